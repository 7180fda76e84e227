"""Speed and memory of the explicit engine, as ratios to the plain way in the same run.

The plain way is a mask scan into Rust's standard hash set (`analysis/engine/examples/std_hash_set.rs`), which shares no
code with the engine: its counts of markings and edges must be equal, or the benchmark fails. A figure in seconds alone
would measure the machine; the ratio measures the engine. Times are the best of `--repeat` runs on one core.

    python benchmarks/engine.py [--repeat 3]
"""

from __future__ import annotations

import argparse
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from firable.analysis import _engine

CRATE: Final = Path(__file__).resolve().parent.parent / "analysis" / "engine"
MEMORY_BYTES_MAX: Final = 8 << 30

Row = tuple[list[int], list[int], list[int], list[int], list[tuple[int, bool]]]


@dataclass(frozen=True)
class Family:
    """A net as the engine takes it."""

    name: str
    n_places: int
    rows: list[Row]
    initial: list[int]

    def text(self) -> str:
        """The net as the plain explorer reads it."""
        lines = [" ".join(map(str, [self.n_places, *self.initial]))]
        lines += [";".join(" ".join(map(str, part)) for part in row[:4]) for row in self.rows]
        return "\n".join(lines)


def machines(count: int, *, signals: bool = False) -> Family:
    """Independent machines, idle or busy: 2^count markings; with a signal each, all combinations step."""
    rows: list[Row] = []
    for i in range(count):
        gate = [(i, True)] if signals else []
        rows += [([2 * i], [2 * i + 1], [], [], gate), ([2 * i + 1], [2 * i], [], [], gate)]
    return Family(f"machines {count}", 2 * count, rows, list(range(0, 2 * count, 2)))


def philosophers(count: int) -> Family:
    """Dining philosophers of four places: fork, thinking, holding the left fork, eating."""
    rows: list[Row] = []
    for i in range(count):
        fork, think, left, eat = range(4 * i, 4 * i + 4)
        other = 4 * ((i + 1) % count)
        rows.append(([think, fork], [left], [], [], []))
        rows.append(([left, other], [eat], [], [], []))
        rows.append(([eat], [think, fork, other], [], [], []))
    return Family(f"philosophers {count}", 4 * count, rows, [p for i in range(count) for p in (4 * i, 4 * i + 1)])


def pipeline(stages: int) -> Family:
    """A line of one-place buffers, each with a complement: any subset of stages can hold a part."""
    rows: list[Row] = [([1], [0], [], [], [])]
    for i in range(stages - 1):
        rows.append(([2 * i, 2 * i + 3], [2 * i + 1, 2 * i + 2], [], [], []))
    rows.append(([2 * stages - 2], [2 * stages - 1], [], [], []))
    return Family(f"pipeline {stages}", 2 * stages, rows, list(range(1, 2 * stages, 2)))


def interlocked(count: int, *, spare: int = 0, signals: bool = False) -> Family:
    """Machines with internal gates to their neighbours, among places that never change."""
    rows: list[Row] = []
    for i in range(count):
        idle, busy, done = range(3 * i, 3 * i + 3)
        after = 3 * ((i + 1) % count)
        gate = [(i, True)] if signals else []
        rows.append(([idle], [busy], [], [after + 1], gate))
        rows.append(([busy], [done], [], [], gate))
        rows.append(([done], [idle], [], [after + 2], gate))
    initial = list(range(0, 3 * count, 3))
    return Family(f"interlocked {count}", 3 * count + spare, rows, initial)


FAMILIES: Final[tuple[Callable[[], Family], ...]] = (
    lambda: machines(20),
    lambda: philosophers(16),
    lambda: pipeline(20),
    lambda: interlocked(14),
    lambda: interlocked(14, spare=60),
    lambda: interlocked(14, spare=180),
)


def plain(family: Family) -> tuple[int, int, float]:
    """Markings, edges and seconds of the standard hash set."""
    command = [str(CRATE / "target" / "release" / "examples" / "std_hash_set")]
    answer = subprocess.run(command, input=family.text(), capture_output=True, text=True, check=True).stdout.split()
    return int(answer[0]), int(answer[1]), float(answer[2])


def explored(family: Family, *, step: bool = False) -> _engine.Graph:
    """The engine's graph, which must be complete."""
    graph = _engine.explore(
        family.n_places,
        family.rows,
        family.initial,
        step=step,
        max_markings=1 << 30,
        max_memory_bytes=MEMORY_BYTES_MAX,
        max_seconds=None,
    )
    if not graph.complete:
        raise SystemExit(f"{family.name}: incomplete for want of {graph.reason}")
    return graph


def main() -> None:
    """Print one line for each net."""
    parser = argparse.ArgumentParser(description="speed and memory of the explicit engine")
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the best counts")
    repeat = parser.parse_args().repeat
    if repeat < 1:
        parser.error("--repeat must be at least 1")
    build = ["cargo", "build", "--release", "--locked", "--quiet", "--example", "std_hash_set"]
    subprocess.run(build, cwd=CRATE, check=True)

    print(f"{platform.machine()} {platform.system()}, Python {platform.python_version()}, best of {repeat}, one core\n")
    print(f"{'interleaving':16}{'places':>7}{'markings':>10}{'edges':>11}{'Medges/s':>10}", end="")
    print(f"{'ns/edge':>9}{'B/marking':>11}{'std ns':>8}{'x std':>7}{'live/explore':>14}")
    for make in FAMILIES:
        family = make()
        graph = explored(family)
        seconds = min([graph.seconds, *(explored(family).seconds for _ in range(repeat - 1))])
        baseline = [plain(family) for _ in range(repeat)]
        markings, edges, plain_seconds = min(baseline, key=lambda run: run[2])
        if (markings, edges) != (graph.n_markings, graph.n_edges):
            raise SystemExit(f"{family.name}: {graph} but the plain explorer has {markings} markings, {edges} edges")
        start = time.perf_counter()
        graph.live()
        live = time.perf_counter() - start
        print(f"{family.name:16}{family.n_places:7}{markings:10,}{edges:11,}{edges / seconds / 1e6:10.1f}", end="")
        print(f"{seconds / edges * 1e9:9.1f}{graph.bytes_per_marking:11.1f}{plain_seconds / edges * 1e9:8.1f}", end="")
        print(f"{plain_seconds / seconds:7.1f}{live / seconds:14.2f}")

    print(f"\n{'step':16}{'places':>7}{'markings':>10}{'edges':>11}{'Medges/s':>10}{'ns/edge':>9}{'B/marking':>11}")
    for family in (machines(11, signals=True), interlocked(7, signals=True), interlocked(9, signals=True)):
        graph = explored(family, step=True)
        print(f"{family.name:16}{family.n_places:7}{graph.n_markings:10,}{graph.n_edges:11,}", end="")
        print(f"{graph.n_edges / graph.seconds / 1e6:10.1f}{graph.seconds / graph.n_edges * 1e9:9.1f}", end="")
        print(f"{graph.bytes_per_marking:11.1f}")


if __name__ == "__main__":
    main()
