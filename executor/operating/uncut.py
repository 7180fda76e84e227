"""Ending in order whatever is asked again meanwhile, and ending all the same where something hangs.

To stop machines takes time: the safe outputs are written over links. Who presses Ctrl-C twice, or a supervisor that
repeats its request to terminate, would cancel that wait, and with it the driver in the middle of its writing. So the
first request ends the run in order, and no later one cuts into the writing. A driver bounds its waits by its own time
limits; what has not ended when `STOP_SECONDS` more are over hangs, and is given up: the run ends as a fault that says
so. A second Ctrl-C says that somebody does not want to wait so long: `HURRY_SECONDS` are left for the safe outputs,
which take milliseconds where anybody answers. Rejected: to end at that very instant, as tools that hold no machine do;
a key that bounces would leave the machines on.

A terminal that is closed and an ssh connection that is lost ask to terminate too (SIGHUP), and so does SIGQUIT: nobody
looks at the machines any more, and left to itself the signal would end the process with the machines on. Who begins a
run with `nohup` has said that it outlives the terminal, and is believed.

A program that blocks the event loop itself obeys none of this. So a thread beside it, begun with the first request,
ends the process when it is still there after all that time; what the journal holds, a restart takes up.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Final

STOP_SECONDS: Final = 10.0
"""So long the driver and the link may take to end beyond their own time limits."""
HURRY_SECONDS: Final = 1.0
"""So long where somebody has asked twice."""
GIVEN_UP: Final = 1
"""The exit code of a process that was given up."""

_ASKING: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT") if hasattr(signal, name)
)
"""The signals that ask a run to end, of those that the platform has."""
_POLL_SECONDS: Final = 0.1
_AFTER_SECONDS: Final = 5.0
"""What comes after the driver has ended takes no longer."""


class Patience:
    """How long is waited for what is being ended: `seconds`, and hardly any longer once somebody is in a hurry."""

    def __init__(self, seconds: float = STOP_SECONDS) -> None:
        self.seconds = seconds

    def hurry(self) -> None:
        """Wait no longer than for the safe outputs of who answers."""
        self.seconds = min(self.seconds, HURRY_SECONDS)


async def uncut(awaited: Collection[asyncio.Future[Any]], patience: Patience | None = None) -> list[str]:
    """Wait until all are done, however they end; to be cancelled meanwhile changes nothing.

    With `patience`, what is not done when it is over is given up: returns the names of these tasks.
    """
    loop = asyncio.get_running_loop()
    begun, asked = loop.time(), None if patience is None else patience.seconds
    while pending := [future for future in awaited if not future.done()]:
        if patience is not None:
            if patience.seconds != asked:  # a hurry counts from when it is said
                begun, asked = loop.time(), patience.seconds
            if loop.time() - begun >= patience.seconds:
                return [_given_up(future) for future in pending]
        with suppress(asyncio.CancelledError):
            await asyncio.wait(pending, timeout=None if patience is None else _POLL_SECONDS)
    return []


def _given_up(future: asyncio.Future[Any]) -> str:
    if not isinstance(future, asyncio.Task):
        return "something"
    asyncio.tasks._unregister_task(future)  # or the end of the event loop would wait for it, for ever
    return future.get_name()


@contextmanager
def ended_by_signals(patience: Patience | None = None) -> Iterator[None]:
    """Cancel the present task by the first Ctrl-C or request to terminate; a second Ctrl-C makes a hurry of it."""
    task, loop = asyncio.current_task(), asyncio.get_running_loop()
    asked: list[int] = []
    guard = Guard((patience or Patience()).seconds + _AFTER_SECONDS)

    def end(number: int, _: FrameType | None) -> None:
        asked.append(number)
        if len(asked) == 1 and task is not None:
            loop.call_soon_threadsafe(task.cancel)
            guard.begin()
        elif number == signal.SIGINT:
            if patience is not None:
                patience.hurry()
            guard.begin(2 * HURRY_SECONDS)

    if threading.current_thread() is not threading.main_thread():  # no other is reached by signals
        yield
        return
    heard = [number for number in _ASKING if signal.getsignal(number) is not signal.SIG_IGN]
    earlier = {number: signal.signal(number, end) for number in heard}
    try:
        yield
    finally:
        guard.end()
        for number, handler in earlier.items():
            signal.signal(number, handler)


class Guard:
    """A thread that ends the process if it has not been called off in time."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.timer: threading.Timer | None = None

    def begin(self, seconds: float | None = None) -> None:
        """Wait from now on, for so long."""
        self.end()
        self.timer = threading.Timer(self.seconds if seconds is None else seconds, _end_the_process)
        self.timer.daemon = True
        self.timer.start()

    def end(self) -> None:
        """Wait no more."""
        if self.timer is not None:
            self.timer.cancel()


def _end_the_process() -> None:
    message = (
        "the run hangs and is given up: its safe outputs may not have been driven, look at the machines; "
        "what the journal holds, the same command takes up"
    )
    with suppress(OSError, ValueError):
        sys.stderr.write(f"\nerror: {message}\n")
        sys.stderr.flush()
    os._exit(GIVEN_UP)
