"""Who wonders on one host why nothing moves is told that another one is paused, held or latched."""

import asyncio
import io
import logging

from support.two_hosts import SPLIT, Hosts

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.host import Host
from firable.executor.operating.log import Log, logger_to

CENTRE = (COORDINATOR, "b")


class Cell(Hosts):
    """Both hosts, and what the centre was told of the other one."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[str] = []
        self.tasks: list[asyncio.Task[object]] = []
        self.centre = self.start(CENTRE, MemoryJournal())
        self.centre.tell = lambda kind, sentence: self.told.append(sentence) if kind == "standing" else None

    def start(self, machines: tuple[str, ...], journal: Journal) -> Host:
        run = self.host(machines, journal)
        run.latched = lambda: DryRunDriver([SPLIT.subnet("a")], 1.0)
        run.served = True
        self.tasks.append(asyncio.create_task(run.main()))
        return run

    @property
    def said(self) -> str:
        """What the centre says now."""
        return self.centre.situation().message

    async def end(self) -> None:
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)


def test_a_host_that_is_paused_is_told_of_on_the_others_until_it_goes_on() -> None:
    async def main() -> None:
        cell, log = Cell(), io.StringIO()
        cell.centre.recorder.observers.append(Log(logger_to(logging.StreamHandler(log))).seen)
        a = cell.start(("a",), MemoryJournal())
        a.pause()
        await asyncio.sleep(5)
        assert cell.said == "'a' is paused"
        assert a.situation().message == ""
        assert await cell.centre.step() is None
        cell.centre.pause()
        await asyncio.sleep(5)
        assert a.situation().message == "the coordinator is paused"
        assert a.resume()
        assert cell.centre.resume()
        await asyncio.sleep(5)
        assert "paused" not in cell.said + a.situation().message
        assert cell.told == ["'a' is paused", "'a' goes on"]
        assert log.getvalue().count('"event": "standing"') == 2
        assert a.marking == ("a.over",)
        await cell.end()

    run_in_virtual_time(main())


def test_a_host_that_is_paused_and_ends_is_lost_and_does_not_go_on() -> None:
    async def main() -> None:
        cell = Cell()
        a = cell.start(("a",), MemoryJournal())
        a.pause()
        await asyncio.sleep(5)
        a.stop()
        await asyncio.sleep(5)
        assert cell.told == ["'a' is paused"]
        assert cell.said == "'a' is not connected"
        await cell.end()

    run_in_virtual_time(main())


def test_a_host_that_is_held_or_latched_is_told_of_on_the_others() -> None:
    async def main() -> None:
        cell, journal = Cell(), MemoryJournal()
        a = cell.start(("a",), journal)
        await asyncio.sleep(0.5)
        a.emergency_stop("pressed")
        await asyncio.sleep(5)
        assert "'a' is latched by an emergency stop, until it is reset and resumed" in cell.said
        assert not a.reset()
        await asyncio.sleep(5)
        assert "'a' is held until it is resumed" in cell.said
        a.stop()
        await asyncio.sleep(5)
        assert cell.said == "'a' is not connected"
        again = cell.start(("a",), journal)
        await asyncio.sleep(5)
        assert cell.said == "'a' is held until it is resumed"
        assert again.resume()
        await asyncio.sleep(5)
        assert cell.said == ""
        assert [sentence.split()[2] for sentence in cell.told] == ["latched", "held", "held", "on"]
        await cell.end()

    run_in_virtual_time(main())
