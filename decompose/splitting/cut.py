"""Splitting a net by ownership: one subnet for each controller, and the coordinator's table.

Participants(t) are the owners of I(t), O(t), the sources of Gp(t) and Gi(t), and the signals of X(t). One participant
makes a transition local, more make it global: it is cut into *parts*, one for each participant, with those inputs,
outputs and gates that the participant owns. A participant that owns only a gate has a part that moves no token; it
votes and locks (O3). Nothing is decided here but names: ownership is in the net, so the cut is a function of it and
`join` undoes it.

The paper's alternative, parts listed by hand in the coordinator's table, has to be kept equal to the net; here the
table is derived, and for the paper's own cell the derived table is the published one.

Decided by the coordinator are the global transitions and every local one in the conflict component of a global one
(O2): two deciders of one conflict would each choose a winner. Where controllers stand in layers, it is the lowest
coordinator above all participants of the component that decides (`firable.nets.layers`), and of all components that
contend for promises (`firable.nets.contention`). `firable.nets.deciding` reads that off the net, for whoever runs a
table, too. The subnets are flat: which layer a controller stands in stays with the central net, since it changes
nothing that the controller itself does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count

from firable.nets.deciding import deciders, groups, owners
from firable.nets.decomposition import Coordinated, Decomposition, Part
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Net, Place, Signal, Transition
from firable.semantics.arbitration import Arbitration


def participants(net: Net, transition: Transition) -> tuple[str, ...]:
    """The controllers that take part in a transition, in the order of the net; those of unowned things are left out.

    >>> from firable.nets.net import Controller, Net, Place, Transition
    >>> places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    >>> net = Net("n", places, (Transition("t", ("a.p",), ("b.q",)),), controllers=(Controller("a"), Controller("b")))
    >>> participants(net, net.transition("t"))
    ('a', 'b')
    """
    taking_part = (owner for owner in owners(net, transition) if owner is not None)
    return tuple(sorted(taking_part, key=net.controller_index.__getitem__))


def unowned(net: Net) -> tuple[str, ...]:
    """The transitions without any participant: no controller would fire them."""
    return tuple(transition.name for transition in net.transitions if not participants(net, transition))


def controller_numbers(net: Net) -> dict[str, int]:
    """The number of each controller in the names of parts: 0 is the coordinator's own, the others count from 1.

    >>> from firable.nets.net import Controller, Net
    >>> controller_numbers(Net("n", controllers=(Controller("robot"), Controller("system", coordinator=True))))
    {'system': 0, 'robot': 1}
    """
    others = (controller.name for controller in net.controllers if not controller.coordinator)
    own = {net.coordinator.name: 0} if net.coordinator else {}
    return own | {name: number for number, name in enumerate(others, start=1)}


def part_name(controller: int, number: int) -> str:
    """The name of the part of global transition `number` in the controller of this number.

    >>> part_name(0, 2), part_name(3, 2)
    ('t0-2', 't3-23')
    """
    return f"t{controller}-{number}{controller or ''}"


def split(net: Net) -> Decomposition:
    """Split a net over its controllers.

    Subnets bear the names of their controllers and hold their places, signals and transitions in the order of the net.
    Arbiters become groups; arbiters and properties stay with the central net. A global transition without a number gets
    the next free one. Raises `InputError` with every reason: F2011 for a place or signal without an owner, F4001
    for whatever else cannot be split, F2013 for an arbiter that fits no conflict component.
    """
    problems = list(_problems(net))
    if problems:
        raise InputError(problems)
    taking_part = {transition.name: participants(net, transition) for transition in net.transitions}
    numbers = _numbers(net, [name for name, its in taking_part.items() if len(its) > 1])
    controllers = controller_numbers(net)

    parts: dict[str, tuple[Part, ...]] = {}
    for name, its in taking_part.items():
        if len(its) == 1:
            parts[name] = (Part(its[0], name),)
        else:
            numbered = sorted((controllers[owner], owner) for owner in its)
            parts[name] = tuple(Part(owner, part_name(number, numbers[name])) for number, owner in numbered)
    if clashes := list(_clashes(parts)):
        raise InputError(clashes)

    Arbitration.of(net)  # which refuses an arbiter that fits no component
    at = deciders(net)
    coordinated = tuple(
        Coordinated(
            t.name,
            numbers.get(t.name, t.number),
            parts[t.name],
            t.description,
            at[t.name],
        )
        for t in net.transitions
        if t.name in at
    )
    return Decomposition(net, _subnets(net, parts), coordinated, tuple(groups(net, at)))


def _problems(net: Net) -> Iterator[Diagnostic]:
    """Why the net cannot be split, before any name is given."""
    kinds: tuple[tuple[str, Sequence[Place | Signal]], ...] = (("places", net.places), ("signals", net.signals))
    for kind, items in kinds:
        orphans = [item.name for item in items if item.owner is None]
        if orphans:
            several = (
                f"{len(orphans)} {kind} have no owner, first of them '{orphans[0]}': no controller would keep them"
            )
            yield Diagnostic(
                "F2011",
                several if orphans[1:] else f"'{orphans[0]}' has no owner, so no controller would keep it",
                "nest what has no owner under one of the `controllers`, or have a file with owners written by "
                "`firable split NET --own CONTROLLER='PATTERN' -o FILE`",
                (kind, orphans[0]),
            )
    for kind, named in (("controllers", net.controllers), ("transitions", net.transitions)):
        for item in named:
            if "/" in item.name:  # `vote/T/C` would be the vote of C on T, or a transition of that name
                yield Diagnostic(
                    "F4001",
                    f"'{item.name}' has a '/' in its name, by which proofs part the names of what they add to the net",
                    "rename it, with another character in its place",
                    (kind, item.name),
                )
    for name in unowned(net):
        transition = net.transition(name)
        if (
            transition.inputs
            or transition.outputs
            or transition.permissive
            or transition.inhibitive
            or transition.external
        ):
            continue  # what it is joined to has no owner, which is already said
        yield Diagnostic(
            "F4001",
            f"'{name}' has no place and no gate, so it belongs to no controller",
            "give it an arc or a gate, or delete it",
            ("transitions", name),
        )
    for place in net.places:
        if place.within is not None and place.owner is not None:
            owner = net.signal(place.within.timer).owner
            if owner not in {place.owner, None}:
                yield Diagnostic(
                    "F4001",
                    f"'{place.name}' of '{place.owner}' is timed by '{place.within.timer}', which '{owner}' owns",
                    "the controller that sends a command is the one that times it",
                    ("places", place.name, "within"),
                )
        if place.completion is None or place.owner is None:
            continue
        owner = net.signal(place.completion).owner
        if owner not in {place.owner, None}:
            yield Diagnostic(
                "F4001",
                f"'{place.name}' of '{place.owner}' waits until '{place.completion}', which '{owner}' owns",
                "the controller that sends a command is the one that is told of its completion",
                ("places", place.name, "until"),
            )
    for transition in net.transitions:
        if transition.number is not None and transition.number < 0:
            yield Diagnostic(
                "F4001",
                f"'{transition.name}' has the negative number {transition.number}",
                "number the rows of the coordinator table from 1",
                ("transitions", transition.name, "number"),
            )


def _numbers(net: Net, names: Sequence[str]) -> dict[str, int]:
    """The number of each of these transitions: its own, or the next that no transition of the net bears."""
    taken = {transition.number for transition in net.transitions if transition.number is not None}
    free = (number for number in count(1) if number not in taken)
    numbers = {}
    for name in names:
        number = net.transition(name).number
        numbers[name] = next(free) if number is None else number
    return numbers


def _clashes(parts: dict[str, tuple[Part, ...]]) -> Iterator[Diagnostic]:
    """Local transitions that bear the name of a part; a place cannot, for the name of an owned one has a dot."""
    made = {part.name: name for name, its in parts.items() if len(its) > 1 for part in its}
    for name, its in parts.items():
        if len(its) == 1 and name in made:
            yield Diagnostic(
                "F4001",
                f"'{name}' is also the name of a part of '{made[name]}'",
                "rename it: names such as t1-21 are made from the numbers of the global transitions",
                ("transitions", name),
            )


def _subnets(net: Net, parts: Mapping[str, tuple[Part, ...]]) -> tuple[Net, ...]:
    """The subnet of each controller; every place, signal and part is looked at once, whatever the number of them."""
    places: dict[str | None, list[Place]] = {}
    signals: dict[str | None, list[Signal]] = {}
    transitions: dict[str, list[Transition]] = {}
    for place in net.places:
        places.setdefault(place.owner, []).append(place)
    for signal in net.signals:
        signals.setdefault(signal.owner, []).append(signal)
    for t in net.transitions:
        for part in parts[t.name]:
            number = t.number if len(parts[t.name]) == 1 else None
            transitions.setdefault(part.controller, []).append(_part(net, t, part, number))
    return tuple(
        Net(
            controller.name,
            tuple(places.get(controller.name, ())),
            tuple(transitions.get(controller.name, ())),
            tuple(signals.get(controller.name, ())),
            (replace(controller, under=None),),
            description=controller.description,
        )
        for controller in net.controllers
    )


def _part(net: Net, t: Transition, part: Part, number: int | None) -> Transition:
    """What of a transition is the part's controller's own."""

    def own(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in names if net.place(name).owner == part.controller)

    return Transition(
        part.name,
        own(t.inputs),
        own(t.outputs),
        own(t.permissive),
        own(t.inhibitive),
        tuple(gate for gate in t.external if net.signal(gate.signal).owner == part.controller),
        number,
        t.description,
    )
