"""Lines of text over a pair of pseudo-terminals."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from serial import Serial

from firable.executor.drivers import modbus, serial_line
from firable.executor.drivers.bench import Far
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.device import LinkError, Wanted
from firable.executor.drivers.far_side.line import PseudoLine
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.serial_device import SerialEnd


class TestSerialLine(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        end = SerialEnd()
        end.line.open()
        points = {role: f"M.{role}" for role in (*ROLES, "command")}
        yield Far(end, f"driver: serial, port: {end.line.near}", points)


@pytest.mark.parametrize("kind", [serial_line.KIND, modbus.RTU], ids=["serial", "modbus-rtu"])
def test_a_port_that_cannot_be_had_is_told_with_the_reason_in_words(kind: Any) -> None:
    async def refusal(port: str) -> str:
        with pytest.raises(LinkError) as refused:
            await kind.connect(kind.options(port=port), Wanted((), 5.0))
        return str(refused.value)

    async def main() -> None:
        line = PseudoLine()
        line.open()
        with Serial(line.near, exclusive=True):
            assert await refusal(line.near) == f"{line.near}: another program has it open"
        assert await refusal("/dev/nobody-is-here") == "/dev/nobody-is-here: No such file or directory"
        assert await refusal("/dev/null") == "/dev/null: this is no serial port"
        line.close()

    asyncio.run(main())
