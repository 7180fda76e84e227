"""Devices that misbehave for long: they are not connected to, and not told of, as often as they do."""

import asyncio
from collections.abc import Sequence
from itertools import pairwise

import pytest

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import Heard, bench_net, until
from firable.executor.drivers.binding import SignalDocument, parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.bound_device import BoundDevice
from firable.executor.drivers.device import LinkError, NoValue, Point, Value, Wanted, Writes
from firable.executor.drivers.driver import Quality
from firable.executor.drivers.image import Image
from firable.executor.drivers.keeping import Kept, Nobody
from firable.executor.drivers.modbus import TCP, TcpOptions

FLAPPING = """{firable_bind: 1, cell: c, devices: {D: {driver: modbus-tcp, host: h, timeout_s: TIMEOUT, retry_s: 0.02,
retry_max_s: 0.5, heartbeat: {write: holding 0, every_s: 0.01}}}}"""


class Refusing:
    """A device that can be read, and refuses what is written to it."""

    options = TcpOptions
    through_broker = False

    def __init__(self) -> None:
        self.connections_at: list[float] = []
        self.stands_s = 0.0
        """For how long it takes a write before it refuses it."""

    async def connect(self, options: object, wanted: Wanted) -> "Refusing":
        """Be connected."""
        del options, wanted
        self.connections_at.append(asyncio.get_running_loop().time())
        self.is_first = True
        return self

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """Show something, once."""
        if not self.is_first:
            await asyncio.get_running_loop().create_future()
        self.is_first = False
        return (("discrete 0", True),)

    async def write(self, writes: Writes) -> None:
        """Refuse it."""
        del writes
        await asyncio.sleep(self.stands_s)
        raise LinkError("the device refuses holding 0: exception 2")

    async def close(self) -> None:
        """Nothing to be done."""

    point_problem = TCP.point_problem
    load = TCP.load


class RefusingLater(Refusing):
    """A device that takes the safe outputs, and refuses a heartbeat."""

    async def write(self, writes: Writes) -> None:
        """Take what is safe."""
        if writes[0][0] != "holding 1":
            await super().write(writes)


@pytest.mark.parametrize("is_stable", [False, True])
def test_the_pause_before_a_new_connection_grows_until_one_has_stood_for_a_while(is_stable: bool) -> None:
    async def main() -> list[float]:
        device = Refusing()
        device.stands_s = 0.06
        document = parse_binding(FLAPPING.replace("TIMEOUT", "0.05" if is_stable else "10")).document.devices["D"]
        wanted = Wanted(("discrete 0",), document.timeout_s)
        kept = Kept(document, device, TcpOptions(host="h"), wanted, Nobody())
        task = asyncio.create_task(kept.run())
        await until(lambda: len(device.connections_at) == 6, "six connections")
        kept.stop()
        await task
        at = device.connections_at
        return [later - before - device.stands_s for before, later in pairwise(at)]

    pauses = asyncio.run(main())
    grown = [0.02, 0.04, 0.08, 0.16, 0.32]
    if is_stable:
        assert sum(pauses) < sum(grown)
    else:
        assert all(pause > 0.9 * least for pause, least in zip(pauses, grown, strict=True))


class Owing(Refusing):
    """A device on a line, which may still answer what it was asked."""

    owed_seconds = 30.0


@pytest.mark.parametrize("safe", ["", "safe: {holding 1: 0}, "])
def test_a_line_is_not_used_again_while_it_may_still_bring_an_answer_but_for_the_safe_outputs_of_a_stop(
    safe: str,
) -> None:
    async def main() -> tuple[list[float], float, float]:
        device, loop = Owing(), asyncio.get_running_loop()
        text = FLAPPING.replace("TIMEOUT", "10").replace("heartbeat:", f"{safe}heartbeat:")
        document = parse_binding(text).document.devices["D"]
        kept = Kept(document, device, TcpOptions(host="h"), Wanted(("discrete 0",), 10.0), Nobody())
        task = asyncio.create_task(kept.run())
        await until(lambda: len(device.connections_at) == 2, "two connections")
        await asyncio.sleep(1)
        stopped_at = loop.time()
        kept.stop()
        await task
        return device.connections_at, stopped_at, loop.time()

    at, stopped_at, ended_at = run_in_virtual_time(main())
    assert at[1] - at[0] > 0.99 * Owing.owed_seconds
    assert [one - stopped_at < 1 for one in at[2:3]] == ([True] if safe else [])
    assert ended_at - at[-1] > 0.99 * Owing.owed_seconds, "who uses the line next would take it for an answer"


class Latched(Nobody):
    """Somebody who is served after an emergency stop."""

    is_latched = True


def test_after_an_emergency_stop_the_pause_does_not_grow_where_each_connection_brings_the_safe_outputs() -> None:
    async def main() -> list[float]:
        device = RefusingLater()
        document = parse_binding(
            FLAPPING.replace("TIMEOUT", "10").replace("heartbeat:", "safe: {holding 1: 0}, heartbeat:")
        ).document.devices["D"]
        kept = Kept(document, device, TcpOptions(host="h"), Wanted(("discrete 0",), 10.0), Latched())
        task = asyncio.create_task(kept.run())
        await until(lambda: len(device.connections_at) == 6, "six connections")
        at = list(device.connections_at)
        kept.stop()
        await task
        return at

    at = asyncio.run(main())
    assert at[-1] - at[0] < sum([0.02, 0.04, 0.08, 0.16, 0.32])


def test_a_signal_that_shows_one_thing_after_the_other_that_is_no_value_is_a_fault_once() -> None:
    image = Image({"s": SignalDocument(device="D", read="topic")})
    assert image.take([("topic", True)], 1.0)[1] == []
    assert [image.take([("topic", f"{at}.5")], 2.0)[1] for at in range(3)] == [["s"], [], []]
    assert image.take([("topic", True)], 3.0)[1] == []
    assert image.take([("topic", "3.5")], 4.0)[1] == ["s"]
    image.lost("no answer in time")
    assert image.take([("topic", "4.5")], 5.0)[1] == ["s"]


GARBAGE = """{firable_bind: 1, cell: conformance, devices: {D: {driver: mqtt, host: h,
channels: {M: {number: number, taken: taken, done: done}}}}, signals: {M.held: {device: D, read: held},
M.zero: {device: D, read: zero}, M.one: {device: D, read: one}, M.needed: {device: D, read: needed},
M.moved: acknowledged, M.closed: acknowledged}, commands: {M.move: {device: D, channel: M, write: {code: 1}},
M.grip: {device: D, channel: M, write: {code: 2}}, M.halt: {device: D, channel: M, write: {code: 3}}}}"""


def test_what_says_nothing_of_a_command_is_told_once_as_long_as_it_does_and_not_at_length(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    device = bound_driver(parse_binding(GARBAGE), bench_net()).devices["D"]
    notes: list[str] = []
    monkeypatch.setattr(device, "note", notes.append)
    for value in ("1.5", "2.5", "3.5", 7, "3.5", 7, "3.5", "4.5", 8, "x" * 1_000_000):
        device.read((("done", value),))
    shown = ["'1.5'", "'3.5'", f"'{'x' * 40}'... (1000000 characters)"]
    assert notes == [f"'done' shows {value}, which says nothing of a command" for value in shown]
    device.read((("needed", "y" * 1_000_000),))
    assert len(device.image.readings["M.needed"].why) < 200


GUARDED = """{firable_bind: 1, cell: c, devices: {D: {driver: opcua, url: 'opc.tcp://h:4840/',
heartbeat: {write: s=beat, every_s: 1, tripped: s=tripped}}}}"""


def test_a_watchdog_that_trips_while_nobody_can_read_it_is_a_fault_when_it_can_be_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver = BoundDriver(parse_binding(GUARDED), (), frozenset())
    device, faults = driver.devices["D"], list[str]()
    monkeypatch.setattr(device, "_fault", faults.append)
    for value in (NoValue("BadWaitingForInitialData"), False, NoValue("BadNoCommunication")):
        device.read((("s=tripped", value),))
    assert faults == []
    device.read((("s=tripped", True),))
    assert faults == ["its watchdog has stopped its machines: it has had no heartbeat"]


FORGETFUL = """{firable_bind: 1, cell: c, devices: {D: {driver: mqtt, host: h, grace_s: 3,
alive: {read: life, within_s: 1}}},
emergency_stop: {door: {device: D, read: door}}, signals: {held: {device: D, read: held, on_loss: hold},
zero: {device: D, read: zero, on_loss: 0}, needed: {device: D, read: needed}, shown: {device: D, read: shown}}}"""


def test_what_a_broker_has_forgotten_is_lost_after_the_grace_though_it_is_connected_again() -> None:
    async def main() -> tuple[BoundDevice, Heard]:
        driver, heard = BoundDriver(parse_binding(FORGETFUL), (), frozenset(), latched=True), Heard()
        driver.clock = driver.listener = heard
        device = driver.devices["D"]
        device.read([(name, "1") for name in ("held", "zero", "needed", "shown", "door")])
        device.ready()
        assert not tuple(driver.against())
        device.lost("cut")
        await asyncio.sleep(1)
        device.read([("shown", "1")])
        device.ready()
        assert tuple(driver.against()) == ("D: 'door' is not closed",)
        assert device.image.readings["held"].quality is Quality.GOOD
        driver.is_latched = False
        await asyncio.sleep(3)
        return device, heard

    device, heard = run_in_virtual_time(main())
    why = "not shown since it was connected again: cut"
    shown = {
        name: (one.value, one.quality, one.why) for name, one in device.image.readings.items() if name in device.told
    }
    assert shown == {
        "held": (True, Quality.UNCERTAIN, why),
        "zero": (False, Quality.BAD, why),
        "needed": (True, Quality.BAD, why),
        "shown": (True, Quality.GOOD, ""),
    }
    assert heard.faults == [f"D: 'needed' cannot be read: {why}"]
    assert heard.signals[4:] == [("zero", False, None)]


def test_the_grace_of_what_a_broker_has_forgotten_runs_on_over_further_losses() -> None:
    async def main() -> tuple[BoundDevice, list[str], Heard]:
        driver, heard = BoundDriver(parse_binding(FORGETFUL), (), frozenset()), Heard()
        driver.clock = driver.listener = heard
        device = driver.devices["D"]
        device.contacts.contacts = {}
        device.read([(name, "1") for name in ("held", "zero", "needed", "shown")])
        device.ready()
        told = []
        for _ in range(3):
            device.lost("cut")
            await asyncio.sleep(0.5)
            device.read([("shown", "1")])
            device.ready()
            await asyncio.sleep(0.9)
            told.append(device.image.readings["needed"].quality.name)
        return device, told, heard

    device, told, heard = run_in_virtual_time(main())
    assert told == ["GOOD", "GOOD", "BAD"]
    assert device.image.readings["shown"].quality is Quality.GOOD
    assert heard.faults == ["D: 'needed' cannot be read: cut"]


def test_what_this_connection_has_shown_is_good_though_the_grace_ends_before_it_is_ready() -> None:
    async def main() -> Quality:
        driver, heard = BoundDriver(parse_binding(FORGETFUL), (), frozenset(), latched=True), Heard()
        driver.clock = driver.listener = heard
        device = driver.devices["D"]
        device.read([("needed", "1")])
        device.ready()
        device.lost("cut")
        await asyncio.sleep(2.9)
        device.read([("needed", "1")])
        await asyncio.sleep(0.2)  # the safe outputs take their time
        device.ready()
        return device.image.readings["needed"].quality

    assert run_in_virtual_time(main()) is Quality.GOOD


@pytest.mark.parametrize("latched", [False, True])
def test_a_contact_is_closed_by_a_device_that_is_ready_and_not_by_a_connection_before(latched: bool) -> None:
    """Where its safe outputs were not confirmed its loss is no emergency: other devices must not move by it."""

    async def main() -> tuple[BoundDevice, Heard]:
        driver, heard = BoundDriver(parse_binding(FORGETFUL), (), frozenset(), latched=latched), Heard()
        driver.clock = driver.listener = heard
        device = driver.devices["D"]
        device.read([("door", "1"), ("needed", "1")])
        assert not driver.may_move
        device.lost("busy")
        device.lost("refused")
        assert heard.faults == [], "its start may take its time"
        device.read([("shown", "1")])
        device.ready()
        await asyncio.sleep(4)
        return device, heard

    device, heard = run_in_virtual_time(main())
    assert device.contacts.open_ones == {"door"}
    assert device.image.readings["needed"].quality is Quality.BAD
    assert heard.emergencies == []


def test_each_contact_that_opens_is_open_though_another_one_has_opened_with_it() -> None:
    text = FORGETFUL.replace("emergency_stop: {", "emergency_stop: {gate: {device: D, read: gate}, ")
    driver, heard = BoundDriver(parse_binding(text), (), frozenset(), latched=True), Heard()
    driver.clock = driver.listener = heard
    device = driver.devices["D"]

    async def main() -> tuple[str, ...]:
        device.read([("door", "1"), ("gate", "1"), ("needed", "1")])
        device.ready()
        assert not tuple(driver.against())
        device.read([("door", "0"), ("gate", "0")])
        device.read([("door", "1")])
        return tuple(driver.against())

    assert run_in_virtual_time(main()) == ("D: 'gate' is not closed",)


def test_what_a_device_shows_is_not_lost_when_the_time_of_its_start_is_over() -> None:
    async def main() -> BoundDevice:
        driver, heard = BoundDriver(parse_binding(FORGETFUL), (), frozenset(), latched=True), Heard()
        driver.clock = driver.listener = heard
        device = driver.devices["D"]
        device.read([("needed", "1")])  # its safe outputs take their time
        device._not_met("not reached since the start")
        device.ready()
        await asyncio.sleep(4)
        return device

    readings = run_in_virtual_time(main()).image.readings
    assert (readings["needed"].quality, readings["zero"].quality) == (Quality.GOOD, Quality.BAD)
