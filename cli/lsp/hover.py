"""What an editor tells of a name: of a transition what it waits for, each condition that Eq. (1) and (2) ask."""

from __future__ import annotations

from collections.abc import Iterator

from firable.nets.net import ExternalGate, Net, Place, SignalKind
from firable.nets.occurrences import Kind, Occurrence
from firable.nets.time_limits import format_time
from firable.nets.verdict import counted


def hover(net: Net, one: Occurrence) -> str:
    """What is told of a name, as Markdown; nothing of a name that the net does not have."""
    match one.kind:
        case Kind.TRANSITION if one.name in net.transition_index:
            return "\n".join(_transition(net, one.name))
        case Kind.PLACE if one.name in net.place_index:
            return "\n".join(_place(net, net.place(one.name)))
        case Kind.SIGNAL if one.name in net.signal_index:
            return "\n".join(_signal(net, one.name))
        case Kind.CONTROLLER:
            return "\n".join(_controller(net, one.name))
        case Kind.ARBITER:
            return "\n".join(_arbiter(net, one.name))
    return ""


def _transition(net: Net, name: str) -> Iterator[str]:
    t = net.transition(name)
    yield _title(name, t.description)
    yield ""
    yield "It fires when all of this holds:"
    yield ""
    yield from (f"- `{place}` holds a token, which it takes{_said(net, place)}" for place in t.inputs)
    yield from (f"- `{place}` holds a token, which stays{_said(net, place)}" for place in t.permissive)
    yield from (f"- `{place}` is empty{_said(net, place)}" for place in t.inhibitive)
    yield from (f"- `{gate.signal}` is {int(gate.wanted)}: {_meaning(net, gate)}" for gate in t.external)
    yield from (f"- `{place}` is empty, which it fills{_said(net, place)}" for place in t.outputs)
    owners = {net.place(p).owner for p in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)}
    owners |= {net.signal(gate.signal).owner for gate in t.external}
    several = sorted(owner for owner in owners if owner is not None)
    if len(several) > 1:
        yield ""
        yield f"It is global: {', '.join(several)} take part."


def _meaning(net: Net, gate: ExternalGate) -> str:
    kind = net.signal(gate.signal).kind
    if kind is SignalKind.SENSOR:
        return "a sensor"
    if kind is SignalKind.TIMER:
        of = [f"`{place.name}`{_limit(place)}" for place in net.places if _timer(place) == gate.signal]
        return f"the time limit of {' and '.join(of)}"
    commands = [f"{place.command}{_limit(place)}" for place in net.places if place.completion == gate.signal]
    return f"the completion of {' and '.join(commands)}"


def _timer(place: Place) -> str | None:
    return place.within.timer if place.within else None


def _limit(place: Place) -> str:
    """How long the command of a place may take, where its file says so."""
    return f" (within {format_time(place.within.milliseconds)})" if place.within else ""


def _place(net: Net, place: Place) -> Iterator[str]:
    yield _title(place.name, place.description)
    yield ""
    if place.marked:
        yield "It holds a token at the start."
        yield ""
    if place.command is not None:
        until = f", and waits until `{place.completion}`{_limit(place)}" if place.completion else ""
        yield f"When a token enters, `{place.command}` is sent{until}."
        yield ""
    for words, names in (
        ("filled by", [t.name for t in net.transitions if place.name in t.outputs]),
        ("emptied by", [t.name for t in net.transitions if place.name in t.inputs]),
        ("wanted full by", [t.name for t in net.transitions if place.name in t.permissive]),
        ("wanted empty by", [t.name for t in net.transitions if place.name in t.inhibitive]),
    ):
        if names:
            yield f"- {words} {', '.join(names)}"


def _signal(net: Net, name: str) -> Iterator[str]:
    signal = net.signal(name)
    kinds = {SignalKind.SENSOR: "sensor", SignalKind.COMPLETION: "completion", SignalKind.TIMER: "timer"}
    yield f"**{name}**, a {kinds[signal.kind]}" + (f" of {signal.owner}" if signal.owner else "")
    yield ""
    for wanted in (True, False):
        names = [t.name for t in net.transitions if ExternalGate(name, wanted) in t.external]
        if names:
            yield f"- wanted {int(wanted)} by {', '.join(names)}"
    for place in net.places:
        if place.completion == name:
            yield f"- cleared by `{place.command}` in `{place.name}`, which waits for it{_limit(place)}"
        if _timer(place) == name:
            yield f"- set when `{place.name}` has waited too long for `{place.completion}`{_limit(place)}"


def _controller(net: Net, name: str) -> Iterator[str]:
    for controller in net.controllers:
        if controller.name == name:
            yield _title(name, controller.description)
            places = sum(place.owner == name for place in net.places)
            signals = sum(signal.owner == name for signal in net.signals)
            role = "The coordinator" if controller.coordinator else "A controller"
            yield ""
            yield f"{role} with {counted(places, 'place')} and {counted(signals, 'signal')}."


def _arbiter(net: Net, name: str) -> Iterator[str]:
    for arbiter in net.arbiters:
        if arbiter.name == name:
            yield f"**{name}** chooses by {arbiter.by} among {', '.join(arbiter.among)}."


def _title(name: str, description: str) -> str:
    return f"**{name}**" + (f": {description}" if description else "")


def _said(net: Net, place: str) -> str:
    description = net.place(place).description
    return f" ({description})" if description else ""
