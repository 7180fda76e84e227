"""What goes wrong in a simulated cell because somebody has asked for it: machines that hang, sensors, lost workpieces.

The laws of the cell (`plant.py`) know of no mishap. Each that is asked for stands here as what it is about and when: a
command by how often its machine has been given it, a sensor by the time. So a run with mishaps is a function of them,
as it is of its seed. Rejected: mishaps that are drawn. A test of what follows from one has to know that it comes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


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


class Disturbances:
    """All that is asked for in one cell.

    >>> asked = Disturbances([StuckSensor("s", True, 3.0), NeverCompletes("R", "MOVE", 2)])
    >>> asked.shown("s", 2.9), asked.shown("s", 3.0), list(asked.moments())
    (None, True, [3.0])
    >>> asked.hangs("R", "MOVE", 1), asked.hangs("R", "MOVE", 2), asked.drops("R", "MOVE", 2)
    (False, True, False)
    """

    def __init__(self, several: Iterable[Disturbance]) -> None:
        self.several = tuple(several)
        self.stuck = [one for one in self.several if isinstance(one, StuckSensor)]

    def moments(self) -> Iterator[float]:
        """When something goes wrong by itself."""
        return (one.from_seconds for one in self.stuck)

    def hangs(self, machine: str, command: str, occurrence: int) -> bool:
        """Whether a machine takes a command, given to it so often by now, and never ends it."""
        return NeverCompletes(machine, command, occurrence) in self.several

    def drops(self, machine: str, command: str, occurrence: int) -> bool:
        """Whether a machine that ends a command loses what it holds."""
        return Drops(machine, command, occurrence) in self.several

    def shown(self, signal: str, at_seconds: float) -> bool | None:
        """What a sensor shows whatever it sees; None where it is right."""
        return next((one.value for one in self.stuck if one.signal == signal and one.from_seconds <= at_seconds), None)
