"""Rule: what the goal does not depend on. Only for the reachability of a goal over places.

A literal is *relevant* if the goal may become true by it, or if a relevant move needs it; a move is relevant if it
makes a relevant literal true. The moves that are not relevant are removed ("irrelevant transition"), and then the
places that no move needs and the goal does not speak of ("irrelevant place").

Sound: a run without the other moves is a run of the draft as it was. Complete: take a run to the goal and leave out
the moves that are not relevant. By induction each relevant literal that holds in the run holds in the shortened one
too: a relevant move finds its needs, which are relevant, and does the same in both; a move left out makes no relevant
literal true, so it is missed by none. So the shortened run ends in the goal, because its literals are relevant.

This is backward slicing (Rakow 2012, "Safety slicing Petri nets"; Bønneland, Dyhr, Jensen, Johannsen and Srba 2019,
"Stubborn versus structural reductions for Petri nets"), by literals rather than by places. The contact rule makes
little of the difference: whoever puts a token needs the place empty, so who takes it is relevant too. Gates are needs
like all others.

The second part, a place that nobody needs, holds for every question: without it the graph of markings is the same.

Cost: linear in the arcs.
"""

from __future__ import annotations

from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft


def remove_irrelevant(draft: Draft) -> bool:
    """Apply the rule everywhere; whether something changed."""
    changed = False
    if not draft.deadlock:
        relevant, kept = set(draft.goal_literals), set[int]()
        todo = list(relevant)
        while todo:
            one = todo.pop()
            for number in draft.at[one ^ 1]:
                move = draft.moves[number]
                if number not in kept and one // 2 in move.flips:
                    kept.add(number)
                    new = set(move.literals) - relevant
                    relevant |= new
                    todo += new
        others = [number for number in draft.moves if number not in kept]
        if others:
            draft.note(Rule.IRRELEVANT, others)
        for number in others:
            draft.remove(number)
        draft.count("irrelevant transition", len(others))
        changed = bool(others)
    return remove_unneeded_places(draft) or changed


def remove_unneeded_places(draft: Draft) -> bool:
    """Drop the places that no move needs and the goal does not speak of; whether there were any."""
    unneeded = [place for place in draft.places if not draft.needing(place) and not draft.protected(place)]
    if unneeded:
        draft.note(Rule.UNNEEDED, places=unneeded)
    for place in unneeded:
        draft.drop(place)
    draft.count("irrelevant place", len(unneeded))
    return bool(unneeded)
