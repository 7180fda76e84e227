"""Lines of text over a pair of pseudo-terminals."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from firable.executor.drivers.bench import Far
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.serial_device import SerialEnd


class TestSerialLine(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        end = SerialEnd()
        end.line.open()
        points = {role: f"M.{role}" for role in (*ROLES, "command")}
        yield Far(end, f"driver: serial, port: {end.line.near}", points)
