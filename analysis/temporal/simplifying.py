"""Formulas of CTL made simpler: by laws of the logic, and by state formulas that hold always or never.

What is asked of nets is rarely as simple as it could be. `EF AF E[p U q]` is `EF q`, which comes down to a goal; `AX p`
where `p` can never fail is `true`, and with it falls what is built on it. The laws are those by which one operator
swallows another (`EF EF`, `EF AF`, `AF EF`, `A[p U EF q]`, and their duals), by which operators are shared out over
`and` and `or`, and what constants leave. All hold for maximal runs, those that end in a deadlock among them.

Which state formulas are constant the caller finds, by goals: one that holds in M0 can only be `true`, another one only
`false` (`simplified`). Source of the idea: Bønneland, Dyhr, Jensen, Johannsen, Srba, "Simplification of CTL formulae
for efficient model checking of Petri nets" (2018), which solves a linear programme for each comparison; here techniques
for goals are asked, which on the contest's nets decide nearly all of them.
"""

from __future__ import annotations

from collections.abc import Callable

from firable.nets.formula import And, Constant, Deadlock, Formula, Not, Or
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
    all_of,
    any_of,
    negated,
)

TRUE = Constant(value=True)
FALSE = Constant(value=False)
States = Callable[[Formula], Formula]
"""What stands for a state formula."""


def simplified(formula: Temporal, states: States = lambda state: state) -> Temporal:
    """The formula with negations inside, each largest state formula replaced by what `states` says, and laws applied.

    The result holds in the same reachable markings, if what `states` says does. Cost: linear but for operators that are
    shared out.

    >>> from firable.nets.temporal import format_temporal, parse_temporal
    >>> [format_temporal(simplified(parse_temporal(text))) for text in ("EF AF E[p U q]", "not AG (p and AX q)")]
    ['EF q', 'EF not p or EF EX not q']
    >>> format_temporal(simplified(parse_temporal("AG (p or AX q)"), lambda state: TRUE))
    'true'
    """
    return _inside(formula, states, negate=False)


def _inside(formula: Temporal, states: States, *, negate: bool) -> Temporal:
    match formula:
        case _ if isinstance(formula, Formula):
            return states(_state(formula, negate=negate))
        case TemporalNot(operand):
            return _inside(operand, states, negate=not negate)
        case TemporalAnd(operands) | TemporalOr(operands):
            parts = [_inside(operand, states, negate=negate) for operand in operands]
            return _joined(parts, every=isinstance(formula, TemporalAnd) is not negate, states=states)
        case Exists(Next(operand)) | ForAll(Next(operand)):
            return _next(
                _inside(operand, states, negate=negate), states, some=isinstance(formula, Exists) is not negate
            )
        case Exists(Eventually(operand)) | ForAll(Eventually(operand)):
            inner = _inside(operand, states, negate=negate)
            some = isinstance(formula, Exists) is not negate
            return _always(inner, states, some=some) if negate else _eventually(inner, states, some=some)
        case Exists(Globally(operand)) | ForAll(Globally(operand)):
            inner = _inside(operand, states, negate=negate)
            some = isinstance(formula, Exists) is not negate
            return _eventually(inner, states, some=some) if negate else _always(inner, states, some=some)
        case Exists(Until(left, right)) | ForAll(Until(left, right)):
            inner = _until(
                _inside(left, states, negate=False),
                _inside(right, states, negate=False),
                states,
                some=isinstance(formula, Exists),
            )
            # Only an until is kept under a negation, as its dual is no operator of CTL.
            is_until = isinstance(inner, Exists | ForAll) and isinstance(inner.path, Until)
            return inner if not negate else TemporalNot(inner) if is_until else _inside(inner, states, negate=True)
    raise ValueError(f"{formula} is no formula of CTL")


def _state(formula: Formula, *, negate: bool) -> Formula:
    if not negate:
        return formula
    match formula:
        case Not(operand):
            return operand
        case Constant(value):
            return Constant(not value)
    return Not(formula)


def _joined(parts: list[Temporal], *, every: bool, states: States) -> Temporal:
    """The conjunction (`every`) or disjunction, flat, without repetitions and constants."""
    of, decisive = (TemporalAnd if every else TemporalOr), Constant(not every)
    flat: dict[Temporal, None] = {}
    for part in parts:
        flat.update(dict.fromkeys(part.operands if isinstance(part, of) else (part,)))
    flat.pop(Constant(every), None)
    if decisive in flat or not flat:
        return decisive if decisive in flat else Constant(every)
    found = [part for part in flat if isinstance(part, Formula)]
    others = [part for part in flat if not isinstance(part, Formula)]
    if len(found) > 1:
        together = And(tuple(found)) if every else Or(tuple(found))
        state = states(together)
        if state == decisive:
            return decisive
        found = [] if state == Constant(every) else [state]
    whole = (*found, *others)
    return Constant(every) if not whole else all_of(whole) if every else any_of(whole)


def _next(operand: Temporal, states: States, *, some: bool) -> Temporal:
    if operand == Constant(not some):
        return operand
    if operand == Constant(some):
        return states(Not(Deadlock()) if some else Deadlock())
    if isinstance(operand, TemporalOr if some else TemporalAnd):
        return _joined([_next(one, states, some=some) for one in operand.operands], every=not some, states=states)
    return Exists(Next(operand)) if some else ForAll(Next(operand))


def _eventually(operand: Temporal, states: States, *, some: bool) -> Temporal:
    """EF or AF."""
    match operand:
        case Constant():
            return operand
        case Exists(Eventually()):  # EF EF, AF EF
            return operand
        case ForAll(Eventually(inner)):  # EF AF, AF AF
            return _eventually(inner, states, some=True) if some else operand
        case ForAll(Until(_, right)):  # of it EF and AF see the end alone
            return _eventually(right, states, some=some)
        case Exists(Until(_, right)) if some:
            return _eventually(right, states, some=True)
        case TemporalOr(operands) if some:
            return _joined([_eventually(one, states, some=True) for one in operands], every=False, states=states)
    return Exists(Eventually(operand)) if some else ForAll(Eventually(operand))


def _always(operand: Temporal, states: States, *, some: bool) -> Temporal:
    """EG or AG."""
    match operand:
        case Constant():
            return operand
        case ForAll(Globally()):  # EG AG, AG AG
            return operand
        case Exists(Globally(inner)):  # EG EG, AG EG
            return operand if some else _always(inner, states, some=False)
        case TemporalAnd(operands) if not some:
            return _joined([_always(one, states, some=False) for one in operands], every=True, states=states)
    return Exists(Globally(operand)) if some else ForAll(Globally(operand))


def _until(left: Temporal, right: Temporal, states: States, *, some: bool) -> Temporal:
    if left == TRUE:
        return _eventually(right, states, some=some)
    if left == FALSE or isinstance(right, Constant):
        return right
    match right:
        case Exists(Eventually()):  # what can be reached later can be reached now
            return right
        case ForAll(Eventually()) if not some:
            return right
        case TemporalOr(operands) if some:
            return _joined([_until(left, one, states, some=True) for one in operands], every=False, states=states)
    return Exists(Until(left, right)) if some else ForAll(Until(left, right))


def implied(formula: Temporal) -> Formula:
    """A state formula that holds wherever a simplified formula does; `true` where nothing better is seen.

    >>> from firable.nets.formula import format_formula
    >>> from firable.nets.temporal import parse_temporal
    >>> format_formula(implied(simplified(parse_temporal("AG p and not E[q U r] and EX q"))))
    'p and not r'
    """
    match formula:
        case _ if isinstance(formula, Formula):
            return formula
        case TemporalAnd(operands):
            kept = [of for of in map(implied, operands) if of != TRUE]
            return TRUE if not kept else kept[0] if len(kept) == 1 else And(tuple(kept))
        case TemporalOr(operands):
            parts = [implied(operand) for operand in operands]
            return TRUE if TRUE in parts else Or(tuple(parts))
        case Exists(Globally(operand)) | ForAll(Globally(operand)):
            return implied(operand)
        case Exists(Until(left, right)) | ForAll(Until(left, right)):
            either = (implied(left), implied(right))
            return TRUE if TRUE in either else Or(either)
        case TemporalNot(Exists(Until(_, right)) | ForAll(Until(_, right))):
            return implied(simplified(negated(right)))
    return TRUE
