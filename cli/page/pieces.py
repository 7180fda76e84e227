"""The pieces that sections are made of: badges that say how something ended, tables, and lists of names.

They hold what is the same in every section: a badge is a sign and a word, never a colour alone, and of what is long the
first is shown and the rest counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from firable.cli.page.markup import Content, Markup, tag, together
from firable.cli.text import SIGNS, first_of, mark
from firable.nets.rules import hints_of
from firable.nets.verdict import Status, Verdict

ROWS_MAX: Final = 400
_NAMES_MAX: Final = 200
TONES: Final = {"✓": "good", "✗": "bad", "?": "open", "!": "open", "·": None, "=": "good"}


def badge(verdict: Verdict) -> Markup:
    """How a verdict ended, as a sign and a word."""
    sign, word, _ = mark(verdict)
    return tag("span", f"{sign} {word}", cls=classes(TONES[sign]))


def hints_said(verdict: Verdict) -> Markup:
    """What to write instead, a paragraph with its code each; nothing where the verdict holds."""
    return together(*(tag("p", f"[{code}] ", in_code(hint), cls="hint") for code, hint in hints_of(verdict)))


def in_code(words: str) -> Markup:
    """Words in which backticks enclose what is typed, as markup that shows it so.

    >>> str(in_code("write `k: proved`"))
    'write <span class="code">k: proved</span>'
    """
    return together(*(tag("span", part, cls="code") if i % 2 else part for i, part in enumerate(words.split("`"))))


def status_badge(status: Status) -> Markup:
    """A status by itself."""
    sign = SIGNS[status.value]
    return tag("span", f"{sign} {status}", cls=classes(TONES[sign]))


def classes(tone: str | None) -> str:
    """The classes of a badge."""
    return f"badge {tone}" if tone else "badge"


def table(heads: Sequence[str], rows: Iterable[Sequence[Content]], *, caption: str, count: int | None = None) -> Markup:
    """A table that becomes a stack of cards on a phone; the first cell of a row is its head.

    Of many rows the first are shown; `count` says how many there are where not all are given.
    """
    body = []
    for row in rows:
        cells = [tag("th", row[0], scope="row")]
        cells += [tag("td", cell, data_of=head) for head, cell in zip(heads[1:], row[1:], strict=True)]
        body.append(tag("tr", *cells))
    more = (len(body) if count is None else count) - ROWS_MAX
    rest = tag("p", f"and {more:,} more", cls="soft") if more > 0 else None
    head = tag("thead", tag("tr", *(tag("th", one, scope="col") for one in heads)))
    hidden = tag("caption", caption, cls="unseen")
    return together(
        tag("div", tag("table", hidden, head, tag("tbody", body[:ROWS_MAX]), cls="stack"), cls="wide"), rest
    )


def names(some: Iterable[str]) -> Markup:
    """Names as code, the first of many."""
    return tag("span", first_of(tuple(some), _NAMES_MAX), cls="code")
