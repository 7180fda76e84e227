"""State formulas over the markings of a net, and the text they are written in.

A property of a net file speaks about markings: `never: robot.put_mc and mc.machining`. The formulas
are Boolean combinations of four kinds of atoms: a place holds a token, a transition is firable
(Eq. 1, with its external gates free), the marking is a deadlock, the marking is the initial one. They
are a syntax tree only. `firable.semantics.formulas` evaluates them, over any Boolean algebra.

The grammar, loosest binding first (`->` groups to the right)::

    formula = disjunction [ "->" formula ]
    disjunction = conjunction { "or" conjunction }
    conjunction = literal { "and" literal }
    literal = "not" literal | "(" formula ")" | atom
    atom = "true" | "false" | "start" | "deadlock" | "firable" "(" name ")" | place name

Temporal operators are not part of formulas: a property is one temporal pattern over state formulas, so
that each has a method of its own and a counterexample that an engineer can read. The rejected alternative,
full CTL in the net file, reads badly and answers questions nobody at the cell asks.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Constant:
    """`true` or `false`."""

    value: bool


@dataclass(frozen=True, slots=True)
class Holds:
    """The place `place` holds a token."""

    place: str


@dataclass(frozen=True, slots=True)
class Firable:
    """The transition `transition` is firable (Eq. 1) and some valuation opens its external gates."""

    transition: str


@dataclass(frozen=True, slots=True)
class Start:
    """The marking is the initial marking M0."""


@dataclass(frozen=True, slots=True)
class Deadlock:
    """No transition is firable and openable in the marking."""


@dataclass(frozen=True, slots=True)
class Not:
    """Negation."""

    operand: Formula


@dataclass(frozen=True, slots=True)
class And:
    """Conjunction; the empty one is true."""

    operands: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Disjunction; the empty one is false."""

    operands: tuple[Formula, ...]


Formula = Constant | Holds | Firable | Start | Deadlock | Not | And | Or


class FormulaError(ValueError):
    """The text is not a formula; `column` (from 0) is where it stops being one."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.message = message
        self.column = column


_TOKEN: Final = re.compile(r"\s*(?:(?P<symbol>->|[()])|(?P<name>[^\s()]+?(?=\s|[()]|->|$)))")
_KEYWORDS: Final = frozenset({"and", "or", "not"})
NESTING_MAX: Final = 100

CONSTANT_ATOMS: Final = frozenset({"true", "false", "start", "deadlock"})
"""Words that are atoms by themselves, so a place of that name cannot be named in a formula."""


@dataclass(frozen=True, slots=True)
class _Token:
    text: str
    column: int


def _tokens(text: str) -> list[_Token]:
    # Nothing is passed over but blanks: every other character is a symbol or part of a name.
    words = ((match["symbol"] or match["name"], match.end()) for match in _TOKEN.finditer(text))
    return [_Token(word, end - len(word)) for word, end in words]


class _Parser:
    """Recursive descent over the grammar of the module's docstring."""

    def __init__(self, text: str) -> None:
        self.tokens = _tokens(text)
        self.position = 0
        self.end = len(text)
        self.depth = 0

    def peek(self) -> str | None:
        return self.tokens[self.position].text if self.position < len(self.tokens) else None

    def column(self) -> int:
        return self.tokens[self.position].column if self.position < len(self.tokens) else self.end

    def take(self) -> str:
        token = self.peek()
        if token is None:
            raise FormulaError("the formula ends too early", self.end)
        self.position += 1
        return token

    def expect(self, wanted: str) -> None:
        column = self.column()
        found = self.peek()
        if found != wanted:
            raise FormulaError(f"expected {wanted!r}, found {'the end' if found is None else repr(found)}", column)
        self.position += 1

    def deeper(self, levels: int) -> None:
        """Count nesting: what walks over a formula calls itself for each level, so levels are bounded here."""
        self.depth += levels
        if self.depth > NESTING_MAX:
            raise FormulaError(f"nests too deeply, more than {NESTING_MAX} levels", self.column())

    def implication(self) -> Formula:
        left = self.disjunction()
        if self.peek() == "->":
            self.take()
            self.deeper(1)
            right = self.implication()
            self.deeper(-1)
            return Or((Not(left), right))
        return left

    def disjunction(self) -> Formula:
        operands = [self.conjunction()]
        while self.peek() == "or":
            self.take()
            operands.append(self.conjunction())
        return operands[0] if len(operands) == 1 else Or(tuple(operands))

    def conjunction(self) -> Formula:
        operands = [self.literal()]
        while self.peek() == "and":
            self.take()
            operands.append(self.literal())
        return operands[0] if len(operands) == 1 else And(tuple(operands))

    def literal(self) -> Formula:
        # `not not not ...` is a loop, so that only parentheses nest.
        negations = 0
        while self.peek() == "not":
            self.take()
            self.deeper(1)
            negations += 1
        formula = self.atom()
        self.deeper(-negations)
        for _ in range(negations):
            formula = Not(formula)
        return formula

    def atom(self) -> Formula:
        column = self.column()
        token = self.take()
        match token:
            case "(":
                self.deeper(1)
                inner = self.implication()
                self.deeper(-1)
                self.expect(")")
                return inner
            case "true" | "false":
                return Constant(token == "true")
            case "start":
                return Start()
            case "deadlock":
                return Deadlock()
            case "firable" if self.peek() == "(":
                self.take()
                name_column = self.column()
                name = self.take()
                if name in {"(", ")", "->"} or name in _KEYWORDS:
                    raise FormulaError(f"expected the name of a transition, found {name!r}", name_column)
                self.expect(")")
                return Firable(name)
            case ")" | "->" | "and" | "or":
                raise FormulaError(f"expected a place, found {token!r}", column)
            case _:
                return Holds(token)


def parse_formula(text: str) -> Formula:
    """Read a state formula.

    Raises `FormulaError` with the column where the text stops being a formula.

    >>> parse_formula("robot.put_mc and not mc.machining")
    And(operands=(Holds(place='robot.put_mc'), Not(operand=Holds(place='mc.machining'))))
    >>> parse_formula("a and")
    Traceback (most recent call last):
    firable.nets.formula.FormulaError: the formula ends too early
    """
    parser = _Parser(text)
    formula = parser.implication()
    if parser.peek() is not None:
        raise FormulaError(f"unexpected {parser.peek()!r}", parser.column())
    return formula


_LOOSE, _TIGHT = 0, 1


def format_formula(formula: Formula, _binding: int = _LOOSE) -> str:
    """Print a formula so that `parse_formula` reads the same tree back.

    >>> format_formula(parse_formula("(a or b) and firable(t)"))
    '(a or b) and firable(t)'
    """
    match formula:
        case Constant(value):
            return "true" if value else "false"
        case Holds(place):
            return place
        case Firable(transition):
            return f"firable({transition})"
        case Start():
            return "start"
        case Deadlock():
            return "deadlock"
        case Not(operand):
            return f"not {format_formula(operand, _TIGHT)}"
        case And(operands) | Or(operands):
            if not operands:
                return "true" if isinstance(formula, And) else "false"
            word = " and " if isinstance(formula, And) else " or "
            text = word.join(format_formula(operand, _TIGHT) for operand in operands)
            return f"({text})" if _binding == _TIGHT and len(operands) > 1 else text


def names_in(formula: Formula) -> Iterator[Holds | Firable]:
    """The atoms of the formula that name a place or a transition, left to right."""
    match formula:
        case Holds() | Firable():
            yield formula
        case Not(operand):
            yield from names_in(operand)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from names_in(operand)
        case Constant() | Start() | Deadlock():
            return
