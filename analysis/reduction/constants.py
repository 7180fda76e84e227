"""Rule: places that never change, and transitions that therefore never fire.

Which values can a place take? Those of M0, and those that a move gives it whose needs can all be met, each by itself.
The least fixpoint holds every value of every reachable marking, since it only forgets which values occur together (the
relaxation of planning that ignores deletes: Hoffmann and Nebel 2001, "The FF planning system"). So

- a move that needs a value its place cannot take never fires, and is removed ("dead transition");
- a place with one value is a constant: what needs it needs nothing, the goal is told the value, the place is dropped
  ("constant place").

Both leave the graph of markings as it is, but for the constant itself, so every question is preserved, and the
contract holds with identical runs. This covers the place that is empty and has no producer, the place that is marked
and has no consumer (under the contact rule its producers are dead), and what follows from them.

Cost: linear in the arcs.
"""

from __future__ import annotations

from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft, literal


def remove_constants(draft: Draft) -> bool:
    """Apply the rule everywhere; whether something changed."""
    possible = {literal(place, draft.values[place]) for place in draft.places}
    missing = {number: len(move.needs) for number, move in draft.moves.items()}
    todo = list(possible)
    while todo:
        one = todo.pop()
        for number in draft.at[one]:
            missing[number] -= 1
            if not missing[number]:
                for made in draft.moves[number].made:
                    if made not in possible:
                        possible.add(made)
                        todo.append(made)
    constant = [place for place in draft.places if literal(place, not draft.values[place]) not in possible]
    if constant:
        draft.note(Rule.CONSTANT, places=constant)
    dead = [number for number, count in missing.items() if count and number in draft.moves]
    for number in dead:
        draft.remove(number)
    draft.substitute({place: draft.values[place] for place in constant})
    for place in constant:
        draft.drop(place)
    draft.count("dead transition", len(dead))
    draft.count("constant place", len(constant))
    return bool(dead or constant)
