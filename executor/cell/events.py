"""What is to happen in a simulated cell at some time, and the commands that its machines are at.

Each is data, and stands in the cell's queue with its time; what it does when that has come, the laws say (`plant.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from firable.executor.cell.disturbances import StuckSensor

Ticket = int
"""Names one sent command in the plant's answer."""


@dataclass(frozen=True, slots=True)
class Busy:
    """The command that a machine is at."""

    command: str
    parameters: Mapping[str, str]
    ticket: Ticket
    waits: bool = False
    """Whether it would be done if its station were not full."""


@dataclass(frozen=True, slots=True)
class ArrivalDue:
    """The next workpiece comes."""


@dataclass(frozen=True, slots=True)
class DepartureDue:
    """A workpiece at an end is taken away, if it is still there."""

    station: str
    id: int


@dataclass(frozen=True, slots=True)
class FinishDue:
    """The time of a command is over."""

    machine: str
    busy: Busy


@dataclass(frozen=True, slots=True)
class PressDue:
    """Somebody has come to a machine that was stopped, and presses the key."""

    signal: str


@dataclass(frozen=True, slots=True)
class SwitchDue:
    """Somebody outside the cell sets a signal, or resets it."""

    signal: str


@dataclass(frozen=True, slots=True)
class StickDue:
    """A sensor gets stuck: `_seen` looks at the disturbances."""

    stuck: StuckSensor


@dataclass(frozen=True, slots=True)
class LookDue:
    """A camera has looked long enough at what lies on a station."""

    station: str
    number: int
    """Of the looks at that station: one that was begun anew since, or has nothing to see any more, finds nothing."""


Event = ArrivalDue | DepartureDue | FinishDue | PressDue | SwitchDue | StickDue | LookDue
