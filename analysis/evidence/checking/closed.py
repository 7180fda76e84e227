"""A large set of listed markings, closed as a rule, looked through in arrays: any formula of CTL on millions of them.

Where a transition may fire is a question to columns, one bit for each marking, by the one text of the firing rule. All
markings after it are then looked up at once, in the sorted list itself where a marking is one word, else by a hash,
with every word compared afterwards; so nothing rests on the hash. No firing is kept: each label asks for them again,
which takes a fraction of a second for a million, where keeping them as lists (`listed`) takes gigabytes.

Labels are the ranks of `listed`, under the same conditions, and each marking must have the one rank that follows from
those after it. Ranks are counted in 64 bits; one that is not smaller than the number of markings is refused before.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from itertools import count, pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Label, Ranks, Whole
from firable.analysis.evidence.checking.cubes import firings
from firable.analysis.evidence.refusal import in_time, refuse, shown
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import counted
from firable.semantics.algebra import Bitwise
from firable.semantics.formulas import evaluate

Column = npt.NDArray[np.bool_]
_Words = npt.NDArray[np.uint64]
_Numbers = npt.NDArray[np.intp]

_CHUNK: Final = 1 << 16
_WORD: Final = 64
_NO_RANK: Final = np.iinfo(np.int64).max
_NOT_ITS_RANK: Final = "{} has not the rank that follows from the ranks after it"
_NOT_ALWAYS: Final = "what is to hold always ends in {}"


class Closed:
    """Markings that are closed under single firings, and hold M0; refused where they are not."""

    def __init__(self, net: Net, markings: Sequence[Marking], deadline: Deadline = NEVER) -> None:
        self.net, self.markings, self.deadline = net, markings, deadline
        if any(one >= after for one, after in pairwise(markings)):
            refuse("the markings of the set are not in order, each once")
        self.start = bisect_left(markings, net.initial_marking)
        if self.start == len(markings) or markings[self.start] != net.initial_marking:
            refuse("the initial marking is not in the set")
        n_words = max(1, -(-len(net.places) // _WORD))
        data = b"".join(marking.to_bytes(8 * n_words, "little") for marking in in_time(markings, deadline))
        self._words: _Words = np.frombuffer(data, "<u8").reshape(-1, n_words)
        self._full = self._columns()
        self._algebra = Bitwise(true=(1 << len(markings)) - 1, false=0)
        self._firings = list(firings(net).values())
        self._keys, self._hash = self._hashed(n_words)
        self._by_hash = np.argsort(self._hash, kind="stable")
        self._hashes = self._hash[self._by_hash]
        self.n_firings = sum(len(rows) for rows, _ in self._fired())

    @property
    def method(self) -> str:
        """What was gone through, in words."""
        markings, firings = counted(len(self.markings), "marking"), counted(self.n_firings, "firing")
        return f"{markings} and {firings} looked through in columns"

    def _columns(self) -> list[int]:
        """For each place the markings in which it holds a token, as one number."""
        parts = []
        for begin in range(0, len(self._words), _CHUNK):
            rows = np.ascontiguousarray(self._words[begin : begin + _CHUNK]).view(np.uint8)
            bits = np.unpackbits(rows, axis=1, bitorder="little")[:, : len(self.net.places)]
            parts.append(np.packbits(bits, axis=0, bitorder="little"))
        packed = np.ascontiguousarray(np.concatenate(parts).T)
        return [int.from_bytes(row.tobytes(), "little") for row in packed]

    def _hashed(self, n_words: int) -> tuple[_Words, _Words]:
        """For each place a key, and of each marking the exclusive or of the keys of those that hold a token.

        A firing changes the hash by the keys of the places that it flips. Of one word the marking is its own hash.
        """
        if n_words == 1:
            return np.left_shift(np.uint64(1), np.arange(len(self.net.places), dtype=np.uint64)), self._words[:, 0]
        for seed in count():
            keys = np.random.default_rng(seed).integers(0, 2**_WORD, len(self.net.places), dtype=np.uint64)
            found = np.zeros(len(self.markings), dtype=np.uint64)
            for p in in_time(range(len(self.net.places)), self.deadline):
                found ^= (self._words[:, p // _WORD] >> np.uint64(p % _WORD) & np.uint64(1)) * keys[p]
            if len(np.unique(found)) == len(found):  # two markings with one hash would hide each other
                break
        return keys, found

    def _fired(self) -> Iterator[tuple[_Numbers, _Numbers]]:
        """For each transition in which markings it may fire, and the markings after; refused where one is not there."""
        for needs, flips in in_time(self._firings, self.deadline):
            literals = (self._full[p] if value else self._algebra.negation(self._full[p]) for p, value in needs.items())
            if where := self._algebra.conjunction(literals):
                rows = np.flatnonzero(self._column(where))
                yield rows, self._after(rows, flips)

    def _after(self, rows: _Numbers, flips: frozenset[int]) -> _Numbers:
        changed, key = 0, np.uint64(0)
        for p in flips:
            changed |= 1 << p
            key ^= self._keys[p]
        at = np.searchsorted(self._hashes, self._hash[rows] ^ key)
        found = self._by_hash[np.minimum(at, len(self._hashes) - 1)]
        same = np.ones(len(rows), dtype=np.bool_)
        for k in range(self._words.shape[1]):
            part = np.uint64(changed >> _WORD * k & 2**_WORD - 1)
            same &= self._words[rows, k] ^ part == self._words[found, k]
        if not same.all():
            outside = self.markings[int(rows[np.argmin(same)])] ^ changed
            refuse(f"a firing leads out of the set, to {shown(self.net, outside)}")
        return found

    def _column(self, number: int) -> Column:
        data = np.frombuffer(number.to_bytes(-(-len(self.markings) // 8), "little"), np.uint8)
        return np.unpackbits(data, bitorder="little")[: len(self.markings)].astype(np.bool_)

    # What a labelling asks.

    def holds_initially(self, column: Column) -> bool:
        """Whether M0 is in a subset."""
        return bool(column[self.start])

    def where(self, formula: Formula) -> Column:
        """The markings in which a state formula holds."""
        return self._column(evaluate(self._algebra, self.net, formula, self._full.__getitem__))

    def all_of(self, sets: Iterable[Column]) -> Column:
        """The markings in all of the subsets."""
        found: Column = np.logical_and.reduce(list(sets))
        return found

    def any_of(self, sets: Iterable[Column]) -> Column:
        """The markings in some of the subsets."""
        found: Column = np.logical_or.reduce(list(sets))
        return found

    def neighbours(self, targets: Column, *, every: bool) -> Column:
        """The markings of which every next marking, or some, is a target."""
        found = np.full(len(self.markings), every)
        for rows, after in self._fired():
            found[rows] = found[rows] & targets[after] if every else found[rows] | targets[after]
        return found

    def least(self, label: Label, through: Column, end: Column, *, every: bool) -> Column:
        """The markings with a rank: 0 in the end, elsewhere one more than the nearest next one has, or the farthest."""
        ranks = self._ranks(label)
        ranked = np.where(ranks < 0, _NO_RANK, ranks)
        above = np.full(len(ranks), -1 if every else _NO_RANK)
        for rows, after in self._fired():
            above[rows] = (np.maximum if every else np.minimum)(above[rows], ranked[after])
        goes_on = through & (above >= 0) & (above < _NO_RANK)
        self._require(ranks == np.where(end, 0, np.where(goes_on, above + goes_on, -1)), _NOT_ITS_RANK)
        return ranks >= 0

    def greatest(self, label: Label, end: Column, through: Column, *, every: bool) -> Column:
        """The markings with rank 0: `through` holds there, and with it the end, or a next one has a rank, or all.

        The others have -1, and none of them could have a rank because those after it have.
        """
        ranks = np.zeros(len(self.markings), dtype=np.int64) if isinstance(label, Whole) else self._ranks(label)
        ends, goes_on = np.ones(len(ranks), dtype=np.bool_), np.full(len(ranks), every)
        for rows, after in self._fired():
            ends[rows] = False
            goes_on[rows] = goes_on[rows] & (ranks[after] >= 0) if every else goes_on[rows] | (ranks[after] >= 0)
        self._require(ranks == np.where(through & (end | ends | goes_on), 0, -1), _NOT_ALWAYS)
        return ranks >= 0

    def _ranks(self, label: Label) -> npt.NDArray[np.int64]:
        if not isinstance(label, Ranks) or len(label.ranks) != len(self.markings):
            refuse("a listed set wants a rank for each marking as a label")
        if not all(-1 <= rank < len(label.ranks) for rank in label.ranks):
            refuse("no rank is as large as the number of markings")
        return np.array(label.ranks, dtype=np.int64)

    def _require(self, right: Column, wrong: str) -> None:
        if not right.all():
            refuse(wrong.format(shown(self.net, self.markings[int(np.argmin(right))])))
