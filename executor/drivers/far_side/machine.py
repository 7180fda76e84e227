"""The machine behind an end for which drivers are tested: it does what a device has to, and only when it is told.

It keeps the rules of a channel: a number that it has is ignored, another one is taken; number 0 clears what it shows.
Its watchdog, when it has been given one, sets the output to its safe value and fails the command under way; that it
has done so is shown until the output is written anew. Where it is asked for a sign of life it gives one while it lives.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from firable.executor.drivers.device import Point, Value, as_number
from firable.executor.drivers.far_side.end import FarEnd

ROLES: Final = ("sensor", "closed", "button", "beat", "tripped", "output", "code", "taken", "done", "failed", "alive")
"""What an end must have a point for; besides `number` or `command`."""

SIGN_S: Final = 0.01
"""How long its sign of life stays as it is."""


@dataclass(frozen=True, slots=True)
class Order:
    """A command as the machine got it: its number, and what was written before it or with it."""

    number: int
    code: Value


class Machine:
    """A machine with one channel, two sensors, a button for the emergency stop, an output and a watchdog."""

    def __init__(self, end: FarEnd, points: Mapping[str, Point]) -> None:
        self.end = end
        self.points = points
        self.roles = {point: role for role, point in points.items()}
        self.orders: list[Order] = []
        self.outputs: list[bool] = []
        """All that was written to the output."""
        self.events: list[str] = []
        """The roles that were written, in order."""
        self.number = 0
        self.code: Value = 0
        self.beats = 0
        self.taking = True
        self.stands_at_output = False
        """Whether what is written to the output stops it in the middle of a command, which has failed then."""
        self.finished = 0
        self.waiting: tuple[int, Value] | None = None
        """The command that stands there while it takes none."""
        self.finishes_at_once = False
        self.watchdog_s = 0.0
        self.watching: asyncio.TimerHandle | None = None
        self.signs = 0
        """How often its sign of life has changed."""
        self.living: asyncio.TimerHandle | None = None

    async def start(self) -> None:
        """Begin to serve, with everything at 0."""
        await self.end.start(self.written)
        for role in ("taken", "done", "failed"):
            self.show(role, 0)
        for role in ("sensor", "closed", "tripped"):
            self.show(role, value=False)
        self.show("button", value=True)

    async def stop(self) -> None:
        """End."""
        self.lives = False
        if self.watching is not None:
            self.watching.cancel()
        await self.end.stop()

    @property
    def lives(self) -> bool:
        """Whether it gives a sign of life, a number that grows."""
        return self.living is not None

    @lives.setter
    def lives(self, value: bool) -> None:
        if self.living is not None:
            self.living.cancel()
        self.living = None
        if value:
            self._live()

    @property
    def takes(self) -> bool:
        """Whether its program runs, which takes what it is given; one that is written stands there until then."""
        return self.taking

    @takes.setter
    def takes(self, value: bool) -> None:
        self.taking = value
        if value and self.waiting is not None:
            number, code = self.waiting
            self.waiting = None
            self._ordered(number, code)

    def show(self, role: str, value: Value) -> None:
        """Show a value at the point of a role."""
        self.end.show(self.points[role], value)

    def switch_off_and_on(self) -> None:
        """Forget what it had."""
        self._ordered(0, 0)

    def finish(self, number: int | None = None) -> None:
        """Show that the newest command, or the one of a number, is done."""
        self.finished = self.number if number is None else number
        self.show("done", self.finished)

    def fail(self) -> None:
        """Show that the newest command has failed."""
        self.show("failed", self.number)

    def written(self, point: Point, value: Value) -> None:
        """Take what a client writes."""
        role = self.roles.get(point)
        if role is None:
            return
        self.events.append(role)
        match role:
            case "number":
                self._ordered(as_number(value), self.code)
            case "command":
                number, _, text = str(value).partition(" ")
                self._ordered(as_number(number), text)
            case "code":
                self.code = value
            case "output":
                self.show("tripped", value=False)
                self.outputs.append(bool(as_number(value) if isinstance(value, str) else value))
                if self.stands_at_output and self.number != self.finished:
                    self.fail()
            case "beat":
                self._beaten()

    def _ordered(self, number: int | None, code: Value) -> None:
        if number == 0:
            self.number, self.waiting = 0, None
            for role in ("taken", "done", "failed"):
                self.show(role, 0)
        elif number is not None and number != self.number and not self.taking:
            self.waiting = (number, code)
        elif number is not None and number != self.number:
            self.number = number
            self.orders.append(Order(number, code))
            self.show("taken", number)
            if self.finishes_at_once:
                self.finish()

    def _live(self) -> None:
        self.signs += 1
        self.show("alive", self.signs)
        self.living = asyncio.get_running_loop().call_later(SIGN_S, self._live)

    def _beaten(self) -> None:
        self.beats += 1
        if self.watching is not None:
            self.watching.cancel()
        if self.watchdog_s:
            self.watching = asyncio.get_running_loop().call_later(self.watchdog_s, self._trip)

    def _trip(self) -> None:
        self.outputs.append(False)
        self.show("tripped", value=True)
        self.fail()
