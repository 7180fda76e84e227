"""Which transitions are enabled, kept up to date by the bits that have changed.

A firing changes a handful of bits. Only the transitions that read one of them can have become enabled or disabled, so
only they are looked at again; a transition that nothing touched costs nothing, however many there are. It is the idea
of Rete (Forgy, 1982) for rules whose conditions are sets of bits, with one level: for each bit, who reads it.

The set is itself a mask, bit t for transition t, so that it is compared, cut and searched in a few machine words.
Whoever asks says the word of now, and what has changed since the last question is seen by comparison: so no change
can be forgotten by those who make it. Rejected: to be told of each change, which is as fast and can be forgotten.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

Word = int


class EnabledSet:
    """The enabled ones among conditions `(needs, forbids)`: all bits of `needs` are set and none of `forbids`.

    >>> watched = EnabledSet([(0b001, 0b010), (0b010, 0b100)])
    >>> [f"{watched.at(word):02b}" for word in (0b001, 0b010, 0b110, 0b000)]
    ['01', '10', '00', '00']
    """

    def __init__(self, conditions: Sequence[tuple[Word, Word]]) -> None:
        self._conditions = [(1 << t, needs, forbids) for t, (needs, forbids) in enumerate(conditions)]
        self._readers: dict[int, list[tuple[int, Word, Word]]] = {}
        for condition in self._conditions:
            _, needs, forbids = condition
            for bit in bits(needs | forbids):
                self._readers.setdefault(bit, []).append(condition)
        self._word = 0
        self._mask = sum(own for own, needs, _ in self._conditions if not needs)

    def at(self, word: Word) -> int:
        """The mask of those enabled at a word; time linear in those that read a bit that has changed."""
        changed = self._word ^ word
        if changed:
            mask = self._mask
            for bit in bits(changed):
                for own, needs, forbids in self._readers.get(bit, ()):
                    if word & needs == needs and not word & forbids:
                        mask |= own
                    else:
                        mask &= ~own
            self._word, self._mask = word, mask
        return self._mask


def bits(mask: int) -> Iterator[int]:
    """The positions of the bits that are set, from the lowest.

    >>> list(bits(0b1010))
    [1, 3]
    """
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low
