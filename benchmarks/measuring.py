"""What all benchmarks share: how a time is taken, and how figures become a table.

A time is the *processor time* of the one thread that works, the kernel's share included, so that other programs on
the machine disturb it less than they would the clock; only what uses several threads goes by the clock. Each thing is
measured several times, in turn with what it is compared to, so that a slow minute slows both. A figure is a ratio of
the two smallest times: seconds alone would measure the machine. Beside it stand smallest, median and largest time,
which show how much the machine was disturbed.
"""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final, TypeVar

T = TypeVar("T")

REPOSITORY: Final = Path(__file__).resolve().parent.parent
CRATE: Final = REPOSITORY / "analysis" / "engine"
MISSED, MET = "missed", "met"


@dataclass(frozen=True)
class Table:
    """A table of results, with a sentence on what it shows, and what is drawn of it, in Markdown."""

    title: str
    about: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    drawn: str = ""

    def markdown(self) -> str:
        """The table in Markdown."""
        lines = [f"## {self.title}", "", self.about, "", f"| {' | '.join(self.columns)} |"]
        lines.append("|" + "---|" * len(self.columns))
        lines += [f"| {' | '.join(row)} |" for row in self.rows]
        return "\n".join(lines) + "\n" + (f"\n{self.drawn}" if self.drawn else "")


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What the work gives, and the processor seconds that it took in this process."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def example(name: str, *arguments: str, text: str = "") -> tuple[list[str], float]:
    """The words that an example of the crate prints, and the processor seconds that it took."""
    command = [str(CRATE / "target" / "release" / "examples" / name), *arguments]
    before = children_seconds()
    words = subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout.split()
    return words, children_seconds() - before


def children_seconds() -> float:
    """The processor seconds of all processes that this one has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def build_examples() -> None:
    """Build the examples of the crate, with all optimisations."""
    command = ["cargo", "build", "--release", "--locked", "--quiet", "--examples"]
    subprocess.run(command, cwd=CRATE, check=True)


def spread(seconds: Sequence[float], per: float = 1.0, scale: float = 1e9) -> str:
    """Smallest, median and largest of the times, each divided by `per`, in nanoseconds or as `scale` says."""
    return " / ".join(f"{value / per * scale:.3g}" for value in (min(seconds), median(seconds), max(seconds)))


def against(goal: float, ratio: float, *, at_least: bool = False) -> str:
    """A ratio beside its goal, and whether the goal is met."""
    met = ratio >= goal if at_least else ratio <= goal
    return f"{ratio:.2f} ({'>=' if at_least else '<='} {goal:g}: {MET if met else MISSED})"


def is_busy() -> bool:
    """Whether other programs want more processors than there are."""
    return os.getloadavg()[0] > (os.cpu_count() or 1)


def machine() -> str:
    """The machine, the commit and how busy the machine was, for the head of the results."""
    commit = _said("git", "rev-parse", "--short=12", "HEAD")
    changed = " with changes" if _said("git", "status", "--porcelain", "--untracked-files=no") else ""
    model = next(
        (line.partition(":")[2].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")),
        platform.processor() or platform.machine(),
    )
    memory = next((int(line.split()[1]) >> 20 for line in _lines("/proc/meminfo") if line.startswith("MemTotal")), 0)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    return (
        f"{model}, {os.cpu_count()} processors, {memory} GiB, {platform.system()} {platform.release()}, "
        f"Python {platform.python_version()}, {_said('rustc', '--version')}; commit {commit}{changed}; "
        f"{time.strftime('%Y-%m-%d', time.gmtime())}; load of the machine when it began (1, 5, 15 minutes): {load}"
    )


def _said(*command: str) -> str:
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False).stdout.strip()


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
