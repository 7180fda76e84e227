"""A single step: while a host is paused, one transition fires, and everything stands again.

Local transitions of each controller and the coordinators take turns to be first. Among several hosts a step is of a
transition that this one decides; its coordinator asks the controllers elsewhere, who answer unless they are paused. It
asks when they have said what the last decision came to, so a step that follows at once finds what that has enabled.
Of two operators who step at once each has a step of his own.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

VOTES_SECONDS: Final = 2.0
"""So long a step waits for other hosts: for what the last decision came to, and for the votes of each coordinator."""


async def step(run: Host) -> str | None:
    """While paused, fire one transition; returns its name, or None where none is enabled.

    Whatever else the operator says meanwhile, a stop most of all, or again to pause, ends the step before it fires.
    """
    pauses = run.pauses
    async with run.stepping:
        await run.quiet()
        # What any coordinator has decided may enable what another one decides.
        await _heard(run, pauses, lambda: all(one.idle for one in run.coordinators.values()))
        before = dict(run.recorder.firings)
        names = [*run.coordinators, *run.controllers]
        for name in names[run.turn :] + names[: run.turn]:
            if not _may_step(run, pauses):
                return None
            if name in run.controllers:
                run.acts.fire(name)
            else:
                await _commit_one(run, name, pauses)
            await run.quiet()
            fired = [t for t, count in run.recorder.firings.items() if count > before[t]]
            if fired:
                run.turn = (names.index(name) + 1) % len(names)
                return fired[0]
        return None


def _may_step(run: Host, pauses: int) -> bool:
    """Whether a step may go on that was asked for when somebody had paused the run so often."""
    return run.paused and run.pauses == pauses and not (run.stopping or run.is_over or run.peers.is_unmet)


async def _commit_one(run: Host, name: str, pauses: int) -> None:
    coordinator = run.coordinators[name]
    run.acts.act(name, coordinator.permit(1))
    try:
        await run.quiet()
        await _heard(run, pauses, lambda: all(one.decided for one in coordinator.rounds.values()))
    finally:
        if run.paused and not run.is_over:
            run.acts.act(name, coordinator.permit(0))


async def _heard(run: Host, pauses: int, is_so: Callable[[], bool]) -> None:
    """Wait for what other hosts have to say: it is on its way."""
    loop = asyncio.get_running_loop()
    end = loop.time() + VOTES_SECONDS
    while _may_step(run, pauses) and not is_so() and loop.time() < end:
        await asyncio.sleep(0.01)
