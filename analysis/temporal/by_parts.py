"""CTL without all markings: what can be said of a formula by goals is said by goals, the rest is evaluated locally.

A formula is made simpler (`simplifying`), and each state formula in it that holds always, or never, is found by the
techniques for goals and replaced. What is left in M0 is a Boolean combination, whose parts are asked one by one, with
three values. A part that comes down to a goal is asked as one; for `EX` and `AX` the next markings are asked in turn;
`EF p` and `E[q U p]` fail where a state formula that p implies cannot be reached; and all else is evaluated where it is
asked (`local`), first of all for a moment, since that often is enough.

Without X, a formula and each part of one is asked in the net reduced for it, too (`in_reduced`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from time import perf_counter
from typing import Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.goal import Finding, Limits
from firable.analysis.question import Answer, Known
from firable.analysis.reduction.deciding import ByReduction
from firable.analysis.reduction.reducer import Reducer
from firable.analysis.temporal.in_reduced import CtlInReduced
from firable.analysis.temporal.local import METHOD, decide_ctl_on_the_fly
from firable.analysis.temporal.queries import as_goal
from firable.analysis.temporal.simplifying import FALSE, TRUE, implied, simplified
from firable.analysis.walk import Walks
from firable.nets.formula import Constant, Formula, Not, Start, leaves_in
from firable.nets.net import Net
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
)
from firable.nets.temporal_parts import states_in
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in

_GLANCE: Final = 0.05  # of the time that is left, for a first local evaluation
_REDUCED: Final = 0.75  # for the formula, and for each part of it, in a reduced net
_CONSTANTS: Final = 0.5  # for state formulas that hold always or never
_EACH: Final = 0.1  # for one of these
_PART: Final = 0.4  # for each part by goals
_NEXT: Final = 0.2  # for a formula of next markings, before these are asked one by one
_AFTER: Final = 0.8  # for all of these
_FIRINGS: Final = 2**15  # of a walk, before a net is reduced for a goal
_NEXT_MAX: Final = 16
"""Next markings that are asked one by one."""


def decide_ctl_by_parts(net: Net, formula: Temporal, limits: Limits) -> Known:
    """Decide whether M0 satisfies a formula of CTL, under interleaving, gates free.

    Raises `IncompleteGraph` where it is not decided.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> net = catalogue_net("one_robot")
    >>> texts = ("AG EF start", "EF EG not firable(G3)", "AX EF (robot.put_mc and mc.machining)")
    >>> [decide_ctl_by_parts(net, parse_temporal(text), Limits()).answer.holds for text in texts]
    [True, False, False]
    """
    return CtlByParts(net)(formula, limits)


class CtlByParts:
    """Formulas of CTL on one net, one after the other: what is found of goals for one of them is kept for all."""

    def __init__(self, net: Net) -> None:
        self._goals = _Goals(Reducer(net))

    def __call__(self, formula: Temporal, limits: Limits) -> Known:
        """As `decide_ctl_by_parts`."""
        began = perf_counter()
        parts = _Parts(self._goals, limits)
        holds, witness = parts.decided(formula)
        if holds is None:
            raise IncompleteGraph("not decided by goals, in reduced nets or marking by marking")
        method = "; ".join(dict.fromkeys(parts.methods)) or "the initial marking"
        hint = "" if holds or witness else "it was decided without all markings: no run is kept that shows it"
        return Known(Answer(holds, witness=witness, hint=hint), method, Cost(seconds=perf_counter() - began))


@dataclass
class _Goals:
    """A net with what was found of goals in it, and who is asked about it and keeps what it finds."""

    reducer: Reducer
    findings: dict[Formula, Finding] = field(default_factory=dict)
    walked: set[Formula] = field(default_factory=set)
    """The goals that a walk does not meet."""

    @property
    def net(self) -> Net:
        return self.reducer.net

    @cached_property
    def by_reduction(self) -> ByReduction:
        """Goals in reduced nets."""
        return ByReduction(self.net, self.reducer)

    @cached_property
    def in_reduced(self) -> CtlInReduced:
        """Formulas without X in reduced nets."""
        return CtlInReduced(self.reducer)

    @cached_property
    def walks(self) -> Walks:
        """Walks in the net."""
        return Walks(self.net)

    def found(self, goal: Formula, limits: Limits) -> Finding | None:
        """What is found of a goal; None where it is not decided."""
        if goal in self.findings:
            return self.findings[goal]
        walk = partial(self.walks.decide, firings=_FIRINGS)
        deciders: list[Callable[[Formula, Limits], Finding]] = [walk, self.by_reduction]
        for decide in deciders[goal in self.walked :]:
            try:
                finding = decide(goal, limits)
            except (BudgetExceeded, IncompleteGraph):
                continue
            if finding.reachable is not None:
                self.findings[goal] = finding
                return finding
            if decide is walk and not limits.deadline.over:  # else it was cut short
                self.walked.add(goal)
        return None


@dataclass
class _Parts:
    """One formula on a net, and the methods that said something of it."""

    goals: _Goals
    limits: Limits
    methods: list[str] = field(default_factory=list)

    @property
    def net(self) -> Net:
        return self.goals.net

    def decided(self, formula: Temporal) -> tuple[bool | None, Witness | None]:
        """The value of a formula in M0, and what shows it where one firing sequence does."""
        formula = simplified(formula)
        if (holds := self._locally(formula, _GLANCE)) is not None:
            return holds, None
        if as_goal(formula) is None and (holds := self._in_reduced(formula)) is not None:
            return holds, None
        until = self._part(_CONSTANTS)
        formula = simplified(formula, lambda state: self._constant(state, until))
        return self._value(formula)

    def _part(self, share: float) -> Limits:
        return replace(self.limits, deadline=self.limits.deadline.share(share))

    def _holds(self, state: Formula) -> bool:
        return bool(evaluate(BOOL, self.net, state, holds_in(self.net.initial_marking)))

    def _constant(self, state: Formula, until: Limits) -> Formula:
        """A constant for a state formula that holds in all reachable markings, or in none."""
        if isinstance(state, Constant) or until.deadline.over:
            return state
        holds = self._holds(state)
        each = replace(until, deadline=until.deadline.share(_EACH))
        finding = self._asked(Not(state) if holds else state, each)
        return Constant(holds) if finding is not None and not finding.reachable else state

    def _asked(self, goal: Formula, limits: Limits) -> Finding | None:
        """What is found of a goal; None where it is not decided."""
        finding = self.goals.found(goal, limits)
        if finding is not None:
            self.methods.append(finding.method)
        return finding

    def _locally(self, formula: Temporal, share: float) -> bool | None:
        try:
            known = decide_ctl_on_the_fly(self.net, formula, self._part(share))
        except IncompleteGraph:
            return None
        self.methods.append(METHOD)
        return known.answer.holds

    def _in_reduced(self, formula: Temporal) -> bool | None:
        if (found := self.goals.in_reduced.decided(formula, self._part(_REDUCED))) is None:
            return None
        holds, method = found
        self.methods.append(method)
        return holds

    def _value(self, formula: Temporal) -> tuple[bool | None, Witness | None]:
        match formula:
            case _ if isinstance(formula, Formula):
                return self._holds(formula), None
            case TemporalAnd(operands):
                return self._first(operands, self._value, decisive=False)
            case TemporalOr(operands):
                return self._first(operands, self._value, decisive=True)
            case TemporalNot(operand):
                holds, witness = self._value(operand)
                return None if holds is None else not holds, witness
        if (goal := as_goal(formula)) is not None:
            finding = self._asked(goal[0], self._part(_PART))
            if finding is not None:
                return finding.reachable is goal[1], finding.witness
        if isinstance(formula, Exists | ForAll) and isinstance(formula.path, Next):
            holds = self._locally(formula, _NEXT)
            if holds is None:
                holds = self._after(formula.path.operand, every=isinstance(formula, ForAll))
        elif (holds := self._in_reduced(formula)) is None:
            holds = self._bounded(formula)
        return (self._locally(formula, 1.0) if holds is None else holds), None

    def _first(
        self,
        operands: Sequence[Temporal],
        value: Callable[[Temporal], tuple[bool | None, Witness | None]],
        *,
        decisive: bool,
    ) -> tuple[bool | None, Witness | None]:
        """The first operand with the decisive value decides, else all must be decided; what costs nothing is first."""
        undecided = False
        for operand in sorted(operands, key=lambda operand: not isinstance(operand, Formula)):
            holds, witness = value(operand)
            if holds is decisive:
                return holds, witness
            undecided = undecided or holds is None
        return None if undecided else not decisive, None

    def _bounded(self, formula: Temporal) -> bool | None:
        """False where a formula needs a marking that cannot be reached, true where its negation does; else None."""
        match formula:
            case Exists(Eventually(operand)) | ForAll(Eventually(operand)):
                needed, verdict = implied(operand), False
            case Exists(Until(_, right)) | ForAll(Until(_, right)):
                needed, verdict = implied(right), False
            case Exists(Globally(operand)) | ForAll(Globally(operand)):
                needed, verdict = implied(simplified(TemporalNot(operand))), True
            case _:
                return None
        if needed == TRUE:
            return None
        if needed == FALSE:
            return verdict
        finding = self._asked(needed, self._part(_PART))
        return verdict if finding is not None and not finding.reachable else None

    def _after(self, operand: Temporal, *, every: bool) -> bool | None:
        """Whether every, or some, next marking satisfies a formula that does not speak of M0."""
        player = Player(self.net)
        firable = player.may_fire(self.net.initial_marking)
        if len(firable) > _NEXT_MAX or self.limits.deadline.over or _speaks_of_start(operand):
            return None
        values, all_ = list[bool | None](), self._part(_AFTER)
        for number, t in enumerate(firable):
            marking = player.fire(self.net.initial_marking, (t,))
            each = replace(all_, deadline=all_.deadline.share(1 / (len(firable) - number)))
            there = _Parts(_Goals(self.goals.reducer.at(marking)), each, self.methods)
            holds, _ = there._value(operand)
            if holds is not every and holds is not None:
                return holds
            if all_.deadline.over:
                return None
            values.append(holds)
        return None if None in values else every


def _speaks_of_start(formula: Temporal) -> bool:
    """Whether some state formula in it names M0: a net with another first marking would take that for its own."""
    return any(isinstance(leaf, Start) for state in states_in(formula) for leaf in leaves_in(state))
