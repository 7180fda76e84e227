"""`check`: decide what holds of a net, by the technique that fits it.

`auto`, the default, goes in three stages, and stops as soon as every verdict is decided:

1. *Explore.* Most cells have few markings: the explicit engine looks at up to 200,000 of them first, alone, which takes
   a moment and gives the shortest witnesses. What it finds whole is reported the same way every time.
2. *Hold all markings* by whichever of the explicit engine and the decision diagram is first, side by side. Beside
   both, after a moment, quick techniques begin with the third stage, because how large the space is cannot be seen
   beforehand. The moment is for nets that are done within it: solvers take longer to load. Where nothing else is asked
   than formulas, and these settle all of them, the search for all markings ends.
3. *Settle the verdicts one by one* (`firable.analysis.settling`), where no technique could hold all markings: by
   techniques that know some at once, by a race of techniques for those that come down to goals, and by what follows.
   Where it was room that the explicit engine wanted for, a compact search tries to see all markings without a graph.
   What the markings show that it has found by then, such as a deadlock, is kept.

Under synchronous steps only the explicit engine knows the rule; there `auto` is `explicit`.

What a race decides first may name another technique, and another witness, on another day; what is decided is the same.
The report's `course` tells what was tried. A technique that is asked for by name is the only one to answer.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from threading import Event
from time import monotonic, sleep
from types import MappingProxyType
from typing import Any, Final, TypeAlias

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.methods import (
    FIRST_KNOWERS,
    FORMULA_LANES,
    FORMULAS,
    GOAL_LANES,
    GOALS,
    KNOWERS,
    SPACES,
    Method,
    Technique,
)
from firable.analysis.question import LARGER, Question, unknown
from firable.analysis.race import SLICES_SECONDS, Contestant, race
from firable.analysis.report import CheckReport, report_on
from firable.analysis.settling import Lanes, Settling
from firable.analysis.spaces.reachability import REASONS, Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.temporal.queries import as_goal, question_of, temporal_question
from firable.analysis.verdicts.behaviour import DEADLOCK_FREE, QUESTIONS
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Net, TemporalProperty
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Logic
from firable.nets.verdict import Cost, Status, Verdict, spelled
from firable.semantics.trace import Discipline

FIRST_MARKINGS: Final = 200_000
"""How many markings `auto` explores before it lets techniques race."""
FEW_MARKINGS: Final = 10_000
"""Up to so many markings, formulas of LTL are asked of sets of them, which takes no time."""
FOLLOWED_VERTICES: Final = 2**18
"""How far runs are followed for such a formula where more are explored: mostly that decides it, in milliseconds."""
ALONE_SECONDS: Final = 60.0
"""How long a technique that is named has for each question, where no time is given."""
ALONE_STEPS: Final = 50
"""How long runs it unrolls then: a solver takes longer for each further step, and comes to no end by itself."""
AGAIN: Final = "ask again, and let it come to its end"
"""What helps where Ctrl-C has ended a search."""
INTERRUPTED: Final = "interrupted"
"""What the course of a report tells of Ctrl-C."""
_OF_BUDGET: Final = ("markings", "memory", "time")
"""Why the explicit engine has ended where its budget is used up."""
_ALONE_SECONDS: Final = 0.1
"""How long techniques that hold all markings are alone, before others begin beside them."""
_SPACES_SHARE: Final = 0.6  # of the time, for techniques that hold all markings
_KNOWING_SECONDS_MAX: Final = 30.0  # for what is known at once
_WAITED_SHARE: Final = 0.02  # of the time of exploring, for each property: so long it takes on a graph (0.015 to 0.03)
_WAITED_SHARE_MAX: Final = 0.5  # of the time that is left, for a diagram to be there first
_WAITED_TURN_SECONDS: Final = 0.02
_SEEN_SHARE: Final = 0.25  # of the time that is left, for what the markings say that were found and are not all
_COUNTING_SHARE: Final = 0.5  # of the time that is left, for all markings without a graph
_COUNTING_SECONDS_MAX: Final = 120.0
_LEARNT_FIRST: Final = frozenset(question.name for question in QUESTIONS)
_DEADLOCK_LANES: Final = ((Method.REDUCTION, Method.WALK, Method.STATE_EQUATION), (Method.PARIKH,))
_FIRST_LANES: Final = ((Method.REDUCTION, Method.WALK), (Method.STATE_EQUATION, Method.PARIKH), *FORMULA_LANES)
_QUERIES_LANES: Final = ((Method.REDUCTION,), *FORMULA_LANES)
_FIRST_SLICES_SECONDS: Final = (3.0, 10.0)
_HARD_SECONDS: Final = (10.0,)
"""How long each may take at most beside the search for all markings, also where no time is given."""
_BESIDE_SHARE: Final = 0.25  # of the memory, for these beside the search for all markings
_QUERIES_SHARE: Final = 0.8  # of the time that is left, for hard ones where nothing else is asked
_STATED_SHARE: Final = 0.5  # of the time, for what is stated and easy
_FORMULAS_SHARES: Final = {Logic.LTL: 0.5, Logic.CTL: 0.25}
"""The parts of the time left for formulas before sets of markings, which decide more of CTL than of LTL."""
_FOLLOWED_SHARE: Final = 0.25  # of the time that is left, for runs where all markings are there
_FORMULA_SECONDS_MAX: Final = 1.0  # for each of them

_Contestant: TypeAlias = Contestant[StateSpace[Any]]


def check(
    net: Net,
    discipline: Discipline | str = Discipline.INTERLEAVING,
    budget: Budget | None = None,
    *,
    method: Method | str = Method.AUTO,
    queries: Sequence[Query] = (),
    of_the_net: bool = True,
    progress: Callable[[int, int], object] | None = None,
    tell: Callable[[str], object] | None = None,
    interrupted: Event | None = None,
) -> CheckReport:
    """Decide every verdict on a net under a discipline, external gates free, by the method named.

    The verdicts on `queries` follow those on the net's own properties; where not `of_the_net` these are all that is
    asked. `progress` is told how many markings and edges are found, and `tell` in words how far it is with verdicts
    that are settled one by one. Ctrl-C, which leaves unknown what is not decided yet, sets `interrupted`; where it is
    set already, for another net, nothing is begun.

    Raises `InputError` F2001 where two queries have one name, F2013 where the arbiters do not fit the conflicts of the
    net, F3004 where the budget does not hold the net itself, F3006 where the method knows no synchronous steps.

    >>> from firable.nets.catalogue import catalogue_net
    >>> report = check(catalogue_net("conceptual_one_robot"))
    >>> report.figures.markings, report.figures.edges, str(report.verdict("live").status)
    (14, 23, 'proved')
    """
    discipline, budget, method = Discipline(discipline), budget or Budget(), Method(method)
    if twice := {name for name, count in Counter(query.name for query in queries).items() if count > 1}:
        message = f"'{min(twice)}' is the name of two queries"
        raise InputError([Diagnostic("F2001", message, "give each query a name of its own")])
    interrupted = interrupted or Event()
    deadline = Deadline(cancelled=interrupted)
    if budget.seconds is not None:
        deadline = Deadline.after(budget.seconds, interrupted)
    one = _Check(net, discipline, budget, deadline, interrupted, tuple(queries), of_the_net, progress, tell)
    if discipline is Discipline.STEP and method not in {Method.EXPLICIT, Method.AUTO}:
        message = f"the method '{method}' knows no synchronous steps"
        raise InputError([Diagnostic("F3006", message, "leave out --method, or name `explicit`")])
    if interrupted.is_set():
        report = one.unasked()
    elif method is Method.EXPLICIT or discipline is Discipline.STEP:
        report = one.explicitly()
    else:
        report = one.automatically() if method is Method.AUTO else one.by(method)
    return _left_off(report) if INTERRUPTED in report.course else report


@dataclass(frozen=True)
class _Check:
    """One net, and what may be spent on it."""

    net: Net
    discipline: Discipline
    budget: Budget
    deadline: Deadline
    interrupted: Event
    queries: tuple[Query, ...]
    of_the_net: bool
    progress: Callable[[int, int], object] | None
    tell: Callable[[str], object] | None

    def unasked(self) -> CheckReport:
        """The report where Ctrl-C has come before: what M0 alone does not decide is unknown."""
        report = self._report(self._nothing())
        verdicts = (
            replace(verdict, bound=INTERRUPTED, hint=AGAIN) if verdict.status is Status.UNKNOWN else verdict
            for verdict in report.verdicts
        )
        return _told(replace(report, verdicts=tuple(verdicts)), [INTERRUPTED])

    def explicitly(self) -> CheckReport:
        """The report of the explicit engine alone, within the whole budget."""
        graph = self._explore(self.budget, threads=2)
        return self._explored(graph)

    def automatically(self) -> CheckReport:
        """The report of the three stages, as far as they are needed."""
        try:
            first = self._explore(replace(self.budget, markings=min(FIRST_MARKINGS, self.budget.markings)))
        except InputError as error:
            return self._without_a_graph(error)
        settling = self._settling()
        if first.complete or first.engine.reason == "interrupted":
            if first.complete and first.n_markings > FEW_MARKINGS:
                settling.follow_runs(self.deadline.share(_FOLLOWED_SHARE), FOLLOWED_VERTICES)
            return self._explored(first, settling.found)
        course = [f"the first {first.n_markings:,} markings are not all"]
        ends: dict[str, ReachabilityGraph] = {}
        space = self._whole(settling, course, ends)
        if space is not None:  # sets may take far longer than one run that is nearby
            self._ask_formulas(settling)
        # What had no room with indexes may have it without.
        late = {Method.COMPACT: _COUNTING_SHARE} if {"memory", "markings"} & set(ends) else {}
        report = self._report(space or first, settling.found)
        if space is None:  # as far as anybody came, and not as far as was looked before the race
            furthest = next((graph.bound for reason, graph in ends.items() if reason in _OF_BUDGET), first.bound)
            report = replace(report, verdicts=tuple(_reaching(of, first, furthest) for of in report.verdicts))
            while ends:
                course += self._settled_by(ends.popitem()[1], settling, report)
        ends.clear()  # those who come now have all the memory
        return self._settled(report, settling, FIRST_KNOWERS | late, (*GOAL_LANES, *FORMULA_LANES), course)

    def _without_a_graph(self, error: InputError) -> CheckReport:
        """The report on a net of which the explicit engine has no room for the masks, let alone for markings.

        Raises the error, with what is left to do, where no other technique holds its markings.
        """
        course = ["the explicit engine has no room for the net itself"]
        for of in SPACES.values():
            try:
                space = of.load()(self.net, Limits(self.deadline, self.budget.memory_bytes, threads=2))
            except BudgetExceeded:
                continue
            return _told(self._report(space), [*course, f"{of.words}: {_size(space)}"])
        raise InputError([replace(each, hint="give it a larger budget of memory") for each in error.diagnostics])

    def _settled_by(self, graph: ReachabilityGraph, settling: Settling, report: CheckReport) -> list[str]:
        """Settle what a part of the markings decides and is open yet, whatever the rest are; how that is told."""
        if not any(of.status is Status.UNKNOWN and of.name not in settling.found for of in report.verdicts):
            return []
        seen = self._report(graph.until(_moment(self.deadline, _SEEN_SHARE)), settling.found)
        open_ = {of.name for of in report.verdicts if of.status is Status.UNKNOWN} - settling.found.keys()
        decided = {of.name: of for of in seen.verdicts if of.name in open_ and of.status is not Status.UNKNOWN}
        settling.found |= decided
        return [*seen.course, *([f"explored, and not all: {', '.join(sorted(decided))}"] if decided else [])]

    def _begin(self, settling: Settling, deadline: Deadline, enough: Event) -> None:
        """Settle, beside the search for all markings, what others follow from, by quick techniques, and what is stated.

        `enough` ends it, with the search, and is set where nothing is left that all markings are wanted for.
        """
        if enough.wait(_ALONE_SECONDS):
            return
        questions = [*map(temporal_question, self._temporal), *map(question_of, self.queries)]
        asked = list(map(_asked_of, questions))
        share = deadline.share(_STATED_SHARE)
        settling.ask_in_turns(asked, (), _FIRST_LANES, share, _FIRST_SLICES_SECONDS, once=True)
        for of, part in FIRST_KNOWERS.items() if self.of_the_net else ():
            settling.learn(of, _LEARNT_FIRST, _moment(deadline, part))
        # What else is hard of the net waits for the processors, which the search for all markings has; queries go on.
        if self.of_the_net:
            settling.ask_in_turns(map(_asked_of, self._formulas(*Logic)), (), FORMULA_LANES, deadline, _HARD_SECONDS)
            settling.ask(_asked_of(DEADLOCK_FREE), (), _DEADLOCK_LANES, deadline, _FIRST_SLICES_SECONDS)
        else:
            until = replace(self.deadline.share(_QUERIES_SHARE), cancelled=enough)
            settling.ask_in_turns(asked, (), _QUERIES_LANES, until, _HARD_SECONDS)
        is_all = not self.of_the_net and len(self._temporal) == len(self.net.properties)
        if is_all and asked and all(verdict.name in settling.found for verdict in asked):
            enough.set()

    @property
    def _temporal(self) -> list[TemporalProperty]:
        return [of for of in self.net.properties if isinstance(of, TemporalProperty)]

    def _formulas(self, *logics: Logic) -> list[Question]:
        """The formulas of these logics that do not come down to goals."""
        stated = [of for of in self._temporal if of.logic in logics and not as_goal(of.formula)]
        kinds = {QueryKind(logic) for logic in logics}
        queries = [of for of in self.queries if of.formula and of.kind in kinds and not as_goal(of.formula)]
        return [*map(temporal_question, stated), *map(question_of, queries)]

    def _ask_formulas(self, settling: Settling) -> None:
        """Settle the formulas that do not come down to goals, one after the other, as far as that is quick."""
        for logic, share in _FORMULAS_SHARES.items():
            asked = [of for of in self._formulas(logic) if of.name not in settling.found]
            until = self.deadline.share(share)
            for later, question in zip(range(len(asked), 0, -1), asked, strict=True):
                turn = until.share(1 / later).within(_FORMULA_SECONDS_MAX)
                settling.ask(_asked_of(question), (), FORMULA_LANES, turn, None)

    def by(self, method: Method) -> CheckReport:
        """The report of one technique: what it does not decide stays unknown."""
        if method in SPACES:
            words = SPACES[method].words
            try:
                space = SPACES[method].load()(self.net, Limits(self.deadline, self.budget.memory_bytes, threads=2))
            except BudgetExceeded as error:
                said = f"{words} gave up: {error}"
                report = self._report(self._nothing())
                more = "allow it more time or memory, or leave out --method"
                verdicts = [_undecided(verdict, said, more) for verdict in report.verdicts]
                return _told(replace(report, verdicts=tuple(verdicts)), [said])
            return _told(self._report(space), [f"{words}: {_size(space)}"])
        report = self._report(self._nothing())
        knowers = {of: 1.0 for of in KNOWERS if of is method}
        formulas = {of: words for techniques in FORMULAS.values() for of, words in techniques.items()}
        lanes = ((method,),) if method in GOALS | formulas else ()
        words = (KNOWERS | GOALS | formulas)[method].words
        settling, slices = self._settling(), None
        if self.budget.seconds is None:
            settling.depth_max, slices = ALONE_STEPS, (ALONE_SECONDS,)
        report = self._settled(report, settling, knowers, lanes, [f"{words}, and nothing else"], slices)
        return replace(report, verdicts=tuple(self._by_one(verdict, settling, words) for verdict in report.verdicts))

    def _by_one(self, verdict: Verdict, settling: Settling, words: str) -> Verdict:
        """A verdict, which says, where the one technique has not decided it, how far that has come."""
        if (said := settling.reached.get(verdict.name)) is not None:
            more = "allow it more time, with --max-seconds, or leave out --method"
            return _undecided(verdict, said, AGAIN if self.interrupted.is_set() else more)
        why = "was not asked any more" if self.deadline.over else "does not decide it"
        return _undecided(verdict, f"{words} {why}", "leave out --method, or name another one")

    def _settling(self) -> Settling:
        return Settling(self.net, self.queries, self.budget.memory_bytes, self.interrupted, self.tell)

    def _nothing(self) -> ReachabilityGraph:
        """A space of M0 alone, of which nothing is concluded but what holds of M0."""
        return self._explore(replace(self.budget, markings=1))

    def _report(self, space: StateSpace[Any], known: Mapping[str, Verdict] = MappingProxyType({})) -> CheckReport:
        """The report on a space; Ctrl-C leaves unknown what is not decided yet, and twice ends all."""
        report = partial(report_on, space, self.queries, known, of_the_net=self.of_the_net)
        try:
            return report()
        except KeyboardInterrupt:
            if self.interrupted.is_set():
                raise
            self.interrupted.set()
            return _told(report(), [INTERRUPTED])

    def _explored(self, graph: ReachabilityGraph, known: Mapping[str, Verdict] = MappingProxyType({})) -> CheckReport:
        """The report on a graph, and whether Ctrl-C ended the graph: then its figures are not those of the net."""
        report = _told(self._report(graph, known), [f"explored: {_size(graph)}"])
        if graph.engine.reason != "interrupted":
            return report
        self.interrupted.set()  # not before: what was found is still asked
        return _told(report, [INTERRUPTED])

    def _explore(self, budget: Budget, threads: int = 1) -> ReachabilityGraph:
        """Some markings, or all; by as many threads whatever the machine, since they say how markings are numbered."""
        return explore(
            self.net, self.discipline, budget, deadline=self.deadline, progress=self.progress, threads=threads
        )

    def _whole(
        self, settling: Settling, course: list[str], ends: dict[str, ReachabilityGraph]
    ) -> StateSpace[Any] | None:
        """All markings, by whichever technique is first; None where none of them could hold them all.

        `ends` is given what the explicit engine has found, by the reason why it ended. The settling is begun beside it,
        and given up where all markings are there.
        """
        enough, space = Event(), None
        deadline = replace(self.deadline.share(_SPACES_SHARE), cancelled=enough)
        limits = Limits(deadline, self.budget.memory_bytes)
        if not self.of_the_net:  # the settling goes on as long as the search, and so has its part of the memory
            settling.memory_bytes = int(_BESIDE_SHARE * self.budget.memory_bytes)
            limits = replace(limits, memory_bytes=self.budget.memory_bytes - settling.memory_bytes)
        with ThreadPoolExecutor(1) as beside:
            begun = beside.submit(self._begin, settling, deadline, enough)
            contestants = [Contestant("explicit engine", partial(self._held_explicitly, ends))]
            contestants += [Contestant(of.words, partial(_held, of, self.net)) for of in SPACES.values()]
            contestants = _by_two_when_alone(contestants, begun.done)
            try:
                outcome = race([[one] for one in contestants], limits, slices_seconds=None)
                course += outcome.told
                if outcome.answer is not None:
                    space = outcome.answer.until(self.deadline)  # the race ended it with itself
                    course.append(f"{outcome.winner} was the first to hold all markings: {_size(space)}")
                if outcome.interrupted:
                    raise KeyboardInterrupt
                if space is None:
                    begun.result()
            except KeyboardInterrupt:  # nothing else is begun, and what is known is reported
                self.interrupted.set()
                course.append(INTERRUPTED)
            finally:
                enough.set()
        begun.result()
        settling.memory_bytes = self.budget.memory_bytes
        return space

    def _held_explicitly(self, ends: dict[str, ReachabilityGraph], limits: Limits) -> StateSpace[Any]:
        """The graph; one that is not whole `ends` is given, by the reason why the engine ended.

        For each property that is always possible again it would look at every marking, which takes part of the time
        that they took to be found; a diagram looks at all of them at once. So where there are many, it is waited for.
        """
        began = monotonic()
        budget = replace(self.budget, memory_bytes=limits.memory_bytes, seconds=None)
        try:
            graph = explore(
                self.net,
                self.discipline,
                budget,
                deadline=limits.deadline,
                progress=self.progress,
                threads=limits.threads,
                second_free=limits.second_free,
            )
        except InputError as error:  # a part of the memory does not hold the net itself, and others may need less
            raise BudgetExceeded(error.diagnostics[0].message) from None
        if not graph.complete:
            ends[str(graph.engine.reason)] = graph
        graph.require_complete()
        worth_seconds = _WAITED_SHARE * len(self.net.possibilities) * (monotonic() - began)
        until = limits.deadline.share(_WAITED_SHARE_MAX).within(worth_seconds)
        while not until.over and not (limits.second_free is not None and limits.second_free()):
            sleep(_WAITED_TURN_SECONDS)
        return graph

    def _settled(
        self,
        report: CheckReport,
        settling: Settling,
        knowers: Mapping[Method, float],
        lanes: Lanes,
        course: list[str],
        slices_seconds: Sequence[float] | None = SLICES_SECONDS,
    ) -> CheckReport:
        """The report with those of its unknown verdicts settled that can be.

        The knowers, each with its part of the time, are asked only as long as something is open; the time left is
        shared out among the verdicts that come down to goals, and what these leave is for knowers that go on.
        """

        def open_() -> list[Verdict]:
            unknown = (verdict for verdict in report.verdicts if verdict.status is Status.UNKNOWN)
            return [verdict for verdict in unknown if verdict.name not in settling.found]

        settling.conclude(report.verdicts)
        for of, share in knowers.items():
            settling.learn(of, {verdict.name for verdict in open_()}, _moment(self.deadline, share, of))
            settling.conclude()
        fired = self._fired(report.space) if open_() else set()
        waiting = [verdict for verdict in open_() if settling.may_ask(verdict)]
        settling.ask_in_turns(waiting, fired, lanes, self.deadline, slices_seconds)
        settling.learn_on({verdict.name for verdict in open_()}, _moment(self.deadline, 1.0))
        settling.conclude()
        verdicts = tuple(
            settling.found.get(verdict.name, verdict) if verdict.status is Status.UNKNOWN else verdict
            for verdict in report.verdicts
        )
        is_told = verdicts != report.verdicts or self.interrupted.is_set()
        course = [*course, *settling.course] if is_told else course
        return _told(replace(report, verdicts=verdicts, findings=settling.findings), course)

    def _fired(self, space: StateSpace[Any]) -> set[str]:
        """The transitions that are known to fire, as far as there is time to ask."""
        try:
            return {self.net.transitions[t].name for t, count in enumerate(space.fired()) if count}
        except BudgetExceeded:
            return set()


def _asked_of(question: Question) -> Verdict:
    """The verdict on a question before anybody was asked."""
    return question.settle(unknown("not asked yet", ""), "", Discipline.INTERLEAVING, Cost())


def _held(of: Technique[Callable[[Net, Limits], StateSpace[Any]]], net: Net, limits: Limits) -> StateSpace[Any]:
    space = of.load()(net, limits)
    space.require_complete()
    return space


def _by_two_when_alone(contestants: Sequence[_Contestant], is_idle: Callable[[], bool]) -> list[_Contestant]:
    """The same, who each work by a second thread too once all others have ended and `is_idle` says so of all else."""
    ended = [Event() for _ in contestants]

    def run(own: int, limits: Limits) -> StateSpace[Any] | None:
        def is_alone() -> bool:
            return is_idle() and all(each.is_set() for at, each in enumerate(ended) if at != own)

        try:
            return contestants[own].run(replace(limits, threads=2, second_free=is_alone))
        finally:
            ended[own].set()

    return [replace(contestant, run=partial(run, at)) for at, contestant in enumerate(contestants)]


def _moment(deadline: Deadline, share: float, of: Method | None = None) -> Deadline:
    """When a technique that knows things at once must have said them; one that looks at all markings has longer."""
    longest = _COUNTING_SECONDS_MAX if of is Method.COMPACT else _KNOWING_SECONDS_MAX
    return deadline.share(share).within(longest)


def _size(space: StateSpace[Any]) -> str:
    edges = "edges not counted" if space.n_edges is None else f"{spelled(space.n_edges)} edges"
    size = f"{spelled(space.n_markings)} markings, {edges}"
    return size if space.complete else f"{size}, which are not all ({space.bound})"


def _left_off(report: CheckReport) -> CheckReport:
    """A report that Ctrl-C has ended: what is unknown by that, and by no budget, is no matter of the budget."""
    of_budget = tuple(REASONS[reason] for reason in _OF_BUDGET)
    told = (
        replace(verdict, hint=AGAIN) if verdict.hint == LARGER and not verdict.bound.endswith(of_budget) else verdict
        for verdict in report.verdicts
    )
    return replace(report, verdicts=tuple(told))


def _reaching(verdict: Verdict, first: ReachabilityGraph, bound: str) -> Verdict:
    """A verdict that the first markings leave unknown, with the bound that was reached behind them."""
    is_left = verdict.status is Status.UNKNOWN and verdict.bound == first.bound
    return replace(verdict, bound=bound) if is_left else verdict


def _undecided(verdict: Verdict, bound: str, hint: str) -> Verdict:
    return replace(verdict, bound=bound, hint=hint) if verdict.status is Status.UNKNOWN else verdict


def _told(report: CheckReport, course: Sequence[str]) -> CheckReport:
    return replace(report, course=(*report.course, *course))
