"""The driver of the simulated cell: commands become commands of the plant, what the plant sees becomes signals.

Each command goes out under a ticket of its own, which the plant gives back when the command is done, so that a late
acknowledgement is never taken for that of a later command. There is no link here that could be lost; behind the points
and connections of real devices the simulated cell is in `far_side/cell.py`.

With a log, the cell outlives the process, as machines do: all inputs of the past are given to it again, and it is where
it was, forming the completions that it was forming. A stop interrupts the commands that machines are at; whether such a
command is to be given anew only a person can say, so it is unknown.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Iterable, Iterator, Mapping

from firable.executor.cell.cell_log import CellLog
from firable.executor.cell.plant import CommandDone, Plant, PlantFault, PlantReport, SensorChanged
from firable.executor.drivers.completions import Completions
from firable.executor.drivers.driver import Answer, Clock, Listener, Quality, Reading
from firable.nets.net import Net, Place, SignalKind


class _Nobody:
    """Whom a cell tells of its past."""

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """It was told in its time."""

    def taken(self, place: str, entry: int) -> None:
        """It was told in its time."""

    def driver_fault(self, machine: str, message: str) -> None:
        """It was told in its time."""

    def driver_note(self, machine: str, message: str) -> None:
        """It was told in its time."""

    def emergency_stop(self, reason: str) -> None:
        """It was told in its time."""

    def all_told(self) -> None:
        """It was told in its time."""

    def moved(self) -> None:
        """It was told in its time."""


class SimulatedDriver:
    """The driver of a simulated cell, which begins anew or where its log ends."""

    def __init__(self, plant: Plant, net: Net, log: CellLog | None = None) -> None:
        self.plant = plant
        self.net = net
        self.sensors = {signal.name for signal in net.signals if signal.kind is SignalKind.SENSOR}
        self.image = {name: Reading(value, 0.0, Quality.GOOD, "") for name, value in plant.shown.items()}
        self.completions = Completions({name: plant.shown[name] for name in plant.shown if name not in self.sensors})
        self.tickets: dict[int, tuple[Place, int]] = {}
        """The commands that the plant is at, with their entry numbers."""
        self.received: dict[str, int] = {}
        """Of each place, the entry that was received last."""
        self.done: dict[str, int] = {}
        """Of each place, the entry that was acknowledged last."""
        self.interrupted: set[tuple[str, int]] = set()
        """The commands that a stop has ended."""
        self.stopped = False
        self.next_ticket = 0
        self.clock: Clock | None = None
        self.listener: Listener = _Nobody()
        self.awake: asyncio.Event = asyncio.Event()
        self.is_known = log is None
        """Whether whoever listens has been told from the beginning what sensors show."""
        self.log: CellLog | None = None
        for at_seconds, what, arguments in log.past if log is not None else ():
            self._input(at_seconds, what, *arguments)
        self.log = log
        if log is not None and log.past:
            self._start(log.end_seconds)

    @property
    def tells_each_sensor(self) -> bool:
        """Whether some sensors show something before anything happens, so that all are told at the beginning."""
        return bool(self.plant.model.full_at_first)

    @property
    def at_rest(self) -> bool:
        """Whether no event is scheduled in the plant, but that signals are set from outside again."""
        return self.plant.at_rest

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """None: there is no device that could be out of reach."""
        return ()

    @property
    def unreached(self) -> tuple[str, ...]:
        """Nothing, likewise."""
        return ()

    def readings(self) -> Mapping[str, Reading]:
        """What each sensor of the plant showed in the report told last."""
        return self.image

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Let the plant's events happen when they are due."""
        self.clock, self.listener = clock, listener
        loop = asyncio.get_running_loop()
        # Perhaps it is a controller that has restarted, and knows nothing of its sensors.
        for signal in self.image if self.tells_each_sensor or not self.is_known else ():
            if signal in self.sensors:
                listener.signal(signal, bool(self.image[signal].value), None)
        while True:
            due = self.plant.next_seconds
            if due is not None and due <= (now := clock.now_seconds()):
                self._input(now, "advance")
            listener.moved()
            self.awake.clear()
            due = self.plant.next_seconds
            timer = None if due is None else loop.call_later(clock.loop_delay_seconds(due), self.awake.set)
            await self.awake.wait()
            if timer is not None:
                timer.cancel()

    def send(self, place: Place, entry: int) -> None:
        """Give the machine its command, under a new ticket."""
        if place.command is None or self.clock is None:
            raise RuntimeError(f"'{place.name}' sends no command, or the driver does not run yet")
        if self.stopped:
            return
        self._input(self.clock.now_seconds(), "send", place.name, entry)
        self.awake.set()

    def withdraw(self, place: Place) -> None:
        """Nothing: a command is taken when it is sent."""

    async def met(self) -> None:
        """At once: there is no device that could be out of reach."""

    async def ask(self, place: Place, entry: int) -> Answer:
        """What the plant knows of a command: nothing is ever lost on the way to it."""
        if (place.name, entry) in self.interrupted:
            return Answer.UNKNOWN
        if self.received.get(place.name) != entry:
            return Answer.NOT_RECEIVED
        if place.completion is None:
            return Answer.DONE
        is_done = self.done.get(place.name) == entry and place.completion not in self.completions.awaited
        return Answer.DONE if is_done else Answer.WORKING

    def stop(self) -> None:
        """Stop every machine of the plant where it is."""
        self._input(self.clock.now_seconds() if self.clock is not None else 0.0, "stop")

    def latched(self) -> SimulatedDriver:
        """The same cell for a run that goes on after an emergency stop: its machines stand until it is released."""
        self.is_known = False
        return self

    @property
    def undriven(self) -> tuple[str, ...]:
        """None: there is no device that could be out of reach."""
        return ()

    def against(self) -> tuple[str, ...]:
        """Nothing: there is no device that could be out of reach."""
        return ()

    def release(self) -> None:
        """Let machines be commanded again; what the stop has broken off stays so."""
        self._start(self.clock.now_seconds() if self.clock is not None else 0.0)
        self.awake.set()  # a workpiece that was kept out may come now

    def close(self) -> bool:
        """Let no more workpieces come in this life of the run; the next one does not end with the cycle."""
        self._input(self.clock.now_seconds() if self.clock is not None else 0.0, "close")
        return True

    def _start(self, at_seconds: float) -> None:
        self._input(at_seconds, "start")
        if self.plant.is_closed and not self.plant.faulted:
            self._input(at_seconds, "open")

    def _input(self, at_seconds: float, what: str, *arguments: str | int) -> None:
        """Do something to the cell, after it is in the log."""
        if self.log is not None:
            self.log.add(at_seconds, what, *arguments)
        match what, arguments:
            case "send", (str(place), int(entry)):
                self._send(at_seconds, self.net.place(place), entry)
            case "advance", ():
                self._tell(at_seconds, self.plant.advance(at_seconds))
            case "close", ():
                self.plant.close()
            case "open", ():
                self._tell(at_seconds, self.plant.open(at_seconds))
            case "stop", ():
                self.stopped = True
                self.plant.halt()
                self.interrupted |= {(place.name, entry) for place, entry in self.tickets.values()}
                self.tickets.clear()
            case "start", ():
                self.stopped = False
            case _:
                raise ValueError(f"a simulated cell knows no '{what}'")

    def _send(self, at_seconds: float, place: Place, entry: int) -> None:
        command = place.command
        if command is None:
            raise RuntimeError(f"'{place.name}' sends no command")
        ticket = self.next_ticket
        self.next_ticket += 1
        self.received[place.name] = entry
        self.listener.taken(place.name, entry)
        self.interrupted.discard((place.name, entry))
        if place.completion is not None:
            self.tickets[ticket] = (place, entry)
            self.completions.commanded(place.completion, entry)
        sent = self.plant.command(at_seconds, command.machine, command.command, dict(command.parameters), ticket)
        self._tell(at_seconds, sent)

    def _tell(self, at_seconds: float, reports: list[PlantReport]) -> None:
        for report in _completions_last(reports, self.sensors):
            match report:
                case SensorChanged(signal, value):
                    self._sensor(at_seconds, signal, value)
                case CommandDone(ticket):
                    if (sent := self.tickets.pop(ticket, None)) is not None:
                        place, entry = sent
                        self.done[place.name] = entry
                        self._formed(str(place.completion), self.completions.acknowledged(str(place.completion), entry))
                case PlantFault(message):
                    self.listener.driver_fault("", message)  # it names the machine

    def _sensor(self, at_seconds: float, signal: str, value: bool) -> None:
        self.image[signal] = Reading(value, at_seconds, Quality.GOOD, "")
        if signal in self.sensors:
            self.listener.signal(signal, value, None)
        else:
            self._formed(signal, self.completions.shows(signal, value))

    def _formed(self, signal: str, entry: int | None) -> None:
        if entry is not None:
            self.listener.signal(signal, value=True, entry=entry)


def _completions_last(reports: Iterable[PlantReport], sensors: Collection[str]) -> Iterator[PlantReport]:
    """The reports as they are told: of what is seen together, completions are formed behind what sensors show."""
    forming: list[PlantReport] = []
    for report in reports:
        if isinstance(report, SensorChanged) and report.signal not in sensors:
            forming.append(report)
            continue
        if not isinstance(report, SensorChanged):
            yield from forming
            forming.clear()
        yield report
    yield from forming
