"""What goes wrong in a simulated cell because somebody has asked for it: machines that hang, sensors, lost workpieces.

The laws of the cell (`plant.py`) know of no mishap. Each that is asked for stands here as what it is about and when: a
command by how often its machine has been given it, a sensor by the time. So a run with mishaps is a function of them,
as it is of its seed. Rejected: mishaps that are drawn. A test of what follows from one has to know that it comes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar


@dataclass(frozen=True, slots=True)
class NeverCompletes:
    """A disturbance: this command of this machine, the `occurrence`-th time (from 1), is taken and never done."""

    machine: str
    command: str
    occurrence: int = 1


@dataclass(frozen=True, slots=True)
class StuckSensor:
    """A disturbance: from a time on, the sensor shows one value whatever it sees."""

    signal: str
    value: bool
    from_seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Drops:
    """A disturbance: when this command of this machine ends, the `occurrence`-th time, what it holds is lost."""

    machine: str
    command: str
    occurrence: int = 1


Disturbance = NeverCompletes | StuckSensor | Drops
T = TypeVar("T", NeverCompletes, Drops)


class Disturbances:
    """All that is asked for in one cell.

    >>> asked = Disturbances([StuckSensor("s", True, 3.0), NeverCompletes("R", "MOVE", 2)])
    >>> asked.shown("s", 2.9), asked.shown("s", 3.0)
    (None, True)
    >>> asked.hangs("R", "MOVE", 1), asked.hangs("R", "MOVE", 2), asked.drops("R", "MOVE", 2)
    (None, NeverCompletes(machine='R', command='MOVE', occurrence=2), None)
    """

    def __init__(self, several: Iterable[Disturbance]) -> None:
        self.several = tuple(several)
        self.stuck = [one for one in self.several if isinstance(one, StuckSensor)]

    def hangs(self, machine: str, command: str, occurrence: int) -> NeverCompletes | None:
        """What makes a machine take a command, given to it so often by now, and never end it."""
        return self._asked(NeverCompletes(machine, command, occurrence))

    def drops(self, machine: str, command: str, occurrence: int) -> Drops | None:
        """What makes a machine that ends a command lose what it holds."""
        return self._asked(Drops(machine, command, occurrence))

    def _asked(self, one: T) -> T | None:
        return one if one in self.several else None

    def shown(self, signal: str, at_seconds: float) -> bool | None:
        """What a sensor shows whatever it sees; None where it is right."""
        return next((one.value for one in self.stuck if one.signal == signal and one.from_seconds <= at_seconds), None)
