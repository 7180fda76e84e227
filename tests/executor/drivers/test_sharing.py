"""Devices between hosts: one writes what stops the machines of a device, others look at it, and no two share one."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.cells import decomposition_of, plant_of

from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.executor.drivers.binding import Binding, parse_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.device import Options
from firable.executor.drivers.far_side.ends import binding_text
from firable.executor.operating.hosting import own_net
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.net import Net
from firable.nets.text import parse_net

CELL = decomposition_of("one_robot")
PORTS = {"modbus": "1502", "opcua": "1484", "mqtt": "1188", "serial": "/dev/ttyS9"}
APART = binding_text(CELL.net, PORTS, plant_of("one_robot").sensors)
"""R at modbus, MC at opcua, CV1 at mqtt and CV2 at the serial line; the contact at modbus."""
TOGETHER = binding_text(CELL.net, {"modbus": "1502", "opcua": "1484"}, plant_of("one_robot").sensors)
"""R and CV1 at modbus, MC and CV2 at opcua."""

TWO_TEXT = """
firable: 1
cell: two
controllers:
  a: {start: free, inputs: key, places: {free: , lit: {send: {machine: L, command: LIGHT}}}}
  b: {start: free, inputs: key, places: {free: , lit: {send: {machine: M, command: LIGHT}}}}
transitions:
  on-a: {from: a.free, to: a.lit, if: a.key}
  on-b: {from: b.free, to: b.lit, if: b.key}
"""
TWO = parse_net(TWO_TEXT)
BINDING = """
firable_bind: 1
cell: two
devices:
  plc: {driver: modbus-tcp, host: 10.0.0.1, channels: {L: {number: holding 1}, M: {number: holding 2}}}
  door: {driver: modbus-tcp, host: 10.0.0.2}
signals:
  a.key: {device: door, read: discrete 1}
  b.key: {device: door, read: discrete 2}
commands:
  a.lit: {device: plc, channel: L}
  b.lit: {device: plc, channel: M}
"""


def driver_of(text: str, *controllers: str) -> BoundDriver:
    """The driver of a host of the cell with these controllers."""
    return bound_driver(parse_binding(text), CELL.net, own_net(CELL, controllers))


def driven(driver: BoundDriver) -> dict[str, bool]:
    """Each device of a driver, and whether it writes safe outputs and heartbeats there, which go together here."""
    documents = {name: device.document for name, device in driver.devices.items()}
    assert all(bool(one.safe) is (one.heartbeat is not None) for one in documents.values())
    return {name: bool(one.safe) for name, one in documents.items()}


def refused(binding: Binding, net: Net, part: Net) -> list[tuple[str, tuple[str, ...], str]]:
    with pytest.raises(InputError) as caught:
        bound_driver(binding, net, part)
    assert all(one.span is not None for one in caught.value.diagnostics)
    return [(one.code, one.subject, one.message) for one in caught.value.diagnostics]


def test_each_host_drives_the_devices_of_its_machines_and_looks_at_the_contact() -> None:
    assert driven(driver_of(APART, "robot")) == {"modbus": True}
    assert driven(driver_of(APART, "mc")) == {"modbus": False, "opcua": True}
    assert driven(driver_of(APART, "conveyor")) == {"modbus": False, "mqtt": True, "serial": True}
    assert driven(driver_of(APART, "system", "robot", "conveyor")) == {"modbus": True, "mqtt": True, "serial": True}
    assert set(driver_of(APART, "mc").readings()) == {"mc.part_present", "emergency stop button"}


def test_a_device_with_machines_of_two_hosts_is_refused_and_one_whose_controllers_are_all_here_is_not() -> None:
    binding = parse_binding(TOGETHER)
    message = "'modbus' has machines of 'robot', which runs here, and of 'conveyor', which runs elsewhere"
    assert refused(binding, CELL.net, own_net(CELL, ["robot"])) == [("F5105", ("devices", "modbus"), message)]
    assert len(refused(binding, CELL.net, own_net(CELL, ["conveyor", "system"]))) == 2
    assert driven(driver_of(TOGETHER, "robot", "conveyor", "mc")) == {"modbus": True, "opcua": True}
    assert driven(bound_driver(binding, CELL.net)) == {"modbus": True, "opcua": True}, "a whole run has them all"


def test_a_sensor_at_the_device_of_another_host_is_read_there_and_nothing_is_written() -> None:
    wired = APART.replace(
        "mc.part_present: {device: opcua, read: ns=2;s=sensors/mc.part_present, force: true}",
        "mc.part_present: {device: modbus, read: discrete 99}",
    )
    assert wired != APART
    assert driven(driver_of(wired, "mc")) == {"modbus": False, "opcua": True}
    assert "mc.part_present" in driver_of(wired, "mc").readings()
    assert driven(driver_of(wired, "robot")) == {"modbus": True}


def test_a_device_without_anything_that_stops_it_is_shared_by_channels_of_their_own_and_a_channel_by_nobody() -> None:
    decomposition = split(TWO)
    part = own_net(decomposition, ["a"])
    driver = bound_driver(parse_binding(BINDING), TWO, part)
    assert set(driver.devices) == {"plc", "door"}
    one_channel = BINDING.replace(
        "b.lit: {device: plc, channel: M}", "b.lit: {device: plc, channel: L, write: {coil 7: 1}}"
    )
    one_lamp = parse_net(TWO_TEXT.replace("machine: M", "machine: L"))
    assert refused(parse_binding(one_channel), one_lamp, own_net(split(one_lamp), ["a"])) == [
        (
            "F5105",
            ("devices", "plc", "channels", "L"),
            "'L' takes commands of 'a', which runs here, and of 'b', which runs elsewhere",
        )
    ]


def test_the_safe_outputs_of_a_device_with_sensors_of_two_hosts_alone_are_nobodys() -> None:
    text = BINDING.replace("host: 10.0.0.2", "host: 10.0.0.2, safe: {coil 1: true}")
    ((code, subject, _),) = refused(parse_binding(text), TWO, own_net(split(TWO), ["b"]))
    assert (code, subject) == ("F5105", ("devices", "door"))


def test_what_stands_behind_a_contact_alone_stops_all_machines_and_is_no_single_hosts() -> None:
    relay = "  relay: {driver: modbus-tcp, host: 10.0.0.3, safe: {coil 1: false}}\n"
    text = BINDING.replace(
        "signals:\n", f"{relay}emergency_stop:\n  door: {{device: relay, read: discrete 9}}\nsignals:\n"
    )
    binding, decomposition = parse_binding(text), split(TWO)
    for here in ("a", "b"):
        ((code, subject, message),) = refused(binding, TWO, own_net(decomposition, [here]))
        assert (code, subject) == ("F5105", ("devices", "relay"))
        assert message.startswith(f"'relay' stops machines of '{here}', which runs here")
    together = bound_driver(binding, TWO, own_net(decomposition, ["a", "b"]))
    assert together.devices["relay"].document.safe == {"coil 1": "false"}


def two_devices(left: str, right: str) -> str:
    """The binding where each machine has a device of its own, with these keys beside its channel."""
    one = "{driver: modbus-tcp, host: 10.0.0.1, channels: {L: {number: holding 1}, M: {number: holding 2}}}"
    two = f"  left: {{{left}, channels: {{L: {{number: holding 1}}}}}}\n"
    two += f"  right: {{{right}, channels: {{M: {{number: holding 2}}}}}}"
    text = BINDING.replace(f"  plc: {one}", two).replace("plc, channel: L", "left, channel: L")
    return text.replace("plc, channel: M", "right, channel: M")


PLC = "driver: modbus-tcp, host: 10.0.0.1"


@pytest.mark.parametrize("way", [PLC, f"{PLC}, port: 502, every_s: 0.5"], ids=["same", "other keys"])
@pytest.mark.parametrize("shared", ["safe: {coil 1: true}", "heartbeat: {write: holding 7, every_s: 0.2}"])
def test_two_devices_at_one_address_do_not_write_the_same(shared: str, way: str) -> None:
    apart, part = two_devices(f"{PLC}, {shared}", f"{way}, {shared}"), own_net(split(TWO), ["a"])
    ((code, subject, message),) = refused(parse_binding(apart), TWO, part)
    assert (code, subject) == ("F5105", ("devices", "left"))
    assert "as 'right' does, which is another host's at the same address" in message
    elsewhere = two_devices(f"{PLC}, {shared}", f"driver: modbus-tcp, host: 10.0.0.9, {shared}")
    assert set(bound_driver(parse_binding(elsewhere), TWO, part).devices) == {"left", "door"}
    assert set(bound_driver(parse_binding(apart), TWO, own_net(split(TWO), ["a", "b"])).devices) > {"left", "right"}


def options(driver: str, text: str) -> Options:
    return parse_binding(f"firable_bind: 1\ncell: c\ndevices: {{d: {{driver: {driver}, {text}}}}}\n").options["d"]


@pytest.mark.parametrize(
    ("driver", "one", "same", "other"),
    [
        ("modbus-tcp", "host: plc.cell", "host: PLC.cell., every_s: 1", "host: plc.cell, unit: 2"),
        ("modbus-tcp", "host: 'fe80::1', port: 502", "host: 'FE80:0::1'", "host: 'fe80::1', port: 503"),
        ("modbus-rtu", "port: /dev/ttyS0", "port: /dev/ttyS0, baud: 9600", "port: /dev/ttyS1"),
        ("opcua", "url: opc.tcp://plc:4840", "url: opc.tcp://PLC:4840/, every_s: 1", "url: opc.tcp://plc:4841"),
        ("mqtt", "host: broker", "host: Broker, user: firable", "host: broker, port: 1884"),
        ("serial", "port: /dev/ttyS0", "port: /dev/ttyS0, every_s: 2", "port: /dev/ttyS1"),
    ],
)
def test_a_device_is_the_same_however_it_is_spoken_with(driver: str, one: str, same: str, other: str) -> None:
    assert options(driver, one).far_end() == options(driver, same).far_end()
    assert options(driver, one).far_end() != options(driver, other).far_end()


def test_servers_that_share_a_port_may_be_one_and_are_taken_for_one() -> None:
    """Two hosts would stop each other's machines, where both paths lead to one server."""
    opcua = "driver: opcua, url: 'opc.tcp://plc:4840/{}', safe: {{ns=2;s=stop: true}}"
    text = two_devices(opcua.format("left"), opcua.format("right"))
    for register, node in (("holding 1", "ns=2;s=left"), ("holding 2", "ns=2;s=right")):
        text = text.replace(f"number: {register}", f"number: {node}")
    ((code, subject, message),) = refused(parse_binding(text), TWO, own_net(split(TWO), ["a"]))
    assert (code, subject) == ("F5105", ("devices", "left"))
    assert "as 'right' does, which is another host's at the same address" in message


def test_simulated_devices_are_never_one() -> None:
    assert options("simulated", "seconds: 1").far_end() != options("simulated", "seconds: 1").far_end()


def test_a_host_that_would_share_a_device_is_refused_before_anything_is_connected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = str(tmp_path / "cell.bundle")
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    bind = str(catalogue_path("one_robot").with_name("one_robot.bind.yaml"))
    assert main(["run", bundle, "--controller", "robot", "--join", "tcp/127.0.0.1:1", "--bind", bind]) == 2
    said = capsys.readouterr().err
    assert "error[F5105]: 'modbus' has machines of 'robot', which runs here, and of 'conveyor'" in said
    assert "write a device of its own for each" in said
