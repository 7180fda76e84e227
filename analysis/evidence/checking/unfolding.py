"""A formula of LTL on a closed set of markings: every run that could refute it is followed, by a tableau made here.

A node is a marking with what the rest of the run owes to satisfy the negation. What is owed is unfolded into what
holds now and what is owed next (Couvreur 1999, "On-the-fly verification of linear temporal logic"): `p U q` is q now,
or p now and the same next, which postpones q; `p R q` is q now, and p now or the same next. A run refutes the formula
iff it can go round for ever without postponing any one until all the time. So the formula holds iff in no strongly
connected part of what is reached from M0, for every until, some firing does not postpone it. In a deadlock the
marking is repeated.

This is the one certificate that is decided again rather than looked through: ranks on these nodes would be as many
numbers as there are nodes, and would be checked by going through just these nodes. What is certified is the set of
markings; the tableau shares nothing with that of `firable.analysis.temporal` but the idea.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.checking.listed import Listed
from firable.analysis.evidence.refusal import TimeIsOverError, refuse, shown
from firable.nets.formula import Constant, Formula, Not
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
    all_of,
    any_of,
    format_temporal,
)
from firable.nets.temporal_parts import has_events
from firable.semantics.trace import Discipline

Owed = frozenset[Temporal]


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to begin with what is owed: what holds now, what fires next or does not, what is owed then."""

    now: frozenset[Formula]
    fires: frozenset[str]
    spares: frozenset[str]
    owed: Owed
    postponed: Owed


def positive(formula: Temporal, *, negative: bool = False) -> Temporal:
    """A formula of LTL, or its negation, in which negation stands before atoms alone, of X, U and R.

    >>> from firable.nets.temporal import parse_temporal
    >>> format_temporal(positive(parse_temporal("not (p U q)")))
    'not p R not q'
    """

    def part(operand: Temporal) -> Temporal:
        return positive(operand, negative=negative)

    match formula:
        case TemporalNot(operand):
            return positive(operand, negative=not negative)
        case TemporalAnd(operands) | TemporalOr(operands):
            joined = all_of if isinstance(formula, TemporalAnd) is not negative else any_of
            return joined(tuple(map(part, operands)))
        case Next(operand):
            return Next(part(operand))
        case Eventually(operand):
            return part(Until(Constant(value=True), operand))
        case Globally(operand):
            return part(Release(Constant(value=False), operand))
        case Until(left, right):
            return Release(part(left), part(right)) if negative else Until(part(left), part(right))
        case Release(left, right):
            return Until(part(left), part(right)) if negative else Release(part(left), part(right))
        case WeakUntil(left, right):
            return part(Release(right, any_of((left, right))))
        case Fires():
            return TemporalNot(formula) if negative else formula
        case _ if isinstance(formula, Formula):
            return Not(formula) if negative else formula
    raise ValueError(f"'{format_temporal(formula)}' is no formula of LTL")


@lru_cache(maxsize=4096)
def _ways(owed: Owed) -> tuple[_Way, ...]:
    """The ways to begin with what is owed."""
    found: dict[_Way, None] = {}
    none: frozenset[str] = frozenset()
    todo: list[tuple[tuple[Temporal, ...], _Way]] = [
        (tuple(owed), _Way(frozenset(), none, none, frozenset(), frozenset()))
    ]
    while todo:
        rest, way = todo.pop()
        if not rest:
            found[way] = None
            continue
        one, rest = rest[0], rest[1:]
        later = _Way(way.now, way.fires, way.spares, way.owed | {one}, way.postponed)
        match one:
            case TemporalAnd(operands):
                todo.append(((*operands, *rest), way))
            case TemporalOr(operands):
                todo += [((operand, *rest), way) for operand in operands]
            case Next(operand):
                todo.append((rest, _Way(way.now, way.fires, way.spares, way.owed | {operand}, way.postponed)))
            case Until(left, right):
                putting_off = _Way(later.now, later.fires, later.spares, later.owed, later.postponed | {one})
                todo += [((right, *rest), way), ((left, *rest), putting_off)]
            case Release(left, right):
                todo += [((left, right, *rest), way), ((right, *rest), later)]
            case Fires(name):
                todo.append((rest, _Way(way.now, way.fires | {name}, way.spares, way.owed, way.postponed)))
            case TemporalNot(Fires(name)):
                todo.append((rest, _Way(way.now, way.fires, way.spares | {name}, way.owed, way.postponed)))
            case _ if isinstance(one, Formula):
                todo.append((rest, _Way(way.now | {one}, way.fires, way.spares, way.owed, way.postponed)))
            case _:
                raise ValueError(f"'{format_temporal(one)}' is not in positive form")
    return tuple(found)


Product = tuple[int, Owed]
Edge = tuple[Product, Owed]
"""The node after, and the untils that are postponed."""


class Unfolding:
    """The nodes that the negation of a formula leads to, from M0."""

    def __init__(self, space: Listed, formula: Temporal, deadline: Deadline = NEVER) -> None:
        self.space, self.formula, self.deadline = space, formula, deadline
        self.columns: dict[Formula, list[bool]] = {}
        self.nodes = 0

    def check(self) -> None:
        """Refuse where some run refutes the formula; raises `TimeIsOverError` at the deadline."""
        if has_events(self.formula) and self.space.discipline is Discipline.STEP:
            refuse("`fires` names one firing, and a step holds several")
        start = (self.space.start, frozenset({positive(self.formula, negative=True)}))
        for part in self._parts(start):
            inside = set(part)
            edges = [postponed for node in part for after, postponed in self._edges(node) if after in inside]
            if edges and not frozenset.intersection(*edges):
                here = shown(self.space.net, self.space.markings[part[0][0]])
                refuse(f"a run that goes on from {here} does not satisfy ({format_temporal(self.formula)})")

    def _edges(self, node: Product) -> list[Edge]:
        at, owed = node
        names = self.space.net.transitions
        row = [({names[t].name for t in fired}, after) for fired, after in self.space.edges[at]] or [(set(), at)]
        found = []
        for way in _ways(owed):
            if all(self._holds(one, at) for one in way.now):
                found += [
                    ((after, way.owed), way.postponed)
                    for fired, after in row
                    if way.fires <= fired and way.spares.isdisjoint(fired)
                ]
        return found

    def _holds(self, formula: Formula, at: int) -> bool:
        if formula not in self.columns:
            self.columns[formula] = self.space.where(formula)
        return self.columns[formula][at]

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
                    if len(number) % 1024 == 0 and self.deadline.over:
                        raise TimeIsOverError
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
