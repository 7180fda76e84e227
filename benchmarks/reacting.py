"""How long it takes from a change of a signal to the command that follows from it.

The net is the smallest that reacts: a token goes from one place to another when a signal comes, and back when it goes,
and each place sends a command. It is measured three ways, each beside the least that does the same, in turn with it:

- over a socket of loopback: a plant, in a process of its own, sends a byte and waits for one. The yardstick is an echo
  server of asyncio; with the executor, the byte is a signal of the net and the answer its command;
- within the process: the driver changes the signal and waits for the command. The yardstick is an echo between two
  tasks of asyncio by queues, in which no byte is moved and the kernel is not asked: a harder one than the socket;
- over Modbus TCP: the plant is a server of pymodbus in a process of its own, which takes the time from what it shows
  to what it is written. The yardstick is a loop that polls by pymodbus and writes when it sees a change, at the same
  pace: as fast as the answers come, and each millisecond, where both wait for the poll most of the time.

Two rows beside them show where the time goes. The controller alone is the pure machine of the protocol, called in a
loop of Python: what it takes stands in every reaction, whatever host is around it. And what is measured in the process
is measured once more with pauses of some milliseconds, as between two changes at a machine: then code and data of the
reaction are in no cache any more, which is what a reaction over Modbus meets.

Times are by the clock, because reacting is waiting. The noise floor is the yardstick against itself, measured in turn
with the rest, and no difference below it means anything.

    python benchmarks/reacting.py echo PORT COUNT      a plant at a socket
    python benchmarks/reacting.py modbus COUNT         a plant as a Modbus server; it prints its port first
"""

from __future__ import annotations

import asyncio
import json
import random
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from statistics import median, quantiles
from typing import Final

from measuring import Table, against

from firable.decompose.splitting.cut import split
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import Point, Value
from firable.executor.drivers.driver import Answer, Clock, Driver, Listener, Reading
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Sending
from firable.nets.net import Place
from firable.nets.text import parse_net

REACTIONS: Final = 2_000
OVER_MODBUS: Final = 500
FIRST: Final = 20
"""So many reactions are not counted: connecting, and what is done once."""
EVERY_S: Final = 0.001
IN_PROCESS_MAX, OVER_MODBUS_MAX = 2.0, 1.2
"""The goals, for the medians."""

NET: Final = parse_net(
    """
firable: 1
cell: reacting
controllers:
  m:
    start: low
    inputs: s
    places: {low: {send: {machine: M, command: LOW}}, high: {send: {machine: M, command: HIGH}}}
transitions:
  up: {from: m.low, to: m.high, if: m.s}
  down: {from: m.high, to: m.low, unless: m.s}
"""
)

BINDING: Final = """
firable_bind: 1
cell: reacting
devices:
  plc:
    driver: modbus-tcp
    host: 127.0.0.1
    port: {port}
    every_s: {every}
    channels: {{M: {{number: holding 1, taken: input 1}}}}
signals:
  m.s: {{device: plc, read: input 0}}
commands:
  m.low: {{device: plc, channel: M, write: {{holding 0: 1}}}}
  m.high: {{device: plc, channel: M, write: {{holding 0: 2}}}}
"""


class PingPong:
    """A driver that changes the signal as soon as the command has come, and takes the times in between."""

    def __init__(self, count: int, pauses: Iterator[float] | None = None) -> None:
        self.count = count
        self.pauses = pauses
        self.times: list[float] = []
        self.came = asyncio.Event()
        self.sent = 0.0
        self.last = ("", 0)
        self.listener: Listener | None = None

    @property
    def at_rest(self) -> bool:
        """Something always comes."""
        return False

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """None: there is no device that could be out of reach."""
        return ()

    @property
    def unreached(self) -> tuple[str, ...]:
        """Nothing, likewise."""
        return ()

    def readings(self) -> Mapping[str, Reading]:
        """Nothing that would be asked for."""
        return {}

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Change the signal, wait for the command, and again."""
        del clock  # the yardstick has none either
        self.listener = listener
        for count in range(self.count):
            self.came.clear()
            if self.pauses is not None:
                await asyncio.sleep(next(self.pauses))
            self.sent = time.perf_counter()
            listener.signal("m.s", count % 2 == 0, None)
            listener.all_told()
            await self.came.wait()
        listener.driver_fault("", "enough")
        await asyncio.get_running_loop().create_future()

    def send(self, place: Place, entry: int) -> None:
        """Take the time."""
        self.times.append(time.perf_counter() - self.sent)
        self.last = (place.name, entry)
        if self.listener is not None:
            self.listener.taken(place.name, entry)
        self.came.set()

    async def met(self) -> None:
        """At once."""

    async def ask(self, place: Place, entry: int) -> Answer:
        """What was sent last is done."""
        return Answer.DONE if (place.name, entry) == self.last else Answer.UNKNOWN

    def withdraw(self, place: Place) -> None:
        """Nothing waits here."""

    def stop(self) -> None:
        """Nothing to stop."""

    def close(self) -> bool:
        """Nothing to close."""
        return False


def execution_with(driver: Driver) -> Host:
    """The net, run with a driver."""
    return Host(split(NET), driver, Recorder(NET, "", None), Conduct(overdue_seconds=60.0))


def between_changes() -> Iterator[float]:
    """Pauses in seconds, always the same ones."""
    moments = random.Random(0)
    while True:
        yield 0.002 + moments.uniform(0, 0.004)


async def within(count: int, *, with_pauses: bool = False) -> list[float]:
    """The reactions of the executor to signals in this process, in seconds."""
    driver = PingPong(count, between_changes() if with_pauses else None)
    await execution_with(driver).main()
    return driver.times[FIRST:]


async def controller_alone(count: int) -> list[float]:
    """The controller without a host: a signal in, the firing and its command out, and nothing done with them."""
    controller = LocalController(split(NET), "m")
    times = []
    for i in range(count):
        start = time.perf_counter()
        controller.read("m.s", i % 2 == 0)
        effects = controller.fire()
        controller.report()
        times.append(time.perf_counter() - start)
        (sending,) = (effect for effect in effects if isinstance(effect, Sending))
        controller.sent(sending.place, sending.entry)
    return times[FIRST:]


async def echo_within(count: int, *, with_pauses: bool = False) -> list[float]:
    """The same between two tasks and two queues, which is the least that asyncio can do."""
    pauses = between_changes()
    there: asyncio.Queue[int] = asyncio.Queue()
    back: asyncio.Queue[int] = asyncio.Queue()

    async def echoing() -> None:
        while True:
            back.put_nowait(await there.get())

    task = asyncio.create_task(echoing())
    times = []
    for i in range(count):
        if with_pauses:
            await asyncio.sleep(next(pauses))
        start = time.perf_counter()
        there.put_nowait(i)
        await back.get()
        times.append(time.perf_counter() - start)
    task.cancel()
    return times[FIRST:]


# Over a socket


class Echo(asyncio.Protocol):
    """The yardstick: what comes goes back."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The plant is there."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        """Answer."""
        self.transport.write(data)


class SocketDriver(PingPong, asyncio.Protocol):
    """A driver to which a byte is a signal and a command a byte."""

    transport: asyncio.Transport | None = None

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Serve until cancelled."""
        del clock
        self.listener = listener
        await asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """The plant is there."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        """The signal."""
        if self.listener is not None:
            self.listener.signal("m.s", data == b"1", None)
            self.listener.all_told()

    def send(self, place: Place, entry: int) -> None:
        """The command."""
        self.last = (place.name, entry)
        if self.transport is not None and self.listener is not None:
            self.transport.write(b"!")
            self.listener.taken(place.name, entry)


async def served(protocol: asyncio.Protocol, count: int) -> list[float]:
    """The times that a plant takes which talks to a protocol of this loop."""
    server = await asyncio.get_running_loop().create_server(lambda: protocol, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    async with server, plant("echo", str(port), str(count)) as lines:
        times: list[float] = json.loads(await lines.readline())
    return times[FIRST:]


async def over_socket(count: int) -> list[float]:
    """The reactions of the executor to a byte."""
    driver = SocketDriver(count)
    running = asyncio.create_task(execution_with(driver).main())
    times = await served(driver, count)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    return times


async def echo_over_socket(count: int) -> list[float]:
    """The answers of an echo server."""
    return await served(Echo(), count)


def byte_by_byte(port: int, count: int) -> list[float]:
    """Send a byte, wait for one, and again."""
    times = []
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for i in range(count):
            start = time.perf_counter()
            connection.sendall(b"1" if i % 2 == 0 else b"0")
            connection.recv(16)
            times.append(time.perf_counter() - start)
    return times


# Over Modbus


async def over_modbus(every_s: float, count: int) -> list[float]:
    """The reactions of the executor over Modbus TCP."""

    async def serve(port: int, over: asyncio.Event) -> None:
        driver = bound_driver(parse_binding(BINDING.format(port=port, every=every_s)), NET)
        execution = execution_with(driver)
        running = asyncio.create_task(execution.main())
        await asyncio.wait((running, asyncio.create_task(over.wait())), return_when=asyncio.FIRST_COMPLETED)
        execution.stop()
        await running

    return await at_server(serve, count)


async def bare_modbus(every_s: float, count: int) -> list[float]:
    """The reactions of a loop over a bare client of pymodbus."""
    from pymodbus.client import AsyncModbusTcpClient

    async def poll(port: int, over: asyncio.Event) -> None:
        client = AsyncModbusTcpClient("127.0.0.1", port=port, retries=0)
        await client.connect()
        loop = asyncio.get_running_loop()
        shown, number, due = 0, 0, 0.0
        try:
            while not over.is_set():  # to be cancelled would leave a question open, and pymodbus warns of its answer
                await asyncio.sleep(max(0.0, due - loop.time()))
                due = loop.time() + every_s
                answer = await client.read_input_registers(0, count=2)
                if answer.registers[0] != shown:
                    shown, number = answer.registers[0], number % 65_535 + 1
                    await client.write_registers(0, [shown, number])
        finally:
            client.close()

    return await at_server(poll, count)


async def at_server(client: Callable[[int, asyncio.Event], Awaitable[None]], count: int) -> list[float]:
    """The times that a Modbus server takes to which a client reacts, until it is told that it is over."""
    async with plant("modbus", str(count)) as lines:
        over = asyncio.Event()
        running = asyncio.ensure_future(client(int(await lines.readline()), over))
        try:
            times: list[float] = json.loads(await lines.readline())
            over.set()
            await running
        finally:
            await ended([running])
    return times


async def modbus_plant(count: int) -> None:
    """Serve, and take the time from what is shown to what is written for it, at any moment of the poll."""
    end, came, times = ModbusTcpEnd(), asyncio.Event(), []

    def written(point: Point, value: Value) -> None:
        if point == "holding 1" and value:
            end.show("input 1", value)  # the number of a command, which is taken
            came.set()

    await end.start(written)
    print(end.port, flush=True)
    for i, pause in zip(range(FIRST + count), between_changes(), strict=False):
        await asyncio.sleep(pause)
        came.clear()
        start = time.perf_counter()
        end.show("input 0", (i + 1) % 2)
        await came.wait()
        times.append(time.perf_counter() - start)
    print(json.dumps(times[FIRST:]), flush=True)
    await asyncio.get_running_loop().create_future()  # a client whose connection ends would say so


# Plants are processes of their own


@asynccontextmanager
async def plant(*arguments: str) -> AsyncIterator[asyncio.StreamReader]:
    """A plant, and what it prints; it ends when it is not listened to any more."""
    command = (sys.executable, str(Path(__file__).resolve()), *arguments)
    pipe = subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, limit=1 << 24)
    assert process.stdout is not None
    try:
        async with asyncio.timeout(300):
            yield process.stdout
    finally:
        process.kill()
        await process.wait()


Way = Callable[[int], Awaitable[list[float]]]

COMPARED: Final[tuple[tuple[str, Way, str, Way, int, float | None], ...]] = (
    ("echo server of asyncio", echo_over_socket, "executor at a socket", over_socket, REACTIONS, IN_PROCESS_MAX),
    ("echo between two tasks", echo_within, "executor, driver in the process", within, REACTIONS, IN_PROCESS_MAX),
    ("echo between two tasks", echo_within, "controller alone, without a host", controller_alone, REACTIONS, None),
    (
        "echo between two tasks, with pauses",
        partial(echo_within, with_pauses=True),
        "executor, driver in the process, with pauses",
        partial(within, with_pauses=True),
        OVER_MODBUS,
        None,
    ),
    *(
        (
            f"loop of pymodbus, {pace}",
            partial(bare_modbus, every_s),
            f"executor over Modbus TCP, {pace}",
            partial(over_modbus, every_s),
            OVER_MODBUS,
            OVER_MODBUS_MAX,
        )
        for every_s, pace in ((0.0, "polled without a pause"), (EVERY_S, f"polled each {EVERY_S * 1e3:g} ms"))
    ),
)


def tables(repeat: int) -> list[Table]:
    """Reactions each way, beside its yardstick and the noise floor."""
    rows: list[tuple[str, ...]] = []
    for yardstick_name, yardstick, name, work, count, goal in COMPARED:
        bare: list[list[float]] = []
        again: list[list[float]] = []
        ours: list[list[float]] = []
        for _ in range(repeat):
            bare.append(asyncio.run(_times(yardstick, count)))
            ours.append(asyncio.run(_times(work, count)))
            again.append(asyncio.run(_times(yardstick, count)))
        best, second, own = min(bare, key=median), min(again, key=median), min(ours, key=median)
        rows.append(_row(yardstick_name, best, best, "the yardstick"))
        rows.append(_row(f"{yardstick_name}, again: the noise floor", second, best, ""))
        rows.append(_row(name, own, best, "" if goal is None else against(goal, median(own) / median(best))))
    return [
        Table(
            "From a change of a signal to its command",
            f"By the clock, in microseconds, of each the run with the least median of {repeat}; by a plant in another "
            "process, except between two tasks.",
            ("what", "p50", "p99", "p50, times the yardstick", "p99, times the yardstick", "goal for p50"),
            tuple(rows),
        )
    ]


async def _times(way: Way, count: int) -> list[float]:
    return await way(count)


def _row(name: str, times: list[float], yardstick: list[float], goal: str) -> tuple[str, ...]:
    p99, bare = quantiles(times, n=100)[98], quantiles(yardstick, n=100)[98]
    return (
        name,
        f"{median(times) * 1e6:,.1f}",
        f"{p99 * 1e6:,.1f}",
        f"{median(times) / median(yardstick):.2f}",
        f"{p99 / bare:.2f}",
        goal,
    )


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["echo", port, count]:
            print(json.dumps(byte_by_byte(int(port), int(count))))
        case ["modbus", count]:
            asyncio.run(modbus_plant(int(count)))
