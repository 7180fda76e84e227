"""LTL: does every maximal run from M0 satisfy the formula?

A run that does not is one that satisfies the negation, so the automaton of the negation is made, and the formula fails
iff from M0 and its first state a run can be accepted (Vardi and Wolper 1986, "An automata-theoretic approach to
automatic program verification"). A run that ends in a deadlock stutters there for ever: the last marking is repeated,
and no transition fires. With this convention, that of the model checking contest, `X` is true of the last marking where
its operand is, and every law of LTL over infinite words holds.

Before the automaton is made, each state formula is evaluated, and replaced where it holds everywhere or nowhere.
"""

from __future__ import annotations

from typing import TypeVar

from firable.analysis.temporal.automaton import automaton_of
from firable.analysis.temporal.product import Pairs, Product
from firable.analysis.temporal.rewriting import positive, replaced
from firable.analysis.temporal.sets import Sets
from firable.nets.temporal import Temporal, negated

S = TypeVar("S")


def refuting(sets: Sets[S], formula: Temporal) -> tuple[Product[S], Pairs[S], Pairs[S]] | None:
    """The product with the automaton of the negation, where runs are accepted, and what leads there.

    None where M0 does not lead there: the formula holds.

    Raises `IncompleteGraph` where the space is not whole, `TooLargeError` and `TimeEndedError` where a limit is met.
    """
    sets.space.require_complete()
    refuting_one = replaced(positive(negated(formula)), sets.constant)
    automaton = automaton_of(refuting_one, deadline=sets.space.moment)
    product = Product.of(sets, automaton)
    fair = product.fair()
    if not fair:
        return None
    leading = product.reaching(fair)
    return (product, fair, leading) if sets.space.contains(leading[0], sets.space.net.initial_marking) else None
