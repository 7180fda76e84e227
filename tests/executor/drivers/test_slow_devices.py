"""A device that answers rightly, and takes its time for each of many answers, is stopped as soon as any other."""

import asyncio
from collections.abc import Callable

from pymodbus.constants import ExcCodes

from firable.executor.drivers import modbus
from firable.executor.drivers.bench import PATIENCE_S
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.device import Wanted, Writes
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.keeping import Kept, Nobody

BINDING = """{firable_bind: 1, cell: c, devices: {D: {driver: modbus-tcp, host: h, timeout_s: 2, retry_s: 0.02,
safe: {coil 1: false}, heartbeat: {write: holding 9, every_s: 0.05}}}}"""
BLOCKS = tuple(f"{table} {at}" for table in ("input", "discrete", "coil", "holding") for at in (0, 100, 200))
"""Each is a question of its own: all of them take longer than an answer may."""
ANSWER_S = 0.2
SAFE, BEAT, GO = ("coil", 1), ("holding", 9), ("coil", 7)
WRITES = {5: "coil", 15: "coil", 6: "holding", 16: "holding"}


class Slow(ModbusTcpEnd):
    """A server that does something when it is asked, before it answers, and remembers what it was asked."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[str, int]] = []
        self.when: Callable[[tuple[str, int]], None] = lambda _: None

    async def _asked(
        self,
        function: int,
        start: int,
        first: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        one = (WRITES.get(function, "read"), first)
        self.asked.append(one)
        self.when(one)
        return await super()._asked(function, start, first, count, registers, values)


class Cell(Nobody):
    """Who has one command, and is told when a connection may be written to."""

    def __init__(self, *, is_latched: bool = False) -> None:
        self.is_latched = is_latched
        self.waiting: list[Writes] = []
        self.asked_when_ready: list[int] = []
        self.end = Slow()

    def ready(self) -> None:
        """It may."""
        self.asked_when_ready.append(len(self.end.asked))

    def next_writes(self) -> Writes | None:
        """The command."""
        return self.waiting.pop() if self.waiting else None


def stopped(cell: Cell, when: Callable[[tuple[str, int], Kept], bool]) -> tuple[Kept, list[tuple[str, int]]]:
    """What a device was asked from the moment on at which it is stopped: when this is so of what it is asked."""
    end = cell.end

    async def main() -> Kept:
        await end.start(lambda _, __: None)
        options = modbus.TcpOptions(host="127.0.0.1", port=end.port, every_s=0)
        document = parse_binding(BINDING).document.devices["D"]
        kept = Kept(document, modbus.TCP, options, Wanted(BLOCKS, document.timeout_s), cell)

        def look(one: tuple[str, int]) -> None:
            if not kept.stopping and when(one, kept):
                end.asked.clear()
                kept.stop()

        end.when = look
        end.faults.delay_s = ANSWER_S
        await asyncio.wait((asyncio.create_task(kept.run()),), timeout=PATIENCE_S)
        await end.stop()
        return kept

    return asyncio.run(main()), end.asked


def test_a_stop_waits_for_the_answer_to_a_heartbeat_and_not_for_a_new_connection() -> None:
    kept, asked = stopped(Cell(), lambda one, kept: one == BEAT and kept.connections == 1)
    assert kept.is_safe
    assert kept.connections == 1
    assert SAFE in asked[:2], "behind the one question at most that has waited before"


def test_a_stop_writes_the_safe_outputs_before_a_new_connection_is_asked_anything() -> None:
    cell = Cell()
    cell.waiting.append((("coil 7", True),))
    kept, asked = stopped(cell, lambda one, _: one == GO)
    assert kept.is_safe
    assert asked[0] == SAFE
    assert len(cell.asked_when_ready) == 1, "nobody is told that the second connection may be written to"


def test_after_an_emergency_stop_a_connection_begins_with_the_safe_outputs_and_is_ready_when_it_was_read() -> None:
    cell = Cell(is_latched=True)
    seen: list[tuple[str, int]] = []

    def when(one: tuple[str, int], kept: Kept) -> bool:
        seen.append(one)
        return kept.connections == 1

    stopped(cell, when)
    assert seen[: 1 + len(BLOCKS)] == [SAFE, *seen[1 : 1 + len(BLOCKS)]]
    assert {kind for kind, _ in seen[1 : 1 + len(BLOCKS)]} == {"read"}
    assert SAFE not in seen[1:]
    assert cell.asked_when_ready == [1 + len(BLOCKS)]


def test_a_stop_does_not_wait_until_a_new_connection_was_read() -> None:
    cell, reads = Cell(), list[tuple[str, int]]()

    def when(one: tuple[str, int], kept: Kept) -> bool:
        reads.append(one)
        return kept.connections == 0 and len(reads) == 3

    kept, asked = stopped(cell, when)
    assert kept.is_safe
    assert SAFE in asked[:2], "behind the one question at most that has waited before"
