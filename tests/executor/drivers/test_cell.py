"""The simulated cell behind real servers, and the executor on the other side of the sockets."""

import asyncio
import io
from collections.abc import Callable
from functools import partial

import pytest
from support.cells import plant_of
from support.served_cells import DECOMPOSITION, NET, Served, halved, served, unhurried

from firable.executor.cell.disturbances import Drops, NeverCompletes
from firable.executor.cell.plant import Plant
from firable.executor.drivers.bench import until
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.executor.drivers.device import Point, Value
from firable.executor.drivers.far_side.cell import CellServer
from firable.executor.drivers.far_side.ends import binding_text
from firable.executor.drivers.far_side.modbus_server import ModbusTcpEnd
from firable.executor.drivers.far_side.mqtt_device import mosquitto
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.modbus_points import address
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.service import patience_with
from firable.executor.operating.situation import Situation, State
from firable.nets.interchange import net_digest
from firable.semantics.replaying import replay
from firable.semantics.trace import parse_trace


async def executed(one: Served, done: Callable[[], object], *, overdue_seconds: float = 60.0) -> Situation:
    """Run the net on a served cell until something is so; the trace must be one of the net."""

    async def operator(host: Host) -> None:
        await until(done, "the work in the cell")
        host.stop()

    stream = io.StringIO()
    recorder = Recorder(NET, net_digest(NET), stream)
    driver = bound_driver(one.binding, NET)
    patience = patience_with(driver)
    host = Host(
        DECOMPOSITION, driver, recorder, Conduct(operator=operator, overdue_seconds=overdue_seconds), patience=patience
    )
    situation = await host.main()
    assert replay(NET, parse_trace(stream.getvalue())).complete
    return situation


def test_workpieces_go_through_a_cell_behind_sockets_none_lost_and_none_doubled() -> None:
    async def main() -> None:
        async with served(3) as one:
            situation = await executed(one, lambda: len(one.plant.delivered) == 3)
            assert situation.state is State.STOPPED
            assert [workpiece.processed for workpiece in one.plant.delivered] == [1, 1, 1]
            assert not one.cell.fault

    asyncio.run(main())


def test_contact_of_the_emergency_stop_is_closed_from_the_moment_at_which_its_device_listens() -> None:
    class Watched(ModbusTcpEnd):
        async def start(self, written: Callable[[Point, Value], None]) -> None:
            await super().start(written)
            shown.append(dict(self.shown))

    shown: list[dict[tuple[str, int], int]] = []

    async def main() -> None:
        port = free_port()
        binding = parse_binding(binding_text(NET, {"modbus": str(port)}, plant_of("one_robot").sensors))
        cell = CellServer(binding, NET, Plant(plant_of("one_robot"), workpieces=1), {"modbus": Watched(port)})
        await cell.start()
        await cell.stop()
        contact = address(binding.document.emergency_stop["button"].read)
        assert shown[0].get((contact.table, contact.number)) == 1

    asyncio.run(main())


def test_machines_that_know_no_numbers_lose_and_double_no_workpiece_either() -> None:
    async def main() -> None:
        async with served(2, knows_numbers=False) as one:
            situation = await executed(one, lambda: len(one.plant.delivered) == 2)
            assert situation.state is State.STOPPED
            assert [workpiece.processed for workpiece in one.plant.delivered] == [1, 1]
            assert not one.cell.fault

    asyncio.run(main())


def at_one_address(protocol: str, port: int, **keys: int) -> str:
    """A binding of the cell to two devices of a protocol at a port."""
    return halved(unhurried(binding_text(NET, {protocol: str(port)}, plant_of("one_robot").sensors)), **keys)


@pytest.mark.parametrize(
    ("binding", "servers"),
    [
        (partial(at_one_address, "modbus", unit=2), 2),
        (partial(at_one_address, "modbus"), 1),
        (partial(at_one_address, "opcua"), 1),
        pytest.param(
            partial(at_one_address, "mqtt"), 1, marks=pytest.mark.skipif(not mosquitto(), reason="mosquitto is missing")
        ),
    ],
    ids=["two units", "one unit", "OPC UA", "MQTT"],
)
def test_two_devices_at_one_address_are_served(binding: Callable[[int], str], servers: int) -> None:
    async def main() -> None:
        async with served(2, at_one_address=binding) as one:
            situation = await executed(one, lambda: len(one.plant.delivered) == 2)
            assert situation.state is State.STOPPED
            assert [workpiece.processed for workpiece in one.plant.delivered] == [1, 1]
            assert not one.cell.fault
            assert len({device.end for device in one.cell.devices.values()}) == servers

    asyncio.run(main())


def test_button_of_the_cell_ends_the_run_with_every_machine_stopped() -> None:
    async def main() -> None:
        async with served(1) as one:
            asyncio.get_running_loop().call_later(1.5, lambda: one.cell.press(pressed=True))
            situation = await executed(one, lambda: False)
            assert (situation.state, situation.message) == (State.STOPPED, "emergency stop: modbus: 'button' is open")
            await until(lambda: not one.cell.at, "all machines stand")

    asyncio.run(main())


def test_a_situation_names_the_devices_that_cannot_be_reached_and_says_why() -> None:
    ports = {"modbus": str(free_port()), "serial": "/dev/nobody-is-here"}
    driver = bound_driver(parse_binding(binding_text(NET, ports, plant_of("one_robot").sensors), "cell"), NET)
    seen: list[Situation] = []

    async def operator(host: Host) -> None:
        def is_told(now: Situation) -> bool:
            return now.message.count("not connected: ") == 2 and now.state is State.WAITING

        await until(lambda: is_told(host.situation()), "both refusals")
        seen.append(host.situation())
        host.stop()

    recorder = Recorder(NET, net_digest(NET), io.StringIO())
    asyncio.run(
        Host(DECOMPOSITION, driver, recorder, Conduct(operator=operator), patience=patience_with(driver)).main()
    )
    assert "modbus is not connected: 127.0.0.1" in seen[0].message
    assert "serial is not connected: " in seen[0].message


def test_machine_that_hangs_is_a_fault_and_the_others_are_stopped() -> None:
    async def main() -> None:
        async with served(2, NeverCompletes("R", "GRASP")) as one:
            situation = await executed(one, lambda: False, overdue_seconds=1.5)
            assert situation.state is State.FAULT
            assert "'R GRASP at=CV1' of 'robot.grasp_cv1'" in situation.message
            await until(lambda: "R is stopped by a safe output" in one.said, "the safe output")

    asyncio.run(main())


def test_workpiece_that_is_dropped_is_missed_where_it_should_be() -> None:
    async def main() -> None:
        async with served(1, Drops("R", "MOVE", 2)) as one:
            situation = await executed(one, lambda: one.cell.fault)
            assert "has lost the workpiece" in one.cell.fault or "holds nothing" in one.cell.fault
            assert situation.state in {State.STOPPED, State.FAULT}
            assert one.plant.inside == ()

    asyncio.run(main())
