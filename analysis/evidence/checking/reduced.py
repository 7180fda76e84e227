"""What a reduction leaves to be shown: that a goal is never met in a part of the small net.

The steps are applied (`firable.analysis.evidence.checking.reductions`). What is left is a net again, its transitions
the moves, in the order of their numbers, so that the other kinds of certificates speak of it as they do of any net. It
is made here, and never read from the document: a certificate for another net shows nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import dataclass

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import (
    Diagram,
    InductiveInvariant,
    Labelling,
    Markings,
    Reduction,
    StubbornSets,
)
from firable.analysis.evidence.checking.obligation import Evidence, Obligation
from firable.analysis.evidence.checking.reductions import Draft
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.refusal import refuse
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, names_in
from firable.nets.net import Net, Place, Transition
from firable.semantics.formulas import evaluate
from firable.semantics.trace import Discipline


@dataclass(frozen=True, slots=True)
class Left:
    """What the steps leave to be shown, and what they did in words."""

    obligations: tuple[Obligation, ...]
    rest: Evidence | None
    words: str


def left_of(evidence: Evidence, deadline: Deadline) -> Left:
    """What a reduction leaves to be shown; refused where a step cannot be taken, raises `TimeIsOverError`."""
    of, net = evidence.certificate, evidence.net
    if not isinstance(of, Reduction):
        raise TypeError("the evidence is no reduction")
    if evidence.discipline is not Discipline.INTERLEAVING:
        refuse("reductions are about single firings")
    draft = Draft(net, evidence.claim.state_goal, deadline)
    for step in of.steps:
        draft.apply(step)
    places = frozenset(net.place_index[name] for name in of.part)
    if not places <= draft.values.keys():
        refuse("the part that is left has a place that was taken out")
    size = f"{len(net.places)}/{len(net.transitions)} to {len(draft.values)}/{len(draft.moves)} places/transitions"
    words = f"{len(of.steps):,} steps of a reduction from {size} gone through"
    if of.then is None:
        if of.part or of.goal != Constant(value=False):
            refuse("a part of the net is named, or its goal, and nothing shows anything of it")
        if draft.deadlock and draft.never_dead:
            return Left((), None, words)
        nothing = Obligation("goal", "after the steps of the reduction the goal is false", (draft.goal,))
        return Left((nothing,), None, words)
    small = small_net(draft, places)
    _require_fitting(small, of.goal, of.then)
    said = evaluate(draft.terms, small, of.goal, lambda p: draft.terms.variable(small.places[p].name))
    statement = "the goal of what is left holds wherever that of the net does"
    weaker = Obligation("weaker", statement, (draft.goal, draft.terms.negation(said)))
    claim = Claim(ClaimKind.NEVER, asked_of(of.goal, deadlock=draft.deadlock))
    return Left((weaker,), Evidence(small, Discipline.INTERLEAVING, claim, of.then), words)


def asked_of(goal: Formula, *, deadlock: bool) -> Formula:
    """The goal of what is left as one state formula."""
    if not deadlock:
        return goal
    return Deadlock() if goal == Constant(value=True) else And((Deadlock(), goal))


def small_net(draft: Draft, places: Iterable[int]) -> Net:
    """The net of the moves around these places; refused where a move has to do with others too."""
    kept = frozenset(places)
    names = {one.name for kind in (draft.net.places, draft.net.transitions, draft.net.signals) for one in kind}
    transitions = []
    for number in sorted(draft.moves):
        around = draft.moves[number][0].keys()
        if around <= kept:
            transitions.append(_transition(draft, number, names))
        elif around & kept:
            refuse("a transition has to do with places of the part that is left and with others")
    of = draft.net.places
    return Net(
        draft.net.name,
        tuple(Place(of[p].name, marked=draft.values[p]) for p in sorted(kept)),
        tuple(transitions),
    )


def _transition(draft: Draft, number: int, taken: Set[str]) -> Transition:
    """The move as a transition, under its name if it is one of the net's; its number for a name else."""
    name = f"{number}"
    if number < len(draft.net.transitions):
        name = draft.net.transitions[number].name
    else:
        while name in taken:
            name += "-"
    (needs, flips), of = draft.moves[number], draft.net.places

    def named(*, flipped: bool, value: bool) -> tuple[str, ...]:
        return tuple(of[p].name for p in sorted(needs) if needs[p] is value and (p in flips) is flipped)

    return Transition(
        name,
        named(flipped=True, value=True),
        named(flipped=True, value=False),
        named(flipped=False, value=True),
        named(flipped=False, value=False),
    )


def _require_fitting(small: Net, goal: Formula, then: InductiveInvariant | Labelling | StubbornSets) -> None:
    """Refuse a certificate that speaks of what the small net does not have."""
    atoms = list(names_in(goal))
    places = [one.place for one in atoms if isinstance(one, Holds)]
    fits = all(one.transition in small.transition_index for one in atoms if isinstance(one, Firable))
    match then:
        case InductiveInvariant(equations, clauses, _, inequalities):
            places += [name for one in equations for name, _ in one.weights]
            places += [name for one in inequalities for name, _ in one.weights]
            places += [name for one in clauses for name in (*one.marked, *one.empty)]
        case Labelling(space, labels):
            fits = fits and not labels and _fit(small, space)
        case StubbornSets(space, sets):
            fits = fits and _fit(small, space) and not any(one >> len(small.transitions) for one in sets)
    if not fits or not all(name in small.place_index for name in places):
        refuse("what is said of the net that is left speaks of something that it does not have")


def _fit(small: Net, space: Markings | Diagram) -> bool:
    return isinstance(space, Diagram) or not any(one >> len(small.places) for one in space.markings)
