"""Facts about a net that is being reduced: which pairs of literals are never true together, computed by the checker.

A literal is a place with a value. What is kept is the complement: the pairs that may be true together. Those of M0 may.
Where all needs of a move may be true pairwise it may be made, and after it, what it made true may stand beside what it
read, and beside each literal that could stand beside all of its needs. The least such set holds every pair that is
true in a reachable marking, by induction over the firings: a literal beside the needs in the marking before is one
that could stand beside each of them (Haslum and Geffner 2000, "Admissible heuristics for optimal planning": h2; in
nets the concurrency relation of Kovalyov 1992). So what is not in it is a fact. Facts that were known before stay
facts, and what they exclude never comes in.

A certificate does not bring the facts, since a matrix of all literals by all would be the largest part of it, and to
look through a given one takes about as long as to compute it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.checking.cubes import Cube
from firable.analysis.evidence.refusal import TimeIsOverError

Literal: TypeAlias = tuple[int, bool]
"""A place, and whether it is full."""
Move: TypeAlias = tuple[Cube, frozenset[int]]
"""The values that a firing needs, and the places among them that it flips."""
_CLOCK_EVERY = 64


@dataclass(frozen=True)
class Facts:
    """The pairs of literals that may be true together; `rows` are the literals' numbers in the matrix."""

    rows: Mapping[Literal, int]
    together: npt.NDArray[np.bool_]

    def exclude(self, one: Literal, other: Literal) -> bool:
        """Whether two literals are never true together."""
        return not self.together[self.rows[one], self.rows[other]]


def facts_of(initial: Mapping[int, bool], moves: Iterable[Move], known: Facts | None, deadline: Deadline) -> Facts:
    """The facts on the moves from M0, given as the value of each place; raises `TimeIsOverError`."""
    rows = {(p, value): 2 * i + value for i, p in enumerate(sorted(initial)) for value in (False, True)}
    true = np.zeros(len(rows), dtype=np.bool_)
    true[[rows[literal] for literal in initial.items()]] = True
    together = np.outer(true, true)
    allowed = None
    if known is not None:
        kept = np.array([known.rows[literal] for literal in rows], dtype=np.intp)
        allowed = known.together[np.ix_(kept, kept)]
    changed = np.ones(len(rows), dtype=np.int64)  # when the row of a literal changed last
    todo = [_Rows(move, rows) for move in moves if move[1]]
    now, looked, again = 1, 0, True
    while again:
        again = False
        for move in todo:
            looked += 1
            if looked % _CLOCK_EVERY == 0 and deadline.over:
                raise TimeIsOverError
            if changed[move.needs].max() <= move.looked:
                continue
            move.looked = now
            beside: npt.NDArray[np.bool_] = np.logical_and.reduce(together[move.needs])
            if not beside[move.needs].all():
                continue
            beside[move.needs] = False
            beside[move.after] = True
            now += 1
            for made in move.made:
                new = beside & ~together[made]
                if allowed is not None:
                    new &= allowed[made]
                if new.any():
                    together[made] |= new
                    together[:, made] |= new
                    changed[new] = changed[made] = now
                    again = True
        todo.reverse()  # a token goes as far in a round whichever way the moves stand
    return Facts(rows, together)


class _Rows:
    """A move in the rows of the matrix, and when it was looked at last."""

    def __init__(self, move: Move, rows: Mapping[Literal, int]) -> None:
        needs, flips = move
        self.needs = np.array([rows[literal] for literal in needs.items()], dtype=np.intp)
        self.after = np.array([rows[p, value ^ (p in flips)] for p, value in needs.items()], dtype=np.intp)
        self.made = [rows[p, not needs[p]] for p in flips]
        self.looked = 0
