"""How a run has ended is its exit code: whether all is well, or somebody has to look."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.waiting import PATIENCE_SECONDS, heard_in_time, until

from firable.cli.main import main
from firable.cli.simulated_run import _verdicts
from firable.executor import RunReport
from firable.executor.operating.situation import Situation, State
from firable.nets.verdict import Status

NET = """\
firable: 1
cell: cell
controllers:
  robot: {start: free, places: {free: , working: {send: {machine: R, command: WORK}, until: worked}}}
transitions:
  begin: {from: robot.free, to: robot.working}
  end: {from: robot.working, to: robot.free}
"""
BINDING = """\
firable_bind: 1
cell: cell
devices:
  R: {driver: simulated, seconds: 600, channels: {R: {command: R, taken: R.taken, done: R.done, failed: R.failed}}}
signals: {robot.worked: acknowledged}
commands: {robot.working: {device: R, channel: R, write: {}}}
"""


def firable(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-u", "-m", "firable.cli", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def test_a_run_on_machines_that_is_stopped_while_it_is_held_ends_as_one_that_somebody_has_to_look_at(
    tmp_path: Path,
) -> None:
    net, bind, bundle, trace = (tmp_path / name for name in ("cell.firable.yaml", "bind", "cell.bundle", "trace"))
    net.write_text(NET)
    bind.write_text(BINDING)
    assert main(["bundle", str(net), "-o", str(bundle)]) == 0
    run = ["run", str(bundle), "--bind", str(bind), "--journal", str(tmp_path / "journal"), "--trace", str(trace)]
    running = firable(*run)
    held = None
    try:
        until(lambda: trace.exists() and '"command"' in trace.read_text(), "a command")
        running.kill()
        running.wait()
        held = firable(*run, "--serve", "127.0.0.1:0")
        assert held.stdout is not None
        with heard_in_time(held):
            next(line for line in held.stdout if "is held, until it is resumed" in line)
        held.send_signal(signal.SIGTERM)
        said, _ = held.communicate(timeout=PATIENCE_SECONDS)
        assert held.returncode == 3, said
        assert "'R WORK' of 'robot.working' was issued, and nobody knows what became of it" in said
        assert "--say robot.working=done" in said, "there is nobody left who is served"
        assert re.search(r"  0 firings, .* since it was taken up at \d+ s\n", said)
    finally:
        for process in (running, held):
            if process is not None:
                process.kill()
                process.communicate()


@pytest.mark.parametrize(
    ("through", "situation", "status"),
    [
        (2, Situation(State.STOPPED, (), message="stopped at the end of the cycle"), Status.PROVED),
        (1, Situation(State.STOPPED, (), message="stopped at the end of the cycle"), Status.UNKNOWN),
        (2, Situation(State.STOPPED, (), message="emergency stop: a person", is_emergency=True), Status.UNKNOWN),
        (2, Situation(State.STOPPED, (), message="stopped; it was held", is_held=True), Status.UNKNOWN),
    ],
)
def test_a_run_that_was_stopped_when_all_workpieces_were_through_has_carried_them_through(
    through: int, situation: Situation, status: Status
) -> None:
    report = RunReport(situation, tuple(range(1, through + 1)), (), (), (), {}, 0, 0, {}, 1.0)
    carried = _verdicts(report, 2, 0, is_kept=True)[0]
    assert carried.status is status
    told = {Status.PROVED: "", Status.UNKNOWN: situation.message if through == 2 else "1 went through"}
    assert carried.bound == told[status]


def test_a_run_that_ends_held_is_told_to_say_what_became_of_commands_only_with_a_journal() -> None:
    situation = Situation(State.HELD, (), message="the run was interrupted", is_held=True)
    report = RunReport(situation, (1,), (), (), (), {}, 0, 0, {}, 1.0)
    with_journal, without = (_verdicts(report, 2, 0, is_kept=kept)[0] for kept in (True, False))
    assert with_journal.status is without.status is Status.UNKNOWN
    assert "`--say`" in with_journal.hint
    assert without.hint == "name a --journal: then a run that is held can be taken up"
