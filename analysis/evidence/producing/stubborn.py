"""Stubborn sets as evidence: the search that decides a goal, done again with its sets kept.

The race asks stubborn sets of many goals and keeps nothing but answers, since the sets take more room than the
markings. To search once more for one goal that is known to be unreachable costs what it did then, and mostly
little: such a graph is small, or the technique would not have won. Quick and thorough closures are tried with few
markings first, because every marking is written. Nothing here is trusted.
"""

from __future__ import annotations

from typing import Final

from firable.analysis._engine import BudgetExceeded, Search, Stubborn
from firable.analysis.compiled import engine_limits, flat, nodes_of
from firable.analysis.evidence.certificate import Markings, StubbornSets
from firable.analysis.goal import Limits
from firable.nets.formula import Deadlock, Formula
from firable.nets.net import Net

MARKINGS_MAX: Final = 100_000
"""How many markings are listed with a stubborn set each."""
DIGITS_MAX: Final = 8 * 2**20
"""How many hexadecimal digits the markings and the sets of one goal may take together."""
_TURNS: Final = ((False, 2**12), (True, 2**12), (True, MARKINGS_MAX), (False, MARKINGS_MAX))


def stubborn_sets(net: Net, goal: Formula, limits: Limits) -> StubbornSets | None:
    """The markings and sets that show a goal to be unreachable; None where it is reachable, or they are too many.

    Under interleaving. Raises `BudgetExceeded` where the memory does not hold the net.
    """
    engine, nodes = Stubborn(*flat(net)), None if isinstance(goal, Deadlock) else nodes_of(net, goal)
    for thorough, most in _TURNS:
        options = engine_limits(limits.deadline) | {"thorough": thorough, "keep_sets": True}
        options |= {"max_markings": most, "max_memory_bytes": limits.memory_bytes}
        found = engine.deadlocks(all=False, **options) if nodes is None else engine.reach(nodes, **options)
        if found.reason != "markings":
            break
    if not found.complete:
        if found.reason == "markings":
            return None
        raise BudgetExceeded(f"the search was ended: {found.reason}")
    if found.found is not None or (nodes is None and found.deadlocks()):
        return None
    return _written(net, found)


def _written(net: Net, search: Search) -> StubbornSets | None:
    sets, chosen = search.sets()
    digits = search.n_markings * -(-len(net.places) // 4) + len(sets) * -(-len(net.transitions) // 4)
    if digits > DIGITS_MAX:
        return None
    listed = sorted((search.marking(i), chosen[i]) for i in range(search.n_markings))
    of_each = tuple(sum(1 << t for t in one) for one in sets)
    return StubbornSets(Markings(tuple(m for m, _ in listed)), of_each, tuple(of for _, of in listed))
