"""A run on real sockets is killed again and again: the machines are asked first, and get each command once."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

from support.served_cells import unhurried
from support.waiting import PATIENCE_SECONDS, heard_in_time

from firable.cli.main import main
from firable.executor.drivers.far_side.ends import binding_text
from firable.executor.drivers.far_side.ports import free_port
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import read_plant
from firable.semantics.replaying import replay
from firable.semantics.trace import CommandSent, Noted, read_trace

NET = catalogue_net("one_robot")
PLANT = read_plant(catalogue_path("one_robot").with_name("one_robot.plant.yaml"))
COMMAND = re.compile(r"^ *[\d.]+ s  ([A-Z]\w* [A-Z].*)$")
KILLS_AFTER = (1, 3, 2, 4)
"""So many more commands the machines have got each time."""


def firable(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-u", "-m", "firable.cli", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Cell:
    """A cell in a process of its own, and what it has told so far."""

    def __init__(self, bind: Path) -> None:
        self.process = firable(
            "sim", "catalogue:one_robot", "--bind", str(bind), "--workpieces", "1", "--speed", "8", "--seed", "3"
        )
        self.commands: list[str] = []
        self.until(lambda line: "serving" in line)

    def until(self, last: object) -> None:
        assert self.process.stdout is not None
        assert callable(last)
        with heard_in_time(self.process):
            for line in self.process.stdout:
                if (found := COMMAND.match(line)) is not None:
                    self.commands.append(found[1].strip())
                if last(line):
                    return
        raise AssertionError("the cell has ended")


def test_run_that_is_killed_while_its_machines_work_asks_them_and_doubles_no_command(tmp_path: Path) -> None:
    bundle, bind, trace = (str(tmp_path / name) for name in ("cell.bundle", "cell.bind.yaml", "trace"))
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    text = unhurried(binding_text(NET, {"modbus": str(free_port())}, PLANT.sensors))
    # Machines that go on while nobody is there: without a heartbeat, and without outputs that stop them at a start.
    Path(bind).write_text("\n".join(line for line in text.split("\n") if not re.match(r" *(heartbeat|safe):", line)))
    run = ["run", bundle, "--bind", bind, "--trace", trace, "--journal", str(tmp_path / "journal"), "--resume"]
    cell = Cell(Path(bind))
    running = None
    try:
        for more in KILLS_AFTER:
            running, due = firable(*run), len(cell.commands) + more
            cell.until(lambda _, due=due: len(cell.commands) >= due)
            running.kill()
            running.communicate()
        running = firable(*run)
        cell.until(lambda line: "workpiece 1 is carried out" in line)
        running.send_signal(signal.SIGINT)
        said, _ = running.communicate(timeout=PATIENCE_SECONDS)
        assert running.returncode == 0, said
    finally:
        for process in (cell.process, running):
            if process is not None:
                process.kill()
                process.communicate()
    written = read_trace(trace)
    assert replay(NET, written).complete
    sent = Counter(str(NET.place(each.place).command) for each in written.events if isinstance(each, CommandSent))
    got = Counter(cell.commands)
    assert all(got[command] <= sent[command] for command in got), "a machine gets a command that was not sent, or twice"
    assert sum((sent - got).values()) <= 1, "one at most is on its way when the run ends"
    notes = [event for event in written.events if isinstance(event, Noted)]
    assert [note.note for note in notes].count("restarted") == len(KILLS_AFTER)
    asked = [note.data["answer"] for note in notes if note.note == "asked after"]
    assert asked
    assert set(asked) <= {"done", "working", "not received"}
