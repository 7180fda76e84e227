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

PUSHED = """\
firable: 1
cell: pushed
controllers:
  belt:
    start: empty
    inputs: part_there
    places:
      empty:
      pushing: {send: {machine: PUSHER, command: PUSH}, until: pushed}
      loaded:
      clearing: {send: {machine: BELT, command: RUN}, until: cleared}
transitions:
  first: {from: belt.empty, to: belt.pushing, if: belt.part_there}
  lies: {from: belt.pushing, to: belt.loaded}
  next: {from: belt.loaded, to: belt.clearing, if: belt.part_there}
  clear: {from: belt.clearing, to: belt.pushing}
"""
PUSHING = """\
firable_plant: 1
plant: pushed
stations: [entry, table, exit]
arrivals: {station: entry, every_s: 8}
departures: {station: exit, after_s: 1}
machines:
  PUSHER: {commands: {PUSH: {does: carry, from: entry, to: table, takes_s: 1}}}
  BELT: {commands: {RUN: {does: carry, from: table, to: exit, takes_s: 1, when_full: wait}}}
sensors: {belt.part_there: {occupied: SEES}}
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


def test_where_the_last_workpiece_waits_for_another_one_that_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, bundle, plant = tmp_path / "cell.firable.yaml", tmp_path / "cell.bundle", tmp_path / "cell.plant.yaml"
    net.write_text(PUSHED, "utf-8")
    plant.write_text(PUSHING.replace("SEES", "entry"), "utf-8")
    assert main(["bundle", str(net), "-o", str(bundle)]) == 0
    run = ["run", str(bundle), "--plant", str(plant), "--workpieces", "3"]
    assert main(run) == 1
    said = capsys.readouterr().out
    assert "2 workpieces carried through, 0 lost, 0 doubled, 1 still inside" in said
    assert "about: 1 of 3 workpieces stays inside until another one comes, next waits for belt.part_there" in said
    assert "where each workpiece is pushed on by the next one, the last stay inside" in said
    plant.write_text(PUSHING.replace("SEES", "table"), "utf-8")  # so that nothing is seen to come
    assert main([*run[:-1], "1"]) == 1
    assert "about: first waits for belt.part_there" in capsys.readouterr().out
