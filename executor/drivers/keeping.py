"""Keeping a device: a connection as long as it lasts, then a new one; the heartbeat; the safe outputs at both ends.

One task reads, one writes. All that is written goes through the one that writes, so that the order is the one that was
meant: safe outputs before anything else on the first connection, then heartbeats and commands, then safe outputs as
the last thing. A command may leave before that task has its turn (`urge`), where it waits for something to write and
the connection can begin a write (`device.Prompt`): the order is the same, and the command a turn of the event loop
earlier. A connection that has failed in any way is closed and never asked again; the next one is made after a pause
that doubles up to a bound, and is read before it is written, because what the device shows then decides what is still
to be sent. The pause is short again when a connection has stood for as long as an answer or a sign of life may take: a
device that can be read and refuses what is written to it would else be connected, and told of, ten times a second.
After an emergency stop it is short also then, as each connection brings the safe outputs. It is as long as a line may
still bring an answer to what was asked before (`device.Owed`). The safe outputs of a stop do not wait for that: no
answer decides anything then. But a line is left only after it, as the driver that follows an emergency stop is the next
to use it.

A stop breaks off a command that is being written, if it is not confirmed at once, and makes new connections until the
device has confirmed the safe outputs, or has had its time. On these, and on each connection after an emergency stop,
the safe outputs are written before anything is read: a device may take a tenth of a second for each answer, and have
ten of them to give. What has not been sent by then is not sent any more: a command may wait behind the very question
whose answer is the reason of the stop, or be sent in steps. A connection that cannot tell what it has sent
(`device.Withholding`) is broken off at once. And where a command was sent that was never confirmed, the safe outputs
are written once more when the time of its answer is over: what an earlier connection still brings must not be the last
thing that a device gets.

A connection alone says nothing of a device that has a sign of life (`alive`): a broker, or the server of a control
whose program stands still, shows what was so once. What is read is held back until that sign has changed on this very
connection, and nothing is commanded; the last value of an earlier one proves nothing, as it may have changed before the
device died, and neither does a server that says that it has no value yet, or none any more. Two things do not wait:
heartbeats, from which many a device makes its sign of life, and the safe outputs with which a run begins or ends, or a
connection that is latched. These are written at once, for the device may be alive, and once more when it is seen to be,
for it may not have been: until then those of the end are not confirmed.

An error that is no failure of a link is a mistake, in a library or in what is served here. It ends the run, and this
device is stopped as any other: over a new connection of which nothing is taken, since what it shows may be what nobody
can deal with.

While the cell runs, the safe outputs are not driven on a *later* connection. What the machines do while the line is
down is for the device's own watchdog, which knows of it in time; a driver that is back after a second would stop a
machine that did its work. After an emergency stop no machine does any work, and a device may have been switched off
and on: until the stop is reset each connection begins with the safe outputs.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Sequence
from contextlib import suppress
from math import inf
from typing import Any, Final, Protocol

from firable.executor.drivers.binding import NUMBER_MAX, DeviceDocument, writes
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import (
    Connection,
    DeviceKind,
    LinkError,
    NoValue,
    Options,
    Owed,
    Point,
    Prompt,
    Value,
    Wanted,
    WithheldError,
    Withholding,
    Writes,
)

BEATS: Final = NUMBER_MAX + 1
"""Heartbeats are numbers from 0, one more each time, and again from 0."""

_CONFIRMED_SECONDS: Final = 0.02
"""A command that the device confirms so soon after the stop leaves its connection good for the safe outputs."""

_FAILURES: Final = (LinkError, OSError, TimeoutError)


async def _failed(error: Exception) -> None:
    raise error


class Served(Protocol):
    """What the connection of a device is for."""

    def read(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Values have come."""
        ...

    def unproven(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Values have come from where the device has not been seen to be alive; they are read when it is."""
        ...

    def ready(self) -> None:
        """A new connection has told what the device shows, which is alive, and may be written to."""
        ...

    def lost(self, why: str) -> None:
        """There is no connection, or none any more."""
        ...

    def next_writes(self) -> Writes | None:
        """What is to be written now, if anything."""
        ...

    def written(self) -> None:
        """The device has confirmed that."""
        ...

    def broken(self, error: Exception) -> None:
        """Something is wrong that is no failure of a link: nothing is served any more, and the device is stopped."""
        ...

    @property
    def is_writing(self) -> bool:
        """Whether something that is to be written has not been confirmed."""
        ...

    @property
    def is_latched(self) -> bool:
        """Whether each connection begins with the safe outputs, and not the first one alone."""
        ...


class Nobody:
    """What a connection is for that is made for the safe outputs alone: for nothing else."""

    is_writing = is_latched = False

    def read(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Take nothing."""

    def unproven(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """Take nothing."""

    def ready(self) -> None:
        """Tell nobody."""

    def lost(self, why: str) -> None:
        """Tell nobody."""

    def next_writes(self) -> Writes | None:
        """Write nothing."""
        return None

    def written(self) -> None:
        """Tell nobody."""

    def broken(self, error: Exception) -> None:
        """Tell nobody."""


class Kept:
    """A device that is kept connected until it is stopped."""

    def __init__(
        self,
        document: DeviceDocument,
        kind: DeviceKind,
        options: Options,
        wanted: Wanted,
        served: Served,
    ) -> None:
        self.document = document
        self.kind = kind
        self.options = options
        self.wanted = wanted
        self.served = served
        self.safe = writes(document.safe)
        self.awake = asyncio.Event()
        self.prompt: Prompt | None = None
        """The connection, where it can begin a write."""
        self.withholding: Withholding | None = None
        """The connection, where it can withhold what it has not sent."""
        self.idle: Prompt | None = None
        """The same, while who writes has nothing to write."""
        self.begun: Coroutine[Any, Any, None] | None = None
        """What was begun on it meanwhile, and who writes is to wait for."""
        self.connections = 0
        """How many connections there have been."""
        self.stood_seconds = 0.0
        """How long the last of them has stood."""
        self.owed_until_seconds = -inf
        """Until when it may still be answered, by the event loop."""
        self.is_connected = False
        self.started = False
        """Whether the safe outputs of the start-up have been written, to a device that is alive."""
        self.is_safe = not self.safe
        """Whether the device has confirmed the safe outputs of the stop, where it has any."""
        self.stopping = False
        self.error: Exception | None = None
        """What ended the serving, and was no failure of a link."""
        self.writing: asyncio.Timeout | None = None
        """Around a command that is being written: a stop breaks it off."""
        self.beating: asyncio.Timeout | None = None
        """Around a heartbeat that is being written."""
        self.has_read = False
        """Whether the device has shown on this connection what it shows."""
        self.late_seconds = -inf
        """Until when a command may come to the device that was sent and never confirmed."""
        self.stopped = asyncio.Event()
        """The safe outputs have been written for the last time, or cannot be."""
        self.beat = 0
        self.is_alive = False
        """Whether the device has changed its sign of life on this connection, where it has one."""
        self.alive_seconds = 0.0
        self.alive_value: Value | None = None
        """What the sign of life is, as far as this connection has shown it."""
        self.held: dict[Point, Value] = {}
        """What this connection has shown before the device was seen to be alive."""

    async def run(self) -> None:
        """Keep the device connected; ends when it is stopped, and safe as far as it can be reached in time.

        Only then it raises what was no failure of a link.
        """
        try:
            try:
                await self._keep()
            except Exception as error:
                self._break(error)
            with suppress(TimeoutError):
                async with asyncio.timeout(2 * self.document.timeout_s):
                    while not self.is_safe:
                        try:
                            await self._connected()
                        except _FAILURES as error:
                            self._lost(error)
                            await asyncio.sleep(self.document.retry_s)
                        except Exception as error:
                            self._break(error)
                            await asyncio.sleep(self.document.retry_s)
            await asyncio.sleep(self._owed_seconds)  # the next to use the line would take it for an answer
        finally:
            self.stopped.set()
        if self.error is not None:
            raise self.error

    def _lost(self, error: Exception) -> None:
        try:
            self.served.lost(str(error) or "no answer in time")
        except Exception as mistake:
            self._break(mistake)

    def _break(self, error: Exception) -> None:
        """Serve nobody any more, and stop; who was served is told in a turn of its own: what fails there is no harm."""
        self.stopping = True
        if self.error is None:
            self.error = error
            served, self.served = self.served, Nobody()
            asyncio.get_running_loop().call_soon(served.broken, error)

    async def _keep(self) -> None:
        pause_s = self.document.retry_s
        alive = self.document.alive
        enough_s = self.document.timeout_s if alive is None else min(alive.within_s, self.document.timeout_s)
        while not self.stopping:
            self.stood_seconds = 0.0
            try:
                await self._connected()
            except _FAILURES as error:
                self.served.lost(str(error) or "no answer in time")
            if self.stood_seconds >= enough_s or (self.stood_seconds and self.served.is_latched):
                pause_s = self.document.retry_s
            with suppress(TimeoutError):
                await asyncio.wait_for(self._asked_to_stop(), max(pause_s, self._owed_seconds))
            pause_s = min(2 * pause_s, self.document.retry_max_s)

    @property
    def _owed_seconds(self) -> float:
        return max(0.0, self.owed_until_seconds - asyncio.get_running_loop().time())

    def stop(self) -> None:
        """Write the safe outputs and nothing afterwards."""
        self.stopping = True
        if self.writing is not None and not self.writing.expired():
            patience_s = 0.0 if self.withholding is None else _CONFIRMED_SECONDS
            self.writing.reschedule(asyncio.get_running_loop().time() + patience_s)
        if self.beating is not None and not self.beating.expired():
            self.beating.reschedule(asyncio.get_running_loop().time() + self.document.timeout_s / 2)
        if self.withholding is not None and (self.writing is not None or self.begun is not None):
            self.withholding.withhold()
        self.awake.set()

    def urge(self) -> None:
        """There is something to be written: it is begun now, where nothing else is under way, or else in its turn."""
        if self.idle is not None and not self.stopping:
            connection, self.idle = self.idle, None
            try:
                if (some := self.served.next_writes()) is not None:
                    self.begun = connection.begin(some)
            except Exception as error:
                self.begun = _failed(error)  # a mistake is dealt with where it would else be made
        self.awake.set()

    async def _asked_to_stop(self) -> None:
        while not self.stopping:
            self.awake.clear()
            await self.awake.wait()

    async def _connected(self) -> None:
        """One connection, from its making to its failure or to the stop."""
        # In this task: one of its own would be left behind by who is cancelled twice, with an error nobody hears of.
        async with asyncio.timeout(2 * self.document.timeout_s):
            connection = await self.kind.connect(self.options, self.wanted)
        before, since_seconds = self.connections, asyncio.get_running_loop().time()
        try:
            self.is_connected = True
            await self._first_of(self._serve(connection), self._watch())
        except _FAILURES as error:
            self.served.lost(str(error) or "no answer in time")  # before the goodbye, which may take its time
            raise
        finally:
            self.is_connected = False
            if self.connections > before:
                self.stood_seconds = asyncio.get_running_loop().time() - since_seconds
            self._forget()
            await connection.close()
            if isinstance(connection, Owed):
                until_seconds = asyncio.get_running_loop().time() + connection.owed_seconds
                self.owed_until_seconds = max(self.owed_until_seconds, until_seconds)

    async def _serve(self, connection: Connection) -> None:
        self.has_read = False
        self.is_alive = self.document.alive is None
        self.alive_value = None
        self.held = {}
        await self._first_of(self._write(connection), self._read(connection))

    async def _until_read(self) -> None:
        """Wait until the device has shown what it shows, or is to be stopped: then nothing of that decides anything."""
        while not self.has_read and not self.stopping:
            self.awake.clear()
            await self.awake.wait()

    async def _first_of(self, *work: Coroutine[Any, Any, None]) -> None:
        """Do several things until one ends or fails."""
        tasks = [asyncio.create_task(one) for one in work]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            await ended(tasks)

    def _take(self, batch: Sequence[tuple[Point, Value]]) -> None:
        was_alive = self.is_alive
        if self.document.alive is not None:
            signs = (value for point, value in batch if point == self.document.alive.read)
            for value in signs:
                if not isinstance(value, NoValue) and value != self.alive_value:
                    self.is_alive |= self.alive_value is not None
                    self.alive_value = value
                    self.alive_seconds = asyncio.get_running_loop().time()
        if was_alive:
            self.served.read(batch)
            return
        self.held.update(batch)
        self.served.unproven(batch)
        if self.is_alive:
            self.served.read(tuple(self.held.items()))
            self.awake.set()

    async def _read(self, connection: Connection) -> None:
        while True:
            self._take(await connection.read())
            if not self.has_read:
                self.has_read = True
                self.awake.set()
            if self.served.is_writing:  # what was read may be what the next command waits for
                self.urge()

    async def _write(self, connection: Connection) -> None:
        if not (self.safe and self.served.is_latched):
            await self._until_read()
        await self._make_safe(connection)
        await self._until_read()
        self.connections += 1
        loop = asyncio.get_running_loop()
        heartbeat = self.document.heartbeat
        due = loop.time()
        is_ready = beaten = False
        while not self.stopping or self.begun is not None:
            self.awake.clear()
            if self.is_alive and not is_ready:
                is_ready = True
                await self._get_ready(connection)
                continue  # it may have been stopped meanwhile
            if self.begun is not None:
                beaten, (begun, self.begun) = False, (self.begun, None)
                if await self._put(begun):
                    self.served.written()
                continue
            is_due = heartbeat is not None and loop.time() >= due
            # They take turns where a device is so slow that there is always a heartbeat to be sent.
            if is_ready and not (is_due and not beaten) and (some := self.served.next_writes()) is not None:
                beaten = False
                if await self._put(connection.write(some)):
                    self.served.written()
            elif is_due and heartbeat is not None:
                beaten, due = True, loop.time() + heartbeat.every_s
                await self._beat(connection, heartbeat.write)
            else:
                timer = None if heartbeat is None else loop.call_later(due - loop.time(), self.awake.set)
                self.idle = self.prompt
                try:
                    await self.awake.wait()
                finally:
                    self.idle = None
                if timer is not None:
                    timer.cancel()
        if self.safe:
            await self._write_last(connection)
        self.is_safe = True
        if self.safe and (late_s := self.late_seconds - loop.time()) > 0:
            await asyncio.sleep(late_s)
            await connection.write(self.safe)

    async def _make_safe(self, connection: Connection) -> None:
        """Write the safe outputs with which the run begins, or each connection of one that is latched."""
        if (not self.started or self.served.is_latched) and not self.stopping:
            was_alive = self.is_alive
            if self.safe:
                await connection.write(self.safe)
            self.started |= was_alive

    async def _write_last(self, connection: Connection) -> None:
        """Write the safe outputs of the stop, once more when a device that has not been seen to be alive is.

        Heartbeats go out meanwhile, as it may make its sign of life from them, and the safe outputs behind each.
        """
        was_alive = self.is_alive
        await connection.write(self.safe)
        if was_alive:
            return
        while not self.is_alive:
            self.awake.clear()
            if (heartbeat := self.document.heartbeat) is None:
                await self.awake.wait()
                continue
            await self._beat(connection, heartbeat.write)
            await connection.write(self.safe)
            with suppress(TimeoutError):
                await asyncio.wait_for(self.awake.wait(), heartbeat.every_s)
        await connection.write(self.safe)

    async def _get_ready(self, connection: Connection) -> None:
        """Let the device be commanded, which has shown what it shows, and that it is alive."""
        if self.document.alive is not None:
            await self._make_safe(connection)
        if not self.stopping:
            self.served.ready()
        self.prompt = connection if isinstance(connection, Prompt) else None
        self.withholding = connection if isinstance(connection, Withholding) else None

    async def _put(self, writing: Coroutine[Any, Any, None]) -> bool:
        """Write, and break it off at a stop, so that no machine starts after it; the connection is of no use then.

        Returns whether it is written: what was not sent before the stop is withheld, and costs no connection.

        Without a task of its own, which would be two more turns of the loop on the way of each command.
        """
        try:
            async with asyncio.timeout(_CONFIRMED_SECONDS if self.stopping else None) as self.writing:
                await writing
            return True
        except WithheldError:
            return False
        except BaseException as error:
            self._doubt()
            if isinstance(error, TimeoutError) and self.stopping:
                raise LinkError("stopped while something was written") from None
            raise
        finally:
            self.writing = None

    async def _beat(self, connection: Connection, point: Point) -> None:
        """Write a heartbeat, which moves nothing: a stop waits for its answer, for a while."""
        try:
            async with asyncio.timeout(self.document.timeout_s / 2 if self.stopping else None) as self.beating:
                await connection.write(((point, self.beat),))
                self.beat = (self.beat + 1) % BEATS
        finally:
            self.beating = None

    def _doubt(self) -> None:
        """A command was sent of which nobody knows whether it has come, or will."""
        self.late_seconds = asyncio.get_running_loop().time() + self.document.timeout_s

    def _forget(self) -> None:
        """The connection is gone, with what was begun on it."""
        self.prompt = self.withholding = None
        if self.begun is not None:
            self.begun.close()
            self.begun = None
            self._doubt()

    async def _watch(self) -> None:
        """End the connection when the device has not changed its sign of life in time."""
        loop = asyncio.get_running_loop()
        alive = self.document.alive
        if alive is None:
            await loop.create_future()
            return
        self.alive_seconds = loop.time()
        while (left_s := self.alive_seconds + alive.within_s - loop.time()) > 0:
            await asyncio.sleep(left_s)
        raise LinkError(f"silent: '{alive.read}' has not changed within {alive.within_s:g} s")
