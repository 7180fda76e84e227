"""The trace of one host: what its own machines do, with the rounds by which the traces of all hosts join.

Beside firings, signals and commands it has each yes vote and each part that is applied (`firable.semantics.joining`).
A host that is started anew goes on in the same file: its clock goes on where the last line was written, or later, and a
line that a crash left half written is cut off. Lines are written after the journal is synced and before anything
leaves the host, so what others know of it stands in its trace.

Between the sync and the lines a crash still could lose them. So the journal keeps, with the acts of each sync, the
lines that they write; a start writes those of the last sync that the file lacks.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from firable.executor.protocol.messages import Effect, Keep, Stored
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import net_digest
from firable.nets.net import Net
from firable.nets.source import printable, read_source
from firable.nets.writing import write_whole
from firable.semantics.joining import APPLIED, VOTED
from firable.semantics.trace import (
    SIZE_BYTES_MAX,
    CommandSent,
    End,
    Event,
    Fired,
    Header,
    Noted,
    SignalChanged,
    read_trace,
)

_LINES: Final = "lines"
TRACE: Final = "\ntrace"
"""The name under which the journal keeps lines; no machine has it."""


class HostTrace:
    """The trace file of a host, or none; `kept` is what the journal kept under `TRACE`."""

    def __init__(
        self, net: Net, machines: tuple[str, ...], path: Path | str | None, kept: Mapping[str, Stored]
    ) -> None:
        self.path = None if path is None else Path(path)
        self.written = 0
        """How many lines stand in the file."""
        self.pending: list[str] = []
        """Those of acts that are not released yet."""
        self.offset_seconds = 0.0
        self.clock: Callable[[], float] = time.monotonic
        self.started_seconds = self.clock()
        if self.path is None or self._went_on(self.path, kept):
            return
        digest = net_digest(net)
        header = Header(net.name, digest, signals=True, commands=True, machines=machines, began=time.time())
        self.pending.append(json.dumps(header.to_json()))
        self._open(self.path, "w")

    def now_seconds(self) -> float:
        """The time since the trace began, which no restart turns back."""
        return self.offset_seconds + self.clock() - self.started_seconds

    def run_by(self, clock: Callable[[], float]) -> None:
        """Go on by another clock, that of the event loop."""
        self.offset_seconds = self.now_seconds()
        self.clock, self.started_seconds = clock, clock()

    def fired(self, transition: str, number: int | None) -> None:
        """A transition has fired, by the decision of a round or in a controller of this host alone."""
        self._add(Fired(self.now_seconds(), (transition,), number))

    def signal(self, name: str, value: bool) -> None:
        """A controller has taken a new value of a signal."""
        self._add(SignalChanged(self.now_seconds(), name, value))

    def sent(self, place: str) -> None:
        """The command of a place was sent."""
        self._add(CommandSent(self.now_seconds(), place))

    def voted(self, controller: str, number: int, promised: frozenset[str]) -> None:
        """A controller has promised transitions in a round."""
        data = {"controller": controller, "round": number, "promised": sorted(promised)}
        self._add(Noted(self.now_seconds(), VOTED, data))

    def applied(self, controller: str, number: int) -> None:
        """A controller has applied its part of what a round committed."""
        self._add(Noted(self.now_seconds(), APPLIED, {"controller": controller, "round": number}))

    def note(self, note: str, **data: str) -> None:
        """Anything else that the trace should keep."""
        self._add(Noted(self.now_seconds(), note, data))

    def end(self, marking: tuple[str, ...], reason: str) -> None:
        """The last line, of a host in which nothing is open; what happens while the host closes its link is none."""
        self._add(End(self.now_seconds(), marking, reason))
        self.flush()
        self.path = None

    def keep(self) -> list[Effect]:
        """What the journal keeps of the lines that are not in the file yet."""
        return [Keep(_LINES, [self.written + 1, *self.pending])] if self.pending else []

    def flush(self) -> None:
        """Write the lines of the acts so far; raises `InputError` F1017."""
        if self.path is not None and self.pending:
            self._open(self.path, "a")

    def _open(self, path: Path, mode: str) -> None:
        try:
            with path.open(mode, encoding="utf-8") as stream:
                stream.writelines(f"{line}\n" for line in self.pending)
        except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
            reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
            message = f"{printable(str(path))}: the trace cannot be written: {reason}"
            raise InputError([Diagnostic("F1017", message, "name a file in a folder that you may write to")]) from None
        self.written += len(self.pending)
        self.pending.clear()

    def _went_on(self, path: Path, kept: Mapping[str, Stored]) -> bool:
        """Go on in the file of an earlier start, if the journal knows of one."""
        lines = kept.get(_LINES)
        if not isinstance(lines, list) or not path.exists():
            return False
        text = read_source(path, SIZE_BYTES_MAX).text
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            write_whole(path, whole)  # a line that was half written is none
        self.written = whole.count("\n")
        first, *texts = lines
        lacking = texts[self.written + 1 - int(str(first)) :] if self.written + 1 >= int(str(first)) else texts
        self.pending += map(str, lacking)
        self.flush()
        trace = read_trace(path)
        last = max((event.at_seconds for event in trace.events), default=0.0)
        self.offset_seconds = max(last, time.time() - trace.header.began)
        return True

    def _add(self, event: Event | End) -> None:
        if self.path is not None:
            self.pending.append(json.dumps(event.to_json()))
