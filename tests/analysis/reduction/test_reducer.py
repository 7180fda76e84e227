"""What is kept of a net between questions changes no answer, and what time ended is not kept."""

from dataclasses import replace
from threading import Event
from time import monotonic, sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cell_nets import cell_nets
from support.dense_nets import dense_nets
from support.examples import examples
from support.lively_nets import lively_nets
from support.naive_space import NaiveSpace
from support.whole_nets import formulas

from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.reduction import reduce
from firable.analysis.reduction.deciding import ByReduction, decide_by_exploring
from firable.analysis.reduction.pairs import Pairs
from firable.analysis.reduction.reduce import reduce_for_goal
from firable.analysis.reduction.reducer import Reducer
from firable.nets.catalogue.families import family_net
from firable.nets.formula import Formula, Holds, Not, parse_formula
from firable.nets.net import Net
from firable.semantics.player import Player

NETS = st.one_of(cell_nets(), lively_nets(), dense_nets(signals=True))
NET = family_net("pipeline-8")
GOALS = [Holds(place.name) for place in NET.places[:3]]


@pytest.fixture
def proved(monkeypatch: pytest.MonkeyPatch) -> list[Net]:
    """The nets that facts are proved of."""
    nets, prove = list[Net](), reduce.facts_on

    def facts_on(net: Net, limits: Limits) -> Pairs | None:
        nets.append(net)
        return prove(net, limits)

    monkeypatch.setattr(reduce, "facts_on", facts_on)
    return nets


@examples(30)
@given(st.data(), NETS)
def test_goals_one_after_the_other_are_decided_as_in_the_naive_space(data: st.DataObject, net: Net) -> None:
    names = [place.name for place in net.places], [transition.name for transition in net.transitions]
    asked, naive = ByReduction(net), NaiveSpace(net)
    for goal in data.draw(st.lists(formulas(*names), min_size=2, max_size=4)):
        expected = naive.witness(naive.satisfying(goal)) is not None
        assert asked(goal, Limits()).reachable is expected
        assert asked(goal, Limits()).reachable is expected
        explored = decide_by_exploring(net, goal, Limits())
        assert explored.reachable is expected
        assert (explored.witness is not None) is expected


def test_facts_are_proved_once_for_all_questions_but_the_first_goal(proved: list[Net]) -> None:
    reducer = Reducer(NET)
    assert reducer.for_goal(GOALS[0], Limits()) == reduce_for_goal(NET, GOALS[0])
    assert proved == []
    before = reducer.takes_seconds
    assert reducer.for_goal(GOALS[1], Limits()).net == reduce_for_goal(NET, GOALS[1]).net
    assert proved == [NET]
    assert reducer.takes_seconds < before
    reducer.for_runs(GOALS, Limits())
    reducer.for_branches(GOALS, Limits())
    assert proved == [NET]


def test_a_reduction_that_came_to_its_end_is_kept_and_one_that_time_ended_is_not(proved: list[Net]) -> None:
    reducer, over = Reducer(NET), Limits(Deadline.after(0))
    hasty = reducer.for_branches(GOALS, over)
    assert len(hasty.net.places) == len(NET.places)
    found = reducer.for_branches(GOALS, Limits())
    assert len(found.net.places) < len(NET.places)
    assert len(proved) == 2  # time had ended the first proof, too
    assert reducer.for_branches(GOALS, Limits()) is found
    assert reducer.for_branches(GOALS, over) is found
    assert reducer.for_branches(GOALS, Limits()) is found
    goal, runs = reducer.for_goal(GOALS[0], Limits()), reducer.for_runs(GOALS, Limits())
    assert reducer.for_goal(GOALS[0], Limits()) is goal
    assert reducer.for_runs(GOALS, Limits()) is runs


@pytest.mark.parametrize(
    ("bound", "most"), [("_KEPT_MAX", 2), ("_KEPT_SIZE_MAX", 2 * (len(NET.places) + len(NET.transitions) + 1))]
)
def test_of_many_reductions_the_last_ones_are_kept(monkeypatch: pytest.MonkeyPatch, bound: str, most: int) -> None:
    monkeypatch.setattr(f"firable.analysis.reduction.reducer.{bound}", most)
    reducer = Reducer(NET)
    first, second = (reducer.for_goal(one, Limits()) for one in GOALS[:2])
    assert reducer.for_goal(GOALS[0], Limits()) is first
    reducer.for_goal(GOALS[2], Limits())
    assert reducer.for_goal(GOALS[0], Limits()) is first
    assert reducer.for_goal(GOALS[1], Limits()) is not second


def test_a_proof_that_takes_too_long_costs_a_part_of_a_turn_and_is_tried_again_with_twice_the_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[float] = []

    def until_over(net: Net, limits: Limits) -> None:
        tried.append(limits.deadline.left_seconds or 0.0)
        while not limits.deadline.over:
            sleep(0.001)

    monkeypatch.setattr(reduce, "facts_on", until_over)
    cancelled = Event()
    cancelled.set()
    reducer = Reducer(NET)
    reducer.for_branches(GOALS, Limits(Deadline(monotonic() + 600, cancelled)))
    tried.clear()
    for seconds, times in ((1.0, 1), (1.0, 1), (1.2, 1), (3.0, 2)):
        limits = Limits(Deadline.after(seconds))
        found = reducer.for_branches([GOALS[0], GOALS[times]], limits)
        assert len(tried) == times
        assert not limits.deadline.over
        assert len(found.net.places) < len(NET.places)
    there = reducer.at(NET.initial_marking)
    there.for_branches(GOALS, Limits(Deadline.after(1.2)))
    assert len(tried) == 2


def test_a_net_that_no_facts_are_proved_of_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Net] = []
    monkeypatch.setattr(reduce, "facts_on", lambda net, _: tried.append(net))
    reducer = Reducer(NET)
    before = reducer.takes_seconds
    for _ in range(2):
        reducer.for_runs(GOALS, Limits(Deadline.after(60)))
        reducer.for_branches(GOALS, Limits())
        reducer.at(NET.initial_marking).for_branches(GOALS, Limits())
    assert len(tried) == 1
    assert reducer.takes_seconds < before


def test_of_a_net_that_begins_elsewhere_the_same_facts_are_true(proved: list[Net]) -> None:
    reducer, player = Reducer(NET), Player(NET)
    labels: list[Formula] = [Holds(NET.places[0].name), Not(Holds(NET.places[1].name))]
    reducer.for_branches(labels, Limits())
    marking = player.fire(NET.initial_marking, player.may_fire(NET.initial_marking)[:1])
    there = reducer.at(marking)
    assert there.net.initial_marking == marking
    assert replace(there.net, places=NET.places) == NET
    there.for_branches(labels, Limits())
    assert proved == [NET]


def test_exploring_decides_nothing_of_what_it_has_not_seen_and_finds_what_it_has() -> None:
    net = family_net("counter-17")
    near, never = parse_formula("counter.one0"), parse_formula("counter.one0 and counter.zero0")
    for limits in (Limits(Deadline.after(0)), Limits(memory_bytes=1), Limits(memory_bytes=2**20)):
        found = decide_by_exploring(net, never, limits)
        assert found.reachable is None
        assert found.bound
    assert decide_by_exploring(net, never, Limits()).reachable is False
    found = decide_by_exploring(net, near, Limits(memory_bytes=2**20))
    assert found.reachable
    assert found.witness is not None
    assert len(found.witness.firings) == 1
