"""A command leaves in the turn of the event loop in which it comes, and is stopped, lost and refused as any other."""

import asyncio
import gc
import warnings
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from functools import partial
from typing import Any

import pytest

from firable.executor.drivers import keeping, modbus
from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.device import (
    Connection,
    LinkError,
    Options,
    Point,
    Prompt,
    Use,
    Value,
    Wanted,
    WithheldError,
    Writes,
)
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.keeping import Kept, Nobody
from firable.executor.drivers.modbus_connection import ModbusConnection

BINDING = """{firable_bind: 1, cell: c, devices: {D: {driver: modbus-tcp, host: h, timeout_s: 5, retry_s: 0.02,
safe: {coil 1: false}}}}"""
GO: Writes = (("coil 1", True),)
SAFE: Writes = (("coil 1", False),)


class Line:
    """A connection that begins at once, and confirms what it is told to."""

    def __init__(self) -> None:
        self.sent: list[Writes] = []
        self.is_confirmed = asyncio.Event()
        self.is_confirmed.set()
        self.failing = asyncio.get_running_loop().create_future()
        self.reads = 0
        self.mistake = ""

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """What it shows first, and then nothing more until it fails."""
        self.reads += 1
        if self.reads > 1:
            await self.failing
        return []

    def begin(self, writes: Writes) -> Coroutine[Any, Any, None]:
        """Send it."""
        if self.mistake:
            raise AttributeError(self.mistake)
        self.sent.append(writes)
        return self._confirmed()

    async def write(self, writes: Writes) -> None:
        """Send it, and wait."""
        await self.begin(writes)

    def withhold(self) -> None:
        """Nothing: it is sent."""

    async def close(self) -> None:
        """Nothing."""

    async def _confirmed(self) -> None:
        await self.is_confirmed.wait()


class Lines:
    """A kind of device whose connections are kept."""

    options = Options
    through_broker = False

    def __init__(self) -> None:
        self.made: list[Line] = []

    def point_problem(self, point: Point, use: Use) -> str:
        """None."""
        del point, use
        return ""

    def load(self) -> None:
        """Nothing."""

    async def connect(self, options: Options, wanted: Wanted) -> Connection:
        """One more."""
        del options, wanted
        self.made.append(Line())
        return self.made[-1]


class Commands(Nobody):
    """Who has commands to be written."""

    def __init__(self) -> None:
        self.waiting: list[Writes] = []
        self.confirmed = 0
        self.is_ready = False
        self.errors: list[Exception] = []

    def ready(self) -> None:
        """There is a connection."""
        self.is_ready = True

    def next_writes(self) -> Writes | None:
        """The next one."""
        return self.waiting.pop(0) if self.waiting else None

    def written(self) -> None:
        """It is confirmed."""
        self.confirmed += 1

    def broken(self, error: Exception) -> None:
        """It is a mistake."""
        self.errors.append(error)


Then = Callable[[Kept, Line, Commands], Awaitable[None]]


def served(then: Then, timeout_s: float = 5) -> tuple[list[list[Writes]], Commands]:
    """What each connection has sent to a device for which something is done when it is idle, and is then stopped."""
    kind, commands = Lines(), Commands()

    async def main() -> None:
        document = parse_binding(BINDING.replace("timeout_s: 5", f"timeout_s: {timeout_s}")).document.devices["D"]
        kept = Kept(document, kind, Options(), Wanted((), timeout_s), commands)
        task = asyncio.create_task(kept.run())
        await until(lambda: kept.idle is not None, "the connection")
        await then(kept, kind.made[0], commands)
        kept.stop()
        await asyncio.wait((task,), timeout=PATIENCE_S)
        assert kept.is_safe

    gc.collect()  # what others have left behind is not ours
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        asyncio.run(main())
        gc.collect()
    assert [str(one.message) for one in warned] == []
    return [line.sent for line in kind.made], commands


def given(kept: Kept, commands: Commands) -> None:
    commands.waiting.append(GO)
    kept.urge()


def test_command_is_sent_before_anything_else_is_done_and_confirmed_later() -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        line.is_confirmed.clear()
        given(kept, commands)
        assert line.sent == [SAFE, GO]
        given(kept, commands)  # one after the other
        await asyncio.sleep(0.01)
        assert line.sent == [SAFE, GO]
        assert commands.confirmed == 0
        line.is_confirmed.set()
        await until(lambda: commands.confirmed == 2, "the confirmations")

    assert served(then)[0] == [[SAFE, GO, GO, SAFE]]


def test_command_that_is_not_confirmed_soon_after_a_stop_costs_its_connection() -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        line.is_confirmed.clear()
        given(kept, commands)
        kept.stop()
        given(kept, commands)  # nothing is sent any more

    # What was sent may come late, by the first of them: the second one has the last word.
    assert served(then, timeout_s=0.5)[0] == [[SAFE, GO], [SAFE, SAFE]]


def test_command_that_is_confirmed_soon_after_a_stop_leaves_its_connection() -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        del line
        given(kept, commands)
        kept.stop()

    sent, commands = served(then)
    assert sent == [[SAFE, GO, SAFE]]
    assert commands.confirmed == 1


def test_nothing_is_begun_after_a_stop() -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        del line
        kept.stop()
        given(kept, commands)

    assert served(then)[0] == [[SAFE, SAFE]]


@pytest.mark.parametrize("turns", range(6))
def test_command_of_the_turn_in_which_its_connection_fails_is_not_confirmed(turns: int) -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        commands.is_ready = False
        line.is_confirmed.clear()
        line.failing.set_exception(LinkError("gone"))
        for _ in range(turns):
            await asyncio.sleep(0)
        given(kept, commands)
        await until(lambda: commands.is_ready, "the next connection")
        line.is_confirmed.set()

    sent, commands = served(then, timeout_s=0.5)
    begun = len(sent[0]) - 1
    assert sent[0] == [SAFE, GO][: begun + 1]
    assert commands.confirmed == 1 - begun  # what was begun is for its channel to send again


def test_mistake_at_the_beginning_of_a_write_stops_the_device() -> None:
    async def then(kept: Kept, line: Line, commands: Commands) -> None:
        line.mistake = "no begin"
        given(kept, commands)
        await until(lambda: commands.errors, "the mistake")

    sent, commands = served(then, timeout_s=0.5)
    assert sent == [[SAFE], [SAFE, SAFE]]
    assert [str(error) for error in commands.errors] == ["no begin"]


# Over Modbus


class Commander(Commands):
    """Who stops the device as soon as its input shows 1."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[Kept] = []

    def read(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """A button."""
        if ("input 0", 1) in batch:
            self.kept[0].stop()


@pytest.mark.parametrize("turns", [0, 5])
@pytest.mark.parametrize("pressed", [False, True])
def test_command_that_waits_for_an_answer_is_not_sent_after_a_stop(
    turns: int, pressed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keeping, "_CONFIRMED_SECONDS", PATIENCE_S)  # the answer comes late on a busy machine
    written: list[tuple[Point, Value]] = []
    commands = Commander()

    async def main() -> None:
        end = ModbusTcpEnd()
        await end.start(lambda point, value: written.append((point, value)))
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port, every_s=0)
        document = parse_binding(BINDING).document.devices["D"]
        kept = Kept(document, modbus.TCP, options, Wanted(("input 0",), document.timeout_s), commands)
        commands.kept.append(kept)
        task = asyncio.create_task(kept.run())
        await until(lambda: kept.idle is not None, "the connection")
        connection = kept.idle
        assert isinstance(connection, ModbusConnection)
        end.faults.delay_s = 0.01
        for _ in range(2):  # the second one is answered so late
            asked = connection.watch.answer
            while connection.watch.answer is asked:
                await asyncio.sleep(0)
        commands.waiting.append((("coil 7", True),))
        kept.urge()
        for _ in range(turns):
            await asyncio.sleep(0)
        if pressed:
            end.show("input 0", 1)
        else:
            kept.stop()
        await asyncio.wait((task,), timeout=PATIENCE_S)
        assert kept.is_safe
        assert kept.connections == 1, "the connection is as good as before"
        await end.stop()

    asyncio.run(main())
    assert written == [("coil 1", False), ("coil 1", False)]
    assert commands.confirmed == 0


def over_modbus(
    work: Callable[[ModbusConnection, ModbusTcpEnd, list[Point]], Awaitable[None]],
    read: Sequence[Point] = ("input 0", "input 5"),
) -> None:
    """Do something on a connection to a server, which notes what it is written."""
    written: list[Point] = []

    async def main() -> None:
        end = ModbusTcpEnd()
        await end.start(lambda point, _: written.append(point))
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port, every_s=0)
        wanted = Wanted(read=read, timeout_s=10 * PATIENCE_S)
        connection = await modbus.TCP.connect(options, wanted)
        assert isinstance(connection, ModbusConnection)
        assert isinstance(connection, Prompt)
        try:
            await work(connection, end, written)
        finally:
            await connection.close()
            await end.stop()

    asyncio.run(main())


def test_what_is_begun_is_on_its_way_before_anybody_waits_for_it() -> None:
    async def work(connection: ModbusConnection, end: ModbusTcpEnd, written: list[Point]) -> None:
        del end
        writing = connection.begin([("holding 1", 7), ("coil 3", True)])
        await until(lambda: written == ["holding 1"], "the first of it")
        await writing
        assert written == ["holding 1", "coil 3"]

    over_modbus(work)


def test_what_is_begun_while_something_is_polled_goes_before_the_rest_of_the_poll() -> None:
    async def work(connection: ModbusConnection, end: ModbusTcpEnd, written: list[Point]) -> None:
        end.show("input 5", 1)
        polled = asyncio.create_task(connection.read())
        while not connection.is_asking:
            await asyncio.sleep(0)
        await asyncio.wait_for(connection.begin([("holding 1", 7)]), PATIENCE_S)
        assert not polled.done()
        assert written == ["holding 1"]
        assert list(await polled) == [("input 0", 0), ("input 5", 1)]

    over_modbus(work)


def test_what_is_withheld_is_sent_no_further_and_the_line_goes_on() -> None:
    async def work(connection: ModbusConnection, end: ModbusTcpEnd, written: list[Point]) -> None:
        end.show("input 5", 1)
        begun = connection.begin([("holding 1", 7), ("coil 3", True)])
        polled = asyncio.create_task(connection.read())
        connection.withhold()
        with pytest.raises(WithheldError, match="coil 3 is not written any more"):
            await begun
        assert written == ["holding 1"]
        assert list(await asyncio.wait_for(polled, PATIENCE_S)) == [("input 0", 0), ("input 5", 1)]
        await connection.write([("coil 4", True)])
        assert written == ["holding 1", "coil 4"]

    over_modbus(work)


def test_device_of_which_nothing_is_read_leaves_the_loop_to_others() -> None:
    async def work(connection: ModbusConnection, end: ModbusTcpEnd, written: list[Point]) -> None:
        del end, written
        reading = connection.read()
        reading.send(None)  # it waits
        reading.close()
        await connection.write(())

    over_modbus(work, read=())


def test_value_that_cannot_be_written_fails_for_who_waits_and_the_line_goes_on() -> None:
    async def work(connection: ModbusConnection, end: ModbusTcpEnd, written: list[Point]) -> None:
        del end
        writing = connection.begin([("holding 1", "x")])
        with pytest.raises(LinkError, match="holding 1 takes numbers, not 'x'"):
            await writing
        assert len(await connection.read()) == 2
        assert written == []

    over_modbus(work)


def test_question_that_is_not_answered_in_time_fails() -> None:
    async def silent(_reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
        await asyncio.sleep(PATIENCE_S)  # with the writer, which would close the connection when it is gone

    async def main() -> None:
        server = await asyncio.start_server(silent, "127.0.0.1", 0)
        options = modbus.TcpOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1], every_s=0)
        connection = await modbus.TCP.connect(options, Wanted(read=("input 0",), timeout_s=0.05))
        for asked in (connection.read, partial(connection.write, GO)):
            with pytest.raises(LinkError, match="no answer in time"):
                await asyncio.wait_for(asked(), PATIENCE_S)
        await connection.close()
        server.close()

    asyncio.run(main())
