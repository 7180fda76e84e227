"""The markings on which a formula of LTL is unfolded, where all of them are too many: those that its negation asks for.

The tableau of the checker (`firable.analysis.evidence.checking.unfolding`) is unfolded on markings that are found as it
asks for them, as a search on the fly does. What has been asked for is the evidence. Under interleaving.
"""

from __future__ import annotations

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Markings
from firable.analysis.evidence.checking.cubes import firings
from firable.analysis.evidence.checking.unfolding import Unfolding
from firable.analysis.evidence.producing.labels import TooLargeError
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.temporal import Temporal
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, holds_in
from firable.semantics.trace import Discipline


def unfolded_markings(net: Net, formula: Temporal, most: int, deadline: Deadline) -> Markings | None:
    """The markings that the negation of a formula is unfolded on; None where a run refutes the formula.

    Raises `TooLargeError` for more than `most` of them, `BudgetExceeded` where the deadline comes first.
    """
    growing = Growing(net, most)
    try:
        Unfolding(growing, formula, deadline).check()
    except InputError:
        return None
    except TimeIsOverError:
        raise BudgetExceeded("the time was over") from None
    return Markings(tuple(sorted(growing.markings[at] for at in growing.asked)))


class Growing:
    """The markings met so far, and what fires in those that were asked for."""

    discipline = Discipline.INTERLEAVING
    start = 0

    def __init__(self, net: Net, most: int) -> None:
        self.net, self.most = net, most
        self.markings = [net.initial_marking]
        self.asked: dict[int, list[tuple[FiringSet, int]]] = {}
        self._numbers = {net.initial_marking: 0}
        self._masks = [
            (t, sum(1 << p for p in cube), sum(value << p for p, value in cube.items()), sum(1 << p for p in flips))
            for t, (cube, flips) in firings(net).items()
        ]

    @property
    def edges(self) -> Growing:
        """The firings by marking: this itself."""
        return self

    def __getitem__(self, at: int) -> list[tuple[FiringSet, int]]:
        """What fires in a marking."""
        if at not in self.asked:
            if len(self.asked) >= self.most:
                raise TooLargeError(f"a tableau is unfolded on up to {self.most:,} markings")
            marking = self.markings[at]
            self.asked[at] = [
                ((t,), self._number(marking ^ flips))
                for t, places, wanted, flips in self._masks
                if marking & places == wanted
            ]
        return self.asked[at]

    def _number(self, marking: int) -> int:
        number = self._numbers.setdefault(marking, len(self.markings))
        if number == len(self.markings):
            self.markings.append(marking)
        return number

    def holds(self, formula: Formula, at: int) -> bool:
        """Whether a state formula holds in a marking."""
        return evaluate(BOOL, self.net, formula, holds_in(self.markings[at]))
