"""The recorder: writes the trace of a run as it goes, and keeps the joint marking that the trace shows.

Firings, signals, commands and notes are written in the order in which they took effect: a coordinated firing at the
coordinator's decision, a local one where it occurs. That order is a trace of the central net (SEMANTICS O1-O5), so the
recorder plays it along and is where a running executor is asked for its marking. It is flushed whenever the
run waits, so that who follows the file sees what has happened; a line that a killed run leaves half written is no line
of the trace.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Marking, Net
from firable.nets.source import printable
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, Noted, SignalChanged


class LineStream(Protocol):
    """Where a recorder writes: a text stream, as far as it needs one."""

    def write(self, line: str, /) -> object:
        """Write a line with its end."""
        ...

    def flush(self) -> None:
        """Hand over what is still buffered."""
        ...


class TraceFile:
    """A trace on disk, opened anew: whatever fails here is `InputError` F1017, and no other error is taken for it."""

    def __init__(self, path: Path | str) -> None:
        self.path = path
        with self._failures():
            self.stream = Path(path).open("w", encoding="utf-8")  # noqa: SIM115 - open as long as this object is

    def write(self, line: str, /) -> None:
        """Write a line with its end."""
        with self._failures():
            self.stream.write(line)

    def flush(self) -> None:
        """Hand over what is still buffered."""
        with self._failures():
            self.stream.flush()

    def close(self) -> None:
        """Close the file; again, it does nothing."""
        with self._failures():
            self.stream.close()

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
            reason = error.strerror if isinstance(error, OSError) else str(error)
            message = f"{printable(str(self.path))}: the trace cannot be written: {reason}"
            raise InputError([Diagnostic("F1017", message, "name a file in a folder that you may write to")]) from None


class Recorder:
    """The trace so far, its marking and its counts."""

    def __init__(self, net: Net, digest: str, stream: LineStream | None) -> None:
        self.player = TokenPlayer.of(net)
        self.word = net.initial_marking
        self.stream = stream
        self.firings: dict[str, int] = {transition.name: 0 for transition in net.transitions}
        self.commands = 0
        self.unflushed = False
        self._write(Header(net.name, digest, signals=True, commands=True))

    @property
    def marking(self) -> Marking:
        """The joint marking."""
        return self.player.marking(self.word)

    def fired(self, at_seconds: float, transition: str) -> None:
        """A transition of the central net has fired."""
        self.word = self.player.transitions[transition].fire(self.word)
        self.firings[transition] += 1
        self._write(Fired(at_seconds, (transition,)))

    def signal(self, at_seconds: float, name: str, value: bool) -> None:
        """A controller has taken a new value of a signal."""
        bit = self.player.signal_bit(name)
        self.word = self.word | bit if value else self.word & ~bit
        self._write(SignalChanged(at_seconds, name, value))

    def sent(self, at_seconds: float, place: str) -> None:
        """The command of a place was sent."""
        self.commands += 1
        self._write(CommandSent(at_seconds, place))

    def note(self, at_seconds: float, note: str, **data: str) -> None:
        """Anything else that the trace should keep."""
        self._write(Noted(at_seconds, note, data))

    def end(self, at_seconds: float, reason: str) -> None:
        """The last line."""
        self._write(End(at_seconds, self.player.net.names(self.marking), reason))
        self.flush()

    def flush(self) -> None:
        """Hand the lines so far over to who follows the file."""
        if self.stream is not None and self.unflushed:
            self.stream.flush()
            self.unflushed = False

    def _write(self, item: Header | Event | End) -> None:
        if self.stream is not None:
            self.stream.write(json.dumps(item.to_json()) + "\n")
            self.unflushed = True
