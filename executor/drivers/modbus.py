"""Modbus over TCP and over a serial line (RTU), by pymodbus.

Modbus has no events, so the points are polled (`modbus_points.py`). What is written together and lies together goes out
in one request, so that a command and its number reach the device in one piece. The line takes one request at a time,
and a command goes before the next poll.

A request that is not answered in time ends the connection. Frames over TCP carry a transaction number and pymodbus
looks at it, frames of RTU carry none: there a late answer *is* the answer to the next question.

What is asked, how it is written and read, and the transport are those of pymodbus; only the waiting is done here
(`ModbusConnection.ask`). Its `execute` sets a timer for each request, and passes an answer on through three coroutines
and two locks: a good part of what a reaction takes. Here one timer watches all requests of a connection (`Watch`), and
what is sent is sent by a plain call, so that a command that follows from an answer leaves in the turn of the event loop
in which the answer came (`begin`). Who waits for an answer is told when the connection is gone, which pymodbus tells
nobody. And what comes when nobody asks any more, as where a stop has broken off a question, is nobody's answer: it is
dropped before pymodbus warns of it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Literal

from pydantic import Field

from firable.executor.drivers.device import (
    Connection,
    LinkError,
    Options,
    Point,
    Stepwise,
    Use,
    Value,
    Wanted,
    Writes,
    drop_at_close,
    quiet,
)
from firable.executor.drivers.modbus_points import (
    BITS,
    WRITTEN,
    Address,
    Block,
    address,
    blocks,
    shown_value,
    together,
)

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
    from pymodbus.client.mixin import ModbusClientMixin
    from pymodbus.pdu import ModbusPDU


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


class Watch:
    """The time limit of a connection, on whatever it asks: one question at a time."""

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self.loop = asyncio.get_running_loop()
        self.since_seconds = 0.0
        self.answer: asyncio.Future[Any] | None = None
        """What is waited for since then."""
        self.timer = self.loop.call_later(timeout_s, self._look)

    def begin(self, answer: asyncio.Future[Any]) -> None:
        """A question is asked."""
        self.since_seconds, self.answer = self.loop.time(), answer

    def close(self) -> None:
        """Watch no more."""
        self.timer.cancel()

    def _look(self) -> None:
        left_s = self.timeout_s
        if self.answer is not None and not self.answer.done():
            left_s -= self.loop.time() - self.since_seconds
            if left_s <= 0:
                self.answer.set_exception(TimeoutError("no answer in time"))
                left_s = self.timeout_s
        self.timer = self.loop.call_later(left_s, self._look)


@dataclass(frozen=True, slots=True)
class _Question:
    """A request, and of what, in words."""

    request: ModbusPDU
    what: str


class ModbusConnection(Stepwise):
    """A connection to one device, by a client that is connected."""

    def __init__(
        self, client: AsyncModbusTcpClient | AsyncModbusSerialClient, unit: int, every_s: float, timeout_s: float
    ) -> None:
        from pymodbus.exceptions import ModbusException

        self.client = client
        self.closed = partial(ModbusException, "the connection was closed")
        self.unconnected = partial(ModbusException, "Not connected")
        client.ctx.trace_connect = self._told
        client.ctx.trace_packet = self._passed
        self.requests = _requests()
        self.unit = unit
        self.every_s = every_s
        self.loop = asyncio.get_running_loop()
        self.watch = Watch(timeout_s)
        self.is_asking = False
        """Whether an answer is awaited: the line takes one question at a time."""
        self.queue: deque[asyncio.Future[None]] = deque()
        """Who waits for the line; the first is told when it is free."""
        self.is_free = asyncio.Event()
        """Set while nothing is being written."""
        self.is_free.set()
        self.points: dict[Address, list[Point]] = {}
        self.polls: list[tuple[_Question, Block]] = []
        self.layout: list[tuple[Point, int, Address]] = []
        """Where each point stands among the values of all blocks."""
        self.due_seconds = 0.0
        self.failures: tuple[type[Exception], ...] = (ModbusException, TimeoutError)

    def want(self, points: Sequence[Point]) -> None:
        """Say what is to be read."""
        for point in points:
            self.points.setdefault(address(point), []).append(point)
        asking = {
            "coil": self.requests.read_coils,
            "discrete": self.requests.read_discrete_inputs,
            "input": self.requests.read_input_registers,
            "holding": self.requests.read_holding_registers,
        }
        at: dict[tuple[str, int], int] = {}
        for block in blocks(list(self.points)):
            request = asking[block.table](block.first, count=block.count, device_id=self.unit)
            self.polls.append((_Question(request, f"{block.table} {block.first}"), block))
            for number in range(block.first, block.first + block.count):
                at[block.table, number] = len(at)
        self.layout = [(point, at[one.table, one.number], one) for one, each in self.points.items() for point in each]

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """All points, when it is time to poll them again."""
        if (early_s := self.due_seconds - self.loop.time()) > 0 or not self.polls:
            await asyncio.sleep(max(0.0, early_s))
        if not self.is_free.is_set():
            await self.is_free.wait()
        self.due_seconds = self.loop.time() + self.every_s
        shown: list[int] = []
        for question, block in self.polls:
            await self._turn()
            answer = await self._answer(self.ask(question), question)
            values: Sequence[int] = answer.bits if block.table in BITS else answer.registers
            if len(values) < block.count:
                short = f"an answer with {len(values)} values to a question for {block.count}"
                raise LinkError(f"{short} from {question.what}")
            shown += values[: block.count]
        return [(point, shown_value(shown[at], one)) for point, at, one in self.layout]

    async def write(self, writes: Writes) -> None:
        """Write values in their order, neighbours together."""
        await self.begin(writes)

    def begin(self, writes: Writes) -> Coroutine[Any, Any, None]:
        """Write values in their order, the first of them now where nothing else is asked; what waits for the rest."""
        self.is_free.clear()  # nothing is polled before they are written
        begun: tuple[_Question, asyncio.Future[ModbusPDU]] | None = None
        questions = self._questions(writes)
        if self._is_idle:
            try:
                if (first := next(questions, None)) is not None:
                    begun = first, self.ask(first)
            except LinkError:
                questions = self._questions(writes)  # who waits is told
        return self._written(begun, questions, self.withheld)

    def ask(self, question: _Question) -> asyncio.Future[ModbusPDU]:
        """Ask the device now, as nothing else is asked; what will be answered, or why nothing will be."""
        line = self.client.ctx
        answer: asyncio.Future[ModbusPDU] = self.loop.create_future()
        self.is_asking = True
        self.watch.begin(answer)
        line.response_future, line.recv_buffer = answer, b""
        try:
            if line.transport is None:
                raise self.unconnected()
            question.request.transaction_id = line.getNextTID()
            line.pdu_send(question.request)
        except Exception as error:
            answer.set_exception(error)
        return answer

    async def close(self) -> None:
        """Close the client, which is not used again."""
        self.watch.close()
        if isinstance(transport := self.client.ctx.transport, asyncio.Transport):
            transport.abort()  # before pymodbus, which would send what it still has
        self.client.close()

    def _told(self, is_connected: bool) -> None:
        """The connection is made, or it is gone: then nobody will answer what was asked."""
        answer = self.client.ctx.response_future
        if not is_connected and self.is_asking and not answer.done():
            answer.set_exception(self.closed())

    def _passed(self, is_sent: bool, data: bytes) -> bytes:
        """What goes out, and what comes in as long as somebody asks."""
        return data if is_sent or not self.client.ctx.response_future.done() else b""

    async def _written(
        self, begun: tuple[_Question, asyncio.Future[ModbusPDU]] | None, questions: Iterator[_Question], withheld: int
    ) -> None:
        try:
            if begun is not None:
                question, answer = begun
                await self._answer(answer, question)
            for question in questions:
                await self._turn()
                with self.step(question.what, withheld):
                    await self._answer(self.ask(question), question)
        finally:
            self.is_free.set()
            self._hand_on()

    @property
    def _is_idle(self) -> bool:
        return not self.is_asking and not self.queue

    async def _turn(self) -> None:
        """Wait until the line is free, behind those who have waited before: neither polls nor writes starve."""
        if self._is_idle:
            return
        turn = self.loop.create_future()
        self.queue.append(turn)
        try:
            await turn
        except asyncio.CancelledError:
            self.queue.remove(turn)
            self._hand_on()
            raise
        self.queue.remove(turn)

    def _hand_on(self) -> None:
        if self.queue and not self.is_asking and not self.queue[0].done():
            self.queue[0].set_result(None)

    async def _answer(self, answer: asyncio.Future[ModbusPDU], question: _Question) -> ModbusPDU:
        try:
            shown = await answer
        except self.failures as error:
            raise LinkError(f"{question.what}: {str(error).removeprefix('Modbus Error: ')}") from None
        finally:
            self.is_asking = False
            self._hand_on()
        if shown.isError():
            raise LinkError(f"the device refuses {question.what}: exception {shown.exception_code}")
        return shown

    def _questions(self, writes: Writes) -> Iterator[_Question]:
        """The requests that write values in their order, neighbours together; raises `LinkError`."""
        for first, begin, end in together(tuple(point for point, _ in writes)):
            yield self._question(first, [value for _, value in writes[begin:end]])

    def _question(self, first: Address, values: Sequence[Value]) -> _Question:
        what = f"{first.table} {first.number}"
        try:
            numbers = [int(value) for value in values]
        except ValueError:
            raise LinkError(f"{what} takes numbers, not {values[0]!r}") from None
        if first.table == "coil":
            bits = [bool(number) for number in numbers]
            return _Question(self.requests.write_coils(first.number, bits, device_id=self.unit), what)
        if first.bit is not None:
            mask = 1 << first.bit
            keeping, setting = 0xFFFF ^ mask, mask * bool(numbers[0])
            mask_write = self.requests.mask_write_register
            request = mask_write(address=first.number, and_mask=keeping, or_mask=setting, device_id=self.unit)
            return _Question(request, what)
        numbers = [number & 0xFFFF for number in numbers]
        return _Question(self.requests.write_registers(first.number, numbers, device_id=self.unit), what)


def _requests() -> ModbusClientMixin[ModbusPDU]:
    """The requests of pymodbus, by the methods of its clients, as they are before they are sent."""
    from pymodbus.client.mixin import ModbusClientMixin
    from pymodbus.pdu import ModbusPDU

    class Requests(ModbusClientMixin[ModbusPDU]):
        def execute(self, no_response_expected: bool, request: ModbusPDU) -> ModbusPDU:
            del no_response_expected
            return request

    made: Callable[[], ModbusClientMixin[ModbusPDU]] = Requests  # it is not typed
    return made()


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
    drop_at_close(client.ctx.transport)
    connection.want(list(wanted.read))
    return connection


TCP: Final = ModbusTcp()
RTU: Final = ModbusRtu()
