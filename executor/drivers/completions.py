"""Completion bits: formed from the acknowledgement of a command and, where there is one, from a sensor.

A completion is a level that a command clears and the driver sets (SEMANTICS, "Completion gates"). It is set once, when
the machine has acknowledged *this* command, by its entry number, and the sensor shows the outcome at the same time:
either may come first, and a sensor that still shows the outcome of the command before says nothing by itself. What
comes for an earlier entry is dropped here, and once more in the controller.

Pure, and shared by all drivers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(slots=True)
class _Awaited:
    """A completion that is being formed."""

    entry: int
    acknowledged: bool = False


class Completions:
    """The completions that are being formed, of the signals of one net."""

    def __init__(self, sensed: Mapping[str, bool]) -> None:
        self.shown = dict(sensed)
        """What the sensor shows, of each completion that has one; what cannot be believed counts as not shown."""
        self.awaited: dict[str, _Awaited] = {}

    def commanded(self, signal: str, entry: int) -> None:
        """A command was sent: its completion is cleared, and awaited."""
        self.awaited[signal] = _Awaited(entry)

    def acknowledged(self, signal: str, entry: int) -> int | None:
        """The machine has done the command of an entry; returns the entry if that makes its completion."""
        awaited = self.awaited.get(signal)
        if awaited is None or awaited.entry != entry:
            return None
        awaited.acknowledged = True
        return self._formed(signal)

    def shows(self, signal: str, value: bool) -> int | None:
        """The sensor of a completion shows something; returns the entry that this makes complete."""
        self.shown[signal] = value
        return self._formed(signal)

    def _formed(self, signal: str) -> int | None:
        awaited = self.awaited.get(signal)
        if awaited is None or not awaited.acknowledged or not self.shown.get(signal, True):
            return None
        del self.awaited[signal]
        return awaited.entry
