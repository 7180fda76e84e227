"""Is anything lost? Whatever the central net may fire next, the protocol can still fire next.

The relation "this configuration, and the central marking that it carries" is a branching bisimulation (van Glabbeek and
Weijland 1996) between the protocol, all steps hidden by which nothing fires, and the central net, if

- whatever fires is a firing of the central net: that is the sentence `follows`; and no hidden step changes the central
  marking, which is so by the arcs;
- from each configuration, for each transition that its central marking may fire, some hidden steps lead to one where it
  fires. That is what is decided here. The central marking does not change on the way, which makes it *branching*.

The relation is a function of the configuration, so no partition has to be refined, and closures by hidden steps decide
it, in a table or in a diagram. In the true protocol two arguments make it quick: all configurations lead *home*, to one
where nothing is asked, promised or on its way, which one closure shows of all central markings at once, since no hidden
step changes it; and the votes of parts that are free of promise are heard. From there the transition is asked for,
promised, heard and decided, a run that is written down and played by the reference player.
Where this does not succeed, a closure is made for each transition and central marking.

Under faults the same is asked with the faults hidden, of the configurations where faults have ceased: to cease is a
hidden step. Something is lost if no restart comes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, Final, NamedTuple

from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, IncompleteGraph, explore
from firable.analysis.spaces.space import StateSpace, WitnessError, Witnesses
from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import ASTRAY, at, central
from firable.decompose.protocol.faulty import GO_ON
from firable.decompose.protocol.parts import Part
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Holds, Not, Or
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

CENTRAL_MARKINGS_MAX: Final = 2_000


class Lost(NamedTuple):
    """A transition that the central net may fire, and a shortest run after which the protocol cannot fire it next."""

    transition: str
    witness: Witness


def central_markings(net: Net, limits: Limits) -> Mapping[Marking, tuple[int, ...]]:
    """The reachable markings of the central net, and what may fire in each; `IncompleteGraph` for too many."""
    try:
        graph = explore(net, budget=Budget(CENTRAL_MARKINGS_MAX, limits.memory_bytes), deadline=limits.deadline)
    except InputError as error:  # there is no room for the net itself
        raise IncompleteGraph(error.diagnostics[0].message) from None
    graph.require_complete()
    return {
        graph.marking(i): tuple(t for fired, _ in graph.successors(i) for t in fired) for i in range(graph.n_markings)
    }


def carrying(space: StateSpace[Any], net: Net, marking: Marking) -> Any:
    """The configurations in a protocol's space that carry a marking of the central net."""
    literals = (
        (Holds(central(place.name)) if marking >> p & 1 else Not(Holds(central(place.name))))
        for p, place in enumerate(net.places)
    )
    return space.satisfying(And(tuple(literals)))


def first_lost(protocol: ProtocolNet, space: StateSpace[Any], limits: Limits) -> Lost | None:
    """What is lost, if anything.

    Raises `IncompleteGraph` where the space, or that of the central net, is not whole, `BudgetExceeded` where time or
    memory ends, and `ValueError` of a protocol in which a hidden step changes the central marking.
    """
    space.require_complete()
    markings = central_markings(protocol.parts.net, limits)
    asked = _Completeness(protocol, space)
    found = [lost for marking, may_fire in markings.items() for lost in asked.lost_in(marking, may_fire)]
    return min(found, key=lambda lost: len(lost.witness.firings), default=None)


class _Completeness:
    """The closures of one state space."""

    def __init__(self, protocol: ProtocolNet, space: StateSpace[Any]) -> None:
        self.protocol, self.space = protocol, space
        self.net, self.central = protocol.net, protocol.parts.net
        if moving := _moving(protocol):
            raise ValueError(f"hidden steps change the central marking: {', '.join(moving)}")
        self.quiet = space.satisfying(protocol.quiet)
        outside = [Holds(ASTRAY), *([Holds(GO_ON)] if GO_ON in self.net.place_index else [])]
        self.asked = space.algebra.negation(space.satisfying(Or(tuple(outside))))
        self.player = Player(self.net)
        self.witnesses = Witnesses(self.net, Discipline.INTERLEAVING)

    @cached_property
    def astray(self) -> Any:
        """The configurations that are asked about, and do not lead home."""
        algebra = self.space.algebra
        home = algebra.conjunction([self.asked, self.quiet])
        return algebra.conjunction([self.asked, algebra.negation(self._leading_to(home, self.asked))])

    def lost_in(self, marking: Marking, may_fire: tuple[int, ...]) -> Iterator[Lost]:
        """What is lost in the configurations of one central marking."""
        if not may_fire:
            return
        algebra = self.space.algebra
        starts = all(map(self._starts_from_home(marking), may_fire))
        if starts and not self.space.count(self.astray):
            return
        inside = algebra.conjunction([carrying(self.space, self.central, marking), self.asked])
        if not self.space.count(inside):
            return
        if starts and not self.space.count(algebra.conjunction([inside, self.astray])):
            return
        for t in may_fire:
            name = self.central.transitions[t].name
            firing = algebra.disjunction(self.space.may_fire(i) for i in self.protocol.firing[name])
            targets = algebra.conjunction([inside, firing])
            rest = algebra.conjunction([inside, algebra.negation(self._leading_to(targets, inside))])
            witness = self.space.witness(rest, f"from here {name} cannot be the next to fire")
            if witness is not None:
                yield Lost(name, witness)

    def _leading_to(self, targets: Any, inside: Any) -> Any:
        return self.space.backward(targets, inside, self.protocol.hidden)

    def _starts_from_home(self, marking: Marking) -> Any:
        names = self.central.names(marking)
        start = self.net.initial_marking & ~self.net.marking(
            name for place in self.central.places for name in (place.name, central(place.name)) if place.marked
        )
        start |= self.net.marking(name for place in names for name in (place, central(place)))
        free = (part for its in self.protocol.parts.coordinated.values() for part in its if part.free)
        voting = [part for part in free if _is_firable(part, frozenset(names))]
        start |= self.net.marking(at(kind, part) for part in voting for kind in ("stands", "heard"))

        def starts(t: int) -> bool:
            """Whether the run that asks for the transition, and for nothing else, fires it from a quiet configuration.

            It touches no place of the faults, so it can be played wherever nobody is down.
            """
            run = way(self.protocol, self.central.transitions[t].name, voted=True)
            if run is None:
                return False
            try:
                self.witnesses.play(start, [(self.net.transition_index[name],) for name in run])
            except WitnessError:
                return False
            return True

        return starts


def way(protocol: ProtocolNet, t: str, *, voted: bool = False) -> tuple[str, ...] | None:
    """The steps by which a transition fires where nothing else is asked; None in the bare skeleton.

    Those by which parts free of promise vote, and are heard, may have been taken before; where they were, they are left
    out with `voted`.
    """
    its = protocol.parts.coordinated.get(t)
    if its is None:
        return (f"fire/{t}",)
    if not protocol.variant.acknowledged:
        return None
    steps = [f"ask/{t}"] if protocol.parts.promising(t) else []
    for part in its:
        at_it = f"{t}/{part.controller}"
        if not part.free:
            steps += [f"{step}/{at_it}" for step in ("send-request", "promise", "hear")]
        elif not voted:
            steps += [f"stand/{at_it}", f"stand/{at_it}/again", f"hear/{at_it}"]
    return (*steps, f"decide/{t}")


def _moving(protocol: ProtocolNet) -> list[str]:
    """The hidden steps that change the central marking; of no protocol that is built there are any."""
    carried = {central(place.name) for place in protocol.parts.net.places}
    hidden = [protocol.net.transitions[i] for i in protocol.hidden]
    return [t.name for t in hidden if not carried.isdisjoint((*t.inputs, *t.outputs))]


def _is_firable(part: Part, marking: frozenset[str]) -> bool:
    """Eq. (1) of a part."""
    return marking.issuperset((*part.inputs, *part.permissive)) and marking.isdisjoint(
        (*part.outputs, *part.inhibitive)
    )


__all__ = ["CENTRAL_MARKINGS_MAX", "IncompleteGraph", "Lost", "carrying", "central_markings", "first_lost", "way"]
