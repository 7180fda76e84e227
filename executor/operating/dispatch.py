"""Commands on their way between a host and its driver: handed over, taken, overdue, given up.

A net cannot tell a slow machine from a dead one; only time does. So a command that is not over in time is a fault: one
with a completion is over when that has come, one without when its machine has taken it. A place with `within` says in
the net what follows when its time is over (`time_limits.py`). There the alarm is for when that does not follow, as
where a promise keeps what the timeout would change: its time begins when that of the place is over.

That a machine has taken a command outlives this process: one that was switched off and on since shows that it has never
had it, and is not believed (`was_taken`). It may have done it by halves, and would do it twice.

When a token leaves a place before its command was over, what has not reached the machine is given up: no machine moves
by it when its line is back.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.driver import withdraw
from firable.executor.journal.journal import Journal
from firable.executor.operating.items import CommandTaken
from firable.executor.protocol.messages import Keep
from firable.nets.net import Net, Place

if TYPE_CHECKING:
    from firable.executor.operating.host import Host


TAKEN: Final = "\ntaken"
"""The name under which the journal keeps the number of the command that was taken last, by its place."""


def was_taken(journal: Journal, place: str, entry: int) -> bool:
    """Whether a machine has taken this command of a place, in this life of the host or one before."""
    return journal.kept(TAKEN).get(place) == entry


class Dispatch:
    """The commands of one host."""

    def __init__(self, run: Host, overdue_seconds: float) -> None:
        self.run = run
        self.overdue_seconds = overdue_seconds
        self.timers: dict[str, asyncio.TimerHandle] = {}
        """The alarm of each command that is awaited, by its completion or, without one, its place."""
        self.is_taken_kept = True
        """Whether what was taken is stored: what a machine says while it is stopped is behind the last group."""
        self.untaken: set[str] = set()
        """The places whose command has no completion, and is with the driver."""
        self.left_behind = _left_behind(run.net)

    def send(self, place: str, entry: int) -> None:
        """Hand the command of a place to the driver."""
        run = self.run
        sender = run.net.place(place)
        if sender.completion is not None:
            self.watch(place, entry)
            run.driver.send(sender, entry)
            return
        self.untaken.add(place)
        run.driver.send(sender, entry)
        if place in self.untaken:  # it waits for a line
            self.watch(place, entry)

    def taken(self, place: str, entry: int) -> None:
        """A machine has the command of a place; a token without completion has waited for that."""
        sender = self.run.net.place(place)
        if sender.completion is not None:
            self.keep_taken(place, entry)
        else:
            self.untaken.discard(place)
            self.over(place)
            self.run.acts.hear(str(sender.owner), CommandTaken(place, entry))

    def keep_taken(self, place: str, entry: int | None) -> None:
        """Have the journal keep that a machine has this command of a place, or by None that it has none."""
        self.run.journal.write(TAKEN, [Keep(place, entry)])
        self.is_taken_kept = False
        self.run.acts.have_kept(self._taken_kept)

    def _taken_kept(self) -> None:
        self.is_taken_kept = True

    def left(self, controller: str, transition: str) -> None:
        """Give up what the tokens of a controller have left behind."""
        places = self.left_behind.get((controller, transition))
        if places:
            for name in withdraw(self.run.driver, places, self.run.acts.outbox):
                self.run.recorder.note(self.run.now_seconds(), "withdrawn", place=name)
            for place in places:
                if place.within is not None:
                    self.over(str(place.completion))

    def watch(self, place: str, entry: int) -> None:
        """Await the end of a place's command from now on."""
        sender, clock = self.run.net.place(place), self.run.clock
        if clock is not None:
            awaited = sender.completion or place
            self.over(awaited)
            limit = 0.0 if sender.within is None else sender.within.seconds
            delay = (limit + self.overdue_seconds) / clock.speed
            self.timers[awaited] = clock.loop.call_later(delay, self._overdue, place, entry, clock.now_seconds())

    def over(self, awaited: str) -> None:
        """Await a completion, or the command of a place, no more."""
        if (timer := self.timers.pop(awaited, None)) is not None:
            timer.cancel()

    def end(self) -> None:
        """Await nothing."""
        for timer in self.timers.values():
            timer.cancel()

    def _overdue(self, place: str, entry: int, sent_at: float) -> None:
        sender = self.run.net.place(place)
        owner = self.run.controllers[str(sender.owner)]
        # What follows a time limit does when it is over; and that begins anew when a run that is held is resumed.
        if sender.within is not None and (self.run.paused or owner.held or place in owner.timers.running):
            self.watch(place, entry)
            return
        self.timers.pop(sender.completion or place, None)
        awaited = "its machine has not shown that it took it"
        if sender.completion is not None:
            taken = "it counts as taken" if was_taken(self.run.journal, place, entry) else awaited
            awaited = f"{taken}, and '{sender.completion}' has not come"
        if sender.within is None:
            late = f"{awaited} within {self.overdue_seconds:g} s"
        else:
            limit = f"{sender.within.seconds:g} s"
            late = f"{awaited} within its {limit}, nor its timeout in {self.overdue_seconds:g} s more"
        self.run.fail(f"'{sender.command}' of '{place}', sent at {sent_at:.1f} s, is overdue: {late}")


def _left_behind(net: Net) -> dict[tuple[str, str], list[Place]]:
    """The places whose command a firing leaves behind, by their controller and the transition, where there are any.

    A token whose command has no completion stays until its machine has it: nothing is given up with it.
    """
    commanding = {
        place.name: place for place in net.places if place.command is not None and place.completion is not None
    }
    found: dict[tuple[str, str], list[Place]] = {}
    for transition in net.transitions:
        for place in filter(None, map(commanding.get, transition.inputs)):
            found.setdefault((str(place.owner), transition.name), []).append(place)
    return found
