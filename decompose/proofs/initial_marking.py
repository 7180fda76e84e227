"""The initial markings of the subnets together are M0."""

from __future__ import annotations

from collections.abc import Iterator

from firable.analysis.induction.smt import Terms
from firable.decompose.proofs.obligation import Obligation, equation
from firable.decompose.proofs.sides import Sides, holds
from firable.nets.formula import Start
from firable.semantics.formulas import evaluate


def initial_marking(sides: Sides) -> Iterator[Obligation]:
    """The one obligation on M0."""
    terms = Terms()
    yield equation(
        terms,
        "initial-marking",
        "the initial markings of the subnets together are that of the central net",
        "",
        evaluate(terms, sides.net, Start(), holds(terms, sides.net)),
        terms.conjunction(evaluate(terms, subnet, Start(), holds(terms, subnet)) for subnet in sides.subnets),
        words=("the central M0", "the subnets' M0"),
    )
