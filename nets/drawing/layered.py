"""A layered drawing of a directed graph: boxes in rows, an edge from row to row, its words in a row of their own.

The method is that of Sugiyama, Tagawa and Toda (1981), whose first step, the rows, is the caller's: what is drawn here
knows how far each box is from the beginning. The words of an edge are a box like others, in a row between those of its
ends, so they cover nothing by construction. An edge that passes rows stands in each of them as a box without width.
Rows are ordered by barycentres, down and up again, the order with the fewest crossings kept. Then each row takes the
places nearest to those its neighbours wish for, in the order that it has and without overlap, which is isotonic
regression, solved exactly by pooling adjacent violators (Ayer and others, 1955).

Graphviz does the same with more care, where it is installed (`firable.cli.graphviz`). Rejected: to require it. The
picture of a net must not depend on what else a machine has.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

Point = tuple[float, float]

_GAP: Final = 18.0
_LINE_GAP: Final = 12.0
_ROW_GAP: Final = 18.0
_PORT_GAP: Final = 16.0
_CORNER: Final = 8.0
_SWEEPS: Final = 24
_PLACINGS: Final = 16


@dataclass(frozen=True, slots=True)
class Box:
    """A box of a graph, in pixels, and its row from 0.

    Lines lead best to the `core` of it, so many pixels in its middle; what is beside that is words. 0 is the whole box.
    """

    width: float
    height: float
    row: int
    core: float = 0.0


@dataclass(frozen=True, slots=True)
class Link:
    """An edge between two boxes, by their indexes, with the size of the words at it."""

    tail: int
    head: int
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Route:
    """The way of an edge from its tail to its head: the first point, then three for each cubic Bezier curve."""

    points: tuple[Point, ...]
    words: Point
    """The centre of its words."""


@dataclass(frozen=True, slots=True)
class Placed:
    """A graph laid out: the centre of each box, the route of each edge, and the size of the whole."""

    centres: tuple[Point, ...]
    routes: tuple[Route, ...]
    width: float
    height: float


Layouter = Callable[[Sequence[Box], Sequence[Link]], Placed]
"""What lays a graph out; no edge leads from a box to itself."""


def layered(boxes: Sequence[Box], links: Sequence[Link]) -> Placed:
    """Lay a graph out in the rows that its boxes name; the same graph always gets the same layout.

    The cost is that of counting crossings, m log m in the pieces of edges between rows, some twenty times.

    >>> placed = layered([Box(40, 20, 0), Box(40, 20, 1)], [Link(0, 1, 30, 12)])
    >>> [x for x, _ in placed.centres] == [placed.routes[0].words[0]] * 2
    True
    """
    return _Layers(boxes, links).placed()


class _Layers:
    """The graph with a box for the words of each edge and for each row that an edge passes."""

    def __init__(self, boxes: Sequence[Box], links: Sequence[Link]) -> None:
        self.boxes, self.links = boxes, links
        self.width = [box.width for box in boxes]
        self.height = [box.height for box in boxes]
        self.row = [2 * box.row for box in boxes]
        self.chains = [self._chain(link) for link in links]
        self.above: list[list[int]] = [[] for _ in self.row]
        self.below: list[list[int]] = [[] for _ in self.row]
        for chain in self.chains:
            for one, other in pairwise(chain):
                high, low = (one, other) if self.row[one] < self.row[other] else (other, one)
                self.below[high].append(low)
                self.above[low].append(high)
        self.rows: list[list[int]] = [[] for _ in range(max(self.row, default=-1) + 1)]
        for node, row in enumerate(self.row):
            self.rows[row].append(node)

    def _add(self, row: int, width: float = 0.0, height: float = 0.0) -> int:
        self.row.append(row)
        self.width.append(width)
        self.height.append(height)
        return len(self.row) - 1

    def _chain(self, link: Link) -> list[int]:
        """The nodes of an edge from tail to head; its words stand in the row beside the upper end of it."""
        tail, head = self.row[link.tail], self.row[link.head]
        if tail == head:
            return [link.tail, self._add(tail + 1, link.width, link.height), link.head]
        step = 1 if head > tail else -1
        inner = []
        for row in range(tail + step, head, step):
            words = row == min(tail, head) + 1
            inner.append(self._add(row, link.width, link.height) if words else self._add(row))
        return [link.tail, *inner, link.head]

    def placed(self) -> Placed:
        """Order the rows, place each, and draw the lines."""
        self._order()
        x, y, height = self._columns(), *self._heights()
        left = min((x[v] - self.width[v] / 2 for v in range(len(x))), default=0.0)
        x = [value - left for value in x]
        width = max((x[v] + self.width[v] / 2 for v in range(len(x))), default=0.0)
        centres = tuple((x[v], y[self.row[v]]) for v in range(len(self.boxes)))
        ports = self._ports(x)
        routes = tuple(self._route(k, x, y, ports) for k in range(len(self.chains)))
        return Placed(centres, routes, width, height)

    def _order(self) -> None:
        best, fewest = [list(row) for row in self.rows], self._crossings()
        for sweep in range(_SWEEPS):
            down = sweep % 2 == 0
            rows = range(1, len(self.rows)) if down else range(len(self.rows) - 2, -1, -1)
            for r in rows:
                self._sort(self.rows[r], self.rows[r - 1 if down else r + 1], self.above if down else self.below)
            crossings = self._crossings()
            if crossings < fewest:
                best, fewest = [list(row) for row in self.rows], crossings
        self.rows = best

    def _sort(self, row: list[int], beside: Sequence[int], neighbours: Sequence[Sequence[int]]) -> None:
        """Sort a row by the mean places of its neighbours in the row beside it."""
        place = {v: float(i) for i, v in enumerate(beside)}
        scale = len(beside) / max(1, len(row))
        wish = {v: i * scale for i, v in enumerate(row)}
        wish |= {v: sum(place[u] for u in neighbours[v]) / len(neighbours[v]) for v in row if neighbours[v]}
        row.sort(key=wish.__getitem__)

    def _crossings(self) -> int:
        count = 0
        for upper, lower in pairwise(self.rows):
            place = {v: i for i, v in enumerate(lower)}
            seen: list[int] = []
            for v in upper:
                ends = sorted(place[u] for u in self.below[v])
                count += sum(len(seen) - bisect_right(seen, end) for end in ends)
                for end in ends:
                    insort(seen, end)
        return count

    def _columns(self) -> list[float]:
        x = [0.0] * len(self.row)
        for row in self.rows:
            self._settle(row, [0.0] * len(row), x)
        for k in range(_PLACINGS):
            down = k % 2 == 0
            for row in self.rows if down else reversed(self.rows):
                wishes = []
                for v in row:
                    near = (
                        (self.above if down else self.below)[v] if k < _PLACINGS - 2 else self.above[v] + self.below[v]
                    )
                    wishes.append(sum(x[u] for u in near) / len(near) if near else x[v])
                self._settle(row, wishes, x)
        return x

    def _settle(self, row: Sequence[int], wishes: Sequence[float], x: list[float]) -> None:
        """Give the nodes of a row the places nearest to their wishes that keep order and distance."""
        offset, at = [], 0.0
        for before, v in zip([None, *row], row, strict=False):
            if before is not None:
                gap = _GAP if self.width[before] and self.width[v] else _LINE_GAP
                at += (self.width[before] + self.width[v]) / 2 + gap
            offset.append(at)
        blocks: list[tuple[float, int]] = []  # the mean of the pooled wishes, less the offsets, and how many they are
        for wish, shift in zip(wishes, offset, strict=True):
            mean, size = wish - shift, 1
            while blocks and blocks[-1][0] > mean:
                other, others = blocks.pop()
                mean, size = (mean * size + other * others) / (size + others), size + others
            blocks.append((mean, size))
        settled = (mean for mean, size in blocks for _ in range(size))
        for v, shift, mean in zip(row, offset, settled, strict=True):
            x[v] = mean + shift

    def _heights(self) -> tuple[list[float], float]:
        """The middle of each row, and the height of all."""
        y, bottom = [], 0.0
        self.tall = [max((self.height[v] for v in row), default=0.0) for row in self.rows]
        for tall in self.tall:
            y.append(bottom + tall / 2)
            bottom += tall + _ROW_GAP
        return y, max(0.0, bottom - _ROW_GAP)

    def _ports(self, x: Sequence[float]) -> dict[tuple[int, int, int], float]:
        """Where each end of an edge meets its box, by (edge, box, side): side by side, in the order of their ways."""
        ends: dict[tuple[int, int], list[tuple[float, int]]] = {}
        for k, chain in enumerate(self.chains):
            for box, near in ((chain[0], chain[1]), (chain[-1], chain[-2])):
                side = 1 if self.row[near] > self.row[box] else -1
                ends.setdefault((box, side), []).append((x[near], k))
        ports: dict[tuple[int, int, int], float] = {}
        for (box, side), there in ends.items():
            step = min(_PORT_GAP, (self.width[box] - 2 * _CORNER) / len(there))
            for i, (_, k) in enumerate(sorted(there)):
                ports[k, box, side] = x[box] + step * (i - (len(there) - 1) / 2)
        return ports

    def _route(self, k: int, x: Sequence[float], y: Sequence[float], ports: dict[tuple[int, int, int], float]) -> Route:
        """A line that goes upright through every row, and bends only between two of them."""
        chain = self.chains[k]
        tail, head = chain[0], chain[-1]
        words = next((v for v in chain[1:-1] if self.width[v]), tail)
        points: list[Point] = []
        for one, other in pairwise(chain):
            sign = 1 if self.row[other] > self.row[one] else -1
            start_x = ports[k, one, sign] if one in {tail, head} else x[one]
            end_x = ports[k, other, -sign] if other in {tail, head} else x[other]
            edge_of_row = y[self.row[one]] + sign * self.tall[self.row[one]] / 2
            next_row = y[self.row[other]] - sign * self.tall[self.row[other]] / 2
            if not points:
                points.append((start_x, y[self.row[one]] + sign * self.height[one] / 2))
            points += _straight(points[-1], (start_x, edge_of_row))
            middle = (edge_of_row + next_row) / 2
            points += [(start_x, middle), (end_x, middle), (end_x, next_row)]
            if other == head:
                points += _straight(points[-1], (end_x, y[self.row[other]] - sign * self.height[other] / 2))
        if self.row[tail] == self.row[head]:  # below all boxes of the row, down towards the words and up again: a bow
            start, end, depth = points[0], points[-1], y[self.row[words]]
            low = y[self.row[tail]] + self.tall[self.row[tail]] / 2
            points = [start, *_straight(start, (start[0], low)), (start[0], depth), (end[0], depth), (end[0], low)]
            points += _straight(points[-1], end)
        return Route(tuple(points), (x[words], y[self.row[words]]))


def _straight(start: Point, end: Point) -> list[Point]:
    """A straight line as a Bezier curve; nothing where it has no length."""
    return [] if start == end else [start, end, end]
