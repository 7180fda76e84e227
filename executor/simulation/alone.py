"""A controller explored alone, in the widest surroundings that the proof of the protocol leaves it.

All machines of a cell together have too many interleavings to be explored one by one. But a controller sees nothing of
the others than messages, and `surroundings` says which may arrive in whatever it holds. So each controller is explored
on its own, with its machines of the cell, its sensors and its stable storage; any number of messages is lost, doubled
and late. A controller that mostly votes comes to an end after some hundred configurations, one with many steps of its
own after thousands, or not in minutes. Where it ends, what the controller does in any run of the cell it does here, as
far as `Reach` and the budget of its own crashes go.

Numbers are counted from the beginning as in the exploration of all machines, and then with gaps between them, so that
there are numbers for what arrives. Zero is not moved: it is where a controller begins that has heard of nothing, and
nothing is below it. Of what a controller has seen it only matters whether it is all that it has told.
Rejected: messages that machines really sent, put before every configuration of their receiver; almost all of these
pairs are of two different times of the cell, and what a machine does with an order out of nowhere says nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import EPOCH_BITS, Effect, Message
from firable.executor.protocol.token_player import Word
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.numbering import Kept, Kind, Ranking, apply, count_of
from firable.executor.simulation.repertoire import Configuration, Job, Step
from firable.executor.simulation.snapshots import clone
from firable.executor.simulation.surroundings import Reach, Surroundings
from firable.nets.decomposition import Decomposition


class Alone(Explorer):
    """Explores one controller of a decomposition; the other machines of its configurations are those of the start."""

    def __init__(
        self,
        decomposition: Decomposition,
        name: str,
        reach: Reach,
        *,
        controller: type[LocalController] = LocalController,
    ) -> None:
        super().__init__(decomposition, controller=controller)
        self.which = self.names.index(name)
        self.sensors = tuple(sensor for sensor in self.sensors if self.owner_of[sensor] == self.which)
        self.surroundings = Surroundings(decomposition, reach)
        self.spread = _Spread(self.coordinators)
        self.recounted: dict[tuple[int, frozenset[Job]], tuple[int, frozenset[Job]]] = {}

    def steps(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen to the controller, and where it leads."""
        which, number = self.which, self._spread(at.machines[self.which])
        at = self._with(number, at, at.jobs)
        machine = self.machine(number)
        if not isinstance(machine, LocalController):
            raise TypeError(f"{self.names[which]!r} is no controller")
        for message in self.surroundings.messages(machine):
            yield from self._arrives(at, message)
        yield from self._acts_of(at, which)
        yield from self._of_cell(at)
        yield from self._does(at, "repeat", which, None, lambda machine: machine.resend())
        if at.budget.crashes:
            yield self._crashes(at, which, at, number, ())

    def counted(self, found: Configuration) -> Configuration:
        """The configuration with the numbers of the controller counted from the beginning; nothing is under way."""
        number = found.machines[self.which]
        if (known := self.recounted.get((number, found.jobs))) is None:
            ranking = self.ranking((number, *found.jobs))
            jobs = ((p, ranking.entry(count_of(p, self.net), entry), how) for p, entry, how in found.jobs)
            known = self.recounted[number, found.jobs] = self._renumbered(number, ranking), frozenset(jobs)
        return self._with(known[0], found, known[1])

    def ranking(self, parts: Sequence[int | Message | Job]) -> Ranking:
        """The numbers of a controller, and of what it meets, in their order."""
        collected: dict[Kind, set[int]] = {}
        for part in parts:
            for kind, numbers in self._numbers(part).items():
                collected[kind] = collected.get(kind, set()) | numbers
        for kind, numbers in collected.items():
            if kind[0] == "round":
                numbers.add(self.coordinators.index(kind[2]))
        return Ranking(collected.items(), self.coordinators)

    def kept(self, machine: LocalController | Coordinator, kept: Kept, effects: Sequence[Effect]) -> int:
        """The number of a machine, of which it is only known whether all that it has told was seen."""
        if isinstance(machine, LocalController):
            for above in machine.above.values():
                above.seen = above.seen if above.seen == above.told else -1
                above.dismissed = above.dismissed if above.dismissed == above.readiness.sequence else -1
        return super().kept(machine, kept, effects)

    def fired(self, central: Word, effects: Sequence[Effect]) -> Word:
        """Nothing: what the central net holds besides is not known here."""
        del effects
        return central

    def _with(self, number: int, at: Configuration, jobs: frozenset[Job]) -> Configuration:
        machines = (*at.machines[: self.which], number, *at.machines[self.which + 1 :])
        return Configuration(machines, frozenset(), jobs, at.budget, at.central)

    def _spread(self, number: int) -> int:
        if (known := self.acts.get((number, "spread"))) is None:
            stored = self.machines[number]
            machine = clone(stored.machine)
            kept = apply(machine, stored.kept, self.spread)
            known = self.acts[number, "spread"] = (self._number(machine, kept), ())
        return known[0]


class _Spread:
    """Puts a gap of three before each number of a round, but before the first of all."""

    def __init__(self, coordinators: Sequence[str]) -> None:
        self.coordinators = coordinators

    def round(self, coordinator: str, number: int) -> int:
        """The number of a round, with room for others before it."""
        first, stride = self.coordinators.index(coordinator), len(self.coordinators)
        if number < first:
            return number
        begin = number >> EPOCH_BITS << EPOCH_BITS
        begin += (first - begin) % stride
        return begin + 4 * (number - begin) + (4 * stride if number >> EPOCH_BITS else 0)

    def report(self, controller: str, coordinator: str, number: int) -> int:
        """The number of a report."""
        del controller, coordinator
        return number

    def entry(self, count: str, number: int) -> int:
        """The number of a command."""
        del count
        return number
