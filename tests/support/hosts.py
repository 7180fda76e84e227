"""The hosts of a cell in one process, over the in-process link, in virtual time; with parts free of promise, or not."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from support.free_parts import freed

from firable.decompose import split
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting, Link
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.metrics import Metrics
from firable.executor.operating.recorder import KEY, TRACE, Recorder, TraceFile, size_bytes_of
from firable.executor.operating.situation import Situation
from firable.executor.operating.taken_up import start_of
from firable.nets.catalogue import catalogue_net
from firable.semantics.joining import VOTED, join
from firable.semantics.replaying import Replay, replay
from firable.semantics.trace import Noted, read_trace

CENTRE = (COORDINATOR,)
ROBOT = ("robot",)
ONE_EACH = ((COORDINATOR,), ("system",), ("robot",), ("mc",), ("conveyor",))
TOGETHER = (("system", COORDINATOR), ("robot", "mc"), ("conveyor",))
ALL_IN_ONE = ((COORDINATOR, "system", "robot", "mc", "conveyor"),)


async def ended_within(host: asyncio.Task[Situation], seconds: float) -> Situation:
    """How a host ends that ends in time. To give up waiting as `wait_for` does would stop it, and pass for its end."""
    await asyncio.wait([host], timeout=seconds)
    assert host.done(), f"it has not ended within {seconds:g} s"
    return host.result()


class Cell:
    """The hosts of the one-robot cell; `of` says which machines each runs."""

    def __init__(
        self,
        folder: Path,
        of: tuple[tuple[str, ...], ...] = ONE_EACH,
        name: str = "one_robot",
        link: Callable[[Greeting], Link] | None = None,
        seconds: float = 1.0,
        *,
        free: bool = False,
    ) -> None:
        self.make_link = link
        self.seconds = seconds
        self.decomposition = freed(split(catalogue_net(name))) if free else split(catalogue_net(name))
        self.net = self.decomposition.net
        self.folder = folder
        self.exchange = Exchange()
        self.journals: dict[tuple[str, ...], Journal] = {machines: MemoryJournal() for machines in of}
        self.hosts: dict[tuple[str, ...], Host] = {}
        self.links: dict[tuple[str, ...], InProcessLink] = {}
        self.tasks: dict[tuple[str, ...], asyncio.Task[Situation]] = {}
        self.told: list[tuple[str, str]] = []
        for machines in of:
            self.start(machines)

    def path(self, machines: tuple[str, ...]) -> Path:
        """The trace of a host."""
        return self.folder / f"{machines[0] or 'coordinator'}.trace"

    def start(
        self,
        machines: tuple[str, ...],
        shown: Mapping[str, bool] | None = None,
        *,
        monitor: LocalMonitor | None = None,
        figures: Metrics | None = None,
        **conduct: Any,
    ) -> None:
        """Start a host, or start it anew."""
        journal = self.journals[machines]
        kept = journal.kept(TRACE).get(KEY)
        now = asyncio.get_running_loop().time()
        is_taken_over = kept is None and any(journal.kept(name) for name in machines)
        recorder = Recorder(
            self.net,
            "",
            TraceFile(self.path(machines), size_bytes_of(kept)),
            kept,
            machines,
            began=1e9 + now,
            start=start_of(self.decomposition, machines, journal) if is_taken_over else None,
        )
        subnets = [subnet for subnet in self.decomposition.subnets if subnet.name in machines]
        greeting = Greeting("d", machines)
        link: Link
        if self.make_link is not None:
            link = self.make_link(greeting)
        else:
            link = self.links[machines] = InProcessLink(self.exchange, greeting)
        host = self.hosts[machines] = Host(
            self.decomposition,
            DryRunDriver(subnets, self.seconds, shown),
            recorder,
            Conduct(tell=lambda kind, sentence: self.told.append((kind, sentence)), **conduct),
            machines=machines,
            link=link,
            journal=journal,
            begin_seconds=1e9 + now - recorder.began,
            monitor=monitor,
            figures=figures,
        )
        self.tasks[machines] = asyncio.create_task(host.main())

    async def kill(self, machines: tuple[str, ...]) -> None:
        """End a host at once, as a crash does: nothing more is written or sent."""
        host, task = self.hosts[machines], self.tasks[machines]
        assert host.outcome is not None
        host.acquaintances.has_heard = False  # what it would keep at an end in order
        host.outcome.cancel()
        with suppress(asyncio.CancelledError):
            await task

    async def stop(self) -> dict[tuple[str, ...], Situation]:
        """Stop all hosts in order; how each ended."""
        for task in self.tasks.values():
            task.cancel()
        ended = await asyncio.gather(*self.tasks.values())
        return dict(zip(self.tasks, ended, strict=True))

    def replayed(self) -> Replay:
        """What the joined trace did, as the reference player judges it; it must be whole."""
        traces = [read_trace(self.path(machines)) for machines in self.hosts]
        notes = [
            event.data for trace in traces for event in trace.events if isinstance(event, Noted) and event.note == VOTED
        ]
        votes = [(data["controller"], data["round"]) for data in notes]
        assert len(set(votes)) == len(votes), "a vote is told once, however often it is given"
        joined = join(self.net, traces)
        done = replay(self.net, joined)
        assert done.complete
        return done

    def firings(self) -> int:
        """How many transitions have fired until now, as the traces show."""
        lines = (line for machines in self.hosts for line in self.path(machines).read_text().splitlines())
        return sum('"fired"' in line for line in lines)
