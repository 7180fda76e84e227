"""Each kind of link with the line between its ends, which a test can cut, mend and disturb."""

import asyncio
import os
import pty
import random
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Protocol

from firable.executor.drivers.far_side.ports import free_port
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Arrival, Greeting, Link, Refusal, known_otherwise
from firable.executor.links.serial_line import MASTER, SerialLink, addresses_on_a_line
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Estranged, Memory, Met, Storage
from firable.executor.links.zenoh_link import ZenohLink
from firable.executor.protocol.messages import Message
from firable.nets.diagnostics import Diagnostic

CONTROLLERS = ("system", "robot", "mc", "conveyor")
PATIENCE_SECONDS = 60.0


@dataclass
class Heard:
    """A listener that keeps what it is told."""

    told: list[tuple[str, str]] = field(default_factory=list)
    messages: list[tuple[str, str, Message]] = field(default_factory=list)
    ages: list[int] = field(default_factory=list)
    """Those of the messages."""
    problems: list[Diagnostic] = field(default_factory=list)
    run_by_two: set[str] = field(default_factory=set)
    waiters: list[asyncio.Future[None]] = field(default_factory=list)
    memory: Memory = field(default_factory=lambda: Memory(Storage(os.urandom(4).hex())))

    age: int = 0

    def arrived_together(self, messages: Sequence[Arrival]) -> None:
        """The same of several."""
        for message in messages:
            self.arrived(*message)

    def arrived(self, sender: str, receiver: str, message: Message, age: int) -> None:
        self.messages.append((sender, receiver, message))
        self.ages.append(age)
        self._wake()

    def connected(self, peer: str, storage: Storage) -> None:
        self.memory = Memory(self.memory.storage, {peer: Met(storage.name), **self.memory.known})
        self.told.append(("connected", peer))
        self._wake()

    def lost(self, peer: str) -> None:
        self.told.append(("lost", peer))
        self._wake()

    def stands(self, peer: str, standing: Standing) -> None:
        self.told.append((standing, peer))
        self._wake()

    def refused(self, peers: Sequence[str], why: Refusal) -> None:
        self.told += [("refused", peer) for peer in peers]
        self.problems.append(why.problem)
        self.run_by_two.update(why.run_by_two)
        self._wake()

    def gone(self, peers: Sequence[str]) -> None:
        self.told += [("gone", peer) for peer in peers]
        self._wake()

    def disowned(self, peers: Sequence[str], why: Estranged) -> None:
        self.told += [("disowned", peer) for peer in peers]
        self.problems.append(known_otherwise(why, peers))
        self._wake()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until something that was told makes the condition true."""
        async with asyncio.timeout(PATIENCE_SECONDS):
            while not condition():
                waiter = asyncio.get_running_loop().create_future()
                self.waiters.append(waiter)
                await waiter

    async def until_told(self, *told: tuple[str, str]) -> None:
        """Wait until all of this was told."""
        await self.until(lambda: set(told) <= set(self.told))

    def _wake(self) -> None:
        for waiter in self.waiters:
            if not waiter.done():
                waiter.set_result(None)
        self.waiters.clear()


@asynccontextmanager
async def running(link: Link, memory: Memory | None = None) -> AsyncIterator[Heard]:
    """A link that runs, and what it tells; with the memory of a host that was there before, or a new one."""
    heard = Heard() if memory is None else Heard(memory=memory)
    task = asyncio.create_task(link.run(heard))
    try:
        yield heard
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


class Rig(Protocol):
    """One kind of link: the host of the coordinator, and others at the end of a line of their own."""

    def link(self, greeting: Greeting) -> Link:
        """A link that is not started yet."""
        ...

    def cut(self) -> None:
        """Nothing gets through to the coordinator any more, nor from it."""
        ...

    def mend(self) -> None:
        """All is as before."""
        ...


class InProcessRig:
    """Links that meet in an exchange."""

    def __init__(self) -> None:
        self.exchange = Exchange()
        self.links: list[InProcessLink] = []

    def link(self, greeting: Greeting) -> Link:
        self.links.append(InProcessLink(self.exchange, greeting))
        return self.links[-1]

    def cut(self) -> None:
        for link in self.links:
            if COORDINATOR in link.greeting.names:
                self.exchange.cut(link)

    def mend(self) -> None:
        for link in self.links:
            if COORDINATOR in link.greeting.names:
                self.exchange.mend(link)


class ZenohRig:
    """Zenoh peers that reach the coordinator through a relay, which can stop to hand on."""

    def __init__(self, port: int, relay_port: int) -> None:
        self.port, self.relay_port = port, relay_port
        self.open = True

    def link(self, greeting: Greeting) -> Link:
        if COORDINATOR in greeting.names:
            return ZenohLink(greeting, listen=[f"tcp/127.0.0.1:{self.port}"], lease_seconds=0.4)
        return ZenohLink(greeting, join=[f"tcp/127.0.0.1:{self.relay_port}"], lease_seconds=0.4)

    def cut(self) -> None:
        self.open = False

    def mend(self) -> None:
        self.open = True

    async def relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        try:
            there = await asyncio.open_connection("127.0.0.1", self.port)
        except OSError:
            writer.close()
            return
        ways = [self._hand_on(reader, there[1]), self._hand_on(there[0], writer)]
        with suppress(OSError):
            await asyncio.gather(*ways)

    async def _hand_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(65_536):
                if self.open:
                    writer.write(data)
        finally:
            writer.close()


@dataclass
class SerialRig:
    """Pseudo-terminals, each end of which hears what any other says, with noise on the way."""

    ports: list[tuple[int, int]] = field(default_factory=list)
    open: bool = True
    dice: random.Random = field(default_factory=lambda: random.Random(1))
    flipped: float = 0.0
    lost: float = 0.0
    doubled: float = 0.0

    def link(self, greeting: Greeting) -> SerialLink:
        addresses = addresses_on_a_line((COORDINATOR,), CONTROLLERS)
        ours, theirs = pty.openpty()
        os.set_blocking(ours, False)
        self.ports.append((ours, theirs))
        asyncio.get_running_loop().add_reader(ours, self._carry, ours)
        own = MASTER if COORDINATOR in greeting.names else min(addresses[name] for name in greeting.names)
        return SerialLink(
            greeting, os.ttyname(theirs), addresses, own, baud=4_000_000, lease_seconds=0.6, answer_seconds=0.03
        )

    def cut(self) -> None:
        self.open = False

    def mend(self) -> None:
        self.open = True

    def close(self) -> None:
        for ours, theirs in self.ports:
            asyncio.get_running_loop().remove_reader(ours)
            os.close(ours)
            os.close(theirs)

    def _carry(self, port: int) -> None:
        data = self._disturbed(os.read(port, 65_536))
        for other, _ in self.ports:
            if other != port and self.open:
                with suppress(BlockingIOError):  # a full buffer of a reader that has gone
                    os.write(other, data)

    def _disturbed(self, data: bytes) -> bytes:
        if not (self.flipped or self.lost or self.doubled):
            return data
        found = bytearray()
        for byte in data:
            if self.dice.random() < self.flipped:
                byte ^= 1 << self.dice.randrange(8)
            if self.dice.random() >= self.lost:
                found += bytes([byte]) * (2 if self.dice.random() < self.doubled else 1)
        return bytes(found)


@asynccontextmanager
async def in_process() -> AsyncIterator[Rig]:
    yield InProcessRig()


@asynccontextmanager
async def over_zenoh() -> AsyncIterator[Rig]:
    rig = ZenohRig(free_port(), free_port())
    server = await asyncio.start_server(rig.relay, "127.0.0.1", rig.relay_port)
    try:
        yield rig
    finally:
        server.close()


@asynccontextmanager
async def over_a_serial_line() -> AsyncIterator[SerialRig]:
    rig = SerialRig()
    try:
        yield rig
    finally:
        rig.close()
