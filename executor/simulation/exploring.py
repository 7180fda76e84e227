"""The machines of the protocol explored to the end: every order of everything, with so many faults.

The simulation draws some of what may happen; here all of it happens. A *configuration* is the machines with what they
have kept, the messages under way, and the commands that machines of the cell are at; it is left by every step that is
possible in it, breadth first. The machines are the executor's own code: an act is a call of one of them on a copy,
which is done once and then looked up (`repertoire`); the code runs some thousand times for a million configurations.

What may happen: a message arrives, in any order; a controller fires or reports; whoever has something unanswered
repeats it when nothing is under way; a machine takes a command, at any time after it was sent, and completes it; a
command that is still with its driver when its token leaves is given up; a sensor changes; a time begins, or is over.
And with a *budget* for each: a message is lost; one arrives and stays under way; a machine is killed, before or after
an act but before anything of it leaves, or without having heard what a machine of the cell has taken or done, and
restored from what it kept, its driver with nothing; the operator has everything undecided given up, or a controller
leave, and stay after all. A controller that was restored is resumed at any time, with the answers of its
machines.

Messages under way are a set: the same one twice is once, since one that stays is a copy too. Numbers are counted from
the beginning (`numbering`), so that it ends. What an explored space is held to is the caller's: a `Watcher` sees each
step. Rejected: sets of messages that only grow, as in the proof; without numbers that grow they never end a round.
"""

from __future__ import annotations

import random
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import partial
from math import inf
from operator import itemgetter
from typing import Any, Final

from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import (
    Decision,
    Effect,
    Firing,
    Hello,
    Message,
    Sending,
    Taken,
    VoteRequest,
)
from firable.executor.protocol.token_player import Word
from firable.executor.simulation.repertoire import NO_FAULTS, Act, Budget, Configuration, Job, Reached, Repertoire, Step


class MachineError(AssertionError):
    """A machine of the cell is commanded as it must not be, or not at all."""


class NotATraceError(AssertionError):
    """What happened is none of the central net."""


_FAULTS_ON_A_WAY: Final = 0.03
Watcher = Callable[["Explorer", Configuration, Step, Configuration], None]


@dataclass(slots=True)
class Space:
    """What was explored; edges only if they were asked for."""

    configurations: int
    steps: int
    complete: bool
    edges: dict[Configuration, list[tuple[Step, Configuration]]] = field(default_factory=dict)


class Explorer(Repertoire):
    """Explores the machines of a decomposition."""

    # --- Steps

    def steps(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """Everything that may happen in a configuration, and where it leads."""
        for message in at.under_way:
            yield from self._arrives(at, message)
        for which in range(len(self.coordinators), len(self.names)):
            yield from self._acts_of(at, which)
        yield from self._of_cell(at)
        if not at.under_way:
            for which in range(len(self.names)):
                yield from self._does(at, "repeat", which, None, lambda machine: machine.resend())
        yield from self._faults(at)

    def _of_cell(self, at: Configuration) -> Iterator[tuple[Step, Configuration]]:
        """What machines of the cell do, and what sensors show."""
        for place, entry, how in at.jobs:
            if how is Reached.SENT:
                yield from self._taken(at, place, entry)
            elif how is Reached.TAKEN:
                yield from self._completes(at, place, entry)
        for sensor in self.sensors:
            which = self.owner_of[sensor]
            for value in (False, True):
                yield from self._does(at, "sense", which, (sensor, value), partial(_sense, sensor, value))

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
                return Answer.DONE if job[2] is Reached.DONE else Answer.WORKING
        return Answer.NOT_RECEIVED

    def _taken(self, at: Configuration, place: str, entry: int) -> Iterator[tuple[Step, Configuration]]:
        """A machine takes a command, and its driver says so."""
        taken = replace(at, jobs=at.jobs - {(place, entry, Reached.SENT)} | {(place, entry, Reached.TAKEN)})
        which = self.names.index(str(self.net.place(place).owner))
        sent = partial(_sent, place, entry)
        yield from self._does(taken, "take", which, (place, entry), sent, always=True, before=at)
        yield from self._unheard(taken, "take", which, (place, entry), at)

    def _completes(self, at: Configuration, place: str, entry: int) -> Iterator[tuple[Step, Configuration]]:
        """A machine ends a command, and its driver says so."""
        completion = self.net.place(place).completion
        if completion is None:
            return
        done = replace(at, jobs=at.jobs - {(place, entry, Reached.TAKEN)} | {(place, entry, Reached.DONE)})
        which = self.owner_of[completion]
        read = partial(_read, completion, entry)
        yield from self._does(done, "complete", which, (completion, entry), read, always=True, before=at)
        yield from self._unheard(done, "complete", which, (completion, entry), at)

    def _unheard(
        self, at: Configuration, kind: str, which: int, about: Hashable, before: Configuration
    ) -> Iterator[tuple[Step, Configuration]]:
        """The same, and its controller is killed before it hears of it."""
        if at.budget.crashes:
            yield self._crashes(at, which, before, at.machines[which], (), f"{kind}, unheard crash", about)

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
        after, effects = self.act(number, (kind, about), act)
        if after == number and not effects and not always:
            return
        step = Step(kind, which, about, effects, number, after)
        yield step, self.counted(self._left(at, which, after, effects))
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
        restored, started = self.restored(number, which)
        step = Step(f"{kind}, crash" if effects else kind, which, about, effects, before.machines[which], restored)
        central = self.fired(at.central, effects)
        budget = _less(at.budget, "crashes")
        own = self.names[which]  # what its driver has is lost with it
        jobs = frozenset(j for j in at.jobs if j[2] is not Reached.SENT or self.net.place(j[0]).owner != own)
        left = self._left(Configuration(at.machines, at.under_way, jobs, budget, central), which, restored, started)
        return step, self.counted(left)

    def _left(self, at: Configuration, which: int, number: int, effects: tuple[Effect, ...]) -> Configuration:
        machines = (*at.machines[:which], number, *at.machines[which + 1 :])
        given_up = {job for job in at.jobs if self._is_given_up(job, at.machines[which], number, which)}
        for place, _, _ in given_up:
            if self.net.place(place).completion is None:
                raise MachineError(f"the token of '{place}' has left before a machine had its command")
        jobs = at.jobs - given_up
        for sending in (effect for effect in effects if isinstance(effect, Sending)):
            of_place = {job for job in jobs if job[0] == sending.place}
            if any(entry >= sending.entry and how is not Reached.SENT for _, entry, how in of_place):
                raise MachineError(f"command {sending.entry} of '{sending.place}' is given again")
            jobs = jobs - of_place | {(sending.place, sending.entry, Reached.SENT)}
        messages = frozenset(effect for effect in effects if isinstance(effect, Message))
        return Configuration(machines, at.under_way | messages, jobs, at.budget, self.fired(at.central, effects))

    def _is_given_up(self, job: Job, before: int, after: int, which: int) -> bool:
        """Whether a command is still with the driver of a machine whose token has left its place by this act."""
        place = self.net.place(job[0])
        if job[2] is not Reached.SENT or place.owner != self.names[which] or before == after:
            return False
        machine = self.machines[after].machine
        return isinstance(machine, LocalController) and place.name not in machine.subnet.names(machine.marking)

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
    budget: Budget = NO_FAULTS,
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

    Each kind of step that may come next is as likely as every other, and faults are spread over the way. One seed is
    one way, in every process. Returns how often each kind was taken. Cost: `length` times the steps that a
    configuration has, some twenty; the code runs anew in most of them.
    """
    draw, taken = random.Random(seed), Counter[str]()
    at = explorer.initial(budget)
    for _ in range(length):
        kinds: dict[str, list[tuple[tuple[int, str], Configuration]]] = {}
        for step, after in explorer.steps(at):
            watch(explorer, at, step, after)
            if after != at:
                kinds.setdefault(step.kind, []).append(((step.machine, _words(step.about)), after))
        if not kinds:
            break
        faults = {kind for kind in kinds if kind in ("lose", "give up") or kind.endswith("crash")}
        wanted = kinds.keys() & faults if draw.random() < _FAULTS_ON_A_WAY else kinds.keys() - faults
        kind = draw.choice(sorted(wanted or kinds))
        taken[kind] += 1
        _, at = draw.choice(sorted(kinds[kind], key=itemgetter(0)))  # for steps come in the order of sets
    return taken


def _words(value: object) -> str:
    """What a step is about, in words that are the same in every process."""
    match value:
        case frozenset():
            return f"{{{', '.join(sorted(map(_words, value)))}}}"
        case tuple():
            return f"({', '.join(map(_words, value))})"
        case _ if is_dataclass(value):
            return f"{type(value).__name__}({', '.join(_words(getattr(value, each.name)) for each in fields(value))})"
    return repr(value)


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


def _sent(place: str, entry: int, machine: LocalController) -> list[Effect]:
    return machine.sent(place, entry)
