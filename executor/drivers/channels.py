"""Channels: how a command comes to a machine once, and how its answer is known to be its own.

Every command goes out with a *number*, written behind all that it needs, and the device shows the number that it has
*taken*, has *done* or has *failed* at. Numbers make the rest simple. An answer with another number is to another
command, however late it comes. A device that is written the number it has already ignores it, so that a write whose
confirmation was lost is repeated without harm. After a restart the numbers shown say what became of a command, because
the number is computed from place and entry, which outlive the executor in its journal. That a command has not been
received is certain only when whatever may be on its way has had its time; should it come later still, it is sent with
the number that the device has by then, and ignored.

Where the device already shows the number that is to be sent, as it may when a run begins without a journal, it is sent
number 0 first, "no command", and the number goes out when it is shown no more. So it is where a command was given up
that the device has not taken: the next one, such as a stop, does not wait for a program that stands still, and what it
writes is never taken with the number of the one before. Rejected, where a device has the choice: bits for request and
done, with their four edges for each command. They know no order, and say little after a restart; a device that has
nothing else is spoken to by `handshake.py`.

The device *has* a command when it shows its number. Of a channel that shows nothing of what it has taken, the
confirmation of the write must do; behind a broker that is the broker's word alone. What it has is not written again: a
command is given once, and is no level that would have to be held as long as its token stays.

A channel is for one machine, which does one thing at a time. A command that overtakes another, such as a stop, has no
completion. Pure: a machine of calls and answers, without clock and connection.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from enum import Enum, auto

from firable.executor.drivers.binding import NUMBER_MAX, ChannelDocument
from firable.executor.drivers.device import Value, Writes, as_number
from firable.executor.drivers.driver import Answer
from firable.executor.protocol.record import record


@record
class Order:
    """The command of a place, for one entry as the controller counts it."""

    place: str
    entry: int
    number: int
    text: str
    writes: Writes = ()


class Said(Enum):
    """What a machine says of an order."""

    TAKEN = auto()
    DONE = auto()
    FAILED = auto()


@record
class Outcome:
    """What a machine says, and of which order."""

    order: Order
    said: Said


class _Phase(Enum):
    """How far the newest order has come."""

    HELD = auto()
    CLEARING = auto()
    WRITING = auto()
    WRITTEN = auto()


class Channel:
    """The commands of one machine, to which the commands of `places` go; `answered` are those with a completion."""

    def __init__(self, document: ChannelDocument, places: Sequence[str], answered: frozenset[str]) -> None:
        self.document = document
        self.places = sorted(places)
        self.answered = answered
        self.shown: dict[str, int | None] = {}
        """The numbers taken, done and failed at, as the device shows them; None for what is no number."""
        self.waiting: deque[Order] = deque()
        self.current: Order | None = None
        self.phase = _Phase.WRITTEN
        self.outstanding: dict[int, Order] = {}
        """What was sent, by its number, and is neither done nor failed."""
        self.untaken: dict[int, Order] = {}
        """What was sent, by its number, and the device is not known to have."""
        self.is_taken = False
        """Whether the device has the newest order: it has shown its number, or confirmed it where it shows none."""
        self.is_withdrawn = False
        """Whether the newest order is not to be written again, and the next does not wait until the device has it."""
        self.failed_before: int | None = None
        """The number that was shown as failed when a restart asked, as long as it is: somebody was asked what to do."""
        self.given_up: set[int] = set()
        """The numbers of commands that were given up, and may stand at the device, which would still take them."""
        self.not_received: set[int] = set()
        """The numbers of which a restart was told that the device had not received them."""

    @property
    def is_writing(self) -> bool:
        """Whether a command has not been written yet."""
        return bool(self.waiting) or (self.current is not None and self.phase is not _Phase.WRITTEN)

    @property
    def unanswered(self) -> Order | None:
        """The newest order, where the device has confirmed what was written and should show by now that it has it."""
        awaits = self.phase is _Phase.WRITTEN and not self.is_taken and self.document.taken is not None
        return self.current if awaits or self.phase is _Phase.CLEARING else None

    def number(self, place: str, entry: int) -> int:
        """The number of a command: 1 + (entry * n + i) mod m, for place i of n and the largest m of whole rounds.

        So two numbers of one channel are equal only for one place and entries that are thousands apart.
        """
        rounds = NUMBER_MAX // len(self.places)
        return 1 + (entry % rounds) * len(self.places) + self.places.index(place)

    def send(self, place: str, entry: int, text: str, writes: Writes) -> None:
        """Send a command as soon as that can be; `text` is the command as the net has it."""
        if place in self.answered:  # without a completion, each is to be done
            self.withdraw(place)
        self.waiting.append(Order(place, entry, self.number(place, entry), text, writes))

    def withdraw(self, place: str) -> None:
        """Give up what was sent for a place, as far as the device cannot have it; it is not written again either.

        Otherwise a machine would move when its link comes back, by a command whose token has long left the place.
        """
        self.waiting = deque(order for order in self.waiting if order.place != place)
        self.given_up |= {number for number, order in self.untaken.items() if order.place == place}
        if self.current is None or self.current.place != place:
            return
        if self.phase in {_Phase.HELD, _Phase.CLEARING}:
            self.current, self.phase = None, _Phase.WRITTEN
        else:
            self.is_withdrawn = True

    def next_writes(self) -> Writes | None:
        """What is to be written now, if anything; `written` follows when the device has it."""
        if self._delivered() and self.waiting:
            self.current, self.phase, self.is_taken = self.waiting.popleft(), _Phase.HELD, False
            self.is_withdrawn = False
        order = self.current
        if order is None or self.phase in {_Phase.WRITING, _Phase.WRITTEN}:
            return None
        is_shown = order.number in self.shown.values() and order.number not in self.not_received
        if is_shown or self.given_up:
            if self.phase is _Phase.CLEARING and not self.given_up:
                return None
            self.phase = _Phase.CLEARING
            return self._numbered(0, "")
        self.not_received.discard(order.number)  # it may have come since: then the device ignores it
        self.phase = _Phase.WRITING
        self.outstanding = {number: one for number, one in self.outstanding.items() if one.place != order.place}
        self.outstanding[order.number] = self.untaken[order.number] = order
        return (*order.writes, *self._numbered(order.number, order.text))

    def written(self) -> tuple[Outcome, ...]:
        """The device has confirmed what was to be written; returns what that tells, where it does not tell more."""
        if self.phase is _Phase.CLEARING:
            self.untaken = {number: one for number, one in self.untaken.items() if number not in self.given_up}
            self.given_up.clear()
        if self.phase is not _Phase.WRITING or (order := self.current) is None:
            return ()
        self.phase = _Phase.WRITTEN
        if self.document.taken is None:
            self.is_taken = True
            return self._has(order.number)
        shown = [key for key, number in self.shown.items() if number == order.number]  # also from before it was written
        return tuple(outcome for key in shown for outcome in self.shows(key, order.number))

    def shows(self, key: str, value: Value) -> tuple[Outcome, ...]:
        """The device shows a number; returns what that tells."""
        number = self.shown[key] = as_number(value)
        if (order := self.current) is not None and number == order.number:
            if self.phase is _Phase.HELD and self.untaken.get(number) is order:  # brought late by the connection before
                self.phase = _Phase.WRITTEN
            self.is_taken |= self.phase in {_Phase.WRITING, _Phase.WRITTEN}
        if number is None:
            return ()
        if key == "failed" and number != self.failed_before:
            self.failed_before = None
        has = self._has(number)
        if key == "taken" or (key == "failed" and number == self.failed_before):
            return has
        if (order := self.outstanding.pop(number, None)) is None:
            return has
        return (*has, Outcome(order, Said.DONE if key == "done" else Said.FAILED))

    def connected_again(self) -> Order | None:
        """A new connection shows its numbers; returns an order that the device had, and knows nothing of any more.

        What the device may not have is written again, with its number: a device that has it ignores it. What it has is
        not: one that was switched off and on would begin anew, hours later and by no token.
        """
        order = self.current
        if order is None or self.phase is _Phase.HELD:
            return None
        if order.number in self.shown.values() and self.phase is not _Phase.CLEARING:
            self.phase = _Phase.WRITTEN
        elif not self.is_taken and self.is_withdrawn:
            self.current, self.phase = None, _Phase.WRITTEN
        elif not self.is_taken:
            self.phase = _Phase.HELD
        else:
            self.phase = _Phase.WRITTEN
            # What cannot be read now has not been forgotten yet; when it can, `forgotten` knows.
            return None if self.shown.get("taken") is None else self.outstanding.pop(order.number, None)
        return None

    def forgotten(self) -> Order | None:
        """The newest order, once, where the device had shown that it has it and shows nothing of it any more.

        To be asked when all that has come is known: `taken` may go in the same batch in which `done` comes.
        """
        order = self.current
        if order is None or not self.is_taken or self.phase is not _Phase.WRITTEN or self.shown.get("taken") is None:
            return None
        return None if order.number in self.shown.values() else self.outstanding.pop(order.number, None)

    def expect(self, place: str, entry: int) -> None:
        """Take up a command that was sent before a restart, so that its outcome is told if it comes."""
        number = self.number(place, entry)
        self.outstanding[number] = order = Order(place, entry, number, "")
        if number not in self.shown.values():
            self.untaken[number] = order

    def is_at(self, place: str, entry: int) -> bool:
        """Whether the device shows that it has a command, and neither that it is done nor that it has failed."""
        number = self.number(place, entry)
        return self.shown.get("taken") == number and number not in {self.shown.get("done"), self.shown.get("failed")}

    def answer(self, place: str, entry: int, *, stopped: bool) -> Answer:
        """What became of a command that was sent before a restart; `stopped` where the safe outputs came in between.

        A device that would show that it has failed is believed to be at work as long as it does not, also then; without
        that, whether the machine was stopped in the middle of it nobody knows. Of a command without completion nothing
        is asked but that the machine has it. The command is taken up again, so that its outcome is told if it comes.
        """
        number = self.number(place, entry)
        if self.shown.get("done") == number:
            return Answer.DONE
        self.expect(place, entry)
        if self.shown.get("failed") == number:
            self.failed_before = number
            return Answer.UNKNOWN
        if number in self.shown.values():
            if place not in self.answered:
                return Answer.DONE
            return Answer.UNKNOWN if stopped and self.document.failed is None else Answer.WORKING
        taken = self.shown.get("taken")
        if taken is None or not self._came_before(taken):
            return Answer.UNKNOWN
        del self.outstanding[number], self.untaken[number]
        self.not_received.add(number)
        return Answer.NOT_RECEIVED

    def _came_before(self, taken: int) -> bool:
        """Whether the number shown is none, or of a command that was over when a later one was sent."""
        return taken == 0 or self.places[(taken - 1) % len(self.places)] in self.answered

    def _has(self, number: int) -> tuple[Outcome, ...]:
        order = self.untaken.pop(number, None)
        self.given_up.discard(number)
        return () if order is None else (Outcome(order, Said.TAKEN),)

    def _delivered(self) -> bool:
        """Whether the next order may go out: the device has the newest, as far as it tells, or is not to have it."""
        if self.current is None:
            return True
        return self.phase is _Phase.WRITTEN and (self.is_taken or self.document.taken is None or self.is_withdrawn)

    def _numbered(self, number: int, text: str) -> Writes:
        if self.document.number is not None:
            return ((self.document.number, number),)
        return ((str(self.document.command), f"{number} {text}".strip()),)
