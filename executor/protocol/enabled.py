"""Which transitions are enabled, kept up to date by the bits that have changed.

A firing changes a handful of bits. Only the transitions that read one of them can have become enabled or disabled, so
only they are looked at again; a transition that nothing touched costs nothing, however many there are. It is the idea
of Rete (Forgy, 1982) for rules whose conditions are sets of bits, with one level: for each bit, who reads it.

The set is itself a mask, bit t for transition t, so that it is compared, cut and searched in a few machine words.
Whoever asks says the word of now, and what has changed since the last question is seen by comparison: so no change
can be forgotten by those who make it. Rejected: to be told of each change, which is as fast and can be forgotten.

A cell goes round, and asks again and again of the same words: the answers to the last `KNOWN_MAX` of them are known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

Word = int

KNOWN_MAX: Final = 1024
"""So many words are remembered; then all are forgotten."""


class EnabledSet:
    """The enabled ones among conditions `(needs, forbids)`: all bits of `needs` are set and none of `forbids`.

    >>> watched = EnabledSet([(0b001, 0b010), (0b010, 0b100)])
    >>> [f"{watched.at(word):02b}" for word in (0b001, 0b010, 0b110, 0b000)]
    ['01', '10', '00', '00']
    """

    def __init__(self, conditions: Sequence[tuple[Word, Word]]) -> None:
        self._readers: dict[int, list[tuple[int, Word, Word]]] = {}
        """For each bit, who reads it: the own bit in the mask, the bits that are read, and those of them to be set.

        A condition that wants a bit both ways wants one more, which no word has.
        """
        self._word = 0
        self._mask = 0
        self._known: dict[Word, int] = {}
        for t, (needs, forbids) in enumerate(conditions):
            condition = (1 << t, needs | forbids, needs if not needs & forbids else -1)
            for bit in bits(needs | forbids):
                self._readers.setdefault(bit, []).append(condition)
            if not needs:
                self._mask |= 1 << t

    def at(self, word: Word) -> int:
        """The mask of those enabled at a word; time linear in those that read a bit that has changed."""
        mask = self._known.get(word)
        if mask is None:
            changed, mask, readers, bit = self._word ^ word, self._mask, self._readers, -1
            while changed:  # `bits`, written out: it is on the way of each signal
                skipped = (changed & -changed).bit_length()
                bit += skipped
                changed >>= skipped
                for own, read, needs in readers.get(bit, ()):
                    if (word & read == needs) is not (mask & own != 0):
                        mask ^= own
            if len(self._known) >= KNOWN_MAX:
                self._known.clear()
            self._known[word] = mask
        self._word, self._mask = word, mask
        return mask


def bits(mask: int) -> Iterator[int]:
    """The positions of the bits that are set, from the lowest.

    >>> list(bits(0b1010))
    [1, 3]
    """
    at = -1
    while mask:
        skipped = (mask & -mask).bit_length()
        at += skipped
        yield at
        mask >>= skipped  # after the first, neighbours are found in a few digits, however wide the mask was


def bits_behind(mask: int, last: int) -> Iterator[int]:
    """The positions of the bits that are set, from the first one behind `last`, and then those up to it.

    >>> list(bits_behind(0b110101, 2))
    [4, 5, 0, 2]
    """
    first = last + 1
    for at in bits(mask >> first):
        yield first + at
    yield from bits(mask & (1 << first) - 1)
