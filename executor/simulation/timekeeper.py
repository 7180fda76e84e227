"""The times of one controller, kept a second time: when a timer may be set, and when it must be.

The reference player knows no times: it says in which markings a timer may be set, not after how long. So each
controller's own clock is looked at here, with the tokens and signals of its image before and after each act:

- a timer is set only where the token has stood for its whole limit by that clock, from its entry or, after a restart,
  from when the operator resumed, and where its command has been out of the process as long: no machine is accused of a
  command that it has not had. A token of the initial marking has no time, and a controller that is held times none;
- a token enters with its timer cleared;
- when the controller has been told the time, each timer whose limit has gone by since it was first told after its
  command had left is set, or waits behind a promise, unless the completion has come; whatever else has not left.

How soon the controller is told the time after `deadline` is its host's affair. Nothing here is shared with `timers`,
which is what is judged: that one counts down, this one remembers when tokens have come.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from firable.executor.protocol.controller import LocalController
from firable.nets.net import Net, Place

_RESOLUTION_SECONDS = 1e-5


class TimeLimitError(AssertionError):
    """A time limit is not kept."""


@dataclass(frozen=True, slots=True)
class Limited:
    """A place with a time limit: its bits in the word of its controller."""

    place: str
    seconds: float
    timer: str
    completion: str
    token: int
    completed: int
    over: int


def limited(subnet: Net) -> tuple[Limited, ...]:
    """The places of a subnet that have a time limit."""

    def bit(signal: str | None) -> int:
        return 0 if signal is None else 1 << len(subnet.places) + subnet.signal_index[signal]

    def of(place: Place) -> Iterator[Limited]:
        if (within := place.within) is not None:
            token, done, over = 1 << subnet.place_index[place.name], bit(place.completion), bit(within.timer)
            completion = place.completion or ""
            yield Limited(place.name, within.seconds, within.timer, completion, token, done, over)

    return tuple(each for place in subnet.places for each in of(place))


class Timekeeper:
    """The times of one controller, over all its restarts."""

    def __init__(self, places: tuple[Limited, ...]) -> None:
        self.places = places
        self.machine: LocalController | None = None
        self.word = 0
        self.held = False
        self.entered: dict[str, float] = {}
        """When the token of each place that is timed has come, its controller was resumed, or its command held back."""
        self.told: dict[str, float] = {}
        """When the controller was first told the time after that."""

    def acted(self, machine: LocalController, now_seconds: float, held: Collection[str]) -> None:
        """See what an act has changed; the commands of the places `held` have not left. Raises `TimeLimitError`."""
        if machine is not self.machine:
            self.machine, self.word, self.held = machine, machine.word, machine.held
            self.entered.clear()
            self.told.clear()
        before, self.word = self.word, machine.word
        resumed, self.held = self.held and not machine.held, machine.held
        for each in self.places:
            enters = self.word & each.token and not before & each.token
            if not self.word & each.token or enters:
                self.entered.pop(each.place, None)
                self.told.pop(each.place, None)
            if enters and self.word & each.over:
                raise TimeLimitError(f"'{each.place}' is entered, and '{each.timer}' is set")
            was_sent = machine.commands.entry(each.completion) > 0
            if not machine.held and (enters or (resumed and was_sent and self._waits(each))):
                self.entered[each.place] = now_seconds
            if each.place in held and each.place in self.entered:
                self.entered[each.place] = now_seconds
            if self.word & each.over and not before & each.over:
                self._check_over(each, now_seconds)

    def ticked(self, machine: LocalController, now_seconds: float, held: Collection[str]) -> None:
        """Check what a controller has made of the time that it was just told; raises `TimeLimitError`."""
        for each in self.places:
            if each.place in self.entered and each.place not in held and self._waits(each):
                told = self.told.setdefault(each.place, now_seconds)
                is_over = now_seconds >= told + each.seconds + _RESOLUTION_SECONDS
                if is_over and not self.word & each.over and each.timer not in machine.latched:
                    waited = f"{now_seconds - told:.3f} s after it was first told the time"
                    raise TimeLimitError(f"'{each.timer}' is not set {waited}, and {each.seconds:g} s is the limit")

    def unset(self) -> tuple[str, ...]:
        """The timers that are not set, although their place is timed and the completion has not come."""
        timed = (each for each in self.places if each.place in self.entered and self._waits(each))
        return tuple(each.timer for each in timed if not self.word & each.over)

    def _waits(self, each: Limited) -> bool:
        return bool(self.word & each.token) and not self.word & each.completed

    def _check_over(self, each: Limited, now_seconds: float) -> None:
        since = self.entered.get(each.place)
        if since is None:
            raise TimeLimitError(f"'{each.timer}' is set, and no time of '{each.place}' has begun")
        if now_seconds - since < each.seconds - _RESOLUTION_SECONDS:
            raise TimeLimitError(f"'{each.timer}' is set {now_seconds - since:.3f} s after '{each.place}' was sent")
