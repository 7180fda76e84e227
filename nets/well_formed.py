"""The rules of a well-formed net, each with the diagnostic that says what to write instead.

They are asked once, by the constructor of `Net`, so a net that exists keeps them, whoever built it; and they name the
*subject* of a problem, never a line, so that they serve text, PNML and programs alike. A contradiction that no text can
express, such as a completion signal that gates nothing, is a `ValueError`: the fault of the program that made it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from typing import Final

from firable.nets.diagnostics import Diagnostic, Subject, did_you_mean
from firable.nets.formula import CONSTANT_ATOMS, Firable, Holds, names_in
from firable.nets.net import (
    ArbitrationRule,
    ExternalGate,
    Net,
    Place,
    Property,
    PropertyKind,
    Signal,
    SignalKind,
    TemporalProperty,
    Transition,
    is_fault,
)
from firable.nets.source import quoted
from firable.nets.temporal import Fires, logics
from firable.nets.temporal_parts import atoms_in
from firable.nets.time_limits import limit_problems
from firable.nets.written_as_one import is_one_name, meant_by, written_as_one

FORBIDDEN_IN_NAMES: Final = frozenset(" \t\r\n()[]{},:#&*!|>'\"%@`\\")


def is_name(text: str) -> bool:
    """Whether a text may be a name: without blanks, brackets, quotes, YAML signs, and what a terminal would obey."""
    return bool(text) and FORBIDDEN_IN_NAMES.isdisjoint(text) and text.isprintable()


def as_name(text: str) -> str:
    """A text of visible characters as a name, or a part of one: another for each text, and most are themselves.

    >>> as_name("R1"), as_name("press 1"), as_name("press~201")
    ('R1', 'press~201', 'press~7e201')
    """
    escaped = FORBIDDEN_IN_NAMES | {"~"}
    return "".join(f"~{ord(one):02x}" if one in escaped else one for one in text)


def problems(net: Net) -> Iterator[Diagnostic]:
    """Every rule of SEMANTICS, "The net", that the parts violate, found as it is asked for."""
    if not net.name.isprintable():
        hint = "write it on one line, in visible characters"
        yield Diagnostic("F2012", f"{net.name!r} is not a name for a net", hint, ("cell",))
    yield from _duplicate_names(net)
    controllers = {controller.name for controller in net.controllers}
    yield from _ownership(net, controllers)
    if len(coordinators := [c.name for c in net.controllers if c.coordinator]) > 1:
        yield Diagnostic(
            "F2015",
            f"{' and '.join(coordinators)} are both marked as coordinator",
            "leave `coordinator: true` at one of them",
            ("controllers", coordinators[1]),
        )
    yield from _layers(net, controllers)
    yield from _completions(net)
    yield from limit_problems(net)
    yield from _meanings(net)
    known = _Known(
        {place.name for place in net.places},
        {transition.name for transition in net.transitions},
        {signal.name for signal in net.signals},
    )
    for transition in net.transitions:
        if not _is_sound(transition, known):
            yield from _transition_problems(transition, known)
    yield from _numbers(net)
    yield from _arbiters(net)
    yield from _properties(net)


def _duplicate_names(net: Net) -> Iterator[Diagnostic]:
    kinds: tuple[tuple[str, tuple[str, ...]], ...] = (
        ("controllers", tuple(x.name for x in net.controllers)),
        ("places", tuple(x.name for x in net.places)),
        ("signals", tuple(x.name for x in net.signals)),
        ("transitions", tuple(x.name for x in net.transitions)),
        ("arbiters", tuple(x.name for x in net.arbiters)),
        ("properties", tuple(x.name for x in net.properties)),
    )
    nodes: dict[str, str] = {}
    for kind, names in kinds:
        seen: set[str] = set()
        for name in names:
            if not is_name(name) or name in {"and", "or", "not", "->"}:
                singular = {"properties": "property"}.get(kind, kind[:-1])
                yield Diagnostic(
                    "F2012",
                    f"{name!r} is not a name for a {singular}",
                    _as_inputs(net, name) or "use letters, digits, '_', '-' and '.'",
                    (kind, name),
                )
            if name in seen:
                yield Diagnostic("F2001", f"there are two {kind} named '{name}'", "rename one of them", (kind, name))
            seen.add(name)
            # Places, signals and transitions are told apart by their names alone, in gates and in formulas.
            if kind in {"places", "signals", "transitions"}:
                if (other := nodes.get(name)) not in {None, kind}:
                    yield Diagnostic(
                        "F2001",
                        f"'{name}' names one of the {other} and one of the {kind}",
                        "rename one of them: gates and formulas tell them apart by name",
                        (kind, name),
                    )
                nodes.setdefault(name, kind)


def _as_inputs(net: Net, name: str) -> str:
    """The hint on the name of a sensor that is a list of names."""
    sensors = (signal for signal in net.signals if signal.name == name and signal.kind is SignalKind.SENSOR)
    return next((written_as_one(name.removeprefix(f"{one.owner}."), (), "inputs") for one in sensors), "")


def _ownership(net: Net, controllers: set[str]) -> Iterator[Diagnostic]:
    owned: tuple[tuple[str, tuple[Place | Signal, ...]], ...] = (("places", net.places), ("signals", net.signals))
    for kind, items in owned:
        for item in items:
            if item.owner is None:
                continue
            subject: Subject = (kind, item.name, "owner")
            if item.owner not in controllers:
                yield Diagnostic(
                    "F2005",
                    f"'{item.name}' is owned by {quoted(item.owner)}, which is no controller",
                    did_you_mean(item.owner, sorted(controllers)) + "declare it under `controllers`",
                    subject,
                )
            local = item.name.removeprefix(f"{item.owner}.")
            if local == item.name or not local:
                yield Diagnostic(
                    "F2019",
                    f"'{item.name}' is owned by '{item.owner}', so its name must begin with '{item.owner}.'",
                    f"name it '{item.owner}.{item.name}'",
                    subject,
                )


def _layers(net: Net, controllers: set[str]) -> Iterator[Diagnostic]:
    above = {controller.name: controller.under for controller in net.controllers}
    for controller in net.controllers:
        subject: Subject = ("controllers", controller.name, "under")
        if controller.under is None:
            continue
        if controller.under not in controllers:
            yield Diagnostic(
                "F2005",
                f"'{controller.name}' is under {quoted(controller.under)}, which is no controller",
                did_you_mean(controller.under, sorted(controllers)) + "declare it under `controllers`",
                subject,
            )
        elif controller.coordinator:
            yield Diagnostic(
                "F2027",
                f"'{controller.name}' coordinates the whole net, and is under '{controller.under}'",
                "the others are under it: leave `under` out here",
                subject,
            )
        elif _is_cyclic(controller.name, above):
            yield Diagnostic(
                "F2027",
                f"'{controller.name}' is under itself, by way of '{controller.under}'",
                "controllers are a tree: leave `under` out at the highest of these",
                subject,
            )


def _is_cyclic(name: str, above: Mapping[str, str | None]) -> bool:
    """Whether the way up from a controller comes back to it."""
    seen = {name}
    now = above[name]
    while now is not None and now not in seen:
        seen.add(now)
        now = above.get(now)
    return now == name


def _completions(net: Net) -> Iterator[Diagnostic]:
    signals = {signal.name: signal for signal in net.signals}
    consumers: dict[str, list[Transition]] = {place.name: [] for place in net.places if place.completion is not None}
    for transition in net.transitions if consumers else ():
        for name in transition.inputs:
            if name in consumers:
                consumers[name].append(transition)
    for place in net.places:
        if place.completion is None:
            continue
        subject: Subject = ("places", place.name, "until")
        signal = signals.get(place.completion)
        if signal is None:
            yield _unknown_name("F2003", "signal", place.completion, signals, subject, "until")
        elif signal.kind is not SignalKind.COMPLETION:
            declared = "a sensor" if signal.kind is SignalKind.SENSOR else "a timer"
            yield Diagnostic(
                "F2018",
                f"'{signal.name}' is declared as {declared}, and `until` makes it a completion signal",
                "a completion is a bit that the driver forms and clears: take it out of `inputs`, "
                "or write `if` at the transition",
                subject,
            )
        if place.command is None:
            yield Diagnostic(
                "F2014",
                f"'{place.name}' waits until '{place.completion}' but sends no command that could complete",
                "add `send`, or declare the signal under `inputs` and write it as `if` of the transition",
                subject,
            )
        late = ExternalGate(place.within.timer) if place.within is not None else None
        gated = [
            transition for transition in consumers[place.name] if ExternalGate(place.completion) in transition.external
        ]
        for transition in consumers[place.name]:
            if transition not in gated and not (late and is_fault(place, transition, late)):
                raise ValueError(
                    f"'{transition.name}' takes the token of '{place.name}' without the gate '{place.completion}'"
                )
        if len(consumers[place.name]) > len(gated) + 1:
            raise ValueError(f"'{place.name}' has more than one fault transition")


def _meanings(net: Net) -> Iterator[Diagnostic]:
    """What `task` and `opens` say of places: one thing each, and no idle place twice.

    That the controllers of idle places are there is asked of the net that is refined: a subnet has only its own.
    """
    opened: dict[str, str] = {}
    for place in net.places:
        if (place.task or place.resource) is None:
            continue
        subject: Subject = ("places", place.name)
        said = {"task": place.task, "opens": place.resource, "send": place.command, "until": place.completion}
        keys = [key for key, value in said.items() if value is not None]
        if len(keys) > 1:
            yield Diagnostic(
                "F2024",
                f"'{place.name}' has {' and '.join(f'`{key}`' for key in keys)}",
                "a place stands for a task, or for a resource, or sends a command: leave one of them",
                subject,
            )
        if place.resource is None:
            continue
        idle = place.resource.idle
        if not idle.partition(".")[2] or not is_name(idle):
            yield Diagnostic(
                "F2012",
                f"{idle!r} is not the full name of a place",
                "write `to: CONTROLLER.PLACE`, such as `to: robot.free`",
                (*subject, "opens", "to"),
            )
        elif (other := opened.setdefault(idle, place.name)) != place.name:
            yield Diagnostic(
                "F2001",
                f"'{other}' and '{place.name}' both open to '{idle}'",
                "give each resource an idle place of its own",
                (*subject, "opens", "to"),
            )


@dataclass(frozen=True, slots=True)
class _Known:
    """The names an arc or a gate may end at."""

    places: set[str]
    transitions: set[str]
    signals: set[str]


def _is_sound(transition: Transition, known: _Known) -> bool:
    """Whether the transition keeps all rules: the quick way of asking, for the many that do."""
    for names in (transition.inputs, transition.outputs, transition.permissive, transition.inhibitive):
        if not known.places.issuperset(names) or (len(names) > 1 and len(set(names)) < len(names)):
            return False
    external = transition.external
    return not external or (
        known.signals.issuperset([gate.signal for gate in external]) and len(set(external)) == len(external)
    )


def _transition_problems(transition: Transition, known: _Known) -> Iterator[Diagnostic]:
    places, names, signals = known.places, known.transitions, known.signals
    arcs = (("from", transition.inputs), ("to", transition.outputs))
    gates = (("if", transition.permissive), ("unless", transition.inhibitive))
    for key, sources in (*arcs, *gates):
        is_gate = key in {"if", "unless"}
        seen: set[str] = set()
        for name in sources:
            subject: Subject = ("transitions", transition.name, key, name)
            if name in seen:
                yield Diagnostic(
                    "F2022" if is_gate else "F2007",
                    f"'{name}' stands twice in `{key}` of '{transition.name}'",
                    "arcs and gates are sets, without weights: write it once",
                    subject,
                )
            seen.add(name)
            if name in places:
                continue
            if name in names:
                code = "F2008" if is_gate else "F2017"
                yield Diagnostic(
                    code,
                    f"'{name}' in `{key}` of '{transition.name}' is a transition",
                    "the source of a gate is a place or a signal"
                    if is_gate
                    else "an arc joins a place and a transition",
                    subject,
                )
            elif name in signals and not is_gate:
                yield Diagnostic(
                    "F2017",
                    f"'{name}' in `{key}` of '{transition.name}' is a signal",
                    "a signal can be a gate: write it under `if` or `unless`",
                    subject,
                )
            elif not is_gate:
                own = name.rpartition(".")[2]
                alike = [signal for signal in signals if signal.rpartition(".")[2] == own]
                unknown = _unknown_name("F2002", "place", name, places, subject, key)
                if len(alike) == 1 and is_one_name(name):
                    hint = f"'{alike[0]}' is a signal, which can be a gate: write it under `if` or `unless`"
                    unknown = replace(unknown, hint=hint)
                yield unknown
            elif name not in signals:
                yield _unknown_name("F2021", "place or signal", name, places | signals, subject, key)
            else:
                raise ValueError(f"the internal gate '{name}' of '{transition.name}' is a signal: its gate is external")
    seen_gates: set[ExternalGate] = set()
    for gate in transition.external:
        subject = ("transitions", transition.name, "if" if gate.wanted else "unless", gate.signal)
        if gate.signal not in signals:
            yield _unknown_name("F2003", "signal", gate.signal, signals, subject, subject[2])
        if gate in seen_gates:
            yield Diagnostic(
                "F2022", f"the gate '{gate.signal}' of '{transition.name}' stands twice", "write it once", subject
            )
        seen_gates.add(gate)


def _numbers(net: Net) -> Iterator[Diagnostic]:
    first: dict[int, str] = {}
    for transition in net.transitions:
        if transition.number is None:
            continue
        other = first.setdefault(transition.number, transition.name)
        if other != transition.name:
            yield Diagnostic(
                "F2016",
                f"'{other}' and '{transition.name}' both have the number {transition.number}",
                "numbers name the parts of a transition in the controllers, so each is used once",
                ("transitions", transition.name, "number"),
            )


def _arbiters(net: Net) -> Iterator[Diagnostic]:
    names = {transition.name for transition in net.transitions}
    taken: dict[str, str] = {}
    for arbiter in net.arbiters:
        subject: Subject = ("arbiters", arbiter.name, "among")
        # A list that is written as one name is told as that, below.
        if len(set(arbiter.among)) < 2 and not any(written_as_one(one, names, "among") for one in arbiter.among):
            yield Diagnostic(
                "F2013", f"'{arbiter.name}' has nothing to decide", "name at least two transitions", subject
            )
        if arbiter.by is not ArbitrationRule.ORDER and len(set(arbiter.among)) < len(arbiter.among):
            yield Diagnostic(
                "F2013",
                f"'{arbiter.name}' names a transition twice",
                "only `by: order` may name a transition more than once",
                subject,
            )
        for name in dict.fromkeys(arbiter.among):
            if name not in names:
                yield _unknown_name("F2004", "transition", name, names, (*subject, name), "among")
            elif (other := taken.setdefault(name, arbiter.name)) != arbiter.name:
                yield Diagnostic(
                    "F2013",
                    f"'{name}' is decided by '{other}' and by '{arbiter.name}'",
                    "a conflict component has one arbiter: join the two",
                    (*subject, name),
                )


def _properties(net: Net) -> Iterator[Diagnostic]:
    places = {place.name for place in net.places}
    transitions = {transition.name for transition in net.transitions}
    for name in sorted(CONSTANT_ATOMS & places) if net.properties else ():
        yield Diagnostic(
            "F2012",
            f"the place '{name}' has a name that means something else in the formulas of `properties`",
            "rename the place",
            ("places", name),
        )
    for prop in net.properties:
        for atom in _atoms(prop):
            if isinstance(atom, Holds):
                if atom.place not in places:
                    subject: Subject = ("properties", prop.name, atom.place)
                    yield unknown_in_formula("place", atom.place, net, subject)
            elif atom.transition not in transitions:
                subject = ("properties", prop.name, atom.transition)
                yield unknown_in_formula("transition", atom.transition, net, subject)


def unknown_in_formula(
    kind: str,
    name: str,
    net: Net,
    subject: Subject,
    hint: str = "declare it first, or correct the name",
    words: Set[str] = CONSTANT_ATOMS,
) -> Diagnostic:
    """The diagnostic on a name in a formula that no place, or no transition, of the net has.

    `words` may stand where a place does, so that one of them may be what was meant.
    """
    if kind == "place":
        transitions = {transition.name for transition in net.transitions}
        if name in transitions:
            said = f"write `firable({name})` where it may fire, or name a place"
            return Diagnostic("F2002", f"{quoted(name)} is a transition, and no place", said, subject)
        known = {place.name for place in net.places} | (words - {name})
        return _unknown_name("F2002", kind, name, known, subject, hint=hint)
    if any(place.name == name for place in net.places):
        filling = next(
            (f", such as '{one.name}', which puts a token on it" for one in net.transitions if name in one.outputs), ""
        )
        said = f"write `{name}` for a token on it, or name a transition{filling}"
        return Diagnostic("F2004", f"{quoted(name)} is a place, and no transition", said, subject)
    return _unknown_name("F2004", kind, name, {transition.name for transition in net.transitions}, subject, hint=hint)


def _unknown_name(
    code: str,
    kind: str,
    name: str,
    known: Collection[str],
    subject: Subject,
    key: str = "",
    hint: str = "declare it first, or correct the name",
) -> Diagnostic:
    """The diagnostic on a name that nothing has, with the known name that was probably meant under this key."""
    message, (owner, _, own) = f"there is no {kind} {quoted(name)}", name.partition(".")
    if as_one := written_as_one(name, known, key):
        return Diagnostic(code, message, as_one, subject)
    if f"{owner}.{name}" in known:  # declared by its full name, where the local one is expected
        full = quoted(f"{owner}.{name}")
        said = f"{full} is declared: inside {quoted(owner)} names are local, so write {quoted(own)} there"
        return Diagnostic(code, message, said, subject)
    local = min((full for full in known if full.rpartition(".")[2] == name), default=None)
    # Names much longer or shorter are no slips of the pen, and would be sorted for nothing.
    similar = sorted(full for full in known if abs(len(full) - len(name)) <= 4 and is_name(full))
    suggestion = f"did you mean {quoted(local)}? " if local else meant_by(name, similar)
    return Diagnostic(code, message, f"{suggestion}{hint}", subject)


def _atoms(prop: Property | TemporalProperty) -> Iterator[Holds | Firable | Fires]:
    if isinstance(prop, TemporalProperty):
        if prop.logic not in logics(prop.formula):
            raise ValueError(f"'{prop.name}' is no formula of {prop.logic.upper()}")
        yield from atoms_in(prop.formula)
        return
    if (prop.then is None) == (prop.kind is PropertyKind.LEADS_TO):
        raise ValueError(f"'{prop.name}': exactly `leads_to` has a second formula")
    for formula in (prop.formula, prop.then):
        yield from names_in(formula) if formula else ()
