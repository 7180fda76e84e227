"""Random walks find goals and never exclude them; what they show is cut down and replays."""

from __future__ import annotations

from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.lively_nets import lively_nets
from support.ring_nets import ring_nets
from support.searched import distance_to, goals, played, satisfies

from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.walk import decide_by_walk
from firable.nets.catalogue.processes import philosophers
from firable.nets.formula import And, Deadlock, Holds
from firable.nets.net import Net, Place, Transition

NETS = st.one_of(lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


@examples(100)
@given(st.data())
def test_what_a_walk_finds_is_reachable_and_small_nets_are_walked_all_over(data: st.DataObject) -> None:
    net = data.draw(NETS)
    graph = explore(net)
    for goal in (data.draw(goals(net)), Deadlock()):
        found, distance = decide_by_walk(net, goal, Limits(), firings=20_000), distance_to(graph, goal)
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
