"""A simulated process: one machine on its disk, and what waits to leave it.

It is the host of the machine, and does what every host has to: the writes of an act become durable before anything of
the act leaves. What an act wants to let out stands in the outbox, in order, until the sync behind which it may leave;
while that sync is under way the process goes on, and what it does waits for the next. The outbox is the executor's own
(`executor/journal/outbox.py`). A command is then with the driver, which may have to
wait for a line; what has not reached its machine is given up when its token leaves. Killed, the process loses the
machine, the outbox, what its driver kept and what its disk had not synced. Of the acts whose writes survive,
firings and changes of signals have happened, although nobody was told: a restart finds them done.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from firable.executor.journal.outbox import Outbox
from firable.executor.protocol.messages import Effect, Firing, Keep, Sending, Stored, Taken
from firable.executor.simulation.clock import Clock
from firable.executor.simulation.disk import Disk

Machine = TypeVar("Machine")


@dataclass(slots=True)
class Act:
    """What one call of a machine let out, and whether it wrote anything."""

    writes: bool
    leaving: list[Effect]


@dataclass(slots=True)
class Process(Generic[Machine]):
    """A process that is not started yet."""

    name: str
    draw: random.Random
    disk: Disk = field(init=False)
    machine: Machine | None = None
    outbox: Outbox[Act] = field(default_factory=Outbox[Act])
    clock: Clock = field(default_factory=Clock)
    """It began anew with the process."""
    leaving: deque[Effect] = field(default_factory=deque[Effect])
    """What is durable, and about to leave."""
    has_acted: bool = False
    """Whether anything was done by what has left meanwhile."""
    queue: list[Sending] = field(default_factory=list)
    """The commands that its driver keeps."""
    void: set[tuple[str, int]] = field(default_factory=set)
    """The commands in the outbox whose token has left, by place and entry."""
    is_held: bool = False
    """Whether it has restarted, and no operator has resumed it yet."""
    is_safe: bool = False
    """Whether there was an emergency stop: its machines stand, and nothing is given to them."""
    is_latched: bool = False
    """Whether, after that, its machine has been made anew, and nobody has reset it."""
    cut_off: bool = False
    """Whether no message reaches it or leaves it."""

    def __post_init__(self) -> None:
        self.disk = Disk(self.draw)

    def act(self, effects: Iterable[Effect]) -> bool:
        """Take the effects of one call, writes to the disk, the rest to the outbox; returns whether there are any."""
        batch: dict[str, Stored | None] = {}
        leaving: list[Effect] = []
        for effect in effects:
            if isinstance(effect, Keep):
                batch[effect.key] = effect.value
            else:
                leaving.append(effect)
        if batch:
            self.disk.write(batch)
        elif not leaving:
            return False
        self.outbox.add(Act(bool(batch), leaving))
        return True

    def sync(self) -> list[Effect]:
        """End the sync that is under way, and return what may leave now; raises `DiskFailedError`."""
        if batches := sum(act.writes for act in self.outbox.behind):
            self.disk.sync(batches)
        return [effect for act in self.outbox.over() for effect in act.leaving]

    @property
    def held_back(self) -> Iterator[str]:
        """The places whose commands have not left."""
        waiting = [effect for act in self.outbox for effect in act.leaving]
        return (effect.place for effect in (*waiting, *self.leaving) if isinstance(effect, Sending))

    def hand(self, sending: Sending) -> bool:
        """Let the driver keep a command for later; returns whether that counts as sent."""
        self.queue.append(sending)
        return False

    def make_safe(self) -> None:
        """Have the driver drop what it keeps, and give the machines nothing more."""
        self.is_safe = True
        self.queue.clear()

    def give_up(self, places: Collection[str]) -> list[Sending]:
        """The tokens of these places have left: returns what the driver kept of theirs, and keeps no more."""
        waiting = [effect for act in self.outbox for effect in act.leaving if isinstance(effect, Sending)]
        self.void |= {(each.place, each.entry) for each in waiting if each.place in places}
        given_up = [each for each in self.queue if each.place in places]
        self.queue = [each for each in self.queue if each.place not in places]
        return given_up

    def kill(self) -> list[Effect]:
        """End at once; returns what had happened, though nothing of it was told to anybody."""
        kept = self.disk.crash()
        happened: list[Effect] = [effect for effect in self.leaving if isinstance(effect, Firing | Taken)]
        for act in self.outbox:
            if not kept:
                break
            kept -= act.writes
            happened += [effect for effect in act.leaving if isinstance(effect, Firing | Taken)]
        self.outbox.clear()
        self.leaving.clear()
        self.has_acted = False
        self.queue.clear()
        self.void.clear()
        self.is_safe = self.is_latched = False
        self.machine = None
        return happened
