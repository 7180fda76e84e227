"""What of a controller alone is not told apart: the quotient that lets its exploration end.

A controller alone is in the widest surroundings, where whatever may happen is tried. So what it remembers need not be
told apart where every value of it is tried anyway, or where no act reads it. Each line below but the last two takes
only differences away that other configurations have as well: whatever a controller may do, it does in the
configuration it is like. That is meant to be a quotient by an abstraction that only adds runs (Clarke, Grumberg and
Long, TOPLAS 1994), of the code itself; it is argued here, line by line, and proved nowhere.

- *Whose turn it is*: which local transition fired last only shares out turns. It is forgotten, and `fire` is tried
  behind each of them (`lasts`).
- *Which command came first*, of different counts: it is the order in which they are asked after, no more.
- *What was told last*: whether the next report is a new one depends on whether what is enabled now is what was told.
  Where it is not, the report is replaced by one that names nothing there is (`STALE`), and what is enabled may at any
  time be what was told once more (`told_again`). Should the code ever send what it told before, its message names that.
- *Of what was seen* it only matters whether it is all that was told.
- *How often it has restarted*: its numbers are those of a restart, however many there were. So it may restart as often
  as it likes.
- *Rounds that are over*, or in which nothing was promised: what it does about one of them does not depend on others. So
  of these *idle* rounds so many are known at once as are asked for, and of more each choice is tried (`forgetting`).
- *What a coordinator has closed, and was told*: it matters to what arrives of this coordinator, and to nothing else. So
  one coordinator at most is in focus; of the others the controller knows its promises alone, and the rest as at a first
  start. Where none is, rounds, tokens, commands, sensors and restarts are explored, and what is closed is not.

The last two rest on how the code is made. Tests hold acts on a cell before forgetting to those after it, and the acts
of controllers among all machines, which forget nothing, to those that were explored with a coordinator in focus; that
is no proof of them. Rejected: the product of all these, which has no end for the conveyors of a cell, as things that
have nothing to do with each other multiply.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Final

from firable.executor.protocol.above import Above
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.deciders import closed_key
from firable.executor.protocol.messages import EPOCH_BITS, Readiness
from firable.executor.simulation.numbering import Kept

STALE: Final = frozenset({"(told before)"})
"""What a report names that is not what is enabled now."""
_NOWHERE: Final = -1 << 62
"""The mask of that."""


def liken(machine: LocalController, kept: Kept) -> None:
    """Take away what is not told apart behind any act, of a controller and of what it has kept."""
    machine.arbiter.last = -1
    machine.commands.newest = dict(sorted(machine.commands.newest.items()))
    if machine.epoch > 1:
        _restart_once(machine, kept)
    for above in machine.above.values():
        above.seen = above.seen if above.seen == above.told else -1
        above.dismissed = above.dismissed if above.dismissed == above.readiness.sequence else -1
        if _is_news(machine, above):
            epoch = above.epoch if above.readiness.epoch == above.epoch else -1
            above.readiness, above.ready_mask = Readiness(above.readiness.sequence, STALE, epoch), _NOWHERE


def lasts(machine: LocalController) -> Iterator[int]:
    """The local transitions behind which the next one may be looked for, by their indexes."""
    return (t for t in range(len(machine.transitions)) if machine.local_mask >> t & 1)


def may_be_told_again(machine: LocalController, above: Above) -> bool:
    """Whether what is enabled now may be what was told last, as far as the numbers say."""
    known = above.readiness
    return known.transitions is STALE and known.epoch == above.epoch and known.sequence >= machine.epoch << EPOCH_BITS


def told_again(machine: LocalController, above: Above) -> None:
    """What is enabled now is what was told last."""
    known = above.readiness
    fresh = machine._readiness(above)
    above.readiness = replace(fresh, sequence=known.sequence)


def idle(machine: LocalController, kept: Kept) -> frozenset[int]:
    """The rounds that a controller knows, and in which nothing is promised."""
    found = {n for n, promise in machine.promises.items() if not promise.promised} | machine.closed
    for name in machine.above:
        found |= _closed(kept, name)[1]
    return frozenset(found)


def forgetting(machine: LocalController, kept: Kept, most: int, focus: frozenset[str]) -> Iterator[frozenset[int]]:
    """Each choice of idle rounds to forget, so that so many are left, of coordinators in focus."""
    known = idle(machine, kept)
    mine = sorted(n for n in known if machine.coordinator_of(n) in focus)
    yield from (known - set(left) for left in combinations(mine, min(most, len(mine))))


def forget(machine: LocalController, kept: Kept, rounds: frozenset[int], focus: frozenset[str]) -> None:
    """Forget idle rounds, and of coordinators out of focus all but what is promised."""
    machine.closed -= rounds
    machine.promises = {n: promise for n, promise in machine.promises.items() if n not in rounds}
    for above in machine.above.values():
        below, numbers = _closed(kept, above.name)
        if above.name not in focus:
            kept.pop(closed_key(above.name), None)
            above.closed_below = above.kept_below = above.epoch = 0
            above.readiness, above.ready_mask = Readiness(machine.epoch << EPOCH_BITS, frozenset(), above.epoch), 0
            told_again(machine, above)
            above.told = above.seen = above.readiness.sequence
        elif numbers & rounds:
            kept[closed_key(above.name)] = below, tuple(sorted(numbers - rounds))


def _closed(kept: Kept, coordinator: str) -> tuple[int, frozenset[int]]:
    match kept.get(closed_key(coordinator)):
        case [int(below), [*numbers]]:
            return below, frozenset(int(str(number)) for number in numbers)
    return 0, frozenset()


def _is_news(machine: LocalController, above: Above) -> bool:
    """Whether a report would be a new one, as the machine itself says."""
    known = above.readiness, above.ready_mask
    is_news = machine._readiness(above) is not known[0]
    above.readiness, above.ready_mask = known
    return is_news


def _restart_once(machine: LocalController, kept: Kept) -> None:
    shift = (machine.epoch - 1) << EPOCH_BITS
    for above in machine.above.values():
        above.readiness = replace(above.readiness, sequence=above.readiness.sequence - shift)
        above.told -= shift
        above.seen = max(-1, above.seen - shift)
        above.dismissed = max(-1, above.dismissed - shift)
    machine.epoch = 1
    kept["epoch"] = 1
