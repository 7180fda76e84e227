"""Layout by Graphviz, where it is installed and asked for: the same boxes and arrows, placed by `dot`.

Only places are asked of it: sizes go in, coordinates come out (`-Tplain`), and the picture is written as always.
Rejected: the SVG that `dot` writes, whose ids, fonts and colours are its own, and the Python packages around it, which
put one process behind more names. `dot` is found on the PATH; nothing is installed or downloaded.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
from collections.abc import Sequence
from typing import Final

import click

from firable.nets.drawing.layered import Box, Link, Placed, Point, Route

_SECONDS_MAX: Final = 60
_PIXELS_PER_INCH: Final = 72.0


def dot(boxes: Sequence[Box], links: Sequence[Link]) -> Placed:
    """Lay a graph out by Graphviz; at most one link leads from one box to another.

    Raises `click.UsageError` where there is no `dot`, or where it fails or takes longer than a minute.
    """
    program = shutil.which("dot")
    if program is None:
        raise click.UsageError("Graphviz is not installed: no program 'dot' is on the PATH. Leave out --layout dot")
    try:
        done = subprocess.run(
            [program, "-Tplain"],
            input=_source(boxes, links),
            capture_output=True,
            text=True,
            encoding="utf-8",
            timeout=_SECONDS_MAX,
            check=True,
        )
    except subprocess.TimeoutExpired:
        said = f"Graphviz has not laid out the graph after {_SECONDS_MAX} seconds: draw less, or leave out --layout dot"
        raise click.UsageError(said) from None
    except subprocess.CalledProcessError as error:
        raise click.UsageError(f"Graphviz fails: {error.stderr.strip()}. Leave out --layout dot") from None
    except OSError as error:
        raise click.UsageError(f"Graphviz cannot be run: {error}. Leave out --layout dot") from None
    return _read(done.stdout, len(boxes), links)


def _source(boxes: Sequence[Box], links: Sequence[Link]) -> str:
    """The graph for `dot`; words are an empty table of their size, so that it keeps room for them."""
    lines = [
        "digraph {",
        "graph [nodesep=0.3 ranksep=0.35];",
        'node [shape=box fixedsize=true label=""];',
        "edge [arrowhead=none];",
    ]
    for i, box in enumerate(boxes):
        lines.append(f"{i} [width={box.width / _PIXELS_PER_INCH:.4f} height={box.height / _PIXELS_PER_INCH:.4f}];")
    for link in links:
        size = f'FIXEDSIZE="TRUE" WIDTH="{round(link.width)}" HEIGHT="{round(link.height)}"'
        table = f'<TABLE BORDER="0" CELLBORDER="0" CELLPADDING="0" {size}><TR><TD></TD></TR></TABLE>'
        lines.append(f"{link.tail} -> {link.head} [label=<{table}>];")
    return "\n".join([*lines, "}"])


def _read(plain: str, n_boxes: int, links: Sequence[Link]) -> Placed:
    """Read the plain format: inches, y upwards, words behind the points of an edge."""
    centres: list[Point] = [(0.0, 0.0)] * n_boxes
    routes: dict[tuple[int, int], Route] = {}
    width = height = 0.0

    def point(x: str, y: str) -> Point:
        return float(x) * _PIXELS_PER_INCH, height - float(y) * _PIXELS_PER_INCH

    for line in plain.replace("\\\n", "").splitlines():
        match shlex.split(line):
            case ["graph", _, w, h]:
                width, height = float(w) * _PIXELS_PER_INCH, float(h) * _PIXELS_PER_INCH
            case ["node", name, x, y, *_]:
                centres[int(name)] = point(x, y)
            case ["edge", tail, head, n, *rest]:
                ends = 2 * int(n)
                points = tuple(point(*rest[k : k + 2]) for k in range(0, ends, 2))
                routes[int(tail), int(head)] = Route(points, point(*rest[ends + 1 : ends + 3]))
    return Placed(tuple(centres), tuple(routes[link.tail, link.head] for link in links), width, height)
