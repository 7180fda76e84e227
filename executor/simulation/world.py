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
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Message,
    Report,
    Sending,
    Taken,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.clock import Clock
from firable.executor.simulation.disk import DiskFailedError
from firable.executor.simulation.faults import Faults
from firable.executor.simulation.happenings import happen
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.machinery import Job, Machinery
from firable.executor.simulation.process import Process
from firable.executor.simulation.timekeeper import Timekeeper
from firable.nets.net import Marking
from firable.semantics.replaying import Replayer
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, SignalChanged, Trace

COORDINATOR = "coordinator"
THE = f"the {COORDINATOR}"
SECONDS_PER_STEP: Final = 0.01
STEPS_PER_LIMIT: Final = (10, 400)
_LOGGED_STEPS = 60


class RunFailedError(AssertionError):
    """What happened is none of what may happen."""


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
            self._something()

    def let_pass(self, seconds: float) -> None:
        """Let so much time pass, as each clock shows it."""
        for process in self.processes:
            process.clock.advance(seconds)

    def told(self) -> Iterator[str]:
        """The last steps in words."""
        for step, what, about in self.log:
            match about:
                case Report() | Vote() | Acknowledgement():
                    words = f"{what} from {about.controller} at {about.coordinator or THE}: {_shown(about)}"
                case VoteRequest() | Decision() | Hello():
                    words = f"{what} from {about.coordinator or THE} at {about.controller}: {_shown(about)}"
                case _:
                    words = f"{what}: {_shown(about)}" if about else what
            yield f"{step:5}  {words}"

    # --- Acts

    def act(self, process: Process[Any], effects: Sequence[Effect], *, at_once: bool = False) -> None:
        """Let a process do what its machine wants done: behind a sync now, or one that it shares with later acts."""
        if not effects:
            return
        if (timekeeper := self.timekeepers.get(process.name)) is not None and process.machine is not None:
            timekeeper.acted(process.machine, process.clock.shown_seconds)
        if self.paused:
            self._check_pause(effects)
        if process.name in self.controllers:
            for effect in effects:
                if isinstance(effect, Firing):
                    self._left(process, effect.transition)
        if process.act(effects):
            lazy = self.faults["unsynced"]
            if at_once:
                self.sync_all(process)
            elif not lazy or self.draw.random() >= lazy:
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
        for i, effect in enumerate(leaving):
            if process.machine is None:  # its disk has failed at what came before, which a machine had taken
                self._happened(leaving[i:])
                return
            if torn and self.draw.random() < torn:
                self.note("killed between commit and sending", process.name)
                self._happened(leaving[i:])
                self.kill(process)
                return
            self._leave(process, effect)

    def _leave(self, process: Process[Any], effect: Effect) -> None:
        match effect:
            case Firing(transition):
                self._fired(transition)
            case Taken(signal, value):
                self._changed(signal, value)
            case Sending(place, entry, again):
                self.note("command", (process.name, place, entry))
                self.counts["sent again"] += again
                if process.is_held:
                    raise RunFailedError(f"{process.name} commands '{place}' before the operator has resumed it")
                # One that was given before a stop, and is to be given again, is in the trace already.
                if not again or place in self.judge.owed:
                    self._event(CommandSent(float(len(self.events)), place))
                if (place, entry) in process.void:
                    process.void.remove((place, entry))
                    self.note("given up", (process.name, place, entry))
                elif self.faults["queued"] and self.draw.random() < 0.7 * self.faults["queued"]:
                    self.counts["queued"] += 1
                    self.note("waits for its line", (process.name, place, entry))
                    if process.hand(effect):
                        self._sent(process, effect)
                else:
                    self._given(process, effect)
            case VoteRequest() | Decision() | Report() | Vote() | Acknowledgement() | Hello():
                self._send(effect)

    def reach(self, process: Process[Any]) -> None:
        """Let the lines of a process be up: its machines are given what its driver has kept."""
        while process.queue:
            self._given(process, process.queue.pop(0))

    def _given(self, process: Process[Any], sending: Sending) -> None:
        machine = process.machine
        if machine is not None and sending.place not in machine.subnet.names(machine.marking):
            raise RunFailedError(f"a machine is given the command of '{sending.place}', which its token has left")
        self.note("is given", (sending.place, sending.entry))
        stuck = self.draw.random() < 0.3 * self.faults["stuck"]
        self.cell.send(sending.place, sending.entry, stuck=stuck)
        self._sent(process, sending)

    def _sent(self, process: Process[Any], sending: Sending) -> None:
        if process.machine is not None:
            self.act(process, process.machine.sent(sending.place, sending.entry))

    def _left(self, process: Process[Any], transition: str) -> None:
        """Let a process give up the commands that a firing leaves behind."""
        for sending in process.give_up(self.net.transition(transition).inputs):
            self.note("given up", (process.name, sending.place, sending.entry))
            if self.net.place(sending.place).completion is None:
                raise RunFailedError(f"'{transition}' fires before a machine has the command of '{sending.place}'")

    def _happened(self, effects: Iterable[Effect]) -> None:
        """Tell the judge what is durable, though the process that did it was killed before it could say so."""
        for effect in effects:
            match effect:
                case Firing(transition):
                    self._fired(transition)
                case Taken(signal, value):
                    self._changed(signal, value)

    def _fired(self, transition: str) -> None:
        self.note("fires", transition)
        self.counts["firings"] += 1
        self.fired.add(transition)
        self._event(Fired(float(len(self.events)), (transition,)))

    def _changed(self, signal: str, value: bool) -> None:
        self.note("taken in", (signal, value))
        self._event(SignalChanged(float(len(self.events)), signal, value))

    def _event(self, event: Event) -> None:
        self.events.append(event)
        self.judge.take(event)

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
        # What sensors show is told anew, in its time.
        names = (signal.name for signal in controller.subnet.signals if signal.name in self.values)
        self.telling += [(name, self.values[name], None) for name in names]
        for place, entry in controller.commands.questions:
            if process.machine:
                self.answer(process, place, entry, self._asked(place, entry))

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
            self._happened(process.kill())

    def ends(self, process: Process[LocalController]) -> None:
        """Let the host of a controller end in order, which leaves nothing open."""
        self.note("ends in order", process.name)
        self.sync(process)
        if process.machine is None:
            return
        for coordinator in (each.machine for each in self.coordinators.values() if each.machine is not None):
            for opened in coordinator.rounds.values():
                is_waited_for = process.name in coordinator.ordered(opened)
                if opened.committed is None or not is_waited_for or process.name in opened.acknowledged:
                    continue
                # Who has restarted since it gave its word has forgotten what was acknowledged, and will hear it again.
                is_anew = coordinator.epoch > process.machine.above[coordinator.name].epoch
                order = Decision(process.name, opened.number, opened.committed, 0, -1, 0, coordinator.name)
                if not is_anew or process.machine.applies(order):
                    raise RunFailedError(f"{process.name} ends in order, and its order of '{opened.committed}' is open")
            if votes := coordinator.ready[process.name] & coordinator.of_free.get(process.name, frozenset()):
                raise RunFailedError(f"{process.name} ends in order, and its votes for {sorted(votes)} still count")
        self.counts["ends"] += 1
        self.kill(process)

    def restart(self, process: Process[Any]) -> None:
        """Start a process that is down."""
        if process.machine is None:
            self.note("restarts", process.name)
            self.counts["restarts"] += 1
            self._start(process)

    # --- Network

    def _send(self, message: Message) -> None:
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
                self._left(receiver, name)
        self.act(receiver, receiver.machine.receive(message))
        if to_controller and not self._is_slow():
            self.turn(controller)

    def turn(self, process: Process[Any]) -> None:
        """Let a controller fire if it may and can, and report what that changed."""
        self.tick(process)
        if process.machine is not None and not self.paused and not self._is_slow():
            self.act(process, process.machine.fire())
        if process.machine is not None:
            self.act(process, process.machine.report())

    def tick(self, process: Process[LocalController]) -> None:
        """Tell a controller the time if it wants to know; sometimes also if it does not, as its host does."""
        timekeeper = self.timekeepers.get(process.name)
        if timekeeper is None or process.machine is None:
            return
        now, due = process.clock.shown_seconds, process.machine.deadline()
        if (due is not None and due <= now) or self.draw.random() < 0.5:
            effects = process.machine.tick(now)
            self.note("is told the time", (process.name, round(now, 3)))
            timekeeper.acted(process.machine, now)
            timekeeper.ticked(process.machine, now)
            self.counts["timers set"] += sum(isinstance(effect, Taken) for effect in effects)
            self.act(process, effects)

    def _is_slow(self) -> bool:
        slow = self.faults["slow"]
        return slow > 0 and self.draw.random() < slow

    # --- The cell

    def tell(self, signal: str, value: bool, entry: int | None) -> None:
        """Let a controller read what a machine or a sensor shows, if it is up."""
        process = self.controllers[self.subject.owner_of[signal]]
        if process.machine is not None:
            self.note("shows", (signal, value, entry))
            self.act(process, process.machine.read(signal, value, entry))
            if not self._is_slow():
                self.turn(process)

    def completed(self, job: Job) -> None:
        """A machine has ended a command, and shows it."""
        if job.signal is not None:
            self.telling.append((job.signal, True, job.entry))

    # --- One step

    def _something(self) -> None:
        choice = self.draw.random()
        if choice < 0.60:
            self._network()
        elif choice < 0.65:
            self.turn(self.any_controller())
        elif choice < 0.84:
            self._machines()
        elif choice < 0.92:
            waiting = [process for process in self.processes if process.outbox]
            if waiting:
                self.sync(waiting[int(self.draw.random() * len(waiting))])
            else:
                self._resend()
        else:
            happen(self)

    def any_controller(self) -> Process[LocalController]:
        """A controller, drawn."""
        names = self.subject.controllers
        return self.controllers[names[int(self.draw.random() * len(names))]]

    def any_process(self) -> Process[Any]:
        """A process, drawn."""
        return self.processes[int(self.draw.random() * len(self.processes))]

    def _network(self) -> None:
        faults, draw = self.faults, self.draw
        if self.late and draw.random() < (0.05 if self.in_flight else 0.3):
            self.in_flight.append(self.late.pop(int(draw.random() * len(self.late))))
        if not self.in_flight:  # what was lost is sent again, or the cell goes on
            if draw.random() < 0.3:
                self._resend()
            else:
                self._machines()
            return
        index = int(draw.random() * len(self.in_flight)) if faults["reordering"] else 0
        message = self.in_flight.pop(index)
        if faults["duplication"] and draw.random() < 0.4 * faults["duplication"]:
            self.counts["doubled"] += 1
            self.late.append(message)
        if faults["loss"] and draw.random() < 0.5 * faults["loss"]:
            self.note("lost", message)
            self.counts["lost"] += 1
        else:
            self.deliver(message)

    def _resend(self) -> None:
        process = self.any_process()
        if process.machine is not None:
            self.act(process, process.machine.resend())

    def _machines(self) -> None:
        waiting = [process for process in self.controllers.values() if process.queue]
        if waiting and self.draw.random() < 0.3:
            self.reach(waiting[int(self.draw.random() * len(waiting))])
            return
        draw = self.draw.random()
        if draw < 0.4 and self.telling:
            self.tell(*self.telling.pop(0))
        elif draw < 0.8 and self.cell.working and self.draw.random() >= 0.9 * self.faults["late"]:
            job = self.cell.complete()
            if job is not None:
                self.completed(job)
        elif self.values:
            self._sense()

    def _sense(self) -> None:
        """A sensor changes: mostly to what a transition waits for, as in a cell that is at work, else at random."""
        sensors, draw = self.subject.sensors, self.draw
        if draw.random() < 0.75:
            wanted = [
                gate.signal
                for t in self.judge.player.firable(self.judge.marking)
                for gate in self.net.transitions[t].external
                if self.values.get(gate.signal, gate.wanted) != gate.wanted
            ]
            if not wanted:
                return
            signal = wanted[int(draw.random() * len(wanted))]
        else:
            signal = sensors[int(draw.random() * len(sensors))]
        self.values[signal] = not self.values[signal]
        self.telling.append((signal, self.values[signal], None))


def _shown(about: object) -> str:
    match about:
        case Report(readiness=readiness):
            return f"enabled: {_names(readiness.transitions)}"
        case VoteRequest():
            return f"round {about.round}: promise {_names(about.transitions)}?"
        case Vote():
            return f"round {about.round}: {_names(about.promised)} promised"
        case Decision():
            return f"round {about.round}: {about.committed or 'nothing'} is committed"
        case Acknowledgement():
            return f"round {about.round} obeyed"
        case Hello():
            return f"has restarted, epoch {about.epoch}"
        case tuple():
            return " ".join(map(str, about))
    return str(about)


def _names(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "nothing"
