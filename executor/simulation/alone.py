"""A controller explored alone, in the widest surroundings that the proof of the protocol leaves it.

All machines of a cell together have too many interleavings to be explored one by one. But a controller sees nothing of
the others than messages, and `surroundings` says which may arrive in whatever it holds. So each controller is explored
on its own, with its machines of the cell, its sensors and its stable storage; any number of messages is lost, doubled
and late. A controller that mostly votes comes to an end after some hundred configurations, one with many steps of its
own after thousands, or not in minutes. Where it ends, what the controller does in any run of the cell it does here, as
far as `Reach` and the budget of its own crashes go, and but for what `likeness` does not tell apart: that what is
closed has nothing to do with the rest is argued there and tested, not proved.

Numbers are counted from the beginning as in the exploration of all machines, and then with gaps between them, so that
there are numbers for what arrives. Zero is not moved: it is where a controller begins that has heard of nothing, and
nothing is below it. Of what a controller has seen it only matters whether it is all that it has told.
Rejected: messages that machines really sent, put before every configuration of their receiver; almost all of these
pairs are of two different times of the cell, and what a machine does with an order out of nowhere says nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import EPOCH_BITS, Effect, Message
from firable.executor.protocol.token_player import Word
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.likeness import (
    forget,
    forgetting,
    lasts,
    liken,
    may_be_told_again,
    told_again,
)
from firable.executor.simulation.numbering import Kept, Kind, Ranking, apply, count_of
from firable.executor.simulation.repertoire import Budget, Configuration, Job, Step
from firable.executor.simulation.snapshots import clone
from firable.executor.simulation.surroundings import Reach, Surroundings
from firable.nets.decomposition import Decomposition

PASSING_MAX: Final = 20_000
"""So many are remembered beside those of configurations, in about two gibibytes; what they do is done anew then."""


class OneMachine(Explorer, ABC):
    """Explores one machine of a decomposition; the other machines of its configurations are those of the start."""

    def __init__(
        self,
        decomposition: Decomposition,
        name: str,
        *,
        coordinator: type[Coordinator] = Coordinator,
        controller: type[LocalController] = LocalController,
    ) -> None:
        super().__init__(decomposition, coordinator=coordinator, controller=controller)
        self.which = self.names.index(name)
        self.budget: Budget | None = None
        self.spread = _Spread(self.coordinators)
        self.reached: set[int] = set()
        """The machines of configurations; all others are only met between two of them."""
        self.passing_max = PASSING_MAX
        self.choices: dict[int, list[int]] = {}
        self.recounted: dict[tuple[int, frozenset[Job]], tuple[int, frozenset[Job]]] = {}

    def steps(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen to the machine, and where it leads."""
        self.reached.update(at.machines)
        if len(self.machines) > len(self.reached) + self.passing_max:
            self.forget_but(self.reached)
            self.choices.clear()
            self.recounted.clear()
        for step, after in self.happenings(at):
            number = after.machines[self.which]
            if (known := self.choices.get(number)) is None:
                known = self.choices[number] = list(self.likened(number))
            for left in known:
                found = after if left == number else self.counted(self.at(left, after, after.jobs))
                self.reached.add(found.machines[self.which])
                yield step, found

    @abstractmethod
    def happenings(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen to the machine, and where it leads, with all that the machine knows."""
        ...

    @abstractmethod
    def likened(self, number: int) -> Iterator[int]:
        """The machines like one, which know less."""
        ...

    def initial(self, budget: Budget) -> Configuration:
        """The machine started for the first time; of what it may suffer once it may suffer any number."""
        self.budget = budget
        return super().initial(budget)

    def counted(self, found: Configuration) -> Configuration:
        """The configuration with the numbers of the machine counted from the beginning; nothing is under way."""
        number = found.machines[self.which]
        if (known := self.recounted.get((number, found.jobs))) is None:
            ranking = self.ranking((number, *found.jobs))
            jobs = ((p, ranking.entry(count_of(p, self.net), entry), how) for p, entry, how in found.jobs)
            known = self.recounted[number, found.jobs] = self._renumbered(number, ranking), frozenset(jobs)
        return self.at(known[0], found, known[1])

    def ranking(self, parts: Sequence[int | Message | Job]) -> Ranking:
        """The numbers of a machine, and of what it meets, in their order."""
        collected: dict[Kind, set[int]] = {}
        for part in parts:
            for kind, numbers in self._numbers(part).items():
                collected[kind] = collected.get(kind, set()) | numbers
        for kind, numbers in collected.items():
            if kind[0] == "round":
                numbers.add(self.coordinators.index(kind[2]))
        return Ranking(collected.items(), self.coordinators)

    def fired(self, central: Word, effects: Sequence[Effect]) -> Word:
        """Nothing: what the central net holds besides is not known here."""
        del effects
        return central

    def at(self, number: int, like: Configuration, jobs: frozenset[Job]) -> Configuration:
        """The configuration in which it is the machine of this number."""
        machines = (*like.machines[: self.which], number, *like.machines[self.which + 1 :])
        return Configuration(machines, frozenset(), jobs, self.budget or like.budget, like.central)

    def spread_out(self, number: int) -> int:
        """The machine with gaps between its numbers."""
        if (known := self.acts.get((number, "spread"))) is None:
            stored = self.machines[number]
            machine = clone(stored.machine)
            kept = apply(machine, stored.kept, self.spread)
            known = self.acts[number, "spread"] = (self._number(machine, kept), ())
        return known[0]


class Alone(OneMachine):
    """Explores one controller of a decomposition."""

    def __init__(
        self,
        decomposition: Decomposition,
        name: str,
        reach: Reach,
        *,
        controller: type[LocalController] = LocalController,
    ) -> None:
        super().__init__(decomposition, name, controller=controller)
        self.sensors = tuple(sensor for sensor in self.sensors if self.owner_of[sensor] == self.which)
        self.surroundings = Surroundings(decomposition, reach)
        self.focus = frozenset([] if reach.focus is None else [reach.focus])

    def happenings(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen to the controller, and where it leads, with all that it knows."""
        which, number = self.which, self.spread_out(at.machines[self.which])
        at = self.at(number, at, at.jobs)
        machine = self.controller(number)
        for message in self.surroundings.messages(machine):
            yield from self._arrives(at, message)
        yield from self._acts_of(at, which)
        for last in lasts(machine):
            yield from self._does(at, "fire", which, last, partial(_fire_behind, last))
        yield from self._of_cell(at)
        yield from self._does(at, "repeat", which, None, lambda machine: machine.resend())
        for above in machine.above.values():
            if may_be_told_again(machine, above):
                again, _ = self.act(number, ("told again", above.name), partial(_told_again, above.name))
                yield Step("told again", -1, None, (), number, again), self.counted(self.at(again, at, at.jobs))
        if at.budget.crashes:
            yield self._crashes(at, which, at, number, ())

    def likened(self, number: int) -> Iterator[int]:
        """The controllers like one: of what it knows of idle rounds, each choice."""
        idle, kept = self.surroundings.reach.idle, self.machines[number].kept
        for rounds in forgetting(self.controller(number), kept, idle, self.focus):
            machine, left = clone(self.controller(number)), dict(kept)
            forget(machine, left, rounds, self.focus)
            yield self.kept(machine, left, ())

    def liken(self, machine: LocalController | Coordinator, kept: Kept) -> None:
        """Take away of a machine what is not told apart behind any act."""
        super().liken(machine, kept)
        if isinstance(machine, LocalController):
            liken(machine, kept)

    def controller(self, number: int) -> LocalController:
        """A controller, to look at."""
        machine = self.machine(number)
        if not isinstance(machine, LocalController):
            raise TypeError(f"{machine.name!r} is no controller")
        return machine


def _fire_behind(last: int, machine: LocalController) -> list[Effect]:
    machine.arbiter.last = last
    return machine.fire()


def _told_again(name: str, machine: LocalController) -> list[Effect]:
    told_again(machine, machine.above[name])
    return []


class _Spread:
    """Puts a gap of three before each number of a round, but before the first of all."""

    def __init__(self, coordinators: Sequence[str]) -> None:
        self.coordinators = coordinators
        self.has_room_before_all = False

    def round(self, coordinator: str, number: int) -> int:
        """The number of a round, with room for others before it."""
        first, stride = self.coordinators.index(coordinator), len(self.coordinators)
        if number < first:
            return number
        begin = number >> EPOCH_BITS << EPOCH_BITS
        begin += (first - begin) % stride
        return begin + 4 * (number - begin) + (4 * stride if number >> EPOCH_BITS or self.has_room_before_all else 0)

    def report(self, controller: str, coordinator: str, number: int) -> int:
        """The number of a report."""
        del controller, coordinator
        return number

    def entry(self, count: str, number: int) -> int:
        """The number of a command."""
        del count
        return number
