"""Contact excluded by invariants: a full output place where the inputs are there would be a token too many.

At a contact the inputs and permissive gate places of a transition hold tokens, and so does one of its output places
besides. A *draining* set of places (`firable.analysis.structure.cover`) with one token excludes that if it contains two
of these places: its tokens never get more, and one token is not in two places. One that contains the output place
contains an input too, since who puts a token into it takes one from it. So if every place that gets tokens is in such a
set, the net is contact-free: it is 1-safe as an ordinary net. Most are units, sets that lose no token either, as the
positions of a robot. This is how an engineer knows it, and what cells, protocols and processes are made of; it takes a
second for ten thousand places.

Where there is no draining set, an inequality is looked for that excludes the contact
(`firable.analysis.structure.inequalities`), which may be weighted, of either sign. The first contact that
nothing excludes ends the search, for then nothing is proved; that it is reachable is not said. The rejected
alternative, to list the minimal invariants first, waits for exponentially many of which a few are needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Clause, Equation, InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.structure.cover import UnitSearch
from firable.analysis.structure.inequalities import AtLeast, Refuter, kept_by_all, never_more
from firable.analysis.structure.invariants import columns
from firable.analysis.structure.ordinary import markable, ordinary
from firable.nets.net import Net
from firable.nets.verdict import Cost

METHOD = "sets of places with one token, which never gain one"


@dataclass(frozen=True, slots=True)
class ContactProof:
    """What excludes contact. `whole`: at every transition; `behaves`: at every one that does not contradict itself.

    `units` and `inequalities` are what was used (of a draining set that is no unit, that it never gains a token);
    `undecided` says of an unfinished proof where it ended.
    """

    whole: bool
    behaves: bool
    units: tuple[tuple[int, ...], ...]
    inequalities: tuple[AtLeast, ...]
    undecided: str = ""


def decide_contact_by_invariants(net: Net, limits: Limits) -> Finding:
    """Refute that a marking in contact is reachable; never says that one is.

    >>> from firable.nets.catalogue import catalogue_net
    >>> decide_contact_by_invariants(catalogue_net("one_robot"), Limits()).reachable
    False
    """
    start = perf_counter()
    proof = contact_proof(net, limits.deadline)
    cost = Cost(seconds=perf_counter() - start)
    if not proof.whole:
        return Finding(None, METHOD, bound=proof.undecided, cost=cost)
    if not kept_by_all(net, proof.inequalities):
        return Finding(reachable=False, method=METHOD, cost=cost)
    names = [place.name for place in net.places]
    of = ordinary(net)
    certificate = InductiveInvariant(
        tuple(Equation(tuple((names[p], 1) for p in unit), sum(p in of.marked for p in unit)) for unit in proof.units),
        tuple(Clause(empty=(names[p],)) for p in sorted(set(range(of.n_places)) - markable(of))),
        inequalities=tuple(inequality.named(net) for inequality in proof.inequalities),
    )
    return Finding(reachable=False, method=METHOD, cost=cost, certificate=certificate)


def contact_proof(net: Net, deadline: Deadline) -> ContactProof:
    """Exclude contact at one transition after the other, those first that can fire."""
    search = _Search(net, deadline)
    behaves = False
    # Those that contradict themselves never fire, but are in contact where the inputs and an output place are full.
    fires = set(search.of.transitions)
    for late in (False, True):
        for t, place in _contacts(net, fires, late=late):
            if not search.excluded(t, place):
                told = f"contact at {net.transitions[t].name} with {net.places[place].name} is not excluded"
                return search.proof(whole=False, behaves=behaves, undecided=told)
        behaves = True
    return search.proof(whole=True, behaves=True, undecided="")


def _contacts(net: Net, fires: set[int], *, late: bool) -> Iterator[tuple[int, int]]:
    for t, transition in enumerate(net.transitions):
        if (t in fires) is not late:
            yield from ((t, net.place_index[name]) for name in transition.outputs if name not in transition.inputs)


class _Search:
    """The draining sets found so far, by their places, and what they leave to inequalities."""

    def __init__(self, net: Net, deadline: Deadline) -> None:
        self.net, self.deadline, self.of = net, deadline, ordinary(net)
        self.may_be_marked = markable(self.of)
        # A unit is a draining set that fewer tries find, where there is one. Next time what was found goes first.
        self.draining_first = False
        self.drains: list[tuple[frozenset[int], int]] = []  # each with its tokens
        self.at: dict[int, list[int]] = {}
        self.used: dict[int, None] = {}
        self.tried: set[int] = set()
        self.inequalities: list[AtLeast] = []

    def excluded(self, t: int, place: int) -> bool:
        """Whether no reachable marking has the inputs and permissive gates of a transition full, and this place."""
        transition, index = self.net.transitions[t], self.net.place_index
        full = {index[name] for name in (*transition.inputs, *transition.permissive)} | {place}
        empty = {index[name] for name in transition.inhibitive}
        if full & empty or not full <= self.may_be_marked:
            return True
        if self._by_drain(full, full) or self._by_inequality(full, empty):
            return True
        if place not in self.tried and place not in self.at:
            self.tried.add(place)
            first = self.draining_first
            for draining, tries in ((first, 20), (not first, 200), (first, 500)):
                if self.deadline.over:
                    return False
                search = self._drain if draining else self._unit
                if drain := search.unit(place, tries, self.deadline):
                    self.draining_first = draining
                    self._add(drain)
                    if self._by_drain(full, {place}):
                        return True
                    break
        if self.deadline.over:
            return False
        found = self._refuter.inequality(full, empty, self.deadline)
        if found is not None:
            self.inequalities.append(found)
        return found is not None

    def _by_drain(self, full: set[int], places: set[int]) -> bool:
        for place in places:
            for k in self.at.get(place, ()):
                drain, tokens = self.drains[k]
                if len(full & drain) > tokens:
                    self.used[k] = None
                    return True
        return False

    def _by_inequality(self, full: set[int], empty: set[int]) -> bool:
        return any(
            sum(weight if p in full else max(0, weight) for p, weight in found.weights if p not in empty) < found.tokens
            for found in self.inequalities
        )

    def _add(self, drain: tuple[int, ...]) -> None:
        for place in drain:
            self.at.setdefault(place, []).append(len(self.drains))
        self.drains.append((frozenset(drain), len(self.of.marked.intersection(drain))))

    # What is as large as the net is made when it is first needed, so that the deadline is looked at between.
    @cached_property
    def _changes(self) -> list[dict[int, int]]:
        return columns(self.net)

    @cached_property
    def _unit(self) -> UnitSearch:
        return UnitSearch(self._changes, self.of.n_places, self.of.marked, 1)

    @cached_property
    def _drain(self) -> UnitSearch:
        return UnitSearch(self._changes, self.of.n_places, self.of.marked, 1, draining=True)

    @cached_property
    def _refuter(self) -> Refuter:
        # Only the transitions that can fire: the certificate says which places they are that stay empty.
        fires = (t for k, t in enumerate(self.of.transitions) if self.may_be_marked.issuperset(self.of.inputs[k]))
        return Refuter([self._changes[t] for t in fires], self.of.n_places, self.of.marked)

    def proof(self, *, whole: bool, behaves: bool, undecided: str) -> ContactProof:
        """What was found, with the units that were needed."""
        used = [(tuple(sorted(self.drains[k][0])), self.drains[k][1]) for k in self.used]
        lossless = self._drain.lossless([places for places, _ in used]) if used else []
        units = tuple(places for (places, _), unit in zip(used, lossless, strict=True) if unit)
        sums = (never_more(*drain) for drain, unit in zip(used, lossless, strict=True) if not unit)
        told = "the time was over" if undecided and self.deadline.over else undecided
        return ContactProof(whole, behaves, units, (*sums, *self.inequalities), told)
