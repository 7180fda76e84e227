"""A goal as linear constraints on the tokens of a marking, for an integer programme whose markings must satisfy it.

A place is a column that is 0 or 1. In negation normal form a disjunction is a row, "the values of the operands sum up
to at least 1", and a conjunction is a row for each operand; a full place has the value of its column, an empty one 1
minus that. An operand that is no literal has for its value an *indicator*, a column of 0 or 1 that may be 1 only where
the operand holds. (That it must be 1 there nobody needs, since nothing is negated any more.) A comparison of counts of
tokens is a row as it stands; all other atoms are what `semantics.formulas` makes of them.

A transition is not firable where a place in front of it is empty, and where one behind it is full. The second never
happens alone in a net without contact, but a solver that does not know this has as many more ways to try as there are
outputs, and takes up to twenty times as long. So the rows of a goal may leave the contact rule out. Where there is
contact they are those of another goal, and whoever uses them looks whether the marking that was reached is of this one.

Rejected: a comparison as the Boolean term that other engines are given. It takes an indicator for each entry of a
table, and leaves the solver a relaxation that says next to nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import ALL, ANY, EMPTY, FULL, Nodes, Pair
from firable.analysis.deadline import NEVER, Deadline
from firable.nets.formula import Compare, Deadlock, Firable, Formula, Sign
from firable.nets.net import Net
from firable.semantics.firing import gates_and_inputs

OUT_OF_TIME: Final = "the time was over"
_SUM: Final = 4
"""The operator of "the weighted tokens sum up to at least"; its operands are that number, then place, weight, ..."""

Row = tuple[dict[int, int], int]
"""Weights of columns, which must sum up to at least a number."""


@dataclass
class GoalRows:
    """The `rows` of a goal; its columns are the places by index, and after them the indicators."""

    n_columns: int
    rows: list[Row] = field(default_factory=list)


@dataclass
class _Sums(Nodes):
    """The algebra of nodes in which a comparison is a node of its own; by the contact rule or without it."""

    contact: bool = True
    deadline: Deadline = NEVER

    def conjunction(self, operands: Iterable[Pair], /) -> Pair:
        if self.deadline.over:  # there is one for each transition
            raise BudgetExceeded(OUT_OF_TIME)
        return super().conjunction(operands)

    def atom(self, net: Net, part: Formula) -> Pair:
        match part:
            case Compare():
                return self._compared(net, part)
            case Firable(name) if not self.contact:
                return self._may_fire(net, net.transition_index[name])
            case Deadlock() if not self.contact:
                return self.conjunction(self.negation(self._may_fire(net, t)) for t in range(len(net.transitions)))
        return super().atom(net, part)

    def _may_fire(self, net: Net, t: int) -> Pair:
        false = self.negation(self.true)
        return gates_and_inputs(self, net, t, self.holds) if net.transitions[t].openable else false

    def _compared(self, net: Net, part: Compare) -> Pair:
        weights: dict[int, int] = {}
        for side, sign in ((part.left, 1), (part.right, -1)):
            for name in side.places:
                place = net.place_index[name]
                weights[place] = weights.get(place, 0) + sign
        bound = part.right.added - part.left.added
        match part.sign:
            case Sign.AT_LEAST:
                return self._at_least(weights, bound)
            case Sign.MORE:
                return self._at_least(weights, bound + 1)
            case Sign.LESS:
                return self.negation(self._at_least(weights, bound))
            case Sign.AT_MOST:
                return self.negation(self._at_least(weights, bound + 1))
        equal = [self._at_least(weights, bound), self.negation(self._at_least(weights, bound + 1))]
        return self.conjunction(equal) if part.sign is Sign.EQUAL else self.negation(self.conjunction(equal))

    def _at_least(self, weights: dict[int, int], least: int) -> Pair:
        if least <= sum(weight for weight in weights.values() if weight < 0):
            return self.true
        if least > sum(weight for weight in weights.values() if weight > 0):
            return self.negation(self.true)
        return self._sum(weights.items(), least), self._sum(((p, -weight) for p, weight in weights.items()), 1 - least)

    def _sum(self, weighted: Iterable[tuple[int, int]], least: int) -> int:
        return self._node(_SUM, (least, *(number for pair in weighted for number in pair)))


def rows_of(net: Net, goal: Formula, *, contact: bool = True, deadline: Deadline = NEVER) -> GoalRows:
    """The constraints that a marking satisfies, with some values of the indicators, iff the goal holds in it.

    Without `contact`, what is firable is so whatever its output places hold. Raises `BudgetExceeded` where the deadline
    comes first.

    >>> from firable.nets.formula import parse_formula
    >>> from firable.nets.net import Place
    >>> net = Net("n", (Place("p"), Place("q")))
    >>> rows_of(net, parse_formula("not (p and q)")).rows  # 1 - p + 1 - q is at least 1
    [({0: -1, 1: -1}, -1)]
    """
    algebra = _Sums(contact=contact, deadline=deadline)
    root, _ = algebra.value(net, goal)
    nodes = algebra.needed_for(root)
    found = GoalRows(len(net.places))
    indicators: dict[int, int] = {}
    todo: list[tuple[int, int | None]] = [(len(nodes) - 1, None)]  # nodes that hold, always or where an indicator is 1

    def any_of(operands: Iterable[int], under: int | None) -> Row:
        row, least = ({}, 1) if under is None else ({under: -1}, 0)
        for node in operands:
            operator, (place, *_) = nodes[node]
            if operator in (FULL, EMPTY):
                column, weight = place, 1 if operator == FULL else -1
                least -= operator == EMPTY
            else:
                if node not in indicators:
                    indicators[node] = found.n_columns
                    found.n_columns += 1
                    todo.append((node, indicators[node]))
                column, weight = indicators[node], 1
            row[column] = row.get(column, 0) + weight
        return row, least

    while todo:
        node, under = todo.pop()
        operator, operands = nodes[node]
        if operator == ANY:
            found.rows.append(any_of(operands, under))
        elif operator == ALL and under is None:
            todo += [(operand, None) for operand in operands]
        elif operator == ALL:
            found.rows += [any_of((operand,), under) for operand in operands]
        elif operator == _SUM:
            least, *weighted = operands
            row = dict(zip(weighted[::2], weighted[1::2], strict=True))
            if under is not None:  # where the indicator is 0 the least that there is suffices
                always = sum(weight for weight in row.values() if weight < 0)
                row[under], least = always - least, always
            found.rows.append((row, least))
        else:
            found.rows.append(any_of((node,), under))
    return found
