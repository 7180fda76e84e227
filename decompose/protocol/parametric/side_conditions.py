"""What connects the theorem, which is about any net, with one decomposition: seven conditions on names.

The theorem speaks of a part as what a transition has of places at a controller. A `Decomposition` lists subnets and a
table; it may say something else, by a fault of the split or an edit by hand. So it is compared, name by name, with the
central net, in time linear in arcs and gates:

- *owner*: each place stands in one subnet, that of its owner (the function `owner`);
- *parts*: a coordinated transition has one part at each controller that owns a place of it, with just its arcs and
  gates there (so that who owns a gate takes part, O3), and whatever else takes part moves and reads nothing;
- *locals*: every other transition stands in one subnet, whole (the function `home`);
- *strangers*: the subnets have no transition that is neither, and none stands for two;
- *gates*: the external gates of the parts are those of the transition, each at the owner of its signal, and commands
  are completed and timed by the same signals (`signal`, `clears`);
- *start*: a place is marked in its subnet as in the central net;
- *free*: the parts that are said to be free of promise are parts, nobody else at their controller takes or reads what
  they take, or fills or reads what they fill, or reads a signal that they clear but who needs a place full that they
  fill; and of signals they read completions alone, at 1, which fall by a command. That their votes are persistent, too,
  is no comparison of names but a verdict of its own on each (`firable.decompose.splitting.persistence`).

Nothing is asked of arbitration groups. Promises alone keep conflicting transitions apart, whichever rounds ask for
them; groups decide who wins, which is fairness and not safety.

Rejected: to compare what the parts do and not what they list. Eq. (7)-(10) do that, by a solver
(`firable.decompose.proofs`); a gate that repeats an arc would pass there, and here it would lock more than the proof
knows of.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from firable.nets.decomposition import Decomposition
from firable.nets.net import Net, SignalKind, Transition
from firable.nets.verdict import Status, Verdict, Witness


@dataclass(frozen=True, slots=True)
class _Problem:
    """A condition does not hold, of this name."""

    subject: str
    words: str


@dataclass(frozen=True)
class _Split:
    """A decomposition with what all conditions look up."""

    decomposition: Decomposition
    net: Net
    subnets: dict[str, Net]
    owner_of: dict[str, str | None]
    cleared_of: dict[str, tuple[str, ...]]
    """The signals that a token clears when it enters a place."""
    part_of: dict[tuple[str, str], list[str]]
    """By controller and name of a part: the coordinated transitions that list it."""
    coordinated: frozenset[str]

    @classmethod
    def of(cls, decomposition: Decomposition) -> _Split:
        part_of: dict[tuple[str, str], list[str]] = {}
        for row in decomposition.coordinated:
            for part in row.parts:
                part_of.setdefault((part.controller, part.name), []).append(row.name)
        return cls(
            decomposition,
            decomposition.net,
            {subnet.name: subnet for subnet in decomposition.subnets},
            {place.name: place.owner for place in decomposition.net.places},
            {place.name: place.cleared for place in decomposition.net.places},
            part_of,
            frozenset(row.name for row in decomposition.coordinated),
        )


def side_conditions(decomposition: Decomposition) -> tuple[Verdict, ...]:
    """A verdict `protocol.side.NAME` on each condition; where one fails, its subject is the first name that fails."""
    split = _Split.of(decomposition)
    return tuple(_verdict(name, statement, next(check(split), None)) for name, statement, check in CONDITIONS)


def _verdict(name: str, statement: str, problem: _Problem | None) -> Verdict:
    full, method = f"protocol.side.{name}", "comparison of the subnets and the table with the central net"
    if problem is None:
        return Verdict(full, Status.PROVED, statement, method)
    return Verdict(
        full,
        Status.VIOLATED,
        statement,
        method,
        code="F4002",
        hint="split the net anew: subnets and table are not to be edited",
        subjects=(problem.subject,),
        witness=Witness(note=problem.words),
    )


def _owner(split: _Split) -> Iterator[_Problem]:
    for name, n in Counter(subnet.name for subnet in split.decomposition.subnets).items():
        if n > 1:
            yield _Problem(name, f"there are {n} subnets of '{name}'")
    found: dict[str, str] = {}
    for subnet in split.decomposition.subnets:
        for place in subnet.places:
            if place.name not in split.owner_of:
                yield _Problem(place.name, f"'{place.name}' of the subnet of '{subnet.name}' is no place of the net")
            elif place.name in found:
                yield _Problem(place.name, f"'{place.name}' stands in two subnets")
            elif subnet.name != split.owner_of[place.name]:
                owner = split.owner_of[place.name]
                yield _Problem(place.name, f"'{place.name}' is owned by '{owner}', and kept by '{subnet.name}'")
            found[place.name] = subnet.name
    for name in split.owner_of:
        if name not in found:
            yield _Problem(name, f"'{name}' stands in no subnet")


_KINDS: Final = ("inputs", "outputs", "permissive", "inhibitive")


def _arcs(transition: Transition, kind: str) -> tuple[str, ...]:
    arcs: tuple[str, ...] = getattr(transition, kind)
    return arcs


def _parts(split: _Split) -> Iterator[_Problem]:
    for name, n in Counter(row.name for row in split.decomposition.coordinated).items():
        if n > 1:
            yield _Problem(name, f"the table lists '{name}' {n} times")
    for row in split.decomposition.coordinated:
        if row.name not in split.net.transition_index:
            yield _Problem(row.name, f"'{row.name}' of the table is no transition of the net")
            continue
        whole = split.net.transition(row.name)
        asked = [part.controller for part in row.parts]
        for controller, n in Counter(asked).items():
            if n > 1:
                yield _Problem(row.name, f"'{row.name}' has {n} parts at '{controller}'")
        for part in row.parts:
            subnet = split.subnets.get(part.controller)
            if subnet is None or part.name not in subnet.transition_index:
                yield _Problem(row.name, f"'{row.name}' lists '{part.name}', which '{part.controller}' does not have")
                continue
            for kind in _KINDS:
                wanted = [place for place in _arcs(whole, kind) if split.owner_of.get(place) == part.controller]
                if sorted(wanted) != sorted(_arcs(subnet.transition(part.name), kind)):
                    words = f"the {kind} of '{part.name}' at '{part.controller}' are not those of '{row.name}' there"
                    yield _Problem(row.name, words)
        for kind in _KINDS:
            for place in _arcs(whole, kind):
                if split.owner_of.get(place) not in asked:
                    owner = split.owner_of.get(place)
                    yield _Problem(row.name, f"'{owner}' owns '{place}' of '{row.name}', and takes no part in it (O3)")


def _locals(split: _Split) -> Iterator[_Problem]:
    homes: dict[str, list[Net]] = {}
    for subnet in split.decomposition.subnets:
        for transition in subnet.transitions:
            if (subnet.name, transition.name) not in split.part_of:
                homes.setdefault(transition.name, []).append(subnet)
    for whole in split.net.transitions:
        if whole.name in split.coordinated:
            continue
        at = homes.get(whole.name, [])
        if len(at) != 1:
            yield _Problem(whole.name, f"'{whole.name}' is not coordinated, and stands in {len(at)} subnets")
            continue
        local = at[0].transition(whole.name)
        for kind in (*_KINDS, "external"):
            if sorted(map(repr, getattr(local, kind))) != sorted(map(repr, getattr(whole, kind))):
                words = f"the {kind} of '{whole.name}' at '{at[0].name}' are not those of the central net"
                yield _Problem(whole.name, words)


def _strangers(split: _Split) -> Iterator[_Problem]:
    for (controller, part), rows in split.part_of.items():
        if len(rows) > 1:
            yield _Problem(part, f"'{part}' at '{controller}' is a part of '{rows[0]}' and of '{rows[1]}'")
    for subnet in split.decomposition.subnets:
        for transition in subnet.transitions:
            if (subnet.name, transition.name) in split.part_of:
                continue
            if transition.name not in split.net.transition_index or transition.name in split.coordinated:
                words = f"'{transition.name}' at '{subnet.name}' is no part of a coordinated transition and not local"
                yield _Problem(transition.name, words)


def _gates(split: _Split) -> Iterator[_Problem]:
    owner_of = {signal.name: signal.owner for signal in split.net.signals}
    for subnet in split.decomposition.subnets:
        for signal in subnet.signals:
            if owner_of.get(signal.name) != subnet.name:
                yield _Problem(signal.name, f"'{signal.name}' is read by '{subnet.name}', which does not own it")
        for place in subnet.places:
            if place.cleared != split.cleared_of.get(place.name):
                words = f"the command of '{place.name}' is completed, or timed, by another signal at '{subnet.name}'"
                yield _Problem(place.name, words)
    for row in split.decomposition.coordinated:
        if row.name not in split.net.transition_index:
            continue  # which `parts` says
        whole = split.net.transition(row.name)
        for part in row.parts:
            its = split.subnets.get(part.controller)
            if its is None or part.name not in its.transition_index:
                continue
            wanted = {gate for gate in whole.external if owner_of[gate.signal] == part.controller}
            if set(its.transition(part.name).external) != wanted:
                words = (
                    f"the external gates of '{part.name}' at '{part.controller}' are not those of '{row.name}' there"
                )
                yield _Problem(row.name, words)
        for gate in whole.external:
            if owner_of[gate.signal] not in {part.controller for part in row.parts}:
                yield _Problem(row.name, f"who owns '{gate.signal}' takes no part in '{row.name}'")


def _start(split: _Split) -> Iterator[_Problem]:
    marked = {place.name: place.marked for place in split.net.places}
    for subnet in split.decomposition.subnets:
        for place in subnet.places:
            if place.marked != marked.get(place.name, place.marked):
                words = f"'{place.name}' is {'' if place.marked else 'not '}marked in the subnet of '{subnet.name}'"
                yield _Problem(place.name, f"{words}, other than in the central net")


def _free(split: _Split) -> Iterator[_Problem]:
    parts = {(row.name, part.controller) for row in split.decomposition.coordinated for part in row.parts}
    kind = {signal.name: signal.kind for signal in split.net.signals}
    at: dict[str, list[Transition]] = {}
    for each in split.net.transitions:
        owners = {split.owner_of.get(place) for arcs in _KINDS for place in _arcs(each, arcs)}
        owners |= {split.net.signal(gate.signal).owner for gate in each.external}
        for owner in owners - {None}:
            at.setdefault(str(owner), []).append(each)
    for name, controller in split.decomposition.free:
        if (name, controller) not in parts or name not in split.net.transition_index:
            yield _Problem(name, f"'{name}' has no part at '{controller}' to be free of promise")
            continue
        whole = split.net.transition(name)
        takes, fills = (
            {place for place in _arcs(whole, arcs) if split.owner_of.get(place) == controller}
            for arcs in ("inputs", "outputs")
        )
        cleared = {signal for place in fills for signal in split.cleared_of[place]}
        for gate in whole.external:
            if split.net.signal(gate.signal).owner != controller:
                continue
            if not gate.wanted or kind[gate.signal] is not SignalKind.COMPLETION:
                yield _Problem(name, f"'{name}' is free of promise at '{controller}', and reads '{gate.signal}'")
        for other in at.get(controller, ()):
            if other is whole:
                continue
            full, empty = {*other.inputs, *other.permissive}, {*other.outputs, *other.inhibitive}
            read = {gate.signal for gate in other.external} & cleared
            in_the_way = sorted(takes & full | fills & empty | (set() if fills & full else read))
            if in_the_way:
                words = f"'{name}' is free of promise at '{controller}', and '{other.name}' is at '{in_the_way[0]}'"
                yield _Problem(name, words)


CONDITIONS: Final[tuple[tuple[str, str, Callable[[_Split], Iterator[_Problem]]], ...]] = (
    ("owner", "each place stands in one subnet, that of its owner", _owner),
    ("parts", "each part has the arcs and gates of its transition at its controller, and no owner is left out", _parts),
    ("locals", "each transition that is not coordinated stands whole in one subnet", _locals),
    ("strangers", "the subnets have no other transitions", _strangers),
    ("gates", "the parts have the external gates of the transition, each at the owner of its signal", _gates),
    ("start", "the subnets are marked as the central net", _start),
    ("free", "parts that are free of promise disturb nobody, and read no signal that falls by itself", _free),
)
"""What the theorem assumes of a decomposition. To add one: its function, and a row."""
