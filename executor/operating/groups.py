"""When groups of acts are done, made durable, and let go: by callbacks of the event loop that have no caller.

A callback does one group (`acts.py`) and begins its sync. Where the journal is in memory and no trace is on a disk that
is all, and what leaves is let go at once. Files are written on a thread, and the loop goes on: signals, messages and
the operator are heard, further groups are done, and what they let out waits for the next sync, which begins when this
one is over (`outbox.py`). A stop waits for no disk: it goes to the driver in the call that asks for it.

A driver that has told all that came together has the group done in that call (`do_due`), and a link has, too: a turn of
the loop asks the kernel what else there is.

What a driver says of a command while it is handed over, that its machine has it, is acted upon in the same callback,
and not a turn of the loop later in front of the next signal. That once: a net that fires on it must not keep the loop.

The journal and the trace are written for these callbacks alone, so what fails there ends the run with the machines
stopped, whoever called, and nothing leaves any more. A disk that never answers fails when a stop has waited for it as
long as for anything that hangs: what it was given is as open as after a failed sync. Before a stop it is told of
(`disk_watch.py`).

Rejected: to wait for the disk in the callback. It is the shortest text and, on a disk that answers at once, the
quickest; but one that stands still for a second would keep a stop from the machines for that second.

The last lines of the trace tell what was done when nothing leaves any more, and no group is behind them. They are
written on the thread like all others, and waited for as long as whatever else the end waits for.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

from firable.executor.journal.journal import Storing
from firable.executor.operating.disk_watch import DiskWatch
from firable.executor.operating.uncut import Patience, uncut
from firable.nets.diagnostics import Diagnostic, InputError

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

FIRINGS_AT_ONCE_MAX: Final = 100_000
"""More firings at one instant, or without anything from outside, are a net that runs in circles without its cell."""


def _store(storing: list[Storing]) -> None:
    for one in storing:
        one()


class Groups:
    """The groups of one host."""

    def __init__(self, run: Host) -> None:
        self.run = run
        self.are_due = False
        """Whether a group is done, or about to be."""
        self.turn: asyncio.Handle | None = None
        """In which a group is due, unless it was done before."""
        self.is_working = False
        self.storing: asyncio.Future[None] | None = None
        """The sync that is under way on a thread."""
        self.disk = DiskWatch(run)
        self.is_given_up = False
        """Whether nobody waits for it any more."""

    @property
    def are_over(self) -> bool:
        """Whether none is done or due, and no sync is under way."""
        return not self.are_due and self.storing is None

    def wake(self) -> None:
        """Have a group done in a turn of the loop of its own, unless one is due."""
        if not self.are_due and self._goes_on():
            self.are_due = True
            if self.turn is None:
                self.turn = asyncio.get_running_loop().call_soon(self._in_turn)

    def at_once(self) -> None:
        """Do a group now, unless one is due."""
        if not self.are_due and self._goes_on():
            self.are_due = True
            self._work()

    def do_due(self) -> None:
        """Do now the group that is due in a turn of the loop, if one is."""
        if self.are_due and not self.is_working and self._goes_on():
            self._work()

    def commit(self) -> None:
        """Let go of what leaves once it is durable, unless a sync is under way: then all that was done waits for it."""
        if self.storing is not None:
            return
        if storing := self.run.acts.commit():
            future = asyncio.get_running_loop().run_in_executor(None, _store, storing)
            if not future.done():
                self.storing = future
                self.disk.asked()
                future.add_done_callback(self._stored)
                return
            future.result()
        self.run.acts.stored()
        self.run.leave(self.run.acts.let_go())

    async def end(self, patience: Patience) -> list[str]:
        """Do nothing more, and wait for the sync that is under way; returns what had to be given up."""
        if self.turn is not None:
            self.turn.cancel()
        self.disk.end()
        if self.storing is None:
            return []
        hangs = self.is_given_up or await uncut([self.storing], patience)
        return [self.run.acts.stored_in] if hangs else []

    def give_up(self) -> None:
        """Somebody has wanted the run to end, and has waited long enough for the disk."""
        if self.storing is not None and not self.is_given_up:
            self.is_given_up = True
            message = f"{self.run.acts.stored_in} cannot be written: the disk does not answer"
            hint, code = "look at the machines, then at the disk", "F1017"
            if self.run.acts.stored_in != "the trace":
                hint, code = f"{hint}; what the journal holds, the same command takes up", "F5034"
            self.run.told("fault", f"{message}; {hint}")
            self.run.broken(InputError([Diagnostic(code, message, hint)]))

    async def write_last(self, patience: Patience, *, has_news: bool) -> str:
        """Write the lines of the trace that are left, and what machines have taken, or others said, since the sync.

        `has_news` says that the journal has something else to store. Returns a sentence where that had to be given up.
        Raises `InputError` F1017 or F5034 where it fails.
        """
        self.run.recorder.may_write |= self.run.acquaintances.is_alive
        has_news |= self.run.link is not None or not self.run.dispatch.is_taken_kept
        sync = self.run.journal.sync() if has_news and self.storing is None else None
        if last := [one for one in (sync, self.run.recorder.writing()) if one is not None]:
            storing = asyncio.get_running_loop().run_in_executor(None, _store, last)
            if await uncut([storing], patience):
                return "the last lines of the trace are not written: the disk does not answer"
            storing.result()
        self.run.recorder.written()
        return ""

    def _in_turn(self) -> None:
        self.turn = None
        self.do_due()

    def _work(self) -> None:
        """One group, and its sync; at quiescence, whether the run has ended."""
        run, acts = self.run, self.run.acts
        self.is_working = True
        try:
            self._act()
            if acts.posted and self.storing is None:  # once more, and no oftener
                self._act()
            if acts.firings_at_once > FIRINGS_AT_ONCE_MAX:
                last = acts.fired_at_once[0]
                run.fail(f"'{last}' and others fire without end, and no time passes: no gate ever holds them")
            if run.circling is not None:
                run.circling.end_circle()
            self.are_due = False
            if self.storing is not None:
                if acts.posted and not acts.is_ahead:
                    self.wake()
            elif acts.posted or acts.unsynced:
                self.wake()
            else:
                run.settle()
        except Exception as error:  # a callback has no caller: it must end the run, as an error in a task does
            run.broken(error)
        finally:
            self.is_working = False

    def _goes_on(self) -> bool:
        run, outcome = self.run, self.run.outcome
        return outcome is not None and run.ended is None and not outcome.done()

    def _act(self) -> None:
        if self.storing is None or not self.run.acts.is_ahead:
            self.run.acts.group()
        self.commit()

    def _stored(self, storing: asyncio.Future[None]) -> None:
        """A sync is over: what waited for it leaves, and what was done meanwhile is the next group."""
        self.storing = None
        try:
            storing.result()
            if not self.is_given_up:
                self.run.acts.stored()
            if self.run.outcome is None or self.run.outcome.done():
                return  # ended by an error: nothing leaves any more
            self.run.leave(self.run.acts.let_go())
            self.disk.answered()
            self.at_once()
        except Exception as error:
            self.run.broken(error)
