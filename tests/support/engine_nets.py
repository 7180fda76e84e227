"""Small nets as the engine takes them, drawn at random, and the graphs that they have by the definition."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import networkx as nx
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.analysis import _engine

Row = tuple[list[int], list[int], list[int], list[int], list[tuple[int, bool]]]
Edge = tuple[frozenset[int], int]


@dataclass(frozen=True)
class Drawn:
    n_places: int
    rows: list[Row]
    initial: list[int]


def mask(places: list[int]) -> int:
    return sum(1 << p for p in set(places))


class Naive:
    """Everything by the definition, with no regard to cost."""

    def __init__(self, net: Drawn, *, step: bool) -> None:
        self.rows = net.rows
        self.step = step
        self.start = mask(net.initial)
        self.graph: dict[int, set[Edge]] = {}
        self.distance = {self.start: 0}
        queue = deque([self.start])
        while queue:
            marking = queue.popleft()
            self.graph[marking] = set(self.edges(marking))
            for _, after in self.graph[marking]:
                if after not in self.distance:
                    self.distance[after] = self.distance[marking] + 1
                    queue.append(after)

    def firable(self, t: int, marking: int) -> bool:
        inputs, outputs, permissive, inhibitive, _ = self.rows[t]
        full, empty = mask(inputs) | mask(permissive), mask(outputs) | mask(inhibitive)
        return marking & full == full and not marking & empty

    def contact(self, t: int, marking: int) -> bool:
        inputs, outputs, permissive, inhibitive, _ = self.rows[t]
        full = mask(inputs) | mask(permissive)
        held = marking & full == full and not marking & mask(inhibitive)
        return held and bool(marking & mask(outputs) & ~mask(inputs))

    def openable(self, t: int) -> bool:
        return all((s, not wanted) not in self.rows[t][4] for s, wanted in self.rows[t][4])

    def may_fire(self, marking: int) -> list[int]:
        return [t for t in range(len(self.rows)) if self.firable(t, marking) and self.openable(t)]

    def after(self, marking: int, fired: frozenset[int]) -> int:
        for t in fired:
            marking &= ~mask(self.rows[t][0])
        for t in fired:
            marking |= mask(self.rows[t][1])
        return marking

    def edges(self, marking: int) -> Iterator[Edge]:
        if not self.step:
            for t in self.may_fire(marking):
                yield frozenset([t]), self.after(marking, frozenset([t]))
            return
        signals = sorted({s for row in self.rows for s, _ in row[4]})
        steps: set[frozenset[int]] = set()
        for values in itertools.product([False, True], repeat=len(signals)):
            valuation = dict(zip(signals, values, strict=True))
            enabled = [
                t
                for t in range(len(self.rows))
                if self.firable(t, marking) and all(valuation[s] == wanted for s, wanted in self.rows[t][4])
            ]
            free = [
                frozenset(chosen)
                for size in range(len(enabled) + 1)
                for chosen in itertools.combinations(enabled, size)
                if not any(self.conflict(t, u) for t, u in itertools.combinations(chosen, 2))
            ]
            steps |= {chosen for chosen in free if not any(chosen < other for other in free)}
        for fired in steps - {frozenset()}:
            yield fired, self.after(marking, fired)

    def conflict(self, t: int, u: int) -> bool:
        return bool(mask(self.rows[t][0]) & mask(self.rows[u][0]) or mask(self.rows[t][1]) & mask(self.rows[u][1]))


@st.composite
def nets(draw: st.DrawFn) -> Drawn:
    """Small nets, their places spread over one to several words.

    Most transitions are drawn so that they are firable in M0 or after another, else conflicts hardly ever show.
    """
    count = draw(st.integers(0, 6))
    spread = draw(st.sampled_from([1, 1, 13, 30, 45, 62, 100, 200]))
    everywhere = [p * spread for p in range(count)]
    initial = [p for p in everywhere if draw(st.booleans())]
    empty = [p for p in everywhere if p not in initial]

    def some(places: list[int], most: int) -> list[int]:
        return draw(st.lists(st.sampled_from(places), max_size=most)) if places else []

    def row() -> Row:
        kind = draw(st.integers(0, 4))
        inputs, outputs = {0: (everywhere, everywhere), 1: (empty, initial)}.get(kind, (initial, empty))
        takes, puts = some(inputs, 2), some(outputs, 2)
        gated = draw(st.integers(0, 2)) == 0
        permissive, inhibitive = (
            (some(everywhere + 3 * takes, 2), some(everywhere + 3 * puts, 1)) if gated else ([], [])
        )
        literals = draw(st.lists(st.tuples(st.integers(0, 1), st.booleans()), max_size=2))
        return takes, puts, permissive, inhibitive, literals

    return Drawn(count * spread, [row() for _ in range(draw(st.integers(0, 5)))], initial)


def explore(
    net: Drawn,
    *,
    step: bool = False,
    max_markings: int = 1 << 20,
    max_memory_bytes: int = 1 << 28,
    max_seconds: float | None = None,
) -> _engine.Graph:
    return _engine.explore(
        net.n_places,
        net.rows,
        net.initial,
        step=step,
        max_markings=max_markings,
        max_memory_bytes=max_memory_bytes,
        max_seconds=max_seconds,
    )


def explored(net: Drawn, *, step: bool) -> _engine.Graph:
    graph = explore(net, step=step)
    assert graph.complete
    assert graph.reason is None
    return graph


def both(test: Callable[[Drawn, bool], None]) -> Callable[[], None]:
    """A generated net under either discipline."""
    return examples(125)(given(net=nets(), step=st.booleans())(test))


def digraph(graph: _engine.Graph) -> nx.DiGraph[int]:
    found: nx.DiGraph[int] = nx.DiGraph()
    found.add_nodes_from(range(graph.n_markings))
    found.add_edges_from((i, j) for i in range(graph.n_markings) for _, j in graph.successors(i))
    return found


def replayed(naive: Naive, marking: int, sequence: list[list[int]]) -> int:
    """Fires a sequence, each set of which must be an edge by the definition."""
    for fired in sequence:
        assert (frozenset(fired), naive.after(marking, frozenset(fired))) in naive.graph[marking]
        marking = naive.after(marking, frozenset(fired))
    return marking


def bitmap(graph: _engine.Graph, chosen: set[int]) -> bytes:
    return bytes(i in chosen for i in range(graph.n_markings))
