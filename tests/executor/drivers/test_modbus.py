"""Modbus over TCP and over a serial line, against servers of pymodbus."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from firable.executor.drivers.bench import Far
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.far_side.modbus_server import ModbusRtuEnd, ModbusTcpEnd

POINTS = {
    "sensor": "discrete 0",
    "closed": "discrete 1",
    "button": "discrete 2",
    "tripped": "discrete 5",
    "output": "coil 3",
    "beat": "holding 0",
    "code": "holding 10",
    "number": "holding 11",
    "taken": "input 10",
    "done": "input 11",
    "failed": "input 12",
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
