"""What a device shows, in drawn courses of values, losses and connections, against what a reader of them may believe.

The connection is played: values come, it is ready, it is lost, time passes. Three sentences are checked after each:
what this connection has shown is good; what it has not, and was lost for longer than the grace, is not; and a contact
of the emergency stop is closed only if the device is ready and this connection has shown it so, and not open since.
"""

import asyncio
import random
from dataclasses import dataclass, field

import pytest
from support.examples import seeds

from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import Heard
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver
from firable.executor.drivers.driver import Quality

BINDING = """{firable_bind: 1, cell: c, devices: {D: {driver: serial, port: /dev/x, grace_s: GRACE}},
emergency_stop: {door: {device: D, read: door}, gate: {device: D, read: gate}},
signals: {a: {device: D, read: a}, b: {device: D, read: b, on_loss: hold}, c: {device: D, read: c, on_loss: 1},
e: {device: D, read: c, invert: true}}}"""
POINTS = {"a": "a", "b": "b", "c": "c", "e": "c"}
CONTACTS = ("door", "gate")
GRACES = (0, 0.1, 0.3, 1.7, 3)


@dataclass
class Believed:
    """What a reader believes, who sees all that comes."""

    grace_s: float
    is_ready: bool = False
    has_begun: bool = False
    """Whether it was ready once, or the time of its start is over."""
    shown: set[str] = field(default_factory=set)
    missed_since: dict[str, float] = field(default_factory=dict)
    closed: dict[str, bool] = field(default_factory=dict)

    def read(self, batch: list[tuple[str, str]]) -> None:
        for point, value in batch:
            if point in CONTACTS:
                self.closed[point] = value == "1"
            for signal in (name for name, at in POINTS.items() if at == point):
                self.shown.add(signal)
                self.missed_since.pop(signal, None)

    def ready(self, now: float) -> None:
        if not self.has_begun:  # until then the start has its own time
            self.missed_since = dict.fromkeys(self.missed_since, now)
        self.is_ready = self.has_begun = True

    def lost(self, now: float) -> None:
        for signal in POINTS if self.is_ready else set(self.shown):
            self.missed_since.setdefault(signal, now)
        self.is_ready = False
        self.shown.clear()
        self.closed.clear()

    def is_over(self, signal: str, now: float) -> bool:
        since = self.missed_since.get(signal)
        return self.has_begun and since is not None and now > since + self.grace_s + 1e-3


@pytest.mark.seeds
def test_what_a_device_has_shown_is_good_and_what_is_lost_for_long_is_not() -> None:
    async def course(drawn: random.Random) -> None:
        believed = Believed(drawn.choice(GRACES))
        binding = parse_binding(BINDING.replace("GRACE", str(believed.grace_s)))
        driver, heard = BoundDriver(binding, (), frozenset(), latched=True), Heard()
        driver.clock = driver.listener = heard
        device, loop = driver.devices["D"], asyncio.get_running_loop()
        for _ in range(120):
            match drawn.choice(("read", "read", "ready", "lost", "lost", "late", "pass", "pass", "pass")):
                case "read":
                    points = drawn.sample([*dict.fromkeys(POINTS.values()), *CONTACTS], drawn.randint(1, 4))
                    batch = [(point, drawn.choice("1110") if point in CONTACTS else "1") for point in points]
                    believed.read(batch)
                    device.read(batch)
                case "ready" if not believed.is_ready:
                    believed.ready(loop.time())
                    device.ready()
                case "late" if not believed.has_begun:
                    believed.has_begun = True
                    device._not_met("not reached since the start")
                case "lost":
                    believed.lost(loop.time())
                    for _ in range(drawn.randint(1, 2)):  # it may be told twice
                        device.lost("cut")
                case "pass":
                    await asyncio.sleep(drawn.choice((0.1, 1 / 3, believed.grace_s, drawn.random())))
            await asyncio.sleep(0)
            for signal in POINTS:
                is_good = device.image.readings[signal].quality is Quality.GOOD
                assert is_good or signal not in believed.shown
                assert not (is_good and believed.is_over(signal, loop.time()))
            for contact in CONTACTS:
                is_closed = contact not in device.contacts.open_ones
                assert not is_closed or (believed.is_ready and believed.closed.get(contact, False))
                if believed.is_ready and believed.closed.get(contact, False):
                    assert is_closed or not all(believed.closed.get(one, False) for one in CONTACTS)

    for seed in seeds(60):
        run_in_virtual_time(course(random.Random(seed)))
