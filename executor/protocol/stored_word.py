"""How stable storage holds a word: in pieces, of which an act writes those that it has changed.

A word has a bit for each place and signal. Written whole, each firing would spell out all of them, and a controller
with ten thousand places would spend more on what nothing touched than on the firing. The first piece stands under
`word`, which is all of a small net; the others under `word/1`, `word/2` and so on. A piece that is not there was never
changed. The pieces of one act are one batch, like all that it keeps. Most acts know which they are (`kept_of`): then no
words need to be compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Final

from firable.executor.protocol.enabled import Word
from firable.executor.protocol.messages import Effect, Keep, Stored

PIECE_BITS: Final = 512
Piece = tuple[str, int]
"""The key under which it is kept, and the position of its first bit."""


def changed_pieces(before: Word, after: Word) -> list[Effect]:
    """What is to be kept of a word so that, with what was kept of it before, all of it is.

    >>> [(keep.key, keep.value) for keep in changed_pieces(0b101, 0b111 | 1 << 512)]
    [('word', '7'), ('word/1', '1')]
    """
    changed = before ^ after
    if changed <= _PIECE:  # most nets have but one
        return [Keep("word", f"{after & _PIECE:x}")] if changed else []
    kept: list[Effect] = []
    while changed:
        piece = (changed.bit_length() - 1) // PIECE_BITS  # from above: of what lies high, little is looked at
        kept.append(Keep(_key(piece), f"{after >> piece * PIECE_BITS & _PIECE:x}"))
        changed &= _below(piece)
    return kept[::-1]


def pieces_of(positions: Iterable[int]) -> tuple[Piece, ...]:
    """The pieces in which bits at these positions stand.

    >>> pieces_of([0, 2, 512])
    (('word', 0), ('word/1', 512))
    """
    return tuple(_piece(piece) for piece in sorted({at // PIECE_BITS for at in positions}))


def kept_of(before: Word, after: Word, pieces: tuple[Piece, ...]) -> list[Effect]:
    """The same, where nothing has changed but in these pieces; where there is one, something has.

    >>> kept_of(0b101, 0b111, pieces_of([1])) == changed_pieces(0b101, 0b111)
    True
    """
    if len(pieces) == 1:  # then nothing needs to be compared
        ((key, first),) = pieces
        return [Keep(key, f"{after >> first & _PIECE:x}")]
    changed = before ^ after
    return [Keep(key, f"{after >> first & _PIECE:x}") for key, first in pieces if changed >> first & _PIECE]


def stored_word(kept: Mapping[str, Stored], initial: Word) -> Word:
    """The word that was kept; where nothing was, it is as in the beginning.

    >>> stored_word({"word": "7"}, 1 << 512 | 1) == 1 << 512 | 7, stored_word({}, 5)
    (True, 5)
    """
    word = initial
    for key, value in kept.items():
        name, _, piece = key.partition("/")
        if name == "word":
            at = int(piece or 0) * PIECE_BITS
            word = word & ~(_PIECE << at) | int(str(value), 16) << at
    return word


def pieces(word: Word) -> dict[str, Stored]:
    """All of a word, as stable storage holds it.

    >>> pieces(1 << 512)
    {'word': '0', 'word/1': '1'}
    """
    count = max(1, -(-word.bit_length() // PIECE_BITS))
    return {_key(piece): f"{word >> piece * PIECE_BITS & _PIECE:x}" for piece in range(count)}


_PIECE: Final = (1 << PIECE_BITS) - 1


@cache
def _below(piece: int) -> Word:
    return (1 << piece * PIECE_BITS) - 1


@cache
def _piece(piece: int) -> Piece:
    return _key(piece), piece * PIECE_BITS


@cache
def _key(piece: int) -> str:
    return f"word/{piece}" if piece else "word"
