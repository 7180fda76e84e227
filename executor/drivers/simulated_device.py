"""A device that is simulated within the process, for cells of which some machines are real and some are not there yet.

Its points live in memory. A channel of it takes commands as texts (`command: NAME`); the device shows their numbers at
`NAME.taken` and `NAME.done`, as `NAME.failed` what a stop has broken off. Each command takes its time, with jitter, and
may change what sensors show when it is done. `stop`, written as one of the safe outputs, stops everything.

There are no workpieces here: a real machine that puts one down tells nobody, and where one is gone is for `effects` to
say. A whole simulated cell, with workpieces that can be lost, is `firable run --plant`, or `firable sim` behind
sockets. Rejected: to let that plant run some of its machines only; it would miss what the real ones carry away.

After a restart of the process the device shows no numbers: what became of a command is for a person to say, as of any
device that forgets.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Mapping, Sequence
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from firable.executor.drivers.device import Connection, Options, Point, Use, Value, Wanted, Writes

STOP: Final = "stop"
"""The point that stops all machines of the device when 1 is written to it."""

Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]
Bit = Annotated[int, Field(ge=0, le=1)]


class Effect(BaseModel):
    """How long a command takes, and what sensors show when it is done."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)
    seconds: Seconds | None = None
    then: dict[str, Bit] = {}


class SimulatedOptions(Options):
    """What sensors show at first, how long commands take, and what they do besides.

    A command is named as the net has it, with its machine and its parameters, such as `R MOVE to=CV1`.
    """

    seconds: Seconds = 1.0
    jitter: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """By so much of itself a time may be longer or shorter."""
    seed: int = 0
    shows: Mapping[str, Bit] = Field(default_factory=dict)
    effects: Mapping[str, Effect] = Field(default_factory=dict)

    def far_end(self) -> object:
        """Each simulated device is one of its own."""
        return object()


class SimulatedConnection:
    """The machines of a device, and the one connection that there is to them."""

    def __init__(self, options: SimulatedOptions, wanted: Wanted) -> None:
        self.options = options
        self.wanted = frozenset(wanted.read)
        self.channels = frozenset(wanted.asks)
        self.draw = random.Random(options.seed)
        self.told: asyncio.Queue[tuple[Point, Value]] = asyncio.Queue()
        self.is_first = True
        self.numbers: dict[str, str] = {}
        """Of each channel, the number that it has."""
        self.at_work: dict[str, asyncio.TimerHandle] = {}

    async def read(self) -> Sequence[tuple[Point, Value]]:
        """What the sensors show at first, then all that has changed."""
        if self.is_first:
            self.is_first = False
            return self._at_first()
        batch = [await self.told.get()]
        while not self.told.empty():
            batch.append(self.told.get_nowait())
        return batch

    def _at_first(self) -> list[tuple[Point, Value]]:
        """What is shown before any command: no point that it has may look like one that is written wrong.

        What was taken before a restart it does not know, so an empty text stands there: 0 would mean "not received".
        """
        changed = {sensor: 0 for effect in self.options.effects.values() for sensor in effect.then}
        sensors = {**changed, **self.options.shows}
        nothing: dict[str, Value] = {"taken": "", "done": 0, "failed": 0}
        answers = {f"{channel}.{what}": value for channel in self.channels for what, value in nothing.items()}
        return [(point, value) for point, value in (answers | sensors).items() if point in self.wanted]

    async def write(self, writes: Writes) -> None:
        """Take commands, or stop."""
        for point, value in writes:
            if point != STOP:
                number, _, command = str(value).partition(" ")
                self._ordered(point, number, command)
            elif value:
                self._stop()

    async def close(self) -> None:
        """Nothing moves any more."""
        for timer in self.at_work.values():
            timer.cancel()
        self.at_work.clear()

    def _ordered(self, channel: str, number: str, command: str) -> None:
        if number == self.numbers.get(channel):
            return
        self.numbers[channel] = number
        if (earlier := self.at_work.pop(channel, None)) is not None:
            earlier.cancel()
        if number == "0":
            for what in ("taken", "done", "failed"):
                self._show(f"{channel}.{what}", 0)
            return
        self._show(f"{channel}.taken", number)
        effect = self.options.effects.get(command, Effect())
        seconds = self.options.seconds if effect.seconds is None else effect.seconds
        seconds *= 1 + self.options.jitter * self.draw.uniform(-1, 1)
        loop = asyncio.get_running_loop()
        self.at_work[channel] = loop.call_later(seconds, self._done, channel, number, effect.then)

    def _done(self, channel: str, number: str, then: Mapping[str, int]) -> None:
        del self.at_work[channel]
        for sensor, value in then.items():
            self._show(sensor, value)
        self._show(f"{channel}.done", number)

    def _stop(self) -> None:
        for channel, timer in self.at_work.items():
            timer.cancel()
            self._show(f"{channel}.failed", self.numbers[channel])
        self.at_work.clear()

    def _show(self, point: Point, value: Value) -> None:
        if point in self.wanted:
            self.told.put_nowait((point, value))


class Simulated:
    """Devices in the memory of this process."""

    options: type[Options] = SimulatedOptions
    through_broker = False

    def point_problem(self, point: Point, use: Use) -> str:
        """What is wrong with a name."""
        return f"what there is to {use} has a name" if not point.strip() else ""

    def load(self) -> None:
        """Nothing: there is no library."""

    async def connect(self, options: SimulatedOptions, wanted: Wanted) -> Connection:
        """Make the machines; they are at rest."""
        return SimulatedConnection(options, wanted)


KIND: Final = Simulated()
