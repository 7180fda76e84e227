"""A driver as others would bring one: points in the memory of this process, told as they change."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Final

from firable.executor.drivers.device import Connection, LinkError, Options, Point, Use, Value, Wanted, Writes
from firable.executor.drivers.far_side.end import Faults


class MemoryOptions(Options):
    """Which memory."""

    memory: str


class MemoryEnd:
    """Points in memory, and the connections to them."""

    def __init__(self, name: str) -> None:
        self.faults = Faults()
        self.values: dict[Point, Value] = {}
        self.connections: list[MemoryConnection] = []
        self.is_cut = True
        self.loop: asyncio.AbstractEventLoop
        self.written: Callable[[Point, Value], None] = lambda _point, _value: None
        MEMORIES[name] = self

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        self.written = written
        self.loop = asyncio.get_running_loop()
        self.is_cut = False

    async def stop(self) -> None:
        await self.cut()

    def show(self, point: Point, value: Value) -> None:
        self.values[point] = value
        for connection in self.connections:
            connection.tell((point, "?" if self.faults.garbage else value))

    async def cut(self) -> None:
        self.is_cut = True
        for connection in self.connections:
            connection.tell(None)
        self.connections.clear()

    async def mend(self) -> None:
        self.is_cut = False


class MemoryConnection:
    """A connection to a memory."""

    def __init__(self, end: MemoryEnd, timeout_s: float) -> None:
        self.end = end
        self.timeout_s = timeout_s
        self.told: asyncio.Queue[tuple[Point, Value] | None] = asyncio.Queue()
        self.loop = asyncio.get_running_loop()
        self.is_first = True

    def tell(self, item: tuple[Point, Value] | None) -> None:
        self.loop.call_soon_threadsafe(self.told.put_nowait, item)

    async def read(self) -> Sequence[tuple[Point, Value]]:
        if self.is_first:
            self.is_first = False
            return list(self.end.values.items())
        batch = [await self.told.get()]
        while not self.told.empty():
            batch.append(self.told.get_nowait())
        if None in batch:
            raise LinkError("the memory is gone")
        return [one for one in batch if one is not None]

    async def write(self, writes: Writes) -> None:
        deadline = asyncio.get_running_loop().time() + self.timeout_s
        await asyncio.sleep(self.end.faults.delay_s)
        while self.end.faults.silent:
            await asyncio.sleep(0.005)
            if asyncio.get_running_loop().time() > deadline:
                raise LinkError("silent")
        if self.end.is_cut:
            raise LinkError("the memory is gone")
        for point, value in writes:
            self.end.loop.call_soon_threadsafe(self.end.written, point, value)

    async def close(self) -> None:
        if self in self.end.connections:
            self.end.connections.remove(self)


class MemoryKind:
    """The kind; every address is one, but those that begin with a question mark."""

    options: type[Options] = MemoryOptions
    through_broker = False

    def point_problem(self, point: Point, use: Use) -> str:
        return f"a question is no point to {use}" if point.startswith("?") else ""

    def load(self) -> None:
        pass  # there is no library

    async def connect(self, options: MemoryOptions, wanted: Wanted) -> Connection:
        end = MEMORIES[options.memory]
        if end.is_cut:
            raise LinkError("there is no memory")
        connection = MemoryConnection(end, wanted.timeout_s)
        end.connections.append(connection)
        return connection


MEMORIES: Final[dict[str, MemoryEnd]] = {}
KIND: Final = MemoryKind()
OTHER: Final = MemoryKind()
