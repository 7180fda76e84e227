"""A net on some of its places, and all its markings there.

Places are dropped, with all that transitions need of them and do to them. Whatever fires in the net fires in the
*projection* too, or changes nothing there: the places that are kept are what they would be, and less is asked of the
others. So the markings of the projection are at least those of the net on these places, and with any tokens on the
other places they are a set of markings of the net that no firing leads out of.

A goal is read from above: in negation normal form, where what it asks of a dropped place counts as true. If it holds in
no marking of the projection it holds in none of the net. Interleaving only: of a maximal step it is not true that fewer
places allow more, since a rival may be gone that kept somebody out.

Transitions that look alike on these places are one, and what changes none of them is left out. In the nets of many
components that explode, few hundred transitions are left to explore, and mostly a few thousand markings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import ALL, ANY, FULL, Node
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import Budget, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.bits import bits
from firable.nets.diagnostics import InputError
from firable.nets.net import Marking, Net, Place, Transition
from firable.semantics.algebra import BooleanAlgebra
from firable.semantics.firing import Valuation
from firable.semantics.trace import Discipline


@dataclass(frozen=True, slots=True)
class Projection:
    """A net on the `kept` places: `members` are, for each transition of the `small` net, those that it stands for."""

    kept: Marking
    small: Net
    members: tuple[tuple[int, ...], ...]


def projection(net: Net, kept: Marking) -> Projection:
    """A net on some of its places, given as a mask; what contradicts itself in the net is left out.

    Cost: linear in the arcs of the transitions that change these places.

    >>> t, u = Transition("t", ("p", "r"), ("q",)), Transition("u", ("p",), ("q",))
    >>> net = Net("n", (Place("p", marked=True), Place("q"), Place("r")), (t, u, Transition("v", ("q",), ("r",))))
    >>> of = projection(net, 0b011)
    >>> [(t.name, t.inputs, t.outputs) for t in of.small.transitions], of.members
    ([('t', ('p',), ('q',)), ('v', ('q',), ())], ((0, 1), (2,)))
    """
    places = tuple(Place(net.places[p].name, marked=net.places[p].marked) for p in bits(kept))
    names = frozenset(place.name for place in places)
    alike: dict[tuple[tuple[str, ...], ...], list[int]] = {}
    for t in sorted({t for p in bits(kept) for t in (*net.consumers[p], *net.producers[p])}):
        of = net.transitions[t]
        if of.openable and {*of.inputs, *of.permissive}.isdisjoint((*of.outputs, *of.inhibitive)):
            inputs, outputs = names.intersection(of.inputs), names.intersection(of.outputs)
            gates = names.intersection(of.permissive) - inputs, names.intersection(of.inhibitive) - outputs
            alike.setdefault(tuple(tuple(sorted(part)) for part in (inputs, outputs, *gates)), []).append(t)
    transitions = tuple(
        Transition(net.transitions[members[0]].name, inputs, outputs, permissive, inhibitive)
        for (inputs, outputs, permissive, inhibitive), members in alike.items()
    )
    return Projection(kept, Net(net.name, places, transitions), tuple(map(tuple, alike.values())))


@dataclass(frozen=True, slots=True)
class Explored:
    """A projection, and all of its markings."""

    of: Projection
    space: StateSpace[Any]

    def run_into(self, goal: Sequence[Node]) -> list[tuple[int, ...]] | None:
        """A run to a marking where a goal of the net holds from above: for each firing what it stands for.

        None where there is none. Raises `BudgetExceeded`.
        """
        at = {p: i for i, p in enumerate(bits(self.of.kept))}
        met = self.space.where(lambda algebra, holds: from_above(goal, algebra, holds, at))
        if (witness := self.space.witness(met)) is None:
            return None
        index = self.of.small.transition_index
        return [self.of.members[index[name]] for (name,) in witness.firings]

    def dead(self) -> Iterator[int]:
        """The transitions of the net that change a kept place, and that fire in no marking of the projection."""
        for members, fired in zip(self.of.members, self.space.fired(), strict=True):
            if not fired:
                yield from members


@dataclass(frozen=True, slots=True)
class Room:
    """How many markings of a projection are held one by one, and how many bytes a diagram of more of them may take.

    With 0 bytes no diagram is tried.
    """

    markings: int
    diagram_bytes: int


ROOM: Final = Room(2**20, 2**28)
"""What a projection is given where nobody says otherwise."""


def explored(of: Projection, limits: Limits, room: Room = ROOM) -> Explored:
    """The markings of a projection, one by one where they are few, and else in a decision diagram.

    Raises `BudgetExceeded` where there is neither time nor room for them.
    """
    try:
        budget = Budget(room.markings, limits.memory_bytes)
        graph = explore(of.small, Discipline.INTERLEAVING, budget, deadline=limits.deadline)
    except InputError as error:  # there is no room for the net itself
        raise BudgetExceeded(error.diagnostics[0].message) from None
    if graph.complete:
        return Explored(of, graph)
    if not room.diagram_bytes:
        raise BudgetExceeded(graph.bound)
    limits = replace(limits, memory_bytes=min(limits.memory_bytes, room.diagram_bytes))
    return Explored(of, explore_symbolically(of.small, limits))


def from_above(goal: Sequence[Node], algebra: BooleanAlgebra[Any], holds: Valuation[Any], at: Mapping[int, int]) -> Any:
    """The value of a goal where what it asks of a dropped place is true; `at` gives the number of each kept place.

    >>> from firable.analysis.compiled import nodes_of
    >>> from firable.nets.formula import parse_formula
    >>> from firable.semantics.algebra import BOOL
    >>> goal = nodes_of(Net("n", (Place("p"), Place("q"))), parse_formula("p and not q"))
    >>> from_above(goal, BOOL, lambda place: True, {0: 0}), from_above(goal, BOOL, lambda place: True, {1: 0})
    (True, False)
    """
    values: list[Any] = []
    for operator, operands in goal:
        if operator == ALL:
            values.append(algebra.conjunction(values[of] for of in operands))
        elif operator == ANY:
            values.append(algebra.disjunction(values[of] for of in operands))
        elif operands[0] not in at:
            values.append(algebra.conjunction(()))
        else:
            held = holds(at[operands[0]])
            values.append(held if operator == FULL else algebra.negation(held))
    return values[-1]
