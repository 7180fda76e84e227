"""Eq. (8): the external gates of a transition are open iff those of all its parts are.

Like Eq. (7), of Eq. (2): an identity of one valuation. A gate that its owner saw open may be closed when the transition
fires; which gates must not be is assumption O4 (`firable.decompose.proofs.assumptions`).
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.analysis.induction.smt import Terms
from firable.decompose.proofs.obligation import Obligation, equation
from firable.decompose.proofs.sides import Sides, signals
from firable.semantics.firing import external_gates


def openness(sides: Sides) -> Iterator[Obligation]:
    """Eq. (8) for each transition."""
    return (_of(sides, t) for t in range(len(sides.net.transitions)))


def _of(sides: Sides, t: int) -> Obligation:
    terms, name = Terms(), sides.net.transitions[t].name
    return equation(
        terms,
        f"eq8.{name}",
        f"the external gates of '{name}' are open iff those of each of its parts are open",
        name,
        external_gates(terms, sides.net, t, signals(terms, sides.net)),
        sides.of_parts(terms, name, lambda subnet, part: external_gates(terms, subnet, part, signals(terms, subnet))),
    )
