"""What follows from a split: why transitions are coordinated, and what each controller must know."""

from __future__ import annotations

from dataclasses import replace

from support.reference import load_net

from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Coordinated, Decomposition, Part
from firable.nets.knowledge import Because, Knowledge, Reason, knowledge, reasons, split_to_json
from firable.nets.layers import COORDINATOR
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition

A, B = Controller("a"), Controller("b")


def of(decomposition: Decomposition, controller: str) -> Knowledge:
    return next(one for one in knowledge(decomposition) if one.controller == controller)


def test_every_row_of_the_cell_is_there_because_of_its_arcs() -> None:
    found = reasons(split(catalogue_net("one_robot")))
    assert [reason.transition for reason in found] == [f"G{n}" for n in range(1, 10)]
    assert {reason.because for reason in found} == {Because.ARCS}


def test_transition_that_only_a_gate_makes_global_names_the_gate() -> None:
    found = {reason.transition: reason for reason in reasons(split(load_net("remote_gate")))}
    assert found["l"] == Reason("l", Because.GATE, gates=("c2.y",))


def test_transition_that_only_a_signal_makes_global_names_the_signal() -> None:
    net = Net(
        "n",
        (Place("a.p", "a", marked=True), Place("a.g", "a")),
        (Transition("t", ("a.p",), (), ("a.g",), external=(ExternalGate("b.s"), ExternalGate("a.s"))),),
        (Signal("a.s", "a"), Signal("b.s", "b")),
        (A, B),
    )
    assert reasons(split(net)) == (Reason("t", Because.GATE, gates=("b.s",)),)


def test_local_transition_in_a_chain_of_conflicts_names_the_rival_and_the_place_that_join_it() -> None:
    places = (*(Place(f"a.{p}", "a", marked=True) for p in "pqr"), Place("b.x", "b"))
    crossing = Transition("G", ("a.p",), ("b.x",))
    first, second = Transition("l1", ("a.p",), ("a.q",)), Transition("l2", ("a.r",), ("a.q",))
    net = Net("n", places, (second, first, crossing), controllers=(A, B))
    assert reasons(split(net)) == (
        Reason("l2", Because.CONFLICT, rival="l1", place="a.q"),
        Reason("l1", Because.CONFLICT, rival="G", place="a.p"),
        Reason("G", Because.ARCS),
    )


def test_controller_of_the_cell_knows_its_own_things_and_talks_to_the_coordinator_only() -> None:
    robot = of(split(catalogue_net("one_robot")), "robot")
    assert robot.places[:2] == ("robot.free", "robot.to_cv1")
    assert robot.fires == ("t1-a", "t1-b", "t1-c", "t1-d")
    assert robot.votes[:2] == (("G2", "t1-21"), ("G3", "t1-71"))
    assert robot.talks_to == ("system",)
    assert ("robot.touch", "G3") in robot.answers
    assert robot.locks == ()


def test_coordinator_talks_to_everyone_who_votes() -> None:
    assert of(split(catalogue_net("one_robot")), "system").talks_to == ("robot", "mc", "conveyor")


def test_voters_without_a_controller_marked_as_coordinator_talk_to_the_coordinator() -> None:
    decomposition = split(load_net("remote_gate"))
    assert {one.talks_to for one in knowledge(decomposition)} == {(COORDINATOR,)}


def test_owner_of_a_gate_locks_its_source() -> None:
    assert ("c2.y", "l") in of(split(load_net("remote_gate")), "c2").locks


def test_controller_that_votes_on_nothing_talks_to_nobody() -> None:
    places = (Place("a.p", "a", marked=True), Place("a.q", "a"), Place("b.x", "b"))
    rivals = (Transition("t", ("a.p",), ("a.q",)), Transition("u", ("a.p",), ("a.q",)))
    a = of(split(Net("n", places, rivals, controllers=(A, B))), "a")
    assert (a.talks_to, a.fires, len(a.decides)) == ((), ("t", "u"), 1)


def test_local_transition_that_the_coordinator_decides_is_voted_on() -> None:
    decomposition = split(load_net("local_conflict"))
    assert ("l", "l") in of(decomposition, "c1").votes
    assert "l" not in of(decomposition, "c1").fires


def test_undisturbing_parts_share_no_place_in_a_way_that_takes_a_yes_back() -> None:
    robot = of(split(catalogue_net("one_robot")), "robot")
    assert "t1-21" not in robot.undisturbing  # the robot's freedom is taken by another task too
    assert "t1-91" not in robot.undisturbing  # `touch` is cleared by the other grasp too
    done = Command("M", "GO")
    places = (Place("a.p", "a", command=done, completion="a.done"), Place("b.q", "b"))
    crossing = Transition("t", ("a.p",), ("b.q",), external=(ExternalGate("a.done"),))
    net = Net("n", places, (crossing,), (Signal("a.done", "a", SignalKind.COMPLETION),), (A, B))
    assert of(split(net), "a").undisturbing == ("t1-11",)


def test_an_edited_table_makes_it_say_less_and_raises_nothing() -> None:
    decomposition = split(catalogue_net("one_robot"))
    rows = (*decomposition.coordinated, Coordinated("no such", 99, (Part("nobody", "t"), Part("robot", "u"))))
    for edited in (replace(decomposition, coordinated=rows), replace(decomposition, subnets=())):
        split_to_json(edited)
