"""What a host knows of others by their storages, and what it is known by itself, for as long as its process lives.

By which storage it met each machine it keeps before anything leaves that rests on what the machine said, and what its
own is called before anybody is told that. Its life it keeps when it is first let in by somebody, and before it has said
anything. Of a process that nobody lets in nobody can have heard, and it is no life: an older copy stays one, and as old
as it is, however often it is started.

What it has heard of the age of others it keeps with whatever is kept next, from one repeat to the next: to write that
for each message would cost more than the message. It is made durable by itself when more is heard and the last time
was a minute ago, when a peer is lost, and when the host ends in order. Of what is heard otherwise an outage of this
host may take the last, and a copy may pass that lacks no more than that.
"""

from __future__ import annotations

from typing import Final

from firable.executor.journal.journal import Journal, sync_now
from firable.executor.journal.memory import HOSTS, keeping, keeping_no_life, remembered
from firable.executor.links.storages import Memory, Met, Storage

KEEP_SECONDS: Final = 60.0
"""An age that was heard is made durable by itself when the last was so long ago."""


class Acquaintances:
    """What the journal of a host remembers, and what comes to that; without a link nothing does."""

    def __init__(self, journal: Journal, *, is_linked: bool) -> None:
        self.journal = journal
        kept = journal.kept(HOSTS)
        memory = remembered(kept, journal.age)
        if is_linked:
            journal.write(HOSTS, keeping_no_life(memory))  # with whatever this process keeps first
            if not kept:
                sync_now(journal)
        self.storage, self.known = memory.storage, dict(memory.known)
        self.lives: dict[str, str] = {}
        """The life of its storage in which each machine was met."""
        self.ages: dict[str, int] = {}
        """The age of each of these lives that was heard last."""
        self.is_alive = False
        """Whether the journal keeps this life: before, nothing may be said in it."""
        self.has_heard = False
        """Whether an age was heard that is not kept."""

    @property
    def memory(self) -> Memory:
        """What this host is known by, and knows others by."""
        for machine, life in self.lives.items():
            if age := self.ages.get(life):
                self.known[machine] = Met(self.known[machine].name, life, age)
        return Memory(self.storage, dict(self.known))

    def met(self, machine: str, storage: Storage) -> bool:
        """Take that a machine is connected, by this storage of its host; whether that is to be kept."""
        known = self.memory.known.get(machine)
        if known is None:
            self.known[machine] = Met(storage.name)
        elif known.life == storage.life:
            self.ages.setdefault(known.life, known.age)
        self.lives[machine] = storage.life
        return known is None or not self.is_alive

    def heard(self, machine: str, age: int) -> None:
        """Take how old the storage of a machine is by now; messages may be overtaken."""
        life = self.lives.get(machine, "")
        if age > self.ages.get(life, 0):
            self.ages[life] = age
            self.has_heard = True

    def write(self) -> None:
        """Have the journal keep what is known, and that this life has begun, with its next sync."""
        self.has_heard = False
        self.journal.write(HOSTS, keeping(self.memory))
