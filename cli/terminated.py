"""SIGTERM to a command that searches, which `timeout` of a CI sends: it ends as by Ctrl-C, and shows what is known.

It becomes the signal of Ctrl-C, and not a call of Python's handler of that: Python calls no handler while the main
thread is in z3, which has its own for that signal and ends by it. A thread hears of the one and sends the other.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread, current_thread, main_thread
from types import FrameType


@contextmanager
def terminated_as_by_ctrl_c() -> Iterator[Event]:
    """Let SIGTERM end what is done here as Ctrl-C does; what is given is set by then, whoever ends by it.

    Where Ctrl-C means something else, as nothing in what a shell script begins with `&`, or SIGTERM does, both are left
    as they are.
    """
    ended = Event()
    theirs = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    if current_thread() is not main_thread() or theirs != (signal.SIG_DFL, signal.default_int_handler):
        yield ended
        return

    def end(*_: int | FrameType | None) -> None:
        ended.set()
        raise KeyboardInterrupt

    heard, told = os.pipe()
    os.set_blocking(told, False)
    listener = Thread(target=_listen, args=(heard,), daemon=True)
    listener.start()
    before = signal.set_wakeup_fd(told)
    signal.signal(signal.SIGTERM, lambda *_: None)
    signal.signal(signal.SIGINT, end)
    try:
        yield ended
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.set_wakeup_fd(before)
        os.close(told)
        listener.join()
        os.close(heard)


def _listen(heard: int) -> None:
    """Send on each SIGTERM that is told there, until nobody tells any more."""
    while numbers := os.read(heard, 1):
        if numbers[0] == signal.SIGTERM:
            os.kill(os.getpid(), signal.SIGINT)
