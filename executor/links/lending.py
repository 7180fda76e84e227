"""An event loop that lends itself: while it sleeps, another thread may do what the loop would be woken for.

A library with threads of its own, as Zenoh is, calls back on one of them. To hand over to an event loop is to write to
a pipe, to wake the thread of the loop and to wait until the system has switched to it, which takes as long as a whole
message over loopback. But a loop that waits for something to happen does nothing else: its thread stands in `select`,
and nobody reads or changes what belongs to the loop. So there is a lock, which the loop holds whenever it works and
lets go of while it waits. Whoever has the lock *is* the loop: for `asyncio`, too, it is the running one of that thread.
What is done so is done as by a callback, one after the other, and never beside one.

Nobody waits for the lock but the loop itself, for as long as one callback takes; a thread that does not get it hands
over as ever. A loop that has been given something to do meanwhile, a callback or a timer, is woken afterwards.

Rejected: a lock around the host, taken by each of its entrances. There are dozens, of drivers, timers and the operator,
and one that is forgotten shows once a year. Rejected, too: a second loop for the link. What is acted upon is one thing,
and two loops would need the lock again.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from contextvars import Context
from threading import Lock
from typing import TypeVarTuple

from firable.executor.own_time import ListeningSelector, OwnTimeLoop

Ts = TypeVarTuple("Ts")


class _LettingGo(ListeningSelector):
    """A selector that holds the lock but while it waits."""

    def __init__(self) -> None:
        super().__init__()
        self.lock = Lock()
        self.lock.acquire()

    def look(self, timeout: float) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready; others may have the lock until then."""
        if timeout <= 0:
            return super().look(timeout)
        self.lock.release()
        try:
            return super().look(timeout)
        finally:
            self.lock.acquire()


class LendingLoop(OwnTimeLoop):
    """An event loop on which other threads may work while it sleeps."""

    def __init__(self) -> None:
        self._letting_go = _LettingGo()
        super().__init__(self._letting_go)
        self.is_lent = False
        """Whether another thread works on it now."""
        self._has_news = False

    def lend(self, work: Callable[[], object]) -> bool:
        """Do something on the present thread as if it were a callback of this loop; False where the loop is at work.

        What it raises is raised here, when the loop has been given back.
        """
        if self.get_debug() or not self._letting_go.lock.acquire(blocking=False):
            return False  # a loop that looks for mistakes takes other threads for one
        try:
            self.is_lent, self._has_news = True, False
            asyncio._set_running_loop(self)
            try:
                self.listening.account()  # before anything is begun in a time that is set back when the loop wakes
                work()
            finally:
                asyncio._set_running_loop(None)
                if self._has_news:
                    self.call_soon_threadsafe(_nothing)
                self.is_lent = False
        finally:
            self._letting_go.lock.release()
        return True

    def call_soon(
        self, callback: Callable[[*Ts], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.Handle:
        """The same as of any loop."""
        self._has_news = True
        return super().call_soon(callback, *args, context=context)

    def call_at(
        self, when: float, callback: Callable[[*Ts], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """The same as of any loop."""
        self._has_news = True
        return super().call_at(when, callback, *args, context=context)


def _nothing() -> None:
    pass
