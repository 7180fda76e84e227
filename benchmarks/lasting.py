"""Whether a day of a cell is as its first hour: 24 simulated hours, with no drift of anything that is counted.

The cell runs in virtual time without jitter, so all its cycles are alike, and the time of the n-th workpiece is that of
the first and n - 1 cycles, to the rounding of a sum. What must not grow is measured an hour and a day long: the memory
of the process, the journal, and the messages and firings for a workpiece. The log of the simulated cell grows, and is
no part of a real one.
"""

from __future__ import annotations

import re
import resource
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from measuring import Table, timed

from firable.decompose.splitting.cut import split
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.running import RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import parse_plant

NAME: Final = "one_robot"
DAY_SECONDS: Final = 24 * 3600
FIRST: Final = 20


@dataclass(frozen=True)
class Lasted:
    """A run: its report, its processor seconds, and the journal and the most memory afterwards, in kilobytes."""

    report: RunReport
    seconds: float
    journal_kb: float
    memory_kb: int


def lasted(workpieces: int) -> Lasted:
    """Let a cell without jitter finish so many workpieces, with a journal on disk."""
    net = catalogue_net(NAME)
    text = catalogue_path(NAME).with_name(f"{NAME}.plant.yaml").read_text("utf-8")
    plant = parse_plant(re.sub(r", jitter_s: [0-9.]+", "", text))
    with tempfile.TemporaryDirectory() as folder:
        journal = Path(folder) / "journal"
        cell, conduct = SimulatedCell(plant, workpieces), Conduct(journal_path=journal)
        work = partial(execute, split(net), cell, conduct, digest=NAME)
        report, seconds = timed(work)
        if report.state is not State.DONE:
            raise RuntimeError(f"the run has not come to its end: {report.situation.message}")
        return Lasted(
            report, seconds, journal.stat().st_size / 1024, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        )


def cycle_seconds() -> float:
    """The time between two workpieces, once the cell is full."""
    one, other = (lasted(FIRST * n).report.simulated_seconds for n in (1, 2))
    return (other - one) / FIRST


def drift_seconds(run: Lasted, first: Lasted, cycle: float) -> float:
    """How much later a run has ended than its cycles say."""
    more = len(run.report.delivered) - len(first.report.delivered)
    return run.report.simulated_seconds - first.report.simulated_seconds - more * cycle


def tables(repeat: int) -> list[Table]:
    """An hour and a day."""
    del repeat  # it is long, and compared to itself
    cycle = cycle_seconds()
    first = lasted(FIRST)
    rows = []
    for words, seconds in (("an hour", 3600), ("a day", DAY_SECONDS)):
        run = lasted(int(seconds / cycle) + 1)
        report, count = run.report, len(run.report.delivered)
        rows.append(
            (
                words,
                f"{report.simulated_seconds / 3600:.2f}",
                f"{count:,}",
                f"{run.seconds:.0f}",
                f"{drift_seconds(run, first, cycle):+.6f}",
                f"{sum(report.firings.values()) / count:.3f}",
                f"{report.messages / count:.2f}",
                f"{run.journal_kb:.0f}",
                f"{run.memory_kb / 1024:.1f}",
            )
        )
    columns = (
        *("run", "simulated hours", "workpieces", "processor seconds", "drift, s", "firings for each"),
        *("messages for each", "journal, KB", "memory, MB"),
    )
    about = (
        f"`catalogue:{NAME}` in virtual time without jitter, one process, journal on disk; a cycle is {cycle:.3f} s."
    )
    return [Table("A day of a cell", about, columns, tuple(rows))]
