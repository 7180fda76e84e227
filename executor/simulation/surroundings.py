"""What may arrive at a controller: everything that the proof of the protocol leaves possible beside what it holds.

A controller alone does not know what was decided. What may arrive is therefore all that contradicts nothing of which
the parametric proof says that it never happens (docs/protocol-invariant.md), whatever was lost, doubled or late:

- a request is of a round of its own epoch, which is not closed as far as the message itself says;
- an order to fire a part finds it promised, or free of promise with its inputs full, their commands taken, and its
  outputs empty; or it is a copy of one that was obeyed;
- no round is closed of which a promise stands, unless its coordinator has restarted since, and has given it up: after
  that nobody commits it;
- `Hello` is said by who has restarted, or to who leaves.

This is the rely of a rely-guarantee argument (Jones, IFIP 1983): that each act of a controller is actions of the proof
is what the others rely on in turn, and as each act comes after all on which it relies, the circle is none. That a free
part is voted for only when its commands are taken the proof does not know: whoever explores has to watch that.
What is left out: a part that only reads is asked for in one round at a time.
A number of a round is one that the controller knows, or lies in a gap between these: it compares numbers, no more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from firable.executor.protocol.above import Above
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import EPOCH_BITS, Decision, Hello, ToController, VoteRequest
from firable.nets.decomposition import Decomposition

Body = tuple[int, tuple[str, ...]] | tuple[int, str | None]
"""A request or an order: of which round, and for what."""


@dataclass(frozen=True, slots=True)
class Reach:
    """How far what may arrive goes."""

    idle: int = 1
    """Of so many rounds a controller knows at once that they are over, or that it has promised nothing in them."""
    rounds: int | None = None
    """Of so many rounds it knows at once that are promised or over; None is of any number."""
    restarts: int = 0
    """How often each coordinator restarts."""
    leaving: bool = False
    """Whether the controller may be told that no round needs it."""
    focus: str | None = None
    """Of which coordinator all may arrive; of the others, or of all, what has to do with promises alone."""


class Surroundings:
    """What may arrive at the controllers of a decomposition."""

    def __init__(self, decomposition: Decomposition, reach: Reach) -> None:
        self.reach = reach
        self.groups = {name: Coordinator(decomposition, name).groups for name in coordinators(decomposition)}
        """The groups of transitions that each coordinator decides."""

    def messages(self, machine: LocalController) -> Iterator[ToController]:
        """What may arrive at a controller whose numbers leave gaps."""
        name = machine.name
        for above in machine.above.values():
            if self.reach.focus != above.name:
                yield from self._beside(machine, above)
                continue
            for epoch in range(self.reach.restarts + 1):
                # What says nothing new is said once.
                is_news = above.seen < above.told and epoch >= above.epoch
                seens = [-1, above.told] if is_news or epoch > above.epoch else [above.seen]
                for below in self._belows(machine, above, epoch):
                    bodies = list(dict.fromkeys(self._bodies(machine, above, epoch, below)))
                    for seen in seens:
                        for number, what in bodies:
                            if isinstance(what, tuple):
                                yield VoteRequest(name, number, what, below, seen, epoch, above.name)
                            else:
                                yield Decision(name, number, what, below, seen, epoch, above.name)
                    for seen in seens if self.reach.leaving else [-1] if epoch else []:
                        yield Hello(name, below, seen, epoch, above.name)

    def _beside(self, machine: LocalController, above: Above) -> Iterator[ToController]:
        """What may arrive of a coordinator of which nothing is known but promises."""
        first = machine.coordinators.index(above.name)
        for number, what in dict.fromkeys(self._bodies(machine, above, above.epoch, 0)):
            if number == first:
                continue  # as good as any later one, where nothing is closed
            if isinstance(what, tuple):
                yield VoteRequest(machine.name, number, what, 0, above.seen, above.epoch, above.name)
            else:
                yield Decision(machine.name, number, what, 0, above.seen, above.epoch, above.name)
        # It has restarted, and has given up some of what it had not decided.
        promised = sorted(n for n in machine.promises if machine.above_of(n) is above)
        for below in (0, *(n + len(machine.coordinators) for n in promised)):
            yield Hello(machine.name, below, -1, above.epoch + 1, above.name)

    def _belows(self, machine: LocalController, above: Above, epoch: int) -> list[int]:
        """Below which round all may be said to be closed: nothing new, or more than the controller knows."""
        found = {middle for e in range(epoch + 1) for _, middle, _ in _gaps(machine, above, e)}
        found |= {_begin(machine, above, e) for e in range(epoch + 1)}
        found |= {n for n in _rounds(machine, above) if _epoch(n) <= epoch}
        found = {n for n in found if n > above.closed_below}
        found.add(above.closed_below if _epoch(above.closed_below) <= epoch else 0)
        open_ = [n for n in machine.promises if machine.above_of(n) is above and _epoch(n) >= epoch]
        return sorted(n for n in found if all(each >= n for each in open_))

    def _numbers(self, machine: LocalController, above: Above, epoch: int, below: int) -> list[int]:
        """The rounds that a message may be of: those that are known, and others in every place among them."""
        found = {above.closed_below, above.kept_below}
        for e in range(epoch + 1):
            found.add(_begin(machine, above, e))
            for gap in _gaps(machine, above, e):
                found |= {*gap} if below in gap else {gap[1]}
        known = _rounds(machine, above)
        others = {n for n in {*machine.promises, *machine.closed} if n not in known or n >= below}
        if self.reach.rounds is not None and len(others) >= self.reach.rounds:
            found = {n for n in found if n < max(below, above.closed_below)}
        first = machine.coordinators.index(above.name)
        return sorted(n for n in {*_rounds(machine, above), *found} if n >= first and _epoch(n) <= epoch)

    def _promised_again(self, machine: LocalController, number: int) -> set[str]:
        """The parts that only read, and are promised in another round; any number of rounds could promise them."""
        promised = {t for n, each in machine.promises.items() if n != number for t in each.promised}
        return {t for t in promised if not machine.parts[t].writes}

    def _bodies(self, machine: LocalController, above: Above, epoch: int, below: int) -> Iterator[Body]:
        for n in self._numbers(machine, above, epoch, below):
            is_over = n in machine.closed or n < above.closed_below
            promise = machine.promises.get(n)
            promised = frozenset[str]() if promise is None else promise.promised
            for group in self.groups[above.name]:
                if not promised <= set(group):
                    continue
                mine = [t for t in group if t in above.parts]
                asked = [t for t in mine if t not in machine.free]
                if _epoch(n) == epoch and n >= below:
                    again = self._promised_again(machine, n)
                    some = (names for names in _some(asked) if promised <= set(names) and again.isdisjoint(names))
                    yield from ((n, names) for names in some)
                yield n, None  # an abort, or the answer to a vote of a round that nobody knows
                if n < below:
                    continue
                yield from ((n, t) for t in group if t not in above.parts)
                yield from ((n, t) for t in asked if t in promised or is_over)
                yield from ((n, t) for t in mine if t in machine.free and (is_over or _stands(machine, t)))


def _stands(machine: LocalController, t: str) -> bool:
    """Whether the vote of a part that is free of promise may stand: its inputs are full and held, its outputs empty."""
    part = machine.parts[t]
    return machine.word & part.takes == part.takes and not machine.word & part.puts and not part.takes & machine.unsent


def _some(names: list[str]) -> Iterator[tuple[str, ...]]:
    for count in range(1, len(names) + 1):
        yield from combinations(names, count)


def _epoch(number: int) -> int:
    return number >> EPOCH_BITS


def _rounds(machine: LocalController, above: Above) -> list[int]:
    """The rounds of a coordinator that a controller knows."""
    return sorted(n for n in {*machine.promises, *machine.closed} if machine.above_of(n) is above)


def _begin(machine: LocalController, above: Above, epoch: int) -> int:
    """The first round of an epoch."""
    begin = epoch << EPOCH_BITS
    return begin + (machine.coordinators.index(above.name) - begin) % len(machine.coordinators)


def _gaps(machine: LocalController, above: Above, epoch: int) -> list[tuple[int, int, int]]:
    """Three numbers of each gap between those of an epoch that the controller knows."""
    stride, begin = len(machine.coordinators), _begin(machine, above, epoch)
    known = {*_rounds(machine, above), above.closed_below, above.kept_below}
    ends = {begin} | {n for n in known if _epoch(n) == epoch and n >= begin}
    return [(n + stride, n + 2 * stride, n + 3 * stride) for n in sorted(ends)]
