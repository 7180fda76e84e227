"""Devices between hosts: who drives what stops the machines of a device, and which devices no two hosts can have.

One binding serves all hosts of a cell, and each takes from it what its controllers need. Anybody may read a device. But
its safe outputs stop all that it has, at the start and at the end of whoever writes them; its watchdog is content as
long as anybody's heartbeat comes; and the numbers of a channel tell its commands apart as far as one host knows them
all. So two hosts with machines at one device would stop each other's when they are started, neither would be missed
when it dies, and a command could go out with a number that the machine has already, and be ignored.

Therefore a device is its *masters'*: of the controllers whose machines it has or, where it has none, whose signals it
shows or, where it shows none, of all: what is behind a relay of the emergency stop stops the whole cell. A host that
runs none of them only looks at it; one that runs some and not all is refused (F5105) where there is anything to be
shared. Two devices at one address are two, but what both write is shared all the same. Each host can see that by
itself: a controller that is not here is elsewhere.

Rejected: to let the first host that comes drive the safe outputs. Which one that is changes with each restart.
Rejected: to refuse every device of two hosts. A sensor of one machine is often wired to the controls of the next.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from firable.executor.drivers.binding import Binding, DeviceDocument
from firable.executor.drivers.device import Point
from firable.nets.diagnostics import Diagnostic
from firable.nets.net import Net


def masters(binding: Binding, net: Net) -> dict[str, frozenset[str]]:
    """For each device the controllers whose machines it has or, where it has none, whose signals it shows, or all."""
    document = binding.document
    commanding = [(one.device, net.place(name).owner) for name, one in document.commands.items()]
    reading = [(one.device, net.signal(name).owner) for name, one in document.signals.items() if one is not None]
    owners = {str(place.owner) for place in net.places}
    return {
        device: frozenset(
            [str(owner) for at, owner in commanding if at == device]
            or [str(owner) for at, owner in reading if at == device]
            or owners
        )
        for device in document.devices
    }


def shared(binding: Binding, net: Net, here: Collection[str]) -> Iterator[Diagnostic]:
    """The devices that a host with these controllers would have together with others (F5105)."""
    commands = binding.document.commands
    of_devices = masters(binding, net)
    for name, of in of_devices.items():
        device = binding.document.devices[name]
        yield from _written_elsewhere(binding, name, of_devices, here)
        if device.safe or device.heartbeat is not None:
            if between := _between(of, here):
                hint = (
                    "its safe outputs would stop all of them, and its heartbeat speak for all: run them on one host, "
                    "or write a device of its own for each, with its own safe outputs and heartbeat"
                )
                has = "stops machines"
                if any(one.device == name for one in commands.values()):
                    has = "has machines"
                elif any(one is not None and one.device == name for one in binding.document.signals.values()):
                    has = "shows signals"
                yield binding.problem("F5105", ("devices", name), f"'{name}' {has} of {between}", hint)
            continue
        for channel in device.channels:
            to = (name, channel)
            owners = {str(net.place(place).owner) for place, one in commands.items() if (one.device, one.channel) == to}
            if between := _between(owners, here):
                message = f"'{channel}' takes commands of {between}"
                hint = "their numbers would be mistaken for each other's: run them on one host"
                yield binding.problem("F5105", ("devices", name, "channels", channel), message, hint)


def _written_elsewhere(
    binding: Binding, name: str, of_devices: Mapping[str, frozenset[str]], here: Collection[str]
) -> Iterator[Diagnostic]:
    """What a device that is this host's writes, and another one at the same address, which is another host's."""
    devices = binding.document.devices
    if not of_devices[name].issubset(here):
        return
    for other, of in of_devices.items():
        same = of.isdisjoint(here) and binding.is_one(name, other)
        if both := sorted(_written(devices[name]) & _written(devices[other])) if same else []:
            points = " and ".join(f"'{point}'" for point in both)
            message = f"'{name}' writes {points}, as '{other}' does, which is another host's at the same address"
            hint = "give each safe outputs, a heartbeat and channels of its own"
            yield binding.problem("F5105", ("devices", name), message, hint)


def _written(device: DeviceDocument) -> set[Point]:
    """The points by which a device is stopped, kept alive and given its commands."""
    channels = (point for one in device.channels.values() for point in (one.number, one.command, one.request))
    beat = None if device.heartbeat is None else device.heartbeat.write
    return {*device.safe, *(point for point in (beat, *channels) if point is not None)}


def _between(owners: Collection[str], here: Collection[str]) -> str:
    """Who of them is here and who is not, in words; empty where all or none are."""
    ours = [name for name in sorted(owners) if name in here]
    others = [name for name in sorted(owners) if name not in here]
    if not ours or not others:
        return ""
    return f"{_named(ours)}, which {_run(ours)} here, and of {_named(others)}, which {_run(others)} elsewhere"


def _named(names: Collection[str]) -> str:
    return " and ".join(f"'{name}'" for name in names)


def _run(names: Collection[str]) -> str:
    return "run" if len(names) > 1 else "runs"
