"""The simulated cell of one robot behind real servers, as a test needs it."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from copy import deepcopy
from dataclasses import dataclass, field

import yaml
from support.cells import decomposition_of, plant_of

from firable.executor.cell.disturbances import Disturbance
from firable.executor.cell.plant import Plant
from firable.executor.drivers.binding import Binding, parse_binding
from firable.executor.drivers.far_side.cell import CellServer
from firable.executor.drivers.far_side.end import FarEnd
from firable.executor.drivers.far_side.ends import binding_text, ends_of
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.far_side.serial_device import SerialEnd

DECOMPOSITION = decomposition_of("one_robot")
NET = DECOMPOSITION.net


def unhurried(text: str) -> str:
    """A binding of `binding_text` whose devices no busy machine takes for lost, nor their watchdogs this process."""
    return re.sub(r"( *)(heartbeat: .*every_s: )[\d.]+", r"\1timeout_s: 2\n\1\g<2>4", text)


def halved(text: str, **keys: int) -> str:
    """A binding with two devices at the address of its one, which have the machines in turn; `keys` of the second."""
    document = yaml.safe_load(text)
    ((_, device),) = document["devices"].items()
    channels = device["channels"]
    second = {m: channels.pop(m) for m in list(channels)[1::2]}
    document["devices"]["second"] = deepcopy(device) | keys | {"channels": second}
    for command in document["commands"].values():
        if command["channel"] not in channels:
            command["device"] = "second"
    return yaml.safe_dump(document, sort_keys=False)


@dataclass
class Served:
    """A cell that is served, and what it said."""

    binding: Binding
    plant: Plant
    cell: CellServer
    said: list[str] = field(default_factory=list)


@asynccontextmanager
async def served(
    workpieces: int,
    *disturbances: Disturbance,
    speed: float = 50.0,
    knows_numbers: bool = True,
    at_one_address: Callable[[int], str] | None = None,
) -> AsyncIterator[Served]:
    """The one-robot cell over Modbus and a serial line, fifty times as fast as it would be, or by another binding."""
    line = SerialEnd()
    if at_one_address is not None:
        text = at_one_address(free_port())
    else:
        line.line.open()
        ports = {"modbus": str(free_port()), "serial": line.line.near}
        text = unhurried(binding_text(NET, ports, plant_of("one_robot").sensors))
    if not knows_numbers:
        numbers = r"number: holding (\d+), taken: input (\d+), done: input (\d+), failed: input (\d+)"
        bits = r"request: coil \1, taken: discrete 1\2, done: discrete 1\3, failed: discrete 1\4"
        text, count = re.subn(numbers, bits, text)
        assert count
    binding = parse_binding(text)
    ends: dict[str, FarEnd] = {"serial": line, **ends_of(binding.without({"serial"}))}
    model = plant_of("one_robot")
    # Its last sensor would show a workpiece for 20 ms, which no busy machine sees.
    departures = [departure.model_copy(update={"after_s": 25.0}) for departure in model.departures]
    model = model.model_copy(update={"departures": departures})
    plant = Plant(model, workpieces=workpieces, disturbances=disturbances)
    said: list[str] = []
    cell = CellServer(binding, NET, plant, ends, speed=speed, tell=lambda _, what: said.append(what))
    await cell.start()
    running = asyncio.create_task(cell.run())
    try:
        yield Served(binding, plant, cell, said)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await cell.stop()
