"""The course of a run: for how long each token stayed, and what its machine did meanwhile.

A trace tells instants. What a person or another program wants to see of a run are spans: this machine did that command
from here to there, and then stood waiting. `course` plays a trace of the net and returns the stays of all tokens, each
with when its command was sent and when its completion came; what was still there when the trace ends has no end.

The trace is judged while it is played (`Replayer`), so no picture shows a run that the net cannot have made. Pictures
and formats are made of this record alone (`firable.cli.timeline`), and agree with each other.

Rejected: spans from the lines of the trace alone, without the net. When a token left its place, which completion
belongs to which command, and that a token that enters clears the completion from before, the net alone says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from firable.nets.net import Net, Place
from firable.semantics.joining import APPLIED, STANDS, VOTED
from firable.semantics.replaying import Replayer
from firable.semantics.trace import CommandSent, Fired, Noted, SignalChanged, Trace

_OF_THE_PROTOCOL = frozenset({VOTED, STANDS, APPLIED})


@dataclass(frozen=True, slots=True)
class Stay:
    """A token on a place, from when it came to when it left; times are in seconds from the start of the run.

    `number` counts the stays on this place, from 1. `sent_seconds` is when the command of the place was sent and
    `done_seconds` when its completion came; either is None where that did not happen, or the place has none.
    `left_seconds` is None where the token was still there at the end.
    """

    place: Place
    number: int
    entered_seconds: float
    sent_seconds: float | None = None
    done_seconds: float | None = None
    left_seconds: float | None = None

    @property
    def is_broken_off(self) -> bool:
        """Whether the token left although the completion of its command had not come: a fault, or a time limit."""
        awaited = self.sent_seconds is not None and self.place.completion is not None
        return awaited and self.done_seconds is None and self.left_seconds is not None


@dataclass(frozen=True, slots=True)
class Firing:
    """A transition fired; `number` counts its firings, from 1."""

    at_seconds: float
    transition: str
    number: int


@dataclass(frozen=True, slots=True)
class Level:
    """A signal took a new value, from outside, or cleared because a token entered its place."""

    at_seconds: float
    signal: str
    value: bool


@dataclass(frozen=True, slots=True)
class Course:
    """All that happened in a run, in the order in which it took effect; stays in the order in which they began.

    `end_seconds` is the time of the last line, and `complete` whether the run ended, rather than was cut off. `notes`
    are those that are not of the voting protocol: faults, and what an operator did.
    """

    net: Net
    stays: tuple[Stay, ...]
    firings: tuple[Firing, ...]
    levels: tuple[Level, ...]
    notes: tuple[Noted, ...]
    end_seconds: float
    complete: bool
    began: float = 0.0


def course(net: Net, trace: Trace) -> Course:
    """The course of the run that a trace tells; raises `InputError` F5004 where it is no trace of the net.

    >>> from firable.nets.catalogue import catalogue_net
    >>> net = catalogue_net("one_robot")
    >>> done = course(net, Trace.of_firings(net, [["G1"], ["G2"]]))
    >>> [(stay.place.name, stay.entered_seconds, stay.left_seconds) for stay in done.stays][:2]
    [('robot.free', 0.0, 1.0), ('mc.free', 0.0, 1.0)]
    """
    player = _Player(net, trace)
    for event in trace.events:
        player.take(event)
    if trace.end is not None:
        player.replayer.end(trace.end)
    return player.course()


class _Player:
    """Plays a trace, and keeps what each event changes."""

    def __init__(self, net: Net, trace: Trace) -> None:
        self.net, self.trace = net, trace
        self.replayer = Replayer(net, trace.header, trace.file)
        self.stays: list[Stay] = []
        self.open: dict[str, int] = {}  # the stay of each place that holds a token
        self.counts: dict[str, int] = {}
        self.firings: list[Firing] = []
        self.levels: list[Level] = []
        self.notes: list[Noted] = []
        self.awaiting: dict[str, list[str]] = {}
        for place in net.places:
            if place.completion is not None:
                self.awaiting.setdefault(place.completion, []).append(place.name)
        for name in net.names(net.initial_marking):
            self._enter(name, 0.0)

    def take(self, event: Fired | SignalChanged | CommandSent | Noted) -> None:
        before, levels = self.replayer.marking, dict(self.replayer.signals)
        self.replayer.take(event)
        now = event.at_seconds
        match event:
            case Fired():
                self.firings += [Firing(now, name, self._next(f"transition {name}")) for name in event.transitions]
                after = self.replayer.marking
                for name in self.net.names(before & ~after):
                    k = self.open.pop(name)
                    self.stays[k] = replace(self.stays[k], left_seconds=now)
                for name in self.net.names(after & ~before):
                    self._enter(name, now)
            case CommandSent():
                k = self.open[event.place]
                self.stays[k] = replace(self.stays[k], sent_seconds=now)
            case SignalChanged(_, signal, True):
                for name in self.awaiting.get(signal, ()):
                    if name in self.open and self.stays[k := self.open[name]].done_seconds is None:
                        self.stays[k] = replace(self.stays[k], done_seconds=now)
            case Noted() if event.note not in _OF_THE_PROTOCOL:
                self.notes.append(event)
        for signal, value in self.replayer.signals.items():
            if levels.get(signal, False) != value:
                self.levels.append(Level(now, signal, value))

    def course(self) -> Course:
        return Course(
            self.net,
            tuple(self.stays),
            tuple(self.firings),
            tuple(self.levels),
            tuple(self.notes),
            self.replayer.now_seconds,
            self.trace.end is not None,
            self.trace.header.began,
        )

    def _next(self, what: str) -> int:
        self.counts[what] = self.counts.get(what, 0) + 1
        return self.counts[what]

    def _enter(self, name: str, now: float) -> None:
        self.open[name] = len(self.stays)
        self.stays.append(Stay(self.net.place(name), self._next(f"place {name}"), now))
