"""Projections refined by counterexamples: few places at first, and more where a run is none in the net.

A goal that a projection does not exclude (`firable.analysis.projection.projected`) is met there by a run, and this run
is tried in the net: of each firing all transitions that look alike in the projection, in some markings side by side,
and where none of them may fire, after a few firings that change nothing in the projection. Where it comes to its end
the goal is reached. Else something stands in its way at a place that was dropped, and this is kept from then on. This
is localization (Kurshan 1994, "Computer-aided verification of coordinating processes"), refined by counterexamples
(Clarke, Grumberg, Jha, Lu and Veith 2000, "Counterexample-guided abstraction refinement").

What is kept is not the place but the *unit* through it, a state machine with one token
(`firable.analysis.structure.cover`). A single place of it says hardly anything, since a token could come to it from
anywhere, and n loose places have 2^n markings; a unit has as many as places. So what is explored is a few components of
a net of many. What one projection excludes, it excludes for all transitions at once (`Projections.dead`): where the
searches have to refute each of a hundred, all markings of two or three components do.

Once all places are kept the projection is the net, so the method ends on every net of which all markings can be held.
Everything but the deadline is counted in markings, so the same net gives the same answer.

The rejected alternative, places by their distance from the goal, keeps some of many units and none of them whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, reduce
from itertools import islice
from operator import or_
from time import perf_counter
from typing import Final

from firable.analysis._engine import BudgetExceeded, Stubborn
from firable.analysis.compiled import ANY, EMPTY, FULL, Node, Row, engine_limits, nodes_of, rows
from firable.analysis.evidence.certificate import Diagram, Labelling
from firable.analysis.goal import Finding, Limits
from firable.analysis.projection.projected import ROOM, Explored, Room, explored, projection
from firable.analysis.question import Known, no, yes
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.spaces.symbolic import SymbolicSpace, explore_symbolically
from firable.analysis.structure.cover import UnitSearch
from firable.analysis.structure.invariants import columns
from firable.nets.bits import bits
from firable.nets.formula import Firable, Formula, Or
from firable.nets.net import Marking, Masks, Net
from firable.nets.verdict import Cost
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

METHOD: Final = "projection"
_ABREAST_MAX: Final = 16
"""In how many markings side by side a run of a projection is tried."""
_TRIED_MAX: Final = 4
"""After how many of these is looked for what may fire in between."""
_BETWEEN_MAX: Final = 2**8
"""How many markings are searched for what must fire between two firings of the run."""
_EXPLORED_MAX: Final = 8
"""How many projections are held, and into how many parts the memory is shared out."""
_TRIES_MAX: Final = 100
"""How many choices a search for the unit through a place takes back."""
_NODES_MAX: Final = 100_000
"""How many nodes the diagram of a certificate has at most."""
_NO_TIME: Final = "the time was over"
_NO_ROOM: Final = "it has no room"


def decide_by_projection(net: Net, goal: Formula, limits: Limits, *, room: Room = ROOM) -> Finding:
    """Decide whether a marking that satisfies the goal is reachable, on as few places as it takes.

    `room` says how large a projection may be.

    Cost: that of all markings of each projection, the last of which is the net itself at worst.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import parse_formula
    >>> net = family_net("philosophers_either-50")
    >>> found = decide_by_projection(net, parse_formula("p3.eating and p4.eating"), Limits())
    >>> found.reachable, found.method, found.cost.markings
    (False, 'projection to 9 of 250 places', 12)
    """
    start, search = perf_counter(), Projections(net, limits, room)
    try:
        found = search.decide(nodes_of(net, goal))
    except BudgetExceeded as error:
        bound = f"kept {search.kept.bit_count():,} of {len(net.places):,} places: {error}"
        return Finding(None, METHOD, bound=bound, cost=Cost(seconds=perf_counter() - start))
    if isinstance(found, Explored):
        method = f"{METHOD} to {search.kept.bit_count():,} of {len(net.places):,} places"
        certificate = _certificate(net, found, limits)
        cost = Cost(found.space.n_markings, seconds=perf_counter() - start)
        return Finding(reachable=False, method=method, cost=cost, certificate=certificate)
    witnesses, firings = Witnesses(net, Discipline.INTERLEAVING), [(t,) for t in found]
    reached = witnesses.play(net.initial_marking, firings)
    if not evaluate(BOOL, net, goal, holds_in(reached)):
        raise WitnessError("a run of a projection ends in a marking that does not satisfy the goal")
    cost = Cost(seconds=perf_counter() - start)
    return Finding(reachable=True, method=METHOD, witness=witnesses.named(firings, reached), cost=cost)


def known_by_projection(net: Net, limits: Limits) -> Mapping[str, Known]:
    """The verdict `quasi-live`, where some transition is dead, or each fires on a run that was replayed.

    >>> from firable.nets.catalogue import catalogue_net
    >>> known_by_projection(catalogue_net("one_robot"), Limits())["quasi-live"].answer.holds
    True
    """
    search, witnesses = Projections(net, limits), Witnesses(net, Discipline.INTERLEAVING)
    open_ = set(range(len(net.transitions)))
    for t in range(len(net.transitions)):
        if search.dead or limits.deadline.over:
            break
        if t not in open_:
            continue
        try:
            found = search.firing(t)
        except BudgetExceeded:
            continue
        if isinstance(found, Explored):
            search.dead.add(t)
        else:
            witnesses.play(net.initial_marking, [(fired,) for fired in (*found, t)])
            open_ -= {*found, t}
    if search.dead:
        return {"quasi-live": Known(no(tuple(net.transitions[t].name for t in sorted(search.dead))), METHOD)}
    return {} if open_ else {"quasi-live": Known(yes(), METHOD)}


def _certificate(net: Net, excluding: Explored, limits: Limits) -> Labelling | None:
    """The markings of a projection with any tokens on the places that were dropped; None where they are too large.

    The dropped places are the lowest levels of the diagram, one node for each, with both of its parts the same.
    """
    space = excluding.space
    try:
        held = space if isinstance(space, SymbolicSpace) else explore_symbolically(excluding.of.small, limits)
        found = held.engine.nodes([held.reach], _NODES_MAX)
    except BudgetExceeded:
        return None
    if found is None:
        return None
    rows_of, roots = found
    small = excluding.of.small
    dropped = [place.name for place in net.places if place.name not in small.place_index]
    n = len(dropped)
    loose = [(level, level, level) for level in range(1, n + 1)]  # the first two numbers are the empty sets of markings

    def number(old: int) -> int:
        return old if old == 0 else old + n

    tight = [(level + n, number(low), number(high)) for level, low, high in rows_of]
    order = (*dropped, *(small.places[p].name for p in held.engine.order))
    return Labelling(Diagram(order, (*loose, *tight), tuple(map(number, roots))))


_Way = tuple[int, "_Way"] | None
"""What has fired, the last one first."""


class Projections:
    """Projections of one net, each explored once within the limits, and what goals they exclude.

    `dead` are the transitions that one of them has shown to be dead, and `markings` how many all of them have.
    """

    def __init__(self, net: Net, limits: Limits, room: Room = ROOM) -> None:
        self.net, self.limits, self.room = net, limits, room
        self.markings = 0
        self.dead = set[int]()
        self.kept = 0
        self._explored: dict[Marking, Explored] = {}
        self._too_large: dict[Marking, Room] = {}
        self._units: dict[int, list[Marking]] = {}
        self._masks: dict[int, Masks] = {}
        self._hidden_for: tuple[Marking, Sequence[int]] = (-1, ())

    def decide(self, goal: Sequence[Node]) -> tuple[int, ...] | Explored:
        """A firing sequence of the net into a goal, or the projection that excludes it.

        Raises `BudgetExceeded` where the limits come first; `kept` are the places of the last projection.
        """
        self.kept, run = 0, None
        while True:
            found = self._tried(run or (), goal)
            if isinstance(found, tuple):
                return found
            if run is not None and not found & ~self.kept:
                raise WitnessError("a run of a projection is none in the net, and nothing is lacking for it")
            self.kept |= found
            on_these = self._on(self.kept)
            if (run := on_these.run_into(goal)) is None:
                return on_these
            if self.limits.deadline.over:  # what is small is explored all the same
                raise BudgetExceeded(_NO_TIME)

    def firing(self, t: int) -> tuple[int, ...] | Explored:
        """The same for the goal that a transition may fire."""
        return self.decide(nodes_of(self.net, Firable(self.net.transitions[t].name)))

    def forget(self) -> None:
        """Hold no markings any more; what they have shown is kept."""
        self._explored.clear()

    def _on(self, kept: Marking) -> Explored:
        """The projection to these places, with all its markings."""
        if self._too_large.get(kept) == self.room:
            raise BudgetExceeded(_NO_ROOM)
        if kept not in self._explored:
            limits = replace(self.limits, memory_bytes=max(1, self.limits.memory_bytes // _EXPLORED_MAX))
            try:
                found = explored(projection(self.net, kept), limits, self.room)
            except BudgetExceeded:
                if not self.limits.deadline.over:
                    self._too_large[kept] = self.room
                self.markings += self.room.markings
                raise
            self.markings += found.space.n_markings
            self.dead.update(found.dead())
            while len(self._explored) >= _EXPLORED_MAX:
                del self._explored[next(iter(self._explored))]
            self._explored[kept] = found
        found = self._explored[kept]
        return replace(found, space=found.space.until(self.limits.deadline))

    def _tried(self, steps: Iterable[Sequence[int]], goal: Sequence[Node]) -> tuple[int, ...] | Marking:
        """The run of a projection as a firing sequence of the net into the goal, or the places that are lacking."""
        front: dict[Marking, _Way] = {self.net.initial_marking: None}
        for alike in steps:
            after, lacking = self._after(front, alike)
            if not after:
                firable = Or(tuple(Firable(self.net.transitions[t].name) for t in alike))
                after, _ = self._after(self._between(front, nodes_of(self.net, firable)), alike)
            if not after:
                return self._least(lacking)
            front = after
        lacking = []
        for marking, way in (front | self._between(front, goal)).items():
            if (blamed := self._blamed(goal, marking)) is None:
                return _in_order(way)
            lacking.append(blamed)
        return self._least(lacking)

    def _after(self, front: dict[Marking, _Way], alike: Sequence[int]) -> tuple[dict[Marking, _Way], list[Marking]]:
        """The markings after a firing of one of some transitions; where there is none, what is lacking for it."""
        after: dict[Marking, _Way] = {}
        lacking: list[Marking] = []
        for marking, way in front.items():
            for t in alike:
                of = self._masks_of(t)
                missing = (of.inputs | of.permissive) & ~marking | (of.outputs | of.inhibitive) & marking
                if not missing and len(after) < _ABREAST_MAX:
                    after.setdefault(marking & ~of.inputs | of.outputs, (t, way))
                elif missing and not after:
                    lacking += map(self._grown, bits(missing))
        return after, lacking

    def _between(self, front: Mapping[Marking, _Way], goal: Sequence[Node]) -> dict[Marking, _Way]:
        """A marking in which a goal holds, after firings that change no kept place; nothing where none was found.

        It is searched for with stubborn sets, after each of the first few markings.
        """
        hidden = self._hidden
        for marking, way in islice(front.items(), _TRIED_MAX):
            engine = Stubborn(len(self.net.places), [self._rows[t] for t in hidden], list(bits(marking)))
            search = engine.reach(
                list(goal),
                max_markings=_BETWEEN_MAX,
                max_memory_bytes=self.limits.memory_bytes,
                **engine_limits(self.limits.deadline),
            )
            if search.found is not None:
                for t in search.path_to(search.found):
                    way = hidden[t], way
                return {search.marking(search.found): way}
        return {}

    @property
    def _hidden(self) -> Sequence[int]:
        """The transitions that change no kept place."""
        if self._hidden_for[0] != self.kept:
            changing = {t for p in bits(self.kept) for t in (*self.net.consumers[p], *self.net.producers[p])}
            self._hidden_for = self.kept, [t for t in range(len(self.net.transitions)) if t not in changing]
        return self._hidden_for[1]

    @cached_property
    def _rows(self) -> list[Row]:
        return rows(self.net)[1]

    def _masks_of(self, t: int) -> Masks:
        if t not in self._masks:
            of, mask = self.net.transitions[t], self.net.marking
            self._masks[t] = Masks(mask(of.inputs), mask(of.outputs), mask(of.permissive), mask(of.inhibitive))
        return self._masks[t]

    def _blamed(self, goal: Sequence[Node], marking: Marking) -> Marking | None:
        """The places to be kept so that the goal is seen not to hold in a marking; None where it holds there.

        Of a conjunction one part that does not hold would do. Where there are places among these, all of them are kept:
        the goal asks for each, so most of them will be wanted.
        """
        found: list[Marking | None] = []
        for operator, operands in goal:
            if operator in (FULL, EMPTY):
                holds = bool(marking >> operands[0] & 1) is (operator == FULL)
                found.append(None if holds else self._grown(operands[0]))
                continue
            false = [part for of in operands if (part := found[of]) is not None]
            if operator == ANY and len(false) < len(operands):
                found.append(None)
            elif operator == ANY:
                found.append(_all_of(false))
            else:
                literals = [part for of in operands if goal[of][0] in (FULL, EMPTY) and (part := found[of]) is not None]
                found.append(_all_of(literals) if literals else self._least(false) if false else None)
        return found[-1]

    def _least(self, masks: Iterable[Marking]) -> Marking:
        """What adds the fewest places to those that are kept."""
        return min(masks, key=lambda mask: ((mask & ~self.kept).bit_count(), mask))

    def _grown(self, place: int) -> Marking:
        """The places to be kept for a place: of the units through it the one that adds least; else itself alone."""
        if place not in self._units:
            unit = self._search.unit(place, _TRIES_MAX, self.limits.deadline)
            if unit is None:
                raise BudgetExceeded(_NO_TIME)
            for p in (place, *unit):
                self._units.setdefault(p, [])
            for p in unit:
                self._units[p].append(_all_of(1 << q for q in unit))
        return self._least(self._units[place]) if self._units[place] else 1 << place

    @cached_property
    def _search(self) -> UnitSearch:
        marked = frozenset(bits(self.net.initial_marking))
        return UnitSearch(columns(self.net), len(self.net.places), marked, 1)


def _all_of(masks: Iterable[Marking]) -> Marking:
    return reduce(or_, masks, 0)


def _in_order(way: _Way) -> tuple[int, ...]:
    fired = []
    while way is not None:
        last, way = way
        fired.append(last)
    return tuple(reversed(fired))
