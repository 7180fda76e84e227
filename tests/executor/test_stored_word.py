"""A word in pieces is the word, whatever was changed of it and when."""

import random
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.decompose.splitting.cut import split
from firable.executor.journal.journal import MemoryJournal
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.enabled import bits_behind
from firable.executor.protocol.messages import Keep
from firable.executor.protocol.stored_word import PIECE_BITS, changed_pieces, pieces, stored_word
from firable.nets.bits import bits
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, Net, Place, Transition

WORDS = st.integers(0, 1 << 4 * PIECE_BITS) | st.sets(st.integers(0, 4 * PIECE_BITS)).map(
    lambda positions: sum(1 << at for at in positions)
)


def wide() -> Decomposition:
    """A ring over several pieces."""
    n = 2 * PIECE_BITS + 50
    places = tuple(Place(f"a.{i}", "a", marked=i == n - 9) for i in range(n))
    moves = tuple(Transition(f"t{i}", (f"a.{i}",), (f"a.{(i + 1) % n}",)) for i in range(n))
    return split(Net("wide", places, moves, controllers=(Controller("a"),)))


@examples(50)
@given(st.lists(WORDS, min_size=1, max_size=6))
def test_pieces_that_changed_are_with_those_before_the_whole_word(words: list[int]) -> None:
    journal = MemoryJournal()
    for before, after in pairwise(words):
        journal.write("a", changed_pieces(before, after))
    assert stored_word(journal.kept("a"), words[0]) == words[-1]
    assert stored_word(pieces(words[-1]), 0) == words[-1]


def test_only_pieces_that_changed_are_written() -> None:
    word = random.Random(3).getrandbits(20 * PIECE_BITS)
    changed = word ^ 1 << 7 * PIECE_BITS ^ 1 << 8 * PIECE_BITS - 1 ^ 1 << 11 * PIECE_BITS + 5
    kept = pieces(changed)
    assert changed_pieces(word, changed) == [Keep(key, kept[key]) for key in ("word/7", "word/11")]


@examples(50)
@given(WORDS, st.integers(-1, 4 * PIECE_BITS))
def test_bits_behind_one_are_all_bits_in_a_circle(mask: int, last: int) -> None:
    assert list(bits(mask)) == [at for at in range(mask.bit_length()) if mask >> at & 1]
    found = list(bits_behind(mask, last))
    assert found == sorted(bits(mask), key=lambda at: (at <= last, at))


def test_controller_with_many_places_is_restored_where_it_was() -> None:
    decomposition = wide()
    first, journal = LocalController(decomposition, "a"), MemoryJournal()
    for count in range(2 * PIECE_BITS):
        effects = first.fire()
        assert sum(isinstance(effect, Keep) for effect in effects) <= 2
        journal.write("a", effects)
        assert stored_word(journal.kept("a"), first.subnet.initial_marking) == first.word
        if count % 200 == 0:
            assert LocalController.restored(decomposition, "a", journal.kept("a")).word == first.word
