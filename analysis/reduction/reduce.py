"""Reduce a net until no rule applies, and lift what was found in the small net back to the given one.

Rules that read the arcs alone come first, because they are cheap and make everything after them cheaper. Then facts
are proved of the pairs of literals, which show what is implied and what may be agglomerated. Facts stay true while
the draft changes; only when nothing more follows from them are they proved anew, of what the net has become. Each
rule removes a transition or a place, or fires a transition early (each once), so this ends.

Whatever the deadline interrupts, between two applications of a rule the draft keeps the contract (see `draft`), so
there is always a result.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Rule, Step
from firable.analysis.goal import Limits
from firable.analysis.reduction.agglomeration import agglomerate
from firable.analysis.reduction.constants import remove_constants
from firable.analysis.reduction.copies import merge_places, remove_subsumed
from firable.analysis.reduction.draft import Draft, Move, Origin, Tail, flat
from firable.analysis.reduction.early import fire_early
from firable.analysis.reduction.goals import Goal, Labels, goal_of, rewritten, written_out
from firable.analysis.reduction.implied import remove_dead, remove_implied_gates, remove_implied_places
from firable.analysis.reduction.pairs import MATRIX_BYTES_MAX, NoFacts, Pairs, pairs
from firable.analysis.reduction.relevance import remove_irrelevant
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.nets.formula import Constant, Formula, Holds
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline


@dataclass(frozen=True, kw_only=True)
class _WithRuns:
    """A smaller net whose runs stand for runs of the `original` one, under interleaving, external gates free.

    `applied` counts the applications of each rule.
    """

    original: Net
    net: Net
    applied: Mapping[str, int]
    first: tuple[Origin, ...]
    moves: Mapping[str, Move]
    tails: tuple[Tail, ...]

    @property
    def summary(self) -> str:
        """What was reduced to what, by which rules: for the method of a verdict."""
        return _summary(self.original, self.net, self.applied)

    def _lifted(self, firings: Iterable[str]) -> list[int]:
        return [t for name in firings for t in flat(self.moves[name].origin)]

    def _from_the_start(self, firings: Iterable[str]) -> list[int]:
        return [*(t for origin in self.first for t in flat(origin)), *self._lifted(firings)]

    def _ended(self, fired: list[int]) -> tuple[list[int], Marking]:
        """A sequence followed by what the tails fire then, and where it leads."""
        marking = self._played(self.original.initial_marking, fired)
        for tail in reversed(self.tails):
            for move in tail.moves:
                if all(bool(marking >> place & 1) == value for place, value in move.needs.items()):
                    more = flat(move.origin)
                    marking = self._played(marking, more)
                    fired = [*fired, *more]
                    break
        return fired, marking

    def _played(self, marking: Marking, firings: Iterable[int]) -> Marking:
        """Where a firing sequence leads if it can be fired, which the reference player sees to afterwards."""
        for t in firings:
            masks = self.original.masks[t]
            marking = marking & ~masks.inputs | masks.outputs
        return marking


@dataclass(frozen=True, kw_only=True)
class Reduced(_WithRuns):
    """A smaller net in which the goal is reachable if and only if it is in the `original`, and the way back.

    `original_goal` and `goal` say the same of either net. `steps` lists the applications of rules for those who check
    them.
    """

    original_goal: Formula
    goal: Formula
    steps: tuple[Step, ...]

    def lift(self, firings: Iterable[str], note: str = "") -> Witness:
        """The firing sequence of the original net that a sequence of the reduced one into its goal stands for.

        It is replayed by the reference player and must end in the original goal; raises `WitnessError` otherwise.
        """
        found, marking = self._ended(self._from_the_start(firings))
        witnesses = Witnesses(self.original, Discipline.INTERLEAVING)
        witness = witnesses.replayed([(t,) for t in found], marking, note)
        if not evaluate(BOOL, self.original, self.original_goal, holds_in(marking)):
            raise WitnessError("the lifted firing sequence does not end in the goal")
        return witness


@dataclass(frozen=True, kw_only=True)
class ReducedRuns(_WithRuns):
    """A smaller net with a maximal run for each one of the `original`, and the way back.

    Of the two runs the `labels` have the same values in the same order, though one may stay longer with them. They
    give, for state formulas of the original net, what stands for them in the small one.
    """

    labels: Mapping[Formula, Formula]

    def lift(self, prefix: Iterable[str], cycle: Iterable[str]) -> tuple[list[int], list[int]]:
        """The run of the original net that a lasso, or without a cycle a run into a deadlock, stands for.

        The cycle closes there too: it can be fired again, so each place that it needs is as it was. Nothing is replayed
        here.
        """
        found, again = self._from_the_start(prefix), self._lifted(cycle)
        return (found, again) if again else (self._ended(found)[0], [])


@dataclass(frozen=True)
class ReducedBranches:
    """A smaller net that satisfies the formulas of CTL without X over some labels that the `original` one satisfies.

    `labels` give, for state formulas of the original net, what stands for them in the small one.
    """

    original: Net
    net: Net
    applied: Mapping[str, int]
    labels: Mapping[Formula, Formula]

    @property
    def summary(self) -> str:
        """What was reduced to what, by which rules: for the method of a verdict."""
        return _summary(self.original, self.net, self.applied)


@dataclass(frozen=True)
class ReducedTransitions:
    """A smaller net in which the transitions fire as in the `original` one, whatever has fired before.

    `transitions` says which transition of the small net each one of the original fires with: None for those that never
    fire. One is live, or fires at least once, exactly if its image is and does.
    """

    original: Net
    net: Net
    applied: Mapping[str, int]
    transitions: Mapping[str, str | None]

    @property
    def summary(self) -> str:
        """What was reduced to what, by which rules: for the method of a verdict."""
        return _summary(self.original, self.net, self.applied)


def _summary(original: Net, small: Net, applied: Mapping[str, int]) -> str:
    before = f"{len(original.places)}/{len(original.transitions)}"
    after = f"{len(small.places)}/{len(small.transitions)}"
    rules = ", ".join(f"{rule} {times}" for rule, times in sorted(applied.items()))
    return f"reduction from {before} to {after} places/transitions by {rules or 'no rule'}"


def reduce_for_goal(net: Net, goal: Formula, limits: Limits | None = None, facts: Pairs | None = None) -> Reduced:
    """Reduce a net, preserving whether a state formula is reachable under interleaving.

    A goal that is `deadlock`, alone or in conjunction, keeps what deadlocks there are; any other goal lets go of all
    that does not lead to it. Cost: linear in the arcs but for the facts on pairs, which are bounded, and less with
    `facts_on` the net; stops at the deadline with what it has by then. Steps of a reduction with such facts are none
    that a checker can take.

    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.net import Net, Place, Transition
    >>> ring = Net("ring", (Place("a", marked=True), Place("b"), Place("c")), (
    ...     Transition("t", ("a",), ("b",)), Transition("u", ("b",), ("c",)), Transition("v", ("c",), ("a",))))
    >>> reduced = reduce_for_goal(ring, parse_formula("c"))
    >>> len(reduced.net.places), reduced.lift([]).firings
    (0, (('t',), ('u',)))
    """
    limits = limits or Limits()
    draft = Draft(net, goal_of(net, goal), limits.deadline)
    _reduce(draft, limits, facts)
    small, numbers = draft.as_net()
    assert isinstance(draft.goal, Goal)
    moves = {name: draft.moves[number] for name, number in numbers.items()}
    return Reduced(
        original=net,
        net=small,
        applied=draft.applied,
        first=tuple(draft.first),
        moves=moves,
        tails=tuple(draft.tails),
        original_goal=goal,
        goal=draft.goal.as_formula(),
        steps=tuple(draft.steps),
    )


def facts_on(net: Net, limits: Limits) -> Pairs | None:
    """What is proved of the pairs of places of a net, for all that is asked of it; None where a limit is met.

    Of copies and constants, which each reduction removes first, nothing is said.

    Raises `BudgetExceeded` where the deadline comes before the net is read.
    """
    draft = Draft(net, Labels(tuple(Holds(place.name) for place in net.places)), limits.deadline)
    changed = True
    while changed and not limits.deadline.over:
        changed = remove_constants(draft)
        changed = merge_places(draft) or changed
    return pairs(draft, None, limits.deadline, _matrix_bytes_max(limits))


def reduce_for_runs(
    net: Net, labels: Sequence[Formula], limits: Limits | None = None, facts: Pairs | None = None
) -> ReducedRuns:
    """Reduce a net, keeping for each maximal run one that goes through the same values of some state formulas.

    A maximal run goes on for ever or ends in a deadlock; how long one stays with each value is not kept. So a formula
    of LTL over these that has no X holds in the one net if and only if it holds in the other (Poitrenaud and
    Pradat-Peyre 2000, "Pre- and post-agglomerations for LTL model checking"). The rules are those that keep deadlocks,
    which look besides that no move is put off or made early that changes a label: so their proofs, which put firings in
    another order, are of infinite runs too. What they add to such a run or leave out is one firing that changes none.

    Cost: as of `reduce_for_goal`; of large nets less than half of it with `facts_on` them.

    Raises `BudgetExceeded` where the deadline comes before the net is read.

    >>> from firable.nets.formula import Holds
    >>> from firable.nets.catalogue.families import family_net
    >>> net = family_net("pipeline-8")
    >>> reduced = reduce_for_runs(net, [Holds(net.places[0].name)])
    >>> len(reduced.net.places) < len(net.places)
    True
    """
    limits = limits or Limits()
    draft = Draft(net, Labels(tuple(rewritten(written_out(net, of), {}) for of in labels)), limits.deadline)
    _reduce(draft, limits, facts)
    small, numbers = draft.as_net()
    assert isinstance(draft.goal, Labels)
    return ReducedRuns(
        original=net,
        net=small,
        applied=draft.applied,
        first=tuple(draft.first),
        moves={name: draft.moves[number] for name, number in numbers.items()},
        tails=tuple(draft.tails),
        labels=dict(zip(labels, draft.goal.formulas, strict=True)),
    )


def reduce_for_branches(
    net: Net, labels: Sequence[Formula], limits: Limits | None = None, facts: Pairs | None = None
) -> ReducedBranches:
    """Reduce a net, keeping which formulas of CTL without X over some state formulas M0 satisfies.

    Each marking of the one net has one of the other that satisfies the same of them (branching bisimilarity that is
    sensitive to divergence; Browne, Clarke and Grumberg 1988, "Characterizing finite Kripke structures in
    propositional temporal logic", for CTL without X). Rules and cost are those of `reduce_for_runs`, but that firings
    are put together only where no choice is between them (`agglomeration`).

    Raises `BudgetExceeded` where the deadline comes before the net is read.

    >>> from firable.nets.formula import Holds
    >>> from firable.nets.catalogue import catalogue_net
    >>> net = catalogue_net("one_robot")
    >>> reduced = reduce_for_branches(net, [Holds("mc.machining")])
    >>> len(net.places), len(reduced.net.places)
    (28, 1)
    """
    limits = limits or Limits()
    given = tuple(rewritten(written_out(net, of), {}) for of in labels)
    draft = Draft(net, Labels(given, branching=True), limits.deadline)
    _reduce(draft, limits, facts)
    assert isinstance(draft.goal, Labels)
    small, _ = draft.as_net()
    return ReducedBranches(net, small, draft.applied, dict(zip(labels, draft.goal.formulas, strict=True)))


def reduce_for_liveness(net: Net, limits: Limits | None = None) -> ReducedTransitions:
    """Reduce a net, preserving for each transition whether it is live and whether it ever fires, under interleaving.

    Only by the rules that leave the graph of markings as it is, but for places that follow from others or that nobody
    needs: each marking enables the same transitions as its image. Whether there is a deadlock is preserved too. How
    many markings there are is not, nor whether M0 can be reached again: two of them may have one image.
    """
    limits = limits or Limits()
    draft = Draft(net, None, limits.deadline)
    _reduce(draft, limits)
    small, numbers = draft.as_net()
    names = {number: name for name, number in numbers.items()}
    images: dict[str, str | None] = {}
    for t, transition in enumerate(net.transitions):
        number = t
        while number in draft.same_as:
            number = draft.same_as[number]
        images[transition.name] = names.get(number)
    return ReducedTransitions(net, small, draft.applied, images)


def _matrix_bytes_max(limits: Limits) -> int:
    return min(MATRIX_BYTES_MAX, limits.memory_bytes // 4)


def _reduce(draft: Draft, limits: Limits, facts: Pairs | None = None) -> None:
    """Apply all rules until none applies, or the deadline comes; with facts that are proved of the net already."""
    deadline, matrix_bytes_max = limits.deadline, _matrix_bytes_max(limits)
    fired: set[int] = set()
    fresh = False
    if facts is not None:
        _by_arcs(draft, fired, deadline)
        draft.touch_all()
    while not deadline.over:
        changed = facts is not None and _by_facts(draft, facts, deadline)
        if fresh and not changed:
            return
        _by_arcs(draft, fired, deadline)
        fresh = not changed
        if fresh:
            facts = pairs(draft, facts, deadline, matrix_bytes_max)
            draft.touch_all()
            if facts is not None:
                draft.note(Rule.FACTS)
            else:
                if agglomerate(draft, NoFacts(), deadline):
                    _by_arcs(draft, fired, deadline)
                return


def _by_arcs(draft: Draft, fired: set[int], deadline: Deadline) -> None:
    """Apply the rules that read the arcs alone until none applies."""
    changed = True
    while changed and not deadline.over:
        changed = remove_constants(draft)
        _settle(draft)
        changed = remove_irrelevant(draft) or changed
        changed = merge_places(draft) or changed
        changed = remove_subsumed(draft) or changed
        changed = (draft.goal is not None and fire_early(draft, fired)) or changed


def _settle(draft: Draft) -> None:
    """Let go of deadlocks where there can be none, because a move needs nothing or the goal is false."""
    if isinstance(draft.goal, Goal) and draft.goal.deadlock:
        if (free := next((number for number, move in draft.moves.items() if not move.needs), None)) is not None:
            draft.note(Rule.ALWAYS, (free,))
            draft.settle(Goal(Constant(value=False)))
        elif draft.goal.is_false:
            draft.settle(Goal(draft.goal.formula))


def _by_facts(draft: Draft, facts: Pairs, deadline: Deadline) -> bool:
    """Apply the rules that rest on facts, each once; whether something changed."""
    changed = remove_dead(draft, facts, deadline)
    changed = remove_implied_gates(draft, facts, deadline) or changed
    changed = remove_implied_places(draft, facts, deadline) or changed
    return agglomerate(draft, facts, deadline) or changed
