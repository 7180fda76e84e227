"""What a connection that is gone still brings: nothing more leaves this host, and safe outputs come behind the rest."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import pytest

from firable.executor.drivers.bench import QUICK_S, Bench, Far, bench_net, until
from firable.executor.drivers.device import DROPPING, Point, Value
from firable.executor.drivers.far_side.end import Faults
from firable.executor.drivers.far_side.machine import ROLES, Machine
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.far_side.mqtt_device import MqttEnd, mosquitto
from firable.executor.drivers.far_side.opcua_server import OpcUaEnd
from firable.executor.drivers.far_side.relay import Relay

MODBUS = {
    "sensor": "discrete 0",
    "closed": "discrete 1",
    "button": "discrete 2",
    "tripped": "discrete 5",
    "output": "coil 3",
    "beat": "holding 0",
    "code": "holding 10",
    "number": "holding 12",
    "taken": "input 10",
    "done": "input 11",
    "failed": "input 12",
    "alive": "input 13",
}
NO_BROKER = pytest.mark.skipif(mosquitto() is None, reason="needs the broker mosquitto, which is not installed")


class ModbusBehind(ModbusTcpEnd):
    """A Modbus server behind a relay."""

    def __init__(self) -> None:
        super().__init__()
        self.relay = Relay(Faults())
        self.relay.target = self.port

    async def start(self, written: Callable[[Point, Value], None]) -> None:
        await super().start(written)
        await self.relay.open()

    async def stop(self) -> None:
        await self.relay.close()
        await super().stop()


@dataclass
class Way:
    """A relay, and a bench of which the driver goes through it."""

    relay: Relay
    bench: Bench


@asynccontextmanager
async def way(kind: str) -> AsyncIterator[Way]:
    end: Any
    match kind:
        case "modbus":
            end, points, keys = ModbusBehind(), MODBUS, "driver: modbus-tcp, host: 127.0.0.1, every_s: 0.002"
        case "opcua":
            points = {role: f"ns=2;s=M.{role}" for role in (*ROLES, "number")}
            bits = {"sensor", "closed", "button", "tripped", "output"}
            end = OpcUaEnd({point: False if role in bits else 0 for role, point in points.items()})
            keys = "driver: opcua, every_s: 0.005"
        case _:
            points = {role: f"cell/M/{role}" for role in (*ROLES, "command")}
            end = MqttEnd({points[role] for role in ("output", "beat", "code", "command")})
            keys = "driver: mqtt, host: 127.0.0.1"
    machine = Machine(end, points)
    await machine.start()
    try:
        port = end.relay.port
        keys += f", url: 'opc.tcp://127.0.0.1:{port}/'" if kind == "opcua" else f", port: {port}"
        yield Way(end.relay, Bench(machine, Far(end, keys, points), bench_net(), timeout_s=2 * QUICK_S))
    finally:
        await machine.stop()
        if kind == "opcua":
            await end.end()


NUMBERED = {"modbus": b"\x10\x00\x0c", "opcua": b"M.number", "mqtt": b"cell/M/command"}
"""What is in a message with the number of a command, and in no other that the tests let pass."""

KINDS = ["modbus", "opcua", pytest.param("mqtt", marks=NO_BROKER)]


@pytest.mark.parametrize("kind", KINDS)
def test_command_that_an_old_connection_brings_after_the_stop_is_followed_by_the_safe_outputs(kind: str) -> None:
    async def main() -> None:
        async with way(kind) as w:
            b = w.bench
            async with b.connected():
                b.driver.send(b.place("halt"), 1)
                await until(lambda: b.heard.takings, "one that is not held")
                w.relay.hold(NUMBERED[kind])
                b.driver.send(b.place("halt"), 2)
                await until(lambda: w.relay.held, "its number is on its way")
                b.driver.stop()
                await until(lambda: b.machine.outputs == [False, False], "the safe outputs over a new connection")
                assert len(b.machine.orders) == 1
                w.relay.release()
                await until(lambda: len(b.machine.orders) == 2, "the command comes late")
                await until(b.driver.devices["D"].kept.stopped.is_set, "the stop is over")
            assert b.machine.events[-1] == "output"
            assert b.driver.unconfirmed == ()

    asyncio.run(main())


@pytest.mark.parametrize("kind", KINDS)
def test_connection_with_a_write_that_is_not_confirmed_is_dropped_at_once(kind: str) -> None:
    async def main() -> None:
        async with way(kind) as w:
            b = w.bench
            b.timeout_s = 30.0  # nobody waits for so long with a goodbye
            b.begin()
            b.driver.devices["D"].kept._doubt = lambda: None  # type: ignore[method-assign]  # nor for what comes late
            async with b.connected():
                w.relay.hold(NUMBERED[kind])
                b.driver.send(b.place("halt"), 1)
                await until(lambda: w.relay.held, "its number is on its way")
                before = asyncio.get_running_loop().time()
                b.driver.stop()
                await until(lambda: b.machine.outputs == [False, False], "the safe outputs over a new connection")
                assert asyncio.get_running_loop().time() - before < 10
                w.relay.release()

    asyncio.run(main())


@pytest.mark.parametrize("kind", KINDS)
def test_kernel_drops_what_is_not_delivered_when_a_connection_or_its_process_ends(kind: str) -> None:
    async def main() -> None:
        async with way(kind) as w, w.bench.connected():
            connection: Any = w.bench.driver.devices["D"].kept.withholding
            match kind:
                case "modbus":
                    found = connection.client.ctx.transport.get_extra_info("socket")
                case "opcua":
                    found = connection.client.uaclient.protocol.transport.get_extra_info("socket")
                case _:
                    found = connection.client._client.socket()
            level, option, value = DROPPING
            assert found.getsockopt(level, option, len(value)) == value

    asyncio.run(main())
