"""Signals that change, and controllers that are told of them a moment later, of one after the other.

When a gripper closes, its hand is full, the station empty and the command done, in one firing of the loop. No wire
shows that at once: a controller is told one signal, may fire, and is told the next. What it does in between is in no
run in which all change together. So the loop has the moments in between: for a signal that is told *late* one place
says what its controller was told last, by which its gates go, and another one that there is news of it. It is told in a
firing of its own, sensors in any order and the completion behind those that see what its machine does: when a machine
says that it is done, or at rest, what it did can be seen, but for a sensor that may linger.

Meanwhile anything else may happen: the cell fires and sends commands, a workpiece comes, another machine gets done. But
a signal takes less time than a command: while a machine is at one there is a moment at which all is told. So a machine
that is given a command while there is news is *starting* until there is none, and does not get done before; nor before
a key is told of that its command has released. Of what a stop breaks off nothing is assumed. And a camera takes longer
to judge a workpiece than its controller to be told that it lies there, and that the one before was judged no more.

What closes a gate is told late, sensor or completion, also where nothing else changes, and a completion behind a sensor
that does. What only opens gates is told in the instant itself: who fires later for it could have waited. So is what
changes as a command is sent or done, where nobody who goes by the old value can be ready until the completion is told,
which comes behind it (`excluding.py`).

What is set from outside is told in the instant, whichever gate it closes: it may change at any time, whatever the cell
does, and nothing but gates goes by it. So what its controller is told late could have been set late, and whoever waits
until all is told is never kept waiting by it for good.

Rejected: to tell what closes a gate in the instant, too, where no sensor opens another one, as who fires before it is
told could have fired before the instant. The instant can be a firing of the cell, where a conveyor takes its workpiece:
who waits for the token that it leaves could not. And a command means something else before: a stop that comes when the
hand has closed leaves nothing undone. For the same reason a completion is told late where no sensor changes with it: a
time can be over when the hand has opened, and the stop leaves it open.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Final

from firable.nets.machines.excluding import Excluding
from firable.nets.machines.laws import Laws, fact
from firable.nets.machines.loop import PLANT
from firable.nets.machines.moment import Case, Literal, Moment, each
from firable.nets.machines.plant_file import Carry, Grasp, Index, Process, Put, Stop
from firable.nets.net import Place, SignalKind
from firable.nets.well_formed import as_name

Change = tuple[str, bool]
"""A signal, and the value that it changes to."""

_STILL: Final = "still-to-be-told"
_UNTOLD: Final = f"{PLANT}.untold"
"""The place that holds a token iff there is news, where that keeps a machine from getting done."""


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
    def from_outside(self) -> frozenset[str]:
        """The signals that somebody outside may set, and reset, at any time."""
        return frozenset(name for name, sensor in self.laws.model.sensors.items() if sensor.set_by is not None)

    @cached_property
    def late(self) -> tuple[str, ...]:
        """The signals that are told late in some firing, in the order of the net."""
        by_commands = ((changes, (place,)) for place in self.laws.commanding for changes in self._by(place))
        by_themselves = ((changes, ()) for changes in self._by_themselves())
        found = frozenset[str]().union(*(self.told_late(*one) for one in chain(by_commands, by_themselves)))
        found |= {name for name, seeing in self._seeing.items() if seeing & found}
        return tuple(signal.name for signal in self.laws.net.signals if signal.name in found)

    @cached_property
    def excluding(self) -> Excluding:
        """What cannot be ready until a controller is told that a command is done."""
        return Excluding(self.laws)

    def told_late(self, changes: Collection[Change], places: Collection[Place] = ()) -> frozenset[str]:
        """Which of some signals that change together are told late: those that each close a gate and are not set from
        outside, and completions behind them. `places` are those whose commands are sent then, or the one whose command
        is done, or goes on."""
        closing = {
            signal
            for signal, value in changes
            if (signal, not value) in self.wanted
            and signal not in self.from_outside
            and not any(self.excluding.excludes(place, signal, value=not value) for place in places)
        }
        behind = {signal for signal, _ in changes if closing and signal in self.completions}
        return frozenset(closing | behind)

    @cached_property
    def behind(self) -> dict[str, tuple[str, ...]]:
        """For each completion the sensors that may change with it, and that are told late: nothing of them is news when
        it is told."""
        return {name: tuple(one for one in self.late if one in seeing) for name, seeing in self._seeing.items()}

    @cached_property
    def _seeing(self) -> dict[str, set[str]]:
        """For each completion the sensors that may change with it."""
        found: dict[str, set[str]] = {}
        for place in self.laws.commanding:
            if place.completion is not None:
                found.setdefault(place.completion, set()).update(signal for signal, _ in self._effect(place))
        return found

    def _by(self, place: Place) -> Iterator[list[Change]]:
        """What changes together as the command of a place is sent, as its machine goes on, and as it is done."""
        match self.laws.action(place):
            case Carry(source=source):
                yield [*self._seen(source, self.laws.machine(place)[0])]
            case Index() as index:
                yield from self._indexed(index)
        yield self._done(place)

    def _done(self, place: Place) -> list[Change]:
        """What changes together when a command is done."""
        completed = [(place.completion, True)] if place.completion is not None else []
        return [*completed, *self._effect(place)]

    def _effect(self, place: Place) -> Iterator[Change]:
        name, _ = self.laws.machine(place)
        match self.laws.action(place):
            case Grasp():
                yield from self._seen(self.laws.station(place), name)
            case Put():
                yield from self._seen(name, self.laws.station(place))
            case Carry(target=target):
                yield from self._seen(name, target)
            case Index() as index:
                yield from chain.from_iterable(self._indexed(index))
            case Process(station=station):
                yield from ((signal, False) for signal in self._judging(station))
            case _:
                return

    def _by_themselves(self) -> Iterator[list[Change]]:
        """What changes together with no command: a completion when its sensor shows it, what a machine that is stopped
        still does, workpieces that come and go, cameras, keys, and sensors that are not exact."""
        model = self.laws.model
        yield from ([(name, True)] for name in self.completions if name in model.sensors)
        yield from ([*self._effect(place)] for places in self.laws.may_break_off.values() for place in places)
        yield [*self._seen(None, model.arrivals.station)]
        yield from ([*self._seen(departure.station, None)] for departure in model.departures)
        for signal in self.laws.net.signals:
            sensor = model.sensors.get(signal.name)
            if sensor is None or signal.name in self.completions:
                continue
            if sensor.by_hand or sensor.may_flicker or sensor.judges is not None:
                yield [(signal.name, True)]
            if sensor.by_hand or sensor.may_flicker or sensor.may_linger:
                yield [(signal.name, False)]

    def _indexed(self, index: Index) -> Iterator[list[Change]]:
        """What changes with each step of an index."""
        yield from ([*self._seen(station, None)] for station in index.following)
        yield from ([*self._seen(None, station)] for station in index.following.values())

    def _seen(self, source: str | None, target: str | None) -> Iterator[Change]:
        """What sensors see at once of a workpiece that goes from one to the other."""
        for signal in self.laws.net.signals:
            sensor = self.laws.model.sensors.get(signal.name)
            if sensor is None or signal.name in self.completions:
                continue
            sees = sensor.occupied or sensor.holding or ""
            if sees == target:
                yield signal.name, True
            if sees == source and not sensor.may_linger:
                yield signal.name, False
        if source is not None:
            yield from ((signal, False) for signal in self._judging(source))

    def _judging(self, station: str) -> Iterator[str]:
        """The sensors that show what a workpiece there was found; a completion that one of them forms stays."""
        for signal in self.laws.net.signals:
            sensor = self.laws.model.sensors.get(signal.name)
            if sensor is not None and sensor.judges == station and signal.name not in self.completions:
                yield signal.name

    @property
    def news(self) -> dict[str, str]:
        """For each signal that may be told late the place that says that there is news of it."""
        return {signal: _news(signal) for signal in self.late}

    @cached_property
    def starting(self) -> dict[str, str]:
        """For each machine the place that says that it is starting: that there was news when it was given the command
        that it is at, and has been ever since. None where nothing is told late, or where it is only stopped at once."""
        some = {self.laws.machine(place)[0] for place in self.laws.commanding if self.laws.lasts(place)}
        those = [name for name in self.laws.model.machines if self.late and name in some]
        return {name: f"{PLANT}.{as_name(name)}.starting" for name in those}

    # --- Its places and firings

    def shown(self, signal: str) -> Literal:
        """The place that shows what the controller of a signal knows of it, and whether a token there means 1."""
        return (_told(signal), True) if signal in self.late else self.truth[signal]

    def may_end(self, place: Place) -> Case:
        """The command of a place may end: its machine is no longer starting; nothing is news of keys that it has
        released, nor of what sees what a stop has broken off, where the machine says that it is at rest."""
        name, _ = self.laws.machine(place)
        before = {key for key, sensor in self.laws.model.sensors.items() if sensor.acknowledges == name}
        if isinstance(self.laws.action(place), Stop) and place.completion is not None:
            broken_off = self.laws.may_break_off.get(name, ())
            before |= {signal for one in broken_off for signal, _ in self._effect(one)}
        starting = ((self.starting[name], False),) if name in self.starting else ()
        return Case(starting).with_(self.is_told(*(signal for signal in self.late if signal in before)))

    def is_told(self, *signals: str) -> Case:
        """The controllers of some signals are still to be told nothing of them."""
        return Case(tuple((_news(signal), False) for signal in signals if signal in self.late))

    def is_seen(self, station: str) -> Case:
        """Controllers are still to be told nothing of whether a workpiece lies on a station, and what it was found."""
        there = (name for name, sensor in self.laws.model.sensors.items() if sensor.occupied == station)
        return self.is_told(*dict.fromkeys((*there, *self._judging(station))))

    def places(self) -> Iterator[Place]:
        """What controllers were told of signals that are told late, and of which there is news."""
        for signal in self.late:
            shows = signal not in self.completions and self.laws.sees_at_first(signal)
            yield fact(_told(signal), f"the controller was told that {signal} is 1", marked=shows)
            yield fact(_told(signal, value=False), f"the controller was told that {signal} is 0", marked=not shows)
            yield fact(_news(signal), f"{signal} has changed, and its controller is still to be told")
        if self.starting:
            yield fact(_UNTOLD, "a controller is still to be told of something")
        for name, starting in self.starting.items():
            yield fact(starting, f"{name} was given its command while a controller was still to be told of something")

    def moves(self) -> Iterator[tuple[str, str, tuple[Case, ...]]]:
        """For each signal that is told late the firing in which it is, its description, and its ways; for each machine
        the one in which it is starting no more.

        There is news of what is as the controller knows it where it was different in between. A sensor that may
        flicker may have dropped and come back before it fell, and more than once: all that is told after it fell.
        """
        for signal in self.late:
            place, means = self.truth[signal]
            sensor = self.laws.model.sensors.get(signal)
            news = _news(signal)
            wants = ((news, True), *((_news(other), False) for other in self.behind.get(signal, ())))
            ways = list[Case]()
            for value, word, was in ((True, "rises", "rose"), (False, "falls", "fell")):
                is_so, is_not = (place, means == value), (place, means != value)
                known, learns = _knows(signal, value=not value), _knows(signal, value=value)
                ways.append(Case((*wants, is_so, *known), ((news, False), *learns), word, f"now {value:d}"))
                if signal not in self.completions:
                    ways.append(Case((*wants, is_not, *known), learns, was, f"{value:d} a moment ago"))
                if not value and sensor is not None and sensor.may_flicker and signal not in self.completions:
                    ways.append(Case((*wants, is_so, *known), learns, "flickered", "0 a moment ago, and 1 since"))
            yield f"{signal}/told", f"the controller is told of {signal}", tuple(ways)
        for name, starting in self.starting.items():
            started = Case(((_UNTOLD, False), (starting, True)), ((starting, False),))
            yield f"{as_name(name)}/started", f"{name} is at its command, and all is told", (started,)

    def of(self, moment: Moment, places: Collection[Place] = ()) -> list[Moment]:
        """A firing with what controllers are told of it in the firing itself; what is told late is news.

        A completion that no sensor is told before is late or not, each time: what always is would be too late for every
        time limit, in runs that are fair to all that fires here. `places` are those of `told_late`.

        Of what was news already, and changes back, there is nothing more to tell, or all of it still; but a completion
        that the controller clears before it was told of it is over.
        """
        changes = dict(self._changes(moment))
        late = self.told_late([one for one in changes.items() if one[1] or one[0] not in self.completions], places)
        if not late <= {*self.late}:
            raise RuntimeError(f"{', '.join(sorted(late - {*self.late}))} may be told late, and was not expected to be")
        moments = [moment]
        for signal in sorted(changes, key=self.completions.__contains__):
            if signal not in self.late:
                continue
            news, value = _news(signal), changes[signal]
            told = Case(((news, False), *_knows(signal, value=not value)), _knows(signal, value=value))
            later = Case(((news, False),), ((news, True),))
            behind = self.behind.get(signal, ()) if value else ()
            at_once = told.with_(self.is_told(*behind))
            ways = [later] if signal in late else [at_once, *self._behind(signal, later, behind)]
            if late == {signal} and signal in self.completions:
                ways = [at_once, replace(later, tag=f"{signal}-late")]
            ways.append(Case(((news, True), *_knows(signal, value=value)), ((news, False),), f"{signal}-untold"))
            if signal not in self.completions:
                ways.append(Case(((news, True),), (), f"{signal}-{_STILL}"))
            moments = each(moments, ways)
        return [one for moment in moments for one in self._with_news(moment)] if self.starting else moments

    def _with_news(self, moment: Moment) -> list[Moment]:
        """A firing with whether there is news before and after it: the first of all or more, the last or not."""
        known = [news for news in self.news.values() if news in moment.after]
        if not any(moment.before[news] for news in known):
            first, more = Case(((_UNTOLD, False),), ((_UNTOLD, True),)), Case(((_UNTOLD, True),), (), "more")
            return each([moment], [first, more]) if any(moment.after[news] for news in known) else [moment]
        untold = (_UNTOLD, True)
        if any(moment.after[news] for news in known):
            return each([moment], [Case((untold,))])
        none, ways = list[Literal](), []
        for signal, news in self.news.items():
            ways.append(Case((untold, *none, (news, True)), (), f"not-yet-{signal}"))
            none.append((news, False))
        return each([moment], [Case((untold, *none), ((_UNTOLD, False),)), *ways])

    def _behind(self, signal: str, later: Case, sensors: Iterable[str]) -> Iterator[Case]:
        """A completion is told later where there is news of one of some sensors first."""
        before = list[Literal]()
        for one in sensors:
            yield later.with_(Case((*before, (_news(one), True)), tag=f"{signal}-behind-{one}"))
            before.append((_news(one), False))

    def sent(self, moment: Moment, places: Iterable[Place]) -> list[Moment]:
        """A firing, with what controllers are told of it, in which machines take the commands of some places in turn.

        A machine is starting where there is news then, but at a stop at once; at the command before it was, or was not.
        What it is given last in one firing is what it is at: to it the commands before are none.
        """
        moments, last = [moment], {self.laws.machine(place)[0]: place for place in places}
        for name, place in last.items():
            if (starting := self.starting.get(name)) is None:
                continue
            moments = each(moments, [Case(((starting, False),)), *self._was_starting(name, moment)])
            if self.laws.lasts(place):
                tag = "" if _UNTOLD in moment.after else f"{name}-starts"
                starts = Case(((_UNTOLD, True), (starting, False)), ((starting, True),), tag)
                moments = each(moments, [Case(((_UNTOLD, False),)), starts])
        return moments

    def _was_starting(self, name: str, moment: Moment) -> Iterator[Case]:
        if not moment.before.get(self.laws.idle(name)):
            yield Case(((self.starting[name], True),), ((self.starting[name], False),), f"{name}-starting")

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
