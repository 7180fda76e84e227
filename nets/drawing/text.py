"""The sizes of text in a drawing, estimated: no font is at hand where the drawing is made.

The reader's machine chooses the font, so a label is given the room that a wide one (DejaVu Sans) takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap
from typing import Final
from unicodedata import east_asian_width


@dataclass(frozen=True, slots=True)
class Style:
    """How a line of text looks: a class of the style sheet, which has its size, and the mean width of a character."""

    css: str
    character_px: float


NAME: Final = Style("name", 8.0)
COMMAND: Final = Style("command", 6.5)
NOTE: Final = Style("note", 6.1)


Words = tuple[tuple[str, Style], ...]
"""Lines of text, each with how it looks."""


def width_of(text: str, style: Style) -> float:
    """The width of a line in pixels, rather too much than too little."""
    return sum(2.0 if east_asian_width(character) in "WF" else 1.0 for character in text) * style.character_px


def wrapped(text: str, characters: int, lines_max: int = 2) -> list[str]:
    """The text in at most `lines_max` lines; what does not fit ends in an ellipsis.

    >>> wrapped("moving the workpiece to the machining centre", 22)
    ['moving the workpiece', 'to the machining…']
    """
    lines = wrap(" ".join(text.split()), characters)
    if len(lines) > lines_max:
        lines = [*lines[: lines_max - 1], f"{lines[lines_max - 1][: characters - 1]}…"]
    return lines
