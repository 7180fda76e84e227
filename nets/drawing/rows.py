"""The order of the transitions down the page: lanes for controllers, rows for transitions.

A cell's net is cyclic, and a drawing needs a beginning. A live net has a token on every cycle, so the arcs *into* the
marked places are where to cut: what is left is the work from the first workpiece to the last, and robots and machines
that become free again close the circle upwards. Cycles without a token (they are dead, but must be drawn too) are cut
where a depth-first search meets them.

Rejected: minimum feedback arc sets, the general remedy of layered drawing (Sugiyama). They cut the fewest arcs,
wherever that is, so a small change of the net turns the picture around.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import Final

from firable.nets.net import Net

_PERMUTED_MAX: Final = 7

Span = tuple[int, int]
"""The first and the last lane that a transition reaches."""


def lane_order(participants: Sequence[frozenset[int]], lanes: int) -> tuple[int, ...]:
    """The order of the lanes in which transitions pass over the fewest lanes that take no part in them.

    `participants[t]` are the lanes of transition t. With more than 7 lanes the order is that of the net.
    """
    orders = permutations(range(lanes)) if lanes <= _PERMUTED_MAX else iter([tuple(range(lanes))])
    wide = [lanes_of for lanes_of in participants if len(lanes_of) > 1]

    def passed_over(order: tuple[int, ...]) -> int:
        position = {lane: i for i, lane in enumerate(order)}
        return sum(
            max(position[lane] for lane in lanes_of) - min(position[lane] for lane in lanes_of) for lanes_of in wide
        )

    return min(orders, key=lambda order: (passed_over(order), order))


def rows_of(net: Net, spans: Sequence[Span]) -> tuple[int, ...]:
    """The row of each transition, from 1: behind what it follows, and beside others only where no lane is shared."""
    before = _predecessors(net)
    depth: list[int] = [0] * len(net.transitions)
    for t in _topological(before):
        depth[t] = 1 + max((depth[u] for u in before[t]), default=0)
    rows = [0] * len(net.transitions)
    taken: set[tuple[int, int]] = set()
    for t in sorted(range(len(rows)), key=lambda t: (depth[t], t)):
        row = 1 + max((rows[u] for u in before[t]), default=0)
        first, last = spans[t]
        while any((row, lane) in taken for lane in range(first, last + 1)):
            row += 1
        rows[t] = row
        taken.update((row, lane) for lane in range(first, last + 1))
    return tuple(rows)


def _predecessors(net: Net) -> list[list[int]]:
    """For each transition those that put a token on its inputs, without closing a cycle."""
    found: list[set[int]] = [set() for _ in net.transitions]
    for p, place in enumerate(net.places):
        if not place.marked:
            for t in net.consumers[p]:
                found[t].update(u for u in net.producers[p] if u != t)
    # Depth-first: an arc to a transition that is still on the stack closes a cycle, and is cut.
    colour = [0] * len(found)
    for start in range(len(found)):
        stack = [(start, iter(sorted(found[start])))] if not colour[start] else []
        colour[start] = colour[start] or 1
        while stack:
            t, rest = stack[-1]
            u = next(rest, None)
            if u is None:
                colour[t] = 2
                stack.pop()
            elif colour[u] == 1:
                found[t].discard(u)
            elif colour[u] == 0:
                colour[u] = 1
                stack.append((u, iter(sorted(found[u]))))
    return [sorted(before) for before in found]


def _topological(before: Sequence[Sequence[int]]) -> list[int]:
    after: list[list[int]] = [[] for _ in before]
    for t, earlier in enumerate(before):
        for u in earlier:
            after[u].append(t)
    missing = [len(earlier) for earlier in before]
    order = [t for t, count in enumerate(missing) if count == 0]
    for t in order:
        for u in after[t]:
            missing[u] -= 1
            if missing[u] == 0:
                order.append(u)
    return order
