"""Each rule where it applies, and where it narrowly does not."""

from __future__ import annotations

import pytest
from support.small_text import net_of

from firable.analysis.deadline import NEVER
from firable.analysis.reduction.agglomeration import agglomerate_at
from firable.analysis.reduction.constants import remove_constants
from firable.analysis.reduction.copies import merge_places, remove_subsumed
from firable.analysis.reduction.draft import Draft, flat
from firable.analysis.reduction.early import fire_early
from firable.analysis.reduction.goals import Goal, goal_of
from firable.analysis.reduction.implied import remove_dead, remove_implied_gates, remove_implied_places
from firable.analysis.reduction.pairs import Pairs, pairs
from firable.analysis.reduction.relevance import remove_irrelevant
from firable.nets.formula import format_formula, parse_formula
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition

LIVENESS = "every transition"


def draft_of(goal: str, marked: str, *transitions: str) -> Draft:
    net = net_of(marked, *transitions)
    return Draft(net, None if goal == LIVENESS else goal_of(net, parse_formula(goal)))


def facts_of(draft: Draft) -> Pairs:
    facts = pairs(draft, None, NEVER)
    assert facts is not None
    return facts


def places(draft: Draft) -> set[str]:
    return {draft.net.places[place].name for place in draft.places}


def fired(draft: Draft) -> set[tuple[str, ...]]:
    """What the moves of the draft stand for."""
    names = [transition.name for transition in draft.net.transitions]
    return {tuple(names[t] for t in flat(move.origin)) for move in draft.moves.values()}


def goal(draft: Draft) -> str:
    assert isinstance(draft.goal, Goal)
    return format_formula(draft.goal.as_formula())


# Transitions that never fire


def test_transitions_that_cannot_open_or_contradict_themselves_are_not_taken_over() -> None:
    both = (ExternalGate("s", wanted=True), ExternalGate("s", wanted=False))
    transitions = (
        Transition("closed", ("p",), ("q",), external=both),
        Transition("open", ("p",), ("q",), external=both[:1]),
        Transition("loop", ("p",), ("p",)),
        Transition("gated", ("p",), (), (), ("p",)),
    )
    net = Net("n", (Place("p", marked=True), Place("q")), transitions, (Signal("s"),))
    draft = Draft(net, None)
    assert fired(draft) == {("open",)}
    assert draft.applied == {"dead transition": 3}


# constants


def test_a_place_that_stays_empty_kills_its_consumers_and_what_they_alone_produce() -> None:
    draft = draft_of("c or not a or p", "p", "t: a -> b", "u: b -> c", "v: p -> q")
    assert remove_constants(draft)
    assert fired(draft) == {("v",)}
    assert places(draft) == {"p", "q"}
    assert goal(draft) == "true"


def test_a_marked_place_without_consumer_blocks_its_producers_for_ever() -> None:
    draft = draft_of("q", "p full", "t: p -> full", "u: p -> q if full")
    assert remove_constants(draft)
    assert fired(draft) == {("u",)}
    assert places(draft) == {"p", "q"}


def test_a_place_that_may_change_is_no_constant() -> None:
    draft = draft_of("q", "p full", "t: p -> full", "u: full ->")
    remove_constants(draft)
    assert fired(draft) == {("t",), ("u",)}
    assert places(draft) == {"p", "full"}


# relevance

RINGS = ("t: a -> b", "u: b -> a", "v: c -> d", "w: d -> c")


def test_a_ring_that_the_goal_does_not_depend_on_is_removed() -> None:
    draft = draft_of("b", "a c", *RINGS)
    assert remove_irrelevant(draft)
    assert fired(draft) == {("t",), ("u",)}
    assert places(draft) == {"a", "b"}


@pytest.mark.parametrize("gate", ["t: a -> b if d", "t: a -> b unless c"])
def test_a_ring_that_a_gate_reads_is_relevant(gate: str) -> None:
    draft = draft_of("b", "a c", gate, *RINGS[1:])
    assert not remove_irrelevant(draft)


def test_who_empties_a_full_output_place_is_relevant() -> None:
    draft = draft_of("b", "a s", "t: a -> b, s", "u: s -> r", "v: r -> s", "w: a -> x")
    assert remove_irrelevant(draft)
    assert fired(draft) == {("t",), ("u",), ("v",)}
    assert places(draft) == {"a", "b", "s", "r"}


def test_a_transition_that_only_spoils_the_goal_is_removed() -> None:
    draft = draft_of("a and c", "a", "t: a -> b", "u: -> c")
    assert remove_irrelevant(draft)
    assert fired(draft) == {("u",)}
    assert not remove_irrelevant(draft_of("a and c", "a", "t: a -> b", "u: -> c", "v: b -> a"))


def test_for_a_deadlock_and_for_liveness_every_transition_is_relevant() -> None:
    for question in ("deadlock", LIVENESS):
        assert not remove_irrelevant(draft_of(question, "a c", *RINGS))


def test_a_place_without_arcs_and_gates_goes_unless_the_goal_speaks_of_it() -> None:
    for question, left in (("deadlock", {"p"}), ("deadlock and q", {"p", "q"})):
        draft = draft_of(question, "p q", "t: p ->")
        remove_irrelevant(draft)
        assert places(draft) == left


# copies


def test_equal_and_complementary_places_are_one_also_in_the_goal() -> None:
    draft = draft_of("p and copy and not free", "free", "t: free -> p, copy", "u: p, copy -> free", "v: -> x if free")
    assert merge_places(draft)
    assert goal(draft) == "not free"
    assert places(draft) == {"free", "x"}
    assert draft.moves[0].needs == {draft.net.place_index["free"]: True}


def test_a_gate_on_a_complement_changes_its_kind() -> None:
    draft = draft_of("x", "p", "t: p -> q", "u: q -> p", "v: -> x unless q")
    assert merge_places(draft)
    _, _, gate = draft.moves.values()
    assert gate.needs == {draft.net.place_index["p"]: True, draft.net.place_index["x"]: False}


def test_a_transition_that_needs_two_copies_to_differ_is_dead() -> None:
    draft = draft_of("x", "p c", "t: p, c -> q", "u: q -> p, c", "v: q -> p, c", "w: p -> c, q", "y: -> x")
    assert merge_places(draft)
    assert fired(draft) == {("t",), ("u",), ("v",), ("y",)}
    assert places(draft) == {"p", "x"}
    draft = draft_of("x", "p", "t: p -> q", "u: q -> p", "v: -> x if p, q")
    assert merge_places(draft)
    assert ("v",) not in fired(draft)


def test_places_that_one_transition_tells_apart_are_no_copies() -> None:
    draft = draft_of("p", "free", "t: free -> p, copy", "u: p, copy -> free", "v: copy -> x")
    merge_places(draft)
    assert places(draft) == {"free", "copy", "x"}
    assert not merge_places(draft)


def test_a_transition_with_one_gate_more_is_subsumed() -> None:
    for question in ("q", "deadlock"):
        draft = draft_of(question, "p g", "t: p -> q", "u: p -> q if g", "v: q -> p unless g", "w: q -> p if h")
        assert remove_subsumed(draft)
        assert fired(draft) == {("t",), ("v",), ("w",)}


def test_for_liveness_only_duplicates_are_merged() -> None:
    draft = draft_of(LIVENESS, "p g", "t: p -> q", "u: p -> q if g", "v: p -> q")
    assert remove_subsumed(draft)
    assert fired(draft) == {("t",), ("u",)}
    assert draft.same_as == {2: 0}


def test_transitions_with_another_effect_are_not_subsumed() -> None:
    assert not remove_subsumed(draft_of("q", "p g", "t: p -> q", "u: p, g -> q", "v: p -> q, x", "w: -> q if p"))


# facts


def test_no_two_places_of_a_ring_are_marked_together() -> None:
    draft = draft_of("a", "a", "t: a -> b", "u: b -> c", "v: c -> a")
    facts = facts_of(draft)
    assert all(facts.exclude(2 * p + 1, 2 * q + 1) for p in range(3) for q in range(3) if p != q)
    assert not any(facts.exclude(2 * p, 2 * q + 1) for p in range(3) for q in range(3) if p != q)


def test_a_gate_keeps_two_rings_apart() -> None:
    gated = draft_of("b", "a c", "t: a -> b unless d", "u: b -> a", "v: c -> d unless b", "w: d -> c")
    index = gated.net.place_index
    assert facts_of(gated).exclude(2 * index["b"] + 1, 2 * index["d"] + 1)
    free = draft_of("b", "a c", "t: a -> b unless d", "u: b -> a", "v: c -> d", "w: d -> c")
    assert not facts_of(free).exclude(2 * index["b"] + 1, 2 * index["d"] + 1)


def test_what_becomes_possible_with_a_place_that_stays_is_followed_on() -> None:
    # t is looked at after v, and makes b true together with c: v must be looked at again.
    draft = draft_of("b", "a c", "v: c -> d", "t: a -> b if c")
    b, d = (2 * draft.net.place_index[name] + 1 for name in "bd")
    assert not facts_of(draft).exclude(b, d)


def test_what_was_known_bounds_what_is_proved_later() -> None:
    draft = draft_of("b", "a c", "t: a -> b unless d", "u: b -> a", "v: c -> d unless b", "w: d -> c")
    facts = facts_of(draft)
    b, d = (2 * draft.net.place_index[name] + 1 for name in "bd")
    draft.replace(2, draft.moves[2].without((b // 2,)))
    assert not facts_of(draft).exclude(b, d)
    again = pairs(draft, facts, NEVER)
    assert again is not None
    assert again.exclude(b, d)


def test_a_move_is_dead_that_has_one_need_which_is_never_met() -> None:
    draft = draft_of("b", "a", "t: a -> b", "u: c -> d")
    facts = facts_of(draft)
    assert [facts.dead(move.without(draft.places - {move.literals[0] // 2})) for move in draft.moves.values()] == [
        False,
        True,
    ]


def test_facts_that_take_too_long_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    draft = draft_of("a", "a", *(f"t{i}: a -> b{i}" for i in range(300)))
    assert pairs(draft, None, NEVER) is not None
    monkeypatch.setattr("firable.analysis.reduction.pairs.WORDS_MAX", 1)
    assert pairs(draft, None, NEVER) is None
    monkeypatch.undo()
    assert pairs(draft, None, NEVER, matrix_bytes_max=1) is None


# implied

RING = ("t: a -> b", "u: b -> c", "v: c -> a")


def test_a_transition_that_needs_two_places_of_a_ring_is_dead() -> None:
    draft = draft_of(LIVENESS, "a x", *RING, "w: a, b -> x", "y: a -> z if x")
    assert remove_dead(draft, facts_of(draft), NEVER)
    assert fired(draft) == {("t",), ("u",), ("v",), ("y",)}


def test_a_gate_that_an_input_implies_is_removed() -> None:
    draft = draft_of(LIVENESS, "a", "t: a -> b unless c", *RING[1:])
    assert remove_implied_gates(draft, facts_of(draft), NEVER)
    assert len(draft.moves[0].needs) == 2
    draft = draft_of(LIVENESS, "a x", "t: a -> b unless y", *RING[1:], "w: x -> y", "z: y -> x")
    assert not remove_implied_gates(draft, facts_of(draft), NEVER)


CAPACITY = ("t: a, slot -> b", "u: b -> c, slot", "v: c -> a")


def test_a_place_whose_value_follows_wherever_it_is_needed_is_removed() -> None:
    draft = draft_of(LIVENESS, "a slot", *CAPACITY)
    assert remove_implied_places(draft, facts_of(draft), NEVER)
    assert "slot" not in places(draft)


def test_a_place_that_the_goal_speaks_of_is_not_removed() -> None:
    draft = draft_of("not slot and a", "a slot", *CAPACITY)
    remove_implied_places(draft, facts_of(draft), NEVER)
    assert "slot" in places(draft)


def test_a_place_that_blocks_when_full_is_not_implied() -> None:
    # `done` is never taken from: under the contact rule it stops the ring in its second round.
    draft = draft_of(LIVENESS, "a", "t: a -> b, done", *RING[1:])
    remove_implied_places(draft, facts_of(draft), NEVER)
    assert "done" in places(draft)


# early


def test_what_nobody_competes_for_is_fired_at_once() -> None:
    draft = draft_of("c", "a", "t: a -> b", "u: b -> c if x", "v: -> x")
    assert fire_early(draft, set())
    assert [flat(origin) for origin in draft.first] == [(0,), (2,)]
    assert [draft.values[draft.net.place_index[p]] for p in "abcx"] == [False, True, False, True]


@pytest.mark.parametrize(
    ("question", "transitions"),
    [
        ("c", ("t: a -> b", "u: a -> c")),  # u competes for the token
        ("c", ("t: a -> b", "u: -> c if a")),  # u reads it
        ("c", ("t: a -> b", "u: x -> c unless b")),  # u wants the output empty
        ("c", ("t: a -> b", "u: x -> c, b")),  # u blocks on the output
        ("not b and x", ("t: a -> b", "u: -> x if b")),  # the goal wants the output empty
        ("a and not x", ("t: a -> b", "u: -> x if b")),  # the goal wants the token to stay
        ("deadlock", ("t: a -> b if x", "u: x -> y, a")),  # a deadlock is reached by closing the gate
    ],
)
def test_what_somebody_would_miss_is_not_fired_early(question: str, transitions: tuple[str, ...]) -> None:
    draft = draft_of(question, "a x", *transitions)
    fire_early(draft, set())
    assert 0 not in [t for origin in draft.first for t in flat(origin)]


def test_transitions_that_undo_each_other_are_fired_early_once() -> None:
    draft = draft_of("deadlock", "a", "t: a ->", "u: -> a")
    done: set[int] = set()
    for _ in range(3):
        fire_early(draft, done)
    assert len(draft.first) == 2


# agglomeration


def agglomerated(draft: Draft) -> str:
    return agglomerate_at(draft, facts_of(draft), draft.net.place_index["p"])


SEQUENCE = ("h: a -> p", "f: p -> b", "g: b -> a")


@pytest.mark.parametrize("question", ["b", "deadlock"])
def test_a_step_between_two_places_of_a_ring_is_skipped(question: str) -> None:
    draft = draft_of(question, "a", *SEQUENCE)
    assert agglomerated(draft) == "closers early"
    assert fired(draft) == {("h", "f"), ("g",)}
    assert places(draft) == {"a", "b"}


def test_what_both_steps_touch_becomes_a_gate() -> None:
    draft = draft_of("b", "a r", "h: a, r -> p", "f: p -> b, r", "g: b -> a", "x: r -> s", "y: s -> r")
    agglomerated(draft)
    assert fired(draft) == {("h", "f"), ("g",), ("x",), ("y",)}
    (move,) = [move for move in draft.moves.values() if flat(move.origin) == (0, 1)]
    r = draft.net.place_index["r"]
    assert move.needs[r]
    assert r not in move.flips


def test_a_buffer_of_two_places_stays_two_places() -> None:
    # Both may be full at once: the contact rule makes h wait for p while f waits for b.
    draft = draft_of("b and c", "a c", "h: c -> p, d", "f: p -> b", "g: b -> a", "i: d, a -> c")
    assert not agglomerated(draft)


@pytest.mark.parametrize(
    ("question", "transitions"),
    [
        ("x", ("v: -> x if p",)),  # somebody sees the step
        ("x", ("v: -> x unless p",)),  # or its absence
        ("p", ()),  # the goal is the step
        ("b or not p", ()),
    ],
)
def test_a_step_that_is_looked_at_stays(question: str, transitions: tuple[str, ...]) -> None:
    draft = draft_of(question, "a", *SEQUENCE, *transitions)
    assert not agglomerated(draft)


def test_closers_whose_effect_somebody_would_miss_are_not_early_but_openers_may_be_late() -> None:
    draft = draft_of("x", "a", *SEQUENCE, "v: -> x unless b")
    assert agglomerated(draft) == "openers late"
    draft = draft_of("x", "a", *SEQUENCE, "v: -> x unless b, a")  # x only while p is marked
    assert not agglomerated(draft)


def test_a_goal_that_a_closer_would_spoil_keeps_it_from_being_early() -> None:
    assert agglomerated(draft_of("not b", "a", *SEQUENCE)) == "openers late"
    assert not agglomerated(draft_of("not b and not a", "a", *SEQUENCE))
    assert agglomerated(draft_of("b or a", "a", *SEQUENCE)) == "closers early"


def test_a_deadlock_is_not_spoilt_by_what_a_closer_does() -> None:
    assert agglomerated(draft_of("deadlock and not b and not a", "a", *SEQUENCE)) == "closers early"


def test_moves_that_stand_for_too_many_firings_are_not_composed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.reduction.agglomeration.LENGTH_MAX", 1)
    assert not agglomerated(draft_of("b", "a", *SEQUENCE))


MEETING = ("f: p, x -> b, y", "g: b -> a", "k: y -> x")


@pytest.mark.parametrize("question", ["b", "deadlock"])
def test_an_opener_may_wait_for_what_its_closer_waits_for(question: str) -> None:
    draft = draft_of(question, "a y", "h: a -> p", *MEETING)
    assert agglomerated(draft) == "openers late"
    assert fired(draft) == {("h", "f"), ("g",), ("k",)}
    assert len(draft.tails) == (question == "deadlock")


def test_a_closer_that_its_opener_makes_impossible_composes_to_nothing() -> None:
    draft = draft_of("b", "a y", "h: a -> p", *MEETING, "never: p, a -> c")
    assert agglomerated(draft) == "openers late"
    assert fired(draft) == {("h", "f"), ("g",), ("k",)}


def test_an_opener_that_somebody_waits_for_is_not_late() -> None:
    assert not agglomerated(draft_of("z", "a y", "h: a -> p", *MEETING, "v: -> z unless a"))
    assert not agglomerated(draft_of("b", "a y q", "h: a -> p", *MEETING, "v: q -> a"))
    assert not agglomerated(draft_of("not a", "a y", "h: a -> p", *MEETING))
    assert agglomerated(draft_of("a", "a y", "h: a -> p", *MEETING)) == "openers late"


def test_an_opener_whose_gate_may_close_is_not_late() -> None:
    assert not agglomerated(draft_of("b", "a y", "h: a -> p if y", *MEETING))
    assert agglomerated(draft_of("b", "a y q", "h: a -> p if q", *MEETING, "v: z -> q")) == "openers late"


def test_an_opener_with_a_competitor_is_late_for_reachability_but_not_for_deadlock() -> None:
    transitions = ("h: a -> p", *MEETING, "v: a -> c", "w: c -> a")
    assert agglomerated(draft_of("b", "a y", *transitions)) == "openers late"
    assert not agglomerated(draft_of("deadlock", "a y", *transitions))


def test_for_a_deadlock_the_goal_must_not_speak_of_what_openers_take() -> None:
    for question, applied in (("deadlock and a", False), ("deadlock and not y", True)):
        draft = draft_of(question, "a y", "h: a -> p", *MEETING)
        assert bool(agglomerated(draft)) is applied


def test_several_openers_of_a_deadlock_must_not_differ_for_the_closers() -> None:
    # After h1 the closer f is blocked, and after h2 it is not: h2 must not be tried instead.
    transitions = ("h1: a -> p", "h2: c -> p", "f: p, x -> b unless a", "k: b -> x")
    assert not agglomerated(draft_of("deadlock", "a c", *transitions))
    assert agglomerated(draft_of("b", "a c", *transitions)) == "openers late"


def test_a_resource_that_is_taken_and_given_back_is_a_place_like_any_other() -> None:
    draft = draft_of("b", "a p", "h: a, p -> b", "f: b -> a, p")
    assert not agglomerated(draft)  # the goal wants b, which is marked only while p is away
    draft = draft_of("a", "a p", "h: a, p -> b", "f: b -> a, p")
    assert agglomerated(draft) == "closers early"
    assert fired(draft) == {("h", "f")}


def test_transitions_must_not_multiply() -> None:
    openers = [f"h{i}: a{i} -> p" for i in range(3)]
    closers = [f"f{i}: p -> b{i}" for i in range(3)]
    back = [f"g{i}{j}: b{i} -> a{j}" for i in range(3) for j in range(3)]
    assert not agglomerated(draft_of("b0", "a0", *openers, *closers, *back))
    assert agglomerated(draft_of("b0", "a0", *openers, closers[0], *back)) == "closers early"


def test_for_liveness_no_firings_are_merged() -> None:
    assert not agglomerated(draft_of(LIVENESS, "a", *SEQUENCE))
