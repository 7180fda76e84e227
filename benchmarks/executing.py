"""How fast a controller fires, what it costs that a net is large, and whether memory stays flat.

The nets are rings: a token goes round in each, by local transitions without gates, so that something is always enabled
and nothing waits for a machine. The yardstick is the least that a token player can do, which knows what to fire: two
operations on the word, and no question asked. What scales is compared to itself on the small net.
"""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from measuring import Table, against, spread, timed

from firable.decompose.splitting.cut import split
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.protocol.controller import LocalController
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, Net, Place, Transition

FIRINGS: Final = 20_000
GROUP: Final = 64
"""So many firings share a sync, about as in `executor/operating/acts.py`."""
GOAL: Final = 10_000
MANY: Final = 10_000_000


def rings(n_transitions: int, n_rings: int) -> Decomposition:
    """One controller with rings of equal length, each with one token."""
    length = n_transitions // n_rings
    names = [[f"a.r{r}.{i}" for i in range(length)] for r in range(n_rings)]
    places = tuple(Place(name, "a", marked=i == 0) for ring in names for i, name in enumerate(ring))
    moves = tuple(
        Transition(f"t{r}.{i}", (ring[i],), (ring[(i + 1) % length],))
        for r, ring in enumerate(names)
        for i in range(length)
    )
    return split(Net("rings", places, moves, controllers=(Controller("a"),)))


def fired(controller: LocalController, firings: int, journal: Journal | None = None) -> None:
    """Fire so often; with a journal, durable in groups."""
    for count in range(firings):
        effects = [*controller.fire(), *controller.report()]
        if journal is not None:
            journal.write("a", effects)
            if count % GROUP == 0:
                journal.sync()


def bare(controller: LocalController, firings: int) -> None:
    """Move tokens by masks that are known beforehand."""
    word, transitions = controller.subnet.initial_marking, controller.transitions
    order = [transitions[i % len(transitions)] for i in range(firings)]
    for transition in order:
        word = word & ~transition.takes | transition.puts


def tables(repeat: int) -> list[Table]:
    """The rate, the scaling, and the memory."""
    return [_rate(repeat), _scaling(repeat), _memory()]


def _rate(repeat: int) -> Table:
    decomposition = rings(1_000, 100)
    controller = LocalController(decomposition, "a")
    with tempfile.TemporaryDirectory() as folder:
        stored = SqliteJournal(Path(folder) / "journal", "d", ["a"])
        ways: dict[str, Callable[[], None]] = {
            "bare masks": lambda: bare(controller, FIRINGS),
            "controller": lambda: fired(controller, FIRINGS),
            "controller, journal in memory": lambda: fired(controller, FIRINGS, MemoryJournal()),
            f"controller, journal on disk, a sync for {GROUP} firings": lambda: fired(controller, FIRINGS, stored),
        }
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        clock: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(repeat):
            for name, way in ways.items():
                start = time.perf_counter()
                seconds[name].append(timed(way)[1])
                clock[name].append(time.perf_counter() - start)
        stored.close()
    yardstick = min(seconds["bare masks"])
    rows = []
    for name, taken in seconds.items():
        by_clock = f"{FIRINGS / min(clock[name]):,.0f}"
        rate = FIRINGS / min(taken)
        goal = against(1, rate / GOAL, at_least=True) if name != "bare masks" else "the yardstick"
        rows.append(
            (name, f"{min(taken) / yardstick:.1f}", f"{rate:,.0f}", goal, by_clock, spread(taken, FIRINGS, 1e6))
        )
    return Table(
        "Firings of one controller with 1,000 transitions",
        f"100 rings of 10; the rate a second of one processor beside the goal of {GOAL:,}, and by the clock, which the "
        "disk slows, and other programs.",
        (
            "what",
            "times the yardstick",
            "firings a second",
            "of the goal",
            "by the clock",
            "microseconds for one: min / median / max",
        ),
        tuple(rows),
    )


def _scaling(repeat: int) -> Table:
    sizes = (100, 1_000, 10_000)
    controllers = {size: LocalController(rings(size, 10), "a") for size in sizes}
    seconds: dict[int, list[float]] = {size: [] for size in sizes}
    for _ in range(repeat):
        for size, controller in controllers.items():
            seconds[size].append(timed(partial(fired, controller, FIRINGS))[1])
    base = min(seconds[sizes[0]])
    rows = tuple(
        (f"{size:,}", against(2.0, min(seconds[size]) / base), spread(seconds[size], FIRINGS, 1e6)) for size in sizes
    )
    return Table(
        "What transitions cost that nothing touched",
        "10 rings, ever longer: 10 transitions are enabled in each net. What is left of the growth is the word itself, "
        "which has a bit for each place.",
        ("transitions", "times 100 transitions", "microseconds for one firing: min / median / max"),
        rows,
    )


def _memory() -> Table:
    controller, journal = LocalController(rings(1_000, 100), "a"), MemoryJournal()
    rows = []
    for part in range(5):
        fired(controller, MANY // 5, journal)
        rows.append((f"{(part + 1) * MANY // 5:,}", f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.1f}"))
    return Table(
        "Memory of a controller that fires on and on",
        "1,000 transitions, with a journal in memory; the most that the process has ever had.",
        ("firings", "MiB"),
        tuple(rows),
    )
