"""The symbolic state space: sizes that no table holds, its budget, its sets as values, and its firing sequences."""

from __future__ import annotations

import threading
from itertools import pairwise

import pytest
from hypothesis import given
from support.ring_nets import ring_nets

from firable.analysis import _engine
from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue.families import FAMILIES, family_net
from firable.nets.formula import And, Formula, Holds, Not, Or, parse_formula
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player

SIZES = {
    "philosophers": (300,),
    "philosophers_either": (300,),
    "machines": (500,),
    "interlocked": (300,),
    "token_ring": (100,),
    "counter": (60,),
    "pipeline": (500,),
    "grid": (4,),
    "manufacturing_cells": (100,),
    "vehicles": (3,),
}


@pytest.mark.parametrize("family", SIZES)
def test_a_family_has_as_many_markings_as_its_formula_says(family: str) -> None:
    formula, size = FAMILIES[family].markings, SIZES[family]
    assert formula is not None
    assert explore_symbolically(FAMILIES[family].net(*size)).n_markings == formula(*size)


def test_the_slotted_ring_has_the_published_number_of_markings() -> None:
    assert explore_symbolically(family_net("slotted_ring-10")).n_markings == 8_291_791_872


def test_edges_are_counted_beyond_a_machine_word() -> None:
    n = 200  # each machine starts or ends in every marking
    space = explore_symbolically(family_net(f"machines-{n}"))
    assert space.n_edges == n * 2**n


def test_one_net_has_one_answer() -> None:
    net = family_net("philosophers-40")
    first, second = explore_symbolically(net), explore_symbolically(net)
    assert first.engine.order == second.engine.order
    assert first.witness(first.deadlocks) == second.witness(second.deadlocks)


def test_the_order_of_the_places_changes_no_answer() -> None:
    gate = [(0, True)]
    rows = [([i], [(i + 1) % 6], list[int](), list[int](), gate if i == 3 else []) for i in range(6)]
    orders = [list(range(6)), [3, 0, 5, 1, 4, 2], [5, 4, 3, 2, 1, 0]]
    for order in orders:
        diagram = _engine.explore_symbolically(6, rows, [0, 3], max_memory_bytes=1 << 20, orders=[order])
        assert diagram.order == order
        assert diagram.reach().count() == 15
        assert diagram.reach().contains([1, 2])
        assert not diagram.reach().contains([1])


@pytest.mark.parametrize("orders", [[], [[0]], [[0, 0]], [[0, 1, 2]]])
def test_what_is_no_order_is_refused(orders: list[list[int]]) -> None:
    with pytest.raises(ValueError, match="order"):
        _engine.explore_symbolically(2, [], [], max_memory_bytes=1 << 20, orders=orders)


def test_a_place_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="place 2"):
        _engine.explore_symbolically(2, [([2], [], [], [], [])], [], max_memory_bytes=1 << 20)
    diagram = _engine.explore_symbolically(2, [], [], max_memory_bytes=1 << 20)
    with pytest.raises(IndexError):
        diagram.having(diagram.reach(), [2], [])
    with pytest.raises(IndexError):
        diagram.before(diagram.reach(), [0])


def test_a_budget_that_ends_is_no_answer() -> None:
    net = family_net("slotted_ring-60")
    with pytest.raises(BudgetExceeded, match="memory"):
        explore_symbolically(net, Limits(memory_bytes=200_000))
    with pytest.raises(BudgetExceeded, match="the time was over"):
        explore_symbolically(net, Limits(Deadline.after(0.01)))


def test_whoever_no_longer_needs_the_answer_ends_the_search() -> None:
    over = threading.Event()
    threading.Timer(0.05, over.set).start()
    with pytest.raises(BudgetExceeded, match="cancelled"):
        explore_symbolically(family_net("vehicles-20-64"), Limits(Deadline(cancelled=over)))


def test_a_space_may_be_asked_under_another_deadline() -> None:
    space = explore_symbolically(family_net("philosophers-100"))
    late = space.until(Deadline.after(0))
    with pytest.raises(BudgetExceeded):
        late.backward(late.engine.forward(late.deadlocks) | late.initial)
    again = late.until(Deadline())
    assert again.backward(again.deadlocks) == again.reach


def test_a_formula_that_holds_somewhere_is_shown_by_a_firing_sequence_that_replays() -> None:
    space = explore_symbolically(family_net("philosophers-6"))
    witness = space.witness(space.satisfying(parse_formula("p1.eating and p3.eating and p5.eating")))
    assert witness is not None
    assert {"p1.eating", "p3.eating", "p5.eating"} <= set(witness.marking)
    assert space.witness(space.satisfying(parse_formula("p1.eating and p2.eating"))) is None


def test_a_deadlock_many_firings_away_is_walked_to() -> None:
    net = family_net("philosophers-120")
    space = explore_symbolically(net)
    witness = space.witness(space.deadlocks)
    assert witness is not None
    assert len(witness.firings) == 120
    assert Player(net).deadlocked(net.marking(witness.marking))


def held_back(machines: int, steps: int) -> Net:
    """Machines in a ring that step on alone; one that has finished begins anew unless the next has finished too."""
    places, transitions = [], []
    for i in range(machines):
        own = [f"m{i}.s{k}" for k in range(steps)]
        places += [Place(name, marked=name == own[0]) for name in own]
        transitions += [Transition(f"m{i}_steps_{k}", (a,), (b,)) for k, (a, b) in enumerate(pairwise(own))]
        next_last = f"m{(i + 1) % machines}.s{steps - 1}"
        transitions.append(Transition(f"m{i}_begins_anew", (own[-1],), (own[0],), inhibitive=(next_last,)))
    return Net("held_back", tuple(places), tuple(transitions))


def test_a_deadlock_that_one_of_a_thousand_million_markings_is_comes_with_a_short_way() -> None:
    machines, steps = 10, 8
    space = explore_symbolically(held_back(machines, steps))
    assert (space.n_markings, space.count(space.deadlocks)) == (steps**machines, 1)
    witness = space.witness(space.deadlocks)
    assert witness is not None
    assert machines * (steps - 1) <= len(witness.firings) <= machines * steps


@given(net=ring_nets(signals=True))
def test_near_firing_sequences_are_shortest(net: Net) -> None:
    graph, space = explore(net), explore_symbolically(net)
    for place in range(len(net.places)):
        shortest, found = graph.witness(graph.marked(place)), space.witness(space.marked(place))
        assert (found is None) == (shortest is None)
        if found is not None and shortest is not None:
            assert len(found.firings) == len(shortest.firings)


def test_sets_are_values() -> None:
    space = explore_symbolically(family_net("machines-4"))
    first, second = space.marked(0), space.marked(2)
    assert first & second == second & first
    assert hash(first & second) == hash(second & first)
    assert (first | second) - first == second - first
    assert first ^ second == (first | second) - (first & second)
    assert first != second
    assert not first - space.reach
    assert len({first, second, space.marked(0)}) == 2
    other = explore_symbolically(family_net("machines-4"))
    assert first != other.marked(0)
    with pytest.raises(TypeError):
        first & other.marked(0)
    with pytest.raises(TypeError):
        other.engine.backward(first)


def test_a_chain_of_twenty_thousand_places_needs_no_deep_stack() -> None:
    names = [f"p{i}" for i in range(20_000)]
    moves = tuple(Transition(f"t{i}", (a,), (b,)) for i, (a, b) in enumerate(pairwise(names)))
    net = Net("chain", tuple(Place(name, marked=name == "p0") for name in names), moves)
    space = explore_symbolically(net)
    assert space.n_markings == len(names)
    assert space.count(space.deadlocks) == 1
    assert space.backward(space.deadlocks) == space.reach


def test_edges_not_counted_in_time_are_none_and_counted_edges_are_kept() -> None:
    space = explore_symbolically(family_net("philosophers-3000"))
    assert space.until(Deadline.after(0)).n_edges is None
    again = space.until(Deadline())
    known = again.n_edges
    assert known is not None
    assert again.until(Deadline.after(0)).n_edges == known


def test_a_given_order_of_the_places_changes_the_diagram_and_not_the_markings() -> None:
    net = family_net("philosophers_either-6")
    order = list(range(len(net.places) - 1, -1, -1))
    given_, own = explore_symbolically(net, orders=[order]), explore_symbolically(net)
    assert given_.engine.order == order
    assert given_.n_markings == own.n_markings
    assert given_.count(given_.deadlocks) == own.count(own.deadlocks)


def test_conjunction_of_literals_is_the_conjunction_of_its_parts() -> None:
    net = family_net("philosophers_either-4")
    space = explore_symbolically(net)
    a, b, c = (Holds(place.name) for place in net.places[:3])
    cases: list[tuple[Formula, ...]] = [(a, Not(b)), (Not(a), Not(b), Or((b, c))), (a, Not(a)), ()]
    for parts in cases:
        apart = [space.satisfying(part) for part in parts]
        assert space.satisfying(And(parts)) == space.algebra.conjunction(apart)
