"""The monitor: are the machines doing what the model of them allows, as far as their signals show?

Everything that was proved of the cell *with* its machines was proved of the loop that `firable.nets.machines.closing`
makes of net and plant file. While the cell runs, that loop is held against it: the monitor keeps the *belief*, the set
of all markings of the loop that explain what has been seen so far, and a cell whose belief is empty does something
that the model excludes. This is the diagnoser of discrete event systems (Sampath et al., "Diagnosability of
discrete-event systems", 1995) with the belief tracked on line instead of compiled before: a compiled one has as many
states as there are sets of markings, of which a run meets few.

*Seen* are the firings, the commands sent and the signals taken; *hidden* is what machines, workpieces and sensors do by
themselves (`watched_loop.py`). A signal is taken later than it changed: on the way lie a driver, a link, a promise that
latches it. So what a signal is and what was taken of it may differ for `latency_seconds`, and no longer; so long it
may also have changed back by the time it is taken.

*Absence* is seen too, because a plant file has times: a command is done at the latest after its time and its jitter, or
when the station that it waits for has become free, and seen to be after the latency. A marking of the belief in which
the machine is still at it is then dropped, as one whose signal should have been taken by now; what is left, if
anything, explains the silence.

The first divergence is the last: a model that the cell has left says nothing of what follows. Rejected: a twin, the
simulated cell run beside the real one. It has one history where the belief has all, so it needs a tolerance for every
difference, and it does not know when workpieces come.

A pure machine: events with their times in, one divergence out, at the event that shows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from firable.executor.operating.watched_loop import REMEMBERED, Formed, Look, Move, WatchedLoop, Work
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Marking, Net
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged, Trace

LATENCY_SECONDS: Final = 0.5
"""How long after its change a signal is taken at the latest, unless a caller knows better."""

_NEVER: Final = -math.inf


@dataclass(frozen=True, slots=True)
class Divergence:
    """The machines did what the model excludes, or did not do what it demands.

    `subject` is the signal, command or transition that shows it, `places` those places of the cell with a token that
    it touches: that wait for the signal, command the machine, or were left or entered.
    """

    at_seconds: float
    subject: str
    message: str
    places: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """The divergence as JSON data."""
        return {
            "at_seconds": self.at_seconds,
            "subject": self.subject,
            "message": self.message,
            "places": list(self.places),
        }

    def __str__(self) -> str:
        touched = f" (touches {', '.join(self.places)})" if self.places else ""
        return f"{self.message}{touched}"


class _Demand(NamedTuple):
    """The command of a place must be done, or a signal taken, by a time."""

    due_seconds: float
    subject: str


_Demanded = tuple[list[tuple[str, Work]], list[tuple[int, str]], list[Look], list[Formed]]
"""The commands that must be done, by their places; the signals that must be taken; the cameras that must judge; the
completions that must be formed."""

_Belief = dict[Marking, tuple[float, ...]]
"""Each marking of the loop with, for each place in `WatchedLoop.timed`, when it last changed there; a signal, without
having been taken since."""


class Monitor:
    """The belief in a cell with the machines of a plant, from its beginning.

    At the stations of `elsewhere` others do what they like, who are not seen (`local_monitor.py`). Raises `InputError`
    F5003 where the plant does not fit the net.
    """

    def __init__(
        self,
        net: Net,
        model: PlantModel,
        *,
        latency_seconds: float = LATENCY_SECONDS,
        elsewhere: Collection[str] = (),
    ) -> None:
        self.net = net
        self.loop = WatchedLoop(net, model, elsewhere)
        self.signals = self.loop.signals
        self.completions = {place.completion for place in net.places if place.completion is not None}
        self.latency_seconds = latency_seconds
        self.is_held: Callable[[str], bool] = lambda _: False
        """Whether a promise keeps a signal as it was; until it ends no change of it is taken."""
        self.held: set[str] = set()
        self.freed_seconds = dict.fromkeys(self.signals, _NEVER)
        """When a promise on each signal was last seen."""
        self.taken = [bool(self.loop.initial & bit) == means for bit, means in self.loop.shown]
        self.taken_seconds: dict[str, float] = {}
        """When each signal was taken last."""
        self.demanded_in: dict[tuple[Marking, tuple[bool, ...]], _Demanded] = {}
        self.sent_seconds: dict[str, float] = {}
        self.marking = net.initial_marking
        self.divergence: Divergence | None = None
        """The first divergence; after it nothing is watched."""
        self.belief = self._closed({self.loop.initial: (_NEVER,) * len(self.loop.timed)}, 0.0)

    def seen(self, event: Event) -> Divergence | None:
        """An event of a trace; the divergence that it shows, if it is the first."""
        match event:
            case Fired(at, (transition,)):
                return self.fired(at, transition)
            case Fired():
                raise ValueError("a cell fires one transition at a time, and this is a trace of steps")
            case SignalChanged(at, name, value):
                return self.signal(at, name, value)
            case CommandSent(at, place):
                return self.sent(at, place)
            case Noted(at):
                return self.passed(at)

    def fired(self, at_seconds: float, transition: str) -> Divergence | None:
        """A transition of the cell has fired."""
        masks = self.net.masks[self.net.transition_index[transition]]
        self.marking = self.marking & ~masks.inputs | masks.outputs
        message = f"'{transition}' fired, and the machines cannot have been where it leaves them"
        entered = self.net.transition(transition).outputs
        return self._seen(at_seconds, self.loop.firing[transition], transition, message, entered)

    def sent(self, at_seconds: float, place: str) -> Divergence | None:
        """The command of a place was sent to its machine."""
        if self.divergence is not None:
            return None
        believed = self._closed(self.belief, at_seconds)
        refused = [move.says for move in self.loop.refusing[place] if any(map(move.firable, believed))]
        message = refused[0] if refused else f"'{self.net.place(place).command}' was sent where it cannot be"
        self.sent_seconds[place] = at_seconds
        return self._seen(at_seconds, self.loop.sending[place], place, message, (place,))

    def signal(self, at_seconds: float, name: str, value: bool) -> Divergence | None:
        """A controller has taken a new value of a signal, or cleared a completion by its command."""
        if self.divergence is not None:
            return None
        if self.passed(at_seconds) is not None:
            return self.divergence
        if name not in self.signals:
            return None
        s = self.signals.index(name)
        self.taken[s] = value
        if not value and name in self.completions:
            # The command that clears it follows; until then the bit differs from what was taken, and not for long.
            self.belief = {m: _changed_at(since, (s,), at_seconds) for m, since in self.belief.items()}
            return None
        bit, means = self.loop.shown[s]
        believed = self._closed(self.belief, at_seconds)
        may_be_late = name not in self.completions  # what a command has cleared is told of no more
        explained = {
            m: since
            for m, since in believed.items()
            if (bool(m & bit) == means) == value or (may_be_late and self._has_been(since[s], name, at_seconds))
        }
        self.taken_seconds[name] = at_seconds
        message = f"'{name}' became {int(value)}, and nothing that the machines can have done explains it"
        return self._believe(explained, at_seconds, name, message, self._waiting_for(name))

    def _has_been(self, changed_seconds: float, name: str, at_seconds: float) -> bool:
        """Whether a signal that has changed again may be taken only now: since it was taken last, and not long ago."""
        is_new = changed_seconds > self.taken_seconds.get(name, _NEVER)
        return is_new and at_seconds <= self._excused(changed_seconds, name) + self.latency_seconds

    def passed(self, at_seconds: float) -> Divergence | None:
        """Time has passed, and nothing was seen: what has become too late is left, one deadline after the other."""
        if self.divergence is not None:
            return None
        self._look_at_promises(at_seconds)
        while (due := self.deadline_seconds()) is not None and due < at_seconds:
            believed = self._closed(self.belief, due)  # what has not moved may move at the last moment
            late = {
                m: min((demand for demand in self._demands(m, since) if demand.due_seconds <= due), default=None)
                for m, since in believed.items()
            }
            left = {m: since for m, since in believed.items() if late[m] is None}
            first = min(filter(None, late.values()), default=None)
            self._believe(left, at_seconds, *(("", "", ()) if first is None else self._told(first)))
        return self.divergence

    def deadline_seconds(self) -> float | None:
        """When time alone can show a divergence; None: never, as long as nothing else is seen."""
        if self.divergence is not None:
            return None
        demands = (demand for marking, since in self.belief.items() for demand in self._demands(marking, since))
        due = min((demand.due_seconds for demand in demands), default=None)
        return None if due == math.inf else due

    def _seen(
        self, at_seconds: float, moves: Iterable[Move], subject: str, message: str, places: tuple[str, ...]
    ) -> Divergence | None:
        if self.divergence is not None:
            return None
        if self.passed(at_seconds) is not None:
            return self.divergence
        believed: _Belief = {}
        for marking, since in self._closed(self.belief, at_seconds).items():
            for move in moves:
                if move.firable(marking):
                    stamps = _changed_at(since, self.loop.timed_by(move), at_seconds)
                    self._add(believed, marking ^ move.flips, stamps)
        return self._believe(believed, at_seconds, subject, message, places)

    def _believe(
        self, belief: _Belief, at_seconds: float, subject: str, message: str, places: tuple[str, ...]
    ) -> Divergence | None:
        if not belief:
            self.divergence = Divergence(at_seconds, subject, message, self._with_token(places))
            return self.divergence
        self.belief = belief
        return None

    def _closed(self, belief: Mapping[Marking, tuple[float, ...]], at_seconds: float) -> _Belief:
        """The belief with everything that may have happened hidden, as late as it can have."""
        closed, open_ = dict(belief), dict.fromkeys(belief)
        while open_:
            marking, _ = open_.popitem()
            since = closed[marking]
            for changed, afters in self.loop.hidden_in(marking):
                stamps = _changed_at(since, changed, at_seconds)
                for after in afters:
                    if closed.get(after) != stamps and self._add(closed, after, stamps):
                        open_[after] = None
        return closed

    @staticmethod
    def _add(belief: _Belief, marking: Marking, since: tuple[float, ...]) -> bool:
        """Believe a marking; of two histories of it the later times count, which excuses more. Whether that is new."""
        known = belief.get(marking)
        merged = since if known is None else tuple(map(max, known, since))
        belief[marking] = merged
        return merged != known

    def _demands(self, marking: Marking, since: tuple[float, ...]) -> Iterator[_Demand]:
        """What must have happened by when, if the loop is in this marking."""
        works, signals, looks, formed = self._demanded(marking)
        for place, work in works:
            over = self.sent_seconds.get(place, 0.0) + work.longest_seconds
            if work.waits_while_empty:
                over = max(over, since[self.loop.timed.index(work.waits_while_empty)])
            completion = self.net.place(place).completion
            yield _Demand(self._excused(over, completion) + self.latency_seconds, place)
        for s, name in signals:
            yield _Demand(self._excused(since[s], name) + self.latency_seconds, name)
        for look in looks:
            begun = max(since[i] for i in look.timed)
            yield _Demand(begun + look.longest_seconds + self.latency_seconds, look.sensor)
        for one in formed:
            since_seconds = max(since[i] for i in one.timed)
            yield _Demand(self._excused(since_seconds, one.signal) + self.latency_seconds, one.signal)

    def _demanded(self, marking: Marking) -> _Demanded:
        """What must happen in a marking, whenever it came about."""
        key = (marking, tuple(self.taken))
        if (known := self.demanded_in.get(key)) is not None:
            return known
        works = [
            (place, work)
            for place, work in self.loop.work.items()
            if marking & work.busy and not (work.waits_while_empty and not marking & work.waits_while_empty)
        ]
        shown = [bool(marking & bit) == means for bit, means in self.loop.shown]
        signals = [(s, name) for s, name in enumerate(self.signals) if shown[s] != self.taken[s]]
        if len(self.demanded_in) >= REMEMBERED:
            self.demanded_in.clear()
        looks = [look for look in self.loop.looks if not marking & look.empty and not marking & look.verdicts]
        formed = [one for one in self.loop.formed if one.move.firable(marking)]
        self.demanded_in[key] = works, signals, looks, formed
        return self.demanded_in[key]

    def _look_at_promises(self, at_seconds: float) -> None:
        held = {name for name in self.signals if self.is_held(name)}
        for name in held | self.held:
            self.freed_seconds[name] = at_seconds
        self.held = held

    def _excused(self, since_seconds: float, signal: str | None) -> float:
        """Since when it has been possible to take a change: not as long as a promise holds the signal."""
        if signal in self.held:
            return math.inf
        return max(since_seconds, self.freed_seconds.get(signal, _NEVER)) if signal is not None else since_seconds

    def _told(self, missed: _Demand) -> tuple[str, str, tuple[str, ...]]:
        """Subject, message and places of a demand that was not met."""
        name = missed.subject
        if name not in self.loop.work:
            taken = int(self.taken[self.signals.index(name)])
            return name, f"'{name}' must be {1 - taken} by now, and is still {taken}", self._waiting_for(name)
        work = self.loop.work[name]
        latest = f"after {work.longest_seconds:g} s at the latest"
        if work.waits_while_empty:
            latest += ", or when the station that it waits for is free"
        sent = f"'{self.net.place(name).command}', sent at {self.sent_seconds.get(name, 0.0):.1f} s"
        message = f"{sent}, must be done {latest}, and nothing shows that it is"
        return name, message, (name,)

    def _waiting_for(self, signal: str) -> tuple[str, ...]:
        readers = [one for one in self.net.transitions if any(gate.signal == signal for gate in one.external)]
        waiting = [place.name for place in self.net.places if place.completion == signal]
        return tuple(dict.fromkeys((*waiting, *(name for one in readers for name in one.inputs))))

    def _with_token(self, places: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in places if self.marking >> self.net.place_index[name] & 1)


def _changed_at(since: tuple[float, ...], changed: Iterable[int], at_seconds: float) -> tuple[float, ...]:
    """The times with those of some indexes replaced."""
    for s in changed:
        since = (*since[:s], at_seconds, *since[s + 1 :])
    return since


def watch(monitor: Monitor, trace: Trace) -> Divergence | None:
    """Hold a whole trace against the model, from its first event to its last line; the first divergence, if any."""
    for event in trace.events:
        monitor.seen(event)
    if trace.end is not None:
        monitor.passed(trace.end.at_seconds)
    return monitor.divergence
