"""What a reduced net answers is what the reference player finds in the original, and its witnesses lift."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cell_nets import cell_nets
from support.dense_nets import dense_nets
from support.examples import FACTOR, examples, seeds
from support.lively_nets import lively_net, lively_nets, part_of
from support.naive_space import NaiveSpace
from support.ring_nets import ring_nets
from support.small_scope import all_nets, net_with
from support.small_text import net_of
from support.whole_nets import formulas

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.reduction.draft import Draft
from firable.analysis.reduction.goals import goal_of
from firable.analysis.reduction.pairs import pairs
from firable.analysis.reduction.reduce import Reduced, reduce_for_goal, reduce_for_liveness
from firable.analysis.spaces.space import WitnessError
from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.formula import And, Compare, Constant, Count, Deadlock, Formula, Holds, Not, Sign, parse_formula
from firable.nets.net import Net, Property

NETS = st.one_of(cell_nets(), lively_nets(), ring_nets(signals=True), dense_nets(signals=True))


def literal(place: str, value: bool) -> Formula:
    return Holds(place) if value else Not(Holds(place))


@st.composite
def goals(draw: st.DrawFn, net: Net) -> Formula:
    """State formulas of all kinds, and those that are easily missed: a few places with a value each."""
    names = [place.name for place in net.places]
    some = formulas(names, [transition.name for transition in net.transitions])
    literals = st.lists(st.builds(literal, st.sampled_from(names), st.booleans()), max_size=3)
    counts = st.builds(Count, st.lists(st.sampled_from(names), max_size=3).map(tuple), st.integers(0, 2))
    goal: Formula = draw(
        st.one_of(
            some,
            literals.map(lambda found: And(tuple(found))),
            st.builds(Compare, counts, st.sampled_from(Sign), counts),
        )
    )
    return And((Deadlock(), goal)) if draw(st.integers(0, 3)) == 0 else goal


def check(net: Net, goal: Formula) -> Reduced:
    """The goal is reachable in the reduced net exactly if it is in the original, and the witness lifts."""
    original = NaiveSpace(net)
    expected = original.witness(original.satisfying(goal))
    reduced = reduce_for_goal(net, goal)
    space = NaiveSpace(reduced.net)
    found = space.witness(space.satisfying(reduced.goal))
    assert (found is None) == (expected is None), reduced.summary
    if found is not None:
        lifted = reduced.lift(name for (name,) in found.firings)
        assert original.contains(original.satisfying(goal), net.marking(lifted.marking))
    return reduced


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(4))
def test_goals_of_nets_whose_transitions_compete_are_kept(chunk: int) -> None:
    for seed in seeds(30, chunk):
        draw = random.Random(seed)
        net = lively_net(draw, 10)
        check(net, Deadlock())
        check(net, part_of(draw, net, draw.choice(list(NaiveSpace(net).graph))))
        check(net, part_of(draw, net, draw.getrandbits(len(net.places)), 4))


@examples(38)
@given(st.data())
def test_a_goal_is_reachable_in_the_reduced_net_exactly_if_it_is_in_the_original(data: st.DataObject) -> None:
    net = data.draw(NETS)
    check(net, data.draw(goals(net)))


@examples(50)
@given(NETS)
def test_there_is_a_deadlock_in_the_reduced_net_exactly_if_there_is_one_in_the_original(net: Net) -> None:
    check(net, Deadlock())


@examples(15)
@given(NETS)
def test_a_transition_is_live_or_dead_exactly_if_its_image_is(net: Net) -> None:
    original, reduced = NaiveSpace(net), reduce_for_liveness(net)
    space = NaiveSpace(reduced.net)
    live, fired = space.live(), space.fired()
    for t, transition in enumerate(net.transitions):
        image = reduced.transitions[transition.name]
        index = None if image is None else reduced.net.transition_index[image]
        assert bool(original.fired()[t]) is (index is not None and bool(fired[index]))
        assert original.live()[t] is (index is not None and live[index])
    assert (original.count(original.deadlocks) > 0) == (space.count(space.deadlocks) > 0)


@examples(30)
@given(NETS)
def test_literals_that_are_true_together_somewhere_are_not_said_to_exclude_each_other(net: Net) -> None:
    facts = pairs(Draft(net, None), None, NEVER)
    assert facts is not None
    for marking in NaiveSpace(net).graph:
        true = [2 * place + (marking >> place & 1) for place in range(len(net.places))]
        assert not any(facts.exclude(one, other) for one in true for other in true)


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(4))
def test_nets_of_a_small_scope(chunk: int) -> None:
    for number, shapes in enumerate(all_nets(2, 2, chunk, 4)):
        if number % (100 if FACTOR == 1 else 50) == 0:
            for initial in range(4):
                net = net_with(2, shapes, initial)
                for goal in ("p and not q", "q", "deadlock", "deadlock and p", "not p", "tokens(p, q) = 1"):
                    check(net, parse_formula(goal))


@pytest.mark.parametrize("name", catalogue_names())
def test_the_nets_of_the_catalogue(name: str) -> None:
    net = catalogue_net(name)
    reduced = check(net, Deadlock())
    assert len(reduced.net.places) < len(net.places) / 2
    for of in net.properties:
        if isinstance(of, Property):
            check(net, of.formula)


def test_a_deadlock_that_an_opener_leads_to_is_lifted_with_it() -> None:
    # Openers are late: where the reduced net is stuck, the original may still fire one of them, and is stuck then.
    reduced = check(net_of("a", "v: c -> b, d", "t: a -> b", "u: b -> c", "w: d -> e if a", "x: e -> a"), Deadlock())
    with pytest.raises(WitnessError, match="does not end in the goal"):
        replace(reduced, tails=()).lift(_deadlock(reduced))
    assert reduced.lift(_deadlock(reduced)).marking == ("c", "d")


def test_openers_that_were_left_out_one_after_the_other_are_fired_in_the_opposite_order() -> None:
    # A line of buffers that nobody empties is stuck when all are full, from the last to the first.
    line = net_of("", "in: -> a", "t: a -> b", "u: b -> c", "v: c -> d")
    reduced = check(replace(line, places=tuple(reversed(line.places))), Deadlock())
    assert len(reduced.tails) > 1
    with pytest.raises(WitnessError):
        replace(reduced, tails=reduced.tails[::-1]).lift(_deadlock(reduced))


def _deadlock(reduced: Reduced) -> list[str]:
    space = NaiveSpace(reduced.net)
    found = space.witness(space.satisfying(reduced.goal))
    assert found is not None
    return [name for (name,) in found.firings]


def test_where_the_deadline_is_over_nothing_but_what_cannot_fire_is_gone() -> None:
    net = net_of("a", "t: a -> b", "u: b -> a", "loop: a -> a")
    reduced = reduce_for_goal(net, Deadlock(), Limits(Deadline.after(0)))
    assert [transition.name for transition in reduced.net.transitions] == ["t", "u"]
    assert len(reduced.net.places) == 2


@examples(30)
@given(cell_nets(), st.integers(1, 12))
def test_whatever_the_deadline_interrupts_the_result_is_sound(net: Net, polls: int) -> None:
    class Clock(Deadline):
        __slots__ = ()
        left = polls

        @property
        def over(self) -> bool:
            Clock.left -= 1
            return Clock.left < 0

    original = NaiveSpace(net)
    reduced = reduce_for_goal(net, Deadlock(), Limits(Clock()))
    space = NaiveSpace(reduced.net)
    found = space.witness(space.satisfying(reduced.goal))
    assert (found is None) == (original.count(original.deadlocks) == 0)
    if found is not None:
        reduced.lift(name for (name,) in found.firings)


def test_the_result_is_a_function_of_the_net() -> None:
    net = catalogue_net("one_robot_mc_late")
    assert reduce_for_goal(net, Deadlock()) == reduce_for_goal(net, Deadlock())


def test_a_net_with_a_transition_that_needs_nothing_has_no_deadlock() -> None:
    net = net_of("g", "t: a -> b", "u: -> if g", "v: b -> a")
    assert reduce_for_goal(net, Deadlock()).goal == Constant(value=False)


def test_composed_transitions_have_names_of_their_own() -> None:
    net = net_of("a y t-5", "t: a -> p", "f: p, x -> b, y", "g: b -> a, t-4", "k: y -> x", "l: t-5, t-4 -> t-6")
    for name in (transition.name for transition in reduce_for_goal(net, parse_formula("b and x")).net.transitions):
        assert name not in {place.name for place in net.places}


def test_a_goal_on_every_place_protects_them() -> None:
    net = net_of("a", "t: a -> p", "u: p -> b", "v: b -> a")
    assert goal_of(net, parse_formula("start")).formula == parse_formula("a and not p and not b")
    check(net, Not(parse_formula("start")))
