"""`firable io`: how it ends, with what verdict, and what it leaves to others."""

import asyncio
import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from importlib.metadata import EntryPoint
from itertools import count
from pathlib import Path
from typing import cast

import pytest
from serial import Serial
from support import third_party_driver
from support.asking import heard
from support.third_party_driver import MemoryConnection, MemoryEnd, MemoryKind, MemoryOptions
from support.waiting import PATIENCE_SECONDS

from firable.cli import live_io
from firable.cli.main import main as firable
from firable.executor.drivers import kinds, serial_line
from firable.executor.drivers.bench import until
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.cancelling import ended
from firable.executor.drivers.device import InUseError, LinkError, Point, Value, Wanted, Writes
from firable.executor.drivers.driver import Quality, Reading
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.far_side.serial_device import SerialEnd
from firable.executor.drivers.sparing import Sparing

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


async def terminated(
    process: asyncio.subprocess.Process, stream: asyncio.StreamReader | None, told: bytes
) -> tuple[int | None, str]:
    """Ask it to end when it has told this on a stream; its exit code, and its last words."""
    assert stream is not None
    line = b""
    while told not in line:
        line = await asyncio.wait_for(stream.readline(), PATIENCE_SECONDS)
    process.send_signal(signal.SIGTERM)
    _, said = await asyncio.wait_for(process.communicate(), PATIENCE_SECONDS)
    return process.returncode, said.decode().splitlines()[-1]


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


PRESSED = """
firable_bind: 1
cell: arm
devices:
  bench:
    driver: simulated
    shows: {button: 1, key: 1}
    effects: {A MOVE: {seconds: 0.1, then: {button: 0}}}
    grace_s: 60
    channels: {A: {command: A, taken: A.taken, done: A.done, failed: A.failed}}
    safe: {stop: 1}
emergency_stop: {button: {device: bench, read: button}}
signals: {a.key: {device: bench, read: key, on_loss: hold}}
commands: {a.away: {device: bench, channel: A, force: true}}
"""


@pytest.mark.parametrize("until_when", [("--for", "30"), ("--once",)], ids=lambda option: option[0])
def test_what_was_read_before_an_emergency_stop_is_not_shown_as_what_is_now(
    until_when: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
    net.write_text(NET)
    bind.write_text(PRESSED)
    command = ["io", str(bind), "--net", str(net), "--send", "a.away", "--format", "json", *until_when]
    assert firable(command) == 1
    said = capsys.readouterr()
    last = json.loads(said.out.splitlines()[-1])
    assert last["devices"] == {"bench": {"connected": False}}
    shown = {name: (one["value"], one["quality"], one["why"]) for name, one in last["signals"].items()}
    why = "the emergency stop has ended the sending"
    assert shown == {"a.key": (True, "uncertain", why), "emergency stop button": (False, "bad", why)}
    assert last["at_seconds"] < 25
    assert "emergency stop: bench: 'button' is open" in said.err
    assert said.err.splitlines()[-1] == "the emergency stop has ended the sending, and nothing is read any more"


IN_USE = """
firable_bind: 1
cell: arm
devices:
  line: {driver: KIND, port: PORT, start_s: 30}
signals: {a.key: {device: line, read: POINT, on_loss: hold}}
"""


@pytest.mark.parametrize(("kind", "point"), [("serial", "key"), ("modbus-rtu, parity: N", "coil 1")])
@pytest.mark.parametrize("until_when", [("--once",), ("--for", "40")], ids=lambda option: option[0])
def test_line_that_another_program_has_is_left_to_it_at_once(
    kind: str, point: str, until_when: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far, near = os.openpty()
    port, bind = os.ttyname(near), tmp_path / "line.bind.yaml"
    bind.write_text(IN_USE.replace("KIND", kind).replace("PORT", port).replace("POINT", point))
    begun = time.monotonic()
    with Serial(port, exclusive=True):
        assert firable(["io", str(bind), *until_when]) == 2
    assert time.monotonic() - begun < 25
    said = f"Error: 'line' is left to the program that has its line: {port}: another program has it open"
    assert capsys.readouterr().err.splitlines() == [said]
    os.close(near)
    os.close(far)


def test_who_sends_by_hand_does_not_wait_for_a_line_of_another_program_to_stop_its_machines(tmp_path: Path) -> None:
    far, near = os.openpty()
    net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
    net.write_text(NET)
    bind.write_text(BIND.replace("PORT", f"{os.ttyname(near)}, timeout_s: 30"))
    begun = time.monotonic()
    with Serial(os.ttyname(near), exclusive=True):
        assert firable(["io", str(bind), "--net", str(net), "--send", "a.away"]) == 2
    assert time.monotonic() - begun < 25
    os.close(near)
    os.close(far)


def test_who_sends_by_hand_beside_a_running_cell_is_refused_before_its_machines_are_stopped(tmp_path: Path) -> None:
    net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
    net.write_text(NET)
    written: list[Point] = []

    async def main() -> tuple[int | None, str]:
        end = ModbusTcpEnd()
        await end.start(lambda point, _: written.append(point))
        device = (
            f"{{driver: modbus-tcp, host: 127.0.0.1, port: {end.port}, heartbeat: {{write: holding 0, every_s: 0.2}}"
        )
        channel = "channels: {A: {number: holding 11, taken: input 10}}"
        text = BIND.replace("{driver: serial, port: PORT, safe: {out: 0}", f"{device}, safe: {{coil 0: true}}")
        text = text.replace("channels: {A: {command: move, taken: taken}}", channel)
        bind.write_text(text.replace("read: key", "read: discrete 1"))

        async def run() -> None:
            for beat in count():
                end.show("holding 0", beat)
                await asyncio.sleep(0.01)

        beating = asyncio.create_task(run())
        try:
            process = await io(bind, "--net", str(net), "--send", "a.away", "--once")
            _, said = await asyncio.wait_for(process.communicate(), PATIENCE_SECONDS)
        finally:
            await ended([beating])
            await end.stop()
        return process.returncode, said.decode()

    code, said = asyncio.run(main())
    assert (code, written) == (2, [])
    assert "error[F5106]: another program sends the heartbeat of 'line'" in said


def test_line_that_was_found_in_use_is_not_asked_for_again() -> None:
    far, near = os.openpty()
    port = os.ttyname(near)
    told: list[str] = []
    kind = Sparing(serial_line.KIND, told.append)

    async def refusal() -> str:
        with pytest.raises(InUseError) as refused:
            await kind.connect(serial_line.SerialOptions(port=port), Wanted((), 5.0))
        return str(refused.value)

    with Serial(port, exclusive=True):
        assert asyncio.run(refusal()) == f"{port}: another program has it open"
    assert asyncio.run(refusal()) == f"{port}: another program has it open"  # and is free
    assert told == [f"{port}: another program has it open"]
    os.close(near)
    os.close(far)


class Refusing(MemoryConnection):
    """A connection to a device that shows a key, and takes nothing."""

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """Show the key, and nothing afterwards."""
        if self.is_first:
            self.is_first = False
            return [("key", 0)]
        return await super().read()

    async def write(self, writes: Writes) -> None:
        """Refuse it."""
        ASKED.append(writes)
        raise LinkError("it does not take that")


class RefusingKind(MemoryKind):
    """The kind of such devices."""

    async def connect(self, options: MemoryOptions, wanted: Wanted) -> MemoryConnection:
        """Reach one."""
        return Refusing(MemoryEnd(options.memory), wanted.timeout_s)


ASKED: list[Writes] = []
FORCED = """
firable_bind: 1
cell: arm
devices:
  bench: {driver: theirs, memory: refusing, retry_s: 0.02, start_s: 0.5, grace_s: 60}
signals: {a.key: {device: bench, read: key, force: true}}
"""


@pytest.mark.parametrize("until_when", [("--for", "2"), ("--once",)], ids=lambda option: option[0])
def test_value_that_a_device_refuses_is_written_once_and_an_error_at_the_end(
    until_when: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
    monkeypatch.setattr(third_party_driver, "KIND", RefusingKind())
    bind = tmp_path / "arm.bind.yaml"
    bind.write_text(FORCED)
    ASKED.clear()
    assert firable(["io", str(bind), "--force", "a.key=1", *until_when]) == 1
    assert ASKED == [(("key", True),)]
    said = capsys.readouterr().err.splitlines()
    assert [line for line in said if "error" in line] == said[-1:]
    assert said[-1] == "error: --force a.key=1 was not written: it does not take that"


def test_command_for_a_device_that_is_not_there_is_not_sent_and_an_error_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
    net.write_text(NET)
    bind.write_text(BIND.replace("port: PORT", "port: /dev/nobody-is-here, start_s: 0.2"))
    assert firable(["io", str(bind), "--net", str(net), "--send", "a.away", "--for", "1"]) == 1
    why = "line is not connected: /dev/nobody-is-here: No such file or directory"
    assert capsys.readouterr().err.splitlines()[-1] == f"error: --send a.away was not taken: {why}"


def test_command_is_an_error_also_when_io_is_asked_to_end_before_its_device_was_there(tmp_path: Path) -> None:
    net, bind = tmp_path / "arm.firable.yaml", tmp_path / "arm.bind.yaml"
    net.write_text(NET)
    bind.write_text(BIND.replace("port: PORT", "port: /dev/nobody-is-here, start_s: 60"))

    async def main() -> tuple[int | None, str]:
        with heard(signal.SIGTERM):
            process = await io(bind, "--net", str(net), "--send", "a.away")
        return await terminated(process, process.stderr, b"not connected")

    why = "it was asked to end before the devices were there"
    assert asyncio.run(main()) == (1, f"error: --send a.away was not taken: {why}")


def test_value_that_could_not_be_written_is_an_error_also_when_io_is_asked_to_end(tmp_path: Path) -> None:
    bind = tmp_path / "arm.bind.yaml"
    bind.write_text(FORCED.replace("driver: theirs, memory: refusing", "driver: serial, port: /dev/nobody-is-here"))

    async def main() -> tuple[int | None, str]:
        with heard(signal.SIGTERM):
            process = await io(bind, "--force", "a.key=1")
        return await terminated(process, process.stdout, b"a.key")  # when its start is over

    why = "bench is not connected: /dev/nobody-is-here: No such file or directory"
    assert asyncio.run(main()) == (1, f"error: --force a.key=1 was not written: {why}")


class Shown:
    """A driver as the table sees it."""

    def readings(self) -> dict[str, Reading]:
        """A sensor."""
        return {"a.key": Reading(value=True, quality=Quality.GOOD, why="")}


@pytest.mark.parametrize(("columns", "lines"), [(80, 2), (42, 3), (20, 5)])
def test_table_is_written_over_the_one_before_also_where_a_narrow_terminal_has_broken_its_lines(
    columns: int, lines: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    table, driver = live_io._Heard(), cast("BoundDriver", Shown())
    monkeypatch.setattr(table, "now_seconds", lambda: 0.5)
    for _ in range(2):
        table.show(driver)
    drawn = capsys.readouterr().out
    assert drawn.count("\x1b[J") == 1
    assert f"\x1b[{lines}F\x1b[J" in drawn
