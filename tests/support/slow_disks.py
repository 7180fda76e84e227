"""A host with journal and trace on disks that answer when a test lets them, and machines that note what they get."""

from __future__ import annotations

import asyncio
import io
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from threading import Semaphore
from typing import Any

import pytest

from firable.decompose.splitting.cut import split
from firable.executor.drivers.bench import PATIENCE_S
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal, Storing
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder, TraceFile
from firable.executor.operating.situation import Situation
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import Stored
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.interchange import net_digest
from firable.nets.net import Place
from firable.nets.text import parse_net

CELL = """\
firable: 1
cell: cell
controllers:
  a:
    start: low
    inputs: s
    places: {low: {send: {machine: A, command: LOW}}, high: {send: {machine: A, command: HIGH}}}
  b:
    start: free
    inputs: key
    places: {free: , working: {send: {machine: B, command: WORK}, until: worked}, waiting: }
transitions:
  up: {from: a.low, to: a.high, if: a.s}
  down: {from: a.high, to: a.low, unless: a.s}
  begin: {from: b.free, to: b.working, if: b.key}
  leave: {from: b.working, to: b.waiting}
"""


class Machines(DryRunDriver):
    """Machines that note what they are sent, and complete nothing by themselves."""

    sent: list[str]
    says: Mapping[str, Answer] = {}
    """What they say of the commands of places, asked after a restart."""

    async def ask(self, place: Place, entry: int) -> Answer:
        assert entry
        return self.says.get(place.name, Answer.DONE)

    def send(self, place: Place, entry: int) -> None:
        self.sent.append(place.name)
        if place.completion is None and self.listener is not None:
            self.listener.taken(place.name, entry)


class Slow(MemoryJournal):
    """A journal whose disk answers to each sync when it is let, or fails then."""

    def __init__(self, durable: Mapping[str, Mapping[str, Stored]] | None = None) -> None:
        super().__init__()
        self.of = {machine: dict(kept) for machine, kept in (durable or {}).items()}
        self.answers = Semaphore(0)
        self.is_slow = False
        self.fails = False
        self.durable: Mapping[str, Mapping[str, Stored]] = {}

    def sync(self) -> Storing | None:
        kept = {machine: self.kept(machine) for machine in self.of}

        def store() -> None:
            assert self.answers.acquire(timeout=PATIENCE_S)
            if self.fails:
                raise InputError([Diagnostic("F5034", "the disk is full", "make room")])
            self.durable = kept

        if self.is_slow:
            return store
        self.durable = kept
        return None


class SlowFile(io.FileIO):
    """A file on a disk that takes what is written when it is let."""

    answers = Semaphore(0)
    is_slow = False

    def write(self, data: Any, /) -> int:
        if self.is_slow:
            assert self.answers.acquire(timeout=PATIENCE_S)
        return super().write(data)


class Waiting(TraceFile):
    """A trace in such a file."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.file = self.disk = SlowFile(path, "w")
        self.disk.answers = Semaphore(0)


class Rig:
    """A host of the cell with such a disk, which begins with what another one has left `durable` there."""

    def __init__(
        self,
        cell: str = CELL,
        trace: TraceFile | None = None,
        durable: Mapping[str, Mapping[str, Stored]] | None = None,
    ) -> None:
        net = parse_net(cell)
        decomposition = split(net)
        self.journal = Slow(durable)
        self.stream = io.StringIO()
        off = {signal.name: False for signal in net.signals}
        self.machines = Machines(decomposition.subnets, 1.0, off)
        self.machines.sent = []

        async def present(_: Host) -> None:
            await asyncio.get_running_loop().create_future()

        recorder = Recorder(net, net_digest(net), trace or self.stream, self.journal.kept(TRACE).get(KEY))
        self.host = Host(decomposition, self.machines, recorder, Conduct(operator=present), journal=self.journal)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[asyncio.Task[Situation]]:
        ending = asyncio.create_task(self.host.main())
        await turns()
        try:
            yield ending
        finally:
            self.journal.answers.release(1000)
            self.host.stop()
            await asyncio.wait([ending], timeout=PATIENCE_S)
            assert ending.done()

    async def slow_from_now_on(self) -> None:
        """The next sync begins, and does not end."""
        self.journal.is_slow = True
        self.host.signal("a.s", value=True, entry=None)
        await turns()
        assert self.host.groups.storing is not None

    async def answer(self) -> None:
        """Let the disk answer to one sync."""
        storing = self.host.groups.storing
        assert storing is not None
        self.journal.answers.release()
        await asyncio.wait([storing], timeout=PATIENCE_S)
        assert storing.done()
        await turns()

    async def answer_all(self) -> None:
        """Let it answer until nothing waits for it."""
        for _ in range(1000):
            if self.host.groups.storing is None:
                return
            await self.answer()
        pytest.fail("each sync is followed by another")

    @property
    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.stream.getvalue().splitlines()]

    @property
    def fired(self) -> list[str]:
        return [name for line in self.lines for name in line.get("fired", ())]


async def turns() -> None:
    for _ in range(20):
        await asyncio.sleep(0)
