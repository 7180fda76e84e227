"""Whether a plant file fits a net, and whether it is the one with which a bundle was proved.

A net and its plant have only commands and sensors in common, so these are asked: each command of the net is one that
the plant knows, each sensor of the one is a signal of the other. What the plant file lacks is told there, with a line
that can be written. Whoever reads both asks this first: the loop, the simulated cell, the monitor, the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from pydantic import BaseModel

from firable.nets.diagnostics import Diagnostic, Severity, did_you_mean
from firable.nets.machines.plant_file import SEEN, PlantModel, Stop, Switch
from firable.nets.net import Command, Net, Place, SignalKind
from firable.nets.source import quoted
from firable.nets.yaml_tree import Path
from firable.nets.yaml_writing import scalar

_OF_THE_SIMULATION: Final = frozenset({"takes_s", "jitter_s", "every_s", "after_s", "for_s", "likely", "description"})


def misfits(model: PlantModel, net: Net) -> tuple[Diagnostic, ...]:
    """Where a plant does not fit a net (F5003): a command it does not know, a sensor on one side only."""
    return (*_misfits_of_places(model, net), *_misfits_of_signals(model, net))


def of_another_cell(model: PlantModel, net: Net) -> tuple[Diagnostic, ...]:
    """That a plant bears the name of another cell than the net (F5003), whether or not it fits.

    The plant of a twin cell has the same commands and sensors, and other times, stations and faults. It is asked where
    somebody names both: a net that is made of one, such as that of a host, may bear another name and have its plant.
    """
    if model.plant == net.name:
        return ()
    message = f"this plant file is for the cell '{model.plant}', and the net is '{net.name}'"
    hint = f"name the plant file of '{net.name}', or write `plant: {net.name}` when you have looked at all that it says"
    return (model.misfit(("plant",), ("net",), message, hint),)


def late_limits(model: PlantModel, net: Net) -> tuple[Diagnostic, ...]:
    """Warnings of time limits that no command keeps (F5009): a check knows no times, and a run goes round for ever."""
    found = []
    for place in net.places:
        command, limit = place.command, place.within
        machine = None if command is None else model.machines.get(command.machine)
        action = None if machine is None or command is None else machine.commands.get(command.command)
        if command is None or limit is None or action is None or limit.seconds >= action.takes_s - action.jitter_s:
            continue
        given_s, least_s = f"{limit.seconds:.6g}", f"{action.takes_s - action.jitter_s:.6g}"
        message = f"'{place.name}' gives '{command}' {given_s} s, and it takes {least_s} s at the least"
        found.append(
            Diagnostic(
                "F5009",
                f"{message}: it is late each time",
                "give the place a longer `within`, or mend `takes_s`; a check with machines leaves times out",
                ("places", place.name),
                model.span(("machines", command.machine, "commands", command.command, "takes_s")),
                severity=Severity.WARNING,
            )
        )
    return tuple(found)


def otherwise_than(sealed: PlantModel, model: PlantModel) -> tuple[Diagnostic, ...]:
    """A warning (F5003) where a plant is not that with which a bundle was proved.

    No proof asks for its times, but for whether a stop is one at once.
    """
    path = _difference(_untimed(sealed), _untimed(model), ())
    if path is None:
        return ()
    message = f"{quoted('.'.join(map(str, path)))}: the bundle was proved with a plant file that says otherwise here"
    hint = "what the bundle shows of machines is not shown of these: make it anew, with --machines and this plant file"
    return (Diagnostic("F5003", message, hint, tuple(map(str, path)), model.span(path), Severity.WARNING),)


def _untimed(part: Any) -> Any:
    """What a plant file says, without what only its simulation reads."""
    if isinstance(part, BaseModel):
        fields = {field.alias or name: name for name, field in type(part).model_fields.items()}
        said = {key: _untimed(getattr(part, name)) for key, name in fields.items() if key not in _OF_THE_SIMULATION}
        return said | {"takes_s": part.takes_s + part.jitter_s > 0} if isinstance(part, Stop) else said
    if isinstance(part, Mapping):
        return {key: _untimed(value) for key, value in part.items()}
    return [_untimed(one) for one in part] if isinstance(part, list | tuple) else part


def _difference(one: Any, other: Any, path: Path) -> Path | None:
    """The first place at which two texts of data differ; None: nowhere."""
    if isinstance(one, dict) and isinstance(other, dict):
        inner = (_difference(one.get(key), other.get(key), (*path, key)) for key in {**other, **one})
        return next((found for found in inner if found is not None), None)
    return None if one == other else path


def _lacks(place: Place, command: Command, *, machine: bool = False) -> str:
    """The hint on a command that a plant file lacks, or whose machine: what nobody looks for there is said at once."""
    does, such = ("{does: work, takes_s: 1}", "a door") if place.completion else ("{does: switch}", "a lamp, a horn")
    written = f"{scalar(command.command)}: {does}"
    if machine:
        written = f"{scalar(command.machine)}: {{commands: {{{written}}}}}"
    return f"add it to the plant file, as `{written}` where it concerns no workpiece: {such}"


def _misfits_of_places(model: PlantModel, net: Net) -> Iterator[Diagnostic]:
    for place in net.places:
        command, subject = place.command, ("places", place.name)
        if command is None:
            continue
        sent = f"'{place.name}' sends '{command}'"
        known = model.machines.get(command.machine)
        if known is None:
            hint = did_you_mean(command.machine, list(model.machines)) + _lacks(place, command, machine=True)
            message = f"{sent}, and the plant has no such machine '{command.machine}'"
            yield model.misfit(("machines",), subject, message, hint)
            continue
        inner = ("machines", command.machine, "commands", command.command)
        if command.command not in known.commands:
            hint = did_you_mean(command.command, list(known.commands)) + _lacks(place, command)
            yield model.misfit(inner, subject, f"{sent}, and the plant has no such command '{command.command}'", hint)
            continue
        action, parameters = known.commands[command.command], dict(command.parameters)
        if isinstance(action, Switch) and place.completion is not None:
            hint = "leave out `until` in the net, or write `does: work` and how long it takes"
            message = f"{sent} and waits for '{place.completion}', and nothing comes back of what is switched"
            yield model.misfit(inner, subject, message, hint)
        needed = {"move": "to", "grasp": "at", "put": "at"}.get(action.does)
        if needed and (named := parameters.get(needed, "")) not in known.positions:
            hint = f"{did_you_mean(named, list(known.positions))}its positions are {', '.join(known.positions)}"
            message = f"{sent}, and '{named}' is no position of '{command.machine}'"
            if not named:
                message = f"{sent} without `{needed}`, a position of '{command.machine}'"
            yield model.misfit(("machines", command.machine, "positions"), subject, message, hint)


def _misfits_of_signals(model: PlantModel, net: Net) -> Iterator[Diagnostic]:
    for signal in net.signals:
        if signal.kind is SignalKind.SENSOR and signal.name not in model.sensors:
            unknown = [name for name in model.sensors if name not in net.signal_index]
            hint = f"{did_you_mean(signal.name, unknown)}add it to the `sensors` of the plant file, as {SEEN}"
            message = f"no sensor of the plant drives '{signal.name}'"
            yield model.misfit(("sensors",), ("signals", signal.name), message, hint)
    for name, sensor in model.sensors.items():
        at = ("sensors", name)
        if name not in net.signal_index:
            hint = did_you_mean(name, [signal.name for signal in net.signals]) + "sensors bear the names of signals"
            yield model.misfit(at, at, f"the net has no signal '{name}'", hint)
            continue
        kind = net.signal(name).kind
        if kind is SignalKind.TIMER:
            hint = "a timer is set by its controller: rename the sensor"
            yield model.misfit(at, at, f"'{name}' is a timer of the net", hint)
        if sensor.by_hand and kind is SignalKind.COMPLETION:
            hint = "declare it under `inputs`, and write it as `if` of a transition"
            what = "the key" if sensor.set_by is None else "what is set from outside,"
            yield model.misfit(at, at, f"{what} '{name}' is a completion of the net", hint)
