"""The clock of a simulated host: it runs fast or slow, jumps ahead and stands still, and never goes back.

It is what a monotonic clock of an operating system may do: hosts differ in speed, a suspended or starved host finds
that time has jumped, and a clock that the host does not advance while it sleeps stands still. What no such clock does
is run backwards. Two hosts share nothing but the time of the world, which none of them sees.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Clock:
    """A clock that shows 0 when it is started."""

    rate: float = 1.0
    """Seconds that it counts in a second of the world."""
    stands_still: bool = False
    shown_seconds: float = 0.0

    def advance(self, seconds: float) -> None:
        """Let so much time of the world pass."""
        if not self.stands_still:
            self.shown_seconds += seconds * self.rate

    def jump(self, seconds: float) -> None:
        """Let it jump ahead."""
        self.shown_seconds += seconds
