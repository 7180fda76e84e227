"""The split by ownership, the coordinator table, and the join that undoes the split."""

from dataclasses import replace

import pytest
from support.published import COORDINATOR_TABLE
from support.reference import Case, cases, load_net

from firable.decompose.splitting.cut import participants, split, unowned
from firable.decompose.splitting.table import table_text
from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.decomposition import Decomposition, Part
from firable.nets.diagnostics import InputError
from firable.nets.joining import join
from firable.nets.net import Arbiter, Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition

ALL_NETS = [
    *("cell1", "cell1_mc_late", "cell1_mc_late_cap", "cell2_separate", "cell2_shared", "conceptual1", "fig2a", "fig2b"),
    *("fig4_parallel", "local_conflict", "local_gate", "local_output_conflict", "no_trouble", "read_before_order"),
    *("remote_gate", "ring"),
]


def as_numbered(net: Net, decomposition: Decomposition) -> Net:
    numbers = {row.name: row.number for row in decomposition.coordinated}
    return replace(net, transitions=tuple(replace(t, number=numbers.get(t.name, t.number)) for t in net.transitions))


def codes(net: Net) -> list[tuple[str, tuple[str, ...]]]:
    with pytest.raises(InputError) as refusal:
        split(net)
    assert all(diagnostic.hint for diagnostic in refusal.value.diagnostics)
    return [(diagnostic.code, diagnostic.subject) for diagnostic in refusal.value.diagnostics]


def test_coordinator_table_of_the_cell_is_the_published_one() -> None:
    assert table_text(split(load_net("cell1")).table) == COORDINATOR_TABLE


def test_coordinator_table_of_the_cell_in_the_catalogue_is_the_published_one() -> None:
    decomposition = split(catalogue_net("one_robot"))
    assert table_text(decomposition.table) == COORDINATOR_TABLE
    assert [subnet.name for subnet in decomposition.subnets] == ["system", "robot", "mc", "conveyor"]


@pytest.mark.parametrize("name", catalogue_names())
def test_every_net_of_the_catalogue_is_split_and_joined_back(name: str) -> None:
    net = catalogue_net(name)
    assert join(split(net)) == net


@pytest.mark.parametrize("case", [case for case in cases() if "table" in case.expect], ids=str)
def test_coordinator_table_is_that_of_the_case(case: Case) -> None:
    table = {row.name: [part.name for part in row.parts] for row in split(case.net()).table}
    assert table == case.expect["table"]


@pytest.mark.parametrize("case", [case for case in cases() if "unowned" in case.expect], ids=str)
def test_transitions_without_participants_are_those_of_the_case(case: Case) -> None:
    assert list(unowned(case.net())) == case.expect["unowned"]
    with pytest.raises(InputError, match="F4001"):
        split(case.net())


def test_net_without_global_transitions_has_an_empty_table() -> None:
    assert table_text(split(load_net("fig4_parallel")).table) == ""


@pytest.mark.parametrize("name", ALL_NETS)
def test_join_undoes_the_split(name: str) -> None:
    net = load_net(name)
    decomposition = split(net)
    assert join(decomposition) == as_numbered(net, decomposition)


def test_subnet_holds_what_its_controller_owns_in_the_order_of_the_net() -> None:
    net = load_net("cell1")
    robot = split(net).subnet("c1")
    assert [place.name for place in robot.places] == [p.name for p in net.places if p.owner == "c1"]
    assert [t.name for t in robot.transitions] == [
        *("t1-21", "t1-71", "t1-81", "t1-31", "t1-41", "t1-91", "t1-51"),
        *("t1-a", "t1-b", "t1-c", "t1-d"),
    ]
    part = robot.transition("t1-71")
    assert (part.inputs, part.outputs) == (("c1.R_grasp_CV1",), ("c1.R_to_MC_full",))
    assert part.external == (ExternalGate("c1.r.touch"),)
    assert robot.place("c1.R_put_MC").command == Command("R", "PUT", (("at", "MC"),))
    assert [controller.name for controller in robot.controllers] == ["c1"]


def test_controller_that_owns_only_a_gate_takes_part_without_moving_a_token() -> None:
    net = load_net("remote_gate")
    decomposition = split(net)
    assert participants(net, net.transition("l")) == ("c1", "c2")
    assert [row.parts for row in decomposition.table] == [
        (Part("c1", "t1-11"), Part("c2", "t2-12")),
        (Part("c1", "t1-21"), Part("c2", "t2-22")),
    ]
    voter = decomposition.subnet("c2").transition("t2-12")
    assert (voter.inputs, voter.outputs, voter.inhibitive) == ((), (), ("c2.y",))


def test_signal_owner_takes_part() -> None:
    net = Net(
        "n",
        (Place("a.p", "a", marked=True),),
        (Transition("t", ("a.p",), external=(ExternalGate("b.s", wanted=False),)),),
        (Signal("b.s", "b"),),
        (Controller("a"), Controller("b")),
    )
    decomposition = split(net)
    assert decomposition.table[0].parts == (Part("a", "t1-11"), Part("b", "t2-12"))
    assert decomposition.subnet("b").transition("t2-12").external == (ExternalGate("b.s", wanted=False),)


def test_local_rival_of_a_global_transition_is_decided_by_the_coordinator() -> None:
    decomposition = split(load_net("local_conflict"))
    assert [(row.name, row.is_global, row.parts) for row in decomposition.coordinated] == [
        ("G", True, (Part("c1", "t1-11"), Part("c2", "t2-12"))),
        ("l", False, (Part("c1", "l"),)),
    ]
    assert [row.name for row in decomposition.table] == ["G"]
    (group,) = decomposition.groups
    assert (group.sequence, group.rest, group.controller) == ((), ("G", "l"), None)


def test_conflict_among_local_transitions_is_decided_by_their_controller() -> None:
    net = Net(
        "n",
        (Place("a.p", "a", marked=True), Place("a.x", "a"), Place("a.y", "a")),
        (Transition("t", ("a.p",), ("a.x",)), Transition("u", ("a.p",), ("a.y",))),
        controllers=(Controller("a"), Controller("b")),
        arbiters=(Arbiter("next", ("u", "t")),),
    )
    decomposition = split(net)
    assert decomposition.coordinated == ()
    (group,) = decomposition.groups
    assert (group.name, group.sequence, group.rest, group.controller) == ("next", ("u", "t"), (), "a")
    assert decomposition.subnet("b").transitions == ()


def test_unnumbered_global_transitions_get_the_next_free_numbers_in_order() -> None:
    def across(name: str, number: int | None) -> Transition:
        return Transition(name, (f"a.{name}",), (f"b.{name}",), number=number)

    names = {"g": None, "h": 1, "i": None, "j": 3, "k": None}
    places = tuple(Place(f"{owner}.{name}", owner) for name in names for owner in ("a", "b"))
    local = Transition("l", ("a.g",), number=2)
    net = Net("n", places, (*map(across, names, names.values()), local), (), (Controller("a"), Controller("b")))
    decomposition = split(net)
    assert [(row.name, row.number) for row in decomposition.table] == [("g", 4), ("h", 1), ("i", 5), ("j", 3), ("k", 6)]
    assert decomposition.table[0].parts == (Part("a", "t1-41"), Part("b", "t2-42"))


def test_everything_without_an_owner_is_reported_at_once() -> None:
    net = Net("n", (Place("p"),), (Transition("t", ("p",)), Transition("u")), (Signal("s"),))
    assert unowned(net) == ("t", "u")
    assert codes(net) == [
        ("F2011", ("places", "p")),
        ("F2011", ("signals", "s")),
        ("F4001", ("transitions", "u")),
    ]


def test_local_transition_with_the_name_of_a_part_is_refused() -> None:
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    crossing = Transition("G", ("a.p",), ("b.q",))
    controllers = (Controller("a"), Controller("b"))
    named = Net("n", places, (crossing, Transition("t2-12", ("b.q",))), controllers=controllers)
    assert codes(named) == [("F4001", ("transitions", "t2-12"))]
    # The name of the whole is not kept in the subnets, so a global transition may bear it.
    whole = Net("n", places, (replace(crossing, name="t2-12"),), controllers=controllers)
    assert split(whole).table[0].parts[1] == Part("b", "t2-12")


@pytest.mark.parametrize("name", ["life/dies", "hold/G/a", "vote/G"])
def test_names_that_proofs_could_give_to_what_they_add_are_refused(name: str) -> None:
    """Or `life/dies` would be a transition of the net and the death of a host."""
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    net = Net("n", places, (Transition(name, ("a.p",), ("b.q",)),), controllers=(Controller("a"), Controller("b")))
    assert codes(net) == [("F4001", ("transitions", name))]
    owned = Place(f"{name}.p", name, marked=True)
    crossing = Transition("G", (owned.name,), ("b.q",))
    net = Net("n", (owned, places[1]), (crossing,), controllers=(Controller(name), Controller("b")))
    assert codes(net) == [("F4001", ("controllers", name))]


def test_completion_signal_of_another_controller_is_refused() -> None:
    net = Net(
        "n",
        (Place("a.p", "a", command=Command("M", "GO"), completion="b.done"),),
        (Transition("t", ("a.p",), external=(ExternalGate("b.done"),)),),
        (Signal("b.done", "b", SignalKind.COMPLETION),),
        (Controller("a"), Controller("b")),
    )
    assert codes(net) == [("F4001", ("places", "a.p", "until"))]


def test_negative_number_is_refused() -> None:
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    crossing = Transition("G", ("a.p",), ("b.q",), number=-1)
    net = Net("n", places, (crossing,), controllers=(Controller("a"), Controller("b")))
    assert codes(net) == [("F4001", ("transitions", "G", "number"))]


def test_the_coordinator_is_number_0_wherever_it_stands_in_the_file() -> None:
    places = (Place("robot.p", "robot", marked=True), Place("system.q", "system"))
    crossing = Transition("t", ("robot.p",), ("system.q",))
    controllers = (Controller("robot"), Controller("system", coordinator=True))
    row = split(Net("n", places, (crossing,), controllers=controllers)).table[0]
    assert row.parts == (Part("system", "t0-1"), Part("robot", "t1-11"))
