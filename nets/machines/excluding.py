"""What cannot be ready while a machine is at a command, nor afterwards until its controller is told that it is done.

Of a signal that changes as a command is sent, or as it is done, nobody needs to be told late who could not go by its
old value in between. Here that is read off the net: the token that sent the command stays until its completion is told,
and what goes by the old value would need a token that is never there together with that one.

Two places never hold a token together where both are among places with one token in all: M0 has one there, and each
transition takes as many of them as it puts, one or none (a state machine component; Murata, Petri Nets, 1989, V.C).
Such places are looked for from the two, a place more for each transition that does not balance. Where the search is too
long nothing is known, which costs markings and no verdict.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.nets.machines.laws import Laws
from firable.nets.net import ExternalGate, Marking, Net, Place, Transition

STEPS_MAX: Final = 1000
"""After so many sets of places a search for one with a single token gives up."""


def with_one_token(net: Net, one: str, other: str) -> frozenset[str] | None:
    """Places with one token in all in every reachable marking, two given ones among them; None where none are found.

    >>> from firable.nets.catalogue import catalogue_net
    >>> sorted(with_one_token(catalogue_net("one_robot"), "conveyor.cv1", "conveyor.cv1_run"))
    ['conveyor.cv1', 'conveyor.cv1_run', 'conveyor.cv1_wait']
    """
    open_ = [net.marking((one, other))]
    seen = set(open_)
    while open_ and len(seen) <= STEPS_MAX:
        places = open_.pop()
        if (more := _balancing(net, places)) is None:
            continue
        if not more and (places & net.initial_marking).bit_count() == 1:
            return frozenset(net.names(places))
        new = {places | place for place in more} - seen
        seen |= new
        open_ += sorted(new)
    return None


def _balancing(net: Net, places: Marking) -> list[Marking] | None:
    """The places of which one has to come to some for a transition to balance, by the first that does not; none where
    all do, None where one never will."""
    if (places & net.initial_marking).bit_count() > 1:
        return None
    wanting = 0
    for masks in net.masks:
        takes, puts = (masks.inputs & places).bit_count(), (masks.outputs & places).bit_count()
        if takes > 1 or puts > 1:
            return None
        if takes != puts and not wanting:
            wanting = masks.outputs if takes else masks.inputs
            if not wanting:
                return None
    return [1 << i for i in range(wanting.bit_length()) if wanting >> i & 1]


@dataclass(frozen=True)
class Excluding:
    """What the places that send commands exclude in the net of some laws."""

    laws: Laws

    @cached_property
    def announced(self) -> frozenset[str]:
        """The places whose token stays until its controller is told that the machine is done.

        All that takes it waits for the completion, which is that of commands of one machine alone.
        """
        net = self.laws.net
        found = set[str]()
        for place in self.laws.commanding:
            if place.completion is None:
                continue
            those = (other for other in net.places if other.completion == place.completion)
            machines = {other.command and other.command.machine for other in those}
            takers = (t for t in net.transitions if place.name in t.inputs)
            if len(machines) == 1 and all(ExternalGate(place.completion) in t.external for t in takers):
                found.add(place.name)
        return frozenset(found)

    def excludes(self, place: Place, signal: str, *, value: bool) -> bool:
        """Whether no part of a transition that wants a signal to be `value` can be ready from the moment at which the
        command of a place is sent until its controller is told that it is done."""
        if place.name not in self.announced:
            return False
        return all(self._keeps_back(place, t, signal) for t in self._wanting(signal, value=value))

    def _wanting(self, signal: str, *, value: bool) -> Iterator[Transition]:
        gate = ExternalGate(signal, value)
        return (t for t in self.laws.net.transitions if gate in t.external)

    def _keeps_back(self, place: Place, t: Transition, signal: str) -> bool:
        """Whether the part of a transition at the controller of a signal cannot be ready: other parts may be late."""
        net, owner = self.laws.net, self.laws.net.signal(signal).owner
        own = {other.name for other in net.places if other.owner == owner}
        if place.name in own:
            if place.name in {*t.outputs, *t.inhibitive}:
                return True
            if place.name in {*t.inputs, *t.permissive}:
                return ExternalGate(str(place.completion)) in t.external
        return any(self._never_with(place.name, name) for name in sorted(own & {*t.inputs, *t.permissive}))

    def _never_with(self, one: str, other: str) -> bool:
        if (one, other) not in self._apart:
            self._apart[one, other] = with_one_token(self.laws.net, one, other) is not None
        return self._apart[one, other]

    @cached_property
    def _apart(self) -> dict[tuple[str, str], bool]:
        return {}
