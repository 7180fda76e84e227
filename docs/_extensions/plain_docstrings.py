"""Docstrings and help texts as they are written here, for Sphinx: plain text, single backticks for code.

Two things of plain text mean something else in reStructuredText. An asterisk, as in `*.firable.yaml`, opens emphasis
unless it closes again; and lines that are set in by four blanks are a quotation, where here they are code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from sphinx.application import Sphinx

_LONE_ASTERISK: Final = re.compile(r"\*(?!\w[^*\n]*\w\*)(?<!\w\*)")
_CODE_OR_STRONG: Final = re.compile(r"(`[^`]*`|\*\*\w+\*\*)")
_ITEM: Final = re.compile(r"\s*(?:[-*]|\d+\.) ")


def plain(lines: list[str]) -> list[str]:
    r"""The lines of a docstring in reStructuredText.

    >>> plain(["Reads *.yaml, and *nothing* else.", "", "    read(*files)"])
    ['Reads \\*.yaml, and *nothing* else.', '', '.. code-block:: python', '', '    read(*files)']
    """
    return list(_told(lines))


def _told(lines: list[str]) -> Iterator[str]:
    before, in_code = "", False
    for k, line in enumerate(lines):
        if line.strip() and not line.startswith("    "):
            before, in_code = line, False
        elif line.startswith("    ") and not in_code and k and not lines[k - 1].strip() and not _ITEM.match(before):
            in_code = True
            yield from (".. code-block:: python", "")
        yield line if in_code or line.lstrip().startswith((">>>", "...")) else _escaped(line)


def _escaped(line: str) -> str:
    parts = _CODE_OR_STRONG.split(line)
    return "".join(part if k % 2 else _LONE_ASTERISK.sub(r"\\*", part) for k, part in enumerate(parts))


def _of_object(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:  # noqa: ARG001 - what Sphinx calls it with
    lines[:] = plain(lines)


def _of_command(app: Sphinx, context: object, lines: list[str]) -> None:  # noqa: ARG001 - what sphinx-click calls it with
    lines[:] = [_escaped(line) for line in lines]


def setup(app: Sphinx) -> dict[str, Any]:
    """Listen to all that bring docstrings."""
    app.connect("autodoc-process-docstring", _of_object)
    for part in ("description", "options", "arguments"):
        app.connect(f"sphinx-click-process-{part}", _of_command)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
