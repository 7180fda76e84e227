"""The process image: what the signals show, how far that may be believed, and what happens when their device is lost.

Values come in batches, in their order; what is told to the controllers is where the signal stands at the end of a
batch, because a net sees levels and not edges. The edges in between are counted as coalesced. A device that is polled
shows nothing of what happened between two polls; one that counts edges itself can be asked for its count (`edges` in
the binding), and then those are counted too. The alternative, telling every edge of a batch, lets one chattering
contact fill the mailbox of a controller faster than it is read.

Pure: the time comes with each call.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

from firable.executor.drivers.binding import SignalDocument
from firable.executor.drivers.device import Point, Value, as_bit, as_number, quoted
from firable.executor.drivers.driver import Quality, Reading
from firable.executor.protocol.record import record

COUNTER_MODULUS = 1 << 16
"""Counters of edges begin again at this number or at a multiple of it."""


@record
class Change:
    """A signal shows something else."""

    signal: str
    value: bool


class Image:
    """The signals of one device."""

    def __init__(self, signals: Mapping[str, SignalDocument]) -> None:
        self.signals = signals
        self.readings = {name: Reading() for name in signals}
        self.unreadable: set[str] = set()
        """The signals that show neither 0 nor 1: a fault is told once, and not again of each other thing they show."""
        self.reads: dict[Point, list[str]] = {}
        self.counters: dict[Point, list[str]] = {}
        self.counted: dict[str, int] = {}
        """The number that the edge counter of a signal showed last."""
        for name, signal in signals.items():
            self.reads.setdefault(signal.read, []).append(name)
            if signal.edges is not None:
                self.counters.setdefault(signal.edges, []).append(name)

    def take(self, batch: Iterable[tuple[Point, Value]], now_seconds: float) -> tuple[list[Change], list[str]]:
        """Take what was read; returns what has changed by it, and which signals are faults by their loss policy."""
        before: dict[str, bool | None] = {}
        edges: dict[str, int] = {}
        counts: dict[str, int] = {}
        faults: list[str] = []
        for point, value in batch:
            for name in self.reads.get(point, ()):
                reading, bit = self.readings[name], as_bit(value)
                if bit is not None and bit ^ self.signals[name].invert is reading.value and name not in before:
                    self.readings[name] = Reading(reading.value, now_seconds, Quality.GOOD, "", reading.coalesced)
                    self.unreadable.discard(name)
                    continue  # as most do that are polled
                before.setdefault(name, reading.value)
                if bit is None:
                    fault = self._lose(name, f"'{point}' shows {quoted(value)}, which is neither 0 nor 1")
                    faults += fault if name not in self.unreadable else []
                    self.unreadable.add(name)
                    continue
                self.unreadable.discard(name)
                bit ^= self.signals[name].invert
                if reading.value is not None and bit != reading.value:
                    edges[name] = edges.get(name, 0) + 1
                self.readings[name] = Reading(bit, now_seconds, Quality.GOOD, "", reading.coalesced)
            for name in self.counters.get(point, ()):
                if (number := as_number(value)) is not None:
                    counts[name] = number
        if not before and not counts:
            return [], faults
        changes = list(self._changes(before))
        told = {change.signal for change in changes}
        for name in {*edges, *counts}:
            passed = edges.get(name, 0)
            if name in counts:
                passed = max(passed, (counts[name] - self.counted.get(name, counts[name])) % COUNTER_MODULUS)
                self.counted[name] = counts[name]
            if (untold := passed - (name in told)) > 0:
                reading = self.readings[name]
                self.readings[name] = replace(reading, coalesced=reading.coalesced + untold)
        return changes, faults

    def lost(self, why: str, signals: Collection[str] | None = None) -> tuple[list[Change], list[str]]:
        """The device is lost, or shows some of its signals no more: follow the policy of each of them.

        Returns what changes, and which are faults.
        """
        gone = self.signals if signals is None else signals
        before = {name: self.readings[name].value for name in gone}
        faults = [fault for name in gone for fault in self._lose(name, why)]
        for name in gone:
            self.counted.pop(name, None)  # the device may count anew
            self.unreadable.discard(name)
        return list(self._changes(before)), faults

    def _changes(self, before: Mapping[str, bool | None]) -> Iterator[Change]:
        for name, was in before.items():
            shows = self.readings[name].value
            if shows is not None and shows != was:
                yield Change(name, shows)

    def _lose(self, name: str, why: str) -> list[str]:
        """Follow the loss policy of a signal; returns its name if that makes a fault, once for each reason."""
        reading, policy = self.readings[name], self.signals[name].on_loss
        match policy:
            case "hold":
                quality = Quality.BAD if reading.value is None else Quality.UNCERTAIN
                self.readings[name] = replace(reading, quality=quality, why=why)
            case "fault":
                self.readings[name] = replace(reading, quality=Quality.BAD, why=why)
                return [name] if reading.why != why else []  # else told at each poll
            case "0" | "1":
                self.readings[name] = replace(reading, value=policy == "1", quality=Quality.BAD, why=why)
        return []
