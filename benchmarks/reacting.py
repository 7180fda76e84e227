"""How long it takes from a change of a signal to the command that follows from it.

The net is the smallest that reacts: a token goes from one place to another when a signal comes, and back when it goes,
and each place sends a command. In this process the yardstick is an echo between two tasks of asyncio; over Modbus TCP
it is a loop that polls by pymodbus and writes when it sees a change, at the same pace, against such a server. These are
times by the clock, because reacting is waiting; the noise floor is the yardstick against itself, measured in turn with
the rest, and no ratio below it means anything.
"""

from __future__ import annotations

import asyncio
import random
import time
from collections.abc import Mapping
from statistics import median, quantiles
from typing import Final

from measuring import Table, against

from firable.decompose.splitting.cut import split
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.device import Point, Value
from firable.executor.drivers.driver import Answer, Clock, Driver, Listener, Reading
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.keeping import ended
from firable.executor.operating.execution import Execution
from firable.executor.operating.recorder import Recorder
from firable.nets.net import Place
from firable.nets.text import parse_net

REACTIONS: Final = 2_000
OVER_MODBUS: Final = 500
EVERY_S: Final = 0.001
GOALS: Final = {"simulated driver": 2.0, "driver over Modbus TCP": 1.2}

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

    def __init__(self, count: int) -> None:
        self.count = count
        self.times: list[float] = []
        self.came = asyncio.Event()
        self.sent = 0.0
        self.last = ("", 0)
        self.listener: Listener | None = None

    @property
    def at_rest(self) -> bool:
        """Something always comes."""
        return False

    def readings(self) -> Mapping[str, Reading]:
        """Nothing that would be asked for."""
        return {}

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Change the signal, wait for the command, and again."""
        del clock  # the yardstick has none either
        self.listener = listener
        for count in range(self.count):
            self.came.clear()
            self.sent = time.perf_counter()
            listener.signal("m.s", count % 2 == 0, None)
            await self.came.wait()
        listener.driver_fault("", "enough")
        await asyncio.get_running_loop().create_future()

    def send(self, place: Place, entry: int) -> None:
        """Take the time."""
        self.last = (place.name, entry)
        if self.listener is not None:
            self.listener.taken(place.name, entry)
        self.times.append(time.perf_counter() - self.sent)
        self.came.set()

    async def ask(self, place: Place, entry: int) -> Answer:
        """What was sent last is done."""
        return Answer.DONE if (place.name, entry) == self.last else Answer.UNKNOWN

    def withdraw(self, place: Place) -> None:
        """Nothing waits here."""

    def stop(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Nothing to close."""


def execution_with(driver: Driver) -> Execution:
    """The net, run with a driver."""
    return Execution(split(NET), driver, Recorder(NET, "", None), overdue_seconds=60.0)


async def simulated(count: int) -> list[float]:
    """The reactions of the executor to signals in this process, in seconds."""
    driver = PingPong(count)
    await execution_with(driver).main()
    return driver.times


async def echo(count: int) -> list[float]:
    """The same between two tasks and two queues, which is the least that asyncio can do."""
    there: asyncio.Queue[int] = asyncio.Queue()
    back: asyncio.Queue[int] = asyncio.Queue()

    async def echoing() -> None:
        while True:
            back.put_nowait(await there.get())

    task = asyncio.create_task(echoing())
    times = []
    for i in range(count):
        start = time.perf_counter()
        there.put_nowait(i)
        await back.get()
        times.append(time.perf_counter() - start)
    task.cancel()
    return times


class Reacted:
    """A Modbus server that shows a change and takes the time until something is written for it."""

    def __init__(self) -> None:
        self.end = ModbusTcpEnd()
        self.came = asyncio.Event()

    def written(self, point: Point, value: Value) -> None:
        """A client has written the number of a command, which is taken."""
        if point == "holding 1" and value:
            self.end.show("input 1", value)
            self.came.set()

    async def measured(self, count: int) -> list[float]:
        """The times from a change to what is written, of changes at any moment of the poll."""
        times = []
        moments = random.Random(0)
        for i in range(count):
            await asyncio.sleep(5 * EVERY_S + moments.uniform(0, 2 * EVERY_S))
            self.came.clear()
            start = time.perf_counter()
            self.end.show("input 0", (i + 1) % 2)
            await self.came.wait()
            times.append(time.perf_counter() - start)
        return times


async def over_modbus(count: int) -> list[float]:
    """The reactions of the executor over Modbus TCP."""
    reacted = Reacted()
    await reacted.end.start(reacted.written)
    driver = bound_driver(parse_binding(BINDING.format(port=reacted.end.port, every=EVERY_S)), NET)
    running = asyncio.create_task(execution_with(driver).main())
    await driver.devices["plc"].is_ready.wait()
    times = await reacted.measured(count)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    await reacted.end.stop()
    return times


async def bare_modbus(count: int) -> list[float]:
    """The reactions of a loop over a bare client of pymodbus."""
    from pymodbus.client import AsyncModbusTcpClient

    reacted = Reacted()
    await reacted.end.start(reacted.written)
    client = AsyncModbusTcpClient("127.0.0.1", port=reacted.end.port, retries=0)
    await client.connect()

    async def polling() -> None:
        loop = asyncio.get_running_loop()
        shown, number, due = 0, 0, 0.0
        while True:
            await asyncio.sleep(max(0.0, due - loop.time()))
            due = loop.time() + EVERY_S
            answer = await client.read_input_registers(0, count=2)
            if answer.registers[0] != shown:
                shown, number = answer.registers[0], number % 65_535 + 1
                await client.write_registers(0, [shown, number])

    task = asyncio.create_task(polling())
    times = await reacted.measured(count)
    await ended([task])
    client.close()
    await reacted.end.stop()
    return times


def tables(repeat: int) -> list[Table]:
    """Reactions in this process and over Modbus, each beside its yardstick and the noise floor."""
    rows: list[tuple[str, ...]] = []
    for yardstick_name, yardstick, name, work, count in (
        ("echo of asyncio", echo, "simulated driver", simulated, REACTIONS),
        ("loop of pymodbus", bare_modbus, "driver over Modbus TCP", over_modbus, OVER_MODBUS),
    ):
        bare: list[list[float]] = []
        again: list[list[float]] = []
        ours: list[list[float]] = []
        for _ in range(repeat):
            bare.append(asyncio.run(yardstick(count)))
            ours.append(asyncio.run(work(count)))
            again.append(asyncio.run(yardstick(count)))
        best, second, own = min(bare, key=median), min(again, key=median), min(ours, key=median)
        rows.append(_row(yardstick_name, best, best, "the yardstick"))
        rows.append(_row(f"{yardstick_name}, again: the noise floor", second, best, ""))
        ratio = median(own) / median(best)
        rows.append(_row(name, own, best, against(GOALS[name], ratio)))
    return [
        Table(
            "From a change of a signal to its command",
            f"By the clock, in microseconds, the run with the least median of {repeat}; over Modbus with a poll each "
            f"{EVERY_S * 1e3:g} ms, at whose start the change may come at any time.",
            ("what", "p50", "p99", "p50, times the yardstick", "p99, times the yardstick", "goal for p50"),
            tuple(rows),
        )
    ]


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
