"""The repertoire of an explored space: the machines that were met, and what each does in each act, done only once.

A configuration names machines by numbers. What an act of a machine does depends on this machine alone, so it is looked
up whenever the same machine meets the same message in another configuration. Numbers within machines and messages are
counted from the beginning (`numbering`), so that there are only so many.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import Effect, Keep, Message
from firable.executor.protocol.record import record
from firable.executor.protocol.token_player import TokenPlayer, Word
from firable.executor.simulation.numbering import (
    Collecting,
    Kept,
    Kind,
    Ranking,
    apply,
    apply_message,
    count_of,
    forget_times,
)
from firable.executor.simulation.snapshots import clone, frozen
from firable.nets.decomposition import Decomposition
from firable.nets.net import SignalKind


class Reached(IntEnum):
    """How far a command has come."""

    SENT = 0
    """It is with the driver."""
    TAKEN = 1
    """Its machine is at it."""
    DONE = 2


Job = tuple[str, int, Reached]
"""A command that was sent to a machine of the cell: its place, its entry, and how far it has come."""


@record
class Budget:
    """How many faults of each kind a run may suffer."""

    losses: int = 0
    copies: int = 0
    crashes: int = 0
    giving_up: int = 0
    leaving: int = 0
    """How often a controller takes its votes back, because its host is about to end."""


NO_FAULTS: Final = Budget()


@record
class Configuration:
    """Where everything stands; machines are numbers of `Explorer.machines`, in the order of `Explorer.names`."""

    machines: tuple[int, ...]
    under_way: frozenset[Message]
    jobs: frozenset[Job]
    budget: Budget
    central: Word
    """The marking of the central net, and its signals, after what has fired and was taken in so far."""


@record
class Step:
    """What happens: of which kind, in which machine, with what, and what the machine does; before and after it."""

    kind: str
    machine: int
    about: object
    effects: tuple[Effect, ...]
    before: int
    after: int
    """The machine itself before and after, as numbers of `Explorer.machines`; its numbers not yet replaced."""


@dataclass(slots=True)
class Stored:
    """A machine and what it has kept; never changed, only copied."""

    machine: LocalController | Coordinator
    kept: Kept


Act = Callable[[Any], list[Effect]]
"""A call of a machine."""


class Repertoire:
    """The machines of a decomposition, as many as have been met."""

    def __init__(
        self,
        decomposition: Decomposition,
        *,
        coordinator: type[Coordinator] = Coordinator,
        controller: type[LocalController] = LocalController,
        senses: bool = True,
    ) -> None:
        self.decomposition = decomposition
        self.net = decomposition.net
        self.classes = (coordinator, controller)
        self.central = TokenPlayer.of(self.net)
        self.coordinators = coordinators(decomposition)
        self.names = (*self.coordinators, *(subnet.name for subnet in decomposition.subnets))
        """Coordinators from the top down, then controllers in the order of the decomposition."""
        self.owner_of = {s.name: self.names.index(n.name) for n in decomposition.subnets for s in n.signals}
        sensors = [signal.name for signal in self.net.signals if signal.kind is SignalKind.SENSOR]
        self.sensors = tuple(sensors) if senses else ()
        self.machines: dict[int, Stored] = {}
        self.met = 0
        """So many were met, those that are forgotten included."""
        self.numbered: dict[Hashable, int] = {}
        self.acts: dict[Hashable, tuple[int, tuple[Effect, ...]]] = {}
        self.found: dict[object, dict[Kind, set[int]]] = {}
        self.mentioned: dict[object, int] = {}
        self.mentioned_in: dict[frozenset[Message] | frozenset[Job], frozenset[int]] = {}
        self.mentions: dict[Hashable, int] = {}
        self.rankings: dict[frozenset[int], Ranking] = {}

    # --- Machines and acts

    def machine(self, number: int) -> LocalController | Coordinator:
        """A machine, to look at."""
        return self.machines[number].machine

    def _number(self, machine: LocalController | Coordinator, kept: Kept) -> int:
        key = (type(machine), frozen(machine), frozen(sorted(kept.items(), key=lambda item: item[0])))
        if (number := self.numbered.get(key)) is None:
            number = self.numbered[key] = self.met
            self.machines[number] = Stored(machine, kept)
            self.met += 1
        return number

    def forget_but(self, numbers: Collection[int]) -> None:
        """Forget all machines but these, and what was found out of any: it is found out again where it is wanted."""
        self.machines = {number: self.machines[number] for number in numbers}
        self.numbered = {key: number for key, number in self.numbered.items() if number in self.machines}
        self.acts.clear()
        self.found.clear()
        self.mentioned.clear()
        self.mentioned_in.clear()
        self.mentions.clear()
        self.rankings.clear()

    def act(self, number: int, key: Hashable, act: Act) -> tuple[int, tuple[Effect, ...]]:
        """The machine that an act makes of one, and its effects; `key` names the act."""
        if (known := self.acts.get((number, key))) is None:
            stored = self.machines[number]
            machine, kept = clone(stored.machine), dict(stored.kept)
            effects = act(machine)
            known = self.acts[number, key] = (self.kept(machine, kept, effects), tuple(effects))
        return known

    def kept(self, machine: LocalController | Coordinator, kept: Kept, effects: Sequence[Effect]) -> int:
        """The number of a machine with what it has kept, and what these effects keep besides."""
        for effect in effects:
            if isinstance(effect, Keep) and effect.value is None:
                kept.pop(effect.key, None)
            elif isinstance(effect, Keep) and effect.value is not None:
                kept[effect.key] = effect.value
        self.liken(machine, kept)
        return self._number(machine, kept)

    def liken(self, machine: LocalController | Coordinator, kept: Kept) -> None:
        """Take away of a machine what is not told apart."""
        del kept
        forget_times(machine)

    def restored(self, number: int, which: int) -> tuple[int, tuple[Effect, ...]]:
        """What a restart makes of a machine, and its effects."""
        if (known := self.acts.get((number, "restart"))) is None:
            kept = dict(self.machines[number].kept)
            coordinator, controller = self.classes
            machine: LocalController | Coordinator = (
                coordinator.restored(self.decomposition, kept, self.names[which])
                if which < len(self.coordinators)
                else controller.restored(self.decomposition, self.names[which], kept)
            )
            effects = machine.start()
            known = self.acts[number, "restart"] = (self.kept(machine, kept, effects), tuple(effects))
        return known

    # --- Configurations

    def initial(self, budget: Budget) -> Configuration:
        """Everything started for the first time."""
        coordinator, controller = self.classes
        made: list[LocalController | Coordinator]
        made = [coordinator(self.decomposition, name) for name in self.coordinators]
        made += [controller(self.decomposition, name) for name in self.names[len(made) :]]
        numbers, under_way, central = [], set[Message](), Word(self.net.initial_marking)
        for machine in made:
            effects = machine.start()
            numbers.append(self.kept(machine, {}, effects))
            under_way |= {effect for effect in effects if isinstance(effect, Message)}
        return self.counted(Configuration(tuple(numbers), frozenset(under_way), frozenset(), budget, central))

    def counted(self, found: Configuration) -> Configuration:
        """The configuration with its numbers counted from the beginning."""
        key = self._mentioned_in(found.under_way).union(
            self._mentioned_in(found.jobs), map(self._mentioned, found.machines)
        )
        if (ranking := self.rankings.get(key)) is None:
            parts = (*found.machines, *found.under_way, *found.jobs)
            collected: dict[Kind, set[int]] = {}
            for part in parts:
                for kind, numbers in self._numbers(part).items():
                    collected[kind] = collected.get(kind, set()) | numbers
            ranking = self.rankings[key] = Ranking(collected.items(), self.coordinators)
        if ranking.changes_nothing:
            return found
        return Configuration(
            tuple(self._renumbered(number, ranking) for number in found.machines),
            frozenset(apply_message(message, ranking) for message in found.under_way),
            frozenset((p, ranking.entry(count_of(p, self.net), entry), how) for p, entry, how in found.jobs),
            found.budget,
            found.central,
        )

    def _mentioned(self, part: int | Message | Job) -> int:
        """A number for all numbers that a part mentions."""
        if (known := self.mentioned.get(part)) is None:
            numbers = self._numbers(part)
            key = tuple((kind, tuple(sorted(numbers[kind]))) for kind in sorted(numbers))
            known = self.mentioned[part] = self.mentions.setdefault(key, len(self.mentions))
        return known

    def _mentioned_in(self, parts: frozenset[Message] | frozenset[Job]) -> frozenset[int]:
        """The same for each of these, found once: a step changes few of them, and a message takes long to be hashed."""
        if (known := self.mentioned_in.get(parts)) is None:
            known = self.mentioned_in[parts] = frozenset(map(self._mentioned, parts))
        return known

    def _numbers(self, part: int | Message | Job) -> dict[Kind, set[int]]:
        if (known := self.found.get(part)) is None:
            collecting = Collecting()
            if isinstance(part, int):
                apply(clone(self.machines[part].machine), self.machines[part].kept, collecting)
            elif isinstance(part, tuple):
                collecting.entry(count_of(part[0], self.net), part[1])
            else:
                apply_message(part, collecting)
            known = self.found[part] = collecting.found
        return known

    def _renumbered(self, number: int, ranking: Ranking) -> int:
        mine = self._numbers(number)
        key = tuple((kind, n, ranking.ranks[kind][n]) for kind in sorted(mine) for n in sorted(mine[kind]))
        if all(n == rank for _, n, rank in key):
            return number
        if (known := self.acts.get((number, key))) is None:
            stored = self.machines[number]
            machine = clone(stored.machine)
            kept = apply(machine, stored.kept, ranking)
            known = self.acts[number, key] = (self._number(machine, kept), ())
        return known[0]
