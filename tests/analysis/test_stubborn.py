"""Stubborn sets leave out markings and nothing that was asked for: compared with the whole reachability graph."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Event
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples, seeds
from support.lively_nets import lively_net, lively_nets, part_of
from support.ring_nets import ring_nets
from support.searched import distance_to, goals, played, satisfies
from support.small_scope import all_nets, net_with

from firable.analysis import _engine, stubborn
from firable.analysis.compiled import nodes_of, rows
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.question import Known
from firable.analysis.reduction.deciding import KnownByReduction
from firable.analysis.spaces.reachability import explore
from firable.analysis.stubborn import decide_by_stubborn_sets, find_deadlocks, find_firings, known_firings
from firable.nets.catalogue.families import family_net
from firable.nets.catalogue.processes import philosophers, philosophers_either
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start, parse_formula
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.semantics.player import Player

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True, most_transitions=5))
UNBOUNDED: dict[str, Any] = {"max_markings": 1 << 20, "max_memory_bytes": 1 << 28, "max_seconds": None}


def deadlocks_of(net: Net, *, thorough: bool) -> set[int]:
    search = _engine.Stubborn(*rows(net)).deadlocks(thorough=thorough, **UNBOUNDED)
    found = [search.marking(i) for i in search.deadlocks()]
    assert search.complete
    assert len(set(found)) == len(found)
    return set(found)


@examples(60)
@given(NETS, st.booleans())
def test_exactly_the_deadlocks_of_the_whole_graph_are_found(net: Net, thorough: bool) -> None:
    graph = explore(net)
    expected = {graph.marking(i) for i in graph.engine.deadlocks()}
    assert deadlocks_of(net, thorough=thorough) == expected
    found = find_deadlocks(net, Limits())
    assert (found.found, found.complete, found.bound) == (len(expected), True, "")
    if expected:
        assert played(net, found.witness) in expected
        assert found.witness is not None
        assert len(found.witness.firings) == distance_to(graph, Deadlock())
    else:
        assert found.witness is None


@examples(30)
@given(st.data())
def test_a_goal_is_reachable_iff_the_whole_graph_reaches_it_and_at_the_same_distance(data: st.DataObject) -> None:
    net = data.draw(NETS)
    graph = explore(net)
    for goal in (data.draw(goals(net)), data.draw(goals(net)), Deadlock()):
        found, distance = decide_by_stubborn_sets(net, goal, Limits()), distance_to(graph, goal)
        assert found.reachable is (distance is not None)
        assert (found.witness is not None) is found.reachable
        if found.witness is not None:
            assert satisfies(net, played(net, found.witness), goal)
            assert len(found.witness.firings) == distance


@examples(50)
@given(NETS)
def test_exactly_the_transitions_that_fire_in_the_whole_graph_are_found_firing(net: Net) -> None:
    fired = explore(net).engine.fired()
    found = find_firings(net, Limits())
    assert found.undecided == ()
    assert found.dead == tuple(t.name for t, count in zip(net.transitions, fired, strict=True) if not count)
    for t in net.transitions:
        witness = found.witness(t.name)
        assert (witness is None) is (t.name in found.dead)
        if witness is not None:
            assert witness.firings[-1] == (t.name,)
            played(net, witness)


class _AfterSoMany(Event):
    """A flag that is set as soon as so many have asked whether it is."""

    def __init__(self, calm: int) -> None:
        super().__init__()
        self.calm = calm

    def is_set(self) -> bool:
        self.calm -= 1
        return self.calm < 0


@pytest.mark.parametrize("calm", range(12))
def test_a_search_for_firings_that_was_ended_goes_on(calm: int, monkeypatch: pytest.MonkeyPatch) -> None:
    net = philosophers_either(8)
    everywhere = tuple(place.name for place in net.places)
    net = replace(net, transitions=(*net.transitions, Transition("never", everywhere)))
    for other in ("_project", "_refute"):  # these need no search to see that so many places are never full together
        monkeypatch.setattr(stubborn.FiringSearch, other, lambda *_: False)
    turns, walk = list[int](), stubborn.FiringSearch._walk

    def walked(search: stubborn.FiringSearch, turn: int) -> None:
        turns.append(turn)
        walk(search, turn)

    monkeypatch.setattr(stubborn.FiringSearch, "_walk", walked)
    search = stubborn.FiringSearch(net)
    ended, before = search.found(Limits(Deadline(cancelled=_AfterSoMany(calm)))), len(turns)
    assert "never" in ended.undecided
    assert "no longer needed" in ended.bound
    found = search.found(Limits())
    assert (found.dead, found.undecided) == (("never",), ())
    assert turns[before] == turns[before - 1], "it goes on with the turn in which it was ended"
    assert turns == sorted(turns)
    for transition in net.transitions[:-1]:
        witness = found.witness(transition.name)
        assert witness is not None
        played(net, witness)


@pytest.mark.parametrize(
    "know", [lambda net: known_firings(net, Limits()), lambda net: KnownByReduction(net)(Limits())]
)
def test_a_verdict_that_a_dead_transition_decides_is_not_kept_back_to_name_others(
    know: Callable[[Net], Mapping[str, Known]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three who share two tools all are never at work; and a counter fires its last transitions after ages."""
    pairs, counter = [(who, tool) for who in "123" for tool in "ab"], family_net("counter-60")
    marked, empty = [*(f"idle{who}" for who in "123"), "free_a", "free_b"], [*(f"busy{who}" for who in "123")]
    places = (Place(name, marked=name in marked) for name in (*marked, *empty, "used_a", "used_b"))
    transitions = (
        Transition("all", permissive=tuple(empty)),
        *(Transition(f"take{i}{j}", (f"idle{i}", f"free_{j}"), (f"busy{i}", f"used_{j}")) for i, j in pairs),
        *(Transition(f"give{i}{j}", (f"busy{i}", f"used_{j}"), (f"idle{i}", f"free_{j}")) for i, j in pairs),
    )
    net = replace(counter, places=(*places, *counter.places), transitions=(*transitions, *counter.transitions))
    walk = stubborn.FiringSearch._walk

    def walked(search: stubborn.FiringSearch, turn: int) -> None:
        assert not search.dead
        walk(search, turn)

    monkeypatch.setattr(stubborn.FiringSearch, "_walk", walked)
    answer = know(net)["quasi-live"].answer
    assert (answer.holds, answer.subjects) == (False, ("all",))


def test_what_fires_for_ever_and_changes_nothing_holds_nobody_up() -> None:
    net = Net("idle", (Place("p"),), (Transition("idle"), Transition("dead", ("p",))))
    found = find_firings(net, Limits())
    assert (found.dead, found.undecided, found.deadlock) == (("dead",), (), None)


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(4))
def test_no_order_that_matters_is_left_out_of_nets_whose_transitions_compete(chunk: int) -> None:
    for seed in seeds(200, chunk):
        draw = random.Random(seed)
        net = lively_net(draw)
        graph, engine = explore(net), _engine.Stubborn(*rows(net))
        expected = {graph.marking(i) for i in graph.engine.deadlocks()}
        goal = part_of(draw, net, graph.marking(draw.randrange(graph.n_markings)))
        for thorough in (False, True):
            assert deadlocks_of(net, thorough=thorough) == expected, seed
            found = engine.reach(nodes_of(net, goal), thorough=thorough, **UNBOUNDED)
            assert found.found is not None, seed
            assert len(found.path_to(found.found)) == distance_to(graph, goal), seed
            firings = engine.fire(list(range(len(net.transitions))), thorough=thorough, **UNBOUNDED).firable()
            assert [at is not None for at in firings] == [n > 0 for n in graph.engine.fired()], seed


@pytest.mark.parametrize("chunk", range(4))
def test_deadlocks_and_firings_of_every_net_of_the_small_scope(chunk: int) -> None:
    seen = 0
    # All nets with one transition, and every 20th with two: initial markings of all of them.
    for chosen in [*all_nets(2, 1), *all_nets(2, 2, 5 * chunk, 20)]:
        for initial in range(4):
            net = net_with(2, chosen, initial)
            graph = explore(net)
            expected = {graph.marking(i) for i in graph.engine.deadlocks()}
            assert deadlocks_of(net, thorough=bool(initial % 2)) == expected, (chosen, initial)
            search = _engine.Stubborn(*rows(net)).fire(list(range(len(chosen))), **UNBOUNDED)
            assert [at is not None for at in search.firable()] == [count > 0 for count in graph.engine.fired()]
            seen += 1
    assert seen > 3000


def machines(n: int) -> Net:
    places = tuple(Place(f"{kind}{i}", marked=kind == "idle") for i in range(n) for kind in ("idle", "busy"))
    moves = tuple(Transition(f"start{i}", (f"idle{i}",), (f"busy{i}",)) for i in range(n))
    return Net("machines", places, moves)


def test_independent_firings_are_followed_in_one_order() -> None:
    found = find_deadlocks(machines(40), Limits())
    assert (found.found, found.complete, found.cost.markings) == (1, True, 41)


def test_a_goal_far_from_most_of_the_net_fires_nothing_else() -> None:
    goal = And((Holds("busy7"), Holds("busy9")))
    found = decide_by_stubborn_sets(machines(40), goal, Limits())
    assert found.witness is not None
    assert {t for (t,) in found.witness.firings} == {"start7", "start9"}
    assert found.cost.markings == 3


def test_who_reads_a_place_and_who_empties_it_are_not_independent() -> None:
    # `read` needs p, `take` empties it: only read before take leads to both q and r.
    places = (Place("p", marked=True), Place("a", marked=True), *map(Place, "qr"))
    net = Net("n", places, (Transition("take", ("p",), ("r",)), Transition("read", ("a",), ("q",), ("p",))))
    found = decide_by_stubborn_sets(net, parse_formula("q and r"), Limits())
    assert found.witness is not None
    assert found.witness.firings == (("read",), ("take",))


def test_who_fills_a_place_and_who_is_inhibited_by_it_are_not_independent() -> None:
    places = (Place("a", marked=True), Place("b", marked=True), *map(Place, "pq"))
    net = Net("n", places, (Transition("fill", ("b",), ("p",)), Transition("move", ("a",), ("q",), (), ("p",))))
    assert decide_by_stubborn_sets(net, parse_formula("p and q"), Limits()).reachable
    assert find_deadlocks(net, Limits()).found == 2


def test_two_that_fill_one_place_are_not_independent() -> None:
    places = (Place("a", marked=True), Place("b", marked=True), Place("p"))
    net = Net("n", places, (Transition("t", ("a",), ("p",)), Transition("u", ("b",), ("p",))))
    assert find_deadlocks(net, Limits()).found == 2


def test_a_transition_that_is_never_disabled_leaves_no_deadlock_and_nothing_to_search() -> None:
    net = Net("n", machines(20).places, (*machines(20).transitions, Transition("tick")))
    found = find_deadlocks(net, Limits())
    assert (found.found, found.complete, found.cost.markings) == (0, True, 1)


def test_gates_that_can_never_open_make_a_transition_dead() -> None:
    both = (ExternalGate("s"), ExternalGate("s", wanted=False))
    never = Transition("never", ("p",), ("q",), external=both)
    net = Net("n", (Place("p", marked=True), Place("q")), (never,), (Signal("s"),))
    assert find_firings(net, Limits()).dead == ("never",)
    assert find_deadlocks(net, Limits()).found == 1
    assert decide_by_stubborn_sets(net, Firable("never"), Limits()).reachable is False


def test_formula_deeper_than_the_stack_is_decided() -> None:
    goal: Formula = Holds("busy0")
    for i in range(5_000):
        goal = (And if i % 3 else Or)((Not(Not(goal)), Holds("busy1")))
    found = decide_by_stubborn_sets(machines(3), goal, Limits())
    assert found.witness is not None
    assert set(found.witness.firings) <= {("start0",), ("start1",)}


@pytest.mark.parametrize(("goal", "firings"), [(Constant(True), 0), (Start(), 0), (Constant(False), None)])
def test_constants_are_goals(goal: Formula, firings: int | None) -> None:
    found = decide_by_stubborn_sets(machines(3), goal, Limits())
    assert found.reachable is (firings is not None)
    assert found.witness is None or len(found.witness.firings) == firings


CANCELLED = Event()
CANCELLED.set()


@pytest.mark.parametrize(
    ("limits", "why"),
    [
        (Limits(Deadline.after(0)), "time"),
        (Limits(Deadline(cancelled=CANCELLED)), "no longer needed"),
        (Limits(memory_bytes=500_000), "memory"),
        (Limits(memory_bytes=1_000), "memory"),
    ],
)
def test_a_budget_that_ends_leaves_the_question_open_and_says_how_far_it_came(
    limits: Limits, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    net = philosophers_either(14)
    never = And(tuple(Holds(place.name) for place in net.places))
    found = decide_by_stubborn_sets(net, never, limits)
    assert (found.reachable, found.witness, why in found.bound) == (None, None, True)
    deadlocks = find_deadlocks(net, limits)
    assert not deadlocks.complete
    assert why in deadlocks.bound
    stuck = replace(net, transitions=(*net.transitions, Transition("never", tuple(p.name for p in net.places))))
    for other in ("_project", "_refute"):  # these need no search to see that so many places are never full together
        monkeypatch.setattr(stubborn.FiringSearch, other, lambda *_: False)
    firings = find_firings(stuck, limits)
    assert "never" in firings.undecided
    assert why in firings.bound


def test_budgets_of_markings_that_end_are_followed_by_larger_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stubborn, "_BUDGETS", ((5, 3), (7, 9)))
    found = find_deadlocks(philosophers(5), Limits())
    assert (found.found, found.complete) == (1, True)
    # 5 + 3 + 7 + 9 markings of the searches that ended early are told too.
    assert (found.cost.markings or 0) > 24


def test_negation_normal_form_shares_what_is_equal() -> None:
    net = Net("n", tuple(map(Place, "abc")))
    once = nodes_of(net, parse_formula("(a or b) and c"))
    assert nodes_of(net, parse_formula("((a or b) and c) and not not (b or a or b)")) != []
    assert nodes_of(net, parse_formula("((a or b) and c) and (a or b)")) == once
    assert nodes_of(net, parse_formula("a and not a or true")) == [(2, [])]
    assert nodes_of(net, parse_formula("false and a")) == [(3, [])]


def test_engine_refuses_what_is_no_formula_and_no_transition() -> None:
    engine = _engine.Stubborn(*rows(machines(2)))
    refused: tuple[list[tuple[int, list[int]]], ...] = (
        [],
        [(0, [4])],
        [(0, [])],
        [(1, [0, 1])],
        [(4, [])],
        [(3, [0])],
        [(0, [0]), (2, [1])],
    )
    for nodes in refused:
        with pytest.raises(ValueError, match=r"node|place|operand"):
            engine.reach(nodes, max_markings=9, max_memory_bytes=1 << 20, max_seconds=None)
    with pytest.raises(IndexError):
        engine.fire([2], max_markings=9, max_memory_bytes=1 << 20, max_seconds=None)
    search = engine.fire([1], max_markings=9, max_memory_bytes=1 << 20, max_seconds=None)
    for outside in (search.marking, search.path_to):
        with pytest.raises(IndexError):
            outside(9)


def test_a_callable_that_raises_comes_out() -> None:
    def cancelled() -> bool:
        raise LookupError

    engine = _engine.Stubborn(*rows(philosophers_either(14)))
    with pytest.raises(LookupError):
        engine.deadlocks(max_markings=1 << 30, max_memory_bytes=1 << 30, max_seconds=None, cancelled=cancelled)


@examples(25)
@given(ring_nets())
def test_the_markings_of_a_reduced_graph_are_reachable_ones(net: Net) -> None:
    reachable = Player(net).reachable()
    search = _engine.Stubborn(*rows(net)).deadlocks(**UNBOUNDED)
    assert {search.marking(i) for i in range(search.n_markings)} <= set(reachable)
