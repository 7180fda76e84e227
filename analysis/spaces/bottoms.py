"""Bottom components: where every run can be led, and where none gets out again.

A bottom component is a strongly connected one that no edge leaves; a deadlock is one by itself. Every run can be led
into one. So what can be reached again from everywhere (AG EF p) is what holds somewhere in each of them, and where it
holds nowhere in one of them, any run into that shows that it is lost. A search against the edges answers one such
question; the bottom components, once they are found, answer all. The loop of a line of which a machine fails is asked
some thousand questions of this kind, and has a few dozen bottom components, in most of which everything stands still.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Generic, TypeVar

from firable.analysis._engine import BudgetExceeded
from firable.nets.net import Marking
from firable.nets.verdict import Witness

if TYPE_CHECKING:
    from firable.analysis.spaces.space import StateSpace

S = TypeVar("S")

SEARCHES: Final = 3
"""So many searches through a space find one component that is no deadlock, as a rule."""
COMPONENTS_MAX: Final = 16
"""So many that are no deadlocks are kept at most: a space may have as many as it has markings."""
FIRINGS_MAX: Final = 500
"""A longer run into a component says less than the shortest one to where a goal is lost, which a search finds."""
_SHARE: Final = 0.5
"""The part of the time of one question that components and runs may take, so that it can be answered without them."""


class Bottoms(Generic[S]):
    """The bottom components of a whole state space, found as goals are asked about.

    At most `most` that are no deadlocks are looked for.
    """

    def __init__(self, space: StateSpace[S], most: int) -> None:
        self._space, self._most = space, min(most, COMPONENTS_MAX)
        self._others: list[S] = []  # those that are no deadlocks
        self._left: S | None = None  # from where none that was found can be reached
        self._runs: list[tuple[Marking, Witness]] = []  # into components
        self._has_time, self._has_runs = True, True

    def where_lost(self, goal: S) -> S | None:
        """Markings of bottom components from which a goal can never be reached again, none where there are none.

        None where it is not known, as not all components were found. Raises `IncompleteGraph` where not all markings
        are known.
        """
        space, algebra = self._space, self._space.algebra
        space.require_complete()
        dead = algebra.conjunction([space.deadlocks, algebra.negation(goal)])
        if space.count(dead):
            return dead
        at = 0
        while at < len(self._others) or self._finds_another():
            if not space.count(algebra.conjunction([self._others[at], goal])):
                return self._others[at]
            at += 1
        return dead if self._left is not None and not space.count(self._left) else None

    def run_into(self, markings: S) -> Witness | None:
        """A run from M0 into some of what `where_lost` has given; None where such runs are long, or none is found."""
        for marking, run in self._runs:
            if self._space.contains(markings, marking):
                return run
        found = None
        if self._has_runs:
            try:
                with self._space.turn(_SHARE):
                    found = self._space.witness(markings)
            except BudgetExceeded:
                pass  # nor is any other looked for
        self._has_runs = found is not None and len(found.firings) <= FIRINGS_MAX
        if found is None or not self._has_runs:
            return None
        self._runs.append((self._space.net.marking(found.marking), found))
        return found

    def _finds_another(self) -> bool:
        """Find one more component that is no deadlock, if there is one, and it is worth it."""
        try:
            with self._space.turn(_SHARE):
                return self._has_time and self._found_another()
        except BudgetExceeded:
            self._has_time = False  # for others neither
            return False

    def _found_another(self) -> bool:
        space, algebra = self._space, self._space.algebra
        if self._left is None:
            home = algebra.disjunction(()) if space.count(space.deadlocks) else space.home()
            if space.count(home):
                self._others.append(home)
                self._left = algebra.disjunction(())
                return True
            self._left = algebra.negation(space.backward(space.deadlocks))
        if not space.count(self._left) or len(self._others) >= self._most:
            return False
        one = space.bottom_after(self._left)
        led = algebra.negation(space.backward(one))
        self._others.append(one)
        self._left = algebra.conjunction([self._left, led])
        return True
