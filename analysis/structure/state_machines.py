"""State machines with one token each: the token goes round in a graph, and everything is read off the graph.

Where each transition has one input and one output, the net falls into connected parts that know nothing of each other,
and a part with one token is in one place at a time: its graph of places *is* its reachability graph, and all parts
together run as their product. So all verdicts of liveness are decided, both ways, in time linear in the net, however
many markings the product has: a part is live iff its places are strongly connected (Murata 1989, "Petri nets:
properties, analysis and applications", theorem 16), reversible iff those that the token can reach are, and so on. With
several tokens in one part a place may get two, contact sets in, and nothing is said here.

Permissive gates are reads (`firable.analysis.structure.ordinary`): a transition that only reads one place is a state
machine's too, which goes from a place to itself.
"""

from __future__ import annotations

from collections.abc import Iterator

import networkx as nx

from firable.analysis.question import Answer, no, yes
from firable.analysis.structure.ordinary import Ordinary
from firable.nets.net import Net

METHOD = "theorem on state machines (each part holds at most one token)"


def decide_state_machines(net: Net, of: Ordinary) -> dict[str, Answer]:
    """The verdicts on a net of state machines with at most one token each, by name; nothing for any other net."""
    if of.inhibited or not of.transitions or any(len(x) != 1 for x in (*of.inputs, *of.outputs)):
        return {}
    graph: nx.MultiDiGraph[int] = nx.MultiDiGraph()
    graph.add_nodes_from(range(of.n_places))
    graph.add_edges_from((of.inputs[k][0], of.outputs[k][0]) for k in range(len(of.transitions)))
    tokens = [part & of.marked for part in map(frozenset, nx.weakly_connected_components(graph))]
    if any(len(marked) > 1 for marked in tokens):
        return {}
    parts = [_Part(graph, p) for marked in tokens for p in marked]
    reached = {p for part in parts for p in part.reached}
    again = {p for part in parts for p in part.again}
    contradictory = set(range(len(net.transitions))) - set(of.transitions)
    dead = contradictory | {t for k, t in enumerate(of.transitions) if of.inputs[k][0] not in reached}
    nonlive = dead | {t for k, t in enumerate(of.transitions) if of.inputs[k][0] not in again}
    found = {
        "quasi-live": _none_of(net, dead),
        "live": _none_of(net, nonlive),
        "reversible": yes() if all(part.returns for part in parts) else no(),
        "home-markings": yes() if all(part.again for part in parts) else no(),
    }
    if not contradictory:
        found["contact-free"] = yes()
    if any(part.goes_on for part in parts):
        found |= {"deadlock-free": yes(), "doomed-markings": yes()}
    return found


class _Part:
    """Where the token of one part can go: `reached` at all, `again` from wherever it may have gone by then."""

    def __init__(self, graph: nx.MultiDiGraph[int], start: int) -> None:
        self.reached = {start, *nx.descendants(graph, start)}
        within = graph.subgraph(self.reached)
        components = list(nx.strongly_connected_components(within))
        bottom = [c for c in components if all(q in c for p in c for q in within.successors(p))]
        self.again: set[int] = set(bottom[0]) if len(bottom) == 1 else set()
        self.returns = start in self.again and len(components) == 1
        self.goes_on = all(within.out_degree(p) for p in self.reached)


def _none_of(net: Net, transitions: set[int]) -> Answer:
    def names() -> Iterator[str]:
        return (net.transitions[t].name for t in sorted(transitions))

    return no(tuple(names())) if transitions else yes()
