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

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from itertools import islice

from firable.nets.diagnostics import PROBLEMS_MAX, InputError
from firable.nets.formula import Formula
from firable.nets.temporal import Logic, Temporal
from firable.nets.verdict import Expectation

Marking = int
"""The set of places with a token; bit i is place i of the net."""


@dataclass(frozen=True, slots=True)
class Controller:
    """An owner of places and signals: what the split gives one subnet to.

    It stands under the coordinator that `under` names, or else under that of the whole net (`firable.nets.layers`).
    """

    name: str
    coordinator: bool = False
    description: str = ""
    under: str | None = None


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
class TaskUse:
    """The registered task that a place of a conceptual net stands for.

    The arguments fill the roles and parameters of the task: a role with the name of a resource place, local to the
    controller of the task's place or full.
    """

    name: str
    arguments: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Resource:
    """What a place of a conceptual net opens to: the idle place of a machine in the detailed net, by its full name.

    `prefix` comes before the names of the machine's signals where its controller has several machines; tasks may ask
    for further parameters.
    """

    idle: str
    machine: str
    prefix: str = ""
    parameters: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """How long the completion of a place's command may take, in whole milliseconds.

    `timer` is a signal of the place's controller: cleared when the token enters, set when the time is over and the
    completion has not come. The fault transition, one of those that take the token, waits for it.
    """

    milliseconds: int
    timer: str

    @property
    def seconds(self) -> float:
        """The same in seconds."""
        return self.milliseconds / 1000


@dataclass(frozen=True, slots=True)
class Place:
    """A place: at most one token, marked or not in M0.

    `completion` names the completion signal of the place's command: the driver clears it when the command is sent
    and sets it when the machine is done; every transition that takes the token out is gated by it, but for the fault
    transition of a place with a time limit (`within`), which wants the completion 0 and the timer 1. `task` and
    `resource` belong to a conceptual net and say what `firable refine` puts in the place's stead; the firing rule
    knows neither.
    """

    name: str
    owner: str | None = None
    marked: bool = False
    command: Command | None = None
    completion: str | None = None
    description: str = ""
    task: TaskUse | None = None
    resource: Resource | None = None
    within: TimeLimit | None = None

    @property
    def cleared(self) -> tuple[str, ...]:
        """The signals that a token clears when it enters: the completion of the command, and the timer."""
        timer = None if self.within is None else self.within.timer
        return tuple(signal for signal in (self.completion, timer) if signal is not None)


def holding(places: Iterable[Place], marking: Marking) -> tuple[Place, ...]:
    """The places of a net, in their order, with the tokens of a marking: those of the net that begins there.

    >>> [place.marked for place in holding((Place("p", marked=True), Place("q")), 0b10)]
    [False, True]
    """
    return tuple(replace(place, marked=bool(marking >> p & 1)) for p, place in enumerate(places))


class SignalKind(StrEnum):
    """What makes a signal true: the completion of a command, a sensor that nobody clears, or a time that is over."""

    COMPLETION = "completion"
    SENSOR = "sensor"
    TIMER = "timer"


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

    @property
    def self_loops(self) -> tuple[str, ...]:
        """The places that are both input and output; one is enough to keep the transition from ever firing.

        >>> Transition("t", ("p", "q"), ("q", "r")).self_loops
        ('q',)
        """
        outputs = set(self.outputs)
        return tuple(place for place in self.inputs if place in outputs)


def is_fault(place: Place, transition: Transition, late: ExternalGate) -> bool:
    """Whether a transition wants the timer of a place with a time limit 1 (the gate `late`) and its completion 0.

    One that wants the completion 1 as well never fires, and takes no token when the time is over.
    """
    completion = {gate.wanted for gate in transition.external if gate.signal == place.completion}
    return late in transition.external and completion == {False}


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
class TemporalProperty:
    """A property that no temporal pattern says: a formula of CTL or LTL, which must hold in M0."""

    name: str
    logic: Logic
    formula: Temporal


@dataclass(frozen=True, slots=True)
class Masks:
    """The sets of one transition as bit masks over the places."""

    inputs: int
    outputs: int
    permissive: int
    inhibitive: int


@dataclass(frozen=True, repr=False)
class Net:
    """An extended Petri net; `places`, `transitions` and `signals` give the order of the indexes.

    Raises `InputError` with every violation where the parts are not a well-formed net.

    >>> net = Net("fig2a",
    ...     places=(Place("Machine", marked=True), Place("Task")),
    ...     transitions=(Transition("start", ("Machine",), ("Task",)), Transition("end", ("Task",), ("Machine",))))
    >>> net.names(net.initial_marking)
    ('Machine',)
    >>> net
    <Net fig2a: 2 places, 2 transitions>
    """

    name: str
    places: tuple[Place, ...] = ()
    transitions: tuple[Transition, ...] = ()
    signals: tuple[Signal, ...] = ()
    controllers: tuple[Controller, ...] = ()
    arbiters: tuple[Arbiter, ...] = ()
    properties: tuple[Property | TemporalProperty, ...] = ()
    description: str = field(default="", compare=False)
    expected: tuple[Expectation, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        from firable.nets.well_formed import problems  # here, because the rules speak of the records above

        if found := list(islice(problems(self), PROBLEMS_MAX)):
            raise InputError(found)

    def __repr__(self) -> str:
        """A line, however large the net is; `firable.nets.printing` prints all of it."""
        return f"<Net {self.name}: {len(self.places):,} places, {len(self.transitions):,} transitions>"

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
    def controller_index(self) -> Mapping[str, int]:
        """The index of each controller."""
        return {controller.name: i for i, controller in enumerate(self.controllers)}

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

    @cached_property
    def fault_transitions(self) -> Mapping[int, int]:
        """For each place with a time limit, by index, the transition that takes its token when the time is over."""
        return {
            p: t
            for p, place in enumerate(self.places)
            if place.within is not None
            for t in self.consumers[p]
            if is_fault(place, self.transitions[t], ExternalGate(place.within.timer))
        }

    @cached_property
    def competitors(self) -> tuple[tuple[int, ...], ...]:
        """For each place, who competes for its token: its consumers, without its fault transition.

        That one wants the completion 0 and all the others want it 1, so no valuation opens it beside one of them.
        """
        faults = self.fault_transitions
        if not faults:
            return self.consumers
        return tuple(
            tuple(t for t in found if faults.get(p) != t) if p in faults else found
            for p, found in enumerate(self.consumers)
        )

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
        bits = f"{marking:b}"[::-1]  # all at once: a shift for each place is quadratic in the net
        return tuple(place.name for place, bit in zip(self.places, bits, strict=False) if bit == "1")

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
    def possibilities(self) -> tuple[Property, ...]:
        """Its properties that say of something that it is always possible (AG EF p)."""
        stated = (of for of in self.properties if isinstance(of, Property))
        return tuple(of for of in stated if of.kind is PropertyKind.ALWAYS_POSSIBLE)

    @cached_property
    def coordinator(self) -> Controller | None:
        """The controller marked as coordinator, if the net has one."""
        return next((controller for controller in self.controllers if controller.coordinator), None)

    def _repr_svg_(self) -> str | None:
        """The picture of the net in a notebook, of a large one its overview; else nothing, and its text is shown."""
        from firable.nets.drawing import NODES_MAX, draw_net, draw_overview, has_overview

        if len(self.places) + len(self.transitions) <= NODES_MAX:
            return draw_net(self)
        return draw_overview(self) if has_overview(self) else None
