"""A host that comes back with an older copy of its journal is refused by whoever has heard of more, and ends."""

import asyncio
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule
from support.examples import examples
from support.hosts import CENTRE, ONE_EACH, ROBOT, Cell
from support.link_rigs import Heard
from support.slow_disks import Slow
from support.two_hosts import Hosts, refusal

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import until
from firable.executor.journal.journal import MemoryJournal
from firable.executor.journal.memory import HOSTS, keeping, remembered
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting
from firable.executor.links.storages import Memory, Met, Storage
from firable.executor.operating.acquaintances import Acquaintances
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.protocol.messages import Hello, Keep


@pytest.mark.parametrize("lost", ONE_EACH, ids=lambda machines: machines[0] or "coordinator")
@pytest.mark.parametrize("lives", [0, 1], ids=["in the life in which it is lost", "in an earlier life"])
@pytest.mark.parametrize("all_restart", [False, True], ids=["others live on", "others are started anew, too"])
def test_a_host_with_an_older_copy_of_its_journal_ends_and_the_others_go_on_when_it_has_the_last(
    lost: tuple[str, ...], lives: int, all_restart: bool, tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.3)
        copy = deepcopy(cell.journals[lost])
        for _ in range(lives):
            await cell.kill(lost)
            cell.start(lost, resume=True)
        await asyncio.sleep(9)
        await cell.kill(lost)
        await asyncio.sleep(0.1)
        if all_restart:
            for machines in cell.journals:
                if machines != lost:
                    await cell.kill(machines)
                    cell.start(machines, resume=True)
        trace, kept = cell.path(lost).read_bytes(), cell.journals[lost]
        cell.journals[lost] = copy
        before = sum(Recorder(cell.net, "", None, copy.kept(TRACE).get(KEY), lost).firings.values())
        cell.start(lost, resume=True)
        problem = await refusal(cell.tasks[lost])
        assert problem.code == "F5025"
        assert "this host has an older copy" in problem.message
        assert sum(cell.hosts[lost].recorder.firings.values()) == before
        assert any("came back without the last that was kept" in told for kind, told in cell.told if kind == "refused")
        cell.path(lost).write_bytes(trace)
        cell.journals[lost] = kept
        before = cell.firings()
        cell.start(lost, resume=True)
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings == cell.firings() > before + 10

    run_in_virtual_time(main())


def test_a_host_with_an_older_copy_ends_also_where_others_were_met_that_have_heard_nothing_later() -> None:
    async def main() -> None:
        hosts, memory, journal = Hosts(), MemoryJournal(), MemoryJournal()
        journal.write(HOSTS, keeping(Memory(Storage("of a"), {COORDINATOR: Met("of c")})))
        memory.write(HOSTS, keeping(Memory(Storage("of c"), {"a": Met("of a", "before", 1000)})))
        run = hosts.host(("a",), journal)
        ending = asyncio.create_task(run.main())
        tasks = [asyncio.create_task(hosts.host(("b",), MemoryJournal()).main())]
        await asyncio.sleep(3)
        assert run.peers.met == {"b"}
        tasks.append(asyncio.create_task(hosts.host((COORDINATOR,), memory).main()))
        problem = await refusal(ending)
        assert "the host of the coordinator has worked with a later state of the journal of 'a'" in problem.message
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_what_was_heard_of_a_storage_is_kept_while_all_is_well_and_when_its_host_is_lost(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)

        def kept() -> Met:
            return remembered(cell.journals[CENTRE].kept(HOSTS), 0).known["robot"]

        await asyncio.sleep(2)
        first = kept()
        await asyncio.sleep(9)
        later = kept()
        assert later.age > first.age
        assert (later.name, later.life) == (first.name, first.life)
        known = cell.hosts[CENTRE].acquaintances
        while known.ages[first.life] == later.age:
            await asyncio.sleep(0.01)
        age = known.ages[first.life]
        assert kept().age < age <= cell.hosts[ROBOT].peers.age
        cell.exchange.cut(cell.links[ROBOT])
        assert kept() == replace(later, age=age)
        cell.exchange.mend(cell.links[ROBOT])
        await cell.kill(ROBOT)
        cell.start(ROBOT, resume=True)
        await asyncio.sleep(9)
        assert kept().life == cell.hosts[ROBOT].acquaintances.storage.life != first.life
        assert kept().age > age
        await cell.stop()

    run_in_virtual_time(main())


def test_an_older_copy_stays_one_however_often_it_was_started_where_nobody_is(tmp_path: Path) -> None:
    """Each start keeps something, so that the copy has been made durable as often as what it is a copy of."""

    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.3)
        copy = deepcopy(cell.journals[ROBOT])
        await asyncio.sleep(5)
        await cell.kill(ROBOT)
        exchange, cell.exchange = cell.exchange, Exchange()
        cell.journals[ROBOT], last = copy, cell.journals[ROBOT]
        while copy.age < last.age + 5:
            cell.start(ROBOT, resume=True)
            await asyncio.sleep(1)
            await cell.kill(ROBOT)
        cell.exchange = exchange
        cell.start(ROBOT, resume=True)
        assert (await refusal(cell.tasks[ROBOT])).code == "F5025"
        cell.journals[ROBOT] = last
        cell.start(ROBOT, resume=True)
        before = cell.firings()
        await asyncio.sleep(30)
        assert cell.firings() > before + 10
        await cell.stop()

    run_in_virtual_time(main())


def test_what_was_heard_last_outlives_an_end_in_order(tmp_path: Path) -> None:
    async def main() -> None:
        hosts = Hosts()
        journal = SqliteJournal(tmp_path / "a.journal", "d", ("a",))
        run, other = hosts.host(("a",), journal), hosts.host(("b", COORDINATOR), MemoryJournal())
        tasks = [asyncio.create_task(each.main()) for each in (run, other)]
        await asyncio.sleep(2)
        run.peers.arrived(COORDINATOR, "a", Hello("a", 0, -1, 0), 10**6)
        tasks[0].cancel()
        await tasks[0]
        journal.close()
        tasks[1].cancel()
        await tasks[1]
        again = SqliteJournal(tmp_path / "a.journal", "d", ("a",))
        assert remembered(again.kept(HOSTS), again.age).known[COORDINATOR].age == 10**6
        again.close()

    asyncio.run(main())


@pytest.mark.parametrize("paused", [ONE_EACH, (ROBOT,)], ids=["all", "robot"])
def test_hosts_that_do_nothing_keep_nothing_but_once_a_minute(
    paused: tuple[tuple[str, ...], ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits is said again every few seconds, and each time an age is heard that may be a new one."""
    synced: list[MemoryJournal] = []
    monkeypatch.setattr(MemoryJournal, "sync", lambda journal: synced.append(journal))

    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(3)
        for machines in paused:
            cell.hosts[machines].pause()
        await asyncio.sleep(60)
        synced.clear()
        await asyncio.sleep(3600)
        for journal in cell.journals.values():
            assert synced.count(cast(MemoryJournal, journal)) <= 61
        for machines in paused:
            assert cell.hosts[machines].resume()
        await asyncio.sleep(10)
        await cell.stop()

    run_in_virtual_time(main())


def test_nothing_is_said_in_a_life_that_the_journal_does_not_keep_yet() -> None:
    """A crash would lose the life, and who had heard of it would refuse the journal for ever."""

    async def main() -> None:
        hosts, journal = Hosts(), Slow()
        run = hosts.host(("a",), journal)
        task = asyncio.create_task(run.main())
        await asyncio.sleep(0.05)
        journal.is_slow = True
        run.acts.repeat()
        run.acts.have_kept()
        await until(lambda: run.groups.storing is not None, "a sync")
        assert len(run.acts.outbox) > 0, "a report waits for it"
        heard = Heard()
        link = asyncio.create_task(InProcessLink(hosts.exchange, Greeting("d", ("b", COORDINATOR))).run(heard))
        await heard.until_told(("connected", "a"))
        journal.answers.release()
        before, life = run.groups.storing, run.acquaintances.storage.life
        await until(lambda: run.groups.storing is not before, "the next sync")
        await asyncio.sleep(0.05)
        assert life not in str(journal.durable)
        assert not heard.messages
        journal.answers.release(100)
        await heard.until(lambda: bool(heard.messages))
        assert life in str(journal.durable)
        for each in (task, link):
            each.cancel()
        await asyncio.gather(task, link, return_exceptions=True)

    asyncio.run(main())


class Journals(RuleBasedStateMachine):
    """A journal, its copies and theirs, and another host; what they hold is told by marks.

    One is let in exactly where it holds all of which the other host has heard.
    """

    def __init__(self) -> None:
        super().__init__()
        self.marks = iter(range(10**9))
        self.other = Acquaintances(MemoryJournal(), is_linked=True)
        self.heard: set[str] = set()
        self.copies: list[MemoryJournal] = []
        self.journal = MemoryJournal()
        self.start(self.journal)

    def holds(self, journal: MemoryJournal) -> set[str]:
        return set(journal.kept("a"))

    def start(self, journal: MemoryJournal) -> None:
        process = Acquaintances(journal, is_linked=True)
        is_let_in = self.other.memory.estranged(["a"], process.storage) is None
        assert is_let_in == (self.heard <= self.holds(journal))
        self.keep(journal)
        if is_let_in:
            self.other.met("a", process.storage)
            assert process.met("b", self.other.storage)
            process.write()
            process.is_alive = True
            self.journal, self.process = journal, process

    def keep(self, journal: MemoryJournal) -> None:
        journal.write("a", [Keep(f"mark {next(self.marks)}", True)])

    @rule()
    def something_becomes_durable(self) -> None:
        self.keep(self.journal)

    @rule()
    def a_message_is_heard(self) -> None:
        self.heard = self.holds(self.journal)
        self.other.heard("a", self.journal.age)

    @rule()
    def the_line_is_cut_and_mended(self) -> None:
        assert self.other.memory.estranged(["a"], self.process.storage) is None
        self.other.met("a", self.process.storage)
        assert not self.process.met("b", self.other.storage)

    @rule()
    def the_other_host_is_started_anew(self) -> None:
        self.other.write()
        self.other = Acquaintances(self.other.journal, is_linked=True)
        self.other.met("a", self.process.storage)

    @rule()
    def a_copy_is_made(self) -> None:
        self.copies.append(deepcopy(self.journal))

    @rule()
    def it_is_started_anew(self) -> None:
        self.start(self.journal)

    @precondition(lambda self: self.copies)
    @rule(data=st.data())
    def a_copy_is_started_or_started_again(self, data: st.DataObject) -> None:
        copy = data.draw(st.sampled_from(self.copies))
        before = self.journal
        self.start(copy)
        if self.journal is copy:
            self.copies = [before if one is copy else one for one in self.copies]


TestJournals = Journals.TestCase
TestJournals.settings = examples(100)


def test_an_age_that_was_overtaken_takes_nothing_back() -> None:
    known = Acquaintances(MemoryJournal(), is_linked=True)
    known.met("a", Storage("of a").in_new_life("first", 2))
    assert known.memory.known["a"] == Met("of a")
    for ages in ((3, 7, 5), (6,)):
        for age in ages:
            known.heard("a", age)
        assert known.memory.known["a"] == Met("of a", "first", 7)
    known.write()
    again = Acquaintances(known.journal, is_linked=True)
    again.met("a", Storage("of a").in_new_life("first", 2))
    again.heard("a", 5)
    assert again.memory.known["a"] == Met("of a", "first", 7)
