"""The emergency stop of a cell as its drivers see it: contacts that are closed as long as nobody has pressed a button.

A contact is *normally closed* (IEC 60947-5-5): 1 says that the machines may move, and everything else stops them. So a
wire that breaks, a device that is lost and a value that nobody can read are a button that is pressed, because nobody
could press it then. There is no time of grace, and no other loss policy. Until each contact has been read as closed, on
a device that is ready, no machine is commanded; once one of them was not, none is, whatever it shows later: the driver
has stopped. The driver that follows it is *latched* (`driver.Latched`): it drives the safe outputs and watches the
contacts, until all of them are closed again and a person has said so. To let the machines move is then another word.

Every driver looks at the contacts of its own controllers, through its own connections. So the stop needs neither the
coordinator nor a link between hosts nor any of the other hosts. Rejected: the contact as a sensor of the net, with
transitions that lead to a safe marking. They would wait for votes, for gates and for places to become empty; and a net
can be wrong.

This is the operating stop of a control, and no safety function by itself: EN ISO 13850 asks for a circuit that stops
the machines without any program.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from firable.executor.drivers.binding import EmergencyDocument, SignalDocument, shown_as
from firable.executor.drivers.device import Point, Value, as_bit, quoted
from firable.executor.drivers.driver import Quality, Reading


@dataclass
class Contacts:
    """The contacts on one device, of which none was read yet."""

    contacts: Mapping[str, EmergencyDocument]
    open_ones: set[str] = field(default_factory=set)
    """Those that were not read as closed, or not any more."""

    def __post_init__(self) -> None:
        self.open_ones = set(self.contacts)

    @property
    def are_closed(self) -> bool:
        """Whether each was read as closed, and never as anything else since."""
        return not self.open_ones

    def signals(self) -> dict[str, SignalDocument]:
        """What the process image has to hold of them."""
        return {
            shown_as(name): SignalDocument(device=one.device, read=one.read, invert=one.invert, on_loss="0")
            for name, one in self.contacts.items()
        }

    def opened(self, batch: Iterable[tuple[Point, Value]]) -> str:
        """What opens a contact first among values that have come in this order, in a sentence; empty for nothing.

        A contact that was open for a moment only is open: the button was pressed.
        """
        opened = ""
        for point, value in batch:
            for name, one in self.contacts.items():
                if one.read == point and (bit := as_bit(value)) in {None, one.invert}:
                    self.open_ones.add(name)
                    is_no_bit = f"shows {quoted(value)}, which is neither 0 nor 1"
                    opened = opened or f"'{name}' " + (is_no_bit if bit is None else "is open")
        return opened

    def read(self, readings: Mapping[str, Reading]) -> None:
        """What the process image holds by now: which contacts are closed."""
        closed = {name for name in self.contacts if _is_closed(readings[shown_as(name)])}
        self.open_ones -= closed

    def lost(self, why: str) -> str:
        """Their device is lost: what that means, in a sentence."""
        self.open_ones |= set(self.contacts)
        several = " and ".join(f"'{name}'" for name in self.contacts)
        return f"{several} cannot be read: {why}"


def _is_closed(reading: Reading) -> bool:
    return reading.quality is Quality.GOOD and reading.value is True
