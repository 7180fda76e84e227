"""How fast a controller fires, what it costs that a net is large, and whether memory stays flat.

The nets are rings: a token goes round in each, by local transitions without gates, so that something is always enabled
and nothing waits for a machine. What runs them is the controller alone, and the *runtime*: the host as `firable run`
has it, with its event loop, its recorder and, where it is said, its journal and trace on disk. The yardstick is the
least that a token player can do, which knows what to fire: two operations on the word, and no question asked. What
scales is compared to itself on the small net.

    python benchmarks/executing.py COUNT      fire so often in the runtime, and tell what memory it has
"""

from __future__ import annotations

import asyncio
import gc
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from measuring import Table, against, spread, timed

from firable.decompose.splitting.cut import split
from firable.executor.drivers.driver import Clock, Listener
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import Journal
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.taken_up import opened
from firable.executor.protocol.controller import LocalController
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, Net, Place, Signal, SignalKind, Transition

FIRINGS: Final = 20_000
GROUP: Final = 64
"""So many firings of the controller alone share a sync."""
GOAL: Final = 10_000
MANY: Final = 10_000_000
SCALING_MAX: Final = 2.0
PARTS: Final = 10
KNOCK: Final = "a.knock"
"""A sensor that opens nothing: a runtime to which nothing ever comes takes a net that fires on and on for a fault."""


def rings(*lengths: int, in_turn: bool = False) -> Decomposition:
    """One controller with rings of these lengths, each with one token.

    The next transition behind the last one fires: a ring goes round and then the next one does or, `in_turn`, where the
    transitions of a ring stand backwards, each ring moves on by one and then the next one does.
    """
    names = [[f"a.r{r}.{i}" for i in range(length)] for r, length in enumerate(lengths)]
    places = tuple(Place(name, "a", marked=i == 0) for ring in names for i, name in enumerate(ring))
    step = -1 if in_turn else 1
    order = [(r, i) for r, ring in enumerate(names) for i in range(len(ring))[::step]]
    moves = tuple(Transition(f"t{r}.{i}", (names[r][i],), (names[r][(i + 1) % len(names[r])],)) for r, i in order)
    signals = (Signal(KNOCK, "a", SignalKind.SENSOR),)
    return split(Net("rings", places, moves, signals=signals, controllers=(Controller("a"),)))


def fired(controller: LocalController, firings: int, journal: Journal | None = None) -> None:
    """Fire so often; with a journal, durable in groups."""
    for count in range(firings):
        effects = [*controller.fire(), *controller.report()]
        if journal is not None:
            journal.write("a", effects)
            if count % GROUP == 0:
                journal.sync()


class Knocking(DryRunDriver):
    """A driver whose sensor changes now and then."""

    async def run(self, clock: Clock, listener: Listener) -> None:
        """Knock until cancelled."""
        del clock
        knocks = 0
        while True:
            listener.signal(KNOCK, knocks % 2 == 1, None)
            knocks += 1
            await asyncio.sleep(0.02)


def run_host(
    decomposition: Decomposition,
    firings: int,
    folder: str | None = None,
    told: Callable[[int], None] = lambda _: None,
) -> float:
    """Run a host until so many transitions have fired, in a folder with journal and trace; processor seconds of one.

    `told` is told how many have fired, now and then.
    """

    async def operate(host: Host) -> None:
        fired = 0
        while fired < firings:
            await asyncio.sleep(0.02)
            fired = sum(host.recorder.firings.values())
            told(fired)
        host.stop()

    paths = (None, None) if folder is None else (Path(folder) / "journal", Path(folder) / "trace")
    with opened(decomposition, "d", *paths) as files:
        host = Host(decomposition, Knocking([], 0.0), files.recorder, Conduct(operator=operate), journal=files.journal)
        _, seconds = timed(lambda: asyncio.run(host.main()))
        return seconds / sum(files.recorder.firings.values())


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
    decomposition = rings(*[10] * 100)
    controller = LocalController(decomposition, "a")
    with tempfile.TemporaryDirectory() as folder:
        stored = SqliteJournal(Path(folder) / "journal", "d", ["a"])

        def each(work: Callable[[], None]) -> float:
            return timed(work)[1] / FIRINGS

        def on_disk() -> float:
            with tempfile.TemporaryDirectory() as fresh:
                return run_host(decomposition, FIRINGS, fresh)

        ways: dict[str, Callable[[], float]] = {
            "bare masks": lambda: each(lambda: bare(controller, FIRINGS)),
            "controller": lambda: each(lambda: fired(controller, FIRINGS)),
            f"controller, journal on disk, a sync for {GROUP} firings": lambda: each(
                lambda: fired(controller, FIRINGS, stored)
            ),
            "runtime": lambda: run_host(decomposition, FIRINGS),
            "runtime, journal and trace on disk": on_disk,
        }
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        clock: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(repeat):
            for name, way in ways.items():
                start = time.perf_counter()
                seconds[name].append(way())
                clock[name].append((time.perf_counter() - start) / FIRINGS)
        stored.close()
    yardstick = min(seconds["bare masks"])
    rows = []
    for name, taken in seconds.items():
        rate = 1 / min(taken)
        goal = against(1, rate / GOAL, at_least=True) if name != "bare masks" else "the yardstick"
        rows.append(
            (
                name,
                f"{min(taken) / yardstick:.1f}",
                f"{rate:,.0f}",
                goal,
                f"{1 / min(clock[name]):,.0f}",
                spread(taken, 1, 1e6),
            )
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
    # Of different lengths and in turn, so that no word comes again: what was asked of one is remembered (`enabled.py`).
    nets = {size: rings(*(size // 10 + more for more in range(-5, 6) if more), in_turn=True) for size in sizes}
    controllers = {size: LocalController(net, "a") for size, net in nets.items()}
    alone: dict[int, list[float]] = {size: [] for size in sizes}
    hosts: dict[int, list[float]] = {size: [] for size in sizes}
    for _ in range(repeat):
        for size, controller in controllers.items():
            alone[size].append(timed(partial(fired, controller, FIRINGS))[1] / FIRINGS)
            hosts[size].append(run_host(nets[size], FIRINGS))
    first = sizes[0]
    rows = tuple(
        (
            f"{size:,}",
            against(SCALING_MAX, min(alone[size]) / min(alone[first])),
            spread(alone[size], 1, 1e6),
            against(SCALING_MAX, min(hosts[size]) / min(hosts[first])),
            spread(hosts[size], 1, 1e6),
        )
        for size in sizes
    )
    return Table(
        "What transitions cost that nothing touched",
        "10 rings, ever longer: 10 transitions are enabled in each net, and no marking comes again, or what is enabled "
        "there would be remembered. What is left of the growth is the word itself, which has a bit for each place, and "
        "that what a firing needs is in no cache any more when its turn comes again.",
        (
            "transitions",
            "controller, times 100 transitions",
            "microseconds for one firing: min / median / max",
            "runtime, times 100 transitions",
            "microseconds for one firing: min / median / max",
        ),
        rows,
    )


def _memory() -> Table:
    command = [sys.executable, str(Path(__file__).resolve()), str(MANY)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = [(f"{count:,}", f"{blocks:,}", f"{mebibytes:.2f}") for count, blocks, mebibytes in json.loads(said)]
    return Table(
        "Memory of a controller that fires on and on",
        "The runtime with 1,000 transitions, in a process of its own: the blocks of memory that Python's objects hold, "
        "and how much of the process is resident. A counter takes a block when it passes 256.",
        ("firings", "blocks", "MiB"),
        tuple(rows),
    )


def _fire_on(count: int) -> None:
    """Print how much memory is resident after each part of so many firings."""
    samples: list[tuple[int, int, float]] = []
    pages = Path("/proc/self/statm")

    def told(fired: int) -> None:
        if fired >= len(samples) * count // PARTS:
            gc.collect()
            resident = int(pages.read_text().split()[1]) * resource.getpagesize()
            samples.append((fired, sys.getallocatedblocks(), resident / 2**20))

    run_host(rings(*[10] * 100), count, told=told)
    print(json.dumps(samples))


if __name__ == "__main__":
    _fire_on(int(sys.argv[1]))
