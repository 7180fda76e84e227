"""The ways to stop a host: at once, at the end of the cycle, in an emergency, by a fault.

*Stop*: no further firing, ever, and no command; the controllers take their votes back, and the host waits, for a
while, until what was decided is applied and acknowledged, and each coordinator that can be reached has said that no
order is open, so that hosts may be stopped in any order; then the driver drives the safe outputs, which stop every
machine where it is. Where all machines are here it takes no time. *Stop at the end of the cycle*: no new work comes
in, and the run ends when the cell is at rest; a host among others takes its votes back when it is at rest, and goes on
if an order comes before the word that none is open. *Emergency stop*: the safe outputs first, before anything is
written or said, and whatever has become of coordinator and link; what was decided is applied all the same, so that
nobody waits for it, and its commands are asked after at the restart, or at the reset (`latch.py`). A *fault* of the
driver, or a command that is overdue, does the same by itself, and is not reset.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from firable.executor.operating import ending, latch

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

SETTLE_SECONDS: Final = 2.0
"""So long a stop waits for what is open at the most."""


def stop(run: Host, *, at_end_of_cycle: bool = False) -> bool:
    """End the run: now, with every machine stopped where it is, or when the work in the cell is done.

    Not with the cycle where it is latched or stopping, and no cycle goes on: nothing of that is kept for afterwards.
    """
    if at_end_of_cycle:
        if run.stopping or run.latch is not None:
            return False
        run.draining = True
        run.note("stopping at the end of the cycle")
        if not run.driver.close():
            run.acts.forgo(ending.beginnings(run.net))
            run.ends_at_home = True
        return True
    run.is_to_end = True
    if not run.stopping:
        if run.is_whole and run.groups.storing is not None:
            run.make_safe()  # at the end of the run otherwise, which follows at once
        run.ended_by = run.ended_by or ("stopped by the operator" if run.is_whole else "")
        _end_soon(run, "stopped by the operator")
    return True


def emergency_stop(run: Host, reason: str) -> None:
    """Drive the safe outputs at once, before anything is written or said; it can be reset, or the run ends."""
    run.make_safe()
    run.emergency = reason
    if latch.may_stay(run):
        latch.keep(run, reason)
    run.peers.meeting.set()  # a driver that has waited for others waits no longer
    _end_soon(run, "emergency stop", reason=reason)


def fail(run: Host, message: str) -> None:
    """End the run by a fault, with the machines stopped where they are."""
    if not run.fault:
        run.fault = message
        run.make_safe()
        _end_soon(run, "fault", message=message)
        run.tell_operator("fault", message)


def end(run: Host, message: str) -> None:
    """End a run that would not end by itself, with its machines stopped where they are, for this reason."""
    run.ended_by = message
    _end_soon(run, "stopped", message=message)


def halt(run: Host, note: str, **data: str) -> None:
    """Let nothing fire by itself any more, and have the trace say why."""
    run.paused = run.acts.halted = True  # first, so that nothing fires whatever happens to the trace
    run.note(note, **data)
    run.acts.permit(0)


def ends_cycle(run: Host) -> bool:
    """Whether there is nothing more to be done before the cycle is at its end; then its end is begun."""
    if not ending.is_home(run):
        if run.acts.is_leaving:
            run.acts.stay()  # an order has come on a vote that stood
        return False
    if not run.is_whole and not run.acts.is_leaving:
        run.acts.leave()
    elif run.is_whole or run.peers.have_let_go:
        run.ended_by = ending.AT_THE_END if run.is_whole else ""
        _end_soon(run, ending.AT_THE_END, **({} if run.is_whole else {"message": ending.alone(run)}))
    return True


def _end_soon(run: Host, note: str, **data: str) -> None:
    """End when nothing is open, or after a while."""
    run.stopping = True
    halt(run, note, **data)
    if not run.is_whole:
        run.acts.leave()
    if run.clock is not None:
        if not run.is_whole:
            run.waiting.append(run.clock.loop.call_later(SETTLE_SECONDS, _wait_no_longer, run))
        run.waiting.append(run.clock.loop.call_later(run.patience.seconds, run.groups.give_up))


def _wait_no_longer(run: Host) -> None:
    run.has_waited = True
    if run.groups.storing is not None:
        run.make_safe()
    run.groups.wake()
