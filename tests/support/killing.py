"""Runs a cell in processes that are killed (SIGKILL), each taken up by the next, until the work is done.

    python killing.py FOLDER CELL WORKPIECES SEED [SPEED]

Each process kills itself at a moment drawn from the seed: before, within or after any act, sync, line of the trace,
input of the simulated cell. Between two processes the cell goes on for a while. The last line of the output is JSON:
how many were killed, and how the last one ended. It is a process of its own because it forks.

At a SPEED, and not in virtual time, the syncs are those of the cell's host: on a thread, on a disk that takes its time,
while the acts go on, and either may be at the moment that is the last. After each kill the trace must be what the
journal says of it; how many were killed while a sync was under way is told, too.
"""

import json
import os
import random
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from support.cells import decomposition_of, plant_of

from firable.executor.cell.cell_log import CellLog
from firable.executor.cell.plant import Plant
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.journal import Storing
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.operating import groups
from firable.executor.operating.acts import Acts
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.recorder import KEY, TRACE, Recorder, TraceFile, size_bytes_of
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.protocol.deciders import coordinators

LIVES_MAX = 300


class Moments:
    """The moments of a process, one after the other; at one of them it is killed."""

    def __init__(self, last: int, folder: Path) -> None:
        self.left = last
        self.lock = threading.Lock()
        self.storing = folder / "storing"
        """There while a sync is under way on its thread."""
        self.chance = 1.0
        """Of the process to be killed at each moment from the last one on."""
        self.draw = random.Random(last)

    def pass_(self) -> None:
        with self.lock:
            self.left -= 1
            if self.left <= 0 and (self.chance == 1 or (self.storing.exists() and self.draw.random() < self.chance)):
                os.kill(os.getpid(), signal.SIGKILL)

    def while_storing(self) -> None:
        """Before, between and after journal and trace, on a disk that takes its time; every other life ends there."""
        if self.left % 2:
            self.chance = 0.3

        def store(storing: list[Storing]) -> None:
            self.storing.touch()
            for one in storing:
                self.pass_()
                with self.lock:
                    seconds = self.draw.choice([0.0, 0.001, 0.01]) * self.draw.random()
                time.sleep(seconds)
                one()
            self.pass_()
            self.storing.unlink()

        groups._store = store

    def around(self, owner: type, name: str) -> None:
        """Before and after each call of a method."""
        original: Callable[..., Any] = getattr(owner, name)

        def watched(*arguments: Any, **named: Any) -> Any:
            self.pass_()
            result = original(*arguments, **named)
            self.pass_()
            return result

        setattr(owner, name, watched)

    def within_lines(self) -> None:
        """In the middle of a line of the trace, and of a line of the cell's log."""
        write_line = TraceFile.write

        def write(file: TraceFile, line: str) -> None:
            if self.left <= 1 and self.chance == 1:
                write_line(file, line[: len(line) // 2])
                file.flush()
            self.pass_()
            write_line(file, line)

        add_input = CellLog.add

        def add(log: CellLog, at_seconds: float, what: str, *arguments: str | int) -> None:
            if self.left <= 1 and self.chance == 1:
                os.write(log.descriptor, b'[1.5, "se')
            self.pass_()
            add_input(log, at_seconds, what, *arguments)

        for owner, name, instead in ((TraceFile, "write", write), (CellLog, "add", add)):
            setattr(owner, name, instead)


def live(folder: Path, cell: str, workpieces: int, seed: int, last: int, speed: float | None = None) -> None:
    """One process: until it is killed, or the run ends."""
    moments = Moments(last, folder)
    for owner, name in (
        (Acts, "act"),
        (SqliteJournal, "sync"),
        (SqliteJournal, "_bear_witness"),
        (Recorder, "writing"),
        (Recorder, "written"),
        (SimulatedDriver, "_input"),
    ):
        moments.around(owner, name)
    moments.within_lines()
    if speed is not None:
        moments.while_storing()
    report = execute(
        decomposition_of(cell),
        SimulatedCell(plant_of(cell), workpieces=workpieces, seed=seed, speed=speed),
        Conduct(trace=folder / "trace.jsonl", journal_path=folder / "cell.journal", resume=True),
        digest="d",
    )
    (folder / "report.json").write_text(json.dumps(report.to_json()))


def cell_goes_on(folder: Path, cell: str, workpieces: int, seed: int, seconds: float) -> None:
    """What happens in the cell while nobody controls it."""
    with suppress(FileNotFoundError):
        if (folder / "cell.journal.cell").stat().st_size:
            log = CellLog(folder / "cell.journal.cell", plant_of(cell), workpieces, seed)
            plant = Plant(plant_of(cell), workpieces=workpieces, seed=seed)
            SimulatedDriver(plant, decomposition_of(cell).net, log)._input(log.end_seconds + seconds, "advance")
            log.close()


def demand_agreement(folder: Path, cell: str) -> None:
    """The trace goes as far as the journal says, and what stands behind that is what the journal has for there."""
    net = decomposition_of(cell)
    if not (folder / "cell.journal").exists():
        return
    names = (*coordinators(net), *(subnet.name for subnet in net.subnets))
    with closing(SqliteJournal(folder / "cell.journal", "d", names)) as journal:
        kept = journal.kept(TRACE).get(KEY)
    if isinstance(kept, dict):
        written, lines = (folder / "trace.jsonl").read_bytes(), str(kept["lines"]).encode()
        behind = written[size_bytes_of(kept) :]
        assert len(written) >= size_bytes_of(kept), "the trace has lost lines"
        assert behind.startswith(lines) or lines.startswith(behind), "the trace tells something else than the journal"
        beside = behind[len(lines) :]  # sensors that have opened nothing
        assert b'"fired"' not in beside, "the trace tells what the disk has not"


def main(folder: Path, cell: str, workpieces: int, seed: int, speed: float | None = None) -> dict[str, Any]:
    """Lives until one of them ends the run."""
    draw = random.Random(seed)
    decomposition_of(cell), plant_of(cell)
    while_storing = 0
    for killed in range(LIVES_MAX):
        last = draw.choice([draw.randint(1, 60), draw.randint(1, 400), draw.randint(1, 2000)])
        if child := os.fork():
            _, status = os.waitpid(child, 0)
            if os.WIFEXITED(status):
                report = folder / "report.json"
                said = {"killed": killed, "while storing": while_storing, "code": os.WEXITSTATUS(status)}
                return {**said, **json.loads(report.read_text("utf-8"))}
            while_storing += (folder / "storing").exists()
            (folder / "storing").unlink(missing_ok=True)
            demand_agreement(folder, cell)
        else:
            code = 1
            try:
                live(folder, cell, workpieces, seed, last, speed)
                code = 0
            finally:
                sys.stderr.flush()
                if code:
                    import traceback

                    traceback.print_exc()
                    (folder / "report.json").write_text("{}")
                os._exit(code)
        if draw.random() < 0.7:
            cell_goes_on(folder, cell, workpieces, seed, draw.choice([0.0, 1.0, 30.0]) * draw.random())
    raise SystemExit("no end")


if __name__ == "__main__":
    folder, cell, workpieces, seed, *speed = sys.argv[1:]
    said = main(Path(folder), cell, int(workpieces), int(seed), *map(float, speed))
    sys.stdout.write(json.dumps(said) + "\n")
