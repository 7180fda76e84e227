"""Speed and memory of the explicit engine, as ratios to yardsticks in the same run.

- the *limit*: as many look-ups and inserts at random as there are edges, in a table of as many keys as there are
  markings, and nothing else (`analysis/engine/examples/random_inserts.rs`): no exploration that asks a table for each
  edge can be quicker. The engine does not ask for each (`analysis/engine/src/sleep.rs`);
- for two threads, the *limit by two*: one such program against two at once, each with half of the look-ups in a table
  of half the size. They share nothing but caches and memory, and need no numbering, so this is what the machine gives;
- `hashbrown` and `std`: the same exploration the plain way, by a mask scan into a general hash set
  (`examples/hash_sets.rs`). It shares no code with the engine, so its markings and edges are a check as well.

The nets are the families of the catalogue. Some are made wider by places that never change, to fill more words.

`firable check` itself, Python's start and the report included, is held to what an explicit model checker of the field
takes for the same net: the time of that one is as published for a machine of this kind, and not measured here.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from measuring import CRATE, Table, against, children_seconds, example, spread, timed

from firable.analysis import _engine
from firable.analysis.compiled import rows
from firable.nets.catalogue import FAMILIES, family_net
from firable.nets.net import Net, Place

T = TypeVar("T")

EXAMPLE: Final = (str(CRATE / "target" / "release" / "examples" / "random_inserts"),)
MEMORY_BYTES_MAX: Final = 8 << 30
LIMIT_GOALS: Final = {1: 1.0, 2: 1.0, 4: 2.0, 8: 2.0}
HASHBROWN_GOAL, STD_GOAL, BYTES_GOAL = 2.0, 4.0, 16.0
EDGE_STORE_GOAL_NS, COMPONENT_GOAL = 15.0, 1.3
VERIFYPN_SECONDS, CHECK_GOAL = 6.5, 20.0
TWO_THREADS_GOAL, COMPACT_BYTES_GOAL, COMPACT_TIME_GOAL = 1.7, 8.0, 2.0


@dataclass(frozen=True)
class Subject:
    """A net of a family, and how many places that never change are added to it."""

    family: str
    spare: int = 0

    def net(self) -> Net:
        """The net."""
        net = family_net(self.family)
        return replace(net, places=(*net.places, *(Place(f"spare{i}") for i in range(self.spare))))

    def __str__(self) -> str:
        return f"{self.family} + {self.spare}" if self.spare else self.family


SUBJECTS: Final = (
    Subject("machines-20"),
    Subject("philosophers-16"),
    Subject("pipeline-20"),
    Subject("pipeline-22"),
    Subject("slotted_ring-6"),
    Subject("slotted_ring-7"),
    Subject("philosophers_either-13"),
    Subject("interlocked-13"),
    Subject("interlocked-13", spare=60),
    Subject("interlocked-13", spare=180),
)
STEP_SUBJECTS: Final = (Subject("machines-11"), Subject("grid-4"), Subject("manufacturing_cells-6"))


def text_of(net: Net) -> str:
    """The net as the plain explorer reads it."""
    n_places, transitions, marked = rows(net)
    lines = [" ".join(map(str, [n_places, *marked]))]
    lines += [";".join(" ".join(map(str, part)) for part in row[:4]) for row in transitions]
    return "\n".join(lines)


def explorer(net: Net, *, step: bool = False, threads: int = 1) -> Callable[[], _engine.Graph]:
    """What explores a net, with all that goes before it done; the graph must be complete."""
    compiled = rows(net)

    def explore() -> _engine.Graph:
        graph = _engine.explore(
            *compiled,
            step=step,
            max_markings=1 << 30,
            max_memory_bytes=MEMORY_BYTES_MAX,
            max_seconds=None,
            threads=threads,
        )
        if not graph.complete:
            raise SystemExit(f"{net.name}: incomplete for want of {graph.reason}")
        return graph

    return explore


def interleaving(repeat: int) -> list[Table]:
    """Exploration against the yardsticks, and what is asked of the graph against exploration."""
    speed, asked = [], []
    for subject in SUBJECTS:
        net = subject.net()
        explore, text = explorer(net), text_of(net)
        graph = explore()
        markings, edges = graph.n_markings, graph.n_edges
        name, _, size = subject.family.partition("-")
        formula = FAMILIES[name].markings
        if formula is not None and formula(int(size)) != markings:
            raise SystemExit(f"{subject}: {markings} markings, and {formula(int(size))} by the formula")
        times: dict[str, list[float]] = {}
        for _ in range(repeat):
            times.setdefault("engine", []).append(timed(explore)[1])
            words = str(1 << (graph.words - 1).bit_length())
            times.setdefault("limit", []).append(example("random_inserts", words, str(markings), str(edges))[1])
            for plain in ("hashbrown", "std"):
                counts, seconds = example("hash_sets", plain, text=text)
                if counts[:2] != [str(markings), str(edges)]:
                    raise SystemExit(f"{subject}: {graph}, but the plain explorer has {counts}")
                times.setdefault(plain, []).append(seconds)
            # A graph keeps its answers, so each is asked of a new one.
            fresh = explore()
            times.setdefault("reversible", []).append(timed(fresh.reversible)[1])
            times.setdefault("live", []).append(timed(fresh.live)[1])
            times.setdefault("handed", []).append(timed(explore().edges)[1])
            counts, _ = example("hot_loops", "-", "edges", text=text)
            if counts[:2] != [str(markings), str(edges)]:
                raise SystemExit(f"{subject}: {graph}, but its edges are stored as {counts}")
            times.setdefault("edges", []).append(float(counts[3]))
        best = {what: min(seconds) for what, seconds in times.items()}
        speed.append(
            (
                str(subject), str(graph.words), f"{markings:,}", f"{edges:,}",
                spread(times["engine"], edges),
                against(LIMIT_GOALS.get(graph.words, 2.0), best["engine"] / best["limit"]),
                against(HASHBROWN_GOAL, best["hashbrown"] / best["engine"], at_least=True),
                against(STD_GOAL, best["std"] / best["engine"], at_least=True),
                against(BYTES_GOAL, graph.bytes_per_marking) if graph.words == 1 else f"{graph.bytes_per_marking:.1f}",
            )
        )  # fmt: skip
        asked.append(
            (
                str(subject),
                against(COMPONENT_GOAL, best["reversible"] / best["engine"]),
                f"{best['live'] / best['engine']:.2f}",
                against(EDGE_STORE_GOAL_NS, best["edges"] / edges * 1e9),
                spread(times["edges"], edges),
                spread(times["handed"], edges),
            )
        )
    return [
        Table(
            "Exploration, one thread",
            "Nanoseconds an edge (smallest / median / largest of the runs); the time as a multiple of the limit; how "
            "many times quicker than the plain way with `hashbrown` and with the standard set; bytes a marking.",
            ("net", "words", "markings", "edges", "ns/edge", "x limit", "x hashbrown", "x std", "bytes/marking"),
            tuple(speed),
        ),
        Table(
            "Questions to an explored graph",
            "Reversibility (one strongly connected component?) and, after it, liveness, each as a multiple of the time "
            "of exploration; nanoseconds an edge to store all edges, and with their way to Python, as bytes.",
            ("net", "reversible / explore", "live / explore", "edge store, ns/edge", "all runs", "to Python"),
            tuple(asked),
        ),
    ]


def synchronous(repeat: int) -> Table:
    """Exploration under synchronous steps, where one valuation of the signals opens many sets."""
    rows = []
    for subject in STEP_SUBJECTS:
        explore = explorer(subject.net(), step=True)
        graph = explore()
        seconds = [timed(explore)[1] for _ in range(repeat)]
        rows.append((str(subject), f"{graph.n_markings:,}", f"{graph.n_edges:,}", spread(seconds, graph.n_edges)))
    return Table(
        "Synchronous steps, one thread",
        "Nanoseconds an edge: each edge is a maximal set of transitions.",
        ("net", "markings", "edges", "ns/edge"),
        tuple(rows),
    )


def clocked(work: Callable[[], T]) -> tuple[T, float, float]:
    """What the work gives, the seconds by the clock, and the processor seconds of all its threads."""
    clock, start = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - clock, time.process_time() - start


def bare_inserts(words: str, markings: int, edges: int, processes: int) -> float:
    """The seconds by the clock of bare random inserts, shared out among so many processes: those of the slowest."""
    command = [*EXAMPLE, words, str(markings // processes), str(edges // processes)]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(processes)]
    return max(float(process.communicate()[0].split()[1]) for process in running)


def two_threads(repeat: int) -> Table:
    """Exploration on two threads against one, by the clock, and what bare random inserts gain by two."""
    rows = []
    for subject in SUBJECTS:
        net = subject.net()
        one, two = explorer(net), explorer(net, threads=2)
        graph, again = one(), two()
        if (graph.n_markings, graph.n_edges, graph.fired()) != (again.n_markings, again.n_edges, again.fired()):
            raise SystemExit(f"{subject}: {graph} by one thread, {again} by two")
        # Of the clock more runs are needed: whatever else the machine does is in it.
        words = str(1 << (graph.words - 1).bit_length())
        bare: list[list[float]] = [[], []]
        runs = []
        for _ in range(3 * repeat):
            runs.append((clocked(one)[1:], clocked(two)[1:]))
            for processes, seconds in enumerate(bare, 1):
                seconds.append(bare_inserts(words, graph.n_markings, graph.n_edges, processes))
        limit = min(bare[0]) / min(bare[1])
        clock, spent = (min(run[0][k] for run in runs) for k in (0, 1))
        clock_two, spent_two = (min(run[1][k] for run in runs) for k in (0, 1))
        rows.append(
            (
                str(subject),
                spread([by_two[0] for _, by_two in runs], graph.n_edges),
                against(TWO_THREADS_GOAL, clock / clock_two, at_least=True),
                f"{limit:.2f}",
                f"{clock / clock_two / limit:.2f}",
                f"{spent_two / spent:.2f}",
            )
        )
    return Table(
        "Exploration, two threads",
        "Nanoseconds an edge by the clock; how many times quicker than one thread by the clock, which means something "
        "where nothing else wants the two processors; the same for bare random inserts, one program against two that "
        "share nothing, each with half of the work; the first as a part of the second; the processor time of both "
        "threads as a multiple of that of one.",
        ("net", "ns/edge by the clock", "x one thread", "bare inserts, x one", "part", "processor time, x one thread"),
        tuple(rows),
    )


def compact(repeat: int) -> Table:
    """All markings without their graph, against exploration."""
    measured = []
    for subject in SUBJECTS:
        net = subject.net()
        explore = explorer(net)
        search = partial(
            _engine.explore_compactly, *rows(net), goals=[], max_memory_bytes=MEMORY_BYTES_MAX, max_seconds=None
        )
        graph, found = explore(), search()
        if (graph.n_markings, graph.n_edges, graph.fired()) != (found.n_markings, found.n_edges, found.fired()):
            raise SystemExit(f"{subject}: {graph}, but the compact search has {found.n_markings} markings")
        plain = [timed(explore)[1] for _ in range(repeat)]
        seconds = [timed(search)[1] for _ in range(repeat)]
        measured.append(
            (
                str(subject),
                str(graph.words),
                spread(seconds, graph.n_edges),
                against(COMPACT_TIME_GOAL, min(seconds) / min(plain)),
                f"{graph.bytes_per_marking:.1f}",
                against(COMPACT_BYTES_GOAL, found.memory_bytes / found.n_markings),
            )
        )
    return Table(
        "All markings without a graph, one thread",
        "Nanoseconds an edge; the time as a multiple of that of exploration; bytes a marking of the graph, and of the "
        "compact search, the two levels that it works on included.",
        ("net", "words", "ns/edge", "x explore", "bytes/marking, graph", "bytes/marking, compact"),
        tuple(measured),
    )


def checked(repeat: int) -> Table:
    """`firable check` as a person types it, and how much of it is Python that starts."""
    firable, net = str(Path(sys.executable).with_name("firable")), "philosophers-16"
    commands = {"start": [sys.executable, "-c", ""], "check": [firable, "check", f"catalogue:{net}", "--no-cache"]}
    times: dict[str, list[float]] = {what: [] for what in commands}
    # An installed package is compiled, so whoever keeps Python from writing that down is not heard.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    for _ in range(1 + 3 * repeat):  # the first compiles
        for what, command in commands.items():
            before = children_seconds()
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
            times[what].append(children_seconds() - before)
            if done.returncode > 1 or (what == "check" and "1,331,714 markings" not in done.stdout):
                raise SystemExit(f"{command} ends with {done.returncode}:\n{done.stdout}{done.stderr}")
    start, whole = times["start"][1:], times["check"][1:]
    quicker = against(CHECK_GOAL, VERIFYPN_SECONDS / min(whole), at_least=True)
    return Table(
        "A whole check",
        "Processor seconds of `firable check --no-cache` in a process of its own, all threads together (smallest / "
        f"median / largest of the runs); how many times quicker than the {VERIFYPN_SECONDS} s that verifypn is known "
        "to take for the markings alone.",
        ("net", "Python's start", "seconds", "x verifypn"),
        ((net, f"{min(start):.3f}", spread(whole, scale=1), quicker),),
    )


def tables(repeat: int) -> list[Table]:
    """All tables of this benchmark."""
    return [*interleaving(repeat), two_threads(repeat), compact(repeat), synchronous(repeat), checked(repeat)]
