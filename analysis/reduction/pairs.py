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

The engine finds it as the structural concurrency relation of a net whose places are the literals
(`analysis/engine/src/concurrency.rs`).

Cost: a matrix of literals by literals in bytes; each move is looked at again when a pair of its needs has changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from firable.analysis._engine import BudgetExceeded, pairs_together
from firable.analysis.compiled import Row, engine_limits
from firable.analysis.deadline import Deadline
from firable.analysis.reduction.draft import Draft, Literal, Move, literal

MATRIX_BYTES_MAX: Final = 256 * 2**20
WORDS_MAX: Final = 2**32
"""Words of rows that are read, at most: some seconds."""
_WORD: Final = 64  # literals in a word
_FEW: Final = 16  # needs of a move whose pairs are looked at one by one

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
        if len(rows) <= _FEW:
            cells, size = self.cells, len(self.numbers)
            return any(not cells[one * size + other] for at, one in enumerate(rows) for other in rows[: at + 1])
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
        bound = _packed(known.together[np.ix_(rows, rows)])
    try:
        found = pairs_together(
            size,
            [_row(move, numbers) for move in draft.moves.values()],
            [numbers[literal(place, draft.values[place])] for place in order],
            bound,
            max_words=WORDS_MAX,
            **engine_limits(deadline),
        )
    except BudgetExceeded:
        return None
    return None if found is None else Pairs(numbers, _unpacked(found, size))


def _row(move: Move, numbers: Mapping[Literal, int]) -> Row:
    """A move as the engine takes it, with literals in place of places."""
    flipped = [numbers[one ^ 1] for one in move.made]
    made = [numbers[one] for one in move.made]
    return flipped, made, [numbers[literal(place, move.needs[place])] for place in move.reads], [], []


def _packed(matrix: Matrix) -> bytes:
    """Rows of bits in whole words."""
    columns = np.zeros((len(matrix), -len(matrix) % _WORD), dtype=np.bool_)
    return np.packbits(np.hstack([matrix, columns]), axis=1, bitorder="little").tobytes()


def _unpacked(rows: bytes, size: int) -> Matrix:
    bits = np.frombuffer(rows, dtype=np.uint8).reshape(size, -1 if size else 0)
    return np.unpackbits(bits, axis=1, count=size, bitorder="little").view(np.bool_)
