"""Numbers counted from the beginning: configurations that differ only in how far they have counted are one.

Rounds, reports and commands are numbered upwards for ever, so no configuration would ever come again. But the machines
only compare numbers, and count on from the largest. So a configuration behaves as the one in which its numbers are
replaced, in their order, by the first ones of their epoch. This is the reduction by data symmetry of Ip and Dill
(Formal Methods in System Design 9, 1996), for a type of which only the order matters. Where the net has layers, each
coordinator counts rounds of its own, whose numbers tell whose they are; these keep that, and only they are in order.
Times are numbers too, of which only one thing matters here, where any may be over at any moment: whether it has begun.
Rejected: to end after so many rounds; what needs one round more would never be seen.

What counts what has to be known, and is said here once, in `apply` and `apply_message`: one walk over all numbers, with
a `Numbering` that collects them or replaces them. A field of a machine that this walk has not been told of is refused:
a number that it overlooks would keep apart what is the same or, worse, be compared to others that were replaced.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import inf
from typing import Final, Protocol

from firable.executor.protocol.commands import PREFIX, Commands
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Acknowledgement,
    Decision,
    Hello,
    Message,
    Readiness,
    Report,
    Stored,
    Vote,
    VoteRequest,
)
from firable.nets.net import Net

Kept = dict[str, Stored]
Kind = tuple[str, str, str]
"""What is numbered: rounds of a coordinator, reports of a controller to a coordinator, commands of one count."""

_CONTROLLER: Final = frozenset(
    {
        *("name", "subnet", "player", "parts", "transitions", "enabled", "rows", "local_mask", "arbiter", "kept_turns"),
        *("word", "kept_word", "promises", "closed", "coordinators", "above", "latched", "commands", "timers"),
        *("unsent", "untold", "held", "leaving", "forgone", "index_of", "epoch", "free", "free_mask", "lasting"),
    }
)
_COORDINATOR: Final = frozenset(
    {
        *("name", "first_round", "stride", "player", "participants", "arbiter", "kept_turns", "groups", "group_of"),
        *("seen", "ready", "waiting", "rounds", "epoch", "next_round", "permits", "free", "of_free", "lately"),
    }
)
_LOW: Final = (1 << EPOCH_BITS) - 1


class Numbering(Protocol):
    """What is done with each number."""

    def round(self, coordinator: str, number: int) -> int:
        """The number of a round of a coordinator."""
        ...

    def report(self, controller: str, coordinator: str, number: int) -> int:
        """The number of a report of a controller to a coordinator."""
        ...

    def entry(self, count: str, number: int) -> int:
        """The number of a command, by what counts it: a completion signal or a place."""
        ...


class Collecting:
    """Collects the numbers that there are."""

    def __init__(self) -> None:
        self.found: dict[Kind, set[int]] = {}

    def round(self, coordinator: str, number: int) -> int:
        """Note the number of a round."""
        return self._note(("round", "", coordinator), number)

    def report(self, controller: str, coordinator: str, number: int) -> int:
        """Note the number of a report."""
        return self._note(("report", controller, coordinator), number)

    def entry(self, count: str, number: int) -> int:
        """Note the number of a command."""
        return self._note(("entry", count, ""), number)

    def _note(self, kind: Kind, number: int) -> int:
        self.found.setdefault(kind, set()).add(number)
        return number


class Ranking:
    """Replaces each number by its rank among those of its epoch; what comes before the first of an epoch stays.

    `coordinators` number every so many-th round, in this order.
    """

    def __init__(self, found: Iterable[tuple[Kind, set[int]]], coordinators: Sequence[str] = ("",)) -> None:
        self.ranks: dict[Kind, dict[int, int]] = {}
        for kind, numbers in found:
            ranks = self.ranks[kind] = {}
            first = {"entry": 1, "round": coordinators.index(kind[2])}.get(kind[0], 0)
            stride = len(coordinators) if kind[0] == "round" else 1
            counted: dict[int, int] = {}
            for number in sorted(numbers):
                epoch = number >> EPOCH_BITS
                if number & _LOW == _LOW or number < first:
                    ranks[number] = number
                else:
                    begin = epoch << EPOCH_BITS
                    skipped = (first - begin) % stride if kind[0] == "round" else first
                    ranks[number] = counted.get(epoch, begin + skipped)
                    counted[epoch] = ranks[number] + stride
        self.changes_nothing = all(n == rank for ranks in self.ranks.values() for n, rank in ranks.items())
        """Whether each number is its rank."""

    def round(self, coordinator: str, number: int) -> int:
        """The rank of a round."""
        return self.ranks["round", "", coordinator][number]

    def report(self, controller: str, coordinator: str, number: int) -> int:
        """The rank of a report."""
        return self.ranks["report", controller, coordinator][number]

    def entry(self, count: str, number: int) -> int:
        """The rank of a command."""
        return self.ranks["entry", count, ""][number]


def apply_message(message: Message, on: Numbering) -> Message:
    """A message with its numbers replaced."""
    controller, coordinator = message.controller, message.coordinator
    match message:
        case Report():
            return replace(message, readiness=_readiness(controller, coordinator, message.readiness, on))
        case Vote() | Acknowledgement():
            readiness = _readiness(controller, coordinator, message.readiness, on)
            return replace(message, round=on.round(coordinator, message.round), readiness=readiness)
        case VoteRequest() | Decision():
            return replace(
                message,
                round=on.round(coordinator, message.round),
                closed_below=on.round(coordinator, message.closed_below),
                seen=on.report(controller, coordinator, message.seen),
            )
        case Hello():
            seen = on.report(controller, coordinator, message.seen)
            return replace(message, closed_below=on.round(coordinator, message.closed_below), seen=seen)


def apply(machine: LocalController | Coordinator, kept: Kept, on: Numbering) -> Kept:
    """Replace the numbers of a machine, and return what it kept with its numbers replaced."""
    known = _CONTROLLER if isinstance(machine, LocalController) else _COORDINATOR
    if unknown := vars(machine).keys() - known:
        raise TypeError(f"it is not known whether {sorted(unknown)} of {type(machine).__name__} hold numbers")
    if isinstance(machine, Coordinator):
        name = machine.name
        machine.next_round = on.round(name, machine.next_round)
        machine.seen = {each: on.report(each, name, number) for each, number in machine.seen.items()}
        for opened in machine.rounds.values():
            opened.number = on.round(name, opened.number)
        machine.rounds = {opened.number: opened for opened in machine.rounds.values()}
        return {_key(key, lambda number: on.round(name, number)): value for key, value in kept.items()}

    def renumbered(number: int) -> int:
        return on.round(machine.coordinator_of(number), number)

    machine.promises = {renumbered(number): promise for number, promise in machine.promises.items()}
    machine.closed = {renumbered(number) for number in machine.closed}
    for above in machine.above.values():
        above.closed_below = on.round(above.name, above.closed_below)
        above.kept_below = on.round(above.name, above.kept_below)
        above.readiness = _readiness(machine.name, above.name, above.readiness, on)
        above.told = on.report(machine.name, above.name, above.told)
        above.seen = on.report(machine.name, above.name, above.seen)
        above.dismissed = on.report(machine.name, above.name, above.dismissed)
    _commands(machine.commands, on)
    return {_key(key, renumbered): _value(key, value, machine.subnet, on) for key, value in kept.items()}


def forget_times(machine: LocalController | Coordinator) -> None:
    """Leave of the times of a controller only whether they have begun."""
    if isinstance(machine, LocalController):
        timers = machine.timers
        timers.running = {place: inf if due > -inf else due for place, due in timers.running.items()}


def count_of(place: str, net: Net) -> str:
    """What counts the commands of a place."""
    return net.place(place).completion or place


def _commands(commands: Commands, on: Numbering) -> None:
    for command in commands.newest.values():
        command.entry = on.entry(count_of(command.place, commands.subnet), command.entry)


def _readiness(controller: str, coordinator: str, readiness: Readiness, on: Numbering) -> Readiness:
    return replace(readiness, sequence=on.report(controller, coordinator, readiness.sequence))


def _key(key: str, renumbered: Callable[[int], int]) -> str:
    kind, slash, number = key.partition("/")
    return f"{kind}/{renumbered(int(number))}" if slash and kind in ("promise", "round") else key


def _value(key: str, value: Stored, net: Net, on: Numbering) -> Stored:
    match value:
        case [int(below), [*numbers]] if key.partition("/")[0] == "closed":
            name = key.partition("/")[2]  # of the coordinator, as `deciders.closed_key` has it
            return on.round(name, below), tuple(on.round(name, int(str(number))) for number in numbers)
        case [str(place), int(entry), str(stage)] if key.startswith(PREFIX):
            return place, on.entry(count_of(place, net), entry), stage
    return value
