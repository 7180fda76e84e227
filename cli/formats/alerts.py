"""The verdicts that other programs show a reader, and where in the net file each of them points.

A verdict is about names of the net; a code-review site wants a line of a file. The place that a verdict points to is
the property of the file that it decides, else the first of its subjects that stands in the file, else the name of the
cell. Nothing points further than the file that the command was given: a bundle and a catalogue family have no lines.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from firable.nets.verdict import Status, Weight

if TYPE_CHECKING:
    from firable.cli.report import Report
    from firable.nets.diagnostics import Span
    from firable.nets.verdict import Verdict

_BETWEEN: Final = re.compile(r" (?:/|->|\+) ")
_TABLES: Final = ("transitions", "places", "signals", "arbiters", "controllers")


@dataclass(frozen=True, slots=True)
class Alert:
    """A verdict that a reader has to see, of the report it stands in; an error fails the command."""

    report: Report
    verdict: Verdict
    is_error: bool


def alerts(report: Report) -> Iterator[Alert]:
    """The verdicts that are not proved and matter: what must hold and does not or is unknown, and warnings."""
    for verdict in report.verdicts:
        if verdict.matters:
            if verdict.outcome is not Status.PROVED:
                yield Alert(report, verdict, is_error=True)
        elif verdict.weight is Weight.WARNING and verdict.status is Status.VIOLATED:
            yield Alert(report, verdict, is_error=False)


def ending(verdict: Verdict) -> str:
    """How an alerting verdict ended, in a word or two."""
    if verdict.status is Status.UNKNOWN:
        return "not decided"
    return "violated" if verdict.expected is None else "changed"


def place_of(report: Report, verdict: Verdict) -> Span | None:
    """Where a verdict points to in the net file; None where the net was read from no file with lines."""
    positions = report.positions
    if positions is None:
        return None
    if verdict.expected is not None and (span := positions.of("expect", verdict.name)):
        return span
    family, _, rest = verdict.name.removeprefix("loop.").partition(".")
    if family == "property" and (span := positions.of("properties", rest)):
        return span
    names = [name for subject in verdict.subjects for name in _BETWEEN.split(subject)]
    return next((span for name in names if (span := place_of_name(report, name))), positions.whole)


def place_of_name(report: Report, name: str) -> Span | None:
    """Where a transition, place, signal, arbiter or controller stands in the net file, if it does."""
    if report.positions is None:
        return None
    return next((span for table in _TABLES if (span := report.positions.of(table, name))), None)
