"""The laws of the plant as cases: what each command wants when it is sent, what it does when it is done.

These are the laws that the simulated cell obeys (`firable.executor.cell.plant`), without times: each station and each
hand holds a workpiece or none; a machine is idle or at one command; a hand is at one position; a station is clamped or
not. Each of these facts is a place, and what has one of several values is *one-hot*: a place for each value, so that
each condition is one gate. What cannot be done (laying a workpiece on another, a command to a busy machine) is an
*accident*.

A command acts at two instants. It is *sent*: what it wants is checked, and a conveyor takes its workpiece. It is
*done*: the effect, and its completion bit, formed with the sensor of that name where the plant has one. Between them
lies any time. A stop at once leaves undone what the machine is at. One that lasts *breaks it off*: until the machine
has come to rest that may still have its effect, unacknowledged, or end in its accident.

An index moves many workpieces at once, each of which may be there or not: as one firing that would be a way for each
set of them. So they are taken one after the other once it is sent, and then laid down one after the other before it is
done, in *steps* of the machine. It is steady before and after; in between nobody else may lay anything down there.

Workpieces are told apart by one bit, whether they were machined; simulation has identities, which would make the number
of markings grow with the number of workpieces and which no law asks for. On a station that a sensor judges by `passes`
or `fails` a workpiece is found good or not some time after it has come, and anew after it was machined there; which of
the two nobody knows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from firable.nets.machines.loop import ACCIDENT, OVERRUN, PLANT
from firable.nets.machines.moment import Case, Literal
from firable.nets.machines.plant_file import (
    Action,
    Carry,
    Clamp,
    Departure,
    Grasp,
    Index,
    Machine,
    Move,
    PlantModel,
    Process,
    Put,
    Release,
    Stop,
    Switch,
    Work,
)
from firable.nets.net import Command, Net, Place
from firable.nets.well_formed import as_name

_RAW, _MACHINED = "raw", "machined"


@dataclass(frozen=True)
class Laws:
    """The laws of one plant for the commands of one net; places are named by what they say of the plant."""

    model: PlantModel
    net: Net

    # --- The facts and their places

    @cached_property
    def commanding(self) -> tuple[Place, ...]:
        """The places that send a command."""
        return tuple(place for place in self.net.places if place.command is not None)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What a workpiece can be."""
        return (_RAW, _MACHINED) if self.model.machines_workpieces else (_RAW,)

    @cached_property
    def clamps(self) -> frozenset[str]:
        """The stations where a workpiece can be clamped, or would have to be."""
        return frozenset(
            action.station
            for machine in self.model.machines.values()
            for action in machine.commands.values()
            if isinstance(action, (Clamp, Process, Release))
        )

    @cached_property
    def judged(self) -> frozenset[str]:
        """The stations where a workpiece is found good, or not."""
        return frozenset(sensor.judges for sensor in self.model.sensors.values() if sensor.judges is not None)

    def sees_at_first(self, signal: str) -> bool:
        """Whether the sensor of a signal sees a workpiece as long as nothing has happened."""
        sensor = self.model.sensors.get(signal)
        return sensor is not None and sensor.occupied in self.model.full_at_first

    def machine(self, place: Place) -> tuple[str, Machine]:
        """The machine that a place commands."""
        name = _command(place).machine
        return name, self.model.machines[name]

    def action(self, place: Place) -> Action:
        """What the command of a place does."""
        return self.machine(place)[1].commands[_command(place).command]

    def lasts(self, place: Place) -> bool:
        """Whether the machine is at the command of a place for a while: not where it switches an output, nor stops at
        once and nobody waits for the end."""
        action = self.action(place)
        if isinstance(action, Switch):
            return False
        return not isinstance(action, Stop) or place.completion is not None or action.takes_s + action.jitter_s > 0

    def busy(self, place: Place) -> str:
        """The place that says that the machine is at the command of a place of the cell."""
        return f"{PLANT}.{as_name(_command(place).machine)}.at.{place.name}"

    def idle(self, machine: str) -> str:
        """The place that says that a machine is at no command."""
        return f"{PLANT}.{as_name(machine)}.idle"

    @cached_property
    def may_break_off(self) -> dict[str, tuple[Place, ...]]:
        """For each machine that a stop brings to rest in some time, the places whose commands it breaks off: those that
        still do something when they are done."""
        found = {}
        for machine in self.model.machines:
            own = [(place, self.action(place)) for place in self.commanding if self.machine(place)[0] == machine]
            if any(isinstance(action, Stop) and self.lasts(place) for place, action in own):
                found[machine] = tuple(place for place, action in own if not isinstance(action, (Stop, Switch, Work)))
        return {machine: places for machine, places in found.items() if places}

    def breaks_off(self, place: Place) -> str:
        """The place that says that the command of a place was broken off by a stop, and may still be done."""
        return f"{PLANT}.{as_name(_command(place).machine)}.breaks_off.{place.name}"

    def breaks_off_nothing(self, machine: str) -> str:
        """The place that says that nothing that was broken off at a machine may still be done."""
        return f"{PLANT}.{as_name(machine)}.breaks_off_nothing"

    @cached_property
    def indexing(self) -> dict[str, dict[str, Index]]:
        """For each machine that the net lets index, the commands by which it does."""
        found: dict[str, dict[str, Index]] = {}
        for place in self.commanding:
            if isinstance(action := self.action(place), Index):
                found.setdefault(self.machine(place)[0], {})[_command(place).command] = action
        return {name: found[name] for name in self.model.machines if name in found}

    def indexed_by(self, *stations: str) -> tuple[str, ...]:
        """The machines of which one of some stations moves as they index."""
        return tuple(name for name in self.indexing if not self.model.machines[name].indexes.isdisjoint(stations))

    def steady(self, machine: str) -> str:
        """The place that says that a machine which can index is not in the midst of that."""
        return f"{PLANT}.{as_name(machine)}.steady"

    def step(self, machine: str, command: str, does: str, station: str) -> str:
        """The place that says that a machine which indexes `takes` next what lies on a station, or `lays` it down."""
        return f"{PLANT}.{as_name(machine)}.{as_name(command)}.{does}.{as_name(station)}"

    def taken_from(self, machine: str, station: str, kind: str = "nothing") -> str:
        """The place that says of which kind the workpiece is that a machine has from a station as it indexes."""
        return f"{PLANT}.{as_name(machine)}.from.{as_name(station)}.{kind}"

    def hand_at(self, machine: str, position: str) -> str:
        """The place that says where a hand is."""
        return f"{PLANT}.{as_name(machine)}.hand_at.{as_name(position)}"

    def empty(self, holder: str) -> str:
        """The place that says that a station is empty, or that a machine holds nothing."""
        return f"{PLANT}.{as_name(holder)}.{'holds_nothing' if holder in self.model.machines else 'empty'}"

    def has(self, holder: str, kind: str) -> str:
        """The place that says that a station or a machine has a workpiece of a kind."""
        return f"{PLANT}.{as_name(holder)}.{'holds_' if holder in self.model.machines else ''}{kind}"

    def clamped(self, station: str) -> str:
        """The place that says that the workpiece on a station is clamped."""
        return f"{PLANT}.{as_name(station)}.clamped"

    def verdict(self, station: str, *, good: bool) -> str:
        """The place that says that the workpiece on a station was found good, or that it was not."""
        return f"{PLANT}.{as_name(station)}.{'passes' if good else 'fails'}"

    def places(self) -> Iterator[Place]:
        """The places of machines and stations, as they are when all is at rest and no workpiece has come."""

        def holding(holder: str) -> Iterator[Place]:
            held, first = holder in self.model.machines, self.model.full_at_first.get(holder)
            yield fact(self.empty(holder), f"{holder} {'holds nothing' if held else 'is empty'}", marked=not first)
            for kind in self.kinds:
                words = f"{holder} holds a {kind} workpiece" if held else f"a {kind} workpiece lies on {holder}"
                yield fact(self.has(holder, kind), words, marked=kind == first)

        for name, machine in self.model.machines.items():
            yield fact(self.idle(name), f"{name} is idle", marked=True)
            for place in self.commanding:
                if _command(place).machine == name:
                    yield fact(self.busy(place), f"{name} is at {_words(place)}")
            if broken_off := self.may_break_off.get(name, ()):
                yield fact(self.breaks_off_nothing(name), f"{name} breaks off nothing", marked=True)
                for place in broken_off:
                    words = f"{name} breaks off {_words(place)}, which may still be done"
                    yield fact(self.breaks_off(place), words)
            for position in machine.positions if machine.hand is not None else ():
                yield fact(
                    self.hand_at(name, position),
                    f"the hand of {name} is at {position}",
                    marked=position == machine.hand,
                )
            if machine.holds:
                yield from holding(name)
            if name in self.indexing:
                yield from self._index_places(name)
        for station in self.model.stations:
            yield from holding(station)
            if station in self.clamps:
                yield fact(self.clamped(station), f"the workpiece on {station} is clamped")
            if station in self.judged:
                yield fact(self.verdict(station, good=True), f"the workpiece on {station} was found good")
                yield fact(self.verdict(station, good=False), f"the workpiece on {station} was not found good")
        yield fact(OVERRUN, "a machine was given a command while it was at another")
        yield fact(ACCIDENT, "something happened that must not")

    def _index_places(self, name: str) -> Iterator[Place]:
        yield fact(self.steady(name), f"{name} is not in the midst of an index", marked=True)
        for command, index in self.indexing[name].items():
            for at in index.following:
                yield fact(self.step(name, command, "takes", at), f"{name} is to take what lies on {at}")
            for at, to in index.following.items():
                yield fact(self.step(name, command, "lays", at), f"{name} is to lay what lay on {at} on {to}")
        for at in dict.fromkeys(at for index in self.indexing[name].values() for at in index.following):
            yield fact(self.taken_from(name, at), f"{name} has nothing from {at}", marked=True)
            for kind in self.kinds:
                yield fact(self.taken_from(name, at, kind), f"{name} has a {kind} workpiece from {at}")

    # --- A command is sent

    def sent(self, place: Place) -> Iterator[Case]:
        """The ways in which a machine can take the command of a place."""
        name, action = self.machine(place)[0], self.action(place)
        if isinstance(action, Stop):
            yield from self._stopped(name, place)
            return
        free = ((self.idle(name), True), (self.busy(place), False))
        taken = ((self.idle(name), False), (self.busy(place), True))
        match action:
            case Grasp():
                yield Case((*free, (self._hand(place), True), (self.empty(name), True)), taken)
            case Put():
                yield Case((*free, (self._hand(place), True), (self.empty(name), False)), taken)
            case Carry(source=source):
                yield from (Case(free, taken).with_(moved) for moved in self._moved(source, name))
                yield Case(
                    (*free, (self.empty(name), False)), taken, f"{name}-goes-on", f"{name} still has its workpiece"
                )
            case Process(station=station):
                yield Case((*free, (self.clamped(station), True), (self.has(station, _RAW), True)), taken)
            case Index() as index:
                steady, first = self.steady(name), self.steps(place)[0]
                loose = tuple((self.clamped(at), False) for at in index.following if at in self.clamps)
                calm = tuple((self.steady(other), True) for other in self._beside(name))
                wants = (*free, (steady, True), (first, False), *loose, *calm)
                yield Case(wants, (*taken, (steady, False), (first, True)))
            case Switch():
                yield Case(((self.idle(name), True),))
            case _:
                yield Case(free, taken)

    def _beside(self, machine: str) -> tuple[str, ...]:
        """The other machines that index at one of the same stations."""
        return tuple(other for other in self.indexed_by(*self.model.machines[machine].indexes) if other != machine)

    def _stopped(self, name: str, place: Place) -> Iterator[Case]:
        """Whatever a machine is at ends, or is broken off; then it is at the stop for a while, or idle at once."""
        idle, now_at = self.idle(name), self.busy(place) if self.lasts(place) else None
        free: tuple[Literal, ...] = () if now_at is None else ((now_at, False),)
        rest = ((now_at, True), (idle, False)) if now_at is not None else ((idle, True),)
        yield Case(((idle, True), *free), rest, f"{name}-idle")
        for other in self.commanding:
            at = self.busy(other)
            if self.machine(other)[0] != name or not self.lasts(other):
                continue
            to_come = f"{name} is still to come to rest"
            if at == now_at:
                yield Case(((at, True), (idle, False)), tag=f"{name}-stops", says=to_come)
                continue
            stops = Case(((at, True), (idle, False), *free), ((at, False), *rest), f"stops-{other.name}")
            if not isinstance(self.action(other), Stop):
                yield stops.with_(self._broken_off(other) if now_at is not None else self._undone(other))
            elif now_at is None:
                yield from map(stops.with_, self._at_rest(name))
            else:
                yield stops.with_(Case(says=to_come))

    def _undone(self, place: Place) -> Case:
        return Case(says=f"{self.machine(place)[0]} leaves {_words(place)} undone")

    def _broken_off(self, place: Place) -> Case:
        """A machine that comes to rest in some time may still do what it was at."""
        name = self.machine(place)[0]
        if place not in self.may_break_off.get(name, ()):
            return self._undone(place)
        words = f"{name} breaks off {_words(place)}"
        return Case(self._breaking_off(place, so=False), self._breaking_off(place, so=True), says=words)

    def no_longer_broken_off(self, place: Place) -> Case:
        """What a machine has broken off is over: it is done, spoiled, or left undone."""
        return Case(self._breaking_off(place, so=True), self._breaking_off(place, so=False))

    def _breaking_off(self, place: Place, *, so: bool) -> tuple[Literal, Literal]:
        """What says that the command of a place is broken off, or that none is."""
        return (self.breaks_off(place), so), (self.breaks_off_nothing(self.machine(place)[0]), not so)

    def _at_rest(self, name: str) -> Iterator[Case]:
        """A machine has come to rest: what was broken off is never done."""
        if name not in self.may_break_off:
            yield Case()
            return
        yield Case(((self.breaks_off_nothing(name), True),))
        for place in self.may_break_off[name]:
            yield self.no_longer_broken_off(place).with_(self._undone(place)).with_(Case(tag=f"undone-{place.name}"))

    def refused(self, place: Place, *, again: bool = False) -> Iterator[Case]:
        """The accidents that sending the command of a place can be: each wants that none before it happens.

        `again` says that the same firing has sent the machine a command before.
        """
        name, action = self.machine(place)[0], self.action(place)
        if isinstance(action, Stop):
            return
        idle: Literal = (self.idle(name), True)
        told = f"{name} is given {_words(place)}"
        busy = f"{name}-busy-{place.name}" if again else f"{name}-busy"  # the one before can be refused, too
        yield self._accident(((idle[0], False),), busy, f"{told} while it is at another command", OVERRUN)
        match action:
            case Grasp() | Put():
                at: Literal = (self._hand(place), True)
                takes = isinstance(action, Grasp)
                yield self._accident((idle, (at[0], False)), f"{name}-elsewhere", f"{told}, and its hand is elsewhere")
                yield self._accident(
                    (idle, at, (self.empty(name), not takes)),
                    f"{name}-{'holds' if takes else 'empty'}",
                    f"{told}, and holds {'a workpiece already' if takes else 'nothing'}",
                )
            case Carry(source=source):
                nothing = ((self.empty(name), True), (self.empty(source), True))
                yield self._accident((idle, *nothing), f"{name}-nothing", f"{told}, and nothing lies on {source}")
            case Process(station=station):
                clamped: Literal = (self.clamped(station), True)
                yield self._accident(
                    (idle, (clamped[0], False)), f"{name}-loose", f"{told}, and nothing is clamped on {station}"
                )
                yield self._accident(
                    (idle, clamped, (self.has(station, _RAW), False)),
                    f"{name}-again",
                    f"{told}, and no raw workpiece lies on {station}",
                )
            case Index() as index:
                rests: tuple[Literal, ...] = (idle, (self.steady(name), True))
                for station in (at for at in index.following if at in self.clamps):
                    words = f"{told}, and the workpiece on {station} is clamped"
                    yield self._accident((*rests, (self.clamped(station), True)), f"{name}-clamped-{station}", words)
                for other in self._beside(name):
                    words = f"{told} while {other} is in the midst of its index"
                    yield self._accident((*rests, (self.steady(other), False)), f"{name}-meets-{other}", words)
            case _:
                pass

    # --- A command is done

    def done(self, place: Place) -> Iterator[Case]:
        """The ways in which a command can have its effect."""
        name, machine = self.machine(place)
        match self.action(place):
            case Move():
                there = self._hand(place)
                for position in machine.positions:
                    here = self.hand_at(name, position)
                    if here == there:
                        yield Case(((there, True),), tag=f"at-{position}")
                    else:
                        yield Case(
                            ((here, True), (there, False)), ((here, False), (there, True)), tag=f"from-{position}"
                        )
            case Grasp():
                if (station := self.station(place)) is not None:
                    loose = ((self.clamped(station), False),) if station in self.clamps else ()
                    yield from (Case(loose).with_(moved) for moved in self._moved(station, name))
            case Put():
                if (station := self.station(place)) is not None:
                    yield from self._laid_down(name, station)
            case Carry(target=target):
                yield from self._laid_down(name, target)
            case Index():
                yield Case(((self.steady(name), True),))
            case Clamp(station=station):
                fixed, lies = self.clamped(station), (self.empty(station), False)
                yield Case(((fixed, False), lies), ((fixed, True),))
                yield Case(((fixed, True), lies), tag="again")
            case Process(station=station):
                raw, machined = self.has(station, _RAW), self.has(station, _MACHINED)
                for unjudged in self._judged_no_more(station):
                    yield Case(((raw, True), (machined, False)), ((raw, False), (machined, True))).with_(unjudged)
                    yield Case(((machined, True),), tag="again").with_(unjudged)
            case Release(station=station):
                fixed = self.clamped(station)
                yield Case(((fixed, True),), ((fixed, False),))
                yield Case(((fixed, False),), tag="again")
            case Stop():
                yield from self._at_rest(name)
            case Work() | Switch():
                yield Case()

    def steps(self, place: Place) -> tuple[str, ...]:
        """The places of the steps of an index, one after the other, and the one that says that all are done."""
        machine, command = self.machine(place)[0], _command(place).command
        stations = self.indexing[machine][command].following
        taking, laying = ([self.step(machine, command, does, at) for at in stations] for does in ("takes", "lays"))
        return (*taking, *laying, self.steady(machine))

    def indexes(self, place: Place, index: Index) -> Iterator[tuple[str, str, tuple[Case, ...]]]:
        """The steps of the index that a place commands: a name, words, and the ways in which each can go."""
        machine, stations, steps = self.machine(place)[0], index.following, self.steps(place)
        moves = (("takes", at) for at in stations), (("lays", at) for at in stations)
        for (does, at), step, next_ in zip(chain(*moves), steps, steps[1:], strict=False):
            goes_on = Case(((step, True), (next_, False)), ((step, False), (next_, True)))
            if does == "takes":
                words, none = f"{machine} takes what lies on {at}", self.empty(at)
                ways = self._taken_up(machine, at)
            else:
                words, none = f"{machine} lays what lay on {at} on {stations[at]}", self.taken_from(machine, at)
                ways = self._indexed(machine, at, stations[at])
            name = f"{as_name(machine)}/{does}/{place.name}/{as_name(at)}"
            yield name, words, tuple(map(goes_on.with_, (Case(((none, True),), tag="nothing"), *ways)))

    def _taken_up(self, machine: str, station: str) -> Iterator[Case]:
        for kind in self.kinds:
            nothing, taken = self.taken_from(machine, station), self.taken_from(machine, station, kind)
            wants = ((self.has(station, kind), True), (self.empty(station), False), (nothing, True), (taken, False))
            moved = Case(wants, _turned(wants), self._tag(kind))
            yield from map(moved.with_, self._judged_no_more(station))

    def _indexed(self, machine: str, station: str, to: str) -> Iterator[Case]:
        for kind in self.kinds:
            nothing, taken = self.taken_from(machine, station), self.taken_from(machine, station, kind)
            wants = ((taken, True), (nothing, False), (self.empty(to), True), (self.has(to, kind), False))
            yield Case(wants, _turned(wants), self._tag(kind))

    def _laid_down(self, machine: str, station: str) -> Iterator[Case]:
        """A machine lays its workpiece down on a station, where nobody is in the midst of an index."""
        steady = Case(tuple((self.steady(other), True) for other in self.indexed_by(station)))
        yield from map(steady.with_, self._moved(machine, station))

    def spoiled(self, place: Place) -> Iterator[Case]:
        """The accidents that a command can end in."""
        name, _ = self.machine(place)
        match self.action(place):
            case Grasp():
                station = self.station(place)
                if station is None:
                    yield self._accident((), "nothing", f"{name} grasps where no workpiece can lie")
                    return
                if station in self.clamps:
                    held = ((self.clamped(station), True), (self.empty(station), False))
                    words = f"{name} pulls at the workpiece that is clamped on {station}"
                    yield self._accident(held, "clamped", words)
                words = f"{name} grasps at {station}, where no workpiece lies"
                yield self._accident(((self.empty(station), True),), "nothing", words)
            case Put(when_full=when_full):
                station = self.station(place)
                if station is None:
                    yield self._accident((), "drops", f"{name} drops its workpiece where nothing is")
                else:
                    yield from self._collides(name, station, when_full)
            case Carry(target=target, when_full=when_full):
                yield from self._collides(name, target, when_full)
            case Index() as index:
                for at, to in index.following.items():
                    lays: Literal = (self.step(name, _command(place).command, "lays", at), True)
                    both = ((self.taken_from(name, at), False), (self.empty(to), False))
                    words = f"{name} moves the workpiece of {at} onto {to}, where another lies"
                    yield self._accident((lays, *both), f"collides-{to}", words)
            case Clamp(station=station) | Process(station=station):
                words = f"{name} does {_words(place)} on {station}, where no workpiece lies"
                yield self._accident(((self.empty(station), True),), "nothing", words)
            case Move() | Release() | Work() | Switch() | Stop():
                return

    def arrives(self) -> Case:
        """A workpiece comes; nobody brings one to a station while a machine indexes there."""
        station = self.model.arrivals.station
        raw, empty = self.has(station, _RAW), self.empty(station)
        steady = tuple((self.steady(machine), True) for machine in self.indexed_by(station))
        return Case(((empty, True), (raw, False), *steady), ((empty, False), (raw, True)))

    def judges(self, station: str) -> Iterator[Case]:
        """A workpiece that lies on a station, and is not judged yet, is found good or not."""
        verdicts = {good: self.verdict(station, good=good) for good in (True, False)}
        wants = ((self.empty(station), False), *((verdict, False) for verdict in verdicts.values()))
        yield Case(wants, ((verdicts[True], True),), "passes", "and is found good")
        yield Case(wants, ((verdicts[False], True),), "fails", "and is not found good")

    def departs(self, departure: Departure) -> Iterator[Case]:
        """A finished workpiece is taken away, or any, where they may be raw."""
        station, finished = departure.station, self.kinds[-1:]
        for kind in self.kinds if departure.raw else finished:
            has, empty = self.has(station, kind), self.empty(station)
            tag = self._tag(kind) if departure.raw else ""
            gone = Case(((has, True), (empty, False)), ((has, False), (empty, True)), tag)
            yield from map(gone.with_, self._judged_no_more(station))

    def departs_raw(self, departure: Departure) -> Iterator[Case]:
        """The accident that a workpiece leaves which no machine has machined, where one should have.

        One that has only come where others are taken away waits there to be machined.
        """
        station = departure.station
        if len(self.kinds) > 1 and not departure.raw and station != self.model.arrivals.station:
            words = "a workpiece leaves the cell without having been machined"
            yield self._accident(((self.has(station, _RAW), True),), "raw", words)

    def _hand(self, place: Place) -> str:
        """The place that says that the hand is where the command of a place is about."""
        parameter = "to" if isinstance(self.action(place), Move) else "at"
        return self.hand_at(self.machine(place)[0], dict(_command(place).parameters)[parameter])

    def station(self, place: Place) -> str | None:
        """The station that the command of a place grasps or puts at; None where its position is none."""
        return self.machine(place)[1].positions[dict(_command(place).parameters)["at"]]

    def _moved(self, source: str, target: str) -> Iterator[Case]:
        """A workpiece goes from a station to a machine, or the other way; what a station shows of it comes and goes."""
        for kind in self.kinds:
            wants = (
                (self.has(source, kind), True),
                (self.empty(source), False),
                (self.empty(target), True),
                (self.has(target, kind), False),
            )
            moved = Case(wants, _turned(wants), self._tag(kind))
            yield from map(moved.with_, self._judged_no_more(source))

    def _judged_no_more(self, holder: str) -> Iterator[Case]:
        """A workpiece goes, or becomes another where it lies, whatever it was found."""
        if holder not in self.judged:
            yield Case()
            return
        passes, fails = self.verdict(holder, good=True), self.verdict(holder, good=False)
        yield Case(((passes, False), (fails, False)))
        yield Case(((passes, True), (fails, False)), ((passes, False),), f"{holder}-passed")
        yield Case(((passes, False), (fails, True)), ((fails, False),), f"{holder}-failed")

    def _tag(self, kind: str) -> str:
        return kind if len(self.kinds) > 1 else ""

    def _collides(self, machine: str, station: str, when_full: str) -> Iterator[Case]:
        """What pushes a workpiece onto another one; or, where it waits for that to go, onto a station that moves."""
        holds: Literal = (self.empty(machine), False)
        onto = f"{machine} pushes its workpiece onto {station}"
        if when_full == "collide":
            yield self._accident(((self.empty(station), False), holds), "collides", f"{onto}, where another lies")
        for other in self.indexed_by(station):
            words = f"{onto} while {other} is in the midst of its index"
            moves: tuple[Literal, ...] = ((self.empty(station), True), (self.steady(other), False))
            yield self._accident((*moves, holds), f"meets-{other}", words)

    def _accident(self, wants: tuple[Literal, ...], tag: str, says: str, kind: str = ACCIDENT) -> Case:
        return Case(((kind, False), *wants), ((kind, True),), tag, says)


def _turned(wants: tuple[Literal, ...]) -> tuple[Literal, ...]:
    """What is left where all that was wanted becomes otherwise."""
    return tuple((place, not value) for place, value in wants)


def fact(name: str, description: str, *, marked: bool = False) -> Place:
    """A place that says something of the plant."""
    return Place(name, PLANT, marked, description=description)


def _command(place: Place) -> Command:
    if place.command is None:
        raise ValueError(f"'{place.name}' sends no command")
    return place.command


def _words(place: Place) -> str:
    """The command of a place, without its machine.

    >>> _words(Place("p", command=Command("R", "MOVE", (("to", "MC"),))))
    'MOVE to=MC'
    """
    command = _command(place)
    return str(Command("", command.command, command.parameters)).strip()
