"""Points of Modbus devices: what an address means, and which of them one request reads or writes.

Points are `coil N`, `discrete N`, `input N` and `holding N`, with addresses from 0 as they stand on the wire, and
`holding N.B` or `input N.B` for a bit of a register, from 0. A number has one spelling, so that points can be compared
as they are written: `holding 010` would be the register of `holding 10`, and look like another.

Manuals number by the table as well, and from 1: 40012 is `holding 11`. That is told of a number without a table; and
since a device may have so high an address, too, `holding 40012` is refused where the binding does not say which is
meant. Rejected: to take either for it, which is another register for whoever means the other.

Those next to each other go into one request, never with a gap, because a device may refuse what is not there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Final

from firable.executor.drivers.device import Point, Value

TABLES: Final = ("coil", "discrete", "input", "holding")
BITS: Final = ("coil", "discrete")
WRITTEN: Final = ("coil", "holding")
ADDRESS_MAX: Final = 65_535
BIT_MAX: Final = 15
REGISTER_MIN: Final = -(1 << 15)
REGISTER_MAX: Final = (1 << 16) - 1
_NUMBERED: Final = {"0": "coil", "1": "discrete", "3": "input", "4": "holding"}
_OF_A_MANUAL: Final = re.compile(r"(?![01].*\.)(?P<table>[0134])x?(?P<number>[0-9]{4,5})(?P<bit>\.[0-9]+)?")
AT_ONCE_MAX: Final = {"coil": 1968, "discrete": 2000, "input": 125, "holding": 123}
"""How many a request may carry, by the standard."""


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """What a point means; `bit` is None for the whole."""

    table: str
    number: int
    bit: int | None = None


@cache
def address(point: Point) -> Address:
    """The address that a point is; raises `ValueError` with a sentence that says what is wrong.

    >>> address("coil 5"), address("input 30.2")
    (Address(table='coil', number=5, bit=None), Address(table='input', number=30, bit=2))
    """
    table, _, rest = point.partition(" ")
    number, dot, bit = rest.partition(".")
    if table not in TABLES or (at := _number(number, ADDRESS_MAX)) is None:
        counted = counted_from_one(point.removeprefix(f"{table} ") if table in TABLES else point)
        raise ValueError(
            "it is not `coil N`, `discrete N`, `input N` or `holding N`, with N from 0 to 65535, without a 0 before it"
            f"{f'; counted from 1, with its table before it, as manuals do, it is `{counted}`' if counted else ''}"
        )
    if not dot:
        return Address(table, at)
    if table in BITS or (bit_at := _number(bit, BIT_MAX)) is None:
        raise ValueError(
            "only a register has bits, `holding N.B` or `input N.B`, with B from 0 to 15, without a 0 before it"
        )
    return Address(table, at, bit_at)


def counted_from_one(number: str) -> Point:
    """The point that a number of a manual is, such as 40012, 4x0012 or, of a bit, 40012.3; empty where it is none.

    >>> counted_from_one("40012"), counted_from_one("4x0012"), counted_from_one("300001.3"), counted_from_one("40000")
    ('holding 11', 'holding 11', 'input 0.3', '')
    """
    found = _OF_A_MANUAL.fullmatch(number)
    at = int(found["number"]) - 1 if found is not None else -1
    if found is None or not 0 <= at <= ADDRESS_MAX:
        return ""
    return f"{_NUMBERED[found['table']]} {at}{found['bit'] or ''}"


def _number(text: str, most: int) -> int | None:
    """The number that a text is the one spelling of, up to the greatest there is."""
    return int(text) if re.fullmatch(r"0|[1-9][0-9]{0,4}", text) and int(text) <= most else None


@dataclass(frozen=True, slots=True)
class Block:
    """Addresses that are read or written in one request."""

    table: str
    first: int
    count: int

    def has(self, one: Address) -> bool:
        """Whether an address is in it."""
        return one.table == self.table and self.first <= one.number < self.first + self.count


def blocks(addresses: Sequence[Address]) -> Iterator[Block]:
    """The requests that read all addresses and nothing else.

    >>> [(b.first, b.count) for b in blocks([address(f"input {n}") for n in (4, 3, 7, 3)])]
    [(3, 2), (7, 1)]
    """
    for table in TABLES:
        numbers = sorted({one.number for one in addresses if one.table == table})
        while numbers:
            count = 1
            while count < min(len(numbers), AT_ONCE_MAX[table]) and numbers[count] == numbers[0] + count:
                count += 1
            yield Block(table, numbers[0], count)
            del numbers[:count]


@cache
def together(points: tuple[Point, ...]) -> tuple[tuple[Address, int, int], ...]:
    """Which points are written in one request: the address of the first, and where they begin and end.

    >>> [(begin, end) for _, begin, end in together(("holding 4", "holding 5", "coil 6", "holding 6"))]
    [(0, 2), (2, 3), (3, 4)]
    """
    found = [address(point) for point in points]
    cuts = [0]
    for at in range(1, len(found)):
        first, count = found[cuts[-1]], at - cuts[-1]
        follows = first.bit is None and found[at] == Address(first.table, first.number + count)
        if not follows or count == AT_ONCE_MAX[first.table]:
            cuts.append(at)
    return tuple((found[begin], begin, end) for begin, end in pairwise([*cuts, len(found)]) if begin < end)


def shown_value(shown: int, one: Address) -> Value:
    """What a point shows, of the bit or register that it is or is in."""
    if one.table in BITS:
        return bool(shown)
    return shown if one.bit is None else bool(shown >> one.bit & 1)
