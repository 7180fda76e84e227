"""The shapes that a drawing is made of, in pixels: what the layout finds and what is written down as SVG.

They know nothing of how they came to stand where they stand, so that the layout and the SVG each depend on them and
not on each other's insides. The rejected alternative, to write the picture while it is laid out, leaves nothing that a
test can measure: whether two labels meet is a question of numbers, not of text.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from firable.nets.drawing.text import Words
from firable.nets.net import ExternalGate

RADIUS: Final = 15.0
BAR_HALF_WIDTH: Final = 24.0
BAR_HALF_HEIGHT: Final = 3.5
BYPASS_FIRST: Final = 34.0
BYPASS_STEP: Final = 10.0
LABEL_LEFT: Final = 24.0
WORDS_LINE: Final = 14.0
STUB_LINE: Final = 12.0


class Kind(StrEnum):
    """What joins a place and a transition."""

    INPUT = "input"
    OUTPUT = "output"
    PERMISSIVE = "permissive"
    INHIBITIVE = "inhibitive"


@dataclass(frozen=True, slots=True)
class Edge:
    """An arc or internal gate: a vertical line at `x` from the place to the height of the transition.

    `bypass` counts the edges of the place that are nearer on the same side; with 0 the line is straight.
    """

    place: int
    transition: int
    kind: Kind
    x: float
    bypass: int


@dataclass(frozen=True, slots=True)
class Stub:
    """An external gate at the bar of a transition, at `x`; `slot` counts the stubs at the same place."""

    transition: int
    gate: ExternalGate
    label: str
    x: float
    slot: int


@dataclass(frozen=True, slots=True)
class Lane:
    """The box of a controller; `owner` is None for what nobody owns."""

    owner: str | None
    x: float
    width: float


@dataclass(frozen=True, slots=True)
class Spot:
    """The centre of a place, the lines that stand beside it, and whether it is a macro place: a task that is folded."""

    x: float
    y: float
    words: Words
    is_macro: bool


@dataclass(frozen=True, slots=True)
class Bar:
    """A transition at height `y`: thick between each pair of `segments`, tied together by a thin line.

    `in_margin` says that its words stand at the left of all lanes, and not beside its last segment.
    """

    y: float
    segments: tuple[tuple[float, float], ...]
    is_global: bool
    in_margin: bool
    words: Words


@dataclass(frozen=True, slots=True)
class Layout:
    """The drawing in pixels, before it is written down; `places` and `bars` by the indexes of the net."""

    lanes: tuple[Lane, ...]
    places: tuple[Spot, ...]
    bars: tuple[Bar, ...]
    edges: tuple[Edge, ...]
    stubs: tuple[Stub, ...]
    margin_labels: float
    top: float
    bottom: float
    width: float
