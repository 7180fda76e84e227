"""The emergency stop that is wired: a contact opens, and the machines stand, whatever has become of the coordinator."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.waiting import PATIENCE_SECONDS, heard_in_time, until

from firable.cli.main import main
from firable.executor.drivers.far_side.machine import Machine
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.far_side.ports import free_port
from firable.semantics.trace import Noted, read_trace

NET = """\
firable: 1
cell: cell
controllers:
  a: {start: free, inputs: key, places: {free: , lamp: {send: {machine: A, command: OPEN}}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  hand: {from: [a.free, b.idle], to: [a.lamp, b.has], if: a.key}
  back: {from: [a.lamp, b.has], to: [a.free, b.idle], unless: a.key}
"""
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
BINDING = """\
firable_bind: 1
cell: cell
devices:
  plc:
    driver: modbus-tcp
    host: 127.0.0.1
    port: {port}
    timeout_s: 30  # a loss would be an emergency stop of its own
    start_s: 60
    safe: {{coil 3: false}}
    channels: {{A: {{number: holding 11, taken: input 10}}}}
emergency_stop:
  button: {{device: plc, read: discrete 2}}
signals:
  a.key: {{device: plc, read: discrete 0, on_loss: hold}}
commands:
  a.lamp: {{device: plc, channel: A, write: {{holding 10: 1}}}}
"""


class Lamp:
    """A machine behind Modbus TCP, in a thread of its own."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever)
        self.thread.start()
        self.end = ModbusTcpEnd()
        self.machine = Machine(self.end, POINTS)
        self.run(self.machine.start())

    def run(self, work: object) -> None:
        assert asyncio.iscoroutine(work)
        asyncio.run_coroutine_threadsafe(work, self.loop).result(PATIENCE_SECONDS)

    def show(self, role: str, *, value: bool) -> None:
        self.loop.call_soon_threadsafe(lambda: self.machine.show(role, value))

    def close(self) -> None:
        self.run(self.machine.stop())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join()
        self.loop.close()


@pytest.fixture
def lamp() -> Iterator[Lamp]:
    made = Lamp()
    yield made
    made.close()


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("bundle")
    (folder / "cell.firable.yaml").write_text(NET)
    assert main(["bundle", str(folder / "cell.firable.yaml"), "-o", str(folder / "cell.bundle")]) == 0
    return str(folder / "cell.bundle")


def started(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "firable.cli", "run", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@pytest.mark.parametrize("coordinator", ["in the same process", "frozen", "killed"])
def test_open_contact_stops_the_machines_of_its_controller_and_the_run_stays_stopped(
    coordinator: str, bundle: str, lamp: Lamp, tmp_path: Path
) -> None:
    bind, trace, journal = tmp_path / "cell.bind.yaml", tmp_path / "trace", tmp_path / "journal"
    bind.write_text(BINDING.format(port=lamp.end.port))
    log = tmp_path / "log"
    mine = [bundle, "--bind", str(bind), "--journal", str(journal), "--log", str(log)]
    at = f"tcp/127.0.0.1:{free_port()}"
    if coordinator != "in the same process":
        mine += ["--controller", "a", "--join", at]
    processes = [started(*mine, "--trace", str(trace))]
    try:
        if coordinator != "in the same process":
            processes.append(started(bundle, "--controller", "b", "--coordinator", "--listen", at, "--dry-run", "0"))
        until(lambda: lamp.machine.outputs == [False], "the start")
        lamp.show("sensor", value=True)
        until(lambda: lamp.machine.orders, "a command that both controllers had to agree on")
        if coordinator == "frozen":
            os.kill(processes[1].pid, signal.SIGSTOP)
        elif coordinator == "killed":
            processes[1].kill()
        lamp.show("button", value=False)
        until(lambda: len(lamp.machine.outputs) == 2, "the safe outputs")
        lamp.show("button", value=True)
        said, _ = processes[0].communicate(timeout=PATIENCE_SECONDS)
        assert processes[0].returncode == 3, said
        assert "emergency stop: plc: 'button' is open" in said
        assert (lamp.machine.outputs, len(lamp.machine.orders)) == ([False, False], 1)
        notes = [event for event in read_trace(trace).events if isinstance(event, Noted)]
        assert [note.data["reason"] for note in notes if note.note == "emergency stop"] == ["plc: 'button' is open"]
        told = [json.loads(line) for line in log.read_text().splitlines()]
        levels = {line["event"]: line["level"] for line in told}
        assert (levels["emergency stop"], levels["ended"]) == ("error", "error")
        # Started again with the button pressed it ends at once, whatever the operator says.
        lamp.show("button", value=False)
        again = started(*mine, "--resume")
        processes.append(again)
        said, _ = again.communicate(timeout=PATIENCE_SECONDS)
        assert again.returncode == 3, said
        assert "emergency stop: plc: 'button' is open" in said
        assert len(lamp.machine.orders) == 1
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_host_whose_coordinator_is_dead_is_latched_by_its_contact_and_goes_on_when_it_is_reset_and_resumed(
    bundle: str, lamp: Lamp, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind, token, log = tmp_path / "cell.bind.yaml", str(tmp_path / "token"), tmp_path / "log"
    bind.write_text(BINDING.format(port=lamp.end.port))
    serve = ["--serve", f"127.0.0.1:{free_port()}", "--token-file", token, "--log", str(log)]
    mine, at = [bundle, "--bind", str(bind), *serve], f"tcp/127.0.0.1:{free_port()}"
    other = [bundle, "--controller", "b", "--coordinator", "--listen", at, "--dry-run", "0"]
    other += ["--journal", str(tmp_path / "journal")]
    mine += ["--controller", "a", "--join", at]

    def operate(*command: str) -> str:
        main(["operate", f"http://{serve[1]}", *command, "--token-file", token])
        return capsys.readouterr().out

    processes = [started(*mine), started(*other)]
    try:
        until(lambda: lamp.machine.outputs == [False], "the start")
        lamp.show("sensor", value=True)
        until(lambda: lamp.machine.orders, "a command that both controllers had to agree on")
        processes[1].kill()
        lamp.show("button", value=False)
        until(lambda: len(lamp.machine.outputs) >= 3, "the safe outputs, by the stop and by the next connection")
        until(lambda: "before it can be reset: plc: 'button' is not closed" in operate("situation"), "the latch")
        assert "refused: plc: 'button' is not closed" in operate("reset")
        assert "firable_latched 1.0" in operate("metrics")
        lamp.show("button", value=True)
        until(lambda: "it can be reset\n  then nothing moves" in operate("situation"), "that it may be reset")
        assert operate("resume").startswith("refused: the run is latched")
        assert operate("reset").startswith("held")
        processes.append(started(*other, "--resume"))
        lamp.show("sensor", value=False)  # then they may take it back, and do it again
        assert len(lamp.machine.orders) == 1, "nothing moves by a reset"
        until(lambda: not operate("resume").startswith("refused"), "the resumption")
        until(lambda: "a.free" in operate("situation").splitlines()[1], "a transition of both")
        lamp.show("sensor", value=True)
        until(lambda: len(lamp.machine.orders) == 2, "the next command")
        assert processes[0].poll() is None
        told = [json.loads(line)["event"] for line in log.read_text().splitlines()]
        assert [event for event in told if event in {"emergency stop", "not reset", "reset", "taken up"}] == [
            "emergency stop",
            "not reset",
            "reset",
            "taken up",
        ]
        operate("stop")
        processes[0].communicate(timeout=PATIENCE_SECONDS)
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_person_at_the_terminal_is_asked_for_the_reset_as_soon_as_the_contact_opens(
    bundle: str, lamp: Lamp, tmp_path: Path
) -> None:
    bind = tmp_path / "cell.bind.yaml"
    bind.write_text(BINDING.format(port=lamp.end.port))
    command = [sys.executable, "-m", "firable.cli", "run", bundle, "--bind", str(bind), "--step"]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT, text=True)

    def asked(*words: str, end: str = ": ") -> None:
        """All of this is said, and then something is asked."""
        assert process.stdout is not None
        said = ""
        with heard_in_time(process):
            while not (said.endswith(end) and all(word in said for word in words)):
                character = process.stdout.read(1)
                assert character, said
                said += character

    def typed(line: str) -> None:
        assert process.stdin is not None
        process.stdin.write(f"{line}\n")
        process.stdin.flush()

    try:
        lamp.show("sensor", value=True)
        asked("hand", "[s] stop now")
        lamp.show("button", value=False)
        asked("button' is open", "type reset")
        assert lamp.machine.outputs[-1] is False
        typed("reset")
        asked("not reset: plc: 'button' is not closed", "type reset")
        lamp.show("button", value=True)
        asked(end="it can be reset; then nothing moves until it is resumed\n")
        assert lamp.machine.outputs.count(False) > 2, "the safe outputs of the next connection"
        typed("reset")
        asked("nothing moves until it is resumed", "take the run up")
        typed("")
        lamp.show("sensor", value=False)
        typed("r")
        asked("back", "[s] stop now")
        assert len(lamp.machine.orders) == 1
        typed("s")
        said, _ = process.communicate(timeout=PATIENCE_SECONDS)
        assert process.returncode == 0, said
    finally:
        process.kill()
        process.communicate()
