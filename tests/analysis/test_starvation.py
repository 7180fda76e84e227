"""Starvation under the arbiters: the eager run, who is passed over, and when nothing can be said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.verdicts.starvation import EagerRun, Enabled, GatesCannotBeOpenError, eager_run, starved
from firable.nets.net import Arbiter, ArbitrationRule, ExternalGate, Net, Place, Signal, Transition
from firable.nets.verdict import Status
from firable.semantics.conflict import jointly_openable
from firable.semantics.player import Player
from firable.semantics.trace import Discipline


def two_ways(*arbiters: Arbiter) -> Net:
    """A token that goes from p by t1 to a or by t2 to b, and back."""
    places = (Place("p", marked=True), Place("a"), Place("b"))
    moves = (
        Transition("t1", ("p",), ("a",)),
        Transition("t2", ("p",), ("b",)),
        Transition("t3", ("a",), ("p",)),
        Transition("t4", ("b",), ("p",)),
    )
    return Net("two-ways", places, moves, arbiters=arbiters)


def test_a_fixed_priority_starves_and_rotation_does_not() -> None:
    priority = Arbiter("p", ("t2", "t1"), ArbitrationRule.PRIORITY)
    verdict = check(two_ways(priority)).verdict("starvation")
    assert (verdict.status, verdict.subjects) == (Status.VIOLATED, ("t1", "t3"))
    assert verdict.witness is not None
    assert verdict.witness.cycle == (("t2",), ("t4",))
    rotation = Arbiter("p", ("t2", "t1"), ArbitrationRule.ROTATION)
    assert check(two_ways(rotation)).verdict("starvation").holds


def test_one_that_no_arbiter_names_does_not_take_the_turn_of_those_that_it_names() -> None:
    moves = (
        Transition("t1", ("a",), ("b",)),
        Transition("t2", ("a",), ("b",)),
        Transition("u", ("x",), ("y",)),
        Transition("link", ("a", "x"), ("b", "y")),
        Transition("back", ("b", "y"), ("a", "x")),
    )
    places = (Place("a", marked=True), Place("x", marked=True), Place("b"), Place("y"))
    turn = Arbiter("turn", ("t1", "t2"), ArbitrationRule.ROTATION)
    assert check(Net("rotation", places, moves, arbiters=(turn,))).verdict("starvation").subjects == ("link",)


def test_without_an_arbiter_the_order_of_the_file_is_the_priority() -> None:
    assert check(two_ways()).verdict("starvation").subjects == ("t2", "t4")


def test_a_specified_order_serves_each_as_often_as_it_is_named() -> None:
    run = eager_run(two_ways(Arbiter("o", ("t1", "t1", "t2"), ArbitrationRule.ORDER)))
    fired = [step[0] for step in run.first(12)]
    assert fired == ["t1", "t3", "t1", "t3", "t2", "t4"] * 2


def test_an_effective_conflict_warns_only_where_no_arbiter_names_it() -> None:
    named = check(two_ways(Arbiter("p", ("t2", "t1")))).verdict("effective-conflicts")
    unnamed = check(two_ways()).verdict("effective-conflicts")
    assert (named.status, str(named.weight)) == (Status.VIOLATED, "information")
    assert (unnamed.status, str(unnamed.weight)) == (Status.VIOLATED, "warning")
    assert unnamed.hint == (
        "no arbiter names t1 and t2: the order of the file decides; "
        "add to `arbiters`: `t1_or_t2: {among: [t1, t2], by: rotation}`"
    )


def test_who_competes_beside_an_arbiter_is_bidden_to_stand_in_that_one() -> None:
    net = two_ways(Arbiter("p", ("t2", "t1")))
    net = replace(net, transitions=(*net.transitions, Transition("t5", ("p",), ("a",))))
    found = check(net).verdict("effective-conflicts")
    assert found.hint.endswith("the order of the file decides; name them in `among` of the arbiter 'p', too")


def test_an_arbiter_that_is_offered_names_all_that_compete_there() -> None:
    net = two_ways()
    net = replace(net, transitions=(*net.transitions, Transition("t5", ("p",), ("a",))))
    assert "{among: [t1, t2, t5], by: rotation}" in check(net).verdict("effective-conflicts").hint


@pytest.mark.parametrize(("of_t", "told"), [(True, "t and u"), (False, "u and t")])
def test_gates_that_cannot_all_be_open_leave_starvation_unknown(of_t: bool, told: str) -> None:
    places = (Place("p", marked=True), Place("q"))
    moves = (
        Transition("t", ("p",), ("q",), external=(ExternalGate("s", wanted=of_t),)),
        Transition("u", ("p",), ("q",), external=(ExternalGate("s", wanted=not of_t),)),
        Transition("v", ("q",), ("p",)),
    )
    net = Net("n", places, moves, (Signal("s"),))
    with pytest.raises(GatesCannotBeOpenError):
        eager_run(net)
    verdict = check(net).verdict("starvation")
    assert verdict.status is Status.UNKNOWN
    assert verdict.bound == f"{told} are firable together, and want the signal 's' 1 and 0"
    assert (verdict.method, verdict.code) == ("eager run of synchronous steps under the arbiters", "")


def test_where_no_transition_is_live_none_starves_even_if_no_run_has_all_gates_open() -> None:
    places = (Place("p", marked=True), Place("q"))
    ways = (
        Transition("t", ("p",), ("q",), external=(ExternalGate("s"),)),
        Transition("u", ("p",), ("q",), external=(ExternalGate("s", wanted=False),)),
    )
    net = Net("n", places, ways, (Signal("s"),))
    with pytest.raises(GatesCannotBeOpenError):
        eager_run(net)
    verdict = check(net).verdict("starvation")
    assert (verdict.status, verdict.hint) == (Status.PROVED, "no transition is live, so none starves")


@pytest.mark.parametrize("ends", [True, False])
def test_where_no_transition_is_live_it_is_said_that_none_starves_for_that(ends: bool) -> None:
    places = (Place("p", marked=True), Place("q"), Place("r"))
    there = Transition("t", ("p",), ("q",))
    once = Net("n", places, (there, Transition("u", ("q",), ("r",))))
    again = Net("n", places, (there, Transition("u", ("q",), ("p",))))
    verdict = check(once if ends else again).verdict("starvation")
    assert (verdict.status, verdict.hint) == (Status.PROVED, "no transition is live, so none starves" if ends else "")


def test_a_run_that_is_cut_off_says_so() -> None:
    run = eager_run(two_ways(), steps_max=1)
    assert run == EagerRun((("t1",),), (), complete=False)


def test_a_run_that_was_cut_off_and_a_graph_that_was_leave_starvation_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    of_graph = check(two_ways(), budget=Budget(markings=1), method="explicit").verdict("starvation")
    monkeypatch.setattr(
        "firable.analysis.verdicts.starvation.eager_run",
        lambda net, deadline: eager_run(net, steps_max=1, deadline=deadline),
    )
    of_run = check(two_ways()).verdict("starvation")
    assert (of_graph.status, of_graph.code) == (of_run.status, of_run.code) == (Status.UNKNOWN, "F3004")
    assert of_run.bound == "1 steps of the run"
    assert of_graph.bound.startswith("1 markings found")
    assert of_graph.cost.markings == 1


@examples(75)
@given(ring_nets(), st.sampled_from(Discipline))
def test_the_witness_of_starvation_is_a_run_of_the_graph_that_recurs_without_the_starved(
    net: Net, discipline: Discipline
) -> None:
    graph = explore(net, discipline)
    verdict = check(net, discipline).verdict("starvation")
    run, player = eager_run(net), Player(net)
    marking = net.initial_marking
    for step in run.first(30):
        enabled = player.may_fire(marking)
        assert jointly_openable(net, enabled)
        assert tuple(sorted(net.transition_index[t] for t in step)) in player.maximal_steps(enabled)
        marking = player.fire(marking, [net.transition_index[t] for t in step])
    live = [net.transitions[t].name for t, live in enumerate(graph.engine.live()) if live]
    assert verdict.subjects == starved(run, live)
    if verdict.witness is None:
        steps = [tuple(net.transition_index[t] for t in step) for step in (*run.prefix, *run.cycle)]
        assert not verdict.subjects or not all(map(player.serialisable, steps))
        return
    fired = {name for step in verdict.witness.cycle for name in step}
    assert not fired & set(verdict.subjects)
    if discipline is Discipline.INTERLEAVING:
        assert all(len(step) == 1 for step in (*verdict.witness.firings, *verdict.witness.cycle))


@given(dense_nets(signals=True), st.lists(st.integers(0, 31), min_size=1, max_size=8))
def test_what_is_enabled_in_the_course_of_a_run_is_what_may_fire(net: Net, markings: list[int]) -> None:
    player, first = Player(net), markings[0]
    running = Enabled(net, first)
    assert running.transitions == set(player.may_fire(first))
    for marking in markings[1:]:
        assert running.after(marking) == player.may_fire(marking)
