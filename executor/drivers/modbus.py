"""Modbus over TCP and over a serial line (RTU), by pymodbus.

Points are `coil N`, `discrete N`, `input N` and `holding N`, with addresses from 0 as they stand on the wire, and
`holding N.B` or `input N.B` for a bit of a register, from 0. Modbus has no events, so the points are polled: those next
to each other in one request, never with a gap, because a device may refuse what is not there. What is written together
and lies together goes out in one request, so that a command and its number reach the device in one piece.
The line takes one request at a time, and a command goes before the next poll.

A request that is not answered in time ends the connection (`retries=0`). Frames over TCP carry a transaction number and
pymodbus looks at it, frames of RTU carry none: there a late answer *is* the answer to the next question. The time is
watched here (`Watch`), by one timer for all requests of a connection: pymodbus would set one for each, and wait for its
answer in two more turns of the event loop, which is a good part of what a reaction takes.

pymodbus does not tell who waits for an answer that the connection is gone: it would be waited for until its time is
over. So this is told here. And what comes when nobody asks any more, as where a stop has broken off a question, is
nobody's answer: it is dropped before pymodbus warns of it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final, Literal

from pydantic import Field

from firable.executor.drivers.device import Connection, LinkError, Options, Point, Use, Value, Wanted, Writes, quiet

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
    from pymodbus.pdu import ModbusPDU

TABLES: Final = ("coil", "discrete", "input", "holding")
BITS: Final = ("coil", "discrete")
WRITTEN: Final = ("coil", "holding")
ADDRESS_MAX: Final = 65_535
AT_ONCE_MAX: Final = {"coil": 1968, "discrete": 2000, "input": 125, "holding": 123}
"""How many a request may carry, by the standard."""


class TcpOptions(Options):
    """A device in a network."""

    host: str
    port: int = Field(default=502, ge=1, le=65_535)
    unit: int = Field(default=1, ge=0, le=255)
    every_s: float = Field(default=0.01, ge=0, le=60, allow_inf_nan=False)


class RtuOptions(Options):
    """A device on a serial line."""

    port: str
    baud: int = Field(default=19_200, ge=300, le=4_000_000)
    parity: Literal["N", "E", "O"] = "E"
    stop_bits: Literal["1", "2"] = "1"
    unit: int = Field(default=1, ge=1, le=247)
    every_s: float = Field(default=0.02, ge=0, le=60, allow_inf_nan=False)


@dataclass(frozen=True, slots=True, order=True)
class Address:
    """What a point means; `bit` is None for the whole."""

    table: str
    number: int
    bit: int | None = None


def address(point: Point) -> Address:
    """The address that a point is; raises `ValueError` with a sentence that says what is wrong.

    >>> address("coil 5"), address("input 30.2")
    (Address(table='coil', number=5, bit=None), Address(table='input', number=30, bit=2))
    """
    table, _, rest = point.partition(" ")
    number, dot, bit = rest.partition(".")
    if table not in TABLES or not number.isdecimal() or int(number) > ADDRESS_MAX:
        raise ValueError("it is not `coil N`, `discrete N`, `input N` or `holding N`, with N from 0 to 65535")
    if not dot:
        return Address(table, int(number))
    if table in BITS or not bit.isdecimal() or int(bit) > 15:
        raise ValueError("only a register has bits, `holding N.B` or `input N.B`, with B from 0 to 15")
    return Address(table, int(number), int(bit))


@dataclass(frozen=True, slots=True)
class _Block:
    """Addresses that are read or written in one request."""

    table: str
    first: int
    count: int


def blocks(addresses: Sequence[Address]) -> Iterator[_Block]:
    """The requests that read all addresses and nothing else.

    >>> [(b.first, b.count) for b in blocks([address(f"input {n}") for n in (4, 3, 7, 3)])]
    [(3, 2), (7, 1)]
    """
    for table in TABLES:
        numbers = sorted({one.number for one in addresses if one.table == table})
        while numbers:
            count = 1
            while count < min(len(numbers), AT_ONCE_MAX[table]) and numbers[count] == numbers[0] + count:
                count += 1
            yield _Block(table, numbers[0], count)
            del numbers[:count]


class Watch:
    """The time limit of a connection, on whatever it asks: one question at a time."""

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self.loop = asyncio.get_running_loop()
        self.since_seconds = 0.0
        self.asking: asyncio.Task[Any] | None = None
        """Who asks, since then."""
        self.is_over = False
        self.timer = self.loop.call_later(timeout_s, self._look)

    def __enter__(self) -> None:
        self.since_seconds, self.asking = self.loop.time(), asyncio.current_task()

    def __exit__(self, *failed: object) -> None:
        asking, self.asking = self.asking, None
        if self.is_over and asking is not None and asking.uncancel() == 0:
            raise TimeoutError("no answer in time") from None

    def close(self) -> None:
        """Watch no more."""
        self.timer.cancel()

    def _look(self) -> None:
        left_s = self.timeout_s
        if self.asking is not None:
            left_s -= self.loop.time() - self.since_seconds
            if left_s <= 0:
                self.is_over = True
                self.asking.cancel()
                return
        self.timer = self.loop.call_later(left_s, self._look)


class ModbusConnection:
    """A connection to one device, by a client that is connected."""

    def __init__(
        self, client: AsyncModbusTcpClient | AsyncModbusSerialClient, unit: int, every_s: float, timeout_s: float
    ) -> None:
        from pymodbus.exceptions import ModbusException

        self.client = client
        self.closed = partial(ModbusException, "the connection was closed")
        client.ctx.trace_connect = self._told
        client.ctx.trace_packet = self._passed
        self.unit = unit
        self.every_s = every_s
        self.watch = Watch(timeout_s)
        self.line = asyncio.Lock()
        """Of who asks: the time of a question begins when the line is its own."""
        self.points: dict[Address, list[Point]] = {}
        self.blocks: tuple[_Block, ...] = ()
        self.layout: list[tuple[Point, int, Address]] = []
        """Where each point stands among the values of all blocks."""
        self.due_seconds = 0.0
        self.failures: tuple[type[Exception], ...] = (ModbusException, TimeoutError)
        self.asked: dict[str, Callable[..., Awaitable[ModbusPDU]]] = {
            "coil": client.read_coils,
            "discrete": client.read_discrete_inputs,
            "input": client.read_input_registers,
            "holding": client.read_holding_registers,
        }
        """What asks for a block of each table."""
        self.is_free = asyncio.Event()
        """Set while nothing is being written."""
        self.is_free.set()

    def want(self, points: Sequence[Point]) -> None:
        """Say what is to be read."""
        for point in points:
            self.points.setdefault(address(point), []).append(point)
        self.blocks = tuple(blocks(list(self.points)))
        first = dict(zip(self.blocks, accumulate((b.count for b in self.blocks), initial=0), strict=False))
        at = {(b.table, b.first + i): first[b] + i for b in self.blocks for i in range(b.count)}
        self.layout = [(point, at[one.table, one.number], one) for one, each in self.points.items() for point in each]

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """All points, when it is time to poll them again."""
        loop = asyncio.get_running_loop()
        # A turn of the loop at least, in which the writer begins with the command that follows from what was polled.
        await asyncio.sleep(max(0.0, self.due_seconds - loop.time()))
        if not self.is_free.is_set():
            await self.is_free.wait()
        self.due_seconds = loop.time() + self.every_s
        shown: list[int] = []
        for block in self.blocks:
            shown += await self._block(block)
        return [(point, _value(shown[at], one)) for point, at, one in self.layout]

    async def write(self, writes: Writes) -> None:
        """Write values in their order, neighbours together."""
        self.is_free.clear()
        try:
            await self._write_all([(address(point), value) for point, value in writes])
        finally:
            self.is_free.set()

    async def _write_all(self, pending: list[tuple[Address, Value]]) -> None:
        while pending:
            (first, _), count = pending[0], 1
            while (
                count < min(len(pending), AT_ONCE_MAX[first.table])
                and first.bit is None
                and pending[count][0] == Address(first.table, first.number + count)
            ):
                count += 1
            await self._write(first, [value for _, value in pending[:count]])
            del pending[:count]

    async def close(self) -> None:
        """Close the client, which is not used again."""
        self.watch.close()
        self.client.close()

    def _told(self, is_connected: bool) -> None:
        """The connection is made, or it is gone: then nobody will answer what was asked."""
        answer = self.client.ctx.response_future
        if not is_connected and self.watch.asking is not None and not answer.done():
            answer.set_exception(self.closed())

    def _passed(self, is_sent: bool, data: bytes) -> bytes:
        """What goes out, and what comes in as long as somebody asks."""
        return data if is_sent or not self.client.ctx.response_future.done() else b""

    async def _block(self, block: _Block) -> Sequence[int]:
        what = f"{block.table} {block.first}"
        answer = await self._answered(partial(self.asked[block.table], block.first, count=block.count), what)
        shown: Sequence[int] = answer.bits if block.table in BITS else answer.registers
        if len(shown) < block.count:
            raise LinkError(f"an answer with {len(shown)} values to a question for {block.count} from {what}")
        return shown[: block.count]

    async def _write(self, first: Address, values: Sequence[Value]) -> None:
        what = f"{first.table} {first.number}"
        try:
            numbers = [int(value) for value in values]
        except ValueError:
            raise LinkError(f"{what} takes numbers, not {values[0]!r}") from None
        if first.table == "coil":
            bits = [bool(number) for number in numbers]
            request = partial(self.client.write_coils, first.number, bits)
        elif first.bit is not None:
            mask = 1 << first.bit
            mask_write = self.client.mask_write_register
            request = partial(mask_write, address=first.number, and_mask=0xFFFF ^ mask, or_mask=mask * bool(numbers[0]))
        else:
            numbers = [number & 0xFFFF for number in numbers]
            request = partial(self.client.write_registers, first.number, numbers)
        await self._answered(request, what)

    async def _answered(self, request: Callable[..., Awaitable[ModbusPDU]], what: str) -> ModbusPDU:
        try:
            async with self.line:
                with self.watch:
                    answer = await request(device_id=self.unit)
        except self.failures as error:
            raise LinkError(f"{what}: {str(error).removeprefix('Modbus Error: ')}") from None
        if answer.isError():
            raise LinkError(f"the device refuses {what}: exception {answer.exception_code}")
        return answer


def _value(shown: int, one: Address) -> Value:
    if one.table in BITS:
        return bool(shown)
    return shown if one.bit is None else bool(shown >> one.bit & 1)


class _Modbus:
    """What both kinds have in common."""

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with an address."""
        try:
            found = address(point)
        except ValueError as error:
            return str(error)
        if use is Use.WRITE and found.table not in WRITTEN:
            return f"nobody can write a {found.table} but the device"
        return ""


class ModbusTcp(_Modbus):
    """Modbus in a network."""

    options: type[Options] = TcpOptions
    through_broker = False

    def load(self) -> None:
        """Import what is needed."""
        import_module("pymodbus.client")

    async def connect(self, options: TcpOptions, wanted: Wanted) -> Connection:
        """Make a new connection."""
        from pymodbus.client import AsyncModbusTcpClient

        client = AsyncModbusTcpClient(
            options.host, port=options.port, timeout=wanted.timeout_s, retries=0, reconnect_delay=0
        )
        where = f"{options.host}:{options.port}"
        return await _opened(client, where, options.unit, options.every_s, wanted)


class ModbusRtu(_Modbus):
    """Modbus on a serial line."""

    options: type[Options] = RtuOptions
    through_broker = False

    def load(self) -> None:
        """Import what is needed."""
        import_module("serial")  # which pymodbus would say to be missing only in passing
        import_module("pymodbus.client")

    async def connect(self, options: RtuOptions, wanted: Wanted) -> Connection:
        """Open the line anew."""
        import termios

        from pymodbus.client import AsyncModbusSerialClient

        client = AsyncModbusSerialClient(
            options.port,
            baudrate=options.baud,
            parity=options.parity,
            stopbits=int(options.stop_bits),
            timeout=wanted.timeout_s,
            retries=0,
            reconnect_delay=0,
        )
        try:
            return await _opened(client, options.port, options.unit, options.every_s, wanted)
        except (ValueError, termios.error) as error:
            raise LinkError(f"{options.port} cannot be set to these options: {error}") from None


async def _opened(
    client: AsyncModbusTcpClient | AsyncModbusSerialClient, where: str, unit: int, every_s: float, wanted: Wanted
) -> Connection:
    quiet("pymodbus")
    try:
        if not await client.connect():
            raise LinkError(f"{where} does not answer")
    except BaseException:
        client.close()
        raise
    setattr(client.ctx.comm_params, "timeout_connect", None)  # noqa: B010 - its type says that there is one always
    connection = ModbusConnection(client, unit, every_s, wanted.timeout_s)
    connection.want(list(wanted.read))
    return connection


TCP: Final = ModbusTcp()
RTU: Final = ModbusRtu()
