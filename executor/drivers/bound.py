"""The driver of a binding: any number of devices of any kinds, as one driver of the net.

What is common to all kinds of devices meets here: the process image of each (`image.py`), the channels of its machines
(`channels.py`), the completions of the net (`completions.py`), the connection that is kept (`keeping.py`). Each of them
is a machine of its own and can be tested alone; this file only carries what one says to the others.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection, Mapping, Sequence

from firable.executor.drivers.binding import Binding, CommandDocument
from firable.executor.drivers.bound_device import LOOK_SECONDS, BoundDevice, ByHand
from firable.executor.drivers.cancelling import ended, uninterrupted
from firable.executor.drivers.completions import Completions
from firable.executor.drivers.driver import Answer, Cautious, Clock, Listener, Reading
from firable.executor.drivers.fitting import misfits
from firable.executor.drivers.sharing import masters, shared
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, Place, SignalKind


def bound_driver(binding: Binding, net: Net, part: Net | None = None, *, latched: bool = False) -> BoundDriver:
    """The driver of a net's binding, or of a part of the net, whose machines are all that this host has.

    A `latched` one follows an emergency stop (`driver.Latched`).
    Raises `InputError` F5101 where binding and net do not fit, F5105 where this host would have a device together with
    another one, and F1001 or F1003 where a file that a device needs, a certificate or a key, cannot be read. One
    binding serves all hosts of a cell: each takes from it the devices of its own machines.
    """
    if problems := misfits(binding, net):
        raise InputError(problems)
    served = net if part is None else part
    completions = {signal.name for signal in served.signals if signal.kind is SignalKind.COMPLETION}
    answered = frozenset(place.name for place in net.places if place.completion is not None)
    names = {*served.signal_index, *served.place_index}
    if part is not None:
        here = [controller.name for controller in part.controllers]
        if together := tuple(shared(binding, net, here)):
            raise InputError(together)
        driven = [device for device, of in masters(binding, net).items() if of.issubset(here)]
        binding = binding.serving(names, here, driven)
    if unreadable := tuple(binding.unreadable()):
        raise InputError(unreadable)
    return BoundDriver(binding, completions, answered, latched=latched)


class BoundDriver:
    """The driver of a binding. `completions` are the signals that it forms, `answered` the places that wait for one.

    Raises `ModuleNotFoundError` where the library of a device is not installed.
    """

    def __init__(
        self, binding: Binding, completions: Collection[str], answered: frozenset[str], *, latched: bool = False
    ) -> None:
        self.binding = binding
        document = binding.document
        sensed = [name for name, signal in document.signals.items() if name in completions and signal is not None]
        self.completions = Completions(dict.fromkeys(sensed, False))
        self.answered = answered
        self.completing: dict[str, str] = {}
        """The completion of each place that has been commanded or asked about."""
        for name in document.devices:  # before an event loop runs, which it would hold up for seconds
            binding.kinds[name].load()
        self.devices = {name: BoundDevice(self, name) for name in document.devices}
        self.contacts = [device.contacts for device in self.devices.values()]
        self.clock: Clock | None = None
        self.listener: Listener | None = None
        self.has_begun = False
        """Whether it may have done something to its devices."""
        self.is_stopped = False
        self.is_latched = latched
        """Whether there was an emergency stop, and nobody has reset it."""

    @property
    def may_move(self) -> bool:
        """Whether every contact of the emergency stop is closed, and none latched; before no machine is commanded."""
        return not self.is_latched and all(contacts.are_closed for contacts in self.contacts)

    def against(self) -> tuple[str, ...]:
        """What keeps it latched: contacts that are open, devices that do not answer, signals whose loss is a fault."""
        return tuple(why for device in self.devices.values() for why in device.against())

    def release(self) -> None:
        """Take an open contact for an emergency stop again, and a lost device for what it is."""
        self.is_latched = False
        for device in self.devices.values():
            device.kept.awake.set()

    @property
    def at_rest(self) -> bool:
        """Never: what machines and workpieces do next is not to be known."""
        return False

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """The devices that have safe outputs and have not confirmed them since the stop; none of those left alone."""
        return tuple(name for name, one in self.devices.items() if self.has_begun and not one.kept.is_safe)

    @property
    def undriven(self) -> tuple[str, ...]:
        """The devices that have safe outputs and have not confirmed those with which their connections begin."""
        return tuple(name for name, one in self.devices.items() if one.document.safe and not one.kept.started)

    @property
    def unreached(self) -> tuple[str, ...]:
        """In a phrase each, the devices that are not connected, have never shown a signal, or not taken a command."""
        of_each = ((one.unreached,) if one.unreached else (one.unshown, one.untaken) for one in self.devices.values())
        return tuple(phrase for phrases in of_each for phrase in phrases if phrase)

    @property
    def tells_each_sensor(self) -> bool:
        """Always: each when it was read first, or when its loss policy has given it a value."""
        return True

    def readings(self) -> Mapping[str, Reading]:
        """The process image."""
        return {name: reading for device in self.devices.values() for name, reading in device.image.readings.items()}

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Serve the devices until cancelled; on the way out the safe outputs are driven."""
        self.clock, self.listener = clock, listener
        if isinstance(listener, Cautious):
            await listener.let_drive()
        self.has_begun = True
        tasks = [asyncio.create_task(device.run(), name=name) for name, device in self.devices.items()]
        try:
            if not tasks:  # a host without machines, which may be given the binding of its cell all the same
                await asyncio.get_running_loop().create_future()
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_EXCEPTION)
            for task in done:
                task.result()
        finally:
            try:
                self.stop()
            finally:  # whatever became of the notes
                await uninterrupted(self._stopped(tasks))

    async def _stopped(self, tasks: Sequence[asyncio.Task[None]]) -> None:
        """Wait until each device is safe or has had its time, and tell of those that are not; raises a mistake."""
        stopping = [asyncio.create_task(device.kept.stopped.wait()) for device in self.devices.values()]
        longest = max((device.document.timeout_s for device in self.devices.values()), default=0.0)
        if stopping:
            await asyncio.wait(stopping, timeout=3 * longest)
        await ended([*tasks, *stopping])
        for name in self.unconfirmed:
            self.devices[name].note("has not confirmed its safe outputs: they are left to its watchdog")
        for device in self.devices.values():
            if device.kept.error is not None:
                raise device.kept.error

    def send(self, place: Place, entry: int) -> None:
        """Send the command of a place, or keep it until its device is connected."""
        if place.command is None:
            raise RuntimeError(f"'{place.name}' sends no command")
        if self.is_stopped:
            return
        if place.completion is not None:
            self.completing[place.name] = place.completion
            self.completions.commanded(place.completion, entry)
        command = self._command(place.name)
        self.devices[command.device].send(command, place, entry)

    def withdraw(self, place: Place) -> None:
        """Give up the command of a place, as far as its device has not been written it."""
        if (command := self.binding.document.commands.get(place.name)) is not None:
            self.devices[command.device].channels[command.channel].withdraw(place.name)

    async def met(self) -> None:
        """Wait until each device was reached, or as long as its start may take."""
        await asyncio.gather(*(device.met() for device in self.devices.values()))

    async def ask(self, place: Place, entry: int) -> Answer:
        """What became of a command that was sent before a restart; waits for its device as long as a start may take."""
        command = self._command(place.name)
        device = self.devices[command.device]
        if place.completion is not None:
            self.completing[place.name] = place.completion
            self.completions.commanded(place.completion, entry)
        channel = device.channels[command.channel]
        if not await device.met():
            channel.expect(place.name, entry)
            return Answer.UNKNOWN
        stopped = bool(device.document.safe)
        if stopped:
            await device.settled(channel, place.name, entry)
        answer = channel.answer(place.name, entry, stopped=stopped)
        while answer is Answer.NOT_RECEIVED and device.may_be_late:  # sent by who was here before
            await asyncio.sleep(LOOK_SECONDS)
            answer = channel.answer(place.name, entry, stopped=stopped)
        if answer is Answer.NOT_RECEIVED and device.unreached:
            channel.expect(place.name, entry)
            return Answer.UNKNOWN
        if answer is not Answer.DONE or place.completion is None:
            return answer
        # Done, and seen to be done: the sensor, where there is one, has its say.
        if self.completions.acknowledged(place.completion, entry) is None:
            return Answer.UNKNOWN if stopped else Answer.WORKING
        return answer

    def send_by_hand(self, place: Place) -> ByHand:
        """Send the command of a place to its device, as it is connected now, and never on a later connection."""
        command = self._command(place.name)
        return self.devices[command.device].send_by_hand(command, place)

    def force(self, signal: str, value: bool) -> ByHand:
        """Write a signal on its device, once; raises `ValueError` where the binding does not allow it."""
        bound = self.binding.document.signals.get(signal)
        if bound is None or not bound.force:
            raise ValueError(f"the binding does not allow '{signal}' to be forced")
        return self.devices[bound.device].force(bound.read, value ^ bound.invert)

    def stop(self) -> None:
        """Drive the safe outputs of every device that can be reached; the others have their watchdogs."""
        if not self.is_stopped:
            self.is_stopped = True
            left = [device for device in self.devices.values() if self.has_begun and device.is_out_of_reach]
            for device in self.devices.values():
                device.kept.stop()
            for device in left:  # only now: who is told may fail, or take its time
                device.note("not connected: the stop is left to its watchdog until it is reached again")

    def emergency_stop(self, reason: str) -> None:
        """Drive the safe outputs now, and only then tell of it."""
        if not self.is_stopped:
            self.stop()
            if self.listener is not None:
                self.listener.emergency_stop(reason)

    def close(self) -> bool:
        """Nothing: what comes into a real cell is not for its driver to say."""
        return False

    def formed(self, completion: str, entry: int | None) -> None:
        """Tell of a completion that has been formed, if any has."""
        if entry is not None and self.listener is not None:
            self.listener.signal(completion, value=True, entry=entry)

    def _command(self, place: str) -> CommandDocument:
        return self.binding.document.commands[place]
