"""What may arrive at a coordinator about one group: everything that the proof of the protocol leaves possible.

A coordinator alone does not know what its controllers hold. What may arrive is therefore all that contradicts nothing
of which the parametric proof says that it never happens (docs/protocol-invariant.md), whatever was lost, doubled or
late:

- a vote of an open round says yes to anything that it has asked of who votes; a vote of a round that is decided, over,
  or of before a restart to anything at all;
- an acknowledgement is of a round that is decided, by one to whom its order went, or of a round that is over;
- whatever a controller says brings a report along, newer than all that was heard of it or not, which names any of its
  parts that are free of promise, and was given in this epoch of the coordinator or before;
- a report may be the last of a controller that is about to end.

Of parts that have to promise a report says only when asking is worth while. On that nothing rests, so it is none of
this, but a part of what else there is: a `Setting`, of which every one is possible at any time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

from firable.executor.protocol.coordinator import Coordinator, Round
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Acknowledgement,
    Readiness,
    Report,
    ToCoordinator,
    Vote,
)


@dataclass(frozen=True, slots=True)
class Beside:
    """A round of another group that is open beside those of the group that is explored."""

    group: int
    is_older: bool
    is_committed: bool
    keeps_all: bool = False
    """Whether it disturbs all there is, so that nothing is opened: several rounds of other groups may."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What else there is when something arrives."""

    hinted: tuple[str, ...] = ()
    """Of these transitions everybody has said that they are enabled, one after the other."""
    beside: Beside | None = None


T = TypeVar("T", bound=ToCoordinator)


class Hearing:
    """What may arrive at a coordinator about one of its groups, by its number."""

    def __init__(self, machine: Coordinator, group: int) -> None:
        self.group = machine.groups[group]
        self.participants = tuple(dict.fromkeys(c for t in self.group for c in machine.participants[t]))
        self.parts = {c: [t for t in self.group if c in machine.participants[t]] for c in self.participants}
        self.free = {c: [t for t in self.parts[c] if c in machine.free[t]] for c in self.participants}
        self.promising = {c: [t for t in self.parts[c] if c not in machine.free[t]] for c in self.participants}
        by_parts: dict[object, list[str]] = {}
        for c in self.participants:
            by_parts.setdefault((tuple(self.free[c]), tuple(self.promising[c])), []).append(c)
        self.alike = [names for names in by_parts.values() if len(names) > 1]
        """Controllers that take part in the same transitions in the same way."""
        self.settings = [*self._hints(machine, group), *self._beside(machine, group)]
        others = [g for g in range(len(machine.groups)) if g != group]
        blocking = [Beside(g, is_older=True, is_committed=False, keeps_all=True) for g in others[:1]]
        self.kept_waiting = Setting(beside=blocking[0]) if blocking else None
        """What keeps a round of the group from being opened, where there is another group."""

    def _hints(self, machine: Coordinator, group: int) -> Iterator[Setting]:
        some = [names for count in range(1, len(self.group) + 1) for names in combinations(self.group, count)]
        others = [names for g, names in enumerate(machine.groups) if g != group]
        for names in (*some, *others):
            yield Setting(names)
        # Two groups are asked for in one act, one after the other, where they do not disturb each other.
        for names in others:
            yield Setting((*names, *self.group))

    def _beside(self, machine: Coordinator, group: int) -> Iterator[Setting]:
        for g in range(len(machine.groups)):
            if g != group:
                for is_older in (True, False):
                    for is_committed in (True, False):
                        yield Setting(beside=Beside(g, is_older, is_committed))
                yield Setting(self.group, Beside(g, is_older=True, is_committed=False))

    def messages(self, machine: Coordinator) -> Iterator[ToCoordinator]:
        """What may arrive at a coordinator whose numbers leave gaps."""
        for c in self.participants:
            votes, notes = list(self._votes(machine, c)), list(self._notes(machine, c))
            for told in self._told(machine, c):
                for last in (False, True):
                    yield Report(c, told, machine.name, last)
                for number, promised in votes:
                    yield Vote(c, number, promised, told, machine.name)
                for number in notes:
                    yield Acknowledgement(c, number, told, machine.name)

    def idle(self, machine: Coordinator) -> Report:
        """A message that says nothing: an old report."""
        c = self.participants[0]
        return Report(c, Readiness(machine.seen[c], frozenset(), machine.epoch), machine.name)

    def _told(self, machine: Coordinator, c: str) -> Iterator[Readiness]:
        """What a controller may say of its free parts."""
        seen = machine.seen[c]
        yield Readiness(seen, frozenset(self.free[c]), machine.epoch)  # an older report
        for epoch in {machine.epoch, max(0, machine.epoch - 1)}:
            for count in range(len(self.free[c]) + 1):
                for names in combinations(self.free[c], count):
                    yield Readiness(seen + 1, frozenset(names), epoch)

    def _votes(self, machine: Coordinator, c: str) -> Iterator[tuple[int, frozenset[str]]]:
        if not self.promising[c]:
            return
        everything = frozenset(self.promising[c])
        for opened in machine.rounds.values():
            if c in opened.participants:
                asked = [t for t in self.promising[c] if t in opened.transitions]
                counts = (0, len(asked)) if opened.decided else range(len(asked) + 1)
                yield from (
                    (opened.number, frozenset(names)) for count in counts for names in combinations(asked, count)
                )
        for number in self._over(machine):
            yield from ((number, promised) for promised in (frozenset[str](), everything))

    def _notes(self, machine: Coordinator, c: str) -> Iterator[int]:
        yield from (opened.number for opened in machine.rounds.values() if c in machine.ordered(opened))
        yield from self._over(machine)

    def _over(self, machine: Coordinator) -> Iterator[int]:
        """Rounds that are over: the newest, the oldest, and one of before the restart."""
        numbers = sorted(machine.rounds)
        for number in {machine.next_round - machine.stride, (numbers or [machine.next_round])[0] - machine.stride}:
            if number not in machine.rounds and number >= 0:
                yield number
        if machine.epoch:
            before = [n for n in numbers if n < machine.epoch << EPOCH_BITS]
            yield (before[-1] if before else machine.first_round) + machine.stride


def placed(machine: Coordinator, setting: Setting, group: tuple[str, ...]) -> None:
    """Put a coordinator whose numbers leave gaps where there is this besides."""
    for t in setting.hinted:
        for c in machine.participants[t]:
            if _is_hint(machine, group, t, c):
                machine.ready[c] |= {t}
        machine.waiting.setdefault(machine.group_of[t])
    if setting.beside is not None:
        opened = round_beside(machine, setting.beside)
        machine.rounds = dict(sorted({**machine.rounds, opened.number: opened}.items()))


def round_beside(machine: Coordinator, beside: Beside) -> Round:
    """The round of another group, where its number leaves those of the others their places."""
    numbers = sorted(machine.rounds)
    number = (numbers[0] if beside.is_older and numbers else machine.next_round) - 2 * machine.stride
    names = machine.groups[beside.group]
    opened = machine._round(number, beside.group, names)
    if beside.keeps_all:
        opened.writes = opened.reads = -1
    if beside.is_committed:
        opened.decided, opened.committed = True, names[0]
    elif not opened.participants:
        opened.decided, opened.committed = True, names[-1]  # one in which nobody promises is never undecided
    return opened


def with_hints(message: T, machine: Coordinator, setting: Setting, group: tuple[str, ...]) -> T:
    """The message of a controller that has hinted, too."""
    c = message.controller
    its = {t for t in setting.hinted if c in machine.participants[t] and _is_hint(machine, group, t, c)}
    told = message.readiness
    return replace(message, readiness=replace(told, transitions=told.transitions | its))


def _is_hint(machine: Coordinator, group: tuple[str, ...], t: str, c: str) -> bool:
    """Whether what is said of a part is no vote on the group that is explored."""
    return t not in group or c not in machine.free[t]
