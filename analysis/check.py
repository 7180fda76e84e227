"""`check`: decide what holds of a net, by the technique that fits it.

`auto`, the default, goes in three stages, and stops as soon as every verdict is decided:

1. *Explore.* Most cells have few markings: the explicit engine looks at up to 200,000 of them first, alone, which takes
   a moment and gives the shortest witnesses. What it finds whole is reported the same way every time.
2. *Hold all markings* by whichever of the explicit engine and the decision diagram is first, side by side.
3. *Decide the questions one by one*, where no technique could hold all markings: those that theorems on the net's
   class answer, and the verdicts that come down to goals by a race of the techniques that decide those.

Under synchronous steps only the explicit engine knows the rule; there `auto` is `explicit`.

What a race decides first may name another technique, and another witness, on another day; what is decided is the same.
The report's `course` tells what was tried. A technique that is asked for by name is the only one to answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from threading import Event
from time import perf_counter
from typing import Any, Final, TypeVar

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Finding, Limits
from firable.analysis.methods import GOAL_LANES, GOALS, KNOWERS, SPACES, Method, Technique
from firable.analysis.question import Answer, Question, no, yes
from firable.analysis.race import Contestant, Outcome, race
from firable.analysis.report import CheckReport, report_on
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace, WitnessError
from firable.analysis.verdicts.behaviour import QUESTIONS
from firable.analysis.verdicts.goals import Goal, goals_of, query_goals
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.queries import Query
from firable.nets.verdict import Cost, Status, Verdict, spelled
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

T = TypeVar("T")

FIRST_MARKINGS: Final = 200_000
"""How many markings `auto` explores before it lets techniques race."""
_SPACES_SHARE: Final = 0.6  # of the time, for techniques that hold all markings
_KNOWING_SHARE: Final = 0.15  # of the time, for what is known at once
_KNOWING_SECONDS_MAX: Final = 30.0
_GOALS_MAX: Final = 64  # a verdict of more goals than this takes longer than anybody waits


def check(
    net: Net,
    discipline: Discipline | str = Discipline.INTERLEAVING,
    budget: Budget | None = None,
    *,
    method: Method | str = Method.AUTO,
    queries: Sequence[Query] = (),
    progress: Callable[[int, int], object] | None = None,
) -> CheckReport:
    """Decide every verdict on a net under a discipline, external gates free, by the method named.

    The verdicts on `queries` follow those on the net's own properties.

    Raises `InputError` F2013 where the arbiters do not fit the conflicts of the net, F3004 where the budget does not
    hold the net itself, F3006 where the method knows no synchronous steps.

    >>> from firable.nets.catalogue import catalogue_net
    >>> report = check(catalogue_net("conceptual_one_robot"))
    >>> report.figures.markings, report.figures.edges, str(report.verdict("live").status)
    (14, 23, 'proved')
    """
    discipline, budget, method = Discipline(discipline), budget or Budget(), Method(method)
    interrupted = Event()
    deadline = Deadline(cancelled=interrupted)
    if budget.seconds is not None:
        deadline = Deadline.after(budget.seconds, interrupted)
    one = _Check(net, discipline, budget, deadline, interrupted, tuple(queries), progress)
    if method is Method.EXPLICIT or (method is Method.AUTO and discipline is Discipline.STEP):
        return one.explicitly()
    if discipline is Discipline.STEP:
        message = f"the method '{method}' knows no synchronous steps"
        raise InputError([Diagnostic("F3006", message, "leave out --method, or name `explicit`")])
    return one.automatically() if method is Method.AUTO else one.by(method)


@dataclass(frozen=True)
class _Check:
    """One net, and what may be spent on it."""

    net: Net
    discipline: Discipline
    budget: Budget
    deadline: Deadline
    interrupted: Event
    queries: tuple[Query, ...]
    progress: Callable[[int, int], object] | None

    def explicitly(self) -> CheckReport:
        """The report of the explicit engine alone, within the whole budget."""
        graph = self._explore(self.budget)
        return _told(self._report(graph), [f"explored: {_size(graph)}"])

    def automatically(self) -> CheckReport:
        """The report of the three stages, as far as they are needed."""
        first = self._explore(replace(self.budget, markings=min(FIRST_MARKINGS, self.budget.markings)))
        if first.complete or first.engine.reason == "interrupted":
            return _told(self._report(first), [f"explored: {_size(first)}"])
        course = [f"the first {first.n_markings:,} markings are not all"]
        # Theorems take a moment, and know what no technique may have the time for afterwards.
        theorems = (Method.STRUCTURE, self._known(Method.STRUCTURE))
        report = self._report(self._whole(course) or first)
        rest = ((of, self._known(of)) for of in KNOWERS if of is not Method.STRUCTURE)
        return self._settled(report, chain([theorems], rest), GOAL_LANES, course)

    def by(self, method: Method) -> CheckReport:
        """The report of one technique: what it does not decide stays unknown."""
        if method in SPACES:
            words = SPACES[method].words
            try:
                space = SPACES[method].load()(self.net, Limits(self.deadline, self.budget.memory_bytes))
            except BudgetExceeded as error:
                return _told(self._report(self._nothing()), [f"{words} gave up: {error}"])
            return _told(self._report(space), [f"{words}: {_size(space)}"])
        nothing = self._nothing()
        knowledge = ((of, self._known(of)) for of in KNOWERS if of is method)
        lanes = ((method,),) if method in GOALS else ()
        words = (KNOWERS | GOALS)[method].words
        return self._settled(self._report(nothing), knowledge, lanes, [f"{words}, and nothing else"])

    def _nothing(self) -> ReachabilityGraph:
        """A space of M0 alone, of which nothing is concluded but what holds of M0."""
        return self._explore(replace(self.budget, markings=1))

    def _report(self, space: StateSpace[Any]) -> CheckReport:
        """The report on a space; Ctrl-C leaves unknown what is not decided yet, and twice ends all."""
        try:
            return report_on(space, self.queries)
        except KeyboardInterrupt:
            if self.interrupted.is_set():
                raise
            self.interrupted.set()
            return _told(report_on(space, self.queries), ["interrupted"])

    def _explore(self, budget: Budget) -> ReachabilityGraph:
        return explore(self.net, self.discipline, budget, deadline=self.deadline, progress=self.progress)

    def _whole(self, course: list[str]) -> StateSpace[Any] | None:
        """All markings, by whichever technique is first; None where none of them could hold them all."""
        limits = Limits(_share(self.deadline, _SPACES_SHARE), self.budget.memory_bytes)
        contestants = [Contestant("explicit engine", self._held_explicitly)]
        contestants += [Contestant(of.words, partial(_held, of, self.net)) for of in SPACES.values()]
        outcome = self._noted(race([[one] for one in contestants], limits, slices_seconds=None), course)
        course += outcome.told
        if outcome.answer is None:
            return None
        space = outcome.answer.until(self.deadline)  # the race ended it with itself
        course.append(f"{outcome.winner} was the first to hold all markings: {_size(space)}")
        return space

    def _noted(self, outcome: Outcome[T], course: list[str]) -> Outcome[T]:
        """The outcome; where Ctrl-C ended the race nothing else is begun, and what is known is reported."""
        if outcome.interrupted:
            self.interrupted.set()
            course.append("interrupted")
        return outcome

    def _held_explicitly(self, limits: Limits) -> StateSpace[Any]:
        budget = replace(self.budget, memory_bytes=limits.memory_bytes, seconds=None)
        graph = explore(self.net, self.discipline, budget, deadline=limits.deadline, progress=self.progress)
        graph.require_complete()
        return graph

    def _settled(
        self,
        report: CheckReport,
        knowledge: Iterable[tuple[Method, Mapping[str, Verdict]]],
        lanes: Sequence[Sequence[Method]],
        course: list[str],
    ) -> CheckReport:
        """The report with those of its unknown verdicts decided that are known at once or come down to goals.

        The knowledge is asked for only as long as something is open.
        """
        open_ = {verdict.name for verdict in report.verdicts if verdict.status is Status.UNKNOWN}
        known: dict[str, Verdict] = {}
        for of, more in knowledge if open_ else ():
            if said := (open_ & more.keys()) - known.keys():
                course.append(f"{KNOWERS[of].words}: {', '.join(sorted(said))}")
            known = {**more, **known}
            if open_ <= known.keys():
                break
        fired = self._fired(report.space) if open_ else set()
        verdicts = [
            verdict
            if verdict.name not in open_
            else known.get(verdict.name) or self._by_goals(verdict, fired, lanes, course)
            for verdict in report.verdicts
        ]
        return _told(replace(report, verdicts=tuple(verdicts)), course)

    def _fired(self, space: StateSpace[Any]) -> set[str]:
        """The transitions that are known to fire, as far as there is time to ask."""
        try:
            return {self.net.transitions[t].name for t, count in enumerate(space.fired()) if count}
        except BudgetExceeded:
            return set()

    def _known(self, of: Method) -> dict[str, Verdict]:
        """The verdicts that a technique knows at once, by name."""
        began, left = perf_counter(), self.deadline.left_seconds
        seconds_max = _KNOWING_SECONDS_MAX if left is None else min(left * _KNOWING_SHARE, _KNOWING_SECONDS_MAX)
        deadline = Deadline.after(seconds_max, self.interrupted)
        try:
            found = KNOWERS[of].load()(self.net, Limits(deadline, self.budget.memory_bytes))
        except KeyboardInterrupt:
            self.interrupted.set()
            return {}
        cost = Cost(seconds=perf_counter() - began)
        return {
            question.name: question.settle(known.answer, known.method, self.discipline, cost)
            for question in QUESTIONS
            if (known := found.get(question.name)) is not None
        }

    def _by_goals(
        self, verdict: Verdict, fired: set[str], lanes: Sequence[Sequence[Method]], course: list[str]
    ) -> Verdict:
        """The verdict after a race for each of its goals; as it was where one stays undecided or there are too many."""
        asked = goals_of(self.net, verdict.name, fired) or query_goals(self.queries, verdict)
        if asked is None or not lanes or len(asked[1]) > _GOALS_MAX:
            return verdict
        question, goals = asked
        found = None
        for goal in goals:
            if (found := self._race(verdict.name, goal, lanes, course)) is None:
                return verdict
            if found.reachable is not goal.wanted:
                return _settle(question, self._failed(goal, found), found)
        return verdict if found is None else _settle(question, yes(found.witness), found)

    def _race(self, name: str, goal: Goal, lanes: Sequence[Sequence[Method]], course: list[str]) -> Finding | None:
        """What the first technique finds that decides a goal; None where none does in time."""
        if self.deadline.over:
            return None
        contestants = [
            [Contestant(GOALS[of].words, partial(_decided, of, self.net, goal.formula)) for of in lane]
            for lane in lanes
        ]
        outcome = self._noted(race(contestants, Limits(self.deadline, self.budget.memory_bytes)), course)
        if outcome.answer is None:
            course.append(f"{name}: {'; '.join(outcome.told)}")
        else:
            course.append(f"{name}: {outcome.winner} was first")
        return outcome.answer

    def _failed(self, goal: Goal, found: Finding) -> Answer:
        if found.witness is None:
            return no(goal.subjects)
        subjects, note = goal.told(_marking_of(self.net, goal.formula, found))
        return no(subjects, replace(found.witness, note=note))


def _marking_of(net: Net, formula: Formula, found: Finding) -> int:
    """The marking that a witness ends in, which must satisfy the goal."""
    if found.witness is None:
        raise WitnessError(f"{found.method} says that a goal is reachable and does not show how")
    marking = net.marking(found.witness.marking)
    if not evaluate(BOOL, net, formula, holds_in(marking)):
        raise WitnessError(f"{found.method} shows a marking that does not satisfy the goal")
    return marking


def _decided(of: Method, net: Net, formula: Formula, limits: Limits) -> Finding | None:
    """What a technique found, or None where it did not decide."""
    found = GOALS[of].load()(net, formula, limits)
    if found.reachable is None:
        raise IncompleteGraph(found.bound or "not decided")
    if found.reachable:
        _marking_of(net, formula, found)
    return found


def _held(of: Technique[Callable[[Net, Limits], StateSpace[Any]]], net: Net, limits: Limits) -> StateSpace[Any]:
    space = of.load()(net, limits)
    space.require_complete()
    return space


def _settle(question: Question, answer: Answer, found: Finding) -> Verdict:
    return question.settle(answer, found.method, Discipline.INTERLEAVING, found.cost)


def _share(deadline: Deadline, share: float) -> Deadline:
    left = deadline.left_seconds
    return deadline if left is None else deadline.within(left * share)


def _size(space: StateSpace[Any]) -> str:
    edges = "edges not counted" if space.n_edges is None else f"{spelled(space.n_edges)} edges"
    size = f"{spelled(space.n_markings)} markings, {edges}"
    return size if space.complete else f"{size}, which are not all ({space.bound})"


def _told(report: CheckReport, course: Sequence[str]) -> CheckReport:
    return replace(report, course=(*report.course, *course))
