"""A host: one process with some machines of a cell, its driver, its journal, and the link to the other hosts.

Machines are pure, and so are their acts: a message, a signal, or the next local firing goes in, effects come out. This
file is the edge around them. All acts of one turn of the event loop are one *group*: what a machine says to another one
in the same process is its next act, since a crash loses both or none; then the journal is synced, once; then what
leaves the host leaves it, in the order of the acts: lines of the trace, commands, messages (`journal.py` says why that
is right). Nothing waits inside an act, and no act waits for the disk of another group.

*Repeats*: what is unanswered is repeated every `resend_seconds`, and at once when a lost peer is back. *Watching*: a
peer that is lost, or refused, is told, and what waits for it is named (`waits`); nothing else changes, because a
controller that has promised waits for the decision whoever is gone (O6), and one that has not goes on alone as far as
its own transitions go. A driver's fault or an overdue command ends the host: its outputs are made safe, and the others
see it lost.

*Stop*: nothing more is asked, promised or fired, and the host waits, for a while, until what was decided is applied and
acknowledged; hosts of controllers wait for the coordinator's to end, so that their last words arrive. Only then its
trace has a last line; one without says honestly that something was open.

After a restart the controllers are held, and the driver is asked after every command that was under way; `resume` is
the operator's. Rejected: one process for each of driver, controller and link. Their crashes would be independent, and
every pair of them would need a protocol like the one between hosts.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Final, assert_never

from firable.executor.drivers.driver import Driver, withdraw
from firable.executor.journal.journal import Journal
from firable.executor.links.link import Link, called
from firable.executor.operating.execution import FIRINGS_AT_ONCE_MAX, RunClock
from firable.executor.operating.host_trace import TRACE, HostTrace
from firable.executor.operating.mailbox import CommandTaken
from firable.executor.operating.situation import Blocked, Situation, State, blocked
from firable.executor.operating.uncut import uncut
from firable.executor.operating.waits import reached, waits
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
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic

RESEND_SECONDS: Final = 0.2
SETTLE_SECONDS: Final = 2.0
ACTS_AT_ONCE_MAX: Final = 1000
"""So many acts are one group at most; then they become durable, and the link and the driver have their turn."""


@dataclass(frozen=True, slots=True)
class SignalRead:
    """A driver's word to a controller: a new value of one of its signals."""

    signal: str
    value: bool
    entry: int | None


Told = Callable[[str, str], None]
"""Who is told what happens to the host: the kind (`connected`, `lost`, `refused`, `held`, ...), and a sentence."""


class Host:
    """Some machines of a decomposition; `main` runs them until they are stopped or fail."""

    def __init__(
        self,
        decomposition: Decomposition,
        machines: Collection[str],
        driver: Driver,
        link: Link,
        trace: HostTrace,
        journal: Journal,
        *,
        overdue_seconds: float = 120.0,
        resend_seconds: float = RESEND_SECONDS,
        settle_seconds: float = SETTLE_SECONDS,
        said: Mapping[str, Answer] | None = None,
        tell: Told | None = None,
    ) -> None:
        self.net = decomposition.net
        self.driver = driver
        self.link = link
        self.trace = trace
        self.journal = journal
        self.overdue_seconds = overdue_seconds
        self.resend_seconds = resend_seconds
        self.settle_seconds = settle_seconds
        self.said = said or {}
        """What an operator says of commands, by place, where the driver does not know."""
        self.tell = tell
        self.deciding = coordinators(decomposition)
        self.coordinators = {
            name: Coordinator.restored(decomposition, journal.kept(name), name)
            for name in self.deciding
            if name in machines
        }
        self.controllers = {
            subnet.name: LocalController.restored(decomposition, subnet.name, journal.kept(subnet.name))
            for subnet in decomposition.subnets
            if subnet.name in machines
        }
        self.owner_of = {
            signal.name: name for name in self.controllers for signal in decomposition.subnet(name).signals
        }
        self.peers = {*self.deciding, *(subnet.name for subnet in decomposition.subnets)} - set(machines)
        """The machines of other hosts."""
        self.connected_to: set[str] = set()
        self.posted: deque[tuple[str, Message | SignalRead | CommandTaken | None]] = deque()
        """What the machines here are given next; None is their turn to fire."""
        self.leaving: list[Effect] = []
        """What leaves the host when this group is durable."""
        self.unsynced = False
        self.working = False
        self.firing = dict.fromkeys(self.controllers, 0)
        """How often each has fired without anything from outside."""
        self.stopping = False
        self.is_safe = False
        """Whether the safe outputs are driven: then no command is sent, and those issued are asked after, later."""
        self.fault = ""
        self.ended_by = ""
        self.messages = 0
        self.repeats = 0
        self.overdue: dict[str, asyncio.TimerHandle] = {}
        """The alarm of each command without a time limit: by its completion signal or, if it has none, its place."""
        self.untaken: set[str] = set()
        """The places whose command has no completion, and is with the driver."""
        self.clock: RunClock | None = None
        self.ticks: dict[str, asyncio.TimerHandle] = {}
        """For each controller with a time that runs, when it is told the time next."""
        self.outcome: asyncio.Future[Situation] | None = None

    # The run

    async def main(self) -> Situation:
        """Run until stopped, by `stop` or by cancelling, or until something fails; returns how it ended.

        Raises `InputError` where the link, the journal or the trace fails; the safe outputs are driven before.
        """
        loop = asyncio.get_running_loop()
        self.outcome = loop.create_future()
        clock = self.clock = RunClock(loop, loop.time(), 1.0)
        self.trace.run_by(loop.time)
        tasks = [
            asyncio.create_task(self.link.run(self), name="link"),
            asyncio.create_task(self.driver.run(clock, self), name="driver"),
            asyncio.create_task(self._repeat(), name="repeats"),
            asyncio.create_task(self._ask(), name="questions"),
        ]
        for task in tasks:
            task.add_done_callback(self._task_ended)
        try:
            for name, coordinator in self.coordinators.items():
                self._act(name, coordinator.start())
            for name, controller in self.controllers.items():
                self._act(name, controller.start())
                self._post(name, None)
            return await asyncio.shield(self.outcome)
        except asyncio.CancelledError:
            self.stop()  # Ctrl-C, or a request to terminate: the host ends in order
            await uncut([self.outcome])
            return self.outcome.result()
        finally:
            self._make_safe()
            for task in tasks:
                task.cancel()
            await uncut(tasks)
            for alarm in (*self.overdue.values(), *self.ticks.values()):
                alarm.cancel()

    def situation(self) -> Situation:
        """What the host is doing, and what waits for what, as far as its machines know."""
        found: list[Blocked] = []
        for controller in self.controllers.values():
            found += blocked(controller.player, controller.word, self.untaken)
        message = self.fault or self.ended_by or "; ".join(self.waits())
        state = State.FAULT if self.fault else State.STOPPED if self.stopping else State.WAITING
        return Situation(state, self.marking, tuple(found), message)

    @property
    def marking(self) -> tuple[str, ...]:
        """The places of the machines here that hold a token."""
        return tuple(p for c in self.controllers.values() for p in c.subnet.names(c.marking))

    def waits(self) -> tuple[str, ...]:
        """What waits for another machine, in a sentence each."""
        return tuple(waits(self.coordinators, self.controllers, self.peers - self.connected_to))

    # What the operator may do

    def stop(self) -> None:
        """Let nothing more fire, and end when nothing is open, or after `settle_seconds`."""
        if not self.stopping:
            self.stopping = True
            self.trace.note("stopped by the operator")
            for name, coordinator in self.coordinators.items():
                self._act(name, coordinator.permit(0))
            asyncio.get_running_loop().call_later(self.settle_seconds, self._end)
            self._wake()

    def emergency_stop(self, reason: str) -> None:
        """Drive the safe outputs at once, before anything is written or said; then the host ends as by `stop`.

        What was decided is applied, so that no other host waits for it; the commands of it are not sent, and asked
        after at the restart.
        """
        self._make_safe()
        self.ended_by = f"emergency stop: {reason}"
        try:
            self.trace.note("emergency stop", reason=reason)
            self.stop()
        except Exception as error:  # whoever calls may swallow it
            self._broken(error)

    def resume(self) -> bool:
        """End the hold of the controllers after a restart; those with a command that nobody knows of stay held.

        A host that is stopping, or has failed, stays held as it is: what is owed would be commanded after the stop.
        """
        if self.stopping:
            return False
        for name, controller in self.controllers.items():
            if controller.held and not controller.commands.questions:
                self.trace.note("resumed", controller=name)
                self._act(name, controller.resume())
                self._post(name, None)
        return not any(controller.held for controller in self.controllers.values())

    def answer(self, controller: str, place: str, entry: int, answer: Answer) -> None:
        """Say what became of a command that was under way when the host was restarted."""
        self._act(controller, self.controllers[controller].answer(place, entry, answer))

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
        """A machine has failed."""
        self._fail(f"{machine}: {message}" if machine else message)

    def driver_note(self, machine: str, message: str) -> None:
        """What a driver says of a machine or its link stands in the trace."""
        self._told("driver", f"{machine}: {message}")

    def moved(self) -> None:
        """Nothing: a host does not end because its machines rest."""

    # What the link tells

    def arrived(self, sender: str, receiver: str, message: Message) -> None:
        """A message of another host; what its sender may not say is dropped."""
        is_order = isinstance(message, ToController)
        way = (message.coordinator, message.controller)
        if (sender, receiver) != (way if is_order else way[::-1]):
            self._told("dropped", f"{called(sender)} sent a {type(message).__name__} that is not its to send")
            return
        self._post(receiver, message)

    def connected(self, peer: str) -> None:
        """A peer can be reached: what it has missed is said again."""
        if peer in self.peers:
            self.connected_to.add(peer)
            self._told("connected", f"{called(peer)} is connected")
            self._say_again()

    def lost(self, peer: str) -> None:
        """A peer can no longer be reached."""
        if peer in self.peers:
            self.connected_to.discard(peer)
            waiting = [sentence for sentence in self.waits() if reached(peer, {peer}) in sentence]
            self._told("lost", "; ".join([f"{called(peer)} is lost", *waiting]))

    def refused(self, peer: str, problem: Diagnostic) -> None:
        """A host was refused."""
        self._told("refused", f"{called(peer)} is refused: {problem.message}; {problem.hint}")

    # Acts

    def _post(self, machine: str, item: Message | SignalRead | CommandTaken | None) -> None:
        self.posted.append((machine, item))
        self._wake()

    def _wake(self) -> None:
        if not self.working and self.outcome is not None and not self.outcome.done():
            self.working = True
            asyncio.get_running_loop().call_soon(self._work)

    def _work(self) -> None:
        """One group: acts until nothing is posted, then the journal, then what leaves."""
        self.working = False
        try:
            for _ in range(min(len(self.posted) + ACTS_AT_ONCE_MAX, ACTS_AT_ONCE_MAX)):
                if not self.posted:
                    break
                self._give(*self.posted.popleft())
            self._leave()
        except Exception as error:  # a callback has no caller: it must end the run, as an error in a task does
            self._broken(error)
            return
        if self.posted:
            self._wake()
        elif self.stopping and self._is_settled() and self._is_heard():
            self._end()

    def _give(self, machine: str, item: Message | SignalRead | CommandTaken | None) -> None:
        """One act of one machine, and its turn to fire and to report."""
        if isinstance(item, ToCoordinator):
            if machine not in self.coordinators:
                raise ProtocolError(f"there is no coordinator here for {item!r}")
            self._act(machine, self.coordinators[machine].receive(item))
            return
        controller = self.controllers[machine]
        match item:
            case VoteRequest() if self.stopping:
                return  # as if it had been lost
            case Decision():
                promised = item.round in controller.promises and item.committed in controller.parts
                effects = controller.receive(item)
                if promised:
                    self.trace.applied(machine, item.round)
                    self._withdraw(str(item.committed))
                self._act(machine, effects)
            case VoteRequest() | Hello():
                known = item.round in controller.promises if isinstance(item, VoteRequest) else True
                effects = controller.receive(item)
                if not known and isinstance(item, VoteRequest) and (given := controller.promises.get(item.round)):
                    self.trace.voted(machine, item.round, given.promised)
                self._act(machine, effects)
            case SignalRead(signal, value, entry):
                self._act(machine, controller.read(signal, value, entry))
            case CommandTaken(place, entry):
                self._act(machine, controller.sent(place, entry))
        self.firing[machine] = self.firing[machine] + 1 if item is None else 0
        if self.firing[machine] > FIRINGS_AT_ONCE_MAX:
            self._fail(f"'{machine}' fires without end, and no gate ever holds it")
        self._tick(machine)
        if not self.stopping and (fired := controller.fire()):
            self._act(machine, fired)
            self.posted.append((machine, None))
            self._tick(machine)
        self._act(machine, controller.report())

    def _act(self, machine: str, effects: list[Effect]) -> None:
        """Take the effects of one act: writes to the journal, messages to machines here, the rest to those who wait."""
        if not effects:
            return
        self.journal.write(machine, effects)
        rounds = {effect.committed: effect.round for effect in effects if isinstance(effect, Decision)}
        for effect in effects:
            match effect:
                case Keep():
                    self.unsynced = True
                case Firing(transition):
                    self.trace.fired(transition, rounds.get(transition) if machine in self.coordinators else None)
                    self._withdraw(transition)
                case Taken(signal, value):
                    self.trace.signal(signal, value)
                case Sending(place, _, again):
                    if again:
                        self.trace.note("sent again", place=place)  # it stands in the trace as sent
                    else:
                        self.trace.sent(place)
                    self.leaving.append(effect)
                case VoteRequest() | Decision() | Hello():
                    self._say(effect.controller, effect)
                case Report() | Vote() | Acknowledgement():
                    self._say(effect.coordinator, effect)
                case _:
                    assert_never(effect)
        self._wake()

    def _withdraw(self, transition: str) -> None:
        for place in withdraw(self.driver, self.net, transition, self.leaving):
            self.trace.note("withdrawn", place=place)

    def _say(self, receiver: str, message: Message) -> None:
        self.messages += 1
        if receiver in self.coordinators or receiver in self.controllers:
            self.posted.append((receiver, message))
        else:
            self.leaving.append(message)

    def _leave(self) -> None:
        """Make the group durable, then let go of what leaves the host."""
        if self.unsynced:
            self.journal.write(TRACE, self.trace.keep())
            self.journal.sync()
            self.unsynced = False
        self.trace.flush()
        leaving, self.leaving = self.leaving, []
        for effect in leaving:
            match effect:
                case Sending(place, entry):
                    if not self.is_safe:
                        self._send(place, entry)
                case VoteRequest() | Decision() | Hello():
                    self.link.send(effect.coordinator, effect.controller, effect)
                case Report() | Vote() | Acknowledgement():
                    self.link.send(effect.controller, effect.coordinator, effect)

    def _send(self, place: str, entry: int) -> None:
        sender = self.net.place(place)
        if sender.completion is not None:
            self._watch(place)
            self.driver.send(sender, entry)
            return
        self.untaken.add(place)
        self.driver.send(sender, entry)
        if place in self.untaken:  # it waits for a line
            self._watch(place)

    def _watch(self, place: str) -> None:
        """Have an alarm, should a command not be completed in time; a place with a time of its own needs none.

        A command without completion has to be taken in time.
        """
        sender = self.net.place(place)
        if sender.within is None:
            awaited = sender.completion or place
            if (earlier := self.overdue.pop(awaited, None)) is not None:
                earlier.cancel()
            self.overdue[awaited] = asyncio.get_running_loop().call_later(self.overdue_seconds, self._overdue, place)

    # Time

    def _tick(self, name: str) -> None:
        """Tell a controller the time, and see to it that it is told again when the next of its times is over."""
        if self.clock is None:
            return
        controller = self.controllers[name]
        self._act(name, controller.tick(self.clock.now_seconds()))
        if (earlier := self.ticks.pop(name, None)) is not None:
            earlier.cancel()
        if (due := controller.deadline()) is not None:
            delay = self.clock.loop_delay_seconds(due)
            self.ticks[name] = self.clock.loop.call_later(delay, self._post, name, None)

    async def _repeat(self) -> None:
        while True:
            await asyncio.sleep(self.resend_seconds)
            self._say_again()

    def _say_again(self) -> None:
        """Repeat what is unanswered."""
        before = self.messages
        for name, coordinator in self.coordinators.items():
            self._act(name, coordinator.resend())
        for name, controller in self.controllers.items():
            self._act(name, controller.resend())
        self.repeats += self.messages - before

    async def _ask(self) -> None:
        """Ask the driver what became of the commands that were under way at a crash."""
        for name, controller in self.controllers.items():
            for place, entry in controller.commands.questions:
                answer = Answer((await self.driver.ask(self.net.place(place), entry)).value)
                if answer is Answer.UNKNOWN:
                    answer = self.said.get(place, answer)
                self.answer(name, place, entry, answer)
                if answer is Answer.UNKNOWN:
                    self._told("held", f"nobody knows what became of the command of '{place}': look, and --say it")
                elif answer is Answer.WORKING:
                    self._watch(place)
            if controller.held:
                self._told("held", f"{called(name)} is held after a restart, until it is resumed")
        await asyncio.get_running_loop().create_future()

    def _overdue(self, place: str) -> None:
        sender = self.net.place(place)
        self.overdue.pop(sender.completion or place, None)
        awaited = f"'{sender.completion}' has not come" if sender.completion else "its machine has not taken it"
        try:
            self._fail(f"'{sender.command}' of '{place}' is overdue: {awaited} within {self.overdue_seconds:g} s")
        except Exception as error:  # a timer has no caller
            self._broken(error)

    # The end

    def _fail(self, message: str) -> None:
        if not self.fault:
            self.fault = message
            self.stopping = True
            self._make_safe()
            self._told("fault", message)
            asyncio.get_running_loop().call_soon(self._end)

    def _make_safe(self) -> None:
        """Stop the driver: what it is handed from now on it drops, so nothing is, and no command counts as sent."""
        self.driver.stop()
        self.is_safe = True

    def _is_settled(self) -> bool:
        """Whether nothing is open: whatever was decided is applied, and no part is promised."""
        rounds = (opened for coordinator in self.coordinators.values() for opened in coordinator.rounds.values())
        return all(opened.decided and opened.committed is None for opened in rounds) and not any(
            promise.promised for controller in self.controllers.values() for promise in controller.promises.values()
        )

    def _is_heard(self) -> bool:
        """Whether nobody waits for a word of this host: all rounds here are closed, and those above have ended.

        Hosts end from the top down: each waits for the coordinators before its own, without any for all.
        """
        before = takewhile(lambda name: name not in self.coordinators, self.deciding)
        return all(each.idle for each in self.coordinators.values()) and self.connected_to.isdisjoint(before)

    def _end(self) -> None:
        if self.outcome is None or self.outcome.done():
            return
        try:
            self._leave()
            ended = self.situation()
            if self._is_settled() and not self.posted:
                self.trace.end(self.marking, ended.state.value)
        except Exception as error:  # a timer has no caller
            self._broken(error)
        else:
            self.outcome.set_result(ended)

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._broken(error)

    def _broken(self, error: BaseException) -> None:
        """End the run by an error; the machines are stopped on the way out."""
        if self.outcome is not None and not self.outcome.done():
            self.outcome.set_exception(error)

    def _told(self, kind: str, sentence: str) -> None:
        self.trace.note(kind, message=sentence)
        if self.tell is not None:
            self.tell(kind, sentence)
        self._wake()
