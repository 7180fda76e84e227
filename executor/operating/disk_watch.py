"""The disk of journal and trace, watched while it stores: one that stands still is told of while it does.

Nothing leaves before journal and trace have it (`groups.py`). So a disk that stands still stops a cell that nobody has
stopped: no command is sent, no vote is given, and whoever looks sees machines at rest and transitions that have fired.
After `HANGS_SECONDS`, of which a disk that works needs some thousandths, the operator is told, and the log and the
figures are; the situation says it until the disk has answered, which is told as well. The trace has it with what is
stored next: a note that had to be stored itself would give a disk that is slow for ever work for ever.

Telling is all. Nothing is lost as long as the process waits, the machines end what they are at, and a stop reaches them
at once; what becomes of the disk then, `groups.py` says. Rejected: to end the run by itself after some time. A disk on
a network may be back after a minute, and a cell that stands still at a marking it knows is better than one that has
to be taken up. Rejected: a timer for each sync. There are thousands a second, and one timer that looks again is enough.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

HANGS: Final = "disk hangs"
ANSWERS: Final = "disk answers"
"""The kinds of notes."""
HANGS_SECONDS: Final = 1.0
"""A sync that takes longer is told of."""


class DiskWatch:
    """The syncs of one host, of which one is under way at most."""

    def __init__(self, run: Host) -> None:
        self.run = run
        self.since: float | None = None
        """When the sync that is under way was begun, by the clock of the event loop."""
        self.timer: asyncio.TimerHandle | None = None
        self.is_told = False
        """Whether it has been told that this one takes long."""

    def asked(self) -> None:
        """A sync has begun, and is not over at once."""
        loop = asyncio.get_running_loop()
        self.since = loop.time()
        if self.timer is None:
            self.timer = loop.call_later(HANGS_SECONDS, self._look)

    def answered(self) -> None:
        """It is over."""
        seconds, self.since = self._seconds(), None
        if self.is_told:
            self.is_told = False
            self._tell(ANSWERS, f"the disk of {self.run.acts.stored_in} has answered after {seconds:.1f} s")

    def end(self) -> None:
        """Tell nothing any more."""
        if self.timer is not None:
            self.timer.cancel()

    def sentence(self) -> str:
        """What there is to say of it now; empty where it has its time."""
        if not self.is_told:
            return ""
        disk = f"the disk of {self.run.acts.stored_in}"
        return f"{disk} has not answered for {self._seconds():.1f} s: nothing leaves until it does"

    def _seconds(self) -> float:
        return 0.0 if self.since is None else asyncio.get_running_loop().time() - self.since

    def _look(self) -> None:
        self.timer = None
        if self.since is None:
            return
        if (left := HANGS_SECONDS - self._seconds()) > 0:  # it was begun after the one that this was set for
            self.timer = asyncio.get_running_loop().call_later(left, self._look)
            return
        self.is_told = True
        self._tell(HANGS, self.sentence())

    def _tell(self, kind: str, sentence: str) -> None:
        """Tell the operator, the log and the figures."""
        self.run.tell_operator(kind, sentence)
        self.run.recorder.note(self.run.now_seconds(), kind, message=sentence)
