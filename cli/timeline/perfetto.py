"""The course of a run as JSON of the Trace Event Format, for Perfetto and chrome://tracing.

A controller is a process, each row of a machine a thread of it. Commands are complete events (`X`), waiting as well;
tokens on places without command are asynchronous spans (`b`, `e`), transitions instants (`i`) on a thread of each
controller that takes part, signals counters (`C`) of 0 and 1, notes instants of the whole. Times are microseconds, to a
nanosecond.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from firable.cli.timeline.lanes import lanes, participants
from firable.semantics.course import Course, Stay

NOT_CARRIED: Final = ("the order of what happens in one instant", "which tokens a transition moved")
_TRANSITIONS: Final = 1


def perfetto(course: Course) -> str:
    """The course of a run as a JSON object with `traceEvents`."""
    rows = ",\n".join(json.dumps(event) for event in _events(course))
    head = json.dumps({"net": course.net.name, "complete": course.complete})
    return f'{{"displayTimeUnit": "ms", "otherData": {head}, "traceEvents": [\n{rows}\n]}}\n'


def micro(at_seconds: float) -> float:
    """A time in microseconds, to a nanosecond."""
    return round(at_seconds * 1e6, 3)


def _events(course: Course) -> Iterator[dict[str, Any]]:
    net = course.net
    owners = dict.fromkeys(
        [
            *(c.name for c in net.controllers),
            *(p.owner or "" for p in net.places),
            *(s.owner or "" for s in net.signals),
        ]
    )
    pid = {owner: n for n, owner in enumerate(owners, start=1)}
    for owner, number in pid.items():
        yield _named("process_name", number, 0, owner or net.name)
        yield _named("thread_name", number, _TRANSITIONS, "transitions")
    tid = dict.fromkeys(pid, _TRANSITIONS)
    for lane in lanes(course):
        for row in lane.rows:
            tid[lane.owner] += 1
            where: dict[str, Any] = {"pid": pid[lane.owner], "tid": tid[lane.owner]}
            yield _named("thread_name", where["pid"], where["tid"], lane.machine)
            for stay in row:
                yield from _spans(course, stay, where)
    for stay in course.stays:
        if stay.place.command is None:
            where = {"pid": pid[stay.place.owner or ""], "tid": _TRANSITIONS, "cat": "place"}
            where |= {"name": stay.place.name, "id": f"{stay.place.name}:{stay.number}"}
            yield {"ph": "b", "ts": micro(stay.entered_seconds), **where}
            if stay.left_seconds is not None:
                yield {"ph": "e", "ts": micro(stay.left_seconds), **where}
    of = participants(net)
    for firing in course.firings:
        for owner in sorted(of[firing.transition], key=pid.__getitem__):
            where = {"pid": pid[owner], "tid": _TRANSITIONS, "cat": "transition", "s": "t"}
            args = {"number": firing.number}
            yield {"ph": "i", "ts": micro(firing.at_seconds), "name": firing.transition, "args": args, **where}
    for level in course.levels:
        where = {"pid": pid[net.signal(level.signal).owner or ""], "tid": 0, "cat": "signal"}
        args = {"value": int(level.value)}
        yield {"ph": "C", "ts": micro(level.at_seconds), "name": level.signal, "args": args, **where}
    for note in course.notes:
        where = {"pid": next(iter(pid.values()), 1), "tid": 0, "cat": "note", "s": "g"}
        yield {"ph": "i", "ts": micro(note.at_seconds), "name": note.note, "args": dict(note.data), **where}


def _named(what: str, pid: int, tid: int, name: str) -> dict[str, Any]:
    return {"ph": "M", "name": what, "pid": pid, "tid": tid, "args": {"name": name}}


def _spans(course: Course, stay: Stay, where: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What a machine does for a command, and its waiting after that."""
    sent, place, command = stay.sent_seconds, stay.place, stay.place.command
    if sent is None or command is None:
        return
    left = course.end_seconds if stay.left_seconds is None else stay.left_seconds
    done = sent if place.completion is None else left if stay.done_seconds is None else stay.done_seconds
    completed = place.completion is None or stay.done_seconds is not None
    name = " ".join((command.command, *(value for _, value in command.parameters)))
    args = {"place": place.name, "number": stay.number, "command": str(command), "completed": completed}
    start, middle, end = map(micro, (sent, done, left))
    yield {
        "ph": "X",
        "ts": start,
        "dur": round(middle - start, 3),
        "name": name,
        "cat": "command",
        "args": args,
        **where,
    }
    if end > middle:
        rest = {"name": "waiting", "cat": "waiting", "args": {"place": place.name, "number": stay.number}}
        yield {"ph": "X", "ts": middle, "dur": round(end - middle, 3), **rest, **where}
