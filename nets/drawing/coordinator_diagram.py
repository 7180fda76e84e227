"""The coordinator diagram: who decides what over whom, the picture of a decomposition.

The coordinator table says with names and numbers which controllers take part in which global transition. This is that
table as a swimlane chart, to be shown to those who will wire the cell: a tinted box for each controller, above them the
coordinators that stand over them, and at the left a lane in which each transition that a coordinator decides is a box.
From it a line goes to the part of each participant, which says what it does there: the tokens that it takes and puts,
and the conditions under which it votes yes. A part without tokens votes and locks (a gate elsewhere reads its place),
and is drawn hollow. What competes stands behind one arbiter: a bracket joins those boxes and says by which rule.

Rows follow the work as in the picture of the net, so both can be laid side by side. Where the boxes are wider than the
sheet, they are cut into panels below each other; a transition appears in each panel where it has a part.

Rejected: a bipartite graph of controllers and transitions. It shows who is joined to whom, and loses what comes first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from firable.nets.decomposition import ArbitrationGroup, Coordinated, Decomposition, Part
from firable.nets.drawing.colours import colours
from firable.nets.drawing.coordinator_words import LABEL_CHARACTERS, count, hint, labels, over, rule, told_of
from firable.nets.drawing.layout import arranged
from firable.nets.drawing.legend import ROW_HEIGHT, legend_rows
from firable.nets.drawing.panels import panels
from firable.nets.drawing.sheet import MARGIN, TOP, least_width, opening, scoped
from firable.nets.drawing.text import NAME, NOTE, width_of, wrapped
from firable.nets.drawing.xml import esc, ident, px
from firable.nets.layers import Layers

WIDTH_MAX: Final = 1900.0
"""How wide a picture gets before its boxes are wrapped, in pixels."""
_LINE: Final = 14.0
_BAND: Final = 30.0
_HEADER: Final = 48.0
_GAP: Final = 12.0
_PADDING: Final = 12.0
_BAR: Final = 34.0
_ROW_GAP: Final = 20.0
_BOX_HEIGHT: Final = 22.0
_BRACKET: Final = 9.0
_DECISIONS_START: Final = 12.0  # of the boxes in their lane, beside the brackets
_LANE_TO_NAME: Final = 1.25  # how much wider the title of a lane is than a name

_STYLE: Final = """
.lane{font-size:15px;font-weight:700}
.band{font-size:13px;font-weight:700}
.name{font-size:13px;font-weight:600}
.note{font-size:10.5px;fill:#5b6775}
.contributes{font-size:12px;font-weight:600}
.flow{font-size:10.5px;fill:#1d2733}
.signal{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#0b6b74}
.bar{fill:#1d2733}
.reads{fill:#fff;stroke:#1d2733;stroke-width:1.6}
.tie{fill:none;stroke:#1d2733;stroke-width:1.6}
.decision{fill:#fff;stroke:#1d2733;stroke-width:1.8}
.decided{font-size:12px;font-weight:700}
.group{fill:none;stroke:#b3123b;stroke-width:1.6}
.apart{fill:none;stroke:#f7f8fa;stroke-width:6}
.over{fill:#e7ebf0;stroke:#9aa6b2}
""".strip()


def draw_coordinator(decomposition: Decomposition, *, width_max: float = WIDTH_MAX) -> str:
    """The coordinator diagram as SVG, at most `width_max` pixels wide where one controller is not wider than that.

    Ids: `coordinator:line` for the band of a coordinator, `controller:robot` for the box of a controller, `decision:G2`
    for the box of a transition, `part:G2:robot` for what a controller contributes to it, `group:robot_next` for what
    competes. What a second panel shows again bears the number of the panel behind its id: `decision:G2:2`.

    >>> from firable.nets.net import Net
    >>> draw_coordinator(Decomposition(Net("n"), (), (), ())).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    return "\n".join(_Writer(decomposition, width_max).lines()) + "\n"


@dataclass(frozen=True, slots=True)
class _Panel:
    """Some lanes, each with its left edge and its width, and the rows in which they take part."""

    lanes: tuple[tuple[int, float, float], ...]
    rows: tuple[Coordinated, ...]
    right: float


class _Writer:
    """One diagram."""

    def __init__(self, decomposition: Decomposition, width_max: float) -> None:
        self.decomposition, self.net, self.layers = decomposition, decomposition.net, Layers(decomposition.net)
        self.subnets = dict(zip((c.name for c in self.net.controllers), decomposition.subnets, strict=False))
        self.told = {
            (row.name, part.controller): told_of(part, self.subnets[part.controller])
            for row in decomposition.coordinated
            for part in row.parts
        }
        self.shown: set[tuple[str, str]] = set()
        self.owners, at = self._order()
        self.rows = sorted(decomposition.coordinated, key=lambda row: at[row.name])
        self.deciders = [
            name
            for name in self.layers.coordinators()
            if any((row.at or self.layers.root) == name for row in self.rows)
        ]
        self.n_groups = self._brackets()
        self.widths = [self._lane_width(owner) for owner in self.owners]
        self.decision_width = max([70.0, *(width_of(row.name, NAME) + 18 for row in self.rows)])
        self.pitch, self.decisions_width = self._decisions()
        # What takes part elsewhere is told at the left, where there is more than one panel.
        wrapped_at = width_max - 2 * MARGIN - self.decisions_width - _GAP
        wraps = sum(self.widths) + _GAP * len(self.widths) > wrapped_at
        said = [width_of(line, NOTE) for row in self.rows for line in labels(row)]
        self.labels_width = max([0.0, *said, *([LABEL_CHARACTERS * NOTE.character_px] if wraps else [])])
        self.decisions_x = MARGIN + self.labels_width + (20 if self.labels_width else 0)
        self.first_x = self.decisions_x + self.decisions_width + _GAP
        self.panels = list(self._panels(width_max - self.first_x - MARGIN))
        self.width = max(
            [panel.right + MARGIN for panel in self.panels] + [least_width(self.net.name, self._caption()), 480.0]
        )
        self.legend = self._legend_rows()

    def _order(self) -> tuple[list[str], Mapping[str, tuple[float, int]]]:
        """The controllers as they stand in the picture of the net, each coordinator before those under it, together."""
        whole = arranged(self.net)
        place = {name: i for i, name in enumerate(lane for lane in whole.lanes if lane is not None)}
        found: list[str] = []

        def mean(name: str) -> float:
            some = [place[one] for one in self._under(name) if one in place]
            return sum(some) / len(some) if some else len(place)

        def visit(name: str) -> None:
            if name in self.net_controllers:
                found.append(name)
            for child in sorted(self.layers.children.get(name, ()), key=mean):
                visit(child)

        self.net_controllers = {c.name for c in self.net.controllers}
        visit(self.layers.root)
        taking = {part.controller for row in self.decomposition.coordinated for part in row.parts}
        kept = [name for name in found if name in place or name in taking]
        return kept, {t.name: (whole.rows[t.name], i) for i, t in enumerate(self.net.transitions)}

    def _under(self, name: str) -> Iterator[str]:
        yield name
        for child in self.layers.children.get(name, ()):
            yield from self._under(child)

    def _brackets(self) -> int:
        """Give each group of several a column of its own for its bracket, shared where their rows do not meet."""
        row_of = {row.name: i for i, row in enumerate(self.rows)}
        self.groups = [
            group
            for group in self.decomposition.groups
            if sum(name in row_of for name in (*group.sequence, *group.rest)) > 1
        ]
        self.column: dict[str, int] = {}
        last: list[int] = []
        for group in sorted(self.groups, key=lambda group: min(self._members(group, row_of))):
            at = self._members(group, row_of)
            column = next((i for i, end in enumerate(last) if end < min(at)), len(last))
            last[column : column + 1] = [max(at)]
            self.column[group.name] = column
        return len(last)

    def _members(self, group: ArbitrationGroup, row_of: Mapping[str, int]) -> list[int]:
        return [row_of[name] for name in (*group.sequence, *group.rest) if name in row_of]

    def _lane_width(self, owner: str) -> float:
        parts = [told.width for (_, controller), told in self.told.items() if controller == owner]
        return (
            max(
                [
                    width_of(owner, NAME) * _LANE_TO_NAME,
                    width_of(self._owned(owner), NOTE),
                    *(_BAR + 6 + width for width in parts),
                ]
            )
            + 2 * _PADDING
        )

    def _owned(self, owner: str) -> str:
        subnet = next(
            s for c, s in zip(self.net.controllers, self.decomposition.subnets, strict=True) if c.name == owner
        )
        votes = sum(controller == owner for _, controller in self.told)
        alone = len(subnet.transitions) - votes
        return f"{count(len(subnet.places), 'place')}, votes for {votes}, fires {alone} alone"

    def _decisions(self) -> tuple[float, float]:
        """How far apart the deciders stand, and how wide the lane is that they share: no title leaves it or another."""
        several = len(self.deciders) > 1
        widths = [width_of(self._decides(name), NAME) * (1 if several else _LANE_TO_NAME) for name in self.deciders]
        # Titles stand in two rows by turns: over two columns there is room for one.
        pitch = max([self.decision_width + 16, *((width + _PADDING) / 2 for width in widths * several)])
        start = (_DECISIONS_START + _BRACKET * self.n_groups) if several else _PADDING
        boxes = _BRACKET * self.n_groups + len(self.deciders) * pitch + 16
        titles = (start + k * pitch + width + _PADDING for k, width in enumerate(widths))
        return pitch, max([boxes, *titles])

    def _decides(self, name: str) -> str:
        return f"{name} decides" if name in self.net_controllers else "coordinator decides"

    def _panels(self, room: float) -> Iterator[_Panel]:
        number = {owner: i for i, owner in enumerate(self.owners)}
        users = [{number[part.controller] for part in row.parts} for row in self.rows]
        for some in panels(self.widths, room, _GAP, users) or [range(0)]:
            lanes, x = [], self.first_x
            for i in some:
                lanes.append((i, x, self.widths[i]))
                x += self.widths[i] + _GAP
            yield self._panel(lanes, x - _GAP)

    def _panel(self, lanes: Sequence[tuple[int, float, float]], right: float) -> _Panel:
        here = {self.owners[i] for i, _, _ in lanes}
        rows = tuple(row for row in self.rows if any(part.controller in here for part in row.parts))
        return _Panel(tuple(lanes), rows, right)

    def _caption(self) -> str:
        n = len(self.rows)
        wide = sum(row.is_global for row in self.rows)
        others = f", and {n - wide} that compete{'s' * (n - wide == 1)} with them" if n > wide else ""
        of = count(len(self.owners), "controller")
        return f"Coordinator diagram: {count(wide, 'global transition')} of {of}{others}"

    def lines(self) -> Iterator[str]:
        """The picture, line by line."""
        body: list[str] = []
        y = TOP
        self.shown.clear()
        for number, panel in enumerate(self.panels, start=1):
            drawn, y = self._drawn(panel, number, y)
            body += drawn
            y += 26
        title = f"{self.net.name}: coordinator diagram"
        style = scoped("coordinator", _STYLE)
        height = y + 24 + ROW_HEIGHT * (len(self.legend) - 1)
        yield from opening(self.width, height, style, title, self.net.name, self._caption(), scope="coordinator")
        yield from body
        yield from self._legend(y)
        yield "</svg>"

    def _drawn(self, panel: _Panel, number: int, top: float) -> tuple[list[str], float]:
        bands = self._bands(panel)
        deep = 1 + max((depth for _, depth, _, _ in bands), default=-1)
        y = top + deep * _BAND
        heights = [self._height(row, panel) for row in panel.rows]
        bottom = y + _HEADER + sum(heights) + _ROW_GAP * len(heights) + 4
        found = [line for band in bands for line in self._band(*band, top, number)]
        for i, x, width in panel.lanes:
            found += self._lane(i, x, width, y, bottom)
        found += self._decision_lane(y, bottom)
        at = y + _HEADER
        middles: dict[str, float] = {}
        for row, height in zip(panel.rows, heights, strict=True):
            middles[row.name] = at + _BOX_HEIGHT / 2
            found += self._row(row, panel, at + _BOX_HEIGHT / 2, number)
            at += height + _ROW_GAP
        for group in sorted(self.groups, key=lambda group: self.column[group.name]):
            found += self._group(group, middles, number)
        return found, bottom

    def _ident(self, kind: str, name: str, number: int) -> str:
        """The id of what may stand in several panels: in all but the first with the number of the panel."""
        again = (kind, name) in self.shown
        self.shown.add((kind, name))
        return ident(kind, name, str(number)) if again else ident(kind, name)

    def _height(self, row: Coordinated, panel: _Panel) -> float:
        here = {self.owners[i] for i, _, _ in panel.lanes}
        lines = [self.told[row.name, part.controller].lines for part in row.parts if part.controller in here]
        return max(_BOX_HEIGHT, _LINE * max([len(self._said(row, here)), *lines]))

    def _said(self, row: Coordinated, here: Collection[str]) -> list[str]:
        """What stands at the left of a row: its description, and who takes part in it in another panel."""
        elsewhere = ", ".join(part.controller for part in row.parts if part.controller not in here)
        return labels(row) + (wrapped(f"also {elsewhere}", LABEL_CHARACTERS) if elsewhere else [])

    def _bands(self, panel: _Panel) -> list[tuple[str, int, float, float]]:
        """The coordinators over the lanes of a panel: name, depth from the root, left and right edge."""
        found = []
        for name in self.layers.coordinators():
            inside = set(self._under(name))
            spans = [(x, x + width) for i, x, width in panel.lanes if self.owners[i] in inside]
            if spans:
                found.append((name, len(self.layers.up(name)) - 1, spans[0][0], spans[-1][1]))
        return found

    def _band(self, name: str, depth: int, left: float, right: float, top: float, number: int) -> Iterator[str]:
        y = top + depth * _BAND
        yield f"<g {self._ident('coordinator', name, number)}>"
        size = f'width="{px(right - left)}" height="{px(_BAND - 6)}"'
        yield f'<rect class="over" x="{px(left)}" y="{px(y)}" {size} rx="6"/>'
        said = name if name in self.net_controllers else "coordinator"
        yield (
            f'<text class="band" x="{px(left + _PADDING)}" y="{px(y + 16.5)}">{esc(said)}'
            f'<tspan class="note" dx="6" font-weight="400">{esc(over(name, self.layers))}</tspan></text>'
        )
        yield "</g>"

    def _lane(self, i: int, x: float, width: float, y: float, bottom: float) -> Iterator[str]:
        owner = self.owners[i]
        fill, stroke = colours(i, owner)
        where = f'x="{px(x)}" y="{px(y)}" width="{px(width)}" height="{px(bottom - y)}"'
        yield f'<rect {ident("controller", owner)} {where} rx="10" fill="{fill}" stroke="{stroke}"/>'
        yield f'<text class="lane" x="{px(x + _PADDING)}" y="{px(y + 21)}">{esc(owner)}</text>'
        yield f'<text class="note" x="{px(x + _PADDING)}" y="{px(y + 36)}">{esc(self._owned(owner))}</text>'

    def _decision_lane(self, y: float, bottom: float) -> Iterator[str]:
        x, width = self.decisions_x, self.decisions_width
        yield (
            f'<rect x="{px(x)}" y="{px(y)}" width="{px(width)}" height="{px(bottom - y)}" rx="10" '
            'fill="#f7f8fa" stroke="#9aa6b2"/>'
        )
        several = len(self.deciders) > 1
        for k, name in enumerate(self.deciders):
            at_x = self._decision_x(name) if several else x + _PADDING
            at_y = y + 21 + (15 * (k % 2) if several else 0)
            css = "band" if several else "lane"
            yield f'<text class="{css}" x="{px(at_x)}" y="{px(at_y)}">{esc(self._decides(name))}</text>'

    def _decision_x(self, decider: str) -> float:
        k = self.deciders.index(decider)
        return self.decisions_x + _DECISIONS_START + _BRACKET * self.n_groups + k * self.pitch

    def _row(self, row: Coordinated, panel: _Panel, y: float, number: int) -> Iterator[str]:
        lanes = {self.owners[i]: x for i, x, _ in panel.lanes}
        here = [part for part in row.parts if part.controller in lanes]
        x = self._decision_x(row.at or self.layers.root)
        yield f"<g {self._ident('decision', row.name, number)}><title>{esc(hint(row))}</title>"
        for k, line in enumerate(self._said(row, lanes)):
            yield f'<text class="note" x="{px(MARGIN)}" y="{px(y + 3.8 + k * _LINE)}">{esc(line)}</text>'
        end = max(lanes[part.controller] for part in here) + _PADDING
        yield f'<path class="tie" d="M{px(x + self.decision_width)} {px(y)}H{px(end)}"/>'
        yield (
            f'<rect class="decision" x="{px(x)}" y="{px(y - _BOX_HEIGHT / 2)}" width="{px(self.decision_width)}" '
            f'height="{px(_BOX_HEIGHT)}" rx="{px(_BOX_HEIGHT / 2)}"/>'
        )
        yield (
            f'<text class="decided" x="{px(x + self.decision_width / 2)}" y="{px(y + 4.2)}" text-anchor="middle">'
            f"{esc(row.name)}</text></g>"
        )
        for part in here:
            yield from self._part(row, part, lanes[part.controller] + _PADDING, y)

    def _part(self, row: Coordinated, part: Part, x: float, y: float) -> Iterator[str]:
        told = self.told[row.name, part.controller]
        fill, _ = colours(self.owners.index(part.controller), part.controller)
        yield f"<g {ident('part', row.name, part.controller)}>"
        yield (
            f'<rect class="{"bar" if told.moves else "reads"}" x="{px(x)}" y="{px(y - 3.5)}" width="{px(_BAR)}" '
            'height="7" rx="1.5"/>'
        )
        at = x + _BAR + 6
        # The line to the next part passes here: it is broken around the words, as a bridge does.
        yield (
            f'<rect fill="{fill}" x="{px(at - 6)}" y="{px(y - 7)}" width="{px(width_of(told.name, NAME) * 0.86 + 9)}" '
            'height="14"/>'
        )
        yield f'<text class="contributes" x="{px(at)}" y="{px(y + 4.2)}">{esc(told.name)}</text>'
        lines = [*((line, "flow") for line in told.flow), *((line, "signal") for line in told.signals)]
        for k, (line, css) in enumerate(lines, start=1):
            yield f'<text class="{css}" x="{px(at)}" y="{px(y + 4.2 + k * _LINE)}">{esc(line)}</text>'
        yield "</g>"

    def _group(self, group: ArbitrationGroup, middles: Mapping[str, float], number: int) -> Iterator[str]:
        names = [name for name in (*group.sequence, *group.rest) if name in middles]
        if not names:
            return
        decider = next(row.at or self.layers.root for row in self.rows if row.name == names[0])
        x = self.decisions_x + 8 + _BRACKET * (self.n_groups - 1 - self.column[group.name])
        ys = sorted(middles[name] for name in names)
        ends = "".join(f"M{px(x)} {px(y)}H{px(self._decision_x(decider))}" for y in ys)
        apart = "".join(f"M{px(x + 2)} {px(y)}H{px(self._decision_x(decider) - 2)}" for y in ys)
        yield f"<g {self._ident('group', group.name, number)}><title>{esc(rule(group))}</title>"
        yield f'<path class="apart" d="{apart}"/>'
        yield f'<path class="group" d="M{px(x)} {px(ys[0])}V{px(ys[-1])}{ends}"/></g>'

    def _legend_rows(self) -> list[list[tuple[float, str, str]]]:
        """The signs that the picture uses, in rows as wide as it is."""
        items = []
        if self.rows:
            items.append(("decision", "decided by a coordinator, when every part has voted yes"))
            items.append(("bar", "part: takes and puts tokens"))
        if any(not told.moves for told in self.told.values()):
            items.append(("reads", "part that votes and locks, and moves no token"))
        if self.groups:
            items.append(("group", "compete: at most one of them is decided at a time"))
        return legend_rows(items, self.width)

    def _legend(self, top: float) -> Iterator[str]:
        for k, row in enumerate(self.legend):
            y = top + ROW_HEIGHT * k
            for x, css, text in row:
                if css == "group":
                    yield f'<path class="group" d="M{px(x + 14)} {px(y - 6)}h-8v12h8"/>'
                elif css == "decision":
                    yield f'<rect class="decision" x="{px(x)}" y="{px(y - 7)}" width="34" height="14" rx="7"/>'
                else:
                    yield f'<rect class="{css}" x="{px(x)}" y="{px(y - 3.5)}" width="34" height="7" rx="1.5"/>'
                yield f'<text class="note" x="{px(x + 42)}" y="{px(y + 3.5)}">{esc(text)}</text>'
