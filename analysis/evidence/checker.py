"""The checker: does this evidence show what it claims? It trusts nobody who made it.

It imports nothing that finds anything: no engine, no exploration, no proof method, no theory of structure. What it
needs is the firing rule, and z3 for the obligations, whose SMT-LIB text goes to any other solver as well. A firing
sequence is played by the reference player, token by token; a set of markings is fired through, marking by marking.

There are three answers. It shows the claim; the solver ran out of time, and nothing is known; or it does not show it,
and then the evidence is refused as an input that says something wrong. That says nothing on whether the claim is true.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NoReturn

from firable.analysis.evidence.certificate import FiringSequence, InductiveInvariant, MarkingSet
from firable.analysis.evidence.document import ClaimKind, Evidence
from firable.analysis.evidence.obligations import obligations, wrong_sums
from firable.analysis.induction.smt import Answer, decide
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import format_formula
from firable.nets.net import Marking
from firable.semantics.algebra import BOOL, Bitwise
from firable.semantics.firing import firable
from firable.semantics.formulas import evaluate
from firable.semantics.player import NotFirableError, Player, holds_in
from firable.semantics.trace import Discipline

TIMEOUT_MS: Final = 60_000

_SHOWS: Final = {
    FiringSequence: {ClaimKind.REACHABLE},
    InductiveInvariant: {ClaimKind.NEVER},
    MarkingSet: {ClaimKind.NEVER, ClaimKind.ALWAYS_POSSIBLE},
}


@dataclass(frozen=True, slots=True)
class Checked:
    """That the evidence shows its claim, or that the time was over first (`shown` is None), and how that was found."""

    shown: bool | None
    method: str
    bound: str = ""


def check_evidence(evidence: Evidence, *, timeout_ms: int = TIMEOUT_MS) -> Checked:
    """Check that the evidence shows what it claims; `timeout_ms` is for each obligation.

    Raises `InputError` F6002 where it does not.

    >>> from firable.analysis.evidence.document import Claim
    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import Deadlock
    >>> net, claim = family_net("philosophers-2"), Claim(ClaimKind.REACHABLE, Deadlock())
    >>> sequence = FiringSequence((("p1_takes_left",), ("p2_takes_left",)))
    >>> check_evidence(Evidence(net, Discipline.INTERLEAVING, claim, sequence)).shown
    True
    """
    certificate = evidence.certificate
    if evidence.claim.kind not in _SHOWS[type(certificate)]:
        _refuse(f"evidence of this kind cannot show '{evidence.claim}'")
    match certificate:
        case FiringSequence(firings):
            return _played(evidence, firings)
        case MarkingSet():
            return _fired_through(evidence, certificate)
        case InductiveInvariant():
            return _discharged(evidence, timeout_ms)


def _refuse(reason: str) -> NoReturn:
    message = f"the evidence does not show what it claims: {reason}"
    hint = "it was edited, or the technique that made it is wrong; whether the claim is true is not known from it"
    raise InputError([Diagnostic("F6002", message, hint)])


def _played(evidence: Evidence, firings: tuple[tuple[str, ...], ...]) -> Checked:
    net, player = evidence.net, Player(evidence.net)
    marking = net.initial_marking
    for number, names in enumerate(firings, start=1):
        fired = tuple(net.transition_index[name] for name in names)
        single = evidence.discipline is Discipline.INTERLEAVING
        allowed = len(fired) == 1 and net.transitions[fired[0]].openable if single else player.is_step(marking, fired)
        if not allowed or len(set(fired)) != len(fired):
            _refuse(f"firing {number}, {' + '.join(names) or 'of nothing'}, is none of this discipline")
        try:
            marking = player.fire(marking, fired)
        except NotFirableError as error:
            _refuse(f"firing {number}: {error}")
    if not evaluate(BOOL, net, evidence.claim.goal, holds_in(marking)):
        _refuse(f"after the firings ({format_formula(evidence.claim.goal)}) does not hold")
    return Checked(shown=True, method=f"{len(firings):,} firings played by the reference player")


def _discharged(evidence: Evidence, timeout_ms: int) -> Checked:
    for wrong in wrong_sums(evidence.net, evidence.certificate):
        _refuse(str(wrong))
    todo = obligations(evidence)
    method = f"{len(todo)} obligations discharged by z3, and the sums multiplied out"
    for obligation in todo:
        decision = decide(obligation.asserted, timeout_ms=timeout_ms)
        if decision.answer is Answer.UNKNOWN:
            return Checked(None, method, f"z3 gave up on '{obligation.name}': {decision.reason}")
        if decision.answer is Answer.SAT:
            full = [place.name for place in evidence.net.places if _true(decision.assignment, place.name)]
            _refuse(f"'{obligation.statement}' is refuted where hold a token: {', '.join(full) or 'none'}")
    return Checked(shown=True, method=method)


def _true(assignment: object, name: str) -> bool:
    return isinstance(assignment, dict) and bool(assignment.get(name, assignment.get(f"{name}@0")))


def _fired_through(evidence: Evidence, found: MarkingSet) -> Checked:
    net, player = evidence.net, Player(evidence.net)
    places = {marking: i for i, marking in enumerate(found.markings)}
    if net.initial_marking not in places:
        _refuse("the initial marking is not in the set")
    ranked = evidence.claim.kind is ClaimKind.ALWAYS_POSSIBLE
    if ranked != bool(found.distances):
        _refuse(f"'{evidence.claim}' wants {'a distance for each marking' if ranked else 'no distances'}")
    goal = _where(evidence, found.markings)
    enabled = _firable(evidence, found.markings) if evidence.discipline is Discipline.INTERLEAVING else None
    edges = 0
    for i, marking in enumerate(found.markings):
        if enabled is None:
            successors: Iterable[Marking] = (after for _, after in player.successors(marking, step=True))
        else:
            successors = (player.fire(marking, (t,)) for t, where in enabled if where >> i & 1)
        nearer = False
        for after in successors:
            edges += 1
            if after not in places:
                _refuse(f"a firing leads out of the set, to {_shown(evidence, after)}")
            nearer |= ranked and found.distances[places[after]] < found.distances[i]
        holds = bool(goal >> i & 1)
        if not ranked and holds:
            _refuse(f"the goal holds in {_shown(evidence, marking)}")
        if ranked and not (holds if not found.distances[i] else nearer):
            _refuse(f"nothing leads nearer to the goal from {_shown(evidence, marking)}")
    method = f"{len(found.markings):,} markings and {edges:,} firings gone through by the reference player"
    return Checked(shown=True, method=method)


def _columns(evidence: Evidence, markings: tuple[Marking, ...]) -> tuple[Bitwise[int], list[int]]:
    """For each place the markings of the list in which it holds a token, as one number, and the algebra of these."""
    columns = [0] * len(evidence.net.places)
    for p in range(len(columns)):
        digits = "".join("1" if marking >> p & 1 else "0" for marking in reversed(markings))
        columns[p] = int(digits or "0", 2)
    return Bitwise(true=(1 << len(markings)) - 1, false=0), columns


def _where(evidence: Evidence, markings: tuple[Marking, ...]) -> int:
    algebra, columns = _columns(evidence, markings)
    return evaluate(algebra, evidence.net, evidence.claim.goal, columns.__getitem__)


def _firable(evidence: Evidence, markings: tuple[Marking, ...]) -> list[tuple[int, int]]:
    """Each transition that may fire in some of the markings, and in which."""
    algebra, columns = _columns(evidence, markings)
    net = evidence.net
    openable = (t for t, transition in enumerate(net.transitions) if transition.openable)
    found = [(t, firable(algebra, net, t, columns.__getitem__)) for t in openable]
    return [(t, where) for t, where in found if where]


def _shown(evidence: Evidence, marking: Marking) -> str:
    return "{" + ", ".join(evidence.net.names(marking)) + "}"
