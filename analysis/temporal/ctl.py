"""CTL, by sets of markings: the set in which each subformula holds, from the inside out.

The algorithm of Clarke, Emerson and Sistla (1986), over any state space: EX is one step back, EU a backward closure, EG
the markings from which a maximal run stays within a set; the universal operators are their duals. One text serves the
table of markings and the decision diagram, since both answer these three. A formula whose operator is EF or AG at the
top, over a state formula, needs no more of the space than the marking that decides it.

The evidence is what the outermost operators give: a firing sequence to a marking, or a lasso, a sequence and then a
cycle, that stays where it should. A negation turns it into that of the dual. What stands below the outermost operator
is not unfolded: the reader is led to a marking where it does (or does not) hold.

Where no technique holds all markings, formulas are evaluated locally (`by_parts`, `local`), which looks at less of the
space where it is lucky; with the whole space at hand sets are faster.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Generic, TypeVar

from firable.analysis.temporal.sets import Sets
from firable.analysis.temporal.simplifying import simplified
from firable.nets.formula import Formula
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
    negated,
)

S = TypeVar("S")


@dataclass
class Ctl(Generic[S]):
    """The sets in which the subformulas of CTL formulas hold, each found once."""

    sets: Sets[S]
    _known: dict[Temporal, S] = field(default_factory=dict)

    def of(self, formula: Temporal) -> S:
        """The markings in which a formula of CTL holds.

        Raises `IncompleteGraph` where the space is not whole.
        """
        self.sets.space.require_complete()
        if formula not in self._known:
            self._known[formula] = self._found(formula)
        return self._known[formula]

    def _found(self, formula: Temporal) -> S:
        sets = self.sets
        match formula:
            case TemporalNot(operand):
                return sets.outside(self.of(operand))
            case TemporalAnd(operands):
                return sets.both(*map(self.of, operands))
            case TemporalOr(operands):
                return sets.either(*map(self.of, operands))
            case Exists(Next(operand)):
                return sets.before(self.of(operand))
            case Exists(Eventually(operand)):
                return sets.until(sets.all, self.of(operand))
            case Exists(Globally(operand)):
                return sets.always(self.of(operand))
            case Exists(Until(left, right)):
                return sets.until(self.of(left), self.of(right))
            case ForAll(Next(operand)):
                return sets.outside(sets.before(sets.outside(self.of(operand))))
            case ForAll(Eventually(operand)):
                return sets.outside(sets.always(sets.outside(self.of(operand))))
            case ForAll(Globally(operand)):
                return sets.outside(sets.until(sets.all, sets.outside(self.of(operand))))
            case ForAll(Until(left, right)):
                # A run fails where `right` stays away for ever, or where `left` ends before it comes.
                away = sets.outside(self.of(right))
                ended = sets.both(away, sets.outside(self.of(left)))
                return sets.outside(sets.either(sets.until(away, ended), sets.always(away)))
            case _ if isinstance(formula, Formula):
                return sets.of(formula)
        raise ValueError(f"{formula} is no formula of CTL")


def satisfied(ctl: Ctl[S], formula: Temporal) -> bool:
    """Whether M0 satisfies a formula, which is made simpler before.

    Raises `IncompleteGraph` where the space is not whole.
    """
    space = ctl.sets.space
    space.require_complete()
    return space.contains(ctl.of(simplified(formula, ctl.sets.constant)), space.net.initial_marking)


def dual(formula: ForAll) -> Temporal:
    """The existential formula that a universal one denies, for X, F and G.

    >>> from firable.nets.temporal import format_temporal, parse_temporal
    >>> format_temporal(dual(ForAll(Globally(parse_temporal("p")))))
    'EF not p'
    """
    match formula.path:
        case Next(operand):
            return Exists(Next(negated(operand)))
        case Eventually(operand):
            return Exists(Globally(negated(operand)))
        case Globally(operand):
            return Exists(Eventually(negated(operand)))
    raise ValueError(f"{formula} has no dual among the existential formulas")
