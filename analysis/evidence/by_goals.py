"""Formulas of CTL that say no more than goals do: which claims on goals show that one holds, or that it does not.

`AG p` is "never not p" and `EF p` is "p is reachable", so a Boolean combination of these, and of what holds in M0, is
shown by claims for which evidence is small where the markings are many. All other formulas need a claim on themselves.
"""

from __future__ import annotations

from collections.abc import Callable

from firable.analysis.evidence.claims import Claim, ClaimKind, tidy
from firable.nets.formula import Formula, Not
from firable.nets.net import Net
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
)
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in


def said_by_goals(net: Net, formula: Temporal, shows: Callable[[Claim], bool], *, holds: bool) -> bool:
    """Whether claims on goals say that a formula of CTL holds in M0, or that it does not.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.temporal import parse_temporal
    >>> net, formula = catalogue_net("one_robot"), parse_temporal("EF robot.free or AG robot.free")
    >>> reachable = Claim(ClaimKind.REACHABLE, parse_formula("robot.free"))
    >>> said_by_goals(net, formula, lambda claim: claim == reachable, holds=True)
    True
    >>> said_by_goals(net, formula, lambda claim: claim == reachable, holds=False)
    False
    """
    match formula:
        case TemporalNot(operand):
            return said_by_goals(net, operand, shows, holds=not holds)
        case TemporalAnd(operands) | TemporalOr(operands):
            judged = all if isinstance(formula, TemporalAnd) is holds else any
            return judged(said_by_goals(net, operand, shows, holds=holds) for operand in operands)
    if isinstance(formula, Formula):
        return bool(evaluate(BOOL, net, formula, holds_in(net.initial_marking))) is holds
    claim = goal_claim(formula, holds=holds)
    return claim is not None and shows(claim)


def goal_claim(formula: Temporal, *, holds: bool) -> Claim | None:
    """The claim that `AG p` or `EF p` is, or its opposite; None of any other formula."""
    match formula:
        case Exists(Eventually(goal)) if isinstance(goal, Formula):
            return Claim(ClaimKind.REACHABLE if holds else ClaimKind.NEVER, tidy(goal))
        case ForAll(Globally(goal)) if isinstance(goal, Formula):
            return Claim(ClaimKind.NEVER if holds else ClaimKind.REACHABLE, tidy(Not(goal)))
    return None
