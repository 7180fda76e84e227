"""What `check` decides of the contest's formulas on public nets; it must never contradict what is known.

The nets and formulas are not part of the repository: `FIRABLE_NETS` names their folder, and without it there is a table
that says so. Each file of formulas is checked by itself, in a process of its own, and nothing else is asked of the net.
The values to compare with are those that the model-checking contest published; a contradiction ends the run.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Final

from measuring import Table
from public_nets import FOLDER, MEMORY_BYTES_MAX, Row, known_to_be_safe

from firable.analysis.check import check
from firable.analysis.spaces.reachability import Budget
from firable.nets.pnml import read_pnml
from firable.nets.queries import QueryKind, read_queries
from firable.nets.verdict import Status, Verdict

SECONDS_MAX: Final = 8.0
EXAMINATIONS: Final = (
    "ReachabilityCardinality",
    "ReachabilityFireability",
    "CTLCardinality",
    "CTLFireability",
    "LTLCardinality",
    "LTLFireability",
    "UpperBounds",
)

Values = Mapping[tuple[str, str, int], str]
"""What was published, by net, examination and the number of the formula."""


def published() -> Values:
    """All values that were published."""
    with (Path(FOLDER) / "queries" / "expected.tsv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream, delimiter="\t"))
    return {(row["net"], row["examination"], int(row["index"])): row["value"] for row in rows}


def asked(expected: Values) -> list[Row]:
    """The rows of `expected.tsv` of the 1-safe nets that are asked for."""
    names = {net for net, _, _ in expected}
    return [row for row in known_to_be_safe() if Path(row["file"]).stem in names]


def value(verdict: Verdict, kind: QueryKind) -> str:
    """A verdict as the contest writes it; empty where it is unknown."""
    if verdict.status is Status.UNKNOWN:
        return ""
    if kind is QueryKind.BOUND:
        return verdict.statement.rpartition(" is ")[2]
    return "TRUE" if verdict.status is Status.PROVED else "FALSE"


def answered(file: str, examination: str) -> tuple[list[str], float]:
    """The values of the formulas of an examination, and the processor seconds that they took."""
    loaded, name = read_pnml(Path(FOLDER) / file), Path(file).stem
    path = Path(FOLDER) / "queries" / name / f"{examination}.xml"
    queries = sorted(read_queries(path, loaded.net, dict(loaded.renamed)), key=lambda query: query.name)
    start = time.process_time()
    budget = Budget(markings=1 << 32, seconds=SECONDS_MAX, memory_bytes=MEMORY_BYTES_MAX)
    report = check(loaded.net, budget=budget, queries=queries, of_the_net=False)
    seconds = time.process_time() - start
    return [value(report.verdict(f"query.{query.name}"), query.kind) for query in queries], seconds


def tables(_repeat: int) -> list[Table]:
    """One row for each net, and a last one that counts what was decided."""
    about = (
        f"How many formulas of each examination `check` decides within {SECONDS_MAX:.0f} s by the clock and "
        f"{MEMORY_BYTES_MAX >> 30} GiB for all of them together, of so many. Processor seconds, of both cores, of all "
        "examinations. Nothing contradicts what is published."
    )
    columns = ("net", *EXAMINATIONS, "seconds")
    if not FOLDER:
        return [Table("Formulas of the contest", "Not run: FIRABLE_NETS names no folder of nets.", columns, ())]
    expected = published()
    lines: list[tuple[str, ...]] = []
    counts = dict.fromkeys(EXAMINATIONS, (0, 0))
    for row in asked(expected):
        name, cells, seconds = Path(row["file"]).stem, list[str](), 0.0
        for examination in EXAMINATIONS:
            with ProcessPoolExecutor(max_workers=1) as pool:
                values, took = pool.submit(answered, row["file"], examination).result()
            for number, found in enumerate(values):
                if found and found != (known := expected.get((name, examination, number), found)):
                    raise SystemExit(f"{name}, {examination} {number} is {found}, and {known} is published")
            decided, seconds = sum(map(bool, values)), seconds + took
            counts[examination] = (counts[examination][0] + decided, counts[examination][1] + len(values))
            cells.append(f"{decided} / {len(values)}")
        lines.append((name, *cells, f"{seconds:.1f}"))
    lines.append((f"{len(lines)} nets", *(f"{decided:,} / {of:,}" for decided, of in counts.values()), ""))
    return [Table("Formulas of the contest", about, columns, tuple(lines))]
