"""A line on the terminal that tells how far an exploration has come, while somebody waits.

It goes to standard error, and by itself only where that is a terminal, so that reports and logs hold nothing of it; it
begins after a second, because what is done sooner needs no line, and is wiped before the report is printed. Told is
what the engine counts, markings and edges, and which verdict is being settled by itself, with how far that is: how much
is still to come nobody knows, so that a bar or a percentage, the alternative, would be made up.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from shutil import get_terminal_size
from threading import Event, Lock, Thread
from time import monotonic
from typing import Final, TextIO

SILENT_SECONDS: Final = 1.0
EVERY_SECONDS: Final = 0.2


class _Line:
    """A line that is written over itself, and wiped in the end."""

    def __init__(self, stream: TextIO, clock: Callable[[], float]) -> None:
        self._stream = stream
        self._clock = clock
        self._began = clock()
        self._width = 0

    def _write(self, line: str) -> None:
        line = line[: get_terminal_size().columns - 1]  # the rest of a broken line could not be wiped
        self._stream.write(f"\r{line.ljust(self._width)}")
        self._stream.flush()
        self._width = len(line)

    def wipe(self) -> None:
        """Take the line off the terminal."""
        if self._width:
            self._stream.write(f"\r{' ' * self._width}\r")
            self._stream.flush()
            self._width = 0


class ProgressLine(_Line):
    """Writes how many markings and edges were found: over itself on a terminal, else line by line; for any thread."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = monotonic) -> None:
        super().__init__(stream, clock)
        self._is_terminal = stream.isatty()
        self._next = self._began + SILENT_SECONDS
        self._turn = Lock()

    def __call__(self, n_markings: int, n_edges: int) -> None:
        """Tell how far it is; most calls come too soon after the last to be told."""
        self.say(f"{n_markings:,} markings, {n_edges:,} edges")

    def say(self, words: str) -> None:
        """Tell in words how far it is."""
        with self._turn:
            now = self._clock()
            if now < self._next:
                return
            self._next = now + (EVERY_SECONDS if self._is_terminal else 10 * EVERY_SECONDS)
            line = f"  {words}, {now - self._began:.0f} s"
            if self._is_terminal:
                self._write(line)
            else:
                self._stream.write(f"{line}\n")
                self._stream.flush()


@contextmanager
def progress_line(wanted: bool | None) -> Generator[ProgressLine | None]:
    """A line for the work of this block; None where it is not wanted, or by default where nobody would see it."""
    if not (sys.stderr.isatty() if wanted is None else wanted):
        yield None
        return
    line = ProgressLine(sys.stderr)
    try:
        yield line
    finally:
        line.wipe()


class Stages(_Line):
    """Writes what is being done and for how long, where the work itself counts nothing: over itself, on a terminal."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = monotonic) -> None:
        super().__init__(stream, clock)
        self._words = ""

    def __call__(self, words: str) -> None:
        """Say what is done from now on."""
        self._words = words

    def tell(self) -> None:
        """Write the line, once a second has gone by."""
        seconds = self._clock() - self._began
        if seconds < SILENT_SECONDS or not self._words:
            return
        self._write(f"  {self._words}, {seconds:.0f} s")


@contextmanager
def stages() -> Generator[Callable[[str], object]]:
    """What tells the stages of the work of this block: a line on a terminal, and nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    line, over = Stages(sys.stderr), Event()

    def write() -> None:
        while not over.wait(EVERY_SECONDS):
            line.tell()

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        yield line
    finally:
        over.set()
        writer.join()
        line.wipe()
