"""Writing a layout down as SVG, in the conventions of the field.

Circles are places and bars transitions; a black dot in a circle is its token; an arc ends in an arrowhead. A permissive
gate arc is dashed and ends at the transition in a black dot, an inhibitive one in a hollow circle; external gates are
short stubs with the name of the signal. A place with an output signal has a small arrow going out to the command.

The text is deterministic: the same net, marking and steps give the same bytes, so that pictures can be compared in
reviews. It contains no script, no link and no font; every name is escaped. What is of the net bears a stable id, of its
kind and its names, which hold no colon: `place:robot.free`, `transition:G2`, `lane:robot`, `input:G2:robot.free` (and
output, permissive, inhibitive), `gate:G1:conveyor.part_at_entry`. Pages and style sheets find it by that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from firable.nets.drawing.layout import label_lines, layout, transition_lines
from firable.nets.drawing.shapes import (
    BAR_HALF_HEIGHT,
    BAR_HALF_WIDTH,
    LABEL_LEFT,
    RADIUS,
    Bar,
    Edge,
    Kind,
    Lane,
    Layout,
    Spot,
    Stub,
)
from firable.nets.drawing.text import COMMAND, NAME, NOTE, width_of
from firable.nets.drawing.xml import esc, head, ident, px
from firable.nets.net import Marking, Net

_TINTS: Final = ("#eef3fb", "#eef8f1", "#fdf4e7", "#f6effa", "#e9f6f8", "#fbeff0", "#f4f5ea", "#f1f1f5")
_EDGES: Final = ("#b9cbe8", "#b5dcc3", "#ecd2a2", "#d8c1e6", "#a9d6de", "#e8bfc4", "#d3d8ab", "#c9c9d6")
_UNOWNED: Final = ("#fafafa", "#d0d0d0")
_LEGEND_HEIGHT: Final = 64.0
_LINE: Final = 14.0

_STYLE: Final = """
text{font-family:'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;fill:#1d2733}
.title{font-size:21px;font-weight:700}
.subtitle{font-size:12.5px;fill:#5b6775}
.lane{font-size:15px;font-weight:700}
.name{font-size:13px;font-weight:600}
.note{font-size:10.5px;fill:#6a7683}
.command{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#9a4b00}
.signal{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#0b6b74}
.step{font-size:10.5px;font-weight:700;fill:#b3123b}
.place{fill:#fff;stroke:#1d2733;stroke-width:1.8}
.token{fill:#1d2733}
.bar{fill:#1d2733}
.fired{fill:#b3123b}
.tie{stroke:#1d2733;stroke-width:1.6}
.leader{stroke:#9aa6b2;stroke-width:1;stroke-dasharray:1.5 3.5}
.arc{fill:none;stroke:#3b4855;stroke-width:1.5}
.gate{fill:none;stroke:#3b4855;stroke-width:1.5;stroke-dasharray:5 3.5}
.stub{fill:none;stroke:#0b6b74;stroke-width:1.3;stroke-dasharray:3 2.2}
.send{fill:none;stroke:#9a4b00;stroke-width:1.3}
.dot{fill:#1d2733}
.hollow{fill:#fff;stroke:#1d2733;stroke-width:1.4}
.head{fill:#3b4855}
.sendhead{fill:#9a4b00}
""".strip()


def draw_net(
    net: Net,
    *,
    marking: Marking | None = None,
    firings: Sequence[Iterable[str]] = (),
    caption: str = "",
) -> str:
    """The net as SVG.

    `marking` is shown instead of M0; `firings` marks each transition with the numbers, from 1, of the steps in which it
    fires; `caption` is the line under the title, by default the description of the net.

    >>> draw_net(Net("empty")).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    steps: dict[str, list[int]] = {}
    for k, fired in enumerate(firings, start=1):
        for name in fired:
            steps.setdefault(name, []).append(k)
    marked = net.initial_marking if marking is None else marking
    return "\n".join(_Writer(net, layout(net), marked, steps, caption or net.description).lines()) + "\n"


class _Writer:
    """One drawing: the net, where everything stands, and what is to be shown on it."""

    def __init__(
        self, net: Net, where: Layout, marking: Marking, steps: Mapping[str, Sequence[int]], caption: str
    ) -> None:
        self.net, self.where, self.marking, self.steps, self.caption = net, where, marking, steps, caption
        self.legend = tuple(self._legend_items())
        title = max(width_of(net.name, NAME) * 1.7, width_of(caption, NOTE) * 1.2)
        self.width = max(where.width, title + 48, 420.0)
        self.legend_rows = self._legend_rows()
        self.height = where.bottom + 12 + 26 * len(self.legend_rows) + 14

    def lines(self) -> Iterator[str]:
        width, height = px(self.width), px(self.height)
        yield (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}" role="img">'
        )
        yield f"<title>{esc(self.net.name)}</title>"
        if self.net.description:
            yield f"<desc>{esc(self.net.description)}</desc>"
        yield f"<style>{_STYLE}</style>"
        yield f'<rect width="{width}" height="{height}" fill="#fff"/>'
        yield f'<text class="title" x="24" y="34">{esc(self.net.name)}</text>'
        yield f'<text class="subtitle" x="24" y="53">{esc(self.caption)}</text>'
        for i, lane in enumerate(self.where.lanes):
            yield from self._lane(i, lane)
        for bar in self.where.bars:
            yield from self._tie(bar)
        for edge in self.where.edges:
            yield from self._halo(edge)
        for edge in self.where.edges:
            yield from self._edge(edge)
        for t, bar in enumerate(self.where.bars):
            yield from self._bar(t, bar)
        for edge in self.where.edges:
            yield from self._gate_end(edge)
        for stub in self.where.stubs:
            yield from self._stub(stub)
        for p, spot in enumerate(self.where.places):
            yield from self._place(p, spot)
        yield from self._legend()
        yield "</svg>"

    def _colours(self, lane: int) -> tuple[str, str]:
        if self.where.lanes[lane].owner is None:
            return _UNOWNED
        return _TINTS[lane % len(_TINTS)], _EDGES[lane % len(_EDGES)]

    def _lane_at(self, x: float) -> int:
        return max((i for i, lane in enumerate(self.where.lanes) if lane.x <= x), default=0)

    def _lane(self, i: int, lane: Lane) -> Iterator[str]:
        fill, stroke = self._colours(i)
        top, bottom = self.where.top, self.where.bottom
        name = "" if lane.owner is None else f"{ident('lane', lane.owner)} "
        yield (
            f'<rect {name}x="{px(lane.x)}" y="{px(top)}" width="{px(lane.width)}" height="{px(bottom - top)}" rx="10" '
            f'fill="{fill}" stroke="{stroke}"/>'
        )
        if lane.owner is None:
            return
        controller = next(c for c in self.net.controllers if c.name == lane.owner)
        role = "coordinator" if controller.coordinator else ""
        yield (
            f'<text class="lane" x="{px(lane.x + 14)}" y="{px(top + 24)}">{esc(lane.owner)}'
            f'<tspan class="note" dx="4" font-weight="400">{role}</tspan></text>'
        )
        yield f'<text class="note" x="{px(lane.x + 14)}" y="{px(top + 40)}">{esc(controller.description)}</text>'

    def _tie(self, bar: Bar) -> Iterator[str]:
        y = px(bar.y)
        if bar.is_global:
            yield f'<path class="leader" d="M{px(24 + self.where.margin_labels + 8)} {y}H{px(bar.segments[0][0])}"/>'
        if len(bar.segments) > 1:
            yield f'<path class="tie" d="M{px(bar.segments[0][1])} {y}H{px(bar.segments[-1][0])}"/>'

    def _path(self, edge: Edge) -> str:
        """The line of an edge from the circle to the bar."""
        spot, bar = self.where.places[edge.place], self.where.bars[edge.transition]
        up = bar.y < spot.y
        sign = -1.0 if up else 1.0
        end = bar.y - sign * (BAR_HALF_HEIGHT + (0 if edge.kind is Kind.OUTPUT else 1))
        if not edge.bypass:
            return f"M{px(spot.x)} {px(spot.y + sign * RADIUS)}V{px(end)}"
        start_x, start_y = spot.x - RADIUS * 0.85, spot.y + sign * RADIUS * 0.53
        bend = spot.y + sign * (RADIUS + 14)
        return (
            f"M{px(start_x)} {px(start_y)}C{px(start_x - 9)} {px(start_y + sign * 5)} {px(edge.x)} "
            f"{px(start_y + sign * 6)} {px(edge.x)} {px(bend)}V{px(end)}"
        )

    def _halo(self, edge: Edge) -> Iterator[str]:
        """A broad line in the colour of the lane: it breaks the ties that the edge crosses, as a bridge does."""
        fill, _ = self._colours(self._lane_at(edge.x))
        yield f'<path d="{self._path(edge)}" fill="none" stroke="{fill}" stroke-width="7"/>'

    def _edge(self, edge: Edge) -> Iterator[str]:
        gate = edge.kind in {Kind.PERMISSIVE, Kind.INHIBITIVE}
        ends = (self.net.transitions[edge.transition].name, self.net.places[edge.place].name)
        yield f'<path {ident(edge.kind, *ends)} class="{"gate" if gate else "arc"}" d="{self._path(edge)}"/>'
        spot, bar = self.where.places[edge.place], self.where.bars[edge.transition]
        sign = -1.0 if bar.y < spot.y else 1.0
        if edge.kind is Kind.INPUT:
            yield head(edge.x, bar.y - sign * (BAR_HALF_HEIGHT + 0.5), 0, sign)
        elif edge.kind is Kind.OUTPUT:
            if edge.bypass:
                yield head(spot.x - RADIUS * 0.85, spot.y + sign * RADIUS * 0.53, 0.85, -sign * 0.53)
            else:
                yield head(spot.x, spot.y + sign * RADIUS, 0, -sign)

    def _gate_end(self, edge: Edge) -> Iterator[str]:
        if edge.kind in {Kind.INPUT, Kind.OUTPUT}:
            return
        bar = self.where.bars[edge.transition]
        sign = -1.0 if bar.y < self.where.places[edge.place].y else 1.0
        y = bar.y - sign * (BAR_HALF_HEIGHT + 4)
        yield _end(edge.x, y, permissive=edge.kind is Kind.PERMISSIVE)

    def _bar(self, t: int, bar: Bar) -> Iterator[str]:
        transition = self.net.transitions[t]
        steps = self.steps.get(transition.name, ())
        yield f"<g {ident('transition', transition.name)}><title>{esc(self._told(t))}</title>"
        for start, end in bar.segments:
            yield (
                f'<rect class="{"fired" if steps else "bar"}" x="{px(start)}" y="{px(bar.y - BAR_HALF_HEIGHT)}" '
                f'width="{px(end - start)}" height="{px(2 * BAR_HALF_HEIGHT)}" rx="1.5"/>'
            )
        lines = transition_lines(self.net, t, is_global=bar.is_global)
        if bar.is_global:
            x, y = 24.0, bar.y - (len(lines) - 1) * _LINE / 2 + 4
        else:
            x, y = bar.segments[-1][1] + 8, bar.y + 4.5
        for k, (text, style) in enumerate(lines):
            yield f'<text class="{style.css}" x="{px(x)}" y="{px(y + k * _LINE)}">{esc(text)}</text>'
        if steps:
            shown = ", ".join(map(str, steps[:4])) + (", …" if len(steps) > 4 else "")
            yield (
                f'<text class="step" x="{px(bar.segments[0][0])}" y="{px(bar.y - 7)}" text-anchor="end">{shown}</text>'
            )
        yield "</g>"

    def _stub(self, stub: Stub) -> Iterator[str]:
        y = self.where.bars[stub.transition].y - BAR_HALF_HEIGHT - 4
        x = stub.x + BAR_HALF_WIDTH - 7 - 9 * (stub.slot % 4)  # each its own end: one may be a dot, the other a circle
        far_x, far_y = stub.x + BAR_HALF_WIDTH + 6, y - 7 - 12 * stub.slot
        not_wanted = () if stub.gate.wanted else ("0",)  # a signal may be wanted both 1 and 0
        yield f"<g {ident('gate', self.net.transitions[stub.transition].name, stub.gate.signal, *not_wanted)}>"
        yield f'<path class="stub" d="M{px(far_x)} {px(far_y)}L{px(x)} {px(y)}"/>'
        yield _end(x, y, permissive=stub.gate.wanted)
        yield f'<text class="signal" x="{px(far_x + 3)}" y="{px(far_y + 2.5)}">{esc(stub.label)}</text></g>'

    def _place(self, p: int, spot: Spot) -> Iterator[str]:
        place = self.net.places[p]
        lines = label_lines(place)
        hint = " — ".join(text for text in (place.name, place.description) if text)
        yield f"<g {ident('place', place.name)}><title>{esc(hint)}</title>"
        yield f'<circle class="place" cx="{px(spot.x)}" cy="{px(spot.y)}" r="{px(RADIUS)}"/>'
        if self.marking >> p & 1:
            yield f'<circle class="token" cx="{px(spot.x)}" cy="{px(spot.y)}" r="5.5"/>'
        y = spot.y - (len(lines) - 1) * _LINE / 2 + 4.5
        for k, (text, style) in enumerate(lines):
            x, line_y = spot.x + LABEL_LEFT, y + k * _LINE
            if style is COMMAND:
                yield from _send(spot, line_y - 3.5)
                x += 12
            yield f'<text class="{style.css}" x="{px(x)}" y="{px(line_y)}">{esc(text)}</text>'
        yield "</g>"

    def _told(self, t: int) -> str:
        transition = self.net.transitions[t]
        number = f" (number {transition.number})" if transition.number is not None else ""
        arcs = f"{', '.join(transition.inputs) or '∅'} → {', '.join(transition.outputs) or '∅'}"
        return "\n".join(filter(None, (f"{transition.name}{number}", transition.description, arcs)))

    def _legend_items(self) -> Iterator[tuple[str, str]]:
        """The signs that this drawing uses, each as (sign, words)."""
        net = self.net
        if net.places:
            yield "place", "place, with its token"
        if any(not bar.is_global for bar in self.where.bars):
            yield "local", "transition"
        if any(bar.is_global for bar in self.where.bars):
            yield "global", "global transition: one part in each controller"
        if any(transition.permissive for transition in net.transitions):
            yield "permissive", "permissive gate"
        if any(transition.inhibitive for transition in net.transitions):
            yield "inhibitive", "inhibitive gate"
        if any(gate.wanted for transition in net.transitions for gate in transition.external):
            yield "external", "external gate: opens with the signal"
        if any(not gate.wanted for transition in net.transitions for gate in transition.external):
            yield "external-inhibitive", "external gate: closes with the signal"
        if any(place.command for place in net.places):
            yield "command", "command sent on entry"
        if self.steps:
            yield "fired", "fired, in these steps"

    def _legend_rows(self) -> list[list[tuple[float, str, str]]]:
        rows: list[list[tuple[float, str, str]]] = [[]]
        x = 24.0
        for sign, words in self.legend:
            width = 46 + width_of(words, NOTE) + 8
            if rows[-1] and x + width > self.width - 10:
                rows.append([])
                x = 24.0
            rows[-1].append((x, sign, words))
            x += width
        return rows

    def _legend(self) -> Iterator[str]:
        for i, row in enumerate(self.legend_rows):
            y = self.where.bottom + 26 + 26 * i
            for x, sign, words in row:
                yield from _sign(sign, x, y)
                yield f'<text class="note" x="{px(x + 46)}" y="{px(y + 3.5)}">{esc(words)}</text>'


def _sign(sign: str, x: float, y: float) -> Iterator[str]:
    """A sign of the legend in a field of 40 pixels."""
    middle = x + 20
    match sign:
        case "place":
            yield f'<circle class="place" cx="{px(middle)}" cy="{px(y)}" r="9"/>'
            yield f'<circle class="token" cx="{px(middle)}" cy="{px(y)}" r="3.5"/>'
        case "local" | "fired":
            css = "bar" if sign == "local" else "fired"
            yield f'<rect class="{css}" x="{px(x + 6)}" y="{px(y - 3)}" width="28" height="6" rx="1.5"/>'
        case "global":
            yield f'<path class="tie" d="M{px(x)} {px(y)}H{px(x + 40)}"/>'
            for start in (x, x + 26):
                yield f'<rect class="bar" x="{px(start)}" y="{px(y - 3)}" width="14" height="6" rx="1.5"/>'
        case "permissive" | "inhibitive":
            yield f'<path class="gate" d="M{px(x + 2)} {px(y)}H{px(x + 33)}"/>'
            yield _end(x + 34, y, permissive=sign == "permissive")
        case "external" | "external-inhibitive":
            yield f'<path class="stub" d="M{px(x + 36)} {px(y - 6)}L{px(x + 20)} {px(y + 2)}"/>'
            yield _end(x + 20, y + 2, permissive=sign == "external")
        case "command":
            yield f'<path class="send" d="M{px(x + 12)} {px(y)}H{px(x + 28)}"/>'
            yield f'<path class="sendhead" d="M{px(x + 34)} {px(y)}l-7 -3.2v6.4z"/>'


def _send(spot: Spot, y: float) -> Iterator[str]:
    """The small arrow that goes out of a place to its command."""
    dy = y - spot.y
    x = spot.x + (RADIUS**2 - dy**2) ** 0.5
    end = spot.x + LABEL_LEFT + 9
    yield f'<path class="send" d="M{px(x)} {px(y)}H{px(end - 5)}"/>'
    yield f'<path class="sendhead" d="M{px(end)} {px(y)}l-6 -2.8v5.6z"/>'


def _end(x: float, y: float, *, permissive: bool) -> str:
    """The end of a gate at the transition: a black dot or a hollow circle."""
    css, radius = ("dot", "3.2") if permissive else ("hollow", "3.6")
    return f'<circle class="{css}" cx="{px(x)}" cy="{px(y)}" r="{radius}"/>'
