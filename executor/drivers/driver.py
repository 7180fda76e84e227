"""Drivers: from commands and signals of the net to machines, and back. This file is the contract.

A driver holds the *process image*: for each signal its value, when that was read, and its quality. It tells each change
to a listener without waiting, and is told of each command that a place sends. What every driver keeps:

- It *forms* the completion bits: a completion is 1 when the machine has acknowledged the command and, where a sensor
  sees the outcome, the sensor shows it; sending the next command that it completes clears it. What was acknowledged is
  named by place and entry number, so that the answer to an earlier command is never taken for that to the present one.
- A signal whose device is lost follows its *loss policy*: hold the value (quality uncertain), take a safe value, or be
  a fault (quality bad both times). Nothing is told of a signal that has not been read yet, and no gate of it is open.
- The *safe outputs* are driven at start-up, before any command; at `stop`; and when this process crashes or freezes,
  by the device itself: the driver gives it a heartbeat, and the device's own watchdog does the rest.
- A connection that failed or timed out is never used again: the answer that comes too late would be taken for that to
  the next question. There is a new one, after a pause that grows.
- Edges that come faster than they are read are counted as *coalesced* in the image, never silently lost.
- A command is *taken* when the machine has it, and not when the driver has put it in a queue. A token without
  completion goes on by that alone: over a dead line, or at a stop, it would leave a machine that has never moved.
- After a restart `ask` says what became of a command that was sent before.

The alternative, polling a process image at a fixed period, adds half a period to every reaction; drivers of devices
that can only be polled do so inside, behind this protocol. Real machines are reached by the driver of a binding,
`bound.py`, which keeps all of the above once for all kinds of devices; a new kind brings a `Connection`, no `Driver`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from enum import StrEnum
from typing import Protocol, TypeVar, runtime_checkable

from firable.executor.protocol.commands import Answer as Answer
from firable.executor.protocol.messages import Effect, Sending
from firable.executor.protocol.record import record
from firable.nets.net import Place

Leaving = TypeVar("Leaving", bound=Effect)


class Quality(StrEnum):
    """How far a value may be believed: it was read; it was read, and may have changed since; it was not."""

    GOOD = "good"
    UNCERTAIN = "uncertain"
    BAD = "bad"


@record
class Reading:
    """What the process image holds of one signal.

    `value` is None as long as nothing was read; `at_seconds` is the time, by the run's clock, at which the value was
    last seen to be so; `why` says why the quality is not good; `coalesced` counts the edges that were not told.
    """

    value: bool | None = None
    at_seconds: float = 0.0
    quality: Quality = Quality.BAD
    why: str = "not read yet"
    coalesced: int = 0


class Listener(Protocol):
    """Whom a driver tells."""

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """A signal has a new value; for a completion, `entry` is the number of the command completed."""
        ...

    def taken(self, place: str, entry: int) -> None:
        """A machine has the command of a place: it will do it, whatever becomes of the line and of this process."""
        ...

    def driver_fault(self, machine: str, message: str) -> None:
        """A machine or its link has failed."""
        ...

    def driver_note(self, machine: str, message: str) -> None:
        """Something about a machine or its link that is no fault, for the trace: lost, found again, refused."""
        ...

    def emergency_stop(self, reason: str) -> None:
        """Somebody, or a device, asks for the emergency stop: every driver here is stopped before this returns."""
        ...

    def all_told(self) -> None:
        """What came together has been told, and the driver is in the midst of nothing: it is acted upon now.

        The driver may be commanded before this returns. Without this it is acted upon in a turn of the event loop.
        """
        ...

    def moved(self) -> None:
        """Something happened in the cell, whether or not a signal shows it."""
        ...


class Clock(Protocol):
    """The time of a run, in its own seconds."""

    def now_seconds(self) -> float:
        """The time since the beginning of the run."""
        ...

    def loop_delay_seconds(self, until_seconds: float) -> float:
        """How long the event loop has to wait until a time of the run."""
        ...


class Driver(Protocol):
    """The border between the executor and the machines."""

    @property
    def at_rest(self) -> bool:
        """Whether nothing will happen any more unless a command is sent, or somebody sets a signal from outside.

        False where the driver cannot know.
        """
        ...

    @property
    def unconfirmed(self) -> Collection[str]:
        """The devices that have not confirmed the safe outputs of the stop; asked once `run` has ended."""
        ...

    @property
    def unreached(self) -> Collection[str]:
        """In a phrase each, the devices that are not connected, have never shown a signal, or not taken a command."""
        ...

    def readings(self) -> Mapping[str, Reading]:
        """The process image: each signal that is read, sensors and what completions are formed from."""
        ...

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Serve the machines until cancelled; on the way out the safe outputs are driven."""
        ...

    def send(self, place: Place, entry: int) -> None:
        """Send the command of a place; it waits for a link that is down, and is `taken` when the machine has it."""
        ...

    def withdraw(self, place: Place) -> None:
        """Give up the command of a place that its token has left before it was over.

        What waits for a link is dropped and never sent; what is being written, or is taken, stays.
        """
        ...

    async def met(self) -> None:
        """Wait until each device was reached, or as long as its start may take: then what is told of it is so."""
        ...

    async def ask(self, place: Place, entry: int) -> Answer:
        """What became of a command that was sent before a restart, as the machine tells it.

        The command is taken up again: after `WORKING`, and after `UNKNOWN` if it turns out well, its completion is told
        as ever; after `DONE` it is not told. `UNKNOWN` too where the machine cannot be reached within its time.
        """
        ...

    def stop(self) -> None:
        """Drive the safe outputs: every machine stops where it is. Nothing is sent afterwards."""
        ...

    def close(self) -> bool:
        """Let no new work into the cell, as far as the driver can; whether none comes any more."""
        ...


@runtime_checkable
class Cautious(Protocol):
    """A listener that may have to leave the machines alone for a while, for another host may have them."""

    async def let_drive(self) -> None:
        """Wait until they may be driven."""
        ...


@runtime_checkable
class Telling(Protocol):
    """A driver that tells each sensor when it was read first, one that shows 0, too; before that nobody knows it.

    So the gates of a sensor are closed until then: a transition `unless` somebody is there would fire, and a machine
    move, before anybody has looked.
    """

    @property
    def tells_each_sensor(self) -> bool:
        """Whether it does."""
        ...


class Latched(Driver, Protocol):
    """A driver that begins after an emergency stop, and is latched until it is released.

    As long as it is, it drives the safe outputs on every connection, commands nothing, and takes neither an open
    contact nor a lost device for news. It reads, and answers what it is asked.
    """

    @property
    def undriven(self) -> Collection[str]:
        """The devices that have not confirmed the safe outputs on any connection of this driver."""
        ...

    def against(self) -> Collection[str]:
        """What keeps it from being released, in a phrase each: contacts that are open, devices that do not answer."""
        ...

    def release(self) -> None:
        """Be a driver as any other from now on; called only where nothing is against it."""
        ...


class Drivers(Protocol):
    """What makes the driver of the machines here, and of the same machines the one that follows an emergency stop."""

    def __call__(self, *, latched: bool = False) -> Latched:
        """A driver that has not begun."""
        ...


class Held(Protocol[Leaving]):
    """What is held back behind the journal (`Outbox`)."""

    def __iter__(self) -> Iterator[Leaving]: ...

    def __len__(self) -> int: ...

    def remove(self, value: Leaving, /) -> None:
        """Hold something back for ever."""
        ...


def withdraw(driver: Driver, places: Iterable[Place], leaving: Held[Leaving]) -> list[str]:
    """Give up the commands of places whose token has left: a machine must not move by them later, by no token.

    They are with the driver, or still among what is `leaving` the process behind the journal, and are taken out there.
    One that its machine has is not given up. Returns the places of those that never reached the driver.
    """
    never: list[str] = []
    for place in places:
        if place.command is not None:
            if len(leaving):
                waiting = [one for one in leaving if isinstance(one, Sending) and one.place == place.name]
                for one in waiting:
                    leaving.remove(one)
                    never.append(place.name)
            driver.withdraw(place)
    return never
