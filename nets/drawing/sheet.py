"""The sheet that every picture stands on: its size, its styles, its title and the line below it.

A picture says by itself what it is of, so that it can be printed, mailed or put into a report. There is no script, link
or font in it, and the styles that all have in common are here. Rejected: a style sheet beside the pictures, which is
the first thing that is lost on the way.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from firable.nets.drawing.text import NAME, NOTE, width_of
from firable.nets.drawing.xml import esc, px

MARGIN: Final = 24.0
TOP: Final = 66.0
"""Where what is drawn may begin below the title."""

NODES_MAX: Final = 600
"""How many places and transitions are drawn: lines are laid out to cross little, at a cost that grows with the cube."""

_STYLE: Final = """
text{font-family:'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;fill:#1d2733}
.title{font-size:21px;font-weight:700}
.subtitle{font-size:12.5px;fill:#5b6775}
""".lstrip()


def least_width(name: str, caption: str) -> float:
    """The width that the title and the line below it need, with both margins."""
    return max(width_of(name, NAME) * 1.7, width_of(caption, NOTE) * 1.2) + 2 * MARGIN


def scoped(scope: str, style: str) -> str:
    """Styles that hold only in pictures of one kind, for pages that hold several: the styles there are the page's.

    >>> scoped("strip", ".bar{fill:red}")
    '.strip .bar{fill:red}'
    """
    return "\n".join(f".{scope} {rule}" for rule in style.splitlines())


def opening(
    width: float,
    height: float,
    style: str,
    title: str,
    name: str,
    caption: str,
    description: str = "",
    *,
    scope: str = "",
) -> Iterator[str]:
    """The beginning of a picture of so many pixels; `title` is its hint, `name` stands on it above `caption`.

    `scope` is the class of the picture itself, of which `scoped` styles are.
    """
    w, h = px(width), px(height)
    kind = f' class="{scope}"' if scope else ""
    yield f'<svg xmlns="http://www.w3.org/2000/svg"{kind} width="{w}" height="{h}" viewBox="0 0 {w} {h}" role="img">'
    yield f"<title>{esc(title)}</title>"
    if description:
        yield f"<desc>{esc(description)}</desc>"
    yield f"<style>{_STYLE}{style}</style>"
    yield f'<rect width="{w}" height="{h}" fill="#fff"/>'
    yield f'<text class="title" x="{px(MARGIN)}" y="34">{esc(name)}</text>'
    yield f'<text class="subtitle" x="{px(MARGIN)}" y="53">{esc(caption)}</text>'
