"""Columns: a property of each of many markings side by side, as one number, so that one `&` looks at all of them.

Bit i of a column says it of marking i. The columns of the places are the markings turned round, and of sets of
transitions, one for each marking, the columns of the transitions are too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

_ROWS = 4_096
"""How many rows are turned at once: a few megabytes of digits."""


def columns(rows: Sequence[int], width: int) -> list[int]:
    """The first `width` columns of a matrix of bits: bit i of column k is bit k of row i.

    >>> columns([0b01, 0b11, 0b10], 2)
    [3, 6]
    """
    parts: list[list[bytes]] = [[] for _ in range(width)]
    within = (1 << width) - 1
    for begin in range(0, len(rows), _ROWS):
        digits = "".join([f"{row & within:0{width}b}" for row in reversed(rows[begin : begin + _ROWS])])
        for k, part in enumerate(parts):
            part.append(int(digits[width - 1 - k :: width], 2).to_bytes(_ROWS // 8, "little"))
    return [int.from_bytes(b"".join(part), "little") for part in parts]


def numbers(column: int) -> Iterator[int]:
    """The numbers of the markings of which a column says yes, ascending.

    >>> list(numbers(0b10110))
    [1, 2, 4]
    """
    digits = f"{column:b}"[::-1]
    at = digits.find("1")
    while at >= 0:
        yield at
        at = digits.find("1", at + 1)
