"""Traces: what happened on a net, one JSON object a line, and the replay that decides whether it could.

Counterexamples of the analysis and logs of the executor are written in one format, so that one player judges both. The
first line is a header, the last says where the trace ended; between them stand, in the order in which they took effect:

    {"at": 1.25, "fired": ["G2"]}                        transitions that fired together
    {"at": 1.25, "signal": "robot.at_cv1", "value": 1}   a change of an external signal
    {"at": 1.25, "command": "robot.to_cv1"}              the output signal of a place, sent
    {"at": 1.25, "note": "fault", ...}                   anything else, kept and not judged

`at` is in seconds from the start of the run, and never runs backwards. `replay` plays the firings from M0 by the
reference player: each must be firable, in a trace that records signals its external gates must be open, every entry of
a place with an output signal must send its command exactly once before the token leaves, and the last line must show
the marking reached. A token that enters a place clears the completion signal of the place: a value from before is
stale and opens no gate, and a completion may not come before its command. A trace
that is cut off, because the run was killed, has no last line, and `replay` says so.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, NoReturn, TextIO

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.net import Marking, Net
from firable.nets.source import read_source
from firable.semantics.player import Player

VERSION: Final = 1
SIZE_BYTES_MAX: Final = 2**30


class Discipline(StrEnum):
    """How transitions fire: one at a time, or all enabled ones of a scan together."""

    INTERLEAVING = "interleaving"
    STEP = "step"


@dataclass(frozen=True, slots=True)
class Fired:
    """Transitions fired together; one, under interleaving."""

    at_seconds: float
    transitions: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {"at": self.at_seconds, "fired": list(self.transitions)}


@dataclass(frozen=True, slots=True)
class SignalChanged:
    """An external signal took a new value."""

    at_seconds: float
    signal: str
    value: bool

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {"at": self.at_seconds, "signal": self.signal, "value": int(self.value)}


@dataclass(frozen=True, slots=True)
class CommandSent:
    """The output signal of a place was sent to its machine."""

    at_seconds: float
    place: str

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {"at": self.at_seconds, "command": self.place}


@dataclass(frozen=True, slots=True)
class Noted:
    """Anything else worth keeping: a fault, an operator's stop; not judged by the replay."""

    at_seconds: float
    note: str
    data: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {**self.data, "at": self.at_seconds, "note": self.note}


Event = Fired | SignalChanged | CommandSent | Noted


@dataclass(frozen=True, slots=True)
class Header:
    """The first line: of which net the trace is, and what it records.

    With `signals` the changes of external signals are recorded and gates are judged; without, gates are free. With
    `commands` the commands sent are recorded and judged.
    """

    net: str
    digest: str = ""
    discipline: Discipline = Discipline.INTERLEAVING
    signals: bool = False
    commands: bool = False

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {
            "firable_trace": VERSION,
            "net": self.net,
            "digest": self.digest,
            "discipline": self.discipline.value,
            "signals": self.signals,
            "commands": self.commands,
        }


@dataclass(frozen=True, slots=True)
class End:
    """The last line: the marking at the end, as the names of the places with a token, and why the run ended."""

    at_seconds: float
    marking: tuple[str, ...]
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {"at": self.at_seconds, "end": self.reason, "marking": list(self.marking)}


@dataclass(frozen=True)
class Trace:
    """A header, the events in the order in which they took effect, and the end, missing where the run was cut off."""

    header: Header
    events: tuple[Event, ...]
    end: End | None = None
    file: str = "<trace>"

    @classmethod
    def of_firings(
        cls, net: Net, firings: Iterable[Iterable[str]], discipline: Discipline = Discipline.INTERLEAVING
    ) -> Trace:
        """The trace of a firing sequence with gates free: how counterexamples are written down.

        Raises `firable.semantics.player.NotFirableError` where the sequence is none of the net.
        """
        player, marking = Player(net), net.initial_marking
        events = []
        for k, fired in enumerate(tuple(map(tuple, firings))):
            marking = player.fire(marking, (net.transition_index[name] for name in fired))
            events.append(Fired(float(k), fired))
        return cls(Header(net.name, discipline=discipline), tuple(events), End(float(len(events)), net.names(marking)))

    def lines(self) -> Iterator[str]:
        """The lines of the file, without line ends."""
        for item in (self.header, *self.events, *((self.end,) if self.end else ())):
            yield json.dumps(item.to_json(), separators=(", ", ": "))

    def write(self, stream: TextIO) -> None:
        """Write the trace as JSON lines."""
        for line in self.lines():
            stream.write(line + "\n")


def read_trace(path: Path | str) -> Trace:
    """Read a trace file; raises `InputError` F5005 with the line, F1001-F1004 where it is no text file."""
    source = read_source(path, SIZE_BYTES_MAX)
    return parse_trace(source.text, source.file)


def parse_trace(text: str, file: str = "<trace>") -> Trace:
    """Read the text of a trace file; raises `InputError` F5005 with the line."""
    reader = _Reader(file)
    # A line without its end was being written when the run was killed: it is no line yet.
    lines = text.split("\n")[:-1]
    if not lines:
        raise InputError(
            [Diagnostic("F1002", "the trace is empty", "a trace begins with a header", span=Span(file, 1, 1))]
        )
    header = reader.header(lines[0])
    events: list[Event] = []
    end = None
    for number, line in enumerate(lines[1:], start=2):
        if end is not None:
            raise reader.failure(number, line, "a line after the end of the trace")
        item = reader.event(number, line)
        if isinstance(item, End):
            end = item
        else:
            events.append(item)
    return Trace(header, tuple(events), end, file)


class _Reader:
    """Turns lines into records, or into one clear error."""

    def __init__(self, file: str) -> None:
        self.file = file

    def failure(self, number: int, line: str, message: str) -> InputError:
        span = Span(self.file, number, 1, line[:200])
        hint = "traces are written by `firable run` and `firable check`"
        return InputError([Diagnostic("F5005", message, hint, span=span)])

    def record(self, number: int, line: str) -> dict[str, Any]:
        try:
            data = json.loads(line, parse_constant=_no_number)
        except (ValueError, RecursionError):
            data = None
        if not isinstance(data, dict):
            raise self.failure(number, line, "not a JSON object")
        return data

    def header(self, line: str) -> Header:
        data = self.record(1, line)
        match data:
            case {
                "firable_trace": int(version),
                "net": str(net),
                "digest": str(digest),
                "discipline": "interleaving" | "step" as discipline,
                "signals": bool(signals),
                "commands": bool(commands),
            }:
                if version != VERSION:
                    raise self.failure(1, line, f"version {version} of the trace format is not known")
                return Header(net, digest, Discipline(discipline), signals, commands)
        raise self.failure(1, line, "not the header of a trace")

    def event(self, number: int, line: str) -> Event | End:
        data = self.record(number, line)
        match data:
            case {"at": float() | int() as at, "fired": list(names)} if names and all(
                isinstance(n, str) for n in names
            ):
                return Fired(float(at), tuple(names))
            case {"at": float() | int() as at, "signal": str(signal), "value": 0 | 1 as value}:
                return SignalChanged(float(at), signal, bool(value))
            case {"at": float() | int() as at, "command": str(place)}:
                return CommandSent(float(at), place)
            case {"at": float() | int() as at, "end": str(reason), "marking": list(names)} if all(
                isinstance(n, str) for n in names
            ):
                return End(float(at), tuple(names), reason)
            case {"at": float() | int() as at, "note": str(note)}:
                return Noted(float(at), note, {k: v for k, v in data.items() if k not in {"at", "note"}})
        raise self.failure(number, line, "not an event of a trace")


def _no_number(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no time")


@dataclass(frozen=True, slots=True)
class Replay:
    """What a trace did, once it is known to be a trace of the net."""

    marking: Marking
    firings: int
    commands: int
    complete: bool


def replay(net: Net, trace: Trace) -> Replay:
    """Play the trace by the reference player; raises `InputError` F5004 with the line that is no event of the net."""
    return _Replayer(net, trace).run()


class _Replayer:
    """The marking, the valuation and the commands owed, as the trace goes on."""

    def __init__(self, net: Net, trace: Trace) -> None:
        self.net = net
        self.trace = trace
        self.player = Player(net)
        self.marking = net.initial_marking
        self.signals: dict[str, bool] = {}
        self.owed: set[str] = set()
        self.now_seconds = 0.0
        self.firings = 0
        self.commands = 0

    def deviates(self, number: int, message: str, hint: str) -> NoReturn:
        record = (self.trace.header, *self.trace.events, *((self.trace.end,) if self.trace.end else ()))[number - 1]
        span = Span(self.trace.file, number, 1, json.dumps(record.to_json()))
        raise InputError([Diagnostic("F5004", message, hint, span=span)])

    def run(self) -> Replay:
        if self.trace.header.net != self.net.name:
            self.deviates(1, f"the trace is of the net '{self.trace.header.net}'", f"this net is '{self.net.name}'")
        number = 1
        for number, event in enumerate(self.trace.events, start=2):
            self.passed(number, event.at_seconds)
            match event:
                case Fired():
                    self.fired(number, event)
                case SignalChanged():
                    self.changed(number, event)
                case CommandSent():
                    self.sent(number, event)
                case Noted():
                    pass
        if self.trace.end is not None:
            self.passed(number + 1, self.trace.end.at_seconds)
            self.ended(number + 1, self.trace.end)
        return Replay(self.marking, self.firings, self.commands, self.trace.end is not None)

    def passed(self, number: int, at_seconds: float) -> None:
        if at_seconds < self.now_seconds:
            self.deviates(number, "time runs backwards", f"the line before is of {self.now_seconds:g} s")
        self.now_seconds = at_seconds

    def changed(self, number: int, event: SignalChanged) -> None:
        if event.signal not in self.net.signal_index:
            self.deviates(number, f"there is no signal '{event.signal}'", "is the trace of another net?")
        unsent = [place for place in sorted(self.owed) if self.net.place(place).completion == event.signal]
        if event.value and unsent:
            self.deviates(
                number, f"'{event.signal}' completes a command of '{unsent[0]}' that was not sent", "it is stale"
            )
        self.signals[event.signal] = event.value

    def fired(self, number: int, event: Fired) -> None:
        if unknown := [name for name in event.transitions if name not in self.net.transition_index]:
            self.deviates(number, f"there is no transition '{unknown[0]}'", "is the trace of another net?")
        if self.trace.header.discipline is Discipline.INTERLEAVING and len(event.transitions) > 1:
            self.deviates(number, "several transitions fire at once", "under interleaving they fire one at a time")
        fired = [self.net.transition_index[name] for name in event.transitions]
        if len(set(fired)) < len(fired):
            self.deviates(number, "a transition fires twice at once", "write it once")
        firable = self.player.firable(self.marking)
        judged = self.trace.header.signals
        enabled = self.player.enabled(self.marking, self.signals) if judged else firable
        for t in fired:
            transition = self.net.transitions[t]
            if t not in firable:
                self.deviates(number, f"'{transition.name}' is not firable", self.why_not(t))
            if not transition.openable:
                self.deviates(number, f"'{transition.name}' can never fire", "it wants one signal both 1 and 0")
            if t not in enabled:
                # That it is closed, the firing rule has said; which gate it is, the message wants to know.
                gate = next(g for g in transition.external if self.signals.get(g.signal, False) != g.wanted)
                self.deviates(
                    number,
                    f"'{transition.name}' fires although its external gate is closed",
                    f"'{gate.signal}' is {int(not gate.wanted)} and must be {int(gate.wanted)}",
                )
        if not self.player.conflicts.free(fired):
            self.deviates(number, "transitions in conflict fire together", "they share an input or an output place")
        step = self.trace.header.discipline is Discipline.STEP
        if step and not self.is_a_step(fired):
            self.deviates(number, "not a maximal step", "an enabled transition without conflict is left out")
        after = self.player.fire(self.marking, fired)
        self.entered(number, after)
        self.marking = after
        self.firings += len(fired)

    def is_a_step(self, fired: list[int]) -> bool:
        wanted = tuple(sorted(fired))
        if self.trace.header.signals:
            return wanted in self.player.maximal_steps(self.player.enabled(self.marking, self.signals))
        return self.player.is_step(self.marking, wanted)

    def why_not(self, t: int) -> str:
        masks, names = self.net.masks[t], self.net.names
        reasons = []
        if missing := names((masks.inputs | masks.permissive) & ~self.marking):
            reasons.append(f"{', '.join(missing)} must hold a token")
        if full := names((masks.outputs | masks.inhibitive) & self.marking):
            reasons.append(f"{', '.join(full)} must be empty")
        return "; ".join(reasons)

    def entered(self, number: int, after: Marking) -> None:
        entered = self.net.names(after & ~self.marking)
        for place in entered:
            if (completion := self.net.place(place).completion) is not None:
                self.signals[completion] = False
        if not self.trace.header.commands:
            return
        left = self.net.names(self.marking & ~after)
        if unsent := [place for place in left if place in self.owed]:
            command = self.net.place(unsent[0]).command
            self.deviates(number, f"the token leaves '{unsent[0]}' before its command was sent", f"expected: {command}")
        self.owed.update(place for place in entered if self.net.place(place).command is not None)

    def sent(self, number: int, event: CommandSent) -> None:
        if event.place not in self.owed:
            known = event.place in self.net.place_index
            reason = "no token has entered it since its last command" if known else "there is no such place"
            self.deviates(number, f"a command of '{event.place}' that is not due", reason)
        self.owed.remove(event.place)
        self.commands += 1

    def ended(self, number: int, end: End) -> None:
        shown = self.net.names(self.marking)
        if set(end.marking) != set(shown) or len(end.marking) != len(shown):
            self.deviates(
                number, "the trace ends in another marking than it shows", f"reached: {', '.join(shown) or 'none'}"
            )
        if end.reason == "deadlock" and not self.player.deadlocked(self.marking):
            self.deviates(number, "the trace ends in a deadlock that is none", "some transition is firable")
        if self.owed:
            self.deviates(
                number, f"the command of '{min(self.owed)}' was never sent", "each entry sends its command once"
            )
