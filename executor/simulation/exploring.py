"""The machines of the protocol explored to the end: every order of everything, with so many faults.

The simulation draws some of what may happen; here all of it happens. A *configuration* is the machines with what they
have kept, the messages under way, and the commands that machines of the cell are at; it is left by every step that is
possible in it, breadth first. The machines are the executor's own code: an act is a call of one of them on a copy. What
an act of a machine does depends on this machine alone, so each is done once, and looked up whenever the same machine
meets the same message in another configuration; the code runs some thousand times for a million configurations.

What may happen: a message arrives, in any order; a controller fires or reports; whoever has something unanswered
repeats it when nothing is under way; a command is completed; a sensor changes; a time begins, or is over. And with a
*budget* for each: a message is lost; one arrives and stays under way; a machine is killed, before or after an act but
before anything of it leaves, and restored from what it kept; the operator has everything undecided given up, or a
controller leave, and stay after all. A controller that was restored is resumed at any time, with the answers of its
machines.

Messages under way are a set: the same one twice is once, since one that stays is a copy too. Numbers are counted from
the beginning (`numbering`), so that it ends. What an explored space is held to is the caller's: a `Watcher` sees each
step. Rejected: sets of messages that only grow, as in the proof; without numbers that grow they never end a round.
"""

from __future__ import annotations

import random
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any, Final

from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import (
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    Message,
    Sending,
    Taken,
    VoteRequest,
)
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

Job = tuple[str, int, bool]
"""A command that a machine of the cell was given: its place, its entry, and whether it is done."""


@dataclass(frozen=True, slots=True)
class Budget:
    """How many faults of each kind a run may suffer."""

    losses: int = 0
    copies: int = 0
    crashes: int = 0
    giving_up: int = 0
    leaving: int = 0
    """How often a controller takes its votes back, because its host is about to end."""


@dataclass(frozen=True, slots=True)
class Configuration:
    """Where everything stands; machines are numbers of `Explorer.machines`, in the order of `Explorer.names`."""

    machines: tuple[int, ...]
    under_way: frozenset[Message]
    jobs: frozenset[Job]
    budget: Budget
    central: Word
    """The marking of the central net, and its signals, after what has fired and was taken in so far."""


@dataclass(frozen=True, slots=True)
class Step:
    """What happens: of which kind, in which machine, with what, and what the machine does; before and after it."""

    kind: str
    machine: int
    about: object
    effects: tuple[Effect, ...]
    before: int
    after: int
    """The machine itself before and after, as numbers of `Explorer.machines`; its numbers not yet replaced."""


class NotATraceError(AssertionError):
    """What happened is none of the central net."""


@dataclass(slots=True)
class Stored:
    """A machine and what it has kept; never changed, only copied."""

    machine: LocalController | Coordinator
    kept: Kept


_FAULTS_ON_A_WAY: Final = 0.03
Act = Callable[[Any], list[Effect]]
"""A call of a machine."""
Watcher = Callable[["Explorer", Configuration, Step, Configuration], None]


@dataclass(slots=True)
class Space:
    """What was explored; edges only if they were asked for."""

    configurations: int
    steps: int
    complete: bool
    edges: dict[Configuration, list[tuple[Step, Configuration]]] = field(default_factory=dict)


class Explorer:
    """Explores the machines of a decomposition."""

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
        self.machines: list[Stored] = []
        self.numbered: dict[Hashable, int] = {}
        self.acts: dict[Hashable, tuple[int, tuple[Effect, ...]]] = {}
        self.found: dict[object, dict[Kind, set[int]]] = {}
        self.mentioned: dict[object, int] = {}
        self.mentions: dict[Hashable, int] = {}
        self.rankings: dict[frozenset[int], Ranking] = {}

    # --- Machines and acts

    def machine(self, number: int) -> LocalController | Coordinator:
        """A machine, to look at."""
        return self.machines[number].machine

    def _number(self, machine: LocalController | Coordinator, kept: Kept) -> int:
        key = (type(machine), frozen(machine), frozen(sorted(kept.items(), key=lambda item: item[0])))
        if (number := self.numbered.get(key)) is None:
            number = self.numbered[key] = len(self.machines)
            self.machines.append(Stored(machine, kept))
        return number

    def _act(self, number: int, key: Hashable, act: Act) -> tuple[int, tuple[Effect, ...]]:
        if (known := self.acts.get((number, key))) is None:
            stored = self.machines[number]
            machine, kept = clone(stored.machine), dict(stored.kept)
            effects = act(machine)
            known = self.acts[number, key] = (self._kept(machine, kept, effects), tuple(effects))
        return known

    def _kept(self, machine: LocalController | Coordinator, kept: Kept, effects: Sequence[Effect]) -> int:
        for effect in effects:
            if isinstance(effect, Keep) and effect.value is None:
                kept.pop(effect.key, None)
            elif isinstance(effect, Keep) and effect.value is not None:
                kept[effect.key] = effect.value
        forget_times(machine)
        return self._number(machine, kept)

    def _restored(self, number: int, which: int) -> tuple[int, tuple[Effect, ...]]:
        if (known := self.acts.get((number, "restart"))) is None:
            kept = dict(self.machines[number].kept)
            coordinator, controller = self.classes
            machine: LocalController | Coordinator = (
                coordinator.restored(self.decomposition, kept, self.names[which])
                if which < len(self.coordinators)
                else controller.restored(self.decomposition, self.names[which], kept)
            )
            effects = machine.start()
            known = self.acts[number, "restart"] = (self._kept(machine, kept, effects), tuple(effects))
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
            numbers.append(self._kept(machine, {}, effects))
            under_way |= {effect for effect in effects if isinstance(effect, Message)}
        return self._counted(Configuration(tuple(numbers), frozenset(under_way), frozenset(), budget, central))

    def _counted(self, found: Configuration) -> Configuration:
        """The configuration with its numbers counted from the beginning."""
        parts = (*found.machines, *found.under_way, *found.jobs)
        key = frozenset(map(self._mentioned, parts))
        if (ranking := self.rankings.get(key)) is None:
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
            frozenset((p, ranking.entry(count_of(p, self.net), entry), done) for p, entry, done in found.jobs),
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

    # --- Steps

    def steps(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen in a configuration, and where it leads."""
        for message in at.under_way:
            yield from self._arrives(at, message)
        for which in range(len(self.coordinators), len(self.names)):
            yield from self._acts_of(at, which)
        for place, entry, done in at.jobs:
            if not done:
                yield from self._completes(at, place, entry)
        for sensor in self.sensors:
            which = self.owner_of[sensor]
            for value in (False, True):
                yield from self._does(at, "sense", which, (sensor, value), partial(_sense, sensor, value))
        if not at.under_way:
            for which in range(len(self.names)):
                yield from self._does(at, "repeat", which, None, lambda machine: machine.resend())
        yield from self._faults(at)

    def _arrives(self, at: Configuration, message: Message) -> Iterator[tuple[Step, Configuration]]:
        to_controller = isinstance(message, VoteRequest | Decision | Hello)
        which = self.names.index(message.controller if to_controller else message.coordinator)
        left = Configuration(at.machines, at.under_way - {message}, at.jobs, at.budget, at.central)
        receive = partial(_receive, message)
        yield from self._does(left, "arrive", which, message, receive, always=True, before=at)
        if at.budget.copies:
            stays = Configuration(at.machines, at.under_way, at.jobs, _less(at.budget, "copies"), at.central)
            yield from self._does(stays, "arrive", which, message, receive, always=True, before=at)

    def _acts_of(self, at: Configuration, which: int) -> Iterator[tuple[Step, Configuration]]:
        yield from self._does(at, "fire", which, None, lambda machine: machine.fire())
        yield from self._does(at, "report", which, None, lambda machine: machine.report())
        machine = self.machines[at.machines[which]].machine
        if isinstance(machine, LocalController) and machine.held:
            answers = tuple(
                (place, entry, self._answer(at, place, entry)) for place, entry in machine.commands.questions
            )
            yield from self._does(at, "resume", which, answers, partial(_resumed, answers), always=True)
        if isinstance(machine, LocalController):
            yield from self._times(at, which, machine)
            if machine.leaving:
                yield from self._does(at, "stay", which, None, _stay)
            elif at.budget.leaving:
                less = replace(at, budget=_less(at.budget, "leaving"))
                yield from self._does(less, "leave", which, None, lambda machine: machine.leave(), before=at)

    def _times(self, at: Configuration, which: int, machine: LocalController) -> Iterator[tuple[Step, Configuration]]:
        if machine.deadline() == -inf:
            yield from self._does(at, "time begins", which, None, lambda machine: machine.tick(0.0))
        for place, due in machine.timers.running.items():
            if due > -inf:
                yield from self._does(at, "time is over", which, place, partial(_over, place))

    def _answer(self, at: Configuration, place: str, entry: int) -> Answer:
        for job in at.jobs:
            if job[:2] == (place, entry):
                return Answer.DONE if job[2] else Answer.WORKING
        return Answer.NOT_RECEIVED

    def _completes(self, at: Configuration, place: str, entry: int) -> Iterator[tuple[Step, Configuration]]:
        jobs = at.jobs - {(place, entry, False)} | {(place, entry, True)}
        completion = self.net.place(place).completion
        done = Configuration(at.machines, at.under_way, jobs, at.budget, at.central)
        if completion is None:
            return
        which = self.owner_of[completion]
        read = partial(_read, completion, entry)
        yield from self._does(done, "complete", which, (completion, entry), read, always=True, before=at)

    def _faults(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        budget = at.budget
        if budget.losses:
            for message in at.under_way:
                lost = Configuration(
                    at.machines, at.under_way - {message}, at.jobs, _less(budget, "losses"), at.central
                )
                yield Step("lose", -1, message, (), -1, -1), lost
        if budget.crashes:
            for which in range(len(self.names)):
                yield self._crashes(at, which, at, at.machines[which], ())
        if budget.giving_up:
            less = Configuration(at.machines, at.under_way, at.jobs, _less(budget, "giving_up"), at.central)
            for which in range(len(self.coordinators)):
                yield from self._does(
                    less, "give up", which, None, lambda m: [*m.permit(0), *m.permit(None)], before=at
                )

    def _does(
        self,
        at: Configuration,
        kind: str,
        which: int,
        about: Hashable,
        act: Act,
        *,
        always: bool = False,
        before: Configuration | None = None,
    ) -> Iterator[tuple[Step, Configuration]]:
        number = at.machines[which]
        after, effects = self._act(number, (kind, about), act)
        if after == number and not effects and not always:
            return
        sent, more = after, effects
        for effect in effects:
            if isinstance(effect, Sending):
                sent, kept = self._act(sent, effect, partial(_sent, effect))
                more = (*more, *kept)
        step = Step(kind, which, about, more, number, sent)
        yield step, self._counted(self._left(at, which, sent, effects))
        if at.budget.crashes and effects:
            # Killed behind the commit and before anything of it leaves.
            yield self._crashes(at, which, before or at, after, effects, kind, about)

    def _crashes(
        self,
        at: Configuration,
        which: int,
        before: Configuration,
        number: int,
        effects: tuple[Effect, ...],
        kind: str = "crash",
        about: object = None,
    ) -> tuple[Step, Configuration]:
        restored, started = self._restored(number, which)
        step = Step(f"{kind}, crash" if effects else "crash", which, about, effects, before.machines[which], restored)
        central = self.fired(at.central, effects)
        budget = _less(at.budget, "crashes")
        left = self._left(Configuration(at.machines, at.under_way, at.jobs, budget, central), which, restored, started)
        return step, self._counted(left)

    def _left(self, at: Configuration, which: int, number: int, effects: tuple[Effect, ...]) -> Configuration:
        machines = (*at.machines[:which], number, *at.machines[which + 1 :])
        sent = [e for e in effects if isinstance(e, Sending)]
        jobs = at.jobs
        for sending in sent:
            jobs = frozenset(job for job in jobs if job[0] != sending.place) | {(sending.place, sending.entry, False)}
        messages = frozenset(effect for effect in effects if isinstance(effect, Message))
        return Configuration(machines, at.under_way | messages, jobs, at.budget, self.fired(at.central, effects))

    def fired(self, central: Word, effects: Sequence[Effect]) -> Word:
        """The central net after what fired and was taken in; raises `NotATraceError`."""
        for effect in effects:
            match effect:
                case Firing(transition):
                    compiled = self.central.transitions[transition]
                    if not compiled.enabled(central):
                        shown = ", ".join(self.net.names(self.central.marking(central)))
                        raise NotATraceError(f"'{transition}' fires, and is not enabled in {shown}")
                    central = compiled.fire(central)
                case Taken(signal, value):
                    bit = self.central.signal_bit(signal)
                    central = central | bit if value else central & ~bit
        return central


def explore(
    explorer: Explorer,
    budget: Budget = Budget(),
    *,
    max_configurations: int = 200_000,
    watch: Watcher | None = None,
    edges: bool = False,
) -> Space:
    """Explore breadth first, up to so many configurations; `watch` sees each step.

    Cost: some microseconds for a step, and some hundred bytes for a configuration.
    """
    first = explorer.initial(budget)
    seen, todo = {first}, deque([first])
    space = Space(1, 0, complete=True)
    while todo:
        at = todo.popleft()
        out = []
        for step, after in explorer.steps(at):
            space.steps += 1
            if watch is not None:
                watch(explorer, at, step, after)
            if edges:
                out.append((step, after))
            if after not in seen:
                if len(seen) >= max_configurations:
                    space.complete = False
                    continue
                seen.add(after)
                todo.append(after)
        if edges:
            space.edges[at] = out
    space.configurations = len(seen)
    return space


def wander(explorer: Explorer, budget: Budget, seed: int, length: int, watch: Watcher) -> Counter[str]:
    """Go one way of so many steps through what is too much to be explored; `watch` sees the steps beside it, too.

    Each kind of step that may come next is as likely as every other, and faults are spread over the way. Returns how
    often each was taken. Cost: `length` times the steps that a configuration has, some twenty; the code runs anew in
    most of them.
    """
    draw, taken = random.Random(seed), Counter[str]()
    at = explorer.initial(budget)
    for _ in range(length):
        kinds: dict[str, list[Configuration]] = {}
        for step, after in explorer.steps(at):
            watch(explorer, at, step, after)
            if after != at:
                kinds.setdefault(step.kind, []).append(after)
        if not kinds:
            break
        faults = {kind for kind in kinds if kind in ("lose", "give up") or kind.endswith("crash")}
        wanted = kinds.keys() & faults if draw.random() < _FAULTS_ON_A_WAY else kinds.keys() - faults
        kind = draw.choice(sorted(wanted or kinds))
        taken[kind] += 1
        at = draw.choice(kinds[kind])
    return taken


def _less(budget: Budget, kind: str) -> Budget:
    return replace(budget, **{kind: getattr(budget, kind) - 1})


def _stay(machine: LocalController) -> list[Effect]:
    machine.stay()
    return []


def _resumed(answers: Sequence[tuple[str, int, Answer]], machine: LocalController) -> list[Effect]:
    effects = [effect for place, entry, answer in answers for effect in machine.answer(place, entry, answer)]
    return [*effects, *machine.resume()]


def _receive(message: Any, machine: Any) -> list[Effect]:
    effects: list[Effect] = machine.receive(message)
    return effects


def _read(completion: str, entry: int, machine: LocalController) -> list[Effect]:
    return machine.read(completion, value=True, entry=entry)


def _over(place: str, machine: LocalController) -> list[Effect]:
    machine.timers.running[place] = 0.0  # whatever the others are: clocks jump
    return machine.tick(0.0)


def _sense(sensor: str, value: bool, machine: LocalController) -> list[Effect]:
    return machine.read(sensor, value)


def _sent(sending: Sending, machine: LocalController) -> list[Effect]:
    return machine.sent(sending.place, sending.entry)
