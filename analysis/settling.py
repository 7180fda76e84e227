"""Settling verdicts one by one: what `check` does where no technique holds all markings, or while some still try.

A verdict is settled in one of four ways, whichever is first:

- a technique *knows* it at once, from the structure of the net or a few walks (`KNOWERS` of the table of methods);
- it comes down to *goals*, and techniques race each other for each of these (`GOALS`);
- it is a *formula* that does not, and techniques for formulas race each other (`FORMULAS`);
- it *follows* from verdicts that are settled (`firable.analysis.verdicts.consequences`).

Most questions are easy for somebody, and which are not cannot be seen beforehand. So a goal is first met by a short
walk, if it can be; all are asked in turns that grow; and who is asked keeps what it knows of the net for the next one.
Rejected: one question after the other, each with its part of the time. The first that is hard takes that from those
behind it, and of sixteen formulas on a large net two were decided where most take a hundredth of a second.

Nothing is settled twice, and what is settled is kept from one stage to the next, so it can be begun beside the search
for all markings. What is told of it goes into the course of the report.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from threading import Event
from time import perf_counter
from typing import Final

from firable.analysis._engine import IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.goal import DEPTH_MAX, Finding, Limits
from firable.analysis.methods import FORMULAS, GOALS, KNOWERS, WORTH_ASKING, Anew, Method
from firable.analysis.question import Answer, Known, Question, no, yes
from firable.analysis.race import SLICES_SECONDS, Contestant, Outcome, T, race
from firable.analysis.spaces.space import WitnessError
from firable.analysis.temporal.on_the_fly import Turn, decide_ltl_on_the_fly
from firable.analysis.temporal.queries import as_goal, question_of, temporal_question
from firable.analysis.verdicts.behaviour import QUESTIONS
from firable.analysis.verdicts.bounds import greatest
from firable.analysis.verdicts.combined import combined, is_combined
from firable.analysis.verdicts.consequences import consequences
from firable.analysis.verdicts.goals import Goal, goals_of, is_of_the_net, query_goals
from firable.analysis.verdicts.starvation import STARVATION
from firable.analysis.walk import Walks
from firable.nets.formula import Count, Deadlock, Formula, format_count
from firable.nets.net import Net, TemporalProperty
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Logic, Temporal
from firable.nets.verdict import Cost, Status, Verdict, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

Lanes = Sequence[Sequence[Method]]

_SAID_BY: Final = {
    QueryKind.LIVE: "live",
    QueryKind.QUASI_LIVE: "quasi-live",
    QueryKind.ONE_SAFE: "contact-free",
}
_GOALS_MAX: Final = 64  # a verdict of more goals than this takes longer than anybody waits
_TURN_SECONDS: Final = 0.25  # for each question in the first turn
_FIRST_TURN: Final = 0.5  # of the time that is left, at most, for the first turn of all
_TURN_SECONDS_MAX: Final = 30.0  # in the last but one, where no time is given
_TURN_GROWTH: Final = 4.0
_NEARBY_FIRINGS: Final = 2**13  # of a walk before the race, some milliseconds
_QUESTIONS: Final = {question.name: question for question in (*QUESTIONS, STARVATION)}


@dataclass
class Settling:
    """The verdicts on one net that were `found` without all markings, and the `course` of finding them.

    `findings` keeps, by verdict, its goals with what was found of them: what evidence is made from; `reached` keeps how
    techniques ended that did not decide one. Ctrl-C sets `interrupted`, after which nothing is begun. `tell` is told in
    words what is being settled, and how far that is; `depth_max` is for techniques that unroll runs.
    """

    net: Net
    queries: tuple[Query, ...]
    memory_bytes: int
    interrupted: Event
    tell: Callable[[str], object] | None = None
    depth_max: int = DEPTH_MAX
    found: dict[str, Verdict] = field(default_factory=dict)
    course: list[str] = field(default_factory=list)
    findings: dict[str, list[tuple[Formula, Finding]]] = field(default_factory=dict)
    reached: dict[str, str] = field(default_factory=dict)
    _knowing: dict[Method, Callable[[Limits], Mapping[str, Known]]] = field(default_factory=dict)
    """Who was asked already what they know."""
    _given: dict[str, Verdict] = field(default_factory=dict)
    """What was decided elsewhere."""
    _met: dict[Formula, Finding] = field(default_factory=dict)
    """The goals that are decided: several verdicts may come down to one, and a verdict to several."""
    _deciders: dict[Method, Callable[[Formula, Limits], Finding]] = field(default_factory=dict)
    _asked: dict[tuple[str, frozenset[str]], tuple[Question, tuple[Goal, ...]] | None] = field(default_factory=dict)
    _walked: set[Formula] = field(default_factory=set)
    """The goals that a short walk does not meet."""
    _tried: dict[str, float] = field(default_factory=dict)
    """The longest turn, in seconds, that a formula had in vain; goals are asked of others each time."""
    _judges: dict[tuple[Logic, Method], Callable[[Temporal, Limits], Known]] = field(default_factory=dict)

    def learn(self, of: Method, among: Collection[str], deadline: Deadline) -> None:
        """Take from a technique what it knows at once of these verdicts, by name."""
        missing = {name for name in among if name not in self.found}
        if missing.isdisjoint(WORTH_ASKING.get(of, missing)) or deadline.over:
            return
        began = perf_counter()
        try:
            if of not in self._knowing:
                self._knowing[of] = KNOWERS[of].load()(self.net)
            known = self._knowing[of](Limits(deadline, self.memory_bytes))
        except KeyboardInterrupt:
            self.interrupted.set()
            return
        cost = Cost(seconds=perf_counter() - began)
        if said := sorted(missing & known.keys()):
            self.course.append(f"{KNOWERS[of].words}: {', '.join(said)}")
        for name in said:
            self._settle(_QUESTIONS[name], known[name].answer, known[name].method, cost)

    def learn_on(self, among: Collection[str], deadline: Deadline) -> None:
        """Ask those again who go on where they were ended, with time that nobody else has a use for."""
        for of in list(self._knowing):
            if not isinstance(KNOWERS[of], Anew):
                self.learn(of, among, deadline)

    def conclude(self, verdicts: Iterable[Verdict] = ()) -> None:
        """Add what follows from these verdicts, those that were given before, and those that were found."""
        self._given |= {verdict.name: verdict for verdict in verdicts if verdict.status is not Status.UNKNOWN}
        following = consequences(self.net, self._given | self.found)
        for name, known in following.items():
            self._settle(_QUESTIONS[name], known.answer, known.method, Cost(seconds=0.0))
        self._pass_on(self._given | self.found)

    def may_ask(self, verdict: Verdict) -> bool:
        """Whether `ask` may have anything to ask: the verdict comes down to goals, to a formula, or to a bound."""
        name = verdict.name
        if is_of_the_net(name) or self._formula_of(name) is not None or self._bound_of(name) is not None:
            return True
        return goals_of(self.net, name) is not None or query_goals(self.queries, verdict) is not None

    def ask(
        self,
        verdict: Verdict,
        fired: Collection[str],
        lanes: Lanes,
        deadline: Deadline,
        slices_seconds: Sequence[float] | None = SLICES_SECONDS,
    ) -> None:
        """Settle a verdict by a race for each of its goals; not where one stays undecided or there are too many.

        `fired` names transitions that are known to fire.
        """
        if verdict.name in self.found or not lanes or deadline.over:
            return
        asked = self._goals_of(verdict, fired)
        if asked is None:
            self._by_formula(verdict, lanes, deadline, slices_seconds)
            return
        if len(asked[1]) > _GOALS_MAX:
            return
        question, goals = asked
        finding, findings = None, list[tuple[Formula, Finding]]()
        self.findings[verdict.name] = findings
        for goal in goals:
            if (finding := self._race(verdict.name, goal, lanes, deadline, slices_seconds)) is None:
                return
            findings.append((goal.formula, finding))
            if finding.reachable is not goal.wanted:
                self._settle(question, self._failed(goal, finding), finding.method, finding.cost)
                return
        if finding is not None:
            self._settle(question, yes(finding.witness), finding.method, finding.cost)

    def _goals_of(self, verdict: Verdict, fired: Collection[str]) -> tuple[Question, tuple[Goal, ...]] | None:
        """The question of a verdict and its goals, made once: of large nets that takes seconds."""
        key = verdict.name, frozenset(fired)
        if key not in self._asked:
            self._asked[key] = goals_of(self.net, verdict.name, fired) or query_goals(self.queries, verdict)
        return self._asked[key]

    def follow_runs(self, deadline: Deadline, vertices: int) -> None:
        """Settle the formulas of LTL that are decided on the fly at so many vertices; the same ones on every day."""
        queries = [(question_of(query), query.formula) for query in self.queries if query.kind is QueryKind.LTL]
        stated = [of for of in self.net.properties if isinstance(of, TemporalProperty) and of.logic is Logic.LTL]
        for question, formula in [*((temporal_question(of), of.formula) for of in stated), *queries]:
            if formula is None or as_goal(formula) is not None or deadline.over:
                continue
            limits = self._limits(question.name, deadline)
            try:
                known = decide_ltl_on_the_fly(self.net, formula, limits, turns=[Turn(None, vertices)])
            except IncompleteGraph:
                continue
            except KeyboardInterrupt:
                self.interrupted.set()
                return
            self._settle(question, known.answer, known.method, known.cost)

    def ask_in_turns(
        self,
        verdicts: Iterable[Verdict],
        fired: Collection[str],
        lanes: Lanes,
        deadline: Deadline,
        slices_seconds: Sequence[float] | None = SLICES_SECONDS,
        *,
        once: bool = False,
    ) -> None:
        """Settle verdicts, the easy ones first: all are asked in turns that grow, of which the last share out the time.

        Which one is hard cannot be seen beforehand, and one that is would take its time from all others. Formulas that
        all had turns in vain begin with one that is longer than the shortest of these. With `once` each has one turn.
        """
        waiting, left = list(verdicts), deadline.left_seconds
        seconds = _TURN_SECONDS if left is None else min(_TURN_SECONDS, _FIRST_TURN * left / max(1, len(waiting)))
        seconds = max(seconds, _TURN_GROWTH * min((self._tried.get(of.name, 0.0) for of in waiting), default=0.0))
        while waiting:
            left = deadline.left_seconds
            longest = _TURN_SECONDS_MAX if left is None else left / len(waiting)
            is_last = not once and (len(waiting) == 1 or seconds >= longest)
            for later, verdict in zip(range(len(waiting), 0, -1), waiting, strict=True):
                until = deadline.share(1 / later) if is_last else deadline.within(seconds)
                turn = until.left_seconds
                self.ask(verdict, fired, lanes, until, slices_seconds)
                is_open = verdict.name not in self.found and not until.is_cancelled
                if turn is not None and is_open and self._goals_of(verdict, fired) is None:
                    self._tried[verdict.name] = max(turn, self._tried.get(verdict.name, 0.0))
                self.conclude()
            waiting = [] if is_last or once else [verdict for verdict in waiting if verdict.name not in self.found]
            seconds *= _TURN_GROWTH

    def _by_formula(
        self, verdict: Verdict, lanes: Lanes, deadline: Deadline, slices_seconds: Sequence[float] | None
    ) -> None:
        """Settle the verdict on a formula of CTL or LTL."""
        if (found := self._formula_of(verdict.name)) is None:
            self._by_halving(verdict, lanes, deadline, slices_seconds)
            return
        formula, logic = found
        if is_combined(formula, branching=logic is Logic.CTL):
            self._combine(verdict, formula, lanes, deadline, slices_seconds)
        able = FORMULAS[logic]
        contestants = [
            [Contestant(able[of].words, partial(self._judge(logic, of), formula)) for of in lane if of in able]
            for lane in lanes
        ]
        if verdict.name in self.found or deadline.over or not any(contestants):
            return
        limits = self._limits(verdict.name, deadline)
        longest = slices_seconds and slices_seconds[-1:]  # to begin anew helps nobody
        outcome = self._told(verdict.name, self.noted(race(contestants, limits, longest)))
        if (known := outcome.answer) is not None:
            question = Question(verdict.name, verdict.statement, verdict.weight)
            self._settle(question, known.answer, known.method, known.cost)

    def _judge(self, logic: Logic, of: Method) -> Callable[[Temporal, Limits], Known]:
        """Who is asked about formulas of a logic, and keeps what it finds for the next one."""
        if (logic, of) not in self._judges:
            self._judges[logic, of] = FORMULAS[logic][of].load()(self.net)
        return self._judges[logic, of]

    def _by_halving(
        self, verdict: Verdict, lanes: Lanes, deadline: Deadline, slices_seconds: Sequence[float] | None
    ) -> None:
        """Settle the verdict on an upper bound of tokens."""
        if (query := self._bound_of(verdict.name)) is None:
            return

        def reached(goal: Formula) -> Finding | None:
            return self._race(
                verdict.name, Goal(goal, lambda _: ((), ""), wanted=True), lanes, deadline, slices_seconds
            )

        if (found := greatest(self.net, query.places, reached)) is None:
            return
        bound, findings = found
        shown = [finding.witness for finding in findings if finding.reachable and finding.witness is not None]
        witness = shown[-1] if shown else Witness((), (), self.net.names(self.net.initial_marking))
        method = "; ".join(dict.fromkeys(finding.method for finding in findings)) or "the initial marking"
        cost = Cost(seconds=sum(finding.cost.seconds or 0.0 for finding in findings))
        question = Question(verdict.name, f"{verdict.statement} is {bound}", verdict.weight)
        counted = format_count(Count(query.places))
        self._settle(question, yes(replace(witness, note=f"here {counted} = {bound}")), method, cost)

    def _combine(
        self,
        verdict: Verdict,
        formula: Temporal,
        lanes: Lanes,
        deadline: Deadline,
        slices_seconds: Sequence[float] | None,
    ) -> None:
        """Settle the verdict on a formula that is put together from goals."""
        asked: list[Finding] = []

        def reached(goal: Formula) -> Finding | None:
            one = Goal(goal, lambda _: ((), ""), wanted=True)
            finding = self._race(verdict.name, one, lanes, deadline, slices_seconds)
            asked.extend([] if finding is None else [finding])
            return finding

        holds, witness = combined(self.net, formula, reached)
        if holds is None:
            return
        method = "; ".join(dict.fromkeys(finding.method for finding in asked)) or "the initial marking"
        cost = Cost(seconds=sum(finding.cost.seconds or 0.0 for finding in asked))
        question = Question(verdict.name, verdict.statement, verdict.weight)
        self._settle(question, Answer(holds, witness=witness), method, cost)

    def _formula_of(self, name: str) -> tuple[Temporal, Logic] | None:
        """The temporal formula of a query or a property, by the name of its verdict, and its logic."""
        for query in self.queries:
            if name == f"query.{query.name}" and query.formula is not None:
                return query.formula, Logic(query.kind)
        for of in self.net.properties:
            if name == f"property.{of.name}" and isinstance(of, TemporalProperty):
                return of.formula, of.logic
        return None

    def _bound_of(self, name: str) -> Query | None:
        """The query for an upper bound of tokens, by the name of its verdict."""
        bounds = (query for query in self.queries if query.kind is QueryKind.BOUND)
        return next((query for query in bounds if f"query.{query.name}" == name), None)

    def _pass_on(self, decided: Mapping[str, Verdict]) -> None:
        """Answer the queries that ask for what a verdict on the net says."""
        for query in self.queries:
            source = decided.get(_SAID_BY.get(query.kind, ""))
            if source is None or f"query.{query.name}" in self.found:
                continue
            if query.kind is QueryKind.ONE_SAFE and (
                not source.holds or any(t.self_loops for t in self.net.transitions)
            ):
                continue  # a transition that never opens may be in contact, and puts no token anywhere
            question = question_of(query)
            answer = Answer(source.holds, source.subjects, source.witness, source.hint)
            self._settle(question, answer, f"follows from {source.name}: {source.method}", source.cost)

    def _settle(self, question: Question, answer: Answer, method: str, cost: Cost) -> None:
        self.found[question.name] = question.settle(answer, method, Discipline.INTERLEAVING, cost)

    def _race(
        self, name: str, goal: Goal, lanes: Lanes, deadline: Deadline, slices_seconds: Sequence[float] | None
    ) -> Finding | None:
        """What the first technique finds that decides a goal; None where none does in time."""
        if goal.formula in self._met:
            return self._met[goal.formula]
        if deadline.over:
            return None
        contestants = [
            [Contestant(GOALS[of].words, partial(self._decided, of, goal.formula)) for of in lane if of in GOALS]
            for lane in lanes
        ]
        if not any(contestants):
            return None
        limits = self._limits(name, deadline)
        walks = any(Method.WALK in lane for lane in lanes)
        finding = self._nearby(name, goal.formula, limits) if walks else None
        if finding is None:
            finding = self._told(name, self.noted(race(contestants, limits, slices_seconds))).answer
        if finding is not None:
            self._met[goal.formula] = finding
        return finding

    def _decided(self, of: Method, goal: Formula, limits: Limits) -> Finding | None:
        """What a technique found, which keeps what it knows of the net for the next goal."""
        if of not in self._deciders:
            self._deciders[of] = GOALS[of].load()(self.net)
        found = self._deciders[of](goal, limits)
        if found.reachable is None:
            raise IncompleteGraph(found.bound or "not decided")
        if found.reachable:
            _marking_of(self.net, goal, found)
        return found

    def _nearby(self, name: str, goal: Formula, limits: Limits) -> Finding | None:
        """A goal that a short walk meets, when it is first asked: most that are met at all are met within it."""
        if goal in self._walked or isinstance(goal, Deadlock):
            return None
        try:
            finding = self._walks.decide(goal, limits, firings=_NEARBY_FIRINGS)
        except KeyboardInterrupt:
            self.interrupted.set()
            return None
        if not finding.reachable:
            if not limits.deadline.over:  # else it was cut short
                self._walked.add(goal)
            return None
        self._tell(name, "a short walk was first")
        return finding

    @cached_property
    def _walks(self) -> Walks:
        return Walks(self.net)

    def _limits(self, name: str, deadline: Deadline) -> Limits:
        """The limits of who is asked about a verdict, whose words are told as being about that."""
        limits, tell = Limits(deadline, self.memory_bytes, self.depth_max), self.tell
        if tell is None:
            return limits
        tell(name)
        return replace(limits, tell=lambda words: tell(f"{name}: {words}"))

    def _told(self, name: str, outcome: Outcome[T]) -> Outcome[T]:
        """The outcome of a race about a verdict, which the course tells."""
        said = f"{outcome.winner} was first"
        if outcome.answer is None:
            said = "; ".join(outcome.told) or "no technique was asked any more"
        self._tell(name, said)
        if outcome.answer is None:
            self.reached[name] = said
        return outcome

    def _tell(self, name: str, said: str) -> None:
        """Add to the course what came of a question to a verdict, in place of how it was left before."""
        if (before := self.reached.pop(name, None)) is not None:
            self.course.remove(f"{name}: {before}")
        self.course.append(f"{name}: {said}")

    def noted(self, outcome: Outcome[T]) -> Outcome[T]:
        """The outcome; where Ctrl-C ended the race nothing else is begun, and what is known is reported."""
        if outcome.interrupted:
            self.interrupted.set()
            self.course.append("interrupted")
        return outcome

    def _failed(self, goal: Goal, finding: Finding) -> Answer:
        if finding.witness is None:
            return no(goal.subjects)
        subjects, note = goal.told(_marking_of(self.net, goal.formula, finding))
        return no(subjects, replace(finding.witness, note=note))


def _marking_of(net: Net, formula: Formula, found: Finding) -> int:
    """The marking that a witness ends in, which must satisfy the goal."""
    if found.witness is None:
        raise WitnessError(f"{found.method} says that a goal is reachable and does not show how")
    marking = net.marking(found.witness.marking)
    if not evaluate(BOOL, net, formula, holds_in(marking)):
        raise WitnessError(f"{found.method} shows a marking that does not satisfy the goal")
    return marking
