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
class Moment:
    """What one event of the trace did; stays are told by their index in `Course.stays`."""

    at_seconds: float
    fired: tuple[Firing, ...] = ()
    left: tuple[int, ...] = ()
    entered: tuple[int, ...] = ()
    sent: tuple[int, ...] = ()
    done: tuple[int, ...] = ()
    levels: tuple[Level, ...] = ()


@dataclass(frozen=True, slots=True)
class Course:
    """All that happened in a run, in the order in which it took effect; stays in the order in which they began.

    `moments` tell the same event by event, so that what happened in one instant keeps its order. `end_seconds` is
    the time of the last line, `complete` whether the run ended, rather than was cut off, and `has_signals` whether the
    trace records them. `notes` are those that are not of the voting protocol: faults, and what an operator did. `began`
    is when, in seconds since 1970, or 0 where the trace does not say.
    """

    net: Net
    stays: tuple[Stay, ...]
    firings: tuple[Firing, ...]
    levels: tuple[Level, ...]
    moments: tuple[Moment, ...]
    notes: tuple[Noted, ...]
    end_seconds: float
    complete: bool
    has_signals: bool
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
        self.moments: list[Moment] = []
        self.notes: list[Noted] = []
        self.awaiting: dict[str, list[str]] = {}
        for place in net.places:
            if place.completion is not None:
                self.awaiting.setdefault(place.completion, []).append(place.name)
        for name in net.names(self.replayer.marking):
            self._enter(name, 0.0)

    def take(self, event: Fired | SignalChanged | CommandSent | Noted) -> None:
        before, levels = self.replayer.marking, dict(self.replayer.signals)
        self.replayer.take(event)
        now = event.at_seconds
        fired: list[Firing] = []
        left: list[int] = []
        entered: list[int] = []
        sent: list[int] = []
        done: list[int] = []
        match event:
            case Fired():
                fired = [Firing(now, name, self._next(f"transition {name}")) for name in event.transitions]
                after = self.replayer.marking
                left = [self.open.pop(name) for name in self.net.names(before & ~after)]
                for k in left:
                    self.stays[k] = replace(self.stays[k], left_seconds=now)
                entered = [self._enter(name, now) for name in self.net.names(after & ~before)]
            case CommandSent():
                sent = [self.open[event.place]]
                self.stays[sent[0]] = replace(self.stays[sent[0]], sent_seconds=now)
            case SignalChanged(_, signal, True):
                waiting = [self.open[name] for name in self.awaiting.get(signal, ()) if name in self.open]
                done = [k for k in waiting if self.stays[k].done_seconds is None]
                for k in done:
                    self.stays[k] = replace(self.stays[k], done_seconds=now)
            case Noted() if event.note not in _OF_THE_PROTOCOL:
                self.notes.append(event)
        new = [Level(now, s, value) for s, value in self.replayer.signals.items() if levels.get(s, False) != value]
        self.firings += fired
        self.levels += new
        self.moments.append(
            Moment(now, tuple(fired), tuple(left), tuple(entered), tuple(sent), tuple(done), tuple(new))
        )

    def course(self) -> Course:
        return Course(
            self.net,
            tuple(self.stays),
            tuple(self.firings),
            tuple(self.levels),
            tuple(self.moments),
            tuple(self.notes),
            self.replayer.now_seconds,
            self.trace.end is not None,
            self.trace.header.signals,
            self.trace.header.began,
        )

    def _next(self, what: str) -> int:
        self.counts[what] = self.counts.get(what, 0) + 1
        return self.counts[what]

    def _enter(self, name: str, now: float) -> int:
        self.open[name] = len(self.stays)
        self.stays.append(Stay(self.net.place(name), self._next(f"place {name}"), now))
        return self.open[name]
