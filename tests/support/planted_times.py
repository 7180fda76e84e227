"""Controllers and timers with a planted fault each: ways to keep a time limit wrongly.

The central net excludes some of them, in whose markings a timer may be set; the others only who looks at the clock.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any, ClassVar

from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Decision, Effect, Sending, Stored, ToController
from firable.executor.protocol.timers import Timers
from firable.executor.protocol.token_player import Compiled, Word
from firable.executor.simulation.process import Process
from firable.executor.simulation.world import Machines
from firable.nets.decomposition import Decomposition


class WithTimers(LocalController):
    """A controller with other timers."""

    kind: ClassVar[type[Timers]] = Timers

    def __init__(self, decomposition: Decomposition, name: str) -> None:
        super().__init__(decomposition, name)
        self.timers = self.kind(self.player)


class GoesOnCounting(WithTimers):
    """The time of a token that has left counts for the next one."""

    class Running(Timers):
        """Times that begin once."""

        def enter(self, place: str) -> None:
            if place not in self.running:
                super().enter(place)

        def over(self, now_seconds: float, word: Word, held: Collection[str] = ()) -> Iterator[str]:
            left = {name: due for name, due in self.running.items() if not self.waits(name, word)}
            yield from super().over(now_seconds, word, held)
            self.running = {**left, **self.running}

    kind = Running


class LooksAtNoCompletion(WithTimers):
    """A time is over though the completion has come."""

    class Blind(Timers):
        """Times of tokens."""

        def waits(self, place: str, word: Word) -> bool:
            return bool(word & self._waits[place][0])

    kind = Blind


class TakesSecondsForMinutes(WithTimers):
    """A limit is over at the sixtieth part of its time."""

    class Hasty(Timers):
        """Times that run fast."""

        def over(self, now_seconds: float, word: Word, held: Collection[str] = ()) -> Iterator[str]:
            yield from super().over(now_seconds * 60, word, held)

    kind = Hasty


class ForgetsOthers(WithTimers):
    """Where one time is over, the others that run are forgotten."""

    class One(Timers):
        """One time."""

        def over(self, now_seconds: float, word: Word, held: Collection[str] = ()) -> Iterator[str]:
            found = list(super().over(now_seconds, word, held))
            if found:
                self.running.clear()
            yield from found

    kind = One


class TimesNothingAnew(WithTimers):
    """After a restart no time begins."""

    class Never(Timers):
        """Times that a restart ends."""

        def begin_anew(self, word: Word) -> None:
            del word

    kind = Never


class TimesTheOutage(WithTimers):
    """After a restart times go on from where the clock begins, also for a controller that is held."""

    class Early(Timers):
        """Times that begin before the operator has resumed."""

        def begin_anew(self, word: Word) -> None:
            self.running = {**{n: self._limit(n) for n in self.places if self.waits(n, word)}, **self.running}

        def _limit(self, place: str) -> float:
            within = self.places[place].within
            return within.milliseconds / 1000 if within is not None else 0.0

    kind = Early

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        super()._restore(kept)
        self.timers.begin_anew(self.word)


class AsksForNoTime(LocalController):
    """The host is never asked to tell the time."""

    def deadline(self, held: Collection[str] = ()) -> float | None:
        del held
        return None

    def tick(self, now_seconds: float, held: Collection[str] = ()) -> list[Effect]:
        return super().tick(now_seconds, held) if self.promises else []


class TimesWhatHasNotLeft(LocalController):
    """The time of a command begins while the disk still holds it back."""

    def tick(self, now_seconds: float, held: Collection[str] = ()) -> list[Effect]:
        del held
        return super().tick(now_seconds)


class WaitsForAllToLeave(LocalController):
    """While the disk holds one command back, the times of the others go on, and none is over."""

    def tick(self, now_seconds: float, held: Collection[str] = ()) -> list[Effect]:
        return [] if self.timers.unbegun(held) else super().tick(now_seconds, held)


class LeavesTimersSet(LocalController):
    """A token enters, and its timer is not cleared."""

    def _fire(self, transition: Compiled) -> list[Effect]:
        timers = sum(self.player.signal_bit(name) for name in self.timers.signals)
        before = self.word & timers
        effects = super()._fire(transition)
        self.word |= before
        return effects


class TakesTimersBlindly(LocalController):
    """A timer that a promise held back is set, whatever has come meanwhile."""

    def _release(self) -> Iterator[Effect]:
        for signal, value in list(self.latched.items()):
            if not self.player.signal_bit(signal) & self._locked_reads():
                del self.latched[signal]
                yield from self._take(signal, self.player.signals[signal], value)


class DropsTimersAtPromises(LocalController):
    """A timer that a promise holds back is lost."""

    def receive(self, message: ToController) -> list[Effect]:
        if isinstance(message, Decision):
            for name in self.timers.signals:
                self.latched.pop(name, None)
        return super().receive(message)


class GivesNothingUp(Process[Any]):
    """What the driver keeps is sent when the line is up, whatever has become of its token."""

    def give_up(self, places: Collection[str]) -> list[Sending]:
        del places
        return []


TIMES: tuple[type[LocalController], ...] = (
    GoesOnCounting,
    LooksAtNoCompletion,
    TakesSecondsForMinutes,
    ForgetsOthers,
    TimesNothingAnew,
    TimesTheOutage,
    AsksForNoTime,
    TimesWhatHasNotLeft,
    WaitsForAllToLeave,
    LeavesTimersSet,
    TakesTimersBlindly,
    DropsTimersAtPromises,
)
PLANTED_TIMES: dict[str, Machines] = {
    **{each.__name__: Machines(controller=each) for each in TIMES},
    GivesNothingUp.__name__: Machines(process=GivesNothingUp),
}
PROVOKED_TIMES: dict[str, tuple[str, ...]] = {
    "TimesNothingAnew": ("crash",),
    "TimesTheOutage": ("crash", "stuck"),
    "GoesOnCounting": ("stuck",),
    "LeavesTimersSet": ("stuck",),
    "ForgetsOthers": ("stuck", "standstill"),
    "GivesNothingUp": ("queued",),
    "TimesWhatHasNotLeft": ("unsynced",),
    "WaitsForAllToLeave": ("unsynced", "stuck", "slow"),
    "TakesTimersBlindly": ("slow", "delay", "late"),
}
"""The kinds of faults that bring some of them out soonest."""
