"""Equivalence of reachability graphs: isomorphism, and weak bisimilarity under hiding.

Two questions need it. Is a transformed net the same net, with its markings renamed, as the complement of a place
claims? That is *isomorphism* of graphs whose edges are labelled by transitions. No search is needed: in either
discipline a marking has one successor for each label, so the only candidate is the map that sends M0 to M0 and goes
on along equal labels, and walking both graphs together builds it or finds where it breaks.

Does a detailed net behave like the conceptual one that it refines, when its inner transitions are hidden? That is
*weak bisimilarity* (Milner 1989): hidden firings may come before and after a visible one. Decided by partition
refinement on the saturated graph: markings are told apart by the classes that they can reach weakly, by nothing and
by each visible label, until nothing changes. It does not tell a marking that waits from one that fires hidden
transitions for ever: a deadlock of one net may be an endless hidden loop of the other, which is why deadlock has
verdicts of its own. Saturation costs time and memory in the square of the number of markings: for nets to compare,
not for large ones.
"""

from __future__ import annotations

from collections.abc import Mapping

import networkx as nx

from firable.analysis.spaces.reachability import ReachabilityGraph

Label = frozenset[str]


def isomorphic(a: ReachabilityGraph, b: ReachabilityGraph) -> bool:
    """Whether the graphs are equal up to the names of markings: M0 to M0, edges to edges with the same transitions.

    Raises `IncompleteGraph` where one of them is not whole. Cost: one pass over both.
    """
    a.require_complete()
    b.require_complete()
    if (a.n_markings, a.n_edges) != (b.n_markings, b.n_edges):
        return False
    image, origin, todo = {0: 0}, {0: 0}, [0]
    while todo:
        left = todo.pop()
        edges, others = _labelled(a, left), _labelled(b, image[left])
        if edges.keys() != others.keys():
            return False
        for label, target in edges.items():
            other = others[label]
            if target not in image and other not in origin:
                image[target], origin[other] = other, target
                todo.append(target)
            elif image.get(target) != other:
                return False
    return True


def _labelled(graph: ReachabilityGraph, index: int) -> dict[Label, int]:
    names = [transition.name for transition in graph.net.transitions]
    return {frozenset(names[t] for t in fired): target for fired, target in graph.successors(index)}


def weakly_bisimilar(
    a: ReachabilityGraph, b: ReachabilityGraph, visible_a: Mapping[str, str], visible_b: Mapping[str, str]
) -> bool:
    """Whether the initial markings are weakly bisimilar, where only some transitions are visible.

    `visible_a` and `visible_b` give the label of each visible transition; the others are hidden. Under steps the
    label is the set of labels of a step's visible transitions, and a step without any is hidden.

    Raises `IncompleteGraph` where one of the graphs is not whole.
    """
    a.require_complete()
    b.require_complete()
    union: nx.MultiDiGraph[tuple[int, int]] = nx.MultiDiGraph()
    for side, graph, visible in ((0, a, visible_a), (1, b, visible_b)):
        for index in range(graph.n_markings):
            union.add_node((side, index))
            for label, target in _labelled(graph, index).items():
                seen = frozenset(visible[name] for name in label if name in visible)
                union.add_edge((side, index), (side, target), label=seen)
    weak = _saturated(union)
    block = dict.fromkeys(weak, 0)
    n_blocks = 1
    while True:
        signatures: dict[tuple[int, frozenset[tuple[Label, int]]], int] = {}
        refined = {}
        for node, moves in weak.items():
            signature = (block[node], frozenset((label, block[target]) for label, target in moves))
            refined[node] = signatures.setdefault(signature, len(signatures))
        block = refined
        if len(signatures) == n_blocks:
            return block[0, 0] == block[1, 0]
        n_blocks = len(signatures)


def _saturated(
    graph: nx.MultiDiGraph[tuple[int, int]],
) -> dict[tuple[int, int], set[tuple[Label, tuple[int, int]]]]:
    """The weak moves of each marking: hidden ones only (the empty label), or hidden, one visible, hidden."""
    hidden: nx.DiGraph[tuple[int, int]] = nx.DiGraph()
    hidden.add_nodes_from(graph)
    strong: dict[tuple[int, int], list[tuple[Label, tuple[int, int]]]] = {node: [] for node in graph}
    for source, target, data in graph.edges(data=True):
        label: Label = data["label"]
        if label:
            strong[source].append((label, target))
        else:
            hidden.add_edge(source, target)
    # Markings on one hidden cycle reach the same: one set for each component, from the last component back.
    components = nx.condensation(hidden)
    reach: dict[int, set[tuple[int, int]]] = {}
    for c in reversed(list(nx.topological_sort(components))):
        reach[c] = set(components.nodes[c]["members"]).union(*(reach[d] for d in components.successors(c)))
    after = {node: reach[components.graph["mapping"][node]] for node in graph}
    return {
        node: {(frozenset[str](), target) for target in after[node]}
        | {(label, end) for between in after[node] for label, target in strong[between] for end in after[target]}
        for node in graph
    }
