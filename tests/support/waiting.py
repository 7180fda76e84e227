"""Waiting for what another process does: until it is so, and with a patience that a busy machine does not use up.

What happens on an event loop is waited for by `firable.executor.drivers.bench.until`.
"""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

PATIENCE_SECONDS: Final = 60.0
"""A machine that tests run on beside much else is ten times slower than one with nothing else to do."""


def until(condition: Callable[[], object], what: Callable[[], object] | str, *, every_seconds: float = 0.02) -> None:
    """Look again and again until something is so; `what` names it where it never is."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not condition():
        late = time.monotonic() >= end
        assert not late, f"not within {PATIENCE_SECONDS:g} s: {what if isinstance(what, str) else what()}"
        time.sleep(every_seconds)


@contextmanager
def heard_in_time(process: subprocess.Popen[str]) -> Iterator[None]:
    """While this lasts, a process that says nothing for ever is killed: whoever reads what it says comes to an end."""
    timer = threading.Timer(PATIENCE_SECONDS, process.kill)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
