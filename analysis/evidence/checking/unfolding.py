"""A formula of LTL on a set of markings: every run that could refute it is followed, by a tableau made here.

A node is a marking with what the rest of the run owes to satisfy the negation. What is owed is unfolded into what
holds now and what is owed next (Couvreur 1999, "On-the-fly verification of linear temporal logic"): `p U q` is q now,
or p now and the same next, which postpones q; `p R q` is q now, and p now or the same next. A run refutes the formula
iff it can go round for ever without postponing any one until all the time. So the formula holds iff in no strongly
connected part of what is reached from M0, for every until, some firing does not postpone it. In a deadlock the
marking is repeated.

The set need not be closed. Where no way is left to refute the formula, a run is not followed, so the markings after it
are not asked for; a run that may still refute it must not leave the set. So a formula that is decided early is
shown by a part of the markings.

The parts of the formula are numbered, each after those that it is made of, and what is owed is a set of numbers:
unfolded from the highest down, no part is unfolded twice, and a part that occurs often is one number. It is unfolded
at a letter, the atoms that hold now and what fires, so a way to begin is what is owed next with what is postponed.

Of the ways only the least are kept, of those that are begun as of those that are done: one goes where another one has
no more to unfold, owes no more next and postpones no more. This loses no run that refutes. Where S' is within S, each
way to unfold S has one of S' within it: unfold each part of S' as it was unfolded there (if in two ways, in either);
what must hold now was asked for there as well. So whatever a way that goes would have become, the one that stays
becomes something within it. Now let a run be followed from S0 through S1, S2, ... by any of the ways. By
induction there are S'i within Si through which kept ways lead: one of S'i is within the way from Si, a kept one is
within that, so S'i+1 is within Si+1. What is postponed on each step is within what was, so an until that was not
postponed all the time is not now. And no run is made up: each way that is kept is one of all the ways. Without this
the ways are as many as there are choices, exponentially many in nested operators; with it they may still be, so the
deadline is looked at wherever one is begun.

This is the one certificate that is decided again rather than looked through: ranks on these nodes would be as many
numbers as there are nodes, and would be checked by going through just these nodes. What is certified is the set of
markings; the tableau shares nothing with that of `firable.analysis.temporal` but the idea.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.checking.listed import OUTSIDE
from firable.analysis.evidence.refusal import TimeIsOverError, refuse, shown
from firable.nets.formula import Constant, Formula
from firable.nets.net import Marking, Net
from firable.nets.temporal import (
    Eventually,
    Fires,
    Globally,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    WeakUntil,
    format_temporal,
)
from firable.nets.temporal_parts import has_events
from firable.semantics.player import FiringSet
from firable.semantics.trace import Discipline

Numbers = frozenset[int]
_NONE: Numbers = frozenset()


class _Operator(Enum):
    """The operators of positive form."""

    AND = auto()
    OR = auto()
    NEXT = auto()
    UNTIL = auto()
    RELEASE = auto()


@dataclass(frozen=True, slots=True)
class _Literal:
    """An atom, or its negation."""

    atom: Formula | Fires
    wanted: bool


@dataclass(frozen=True, slots=True)
class _Joined:
    """An operator over parts, which are numbers below its own."""

    operator: _Operator
    operands: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to begin with what is owed: what is still to be unfolded, what is owed next, the untils postponed."""

    rest: Numbers
    owed: Numbers = _NONE
    postponed: Numbers = _NONE

    def within(self, other: _Way) -> bool:
        """Whether it asks for no more than the other does."""
        return self.rest <= other.rest and self.owed <= other.owed and self.postponed <= other.postponed


class _Tableau:
    """A formula of LTL in positive form, with negation before atoms alone, and how parts of it are unfolded."""

    def __init__(self, formula: Temporal, deadline: Deadline, *, negative: bool) -> None:
        self.deadline = deadline
        self._numbers: dict[_Literal | _Joined, int] = {}
        self.root = self._number(formula, negative=negative)
        self.parts = tuple(self._numbers)
        self._literals = frozenset(n for n, part in enumerate(self.parts) if isinstance(part, _Literal))
        self._known: dict[tuple[Numbers, Numbers], tuple[_Way, ...]] = {}

    def _number(self, formula: Temporal, *, negative: bool) -> int:
        def part(operand: Temporal) -> int:
            return self._number(operand, negative=negative)

        def join(operator: _Operator, *operands: int) -> int:
            return self._add(_Joined(operator, operands))

        both, either = (_Operator.OR, _Operator.AND) if negative else (_Operator.AND, _Operator.OR)
        until, release = _Operator.UNTIL, _Operator.RELEASE
        if negative:
            until, release = release, until
        match formula:
            case TemporalNot(operand):
                return self._number(operand, negative=not negative)
            case TemporalAnd(operands):
                return join(both, *map(part, operands))
            case TemporalOr(operands):
                return join(either, *map(part, operands))
            case Next(operand):
                return join(_Operator.NEXT, part(operand))
            case Eventually(operand):
                return join(until, part(Constant(value=True)), part(operand))
            case Globally(operand):
                return join(release, part(Constant(value=False)), part(operand))
            case Until(left, right):
                return join(until, part(left), part(right))
            case Release(left, right):
                return join(release, part(left), part(right))
            case WeakUntil(left, right):
                first, last = part(left), part(right)
                return join(release, last, join(either, first, last))
            case _ if isinstance(formula, Fires | Formula):
                return self._add(_Literal(formula, not negative))
        raise ValueError(f"'{format_temporal(formula)}' is no formula of LTL")

    def _add(self, part: _Literal | _Joined) -> int:
        return self._numbers.setdefault(part, len(self._numbers))

    def ways(self, letter: Numbers, owed: Numbers) -> tuple[_Way, ...]:
        """The least ways to begin with what is owed where just the literals of the letter hold."""
        if (letter, owed) not in self._known:
            self._known[letter, owed] = self._unfolded(letter, owed)
        return self._known[letter, owed]

    def _unfolded(self, letter: Numbers, owed: Numbers) -> tuple[_Way, ...]:
        false = self._literals - letter
        done: list[_Way] = []
        # By the highest part still to be unfolded: a branch goes to a lower one, so what is taken out is all there is.
        begun = {-1: done}
        todo = [_Way(owed)]
        while True:
            for way in todo:
                if self.deadline.over:
                    raise TimeIsOverError
                if way.rest.isdisjoint(false):
                    settled = _Way(way.rest - letter, way.owed, way.postponed)
                    beside = begun.setdefault(max(settled.rest, default=-1), [])
                    if not any(other.within(settled) for other in (*done, *beside)):
                        beside[:] = [other for other in beside if not settled.within(other)]
                        beside.append(settled)
            highest = max(begun)
            if highest < 0:
                return tuple(done)
            todo = [branch for way in begun.pop(highest) for branch in self._branches(highest, way)]

    def _branches(self, one: int, way: _Way) -> list[_Way]:
        """A part unfolded; the branch that owes least comes first."""
        rest, owed, postponed = way.rest - {one}, way.owed, way.postponed
        match self.parts[one]:
            case _Joined(_Operator.AND, operands):
                return [_Way(rest.union(operands), owed, postponed)]
            case _Joined(_Operator.OR, operands):
                return [_Way(rest | {operand}, owed, postponed) for operand in operands]
            case _Joined(_Operator.NEXT, (operand,)):
                return [_Way(rest, owed | {operand}, postponed)]
            case _Joined(_Operator.UNTIL, (left, right)):
                return [_Way(rest | {right}, owed, postponed), _Way(rest | {left}, owed | {one}, postponed | {one})]
            case _Joined(_Operator.RELEASE, (left, right)):
                return [_Way(rest | {left, right}, owed, postponed), _Way(rest | {right}, owed | {one}, postponed)]
        raise TypeError(f"{self.parts[one]} is no operator with its operands")


Product = tuple[int, Numbers]
Edge = tuple[Product, Numbers]
"""The node after, and the untils that are postponed."""


class Unfoldable(Protocol):
    """Markings by number, M0 being `start`, and their firings, to the numbers of the markings after."""

    @property
    def net(self) -> Net:
        """The net."""
        ...

    @property
    def discipline(self) -> Discipline:
        """How transitions fire."""
        ...

    @property
    def start(self) -> int:
        """The number of M0."""
        ...

    @property
    def markings(self) -> Sequence[Marking]:
        """The markings."""
        ...

    @property
    def edges(self) -> Edges:
        """Of each marking what fires there, and the number of the marking after."""
        ...

    def holds(self, formula: Formula, at: int, /) -> bool:
        """Whether a state formula holds in a marking."""
        ...


class Edges(Protocol):
    """The firings of each marking."""

    def __getitem__(self, at: int, /) -> list[tuple[FiringSet, int]]:
        """Those of one."""
        ...


class Unfolding:
    """The nodes that the negation of a formula leads to, from M0."""

    def __init__(self, space: Unfoldable, formula: Temporal, deadline: Deadline) -> None:
        self.space, self.formula, self.deadline = space, formula, deadline
        self.tableau = _Tableau(formula, deadline, negative=True)
        self.nodes = 0
        self._holding: dict[int, Numbers] = {}
        self._firing: dict[FiringSet, Numbers] = {}

    def check(self) -> None:
        """Refuse where some run refutes the formula; raises `TimeIsOverError` at the deadline."""
        if has_events(self.formula) and self.space.discipline is Discipline.STEP:
            refuse("`fires` names one firing, and a step holds several")
        start = (self.space.start, frozenset({self.tableau.root}))
        for part in self._parts(start):
            inside = set(part)
            edges = [postponed for node in part for after, postponed in self._edges(node) if after in inside]
            if edges and not frozenset.intersection(*edges):
                here = shown(self.space.net, self.space.markings[part[0][0]])
                refuse(f"a run that goes on from {here} does not satisfy ({format_temporal(self.formula)})")

    def _edges(self, node: Product) -> list[Edge]:
        if self.deadline.over:
            raise TimeIsOverError
        at, owed = node
        found = []
        for fired, after in self.space.edges[at] or [((), at)]:
            ways = self.tableau.ways(self._held(at) | self._fired(fired), owed)
            if ways and after == OUTSIDE:
                names = " + ".join(self.space.net.transitions[t].name for t in fired)
                here = shown(self.space.net, self.space.markings[at])
                refuse(f"a run that may refute the formula leads out of the set, by {names} from {here}")
            found += [((after, way.owed), way.postponed) for way in ways]
        return found

    def _held(self, at: int) -> Numbers:
        """The literals over markings that hold in this one."""
        if at not in self._holding:
            self._holding[at] = frozenset(
                number
                for number, part in enumerate(self.tableau.parts)
                if isinstance(part, _Literal)
                and not isinstance(part.atom, Fires)
                and self.space.holds(part.atom, at) is part.wanted
            )
        return self._holding[at]

    def _fired(self, fired: FiringSet) -> Numbers:
        """The literals over firings that hold where these fire."""
        if fired not in self._firing:
            names = {self.space.net.transitions[t].name for t in fired}
            self._firing[fired] = frozenset(
                number
                for number, part in enumerate(self.tableau.parts)
                if isinstance(part, _Literal)
                and isinstance(part.atom, Fires)
                and (part.atom.transition in names) is part.wanted
            )
        return self._firing[fired]

    def _parts(self, start: Product) -> Iterator[list[Product]]:
        """The strongly connected parts of what is reached (Tarjan 1972), without recursion."""
        number: dict[Product, int] = {start: 0}
        low: dict[Product, int] = {start: 0}
        open_, on_stack = [start], {start}
        todo = [(start, iter(self._edges(start)))]
        while todo:
            node, edges = todo[-1]
            for after, _ in edges:
                if after not in number:
                    number[after] = low[after] = len(number)
                    open_.append(after)
                    on_stack.add(after)
                    todo.append((after, iter(self._edges(after))))
                    break
                if after in on_stack:
                    low[node] = min(low[node], number[after])
            else:
                todo.pop()
                if todo:
                    low[todo[-1][0]] = min(low[todo[-1][0]], low[node])
                if low[node] == number[node]:
                    part: list[Product] = []
                    while not part or part[-1] != node:
                        part.append(open_.pop())
                    on_stack -= set(part)
                    yield part
        self.nodes = len(number)
