"""Giving a net owners: the same net, in which each place and signal belongs to a controller and bears its name.

An owned thing is named `controller.thing`, so owning renames it wherever it stands: in arcs, gates, completions,
timers, formulas and the roles of tasks. The name within the controller is the one it had before, without its former
owner; where two of one controller would then have the same name, the former owner stays in it (`robot_free`,
`mc_free`). The description of a fault transition names the completion, and follows it. Nothing else changes: the net
with owners has the same markings under other names.

Rejected: owners beside the names, as a table of their own. A reader of `robot.free` sees whose it is, and so does a
diff.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import starmap
from typing import Any

from firable.nets.formula import Count, Holds
from firable.nets.net import Controller, Net, Place, Signal, TaskUse, Transition
from firable.nets.time_limits import fault_transition


def with_owners(net: Net, owner_of: Mapping[str, str], controllers: Sequence[Controller]) -> Net:
    """The net in which each place and signal belongs to the controller that `owner_of` names for it.

    Raises `KeyError` for a place or signal without an owner there, `InputError` where the new names are none.

    >>> from firable.nets.net import Place
    >>> with_owners(Net("n", (Place("free"),)), {"free": "robot"}, (Controller("robot"),)).places[0].name
    'robot.free'
    """
    items: list[Place | Signal] = [*net.places, *net.signals]
    local = {item.name: item.name.removeprefix(f"{item.owner}.") if item.owner else item.name for item in items}
    taken = Counter((owner_of[item.name], local[item.name]) for item in items)
    named = {}
    for item in items:
        owner, short = owner_of[item.name], local[item.name]
        if taken[owner, short] > 1 and item.owner:
            short = f"{item.owner}_{short}"
        named[item.name] = f"{owner}.{short}"

    def new(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(named[name] for name in names)

    places = tuple(
        replace(
            place,
            name=named[place.name],
            owner=owner_of[place.name],
            completion=None if place.completion is None else named[place.completion],
            within=None if place.within is None else replace(place.within, timer=named[place.within.timer]),
            task=_with_roles(net, place, owner_of[place.name], named),
        )
        for place in net.places
    )
    told = {t: (_told(net.places[p]), _told(places[p])) for p, t in net.fault_transitions.items()}

    def moved(index: int, t: Transition) -> Transition:
        external = tuple(replace(gate, signal=named[gate.signal]) for gate in t.external)
        gates = new(t.permissive), new(t.inhibitive)
        before, after = told.get(index, ("", ""))
        description = after if t.description == before else t.description
        return Transition(t.name, new(t.inputs), new(t.outputs), *gates, external, t.number, description)

    return Net(
        net.name,
        places,
        tuple(starmap(moved, enumerate(net.transitions))),
        tuple(replace(signal, name=named[signal.name], owner=owner_of[signal.name]) for signal in net.signals),
        tuple(controllers),
        net.arbiters,
        tuple(_renamed(prop, named.__getitem__) for prop in net.properties),
        net.description,
        net.expected,
    )


def with_those_named(net: Net, controllers: Iterable[Controller]) -> tuple[Controller, ...]:
    """These controllers, and those of the net that they name and that may own nothing: who stands above one, and whom
    a resource opens to.

    >>> net = Net("n", controllers=(Controller("line"), Controller("robot", under="line"), Controller("belt")))
    >>> [one.name for one in with_those_named(net, net.controllers[1:2])]
    ['robot', 'line']
    """
    given = {controller.name: controller for controller in controllers}
    known = {controller.name: controller for controller in net.controllers} | given
    named = [place.resource.idle.partition(".")[0] for place in net.places if place.resource]
    named += [controller.under for controller in given.values() if controller.under]
    besides: set[str] = set()
    while named:
        if (name := named.pop()) in known and name not in besides:
            besides.add(name)
            named += filter(None, [known[name].under])
    return (*given.values(), *(one for one in net.controllers if one.name in besides and one.name not in given))


def resource_of(net: Net, place: Place, name: str) -> str | None:
    """The resource place that an argument of a task names, local to the controller of the task's place or in full."""
    for full in (name if place.owner is None else f"{place.owner}.{name}", name):
        if full in net.place_index and net.place(full).resource:
            return full
    return None


def _with_roles(net: Net, place: Place, owner: str, named: Mapping[str, str]) -> TaskUse | None:
    """What fills the roles of a place's task, renamed; a name stays short where both are of one controller again."""

    def role(name: str) -> str:
        if (full := resource_of(net, place, name)) is None:
            return name
        return named[full] if name == full else named[full].removeprefix(f"{owner}.")

    arguments = () if place.task is None else place.task.arguments
    return place.task and replace(place.task, arguments=tuple((key, role(name)) for key, name in arguments))


def _told(place: Place) -> str:
    """The description of the fault transition of a place, as its time limit gives it."""
    return fault_transition(place, "", "").description


def _renamed(term: Any, named: Callable[[str], str]) -> Any:
    """A property or formula with its places renamed."""
    match term:
        case Holds(place):
            return Holds(named(place))
        case Count(places, added):
            return Count(tuple(map(named, places)), added)
        case tuple():
            return tuple(_renamed(item, named) for item in term)
    if is_dataclass(term) and not isinstance(term, type):
        return replace(term, **{one.name: _renamed(getattr(term, one.name), named) for one in fields(term)})
    return term
