"""One device of a bound driver: what its connection is for, and what follows from what it shows.

Values come from the connection (`keeping.py`) in batches. The contacts of the emergency stop are looked at before
anything else; then the process image of the device, the channels of its machines and its watchdog each take what is
theirs, and what that means is told to the listener of the driver.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.binding import CommandDocument, SignalDocument, writes
from firable.executor.drivers.channels import Channel, Order, Outcome, Said
from firable.executor.drivers.device import Point, Value, Wanted, Writes, as_bit, quoted
from firable.executor.drivers.driver import Quality, Reading
from firable.executor.drivers.emergency import Contacts
from firable.executor.drivers.handshake import Handshake
from firable.executor.drivers.image import Change, Image
from firable.executor.drivers.keeping import Kept
from firable.nets.net import Place

if TYPE_CHECKING:
    from firable.executor.drivers.bound import BoundDriver

LOOK_SECONDS: Final = 0.01
"""How often it is looked whether a device shows something of a command."""

ANSWERS: Final = 3
"""So many times as long as an answer may take is waited until it is told that a device has not taken a command."""

_INSTANT_SECONDS: Final = 1e-6
"""So much too early a timer may come."""

_POINTS: Final = "are the points written as the device has them?"
"""What is asked where a device is silent: a topic that is written wrong is no error to a broker."""


@dataclass(slots=True)
class ByHand:
    """What a person has forced or sent, once: no machine may move by it when its line is plugged in anew."""

    is_done: bool = False
    """Whether the device has confirmed the value, or shown that it has the command."""
    refused: str = ""
    """Why it will not be: what ended the connection before that, or that there is none."""


class BoundDevice:
    """One device of a driver: what its connection is for (`keeping.Served`)."""

    def __init__(self, driver: BoundDriver, name: str) -> None:
        binding = driver.binding
        self.driver = driver
        self.name = name
        self.document = binding.document.devices[name]
        bound = {signal: one for signal, one in binding.document.signals.items() if one is not None}
        signals: dict[str, SignalDocument] = {signal: one for signal, one in bound.items() if one.device == name}
        contacts = {key: one for key, one in binding.document.emergency_stop.items() if one.device == name}
        self.contacts = Contacts(contacts)
        self.image = Image({**signals, **self.contacts.signals()})
        self.told = signals.keys()
        """What the image holds for the net; the rest is for the emergency stop."""
        self.sensed = [signal for signal in signals if signal in driver.completions.shown]
        """Signals from which completions are formed; the others are told as they are."""
        commands = {place: one for place, one in binding.document.commands.items() if one.device == name}
        self.writes = {place: writes(one.write) for place, one in commands.items()}
        """What the command of each place writes."""
        self.channels: dict[str, Channel | Handshake] = {}
        for channel_name, body in self.document.channels.items():
            places = [place for place, one in commands.items() if one.channel == channel_name]
            self.channels[channel_name] = (
                Channel(body, places, driver.answered) if body.request is None else Handshake(body, driver.answered)
            )
        self.replies: dict[Point, list[tuple[Channel | Handshake, str]]] = {}
        for channel in self.channels.values():
            for point, key in channel.document.shows.items():
                self.replies.setdefault(point, []).append((channel, key))
        heartbeat, alive = self.document.heartbeat, self.document.alive
        self.tripped = None if heartbeat is None else heartbeat.tripped
        self.has_tripped: bool | None = None
        self.forced: deque[tuple[Writes, ByHand]] = deque()
        """What is to be written beside all else, on the connection that stands or on the first that does."""
        self.sent: list[tuple[str, ByHand]] = []
        """The places whose commands a person has sent, as long as it has not shown that it has them."""
        self.writing: Channel | Handshake | None = None
        self.is_ready = asyncio.Event()
        self.was_ready = False
        self.has_begun = False
        """Whether it was ready once, or the time is over that its start may take."""
        self.ready_seconds = 0.0
        """When there was a connection first, by the event loop."""
        self.start: asyncio.TimerHandle | None = None
        """When it should have been reached first."""
        self.grace: asyncio.TimerHandle | None = None
        """When the first of what is missed is lost."""
        self.missed: dict[str, float] = {}
        """The signals that were shown once and not since a loss, with when they are lost, by the event loop."""
        self.missed_why = ""
        self.due: asyncio.TimerHandle | None = None
        """When all signals should have been shown."""
        self.is_overdue = False
        """Whether they should have been by now."""
        self.patience: dict[Channel | Handshake, asyncio.TimerHandle] = {}
        """When the device should show that it has taken what was written to a channel last."""
        self.late: dict[Channel | Handshake, Order] = {}
        """What it has not shown to have taken by then, of each channel the newest."""
        self.unseen = set(self.image.signals)
        """The signals that this connection has not shown."""
        self.noted = ""
        self.garbage: dict[Point, str] = {}
        """What was told of the points of channels that said nothing of a command."""
        points = {*self.image.reads, *self.image.counters, *self.replies}
        points |= {point for point in (self.tripped, None if alive is None else alive.read) if point is not None}
        wanted = Wanted(
            tuple(sorted(points)),
            self.document.timeout_s,
            urgent=frozenset(one.read for one in contacts.values()),
            forced=frozenset(one.read for one in signals.values() if one.force) - set(self._commanding()),
            asks=frozenset(channel.asks for channel in self.document.channels.values()),
        )
        self.kept = Kept(self.document, binding.kinds[name], binding.options[name], wanted, self)

    def _commanding(self) -> Iterator[Point]:
        """The points that are written to command the device, or to stop it."""
        yield from self.document.safe
        yield from (point for some in self.writes.values() for point, _ in some)
        for channel in self.document.channels.values():
            yield channel.asks
        if self.document.heartbeat is not None:
            yield self.document.heartbeat.write

    async def run(self) -> None:
        """Keep the device connected."""
        alive = self.document.alive
        seen = "reached" if alive is None else f"seen to be alive, by '{alive.read}',"
        loop = asyncio.get_running_loop()
        self.start = loop.call_later(self.document.start_s, self._not_met, f"not {seen} since the start")
        begun = loop.call_later(self.document.start_s, self._must_move) if self.contacts.contacts else None
        try:
            await self.kept.run()
        finally:
            for alarm in (self.start, self.grace, self.due, begun, *self.patience.values()):
                if alarm is not None:
                    alarm.cancel()
            self._give_up_by_hand(self._unforced)

    async def met(self) -> bool:
        """Wait until there is a connection to it, as long as its start may take; whether there is one."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self.is_ready.wait(), self.document.start_s)
        return self.is_ready.is_set()

    def send(self, command: CommandDocument, place: Place, entry: int) -> None:
        """Send a command by its channel."""
        self.channels[command.channel].send(place.name, entry, str(place.command), self.writes[place.name])
        self.kept.urge()

    async def settled(self, channel: Channel | Handshake, place: str, entry: int) -> None:
        """Wait until the device shows what the safe outputs of the start have ended, or its time is over."""
        if channel.document.failed is None:
            return
        with suppress(TimeoutError):
            async with asyncio.timeout(self.document.timeout_s):
                while channel.is_at(place, entry):
                    await asyncio.sleep(LOOK_SECONDS)

    @property
    def may_be_late(self) -> bool:
        """Whether something may still come to it that was sent before its first connection here."""
        return asyncio.get_running_loop().time() < self.ready_seconds + self.document.timeout_s

    def force(self, point: Point, value: bool) -> ByHand:
        """Write a point beside all else; what is returned says what becomes of it."""
        if self.driver.is_stopped:
            return ByHand(refused=self._unforced)
        forcing = ByHand()
        self.forced.append((((point, value),), forcing))
        self.kept.awake.set()
        return forcing

    def send_by_hand(self, command: CommandDocument, place: Place) -> ByHand:
        """Send a command on the connection that stands; what is returned says what becomes of it."""
        if self.driver.is_stopped or self.unreached:
            return ByHand(refused=self._unforced)
        self.sent.append((place.name, sending := ByHand()))
        self.send(command, place, 0)
        return sending

    @property
    def _unforced(self) -> str:
        """Why nothing is forced or sent by hand any more."""
        return self.unreached or f"{self.name} was stopped before"

    def _give_up_by_hand(self, why: str) -> None:
        """Give up what a person has forced and sent: the device may be something else when it is connected again."""
        for channel in self.channels.values():
            for place, _ in self.sent:
                channel.withdraw(place)
        for one in (*(one for _, one in self.forced), *(one for _, one in self.sent)):
            one.refused = why
        self.forced.clear()
        self.sent.clear()

    @property
    def is_out_of_reach(self) -> bool:
        """Whether a stop cannot be written to it now, though it has something that stops it."""
        return not self.kept.is_connected and bool(self.document.safe or self.document.heartbeat is not None)

    @property
    def is_writing(self) -> bool:
        """Whether something that was to be written has not been confirmed."""
        return bool(self.forced) or any(channel.is_writing for channel in self.channels.values())

    @property
    def is_latched(self) -> bool:
        """Whether every connection begins with the safe outputs."""
        return self.driver.is_latched

    @property
    def unreached(self) -> str:
        """That there is no connection to it now, and why, as far as that is known; empty where there is one."""
        return "" if self.is_ready.is_set() else ": ".join(filter(None, (self._away, self.noted)))

    @property
    def _away(self) -> str:
        """What is to be said of it as long as it is not ready."""
        is_silent = self.kept.is_connected and self.document.alive is not None
        return f"{self.name} {'has not been seen to be alive' if is_silent else 'is not connected'}"

    @property
    def unshown(self) -> str:
        """What it should have shown by now and never has, with the points; empty where there is nothing."""
        unread = [name for name, reading in self.image.readings.items() if not reading.at_seconds]
        silent = [f"'{name}' (at {self.image.signals[name].read})" for name in sorted(unread)]
        for name, channel in self.channels.items():
            unsaid = {key: point for point, key in channel.document.shows.items() if key not in channel.shown}
            silent += [f"what '{name}' has {key} (at {point})" for key, point in unsaid.items()]
        return f"{self.name} has never shown {', '.join(silent)}" if self.is_overdue and silent else ""

    @property
    def untaken(self) -> str:
        """What it should have taken by now and has not, with the points; empty where there is nothing."""
        late = [_given(one, order) for one, order in self.late.items() if one.unanswered is order]
        return f"{self.name} has not taken {', '.join(late)}" if late else ""

    def against(self) -> Iterator[str]:
        """What keeps its driver latched, in a phrase each."""
        if not self.is_ready.is_set():
            yield self._away
            return
        for name in sorted(self.contacts.open_ones):
            yield f"{self.name}: '{name}' is not closed"
        for name, signal in self.image.signals.items():
            reading = self.image.readings[name]
            if signal.on_loss == "fault" and reading.quality is not Quality.GOOD and reading.why != Reading().why:
                yield f"{self.name}: '{name}' cannot be read: {reading.why}"

    # What the connection tells

    def read(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Values have come."""
        opened = self._opened(batch)  # before anything else
        now = self.driver.clock.now_seconds() if self.driver.clock is not None else 0.0
        changes, faults = self.image.take(batch, now)
        if self.unseen:
            for name in {name for point, _ in batch for name in self.image.reads.get(point, ())}:
                self.unseen.discard(name)
                self.missed.pop(name, None)
        if not opened and self.is_ready.is_set():
            self._close_contacts()
        self._tell(changes, faults)
        for point, value in batch:
            for channel, key in self.replies.get(point, ()):
                self._replied(channel, key, point, value)
            if point == self.tripped:
                self._watchdog(value)
        for channel in self.channels.values():
            self._told_if_forgotten(channel.forgotten())
        if self.driver.listener is not None:
            self.driver.listener.all_told()

    def unproven(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Values have come from where the device has not been seen to be alive: an open contact stops all the same."""
        self._opened(batch)

    def _opened(self, batch: Sequence[tuple[Point, Value]]) -> str:
        """Stop where a contact of the emergency stop is open; what opens it, in a sentence."""
        opened = self.contacts.opened(batch) if self.contacts.contacts else ""
        if opened:
            self._emergency(opened)
        return opened

    def ready(self) -> None:
        """A new connection has told what the device shows."""
        if self.start is not None:
            self.start.cancel()
        self.note("connected again" if self.was_ready else "connected")
        self.noted = ""
        for channel in self.channels.values():
            self._told_if_forgotten(channel.connected_again())
            self._await_taking(channel)
        if not self.was_ready:
            loop = asyncio.get_running_loop()
            self.ready_seconds = loop.time()
            self.due = loop.call_later(self.document.start_s, self._should_have_shown)
            self.missed = dict.fromkeys(self._good(self.unseen), loop.time() + self.document.grace_s) | self.missed
        self.was_ready = self.has_begun = True
        self.is_ready.set()
        self._close_contacts()
        self._miss()

    def _close_contacts(self) -> None:
        """Take for closed what is shown so by a device that is ready: the loss of another one is no emergency."""
        if not self.contacts.are_closed:
            self.contacts.read(self.image.readings)
            if self.driver.may_move:  # what was sent before that has waited for it
                for device in self.driver.devices.values():
                    device.kept.awake.set()

    def _good(self, signals: Collection[str]) -> list[str]:
        return [name for name in sorted(signals) if self.image.readings[name].quality is Quality.GOOD]

    def _should_have_shown(self) -> None:
        """Tell what was never shown: where a device tells unasked, a point that is written wrong is not noticed.

        A loss policy that gives a value holds from now on; the gates of the others stay closed until they are shown.
        """
        self.is_overdue = True
        silent = [name for name, reading in self.image.readings.items() if reading.value is None]
        given = [name for name in silent if self.image.signals[name].on_loss in {"0", "1"}]
        self._tell(*self.image.lost("never shown", given))
        if self.unshown:
            self.note(f"{self.unshown.removeprefix(self.name + ' ')}: {_POINTS}")

    def _should_have_taken(self, channel: Channel | Handshake) -> None:
        """Tell what the device does not show to have taken: else nobody knows before the command is overdue."""
        order = channel.unanswered
        if order is None or order is self.late.get(channel) or self.unreached or self.driver.is_stopped:
            return
        self.late[channel] = order
        self.note(f"has not taken {_given(channel, order)}: {_POINTS}")

    def lost(self, why: str) -> None:
        """There is no connection, or none any more: also of what was only read by then, nobody knows what it is now."""
        gone = set(self.image.signals) if self.is_ready.is_set() else self.image.signals.keys() - self.unseen
        self.unseen.update(self.image.signals)
        contacts = gone.intersection(self.contacts.signals())
        if self.is_ready.is_set():
            self.is_ready.clear()
            self._give_up_by_hand(why)
            if contacts:
                self._emergency(self.contacts.lost(why))
        self.image.lost(why, contacts)  # of them there is no grace
        if gone:
            self.missed_why = why
        if gone and self.has_begun:
            lost_seconds = asyncio.get_running_loop().time() + self.document.grace_s
            self.missed = dict.fromkeys(sorted(gone), lost_seconds) | self.missed  # the grace runs from the first loss
            self._miss()
        if why != self.noted and not self.driver.is_stopped:
            self.noted = why
            self.note(f"not connected: {why}")

    def left(self, why: str) -> None:
        """Its driver has ended: nothing is read any more, and what it has shown is past, whatever the grace."""
        self.is_ready.clear()
        self.image.lost(why)

    def left_to_another(self) -> None:
        """Another program has its line, and its safe outputs are for that one to write: a stop does not try to."""
        self.kept.is_safe = True

    def broken(self, error: Exception) -> None:
        """Its driver has made a mistake: all devices are stopped, and the run ends."""
        try:
            self._fault(f"its driver has failed, {type(error).__name__}: {error}")
        finally:
            self.driver.stop()

    def next_writes(self) -> Writes | None:
        """What is to be written now."""
        self.writing = None
        if self.forced:
            return self.forced[0][0]  # until it is confirmed
        if not self.driver.may_move:
            return None
        for channel in self.channels.values():
            if (some := channel.next_writes()) is not None:
                self.writing = channel
                return some
        return None

    def written(self) -> None:
        """The device has confirmed that."""
        if (channel := self.writing) is None:
            self.forced.popleft()[1].is_done = True
        else:
            for outcome in channel.written():
                self._said(outcome)
            self._await_taking(channel)

    def _await_taking(self, channel: Channel | Handshake) -> None:
        """Wait from now on until the device shows that it has what was written."""
        if (earlier := self.patience.pop(channel, None)) is not None:
            earlier.cancel()
        if channel.unanswered is not None:
            after_s = ANSWERS * self.document.timeout_s
            self.patience[channel] = asyncio.get_running_loop().call_later(after_s, self._should_have_taken, channel)

    # What follows from it

    def note(self, message: str) -> None:
        """Tell the listener something of the device."""
        if self.driver.listener is not None:
            self.driver.listener.driver_note(self.name, message)

    def _fault(self, message: str) -> None:
        if self.driver.is_latched:
            self.note(message)  # its machines are stopped, and stay so: whoever resets looks at them first
        elif self.driver.listener is not None and not self.driver.is_stopped:
            self.driver.listener.driver_fault(self.name, message)

    def _emergency(self, reason: str) -> None:
        if self.driver.is_latched:
            return  # there was one
        self.driver.emergency_stop(f"{self.name}: {reason}")

    def _must_move(self) -> None:
        if not self.contacts.are_closed:
            open_ones = " and ".join(f"'{name}'" for name in sorted(self.contacts.open_ones))
            self._emergency(f"{open_ones} was not read within {self.document.start_s:g} s")

    def _not_met(self, why: str) -> None:
        """The device was not ready in the time of its start: the loss policies hold for what it does not show."""
        self.has_begun = True
        self._tell(*self.image.lost(why, sorted(self.unseen)))

    def _miss(self) -> None:
        """Wait for the end of the first grace."""
        if self.grace is not None:
            self.grace.cancel()
        loop = asyncio.get_running_loop()
        if self.missed and (first_seconds := min(self.missed.values())) > loop.time():
            self.grace = loop.call_at(first_seconds, self._give_up)
        elif self.missed:
            self._give_up()

    def _give_up(self) -> None:
        """Some signals were lost for longer than is waited: the loss policies hold for them.

        Where the device is connected again it has not shown them since: a broker may have come back without them.
        """
        now = asyncio.get_running_loop().time() + _INSTANT_SECONDS
        over = [name for name, seconds in self.missed.items() if seconds <= now]
        for name in over:
            del self.missed[name]
        why = self.missed_why
        if self.is_ready.is_set():
            over = self._good(over)
            why = f"not shown since it was connected again: {why}"
        try:
            self._tell(*self.image.lost(why, over))
        finally:
            self._miss()

    def _tell(self, changes: Sequence[Change], faults: Sequence[str]) -> None:
        if self.driver.listener is not None and not self.driver.is_stopped:
            for change in changes:
                if change.signal in self.told and change.signal not in self.sensed:
                    self.driver.listener.signal(change.signal, change.value, None)
        for signal in self.sensed:  # behind what sensors show, as the loop with the machines has it
            reading = self.image.readings[signal]
            shows = reading.quality is Quality.GOOD and bool(reading.value)
            if shows != self.driver.completions.shown[signal]:
                self.driver.formed(signal, self.driver.completions.shows(signal, shows))
        if faults:
            self._fault(f"{_several(faults)} cannot be read: {self.image.readings[faults[0]].why}")

    def _replied(self, channel: Channel | Handshake, key: str, point: Point, value: Value) -> None:
        is_new = channel.shown.get(key, 0) is not None  # else a text that changes would be told as often as it does
        for outcome in channel.shows(key, value):
            self._said(outcome)
        if value != "" and channel.shown[key] is None and is_new and quoted(value) != self.garbage.get(point):
            self.garbage[point] = quoted(value)
            self.note(f"'{point}' shows {quoted(value)}, which says nothing of a command")

    def _said(self, outcome: Outcome) -> None:
        order = outcome.order
        match outcome.said:
            case Said.TAKEN:
                if by_hand := next((one for one in self.sent if one[0] == order.place), None):
                    self.sent.remove(by_hand)
                    by_hand[1].is_done = True
                if self.driver.listener is not None:
                    self.driver.listener.taken(order.place, order.entry)
            case Said.FAILED:
                self._fault(f"has failed at the command of '{order.place}'{f', {order.text}' if order.text else ''}")
            case Said.DONE:
                if (completion := self.driver.completing.get(order.place)) is not None:
                    self.driver.formed(completion, self.driver.completions.acknowledged(completion, order.entry))

    def _told_if_forgotten(self, order: Order | None) -> None:
        if order is not None:
            self._fault(f"knows nothing any more of '{order.text}' of '{order.place}', which it had taken")

    def _watchdog(self, value: Value) -> None:
        tripped = as_bit(value)
        if tripped is None:  # as a server shows it that has lost the device: who has had no heartbeat meanwhile trips
            return
        if tripped and self.has_tripped is False:
            self._fault("its watchdog has stopped its machines: it has had no heartbeat")
        elif tripped and self.has_tripped is None:
            self.note("its watchdog had stopped its machines when this run began")
        self.has_tripped = tripped


def _given(channel: Channel | Handshake, order: Order) -> str:
    """An order, and where it was written and would be shown."""
    shown = ", ".join(channel.document.shows)
    return f"'{order.text}' of '{order.place}' (written at {channel.document.asks}, shown at {shown})"


def _several(names: Sequence[str]) -> str:
    """The first of some names, and how many there are besides.

    >>> _several(["robot.touch"]), _several(["robot.touch", "mc.there"])
    ("'robot.touch'", "'robot.touch' and 1 more")
    """
    return f"'{names[0]}'" + (f" and {len(names) - 1} more" if len(names) > 1 else "")
