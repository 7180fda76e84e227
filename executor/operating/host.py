"""The host: one process with some machines of a cell, or all of them, their driver, their journal, and an operator.

A run of a whole cell is a host with all machines and no link; a controller beside its machine is a host with one. What
they do is the same: acts in groups (`acts.py`), which become durable before anything of them leaves (`groups.py`). This
file is who may halt that, and what carries it.

When nothing is posted any more the host is *quiescent*: that is when markings are shown (O7), situations are judged and
an operator's step is over.

*Operator*, on each host, for what is on it. *Pause*: no further firing; rounds that are not decided are aborted, and
nothing more is promised to coordinators elsewhere; machines end the command they are at. *Step*: while paused, one
firing. The ways to stop are in `stopping.py`.

A whole run ends by itself, too: when its work is done, or nothing can go on. A host among others does not: its machines
rest because others work. Its trace has a last line only where nothing was open.

Rejected: a process for each of driver, controllers and link. Their crashes would be independent, and every pair of them
would need a protocol like that between hosts. Threads: they add every interleaving of two lines of Python to those of
the protocol, for no gain in one process.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Sequence
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.driver import Driver, Latched, Telling
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.links.link import Link
from firable.executor.links.standing import Standing
from firable.executor.operating import ending, latch, lives, restart, stopping
from firable.executor.operating.acquaintances import Acquaintances
from firable.executor.operating.acts import Acts
from firable.executor.operating.aside import UntoldError
from firable.executor.operating.circling import Circling
from firable.executor.operating.clock import RunClock
from firable.executor.operating.coalesced import Coalesced
from firable.executor.operating.conduct import UNATTENDED, Conduct, Watch
from firable.executor.operating.dispatch import Dispatch
from firable.executor.operating.groups import Groups
from firable.executor.operating.items import SignalRead
from firable.executor.operating.latch import Latch
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.log import NOT_OBEYED, TURNED_AWAY
from firable.executor.operating.monitor import Divergence, Monitor
from firable.executor.operating.peers import Peers
from firable.executor.operating.recorder import TRACE, Recorder
from firable.executor.operating.single_step import step
from firable.executor.operating.situation import Situation, State
from firable.executor.operating.uncut import Patience
from firable.executor.operating.watching import UNWATCHED, UNWATCHED_SENTENCE, Watching, otherwise
from firable.executor.operating.whereabouts import Elsewhere
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import Keep, Message, Sending
from firable.nets.decomposition import Decomposition

if TYPE_CHECKING:
    from firable.executor.cell.plant import Plant
    from firable.executor.operating.metrics import Metrics  # it needs the extra `serve`

_END: Final = "end"
"""Under which the journal keeps, beside the trace, that all the work of the run was done."""


class Host:
    """Machines of a decomposition with a driver, all of them where there is no link; `main` runs them to the end."""

    def __init__(
        self,
        decomposition: Decomposition,
        driver: Driver,
        recorder: Recorder,
        conduct: Conduct = UNATTENDED,
        *,
        machines: Collection[str] | None = None,
        link: Link | None = None,
        journal: Journal | None = None,
        speed: float = 1.0,
        begin_seconds: float = 0.0,
        is_complete: Callable[[], bool] = lambda: False,
        cell: Plant | None = None,
        monitor: Monitor | LocalMonitor | None = None,
        figures: Metrics | None = None,
        patience: Patience | None = None,
        latched: Callable[[], Latched] | None = None,
        elsewhere: Elsewhere | None = None,
    ) -> None:
        self.decomposition = decomposition
        self.net = decomposition.net
        self.driver = driver
        self.recorder = recorder
        self.conduct = conduct
        self.journal = journal or MemoryJournal()
        everything = (*coordinators(decomposition), *(subnet.name for subnet in decomposition.subnets))
        self.machines = everything if machines is None else machines
        self.link = link
        self.acquaintances = Acquaintances(self.journal, is_linked=link is not None)
        # One that may be refused changes no file, until somebody has let it in or, after a restart, it is resumed.
        recorder.may_write = link is None
        self.is_whole = link is None
        self.speed = speed
        self.begin_seconds = begin_seconds
        self.is_complete = is_complete
        self.operated = conduct.operator is not None
        self.served = False
        """Whether an operator may act from elsewhere."""
        self.tell = conduct.tell
        self.divergence: Divergence | None = None
        self.watching = None if monitor is None else Watching(monitor, self._diverged)
        self.figures = figures
        self.log = conduct.log
        self.circling = None if cell is None else Circling(self, cell)
        """Whether a run on this simulated cell goes round in a circle."""
        observers = (self.watching, figures, self.log, self.circling)
        recorder.observers += [one.seen for one in observers if one is not None]
        self.elsewhere = elsewhere
        """Machines that are not where the journal has them, until somebody has said that these are the machines."""
        self.said = conduct.said if elsewhere is None else {}
        """What the operator has said beforehand of commands, by place."""
        self.patience = patience or Patience()
        self.latched = latched
        self.latch: Latch | None = None
        """The emergency stop that nobody has reset."""
        self.is_to_end = False
        """Whether somebody has asked for the end of the run."""
        self.turn = 0
        self.pauses = 0
        """How often somebody has said to pause: that ends the steps that were asked for before."""
        self.clock: RunClock | None = None
        self.coalesced = Coalesced(driver)
        self.begin(resume=conduct.resume)
        if figures is not None and self.taking_up is not None:
            figures.taken_up(self.marking)
        if isinstance(monitor, LocalMonitor):
            monitor.excuse(lambda signal: self.controllers[self.owner_of[signal]].holds(signal))

    def begin(self, *, resume: bool) -> None:
        """Begin a life, with the machines of the protocol as the journal holds them."""
        self.dispatch = Dispatch(self, self.conduct.overdue_seconds)
        self.groups = Groups(self)
        self.acts = Acts(
            self.decomposition,
            self.machines,
            self.journal,
            self.recorder,
            self.figures,
            self.groups.wake,
            self.dispatch.left,
            self.coalesced.behind_promises,
        )
        self.coordinators, self.controllers = self.acts.coordinators, self.acts.controllers
        if isinstance(self.driver, Telling) and self.driver.tells_each_sensor:
            for controller in self.controllers.values():
                controller.await_sensors()
        at_once, go_on = self.groups.at_once, self._go_on
        known, link = self.acquaintances, self.link
        self.peers = Peers(self.decomposition, self.acts, known, link, self.told, at_once, go_on, self.broken)
        self.recorder.may_write |= not self.peers.names
        if self.peers.is_unmet:
            self.acts.halt()
        self.owner_of = {signal.name: name for name, c in self.controllers.items() for signal in c.subnet.signals}
        self.taking_up: restart.TakingUp | None = None
        """What a restart has found out, as long as the controllers are held."""
        if any(controller.held for controller in self.controllers.values()):
            self.taking_up = restart.TakingUp(resume=resume)
        self.was_done = self.journal.kept(TRACE).get(_END) == State.DONE.value
        self.paused = False
        self.stepping = asyncio.Lock()
        """Held by whoever makes a single step."""
        self.stopping = False
        self.draining = False
        self.ends_at_home = False
        """Whether the cycle has ended when the machines are as at the beginning: their driver cannot tell."""
        self.is_safe = False
        """Whether the safe outputs are driven; commands that were issued and did not leave are asked after, later."""
        self.has_waited = False
        """Whether a stop has waited long enough for what is open."""
        self.waiting: list[asyncio.TimerHandle] = []
        """What a stop does when it has waited long enough."""
        self.left_nothing_open = False
        self.emergency = None if self.latch is None else self.latch.reason
        """Why there was an emergency stop, if there was one."""
        self.ended_by = ""
        self.fault = ""
        self.ended: Situation | None = None
        """How this life has ended, as soon as that is decided."""
        self.quiet_waiters: list[asyncio.Future[None]] = []
        self.outcome: asyncio.Future[Situation] | None = None

    # The run

    async def main(self) -> Situation:
        """Run until the work is done, nothing can go on, something fails, or the operator stops; returns how it ended.

        Raises `InputError` where the link, the journal or the trace fails; the safe outputs are driven before.
        """
        return await lives.to_the_end(self)

    def now_seconds(self) -> float:
        """The time since the run began."""
        return self.clock.now_seconds() if self.clock is not None else self.begin_seconds

    @property
    def at_rest(self) -> bool:
        """Whether nothing is pending: no message under way, no event in the cell to come, nothing awaited or timed.

        Then time changes nothing; only the operator, by a step or a resume, may let something fire. Nor is a signal
        waited for that is set from outside again and again.
        """
        is_pending = self.dispatch.timers or self.acts.ticks or (self.circling is not None and self.circling.is_hoped)
        return self.is_quiet and self.driver.at_rest and not is_pending

    @property
    def marking(self) -> tuple[str, ...]:
        """The places that hold a token, of the machines here."""
        if self.is_whole:
            return self.net.names(self.recorder.marking)
        return tuple(place for one in self.controllers.values() for place in one.subnet.names(one.marking))

    @property
    def standing(self) -> Standing:
        """What keeps everything standing here, as the other hosts are told."""
        if self.latch is not None:
            return Standing.LATCHED
        if self.taking_up is not None:
            return Standing.HELD
        return Standing.PAUSED if self.paused else Standing.GOING

    def situation(self) -> Situation:
        """What the host is doing, and what waits for what; exact at quiescence, as far as its machines know."""
        return ending.situation(self)

    # What the operator may do

    def pause(self) -> bool:
        """Let nothing fire any more, a step that was asked for before neither; machines end the command they are at.

        False where the host is latched or stopping, and everything stands for longer than a pause.
        """
        if self.stopping or self.latch is not None:
            return False
        self.pauses += 1
        if not self.paused:
            if self.acts.is_leaving:
                self.acts.stay()
            stopping.halt(self, "paused")
        else:
            self.acts.permit(0)  # to a step that waits for votes
        return True

    def resume(self) -> bool:
        """Let transitions fire again after a pause, or after a restart once nothing about it is uncertain.

        False where it is not, or the host is latched or stopping: what is owed would be commanded after the stop. Where
        machines are elsewhere, it says that these are the machines; they are asked, and it goes on by itself then.
        """
        if self.stopping or self.latch is not None:
            return False
        if self.taking_up is not None and self.elsewhere is not None:
            restart.found_again(self, self.taking_up, self.elsewhere)
            return True
        if restart.uncertain(self):
            return False
        if self.taking_up is not None:
            if self.peers.is_unmet:
                return False
            restart.release(self)
        if self.paused:
            self.paused = False
            self.note("resumed")
            self._go_on()
        return True

    def _go_on(self) -> None:
        """End a halt, unless something else keeps everything standing."""
        if not self.paused and not self.peers.is_unmet:
            self.acts.go_on()

    async def step(self) -> str | None:
        """While paused, fire one transition; returns its name, or None where none is enabled."""
        return await step(self)

    def stop(self, *, at_end_of_cycle: bool = False) -> bool:
        """End the run: now, with every machine stopped where it is, or when the work in the cell is done.

        False where it is to end with the cycle, and the host is latched or stopping.
        """
        return stopping.stop(self, at_end_of_cycle=at_end_of_cycle)

    def emergency_stop(self, reason: str) -> None:
        """Drive the safe outputs at once, before anything is written or said; it can be reset, or the run ends."""
        stopping.emergency_stop(self, reason)

    def reset(self) -> tuple[str, ...]:
        """End the latch after an emergency stop: the machines are asked, nothing moves. Returns what is against it."""
        return latch.reset(self)

    def say(self, place: str, answer: Answer) -> tuple[str, ...]:
        """Say what became of a command that no machine can tell of; why that does not count, where it does not."""
        return restart.say(self, place, answer)

    def commanded(self, command: str, by: str) -> None:
        """Who commanded what stands in the trace."""
        self.note("commanded", what=command, by=by)

    def not_obeyed(self, command: str, by: str, why: str) -> None:
        """And which of these was refused."""
        self.note(NOT_OBEYED, what=command, by=by, why=why)

    def turned_away(self, command: str, by: str) -> None:
        """Who was not let in stands there, too."""
        self.note(TURNED_AWAY, what=command, by=by)

    def answer(self, controller: str, place: str, entry: int, answer: Answer) -> None:
        """Say what became of a command that was under way when the host was restarted."""
        self.acts.act(controller, self.controllers[controller].answer(place, entry, answer))
        if answer in (Answer.WORKING, Answer.NOT_RECEIVED):
            self.dispatch.keep_taken(place, entry if answer is Answer.WORKING else None)
        if answer is Answer.WORKING:
            self.dispatch.watch(place, entry)

    async def quiet(self) -> None:
        """Wait until nothing is posted, or the run is over."""
        if not self.is_quiet and self.outcome is not None and not self.is_over:
            waiter = asyncio.get_running_loop().create_future()
            self.quiet_waiters.append(waiter)
            await waiter

    async def operate(self, operator: Callable[[Host], Awaitable[None]]) -> None:
        """Let an operator act until that ends; then a run that only an operator could have changed may end."""
        await operator(self)
        self.operated = False
        self.groups.wake()

    # What the driver tells, and asks

    async def let_drive(self) -> None:
        """Wait until the machines may be driven: no other host has them, as far as is known, or it is an emergency."""
        await self.peers.let_drive(lambda: self.emergency is not None)

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """A signal has a new value."""
        if entry is not None:
            self.dispatch.over(name)
        self.acts.hear(self.owner_of[name], SignalRead(name, value, entry))

    def taken(self, place: str, entry: int) -> None:
        """A machine has the command of a place."""
        self.dispatch.taken(place, entry)

    def driver_fault(self, machine: str, message: str) -> None:
        """A machine has failed: nothing fires any more."""
        self.fail(f"{machine}: {message}" if machine else message)

    def driver_note(self, machine: str, message: str) -> None:
        """What a driver says of a machine or its link stands in the trace."""
        self.told("driver", f"{machine}: {message}")

    def all_told(self) -> None:
        """What came together is told: if it is anything, the group that is due for it is done now."""
        self.groups.do_due()

    def moved(self) -> None:
        """Something happened in the cell; perhaps it has come to rest."""
        self.groups.wake()

    # Groups

    def leave(self, leaving: Sequence[Sending | Message]) -> None:
        """Let go of what is durable: commands to the driver, messages to the link."""
        if self.acts.has_news:
            self.acts.has_news = False
            self.peers.something_new()
        for effect in leaving:
            if not isinstance(effect, Sending):
                self.peers.send(effect)
            elif (
                self.is_safe or self.stopping
            ):  # the trace has it as issued; a restart asks after it, and gives it then
                self.note("kept back", place=effect.place)
            else:
                self.dispatch.send(effect.place, effect.entry)
        if self.ended is not None and self.outcome is not None:
            self.outcome.set_result(self.ended)

    def settle(self) -> None:
        """At quiescence, wake who waits for it, and end the run if nothing will happen."""
        self._release()
        if not self.stopping:  # it is lost, soon
            self.peers.stand(self.standing)
        if self.ends_at_home and not self.stopping and not self.paused and stopping.ends_cycle(self):
            return
        ended = ending.ended(self)
        if ended is not None and self.outcome is not None:
            if ended.state is State.DONE:
                self.journal.write(TRACE, [Keep(_END, ended.state.value)])
                self.acts.unsynced = True
            self.ended = ended
            # What comes while the link is closed is not heard.
            self.left_nothing_open = self.acts.is_settled and self.peers.have_let_go
            self.groups.commit()

    def _release(self) -> None:
        """Wake who waits for quiescence."""
        for waiter in self.quiet_waiters:
            if not waiter.done():
                waiter.set_result(None)
        self.quiet_waiters.clear()

    @property
    def is_over(self) -> bool:
        """Whether it is known how the run has ended, if by an error."""
        return self.ended is not None or (self.outcome is not None and self.outcome.done())

    @property
    def is_quiet(self) -> bool:
        """Whether nothing is posted, nor waits for the journal."""
        return self.groups.are_over and not self.acts.posted

    def _diverged(self, found: Divergence) -> None:
        """The machines do what their model excludes; what they do when they are stopped it does not know."""
        if self.stopping:
            return
        self.divergence = found
        self.recorder.note(found.at_seconds, "divergence", message=str(found))
        self.groups.wake()
        if self.conduct.watch is Watch.STOP:
            self.fail(otherwise(found))
        else:
            self.tell_operator("divergence", otherwise(found))

    def unwatch(self) -> None:
        """Hold the machines against their plant file no more, and tell so: they go on from somewhere in the middle."""
        if self.watching is not None:
            self.recorder.observers.remove(self.watching.seen)
            self.watching = None
            self.told(UNWATCHED, UNWATCHED_SENTENCE)

    @property
    def is_watched(self) -> bool:
        """Whether the machines were held against their plant file to the end, or to the first divergence."""
        return self.watching is not None or self.divergence is not None

    # The end

    def fail(self, message: str) -> None:
        """End the run by a fault, with the machines stopped where they are."""
        stopping.fail(self, message)

    def make_safe(self) -> None:
        """Stop the driver: what it is handed from now on it drops, so nothing is, and no command counts as sent."""
        self.is_safe = True
        try:
            self.driver.stop()
        except Exception as error:  # a timer has no caller
            self.broken(error)

    def task_ended(self, task: asyncio.Task[None]) -> None:
        """What runs beside the host has ended: with an error the run does."""
        if not task.cancelled() and (error := task.exception()) is not None:
            self.broken(error)

    def broken(self, error: BaseException) -> None:
        """End the run by an error; the machines are stopped on the way out."""
        if self.outcome is not None and not self.outcome.done():
            self.outcome.set_exception(error)
            if self.log is not None:
                self.log.broke(error)
        self._release()  # no group will ever end for them

    def note(self, note: str, **data: str) -> None:
        """Have the trace tell something, durably."""
        self.recorder.note(self.now_seconds(), note, **data)
        self.acts.unsynced = True
        self.groups.wake()

    def told(self, kind: str, sentence: str) -> None:
        """Have the trace tell something, and whoever follows the run."""
        self.note(kind, message=sentence)
        self.tell_operator(kind, sentence)

    def tell_operator(self, kind: str, sentence: str) -> None:
        """Tell who follows the run; one that cannot be told (a terminal that is gone) stops no stop on its way.

        The trace notes what was told to nobody, this line or earlier ones.
        """
        if self.tell is not None:
            try:
                self.tell(kind, sentence)
            except UntoldError as error:
                for what, why in error.untold:
                    self.note("untold", message=error.sentence((what, why)), what=what)
            except Exception as error:
                self.note("untold", message=f"{type(error).__name__}: {error}", what=kind)
