"""What is asked of a graph, against the definitions: what leads where, what is kept for it, and fair runs."""

from __future__ import annotations

import contextlib
import itertools

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.engine_nets import Drawn, Naive, Row, bitmap, both, digraph, explore, explored, nets, replayed
from support.examples import examples

from firable.analysis import _engine


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


OFTEN = 8
"""After so many questions that go against all edges each of them was tried so often that all are kept."""
RARELY = 2
"""After so many none are kept yet."""


def asked_again(graph: _engine.Graph, often: int = 1, within: bytes | None = None) -> int:
    """Go against all edges so often, anywhere or within a set; the bytes held then."""
    for _ in range(often):
        graph.backward(bytes([1] * graph.n_markings), within)
    return graph.memory_bytes


def indexed(graph: _engine.Graph) -> int:
    """The bytes that are held where a question has looked up markings and no edges are kept."""
    graph.endless()
    return graph.memory_bytes


def on_and_off(place: int) -> tuple[Row, Row]:
    """A machine of two places."""
    return ([place], [place + 1], [], [], []), ([place + 1], [place], [], [], [])


def turned_round(graph: _engine.Graph) -> int:
    """The bytes of all edges turned round."""
    return 4 * graph.n_edges + 8 * (graph.n_markings + 1)


def condensed(graph: _engine.Graph) -> int:
    """The bytes of the components, and of the edges from one to another."""
    everything: nx.DiGraph[int] = nx.DiGraph()
    everything.add_nodes_from(range(graph.n_markings))
    edges = [(i, j) for i in range(graph.n_markings) for _, j in graph.successors(i)]
    everything.add_edges_from(edges)
    of = {i: c for c, part in enumerate(nx.strongly_connected_components(everything)) for i in part}
    count = len(set(of.values()))
    return 4 * graph.n_markings + 6 * count + 8 * (count + 1) + 4 * sum(of[i] != of[j] for i, j in edges)


@examples(125)
@given(net=nets(), step=st.booleans(), data=st.data())
def test_edges_that_are_kept_answer_as_those_that_are_computed_again(
    net: Drawn, step: bool, data: st.DataObject
) -> None:
    first, second = explored(net, step=step), explored(net, step=step)
    held = first.memory_bytes if step else indexed(first) - 4 * first.n_markings  # how many edges leave each
    anywhere = asked_again(second, OFTEN)
    inside = asked_again(second, OFTEN, bytes([1] * second.n_markings))
    indexes = st.integers(0, first.n_markings - 1)
    for within in (None, None, *data.draw(st.lists(st.sets(indexes).map(sorted), min_size=2, max_size=2))):
        targets = bitmap(first, data.draw(st.sets(indexes, min_size=1, max_size=2)))
        assert second.backward(targets, within) == explored(net, step=step).backward(targets, within)
        assert second.before(targets) == first.before(targets)
    if step or second.n_edges:
        assert (anywhere - held, inside - anywhere) == (condensed(second), turned_round(second))
    assert second.bytes_per_marking == first.bytes_per_marking


def test_edges_are_kept_in_the_middle_of_a_search_that_tries_many_in_vain() -> None:
    # Ten machines, and from either place of each nine more ways, which also take a token that nothing brings.
    rows: list[Row] = [row for i in range(0, 20, 2) for row in on_and_off(i)]
    vain: list[Row] = [([*takes, 20], puts, [], [], []) for takes, puts, *_ in rows]
    net = Drawn(21, rows + 9 * vain, list(range(0, 20, 2)))
    for within, kept in ((None, condensed), (bytes([1] * 2**10), turned_round)):
        graph = explored(net, step=False)
        held = indexed(graph)
        assert graph.backward([0], within) == bytes([1] * graph.n_markings)
        assert graph.memory_bytes == held + kept(graph)


def test_of_a_graph_known_to_be_one_component_nothing_is_kept() -> None:
    rows = [row for i in range(0, 20, 2) for row in on_and_off(i)]
    graph = explored(Drawn(20, rows, list(range(0, 20, 2))), step=False)
    assert graph.reversible()
    held = graph.memory_bytes
    assert asked_again(graph, OFTEN) == held
    assert graph.backward([7]) == bytes([1] * graph.n_markings)
    assert graph.backward([]) == bytes(graph.n_markings)


def test_edges_that_do_not_fit_are_computed_again() -> None:
    rows = [row for i in range(0, 20, 2) for row in on_and_off(i)]
    net = Drawn(20, rows, list(range(0, 20, 2)))
    roomy, tight = explore(net, max_memory_bytes=1 << 20), explore(net, max_memory_bytes=90_000)
    assert roomy.complete
    assert tight.complete
    once = roomy.backward([0])
    for within, kept in ((None, condensed), (bytes([1] * 2**10), turned_round)):
        held = indexed(roomy), indexed(tight)
        assert (asked_again(roomy, OFTEN, within), asked_again(tight, OFTEN, within)) == (
            held[0] + kept(roomy),
            held[1],
        )
        assert roomy.backward([0], within) == tight.backward([0], within) == once


FAIRNESS = ("none", "weak", "strong")


def fair_sets(net: Drawn, graph: _engine.Graph, within: set[int], fairness: str, *, step: bool) -> list[set[int]]:
    """The sets of markings that a fair run can go through for ever, again and again, by the definition."""
    naive = Naive(net, step=step)
    edges = {i: [(f, graph.find(after)) for f, after in naive.graph[graph.marking(i)]] for i in within}
    found = []
    for size in range(1, len(within) + 1):
        for chosen in map(set, itertools.combinations(sorted(within), size)):
            inside = [(i, f, j) for i in chosen for f, j in edges[i] if j in chosen]
            part: nx.DiGraph[int] = nx.DiGraph()
            part.add_nodes_from(chosen)
            part.add_edges_from((i, j) for i, _, j in inside)
            if not inside or not nx.is_strongly_connected(part):
                continue
            enabled = [set(naive.may_fire(graph.marking(i))) for i in chosen]
            owed = {"none": set[int](), "weak": set.intersection(*enabled), "strong": set.union(*enabled)}[fairness]
            if owed <= {t for _, f, _ in inside for t in f}:
                found.append(chosen)
    return found


@examples(125)
@given(net=nets(), step=st.booleans(), fairness=st.sampled_from(FAIRNESS), data=st.data())
def test_fair_components_are_the_largest_sets_that_a_fair_run_goes_through(
    net: Drawn, step: bool, fairness: str, data: st.DataObject
) -> None:
    graph = explored(net, step=step)
    within = data.draw(st.sets(st.integers(0, graph.n_markings - 1), max_size=8))
    of = np.frombuffer(graph.fair(sorted(within), fairness), "<u4")
    found = [set(np.flatnonzero(of == c).tolist()) for c in set(of.tolist()) - {2**32 - 1}]
    fair = fair_sets(net, graph, within, fairness, step=step)
    largest = [one for one in fair if not any(one < other for other in fair)]
    assert sorted(map(sorted, found)) == sorted(map(sorted, largest))


def test_under_strong_fairness_a_component_is_looked_into_more_than_once() -> None:
    # a and b to and fro, from b to c and back to a, and from c to a dead end: c must be left out, and then b.
    rows: list[Row] = [
        ([0], [1], [], [], []),
        ([1], [0], [], [], []),
        ([1], [2], [], [], []),
        ([2], [0], [], [], []),
        ([2], [3], [], [], []),
    ]
    graph = explored(Drawn(4, rows, [0]), step=False)
    everything = bytes([1] * graph.n_markings)
    of = {fairness: np.frombuffer(graph.fair(everything, fairness), "<u4") for fairness in FAIRNESS}
    assert [int((of[fairness] != 2**32 - 1).sum()) for fairness in FAIRNESS] == [3, 3, 0]


def test_fairness_that_does_not_exist_is_refused_and_a_part_of_a_graph_answers_nothing() -> None:
    net = Drawn(2, [([0], [1], [], [], []), ([1], [0], [], [], [])], [0])
    with pytest.raises(ValueError, match="none, weak or strong, not 'some'"):
        explored(net, step=False).fair([0], "some")
    part = explore(net, max_markings=1)
    with pytest.raises(_engine.IncompleteGraph, match="that a fair run can go on for ever"):
        part.fair([0], "weak")


def test_edges_that_are_kept_leave_room_for_those_that_a_question_stores() -> None:
    rows = [row for i in range(0, 20, 2) for row in on_and_off(i)]
    net = Drawn(20, rows, list(range(0, 20, 2)))
    everything = explored(net, step=False)
    size, within = turned_round(everything), bytes([1] * everything.n_markings)
    for room, inside in itertools.product(range(1, 9), (None, within)):
        graph = explore(net, max_memory_bytes=90_000 + room * size)
        held = indexed(graph)
        is_kept = asked_again(graph, OFTEN, inside) > held
        assert is_kept == (90_000 + room * size - held >= 6 * size)
        if room >= 3:
            assert set(np.frombuffer(graph.fair(within, "strong"), "<u4").tolist()) == {0}


def test_edges_are_not_stored_where_that_would_take_the_time_of_the_question() -> None:
    rows = [row for i in range(0, 24, 2) for row in on_and_off(i)]
    graph = explored(Drawn(24, rows, list(range(0, 24, 2))), step=False)
    held = asked_again(graph, RARELY)
    late = graph.seconds  # of the four times as much that storing may take
    with contextlib.suppress(_engine.BudgetExceeded):
        graph.backward([0], max_seconds=late)
    assert graph.memory_bytes == held
    assert asked_again(graph) > held
