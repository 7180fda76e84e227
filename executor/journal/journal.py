"""The journal of a process: what its machines keep, written before anything that depends on it leaves.

One journal for all machines of a *process*, because a process crashes as a whole and syncs as a whole. Acts are written
in the order in which they happen, and `sync` makes all of them up to now durable in one transaction, so that what a
crash loses is always the last acts of all machines together. Therefore a message from one machine to another in the
same process need not wait for the disk: if its sending is lost, so is everything that came of it. Only what leaves the
process waits: commands to machines, messages to other processes, lines of the trace. A chain of votes and decisions
that ends in a command costs one sync (*group commit*; Gray and Reuter, "Transaction Processing", 1993).

A sync is begun in one place and done in another: the writes are taken where the acts are done, and go to the disk on a
thread, because a disk may take milliseconds, or seconds, in which a stop and the messages of other hosts must be heard.
What rests on them waits (`outbox.py`).

Rejected: one file for each machine. It costs a sync for each machine that takes part in a transition, and files whose
last acts were lost differently show a state in which the process never was.

A sync that fails leaves open what is stored. It is never tried again: the process drives its safe outputs and ends, and
the next start finds either all of the group or nothing of it (Rebello et al., "Can applications recover from fsync
failures?", 2020).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from firable.executor.protocol.messages import Effect, Keep, Stored

Storing = Callable[[], None]
"""Makes durable what a sync was begun for, on any thread; called once. Raises `InputError` where that fails."""


class Journal(Protocol):
    """Stable storage of the machines of one process."""

    @property
    def age(self) -> int:
        """How often something has become durable, in all lives: what is durable now is there at every later age."""
        ...

    def kept(self, machine: str) -> Mapping[str, Stored]:
        """What a machine has kept, up to the last act written; nothing for a machine that never ran."""
        ...

    def write(self, machine: str, effects: Iterable[Effect]) -> None:
        """Take the writes of one act of a machine, in order behind all acts before; durable at the next `sync`."""
        ...

    def sync(self) -> Storing | None:
        """Begin to make all acts written until now durable, together; returns what does it, None where nothing has to.

        No other sync is begun before that is over. Raises `InputError` where an earlier one has failed.
        """
        ...

    def close(self) -> None:
        """Let go of the storage. What is not synced is lost, as in a crash."""
        ...


def sync_now(journal: Journal) -> None:
    """Make all acts written until now durable, and wait for it; raises `InputError` where that fails."""
    if (storing := journal.sync()) is not None:
        storing()


class MemoryJournal:
    """A journal that a crash of the process does not outlive: for runs without a journal, and for tests.

    >>> journal = MemoryJournal()
    >>> journal.write("robot", [Keep("epoch", 0), Keep("word", "5"), Keep("word", None)])
    >>> journal.kept("robot")
    {'epoch': 0}
    """

    def __init__(self) -> None:
        self.of: dict[str, dict[str, Stored]] = {}
        self.age = 0
        """Each write is durable at once, as far as anything here is."""

    def kept(self, machine: str) -> Mapping[str, Stored]:
        """What a machine has kept."""
        return dict(self.of.get(machine, {}))

    def write(self, machine: str, effects: Iterable[Effect]) -> None:
        """Take the writes of one act."""
        self.age += 1
        of_machine = self.of.get(machine)
        if of_machine is None:
            of_machine = self.of[machine] = {}
        for effect in effects:
            if isinstance(effect, Keep):
                if effect.value is None:
                    of_machine.pop(effect.key, None)
                else:
                    of_machine[effect.key] = effect.value

    def sync(self) -> Storing | None:
        """Nothing more can be done for what is in memory."""
        return None

    def close(self) -> None:
        """Keep what is there, for a next start within the process."""
