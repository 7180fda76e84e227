"""Who waits for whom in a deadlock: the circle that keeps it closed, in the places of the net.

In a deadlock every token waits: a transition that would take it lacks a token somewhere else, or finds a place full.
What it lacks can come only from tokens that wait as well. Followed from token to token, this ends in a circle, unless a
token is lost or nothing ever takes it; and the circle, not the list of all that is empty, is what an engineer breaks
(the circular wait of Coffman, Elphick and Shoshani, 1971, read off the net).

From the place that is lacked one goes back against the arcs to the tokens nearest to it. Where places have owners, the
way inside the owner comes first, because there a machine's own token is: MC is not free as long as its token is where
MC holds a workpiece. The shortest circle is told.

Rejected: siphons. An empty siphon says which places stay empty for ever, but neither who holds what nor in which order.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final

from firable.nets.bits import bits
from firable.nets.net import Marking, Net
from firable.nets.verdict import Wait

_Node = tuple[int, int]
"""A place whose token waits, and the transition that would take it."""
_Holder = tuple[int, tuple[int, ...]]
"""A place whose token can come somewhere, and the transitions on the way, in their order."""
_STARTS_MAX: Final = 200  # places from which circles are looked for; the first circle of a wide net says enough


def circle(net: Net, marking: Marking) -> tuple[Wait, ...]:
    """The shortest circle of tokens that wait for each other in a deadlock, from the first place of the net in it.

    Empty where there is none: a token that nothing takes, or one that is lacked and lost.

    >>> from firable.nets.catalogue import catalogue_net
    >>> net = catalogue_net("philosophers-2")
    >>> for wait in circle(net, net.marking(["p1.left", "p2.left"])):
    ...     print(wait.place, wait.transition, wait.lacks, wait.holder)
    p1.left p1_takes_right p2.fork p2.left
    p2.left p2_takes_right p1.fork p1.left
    """
    waits = _Waits(net, marking)
    shortest: tuple[Wait, ...] = ()
    for p in list(bits(marking))[:_STARTS_MAX]:
        for t in waits.taking(p):
            found = waits.back_to((p, t))
            if found and (not shortest or len(found) < len(shortest)):
                shortest = found
    return shortest


class _Waits:
    """What each token waits for in one marking, found once."""

    def __init__(self, net: Net, marking: Marking) -> None:
        self._net, self._marking = net, marking
        self._known: dict[_Node, tuple[tuple[_Node, Wait], ...]] = {}

    def taking(self, p: int) -> Iterator[int]:
        """Who takes the token of a place: not what can never fire, which nobody waits for."""
        return (t for t in self._net.consumers[p] if self._may_fire(t))

    def _may_fire(self, t: int) -> bool:
        masks = self._net.masks[t]
        contradicts = (masks.inputs | masks.permissive) & (masks.outputs | masks.inhibitive)
        return not contradicts and self._net.transitions[t].openable

    def back_to(self, start: _Node) -> tuple[Wait, ...]:
        """The shortest way from a token that waits back to itself; empty where there is none."""
        came: dict[_Node, tuple[_Node, Wait]] = {}
        queue = deque([start])
        while queue:
            node = queue.popleft()
            for after, wait in self._after(node):
                if after == start:
                    way = [wait]
                    while node != start:
                        node, wait = came[node]
                        way.append(wait)
                    return tuple(reversed(way))
                if after not in came:
                    came[after] = (node, wait)
                    queue.append(after)
        return ()

    def _after(self, node: _Node) -> tuple[tuple[_Node, Wait], ...]:
        if node not in self._known:
            self._known[node] = tuple(self._found(node))
        return self._known[node]

    def _found(self, node: _Node) -> Iterator[tuple[_Node, Wait]]:
        net, marking, (p, t) = self._net, self._marking, node
        held, transition, masks = net.places[p].name, net.transitions[t], net.masks[t]
        for full in bits((masks.outputs | masks.inhibitive) & marking):
            name = net.places[full].name
            for taking in self.taking(full):
                yield (
                    (full, taking),
                    Wait(held, transition.name, name, wanted=False, holder=name, by=(net.transitions[taking].name,)),
                )
        for empty in bits((masks.inputs | masks.permissive) & ~marking):
            for holder, way in self._holders(empty):
                by = tuple(net.transitions[u].name for u in way)
                yield (
                    (holder, way[0]),
                    Wait(
                        held,
                        transition.name,
                        net.places[empty].name,
                        wanted=True,
                        holder=net.places[holder].name,
                        by=by,
                    ),
                )

    def _holders(self, empty: int) -> list[_Holder]:
        """The tokens nearest to an empty place against the arcs, with the transitions on the way, in their order."""
        owner = self._net.places[empty].owner
        return (owner is not None and self._nearest(empty, owner)) or self._nearest(empty, None)

    def _nearest(self, empty: int, within: str | None) -> list[_Holder]:
        net, seen = self._net, {empty}
        level: list[_Holder] = [(empty, ())]
        while level:
            found: list[_Holder] = []
            further: list[_Holder] = []
            for place, way in level:
                for u in filter(self._may_fire, net.producers[place]):
                    for before in bits(net.masks[u].inputs):
                        if before in seen or (within is not None and net.places[before].owner != within):
                            continue
                        seen.add(before)
                        (found if self._marking >> before & 1 else further).append((before, (u, *way)))
            if found:
                return found
            level = further
        return []
