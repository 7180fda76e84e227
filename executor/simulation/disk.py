"""The disk of a simulated process: stable storage that loses what was not synced, and fails on request.

A batch is whole or not at all, and batches become durable in order, as in a database with a write-ahead log: after a
crash the disk holds what was synced and some first part of what was written since. That part is drawn, so a promise is
never relied on before the sync, and never taken for lost before it either. A sync is of what was written when it began:
it may take its time, and what is written meanwhile is for the next one.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any


class DiskFailedError(Exception):
    """A write or a sync failed: the process ends at once, for it no longer knows what it will remember."""


class Disk:
    """What one process keeps."""

    def __init__(self, draw: random.Random) -> None:
        self.draw = draw
        self.failing = 0.0
        """The probability that a sync fails."""
        self.durable: dict[str, Any] = {}
        self.unsynced: list[Mapping[str, Any]] = []

    def kept(self) -> Mapping[str, Any]:
        """What a process finds that starts now."""
        return dict(self.durable)

    def write(self, batch: Mapping[str, Any]) -> None:
        """Write a batch, durable after the next sync; None deletes."""
        self.unsynced.append(batch)

    def sync(self, batches: int) -> None:
        """Make durable the first so many batches; raises `DiskFailedError`, and then a first part of them may be."""
        if self.failing and self.draw.random() < self.failing:
            raise DiskFailedError
        self._keep(batches)

    def crash(self) -> int:
        """Lose all but the first of the batches that were not synced; returns how many are kept."""
        kept = self.draw.randint(0, len(self.unsynced)) if self.unsynced else 0
        self._keep(kept)
        self.unsynced.clear()
        return kept

    def _keep(self, count: int) -> None:
        for batch in self.unsynced[:count]:
            for key, value in batch.items():
                if value is None:
                    self.durable.pop(key, None)
                else:
                    self.durable[key] = value
        del self.unsynced[:count]
