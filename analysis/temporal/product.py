"""The product of a state space and an automaton, as one set of markings for each state of the automaton.

A pair of a marking and a state has an edge for each edge of the state whose atoms hold in the marking and each firing
that the edge admits; in a deadlock the run stutters, if the edge asks for no firing. What leads to what is then
computed backward, state by state, so the product is never built: the operator "one step back" of the state space is
all that is needed, and the same text serves tables and decision diagrams.

A run is accepted iff from some moment it stays in one strongly connected part of the automaton and takes edges with
each mark for ever. In such a part the set of pairs where it can is the greatest fixpoint of Emerson and Lei (1986):
from a pair of it, for each mark an edge with that mark can be reached that leads back into it. Most parts that come
from formulas are one state with edges to itself, so two shortcuts carry the whole: going back through such a state is
one backward closure of the space, and staying in it for ever is EG.

Pairs of single markings, one after the other, are better where the first lasso is near or the space too large to be
held: that is a technique of its own (`temporal.on_the_fly`), which has no counterpart on a decision diagram.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic, TypeVar

from firable.analysis.temporal.automaton import Automaton, TimeEndedError
from firable.analysis.temporal.sets import Sets
from firable.nets.formula import Formula
from firable.nets.net import Net

S = TypeVar("S")
Pairs = dict[int, S]
"""For each state of the automaton, the markings it is paired with."""


@dataclass(frozen=True)
class ProductEdge(Generic[S]):
    """An edge of the automaton whose atoms are a set of markings; `by` are the firings admitted, None for all."""

    markings: S
    by: frozenset[int] | None
    stutters: bool
    target: int
    marks: frozenset[int]


@dataclass
class Product(Generic[S]):
    """A state space and the edges of each state of an automaton; a run needs each of the marks for ever."""

    sets: Sets[S]
    edges: tuple[tuple[ProductEdge[S], ...], ...]
    n_marks: int

    @classmethod
    def of(cls, sets: Sets[S], automaton: Automaton) -> Product[S]:
        """The product with an automaton; edges whose atoms hold nowhere are left out."""
        net = sets.space.net
        rows: list[tuple[ProductEdge[S], ...]] = []
        for edges in automaton.edges:
            row = []
            for edge in edges:
                markings = _where(sets, edge.atoms)
                by = firings_of(net, edge.fires, edge.spared)
                possible = by is None or by or not edge.fires
                if possible and not sets.empty(markings):
                    row.append(ProductEdge(markings, by, not edge.fires, edge.target, edge.marks))
            rows.append(tuple(row))
        return cls(sets, tuple(rows), automaton.n_marks)

    @cached_property
    def parts(self) -> tuple[tuple[int, ...], ...]:
        """The strongly connected parts of the automaton, each after all that it leads to."""
        return components([[edge.target for edge in edges] for edges in self.edges])

    def reaching(self, goal: Pairs[S]) -> Pairs[S]:
        """The pairs from which a pair of the goal can be reached."""
        found = Steps(self, {})
        for part in self.parts:
            self._close(found, part, {state: goal.get(state, self.sets.none) for state in part})
        return found.pairs

    def _close(self, found: Steps[S], part: tuple[int, ...], goal: Pairs[S], within: Pairs[S] | None = None) -> None:
        """Add to what is found the pairs of these states that lead, within some, to the goal or to what was found."""
        for state in part:
            found.put(state, goal[state])
        waiting = dict.fromkeys(part)
        while waiting:
            state = next(iter(waiting))
            del waiting[state]
            old, steps = found.pairs[state], found.into(self.edges[state])
            base = self.sets.either(old, steps if within is None else self.sets.both(steps, within[state]))
            new = self._through(state, base, within)
            if self.sets.space.count(new) != self.sets.space.count(old):
                found.put(state, new)
                waiting.update(dict.fromkeys(q for q in part if any(edge.target == state for edge in self.edges[q])))

    def _through(self, state: int, targets: S, within: Pairs[S] | None) -> S:
        """The markings that lead to the targets while the automaton stays in the state, whatever fires."""
        own = [edge.markings for edge in self.edges[state] if edge.target == state and edge.by is None]
        if not own:
            return targets
        through = self.sets.either(*own)
        return self.sets.until(through if within is None else self.sets.both(through, within[state]), targets)

    def fair(self) -> Pairs[S]:
        """The pairs from which a run can be accepted without leaving its part of the automaton."""
        found: Pairs[S] = {}
        for part in self.parts:
            inside = set(part)
            own = [edge for state in part for edge in self.edges[state] if edge.target in inside]
            if own and all(any(mark in edge.marks for edge in own) for mark in range(self.n_marks)):
                pairs = self._fair_in(part)
                found.update({state: markings for state, markings in pairs.items() if not self.sets.empty(markings)})
        return found

    def _fair_in(self, part: tuple[int, ...]) -> Pairs[S]:
        inside = set(part)
        own = {state: [edge for edge in self.edges[state] if edge.target in inside] for state in part}
        every = frozenset(range(self.n_marks))
        pairs = {state: self.sets.either(*(edge.markings for edge in own[state])) for state in part}
        if len(part) == 1 and all(edge.by is None for edge in own[part[0]]):
            pairs = {part[0]: self.sets.always(pairs[part[0]])}  # all that can stay in the state for ever
            if all(edge.marks == every for edge in own[part[0]]):
                return pairs
        missing = [mark for mark in every if any(mark not in edge.marks for edges in own.values() for edge in edges)]
        size = -1
        while (now := sum(map(self.sets.space.count, pairs.values()))) != size:
            size = now
            for mark in missing:
                closed = Steps(self, {})
                self._close(closed, part, self._step(own, pairs, mark), pairs)
                pairs = closed.pairs
            if not missing:
                pairs = self._step(own, pairs, None)
        return pairs

    def _step(self, own: dict[int, list[ProductEdge[S]]], pairs: Pairs[S], mark: int | None) -> Pairs[S]:
        steps = Steps(self, pairs)
        return {q: self.sets.both(steps.into(own[q], mark), markings) for q, markings in pairs.items()}


@dataclass
class Steps(Generic[S]):
    """Pairs, and one step back into them; the step to a set is found once as long as the set stays."""

    product: Product[S]
    pairs: Pairs[S]
    _before: dict[tuple[int, frozenset[int] | None], S] = field(default_factory=dict)

    def put(self, state: int, markings: S) -> None:
        """Let the state be paired with these markings."""
        self.pairs[state] = markings
        for key in [key for key in self._before if key[0] == state]:
            del self._before[key]

    def into(self, edges: Iterable[ProductEdge[S]], mark: int | None = None) -> S:
        """The markings from which one of the edges (with the mark, if it is given) leads into the pairs.

        Raises `TimeEndedError` where the moment of the space comes.
        """
        sets = self.product.sets
        found = []
        for edge in edges:
            targets = self.pairs.get(edge.target)
            if targets is None or (mark is not None and mark not in edge.marks):
                continue
            if sets.space.moment.over:
                raise TimeEndedError
            key = (edge.target, edge.by)
            if key not in self._before:
                self._before[key] = sets.before(targets, edge.by)
            step = self._before[key]
            if edge.stutters:
                step = sets.either(step, sets.both(sets.space.deadlocks, targets))
            found.append(sets.both(edge.markings, step))
        return sets.either(*found)


def _where(sets: Sets[S], atoms: Iterable[Formula]) -> S:
    return sets.both(*(sets.of(atom) for atom in sorted(atoms, key=repr)))


def firings_of(net: Net, fires: frozenset[str], spared: frozenset[str]) -> frozenset[int] | None:
    """The transitions that an edge admits, one at a time: None for all of them."""
    if not fires and not spared:
        return None
    admitted = {t.name for t in net.transitions} if not fires else set(fires) if len(fires) == 1 else set()
    return frozenset(net.transition_index[name] for name in admitted - spared)


def components(targets: list[list[int]]) -> tuple[tuple[int, ...], ...]:
    """The strongly connected components of a small graph, each after those that it leads to (Tarjan 1972)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[tuple[int, ...]] = []
    for root in range(len(targets)):
        if root in index:
            continue
        work = [(root, iter(targets[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        while work:
            node, rest = work[-1]
            following = next(rest, None)
            if following is None:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    at = stack.index(node)
                    found.append(tuple(sorted(stack[at:])))
                    del stack[at:]
            elif following not in index:
                index[following] = low[following] = len(index)
                stack.append(following)
                work.append((following, iter(targets[following])))
            elif following in stack:
                low[node] = min(low[node], index[following])
    return tuple(found)
