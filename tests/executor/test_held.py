"""A run that is held after a restart, with nobody there who could resume it, ends by telling how its cell stands."""

from __future__ import annotations

import asyncio
import io
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers import kinds
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.journal.journal import Journal, MemoryJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.nets.interchange import net_digest
from firable.nets.text import parse_net

NET = parse_net("""
firable: 1
cell: two devices
controllers:
  a: {start: free, places: {free: , busy: {send: {machine: A, command: WORK}, until: done}, gone: }}
  b: {start: idle, inputs: seen, places: {idle: , gone: }}
transitions:
  begin: {from: a.free, to: a.busy}
  end: {from: a.busy, to: a.gone}
  leave: {from: b.idle, to: b.gone, if: b.seen}
""")
BINDING = """
firable_bind: 1
cell: two devices
devices:
  A: {driver: theirs, memory: A, channels: {A: {number: number, taken: taken, done: done}}}
  B: {driver: theirs, memory: B, start_s: 4}
signals: {a.done: acknowledged, b.seen: {device: B, read: seen, on_loss: 0}}
commands: {a.busy: {device: A, channel: A, write: {code: 1}}}
"""


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)]
    monkeypatch.setattr(kinds, "entry_points", lambda **_: found)


def host(journal: Journal, *, resume: bool = False) -> Host:
    recorder = Recorder(NET, net_digest(NET), io.StringIO(), journal.kept(TRACE).get(KEY))
    return Host(
        split(NET), bound_driver(parse_binding(BINDING), NET), recorder, Conduct(resume=resume), journal=journal
    )


async def interrupted(*ends: MemoryEnd) -> Journal:
    """The journal of a run that was ended while the machine was busy."""
    for end in ends:
        end.values.update(dict.fromkeys(("taken", "done", "seen"), 0))
        await end.start(lambda _point, _value: None)
    journal = MemoryJournal()
    run = host(journal)
    ending = asyncio.create_task(run.main())
    await asyncio.sleep(2)
    assert run.marking == ("a.busy", "b.idle")
    run.stop()
    await ending
    return journal


def test_an_operator_of_a_held_run_is_heard_while_a_device_is_away_that_nobody_asks_after() -> None:
    async def main() -> None:
        answering, away = MemoryEnd("A"), MemoryEnd("B")
        journal = await interrupted(answering, away)
        answering.values.update({"taken": "?", "done": "?"})
        await away.cut()
        run = host(journal)
        run.served = True
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(2)
        assert not run.say("a.busy", Answer.DONE)
        run.stop()
        await ending

    run_in_virtual_time(main())


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize(("comes_after_s", "is_told"), [(0.0, False), (2.0, False), (60.0, True)])
def test_a_held_run_says_of_no_device_that_it_is_not_connected_before_its_start_is_over(
    comes_after_s: float, is_told: bool, resume: bool
) -> None:
    async def main() -> None:
        answering, late = MemoryEnd("A"), MemoryEnd("B")
        journal = await interrupted(answering, late)
        if resume:  # held all the same: nobody knows what became of its command
            answering.values.update({"taken": "?", "done": "?"})
        await late.cut()
        held = asyncio.create_task(host(journal, resume=resume).main())
        begun = asyncio.get_running_loop().time()
        asyncio.get_running_loop().call_later(comes_after_s, lambda: asyncio.ensure_future(late.mend()))
        ended = await held
        assert ended.state is State.HELD
        assert ("B is not connected: there is no memory" in ended.message) == is_told
        assert asyncio.get_running_loop().time() >= begun + min(comes_after_s, 4)

    run_in_virtual_time(main())
