"""State formulas over the markings of a net, and the text they are written in.

A property of a net file speaks about markings: `never: robot.put_mc and mc.machining`. The formulas
are Boolean combinations of five kinds of atoms: a place holds a token, a transition is firable
(Eq. 1, with its external gates free), the marking is a deadlock, the marking is the initial one, so many
of some places hold a token. They are a syntax tree only. `firable.semantics.formulas` evaluates them, over
any Boolean algebra.

The grammar, loosest binding first (`->` groups to the right)::

    formula = disjunction [ "->" formula ]
    disjunction = conjunction { "or" conjunction }
    conjunction = literal { "and" literal }
    literal = "not" literal | "(" formula ")" | atom
    atom = "true" | "false" | "start" | "deadlock" | "firable" "(" name ")" | count sign count | place name
    count = number | "tokens" "(" place name { "," place name } ")" [ "+" number ]
    sign = "<=" | "<" | "=" | "!=" | ">=" | ">"

A name in double quotes is a name, also where the word means something else. A name may hold nearly every
character, `<` too, so a number that begins a comparison stands before a blank, or before `tokens`.

Temporal operators are not part of formulas: most properties are one temporal pattern over state formulas, so
that each has a method of its own and a counterexample that an engineer can read. `firable.nets.temporal` has the
operators of CTL and LTL, for what the patterns cannot say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from firable.nets.formula_tokens import tokens_of


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


class Sign(StrEnum):
    """How two numbers are compared."""

    AT_MOST = "<="
    LESS = "<"
    EQUAL = "="
    UNEQUAL = "!="
    AT_LEAST = ">="
    MORE = ">"


@dataclass(frozen=True, slots=True)
class Count:
    """How many of the places hold a token, and a number added; a place that stands twice counts twice."""

    places: tuple[str, ...] = ()
    added: int = 0


@dataclass(frozen=True, slots=True)
class Compare:
    """Two counts of tokens, or a count and a number, compared."""

    left: Count
    sign: Sign
    right: Count


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


Formula = Constant | Holds | Firable | Start | Deadlock | Compare | Not | And | Or


class FormulaError(ValueError):
    """The text is not a formula; `column` (from 0) is where it stops being one."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.message = message
        self.column = column


_KEYWORDS: Final = frozenset({"and", "or", "not"})
_SYMBOLS: Final = frozenset({"->", "(", ")", "[", "]", ","})
_NUMBER: Final = re.compile(r"[0-9]{1,9}")
NESTING_MAX: Final = 100

CONSTANT_ATOMS: Final = frozenset({"true", "false", "start", "deadlock"})
"""Words that are atoms by themselves, so a place of that name is named in quotes."""


class FormulaParser:
    """Recursive descent over the grammar of the module's docstring, which others extend; `atom` is where it ends."""

    def __init__(self, text: str) -> None:
        self.tokens = list(tokens_of(text))
        # The words alone, and what stands for the end: they are looked at several times each.
        self.words: list[str | None] = [*(token.text for token in self.tokens), None]
        self.position = 0
        self.end = len(text)
        self.depth = 0

    def peek(self) -> str | None:
        """The next token, or None at the end."""
        return self.words[self.position]

    def column(self) -> int:
        """Where the next token stands."""
        return self.tokens[self.position].column if self.position < len(self.tokens) else self.end

    def quoted(self) -> bool:
        """Whether a name in quotes stands here."""
        return self.position < len(self.tokens) and self.tokens[self.position].quoted

    def following(self) -> str:
        """What stands after the next token."""
        return self.tokens[self.position + 1].text if self.position + 1 < len(self.tokens) else ""

    def take(self) -> str:
        """Go past the next token, and give it."""
        token = self.peek()
        if token is None:
            raise FormulaError("the formula ends too early", self.end)
        self.position += 1
        return token

    def expect(self, wanted: str) -> None:
        """Go past the next token, which must be this one."""
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
        """A formula."""
        left = self.disjunction()
        if self.peek() == "->":
            self.take()
            self.deeper(1)
            right = self.implication()
            self.deeper(-1)
            return Or((Not(left), right))
        return left

    def disjunction(self) -> Formula:
        """What `->` joins."""
        operands = [self.conjunction()]
        while self.peek() == "or":
            self.take()
            operands.append(self.conjunction())
        return operands[0] if len(operands) == 1 else Or(tuple(operands))

    def conjunction(self) -> Formula:
        """What `or` joins."""
        operands = [self.literal()]
        while self.peek() == "and":
            self.take()
            operands.append(self.literal())
        return operands[0] if len(operands) == 1 else And(tuple(operands))

    def literal(self) -> Formula:
        """What `and` joins."""
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

    def name(self, of: str) -> str:
        """The name that stands here, in quotes or not."""
        column = self.column()
        quoted = self.quoted()
        name = self.take()
        if not quoted and (name in _SYMBOLS or name in _KEYWORDS):
            raise FormulaError(f"expected the name of a {of}, found {name!r}", column)
        return name

    def atom(self) -> Formula:
        """What `not` stands before."""
        if self.quoted():
            return Holds(self.take())
        following = self.following()
        match self.peek():
            case "(":
                self.take()
                self.deeper(1)
                inner = self.implication()
                self.deeper(-1)
                self.expect(")")
                return inner
            case "true" | "false" as word:
                self.take()
                return Constant(word == "true")
            case "start":
                self.take()
                return Start()
            case "deadlock":
                self.take()
                return Deadlock()
            case "firable" if following == "(":
                return Firable(self.in_brackets("transition"))
            case "tokens" if following == "(":
                return self.comparison()
            case str(number) if number.isdecimal() and following in {*Sign}:
                return self.comparison()
        return Holds(self.name("place"))

    def in_brackets(self, of: str) -> str:
        """The name in `word(name)`."""
        self.take()
        self.expect("(")
        name = self.name(of)
        self.expect(")")
        return name

    def comparison(self) -> Formula:
        """Two counts and the sign between them."""
        left, column = self.counted(), self.column()
        sign = self.take()
        if sign not in {*Sign}:
            raise FormulaError(f"expected one of {' '.join(Sign)}, found {sign!r}", column)
        return Compare(left, Sign(sign), self.counted())

    def counted(self) -> Count:
        """A side of a comparison."""
        if self.peek() != "tokens":
            return Count(added=self.number())
        self.take()
        self.expect("(")
        places = [self.name("place")]
        while self.peek() == ",":
            self.take()
            places.append(self.name("place"))
        self.expect(")")
        if self.peek() != "+":
            return Count(tuple(places))
        self.take()
        return Count(tuple(places), self.number())

    def number(self) -> int:
        """A number, not too large to be meant."""
        column = self.column()
        token = self.take()
        if not _NUMBER.fullmatch(token):
            raise FormulaError(f"expected a number of at most 9 digits or `tokens(...)`, found {token!r}", column)
        return int(token)


def parse_formula(text: str) -> Formula:
    """Read a state formula.

    Raises `FormulaError` with the column where the text stops being a formula.

    >>> parse_formula("robot.put_mc and not mc.machining")
    And(operands=(Holds(place='robot.put_mc'), Not(operand=Holds(place='mc.machining'))))
    >>> parse_formula("a and")
    Traceback (most recent call last):
    firable.nets.formula.FormulaError: the formula ends too early
    """
    parser = FormulaParser(text)
    formula = parser.implication()
    if parser.peek() is not None:
        raise FormulaError(f"unexpected {parser.peek()!r}", parser.column())
    return formula


_LOOSE, _TIGHT = 0, 1


def format_formula(formula: Formula, reserved: Set[str] = CONSTANT_ATOMS) -> str:
    """Print a formula so that `parse_formula` reads the same tree back; names among `reserved` stand in quotes.

    >>> format_formula(parse_formula("(a or b) and firable(t) and tokens(a, b)<=1"))
    '(a or b) and firable(t) and tokens(a, b) <= 1'
    """
    return _format(formula, _LOOSE, reserved)


def _format(formula: Formula, binding: int, reserved: Set[str]) -> str:
    match formula:
        case Constant(value):
            return "true" if value else "false"
        case Holds(place):
            return format_name(place, reserved)
        case Firable(transition):
            return f"firable({transition})"
        case Start():
            return "start"
        case Deadlock():
            return "deadlock"
        case Compare(left, sign, right):
            return f"{format_count(left)} {sign} {format_count(right)}"
        case Not(operand):
            return f"not {_format(operand, _TIGHT, reserved)}"
        case And(operands) | Or(operands):
            if not operands:
                return "true" if isinstance(formula, And) else "false"
            word = " and " if isinstance(formula, And) else " or "
            text = word.join(_format(operand, _TIGHT, reserved) for operand in operands)
            return f"({text})" if binding == _TIGHT and len(operands) > 1 else text


def format_name(name: str, reserved: Set[str]) -> str:
    """The name of a place, in quotes where it would be read as something else."""
    return f'"{name}"' if name in reserved else name


def format_count(count: Count) -> str:
    """A side of a comparison.

    >>> format_count(Count(("a", "b"), 1))
    'tokens(a, b) + 1'
    """
    if not count.places:
        return str(count.added)
    return f"tokens({', '.join(count.places)}){f' + {count.added}' if count.added else ''}"


def conjuncts(formula: Formula) -> Iterator[Formula]:
    """The formulas that a formula is the conjunction of, negations pushed inwards as far as there is one.

    >>> [format_formula(one) for one in conjuncts(Not(parse_formula("deadlock -> a and b")))]
    ['deadlock', 'not (a and b)']
    """
    match formula:
        case And(operands):
            for operand in operands:
                yield from conjuncts(operand)
        case Not(Or(operands)):
            for operand in operands:
                yield from conjuncts(Not(operand))
        case Not(Not(operand)):
            yield from conjuncts(operand)
        case _:
            yield formula


def leaves_in(formula: Formula) -> Iterator[Formula]:
    """The atoms, comparisons and constants of the formula, left to right."""
    match formula:
        case Not(operand):
            yield from leaves_in(operand)
        case And(operands) | Or(operands):
            for operand in operands:
                yield from leaves_in(operand)
        case _:
            yield formula


def names_in(formula: Formula) -> Iterator[Holds | Firable]:
    """The atoms of the formula that name a place or a transition, left to right."""
    for leaf in leaves_in(formula):
        match leaf:
            case Holds() | Firable():
                yield leaf
            case Compare(left, _, right):
                yield from map(Holds, (*left.places, *right.places))
