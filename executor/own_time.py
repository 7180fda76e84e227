"""An event loop whose time stands still while nobody listens: a process that did not run accuses nobody of silence.

A host may be frozen: stopped by a signal, swapped out, moved with its virtual machine, or held by one callback for
seconds. When it runs again every time limit is over at once, and asyncio ends them all in the same turn in which it
hears the first answer of what has waited in its sockets. A machine that was done in time is then late, a sign of life
missing, a device or a host lost; with a contact of the emergency stop on that device the cell is latched. All of them
kept their time; the clock was looked at by somebody who had slept.

So the time of this loop is the time in which it has listened. Between two looks at its sockets lies the wait that it
asked for, of `LISTENS_SECONDS` at most, and the work of its callbacks. Where that takes `FROZEN_SECONDS` longer, the
time goes on by `COUNTED_SECONDS` alone. That much counts, so that what is said again every few tenths of a second, a
heartbeat most of all, is said at once.

What the others do meanwhile is theirs: the watchdog of a device stops its machines, and the other hosts lose this one.

Rejected: to look at the clock in each watchdog, and to let each ask whether it has slept. There are twenty, some in
libraries. Rejected: a clock that stands still while a process is stopped: Linux has it for processor time alone.
"""

from __future__ import annotations

import asyncio
import math
import selectors
import time
from collections.abc import Callable
from typing import Final

LISTENS_SECONDS: Final = 0.25
"""The loop looks at its sockets so often, or a freeze within a long wait would not be seen."""
FROZEN_SECONDS: Final = 0.5
"""So much longer than it should has taken what was a freeze."""
COUNTED_SECONDS: Final = 0.25
"""So much of it passes for the loop."""


class ListeningSelector(selectors.DefaultSelector):
    """A selector that knows for how long nobody has looked at it."""

    def __init__(self) -> None:
        super().__init__()
        self.unheard_seconds = 0.0
        """All the time that does not count."""
        self.looked_seconds = math.inf  # before the first look nobody was to be heard
        self.wait_seconds = 0.0
        """So much of the time since then was asked for."""
        self.thawed: Callable[[float], None] = lambda _: None
        """Is told of each freeze, in seconds."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready, after `LISTENS_SECONDS` at most."""
        self.wait_seconds = LISTENS_SECONDS if timeout is None else max(min(timeout, LISTENS_SECONDS), 0.0)
        ready = self.look(self.wait_seconds)
        self.account()
        self.wait_seconds = 0.0
        self.looked_seconds = time.monotonic()
        return ready

    def account(self) -> None:
        """Take note of a freeze since the last look."""
        frozen = time.monotonic() - self.looked_seconds - self.wait_seconds
        if frozen > FROZEN_SECONDS:
            self.unheard_seconds += frozen - COUNTED_SECONDS
            self.looked_seconds += frozen
            self.thawed(frozen)

    def look(self, timeout: float) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready within `timeout` seconds."""
        return super().select(timeout)


class OwnTimeLoop(asyncio.SelectorEventLoop):
    """An event loop in its own time; `selector` is told of a freeze by `thawed`."""

    def __init__(self, selector: ListeningSelector | None = None) -> None:
        self.listening = selector or ListeningSelector()
        super().__init__(self.listening)

    def time(self) -> float:
        """The time in which it has listened, in seconds."""
        return time.monotonic() - self.listening.unheard_seconds
