"""The hypergraph of a net for those who look for owners: what belongs together, and what each transition joins.

A vertex, here a *block*, is a set of places and signals that must have one owner: all places that command one machine,
since commands to a machine come from one controller; a place, the completion signal it waits for, its timer and its
fault place; places that wait for the same completion. Its weight is how many they are. A hyperedge is a transition: the
blocks of its inputs, outputs and gates, external ones too, for each of their owners takes part. A transition within one
block is local whoever owns it, and left out. So a partition of the blocks is an ownership, the hyperedges it cuts are
the global transitions, and the blocks that a cut one meets, counted by owner, are its votes.

Rejected: a graph with an edge for each pair of places that a transition joins, which every graph partitioner takes. It
counts a transition of four places six times, and so prefers to cut two small ones where one large one would do.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil

from firable.nets.net import Net

Partition = tuple[int, ...]
"""For each block the number of its part."""


@dataclass(frozen=True, slots=True)
class Hypergraph:
    """`blocks` are names of places and signals, `weights` how many; `edges` are the blocks that a transition joins.

    `transitions` are the names of the edges, in the order of the net; those within one block are not among them.
    """

    blocks: tuple[tuple[str, ...], ...]
    weights: tuple[int, ...]
    edges: tuple[tuple[int, ...], ...]
    transitions: tuple[str, ...]

    def cut(self, partition: Sequence[int]) -> tuple[str, ...]:
        """The transitions that join several parts."""
        joined = ({partition[block] for block in edge} for edge in self.edges)
        return tuple(name for name, parts in zip(self.transitions, joined, strict=True) if len(parts) > 1)

    def votes(self, partition: Sequence[int]) -> int:
        """The number of votes: for each transition that is cut, the parts that it joins."""
        joined = (len({partition[b] for b in edge}) for edge in self.edges)
        return sum(n for n in joined if n > 1)

    def sizes(self, partition: Sequence[int], n_parts: int) -> tuple[int, ...]:
        """The weight of each part."""
        found = [0] * n_parts
        for block, part in enumerate(partition):
            found[part] += self.weights[block]
        return tuple(found)

    def bounds(self, n_parts: int, slack: float) -> tuple[int, int]:
        """How light and how heavy a part may be: the average and so much less or more, or the heaviest block."""
        average = sum(self.weights) / max(1, n_parts)
        return max(1, ceil(average * (1 - slack))), max(1, int(average * (1 + slack)), *self.weights)

    def fewest(self, n_parts: int) -> int:
        """A number of transitions that every partition cuts at least, as the net hangs together.

        A transition of k blocks ties at most k - 1 parts to others; so many of the largest are needed to tie the parts
        of each component of the net together. 0 where components are as many as parts.
        """
        needed = n_parts - len(set(_classes(len(self.blocks), self.edges)))
        found = 0
        for joined in sorted((min(len(edge), n_parts) - 1 for edge in self.edges), reverse=True):
            if needed <= 0:
                break
            needed -= joined
            found += 1
        return found


def hypergraph(net: Net) -> Hypergraph:
    """The hypergraph of a net, whatever owners it has. Cost: linear in its arcs and gates.

    >>> from firable.nets.catalogue import catalogue_net
    >>> graph = hypergraph(catalogue_net("one_robot"))
    >>> len(graph.blocks), max(graph.weights), len(graph.transitions)
    (19, 15, 9)
    """
    together: list[Sequence[str]] = []
    machines: dict[str, list[str]] = {}
    for p, place in enumerate(net.places):
        fault = net.fault_transitions.get(p)
        to = () if fault is None else net.transitions[fault].outputs
        if place.cleared:
            together.append((place.name, *place.cleared, *to))
        if place.command is not None:
            machines.setdefault(place.command.machine, []).append(place.name)
    blocks = _joined([*(p.name for p in net.places), *(s.name for s in net.signals)], [*together, *machines.values()])
    block_of = {name: number for number, block in enumerate(blocks) for name in block}
    edges: dict[str, tuple[int, ...]] = {}
    for t in net.transitions:
        joined = (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive, *(gate.signal for gate in t.external))
        edge = tuple(sorted({block_of[name] for name in joined}))
        if len(edge) > 1:
            edges[t.name] = edge
    return Hypergraph(tuple(blocks), tuple(map(len, blocks)), tuple(edges.values()), tuple(edges))


def _joined(names: Sequence[str], together: Iterable[Sequence[str]]) -> list[tuple[str, ...]]:
    """The classes of names that the sets of `together` join, in the order of the names."""
    number = {name: i for i, name in enumerate(names)}
    classes: dict[int, list[str]] = {}
    lowest = _classes(len(names), ([number[name] for name in some] for some in together))
    for name, of in zip(names, lowest, strict=True):
        classes.setdefault(of, []).append(name)
    return [tuple(members) for members in classes.values()]


def _classes(n: int, together: Iterable[Sequence[int]]) -> list[int]:
    """For each of n things the lowest one of its class, where each of the sets is within one class."""
    above = list(range(n))

    def root(i: int) -> int:
        while above[i] != i:
            above[i] = above[above[i]]
            i = above[i]
        return i

    for some in together:
        for other in some[1:]:
            low, high = sorted((root(some[0]), root(other)))
            above[high] = low
    return [root(i) for i in range(n)]
