"""How stable storage holds a word: in pieces, of which an act writes those that it has changed.

A word has a bit for each place and signal. Written whole, each firing would spell out all of them, and a controller
with ten thousand places would spend more on what nothing touched than on the firing. The first piece stands under
`word`, which is all of a small net; the others under `word/1`, `word/2` and so on. A piece that is not there was never
changed. The pieces of one act are one batch, like all that it keeps.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from firable.executor.protocol.messages import Keep, Stored
from firable.executor.protocol.token_player import Word

PIECE_BITS: Final = 512


def changed_pieces(before: Word, after: Word) -> list[Keep]:
    """What is to be kept of a word so that, with what was kept of it before, all of it is.

    >>> [(keep.key, keep.value) for keep in changed_pieces(0b101, 0b111 | 1 << 512)]
    [('word', '7'), ('word/1', '1')]
    """
    changed, piece = before ^ after, 0
    if changed <= _PIECE:  # most nets have but one
        return [Keep("word", f"{after & _PIECE:x}")] if changed else []
    kept: list[Keep] = []
    while changed:
        skipped = ((changed & -changed).bit_length() - 1) // PIECE_BITS
        piece += skipped
        kept.append(Keep(_key(piece), f"{after >> piece * PIECE_BITS & _PIECE:x}"))
        changed >>= (skipped + 1) * PIECE_BITS
        piece += 1
    return kept


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


def _key(piece: int) -> str:
    return f"word/{piece}" if piece else "word"
