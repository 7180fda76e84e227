"""The words of a formula: names, symbols, and the signs and numbers of comparisons.

The name of a place may hold nearly every character, `<`, `=` and `+` among them, and may be a number. So a sign is one
only where no name can stand: after a closing bracket, and from there on as long as signs and numbers alternate. A
number is one where a sign and `tokens(` follow at once; elsewhere the parser tells, by what stands beside it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

_SIGN: Final = r"<=|>=|!=|=|<|>"
_END: Final = r"(?=\s|[()\[\],]|->|$)"
_TOKEN: Final = re.compile(
    rf"""\s*(?:(?P<symbol>->|[()\[\],])
        |"(?P<quoted>[^\s"]+)"{_END}
        |(?P<number>[0-9]+)(?=\s*(?:{_SIGN})\s*tokens\s*\()
        |(?P<name>[^\s()\[\],]+?){_END})""",
    re.VERBOSE,
)
_IN_COMPARISON: Final = re.compile(rf"\s*(?:(?P<sign>{_SIGN}|\+)|(?P<number>[0-9]+)(?=\s*(?:{_SIGN}|[()\]]|\s|->|$)))")


class Token(NamedTuple):
    """A word, the column (from 0) of its first character, and whether it stands in quotes."""

    text: str
    column: int
    quoted: bool = False


def tokens_of(text: str) -> Iterator[Token]:
    """The words of a text, left to right.

    >>> [token.text for token in tokens_of('tokens(a,b)<=2 and "or"')]
    ['tokens', '(', 'a', ',', 'b', ')', '<=', '2', 'and', 'or']
    """
    # Nothing is passed over but blanks: every other character is a symbol or part of a name. `<` and `+` may be part of
    # a name too, but no name can follow a closing bracket.
    position, comparing = 0, False
    while True:
        match = (_IN_COMPARISON.match(text, position) if comparing else None) or _TOKEN.match(text, position)
        if match is None:
            return
        kind = match.lastgroup or ""
        position = match.end()
        comparing = kind in {"sign", "number"} or match[kind] == ")"
        yield Token(match[kind], match.start(kind), kind == "quoted")
