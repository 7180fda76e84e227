"""Saying something without waiting for who hears it: lines for people and logs, on a thread beside the event loop.

A terminal that is held by Ctrl-S, a pipe whose reader sleeps, a log on a disk that stands still: who writes there
waits, and if that is the event loop, a stop waits with it. So what is only told is queued, and a thread says it, in
order. It is a daemon: one that hangs keeps no process from its end, which waits for the last words only so long.

That a line was told to nobody is known later: a later call raises it, by the names of those lines and not by its own,
and at the end whoever is named there hears of the rest.

What is a part of what the run does, journal and trace, is not told so: there nothing may leave before it is written
(`groups.py`). Rejected: writing without blocking, which drops what does not fit, in the middle of a line.
"""

from __future__ import annotations

import queue
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Final, ParamSpec

P = ParamSpec("P")

LAST_WORDS_SECONDS: Final = 1.0
"""So long the end waits for what is not said yet."""


LINES_MAX: Final = 10_000
"""So many may wait: who sleeps for days fills no memory."""

TOO_MANY: Final = "too many waited"
UNSAID: Final = "not said in time"
"""Why a line may be told to nobody, besides the errors of whoever is told."""


class UntoldError(Exception):
    """So many lines were told to nobody: how many of each name, and why; `errors` are those of whoever is told."""

    def __init__(self, untold: Iterable[tuple[str, str]], errors: Iterable[Exception] = ()) -> None:
        self.untold = Counter(untold)
        self.errors = tuple(errors)
        super().__init__("; ".join(map(self.sentence, self.untold)))

    def sentence(self, which: tuple[str, str]) -> str:
        """How many lines of a name there were, and why."""
        (name, why), count = which, self.untold[which]
        lines = f"{count:,} lines were" if count > 1 else "1 line was"
        return f"{lines} told to nobody{f' ({name})' if name else ''}: {why}"


@contextmanager
def aside(
    say: Callable[P, object],
    seconds: float = LAST_WORDS_SECONDS,
    named: Callable[P, str] = lambda *_, **__: "",
    left: Callable[[UntoldError], object] = lambda _: None,
) -> Iterator[Callable[P, None]]:
    """What calls `say` on a thread of its own, as long as this lasts; in the end all is said, or `seconds` are over.

    A later call raises `UntoldError` of all that earlier ones have told to nobody, by what `named` calls them; what it
    tells itself is said all the same. `left` is given what no later call has raised.

    >>> heard = []
    >>> with aside(heard.append) as tell:
    ...     tell("a part at entry")
    >>> heard
    ['a part at entry']
    """
    waiting: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
    unsaid: deque[str] = deque()
    """The names of the lines that wait, or are being said."""
    failed: queue.SimpleQueue[tuple[str, Exception]] = queue.SimpleQueue()
    dropped: Counter[tuple[str, str]] = Counter()

    def work() -> None:
        while (call := waiting.get()) is not None:
            try:
                call()
            except Exception as error:  # of whoever is told: it is the caller's to know
                failed.put((unsaid[0], error))
            finally:
                unsaid.popleft()

    def untold(missing: Iterable[tuple[str, str]] = ()) -> UntoldError | None:
        lines, errors = Counter(dropped), list[Exception]()
        dropped.clear()
        while not failed.empty():
            name, error = failed.get()
            lines[name, f"{type(error).__name__}: {error}"] += 1
            errors.append(error)
        lines.update(missing)
        return UntoldError(lines.elements(), errors) if lines else None

    def tell(*arguments: P.args, **named_arguments: P.kwargs) -> None:
        name = named(*arguments, **named_arguments)
        if len(unsaid) >= LINES_MAX:
            dropped[name, TOO_MANY] += 1
            return
        unsaid.append(name)
        waiting.put(lambda: say(*arguments, **named_arguments))
        if (error := untold()) is not None:
            raise error

    thread = threading.Thread(target=work, name="aside", daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        waiting.put(None)
        thread.join(seconds)
        if (error := untold((name, UNSAID) for name in unsaid.copy())) is not None:
            left(error)
