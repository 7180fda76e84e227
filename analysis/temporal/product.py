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

Rejected: nested depth-first search over pairs of single markings. It is better where the first lasso is near, but it
has no counterpart on a decision diagram, and markings one by one are slow in Python.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
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
                by = _firings(net, edge.fires, edge.spared)
                possible = by is None or by or not edge.fires
                if possible and not sets.empty(markings):
                    row.append(ProductEdge(markings, by, not edge.fires, edge.target, edge.marks))
            rows.append(tuple(row))
        return cls(sets, tuple(rows), automaton.n_marks)

    def back(self, edge: ProductEdge[S], pairs: Pairs[S], seen: dict[object, S]) -> S:
        """The markings from which the edge leads into the pairs; `seen` remembers steps back to the same set."""
        targets = pairs.get(edge.target)
        if targets is None:
            return self.sets.none
        if self.sets.space.deadline.over:
            raise TimeEndedError
        key = (edge.target, edge.by)
        if key not in seen:
            seen[key] = self.sets.before(targets, edge.by)
        before = seen[key]
        if edge.stutters:
            before = self.sets.either(before, self.sets.both(self.sets.space.deadlocks, targets))
        return self.sets.both(edge.markings, before)

    def step(self, state: int, pairs: Pairs[S], mark: int | None = None) -> S:
        """The markings with which the state has an edge (with the mark, if it is given) into the pairs."""
        seen: dict[object, S] = {}
        edges = (edge for edge in self.edges[state] if mark is None or mark in edge.marks)
        return self.sets.either(*(self.back(edge, pairs, seen) for edge in edges))

    @cached_property
    def parts(self) -> tuple[tuple[int, ...], ...]:
        """The strongly connected parts of the automaton, each after all that it leads to."""
        return _components([[edge.target for edge in edges] for edges in self.edges])

    def reaching(self, goal: Pairs[S], within: Pairs[S] | None = None) -> Pairs[S]:
        """The pairs from which a pair of the goal can be reached, going only through `within`."""
        found: Pairs[S] = {}
        for part in self.parts:
            inside = [state for state in part if within is None or state in within]
            for state in inside:
                found[state] = goal.get(state, self.sets.none)
            waiting = dict.fromkeys(inside)
            while waiting:
                state = next(iter(waiting))
                del waiting[state]
                old = self.sets.space.count(found[state])
                base = self.sets.either(found[state], self._within(state, self.step(state, found), within))
                found[state] = self._through(state, base, within)
                if self.sets.space.count(found[state]) != old:
                    others = (s for s in inside if any(edge.target == state for edge in self.edges[s]))
                    waiting.update(dict.fromkeys(others))
        return found

    def _within(self, state: int, markings: S, within: Pairs[S] | None) -> S:
        return markings if within is None else self.sets.both(markings, within[state])

    def _through(self, state: int, targets: S, within: Pairs[S] | None) -> S:
        """The markings that lead to the targets while the automaton stays in the state, whatever fires."""
        own = [edge.markings for edge in self.edges[state] if edge.target == state and edge.by is None]
        if not own:
            return targets
        return self.sets.until(self._within(state, self.sets.either(*own), within), targets)

    def fair(self) -> Pairs[S]:
        """The pairs from which a run can be accepted without leaving its part of the automaton."""
        found: Pairs[S] = {}
        for part in self.parts:
            inside = set(part)
            own = [(state, edge) for state in part for edge in self.edges[state] if edge.target in inside]
            if own and all(any(mark in edge.marks for _, edge in own) for mark in range(self.n_marks)):
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
        marks = [
            mark for mark in range(self.n_marks) if any(mark not in e.marks for edges in own.values() for e in edges)
        ]
        size = -1
        while (now := sum(map(self.sets.space.count, pairs.values()))) != size:
            size = now
            for mark in marks:
                goal = {state: self._marked_step(state, own[state], pairs, mark) for state in part}
                pairs = self._closed(part, own, goal, pairs)
            if not marks:
                pairs = {state: self._marked_step(state, own[state], pairs, None) for state in part}
        return pairs

    def _marked_step(self, state: int, own: list[ProductEdge[S]], pairs: Pairs[S], mark: int | None) -> S:
        seen: dict[object, S] = {}
        steps = (self.back(edge, pairs, seen) for edge in own if mark is None or mark in edge.marks)
        return self.sets.both(self.sets.either(*steps), pairs[state])

    def _closed(
        self, part: tuple[int, ...], own: dict[int, list[ProductEdge[S]]], goal: Pairs[S], within: Pairs[S]
    ) -> Pairs[S]:
        """The pairs of the part from which the goal can be reached within the part and these pairs."""
        found = dict(goal)
        waiting = dict.fromkeys(part)
        while waiting:
            state = next(iter(waiting))
            del waiting[state]
            old = self.sets.space.count(found[state])
            seen: dict[object, S] = {}
            steps = self.sets.either(*(self.back(edge, found, seen) for edge in own[state]))
            base = self.sets.either(found[state], self.sets.both(steps, within[state]))
            found[state] = self._through(state, base, within)
            if self.sets.space.count(found[state]) != old:
                waiting.update(dict.fromkeys(s for s in part if any(edge.target == state for edge in own[s])))
        return found


def _where(sets: Sets[S], atoms: Iterable[Formula]) -> S:
    return sets.both(*(sets.of(atom) for atom in sorted(atoms, key=repr)))


def _firings(net: Net, fires: frozenset[str], spared: frozenset[str]) -> frozenset[int] | None:
    """The transitions that an edge admits, one at a time: None for all of them."""
    if not fires and not spared:
        return None
    admitted = {t.name for t in net.transitions} if not fires else set(fires) if len(fires) == 1 else set()
    return frozenset(net.transition_index[name] for name in admitted - spared)


def _components(targets: list[list[int]]) -> tuple[tuple[int, ...], ...]:
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
