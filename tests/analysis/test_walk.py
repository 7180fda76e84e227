"""Random walks find goals and never exclude them; what they show is cut down and replays."""

from __future__ import annotations

import random
from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.lively_nets import lively_net, lively_nets
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets
from support.searched import distance_to, goals, played, satisfies
from support.small_text import net_of

from firable.analysis._engine import Stubborn
from firable.analysis.compiled import rows
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.walk import decide_by_walk
from firable.nets.catalogue.processes import philosophers
from firable.nets.formula import And, Deadlock, Holds
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


@examples(50)
@given(st.data())
def test_what_a_walk_finds_is_reachable_and_small_nets_are_walked_all_over(data: st.DataObject) -> None:
    net = data.draw(NETS)
    graph = explore(net)
    for goal in (data.draw(goals(net)), Deadlock()):
        distance = distance_to(graph, goal)
        found = decide_by_walk(net, goal, Limits(), firings=20_000 if distance is None else 5_000_000)
        assert found.reachable is (True if distance is not None else None)
        if found.witness is not None:
            assert satisfies(net, played(net, found.witness), goal)
            assert len(found.witness.firings) >= (distance or 0)


def test_a_walk_finds_the_deadlock_of_many_philosophers() -> None:
    net = philosophers(60)
    found = decide_by_walk(net, Deadlock(), Limits(), firings=10_000_000)
    assert found.witness is not None
    assert found.witness.marking == tuple(place.name for place in net.places if place.name.endswith("left"))
    assert 60 <= len(found.witness.firings) <= 1_000


def test_the_same_seed_gives_the_same_walk() -> None:
    first, second = (decide_by_walk(philosophers(20), Deadlock(), Limits(), seed=5) for _ in range(2))
    assert first == second


def test_a_goal_far_down_one_line_is_found() -> None:
    n = 5_000
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    net = Net("line", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(n - 1)))
    found = decide_by_walk(net, Holds(f"p{n - 1}"), Limits(), firings=10_000_000)
    assert found.witness is not None
    assert len(found.witness.firings) == n - 1


GONE = Event()
GONE.set()


@pytest.mark.parametrize("limits", [Limits(Deadline.after(0)), Limits(Deadline.after(60, GONE))])
def test_a_walk_ends_with_its_limits_and_leaves_the_question_open(limits: Limits) -> None:
    never = And((Holds("p1.eating"), Holds("p2.eating")))
    found = decide_by_walk(philosophers(5), never, limits)
    assert (found.reachable, found.witness) == (None, None)
    assert "random firings" in found.bound


@pytest.mark.parametrize("chunk", range(4))
def test_what_walks_meet_fires_after_the_ways_that_they_tell(chunk: int) -> None:
    for seed in range(40 * chunk, 40 * (chunk + 1)):
        net = lively_net(random.Random(seed), 9)
        every = range(len(net.transitions))
        ways, deadlock, steps = Stubborn(*rows(net)).cover(list(every), seed=seed, max_vain=3000, max_seconds=None)
        player, reached, met = Player(net), dict[tuple[int, int], int](), list[int]()
        for number, (after, firings, firable) in enumerate(ways):
            marking = net.initial_marking if after is None else reached[after]
            reached[number, 0] = marking
            for end, t in enumerate(firings, start=1):
                marking = player.fire(marking, [t])
                reached[number, end] = marking
            for t, end in firable:
                assert t in player.may_fire(reached[number, end])
                met.append(t)
        assert len(set(met)) == len(met)
        space = NaiveSpace(net)
        assert set(met) <= {t for t in every if space.count(space.may_fire(t))}
        if deadlock is not None:
            marking = net.initial_marking
            for t in deadlock:
                marking = player.fire(marking, [t])
            assert player.deadlocked(marking)
        assert steps <= 3000


def test_walks_in_a_net_that_is_stuck_at_once_end() -> None:
    net = net_of("p", "t: q -> p")
    assert Stubborn(*rows(net)).cover([0], seed=1, max_vain=10**9, max_seconds=None) == ([], [], 0)
    with pytest.raises(IndexError):
        Stubborn(*rows(net)).cover([1], seed=1, max_vain=1, max_seconds=None)
