"""The outbox: what acts let out, held back in their order until the journal has what they rest on.

While a sync is under way a process goes on: it hears messages, reads signals and acts. What these acts let out waits
behind the sync after it, though they may have written nothing themselves, since what they say rests on acts before
them that the disk may still lose. So there is at most one sync under way, everything waits either behind it or for the
next one, and what leaves does so in the order of the acts. A sync that takes long makes the next group larger and
nothing else (*group commit*, as `journal.py` has it).

Pure, and the one order of leaving: hosts (`operating/acts.py`) and simulated processes (`simulation/process.py`) hold
back by it. Rejected: several syncs under way, each with what waits behind it. A disk that is asked twice is no quicker,
and one whose first write failed may have done the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Outbox(Generic[T]):
    """What waits to leave; nothing is under way.

    >>> outbox = Outbox[str]()
    >>> outbox.add("a command")
    >>> outbox.begin()
    >>> outbox.add("a vote")
    >>> outbox.over(), list(outbox)
    (['a command'], ['a vote'])
    """

    def __init__(self) -> None:
        self.behind: list[T] = []
        """What leaves when the sync is over that is under way."""
        self.waiting: list[T] = []
        """What the next one is for."""
        self.is_under_way = False

    def __iter__(self) -> Iterator[T]:
        yield from self.behind
        yield from self.waiting

    def __len__(self) -> int:
        return len(self.behind) + len(self.waiting)

    def add(self, one: T) -> None:
        """Hold something back, behind all before."""
        self.waiting.append(one)

    def begin(self) -> None:
        """A sync begins, of all acts until now."""
        assert not self.is_under_way, "a sync is under way"
        self.is_under_way = True
        self.behind, self.waiting = self.waiting, []

    def over(self) -> list[T]:
        """The sync has made its acts durable: returns what may leave."""
        assert self.is_under_way, "no sync is under way"
        self.is_under_way = False
        leaving, self.behind = self.behind, []
        return leaving

    def remove(self, one: T) -> None:
        """Hold something back for ever."""
        (self.behind if one in self.behind else self.waiting).remove(one)

    def clear(self) -> None:
        """The process is gone, with what it held back and the sync that was under way."""
        self.behind, self.waiting, self.is_under_way = [], [], False
