"""That every siphon contains a trap that is marked in M0: one obligation, by traps that are given or by ranks.

A *siphon* is a set of places such that who puts a token into it takes one from it; a *trap* one such that who takes a
token from it puts one into it. The obligation asserts a siphon, not empty, that contains no marked trap:

    by traps   it lacks a place of each of the given traps
    by ranks   what is taken out of it, to leave the largest trap within it, is all that is marked of it

The largest trap in a set comes about by taking away, one after the other, a place with a consumer that puts nothing
into what is left then. So who asserts this gives each place that is taken away a number, below which are those that its
consumer puts tokens into. Numbers below the number of places are enough, since places are taken away one by one; they
are written in binary, and compared as such, so that the obligation is one in propositional logic like all others. Few
traps make a much smaller question; where it takes hundreds, the numbers are the smaller one.

Rejected: more traps. There may be exponentially many, where sections of a process run side by side.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from firable.analysis.evidence.certificate import Theorem, TheoremName
from firable.analysis.evidence.checking.obligation import Obligation
from firable.analysis.induction.smt import Term, Terms
from firable.nets.net import Net, Transition


def of_siphons(net: Net, theorem: Theorem, terms: Terms) -> tuple[Obligation, ...]:
    """The obligation of a theorem whose premise this is; none of one about marked graphs."""
    if theorem.name is TheoremName.MARKED_GRAPH:
        return ()
    if theorem.traps:
        without = [terms.disjunction(terms.negation(terms.variable(name)) for name in trap) for trap in theorem.traps]
        asserted, words = (*_siphon(net, terms), *without), "one of the marked traps"
    else:
        asserted, words = (*_siphon(net, terms), *_emptied(net, terms)), "a marked trap"
    return (Obligation("siphons", f"every siphon contains {words}", asserted),)


def _taken(t: Transition) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*t.inputs, *t.permissive)))


def _put(t: Transition) -> tuple[str, ...]:
    """What is read is put back, unless it is taken."""
    return tuple(dict.fromkeys((*t.outputs, *(name for name in t.permissive if name not in t.inputs))))


def _siphon(net: Net, terms: Terms) -> Iterator[Term]:
    """The places of which the variable is true are a siphon, and not empty."""
    joined = dict.fromkeys(name for t in net.transitions for name in (*_taken(t), *_put(t)))
    yield terms.disjunction(map(terms.variable, joined))
    for t in net.transitions:
        taken = terms.disjunction(map(terms.variable, _taken(t)))
        yield from (terms.implies(terms.variable(name), taken) for name in _put(t))


def _emptied(net: Net, terms: Terms) -> Iterator[Term]:
    """Every marked place of the siphon is taken away, each after what one of its consumers puts tokens into.

    A place that is taken away has `@` behind its name, a digit of its number `@` and which: no name of a net has these.
    """
    consumers: dict[str, list[Transition]] = {}
    for t in net.transitions:
        for name in _taken(t):
            consumers.setdefault(name, []).append(t)
    for place in net.places:
        name, ways = place.name, list[Term]()
        if place.marked:
            yield terms.implies(terms.variable(name), _away(terms, name))
        for t in consumers.get(name, ()):
            gone = (_gone(terms, net, q, name) for q in _put(t))
            ways.append(terms.conjunction(gone))
        yield terms.implies(_away(terms, name), terms.disjunction(ways))


def _away(terms: Terms, name: str) -> Term:
    return terms.variable(f"{name}@")


def _gone(terms: Terms, net: Net, name: str, before: str) -> Term:
    """A place is not in the siphon, or it is taken away, and before another one is: never so of itself within it."""
    digits = range((len(net.places) - 1).bit_length())
    numbers = ([terms.variable(f"{one}@{k}") for k in digits] for one in (name, before))
    earlier = terms.conjunction([_away(terms, name), _less(terms, *numbers)])
    return terms.disjunction([terms.negation(terms.variable(name)), earlier])


def _less(terms: Terms, one: Iterable[Term], other: Iterable[Term]) -> Term:
    """Whether a number in binary is less than another, the digit of least weight first."""
    less = terms.false
    for a, b in zip(one, other, strict=True):
        below = terms.conjunction([terms.negation(a), b])
        less = terms.disjunction([below, terms.conjunction([terms.equal(a, b), less])])
    return less
