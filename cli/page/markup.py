"""Markup that is escaped because it cannot be made otherwise.

A report holds names from files that anybody wrote. So text and markup are two types: `tag` escapes every `str` and
keeps every `Markup`, and only `tag`, `raw` and `together` make `Markup`. A forgotten escape is then a mistake that
nobody can make; with a template it is one filter that somebody leaves out. A template library would be one more
dependency for a page whose parts are mostly loops over data.

`raw` is for what this program wrote itself: the style sheet, and the pictures of `firable.nets.drawing`.
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Final

_VOID: Final = frozenset({"br", "meta"})
_RENAMED: Final = {"cls": "class", "of": "for"}


class Markup(str):
    """Text that is markup already."""

    __slots__ = ()


Content = str | Iterable["str | Markup"] | None
"""What an element holds: text, markup, several of them, or nothing."""


def raw(text: str) -> Markup:
    """Markup that this program wrote itself."""
    return Markup(text)


def together(*parts: Content) -> Markup:
    """Parts one after the other; text is escaped, None is left out.

    >>> str(together("a < b", None, tag("br")))
    'a &lt; b<br>'
    """
    return Markup("".join(_written(part) for part in parts))


def tag(name: str, /, *parts: Content, **attributes: str | bool | None) -> Markup:
    """An element; `cls` stands for `class`, and an underscore for a hyphen. Attributes that are None are left out.

    >>> str(tag("a", "R & D", href="#x", cls="to"))
    '<a href="#x" class="to">R &amp; D</a>'
    >>> str(tag("details", open=True))
    '<details open></details>'
    """
    written = "".join(_attribute(key, value) for key, value in attributes.items())
    if name in _VOID:
        return Markup(f"<{name}{written}>")
    return Markup(f"<{name}{written}>{together(*parts)}</{name}>")


def _attribute(key: str, value: str | bool | None) -> str:
    if value is None or value is False:
        return ""
    key = _RENAMED.get(key, key.replace("_", "-"))
    return f" {key}" if value is True else f' {key}="{escape(str(value))}"'


def _written(part: Content) -> str:
    if part is None:
        return ""
    if isinstance(part, Markup):
        return part
    if isinstance(part, str):
        return escape(part, quote=False)
    return "".join(map(_written, part))
