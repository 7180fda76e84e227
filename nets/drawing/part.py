"""A part of a net: what some of its controllers own, and their parts of the transitions that they take part in.

Pictures of a few controllers, of the lanes of one panel and of one host show it. A part has what ends in it, no more:
who else takes part in a transition is no longer seen in its arcs, and is asked of the whole (`everybody`). Rejected: to
keep the places of the others as stubs. A conveyor that feeds twenty cells would drag all of them into its picture.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from firable.nets.drawing.arrangement import Owner
from firable.nets.net import Net, Transition


def owners_of(net: Net) -> list[Owner]:
    """Who owns something of a net, in its order; behind them None, if something of it is owned by nobody."""
    owned = {place.owner for place in net.places} | {signal.owner for signal in net.signals}
    named: list[Owner] = [controller.name for controller in net.controllers if controller.name in owned]
    return [*named, None] if None in owned else named


def taking_part(net: Net, t: Transition) -> frozenset[str | None]:
    """The owners of what a transition takes, puts and reads; None stands for what nobody owns."""
    places = (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)
    owners = {net.place(name).owner for name in places} | {net.signal(gate.signal).owner for gate in t.external}
    return frozenset(owners)


def everybody(net: Net) -> dict[str, frozenset[Owner]]:
    """Who takes part in each transition of a net."""
    return {t.name: taking_part(net, t) for t in net.transitions}


def part_of(net: Net, owners: Collection[Owner], participants: Mapping[str, Collection[Owner]]) -> Net:
    """What of a net belongs to these owners, with the transitions in which one of them takes part."""
    here = set(owners)
    places = tuple(place for place in net.places if place.owner in here)
    signals = tuple(signal for signal in net.signals if signal.owner in here)
    names = {place.name for place in places} | {signal.name for signal in signals}

    def part(t: Transition) -> Transition:
        def own(some: Sequence[str]) -> tuple[str, ...]:
            return tuple(name for name in some if name in names)

        external = tuple(gate for gate in t.external if gate.signal in names)
        arcs = own(t.inputs), own(t.outputs), own(t.permissive), own(t.inhibitive)
        return replace(
            t, inputs=arcs[0], outputs=arcs[1], permissive=arcs[2], inhibitive=arcs[3], external=external, number=None
        )

    transitions = tuple(part(t) for t in net.transitions if here.intersection(participants[t.name]))
    controllers = tuple(replace(c, under=None) for c in net.controllers if c.name in here)
    return Net(net.name, places, transitions, signals, controllers, description=net.description)
