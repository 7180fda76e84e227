"""Which transitions are enabled, kept up to date by the bits that have changed.

A firing changes a handful of bits. Only the transitions that read one of them can have become enabled or disabled, so
only they are looked at again; a transition that nothing touched costs nothing, however many there are. It is the idea
of Rete (Forgy, 1982) for rules whose conditions are sets of bits, with one level: for each bit, who reads it, and for
each transition, how many bits are not yet as it wants them.

The set is itself a mask, bit t for transition t, so that it is compared, cut and searched in a few machine words.
Whoever asks says the word of now, and what has changed since the last question is seen by comparison: so no change
can be forgotten by those who make it. Rejected: to be told of each change and of nothing else, which can be forgotten.

A cell goes round, and asks again and again of the same words: the answers to the last `KNOWN_MAX` of them are known.
A word of thousands of bits rarely comes again, and to look it up or to compare it takes longer than the firing. So who
makes a step may say which (`said`). It is believed where it leads from the very word that is counted to the very word
that is asked of; of all else the question compares, as ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from typing import Final, Self

from firable.nets.bits import bits

Word = int
Literal = int
"""A bit and a value of it: 2 i where bit i is 0, 2 i + 1 where it is 1."""

KNOWN_MAX: Final = 1024
"""So many words are remembered; then all are forgotten."""
WIDE_BITS: Final = 1024
"""Words of more bits are wide: none is remembered."""


class EnabledSet:
    """The enabled ones among conditions `(needs, forbids)`: all bits of `needs` are set and none of `forbids`.

    Words have `width` bits at most.

    >>> watched = EnabledSet([(0b001, 0b010), (0b010, 0b100)], 3)
    >>> [f"{watched.at(word):02b}" for word in (0b001, 0b010, 0b110, 0b000)]
    ['01', '10', '00', '00']
    """

    def __init__(self, conditions: Sequence[tuple[Word, Word]], width: int) -> None:
        wanting: list[list[int]] = [[] for _ in range(2 * width)]
        for t, (needs, forbids) in enumerate(conditions):
            for bit in bits(needs):
                wanting[literal(bit, value=True)].append(t)
            for bit in bits(forbids):
                wanting[literal(bit, value=False)].append(t)
        who = [tuple(those) for those in wanting]
        self._readers = tuple((who[one], who[one ^ 1]) for one in range(2 * width))
        """For each literal, who wants it, and who wants its contrary; who wants both is never enabled."""
        self._missed = [needs.bit_count() for needs, _ in conditions]
        """For each condition, how many bits are not as it wants them in the word that is counted."""
        self._holds = bytearray((True, False) * width)
        """The literals that hold there."""
        self._word = 0
        """That word."""
        self._mask = sum(1 << t for t, missed in enumerate(self._missed) if not missed)
        """Those enabled there."""
        self._asked, self._answer = self._word, self._mask
        """The last question, and its answer, which may have been known."""
        self._known: dict[Word, int] = {}
        self._is_wide = width > WIDE_BITS
        self.said: tuple[Word, Word, Sequence[Literal]] = (0, 0, ())
        """A step that was made: a word, the word after it, and the literals that it made hold, one after the other."""

    def __copy__(self) -> Self:
        """A set that goes its own way from here; the tables, which do not change, are shared, and what is known."""
        made = object.__new__(type(self))
        vars(made).update(vars(self) | {"_missed": copy(self._missed), "_holds": copy(self._holds)})
        return made

    def at(self, word: Word) -> int:
        """The mask of those enabled at a word; time linear in those that read a bit that has changed."""
        if word is self._asked:
            return self._answer
        mask = None if self._is_wide else self._known.get(word)
        if mask is None:
            before, after, step = self.said
            if before is self._word and after is word:
                self._count(step)
            else:
                self._count([literal(bit, value=bool(self._holds[2 * bit])) for bit in bits(self._word ^ word)])
            self._word, mask = word, self._mask
            if not self._is_wide:
                if len(self._known) >= KNOWN_MAX:
                    self._known.clear()
                self._known[word] = mask
        self._asked, self._answer = word, mask
        return mask

    def _count(self, step: Iterable[Literal]) -> None:
        readers, missed, holds = self._readers, self._missed, self._holds
        turned: list[int] = []
        for one in step:
            if not holds[one]:
                holds[one], holds[one ^ 1] = True, False
                gaining, losing = readers[one]
                for t in gaining:
                    left = missed[t] = missed[t] - 1
                    if not left:
                        turned.append(t)
                for t in losing:
                    left = missed[t]
                    if not left:
                        turned.append(t)
                    missed[t] = left + 1
        if turned:  # they stand mostly side by side, and a mask may be wide: so it is copied once
            lowest, near = min(turned), 0
            for t in turned:
                near ^= 1 << t - lowest
            self._mask ^= near << lowest


def literal(bit: int, *, value: bool) -> Literal:
    """The literal of a bit and a value."""
    return 2 * bit + value


def first_behind(mask: int, last: int) -> int:
    """The position of the first bit that is set behind `last`, or else of the first one; the mask must not be empty.

    >>> first_behind(0b110101, 2), first_behind(0b101, 2)
    (4, 0)
    """
    first = last + 1
    ahead = mask >> first
    if not ahead:
        ahead, first = mask, 0
    for near in _NEAR:  # a mask may be wide, and what is found lies mostly near
        if found := ahead & near:
            return first + (found & -found).bit_length() - 1
    return first + (ahead & -ahead).bit_length() - 1


_NEAR: Final = tuple((1 << width) - 1 for width in (128, 1024))


def bits_behind(mask: int, last: int) -> Iterator[int]:
    """The positions of the bits that are set, from the first one behind `last`, and then those up to it.

    >>> list(bits_behind(0b110101, 2))
    [4, 5, 0, 2]
    """
    first = last + 1
    for at in bits(mask >> first):
        yield first + at
    yield from bits(mask & (1 << first) - 1)
