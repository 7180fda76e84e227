"""What follows from a split: why each transition is coordinated, and what each controller must know.

Whoever takes over a controller asks: what do I hold, which transitions do I fire alone, for which do I vote, what do I
lock for others that they only read, whom do I talk to? And whoever draws the line between controllers asks which
transitions became global by it, and whether an arc, a gate or a conflict made them so; a gate that reaches over the
line can often be moved, an arc cannot.

All of it follows from the net, the subnets and the table, and is written into bundles nevertheless, as `split.json`, so
that it can be read without this program. Reading a bundle derives it anew and compares, so it cannot say anything else.
That is why it is total: where a table was edited so that it names what is not there, it says less, and raises nothing.
Rejected: fields of their own in the table, which could contradict the rest of it.

Cost: linear in the arcs and gates of the net.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from firable.nets.contention import contentions
from firable.nets.decomposition import Decomposition
from firable.nets.layers import Layers
from firable.nets.net import ExternalGate, Net, SignalKind, Transition


class Because(StrEnum):
    """What makes the coordinator decide a transition."""

    ARCS = "arcs"
    """It moves tokens of several controllers."""
    GATE = "gate"
    """It moves tokens of one controller, and a gate reads a place or a signal of another one (O3)."""
    CONFLICT = "conflict"
    """It is local, and in the conflict component of a global one (O2)."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why the coordinator decides `transition`.

    `gates` are the places and signals of other controllers that its gates read, where nothing else makes it global.
    `rival` is what it conflicts with at `place`: by which a local transition is joined to a global one, or one whose
    participants all stand under the coordinator `lifted_from` is decided by another one above that; that may also be
    one that it contends with there (`firable.nets.contention`).
    """

    transition: str
    because: Because
    gates: tuple[str, ...] = ()
    rival: str = ""
    place: str = ""
    lifted_from: str = ""


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What one controller must know.

    `fires` are the transitions that it decides alone, `decides` its own arbitration groups; `votes` are its parts, each
    with the transition. `locks` are its places that a gate of a global transition reads, each with the transition:
    while it has promised, they stay as they are. `answers` are its signals in the same way, which it cannot lock (O4).
    `undisturbing` are the parts that take no other yes back, by the arcs and by the completions that they clear, and
    whose gates nothing here closes: one that is persistent needs no promise
    (`firable.decompose.splitting.persistence`). It `coordinates` these transitions for those under it, and `relays`
    those that are decided above it and in which one under it takes part: their AND is its vote to the layer above (O8).
    Messages go between who decides and who takes part, whoever stands between them; so it `talks_to` the coordinators
    of its votes, and to those who vote on what it coordinates.
    """

    controller: str
    places: tuple[str, ...]
    signals: tuple[str, ...]
    fires: tuple[str, ...]
    decides: tuple[str, ...]
    votes: tuple[tuple[str, str], ...]
    locks: tuple[tuple[str, str], ...]
    answers: tuple[tuple[str, str], ...]
    undisturbing: tuple[str, ...]
    coordinates: tuple[str, ...]
    relays: tuple[str, ...]
    talks_to: tuple[str, ...]


def reasons(decomposition: Decomposition) -> tuple[Reason, ...]:
    """Why the coordinator decides each transition that it decides, in the order of the net."""
    net = decomposition.net
    joined, layers, in_the_way = _joined(decomposition), Layers(net), _in_the_way(decomposition)
    found = []
    for row in decomposition.coordinated:
        if row.name not in net.transition_index:
            continue
        if not row.is_global:
            rival, place = joined.get(row.name, ("", ""))
            found.append(Reason(row.name, Because.CONFLICT, rival=rival, place=place))
            continue
        transition = net.transition(row.name)
        movers = {net.place(name).owner for name in (*transition.inputs, *transition.outputs)}
        rival, place = "", ""
        if (lower := layers.common(part.controller for part in row.parts)) == (row.at or layers.root):
            lower = ""
        else:
            rival, place = _rival(net, transition) or in_the_way.get(row.name, ("", ""))
        if len(movers) > 1:
            found.append(Reason(row.name, Because.ARCS, (), rival, place, lower))
            continue
        read = [*transition.permissive, *transition.inhibitive]
        gates = [name for name in read if net.place(name).owner not in movers]
        gates += [gate.signal for gate in transition.external if net.signal(gate.signal).owner not in movers]
        found.append(Reason(row.name, Because.GATE, tuple(dict.fromkeys(gates)), rival, place, lower))
    return tuple(found)


def knowledge(decomposition: Decomposition) -> tuple[Knowledge, ...]:
    """What each controller must know, in the order of the subnets."""
    layers = Layers(decomposition.net)
    relays, talks = _passed_on(decomposition, layers)
    whole = {(part.controller, part.name): row for row in decomposition.coordinated for part in row.parts}
    coordinated: dict[str, list[str]] = {}
    for row in decomposition.coordinated:
        coordinated.setdefault(row.at or layers.root, []).append(row.name)
    groups: dict[str | None, list[str]] = {}
    for group in decomposition.groups:
        groups.setdefault(group.controller, []).append(group.name)
    found = []
    for subnet in decomposition.subnets:
        rows = [(whole.get((subnet.name, t.name)), t) for t in subnet.transitions]
        votes = [(row, part) for row, part in rows if row is not None]
        keeps = _keeping(subnet)
        found.append(
            Knowledge(
                subnet.name,
                tuple(place.name for place in subnet.places),
                tuple(signal.name for signal in subnet.signals),
                tuple(part.name for row, part in rows if row is None),
                tuple(groups.get(subnet.name, ())),
                tuple((row.name, part.name) for row, part in votes),
                tuple(_read(votes, lambda t: (*t.permissive, *t.inhibitive))),
                tuple(_read(votes, lambda t: tuple(gate.signal for gate in t.external))),
                tuple(part.name for _, part in votes if keeps(part)),
                tuple(coordinated.get(subnet.name, ())),
                tuple(relays.get(subnet.name, ())),
                tuple(talks.get(subnet.name, ())),
            )
        )
    return tuple(found)


def undisturbing(decomposition: Decomposition) -> tuple[str, ...]:
    """The parts that by the net alone take no other yes back, and whose gates nothing at their controller closes."""
    return tuple(part for one in knowledge(decomposition) for part in one.undisturbing)


def split_to_json(decomposition: Decomposition) -> dict[str, Any]:
    """The content of `split.json`."""
    return {
        "coordinated": [asdict(reason) for reason in reasons(decomposition)],
        "controllers": [asdict(one) for one in knowledge(decomposition)],
    }


def _passed_on(
    decomposition: Decomposition, layers: Layers
) -> tuple[Mapping[str, Iterable[str]], Mapping[str, Iterable[str]]]:
    """For each controller what is decided above it with those under it, and with whom it exchanges messages."""
    relays: dict[str, dict[str, None]] = {}
    talks: dict[str, dict[str, None]] = {}
    for row in decomposition.coordinated:
        at = row.at or layers.root
        for part in row.parts:
            now = part.controller
            if now != at:
                talks.setdefault(at, {})[now] = None
                talks.setdefault(now, {})[at] = None
            while now != at and (above := layers.parent.get(now)) is not None:
                if above != at:
                    relays.setdefault(above, {})[row.name] = None
                now = above
    order = {name: i for i, name in enumerate((layers.root, *(c.name for c in decomposition.net.controllers)))}
    return relays, {
        name: sorted(others, key=lambda other: (other != layers.parent.get(name), order.get(other, 0)))  # upwards first
        for name, others in talks.items()
    }


def _read(votes: Sequence[tuple[Any, Transition]], gates: Callable[[Transition], tuple[str, ...]]) -> Any:
    """What the parts of global transitions read, each with the transition, in the order of what is read."""
    found = [(name, row.name) for row, part in votes if row.is_global for name in dict.fromkeys(gates(part))]
    return sorted(found)


def _joined(decomposition: Decomposition) -> Mapping[str, tuple[str, str]]:
    """Of the local transitions in the conflict component of a global one: what each is joined by, and the place.

    Breadth first from the global ones, so the rival is one of the nearest to a global transition.
    """
    net = decomposition.net
    is_global = {row.name for row in decomposition.coordinated if row.is_global}
    seen = [t.name for t in net.transitions if t.name in is_global]
    joined: dict[str, tuple[str, str]] = {}
    reached: set[tuple[str, bool]] = set()
    for name in seen:
        transition = net.transition(name)
        shared = [(place, False) for place in transition.inputs] + [(place, True) for place in transition.outputs]
        for place, put in shared:
            if (place, put) in reached:
                continue
            reached.add((place, put))
            index = net.place_index[place]
            for other in (net.producers if put else net.competitors)[index]:
                rival = net.transitions[other].name
                if rival not in is_global and rival not in joined:
                    joined[rival] = (name, place)
                    seen.append(rival)
    return joined


def _rival(net: Net, transition: Transition) -> tuple[str, str] | None:
    """One that it conflicts with, and the place; None where there is none."""
    for places, table in ((transition.inputs, net.competitors), (transition.outputs, net.producers)):
        for place in places:
            for other in table[net.place_index[place]]:
                if net.transitions[other] is not transition:
                    return net.transitions[other].name, place
    return None


def _in_the_way(decomposition: Decomposition) -> Mapping[str, tuple[str, str]]:
    """Of each coordinated transition, one that it contends with, and the place or signal."""
    net, found = decomposition.net, dict[str, tuple[str, str]]()
    if Layers(net).several:
        names = {row.name for row in decomposition.coordinated}
        for one in contentions(net, names):
            found.setdefault(one.mover, (one.reader, one.at))
            found.setdefault(one.reader, (one.mover, one.at))
    return found


def _keeping(subnet: Net) -> Callable[[Transition], bool]:
    """Whether a part of the subnet keeps every other yes there, and its own gates."""
    takers = Counter(place for t in subnet.transitions for place in {*t.inputs, *t.permissive})
    putters = Counter(place for t in subnet.transitions for place in {*t.outputs, *t.inhibitive})
    senders: dict[str, set[str]] = {}
    for place in subnet.places:
        for signal in place.cleared:
            senders.setdefault(signal, set()).add(place.name)
    readers: dict[str, list[Transition]] = {signal: [] for signal in senders}
    for t in subnet.transitions:
        for signal in {gate.signal for gate in t.external} & readers.keys():
            readers[signal].append(t)

    def shows_what_it_clears(part: Transition) -> bool:
        """Whether someone may read a completion or timer that the part clears while its order is still on its way.

        Not who needs an output place of it full, which is empty until then.
        """
        outputs = set(part.outputs)
        cleared = {signal for place in part.outputs for signal in subnet.place(place).cleared}
        return any(
            t is not part and outputs.isdisjoint((*t.inputs, *t.permissive))
            for signal in cleared
            for t in readers[signal]
        )

    def is_closed_but_for_a_signal(part: Transition) -> bool:
        """Whether someone would close a gate of the part and is kept from it by a completion that the part waits for.

        By the places alone such a yes does not stand, and the net of the protocol has nothing but places.
        """
        awaited = {gate.signal for gate in part.external if gate.wanted}
        kept = (t for s in awaited & readers.keys() for t in readers[s] if ExternalGate(s, wanted=False) in t.external)
        return any({*t.inputs} & {*part.permissive} or {*t.outputs} & {*part.inhibitive} for t in kept)

    def keeps(part: Transition) -> bool:
        alone = all(takers[p] == 1 for p in part.inputs) and all(putters[p] == 1 for p in part.outputs)
        inputs = set(part.inputs)
        lasting = all(
            # A timer falls by itself when its controller restarts, a completion never.
            subnet.signal(gate.signal).kind is SignalKind.COMPLETION
            and gate.wanted
            and senders.get(gate.signal, {""}) <= inputs  # of one that no place waits for, nothing is claimed
            for gate in part.external
        )
        return alone and lasting and not shows_what_it_clears(part) and not is_closed_but_for_a_signal(part)

    return keeps
