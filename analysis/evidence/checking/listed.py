"""A set of listed markings, closed as a rule: each is fired through by the reference player, and labels are ranks.

Columns of Booleans, one for each marking of the list, are its subsets. Everything is one look at each marking and its
successors, so a check costs about what it costs to read the list.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Label, Ranks, Whole
from firable.analysis.evidence.checking.columns import columns
from firable.analysis.evidence.refusal import TimeIsOverError, refuse, shown, ticking
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import counted
from firable.semantics.algebra import Bitwise
from firable.semantics.firing import firable
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, Player
from firable.semantics.trace import Discipline

Column = list[bool]
_CLOCK_EVERY = 256


OUTSIDE = -1
"""The number of a marking that is not in the set."""


class Part:
    """A set of markings that holds M0; firings may lead out of it, to `OUTSIDE`."""

    def __init__(
        self, net: Net, discipline: Discipline, markings: Sequence[Marking], deadline: Deadline = NEVER
    ) -> None:
        self.net, self.discipline, self.markings = net, discipline, markings
        self.player = Player(net, ticking(deadline))
        self._changed: dict[int, Marking] = {}
        places = {marking: i for i, marking in enumerate(markings)}
        if net.initial_marking not in places:
            refuse("the initial marking is not in the set")
        self.start = places[net.initial_marking]
        self.edges: list[list[tuple[FiringSet, int]]] = []
        for i, marking in enumerate(markings):
            if i % _CLOCK_EVERY == 0 and deadline.over:
                raise TimeIsOverError
            row = []
            for fired, after in self._successors(i, marking):
                row.append((fired, places[after] if after in places else self._outside(after)))
            self.edges.append(row)

    def _outside(self, _: Marking) -> int:
        return OUTSIDE

    @cached_property
    def _held(self) -> dict[Formula, Column]:
        return {}

    def holds(self, formula: Formula, at: int) -> bool:
        """Whether a state formula holds in a marking of the set."""
        if formula not in self._held:
            self._held[formula] = self.where(formula)
        return self._held[formula][at]

    @property
    def method(self) -> str:
        """What was gone through, in words."""
        markings = counted(len(self.markings), "marking")
        return f"{markings} and {counted(sum(map(len, self.edges)), 'firing')} gone through by the reference player"

    def _successors(self, i: int, marking: Marking) -> Iterable[tuple[FiringSet, Marking]]:
        if self.discipline is Discipline.STEP:
            return self.player.successors(marking, step=True)
        fires = (t for t, where in self._firable if where[i])
        return (((t,), self._fired(marking, t)) for t in fires)

    def _fired(self, marking: Marking, t: int) -> Marking:
        """The marking after a firing that Eq. (1) allows.

        Where it does, inputs are full and outputs empty, so the same places change each time: those that the reference
        player changes when it fires the transition for the first time.
        """
        if t not in self._changed:
            self._changed[t] = self.player.fire(marking, (t,)) ^ marking
        return marking ^ self._changed[t]

    @cached_property
    def _columns(self) -> tuple[Bitwise[int], list[int]]:
        """For each place the markings in which it holds a token, as one number, and the algebra of these."""
        of_places = columns(self.markings, len(self.net.places))
        return Bitwise(true=(1 << len(self.markings)) - 1, false=0), of_places

    @cached_property
    def _firable(self) -> list[tuple[int, Column]]:
        """Each transition that may fire in some of the markings, and in which."""
        algebra, of_places = self._columns
        openable = (t for t, transition in enumerate(self.net.transitions) if transition.openable)
        found = ((t, firable(algebra, self.net, t, of_places.__getitem__)) for t in openable)
        return [(t, self._column(where)) for t, where in found if where]

    def _column(self, number: int) -> Column:
        return [digit == "1" for digit in reversed(f"{number:0{len(self.markings)}b}")]

    def where(self, formula: Formula) -> Column:
        """The markings in which a state formula holds."""
        algebra, of_places = self._columns
        return self._column(evaluate(algebra, self.net, formula, of_places.__getitem__))


class Listed(Part):
    """A set of markings that is closed under firing, and holds M0; refused where it is not."""

    def _outside(self, marking: Marking) -> int:
        refuse(f"a firing leads out of the set, to {shown(self.net, marking)}")

    def holds_initially(self, column: Column) -> bool:
        """Whether M0 is in a subset."""
        return column[self.start]

    def all_of(self, sets: Iterable[Column]) -> Column:
        """The markings in all of the subsets."""
        return [all(row) for row in zip(*sets, strict=True)]

    def any_of(self, sets: Iterable[Column]) -> Column:
        """The markings in some of the subsets."""
        return [any(row) for row in zip(*sets, strict=True)]

    def neighbours(self, targets: Column, *, every: bool) -> Column:
        """The markings of which every next marking, or some, is a target."""
        judged = all if every else any
        return [judged(targets[after] for _, after in row) for row in self.edges]

    def least(self, label: Label, through: Column, end: Column, *, every: bool) -> Column:
        """The markings with a rank: 0 in the end, elsewhere one more than the nearest next one has, or the farthest.

        Larger ones would show the same, and so would fewer. Asked for is the one rank that each marking can have from
        those after it, none where it can have none, so that no edit of a rank goes unnoticed.
        """
        ranks = self._ranks(label)
        for i, rank in enumerate(ranks):
            if rank != (0 if end[i] else self._above(ranks, i, every=every) if through[i] else -1):
                refuse(f"{shown(self.net, self.markings[i])} has not the rank that follows from the ranks after it")
        return [rank >= 0 for rank in ranks]

    def _above(self, ranks: Sequence[int], at: int, *, every: bool) -> int:
        """The rank that a marking has from those after it: -1 where they have none."""
        after = [ranks[one] for _, one in self.edges[at]]
        ranked = [one for one in after if one >= 0]
        if not ranked or (every and len(ranked) < len(after)):
            return -1
        return 1 + (max(ranked) if every else min(ranked))

    def greatest(self, label: Label, end: Column, through: Column, *, every: bool) -> Column:
        """The markings with rank 0: `through` holds there, and with it the end, or a next one has a rank, or all.

        The others have -1, and none of them could have a rank because those after it have.
        """
        ranks = [0] * len(self.markings) if isinstance(label, Whole) else self._ranks(label)
        judged = all if every else any
        for i, rank in enumerate(ranks):
            row = self.edges[i]
            stays = end[i] or not row or judged(ranks[after] >= 0 for _, after in row)
            if rank != (0 if through[i] and stays else -1):
                refuse(f"what is to hold always ends in {shown(self.net, self.markings[i])}")
        return [rank >= 0 for rank in ranks]

    def _ranks(self, label: Label) -> Sequence[int]:
        if not isinstance(label, Ranks) or len(label.ranks) != len(self.markings):
            refuse("a listed set wants a rank for each marking as a label")
        return label.ranks
