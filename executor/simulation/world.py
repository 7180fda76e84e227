"""The world of a simulated run: every process of the executor, and all around them that can fail, from one seed.

The scheduler takes one small step after the other: a message arrives, a controller fires, a machine ends its command, a
sensor changes, a disk syncs, a process is killed, the operator pauses. Which step is drawn, so every order is possible,
and a seed is a run. How much goes wrong is drawn as well (`faults`). Checked while it goes on, at each event:

- the joint trace is a trace of the central net, gates and commands included (`judge`);
- no machine gets a command twice, or one while it is certainly at another (`machinery`), or one whose token has left;
- no token without completion leaves its place before the machine has its command;
- nothing fires while the operator has paused, and nothing moves after a restart before the operator has resumed;
- no host ends in order while an order for its controller is open, or one on a vote of it could still be given;
- time limits are kept by the clock of their controller (`timekeeper`), however the clocks run.

In the end everything is mended and the operator resumes; what must hold then is in `recovery`.

The machines are passed in as classes, so that a test can plant a fault in one and see that this finds it. Time passes
with the steps, a hundredth of a second each or, where there are time limits, the tenth to four-hundredth part of the
longest of them, so that some are over in some runs. Nothing here waits, so rejected: an event queue ordered by time, in
which two things that are a minute apart never come in the other order.
"""

from __future__ import annotations

import random
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
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
    Message,
    Taken,
    VoteRequest,
)
from firable.executor.simulation.clock import Clock
from firable.executor.simulation.disk import DiskFailedError
from firable.executor.simulation.faults import Faults
from firable.executor.simulation.judge import RunFailedError, Subject
from firable.executor.simulation.letting_out import give_up, happened, let_out
from firable.executor.simulation.machinery import Job, Machinery
from firable.executor.simulation.process import Process
from firable.executor.simulation.steps import something
from firable.executor.simulation.telling import COORDINATOR, told
from firable.executor.simulation.timekeeper import Timekeeper
from firable.nets.net import Marking
from firable.semantics.replaying import Replayer
from firable.semantics.trace import End, Event, Header, Trace

SECONDS_PER_STEP: Final = 0.01
STEPS_PER_LIMIT: Final = (10, 400)
_LOGGED_STEPS = 60


@dataclass(frozen=True, slots=True)
class Machines:
    """What is simulated: the machines of the executor, or mutants of them."""

    coordinator: type[Coordinator] = Coordinator
    controller: type[LocalController] = LocalController
    process: type[Process[Any]] = Process


REAL: Final = Machines()
"""The machines that run the cell."""


class World:
    """One run of the machines of a subject; a second one from the same seed and faults is the same."""

    def __init__(self, subject: Subject, seed: int, faults: Faults, machines: Machines = REAL) -> None:
        self.subject = subject
        self.net = subject.net
        self.faults = faults
        self.machines = machines
        self.draw = random.Random(seed)
        names = coordinators(subject.decomposition)
        self.coordinators = {name: machines.process(name or COORDINATOR, self.draw) for name in names}
        self.controllers = {name: machines.process(name, self.draw) for name in subject.controllers}
        self.processes = (*self.coordinators.values(), *self.controllers.values())
        limits = {name: Timekeeper(its) for name, its in subject.limited.items() if its}
        self.timekeepers = limits
        self.limit_seconds = max((each.seconds for its in subject.limited.values() for each in its), default=1.0)
        """The longest time limit of the net."""
        steps = random.Random(f"{seed} pace").uniform(*STEPS_PER_LIMIT)
        self.step_seconds = self.limit_seconds / steps if limits else SECONDS_PER_STEP
        self.cell = Machinery(self.net, subject.apart, self.draw)
        self.values = dict.fromkeys(subject.sensors, False)
        self.in_flight: list[Message] = []
        self.late: list[Message] = []
        """Messages on a way that may take very long."""
        self.telling: list[tuple[str, bool, int | None]] = []
        """What machines and sensors show and no process has read yet."""
        self.paused = False
        self.steps_allowed = 0
        self.counts: Counter[str] = Counter()
        self.fired: set[str] = set()
        self.events: list[Event] = []
        header = Header(self.net.name, signals=True, commands=True)
        self.judge = Replayer(self.net, header, f"run of seed {seed}", subject.player)
        self.log: deque[tuple[int, str, object]] = deque(maxlen=_LOGGED_STEPS)
        self.step = 0
        for process in self.processes:
            process.disk.failing = 0.05 * faults["disk"]

    def begin(self) -> None:
        """Start every process for the first time."""
        for process in self.processes:
            self._start(process)

    # --- What is seen from outside

    @property
    def marking(self) -> Marking:
        """The joint marking of the controllers that are up."""
        machines = [process.machine for process in self.controllers.values() if process.machine]
        return self.net.marking(place for m in machines for place in m.subnet.names(m.marking))

    @property
    def trace(self) -> Trace:
        """The joint trace as far as it goes."""
        end = End(float(len(self.events)), self.net.names(self.judge.marking), "simulated")
        return Trace(self.judge.header, tuple(self.events), end)

    def run(self, steps: int) -> None:
        """Let so many steps happen."""
        for _ in range(steps):
            self.step += 1
            self.let_pass(self.step_seconds)
            something(self)

    def let_pass(self, seconds: float) -> None:
        """Let so much time pass, as each clock shows it."""
        for process in self.processes:
            process.clock.advance(seconds)

    def told(self) -> Iterator[str]:
        """The last steps in words."""
        return told(self.log)

    # --- Acts

    def act(self, process: Process[Any], effects: Sequence[Effect], *, at_once: bool = False) -> None:
        """Let a process do what its machine wants done: behind a sync now, or one that it shares with later acts."""
        if not effects:
            return
        if self.paused:
            self._check_pause(effects)
        if process.name in self.controllers:
            for effect in effects:
                if isinstance(effect, Firing):
                    give_up(self, process, effect.transition)
        has_done = process.act(effects)
        if (timekeeper := self.timekeepers.get(process.name)) is not None and process.machine is not None:
            timekeeper.acted(process.machine, process.clock.shown_seconds, set(process.held_back))
        if not has_done:
            return
        if process.leaving:  # what is done by what leaves comes behind all of that
            process.has_acted = True
        elif at_once:
            self.sync_all(process)
        else:
            self._sync_soon(process)

    def _sync_soon(self, process: Process[Any]) -> None:
        lazy = self.faults["unsynced"]
        if not lazy or self.draw.random() >= lazy:
            self.sync(process)

    def sync_all(self, process: Process[Any]) -> None:
        """Let a process make durable all that it wrote until now, whatever comes of it."""
        while process.outbox:
            self.sync(process, at_once=True)

    def sync(self, process: Process[Any], *, at_once: bool = False) -> None:
        """Let a process make durable what it wrote, and let out what waits behind it; a failed disk ends it.

        A sync that is under way is over by that; one that is begun may stay under way.
        """
        if not process.outbox.is_under_way:
            process.outbox.begin()
            lazy = self.faults["unsynced"]
            if lazy and not at_once and self.draw.random() < lazy:
                self.counts["syncs that take time"] += 1
                return
        try:
            leaving = process.sync()
        except DiskFailedError:
            self.note("disk fails", process.name)
            self.kill(process)
            return
        torn = 0.05 * self.faults["torn"]
        process.leaving.extend(leaving)
        while process.leaving:
            if torn and self.draw.random() < torn:
                self.note("killed between commit and sending", process.name)
                self.kill(process)
                return
            let_out(self, process, process.leaving.popleft())
        if process.has_acted:
            process.has_acted = False
            self._sync_soon(process)

    def _check_pause(self, effects: Iterable[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Firing):
                self.steps_allowed -= 1
                if self.steps_allowed < 0:
                    raise RunFailedError(f"'{effect.transition}' fires while the operator has paused")

    def permit(self, firings: int | None) -> None:
        """Tell the coordinators how many transitions each may commit."""
        for process in self.coordinators.values():
            if process.machine is not None:
                self.act(process, process.machine.permit(firings))

    def note(self, what: str, about: object = "") -> None:
        """Remember a step, for the log."""
        self.log.append((self.step, what, about))

    # --- Processes

    def _start(self, process: Process[Any]) -> None:
        kept = process.disk.kept()
        drift = self.faults["drift"]
        process.clock = Clock(1.0 + drift * self.draw.uniform(-0.5, 1.0) if drift else 1.0)
        decomposition = self.subject.decomposition
        if (name := self.coordinating(process)) is not None:
            coordinator = self.machines.coordinator.restored(decomposition, kept, name)
            process.machine = coordinator
            self.act(process, coordinator.start(), at_once=True)
            if self.paused and process.machine:
                self.act(process, coordinator.permit(0))
            return
        process.is_held = bool(kept)
        controller = process.machine = self.machines.controller.restored(decomposition, process.name, kept)
        self.act(process, controller.start(), at_once=True)
        self.show_sensors(process)
        for place, entry in controller.commands.questions:
            if process.machine:
                self.answer(process, place, entry, self._asked(place, entry))

    def show_sensors(self, process: Process[Any]) -> None:
        """Let what the sensors of a controller show be told anew, in its time."""
        names = (s.name for s in self.subject.decomposition.subnet(process.name).signals if s.name in self.values)
        self.telling += [(name, self.values[name], None) for name in names]

    def coordinating(self, process: Process[Any]) -> str | None:
        """The coordinator that is in a process; None of a controller's."""
        return next((name for name, its in self.coordinators.items() if its is process), None)

    def _asked(self, place: str, entry: int) -> Answer:
        answer = self.cell.ask(place, entry)
        return Answer.UNKNOWN if self.draw.random() < self.faults["forgetful"] else answer

    def answer(self, process: Process[LocalController], place: str, entry: int, answer: Answer) -> None:
        """Tell a controller what became of a command that it asks after."""
        self.note("answer", (process.name, place, entry, answer.value))
        self.counts["questions"] += 1
        if process.machine is not None:
            self.act(process, process.machine.answer(place, entry, answer))

    def kill(self, process: Process[Any]) -> None:
        """Kill a process: it ends at once, wherever it is."""
        if process.machine is not None:
            self.note("killed", process.name)
            self.counts["kills"] += 1
            happened(self, process.kill())

    def restart(self, process: Process[Any]) -> None:
        """Start a process that is down."""
        if process.machine is None:
            self.note("restarts", process.name)
            self.counts["restarts"] += 1
            self._start(process)

    # --- Network

    def send(self, message: Message) -> None:
        """Put a message on its way, which may take very long."""
        if self.faults["delay"] and self.draw.random() < 0.4 * self.faults["delay"]:
            self.late.append(message)
        else:
            self.in_flight.append(message)

    def deliver(self, message: Message) -> None:
        """Let a message arrive; where nobody is up, or is cut off, it is lost."""
        to_controller = isinstance(message, VoteRequest | Decision | Hello)
        controller = self.controllers[message.controller]
        receiver = controller if to_controller else self.coordinators[message.coordinator]
        if receiver.machine is None or controller.cut_off:
            self.counts["lost"] += 1
            return
        self.note("arrives", message)
        self.counts["arrived"] += 1
        match message:
            case Decision(committed=str(name)) if receiver.machine.applies(message):
                give_up(self, receiver, name)
        self.act(receiver, receiver.machine.receive(message))
        if to_controller and not self.is_slow():
            self.turn(controller)

    def turn(self, process: Process[Any]) -> None:
        """Let a controller fire if it may and can, and report what that changed."""
        self.tick(process)
        if process.machine is not None and not self.paused and not self.is_slow():
            self.act(process, process.machine.fire())
        if process.machine is not None:
            self.act(process, process.machine.report())

    def tick(self, process: Process[LocalController]) -> None:
        """Tell a controller the time if it wants to know; sometimes also if it does not, as its host does.

        The time of a command that has not left does not begin with that.
        """
        timekeeper = self.timekeepers.get(process.name)
        if timekeeper is None or process.machine is None:
            return
        held = set(process.held_back)
        now, due = process.clock.shown_seconds, process.machine.deadline(held)
        if (due is not None and due <= now) or self.draw.random() < 0.5:
            effects = process.machine.tick(now, held)
            self.note("is told the time", (process.name, round(now, 3)))
            timekeeper.acted(process.machine, now, held)
            timekeeper.ticked(process.machine, now, held)
            self.counts["timers set"] += sum(isinstance(effect, Taken) for effect in effects)
            self.act(process, effects)

    def is_slow(self) -> bool:
        """Whether a process lets what it could do wait."""
        slow = self.faults["slow"]
        return slow > 0 and self.draw.random() < slow

    # --- The cell

    def tell(self, signal: str, value: bool, entry: int | None) -> None:
        """Let a controller read what a machine or a sensor shows, if it is up."""
        process = self.controllers[self.subject.owner_of[signal]]
        if process.machine is not None:
            self.note("shows", (signal, value, entry))
            self.act(process, process.machine.read(signal, value, entry))
            if not self.is_slow():
                self.turn(process)

    def completed(self, job: Job) -> None:
        """A machine has ended a command, and shows it."""
        if job.signal is not None:
            self.telling.append((job.signal, True, job.entry))

    def any_controller(self) -> Process[LocalController]:
        """A controller, drawn."""
        names = self.subject.controllers
        return self.controllers[names[int(self.draw.random() * len(names))]]

    def any_process(self) -> Process[Any]:
        """A process, drawn."""
        return self.processes[int(self.draw.random() * len(self.processes))]
