"""Eq. (7): a transition is firable in the central net iff all its parts are firable in their subnets.

Either side is Eq. (1), evaluated over the same places: once by the transition's own arcs and gates, once by those of
its parts. With every place owned once they are the same conjunction in another order, and the proof is that they are:
an arc, gate or part too many or too few differs in some marking, but for one that only repeats another (a permissive
gate on an input place), which is the business of O3.

This is an identity at one instant. That votes taken at different instants add up to it is what the protocol proves.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.analysis.induction.smt import Terms
from firable.decompose.proofs.obligation import Obligation, equation
from firable.decompose.proofs.sides import Sides, holds
from firable.semantics.firing import firable


def firability(sides: Sides) -> Iterator[Obligation]:
    """Eq. (7) for each transition."""
    return (_of(sides, t) for t in range(len(sides.net.transitions)))


def _of(sides: Sides, t: int) -> Obligation:
    terms, name = Terms(), sides.net.transitions[t].name
    return equation(
        terms,
        f"eq7.{name}",
        f"'{name}' is firable in the central net iff each of its parts is firable in its subnet",
        name,
        firable(terms, sides.net, t, holds(terms, sides.net)),
        sides.of_parts(terms, name, lambda subnet, part: firable(terms, subnet, part, holds(terms, subnet))),
    )
