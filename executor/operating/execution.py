"""The execution: the tasks of one process that run a decomposition, and the operator's controls over them.

One task for the coordinator, one for each local controller, one for the driver; they talk through mailboxes and share
nothing else. The machines they wrap are pure, so this file is the edge: here is the clock, here effects become
messages, commands and lines of the trace.

All tasks run in one event loop, so every message handled is one act, and the trace is written in the order of the acts.
When the last mailbox is empty the execution is *quiescent*: that is when markings are shown (O7), situations are judged
and an operator's step is over. Rejected: threads. They would add every interleaving of two lines of Python to those of
the protocol, for no gain in one process.

Operator's controls. *Pause*: no further firing; rounds that are not decided are aborted, machines end the command they
are at. *Step*: while paused, one firing. *Stop*: no further firing, ever; what is decided is applied and commanded,
which takes no time in one process, then the driver drives the safe outputs, which stop every machine where it is.
*Stop at the end of the cycle*: no new work comes in, and the run ends when the cell is at rest.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Final, assert_never

from firable.executor.drivers.driver import Driver
from firable.executor.operating.mailbox import Continue, Mailbox, SignalRead
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import Situation, State, blocked, is_deadlock
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
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

COORDINATOR: Final = ""
"""The mailbox of the coordinator; no controller has the empty name."""

FIRINGS_AT_ONCE_MAX: Final = 100_000
"""More firings at one instant of virtual time are a net that runs in circles without its cell."""


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
    ) -> None:
        self.net = decomposition.net
        self.driver = driver
        self.recorder = recorder
        self.overdue_seconds = overdue_seconds
        self.is_complete = is_complete
        self.operator = operator
        self.speed = speed
        self.coordinator = Coordinator(decomposition)
        self.controllers = {s.name: LocalController(decomposition, s.name) for s in decomposition.subnets}
        self.owner_of = {signal.name: subnet.name for subnet in decomposition.subnets for signal in subnet.signals}
        self.mailboxes = {name: Mailbox() for name in (COORDINATOR, *self.controllers)}
        self.under_way = 0
        self.messages = 0
        self.paused = False
        self.stopping = False
        self.draining = False
        self.fault = ""
        self.operated = operator is not None
        self.overdue: dict[str, asyncio.TimerHandle] = {}
        """For each completion signal, the alarm of the command that it completes."""
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
        self.clock = RunClock(loop, loop.time(), self.speed)
        self.outcome = loop.create_future()
        tasks = [
            asyncio.create_task(self._coordinate(), name="coordinator"),
            *(asyncio.create_task(self._control(name), name=name) for name in self.controllers),
            asyncio.create_task(self.driver.run(self.clock, self), name="driver"),
        ]
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
            return await self.outcome
        finally:
            self.driver.stop()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for alarm in self.overdue.values():
                alarm.cancel()

    def now_seconds(self) -> float:
        """The time since the run began."""
        return self.clock.now_seconds() if self.clock is not None else 0.0

    @property
    def at_rest(self) -> bool:
        """Whether nothing is pending: no message under way, no event in the cell to come, no completion awaited.

        Then time alone changes nothing; only the operator, by a step or a resume, may let something fire.
        """
        return not self.under_way and self.driver.at_rest and not self.overdue

    def situation(self) -> Situation:
        """What the run is doing, and what waits for what; exact at quiescence."""
        player, word = self.recorder.player, self.recorder.word
        shown = player.net.names(self.recorder.marking)
        if self.fault:
            return Situation(State.FAULT, shown, tuple(blocked(player, word)), self.fault)
        if self.under_way and not self.paused:
            return Situation(State.RUNNING, shown)
        if is_deadlock(player, word):
            message = "no transition can fire any more, whatever the signals do"
            return Situation(State.DEADLOCK, shown, tuple(blocked(player, word)), message)
        if self.paused:
            return Situation(State.PAUSED, shown, tuple(blocked(player, word)))
        return Situation(State.WAITING, shown, tuple(blocked(player, word)))

    # The operator's controls

    def pause(self) -> None:
        """Let nothing fire any more; machines end the command they are at."""
        if not self.paused:
            self.paused = True
            self.recorder.note(self.now_seconds(), "paused")
            self._perform(self.coordinator.permit(0))

    def resume(self) -> None:
        """Let transitions fire again after a pause."""
        if self.paused and not self.stopping:
            self.paused = False
            self.recorder.note(self.now_seconds(), "resumed")
            self._perform(self.coordinator.permit(None))
            for name in self.controllers:
                self._post(name, Continue())

    async def step(self) -> str | None:
        """While paused, fire one transition; returns its name, or None where none is enabled.

        Whatever else the operator says meanwhile, a stop most of all, ends the step before it fires.
        """
        await self.quiet()
        before = dict(self.recorder.firings)
        # Locals of each controller and the coordinator take turns to be first.
        names = [COORDINATOR, *self.controllers]
        order = names[self.turn :] + names[: self.turn]
        for name in order:
            if not self.paused or self.stopping:
                return None
            if name == COORDINATOR:
                self._perform(self.coordinator.permit(1))
                await self.quiet()
                if self.paused:
                    self._perform(self.coordinator.permit(0))
            else:
                self._perform(self.controllers[name].fire())
                self._perform(self.controllers[name].report())
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
        self.recorder.note(self.now_seconds(), "stopped by the operator")
        self._perform(self.coordinator.permit(0))
        self._settle()

    async def quiet(self) -> None:
        """Wait until no message is under way."""
        if self.under_way and self.outcome is not None and not self.outcome.done():
            waiter = asyncio.get_running_loop().create_future()
            self.quiet_waiters.append(waiter)
            await waiter

    # What the driver tells

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """A signal has a new value."""
        if entry is not None and (alarm := self.overdue.pop(name, None)) is not None:
            alarm.cancel()
        self._post(self.owner_of[name], SignalRead(name, value, entry))

    def driver_fault(self, machine: str, message: str) -> None:
        """A machine has failed: nothing fires any more."""
        self._fail(f"{machine}: {message}" if machine else message)

    def driver_note(self, machine: str, message: str) -> None:
        """What a driver says of a machine or its link stands in the trace."""
        self.recorder.note(self.now_seconds(), "driver", machine=machine, message=message)

    def moved(self) -> None:
        """Something happened in the cell; perhaps it has come to rest."""
        self._settle()

    # The tasks

    async def _coordinate(self) -> None:
        box = self.mailboxes[COORDINATOR]
        while True:
            await box.wait()
            match box.items.popleft():
                case Report() | Vote() | Acknowledgement() as message:
                    self._perform(self.coordinator.receive(message))
                case unknown:
                    raise ProtocolError(f"the coordinator was sent {unknown!r}")
            self._handled()

    async def _control(self, name: str) -> None:
        box, controller = self.mailboxes[name], self.controllers[name]
        while True:
            await box.wait()
            match box.items.popleft():
                case VoteRequest() | Decision() | Hello() as message:
                    self._perform(controller.receive(message))
                case SignalRead(signal, value, entry):
                    self._perform(controller.read(signal, value, entry))
                case Continue():
                    pass  # to fire is what every message leads to
                case unknown:
                    raise ProtocolError(f"'{name}' was sent {unknown!r}")
            fired = [] if self.paused else controller.fire()
            if fired:
                self._perform(fired)
                self._post(name, Continue())
            self._perform(controller.report())
            self._handled()
            if fired:
                await asyncio.sleep(0)  # the others' turn, and the operator's, even where firing never ends

    async def _operate(self, operator: Callable[[Execution], Awaitable[None]]) -> None:
        await operator(self)
        self.operated = False
        self._settle()

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._broken(error)

    def _broken(self, error: BaseException) -> None:
        """End the run by an error of the program or of the trace's file; the machines are stopped on the way out."""
        if self.outcome is not None and not self.outcome.done():
            self.outcome.set_exception(error)

    # Effects

    def _perform(self, effects: list[Effect]) -> None:
        for effect in effects:
            match effect:
                case Firing(transition):
                    self._fired(transition)
                case Taken(signal, value):
                    self.recorder.signal(self.now_seconds(), signal, value)
                case Sending(place, entry):
                    self._send(place, entry)
                case VoteRequest() | Decision() | Hello():
                    self.messages += 1
                    self._post(effect.controller, effect)
                case Report() | Vote() | Acknowledgement():
                    self.messages += 1
                    self._post(COORDINATOR, effect)
                case Keep():
                    pass  # without a journal, what a crash would lose is lost
                case _:
                    assert_never(effect)

    def _fired(self, transition: str) -> None:
        now = self.now_seconds()
        self.recorder.fired(now, transition)
        self.fired_at_once = self.fired_at_once + 1 if now == self.fired_seconds else 1
        self.fired_seconds = now
        if self.fired_at_once > FIRINGS_AT_ONCE_MAX:
            self._fail(f"'{transition}' and others fire without end, and no time passes: no gate ever holds them")

    def _send(self, place: str, entry: int) -> None:
        # The line comes first: what the machine answers is written behind it.
        self.recorder.sent(self.now_seconds(), place)
        sender = self.net.place(place)
        if sender.completion is not None:
            if (earlier := self.overdue.pop(sender.completion, None)) is not None:
                earlier.cancel()
            self.overdue[sender.completion] = asyncio.get_running_loop().call_later(
                self.overdue_seconds / self.speed, self._alarm, place, self.now_seconds()
            )
        self.driver.send(sender, entry)

    def _alarm(self, place: str, sent_at: float) -> None:
        try:
            self._overdue(place, sent_at)
        except Exception as error:  # a timer has no caller: it must end the run, as an error in a task does
            self._broken(error)

    def _overdue(self, place: str, sent_at: float) -> None:
        sender = self.net.place(place)
        self.overdue.pop(str(sender.completion), None)
        self._fail(
            f"'{sender.command}' of '{place}', sent at {sent_at:.1f} s, is overdue: "
            f"'{sender.completion}' has not come within {self.overdue_seconds:g} s"
        )

    def _fail(self, message: str) -> None:
        if not self.fault:
            self.fault = message
            self.stopping = self.paused = True  # first, so that nothing fires whatever happens to the trace
            self.recorder.note(self.now_seconds(), "fault", message=message)
            self._perform(self.coordinator.permit(0))
            self._settle()

    def _post(self, mailbox: str, item: Message | SignalRead | Continue) -> None:
        self.under_way += 1
        self.mailboxes[mailbox].post(item)

    def _handled(self) -> None:
        self.under_way -= 1
        self._settle()

    # Quiescence

    def _settle(self) -> None:
        """At quiescence, wake who waits for it, and end the run if nothing more will happen."""
        if self.under_way or self.outcome is None or self.outcome.done():
            return
        for waiter in self.quiet_waiters:
            if not waiter.done():
                waiter.set_result(None)
        self.quiet_waiters.clear()
        ended = self._ended()
        if ended is not None:
            self.outcome.set_result(ended)
        else:
            self.recorder.flush()

    def _ended(self) -> Situation | None:
        if self.fault:
            return self.situation()
        if self.stopping:
            return replace(self.situation(), state=State.STOPPED, message="stopped by the operator")
        # What a pause holds back still has to fire before the cycle, or the work, is at its end.
        if self.at_rest and self.draining and not self.paused:
            return replace(self.situation(), state=State.STOPPED, message="stopped at the end of the cycle")
        if self.at_rest and self.is_complete() and not (self.paused and self.operated):
            return replace(self.situation(), state=State.DONE, blocked=())
        # With an operator present, a cell at rest is waited for: it may be paused, or be given work.
        is_stuck = self.at_rest and not self.operated
        if is_stuck or is_deadlock(self.recorder.player, self.recorder.word):
            return self.situation()
        return None
