"""The log of a run: few lines, each with what happened, how much it matters, and when."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support.cells import decomposition_of, plant_of

from firable.cli.log import log_to
from firable.cli.main import main
from firable.executor import Conduct, Host, SimulatedCell, State, Watch, execute
from firable.executor.cell.disturbances import NeverCompletes
from firable.executor.drivers.bench import PATIENCE_S
from firable.executor.operating.log import Log, logger_to
from firable.executor.operating.situation import Situation
from firable.nets.diagnostics import InputError
from firable.semantics.trace import Noted


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def test_a_log_tells_how_a_run_began_and_ended_and_what_failed_with_what_waits_for_what() -> None:
    stream = io.StringIO()
    report = execute(
        decomposition_of("one_robot"),
        SimulatedCell(plant_of("one_robot"), workpieces=2, disturbances=[NeverCompletes("MC", "CLAMP", 1)]),
        Conduct(overdue_seconds=60.0, watch=Watch.IGNORE, log=Log(logger_to(logging.StreamHandler(stream)))),
    )
    assert report.state is State.FAULT
    told = lines(stream.getvalue())
    assert [(line["level"], line["event"]) for line in told] == [
        ("info", "began"),
        ("error", "fault"),
        ("error", "ended"),
    ]
    assert told[0]["machines"] == ["the coordinator", "system", "robot", "mc", "conveyor"]
    assert "is overdue" in told[1]["message"]
    assert any("waits for mc.clamped" in sentence for sentence in told[2]["blocked"])
    assert all(line["time"].endswith("Z") for line in told)


def test_logs_of_two_runs_do_not_write_into_each_other() -> None:
    streams = io.StringIO(), io.StringIO()
    logs = [Log(logger_to(logging.StreamHandler(stream))) for stream in streams]
    logs[0].seen(Noted(1.0, "lost", {"message": "'robot' is lost"}))
    assert lines(streams[0].getvalue())[0]["level"] == "warning"
    assert not streams[1].getvalue()


def wait_for_line(path: Path) -> None:
    """Wait until the thread that writes has written a line."""
    end = time.monotonic() + PATIENCE_S
    while not (path.exists() and path.read_text().endswith("\n")):
        assert time.monotonic() < end, "nothing is written"
        time.sleep(0.01)


def test_a_log_that_is_rotated_goes_on_in_a_new_file(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    with log_to(str(path)) as log:
        assert log is not None
        log.began("cell", ["robot"])
        wait_for_line(path)
        path.rename(tmp_path / "run.log.1")
        log.ended(Situation(State.STOPPED, ("robot.free",)))
    assert [line["event"] for line in lines(path.read_text())] == ["ended"]


def test_a_log_that_breaks_is_told_once_and_ends_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    with log_to(str(folder / "run.log")) as log:
        assert log is not None
        log.began("cell", ["robot"])
        wait_for_line(folder / "run.log")
        (folder / "run.log").unlink()
        folder.rmdir()
        for _ in range(3):
            log.ended(Situation(State.STOPPED, ()))
    assert capsys.readouterr().err.count("cannot be written any more") == 1


def test_a_log_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught, log_to(str(tmp_path / "none" / "run.log")):
        pass
    assert caught.value.diagnostics[0].code == "F1017"


def test_the_command_writes_the_log_that_it_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle = str(tmp_path / "cell.bundle")
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    assert main(["run", bundle, "--workpieces", "1", "--log", str(tmp_path / "run.log")]) == 0
    capsys.readouterr()
    assert [line["event"] for line in lines((tmp_path / "run.log").read_text())] == ["began", "ended"]


def test_a_run_that_an_error_ends_says_so_in_its_log() -> None:
    class Full(io.StringIO):
        def write(self, line: str) -> int:
            if "G1" in line:
                raise OSError("no space left")
            return super().write(line)

    stream = io.StringIO()
    log = Log(logger_to(logging.StreamHandler(stream)))
    with pytest.raises(OSError, match="no space left"):
        execute(
            decomposition_of("one_robot"),
            SimulatedCell(plant_of("one_robot"), workpieces=1),
            Conduct(trace=Full(), log=log),
        )
    assert [(line["event"], line.get("message")) for line in lines(stream.getvalue())][1:] == [
        ("broke", "no space left")
    ]


def test_a_run_that_is_refused_before_it_begins_leaves_no_log(tmp_path: Path) -> None:
    path = tmp_path / "run.log"
    with log_to(str(path)):
        pass
    assert not path.exists(), "it is opened when there is something to tell"
    with log_to(str(path)) as log:
        assert log is not None
        log.ended(Situation(State.STOPPED, ()))
    assert lines(path.read_text())[0]["event"] == "ended"


@pytest.mark.parametrize("option", ["--log", "--trace"])
def test_a_pipe_that_nobody_reads_is_refused_at_once_and_one_that_is_read_is_written(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle, pipe = str(tmp_path / "cell.bundle"), tmp_path / "pipe"
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    os.mkfifo(pipe)
    command = [sys.executable, "-m", "firable.cli", "run", bundle, "--workpieces", "1", option, str(pipe)]
    refused = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert refused.returncode == 2
    assert "error[F1017]" in refused.stderr
    assert "it is a pipe that nobody reads" in refused.stderr
    assert "start who reads it before the run" in refused.stderr
    reading = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True)
    keeping = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # or the run might come before the reader
    try:
        subprocess.run(command, capture_output=True, check=True, timeout=PATIENCE_S)
        said, _ = reading.communicate(timeout=PATIENCE_S)
    finally:
        os.close(keeping)
        reading.kill()
    written = lines(said)
    assert [line.get("event") for line in written] == ["began", "ended"] if option == "--log" else len(written) > 9


def test_an_error_that_a_library_lets_fall_is_a_line_of_the_log_and_no_traceback_at_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    def let_fall() -> None:
        raise asyncio.CancelledError  # which no `except Exception` of a library takes

    async def operator(_: Host) -> None:
        asyncio.get_running_loop().call_soon(let_fall)

    path = tmp_path / "run.log"
    with log_to(str(path)) as log:
        execute(
            decomposition_of("one_robot"),
            SimulatedCell(plant_of("one_robot"), workpieces=1, speed=1000.0),
            Conduct(watch=Watch.IGNORE, operator=operator, log=log),
        )
    (told,) = [line for line in lines(path.read_text()) if line["event"] == "unhandled"]
    assert told["level"] == "warning"
    assert "an error that nobody has handled: Exception in callback" in told["message"]
    assert "CancelledError: executor/test_log.py, line " in told["message"]
    assert not caplog.records
    assert "Traceback" not in capfd.readouterr().err
