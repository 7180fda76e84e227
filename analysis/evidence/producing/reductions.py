"""Reductions as evidence: the steps that made a net smaller for a goal, and what shows the goal of what is left.

The rules note what they do (`firable.analysis.reduction.draft`). The net that is left is taken from the checker, which
makes it of these steps, so that a certificate speaks of the very net that it is held against. Nothing here is trusted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from firable.analysis.evidence.certificate import InductiveInvariant, Labelling, Reduction, StubbornSets
from firable.analysis.evidence.checking.reduced import asked_of, small_net
from firable.analysis.evidence.checking.reductions import Draft
from firable.analysis.evidence.producing.lacking import NO_TIME, LackingError
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.goal import Limits
from firable.analysis.reduction.components import parts
from firable.analysis.reduction.reduce import reduce_for_goal
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Deadlock, Formula
from firable.nets.net import Net

Plain: TypeAlias = InductiveInvariant | Labelling | StubbornSets
"""What shows of a net, as it is, that a goal is never met."""


def reduction(
    net: Net, goal: Formula, limits: Limits, never: Callable[[Net, Formula], Plain | None]
) -> Reduction | None:
    """What shows by a smaller net that a goal is never met; None where it is, or no part of the small net shows it.

    Under interleaving. `never` is asked of the parts that are left, the smallest first. Raises `BudgetExceeded`, and
    `LackingError` where the checker does not follow.
    """
    reduced = reduce_for_goal(net, goal, limits)
    if reduced.goal == Constant(value=True):
        return None
    draft = Draft(net, goal, limits.deadline)
    try:
        for step in reduced.steps:
            draft.apply(step)
        if reduced.goal == Constant(value=False):
            return Reduction(reduced.steps)
        for part, of in parts(reduced.net, reduced.goal):
            names = tuple(place.name for place in part.places)
            small, left = small_net(draft, map(net.place_index.__getitem__, names)), _without_deadlock(of)
            found = never(small, asked_of(left, deadlock=draft.deadlock))
            if found is not None:
                return Reduction(reduced.steps, names, left, found)
    except TimeIsOverError:
        raise LackingError(NO_TIME) from None
    except InputError as error:
        raise LackingError(error.diagnostics[0].message) from None
    return None


def _without_deadlock(goal: Formula) -> Formula:
    operands = goal.operands if isinstance(goal, And) else (goal,)
    kept = tuple(one for one in operands if one != Deadlock())
    return Constant(value=True) if not kept else kept[0] if len(kept) == 1 else And(kept)
