"""The monitor at work: it sees every event of a run, and time where nothing is seen, and tells the first divergence.

The clock of the run is asked for the moment at which time alone can show something, so a machine that says nothing is
noticed when it should have spoken, and not when something else happens.

After a restart, a takeover or an emergency stop nothing is watched: machines and workpieces may then be anywhere, and
the plant file tells of a cell from its beginning. That is told, since somebody may rely on it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from firable.executor.drivers.driver import Clock
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.monitor import Divergence, Monitor
from firable.semantics.trace import Event

UNWATCHED: Final = "unwatched"
"""The kind of note of machines that are not watched any more."""
UNWATCHED_SENTENCE: Final = (
    "from here on the machines are not held against their plant file, which does not tell where they and their "
    "workpieces are in the middle of a run"
)


def otherwise(found: Divergence) -> str:
    """A divergence in a sentence."""
    return f"the machines are not as they are modelled: {found}"


class Watching:
    """A monitor beside a run; `tell` is called once at most."""

    def __init__(self, monitor: Monitor | LocalMonitor, tell: Callable[[Divergence], None]) -> None:
        self.monitor = monitor
        self.tell = tell
        self.clock: Clock | None = None
        self.timer: asyncio.TimerHandle | None = None

    def begin(self, clock: Clock) -> None:
        """Notice silence from now on, by the clock of the run."""
        self.clock = clock
        self._wait()

    def end(self) -> None:
        """Notice nothing more."""
        if self.timer is not None:
            self.timer.cancel()
        self.clock = None

    def seen(self, event: Event) -> None:
        """Take an event of the trace."""
        if (found := self.monitor.seen(event)) is not None:
            self.tell(found)
        self._wait()

    def _wait(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None
        due = self.monitor.deadline_seconds()
        if self.clock is not None and due is not None:
            delay = self.clock.loop_delay_seconds(due) + _AFTER_SECONDS
            self.timer = asyncio.get_running_loop().call_later(delay, self._passed)

    def _passed(self) -> None:
        if self.clock is None:
            return
        found = self.monitor.passed(self.clock.now_seconds())
        if found is not None:
            self.tell(found)
        else:
            self._wait()


_AFTER_SECONDS = 1e-6
"""A deadline is over when the clock shows more than it."""
