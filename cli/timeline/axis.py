"""The time axis of a timeline: how many seconds a strip holds, where its marks stand, and how a time is written.

A run is cut into strips of equal length, read like lines of text. A strip holds as much as leaves the shorter commands
wide enough to be seen (the quarter that is shortest may be thinner), and a whole number of marks.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

_STEPS: Final = tuple(
    [m * 10.0**e for e in range(-6, 0) for m in (1, 2, 5)]
    + [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200, 86400]
)
_SHORT_PX: Final = 16.0
_MARKS: Final = 12
_STRIPS_MAX: Final = 48


@dataclass(frozen=True, slots=True)
class Axis:
    """From when to when, and the strips between: each `marks` marks of `step_seconds`."""

    start_seconds: float
    end_seconds: float
    step_seconds: float
    width_px: float
    marks: int = _MARKS

    @property
    def strip_seconds(self) -> float:
        """What a strip holds."""
        return self.step_seconds * self.marks

    @property
    def strips(self) -> int:
        """How many strips there are."""
        return max(1, -int(-(self.end_seconds - self.start_seconds) // self.strip_seconds))

    def pieces(self, since: float, until: float) -> Iterator[tuple[int, float, float]]:
        """A span, as (strip, left, right) in pixels for each strip that shows some of it; an instant has one piece."""
        since, until = max(since, self.start_seconds), min(until, self.end_seconds)
        if until < since:
            return
        first, last = self._strip(since), self._strip(until)
        for strip in range(first, last + 1):
            left = max(0.0, self._x(since, strip))
            right = min(self.width_px, self._x(until, strip))
            if right > left or first == last:
                yield strip, left, right

    def _strip(self, at_seconds: float) -> int:
        return min(self.strips - 1, int((at_seconds - self.start_seconds) / self.strip_seconds))

    def _x(self, at_seconds: float, strip: int) -> float:
        return (at_seconds - self.start_seconds - strip * self.strip_seconds) / self.strip_seconds * self.width_px

    def marks_of(self, strip: int) -> Iterator[tuple[float, str]]:
        """The marks of a strip, as (pixels, time), as far as the run goes."""
        for k in range(self.marks + 1):
            at = self.start_seconds + (strip * self.marks + k) * self.step_seconds
            yield k * self.width_px / self.marks, written(at, self.step_seconds, self.end_seconds)


def axis(start_seconds: float, end_seconds: float, spans: Sequence[float], width_px: float) -> Axis:
    """The axis for a run from start to end whose commands took so long."""
    whole = max(end_seconds - start_seconds, _STEPS[0])
    took = sorted(span for span in spans if span > 0)
    short = took[len(took) // 4] if took else whole
    readable = width_px / _SHORT_PX * short
    wanted = min(max(readable, whole / _STRIPS_MAX), whole) / _MARKS
    k = bisect_left(_STEPS, wanted * (1 - 1e-9))
    step = _STEPS[k] if k < len(_STEPS) else -(-wanted // _STEPS[-1]) * _STEPS[-1]
    return Axis(start_seconds, end_seconds, step, width_px)


def written(at_seconds: float, step_seconds: float, end_seconds: float) -> str:
    """A time with its unit, as exact as the step between marks asks; a run of minutes is told in minutes.

    >>> written(0.05, 0.05, 9), written(90, 10, 100), written(150, 30, 900), written(3723, 1, 9999)
    ('0.05 s', '90 s', '2:30 min', '1:02:03 h')
    """
    if end_seconds < 300 or step_seconds < 1:
        digits = next(d for d in range(7) if d == 6 or abs(step_seconds - round(step_seconds, d)) < 1e-9)
        return f"{at_seconds:.{digits}f} s"
    minutes, seconds = divmod(round(at_seconds), 60)
    if end_seconds < 3600:
        return f"{minutes}:{seconds:02} min"
    return f"{minutes // 60}:{minutes % 60:02}:{seconds:02} h"
