"""The execution: the tasks of one process that run a decomposition, and the operator's controls over them.

One task for each coordinator, one for each local controller, one for the driver; they talk through mailboxes and share
nothing else. The machines they wrap are pure, so this file is the edge: here is the clock, here effects become
messages, commands and lines of the trace.

All tasks run in one event loop, so every message handled is one act, and the trace is written in the order of the acts.
When the last mailbox is empty the execution is *quiescent*: that is when markings are shown (O7), situations are judged
and an operator's step is over. Rejected: threads. They would add every interleaving of two lines of Python to those of
the protocol, for no gain in one process.

What leaves the process waits for the journal: the acts write to it what they keep, and when the last mailbox is empty,
or many acts have passed, it is synced once for all of them; then the lines of the trace are written and the commands
sent. Messages between the tasks do not wait, see `journal`. What a restart then does is in `restart.py`.

Operator's controls. *Pause*: no further firing; rounds that are not decided are aborted, machines end the command they
are at. *Step*: while paused, one firing. *Stop*: no further firing, ever; what is decided is applied and commanded,
which takes no time in one process, then the driver drives the safe outputs, which stop every machine where it is.
*Stop at the end of the cycle*: no new work comes in, and the run ends when the cell is at rest. *Emergency stop*: the
safe outputs first, then everything else.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final, assert_never

from firable.executor.drivers.driver import Driver, withdraw
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.operating import restart
from firable.executor.operating.figures import Figures
from firable.executor.operating.mailbox import CommandTaken, Continue, Mailbox, SignalRead
from firable.executor.operating.monitor import Divergence, Monitor
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import Situation, State, blocked
from firable.executor.operating.taken_up import TRACE
from firable.executor.operating.uncut import uncut
from firable.executor.operating.watching import Watching
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
    Keep,
    Message,
    ProtocolError,
    Report,
    Sending,
    Taken,
    Vote,
    VoteRequest,
)
from firable.nets.decomposition import Decomposition

LINES_AT_ONCE_MAX: Final = 64
"""So many events, and the commands among them, wait for a sync where acts follow each other without end."""

FIRINGS_AT_ONCE_MAX: Final = 100_000
"""More firings at one instant of virtual time are a net that runs in circles without its cell."""


_END: Final = "end"
"""Under which the journal keeps, beside the trace, that all the work of the run was done."""


@dataclass(frozen=True, slots=True)
class RunClock:
    """The time of a run on the present event loop, `speed` times as fast as the loop's."""

    loop: asyncio.AbstractEventLoop
    begin_seconds: float
    speed: float

    def now_seconds(self) -> float:
        """The time since the beginning of the run."""
        return (self.loop.time() - self.begin_seconds) * self.speed

    def loop_delay_seconds(self, until_seconds: float) -> float:
        """How long the event loop has to wait until a time of the run."""
        return max(0.0, until_seconds - self.now_seconds()) / self.speed


class Execution:
    """One run of a decomposition with a driver; `main` runs it to its end."""

    def __init__(
        self,
        decomposition: Decomposition,
        driver: Driver,
        recorder: Recorder,
        *,
        speed: float = 1.0,
        overdue_seconds: float = 120.0,
        is_complete: Callable[[], bool] = lambda: False,
        operator: Callable[[Execution], Awaitable[None]] | None = None,
        journal: Journal | None = None,
        resume: bool = False,
        said: Mapping[str, Answer] | None = None,
        begin_seconds: float = 0.0,
        tell: Callable[[str, str], None] | None = None,
        monitor: Monitor | None = None,
        stop_at_divergence: bool = False,
        figures: Figures | None = None,
    ) -> None:
        self.net = decomposition.net
        self.driver = driver
        self.recorder = recorder
        self.overdue_seconds = overdue_seconds
        self.divergence: Divergence | None = None
        self.stop_at_divergence = stop_at_divergence
        self.watching = None if monitor is None else Watching(monitor, self._diverged)
        self.figures = figures
        recorder.observers += [one.seen for one in (self.watching, figures) if one is not None]
        self.is_complete = is_complete
        self.operator = operator
        self.tell = tell
        self.speed = speed
        self.begin_seconds = begin_seconds
        self.journal = journal or MemoryJournal()
        self.coordinators = {
            name: Coordinator.restored(decomposition, self.journal.kept(name), name)
            for name in coordinators(decomposition)
        }
        self.controllers = {
            s.name: LocalController.restored(decomposition, s.name, self.journal.kept(s.name))
            for s in decomposition.subnets
        }
        self.taking_up: restart.TakingUp | None = None
        """What a restart has found out, as long as the controllers are held."""
        if any(controller.held for controller in self.controllers.values()):
            self.taking_up = restart.TakingUp(said or {}, resume=resume)
        self.was_done = self.journal.kept(TRACE).get(_END) == State.DONE.value
        self.leaving: deque[Sending] = deque()
        """The commands that wait for the journal."""
        self.owner_of = {signal.name: subnet.name for subnet in decomposition.subnets for signal in subnet.signals}
        self.mailboxes = {name: Mailbox() for name in (*self.coordinators, *self.controllers)}
        self.under_way = 0
        self.messages = 0
        self.paused = False
        self.stopping = False
        self.draining = False
        self.is_safe = False
        """Whether the safe outputs are driven; commands that were issued and did not leave are asked after, later."""
        self.ended_by = "stopped by the operator"
        self.fault = ""
        self.operated = operator is not None
        self.overdue: dict[str, asyncio.TimerHandle] = {}
        """The alarm of each command without a time limit: by its completion signal or, if it has none, its place."""
        self.untaken: set[str] = set()
        """The places whose command has no completion, and is with the driver."""
        self.ticks: dict[str, asyncio.TimerHandle] = {}
        """For each controller with a time that runs, when it is told the time next."""
        self.turn = 0
        self.fired_seconds = -1.0
        self.fired_at_once = 0
        self.quiet_waiters: list[asyncio.Future[None]] = []
        self.clock: RunClock | None = None
        self.outcome: asyncio.Future[Situation] | None = None

    # The run

    async def main(self) -> Situation:
        """Run until the work is done, or nothing can go on, or the operator stops; returns how it ended."""
        loop = asyncio.get_running_loop()
        self.clock = RunClock(loop, loop.time() - self.begin_seconds / self.speed, self.speed)
        self.outcome = loop.create_future()
        if self.watching is not None:
            self.watching.begin(self.clock)
        for name, coordinator in self.coordinators.items():
            self._act(name, coordinator.start())
        for name, controller in self.controllers.items():
            self._act(name, controller.start())
        tasks = [
            *(asyncio.create_task(self._coordinate(name), name=f"coordinator {name}") for name in self.coordinators),
            *(asyncio.create_task(self._control(name), name=name) for name in self.controllers),
            asyncio.create_task(self.driver.run(self.clock, self), name="driver"),
        ]
        if self.taking_up is not None:
            tasks.append(asyncio.create_task(restart.take_up(self, self.taking_up), name="restart"))
        if self.operator is not None:
            tasks.append(asyncio.create_task(self._operate(self.operator), name="operator"))
        for task in tasks:
            task.add_done_callback(self._task_ended)
        for name in self.controllers:
            self._post(name, Continue())
        try:
            return await asyncio.shield(self.outcome)
        except asyncio.CancelledError:
            self.stop()  # Ctrl-C is the operator's stop: the run ends in order, with its report and its trace
            await uncut([self.outcome])
            return self.outcome.result()
        finally:
            if self.taking_up is None or self.stopping:  # to look at a run that is held changes nothing
                self.driver.stop()
            for task in tasks:
                task.cancel()
            await uncut(tasks)
            for alarm in (*self.overdue.values(), *self.ticks.values()):
                alarm.cancel()
            if self.watching is not None:
                self.watching.end()

    def now_seconds(self) -> float:
        """The time since the run began."""
        return self.clock.now_seconds() if self.clock is not None else 0.0

    @property
    def at_rest(self) -> bool:
        """Whether nothing is pending: no message under way, no event in the cell to come, nothing awaited or timed.

        Then time alone changes nothing; only the operator, by a step or a resume, may let something fire.
        """
        return not self.under_way and self.driver.at_rest and not self.overdue and not self.ticks

    def situation(self) -> Situation:
        """What the run is doing, and what waits for what; exact at quiescence."""
        player, word = self.recorder.player, self.recorder.word
        shown = player.net.names(self.recorder.marking)
        if self.fault:
            return Situation(State.FAULT, shown, tuple(blocked(player, word, self.untaken)), self.fault)
        if self.under_way and not self.paused:
            return Situation(State.RUNNING, shown)
        if self.taking_up is not None:
            return Situation(State.HELD, shown, (), restart.told(self, self.taking_up))
        if self.recorder.is_deadlock:
            message = "no transition can fire any more, whatever the signals do"
            return Situation(State.DEADLOCK, shown, tuple(blocked(player, word, self.untaken)), message)
        if self.paused:
            return Situation(State.PAUSED, shown, tuple(blocked(player, word, self.untaken)))
        return Situation(State.WAITING, shown, tuple(blocked(player, word, self.untaken)))

    # The operator's controls

    def pause(self) -> None:
        """Let nothing fire any more; machines end the command they are at."""
        if not self.paused:
            self.paused = True
            self._halt("paused")

    def resume(self) -> None:
        """Let transitions fire again after a pause, or after a restart once nothing about it is uncertain."""
        if self.stopping or (self.taking_up is not None and not restart.release(self, self.taking_up)):
            return
        if self.paused:
            self.paused = False
            self.recorder.note(self.now_seconds(), "resumed")
            self._permit(None)
            for name in self.controllers:
                self._post(name, Continue())

    async def step(self) -> str | None:
        """While paused, fire one transition; returns its name, or None where none is enabled.

        Whatever else the operator says meanwhile, a stop most of all, ends the step before it fires.
        """
        await self.quiet()
        before = dict(self.recorder.firings)
        # Locals of each controller and the coordinators take turns to be first.
        names = [*self.coordinators, *self.controllers]
        order = names[self.turn :] + names[: self.turn]
        for name in order:
            if not self.paused or self.stopping:
                return None
            if (coordinator := self.coordinators.get(name)) is not None:
                self._act(name, coordinator.permit(1))
                await self.quiet()
                if self.paused:
                    self._act(name, coordinator.permit(0))
            else:
                self._act(name, self.controllers[name].fire())
                self._tick(name)
                self._act(name, self.controllers[name].report())
            self._settle()
            await self.quiet()
            fired = [t for t, count in self.recorder.firings.items() if count > before[t]]
            if fired:
                self.turn = (names.index(name) + 1) % len(names)
                return fired[0]
        return None

    def stop(self, *, at_end_of_cycle: bool = False) -> None:
        """End the run: now, with every machine stopped where it is, or when the work in the cell is done."""
        if at_end_of_cycle:
            self.draining = True
            self.recorder.note(self.now_seconds(), "stopping at the end of the cycle")
            self.driver.close()
            self.moved()
            return
        self.stopping = self.paused = True
        self._halt("stopped by the operator")

    def emergency_stop(self, reason: str) -> None:
        """Drive the safe outputs at once, before anything is written or said; the run ends, and can be taken up."""
        self.driver.stop()
        self.is_safe = True
        self.stopping = self.paused = True
        self.ended_by = f"emergency stop: {reason}"
        self._halt("emergency stop", reason=reason)

    def commanded(self, command: str, by: str) -> None:
        """Who commanded what stands in the trace."""
        self.recorder.note(self.now_seconds(), "commanded", what=command, by=by)

    async def quiet(self) -> None:
        """Wait until no message is under way."""
        if self.under_way and self.outcome is not None and not self.outcome.done():
            waiter = asyncio.get_running_loop().create_future()
            self.quiet_waiters.append(waiter)
            await waiter

    # A restart (`restart.py`)

    def answered(self, name: str, place: str, entry: int, answer: Answer) -> None:
        """A driver, or an operator, has said what became of a command from before the restart."""
        self._act(name, self.controllers[name].answer(place, entry, answer))
        if answer is Answer.WORKING:
            self.watch(place)
        self._settle()

    def released(self) -> None:
        """The operator has resumed the run after a restart: what is owed is sent, and what is enabled fires."""
        self.taking_up = None
        self.recorder.note(self.now_seconds(), "taken up")
        for name, controller in self.controllers.items():
            self._act(name, controller.resume())
            self._post(name, Continue())

    # What the driver tells

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """A signal has a new value."""
        if entry is not None and (alarm := self.overdue.pop(name, None)) is not None:
            alarm.cancel()
        self._post(self.owner_of[name], SignalRead(name, value, entry))

    def taken(self, place: str, entry: int) -> None:
        """A machine has the command of a place; a token without completion has waited for that."""
        sender = self.net.place(place)
        if sender.completion is None:
            self.untaken.discard(place)
            if (alarm := self.overdue.pop(place, None)) is not None:
                alarm.cancel()
            self._post(str(sender.owner), CommandTaken(place, entry))

    def driver_fault(self, machine: str, message: str) -> None:
        """A machine has failed: nothing fires any more."""
        self._fail(f"{machine}: {message}" if machine else message)

    def driver_note(self, machine: str, message: str) -> None:
        """What a driver says of a machine or its link stands in the trace."""
        self.recorder.note(self.now_seconds(), "driver", machine=machine, message=message)
        if self.tell is not None:
            self.tell(machine, message)

    def moved(self) -> None:
        """Something happened in the cell; perhaps it has come to rest."""
        self._settle()

    # The tasks

    async def _coordinate(self, name: str) -> None:
        box, coordinator = self.mailboxes[name], self.coordinators[name]
        while True:
            await box.wait()
            match box.items.popleft():
                case Report() | Vote() | Acknowledgement() as message:
                    self._act(name, coordinator.receive(message))
                case unknown:
                    raise ProtocolError(f"the coordinator was sent {unknown!r}")
            self._handled()

    async def _control(self, name: str) -> None:
        box, controller = self.mailboxes[name], self.controllers[name]
        while True:
            await box.wait()
            match box.items.popleft():
                case VoteRequest() | Decision() | Hello() as message:
                    self._act(name, controller.receive(message))
                case SignalRead(signal, value, entry):
                    self._act(name, controller.read(signal, value, entry))
                case CommandTaken(place, entry):
                    self._act(name, controller.sent(place, entry))
                case Continue():
                    pass  # to fire is what every message leads to
                case unknown:
                    raise ProtocolError(f"'{name}' was sent {unknown!r}")
            self._tick(name)
            fired = [] if self.paused else controller.fire()
            if fired:
                self._act(name, fired)
                self._post(name, Continue())
                self._tick(name)
            self._act(name, controller.report())
            self._handled()
            if fired:
                await asyncio.sleep(0)  # the others' turn, and the operator's, even where firing never ends

    def _tick(self, name: str) -> None:
        """Tell a controller the time, and see to it that it is told again when the next of its times is over."""
        controller = self.controllers[name]
        self._act(name, controller.tick(self.now_seconds()))
        if (earlier := self.ticks.pop(name, None)) is not None:
            earlier.cancel()
        if (due := controller.deadline()) is not None and self.clock is not None:
            delay = self.clock.loop_delay_seconds(due)
            self.ticks[name] = self.clock.loop.call_later(delay, self._post, name, Continue())

    async def _operate(self, operator: Callable[[Execution], Awaitable[None]]) -> None:
        await operator(self)
        self.operated = False
        self._settle()

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._broken(error)

    @contextmanager
    def _breaking(self) -> Iterator[None]:
        """What is raised within ends the run; before the run it is the caller's."""
        try:
            yield
        except Exception as error:
            if self.outcome is None:
                raise
            self._broken(error)

    def _broken(self, error: BaseException) -> None:
        """End the run by an error of the program or of the trace's file; the machines are stopped on the way out."""
        if self.outcome is not None and not self.outcome.done():
            self.outcome.set_exception(error)

    # Effects

    def _act(self, machine: str, effects: list[Effect]) -> None:
        """Do what an act of a machine wants done: what it keeps goes before what it says."""
        self.journal.write(machine, effects)
        for effect in effects:
            match effect:
                case Firing(transition):
                    self._fired(transition)
                    for place in withdraw(self.driver, self.net, transition, self.leaving):
                        self.recorder.note(self.now_seconds(), "withdrawn", place=place)
                case Taken(signal, value):
                    self.recorder.signal(self.now_seconds(), signal, value)
                case Sending(place, again=again):
                    if again:  # its line stands in the trace since before the restart
                        self.recorder.note(self.now_seconds(), "sent again", place=place)
                    else:
                        self.recorder.sent(self.now_seconds(), place)
                    self.leaving.append(effect)
                case VoteRequest() | Decision() | Hello():
                    self._say(effect.controller, effect)
                case Report() | Vote() | Acknowledgement():
                    self._say(effect.coordinator, effect)
                case Keep():
                    pass  # the journal has it
                case _:
                    assert_never(effect)

    def _say(self, receiver: str, message: Message) -> None:
        self.messages += 1
        if self.figures is not None:
            self.figures.message(message)
        self._post(receiver, message)

    def _fired(self, transition: str) -> None:
        now = self.now_seconds()
        self.recorder.fired(now, transition)
        self.fired_at_once = self.fired_at_once + 1 if now == self.fired_seconds else 1
        self.fired_seconds = now
        if self.fired_at_once > FIRINGS_AT_ONCE_MAX:
            self._fail(f"'{transition}' and others fire without end, and no time passes: no gate ever holds them")

    def _commit(self) -> None:
        """Make durable what the machines have done; only then does anything of it leave."""
        if self.recorder.waiting:
            self.journal.write(TRACE, self.recorder.keeping)
        try:
            self.journal.sync()
        except BaseException:
            self.leaving.clear()  # the run ends, and nothing of this is ever sent
            raise
        self.recorder.flush()
        while self.leaving and not self.is_safe:
            self._send(self.leaving.popleft())

    def _send(self, sending: Sending) -> None:
        sender = self.net.place(sending.place)
        if sender.completion is not None:
            self.watch(sending.place)
            self.driver.send(sender, sending.entry)
            return
        self.untaken.add(sending.place)
        self.driver.send(sender, sending.entry)
        if sending.place in self.untaken:  # it waits for a line
            self.watch(sending.place)

    def watch(self, place: str) -> None:
        """Give the alarm where the command of a place without a time limit is not completed in time, from now on.

        A command without completion has to be taken in time.
        """
        sender = self.net.place(place)
        if sender.within is None:
            awaited = sender.completion or place
            if (earlier := self.overdue.pop(awaited, None)) is not None:
                earlier.cancel()
            self.overdue[awaited] = asyncio.get_running_loop().call_later(
                self.overdue_seconds / self.speed, self._alarm, place, self.now_seconds()
            )

    def _alarm(self, place: str, sent_at: float) -> None:
        with self._breaking():  # a timer has no caller: it must end the run, as an error in a task does
            self._overdue(place, sent_at)

    def _overdue(self, place: str, sent_at: float) -> None:
        sender = self.net.place(place)
        self.overdue.pop(sender.completion or place, None)
        awaited = f"'{sender.completion}' has not come" if sender.completion else "its machine has not taken it"
        self._fail(
            f"'{sender.command}' of '{place}', sent at {sent_at:.1f} s, is overdue: "
            f"{awaited} within {self.overdue_seconds:g} s"
        )

    def _fail(self, message: str) -> None:
        if not self.fault:
            self.fault = message
            self.stopping = self.paused = True  # first, so that nothing fires whatever happens to the trace
            self._halt("fault", message=message)

    def _halt(self, note: str, **data: str) -> None:
        """Let no coordinator commit anything more, and have the trace say why."""
        with self._breaking():
            self.recorder.note(self.now_seconds(), note, **data)
            self._permit(0)
        self._settle()

    def _permit(self, firings: int | None) -> None:
        """Let each coordinator commit so many transitions from now on; None is without limit."""
        for name, coordinator in self.coordinators.items():
            self._act(name, coordinator.permit(firings))

    def _diverged(self, found: Divergence) -> None:
        """The machines do what their model excludes."""
        self.divergence = found
        self.recorder.note(found.at_seconds, "divergence", message=str(found))
        if self.stop_at_divergence:
            self._fail(f"the machines are not as they are modelled: {found}")

    def _post(self, mailbox: str, item: Message | SignalRead | CommandTaken | Continue) -> None:
        self.under_way += 1
        self.mailboxes[mailbox].post(item)

    def _handled(self) -> None:
        self.under_way -= 1
        if self.recorder.waiting >= LINES_AT_ONCE_MAX or len(self.leaving) >= LINES_AT_ONCE_MAX:
            self._commit()
        self._settle()

    # Quiescence

    def _settle(self) -> None:
        """At quiescence, let leave what waits for it, wake who waits for it, and end the run if nothing will happen."""
        with self._breaking():  # a timer, or who serves an operator, would swallow it and leave the machines on
            self._quiesce()

    def _quiesce(self) -> None:
        if not self._is_quiet():
            return
        self._commit()
        if not self._is_quiet() or self.outcome is None:  # a machine has answered at once
            return
        for waiter in self.quiet_waiters:
            if not waiter.done():
                waiter.set_result(None)
        self.quiet_waiters.clear()
        ended = self._ended()
        if ended is not None:
            if ended.state is State.DONE:
                self.journal.write(TRACE, [Keep(_END, ended.state.value)])
            self._commit()
            self.outcome.set_result(ended)

    def _is_quiet(self) -> bool:
        return not self.under_way and self.outcome is not None and not self.outcome.done()

    def _ended(self) -> Situation | None:
        if self.fault:
            return self.situation()
        if self.stopping:
            return replace(self.situation(), state=State.STOPPED, message=self.ended_by)
        if self.taking_up is not None:
            if not self.taking_up.is_final or self.operated:
                return None
            if self.was_done and self.is_complete():
                message = "this run was done before, and nothing moved; to run the bundle again, name a new journal"
                return replace(self.situation(), state=State.DONE, message=message)
            return self.situation()
        # What a pause holds back still has to fire before the cycle, or the work, is at its end.
        if self.at_rest and self.draining and not self.paused:
            return replace(self.situation(), state=State.STOPPED, message="stopped at the end of the cycle")
        if self.at_rest and self.is_complete() and not (self.paused and self.operated):
            return replace(self.situation(), state=State.DONE, blocked=())
        # With an operator present, a cell at rest is waited for: it may be paused, or be given work.
        is_stuck = self.at_rest and not self.operated
        if is_stuck or self.recorder.is_deadlock:
            return self.situation()
        return None
