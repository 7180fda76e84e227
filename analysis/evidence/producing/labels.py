"""Labels of a formula of CTL, from any state space that holds all markings: found by the fixpoints that they certify.

What a checker looks through once is computed here in rounds. On a graph the round in which a marking of a "least"
fixpoint came in is its rank, and each edge is followed once (`distances`); a "greatest" one is what a "least" one
leaves. Of a diagram the rounds themselves are kept, since a set for each would be more than the evidence is worth:
going back by one transition after the other, as long as one brings something new, takes fewer turns than by all at
once, and the list of these transitions is all the checker needs. Nothing here is trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from firable.analysis._engine import BudgetExceeded
from firable.analysis.evidence.certificate import Back, Diagram, Label, Labelling, Markings, Root, Rounds, Whole
from firable.analysis.evidence.checking.labelling import (
    All,
    Greatest,
    Least,
    Neighbour,
    Node,
    Some,
    State,
    fixpoints,
    normal,
    parts_of,
)
from firable.analysis.evidence.producing.distances import Distances
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import SymbolicSpace
from firable.nets.temporal import Temporal

NODES_MAX: Final = 100_000
"""How many nodes of a diagram are written."""
TURNS_MAX: Final = 20_000
"""How many transitions an "until" goes back by."""


class TooLargeError(Exception):
    """The evidence would be larger than what is written."""


def listed(graph: ReachabilityGraph) -> Markings:
    """The markings of a complete graph."""
    return Markings(tuple(graph.markings(graph.ascending)))


def drawn(space: SymbolicSpace, sets: Sequence[Any] = ()) -> Diagram:
    """The reachable markings as a diagram, with further sets as roots; raises `TooLargeError`."""
    found = space.engine.nodes([space.reach, *sets], NODES_MAX)
    if found is None:
        raise TooLargeError(f"the decision diagram has more than {NODES_MAX:,} nodes")
    rows, roots = found
    return Diagram(tuple(space.net.places[p].name for p in space.engine.order), tuple(rows), tuple(roots))


def labelling(
    space: StateSpace[Any], whole: Markings | Diagram, formula: Temporal, distances: Distances | None = None
) -> Labelling | None:
    """The labels that show a formula in M0; None where it does not hold. `whole` is the space as it is written.

    `distances` are those of the space, if it is a graph of which they are at hand. Raises `TooLargeError`,
    `BudgetExceeded`.
    """
    root = normal(formula)
    made = _Labels(space, distances)
    if not space.contains(made.of(root), space.net.initial_marking):
        return None
    labels = tuple(made.labels[one] for one in fixpoints(root))
    if made.roots and isinstance(space, SymbolicSpace):
        whole = drawn(space, made.roots)
    return Labelling(whole, labels)


@dataclass
class _Labels:
    """The markings in which each part of a formula holds, and the label of each fixpoint."""

    space: StateSpace[Any]
    given: Distances | None = None
    known: dict[Node, Any] = field(default_factory=dict)
    labels: dict[Node, Label] = field(default_factory=dict)
    roots: list[Any] = field(default_factory=list)

    def of(self, node: Node) -> Any:
        for part in parts_of(node):
            self.of(part)
        if node not in self.known:
            self.known[node] = self._found(node, [self.known[part] for part in parts_of(node)])
        return self.known[node]

    def _found(self, node: Node, parts: list[Any]) -> Any:
        algebra = self.space.algebra
        match node:
            case State(formula):
                return self.space.satisfying(formula)
            case All():
                return algebra.conjunction(parts)
            case Some():
                return algebra.disjunction(parts)
            case Neighbour(every):
                return self._next(parts[0], every=every)
            case Least(every):
                return self._least(node, parts[0], parts[1], every=every)
            case Greatest(every):
                return self._greatest(node, parts[0], parts[1], every=every)

    def _next(self, targets: Any, *, every: bool) -> Any:
        algebra = self.space.algebra
        if every:
            return algebra.negation(self.space.before(algebra.negation(targets)))
        return self.space.before(targets)

    @cached_property
    def _distances(self) -> Distances | None:
        return self.given or (Distances(self.space) if isinstance(self.space, ReachabilityGraph) else None)

    def _least(self, node: Node, through: Any, end: Any, *, every: bool) -> Any:
        space, algebra = self.space, self.space.algebra
        if self._distances is not None:
            ranks = self._distances.until(through, end, every=every)
            self.labels[node] = self._distances.written(ranks)
            return ranks >= 0
        if not every and isinstance(space, SymbolicSpace):
            return self._back(space, node, through, end)
        through = algebra.conjunction([through, algebra.negation(space.deadlocks)])
        found, size, rounds = end, space.count(end), 0
        while True:
            more = algebra.conjunction([through, self._next(found, every=True)])
            found = algebra.disjunction([found, more])
            before, size = size, space.count(found)
            if size == before:
                break
            rounds += 1
        self.labels[node] = Rounds(rounds)
        return found

    def _back(self, space: SymbolicSpace, node: Node, through: Any, end: Any) -> Any:
        """The same on a diagram, by one transition after the other, those with low places first."""
        level = {place: k for k, place in enumerate(space.engine.order)}
        index = space.net.place_index
        tops = [
            max((level[index[name]] for name in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)), default=0)
            for t in space.net.transitions
        ]
        order = sorted(range(len(tops)), key=tops.__getitem__)
        found, turns, more = end, list[str](), True
        while more and found != space.reach:
            more = False
            for t in order:
                if space.deadline.over:
                    raise BudgetExceeded("the time was over")
                larger = found | (space.engine.before(found, [t]) & through)
                if larger != found:
                    found, more = larger, True
                    turns.append(space.net.transitions[t].name)
                    if found == space.reach:
                        break
            order.reverse()  # there and back: what one direction leaves for many turns is the other's next one
            if len(turns) > TURNS_MAX:
                raise TooLargeError(f"going back takes more than {TURNS_MAX:,} turns")
        self.labels[node] = Back(tuple(turns))
        return found

    def _greatest(self, node: Node, end: Any, through: Any, *, every: bool) -> Any:
        space, algebra = self.space, self.space.algebra
        if self._distances is not None:
            not_end, not_through = algebra.negation(end), algebra.negation(through)
            found = self._distances.until(not_end, not_through, every=not every) < 0
            self.labels[node] = Whole() if found.all() else self._distances.written(np.where(found, 0, -1))
            return found
        found, size = through, space.count(through)
        while size:
            stays = [end, self._next(found, every=every), *([] if every else [space.deadlocks])]
            found = algebra.conjunction([found, algebra.disjunction(stays)])
            before, size = size, space.count(found)
            if size == before:
                break
        if size == space.n_markings:
            self.labels[node] = Whole()
        else:
            self.roots.append(found)
            self.labels[node] = Root(len(self.roots))
        return found
