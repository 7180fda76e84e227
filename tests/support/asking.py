"""Signals that ask a run to end, as whoever asks is heard."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def heard(number: signal.Signals) -> Iterator[None]:
    """Whoever runs the tests in the background has SIGINT ignored, and by `nohup` SIGHUP: here they are not."""
    earlier = signal.signal(number, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(number, earlier)
