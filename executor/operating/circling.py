"""Whether a run on the simulated cell goes round in a circle: then virtual time would go on for ever and tell nothing.

A place with a time limit that its machine never keeps is tried again and again, and no workpiece gets any further. What
can be told apart of such a run is finite: the marking with its signals, and where everything in the cell is. Workpieces
are told apart too, so one that comes, moves, is machined or leaves is always something new. When many firings on end
have led to nothing that was not there before, more will not. Nothing is concluded as long as something is still to come
that was under way when they began: a workpiece that arrives in an hour, a machine that takes long, another time limit.
Nor before that has happened many times, since firings alone say little: beside a lamp that blinks, a motion of a minute
that is in time once in four has hardly been tried when the lamp has made up the number.

A run in which nothing fires at all has come to rest, though its operator turns a key again and again. It may take
several turns until a door is shut at the same time, so some are waited for.

Rejected: to look for the very same moment, with all times in it. Where machines take now longer and now shorter it
never comes again, and what the machines of the protocol remember would have to be compared as well. Rejected, too: so
many seconds without a workpiece that moves. How long a cell may well wait only its plant file and its time limits know.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from typing import TYPE_CHECKING, Final

from firable.executor.operating import ending, stopping
from firable.nets.verdict import counted
from firable.semantics.joining import APPLIED, STANDS, VOTED
from firable.semantics.trace import Event, Fired, Noted

if TYPE_CHECKING:
    from firable.executor.cell.plant import Plant
    from firable.executor.operating.host import Host

FIRINGS_MAX: Final = 5_000
"""So many firings on end that lead to nothing new are a circle."""
ROUNDS_MAX: Final = 300
"""If meanwhile, so many times, all that was under way has come to its end."""
SWITCHED_MAX: Final = 20
"""So many times each signal that is set from outside again and again may come and go, and nothing fires any more."""
KNOWN_MAX: Final = 100_000
"""So much is remembered of what was there; a circle that is larger is not noticed."""
_TOLD_MAX: Final = 6


class Circling:
    """What a run of a whole cell comes to, firing by firing."""

    def __init__(self, run: Host, cell: Plant) -> None:
        self.run = run
        self.cell = cell
        self.known: set[int] = set()
        """What was there since the last workpiece came or went, by its hash."""
        self.through = (0, 0)
        """How many workpieces had come and gone then."""
        self.again: Counter[str] = Counter()
        """What has fired since the last firing that led to something new."""
        self.since_seconds = 0.0
        self.was_to_come: set[Hashable] = set()
        """What was to come when the round began."""
        self.rounds = 0
        """How many times since then all that was to come has come."""
        again = [one.after_s + one.for_s for one in cell.model.sensors.values() if one.for_s is not None]
        self.hope_seconds = SWITCHED_MAX * max(again, default=0.0)
        """How long what is set from outside again and again is waited for."""
        self.hoped_from_seconds = run.begin_seconds
        """When something fired last, or somebody did what is noted: let the run go on after a pause, above all."""

    @property
    def is_hoped(self) -> bool:
        """Whether what is set from outside again and again may still let something fire; where the work is done, or the
        cycle with which the run is to end, that would be none of it. Nor, at that end, would a lamp that follows it."""
        run = self.run
        if run.is_complete() or (run.draining and ending.is_home(run) and not self.cell.inside):
            return False
        begun_seconds = self.since_seconds if run.draining and self.again else self.hoped_from_seconds
        return run.now_seconds() < begun_seconds + self.hope_seconds

    def seen(self, event: Event) -> None:
        """Take an event of the trace."""
        is_vote = isinstance(event, Noted) and event.note in (VOTED, STANDS, APPLIED)
        if isinstance(event, Fired | Noted) and not is_vote:  # whoever sees a key first may vote at each of its turns
            self.hoped_from_seconds = event.at_seconds
        if not isinstance(event, Fired):
            return
        through = (self.cell.entered, len(self.cell.delivered))
        if through != self.through or len(self.known) >= KNOWN_MAX:
            self.through = through
            self.known.clear()
        now = hash((self.run.recorder.word, self.cell.standing))
        if now not in self.known:
            self.known.add(now)
            self.again.clear()
            return
        if not self.again:
            self.since_seconds, self.was_to_come, self.rounds = event.at_seconds, self._to_come(), 0
        self.again.update(event.transitions)

    def end_circle(self) -> None:
        """End a run that goes round in a circle, unless an operator may change that; by a fault, if work is left."""
        run = self.run
        if not self.again or run.operated or run.served or run.stopping:
            return
        if self.was_to_come.isdisjoint(to_come := self._to_come()):
            self.was_to_come = to_come
            self.rounds += 1
        if self.again.total() < FIRINGS_MAX or self.rounds < ROUNDS_MAX:
            return
        if run.is_complete():
            stopping.end(run, f"all workpieces went through, and now {self._told()}")
        else:
            stopping.fail(run, f"{self._told()}, and brought no workpiece any further")

    def _to_come(self) -> set[Hashable]:
        """What will happen by itself, each by something that it does not share with its like of another time."""
        happenings: set[Hashable] = {number for _, number, _ in self.cell.events}
        # The alarm of a command is behind its time limit, so that it is to come as long as that is.
        return happenings | {(awaited, alarm.when()) for awaited, alarm in self.run.dispatch.timers.items()}

    def _told(self) -> str:
        """The circle in a sentence."""
        seconds = self.run.now_seconds() - self.since_seconds
        names = sorted(self.again, key=self.run.net.transition_index.__getitem__)
        some = names[:_TOLD_MAX] + [f"{len(names) - _TOLD_MAX} more"] * (len(names) > _TOLD_MAX)
        around = " and ".join(filter(None, (", ".join(some[:-1]), some[-1])))
        firings = counted(self.again.total(), "firing")
        return f"the cell goes round in a circle of {around}: {firings} in {seconds:,.0f} s led to nothing new"
