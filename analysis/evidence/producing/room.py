"""How much room the certificates of a document take, so that none is written that is too large to be read.

Counted are the sets of markings and the runs, each once, and the ranks: all else is small beside the limit. What finds
no room any more is left out, with the reason; what comes after it may still find some.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from firable.analysis.evidence.certificate import (
    Certificate,
    Continuation,
    FiringSequence,
    Labelling,
    Markings,
    Progress,
    Ranks,
    Reduction,
    StubbornSets,
    Theorem,
    Unfolded,
)
from firable.analysis.evidence.claim_records import APART_MAX, steps_of
from firable.analysis.evidence.document import SIZE_BYTES_MAX

_REST_BYTES: Final = 2**24
_BETWEEN_BYTES: Final = 3  # quotes and a comma
_AROUND_BYTES: Final = 6  # and the brackets around a firing

_Large = Markings | Ranks | FiringSequence


class Room:
    """The bytes of a document that are left."""

    def __init__(self, size: int = SIZE_BYTES_MAX - _REST_BYTES) -> None:
        self.left = size
        self._written: dict[int, _Large] = {}  # kept, so that no number is given to another one

    def take(self, certificates: list[Certificate]) -> bool:
        """Whether there is room for certificates, which then is taken."""
        new = {id(part): part for one in certificates for part in _large(one) if id(part) not in self._written}
        size = sum(map(_size, new.values()))
        if size > self.left:
            return False
        self.left -= size
        self._written |= new
        return True


def _large(certificate: Certificate) -> Iterator[_Large]:
    match certificate:
        case FiringSequence():
            yield certificate
        case Labelling(space, labels):
            yield from (part for part in (space, *labels) if isinstance(part, Markings | Ranks))
        case StubbornSets(space) | Progress(space) | Unfolded(space):
            yield space
        case Continuation(_, then):
            yield from _large(then)
        case Theorem(_, contact):
            yield from _large(contact)
        case Reduction(then=then) if then is not None:
            yield from _large(then)


def _size(part: _Large) -> int:
    if isinstance(part, FiringSequence):
        names = (name for fired in (*part.firings, *part.cycle) for name in fired)
        return sum(len(name.encode()) + _AROUND_BYTES for name in names)
    if isinstance(part, Ranks):
        return sum(len(str(rank)) + 1 for rank in part.ranks)
    written = steps_of(part.markings) if len(part.markings) > APART_MAX else part.markings
    return sum(number.bit_length() // 4 + 1 + _BETWEEN_BYTES for number in written)
