"""Formulas of CTL that are goals in disguise: Boolean combinations of `EF p`, `AG p` and what holds in M0.

`EF p or not AG q` speaks of no run, only of two markings: each part comes down to a goal (`as_goal`), and what the
parts say is put together by the three-valued Boolean operations. So it is decided where no technique holds all
markings, and where one part is not decided another may be enough.

Formulas of LTL are not taken apart so, but for conjunctions: that each run satisfies `G p or G q` says neither that
each satisfies `G p` nor that each satisfies `G q`.
"""

from __future__ import annotations

from collections.abc import Callable

from firable.analysis.goal import Finding
from firable.analysis.temporal.queries import as_goal
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.temporal import Temporal, TemporalAnd, TemporalNot, TemporalOr
from firable.nets.verdict import Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in

Reached = Callable[[Formula], Finding | None]
"""What is found of a goal; None where that is not decided."""

Value = tuple[bool | None, Witness | None]
"""Whether a formula holds (None: not decided), and the firing sequence that shows it, where one does."""


def is_combined(formula: Temporal, *, branching: bool) -> bool:
    """Whether a formula is put together from goals; of one that is not `branching`, a conjunction of them.

    >>> from firable.nets.temporal import parse_temporal
    >>> [is_combined(parse_temporal(text), branching=True) for text in ("EF p or not AG q", "EF p or AF q")]
    [True, False]
    """
    match formula:
        case TemporalNot(operand) if branching:
            return is_combined(operand, branching=branching)
        case TemporalOr(operands) if branching:
            return all(is_combined(operand, branching=branching) for operand in operands)
        case TemporalAnd(operands):
            return all(is_combined(operand, branching=branching) for operand in operands)
    return isinstance(formula, Formula) or as_goal(formula) is not None


def combined(net: Net, formula: Temporal, reached: Reached) -> Value:
    """The value of a combined formula, by what is reached; parts that make no difference are not asked for.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> holds, shown = combined(catalogue_net("one_robot"), parse_temporal("start or AG start"), lambda goal: None)
    >>> holds, shown.firings, "robot.free" in shown.marking
    (True, (), True)
    """
    match formula:
        case TemporalNot(operand):
            holds, shown = combined(net, operand, reached)
            return (None if holds is None else not holds), shown
        case TemporalAnd(operands):
            return _first(net, operands, reached, decisive=False)
        case TemporalOr(operands):
            return _first(net, operands, reached, decisive=True)
    if isinstance(formula, Formula):
        holds = bool(evaluate(BOOL, net, formula, holds_in(net.initial_marking)))
        return holds, Witness(marking=net.names(net.initial_marking))
    if (goal := as_goal(formula)) is None:
        raise ValueError("a formula that is not put together from goals")
    finding = reached(goal[0])
    return (None, None) if finding is None else (finding.reachable is goal[1], finding.witness)


def _first(net: Net, operands: tuple[Temporal, ...], reached: Reached, *, decisive: bool) -> Value:
    """The first operand with the decisive value decides, else all must be decided; what costs nothing comes first."""
    undecided = False
    for operand in sorted(operands, key=lambda operand: not isinstance(operand, Formula)):
        holds, shown = combined(net, operand, reached)
        if holds is decisive:
            return holds, shown
        undecided = undecided or holds is None
    return (None if undecided else not decisive), None
