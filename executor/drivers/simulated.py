"""The driver of the simulated cell: commands become commands of the plant, what the plant sees becomes signals.

Each command goes out under a ticket of its own, which the plant gives back when the command is done, so that a late
acknowledgement is never taken for that of a later command. There is no link here that could be lost; a driver of points
and connections that reaches a simulated cell through them is `in_process.py`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from firable.executor.cell.plant import CommandDone, Plant, PlantFault, PlantReport, SensorChanged
from firable.executor.drivers.completions import Completions
from firable.executor.drivers.driver import Answer, Clock, Listener, Quality, Reading
from firable.nets.net import Net, Place, SignalKind


class SimulatedDriver:
    """The driver of a simulated cell."""

    def __init__(self, plant: Plant, net: Net) -> None:
        self.plant = plant
        self.sensors = {signal.name for signal in net.signals if signal.kind is SignalKind.SENSOR}
        self.image = {name: Reading(value, 0.0, Quality.GOOD, "") for name, value in plant.shown.items()}
        self.completions = Completions({name: plant.shown[name] for name in plant.shown if name not in self.sensors})
        self.tickets: dict[int, tuple[Place, int]] = {}
        """The commands that the plant is at, with their entry numbers."""
        self.done: dict[str, int] = {}
        """Of each place, the entry that was acknowledged last."""
        self.next_ticket = 0
        self.clock: Clock | None = None
        self.listener: Listener | None = None
        self.awake: asyncio.Event = asyncio.Event()

    @property
    def at_rest(self) -> bool:
        """Whether no event is scheduled in the plant."""
        return self.plant.next_seconds is None

    def readings(self) -> Mapping[str, Reading]:
        """What each sensor of the plant showed in the report told last."""
        return self.image

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
            self.tickets[ticket] = (place, entry)
            self.completions.commanded(place.completion, entry)
        now = self.clock.now_seconds()
        self._tell(self.plant.command(now, command.machine, command.command, dict(command.parameters), ticket))
        self.awake.set()

    async def ask(self, place: Place, entry: int) -> Answer:
        """What the plant knows of a command: nothing is ever lost on the way to it."""
        if place.completion is None:
            return Answer.UNKNOWN
        if self.done.get(place.name) == entry:
            return Answer.WORKING if place.completion in self.completions.awaited else Answer.DONE
        return Answer.WORKING if (place, entry) in self.tickets.values() else Answer.NOT_RECEIVED

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
                    if (sent := self.tickets.pop(ticket, None)) is not None:
                        place, entry = sent
                        self.done[place.name] = entry
                        self._formed(str(place.completion), self.completions.acknowledged(str(place.completion), entry))
                case PlantFault(machine, message):
                    self._listener.driver_fault(machine, message)

    def _sensor(self, signal: str, value: bool) -> None:
        at_seconds = self.clock.now_seconds() if self.clock is not None else 0.0
        self.image[signal] = Reading(value, at_seconds, Quality.GOOD, "")
        if signal in self.sensors:
            self._listener.signal(signal, value, None)
        else:
            self._formed(signal, self.completions.shows(signal, value))

    def _formed(self, signal: str, entry: int | None) -> None:
        if entry is not None:
            self._listener.signal(signal, value=True, entry=entry)

    @property
    def _listener(self) -> Listener:
        if self.listener is None:
            raise RuntimeError("the driver does not run yet")
        return self.listener
