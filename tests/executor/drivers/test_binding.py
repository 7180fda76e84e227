"""Bindings: what they say, and everything that can be wrong with one, at its place."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from pydantic import field_validator
from support.small_binding import GOOD, NET, edited, refusal
from support.third_party_driver import MemoryKind, MemoryOptions

from firable.decompose.splitting.cut import split
from firable.executor.drivers import kinds
from firable.executor.drivers.binding import parse_binding, read_binding
from firable.executor.drivers.bound import BoundDriver, bound_driver
from firable.executor.drivers.device import files_of
from firable.executor.drivers.far_side.ends import PORTS, binding_text, ends_of
from firable.executor.drivers.modbus import ModbusTcp
from firable.executor.drivers.opcua import OpcUa
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.net import SignalKind
from firable.nets.text import parse_net

MODBUS = "driver: modbus-tcp\n    host: 10.0.0.1"
STOP = "emergency_stop:\n  door: {device: plc, read: discrete 3}\nsignals:"


def test_a_right_binding_is_read_and_fits(tmp_path: Path) -> None:
    path = tmp_path / "c.bind.yaml"
    path.write_text(GOOD, encoding="utf-8")
    binding = read_binding(path)
    driver = bound_driver(binding, NET)
    assert set(driver.readings()) == {"M.there"}
    assert binding.document.devices["plc"].timeout_s == 1.0
    assert driver.devices["plc"].kept.wanted.read == (
        "discrete 0",
        "discrete 9",
        "input 0",
        "input 1",
        "input 2",
        "input 7",
    )


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("firable_bind: 1", "firable_bind: 2", ("F1011", "1: 2")),
        ("cell: c", "cel: c", ("F1008", "2: cel")),
        ("    host: 10.0.0.1\n", "", ("F1009", "4: plc")),
        ("host: 10.0.0.1", "hots: 10.0.0.1", ("F1008", "6: hots")),
        ("every_s: 0.2", "every_s: soon", ("F1010", "7: soon")),
        ("every_s: 0.2", "every_s: 0", ("F1010", "7: 0")),
        ("within_s: 1", "within_s: 1, extra: 2", ("F1008", "8: extra")),
        ("host: 10.0.0.1", "host: 10.0.0.1\n    port: 70000", ("F1010", "7: 70000")),
        ("on_loss: hold", "on_loss: forget", ("F1010", "14: forget")),
        ("read: discrete 0, ", "", ("F1009", "14: M.there")),
        ("invert: true", "invert: 2", ("F1010", "14: 2")),
        (MODBUS, "driver: mqtt\n    host: broker\n    password: secret", ("F1010", "7: password")),
        (MODBUS, "driver: opcua\n    url: opc.tcp://plc:4840\n    password: secret", ("F1010", "7: password")),
    ],
)
def test_what_is_no_binding_is_refused_where_it_stands(old: str, new: str, found: tuple[str, str]) -> None:
    assert found in refusal(edited(old, new))


@pytest.mark.parametrize(
    ("keys", "hint"),
    [
        ("driver: opcua\n    url: opc.tc://plc:4840", "did you mean 'opc.tcp'? write it such as"),
        ("driver: opcua\n    url: opc.tcp:/plc:4840", "write it such as `opc.tcp://192.168.0.10:4840/`"),
        ("driver: opcua\n    url: plc:4840", "write it such as"),
        ("driver: opcua\n    url: opc.tcp://plc", "write it such as"),
        ("driver: opcua\n    url: 'opc.tcp://plc:4840/ '", "write it such as"),
        ("driver: mqtt\n    host: '\uff11\uff12.0.0.1'", "write the name or the address of a host"),
        ("driver: opcua\n    url: opc.tcp://plc:484O", "write it such as"),
        ("driver: opcua\n    url: opc.tcp://:4840", "write it such as"),
        ("driver: opcua\n    url: 'opc.tcp://[::1:4840'", "write it such as"),
        ("driver: mqtt\n    host: mqtt://broker", "write `host: broker`"),
        ("driver: mqtt\n    host: mqtt://broker:1884/cell", "write `host: broker` and `port: 1884`"),
        ("driver: mqtt\n    host: ''", "write the name or the address of a host"),
        ("driver: mqtt\n    host: the broker", "write the name or the address of a host"),
        ("driver: modbus-tcp\n    host: 10.0.0.1:503", "write `host: 10.0.0.1` and `port: 503`"),
        ("driver: modbus-tcp\n    host: '[fe80::1]'", "write `host: fe80::1`"),
        ("driver: modbus-tcp\n    host: 10.0.0.256", "write the name or the address of a host"),
        ("driver: modbus-tcp\n    host: 10.0.1", "write the name or the address of a host"),
        ("driver: modbus-rtu\n    port: ttyUSB0", "write a path such as `/dev/ttyUSB0`"),
        ("driver: serial\n    port: 9600", "write a path such as"),
        ("driver: serial\n    port: socket://plc:7000", "write a path such as"),
    ],
)
def test_address_at_which_no_device_can_be_is_refused_where_it_stands(keys: str, hint: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_binding(edited(MODBUS, keys))
    first = refused.value.diagnostics[0]
    assert (first.code, first.hint[: len(hint)]) == ("F1010", hint)
    assert first.span is not None
    assert first.span.line == 6


@pytest.mark.parametrize(("word", "meant"), [("acknowleged", "did you mean 'acknowledged'? "), ("discrete 2", "")])
def test_a_signal_that_is_neither_read_nor_acknowledged_is_told_both_ways(word: str, meant: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_binding(edited("M.moved: acknowledged", f"M.moved: {word}"))
    (found,) = refused.value.diagnostics
    assert found.hint == f"{meant}`{{device: ..., read: ...}}` is expected, or `acknowledged` of a completion"


@pytest.mark.parametrize(
    "keys",
    [
        "driver: opcua, url: 'opc.tcp://plc-1.cell:4840/firable/server'",
        "driver: opcua, url: 'OPC.TCP://[fe80::1]:4840'",
        "driver: opcua, url: 'opc.tcp://user:word@10.0.0.1:4840/'",
        "driver: mqtt, host: broker_1",
        "driver: mqtt, host: 'fe80::1%eth0'",
        "driver: modbus-tcp, host: müller.example.",
        "driver: modbus-rtu, port: ./line",
        "driver: serial, port: /dev/serial/by-id/usb-FTDI_FT232R-if00-port0",
    ],
)
def test_address_at_which_a_device_may_be_is_taken(keys: str) -> None:
    parse_binding(f"firable_bind: 1\ncell: c\ndevices:\n  plc: {{{keys}}}\n")


def test_an_unknown_key_of_a_device_is_told_with_the_keys_of_its_driver() -> None:
    with pytest.raises(InputError) as refused:
        parse_binding(edited("host: 10.0.0.1", "host: 10.0.0.1\n    prot: 502"))
    problem = refused.value.diagnostics[0]
    assert problem.hint.startswith("did you mean 'port'? ")
    assert problem.span is not None
    assert problem.span.line == 7


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("driver: modbus-tcp", "driver: modbustcp", "5: driver"),
        ("driver: modbus-tcp", "driver: unheard", "5: driver"),
    ],
)
def test_an_unknown_driver_is_refused(old: str, new: str, place: str) -> None:
    assert refusal(edited(old, new)) == [("F5103", place)]


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("read: discrete 0", "read: discret 0", "14: read"),
        ("read: discrete 0", "read: discrete 70000", "14: read"),
        ("read: discrete 0", "read: discrete 0.1", "14: read"),
        ("read: discrete 0", "read: input 0.16", "14: read"),
        ("read: discrete 0", "read: input 0.01", "14: read"),
        ("write: {holding 2: 7}", "write: {holding 02: 7}", "17: holding 02"),
        ("write: {holding 2: 7}", "write: {holding \u0662: 7}", "17: holding \u0662"),
        ("write: {holding 2: 7}", "write: {input 2: 7}", "17: input 2"),
        ("safe: {coil 1: false}", "safe: {discrete 1: false}", "9: discrete 1"),
        ("number: holding 5", "number: register 5", "12: number"),
        ("invert: true", "force: true", "14: force"),
    ],
)
def test_what_is_no_address_of_the_device_for_its_use_is_refused(old: str, new: str, place: str) -> None:
    assert refusal(edited(old, new)) == [("F5102", place)]


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("write: {holding 2: 7}", "write: {holding 2: 65536}", "17: holding 2"),
        ("write: {holding 2: 7}", "write: {holding 2: -32769}", "17: holding 2"),
        ("write: {holding 2: 7}", "write: {holding 2: 1.5}", "17: holding 2"),
        ("write: {holding 2: 7}", "write: {holding 2: MOVE}", "17: holding 2"),
        ("write: {holding 2: 7}", "write: {holding 2.3: 7}", "17: holding 2.3"),
        ("safe: {coil 1: false}", "safe: {coil 1: 2}", "9: coil 1"),
    ],
)
def test_a_value_that_its_point_cannot_take_is_refused(old: str, new: str, place: str) -> None:
    assert refusal(edited(old, new)) == [("F5102", place)]


@pytest.mark.parametrize(
    ("old", "new", "place", "why"),
    [
        ("write: holding 0", "write: coil 3", "7: write", "'coil 3' does not take a heartbeat, which grows to 65535"),
        ("write: holding 0", "write: holding 0.1", "7: write", "'holding 0.1' does not take a heartbeat"),
        ("number: holding 5", "number: coil 5", "12: number", "'coil 5' does not take the numbers of commands"),
        (
            "number: holding 5",
            "number: holding 5.2",
            "12: number",
            "'holding 5.2' does not take the numbers of commands",
        ),
        ("number: holding 5", "command: holding 5", "12: command", "'holding 5' does not take commands as texts"),
        ("number: holding 5", "command: coil 5", "12: command", "'coil 5' does not take commands as texts"),
    ],
)
def test_a_point_that_does_not_take_what_the_driver_writes_there_is_refused(
    old: str, new: str, place: str, why: str
) -> None:
    """A heartbeat at a bit would be 1 for ever, whether or not anybody sends it."""
    assert refusal(edited(old, new)) == [("F5102", place)]
    with pytest.raises(InputError, match=why):
        parse_binding(edited(old, new))


@pytest.mark.parametrize("value", ["65535", "-32768", "0", "true"])
def test_values_of_16_bits_are_taken_with_a_sign_and_without(value: str) -> None:
    parse_binding(edited("write: {holding 2: 7}", f"write: {{holding 2: {value}}}"))


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("write: holding 0,", "write: holding 1,", "7: write"),
        ("number: holding 5", "number: holding 1", "12: number"),
        ("write: {holding 2: 7}", "write: {holding 1: 7}", "17: holding 1"),
        ("write: {holding 2: 7}", "write: {holding 0: 7}", "17: holding 0"),
        ("done: input 2", "done: input 1", "11: done"),
        ("number: holding 5", "number: holding 5, taken: input 1", "12: taken"),
        ("taken: input 1", "taken: holding 1", "11: taken"),
        ("number: holding 5", "number: holding 5, failed: input 2", "12: failed"),
    ],
)
def test_a_point_that_would_mean_two_things_is_refused(old: str, new: str, place: str) -> None:
    assert refusal(edited(old, new)) == [("F5102", place)]


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("read: input 0", "read: holding 0", "8: read"),
        ("read: input 0", "read: holding 0.0", "8: read"),
        ("read: input 0", "read: holding 5", "8: read"),
        ("read: input 0", "read: coil 1", "8: read"),
        ("read: input 0", "read: holding 2", "8: read"),
        ("tripped: discrete 9", "tripped: holding 0", "7: tripped"),
        ("tripped: discrete 9", "tripped: coil 1", "7: tripped"),
    ],
)
def test_what_a_device_must_show_by_itself_is_read_where_nothing_is_written(old: str, new: str, place: str) -> None:
    """The echo of a heartbeat at the server of a control, or at a broker, would be its sign of life for ever."""
    assert refusal(edited(old, new)) == [("F5102", place)]


@pytest.mark.parametrize("point", ["holding 0", "holding 0.3", "holding 1", "holding 2", "coil 1"])
@pytest.mark.parametrize("of", ["plc", "same"])
def test_a_contact_of_the_emergency_stop_is_read_where_nothing_is_written(point: str, of: str) -> None:
    same = "  same: {driver: modbus-tcp, host: 10.0.0.1}\n"
    stop = f"{same}emergency_stop: {{door: {{device: {of}, read: {point}}}}}\nsignals:"
    assert refusal(edited("signals:", stop)) == [("F5102", "14: read")]


def test_a_register_is_written_where_a_bit_of_it_is() -> None:
    text = edited("safe: {coil 1: false}", "safe: {holding 9.1: false}").replace("read: input 0", "read: holding 9")
    assert refusal(text) == [("F5102", "8: read")]


def test_bits_beside_each_other_in_a_register_are_two_points() -> None:
    text = edited("write: {holding 2: 7}", "write: {holding 3.1: 1}").replace("input 0", "holding 3.2")
    parse_binding(text)


@pytest.mark.parametrize(
    ("channel", "host", "keys"),
    [
        ("{number: holding 1}", "10.0.0.1", ["number"]),
        ("{number: holding 0}", "10.0.0.1", ["number"]),
        ("{number: holding 9, taken: input 1, done: input 2}", "10.0.0.1", ["taken", "done"]),
        ("{number: holding 9, taken: input 3}", "10.0.0.1", []),
        ("{number: holding 1, taken: input 1}", "10.0.0.2", []),
    ],
)
def test_a_point_that_means_two_things_by_two_devices_at_one_address_is_refused(
    channel: str, host: str, keys: list[str]
) -> None:
    heartbeat = "heartbeat: {write: holding 0, every_s: 1}"  # on one host two devices may have one
    second = f"  again: {{driver: modbus-tcp, host: {host}, {heartbeat}, channels: {{O: {channel}}}}}\nsignals:"
    text = edited("signals:", second)
    try:
        parse_binding(text)
    except InputError as error:
        found = [problem.subject[-1] for problem in error.diagnostics if problem.code == "F5102"]
        assert found == keys
    else:
        assert not keys


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("{number: holding 11, taken: holding 15}", "{number: holding 15}"),
        ("{number: holding 15}", "{number: holding 11, taken: holding 15}"),
    ],
)
def test_it_is_refused_whichever_device_stands_first(first: str, second: str) -> None:
    device = "{{driver: modbus-tcp, host: 10.0.0.9, channels: {{O: {}}}}}".format
    text = edited("signals:", f"  one: {device(first)}\n  two: {device(second)}\nsignals:")
    with pytest.raises(InputError) as refused:
        parse_binding(text)
    assert [(one.code, one.subject[-1]) for one in refused.value.diagnostics] == [("F5102", "taken")]


def test_a_common_alarm_of_machines_without_numbers_and_requests_among_the_safe_outputs_are_taken() -> None:
    text = edited("number: holding 1, taken: input 1, done: input 2", "request: coil 1, done: coil 2, failed: coil 4")
    parse_binding(text.replace("number: holding 5", "request: coil 5, done: coil 6, failed: coil 4"))


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("N: {number: holding 5}", "N: {number: holding 5, command: holding 6}", "12: N"),
        ("N: {number: holding 5}", "N: {taken: input 5}", "12: N"),
        ("{device: plc, read: discrete 0,", "{device: pcl, read: discrete 0,", "14: device"),
        ("{device: plc, channel: M, write: {holding 2: 7}}", "{device: pcl, channel: M}", "17: device"),
        ("{device: plc, channel: M, write: {holding 2: 7}}", "{device: plc, channel: O}", "17: channel"),
    ],
)
def test_what_refers_to_nothing_is_refused(old: str, new: str, place: str) -> None:
    assert refusal(edited(old, new)) == [("F5101", place)]


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("device: plc", "device: plx", ("F5101", "14: device")),
        ("discrete 3", "coil x", ("F5102", "14: read")),
        ("read: discrete 3", "read: discrete 3, on_loss: hold", ("F1008", "14: door")),
        ("read: discrete 3", "read: discrete 3, controllers: [M, N]", ("F5101", "14: controllers")),
        ("read: discrete 3", "read: discrete 3, controllers: []", ("F1010", "14: [")),
        ("read: discrete 3", "read: discrete 3, controllers: ", ("F1010", "14: controllers")),
        ("{device: plc, read: discrete 3}", "{device: cloud, read: stop}", ("F5101", "17: device")),
    ],
)
def test_a_contact_of_the_emergency_stop_that_would_stop_nothing_is_refused(
    old: str, new: str, found: tuple[str, str]
) -> None:
    stop = STOP.replace(old, new)
    if "cloud" in new:  # whose broker is there, and says nothing of the device
        stop = stop.replace("emergency_stop:", "  cloud:\n    driver: mqtt\n    host: broker\nemergency_stop:")
    assert found in refusal(edited("signals:", stop), fit=found == ("F5101", "14: controllers"))


def test_a_contact_is_for_one_controller_by_its_name_alone() -> None:
    stop = STOP.replace("discrete 3", "discrete 3, controllers: robot")
    contact = parse_binding(edited("signals:", stop)).document.emergency_stop["door"]
    assert contact.controllers == ("robot",)


@pytest.mark.parametrize(
    ("device", "contact", "signal", "is_refused"),
    [
        ("plc", "coil 3", "coil 3", True),
        ("plc", "coil 3", "coil 4", False),
        ("plc", "holding 3.5", "holding 3", True),
        ("plc", "holding 3", "holding 3.5", True),
        ("plc", "holding 3.5", "holding 3.6", False),
        ("same", "coil 3", "coil 3", True),
        ("other", "coil 3", "coil 3", False),
    ],
)
def test_signal_that_may_be_forced_where_a_contact_of_the_emergency_stop_is_read_is_refused(
    device: str, contact: str, signal: str, *, is_refused: bool
) -> None:
    hosts = {"plc": "10.0.0.1", "same": "10.0.0.1", "other": "10.0.0.2"}
    devices = "".join(f"  {name}: {{driver: modbus-tcp, host: {host}}}\n" for name, host in hosts.items())
    text = (
        f"firable_bind: 1\ncell: c\ndevices:\n{devices}"
        f"emergency_stop: {{door: {{device: plc, read: {contact}}}}}\n"
        f"signals:\n  a.door: {{device: {device}, read: {signal}, FORCE}}\n"
    )
    assert parse_binding(text.replace(", FORCE", ""))
    forced = text.replace("FORCE", "force: true")
    assert refusal(forced) == [("F5102", "9: force")] if is_refused else parse_binding(forced)


def test_a_host_with_all_controllers_drives_what_is_behind_a_contact_and_one_of_several_does_not_have_it() -> None:
    (part,) = split(NET).subnets
    far = "  far:\n    driver: modbus-tcp\n    host: 10.0.0.2\n    safe: {coil 9: false}\nemergency_stop:"
    door = STOP.replace("device: plc", "device: far").replace("emergency_stop:", far)
    driver = bound_driver(parse_binding(edited("signals:", door)), NET, part)
    assert set(driver.readings()) == {"M.there", "emergency stop door"}
    assert (driver.devices["plc"].document.safe, driver.devices["far"].document.safe) == (
        {"coil 1": "false"},
        {"coil 9": "false"},
    )
    others = NET.controllers[0].name
    binding = parse_binding(edited("signals:", door.replace("discrete 3", "discrete 3, controllers: [N]")))
    assert set(binding.serving({"M.there"}, [others]).document.devices) == {"plc"}
    assert set(binding.serving({"M.there"}, ["N"]).document.devices) == {"plc", "far"}


def test_who_only_looks_sees_the_contacts_and_is_stopped_by_none() -> None:
    watching = parse_binding(edited("signals:", STOP)).watching()
    driver = BoundDriver(watching, (), frozenset())
    assert set(driver.readings()) == {"M.there", "emergency stop door"}
    assert driver.may_move


@pytest.mark.parametrize("channel", ["{request: coil 1}", "{request: coil 1, number: holding 3, done: discrete 1}"])
def test_a_request_that_nobody_answers_or_that_stands_beside_a_number_is_refused(channel: str) -> None:
    assert refusal(edited("{number: holding 5}", channel)) == [("F5101", "12: N")]


def test_the_binding_of_the_catalogue_fits_its_net_and_can_be_served() -> None:
    binding = read_binding(catalogue_path("one_robot").with_name("one_robot.bind.yaml"))
    driver = bound_driver(binding, catalogue_net("one_robot"))
    assert set(driver.devices) == set(ends_of(binding)) == {"modbus", "opcua"}


def test_libraries_of_devices_are_there_before_an_event_loop_waits_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """The import of asyncua takes seconds on a busy machine, which stood in the log as a process that did not run."""
    loaded: list[str] = []
    for kind in (ModbusTcp, OpcUa):
        monkeypatch.setattr(kind, "load", lambda self: loaded.append(type(self).__name__))
    binding = read_binding(catalogue_path("one_robot").with_name("one_robot.bind.yaml"))
    bound_driver(binding, catalogue_net("one_robot"))
    assert sorted(loaded) == ["ModbusTcp", "OpcUa"]


def test_a_driver_of_others_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    def entries(**_: str) -> list[EntryPoint]:
        return [
            EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP),
            EntryPoint("broken", "support.no_such_module:KIND", kinds.GROUP),
            EntryPoint("double", "support.third_party_driver:KIND", kinds.GROUP),
            EntryPoint("double", "support.third_party_driver:OTHER", kinds.GROUP),
        ]

    monkeypatch.setattr(kinds, "entry_points", entries)
    text = edited("driver: modbus-tcp\n    host: 10.0.0.1", "driver: theirs\n    memory: m")
    assert bound_driver(parse_binding(text), NET).readings()
    assert "theirs" in kinds.kind_names()
    for name in ("broken", "double", "theri"):
        assert refusal(text.replace("driver: theirs", f"driver: {name}")) == [("F5103", "5: driver")]
    # What is firable's own cannot be taken over.
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [EntryPoint("modbus-tcp", "os:path", kinds.GROUP)])
    assert kinds.kind_named("modbus-tcp") is not None


class Even(MemoryOptions):
    """Options of others that say themselves what is wrong with them."""

    @field_validator("memory")
    @classmethod
    def _even(cls, memory: str) -> str:
        raise ValueError(f"'{memory}' is an odd memory")


def test_what_the_options_of_others_say_is_told_at_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = EntryPoint("theirs", "support.third_party_driver:KIND", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda **_: [theirs])
    monkeypatch.setattr(MemoryKind, "options", Even)
    with pytest.raises(InputError) as refused:
        parse_binding(edited(MODBUS, "driver: theirs\n    memory: m"))
    (problem,) = refused.value.diagnostics
    assert (problem.code, problem.hint) == ("F1010", "")
    assert problem.message == "'m' is an odd memory in 'devices.plc.memory'"
    assert problem.span is not None
    assert problem.span.line == 6


TLS = """
  broker:
    driver: mqtt
    host: 10.0.0.2
    tls: {ca: keys/site.pem, certificate: own.pem, key: own.key}
"""


def test_files_are_found_from_the_folder_of_the_binding_wherever_the_program_runs(tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    for name in ("keys/site.pem", "own.pem", "own.key"):
        (tmp_path / name).write_text("a key")
    path = tmp_path / "c.bind.yaml"
    path.write_text(GOOD.replace("signals:\n", f"{TLS.strip(chr(10))}\nsignals:\n", 1))
    binding = read_binding(path)
    assert not [*binding.unreadable()]
    assert {keys: str(file) for keys, file in files_of(binding.options["broker"])} == {
        ("tls", "ca"): str(tmp_path / "keys/site.pem"),
        ("tls", "certificate"): str(tmp_path / "own.pem"),
        ("tls", "key"): str(tmp_path / "own.key"),
    }


def test_a_file_that_cannot_be_read_is_refused_with_its_line_where_its_device_is_served(tmp_path: Path) -> None:
    path = tmp_path / "c.bind.yaml"
    path.write_text(GOOD.replace("signals:\n", f"{TLS.strip(chr(10))}\nsignals:\n", 1))
    (tmp_path / "own.pem").write_text("a certificate")
    (tmp_path / "own.key").mkdir()
    with pytest.raises(InputError) as refused:
        bound_driver(read_binding(path), NET)
    lines = path.read_text().splitlines()
    found = {(one.code, lines[one.span.line - 1].strip()) for one in refused.value.diagnostics if one.span}
    assert found == {("F1001", "tls: {ca: keys/site.pem, certificate: own.pem, key: own.key}")}
    assert len(refused.value.diagnostics) == 2
    assert str(tmp_path / "keys/site.pem") in refused.value.diagnostics[0].message
    assert "folder of the binding" in refused.value.diagnostics[0].hint
    assert bound_driver(read_binding(path), NET, NET), "the broker is another host's"


LONG = "s" * 100
ODD = parse_net(f"""\
firable: 1
cell: 'line #2: "fast"'
controllers:
  tür+1:
    start: "on"
    inputs: [a=b, "null", zu_für, {LONG}]
    places:
      "on":
      go: {{send: {{machine: "M# 1: x", command: "G,O"}}, until: "yes"}}
      gone: {{send: {{machine: "null", command: STOP}}, until: "no"}}
transitions:
  begin: {{from: tür+1.on, to: tür+1.go, if: [tür+1.a=b, tür+1.null, tür+1.zu_für, tür+1.{LONG}]}}
  end: {{from: tür+1.go, to: tür+1.gone}}
""")


@pytest.mark.parametrize("protocol", PORTS)
def test_a_binding_that_is_written_for_a_simulated_cell_is_read_whatever_its_names_are(protocol: str) -> None:
    """A topic has no `+`, a word on a line no umlaut and not a hundred letters, and YAML signs of its own."""
    sensed = [signal.name for signal in ODD.signals if signal.kind is SignalKind.SENSOR]
    assert len(sensed) == 4
    bound_driver(
        parse_binding(binding_text(ODD, {protocol: "/dev/line" if protocol == "serial" else "1502"}, sensed)), ODD
    )
