"""The markings of a net for evidence: those that the run that decided held, or else found anew, as they are written.

Few markings are listed; beyond that a decision diagram stands for them, where one is found in its part of the time.
Each is made when somebody first asks for it, and once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Diagram, Markings
from firable.analysis.evidence.claims import is_marking
from firable.analysis.evidence.producing.labels import TooLargeError, drawn, listed
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 20_000
"""How many markings are listed where a decision diagram would do as well."""
WIDE_MAX: Final = 100_000
"""How many markings are listed where none would, or none is at hand: for responses, LTL, synchronous steps, CTL."""
MANY_MAX: Final = 400_000
"""How many markings are listed where no firings of them need to be kept, for what is never so."""
DIGITS_MAX: Final = 2**25
"""How many hexadecimal digits these may take."""
_SECONDS: Final = 30.0
_CLOCK_EVERY: Final = 4_096


class Spaces:
    """The markings of one net, as far as there is time and room for them; `given` are those that are at hand."""

    def __init__(self, net: Net, discipline: Discipline, limits: Limits, given: StateSpace[Any] | None = None) -> None:
        self.net, self.discipline, self.limits, self.given = net, discipline, limits, given

    def part(self, share: float) -> Deadline:
        """A part of the time that is left for evidence."""
        left = self.limits.deadline.left_seconds
        return self.limits.deadline.within(_SECONDS if left is None else left * share)

    @cached_property
    def graph(self) -> ReachabilityGraph | None:
        """All markings as a graph, where they are few enough to be listed for whatever is claimed."""
        return self._explored(MARKINGS_MAX if self.discipline is Discipline.INTERLEAVING else WIDE_MAX)

    @cached_property
    def wide(self) -> ReachabilityGraph | None:
        """The same, where only listed markings will do."""
        return self.graph or self._explored(WIDE_MAX)

    def _explored(self, most: int) -> ReachabilityGraph | None:
        graph = self.given
        if isinstance(graph, SymbolicSpace) and graph.n_markings > most:
            return None
        if not isinstance(graph, ReachabilityGraph) or not graph.complete:
            budget = Budget(most, self.limits.memory_bytes)
            graph = explore(self.net, self.discipline, budget, deadline=self.part(0.2))
        return graph.until(self.limits.deadline) if graph.complete and graph.n_markings <= most else None

    @cached_property
    def markings(self) -> Markings | None:
        """The markings of `graph` as they are written."""
        return None if self.graph is None else listed(self.graph)

    @cached_property
    def wide_markings(self) -> Markings | None:
        """The markings of `wide` as they are written."""
        return self.markings or (None if self.wide is None else listed(self.wide))

    @cached_property
    def many(self) -> Markings | None:
        """All markings of a graph that is at hand, if they are not too many for a set that is closed, and no more."""
        graph = self.given
        if not isinstance(graph, ReachabilityGraph) or not graph.complete or self.discipline is Discipline.STEP:
            return None
        if graph.n_markings > MANY_MAX or graph.n_markings * -(-len(self.net.places) // 4) > DIGITS_MAX:
            return None
        found = list[Marking]()
        for i in range(graph.n_markings):
            if i % _CLOCK_EVERY == 0 and self.limits.deadline.over:
                return None
            found.append(graph.marking(i))
        return Markings(tuple(sorted(found)))

    @cached_property
    def symbolic(self) -> SymbolicSpace | None:
        """All markings as a decision diagram, where they are too many to be listed."""
        if self.graph is not None or self.discipline is Discipline.STEP:
            return None
        if isinstance(self.given, SymbolicSpace):
            return self.given.until(self.limits.deadline)
        try:
            return explore_symbolically(self.net, Limits(self.part(0.3), self.limits.memory_bytes)).until(
                self.limits.deadline
            )
        except BudgetExceeded:
            return None

    @cached_property
    def diagram(self) -> Diagram | None:
        """The same markings as they are written."""
        try:
            return None if self.symbolic is None else drawn(self.symbolic)
        except TooLargeError:
            return None

    def way(self, targets: Callable[[StateSpace[Any]], Any]) -> Witness | None:
        """A way into a set, from whichever space there is."""
        space: StateSpace[Any] | None = self.graph or self.symbolic or self.given
        return None if space is None else space.witness(targets(space))

    def way_to(self, marking: Marking) -> Witness | None:
        """A way to one marking."""
        return self.way(lambda space: space.satisfying(is_marking(space.net, marking)))
