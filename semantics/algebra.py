"""Boolean algebras: what the firing rule is evaluated in.

Eq. (1)-(4) are Boolean terms. Written over an algebra that is a parameter, one text of them plays tokens (Python bool),
evaluates 64 markings at once (machine words) or a column for every reachable marking (numpy), and builds the terms that
z3 decides and SMT-LIB files state. The alternative, one copy of the rule for each use, is how tools come to prove
something other than what they execute.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from operator import and_, not_, or_, xor
from typing import Final, Generic, Protocol, TypeVar

B = TypeVar("B")


class BooleanAlgebra(Protocol[B]):
    """Conjunction, disjunction and negation over values of type `B`; the empty conjunction is true."""

    def conjunction(self, operands: Iterable[B], /) -> B:
        """The AND of the operands."""
        ...

    def disjunction(self, operands: Iterable[B], /) -> B:
        """The OR of the operands."""
        ...

    def negation(self, operand: B, /) -> B:
        """The NOT of the operand."""
        ...


@dataclass(frozen=True, slots=True)
class Bitwise(Generic[B]):
    """The algebra of any type with the operators `&`, `|` and `^`, given its true and its false.

    >>> words = Bitwise(true=0b1111, false=0)  # four markings side by side
    >>> bin(words.conjunction([0b1100, words.negation(0b0101)]))
    '0b1000'
    """

    true: B
    false: B

    def conjunction(self, operands: Iterable[B], /) -> B:
        """The AND of the operands."""
        return reduce(and_, operands, self.true)

    def disjunction(self, operands: Iterable[B], /) -> B:
        """The OR of the operands."""
        return reduce(or_, operands, self.false)

    def negation(self, operand: B, /) -> B:
        """The NOT of the operand, as an exclusive or with true."""
        result: B = xor(operand, self.true)
        return result


class Booleans:
    """The algebra of Python's own Booleans, which looks no further once the value is known, and counts by itself."""

    conjunction = staticmethod(all)
    disjunction = staticmethod(any)
    negation = staticmethod(not_)

    @staticmethod
    def at_most(terms: Iterable[tuple[bool, int]], bound: int, /) -> bool:
        """Whether the weights of the terms that are true sum up to at most the bound."""
        return sum(weight for term, weight in terms if term) <= bound


BOOL: Final = Booleans()
"""Python's own Booleans."""
