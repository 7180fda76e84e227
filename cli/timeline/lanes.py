"""Who has a lane in what is told of a run: each machine that a place commands, in the order of the controllers.

A lane is of a machine and the controller that commands it. The commands of a machine follow each other, so a lane is
one row; a controller that lets two places command one machine at once gets a second row there, so that no span hides
another. The row of a stay is the first that is free when it begins, as an interval scheduler would give it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from firable.nets.net import Net, Place
from firable.semantics.course import Course, Stay


@dataclass(frozen=True, slots=True)
class Lane:
    """A machine, its controller ("" where the place has none), its rows of commands, and what it is kept for besides.

    `held` are the stays on places without a command, while the machine does nothing and is not free: known where the
    controller has one machine only.
    """

    owner: str
    machine: str
    rows: tuple[tuple[Stay, ...], ...]
    held: tuple[Stay, ...] = ()


def lanes(course: Course) -> tuple[Lane, ...]:
    """The lanes of a run."""
    of = {place.name: lane_of(place) for place in course.net.places if place.command is not None}
    names = sorted(dict.fromkeys(of.values()), key=lambda lane: _rank(course.net, lane[0]))
    sent: dict[tuple[str, str], list[Stay]] = {name: [] for name in names}
    idle: dict[str, list[Stay]] = {}
    for stay in course.stays:
        if stay.place.command is not None:
            sent[of[stay.place.name]].append(stay)
        elif not stay.place.marked:
            idle.setdefault(stay.place.owner or "", []).append(stay)
    alone = {owner for owner, _ in names if sum(owner == other for other, _ in names) == 1}
    return tuple(
        Lane(*name, tuple(_rows(course, sent[name])), tuple(idle.get(name[0], ())) if name[0] in alone else ())
        for name in names
    )


def participants(net: Net) -> dict[str, frozenset[str]]:
    """The controllers that each transition is of: the owners of its places and signals."""
    found = {}
    for t in net.transitions:
        owners = {net.place(name).owner or "" for name in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)}
        found[t.name] = frozenset(owners | {net.signal(gate.signal).owner or "" for gate in t.external})
    return found


def taking_part(net: Net, shown: Sequence[Lane]) -> dict[str, tuple[int, ...]]:
    """The lanes that each transition is of, by their numbers.

    Of a controller with several machines these are the ones whose commands it begins, ends or asks for; all of them
    where it touches no command, and which machine it is about is not known.
    """
    found = {}
    of = participants(net)
    for t in net.transitions:
        places = [net.place(name) for name in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive)]
        commanded = {lane_of(place) for place in places if place.command is not None}
        exact = {owner for owner, _ in commanded}
        found[t.name] = tuple(
            i
            for i, lane in enumerate(shown)
            if (lane.owner, lane.machine) in commanded or lane.owner in of[t.name] - exact
        )
    return found


def lane_of(place: Place) -> tuple[str, str]:
    """The controller and the machine of the command of a place."""
    return place.owner or "", place.command.machine if place.command is not None else ""


def _rank(net: Net, owner: str) -> int:
    return net.controller_index.get(owner, len(net.controllers))


def _rows(course: Course, stays: list[Stay]) -> Iterator[tuple[Stay, ...]]:
    rows: list[list[Stay]] = [[]]
    for stay in stays:
        free = (row for row in rows if not row or _until(row[-1], course) <= stay.entered_seconds)
        row = next(free, None)
        if row is None:
            rows.append([stay])
        else:
            row.append(stay)
    return (tuple(row) for row in rows)


def _until(stay: Stay, course: Course) -> float:
    return course.end_seconds if stay.left_seconds is None else stay.left_seconds
