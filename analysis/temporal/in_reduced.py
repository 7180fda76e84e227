"""CTL in the net reduced for the formula: locally, and over all markings of what is left.

Most of a net has nothing to do with what a formula says, and most of what it does in between is certain to come. What
is left of nets with thousands of places are some hundred, whose markings are often few enough to be explored, or fit
into a small diagram. A formula without X has the same value in both nets (`reduction.reduce.reduce_for_branches`); one
with X is not asked here.

The small net is a net of its own, with runs of its own: what shows the value in it is not carried back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.goal import Limits
from firable.analysis.race import Contestant, race
from firable.analysis.reduction.reduce import ReducedBranches
from firable.analysis.reduction.reducer import Reducer
from firable.analysis.spaces.reachability import explore_few
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.temporal.ctl import Ctl, satisfied
from firable.analysis.temporal.local import decide_ctl_on_the_fly
from firable.analysis.temporal.sets import Sets
from firable.nets.formula import Deadlock, Start, leaves_in
from firable.nets.net import Net
from firable.nets.temporal import Temporal
from firable.nets.temporal_parts import has_next, states_in, with_states

_REDUCING_SHARE: Final = 0.7
"""The part of the time left that the reduction may take."""


class CtlInReduced:
    """Formulas of CTL without X on one net, each in the net reduced for it."""

    def __init__(self, reducer: Reducer) -> None:
        self.reducer = reducer
        self._in_vain: dict[Temporal, float] = {}
        """The seconds within which a formula was not decided."""

    def decided(self, formula: Temporal, limits: Limits) -> tuple[bool, str] | None:
        """Whether M0 satisfies a formula, and the method in words; None where it is not decided, or not asked here.

        It is not where it has an X or speaks of all places, where time is short, or no longer than it was in vain.
        """
        left = limits.deadline.left_seconds
        if left is not None and (
            _REDUCING_SHARE * left < self.reducer.takes_seconds or left < 2 * self._in_vain.get(formula, 0.0)
        ):
            return None
        labels = tuple(dict.fromkeys(states_in(formula)))
        if has_next(formula) or any(isinstance(leaf, Deadlock | Start) for of in labels for leaf in leaves_in(of)):
            return None
        within = replace(limits, deadline=limits.deadline.share(_REDUCING_SHARE))
        try:
            reduced = self.reducer.for_branches(labels, within)
        except BudgetExceeded:
            return None
        small = with_states(formula, reduced.labels.__getitem__)
        outcome = race(_lanes(reduced, small), limits, slices_seconds=None)
        if outcome.interrupted:
            raise KeyboardInterrupt
        if outcome.answer is None:
            if left is not None and not limits.deadline.is_cancelled:
                self._in_vain[formula] = left
            return None
        return outcome.answer, f"{outcome.winner}, after {reduced.summary}"


def _lanes(reduced: ReducedBranches, formula: Temporal) -> list[list[Contestant[bool]]]:
    def asked(name: str, decide: Callable[[Net, Temporal, Limits], bool | None]) -> Contestant[bool]:
        return Contestant(name, partial(decide, reduced.net, formula))

    return [[asked("on the fly", _locally)], [asked("explored", _by_exploring), asked("decision diagram", _by_diagram)]]


def _locally(net: Net, formula: Temporal, limits: Limits) -> bool | None:
    return decide_ctl_on_the_fly(net, formula, limits).answer.holds


def _by_exploring(net: Net, formula: Temporal, limits: Limits) -> bool:
    return _over(explore_few(net, limits), formula)


def _by_diagram(net: Net, formula: Temporal, limits: Limits) -> bool:
    return _over(explore_symbolically(net, limits), formula)


def _over(space: StateSpace[Any], formula: Temporal) -> bool:
    return satisfied(Ctl(Sets(space)), formula)
