"""Transitions that take each other's promise away without being in conflict, and so have one decider.

A promise keeps from its controller whatever would disturb it (O1). Two coordinators that ask one controller for parts
that disturb each other stand in each other's way, and at two controllers in opposite orders for ever: each gets one
yes and one no, both give up, both ask again. Of conflicting transitions O8 excludes that, since one coordinator decides
them. But a part disturbs also who only *reads* what it moves: it takes the token that a permissive gate of the other
reads, puts one on what an inhibitive gate reads, or sends a command that clears a signal which an external gate reads.
Those that *contend* so are decided at one place as well: by the lowest coordinator above all participants. A
coordinator never asks for two things at once that disturb each other, so no promise ever waits for another one.

Only what could be promised together matters: parts of which one needs a place full that the other needs empty never
are. With them, all that follows each other at a machine would be decided at the top. That two commands clear one signal
is no contention: cleared twice is cleared.

Rejected: to leave such pairs where they are, and to settle who comes first by the rank of the coordinators. It keeps a
cell's transition in the cell though a gate of the line reads it; but a busy cell could keep the line waiting for ever,
and controllers would have to hold requests back. A net whose cells should stand alone has its gates within them.

Asked of a net in one layer this is never needed. Cost: the pairs of those who move a place with those who read it, as
far as they are coordinated.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from firable.nets.net import Net, Transition


@dataclass(frozen=True, slots=True)
class Contention:
    """`mover` changes `at`, a place or a signal, while `reader` reads it, and both may be promised at its owner."""

    mover: str
    reader: str
    at: str


def contentions(net: Net, among: Collection[str]) -> Iterator[Contention]:
    """The transitions `among` these that contend, by the places in the order of the net, then by its signals.

    >>> from firable.nets.net import Controller, Place
    >>> places = (Place("a.p", "a", marked=True), Place("a.q", "a"), Place("b.r", "b", marked=True), Place("b.s", "b"))
    >>> move, read = Transition("move", ("a.p",), ("a.q",)), Transition("read", ("b.r",), ("b.s",), ("a.p",))
    >>> net = Net("n", places, (move, read), controllers=(Controller("a"), Controller("b")))
    >>> list(contentions(net, ("move", "read")))
    [Contention(mover='move', reader='read', at='a.p')]
    """
    full: dict[str, list[Transition]] = {}
    empty: dict[str, list[Transition]] = {}
    asking: dict[str, list[Transition]] = {}
    clearing: dict[str, list[Transition]] = {}
    for t in net.transitions:
        if t.name not in among:
            continue
        for name in t.permissive:
            full.setdefault(name, []).append(t)
        for name in t.inhibitive:
            empty.setdefault(name, []).append(t)
        for name in dict.fromkeys(gate.signal for gate in t.external):
            asking.setdefault(name, []).append(t)
        for name in dict.fromkeys(signal for p in t.outputs for signal in net.place(p).cleared):
            clearing.setdefault(name, []).append(t)
    for place in net.places:
        p = net.place_index[place.name]
        for readers, movers in ((full, net.consumers[p]), (empty, net.producers[p])):
            moving = [net.transitions[t] for t in movers if net.transitions[t].name in among]
            yield from _pairs(net, moving, readers.get(place.name, ()), place.name, place.owner)
    for signal in net.signals:
        yield from _pairs(net, clearing.get(signal.name, ()), asking.get(signal.name, ()), signal.name, signal.owner)


def decided_together(net: Net, groups: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], ...]:
    """The transitions of these groups that one coordinator decides: groups with some that contend are put together.

    >>> decided_together(Net("n"), [("t", "u"), ("v",)])
    (('t', 'u'), ('v',))
    """
    group_of = {name: g for g, group in enumerate(groups) for name in group}
    beside: dict[int, set[int]] = {g: set() for g in range(len(groups))}
    for found in contentions(net, group_of.keys()):
        one, other = group_of[found.mover], group_of[found.reader]
        beside[one].add(other)
        beside[other].add(one)
    done, together = set[int](), []
    for first in beside:
        if first in done:
            continue
        grown, members = [first], {first}
        while grown:
            new = beside[grown.pop()] - members
            members |= new
            grown += new
        done |= members
        together.append(tuple(name for g in sorted(members) for name in groups[g]))
    return tuple(together)


def _pairs(
    net: Net, movers: Collection[Transition], readers: Collection[Transition], at: str, owner: str | None
) -> Iterator[Contention]:
    for mover in movers:
        for reader in readers:
            if mover is not reader and not _exclude(net, mover, reader, owner):
                yield Contention(mover.name, reader.name, at)


def _exclude(net: Net, one: Transition, other: Transition, owner: str | None) -> bool:
    """Whether at this controller one needs something full that the other needs empty, or a signal the other way."""
    mine, theirs = _needs(net, one, owner), _needs(net, other, owner)
    return any(theirs.get(name, wanted) != wanted for name, wanted in mine.items())


def _needs(net: Net, t: Transition, owner: str | None) -> dict[str, bool]:
    """What a part needs full (1) or empty (0) at its controller; a transition that is never firable may say either."""
    needs = {gate.signal: gate.wanted for gate in t.external if net.signal(gate.signal).owner == owner}
    for places, wanted in (((*t.inputs, *t.permissive), True), ((*t.outputs, *t.inhibitive), False)):
        needs |= {place: wanted for place in places if net.place(place).owner == owner}
    return needs
