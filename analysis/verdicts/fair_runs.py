"""Fair runs by sets of markings: from where can a fair run go on for ever inside a set? For any state space.

The fair components of `leads_to` need edges one by one. A space of sets has none, and needs none: with the condition
"t is disabled" and "t fires next", both as sets, a fair run inside W is a greatest fixpoint (Emerson and Lei 1986,
"Efficient model checking in fragments of the propositional mu-calculus"):

    weak     Y = W and EX Y and, for each t, E[Y U (Y and (t disabled or t fires into Y))]
    strong   Y = W and EX Y and, for each t, (t disabled or E[Y U (Y and t fires into Y)])

Why this is right for strong fairness: a run that goes round a bottom component of Y for ever, through all of it, either
meets only markings where t is disabled, or one from which "t fires" can be reached in Y, hence in the component. And
the markings that a fair run meets again and again satisfy the equation, so they are in the greatest solution.

The rejected alternative, components found by pivots (Bloem, Gabow and Somenzi 2000), takes fewer steps on long chains
and is much more to get right.
"""

from __future__ import annotations

from firable.analysis.spaces.space import S, StateSpace
from firable.nets.net import Fairness


def fair_markings(space: StateSpace[S], within: S, fairness: Fairness) -> S:
    """The set Y above: those among which a run may go on for ever, and meet each obligation of fairness again.

    A fair run goes on for ever inside the set from these and from what leads to them there, external gates free.
    Without fairness they are all from which a run goes on for ever inside the set.
    """
    algebra = space.algebra
    around = space.endless(within)
    if fairness is Fairness.NONE:
        return around
    transitions = range(len(space.net.transitions))
    disabled = {t: algebra.negation(space.may_fire(t)) for t in transitions}
    size = space.count(around)
    while size:
        for t in transitions:
            fires = algebra.conjunction([around, space.before(around, [t])])
            if fairness is Fairness.WEAK:
                met = algebra.conjunction([around, algebra.disjunction([disabled[t], fires])])
                around = space.backward(met, around)
            else:
                free = algebra.disjunction([disabled[t], space.backward(fires, around)])
                around = algebra.conjunction([around, free])
        around = space.endless(around)
        before, size = size, space.count(around)
        if size == before:
            break
    return around
