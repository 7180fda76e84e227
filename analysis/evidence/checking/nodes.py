"""Sets of markings as zero-suppressed decision diagrams: the few operations that a checker needs.

A node (level, lo, hi) is the set of the markings of `lo`, in which the place of the level is empty, and of those of
`hi` with a token put on it; a level that is passed over is empty (Minato 1993, "Zero-suppressed BDDs"). Equal sets
are equal numbers. What is made of a set and another is kept for as long as the diagram, since the same parts come up
again and again. Nothing recurses: a diagram is as deep as the net has places.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.refusal import TimeIsOverError

EMPTY: Final = 0
"""The empty set."""
UNIT: Final = 1
"""The set of the empty marking alone."""
_CLOCK_EVERY: Final = 4096

Key = tuple[int, ...]
Made = int | tuple[int, Key, Key]
"""A node, or the level and the two keys that it is to be made of."""


class Nodes:
    """The nodes of one diagram, by number; raises `TimeIsOverError` at the deadline.

    >>> nodes = Nodes()
    >>> p, q = nodes.node(1, EMPTY, UNIT), nodes.node(2, EMPTY, UNIT)
    >>> nodes.both(nodes.either(p, q), q) == q, nodes.includes(nodes.either(p, q), p), nodes.includes(q, p)
    (True, True, False)
    """

    def __init__(self, deadline: Deadline = NEVER) -> None:
        self.deadline = deadline
        self.levels, self.lows, self.highs = [0, 0], [EMPTY, EMPTY], [EMPTY, EMPTY]
        self._known: dict[tuple[int, int, int], int] = {}
        self._both: dict[Key, int] = {}
        self._either: dict[Key, int] = {}
        self._less: dict[Key, int] = {}
        self._included: set[tuple[int, int]] = set()
        self._work = 0

    def node(self, level: int, lo: int, hi: int) -> int:
        """The node of these parts, each node once."""
        if hi == EMPTY:
            return lo
        found = self._known.setdefault((level, lo, hi), len(self.levels))
        if found == len(self.levels):
            self.levels.append(level)
            self.lows.append(lo)
            self.highs.append(hi)
        return found

    def part(self, node: int, level: int, value: bool) -> int:
        """The markings of a node that does not reach above a level, with or without a token there."""
        if self.levels[node] == level:
            return self.highs[node] if value else self.lows[node]
        return EMPTY if value else node

    def tick(self) -> None:
        """Count a piece of work; now and then look at the clock."""
        self._work += 1
        if self._work % _CLOCK_EVERY == 0 and self.deadline.over:
            raise TimeIsOverError

    def made(self, root: Key, known: dict[Key, int], parts: Callable[[Key], Made]) -> int:
        """The node of a key, whose parts are nodes, or a level and two keys."""
        todo = [root]
        while todo:
            key = todo[-1]
            self.tick()
            if key in known:
                todo.pop()
                continue
            made = parts(key)
            if isinstance(made, int):
                known[key] = made
                continue
            level, lo, hi = made
            low, high = known.get(lo), known.get(hi)
            if low is not None and high is not None:
                known[key] = self.node(level, low, high)
            else:
                todo += [part for part in (lo, hi) if part not in known]
        return known[root]

    def split(self, a: int, b: int) -> tuple[int, tuple[int, int], tuple[int, int]]:
        """The higher level of two nodes, and the parts of both there, without and with a token."""
        above, other = self.levels[a], self.levels[b]
        if above == other:
            return above, (self.lows[a], self.lows[b]), (self.highs[a], self.highs[b])
        if above > other:
            return above, (self.lows[a], b), (self.highs[a], EMPTY)
        return other, (a, self.lows[b]), (EMPTY, self.highs[b])

    def both(self, a: int, b: int) -> int:
        """The intersection."""

        def parts(key: Key) -> Made:
            a, b = key
            if a == b or EMPTY in key:
                return min(a, b)
            return self.split(a, b)

        return self.made((a, b), self._both, parts)

    def either(self, a: int, b: int) -> int:
        """The union."""

        def parts(key: Key) -> Made:
            a, b = key
            if a == b or EMPTY in key:
                return max(a, b)
            return self.split(a, b)

        return self.made((a, b), self._either, parts)

    def less(self, a: int, b: int) -> int:
        """The markings of the first that are not in the second."""

        def parts(key: Key) -> Made:
            a, b = key
            if a in (b, EMPTY):
                return EMPTY
            return a if b == EMPTY else self.split(a, b)

        return self.made((a, b), self._less, parts)

    def includes(self, b: int, a: int) -> bool:
        """Whether the second set is a part of the first."""
        todo, met = [(a, b)], set[tuple[int, int]]()
        while todo:
            a, b = todo.pop()
            if a in (EMPTY, b) or (a, b) in met or (a, b) in self._included:
                continue
            if b == EMPTY:
                return False
            self.tick()
            met.add((a, b))
            _, lo, hi = self.split(a, b)
            todo += [(lo[0], lo[1]), (hi[0], hi[1])]
        # Only now: of a pair whose parts were not all gone through, be it for want of time, nothing is known.
        self._included |= met
        return True

    def contains(self, node: int, full: set[int]) -> bool:
        """Whether the marking that has tokens on exactly these levels is in a set."""
        left = set(full)
        while level := self.levels[node]:
            node = self.part(node, level, value=level in left)
            left.discard(level)
        return node == UNIT and not left

    def having(self, node: int, values: Mapping[int, bool]) -> int:
        """The markings of a set with and without a token on some levels."""
        literals = sorted(values.items(), reverse=True)

        def parts(key: Key) -> Made:
            node, i = key
            if node == EMPTY or i == len(literals):
                return node
            level, value = literals[i]
            if self.levels[node] > level:
                return self.levels[node], (self.lows[node], i), (self.highs[node], i)
            below = self.part(node, level, value=value), i + 1
            return (level, (EMPTY, i), below) if value else (level, below, (EMPTY, i))

        return self.made((node, 0), {}, parts)
