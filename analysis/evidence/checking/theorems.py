"""Theorems as evidence: the premises are checked here, the theorems stand in the books.

A net of one of these classes is understood without a look at its markings, and may have more of them than anybody can
hold. What the checker reads off the arcs again: that no transition contradicts itself, that there are no inhibitive
gates, that the net is of the class. What it is given: an invariant that excludes contact (so that the net behaves as an
ordinary one and is 1-safe), and traps that are marked, of which every siphon contains one, or none of them. That no
siphon is without a marked trap is one question to a solver (`firable.analysis.evidence.checking.siphons`), instead of a
list of siphons, which may be exponential. Permissive gates are reads: the place counts as taken and put back.

- *Marked graph*, each place with one producer and one consumer, in which every circuit holds a token: live, reversible,
  so with home markings (Commoner, Holt, Even, Pnueli 1971; Genrich and Lautenbach 1973).
- *Extended free choice*, in which every siphon contains a marked trap: live, with home markings; reversible if no trap
  is empty in M0 (Commoner 1972, Hack 1972; Best and Voss 1984; Desel and Esparza 1995, theorems 4.21, 4.27, 8.11).
- *Asymmetric choice*, in which every siphon contains a marked trap: live (Murata 1989, theorem 12).

For deadlock alone no theorem is needed: marked traps are clauses of an inductive invariant that excludes it.
Interleaving only: in a step a token may be taken while it is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from itertools import pairwise
from typing import Final

from firable.analysis.evidence.certificate import Theorem, TheoremName
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.refusal import refuse
from firable.nets.formula import Start
from firable.nets.net import Net
from firable.semantics.trace import Discipline

_SHOWN: Final = {
    TheoremName.MARKED_GRAPH: {ClaimKind.LIVE, ClaimKind.HOME, ClaimKind.ALWAYS_POSSIBLE},
    TheoremName.FREE_CHOICE: {ClaimKind.LIVE, ClaimKind.HOME, ClaimKind.ALWAYS_POSSIBLE},
    TheoremName.ASYMMETRIC_CHOICE: {ClaimKind.LIVE},
}


class _Arcs:
    """The arcs of the ordinary net: for each transition what it takes and puts, for each place with an arc who does."""

    def __init__(self, net: Net) -> None:
        self.taken = [frozenset((*t.inputs, *t.permissive)) for t in net.transitions]
        reads = [frozenset(t.permissive) - frozenset(t.inputs) for t in net.transitions]
        self.put = [frozenset(t.outputs) | read for t, read in zip(net.transitions, reads, strict=True)]
        self.marked = frozenset(place.name for place in net.places if place.marked)
        self.consumers = _at(self.taken)
        self.producers = _at(self.put)
        self.places = self.consumers.keys() | self.producers.keys()


def _at(sides: Iterable[Set[str]]) -> dict[str, frozenset[int]]:
    found: dict[str, set[int]] = {}
    for t, places in enumerate(sides):
        for place in places:
            found.setdefault(place, set()).add(t)
    return {place: frozenset(of) for place, of in found.items()}


def check_premises(net: Net, discipline: Discipline, claim: Claim, of: Theorem) -> None:
    """Refuse a theorem that does not show the claim, or whose premises the arcs do not meet.

    That the net is contact-free, and that every siphon contains one of the traps, are questions of their own.
    """
    if claim.kind not in _SHOWN[of.name] or (claim.kind is ClaimKind.ALWAYS_POSSIBLE and claim.goal != Start()):
        refuse(f"the theorem on nets of the class '{of.name}' does not say '{claim}'")
    if discipline is not Discipline.INTERLEAVING:
        refuse("the theorems are about single firings")
    for t in net.transitions:
        if t.inhibitive or not t.openable or {*t.inputs, *t.permissive} & {*t.outputs}:
            refuse(f"{t.name} has an inhibitive gate or contradicts itself, of which the theorems know nothing")
    arcs = _Arcs(net)
    match of.name:
        case TheoremName.MARKED_GRAPH:
            _marked_graph(arcs)
        case TheoremName.FREE_CHOICE:
            if not all(len({arcs.consumers[p] for p in places}) <= 1 for places in arcs.taken):
                refuse("the net is not extended free choice")
            _marked_traps(arcs, of.traps)
            if claim.kind is ClaimKind.ALWAYS_POSSIBLE and (trap := _largest_trap(arcs, arcs.places - arcs.marked)):
                refuse(f"the trap of {', '.join(sorted(trap))} is empty in the initial marking")
        case TheoremName.ASYMMETRIC_CHOICE:
            for places in arcs.taken:
                groups = sorted({arcs.consumers[p] for p in places}, key=len)
                if not all(one <= other for one, other in pairwise(groups)):
                    refuse("the net is not asymmetric choice")
            _marked_traps(arcs, of.traps)


def _marked_graph(arcs: _Arcs) -> None:
    for place in arcs.places:
        if not len(arcs.consumers.get(place, ())) == 1 == len(arcs.producers.get(place, ())):
            refuse(f"{place} has not one producer and one consumer, so the net is no marked graph")
    # Who waits for no token that is not there yet goes first; a circuit without a token is never begun.
    waiting = [len(places - arcs.marked) for places in arcs.taken]
    ready, done = [t for t, n in enumerate(waiting) if not n], 0
    while ready:
        done += 1
        for place in arcs.put[ready.pop()] - arcs.marked:
            for t in arcs.consumers[place]:
                waiting[t] -= 1
                if not waiting[t]:
                    ready.append(t)
    if done < len(waiting):
        refuse("a circuit of the marked graph holds no token")


def _marked_traps(arcs: _Arcs, traps: Iterable[Iterable[str]]) -> None:
    for names in traps:
        trap = frozenset(names)
        if not trap & arcs.marked:
            refuse(f"the trap of {', '.join(sorted(trap))} holds no token in the initial marking")
        if _largest_trap(arcs, trap) != trap:
            refuse(f"{', '.join(sorted(trap))} are no trap: a firing may take their last token")


def _largest_trap(arcs: _Arcs, among: Set[str]) -> set[str]:
    """The largest set of these places from which every transition that takes puts something back."""
    trap, todo = set(among), list(among)
    while todo:
        place = todo.pop()
        if place in trap and any(arcs.put[t].isdisjoint(trap) for t in arcs.consumers.get(place, ())):
            trap.discard(place)
            todo += [p for t in arcs.producers.get(place, ()) for p in arcs.taken[t] if p in trap]
    return trap
