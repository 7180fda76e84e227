"""Votes: what the yes of a part rests on, and which transitions could take it back, by the arcs alone.

The yes of a part is Eq. (1) and (2) of it: some places of its controller are full (inputs, permissive gates), some are
empty (outputs, inhibitive gates), and its external gates are open. Another transition *falsifies* it by taking a token
from one of the full places, by putting one on one of the empty places, or by sending a command anew whose completion
the part waits for: entering a place clears its completion signal. Whatever else it does, the yes stands; that machines
and sensors close a gate is no firing, but O4. Gates of the other transition take no token, so reading never falsifies.
So the transitions that `touch` a yes are found at its places and at those of its completions, in time linear in
their arcs, and most of them are cleared at once:

- one that needs a place empty which the yes needs full, or the other way about, is never firable while the yes stands;
- one that wants a completion or a timer 0 which the yes wants 1 is never open then, as the transition of a time limit
  that is over (a sensor may drop and let it fire: O4);
- one that can never fire at all falsifies nothing;
- one that needs two places full, with the yes, of a *unit* (`firable.analysis.structure.cover`), of which one place
  holds a token at most, can never be firable then either.

A vote of which all are cleared is `settled`. What clears them is said to a solver, as one obligation for each such vote
and each unit in use (`firable.decompose.proofs.persistent`). So that whoever checks this finds the same units for each
vote without looking for any, the units are put in the order of their places in the net, and each transition is cleared
by the first one that does; those that are no vote's first are left out.

What is left is a question on markings (`firable.decompose.splitting.persistence`). Rejected: to take every transition
that shares a place for a falsifier, which accuses the producer of an input place; and to compare the parts of one
controller only, which overlooks nothing, since places have one owner, but finds the transitions by a second route.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.cover import UnitSearch
from firable.analysis.structure.invariants import columns
from firable.nets.decomposition import Coordinated, Decomposition, Part
from firable.nets.formula import And, Firable, Formula, Holds, Not, Or
from firable.nets.net import Net, SignalKind, Transition

FALSIFIERS_MAX: Final = 500
"""How many transitions that could take one yes back are looked at: a place with n consumers makes n^2 pairs."""


SECONDS: Final = 10.0
"""How long units are looked for where nobody says otherwise."""

Unit = tuple[str, ...]
"""Places of which one at most holds a token, in the order of the net."""


@dataclass(frozen=True, slots=True)
class Vote:
    """The yes of a part: the places it needs `full` and `empty`, and the transitions that could falsify it.

    `awaited` are the signals that it needs to be 1; those that are completions are cleared by sending their commands.

    `touching` are all that would falsify the yes if they fired, in the order of the net, `accused` those that the yes
    itself does not exclude, and `falsifiers` those that no unit excludes either. `units` are those that a settled vote
    needs. `others` counts the arcs of those that were not looked at because there are too many.
    """

    transition: str
    controller: str
    part: str
    full: frozenset[str]
    empty: frozenset[str]
    awaited: frozenset[str] = frozenset()
    touching: tuple[str, ...] = ()
    accused: tuple[str, ...] = ()
    falsifiers: tuple[str, ...] = ()
    others: int = 0
    units: tuple[Unit, ...] = ()

    @property
    def settled(self) -> bool:
        """Whether arcs and units alone show that no other transition takes the yes back."""
        return not self.falsifiers and not self.others

    @property
    def yes(self) -> tuple[Formula, ...]:
        """The literals of the yes, in the order of names."""
        return (*(Holds(place) for place in sorted(self.full)), *(Not(Holds(place)) for place in sorted(self.empty)))

    def goal(self, among: Iterable[str] | None = None) -> Formula:
        """The yes stands and one of the accused, or of these, is firable: reachable iff one of them falsifies it."""
        return And((*self.yes, Or(tuple(Firable(name) for name in (self.accused if among is None else among)))))


def votes(decomposition: Decomposition, deadline: Deadline = NEVER) -> tuple[Vote, ...]:
    """The votes on every transition that the coordinator decides, in the order of the table.

    Of a decomposition that was edited, parts that its subnets do not have are left out; others must prove them missing.
    Cost: linear in the pairs of a part and an arc at its places, at most `FALSIFIERS_MAX` for each part.
    """
    found = list(_touched(decomposition))
    return tuple(_cleared(decomposition, found, deadline))


def units_in_use(net: Net, cast: Iterable[Vote]) -> tuple[Unit, ...]:
    """The units that these votes need, in the order of their places in the net."""
    return _in_order(net, {unit for vote in cast for unit in vote.units})


def _in_order(net: Net, units: Collection[Unit]) -> tuple[Unit, ...]:
    return tuple(sorted(units, key=lambda unit: [net.place_index[place] for place in unit]))


def needs(transition: Transition) -> tuple[frozenset[str], frozenset[str]]:
    """The places that a transition, or a part, needs full and empty (Eq. 1)."""
    full = frozenset((*transition.inputs, *transition.permissive))
    return full, frozenset((*transition.outputs, *transition.inhibitive))


def clears(net: Net, transition: Transition) -> frozenset[str]:
    """The completions and timers that a firing clears, as it sends their commands, and finds at 1 or may find so."""
    sent = {signal for place in transition.outputs for signal in net.place(place).cleared}
    bare = {gate.signal for gate in transition.external if not gate.wanted}
    return frozenset(sent - bare)


def _coordinated(decomposition: Decomposition) -> Iterator[tuple[Coordinated, Part, Transition]]:
    """Each row with each of its parts, as their subnets have them."""
    parts = {(subnet.name, part.name): part for subnet in decomposition.subnets for part in subnet.transitions}
    for row in decomposition.coordinated:
        for part in row.parts if row.name in decomposition.net.transition_index else ():
            if (own := parts.get((part.controller, part.name))) is not None:
                yield row, part, own


def _touched(decomposition: Decomposition) -> Iterator[Vote]:
    """The votes as the arcs have them: no transition is cleared by a unit yet."""
    net = decomposition.net
    senders: dict[str, list[int]] = {}
    for i, place in enumerate(net.places):
        for signal in place.cleared:
            senders.setdefault(signal, []).append(i)
    required = [needs(transition) for transition in net.transitions]
    levels = {signal.name for signal in net.signals if signal.kind is not SignalKind.SENSOR}
    bare = [
        {gate.signal for gate in transition.external if not gate.wanted and gate.signal in levels}
        for transition in net.transitions
    ]
    fires = [not full & empty and t.openable for t, (full, empty) in zip(net.transitions, required, strict=True)]
    for row, part, own_part in _coordinated(decomposition):
        full, empty = needs(own_part)
        awaited = frozenset(gate.signal for gate in own_part.external if gate.wanted)
        vote = Vote(row.name, part.controller, part.name, full, empty, awaited)
        at = [
            *(net.consumers[net.place_index[p]] for p in full if p in net.place_index),
            *(net.producers[net.place_index[p]] for p in empty if p in net.place_index),
        ]
        again = [net.producers[p] for signal in awaited for p in senders.get(signal, ())]
        if (n := sum(map(len, (*at, *again)))) > FALSIFIERS_MAX:
            yield replace(vote, others=n)
            continue
        found = {u for some in at for u in some}
        found |= {u for some in again for u in some if not awaited.isdisjoint(clears(net, net.transitions[u]))}
        touching = sorted(found - {net.transition_index[row.name]})
        accused = tuple(
            net.transitions[u].name
            for u in touching
            if fires[u]
            and awaited.isdisjoint(bare[u])
            and full.isdisjoint(empty)  # else there is no yes
            and full.isdisjoint(required[u][1])
            and empty.isdisjoint(required[u][0])
        )
        yield replace(vote, touching=tuple(net.transitions[u].name for u in touching), accused=accused)


def _cleared(decomposition: Decomposition, found: Sequence[Vote], deadline: Deadline) -> Iterator[Vote]:
    """The votes with the falsifiers that no unit clears, or with the units that clear them all."""
    net = decomposition.net
    full_of = {t.name: needs(t)[0] for t in net.transitions}
    units = _in_order(net, set(_looked_for(decomposition, found, full_of, deadline)))
    at: dict[str, list[int]] = {}
    for k, unit in enumerate(units):
        for place in unit:
            at.setdefault(place, []).append(k)
    for vote in found:
        by: dict[str, int | None] = {}
        for name in vote.accused:
            met = Counter(k for place in vote.full | full_of[name] for k in at.get(place, ()))
            by[name] = min((k for k, n in met.items() if n > 1), default=None)
        left = tuple(name for name, k in by.items() if k is None)
        used = () if left else tuple(units[k] for k in sorted({k for k in by.values() if k is not None}))
        yield replace(vote, falsifiers=left, units=used)


def _looked_for(
    decomposition: Decomposition, found: Sequence[Vote], full_of: Mapping[str, frozenset[str]], deadline: Deadline
) -> Iterator[Unit]:
    """The units that clear a transition which some vote accuses.

    They are looked for through the places in question, first within the subnet of the controller, since what a
    machine is doing now is mostly one token that goes round in its own controller, then in the whole net.
    """
    subnets = {subnet.name: subnet for subnet in decomposition.subnets}
    units = {name: _Units(subnet, decomposition.net, deadline) for name, subnet in subnets.items()}
    whole = _Units(decomposition.net, decomposition.net, deadline)
    for vote in found:
        left = list(vote.accused)
        for within in (units[vote.controller], whole):
            for name in list(left):
                if (unit := within.excluding(vote.full, vote.full | full_of[name])) is not None:
                    yield unit
                    left.remove(name)


class _Units:
    """The units of a net, or of the places of one that a subnet has, found place by place as they are asked for."""

    def __init__(self, net: Net, whole: Net, deadline: Deadline) -> None:
        self.net, self.whole, self.deadline = net, whole, deadline
        self.search: UnitSearch | None = None
        self.tried: set[str] = set()
        self.of_place: dict[str, list[tuple[frozenset[str], Unit]]] = {}

    def excluding(self, through: Iterable[str], full: frozenset[str]) -> Unit | None:
        """A unit through one of some places by which not all the places can be full; None where none was found."""
        for place in sorted(through):
            self._look(place)
            for places, unit in self.of_place.get(place, ()):
                if len(places & full) > 1:
                    return unit
        return None

    def _look(self, place: str) -> None:
        if place in self.tried or place not in self.net.place_index or self.deadline.over:
            return
        self.tried.add(place)
        if self.search is None:
            marked = frozenset(i for i, p in enumerate(self.net.places) if p.marked)
            self.search = UnitSearch(columns(self.net), len(self.net.places), marked, 1)
        found = self.search.unit(self.net.place_index[place], deadline=self.deadline) or ()
        names = frozenset(self.net.places[p].name for p in found)
        index = self.whole.place_index
        if names <= index.keys():  # else the subnet was edited
            unit = tuple(sorted(names, key=index.__getitem__))
            for name in names:
                self.of_place.setdefault(name, []).append((names, unit))
