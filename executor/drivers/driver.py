"""Drivers: from commands and signals of the net to machines, and back.

A driver is told of each command that a place sends, and tells of each change of a signal. It *forms* the completion
bits: a completion is 1 when the machine has acknowledged the command and, where a sensor sees the outcome, the sensor
shows it; sending the next command that it completes clears it. What was acknowledged is named by signal and entry
number, so that the answer to an earlier command is never taken for that to the present one.

Drivers run as a task of their own, and hand over what they have to tell without waiting. `stop` drives the safe
outputs. The alternative, polling a process image at a fixed period, adds half a period to every reaction; drivers of
devices that can only be polled will do so inside, behind the same protocol.
"""

from __future__ import annotations

from typing import Protocol

from firable.nets.net import Place


class Listener(Protocol):
    """Whom a driver tells."""

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """A signal has a new value; for a completion, `entry` is the number of the command completed."""
        ...

    def driver_fault(self, machine: str, message: str) -> None:
        """A machine or its link has failed."""
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
        """Whether nothing will happen any more unless a command is sent; False where the driver cannot know."""
        ...

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Serve the machines until cancelled."""
        ...

    def send(self, place: Place, entry: int) -> None:
        """Send the command of a place."""
        ...

    def stop(self) -> None:
        """Drive the safe outputs: every machine stops where it is. Nothing is sent afterwards."""
        ...

    def close(self) -> None:
        """Let no new work into the cell, as far as the driver can."""
        ...
