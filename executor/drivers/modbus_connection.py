"""One connection to a Modbus device: what is asked, and what is made of the answers.

Modbus has no events, so the points are polled (`modbus_points.py`). What is written together and lies together goes out
in one request, so that a command and its number reach the device in one piece. The line takes one request at a time,
and a command goes before the next poll.

A request that is not answered in time ends the connection. Frames over TCP carry a transaction number and pymodbus
looks at it, as long as it is not 0; frames of RTU carry none: there a late answer would be the answer to the next
question. So an answer must fit its question, and a line is not left before the answer has come that is still owed, or
its time is over (`close`). An answer that could be one to another poll as well is given that time once more before the
line is used again (`owed_seconds`): of two inputs of one device that is late, the one would be shown in the place of
the other.

What is asked, how it is written and read, and the transport are those of pymodbus; only the waiting is done here
(`ModbusConnection.ask`). Its `execute` sets a timer for each request, and passes an answer on through three coroutines
and two locks: a good part of what a reaction takes. Here one timer watches all requests of a connection (`Watch`), and
what is sent is sent by a plain call, so that a command that follows from an answer leaves in the turn of the event loop
in which the answer came (`begin`). Who waits for an answer is told when the connection is gone, which pymodbus tells
nobody. And what comes when nobody asks any more, as where a stop has broken off a question, is nobody's answer: it is
dropped before pymodbus warns of it. An answer that pymodbus cannot read fails its question, and is no error of ours.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Coroutine, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from firable.executor.drivers.device import LinkError, Point, Stepwise, Value, Writes
from firable.executor.drivers.modbus_points import BITS, Address, Block, address, blocks, shown_value, together

if TYPE_CHECKING:
    from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
    from pymodbus.client.mixin import ModbusClientMixin
    from pymodbus.pdu import ModbusPDU

    Client: TypeAlias = AsyncModbusTcpClient | AsyncModbusSerialClient

_REFUSED: Final = 0x80
"""What the function code of an answer has besides that of the request where the request is refused."""

_EXCEPTIONS: Final = {
    1: "it has not this function",
    2: "it has no such address",
    3: "it does not take such a value",
    4: "it has failed",
    5: "it will take a while",
    6: "it is busy",
    10: "the gateway has no way to it",
    11: "it does not answer the gateway",
}
"""What the exceptions mean by which a device refuses a request (MODBUS Application Protocol, 7)."""

_SAID_AGAIN: Final = ("address", "count", "and_mask", "or_mask")
"""What the answer to a write has of the request."""


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


@dataclass(slots=True)
class _Poll:
    """A question for a block, and where the urgent points stand among the values of its answer."""

    question: _Question
    block: Block
    urgent: list[tuple[Point, int, Address]]

    def values(self, answer: ModbusPDU) -> Sequence[int]:
        """The values that are shown; raises `LinkError` where they are not as many as were asked for."""
        count = whole = self.block.count
        values: Sequence[int] = answer.registers
        if self.block.table in BITS:
            values, whole = answer.bits, count + -count % 8
        if len(values) != whole:
            raise LinkError(f"an answer with {len(values)} values to a question for {count} from {self.question.what}")
        return values[:count]


class ModbusConnection(Stepwise):
    """A connection to one device, by a client that is connected."""

    def __init__(self, client: Client, unit: int, every_s: float, timeout_s: float, *, is_line: bool) -> None:
        from pymodbus.exceptions import ModbusException

        self.client = client
        self.closed = partial(ModbusException, "the connection was closed")
        self.unconnected = partial(ModbusException, "Not connected")
        self.unreadable = partial(ModbusException, "an answer that nobody can read")
        line: Any = client.ctx  # of which a method is replaced
        self.decode: Callable[..., int] = line.callback_data
        line.callback_data = self._came
        line.trace_connect = self._told
        self.requests = _requests()
        self.is_line = is_line
        """Whether it is the one way to the device, on which late answers come to whoever asks next."""
        self.unit = unit
        self.every_s = every_s
        self.loop = asyncio.get_running_loop()
        self.watch = Watch(timeout_s)
        self.is_asking = False
        """Whether an answer is awaited: the line takes one question at a time."""
        self.is_owed = False
        """Whether the device has not answered what it was asked, also where nobody waits for it any more."""
        self.is_polling = False
        """Whether that is a poll, whose answer could be one to another poll."""
        self.queue: deque[asyncio.Future[None]] = deque()
        """Who waits for the line; the first is told when it is free."""
        self.is_free = asyncio.Event()
        """Set while nothing is being written."""
        self.is_free.set()
        self.polls: list[_Poll] = []
        self.polled = 0
        """How many of them have been answered, of those that make up the image."""
        self.shown: list[int] = []
        """The values that they have shown."""
        self.is_first = True
        self.layout: list[tuple[Point, int, Address]] = []
        """Where each point stands among the values of all blocks."""
        self.due_seconds = 0.0
        self.failures: tuple[type[Exception], ...] = (ModbusException, TimeoutError)

    def want(self, points: Sequence[Point], urgent: Collection[Point]) -> None:
        """Say what is to be read; blocks with something urgent come first."""
        wanted: dict[Address, list[Point]] = {}
        for point in points:
            wanted.setdefault(address(point), []).append(point)
        asking = {
            "coil": self.requests.read_coils,
            "discrete": self.requests.read_discrete_inputs,
            "input": self.requests.read_input_registers,
            "holding": self.requests.read_holding_registers,
        }
        for block in blocks(list(wanted)):
            request = asking[block.table](block.first, count=block.count, device_id=self.unit)
            self.polls.append(_Poll(_Question(request, f"{block.table} {block.first}"), block, []))
        alarms = {address(point) for point in urgent}
        self.polls.sort(key=lambda poll: not any(poll.block.has(one) for one in alarms))
        before = 0
        for poll in self.polls:
            for one, each in wanted.items():
                if poll.block.has(one):
                    at = before + one.number - poll.block.first
                    self.layout += [(point, at, one) for point in each]
                    poll.urgent += [(point, at, one) for point in each if point in urgent]
            before += poll.block.count

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """All points, when it is time to poll them again; before that those that are urgent, when they are known."""
        if not self.polled:
            if (early_s := self.due_seconds - self.loop.time()) > 0 or not self.polls:
                await asyncio.sleep(max(0.0, early_s))
            if not self.is_free.is_set():
                await self.is_free.wait()
            self.due_seconds = self.loop.time() + self.every_s
            self.shown = []
        layout = self.layout
        while self.polled < len(self.polls):
            poll = self.polls[self.polled]
            if not self._is_idle:
                await self._turn()
            asked, self.is_polling = self.ask(poll.question), True
            answer = await self._answer(asked, poll.question)
            try:
                self.shown += poll.values(answer)
            except LinkError:
                self.is_owed = True
                raise
            self.polled += 1
            if poll.urgent and not self.is_first and self.polled < len(self.polls):
                layout = poll.urgent
                break
        else:
            self.polled, self.is_first = 0, False
        shown = self.shown
        return [(point, shown_value(shown[at], one)) for point, at, one in layout]

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
                    begun[1].add_done_callback(_heard)
            except LinkError:
                questions = self._questions(writes)  # who waits is told
        return self._written(begun, questions, self.withheld)

    def ask(self, question: _Question) -> asyncio.Future[ModbusPDU]:
        """Ask the device now, as nothing else is asked; what will be answered, or why nothing will be."""
        line = self.client.ctx
        answer: asyncio.Future[ModbusPDU] = self.loop.create_future()
        self.is_asking = self.is_owed = True
        self.is_polling = False
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
        try:
            left_s = self.watch.since_seconds + self.watch.timeout_s - self.loop.time()
            if self.is_line and self.is_owed and self.client.ctx.transport is not None and left_s > 0:
                self.client.ctx.response_future = owed = self.loop.create_future()
                await asyncio.wait((owed,), timeout=left_s)
                self.is_owed = not owed.done()
        finally:
            if isinstance(transport := self.client.ctx.transport, asyncio.Transport):
                transport.abort()  # before pymodbus, which would send what it still has
            self.client.close()

    @property
    def owed_seconds(self) -> float:
        """How long a poll may still be answered on a line: twice as long as it should be."""
        if not (self.is_line and self.is_owed and self.is_polling):
            return 0.0
        return max(0.0, self.watch.since_seconds + 2 * self.watch.timeout_s - self.loop.time())

    def _told(self, is_connected: bool) -> None:
        """The connection is made, or it is gone: then nobody will answer what was asked."""
        answer = self.client.ctx.response_future
        if not is_connected and self.is_asking and not answer.done():
            answer.set_exception(self.closed())

    def _came(self, data: bytes, addr: tuple[Any, ...] | None = None) -> int:
        """What comes goes to pymodbus as long as somebody asks; returns how much of it is over."""
        answer = self.client.ctx.response_future
        if answer.done():
            return 0  # the next question clears it
        try:
            return self.decode(data, addr)
        except Exception:  # which the event loop would tell at the terminal, as a mistake
            if self.is_asking and not answer.done():
                answer.set_exception(self.unreadable())
            return len(data)

    async def _written(
        self, begun: tuple[_Question, asyncio.Future[ModbusPDU]] | None, questions: Iterator[_Question], withheld: int
    ) -> None:
        try:
            if begun is not None:
                question, answer = begun
                await self._confirmed(answer, question)
            for question in questions:
                await self._turn()
                with self.step(question.what, withheld):
                    await self._confirmed(self.ask(question), question)
        except asyncio.CancelledError:
            raise  # broken off: the connection ends, and no poll that has waited is sent before
        except BaseException:
            self._free()
            raise
        else:
            self._free()

    def _free(self) -> None:
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
            if not answer.cancelled():
                self._hand_on()
        asked = question.request
        if (shown.function_code & ~_REFUSED, shown.transaction_id) != (asked.function_code, asked.transaction_id):
            raise LinkError(f"an answer to another question than that for {question.what}")
        self.is_owed = False
        if shown.isError():
            code = shown.exception_code
            meant = f" ({_EXCEPTIONS[code]})" if code in _EXCEPTIONS else ""
            raise LinkError(f"the device refuses {question.what}: exception {code}{meant}")
        return shown

    async def _confirmed(self, answer: asyncio.Future[ModbusPDU], question: _Question) -> None:
        """Wait for the answer to a write, which says again what is written, as far as the standard has it."""
        shown = await self._answer(answer, question)
        if any(getattr(shown, key, None) != getattr(question.request, key, None) for key in _SAID_AGAIN):
            self.is_owed = True
            raise LinkError(f"an answer to another question than that for {question.what}")

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


def _heard(answer: asyncio.Future[Any]) -> None:
    """Hear of an error also where who was to wait for it is gone: it fails with the connection, which others tell."""
    if not answer.cancelled():
        answer.exception()


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
