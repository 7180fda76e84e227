"""What hosts know each other's stable storage by, and how one is found out that is not what it was.

At each connection both sides say what stable storage they have (`Storage`), and each remembers that of every machine
that it has met (`Met`). One that comes back with *another* storage, a journal mistyped or left out, does not know where
its tokens stand: it would begin at the places of the start, beside machines and controllers that are somewhere else.
One that comes back with an *older copy*, from a backup, would go on from where its tokens stood then. Either is refused
(F5025), and is told so.

A copy is found out by what others have heard. A storage counts how often it was made durable, which is its *age*; each
message bears the age of its sender's, and nothing leaves a host before what it rests on is durable. Each process that
has worked with a storage, and was let in by somebody, is a *life* of it, with a name at random and the age at which
the one before it had ended. A storage holds what was heard at some age of some life if it knows that life, and the next
one did not begin before that age. What nobody
has heard of, a transition that a controller fired alone behind its last message, is missed by nobody: of that only the
machines know, and they are asked.

Rejected: the age without the lives. A copy ages by being started, also where it is refused, and would be as old as the
original after some restarts. Rejected, too: the last round that was acknowledged. It would be the protocol's, and would
know nothing of what a controller does alone between two rounds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Self

LIVES_MAX: Final = 128
"""So many lives are known of a storage; whoever remembers an earlier one was away for as many others."""

_BETWEEN: Final = "-"
_BEGAN: Final = "."
_COUNT: Final = re.compile("[0-9]{1,19}", re.ASCII)


@dataclass(frozen=True, slots=True)
class Life:
    """A process that has worked with a storage, and how old that was when the one before it had ended."""

    name: str
    began: int


@dataclass(frozen=True, slots=True)
class Met:
    """What is remembered of a storage: its name, and the life and age of which something was heard last, if it was.

    Where text is needed it is spelled NAME-LIFE-AGE.

    >>> str(Met("5eed", "1a", 7)), Met.read("5eed-1a-7").age, Met.read("5eed")
    ('5eed-1a-7', 7, Met(name='5eed', life='', age=0))
    """

    name: str
    life: str = ""
    age: int = 0

    def __str__(self) -> str:
        return _BETWEEN.join((self.name, self.life, str(self.age)))

    @classmethod
    def read(cls, text: str) -> Self:
        """What a text of ours says; of any other text a name of which nothing was heard."""
        name, _, rest = text.partition(_BETWEEN)
        life, _, age = rest.partition(_BETWEEN)
        return cls(name, life, _count(age))


@dataclass(frozen=True, slots=True)
class Storage:
    """The stable storage of a host: its name, given at random when it was made, and its lives, the present one last.

    That of a host without a journal is gone with its process. Where text is needed it is spelled NAME-LIFE.AGE-...

    >>> storage = Storage("5eed").in_new_life("1a", 0).in_new_life("2b", 17)
    >>> str(storage), Storage.read("5eed-1a.0-2b.17") == storage
    ('5eed-1a.0-2b.17', True)
    >>> storage.holds(Met("5eed", "1a", 17)), storage.holds(Met("5eed", "1a", 18)), storage.holds(Met("5eed", "3c", 1))
    (True, False, False)
    """

    name: str = ""
    lives: tuple[Life, ...] = ()

    @property
    def life(self) -> str:
        """The name of the present life."""
        return self.lives[-1].name if self.lives else ""

    def __str__(self) -> str:
        return _BETWEEN.join((self.name, *(f"{life.name}{_BEGAN}{life.began}" for life in self.lives)))

    @classmethod
    def read(cls, text: str) -> Self:
        """The storage of a text of ours; of any other text one that holds nothing."""
        name, *lives = text.split(_BETWEEN)
        parted = [life.partition(_BEGAN) for life in lives]
        return cls(name, tuple(Life(life, _count(began)) for life, _, began in parted))

    def in_new_life(self, name: str, age: int) -> Storage:
        """The same storage in a life that begins now."""
        return replace(self, lives=(*self.lives, Life(name, age))[-LIVES_MAX:])

    def holds(self, met: Met) -> bool:
        """Whether all is in it of which somebody has heard."""
        if not met.life:
            return True
        for life, following in zip(self.lives, (*self.lives[1:], None), strict=True):
            if life.name == met.life:
                return following is None or met.age <= following.began
        return False


@dataclass(frozen=True, slots=True)
class Estranged:
    """Machines of a host that another one has met with another storage, or has heard later things of."""

    machines: tuple[str, ...]
    is_older: bool
    """Whether it is the same storage as it was before that: a copy."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What hosts know each other by: this host's storage, and what it remembers of those of machines it has met."""

    storage: Storage = Storage()
    known: Mapping[str, Met] = field(default_factory=dict)

    def estranged(self, machines: Iterable[str], storage: Storage) -> Estranged | None:
        """Why the host of these machines, with this storage, is not the one that was met; None where it may be."""
        met = {machine: self.known[machine] for machine in machines if machine in self.known}
        if others := tuple(machine for machine, known in met.items() if known.name != storage.name):
            return Estranged(others, is_older=False)
        if later := tuple(machine for machine, known in met.items() if not storage.holds(known)):
            return Estranged(later, is_older=True)
        return None


def _count(text: str) -> int:
    return int(text) if _COUNT.fullmatch(text) else 0
