"""What is made of the answers of a Modbus device: each to its own question, and a contact that is open at once."""

import asyncio
import os
import re
from collections.abc import Sequence
from contextlib import suppress

import pytest
from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerRTU

from firable.executor.drivers import modbus
from firable.executor.drivers.bench import PATIENCE_S, Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import LinkError, Point, Value, Wanted, Writes
from firable.executor.drivers.far_side.line import PseudoLine
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.keeping import Kept, Nobody

BINDING = """{firable_bind: 1, cell: c, devices: {D: {driver: modbus-tcp, host: h, timeout_s: 5, retry_s: 0.02,
safe: {coil 1: false}}}}"""
CONTACT = "input 100.3"
POINTS = frozenset({CONTACT, "input 100", "input 101", "discrete 0", "input 0", "holding 7"})
GO: Writes = (("coil 7", True),)


class Cell(Nobody):
    """Who stops the device when its contact opens, and has one command."""

    def __init__(self) -> None:
        self.kept: list[Kept] = []
        self.waiting: list[Writes] = []
        self.seen_at: list[int] = []
        self.confirmed = 0

    def read(self, batch: Sequence[tuple[Point, Value]]) -> None:
        """A contact."""
        if (CONTACT, False) in batch:
            self.seen_at.append(len(batch))
            self.kept[0].stop()

    def next_writes(self) -> Writes | None:
        """The command."""
        return self.waiting.pop() if self.waiting else None

    def written(self) -> None:
        """It is confirmed."""
        self.confirmed += 1


class Questioned(ModbusTcpEnd):
    """A server that hands its client a command when it is asked something behind the contact that is open."""

    def __init__(self, cell: Cell) -> None:
        super().__init__()
        self.cell = cell
        self.is_shown_open = False
        self.asked: list[tuple[int, int]] = []

    async def _asked(
        self,
        function: int,
        start: int,
        first: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        self.asked.append((function, first))
        if values is None and self.is_shown_open:
            self.is_shown_open = False
            self.cell.waiting.append(GO)
            self.cell.kept[0].urge()
        self.is_shown_open |= (function, first) == (4, 100) and not self.shown["input", 100] >> 3 & 1
        return await super()._asked(function, start, first, count, registers, values)


def test_no_command_leaves_between_the_block_that_shows_an_open_contact_and_the_rest_of_the_poll() -> None:
    written: list[tuple[Point, Value]] = []
    cell = Cell()

    async def main() -> None:
        end = Questioned(cell)
        end.show(CONTACT, value=True)
        await end.start(lambda point, value: written.append((point, value)))
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port, every_s=0)
        document = parse_binding(BINDING).document.devices["D"]
        kept = Kept(document, modbus.TCP, options, Wanted(sorted(POINTS), document.timeout_s, {CONTACT}), cell)
        cell.kept.append(kept)
        task = asyncio.create_task(kept.run())
        await until(lambda: kept.idle is not None, "the connection")
        end.show(CONTACT, value=False)
        await asyncio.wait((task,), timeout=PATIENCE_S)
        assert kept.is_safe
        await end.stop()

    asyncio.run(main())
    assert cell.seen_at == [1]
    assert written == [("coil 1", False), ("coil 1", False)]
    assert cell.confirmed == 0


def test_block_with_a_contact_is_read_first_and_told_before_the_rest() -> None:
    async def main() -> None:
        end = Questioned(Cell())
        end.show(CONTACT, value=True)
        end.show("input 101", 9)
        await end.start(lambda _, __: None)
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port, every_s=0)
        wanted = Wanted(sorted(POINTS), PATIENCE_S, frozenset({CONTACT}))
        connection = await modbus.TCP.connect(options, wanted)
        whole = {CONTACT: True, "input 100": 8, "input 101": 9, "discrete 0": False, "input 0": 0, "holding 7": 0}
        assert dict(await connection.read()) == whole
        for _ in range(2):
            assert list(await connection.read()) == [(CONTACT, True)]
            assert dict(await connection.read()) == whole
        assert end.asked == 3 * [(4, 100), (2, 0), (4, 0), (3, 7)]
        await connection.close()
        await end.stop()

    asyncio.run(main())


READ_ONE = "04 02 0007"
WRITTEN = "0F 0001 0001"


@pytest.mark.parametrize(
    ("question", "answer", "why"),
    [
        ("read", READ_ONE, ""),
        ("read", "04 04 0007 0008", "an answer with 2 values to a question for 1 from input 0"),
        ("read", "04 00", "an answer with 0 values to a question for 1 from input 0"),
        ("read", "03 02 0007", "an answer to another question than that for input 0"),
        ("read", WRITTEN, "an answer to another question than that for input 0"),
        ("read", "84 02", "the device refuses input 0: exception 2 (it has no such address)"),
        ("read", "84 7F", "the device refuses input 0: exception 127"),
        ("read", "84", "input 0: an answer that nobody can read"),
        ("read", "04 09 0007", "input 0: an answer that nobody can read"),
        ("read", "63 01", "input 0: an answer that nobody can read"),
        ("coil 1", "80 01", "coil 1: an answer that nobody can read"),
        ("coil 1", WRITTEN, ""),
        ("coil 1", "0F 0002 0001", "an answer to another question than that for coil 1"),
        ("coil 1", "0F 0001 0002", "an answer to another question than that for coil 1"),
        ("coil 1", READ_ONE, "an answer to another question than that for coil 1"),
        ("coil 1", "10 0001 0001", "an answer to another question than that for coil 1"),
        ("coil 1", "8F 04", "the device refuses coil 1: exception 4 (it has failed)"),
        ("holding 3.2", "16 0003 FFFB 0004", ""),
        ("holding 3.2", "16 0003 FFFB 0000", "an answer to another question than that for holding 3"),
        ("holding 3", "10 0003 0001", ""),
        ("holding 3", "06 0003 0001", "an answer to another question than that for holding 3"),
    ],
)
def test_answer_that_is_not_to_the_question_is_none(question: str, answer: str, why: str) -> None:
    errors: list[object] = []

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context))

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            asked = await reader.read(64)
            body = bytes.fromhex("01" + answer.replace(" ", ""))
            writer.write(asked[:4] + len(body).to_bytes(2, "big") + body)

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        options = modbus.TcpOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1], every_s=0)
        connection = await modbus.TCP.connect(options, Wanted(read=("input 0",), timeout_s=PATIENCE_S))
        work = connection.read() if question == "read" else connection.write([(question, 1)])
        if why:
            with pytest.raises(LinkError, match=f"^{re.escape(why)}$"):
                await asyncio.wait_for(work, PATIENCE_S)
        else:
            await asyncio.wait_for(work, PATIENCE_S)
        await connection.close()
        server.close()

    asyncio.run(main())
    assert not errors


def test_answer_without_a_number_over_tcp_is_none() -> None:
    """One that comes twice would be taken for that to another poll."""

    async def main() -> None:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            asked = await reader.read(12)
            for _ in range(2):
                writer.write(bytes.fromhex("0000 0000 0004") + asked[6:8] + bytes.fromhex("01 01"))
                asked = await reader.read(12)

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        options = modbus.TcpOptions(host="127.0.0.1", port=server.sockets[0].getsockname()[1], every_s=0)
        connection = await modbus.TCP.connect(options, Wanted(("discrete 2", "discrete 7"), PATIENCE_S))
        with pytest.raises(LinkError, match="an answer to another question than that for discrete 2"):
            await asyncio.wait_for(connection.read(), PATIENCE_S)
        await connection.close()
        server.close()

    asyncio.run(main())


LATE = """{firable_bind: 1, cell: c, devices: {D: {driver: modbus-rtu, port: PORT, parity: N, timeout_s: 0.4}},
signals: {dark: {device: D, read: discrete 2, on_loss: hold}, lit: {device: D, read: discrete 7, on_loss: hold}}}"""


def test_answer_that_a_line_brings_late_is_not_taken_for_that_to_another_poll() -> None:
    async def main() -> None:
        line, heard = PseudoLine(), Heard()
        line.open()
        late = False

        async def serve() -> None:
            nonlocal late
            end = os.open(line.far, os.O_RDWR | os.O_NONBLOCK)
            while True:
                with suppress(BlockingIOError):
                    question = os.read(end, 8)
                    number = question[3]
                    if late and number == 7:
                        late = False
                        await asyncio.sleep(0.6)
                    answer = question[:2] + bytes([1, number == 7])
                    os.write(end, answer + FramerRTU.compute_CRC(answer).to_bytes(2, "big"))
                await asyncio.sleep(0.001)

        driver = BoundDriver(parse_binding(LATE.replace("PORT", line.near)), (), frozenset())
        works = [asyncio.create_task(work) for work in (serve(), driver.run(heard, heard))]
        try:
            await until(lambda: heard.notes == ["D: connected"], "the connection")
            late = True
            await until(lambda: heard.notes[-1] == "D: connected again", "the next one")
        finally:
            await ended(works)
            line.close()
        assert heard.signals == [("dark", False, None), ("lit", True, None)]

    asyncio.run(main())
