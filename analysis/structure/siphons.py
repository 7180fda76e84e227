"""Siphons and traps: sets of places that stay empty once empty, or marked once marked.

A *siphon* is a set of places into which no transition puts a token without taking one from it or reading one in it:
once empty, it stays empty. A *trap* is its mirror: no transition takes a token from it without putting one back or
leaving one that it reads: once marked, it stays marked. Both are about the ordinary net under the extended one
(`firable.analysis.structure.ordinary`), and as gates and contact only forbid firings, they hold of the extended net.

The largest siphon or trap within a set of places is unique, because unions of them are again such; it is found by
taking out what cannot be in it, in time linear in the arcs at the set.

The minimal siphons are found by z3: a formula says "these places are a non-empty siphon and contain none found before";
each model is shrunk, place by place, to a minimal one, and excluded with all that contain it. When the formula is
unsatisfiable, all are found. Their number can be exponential, so it is bounded, and there may be a deadline for all
questions together; short of the end the list is said to be incomplete. The rejected alternative is the branching search
of Cordone and others (2005), faster on large nets and three times the code; what needs all siphons on large nets is
better asked without a list (`firable.analysis.structure.commoner`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import z3

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.asking import answer, solver_of
from firable.analysis.structure.ordinary import Ordinary, ordinary
from firable.nets.bits import bits
from firable.nets.net import Marking, Net

SIPHONS_MAX: Final = 2_000


@dataclass(frozen=True, slots=True)
class PlaceSets:
    """Minimal siphons or traps, as the names of their places in the order of the net; all of them if `complete`."""

    minimal: tuple[tuple[str, ...], ...]
    complete: bool


@dataclass(frozen=True)
class Rules:
    """What a siphon or a trap must satisfy: if a place of `conditions[k]` is in it, then one of `needed[k]` is too."""

    n_places: int
    conditions: tuple[tuple[int, ...], ...]
    needed: tuple[tuple[int, ...], ...]

    @cached_property
    def by_condition(self) -> list[list[int]]:
        """For each place, the rules that it calls upon."""
        return self._at(self.conditions)

    @cached_property
    def by_needed(self) -> list[list[int]]:
        """For each place, the rules that it satisfies."""
        return self._at(self.needed)

    def _at(self, sides: tuple[tuple[int, ...], ...]) -> list[list[int]]:
        found: list[list[int]] = [[] for _ in range(self.n_places)]
        for k, places in enumerate(sides):
            for place in places:
                found[place].append(k)
        return found

    def largest(self, within: Iterable[int]) -> set[int]:
        """The largest set within the places that satisfies the rules. Cost: linear in the arcs at these places."""
        found = set(within)
        left: dict[int, int] = {}  # of each rule, how many places that satisfy it
        for place in found:
            for k in self.by_needed[place]:
                left[k] = left.get(k, 0) + 1
        todo = [place for place in found if any(k not in left for k in self.by_condition[place])]
        found.difference_update(todo)
        while todo:
            for k in self.by_needed[todo.pop()]:
                left[k] -= 1
                if not left[k]:
                    fallen = [place for place in self.conditions[k] if place in found]
                    found.difference_update(fallen)
                    todo += fallen
        return found

    def smallest(self, within: set[int], keep: frozenset[int] | None, deadline: Deadline) -> set[int] | None:
        """A minimal non-empty solution within a solution, or one minimal with a place of `keep`; None: out of time.

        Drop a place, keep what is left of it, until nothing is left.
        """
        for place in sorted(within):
            if deadline.over:
                return None
            if place in within:
                smaller = self.largest(within - {place})
                if smaller and (keep is None or smaller & keep):
                    within = smaller
        return within


def siphon_rules(of: Ordinary) -> Rules:
    """What a siphon of the net must satisfy."""
    return _rules(of.n_places, of.outputs, of.inputs)


def trap_rules(of: Ordinary) -> Rules:
    """What a trap of the net must satisfy."""
    return _rules(of.n_places, of.inputs, of.outputs)


def _rules(n_places: int, conditions: Iterable[tuple[int, ...]], needed: Iterable[tuple[int, ...]]) -> Rules:
    # A place that is on both sides, a read, satisfies the rule that it calls upon.
    pairs = {
        (tuple(place for place in condition if place not in satisfied), satisfied)
        for condition, satisfied in zip(conditions, needed, strict=True)
    }
    kept = sorted(pair for pair in pairs if pair[0])
    return Rules(n_places, tuple(pair[0] for pair in kept), tuple(pair[1] for pair in kept))


def minimal_siphons(net: Net, *, most: int = SIPHONS_MAX, deadline: Deadline = NEVER) -> PlaceSets:
    """The minimal non-empty siphons.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")),
    ...           (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))))
    >>> minimal_siphons(net).minimal
    (('p', 'q'),)
    """
    return _minimal_sets(net, siphon_rules(ordinary(net)), most, deadline)


def minimal_traps(net: Net, *, most: int = SIPHONS_MAX, deadline: Deadline = NEVER) -> PlaceSets:
    """The minimal non-empty traps."""
    return _minimal_sets(net, trap_rules(ordinary(net)), most, deadline)


def largest_siphon(net: Net, places: Marking) -> Marking:
    """The largest siphon within a set of places, given and returned as bit masks.

    Within the empty places of a deadlock it is what ran empty.
    """
    return _mask(siphon_rules(ordinary(net)).largest(bits(places)))


class Question:
    """The formula "these places are a non-empty solution of the rules", to which more can be added."""

    def __init__(self, rules: Rules) -> None:
        self.context = z3.Context()
        self.solver = solver_of(self.context)
        self.chosen = [z3.Bool(f"p{i}", self.context) for i in range(rules.n_places)]
        # As text, which z3 reads ten times as fast as it is told terms.
        lines = [f"(declare-const p{i} Bool)" for i in range(rules.n_places)]
        for condition, needed in zip(rules.conditions, rules.needed, strict=True):
            alternatives = " ".join(f"p{i}" for i in needed)
            lines += [f"(assert (or (not p{i}) {alternatives}))" for i in condition]
        self.solver.from_string("\n".join(lines))
        self.solver.add(z3.Or([z3.Or([], self.context), *self.chosen]))

    def exclude(self, places: Iterable[int]) -> None:
        """Ask for no set that contains all these places."""
        self.solver.add(z3.Or([z3.Not(self.chosen[i]) for i in places]))

    def next(self, deadline: Deadline) -> tuple[z3.CheckSatResult, set[int]]:
        """What z3 says, and the set that it found."""
        found = answer(self.solver, deadline)
        if found != z3.sat:
            return found, set()
        model = self.solver.model()
        return found, {i for i, variable in enumerate(self.chosen) if z3.is_true(model[variable])}


def _minimal_sets(net: Net, rules: Rules, most: int, deadline: Deadline) -> PlaceSets:
    """Raises `KeyboardInterrupt` where the user ends the solver."""
    found: list[tuple[int, ...]] = []
    complete = False
    if not deadline.over:
        question = Question(rules)
        while True:
            said, places = question.next(deadline)
            complete = said == z3.unsat
            smallest = rules.smallest(places, None, deadline) if said == z3.sat and len(found) < most else None
            if smallest is None:
                break
            found.append(tuple(sorted(smallest)))
            question.exclude(smallest)
    found.sort(key=lambda places: (len(places), places))
    return PlaceSets(tuple(tuple(net.places[i].name for i in places) for places in found), complete)


def _mask(places: Iterable[int]) -> Marking:
    return sum(1 << i for i in places)
