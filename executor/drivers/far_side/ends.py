"""A binding for a simulated cell, and the servers that it leads to.

The machines are dealt out to the protocols in turn, one device for each protocol. Addresses are of no importance here
beyond being right; they are laid out as one would by hand: a block for each machine, one input for each sensor.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from firable.executor.drivers.binding import Binding, writes
from firable.executor.drivers.device import Point, Use, Value
from firable.executor.drivers.far_side.end import FarEnd
from firable.executor.drivers.kinds import kind_named
from firable.nets.diagnostics import InputError
from firable.nets.net import Command, Net, Place, SignalKind
from firable.nets.yaml_tree import is_ambiguous
from firable.nets.yaml_writing import scalar

PORTS: Final[dict[str, str]] = {"modbus": "15020", "opcua": "14840", "mqtt": "11883", "serial": ""}
"""The protocols, and the port of this host at which each is served; a serial line gets its name when it is made."""

HERE: Final = "127.0.0.1"
"""Where cells are served."""

HEARTBEAT_S: Final = 0.2

_PLAIN: Final = re.compile(r"\w[\w.;=/-]*(?: [\w.;=/-]+)*")

DESCRIPTION: Final = "description: a simulated cell behind real servers, by firable sim"
"""The line by which a binding that was made here is told from one of a site."""


@dataclass(frozen=True)
class _Layout:
    """The keys of a device of a protocol, and how its points are called."""

    protocol: str
    port: str

    @property
    def keys(self) -> Sequence[str]:
        """The lines that say where it is."""
        return {
            "modbus": ("driver: modbus-tcp", "host: 127.0.0.1", f"port: {self.port}"),
            "opcua": ("driver: opcua", f'url: "opc.tcp://127.0.0.1:{self.port}/"'),
            "mqtt": ("driver: mqtt", "host: 127.0.0.1", f"port: {self.port}"),
            "serial": ("driver: serial", f"port: {self.port}"),
        }[self.protocol]

    @property
    def parts(self) -> Sequence[str]:
        """What a channel has: a number beside what is written, or all in one text."""
        asked = ("number",) if self.protocol in {"modbus", "opcua"} else ("command",)
        return (*asked, "taken", "done", "failed")

    def machine(self, name: str, i: int, part: str) -> Point:
        """A point of the i-th machine."""
        if self.protocol == "modbus":
            registers = {"code": "holding 0", "number": "holding 1", "taken": "input 0", "done": "input 1"}
            table, _, offset = registers.get(part, "input 2").partition(" ")
            return f"{table} {10 * i + 10 + int(offset)}"
        return self._named(f"{name}/{part}", f"machine{i}/{part}")

    def device(self, part: str) -> Point:
        """A point of the device itself."""
        if self.protocol == "modbus":
            return {"beat": "holding 0", "tripped": "discrete 0", "stop": "coil 0"}[part]
        return self._named(f"device/{part}")

    def sensor(self, name: str, i: int) -> str:
        """How the i-th sensor is read, and whether it may be forced."""
        if self.protocol == "modbus":
            return f"read: discrete {i + 1}"
        return f"read: {_word(self._named(f'sensors/{name}', f'sensors/{i}'))}, force: true"

    def button(self, sensors: int) -> Point:
        """Where the contact of the emergency stop is read, behind so many sensors."""
        return f"discrete {sensors + 1}" if self.protocol == "modbus" else self._named("device/button")

    def _named(self, name: str, else_name: str = "") -> Point:
        """A point that is called so, or by its number where the protocol cannot have that: a line has no umlauts."""
        point = {"opcua": f"ns=2;s={name}", "mqtt": f"cell/{name}"}.get(self.protocol, name)
        if else_name and kind_named(self.protocol).point_problem(point, Use.READ):
            return self._named(else_name)
        return point


def _word(text: str) -> str:
    """A name or a point, in quotes where YAML takes it for something else."""
    return text if _PLAIN.fullmatch(text) and not is_ambiguous(text) else scalar(text)


def binding_text(net: Net, ports: Mapping[str, str], sensed: Collection[str]) -> str:
    """A binding of a net to these protocols at these ports, as a file; `sensed` are the signals that a sensor shows."""
    layouts = [_Layout(protocol, port) for protocol, port in ports.items()]
    commanded = [(place, place.command) for place in net.places if place.command is not None]
    machines = list(dict.fromkeys(command.machine for _, command in commanded))
    of = {machine: layouts[i % len(layouts)] for i, machine in enumerate(machines)}
    owners = {place.owner: of[command.machine] for place, command in commanded}
    lines = [
        "firable_bind: 1",
        f"cell: {_word(net.name)}",
        DESCRIPTION,
    ]
    lines += ["", "devices:"]
    for layout in layouts:
        own = {name: i for i, name in enumerate(machines) if of[name] is layout}
        lines += [f"  {layout.protocol}:", *(f"    {key}" for key in layout.keys)]
        beat, tripped = layout.device("beat"), layout.device("tripped")
        lines.append(f"    heartbeat: {{write: {beat}, every_s: {HEARTBEAT_S:g}, tripped: {tripped}}}")
        lines.append(f"    safe: {{{layout.device('stop')}: true}}")
        lines += ["    channels:"] if own else []
        for name, i in own.items():
            points = ", ".join(f"{part}: {_word(layout.machine(name, i, part))}" for part in layout.parts)
            lines.append(f"      {_word(name)}: {{{points}}}")
    # A broker shows nothing of a device that is lost, so no contact is read there.
    direct = [layout for layout in layouts if layout.protocol != "mqtt"]
    for layout in direct[:1]:
        read = layout.button(len(net.signals))
        lines += ["", "emergency_stop:", f"  button: {{device: {layout.protocol}, read: {read}}}"]
    shown = [(i, signal) for i, signal in enumerate(net.signals) if signal.kind is not SignalKind.TIMER]
    lines += ["", "signals:"] if shown else []
    for i, signal in shown:
        at = owners.get(signal.owner, layouts[0])
        read = f"{{device: {at.protocol}, {at.sensor(signal.name, i)}}}"
        lines.append(f"  {_word(signal.name)}: {read if signal.name in sensed else 'acknowledged'}")
    return "\n".join([*lines, "", "commands:", *_commands(commanded, machines, of), ""])


def _commands(
    commanded: Sequence[tuple[Place, Command]], machines: Sequence[str], of: Mapping[str, _Layout]
) -> Iterator[str]:
    codes: dict[str, int] = {}
    for place, command in commanded:
        name, layout = command.machine, of[command.machine]
        code = codes.setdefault(str(command), len(codes) + 1)
        write = f", write: {{{_word(layout.machine(name, machines.index(name), 'code'))}: {code}}}"
        written = write if "number" in layout.parts else ""
        yield f"  {_word(place.name)}: {{device: {layout.protocol}, channel: {_word(name)}{written}}}"


def ends_of(binding: Binding) -> dict[str, FarEnd]:
    """The servers to which a binding leads, on this host; raises `InputError` F5104 for a device that has none.

    Devices at one address have one server: that of a Modbus gateway where they are several units, one device or one
    broker that is reached by several connections else. A serial line is one device's, and its path a link to a
    pseudo-terminal while it is served.
    """
    at: dict[int | str, list[str]] = {}
    for name in binding.document.devices:
        at.setdefault(_address(binding, name)[1], []).append(name)
    return {name: end for port, names in at.items() for name, end in _ends(binding, port, names).items()}


def ports_of(binding: Binding) -> dict[str, int | str]:
    """Where on this host each device of a binding that can be served is: a port, or the path of a serial line."""
    return {name: _address(binding, name)[1] for name in binding.document.devices}


def _address(binding: Binding, name: str) -> tuple[str, int | str]:
    """The host and the port of a device; of one on a serial line no host, and a path."""
    options = binding.options[name].model_dump()
    host = options.get("host")
    match driver := binding.document.devices[name].driver:
        case "modbus-tcp" | "mqtt":
            port = options["port"]
        case "opcua":
            parts = urlsplit(options["url"])
            host, port = parts.hostname, parts.port
        case "serial" | "modbus-rtu":
            return "", str(options["port"])
        case _:
            message = f"`driver: {driver}` leads to nothing that can be served on this host"
            hint = (
                "the cell that is served has all machines of the net: give these a protocol, too, or let the binding "
                "be made, by protocols such as --modbus --opcua"
            )
            raise InputError([binding.problem("F5104", ("devices", name, "driver"), message, hint)])
    return HERE if str(host).lower() == "localhost" else str(host), int(port)


def _refuse_what_is_elsewhere(binding: Binding, name: str) -> None:
    """Refuse (F5104) a device that nobody would reach where it is served, or as it is served."""
    options = binding.options[name].model_dump()
    host, _ = _address(binding, name)
    if host not in {"", HERE}:
        key, message = (
            "url" if "url" in options else "host",
            f"'{name}' is at {host}, and a cell is served at {HERE} alone",
        )
        hint = f"in a binding for the simulation, write {HERE}"
    elif key := next((one for one in ("tls", "security") if options.get(one)), ""):
        message = f"'{name}' has `{key}`, and a simulated cell neither encrypts nor knows who comes"
        hint = f"leave `{key}` out of a binding for the simulation"
    elif options.get("parity", "N") != "N":
        key, message = "driver", f"'{name}' has the parity {options['parity']}, and a pseudo-terminal has none"
        hint = "in a binding for the simulation, write `parity: N`"
    else:
        return
    raise InputError([binding.problem("F5104", ("devices", name, key), message, hint)])


def _ends(binding: Binding, port: int | str, names: Sequence[str]) -> dict[str, FarEnd]:
    """The ends of the devices at a port, of which each may be the end of several."""
    first, *others = names
    documents = binding.document.devices
    for name in others:
        if isinstance(port, str):
            why = "a serial line has one device"
        elif documents[name].driver != documents[first].driver:
            why = "another protocol is spoken"
        elif _address(binding, name) != _address(binding, first):
            why = "another host is named"
        else:
            continue
        message = f"'{name}' is at port {port}, where '{first}' is served, and {why}"
        raise InputError([binding.problem("F5104", ("devices", name), message, "give each a port of its own")])
    for name in names:
        _refuse_what_is_elsewhere(binding, name)
    points = {point: value for name in names for point, value in _points(binding, name).items()}
    end: FarEnd
    if isinstance(port, str):
        return {first: _at_line(documents[first].driver, port)}
    match documents[first].driver:
        case "modbus-tcp":
            from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd

            units = {name: int(binding.options[name].model_dump()["unit"]) for name in names}
            if len(set(units.values())) > 1:
                gateway = ModbusTcpEnd(port, set(units.values()))
                return {name: gateway.units[unit] for name, unit in units.items()}
            end = ModbusTcpEnd(port)
        case "opcua":
            from firable.executor.drivers.far_side.opcua_server import OpcUaEnd

            named = [binding.options[name].model_dump()["namespaces"] for name in names]
            end = OpcUaEnd(points, port, namespaces={int(index): uri for one in named for index, uri in one.items()})
        case _:
            from firable.executor.drivers.far_side.mqtt_device import MqttEnd

            end = MqttEnd(list(points), port)
    return dict.fromkeys(names, end)


def _at_line(driver: str, path: str) -> FarEnd:
    """The end of a device on a serial line."""
    if driver == "serial":
        from firable.executor.drivers.far_side.serial_device import SerialEnd

        return SerialEnd(path)
    from firable.executor.drivers.far_side.modbus_server import ModbusRtuEnd

    return ModbusRtuEnd(path)


def _points(binding: Binding, name: str) -> dict[Point, Value]:
    """The points that a device must have, with the values that they have at first, and so their types."""
    document = binding.document
    device = document.devices[name]
    points: dict[Point, Value] = {point: not value for point, value in writes(device.safe)}
    if device.heartbeat is not None:
        points[device.heartbeat.write] = 0
        if device.heartbeat.tripped is not None:
            points[device.heartbeat.tripped] = False
    if device.alive is not None:
        points[device.alive.read] = 0
    for channel in device.channels.values():
        said: Value = 0 if channel.request is None else False
        points |= {point: said for point in (channel.taken, channel.done, channel.failed, channel.request) if point}
        points |= {point: 0 for point in (channel.number,) if point}
        points |= {point: "" for point in (channel.command,) if point}
    for command in document.commands.values():
        if command.device == name:
            points |= {point: type(value)() for point, value in writes(command.write)}
    for contact in document.emergency_stop.values():
        if contact.device == name:
            points[contact.read] = not contact.invert
    for signal in document.signals.values():
        if signal is not None and signal.device == name:
            points[signal.read] = False
            points |= {point: 0 for point in (signal.edges,) if point}
    return points
