"""A stop reaches the machines: after a link that was lost, over a write in flight, and however often it is said."""

import asyncio
from collections.abc import Sequence
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MEMORIES, MemoryConnection, MemoryEnd

from firable.executor.drivers import kinds
from firable.executor.drivers.bench import PATIENCE_S, Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.device import Point, Value, Writes

BINDING = """{firable_bind: 1, cell: c, devices: {D: {driver: theirs, memory: stopping, timeout_s: 1, retry_s: 0.02,
safe: {output: false}}}}"""


@pytest.mark.parametrize("when", ["link lost", "write in flight", "cancelled twice"])
def test_safe_outputs_are_driven_and_nothing_after_them(when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
    written: list[str] = []

    async def main() -> None:
        end, heard = MemoryEnd("stopping"), Heard()
        await end.start(lambda point, _: written.append(point))
        driver = BoundDriver(parse_binding(BINDING), (), frozenset())
        task = asyncio.create_task(driver.run(heard, heard))
        device = driver.devices["D"]
        await until(lambda: written == ["output"], "the safe outputs of the start")
        written.clear()
        end.faults.delay_s = 0.05
        if when == "link lost":
            await end.cut()
            await until(lambda: not device.is_ready.is_set(), "the loss")
        elif when == "write in flight":
            end.faults.delay_s = 60.0
            device.force("start", value=True)
            await until(lambda: device.kept.writing is not None, "the write")
            end.faults.delay_s = 0.0  # of the next one
        driver.stop()
        task.cancel()
        await asyncio.sleep(0.03)
        await end.mend()
        if when == "cancelled twice":
            task.cancel()
        await asyncio.wait((task,), timeout=PATIENCE_S)

    asyncio.run(main())
    # Where something was sent that may come late, once more behind it.
    assert written == ["output"] * (2 if when == "write in flight" else 1)


TWO = """{firable_bind: 1, cell: c, devices: {D: {driver: theirs, memory: gone, timeout_s: 0.1, retry_s: 0.02,
safe: {output: false}}, E: {driver: theirs, memory: there, timeout_s: 5, safe: {output: false}}}}"""


class Deaf(Heard):
    """A listener that cannot be told anything from some time on: its terminal is gone."""

    is_gone = False

    def driver_note(self, machine: str, message: str) -> None:
        if self.is_gone:
            raise BrokenPipeError(32, "Broken pipe")
        super().driver_note(machine, message)


@pytest.mark.parametrize("who", ["operator", "cancelled"])
def test_a_note_that_nobody_can_be_told_keeps_no_device_from_its_safe_outputs(
    who: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
    written: list[str] = []

    async def main() -> None:
        gone, there, heard = MemoryEnd("gone"), MemoryEnd("there"), Deaf()
        await gone.start(lambda _, __: None)
        await there.start(lambda point, _: written.append(point))
        driver = BoundDriver(parse_binding(TWO), (), frozenset())
        task = asyncio.create_task(driver.run(heard, heard))
        await until(lambda: written and driver.devices["D"].is_ready.is_set(), "the safe outputs of the start")
        await gone.cut()
        await until(lambda: not driver.devices["D"].is_ready.is_set(), "the loss")
        written.clear()
        heard.is_gone = True
        if who == "operator":
            with pytest.raises(BrokenPipeError):
                driver.stop()
        task.cancel()
        await asyncio.wait((task,), timeout=PATIENCE_S)
        assert driver.unconfirmed == ("D",)
        assert isinstance(task.exception(), BrokenPipeError)

    asyncio.run(main())
    assert written == ["output"]


class Mistaken(MemoryConnection):
    """A connection to the memory `gone` whose library has a mistake, which shows once."""

    at = ""

    async def read(self) -> Sequence[tuple[Point, Value]]:
        shown = await super().read()
        self.fails("read", self.end)
        return shown

    async def write(self, writes: Writes) -> None:
        self.fails("write", self.end)
        await super().write(writes)

    async def close(self) -> None:
        await super().close()
        self.fails("close", self.end)

    @classmethod
    def fails(cls, at: str, end: MemoryEnd) -> None:
        if cls.at == at and end is MEMORIES["gone"]:
            cls.at = ""
            raise AttributeError(f"no {at}")


@pytest.mark.parametrize("at", ["read", "write", "close", "what is shown", "stopped"])
def test_a_mistake_of_a_library_stops_its_device_as_any_other_and_is_a_fault(
    at: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [entry])
    monkeypatch.setattr("support.third_party_driver.MemoryConnection", Mistaken)
    monkeypatch.setattr(Mistaken, "at", "")
    written: list[str] = []
    heard = Heard()

    async def main() -> None:
        ends = [MemoryEnd("gone"), MemoryEnd("there")]
        await ends[0].start(lambda point, _: written.append(f"D {point}"))
        await ends[1].start(lambda point, _: written.append(f"E {point}"))
        driver = BoundDriver(parse_binding(TWO.replace("timeout_s: 0.1", "timeout_s: 1")), (), frozenset())
        task = asyncio.create_task(driver.run(heard, heard))
        await until(lambda: len(written) == 2, "the safe outputs of the start")
        written.clear()
        if at == "what is shown":  # and shown again at each connection
            monkeypatch.setattr(driver.devices["D"].image, "take", lambda *_: int("x"))
        elif at == "stopped":
            monkeypatch.setattr(Mistaken, "at", "write")
            driver.stop()
        else:
            monkeypatch.setattr(Mistaken, "at", at)
        if at == "close":
            await ends[0].cut()
            await ends[0].mend()
        elif at == "write":
            driver.devices["D"].force("start", value=True)
        else:
            ends[0].show("output", 1)
        await asyncio.wait((task,), timeout=PATIENCE_S)
        assert isinstance(task.exception(), (AttributeError, ValueError))
        assert all(device.kept.is_safe for device in driver.devices.values())

    asyncio.run(main())
    assert sorted(written) == ["D output"] * (2 if at == "write" else 1) + ["E output"]
    assert [fault.split(",")[0] for fault in heard.faults] == ["D: its driver has failed"] * (at != "stopped")
