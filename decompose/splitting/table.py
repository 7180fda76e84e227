"""The coordinator table as text, laid out as the paper publishes it.

One row for each global transition: its name, its parts by controller, what it does. The parts alone say which
controllers must agree, so the table is what an engineer compares with the paper or with the last release. Where
coordinators stand in layers, each has a table of its own, under its name: the rows that it decides.
"""

from __future__ import annotations

from collections.abc import Sequence

from firable.nets.decomposition import Coordinated
from firable.nets.source import one_line

_GAP = 3


def table_text(table: Sequence[Coordinated]) -> str:
    """The coordinator table `Decomposition.table`, a line with its line end for each row; empty where there is none.

    The rows of the highest coordinator come first, then those of each other one.

    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.net import Controller, Net, Place, Transition
    >>> places = (Place("a.p", "a", marked=True), Place("b.q", "b"))
    >>> hand_over = Transition("G1", ("a.p",), ("b.q",), number=1, description="hand over")
    >>> net = Net("n", places, (hand_over,), controllers=(Controller("a", coordinator=True), Controller("b")))
    >>> print(table_text(split(net).table), end="")
    G1: t0-1, t1-11   hand over
    """
    rows = [(row.at, row.name, ", ".join(part.name for part in row.parts), one_line(row.description)) for row in table]
    width_name = max((len(name) for _, name, _, _ in rows), default=0) + 1
    width_parts = max((len(parts) for _, _, parts, _ in rows), default=0) + _GAP
    lines: dict[str | None, list[str]] = {None: []}
    for at, name, parts, description in rows:
        line = f"{name + ':':<{width_name}} {parts:<{width_parts}}{description}".rstrip()
        lines.setdefault(at, []).append(line)
    below = (f"decided by {at}:\n" + _text(some) for at, some in lines.items() if at is not None)
    return _text(lines[None]) + "".join(below)


def _text(lines: Sequence[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
