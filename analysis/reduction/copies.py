"""Rules: places that are copies of each other, and transitions that do nothing another one does not do.

*Equal and complementary places.* A move flips the places that it flips, whatever their values. So if the same moves
flip p and q, each firing changes both or none, and p + q (modulo 2) is what it is in M0: q always equals p, or always
its complement. What needs q then needs p; a move that needs of both what cannot be is dead; the goal speaks of p
instead. The graph of markings is the same. It is the parallel place of Murata (1989, "Petri nets: properties,
analysis and applications", rule of fusion of parallel places) and of Berthelot, for both signs and without asking for
the same arcs: a capacity place, which is the complement of what it guards, goes too.

*Subsumed transitions.* A move u that flips what t flips, from the same values, and needs all that t needs, can be left
out: where u can be made t can, with the same effect. For deadlocks too: where neither can be made, u cannot. With the
same needs the two are duplicates, and where each transition counts only those are merged.

Cost: linear in the arcs, by hashing, and quadratic among transitions with one effect, of which a few are compared.
"""

from __future__ import annotations

from typing import Final

from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft, Move
from firable.analysis.reduction.goals import Value

_COMPARED_MAX: Final = 64


def merge_places(draft: Draft) -> bool:
    """Keep one of the places that the same moves flip; whether something changed."""
    flipping: dict[int, list[int]] = {}
    for number in draft.moves:
        for place in draft.moves[number].flips:
            flipping.setdefault(place, []).append(number)
    kept: dict[tuple[int, ...], int] = {}
    stands_for: dict[int, int] = {}
    for place in sorted(flipping):
        by = tuple(sorted(flipping[place]))
        if (other := kept.setdefault(by, place)) != place:
            stands_for[place] = other
    values: dict[int, Value] = {
        place: (draft.net.places[other].name, draft.values[place] == draft.values[other])
        for place, other in stands_for.items()
    }
    for place, other in stands_for.items():
        draft.note(Rule.COPY, places=(place, other))
    draft.substitute(values)
    dead = 0
    for place, other in stands_for.items():
        equal = draft.values[place] == draft.values[other]
        for number in draft.needing(place):
            move = draft.moves[number]
            wanted = move.needs[place] == equal
            if move.needs.get(other, wanted) != wanted:
                draft.remove(number)
                dead += 1
            else:
                # It flips `other` if it flips `place`; a gate on the one becomes a gate on the other.
                needs = {**move.needs, other: wanted}
                draft.replace(number, Move(needs, move.flips, move.origin, move.length).without((place,)))
        draft.drop(place)
    draft.count("copied place", len(stands_for))
    draft.count("dead transition", dead)
    return bool(stands_for)


def remove_subsumed(draft: Draft) -> bool:
    """Remove the moves that another one subsumes; whether there were any."""
    by_effect: dict[tuple[int, ...], list[int]] = {}
    for number, move in draft.moves.items():
        by_effect.setdefault(tuple(sorted(move.made)), []).append(number)
    removed = 0
    for numbers in by_effect.values():
        if len(numbers) > 1:
            removed += _thin_out(draft, numbers)
    draft.count("subsumed transition", removed)
    return removed > 0


def _thin_out(draft: Draft, numbers: list[int]) -> int:
    """Remove what is subsumed among moves with one effect; how many they were."""
    same: dict[frozenset[int], int] = {}
    removed = 0
    for number in numbers:
        needs = frozenset(draft.moves[number].literals)
        if (other := same.setdefault(needs, number)) != number:
            draft.same_as[number] = other
            draft.note(Rule.SUBSUMED, (number, other))
            draft.remove(number)
            removed += 1
    if draft.goal is None:
        return removed
    weakest: list[frozenset[int]] = []
    for needs in sorted(same, key=lambda needs: (len(needs), same[needs])):
        subsuming = next((weaker for weaker in weakest[:_COMPARED_MAX] if weaker <= needs), None)
        if subsuming is not None:
            draft.note(Rule.SUBSUMED, (same[needs], same[subsuming]))
            draft.remove(same[needs])
            removed += 1
        else:
            weakest.append(needs)
    return removed
