"""The time of a run: of the event loop that it runs on, from the run's beginning, faster where simulated."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Final

_SHORTEST_SECONDS: Final = 2e-9
"""An event loop ends shorter waits at once; where time stands still meanwhile, it would never come there."""


@dataclass(frozen=True, slots=True)
class RunClock:
    """The time of a run on the present event loop, `speed` times as fast as the loop's."""

    loop: asyncio.AbstractEventLoop
    begin_seconds: float
    speed: float = 1.0

    @classmethod
    def going_on(cls, at_seconds: float, speed: float) -> RunClock:
        """The clock that shows `at_seconds` now."""
        loop = asyncio.get_running_loop()
        return cls(loop, loop.time() - at_seconds / speed, speed)

    def now_seconds(self) -> float:
        """The time since the beginning of the run."""
        return (self.loop.time() - self.begin_seconds) * self.speed

    def loop_delay_seconds(self, until_seconds: float) -> float:
        """How long the event loop has to wait until a time of the run; then that time has come."""
        delay = (until_seconds - self.now_seconds()) / self.speed
        return max(delay, _SHORTEST_SECONDS) if delay > 0 else 0.0
