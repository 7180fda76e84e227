"""Columns: sets of markings of an explored graph, one Boolean for each index, as arrays of numpy.

State formulas become columns, evaluated by the one text of the firing rule in `semantics`, on some thousand markings
at a time, eight of them to the byte, because formulas have thousands of parts. They stand apart from the
graph (`reachability.py`), because numpy takes longer to load than most nets to explore, and a graph that is only
counted, or that turns out to be too large, needs none. The rejected alternative, to evaluate formulas in Rust, would be
a second text of the firing rule to keep equal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.semantics.algebra import Bitwise

Column = npt.NDArray[np.bool_]
"""A set of markings of a graph: one Boolean for each index."""


class _Columns(Bitwise[Any]):
    """Columns count tokens by adding, which is faster than by Boolean terms."""

    def at_most(self, terms: Sequence[tuple[Any, int]], bound: int, /) -> Any:
        """Where the weights of the terms that are true sum up to at most the bound."""
        total = np.int64(0)
        for term, weight in terms:
            total = total + np.multiply(unpacked(term), np.int64(weight))
        return packed(total <= bound)


COLUMNS: Final[Bitwise[Any]] = _Columns(true=np.uint8(255), false=np.uint8(0))
"""The algebra of packed columns, eight markings to the byte; the scalars are true and false of any number of them."""


def packed(column: Any) -> Any:
    """A column, or one value for all markings, as `COLUMNS` has it."""
    return np.packbits(column) if np.ndim(column) else np.uint8(255 if column else 0)


def restored(column: Any, n_markings: int) -> Column:
    """The column of so many markings that was packed."""
    return np.unpackbits(column, count=n_markings).astype(np.bool_)


def unpacked(column: Any) -> Any:
    """The Booleans of a packed column, up to seven too many, or the one value of a scalar."""
    return np.unpackbits(column).astype(np.bool_) if np.ndim(column) else np.bool_(column)


NO_COMPONENT: Final = 2**32 - 1
"""Stands for the component of a marking that is in none."""


def words_of(markings: bytes, words: int) -> npt.NDArray[np.uint64]:
    """Markings of so many words each, end to end, as rows."""
    return np.frombuffer(markings, "<u8").reshape(-1, words)


def order(rows: npt.NDArray[np.uint64]) -> npt.NDArray[np.intp]:
    """The numbers of rows, that of the smallest marking first."""
    return np.lexsort(rows.T)  # the last key counts most, as the last word does


def masks(rows: npt.NDArray[np.uint64]) -> list[int]:
    """The markings of rows, as bit masks over the places."""
    if rows.shape[1] == 1:
        return list[int](rows[:, 0].tolist())
    data, size = rows.tobytes(), 8 * rows.shape[1]
    return [int.from_bytes(data[begin : begin + size], "little") for begin in range(0, len(data), size)]


PART: Final = 1 << 18
"""So many markings make a part, on which terms are evaluated together."""


class Room:
    """So many bytes for columns that are kept, because questions are many and of the same things."""

    def __init__(self, size_bytes: int) -> None:
        self._left = size_bytes

    def takes(self, packed_column: Any) -> bool:
        """Whether there is room for one more, which is used up then."""
        fits = bool(packed_column.nbytes <= self._left)
        self._left -= packed_column.nbytes if fits else 0
        return fits


class Places:
    """Which markings of a graph hold a place, packed, part by part; what was read once is kept where there is room."""

    def __init__(self, rows: npt.NDArray[np.uint64], room: Room) -> None:
        self._rows, self._room = rows, room
        self._kept: dict[tuple[int, int], Any] = {}

    def reader(self, start: int) -> Callable[[int], Any]:
        """What reads a place in each marking of the part from `start` on."""
        return cache(partial(self._holds, start))

    def _holds(self, start: int, place: int) -> Any:
        if (kept := self._kept.get((start, place))) is not None:
            return kept
        found = packed((self._rows[start : start + PART, place // 64] & np.uint64(1 << place % 64)) != 0)
        if self._room.takes(found):
            self._kept[start, place] = found
        return found


def column(bitmap: bytes) -> Column:
    """The column of a byte for each marking."""
    return np.frombuffer(bitmap, np.uint8).astype(np.bool_)


def constant(n_markings: int, *, holds: bool) -> Column:
    """All markings or none."""
    return np.full(n_markings, holds, dtype=np.bool_)


def numbers(found: bytes) -> npt.NDArray[np.uint32]:
    """Numbers of 32 bits, end to end."""
    return np.frombuffer(found, "<u4")


def size(markings: Column) -> int:
    """How many markings a set holds."""
    return int(np.count_nonzero(markings))


def first(markings: Column) -> int | None:
    """The lowest marking of a set, which is one nearest to M0; None where the set is empty."""
    index = int(np.argmax(markings)) if len(markings) else 0
    return index if len(markings) and markings[index] else None


def fullest(held: Places, places: Sequence[int], n_markings: int, deadline: Deadline) -> tuple[int, Column]:
    """The greatest number of tokens on places together, and the markings with as many.

    Raises `BudgetExceeded` where the deadline comes first.
    """
    tokens = np.zeros(n_markings, np.uint32)
    for start in range(0, n_markings, PART):
        if start and deadline.over:
            raise BudgetExceeded("the time was over")
        part, reader = tokens[start : start + PART], held.reader(start)
        for place in places:
            part += unpacked(reader(place))[: len(part)]
    most = int(tokens.max())
    return most, tokens == most


def some(markings: Column) -> int:
    """One marking of a set that is not empty, drawn at random, the same of the same set."""
    among = np.flatnonzero(markings)
    return int(among[np.random.default_rng(len(among)).integers(len(among))])
