"""The minimal semi-positive integer solutions of linear equations: the extreme rays of a cone.

Method: the algorithm of Farkas, as Colom and Silva put it (1991, "Convex geometry and semiflows in P/T nets"), which
is the double description method of Motzkin and others (1953). At first there is a row for each variable, alone. One
equation after the other is met: rows that meet it stay, and each row above it is combined with each row below it,
such that they cancel. A combination is an extreme ray only if its support contains that of no third row, which is
seen before it is made. What remains after each equation are exactly the minimal solutions of the equations met so far.
Integers throughout, each row divided by its greatest common divisor.

Order decides everything: next is the equation by which the table grows least (for most of them it shrinks). Rows and
equations are sparse, and a third row is looked for only where the supports lie, so that a net of a thousand small
machines costs a thousand times one of them.

The number of solutions can be exponential, so rows are bounded, and there may be a deadline. Past either the list holds
the rows that meet every equation by then, and is not `complete`; they are minimal all the same, because an extreme
ray of a cone that lies in a smaller cone is an extreme ray of that one too. The rejected alternative, to keep all
combinations and drop what is not minimal afterwards, makes a hundred times as many rows as it keeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from math import gcd
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.linear import Sparse, distinct

_POLL_PAIRS: Final = 64


@dataclass(frozen=True, slots=True)
class Semiflows:
    """Minimal semi-positive solutions, each by its entries that are not 0; all of them if `complete`."""

    vectors: tuple[dict[int, int], ...]
    complete: bool


@dataclass(slots=True)
class _Row:
    """A solution of the equations met so far; `rest` holds its values in the others, `support` is a bit mask."""

    support: int
    solution: dict[int, int]
    rest: dict[int, int]


@dataclass(slots=True)
class _Table:
    """The rows by number, those that do not meet an equation by its number, and each row at one of its variables."""

    rows: dict[int, _Row] = field(default_factory=dict)
    unmet: list[set[int]] = field(default_factory=list)
    above: list[int] = field(default_factory=list)  # how many of the unmet are positive
    at: list[set[int]] = field(default_factory=list)
    next_number: int = 0

    def add(self, row: _Row) -> None:
        self.rows[self.next_number] = row
        for equation, value in row.rest.items():
            self.unmet[equation].add(self.next_number)
            self.above[equation] += value > 0
        self.at[_lowest(row.support)].add(self.next_number)
        self.next_number += 1

    def remove(self, number: int) -> None:
        row = self.rows.pop(number)
        for equation, value in row.rest.items():
            self.unmet[equation].discard(number)
            self.above[equation] -= value > 0
        self.at[_lowest(row.support)].discard(number)

    def growth(self, equation: int) -> int:
        """By how many rows meeting an equation may make the table grow."""
        above = self.above[equation]
        below = len(self.unmet[equation]) - above
        return above * below - above - below

    def holds_third(self, first: int, second: int) -> bool:
        """Whether a third row lies within the supports of two, so that their combination is not minimal."""
        together = self.rows[first].support | self.rows[second].support
        variables = self.rows[first].solution.keys() | self.rows[second].solution.keys()
        for variable in variables:
            for number in self.at[variable]:
                if self.rows[number].support | together == together and number not in (first, second):
                    return True
        return False


def minimal_semiflows(
    equations: Sequence[Sparse], n_variables: int, *, rows_max: int, deadline: Deadline = NEVER
) -> Semiflows:
    """The solutions y >= 0 of minimal support, without a common divisor, over the variables 0 to n - 1.

    `rows_max` bounds the rows of the table (or the number of variables does, where there are more).

    >>> minimal_semiflows([{0: 1, 1: -2}, {2: 1, 3: 1}], 5, rows_max=100).vectors
    ({0: 2, 1: 1}, {4: 1})
    """
    kept = distinct(equations)
    columns: list[dict[int, int]] = [{} for _ in range(n_variables)]
    for number, equation in enumerate(kept):
        for variable, coefficient in equation.items():
            columns[variable][number] = coefficient
    table = _Table(unmet=[set() for _ in kept], above=[0] * len(kept), at=[set() for _ in range(n_variables)])
    for variable, column in enumerate(columns):
        table.add(_Row(1 << variable, {variable: 1}, column))
    growths = {number: table.growth(number) for number in range(len(kept))}
    queue = [(growth, number) for number, growth in growths.items()]
    heapify(queue)
    while queue:
        growth, next_met = heappop(queue)
        if growths.get(next_met) != growth:
            continue
        del growths[next_met]
        changed = _meet(table, next_met, max(rows_max, n_variables), deadline)
        if changed is None:
            return _finished(table, complete=False)
        for number in changed & growths.keys():
            if (now := table.growth(number)) != growths[number]:
                growths[number] = now
                heappush(queue, (now, number))
    return _finished(table, complete=True)


def _meet(table: _Table, equation: int, most: int, deadline: Deadline) -> set[int] | None:
    """Make all rows meet an equation; the equations whose rows changed, or None where a bound came first."""
    numbers = sorted(table.unmet[equation])
    above = [number for number in numbers if table.rows[number].rest[equation] > 0]
    below = [number for number in numbers if table.rows[number].rest[equation] < 0]
    made: list[_Row] = []
    for count, up in enumerate(above):
        for place, down in enumerate(below):
            if (count * len(below) + place) % _POLL_PAIRS == 0 and deadline.over:
                return None
            if not table.holds_third(up, down):
                made.append(_combined(table.rows[up], table.rows[down], equation))
                if len(table.rows) - len(numbers) + len(made) > most:
                    return None
    changed = {number for row in numbers for number in table.rows[row].rest}
    for number in numbers:
        table.remove(number)
    for row in made:
        table.add(row)
    return changed


def _combined(up: _Row, down: _Row, equation: int) -> _Row:
    a, b = -down.rest[equation], up.rest[equation]
    solution = _sum(up.solution, a, down.solution, b)
    rest = _sum(up.rest, a, down.rest, b)
    divisor = gcd(*solution.values())  # divides the rest too, which is the solution times the equations
    if divisor != 1:
        solution = {variable: x // divisor for variable, x in solution.items()}
        rest = {number: x // divisor for number, x in rest.items()}
    return _Row(up.support | down.support, solution, rest)


def _sum(left: Sparse, a: int, right: Sparse, b: int) -> dict[int, int]:
    total = {key: a * x for key, x in left.items()}
    for key, x in right.items():
        if value := total.get(key, 0) + b * x:
            total[key] = value
        else:
            del total[key]
    return total


def _finished(table: _Table, *, complete: bool) -> Semiflows:
    found = sorted(sorted(row.solution.items()) for row in table.rows.values() if not row.rest)
    return Semiflows(tuple(map(dict, found)), complete)


def _lowest(support: int) -> int:
    return (support & -support).bit_length() - 1
