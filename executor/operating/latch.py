"""After an emergency stop: the process stays, with the safe outputs driven, until a person has reset it.

A life of a host ends by an emergency stop as by any other: what was decided is applied, what was done is durable, the
driver has stopped the machines, the link is closed. Where somebody can reset it, an operator at the terminal or one
who is served from elsewhere, the next life begins at once, *latched*, and by the way of a restart: the machines of the
protocol are made of what the journal holds, and are held (`restart.py`). So there is one way back into the middle of a
run, whether its process has ended or not, and what is proved and rehearsed of it is so of both. The link is there
again, so that nobody elsewhere waits for what was promised here; and the driver is a new one that is latched, too
(`drivers.driver.Latched`): it drives the safe outputs on every connection and watches the contacts.

Three words lead back to a cell that moves, and none is said by a program. The contact is closed, at the button. The
*reset* is refused as long as anything is against it, a contact that is open or a device that does not answer; then the
machines are asked what became of each command, and where they cannot tell, the operator says it. And the run is
*resumed*. What was said beforehand, when the process was started, counts for none of it: a reset must not start a
machine by itself (EN ISO 13850, 4.1.4).

The process ends as before where nobody could reset it; where the end was asked for as well; where something failed
besides: a fault, a driver that hangs. Where a device has not confirmed its safe outputs it stays, and goes on trying.

The journal holds an emergency stop that can be reset until it is, or the process has ended in order. So what follows
one that was killed meanwhile begins latched, too; and where nobody can reset it there, held, whatever was said before.

Rejected: to go on with the machines of the protocol as they are, held anew. It is shorter, and a second way back that
must be right in every marking. Rejected: a fault that latches likewise. A fault is of the program or of a device that
does not do what it should, and a new process is the better answer.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from firable.executor.drivers.driver import Latched
from firable.executor.operating import restart
from firable.executor.operating.recorder import TRACE
from firable.executor.operating.situation import Situation, State
from firable.executor.protocol.messages import Keep

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

LATCHED: Final = "latched"
"""The kind of note of what is to be done before a reset."""
_EMERGENCY: Final = "emergency"
"""Under this the journal has why there was an emergency stop, beside the trace."""
_LOOK_SECONDS: Final = 0.2
"""So often it is looked for what is against a reset."""


@dataclass
class Latch:
    """An emergency stop that nobody has reset."""

    reason: str
    driver: Latched
    unconfirmed: Collection[str] = ()
    """The devices that had not confirmed the safe outputs when the life before ended."""
    was_reset: asyncio.Event = field(default_factory=asyncio.Event)


def keep(run: Host, reason: str | None) -> bool:
    """Have the journal hold that there was an emergency stop, or with None that there is none; whether that is news."""
    is_news = run.journal.kept(TRACE).get(_EMERGENCY) != reason
    if is_news:
        run.journal.write(TRACE, [Keep(_EMERGENCY, reason)])
    return is_news


def go_on(run: Host) -> None:
    """Begin as the process before has left it, if that was killed after an emergency stop and before the reset."""
    reason = run.journal.kept(TRACE).get(_EMERGENCY)
    if reason is None:
        return
    run.said = {}
    if run.latched is not None and (run.served or run.operated):
        run.driver = driver = run.latched()
        run.latch = Latch(str(reason), driver, tuple(driver.undriven))
    else:
        run.tell_operator(LATCHED, f"emergency stop: {reason}; it was not reset before the process was killed")
    run.begin(resume=False)


def may_stay(run: Host) -> bool:
    """Whether a host that has been stopped goes on latched, as far as it is known before its driver has ended."""
    somebody = run.served or run.operated
    is_wanted = run.emergency is not None and not run.fault and not run.is_to_end
    return is_wanted and somebody and run.latched is not None


def stays(run: Host, driver: asyncio.Task[None]) -> bool:
    """Whether it does, once all of it has ended."""
    own = asyncio.current_task()
    if own is not None and own.cancelling():  # Ctrl-C, while the safe outputs were driven
        return False
    has_failed = driver.done() and not driver.cancelled() and driver.exception() is not None
    return may_stay(run) and not has_failed


def reset(run: Host) -> tuple[str, ...]:
    """End the latch, so that the machines are asked what became of their commands; returns what is against it."""
    if run.latch is None:
        return ("there is no emergency stop to be reset",)
    if run.stopping:
        return ("the run is ending",)
    if against := tuple(run.latch.driver.against()):
        run.note("not reset", message="; ".join(against))
        return against
    run.latch.driver.release()
    run.latch.was_reset.set()
    run.latch = None
    run.emergency = None
    keep(run, None)
    run.note("reset")
    return ()


async def take_up(run: Host, found: restart.TakingUp) -> None:
    """Wait until the latch is reset, if there is one, and tell of what is against it; then as after a restart."""
    said = ""
    while (latch := run.latch) is not None:
        if (now := told(run)) != said:
            said = now
            run.told(LATCHED, said)
        with suppress(TimeoutError):
            await asyncio.wait_for(latch.was_reset.wait(), _LOOK_SECONDS)
    await restart.take_up(run, found)


def told(run: Host) -> str:
    """The latch in words, and what there is to do."""
    if run.latch is None:
        return ""
    against = "; ".join(run.latch.driver.against())
    todo = (
        f"before it can be reset: {against}" if against else "it can be reset; then nothing moves until it is resumed"
    )
    open_ = [name for name in run.latch.unconfirmed if name in run.latch.driver.undriven]
    return f"emergency stop: {run.latch.reason}; {unconfirmed(open_) or 'the machines are held safe'}; {todo}"


def unconfirmed(devices: Collection[str]) -> str:
    """That these devices have not confirmed the safe outputs, in words; nothing where there are none."""
    have = "have" if len(devices) > 1 else "has"
    told = f"{' and '.join(devices)} {have} not confirmed the safe outputs: look at the machines, they may not be safe"
    return told if devices else ""


def situation(run: Host) -> Situation:
    """What a latched host is doing."""
    others = [sentence for sentence in run.peers.waits() if "is held" not in sentence]
    sentences = filter(None, (told(run), *run.peers.absent(), *others))
    return Situation(State.LATCHED, run.marking, (), "; ".join(sentences), is_emergency=True)
