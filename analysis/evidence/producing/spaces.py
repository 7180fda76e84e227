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
from firable.analysis.evidence.claim_records import steps_of
from firable.analysis.evidence.claims import is_marking
from firable.analysis.evidence.producing.distances import Distances
from firable.analysis.evidence.producing.labels import TooLargeError, drawn, listed
from firable.analysis.evidence.producing.lacking import NO_MEMORY, NO_TIME
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
from firable.nets.diagnostics import InputError
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.trace import Discipline

MARKINGS_MAX: Final = 20_000
"""How many markings are listed where a decision diagram would do as well."""
WIDE_MAX: Final = 250_000
"""How many markings are listed where none would: for responses, LTL, synchronous steps."""
MANY_MAX: Final = 2_000_000
"""How many markings are listed where no diagram is at hand, and they are looked through in arrays."""
WORDS_MAX: Final = 2**25
"""How many words of 64 bits these may take."""
DIGITS_MAX: Final = 2**26
"""How many hexadecimal digits they may take as they are written."""
_SECONDS: Final = 30.0


class Spaces:
    """The markings of one net, as far as there is time and room for them; `given` are those that are at hand."""

    def __init__(self, net: Net, discipline: Discipline, limits: Limits, given: StateSpace[Any] | None = None) -> None:
        self.net, self.discipline, self.limits, self.given = net, discipline, limits, given
        self._ended: dict[int, str] = {}
        """Which budget ended the exploring of so many markings, in words."""

    def ended(self, most: int) -> str:
        """Which budget ended the exploring of so many markings, in words; empty where there are more of them."""
        return self._ended.get(most, "")

    def part(self, share: float) -> Deadline:
        """A part of the time that is left for evidence."""
        return _part_of(self.limits.deadline, share)

    @cached_property
    def _are_held(self) -> bool:
        """Whether all markings are at hand, and may be listed."""
        graph = self.given
        return isinstance(graph, ReachabilityGraph) and graph.complete and graph.n_markings <= MANY_MAX

    @cached_property
    def _for_less(self) -> Deadline:
        return self.part(0.25)

    def part_of_a_run(self) -> Deadline:
        """The same for runs that fire something: less of it where all markings are held, which show them, too."""
        return self.part(0.12 if self._are_held else 0.5)

    def part_of_a_search(self, share: float) -> Deadline:
        """The same for something smaller than all markings; where these are held, all searches share a part of it."""
        return _part_of(self._for_less, share) if self._are_held else self.part(share)

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
            try:
                graph = explore(self.net, self.discipline, budget, deadline=self.part(0.2))
            except InputError:  # there is no room for the net itself, and a diagram may need less
                self._ended[most] = NO_MEMORY
                return None
            self._ended[most] = {"memory": NO_MEMORY, "time": NO_TIME}.get(graph.engine.reason or "", "")
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
    def many(self) -> ReachabilityGraph | None:
        """The same, where no diagram is at hand: as many as are looked through in arrays."""
        if self.discipline is Discipline.STEP:
            return self.wide
        words = -(-len(self.net.places) // 64)
        return self.wide or self._explored(min(MANY_MAX, WORDS_MAX // max(1, words)))

    @cached_property
    def many_markings(self) -> Markings | None:
        """The markings of `many` as they are written, where that is not too much."""
        if self.wide_markings is not None or self.many is None:
            return self.wide_markings
        found = listed(self.many)
        return found if sum(step.bit_length() + 3 for step in steps_of(found.markings)) <= 4 * DIGITS_MAX else None

    @cached_property
    def distances(self) -> Distances | None:
        """The edges of `many`, turned round."""
        return None if self.many is None else Distances(self.many)

    @cached_property
    def asked(self) -> StateSpace[Any] | None:
        """All markings, for questions about them: the first of few, a diagram, and many."""
        return self.graph or self.symbolic or self.many

    @cached_property
    def symbolic(self) -> SymbolicSpace | None:
        """All markings as a decision diagram, where they are too many to be listed."""
        if self.graph is not None or self.discipline is Discipline.STEP:
            return None
        if isinstance(self.given, SymbolicSpace):
            return self.given.until(self.limits.deadline)
        try:
            share = 0.08 if self._are_held else 0.3
            space = explore_symbolically(self.net, Limits(self.part(share), self.limits.memory_bytes))
            return space.until(self.limits.deadline)
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
        space = self.graph or self.symbolic or self.given
        return None if space is None else space.witness(targets(space))

    def way_to(self, marking: Marking) -> Witness | None:
        """A way to one marking."""
        return self.way(lambda space: space.satisfying(is_marking(space.net, marking)))


def _part_of(deadline: Deadline, share: float) -> Deadline:
    left = deadline.left_seconds
    return deadline.within(_SECONDS if left is None else left * share)
