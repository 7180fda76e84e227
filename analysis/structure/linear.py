"""Systems of linear equations with integer coefficients, sparse and exact: the rank, and a basis of the solutions.

The matrix of a net has a row for each of thousands of places, and in each equation stand the few places of one
transition. Elimination keeps it so: the next pivot is always in a shortest equation, and there a variable with the
coefficient 1 or -1, if there is one, that stands in the fewest others (Markowitz 1957, "The elimination form of the
inverse"). A transition that moves one token from one place to another says that two variables are equal, which only
renames; on nets of cells, protocols and processes next to nothing is filled in. Each equation is divided by the common
divisor of its coefficients, so that they stay small, and they are Python's integers, so that none overflows.

The rank is the number of pivots. The solutions are read off backwards: a variable that was never a pivot is free, and
each pivot is a sum of free ones. The rejected alternatives are a computer algebra's dense rational matrix, which takes
half a minute for a thousand places and cannot be interrupted, and arithmetic modulo a prime, which is faster where
much is filled in and says no more than "at least".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from heapq import heapify, heappop, heappush
from math import gcd, lcm

from firable.analysis.deadline import NEVER, Deadline

Sparse = Mapping[int, int]
"""A vector by its entries that are not 0."""


@dataclass(frozen=True, slots=True)
class Eliminated:
    """Equations in triangular form: `steps` holds each pivot variable with its equation, in the order of elimination.

    No equation holds the pivot of an earlier one.
    """

    steps: tuple[tuple[int, Sparse], ...]

    @property
    def rank(self) -> int:
        """The number of independent equations."""
        return len(self.steps)


def eliminate(equations: Iterable[Sparse], *, deadline: Deadline = NEVER) -> Eliminated | None:
    """Bring the equations, each "the sum of coefficient times variable is 0", into triangular form.

    None where the deadline came first. Cost: that of the arithmetic on what stands in the equations and is filled in.

    >>> found = eliminate([{0: 1, 1: -1}, {1: 1, 2: -1}, {0: 1, 2: -1}])
    >>> found.rank if found else None
    2
    """
    system = _System(equations)
    steps: list[tuple[int, Sparse]] = []
    while (number := system.shortest()) is not None:
        if len(steps) % 64 == 0 and deadline.over:
            return None
        pivot = system.pivot(number)
        steps.append((pivot, system.equations[number]))
        if not system.substitute(number, pivot, deadline):
            return None
    return Eliminated(tuple(steps))


def solutions(
    eliminated: Eliminated, variables: Iterable[int], *, deadline: Deadline = NEVER
) -> tuple[dict[int, int], ...] | None:
    """A basis of the rational solutions over the variables, each vector integer and without a common divisor.

    One vector for each variable that is no pivot, in their order; None where the deadline came first.

    >>> found = eliminate([{0: 1, 1: -2}, {1: 1, 2: -1}])
    >>> solutions(found, range(4)) if found else None
    ({0: 2, 1: 1, 2: 1}, {3: 1})
    """
    pivots = {pivot for pivot, _ in eliminated.steps}
    vectors: dict[int, dict[int, Fraction]] = {v: {v: Fraction(1)} for v in variables if v not in pivots}
    # What each variable is, as a sum of free ones.
    values: dict[int, dict[int, Fraction]] = {v: {v: Fraction(1)} for v in vectors}
    for number, (pivot, equation) in enumerate(reversed(eliminated.steps)):
        if number % 64 == 0 and deadline.over:
            return None
        total: dict[int, Fraction] = {}
        for variable, coefficient in equation.items():
            if variable != pivot:
                share = Fraction(-coefficient, equation[pivot])
                for free, factor in values[variable].items():
                    total[free] = total.get(free, 0) + share * factor
        values[pivot] = {free: factor for free, factor in total.items() if factor}
        for free, factor in values[pivot].items():
            vectors[free][pivot] = factor
    return tuple(_integer(vector) for vector in vectors.values())


def _integer(vector: Mapping[int, Fraction]) -> dict[int, int]:
    scale = lcm(*(x.denominator for x in vector.values()))
    whole = {v: int(vector[v] * scale) for v in sorted(vector)}
    divisor = gcd(*whole.values())
    return {v: x // divisor for v, x in whole.items()}


def distinct(equations: Iterable[Sparse]) -> list[dict[int, int]]:
    """The equations without those that say the same: many transitions have the same arcs, or one undoes another.

    >>> distinct([{0: 1, 1: -1}, {1: 1, 0: -1}, {}])
    [{0: 1, 1: -1}]
    """
    found = {tuple(_reduced(equation).items()) for equation in equations}
    return [dict(equation) for equation in sorted(found) if equation]


class _System:
    """The equations that are left, with where each variable stands and a queue of them by their length."""

    def __init__(self, equations: Iterable[Sparse]) -> None:
        self.equations = distinct(equations)
        self.left = set(range(len(self.equations)))
        self.standing: dict[int, set[int]] = {}
        for number, equation in enumerate(self.equations):
            for variable in equation:
                self.standing.setdefault(variable, set()).add(number)
        self.degree = {variable: len(where) for variable, where in self.standing.items()}
        self.queue = [(len(equation), number) for number, equation in enumerate(self.equations)]
        heapify(self.queue)

    def shortest(self) -> int | None:
        """The number of a shortest equation, which is taken out; None where no more are left."""
        while self.queue:
            length, number = heappop(self.queue)
            if number in self.left and len(self.equations[number]) == length:
                self.left.discard(number)
                return number
        return None

    def pivot(self, number: int) -> int:
        """The variable of an equation by which the least is filled in.

        Of equal ones that with the fewest arcs: what stays free then is what many share, and the solutions are short.
        """
        equation = self.equations[number]
        return min(equation, key=lambda v: (abs(equation[v]), len(self.standing[v]), self.degree[v], v))

    def substitute(self, number: int, pivot: int, deadline: Deadline) -> bool:
        """Take the pivot out of all equations that are left; False where the deadline came first."""
        equation = self.equations[number]
        for variable in equation:
            self.standing[variable].discard(number)
        a = equation[pivot]
        for count, other in enumerate(self.standing.pop(pivot)):
            if count % 256 == 255 and deadline.over:
                return False
            target = self.equations[other]
            b = target.pop(pivot)
            factor = gcd(a, b)
            times, less = a // factor, b // factor
            if times < 0:
                times, less = -times, -less
            if times != 1:
                for variable in target:
                    target[variable] *= times
            for variable, coefficient in equation.items():
                if variable == pivot:
                    continue
                if not (value := target.get(variable, 0) - less * coefficient):
                    del target[variable]
                    self.standing[variable].discard(other)
                else:
                    if variable not in target:
                        self.standing[variable].add(other)
                    target[variable] = value
            if times != 1 or abs(less) != 1:
                target = self.equations[other] = _reduced(target)
            if target:
                heappush(self.queue, (len(target), other))
            else:
                self.left.discard(other)
        return True


def _reduced(equation: Sparse) -> dict[int, int]:
    """Without zeros and without a common divisor; the first coefficient is positive, so that equal ones are equal."""
    kept = {variable: equation[variable] for variable in sorted(equation) if equation[variable]}
    if not kept:
        return kept
    divisor = gcd(*kept.values())
    if next(iter(kept.values())) < 0:
        divisor = -divisor
    return kept if divisor == 1 else {variable: x // divisor for variable, x in kept.items()}
