"""The engine against the definitions: an explorer written from SEMANTICS, budgets, and all that can end it early."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable

import networkx as nx
import numpy as np
import pytest
from support.engine_nets import Drawn, Naive, Row, both, digraph, explore, explored, mask, replayed

from firable.analysis import _engine


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
        lambda **limits: lasting().live(**limits),
        lambda **limits: lasting().reversible(**limits),
        lambda **limits: lasting().home_markings(**limits),
        lambda **limits: graph.edges(**limits),
        lambda **limits: graph.path_between(0, never, **limits),
        lambda **limits: graph.before(bytes(len(far) * [1]), **limits),
        lambda **limits: graph.endless(**limits),
        lambda **limits: graph.fair(bytes(len(far) * [1]), "strong", **limits),
        lambda **limits: graph.endless(bytes(len(far) * [1]), **limits),
    ]
    for ask in questions:
        with pytest.raises(_engine.BudgetExceeded, match="the time was over"):
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


def test_a_transition_without_arcs_is_an_edge_to_the_same_marking() -> None:
    graph = explored(Drawn(1, [([], [], [], [], [])], []), step=False)
    assert (graph.n_markings, graph.n_edges, graph.deadlocks(), graph.live()) == (1, 1, [], [True])


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
