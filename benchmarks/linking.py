"""A transition over four controllers, each in a process of its own, by Zenoh: time for each firing in round trips.

The yardstick is what Zenoh alone needs, in the same run and with as many processes: one process publishes to four
others, each answers, and the round trip is over when the last answer is there. A firing takes two phases, asking for
promises and ordering what was decided, and the next one begins with the acknowledgements; so the goal is 1.3 round
trips for each phase. That is so where parts must promise. Of this net it can be shown that no part has to, as a bundle
of it does, and then a firing is one phase: the order, and the acknowledgements with the votes for the next. Both are
measured.

Times are by the clock, because what is measured is waiting. The yardstick answers on Zenoh's own
threads. A controller does so where its event loop sleeps (`executor/links/lending.py`), and where it is at work, with
drivers and timers, the loop is woken. What a hand-over to the loop takes each time shows a second yardstick: the same
round trip between five event loops, each woken by Zenoh's thread once for all that comes before it looks, and doing
nothing else. A third one, the *floor*, is the first with what no protocol in Python leaves out: each message is read
from bytes, strictly, and its answer written. What a phase takes beyond that is the protocol's acts.

    python benchmarks/linking.py controller c1 ADDRESS BUNDLE     a process of the firing
    python benchmarks/linking.py echo c1 ADDRESS BUNDLE           a process of the yardstick
    python benchmarks/linking.py loop c1 ADDRESS BUNDLE           a process of the second yardstick
    python benchmarks/linking.py floor c1 ADDRESS BUNDLE          a process of the third one
"""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from threading import Event
from typing import Final

import zenoh
from measuring import Table, against

from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.links.encoding import pack, unpack
from firable.executor.links.lending import LendingLoop
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.links.zenoh_link import ZenohLink
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.protocol.messages import Acknowledgement, Decision, Readiness
from firable.nets.bundle import Bundle, read_bundle, write_bundle
from firable.nets.decomposition import Decomposition
from firable.nets.net import Controller, Net, Place, Transition

CONTROLLERS: Final = tuple(f"c{i}" for i in range(4))
GOAL: Final = 1.3
COUNT: Final = 500
PAYLOAD: Final = b"x" * 150
"""As long as a vote."""


class Firings(Recorder):
    """A trace that keeps nothing but when transitions fired."""

    def __init__(self, net: Net, wanted: int) -> None:
        super().__init__(net, "", None, None, (COORDINATOR,))
        self.wanted = wanted
        self.at: list[float] = []
        self.enough = asyncio.Event()

    def fired(self, at_seconds: float, transition: str, number: int | None = None) -> None:
        """Remember when."""
        super().fired(at_seconds, transition, number)
        self.at.append(time.perf_counter())
        if len(self.at) > self.wanted:
            self.enough.set()


def ring() -> Net:
    """Two transitions by turns, each of all controllers, and no machine that takes time."""
    owned = {name: (f"{name}.a", f"{name}.b") for name in CONTROLLERS}
    places = tuple(Place(p, name, marked=p == owned[name][0]) for name in CONTROLLERS for p in owned[name])
    a, b = (tuple(owned[name][i] for name in CONTROLLERS) for i in (0, 1))
    controllers = tuple(map(Controller, CONTROLLERS))
    return Net("ring", places, (Transition("go", a, b), Transition("back", b, a)), controllers=controllers)


def host(of: Decomposition, names: tuple[str, ...], trace: Recorder, *, listen: str = "", join: str = "") -> Host:
    """A host of the ring, without machines and journal."""
    greeting = Greeting("ring", names)
    link = ZenohLink(greeting, listen=[listen] if listen else [], join=[join] if join else [], lease_seconds=10.0)
    return Host(of, DryRunDriver([], 0.0), trace, machines=names, link=link)


def session(*, listen: str = "", join: str = "") -> zenoh.Session:
    """A session as the link has it."""
    link = ZenohLink(Greeting("", ()), listen=[listen] if listen else [], join=[join] if join else [])
    return zenoh.open(link._configuration())


async def firing(of: Decomposition, at: str, repeat: int) -> list[float]:
    """Seconds between two firings, in the middle of many, so many times."""
    trace = Firings(of.net, COUNT * repeat)
    coordinator = asyncio.create_task(host(of, (COORDINATOR,), trace, listen=at).main())
    async with asyncio.timeout(300):
        await trace.enough.wait()
    coordinator.cancel()
    await coordinator
    took = [after - before for before, after in zip(trace.at, trace.at[1:], strict=False)]
    return [median(took[i * COUNT : (i + 1) * COUNT]) for i in range(repeat)]


def bare(at: str, repeat: int, *, reads: bool = False) -> list[float]:
    """Seconds of a round trip to all, in the middle of many, so many times; with `reads`, of true messages."""
    answered, all_answered = set[str](), Event()
    opened = session(listen=at)

    def answer(sample: zenoh.Sample) -> None:
        if reads:
            unpack(sample.payload.to_bytes())
        answered.add(str(sample.key_expr))
        if len(answered) == len(CONTROLLERS):
            all_answered.set()

    subscriber = opened.declare_subscriber("yardstick/from/*", answer)
    close: Callable[[], object] = opened.close
    publishers = [opened.declare_publisher(f"yardstick/to/{name}", express=True) for name in CONTROLLERS]
    took: list[float] = []
    while len(took) < COUNT * repeat:
        begin = time.perf_counter()
        answered.clear()
        all_answered.clear()
        for name, publisher in zip(CONTROLLERS, publishers, strict=True):
            number = len(took)
            publisher.put(pack(number, Decision(name, number, "go", number, number)) if reads else PAYLOAD)
        if all_answered.wait(0.5):  # not all are there yet
            took.append(time.perf_counter() - begin)
    del subscriber
    close()
    return [median(took[i * COUNT : (i + 1) * COUNT]) for i in range(repeat)]


def echo(name: str, at: str) -> None:
    """Answer for ever."""
    opened = session(join=at)
    back = opened.declare_publisher(f"yardstick/from/{name}", express=True)
    _subscriber = opened.declare_subscriber(f"yardstick/to/{name}", lambda _: back.put(PAYLOAD))
    Event().wait()


def read_and_answer(name: str, at: str) -> None:
    """Answer for ever what was read, by a message of the protocol."""
    opened = session(join=at)
    back = opened.declare_publisher(f"yardstick/from/{name}", express=True)
    ready = frozenset(("back",))

    def answer(sample: zenoh.Sample) -> None:
        age, order = unpack(sample.payload.to_bytes())
        assert isinstance(order, Decision)
        back.put(pack(age, Acknowledgement(name, order.round, Readiness(order.seen + 1, ready))))

    _subscriber = opened.declare_subscriber(f"yardstick/to/{name}", answer)
    Event().wait()


class Woken:
    """An event loop that Zenoh's thread wakes once for all samples that come before it looks."""

    def __init__(self, look: Callable[[list[str]], None]) -> None:
        self.loop = asyncio.get_running_loop()
        self.look = look
        self.came: list[str] = []

    def on(self, sample: zenoh.Sample) -> None:
        """A sample has come, on a thread of Zenoh."""
        self.came.append(str(sample.key_expr))
        if len(self.came) == 1:
            self.loop.call_soon_threadsafe(self._look)

    def _look(self) -> None:
        came, self.came = self.came, []
        self.look(came)


async def bare_by_loops(at: str, repeat: int) -> list[float]:
    """Seconds of a round trip to all from an event loop, in the middle of many, so many times."""
    answered, all_answered = set[str](), asyncio.Event()

    def look(came: list[str]) -> None:
        answered.update(came)
        if len(answered) == len(CONTROLLERS):
            all_answered.set()

    opened = session(listen=at)
    subscriber = opened.declare_subscriber("yardstick/from/*", Woken(look).on)
    close: Callable[[], object] = opened.close
    publishers = [opened.declare_publisher(f"yardstick/to/{name}", express=True) for name in CONTROLLERS]
    took: list[float] = []
    while len(took) < COUNT * repeat:
        begin = time.perf_counter()
        answered.clear()
        all_answered.clear()
        for publisher in publishers:
            publisher.put(PAYLOAD)
        with suppress(TimeoutError):  # not all are there yet
            async with asyncio.timeout(0.5):
                await all_answered.wait()
            took.append(time.perf_counter() - begin)
    del subscriber
    close()
    return [median(took[i * COUNT : (i + 1) * COUNT]) for i in range(repeat)]


async def echo_by_loop(name: str, at: str) -> None:
    """Answer for ever, on an event loop."""
    opened = session(join=at)
    back = opened.declare_publisher(f"yardstick/from/{name}", express=True)

    def look(came: list[str]) -> None:
        for _ in came:
            back.put(PAYLOAD)

    _subscriber = opened.declare_subscriber(f"yardstick/to/{name}", Woken(look).on)
    await asyncio.get_running_loop().create_future()


@contextmanager
def processes(kind: str, bundle: Path) -> Iterator[str]:
    """The four other processes, and the address that they join."""
    at = f"tcp/127.0.0.1:{free_port()}"
    script = [sys.executable, str(Path(__file__).resolve()), kind]
    started = [subprocess.Popen([*script, name, at, str(bundle)]) for name in CONTROLLERS]
    try:
        yield at
    finally:
        for process in started:
            process.kill()
            process.wait()


def tables(repeat: int) -> list[Table]:
    """The round trips, and a row for each kind of firing: the smallest of the medians of each, and ratios of those."""
    from firable.decompose.splitting.cut import split  # not for the processes, which read its result
    from firable.decompose.splitting.persistence import freed

    promising = split(ring())
    free = freed(promising)
    assert len(free.free) == len(free.coordinated) * len(CONTROLLERS), "no part of the ring has to promise"
    fired: dict[int, list[float]] = {}
    with TemporaryDirectory() as folder:
        bundle = Path(folder) / "ring.bundle"
        write_bundle(bundle, Bundle(promising, ()))
        with processes("echo", bundle) as at:
            trips = bare(at, repeat)
        with processes("loop", bundle) as at:
            by_loops = asyncio.run(bare_by_loops(at, repeat))
        with processes("floor", bundle) as at:
            floor = bare(at, repeat, reads=True)
        for phases, of in ((2, promising), (1, free)):
            write_bundle(bundle, Bundle(of, ()))
            with processes("controller", bundle) as at, asyncio.Runner(loop_factory=LendingLoop) as runner:
                fired[phases] = runner.run(firing(of, at, repeat))
        with processes("echo", bundle) as at:
            again = bare(at, repeat)
    round_trips = Table(
        "Round trips from one process to four others, by Zenoh",
        "Microseconds by the clock until the last answer is there, the median of 500, each smallest with all of the "
        "runs behind it, and as a multiple of the first.",
        ("what", "microseconds", "as a multiple"),
        tuple(
            (what, _shown(took), f"{min(took) / min(trips):.2f}")
            for what, took in (
                ("Zenoh alone, answered on its threads", trips),
                ("the same after the firings: the noise floor", again),
                ("between event loops that do nothing else", by_loops),
                ("on Zenoh's threads, each message read and written: the floor", floor),
            )
        ),
    )
    firings = Table(
        "A transition over four controllers, by Zenoh",
        "Microseconds by the clock between two firings, the median of 500, each smallest with all of the runs behind "
        "it, and a phase as a multiple of the round trip of Zenoh alone, and of the floor.",
        ("parts", "phases", "firing", "phase / round trip", "phase / floor"),
        tuple(
            (
                "must promise" if phases == 2 else "are free of promise",
                str(phases),
                _shown(took),
                against(GOAL, min(took) / phases / min(trips)),
                f"{min(took) / phases / min(floor):.2f}",
            )
            for phases, took in fired.items()
        ),
    )
    return [round_trips, firings]


def _shown(seconds: list[float]) -> str:
    return f"{min(seconds) * 1e6:.0f} ({', '.join(f'{one * 1e6:.0f}' for one in seconds)})"


if __name__ == "__main__":
    _, kind, own, address, path = sys.argv
    if kind == "echo":
        echo(own, address)
    elif kind == "floor":
        read_and_answer(own, address)
    elif kind == "loop":
        asyncio.run(echo_by_loop(own, address))
    else:
        cell = read_bundle(path).decomposition
        with asyncio.Runner(loop_factory=LendingLoop) as runner:
            runner.run(host(cell, (own,), Recorder(cell.net, "", None, None, (own,)), join=address).main())
