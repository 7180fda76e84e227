"""Folding: a net in which what a controller does for one task is one place, so that a large cell stays readable.

A controller is idle, does something, and is idle again. Its idle places are those marked at the start; the others fall
into pieces, each what it does from leaving the idle place to coming back: its tasks. A folded task is drawn as a double
circle, the field's sign of a macro place. Transitions inside it that belong to the controller alone disappear with it,
and those that others take part in keep their part in its box: who meets whom is what a folded picture is looked at for.

The folded net is a picture and not a model: nothing is asked of it. Rejected: to fold along the tasks of the conceptual
net. Only refined nets have one, and the pieces are the same.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from firable.nets.drawing.part import everybody
from firable.nets.net import Marking, Net, Place, Signal, Transition

ALL: Final = "all"
"""What stands for every task of every controller."""


@dataclass(frozen=True)
class Folded:
    """A net with tasks folded: `members` are the places inside each macro place, which has the name of the first."""

    net: Net
    members: Mapping[str, tuple[str, ...]]
    participants: Mapping[str, frozenset[str | None]]
    """Who takes part in each transition that is left: a part inside a folded task is none that an arc would show."""

    @property
    def is_global(self) -> list[bool]:
        """Of each transition that is left, whether more than one controller takes part in it."""
        return [len(self.participants[t.name]) > 1 for t in self.net.transitions]

    def marking(self, net: Net, marking: Marking) -> Marking:
        """The marking of the folded net: a macro place is marked where a place inside it is.

        `net` may be one of which what was folded is a part.
        """
        inside = {member: name for name, members in self.members.items() for member in members}
        held = {inside.get(name, name) for name in net.names(marking)}
        return self.net.marking(held & self.net.place_index.keys())


def fold(net: Net, names: Collection[str], participants: Mapping[str, frozenset[str | None]] | None = None) -> Folded:
    """Fold the tasks that these names name: a place names the one it is in, a controller all of its tasks.

    `participants` are those of each transition, where the net is a part and its arcs do not say so.

    `all` names every task. A place that is idle, or alone in its task, folds nothing. Raises `KeyError` for a name that
    is neither place nor controller.

    >>> from firable.nets.catalogue import catalogue_net
    >>> folded = fold(catalogue_net("one_robot"), ["robot.back"])
    >>> folded.members
    {'robot.to_cv1': ('robot.to_cv1', 'robot.grasp_cv1', 'robot.to_mc', 'robot.put_mc', 'robot.back')}
    """
    owners = {controller.name for controller in net.controllers}
    for name in names:
        if name != ALL and name not in owners and name not in net.place_index:
            raise KeyError(name)
    chosen = [
        task
        for task in tasks(net)
        if ALL in names or net.place(task[0]).owner in names or any(place in names for place in task)
    ]
    members = {task[0]: task for task in chosen if len(task) > 1}
    participants = everybody(net) if participants is None else participants
    return _folded(net, members, participants) if members else Folded(net, {}, participants)


def tasks(net: Net) -> list[tuple[str, ...]]:
    """What each controller does between being idle and being idle again, as places, in the order of the net."""
    piece = {place.name: place.name for place in net.places if not place.marked and place.owner is not None}

    def root(name: str) -> str:
        while piece[name] != name:
            piece[name] = name = piece[piece[name]]
        return name

    for t in net.transitions:
        some: dict[str | None, str] = {}
        for name in (*t.inputs, *t.outputs):
            if name not in piece:
                continue
            owner = net.place(name).owner
            if owner in some:
                piece[root(name)] = root(some[owner])
            some[owner] = name
    found: dict[str, list[str]] = {}
    for place in net.places:
        if place.name in piece:
            found.setdefault(root(place.name), []).append(place.name)
    return sorted((tuple(task) for task in found.values()), key=lambda task: net.place_index[task[0]])


def _folded(
    net: Net, members: Mapping[str, tuple[str, ...]], participants: Mapping[str, frozenset[str | None]]
) -> Folded:
    inside = {member: name for name, some in members.items() for member in some}
    seen = (place for place in net.places if inside.get(place.name, place.name) == place.name)
    places = tuple(_macro(net, place, members) for place in seen)
    outside = (_outside(t, inside, is_local=len(participants[t.name]) == 1) for t in net.transitions)
    transitions = tuple(t for t in outside if t is not None)
    # What is folded sends no command, so nothing completes one: every signal is one that comes from outside.
    signals = tuple(Signal(signal.name, signal.owner) for signal in net.signals)
    plain = tuple(replace(place, completion=None, within=None) for place in places)
    folded = Net(net.name, plain, transitions, signals, net.controllers, description=net.description)
    return Folded(folded, members, participants)


def _macro(net: Net, place: Place, members: Mapping[str, tuple[str, ...]]) -> Place:
    if place.name not in members:
        return place
    return Place(place.name, place.owner, marked=any(net.place(name).marked for name in members[place.name]))


def _outside(t: Transition, inside: Mapping[str, str], *, is_local: bool) -> Transition | None:
    """A transition between what is folded; nothing where a folded task takes it in whole."""

    def moved(names: Iterable[str]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(inside.get(name, name) for name in names))

    inputs, outputs = moved(t.inputs), moved(t.outputs)
    within = {name for name in inputs if name in outputs and name in set(inside.values())}
    if within and is_local and within.issuperset((*inputs, *outputs)):
        return None
    kept = tuple(name for name in inputs if name not in within), tuple(name for name in outputs if name not in within)
    permissive = tuple(name for name in moved(t.permissive) if name not in {*inputs, *outputs})
    inhibitive = tuple(name for name in moved(t.inhibitive) if name not in {*inputs, *outputs, *permissive})
    return replace(t, inputs=kept[0], outputs=kept[1], permissive=permissive, inhibitive=inhibitive)
