"""What there is in a cell with its machines, read from the net and the plant file a second time.

A machine *is at* a command or at none, a hand *is at* a position, a station or a hand *has* nothing, a raw or a
machined workpiece; what lies on a station *is judged* good or bad where a sensor shows that; a signal, a bit, a clamp
are so or not. Each such thing has a name here and one value in each state, and the places that the net of the loop has
for it are named. What can happen to them is told in `happenings`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from firable.nets.machines.excluding import with_one_token
from firable.nets.machines.loop import Faults, Sending
from firable.nets.machines.plant_file import (
    Action,
    Carry,
    Clamp,
    Failure,
    Grasp,
    Index,
    PlantModel,
    Process,
    Put,
    Release,
    Sensor,
    Stop,
    Switch,
    Work,
)
from firable.nets.net import Net, Place, SignalKind, Transition
from firable.nets.well_formed import as_name

ACCIDENT: Final = "accident"
OVERRUN: Final = "overrun"
UNTOLD: Final = "untold"
GOOD: Final = "good"
BAD: Final = "bad"
Value = str | bool | None
State = Mapping[str, Value]


class DiffersError(Exception):
    """The net of the loop is not what the plant file says, and where."""


class UncomparedError(Exception):
    """Whether the net of the loop is what the plant file says would have to be asked in too many states of one thing
    that happens, which has the name `happening`."""

    def __init__(self, happening: str) -> None:
        super().__init__(f"'{happening}' looks at more things than are compared")
        self.happening = happening


class Step(NamedTuple):
    """A step of a machine that indexes: it `takes` what lies on a station, or `lays` on the next one what it took."""

    name: str
    does: str
    at: str
    to: str


@dataclass(frozen=True)
class Things:
    """A net with the machines of a plant file; each thing has a name here, and a value in each state.

    What there is depends on when commands are sent, and on which of them may fail.
    """

    net: Net
    model: PlantModel
    sending: Sending = Sending.LATE
    faults: Faults = Faults.NONE

    # --- What there is, and what it is at the start

    @cached_property
    def things(self) -> dict[str, dict[Value, str]]:
        """For each thing, the place of the loop that is marked in each value; the value False has none, nor has None
        of what is judged."""
        found: dict[str, dict[Value, str]] = {f"token of {p.name}": {True: p.name} for p in self.net.places}
        found |= {f"signal {name}": {True: name} for name in (*self.completions, *self.timers)}
        for name, sensor in self.model.sensors.items():
            if sensor.acknowledges is not None:
                found[f"key {name}"] = {True: name, False: f"plant.{name}.released"}
            elif sensor.set_by is not None:
                found[f"set {name}"] = {True: name, False: f"plant.{name}.reset"}
            elif sensor.may_flicker or sensor.may_linger:
                found[f"bit {name}"] = {True: f"plant.{name}.sensor" if name in self.completions else name}
        found |= {f"told {name}": {True: f"plant.{name}.told_1", False: f"plant.{name}.told_0"} for name in self.late}
        found |= {f"news of {name}": {True: f"plant.{name}.news"} for name in self.late}
        found |= {f"starting {name}": {True: f"plant.{as_name(name)}.starting"} for name in self.may_start}
        found |= {UNTOLD: {True: "plant.untold"}} if self.may_start else {}
        found |= {f"acknowledged {name}": {True: f"plant.{name}.acknowledged"} for name in self.sensed}
        if self.sending is Sending.LATE:
            found |= {f"unsent {p.name}": {True: f"plant.unsent.{p.name}"} for p in self.commanding}
        found |= {f"failed {name}": {True: f"plant.{as_name(name)}.failed"} for name in self.may_fail}
        for name, machine in self.model.machines.items():
            its = f"plant.{as_name(name)}"
            at: dict[Value, str] = {None: f"{its}.idle"}
            at |= {p.name: f"{its}.at.{p.name}" for p in self.commanding if self.machine_of(p) == name}
            found[f"at {name}"] = at
            if self.may_break_off(name):
                breaks: dict[Value, str] = {None: f"{its}.breaks_off_nothing"}
                breaks |= {p.name: f"{its}.breaks_off.{p.name}" for p in self.may_break_off(name)}
                found[f"breaks off {name}"] = breaks
            if machine.hand is not None:
                hands: dict[Value, str] = {where: f"{its}.hand_at.{as_name(where)}" for where in machine.positions}
                found[f"hand {name}"] = hands
            if machine.hand is not None or any(isinstance(one, Carry) for one in machine.commands.values()):
                kinds: dict[Value, str] = {kind: f"{its}.holds_{kind}" for kind in self.kinds}
                found[f"has {name}"] = {None: f"{its}.holds_nothing"} | kinds
            if name in self.tables:
                steps: dict[Value, str] = {
                    step.name: f"{its}.{as_name(command)}.{step.does}.{as_name(step.at)}"
                    for command, some in self.tables[name].items()
                    for step in some
                }
                found[f"step {name}"] = {None: f"{its}.steady"} | steps
                for station in self.taken_by(name):
                    held: dict[Value, str] = {kind: f"{its}.from.{as_name(station)}.{kind}" for kind in self.kinds}
                    found[f"has {name} from {station}"] = {None: f"{its}.from.{as_name(station)}.nothing"} | held
        for name in self.model.stations:
            its = f"plant.{as_name(name)}"
            lies: dict[Value, str] = {kind: f"{its}.{kind}" for kind in self.kinds}
            found[f"has {name}"] = {None: f"{its}.empty"} | lies
            if name in self.clamps:
                found[f"clamped {name}"] = {True: f"{its}.clamped"}
            if name in self.judged:
                found[f"judged {name}"] = {GOOD: f"{its}.passes", BAD: f"{its}.fails"}
        return found | {ACCIDENT: {True: "plant.accident"}, OVERRUN: {True: "plant.overrun"}}

    @cached_property
    def thing_of(self) -> dict[str, tuple[str, Value]]:
        """The thing that each place of the loop is of, and its value; raises `DiffersError` where one is of two."""
        found: dict[str, tuple[str, Value]] = {}
        for thing, places in self.things.items():
            for value, place in places.items():
                if found.setdefault(place, (thing, value))[0] != thing:
                    raise DiffersError(f"'{place}' stands for the {found[place][0]}, and for the {thing}")
        return found

    def values(self, thing: str) -> list[Value]:
        """The values that a thing may have; no machine is ever at a command that takes no time."""
        places = self.things[thing]
        if all(isinstance(value, bool) for value in places):
            return [False, True]
        if thing.startswith("judged "):
            return [None, *places]
        never = self.momentary if thing.startswith("at ") else ()
        return [value for value in places if value not in never]

    # --- What there can be

    def ways_to_know(self, thing: str, state: State) -> list[dict[str, Value]]:
        """The values that a thing may have in a state in which it is left open, each with those of what it goes by."""
        if thing.startswith("judged "):
            has = thing.replace("judged ", "has ", 1)
            return [
                {has: lies, thing: value}
                for lies in ([state[has]] if has in state else self.values(has))
                for value in ([None] if lies is None else self.values(thing))
            ]
        if self.may_start and (thing == UNTOLD or thing.startswith("news of ")):
            ways = ({thing: value} for value in self.values(thing))
            return [way for way in ways if self.may_be_untold({**state, **way})]
        if not thing.startswith(("breaks off ", "starting ")):
            return [{thing: value} for value in self.values(thing)]
        kind = "starting" if thing.startswith("starting ") else "breaks off"
        machine = thing.removeprefix(f"{kind} ")
        at = f"at {machine}"
        at_rest = [False] if kind == "starting" else [None]
        return [
            {at: now_at, thing: value}
            for now_at in ([state[at]] if at in state else self.values(at))
            for value in (
                at_rest
                if now_at is None or not (kind == "starting" or self.comes_to_rest(now_at))
                else self.values(thing)
            )
        ]

    def assert_exists(self, state: State, changes: Mapping[str, Value]) -> None:
        """What has changed has one of its values; nothing is broken off but by a machine at a stop, no machine is
        starting but at a command, there is news iff something is untold, and nothing is judged where nothing lies.

        Raises `DiffersError` where it is not so: no state is compared in which it is not.
        """
        if stray := next((thing for thing, value in changes.items() if value not in self.values(thing)), None):
            raise DiffersError(f"'{stray}' becomes {changes[stray]}, which it never is")
        for machine in self.model.machines:
            at, breaks, starting = f"at {machine}", f"breaks off {machine}", f"starting {machine}"
            asked = {thing for thing in (breaks, starting) if thing in self.things and {thing, at} & changes.keys()}
            if breaks in asked and state[breaks] is not None and not self.comes_to_rest(state[at]):
                raise DiffersError(f"{machine} breaks off the command of '{state[breaks]}', and is at no stop")
            if starting in asked and state[starting] and state[at] is None:
                raise DiffersError(f"{machine} is starting, and is at no command")
        has_changed = self.may_start and any(thing.startswith("news of ") for thing in changes)
        if has_changed and state[UNTOLD] != any(state[f"news of {name}"] for name in self.late):
            raise DiffersError("there is news, and nothing says so, or the other way round")
        for station in self.model.stations:
            has, judged = f"has {station}", f"judged {station}"
            if judged not in self.things or changes.keys().isdisjoint((has, judged)):
                continue
            if state[has] is None and state[judged] is not None:
                raise DiffersError(f"nothing lies on {station}, and it was found {state[judged]}")

    def may_be_untold(self, state: State) -> bool:
        """Whether what is known of all news and of each agrees."""
        known = [state.get(f"news of {name}") for name in self.late]
        return UNTOLD not in state or (None in known and not any(known)) or state[UNTOLD] == any(known)

    def comes_to_rest(self, at: Value) -> bool:
        """Whether a machine that is at the command of a place comes to rest."""
        return at is not None and isinstance(self.action(self.net.place(str(at))), Stop)

    @cached_property
    def start(self) -> State:
        """All is at rest, and no workpiece has come yet; a token in M0 sends no command."""
        first: dict[str, Value] = {thing: None if None in self.values(thing) else False for thing in self.things}
        first |= {f"token of {p.name}": p.marked for p in self.net.places}
        first |= {f"has {station}": kind for station, kind in self.model.full_at_first.items()}
        for name, sensor in self.model.sensors.items():
            if sensor.occupied in self.model.full_at_first:
                told = () if name in self.completions else (f"told {name}",)
                first |= {thing: True for thing in (f"bit {name}", *told) if thing in self.things}
        return first | {f"hand {name}": m.hand for name, m in self.model.machines.items() if m.hand is not None}

    @cached_property
    def commanding(self) -> tuple[Place, ...]:
        """The places that send a command."""
        return tuple(place for place in self.net.places if place.command is not None)

    @cached_property
    def momentary(self) -> set[str]:
        """Those whose command takes no time, and nobody waits for its end: it stops the machine at once, or switches
        something."""
        some = ((place, self.action(place)) for place in self.commanding if place.completion is None)
        return {
            place.name
            for place, one in some
            if isinstance(one, Switch) or (isinstance(one, Stop) and not one.takes_s and not one.jitter_s)
        }

    @cached_property
    def tables(self) -> dict[str, dict[str, list[Step]]]:
        """For each machine that the net has index, and each of the commands by which it does, its steps."""
        found: dict[str, dict[str, list[Step]]] = {}
        for place in self.commanding:
            if place.command is not None and isinstance(action := self.action(place), Index):
                ways = [(does, *way) for does in ("takes", "lays") for way in action.following.items()]
                steps = [Step(f"{place.command.command} {does} {at}", does, at, to) for does, at, to in ways]
                found.setdefault(place.command.machine, {})[place.command.command] = steps
        return found

    def steps_of(self, place: Place) -> list[Step]:
        """Those of an index that a place commands."""
        assert place.command is not None
        return self.tables[place.command.machine][place.command.command]

    def taken_by(self, table: str) -> list[str]:
        """The stations from which a machine takes workpieces when it indexes."""
        return list(dict.fromkeys(step.at for steps in self.tables[table].values() for step in steps))

    def tables_at(self, stations: Collection[str]) -> list[str]:
        """The machines that index, of which one of some stations is an end of some command."""
        return [name for name in self.tables if not self.ends_of(name).isdisjoint(stations)]

    def ends_of(self, table: str) -> set[str]:
        """All stations of a machine that indexes, also of commands that the net never sends."""
        own = [action for action in self.model.machines[table].commands.values() if isinstance(action, Index)]
        return {end for action in own for way in action.following.items() for end in way}

    def may_break_off(self, machine: str) -> list[Place]:
        """Those whose command a stop of the machine may break off: not that of a stop, nor one that does nothing; none
        where the machine is always stopped at once."""
        own = [place for place in self.commanding if self.machine_of(place) == machine]
        stops = [place for place in own if isinstance(self.action(place), Stop)]
        if all(place.name in self.momentary for place in stops):
            return []
        return [place for place in own if place not in stops and not isinstance(self.action(place), Switch | Work)]

    @cached_property
    def failing(self) -> tuple[Place, ...]:
        """The places whose command may be taken and not be done."""
        kinds = {
            Faults.NONE: set[Failure](),
            Faults.REPAIRED: {Failure.REPAIRABLE},
            Faults.FOR_GOOD: {Failure.REPAIRABLE, Failure.FOR_GOOD},
        }[self.faults]
        some = ((place, self.action(place)) for place in self.commanding)
        return tuple(place for place, action in some if not isinstance(action, Stop) and action.may_fail in kinds)

    @cached_property
    def may_fail(self) -> tuple[str, ...]:
        """The machines at such a command, in the order of the plant file."""
        some = {self.machine_of(place) for place in self.failing}
        return tuple(name for name in self.model.machines if name in some)

    @cached_property
    def completions(self) -> tuple[str, ...]:
        """The signals that drivers form."""
        return tuple(signal.name for signal in self.net.signals if signal.kind is SignalKind.COMPLETION)

    @cached_property
    def sensed(self) -> tuple[str, ...]:
        """The completions for which a sensor has to agree."""
        return tuple(name for name in self.completions if name in self.model.sensors)

    @cached_property
    def flickering(self) -> set[str]:
        """The signals of sensors that may drop though there is something to see."""
        return {name for name, sensor in self.model.sensors.items() if sensor.may_flicker}

    @cached_property
    def timers(self) -> dict[str, Place]:
        """The time limits that somebody reads besides the transition that takes the token when the time is over."""
        of_faults = {(self.net.places[p].name, t) for p, t in self.net.fault_transitions.items()}
        found = {}
        for place in self.net.places:
            for t, transition in enumerate(self.net.transitions if place.within is not None else ()):
                reads = any(
                    place.within is not None and gate.signal == place.within.timer for gate in transition.external
                )
                if reads and place.within is not None and (place.name, t) not in of_faults:
                    found[place.within.timer] = place
        return found

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What a workpiece can be: machined only where some machine does that."""
        machines = self.model.machines.values()
        some = any(isinstance(action, Process) for machine in machines for action in machine.commands.values())
        return ("raw", "machined") if some else ("raw",)

    @cached_property
    def clamps(self) -> set[str]:
        """The stations with a clamp."""
        actions = (action for machine in self.model.machines.values() for action in machine.commands.values())
        return {action.station for action in actions if isinstance(action, (Clamp, Release, Process))}

    @cached_property
    def judged(self) -> set[str]:
        """The stations of which a sensor shows what passes there, or what fails."""
        some = (one for sensor in self.model.sensors.values() for one in (sensor.passes, sensor.fails))
        return {one for one in some if one is not None}

    def machine_of(self, place: Place) -> str:
        """The machine that a place commands."""
        assert place.command is not None
        return place.command.machine

    def action(self, place: Place) -> Action:
        """What it commands."""
        assert place.command is not None
        return self.model.machines[place.command.machine].commands[place.command.command]

    def where(self, place: Place, parameter: str) -> str:
        """The position that the command of a place is about."""
        assert place.command is not None
        return dict(place.command.parameters)[parameter]

    # --- What controllers are told

    @cached_property
    def late(self) -> tuple[str, ...]:
        """The signals that a controller may be told later than they change."""
        late = {signal for instant in self.instants() for signal in self.told_late(*instant)}
        late |= {name for name, seeing in self.seen_with.items() if seeing & late}
        return tuple(signal.name for signal in self.net.signals if signal.name in late)

    @cached_property
    def may_start(self) -> tuple[str, ...]:
        """The machines that may be at a command which they were given while a controller was still to be told of
        something, in the order of the plant file."""
        some = {self.machine_of(place) for place in self.commanding if place.name not in self.momentary}
        return tuple(name for name in self.model.machines if self.late and name in some)

    @cached_property
    def read(self) -> set[tuple[str, bool]]:
        """The signals that some gate reads, each with the value that it wants."""
        return {(gate.signal, gate.wanted) for t in self.net.transitions for gate in t.external}

    def told_late(self, changes: Collection[tuple[str, bool]], places: Collection[Place] = ()) -> set[str]:
        """Of signals that change to these values, those by whose old value a gate may be open, and somebody ready: not
        one who cannot be before the completion of a command of `places` is told, which are sent then, or done. Then the
        completion, too, which is told behind them. What is set from outside could have been set later."""
        late = {
            signal
            for signal, value in changes
            if (signal, not value) in self.read
            and not self.may_wait(signal)
            and not any(self.excludes(p, signal, not value) for p in places)
        }
        return late | {signal for signal, _ in changes if late and signal in self.completions}

    def may_wait(self, signal: str) -> bool:
        """Whether somebody outside sets a signal, who may do so when the controller is told as well as before."""
        return signal in self.model.sensors and self.model.sensors[signal].set_by is not None

    @cached_property
    def told_before(self) -> dict[str, list[str]]:
        """For each completion the sensors that may change with it: when a controller is told of it, it has been told of
        them."""
        return {name: [one for one in self.late if one in seeing] for name, seeing in self.seen_with.items()}

    @cached_property
    def seen_with(self) -> dict[str, set[str]]:
        """For each completion the sensors that may change with it."""
        found = {name: set[str]() for name in self.completions}
        for place in self.commanding:
            if place.completion is not None:
                found[place.completion] |= {name for name, _ in self.shows_done(place)}
        return found

    def instants(self) -> Iterator[tuple[list[tuple[str, bool]], list[Place]]]:
        """The signals that change in one instant, and to what, with the place whose command is sent or done in it."""
        for place in self.commanding:
            if isinstance(action := self.action(place), Carry):
                yield self.seen_of(action.source, self.machine_of(place)), [place]
            if isinstance(action, Index):
                yield from ((self.seen_in(step), [place]) for step in self.steps_of(place))
            effect = self.shows_done(place)
            yield effect if place.completion is None else [(place.completion, True), *effect], [place]
            if place in self.may_break_off(self.machine_of(place)):
                yield effect, []
        yield self.seen_of(None, self.model.arrivals.station), []
        for out in self.model.departures:
            yield self.seen_of(out.station, None), []
        for name in self.sensed:
            yield [(name, True)], []
        for name in (signal.name for signal in self.net.signals if signal.kind is SignalKind.SENSOR):
            sensor = self.model.sensors[name]
            moves = sensor.acknowledges is not None or sensor.set_by is not None or sensor.may_flicker
            for value in (True, False) if moves else (False,) if sensor.may_linger else ():
                yield [(name, value)], []
            if sensor.passes is not None or sensor.fails is not None:
                yield [(name, True)], []

    def shows_done(self, place: Place) -> list[tuple[str, bool]]:
        """What sensors show at once of a command that is done: where a workpiece goes, or is judged no more."""
        name, action = self.machine_of(place), self.action(place)
        if isinstance(action, Carry):
            return self.seen_of(name, action.target)
        if isinstance(action, Index):
            return [one for step in self.steps_of(place) for one in self.seen_in(step)]
        if isinstance(action, Process):
            return [(name, False) for name in self.judging(action.station)]
        if isinstance(action, Grasp | Put):
            station = self.model.machines[name].positions[self.where(place, "at")]
            return self.seen_of(station, name) if isinstance(action, Grasp) else self.seen_of(name, station)
        return []

    def seen_in(self, step: Step) -> list[tuple[str, bool]]:
        """What sensors show at once where a machine that indexes takes a workpiece, or lays it down."""
        return self.seen_of(step.at, None) if step.does == "takes" else self.seen_of(None, step.to)

    def excludes(self, place: Place, signal: str, value: bool) -> bool:
        """Whether nobody who goes by this value of a signal is ready while a place holds its token, and it holds it
        till the completion is told: all that takes it waits for that, and no other machine sets it."""
        if (place.name, signal, value) not in self._excluded:
            self._excluded[place.name, signal, value] = self._excludes(place, signal, value)
        return self._excluded[place.name, signal, value]

    @cached_property
    def _excluded(self) -> dict[tuple[str, str, bool], bool]:
        return {}

    def _excludes(self, place: Place, signal: str, value: bool) -> bool:
        completion = place.completion
        if completion is None or any(
            other.command is None or other.command.machine != self.machine_of(place)
            for other in self.net.places
            if other.completion == completion
        ):
            return False
        takers = [t for t in self.net.transitions if place.name in t.inputs]
        if any((completion, True) not in _gates(t) for t in takers):
            return False
        return all(self.is_kept_back(place, t, signal) for t in self.net.transitions if (signal, value) in _gates(t))

    def is_kept_back(self, place: Place, t: Transition, signal: str) -> bool:
        """Whether what a transition needs at the controller of a signal is missing while a place holds its token."""
        owner = self.net.signal(signal).owner
        mine = [name for name in (*t.inputs, *t.permissive) if self.net.place(name).owner == owner]
        if place.owner == owner and place.name in (*t.outputs, *t.inhibitive):
            return True
        if place.name in mine:
            return (str(place.completion), True) in _gates(t)
        return any(self.apart(place.name, name) for name in mine)

    def apart(self, one: str, other: str) -> bool:
        """Whether two places are never marked together, by places among which there is one token for ever; what the
        loop names for that is looked at anew."""
        found = with_one_token(self.net, one, other)
        if found is None:
            return False
        kept = all(len(found & {*t.inputs}) == len(found & {*t.outputs}) for t in self.net.transitions)
        if not kept or not {one, other} <= found or sum(self.net.place(name).marked for name in found) != 1:
            raise DiffersError(f"'{one}' and '{other}' may hold a token at once")
        return True

    def seen_of(self, source: str | None, target: str | None) -> list[tuple[str, bool]]:
        """What sensors that are no completions show at once, of a workpiece that goes."""
        sees = {name: sensor for name, sensor in self.model.sensors.items() if name not in self.sensed}
        come = [(name, True) for name, sensor in sees.items() if target in (sensor.occupied, sensor.holding)]
        gone = [
            (name, False)
            for name, sensor in sees.items()
            if source in (sensor.occupied, sensor.holding) and not sensor.may_linger
        ]
        gone += [(name, False) for name in self.judging(source)]
        return (come if target is not None else []) + (gone if source is not None else [])

    def judging(self, station: str | None) -> list[str]:
        """The sensors that are no completions and show what the workpiece on a station was found."""
        sensors = [(name, one) for name, one in self.model.sensors.items() if name not in self.sensed]
        return [name for name, one in sensors if station is not None and station in (one.passes, one.fails)]

    # --- What a signal shows

    def shown(self, signal: str, state: State) -> bool:
        """The value of a signal that somebody reads."""
        if signal in self.late:
            return bool(state[f"told {signal}"])
        return self.is_true(signal, state)

    @cached_property
    def truths(self) -> dict[str, str]:
        """For each signal, timers apart, the thing that says what it is."""
        found = {name: f"signal {name}" for name in self.completions}
        for name, sensor in self.model.sensors.items():
            if name not in found and any(signal.name == name for signal in self.net.signals):
                ways = (f"key {name}", f"set {name}", f"bit {name}", f"judged {sensor.passes or sensor.fails}")
                found[name] = next((thing for thing in ways if thing in self.things), target_of(sensor))
        return found

    def is_true(self, signal: str, state: State) -> bool:
        """The value of a signal, whoever has been told of it."""
        if signal in self.completions or signal in self.timers:
            return bool(state[f"signal {signal}"])
        return self.seen(signal, state)

    def seen(self, name: str, state: State) -> bool:
        """What a sensor shows."""
        sensor = self.model.sensors[name]
        if sensor.acknowledges is not None:
            return bool(state[f"key {name}"])
        if sensor.set_by is not None:
            return bool(state[f"set {name}"])
        if sensor.may_flicker or sensor.may_linger:
            return bool(state[f"bit {name}"])
        if sensor.passes is not None or sensor.fails is not None:
            return state[f"judged {sensor.passes or sensor.fails}"] == (BAD if sensor.passes is None else GOOD)
        return state[target_of(sensor)] is not None


def _gates(t: Transition) -> set[tuple[str, bool]]:
    return {(gate.signal, gate.wanted) for gate in t.external}


def target_of(sensor: Sensor) -> str:
    """What a sensor that sees whether there is something looks at."""
    return f"has {sensor.occupied or sensor.holding}"
