"""Printing a net as a net file.

The printed text is read back before it is handed out, and must give the same net: so nothing is dropped in silence, and
what the file format has no words for (a self-loop, a completion signal that no place waits for) is an error with a
code. The order of a file groups places and signals by controller, and has fault transitions last; `in_file_order` is
that normal form, and a net that was read from a file has it already.

The alternative, `yaml.dump`, prints neither short entries on one line nor aligned with what an engineer would write.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.formula import format_formula
from firable.nets.net import (
    Command,
    ExternalGate,
    Fairness,
    Net,
    Place,
    Property,
    PropertyKind,
    Resource,
    Signal,
    SignalKind,
    TemporalProperty,
    TimeLimit,
    Transition,
)
from firable.nets.temporal import format_temporal
from firable.nets.text import parse_net
from firable.nets.time_limits import fault_place, fault_place_name, fault_transition_name, format_time, timer_name
from firable.nets.yaml_writing import flow_list, flow_mapping, scalar

WIDTH_CHARACTERS: Final = 120


def format_net(net: Net) -> str:
    """Print a net so that `parse_net` reads `in_file_order(net)` back.

    Raises `InputError`: F2009 for a self-loop and F2020 for anything else that the format cannot say.

    >>> from firable.nets.net import Place, Transition
    >>> print(format_net(Net("demo", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))))
    firable: 1
    cell: demo
    <BLANKLINE>
    start: p
    places:
      p:
      q:
    <BLANKLINE>
    transitions:
      t: {from: p, to: q}
    <BLANKLINE>
    """
    text = "\n".join(_lines(net)) + "\n"
    try:
        back = parse_net(text, net.name)
    except InputError as error:
        if loops := [replace(problem, span=None) for problem in error.diagnostics if problem.code == "F2009"]:
            raise InputError(loops) from None
        raise _cannot_say(f"it would be refused: {error.diagnostics[0].message}") from None
    if back != in_file_order(net) or back.description != net.description:
        raise _cannot_say("it would be read as another net")
    return text


def _cannot_say(reason: str) -> InputError:
    hint = "only what the format of the net file has keys for can be printed"
    return InputError([Diagnostic("F2020", f"the net cannot be written as a net file: {reason}", hint)])


def in_file_order(net: Net) -> Net:
    """The same net with places and signals grouped by controller, and external gates as a file implies them.

    Only the order of the indexes changes.
    """
    owners = [*(controller.name for controller in net.controllers), None]
    rank = {owner: number for number, owner in enumerate(owners)}
    given = _given_places(net)
    places = [
        made
        for place in sorted(net.places, key=lambda place: rank[place.owner])
        if place.name not in given.values()
        for made in (place, *((net.place(given[place.name]),) if place.name in given else ()))
    ]
    kinds = (SignalKind.SENSOR, SignalKind.COMPLETION, SignalKind.TIMER)
    first: dict[str, int] = {}
    for place in places:
        for signal in (place.completion, place.within.timer if place.within else None):
            if signal:
                first.setdefault(signal, len(first))

    def signal_rank(signal: Signal) -> tuple[int, int, int]:
        return rank[signal.owner], kinds.index(signal.kind), first.get(signal.name, len(first))

    faults = {net.transitions[t].name: place for place, t in _faults(net, places)}
    transitions = [_gates_in_order(net, transition) for transition in net.transitions]
    late = {transition.name: transition for transition in transitions if transition.name in faults}
    return replace(
        net,
        places=tuple(places),
        signals=tuple(sorted(net.signals, key=signal_rank)),
        transitions=(*(one for one in transitions if one.name not in late), *(late[name] for name in faults)),
    )


def _faults(net: Net, places: Iterable[Place]) -> Iterator[tuple[Place, int]]:
    """The places whose time limit has a fault transition, with its index."""
    for place in places:
        if (t := net.fault_transitions.get(net.place_index[place.name])) is not None:
            yield place, t


def _given_places(net: Net) -> dict[str, str]:
    """The fault places that no file need declare, by the place whose time limit gives them."""
    found = {}
    for place, t in _faults(net, net.places):
        given = fault_place(place)
        if net.transitions[t].outputs == (given.name,) and net.place(given.name) == given:
            found[place.name] = given.name
    return found


def _gates_in_order(net: Net, transition: Transition) -> Transition:
    if not transition.external:
        return transition
    implied = _implied(net, transition)
    rest = [gate for gate in transition.external if gate not in implied]
    return replace(
        transition,
        external=(*implied, *sorted(rest, key=lambda gate: not gate.wanted)),
    )


def _implied(net: Net, transition: Transition) -> dict[ExternalGate, None]:
    """The gates that `until` puts on the transition, in the order of its inputs."""
    faults, t = net.fault_transitions, net.transition_index[transition.name]
    completions = (net.place(name).completion for name in transition.inputs if faults.get(net.place_index[name]) != t)
    return dict.fromkeys(ExternalGate(signal) for signal in completions if signal is not None)


def _lines(net: Net) -> Iterator[str]:
    yield "firable: 1"
    yield f"cell: {scalar(net.name)}"
    if net.description:
        yield f"description: {scalar(net.description)}"
    places: dict[str | None, list[Place]] = {}
    given = set(_given_places(net).values())
    for place in net.places:
        if place.name not in given:
            places.setdefault(place.owner, []).append(place)
    inputs: dict[str | None, list[Signal]] = {}
    for signal in net.signals:
        if signal.kind is SignalKind.SENSOR:
            inputs.setdefault(signal.owner, []).append(signal)
    if net.controllers:
        yield ""
        yield "controllers:"
    for controller in net.controllers:
        name = controller.name
        yield f"  {scalar(name)}:"
        if controller.coordinator:
            yield "    coordinator: true"
        if controller.under is not None:
            yield f"    under: {scalar(controller.under)}"
        if controller.description:
            yield f"    description: {scalar(controller.description)}"
        yield from _scope(net, places.get(name, []), inputs.get(name, []), f"{name}.", "    ")
    if unowned := list(_scope(net, places.get(None, []), inputs.get(None, []), "", "")):
        yield ""
        yield from unowned
    late = {t for _, t in _faults(net, net.places)}
    rows = ((t.name, _transition(net, t)) for i, t in enumerate(net.transitions) if i not in late)
    yield from _table("transitions", rows, nothing=" {}")
    yield from _table(
        "arbiters",
        ((a.name, [("among", flow_list(a.among)), ("by", str(a.by))]) for a in net.arbiters),
    )
    yield from _table("properties", ((p.name, _property(p)) for p in net.properties))
    if net.expected:
        yield ""
        yield "expect:"
        yield from (f"  {scalar(one.verdict)}: {one.status}" for one in net.expected)


def _scope(net: Net, places: list[Place], inputs: list[Signal], prefix: str, indent: str) -> Iterator[str]:
    def local(name: str) -> str:
        return name.removeprefix(prefix)

    if marked := [local(place.name) for place in places if place.marked]:
        yield f"{indent}start: {_names(marked)}"
    if inputs:
        yield f"{indent}inputs: {_names([local(signal.name) for signal in inputs])}"
    if places:
        yield f"{indent}places:"
    for place in places:
        entries: list[tuple[str, str]] = []
        if place.command:
            entries.append(("send", _command(place.command)))
        if place.completion:
            entries.append(("until", scalar(local(place.completion))))
        if place.within:
            entries.append(("within", _limit(net, place, place.within, local)))
        if place.task:
            entries.append(("task", flow_mapping(_pairs(("name", place.task.name), *place.task.arguments))))
        if place.resource:
            entries.append(("opens", _resource(place.resource)))
        if place.description:
            entries.append(("description", scalar(place.description)))
        yield from _entry(local(place.name), entries, indent + "  ")


def _limit(net: Net, place: Place, limit: TimeLimit, local: Callable[[str], str]) -> str:
    """The time, and what does not bear the name that follows from the place's."""
    entries = [("time", format_time(limit.milliseconds))]
    if (t := net.fault_transitions.get(net.place_index[place.name])) is not None:
        fault = net.transitions[t]
        if fault.outputs[:1] != (fault_place_name(place.name),):
            entries += [("to", scalar(local(name))) for name in fault.outputs[:1]]
        if fault.name != fault_transition_name(place.name):
            entries.append(("transition", scalar(fault.name)))
    if limit.timer != timer_name(place.name):
        entries.append(("timer", scalar(local(limit.timer))))
    return flow_mapping(entries) if len(entries) > 1 else entries[0][1]


def _command(command: Command) -> str:
    return flow_mapping(_pairs(("machine", command.machine), ("command", command.command), *command.parameters))


def _resource(resource: Resource) -> str:
    prefix = [("prefix", resource.prefix)] if resource.prefix else []
    return flow_mapping(_pairs(("to", resource.idle), ("machine", resource.machine), *prefix, *resource.parameters))


def _pairs(*pairs: tuple[str, str]) -> Iterator[tuple[str, str]]:
    return ((scalar(key), scalar(value)) for key, value in pairs)


def _transition(net: Net, transition: Transition) -> list[tuple[str, str]]:
    implied = _implied(net, transition) if transition.external else {}
    gates = [gate for gate in transition.external if gate not in implied]
    opening = [*transition.permissive, *(gate.signal for gate in gates if gate.wanted)]
    closing = [*transition.inhibitive, *(gate.signal for gate in gates if not gate.wanted)]
    names = (("from", transition.inputs), ("to", transition.outputs), ("if", opening), ("unless", closing))
    return [
        *([] if transition.number is None else [("number", str(transition.number))]),
        *([("description", scalar(transition.description))] if transition.description else []),
        *((key, _names(list(of))) for key, of in names if of),
    ]


def _property(prop: Property | TemporalProperty) -> list[tuple[str, str]]:
    if isinstance(prop, TemporalProperty):
        return [(str(prop.logic), scalar(format_temporal(prop.formula)))]
    if prop.kind is not PropertyKind.LEADS_TO or prop.then is None:
        return [(str(prop.kind), scalar(format_formula(prop.formula)))]
    source, target = scalar(format_formula(prop.formula)), scalar(format_formula(prop.then))
    if prop.fairness is Fairness.WEAK:
        return [("leads_to", f"[{source}, {target}]")]
    return [("leads_to", flow_mapping((("from", source), ("to", target), ("fairness", str(prop.fairness)))))]


def _table(key: str, rows: Iterable[tuple[str, list[tuple[str, str]]]], nothing: str = "") -> Iterator[str]:
    lines = [line for name, entries in rows for line in _entry(name, entries, "  ", nothing)]
    if lines:
        yield ""
        yield f"{key}:"
        yield from lines


def _entry(name: str, entries: list[tuple[str, str]], indent: str, nothing: str = "") -> Iterator[str]:
    """One named entry, on one line if it is short enough; `nothing` stands for no entries."""
    head = f"{indent}{scalar(name)}:"
    line = f"{head} {flow_mapping(entries)}"
    if not entries:
        yield f"{head}{nothing}"
    elif len(line) <= WIDTH_CHARACTERS:
        yield line
    else:
        yield head
        yield from (f"{indent}  {key}: {value}" for key, value in entries)


def _names(names: list[str]) -> str:
    return scalar(names[0]) if len(names) == 1 else flow_list(names)
