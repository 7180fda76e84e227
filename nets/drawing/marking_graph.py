"""Writing a reachability graph down as SVG: what an engineer wants to see of a small net before believing a verdict.

A box is a marking. M0 says where all its tokens are; every other box says only what is different there, controller by
controller, because in a cell most machines stand still most of the time and a list of all tokens hides the two that
have moved. A marking where nothing is different from M0 is M0, so what is not named stands as in M0. An arrow is a
firing; pointing at it tells which tokens it takes and puts. Deadlocks have a double rim and say so; doomed markings,
from which a deadlock can no longer be avoided, are tinted and say so: no meaning hangs on a colour alone.

Rows are distances from M0, so the row of a marking is the length of its shortest firing sequence; where a row would be
wider than a sheet, it goes on in the next, and the markings say how far they are. The drawing knows nothing of how
markings are found; who calls it brings them (`firable.cli.pictures` from `firable.analysis`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from firable.nets.drawing.labels import local_name
from firable.nets.drawing.layered import Box, Layouter, Link, Point, Route, layered
from firable.nets.drawing.sheet import opening
from firable.nets.drawing.text import NAME, NOTE, Style, width_of, wrapped
from firable.nets.drawing.xml import esc, head, ident, px
from firable.nets.net import Marking, Net

_LINE: Final = 14.0
_CHARACTERS: Final = 34
_LINES_MAX: Final = 7
_FIRINGS_MAX: Final = 4
_TOP: Final = 72.0
_MARGIN: Final = 24.0
_GAP: Final = 18.0
_WIDTH_MAX: Final = 2400.0
"""How wide the markings of one distance may stand, in pixels, before they go on in the next row."""
_FIRING: Final = Style("firing", 7.0)

_STYLE: Final = """
.name{font-size:13px;font-weight:600}
.note{font-size:10.5px;fill:#4c5966}
.firing{font-size:11px;font-weight:600;paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}
.flag{font-size:10.5px;font-weight:700;fill:#8c0f2e}
.marking{fill:#fff;stroke:#1d2733;stroke-width:1.2}
.initial{fill:#eef3fb;stroke:#1d2733;stroke-width:2.6}
.doomed{fill:#fdf0dc;stroke:#a25b00;stroke-width:1.2;stroke-dasharray:6 2.5}
.deadlock{fill:#fbe3e8;stroke:#b3123b;stroke-width:1.6}
.rim{fill:none;stroke:#b3123b;stroke-width:1.2}
.arc{fill:none;stroke:#3b4855;stroke-width:1.3}
.head{fill:#3b4855}
.more{fill:none;stroke:#3b4855;stroke-width:1.3;stroke-dasharray:2 3}
""".strip()


@dataclass(frozen=True, slots=True)
class Step:
    """An edge of the graph: the numbers of two markings and the transitions that fire between them, at once."""

    tail: int
    head: int
    fired: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class MarkingGraph:
    """Markings by number, M0 first and none before one that is nearer to M0, and the firings between them.

    `deadlocks` and `doomed` are numbers; `beyond[i]` counts the firings of marking i to markings that are not there.
    """

    markings: tuple[Marking, ...]
    steps: tuple[Step, ...]
    deadlocks: frozenset[int] = frozenset()
    doomed: frozenset[int] = frozenset()
    beyond: tuple[int, ...] = ()


def draw_markings(net: Net, graph: MarkingGraph, *, caption: str = "", layout: Layouter = layered) -> str:
    """The graph as SVG: `marking:3` is the id of a marking by its number, `firing:3:5` that of what leads on from it.

    `caption` is the line under the title; `layout` puts boxes and arrows in their places.

    >>> draw_markings(Net("empty"), MarkingGraph((0,), ())).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    return "\n".join(_Writer(net, graph, caption, layout).lines()) + "\n"


class _Writer:
    """One drawing of a graph of markings."""

    def __init__(self, net: Net, graph: MarkingGraph, caption: str, layout: Layouter) -> None:
        self.net, self.graph, self.caption = net, graph, caption
        self.owners = list(dict.fromkeys(place.owner for place in net.places))
        self.texts = [list(self._texts(i)) for i in range(len(graph.markings))]
        self.fired: dict[tuple[int, int], list[tuple[str, ...]]] = {}
        for step in graph.steps:
            self.fired.setdefault((step.tail, step.head), []).append(step.fired)
        self.joined = [pair for pair in self.fired if pair[0] != pair[1]]
        self.depth = self._depths()
        rows = self._rows()
        self.is_wrapped = max(rows, default=0) > max(self.depth, default=0)
        boxes = [Box(*self._size(texts), rows[i]) for i, texts in enumerate(self.texts)]
        links = [Link(tail, head, *self._size_of_words(tail, head)) for tail, head in self.joined]
        self.boxes, self.where = boxes, layout(boxes, links)
        self.legend = list(self._legend_items())
        texts = max(width_of(net.name, NAME) * 1.7, width_of(caption, NOTE) * 1.2)
        legend = sum(46 + width_of(words, NOTE) + 14 for _, words in self.legend)
        self.width = max(self.where.width + self._loops_width(), texts, legend) + 2 * _MARGIN
        self.bottom = _TOP + self.where.height + 30

    def _depths(self) -> list[int]:
        """How many firings lead to each marking; those that nothing here leads to stand one row below the others."""
        depth: dict[int, int] = {0: 0} if self.graph.markings else {}
        after: dict[int, list[int]] = {}
        for tail, into in self.fired:
            after.setdefault(tail, []).append(into)
        queue = list(depth)
        for tail in queue:
            for into in after.get(tail, ()):
                if into not in depth:
                    depth[into] = depth[tail] + 1
                    queue.append(into)
        deepest = max(depth.values(), default=-1)
        return [depth.get(i, deepest + 1) for i in range(len(self.graph.markings))]

    def _rows(self) -> list[int]:
        """The row of each marking: its distance from M0, unless so many are so far that their row is too wide."""
        room = [self._size(texts)[0] for texts in self.texts]
        below = [0.0] * len(room)
        for tail, into in self.joined:
            upper = min(tail, into, key=lambda i: (self.depth[i], i))
            below[upper] += self._size_of_words(tail, into)[0] + _GAP
        rows = [0] * len(room)
        row, last, width = -1, -1, 0.0
        for i in sorted(range(len(room)), key=lambda i: (self.depth[i], i)):
            needed = max(room[i] + _GAP, below[i])
            if self.depth[i] != last or width + needed > _WIDTH_MAX:
                row, width = row + 1, 0.0
            last, width = self.depth[i], width + needed
            rows[i] = row
        return rows

    def _texts(self, i: int) -> Iterator[tuple[str, str]]:
        """The lines in the box of a marking, each as (text, class)."""
        flag = "deadlock" if i in self.graph.deadlocks else "doomed" if i in self.graph.doomed else ""
        yield f"M{i}", "name"
        if flag:
            yield flag, "flag"
        marking, initial = self.graph.markings[i], self.graph.markings[0]
        told: list[str] = []
        for owner in self.owners:
            mine = [p for p, place in enumerate(self.net.places) if place.owner == owner]
            if i and all(not (marking ^ initial) >> p & 1 for p in mine):
                continue
            held = ", ".join(local_name(self.net.places[p].name, owner) for p in mine if marking >> p & 1)
            if i == 0 and not held:
                continue
            told += wrapped(f"{owner}: {held or '–'}" if owner else held or "no token", _CHARACTERS, 3)
        for line in told if len(told) <= _LINES_MAX else [*told[: _LINES_MAX - 1], "…"]:
            yield line, "note"

    def _size(self, texts: Sequence[tuple[str, str]]) -> tuple[float, float]:
        widest = max(width_of(text, NAME if css in {"name", "flag"} else NOTE) for text, css in texts)
        return max(44.0, widest + 16), len(texts) * _LINE + 12

    def _words(self, tail: int, into: int) -> list[str]:
        """What fires between two markings: a line for each way, joined by + where several fire at once."""
        ways = [" + ".join(fired) for fired in self.fired[tail, into]]
        if len(ways) > _FIRINGS_MAX:
            ways = [*ways[: _FIRINGS_MAX - 1], f"and {len(ways) - _FIRINGS_MAX + 1} more"]
        return [line for way in ways for line in wrapped(way, 24, 3)]

    def _size_of_words(self, tail: int, into: int) -> tuple[float, float]:
        lines = self._words(tail, into)
        return max(width_of(line, _FIRING) for line in lines) + 6, len(lines) * _LINE + 2

    def _loops_width(self) -> float:
        return max((30 + self._size_of_words(i, i)[0] for i, into in self.fired if i == into), default=0.0)

    def _spot(self, i: int) -> Point:
        x, y = self.where.centres[i]
        return x + _MARGIN, y + _TOP

    def lines(self) -> Iterator[str]:
        """The picture, line by line."""
        title = f"{self.net.name}: reachability graph"
        yield from opening(self.width, self.bottom + 24, _STYLE, title, self.net.name, self.caption)
        for pair, route in zip(self.joined, self.where.routes, strict=True):
            yield from self._edge(*pair, route)
        for i in range(len(self.graph.markings)):
            yield from self._marking(i)
        for i, into in self.fired:
            if i == into:
                yield from self._loop(i)
        yield from self._legend()
        yield "</svg>"

    def _told(self, tail: int, into: int) -> str:
        """An edge in words: what fires, the tokens taken and put."""
        before, after = self.graph.markings[tail], self.graph.markings[into]
        taken, put = self.net.names(before & ~after), self.net.names(after & ~before)
        ways = "; ".join(" + ".join(fired) for fired in self.fired[tail, into])
        return f"M{tail} → M{into}: {ways}\n{', '.join(taken) or '∅'} → {', '.join(put) or '∅'}"

    def _edge(self, tail: int, into: int, route: Route) -> Iterator[str]:
        points = [(x + _MARGIN, y + _TOP) for x, y in route.points]
        start, *rest = points
        curves = "".join("C" + " ".join(f"{px(x)} {px(y)}" for x, y in rest[k : k + 3]) for k in range(0, len(rest), 3))
        yield f"<g {ident('firing', str(tail), str(into))}><title>{esc(self._told(tail, into))}</title>"
        yield f'<path class="arc" d="M{px(start[0])} {px(start[1])}{curves}"/>'
        (x, y), (end_x, end_y) = next(p for p in reversed(points[:-1]) if p != points[-1]), points[-1]
        length = ((end_x - x) ** 2 + (end_y - y) ** 2) ** 0.5
        yield head(end_x, end_y, (end_x - x) / length, (end_y - y) / length)
        yield from self._words_at(self._words(tail, into), route.words[0] + _MARGIN, route.words[1] + _TOP)
        yield "</g>"

    def _words_at(self, lines: Sequence[str], x: float, y: float, anchor: str = "middle") -> Iterator[str]:
        for k, line in enumerate(lines):
            at = y + (k - (len(lines) - 1) / 2) * _LINE + 4
            yield f'<text class="firing" x="{px(x)}" y="{px(at)}" text-anchor="{anchor}">{esc(line)}</text>'

    def _loop(self, i: int) -> Iterator[str]:
        """A firing that changes nothing: a bow at the right of its marking."""
        x, y = self._spot(i)
        x += self.boxes[i].width / 2
        yield f"<g {ident('firing', str(i), str(i))}><title>{esc(self._told(i, i))}</title>"
        yield f'<path class="arc" d="M{px(x)} {px(y - 7)}c26 -10 26 24 0 14"/>'
        yield head(x, y + 7, -0.93, -0.37)
        yield from self._words_at(self._words(i, i), x + 24, y, "start")
        yield "</g>"

    def _marking(self, i: int) -> Iterator[str]:
        (x, y), box = self._spot(i), self.boxes[i]
        left, top = x - box.width / 2, y - box.height / 2
        css = "deadlock" if i in self.graph.deadlocks else "doomed" if i in self.graph.doomed else "marking"
        held = ", ".join(self.net.names(self.graph.markings[i])) or "no token"
        far = f", {self.depth[i]} firings from M0" if self.is_wrapped else ""
        yield f"<g {ident('marking', str(i))}><title>M{i}{far}: {esc(held)}</title>"
        yield from _box("initial" if i == 0 and css == "marking" else css, left, top, box.width, box.height)
        for k, (text, style) in enumerate(self.texts[i]):
            yield (
                f'<text class="{style}" x="{px(x)}" y="{px(top + 17 + k * _LINE)}" text-anchor="middle">'
                f"{esc(text)}</text>"
            )
        beyond = self.graph.beyond[i] if self.graph.beyond else 0
        if beyond:
            bottom = y + box.height / 2
            yield f'<path class="more" d="M{px(left + 10)} {px(bottom)}v11"/>'
            yield f'<text class="note" x="{px(left + 14)}" y="{px(bottom + 11)}">{beyond} more</text>'
        yield "</g>"

    def _legend_items(self) -> Iterator[tuple[str, str]]:
        graph = self.graph
        if graph.markings:
            yield "initial", "M0, with all its tokens"
        if len(graph.markings) > 1:
            yield "marking", "marking: what is different from M0"
            yield "arc", "firing"
        if graph.deadlocks:
            yield "deadlock", "deadlock"
        if graph.doomed - graph.deadlocks:
            yield "doomed", "doomed: a deadlock can no longer be avoided"
        if any(graph.beyond):
            yield "more", "firings to markings that are not drawn"

    def _legend(self) -> Iterator[str]:
        x, y = _MARGIN, self.bottom
        for sign, words in self.legend:
            if sign == "arc":
                yield f'<path class="arc" d="M{px(x)} {px(y)}h30"/>'
                yield head(x + 36, y, 1, 0)
            elif sign == "more":
                yield f'<path class="more" d="M{px(x + 18)} {px(y - 6)}v12"/>'
            else:
                yield from _box(sign, x, y - 8, 36, 16)
            yield f'<text class="note" x="{px(x + 44)}" y="{px(y + 3.5)}">{esc(words)}</text>'
            x += 46 + width_of(words, NOTE) + 14


def _box(css: str, x: float, y: float, width: float, height: float) -> Iterator[str]:
    """The box of a marking; that of a deadlock has a double rim."""
    size = f'width="{px(width)}" height="{px(height)}"'
    yield f'<rect class="{css}" x="{px(x)}" y="{px(y)}" {size} rx="6"/>'
    if css == "deadlock":
        yield (
            f'<rect class="rim" x="{px(x + 3)}" y="{px(y + 3)}" width="{px(width - 6)}" '
            f'height="{px(height - 6)}" rx="4"/>'
        )
