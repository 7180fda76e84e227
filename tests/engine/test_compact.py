"""The compact search against the graph: the same counts, the same distances, without the graph."""

from __future__ import annotations

import random
from itertools import pairwise
from typing import Any

import pytest
from support.lively_nets import lively_net

from firable.analysis import _engine
from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import nodes_of, rows
from firable.analysis.spaces.columns import first
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.analysis.spaces.space import Witnesses
from firable.nets.catalogue import family_net
from firable.nets.formula import And, Formula, Holds
from firable.nets.net import Net, Place, Transition
from firable.semantics.trace import Discipline


def searched(net: Net, goals: list[Formula], **options: Any) -> _engine.Compact:
    limits: dict[str, Any] = {"max_memory_bytes": 1 << 24, "max_seconds": None}
    return _engine.explore_compactly(*rows(net), [nodes_of(net, goal) for goal in goals], **(limits | options))


def reached(net: Net, way: list[int] | None) -> int:
    assert way is not None
    return Witnesses(net, Discipline.INTERLEAVING).play(net.initial_marking, [(t,) for t in way])


def agrees(net: Net, graph: ReachabilityGraph) -> None:
    names = [place.name for place in net.places]
    goals: list[Formula] = [And((Holds(p), Holds(q))) for p, q in pairwise(names)]
    search = searched(net, goals)
    assert search.complete
    assert (search.n_markings, search.n_edges, search.n_levels) == (
        graph.n_markings,
        graph.n_edges,
        graph.engine.n_levels,
    )
    assert (search.fired(), search.contacts()) == (graph.engine.fired(), graph.engine.contacts())
    assert search.n_deadlocks == len(graph.engine.deadlocks())
    for number, goal in enumerate(goals):
        column = graph.satisfying(goal)
        index = first(column)
        way = search.way_to_goal(number)
        assert search.goals()[number] is (index is not None)
        if index is None:
            assert way is None
            continue
        assert way is not None
        assert len(way) == len(graph.engine.path_to(index))
        assert column[graph.engine.find(reached(net, way))]
    if graph.engine.deadlocks():
        end = graph.engine.find(reached(net, search.way_to_deadlock()))
        assert end in graph.engine.deadlocks()
    else:
        assert search.way_to_deadlock() is None


@pytest.mark.parametrize("chunk", range(4))
def test_a_compact_search_counts_what_the_graph_counts_on_lively_nets(chunk: int) -> None:
    for seed in range(60 * chunk, 60 * (chunk + 1)):
        net = lively_net(random.Random(seed))
        agrees(net, explore(net))


@pytest.mark.parametrize("name", ["philosophers-7", "philosophers_either-6", "slotted_ring-3", "interlocked-6"])
def test_a_compact_search_counts_what_the_graph_counts_on_families(name: str) -> None:
    net = family_net(name)
    agrees(net, explore(net))


def test_a_marking_takes_eight_bytes_at_most() -> None:
    search = searched(family_net("philosophers-13"), [])
    assert search.memory_bytes / search.n_markings <= 16, "of so few, what is held besides counts"
    large = searched(family_net("machines-19"), [])
    assert large.memory_bytes / large.n_markings <= 12


def test_a_search_until_its_goals_are_met_is_no_search_of_all() -> None:
    net = family_net("machines-16")
    busy = next(place.name for place in net.places if not place.marked)
    search = searched(net, [Holds(busy)], until_met=True)
    assert not search.complete
    assert search.reason is None
    assert search.goals() == [True]
    assert search.n_markings < 1000
    way = search.way_to_goal(0)
    assert way is not None
    assert len(way) == 1


def test_budgets_end_a_compact_search() -> None:
    net = family_net("machines-18")
    assert searched(net, [], max_memory_bytes=100_000).reason == "memory"
    assert searched(net, [], max_memory_bytes=100).reason == "memory"
    assert searched(net, [], max_seconds=0.0).reason == "time"
    assert searched(net, [], cancelled=lambda: True).reason == "cancelled"


def test_a_net_of_more_than_sixty_determining_places_is_refused() -> None:
    places = (Place("p0", marked=True), *(Place(f"p{i}") for i in range(1, 62)))
    chain = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(61))
    with pytest.raises(BudgetExceeded, match="more than 60 places"):
        searched(Net("chain", places, chain), [])
    shorter = searched(Net("chain", places, chain[:60]), [])
    assert (shorter.n_markings, shorter.complete) == (61, True)


def test_a_goal_that_was_not_asked_for_is_refused() -> None:
    search = searched(family_net("machines-2"), [])
    with pytest.raises(IndexError, match="there is no goal 0 of 0"):
        search.way_to_goal(0)
