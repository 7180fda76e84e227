"""Sets of markings with the operators that temporal logic needs, over any state space.

A maximal run goes on for ever or ends in a deadlock; this is where that convention is written. `EX p` needs a next
marking, so it is false in a deadlock; `EG p` holds where p can hold for ever, or until a deadlock that satisfies p.
Everything else in CTL follows by duality.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from firable.analysis.spaces.space import StateSpace
from firable.nets.formula import Constant, Formula

S = TypeVar("S")


@dataclass
class Sets(Generic[S]):
    """The sets of a state space; the set of each state formula is found once."""

    space: StateSpace[S]
    _known: dict[Formula, S] = field(default_factory=dict)

    @property
    def all(self) -> S:
        """All reachable markings."""
        return self.space.algebra.conjunction(())

    @property
    def none(self) -> S:
        """No marking."""
        return self.space.algebra.disjunction(())

    def both(self, *sets: S) -> S:
        """The intersection."""
        return self.space.algebra.conjunction(sets)

    def either(self, *sets: S) -> S:
        """The union."""
        return self.space.algebra.disjunction(sets)

    def outside(self, markings: S) -> S:
        """The complement within the reachable markings."""
        return self.space.algebra.negation(markings)

    def empty(self, markings: S) -> bool:
        """Whether there is no marking in the set."""
        return self.space.count(markings) == 0

    def of(self, formula: Formula) -> S:
        """The markings in which a state formula holds."""
        if formula not in self._known:
            self._known[formula] = self.space.satisfying(formula)
        return self._known[formula]

    def constant(self, formula: Formula) -> Formula:
        """The constant that a state formula is in all reachable markings, or itself."""
        markings = self.of(formula)
        if self.empty(markings):
            return Constant(value=False)
        return Constant(value=True) if self.empty(self.outside(markings)) else formula

    def before(self, markings: S, by: Iterable[int] | None = None) -> S:
        """EX: a next marking, reached by firing one of `by` if it is given, is in the set."""
        return self.space.before(markings, by)

    def until(self, through: S, targets: S) -> S:
        """E[through U targets]."""
        return self.space.backward(targets, self.either(through, targets))

    def always(self, within: S) -> S:
        """EG: some maximal run stays within the set."""
        stuck = self.both(self.space.deadlocks, within)
        return self.either(self.space.endless(within), self.until(within, stuck))
