"""A host that did not run for a while takes that time for nobody's silence."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from support.served_cells import unhurried
from support.waiting import PATIENCE_SECONDS, heard_in_time, until

from firable.cli.main import main as firable
from firable.executor.drivers.far_side.ends import binding_text
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.links.lending import LendingLoop
from firable.executor.own_time import COUNTED_SECONDS, OwnTimeLoop
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import read_plant
from firable.semantics.trace import CommandSent, Fired, Noted, SignalChanged, read_trace

FREEZE_SECONDS = 1.5
SLACK_SECONDS = 0.6
"""How much later than that a busy machine may be, and less than the freeze."""


@pytest.fixture(params=[OwnTimeLoop, LendingLoop])
def loop_of(request: pytest.FixtureRequest) -> Callable[[], OwnTimeLoop]:
    kind: Callable[[], OwnTimeLoop] = request.param
    return kind


def test_the_time_of_a_loop_stands_still_while_it_does_not_listen(loop_of: Callable[[], OwnTimeLoop]) -> None:
    told: list[float] = []

    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, OwnTimeLoop)
        loop.listening.thawed = told.append
        before, real = loop.time(), time.monotonic()
        loop.call_soon(time.sleep, FREEZE_SECONDS)
        await asyncio.sleep(0.01)
        await asyncio.sleep(0.01)
        assert time.monotonic() - real >= FREEZE_SECONDS
        assert loop.time() - before < COUNTED_SECONDS + SLACK_SECONDS
        before = loop.time()
        await asyncio.sleep(0.6)  # longer than the loop goes without listening
        assert loop.time() - before >= 0.6

    with asyncio.Runner(loop_factory=loop_of) as runner:
        runner.run(main())
    assert told
    assert max(told) >= FREEZE_SECONDS - 0.1


def test_what_has_come_meanwhile_is_heard_before_a_time_limit_is_over(loop_of: Callable[[], OwnTimeLoop]) -> None:
    async def main() -> bytes:
        near, far = socket.socketpair()
        reader, writer = await asyncio.open_connection(sock=near)
        question = asyncio.create_task(_line(reader))
        await asyncio.sleep(0)
        asyncio.get_running_loop().call_soon(time.sleep, FREEZE_SECONDS)
        threading.Timer(FREEZE_SECONDS / 2, far.sendall, [b"done\n"]).start()
        try:
            return await question
        finally:
            writer.close()
            far.close()

    async def _line(reader: asyncio.StreamReader) -> bytes:
        async with asyncio.timeout(1.0):
            await asyncio.sleep(0.02)
            return await reader.readline()

    with asyncio.Runner(loop_factory=loop_of) as runner:
        assert runner.run(main()) == b"done\n"


def test_a_timer_that_another_thread_begins_as_the_loop_thaws_is_in_time() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, LendingLoop)
        rung = asyncio.Event()

        def lent() -> None:
            assert loop.lend(lambda: loop.call_later(0.01, rung.set))

        def thaw() -> None:  # on a thread, while the loop waits: as if the process had been stopped
            with loop._letting_go.lock:
                loop.listening.looked_seconds -= 30
            lent()

        thread = threading.Thread(target=thaw)
        loop.call_later(0.05, thread.start)
        await asyncio.wait_for(rung.wait(), 5)
        thread.join()

    with asyncio.Runner(loop_factory=LendingLoop) as runner:
        runner.run(main())


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot freeze a process")
def test_a_machine_that_was_in_time_is_not_late_for_a_host_that_was_frozen(tmp_path: Path) -> None:
    net, bind = catalogue_net("one_robot_timed"), tmp_path / "cell.bind.yaml"
    sensors = read_plant(catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml")).sensors
    text = unhurried(binding_text(net, {"modbus": str(free_port())}, sensors))
    bind.write_text("\n".join(line for line in text.split("\n") if "heartbeat" not in line))
    bundle, trace = tmp_path / "cell.bundle", tmp_path / "trace.jsonl"
    assert firable(["bundle", "catalogue:one_robot_timed", "-o", str(bundle)]) == 0
    command = [sys.executable, "-u", "-m", "firable.cli"]
    serve = ["sim", "catalogue:one_robot_timed", "--bind", str(bind), "--speed", "4", "--workpieces", "1"]
    cell = subprocess.Popen([*command, *serve], stdout=subprocess.PIPE, text=True)
    run: subprocess.Popen[bytes] | None = None
    try:
        assert cell.stdout is not None
        with heard_in_time(cell):
            assert any("serving" in line for line in cell.stdout)
        run = subprocess.Popen([*command, "run", str(bundle), "--bind", str(bind), "--trace", str(trace)])
        until(lambda: trace.exists() and '"command": "robot.to_cv1"' in trace.read_text(), "the command")
        os.kill(run.pid, signal.SIGSTOP)
        time.sleep(5.5)  # longer than the limit of 5 s; the machine takes half a second
        os.kill(run.pid, signal.SIGCONT)
        until(lambda: '"robot.to_cv1_timeout"' in trace.read_text() or '"t1-a"' in trace.read_text(), "its end")
        run.terminate()
        assert run.wait(PATIENCE_SECONDS) == 0
    finally:
        cell.kill()
        cell.communicate()
        if run is not None:
            run.kill()
            run.communicate()
    events = read_trace(trace).events
    assert [e.data["message"][:28] for e in events if isinstance(e, Noted) and e.note == "frozen"] == [
        "this process did not run for"
    ]
    assert [e.transitions for e in events if isinstance(e, Fired)][2] == ("t1-a",)
    assert not [e for e in events if isinstance(e, SignalChanged) and e.signal == "robot.to_cv1_overdue" and e.value]
    assert [e.place for e in events if isinstance(e, CommandSent)].count("robot.to_cv1") == 1
