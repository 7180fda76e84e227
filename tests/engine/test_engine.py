"""The engine against the definitions: an explorer written here from SEMANTICS, and networkx for what graphs mean."""

from __future__ import annotations

import itertools
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import networkx as nx
import numpy as np
import pytest
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


@both
def test_graph_is_the_one_of_the_definition(net: Drawn, step: bool) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    masks = [graph.marking(i) for i in range(graph.n_markings)]
    assert len(set(masks)) == len(masks) == graph.n_markings == len(graph)
    assert masks[0] == naive.start
    assert set(masks) == set(naive.graph)
    assert [graph.find(m) for m in masks] == list(range(len(masks)))
    fired = [0] * len(net.rows)
    for i, m in enumerate(masks):
        edges = graph.successors(i)
        assert {(frozenset(f), masks[j]) for f, j in edges} == naive.graph[m]
        assert len(edges) == len(naive.graph[m])
        assert all(f == sorted(f) for f, _ in edges)
        for f, _ in edges:
            for t in f:
                fired[t] += 1
    assert graph.n_edges == sum(len(edges) for edges in naive.graph.values())
    assert graph.fired() == fired
    assert graph.deadlocks() == [i for i, m in enumerate(masks) if not naive.may_fire(m)]
    distances = [naive.distance[m] for m in masks]
    assert distances == sorted(distances)
    assert graph.n_levels == distances[-1] + 1


@both
def test_contacts_and_joint_firability_are_counted_over_reachable_markings(net: Drawn, step: bool) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    masks = [graph.marking(i) for i in range(graph.n_markings)]
    for t, count in enumerate(graph.contacts()):
        touching = [i for i, m in enumerate(masks) if naive.contact(t, m)]
        assert count == len(touching)
        assert graph.contact_witness(t) == (touching[0] if touching else None)
    pairs = [(t, u) for t in range(len(net.rows)) for u in range(len(net.rows))]
    for (t, u), lowest in zip(pairs, graph.effective_conflicts(pairs), strict=True):
        together = [i for i, m in enumerate(masks) if naive.firable(t, m) and naive.firable(u, m)]
        assert lowest == (together[0] if together else None)


@both
def test_sequences_replay_and_are_shortest(net: Drawn, step: bool) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    for i in range(graph.n_markings):
        sequence = graph.path_to(i)
        assert replayed(naive, naive.start, sequence) == graph.marking(i)
        assert len(sequence) == naive.distance[graph.marking(i)]


@examples(125)
@given(net=nets(), step=st.booleans(), data=st.data())
def test_paths_within_a_set_are_those_of_networkx(net: Drawn, step: bool, data: st.DataObject) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    everything = digraph(graph)
    indexes = st.integers(0, graph.n_markings - 1)
    start = data.draw(indexes)
    targets = data.draw(st.sets(indexes, max_size=2))
    within = data.draw(st.one_of(st.just(set(everything)), st.sets(indexes)))
    allowed: nx.DiGraph[int] = nx.DiGraph(everything)
    allowed.remove_edges_from([(i, j) for i, j in everything.edges if i not in within or i in targets])
    lengths = nx.single_source_shortest_path_length(allowed, start)
    found = graph.path_between(start, sorted(targets), bitmap(graph, within))
    if not targets & set(lengths):
        assert found is None
    else:
        assert found is not None
        sequence, reached = found
        assert reached in targets
        assert replayed(naive, graph.marking(start), sequence) == graph.marking(reached)
        assert len(sequence) == min(lengths[i] for i in targets if i in lengths)
    can = set(targets)
    for target in targets:
        can |= nx.ancestors(allowed, target)
    assert graph.backward(bitmap(graph, targets), sorted(within)) == bitmap(graph, can)


@examples(63)
@given(net=nets(), step=st.booleans(), data=st.data())
def test_one_edge_back_is_that_of_the_definition(net: Drawn, step: bool, data: st.DataObject) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    targets = data.draw(st.sets(st.integers(0, graph.n_markings - 1)))
    by = data.draw(st.sets(st.sampled_from(range(len(net.rows))))) if net.rows else set()
    into = {graph.marking(i) for i in targets}
    fired_into = [
        [fired for fired, after in naive.graph[graph.marking(i)] if after in into] for i in range(graph.n_markings)
    ]
    assert graph.before(bitmap(graph, targets)) == bytes(bool(edges) for edges in fired_into)
    assert graph.before(sorted(targets), sorted(by)) == bytes(any(f & by for f in edges) for edges in fired_into)
    within = data.draw(st.sets(st.integers(0, graph.n_markings - 1)))
    can, bigger = set(targets), True
    while bigger:
        there = {graph.marking(i) for i in can}
        more = {i for i in within if any(f & by and after in there for f, after in naive.graph[graph.marking(i)])}
        can, bigger = can | more, not more <= can
    assert graph.backward(sorted(targets), sorted(within), sorted(by)) == bitmap(graph, can)


@examples(63)
@given(net=nets(), step=st.booleans(), data=st.data())
def test_endless_runs_are_those_into_cycles_within_the_set(net: Drawn, step: bool, data: st.DataObject) -> None:
    graph = explored(net, step=step)
    everything = digraph(graph)
    within = data.draw(st.one_of(st.none(), st.sets(st.integers(0, graph.n_markings - 1))))
    inside = everything.subgraph(everything if within is None else within)
    endless = {
        i for part in nx.strongly_connected_components(inside) for i in part if inside.subgraph(part).number_of_edges()
    }
    for i in list(endless):
        endless |= nx.ancestors(inside, i)
    assert graph.endless(None if within is None else bitmap(graph, within)) == bitmap(graph, endless)


@examples(63)
@given(net=nets(), step=st.booleans(), data=st.data())
def test_components_are_those_of_networkx(net: Drawn, step: bool, data: st.DataObject) -> None:
    graph = explored(net, step=step)
    everything = digraph(graph)
    within = data.draw(st.one_of(st.none(), st.sets(st.integers(0, graph.n_markings - 1))))
    inside = everything.subgraph(everything if within is None else within)
    components = graph.components(None if within is None else sorted(within))
    of = np.frombuffer(components.of(), "<u4")
    expected = [set(c) for c in nx.strongly_connected_components(inside)]
    found = [set(np.flatnonzero(of == c).tolist()) for c in range(len(components))]
    assert sorted(map(sorted, found)) == sorted(map(sorted, expected))
    assert np.frombuffer(components.sizes(), "<u4").tolist() == [len(c) for c in found]
    assert set(np.flatnonzero(of == 2**32 - 1).tolist()) == set(everything) - set(inside)
    assert all(of[i] >= of[j] for i, j in inside.edges)
    for members, bottom, trivial in zip(found, components.bottom(), components.trivial(), strict=True):
        assert bottom == (not any(j not in members for i in members for j in inside.successors(i)))
        assert trivial == (not any(j in members for i in members for j in inside.successors(i)))


@both
def test_live_home_and_reversible_follow_from_reachability(net: Drawn, step: bool) -> None:
    naive, graph = Naive(net, step=step), explored(net, step=step)
    everything = digraph(graph)
    reach = {i: nx.descendants(everything, i) | {i} for i in everything}
    fires = {i: {t for f, _ in naive.graph[graph.marking(i)] for t in f} for i in everything}
    for t, live in enumerate(graph.live()):
        assert live == all(any(t in fires[j] for j in reach[i]) for i in everything)
    assert graph.reversible() == all(0 in reach[i] for i in everything)
    home = {j for j in everything if all(j in reach[i] for i in everything)}
    assert graph.home_markings() == bitmap(graph, home)
    nearest = next(i for i in everything if all(i in reach[j] for j in reach[i]))
    assert graph.bottom() == bitmap(graph, reach[nearest])


@both
def test_edges_and_markings_as_columns_are_the_same_graph(net: Drawn, step: bool) -> None:
    graph = explored(net, step=step)
    offsets, targets = (np.frombuffer(part, kind) for part, kind in zip(graph.edges(), ["<u8", "<u4"], strict=True))
    assert len(targets) == graph.n_edges
    words = np.frombuffer(graph.markings_bytes(), "<u8").reshape(graph.n_markings, graph.words)
    for i in range(graph.n_markings):
        assert targets[offsets[i] : offsets[i + 1]].tolist() == [j for _, j in graph.successors(i)]
        assert sum(int(word) << 64 * k for k, word in enumerate(words[i])) == graph.marking(i)


def machines(count: int, *, pad: int = 0, gated: bool = False) -> Drawn:
    """Independent machines, each idle or busy; gated ones start and end when their own signal says so."""
    rows: list[Row] = []
    for i in range(count):
        idle, busy = pad + 2 * i, pad + 2 * i + 1
        gate = [(i, True)] if gated else []
        rows += [([idle], [busy], [], [], gate), ([busy], [idle], [], [], gate)]
    return Drawn(pad + 2 * count, rows, [pad + 2 * i for i in range(count)])


@pytest.mark.parametrize("pad", [0, 40, 100, 170, 230, 400, 480, 1000])
def test_independent_machines_multiply_at_every_width(pad: int) -> None:
    graph = explored(machines(13, pad=pad), step=False)
    assert (graph.n_markings, graph.n_edges, graph.n_levels) == (2**13, 13 * 2**13, 14)
    assert graph.live() == [True] * 26
    assert graph.reversible()
    last = graph.find(mask([pad + 2 * i + 1 for i in range(13)]))
    assert last == 2**13 - 1
    assert sorted(t for [t] in graph.path_to(last)) == [2 * i for i in range(13)]


def test_machines_with_a_signal_each_step_in_every_combination() -> None:
    graph = explored(machines(8, gated=True), step=True)
    assert (graph.n_markings, graph.n_edges, graph.n_levels) == (2**8, 2**8 * (2**8 - 1), 2)
    assert graph.fired() == [2**7 * 2**7] * 16
    assert graph.reversible()
    assert graph.live() == [True] * 16


def test_a_random_coupled_net_of_several_batches_agrees_with_the_definition() -> None:
    rng = np.random.default_rng(7)
    for pad in (0, 90):
        net = machines(9, pad=pad)
        for inputs, outputs, permissive, inhibitive, _ in net.rows:
            free = [pad + p for p in range(18) if pad + p not in {*inputs, *outputs}]
            (permissive if rng.random() < 0.5 else inhibitive).append(int(rng.choice(free)))
        naive, graph = Naive(net, step=False), explored(net, step=False)
        assert graph.n_markings == len(naive.graph) > 64
        assert {graph.marking(i) for i in range(graph.n_markings)} == set(naive.graph)
        assert graph.n_edges == sum(map(len, naive.graph.values()))
        can = graph.backward([0])
        assert sum(can) == 1 + len(nx.ancestors(digraph(graph), 0))


def test_many_conflicts_on_one_place_give_one_step_each() -> None:
    rows: list[Row] = [([0], [i], [], [], []) for i in range(1, 101)]
    graph = explored(Drawn(101, rows, [0]), step=True)
    assert (graph.n_markings, graph.n_edges) == (101, 100)


def test_a_budget_that_runs_out_is_said_and_nothing_is_concluded_from_the_part() -> None:
    net = machines(14)
    stopped = {
        "markings": explore(net, max_markings=50),
        "memory": explore(net, max_memory_bytes=20_000),
        "time": explore(net, max_seconds=0.0),
    }
    for reason, graph in stopped.items():
        assert (graph.complete, graph.reason) == (False, reason)
        assert 0 < graph.n_markings < 2**14
        for question in (
            graph.live,
            graph.reversible,
            graph.home_markings,
            graph.components,
            graph.edges,
        ):
            with pytest.raises(_engine.IncompleteGraph, match=reason):
                question()
        with pytest.raises(_engine.IncompleteGraph, match=reason):
            graph.backward([0])
        assert graph.effective_conflicts([(0, 2), (0, 1)]) == [0, None]
        with pytest.raises(_engine.BudgetExceeded if reason == "memory" else _engine.IncompleteGraph):
            graph.path_between(1, [])
        last = graph.n_markings - 1
        assert len(graph.path_to(last)) == sum(graph.marking(last) >> (2 * i + 1) & 1 for i in range(14)) > 0
    graph = explore(net, max_markings=2**14)
    assert graph.complete


def test_memory_held_stays_within_the_budget_and_is_stated() -> None:
    net = machines(14)
    graph = explore(net, max_memory_bytes=1 << 20)
    assert graph.complete
    assert 8 + 4 < graph.bytes_per_marking < 20
    assert graph.memory_bytes == pytest.approx(graph.bytes_per_marking * graph.n_markings)
    tight = explore(net, max_memory_bytes=1 << 17)
    assert not tight.complete
    assert tight.memory_bytes <= 1 << 17
    enough = explore(net, max_memory_bytes=graph.memory_bytes + 200_000)
    assert enough.complete
    with pytest.raises(_engine.BudgetExceeded):
        enough.edges()
    with pytest.raises(_engine.BudgetExceeded):
        explore(net, max_memory_bytes=100)


def test_an_exploding_step_component_ends_with_a_reason() -> None:
    # Maximal sets of a ladder of conflicts grow exponentially, all of them within one component of one marking.
    rows: list[Row] = [([i, i + 1], [200 + i], [], [], []) for i in range(100)]
    net = Drawn(300, rows, list(range(101)))
    stopped = {
        "time": explore(net, step=True, max_seconds=0.05),
        "memory": explore(net, step=True, max_memory_bytes=1 << 20),
    }
    for reason, graph in stopped.items():
        assert (graph.complete, graph.reason, graph.n_markings) == (False, reason, 1)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_gives_what_is_known_so_far() -> None:
    net = machines(26)
    timer = threading.Timer(0.2, signal.raise_signal, [signal.SIGINT])
    timer.start()
    try:
        graph = explore(net, max_markings=1 << 26)
    finally:
        timer.cancel()
    assert (graph.complete, graph.reason) == (False, "interrupted")
    assert graph.n_markings > 1


@pytest.mark.usefixtures("interruptible")
def test_what_a_signal_handler_raises_is_not_swallowed() -> None:
    class StopEverythingError(Exception):
        pass

    def handler(*_: object) -> None:
        raise StopEverythingError

    net = machines(26)
    before = signal.signal(signal.SIGINT, handler)
    timer = threading.Timer(0.2, signal.raise_signal, [signal.SIGINT])
    timer.start()
    try:
        with pytest.raises(StopEverythingError):
            explore(net, max_markings=1 << 26)
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)


def test_an_exploration_that_is_cancelled_is_incomplete_and_tells_how_far_it_is() -> None:
    told: list[tuple[int, int]] = []
    graph = _engine.explore(
        52,
        machines(26).rows,
        machines(26).initial,
        max_markings=1 << 26,
        max_memory_bytes=1 << 30,
        max_seconds=None,
        cancelled=lambda: len(told) == 3,
        progress=lambda markings, edges: told.append((markings, edges)),
    )
    assert (graph.complete, graph.reason) == (False, "cancelled")
    assert 0 < told[0][0] < told[1][0] < told[2][0] <= graph.n_markings
    assert 0 < told[0][1] < told[1][1] < told[2][1] <= graph.n_edges


def test_what_a_callable_raises_is_not_swallowed() -> None:
    def fails(*_: int) -> bool:
        raise LookupError

    graph = explored(machines(16), step=False)
    with pytest.raises(LookupError):
        graph.edges(cancelled=fails)
    for role in ("cancelled", "progress"):
        with pytest.raises(LookupError):
            _engine.explore(
                32,
                machines(16).rows,
                machines(16).initial,
                max_markings=1 << 26,
                max_memory_bytes=1 << 30,
                max_seconds=None,
                **{role: fails},  # type: ignore[arg-type]
            )


@pytest.mark.parametrize("step", [False, True])
def test_every_long_question_ends_by_the_clock_and_when_cancelled(step: bool) -> None:
    # Under steps without gates every machine moves, so a signal each; 2^9 markings then have 2^18 edges.
    def lasting() -> _engine.Graph:
        return explored(machines(9, gated=True) if step else machines(16), step=step)

    graph = lasting()
    far = bytes(graph.n_markings - 1) + b"\1"
    never = bytes(graph.n_markings)
    questions: list[Callable[..., object]] = [
        lambda **limits: graph.backward(far, **limits),
        lambda **limits: lasting().components(**limits),
        lambda **limits: lasting().live(**limits),
        lambda **limits: lasting().reversible(**limits),
        lambda **limits: lasting().home_markings(**limits),
        lambda **limits: graph.edges(**limits),
        lambda **limits: graph.path_between(0, never, **limits),
        lambda **limits: graph.before(bytes(len(far) * [1]), **limits),
        lambda **limits: graph.endless(**limits),
        lambda **limits: graph.endless(bytes(len(far) * [1]), **limits),
    ]
    for ask in questions:
        with pytest.raises(_engine.BudgetExceeded, match="max_seconds"):
            ask(max_seconds=0.0)
        with pytest.raises(_engine.BudgetExceeded, match="cancelled"):
            ask(cancelled=lambda: True)
        ask(max_seconds=600.0, cancelled=lambda: False)
    with pytest.raises(ValueError, match="not a time"):
        graph.edges(max_seconds=-1.0)


def test_the_empty_net_has_one_marking_which_is_a_deadlock() -> None:
    graph = explored(Drawn(0, [], []), step=False)
    assert (graph.n_markings, graph.n_edges, graph.deadlocks(), graph.live(), graph.reversible()) == (
        1,
        0,
        [0],
        [],
        True,
    )
    assert graph.find(1) is None
    assert len(graph.components()) == 1


def test_a_transition_without_arcs_is_an_edge_to_the_same_marking() -> None:
    graph = explored(Drawn(1, [([], [], [], [], [])], []), step=False)
    assert (graph.n_markings, graph.n_edges, graph.deadlocks(), graph.live()) == (1, 1, [], [True])
    assert graph.components().trivial() == b"\0"


def test_an_index_that_does_not_exist_is_refused() -> None:
    graph = explored(machines(2), step=False)
    for call in (graph.marking, graph.successors, graph.path_to, graph.contact_witness):
        with pytest.raises(IndexError):
            call(99)
    with pytest.raises(ValueError, match="one byte for each"):
        graph.backward(b"\1")
    with pytest.raises(IndexError):
        graph.backward([99])
    with pytest.raises(ValueError, match="not a negative"):
        graph.find(-1)
    with pytest.raises(ValueError, match="place 7"):
        explore(Drawn(3, [([7], [], [], [], [])], []))
    with pytest.raises(ValueError, match="max_seconds"):
        explore(Drawn(3, [], []), max_seconds=-1.0)
    assert graph.find(1 << 200) is None


def test_a_ring_of_three_thousand_places_needs_no_deep_stack() -> None:
    n = 3000
    rows: list[Row] = [([i], [(i + 1) % n], [], [], []) for i in range(n)]
    for step in (False, True):
        graph = explored(Drawn(n, rows, [0]), step=step)
        assert (graph.n_markings, graph.n_edges, graph.reversible()) == (n, n, True)
        assert graph.path_to(n - 1) == [[i] for i in range(n - 1)]
