"""Units: sets of places that share their tokens one by one, found without listing all invariants.

A *unit* is a set of places such that a transition that touches it has exactly one input and exactly one output in it,
self-loops aside: within it the net is a connected state machine, and its places with weight 1 are a minimal P-invariant
(on a connected state machine all weights are equal). Almost all invariants an engineer means are units: the positions
of a robot, a buffer with its free slots, the phases of a task. A net may have exponentially many minimal invariants,
and still a few units cover all its places; with one token in it, a unit proves all its places 1-safe.

Method: from one place on, by propagation. A chosen place forbids all others on the same side of its transitions, and
needs one on the other side; where only one can be taken, it is taken; where several can, they are tried one after
the other, with a bound on the tries for each start. So a unit costs what it touches. The rejected alternatives: linear
programming, which finds weighted invariants too but a thousand places at a time, and asking a SAT solver for a unit
through each place, which builds the whole net for each question.

A *draining* set asks for less: who puts a token into it, one at most, takes one from it, and tokens may get lost. Its
number of tokens never rises, which excludes two where there was one, and it is found in the same way, going back only.

The equations may be those of transitions too: a unit is then a set of transitions of which each place touched has one
producer and one consumer, a cycle of firings that may fork and join but never chooses.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.structure.linear import Sparse, distinct

TRIES_MAX: Final = 500


@dataclass(frozen=True, slots=True)
class Cover:
    """Units, each as its variables in order, and the variables that are in none of them.

    `complete`: each variable left over was tried as a start until the tries or the possibilities ended; else the
    deadline came first.
    """

    units: tuple[tuple[int, ...], ...]
    uncovered: tuple[int, ...]
    complete: bool


def cover(
    equations: Iterable[Sparse],
    n_variables: int,
    *,
    marked: frozenset[int] = frozenset(),
    tokens_max: int | None = None,
    tries_max: int = TRIES_MAX,
    deadline: Deadline = NEVER,
) -> Cover:
    """Cover the variables 0 to n - 1 by units, greedily, with at most `tokens_max` of the `marked` ones in each.

    Cost: for each unit at best its size, at worst `tries_max` times that.

    >>> cover([{0: -1, 1: 1, 2: 1}, {1: -1, 2: -1, 0: 1}], 3)
    Cover(units=((0, 1), (0, 2)), uncovered=(), complete=True)
    """
    search = UnitSearch(equations, n_variables, marked, tokens_max)
    units: list[tuple[int, ...]] = []
    complete = True
    for start in range(n_variables):
        if start in search.covered:
            continue
        unit = search.unit(start, tries_max, deadline)
        if unit is None:
            complete = False
            break
        if unit:
            units.append(unit)
    uncovered = tuple(v for v in range(n_variables) if v not in search.covered)
    return Cover(tuple(units), uncovered, complete)


Side = tuple[int, bool]
"""An equation, and which of its two signs."""


class UnitSearch:
    """Looks for units one by one; what is in one that was found is `covered`.

    Holds the equations by their two sides, and the choice as it stands. For `draining` sets the equations are columns
    of the incidence matrix, whose sign tells inputs from outputs.
    """

    def __init__(
        self,
        equations: Iterable[Sparse],
        n_variables: int,
        marked: frozenset[int] = frozenset(),
        tokens_max: int | None = None,
        *,
        draining: bool = False,
    ) -> None:
        kept = list(equations) if draining else distinct(equations)
        self.draining = draining
        self.marked = marked
        self.tokens_max = n_variables if tokens_max is None else tokens_max
        self.covered = set[int]()
        self.sides: list[tuple[list[int], list[int]]] = [([], []) for _ in kept]
        self.standing: list[list[Side]] = [[] for _ in range(n_variables)]
        for number, equation in enumerate(kept):
            for variable, coefficient in equation.items():
                self.sides[number][coefficient > 0].append(variable)
                self.standing[variable].append((number, coefficient > 0))
        self.alone = [[side for side in sides if self._needs_across(side)] for sides in self.standing]
        self.chosen = set[int]()
        self.held: dict[Side, int] = {}  # how many are chosen on each side
        self.open: dict[Side, None] = {}
        self.tokens = 0

    def unit(self, start: int, tries_max: int = TRIES_MAX, deadline: Deadline = NEVER) -> tuple[int, ...] | None:
        """A unit through the start, the empty one where none was found; None where the deadline came first."""
        undo: list[int] = []  # the variables in the order they were taken
        branches: list[tuple[int, list[int]]] = []  # how much was done before a choice, and what is left to try
        tries, alive = 0, self._choose(start, undo)
        while True:
            if deadline.over:
                self._back(undo, 0)
                return None
            if alive and not self.open:
                unit = tuple(sorted(self.chosen))
                self.covered.update(unit)
                self._back(undo, 0)
                return unit
            if alive:
                candidates = self._candidates()
                if len(candidates) > 1:
                    branches.append((len(undo), candidates[1:][::-1]))
                alive = bool(candidates) and self._choose(candidates[0], undo)
                continue
            while branches and not branches[-1][1]:
                branches.pop()
            tries += 1
            if not branches or tries > tries_max:
                self._back(undo, 0)
                return ()
            done, others = branches[-1]
            self._back(undo, done)
            alive = self._choose(others.pop(), undo)

    def lossless(self, drains: Iterable[Iterable[int]]) -> list[bool]:
        """Of draining sets, whether each loses no token either: then its places with weight 1 are an invariant."""
        found = []
        for drain in drains:
            balance: dict[int, int] = {}
            for variable in drain:
                for number, positive in self.standing[variable]:
                    balance[number] = balance.get(number, 0) + (1 if positive else -1)
            found.append(not any(balance.values()))
        return found

    def _candidates(self) -> list[int]:
        """What may be taken for the open side that leaves the least choice, among the last few."""
        best: list[int] | None = None
        for looked, (number, positive) in enumerate(reversed(self.open)):
            found = [v for v in self.sides[number][positive] if not self._barred(v)]
            if best is None or len(found) < len(best):
                best = found
            if len(best) < 2 or looked == 8:
                break
        # New places first, since a unit is to cover much; then those that hold no token, and those with few arcs.
        return sorted(best or [], key=lambda v: (v in self.covered, v in self.marked, len(self.standing[v]), v))

    def _choose(self, variable: int, undo: list[int]) -> bool:
        """Take a variable into the unit; False where that contradicts what was taken before."""
        if self._barred(variable) or self.tokens + (variable in self.marked) > self.tokens_max:
            return False
        self.chosen.add(variable)
        self.tokens += variable in self.marked
        undo.append(variable)
        for side in self.standing[variable]:
            self.held[side] = self.held.get(side, 0) + 1
            self.open.pop(side, None)
            across = (side[0], not side[1])
            if self._needs_across(side) and not self.held.get(across):
                self.open[across] = None
        return True

    def _barred(self, variable: int) -> bool:
        """Whether another one was taken on a side where it would have to be alone."""
        return any(map(self.held.get, self.alone[variable]))

    def _needs_across(self, side: Side) -> bool:
        """Whether what is chosen on a side is alone there and needs one on the other side."""
        return side[1] or not self.draining

    def _unchoose(self, variable: int) -> None:
        self.chosen.discard(variable)
        self.tokens -= variable in self.marked
        for side in reversed(self.standing[variable]):
            self.held[side] -= 1
            across = (side[0], not side[1])
            if self._needs_across(side):
                self.open.pop(across, None)
            if not self.held[side] and self.held.get(across) and self._needs_across(across):
                self.open[side] = None

    def _back(self, undo: list[int], done: int) -> None:
        while len(undo) > done:
            self._unchoose(undo.pop())
