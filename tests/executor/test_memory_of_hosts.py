"""Hosts remember each other's journals: one that comes back without its own is refused, and moves nothing."""

import asyncio
from contextlib import closing
from pathlib import Path

import pytest
from support.hosts import CENTRE, ONE_EACH, ROBOT, Cell
from support.two_hosts import SPLIT, Counting, Hosts, refusal

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.journal.memory import HOSTS, keeping
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import HELD_BACK_MAX, Recorder, TraceFile
from firable.executor.operating.situation import State
from firable.nets.text import parse_net

CONVEYOR = ("conveyor",)
LAMP = """\
firable: 1
cell: cell
controllers:
  a: {start: free, places: {free: , over: }}
  b: {start: idle, places: {idle: , has: }}
  c: {start: dark, places: {dark: , lit: {send: {machine: C, command: SHINE}}}}
transitions:
  hand: {from: [a.free, b.idle], to: [a.over, b.has]}
  light: {from: c.dark, to: c.lit}
"""
"""c talks to nobody."""


@pytest.mark.parametrize("lost", ONE_EACH, ids=lambda machines: machines[0] or "coordinator")
@pytest.mark.parametrize("after_seconds", [0.5, 2.5, 7.9])
def test_a_host_without_its_journal_ends_and_the_others_go_on_when_it_has_it_again(
    lost: tuple[str, ...], after_seconds: float, tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(after_seconds)
        await cell.kill(lost)
        trace, kept = cell.path(lost).read_bytes(), cell.journals[lost]
        cell.journals[lost] = MemoryJournal()
        cell.start(lost)
        problem = await refusal(cell.tasks[lost])
        assert problem.code == "F5025"
        assert "has worked with another journal of" in problem.message
        assert not sum(cell.hosts[lost].recorder.firings.values())
        assert any("came back without what was kept there" in sentence for kind, sentence in cell.told)
        cell.path(lost).write_bytes(trace)
        cell.journals[lost] = kept
        before = cell.firings()
        cell.start(lost, resume=True)
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings == cell.firings() > before + 10

    run_in_virtual_time(main())


def test_a_host_that_is_stopped_while_it_is_held_says_so_at_its_end(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.5)
        await cell.kill(ROBOT)
        cell.start(ROBOT)
        await asyncio.sleep(5)
        for machines, ended in (await cell.stop()).items():
            assert ended.state is State.STOPPED
            assert ("nothing moves until it is resumed" in ended.message) == (machines == ROBOT)

    run_in_virtual_time(main())


def test_a_host_that_begins_anew_moves_nothing_before_it_has_met_another() -> None:
    async def main() -> None:
        hosts = Hosts()
        run = hosts.host(("a",), journal := MemoryJournal())
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(10)
        assert hosts.driver.sent == 0
        assert run.marking == ("a.free",)
        assert "nothing moves here before another host of the cell has been met" in run.situation().message
        run.pause()
        assert await run.step() is None
        assert run.resume()
        await asyncio.sleep(1)
        assert hosts.driver.sent == 0
        other = asyncio.create_task(hosts.host(("b", COORDINATOR), MemoryJournal()).main())
        await asyncio.sleep(10)
        assert hosts.driver.sent == 1
        assert run.marking == ("a.over",)
        assert "nothing moves" not in run.situation().message
        run.stop()
        assert (await ending).state is State.STOPPED
        # It knows them now, and needs nobody to go on with what it does alone.
        other.cancel()
        await other
        assert not hosts.host(("a",), journal).peers.is_unmet

    run_in_virtual_time(main())


def test_a_pause_outlasts_the_first_meeting() -> None:
    async def main() -> None:
        hosts = Hosts()
        run = hosts.host(("a",), MemoryJournal())
        tasks = [asyncio.create_task(run.main())]
        await asyncio.sleep(1)
        run.pause()
        tasks.append(asyncio.create_task(hosts.host(("b", COORDINATOR), MemoryJournal()).main()))
        await asyncio.sleep(5)
        assert (run.marking, hosts.driver.sent) == (("a.free",), 0)
        assert run.resume()
        await asyncio.sleep(5)
        assert run.marking == ("a.over",)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_a_cell_that_was_begun_anew_is_not_ended_by_a_host_of_the_old_one(tmp_path: Path) -> None:
    """It remembers other journals, and is held after its restart; who is at work is only told."""

    async def main() -> None:
        old = Cell(tmp_path)
        await asyncio.sleep(3)
        await old.stop()
        folder = tmp_path / "anew"
        folder.mkdir()
        cell = Cell(folder, (CENTRE, ("system",), ("mc",), CONVEYOR))
        await asyncio.sleep(3)
        cell.journals[ROBOT] = old.journals[ROBOT]
        old.path(ROBOT).rename(cell.path(ROBOT))
        cell.start(ROBOT)
        await asyncio.sleep(3)
        assert not any(cell.tasks[machines].done() for machines in (CENTRE, ("system",), ("mc",), CONVEYOR))
        refused = [sentence for kind, sentence in cell.told if kind == "refused"]
        assert any("the coordinator came back without what was kept there" in sentence for sentence in refused)
        ours = "this host is refused: the host of 'robot' has worked with another journal of the coordinator than"
        assert any(ours in sentence for sentence in refused)
        assert cell.hosts[ROBOT].situation().state is State.HELD
        for task in cell.tasks.values():
            task.cancel()
        await asyncio.gather(*cell.tasks.values())

    run_in_virtual_time(main())


def test_a_host_that_is_to_be_resumed_by_itself_waits_until_it_has_met_another(tmp_path: Path) -> None:
    """Its journal may be that of yesterday; an operator who resumes it before sees where it stands."""

    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.5)
        for machines in ONE_EACH:
            await cell.kill(machines)
        cell.start(ROBOT, resume=True)
        host = cell.hosts[ROBOT]
        await asyncio.sleep(5)
        assert host.situation().state is State.HELD
        waiting = "it is resumed when another host of the cell has been met: until then it may have another journal"
        assert ("held", waiting) in cell.told
        for machines in ONE_EACH:
            if machines != ROBOT:
                cell.start(machines, resume=True)
        await asyncio.sleep(30)
        assert not host.controllers["robot"].held
        await cell.stop()
        assert cell.replayed().complete

    run_in_virtual_time(main())


def test_what_a_host_remembers_outlives_it_in_its_journal(tmp_path: Path) -> None:
    async def main() -> None:
        hosts = Hosts()
        journal = SqliteJournal(tmp_path / "a.journal", "d", ("a",))
        run = hosts.host(("a",), journal)
        other = hosts.host(("b", COORDINATOR), MemoryJournal())
        tasks = [asyncio.create_task(each.main()) for each in (run, other)]
        await asyncio.sleep(5)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)
        journal.close()
        again = SqliteJournal(tmp_path / "a.journal", "d", ("a",))
        memory = hosts.host(("a",), again).peers.memory
        assert memory.known == run.peers.memory.known
        assert memory.storage.name == run.peers.memory.storage.name
        before, now = memory.storage.lives
        assert (before.name, before.began) == (run.peers.memory.storage.life, 0)
        assert now.began == again.age >= run.peers.age
        storages = {(known.name, known.life) for known in memory.known.values()}
        assert storages == {(other.peers.memory.storage.name, other.peers.memory.storage.life)}
        again.close()

    asyncio.run(main())


def test_what_a_journal_is_called_is_stored_before_anybody_is_told(tmp_path: Path) -> None:
    """Or a host that is killed as soon as it was met would come back by another name, and be refused."""
    path = tmp_path / "a.journal"
    with closing(SqliteJournal(path, "d", ("a",))) as journal:
        called = Hosts().host(("a",), journal).peers.memory.storage.name  # and here it is killed
    with closing(SqliteJournal(path, "d", ("a",))) as journal:
        assert Hosts().host(("a",), journal).peers.memory.storage.name == called


def test_a_host_whose_machines_talk_to_nobody_moves_nothing_either_before_another_host_is_met() -> None:
    async def main() -> None:
        alone = split(parse_net(LAMP))
        exchange, driver = Exchange(), Counting([alone.subnet("c")], 1.0)

        def host(*machines: str) -> Host:
            link = InProcessLink(exchange, Greeting("d", machines))
            recorder = Recorder(alone.net, "", None, None, machines)
            devices = driver if machines == ("c",) else DryRunDriver([], 1.0)
            return Host(alone, devices, recorder, machines=machines, link=link)

        tasks = [asyncio.create_task(host("c").main())]
        await asyncio.sleep(10)
        assert driver.sent == 0
        tasks.append(asyncio.create_task(host("a", "b", COORDINATOR).main()))
        await asyncio.sleep(3)
        assert driver.sent > 0
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_a_host_that_has_met_only_those_who_cannot_know_it_ends_when_one_does() -> None:
    async def main() -> None:
        hosts, memory = Hosts(), MemoryJournal()
        memory.write(HOSTS, keeping(Memory(Storage("of the coordinator"), {"a": Met("of another journal")})))
        run = hosts.host(("a",), MemoryJournal())
        ending = asyncio.create_task(run.main())
        tasks = [asyncio.create_task(hosts.host(("b",), MemoryJournal()).main())]
        await asyncio.sleep(3)
        assert run.peers.met == {"b"}
        assert hosts.driver.sent == 0
        tasks.append(asyncio.create_task(hosts.host((COORDINATOR,), memory).main()))
        assert (await refusal(ending)).code == "F5025"
        assert hosts.driver.sent == 0
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_lines_that_wait_until_a_host_is_let_in_are_not_many(tmp_path: Path) -> None:
    """The journal keeps them anew with each group."""
    trace = tmp_path / "a.trace"
    trace.write_text("what stood there")
    recorder = Recorder(SPLIT.net, "", TraceFile(trace), None, ("a",))
    recorder.may_write = False
    for _ in range(HELD_BACK_MAX - 1):
        recorder.note(0.0, "told")
        assert recorder.writing() is None
    assert trace.read_text() == "what stood there"
    recorder.note(0.0, "told")
    writing = recorder.writing()
    assert writing is not None
    writing()
    assert trace.read_text().count("\n") == HELD_BACK_MAX + 1
