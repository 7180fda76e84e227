"""Traces: what happened on a net, one JSON object a line.

Counterexamples of the analysis and logs of the executor are written in one format, so that one player judges both. The
first line is a header, the last says where the trace ended; between them stand, in the order in which they took effect:

    {"at": 1.25, "fired": ["G2"]}                        transitions that fired together
    {"at": 1.25, "signal": "robot.at_cv1", "value": 1}   a change of an external signal
    {"at": 1.25, "command": "robot.to_cv1"}              the output signal of a place, sent
    {"at": 1.25, "note": "fault", ...}                   anything else, kept and not judged

A firing that a coordinator decided bears the number of its `round` where the trace is that of one host among others;
`firable.semantics.joining` makes one trace of those of all hosts.

`at` is in seconds from the start of the run, and never runs backwards. The trace of a run that has taken a cell over
(`firable takeover`) begins in the middle: its header has what it begins with. A trace that is cut off, because the run
was killed, has no last line. Whether a trace is one of the net is decided by `firable.semantics.replaying`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, NoReturn, TextIO, TypeGuard

from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.net import Net
from firable.nets.source import read_source
from firable.semantics.player import Player

VERSION: Final = 1
SIZE_BYTES_MAX: Final = 2**30
SECONDS_MAX: Final = 1e11
"""Three thousand years: a time beyond has no date, and is that of no run."""


class Discipline(StrEnum):
    """How transitions fire: one at a time, or all enabled ones of a scan together."""

    INTERLEAVING = "interleaving"
    STEP = "step"


@dataclass(frozen=True, slots=True)
class Fired:
    """Transitions fired together; one, under interleaving. In the trace of a host, `round` is the one that decided."""

    at_seconds: float
    transitions: tuple[str, ...]
    round: int | None = None

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        of_round = {} if self.round is None else {"round": self.round}
        return {"at": self.at_seconds, "fired": list(self.transitions), **of_round}


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
class Start:
    """Where a trace begins that does not begin in M0, because its run has taken over what another one has left.

    `marking` are the places with a token, `signals` those that are 1, and `owed` the places with a command still to be
    sent. On one host of several they are those of its machines. That the net reaches the marking is not the trace's to
    show.
    """

    marking: tuple[str, ...]
    signals: tuple[str, ...] = ()
    owed: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """What the first line has of it."""
        return {"marking": list(self.marking), "signals": list(self.signals), "owed": list(self.owed)}


@dataclass(frozen=True, slots=True)
class Header:
    """The first line: of which net the trace is, and what it records.

    With `signals` the changes of external signals are recorded and gates are judged; without, gates are free. With
    `commands` the commands sent are recorded and judged. `machines` are those of the host whose trace it is, where it
    is one of several hosts (the coordinator is ""), and `began` is when, in seconds since 1970. `start` is where it
    begins, if not in M0.
    """

    net: str
    digest: str = ""
    discipline: Discipline = Discipline.INTERLEAVING
    signals: bool = False
    commands: bool = False
    machines: tuple[str, ...] = ()
    began: float = 0.0
    start: Start | None = None

    def to_json(self) -> dict[str, Any]:
        """The line of the trace file."""
        return {
            "firable_trace": VERSION,
            "net": self.net,
            "digest": self.digest,
            "discipline": self.discipline.value,
            "signals": self.signals,
            "commands": self.commands,
            **({"machines": list(self.machines), "began": self.began} if self.machines else {}),
            **({"start": self.start.to_json()} if self.start is not None else {}),
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
                if version != VERSION or not _is_whole(version):
                    raise self.failure(1, line, f"version {version} of the trace format is not known")
                machines, began = data.get("machines", []), data.get("began", 0.0)
                if _are_names(machines) and _is_number(began) and 0 <= began <= SECONDS_MAX:
                    kind, start = Discipline(discipline), self._start(line, data.get("start"))
                    return Header(net, digest, kind, signals, commands, tuple(machines), float(began), start)
        raise self.failure(1, line, "not the header of a trace")

    def _start(self, line: str, data: object) -> Start | None:
        match data:
            case None:
                return None
            case {"marking": list(marking), "signals": list(signals), "owed": list(owed)} if all(
                map(_are_names, (marking, signals, owed))
            ):
                return Start(tuple(marking), tuple(signals), tuple(owed))
        raise self.failure(1, line, "not where a trace begins")

    def event(self, number: int, line: str) -> Event | End:
        data = self.record(number, line)
        if _is_number(at := data.get("at")):
            if not abs(at) <= SECONDS_MAX:
                raise self.failure(number, line, "no run lasts so long")
            if event := _event(float(at), data):
                return event
        raise self.failure(number, line, "not an event of a trace")


def _event(at: float, data: dict[str, Any]) -> Event | End | None:
    """What the data of a line say, if they are those of an event."""
    round_ = data.get("round")
    match data:
        case {"fired": [*names]} if names and _are_names(names) and (round_ is None or _is_whole(round_)):
            return Fired(at, tuple(names), round_)
        case {"signal": str(signal), "value": 0 | 1 as value} if _is_whole(value):
            return SignalChanged(at, signal, bool(value))
        case {"command": str(place)}:
            return CommandSent(at, place)
        case {"end": str(reason), "marking": names} if _are_names(names):
            return End(at, tuple(names), reason)
        case {"note": str(note)}:
            return Noted(at, note, {k: v for k, v in data.items() if k not in {"at", "note"}})
    return None


def _is_whole(data: object) -> bool:
    # True, 1 and 1.0 are equal, and True is an int.
    return isinstance(data, int) and not isinstance(data, bool)


def _is_number(data: object) -> TypeGuard[int | float]:
    return isinstance(data, float) or _is_whole(data)


def _are_names(data: object) -> bool:
    return isinstance(data, list) and all(isinstance(name, str) for name in data)


def _no_number(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no time")
