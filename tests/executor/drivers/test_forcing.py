"""What a person forces and sends goes out on one connection, once, and it is known what has become of it."""

import asyncio
from collections.abc import Callable, Coroutine
from importlib.metadata import EntryPoint
from typing import Any

import pytest
from support.third_party_driver import MemoryEnd

from firable.executor.drivers import kinds
from firable.executor.drivers.bench import Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.nets.net import Command, Place

BINDING = """
{firable_bind: 1, cell: c, devices: {D: {driver: theirs, memory: forced, timeout_s: 5, retry_s: 0.02,
retry_max_s: 0.05, safe: {out: false}, channels: {A: {number: go, taken: has, done: did}}}},
signals: {a.key: {device: D, read: key, force: true, on_loss: hold}}, commands: {a.away: {device: D, channel: A}}}
"""
AWAY = Place("a.away", command=Command("A", "MOVE"))


def with_driver(
    act: Callable[[BoundDriver, MemoryEnd], Coroutine[Any, Any, None]], monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """Do something to a driver that has not been started, and to its device, which is out of reach; what is written."""
    entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
    written: list[str] = []

    async def main() -> None:
        end, heard = MemoryEnd("forced"), Heard()
        await end.start(lambda point, _: written.append(point))
        end.show("key", value=False)
        await end.cut()
        driver = BoundDriver(parse_binding(BINDING), (), frozenset())
        task = asyncio.create_task(driver.run(heard, heard))
        try:
            await act(driver, end)
        finally:
            task.cancel()
            await asyncio.wait((task,))

    asyncio.run(main())
    return written


def test_what_is_forced_before_there_is_a_connection_is_done_on_the_first_one_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        forcing = driver.force("a.key", value=True)
        await asyncio.sleep(0.1)
        assert (forcing.is_done, forcing.refused) == (False, "")
        await end.mend()
        await until(lambda: forcing.is_done, "the value is written")
        await end.cut()
        await end.mend()
        await until(lambda: driver.devices["D"].kept.connections == 2, "the next connection")
        assert not forcing.refused

    assert with_driver(act, monkeypatch) == ["out", "key", "out"]


def test_what_is_not_confirmed_before_its_connection_is_lost_is_not_written_on_a_later_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        device = driver.devices["D"]
        await end.mend()
        await until(device.is_ready.is_set, "the connection")
        end.faults.delay_s = 60.0
        forcings = [driver.force("a.key", value=True), driver.force("a.key", value=False)]
        await until(lambda: device.kept.writing is not None, "the write")
        end.faults.delay_s = 0.0
        await end.cut()
        await until(lambda: not device.is_ready.is_set(), "the loss")
        await end.mend()
        await until(device.is_ready.is_set, "the next connection")
        await until(lambda: not device.is_writing, "nothing is left to be written")
        assert [(one.is_done, one.refused) for one in forcings] == [(False, "the memory is gone")] * 2

    assert "key" not in with_driver(act, monkeypatch)


def test_what_no_connection_was_there_for_is_known_not_to_be_written_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    forcings = []

    async def act(driver: BoundDriver, _: MemoryEnd) -> None:
        forcings.append(driver.force("a.key", value=True))
        await until(lambda: driver.devices["D"].noted, "the first try")
        driver.stop()
        forcings.append(driver.force("a.key", value=True))

    assert with_driver(act, monkeypatch) == []
    assert {(one.is_done, one.refused) for one in forcings} == {(False, "D is not connected: there is no memory")}


def test_what_is_sent_by_hand_where_there_is_no_connection_is_never_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that is plugged in minutes later must not move by what nobody remembers."""

    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        await until(lambda: driver.devices["D"].noted, "the first try")
        sending = driver.send_by_hand(AWAY)
        assert (sending.is_done, sending.refused) == (False, "D is not connected: there is no memory")
        await end.mend()
        await until(driver.devices["D"].is_ready.is_set, "the connection")
        await until(lambda: not driver.devices["D"].is_writing, "nothing is left to be written")

    assert with_driver(act, monkeypatch) == ["out", "out"]


def test_what_was_sent_by_hand_and_not_taken_is_given_up_with_its_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        device = driver.devices["D"]
        await end.mend()
        await until(device.is_ready.is_set, "the connection")
        sendings = [driver.send_by_hand(AWAY) for _ in range(2)]
        end.show("has", 1)
        await until(lambda: sendings[0].is_done, "the first is taken")
        end.show("has", 0)  # it was cleared, as both have one number
        await until(lambda: not device.is_writing, "the second is written")
        await end.cut()
        await until(lambda: not device.is_ready.is_set(), "the loss")
        await end.mend()
        await until(device.is_ready.is_set, "the next connection")
        await until(lambda: not device.is_writing, "nothing is left to be written")
        assert [(one.is_done, one.refused) for one in sendings] == [(True, ""), (False, "the memory is gone")]

    assert with_driver(act, monkeypatch) == ["out", "go", "go", "go", "out"]


def test_what_is_sent_by_hand_and_was_not_taken_until_the_end_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    sendings = []

    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        await end.mend()
        await until(driver.devices["D"].is_ready.is_set, "the connection")
        sendings.append(driver.send_by_hand(AWAY))
        await until(lambda: not driver.devices["D"].is_writing, "the command is written")
        driver.stop()
        sendings.append(driver.send_by_hand(AWAY))

    with_driver(act, monkeypatch)
    assert {(one.is_done, one.refused) for one in sendings} == {(False, "D was stopped before")}
