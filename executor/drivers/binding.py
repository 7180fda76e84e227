"""The binding, `*.bind.yaml`: at which address of which device each signal and command of a net is found.

It is never part of what is proved: the same bundle runs on the simulated cell and, with another binding, on the floor,
and both meet at `firable run BUNDLE --bind FILE`. So nothing here can change what a net does, only what it does it to,
and everything here must be there: each signal and each command is bound once (`fitting.py`), in one file, to devices of
as many kinds as the cell has. The alternative, addresses in the net file, would make a net of every rewiring.

A device has *channels*, each for one machine. A command goes to its channel as some values and, last, its number; the
device shows which number it has taken, done or failed at (`channels.py` says why by numbers).

The file is read like a net file: bounded, without ambiguous YAML, each mistake with its line.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, WithJsonSchema

from firable.executor.drivers.device import Bounded, DeviceKind, Divided, Options, Point, Use, Value, Writes, files_of
from firable.executor.drivers.kinds import kind_named
from firable.executor.drivers.overlapping import overlaps
from firable.nets.diagnostics import Diagnostic, InputError, Severity, did_you_mean
from firable.nets.document import as_list, given
from firable.nets.document_errors import Shape, document_problems, keys_of, version_problem
from firable.nets.secret_files import warning_if_open
from firable.nets.source import Source, printable, quoted, read_bytes, read_source
from firable.nets.yaml_tree import Data, Node, data, node_span, nodes_along, parse_tree
from firable.nets.yaml_tree import Path as TreePath

SIZE_BYTES_MAX: Final = 1024 * 1024
FILE_BYTES_MAX: Final = 1_000_000
"""More than any certificate or key needs."""

NUMBER_MAX: Final = 65_535
"""Numbers of commands and of heartbeats fit a register of 16 bits; 0 is no command."""

ACKNOWLEDGED: Final = "acknowledged"
"""How the binding writes of a completion that no sensor has a part in it."""


Name = Annotated[str, Field(min_length=1)]
Seconds = Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
Grace = Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]
Controllers = Annotated[
    tuple[Name, ...] | None,
    BeforeValidator(
        lambda value: given(as_list(value) or None),
        json_schema_input_type=Name | Annotated[list[Name], Field(min_length=1)],
    ),
]
"""One or several: a contact that is for none of them would stop nothing."""
Writing = Annotated[
    str,
    BeforeValidator(
        lambda value: str(value).lower() if isinstance(value, bool) else value, json_schema_input_type=Value
    ),
]
"""A value as the file writes it; `writes` says what is meant."""


class _Model(BaseModel):
    # The tree of a file resolves no numbers: a text that is one is taken for it.
    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)


class HeartbeatDocument(_Model):
    """A point to which a growing number is written, so that the device stops its machines where none comes.

    `tripped` is a point by which the device tells that its watchdog has done so.
    """

    write: Name
    every_s: Seconds
    tripped: Name | None = None


class AliveDocument(_Model):
    """A point that changes by itself, so that a device that is silent can be told from one that has nothing to tell."""

    read: Name
    within_s: Seconds


class NothingDocument(_Model):
    """An empty mapping, which says that there is none."""


Heartbeat = Annotated[
    HeartbeatDocument | None,
    BeforeValidator(
        lambda value: None if value == {} else given(value), json_schema_input_type=HeartbeatDocument | NothingDocument
    ),
]


class ChannelDocument(_Model):
    """Where the commands of one machine go, and where it shows the numbers of what it has taken, done or failed at.

    The number stands alone at `number`, behind what the command writes; or `command` takes a text with the number, the
    command and its parameters as the net has them. A device that knows no numbers has a bit `request`, and bits that
    say what has become of it (`handshake.py`).
    """

    number: Name | None = None
    command: Name | None = None
    request: Name | None = None
    taken: Name | None = None
    done: Name | None = None
    failed: Name | None = None

    @property
    def asks(self) -> Point:
        """The point by which a command is given."""
        return str(self.number or self.command or self.request)

    @property
    def shows(self) -> dict[Point, str]:
        """The points that are read, and of what."""
        keys = {"taken": self.taken, "done": self.done, "failed": self.failed}
        return {point: key for key, point in keys.items() if point is not None}


class DeviceDocument(_Model):
    """One device: its kind, its channels, its safe outputs; the other keys are of its kind."""

    model_config = ConfigDict(extra="allow")
    driver: Name
    channels: dict[Name, ChannelDocument] = {}
    safe: dict[Name, Writing] = {}
    heartbeat: Heartbeat = None
    alive: AliveDocument | None = None
    timeout_s: Seconds = 1.0
    start_s: Seconds = 5.0
    grace_s: Grace = 0.0
    retry_s: Seconds = 0.1
    retry_max_s: Seconds = 5.0


class SignalDocument(_Model):
    """Where a signal is read; of a completion, the sensor that must agree with the acknowledgement."""

    device: Name
    read: Name
    invert: bool = False
    on_loss: Annotated[Literal["fault", "hold", "0", "1"], WithJsonSchema({"enum": ["fault", "hold", 0, 1]})] = "fault"
    edges: Name | None = None
    force: bool = False


class EmergencyDocument(_Model):
    """A contact that is closed, 1, as long as nobody presses the button; anything else stops the machines at once.

    It is for all controllers, or for those that are named; each looks at it for itself.
    """

    device: Name
    read: Name
    invert: bool = False
    controllers: Controllers = None


class CommandDocument(_Model):
    """What the command of a place writes, and the channel by which it goes."""

    device: Name
    channel: Name
    write: dict[Name, Writing] = {}
    force: bool = False


def _signal(value: object) -> object:
    return None if value == ACKNOWLEDGED else {} if value is None else value


BoundSignal = Annotated[
    SignalDocument | None, BeforeValidator(_signal, json_schema_input_type=SignalDocument | Literal["acknowledged"])
]


class BindingDocument(_Model):
    """A whole binding."""

    firable_bind: Annotated[Literal[1], BeforeValidator(lambda value: 1 if value == "1" else value)]
    cell: Name
    description: str = ""
    devices: dict[Name, DeviceDocument]
    emergency_stop: dict[Name, EmergencyDocument] = {}
    signals: dict[Name, BoundSignal] = {}
    commands: dict[Name, CommandDocument] = {}


SHAPE: Final = Shape(
    "firable_bind",
    "binding",
    {
        path: keys_of(model)
        for path, model in (
            ((), BindingDocument),
            (("devices", "*"), DeviceDocument),
            (("devices", "*", "heartbeat"), HeartbeatDocument),
            (("devices", "*", "alive"), AliveDocument),
            (("devices", "*", "channels", "*"), ChannelDocument),
            (("emergency_stop", "*"), EmergencyDocument),
            (("signals", "*"), SignalDocument),
            (("commands", "*"), CommandDocument),
        )
    },
    {"devices": "device", "emergency_stop": "contact", "signals": "signal", "commands": "place"},
)


@dataclass(frozen=True)
class Binding:
    """A binding that is right in itself: what it says, of which kind each device is, and where it stands."""

    document: BindingDocument
    kinds: Mapping[str, DeviceKind]
    options: Mapping[str, Options]
    source: Source
    tree: Node

    def problem(self, code: str, path: TreePath, message: str, hint: str = "") -> Diagnostic:
        """A diagnostic at a path of the file."""
        return _problem(self.source, self.tree, code, path, message, hint)

    def is_one(self, name: str, other: str) -> bool:
        """Whether two of its devices are one, or stand at one address."""
        return _is_one(self.document, self.options, name, other)

    def unreadable(self) -> Iterator[Diagnostic]:
        """The files of its devices that cannot be read (F1001, F1003): certificates and keys.

        Asked of the devices that are served here: another host's files are on that host.
        """
        for name in self.document.devices:
            for keys, file in files_of(self.options[name]):
                try:
                    read_bytes(file, FILE_BYTES_MAX)
                except InputError as error:
                    for one in error.diagnostics:
                        hint = "a path in a binding begins at the folder of the binding, unless it begins with /"
                        yield self.problem(
                            one.code, ("devices", name, *keys), f"{printable(file)}: {one.message}", hint
                        )

    def exposed(self) -> Iterator[Diagnostic]:
        """Warnings of what is no secret: passwords on a network (F5027), passwords and keys on this host (F5026)."""
        for name, options in self.options.items():
            if options.is_overheard:
                message = f"the password of '{name}' goes over the network as it is: whoever is on it can read that"
                hint = f"encrypt it, as docs/drivers.md tells of `driver: {self.document.devices[name].driver}`"
                told = self.problem("F5027", ("devices", name, "password"), message, hint)
                yield replace(told, severity=Severity.WARNING)
            for keys, file in files_of(options):
                if keys[-1] == "key":
                    yield from warning_if_open(file, "key")
        if any(getattr(one, "password", None) is not None for one in self.options.values()):
            yield from warning_if_open(self.source.file, "password")

    def watching(self) -> Binding:
        """The binding for who only looks: without safe outputs and heartbeats, which are another's to write.

        Contacts of the emergency stop stop nothing, and are shown as signals are.
        """
        document = self.document
        devices = {name: _looked_at(device) for name, device in document.devices.items()}
        contacts = {
            shown_as(name): SignalDocument(device=one.device, read=one.read, invert=one.invert, on_loss="hold")
            for name, one in document.emergency_stop.items()
        }
        update = {"devices": devices, "emergency_stop": {}, "signals": {**document.signals, **contacts}}
        return replace(self, document=document.model_copy(update=update))

    def without(self, devices: Collection[str]) -> Binding:
        """The binding without some devices, as if nothing was bound to them."""
        bound = {**self.document.signals, **self.document.commands}
        kept = self.serving({name for name, one in bound.items() if one is None or one.device not in devices})
        document = kept.document
        contacts = {name: one for name, one in document.emergency_stop.items() if one.device not in devices}
        needed = {name: one for name, one in document.devices.items() if name not in devices}
        return replace(kept, document=document.model_copy(update={"devices": needed, "emergency_stop": contacts}))

    def serving(
        self,
        names: Collection[str],
        controllers: Collection[str] | None = None,
        driven: Collection[str] | None = None,
    ) -> Binding:
        """What the binding says of these signals and places, and the devices that they need.

        Of the emergency stop, what is for one of these controllers. A device that is not `driven` is only looked at;
        where nobody says which are, one that is needed for that stop alone. Its safe outputs and its heartbeat are for
        the host whose machines it has.
        """
        document = self.document
        contacts = {
            name: one
            for name, one in document.emergency_stop.items()
            if controllers is None or one.controllers is None or not set(controllers).isdisjoint(one.controllers)
        }
        signals = {name: signal for name, signal in document.signals.items() if name in names}
        commands = {name: command for name, command in document.commands.items() if name in names}
        needed = {one.device for one in (*signals.values(), *commands.values()) if one is not None}
        watched = {one.device for one in contacts.values()} - needed
        driven = needed if driven is None else driven
        devices = {
            name: device if name in driven else _looked_at(device)
            for name, device in document.devices.items()
            if name in needed | watched or (name in driven and (device.safe or device.heartbeat is not None))
        }
        update = {"devices": devices, "emergency_stop": contacts, "signals": signals, "commands": commands}
        return replace(self, document=document.model_copy(update=update))


def shown_as(contact: str) -> str:
    """How a contact of the emergency stop is called among the readings of a driver.

    >>> shown_as("door")
    'emergency stop door'
    """
    return f"emergency stop {contact}"


def _looked_at(device: DeviceDocument) -> DeviceDocument:
    return device.model_copy(update={"safe": {}, "heartbeat": None})


def read_binding(path: Path | str) -> Binding:
    """Read a binding; raises `InputError` F1001-F1011, F5101-F5103."""
    return _parse(read_source(path, SIZE_BYTES_MAX))


def parse_binding(text: str, file: str = "<binding>") -> Binding:
    """Read a binding from text, as `read_binding` does."""
    return _parse(Source(file, text))


def _is_one(document: BindingDocument, options: Mapping[str, Options], name: str, other: str) -> bool:
    if name == other or other not in document.devices:
        return name == other
    is_alike = document.devices[name].driver == document.devices[other].driver
    return is_alike and options[name].far_end() == options[other].far_end()


def _problem(source: Source, tree: Node, code: str, path: TreePath, message: str, hint: str) -> Diagnostic:
    key, node = list(nodes_along(tree, path))[-1]
    return Diagnostic(code, message, hint, tuple(map(str, path)), node_span(source, key or node))


def _parse(source: Source) -> Binding:
    tree = parse_tree(source, SHAPE.file, f"`{SHAPE.version}: 1` and `cell: NAME`; docs/drivers.md has a whole one")
    if problem := version_problem(source, tree, SHAPE):
        raise InputError([problem])
    try:
        document = BindingDocument.model_validate(data(tree))
    except ValidationError as error:
        raise InputError(document_problems(source, tree, error, SHAPE)) from None
    reading = _Reading(source, tree, document)
    reading.devices()
    if not reading.problems:  # addresses of a device that is not understood cannot be judged
        reading.points()
    if reading.problems:
        raise InputError(reading.problems)
    return Binding(document, reading.kinds, reading.options, source, tree)


class _Reading:
    """The checks of a document that need no net."""

    def __init__(self, source: Source, tree: Node, document: BindingDocument) -> None:
        self.source = source
        self.tree = tree
        self.document = document
        self.kinds: dict[str, DeviceKind] = {}
        self.options: dict[str, Options] = {}
        self.problems: list[Diagnostic] = []

    def problem(self, code: str, path: TreePath, message: str, hint: str) -> None:
        self.problems.append(_problem(self.source, self.tree, code, path, message, hint))

    def devices(self) -> None:
        """Find the kind of each device, and read the keys that are its own."""
        for name, device in self.document.devices.items():
            try:
                kind = self.kinds[name] = kind_named(device.driver)
            except InputError as error:
                for one in error.diagnostics:
                    self.problem(one.code, ("devices", name, "driver"), one.message, one.hint)
                continue
            own: dict[str, Data] = dict(device.model_extra or {})
            try:
                folder = Path(self.source.file).parent
                self.options[name] = kind.options.model_validate(own, context={"folder": folder})
            except ValidationError as error:
                keys = (*keys_of(DeviceDocument), *keys_of(kind.options))
                shape = Shape(SHAPE.version, SHAPE.file, {("devices", name): keys}, {})
                self.problems += document_problems(self.source, self.tree, error, shape, ("devices", name))

    def points(self) -> None:
        """Judge every address by its kind, and every reference to a device or a channel."""
        for name, device in self.document.devices.items():
            for path, point, use in _device_points(device):
                self.point(name, ("devices", name, *path), point, use)
            self.values(name, ("devices", name, "safe"), device.safe)
            for path, point, value, what in _device_writes(device):
                self.takes(name, ("devices", name, *path), point, value, what)
            for channel, body in device.channels.items():
                ways = [one for one in (body.number, body.command, body.request) if one is not None]
                if len(ways) != 1:
                    hint = "write `number: ADDRESS`, or `command: ADDRESS`, or `request: ADDRESS`"
                    message = f"'{channel}' takes commands in one way"
                    self.problem("F5101", ("devices", name, "channels", channel), message, hint)
                elif body.request is not None and body.taken is None and body.done is None:
                    hint = "write `done: ADDRESS`, where the device shows that it has done it, or `taken: ADDRESS`"
                    message = f"nobody would know when the request of '{channel}' may fall"
                    self.problem("F5101", ("devices", name, "channels", channel), message, hint)
        for name, contact in self.document.emergency_stop.items():
            if self.device(("emergency_stop", name), contact.device):
                self.contact(name, contact)
        for signal, bound in self.document.signals.items():
            if bound is not None and self.device(("signals", signal), bound.device):
                self.point(bound.device, ("signals", signal, "read"), bound.read, Use.READ)
                if bound.edges is not None:
                    self.point(bound.device, ("signals", signal, "edges"), bound.edges, Use.READ)
                if bound.force:
                    self.point(bound.device, ("signals", signal, "force"), bound.read, Use.WRITE)
                    self.forced(signal, bound)
        for place, command in self.document.commands.items():
            if not self.device(("commands", place), command.device):
                continue
            channels = self.document.devices[command.device].channels
            if command.channel not in channels:
                hint = did_you_mean(command.channel, list(channels)) + f"see `channels` of '{command.device}'"
                message = f"'{command.device}' has no channel {quoted(command.channel)}"
                self.problem("F5101", ("commands", place, "channel"), message, hint)
            for point in command.write:
                self.point(command.device, ("commands", place, "write", point), point, Use.WRITE)
            self.values(command.device, ("commands", place, "write"), command.write)
        for one, other in combinations(self.options, 2):
            if self.is_one(one, other) and (key := self.options[one].unlike(self.options[other])):
                message = f"'{other}' stands at the address of '{one}', and has another `{key}`"
                hint = f"write the same `{key}` for both, so that their points mean the same"
                self.problem("F5102", ("devices", other), message, hint)
        for path, message, hint in overlaps(self.document, self.is_one, self.whole):
            self.problem("F5102", path, message, hint)

    def contact(self, name: str, contact: EmergencyDocument) -> None:
        self.point(contact.device, ("emergency_stop", name, "read"), contact.read, Use.READ)
        if self.kinds[contact.device].through_broker and self.document.devices[contact.device].alive is None:
            message = f"whether '{contact.device}' is there is not to be seen through its broker"
            hint = "give the device `alive: {read: ADDRESS, within_s: SECONDS}`, so that its loss stops the machines"
            self.problem("F5101", ("emergency_stop", name, "device"), message, hint)

    def forced(self, signal: str, bound: SignalDocument) -> None:
        """Refuse a signal that may be forced at the point of a contact of the emergency stop: that would close it."""
        for name, contact in self.document.emergency_stop.items():
            if self.is_one(bound.device, contact.device) and self.is_written_with(bound, contact):
                message = f"'{bound.read}' shows the contact '{name}', which is opened and closed by hand alone"
                hint = "leave out `force: true`, or read the signal where no contact of the emergency stop is"
                self.problem("F5102", ("signals", signal, "force"), message, hint)

    def is_one(self, name: str, other: str) -> bool:
        """Whether two devices are one, or stand at one address."""
        return _is_one(self.document, self.options, name, other)

    def is_written_with(self, bound: SignalDocument, contact: EmergencyDocument) -> bool:
        """Whether what is written to a signal changes what a contact of the same device shows."""
        written, shown = bound.read, contact.read
        return shown in (written, self.whole(bound.device, written)) or written == self.whole(bound.device, shown)

    def whole(self, device: str, point: Point) -> Point:
        """The point of a device that is written with another one, which is a part of it; itself where it is none."""
        kind = self.kinds[device]
        return kind.whole(point) if isinstance(kind, Divided) else point

    def device(self, path: TreePath, name: str) -> bool:
        if name in self.document.devices:
            return True
        hint = did_you_mean(name, list(self.document.devices)) + "see `devices`"
        self.problem("F5101", (*path, "device"), f"there is no device {quoted(name)}", hint)
        return False

    def point(self, device: str, path: TreePath, point: Point, use: Use) -> None:
        if problem := self.kinds[device].point_problem(point, use) or self.options[device].point_problem(point):
            hint = f"the addresses of `driver: {self.document.devices[device].driver}` are described in docs/drivers.md"
            self.problem("F5102", path, f"{quoted(point)} cannot be a point to {use}: {problem}", hint)

    def values(self, device: str, path: TreePath, mapping: Mapping[Point, str]) -> None:
        """Judge what is to be written to points, as far as they are points of the device."""
        kind = self.kinds[device]
        if not isinstance(kind, Bounded):
            return
        for point, value in writes(mapping):
            if not kind.point_problem(point, Use.WRITE) and (problem := kind.value_problem(point, value)):
                message = f"{quoted(str(value))} cannot be written to '{point}': {problem}"
                hint = "look up what the device understands, and write a value that it has"
                self.problem("F5102", (*path, point), message, hint)

    def takes(self, device: str, path: TreePath, point: Point, value: Value, what: str) -> None:
        """Judge what the driver itself writes to a point: a bit, say, takes no number, and would be 1 for ever."""
        kind = self.kinds[device]
        if not isinstance(kind, Bounded) or kind.point_problem(point, Use.WRITE):
            return
        if problem := kind.value_problem(point, value):
            hint = "look up where the device has what takes it, and give it that address"
            self.problem("F5102", path, f"'{point}' does not take {what}: {problem}", hint)


_CHANNEL_POINTS: Final[Mapping[str, Use]] = {
    **dict.fromkeys(("number", "command", "request"), Use.WRITE),
    **dict.fromkeys(("taken", "done", "failed"), Use.READ),
}


def _device_points(device: DeviceDocument) -> Iterator[tuple[TreePath, Point, Use]]:
    for point in device.safe:
        yield ("safe", point), point, Use.WRITE
    if device.heartbeat is not None:
        yield ("heartbeat", "write"), device.heartbeat.write, Use.WRITE
        if device.heartbeat.tripped is not None:
            yield ("heartbeat", "tripped"), device.heartbeat.tripped, Use.READ
    if device.alive is not None:
        yield ("alive", "read"), device.alive.read, Use.READ
    for name, channel in device.channels.items():
        for key, use in _CHANNEL_POINTS.items():
            if (point := getattr(channel, key)) is not None:
                yield ("channels", name, key), point, use


def _device_writes(device: DeviceDocument) -> Iterator[tuple[TreePath, Point, Value, str]]:
    """What is written to a device beside what stands in the binding, each by one that asks most of its point."""
    if device.heartbeat is not None:
        yield ("heartbeat", "write"), device.heartbeat.write, NUMBER_MAX, f"a heartbeat, which grows to {NUMBER_MAX}"
    for name, channel in device.channels.items():
        if channel.number is not None:
            what = f"the numbers of commands, up to {NUMBER_MAX}"
            yield ("channels", name, "number"), channel.number, NUMBER_MAX, what
        elif channel.command is not None:
            yield ("channels", name, "command"), channel.command, "7 R MOVE", "commands as texts, such as '7 R MOVE'"


def writes(mapping: Mapping[Point, str]) -> Writes:
    """The writes of a mapping of the file, in its order: truth values, numbers, texts.

    >>> writes({"coil 1": "true", "holding 2": "7", "node": "RUN"})
    (('coil 1', True), ('holding 2', 7), ('node', 'RUN'))
    """
    return tuple((point, _value(text)) for point, text in mapping.items())


def _value(text: str) -> Value:
    if text in {"true", "false"}:
        return text == "true"
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text
