"""Every technique that holds a state space, against the oracle: the same sets, whatever they are made of."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import seeds
from support.lively_nets import lively_net, lively_nets
from support.naive_space import Markings, NaiveSpace
from support.ring_nets import ring_nets
from support.timed_nets import timed_nets

from firable.analysis.goal import Limits
from firable.analysis.methods import SPACES, Method
from firable.analysis.spaces.bottoms import Bottoms
from firable.analysis.spaces.reachability import explore
from firable.analysis.spaces.space import StateSpace
from firable.nets.net import Marking, Net
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.firing import Valuation
from firable.semantics.trace import Discipline


def held_by(method: Method, net: Net) -> StateSpace[Any]:
    return SPACES[method].load()(net, Limits())


HELD: dict[str, Callable[[Net], StateSpace[Any]]] = {
    "reachability graph, interleaving": lambda net: explore(net),
    "reachability graph, steps": lambda net: explore(net, Discipline.STEP),
} | {of.words: partial(held_by, method) for method, of in SPACES.items()}


class Pairing:
    """A space beside the oracle, and how sets go from one to the other."""

    def __init__(self, space: StateSpace[Any]) -> None:
        self.space = space
        self.oracle = NaiveSpace(space.net, space.discipline)

    def same(self, found: Any, expected: Markings) -> None:
        assert self.space.count(found) == len(expected)
        assert {marking for marking in self.oracle.graph if self.space.contains(found, marking)} == set(expected)

    def given(self, marking: Marking) -> tuple[Any, Markings]:
        """The set of one marking in the space's own type, and as the oracle's."""

        def is_it(algebra: BooleanAlgebra[Any], holds: Valuation[Any]) -> Any:
            places = range(len(self.space.net.places))
            return algebra.conjunction(holds(p) if marking >> p & 1 else algebra.negation(holds(p)) for p in places)

        return self.space.where(is_it), frozenset({marking})


@pytest.mark.parametrize("name", HELD)
@given(net=st.one_of(lively_nets(), dense_nets(signals=True), ring_nets(signals=True), timed_nets()), data=st.data())
def test_a_space_has_the_sets_of_the_oracle(name: str, net: Net, data: st.DataObject) -> None:
    space = HELD[name](net)
    both = Pairing(space)
    oracle, same = both.oracle, both.same
    transitions, reached = range(len(net.transitions)), sorted(oracle.graph)
    assert space.complete
    assert (space.n_markings, space.n_edges) == (oracle.n_markings, oracle.n_edges)
    same(space.initial, oracle.initial)
    for marking in (*reached[:8], (reached[-1] + 1) % 2 ** len(net.places)):
        same(space.alone(marking), oracle.alone(marking))
    same(space.deadlocks, oracle.deadlocks)
    same(space.endless(), oracle.endless())
    same(space.home(), oracle.home())
    for t in transitions:
        same(space.may_fire(t), oracle.may_fire(t))
        same(space.in_contact(t), oracle.in_contact(t))
    assert list(space.contacts()) == list(oracle.contacts())
    blocked = list(space.meet_contact())
    assert blocked == list(oracle.meet_contact())
    for among in (blocked, blocked[:1], blocked[1:]):
        witness = space.witness_of_contact(among)
        assert (witness is None) == (not among)
        if witness is not None:
            assert net.marking(witness.marking) in oracle.algebra.disjunction(map(oracle.in_contact, among))
    assert [n > 0 for n in space.fired()] == [n > 0 for n in oracle.fired()]
    assert list(space.live()) == list(oracle.live())
    assert space.reversible() == oracle.reversible()
    pairs = [(t, u) for t in transitions for u in transitions if t < u]
    assert list(space.firable_together(pairs)) == list(oracle.firable_together(pairs))
    pairs = [(p, q) for p in range(len(net.places)) for q in range(p + 1)]
    assert list(space.marked_together(pairs)) == list(oracle.marked_together(pairs))
    bottom = {marking for marking in reached if space.contains(space.bottom(), marking)}
    assert bottom
    assert all(after in bottom for marking in bottom for _, after in oracle.graph[marking])
    assert all(bottom <= oracle.backward(frozenset({marking})) for marking in bottom)
    chosen = data.draw(st.lists(st.sampled_from(reached), min_size=1, max_size=4, unique=True))
    around = data.draw(st.lists(st.sampled_from(reached), max_size=len(reached), unique=True))
    sets = [both.given(marking) for marking in chosen]
    targets = space.algebra.disjunction(mine for mine, _ in sets), oracle.algebra.disjunction(s for _, s in sets)
    sets = [both.given(marking) for marking in around]
    within = space.algebra.disjunction(mine for mine, _ in sets), oracle.algebra.disjunction(s for _, s in sets)
    same(*targets)
    same(space.algebra.negation(targets[0]), oracle.algebra.negation(targets[1]))
    same(space.before(targets[0]), oracle.before(targets[1]))
    by = data.draw(st.sets(st.sampled_from(list(transitions)))) if transitions else set()
    same(space.before(targets[0], by), oracle.before(targets[1], by))
    same(space.backward(targets[0]), oracle.backward(targets[1]))
    same(space.forward(targets[0]), oracle.forward(targets[1]))
    assert space.count(space.one_of(targets[0])) == 1
    assert any(space.contains(space.one_of(targets[0]), marking) for marking in targets[1])
    same(space.backward(targets[0], within[0]), oracle.backward(targets[1], within[1]))
    same(space.backward(targets[0], by=by), oracle.backward(targets[1], by=by))
    same(space.backward(targets[0], within[0], by), oracle.backward(targets[1], within[1], by))
    others = set(transitions) - by
    same(space.backward(targets[0], within[0], others), oracle.backward(targets[1], within[1], others))
    same(space.endless(within[0]), oracle.endless(within[1]))
    witness = space.witness(targets[0], "here")
    assert witness is not None
    assert witness.note == "here"
    assert net.marking(witness.marking) in targets[1]
    assert space.witness(space.algebra.disjunction(())) is None


@pytest.mark.parametrize("name", HELD)
@given(net=st.one_of(lively_nets(), dense_nets(signals=True)), data=st.data())
def test_bottom_components_tell_of_every_goal_whether_it_is_lost_somewhere(
    name: str, net: Net, data: st.DataObject
) -> None:
    space = HELD[name](net)
    both = Pairing(space)
    oracle, reached = both.oracle, sorted(both.oracle.graph)
    all_, few = Bottoms(space, len(reached)), Bottoms(space, data.draw(st.integers(0, 2)))
    for _ in range(6):
        drawn = data.draw(st.lists(st.sampled_from(reached), max_size=len(reached), unique=True))
        sets = [both.given(marking) for marking in drawn]
        goal = space.algebra.disjunction(mine for mine, _ in sets)
        again = oracle.backward(frozenset(drawn))
        for bottoms in (all_, few):
            lost = bottoms.where_lost(goal)
            if lost is not None and space.count(lost):
                run = bottoms.run_into(lost)
                assert run is not None
                assert space.contains(lost, net.marking(run.marking))
                assert net.marking(run.marking) not in again
            elif lost is not None:
                assert again == frozenset(reached)
            assert lost is not None or bottoms is few


@pytest.mark.parametrize("method", SPACES)
@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(4))
def test_a_space_agrees_with_the_table_on_nets_whose_transitions_compete(method: Method, chunk: int) -> None:
    for seed in seeds(50, chunk):
        net = lively_net(random.Random(seed))
        told = []
        spaces: tuple[StateSpace[Any], ...] = (explore(net), held_by(method, net))
        for space in spaces:
            transitions = range(len(net.transitions))
            sizes = [space.count(found) for found in (space.deadlocks, space.home(), space.endless())]
            sizes += [space.count(space.backward(space.may_fire(t))) for t in transitions]
            sizes += [space.count(space.before(space.may_fire(t), [t])) for t in transitions]
            fired = [count > 0 for count in space.fired()]
            pairs = [(t, u) for t in transitions for u in range(t)]
            shape = (space.n_markings, space.n_edges, space.reversible(), list(space.live()), list(space.contacts()))
            told.append((shape, sizes, fired, list(space.firable_together(pairs))))
        assert told[0] == told[1], seed
