"""What is printed is read back as the same net."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.reference import cases, load_net, reference_names
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import Holds
from firable.nets.net import (
    Command,
    ExternalGate,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    Transition,
)
from firable.nets.printing import format_net, in_file_order
from firable.nets.text import parse_net


@pytest.mark.parametrize("name", catalogue_names())
def test_a_net_of_the_catalogue_survives_printing(name: str) -> None:
    net = catalogue_net(name)
    back = parse_net(format_net(net))
    assert back == net
    assert back.description == net.description


@pytest.mark.parametrize("name", reference_names())
def test_a_reference_net_survives_printing(name: str) -> None:
    net = load_net(name)
    assert parse_net(format_net(net)) == in_file_order(net)


@given(whole_nets())
@examples(38)
def test_any_net_survives_printing(net: Net) -> None:
    back = parse_net(format_net(net))
    assert back == in_file_order(net)
    assert back.description == net.description
    assert parse_net(format_net(back)) == back


@given(whole_nets())
@examples(25)
def test_file_order_only_reorders(net: Net) -> None:
    ordered = in_file_order(net)
    assert set(ordered.places) == set(net.places)
    assert set(ordered.signals) == set(net.signals)
    own = [t.name for i, t in enumerate(net.transitions) if i not in net.fault_transitions.values()]
    assert [t.name for t in ordered.transitions][: len(own)] == own, "the fault transitions come last, in file order"
    assert {t.name for t in ordered.transitions} == {t.name for t in net.transitions}
    for t in net.transitions:
        assert replace(ordered.transition(t.name), external=()) == replace(t, external=())
        assert set(ordered.transition(t.name).external) == set(t.external)
    assert in_file_order(ordered) == ordered


@given(st.text())
def test_any_description_survives_printing(text: str) -> None:
    net = Net("n", (Place("p", description=text),), description=text)
    back = parse_net(format_net(net))
    assert (back.description, back.places[0].description) == (text, text)


def test_short_entries_stand_on_one_line_and_long_ones_do_not() -> None:
    places = tuple(Place(f"place_number_{i:02}") for i in range(12))
    short = Transition("short", ("place_number_00",), ("place_number_01",))
    long = Transition("long", tuple(place.name for place in places))
    lines = format_net(Net("n", places, (short, long))).splitlines()
    assert "  short: {from: place_number_00, to: place_number_01}" in lines
    assert "  long:" in lines


@pytest.mark.parametrize("name", ["on", "No", "null", "~", "1", "1e3", "true", "y", "0x1F", ".5", "-", "é", "start"])
def test_a_name_that_yaml_could_misread_is_quoted(name: str) -> None:
    net = Net("n", (Place(name, marked=True),), (Transition("t", (name,)),))
    assert parse_net(format_net(net)) == net
    if name != "start":
        assert f'"{name}"' in format_net(net)


DONE = Signal("done", kind=SignalKind.COMPLETION)
MOVE = Command("R", "MOVE")


@pytest.mark.parametrize(
    ("net", "code"),
    [
        (Net("n", (Place("p"),), (Transition("t", ("p",), ("p",)),)), "F2009"),
        (Net("n", signals=(DONE,)), "F2020"),
        (Net("n", (Place("p", command=Command("R", "MOVE", (("machine", "S"),))),)), "F2020"),
        (Net("n", (Place("p", command=Command("R", "")),)), "F2020"),
        (Net("n", (), (Transition("t", number=-1),)), "F2020"),
    ],
)
def test_what_the_format_cannot_say_is_refused(net: Net, code: str) -> None:
    with pytest.raises(InputError) as refused:
        format_net(net)
    assert [problem.code for problem in refused.value.diagnostics] == [code]


def test_an_implied_gate_is_not_printed() -> None:
    net = Net(
        "n",
        (Place("p", command=MOVE, completion="done"),),
        (Transition("t", ("p",), external=(ExternalGate("done"),)),),
        (DONE,),
    )
    assert "if" not in format_net(net)
    assert parse_net(format_net(net)) == net


def test_every_well_formed_case_without_self_loops_survives_printing() -> None:
    for case in cases():
        if case.expect.get("error") or case.expect.get("selfloops"):
            continue
        net = case.net()
        if not any(t.self_loops for t in net.transitions):
            assert parse_net(format_net(net)) == in_file_order(net), str(case)


def test_fairness_other_than_weak_is_printed() -> None:
    text = "firable: 1\ncell: n\nplaces: {p: }\nproperties: {l: {leads_to: {from: p, to: p, fairness: strong}}}\n"
    net = parse_net(text)
    assert "fairness: strong" in format_net(net)
    assert parse_net(format_net(net)) == net
    assert Property("n", PropertyKind.NEVER, Holds("p")).fairness == "weak"
