"""Whether another program commands a device: nobody else sends its heartbeat.

The hosts of one run know of each other by their link, and share no device (`sharing.py`). A second run of the whole
binding is none of these hosts: it was started twice, or an old computer was switched on again with the script of last
year. Both would command the machines, each would stop those of the other at its start and its end, and the watchdog of
the device would be content with the heartbeat of either. So before a run writes anything it listens for the time of
three beats. A heartbeat that changes twice while nobody here sends it is another program's, and the run does not begin
(F5106): it has written nothing, the safe outputs neither. One change may be the last beat of a process that was killed,
still on its way.

A heartbeat that cannot be read, of a device that has no connection now, says nothing. A run that follows an emergency
stop does not listen: the stop waits for nothing. Two runs that are started in the same second do not hear each other.

Rejected: to look at the heartbeat as long as the run lasts. Of two that notice each other both would stop, and the one
that was there first is the one that should not.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Final

from firable.executor.drivers.binding import Binding
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import LinkError, Use, Value, Wanted
from firable.nets.diagnostics import Diagnostic, InputError

_BEATS: Final = 3
"""So many beats of a heartbeat are waited for its two changes."""


async def demand_alone(binding: Binding) -> None:
    """Raise `InputError` F5106 where another program sends the heartbeat of a device; nothing is written."""
    listening = [asyncio.create_task(_rival(binding, name)) for name in binding.document.devices]
    try:
        found = await asyncio.gather(*listening)
    finally:
        await ended(listening)
    if problems := [problem for problem in found if problem is not None]:
        raise InputError(problems)


async def _rival(binding: Binding, name: str) -> Diagnostic | None:
    """What another program has sent to a device meanwhile, if any does."""
    device, kind = binding.document.devices[name], binding.kinds[name]
    if device.heartbeat is None or kind.point_problem(device.heartbeat.write, Use.READ):
        return None
    point, shown = device.heartbeat.write, dict[Value, None]()
    with suppress(LinkError, OSError, TimeoutError):
        async with asyncio.timeout(2 * device.timeout_s):
            connection = await kind.connect(binding.options[name], Wanted((point,), device.timeout_s))
        try:
            async with asyncio.timeout(min(_BEATS * device.heartbeat.every_s, device.start_s)):
                while len(shown) <= 2:
                    shown |= dict.fromkeys(value for at, value in await connection.read() if at == point)
        finally:
            await connection.close()
    if len(shown) <= 2:
        return None
    message = f"another program sends the heartbeat of '{name}', at '{point}', and commands its machines"
    hint = "this run has not begun, and has written nothing: end that program first, or name the device that is meant"
    return binding.problem("F5106", ("devices", name, "heartbeat", "write"), message, hint)
