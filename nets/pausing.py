"""No search for cycles of garbage while a large net is built.

Python counts what is made and, each time the count has grown by a quarter, visits every object alive to look for cycles
that nothing refers to. Reading a net makes millions of records and no cycle; the visits found nothing and took more
than half of the time. Reference counts free everything here, so the search is paused for as long as a net is read.

Rejected: `gc.freeze`, which also hides what the caller made before, and a larger threshold, which only moves the cost.
"""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def without_cycle_search() -> Generator[None]:
    """Pause the search for cycles of garbage in this block; where it was off before, it stays off.

    >>> with without_cycle_search():
    ...     gc.isenabled()
    False
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
