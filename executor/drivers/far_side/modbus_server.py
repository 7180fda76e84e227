"""A Modbus server of points, by pymodbus: in a network, or on a pseudo-terminal for RTU.

Values are kept here and brought into the server's registers when they are asked for, so that a value that is shown is
seen by the next request and not by the one after it. What was never shown or written is 0.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from firable.executor.drivers.device import Point, Value, quiet
from firable.executor.drivers.far_side.end import Faults
from firable.executor.drivers.far_side.line import LineEnd, PseudoLine
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.modbus_points import BITS, Address, address

REGISTERS = 256
"""How many addresses each table has."""

_TABLES = {1: "coil", 5: "coil", 15: "coil", 2: "discrete", 4: "input", 3: "holding", 6: "holding", 16: "holding"}
"""The table of each function code."""


class ModbusServer:
    """A Modbus server of points, without its transport."""

    def __init__(self) -> None:
        quiet("pymodbus")
        self.faults = Faults()
        self.shown: dict[tuple[str, int], int] = {}
        self.written: Callable[[Point, Value], None] = lambda _point, _value: None
        self.turn = asyncio.Lock()
        """A device does one thing after the other, where pymodbus would do them all at a time."""

    def show(self, point: Point, value: Value) -> None:
        """Show a value to whoever reads it."""
        one = address(point)
        key = (one.table, one.number)
        if one.bit is None:
            self.shown[key] = int(value) & 0xFFFF
        else:
            mask = 1 << one.bit
            self.shown[key] = self.shown.get(key, 0) & ~mask | mask * bool(value)

    def device(self, unit: int = 0) -> SimDevice:
        """The tables of a unit, 0 for whichever is asked, which are filled as they are asked for."""
        bits = [SimData(0, count=REGISTERS // 16, values=0, datatype=DataType.BITS)]
        registers = [SimData(0, count=REGISTERS, values=0, datatype=DataType.REGISTERS)]
        return SimDevice(unit, (bits, bits, registers, registers), action=self._asked)

    def garble(self, sending: bool, data: bytes) -> bytes:
        """What goes out instead of a frame, where answers are garbled."""
        return bytes(byte ^ 0x5A for byte in data) if sending and self.faults.garbage else data

    async def _asked(
        self,
        function: int,
        _start: int,
        first: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        async with self.turn:
            if self.faults.delay_s:
                await asyncio.sleep(self.faults.delay_s)
            while self.faults.silent:
                await asyncio.sleep(0.01)
        table = _TABLES[function]
        for offset, value in enumerate(values or ()):
            self.shown[table, first + offset] = int(value)
            one = Address(table, first + offset)
            self.written(f"{one.table} {one.number}", bool(value) if table in BITS else int(value))
        if table in BITS:
            low = first // 16
            for at in range(low, low + count):
                registers[at] = sum(self.shown.get((table, 16 * at + i), 0) << i for i in range(16))
        else:
            registers[first : first + count] = [self.shown.get((table, first + i), 0) for i in range(count)]
        return None


class ModbusTcpEnd(ModbusServer):
    """A Modbus server in the network of this host; `port` 0 takes a free one.

    It is the device itself, or what stands before the devices of these `units`.
    """

    def __init__(self, port: int = 0, units: Collection[int] = ()) -> None:
        super().__init__()
        self.port = port or free_port()
        self.units = {unit: ModbusUnit(self) for unit in units}
        self.server: ModbusTcpServer | None = None

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve."""
        self.written = written
        await self.mend()

    async def stop(self) -> None:
        """End, and close all connections."""
        await self.cut()

    async def cut(self) -> None:
        """Close all connections, and take no new ones."""
        if self.server is not None:
            end: Callable[[], Awaitable[None]] = self.server.shutdown
            await end()
            self.server = None

    async def mend(self) -> None:
        """Take connections again, at the same port."""
        if self.server is not None:
            return
        devices = [one.device(unit) for unit, one in self.units.items()] or self.device()
        self.server = ModbusTcpServer(devices, address=("127.0.0.1", self.port), trace_packet=self.garble)
        try:
            await self.server.serve_forever(background=True)
        except RuntimeError as error:  # of which pymodbus says neither the address nor the reason
            raise RuntimeError(f"cannot listen at 127.0.0.1:{self.port}, where something else may") from error


class ModbusUnit(ModbusServer):
    """One of several devices behind one address, each with tables of its own."""

    def __init__(self, before: ModbusTcpEnd) -> None:
        super().__init__()
        self.before = before
        self.faults = before.faults

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve, all that are behind the address."""
        self.written = written
        await self.before.mend()

    async def stop(self) -> None:
        """End, and close all connections."""
        await self.before.cut()

    async def cut(self) -> None:
        """Close all connections, and take no new ones."""
        await self.before.cut()

    async def mend(self) -> None:
        """Take connections again."""
        await self.before.mend()


class ModbusRtuEnd(LineEnd, ModbusServer):
    """A Modbus server at one end of a pseudo-line; the driver takes the other end, or a `link` to it."""

    def __init__(self, link: str = "") -> None:
        super().__init__()
        self.line = PseudoLine(link)
        self.server: ModbusSerialServer | None = None

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        """Begin to serve."""
        self.written = written
        self.line.open()
        self.server = ModbusSerialServer(
            self.device(), port=self.line.far, baudrate=115_200, trace_packet=self.garble, reconnect_delay=0
        )
        await self.server.serve_forever(background=True)

    async def stop(self) -> None:
        """End, and close the line."""
        if self.server is not None:
            end: Callable[[], Awaitable[None]] = self.server.shutdown
            await end()
            self.server = None
        self.line.close()
