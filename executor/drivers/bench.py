"""The bench on which drivers are tested: a net, a binding, a machine at the far end, and someone who listens.

Used by `conformance.py`, and by whoever tests a driver of their own beyond that.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Final

from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.device import Point
from firable.executor.drivers.driver import Quality
from firable.executor.drivers.far_side.end import FarEnd
from firable.executor.drivers.far_side.machine import Machine
from firable.nets.net import Net, Place
from firable.nets.text import parse_net

PATIENCE_S: Final = 60.0
QUICK_S: Final = 0.5
"""How long an answer may take where one is about not to come; where all do, a busy machine is given longer."""

_NET: Final = """
firable: 1
cell: conformance
controllers:
  M:
    start: idle
    inputs: [held, zero, one, needed]
    places:
      idle:
      move: {send: {machine: M, command: MOVE, to: A}, until: moved}
      grip: {send: {machine: M, command: GRIP}, until: closed}
      halt: {send: {machine: M, command: HALT}}
transitions:
  t1: {from: M.idle, to: M.move, if: [M.held, M.zero, M.one, M.needed]}
  t2: {from: M.move, to: M.grip}
  t3: {from: M.grip, to: M.halt}
  t4: {from: M.halt, to: M.idle}
"""

_BINDING: Final = """
firable_bind: 1
cell: conformance
devices:
  D:
    {keys}
    timeout_s: {timeout_s}
    retry_s: 0.02
    retry_max_s: 0.1
    start_s: {start_s}
    heartbeat: {{write: {beat}, every_s: 0.05, tripped: {tripped}}}
    safe: {{{output}: false}}
    {life}
    channels:
      M: {{{out}, {shown}done: {done}, failed: {failed}}}
{emergency}
signals:
  M.held: {{device: D, read: {sensor}, on_loss: hold}}
  M.zero: {{device: D, read: {sensor}, on_loss: 0}}
  M.one: {{device: D, read: {sensor}, on_loss: 1}}
  M.needed: {{device: D, read: {sensor}, on_loss: {needed}}}
  M.moved: acknowledged
  M.closed: {{device: D, read: {closed}, on_loss: hold}}
commands:
  M.move: {{device: D, channel: M, write: {{{move}}}}}
  M.grip: {{device: D, channel: M, write: {{{grip}}}}}
  M.halt: {{device: D, channel: M, write: {{{halt}}}}}
"""


def bench_net() -> Net:
    """The net of one machine with a completion by acknowledgement, one with a sensor besides, and one without."""
    return parse_net(_NET)


@dataclass(frozen=True)
class Far:
    """A far end, the keys of a device that reach it (lines of YAML in one flow), and its points by their roles."""

    end: FarEnd
    keys: str
    points: Mapping[str, Point]
    through_broker: bool = False
    """Whether they lead to a broker: an emergency stop needs a sign of life there."""


@dataclass
class Heard:
    """A listener that remembers, and a clock beside it."""

    signals: list[tuple[str, bool, int | None]] = field(default_factory=list)
    takings: list[tuple[str, int]] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    emergencies: list[str] = field(default_factory=list)

    def signal(self, name: str, value: bool, entry: int | None) -> None:
        """Remember a value."""
        self.signals.append((name, value, entry))

    def taken(self, place: str, entry: int) -> None:
        """Remember that a machine has a command."""
        self.takings.append((place, entry))

    def driver_fault(self, machine: str, message: str) -> None:
        """Remember a fault."""
        self.faults.append(f"{machine}: {message}")

    def driver_note(self, machine: str, message: str) -> None:
        """Remember a note."""
        self.notes.append(f"{machine}: {message}")

    def emergency_stop(self, reason: str) -> None:
        """Remember an emergency stop."""
        self.emergencies.append(reason)

    def all_told(self) -> None:
        """Nothing to remember."""

    def moved(self) -> None:
        """Nothing to remember."""

    def now_seconds(self) -> float:
        """The time of the loop."""
        return asyncio.get_running_loop().time()

    def loop_delay_seconds(self, until_seconds: float) -> float:
        """The time until then."""
        return max(0.0, until_seconds - self.now_seconds())


async def until(condition: Callable[[], object], what: str) -> None:
    """Wait until something is so."""
    deadline = asyncio.get_running_loop().time() + PATIENCE_S
    while not condition():
        assert asyncio.get_running_loop().time() < deadline, f"not within {PATIENCE_S:g} s: {what}"
        await asyncio.sleep(0.002)


@dataclass
class Bench:
    """A driver and the machine that it is connected to."""

    machine: Machine
    far: Far
    net: Net
    needed: str = "0"
    start_s: float = PATIENCE_S
    timeout_s: float = 10.0
    button: bool = False
    """Whether the binding has the button of the machine as its emergency stop."""
    latched: bool = False
    """Whether the driver follows an emergency stop."""
    shows_taken: bool = True
    """Whether the channel of the machine shows what it has taken."""
    within_s: float = 0.0
    """Within what time the sign of life of the machine must change; where 0 it has none, unless it must have one."""
    driver: BoundDriver = field(init=False)
    heard: Heard = field(init=False)

    def __post_init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Make a new driver, as after a restart."""
        self.heard = Heard()
        within_s = self.within_s or (PATIENCE_S if self.button and self.far.through_broker else 0.0)
        if within_s and not self.machine.signs:
            self.machine.lives = True
        points = dict(self.far.points)
        codes = {name: f"{points['code']}: {i}" for i, name in enumerate(("move", "grip", "halt"), 1)}
        out = f"number: {points['number']}" if "number" in points else f"command: {points['command']}"
        text = _BINDING.format(
            keys="\n    ".join(self.far.keys.split(", ")),
            out=out,
            life=f"alive: {{read: {points['alive']}, within_s: {within_s}}}" if within_s else "",
            shown=f"taken: {points['taken']}, " if self.shows_taken else "",
            needed=self.needed,
            start_s=self.start_s,
            timeout_s=self.timeout_s,
            emergency=f"emergency_stop: {{button: {{device: D, read: {points['button']}}}}}" if self.button else "",
            **(points | codes),
        )
        self.driver = bound_driver(parse_binding(text), self.net, latched=self.latched)

    async def ordered(self, count: int) -> None:
        """Wait until so many commands have arrived."""
        await until(lambda: len(self.machine.orders) == count, f"{count} commands arrive")

    def place(self, name: str) -> Place:
        """A place of the machine."""
        return self.net.place(f"M.{name}")

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """The driver runs; at the end it is cancelled, as the host does it."""
        task = asyncio.create_task(self.driver.run(self.heard, self.heard))
        try:
            yield
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """The driver runs, and is connected."""
        async with self.running():
            await until(lambda: self.driver.devices["D"].is_ready.is_set(), "the driver connects")
            yield

    def quality(self, signal: str) -> tuple[bool | None, Quality]:
        """What the image holds of a signal."""
        reading = self.driver.readings()[f"M.{signal}"]
        return reading.value, reading.quality

    def heard_of(self, signal: str) -> list[tuple[bool, int | None]]:
        """All that was told of a signal."""
        return [(value, entry) for name, value, entry in self.heard.signals if name == f"M.{signal}"]
