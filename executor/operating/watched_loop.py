"""The loop of a net and its machines, as the monitor asks it: masks over its markings, by what is seen of each.

`firable.nets.machines.closing` makes one net of a cell and its plant file. Of its transitions three kinds are *seen*:
the firings of the cell, in variants by what the machines do then, the commands that are sent, and those that are
refused because they end in an accident. All others are *hidden*: what machines, workpieces and sensors do by
themselves, and at the stations of `elsewhere` what machines do that nobody here sees. Of the places those are looked at
that say what a sensor shows, and that a machine is at a command, with how long that may take.

Which firing was open by which sensor is not asked again (the replay asks it): those gates are stripped, because a vote
may outlive its gate (O4). Those of completions stay, which only their command clears. A signal that is set from outside
shows nothing of the machines then, and would only double what is believed: it is left out.

The same markings are asked about again and again, so what may happen hidden in one is remembered, for a bounded number
of them. What is believed, and what time says, is the monitor's. Rejected: to ask the loop as a net. A belief has
hundreds of markings at each event, and a mask answers each in two operations.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Final

from firable.nets.machines.closing import close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import PLANT, Sending
from firable.nets.machines.plant_file import Carry, PlantModel, Put
from firable.nets.net import Marking, Net

REMEMBERED: Final = 10_000
"""For how many markings it is remembered what may happen in them, and what must."""


@dataclass(frozen=True, slots=True)
class Move:
    """A transition of the loop as masks over its places."""

    needs: Marking
    forbids: Marking
    flips: Marking
    says: str

    def firable(self, marking: Marking) -> bool:
        """Whether it may happen in a marking of the loop."""
        return marking & self.needs == self.needs and not marking & self.forbids


@dataclass(frozen=True, slots=True)
class Work:
    """A machine at a command: the place of the loop that says so, how long at most, and what it may wait for."""

    busy: Marking
    longest_seconds: float
    waits_while_empty: Marking
    """The place that says that the target is empty, if the command waits for it; no bit where it does not wait."""


@dataclass(frozen=True, slots=True)
class Look:
    """A camera: what says that nothing lies at its station, that it has judged, and how long that may take."""

    sensor: str
    """The first that shows what it finds."""
    empty: Marking
    verdicts: Marking
    longest_seconds: float
    timed: tuple[int, ...]
    """The indexes in `WatchedLoop.timed` of what begins a look when it changes."""


@dataclass(frozen=True, slots=True)
class Formed:
    """A completion of a command that was acknowledged before its sensor saw it: due as soon as the move is firable."""

    signal: str
    move: Move
    timed: tuple[int, ...]
    """The indexes in `WatchedLoop.timed` of what makes it so when it changes."""


Hidden = list[tuple[tuple[int, ...], tuple[Marking, ...]]]
"""The markings that hidden moves lead to, by the indexes in `WatchedLoop.timed` of the places that these change."""


class WatchedLoop:
    """The loop of a net and the machines of a plant; raises `InputError` F5003 where they do not fit."""

    def __init__(self, net: Net, model: PlantModel, elsewhere: Collection[str]) -> None:
        sensors = {name: sensor for name, sensor in model.sensors.items() if sensor.set_by is None}
        outside = model.sensors.keys() - sensors.keys()
        model = model.model_copy(update={"sensors": sensors})
        loop = close(_of_the_machines(net, outside), model, sending=Sending.LATE)
        laws = Laws(model, net)
        self.net = net
        self.index = loop.net.place_index
        self.initial = loop.net.initial_marking
        moves = {one.name: _compiled(loop.net, t) for t, one in enumerate(loop.net.transitions)}
        own = {variant for variants in loop.variants.values() for variant in variants}
        self.firing = {name: [moves[one] for one in variants] for name, variants in loop.variants.items()}
        """What may have happened when a transition of the cell fired."""
        unsent = {place: self._bit(name) for place, name in loop.unsent.items()}
        every_unsent = _union(unsent.values())
        sends = {name for name, move in moves.items() if name not in own and move.flips & every_unsent}
        self.sending: dict[str, list[Move]] = {place: [] for place in unsent}
        """What may have happened when the command of a place was sent."""
        self.refusing: dict[str, list[Move]] = {place: [] for place in unsent}
        """What says that it cannot be."""
        for place, bit in unsent.items():
            for name in sends:
                if moves[name].flips & bit:
                    (self.refusing if name in loop.accidents else self.sending)[place].append(moves[name])
        self.hidden = [m for name, m in moves.items() if name not in own | sends and name not in loop.accidents]
        """What happens unseen."""
        self.hidden += [move for station in elsewhere for move in self._by_others(laws, station)]
        self.signals = tuple(signal.name for signal in net.signals if signal.name in loop.shown)
        """All but timers: that a time is over says nothing of the machines."""
        self.shown = tuple((self._bit(place), means) for place, means in map(loop.shown.__getitem__, self.signals))
        """For each signal the place that says what it is, and the value that a token there means."""
        self.work = {place.name: self._work(laws, place.name, loop.at) for place in laws.commanding}
        waited = (work.waits_while_empty for work in self.work.values() if work.waits_while_empty)
        begun = {station: self._beginning(laws, station) for station in sorted(laws.judged)}
        shows = {
            signal: moves[f"{signal}/shown"] for signal in loop.acknowledged if not model.sensors[signal].may_flicker
        }
        showing = {signal: _bits((one.needs | one.forbids) & ~self._bit(signal)) for signal, one in shows.items()}
        others = dict.fromkeys((*waited, *chain.from_iterable((*begun.values(), *showing.values()))))
        self.timed = (*(bit for bit, _ in self.shown), *others)
        """The places of which it is kept when they last changed: those of the signals, then those waited for, those
        looked at, and those that form a completion."""
        self.looks = tuple(self._look(laws, station, bits) for station, bits in begun.items())
        self.formed = tuple(
            Formed(signal, one, tuple(map(self.timed.index, showing[signal]))) for signal, one in shows.items()
        )
        self._hidden_in: dict[Marking, Hidden] = {}
        self._timed_by: dict[Marking, tuple[int, ...]] = {}

    def hidden_in(self, marking: Marking) -> Hidden:
        """What may happen hidden in a marking."""
        if (known := self._hidden_in.get(marking)) is None:
            if len(self._hidden_in) >= REMEMBERED:
                self._hidden_in.clear()
            afters: dict[tuple[int, ...], dict[Marking, None]] = {}
            for move in self.hidden:
                if move.firable(marking):
                    afters.setdefault(self.timed_by(move), {})[marking ^ move.flips] = None
            known = self._hidden_in[marking] = [(changed, tuple(those)) for changed, those in afters.items()]
        return known

    def timed_by(self, move: Move) -> tuple[int, ...]:
        """The indexes in `timed` of the places that a move changes."""
        if (changed := self._timed_by.get(move.flips)) is None:
            changed = tuple(i for i, bit in enumerate(self.timed) if move.flips & bit)
            self._timed_by[move.flips] = changed
        return changed

    def _by_others(self, laws: Laws, station: str) -> Iterator[Move]:
        """What machines that are not seen may do at a station: each workpiece comes and goes, each sensor follows."""
        kinds = [self._bit(laws.has(station, kind)) for kind in laws.kinds]
        verdicts = (laws.verdict(station, good=good) for good in (True, False) if station in laws.judged)
        found = [0, *map(self._bit, verdicts)]
        ways = [self._bit(laws.empty(station)), *(kind | verdict for kind in kinds for verdict in found)]
        for before in ways:
            yield from (Move(before, after & ~before, before ^ after, "") for after in ways if after != before)
        for name, sensor in laws.model.sensors.items():
            if sensor.occupied == station and (sensor.may_flicker or sensor.may_linger):
                bit = self._bit(f"{PLANT}.{name}.sensor" if f"{PLANT}.{name}.sensor" in self.index else name)
                yield from (Move(bit, 0, bit, ""), Move(0, bit, bit, ""))

    def _bit(self, place: str) -> Marking:
        return 1 << self.index[place]

    def _work(self, laws: Laws, place: str, at: Mapping[str, str]) -> Work:
        action = laws.action(self.net.place(place))
        if place not in at:  # a stop at once
            return Work(0, math.inf, 0)
        target = None
        if isinstance(action, Carry | Put) and action.when_full == "wait":
            target = action.target if isinstance(action, Carry) else self._put_at(laws, place)
        waits = self._bit(laws.empty(target)) if target is not None else 0
        return Work(self._bit(at[place]), action.takes_s + action.jitter_s, waits)

    def _beginning(self, laws: Laws, station: str) -> list[Marking]:
        """The places that change where a workpiece comes, or becomes another and is judged no more."""
        names = [laws.empty(station), laws.has(station, laws.kinds[0])]
        return [self._bit(name) for name in (*names, *(laws.verdict(station, good=good) for good in (True, False)))]

    def _look(self, laws: Laws, station: str, begun: Collection[Marking]) -> Look:
        verdicts = _union(self._bit(laws.verdict(station, good=good)) for good in (True, False))
        sensors = {name: one for name, one in laws.model.sensors.items() if one.judges == station}
        longest = max(one.after_s for one in sensors.values())
        timed = tuple(self.timed.index(bit) for bit in begun)
        return Look(next(iter(sensors)), self._bit(laws.empty(station)), verdicts, longest, timed)

    def _put_at(self, laws: Laws, place: str) -> str | None:
        _, machine = laws.machine(self.net.place(place))
        command = self.net.place(place).command
        return machine.positions[dict(command.parameters)["at"]] if command is not None else None


def _of_the_machines(net: Net, outside: Collection[str]) -> Net:
    """A net without the signals that are set from outside, and with no gates but those of completions."""
    completions = {signal for place in net.places for signal in place.cleared}
    return replace(
        net,
        signals=tuple(signal for signal in net.signals if signal.name not in outside),
        transitions=tuple(
            replace(one, external=tuple(gate for gate in one.external if gate.signal in completions))
            for one in net.transitions
        ),
    )


def _compiled(net: Net, t: int) -> Move:
    masks = net.masks[t]
    return Move(
        masks.inputs | masks.permissive,
        masks.outputs | masks.inhibitive,
        masks.inputs | masks.outputs,
        net.transitions[t].description,
    )


def _union(masks: Iterable[int]) -> int:
    union = 0
    for mask in masks:
        union |= mask
    return union


def _bits(mask: Marking) -> list[Marking]:
    """The places of a mask, one by one."""
    return [1 << i for i in range(mask.bit_length()) if mask >> i & 1]
