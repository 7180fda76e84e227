"""A driver for a dry run, without machines: every command is done after a while, and every sensor shows what it is
told to.

It lets the hosts of a cell be started, linked, cut off and started anew before a machine is connected, over the real
links and with the real journals: the tokens go round, and nothing moves. The simulated cell cannot do that, because
its machines hand workpieces to each other and so live in one process.

Asked after a restart, it says of every command that it is done: what it would have done is over by then.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping

from firable.executor.drivers.driver import Answer, Clock, Listener, Quality, Reading
from firable.nets.net import Net, Place, SignalKind


class DryRunDriver:
    """The driver of a dry run of the subnets given: commands take `seconds`, and `shown` says what sensors show."""

    def __init__(self, subnets: Iterable[Net], seconds: float, shown: Mapping[str, bool] | None = None) -> None:
        self.seconds = seconds
        sensors = (s.name for subnet in subnets for s in subnet.signals if s.kind is SignalKind.SENSOR)
        self.shown = {name: (shown or {}).get(name, True) for name in sensors}
        self.clock: Clock | None = None
        self.listener: Listener | None = None
        self.is_stopped = False

    @property
    def at_rest(self) -> bool:
        """Never: what an operator changes of the sensors is not to be known."""
        return False

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """None: there is no device that could be out of reach."""
        return ()

    @property
    def unreached(self) -> tuple[str, ...]:
        """Nothing, likewise."""
        return ()

    @property
    def tells_each_sensor(self) -> bool:
        """Always, at the start."""
        return True

    def readings(self) -> Mapping[str, Reading]:
        """What the sensors show."""
        return {name: Reading(value, quality=Quality.GOOD, why="") for name, value in self.shown.items()}

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Tell what the sensors show, then complete commands until cancelled."""
        self.clock, self.listener = clock, listener
        for name, value in self.shown.items():
            listener.signal(name, value, None)
        await asyncio.get_running_loop().create_future()

    def send(self, place: Place, entry: int) -> None:
        """Take the command of a place, and complete it in time."""
        if self.clock is None or self.listener is None or self.is_stopped:
            return
        self.listener.taken(place.name, entry)
        if place.completion is not None:
            delay = self.clock.loop_delay_seconds(self.clock.now_seconds() + self.seconds)
            asyncio.get_running_loop().call_later(delay, self._done, place.completion, entry)

    def _done(self, completion: str, entry: int) -> None:
        if self.listener is not None and not self.is_stopped:
            self.listener.signal(completion, value=True, entry=entry)

    def withdraw(self, place: Place) -> None:
        """Nothing: a command is taken when it is sent."""

    async def met(self) -> None:
        """At once: there is no device that could be out of reach."""

    async def ask(self, place: Place, entry: int) -> Answer:
        """What became of a command: it is over, if there is one."""
        return Answer.DONE if place.command is not None and entry else Answer.UNKNOWN

    def stop(self) -> None:
        """Complete nothing any more."""
        self.is_stopped = True

    @property
    def undriven(self) -> tuple[str, ...]:
        """None: there is no device that could be out of reach."""
        return ()

    def against(self) -> tuple[str, ...]:
        """Nothing: there is no device that could be out of reach."""
        return ()

    def release(self) -> None:
        """Nothing: no machine is stopped."""

    def close(self) -> bool:
        """Nothing: workpieces come and go with the tokens."""
        return False
