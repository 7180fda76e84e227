"""What the net file means."""

import pytest

from firable.nets.diagnostics import InputError
from firable.nets.formula import Holds, Start
from firable.nets.net import (
    Arbiter,
    ArbitrationRule,
    Command,
    Controller,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    SignalKind,
    TemporalProperty,
)
from firable.nets.printing import format_net
from firable.nets.temporal import Logic, format_temporal
from firable.nets.text import parse_net

HEAD = "firable: 1\ncell: c\n"


def net(body: str) -> Net:
    return parse_net(HEAD + body)


def test_nesting_is_ownership() -> None:
    found = net(
        "controllers:\n  s: {coordinator: true, description: d, places: {p: }}\n  r: {inputs: x}\nplaces: {q: }\n"
    )
    assert found.controllers == (Controller("s", True, "d"), Controller("r"))
    assert found.places == (Place("s.p", "s"), Place("q"))
    assert [(signal.name, signal.owner, signal.kind) for signal in found.signals] == [("r.x", "r", SignalKind.SENSOR)]


def test_start_is_one_place_or_a_list() -> None:
    found = net("controllers: {r: {start: p, places: {p: , q: }}}\nplaces: {u: , v: , w: }\nstart: [u, w]\n")
    assert [place.name for place in found.places if place.marked] == ["r.p", "u", "w"]


def test_send_keeps_its_parameters_as_they_are_written() -> None:
    found = net("places: {p: {send: {machine: MC, command: RUN, program: 0007, speed: 1.50}}}\n")
    assert found.places[0].command == Command("MC", "RUN", (("program", "0007"), ("speed", "1.50")))


UNTIL = """
controllers:
  r:
    places:
      p: {send: {machine: R, command: GO}, until: there}
      q: {send: {machine: R, command: GO}, until: there}
"""


def test_until_gates_everything_that_takes_the_token_out() -> None:
    found = net(UNTIL + "transitions: {t: {from: r.p}, u: {from: [r.p, r.q]}, v: {to: r.p}}\n")
    assert [place.completion for place in found.places] == ["r.there", "r.there"]
    assert [(signal.name, signal.kind) for signal in found.signals] == [("r.there", SignalKind.COMPLETION)]
    gate = ExternalGate("r.there")
    assert [transition.external for transition in found.transitions] == [(gate,), (gate,), ()]


def test_a_completion_written_again_as_a_gate_changes_nothing() -> None:
    assert net(UNTIL + "transitions: {t: {from: r.p, if: r.there}}\n") == net(UNTIL + "transitions: {t: {from: r.p}}\n")


def test_a_completion_may_gate_other_transitions() -> None:
    found = net(UNTIL + "transitions: {t: {unless: r.there}}\n")
    assert found.transitions[0].external == (ExternalGate("r.there", wanted=False),)


def test_gates_on_places_are_internal_and_gates_on_signals_external() -> None:
    found = net("inputs: [x, y]\nplaces: {p: , q: }\ntransitions: {t: {if: [p, x], unless: [y, q]}}\n").transitions[0]
    assert (found.permissive, found.inhibitive) == (("p",), ("q",))
    assert found.external == (ExternalGate("x"), ExternalGate("y", wanted=False))


def test_a_signal_may_be_wanted_both_ways() -> None:
    assert not net("inputs: x\ntransitions: {t: {if: x, unless: x}}\n").transitions[0].openable


def test_properties_are_patterns_over_formulas() -> None:
    found = net(
        "places: {a: , b: }\nproperties:\n  p: {leads_to: [a, b]}\n"
        "  q: {leads_to: {from: a, to: b, fairness: none}}\n  r: {always_possible: start}\n"
    ).properties
    patterns = [p for p in found if isinstance(p, Property)]
    assert [(p.kind, p.formula, p.then) for p in patterns] == [
        (PropertyKind.LEADS_TO, Holds("a"), Holds("b")),
        (PropertyKind.LEADS_TO, Holds("a"), Holds("b")),
        (PropertyKind.ALWAYS_POSSIBLE, Start(), None),
    ]
    assert [p.fairness for p in patterns[:2]] == [Fairness.WEAK, Fairness.NONE]


def test_a_property_is_a_formula_of_one_of_two_logics() -> None:
    found = net(
        "places: {a: , A: }\nproperties:\n  p: {ctl: 'E[a U AG \"A\"]'}\n"
        "  q:\n    ltl: G (a -> F tokens(a, A) = 0)\n  r: {ltl: a}\n"
    ).properties
    assert [(p.name, p.logic) for p in found if isinstance(p, TemporalProperty)] == [
        ("p", Logic.CTL),
        ("q", Logic.LTL),
        ("r", Logic.LTL),
    ]
    assert [format_temporal(p.formula) for p in found] == [
        'E[a U AG "A"]',
        "G (not a or F tokens(a, A) = 0)",
        "a",
    ]


def test_an_arbiter_is_by_priority_unless_it_says_otherwise() -> None:
    found = net("transitions: {t: {}, u: {}}\narbiters: {a: {among: [u, t]}}\n").arbiters
    assert found == (Arbiter("a", ("u", "t"), ArbitrationRule.PRIORITY),)


def test_numbers_and_names_are_read_as_written() -> None:
    found = net("places: {1: , 0x1F: , 1e3: , 007: }\ntransitions: {t: {number: 12, from: 007}}\n")
    assert [place.name for place in found.places] == ["1", "0x1F", "1e3", "007"]
    assert (found.transitions[0].number, found.transitions[0].inputs) == (12, ("007",))


def test_a_net_may_be_empty() -> None:
    assert net("") == Net("c")


def test_nets_with_long_chains_of_aliases_are_refused_before_they_grow() -> None:
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    with pytest.raises(InputError) as refused:
        net(bomb)
    assert [problem.code for problem in refused.value.diagnostics] == ["F1007"]


def test_a_signal_under_a_controller_is_local_whatever_its_name_begins_with() -> None:
    places = "    places: {up: , down: {send: {machine: P, command: DOWN}, until: press.pressed}}\n"
    found = net("controllers:\n  press:\n    inputs: [press.shut, pressed]\n" + places)
    assert [signal.name for signal in found.signals] == ["press.press.shut", "press.pressed", "press.press.pressed"]
    assert parse_net(format_net(found)) == found  # so a name that begins so cannot be refused
