"""Goals as formulas over places alone, rewritten while places disappear.

A reduction removes transitions and places, so a goal that names transitions, the deadlock or the initial marking is
first written out over places: `firable(t)` is the conjunction of Eq. (1), `start` says of each place what M0 says. The
one atom that is not written out is a `deadlock` that stands in conjunction with the rest, because a reduction that is
made for deadlocks can preserve it without protecting every place of the net.

What a rule must know of a goal are its *literals*: the pairs of a place and a value such that the goal may become true
by the place taking that value. A goal in which `p` stands only without negation is never spoilt by a token on `p`. The
literals are read off with the negations pushed inwards; a comparison of counts has, for each place, the value that
helps it, and both where it asks for equality.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from firable.nets.formula import (
    And,
    Compare,
    Constant,
    Count,
    Deadlock,
    Firable,
    Formula,
    Holds,
    Not,
    Or,
    Sign,
    Start,
    conjuncts,
)
from firable.nets.net import Net

Value = bool | tuple[str, bool]
"""What stands for a place: a constant, or another place, equal to it (True) or its complement (False)."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A marking that satisfies `formula`, which speaks of places alone, and is a deadlock if that is asked for."""

    formula: Formula
    deadlock: bool = False

    def as_formula(self) -> Formula:
        """The goal as one state formula."""
        if not self.deadlock or self.formula == Constant(value=False):
            return self.formula
        return Deadlock() if self.formula == Constant(value=True) else And((Deadlock(), self.formula))

    @property
    def is_false(self) -> bool:
        """Whether no marking can satisfy it."""
        return self.formula == Constant(value=False)

    def literals(self) -> Iterator[tuple[str, bool]]:
        """The places with the values that it may become true by."""
        return literals_in(self.formula)

    def rewritten(self, values: Mapping[str, Value]) -> Goal:
        """The same with what stands for places in their place."""
        return Goal(rewritten(self.formula, values), self.deadlock)


@dataclass(frozen=True, slots=True)
class Labels:
    """Formulas over places alone, of which it matters along a maximal run where each is true and where it is not.

    Where they are `branching` it matters besides what can still happen wherever a run has come.
    """

    formulas: tuple[Formula, ...]
    branching: bool = False
    deadlock: ClassVar = True

    def literals(self) -> Iterator[tuple[str, bool]]:
        """The places that they speak of, with both values."""
        for formula in self.formulas:
            for place, _ in literals_in(formula):
                yield place, False
                yield place, True

    def rewritten(self, values: Mapping[str, Value]) -> Labels:
        """The same with what stands for places in their place."""
        return replace(self, formulas=tuple(rewritten(formula, values) for formula in self.formulas))


def goal_of(net: Net, formula: Formula) -> Goal:
    """The goal that a state formula of the net is.

    >>> from firable.nets.net import Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    >>> goal_of(net, And((Deadlock(), Holds("q"))))
    Goal(formula=Holds(place='q'), deadlock=True)
    >>> goal_of(net, Firable("t"))
    Goal(formula=And(operands=(Holds(place='p'), Not(operand=Holds(place='q')))), deadlock=False)
    """
    operands = tuple(conjuncts(formula))
    rest = tuple(operand for operand in operands if operand != Deadlock())
    return Goal(rewritten(written_out(net, And(rest)), {}), len(rest) < len(operands))


def written_out(net: Net, formula: Formula) -> Formula:
    """The same formula over places alone."""
    match formula:
        case Firable(name):
            return _firable(net, net.transition_index[name])
        case Start():
            return And(tuple(_literal(place.name, place.marked) for place in net.places))
        case Deadlock():
            return And(tuple(Not(_firable(net, t)) for t in range(len(net.transitions))))
        case Not(operand):
            return Not(written_out(net, operand))
        case And(operands):
            return And(tuple(written_out(net, operand) for operand in operands))
        case Or(operands):
            return Or(tuple(written_out(net, operand) for operand in operands))
        case Constant() | Holds() | Compare():
            return formula


def _firable(net: Net, t: int) -> Formula:
    transition = net.transitions[t]
    if not transition.openable:
        return Constant(value=False)
    marked = dict.fromkeys((*transition.inputs, *transition.permissive))
    empty = dict.fromkeys((*transition.outputs, *transition.inhibitive))
    if marked.keys() & empty.keys():
        return Constant(value=False)
    return And((*(Holds(place) for place in marked), *(Not(Holds(place)) for place in empty)))


def _literal(place: str, value: bool) -> Formula:
    return Holds(place) if value else Not(Holds(place))


def rewritten(formula: Formula, values: Mapping[str, Value]) -> Formula:
    """The formula with places replaced by what stands for them, and constants folded.

    >>> from firable.nets.formula import format_formula, parse_formula
    >>> format_formula(rewritten(parse_formula("a and (b or not c) and tokens(a, c) <= 1"), {"a": True}))
    '(b or not c) and tokens(c) + 1 <= 1'
    >>> format_formula(rewritten(parse_formula("tokens(a, c) >= 1 and not b"), {"a": ("b", False)}))
    'tokens(c) + 1 >= tokens(b) + 1 and not b'
    """
    match formula:
        case Holds(place):
            return _standing_for(formula, values.get(place))
        case Compare():
            return _compared(formula, values)
        case Not(operand):
            match rewritten(operand, values):
                case Constant(value):
                    return Constant(not value)
                case Not(inner):
                    return inner
                case inner:
                    return Not(inner)
        case And(operands):
            return _joined(operands, values, conjunction=True)
        case Or(operands):
            return _joined(operands, values, conjunction=False)
        case _:
            return formula


def _standing_for(formula: Holds, value: Value | None) -> Formula:
    match value:
        case None:
            return formula
        case bool():
            return Constant(value)
        case (place, equal):
            return _literal(place, equal)


def _joined(operands: tuple[Formula, ...], values: Mapping[str, Value], *, conjunction: bool) -> Formula:
    kind = And if conjunction else Or
    found: dict[Formula, None] = {}
    for operand in operands:
        new = rewritten(operand, values)
        if new == Constant(not conjunction):
            return new
        if new != Constant(conjunction):
            found.update(dict.fromkeys(new.operands if isinstance(new, kind) else (new,)))
    if any(isinstance(one, Not) and one.operand in found for one in found):
        return Constant(not conjunction)
    return next(iter(found)) if len(found) == 1 else kind(tuple(found)) if found else Constant(conjunction)


def _compared(formula: Compare, values: Mapping[str, Value]) -> Formula:
    places: tuple[list[str], list[str]] = ([], [])
    added = [formula.left.added, formula.right.added]
    for side, count in enumerate((formula.left, formula.right)):
        for place in count.places:
            match values.get(place):
                case None:
                    places[side].append(place)
                case bool(value):
                    added[side] += value
                case (other, True):
                    places[side].append(other)
                case (other, _):  # 1 - other: it counts on the other side
                    added[side] += 1
                    places[1 - side].append(other)
    lowest, highest = added[0] - added[1] - len(places[1]), added[0] - added[1] + len(places[0])
    if (known := _known(formula.sign, lowest, highest)) is not None:
        return Constant(known)
    return Compare(Count(tuple(places[0]), added[0]), formula.sign, Count(tuple(places[1]), added[1]))


def _known(sign: Sign, lowest: int, highest: int) -> bool | None:
    """The value of "the difference of two counts compares so with 0", if its bounds alone tell it."""
    match sign:
        case Sign.AT_MOST:
            return True if highest <= 0 else False if lowest > 0 else None
        case Sign.LESS:
            return True if highest < 0 else False if lowest >= 0 else None
        case Sign.AT_LEAST:
            return True if lowest >= 0 else False if highest < 0 else None
        case Sign.MORE:
            return True if lowest > 0 else False if highest <= 0 else None
        case Sign.EQUAL | Sign.UNEQUAL:
            equal = True if lowest == highest == 0 else False if lowest > 0 or highest < 0 else None
            return None if equal is None else equal is (sign is Sign.EQUAL)


def literals_in(formula: Formula, *, wanted: bool = True) -> Iterator[tuple[str, bool]]:
    """The places with the values that may make the formula true (or false, where that is `wanted`).

    >>> from firable.nets.formula import parse_formula
    >>> sorted(literals_in(parse_formula("a and not (b or not c) and tokens(d) < tokens(e)")))
    [('a', True), ('b', False), ('c', True), ('d', False), ('e', True)]
    """
    match formula:
        case Holds(place):
            yield place, wanted
        case Compare(left, sign, right):
            values = {
                Sign.AT_MOST: (not wanted,),
                Sign.LESS: (not wanted,),
                Sign.AT_LEAST: (wanted,),
                Sign.MORE: (wanted,),
                Sign.EQUAL: (False, True),
                Sign.UNEQUAL: (False, True),
            }[sign]
            for value in values:
                yield from ((place, value) for place in left.places)
                yield from ((place, not value) for place in right.places)
        case Not(operand):
            yield from literals_in(operand, wanted=not wanted)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from literals_in(operand, wanted=wanted)
        case Constant():
            return
        case Firable() | Start() | Deadlock():
            raise ValueError(f"{type(formula).__name__} is not written out over places")
