"""Alarms: a command that is not over in time is a fault, unless its place has a time limit of its own.

A net cannot tell a slow machine from a dead one; only time does. A command is over when its completion has come; one
without completion, when its machine has taken it. A place with `within` says in the net what follows when its time is
over (`time_limits.py`), so it needs no alarm.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from firable.executor.operating.clock import RunClock
from firable.nets.net import Net


class Alarms:
    """One for each command that is awaited, by its completion or place; `fail` is told of one that goes off."""

    def __init__(self, net: Net, overdue_seconds: float, fail: Callable[[str], None]) -> None:
        self.net = net
        self.overdue_seconds = overdue_seconds
        self.fail = fail
        self.timers: dict[str, asyncio.TimerHandle] = {}

    def watch(self, place: str, clock: RunClock) -> None:
        """Await the end of a place's command from now on."""
        sender = self.net.place(place)
        if sender.within is None:
            awaited = sender.completion or place
            self.over(awaited)
            delay = self.overdue_seconds / clock.speed
            self.timers[awaited] = clock.loop.call_later(delay, self._overdue, place, clock.now_seconds())

    def over(self, awaited: str) -> None:
        """Await it no more."""
        if (timer := self.timers.pop(awaited, None)) is not None:
            timer.cancel()

    def end(self) -> None:
        """Await nothing."""
        for timer in self.timers.values():
            timer.cancel()

    def _overdue(self, place: str, sent_at: float) -> None:
        sender = self.net.place(place)
        self.timers.pop(sender.completion or place, None)
        awaited = f"'{sender.completion}' has not come" if sender.completion else "its machine has not taken it"
        self.fail(
            f"'{sender.command}' of '{place}', sent at {sent_at:.1f} s, is overdue: "
            f"{awaited} within {self.overdue_seconds:g} s"
        )
