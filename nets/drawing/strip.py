"""A run as a strip of small pictures: one for each step, with only the places that matter, each always at its place.

A picture of the whole net for each step is no strip: the eye would have to find what has changed among what has not. So
a frame shows the places that some transition of the run takes from, puts to or reads, below each other in the boxes of
their controllers, the same in every frame; and the transition that fires, as a bar beside them, with its arcs and
gates. Tokens that come are drawn in green with their names, those that leave as hollow circles. What is under the title
of a frame is what the net's author wrote of the transition.

Frames are read like words: from left to right, then the next row. Rejected: to show only the two markings of a step.
In a deadlock what matters is what was taken three steps ago.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from firable.nets.drawing.colours import colours
from firable.nets.drawing.labels import local_name
from firable.nets.drawing.sheet import MARGIN, TOP, least_width, opening, scoped
from firable.nets.drawing.text import NAME, NOTE, width_of, wrapped
from firable.nets.drawing.xml import esc, head, ident, px
from firable.nets.net import Marking, Net, Transition

WIDTH_MAX: Final = 1500.0
"""How wide a strip gets before it goes on in the next row, in pixels."""
STEPS_MAX: Final = 120
"""How many steps are drawn; of a longer run the middle is left out, and the strip says so."""
_LINE: Final = 18.0
_HEAD: Final = 50.0
_BOX_HEAD: Final = 20.0
_BOX_GAP: Final = 5.0
_FRAME_GAP: Final = 14.0
_ROW_GAP: Final = 20.0
_BAR_STEP: Final = 16.0
_ARC: Final = 26.0
_RADIUS: Final = 5.2
_CHARACTERS: Final = 30
_END_LINE: Final = 14.0
_END_LINES_MAX: Final = 48

_STYLE: Final = """
.frame{fill:#fff;stroke:#9aa6b2}
.number{font-size:13px;font-weight:700;fill:#b3123b}
.name{font-size:13px;font-weight:700}
.note{font-size:10.5px;fill:#5b6775}
.lane{font-size:11.5px;font-weight:700;fill:#3b4855}
.held{font-size:11.5px}
.empty{font-size:11.5px;fill:#8a949f}
.comes{font-size:11.5px;font-weight:700;fill:#11693a}
.leaves{font-size:11.5px;fill:#8c0f2e}
.place{fill:#fff;stroke:#5b6775;stroke-width:1.3}
.put{fill:#fff;stroke:#11693a;stroke-width:2}
.taken{fill:#fff;stroke:#8c0f2e;stroke-width:1.6;stroke-dasharray:2.5 1.8}
.token{fill:#1d2733}
.new{fill:#11693a}
.fired{fill:#b3123b}
.arc{fill:none;stroke:#b3123b;stroke-width:1.3}
.head{fill:#b3123b}
.gate{fill:none;stroke:#b3123b;stroke-width:1.3;stroke-dasharray:4 2.5}
.dot{fill:#b3123b}
.hollow{fill:#fff;stroke:#b3123b;stroke-width:1.3}
.signal{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:#0b6b74}
.end{font-size:11.5px;font-weight:600}
""".strip()


@dataclass(frozen=True, slots=True)
class Frame:
    """A moment of a run: the step that led to it, from 1, what fired in it, and the marking before and after."""

    number: int
    fired: tuple[str, ...]
    before: Marking
    after: Marking


def draw_strip(
    net: Net, frames: Sequence[Frame], *, caption: str = "", end: Sequence[str] = (), width_max: float = WIDTH_MAX
) -> str:
    """A run from M0 as SVG, a small picture for each step; `end` is what is to be said of where it ends, in lines.

    `caption` is the line under the title. Ids: `step:3` for a frame, `fired:3:G2` for what fires in it,
    `place:3:robot.free` for a place in it; step 0 is M0.

    >>> draw_strip(Net("empty"), ()).startswith('<svg xmlns="http://www.w3.org/2000/svg"')
    True
    """
    return "\n".join(_Writer(net, frames, caption, end, width_max).lines()) + "\n"


def _in_lines(told: Sequence[str], characters: int) -> list[str]:
    """Sentences in lines, each after a little space: a line without words."""
    lines = [line for text in told for line in (*wrapped(text, characters, _END_LINES_MAX), "")]
    return lines[: min(_END_LINES_MAX, len(lines) - 1)] if lines else []


class _Writer:
    """One strip."""

    def __init__(self, net: Net, frames: Sequence[Frame], caption: str, end: Sequence[str], width_max: float) -> None:
        self.net, self.caption, self.told = net, caption, end
        start = frames[0].before if frames else net.initial_marking
        kept = list(frames)
        self.left_out = max(0, len(kept) - STEPS_MAX)
        if self.left_out:
            kept[STEPS_MAX // 2 : len(kept) - STEPS_MAX // 2] = []
        self.frames = [Frame(0, (), start, start), *kept]
        self.gap_at = STEPS_MAX // 2 if self.left_out else -1
        self.end = _in_lines(end, _CHARACTERS + 6)
        self.boxes = self._boxes()
        bars = max([0, *(len(frame.fired) for frame in self.frames)])
        self.bars_width = bars * _BAR_STEP + _ARC if bars else 12.0
        names = [width_of(self._name(p), NAME) * 0.9 for _, places in self.boxes for p in places]
        owners = [width_of(owner or "", NAME) for owner, _ in self.boxes]
        heads = [self._head_width(frame) for frame in self.frames]
        said = [width_of(line, NAME) * 0.9 for line in self.end]
        inner = max([0.0, *names, *owners]) + 2 * _RADIUS + 14
        self.frame_width = max(self.bars_width + inner + 20, *heads, 150.0) + 8
        body = sum(_BOX_HEAD * (owner is not None) + _LINE * len(places) + _BOX_GAP + 6 for owner, places in self.boxes)
        self.frame_height = _HEAD + body + 8
        self.end_width = max([0.0, *said]) + 16 if self.end else 0.0
        room = max(self.frame_width, width_max - 2 * MARGIN)
        self.per_row = max(1, int((room + _FRAME_GAP) // (self.frame_width + _FRAME_GAP)))
        self.places = list(self._places())

    def _boxes(self) -> list[tuple[str | None, list[int]]]:
        """The places that matter, by their owners, in the order of the net."""
        touched: set[str] = set()
        for name in {name for frame in self.frames for name in frame.fired}:
            t = self.net.transition(name)
            touched.update(t.inputs, t.outputs, t.permissive, t.inhibitive)
        found: dict[str | None, list[int]] = {}
        for controller in self.net.controllers:
            found[controller.name] = []
        for p, place in enumerate(self.net.places):
            if place.name in touched:
                found.setdefault(place.owner, []).append(p)
        return [(owner, places) for owner, places in found.items() if places]

    def _name(self, p: int) -> str:
        place = self.net.places[p]
        return local_name(place.name, place.owner)

    def _head_width(self, frame: Frame) -> float:
        lines = [width_of(" + ".join(frame.fired), NAME) + 30]
        return max(lines + [width_of(line, NOTE) + 16 for line, _ in self._said(frame)])

    def _said(self, frame: Frame) -> list[tuple[str, str]]:
        """What stands under the title of a frame, at most two lines, each with its class."""
        if not frame.number:
            return [("the initial marking", "note")]
        some = [self.net.transition(name) for name in frame.fired]
        lines = [(line, "note") for t in some for line in wrapped(t.description, _CHARACTERS)]
        for t in some:
            signals = ", ".join(
                ("" if gate.wanted else "not ") + local_name(gate.signal, self.net.signal(gate.signal).owner)
                for gate in t.external
            )
            lines += [(line, "signal") for line in wrapped(f"if {signals}", _CHARACTERS)] if signals else []
        return lines[:2]

    def _places(self) -> Iterator[tuple[float, float]]:
        """The upper left corner of each frame; where steps are left out, a frame stays free for the words."""
        slots = len(self.frames) + (1 if self.left_out else 0)
        for slot in range(slots):
            if self.left_out and slot == self.gap_at + 1:
                continue
            yield self._slot(slot)

    def _slot(self, slot: int) -> tuple[float, float]:
        row, column = divmod(slot, self.per_row)
        return MARGIN + column * (self.frame_width + _FRAME_GAP), TOP + 6 + row * (self.frame_height + _ROW_GAP)

    def lines(self) -> Iterator[str]:
        """The picture, line by line."""
        right = max(x for x, _ in self.places) + self.frame_width
        bottom = max(y for _, y in self.places) + self.frame_height
        end_x, end_y = self.places[-1][0] + self.frame_width + 12, self.places[-1][1]
        if self.end and len(self.places) >= self.per_row and end_x + self.end_width > right + 40:
            end_x, end_y = MARGIN, bottom + 4
            self.end = _in_lines(self.told, max(_CHARACTERS + 6, int((right - MARGIN) / (NAME.character_px * 0.9))))
        elif self.end:
            right = max(right, end_x + self.end_width)
        if self.end:
            bottom = max(bottom, end_y + _END_LINE * len(self.end) + 12)
        width = max(right + MARGIN, least_width(self.net.name, self.caption), 480.0)
        title = f"{self.net.name}: {self.caption}" if self.caption else self.net.name
        style = scoped("strip", _STYLE)
        yield from opening(width, bottom + 44, style, title, self.net.name, self.caption, scope="strip")
        for frame, (x, y) in zip(self.frames, self.places, strict=True):
            yield from self._frame(frame, x, y)
        if self.left_out:
            x, y = self._slot(self.gap_at + 1)
            said = f"{self.left_out:,} steps are left out here"
            yield f'<text class="note" x="{px(x + 8)}" y="{px(y + self.frame_height / 2)}">{said}</text>'
        for k, line in enumerate(self.end):
            yield f'<text class="end" x="{px(end_x)}" y="{px(end_y + 19 + _END_LINE * k)}">{esc(line)}</text>'
        yield from self._legend(bottom + 24)
        yield "</svg>"

    def _frame(self, frame: Frame, x: float, y: float) -> Iterator[str]:
        yield f"<g {ident('step', str(frame.number))}>"
        size = f'width="{px(self.frame_width)}" height="{px(self.frame_height)}"'
        yield f'<rect class="frame" x="{px(x)}" y="{px(y)}" {size} rx="8"/>'
        title = " + ".join(frame.fired) if frame.number else "M0"
        number = f'<tspan class="number">{frame.number}</tspan> ' if frame.number else ""
        yield f'<text class="name" x="{px(x + 8)}" y="{px(y + 18)}">{number}{esc(title)}</text>'
        for k, (line, css) in enumerate(self._said(frame)):
            yield f'<text class="{css}" x="{px(x + 8)}" y="{px(y + 32 + 13 * k)}">{esc(line)}</text>'
        at: dict[str, float] = {}
        top = y + _HEAD
        left = x + 6 + self.bars_width
        for i, (owner, places) in enumerate(self.boxes):
            head_height = _BOX_HEAD if owner is not None else 0.0
            height = head_height + _LINE * len(places) + 6
            fill, stroke = colours(i, owner)
            yield (
                f'<rect x="{px(left)}" y="{px(top)}" width="{px(x + self.frame_width - 6 - left)}" '
                f'height="{px(height)}" rx="5" fill="{fill}" stroke="{stroke}"/>'
            )
            if owner is not None:
                yield f'<text class="lane" x="{px(left + 8)}" y="{px(top + 14)}">{esc(owner)}</text>'
            for k, p in enumerate(places):
                middle = top + head_height + 3 + _LINE * (k + 0.5)
                at[self.net.places[p].name] = middle
                yield from self._place(frame, p, left + 8 + _RADIUS, middle)
            top += height + _BOX_GAP
        for k, name in enumerate(frame.fired):
            yield from self._fired(frame, self.net.transition(name), x + 12 + k * _BAR_STEP, left + 8, at)
        yield "</g>"

    def _place(self, frame: Frame, p: int, x: float, y: float) -> Iterator[str]:
        before, after = frame.before >> p & 1, frame.after >> p & 1
        css = {(1, 1): "held", (0, 0): "empty", (0, 1): "comes", (1, 0): "leaves"}[before, after]
        circle = {"comes": "put", "leaves": "taken"}.get(css, "place")
        place = self.net.places[p]
        hint = " — ".join(text for text in (place.name, place.description) if text)
        yield f"<g {ident('place', str(frame.number), place.name)}><title>{esc(hint)}</title>"
        yield f'<circle class="{circle}" cx="{px(x)}" cy="{px(y)}" r="{px(_RADIUS)}"/>'
        if after:
            yield f'<circle class="{"new" if css == "comes" else "token"}" cx="{px(x)}" cy="{px(y)}" r="2.6"/>'
        yield f'<text class="{css}" x="{px(x + _RADIUS + 6)}" y="{px(y + 4)}">{esc(self._name(p))}</text></g>'

    def _fired(self, frame: Frame, t: Transition, x: float, circles: float, at: dict[str, float]) -> Iterator[str]:
        reached = [at[name] for name in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)]
        hint = f"{t.name} {t.description}".strip()
        yield f"<g {ident('fired', str(frame.number), t.name)}><title>{esc(hint)}</title>"
        if reached:
            top, bottom = min(reached) - 6, max(reached) + 6
            yield f'<rect class="fired" x="{px(x)}" y="{px(top)}" width="5" height="{px(bottom - top)}" rx="1.5"/>'
        for names, kind in ((t.inputs, "in"), (t.outputs, "out"), (t.permissive, "dot"), (t.inhibitive, "hollow")):
            for name in names:
                y = at[name]
                css = "arc" if kind in {"in", "out"} else "gate"
                yield f'<path class="{css}" d="M{px(x + 5)} {px(y)}H{px(circles)}"/>'
                if kind == "in":
                    yield head(x + 5, y, -1, 0)
                elif kind == "out":
                    yield head(circles, y, 1, 0)
                else:
                    yield f'<circle class="{kind}" cx="{px(x + 8.5)}" cy="{px(y)}" r="3"/>'
        yield "</g>"

    def _legend(self, y: float) -> Iterator[str]:
        x = MARGIN
        if len(self.frames) == 1:
            return
        for css, words in (("fired", "fires in this step"), ("put", "a token comes"), ("taken", "a token leaves")):
            if css == "fired":
                yield f'<rect class="fired" x="{px(x + 8)}" y="{px(y - 8)}" width="5" height="16" rx="1.5"/>'
            else:
                yield f'<circle class="{css}" cx="{px(x + 10)}" cy="{px(y)}" r="{px(_RADIUS)}"/>'
                if css == "put":
                    yield f'<circle class="new" cx="{px(x + 10)}" cy="{px(y)}" r="2.6"/>'
            yield f'<text class="note" x="{px(x + 22)}" y="{px(y + 3.5)}">{esc(words)}</text>'
            x += 22 + width_of(words, NOTE) + 16
