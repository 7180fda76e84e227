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

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from firable.nets.drawing.arrangement import Arrangement, Owner
from firable.nets.drawing.colours import colours
from firable.nets.drawing.folding import Folded, fold
from firable.nets.drawing.layout import FREE, arranged
from firable.nets.drawing.legend import gate_end, legend, legend_items, legend_rows
from firable.nets.drawing.part import everybody, part_of
from firable.nets.drawing.rows import depths
from firable.nets.drawing.shapes import (
    BAR_HALF_HEIGHT,
    BAR_HALF_WIDTH,
    LABEL_LEFT,
    RADIUS,
    STUB_LINE,
    WORDS_LINE,
    Bar,
    Edge,
    Kind,
    Lane,
    Spot,
    Stub,
)
from firable.nets.drawing.sheet import least_width, opening
from firable.nets.drawing.styles import STYLE
from firable.nets.drawing.text import COMMAND, width_of
from firable.nets.drawing.wrapping import Panel, wrapped_panels
from firable.nets.drawing.xml import esc, head, ident, px
from firable.nets.net import Marking, Net


def draw_net(
    net: Net,
    *,
    marking: Marking | None = None,
    firings: Sequence[Iterable[str]] = (),
    caption: str = "",
    folded: Collection[str] = (),
    owners: Collection[Owner] | None = None,
    given: Arrangement = FREE,
    width_max: float | None = None,
) -> str:
    """The net as SVG.

    `marking` is shown instead of M0; `firings` marks each transition with the numbers, from 1, of the steps in which it
    fires; `caption` is the line under the title, by default the description of the net. `folded` names the tasks that
    are drawn as one place, as `fold` does, with its `KeyError`. Of some `owners` alone the places are drawn, and the
    transitions that they take part in, which say who else does. `given` settles lanes, rows and tracks. Lanes that are
    wider than `width_max`, in pixels, are wrapped.

    >>> draw_net(Net("empty")).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    steps: dict[str, list[int]] = {}
    for k, fired in enumerate(firings, start=1):
        for name in fired:
            steps.setdefault(name, []).append(k)
    participants = everybody(net)
    shown = net
    if owners is not None:  # what is left out still says what comes first
        shown = part_of(net, owners, participants)
        deep = {t.name: float(depth) for t, depth in zip(net.transitions, depths(net), strict=True)}
        given = replace(given, rows=given.rows or deep)
    whole = fold(shown, folded, participants)
    marked = whole.marking(net, net.initial_marking if marking is None else marking)
    if whole.members:  # what is folded away still says what comes first
        settled = arranged(shown, replace(given, participants=participants))
        given = replace(settled, tracks=given.tracks)
    panels = wrapped_panels(whole, given, width_max)
    caption = caption or net.description
    items = list(
        legend_items(whole.net, whole.is_global, macros=bool(whole.members), fired=bool(steps)),
    )
    width = max([least_width(net.name, caption), 420.0, *(panel.where.width for panel in panels)])
    rows = legend_rows(items, width)
    bottom = panels[-1].top + panels[-1].where.bottom
    lines = [*opening(width, bottom + 26 + 26 * len(rows), STYLE, net.name, net.name, caption, net.description)]
    for number, panel in enumerate(panels, start=1):
        lines += _Writer(panel, number, marked, whole, steps).lines()
    return "\n".join([*lines, *legend(rows, bottom), "</svg>"]) + "\n"


class _Writer:
    """One panel of a picture: its part of the net, where everything stands, and what is to be shown on it."""

    def __init__(
        self, panel: Panel, number: int, marking: Marking, whole: Folded, steps: Mapping[str, Sequence[int]]
    ) -> None:
        self.panel, self.number, self.net, self.where, self.steps = panel, number, panel.net, panel.where, steps
        self.marked = set(whole.net.names(marking))
        self.members = whole.members

    def lines(self) -> Iterator[str]:
        """The panel, line by line; one below the first is moved down as a whole."""
        if self.panel.top:
            yield f'<g transform="translate(0 {px(self.panel.top)})">'
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
        if self.panel.top:
            yield "</g>"

    def _lane_at(self, x: float) -> int:
        return max((i for i, lane in enumerate(self.where.lanes) if lane.x <= x), default=0)

    def _lane(self, i: int, lane: Lane) -> Iterator[str]:
        fill, stroke = colours(self.panel.first_lane + i, lane.owner)
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
        if bar.in_margin and (leader := self._leader(bar)):
            yield f'<path class="leader" d="{leader}"/>'
        if len(bar.segments) > 1:
            yield f'<path class="tie" d="M{px(bar.segments[0][1])} {y}H{px(bar.segments[-1][0])}"/>'

    def _leader(self, bar: Bar) -> str:
        """The line from a name in the margin to its bar, left out where a bar that is none of it stands in the row."""
        x, end, y = 24 + self.where.margin_labels + 8, bar.segments[0][0], px(bar.y)
        found = ""
        for other in sorted(self.where.bars, key=lambda one: one.segments[0][0]):
            left, right = other.segments[0][0] - 14, other.segments[-1][1] + 14
            if other.in_margin or other.y != bar.y or left > end:
                continue
            found += f"M{px(x)} {y}H{px(left)}" if left > x else ""
            x = max(x, right + width_of(*other.words[0]))
        return found + (f"M{px(x)} {y}H{px(end)}" if end > x else "")

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
        lane = self._lane_at(edge.x)
        fill, _ = colours(self.panel.first_lane + lane, self.where.lanes[lane].owner)
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
        yield gate_end(edge.x, y, permissive=edge.kind is Kind.PERMISSIVE)

    def _bar(self, t: int, bar: Bar) -> Iterator[str]:
        transition = self.net.transitions[t]
        steps = self.steps.get(transition.name, ())
        again = [] if transition.name not in self.panel.again else [str(self.number)]
        yield f"<g {ident('transition', transition.name, *again)}><title>{esc(self._told(t))}</title>"
        for start, end in bar.segments:
            yield (
                f'<rect class="{"fired" if steps else "bar"}" x="{px(start)}" y="{px(bar.y - BAR_HALF_HEIGHT)}" '
                f'width="{px(end - start)}" height="{px(2 * BAR_HALF_HEIGHT)}" rx="1.5"/>'
            )
        lines = bar.words
        if bar.in_margin:
            x, y = 24.0, bar.y - (len(lines) - 1) * WORDS_LINE / 2 + 4
        else:
            x, y = bar.segments[-1][1] + 8, bar.y + 4.5
        for k, (text, style) in enumerate(lines):
            yield f'<text class="{style.css}" x="{px(x)}" y="{px(y + k * WORDS_LINE)}">{esc(text)}</text>'
        if steps:
            shown = ", ".join(map(str, steps[:4])) + (", …" if len(steps) > 4 else "")
            yield (
                f'<text class="step" x="{px(bar.segments[0][0])}" y="{px(bar.y - 7)}" text-anchor="end">{shown}</text>'
            )
        yield "</g>"

    def _stub(self, stub: Stub) -> Iterator[str]:
        y = self.where.bars[stub.transition].y - BAR_HALF_HEIGHT - 4
        x = stub.x + BAR_HALF_WIDTH - 7 - 9 * (stub.slot % 4)  # each its own end: one may be a dot, the other a circle
        far_x, far_y = stub.x + BAR_HALF_WIDTH + 6, y - 7 - STUB_LINE * stub.slot
        not_wanted = () if stub.gate.wanted else ("0",)  # a signal may be wanted both 1 and 0
        yield f"<g {ident('gate', self.net.transitions[stub.transition].name, stub.gate.signal, *not_wanted)}>"
        yield f'<path class="stub" d="M{px(far_x)} {px(far_y)}L{px(x)} {px(y)}"/>'
        yield gate_end(x, y, permissive=stub.gate.wanted)
        yield f'<text class="signal" x="{px(far_x + 3)}" y="{px(far_y + 2.5)}">{esc(stub.label)}</text></g>'

    def _place(self, p: int, spot: Spot) -> Iterator[str]:
        place = self.net.places[p]
        lines = spot.words
        inside = self.members.get(place.name, ())
        hint = " — ".join(text for text in (", ".join(inside) or place.name, place.description) if text)
        yield f"<g {ident('place', place.name)}><title>{esc(hint)}</title>"
        css = "macro" if spot.is_macro else "place"
        yield f'<circle class="{css}" cx="{px(spot.x)}" cy="{px(spot.y)}" r="{px(RADIUS)}"/>'
        if spot.is_macro:
            yield f'<circle class="macro" cx="{px(spot.x)}" cy="{px(spot.y)}" r="{px(RADIUS - 4)}"/>'
        if place.name in self.marked:
            yield f'<circle class="token" cx="{px(spot.x)}" cy="{px(spot.y)}" r="5.5"/>'
        y = spot.y - (len(lines) - 1) * WORDS_LINE / 2 + 4.5
        for k, (text, style) in enumerate(lines):
            x, line_y = spot.x + LABEL_LEFT, y + k * WORDS_LINE
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


def _send(spot: Spot, y: float) -> Iterator[str]:
    """The small arrow that goes out of a place to its command."""
    dy = y - spot.y
    x = spot.x + (RADIUS**2 - dy**2) ** 0.5
    end = spot.x + LABEL_LEFT + 9
    yield f'<path class="send" d="M{px(x)} {px(y)}H{px(end - 5)}"/>'
    yield f'<path class="sendhead" d="M{px(end)} {px(y)}l-6 -2.8v5.6z"/>'
