"""What `check` decides on the public nets that are too large for the tests; it must never contradict what is known.

The nets are not part of the repository: `FIRABLE_NETS` names their folder, and without it there is a table that says
so. Each net is checked by itself, in a process of its own, so that the memory of one is not the limit of the next.
The verdicts and numbers of markings to compare with are those that the model-checking contest published; an empty cell
is one that `check` left unknown, and a contradiction ends the run.
"""

from __future__ import annotations

import csv
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from measuring import Table

from firable.analysis.check import check
from firable.analysis.spaces.reachability import Budget
from firable.nets.pnml import read_pnml
from firable.nets.verdict import Status, spelled

FOLDER: Final = os.environ.get("FIRABLE_NETS", "")
SECONDS_MAX: Final = 5.0
MEMORY_BYTES_MAX: Final = 6 << 30
TESTED_MARKINGS_MAX: Final = 3_000_000
"""Nets with fewer markings are in the tests, with all their figures."""
VERDICTS: Final = {
    "contact-free": "contest_one_safe",
    "deadlock-free": "contest_deadlock",
    "quasi-live": "contest_quasi_live",
    "live": "contest_live",
}
"""Our verdicts, and the column that holds the published one."""
GOOD: Final = {"contact-free": "TRUE", "deadlock-free": "FALSE", "quasi-live": "TRUE", "live": "TRUE"}
"""What a published verdict says where ours is proved."""

Row = dict[str, str]


@dataclass(frozen=True)
class Checked:
    """What `check` said of a net."""

    places: int
    markings: int | None
    statuses: dict[str, str]
    seconds: float
    method: str


def known_to_be_safe() -> list[Row]:
    """The rows of `expected.tsv` of nets that are known to be 1-safe."""
    with (Path(FOLDER) / "expected.tsv").open(encoding="utf-8", newline="") as stream:
        table = csv.DictReader(stream, delimiter="\t")
        return [row for row in table if "yes" in row["one_safe"] or row["contest_one_safe"] == "TRUE"]


def rows() -> list[Row]:
    """Those that are not in the tests."""
    return [row for row in known_to_be_safe() if not 0 < int(row["markings_contact_rule"] or 0) <= TESTED_MARKINGS_MAX]


def checked(file: str) -> Checked:
    """Check one net, within the limits."""
    net = read_pnml(Path(FOLDER) / file).net
    start = time.process_time()
    report = check(net, budget=Budget(markings=1 << 32, seconds=SECONDS_MAX, memory_bytes=MEMORY_BYTES_MAX))
    seconds = time.process_time() - start
    whole = report.space.complete
    return Checked(
        places=len(net.places),
        markings=report.space.n_markings if whole else None,
        statuses={name: str(report.verdict(name).status) for name in VERDICTS},
        seconds=seconds,
        method=report.space.method if whole else "",
    )


def contradictions(row: Row, found: Checked) -> list[str]:
    """Where a verdict or the number of markings differs from what was published."""
    differing = []
    if row["contest_markings"] and found.markings is not None and found.markings != int(row["contest_markings"]):
        differing.append(f"{found.markings} markings, and {row['contest_markings']} published")
    for name, column in VERDICTS.items():
        published, status = row[column], found.statuses[name]
        if published in {"TRUE", "FALSE"} and status != Status.UNKNOWN:
            agrees = (status == Status.PROVED) == (published == GOOD[name])
            differing += [] if agrees else [f"{name} is {status}, and {column} {published}"]
    return differing


def tables(_repeat: int) -> list[Table]:
    """One row for each net, and a last one that counts what was decided."""
    columns = ("net", "places", "markings", *VERDICTS, "seconds", "all markings held by")
    about = (
        f"What `check` decides within {SECONDS_MAX:.0f} s by the clock and {MEMORY_BYTES_MAX >> 30} GiB for each "
        "net; an empty cell is unknown. Processor seconds, of both cores. No verdict and no number contradicts the "
        "published ones."
    )
    if not FOLDER:
        return [Table("Public nets", "Not run: FIRABLE_NETS names no folder of public nets.", columns, ())]
    lines: list[tuple[str, ...]] = []
    counts = dict.fromkeys(("markings", *VERDICTS), 0)
    for row in rows():
        with ProcessPoolExecutor(max_workers=1) as pool:
            found = pool.submit(checked, row["file"]).result()
        if differing := contradictions(row, found):
            raise SystemExit(f"{row['file']}: {'; '.join(differing)}")
        decided = {name: status for name, status in found.statuses.items() if status != Status.UNKNOWN}
        for name in decided:
            counts[name] += 1
        counts["markings"] += found.markings is not None
        lines.append(
            (
                Path(row["file"]).stem, f"{found.places:,}", "" if found.markings is None else spelled(found.markings),
                *(decided.get(name, "") for name in VERDICTS), f"{found.seconds:.1f}", found.method,
            )
        )  # fmt: skip
    lines.append((f"{len(lines)} nets", "", *(str(count) for count in counts.values()), "", ""))
    return [Table("Public nets", about, columns, tuple(lines))]
