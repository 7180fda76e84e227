"""Eq. (9)-(10): whatever fires, the owner's subnet gives a place the same token as the central net.

The transitions that fire are free variables, but for the arbiters' promise that a place has one consumer and one
producer at most. Every arbitrated firing is such a choice, so this is more than the paper asks, and needs no word about
arbiters. A part fires when its transition does; what is a part of nothing fires at will.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.analysis.induction.smt import Term, Terms
from firable.decompose.proofs.obligation import Obligation, equation
from firable.decompose.proofs.sides import Sides, holds
from firable.semantics.firing import next_token


def next_tokens(sides: Sides) -> Iterator[Obligation]:
    """Eq. (9)-(10) for each place."""
    for p in range(len(sides.net.places)):
        yield _next_token(sides, p)


def _next_token(sides: Sides, p: int) -> Obligation:
    net, place, terms = sides.net, sides.net.places[p], Terms()

    def fires(name: str) -> Term:
        return terms.variable(f"fires({name})")

    together = [
        terms.at_most_one(fires(net.transitions[t].name) for t in adjacent)
        for adjacent in (net.consumers[p], net.producers[p])
        if len(adjacent) > 1
    ]
    subnet = sides.by_name.get(place.owner or "")
    local = terms.false
    if subnet is not None and place.name in subnet.place_index:
        local = next_token(
            terms,
            subnet,
            subnet.place_index[place.name],
            holds(terms, subnet),
            lambda t: fires(sides.whole_of(subnet, t)),
        )
    return equation(
        terms,
        f"eq9-10.{place.name}",
        f"whatever fires, the next token of '{place.name}' is the same in its subnet and in the central net",
        place.name,
        next_token(terms, net, p, holds(terms, net), lambda t: fires(net.transitions[t].name)),
        local,
        assumptions=together,
        words=("next in the central net", "next in the subnet"),
    )
