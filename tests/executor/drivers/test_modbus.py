"""Modbus over TCP and over a serial line, against servers of pymodbus."""

import asyncio
import os
import pty
import tty
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from functools import partial

import pytest
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.framer import FramerRTU

from firable.executor.drivers import modbus
from firable.executor.drivers.bench import PATIENCE_S, Far, until
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.device import Connection, LinkError, Point, Value, Wanted
from firable.executor.drivers.far_side.modbus_server import ModbusRtuEnd, ModbusTcpEnd
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.modbus_connection import ModbusConnection

POINTS = {
    "sensor": "discrete 0",
    "closed": "discrete 1",
    "button": "discrete 2",
    "tripped": "discrete 5",
    "output": "coil 3",
    "beat": "holding 0",
    "code": "holding 10",
    "number": "holding 12",
    "taken": "input 10",
    "done": "input 11",
    "failed": "input 12",
    "alive": "input 13",
}


class TestModbusTcp(DriverConformance):
    counts_edges = False

    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        end = ModbusTcpEnd()
        await end.mend()  # takes its port
        await end.cut()
        yield Far(end, f"driver: modbus-tcp, host: 127.0.0.1, port: {end.port}, every_s: 0.002", POINTS)


class TestModbusRtu(DriverConformance):
    counts_edges = False

    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        end = ModbusRtuEnd()
        end.line.open()
        yield Far(end, f"driver: modbus-rtu, port: {end.line.near}, baud: 115200, parity: N, every_s: 0.002", POINTS)


WANTED = Wanted(read=("input 0",), timeout_s=10 * PATIENCE_S)
"""Who waits for the time of a question waits longer than the test."""
ANSWER = bytes.fromhex("0000 0005 01 04 02 0007")
"""To a question for one register, without the number of the question."""


async def line_that_is_gone(has_asked: asyncio.Event, end: Callable[[int], object]) -> Connection:
    """A connection over a serial line of which the far side is ended when it has been asked something."""
    far, near = pty.openpty()
    tty.setraw(near)

    def asked() -> None:
        os.read(far, 256)
        asyncio.get_running_loop().remove_reader(far)
        has_asked.set()
        end(far)

    asyncio.get_running_loop().add_reader(far, asked)
    options = modbus.RtuOptions(port=os.ttyname(near), parity="N", every_s=0)
    connection = await modbus.RTU.connect(options, WANTED)
    os.close(near)
    return connection


async def device_that_goes(has_asked: asyncio.Event, end: Callable[[asyncio.StreamWriter], object]) -> Connection:
    """A connection in the network of which the far side is ended when it has been asked something."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readexactly(12)
        has_asked.set()
        end(writer)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    options = modbus.TcpOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1], every_s=0)
    return await modbus.TCP.connect(options, WANTED)


def test_a_connection_that_leads_to_itself_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it says would come back to it, and that is how a device confirms what is written to it."""
    port = free_port()
    itself = partial(AsyncModbusTcpClient, source_address=("127.0.0.1", port))
    monkeypatch.setattr("pymodbus.client.AsyncModbusTcpClient", itself)

    async def main() -> None:
        options = modbus.TcpOptions(host="127.0.0.1", port=port, every_s=0)
        with pytest.raises(LinkError, match="does not answer: the connection leads to itself"):
            await modbus.TCP.connect(options, WANTED)

    asyncio.run(main())


def test_a_serial_port_whose_settings_are_refused_is_closed_and_can_be_opened_again() -> None:
    """A pseudo-terminal has no parity, and says so when it is set a second time, open already."""

    async def main() -> None:
        far, near = pty.openpty()
        tty.setraw(near)
        options = modbus.RtuOptions(port=os.ttyname(near), parity="E", every_s=0)
        refused = []  # as who tells of them keeps them: what they hold on to is not collected
        for _ in range(2):
            with pytest.raises(LinkError, match="cannot be set to these options") as caught:
                await modbus.RTU.connect(options, WANTED)
            refused.append(caught.value)
        connection = await modbus.RTU.connect(options.model_copy(update={"parity": "N"}), WANTED)
        await connection.close()
        os.close(near)
        os.close(far)

    asyncio.run(main())


@pytest.mark.parametrize(
    "connected",
    [
        partial(device_that_goes, end=asyncio.StreamWriter.close),
        partial(device_that_goes, end=lambda writer: writer.transport.abort()),
        partial(line_that_is_gone, end=os.close),
    ],
    ids=["closed", "reset", "serial line"],
)
def test_a_question_under_way_fails_at_once_when_the_connection_is_closed(
    connected: Callable[[asyncio.Event], Awaitable[Connection]],
) -> None:
    async def main() -> None:
        has_asked = asyncio.Event()
        connection = await connected(has_asked)
        with pytest.raises(LinkError, match="input 0: the connection was closed"):
            await asyncio.wait_for(connection.read(), PATIENCE_S)
        assert has_asked.is_set()
        with pytest.raises(LinkError, match="Not connected"):
            await asyncio.wait_for(connection.read(), PATIENCE_S)
        await connection.close()

    asyncio.run(main())


def test_an_answer_to_a_question_that_was_broken_off_is_nobodys_and_nothing_is_said_of_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def main() -> None:
        questions: list[bytes] = []
        far: list[asyncio.StreamWriter] = []

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            far.append(writer)
            while question := await reader.read(12):
                questions.append(question)

        async def asked(count: int) -> None:
            await until(lambda: len(questions) >= count, "the question")

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        options = modbus.TcpOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1], every_s=0)
        connection = await modbus.TCP.connect(options, WANTED)
        assert isinstance(connection, ModbusConnection)
        for number in range(2):
            reading = asyncio.create_task(connection.read())
            await asked(number + 1)
            if not number:
                reading.cancel()
                await asyncio.wait([reading])
            far[0].write(questions[number][:2] + ANSWER)
            if not number:
                await until(lambda: connection.client.ctx.recv_buffer, "the answer")
        assert list(await asyncio.wait_for(reading, PATIENCE_S)) == [("input 0", 7)]
        await connection.close()

    asyncio.run(main())
    assert not [record for record in caplog.records if record.name.startswith("pymodbus")]


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_serial_line_is_not_left_before_the_answer_that_is_still_owed_which_is_nobodys(is_cancelled: bool) -> None:
    async def main() -> None:
        far, near = pty.openpty()
        tty.setraw(near)
        loop = asyncio.get_running_loop()
        questions: list[bytes] = []
        loop.add_reader(far, lambda: questions.append(os.read(far, 256)))

        def answer(value: int) -> None:
            body = bytes.fromhex("01 04 02") + value.to_bytes(2, "big")
            os.write(far, body + FramerRTU.compute_CRC(body).to_bytes(2, "big"))

        async def asked(count: int) -> tuple[Connection, asyncio.Task[Sequence[tuple[Point, Value]]]]:
            connection = await modbus.RTU.connect(options, WANTED)
            reading = asyncio.create_task(connection.read())
            await until(lambda: len(questions) == count, "the question")
            return connection, reading

        options = modbus.RtuOptions(port=os.ttyname(near), parity="N", every_s=0)
        connection, reading = await asked(1)
        reading.cancel()
        closing = asyncio.create_task(connection.close())
        done, _ = await asyncio.wait((closing,), timeout=0.05)
        assert not done
        if is_cancelled:  # it is left at once then
            closing.cancel()
            await asyncio.wait((closing,))
        else:
            answer(7)
            await asyncio.wait_for(closing, PATIENCE_S)
        connection, reading = await asked(2)
        answer(8)
        assert list(await asyncio.wait_for(reading, PATIENCE_S)) == [("input 0", 8)]
        await asyncio.wait_for(connection.close(), PATIENCE_S)
        loop.remove_reader(far)
        os.close(far)
        os.close(near)

    asyncio.run(main())
