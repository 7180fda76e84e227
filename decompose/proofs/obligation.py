"""What one obligation is, and the one question that all static families are asked.

An obligation compares two sides that are made from different data: one from the central net, one from the subnets and
the table. So a subnet that was edited, by hand or by a fault of the split, is refuted, and the assignment that refutes
it speaks of places, signals and transitions of the net. A part that is missing is never firable, and a place that is
missing never holds a token: so what was taken out is refuted, too.

Two kinds suffice. An *equation* is a claim about terms, evaluations of `firable.semantics.firing`, that must hold
whatever the free variables are. *Facts* are variables, each a sentence, that one side fixes and the other claims: sets
of sentences that must be equal. Facts could be compared without a solver; then what an engineer or another solver reads
would be half of the proof.

Each obligation has terms of its own: what is proved of one is not kept while the next is built, so that a cell of ten
thousand transitions takes no more memory than its text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from firable.analysis.induction.smt import Term, Terms
from firable.nets.verdict import Weight

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Obligation:
    """A claim, proved iff what is `asserted`, its negation under its assumptions, cannot be true.

    `definitions` are those of the assumptions that say only what a variable stands for, which no message shows.
    `sides` are the two terms that the claim compares, where it compares two, with their descriptions: for the message.
    `weight` is that of its verdict, and `discipline` says how transitions fire, where the claim depends on it.
    `rests_on` are the obligations, before it in its family, of which the claims are among its assumptions.
    """

    name: str
    statement: str
    subjects: tuple[str, ...]
    claim: Term
    asserted: tuple[Term, ...]
    sides: tuple[tuple[str, Term], ...] = ()
    definitions: tuple[Term, ...] = ()
    weight: Weight = Weight.REQUIRED
    discipline: str = ""
    rests_on: tuple[str, ...] = ()


def claimed(
    terms: Terms,
    name: str,
    statement: str,
    claim: Term,
    *,
    subjects: tuple[str, ...] = (),
    assumptions: Iterable[Term] = (),
    sides: tuple[tuple[str, Term], ...] = (),
    definitions: tuple[Term, ...] = (),
) -> Obligation:
    """The obligation that a claim follows from its assumptions and definitions."""
    asserted = (*definitions, *assumptions, terms.negation(claim))
    return Obligation(name, statement, subjects, claim, asserted, sides, definitions)


def equation(
    terms: Terms,
    name: str,
    statement: str,
    subject: str,
    central: Term,
    parts: Term,
    *,
    assumptions: Iterable[Term] = (),
    words: tuple[str, str] = ("in the central net", "in the subnets"),
) -> Obligation:
    """The obligation that two terms have the same value."""
    sides = ((words[0], central), (words[1], parts))
    claim = terms.equal(central, parts)
    subjects = (subject,) if subject else ()
    return claimed(terms, name, statement, claim, subjects=subjects, assumptions=assumptions, sides=sides)


def facts(
    name: str, statement: str, central: Iterable[str], made: Iterable[str], *, subjects: tuple[str, ...] = ()
) -> Obligation:
    """The obligation that the facts that the decomposition states are those of the central net, no fewer and no more.

    A fact that is stated twice is stated besides as "twice": nothing central says so.

    >>> sorted(facts("n", "they agree", ["a owns p"], ["a owns p", "a owns p"]).asserted, key=repr)
    [(not (and |a owns p| (not |twice: a owns p|))), |a owns p|, |twice: a owns p|]
    """
    terms = Terms()
    stated_list = list(made)
    wanted = dict.fromkeys(central)
    stated = dict.fromkeys([*stated_list, *(f"twice: {fact}" for fact in repeated(stated_list))])
    every = [*wanted, *(fact for fact in stated if fact not in wanted)]
    assumptions = [terms.literal(fact, fact in stated) for fact in every]
    claim = terms.conjunction(terms.literal(fact, fact in wanted) for fact in every)
    return claimed(terms, name, statement, claim, subjects=subjects, assumptions=assumptions)


def called(controller: str | None) -> str:
    """A controller in a fact; who is none is told in words that no name holds."""
    return "no controller" if controller is None else controller


def repeated(items: Iterable[Item]) -> list[Item]:
    """What stands more than once among the items, in their order."""
    return [item for item, n in Counter(items).items() if n > 1]
