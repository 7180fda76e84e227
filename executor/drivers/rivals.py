"""Whether another program commands a device: nobody else sends its heartbeat.

The hosts of one run know of each other by their link, and share no device (`sharing.py`). A second run of the whole
binding is none of these hosts: it was started twice, or an old computer was switched on again with the script of last
year. Both would command the machines, each would stop those of the other at its start and its end, and the watchdog of
the device would be content with the heartbeat of either. So before a run begins, before its journal is opened and
anything is written, it listens for the time of four beats, or of four polls where these take longer. A heartbeat that
changes twice while nobody here sends it is another program's, and the run does not begin (F5106). One change may be the
last beat of a process that was killed, still on its way. Who sends commands by hand (`firable io --send`) listens, too.

What cannot be heard says nothing: a heartbeat that the device does not show or that comes too seldom, and whatever goes
wrong with a connection here, which goes wrong once more in the run and is dealt with there. A line has one program at a
time. Two runs that are started in the same second do not hear each other.

Rejected: to listen when the run has begun. What fires by then is commanded later, all devices wait for the slowest of
them, and an emergency stop with them. Rejected: to look at the heartbeat as long as the run lasts. Of two that notice
each other both would stop, and the one that was there first is the one that should not.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from threading import Thread
from typing import Final, ParamSpec, TypeVar

from firable.executor.drivers.binding import Binding
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import Connection, DeviceKind, Point, Shared, Use, Value, Wanted, as_number
from firable.nets.diagnostics import Diagnostic, InputError

P = ParamSpec("P")
T = TypeVar("T")

BEATS: Final = 4
"""So many beats of a heartbeat are waited for its two changes."""
SECONDS_MIN, SECONDS_MAX = 1.0, 4.0
"""But at least so long, for who beats may be busy, and at most so long, for machines that were left on are to stop."""


class _LeftBehind(ThreadPoolExecutor):
    """Threads that nobody waits for, not even the end of the process: a name server may not answer."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Begin something on a thread of its own."""
        future = Future[T]()

        def work() -> None:
            try:
                result = fn(*args, **kwargs)
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(result)

        future.set_running_or_notify_cancel()  # from now on nobody takes it back
        Thread(target=work, daemon=True).start()
        return future


def listen_first(binding: Binding) -> None:
    """Raise `InputError` F5106 where another program sends the heartbeat of a device, on an event loop of its own."""

    async def listen() -> None:
        asyncio.get_running_loop().set_default_executor(_LeftBehind())
        await demand_alone(binding)

    asyncio.run(listen())


def shows(kind: DeviceKind) -> bool:
    """Whether a program can read there what another one has written."""
    return isinstance(kind, Shared) and kind.shows_writes


async def demand_alone(binding: Binding) -> None:
    """Raise `InputError` F5106 where another program sends the heartbeat of a device; nothing is written."""
    listening = [asyncio.create_task(_rival(binding, name)) for name in binding.document.devices]
    try:
        found = await asyncio.gather(*listening)
    finally:
        await ended(listening)
    if problems := [problem for problem in found if problem is not None]:
        raise InputError(problems)


async def _hears(connection: Connection, point: Point, beats_s: float) -> bool:
    """Whether a point that nobody here writes changes twice in the time of some beats, from number to number."""
    changes, before = 0, None
    with suppress(TimeoutError):
        async with asyncio.timeout(min(max(beats_s, SECONDS_MIN), SECONDS_MAX)):
            while changes < 2:
                for at, value in await connection.read():
                    if at == point and (beat := _beat(value)) is not None:
                        changes += before is not None and beat != before
                        before = beat
    return changes >= 2


def _beat(value: Value) -> int | None:
    """What a point shows of a heartbeat; None for what is none, such as the words of a server that has no value yet."""
    return int(value) if isinstance(value, bool) else as_number(value)


async def _rival(binding: Binding, name: str) -> Diagnostic | None:
    """That another program sends the heartbeat of a device, if one does."""
    device, kind, options = binding.document.devices[name], binding.kinds[name], binding.options[name]
    heartbeat, is_heard = device.heartbeat, False
    if heartbeat is None or not shows(kind):
        return None
    with suppress(Exception):  # what goes wrong the run meets again, and stops its machines in order
        if kind.point_problem(heartbeat.write, Use.READ):
            return None
        async with asyncio.timeout(2 * device.timeout_s):
            connection = await kind.connect(options, Wanted((heartbeat.write,), device.timeout_s))
        try:
            is_heard = await _hears(connection, heartbeat.write, BEATS * max(heartbeat.every_s, options.polled_s))
        finally:
            await connection.close()
    if not is_heard:
        return None
    message = f"another program sends the heartbeat of '{name}', at '{heartbeat.write}', and commands its machines"
    hint = "nothing was begun or written here: find out which of the two is the one that should command them"
    return binding.problem("F5106", ("devices", name, "heartbeat", "write"), message, hint)
