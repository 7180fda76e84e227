"""Channels of devices that know no numbers: a bit by which a command is asked for, and a bit that says that it is done.

The handshake of four edges, as robots and drives have it on their terminals: what the command needs is written, then
`request` becomes 1; the device shows `done`; `request` becomes 0; `done` becomes 0, and the next command may come. A
bit that says that it is `taken`, or at work, may stand beside it, and one that says that it has `failed`. All bits are
levels, so a write whose confirmation was lost is repeated without harm, and a `done` that stands there from before is
cleared before a request is made: within one run an answer is to its own command.

What numbers give beyond that is lost, and nothing here pretends to it:

- After a restart an idle device may have done the command or never have had it, and a `done` may be of the command
  before. `ask` answers *working* where the device shows that it is at work, and else *unknown*: a person says what is.
- No command overtakes another. One that was given up before its machine was done stands in the way of the next, unless
  the device shows by `taken` that it has let go of it when its request has fallen.
- A device that is switched off and on shows nothing of what it had; with `taken` that is a fault, without it the
  command is overdue in the end.

Rejected: pulses instead of levels. Whoever looks at the wrong moment never sees one.
"""

from __future__ import annotations

from collections import deque
from enum import Enum, auto

from firable.executor.drivers.binding import ChannelDocument
from firable.executor.drivers.channels import Order, Outcome, Said
from firable.executor.drivers.device import Value, Writes, as_bit
from firable.executor.drivers.driver import Answer


class _Phase(Enum):
    """How far the handshake of the newest order has come."""

    HELD = auto()
    """It waits until the device shows nothing of the one before."""
    ASKING = auto()
    ASKED = auto()
    OVER = auto()
    """It was done, has failed or was given up: its request falls."""


class Handshake:
    """The commands of one machine, one after the other; the same to its device as `channels.Channel` is."""

    def __init__(self, document: ChannelDocument, answered: frozenset[str]) -> None:
        self.document = document
        self.answered = answered
        self.shown: dict[str, int | None] = {}
        """The bits that the device shows; None for what is neither 0 nor 1."""
        self.waiting: deque[Order] = deque()
        self.current: Order | None = None
        self.phase = _Phase.OVER
        self.request: bool | None = None
        """What the request was confirmed to be; None as long as nobody knows."""
        self.writing: bool | None = None
        self.is_taken = False
        self.is_withdrawn = False

    @property
    def is_writing(self) -> bool:
        """Whether a command has not been written yet."""
        return bool(self.waiting) or (self.current is not None and self.phase in {_Phase.HELD, _Phase.ASKING})

    @property
    def unanswered(self) -> Order | None:
        """The newest order, where the device should show by now that it has it, or has never shown all of its bits."""
        awaits = self.phase is _Phase.ASKED and not self.is_taken and self.document.taken is not None
        known = (self.shown.get(key) is not None for key in self.document.shows.values())
        is_blind = self.phase is _Phase.HELD and not all(known)
        return self.current if awaits or is_blind else None

    def send(self, place: str, entry: int, text: str, writes: Writes) -> None:
        """Send a command as soon as the one before is over."""
        if place in self.answered:
            self.withdraw(place)
        self.waiting.append(Order(place, entry, 0, text, writes))

    def withdraw(self, place: str) -> None:
        """Give up what was sent for a place; what the device was asked for, it may do all the same."""
        self.waiting = deque(order for order in self.waiting if order.place != place)
        if self.current is None or self.current.place != place:
            return
        if self.phase is _Phase.HELD:
            self.current, self.phase = None, _Phase.OVER
        else:
            self.is_withdrawn = True
            if self.phase is _Phase.ASKING and self.writing is None:  # it was to be asked for anew
                self.phase = _Phase.OVER
            self._let_go()

    def next_writes(self) -> Writes | None:
        """What is to be written now, if anything; `written` follows when the device has it."""
        if self.phase is _Phase.OVER and self.waiting:
            self.current, self.phase = self.waiting.popleft(), _Phase.HELD
            self.is_taken = self.is_withdrawn = False
        if self.writing is not None or self.current is None:
            return None
        if self.phase in {_Phase.OVER, _Phase.HELD} and self.request is not False:
            self.writing = False
            return ((self.document.asks, False),)
        if self.phase is _Phase.ASKING or (self.phase is _Phase.HELD and self._is_idle()):
            self.phase, self.writing = _Phase.ASKING, True
            return (*self.current.writes, (self.document.asks, True))
        return None

    def written(self) -> tuple[Outcome, ...]:
        """The device has confirmed what was to be written; it has taken a command when it shows so."""
        self.request, self.writing = self.writing, None
        if self.phase is _Phase.ASKING:
            self.phase = _Phase.ASKED
        return ()

    def shows(self, key: str, value: Value) -> tuple[Outcome, ...]:
        """The device shows a bit; returns what that tells of the command that it was asked for."""
        bit = as_bit(value)
        self.shown[key] = None if bit is None else int(bit)
        order = self.current
        if not bit or order is None or self.phase not in {_Phase.ASKING, _Phase.ASKED}:
            return ()
        outcomes = [] if self.is_taken else [Outcome(order, Said.TAKEN)]
        self.is_taken = True
        if key != "taken":
            outcomes.append(Outcome(order, Said.DONE if key == "done" else Said.FAILED))
        if key != "taken" or self.document.done is None:
            self.phase = _Phase.OVER
        self._let_go()
        return tuple(outcomes)

    def connected_again(self) -> Order | None:
        """A new connection shows its bits; returns an order that the device had, and knows nothing of any more."""
        self.request = self.writing = None
        order = self.current
        if self.phase is _Phase.ASKING and (self.is_taken or self.is_withdrawn):
            self.phase = _Phase.ASKED if self.is_taken else _Phase.OVER
        elif self.phase is _Phase.ASKED and self.document.taken is not None and self.is_taken and self._is_idle():
            self.phase = _Phase.OVER
            return order
        return None

    def forgotten(self) -> Order | None:
        """Nobody can tell: a bit that says at work may fall a moment before the bit that says done rises."""
        return None

    def is_at(self, place: str, entry: int) -> bool:
        """Whether the device shows that it is at work, at whatever it was asked for last."""
        del place, entry  # it knows neither
        return self.shown.get("taken") == 1 and not self.shown.get("done") and not self.shown.get("failed")

    def expect(self, place: str, entry: int) -> None:
        """Nothing: a bit that is set later may be of any command."""

    def answer(self, place: str, entry: int, *, stopped: bool) -> Answer:
        """What became of a command that was sent before a restart, as far as bits can tell.

        Where the device is at work, the outcome is told if it comes; else nothing is taken for an outcome.
        """
        if not self.is_at(place, entry) or (stopped and self.document.failed is None) or place not in self.answered:
            return Answer.UNKNOWN
        self.current, self.phase, self.is_taken = Order(place, entry, 0, ""), _Phase.ASKED, True
        return Answer.WORKING

    def _is_idle(self) -> bool:
        """Whether the device shows nothing of an earlier command."""
        return all(self.shown.get(key) == 0 for key in self.document.shows.values())

    def _let_go(self) -> None:
        """Let the request of a command that was given up fall, once the device will show what it makes of that."""
        if self.is_withdrawn and self.is_taken and self.document.taken is not None and self.phase is _Phase.ASKED:
            self.phase = _Phase.OVER
