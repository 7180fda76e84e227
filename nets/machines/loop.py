"""A closed loop as data: the net of a cell with its machines, what its names mean, and what was chosen for it.

`firable.nets.machines.closing` makes it; whoever asks questions of it needs only this.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from firable.nets.machines.moment import Literal
from firable.nets.net import Net

PLANT: Final = "plant"
"""The owner of what stands for machines and workpieces."""
UNSENT: Final = f"{PLANT}.unsent"
ACCIDENT: Final = f"{PLANT}.accident"
OVERRUN: Final = f"{PLANT}.overrun"


class Sending(StrEnum):
    """When a command is sent: in the firing itself, or later, when its controller has applied the firing.

    The second is the distributed cell: the coordinator decides, and each controller applies its part and sends its
    commands at a moment of its own. What reads or takes the token of the place waits for that moment.
    """

    AT_ONCE = "at once"
    LATE = "late"


class Faults(StrEnum):
    """Which commands may fail: none, those that are repaired and then go on, or all that may, for good."""

    NONE = "none"
    REPAIRED = "repaired"
    FOR_GOOD = "for good"


@dataclass(frozen=True)
class ClosedLoop:
    """The net of a cell with its machines, and what its names mean.

    `variants` holds, for each transition of the cell, its transitions in the loop; `accidents` those transitions after
    which nothing fires; `shown` for each signal the place that shows it, and whether a token there means 1 (of timers,
    those that more than a fault transition reads); `at` for
    each place with a command the place that says that the machine is at it; `failed` the place of each machine that
    can fail; `acknowledged`, for a completion that waits for its sensor, the place that says so; `unsent`, where
    commands are sent late, the place that says that the command of a place is still to be sent; `news`, for a signal of
    which a controller may be told late, the place that says that it has changed since.
    """

    cell: Net
    net: Net
    variants: Mapping[str, tuple[str, ...]]
    accidents: Mapping[str, str]
    shown: Mapping[str, Literal]
    at: Mapping[str, str]
    failed: Mapping[str, str]
    acknowledged: Mapping[str, str]
    unsent: Mapping[str, str]
    news: Mapping[str, str]

    def of_the_cell(self, firings: Iterable[Iterable[str]]) -> tuple[tuple[str, ...], ...]:
        """A firing sequence of the loop as one of the cell: the names of its transitions, without the machines."""
        own = {variant: name for name, variants in self.variants.items() for variant in variants}
        kept = (tuple(own[name] for name in fired if name in own) for fired in firings)
        return tuple(fired for fired in kept if fired)
