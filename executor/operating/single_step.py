"""A single step: while a host is paused, one transition fires, and everything stands again.

Local transitions of each controller and the coordinators take turns to be first. Among several hosts a step is of a
transition that this one decides; its coordinator asks the controllers elsewhere, who answer unless they are paused.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from firable.executor.operating.host import Host

VOTES_SECONDS: Final = 2.0
"""So long a step waits for the votes of other hosts."""


async def step(run: Host) -> str | None:
    """While paused, fire one transition; returns its name, or None where none is enabled.

    Whatever else the operator says meanwhile, a stop most of all, ends the step before it fires.
    """
    await run.quiet()
    before = dict(run.recorder.firings)
    names = [*run.coordinators, *run.controllers]
    for name in names[run.turn :] + names[: run.turn]:
        if not run.paused or run.stopping or run.is_over or run.peers.is_unmet:
            return None
        if name in run.controllers:
            run.acts.fire(name)
        else:
            await _commit_one(run, name)
        await run.quiet()
        fired = [t for t, count in run.recorder.firings.items() if count > before[t]]
        if fired:
            run.turn = (names.index(name) + 1) % len(names)
            return fired[0]
    return None


async def _commit_one(run: Host, name: str) -> None:
    coordinator, loop = run.coordinators[name], asyncio.get_running_loop()
    run.acts.act(name, coordinator.permit(1))
    await run.quiet()
    end = loop.time() + VOTES_SECONDS
    while any(not one.decided for one in coordinator.rounds.values()) and loop.time() < end and not run.is_over:
        await asyncio.sleep(0.01)  # votes of other hosts are on their way
    if run.paused:
        run.acts.act(name, coordinator.permit(0))
