"""When groups of acts are done, and what leaves: as soon as all is told, and nothing that the disk may still lose."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import pytest
from support.hosts import ended_within
from support.slow_disks import Rig, Waiting, turns

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import PATIENCE_S, until
from firable.executor.journal.outbox import Outbox
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.operating import acts, stopping
from firable.executor.operating.host import Host
from firable.executor.operating.situation import State
from firable.executor.operating.uncut import Patience
from firable.executor.protocol.messages import Keep
from firable.nets.diagnostics import InputError


def test_what_is_told_together_is_acted_upon_when_all_is_told_and_else_in_a_turn_of_the_loop() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running():
            rig.host.all_told()  # nothing is
            rig.host.signal("a.s", value=True, entry=None)
            rig.host.signal("b.key", value=True, entry=None)
            assert rig.machines.sent == []  # the driver is in the midst of something
            rig.host.all_told()
            assert rig.machines.sent == ["a.high", "b.working"]
            rig.host.signal("a.s", value=False, entry=None)
            await turns()
            assert rig.machines.sent == ["a.high", "b.working", "a.low"]

    asyncio.run(main())


def test_the_word_that_a_machine_has_its_command_is_acted_upon_before_the_next_signal() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running():
            rig.host.signal("a.s", value=True, entry=None)
            rig.host.all_told()
            assert rig.machines.sent == ["a.high"]
            assert not rig.host.controllers["a"].commands.unsent
            rig.host.signal("a.s", value=False, entry=None)
            rig.host.all_told()
            assert rig.machines.sent == ["a.high", "a.low"]

    asyncio.run(main())


def test_signals_are_taken_and_transitions_fire_while_the_disk_takes_its_time_and_nothing_leaves() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running():
            await rig.slow_from_now_on()
            rig.host.signal("b.key", value=True, entry=None)
            await turns()
            assert "b.working" in rig.host.marking
            assert rig.machines.sent == rig.fired == []
            await rig.answer()
            assert rig.machines.sent == ["a.high"]  # what was done during the sync waits for the next one
            assert rig.fired == ["up"]
            assert "b.working" not in str(rig.journal.durable["b"])
            await rig.answer()
            assert rig.machines.sent == ["a.high", "b.working"]
            assert rig.fired == ["up", "begin"]
            assert "b.working" in str(rig.journal.durable["b"])

    asyncio.run(main())


def test_an_emergency_stop_reaches_the_machines_while_the_disk_takes_its_time_and_nothing_is_commanded_after() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running() as ending:
            await rig.slow_from_now_on()
            rig.host.emergency_stop("a person")
            assert rig.machines.is_stopped
            assert not ending.done()
            await rig.answer()
            assert rig.machines.sent == []
            await rig.answer()
            situation = await ended_within(ending, PATIENCE_S)
            assert situation.state is State.STOPPED
            assert situation.is_emergency

    asyncio.run(main())


def test_a_stop_of_a_whole_cell_reaches_the_machines_while_the_disk_takes_its_time() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running() as ending:
            await rig.slow_from_now_on()
            rig.host.stop()
            assert rig.machines.is_stopped
            assert not ending.done()

    asyncio.run(main())


@pytest.mark.parametrize(
    "end",
    [Host.stop, lambda host: host.emergency_stop("a person"), lambda host: host.fail("a fault")],
    ids=["stop", "emergency stop", "fault"],
)
def test_a_disk_that_never_answers_ends_a_stop_as_an_error_and_what_it_was_given_never_leaves(
    end: Callable[[Host], object],
) -> None:
    async def main() -> None:
        rig = Rig()
        rig.host.patience = Patience(0.1)
        async with rig.running() as ending:
            await rig.slow_from_now_on()
            storing = rig.host.groups.storing
            assert storing is not None
            end(rig.host)
            with pytest.raises(InputError, match="the journal cannot be written: the disk does not answer"):
                await ended_within(ending, PATIENCE_S)
            assert rig.machines.is_stopped
            rig.journal.answers.release()  # after all
            await asyncio.wait([storing], timeout=PATIENCE_S)
            await turns()
            assert rig.machines.sent == rig.fired == []

    asyncio.run(main())


def test_a_host_among_others_stops_its_machines_when_its_stop_has_waited_and_its_disk_has_not_answered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stopping, "SETTLE_SECONDS", 0.05)

    async def main() -> None:
        rig = Rig()
        rig.host.is_whole = False
        async with rig.running() as ending:
            await rig.slow_from_now_on()
            rig.host.stop()
            assert not rig.machines.is_stopped, "others may wait for a word of it"
            await until(lambda: rig.machines.is_stopped, "the stop")
            assert not ending.done()

    asyncio.run(main())


def test_a_disk_that_fails_on_its_thread_ends_the_run_with_the_machines_stopped_and_nothing_left() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running() as ending:
            await rig.slow_from_now_on()
            rig.host.signal("b.key", value=True, entry=None)
            await turns()
            rig.journal.fails = True
            await rig.answer()
            with pytest.raises(InputError, match="the disk is full"):
                await ended_within(ending, PATIENCE_S)
            assert rig.machines.is_stopped
            assert rig.machines.sent == rig.fired == []

    asyncio.run(main())


def test_a_command_whose_token_has_left_before_the_disk_has_answered_is_not_sent() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running():
            rig.journal.is_slow = True
            rig.host.signal("b.key", value=True, entry=None)
            await turns()
            assert "b.working" in rig.host.marking
            rig.host.signal("b.worked", value=True, entry=None)  # as a sensor shows it, whoever has done it
            await turns()
            assert "b.working" not in rig.host.marking
            assert rig.machines.sent == []
            await rig.answer_all()
            assert rig.machines.sent == []
            assert [line["place"] for line in rig.lines if line.get("note") == "withdrawn"] == ["b.working"]

    asyncio.run(main())


def test_nobody_is_told_that_the_host_is_at_rest_before_the_disk_has_answered() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running():
            await rig.slow_from_now_on()
            quiet = asyncio.create_task(rig.host.quiet())
            await turns()
            assert not quiet.done()
            assert rig.host.situation().state is State.RUNNING
            await rig.answer()
            await rig.answer_all()  # its machine has taken the command, which is kept as well
            await asyncio.wait_for(quiet, PATIENCE_S)

    asyncio.run(main())


def test_a_run_ends_when_its_last_sync_is_over_and_not_before() -> None:
    async def main() -> None:
        rig = Rig()
        async with rig.running() as ending:
            rig.journal.is_slow = True
            rig.host.stop()
            await turns()
            assert not ending.done()
            await rig.answer()
            assert (await ended_within(ending, PATIENCE_S)).state is State.STOPPED
            assert rig.lines[-1]["end"] == "stopped"

    asyncio.run(main())


def test_a_disk_that_stands_still_lets_the_host_get_so_far_ahead_and_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(acts, "AHEAD_MAX", 20)

    async def main() -> None:
        rig = Rig()
        async with rig.running():
            await rig.slow_from_now_on()
            for i in range(100):
                rig.host.signal("b.key", value=i % 2 == 0, entry=None)
                await asyncio.sleep(0)
            ahead = len(rig.host.recorder.unwritten) + len(rig.host.acts.outbox)
            assert 20 < ahead < 30
            assert rig.host.acts.posted
            await rig.answer_all()
            assert not rig.host.acts.posted
            assert rig.host.is_quiet

    asyncio.run(main())


def test_what_a_thread_would_do_takes_no_virtual_time() -> None:
    async def main() -> float:
        loop = asyncio.get_running_loop()
        asyncio.get_running_loop().call_later(1000, lambda: None)
        assert await loop.run_in_executor(None, lambda: 7) == 7
        with pytest.raises(ValueError, match="no"):
            await loop.run_in_executor(None, int, "no")
        return loop.time()

    assert run_in_virtual_time(main()) == 0


def test_the_sqlite_journal_stores_on_another_thread_what_was_written_when_the_sync_began(tmp_path: Path) -> None:
    journal = SqliteJournal(tmp_path / "cell.journal", "d", ("a",))
    journal.write("a", [Keep("word", "1")])
    storing = journal.sync()
    assert storing is not None
    journal.write("a", [Keep("word", "2"), Keep("other", "3")])
    thread = Thread(target=storing)
    thread.start()
    thread.join()
    journal.close()
    again = SqliteJournal(tmp_path / "cell.journal", "d", ("a",))
    assert again.kept("a") == {"word": "1"}
    again.close()


def test_the_outbox_lets_go_in_the_order_of_the_acts_and_of_one_sync_at_a_time() -> None:
    outbox = Outbox[int]()
    left = []
    for number in range(10):
        outbox.add(number)
        if number in {2, 5, 9}:
            if outbox.is_under_way:
                left += outbox.over()
            outbox.begin()
    assert left == [0, 1, 2, 3, 4, 5]
    assert list(outbox) == [6, 7, 8, 9]
    outbox.remove(7)
    assert outbox.over() == [6, 8, 9]
    assert len(outbox) == 0


def test_a_trace_on_a_disk_that_stands_still_keeps_no_stop_from_the_machines(tmp_path: Path) -> None:
    async def main() -> None:
        rig = Rig(trace=(trace := Waiting(tmp_path / "trace.jsonl")))
        async with rig.running() as ending:
            trace.disk.is_slow = True
            rig.host.signal("a.s", value=True, entry=None)
            await turns()
            assert rig.host.acts.stored_in == "the trace"
            rig.host.signal("b.key", value=True, entry=None)  # what is told meanwhile is written next
            await turns()
            assert rig.machines.sent == []
            rig.host.stop()
            await turns()
            assert rig.machines.is_stopped
            assert not ending.done()
            trace.disk.answers.release(1000)
            assert (await ended_within(ending, PATIENCE_S)).state is State.STOPPED
        lines = (tmp_path / "trace.jsonl").read_text("utf-8").splitlines()
        assert [name for line in lines for name in json.loads(line).get("fired", ())] == ["up", "begin"]
        assert "end" in json.loads(lines[-1])

    asyncio.run(main())


def test_a_trace_whose_disk_never_answers_ends_a_stop_as_an_error(tmp_path: Path) -> None:
    async def main() -> None:
        rig = Rig(trace=(trace := Waiting(tmp_path / "trace.jsonl")))
        rig.host.patience = Patience(0.1)
        async with rig.running() as ending:
            trace.disk.is_slow = True
            rig.host.signal("a.s", value=True, entry=None)
            await turns()
            rig.host.stop()
            with pytest.raises(InputError, match=r"F1017.*the trace cannot be written: the disk does not answer"):
                await ended_within(ending, PATIENCE_S)
            assert rig.machines.is_stopped
            assert rig.machines.sent == []
            trace.close()  # which neither waits nor pulls the file from under who writes
            assert not trace.disk.closed
            trace.disk.answers.release(1000)

    asyncio.run(main())
