"""The driver of the simulated cell: commands become commands of the plant, what the plant sees becomes signals.

Each command goes out under a ticket of its own, which the plant gives back when the command is done, so that a late
acknowledgement is never taken for that of a later command.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from firable.executor.cell.plant import CommandDone, Plant, PlantFault, PlantReport, SensorChanged
from firable.executor.drivers.driver import Clock, Listener
from firable.nets.net import Net, Place, SignalKind


@dataclass(slots=True)
class _Awaited:
    """A completion that is being formed."""

    signal: str
    entry: int
    acknowledged: bool = False


class SimulatedDriver:
    """The driver of a simulated cell."""

    def __init__(self, plant: Plant, net: Net) -> None:
        self.plant = plant
        self.sensors = {signal.name for signal in net.signals if signal.kind is SignalKind.SENSOR}
        self.shown = dict(plant.shown)
        """What each sensor showed in the report told last; the plant may have gone on when a report is told."""
        self.awaited: dict[str, _Awaited] = {}
        """For each completion signal, the command that it will complete."""
        self.tickets: dict[int, _Awaited] = {}
        self.next_ticket = 0
        self.clock: Clock | None = None
        self.listener: Listener | None = None
        self.awake: asyncio.Event = asyncio.Event()

    @property
    def at_rest(self) -> bool:
        """Whether no event is scheduled in the plant."""
        return self.plant.next_seconds is None

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Let the plant's events happen when they are due."""
        self.clock, self.listener = clock, listener
        loop = asyncio.get_running_loop()
        while True:
            self._tell(self.plant.advance(clock.now_seconds()))
            listener.moved()
            self.awake.clear()
            due = self.plant.next_seconds
            timer = None if due is None else loop.call_later(clock.loop_delay_seconds(due), self.awake.set)
            await self.awake.wait()
            if timer is not None:
                timer.cancel()

    def send(self, place: Place, entry: int) -> None:
        """Give the machine its command, under a new ticket."""
        command = place.command
        if command is None or self.clock is None:
            raise RuntimeError(f"'{place.name}' sends no command, or the driver does not run yet")
        ticket = self.next_ticket
        self.next_ticket += 1
        if place.completion is not None:
            self.awaited[place.completion] = self.tickets[ticket] = _Awaited(place.completion, entry)
        now = self.clock.now_seconds()
        self._tell(self.plant.command(now, command.machine, command.command, dict(command.parameters), ticket))
        self.awake.set()

    def stop(self) -> None:
        """Stop every machine of the plant where it is."""
        self.plant.halt()

    def close(self) -> None:
        """Let no more workpieces come."""
        self.plant.close()

    def _tell(self, reports: list[PlantReport]) -> None:
        for report in reports:
            match report:
                case SensorChanged(signal, value):
                    self._sensor(signal, value)
                case CommandDone(ticket):
                    if (awaited := self.tickets.pop(ticket, None)) is not None:
                        awaited.acknowledged = True
                        self._form(awaited)
                case PlantFault(machine, message):
                    self._listener.driver_fault(machine, message)

    def _sensor(self, signal: str, value: bool) -> None:
        self.shown[signal] = value
        if signal in self.sensors:
            self._listener.signal(signal, value, None)
        elif (awaited := self.awaited.get(signal)) is not None:
            self._form(awaited)

    def _form(self, awaited: _Awaited) -> None:
        """Set the completion bit, if its command is acknowledged and its sensor, if it has one, agrees."""
        shown = self.shown.get(awaited.signal, True)
        if awaited.acknowledged and shown and self.awaited.get(awaited.signal) is awaited:
            del self.awaited[awaited.signal]
            self._listener.signal(awaited.signal, value=True, entry=awaited.entry)

    @property
    def _listener(self) -> Listener:
        if self.listener is None:
            raise RuntimeError("the driver does not run yet")
        return self.listener
