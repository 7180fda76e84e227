"""Reaching a goal on the reduced net, by stubborn sets: what reductions leave is small, and often independent."""

from __future__ import annotations

from firable.analysis.goal import Finding, Limits
from firable.analysis.reduction.deciding import decide_reduced
from firable.analysis.stubborn import decide_by_stubborn_sets
from firable.nets.formula import Formula
from firable.nets.net import Net


def decide_by_reduction(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Whether the goal is reachable: the net is reduced for it, the rest searched, and the witness lifted back."""
    return decide_reduced(net, goal, limits, decide_by_stubborn_sets)
