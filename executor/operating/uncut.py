"""Ending in order whatever is asked again meanwhile.

To stop machines takes time: the safe outputs are written over links. Who presses Ctrl-C twice, or a supervisor that
repeats its request to terminate, would cancel that wait, and with it the driver in the middle of its writing. So the
first request ends the run, and whatever comes after waits with it. The driver bounds the wait by its own time limits.
Rejected: to end at once by the second request, as tools that hold no machine do; to kill the process is that.
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from typing import Any


async def uncut(awaited: Collection[asyncio.Future[Any]]) -> None:
    """Wait until all are done, however they end; to be cancelled meanwhile changes nothing."""
    while pending := [future for future in awaited if not future.done()]:
        with suppress(asyncio.CancelledError):
            await asyncio.wait(pending)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Cancel the present task by the first Ctrl-C or request to terminate; any other, during or after, does nothing."""
    tasks = [task for task in [asyncio.current_task()] if task is not None]

    def end() -> None:
        while tasks:
            tasks.pop().cancel()

    if threading.current_thread() is threading.main_thread():  # no other is reached by signals
        with suppress(NotImplementedError):  # an event loop of Windows, where Ctrl-C ends the run as Python does it
            for number in (signal.SIGINT, signal.SIGTERM):
                asyncio.get_running_loop().add_signal_handler(number, end)
    try:
        yield
    finally:
        tasks.clear()
