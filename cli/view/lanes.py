"""What each machine has done lately, as bars in a lane of its own (Gantt): from the command to its completion.

A bar begins when the command is sent and ends with the completion signal; where the place has none, the command is an
instant. If the token leaves before (a time limit, a jump of the operator), the bar ends unfinished. Of each machine the
last bars are kept, so a page that is opened later shows them too.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Final

from firable.nets.net import Net
from firable.semantics.joining import APPLIED
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged

BARS_MAX: Final = 60


class Lanes:
    """The lanes of a net's machines, kept up to date with the events of a run."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self.machines = list(dict.fromkeys(place.command.machine for place in net.places if place.command is not None))
        self.bars: dict[str, deque[dict[str, Any]]] = {name: deque(maxlen=BARS_MAX) for name in self.machines}
        self.under_way: dict[str, dict[str, Any]] = {}
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
                bar = {"place": name, "command": str(place.command), "from": at, "to": None, "end": "working"}
                self.bars[place.command.machine].append(bar)
                self.under_way[name] = bar
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
            bar["to"], bar["end"] = at, how

    def told(self) -> list[dict[str, Any]]:
        """All lanes."""
        return [{"machine": name, "bars": list(self.bars[name])} for name in self.machines]
