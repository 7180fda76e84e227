"""Rule: a transition that may fire at once, and is never sorry to have fired, is fired in M0.

A move t that can be made in M0 is made first ("early firing") if no other move needs, and the goal is not made true
by, a literal that t makes false. For a deadlock, t must read nothing besides.

Proof. Let x be a place that t flips, from v. Until t is made no move touches x: who does would need v, and only t
does, or the other value, which x has not. So in a run to the goal in which t is made, its first occurrence can be put
in front: what came before it neither needs nor flips such an x. In a run to the goal in which t is not made, t can be
put in front, and the marking at the end differs only in that the literals v are false, which the goal does not want.
A deadlock is not reached without t if all that t needs are the x, because they keep their values.

Where it matters what can still happen (`Labels.branching`), the same holds: nobody can make t impossible, and it takes
nothing from anybody, so M0 and the marking after t satisfy the same formulas of CTL without X (why, `agglomeration`
says of such a move).

Contract: a run after t is a run, and it is noted what was fired first.

Each move is fired so at most once, because two that undo each other would do so for ever.
"""

from __future__ import annotations

from firable.analysis.evidence.certificate import Rule
from firable.analysis.reduction.draft import Draft


def fire_early(draft: Draft, fired: set[int]) -> bool:
    """Apply the rule to all moves not among those `fired`, which grow by them; whether something changed."""
    count = 0
    for number, move in list(draft.moves.items()):
        if number in fired or not move.flips or not draft.initially(move):
            continue
        if draft.deadlock and any(True for _ in move.reads):
            continue
        lost = [one ^ 1 for one in move.made]
        if any(len(draft.at[one]) > 1 for one in lost) or not draft.goal_literals.isdisjoint(lost):
            continue
        for place in move.flips:
            draft.values[place] = not draft.values[place]
            draft.touched[place] = None
        draft.first.append(move.origin)
        draft.note(Rule.EARLY, (number,))
        fired.add(number)
        count += 1
    draft.count("early firing", count)
    return count > 0
