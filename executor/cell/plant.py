"""The simulated cell: machines, stations and workpieces with identities, and the laws that they obey.

Every station and every hand holds at most one workpiece. A command takes its time, then does to a workpiece what the
plant file says. What cannot be done is a *plant fault*: laying a workpiece on another, grasping nothing, commanding a
busy machine, machining what is not clamped or twice. The plant knows nothing of the net, so that a wrong net crashes
here as it would on the floor, and the identities of the workpieces tell what was lost or doubled.

A pure machine with its own queue of events: the caller says what time it is. All randomness comes from one seed.
"""

from __future__ import annotations

import random
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from typing import Final

from firable.executor.cell.disturbances import Disturbance, Disturbances
from firable.executor.cell.events import (
    ArrivalDue,
    Busy,
    DepartureDue,
    Event,
    FinishDue,
    LookDue,
    PressDue,
    StickDue,
    SwitchDue,
    Ticket,
)
from firable.nets.machines.plant_file import (
    GOOD,
    Action,
    Carry,
    Clamp,
    Grasp,
    Index,
    Machine,
    Move,
    PlantModel,
    Process,
    Put,
    Release,
    Sensor,
    Stop,
    Switch,
)

STILL_DONE: Final = 0.5
"""How often a machine that is brought to rest in some time does what it would have been done with by then."""


@dataclass(frozen=True, slots=True)
class SensorChanged:
    """A sensor sees something else."""

    signal: str
    value: bool


@dataclass(frozen=True, slots=True)
class CommandDone:
    """The machine acknowledges that a command is done."""

    ticket: Ticket


@dataclass(frozen=True, slots=True)
class PlantFault:
    """Something happened that must not: the machines of the cell stand still from now on."""

    message: str


PlantReport = SensorChanged | CommandDone | PlantFault


@dataclass(slots=True)
class Workpiece:
    """A workpiece and how often it was machined."""

    id: int
    processed: int = 0


@dataclass(slots=True)
class _MachineNow:
    """What a machine holds, where its hand is, and what it is at."""

    model: Machine
    position: str | None
    holding: Workpiece | None = None
    busy: Busy | None = None
    breaks_off: Busy | None = None
    """The command that it was at when it was stopped, until it has come to rest; one that waits will be done."""
    indexes: str = ""
    """The command by which it is in the midst of an index, also where it was halted there."""
    taken: dict[str, Workpiece] = field(default_factory=dict)
    """By the stations from which it has taken them, the workpieces that it moves then."""
    times: dict[str, int] = field(default_factory=dict)


class _FaultError(Exception):
    """A law of the plant is broken."""


def _told_apart(workpiece: Workpiece | None) -> Hashable:
    return workpiece and (workpiece.id, workpiece.processed)


def _doing(busy: Busy | None) -> Hashable:
    return busy and (busy.command, busy.waits)


class Plant:
    """The cell of a plant file at rest, into which `workpieces` workpieces will come, besides those that are there."""

    def __init__(
        self, model: PlantModel, *, workpieces: int, seed: int = 0, disturbances: Iterable[Disturbance] = ()
    ) -> None:
        self.model = model
        self.random = random.Random(seed)
        self.disturbances = Disturbances(disturbances)
        self.befallen: list[tuple[Disturbance, str]] = []
        """What was asked to go wrong and has come, with what became of it, in words."""
        self.machines = {name: _MachineNow(machine, machine.hand) for name, machine in model.machines.items()}
        self.stations: dict[str, Workpiece | None] = dict.fromkeys(model.stations)
        self.clamped: set[str] = set()
        judging = [sensor for sensor in model.sensors.values() if sensor.judges is not None]
        self.machines_workpieces = model.machines_workpieces
        self.likely = {str(one.judges): GOOD for one in judging}
        """How likely a workpiece is to be found good, at each station where that is judged."""
        self.likely |= {str(one.judges): one.good for one in judging if one.good is not None}
        self.looks = {
            station: (0, max(one.after_s for one in judging if one.judges == station)) for station in self.likely
        }
        """How often a look was begun there or broken off, and how many seconds one takes."""
        self.found_good: dict[str, bool] = {}
        """What the workpieces at these were found, where one lies."""
        self.to_come = workpieces
        self.entered = 0
        self.delivered: list[Workpiece] = []
        self.shown = dict.fromkeys(model.sensors, False)
        self.pressed: set[str] = set()
        """The keys that somebody has pressed, and the signals that are set from outside."""
        self.faulted = False
        self.arrival_due = False
        self.is_closed = False
        self.events: list[tuple[float, int, Event]] = []
        """What will happen: when, a tie breaker, what."""
        self.sequence = 0
        self.now_seconds = 0.0
        if workpieces:
            self._in(0.0, model.arrivals.jitter_s, ArrivalDue())
        for name, sensor in model.sensors.items():
            if sensor.set_by is not None:
                self._in(sensor.after_s, 0.0, SwitchDue(name))
        for stuck in self.disturbances.stuck:
            self._in(stuck.from_seconds, 0.0, StickDue(stuck))
        for station, kind in model.full_at_first.items():
            self.entered += 1
            self._lies(station, Workpiece(self.entered, processed=int(kind == "machined")))
        if model.full_at_first:
            self.shown = {name: self._sees(name, sensor) for name, sensor in model.sensors.items()}

    @property
    def next_seconds(self) -> float | None:
        """When something happens next, if no command comes before; None: never."""
        return self.events[0][0] if self.events and not self.faulted else None

    @property
    def at_rest(self) -> bool:
        """Whether nothing happens any more if no command comes, but that signals are set from outside again."""
        return self.faulted or all(
            isinstance(event, SwitchDue) and self.model.sensors[event.signal].for_s is not None
            for *_, event in self.events
        )

    @property
    def inside(self) -> tuple[int, ...]:
        """The workpieces in the cell, in the order in which they came."""
        holders = [*self.stations.values(), *(machine.holding for machine in self.machines.values())]
        holders += [workpiece for machine in self.machines.values() for workpiece in machine.taken.values()]
        return tuple(sorted(workpiece.id for workpiece in holders if workpiece is not None))

    @property
    def standing(self) -> Hashable:
        """Where everything is and what the machines are at, whatever the time: equal where nothing has changed."""
        machines = tuple(
            (
                (machine.position, _told_apart(machine.holding), _doing(machine.busy), _doing(machine.breaks_off)),
                (machine.indexes, *((station, _told_apart(one)) for station, one in machine.taken.items())),
            )
            for machine in self.machines.values()
        )
        stations = tuple(map(_told_apart, self.stations.values()))
        looked = frozenset(self.found_good.items())
        return machines, stations, frozenset(self.clamped), frozenset(self.pressed), looked, self.arrival_due

    def close(self) -> None:
        """Let no more workpieces come, until it is opened."""
        self.is_closed = True

    def open(self, now_seconds: float) -> list[PlantReport]:
        """Let workpieces come again; one that is due is there at once."""
        self.now_seconds = now_seconds
        self.is_closed = False
        self._arrive()
        return list(self._seen())

    def halt(self) -> None:
        """Stop every machine where it is: the safe output of the simulated cell.

        Nobody outside stands still by that: workpieces come and go, a door is opened, somebody presses a key.
        """
        for machine in self.machines:
            self.stand(machine)

    def stand(self, machine: str) -> None:
        """Stop one machine where it is; what it was at is never done, and it may be commanded again."""
        self._rest(machine)

    def command(
        self, now_seconds: float, machine: str, command: str, parameters: Mapping[str, str], ticket: Ticket
    ) -> list[PlantReport]:
        """Give a machine a command; the ticket comes back when it is done."""
        if self.faulted:
            return []
        self.now_seconds = now_seconds
        return self._lawful(self._begin(machine, Busy(command, parameters, ticket)))

    def advance(self, now_seconds: float) -> list[PlantReport]:
        """Let happen what is due."""
        reports: list[PlantReport] = []
        while self.next_seconds is not None and self.next_seconds <= now_seconds:
            self.now_seconds, _, event = heappop(self.events)
            reports += self._lawful(self._happen(event))
        return reports

    def _lawful(self, happening: Iterator[PlantReport]) -> list[PlantReport]:
        reports: list[PlantReport] = []
        try:
            reports.extend(happening)
        except _FaultError as fault:
            self.faulted = True
            self.halt()
            reports.append(PlantFault(str(fault)))
        # What is seen comes before what is acknowledged: a completion is formed from both.
        return [*self._seen(), *reports]

    def _in(self, delay_s: float, jitter_s: float, event: Event) -> None:
        delay = max(0.0, delay_s + (self.random.uniform(-jitter_s, jitter_s) if jitter_s else 0.0))
        heappush(self.events, (self.now_seconds + delay, self.sequence, event))
        self.sequence += 1

    def _happen(self, event: Event) -> Iterator[PlantReport]:
        match event:
            case ArrivalDue():
                self.arrival_due = True
                self._arrive()
            case DepartureDue(station, id_):
                self._depart(station, id_)
            case FinishDue(machine, busy):
                now = self.machines[machine]
                if now.busy is busy:
                    yield from self._finish(machine, busy)
                elif now.breaks_off is busy and (busy.waits or self._is_still_done()):
                    now.breaks_off = replace(busy, waits=not self._take_effect(machine, busy))
            case PressDue(signal):
                if self.machines[str(self.model.sensors[signal].acknowledges)].busy is None:
                    self.pressed.add(signal)
            case SwitchDue(signal):
                self._switch(signal, self.model.sensors[signal])
            case LookDue(station, number):
                if number == self.looks[station][0]:
                    self._find(station)
            case StickDue(stuck):
                self.befallen.append((stuck, f"{stuck.signal} is stuck at {int(stuck.value)}"))

    def _switch(self, signal: str, sensor: Sensor) -> None:
        self.pressed ^= {signal}
        if sensor.for_s is not None:
            self._in(sensor.for_s if signal in self.pressed else sensor.after_s, 0.0, SwitchDue(signal))

    def _arrive(self) -> None:
        arrivals = self.model.arrivals
        if self._indexing(arrivals.station) or self.stations[arrivals.station] is not None:
            return
        if self.arrival_due and self.to_come and not self.is_closed:
            self.arrival_due = False
            self.to_come -= 1
            self.entered += 1
            self._lies(arrivals.station, Workpiece(self.entered))
            if self.to_come:
                self._in(arrivals.every_s, arrivals.jitter_s, ArrivalDue())

    def _depart(self, station: str, id_: int) -> None:
        workpiece, departure = self.stations[station], self.model.departure(station)
        if workpiece is None or workpiece.id != id_:
            return
        self._gone(station)
        if station == self.model.arrivals.station:
            self._arrive()
        self._wake()
        self.delivered.append(workpiece)
        if not workpiece.processed and self.machines_workpieces and not (departure and departure.raw):
            raise _FaultError(f"workpiece {workpiece.id} leaves the cell without having been machined")

    def _begin(self, name: str, busy: Busy) -> Iterator[PlantReport]:
        machine = self.machines.get(name)
        action = machine.model.commands.get(busy.command) if machine else None
        if machine is None or action is None:
            raise _FaultError(f"{name} does not know the command {busy.command}")
        machine.times[busy.command] = machine.times.get(busy.command, 0) + 1
        if isinstance(action, Stop):
            was = machine.busy
            if was is not None and not isinstance(machine.model.commands[was.command], Stop):
                machine.breaks_off = was if not was.waits or self._is_still_done() else replace(was, waits=False)
            machine.busy = busy
            if action.takes_s + action.jitter_s or self._hangs(name, busy):
                self._take_time(name, busy, action)
            else:
                yield from self._finish(name, busy)  # before anything else comes
            return
        if machine.busy is not None:
            raise _FaultError(f"{name} is given {busy.command} while it is at {machine.busy.command}")
        if isinstance(action, Switch):
            yield CommandDone(busy.ticket)
            return
        machine.busy = busy
        self.pressed.difference_update(key for key, _ in self._keys(name))
        match action:
            case Move():
                self._position(machine, name, busy, "to")
            case Grasp() | Put():
                at = self._position(machine, name, busy, "at")
                if machine.position != at:
                    raise _FaultError(f"{name} is to {action.does} at {at}, and its hand is at {machine.position}")
                if isinstance(action, Put) and machine.holding is None:
                    raise _FaultError(f"{name} is to put at {at} and holds nothing")
                if isinstance(action, Grasp) and machine.holding is not None:
                    raise _FaultError(f"{name} is to grasp at {at} and holds workpiece {machine.holding.id}")
            case Carry(source=source):
                if machine.holding is None:  # it holds one where it was stopped on the way
                    machine.holding = self._taken(source, f"{name} is to carry from {source}")
            case Index() as index:
                self._take_up(name, busy, index)
            case Process(station=station):
                workpiece = self._lying(station, f"{name} is to machine on {station}")
                if station not in self.clamped:
                    raise _FaultError(f"{name} machines workpiece {workpiece.id}, which is not clamped")
                if workpiece.processed:
                    raise _FaultError(f"{name} machines workpiece {workpiece.id} a second time")
        self._take_time(name, busy, action)

    def _take_up(self, name: str, busy: Busy, index: Index) -> None:
        """Take what lies on the stations of an index; one that was halted in the midst of it has that already."""
        machine = self.machines[name]
        if machine.indexes:
            if machine.indexes != busy.command:
                raise _FaultError(f"{name} is given {busy.command} in the midst of {machine.indexes}")
            return
        for station in sorted(machine.model.indexes):
            if other := self._indexing(station):
                raise _FaultError(f"{name} is given {busy.command} while {other} moves what lies on {station}")
        for station in index.following:
            if station in self.clamped:
                raise _FaultError(f"{name} is given {busy.command}, and the workpiece on {station} is clamped")
        machine.indexes = busy.command
        for station in index.following:
            if (workpiece := self.stations[station]) is not None:
                machine.taken[station] = workpiece
                self._gone(station)
        self._wake()

    def _lay_all(self, name: str, index: Index) -> None:
        """Lay down what an index has taken, each on its next station."""
        machine = self.machines[name]
        for station, workpiece in machine.taken.items():
            to = index.following[station]
            if (there := self.stations[to]) is not None:
                raise _FaultError(f"{name} moves workpiece {workpiece.id} onto {to}, where workpiece {there.id} lies")
            self._lies(to, workpiece)
        machine.taken.clear()
        machine.indexes = ""
        self._arrive()

    def _indexing(self, station: str) -> str:
        """The machine with which a station moves at this time, if it does."""
        those = (name for name, one in self.machines.items() if one.indexes and station in one.model.indexes)
        return next(those, "")

    def _take_time(self, name: str, busy: Busy, action: Action) -> None:
        if (hangs := self._hangs(name, busy)) is None:
            self._in(action.takes_s, action.jitter_s, FinishDue(name, busy))
        else:
            self.befallen.append((hangs, f"{name} has {busy.command} and will never end it"))

    def _hangs(self, name: str, busy: Busy) -> Disturbance | None:
        return self.disturbances.hangs(name, busy.command, self.machines[name].times[busy.command])

    def _finish(self, name: str, busy: Busy) -> Iterator[PlantReport]:
        machine = self.machines[name]
        if not self._take_effect(name, busy):
            machine.busy = replace(busy, waits=True)
            return
        self._rest(name)
        yield CommandDone(busy.ticket)

    def _rest(self, name: str) -> None:
        """Let a machine stand: somebody acknowledges later that what a stop was to break off is."""
        machine = self.machines[name]
        for key, sensor in self._keys(name) if machine.breaks_off is not None else ():
            self._in(sensor.after_s, 0.0, PressDue(key))
        machine.busy = machine.breaks_off = None

    def _take_effect(self, name: str, busy: Busy) -> bool:
        """Do what a command does in the end, and say whether it is done: on a full station it may have to wait."""
        machine = self.machines[name]
        action = machine.model.commands[busy.command]
        match action:
            case Move():
                machine.position = busy.parameters["to"]
            case Grasp():
                station = machine.model.positions[busy.parameters["at"]]
                if station in self.clamped:
                    raise _FaultError(f"{name} pulls at a workpiece that is clamped on {station}")
                machine.holding = self._taken(station, f"{name} grasps at {busy.parameters['at']}")
            case Put(when_full=when_full):
                station = machine.model.positions[busy.parameters["at"]]
                if when_full == "wait" and self._full(station):
                    return False
                self._lay(name, machine, station)
            case Carry(target=target, when_full=when_full):
                if when_full == "wait" and self._full(target):
                    return False
                self._lay(name, machine, target)
            case Index() as index:
                self._lay_all(name, index)
            case Clamp(station=station):
                self._lying(station, f"{name} clamps on {station}")
                self.clamped.add(station)
            case Process(station=station):
                workpiece = self._lying(station, f"{name} machines on {station}")
                workpiece.processed += 1
                self._judge(station)
                if station == self.model.arrivals.station:
                    self._finished(station, workpiece)
            case Release(station=station):
                self.clamped.discard(station)
        if (drops := self.disturbances.drops(name, busy.command, machine.times[busy.command])) is not None:
            held = "nothing, for it holds nothing" if machine.holding is None else f"workpiece {machine.holding.id}"
            self.befallen.append((drops, f"{name} drops {held}, as {busy.command} ends"))
            machine.holding = None
        return True

    def _is_still_done(self) -> bool:
        """Whether what is broken off is done if its time is over before the machine rests; it is asked once."""
        return self.random.random() < STILL_DONE

    def _position(self, machine: _MachineNow, name: str, busy: Busy, parameter: str) -> str:
        position = busy.parameters.get(parameter)
        if position is None or position not in machine.model.positions:
            raise _FaultError(f"{name} does not know the position {position} of {busy.command}")
        return position

    def _lying(self, station: str | None, doing: str) -> Workpiece:
        workpiece = self.stations[station] if station is not None else None
        if workpiece is None:
            raise _FaultError(f"{doing}, where no workpiece lies")
        return workpiece

    def _taken(self, station: str | None, doing: str) -> Workpiece:
        workpiece = self._lying(station, doing)
        self._gone(str(station))
        if station == self.model.arrivals.station:
            self._arrive()
        self._wake()
        return workpiece

    def _lies(self, station: str, workpiece: Workpiece) -> None:
        self.stations[station] = workpiece
        self._judge(station)
        self._finished(station, workpiece)

    def _finished(self, station: str, workpiece: Workpiece) -> None:
        """Have a workpiece taken away at its end; where workpieces arrive there, too, not before it was machined."""
        departure = self.model.departure(station)
        if departure is None:
            return
        may_go = workpiece.processed or departure.raw or not self.machines_workpieces
        if may_go or station != self.model.arrivals.station:
            self._in(departure.after_s, 0.0, DepartureDue(station, workpiece.id))

    def _gone(self, station: str) -> None:
        self.stations[station] = None
        self._judge(station)

    def _judge(self, station: str) -> None:
        """Begin to look at a station where workpieces are judged: one has come, gone, or become another there."""
        if station not in self.likely:
            return
        self.found_good.pop(station, None)
        number, seconds = self.looks[station]
        self.looks[station] = number + 1, seconds
        if self.stations[station] is not None:  # a look that takes no time is told of behind what made it begin
            self._in(seconds, 0.0, LookDue(station, number + 1))

    def _find(self, station: str) -> None:
        self.found_good[station] = self.random.random() < self.likely[station]

    def _wake(self) -> None:
        """Let each machine that waits for a station to become free look again."""
        for name, machine in self.machines.items():
            for waiting in (machine.busy, machine.breaks_off):
                if waiting is not None and waiting.waits:
                    self._in(0.0, 0.0, FinishDue(name, waiting))

    def _full(self, station: str | None) -> bool:
        return station is not None and self.stations[station] is not None

    def _lay(self, name: str, machine: _MachineNow, station: str | None) -> None:
        workpiece = machine.holding
        if workpiece is None:
            raise _FaultError(f"{name} has lost the workpiece that it should lay down")
        if station is None:
            raise _FaultError(f"{name} drops workpiece {workpiece.id} where nothing is")
        onto = f"{name} pushes workpiece {workpiece.id} onto {station}"
        if (there := self.stations[station]) is not None:
            raise _FaultError(f"{onto}, where workpiece {there.id} lies")
        if other := self._indexing(station):
            raise _FaultError(f"{onto} while {other} moves what lies there")
        machine.holding = None
        self._lies(station, workpiece)

    def _keys(self, machine: str) -> Iterator[tuple[str, Sensor]]:
        """The keys that acknowledge a fault of a machine."""
        return ((name, sensor) for name, sensor in self.model.sensors.items() if sensor.acknowledges == machine)

    def _sees(self, name: str, sensor: Sensor) -> bool:
        if (shown := self.disturbances.shown(name, self.now_seconds)) is not None:
            return shown
        if sensor.occupied is not None:
            return self.stations[sensor.occupied] is not None
        if sensor.by_hand:
            return name in self.pressed
        if sensor.judges is not None:
            return self.found_good.get(sensor.judges) is (sensor.passes is not None)
        return self.machines[str(sensor.holding)].holding is not None

    def _seen(self) -> Iterator[PlantReport]:
        for name, sensor in self.model.sensors.items():
            value = self._sees(name, sensor)
            if value != self.shown[name]:
                self.shown[name] = value
                yield SensorChanged(name, value)
