"""Temporal formulas, CTL and LTL, over the state formulas of a net, and the text they are written in.

Two logics, one syntax tree. CTL (Clarke and Emerson 1981) speaks of the tree of what can happen: each operator says
whether it means some run (`E`) or all of them (`A`). LTL (Pnueli 1977) speaks of each run by itself, and holds where
every run satisfies it. A run is maximal: it goes on for ever or ends in a deadlock. What this means for each operator
is said in docs/queries.md. In LTL an atom may also be an event: `fires(t)` holds where the next thing that happens is
that `t` fires.

The grammar, loosest binding first (`->`, `U`, `R` and `W` group to the right)::

    formula = disjunction [ "->" formula ]
    disjunction = conjunction { "or" conjunction }
    conjunction = binary { "and" binary }
    binary = literal [ ( "U" | "R" | "W" ) binary ]
    literal = "not" literal | unary literal | quantifier "[" formula "U" formula "]" | "(" formula ")" | atom
    unary = "X" | "F" | "G" | "EX" | "EF" | "EG" | "AX" | "AF" | "AG"
    quantifier = "E" | "A"
    atom = "fires" "(" name ")" | atom of a state formula

A place whose name is one of these words is named in quotes. The two logics do not mix: CTL*, which has both, needs a
method of its own for questions that nobody asks. Rejected, too: the symbols of the literature (`[]`, `<>`, `!`, `/\\`),
which are half of the characters of a place's name and which no engineer reads aloud.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from firable.nets.formula import (
    CONSTANT_ATOMS,
    And,
    Formula,
    FormulaError,
    FormulaParser,
    Not,
    Or,
    format_formula,
)


@dataclass(frozen=True, slots=True)
class Fires:
    """The next thing that happens is that `transition` fires; only in LTL."""

    transition: str


@dataclass(frozen=True, slots=True)
class TemporalNot:
    """Negation of what is no state formula."""

    operand: Temporal


@dataclass(frozen=True, slots=True)
class TemporalAnd:
    """Conjunction, of which one operand at least is no state formula."""

    operands: tuple[Temporal, ...]


@dataclass(frozen=True, slots=True)
class TemporalOr:
    """Disjunction, of which one operand at least is no state formula."""

    operands: tuple[Temporal, ...]


@dataclass(frozen=True, slots=True)
class Next:
    """X: at the next marking of the run."""

    operand: Temporal


@dataclass(frozen=True, slots=True)
class Eventually:
    """F: now or later."""

    operand: Temporal


@dataclass(frozen=True, slots=True)
class Globally:
    """G: now and always."""

    operand: Temporal


@dataclass(frozen=True, slots=True)
class Until:
    """U: `right` now or later, and `left` until then."""

    left: Temporal
    right: Temporal


@dataclass(frozen=True, slots=True)
class Release:
    """R: `right` up to and including the moment when `left` holds, or always."""

    left: Temporal
    right: Temporal


@dataclass(frozen=True, slots=True)
class WeakUntil:
    """W: `left` until `right`, or always."""

    left: Temporal
    right: Temporal


@dataclass(frozen=True, slots=True)
class Exists:
    """E: some maximal run from here."""

    path: Temporal


@dataclass(frozen=True, slots=True)
class ForAll:
    """A: every maximal run from here."""

    path: Temporal


Temporal = (
    Formula
    | Fires
    | TemporalNot
    | TemporalAnd
    | TemporalOr
    | Next
    | Eventually
    | Globally
    | Until
    | Release
    | WeakUntil
    | Exists
    | ForAll
)


class Logic(StrEnum):
    """The two logics."""

    CTL = "ctl"
    LTL = "ltl"


_CTL: Final = frozenset({Logic.CTL})
_LTL: Final = frozenset({Logic.LTL})
_BOTH: Final = _CTL | _LTL

_UNARY: Final[dict[str, type[Next | Eventually | Globally]]] = {"X": Next, "F": Eventually, "G": Globally}
_BINARY: Final[dict[str, type[Until | Release | WeakUntil]]] = {"U": Until, "R": Release, "W": WeakUntil}
_QUANTIFIERS: Final[dict[str, type[Exists | ForAll]]] = {"E": Exists, "A": ForAll}
_QUANTIFIED: Final = {q + u: (_QUANTIFIERS[q], _UNARY[u]) for q in _QUANTIFIERS for u in _UNARY}
RESERVED: Final = CONSTANT_ATOMS | {*_UNARY, *_BINARY, *_QUANTIFIERS, *_QUANTIFIED}
"""Words that mean something here, so a place of that name stands in quotes."""


def negated(operand: Temporal) -> Temporal:
    """The negation: a state formula of a state formula."""
    return Not(operand) if isinstance(operand, Formula) else TemporalNot(operand)


def all_of(operands: tuple[Temporal, ...]) -> Temporal:
    """The conjunction: a state formula of state formulas; one operand stands for itself."""
    if len(operands) == 1:
        return operands[0]
    states = tuple(one for one in operands if isinstance(one, Formula))
    return And(states) if len(states) == len(operands) else TemporalAnd(operands)


def any_of(operands: tuple[Temporal, ...]) -> Temporal:
    """The disjunction: a state formula of state formulas; one operand stands for itself."""
    if len(operands) == 1:
        return operands[0]
    states = tuple(one for one in operands if isinstance(one, Formula))
    return Or(states) if len(states) == len(operands) else TemporalOr(operands)


class _Parser(FormulaParser):
    """Recursive descent over the grammar of the module's docstring; atoms are those of state formulas."""

    def formula(self, *, in_brackets: bool = False) -> Temporal:
        """A formula; in the brackets of `E[p U q]` an `U` that nothing else encloses belongs to them."""
        left = self.any_of(in_brackets)
        if self.peek() == "->":
            self.take()
            self.deeper(1)
            right = self.formula(in_brackets=in_brackets)
            self.deeper(-1)
            return any_of((negated(left), right))
        return left

    def any_of(self, in_brackets: bool) -> Temporal:
        operands = [self.all_of(in_brackets)]
        while self.peek() == "or":
            self.take()
            operands.append(self.all_of(in_brackets))
        return any_of(tuple(operands))

    def all_of(self, in_brackets: bool) -> Temporal:
        operands = [self.binary(in_brackets)]
        while self.peek() == "and":
            self.take()
            operands.append(self.binary(in_brackets))
        return all_of(tuple(operands))

    def binary(self, in_brackets: bool) -> Temporal:
        left = self.prefixed()
        word = self.peek()
        if in_brackets or word not in _BINARY or self.quoted():
            return left
        self.take()
        self.deeper(1)
        right = self.binary(in_brackets)
        self.deeper(-1)
        return _BINARY[word](left, right)

    def prefixed(self) -> Temporal:
        prefixes = []
        while (word := self.peek()) == "not" or ((word in _UNARY or word in _QUANTIFIED) and not self.quoted()):
            prefixes.append(self.take())
            self.deeper(1)
        formula = self.unit()
        self.deeper(-len(prefixes))
        for word in reversed(prefixes):
            if word == "not":
                formula = negated(formula)
            elif word in _UNARY:
                formula = _UNARY[word](formula)
            else:
                quantifier, operator = _QUANTIFIED[word]
                formula = quantifier(operator(formula))
        return formula

    def unit(self) -> Temporal:
        word, column = self.peek(), self.column()
        if self.quoted():
            return self.atom()
        if word == "(":
            self.take()
            self.deeper(1)
            inner = self.formula()
            self.deeper(-1)
            self.expect(")")
            return inner
        if word in _QUANTIFIERS:
            self.take()
            self.expect("[")
            self.deeper(1)
            left = self.formula(in_brackets=True)
            self.expect("U")
            right = self.formula(in_brackets=True)
            self.deeper(-1)
            self.expect("]")
            return _QUANTIFIERS[word](Until(left, right))
        if word == "fires" and self.following() == "(":
            return Fires(self.in_brackets("transition"))
        if word in _BINARY:
            raise FormulaError(f"expected a formula, found {word!r}", column)
        return self.atom()


def parse_temporal(text: str) -> Temporal:
    """Read a formula of CTL or LTL.

    Raises `FormulaError` with the column where the text stops being one; a mixture of both is one of neither.

    >>> parse_temporal("AG (EF start)")
    ForAll(path=Globally(operand=Exists(path=Eventually(operand=Start()))))
    >>> parse_temporal("G (p -> p U q)")
    Globally(operand=TemporalOr(operands=(Not(operand=Holds(place='p')), Until(left=Holds(place='p'), \
right=Holds(place='q')))))
    """
    parser = _Parser(text)
    formula = parser.formula()
    if parser.peek() is not None:
        raise FormulaError(f"unexpected {parser.peek()!r}", parser.column())
    logics(formula)
    return formula


def logics(formula: Temporal) -> frozenset[Logic]:
    """The logics that a formula belongs to: one of them, or both for a state formula.

    Raises `FormulaError` where it mixes them.
    """
    if isinstance(formula, Formula):
        return _BOTH
    found = _BOTH
    for part in operands_of(formula):
        found &= logics(part)
    match formula:
        case Exists(path) | ForAll(path):
            if not isinstance(path, Next | Eventually | Globally | Until):
                raise FormulaError("a quantifier of CTL stands before X, F, G or U", 0)
            found = _CTL.intersection(*map(logics, operands_of(path)))
        case Next() | Eventually() | Globally() | Until() | Release() | WeakUntil() | Fires():
            found &= _LTL
    if not found:
        raise FormulaError("CTL and LTL are mixed: write E or A before every X, F, G, U, or before none", 0)
    return found


def operands_of(formula: Temporal) -> tuple[Temporal, ...]:
    """The operands of a formula; none of a quantifier, whose formula is no formula by itself."""
    match formula:
        case TemporalAnd(operands) | TemporalOr(operands):
            return operands
        case TemporalNot(operand) | Next(operand) | Eventually(operand) | Globally(operand):
            return (operand,)
        case Until(left, right) | Release(left, right) | WeakUntil(left, right):
            return (left, right)
    return ()


def format_temporal(formula: Temporal) -> str:
    """Print a formula so that `parse_temporal` reads the same tree back.

    >>> format_temporal(parse_temporal("A[p and q U (EX r)] and not EG not (p or q)"))
    'A[p and q U EX r] and not EG not (p or q)'
    """
    return _format(formula, tight=False)


def _format(formula: Temporal, *, tight: bool) -> str:
    match formula:
        case TemporalNot(operand):
            return f"not {_format(operand, tight=True)}"
        case Fires(transition):
            return f"fires({transition})"
        case Next() | Eventually() | Globally():
            return f"{_UNARY_WORD[type(formula)]} {_format(formula.operand, tight=True)}"
        case Exists(path) | ForAll(path):
            word = "E" if isinstance(formula, Exists) else "A"
            if isinstance(path, Until):
                return f"{word}[{_format_in_brackets(path.left)} U {_format_in_brackets(path.right)}]"
            return f"{word}{_format(path, tight=True)}"
        case TemporalAnd(operands) | TemporalOr(operands):
            word = " and " if isinstance(formula, TemporalAnd) else " or "
            text = word.join(_format(operand, tight=True) for operand in operands)
        case Until(left, right) | Release(left, right) | WeakUntil(left, right):
            text = f"{_format(left, tight=True)} {_BINARY_WORD[type(formula)]} {_format(right, tight=True)}"
        case _:
            text = format_formula(formula, RESERVED)
            if not isinstance(formula, And | Or) or len(formula.operands) < 2:
                return text
    return f"({text})" if tight else text


def _format_in_brackets(formula: Temporal) -> str:
    return _format(formula, tight=isinstance(formula, Until | Release | WeakUntil))


_UNARY_WORD: Final = {of: word for word, of in _UNARY.items()}
_BINARY_WORD: Final[dict[type, str]] = {of: word for word, of in _BINARY.items()}
