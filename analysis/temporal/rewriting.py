"""Formulas of LTL rewritten for the tableau: negations at atoms, X, U and R alone, and as little of them as possible.

Besides the laws that every textbook has, three classes of formulas collapse (Etessami and Holzmann 2000, "Optimizing
Büchi automata"): *eventual* ones, such as F p, hold now if they hold later, so `q U F p` is `F p`; *universal* ones,
such as G p, hold later if they hold now, so `q R G p` is `G p`; and what is both, such as G F p, holds everywhere on a
run or nowhere, so X, U and R before it say nothing. An X is pulled outwards, where it is taken once. Each rule takes
states from the automaton, and each state costs a fixpoint over the whole state space.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from firable.nets.formula import And, Constant, Formula, Not, Or
from firable.nets.temporal import (
    Eventually,
    Globally,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    WeakUntil,
    all_of,
    any_of,
    negated,
)

TRUE: Final = Constant(value=True)
FALSE: Final = Constant(value=False)


def positive(formula: Temporal) -> Temporal:
    """The formula with negations at atoms only, and with the operators X, U and R alone.

    >>> from firable.nets.temporal import format_temporal, parse_temporal
    >>> format_temporal(positive(parse_temporal("not G (p -> F q)")))
    'true U (p and (false R not q))'
    """
    match formula:
        case TemporalAnd(operands):
            return _all_of(map(positive, operands))
        case TemporalOr(operands):
            return _any_of(map(positive, operands))
        case Next(operand):
            return _next(positive(operand))
        case Eventually(operand):
            return _until(TRUE, positive(operand))
        case Globally(operand):
            return _release(FALSE, positive(operand))
        case Until(left, right):
            return _until(positive(left), positive(right))
        case Release(left, right):
            return _release(positive(left), positive(right))
        case WeakUntil(left, right):
            return _release(positive(right), _any_of((positive(left), positive(right))))
        case TemporalNot(operand):
            return _positive_of_negation(operand)
        case Not(Not(operand)):
            return positive(operand)
    return formula


def _positive_of_negation(formula: Temporal) -> Temporal:
    match formula:
        case TemporalNot(operand):
            return positive(operand)
        case TemporalAnd(operands):
            return _any_of(positive(negated(operand)) for operand in operands)
        case TemporalOr(operands):
            return _all_of(positive(negated(operand)) for operand in operands)
        case Next(operand):  # a run never ends: in a deadlock it stutters, so X is its own dual
            return _next(positive(negated(operand)))
        case Eventually(operand):
            return _release(FALSE, positive(negated(operand)))
        case Globally(operand):
            return _until(TRUE, positive(negated(operand)))
        case Until(left, right):
            return _release(positive(negated(left)), positive(negated(right)))
        case Release(left, right):
            return _until(positive(negated(left)), positive(negated(right)))
        case WeakUntil(left, right):
            either = any_of((left, right))
            return _until(positive(negated(right)), positive(negated(either)))
    return negated(formula)


def _all_of(operands: Iterable[Temporal]) -> Temporal:
    """A conjunction whose state formulas are one operand."""
    flat: dict[Temporal, None] = {}
    for operand in operands:
        parts = operand.operands if isinstance(operand, TemporalAnd) else (operand,)
        flat.update(dict.fromkeys(parts))
    states = tuple(one for one in flat if isinstance(one, Formula) and one != TRUE)
    others = tuple(one for one in flat if not isinstance(one, Formula))
    if FALSE in states:
        return FALSE
    state = states[0] if len(states) == 1 else And(states)
    if not others:
        return state if states else TRUE
    return all_of((state, *others) if states else others)


def _any_of(operands: Iterable[Temporal]) -> Temporal:
    """A disjunction whose state formulas are one operand."""
    flat: dict[Temporal, None] = {}
    for operand in operands:
        parts = operand.operands if isinstance(operand, TemporalOr) else (operand,)
        flat.update(dict.fromkeys(parts))
    states = tuple(one for one in flat if isinstance(one, Formula) and one != FALSE)
    others = tuple(one for one in flat if not isinstance(one, Formula))
    if TRUE in states:
        return TRUE
    state = states[0] if len(states) == 1 else Or(states)
    if not others:
        return state if states else FALSE
    return any_of((state, *others) if states else others)


def _next(operand: Temporal) -> Temporal:
    if operand in {TRUE, FALSE} or _invariant(operand):
        return operand
    if isinstance(operand, TemporalAnd | TemporalOr) and (free := [one for one in operand.operands if _invariant(one)]):
        rest = (one for one in operand.operands if one not in free)
        if isinstance(operand, TemporalAnd):
            return _all_of((_next(_all_of(rest)), *free))
        return _any_of((_next(_any_of(rest)), *free))
    return Next(operand)


@dataclass(frozen=True, slots=True)
class _Kind:
    """Until or release, which are each other's mirror: what is true of the one is of the other with all sides turned.

    `anything` on the left asks nothing of the time before, `nothing` on the left lets no time pass; `passes` says that
    what is on the right is not changed by the time before it; the operator goes into each of `many`.
    """

    make: type[Until] | type[Release]
    anything: Temporal
    nothing: Temporal
    passes: Callable[[Temporal], bool]
    many: type[TemporalAnd] | type[TemporalOr]

    def __call__(self, left: Temporal, right: Temporal) -> Temporal:
        """The operator applied, simplified."""
        if right in {TRUE, FALSE} or left == self.nothing or self.passes(right):
            return right
        if isinstance(right, self.make) and (left == self.anything or right.left == left):  # F (p U q), p U (p U q)
            return self(left, right.right)
        if isinstance(right, Next) and left == self.anything:
            return _next(self(left, right.operand))
        if isinstance(right, Next) and isinstance(left, Next):
            return _next(self(left.operand, right.operand))
        if not isinstance(right, TemporalAnd | TemporalOr):
            return self.make(left, right)
        join = _all_of if isinstance(right, TemporalAnd) else _any_of
        if isinstance(right, self.many) and left == self.anything:
            return join(self(left, operand) for operand in right.operands)
        if free := [one for one in right.operands if _invariant(one)]:
            rest = tuple(one for one in right.operands if one not in free)
            return join((self(left, join(rest)), *free))
        return self.make(left, right)


def _until(left: Temporal, right: Temporal) -> Temporal:
    return _Kind(Until, TRUE, FALSE, _eventual, TemporalOr)(left, right)


def _release(left: Temporal, right: Temporal) -> Temporal:
    return _Kind(Release, FALSE, TRUE, _universal, TemporalAnd)(left, right)


def _eventual(formula: Temporal) -> bool:
    """Whether the formula holds of a run if it holds of the rest of it from some later moment."""
    match formula:
        case Constant():
            return True
        case Until(left, right):
            return left == TRUE or (_eventual(left) and _eventual(right))
        case Release(left, right):
            return _eventual(left) and _eventual(right)
        case Next(operand):
            return _eventual(operand)
        case TemporalAnd(operands) | TemporalOr(operands):
            return all(map(_eventual, operands))
    return False


def _universal(formula: Temporal) -> bool:
    """Whether the formula holds of all the rests of a run if it holds of the run."""
    match formula:
        case Constant():
            return True
        case Release(left, right):
            return left == FALSE or (_universal(left) and _universal(right))
        case Until(left, right):
            return _universal(left) and _universal(right)
        case Next(operand):
            return _universal(operand)
        case TemporalAnd(operands) | TemporalOr(operands):
            return all(map(_universal, operands))
    return False


def _invariant(formula: Temporal) -> bool:
    """Whether the formula holds of a run iff it holds of each of its rests."""
    return _eventual(formula) and _universal(formula)


def replaced(formula: Temporal, value: Callable[[Formula], Formula]) -> Temporal:
    """The (positive) formula with each state formula of it replaced, and simplified again."""
    match formula:
        case TemporalAnd(operands):
            return _all_of(replaced(operand, value) for operand in operands)
        case TemporalOr(operands):
            return _any_of(replaced(operand, value) for operand in operands)
        case Next(operand):
            return _next(replaced(operand, value))
        case Until(left, right):
            return _until(replaced(left, value), replaced(right, value))
        case Release(left, right):
            return _release(replaced(left, value), replaced(right, value))
    return value(formula) if isinstance(formula, Formula) else formula
