"""Lines of text over a pair of pseudo-terminals."""

import asyncio
import os
import subprocess
import sys
import tty
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from serial import Serial

from firable.executor.drivers import modbus, serial_line
from firable.executor.drivers.bench import PATIENCE_S, Far, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.conformance import DriverConformance
from firable.executor.drivers.device import LinkError, Wanted
from firable.executor.drivers.far_side.line import PseudoLine
from firable.executor.drivers.far_side.machine import ROLES
from firable.executor.drivers.far_side.serial_device import SerialEnd
from firable.executor.drivers.keeping import Kept, Nobody


class TestSerialLine(DriverConformance):
    @asynccontextmanager
    async def far_end(self) -> AsyncIterator[Far]:
        end = SerialEnd()
        end.line.open()
        points = {role: f"M.{role}" for role in (*ROLES, "command")}
        yield Far(end, f"driver: serial, port: {end.line.near}", points)


def test_a_link_to_a_line_replaces_that_of_a_line_which_went_with_its_process_and_no_other(tmp_path: Path) -> None:
    async def main() -> None:
        line = PseudoLine(str(link := tmp_path / "robot.line"))
        line.open()
        near, gone = Path(line.near), Path(line.near).with_name("987654")
        line.close()
        assert not link.is_symlink()
        for left in (gone, near):  # the system gives the same terminal again
            link.symlink_to(left)
            line.open()
            assert link.readlink() == Path(line.near)
            line.close()
        link.symlink_to(unplugged := tmp_path / "ttyUSB0")
        with pytest.raises(OSError, match="cannot be made to lead to a line: File exists"):
            line.open()
        assert link.readlink() == unplugged

    asyncio.run(main())


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


@pytest.mark.parametrize("kind", [serial_line.KIND, modbus.RTU], ids=["serial", "modbus-rtu"])
def test_a_line_that_takes_nothing_holds_nobody_up(kind: Any) -> None:
    """In a process of its own, which can be ended where it is held up."""
    parity = {} if kind is serial_line.KIND else {"parity": "N"}
    point = "a" if kind is serial_line.KIND else "discrete 0"
    program = f"""
import asyncio, os, tty
from contextlib import suppress
from firable.executor.drivers import modbus, serial_line
from firable.executor.drivers.device import Wanted

async def main():
    far, near = os.openpty()
    tty.setraw(near)
    os.set_blocking(near, False)
    with suppress(BlockingIOError):
        while True:
            os.write(near, 1000 * b"x")
    kind = {"serial_line.KIND" if kind is serial_line.KIND else "modbus.RTU"}
    connection = await kind.connect(kind.options(port=os.ttyname(near), **{parity}), Wanted(({point!r},), 0.1))
    try:
        await connection.read()
    except Exception as error:
        print(type(error).__name__)
    await connection.close()

asyncio.run(main())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.stdout.strip() in {"TimeoutError", "LinkError"}, done.stderr


@pytest.mark.parametrize("line", [b"\0a=1*6D\n", b"a=\x001*6D\n", b"a=1\0*6D\n"])
def test_a_zero_byte_that_the_check_value_does_not_show_is_damage(line: bytes) -> None:
    """Else a break on the line would hide what a sensor shows, and its last value would be good."""

    async def main() -> None:
        far, near = os.openpty()
        tty.setraw(near)
        with Serial(os.ttyname(near), timeout=0) as port:
            lines = serial_line.Lines(port)
            os.write(far, b"a=1*6D\n" + line)
            assert await asyncio.wait_for(lines.get(), PATIENCE_S) == "a=1"
            with pytest.raises(LinkError, match="a damaged line"):
                await asyncio.wait_for(lines.get(), PATIENCE_S)
            lines.close()
        os.close(far)
        os.close(near)

    asyncio.run(main())


class Latched(Nobody):
    """Whose device is latched, and is ready at some time."""

    is_latched = True

    def __init__(self) -> None:
        self.is_ready = False

    def ready(self) -> None:
        """It is."""
        self.is_ready = True


def test_all_safe_outputs_of_a_latched_device_are_confirmed_though_it_tells_the_rest_meanwhile() -> None:
    """Lines are confirmed by being read, and there is more to be read than one answer."""
    points = ("o1", "o2", "o3")
    written: list[str] = []

    async def main() -> None:
        end, latched = SerialEnd(), Latched()
        end.line.open()
        await end.start(lambda point, _: written.append(point))
        end.show("s", value=1)
        text = f"driver: serial, port: {end.line.near}, safe: {{{', '.join(f'{one}: 0' for one in points)}}}"
        document = parse_binding(f"{{firable_bind: 1, cell: c, devices: {{D: {{{text}}}}}}}").document.devices["D"]
        options = serial_line.SerialOptions(port=str(end.line.near))
        kept = Kept(document, serial_line.KIND, options, Wanted(("s",), document.timeout_s), latched)
        task = asyncio.create_task(kept.run())
        await until(lambda: latched.is_ready, "the connection")
        assert kept.connections == 1
        assert tuple(written) == points
        kept.stop()
        await task
        await end.stop()

    asyncio.run(main())
