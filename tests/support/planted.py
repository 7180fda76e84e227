"""Machines of the protocol and hosts with a planted fault each: ways to forget what keeps a cell safe or going.

Each is the executor's own machine with one thing left out or done too early. The simulation must find every one of
them; the table `PLANTED` says by which kinds of faults it is provoked.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Self

from firable.executor.protocol.above import Promise
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator, Round
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Hello,
    Keep,
    Readiness,
    Report,
    Sending,
    Stored,
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import Compiled
from firable.executor.simulation.process import Process
from firable.executor.simulation.world import Machines
from firable.nets.decomposition import Decomposition


def without(effects: Iterable[Effect], *keys: str) -> list[Effect]:
    """The effects but for writes under keys that begin so."""
    return [effect for effect in effects if not (isinstance(effect, Keep) and effect.key.startswith(keys))]


# --- Controllers


class KeepsNoPromise(LocalController):
    """A yes is given, and not kept."""

    def receive(self, message: ToController) -> list[Effect]:
        return without(super().receive(message), "promise/")


class KeepsNoMarking(LocalController):
    """The marking is not kept."""

    def receive(self, message: ToController) -> list[Effect]:
        return without(super().receive(message), "word")

    def fire(self) -> list[Effect]:
        return without(super().fire(), "word")


class KeepsNoLocalFiring(LocalController):
    """The marking is kept where a coordinated transition changed it, only."""

    def fire(self) -> list[Effect]:
        return without(super().fire(), "word")


class ForgetsClosedRounds(LocalController):
    """Which rounds are over is not kept."""

    def receive(self, message: ToController) -> list[Effect]:
        return without(super().receive(message), "closed")


class KeepsNoCommand(LocalController):
    """Which commands were issued is not kept."""

    def receive(self, message: ToController) -> list[Effect]:
        return without(super().receive(message), "command/")

    def fire(self) -> list[Effect]:
        return without(super().fire(), "command/")


class NumbersReportsAnew(LocalController):
    """After a restart reports are numbered from the beginning."""

    def start(self) -> list[Effect]:
        return without(super().start(), "epoch")

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        super()._restore({**kept, "epoch": -1})
        self.told = -1
        self.readiness = Readiness(-1, frozenset())


class FiresWhileHeld(LocalController):
    """After a restart everything goes on by itself."""

    @classmethod
    def restored(cls, decomposition: Decomposition, name: str, kept: Mapping[str, Stored]) -> Self:
        machine = super().restored(decomposition, name, kept)
        machine.held = False
        return machine


class SendsWithoutAsking(LocalController):
    """After a restart every command that may not have arrived is sent again, without asking its machine."""

    def answer(self, place: str, entry: int, answer: Answer) -> list[Effect]:
        del answer  # whatever it is
        return super().answer(place, entry, Answer.NOT_RECEIVED)


class TakesCommandsForDone(LocalController):
    """After a restart a command that a machine is at is taken for done."""

    def answer(self, place: str, entry: int, answer: Answer) -> list[Effect]:
        return super().answer(place, entry, Answer.DONE if answer is Answer.WORKING else answer)


class NeverSendsAgain(LocalController):
    """A command that was not received before a crash is never sent."""

    def resume(self) -> list[Effect]:
        return [effect for effect in super().resume() if not isinstance(effect, Sending)]


class BelievesOldSensors(LocalController):
    """After a restart sensors are taken to show what they showed before it."""

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        super()._restore(kept)
        self.untold = 0


class TakesStaleCompletions(LocalController):
    """The completion of an earlier command counts for the present one."""

    def read(self, signal: str, value: bool, entry: int | None = None) -> list[Effect]:
        return super().read(signal, value, None if entry is None else self.commands.entry(signal))


class NoLock(LocalController):
    """A yes vote promises nothing."""

    def _disturbs_promises(self, _transition: Compiled) -> bool:
        return False


class ReadsUnlocked(LocalController):
    """What a promised part will write may still be read."""

    def _disturbs_promises(self, transition: Compiled) -> bool:
        return any(transition.writes & promise.reads for promise in self.promises.values())


class SignalsUnlocked(LocalController):
    """A signal may change between the vote and the commit."""

    def _locked_reads(self) -> int:
        return 0


class ForgetsSignals(LocalController):
    """A signal that changed during a promise is never taken in."""

    def _release(self) -> Iterator[Effect]:
        yield from ()


class LeavesUntaken(LocalController):
    """A token without completion goes on although no machine has taken its command."""

    def _is_enabled(self, transition: Compiled) -> bool:
        return transition.enabled(self.word)


class AppliesTwice(LocalController):
    """An order that comes again is carried out again."""

    def _is_closed(self, number: int) -> bool:
        return number < self.above_of(number).closed_below

    def _apply(self, decision: Decision, _promise: Promise | None) -> Iterator[Effect]:
        yield from self._fire(self.parts[str(decision.committed)])


class VotesFromMemory(LocalController):
    """A vote is what was reported last, not what holds now; orders are carried out blindly."""

    def _vote(self, request: VoteRequest) -> Iterator[Effect]:
        if not self._is_closed(request.round):
            readiness = self.above_of(request.round).readiness
            self.promises.setdefault(request.round, Promise(readiness.transitions, 0, 0))
            yield Vote(self.name, request.round, self.promises[request.round].promised, readiness, request.coordinator)

    def _apply(self, decision: Decision, _promise: Promise | None) -> Iterator[Effect]:
        yield from self._fire(self.parts[str(decision.committed)])


class AppliesBlindly(NoLock):
    """The naive system of the paper: no promise at the vote, no check at the order."""

    def _apply(self, decision: Decision, _promise: Promise | None) -> Iterator[Effect]:
        yield from self._fire(self.parts[str(decision.committed)])


class ForgetsVotes(LocalController):
    """The request of a decided round locks once more."""

    def _is_closed(self, number: int) -> bool:
        return number in self.closed and number not in self.promises and number % 2 == 0


class ReportsOnce(LocalController):
    """A report that is lost stays lost."""

    def resend(self) -> list[Effect]:
        return [effect for effect in super().resend() if not isinstance(effect, Report)]

    def receive(self, message: ToController) -> list[Effect]:
        return [] if isinstance(message, Hello) else super().receive(message)


# --- Coordinators


class ReusesRounds(Coordinator):
    """After a restart rounds are numbered from the beginning."""

    def start(self) -> list[Effect]:
        return without(super().start(), "epoch")


class KeepsNoDecision(Coordinator):
    """A commit is sent, and not kept."""

    def receive(self, message: ToCoordinator) -> list[Effect]:
        return without(super().receive(message), "round/")


class DropsDecisions(Coordinator):
    """After a restart nobody is told of what was committed before."""

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        super()._restore({key: value for key, value in kept.items() if not key.startswith("round/")})


class LeavesVotesUnanswered(Coordinator):
    """A vote of a round from before the restart gets no answer, and nothing says that the round is over."""

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        if vote.round in self.rounds:
            yield from super()._voted(vote)

    @property
    def closed_below(self) -> int:
        return 0


class DecidesEarly(Coordinator):
    """The decision does not wait for all votes."""

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        voted = self.rounds.get(vote.round)
        if voted is not None and not voted.decided:
            for controller in voted.participants:
                voted.votes.setdefault(controller, frozenset(voted.transitions))
        yield from super()._voted(vote)


class CachedVotes(Coordinator):
    """A yes of an earlier round counts for the present one."""

    def receive(self, message: ToCoordinator) -> list[Effect]:
        if isinstance(message, Vote):
            for opened in self.rounds.values():
                if not opened.decided and message.controller in opened.participants and message.round < opened.number:
                    return super().receive(replace(message, round=opened.number))
        return super().receive(message)


class CachedGates(Coordinator):
    """Who owns only a gate is not asked; its last report is believed."""

    def _ask(self, group: int, names: tuple[str, ...]) -> Iterator[Effect]:
        requests = list(super()._ask(group, names))
        transitions = [self.player.net.transition(name) for name in names]
        moved = [self.player.net.place(place) for t in transitions for place in (*t.inputs, *t.outputs)]
        opened = self.rounds[self.next_round - 1]
        opened.participants = tuple(c for c in opened.participants if c in {place.owner for place in moved})
        return (r for r in requests if isinstance(r, VoteRequest) and r.controller in opened.participants)

    def _choice(self, voted: Round) -> str | None:
        voted.votes = {**self.ready, **voted.votes}
        return super()._choice(voted)


class CommitsAborted(Coordinator):
    """A round that was aborted is committed when its votes come after all."""

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        voted = self.rounds.get(vote.round)
        if voted is not None and voted.decided and voted.committed is None:
            voted.decided = False
        yield from super()._voted(vote)


class IgnoresPause(Coordinator):
    """What was asked before the operator paused is committed after it."""

    def permit(self, firings: int | None) -> list[Effect]:
        return super().permit(firings) if firings else []


class OldReports(Coordinator):
    """A report that was overtaken replaces the newer one."""

    def _hear(self, controller: str, readiness: Readiness) -> None:
        self.seen[controller] = -1
        super()._hear(controller, readiness)
        self.seen[controller] = 1 << 60


class ForgetsLosers(Coordinator):
    """What lost the arbitration, or was aborted, is not asked again."""

    def _acknowledged(self, message: Acknowledgement) -> Iterator[Effect]:
        before = set(self.waiting)
        yield from super()._acknowledged(message)
        for group in set(self.waiting) - before:
            del self.waiting[group]


class NeverRepeats(Coordinator):
    """An order that is lost stays lost."""

    def resend(self) -> list[Effect]:
        return [effect for effect in super().resend() if isinstance(effect, Hello)]


class SaysNoHello(Coordinator):
    """After a restart the coordinator waits for reports, which nobody repeats."""

    def resend(self) -> list[Effect]:
        return [effect for effect in super().resend() if not isinstance(effect, Hello)]


class ClosesEarly(Coordinator):
    """A round is closed when the first has acknowledged."""

    def _acknowledged(self, message: Acknowledgement) -> Iterator[Effect]:
        if message.round in self.rounds and self.rounds[message.round].decided:
            self.rounds[message.round].acknowledged.update(self.rounds[message.round].participants[1:])
        yield from super()._acknowledged(message)


# --- Hosts


class SendsBeforeKeeping(Process[Any]):
    """An act that lets out such an effect lets it out at once, and is kept later."""

    kinds: tuple[type, ...] = ()

    def sync(self) -> list[Effect]:
        if not any(isinstance(effect, self.kinds) for act in self.outbox for effect in act.leaving):
            return super().sync()
        early = [effect for act in self.outbox for effect in act.leaving]
        for act in self.outbox:
            act.leaving.clear()
        return early


class DecidesBeforeKeeping(SendsBeforeKeeping):
    """A decision leaves before it is kept."""

    kinds = (Decision,)


class VotesBeforeKeeping(SendsBeforeKeeping):
    """A promise leaves before it is kept."""

    kinds = (Vote,)


class AcknowledgesBeforeKeeping(SendsBeforeKeeping):
    """An order is acknowledged before what it changes is kept."""

    kinds = (Acknowledgement,)


class CommandsBeforeKeeping(SendsBeforeKeeping):
    """A command leaves before it is kept that it does."""

    kinds = (Sending,)


class GoesOnAfterFailedDisk(Process[Any]):
    """A sync that failed is taken for one that did not."""

    def sync(self) -> list[Effect]:
        if self.disk.failing and self.draw.random() < self.disk.failing:
            self.disk.unsynced.clear()
        failing, self.disk.failing = self.disk.failing, 0.0
        try:
            return super().sync()
        finally:
            self.disk.failing = failing


class LetsOutWhatWasDoneMeanwhile(Process[Any]):
    """A sync that is over lets out all that waits, also what was done while it was under way."""

    def sync(self) -> list[Effect]:
        durable = super().sync()
        meanwhile = [effect for act in self.outbox for effect in act.leaving]
        for act in self.outbox:
            act.leaving.clear()
        return [*durable, *meanwhile]


class LetsOutWhatWroteNothing(Process[Any]):
    """What an act says that has written nothing does not wait for the acts before it, whose sync is under way."""

    def sync(self) -> list[Effect]:
        early = [act for act in self.outbox.waiting if not act.writes]
        said = [effect for act in early for effect in act.leaving]
        for act in early:
            act.leaving.clear()
        return [*said, *super().sync()]


class CountsQueuedCommandsAsSent(Process[Any]):
    """What the driver keeps for a line that is down is taken for sent."""

    def hand(self, sending: Sending) -> bool:
        super().hand(sending)
        return True


class KeepsCommandsOverAnEmergencyStop(Process[Any]):
    """What the driver keeps for a line that is down is given to its machine although there was an emergency stop."""

    def make_safe(self) -> None:
        self.is_safe = True


CONTROLLERS: tuple[type[LocalController], ...] = (
    KeepsNoPromise,
    KeepsNoMarking,
    KeepsNoLocalFiring,
    ForgetsClosedRounds,
    KeepsNoCommand,
    NumbersReportsAnew,
    FiresWhileHeld,
    SendsWithoutAsking,
    TakesCommandsForDone,
    NeverSendsAgain,
    BelievesOldSensors,
    TakesStaleCompletions,
    NoLock,
    ReadsUnlocked,
    SignalsUnlocked,
    ForgetsSignals,
    AppliesTwice,
    VotesFromMemory,
    AppliesBlindly,
    ForgetsVotes,
    ReportsOnce,
)
COORDINATORS: tuple[type[Coordinator], ...] = (
    ReusesRounds,
    KeepsNoDecision,
    DropsDecisions,
    LeavesVotesUnanswered,
    DecidesEarly,
    CachedVotes,
    CachedGates,
    CommitsAborted,
    IgnoresPause,
    OldReports,
    ForgetsLosers,
    NeverRepeats,
    SaysNoHello,
    ClosesEarly,
)
PROCESSES: tuple[type[Process[Any]], ...] = (
    DecidesBeforeKeeping,
    VotesBeforeKeeping,
    AcknowledgesBeforeKeeping,
    CommandsBeforeKeeping,
    GoesOnAfterFailedDisk,
    LetsOutWhatWasDoneMeanwhile,
    LetsOutWhatWroteNothing,
    CountsQueuedCommandsAsSent,
    KeepsCommandsOverAnEmergencyStop,
)

PLANTED: dict[str, Machines] = {
    **{each.__name__: Machines(controller=each) for each in CONTROLLERS},
    **{each.__name__: Machines(coordinator=each) for each in COORDINATORS},
    **{each.__name__: Machines(process=each) for each in PROCESSES},
}

PROVOKED_BY: dict[str, tuple[str, ...]] = {
    "KeepsNoLocalFiring": ("crash", "torn"),
    "ForgetsClosedRounds": ("crash", "duplication"),
    "KeepsNoCommand": ("crash",),
    "TakesCommandsForDone": ("crash", "late"),
    "NeverSendsAgain": ("torn",),
    "TakesStaleCompletions": ("stale", "late"),
    "NoLock": ("slow", "delay"),
    "ReadsUnlocked": ("slow", "delay"),
    "CachedVotes": ("duplication", "reordering"),
    "SaysNoHello": ("crash", "stop"),
    "BelievesOldSensors": ("crash", "flapping", "slow"),
    "VotesBeforeKeeping": ("crash", "torn"),
    "AcknowledgesBeforeKeeping": ("crash",),
    "CommandsBeforeKeeping": ("crash", "torn"),
    "GoesOnAfterFailedDisk": ("disk", "crash"),
    "LetsOutWhatWasDoneMeanwhile": ("unsynced", "crash"),
    "LetsOutWhatWroteNothing": ("unsynced", "crash"),
    "CountsQueuedCommandsAsSent": ("queued",),
    "KeepsCommandsOverAnEmergencyStop": ("queued", "emergency"),
}
"""The kinds of faults that bring some of them out soonest; the others, and these too, are found with kinds drawn."""
