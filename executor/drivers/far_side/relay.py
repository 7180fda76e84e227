"""A relay in a network line, which can be cut, hold what goes through it, delay it or garble it.

It stands before servers whose own misbehaviour cannot be asked for. What it holds while it is silent goes on when it is
not any more, as the answers of a slow network do: late, and on the old connection. It can hold what goes to the server
by one connection, while others pass.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Any

from firable.executor.drivers.far_side.end import Faults
from firable.executor.drivers.far_side.ports import free_port


class Relay:
    """A port of this host that leads to another one."""

    def __init__(self, faults: Faults, port: int = 0, *, garbles: bool = True) -> None:
        self.faults = faults
        self.garbles = garbles
        self.port = port or free_port()
        self.target = 0
        """The port of this host that it leads to, from when it is opened."""
        self.server: asyncio.Server | None = None
        self.carrying: set[asyncio.Task[None]] = set()
        self.held: set[asyncio.Task[None]] = set()
        """Those of which nothing comes to the server."""
        self.mark = b""
        """What is not to come there, while it is anything."""

    async def open(self) -> None:
        """Take connections."""
        self.server = await asyncio.start_server(self._accepted, "127.0.0.1", self.port)

    async def close(self) -> None:
        """Drop all connections, and take no new ones."""
        if self.server is not None:
            self.server.close()
            self.server = None
        tasks = list(self.carrying)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def hold(self, mark: bytes) -> None:
        """Hold what has these bytes, and all that its connection brings behind it, until `release`."""
        self.mark = mark

    def release(self) -> None:
        """Let it come to the server, also where its connection is gone."""
        self.mark = b""
        self.held.clear()

    def _accepted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.get_running_loop().create_task(self._carried(reader, writer))
        self.carrying.add(task)
        task.add_done_callback(self.carrying.discard)

    async def _carried(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_writer: asyncio.StreamWriter | None = None
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.target)
            there = self._carry(reader, far_writer, asyncio.current_task())
            await asyncio.gather(there, self._carry(far_reader, writer))
        except OSError:
            pass  # the end behind it takes no connection, or has dropped it: so does the relay
        finally:
            for one in (writer, far_writer):
                if one is not None:
                    one.transport.abort()

    async def _carry(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, there: asyncio.Task[Any] | None = None
    ) -> None:
        with suppress(OSError):
            while some := await reader.read(65_536):
                if there is not None and self.mark and self.mark in some:
                    self.held.add(there)
                if self.faults.delay_s:
                    await asyncio.sleep(self.faults.delay_s)
                while self.faults.silent or there in self.held:
                    await asyncio.sleep(0.01)
                if there is None and self.garbles and self.faults.garbage:
                    some = bytes(byte ^ 0x5A for byte in some)
                writer.write(some)
                await writer.drain()
        writer.close()


class RelayedEnd:
    """What drivers reach through a relay, and do not where that is cut."""

    relay: Relay

    @property
    def port(self) -> int:
        """The port at which a driver reaches it."""
        return self.relay.port

    async def cut(self) -> None:
        """Close all connections of drivers, and take no new ones."""
        await self.relay.close()

    async def mend(self) -> None:
        """Take connections again, at the same port."""
        await self.relay.open()
