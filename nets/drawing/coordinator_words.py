"""What a coordinator diagram says in words: of a part, of a transition, of a coordinator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from firable.nets.decomposition import ArbitrationGroup, Coordinated, Part
from firable.nets.drawing.labels import local_name
from firable.nets.drawing.text import COMMAND, NAME, NOTE, width_of, wrapped
from firable.nets.layers import Layers
from firable.nets.net import ArbitrationRule, Net

LABEL_CHARACTERS: Final = 24
_PART_CHARACTERS: Final = 26


@dataclass(frozen=True, slots=True)
class Told:
    """What stands at a part: its name, what it moves or reads, and the signals that it waits for."""

    name: str
    flow: tuple[str, ...]
    signals: tuple[str, ...]
    moves: bool

    @property
    def lines(self) -> int:
        """How many lines that are."""
        return 1 + len(self.flow) + len(self.signals)

    @property
    def width(self) -> float:
        """The width of the longest, in pixels."""
        lines = [width_of(line, NOTE) for line in self.flow] + [width_of(line, COMMAND) for line in self.signals]
        return max([width_of(self.name, NAME), *lines])


def told_of(part: Part, subnet: Net) -> Told:
    """What a part takes and puts, what it reads, and which signals open it, in the names of its controller."""
    transition = subnet.transition(part.name)

    def own(names: Sequence[str]) -> str:
        return ", ".join(local_name(name, part.controller) for name in names)

    moves = bool(transition.inputs or transition.outputs)
    lines = [f"{own(transition.inputs) or '∅'} → {own(transition.outputs) or '∅'}"] if moves else []
    lines += [f"while {own(transition.permissive)}"] if transition.permissive else []
    lines += [f"unless {own(transition.inhibitive)}"] if transition.inhibitive else []
    signals = (
        f"{'if' if gate.wanted else 'unless'} {local_name(gate.signal, part.controller)}"
        for gate in transition.external
    )
    flow = (piece for line in lines for piece in wrapped(line, _PART_CHARACTERS, 3))
    return Told(part.name, tuple(flow), tuple(signals), moves)


def labels(row: Coordinated) -> list[str]:
    """What stands at the left of a row."""
    return wrapped(row.description, LABEL_CHARACTERS)


def hint(row: Coordinated) -> str:
    """What is shown of a row where one points at it."""
    parts = "; ".join(f"{part.controller} by {part.name}" for part in row.parts)
    number = "" if row.number is None else f" (number {row.number})"
    return "\n".join(filter(None, (f"{row.name}{number}", row.description, parts)))


def rule(group: ArbitrationGroup) -> str:
    """How it is decided among those that compete."""
    order = ", ".join((*group.sequence, *group.rest))
    match group.by:
        case ArbitrationRule.ORDER:
            return f"in the order {order}"
        case ArbitrationRule.ROTATION:
            return f"by turns: {order}"
        case ArbitrationRule.PRIORITY:
            return f"by priority: {order}" if group.sequence else f"one of {order}"


def over(name: str, layers: Layers) -> str:
    """What a coordinator stands over."""
    above = layers.parent.get(name)
    return "coordinates all" if above is None else f"coordinates these, under {above}"


def count(n: int, word: str) -> str:
    """A number and what it counts.

    >>> count(1, "place"), count(2, "place")
    ('1 place', '2 places')
    """
    return f"{n:,} {word}{'' if n == 1 else 's'}"
