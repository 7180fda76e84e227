"""`firable sim`: the simulated cell as real servers, for the executor to be run against."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from firable.cli.files import MADE, READ
from firable.cli.finite import FiniteRange
from firable.cli.options import load_net, plant_for, write_text
from firable.cli.text import counted, show_diagnostic

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from firable.executor.cell.disturbances import Disturbance
    from firable.executor.cell.plant import Plant
    from firable.executor.drivers.binding import Binding
    from firable.executor.drivers.far_side.cell import CellServer
    from firable.executor.drivers.far_side.end import FarEnd
    from firable.nets.machines.plant_file import Action, Machine, PlantModel
    from firable.nets.net import Net

_PRESSED_SECONDS = 1.0
_SEAL = "# Written by `firable sim`, which writes it anew unless it is edited: "
_SEAL_CHARACTERS = 16
_NO_BUTTON = "; over MQTT there is none: serve some machines by another protocol as well"


@click.command(short_help="Serve the simulated cell over real protocols.")
@click.argument("net", metavar="NET", type=READ)
@click.option(
    "--plant",
    metavar="FILE",
    type=READ,
    help="The plant file of the cell, or catalogue:NAME.  [default: NAME.plant.yaml beside NET, else that of the net's "
    "name in the catalogue]",
)
@click.option("--modbus", is_flag=True, help="Serve machines over Modbus TCP.")
@click.option("--opcua", is_flag=True, help="Serve machines over OPC UA.")
@click.option("--mqtt", is_flag=True, help="Serve machines over MQTT, by mosquitto, which must be installed.")
@click.option("--serial", is_flag=True, help="Serve machines on a serial line, by a pseudo-terminal.")
@click.option(
    "--bind",
    metavar="FILE",
    type=MADE,
    help="The binding: written where protocols are named, or else read and served.",
)
@click.option("--workpieces", type=click.IntRange(min=0), default=10, show_default=True, help="How many will come.")
@click.option("--seed", type=int, default=0, show_default=True, help="The seed of the cell's jitter.")
@click.option("--speed", type=FiniteRange(min=0.01), default=1.0, show_default=True, help="Times real time.")
@click.option("--stuck", metavar="SIGNAL=0|1[@S]", multiple=True, help="A sensor that shows one value, from a time on.")
@click.option("--drop", metavar="MACHINE.COMMAND[#N]", multiple=True, help="What is held falls as this ends.")
@click.option("--hang", metavar="MACHINE.COMMAND[#N]", multiple=True, help="A command that is taken and never done.")
@click.option(
    "--press", type=FiniteRange(min=0), metavar="SECONDS", help="Press the emergency stop then, for a second."
)
@click.option("--for", "seconds", type=FiniteRange(min=0), metavar="SECONDS", help="End by itself after so long.")
def sim(
    net: str,
    plant: str | None,
    modbus: bool,
    opcua: bool,
    mqtt: bool,
    serial: bool,
    bind: str | None,
    workpieces: int,
    seed: int,
    speed: float,
    stuck: tuple[str, ...],
    drop: tuple[str, ...],
    hang: tuple[str, ...],
    press: float | None,
    seconds: float | None,
) -> int:
    """Serve the machines of NET, with workpieces and jitter, to whoever connects: `firable run BUNDLE --bind FILE`.

    The machines are dealt out to the protocols that are named, on ports of this host, and where everything is stands in
    the binding that is written. Without protocols, --bind is read, and what it leads to on this host is served: each
    machine by the protocol of its device there, a serial line by a link to a pseudo-terminal at the path of its port.

    It ends by Ctrl-C. When something collides its machines stand, and show that they have failed at what they did; the
    exit code is 1 then. N in --drop and --hang says which time, from 1.
    """
    import asyncio

    from firable.cli.loop import read_machines_of
    from firable.executor.cell.plant import Plant
    from firable.executor.drivers.fitting import misfits as binding_misfits
    from firable.executor.operating.uncut import ended_by_signals
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.fitting import late_limits, misfits

    loaded = load_net(net).net
    model = read_machines_of(plant or plant_for(net, loaded.name), loaded)
    if problems := misfits(model, loaded):
        raise InputError(problems)
    for late in late_limits(model, loaded):
        show_diagnostic(late)
    disturbances = _disturbances(model, stuck, drop, hang)
    chosen = {"modbus": modbus, "opcua": opcua, "mqtt": mqtt, "serial": serial}
    protocols = [name for name, is_chosen in chosen.items() if is_chosen]
    if protocols and bind == "-":
        raise click.UsageError("the binding cannot go to standard output, where it is told what happens: name a file")
    machines = {place.command.machine for place in loaded.places if place.command is not None}
    if len(protocols) > len(machines):
        has = f"the net commands {counted(len(machines), 'machine')}"
        raise click.UsageError(f"{has}, of which each is served by one protocol: name no more than that")
    if not protocols and bind is None:
        raise click.UsageError("name protocols, such as --modbus --opcua, or a binding to serve, with --bind")

    async def served() -> str:
        with ended_by_signals():
            binding, ends, write = await _bound(loaded, protocols, bind, model)
            if problems := binding_misfits(binding, loaded):
                raise InputError(problems)
            if press is not None and not binding.document.emergency_stop:
                more = _NO_BUTTON if protocols else ""
                raise click.UsageError(f"--press: the binding has no contact of an emergency stop{more}")
            cell = Plant(model, workpieces=workpieces, seed=seed, disturbances=disturbances)
            return await _serve(binding, loaded, cell, ends, write, speed, press, seconds)

    try:
        fault = asyncio.run(served())
    except (KeyboardInterrupt, asyncio.CancelledError):
        fault = ""
    if fault:
        click.echo(f"the cell stands still: {fault}")
    return 1 if fault else 0


async def _bound(
    net: Net, protocols: list[str], bind: str | None, model: PlantModel
) -> tuple[Binding, dict[str, FarEnd], Callable[[], None]]:
    """The binding, made or read, the ends that it leads to, and what tells of these, and writes one that was made."""
    from firable.executor.drivers.binding import parse_binding, read_binding
    from firable.executor.drivers.far_side.ends import PORTS, binding_text, ends_of, ports_of

    if not protocols:
        binding = read_binding(str(bind))
        return binding, ends_of(binding), lambda: _tell_ports(str(bind), ports_of(binding))
    path = bind or f"{net.name}.bind.yaml"
    _refuse_what_is_not_ours(path)
    ends: dict[str, FarEnd] = {}
    ports = {name: PORTS[name] for name in protocols}
    if "serial" in protocols:  # the name of the line is the system's, so it is there before the binding
        from firable.executor.drivers.far_side.serial_device import SerialEnd

        line = ends["serial"] = SerialEnd()
        line.line.open()
        ports["serial"] = line.line.near
    text = binding_text(net, ports, model.sensors)
    binding = parse_binding(text, path)

    def write() -> None:
        write_text(path, _sealed(text))
        _tell_ports(path, ports)

    return binding, ends | ends_of(binding.without(set(ends))), write


def _tell_ports(path: str, ports: Mapping[str, int | str]) -> None:
    click.echo(f"{path}: {', '.join(f'{name} at {port}' for name, port in ports.items())}")


def _sealed(text: str) -> str:
    """A binding with a line by which it is known whether somebody has edited it since."""
    return f"{text}{_SEAL}{hashlib.sha256(text.encode()).hexdigest()[:_SEAL_CHARACTERS]}\n"


def _refuse_what_is_not_ours(path: str) -> None:
    """Refuse (F1017) to write over a file that was not made here, or was edited: it may be the binding of a site."""
    from firable.executor.drivers.binding import SIZE_BYTES_MAX
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable, read_bytes

    if not Path(path).is_file():  # what else may stand there is refused where it is written
        return
    data = read_bytes(path, SIZE_BYTES_MAX)
    made, seal, _ = data.rpartition(_SEAL.encode())
    if not seal or data != _sealed(made.decode(errors="replace")).encode():
        message = f"{printable(path)}: a file stands there that firable sim has not written, or was edited since"
        hint = "name another file, or give --bind without protocols to serve what the file leads to"
        raise InputError([Diagnostic("F1017", message, hint)])


async def _serve(
    binding: Binding,
    net: Net,
    plant: Plant,
    ends: dict[str, FarEnd],
    write: Callable[[], None],
    speed: float,
    press: float | None,
    seconds: float | None,
) -> str:
    """Serve until it is cancelled or the time is over; returns what has collided by then, in a sentence."""
    import asyncio

    from firable.executor.drivers.far_side.cell import CellServer
    from firable.executor.drivers.far_side.end import GoneError
    from firable.nets.diagnostics import Diagnostic, InputError

    def tell(at_seconds: float, what: str) -> None:
        click.echo(f"{at_seconds:8.1f} s  {what}")

    cell = CellServer(binding, net, plant, ends, speed=speed, tell=tell)
    try:
        try:
            await cell.start()
        except RuntimeError as error:  # a port that is taken, or a broker that is not installed
            hint = "end what else serves there, or name other ports in a binding of your own, with --bind alone"
            raise InputError([Diagnostic("F5104", f"the cell cannot be served: {error}", hint)]) from None
        write()  # a binding that leads to nothing would be in the place of one that another cell serves
        click.echo(f"serving '{net.name}'; Ctrl-C ends it")
        if press is not None:
            loop = asyncio.get_running_loop()
            for pressed, after in ((True, press / speed), (False, press / speed + _PRESSED_SECONDS)):
                loop.call_later(after, partial(_pressed, cell, pressed=pressed))
        try:
            await asyncio.wait_for(cell.run(), seconds)
        except TimeoutError:
            click.echo(f"the time is over: {len(plant.delivered)} carried out, {len(plant.inside)} inside")
        except asyncio.CancelledError:
            if not cell.fault:
                click.echo(f"ended: {len(plant.delivered)} carried out, {len(plant.inside)} inside")
                raise
        except GoneError as error:
            message, hint = f"the cell cannot be served any more: {error}", "the same command serves it anew"
            raise InputError([Diagnostic("F5104", message, hint)]) from None
        finally:
            for line in _missed(plant, None if press is None or press <= cell.now_seconds() else press):
                click.echo(line)
    finally:
        await cell.stop()
    return cell.fault


def _pressed(cell: CellServer, *, pressed: bool) -> None:
    cell.press(pressed=pressed)
    click.echo(f"{cell.now_seconds():8.1f} s  the emergency stop is {'pressed' if pressed else 'released'}")


def _disturbances(
    model: PlantModel, stuck: tuple[str, ...], drop: tuple[str, ...], hang: tuple[str, ...]
) -> list[Disturbance]:
    """What was asked to go wrong; a name that the cell has not is a mistake."""
    from firable.executor.cell.disturbances import Drops, NeverCompletes, StuckSensor
    from firable.nets.diagnostics import did_you_mean
    from firable.nets.machines.plant_file import Switch

    found: list[Disturbance] = []
    for text in stuck:
        sensor, _, rest = text.partition("=")
        value, _, at = rest.partition("@")
        if sensor not in model.sensors:
            known = ", ".join(model.sensors)
            hint = did_you_mean(sensor, list(model.sensors))
            raise click.UsageError(f"the cell has no sensor '{sensor}'; {hint}it has {known}")
        if value not in {"0", "1"} or not (at or "0").replace(".", "", 1).isdecimal():
            raise click.UsageError(f"--stuck {text}: write SIGNAL=0 or SIGNAL=1, and @SECONDS behind it if later")
        found.append(StuckSensor(sensor, value == "1", float(at or 0)))
    commands = {f"{m}.{c}": (body, action) for m, body in model.machines.items() for c, action in body.commands.items()}
    for kind, texts in ((Drops, drop), (NeverCompletes, hang)):
        for text in texts:
            name, _, occurrence = text.partition("#")
            if name not in commands or not (occurrence or "1").isdecimal():
                hint = did_you_mean(name, list(commands))
                raise click.UsageError(f"the cell has no command '{text}'; {hint}it has {', '.join(commands)}")
            if int(occurrence or 1) < 1:
                raise click.UsageError(f"'{text}' never comes: the first time is #1")
            if kind is NeverCompletes and isinstance(commands[name][1], Switch):
                raise click.UsageError(f"--hang {text}: '{name}' is done as it is sent, and nobody waits for its end")
            if kind is Drops and not _may_hold(*commands[name]):
                holding = [one for one in commands if _may_hold(*commands[one])]
                named = f"name one of {', '.join(holding)}" if holding else "no command of this cell ends so"
                raise click.UsageError(f"--drop {text}: nothing is held when '{name}' ends; {named}")
            machine, _, command = name.partition(".")
            found.append(kind(machine, command, int(occurrence or 1)))
    return found


def _may_hold(machine: Machine, action: Action) -> bool:
    """Whether a machine may hold something when a command ends: it can take something up, and does not lay it down."""
    from firable.nets.machines.plant_file import Carry, Grasp, Put, Stop, Switch

    return not isinstance(action, Carry | Put | Stop | Switch) and any(
        isinstance(one, Grasp | Carry) for one in machine.commands.values()
    )


def _missed(plant: Plant, press: float | None) -> Iterator[str]:
    """What was asked to go wrong and has not come, in sentences; `press` is when the emergency stop would have."""
    from firable.executor.cell.disturbances import StuckSensor

    came = [disturbance for disturbance, _ in plant.befallen]
    for one in plant.disturbances.several:
        if isinstance(one, StuckSensor):
            if one not in came:
                yield f"'{one.signal}' was to be stuck at {one.from_seconds:g} s, and the cell has ended before"
        elif one not in came:
            given = plant.machines[one.machine].times.get(one.command, 0)
            often = {0: "never given", 1: "given once"}.get(given, f"given {given} times")
            yield f"'{one.machine}.{one.command}#{one.occurrence}' has not come: it was {often}"
    if press is not None:
        yield f"the emergency stop was to be pressed at {press:g} s, and the cell has ended before"
