"""An event loop whose clock jumps: simulated hours pass as fast as the work in them is done.

asyncio asks its selector to wait until the next timer is due. This loop's selector does not wait; it moves the loop's
own clock there. What is given to a thread is done at once instead and takes no time, or time would jump while the
thread works, as far as the machine is slow. Tasks, timers and futures are the ordinary ones, so the same code runs in
real time on an ordinary loop; and nothing depends on how fast the machine is, so a run is a function of its seed. The
alternative, a clock parameter threaded through all code that waits, gives two ways to wait and tests only one of them.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, TypeVar, TypeVarTuple

T = TypeVar("T")
Ts = TypeVarTuple("Ts")


class _JumpingSelector(selectors.DefaultSelector):
    """A selector that moves the clock on instead of waiting for a timer."""

    def __init__(self) -> None:
        super().__init__()
        self.now_seconds = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready now; where nothing is, it is `timeout` seconds later on this clock."""
        # Without a timer, only another thread (or Ctrl-C) can wake the loop: then waiting is right.
        ready = super().select(None if timeout is None else 0)
        if not ready and timeout is not None and timeout > 0:
            self.now_seconds += timeout
        return ready


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An event loop in virtual time, which begins at 0."""

    def __init__(self) -> None:
        self._jumping = _JumpingSelector()
        super().__init__(self._jumping)

    def time(self) -> float:
        """The virtual time in seconds."""
        return self._jumping.now_seconds

    def run_in_executor(self, executor: Executor | None, func: Callable[[*Ts], T], *args: *Ts) -> asyncio.Future[T]:
        """Call a function at once, on no thread of any executor; the future that is returned is done."""
        del executor
        done: asyncio.Future[T] = self.create_future()
        try:
            done.set_result(func(*args))
        except Exception as error:  # it is the future's
            done.set_exception(error)
        return done


def run_in_virtual_time(coroutine: Any) -> Any:
    """Run a coroutine to its end on a loop in virtual time, and return its result."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(coroutine)
