"""The monitor of one host among others: its own machines, held against what the plant file says of them.

A host sees what its controllers do: their firings, their parts of coordinated transitions when these are applied, the
commands that it sends and the signals that it takes. So for each controller there is a monitor of its subnet with its
own machines. What all other machines do is left open: a station that one of them reaches may get or lose a workpiece at
any moment, and so may one where workpieces come or go. That explains more than the cell can do, so a divergence here is
one of the whole cell, and what only two hosts together could know (a workpiece that came from nowhere) is not found:
the joined trace shows it (`firable replay TRACE --machines PLANT`).

A promise keeps a signal as it was in the process image, for as long as a link is down if need be. The time that a
signal may take begins anew when the promise ends.

Rejected: the whole loop, with all that is not seen as hidden. The belief would be nearly all of its markings, and a
coordinated firing is known here only after others may have gone on from it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from firable.executor.operating.monitor import LATENCY_SECONDS, Divergence, Monitor
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.machines.fitting import misfits
from firable.nets.machines.plant_file import Carry, Clamp, Index, Machine, PlantModel, Process, Release, Sensor
from firable.semantics.joining import APPLIED
from firable.semantics.trace import Event, Fired, Noted


class LocalMonitor:
    """The monitors of some controllers of a net; the first divergence of any of them is the last.

    Raises `InputError` F5003 where the plant does not fit the net.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        controllers: Collection[str],
        model: PlantModel,
        *,
        latency_seconds: float = LATENCY_SECONDS,
    ) -> None:
        if problems := misfits(model, decomposition.net):
            raise InputError(problems)
        self.monitors = {
            name: _of_one(decomposition, name, model, latency_seconds)
            for name in controllers
            if decomposition.subnet(name).places
        }
        self.parts = {
            (part.controller, row.name): part.name
            for row in decomposition.coordinated
            for part in row.parts
            if part.controller in self.monitors
        }
        subnets = [decomposition.subnet(name) for name in self.monitors]
        self.owner_of = {place.name: net.name for net in subnets for place in net.places}
        self.owner_of |= {signal.name: net.name for net in subnets for signal in net.signals}
        # What a coordinator decides alone at one controller bears one name as a row and as a part, and is applied, too.
        applied = set(self.parts.values())
        self.owner_of |= {t.name: net.name for net in subnets for t in net.transitions if t.name not in applied}
        self.divergence: Divergence | None = None

    def excuse(self, is_held: Callable[[str], bool]) -> None:
        """Ask this of a signal: whether a promise holds it as it was."""
        for monitor in self.monitors.values():
            monitor.is_held = is_held

    def seen(self, event: Event) -> Divergence | None:
        """An event of the trace of this host; the divergence that it shows, if it is the first."""
        if self.divergence is not None:
            return None
        self.passed(event.at_seconds)
        match event:
            case Noted(at, note, data) if note == APPLIED:
                name = str(data["controller"])
                if (part := self.parts.get((name, str(data["transition"])))) is not None:
                    self._found(self.monitors[name].fired(at, part))
            case Noted():
                pass
            case Fired(at, transitions):
                # One that this host's coordinator has decided fires here when its part is applied.
                for name in transitions:
                    if (owner := self.owner_of.get(name)) is not None:
                        self._found(self.monitors[owner].fired(at, name))
            case _:
                about = event.place if hasattr(event, "place") else event.signal
                if (owner := self.owner_of.get(about)) is not None:
                    self._found(self.monitors[owner].seen(event))
        return self.divergence

    def passed(self, at_seconds: float) -> Divergence | None:
        """Time has passed, and nothing was seen."""
        for monitor in self.monitors.values():
            self._found(monitor.passed(at_seconds))
        return self.divergence

    def deadline_seconds(self) -> float | None:
        """When time alone can show a divergence; None: never, as long as nothing else is seen."""
        if self.divergence is not None:
            return None
        return min(filter(None, (one.deadline_seconds() for one in self.monitors.values())), default=None)

    def _found(self, divergence: Divergence | None) -> None:
        self.divergence = self.divergence or divergence


def _of_one(decomposition: Decomposition, name: str, model: PlantModel, latency_seconds: float) -> Monitor:
    subnet = decomposition.subnet(name)
    commanding = {
        machine: {
            place.owner for place in decomposition.net.places if place.command and place.command.machine == machine
        }
        for machine in model.machines
    }
    for machine, owners in commanding.items():
        if name in owners and len(owners) > 1:
            who = " and ".join(sorted(map(str, owners)))
            message = f"'{machine}' is commanded by {who}, and no host alone knows what it does"
            raise InputError([Diagnostic("F5003", message, "watch the joined trace: `firable replay --machines`")])
    own = {machine: model.machines[machine] for machine, owners in commanding.items() if owners == {name}}
    others = {machine: one for machine, one in model.machines.items() if machine not in own}
    touched = {station for one in others.values() for station in _reached(one)}
    sensors, unknown = dict[str, Sensor](), list[str]()
    for signal in subnet.signals:
        if (sensor := model.sensors.get(signal.name)) is None:
            continue
        if (sensor.holding or sensor.acknowledges) in others:
            # It tells of a machine elsewhere: it may show anything.
            station = f"elsewhere.{signal.name}"
            unknown.append(station)
            sensor = Sensor(occupied=station)
        sensors[signal.name] = sensor
    near = {station for one in own.values() for station in _reached(one)}
    near |= {sensor.station for sensor in sensors.values() if sensor.station is not None}
    ends = {model.arrivals.station, *(departure.station for departure in model.departures)}
    # Where workpieces come and go out of reach, that would only multiply what is believed.
    nowhere = "elsewhere"
    update = {"machines": own, "sensors": sensors, "stations": [*sorted(near | ends), nowhere]}
    if model.arrivals.station not in near:
        update["arrivals"] = model.arrivals.model_copy(update={"station": nowhere})
    update["departures"] = [departure for departure in model.departures if departure.station in near]
    others_at = sorted((touched | ends | set(unknown)) & near)
    local = model.model_copy(update=update)
    # Whether a workpiece was machined is told apart only where a machine here does that.
    full = {at: kind if local.machines_workpieces else "raw" for at, kind in model.full_at_first.items() if at in near}
    local = local.model_copy(update={"full_at_first": full})
    return Monitor(subnet, local, latency_seconds=latency_seconds, elsewhere=others_at)


def _reached(machine: Machine) -> Iterator[str]:
    """The stations at which a machine can do anything to a workpiece."""
    yield from (station for station in machine.positions.values() if station is not None)
    for action in machine.commands.values():
        match action:
            case Carry(source=source, target=target):
                yield from (source, target)
            case Index():
                yield from action.stations
            case Clamp(station=station) | Process(station=station) | Release(station=station):
                yield station
            case _:
                pass
