"""A race of techniques: several look for one answer at the same time, and the first sound one ends the others.

No technique is best for all nets: a decision diagram holds 10^50 markings of one net and chokes on a thousand of
another, induction proves at once what exploration never ends, and a random walk finds what no proof can. So they run
side by side, in lanes: each lane is a thread that tries its techniques one after the other, each for a slice of time,
then all of them again for longer slices. The long work of each releases the interpreter, so lanes use the cores.

The rejected alternative, choosing a technique by the looks of the net, needs no cores and is wrong on every tenth net.

An answer of which nobody can tell how it was found is worth nothing: an outcome tells how each technique ended.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Event, Lock, Thread
from time import monotonic
from typing import Final, Generic, TypeVar

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits

T = TypeVar("T")

SLICES_SECONDS: Final = (2.0, 10.0, 60.0)
"""How long each technique may try in each round of its lane."""
_GROWTH: Final = 4.0
"""How much longer a slice is than the one before it where the time is short: only the last takes all that is left."""
_TURN_SECONDS: Final = 0.1
_CANCELLED: Final = "cancelled"
"""What the engine says where it was ended from outside, mostly because another technique was first: no giving up."""
_START_SECONDS: Final = 1.0


@dataclass(frozen=True, slots=True)
class Contestant(Generic[T]):
    """A technique in a race: its name, and the work within limits, which gives None or an answer."""

    name: str
    run: Callable[[Limits], T | None]


@dataclass(frozen=True, slots=True)
class Outcome(Generic[T]):
    """The first answer (None: nobody found one), who found it, and in words how the others ended.

    `interrupted` says that Ctrl-C ended the race.
    """

    answer: T | None
    winner: str
    told: tuple[str, ...]
    interrupted: bool = False


def race(
    lanes: Sequence[Sequence[Contestant[T]]], limits: Limits, slices_seconds: Sequence[float] | None = SLICES_SECONDS
) -> Outcome[T]:
    """Run the lanes side by side until one technique has an answer, all have given up, or the limits are reached.

    With `slices_seconds` None each technique runs once, for as long as the limits allow. The memory is shared out
    evenly among the lanes. Ctrl-C ends the race, and so does what a technique raises that is no exhausted budget, which
    comes out.
    """
    course, lanes = _Course[T](Event(), Lock()), [lane for lane in lanes if lane]
    share = replace(limits, memory_bytes=max(1, limits.memory_bytes // max(1, len(lanes))))
    ends = [Event() for _ in lanes]
    threads = [
        Thread(target=course.go, args=(lane, share, slices_seconds, end), daemon=True)
        for lane, end in zip(lanes, ends, strict=True)
    ]
    begun: list[Thread] = []
    interrupted = False
    try:
        for thread in threads:
            begun.append(thread)
            thread.start()
        # Not by `join`: Ctrl-C in the midst of it has a thread that runs on taken for one that has ended (bpo-45274).
        for end in ends:
            while not end.wait(_TURN_SECONDS):
                if limits.deadline.over:
                    course.over.set()
    except KeyboardInterrupt:
        interrupted = True
    finally:
        course.over.set()
        for thread, end in zip(begun, ends, strict=False):
            if thread.ident is None:
                end.wait(_START_SECONDS)  # Ctrl-C came while it was started, which it may have been
            if thread.ident is not None:
                end.wait()
    if course.failure is not None:
        raise course.failure
    return Outcome(course.answer, course.winner, tuple(course.told), interrupted)


class _Course(Generic[T]):
    """What the lanes of one race share."""

    def __init__(self, over: Event, lock: Lock) -> None:
        self.over = over
        self.lock = lock
        self.answer: T | None = None
        self.winner = ""
        self.failure: BaseException | None = None
        self.told: list[str] = []

    def go(
        self, lane: Sequence[Contestant[T]], limits: Limits, slices_seconds: Sequence[float] | None, end: Event
    ) -> None:
        """One lane, which sets `end` at its end."""
        try:
            self._go(lane, limits, slices_seconds)
        finally:
            end.set()

    def _go(self, lane: Sequence[Contestant[T]], limits: Limits, slices_seconds: Sequence[float] | None) -> None:
        """Its techniques in turn, in slices that grow; one that gives up early is not asked again."""
        waiting, left = list(lane), limits.deadline.left_seconds
        slices = slices_seconds or (None,)
        for later, seconds in zip(range(len(slices) - 1, -1, -1), slices, strict=True):
            longest = seconds if left is None or seconds is None else min(seconds, left * _GROWTH**-later)
            for contestant in list(waiting):
                if self.over.is_set() or limits.deadline.over:
                    return
                until = self._until(limits.deadline, longest)
                gave_up = self._try(contestant, replace(limits, deadline=until))
                if gave_up and not until.over:
                    waiting.remove(contestant)

    def _until(self, deadline: Deadline, seconds: float | None) -> Deadline:
        until = deadline if seconds is None else deadline.within(seconds)
        return replace(until, cancelled=self.over)

    def _try(self, contestant: Contestant[T], limits: Limits) -> bool:
        """Let one technique try; whether it gave up."""
        began = monotonic()
        try:
            answer = contestant.run(limits)
        except (BudgetExceeded, IncompleteGraph) as error:
            ended = "was ended" if self.answer is None else "was no longer needed"
            self._tell(f"{contestant.name} {ended if str(error) == _CANCELLED else f'gave up: {error}'}")
            return True
        except BaseException as error:
            with self.lock:
                self.failure = self.failure or error
            self.over.set()
            return True
        with self.lock:
            if answer is not None and self.answer is None and self.failure is None:
                self.answer, self.winner = answer, contestant.name
                self.over.set()
                return False
        lost = "was too late" if answer is not None else "was ended" if self.over.is_set() else "found no answer"
        self._tell(f"{contestant.name} {lost} after {monotonic() - began:.1f} s")
        return True

    def _tell(self, line: str) -> None:
        with self.lock:
            self.told.append(line)
