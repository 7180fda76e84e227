"""Evidence for what `check` decided: each verdict brought down to claims, and each claim to a certificate.

Which claims a verdict comes down to is the matter of `firable.analysis.evidence.meaning`, which also judges them; here
stands which of several ways is tried, and in which order. What cannot be had is said in the document, with the reason.
The run that decided hands over what it held: its state space, and the findings of techniques that leave a certificate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import combinations
from typing import Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.evidence.by_goals import goal_claim, said_by_goals
from firable.analysis.evidence.certificate import Certificate, FiringSequence
from firable.analysis.evidence.checking.obligations import played
from firable.analysis.evidence.checking.runs import holds
from firable.analysis.evidence.claims import TRUE, Claim, ClaimKind, is_marking, temporal_claim, tidy
from firable.analysis.evidence.document import Document, Record, order_of
from firable.analysis.evidence.meaning import (
    commands,
    commands_clash,
    compete,
    competing,
    completions_clash,
    contact,
    in_each_deadlock,
    never_beside,
    property_claim,
    senders,
    some_firable,
    suffices,
    tokens_at_least,
)
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import NO_TIME, LackingError, which_ended
from firable.analysis.evidence.producing.room import Room
from firable.analysis.evidence.read_off import eager_cycle, read_off
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.goal import Finding, Limits
from firable.analysis.report import CheckReport
from firable.analysis.verdicts.behaviour import DEADLOCK_FREE
from firable.nets.formula import And, Deadlock, Firable, Formula, Holds, Not, Start
from firable.nets.net import Marking, Property, TemporalProperty
from firable.nets.queries import Query, QueryKind, format_query
from firable.nets.temporal import Logic, Temporal, TemporalAnd, TemporalNot, TemporalOr
from firable.nets.verdict import Status, Verdict, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in

Shown = list[tuple[Claim, Certificate]]
STABLE_PLACES_MAX: Final = 500


def evidence_of_report(report: CheckReport, queries: Sequence[Query] = (), limits: Limits | None = None) -> Document:
    """The document on all that a report decides.

    >>> from firable.analysis.check import check
    >>> from firable.nets.catalogue import catalogue_net
    >>> document = evidence_of_report(check(catalogue_net("conceptual_one_robot")))
    >>> [record.lacking for record in document.records if record.lacking]
    []
    """
    findings = [finding for of in report.findings.values() for finding in of]
    space = report.space if report.space.complete else None
    certifier = Certifier(report.net, report.discipline, limits or Limits(), space, findings)
    one = _Verdicts(certifier, {query.name: query for query in queries}, report.findings)
    deadlocked = [v for v in report.verdicts if v.name == DEADLOCK_FREE.name and v.status is Status.VIOLATED]
    certifier.deadlock = next((verdict.witness for verdict in deadlocked), None)
    decided = [verdict for verdict in report.verdicts if verdict.status is not Status.UNKNOWN]
    return Document(report.net, report.discipline, tuple(map(one.record, decided)))


class _Verdicts:
    """The records of the verdicts of one report."""

    def __init__(
        self,
        certifier: Certifier,
        queries: Mapping[str, Query],
        findings: Mapping[str, Sequence[tuple[Formula, Finding]]],
    ) -> None:
        self.certifier, self.queries, self.findings = certifier, queries, findings
        self.net = certifier.net
        self._live: dict[tuple[str, ...], Shown | str] = {}
        self._room = Room()

    def record(self, verdict: Verdict) -> Record:
        """What shows a decided verdict, or why nothing does."""
        net, discipline = self.net, self.certifier.discipline
        query = self.queries.get(verdict.name.removeprefix("query.")) if verdict.name.startswith("query.") else None
        proved, lacking, shown = verdict.status is Status.PROVED, "", Shown()
        if read_off(net, discipline, verdict.name) is None:
            try:
                shown = list(self._shown(verdict, query, proved))
            except LackingError as error:
                lacking = str(error)
            except (BudgetExceeded, IncompleteGraph) as error:
                lacking = which_ended(error)  # of what was looked for beside the claims themselves
        once = {order_of(claim): (claim, certificate) for claim, certificate in reversed(shown)}
        shown = [once[key] for key in sorted(once)]  # of what is shown twice, the first
        if not self._room.take([certificate for _, certificate in shown]):
            shown, lacking = [], "the document would be larger than what is read"
        claims = [claim for claim, _ in shown]
        if not lacking and not suffices(net, discipline, verdict.name, proved, claims, query):
            lacking = "no certificate is known for this verdict"
        return Record(verdict.name, proved, tuple(shown), lacking, "" if query is None else format_query(query))

    def _one(self, claim: Claim, witness: Witness | None = None) -> Iterator[tuple[Claim, Certificate]]:
        yield from self.certifier.shown(claim, witness)

    def _never(self, bad: Formula, verdict: Verdict) -> Iterator[tuple[Claim, Certificate]]:
        """That something is never so, for a verdict that says this, or that it is."""
        if verdict.status is Status.PROVED:
            return self._one(Claim(ClaimKind.NEVER, bad))
        return self._one(Claim(ClaimKind.REACHABLE, bad), verdict.witness)

    def _shown(self, verdict: Verdict, query: Query | None, proved: bool) -> Iterable[tuple[Claim, Certificate]]:
        net = self.net
        if proved:
            if verdict.name in _ALL_LIVE or (query is not None and query.kind is QueryKind.LIVE):
                return self._all_live()
            if verdict.name == "quasi-live" or (query is not None and query.kind is QueryKind.QUASI_LIVE):
                return self._quasi_live(verdict)
        elif (query is not None and query.kind in _DEAD) or verdict.name in {"live", "quasi-live"}:
            dead = verdict.name == "quasi-live" or (query is not None and query.kind is QueryKind.QUASI_LIVE)
            return self._not_live(verdict, dead=dead)
        match verdict.name:
            case "contact-free":
                return self._never(contact(net), verdict)
            case "deadlock-free":
                return self._never(Deadlock(), verdict)
            case "doomed-markings":
                return self._no_doom(verdict)
            case "reversible":
                kind = ClaimKind.ALWAYS_POSSIBLE if proved else ClaimKind.LOST
                return self._or_theorem(Claim(kind, Start()), verdict.witness)
            case "home-markings":
                return self._home() if proved else self._homeless()
            case "conflicting-commands":
                return self._never(commands_clash(net), verdict)
            case "shared-completions":
                return self._never(completions_clash(net), verdict)
            case "effective-conflicts":
                return self._competing(verdict)
            case "steps-serialisable":
                kind = ClaimKind.ORDERED if proved else ClaimKind.UNORDERED
                return self._one(Claim(kind), verdict.witness)
            case "machine-never-stopped":
                return self._stopped() if proved else self._never_stopped()
            case "starvation":
                return self._served(proved)
        if (of := next((of for of in net.properties if verdict.name == f"property.{of.name}"), None)) is not None:
            return self._property(of, verdict, proved)
        return () if query is None else self._query(query, verdict, proved)

    def _no_doom(self, verdict: Verdict) -> Iterable[tuple[Claim, Certificate]]:
        """A deadlock is doomed, and every doomed marking leads to one."""
        if verdict.status is Status.PROVED:
            return self._one(Claim(ClaimKind.NEVER, Deadlock()))
        return self._one(Claim(ClaimKind.REACHABLE, Deadlock()), self.certifier.deadlock)

    def _competing(self, verdict: Verdict) -> Iterator[tuple[Claim, Certificate]]:
        net, goal = self.net, competing(self.net)
        if verdict.status is Status.PROVED and goal is not None:
            yield from self._never(goal, verdict)
        elif verdict.witness is not None:
            firable = [net.transitions[t].name for t in Player(net).may_fire(net.marking(verdict.witness.marking))]
            pairs = (pair for pair in combinations(firable, 2) if compete(net, *pair))
            if (pair := next(pairs, None)) is not None:
                both = And((Firable(pair[0]), Firable(pair[1])))
                yield from self._one(Claim(ClaimKind.REACHABLE, both), verdict.witness)

    def _home_claim(self, home: Marking) -> Claim:
        return Claim(ClaimKind.ALWAYS_POSSIBLE, tidy(is_marking(self.net, home)))

    def _home(self) -> Iterator[tuple[Claim, Certificate]]:
        if self.certifier.home is not None:
            return iter([self._at_home()])
        return iter([(Claim(ClaimKind.HOME), self.certifier.theorem(Claim(ClaimKind.HOME)))])

    def _or_theorem(self, claim: Claim, witness: Witness | None) -> Iterator[tuple[Claim, Certificate]]:
        try:
            yield from self._one(claim, witness)
        except LackingError as error:
            if claim.kind is not ClaimKind.ALWAYS_POSSIBLE:
                raise
            try:
                yield claim, self.certifier.theorem(claim)
            except LackingError:
                raise error from None

    def _all_live(self) -> Shown:
        return self._lively(tuple(t.name for t in self.net.transitions))

    def _lively(self, names: tuple[str, ...]) -> Shown:
        """That transitions are live: by a home marking, or by a theorem, or each for itself."""
        if names not in self._live:
            ways: list[Callable[[], Shown]] = [partial(self._by_home, names), self._by_theorem]
            ways.append(lambda: [pair for name in names for pair in self._one(_possible(name))])
            said = ""
            for way in ways:
                try:
                    self._live[names] = way()
                    break
                except LackingError as error:
                    said = said or str(error)
            else:
                self._live[names] = said
        found = self._live[names]
        if isinstance(found, str):
            raise LackingError(found)
        return found

    def _by_theorem(self) -> Shown:
        return [(Claim(ClaimKind.LIVE), self.certifier.theorem(Claim(ClaimKind.LIVE)))]

    def _by_home(self, names: tuple[str, ...]) -> Shown:
        shown = self._at_home()
        runs = self.certifier.runs_firing(names, self.certifier.home)
        return [shown, *self._fired(shown[0].state_goal, runs)]

    def _fired(self, goal: Formula, runs: Iterable[FiringSequence]) -> Shown:
        """What each run fires from where the goal first holds."""
        shown: Shown = []
        for run in runs:
            markings = played(self.net, self.certifier.discipline, run.firings)
            begin = next(i for i, marking in enumerate(markings) if holds(self.net, goal, marking))
            fired = {name for names in run.firings[begin:] for name in names}
            fires = tuple(sorted(fired, key=self.net.transition_index.__getitem__))
            shown.append((Claim(ClaimKind.FIRES, goal, fires=fires), run))
        return shown

    def _quasi_live(self, verdict: Verdict) -> Shown:
        names = [t.name for t in self.net.transitions]
        shown: Shown = []
        for goal, found in self.findings.get(verdict.name, ()):
            if isinstance(goal, Firable) and found.witness is not None:
                run = FiringSequence(found.witness.firings)
                shown.append((Claim(ClaimKind.REACHABLE, goal), run))
        known = {claim.state_goal.transition for claim, _ in shown if isinstance(claim.state_goal, Firable)}
        left = [name for name in names if name not in known]
        return shown + (self._fired(TRUE, self.certifier.runs_firing(left)) if left else [])

    def _not_live(self, verdict: Verdict, *, dead: bool) -> Iterator[tuple[Claim, Certificate]]:
        """Of the transitions that a verdict says to be dead, or not live, the first of which it can be shown."""
        reason = "the verdict names no transition"
        for name in verdict.subjects:
            claim = Claim(ClaimKind.NEVER if dead else ClaimKind.LOST, Firable(name))
            try:
                if not dead and (found := self.certifier.never_fires(name)):
                    yield Claim(ClaimKind.NEVER, Firable(name)), found  # so it is not live
                else:
                    yield claim, self.certifier.certify(claim, verdict.witness)
            except LackingError as error:
                reason = str(error)
                continue
            return
        raise LackingError(reason)

    def _homeless(self) -> Iterator[tuple[Claim, Certificate]]:
        formula = self.certifier.parted()
        if formula is None:
            raise LackingError("no formula was found that parts two ends of the net")
        for goal in (formula, Not(formula)):
            yield from self._one(Claim(ClaimKind.LOST, goal))

    def _stopped(self) -> Iterator[tuple[Claim, Certificate]]:
        """Each command is never sent, or sent in a run that sends another one to the same machine."""
        for names in senders(self.net).values():
            for name, sending in names.items():
                others = dict.fromkeys(t for other, of in names.items() if other != name for t in of)
                found = self.certifier.run_in_order(sending, tuple(others))
                if found is not None:
                    yield Claim(ClaimKind.IN_ORDER, fires=found[0]), found[1]
                else:
                    yield from self._one(Claim(ClaimKind.NEVER, some_firable(sending)))

    def _never_stopped(self) -> Iterator[tuple[Claim, Certificate]]:
        """A command that is sent, and beside which no run sends another one to its machine."""
        for sending, others in commands(self.net):
            beside = never_beside(sending, others) if others else None
            for name in sending:
                try:
                    sent = self._fired(TRUE, self.certifier.runs_firing((name,)))
                    if beside is not None:
                        sent.append((Claim(ClaimKind.LTL, beside), self.certifier.asked_for(beside)))
                except LackingError:
                    continue
                yield from sent
                return
        raise LackingError("that no other command follows in any run is not certified")

    def _served(self, proved: bool) -> Iterator[tuple[Claim, Certificate]]:
        try:
            again = eager_cycle(self.net, self.certifier.limits.deadline) or ()
        except TimeIsOverError:
            raise LackingError(NO_TIME) from None
        waiting = [t.name for t in self.net.transitions if t.name not in again]
        if not proved:
            for name in waiting:
                try:
                    yield from self._lively((name,))
                except LackingError:
                    continue
                return
            raise LackingError("that a waiting transition is live was not certified")
        for name in waiting:
            yield from self._one(Claim(ClaimKind.LOST, Firable(name)))

    def _property(
        self, of: Property | TemporalProperty, verdict: Verdict, proved: bool
    ) -> Iterator[tuple[Claim, Certificate]]:
        if isinstance(of, TemporalProperty):
            return self._temporal(of.logic, of.formula, verdict, proved)
        claim = property_claim(of, proved=proved)
        if claim.kind is ClaimKind.ALWAYS_POSSIBLE and len(self.net.possibilities) > 1:
            for from_there in (self._from_home, self._from_deadlocks):
                try:
                    return iter(from_there(claim.state_goal))
                except LackingError:
                    continue  # there is no such marking, or it is not known
        return self._one(claim, verdict.witness)

    @cached_property
    def _home_shown(self) -> tuple[Claim, Certificate] | str:
        """That some marking is a home marking, or why that is not shown: looked for once."""
        if self.certifier.home is None:
            return "no home marking is known"
        try:
            claim = self._home_claim(self.certifier.home)
            return claim, self.certifier.certify(claim)
        except LackingError as error:
            return str(error)

    def _at_home(self) -> tuple[Claim, Certificate]:
        """That some marking is a home marking; raises `LackingError`."""
        if isinstance(self._home_shown, str):
            raise LackingError(self._home_shown)
        return self._home_shown

    def _from_home(self, goal: Formula) -> Shown:
        """That a goal is always possible, since a home marking is, and from there a run meets it."""
        shown = self._at_home()
        later = Claim(ClaimKind.LATER, shown[0].state_goal, then=goal)
        return [shown, (later, self.certifier.later(goal))]

    @cached_property
    def _ends_shown(self) -> tuple[Claim, Certificate] | str:
        """That some deadlock can be reached from everywhere, or why that is not shown: looked for once."""
        claim = Claim(ClaimKind.ALWAYS_POSSIBLE, Deadlock())
        try:
            return claim, self.certifier.certify(claim)
        except LackingError as error:
            return str(error)

    def _from_deadlocks(self, goal: Formula) -> Shown:
        """That a goal is always possible, since some deadlock is, and the goal holds in each; raises `LackingError`."""
        if isinstance(self._ends_shown, str):
            raise LackingError(self._ends_shown)
        holds = in_each_deadlock(goal)
        return [self._ends_shown, (holds, self.certifier.certify(holds))]

    def _temporal(
        self, logic: Logic | QueryKind, formula: Temporal, verdict: Verdict, proved: bool
    ) -> Iterator[tuple[Claim, Certificate]]:
        """A formula; of many markings, one of CTL that comes down to goals by these."""
        if logic.value == Logic.CTL.value and self.certifier.spaces.graph is None:
            try:
                return iter(self._by_goals(formula, verdict.witness, holds=proved))
            except LackingError:
                pass  # it says more than goals do, or one of them is not shown: all markings may show it
        return self._one(temporal_claim(logic, formula, proved=proved), verdict.witness)

    def _by_goals(self, formula: Temporal, witness: Witness | None, *, holds: bool) -> Shown:
        """Claims on goals that say of a formula of CTL that it holds in M0, or that it does not."""
        match formula:
            case TemporalNot(operand):
                return self._by_goals(operand, witness, holds=not holds)
            case TemporalAnd(operands) | TemporalOr(operands) if isinstance(formula, TemporalAnd) is holds:
                return [pair for operand in operands for pair in self._by_goals(operand, witness, holds=holds)]
            case TemporalAnd(operands) | TemporalOr(operands):
                for operand in operands:
                    try:
                        return self._by_goals(operand, witness, holds=holds)
                    except LackingError:
                        continue
        if said_by_goals(self.net, formula, lambda _: False, holds=holds):
            return []  # it says so of M0
        claim = goal_claim(formula, holds=holds)
        if claim is None:
            raise LackingError("it does not come down to goals")
        fits = witness and evaluate(BOOL, self.net, claim.state_goal, holds_in(self.net.marking(witness.marking)))
        return list(self._one(claim, witness if fits else None))

    def _query(self, query: Query, verdict: Verdict, proved: bool) -> Iterator[tuple[Claim, Certificate]]:
        match query.kind:
            case QueryKind.CTL | QueryKind.LTL if query.formula is not None:
                return self._temporal(query.kind, query.formula, verdict, proved)
            case QueryKind.STABLE_MARKING:
                return self._stable(proved)
            case QueryKind.ONE_SAFE:
                return self._never(contact(self.net, openable=True), verdict)
            case QueryKind.BOUND:
                return self._bound(query.places, verdict)
        return iter(())

    def _stable(self, proved: bool) -> Iterator[tuple[Claim, Certificate]]:
        if len(self.net.places) > STABLE_PLACES_MAX:
            raise LackingError(f"a firing sequence for each of more than {STABLE_PLACES_MAX} places is not written")
        for place in self.net.places:
            both: tuple[Formula, ...] = (Holds(place.name), Not(Holds(place.name)))
            if not proved:
                yield from (pair for one in both for pair in self._one(Claim(ClaimKind.REACHABLE, one)))
                continue
            for one in both:
                try:
                    yield from self._one(Claim(ClaimKind.NEVER, one))
                except LackingError:
                    continue
                return

    def _bound(self, places: tuple[str, ...], verdict: Verdict) -> Iterator[tuple[Claim, Certificate]]:
        if verdict.witness is None:
            raise LackingError("no marking with so many tokens was found")
        held = set(verdict.witness.marking)
        bound = sum(place in held for place in places)
        if bound:
            yield from self._one(Claim(ClaimKind.REACHABLE, tokens_at_least(places, bound)), verdict.witness)
        if bound < len(places):
            yield from self._one(Claim(ClaimKind.NEVER, tokens_at_least(places, bound + 1)))


_ALL_LIVE: Final = frozenset({"live"})
_DEAD: Final = frozenset({QueryKind.LIVE, QueryKind.QUASI_LIVE})


def _possible(name: str) -> Claim:
    return Claim(ClaimKind.ALWAYS_POSSIBLE, Firable(name))
