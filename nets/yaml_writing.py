"""YAML that every reader takes for the same text: scalars, and lists and mappings on one line.

Quoting is generous: a word that any YAML reader could take for a number, a Boolean or null is put in double quotes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from firable.nets.yaml_tree import is_ambiguous

_PLAIN: Final = re.compile(r"[A-Za-z_][\w.()>-]*(?: [\w.()>-]+)*", re.ASCII)
_ESCAPES: Final = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def scalar(text: str) -> str:
    """A scalar that every YAML reader takes for this text.

    >>> scalar("robot.free"), scalar("on"), scalar("a, b")
    ('robot.free', '"on"', '"a, b"')
    """
    if _PLAIN.fullmatch(text) and not is_ambiguous(text):
        return text
    return '"' + "".join(_escaped(character) for character in text) + '"'


def flow_mapping(entries: Iterable[tuple[str, str]]) -> str:
    """A mapping on one line, of keys and values that are written already."""
    return f"{{{', '.join(f'{key}: {value}' for key, value in entries)}}}"


def flow_list(texts: Iterable[str]) -> str:
    """A list of scalars on one line."""
    return f"[{', '.join(map(scalar, texts))}]"


def _escaped(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
