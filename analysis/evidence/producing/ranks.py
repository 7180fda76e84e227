"""Ranks for a response under fairness, from the components of what waits for the answer.

The markings that wait are those that are reached from a question without an answer on the way. Where a response holds,
no component of them holds a fair run, for a reason that names a transition (`firable.analysis.verdicts.leads_to`): one
that is enabled and never fires in it. Numbering components from the last to the first gives the first number of each
rank; under strong fairness the markings of a component that do not enable its transition are decomposed again, and give
the next number (`firable.analysis.evidence.checking.progress`). Nothing here is trusted.
"""

from __future__ import annotations

from collections.abc import Iterable

import networkx as nx

from firable.analysis.evidence.certificate import Markings, Progress
from firable.analysis.evidence.claims import Claim
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.nets.net import Fairness
from firable.semantics.player import FiringSet

Rank = tuple[int, ...]


def progress(graph: ReachabilityGraph, space: Markings, claim: Claim) -> Progress | None:
    """The ranks that show a response on a complete graph; None where a component gives no reason."""
    asked, answered = graph.satisfying(claim.state_goal), graph.satisfying(claim.then)
    edges: dict[int, list[tuple[FiringSet, int]]] = {}
    enabled: dict[int, frozenset[int]] = {}
    todo = [i for i in range(graph.n_markings) if asked[i] and not answered[i]]
    seen = set(todo)
    while todo:
        i = todo.pop()
        leaving = list(graph.successors(i))
        enabled[i] = frozenset(t for fired, _ in leaving for t in fired)
        edges[i] = [(fired, after) for fired, after in leaving if not answered[after]]
        for _, after in edges[i]:
            if after not in seen:
                seen.add(after)
                todo.append(after)
    ranks, helpful = dict[int, Rank](), dict[Rank, int]()
    pieces: list[tuple[Iterable[int], Rank]] = [(edges, ())]
    while pieces:
        inside, prefix = pieces.pop()
        waiting = set(inside)
        part: nx.DiGraph[int] = nx.DiGraph()
        part.add_nodes_from(sorted(waiting))
        part.add_edges_from((i, after) for i in sorted(waiting) for _, after in edges[i] if after in waiting)
        condensed = nx.condensation(part)
        for number, component in enumerate(reversed(list(nx.topological_sort(condensed)))):
            members, rank = condensed.nodes[component]["members"], (*prefix, number)
            within = [(i, fired) for i in members for fired, after in edges[i] if after in members]
            ranks |= dict.fromkeys(members, rank)
            if not within:
                continue
            t = _helping(claim.fairness, [enabled[i] for i in members], [fired for _, fired in within])
            if t is None:
                return None
            helpful[rank] = t
            if claim.fairness is Fairness.STRONG:
                pieces.append(([i for i in members if t not in enabled[i]], rank))
    names = graph.net.transitions
    return Progress(
        space,
        tuple(ranks.get(i, ()) for i in graph.ascending.tolist()),
        tuple((rank, names[t].name) for rank, t in sorted(helpful.items())),
    )


def _helping(fairness: Fairness, enabled: list[frozenset[int]], fired: list[FiringSet]) -> int | None:
    """A transition that fairness does not allow to be left out for ever in a component that never fires it."""
    fires = {t for label in fired for t in label}
    match fairness:
        case Fairness.WEAK:
            owed = frozenset.intersection(*enabled)
        case Fairness.STRONG:
            owed = frozenset.union(*enabled)
        case _:
            return None
    return min(owed - fires, default=None)
