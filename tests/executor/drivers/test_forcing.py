"""What is forced on a device is written on one connection, once, and it is known what has become of it."""

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

BINDING = """
{firable_bind: 1, cell: c, devices: {D: {driver: theirs, memory: forced, timeout_s: 5, retry_s: 0.02,
retry_max_s: 0.05, safe: {out: false}}}, signals: {a.key: {device: D, read: key, force: true, on_loss: hold}}}
"""


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


def test_what_is_forced_before_there_is_a_connection_is_written_on_the_first_one_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def act(driver: BoundDriver, end: MemoryEnd) -> None:
        forcing = driver.force("a.key", value=True)
        await asyncio.sleep(0.1)
        assert (forcing.is_written, forcing.refused) == (False, "")
        await end.mend()
        await until(lambda: forcing.is_written, "the value is written")
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
        assert [(one.is_written, one.refused) for one in forcings] == [(False, "the memory is gone")] * 2

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
    assert {(one.is_written, one.refused) for one in forcings} == {(False, "D is not connected: there is no memory")}
