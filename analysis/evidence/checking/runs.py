"""Runs as evidence: a firing sequence, and a cycle after it or a deadlock, played and judged by the definitions.

A maximal run that goes on for ever is a lasso: its positions are finitely many, after the last comes the first of the
cycle. One that ends in a deadlock stutters there, as everywhere in this program. The value of a formula of LTL at each
position follows from those of its parts: an "until" is the least solution of its equation, which two rounds backward
find. Of fairness the definition is taken as it stands: what is enabled all the way round (weak), or anywhere on it
(strong), fires on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.obligations import played
from firable.analysis.evidence.claims import Claim
from firable.analysis.evidence.refusal import refuse
from firable.nets.formula import Formula
from firable.nets.net import Fairness, Marking, Net
from firable.nets.temporal import (
    Eventually,
    Fires,
    Globally,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    WeakUntil,
    format_temporal,
)
from firable.nets.temporal_parts import has_events
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline

Values = list[bool]


def holds(net: Net, formula: Formula, marking: Marking) -> bool:
    """Whether a state formula holds in a marking."""
    return evaluate(BOOL, net, formula, holds_in(marking))


@dataclass(frozen=True)
class Lasso:
    """A maximal run: the marking at each position, what fires there, and the position after each.

    `loop` is the first position of what is repeated.
    """

    net: Net
    markings: tuple[Marking, ...]
    fired: tuple[frozenset[str], ...]
    loop: int

    @classmethod
    def of(cls, net: Net, discipline: Discipline, sequence: FiringSequence, deadline: Deadline = NEVER) -> Lasso:
        """The run that a firing sequence and a cycle are; refused where it is none, or goes on."""
        markings = played(net, discipline, (*sequence.firings, *sequence.cycle), deadline)
        fired = [frozenset(names) for names in (*sequence.firings, *sequence.cycle)]
        loop = len(sequence.firings)
        if sequence.cycle:
            if markings.pop() != markings[loop]:
                refuse("the cycle does not close")
        elif Player(net).may_fire(markings[-1]):
            refuse("the run ends where it could go on")
        else:
            fired.append(frozenset())
        return cls(net, tuple(markings), tuple(fired), loop)

    def values(self, formula: Temporal) -> Values:
        """The value of a formula of LTL at each position."""
        match formula:
            case TemporalNot(operand):
                return [not value for value in self.values(operand)]
            case TemporalAnd(operands):
                return [all(row) for row in zip(*map(self.values, operands), strict=True)]
            case TemporalOr(operands):
                return [any(row) for row in zip(*map(self.values, operands), strict=True)]
            case Next(operand):
                values = self.values(operand)
                return [*values[1:], values[self.loop]]
            case Eventually(operand):
                return self._until(self._always, self.values(operand))
            case Globally(operand):
                return self._release(self._never, self.values(operand))
            case Until(left, right):
                return self._until(self.values(left), self.values(right))
            case Release(left, right):
                return self._release(self.values(left), self.values(right))
            case WeakUntil(left, right):
                first, second = self.values(left), self.values(right)
                return self._release(second, [a or b for a, b in zip(first, second, strict=True)])
            case Fires(transition):
                return [transition in fired for fired in self.fired]
            case _ if isinstance(formula, Formula):
                return [holds(self.net, formula, marking) for marking in self.markings]
        raise ValueError(f"'{format_temporal(formula)}' is no formula of LTL")

    @property
    def _always(self) -> Values:
        return [True] * len(self.markings)

    @property
    def _never(self) -> Values:
        return [False] * len(self.markings)

    def _until(self, left: Values, right: Values) -> Values:
        values = list(right)
        for _ in range(2):
            for i in reversed(range(len(values))):
                after = values[i + 1] if i + 1 < len(values) else values[self.loop]
                values[i] = right[i] or (left[i] and after)
        return values

    def _release(self, left: Values, right: Values) -> Values:
        never = self._until([not value for value in left], [not value for value in right])
        return [not value for value in never]


def check_refuting_run(
    net: Net, discipline: Discipline, claim: Claim, sequence: FiringSequence, deadline: Deadline = NEVER
) -> None:
    """Refuse a run that satisfies the formula of LTL which it is to refute."""
    if has_events(claim.goal) and discipline is Discipline.STEP:
        refuse("`fires` names one firing, and a step holds several")
    if Lasso.of(net, discipline, sequence, deadline).values(claim.goal)[0]:
        refuse(f"the run satisfies ({format_temporal(claim.goal)})")


def check_unanswered_run(
    net: Net, discipline: Discipline, claim: Claim, sequence: FiringSequence, deadline: Deadline = NEVER
) -> None:
    """Refuse a run that is not fair, or in which what is asked for never stays without the answer."""
    run = Lasso.of(net, discipline, sequence, deadline)
    answered = [holds(net, claim.then, marking) for marking in run.markings]
    asked = [holds(net, claim.state_goal, marking) for marking in run.markings]
    last = max((i for i, answer in enumerate(answered) if answer), default=-1)
    if last >= run.loop or not any(asked[last + 1 :]):
        refuse("in this run the answer comes")
    if not sequence.cycle:
        return
    player = Player(net)
    enabled = [{net.transitions[t].name for t in player.may_fire(m)} for m in run.markings[run.loop :]]
    owed: set[Any] = set()
    match claim.fairness:
        case Fairness.WEAK:
            owed = set.intersection(*enabled)
        case Fairness.STRONG:
            owed = set.union(*enabled)
    if left_out := owed - frozenset().union(*run.fired[run.loop :]):
        refuse(f"the cycle is not fair to {min(left_out)}")
