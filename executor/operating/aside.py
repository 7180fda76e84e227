"""Saying something without waiting for who hears it: lines for people and logs, on a thread beside the event loop.

A terminal that is held by Ctrl-S, a pipe whose reader sleeps, a log on a disk that stands still: who writes there
waits, and if that is the event loop, a stop waits with it. So what is only told is queued, and a thread says it, in
order. It is a daemon: one that hangs keeps no process from its end, which waits for the last words only so long.

What is a part of what the run does, journal and trace, is not told so: there nothing may leave before it is written
(`groups.py`). Rejected: writing without blocking, which drops what does not fit, in the middle of a line.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final, ParamSpec

P = ParamSpec("P")

LAST_WORDS_SECONDS: Final = 1.0
"""So long the end waits for what is not said yet."""


LINES_MAX: Final = 10_000
"""So many may wait: who sleeps for days fills no memory."""


class UntoldError(Exception):
    """So many lines were told to nobody, because too many waited."""


@contextmanager
def aside(say: Callable[P, object], seconds: float = LAST_WORDS_SECONDS) -> Iterator[Callable[P, None]]:
    """What calls `say` on a thread of its own, as long as this lasts; in the end all is said, or `seconds` are over.

    A later call raises what an earlier one has failed with, or `UntoldError`; what it tells is said all the same.

    >>> heard = []
    >>> with aside(heard.append) as tell:
    ...     tell("a part at entry")
    >>> heard
    ['a part at entry']
    """
    waiting: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
    failed: queue.SimpleQueue[Exception] = queue.SimpleQueue()

    def work() -> None:
        while (call := waiting.get()) is not None:
            try:
                call()
            except Exception as error:  # of whoever is told: it is the caller's to know
                failed.put(error)

    untold = 0

    def tell(*arguments: P.args, **named: P.kwargs) -> None:
        nonlocal untold
        if waiting.qsize() >= LINES_MAX:
            untold += 1
            return
        waiting.put(lambda: say(*arguments, **named))
        if untold:
            some, untold = untold, 0
            raise UntoldError(f"{some:,} lines were told to nobody: too many waited")
        if not failed.empty():
            raise failed.get()

    thread = threading.Thread(target=work, name="aside", daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        waiting.put(None)
        thread.join(seconds)
