"""The timeline of a run as SVG: a lane for each machine, and in it what it did from when to when.

A bar goes from a command to its completion; what follows is hatched until the token leaves: the machine is done and
waits for others. A thin line is a machine that is kept for somebody and does nothing. A tick is a transition that
fired, in the lanes of all who took part in it; a line joins them. A bar with a red end was broken off
before its completion.

A run is cut into strips that are read like lines of text, each with its own axis, so a run of hours stays readable and
can be printed on pages. Rejected: one strip to scroll through, which no paper holds, and a scale at which the whole run
fits into the window, at which a grasp of half a second is thinner than a line.

The text is deterministic, with no script, link or font in it. Ids are stable: `lane:robot:R`, `bar:robot.to_cv1:3` (the
third command of that place), `wait:robot.to_cv1:3`, `held:mc.wait_put:1`, `fired:G2:3`, `strip:1`, `note:1`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from firable.cli.timeline.axis import Axis, axis
from firable.cli.timeline.lanes import lanes, taking_part
from firable.nets.drawing.labels import local_name
from firable.nets.drawing.text import COMMAND, NAME, NOTE, width_of
from firable.nets.drawing.xml import esc, ident, px
from firable.semantics.course import Course, Stay

_WIDTH: Final = 1180.0
_MARGIN: Final = 24.0
_GUTTER_MIN: Final = 70.0
_TITLE: Final = 66.0
_AXIS: Final = 20.0
_NAMES: Final = 14.0
_ROW: Final = 24.0
_BAR: Final = 16.0
_LANE_GAP: Final = 4.0
_STRIP_GAP: Final = 22.0
_LEGEND: Final = 46.0
_FILLS: Final = ("#8fb1e3", "#8acca3", "#ebbf6f", "#c79fe0", "#7fc4d1", "#e39aa3", "#bcc374", "#a9a9c4")
_TINTS: Final = ("#f3f6fc", "#f2faf5", "#fef9f0", "#f9f5fc", "#f0f9fa", "#fdf5f6", "#f8f8f1", "#f5f5f8")

_STYLE: Final = """
text{font-family:'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;fill:#1d2733}
.title{font-size:21px;font-weight:700}
.subtitle{font-size:12.5px;fill:#5b6775}
.name{font-size:13px;font-weight:600}
.note{font-size:10.5px;fill:#5b6775}
.command{font-size:10.5px;font-family:Menlo,Consolas,'DejaVu Sans Mono',monospace}
.step{font-size:10.5px;font-weight:700;fill:#b3123b}
.grid{stroke:#d5dbe2;stroke-width:1}
.bar{stroke:#3b4855;stroke-width:.8}
.wait{fill:url(#waiting);stroke:#9aa6b2;stroke-width:.6}
.held{stroke:#7a8794;stroke-width:2}
.broken{stroke:#b3123b;stroke-width:3}
.tick{stroke:#b3123b;stroke-width:2}
.join{stroke:#b3123b;stroke-width:.6;stroke-opacity:.55}
.noted{stroke:#1d2733;stroke-width:1;stroke-dasharray:4 3}
.over{stroke:#1d2733;stroke-width:1.5}
""".strip()


def draw_timeline(course: Course, *, caption: str, since: float = 0.0, until: float | None = None) -> str:
    """The timeline of a run, or of what happened in it between two times, as SVG."""
    end = course.end_seconds if until is None else min(until, course.end_seconds)
    return "\n".join(_Writer(course, since, end, caption).lines()) + "\n"


class _Writer:
    """One picture: the run, its lanes, and how time becomes a place on the paper."""

    def __init__(self, course: Course, since: float, until: float, caption: str) -> None:
        self.course, self.caption = course, caption
        self.lanes = lanes(course)
        self.since, self.until = since, until
        shown = [s for lane in self.lanes for row in lane.rows for s in row if self._is_shown(s)]
        spans = [(s.done_seconds or 0.0) - (s.sent_seconds or 0.0) for s in shown if s.done_seconds is not None]
        names = [max(width_of(lane.machine, NAME), width_of(lane.owner, NOTE)) for lane in self.lanes]
        self.left = _MARGIN + max([_GUTTER_MIN, *names]) + 12
        self.axis: Axis = axis(since, until, spans, _WIDTH)
        self.of_transition = taking_part(course.net, self.lanes)
        self.tops = list(self._tops())
        self.strip_height = _AXIS + _NAMES + self.tops[-1] + _STRIP_GAP
        self.width = self.left + _WIDTH + 44
        self.height = _TITLE + self.axis.strips * self.strip_height + _LEGEND

    def _tops(self) -> Iterator[float]:
        """Where each lane begins below the first, and where the last one ends."""
        y = 0.0
        for lane in self.lanes:
            yield y
            y += len(lane.rows) * _ROW + _LANE_GAP
        yield y

    def _is_shown(self, stay: Stay) -> bool:
        return stay.entered_seconds <= self.until and self._left(stay) >= self.since

    def _left(self, stay: Stay) -> float:
        return self.course.end_seconds if stay.left_seconds is None else stay.left_seconds

    def _y(self, strip: int, lane: int = 0, row: int = 0) -> float:
        return _TITLE + strip * self.strip_height + _AXIS + _NAMES + self.tops[lane] + row * _ROW

    def lines(self) -> Iterator[str]:
        width, height, net = px(self.width), px(self.height), self.course.net
        yield (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}" role="img">'
        )
        yield f"<title>{esc(f'{net.name}: timeline')}</title>"
        yield f"<desc>{esc(self.caption)}</desc>"
        yield f"<style>{_STYLE}</style>"
        yield (
            '<defs><pattern id="waiting" width="5" height="5" patternUnits="userSpaceOnUse" '
            'patternTransform="rotate(45)"><rect width="5" height="5" fill="#fff"/>'
            '<path d="M0 0V5" stroke="#9aa6b2" stroke-width="2"/></pattern></defs>'
        )
        yield f'<rect width="{width}" height="{height}" fill="#fff"/>'
        yield f'<text class="title" x="{px(_MARGIN)}" y="34">{esc(net.name)}</text>'
        yield f'<text class="subtitle" x="{px(_MARGIN)}" y="53">{esc(self.caption)}</text>'
        for strip in range(self.axis.strips):
            yield from self._strip(strip)
        for i, lane in enumerate(self.lanes):
            for stay in lane.held:
                if self._is_shown(stay):
                    yield from self._held(i, stay)
            for k, row in enumerate(lane.rows):
                for stay in row:
                    if self._is_shown(stay) and stay.sent_seconds is not None:
                        yield from self._command(i, k, stay, stay.sent_seconds)
        yield from self._firings()
        yield from self._notes()
        yield from self._end()
        yield from self._legend()
        yield "</svg>"

    def _strip(self, strip: int) -> Iterator[str]:
        """The lanes of a strip, its axis and its grid."""
        top, bottom = self._y(strip), self._y(strip, len(self.lanes)) - _LANE_GAP
        yield f"<g {ident('strip', str(strip + 1))}>"
        for i, lane in enumerate(self.lanes):
            y, height = self._y(strip, i), len(lane.rows) * _ROW
            mine = f"{ident('lane', lane.owner, lane.machine)} " if strip == 0 else ""
            yield (
                f'<rect {mine}x="{px(self.left)}" y="{px(y)}" width="{px(_WIDTH)}" height="{px(height)}" '
                f'fill="{_TINTS[i % len(_TINTS)]}"/>'
            )
            end = px(self.left - 10)
            yield f'<text class="name" x="{end}" y="{px(y + 11)}" text-anchor="end">{esc(lane.machine)}</text>'
            if lane.owner:
                yield f'<text class="note" x="{end}" y="{px(y + 22)}" text-anchor="end">{esc(lane.owner)}</text>'
        for x, time in self.axis.marks_of(strip):
            at = px(self.left + x)
            yield f'<path class="grid" d="M{at} {px(top - _NAMES - 4)}V{px(bottom)}"/>'
            yield f'<text class="note" x="{at}" y="{px(top - _NAMES - 8)}" text-anchor="middle">{esc(time)}</text>'
        yield "</g>"

    def _command(self, lane: int, row: int, stay: Stay, sent: float) -> Iterator[str]:
        place, name = stay.place, stay.place.name
        left = self._left(stay)
        done = sent if place.completion is None else left if stay.done_seconds is None else stay.done_seconds
        told = f"{place.command}: {self._told(stay, sent, done)}"
        pieces = list(self.axis.pieces(sent, done))
        widest = max(range(len(pieces)), key=lambda k: pieces[k][2] - pieces[k][1], default=0)
        if pieces:
            yield f"<g {ident('bar', name, str(stay.number))}><title>{esc(told)}</title>"
            for k, (strip, start, end) in enumerate(pieces):
                y = self._y(strip, lane, row) + (_ROW - _BAR) / 2
                x, width = self.left + start, max(end - start, 1.5)
                yield (
                    f'<rect class="bar" x="{px(x)}" y="{px(y)}" width="{px(width)}" height="{px(_BAR)}" '
                    f'fill="{_FILLS[lane % len(_FILLS)]}"/>'
                )
                if k == widest and (label := _label(stay, width - 6)):
                    yield f'<text class="command" x="{px(x + 4)}" y="{px(y + 11.5)}">{esc(label)}</text>'
            if stay.is_broken_off:
                strip, _, end = pieces[-1]
                y = self._y(strip, lane, row)
                yield f'<path class="broken" d="M{px(self.left + end)} {px(y + 1)}v{px(_ROW - 2)}"/>'
            yield "</g>"
        if left > done and (waits := list(self.axis.pieces(done, left))):
            yield f"<g {ident('wait', name, str(stay.number))}><title>{esc(told)}</title>"
            for strip, start, end in waits:
                y = self._y(strip, lane, row) + (_ROW - _BAR) / 2 + 3
                yield (
                    f'<rect class="wait" x="{px(self.left + start)}" y="{px(y)}" width="{px(end - start)}" '
                    f'height="{px(_BAR - 6)}"/>'
                )
            yield "</g>"

    def _told(self, stay: Stay, sent: float, done: float) -> str:
        if stay.place.completion is None:
            words = [f"sent at {sent:.2f} s"]
        elif stay.done_seconds is not None:
            words = [f"{sent:.2f} to {done:.2f} s"]
        else:
            words = [f"from {sent:.2f} s, {'broken off' if stay.is_broken_off else 'not done at the end'}"]
        if stay.left_seconds is not None and stay.left_seconds > done:
            words.append(f"waits to {stay.left_seconds:.2f} s")
        return ", then ".join(words)

    def _held(self, lane: int, stay: Stay) -> Iterator[str]:
        until = self._left(stay)
        words = stay.place.description or local_name(stay.place.name, stay.place.owner)
        yield f"<g {ident('held', stay.place.name, str(stay.number))}>"
        yield f"<title>{esc(f'{words}: {stay.entered_seconds:.2f} to {until:.2f} s')}</title>"
        for strip, start, end in self.axis.pieces(stay.entered_seconds, until):
            y = px(self._y(strip, lane) + _ROW / 2)
            yield f'<path class="held" d="M{px(self.left + start)} {y}H{px(self.left + end)}"/>'
        yield "</g>"

    def _firings(self) -> Iterator[str]:
        """A tick for each firing; its name where there is room before the next one."""
        last: dict[int, float] = {}
        for firing in self.course.firings:
            mine = self.of_transition[firing.transition]
            if not mine or not self.since <= firing.at_seconds <= self.until:
                continue
            strip, x, _ = next(self.axis.pieces(firing.at_seconds, firing.at_seconds))
            at = px(self.left + x)
            yield f"<g {ident('fired', firing.transition, str(firing.number))}>"
            yield f"<title>{esc(f'{firing.transition} at {firing.at_seconds:.2f} s')}</title>"
            if mine[-1] > mine[0]:
                bottom = self._y(strip, mine[-1])
                yield f'<path class="join" d="M{at} {px(self._y(strip, mine[0]))}V{px(bottom)}"/>'
            ticks = "".join(f"M{at} {px(self._y(strip, i) - 1)}v7" for i in mine)
            yield f'<path class="tick" d="{ticks}"/>'
            half = width_of(firing.transition, NOTE) / 2 + 2
            if x - half >= last.get(strip, -half):
                last[strip] = x + half
                y = px(self._y(strip) - 4)
                yield f'<text class="step" x="{at}" y="{y}" text-anchor="middle">{esc(firing.transition)}</text>'
            yield "</g>"

    def _notes(self) -> Iterator[str]:
        for k, note in enumerate(self.course.notes, start=1):
            if not self.since <= note.at_seconds <= self.until:
                continue
            strip, x, _ = next(self.axis.pieces(note.at_seconds, note.at_seconds))
            at, bottom = px(self.left + x), self._y(strip, len(self.lanes)) - _LANE_GAP
            yield f"<g {ident('note', str(k))}><title>{esc(_said(note.note, note.data, note.at_seconds))}</title>"
            yield f'<path class="noted" d="M{at} {px(self._y(strip))}V{px(bottom + 4)}"/>'
            yield f'<text class="note" x="{at}" y="{px(bottom + 14)}" text-anchor="middle">{esc(note.note)}</text></g>'

    def _end(self) -> Iterator[str]:
        """A line where the run ends; where it was cut off, or the picture ends before it, there is none."""
        if self.course.complete and self.until == self.course.end_seconds:
            strip, x, _ = next(self.axis.pieces(self.until, self.until))
            bottom = self._y(strip, len(self.lanes)) - _LANE_GAP
            yield f'<path class="over" d="M{px(self.left + x)} {px(self._y(strip))}V{px(bottom)}"/>'

    def _legend(self) -> Iterator[str]:
        y, x = self.height - 26, self.left
        for sign, words in self._signs():
            yield from _sign(sign, x, y)
            yield f'<text class="note" x="{px(x + 38)}" y="{px(y + 4)}">{esc(words)}</text>'
            x += 38 + width_of(words, NOTE) + 18

    def _signs(self) -> Iterator[tuple[str, str]]:
        yield "bar", "command, to its completion"
        yield "wait", "done, waits for others"
        if any(lane.held for lane in self.lanes):
            yield "held", "kept for another"
        yield "tick", "transition that fired"
        if any(stay.is_broken_off for lane in self.lanes for row in lane.rows for stay in row):
            yield "broken", "broken off"


def _sign(sign: str, x: float, y: float) -> Iterator[str]:
    match sign:
        case "bar":
            yield f'<rect class="bar" x="{px(x)}" y="{px(y - 7)}" width="32" height="14" fill="{_FILLS[0]}"/>'
        case "wait":
            yield f'<rect class="wait" x="{px(x)}" y="{px(y - 5)}" width="32" height="10"/>'
        case "held":
            yield f'<path class="held" d="M{px(x)} {px(y)}h32"/>'
        case "tick":
            yield f'<path class="tick" d="M{px(x + 16)} {px(y - 4)}v8"/>'
        case "broken":
            yield f'<path class="broken" d="M{px(x + 16)} {px(y - 8)}v16"/>'


def _label(stay: Stay, room: float) -> str:
    """What fits into the bar of a command: all of it, its words without keys, its verb, or nothing."""
    command = stay.place.command
    if command is None:
        return ""
    values = " ".join((command.command, *(value for _, value in command.parameters)))
    return next((text for text in (values, command.command) if width_of(text, COMMAND) <= room), "")


def _said(note: str, data: Mapping[str, object], at_seconds: float) -> str:
    more: Sequence[str] = [f"{key} {value}" for key, value in data.items()]
    return f"{', '.join((note, *more))} at {at_seconds:.2f} s"
