"""A net without lanes: places and bars wherever a layouter puts them, arcs as curves between them.

Lanes are the better picture of a cell, because who takes part is what is looked for. Of a net that has no controllers,
or that came from elsewhere, they show one broad box, and the shape of the net is better seen if its nodes may stand
anywhere. What places them is a `Layouter`, as for reachability graphs: firable's own, Graphviz, or ELK. Signs, styles
and ids are those of the picture with lanes, so that whoever reads one reads the other; a controller is a tint behind
its places, with its name in the legend.

Each node is a box with its sign in the middle and its words at the right, so a layouter that knows only boxes keeps the
words free. Arcs lead to the box, and from its rim straight to the sign.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from firable.nets.drawing.colours import colours
from firable.nets.drawing.labels import local_name, place_words
from firable.nets.drawing.layered import Box, Layouter, Link, Point, Route, layered
from firable.nets.drawing.legend import gate_end, legend, legend_items, legend_rows
from firable.nets.drawing.rows import depths
from firable.nets.drawing.shapes import BAR_HALF_HEIGHT, BAR_HALF_WIDTH, RADIUS, Kind
from firable.nets.drawing.sheet import MARGIN, TOP, least_width, opening, scoped
from firable.nets.drawing.styles import STYLE
from firable.nets.drawing.text import COMMAND, NAME, NOTE, Style, Words, width_of, wrapped
from firable.nets.drawing.xml import esc, head, ident, px
from firable.nets.net import Marking, Net

_LINE: Final = 14.0
_SIGNAL: Final = Style("signal", 6.5)
_NOTE_CHARACTERS: Final = 20
_HALO: Final = "text{paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}"
"""Words are read over a line that a layouter leads to the side of a box."""


def draw_free(
    net: Net,
    *,
    marking: Marking | None = None,
    firings: Sequence[Iterable[str]] = (),
    caption: str = "",
    layout: Layouter = layered,
) -> str:
    """The net as SVG, placed by a layouter instead of in lanes; the parameters and ids are those of `draw_net`.

    >>> draw_free(Net("empty")).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    steps: dict[str, list[int]] = {}
    for k, fired in enumerate(firings, start=1):
        for name in fired:
            steps.setdefault(name, []).append(k)
    marked = net.initial_marking if marking is None else marking
    return "\n".join(_Writer(net, marked, steps, caption or net.description, layout).lines()) + "\n"


class _Writer:
    """One picture: places are the first boxes, transitions those behind them."""

    def __init__(
        self, net: Net, marking: Marking, steps: Mapping[str, Sequence[int]], caption: str, layout: Layouter
    ) -> None:
        self.net, self.marking, self.steps, self.caption = net, marking, steps, caption
        self.words = [place_words(place) for place in net.places] + [self._said(t) for t in range(len(net.transitions))]
        n = len(net.places)
        halves = [RADIUS + 6] * n + [BAR_HALF_WIDTH + 6] * len(net.transitions)
        self.halves = halves
        boxes = [
            Box(
                2 * (half + max(_width(line) for line in words)),
                max(2 * RADIUS, _LINE * len(words)),
                row,
                2 * half - 12,
            )
            for half, words, row in zip(halves, self.words, self._rows(), strict=True)
        ]
        self.boxes = boxes
        ends: dict[tuple[int, int], None] = {}
        for kind, p, t in self._edges():
            ends[(n + t, p) if kind is Kind.OUTPUT else (p, n + t)] = None
        self.where = layout(boxes, [Link(tail, into, 8.0, 2.0) for tail, into in ends])
        self.routes = dict(zip(ends, self.where.routes, strict=True))
        self.owners = [c.name for c in net.controllers if any(place.owner == c.name for place in net.places)]
        plain = [False] * len(net.transitions)
        items = list(legend_items(net, plain, macros=False, fired=bool(steps), stubs=False))
        items += [(f"owner:{i}", f"places of {owner}") for i, owner in enumerate(self.owners)]
        self.width = max(self.where.width + 2 * MARGIN, least_width(net.name, caption), 420.0)
        self.legend = legend_rows(items, self.width)
        self.bottom = TOP + self.where.height + 10

    def _said(self, t: int) -> Words:
        transition = self.net.transitions[t]
        gates = (
            ("if " if gate.wanted else "unless ") + local_name(gate.signal, self.net.signal(gate.signal).owner)
            for gate in transition.external
        )
        notes = wrapped(transition.description, _NOTE_CHARACTERS)
        return (transition.name, NAME), *((line, NOTE) for line in notes), *((line, _SIGNAL) for line in gates)

    def _rows(self) -> list[int]:
        """A row for each node, for layouters that want them: a place stands below what puts its first token there."""
        depth = depths(self.net)
        found = []
        for p, place in enumerate(self.net.places):
            before, after = self.net.producers[p], self.net.consumers[p]
            if before and not (place.marked and after):
                found.append(2 * min(depth[t] for t in before) + 1)
            else:
                found.append(2 * min((depth[t] for t in after), default=1) - 1)
        return [*found, *(2 * one for one in depth)]

    def _edges(self) -> Iterator[tuple[Kind, int, int]]:
        index = self.net.place_index
        for t, transition in enumerate(self.net.transitions):
            for kind, names in (
                (Kind.INPUT, transition.inputs),
                (Kind.OUTPUT, transition.outputs),
                (Kind.PERMISSIVE, transition.permissive),
                (Kind.INHIBITIVE, transition.inhibitive),
            ):
                yield from ((kind, index[name], t) for name in names)

    def _at(self, node: int) -> Point:
        x, y = self.where.centres[node]
        return x + MARGIN, y + TOP

    def lines(self) -> Iterator[str]:
        """The picture, line by line."""
        net = self.net
        height = self.bottom + 26 + 26 * len(self.legend)
        style = f"{STYLE}\n{scoped('free', _HALO)}"
        yield from opening(self.width, height, style, net.name, net.name, self.caption, net.description, scope="free")
        for p, place in enumerate(net.places):
            if place.owner is not None:
                yield from self._tint(p, place.owner)
        for kind, p, t in self._edges():
            yield from self._edge(kind, p, t)
        for t in range(len(net.transitions)):
            yield from self._bar(t)
        for p in range(len(net.places)):
            yield from self._place(p)
        yield from legend(self.legend, self.bottom)
        yield "</svg>"

    def _tint(self, p: int, owner: str) -> Iterator[str]:
        (x, y), box = self._at(p), self.boxes[p]
        fill, stroke = colours(self.owners.index(owner), owner)
        left, width = x - RADIUS - 5, self.halves[p] + box.width / 2
        yield (
            f'<rect x="{px(left)}" y="{px(y - box.height / 2 - 4)}" width="{px(width)}" '
            f'height="{px(box.height + 8)}" rx="8" fill="{fill}" stroke="{stroke}"/>'
        )

    def _edge(self, kind: Kind, p: int, t: int) -> Iterator[str]:
        n = len(self.net.places)
        to_place = kind is Kind.OUTPUT
        points = self._points(self.routes[(n + t, p) if to_place else (p, n + t)])
        at_place = self._on_circle(p, points[-1] if to_place else points[0])
        at_bar = self._on_bar(t, points[0] if to_place else points[-1], 0 if to_place else 1)
        first, last = (at_bar, at_place) if to_place else (at_place, at_bar)
        gate = kind in {Kind.PERMISSIVE, Kind.INHIBITIVE}
        if gate:
            last = self._on_bar(t, points[-1], 4)
        curves = "".join(
            "C" + " ".join(f"{px(x)} {px(y)}" for x, y in points[k : k + 3]) for k in range(1, len(points), 3)
        )
        begin, (end_x, end_y) = " ".join(map(px, points[0])), last
        path = f"M{px(first[0])} {px(first[1])}L{begin}{curves}L{px(end_x)} {px(end_y)}"
        ends = (self.net.transitions[t].name, self.net.places[p].name)
        yield f'<path {ident(kind, *ends)} class="{"gate" if gate else "arc"}" d="{path}"/>'
        if gate:
            yield gate_end(*last, permissive=kind is Kind.PERMISSIVE)
        else:
            yield head(*last, *_direction(next(q for q in (*reversed(points), first) if _apart(q, last)), last))

    def _points(self, route: Route) -> list[Point]:
        return [(x + MARGIN, y + TOP) for x, y in route.points]

    def _on_circle(self, p: int, near: Point) -> Point:
        x, y = self._at(p)
        dx, dy = _direction((x, y), near) if _apart(near, (x, y)) else (0.0, 1.0)
        return x + RADIUS * dx, y + RADIUS * dy

    def _on_bar(self, t: int, near: Point, gap: float) -> Point:
        x, y = self._at(len(self.net.places) + t)
        reach = BAR_HALF_WIDTH - 3
        side = -1.0 if near[1] < y else 1.0
        return min(max(near[0], x - reach), x + reach), y + side * (BAR_HALF_HEIGHT + gap)

    def _lines_at(self, node: int) -> Iterator[str]:
        x, y = self._at(node)
        words = self.words[node]
        for k, (text, style) in enumerate(words):
            at = y + (k - (len(words) - 1) / 2) * _LINE + 4.5
            sent = _sent(style)
            if sent:
                yield f'<path class="sendhead" d="M{px(x + self.halves[node] + 9)} {px(at - 3.5)}l-6 -2.8v5.6z"/>'
            yield f'<text class="{style.css}" x="{px(x + self.halves[node] + sent)}" y="{px(at)}">{esc(text)}</text>'

    def _bar(self, t: int) -> Iterator[str]:
        node = len(self.net.places) + t
        x, y = self._at(node)
        transition = self.net.transitions[t]
        steps = self.steps.get(transition.name, ())
        hint = "\n".join(filter(None, (transition.name, transition.description)))
        yield f"<g {ident('transition', transition.name)}><title>{esc(hint)}</title>"
        yield (
            f'<rect class="{"fired" if steps else "bar"}" x="{px(x - BAR_HALF_WIDTH)}" y="{px(y - BAR_HALF_HEIGHT)}" '
            f'width="{px(2 * BAR_HALF_WIDTH)}" height="{px(2 * BAR_HALF_HEIGHT)}" rx="1.5"/>'
        )
        yield from self._lines_at(node)
        if steps:
            shown = ", ".join(map(str, steps[:4])) + (", …" if len(steps) > 4 else "")
            yield f'<text class="step" x="{px(x - BAR_HALF_WIDTH)}" y="{px(y - 7)}" text-anchor="end">{shown}</text>'
        for gate in transition.external:
            not_wanted = () if gate.wanted else ("0",)
            yield f"<g {ident('gate', transition.name, gate.signal, *not_wanted)}/>"
        yield "</g>"

    def _place(self, p: int) -> Iterator[str]:
        x, y = self._at(p)
        place = self.net.places[p]
        hint = " — ".join(text for text in (place.name, place.description) if text)
        yield f"<g {ident('place', place.name)}><title>{esc(hint)}</title>"
        yield f'<circle class="place" cx="{px(x)}" cy="{px(y)}" r="{px(RADIUS)}"/>'
        if self.marking >> p & 1:
            yield f'<circle class="token" cx="{px(x)}" cy="{px(y)}" r="5.5"/>'
        yield from self._lines_at(p)
        yield "</g>"


def _sent(style: Style) -> float:
    """The room for the arrow before a command."""
    return 12.0 if style is COMMAND else 0.0


def _width(line: tuple[str, Style]) -> float:
    return width_of(*line) + _sent(line[1])


def _apart(one: Point, other: Point) -> bool:
    return abs(one[0] - other[0]) + abs(one[1] - other[1]) > 0.05


def _direction(start: Point, end: Point) -> Point:
    length = ((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2) ** 0.5
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length
