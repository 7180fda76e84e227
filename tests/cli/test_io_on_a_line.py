"""`firable io` on a serial line: how it ends, and what it leaves to others."""

import asyncio
import signal
import sys
from pathlib import Path

import pytest
from support.asking import heard
from support.waiting import PATIENCE_SECONDS

from firable.executor.drivers.bench import until
from firable.executor.drivers.device import Point, Value
from firable.executor.drivers.far_side.serial_device import SerialEnd

NET = """
firable: 1
cell: arm
controllers:
  a:
    start: home
    inputs: [key]
    places: {home: , away: {send: {machine: A, command: MOVE}}}
transitions:
  go:   {from: a.home, to: a.away, if: a.key}
  back: {from: a.away, to: a.home}
"""
BIND = """
firable_bind: 1
cell: arm
devices:
  line: {driver: serial, port: PORT, safe: {out: 0}, channels: {A: {command: move, taken: taken}}}
signals: {a.key: {device: line, read: key}}
commands: {a.away: {device: line, channel: A, force: true}}
"""


async def io(bind: Path, *arguments: str) -> asyncio.subprocess.Process:
    command = [sys.executable, "-m", "firable.cli", "io", str(bind), *arguments]
    pipe = asyncio.subprocess.PIPE
    return await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe, stderr=pipe)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_machine_that_was_sent_something_is_stopped_however_io_is_asked_to_end(
    number: signal.Signals, tmp_path: Path
) -> None:
    written: list[tuple[Point, Value]] = []

    async def main() -> None:
        end = SerialEnd()

        def take(point: Point, value: Value) -> None:
            written.append((point, value))
            if point == "move":
                end.show("taken", str(value).partition(" ")[0])

        await end.start(take)
        end.show("key", value=True)
        end.show("taken", 0)
        net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
        net.write_text(NET)
        bind.write_text(BIND.replace("PORT", str(end.line.near)))
        with heard(number):
            process = await io(bind, "--net", str(net), "--send", "a.away")
        try:
            await until(lambda: len(written) == 2, "the command")
            process.send_signal(number)
            await asyncio.wait_for(process.communicate(), PATIENCE_SECONDS)
        finally:
            if process.returncode is None:
                process.kill()
            await end.stop()
        assert process.returncode == 0

    asyncio.run(main())
    assert written == [("out", "0"), ("move", "1 A MOVE"), ("out", "0")]
