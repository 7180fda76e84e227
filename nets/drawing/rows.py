"""The order of the transitions down the page: lanes for controllers, rows for transitions.

A cell's net is cyclic, and a drawing needs a beginning. A live net has a token on every cycle, so the arcs *into* the
marked places are where to cut: what is left is the work from the first workpiece to the last, and robots and machines
that become free again close the circle upwards. Cycles without a token (they are dead, but must be drawn too) are cut
where a depth-first search meets them.

Rejected: minimum feedback arc sets, the general remedy of layered drawing (Sugiyama). They cut the fewest arcs,
wherever that is, so a small change of the net turns the picture around.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import permutations
from types import MappingProxyType
from typing import Final

from firable.nets.net import Net

_PERMUTED_MAX: Final = 7
_GROWN_MAX: Final = 40

Span = tuple[int, int]
"""The first and the last lane that a transition reaches."""


def lane_order(participants: Sequence[frozenset[int]], lanes: int) -> tuple[int, ...]:
    """The order of the lanes in which transitions pass over the fewest lanes that take no part in them.

    `participants[t]` are the lanes of transition t. Of more than 7 lanes the orders tried are that of the net and those
    that grow from one lane by the lane that leaves the fewest transitions open, which is close to the best.
    """
    wide = [lanes_of for lanes_of in participants if len(lanes_of) > 1]
    orders: Iterable[tuple[int, ...]] = permutations(range(lanes))
    if lanes > _PERMUTED_MAX:
        orders = (tuple(range(lanes)), *(grown(wide, lanes, start) for start in range(min(lanes, _GROWN_MAX))))

    def passed_over(order: tuple[int, ...]) -> int:
        position = {lane: i for i, lane in enumerate(order)}
        return sum(
            max(position[lane] for lane in lanes_of) - min(position[lane] for lane in lanes_of) for lanes_of in wide
        )

    return min(orders, key=lambda order: (passed_over(order), order))


def grown(
    wide: Iterable[Collection[int]], lanes: int, start: int, before: Sequence[Collection[int]] = ()
) -> tuple[int, ...]:
    """An order from one lane on: each next one closes the most transitions that are open, and opens the fewest.

    `wide` are the lanes of each transition. Of those that are as good the one with what is open longest is next, then
    the first. `before` are for each lane those that stand before it in any case; `start` has none, and there is no
    circle.
    """
    wide = list(wide)
    of_lane: list[list[int]] = [[] for _ in range(lanes)]
    missing = [len(lanes_of) for lanes_of in wide]
    for t, lanes_of in enumerate(wide):
        for lane in lanes_of:
            of_lane[lane].append(t)
    since: dict[int, int] = {}

    def cost(lane: int) -> tuple[int, int, int]:
        opened = sum(t not in since for t in of_lane[lane])
        closed = sum(missing[t] == 1 for t in of_lane[lane])
        oldest = min((since[t] for t in of_lane[lane] if t in since), default=lanes)
        return opened - closed, oldest, lane

    costs = {lane: cost(lane) for lane in range(lanes)}
    left = [len(some) for some in before] or [0] * lanes
    behind: list[list[int]] = [[] for _ in range(lanes)]
    for lane, some in enumerate(before):
        for other in some:
            behind[other].append(lane)
    order: list[int] = []
    lane = start
    while True:
        del costs[lane]
        for t in of_lane[lane]:
            since.setdefault(t, len(order))
            missing[t] -= 1
        order.append(lane)
        if not costs:
            return tuple(order)
        for other in behind[lane]:
            left[other] -= 1
        for other in {other for t in of_lane[lane] for other in wide[t]} & costs.keys():
            costs[other] = cost(other)
        lane = min((lane for lane in costs if not left[lane]), key=costs.__getitem__)


def rows_of(net: Net, spans: Sequence[Span], kept: Mapping[str, float] = MappingProxyType({})) -> tuple[int, ...]:
    """The row of each transition, from 1: behind what it follows, and beside others only where no lane is shared.

    `kept` are rows that transitions have already, by name, whose order stays; where two of one row share a lane, the
    second gets a row of its own behind it. What is new gets a row of its own behind what it follows.
    """
    before = _predecessors(net)
    depth = _depths(before)
    found: dict[int, float] = {}
    taken: set[tuple[float, int]] = set()

    def stand(t: int, row: float, step: float) -> None:
        first, last = spans[t]
        while any((row, lane) in taken for lane in range(first, last + 1)):
            # Between two rows of those that are kept there is always room for one more.
            row = row + 1 if step == 1 else row + (math.floor(row) + 1 - row) / 2
        found[t] = row
        taken.update((row, lane) for lane in range(first, last + 1))

    names = [transition.name for transition in net.transitions]
    for t in sorted((t for t, name in enumerate(names) if name in kept), key=lambda t: (kept[names[t]], t)):
        stand(t, kept[names[t]], 0.5)
    step = 0.5 if found else 1
    for t in sorted((t for t in range(len(names)) if t not in found), key=lambda t: (depth[t], t)):
        stand(t, step + max((found[u] for u in before[t] if u in found), default=0), step)
    rank = {row: i for i, row in enumerate(sorted(set(found.values())), start=1)}
    return tuple(rank[found[t]] for t in range(len(names)))


def depths(net: Net) -> list[int]:
    """How many transitions lead to each one at least, itself among them, without going around a cycle."""
    return _depths(_predecessors(net))


def followed(net: Net, some: Sequence[int]) -> list[set[int]]:
    """For each of some transitions those of them that come before it, without going around a cycle.

    What lies in between may be any transitions that are none of them.
    """
    before = _predecessors(net)
    at = {t: i for i, t in enumerate(some)}
    found: list[set[int]] = [set() for _ in before]
    for t in _topological(before):
        for u in before[t]:
            found[t] |= {at[u]} if u in at else found[u]
    return [found[t] for t in some]


def _depths(before: Sequence[Sequence[int]]) -> list[int]:
    depth = [0] * len(before)
    for t in _topological(before):
        depth[t] = 1 + max((depth[u] for u in before[t]), default=0)
    return depth


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
