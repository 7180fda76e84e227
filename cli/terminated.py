"""SIGTERM to a command that searches, which `timeout` of a CI sends: it ends as by Ctrl-C, and shows what is known.

It becomes the signal of Ctrl-C, and not a call of Python's handler of that: Python calls no handler while the main
thread is in z3, which has its own for that signal and ends by it. A thread hears of the one and sends the other.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread, current_thread, main_thread


@contextmanager
def terminated_as_by_ctrl_c() -> Iterator[None]:
    """Let SIGTERM end what is done here as Ctrl-C does.

    Where Ctrl-C is ignored, as in what a shell script begins with `&`, or SIGTERM means something already, it is left
    as it is.
    """
    is_ours = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL and signal.getsignal(signal.SIGINT) != signal.SIG_IGN
    if current_thread() is not main_thread() or not is_ours:
        yield
        return
    heard, told = os.pipe()
    os.set_blocking(told, False)
    listener = Thread(target=_listen, args=(heard,), daemon=True)
    listener.start()
    before = signal.set_wakeup_fd(told)
    signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.set_wakeup_fd(before)
        os.close(told)
        listener.join()
        os.close(heard)


def _listen(heard: int) -> None:
    """Send on each SIGTERM that is told there, until nobody tells any more."""
    while numbers := os.read(heard, 1):
        if numbers[0] == signal.SIGTERM:
            os.kill(os.getpid(), signal.SIGINT)
