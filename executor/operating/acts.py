"""The acts of the machines of one host, in groups: what they are given, what they keep, what leaves.

Machines are pure: a message, a signal, or their turn to fire goes in, effects come out. What a machine says to another
one of the same host is that one's next act, since a crash loses both or none. All acts of one turn of the event loop
are one *group*; at its end begin the one sync of the journal and, behind it, the writing of the trace, and then the
caller lets go of what leaves the host, commands and messages, in the order of the acts. So a signal and the command
that follows from it, whatever controllers and coordinators say about it in between, are one callback and one sync
(`journal.py` says why messages need not wait for the sync within a host).

Acts go on while a disk takes its time; what they let out, and the lines that tell of them, wait for the next sync
(`outbox.py`), whether they have written anything or not. Only as far as `AHEAD_MAX`: a disk that stands still fills no
memory.

A signal is not acted upon inside the call that tells it. A driver tells in the middle of its own bookkeeping, and would
be commanded there; and signals that come together would cost a sync each. It is acted upon when the driver says that
all is told, or in the next turn of the loop.

Nothing here waits, and nothing here is a machine's: no rule of the protocol stands in this file.

Rejected: a task and a mailbox for each machine. Messages between them are then turns of the event loop, of which a
coordinated transition takes a dozen, and nothing gained: acts exclude each other anyway.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Final, assert_never

from firable.executor.journal.journal import Journal, Storing
from firable.executor.journal.outbox import Outbox
from firable.executor.links.link import called
from firable.executor.operating.clock import RunClock
from firable.executor.operating.items import CommandTaken, Item, SignalRead
from firable.executor.operating.recorder import TRACE, Recorder
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

if TYPE_CHECKING:  # it needs the extra `serve`
    from firable.executor.operating.metrics import Metrics

ACTS_AT_ONCE_MAX: Final = 250
"""So many acts are one group at most; then they become durable, and the driver, the link and the operator are heard."""
AHEAD_MAX: Final = 10_000
"""So much may wait for a sync, things that leave and lines of the trace; then nothing is done before it is over."""


class Acts:
    """The machines of these names, as the journal kept them, and what they do.

    `wake` is called when there is something to do; `left` when a controller's part of a transition has fired. In
    `coalesced` they count the changes of signals that are taken back before a promise lets them be seen.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        names: Collection[str],
        journal: Journal,
        recorder: Recorder,
        figures: Metrics | None,
        wake: Callable[[], None],
        left: Callable[[str, str], None],
        coalesced: Counter[str],
    ) -> None:
        self.journal = journal
        self.recorder = recorder
        self.figures = figures
        self.wake = wake
        self.left = left
        self.coalesced = coalesced
        self.coordinators = {
            name: Coordinator.restored(decomposition, journal.kept(name), name)
            for name in coordinators(decomposition)
            if name in names
        }
        self.controllers = {
            subnet.name: LocalController.restored(decomposition, subnet.name, journal.kept(subnet.name))
            for subnet in decomposition.subnets
            if subnet.name in names
        }
        self.posted: deque[tuple[str, Item]] = deque()
        """What the machines here are given next."""
        self.outbox = Outbox[Sending | Message]()
        """What leaves the host when it is durable."""
        self.stored_in = ""
        """What is being written, in words."""
        self.unsynced = False
        self.then: list[Callable[[], None]] = []
        """What is called when all that was written until now is stored."""
        self.then_stored: list[Callable[[], None]] = []
        """What is called when the sync that is under way is over."""
        self.in_group = False
        """Whether a group is being done: then nobody has to be woken for what is posted."""
        self.has_news = False
        """Whether anything is said to other hosts for the first time."""
        self.halted = False
        """Whether nothing may fire here by itself, nor be promised to the coordinators of other hosts."""
        self.is_leaving = False
        """Whether all votes are taken back, and nothing is withheld any more: each request is answered by no."""
        self.withheld: dict[tuple[str, int], VoteRequest | Decision] = {}
        """What those have asked for meanwhile, and what they have decided on votes that stood before the halt."""
        self.standing: dict[str, set[str]] = {name: set() for name, one in self.controllers.items() if one.free}
        """For each controller with parts free of promise, what the trace tells as standing votes."""
        self.clock: RunClock | None = None
        self.ticks: dict[str, asyncio.TimerHandle] = {}
        """For each controller with a time that runs, when it is told the time next."""
        self.unbegun: set[str] = set()
        """The controllers with a time that begins when its command has left; their other times go on."""
        self.messages = 0
        self.repeats = 0
        self.heard = False
        """Whether anything came from outside since the last firing."""
        self.fired_seconds = -1.0
        self.fired_at_once: deque[str] = deque(maxlen=1)
        self.firings_at_once = 0
        """How many transitions have fired without that, or at one instant."""

    # What they are given

    def start(self) -> None:
        """The first act of each."""
        for machine, coordinator in self.coordinators.items():
            self.act(machine, coordinator.start())
        for machine, controller in self.controllers.items():
            self.act(machine, controller.start())
            self.post(machine, None)

    def post(self, machine: str, item: Item) -> None:
        """Have a machine given something, behind what was posted before."""
        self.posted.append((machine, item))
        self.wake()

    def hear(self, machine: str, item: Item) -> None:
        """The same, of what comes from outside the host: a signal, a message, the time."""
        self.heard = True
        self.posted.append((machine, item))
        self.wake()

    def hear_all(self, items: Collection[tuple[str, Item]]) -> None:
        """The same of several, to be done by a caller who wakes nobody."""
        self.heard = True
        self.posted += items

    def group(self) -> None:
        """Acts until nothing is posted, or they are many."""
        self.in_group = True
        try:
            for _ in range(ACTS_AT_ONCE_MAX):
                if not self.posted:
                    return
                self._give(*self.posted.popleft())
        finally:
            self.in_group = False

    def permit(self, firings: int | None) -> None:
        """Let each coordinator commit so many transitions from now on; None is without limit."""
        for machine, coordinator in self.coordinators.items():
            self.act(machine, coordinator.permit(firings))

    def halt(self) -> None:
        """Let nothing fire here by itself any more; rounds that are not decided are aborted."""
        self.halted = True
        self.permit(0)

    def go_on(self) -> None:
        """End a halt: what was withheld is answered, and everybody has a turn."""
        self.halted = False
        self.permit(None)
        self._answer_withheld()
        for machine in self.controllers:
            self.post(machine, None)

    def leave(self) -> None:
        """Take all votes of the controllers here back, and obey whatever was decided on them before."""
        if not self.is_leaving:
            self.is_leaving = True
            for machine, controller in self.controllers.items():
                self.act(machine, controller.leave())
            self._answer_withheld()

    def stay(self) -> None:
        """Give votes again after all."""
        self.is_leaving = False
        for machine, controller in self.controllers.items():
            controller.stay()
            self.post(machine, None)

    def _answer_withheld(self) -> None:
        for message in self.withheld.values():
            self.post(message.controller, message)
        self.withheld.clear()

    def forgo(self, names: Collection[str]) -> None:
        """Let these transitions fire no more, nor be promised here."""
        for machine, controller in self.controllers.items():
            controller.forgo(names)
            self.post(machine, None)

    def fire(self, machine: str) -> None:
        """Let a controller fire one local transition, although nothing may fire by itself."""
        controller = self.controllers[machine]
        self.act(machine, controller.fire())
        self._tick(machine)
        self.act(machine, controller.report())

    def repeat(self) -> None:
        """Say again what is unanswered."""
        for machine, coordinator in self.coordinators.items():
            self.act(machine, coordinator.resend(), again=True)
        for machine, controller in self.controllers.items():
            self.act(machine, controller.resend(), again=True)

    def end(self) -> None:
        """Tell nobody the time any more."""
        for timer in self.ticks.values():
            timer.cancel()

    def _give(self, machine: str, item: Item) -> None:
        """One act of one machine, and a controller's turn to fire and to report."""
        if (coordinator := self.coordinators.get(machine)) is not None:
            if not isinstance(item, ToCoordinator):
                raise ProtocolError(f"{called(machine)} was sent {item!r}")
            self.act(machine, coordinator.receive(item))
            return
        controller = self.controllers[machine]
        effects: list[Effect] = []
        match item:
            case SignalRead():
                effects = self._read(controller, item)
            case VoteRequest() if self._withholds(item):
                self.withheld[machine, item.round] = item
                return
            case Decision() if self._withholds(item) and item.committed in controller.free:
                self.withheld[machine, item.round] = item  # as if it were still on its way
                return
            case VoteRequest() | Decision() | Hello():
                self._receive(machine, controller, item)
            case CommandTaken():
                effects = controller.sent(item.place, item.entry)
            case None:
                pass
            case unknown:
                raise ProtocolError(f"{called(machine)} was sent {unknown!r}")
        # On the way of each signal it counts that what it makes is one act, as far as nobody's time comes in between.
        if controller.timers.running or self.ticks:
            self.act(machine, effects)
            effects = []
            self._tick(machine)
        if not self.halted and (fired := controller.fire()):
            effects += fired
            if controller.timers.running or self.ticks:
                self.act(machine, effects)
                effects = []
                self._tick(machine)
            if controller.may_fire:
                self.posted.append((machine, None))
        effects += controller.report()
        if effects:
            self.act(machine, effects)

    def _read(self, controller: LocalController, item: SignalRead) -> list[Effect]:
        """Give a controller a signal; two changes are coalesced by one that comes back to what a promise has kept."""
        if not (latched := controller.latched):
            return controller.read(item.signal, item.value, item.entry)
        was = latched.get(item.signal)
        effects = controller.read(item.signal, item.value, item.entry)
        is_kept = bool(controller.word & controller.player.signal_bit(item.signal)) == item.value
        if was is not None and latched.get(item.signal, was) != was and is_kept:
            self.coalesced[item.signal] += 2
        return effects

    def _withholds(self, item: VoteRequest | Decision) -> bool:
        return self.halted and not self.is_leaving and item.coordinator not in self.coordinators

    def _receive(self, machine: str, controller: LocalController, item: ToController) -> None:
        known = frozenset(controller.promises)
        applied = str(item.committed) if isinstance(item, Decision) and controller.applies(item) else None
        effects = controller.receive(item)
        if isinstance(item, Decision) and applied is not None:
            self.recorder.applied(self.now_seconds(), machine, item.round, applied)
            self.left(machine, applied)
            if applied in controller.free:
                self._obeyed(machine, applied, effects, known)
                return
        self.act(machine, effects, known)

    def _obeyed(self, machine: str, applied: str, effects: list[Effect], known: Collection[int]) -> None:
        """Take the effects of an order on a vote that stood, which is used from the acknowledgement on and not before.

        An order of a coordinator in a new epoch has all said again first: that is the vote that is used, no new one.
        """
        self.standing[machine].add(applied)
        at = next(i for i, effect in enumerate(effects) if isinstance(effect, Acknowledgement))
        self.act(machine, effects[:at], known)
        self.standing[machine].discard(applied)
        self.act(machine, effects[at:], known)

    def _tick(self, machine: str) -> None:
        """Tell a controller the time, and see to it that it is told again when the next of its times is over.

        A time begins with that, but not before its command has left: a machine is not accused of a disk that is slow.
        """
        controller = self.controllers[machine]
        if not controller.timers.running and machine not in self.ticks:
            return  # most machines have no time limits, and this is on the way of each signal
        held = controller.timers.unbegun(one.place for one in self.outbox if isinstance(one, Sending))
        if held:
            self.unbegun.add(machine)  # `let_go` has it told
        self.act(machine, controller.tick(self.now_seconds(), held))
        if (earlier := self.ticks.pop(machine, None)) is not None:
            earlier.cancel()
        if self.clock is not None and (due := controller.deadline(held)) is not None:
            delay = self.clock.loop_delay_seconds(due)
            self.ticks[machine] = self.clock.loop.call_later(delay, self.hear, machine, None)

    def have_kept(self, then: Callable[[], None] | None = None) -> None:
        """Have the journal keep what was written to it beside the acts, and call this as soon as that is stored."""
        if then is not None:
            self.then.append(then)
        self.unsynced = True
        self.wake()

    # What comes of it

    def now_seconds(self) -> float:
        """The time since the run began."""
        return self.clock.now_seconds() if self.clock is not None else self.recorder.at_seconds

    def act(self, machine: str, effects: list[Effect], known: Collection[int] = (), *, again: bool = False) -> None:
        """Take the effects of one act: writes to the journal, messages to machines here, the rest to those who wait.

        `known` are the rounds that the controller has voted in before; `again`: all are repeated.
        """
        if not effects:
            return
        keeps: list[Keep] = []
        now = self.clock.now_seconds() if self.clock is not None else self.recorder.at_seconds
        for effect in effects:
            match effect:
                case Keep():
                    keeps.append(effect)
                case Taken():
                    self.recorder.signal(now, effect.signal, effect.value)
                case Firing():
                    self._fired(now, machine, effect.transition, effects)
                case Sending():
                    if effect.again:  # its line stands in the trace since before the restart
                        self.recorder.note(now, "sent again", place=effect.place)
                    else:
                        self.recorder.sent(now, effect.place)
                    self.outbox.add(effect)
                case VoteRequest() | Decision() | Hello():
                    self._say(effect.controller, effect, again=again)
                case Vote(controller, number, promised):
                    is_new = not again and number not in known
                    if is_new:
                        self.recorder.voted(now, controller, number, promised)
                    self._stands(now, effect)
                    self._say(effect.coordinator, effect, again=not is_new)
                case Report() | Acknowledgement():
                    self._stands(now, effect)
                    self._say(effect.coordinator, effect, again=again)
                case _:
                    assert_never(effect)
        if keeps:
            self.journal.write(machine, keeps)
            self.unsynced = True
        if not self.in_group:
            self.wake()

    def _fired(self, now: float, machine: str, transition: str, effects: list[Effect]) -> None:
        number = None
        if machine in self.coordinators:
            number = next(e.round for e in effects if isinstance(e, Decision) and e.committed == transition)
        else:
            self.left(machine, transition)
        self.recorder.fired(now, transition, number)
        if self.heard and now != self.fired_seconds:
            self.firings_at_once = 0
        self.heard, self.fired_seconds = False, now
        self.firings_at_once += 1
        self.fired_at_once.append(transition)

    def _stands(self, now: float, told: Report | Vote | Acknowledgement) -> None:
        """Have the trace of one host among others tell of votes that stand from now on, before anybody counts them."""
        if (known := self.standing.get(told.controller)) is None or not self.recorder.machines:
            return
        if new := (told.readiness.transitions & self.controllers[told.controller].free) - known:
            known |= new
            self.recorder.stands(now, told.controller, new)
            self.unsynced = True

    def _say(self, receiver: str, message: Message, *, again: bool) -> None:
        self.messages += 1
        self.repeats += again
        if self.figures is not None:
            self.figures.message(message, again=again)
        if receiver in self.coordinators or receiver in self.controllers:
            self.posted.append((receiver, message))
        else:
            self.outbox.add(message)
            self.has_news |= not again

    @property
    def is_ahead(self) -> bool:
        """Whether so much waits for the disk that nothing more is done before it has answered."""
        return self.outbox.is_under_way and len(self.outbox) + len(self.recorder.unwritten) > AHEAD_MAX

    def commit(self) -> list[Storing]:
        """Begin the sync of all acts until now; returns what stores them, in this order, which may wait for a disk.

        `stored` and `let_go` follow when that is done. Raises `InputError` where the journal cannot be written; then,
        or where what is returned raises it, the process must end.
        """
        self.outbox.begin()
        sync = None
        if self.unsynced:
            self.unsynced = False
            self.then_stored, self.then = self.then, []
            self.journal.write(TRACE, self.recorder.keep())
            sync = self.journal.sync()
        writing = self.recorder.writing()
        if sync is None or writing is None:
            self.stored_in = "the trace" if sync is None else "the journal"
            return [one for one in (sync, writing) if one is not None]
        self.stored_in = "the journal and the trace"
        return [sync, writing]

    def stored(self) -> None:
        """What was begun is durable, and the trace tells it.

        Raises `InputError` where a trace that is no file cannot be written; then the process must end.
        """
        self.recorder.written()
        for call in self.then_stored:
            call()
        self.then_stored = []

    def let_go(self) -> list[Sending | Message]:
        """What leaves the host now that its cause is stored, or is never sent."""
        for machine in self.unbegun:
            self.post(machine, None)
        self.unbegun.clear()
        return self.outbox.over()

    # What is open

    def awaited(self) -> dict[str, set[str]]:
        """For each controller that is leaving, the coordinators whose word it waits for."""
        return {name: set(controller.awaited) for name, controller in self.controllers.items()}

    @property
    def is_settled(self) -> bool:
        """Whether nothing is open: whatever was decided is applied, and no part is promised."""
        rounds = (opened for coordinator in self.coordinators.values() for opened in coordinator.rounds.values())
        return (
            not self.posted
            and all(opened.decided and opened.committed is None for opened in rounds)
            and not any(p.promised for controller in self.controllers.values() for p in controller.promises.values())
        )
