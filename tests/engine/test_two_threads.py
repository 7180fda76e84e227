"""Exploration on two threads against exploration on one: the same graph, in a numbering that never changes."""

from __future__ import annotations

from typing import Any

import pytest

from firable.analysis import _engine
from firable.analysis.compiled import rows
from firable.analysis.spaces.reachability import explore as explore_net
from firable.nets.catalogue import family_net
from firable.nets.net import Net, Place, Transition

NAMES = ["machines-15", "philosophers-11", "interlocked-9", "slotted_ring-4", "pipeline-15"]
"""Families with levels that are worth two threads."""


def explored(name: str, *, spare: int = 0, **options: Any) -> _engine.Graph:
    n_places, transitions, initial = rows(family_net(name))
    limits: dict[str, Any] = {"max_markings": 1 << 20, "max_memory_bytes": 1 << 30, "max_seconds": None}
    return _engine.explore(n_places + spare, transitions, initial, **(limits | options))


def chained(count: int) -> Net:
    """Machines that each have a counter of their own: so many places that no key holds the tokens that matter."""
    places = [Place(f"p{i}{k}", marked=k == 0) for i in range(count) for k in range(9)]
    transitions = [Transition(f"t{i}{k}", (f"p{i}{k}",), (f"p{i}{k + 1}",)) for i in range(count) for k in range(8)]
    return Net("chains", tuple(places), tuple(transitions))


def sets_of(graph: _engine.Graph) -> tuple[set[int], set[int]]:
    deadlocks = {graph.marking(index) for index in graph.deadlocks()}
    return {graph.marking(index) for index in range(0, graph.n_markings, 7)}, deadlocks


@pytest.mark.parametrize("spare", [0, 60, 300])
@pytest.mark.parametrize("name", NAMES)
def test_two_threads_find_the_graph_that_one_finds(name: str, spare: int) -> None:
    one, two = explored(name, spare=spare), explored(name, spare=spare, threads=2)
    assert (one.n_markings, one.n_edges, one.n_levels) == (two.n_markings, two.n_edges, two.n_levels)
    assert (one.complete, one.fired(), one.contacts()) == (two.complete, two.fired(), two.contacts())
    assert len(one.deadlocks()) == len(two.deadlocks())
    some, deadlocks = sets_of(one)
    assert all(two.find(marking) is not None for marking in some)
    assert deadlocks == sets_of(two)[1]
    assert (one.reversible(), one.live()) == (two.reversible(), two.live())


@pytest.mark.parametrize("name", NAMES)
def test_an_index_of_two_threads_is_a_distance_rank(name: str) -> None:
    one, two = explored(name), explored(name, threads=2)
    for index in range(0, two.n_markings, two.n_markings // 40):
        there = one.find(two.marking(index))
        assert there is not None
        assert len(two.path_to(index)) == len(one.path_to(there))


def test_markings_of_more_places_than_a_key_holds_are_shared_out_too() -> None:
    n_places, transitions, initial = rows(chained(9))
    limits: dict[str, Any] = {"max_markings": 200_000, "max_memory_bytes": 1 << 30, "max_seconds": None}
    one, two = (_engine.explore(n_places, transitions, initial, threads=n, **limits) for n in (1, 2))
    assert one.n_markings == two.n_markings == 200_000
    assert len({two.marking(index) for index in range(0, 200_000, 11)}) == len(range(0, 200_000, 11))
    assert all(two.find(two.marking(index)) == index for index in range(0, 200_000, 101))


@pytest.mark.parametrize("name", NAMES)
def test_the_numbering_of_two_threads_is_a_function_of_the_net(name: str) -> None:
    first = explored(name, threads=2)
    again = explored(name, threads=2)
    assert first.markings_bytes() == again.markings_bytes()
    assert first.deadlocks() == again.deadlocks()


def test_levels_that_begin_while_no_second_processor_is_free_are_explored_by_one() -> None:
    alone = explored("machines-15", threads=2, second_free=lambda: False)
    assert alone.markings_bytes() == explored("machines-15").markings_bytes()
    assert alone.markings_bytes() != explored("machines-15", threads=2).markings_bytes()


def test_what_asking_for_the_second_processor_raises_comes_out() -> None:
    def broken() -> bool:
        raise LookupError("nobody knows")

    with pytest.raises(LookupError, match="nobody knows"):
        explored("machines-20", threads=2, second_free=broken, max_markings=1 << 21)


@pytest.mark.parametrize("budget", [{"max_markings": 20_000}, {"max_memory_bytes": 1_000_000}])
def test_two_threads_leave_a_prefix_where_a_budget_ends(budget: dict[str, int]) -> None:
    name = "machines-17"
    one, two = explored(name, **budget), explored(name, threads=2, **budget)
    assert (one.complete, one.reason) == (two.complete, two.reason)
    assert two.n_markings == explored(name, threads=2, **budget).n_markings
    assert two.memory_bytes <= 1_000_000 or "max_markings" in budget
    assert 0.6 * one.n_markings <= two.n_markings <= 1.4 * one.n_markings
    assert len(two.path_to(two.n_markings - 1)) <= two.n_levels
    if "max_markings" in budget:
        assert two.n_markings == 20_000


def test_time_ends_two_threads() -> None:
    graph = explored("machines-20", threads=2, max_markings=1 << 21, max_seconds=0.02)
    assert (graph.complete, graph.reason) == (False, "time")
    assert graph.n_markings < 1 << 20


def test_steps_and_more_threads_are_refused() -> None:
    with pytest.raises(ValueError, match="steps are explored by 1 thread, not 2"):
        explored("machines-3", threads=2, step=True)
    with pytest.raises(ValueError, match="1 or 2 threads explore, not 3"):
        explored("machines-3", threads=3)


def test_synchronous_steps_are_explored_by_one_thread_whatever_is_asked() -> None:
    net = family_net("machines-3")
    assert explore_net(net, "step", threads=2).n_markings == explore_net(net, "step").n_markings


def searched(name: str, **limits: Any) -> _engine.Diagram:
    """All markings of a net of a family as a diagram."""
    n_places, transitions, initial = rows(family_net(name))
    return _engine.explore_symbolically(n_places, transitions, initial, max_memory_bytes=1 << 30, **limits)


def test_by_two_threads_the_same_order_wins_the_race_as_by_one() -> None:
    one, two = (searched("vehicles-8-32", threads=n) for n in (1, 2))  # which takes more than a round
    assert (one.order, one.n_nodes, one.reach().count()) == (two.order, two.n_nodes, two.reach().count())


def test_what_asking_for_the_second_processor_of_a_race_raises_comes_out() -> None:
    def broken() -> bool:
        raise LookupError("nobody knows")

    with pytest.raises(LookupError, match="nobody knows"):
        searched("vehicles-8-32", threads=2, second_free=broken)


def test_more_threads_than_two_are_refused() -> None:
    with pytest.raises(ValueError, match="1 or 2 threads search, not 3"):
        searched("vehicles-2-8", threads=3)
