"""Signs of life: what a connection shows is believed when the device behind it has been seen to be alive on it."""

import asyncio
from collections.abc import Awaitable, Callable
from importlib.metadata import EntryPoint

import pytest
from support.third_party_driver import MemoryEnd

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers import kinds
from firable.executor.drivers.bench import Heard, until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.device import NoValue, Point, Value
from firable.executor.drivers.driver import Quality

BINDING = """
firable_bind: 1
cell: c
devices:
  D:
    {driver: theirs, memory: alive, retry_s: 0.1, grace_s: 0.3, start_s: 2,
     alive: {read: life, within_s: 0.4}, heartbeat: {write: beat, every_s: 0.05}, safe: {output: false}}
emergency_stop: {BUTTON}
signals:
  guard: {device: D, read: guard, on_loss: 0, force: true}
"""
BUTTON = "button: {device: D, read: button}"


@pytest.fixture(autouse=True)
def theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    one = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [one])


class Watched:
    """A driver, and the device that it watches: what it was written, and how its sign of life stands."""

    def __init__(self, *, button: bool = False, echoes: bool = False) -> None:
        self.end = MemoryEnd("alive")
        self.heard = Heard()
        self.echoes = echoes
        self.written: list[Point] = []
        self.signs = 0
        self.driver = BoundDriver(parse_binding(BINDING.replace("BUTTON", BUTTON if button else "")), (), frozenset())
        self.device = self.driver.devices["D"]

    def take(self, point: Point, value: Value) -> None:
        self.written.append(point)
        if self.echoes and point == "beat":
            self.end.show("life", value)

    def guard(self) -> tuple[bool | None, Quality]:
        reading = self.driver.readings()["guard"]
        return reading.value, reading.quality

    def lives(self) -> None:
        self.signs += 1
        self.end.show("life", self.signs)

    async def gone(self) -> None:
        """Give signs of life for a second, and none from then on, until its connection has failed."""
        for _ in range(10):
            self.lives()
            await asyncio.sleep(0.1)
        assert self.guard() == (True, Quality.GOOD)
        await asyncio.sleep(0.35)
        assert not self.device.is_ready.is_set()


def watched(test: Callable[[Watched], Awaitable[None]], *, button: bool = False, echoes: bool = False) -> Watched:
    """Do this while the driver runs."""

    async def main() -> Watched:
        w = Watched(button=button, echoes=echoes)
        await w.end.start(w.take)
        for point in ("guard", "button"):
            w.end.show(point, 1)
        w.end.show("life", 0)
        running = asyncio.create_task(w.driver.run(w.heard, w.heard))
        try:
            await test(w)
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
        return w

    one: Watched = run_in_virtual_time(main())
    return one


def test_the_time_of_grace_runs_on_over_connections_without_a_sign_of_life_and_its_end_is_lasting() -> None:
    async def test(w: Watched) -> None:
        await w.gone()
        await asyncio.sleep(0.2)
        assert w.device.kept.is_connected
        assert w.guard() == (True, Quality.GOOD), "the loss is borne as yet"
        await asyncio.sleep(0.2)
        for _ in range(50):
            assert w.guard() == (False, Quality.BAD)
            await asyncio.sleep(0.1)
        assert w.device.kept.connections > 5

    heard = watched(test).heard
    assert heard.signals == [("guard", True, None), ("guard", False, None)]
    assert heard.notes == [
        "D: connected",
        "D: not connected: silent: 'life' has not changed within 0.4 s",
        "D: has not confirmed its safe outputs: they are left to its watchdog",
    ]


def test_a_sign_of_life_that_has_changed_between_two_connections_proves_nothing_of_the_later_one() -> None:
    async def test(w: Watched) -> None:
        await w.gone()
        for _ in range(5):
            await until(lambda: not w.device.kept.is_connected, "the loss")
            w.lives()
            await until(lambda: w.device.kept.is_connected, "another connection")
            await asyncio.sleep(0.05)
            assert not w.device.is_ready.is_set()

    watched(test)


def test_a_server_that_has_no_value_of_the_sign_of_life_and_then_the_last_one_shows_no_sign_of_life() -> None:
    """So a server begins a connection when it has yet to ask, and what it asks may be a program that stands still."""

    async def test(w: Watched) -> None:
        await w.gone()
        w.end.show("life", NoValue("BadWaitingForInitialData"))
        for _ in range(20):
            await until(lambda: w.device.kept.is_connected, "another connection")
            for value in (w.signs, NoValue("BadNoCommunication"), w.signs, NoValue("Bad"), w.signs):
                w.end.show("life", value)
                await asyncio.sleep(0.01)
            assert not w.device.is_ready.is_set()
            w.end.show("life", NoValue("BadWaitingForInitialData"))

    watched(test)


def test_a_sign_of_life_that_stands_is_none_though_it_cannot_be_had_now_and_then() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(0.01)
        w.lives()
        await until(w.device.is_ready.is_set, "the connection")
        for _ in range(6):
            w.end.show("life", NoValue("BadNoCommunication"))
            await asyncio.sleep(0.05)
            w.end.show("life", w.signs)
            await asyncio.sleep(0.05)
        assert not w.device.is_ready.is_set()

    assert "D: not connected: silent: 'life' has not changed within 0.4 s" in watched(test).heard.notes


def test_what_was_shown_before_the_sign_of_life_changes_is_told_as_it_stands_then() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(0.01)
        w.driver.force("guard", value=True)
        for value in (0, 1, 0):
            w.end.show("guard", value)
            await asyncio.sleep(0.01)
        assert w.heard.signals == []
        assert w.guard() == (None, Quality.BAD)
        assert w.driver.unreached == ("D has not been seen to be alive",)
        assert "guard" not in w.written
        w.lives()
        await asyncio.sleep(0.01)
        assert w.heard.signals == [("guard", False, None)]
        assert w.written[-1] == "guard", "what was to be written has waited for it"

    watched(test)


def test_a_device_that_makes_its_sign_of_life_from_the_heartbeat_gets_it_before() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(1)
        assert w.device.is_ready.is_set()
        assert w.device.kept.connections == 1
        assert [point for point in w.written if point != "beat"] == ["output", "output"], "also when it is seen to live"

    watched(test, echoes=True)


def test_a_contact_that_is_open_stops_also_where_its_device_has_not_been_seen_to_be_alive() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(0.01)
        assert not w.driver.may_move, "it was shown as closed, which is not believed"
        w.end.show("button", 0)
        w.end.show("button", 1)
        await asyncio.sleep(0.01)
        assert w.driver.is_stopped

    assert watched(test, button=True).heard.emergencies == ["D: 'button' is open"]


def test_a_stop_drives_the_safe_outputs_of_a_device_that_has_not_been_seen_to_be_alive() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(0.01)
        w.written.clear()
        w.driver.stop()
        await asyncio.sleep(0.01)
        assert w.written[-1] == "output"
        assert not w.device.is_ready.is_set()

    watched(test)


def test_the_safe_outputs_of_a_stop_are_not_confirmed_by_who_takes_them_for_a_dead_device() -> None:
    """A broker, or the server of a control whose program stands still: the machines may be moving."""
    w = watched(Watched.gone)
    assert w.written[-1] == "output"
    assert w.driver.unconfirmed == ("D",)
    assert w.heard.notes[-1] == "D: has not confirmed its safe outputs: they are left to its watchdog"


def test_the_safe_outputs_of_a_stop_come_once_more_when_the_device_is_seen_to_be_alive() -> None:
    async def test(w: Watched) -> None:
        await w.gone()
        await until(lambda: w.device.kept.is_connected, "another connection")
        w.driver.stop()
        await asyncio.sleep(0.08)  # and then goes on between two heartbeats
        assert w.driver.unconfirmed == ("D",)
        w.written.clear()
        w.lives()
        await asyncio.sleep(0.01)
        assert w.written == ["output"]

    assert watched(test).driver.unconfirmed == ()


def test_a_device_that_makes_its_sign_of_life_from_the_heartbeat_confirms_a_stop_on_a_new_connection() -> None:
    async def test(w: Watched) -> None:
        await until(w.device.is_ready.is_set, "the connection")
        await w.end.cut()
        await until(lambda: not w.device.kept.is_connected, "the loss")
        w.driver.stop()
        w.written.clear()
        await w.end.mend()

    w = watched(test, echoes=True)
    assert w.driver.unconfirmed == ()
    assert [w.written[0], w.written[-1]] == ["output", "output"], "at once, and as the last thing"
    assert "beat" in w.written


def test_a_device_that_is_never_seen_to_be_alive_is_lost_when_its_start_is_over() -> None:
    async def test(w: Watched) -> None:
        await asyncio.sleep(1.9)
        assert w.guard() == (None, Quality.BAD)
        await asyncio.sleep(0.2)
        assert w.guard() == (False, Quality.BAD)
        assert w.driver.readings()["guard"].why == "not seen to be alive, by 'life', since the start"

    assert watched(test).heard.signals == [("guard", False, None)]
