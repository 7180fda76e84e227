"""The recorder: writes the trace of a host as it goes, and keeps the joint marking that the trace of a whole run shows.

Firings, votes, signals, commands and notes are written in the order in which they took effect: a coordinated firing at
the coordinator's decision, a local one where it occurs. Of a whole run that order is a trace of the central net
(SEMANTICS O1-O5), so the recorder plays it along and is where a running executor is asked for its marking. Of one host
among others it is what the machines there did, with the rounds by which the traces of all hosts join
(`firable.semantics.joining`).

A file is written on the thread that stores (`groups.py`): a disk that stands still must not keep a stop from the
machines. A line is written only once what it tells is durable, or a trace could show what a restart has forgotten.
Then a process that is killed between the two leaves a trace without its last lines. So the journal keeps, with each
group of acts, the lines of that group and where in the file they begin: a restart cuts the file there and writes them
again, and the trace goes on as if nothing had happened. What is told beside what is kept, a sensor that opened no gate,
is flushed without a sync and cut off by a crash: drivers tell it anew. The last line is not kept: it stands there until
the run is taken up again.
"""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from io import FileIO
from pathlib import Path
from typing import Final, Protocol

from firable.executor.cell.cell_log import CellLog
from firable.executor.protocol.enabled import EnabledSet
from firable.executor.protocol.messages import Keep, ProtocolError, Stored
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Marking, Net
from firable.nets.source import printable
from firable.nets.writing import UNREAD, open_at_once
from firable.semantics.joining import APPLIED, STANDS, VOTED
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, Noted, SignalChanged, Start


class LineStream(Protocol):
    """Where a recorder writes: a text stream, as far as it needs one."""

    def write(self, line: str, /) -> object:
        """Write a line with its end."""
        ...

    def flush(self) -> None:
        """Hand over what is still buffered."""
        ...


_SHORT: Final = "it is shorter than its journal says; was it changed, or the power cut?"
_TORN: Final = "its last lines are not text as they were written; was it changed, or the power cut?"
_TAIL_BYTES: Final = 65_536
"""So much of a file is looked at before it is gone on with: a power cut leaves its last blocks empty, however many."""


class TraceFile:
    """A trace on disk, begun anew, or gone on with after `size_bytes` bytes: what fails is `InputError` F1017.

    What stands behind them, or there at all where it is begun anew, stays until the first line is written.
    """

    def __init__(self, path: Path | str, size_bytes: int = 0) -> None:
        self.path = path
        self.is_writing = False
        self.cut_at: int | None = size_bytes
        """Where the file is cut before the first line; None when that is done."""
        with _failures(self.path):
            mode = "r+" if size_bytes or Path(path).is_file() else "w"
            # No buffer, whose lock a write that hangs would hold.
            self.file = FileIO(path, mode, opener=open_at_once)
            if size_bytes and (lost := self._lost(size_bytes)):
                self.file.close()
                raise ValueError(lost)

    def _lost(self, size_bytes: int) -> str:
        """What is not there any more of the lines before these bytes, in words."""
        if self.file.seek(0, os.SEEK_END) < size_bytes:
            return _SHORT
        begin = self.file.seek(max(size_bytes - _TAIL_BYTES, 0))
        tail = self.file.read(size_bytes - begin)
        return "" if tail.endswith(b"\n") and b"\0" not in tail else _TORN

    def _cut(self, size_bytes: int) -> None:
        if stat.S_ISREG(os.fstat(self.file.fileno()).st_mode):  # of a pipe or a device nothing can be cut
            self.file.truncate(size_bytes)
            self.file.seek(size_bytes)

    def write(self, lines: str, /) -> None:
        """Write lines with their ends, whole; on any thread."""
        self.is_writing = True
        try:
            with _failures(self.path):
                if self.cut_at is not None:
                    self._cut(self.cut_at)
                    self.cut_at = None
                rest = memoryview(lines.encode())
                while rest:
                    rest = rest[self.file.write(rest) or 0 :]
        finally:
            self.is_writing = False

    def flush(self) -> None:
        """Nothing is buffered."""

    def close(self) -> None:
        """Close the file; again, or where a write hangs, it does nothing."""
        if not self.is_writing:
            with _failures(self.path):
                self.file.close()


@contextmanager
def _failures(path: Path | str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        reason = error.strerror if isinstance(error, OSError) else str(error)
        message = f"{printable(str(path))}: the trace cannot be written: {reason}"
        hint = "name a file in a folder that you may write to"
        if reason in {_SHORT, _TORN}:
            hint = "put the trace of this run back as it was, or leave --trace out: it cannot be begun in the middle"
        if reason == UNREAD:
            hint = "start who reads it before the run, or name a file"
        if isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
            hint = "make room on its disk; with --journal, the same command then takes the run up"
        raise InputError([Diagnostic("F1017", message, hint)]) from None


def room_for(path: Path | str) -> AbstractContextManager[object]:
    """Raise `InputError` F1017 where no trace can be; one that is made to see that is taken away at once.

    Be in what is returned until the trace is open: a pipe that is let go of before would have ended for its reader.
    """
    with _failures(path):
        try:
            Path(path).stat()
        except FileNotFoundError:
            if str(path).endswith("/"):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)) from None
            made = os.path.realpath(path)  # a link that leads nowhere stays
            os.close(os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
            Path(made).unlink()
            return nullcontext()
        return closing(TraceFile(path))


TRACE: Final = "\ntrace"
"""The name under which the journal keeps the trace; no machine has it."""
HELD_BACK_MAX: Final = 1000
"""So many lines wait at most until they may be written: the journal keeps them with each group until then."""
KEY: Final = "trace"
"""Under which the journal keeps what a restart needs to go on with a trace."""
CELL: Final = "cell"
"""Under which that is how far the log of a simulated cell was."""


class Recorder:
    """The trace so far, its marking and its counts, which are of this process.

    `kept` is what `keep` gave the journal before a restart; the stream then stands at `size_bytes_of(kept)`. `machines`
    are those of a host among others, and `began` is when its trace was begun, in seconds since 1970. It begins in M0,
    or at the `start` that a takeover has left.
    """

    def __init__(
        self,
        net: Net,
        digest: str,
        stream: LineStream | None,
        kept: Stored | None = None,
        machines: tuple[str, ...] = (),
        began: float = 0.0,
        start: Start | None = None,
        cell: CellLog | None = None,
    ) -> None:
        self.cell = cell
        """The log of the simulated cell, of which the journal keeps how far it was."""
        self.machines = machines
        self.began = float(str(kept.get("began", began))) if isinstance(kept, Mapping) else began
        self.player = TokenPlayer.of(net)
        self.word = net.initial_marking if start is None else net.marking(start.marking)
        openable = [c for c in self.player.transitions.values() if c.openable]
        places = self.player.places
        self._firable = EnabledSet([(c.needs & places, c.forbids & places) for c in openable], len(net.places))
        self.stream = stream
        self.may_write = True
        """Whether lines may be written: not as long as the run may be refused, which changes no file."""
        self.firings: dict[str, int] = {transition.name: 0 for transition in net.transitions}
        self.commands = 0
        self.size_bytes = 0
        """Of the stream without the lines that are not written yet."""
        self.at_seconds = 0.0
        self.unwritten: list[str] = []
        self.begun = 0
        """How many of them are being written."""
        self.is_ended = False
        self.observers: list[Callable[[Event], None]] = []
        """Who is shown each event as it is recorded."""
        if isinstance(kept, Mapping):
            self.word = int(str(kept["word"]), 16)
            self.at_seconds = float(str(kept["at"]))
            if stream is not None:
                self.size_bytes = size_bytes_of(kept)
                self.unwritten = str(kept["lines"]).splitlines(keepends=True)
            self.note(self.at_seconds, "restarted")
        else:
            header = Header(net.name, digest, signals=True, commands=True, machines=machines, began=self.began)
            self._write(replace(header, start=start))

    @property
    def is_deadlock(self) -> bool:
        """Whether no transition is firable and openable, as `situation.is_deadlock` says, without looking at each."""
        return not self._firable.at(self.word & self.player.places)

    def keep(self) -> list[Keep]:
        """What the journal keeps, together with the acts that the unwritten lines tell."""
        now: dict[str, Stored] = {
            "at": self.at_seconds,
            "word": f"{self.word:x}",
            "size_bytes": self.size_bytes,
            "lines": "".join(self.unwritten) if self.unwritten else "",
        }
        if self.cell is not None:
            now[CELL] = list(self.cell.mark)
        return [Keep(KEY, now | {"began": repr(self.began)} if self.machines else now)]

    @property
    def marking(self) -> Marking:
        """The joint marking."""
        return self.player.marking(self.word)

    def fired(self, at_seconds: float, transition: str, number: int | None = None) -> None:
        """A transition has fired, by the decision of a round or in its controller alone.

        Raises `ProtocolError` where the joint marking does not let it: a firing that is told twice would be undone.
        """
        if not self.machines:
            compiled, word = self.player.transitions[transition], self.word
            if word & compiled.takes != compiled.takes or word & compiled.puts:
                raise ProtocolError(f"'{transition}' is told as fired where its tokens are not")
            self.word = compiled.fire(word)
        self.firings[transition] += 1
        self.at_seconds = at_seconds
        if self.stream is not None or self.observers:
            self._write(Fired(at_seconds, (transition,), number))

    def voted(self, at_seconds: float, controller: str, number: int, promised: frozenset[str]) -> None:
        """A controller has voted in a round: yes for these transitions."""
        if self._is_told(at_seconds):
            data = {"controller": controller, "round": number, "promised": sorted(promised)}
            self._write(Noted(at_seconds, VOTED, data))

    def stands(self, at_seconds: float, controller: str, transitions: frozenset[str]) -> None:
        """A controller has said yes for parts that are free of promise: of one host among others, that is told."""
        if self._is_told(at_seconds):
            self._write(Noted(at_seconds, STANDS, {"controller": controller, "transitions": sorted(transitions)}))

    def applied(self, at_seconds: float, controller: str, number: int, transition: str) -> None:
        """A controller has applied its part of what a round committed: of one host among others, that is told."""
        if self.machines and self._is_told(at_seconds):
            data = {"controller": controller, "round": number, "transition": transition}
            self._write(Noted(at_seconds, APPLIED, data))

    def signal(self, at_seconds: float, name: str, value: bool) -> None:
        """A controller has taken a new value of a signal."""
        bit = self.player.signal_bits[name]
        self.word = self.word | bit if value else self.word & ~bit
        self.at_seconds = at_seconds
        if self.stream is not None or self.observers:  # an event that nobody is shown is not made
            self._write(SignalChanged(at_seconds, name, value))

    def sent(self, at_seconds: float, place: str) -> None:
        """The command of a place was sent."""
        self.commands += 1
        self.at_seconds = at_seconds
        if self.stream is not None or self.observers:
            self._write(CommandSent(at_seconds, place))

    def note(self, at_seconds: float, note: str, **data: str) -> None:
        """Anything else that the trace should keep."""
        self._write(Noted(at_seconds, note, data))

    def end(self, at_seconds: float, marking: tuple[str, ...], reason: str) -> None:
        """The last line, which no journal keeps: a run that is taken up again goes on before it.

        What happens afterwards, while links are closed, is none.
        """
        self._write(End(at_seconds, marking, reason))
        self.is_ended = True

    def writing(self) -> Callable[[], None] | None:
        """Begin to write the lines so far: what writes them to a file, on any thread; None where nothing does.

        `written` follows when it is done. What is returned raises `InputError` F1017 where the file cannot be written.
        """
        self.may_write |= len(self.unwritten) > HELD_BACK_MAX
        self.begun = len(self.unwritten) if self.may_write else 0
        if self.begun == 0 or not isinstance(self.stream, TraceFile):
            return None
        return partial(self.stream.write, "".join(self.unwritten))  # others come while they are written

    def written(self) -> None:
        """What was begun is written, or will be now where the stream is no file."""
        lines, self.begun = self.unwritten[: self.begun], 0
        if self.stream is None or not lines:
            return
        if not isinstance(self.stream, TraceFile):
            for line in lines:
                self.stream.write(line)
            self.stream.flush()
        self.size_bytes += sum(map(len, lines))
        del self.unwritten[: len(lines)]

    def _is_told(self, at_seconds: float) -> bool:
        """Whether anybody is shown what happens now: an event that nobody is shown is not made."""
        self.at_seconds = at_seconds
        return self.stream is not None or bool(self.observers)

    def _write(self, item: Header | Event | End) -> None:
        if self.is_ended:
            return
        if not isinstance(item, Header):
            self.at_seconds = item.at_seconds
        if self.stream is not None:
            self.unwritten.append(json.dumps(item.to_json()) + "\n")  # in ASCII: as many bytes as characters
        if not isinstance(item, Header | End):
            for observer in self.observers:
                observer(item)


def size_bytes_of(kept: Stored | None) -> int:
    """Where the stream has to stand for a recorder to go on."""
    return int(str(kept["size_bytes"])) if isinstance(kept, Mapping) else 0
