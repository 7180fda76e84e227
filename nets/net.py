"""The extended Petri net N = (P, T, I, O, Gp, Gi, X, owner, out, M0) of SEMANTICS, as one frozen value.

One `Net` goes through everything: it is read by `nets`, fired by `semantics`, explored by `analysis`, split by
`decompose`, executed by `executor`. It is a tuple of records with names, as an engineer wrote them; for the rooms that
compute, names are interned to indexes (the position in `places`, `transitions`, `signals`) and sets of places to bit
masks (bit i is place i), once for each net, on first use.

A `Net` that exists is well formed: the constructor collects every violation of the rules of SEMANTICS and raises
one `InputError`. Two things are legal here that other rooms or the text format refuse: a self-loop (its transition is
dead, which analysis reports) and a place or signal without an owner (such a net can be checked, not split).

Markings are sets of places with one token, written as `int` bit masks: the alternative, a class with a set of names,
costs 20 times the memory and forbids the bitwise firing rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from itertools import islice
from typing import Final

from firable.nets.diagnostics import Diagnostic, InputError, Subject, did_you_mean
from firable.nets.formula import CONSTANT_ATOMS, Formula, Holds, names_in

Marking = int
"""The set of places with a token; bit i is place i of the net."""

_PROBLEMS_MAX: Final = 100  # enough to read; a file of noise has millions
FORBIDDEN_IN_NAMES: Final = frozenset(" \t\r\n()[]{},:#&*!|>'\"%@`\\")


@dataclass(frozen=True, slots=True)
class Controller:
    """An owner of places and signals: what the split gives one subnet to."""

    name: str
    coordinator: bool = False
    description: str = ""


@dataclass(frozen=True, slots=True)
class Command:
    """The output signal of a place: sent to `machine` when the place goes from 0 to 1 by a firing."""

    machine: str
    command: str
    parameters: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        arguments = " ".join(f"{key}={value}" for key, value in self.parameters)
        return f"{self.machine} {self.command}{' ' if arguments else ''}{arguments}"


@dataclass(frozen=True, slots=True)
class Place:
    """A place: at most one token, marked or not in M0.

    `completion` names the completion signal of the place's command: the driver clears it when the command is sent
    and sets it when the machine is done; every transition that takes the token out is gated by it.
    """

    name: str
    owner: str | None = None
    marked: bool = False
    command: Command | None = None
    completion: str | None = None
    description: str = ""


class SignalKind(StrEnum):
    """What makes a signal true: the completion of a command, or a sensor that nobody clears."""

    COMPLETION = "completion"
    SENSOR = "sensor"


@dataclass(frozen=True, slots=True)
class Signal:
    """An external signal, source of external gates."""

    name: str
    owner: str | None = None
    kind: SignalKind = SignalKind.SENSOR


@dataclass(frozen=True, slots=True)
class ExternalGate:
    """A literal of X(t): permissive wants the signal to be 1, inhibitive wants it to be 0."""

    signal: str
    wanted: bool = True


@dataclass(frozen=True, slots=True)
class Transition:
    """A transition with its arcs and gates, each a set written as a tuple in the order of the file."""

    name: str
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    permissive: tuple[str, ...] = ()
    inhibitive: tuple[str, ...] = ()
    external: tuple[ExternalGate, ...] = ()
    number: int | None = None
    description: str = ""

    @property
    def openable(self) -> bool:
        """Whether some valuation of the signals opens X(t): no signal is wanted both 1 and 0."""
        return len({gate.signal for gate in self.external}) == len(set(self.external))


class ArbitrationRule(StrEnum):
    """How an arbiter decides a conflict; see `firable.semantics.arbitration`."""

    PRIORITY = "priority"
    ORDER = "order"
    ROTATION = "rotation"


@dataclass(frozen=True, slots=True)
class Arbiter:
    """The rule by which the conflict component of the transitions `among` is decided."""

    name: str
    among: tuple[str, ...]
    by: ArbitrationRule = ArbitrationRule.PRIORITY


class PropertyKind(StrEnum):
    """The temporal patterns of the net file; `p` and `q` are state formulas."""

    NEVER = "never"  # AG not p
    ALWAYS = "always"  # AG p
    REACHABLE = "reachable"  # EF p
    LEADS_TO = "leads_to"  # AG (p -> AF q), under the stated fairness
    ALWAYS_POSSIBLE = "always_possible"  # AG EF p


class Fairness(StrEnum):
    """What a run may not do for ever, in a `leads_to` property.

    Weak: leave out a transition that stays enabled. Strong: leave out one that is enabled again and again. Gates
    are free, so either assumes that an external gate does open.
    """

    NONE = "none"
    WEAK = "weak"
    STRONG = "strong"


@dataclass(frozen=True, slots=True)
class Property:
    """A property that the net file states of its own net."""

    name: str
    kind: PropertyKind
    formula: Formula
    then: Formula | None = None
    fairness: Fairness = Fairness.WEAK


@dataclass(frozen=True, slots=True)
class Masks:
    """The sets of one transition as bit masks over the places."""

    inputs: int
    outputs: int
    permissive: int
    inhibitive: int


@dataclass(frozen=True)
class Net:
    """An extended Petri net; `places`, `transitions` and `signals` give the order of the indexes.

    Raises `InputError` with every violation where the parts are not a well-formed net.

    >>> net = Net("fig2a",
    ...     places=(Place("Machine", marked=True), Place("Task")),
    ...     transitions=(Transition("start", ("Machine",), ("Task",)), Transition("end", ("Task",), ("Machine",))))
    >>> net.names(net.initial_marking)
    ('Machine',)
    """

    name: str
    places: tuple[Place, ...] = ()
    transitions: tuple[Transition, ...] = ()
    signals: tuple[Signal, ...] = ()
    controllers: tuple[Controller, ...] = ()
    arbiters: tuple[Arbiter, ...] = ()
    properties: tuple[Property, ...] = ()
    description: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        problems = list(islice(_problems(self), _PROBLEMS_MAX))
        if problems:
            raise InputError(problems)

    @cached_property
    def place_index(self) -> Mapping[str, int]:
        """The index of each place."""
        return {place.name: i for i, place in enumerate(self.places)}

    @cached_property
    def transition_index(self) -> Mapping[str, int]:
        """The index of each transition."""
        return {transition.name: i for i, transition in enumerate(self.transitions)}

    @cached_property
    def signal_index(self) -> Mapping[str, int]:
        """The index of each signal."""
        return {signal.name: i for i, signal in enumerate(self.signals)}

    @cached_property
    def masks(self) -> tuple[Masks, ...]:
        """The masks of each transition, by its index."""
        return tuple(
            Masks(
                self.marking(transition.inputs),
                self.marking(transition.outputs),
                self.marking(transition.permissive),
                self.marking(transition.inhibitive),
            )
            for transition in self.transitions
        )

    @cached_property
    def initial_marking(self) -> Marking:
        """M0."""
        return self.marking(place.name for place in self.places if place.marked)

    @cached_property
    def consumers(self) -> tuple[tuple[int, ...], ...]:
        """For each place, the indexes of the transitions that have it as an input."""
        return self._adjacent(lambda transition: transition.inputs)

    @cached_property
    def producers(self) -> tuple[tuple[int, ...], ...]:
        """For each place, the indexes of the transitions that have it as an output."""
        return self._adjacent(lambda transition: transition.outputs)

    def _adjacent(self, places_of: Callable[[Transition], tuple[str, ...]]) -> tuple[tuple[int, ...], ...]:
        found: list[list[int]] = [[] for _ in self.places]
        for t, transition in enumerate(self.transitions):
            for name in places_of(transition):
                found[self.place_index[name]].append(t)
        return tuple(tuple(transitions) for transitions in found)

    def marking(self, places: Iterable[str]) -> Marking:
        """The marking in which exactly these places hold a token; `KeyError` for a name that is no place."""
        marking = 0
        for name in places:
            marking |= 1 << self.place_index[name]
        return marking

    def names(self, marking: Marking) -> tuple[str, ...]:
        """The places that hold a token, in the order of the net."""
        return tuple(place.name for i, place in enumerate(self.places) if marking >> i & 1)

    def transition(self, name: str) -> Transition:
        """The transition of this name; `KeyError` where there is none."""
        return self.transitions[self.transition_index[name]]

    def place(self, name: str) -> Place:
        """The place of this name; `KeyError` where there is none."""
        return self.places[self.place_index[name]]

    def signal(self, name: str) -> Signal:
        """The signal of this name; `KeyError` where there is none."""
        return self.signals[self.signal_index[name]]

    @cached_property
    def coordinator(self) -> Controller | None:
        """The controller marked as coordinator, if the net has one."""
        return next((controller for controller in self.controllers if controller.coordinator), None)


def _problems(net: Net) -> Iterator[Diagnostic]:
    """Every rule of SEMANTICS, "The net", that the parts violate."""
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
    yield from _completions(net)
    known = _Known(
        {place.name for place in net.places},
        {transition.name for transition in net.transitions},
        {signal.name for signal in net.signals},
    )
    for transition in net.transitions:
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
            singular = {"properties": "property"}.get(kind, kind[:-1])
            if (
                not name
                or FORBIDDEN_IN_NAMES & set(name)
                or not name.isprintable()
                or name in {"and", "or", "not", "->"}
            ):
                yield Diagnostic(
                    "F2012",
                    f"{name!r} is not a name for a {singular}",
                    "use letters, digits, '_', '-' and '.'",
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
                    f"'{item.name}' is owned by '{item.owner}', which is no controller",
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


def _completions(net: Net) -> Iterator[Diagnostic]:
    signals = {signal.name: signal for signal in net.signals}
    consumers: dict[str, list[Transition]] = {place.name: [] for place in net.places}
    for transition in net.transitions:
        for name in transition.inputs:
            consumers.get(name, []).append(transition)
    for place in net.places:
        if place.completion is None:
            continue
        subject: Subject = ("places", place.name, "until")
        signal = signals.get(place.completion)
        if signal is None:
            yield _unknown("F2003", "signal", place.completion, sorted(signals), subject)
        elif signal.kind is not SignalKind.COMPLETION:
            yield Diagnostic(
                "F2018",
                f"'{signal.name}' is declared as a sensor, and `until` makes it a completion signal",
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
        for transition in consumers[place.name]:
            if ExternalGate(place.completion) not in transition.external:
                raise ValueError(
                    f"'{transition.name}' takes the token of '{place.name}' without the gate '{place.completion}'"
                )


@dataclass(frozen=True, slots=True)
class _Known:
    """The names an arc or a gate may end at."""

    places: set[str]
    transitions: set[str]
    signals: set[str]


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
                    "F2007",
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
                yield _unknown("F2002", "place", name, sorted(places), subject)
            elif name not in signals:
                yield _unknown("F2002", "place or signal", name, sorted(places | signals), subject)
    seen_gates: set[ExternalGate] = set()
    for gate in transition.external:
        subject = ("transitions", transition.name, "if" if gate.wanted else "unless", gate.signal)
        if gate.signal not in signals:
            yield _unknown("F2003", "signal", gate.signal, sorted(signals), subject)
        if gate in seen_gates:
            yield Diagnostic(
                "F2007", f"the gate '{gate.signal}' of '{transition.name}' stands twice", "write it once", subject
            )
        seen_gates.add(gate)


def _unknown(code: str, kind: str, name: str, known: list[str], subject: Subject) -> Diagnostic:
    local = [full for full in known if full.rpartition(".")[2] == name]
    suggestion = f"did you mean '{local[0]}'? " if local else did_you_mean(name, known)
    return Diagnostic(
        code, f"there is no {kind} '{name}'", f"{suggestion}Declare it first, or correct the name.".strip(), subject
    )


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
        if len(set(arbiter.among)) < 2:
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
                yield _unknown("F2004", "transition", name, sorted(names), (*subject, name))
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
        if (prop.then is None) == (prop.kind is PropertyKind.LEADS_TO):
            raise ValueError(f"'{prop.name}': exactly `leads_to` has a second formula")
        for formula in (prop.formula, prop.then):
            for atom in names_in(formula) if formula else ():
                if isinstance(atom, Holds):
                    if atom.place not in places:
                        subject: Subject = ("properties", prop.name, atom.place)
                        yield _unknown("F2002", "place", atom.place, sorted(places), subject)
                elif atom.transition not in transitions:
                    subject = ("properties", prop.name, atom.transition)
                    yield _unknown("F2004", "transition", atom.transition, sorted(transitions), subject)
