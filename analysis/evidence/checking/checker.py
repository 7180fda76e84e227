"""The checker: does this evidence show what it claims? It trusts nobody who made it.

It imports nothing that finds anything: no engine, no exploration, no proof method, no theory of structure. What it
needs is the firing rule, and z3 for the obligations, whose SMT-LIB text goes to any other solver as well. A firing
sequence is played by the reference player, token by token; listed markings are fired through, one by one, and labels,
ranks and tableaux looked through there; a decision diagram is found closed under each transition by a few operations
of its own.

There are three answers. It shows the claim; the time was over, and nothing is known; or it does not show it, and then
the evidence is refused as an input that says something wrong. That says nothing on whether the claim is true.

A verdict is shown where the claims that are shown suffice for it (`firable.analysis.evidence.meaning`); one that no
claim shows is only claimed, and told so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import (
    Certificate,
    Continuation,
    Diagram,
    FiringSequence,
    InductiveInvariant,
    Label,
    Labelling,
    Markings,
    Progress,
    Reduction,
    StubbornSets,
    Theorem,
    Unfolded,
)
from firable.analysis.evidence.checking.closed import Closed
from firable.analysis.evidence.checking.diagrams import Diagrams
from firable.analysis.evidence.checking.labelling import LabelledSpace, labelled
from firable.analysis.evidence.checking.listed import Listed, Part
from firable.analysis.evidence.checking.obligation import Evidence, Obligation, TimedTerms
from firable.analysis.evidence.checking.obligations import (
    contact_free,
    continued,
    diagram_term,
    obligations,
    played,
    wrong_sums,
)
from firable.analysis.evidence.checking.progress import check_progress
from firable.analysis.evidence.checking.reduced import left_of
from firable.analysis.evidence.checking.runs import check_refuting_run, check_unanswered_run, holds
from firable.analysis.evidence.checking.siphons import of_siphons
from firable.analysis.evidence.checking.stubborn import Stubborn
from firable.analysis.evidence.checking.theorems import check_premises
from firable.analysis.evidence.checking.unfolding import Unfolding
from firable.analysis.evidence.claims import Claim, ClaimKind, as_ctl
from firable.analysis.evidence.document import Document, Record
from firable.analysis.evidence.meaning import suffices
from firable.analysis.evidence.refusal import TimeIsOverError, refuse
from firable.analysis.induction.smt import Answer, decide
from firable.nets.diagnostics import InputError
from firable.nets.formula import format_formula
from firable.nets.net import Net
from firable.nets.queries import parse_query
from firable.nets.temporal import format_temporal
from firable.nets.verdict import counted
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

TIMEOUT_MS: Final = 60_000
EDGES_MAX: Final = 100_000
"""Of how many listed markings all firings are gone through by the reference player, and kept."""

_SHOWS: Final = {
    FiringSequence: {
        *(ClaimKind.REACHABLE, ClaimKind.FIRES, ClaimKind.IN_ORDER, ClaimKind.LATER, ClaimKind.UNORDERED),
        *(ClaimKind.NOT_LTL, ClaimKind.NOT_LEADS_TO),
    },
    InductiveInvariant: {ClaimKind.NEVER},
    Labelling: {
        *(ClaimKind.NEVER, ClaimKind.REACHABLE, ClaimKind.ALWAYS_POSSIBLE, ClaimKind.LOST, ClaimKind.CTL),
        ClaimKind.ORDERED,
    },
    StubbornSets: {ClaimKind.NEVER},
    Reduction: {ClaimKind.NEVER},
    Continuation: {ClaimKind.LOST},
    Progress: {ClaimKind.LEADS_TO},
    Theorem: {ClaimKind.LIVE, ClaimKind.HOME, ClaimKind.ALWAYS_POSSIBLE},
    Unfolded: {ClaimKind.LTL},
}

_BY_DEFINITION: Final = {"starvation": "the arbitrated run played"}


@dataclass(frozen=True, slots=True)
class Checked:
    """That the evidence shows its claim, or that the time was over first (`shown` is None), and how that was found."""

    shown: bool | None
    method: str
    bound: str = ""


@dataclass(frozen=True, slots=True)
class CheckedRecord:
    """A verdict of a document: whether it is shown, by what, and what of it is only claimed."""

    record: Record
    shown: bool
    methods: tuple[str, ...]
    only_claimed: str = ""


def check_evidence(evidence: Evidence, *, timeout_ms: int = TIMEOUT_MS) -> Checked:
    """Check that the evidence shows what it claims; `timeout_ms` is for each obligation.

    Raises `InputError` F6002 where it does not.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import Deadlock
    >>> from firable.semantics.trace import Discipline
    >>> net, claim = family_net("philosophers-2"), Claim(ClaimKind.REACHABLE, Deadlock())
    >>> sequence = FiringSequence((("p1_takes_left",), ("p2_takes_left",)))
    >>> check_evidence(Evidence(net, Discipline.INTERLEAVING, claim, sequence)).shown
    True
    """
    return _Checker(timeout_ms).check(evidence)


def check_document(document: Document, *, timeout_ms: int = TIMEOUT_MS) -> Iterator[CheckedRecord]:
    """Check a document, verdict by verdict.

    Raises `InputError` F6002 at the first verdict with a certificate that does not show its claim.
    """
    checker = _Checker(timeout_ms)
    for record in document.records:
        try:
            yield _checked(checker, document, record)
        except InputError as error:
            named = [replace(one, message=f"{record.name}: {one.message}") for one in error.diagnostics]
            raise InputError(named if record.name else error.diagnostics) from None


def _checked(checker: _Checker, document: Document, record: Record) -> CheckedRecord:
    net, discipline = document.net, document.discipline
    checked = [checker.check(Evidence(net, discipline, claim, of)) for claim, of in record.shown]
    methods = tuple(dict.fromkeys(one.method for one in checked))
    if late := [one.bound for one in checked if one.shown is None]:
        return CheckedRecord(record, shown=False, methods=methods, only_claimed=late[0])
    if not record.name:
        return CheckedRecord(record, shown=bool(checked), methods=methods)
    claims = [claim for claim, _ in record.shown]
    query = parse_query(record.query, record.name.partition(".")[2]) if record.query else None
    try:
        enough = suffices(net, discipline, record.name, record.proved, claims, query, checker.deadline)
    except TimeIsOverError as error:
        return CheckedRecord(record, shown=False, methods=methods, only_claimed=str(error))
    if enough and not record.lacking:
        return CheckedRecord(
            record, shown=True, methods=methods or (_BY_DEFINITION.get(record.name, "the net itself"),)
        )
    reason = record.lacking or "what is shown does not say so"
    return CheckedRecord(record, shown=False, methods=methods, only_claimed=f"only claimed: {reason}")


@dataclass
class _Checker:
    """What is found of a set once serves all claims that rest on it, and of a claim, wherever it stands again."""

    timeout_ms: int
    _claims: dict[Claim, tuple[Net, Certificate, Checked]] = field(default_factory=dict)
    _spaces: list[tuple[Net, Markings | Diagram, Listed | Closed | Diagrams]] = field(default_factory=list)
    _parts: list[tuple[Net, Markings, Part]] = field(default_factory=list)

    def check(self, evidence: Evidence) -> Checked:
        """Check one claim."""
        claim, certificate = evidence.claim, evidence.certificate
        net, known, checked = self._claims.get(claim, (None, None, None))
        if checked is not None and net is evidence.net and known is certificate:
            return checked
        checked = self._shown(evidence)
        self._claims[claim] = evidence.net, certificate, checked
        return checked

    def _shown(self, evidence: Evidence) -> Checked:
        claim, certificate = evidence.claim, evidence.certificate
        if claim.kind not in _SHOWS[type(certificate)]:
            refuse(f"evidence of this kind cannot show '{claim}'")
        try:
            return self._check(evidence, certificate)
        except TimeIsOverError as error:
            return Checked(None, "not all was gone through", str(error))

    def _check(self, evidence: Evidence, certificate: Certificate) -> Checked:
        net, discipline, claim = evidence.net, evidence.discipline, evidence.claim
        match certificate:
            case FiringSequence():
                return _run(evidence, certificate, self.deadline)
            case InductiveInvariant():
                return self._discharged(evidence)
            case Labelling(space, labels):
                return self._labelled(evidence, space, labels)
            case StubbornSets():
                if discipline is not Discipline.INTERLEAVING:
                    refuse("stubborn sets are checked under interleaving only")
                stubborn = Stubborn(net, certificate, self.deadline)
                stubborn.check(claim.state_goal)
                markings, firings = counted(len(stubborn.markings), "marking"), counted(stubborn.n_firings, "firing")
                words = f"{markings} with stubborn sets, and {firings}"
                return Checked(shown=True, method=f"{words}, looked through")
            case Reduction():
                left = left_of(evidence, self.deadline)
                late = self._unsolved(evidence, left.obligations)
                if left.rest is None or late:
                    return Checked(None if late else True, left.words, late)
                rest = self.check(left.rest)
                return replace(rest, method=f"{left.words}, and of what is left: {rest.method}")
            case Continuation(firings):
                rest = self.check(continued(evidence, self.deadline))
                return replace(rest, method=f"{counted(len(firings), 'firing')} played, and from there: {rest.method}")
            case Progress(space):
                listed = self._listed(evidence, space)
                check_progress(listed, claim, certificate)
                return Checked(shown=True, method=f"{listed.method}, and their ranks looked through")
            case Theorem(name):
                check_premises(net, discipline, claim, certificate)
                premise = self.check(contact_free(evidence))
                siphons = of_siphons(net, certificate, TimedTerms(deadline=self.deadline))
                late = self._unsolved(evidence, siphons)
                words = f"premises of the theorem on nets of the class '{name}' checked; {premise.method}"
                if premise.shown is None or late:
                    return Checked(None, words, premise.bound or late)
                return Checked(shown=True, method=words)
            case Unfolded(space):
                part = self._part(evidence, space)
                unfolding = Unfolding(part, claim.goal, self.deadline)
                unfolding.check()
                return Checked(shown=True, method=f"{part.method}, {unfolding.nodes:,} nodes of a tableau on them")

    @property
    def deadline(self) -> Deadline:
        """The end of what begins now."""
        return Deadline.after(self.timeout_ms / 1000)

    def _space(
        self, evidence: Evidence, of: Markings | Diagram, *, one_by_one: bool = False
    ) -> Listed | Closed | Diagrams:
        single = evidence.discipline is Discipline.INTERLEAVING
        kind: type[Listed | Closed | Diagrams] = Diagrams if isinstance(of, Diagram) else Listed
        if isinstance(of, Markings) and single and not one_by_one and len(of.markings) > EDGES_MAX:
            kind = Closed
        for net, known, space in self._spaces:
            # Of a continuation the net is made anew each time, with the same transitions. What a reduction leaves may
            # have none, as all that is left by others; then the numbers of a marking stand for other places.
            same = net.transitions is evidence.net.transitions and net.place_index == evidence.net.place_index
            if same and net.initial_marking == evidence.net.initial_marking and known is of and type(space) is kind:
                return space
        if isinstance(of, Diagram):
            if not single:
                refuse("a decision diagram is checked under interleaving only")
            made: Listed | Closed | Diagrams = Diagrams(evidence.net, of, self.deadline)
        elif kind is Closed:
            made = Closed(evidence.net, of.markings, self.deadline)
        else:
            made = Listed(evidence.net, evidence.discipline, of.markings, self.deadline)
        self._spaces.append((evidence.net, of, made))
        return made

    def _part(self, evidence: Evidence, of: Markings) -> Part:
        """Markings of which nothing is asked but what fires in them: never one of `_spaces`, which are closed."""
        for net, known, part in self._parts:
            if net is evidence.net and known is of:
                return part
        made = Part(evidence.net, evidence.discipline, of.markings, self.deadline)
        self._parts.append((evidence.net, of, made))
        return made

    def _listed(self, evidence: Evidence, of: Markings) -> Listed:
        space = self._space(evidence, of, one_by_one=True)
        if not isinstance(space, Listed):
            raise TypeError("listed markings are gone through one by one")
        return space

    def _labelled(self, evidence: Evidence, of: Markings | Diagram, labels: tuple[Label, ...]) -> Checked:
        claim = evidence.claim
        space = self._space(evidence, of)
        if not isinstance(space, Listed):
            space.deadline = self.deadline
        if claim.kind is ClaimKind.NEVER and not labels:
            if isinstance(space, Diagrams) and isinstance(of, Diagram) and not space.is_cube(claim.state_goal):
                return self._excluded(evidence, of, space)
            found = space.where(claim.state_goal)
            if found if isinstance(found, int) else any(found):
                refuse(f"the goal ({format_formula(claim.state_goal)}) holds in a marking of the set")
            return Checked(shown=True, method=space.method)
        if claim.kind is ClaimKind.ORDERED and not labels:
            return _ordered(space)
        _require_initially(space, claim, labels)
        return Checked(shown=True, method=f"{space.method}{', and the labels looked through' if labels else ''}")

    def _excluded(self, evidence: Evidence, of: Diagram, space: Diagrams) -> Checked:
        """That a goal of many parts holds in no marking of a diagram is a question to the solver."""
        terms, net = TimedTerms(deadline=self.deadline), evidence.net
        holds_at = [terms.variable(place.name) for place in net.places]
        among = diagram_term(terms, net, of, holds_at.__getitem__)
        goal = evaluate(terms, net, evidence.claim.state_goal, holds_at.__getitem__)
        todo = Obligation("goal", "the goal holds in no marking of the set", (among, goal))
        late = self._unsolved(evidence, [todo])
        return Checked(None if late else True, f"{space.method}, the goal excluded by z3", late)

    def _discharged(self, evidence: Evidence) -> Checked:
        for wrong in wrong_sums(evidence.net, evidence.certificate):
            refuse(str(wrong))
        todo = obligations(evidence, self.deadline)
        late = self._unsolved(evidence, todo)
        method = f"{len(todo)} obligations discharged by z3, and the sums multiplied out"
        return Checked(None if late else True, method, late)

    def _unsolved(self, evidence: Evidence, todo: tuple[Obligation, ...] | list[Obligation]) -> str:
        """Why an obligation is open; refused where one does not hold."""
        for obligation in todo:
            decision = decide(obligation.asserted, timeout_ms=self.timeout_ms)
            if decision.answer is Answer.UNKNOWN:
                return f"z3 gave up on '{obligation.name}': {decision.reason}"
            if decision.answer is Answer.SAT:
                full = [place.name for place in evidence.net.places if _true(decision.assignment, place.name)]
                refuse(f"'{obligation.statement}' is refuted where hold a token: {', '.join(full) or 'none'}")
        return ""


def _ordered(space: Listed | Closed | Diagrams) -> Checked:
    """Refuse a set of markings with a step that no order replays; under interleaving each firing is one."""
    if isinstance(space, Listed):
        steps = {fired for row in space.edges for fired, _ in row if len(fired) > 1}
        for fired in steps:
            if not space.player.serialisable(fired):
                names = (space.net.transitions[t].name for t in fired)
                refuse(f"the step of {' + '.join(names)} has no order")
    return Checked(shown=True, method=f"{space.method}, and the steps put in order")


def _require_initially(space: Listed | Closed | Diagrams, claim: Claim, labels: tuple[Label, ...]) -> None:
    """Refuse labels that do not show the claim of M0."""
    formula = as_ctl(claim)
    if formula is None:
        refuse(f"'{claim}' wants no labels")
    of: LabelledSpace[Any] = space
    if not of.holds_initially(labelled(of, formula, labels)):
        refuse(f"the labels do not say that ({format_temporal(formula)}) holds in the initial marking")


def _true(assignment: object, name: str) -> bool:
    return isinstance(assignment, dict) and bool(assignment.get(name, assignment.get(f"{name}@0")))


def _run(evidence: Evidence, of: FiringSequence, deadline: Deadline) -> Checked:
    net, discipline, claim = evidence.net, evidence.discipline, evidence.claim
    method = f"{counted(len(of.firings) + len(of.cycle), 'firing')} played by the reference player"
    match claim.kind:
        case ClaimKind.NOT_LTL:
            check_refuting_run(net, discipline, claim, of, deadline)
            return Checked(shown=True, method=f"{method}, and the formula evaluated along them")
        case ClaimKind.NOT_LEADS_TO:
            check_unanswered_run(net, discipline, claim, of, deadline)
            return Checked(shown=True, method=f"{method}, a run that is fair and has no answer")
    if of.cycle:
        refuse("a run into a marking has no cycle")
    if claim.kind is ClaimKind.UNORDERED:
        played(net, discipline, of.firings, deadline)
        last = [net.transition_index[name] for name in of.firings[-1]] if of.firings else []
        if Player(net).serialisable(last):
            refuse("the last step of the run can be replayed one firing after the other")
        return Checked(shown=True, method=f"{method}, the last of which have no order")
    markings = played(net, discipline, of.firings, deadline)
    if claim.kind is ClaimKind.REACHABLE:
        if not holds(net, claim.state_goal, markings[-1]):
            refuse(f"after the firings ({format_formula(claim.state_goal)}) does not hold")
        return Checked(shown=True, method=method)
    begin = next((i for i, marking in enumerate(markings) if holds(net, claim.state_goal, marking)), None)
    if begin is None:
        refuse(f"({format_formula(claim.state_goal)}) holds nowhere on the run")
    if claim.kind is ClaimKind.LATER:
        if not any(holds(net, claim.then, marking) for marking in markings[begin:]):
            refuse(f"({format_formula(claim.then)}) holds nowhere on the run after that goal")
    elif claim.kind is ClaimKind.IN_ORDER:
        _require_in_order(claim, of.firings[begin:])
    elif left := set(claim.fires) - {name for fired in of.firings[begin:] for name in fired}:
        refuse(f"the run does not fire {min(left)}")
    return Checked(shown=True, method=method)


def _require_in_order(claim: Claim, firings: Sequence[Sequence[str]]) -> None:
    """Refuse firings of which none, one moment after the other, are those of the claim; a step is one moment."""
    wanted = list(claim.fires)
    for fired in firings:
        if wanted and wanted[0] in fired:
            wanted.pop(0)
    if wanted:
        refuse(f"the run does not fire {', and later '.join(claim.fires)}")
