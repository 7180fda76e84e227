"""What every picture writes in the same way: ids, numbers and text."""

from __future__ import annotations

from urllib.parse import quote
from xml.sax.saxutils import escape


def ident(kind: str, *names: str) -> str:
    """The attribute by which a part of a picture is found; what XML forbids in names is percent-encoded.

    >>> ident("place", "robot.free")
    'id="place:robot.free"'
    """
    return f'id="{":".join((kind, *(quote(name) for name in names)))}"'


def px(value: float) -> str:
    """A number to a tenth of a pixel, as short as can be."""
    return f"{round(value, 1) + 0.0:.10g}"


def esc(text: str) -> str:
    """Text for XML, without the control characters that XML forbids."""
    return escape("".join(c if c.isprintable() or c == "\n" else "�" for c in text))


def head(x: float, y: float, dx: float, dy: float, css: str = "head") -> str:
    """An arrowhead whose tip is at (x, y), pointing in the direction (dx, dy) of length one."""
    back_x, back_y = x - 8 * dx, y - 8 * dy
    return (
        f'<path class="{css}" d="M{px(x)} {px(y)}L{px(back_x - 3.6 * dy)} {px(back_y + 3.6 * dx)}'
        f'L{px(back_x + 3.6 * dy)} {px(back_y - 3.6 * dx)}z"/>'
    )
