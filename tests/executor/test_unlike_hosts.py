"""Hosts of another bundle or version: one that nobody ever let in ends when who decides for it refuses it; no other."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from support.hosts import TOGETHER, Cell
from support.two_hosts import Hosts, refusal

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting, Refusal
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import State
from firable.executor.protocol.deciders import coordinator_at
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import Diagnostic

A, CENTRE = ("a",), ("b", COORDINATOR)
UNLIKE: list[dict[str, Any]] = [{"digest": "of another bundle"}, {"version": 0}]


@pytest.mark.parametrize("unlike", UNLIKE, ids=["bundle", "version"])
def test_a_host_that_its_coordinator_can_never_let_in_ends_and_the_coordinator_waits_for_the_right_one(
    unlike: dict[str, Any],
) -> None:
    async def main() -> None:
        hosts = Hosts()
        centre = hosts.host(CENTRE, MemoryJournal())
        told: list[str] = []
        centre.tell = lambda kind, sentence: told.append(f"{kind}: {sentence}")
        waiting = asyncio.create_task(centre.main())
        wrong = hosts.host(A, MemoryJournal(), **unlike)
        said: list[tuple[str, str]] = []
        wrong.tell = lambda *line: said.append(line)
        problem = await refusal(asyncio.create_task(wrong.main()))
        assert problem.code == "F5020"
        assert problem.message.startswith("'b', the coordinator ")
        assert [kind for kind, _ in said if kind == "refused"] == ["refused"]
        refused, gone = told
        assert refused.startswith("refused: the host of 'a' is refused: 'a' ")
        assert gone == "gone: the host of 'a' that was refused is gone"
        assert hosts.driver.sent == 0
        assert not waiting.done()
        right = asyncio.create_task(hosts.host(A, MemoryJournal()).main())
        await asyncio.sleep(10)
        assert hosts.driver.sent == 1
        for task in (waiting, right):
            task.cancel()
        await asyncio.gather(waiting, right)

    run_in_virtual_time(main())


@pytest.mark.parametrize("unlike", UNLIKE, ids=["bundle", "version"])
@pytest.mark.parametrize("wrong_comes_first", [True, False])
def test_a_host_that_finds_a_wrong_coordinator_and_a_right_one_works_with_that(
    unlike: dict[str, Any], wrong_comes_first: bool
) -> None:
    async def main() -> None:
        hosts = Hosts()
        of_centre = [hosts.host(CENTRE, MemoryJournal(), **unlike), hosts.host(CENTRE, MemoryJournal())]
        tasks = []
        for run in of_centre if wrong_comes_first else reversed(of_centre):
            tasks.append(asyncio.create_task(run.main()))
            await asyncio.sleep(0.1)
        tasks.append(asyncio.create_task(hosts.host(A, MemoryJournal()).main()))
        await asyncio.sleep(10)
        assert not any(task.done() for task in tasks)
        assert hosts.driver.sent == 1
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_the_host_of_the_coordinator_at_the_top_is_ended_by_nobody() -> None:
    """Though it runs a controller that another coordinator decides for, too."""

    async def main() -> None:
        two_cells = split(catalogue_net("two_cells"))
        machines = (COORDINATOR, "robot_a")
        driver = DryRunDriver([two_cells.subnet("robot_a")], 1.0)
        link = InProcessLink(Exchange(), Greeting("d", machines))
        run = Host(two_cells, driver, Recorder(two_cells.net, "", None, None, machines), machines=machines, link=link)
        task = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        why = Refusal(Diagnostic("F5020", "it holds another bundle", "give it this one"), are_unlike=True)
        assert run.peers.deciding == {coordinator_at("cell_a")}
        run.peers.refused((coordinator_at("cell_a"),), why)
        await asyncio.sleep(10)
        assert not task.done()
        task.cancel()
        await task

    run_in_virtual_time(main())


@pytest.mark.parametrize("unlike", UNLIKE, ids=["bundle", "version"])
@pytest.mark.parametrize("restarts", [False, True])
def test_a_host_that_was_let_in_is_ended_by_no_wrong_one(unlike: dict[str, Any], restarts: bool) -> None:
    async def main() -> None:
        hosts, journals = Hosts(), {A: MemoryJournal(), CENTRE: MemoryJournal()}
        tasks = {
            machines: asyncio.create_task(hosts.host(machines, journals[machines]).main()) for machines in journals
        }
        await asyncio.sleep(0.5)
        for machines in journals if restarts else (CENTRE,):
            tasks[machines].cancel()
            await tasks[machines]
        if restarts:
            tasks[A] = asyncio.create_task(hosts.host(A, journals[A]).main())
        wrong = asyncio.create_task(hosts.host(CENTRE, MemoryJournal(), **unlike).main())
        await asyncio.sleep(5)
        assert not tasks[A].done()
        assert not wrong.done(), "others may be let in by it"
        for task in (tasks[A], wrong):
            task.cancel()
            assert (await task).state is State.STOPPED

    run_in_virtual_time(main())


def test_a_second_host_of_a_machine_is_not_ended() -> None:
    async def main() -> None:
        hosts = Hosts()
        tasks = [asyncio.create_task(hosts.host(each, MemoryJournal()).main()) for each in (CENTRE, ("b",))]
        await asyncio.sleep(5)
        assert not any(task.done() for task in tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_a_host_under_several_coordinators_is_ended_by_all_of_them_alone() -> None:
    """One of them may be the wrong one."""

    async def main() -> None:
        two_cells = split(catalogue_net("two_cells"))
        machines = ("robot_a",)
        recorder = Recorder(two_cells.net, "", None, None, machines)
        driver = DryRunDriver([two_cells.subnet("robot_a")], 1.0)
        link = InProcessLink(Exchange(), Greeting("d", machines))
        run = Host(two_cells, driver, recorder, machines=machines, link=link)
        task = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        why = Refusal(Diagnostic("F5020", "it holds another bundle", "give it this one"), are_unlike=True)
        assert run.peers.deciding == {COORDINATOR, coordinator_at("cell_a")}
        run.peers.refused((COORDINATOR,), why)
        await asyncio.sleep(1)
        assert not task.done()
        run.peers.refused((coordinator_at("cell_a"),), why)
        assert (await refusal(task)).code == "F5020"

    run_in_virtual_time(main())


def test_a_refusal_is_told_once_by_each_who_refuses_and_by_who_is_refused_with_its_end(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, TOGETHER)
        await asyncio.sleep(2.5)
        lost = ("robot", "mc")
        await cell.kill(lost)
        cell.journals[lost] = MemoryJournal()
        cell.told.clear()
        cell.start(lost)
        assert (await refusal(cell.tasks[lost])).code == "F5025"
        refused = [sentence for kind, sentence in cell.told if kind == "refused"]
        assert [sentence.partition(" came back")[0] for sentence in refused] == [
            "the host of 'robot', 'mc' is refused: 'robot', 'mc'"
        ] * 2
        del cell.tasks[lost]
        await cell.stop()

    run_in_virtual_time(main())
