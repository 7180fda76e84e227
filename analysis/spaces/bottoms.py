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

_SHARE: Final = 0.5
"""The part of the time of one question that further components may take, so that it can be answered without them."""


class Bottoms(Generic[S]):
    """The bottom components of a whole state space, found as goals are asked about.

    At most `most` that are no deadlocks are looked for: a space may have as many as it has markings.
    """

    def __init__(self, space: StateSpace[S], most: int) -> None:
        self._space, self._most = space, most
        self._dead: list[tuple[Marking, Witness]] = []  # deadlocks, with a run to each
        self._others: list[S] = []  # components that are no deadlocks
        self._runs: dict[int, Witness | None] = {}  # into some of these
        self._left: S | None = None  # from where none that was found can be reached

    def where_lost(self, goal: S) -> Witness | None:
        """A run from M0 to where a goal can never be reached again; None where no component that was found shows that.

        Raises `IncompleteGraph` where not all markings are known.
        """
        space, algebra = self._space, self._space.algebra
        space.require_complete()
        for marking, witness in self._dead:
            if not space.contains(goal, marking):
                return witness
        found = space.witness(algebra.conjunction([space.deadlocks, algebra.negation(goal)]))
        if found is not None:
            self._dead.append((space.net.marking(found.marking), found))
            return found
        at = 0
        while at < len(self._others) or self._finds_another():
            if not space.count(algebra.conjunction([self._others[at], goal])):
                if at not in self._runs:
                    self._runs[at] = space.witness(self._others[at])
                return self._runs[at]
            at += 1
        return None

    @property
    def all_found(self) -> bool:
        """Whether every run can be led into a component that was found: what none of them shows to be lost is not."""
        return self._left is not None and not self._space.count(self._left)

    def _finds_another(self) -> bool:
        """Find one more component that is no deadlock, if there is one, and it is worth it."""
        space, algebra = self._space, self._space.algebra
        try:
            with space.turn(_SHARE):
                if self._left is None:
                    home = algebra.disjunction(()) if space.count(space.deadlocks) else space.home()
                    if space.count(home):
                        self._others.append(home)
                        self._left = algebra.disjunction(())
                        return True
                    self._left = algebra.negation(space.backward(space.deadlocks))
                if self.all_found or len(self._others) >= self._most:
                    return False
                one = space.bottom_after(self._left)
                led = algebra.negation(space.backward(one))
        except BudgetExceeded:
            self._most = 0
            return False
        self._others.append(one)
        self._left = algebra.conjunction([self._left, led])
        return True
