"""Runs a cell in processes that are killed (SIGKILL), each taken up by the next, until the work is done.

    python killing.py FOLDER CELL WORKPIECES SEED

Each process kills itself at a moment drawn from the seed: before, within or after any act, sync, line of the trace,
input of the simulated cell. Between two processes the cell goes on for a while. The last line of the output is JSON:
how many were killed, and how the last one ended. It is a process of its own because it forks.
"""

import json
import os
import random
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from support.cells import decomposition_of, plant_of

from firable.executor.cell.cell_log import CellLog
from firable.executor.cell.plant import Plant
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.operating.acts import Acts
from firable.executor.operating.recorder import Recorder, TraceFile
from firable.executor.operating.running import execute

LIVES_MAX = 300


class Moments:
    """The moments of a process, one after the other; at one of them it is killed."""

    def __init__(self, last: int) -> None:
        self.left = last

    def pass_(self) -> None:
        self.left -= 1
        if self.left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

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
            if self.left == 1:
                write_line(file, line[: len(line) // 2])
                file.flush()
            self.pass_()
            write_line(file, line)

        add_input = CellLog.add

        def add(log: CellLog, at_seconds: float, what: str, *arguments: str | int) -> None:
            if self.left == 1:
                os.write(log.descriptor, b'[1.5, "se')
            self.pass_()
            add_input(log, at_seconds, what, *arguments)

        for owner, name, instead in ((TraceFile, "write", write), (CellLog, "add", add)):
            setattr(owner, name, instead)


def live(folder: Path, cell: str, workpieces: int, seed: int, last: int) -> None:
    """One process: until it is killed, or the run ends."""
    moments = Moments(last)
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
    report = execute(
        decomposition_of(cell),
        plant_of(cell),
        workpieces=workpieces,
        seed=seed,
        trace=folder / "trace.jsonl",
        journal_path=folder / "cell.journal",
        digest="d",
        resume=True,
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


def main(folder: Path, cell: str, workpieces: int, seed: int) -> dict[str, Any]:
    """Lives until one of them ends the run."""
    draw = random.Random(seed)
    decomposition_of(cell), plant_of(cell)
    for killed in range(LIVES_MAX):
        last = draw.choice([draw.randint(1, 60), draw.randint(1, 400), draw.randint(1, 2000)])
        if child := os.fork():
            _, status = os.waitpid(child, 0)
            if os.WIFEXITED(status):
                report = folder / "report.json"
                return {"killed": killed, "code": os.WEXITSTATUS(status), **json.loads(report.read_text("utf-8"))}
        else:
            code = 1
            try:
                live(folder, cell, workpieces, seed, last)
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
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))) + "\n")
