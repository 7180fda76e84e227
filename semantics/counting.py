"""Comparing counts of tokens, over any Boolean algebra.

A comparison is brought to the form "the weights of those of these terms that are true sum up to at most a bound", with
positive weights: a place on both sides cancels, and one on the right counts where it is empty. That is a monotone
threshold function, whose table by place and remaining bound is filled from the last place to the first (Eén and
Sörensson 2006, "Translating pseudo-Boolean constraints into SAT": decision diagrams). An entry whose remaining bound
is negative, or as large as what can still come, is a constant, so the table has at most places times
min(bound, places - bound) entries, and a decision diagram made from it is one of that size.

An algebra that can count by itself, such as Python's Booleans and the columns of a state space, says so by a method
`at_most` of the same terms and bound. Rejected: the comparison written out as a state formula, which has no sharing and
grows as a binomial coefficient.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from firable.nets.formula import Compare, Sign
from firable.nets.net import Net
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.firing import Valuation

B = TypeVar("B")


def compared(algebra: BooleanAlgebra[B], net: Net, comparison: Compare, holds: Valuation[B]) -> B:
    """The value of a comparison in the marking that `holds` reads.

    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.net import Net, Place
    >>> from firable.semantics.algebra import BOOL
    >>> net = Net("n", tuple(map(Place, "abc")))
    >>> term = parse_formula("tokens(a, b, c) <= 2")
    >>> compared(BOOL, net, term, lambda p: True), compared(BOOL, net, term, lambda p: p != 1)
    (False, True)
    """
    left, right = comparison.left, comparison.right
    match comparison.sign:
        case Sign.AT_LEAST | Sign.MORE:
            left, right = right, left
    weights: dict[int, int] = {}
    for side, sign in ((left, 1), (right, -1)):
        for name in side.places:
            place = net.place_index[name]
            weights[place] = weights.get(place, 0) + sign
    bound = right.added - left.added
    terms: list[tuple[B, int]] = []
    for place, weight in weights.items():
        if weight > 0:
            terms.append((holds(place), weight))
        elif weight < 0:
            terms.append((algebra.negation(holds(place)), -weight))
            bound -= weight
    match comparison.sign:
        case Sign.AT_MOST | Sign.AT_LEAST:
            return at_most(algebra, terms, bound)
        case Sign.LESS | Sign.MORE:
            return at_most(algebra, terms, bound - 1)
    differ = algebra.disjunction([at_most(algebra, terms, bound - 1), algebra.negation(at_most(algebra, terms, bound))])
    return differ if comparison.sign is Sign.UNEQUAL else algebra.negation(differ)


class TableTooLargeError(Exception):
    """The table of a comparison would have more entries than are allowed."""


def at_most(
    algebra: BooleanAlgebra[B], terms: Sequence[tuple[B, int]], bound: int, entries_max: int | None = None
) -> B:
    """Where the (positive) weights of the terms that are true sum up to at most the bound.

    Weights that are no counts may make a table that doubles with each term: raises `TableTooLargeError` where it would
    have more than `entries_max` entries.
    """
    total = sum(weight for _, weight in terms)
    if bound < 0:
        return algebra.disjunction([])
    if bound >= total:
        return algebra.conjunction([])
    counting = getattr(algebra, "at_most", None)  # to look for a protocol takes longer than to count
    if counting is not None:
        counted: B = counting(terms, bound)
        return counted
    # Which remaining bounds are met before each term, first to last; then their values, last to first.
    met: list[set[int]] = [{bound}]
    left, entries = total, 0
    for _, weight in terms:
        left -= weight
        entries += len(met[-1])
        if entries_max is not None and entries > entries_max:
            raise TableTooLargeError
        after = met[-1] | {remaining - weight for remaining in met[-1]}
        met.append({remaining for remaining in after if 0 <= remaining < left})
    values: dict[int, B] = {}

    def value(remaining: int, most: int) -> B:
        if remaining < 0:
            return algebra.disjunction([])
        return algebra.conjunction([]) if remaining >= most else values[remaining]

    for (term, weight), remainders in zip(reversed(terms), reversed(met[:-1]), strict=True):
        empty = algebra.negation(term)
        # What holds with less remaining holds with more, so the term itself need not be asked in the first case.
        values = {
            remaining: algebra.disjunction(
                [value(remaining - weight, left), algebra.conjunction([empty, value(remaining, left)])]
            )
            for remaining in remainders
        }
        left += weight
    return values[bound]
