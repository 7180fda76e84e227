"""The machines of a simulated cell: they take commands, are at work for a while, and complete them or not.

They know the net only as the list of its commands. Which machine may be given which commands at once is derived from
the net, by its markings: two places of one machine are *apart* if no marking that is reached holds both, and whoever
leaves either has waited for its completion. A command of the one while the machine is still at that of the other is
then a fault of the executor, whatever its trace shows.

Rejected: the plant of the catalogue's cells. It knows workpieces, and with them which commands are lawful, but there is
one of it for each cell, and generated nets have none; the runs of `executor/cell/` are for that.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from firable.executor.protocol.commands import Answer
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.net import Net, Place

_MARKINGS_MAX: Final = 2000


class MachineError(AssertionError):
    """A machine was given what no machine may be given."""


@dataclass(slots=True)
class Job:
    """A command that a machine was given."""

    place: str
    entry: int
    signal: str | None
    done: bool = False
    stuck: bool = False
    halted: bool = False


class Machinery:
    """The machines of a net, at rest; `apart` is what `apart_of` says of the net."""

    def __init__(self, net: Net, apart: Mapping[str, frozenset[str]], draw: random.Random) -> None:
        self.draw = draw
        self.apart = apart
        self.machine_of = {place.name: place.command.machine for place in net.places if place.command}
        self.completion_of = {place.name: place.completion for place in net.places if place.command}
        self.jobs: dict[str, Job] = {}
        """The last command of each place."""
        self.newest: dict[str, Job] = {}
        """The last command that each completion signal completes."""
        self.working: list[Job] = []
        self.commands = 0

    def send(self, place: str, entry: int, *, stuck: bool = False) -> None:
        """Give a machine the command of a place; raises `MachineError`."""
        last = self.jobs.get(place)
        if last is not None and last.entry >= entry:
            raise MachineError(f"command {entry} of '{place}' is given again: the last one was {last.entry}")
        for job in self.working:
            if job.place in self.apart.get(place, ()):
                raise MachineError(
                    f"{self.machine_of[place]} is given the command of '{place}' while it is at that of '{job.place}'"
                )
        job = self.jobs[place] = Job(place, entry, self.completion_of[place], stuck=stuck)
        self.working.append(job)
        if job.signal is not None:
            self.newest[job.signal] = job
        self.commands += 1

    def complete(self, *, mended: bool = False) -> Job | None:
        """Let one of the machines at work end its command, stuck ones only when mended; None where there is none."""
        able = [job for job in self.working if mended or not job.stuck]
        if not able:
            return None
        job = able[int(self.draw.random() * len(able))]
        self.working.remove(job)
        job.done = True
        return job

    def ask(self, place: str, entry: int) -> Answer:
        """What has become of a command."""
        job = self.jobs.get(place)
        if job is None or job.entry < entry:
            return Answer.NOT_RECEIVED
        return Answer.UNKNOWN if job.halted else Answer.DONE if job.done else Answer.WORKING

    def halt(self, job: Job) -> None:
        """Stop a machine in the middle of its command; only the operator can tell what is to be done."""
        job.halted = True
        self.working.remove(job)

    def settle(self, place: str, *, done: bool) -> Answer:
        """The operator has looked at a machine that was halted: its command counts as done, or is to be given again."""
        job = self.jobs[place]
        job.halted, job.done = False, done
        if not done:
            del self.jobs[place]
        return Answer.DONE if done else Answer.NOT_RECEIVED


def apart_of(net: Net) -> dict[str, frozenset[str]]:
    """For each place with a command, the places whose commands its machine has certainly ended when it is entered.

    Empty where the net has more markings than are looked at: then nothing is claimed. Cost: one search over them.
    """
    markings = reached(net)
    if markings is None:
        return {}
    bit = {place.name: 1 << i for i, place in enumerate(net.places)}

    def together(one: Place, other: Place) -> bool:
        both = bit[one.name] | bit[other.name]
        return one is not other and any(marking & both == both for marking in markings)

    sharing = {p.name: [q for q in net.places if q.completion == p.completion] for p in net.places if p.completion}
    waited = [
        place
        for place in net.places
        if place.command and place.completion and _is_waited_for(net, place)
        # A completion that two commands wait for at once does not say which of them has ended.
        if not any(together(place, other) for other in sharing[place.name])
    ]
    return {
        place.name: frozenset(
            rival.name
            for rival in waited
            if rival.command and rival.command.machine == place.command.machine and not together(place, rival)
        )
        for place in net.places
        if place.command
    }


def reached(net: Net) -> set[int] | None:
    """The markings that a net reaches with its external gates free; None where they are more than are looked at."""
    player = TokenPlayer.of(net)
    markings = {net.initial_marking}
    todo = [net.initial_marking]
    while todo:
        word = todo.pop()
        for compiled in player.transitions.values():
            if compiled.openable and compiled.firable(word, player.places):
                after = player.marking(compiled.fire(word))
                if after not in markings:
                    if len(markings) == _MARKINGS_MAX:
                        return None
                    markings.add(after)
                    todo.append(after)
    return markings


def _is_waited_for(net: Net, place: Place) -> bool:
    takers = (t for t in net.transitions if place.name in t.inputs)
    return all(any(g.signal == place.completion and g.wanted for g in t.external) for t in takers)
