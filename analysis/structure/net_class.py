"""The class of a net: state machine, marked graph, free choice and their extensions.

The classes are conditions on the arcs alone, as in Murata (1989, "Petri nets: properties, analysis and applications"):

- *state machine*: each transition has one input and one output place: choice, no synchronisation;
- *marked graph*: each place has one producer and one consumer: synchronisation, no choice;
- *free choice*: a place with several consumers is the only input of each;
- *extended free choice*: places that share a consumer share all consumers;
- *asymmetric choice*: of two places that share a consumer, one has all consumers of the other.

Each is contained in the next of the last three. What makes a class worth knowing are its theorems (Commoner: a
free-choice net is live iff each of its siphons holds a marked trap), and they are about ordinary nets. Gates put a
net outside: an internal gate is a read or inhibitor arc, an external gate makes a choice that the class calls free
depend on a signal. So does the contact rule, unless the net is contact-free. What stands in the way of the theorems
is listed; the alternative, counting gates as arcs, would name a class whose theorems do not hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from firable.nets.net import Net


@dataclass(frozen=True, slots=True)
class NetClass:
    """The classes that the arcs of a net belong to, and what keeps their theorems from holding of it.

    `pure`: no self-loops. `connected` and `strongly_connected` are of the graph of places and transitions, by arcs.
    """

    state_machine: bool
    marked_graph: bool
    free_choice: bool
    extended_free_choice: bool
    asymmetric_choice: bool
    pure: bool
    connected: bool
    strongly_connected: bool
    outside: tuple[str, ...]

    @property
    def name(self) -> str:
        """The narrowest class, in words."""
        for holds, name in (
            (self.state_machine and self.marked_graph, "state machine and marked graph"),
            (self.state_machine, "state machine"),
            (self.marked_graph, "marked graph"),
            (self.free_choice, "free choice"),
            (self.extended_free_choice, "extended free choice"),
            (self.asymmetric_choice, "asymmetric choice"),
        ):
            if holds:
                return name
        return "general"


def net_class(net: Net, *, contact_free: bool | None = None) -> NetClass:
    """The classes of a net by its arcs; `contact_free` is what is known of that verdict (None: nothing).

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")),
    ...           (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))))
    >>> net_class(net, contact_free=True).name
    'state machine and marked graph'
    """
    connected, strongly_connected = _joined(net)
    index = net.place_index
    inputs = [[index[name] for name in t.inputs] for t in net.transitions]
    return NetClass(
        state_machine=all(len(t.inputs) == 1 == len(t.outputs) for t in net.transitions),
        marked_graph=all(len(c) == 1 == len(p) for c, p in zip(net.consumers, net.producers, strict=True)),
        free_choice=all(len(inputs[t]) == 1 for group in net.consumers if len(group) > 1 for t in group),
        extended_free_choice=extended_free_choice(inputs, net.consumers),
        asymmetric_choice=asymmetric_choice(inputs, net.consumers),
        pure=not any(t.self_loops for t in net.transitions),
        connected=connected,
        strongly_connected=strongly_connected,
        outside=tuple(_outside(net, contact_free)),
    )


def extended_free_choice(inputs: Sequence[Sequence[int]], consumers: Sequence[tuple[int, ...]]) -> bool:
    """Whether the inputs of each transition have the same consumers. Cost: linear in the arcs."""
    same = _equal(consumers)
    return all(same[p] == same[places[0]] for places in inputs for p in places)


def asymmetric_choice(inputs: Sequence[Sequence[int]], consumers: Sequence[tuple[int, ...]]) -> bool:
    """Whether of the inputs of each transition, two by two, one has all consumers of the other."""
    same, compared = _equal(consumers), dict[tuple[int, int], bool]()
    for places in inputs:
        by_size = sorted(places, key=lambda p: len(consumers[p]))
        for p, q in pairwise(by_size):
            pair = same[p], same[q]
            if pair not in compared:  # each pair once, for a place may have as many consumers as there are transitions
                compared[pair] = pair[0] == pair[1] or set(consumers[p]) <= set(consumers[q])
            if not compared[pair]:
                return False
    return True


def _equal(consumers: Sequence[tuple[int, ...]]) -> list[int]:
    """A number for each place, the same for places with the same consumers."""
    numbers: dict[tuple[int, ...], int] = {}
    return [numbers.setdefault(group, len(numbers)) for group in consumers]


def _joined(net: Net) -> tuple[bool, bool]:
    """Whether the graph of places and transitions, by arcs, is connected, and whether it is strongly.

    Strongly: one node reaches all and is reached by all. Cost: linear in the arcs.
    """
    n, index = len(net.places), net.place_index
    after: list[list[int]] = [[] for _ in range(n + len(net.transitions))]
    before: list[list[int]] = [[] for _ in after]
    for t, transition in enumerate(net.transitions, n):
        for name in transition.inputs:
            after[index[name]].append(t)
            before[t].append(index[name])
        for name in transition.outputs:
            after[t].append(index[name])
            before[index[name]].append(t)
    either = [x + y for x, y in zip(after, before, strict=True)]
    return _reaches_all(either), _reaches_all(after) and _reaches_all(before)


def _reaches_all(neighbours: Sequence[Sequence[int]]) -> bool:
    """Whether the first node reaches all; so does the first of none."""
    found, todo = {0}, [0]
    while todo and neighbours:
        for node in neighbours[todo.pop()]:
            if node not in found:
                found.add(node)
                todo.append(node)
    return len(found) >= len(neighbours)


def _outside(net: Net, contact_free: bool | None) -> Iterator[str]:
    """Why the theorems of the classes do not hold of this net as it is."""
    if any(t.permissive or t.inhibitive for t in net.transitions):
        yield "it has internal gates, which are read and inhibitor arcs"
    if any(t.external for t in net.transitions):
        yield "it has external gates, on which choices depend"
    if any(t.self_loops for t in net.transitions):
        yield "it has self-loops, which never fire here and would in an ordinary net"
    if contact_free is False:
        yield "it is not contact-free: an ordinary net would fire where this one may not"
    elif contact_free is None:
        yield "it is not known to be contact-free"
