"""Boolean formulas in a normal form, so that two texts that state the same are the same number.

A formula is a number of a `Formulas`: equal formulas have equal numbers. The normal form forgets by which definitions a
text was shortened, and nothing else: what is written is what was made. Making a formula leaves out operands that change
nothing or stand there already, a connective of a single operand, and double negation, as docs/bundle.md has it. It goes
no further. In particular an equation is never decided, not even one of equal sides: every claim that is proved is
worth `true`, and it is not the worth but the sentence that has to be the right one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Final

Formula = int

TRUE: Final[Formula] = 0
FALSE: Final[Formula] = 1

_BY_NUMBER: Final = re.compile(r"[^ -~]|[|\\%]")
_RESERVED: Final = frozenset({"true", "false", "not", "and", "or", "xor", "distinct", "ite", "as", "_", "="})
"""What nobody may declare, even between bars; nor what begins with a point."""


@lru_cache(2**16)
def spelled(name: str) -> str:
    """A name as a file spells it: what is not printable ASCII, a bar, a backslash or `%` by its number.

    So is the first character of what SMT-LIB reserves.

    >>> spelled("robot.free"), spelled("é"), spelled("50%"), spelled("|"), spelled(chr(92)), spelled(".p")
    ('robot.free', '%e9.', '50%25.', '%7c.', '%5c.', '%2e.p')
    """
    text = _BY_NUMBER.sub(lambda found: f"%{ord(found[0]):x}.", name)
    return f"%{ord(text[0]):x}.{text[1:]}" if text in _RESERVED or text.startswith(".") else text


class Formulas:
    """The formulas that were made, each with one number.

    >>> of = Formulas()
    >>> p, q = of.variable("p"), of.variable("q")
    >>> of.all_of([p, q, p]) == of.all_of([p, q]), of.negation(of.negation(p)) == p, of.any_of([]) == FALSE
    (True, True, True)
    >>> of.all_of([p, q]) == of.all_of([q, p])
    False
    >>> of.equal(p, p) == TRUE
    False
    """

    def __init__(self) -> None:
        self._numbers: dict[tuple[object, ...], Formula] = {("true",): TRUE, ("false",): FALSE}
        self._negated: dict[Formula, Formula] = {TRUE: FALSE, FALSE: TRUE}
        self._negations: set[Formula] = set()
        self._variables: set[Formula] = set()

    def _number(self, key: tuple[object, ...]) -> Formula:
        return self._numbers.setdefault(key, len(self._numbers))

    def variable(self, name: str) -> Formula:
        """The variable of a name of the net, or of a sentence of such names."""
        return self.symbol(spelled(name))

    def symbol(self, text: str) -> Formula:
        """The variable that a file spells so."""
        made = self._number(("variable", text))
        self._variables.add(made)
        return made

    def is_variable(self, formula: Formula) -> bool:
        """Whether a formula is a variable."""
        return formula in self._variables

    def negation(self, operand: Formula) -> Formula:
        """The NOT of a formula."""
        if (known := self._negated.get(operand)) is not None:
            return known
        made = self._number(("not", operand))
        self._negated[operand], self._negated[made] = made, operand
        self._negations.add(made)
        return made

    def is_negation(self, formula: Formula) -> bool:
        """Whether a formula is the NOT of another one."""
        return formula in self._negations

    def literal(self, name: str, value: bool) -> Formula:
        """The variable of this name, or its negation."""
        return self.variable(name) if value else self.negation(self.variable(name))

    def all_of(self, operands: Iterable[Formula]) -> Formula:
        """The AND of some formulas; `true` of none."""
        return self._connective("and", operands, neutral=TRUE, dominant=FALSE)

    def any_of(self, operands: Iterable[Formula]) -> Formula:
        """The OR of some formulas; `false` of none."""
        return self._connective("or", operands, neutral=FALSE, dominant=TRUE)

    def _connective(self, word: str, operands: Iterable[Formula], *, neutral: Formula, dominant: Formula) -> Formula:
        kept = tuple(operand for operand in dict.fromkeys(operands) if operand != neutral)
        if dominant in kept:
            return dominant
        if len(kept) < 2:
            return kept[0] if kept else neutral
        return self._number((word, kept))

    def equal(self, left: Formula, right: Formula) -> Formula:
        """The equation of two formulas."""
        return self._number(("=", left, right))


class AtMostOne:
    """At most one of some formulas: neighbours are joined to "one of us" and "not two of us", until one is left.

    >>> of = Formulas()
    >>> p, q, r = map(of.variable, "pqr")
    >>> once = AtMostOne(of, [p, q, r])
    >>> once.when({1: TRUE}) == of.all_of([of.negation(p), of.negation(r)])
    True
    """

    def __init__(self, of: Formulas, operands: Iterable[Formula]) -> None:
        self.of = of
        self.rows: list[list[tuple[Formula, Formula]]] = [[(operand, TRUE) for operand in operands]]
        while len(self.rows[-1]) > 1:
            row = self.rows[-1]
            self.rows.append([self._join(row, {}, i) for i in range(0, len(row), 2)])

    def formula(self) -> Formula:
        """That at most one of them holds."""
        return self.rows[-1][0][1] if self.rows[0] else TRUE

    def when(self, others: dict[int, Formula]) -> Formula:
        """The same where some of them, by their positions, are others."""
        changed = {i: (other, TRUE) for i, other in others.items()}
        for row in self.rows[:-1]:
            changed = {i // 2: self._join(row, changed, i - i % 2) for i in changed}
        return changed[0][1] if changed else self.formula()

    def _join(
        self, row: list[tuple[Formula, Formula]], changed: dict[int, tuple[Formula, Formula]], i: int
    ) -> tuple[Formula, Formula]:
        one, one_once = changed.get(i, row[i])
        if i + 1 == len(row):
            return one, one_once
        other, other_once = changed.get(i + 1, row[i + 1])
        not_both = self.of.negation(self.of.all_of([one, other]))
        return self.of.any_of([one, other]), self.of.all_of([one_once, other_once, not_both])
