"""A disk that stands still is told of while it does, and a cell on several hosts goes on when it has answered."""

from __future__ import annotations

import asyncio
import io
import json
import logging
from collections.abc import Callable, Coroutine
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, TypeVar, TypeVarTuple

from prometheus_client.parser import text_string_to_metric_families
from support.hosts import Cell, ended_within

from firable.executor.cell.virtual_time import VirtualTimeLoop
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.disk_watch import ANSWERS, HANGS, HANGS_SECONDS
from firable.executor.operating.host import Host
from firable.executor.operating.log import Log, logger_to
from firable.executor.operating.metrics import Metrics
from firable.executor.operating.situation import State
from firable.nets.net import Place

T = TypeVar("T")
Ts = TypeVarTuple("Ts")
ROBOT = ("robot",)


class Disk(MemoryJournal):
    """A journal on a disk: nothing is stored before `answers_at`, nor sooner than it takes."""

    answers_at = 0.0
    takes_seconds = 0.0

    def sync(self) -> Callable[[], None]:
        return self.store

    def store(self) -> None:
        """What a thread would do."""


class DisksLoop(VirtualTimeLoop):
    """A loop in virtual time on which a disk takes as long as it says."""

    def run_in_executor(self, executor: Executor | None, func: Callable[[*Ts], T], *args: *Ts) -> asyncio.Future[T]:
        storing = [one for listed in args if isinstance(listed, list) for one in listed]
        disk = next((getattr(one, "__self__", None) for one in storing), None)
        seconds = max(disk.answers_at - self.time(), disk.takes_seconds) if isinstance(disk, Disk) else 0.0
        done = super().run_in_executor(executor, func, *args)
        if seconds <= 0:
            return done
        later: asyncio.Future[T] = self.create_future()

        def answer() -> None:
            if not later.cancelled():
                later.set_result(done.result())

        self.call_later(seconds, answer)
        return later


class Counting(DryRunDriver):
    """Machines that count what they are sent."""

    sent = 0

    def send(self, place: Place, entry: int) -> None:
        self.sent += 1
        super().send(place, entry)


class OnDisks(Cell):
    """The hosts of the cell, each with a disk; that of the robot has a log, figures and machines that count."""

    def start(self, machines: tuple[str, ...], shown: Any = None, **options: Any) -> None:
        self.journals[machines] = Disk()
        if machines == ROBOT:
            self.lines, self.metrics = io.StringIO(), Metrics(self.net, ROBOT)
            options |= {"log": Log(logger_to(logging.StreamHandler(self.lines))), "figures": self.metrics}
        super().start(machines, shown, **options)
        if machines == ROBOT:
            self.robot.driver = self.machine = Counting([self.decomposition.subnet("robot")], self.seconds)

    @property
    def robot(self) -> Host:
        return self.hosts[ROBOT]

    @property
    def disk(self) -> Disk:
        found = self.journals[ROBOT]
        assert isinstance(found, Disk)
        return found

    def said(self) -> list[str]:
        """What the operator was told of a disk."""
        return [kind for kind, _ in self.told if kind in {HANGS, ANSWERS}]

    def logged(self) -> list[tuple[str, str]]:
        """The same, as the log of the robot has it."""
        told = [json.loads(line) for line in self.lines.getvalue().splitlines()]
        return [(line["level"], line["event"]) for line in told if line["event"] in {HANGS, ANSWERS}]

    def hangs(self) -> float:
        """The figure."""
        families = text_string_to_metric_families(self.metrics.text().decode())
        return next(family.samples[0].value for family in families if family.name == "firable_disk_hangs")


def run(main: Coroutine[Any, Any, None]) -> None:
    with asyncio.Runner(loop_factory=DisksLoop) as runner:
        runner.run(main)


def test_a_disk_that_stands_still_is_told_within_its_time_and_the_cell_goes_on_when_it_has_answered(
    tmp_path: Path,
) -> None:
    async def main() -> None:
        cell = OnDisks(tmp_path)
        await asyncio.sleep(5.1)
        cell.disk.answers_at = 20.1
        while cell.robot.groups.storing is None:
            assert asyncio.get_running_loop().time() < 15, "the robot stores nothing"
            await asyncio.sleep(0.01)
        await asyncio.sleep(HANGS_SECONDS - 0.02)
        assert (cell.said(), cell.hangs()) == ([], 0.0)
        await asyncio.sleep(0.04)
        sent = cell.machine.sent
        assert (cell.said(), cell.logged(), cell.hangs()) == ([HANGS], [("error", HANGS)], 1.0)
        assert "the disk of the journal and the trace has not answered for 1.0 s" in cell.robot.situation().message
        await asyncio.sleep(20 - asyncio.get_running_loop().time())
        stood = cell.firings()
        assert cell.machine.sent == sent, "a command leaves that the disk may still lose"
        assert cell.said() == [HANGS], "once"
        await asyncio.sleep(0.2)
        assert cell.said() == [HANGS, ANSWERS]
        assert (cell.logged()[1:], cell.hangs()) == ([("info", ANSWERS)], 0.0)
        assert "disk" not in cell.robot.situation().message
        await asyncio.sleep(30)
        ended = await cell.stop()
        assert {situation.state for situation in ended.values()} == {State.STOPPED}
        assert cell.replayed().firings > stood + 10

    run(main())


def test_a_disk_that_is_slow_again_and_again_and_never_stands_still_is_told_by_nobody(tmp_path: Path) -> None:
    async def main() -> None:
        cell = OnDisks(tmp_path)
        cell.disk.takes_seconds = 0.9 * HANGS_SECONDS
        await asyncio.sleep(60)
        assert cell.machine.sent > 3
        assert (cell.said(), cell.hangs()) == ([], 0.0)
        await cell.stop()
        assert cell.replayed().complete

    run(main())


def test_each_time_that_a_disk_stands_still_is_told_and_a_stop_meanwhile_ends_in_order(tmp_path: Path) -> None:
    async def main() -> None:
        cell = OnDisks(tmp_path)
        cell.disk.takes_seconds = 1.5 * HANGS_SECONDS
        await asyncio.sleep(10)
        said = cell.said()
        assert len(said) > 4
        assert said == [HANGS, ANSWERS] * (len(said) // 2) + [HANGS] * (len(said) % 2)
        cell.robot.stop()
        situation = await ended_within(cell.tasks[ROBOT], 10)
        assert situation.state is State.STOPPED
        assert "disk" not in situation.message
        await cell.stop()

    run(main())


def test_a_cell_at_rest_on_a_disk_that_is_slow_each_time_has_nothing_more_to_store(tmp_path: Path) -> None:
    async def main() -> None:
        cell = OnDisks(tmp_path)
        cell.disk.takes_seconds = 1.5 * HANGS_SECONDS
        await asyncio.sleep(20)
        for host in cell.hosts.values():
            host.pause()
        await asyncio.sleep(30)
        said = cell.said()
        await asyncio.sleep(60)
        assert cell.said() == said
        assert said[-1] == ANSWERS
        await cell.stop()

    run(main())
