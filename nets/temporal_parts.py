"""What a formula of CTL or LTL is made of: the names in it, and the state formulas that it is built over.

One walk over the tree for all that ask: who checks names, who renames, who turns gates of a complemented place, and who
must know whether firings are spoken of. Beside `firable.nets.temporal`, which says what formulas are and how they are
written; a base class with a method for each walk was rejected, as the tree would know its readers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from firable.nets.formula import Firable, Formula, Holds, names_in
from firable.nets.temporal import (
    Eventually,
    Exists,
    Fires,
    ForAll,
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
    operands_of,
)


def atoms_in(formula: Temporal) -> Iterator[Holds | Firable | Fires]:
    """The atoms of the formula that name a place or a transition, left to right."""
    match formula:
        case Fires():
            yield formula
        case Exists(path) | ForAll(path):
            yield from atoms_in(path)
        case _ if isinstance(formula, Formula):
            yield from names_in(formula)
        case _:
            for operand in operands_of(formula):
                yield from atoms_in(operand)


def states_in(formula: Temporal) -> Iterator[Formula]:
    """The largest state formulas in it, left to right.

    >>> from firable.nets.temporal import parse_temporal
    >>> list(states_in(parse_temporal("AG (p and EX not q)")))
    [Holds(place='p'), Not(operand=Holds(place='q'))]
    """
    match formula:
        case Exists(path) | ForAll(path):
            yield from states_in(path)
        case _ if isinstance(formula, Formula):
            yield formula
        case _:
            for operand in operands_of(formula):
                yield from states_in(operand)


def with_states(formula: Temporal, changed: Callable[[Formula], Formula]) -> Temporal:
    """The formula with each of its largest state formulas changed.

    >>> from firable.nets.formula import Not
    >>> from firable.nets.temporal import format_temporal, parse_temporal
    >>> format_temporal(with_states(parse_temporal("AG (p and q)"), Not))
    'AG not (p and q)'
    """
    match formula:
        case Fires():
            return formula
        case TemporalNot(operand):
            return negated(with_states(operand, changed))
        case TemporalAnd(operands):
            return all_of(tuple(with_states(operand, changed) for operand in operands))
        case TemporalOr(operands):
            return any_of(tuple(with_states(operand, changed) for operand in operands))
        case Next() | Eventually() | Globally():
            return type(formula)(with_states(formula.operand, changed))
        case Until() | Release() | WeakUntil():
            return type(formula)(with_states(formula.left, changed), with_states(formula.right, changed))
        case Exists() | ForAll():
            return type(formula)(with_states(formula.path, changed))
    return changed(formula)


def has_events(formula: Temporal) -> bool:
    """Whether the formula speaks of firings, and not of markings alone."""
    return any(isinstance(atom, Fires) for atom in atoms_in(formula))


def has_next(formula: Temporal) -> bool:
    """Whether the formula has the operator X, and so may tell apart how long a run stays with the same values.

    >>> from firable.nets.temporal import parse_temporal
    >>> [has_next(parse_temporal(text)) for text in ("G (p -> F X q)", "AG (p or EX q)", "G (p -> F q)")]
    [True, True, False]
    """
    match formula:
        case Exists(path) | ForAll(path):
            return has_next(path)
        case _ if isinstance(formula, Formula):
            return False
    return isinstance(formula, Next) or any(map(has_next, operands_of(formula)))
