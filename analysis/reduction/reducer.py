"""One net, reduced for one question after the other.

What is proved of the pairs of its places, which takes half of a reduction, is true whatever is asked; so it is proved
once. A reduction that came to its end is kept, since who is asked in turns is asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from firable.analysis._engine import BudgetExceeded
from firable.analysis.goal import Limits
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net, holding

if TYPE_CHECKING:
    from firable.analysis.reduction.pairs import Pairs
    from firable.analysis.reduction.reduce import Reduced, ReducedBranches, ReducedRuns

R = TypeVar("R")
_KEPT_MAX: Final = 64
_KEPT_SIZE_MAX: Final = 400_000
"""Reductions that are kept of a kind, and places and transitions of the net for all of them: some 0.4 kB for each."""
_REDUCING_SECONDS: Final = 8e-5
"""What it takes for each place and each transition, of large nets."""
_PROVING_SECONDS: Final = 2e-5
"""The same of what is proved of the net for all that is asked, and for each pair of literals:"""
_PAIR_SECONDS: Final = 8e-9
_PROVING_SHARE: Final = 0.4
"""The part of the time left that this proof may take; what comes after goes on without."""
_AGAIN: Final = 2.0
"""One that time has ended is tried again with so many times as long."""


class Reducer:
    """Reduces a net as `firable.analysis.reduction.reduce` does, by facts that are proved of it once."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self._facts: Pairs | None = None
        self._is_beyond_proof = False
        self._in_vain_seconds = 0.0
        self._is_first_goal = True
        most = max(1, min(_KEPT_MAX, _KEPT_SIZE_MAX // (len(net.places) + len(net.transitions) + 1)))
        self._goals: _Kept[Reduced] = _Kept(most)
        self._runs: _Kept[ReducedRuns] = _Kept(most)
        self._branches: _Kept[ReducedBranches] = _Kept(most)

    def at(self, marking: Marking) -> Reducer:
        """The reducer of the net that begins in a reachable marking, of which all that is proved is true as well."""
        there = Reducer(replace(self.net, places=holding(self.net.places, marking)))
        there._facts, there._is_beyond_proof = self._facts, self._is_beyond_proof
        there._in_vain_seconds = self._in_vain_seconds
        return there

    @property
    def takes_seconds(self) -> float:
        """About how long the next reduction takes."""
        places, size = len(self.net.places), len(self.net.places) + len(self.net.transitions)
        if self._facts is not None or self._is_beyond_proof:
            return _REDUCING_SECONDS * size
        return (_REDUCING_SECONDS + _PROVING_SECONDS) * size + _PAIR_SECONDS * (2 * places) ** 2

    def for_goal(self, goal: Formula, limits: Limits) -> Reduced:
        """The net reduced for a goal, as far as that comes until the deadline; a checker cannot take its steps.

        The first goal is reduced for without facts on the whole net: what it does not depend on goes before any are
        needed. Raises `BudgetExceeded` where the deadline comes before the net is read, as the others do.
        """
        from firable.analysis.reduction.reduce import reduce_for_goal  # with numpy, where first needed

        def reduced() -> Reduced:
            facts = self._facts if self._is_first_goal else self._proved(limits)
            self._is_first_goal = False
            return reduce_for_goal(self.net, goal, limits, facts)

        return self._goals.of((goal,), reduced, limits)

    def for_runs(self, labels: Sequence[Formula], limits: Limits) -> ReducedRuns:
        """The net reduced for runs through these labels, as far as that comes until the deadline."""
        from firable.analysis.reduction.reduce import reduce_for_runs

        return self._runs.of(
            tuple(labels), lambda: reduce_for_runs(self.net, labels, limits, self._proved(limits)), limits
        )

    def for_branches(self, labels: Sequence[Formula], limits: Limits) -> ReducedBranches:
        """The net reduced for CTL without X over these labels, as far as that comes until the deadline."""
        from firable.analysis.reduction.reduce import reduce_for_branches

        return self._branches.of(
            tuple(labels), lambda: reduce_for_branches(self.net, labels, limits, self._proved(limits)), limits
        )

    def _proved(self, limits: Limits) -> Pairs | None:
        from firable.analysis.reduction.reduce import facts_on

        within = replace(limits, deadline=limits.deadline.share(_PROVING_SHARE))
        left = within.deadline.left_seconds
        is_short = left is not None and left < _AGAIN * self._in_vain_seconds
        if self._facts is None and not self._is_beyond_proof and not is_short:
            with suppress(BudgetExceeded):
                self._facts = facts_on(self.net, within)
            if left is None or not within.deadline.over:
                self._is_beyond_proof = self._facts is None
            elif self._facts is None and not within.deadline.is_cancelled:
                self._in_vain_seconds = left
        return self._facts


class _Kept(Generic[R]):
    """The reductions of one kind that were asked for last, at most so many."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: dict[tuple[Formula, ...], R] = {}

    def of(self, labels: tuple[Formula, ...], reduced: Callable[[], R], limits: Limits) -> R:
        """What is kept, or else is made now, and is kept unless the deadline has ended it."""
        is_kept = labels in self._found
        found = self._found.pop(labels) if is_kept else reduced()
        if is_kept or not limits.deadline.over:
            self._found[labels] = found
            if len(self._found) > self._most:
                del self._found[next(iter(self._found))]
        return found
