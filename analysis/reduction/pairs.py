"""Which pairs of literals are never true together: facts that the rules of this folder rest on.

A net whose every marking respects "never both a and b" is understood far better by looking at its arcs: that an output
place is empty when the inputs are marked, that a gate is implied by an input, that a transition can never fire. All
one-token invariants have this form (of the positions of one robot, no two hold), and so have their complements and
what gates enforce.

Method: the strongest set of such pairs that is inductive, by propagation of its complement. At first, the pairs of
literals that are true together in M0 are possible. A move whose needs are possible pairwise may be made; after it,
what it made is true together with what it read, and with each literal that was possible together with all of its
needs. The least fixpoint contains all pairs that are true together in a reachable marking (Haslum and Geffner 2000,
"Admissible heuristics for optimal planning": h²; in nets the concurrency relation of Kovalyov 1992, made exact for
the arcs of both signs). What was known before the draft changed stays true, by the contract, and bounds what may
become possible.

Rejected: P-invariants, which know nothing of gates and contact and of which there may be exponentially many. Also
rejected: one-token units (`firable.analysis.structure.cover`) as a first, cheaper source of facts; it took as long.

A fixpoint that was not reached is no fact at all, so past the work allowed or the deadline there are none.

Cost: a matrix of literals by literals in bytes; each move is looked at again when a pair of its needs has changed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from firable.analysis.deadline import Deadline
from firable.analysis.reduction.draft import Draft, Literal, Move, literal

MATRIX_BYTES_MAX: Final = 256 * 2**20
WORK_MAX: Final = 20_000_000_000
"""Bytes of the matrix that are read, at most: some seconds."""
_LOOK: Final = 20_000  # what looking at a move costs besides, in the same unit
_POLL: Final = 256

Matrix = npt.NDArray[np.bool_]


class Facts(Protocol):
    """What is known of pairs of literals."""

    def excluded_by(self, one: Literal) -> Callable[[Literal], bool]:
        """Whether a literal is never true together with this one, as a function of it."""
        ...


@dataclass(frozen=True, slots=True)
class NoFacts:
    """What is known of any net: a place is not both marked and empty."""

    def excluded_by(self, one: Literal) -> Callable[[Literal], bool]:
        """Whether a literal is never true together with this one, as a function of it."""
        return lambda other: other == one ^ 1


@dataclass(frozen=True)
class Pairs:
    """The pairs of literals that may be true together in a reachable marking; all others never are.

    `numbers` are the rows of the matrix by literal; a literal of a place that was not in the draft has none.
    """

    numbers: dict[Literal, int]
    together: Matrix

    @cached_property
    def cells(self) -> memoryview:
        """The matrix, row after row, one byte for each pair."""
        return self.together.view(np.uint8).reshape(-1).data

    def exclude(self, one: Literal, other: Literal) -> bool:
        """Whether the two are never true together."""
        return not self.cells[self.numbers[one] * len(self.numbers) + self.numbers[other]]

    def excluded_by(self, one: Literal) -> Callable[[Literal], bool]:
        """Whether a literal is never true together with this one, as a function of it."""
        start, numbers = self.numbers[one] * len(self.numbers), self.numbers
        row = self.cells[start : start + len(numbers)]
        return lambda other: not row[numbers[other]]

    def dead(self, move: Move) -> bool:
        """Whether the move can never be made."""
        rows = [self.numbers[need] for need in move.literals]
        return not bool(self.together[np.ix_(rows, rows)].all())


def pairs(
    draft: Draft, known: Pairs | None, deadline: Deadline, matrix_bytes_max: int = MATRIX_BYTES_MAX
) -> Pairs | None:
    """The facts on the draft as it is, at least those `known`; None past the work or memory allowed or the deadline."""
    order = sorted(draft.places)
    numbers = {literal(place, value): 2 * i + value for i, place in enumerate(order) for value in (False, True)}
    size = len(numbers)
    if size * size > matrix_bytes_max or deadline.over:
        return None
    bound = None
    if known is not None:
        rows = np.array([known.numbers[one] for one in numbers], dtype=np.intp)
        bound = known.together[np.ix_(rows, rows)]
    initial = np.zeros(size, dtype=np.bool_)
    initial[[numbers[literal(place, draft.values[place])] for place in order]] = True
    together = np.outer(initial, initial)
    if not _propagate(draft, numbers, together, bound, deadline):
        return None
    return Pairs(numbers, together)


def _propagate(
    draft: Draft, numbers: dict[Literal, int], together: Matrix, bound: Matrix | None, deadline: Deadline
) -> bool:
    """Close `together` under the moves, within `bound`; False where that ended early."""
    size, work, looked = len(numbers), 0, 0
    changed = np.ones(size, dtype=np.int64)  # when the row of a literal changed last
    moves = [_Rows(move, numbers) for move in _from_the_start(draft)]
    now = 1
    again = True
    while again:
        again = False
        for move in moves:
            looked += 1
            work += _LOOK
            if looked % _POLL == 0 and (work > WORK_MAX or deadline.over):
                return False
            if len(move.needs) and changed[move.needs].max() <= move.looked:
                continue
            if not len(move.needs) and move.looked:
                continue
            move.looked = now
            work += size * (len(move.needs) + 2 * len(move.made))
            possible: Matrix = np.logical_and.reduce(together[move.needs])
            if not possible[move.needs].all():
                continue
            possible[move.own] = False
            possible[move.after] = True
            now += 1
            for made in move.made:
                new = possible & ~together[made]
                if bound is not None:
                    new &= bound[made]
                if new.any():
                    together[made] |= new
                    together[:, made] |= new
                    changed[new] = now
                    changed[made] = now
                    again = True
    return True


def _from_the_start(draft: Draft) -> list[Move]:
    """The moves in the order in which they may be made for the first time, so that a round carries a token far."""
    true = {literal(place, draft.values[place]) for place in draft.places}
    missing = {number: len(move.needs) for number, move in draft.moves.items()}
    order = [draft.moves[number] for number, count in missing.items() if not count]
    todo = deque(sorted(true))
    while todo:
        for number in sorted(draft.at[todo.popleft()]):
            missing[number] -= 1
            if not missing[number]:
                order.append(draft.moves[number])
                todo += [made for made in draft.moves[number].made if made not in true]
                true.update(draft.moves[number].made)
    return order


class _Rows:
    """A move in the numbers of the matrix, and when it was looked at last."""

    __slots__ = ("after", "looked", "made", "needs", "own")

    def __init__(self, move: Move, numbers: dict[Literal, int]) -> None:
        self.needs = np.array([numbers[need] for need in move.literals], dtype=np.intp)
        self.made = [numbers[one] for one in move.made]
        self.own = np.concatenate([self.needs, self.needs ^ 1])
        kept = [numbers[literal(place, move.needs[place])] for place in move.reads]
        self.after = np.array([*self.made, *kept], dtype=np.intp)
        self.looked = 0
