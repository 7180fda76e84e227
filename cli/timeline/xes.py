"""The course of a run as XES (IEEE Std 1849), for process mining.

A case is a cycle of one controller: from the first event after its places hold what they hold at the start, until
they hold it again. Which workpiece an event is of the trace does not say, since a token bears no name; what each
controller does over and over it does, and that is what a discovered model is to show. Events
are the firings that a controller takes part in (`complete`) and the commands of its machines (`start`, `complete`, or
`ate_abort` for one that was broken off).

A global transition is an event of a case of each controller that takes part in it.

The file keeps the rules of the published schema: a version that is a decimal number, names of classifiers without
blanks, attributes before traces and traces before nothing. It is in the namespace in which tools write such files; the
schema itself names none.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Final
from xml.sax.saxutils import quoteattr

from firable.cli.timeline.lanes import participants
from firable.semantics.course import Course, Moment

NOT_CARRIED: Final = (
    "signals that complete no command, markings and notes",
    "the fraction of a microsecond",
)
_EXTENSIONS: Final = (("Concept", "concept"), ("Lifecycle", "lifecycle"), ("Time", "time"), ("Organizational", "org"))
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


def xes(course: Course) -> str:
    """The course of a run as an event log; times count from its beginning, or from 1970 where that is not known."""
    return "\n".join(_lines(course)) + "\n"


def timestamp(course: Course, at_seconds: float) -> str:
    """A time as xs:dateTime in UTC."""
    return (_EPOCH + timedelta(seconds=course.began + at_seconds)).isoformat(timespec="microseconds")


def _lines(course: Course) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<log xes.version="1849.2016" xes.features="" xmlns="http://www.xes-standard.org/">'
    for name, prefix in _EXTENSIONS:
        yield f'  <extension name="{name}" prefix="{prefix}" uri="http://www.xes-standard.org/{prefix}.xesext"/>'
    yield '  <global scope="trace">'
    yield '    <string key="concept:name" value="none"/>'
    yield "  </global>"
    yield '  <global scope="event">'
    yield '    <string key="concept:name" value="none"/>'
    yield '    <string key="lifecycle:transition" value="complete"/>'
    yield f'    <date key="time:timestamp" value="{_EPOCH.isoformat(timespec="microseconds")}"/>'
    yield "  </global>"
    yield '  <classifier name="Activity" keys="concept:name"/>'
    yield '  <classifier name="ActivityAndLifecycle" keys="concept:name lifecycle:transition"/>'
    yield f"  {_string('concept:name', course.net.name)}"
    yield f"  {_string('lifecycle:model', 'standard')}"
    for owner in dict.fromkeys(place.owner or "" for place in course.net.places):
        for number, (events, whole) in enumerate(_cycles(course, owner), start=1):
            yield "  <trace>"
            yield f"    {_string('concept:name', f'{owner or course.net.name} {number}')}"
            yield f'    <boolean key="complete" value="{str(whole).lower()}"/>'
            yield from events
            yield "  </trace>"
    yield "</log>"


def _cycles(course: Course, owner: str) -> Iterator[tuple[list[str], bool]]:
    """The events of each cycle of a controller, and whether it came to its end."""
    of = participants(course.net)
    start = {place.name for place in course.net.places if (place.owner or "") == owner and place.marked}
    held, events = set(start), list[str]()
    for moment in course.moments:
        events += _events(course, moment, owner, of)
        for k in moment.left:
            held.discard(course.stays[k].place.name)
        held |= {
            place.name for k in moment.entered if (place := course.stays[k].place) and (place.owner or "") == owner
        }
        if events and held == start:
            yield events, True
            events = []
    if events:
        yield events, False


def _events(course: Course, moment: Moment, owner: str, of: dict[str, frozenset[str]]) -> Iterator[str]:
    now = timestamp(course, moment.at_seconds)
    broken = [k for k in moment.left if course.stays[k].is_broken_off]
    for ks, lifecycle in ((moment.done, "complete"), (broken, "ate_abort"), (moment.sent, "start")):
        for stay in (course.stays[k] for k in ks):
            place = stay.place
            if (place.owner or "") != owner or place.command is None or stay.sent_seconds is None:
                continue
            more = (("org:resource", place.command.machine), ("command", str(place.command)))
            yield _event(place.name, lifecycle, now, *more)
            if lifecycle == "start" and place.completion is None:
                yield _event(place.name, "complete", now, *more)
    for firing in moment.fired:
        if owner in of[firing.transition]:
            yield _event(firing.transition, "complete", now)


def _event(name: str, lifecycle: str, now: str, *more: tuple[str, str]) -> str:
    strings = [_string("concept:name", name), _string("lifecycle:transition", lifecycle)]
    rest = [_string(*pair) for pair in more]
    inner = [*strings, f'<date key="time:timestamp" value="{now}"/>', *rest]
    return "\n".join(["    <event>", *(f"      {line}" for line in inner), "    </event>"])


def _string(key: str, value: str) -> str:
    clean = "".join(c if c.isprintable() else "\ufffd" for c in value)
    return f"<string key={quoteattr(key)} value={quoteattr(clean)}/>"
