"""Time limits: what `within: 5s` beside `until` makes of a net, and the rules of it.

A command that never completes would hold its place for ever, and a token cannot tell a slow machine from a dead one;
only time can. So a place may say how long its command may take. That gives three things, under names that follow from
the place's: a *timer*, a signal of the place's controller that the token's entry clears and the passing of the time
sets; a *fault place*; and the *fault transition*, which takes the token there. How the cell goes on from the fault
place the engineer writes, as ordinary transitions.

    robot.to_cv1: {send: ..., until: at_cv1, within: 5s}

    signal      robot.to_cv1_overdue     set when 5 s are over and robot.at_cv1 has not come
    place       robot.to_cv1_fault       may be declared under `places`, with a command of its own
    transition  robot.to_cv1_timeout     from robot.to_cv1 to robot.to_cv1_fault,
                                         if robot.to_cv1_overdue, unless robot.at_cv1

*The completion comes first*: the fault transition wants the completion 0, and every other transition that takes the
token wants it 1. No valuation opens both, so they never compete, nobody has to arbitrate, and a token whose completion
has come in time but which waits for something else is not taken. Without times (in analysis) both gates are free, and
either may open first: what is proved holds whether the machine is in time or not, and whatever the limits are.

Rejected: a conflict for an arbiter to decide, which every timed cell would have to declare and nobody would decide
otherwise; a limit of the executor for all commands, which no proof knows of; time in the semantics (timed Petri nets),
whose verdicts hold only as long as every machine keeps its times.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Final

from firable.nets.diagnostics import Diagnostic, Subject
from firable.nets.net import ExternalGate, Net, Place, SignalKind, Transition

MILLISECONDS_MAX: Final = 24 * 60 * 60 * 1000
TIME_PATTERN: Final = r"^(0|[1-9][0-9]{0,8})(\.[0-9]{1,3})? ?(ms|s|min|h)$"
"""A time in a net file: a number, and its unit."""

_TIME: Final = re.compile(TIME_PATTERN)
_UNITS_MS: Final = {"h": 3_600_000, "min": 60_000, "s": 1_000, "ms": 1}  # the largest first


def parse_time(text: str) -> int | None:
    """The milliseconds that a time of a net file says; None for what is no time limit, or no whole number of them.

    >>> [parse_time(text) for text in ("5s", "1.5 s", "2min", "8h", "5", "0.5ms", "0s")]
    [5000, 1500, 120000, 28800000, None, None, None]
    """
    found = _TIME.fullmatch(text)
    if found is None:
        return None
    whole, fraction, unit = found.groups()
    thousandths = int(whole) * 1000 + int((fraction or ".0").removeprefix(".").ljust(3, "0"))
    milliseconds, rest = divmod(thousandths * _UNITS_MS[unit], 1000)
    return None if rest or not _is_limit(milliseconds) else milliseconds


def _is_limit(milliseconds: int) -> bool:
    return 0 < milliseconds <= MILLISECONDS_MAX


def format_time(milliseconds: int) -> str:
    """A time as a net file says it, in the largest unit of which it is a whole number.

    >>> format_time(5000), format_time(90_000), format_time(1500), format_time(120_000)
    ('5s', '90s', '1500ms', '2min')
    """
    unit = next(unit for unit, ms in _UNITS_MS.items() if not milliseconds % ms)
    return f"{milliseconds // _UNITS_MS[unit]}{unit}"


def fault_place_name(place: str) -> str:
    """The name of the fault place that a time limit gives a place, if the file gives no other."""
    return f"{place}_fault"


def timer_name(place: str) -> str:
    """The name of its timer."""
    return f"{place}_overdue"


def fault_transition_name(place: str) -> str:
    """The name of its fault transition."""
    return f"{place}_timeout"


def fault_transition(place: Place, to: str, name: str) -> Transition:
    """The transition that takes the token of a place with a time limit to its fault place."""
    if place.within is None or place.completion is None:
        raise ValueError(f"'{place.name}' has no time limit on a completion")
    gates = (ExternalGate(place.within.timer), ExternalGate(place.completion, wanted=False))
    told = f"{place.completion} has not come within {format_time(place.within.milliseconds)}"
    return Transition(name, (place.name,), (to,), external=gates, description=told)


def fault_place(place: Place) -> Place:
    """The fault place of a place whose file declares none."""
    told = f"{place.command} was not done in time" if place.command else "not done in time"
    return Place(fault_place_name(place.name), place.owner, description=told)


def limit_problems(net: Net) -> Iterator[Diagnostic]:
    """Every rule on time limits that a net violates; `ValueError` for what no text can say."""
    signals = {signal.name: signal for signal in net.signals}
    named = Counter(signal.name for signal in net.signals)  # of two that bear one name that alone is told
    timers: dict[str, str] = {}
    for place in net.places:
        if place.within is None:
            continue
        subject: Subject = ("places", place.name, "within")
        if place.completion is None:
            yield Diagnostic(
                "F2028",
                f"'{place.name}' has a time limit, and waits for no completion that could come in time",
                "add `until`, the completion of its command, or leave out `within`",
                subject,
            )
        if not _is_limit(place.within.milliseconds):
            yield no_time(place.name, f"{place.within.milliseconds}ms")
        signal = signals.get(place.within.timer)
        if signal is None or signal.kind is not SignalKind.TIMER:
            raise ValueError(f"'{place.within.timer}', which is to time '{place.name}', is no timer of the net")
        if (other := timers.setdefault(signal.name, place.name)) != place.name and named[signal.name] == 1:
            raise ValueError(f"'{signal.name}' times both '{other}' and '{place.name}'")
    for signal in net.signals:
        if signal.kind is SignalKind.TIMER and signal.name not in timers:
            raise ValueError(f"the timer '{signal.name}' is that of no place")


def no_time(place: str, text: str) -> Diagnostic:
    """The diagnostic for a time limit that is none."""
    return Diagnostic(
        "F2029",
        f"'{text}' is no time limit for '{place}'",
        f"write a number with ms, s, min or h, from 1ms to {format_time(MILLISECONDS_MAX)}, such as `within: 5s`",
        ("places", place, "within", "time"),
    )


def waiting_for_a_timer(net: Net) -> frozenset[int]:
    """The transitions that want a timer 1."""
    timers = {signal.name for signal in net.signals if signal.kind is SignalKind.TIMER}
    return frozenset(
        t
        for t, transition in enumerate(net.transitions if timers else ())
        if any(gate.wanted and gate.signal in timers for gate in transition.external)
    )


def only_after_a_timeout(net: Net) -> frozenset[str]:
    """The transitions that cannot fire as long as no time limit is over, by their input places and gates alone."""
    late = waiting_for_a_timer(net)
    if not late:
        return frozenset()
    reached, waiting = net.initial_marking, set(range(len(net.transitions))) - late
    while ready := [t for t in waiting if not (net.masks[t].inputs | net.masks[t].permissive) & ~reached]:
        waiting.difference_update(ready)
        for t in ready:
            reached |= net.masks[t].outputs
    return frozenset(net.transitions[t].name for t in waiting | late)
