"""CTL where it is asked: a formula evaluated in M0, at no more markings than its operators look at.

`Ctl` finds the set of markings in which each subformula holds, and so needs all markings. Where no technique holds
them all, a formula often needs few: a way to one marking, a cycle, a deadlock. The engine evaluates each subformula
where it is asked for, depth first, keeps what it has found, and gives up a search inside a search for a while where
that takes too long (`analysis/engine/src/local`, with its sources). What holds it shows without a run: the parts of a
formula that are true here and false there have no single run that shows it.

The engine knows `EX`, `E[p U q]` and `A[p U q]`; the others are made of these. Negations are pushed inwards as far as
state formulas go, so that a search knows which literals bring it nearer to what it looks for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from firable.analysis._engine import IncompleteGraph, evaluate_locally
from firable.analysis.compiled import engine_limits, flat, nodes_of
from firable.analysis.goal import Limits
from firable.analysis.question import Answer, Known
from firable.analysis.spaces.reachability import REASONS
from firable.nets.formula import Constant, Formula, Not
from firable.nets.net import Net
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
)
from firable.nets.verdict import Cost

METHOD: Final = "on the fly"
_MARKINGS_MAX: Final = 2**32 - 2
_FIRST: Final = 256
"""Markings that a search inside another one may meet in the first round."""


def decide_ctl_on_the_fly(net: Net, formula: Temporal, limits: Limits, *, markings: int = _MARKINGS_MAX) -> Known:
    """Decide whether M0 satisfies a formula of CTL, under interleaving, gates free.

    At most so many `markings` are met. Raises `IncompleteGraph` where it is not decided, with how far was looked.

    Cost: for each marking and each subformula with an operator that is asked for there, the transitions that the last
    firing touched; 4 bytes for each of them, and the marking.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.temporal import parse_temporal
    >>> net = catalogue_net("one_robot_mc_late")
    >>> formulas = map(parse_temporal, ("AG EF start", "AF EX start"))
    >>> [decide_ctl_on_the_fly(net, formula, Limits()).answer.holds for formula in formulas]
    [False, False]
    """
    compiled = _Compiled(net)
    compiled.add(formula, negate=False)
    found = evaluate_locally(
        *flat(net),
        [nodes_of(net, label) for label in compiled.labels],
        compiled.nodes,
        first=_FIRST,
        max_markings=markings,
        max_memory_bytes=limits.memory_bytes,
        **engine_limits(limits.deadline),
    )
    if found.holds is None:
        reason = REASONS.get(found.reason or "", found.reason)
        raise IncompleteGraph(f"{found.n_markings:,} markings: {reason}")
    return Known(Answer(found.holds), METHOD, Cost(found.n_markings, found.n_edges, found.seconds))


@dataclass
class _Compiled:
    """A formula as the engine takes it: state formulas, and nodes of which the last is the whole."""

    net: Net
    labels: dict[Formula, int] = field(default_factory=dict)
    nodes: list[tuple[str, list[int]]] = field(default_factory=list)
    _known: dict[tuple[str, tuple[int, ...]], int] = field(default_factory=dict)

    def add(self, formula: Temporal, *, negate: bool) -> int:
        """The node of a formula or of its negation."""
        match formula:
            case TemporalNot(operand):
                return self.add(operand, negate=not negate)
            case TemporalAnd(operands) | TemporalOr(operands):
                # What costs nothing is asked first.
                parts = sorted(operands, key=lambda operand: not isinstance(operand, Formula))
                word = "and" if isinstance(formula, TemporalAnd) is not negate else "or"
                return self._node(word, *(self.add(part, negate=negate) for part in parts))
            case Exists(Globally(operand)):
                return self._not(self._until("AU", None, self.add(operand, negate=True)), negate)
            case ForAll(Globally(operand)):
                return self._not(self._until("EU", None, self.add(operand, negate=True)), negate)
            case Exists(Eventually(operand)):
                return self._not(self._until("EU", None, self.add(operand, negate=False)), not negate)
            case ForAll(Eventually(operand)):
                return self._not(self._until("AU", None, self.add(operand, negate=False)), not negate)
            case Exists(Until(left, right)):
                until = self._until("EU", self.add(left, negate=False), self.add(right, negate=False))
                return self._not(until, not negate)
            case ForAll(Until(left, right)):
                until = self._until("AU", self.add(left, negate=False), self.add(right, negate=False))
                return self._not(until, not negate)
            case Exists(Next(operand)):
                return self._not(self._node("EX", self.add(operand, negate=False)), not negate)
            case ForAll(Next(operand)):
                return self._not(self._node("EX", self.add(operand, negate=True)), negate)
            case _ if isinstance(formula, Formula):
                return self._label(Not(formula) if negate else formula)
        raise ValueError(f"{formula} is no formula of CTL")

    def _not(self, node: int, kept: bool) -> int:
        """The node, or its negation unless it is `kept`."""
        return node if kept else self._node("not", node)

    def _until(self, word: str, left: int | None, right: int) -> int:
        return self._node(word, self._label(Constant(value=True)) if left is None else left, right)

    def _label(self, formula: Formula) -> int:
        return self._node("label", self.labels.setdefault(formula, len(self.labels)))

    def _node(self, word: str, *operands: int) -> int:
        key = (word, operands)
        if key not in self._known:
            self._known[key] = len(self.nodes)
            self.nodes.append((word, list(operands)))
        return self._known[key]
