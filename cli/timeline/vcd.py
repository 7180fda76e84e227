"""The course of a run as VCD, for waveform viewers: IEEE Std 1364, clause 18, four-state value change dump.

Each place and each signal is a wire of one bit in the scope of its controller, each transition an event, and each
machine a wire that is 1 while a command of it is not completed. Time is in nanoseconds. Changes of one instant stand
under one time, in their order; a viewer shows the last value that a wire takes there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from firable.cli.timeline.lanes import lane_of
from firable.nets.drawing.labels import local_name
from firable.semantics.course import Course

NOT_CARRIED: Final = (
    "the order of what happens in one instant, where a viewer shows the last value",
    "notes, and parameters of commands",
)
_TICKS: Final = 10**9


def vcd(course: Course) -> str:
    """The course of a run as a value change dump."""
    return "\n".join(_lines(course)) + "\n"


def ticks(at_seconds: float) -> int:
    """A time in nanoseconds."""
    return round(at_seconds * _TICKS)


def _lines(course: Course) -> Iterator[str]:
    net = course.net
    ids = (_identifier(n) for n in range(10**9))
    places = {place.name: next(ids) for place in net.places}
    signals = {signal.name: next(ids) for signal in net.signals} if course.has_signals else {}
    fired = {t.name: next(ids) for t in net.transitions}
    machines = {lane: next(ids) for lane in dict.fromkeys(lane_of(p) for p in net.places if p.command is not None)}
    yield "$version firable $end"
    yield "$timescale 1 ns $end"
    yield f"$scope module {_word(net.name)} $end"
    owners = dict.fromkeys([p.owner or "" for p in net.places] + [s.owner or "" for s in net.signals])
    for owner in owners:
        if owner:
            yield f"$scope module {_word(owner)} $end"
        yield from _scope("places", [(p.name, owner, places[p.name]) for p in net.places if (p.owner or "") == owner])
        mine = [(s.name, owner, signals[s.name]) for s in net.signals if s.name in signals and (s.owner or "") == owner]
        yield from _scope("signals", mine)
        yield from _scope("machines", [(lane[1], "", code) for lane, code in machines.items() if lane[0] == owner])
        if owner:
            yield "$upscope $end"
    yield from _scope("transitions", [(name, "", code) for name, code in fired.items()], kind="event")
    yield "$upscope $end"
    yield "$enddefinitions $end"
    yield "#0"
    yield "$dumpvars"
    for place in net.places:
        yield f"{int(place.marked)}{places[place.name]}"
    yield from (f"0{code}" for code in (*signals.values(), *machines.values()))
    yield "$end"
    now, working = 0, dict.fromkeys(machines, 0)
    for moment in course.moments:
        lines = []
        ended = [*moment.done, *(k for k in moment.left if course.stays[k].is_broken_off)]
        for k, change in (*((k, 1) for k in moment.sent), *((k, -1) for k in ended)):
            place = course.stays[k].place
            if place.completion is not None and course.stays[k].sent_seconds is not None:
                before, lane = working[lane_of(place)], lane_of(place)
                working[lane] += change
                if bool(before) != bool(working[lane]):
                    lines.append(f"{int(working[lane] > 0)}{machines[lane]}")
        lines += [f"1{fired[firing.transition]}" for firing in moment.fired]
        lines += [f"0{places[course.stays[k].place.name]}" for k in moment.left]
        lines += [f"1{places[course.stays[k].place.name]}" for k in moment.entered]
        lines += [f"{int(level.value)}{signals[level.signal]}" for level in moment.levels if level.signal in signals]
        if lines and (at := ticks(moment.at_seconds)) != now:
            now = at
            yield f"#{at}"
        yield from lines
    if ticks(course.end_seconds) != now:
        yield f"#{ticks(course.end_seconds)}"


def _scope(name: str, variables: list[tuple[str, str, str]], kind: str = "wire") -> Iterator[str]:
    if not variables:
        return
    yield f"$scope module {name} $end"
    for variable, owner, code in variables:
        yield f"$var {kind} 1 {code} {_word(local_name(variable, owner))} $end"
    yield "$upscope $end"


def _identifier(n: int) -> str:
    """The n-th code of a variable: the printable characters of ASCII, shortest first."""
    code = ""
    while True:
        n, digit = divmod(n, 94)
        code += chr(33 + digit)
        if n == 0:
            return code
        n -= 1


def _word(name: str) -> str:
    """A name as one word: what VCD would end it at is replaced."""
    return "".join(c if c.isprintable() and not c.isspace() else "_" for c in name)
