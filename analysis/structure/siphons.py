"""Siphons and traps, and what they say about deadlock.

A *siphon* is a set of places into which no transition puts a token without taking one from it: once empty, it stays
empty. A *trap* is its mirror: no transition takes a token from it without putting one back: once marked, it stays
marked. In a deadlock of an ordinary net the empty places are a siphon, so if every minimal siphon contains a trap
that is marked in M0 no deadlock is reachable (Commoner 1972; Hack 1972). This proves deadlock-freeness without
exploring anything.

The minimal siphons are found by z3: a formula says "these places are a non-empty siphon and contain none found before";
each model is shrunk, place by place, to a minimal one, and excluded with all that contain it. When the formula is
unsatisfiable, all are found. Their number can be exponential, so it is bounded, and there may be a deadline for all
questions together; short of the end the list is said to be incomplete. The rejected alternative is the branching search
of Cordone and others (2005), faster on large nets and three times the code.

For the net of this toolkit the argument has premises. The firing rule also forbids firings: internal gates, contact,
a signal wanted both 1 and 0, self-loops. In the markings where one of these holds a transition back, the empty places
need not be a siphon. So the claim is made only for a net without internal gates and self-loops, whose transitions are
all openable, and which is contact-free; external gates are free, as everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import z3

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.induction.smt import SEED
from firable.nets.net import Marking, Net

SIPHONS_MAX: Final = 2_000


@dataclass(frozen=True, slots=True)
class PlaceSets:
    """Minimal siphons or traps, as the names of their places in the order of the net; all of them if `complete`."""

    minimal: tuple[tuple[str, ...], ...]
    complete: bool


@dataclass(frozen=True, slots=True)
class DeadlockTrap:
    """The deadlock-trap property: does every minimal siphon contain a trap that is marked in M0?

    `siphons` are the minimal siphons, not `complete` where not all were found or looked into; `without_marked_trap` are
    those that refute the property. `premises` says
    what is missing for a conclusion on deadlock; the property alone concludes nothing about it.
    """

    siphons: PlaceSets
    without_marked_trap: tuple[tuple[str, ...], ...]
    premises: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether every siphon is known and contains a marked trap."""
        return self.siphons.complete and not self.without_marked_trap

    @property
    def excludes_deadlock(self) -> bool:
        """Whether the net is thereby proved free of deadlock."""
        return self.holds and not self.premises


def minimal_siphons(net: Net, *, most: int = SIPHONS_MAX, deadline: Deadline = NEVER) -> PlaceSets:
    """The minimal non-empty siphons.

    >>> from firable.nets.net import Net, Place, Transition
    >>> net = Net("n", (Place("p", marked=True), Place("q")),
    ...           (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))))
    >>> minimal_siphons(net).minimal
    (('p', 'q'),)
    """
    return _minimal_sets(net, _siphon_rules(net), most, deadline)


def minimal_traps(net: Net, *, most: int = SIPHONS_MAX, deadline: Deadline = NEVER) -> PlaceSets:
    """The minimal non-empty traps."""
    return _minimal_sets(net, _trap_rules(net), most, deadline)


def largest_trap(net: Net, places: Marking) -> Marking:
    """The largest trap within a set of places, given and returned as bit masks."""
    return _largest(places, _trap_rules(net))


def largest_siphon(net: Net, places: Marking) -> Marking:
    """The largest siphon within a set of places, given and returned as bit masks.

    Within the empty places of a deadlock it is what ran empty.
    """
    return _largest(places, _siphon_rules(net))


def deadlock_trap(
    net: Net, *, contact_free: bool | None = None, most: int = SIPHONS_MAX, deadline: Deadline = NEVER
) -> DeadlockTrap:
    """Decide the deadlock-trap property; `contact_free` is what is known of that verdict (None: nothing)."""
    siphons = minimal_siphons(net, most=most, deadline=deadline)
    bare = []
    for siphon in siphons.minimal:
        if deadline.over:
            siphons = PlaceSets(siphons.minimal, complete=False)
            break
        if not largest_trap(net, net.marking(siphon)) & net.initial_marking:
            bare.append(siphon)
    return DeadlockTrap(siphons, tuple(bare), tuple(_missing_premises(net, contact_free)))


def _missing_premises(net: Net, contact_free: bool | None) -> Iterator[str]:
    if not net.transitions:
        yield "it has no transitions, so that every marking is a deadlock"
    if any(t.permissive or t.inhibitive for t in net.transitions):
        yield "internal gates may hold transitions back while their inputs are marked"
    if any(t.self_loops for t in net.transitions):
        yield "a transition with a self-loop never fires"
    if not all(t.openable for t in net.transitions):
        yield "a transition wants a signal both 1 and 0 and never fires"
    if not contact_free:
        yield "full output places may hold transitions back: the net is not known to be contact-free"


Rule = tuple[Marking, Marking]
"""(If one of these places is in the set, one of those must be)."""


def _siphon_rules(net: Net) -> tuple[Rule, ...]:
    return tuple((masks.outputs, masks.inputs) for masks in net.masks if masks.outputs)


def _trap_rules(net: Net) -> tuple[Rule, ...]:
    return tuple((masks.inputs, masks.outputs) for masks in net.masks if masks.inputs)


def _largest(places: Marking, rules: tuple[Rule, ...]) -> Marking:
    """The largest subset that satisfies the rules: their solutions are closed under union, so it is unique."""
    changed = True
    while changed:
        changed = False
        for condition, needed in rules:
            if places & condition and not places & needed:
                places &= ~condition
                changed = True
    return places


def _minimal_sets(net: Net, rules: tuple[Rule, ...], most: int, deadline: Deadline) -> PlaceSets:
    """Raises `KeyboardInterrupt` where the user ends the solver."""
    chosen = [z3.Bool(f"p{i}") for i in range(len(net.places))]
    solver = z3.Solver()
    solver.set("random_seed", SEED)
    solver.add(z3.Or(*chosen))
    for condition, needed in rules:
        alternatives = z3.Or(*(chosen[i] for i in _bits(needed)))
        for i in _bits(condition):
            solver.add(z3.Implies(chosen[i], alternatives))
    found: list[Marking] = []
    answer = z3.unknown
    while not deadline.over:
        answer = _answer(solver, deadline)
        if answer != z3.sat or len(found) == most:
            break
        model = solver.model()
        places = sum(1 << i for i, variable in enumerate(chosen) if z3.is_true(model[variable]))
        smallest = _shrunk(places, lambda inner: _largest(inner, rules))
        found.append(smallest)
        solver.add(z3.Or(*(z3.Not(chosen[i]) for i in _bits(smallest))))
    names = sorted((tuple(_bits(places)) for places in found), key=lambda bits: (len(bits), bits))
    return PlaceSets(tuple(tuple(net.places[i].name for i in bits) for bits in names), answer == z3.unsat)


def _answer(solver: z3.Solver, deadline: Deadline) -> z3.CheckSatResult:
    solver.set("timeout", deadline.left_milliseconds)
    answer = solver.check()
    # z3 takes the signal of Ctrl-C for itself and calls it an answer.
    if answer == z3.unknown and "interrupted" in solver.reason_unknown():
        raise KeyboardInterrupt
    return answer


def _shrunk(places: Marking, largest_within: Callable[[Marking], Marking]) -> Marking:
    """A minimal non-empty solution within a solution: drop a place, keep what is left of it, until nothing is left."""
    for i in _bits(places):
        if places >> i & 1 and (smaller := largest_within(places & ~(1 << i))):
            places = smaller
    return places


def _bits(mask: int) -> Iterator[int]:
    return (i for i in range(mask.bit_length()) if mask >> i & 1)
