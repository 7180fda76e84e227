"""What each machine has done lately, as bars in a lane of its own (Gantt): from the command to its completion.

A bar begins when the command is sent and ends with the completion signal; where the place has none, the command is an
instant. If the token leaves before (a time limit, a jump of the operator), the bar ends unfinished. Of each machine the
last bars are kept, so a page that is opened later shows them too; one that follows is told the bars that have changed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Final

from firable.nets.net import Net
from firable.semantics.joining import APPLIED
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged

BARS_MAX: Final = 60


@dataclass(slots=True)
class Bar:
    """A command of a machine: from when to when, and how it ended."""

    number: int
    machine: str
    command: str
    began: float
    ended: float | None = None
    how: str = "working"
    change: int = 0
    """The change of the lanes with which it came to be as it is."""

    def to_json(self) -> dict[str, Any]:
        """As the page reads it."""
        return {
            "number": self.number,
            "machine": self.machine,
            "command": self.command,
            "from": self.began,
            "to": self.ended,
            "end": self.how,
        }


class Lanes:
    """The lanes of a net's machines, kept up to date with the events of a run."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self.machines = list(dict.fromkeys(place.command.machine for place in net.places if place.command is not None))
        self.bars: dict[str, deque[Bar]] = {name: deque(maxlen=BARS_MAX) for name in self.machines}
        self.numbered = 0
        self.changes = 0
        self.under_way: dict[str, Bar] = {}
        """The bars that have not ended, by their places."""
        self.waiting_for: dict[str, set[str]] = {}
        """The places whose command a signal completes."""
        for place in net.places:
            if place.command is not None and place.completion is not None:
                self.waiting_for.setdefault(place.completion, set()).add(place.name)

    def seen(self, event: Event) -> None:
        """An event of the run."""
        match event:
            case CommandSent(at, name) if name in self.net.place_index:
                place = self.net.place(name)
                if place.command is None:
                    return
                self.numbered += 1
                bar = Bar(self.numbered, place.command.machine, str(place.command), at)
                self.bars[bar.machine].append(bar)
                self.under_way[name] = bar
                self._changed(bar)
                if place.completion is None:
                    self._end(name, at, "instant")
            case SignalChanged(at, signal, True):
                for name in self.waiting_for.get(signal, ()):
                    self._end(name, at, "done")
            case Fired(at, names):
                self._left(at, names)
            case Noted(at, note, {"transition": str(name)}) if note == APPLIED:  # a part of it, of a host among others
                self._left(at, (name,))

    def _left(self, at: float, transitions: tuple[str, ...]) -> None:
        for transition in transitions:
            if transition in self.net.transition_index:
                for name in self.net.transition(transition).inputs:
                    self._end(name, at, "left")

    def _end(self, place: str, at: float, how: str) -> None:
        if (bar := self.under_way.pop(place, None)) is not None:
            bar.ended, bar.how = at, how
            self._changed(bar)

    def _changed(self, bar: Bar) -> None:
        self.changes += 1
        bar.change = self.changes

    def since(self, change: int) -> list[dict[str, Any]]:
        """The bars that have changed after a change, by their numbers."""
        found = (bar for bars in self.bars.values() for bar in bars if bar.change > change)
        return [bar.to_json() for bar in sorted(found, key=lambda bar: bar.number)]
