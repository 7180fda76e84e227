"""P- and T-invariants: the minimal semi-positive integer solutions of y C = 0 and of C x = 0.

C is the incidence matrix, C[p][t] = 1 if t puts a token on p, -1 if it takes one. Under a P-invariant y the weighted
number of tokens is the same in every reachable marking, whatever the gates do: they only forbid firings. A
T-invariant x counts firings that, if they can be fired at all, bring the marking back. A self-loop cancels, and reads
are gates.

Method: the algorithm of Farkas, as Colom and Silva put it (1991, "Convex geometry and semiflows in P/T nets"). The rows
of [I | C] are combined pairwise to cancel one column of C after the other, and a row whose support contains that of
another one is dropped, so that what remains after each column are exactly the minimal solutions so far; integers
throughout, each row divided by its greatest common divisor. Their number can be exponential, so rows are bounded, and
there may be a deadline: past either bound the result is `complete=False` and holds only the rows that were finished,
which are minimal invariants all the same, because an extreme ray of a cone that lies in a smaller cone is an extreme
ray of that one too. The dimension of the solution space is exact and cheap (rank by sympy, over the rationals). The
rejected alternative, a basis from linear algebra, has negative entries, which no engineer reads as "these places share
one token".

Every vector is multiplied out against C before it is handed out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd
from typing import Final

from sympy import QQ
from sympy.polys.matrices import DomainMatrix

from firable.analysis.deadline import NEVER, Deadline
from firable.nets.net import Marking, Net

ROWS_MAX: Final = 5_000

Matrix = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class Invariant:
    """One minimal semi-positive solution: the names in its support, with their weights, in the order of the net."""

    weights: tuple[tuple[str, int], ...]

    @property
    def support(self) -> tuple[str, ...]:
        """The places (or transitions) with a weight that is not 0."""
        return tuple(name for name, _ in self.weights)

    def tokens(self, net: Net, marking: Marking) -> int:
        """The weighted number of tokens of a P-invariant, the same in every reachable marking."""
        return sum(weight for name, weight in self.weights if marking >> net.place_index[name] & 1)

    def __str__(self) -> str:
        return " + ".join(name if weight == 1 else f"{weight} {name}" for name, weight in self.weights)


@dataclass(frozen=True, slots=True)
class Invariants:
    """The minimal semi-positive invariants of a net, and the dimension of the space of all rational ones.

    Where not `complete`, the bound on rows or the deadline was reached: all listed are minimal invariants, and there
    may be more. The dimension is None where the deadline came before it was computed.
    """

    minimal: tuple[Invariant, ...]
    dimension: int | None
    complete: bool

    def uncovered(self, names: Sequence[str]) -> tuple[str, ...]:
        """The names in no listed invariant; where not `complete` another one may still cover them."""
        covered = {name for invariant in self.minimal for name in invariant.support}
        return tuple(name for name in names if name not in covered)


def incidence(net: Net) -> Matrix:
    """The incidence matrix C, a row for each place and a column for each transition; a self-loop gives 0."""
    return tuple(
        tuple((place.name in t.outputs) - (place.name in t.inputs) for t in net.transitions) for place in net.places
    )


def p_invariants(net: Net, *, rows_max: int = ROWS_MAX, deadline: Deadline = NEVER) -> Invariants:
    """The minimal semi-positive P-invariants.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = p_invariants(catalogue_net("one_robot"))
    >>> len(found.minimal), found.dimension, found.complete
    (68, 14, True)
    """
    return _invariants(incidence(net), [place.name for place in net.places], rows_max, deadline)


def t_invariants(net: Net, *, rows_max: int = ROWS_MAX, deadline: Deadline = NEVER) -> Invariants:
    """The minimal semi-positive T-invariants."""
    names = [transition.name for transition in net.transitions]
    rows = incidence(net)
    return _invariants(tuple(tuple(row[t] for row in rows) for t in range(len(names))), names, rows_max, deadline)


def _invariants(matrix: Matrix, names: list[str], rows_max: int, deadline: Deadline) -> Invariants:
    """The minimal y >= 0 with y `matrix` = 0; `names` are those of its rows."""
    vectors, complete = _minimal_solutions(matrix, rows_max, deadline)
    columns = tuple(zip(*matrix, strict=True))
    checked = []
    for vector in vectors:
        if deadline.over:
            complete = False
            break
        if any(sum(y * entry for y, entry in zip(vector, column, strict=True)) for column in columns):
            raise AssertionError("a vector that is no invariant came out of the elimination")
        checked.append(vector)
    found = tuple(Invariant(tuple((name, y) for name, y in zip(names, v, strict=True) if y)) for v in checked)
    return Invariants(found, None if deadline.over else len(names) - rank(matrix), complete)


def rank(matrix: Matrix) -> int:
    """The rank over the rationals, exact."""
    if not matrix or not matrix[0]:
        return 0
    return int(DomainMatrix([[QQ(x) for x in row] for row in matrix], (len(matrix), len(matrix[0])), QQ).rank())


@dataclass(frozen=True, slots=True)
class _Row:
    """A row of [Y | Y C] in the elimination; `support` is that of the Y part, as a bit mask."""

    support: int
    solution: tuple[int, ...]
    rest: tuple[int, ...]


def _minimal_solutions(matrix: Matrix, rows_max: int, deadline: Deadline) -> tuple[list[tuple[int, ...]], bool]:
    n = len(matrix)
    rows = [_Row(1 << i, tuple(int(i == j) for j in range(n)), tuple(row)) for i, row in enumerate(matrix)]
    columns = set(range(len(matrix[0]))) if matrix else set()
    while columns:
        column = min(columns, key=lambda c: _growth(rows, c))
        columns.remove(column)
        kept = [row for row in rows if not row.rest[column]]
        above = [row for row in rows if row.rest[column] > 0]
        below = [row for row in rows if row.rest[column] < 0]
        # Of rows with one support at most one is minimal: they are multiples, or a smaller support is there too.
        combined: dict[int, _Row] = {row.support: row for row in kept}
        for up in above:
            for down in below:
                if up.support | down.support not in combined:
                    row = _combined(up, down, column)
                    combined[row.support] = row
                if len(combined) > rows_max:
                    return _finished(rows), False
            if deadline.over:
                return _finished(rows), False
        minimal = _minimal(combined, deadline)
        if minimal is None:
            return _finished(rows), False
        rows = minimal
    return sorted((row.solution for row in rows), reverse=True), True


def _finished(rows: list[_Row]) -> list[tuple[int, ...]]:
    return sorted((row.solution for row in rows if not any(row.rest)), reverse=True)


def _growth(rows: list[_Row], column: int) -> int:
    """By how many rows cancelling a column makes the table grow: the next column is the one where that is least."""
    above = sum(row.rest[column] > 0 for row in rows)
    below = sum(row.rest[column] < 0 for row in rows)
    return above * below - above - below


def _combined(up: _Row, down: _Row, column: int) -> _Row:
    a, b = -down.rest[column], up.rest[column]
    solution = [a * x + b * y for x, y in zip(up.solution, down.solution, strict=True)]
    rest = [a * x + b * y for x, y in zip(up.rest, down.rest, strict=True)]
    divisor = gcd(*solution)  # divides the rest too, which is the solution times C
    return _Row(up.support | down.support, tuple(x // divisor for x in solution), tuple(x // divisor for x in rest))


def _minimal(rows: dict[int, _Row], deadline: Deadline) -> list[_Row] | None:
    """The rows whose support contains the support of no other one; None where the deadline comes first."""
    found: list[_Row] = []
    for row in sorted(rows.values(), key=lambda row: row.support.bit_count()):
        if deadline.over:
            return None
        if not any(other.support & row.support == other.support for other in found):
            found.append(row)
    return found
