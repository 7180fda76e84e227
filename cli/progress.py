"""A line that tells how far long work has come, while somebody waits.

It goes to standard error, so that reports hold nothing of it. On a terminal it begins after a second, because what is
done sooner needs no line, is written over itself, and is wiped before the report is printed. In a log, such as that of
a CI job, it is a line a minute: enough to see that something goes on, and what, where a job that says nothing for long
is taken for one that hangs. Told is what is being done, what the engine counts, markings and edges, and which verdict
is being settled by itself, with how far that is: how much is still to come nobody knows, so that a bar or a percentage,
the alternative, would be made up.
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
LOG_SECONDS: Final = 60.0
"""How often a log is told of what nobody asked to be told, and of what is as it was."""
_LOOK_SECONDS: Final = 0.2


class ProgressLine:
    """Writes what is being done and how far it is: over itself on a terminal, else line by line; for any thread.

    Where nobody `wanted` it, a log hears of it once a minute.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = monotonic, *, wanted: bool = True) -> None:
        self._stream = stream
        self._clock = clock
        self._is_terminal = stream.isatty()
        self._seldom = not (self._is_terminal or wanted)
        self._began = clock()
        self._next = self._began + (LOG_SECONDS if self._seldom else SILENT_SECONDS)
        self._again = self._next
        self._doing = self._words = self._told = ""
        self._width = 0
        self._turn = Lock()

    def __call__(self, n_markings: int, n_edges: int) -> None:
        """Tell how far it is; most calls come too soon after the last to be told."""
        self.say(f"{n_markings:,} markings, {n_edges:,} edges")

    def say(self, words: str) -> None:
        """Tell in words how far it is."""
        with self._turn:
            self._words = words
            self._tell(self._next)

    def begins(self, doing: str) -> None:
        """Say what is done from now on."""
        with self._turn:
            self._doing, self._words = doing, ""

    def tell(self) -> None:
        """Tell what was said last, where it is time to: a log is told again of what is as it was only once a minute."""
        with self._turn:
            self._tell(self._again if self._said == self._told else self._next)

    @property
    def _said(self) -> str:
        return ": ".join(filter(None, (self._doing, self._words)))

    def _tell(self, due: float) -> None:
        now, words = self._clock(), self._said
        if not words or now < due:
            return
        self._told = words
        self._next = now + (EVERY_SECONDS if self._is_terminal else LOG_SECONDS if self._seldom else 10 * EVERY_SECONDS)
        self._again = now + (EVERY_SECONDS if self._is_terminal else LOG_SECONDS)
        line = f"  {words}, {now - self._began:.0f} s"
        if self._is_terminal:
            line = line[: get_terminal_size().columns - 1]  # the rest of a broken line could not be wiped
            self._stream.write(f"\r{line.ljust(self._width)}")
            self._width = len(line)
        else:
            self._stream.write(f"{line}\n")
        self._stream.flush()

    def wipe(self) -> None:
        """Take the line off the terminal."""
        if self._width:
            self._stream.write(f"\r{' ' * self._width}\r")
            self._stream.flush()
            self._width = 0


@contextmanager
def progress_line(wanted: bool | None = None) -> Generator[ProgressLine | None]:
    """A line for the work of this block; None where it is not wanted, and once a minute where nobody said."""
    if wanted is False:
        yield None
        return
    line, over = ProgressLine(sys.stderr, wanted=bool(wanted)), Event()

    def look() -> None:
        while not over.wait(_LOOK_SECONDS):
            line.tell()

    looking = Thread(target=look, daemon=True)
    looking.start()
    try:
        yield line
    finally:
        over.set()
        looking.join()
        line.wipe()


@contextmanager
def stages() -> Generator[Callable[[str], object]]:
    """What tells the stages of the work of this block, where the work itself counts nothing."""
    with progress_line() as line:
        yield line.begins if line is not None else lambda _: None
