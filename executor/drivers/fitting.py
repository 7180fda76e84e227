"""Whether a binding fits a net: every signal and every command bound once, and nothing else.

A signal that is not bound would never change, and a command that is not bound would never be sent: either would look
like a machine that is slow. So both are refused before anything is connected, all together, with their lines.

So are two commands that are written alike, such as a stop that was copied from the line of a start and not edited: the
machine would do the one for the other. Only machine and word are compared: a gripper may close in one way everywhere.
And so is a channel with commands of two machines of two controllers: it is for one machine, which does one thing at a
time, and these may be at work at once. An arm and its gripper, of one controller, may be one program's. For the same
reason no two such commands write different values to one point, each before a number of its own: whoever takes its
number late would find what the other needs. A signal has no such rule: two may look at one sensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from firable.executor.drivers.binding import ACKNOWLEDGED, Binding, writes
from firable.executor.drivers.device import Point, Value
from firable.nets.diagnostics import Diagnostic, did_you_mean
from firable.nets.net import Command, Net, Place, SignalKind


def misfits(binding: Binding, net: Net) -> tuple[Diagnostic, ...]:
    """Where a binding does not fit a net (F5101), or commands of two machines stand in each other's way (F5102)."""
    return tuple(_misfits(binding, net))


def _misfits(binding: Binding, net: Net) -> Iterator[Diagnostic]:
    document = binding.document
    if document.cell != net.name:
        message = f"this binding is for the cell '{document.cell}', and the net is '{net.name}'"
        yield binding.problem("F5101", ("cell",), message, "name the cell, when you have looked at all that is bound")
    controllers = [controller.name for controller in net.controllers]
    for name, contact in document.emergency_stop.items():
        for unknown in (one for one in contact.controllers or () if one not in controllers):
            hint = did_you_mean(unknown, controllers) + f"it has {', '.join(controllers)}; or leave it out, for all"
            message = f"the net has no controller '{unknown}'"
            yield binding.problem("F5101", ("emergency_stop", name, "controllers"), message, hint)
    signals = {signal.name: signal for signal in net.signals if signal.kind is not SignalKind.TIMER}
    for name in document.signals:
        if name not in signals:
            hint = did_you_mean(name, list(signals)) + "take it out, or correct its name"
            message = f"the net has no signal '{name}'"
            if name in net.signal_index:
                message, hint = f"'{name}' is a timer, which its controller sets", "take it out"
            yield binding.problem("F5101", ("signals", name), message, hint)
    for name, signal in signals.items():
        if name not in document.signals:
            read = "{device: ..., read: ...}"
            ways = f"`{name}: {read}`"
            if signal.kind is SignalKind.COMPLETION:
                ways = f"`{name}: {ACKNOWLEDGED}`, or {ways} where a sensor must agree"
            yield binding.problem("F5101", ("signals",), f"the signal '{name}' is not bound", f"write {ways}")
        elif document.signals[name] is None and signal.kind is SignalKind.SENSOR:
            message = f"'{name}' is a sensor, and no command acknowledges it"
            yield binding.problem("F5101", ("signals", name), message, "write `{device: ..., read: ...}`")
    places = {place.name: place for place in net.places if place.command is not None}
    for name in document.commands:
        if name not in places:
            what = "has no place" if name not in net.place_index else "sends no command on entry to"
            hint = did_you_mean(name, list(places)) + "take it out, or correct its name"
            yield binding.problem("F5101", ("commands", name), f"the net {what} '{name}'", hint)
    for name, place in places.items():
        if name not in document.commands:
            hint = f"write `{name}: {{device: ..., channel: ...}}`"
            yield binding.problem(
                "F5101", ("commands",), f"the command of '{name}', {place.command}, is not bound", hint
            )
        else:
            yield from _unanswered(binding, place)
    bound = [place for place in places.values() if place.name in document.commands]
    yield from _alike(binding, bound)
    yield from _crowded(binding, bound)
    yield from _contrary(binding, bound)


def _unanswered(binding: Binding, place: Place) -> Iterator[Diagnostic]:
    """A command whose completion is awaited goes by a channel that shows what is done."""
    command = binding.document.commands[place.name]
    channel = binding.document.devices[command.device].channels[command.channel]
    if place.completion is not None and channel.done is None:
        message = f"'{place.name}' waits for its completion, and '{command.channel}' does not show what is done"
        hint = f"give the channel `done: ADDRESS`, where '{command.device}' shows the number of what it has done"
        yield binding.problem("F5101", ("commands", place.name, "channel"), message, hint)


def _alike(binding: Binding, places: Iterable[Place]) -> Iterator[Diagnostic]:
    """Commands of different machines or words that are written alike, where the channel does not send the words."""
    document = binding.document
    written: dict[tuple[str, str, frozenset[tuple[Point, object]]], Place] = {}
    for place in places:
        bound = document.commands[place.name]
        if place.command is None or document.devices[bound.device].channels[bound.channel].command is not None:
            continue
        values = frozenset(writes(bound.write))
        first = written.setdefault((bound.device, bound.channel, values), place)
        if first.command is None or _word(first.command) == _word(place.command):
            continue
        told = ", ".join(f"{point}: {value}" for point, value in bound.write.items()) or "nothing but a number"
        message = f"{place.command} of '{place.name}' is written as {first.command} of '{first.name}' is: {told}"
        hint = "the machine cannot tell them apart: write what is meant by each, or give them one word in the net"
        key = ("write",) if bound.write else ()
        yield binding.problem("F5102", ("commands", place.name, *key), message, hint)


def _crowded(binding: Binding, places: Iterable[Place]) -> Iterator[Diagnostic]:
    """Commands of another machine, from another controller, than one that is given by their channel, too."""
    given: dict[tuple[str, str], list[Place]] = {}
    for place in places:
        bound = binding.document.commands[place.name]
        others = given.setdefault((bound.device, bound.channel), [])
        machine = _machine(place)
        if other := next((one for one in others if _are_apart(one, place)), None):
            such = f"'{_machine(other)}', such as '{other.name}'"
            message = f"'{bound.channel}' has commands of {such}, and here of '{machine}'"
            hint = "a channel is for one machine, which does one thing at a time: name the channel of this one"
            yield binding.problem("F5102", ("commands", place.name, "channel"), message, hint)
        others.append(place)


def _contrary(binding: Binding, places: Iterable[Place]) -> Iterator[Diagnostic]:
    """Commands that write another value to a point than those of another machine, from another controller, write."""
    commands = binding.document.commands
    written: dict[Point, list[tuple[Place, Value]]] = {}
    for place in places:
        bound = commands[place.name]
        for point, value in writes(bound.write):
            others = written.setdefault(point, [])
            for other, instead in others:
                at = commands[other.name]
                is_one = _are_apart(other, place) and binding.is_one(at.device, bound.device)
                if is_one and value != instead and (at.device, at.channel) != (bound.device, bound.channel):
                    message = f"{place.command} writes {value} to '{point}' of '{bound.device}'"
                    message += f", and {other.command} of '{other.name}' writes {instead} there"
                    hint = "both may be under way at once: give the commands of each machine points of their own"
                    yield binding.problem("F5102", ("commands", place.name, "write", point), message, hint)
                    break
            others.append((place, value))


def _are_apart(one: Place, other: Place) -> bool:
    """Whether the commands of two places are for two machines, and of two controllers, so that none waits for one."""
    return one.owner != other.owner and _machine(one) != _machine(other)


def _machine(place: Place) -> str:
    return "" if place.command is None else place.command.machine


def _word(command: Command) -> tuple[str, str]:
    return command.machine, command.command
