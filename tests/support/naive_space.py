"""The state space as Python sets of markings, played by the reference player: the oracle for every other one.

Each operation is the textbook's sentence about it. Slow and obvious on purpose: what is fast is held to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.spaces.space import Derived
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import BOOL, Bitwise, BooleanAlgebra
from firable.semantics.firing import Valuation, in_contact
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, Player, holds_in
from firable.semantics.trace import Discipline

Markings = frozenset[Marking]


@lru_cache(256)
def _played(net: Net, discipline: Discipline) -> dict[Marking, list[tuple[FiringSet, Marking]]]:
    """The graph of a net, which nobody changes: many claims are asked of one net, most of them read anew for each."""
    return Player(net).reachable(step=discipline is Discipline.STEP)


@dataclass(frozen=True)
class NaiveSpace(Derived[Markings]):
    """All markings reachable from M0, by the reference player."""

    net: Net
    discipline: Discipline = Discipline.INTERLEAVING
    method: str = "the reference player"
    complete: bool = True
    bound: str = ""
    deadline: Deadline = NEVER

    @cached_property
    def graph(self) -> dict[Marking, list[tuple[FiringSet, Marking]]]:
        """Each reachable marking, breadth first, with its outgoing edges."""
        return _played(self.net, self.discipline)

    @property
    def cost(self) -> Cost:
        """What finding the markings took."""
        return Cost(self.n_markings, self.n_edges)

    @property
    def n_markings(self) -> int:
        """How many markings."""
        return len(self.graph)

    @property
    def n_edges(self) -> int:
        """How many pairs of a marking and what fires in it."""
        return sum(map(len, self.graph.values()))

    @cached_property
    def algebra(self) -> BooleanAlgebra[Markings]:
        """Sets of markings; the exclusive or with all of them is the complement."""
        return Bitwise(true=frozenset(self.graph), false=frozenset())

    @property
    def initial(self) -> Markings:
        """M0 alone."""
        return frozenset({self.net.initial_marking})

    @property
    def deadlocks(self) -> Markings:
        """The markings without an edge."""
        return frozenset(marking for marking, edges in self.graph.items() if not edges)

    def until(self, deadline: Deadline) -> NaiveSpace:
        """The same markings; it answers whatever it is asked, however long that takes."""
        return replace(self, deadline=deadline)

    def require_complete(self) -> None:
        """It always is."""

    def where(self, term: Callable[[BooleanAlgebra[Any], Valuation[Any]], Any]) -> Markings:
        """The markings in which a Boolean term holds."""
        return frozenset(marking for marking in self.graph if term(BOOL, holds_in(marking)))

    def fullest(self, places: Sequence[int]) -> tuple[int, Markings]:
        """The greatest number of tokens on places together, and the markings with as many."""
        tokens = {marking: sum(marking >> place & 1 for place in places) for marking in self.graph}
        most = max(tokens.values())
        return most, frozenset(marking for marking, count in tokens.items() if count == most)

    def satisfying(self, formula: Formula) -> Markings:
        """The markings in which a state formula holds."""
        return self.where(lambda algebra, holds: evaluate(algebra, self.net, formula, holds))

    def marked(self, place: int) -> Markings:
        """The markings in which a place holds a token."""
        return frozenset(marking for marking in self.graph if marking >> place & 1)

    def may_fire(self, t: int) -> Markings:
        """The markings in which a transition is firable and openable."""
        player = Player(self.net)
        return frozenset(marking for marking in self.graph if t in player.may_fire(marking))

    def in_contact(self, t: int) -> Markings:
        """The markings in contact at a transition."""
        return self.where(lambda algebra, holds: in_contact(algebra, self.net, t, holds))

    def alone(self, marking: Marking) -> Markings:
        """The set of one marking, if it is reachable."""
        return frozenset({marking}) & frozenset(self.graph)

    def contains(self, markings: Markings, marking: Marking) -> bool:
        """Whether the marking is one of these."""
        return marking in markings

    def count(self, markings: Markings) -> int:
        """How many."""
        return len(markings)

    def before(self, targets: Markings, by: Iterable[int] | None = None) -> Markings:
        """The markings with an edge into the targets, one that fires a transition of `by` if it is given."""
        wanted = None if by is None else set(by)
        return frozenset(
            marking
            for marking, edges in self.graph.items()
            if any(after in targets and (wanted is None or wanted & set(fired)) for fired, after in edges)
        )

    def backward(self, targets: Markings, within: Markings | None = None, by: Iterable[int] | None = None) -> Markings:
        """The least set with the targets, and the markings of `within` that have an edge into it, as for `before`."""
        found, some = targets, None if by is None else set(by)
        while more := (self.before(found, some) & (frozenset(self.graph) if within is None else within)) - found:
            found |= more
        return found

    def endless(self, within: Markings | None = None) -> Markings:
        """The greatest set inside `within` whose every marking has an edge into it."""
        found = frozenset(self.graph) if within is None else within
        while (fewer := found & self.before(found)) != found:
            found = fewer
        return found

    def forward(self, sources: Markings) -> Markings:
        """What can be reached from the sources, and these."""
        reached, more = set(sources), list(sources)
        while more:
            after = {after for _, after in self.graph[more.pop()]} - reached
            reached |= after
            more += after
        return frozenset(reached)

    def one_of(self, markings: Markings) -> Markings:
        """The smallest marking."""
        return frozenset({min(markings)})

    def bottom(self) -> Markings:
        """The markings of the first bottom component: what can be reached from one of them, and leads back to it."""
        for marking in self.graph:
            one = frozenset({marking})
            reached = self.forward(one)
            if reached <= self.backward(one):
                return reached
        raise AssertionError("a finite graph has a bottom component")

    def home(self) -> Markings:
        """The markings that every marking leads back to."""
        return frozenset(
            marking for marking in self.graph if len(self.backward(frozenset({marking}))) == len(self.graph)
        )

    def witness(self, targets: Markings, note: str = "") -> Witness | None:
        """A shortest firing sequence from M0 into the targets."""
        ways: dict[Marking, tuple[FiringSet, ...]] = {self.net.initial_marking: ()}
        for marking in self.graph:  # breadth first
            if marking in targets:
                names = tuple(tuple(self.net.transitions[t].name for t in fired) for fired in ways[marking])
                return Witness(names, marking=self.net.names(marking), note=note)
            for fired, after in self.graph[marking]:
                ways.setdefault(after, (*ways[marking], fired))
        return None
