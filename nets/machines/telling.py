"""Signals that change, and controllers that are told of them a moment later, of one after the other.

When a gripper closes, its hand is full, the station empty and the command done, in one firing of the loop. No wire
shows that at once: a controller is told one signal, may fire, and is told the next. What it does in between is in no
run in which all change together. So the loop has the moments in between: for a signal that is told *late* one place
says what its controller was told last, by which its gates go, and another one that there is news of it. It is told in a
firing of its own, sensors in any order and the completion behind them: when a machine says that it is done, what it did
can be seen, but for a sensor that may linger. Meanwhile the cell may fire and send commands, and somebody outside may
press a key or set a signal; nothing happens at the machines before all is told, since a signal takes less time than a
machine.

A sensor that closes a gate is told late, also where nothing else changes, and completions behind it. What only opens
gates is told in the instant itself: who fires later for it could have waited. So is a completion with which no sensor
changes: it says that its machine was done some time ago.

Rejected: to tell what closes a gate in the instant, too, where no sensor opens another one, as who fires before it is
told could have fired before the instant. The instant can be a firing of the cell, where a conveyor takes its workpiece:
who waits for the token that it leaves could not. And a command means something else before: a stop that comes when the
hand has closed leaves nothing undone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Final

from firable.nets.machines.laws import Laws, fact
from firable.nets.machines.loop import PLANT
from firable.nets.machines.moment import Case, Literal, Moment, each
from firable.nets.machines.plant_file import Carry, Grasp, Process, Put
from firable.nets.net import Place, SignalKind

Change = tuple[str, bool]
"""A signal, and the value that it changes to."""

_STILL: Final = "still-to-be-told"


@dataclass(frozen=True)
class Telling:
    """How the signals of a net reach its controllers.

    `truth` has for each signal, timers apart, the place that shows what it is, and whether a token there means 1.
    """

    laws: Laws
    truth: Mapping[str, Literal]

    @cached_property
    def wanted(self) -> frozenset[Change]:
        """The values that gates want of signals."""
        return frozenset((gate.signal, gate.wanted) for t in self.laws.net.transitions for gate in t.external)

    @cached_property
    def completions(self) -> frozenset[str]:
        """The signals that a controller clears by itself, when it sends the command that will set them."""
        return frozenset(one.name for one in self.laws.net.signals if one.kind is SignalKind.COMPLETION)

    @cached_property
    def late(self) -> tuple[str, ...]:
        """The signals that are told late in some firing, in the order of the net."""
        alone = ([(signal, value)] for signal in {*self.truth} - self.completions for value in (True, False))
        found = frozenset[str]().union(*map(self.told_late, chain(alone, self._completed())))
        return tuple(signal.name for signal in self.laws.net.signals if signal.name in found)

    def told_late(self, changes: Collection[Change]) -> frozenset[str]:
        """Which of some signals that change together are told late: those that each close a gate, and completions
        behind them; but a completion with which no sensor changes is told at once."""
        changed = {signal for signal, _ in changes}
        closing = {signal for signal, value in changes if (signal, not value) in self.wanted}
        if not closing or changed <= self.completions:
            return frozenset()
        return frozenset(closing | changed & self.completions)

    def _completed(self) -> Iterator[list[Change]]:
        """What changes together with each completion."""
        for place in self.laws.commanding:
            if place.completion is None:
                continue
            name, _ = self.laws.machine(place)
            match self.laws.action(place):
                case Grasp():
                    seen = [*self._seen(self.laws.station(place), name)]
                case Put():
                    seen = [*self._seen(name, self.laws.station(place))]
                case Carry(target=target):
                    seen = [*self._seen(name, target)]
                case Process(station=station):
                    seen = [(signal, False) for signal in self._judging(station)]
                case _:
                    continue
            yield [(place.completion, True), *seen]

    def _seen(self, source: str | None, target: str | None) -> Iterator[Change]:
        """What sensors see at once of a workpiece that goes from one to the other."""
        for signal in self.laws.net.signals:
            sensor = self.laws.model.sensors.get(signal.name)
            if sensor is None or signal.name in self.completions or sensor.by_hand:
                continue
            sees = sensor.occupied or sensor.holding or ""
            if sees == target:
                yield signal.name, True
            if sees == source and not sensor.may_linger:
                yield signal.name, False
        if source is not None:
            yield from ((signal, False) for signal in self._judging(source))

    def _judging(self, station: str) -> dict[str, bool]:
        """The signals that show what a workpiece there was found, and whether that is good."""
        sensors = self.laws.model.sensors
        read = (signal.name for signal in self.laws.net.signals if signal.name in sensors)
        return {name: sensors[name].passes is not None for name in read if sensors[name].judges == station}

    @property
    def news(self) -> dict[str, str]:
        """For each signal that may be told late the place that says that there is news of it."""
        return {signal: _news(signal) for signal in self.late}

    # --- Its places and firings

    def shown(self, signal: str) -> Literal:
        """The place that shows what the controller of a signal knows of it, and whether a token there means 1."""
        return (_told(signal), True) if signal in self.late else self.truth[signal]

    @property
    def all_told(self) -> Case:
        """No controller is still to be told anything."""
        return Case(tuple((news, False) for news in self.news.values()))

    def is_told(self, signal: str) -> Case:
        """The controller of a signal is still to be told nothing of it."""
        return Case(((_news(signal), False),) if signal in self.late else ())

    def places(self) -> Iterator[Place]:
        """What controllers were told of signals that are told late, and of which there is news."""
        for signal in self.late:
            yield fact(_told(signal), f"the controller was told that {signal} is 1")
            yield fact(_told(signal, value=False), f"the controller was told that {signal} is 0", marked=True)
            yield fact(_news(signal), f"{signal} has changed, and its controller is still to be told")

    def moves(self) -> Iterator[tuple[str, str, tuple[Case, ...]]]:
        """For each signal that is told late the firing in which it is, its description, and its ways.

        There is news of what is as the controller knows it where it was different in between.
        """
        for signal in self.late:
            place, means = self.truth[signal]
            news = _news(signal)
            before = [other for other in self.late if signal in self.completions and other not in self.completions]
            wants = ((news, True), *((_news(other), False) for other in before))
            ways = list[Case]()
            for value, word, was in ((True, "rises", "rose"), (False, "falls", "fell")):
                is_so, is_not = (place, means == value), (place, means != value)
                known, learns = _knows(signal, value=not value), _knows(signal, value=value)
                ways.append(Case((*wants, is_so, *known), ((news, False), *learns), word, f"now {value:d}"))
                if signal not in self.completions:
                    ways.append(Case((*wants, is_not, *known), learns, was, f"{value:d} a moment ago"))
            yield f"{signal}/told", f"the controller is told of {signal}", tuple(ways)

    def of(self, moment: Moment) -> list[Moment]:
        """A firing with what controllers are told of it in the firing itself; what is told late is news.

        Of what was news already, and changes back, there is nothing more to tell, or all of it still; but a completion
        that the controller clears before it was told of it is over.
        """
        changes = dict(self._changes(moment))
        late = self.told_late([one for one in changes.items() if one[1] or one[0] not in self.completions])
        moments = [moment]
        for signal, value in changes.items():
            if signal not in self.late:
                continue
            news = _news(signal)
            at_once = Case(((news, False), *_knows(signal, value=not value)), _knows(signal, value=value))
            later = Case(((news, False),), ((news, True),))
            ways = [later if signal in late else at_once]
            ways.append(Case(((news, True), *_knows(signal, value=value)), ((news, False),), f"{signal}-untold"))
            if signal not in self.completions:
                ways.append(Case(((news, True),), (), f"{signal}-{_STILL}"))
            moments = each(moments, ways)
        return moments

    def _changes(self, moment: Moment) -> Iterator[Change]:
        for signal, (place, means) in self.truth.items():
            if place in moment.before and moment.before[place] != moment.after[place]:
                yield signal, moment.after[place] == means


def _told(signal: str, *, value: bool = True) -> str:
    """The place that holds a token iff the controller was told last that a signal is 1, or that it is 0."""
    return f"{PLANT}.{signal}.told_{int(value)}"


def _knows(signal: str, *, value: bool) -> tuple[Literal, Literal]:
    """What the controller was told last of a signal; with two places, no firing that tells it is ever in contact."""
    return (_told(signal), value), (_told(signal, value=False), not value)


def _news(signal: str) -> str:
    """The place that holds a token iff a signal has changed since its controller was told."""
    return f"{PLANT}.{signal}.news"
