"""The simulated cell behind real servers: a plant that is reached only through the points of a binding.

What the executor meets here is what it would meet on the floor: sockets, times, jitter, machines that are watched by
their devices. A device takes a command when its number comes and knows which one by what was written before it, as a
program in it would; it shows the numbers that it has taken and done; it stops its machines when a safe output is
written, and when its heartbeat stays away for `BEATS_MISSED` of its periods; it gives the sign of life that is asked of
it, and counts the edges of its sensors. The cell does not know the net beyond the commands of its places, and learns of
no firing.
"""

from __future__ import annotations

import asyncio
import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from firable.executor.cell.plant import CommandDone, Plant, PlantFault, PlantReport, SensorChanged
from firable.executor.drivers.binding import AliveDocument, Binding, ChannelDocument, DeviceDocument, writes
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import Point, Value, as_bit, as_number
from firable.executor.drivers.far_side.end import Dependent, FarEnd, GoneError
from firable.executor.drivers.keeping import BEATS
from firable.nets.net import Command, Net

BEATS_MISSED: Final = 5

SIGNS: Final = 4
"""How often a sign of life changes in the time within which it must."""

_TURNS_TOLD: Final = 2
"""How often a sensor that is set again and again is told to change."""


@dataclass
class _Channel:
    """One channel of a device: the number that it has, and the commands that it knows."""

    document: ChannelDocument
    commands: list[tuple[dict[Point, int | str], Command]] = field(default_factory=list)
    """What is written for a command, and the command."""
    number: int = 0
    requests: int = 0
    """How often the bit of a channel without numbers has risen."""


@dataclass
class _Device:
    """One device: its end, its channels, and what was written to it last."""

    document: DeviceDocument
    end: FarEnd
    channels: dict[str, _Channel]
    last: dict[Point, int | str] = field(default_factory=dict)
    machines: set[str] = field(default_factory=set)
    watchdog: asyncio.TimerHandle | None = None


class CellServer:
    """A plant behind the ends of a binding's devices; `tell` is told what happens, in words."""

    def __init__(
        self,
        binding: Binding,
        net: Net,
        plant: Plant,
        ends: Mapping[str, FarEnd],
        *,
        speed: float = 1.0,
        tell: Callable[[float, str], None] = lambda _seconds, _what: None,
    ) -> None:
        self.binding = binding
        self.plant = plant
        self.speed = speed
        self.tell = tell
        self.devices = {
            name: _Device(document, ends[name], {key: _Channel(one) for key, one in document.channels.items()})
            for name, document in binding.document.devices.items()
        }
        for place, bound in binding.document.commands.items():
            command = net.place(place).command
            if command is not None:
                device = self.devices[bound.device]
                written = {point: _plain(value) for point, value in writes(bound.write)}
                device.channels[bound.channel].commands.append((written, command))
                device.machines.add(command.machine)
        self.tickets: dict[int, tuple[_Device, _Channel, int]] = {}
        self.at: dict[str, tuple[_Device, _Channel, int]] = {}
        """What each machine is at."""
        self.edges = dict.fromkeys(binding.document.signals, -1)
        """How often each signal has changed, since it was first shown."""
        self.changes = Counter[str]()
        """How often each sensor has changed."""
        self.next_ticket = 0
        self.begun_seconds = 0.0
        self.delivered = self.befallen = 0
        self.fault = ""
        self.awake = asyncio.Event()

    def now_seconds(self) -> float:
        """The time in the cell."""
        return (asyncio.get_running_loop().time() - self.begun_seconds) * self.speed

    async def start(self) -> None:
        """Begin to serve; raises `RuntimeError`, with the names of its devices, where an end cannot be had."""
        # Shown before anybody can connect: a contact that was not shown yet would be read as an emergency stop.
        for device in self.devices.values():
            for channel in device.channels.values():
                self._clear(device, channel)
            if device.document.heartbeat is not None and device.document.heartbeat.tripped is not None:
                device.end.show(device.document.heartbeat.tripped, value=False)
        for signal in self.plant.shown:
            self._sensor(signal)
        self.press(pressed=False)
        for end, devices in self._ends():
            try:
                await end.start(partial(self._written_to, devices))
            except (OSError, RuntimeError) as error:
                raise RuntimeError(f"{self._names(devices)}: {error}") from error
        self.begun_seconds = asyncio.get_running_loop().time()

    def press(self, *, pressed: bool) -> None:
        """Let every button of the emergency stop be pressed, or not any more."""
        for contact in self.binding.document.emergency_stop.values():
            self.devices[contact.device].end.show(contact.read, (not pressed) ^ contact.invert)

    async def stop(self) -> None:
        """End, and close all connections."""
        for device in self.devices.values():
            if device.watchdog is not None:
                device.watchdog.cancel()
        for end, _ in self._ends():
            await end.stop()

    async def run(self) -> None:
        """Let the plant's events happen when they are due, until cancelled; none does once something has collided.

        Raises `GoneError`, with the names of its devices, where an end is without what it needs.
        """
        lasting = [self._gone(end, devices) for end, devices in self._ends() if isinstance(end, Dependent)]
        living = [self._living(one, one.document.alive) for one in self.devices.values() if one.document.alive]
        works = [asyncio.create_task(work) for work in (self._happening(), *lasting, *living)]
        try:
            done, _ = await asyncio.wait(works, return_when=asyncio.FIRST_COMPLETED)
            for work in done:
                work.result()
        finally:
            await ended(works)

    async def _happening(self) -> None:
        while True:
            if not self.fault:
                self._report(self.plant.advance(self.now_seconds()))
            due = None if self.fault else self.plant.next_seconds
            delay = None if due is None else max(0.0, due - self.now_seconds()) / self.speed
            self.awake.clear()
            try:
                await asyncio.wait_for(self.awake.wait(), delay)
            except TimeoutError:
                continue

    async def _living(self, device: _Device, alive: AliveDocument) -> None:
        """Change the sign of life of a device, in the time of whoever watches it."""
        for count in itertools.count():
            self._show(device, alive.read, count % BEATS)
            await asyncio.sleep(alive.within_s / SIGNS)

    async def _gone(self, end: Dependent, devices: list[_Device]) -> None:
        try:
            await end.gone()
        except GoneError as error:
            raise GoneError(f"{self._names(devices)}: {error}") from None

    def _names(self, devices: list[_Device]) -> str:
        return ", ".join(name for name, device in self.devices.items() if device in devices)

    def _ends(self) -> Iterator[tuple[FarEnd, list[_Device]]]:
        """Each end, with the devices that are reached by it."""
        ends = {id(device.end): device.end for device in self.devices.values()}
        for end in ends.values():
            yield end, [device for device in self.devices.values() if device.end is end]

    def _written_to(self, devices: list[_Device], point: Point, value: Value) -> None:
        """A client has written something at an end."""
        for device in devices:
            self._written(device, point, value)

    def _written(self, device: _Device, point: Point, value: Value) -> None:
        """It is of a device, if it has such a point."""
        document = device.document
        device.last[point] = _plain(value)
        if document.heartbeat is not None and point == document.heartbeat.write:
            self._beaten(device, document.heartbeat.every_s)
        if point in document.safe and device.last[point] == _plain(dict(writes(document.safe))[point]):
            self._stop(device, "a safe output")
            if document.heartbeat is not None and document.heartbeat.tripped is not None:
                device.end.show(document.heartbeat.tripped, value=False)
        for channel in device.channels.values():
            if point == channel.document.number:
                self._ordered(device, channel, as_number(value), "")
            elif point == channel.document.request:
                self._requested(device, channel, asked=bool(device.last[point]))
            elif point == channel.document.command:
                number, _, text = str(value).partition(" ")
                self._ordered(device, channel, as_number(number), text)

    def _requested(self, device: _Device, channel: _Channel, *, asked: bool) -> None:
        if asked and not channel.number:
            channel.requests += 1
            self._ordered(device, channel, channel.requests, "")
        elif not asked:
            self._ordered(device, channel, 0, "")

    def _ordered(self, device: _Device, channel: _Channel, number: int | None, text: str) -> None:
        if number is None or number == channel.number:
            return
        channel.number = number
        if number == 0:
            self._clear(device, channel)
            return
        self._say(device, channel, channel.document.taken, number)
        known = [
            command
            for written, command in channel.commands
            if (str(command) == text if text else all(device.last.get(point) == one for point, one in written.items()))
        ]
        if not known:
            self.tell(self.now_seconds(), f"a command that nobody knows: {text or device.last}")
            self._say(device, channel, channel.document.failed, number)
            return
        command = known[0]
        self.tell(self.now_seconds(), f"{command}")
        ticket, self.next_ticket = self.next_ticket, self.next_ticket + 1
        self.tickets[ticket] = self.at[command.machine] = (device, channel, number)
        parameters = dict(command.parameters)
        self._report(self.plant.command(self.now_seconds(), command.machine, command.command, parameters, ticket))
        self.awake.set()

    def _report(self, reports: list[PlantReport]) -> None:
        for report in reports:
            match report:
                case SensorChanged(signal, value):
                    self._tell_shown(signal, value=value)
                    self._sensor(signal)
                case CommandDone(ticket):
                    if (waiting := self.tickets.pop(ticket, None)) is not None:
                        device, channel, number = waiting
                        self.at = {machine: one for machine, one in self.at.items() if one is not waiting}
                        self._say(device, channel, channel.document.done, number)
                case PlantFault(message):
                    self.fault = message
                    self.tell(self.now_seconds(), self.fault)
                    for device in self.devices.values():
                        self._stop(device, "what has happened")
                    self.awake.set()
        for _, what in self.plant.befallen[self.befallen :]:
            self.tell(self.now_seconds(), f"as asked for: {what}")
        self.befallen = len(self.plant.befallen)
        if len(self.plant.delivered) > self.delivered:
            self.delivered = len(self.plant.delivered)
            self.tell(self.now_seconds(), f"workpiece {self.plant.delivered[-1].id} is carried out")

    def _tell_shown(self, signal: str, *, value: bool) -> None:
        """Tell what a sensor shows; one that is set again and again hides all else, and is told of once for all."""
        sensor = self.plant.model.sensors[signal]
        self.changes[signal] += 1
        if sensor.for_s is None or self.changes[signal] <= _TURNS_TOLD:
            self.tell(self.now_seconds(), f"{signal} shows {int(value)}")
        elif self.changes[signal] == _TURNS_TOLD + 1:
            turns = f"1 for {sensor.for_s:g} s and 0 for {sensor.after_s:g} s"
            self.tell(self.now_seconds(), f"{signal} goes on so, {turns}, and is told no more")

    def _sensor(self, signal: str) -> None:
        bound = self.binding.document.signals.get(signal)
        if bound is not None:
            device = self.devices[bound.device]
            device.end.show(bound.read, self.plant.shown[signal] ^ bound.invert)
            self.edges[signal] += 1
            self._show(device, bound.edges, self.edges[signal] % BEATS)

    def _beaten(self, device: _Device, every_s: float) -> None:
        if device.watchdog is not None:
            device.watchdog.cancel()
        loop = asyncio.get_running_loop()
        device.watchdog = loop.call_later(max(BEATS_MISSED * every_s, 0.5), self._trip, device)

    def _trip(self, device: _Device) -> None:
        self._stop(device, "its watchdog")
        if device.document.heartbeat is not None and device.document.heartbeat.tripped is not None:
            device.end.show(device.document.heartbeat.tripped, value=True)

    def _stop(self, device: _Device, why: str) -> None:
        """Stop the machines of a device where they are; what they were at has failed."""
        for machine in sorted(device.machines & set(self.at)):
            of, channel, number = self.at.pop(machine)
            self.plant.stand(machine)
            self.tell(self.now_seconds(), f"{machine} is stopped by {why}")
            self._say(of, channel, channel.document.failed, number)

    def _clear(self, device: _Device, channel: _Channel) -> None:
        for point in (channel.document.taken, channel.document.done, channel.document.failed):
            self._show(device, point, 0 if channel.document.request is None else False)

    def _say(self, device: _Device, channel: _Channel, point: Point | None, number: int) -> None:
        """Say something of a command: by its number, or by a bit as long as it is asked for."""
        if channel.document.request is None:
            self._show(device, point, number)
        elif number == channel.number:
            self._show(device, point, value=True)

    def _show(self, device: _Device, point: Point | None, value: Value) -> None:
        if point is not None:
            device.end.show(point, value)


def _plain(value: Value) -> int | str:
    """A value as it can be compared, whatever the protocol has made of it."""
    bit = as_bit(value)
    if bit is not None:
        return int(bit)
    number = as_number(value)
    return str(value) if number is None else number
