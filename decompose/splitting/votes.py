"""Votes: what the yes of a part rests on, and which transitions could take it back, by the arcs alone.

The yes of a part is Eq. (1) and (2) of it: some places of its controller are full (inputs, permissive gates), some are
empty (outputs, inhibitive gates), and its external gates are open. Another transition *falsifies* it by taking a token
from one of the full places, by putting one on one of the empty places, or by sending a command anew whose completion
the part waits for: entering a place clears its completion signal. Whatever else it does, the yes stands; that machines
and sensors close a gate is no firing, but O4. Gates of the other transition take no token, so reading never falsifies.
So the transitions that could falsify a yes are found at its places and at those of its completions, in time linear in
their arcs, and most of them are cleared at once:

- one that needs a place empty which the yes needs full, or the other way about, is never firable while the yes stands;
- one that wants a completion or a timer 0 which the yes wants 1 is never open then, as the transition of a time limit
  that is over (a sensor may drop and let it fire: O4);
- one that needs two places full, with the yes, of a *unit* (`firable.analysis.structure.cover`) that holds one token
  can never be firable then either, and the unit is an invariant that a checker multiplies out;
- one that can never fire at all falsifies nothing.

What is left is a question on markings (`firable.decompose.splitting.persistence`). Rejected: to take every transition
that shares a place for a falsifier, which accuses the producer of an input place; and to compare the parts of one
controller only, which overlooks nothing, since places have one owner, but finds the transitions by a second route.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Equation
from firable.analysis.structure.cover import UnitSearch
from firable.analysis.structure.invariants import columns
from firable.nets.decomposition import Decomposition
from firable.nets.formula import And, Firable, Formula, Holds, Not, Or
from firable.nets.net import Net, SignalKind, Transition

FALSIFIERS_MAX: Final = 500
"""How many transitions that could take one yes back are looked at: a place with n consumers makes n^2 pairs."""


@dataclass(frozen=True, slots=True)
class Vote:
    """The yes of a part: the places it needs `full` and `empty`, and the transitions that could falsify it.

    `awaited` are the signals that it needs to be 1; those that are completions are cleared by sending their commands.

    `others` counts those that were not looked at because there are too many. `units` are the invariants, each with
    one token at most, that clear transitions which the arcs accuse: with them, and the rest of `accused`, nothing else
    can falsify the yes. `accused` are all that are not cleared by the yes itself.
    """

    transition: str
    controller: str
    part: str
    full: frozenset[str]
    empty: frozenset[str]
    accused: tuple[str, ...]
    falsifiers: tuple[str, ...]
    others: int = 0
    units: tuple[Equation, ...] = ()
    awaited: frozenset[str] = frozenset()

    @property
    def yes(self) -> tuple[Formula, ...]:
        """The literals of the yes, in the order of names."""
        return (*(Holds(place) for place in sorted(self.full)), *(Not(Holds(place)) for place in sorted(self.empty)))

    def goal(self, among: Iterable[str] | None = None) -> Formula:
        """The yes stands and one of the accused, or of these, is firable: reachable iff one of them falsifies it."""
        return And((*self.yes, Or(tuple(Firable(name) for name in (self.accused if among is None else among)))))


def votes(decomposition: Decomposition, deadline: Deadline = NEVER) -> tuple[Vote, ...]:
    """The votes on every transition that the coordinator decides, in the order of the table.

    Cost: linear in the pairs of a part and an arc at its places, at most `FALSIFIERS_MAX` for each part.
    """
    found = list(_accused(decomposition))
    return tuple(_cleared(decomposition, found, deadline))


def needs(transition: Transition) -> tuple[frozenset[str], frozenset[str]]:
    """The places that a transition, or a part, needs full and empty (Eq. 1)."""
    full = frozenset((*transition.inputs, *transition.permissive))
    return full, frozenset((*transition.outputs, *transition.inhibitive))


def clears(net: Net, transition: Transition) -> frozenset[str]:
    """The completions and timers that a firing clears, as it sends their commands, and finds at 1 or may find so."""
    sent = {signal for place in transition.outputs for signal in net.place(place).cleared}
    bare = {gate.signal for gate in transition.external if not gate.wanted}
    return frozenset(sent - bare)


def _accused(decomposition: Decomposition) -> Iterator[Vote]:
    net = decomposition.net
    subnets = {subnet.name: subnet for subnet in decomposition.subnets}
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
    for row in decomposition.coordinated:
        own = net.transition_index[row.name]
        for part in row.parts:
            own_part = subnets[part.controller].transition(part.name)
            full, empty = needs(own_part)
            awaited = frozenset(gate.signal for gate in own_part.external if gate.wanted)
            vote = Vote(row.name, part.controller, part.name, full, empty, (), (), awaited=awaited)
            if full & empty:  # a self-loop: there is no yes
                yield vote
                continue
            at = [
                *(net.consumers[net.place_index[p]] for p in full),
                *(net.producers[net.place_index[p]] for p in empty),
            ]
            again = [net.producers[p] for signal in awaited for p in senders.get(signal, ())]
            if (n := sum(map(len, (*at, *again)))) > FALSIFIERS_MAX + len(at):
                yield replace(vote, others=n)
                continue
            found = {u for some in at for u in some}
            found |= {u for some in again for u in some if not awaited.isdisjoint(clears(net, net.transitions[u]))}
            touching = sorted(u for u in found if u != own and fires[u] and awaited.isdisjoint(bare[u]))
            accused = tuple(
                net.transitions[u].name
                for u in touching
                if full.isdisjoint(required[u][1]) and empty.isdisjoint(required[u][0])
            )
            yield replace(vote, accused=accused, falsifiers=accused)


def _cleared(decomposition: Decomposition, found: Sequence[Vote], deadline: Deadline) -> Iterator[Vote]:
    """The votes without the falsifiers that a unit clears.

    Units are looked for through the places in question, first within the subnet of the controller, since what a
    machine is doing now is mostly one token that goes round in its own controller, then in the whole net.
    """
    subnets = {subnet.name: subnet for subnet in decomposition.subnets}
    units = {name: _Units(subnet, deadline) for name, subnet in subnets.items()}
    whole = _Units(decomposition.net, deadline)
    full_of = {t.name: needs(t)[0] for t in decomposition.net.transitions}
    for vote in found:
        left, used = list(vote.falsifiers), dict[Equation, None]()
        for within in (units[vote.controller], whole):
            for name in list(left):
                if (equation := within.excluding(vote.full, vote.full | full_of[name])) is not None:
                    used[equation] = None
                    left.remove(name)
        yield replace(vote, falsifiers=tuple(left), units=tuple(used))


class _Units:
    """The units of a net with at most one token, found place by place as they are asked for."""

    def __init__(self, net: Net, deadline: Deadline) -> None:
        self.net, self.deadline = net, deadline
        self.search: UnitSearch | None = None
        self.tried: set[str] = set()
        self.of_place: dict[str, list[tuple[frozenset[str], Equation]]] = {}

    def excluding(self, through: Iterable[str], full: frozenset[str]) -> Equation | None:
        """A unit through one of some places by which not all the places can be full; None where none was found."""
        for place in sorted(through):
            self._look(place)
            for places, equation in self.of_place.get(place, ()):
                if len(places & full) > equation.tokens:
                    return equation
        return None

    def _look(self, place: str) -> None:
        if place in self.tried or place not in self.net.place_index or self.deadline.over:
            return
        self.tried.add(place)
        if self.search is None:
            marked = frozenset(i for i, p in enumerate(self.net.places) if p.marked)
            self.search = UnitSearch(columns(self.net), len(self.net.places), marked, 1)
        found = self.search.unit(self.net.place_index[place], deadline=self.deadline) or ()
        names = [self.net.places[p].name for p in found]
        equation = Equation(tuple((name, 1) for name in names), sum(self.net.places[p].marked for p in found))
        for name in names:
            self.of_place.setdefault(name, []).append((frozenset(names), equation))
