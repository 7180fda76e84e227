"""Rules: needs that other needs imply, places that only have such needs, and transitions that contradict a fact.

All rest on facts of the form "never both" (`pairs`): if a and not-b are never true together, then a implies b.

- *Dead transition*: two of its needs are never true together.
- *Implied gate*: a move reads a literal that another of its needs implies. Without the gate it fires in the same
  reachable markings.
- *Implied place*: each need of the place, in each move, is implied by a need of another place, and the goal does not
  speak of it. Without it the same runs are possible: by induction, the move finds its other needs in the marking of
  the draft as it was, which is reachable there, so they imply the one that was dropped. This is the implicit or
  redundant place of Berthelot and of Silva and Colom, where for us both sides must be implied: that it is marked when
  it is taken from, and that it is empty when a token is put on it.

The first two leave the graph of markings as it is. The last may map two markings to one, which enables the same moves,
so it preserves what a run can do, not how many markings there are. One need is dropped at a time, so that
two that imply each other do not both go; what was proved of the reachable markings before stays true after each.

Cost: for each move, the pairs of its needs.
"""

from __future__ import annotations

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft, Move
from firable.analysis.reduction.pairs import Pairs

_NEEDS_MAX = 200  # pairs of needs are quadratic; a transition with more is left as it is
_AROUND_MAX = 2_000


def remove_dead(draft: Draft, facts: Pairs, deadline: Deadline) -> bool:
    """Remove the moves that a fact forbids; whether there were any."""
    if deadline.over:
        return False
    dead = [number for number, move in draft.moves.items() if facts.dead(move)]
    if dead:
        draft.note(Rule.DEAD, dead)
    for number in dead:
        draft.remove(number)
    draft.count("dead transition", len(dead))
    return bool(dead)


def remove_implied_gates(draft: Draft, facts: Pairs, deadline: Deadline) -> bool:
    """Remove the gates that other needs of their move imply; whether there were any."""
    removed = 0
    for number in list(draft.moves):
        if deadline.over:
            break
        move = draft.moves[number]
        if len(move.needs) > _NEEDS_MAX:
            continue
        for place in list(move.reads):
            if _implied(move, place, facts):
                move = move.without((place,))
                draft.note(Rule.GATE, (number,), (place,))
                removed += 1
        if move is not draft.moves[number]:
            draft.replace(number, move)
    draft.count("implied gate", removed)
    return removed > 0


def remove_implied_places(draft: Draft, facts: Pairs, deadline: Deadline) -> bool:
    """Remove the places whose value follows wherever it is needed; whether there were any."""
    removed = 0
    for place in sorted(draft.places):
        if deadline.over:
            break
        if draft.protected(place):
            continue
        moves = [draft.moves[number] for number in draft.needing(place)]
        if sum(len(move.needs) for move in moves) > _AROUND_MAX:
            continue
        if all(_implied(move, place, facts) for move in moves):
            draft.note(Rule.IMPLIED, places=(place,))
            draft.drop(place)
            removed += 1
    draft.count("implied place", removed)
    return removed > 0


def _implied(move: Move, place: int, facts: Pairs) -> bool:
    """Whether another need of the move implies what it needs of the place."""
    opposite = 2 * place + (not move.needs[place])
    return any(one // 2 != place and facts.exclude(one, opposite) for one in move.literals)
