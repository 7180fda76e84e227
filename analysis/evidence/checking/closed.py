"""A set of listed markings, closed as a rule, of which nothing is asked but that: for what is never so.

That M0 is in it, that no firing leads out of it and that a goal holds nowhere in it are questions to columns, one bit
for each marking (`columns`): where a transition may fire, and then the markings after it one by one. What fires where
is not kept, which for labels it must be (`listed`), so that millions of markings can be looked through.
"""

from __future__ import annotations

from collections.abc import Sequence

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.checking.columns import columns, numbers
from firable.analysis.evidence.checking.cubes import firings
from firable.analysis.evidence.refusal import in_time, refuse, shown
from firable.nets.formula import Formula, format_formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import counted
from firable.semantics.algebra import Bitwise
from firable.semantics.formulas import evaluate


class Closed:
    """Markings that are closed under single firings, and hold M0; refused where they are not."""

    def __init__(self, net: Net, markings: Sequence[Marking], deadline: Deadline = NEVER) -> None:
        self.net, self.markings = net, markings
        self._full = columns(markings, len(net.places))
        self._algebra = Bitwise(true=(1 << len(markings)) - 1, false=0)
        self.n_firings = 0
        among = frozenset(markings)
        if net.initial_marking not in among:
            refuse("the initial marking is not in the set")
        for needs, flips in firings(net).values():
            literals = (self._full[p] if value else self._algebra.negation(self._full[p]) for p, value in needs.items())
            changed = sum(1 << p for p in flips)
            for i in in_time(numbers(self._algebra.conjunction(literals)), deadline):
                self.n_firings += 1
                if markings[i] ^ changed not in among:
                    refuse(f"a firing leads out of the set, to {shown(net, markings[i] ^ changed)}")

    @property
    def method(self) -> str:
        """What was gone through, in words."""
        markings, firings = counted(len(self.markings), "marking"), counted(self.n_firings, "firing")
        return f"{markings} and {firings} looked through in columns"

    def require_never(self, goal: Formula) -> None:
        """Refuse a goal that holds in a marking of the set."""
        if evaluate(self._algebra, self.net, goal, self._full.__getitem__):
            refuse(f"the goal ({format_formula(goal)}) holds in a marking of the set")
