"""The plant file, `*.plant.yaml`: the physical side of a cell, for its simulation and for the model of its machines.

It says where workpieces can lie, which machines exist, what each command does to a workpiece and how long that takes,
and what each sensor sees. It says nothing of places and transitions: commands and sensors are the whole border between
a net and its cell, so a plant knows nothing that a real cell would not. Times are in seconds, and stand in keys that
end in `_s`.

One file serves both readers, because both must be told the same facts. `firable run` plays it with its times
(`firable.executor.cell.plant`); `firable check --machines` leaves the times out and keeps every order in which things
can happen (`firable.nets.machines.closing`). Two keys speak to the second reader alone: `may_fail` of a command, and
`may_flicker` and `may_linger` of a sensor; a simulated run is disturbed by its caller instead. The alternative, a file
of machines beside the plant file, with "idle, busy, done" and the sensors that each command sets, says the same things
a second time and cannot say why two machines collide.

The file is read like a net file: bounded, without ambiguous YAML, each mistake with its line. Where it is for other
machines than a net commands, the file is at fault as well: a plant remembers where in its file everything stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from math import isclose
from pathlib import Path as FilePath
from typing import Annotated, ClassVar, Final, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr, ValidationError

from firable.nets.diagnostics import Diagnostic, InputError, Span, Subject, did_you_mean
from firable.nets.document import Name, OptionalName, given
from firable.nets.document_errors import Shape, document_problems, keys_of, version_problem
from firable.nets.source import Source, quoted, read_source
from firable.nets.yaml_tree import Node, Path, Scalar, as_written, data, node_span, nodes_along, parse_tree

SIZE_BYTES_MAX: Final = 1024 * 1024


def _number(value: object) -> object:
    # The tree resolves no numbers; a number that is none is left for pydantic to refuse.
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def _version(value: object) -> object:
    return 1 if value == "1" else value


Seconds = Annotated[float, BeforeValidator(_number), Field(ge=0, le=1e6, allow_inf_nan=False)]
Probability = Annotated[float, BeforeValidator(_number), Field(ge=0.0, le=1.0, allow_inf_nan=False)]
GOOD: Final = 0.9
"""How often a workpiece is found good in a simulated run, unless the plant file says otherwise."""
_AGREE: Final = 1e-9
"""How far two sensors may be apart that say how often: 1 - 0.3 is not 0.7."""

SWITCHED_SECONDS_MIN: Final = 0.001
"""So long at least a signal that is set from outside again and again stays what it is: each change costs a simulated
run as much as any, and a time that is lost when it is added to the run's is none."""


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", strict=True, frozen=True, populate_by_name=False)


class Failure(StrEnum):
    """What comes after a command that a machine failed at: it is repaired and goes on, or stands still for good."""

    REPAIRABLE = "repairable"
    FOR_GOOD = "for_good"


class _Timed(_Model):
    takes_s: Seconds
    jitter_s: Seconds = 0.0
    may_fail: Annotated[Failure | None, Field(strict=False), BeforeValidator(given, json_schema_input_type=Failure)] = (
        None
    )


class Move(_Timed):
    """Move the hand to the position named by the command's parameter `to`."""

    does: Literal["move"]


class Grasp(_Timed):
    """Take the workpiece that lies at the hand; the command's parameter `at` is the position where this must be."""

    does: Literal["grasp"]


class Put(_Timed):
    """Lay down the workpiece in the hand, at the position of the parameter `at`.

    On a full station the machine collides with what lies there, or, with `when_full: wait`, holds on until it is free.
    """

    does: Literal["put"]
    when_full: Literal["collide", "wait"] = "collide"


class Carry(_Timed):
    """Carry the workpiece from one station to another; on a full one it collides or waits, as one that is put does."""

    does: Literal["carry"]
    source: Name = Field(alias="from")
    target: Name = Field(alias="to")
    when_full: Literal["collide", "wait"] = "collide"


class Clamp(_Timed):
    """Clamp the workpiece on a station."""

    does: Literal["clamp"]
    station: Name


class Process(_Timed):
    """Machine the clamped workpiece on a station."""

    does: Literal["process"]
    station: Name


class Release(_Timed):
    """Unclamp the workpiece on a station."""

    does: Literal["release"]
    station: Name


class Work(_Timed):
    """Do something that moves no workpiece and touches none: go home, open a door, measure."""

    does: Literal["work"]


class Index(_Timed):
    """Move every workpiece to the next station at once, as an index table or a walking beam does.

    `next` says of each station which one that is; round in a circle, if the last leads to the first. The workpieces are
    taken up as the command is sent, and lie on the next stations when it is done; one that lies there already is
    collided with. Until then nobody else may lay anything on a station of the machine, or take anything from it.
    """

    does: Literal["index"]
    following: dict[Name, Name] = Field(alias="next", min_length=1)

    @property
    def stations(self) -> tuple[str, ...]:
        """The stations that it moves workpieces from or to."""
        return tuple(dict.fromkeys((*self.following, *self.following.values())))


class Switch(_Model):
    """Switch an output that moves nothing and answers nothing, a lamp or a horn; it is done as it is sent."""

    does: Literal["switch"]
    takes_s: ClassVar[float] = 0.0
    jitter_s: ClassVar[float] = 0.0
    may_fail: ClassVar[None] = None


class Stop(_Model):
    """Stop whatever the machine does; at once, or, with `takes_s`, as long as it takes to come to rest.

    At once what it was at is left undone; else, and where a place waits for the end of the stop, it may still be done
    before the machine has come to rest.
    """

    does: Literal["stop"]
    takes_s: Seconds = 0.0
    jitter_s: Seconds = 0.0


Action = Annotated[
    Move | Grasp | Put | Carry | Index | Clamp | Process | Release | Work | Switch | Stop,
    Field(discriminator="does"),
]
_ACTIONS: Final[tuple[type[BaseModel], ...]] = get_args(get_args(Action)[0])


class Machine(_Model):
    """A machine; one with a hand has positions, each in front of a station or of nothing."""

    hand: OptionalName = Field(default=None, description="The position where the hand is at first.")
    positions: dict[Name, Name | None] = {}
    commands: dict[Name, Action]

    @property
    def holds(self) -> bool:
        """Whether it can hold a workpiece: in its hand, or while it carries one."""
        return self.hand is not None or any(isinstance(action, Carry) for action in self.commands.values())

    @property
    def indexes(self) -> frozenset[str]:
        """The stations that move as it indexes, by whichever command: it is one table, or one beam."""
        return frozenset(
            station for action in self.commands.values() if isinstance(action, Index) for station in action.stations
        )


class Arrivals(_Model):
    """Where workpieces come from: one each `every_s`, as soon as the station is empty."""

    station: Name
    every_s: Seconds
    jitter_s: Seconds = 0.0


class Departure(_Model):
    """Where finished workpieces are taken away, `after_s` after they arrive; where they may be `raw`, any are."""

    station: Name
    after_s: Seconds = 0.0
    raw: bool = False


class Sensor(_Model):
    """What a sensor sees: a workpiece on a station, one in the hand of a machine, an operator who presses a key,
    whether a workpiece is good, or what somebody sets from outside.

    A workpiece is judged some time after it has come to a station of which a sensor sees what `passes` or what `fails`,
    and again when it has been machined there; the judgement stands until then, or until the workpiece leaves. In a
    simulated run it takes `after_s`, and the sensor sees what comes with the probability `likely`, without it 0.9 for
    `passes` and 0.1 for `fails`; a model of the machines leaves open when and how it is judged.

    One that may flicker can drop while the workpiece is there, and come back; one that may linger can stay for a while
    when the workpiece has gone. A key acknowledges a fault: in a simulated run it is pressed `after_s` after the
    machine was stopped in the midst of a command; a model of the machines leaves open when and how often. The next
    command to the machine releases it.

    What is set from outside, by the key of an operator, a door or the next cell, is 0 at first, and may change at any
    time. In a simulated run it is 0 for `after_s`, and then 1: for good, or for `for_s`, and so on.
    """

    occupied: OptionalName = None
    holding: OptionalName = None
    acknowledges: OptionalName = None
    set_by: OptionalName = None
    passes: OptionalName = None
    fails: OptionalName = None
    likely: Annotated[Probability | None, BeforeValidator(given, json_schema_input_type=Probability)] = None
    after_s: Seconds = 0.0
    for_s: Annotated[Seconds | None, BeforeValidator(given, json_schema_input_type=Seconds)] = None
    may_flicker: bool = False
    may_linger: bool = False

    @property
    def judges(self) -> str | None:
        """The station whose workpieces it shows the judgement of, if that is what it shows."""
        return self.passes or self.fails

    @property
    def by_hand(self) -> bool:
        """Whether it shows what somebody does, and nothing of the machines and workpieces."""
        return self.acknowledges is not None or self.set_by is not None

    @property
    def station(self) -> str | None:
        """The station that it looks at, if it looks at one."""
        return self.occupied or self.judges

    @property
    def good(self) -> float | None:
        """How likely it says a workpiece is to be found good, if it says so."""
        return self.likely if self.likely is None or self.passes is not None else 1 - self.likely


def _as_list(value: object) -> object:
    return [value] if isinstance(value, dict) else value


class PlantModel(_Model):
    """A whole plant file."""

    firable_plant: Annotated[Literal[1], BeforeValidator(_version)]
    plant: Name = Field(description="The cell of the net.")
    description: str = ""
    stations: list[Name]
    full_at_first: dict[Name, Literal["raw", "machined"]] = Field(
        default={}, description="The stations where a workpiece lies at first, and whether it was machined."
    )
    arrivals: Arrivals
    departures: Annotated[
        list[Departure],
        BeforeValidator(_as_list, json_schema_input_type=Departure | Annotated[list[Departure], Field(min_length=1)]),
        Field(min_length=1),
    ]
    machines: dict[Name, Machine]
    sensors: dict[Name, Sensor] = {}
    _read: tuple[Source, Node] | None = PrivateAttr(default=None)

    @property
    def machines_workpieces(self) -> bool:
        """Whether some machine machines workpieces; else all are finished as they come."""
        return any(isinstance(one, Process) for machine in self.machines.values() for one in machine.commands.values())

    def departure(self, station: str) -> Departure | None:
        """How workpieces are taken away at a station, if they are."""
        return next((departure for departure in self.departures if departure.station == station), None)

    def misfit(self, path: Path, subject: Subject, message: str, hint: str) -> Diagnostic:
        """What does not fit a net (F5003), at the place of the file that a path leads to, as far as it does."""
        return Diagnostic("F5003", message, hint, subject, self.span(path))

    def span(self, path: Path) -> Span | None:
        """Where a path of the file ends, as far as it leads; None where the plant is of no file."""
        return _span(*self._read, path) if self._read else None


SEEN: Final = (
    "`occupied: STATION`, `holding: MACHINE`, `acknowledges: MACHINE`, `passes: STATION` or `fails: STATION` "
    "(a workpiece there was found good, or not), or `set_by: WHO` (an operator, a door, the next cell)"
)
"""What a sensor can see, for who has to write it."""
_COMMAND: Final = ("machines", "*", "commands", "*")
SHAPE: Final = Shape(
    "firable_plant",
    "plant file",
    {
        path: keys_of(model)
        for path, model in (
            ((), PlantModel),
            (("arrivals",), Arrivals),
            (("departures", "*"), Departure),
            (("machines", "*"), Machine),
            (("sensors", "*"), Sensor),
        )
    }
    | {(*_COMMAND, *get_args(action.model_fields["does"].annotation)): keys_of(action) for action in _ACTIONS}
    | {_COMMAND: tuple(dict.fromkeys(key for action in _ACTIONS for key in keys_of(action)))},
    {"machines": "machine", "positions": "position", "commands": "command", "sensors": "sensor"},
    (_COMMAND,),
)


def read_plant(path: FilePath | str) -> PlantModel:
    """Read a plant file; raises `InputError` F1001-F1011 for the text, F5003 where it contradicts itself."""
    return _parse(read_source(path, SIZE_BYTES_MAX))


def parse_plant(text: str, file: str = "<plant>") -> PlantModel:
    """Read a plant from text, as `read_plant` does."""
    return _parse(Source(file, text))


def _parse(source: Source) -> PlantModel:
    tree = parse_tree(source, SHAPE.file, f"`{SHAPE.version}: 1` and `plant: NAME`; docs/machines.md describes it")
    if problem := version_problem(source, tree, SHAPE):
        raise InputError([problem])
    try:
        model = PlantModel.model_validate(data(tree))
    except ValidationError as error:
        raise InputError(document_problems(source, tree, error, SHAPE)) from None
    if problems := [_contradiction(source, tree, *found) for found in _inconsistencies(model)]:
        raise InputError(problems)
    model._read = (source, tree)
    return model


def _contradiction(source: Source, tree: Node, path: Path, message: str, hint: str) -> Diagnostic:
    path = as_written(tree, path)
    said = f"{quoted('.'.join(map(str, path)))}: {message}"
    return Diagnostic("F5003", said, hint, tuple(map(str, path)), _span(source, tree, path))


def _span(source: Source, tree: Node, path: Path) -> Span:
    """Where a path of a file ends, as far as it leads: at a value of one word, else at the key."""
    key, node = list(nodes_along(tree, path))[-1]
    return node_span(source, node if isinstance(node, Scalar) and node.text else key or node)


def _inconsistencies(model: PlantModel) -> Iterator[tuple[Path, str, str]]:
    yield from _no_names(model)
    stations = set(model.stations)
    for i, name in enumerate(model.stations):
        if name in model.stations[:i]:
            yield ("stations", i), f"the station '{name}' stands here a second time", "write it once, or rename one"

    def station(path: Path, name: str | None) -> Iterator[tuple[Path, str, str]]:
        if name is not None and name not in stations:
            yield path, f"there is no station '{name}'", did_you_mean(name, model.stations) + "see `stations`"

    yield from station(("arrivals", "station"), model.arrivals.station)
    ends = [departure.station for departure in model.departures]
    for i, end in enumerate(ends):
        yield from station(("departures", i, "station"), end)
        if end in ends[:i]:
            yield ("departures", i), f"workpieces leave at '{end}' by an earlier entry", "write each station once"
    for full, kind in model.full_at_first.items():
        yield from station(("full_at_first", full), full)
        yield from _contradicted(model, full, kind)
    for name, machine in model.machines.items():
        path = ("machines", name)
        if name == "safe":
            yield path, "'safe' is the verdict on accidents, and no name for a machine", "rename the machine"
        if name in stations:
            yield path, "a station has this name, too", "rename one of them"
        if whose := next((other for other in model.machines if name.startswith(f"{other}.")), None):
            yield path, f"verdicts on '{whose}' have names like those on this machine", "rename it, without the dot"
        if machine.hand is not None and machine.hand not in machine.positions:
            yield (*path, "hand"), f"there is no position '{machine.hand}'", "see `positions` of the machine"
        for position, at in machine.positions.items():
            yield from station((*path, "positions", position), at)
        for command, action in machine.commands.items():
            inner = (*path, "commands", command)
            match action:
                case Move() | Grasp() | Put() if machine.hand is None:
                    yield inner, f"'{name}' has no hand", "give the machine `hand` and `positions`"
                case Carry(source=source, target=target):
                    yield from station((*inner, "from"), source)
                    yield from station((*inner, "to"), target)
                case Index():
                    for leaves, comes in action.following.items():
                        yield from station((*inner, "next", leaves), leaves)
                        yield from station((*inner, "next", leaves), comes)
                    yield from _meeting((*inner, "next"), action.following)
                    if any(isinstance(one, Stop) for one in machine.commands.values()):
                        message = f"'{name}' has a `stop`, too, which could leave workpieces between two stations"
                        hint = "leave out the `stop`: `within` of a place tells of an `index` that is not done in time"
                        yield inner, message, hint
                case Clamp(station=at) | Process(station=at) | Release(station=at):
                    yield from station((*inner, "station"), at)
    for name, sensor in model.sensors.items():
        seen = (sensor.occupied, sensor.holding, sensor.acknowledges, sensor.passes, sensor.fails, sensor.set_by)
        if sum(one is not None for one in seen) != 1:
            yield ("sensors", name), "a sensor sees one thing", f"write {SEEN}"
        if sensor.judges is not None and (sensor.may_flicker or sensor.may_linger):
            hint = "leave out `may_flicker` and `may_linger`; a sensor with `occupied` can have them"
            yield ("sensors", name), "a judgement stands until the workpiece leaves", hint
        if sensor.judges is None and sensor.likely is not None:
            hint = "`likely` belongs to `passes` and `fails`"
            yield ("sensors", name, "likely"), "nothing is judged by this sensor", hint
        if sensor.acknowledges is not None and (sensor.may_flicker or sensor.may_linger):
            yield ("sensors", name), "a key is pressed or not", "leave out `may_flicker` and `may_linger`"
        if sensor.set_by is not None and (sensor.may_flicker or sensor.may_linger):
            hint = "leave out `may_flicker` and `may_linger`"
            yield ("sensors", name), "what is set from outside may change at any time as it is", hint
        if not sensor.by_hand and sensor.judges is None and sensor.after_s:
            hint = "`after_s` belongs to `acknowledges`, `passes`, `fails` and `set_by`"
            yield ("sensors", name, "after_s"), "a sensor sees at once", hint
        if sensor.for_s is not None and sensor.set_by is None:
            yield ("sensors", name, "for_s"), "nobody sets this sensor", "`for_s` belongs to `set_by`"
        elif sensor.for_s is not None and min(sensor.for_s, sensor.after_s) < SWITCHED_SECONDS_MIN:
            least = f"at least {SWITCHED_SECONDS_MIN:g} s"
            hint = f"give `for_s` and `after_s` {least}, or leave out `for_s`: then it stays 1"
            yield ("sensors", name, "for_s"), "it would change again and again, and hardly any time would pass", hint
        for where, at in (("occupied", sensor.occupied), ("passes", sensor.passes), ("fails", sensor.fails)):
            yield from station(("sensors", name, where), at)
        for key, machine_seen in (("holding", sensor.holding), ("acknowledges", sensor.acknowledges)):
            if machine_seen is not None and machine_seen not in model.machines:
                yield ("sensors", name, key), f"there is no machine '{machine_seen}'", "see `machines`"
        if sensor.holding in model.machines and not model.machines[sensor.holding].holds:
            hint = "a machine with `hand`, or with a command that does `carry`, holds workpieces"
            yield ("sensors", name, "holding"), f"'{sensor.holding}' never holds anything", hint
    yield from _disagreements(model)


def _contradicted(model: PlantModel, at: str, kind: str) -> Iterator[tuple[Path, str, str]]:
    """What else the file says of a station where a workpiece lies at first, which cannot be so, too."""
    path, departure = ("full_at_first", at), model.departure(at)
    if at == model.arrivals.station:
        hint = "leave it out: one that lies there is the first that comes"
        yield path, f"workpieces come to '{at}', and each only when it is empty", hint
    elif kind == "machined" and not model.machines_workpieces:
        yield path, "no machine of the cell machines workpieces: none does `process`", "write `raw`"
    elif kind == "raw" and model.machines_workpieces and departure is not None and not departure.raw:
        hint = "write `machined` here, or `raw: true` of the departure"
        yield path, f"workpieces leave at '{at}', and none may leave without having been machined", hint


def _meeting(path: Path, following: Mapping[str, str]) -> Iterator[tuple[Path, str, str]]:
    """Stations that lead to themselves, or two to one, where workpieces would meet."""
    first: dict[str, str] = {}
    for at, to in following.items():
        if to == at:
            yield (*path, at), "a workpiece that is moved comes to another station", "leave the station out if it stays"
        elif (other := first.setdefault(to, at)) != at:
            message = f"workpieces from '{other}' and from '{at}' would meet at '{to}'"
            yield (*path, at), message, "give each station a next one of its own"


def _no_names(model: PlantModel) -> Iterator[tuple[Path, str, str]]:
    """What the places and transitions of the closed loop are named after, and verdicts on machines."""
    named: list[tuple[Path, str, str]] = [(("stations", i), name, "station") for i, name in enumerate(model.stations)]
    for name, machine in model.machines.items():
        path = ("machines", name)
        named.append((path, name, "machine"))
        named += [((*path, "positions", position), position, "position") for position in machine.positions]
    for where, name, what in named:
        if not name.isprintable():
            message = f"{quoted(name)} is not a name for a {what}: it has a character that cannot be seen"
            yield where, message, "write it in visible characters, here and in the net"


def _disagreements(model: PlantModel) -> Iterator[tuple[Path, str, str]]:
    """Sensors that say of one station how likely a workpiece is to be found good, and say different things."""
    first: dict[str, tuple[str, float]] = {}
    for name, sensor in model.sensors.items():
        if sensor.judges is None or sensor.good is None:
            continue
        other, good = first.setdefault(sensor.judges, (name, sensor.good))
        if not isclose(good, sensor.good, abs_tol=_AGREE):
            message = f"a workpiece at '{sensor.judges}' is found good with {_share(good)}, as '{other}' says, "
            message += f"and here with {_share(sensor.good)}"
            hint = "say it once: there is one judgement of a station, and `likely` of `fails` is that it is not good"
            yield ("sensors", name, "likely"), message, hint


def _share(probability: float) -> str:
    return f"{round(probability, 9):.9g}"
