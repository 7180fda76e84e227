"""The bits of a mask, such as the places of a marking: an `int`, bit i for place i."""

from __future__ import annotations

from collections.abc import Iterator


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
