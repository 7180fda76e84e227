"""`firable sim`, `firable io` and `firable run --bind`: the cell over sockets, looked at, forced and run."""

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from support.served_cells import halved, unhurried
from support.waiting import PATIENCE_SECONDS, heard_in_time

from firable.cli.main import main
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.far_side.ends import PORTS, binding_text
from firable.executor.drivers.far_side.mqtt_device import mosquitto
from firable.executor.drivers.far_side.ports import free_port
from firable.executor.drivers.fitting import misfits
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import read_plant
from firable.semantics.replaying import replay
from firable.semantics.trace import read_trace

SCHEMA = json.loads(files("firable.cli").joinpath("io.schema.json").read_text(encoding="utf-8"))
REPORT_SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
NET = catalogue_net("one_robot")
SENSORS = read_plant(catalogue_path("one_robot").with_name("one_robot.plant.yaml")).sensors


def firable(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-u", "-m", "firable.cli", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@dataclass
class Cell:
    """A cell that is served by a process of its own, and where."""

    process: subprocess.Popen[str]
    bind: Path

    def line_with(self, text: str) -> str:
        """Read on to the line that holds a text."""
        assert self.process.stdout is not None
        with heard_in_time(self.process):
            for line in self.process.stdout:
                if text in line:
                    return line
        raise AssertionError(f"the cell has ended and never said '{text}'")


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    """The one-robot cell over Modbus, of which the completion of a grasp and the sensor of MC may be forced."""
    bind = tmp_path / "cell.bind.yaml"
    port = free_port()
    text = unhurried(binding_text(NET, {"modbus": str(port)}, SENSORS))
    text = text.replace("write: {holding 10: 5}}", "write: {holding 10: 5}, force: true}")
    held = "mc.part_present: {device: modbus, read: coil 20, on_loss: hold, force: true}"
    bind.write_text("\n".join(f"  {held}" if "mc.part_present:" in line else line for line in text.split("\n")))
    serving = firable("sim", "catalogue:one_robot", "--bind", str(bind), "--workpieces", "1", "--speed", "40")
    served = Cell(serving, bind)
    try:
        assert served.line_with(" at ") == f"{bind}: modbus at {port}\n"
        served.line_with("serving 'one-robot'")
        yield served
    finally:
        serving.terminate()
        serving.communicate(timeout=PATIENCE_SECONDS)


def test_signals_are_shown_and_forced_only_where_the_binding_allows_it(
    cell: Cell, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["io", str(cell.bind), "--once"]) == 0
    shown = capsys.readouterr().out
    assert "mc.part_present         0      good" in shown
    assert main(["io", str(cell.bind), "--once", "--force", "mc.part_present=1"]) == 0
    assert "mc.part_present         1      good" in capsys.readouterr().out
    assert main(["io", str(cell.bind), "--force", "robot.touch=1"]) == 2
    assert "does not allow 'robot.touch' to be forced" in capsys.readouterr().err
    assert main(["io", str(cell.bind), "--force", "robot.at_cv1=1"]) == 2
    assert "'robot.at_cv1' is `acknowledged`: its machine says when it is done" in capsys.readouterr().err
    assert main(["io", str(cell.bind), "--force", "robot.tuch=1"]) == 2
    assert "no signal 'robot.tuch' is read; did you mean 'robot.touch'?" in capsys.readouterr().err
    for button in ("button", "emergency stop button"):
        assert main(["io", str(cell.bind), "--force", f"{button}=0"]) == 2
        assert f"'{button}' is a contact of the emergency stop, which is opened" in capsys.readouterr().err


def test_sensors_of_a_cell_on_a_serial_line_can_be_forced_as_those_of_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind = tmp_path / "cell.bind.yaml"
    serving = firable("sim", "catalogue:one_robot", "--serial", "--bind", str(bind), "--workpieces", "0")
    try:
        Cell(serving, bind).line_with("serving 'one-robot'")
        assert main(["io", str(bind), "--once", "--force", "mc.part_present=1"]) == 0
        assert main(["io", str(bind), "--once"]) == 0
        assert capsys.readouterr().out.count("mc.part_present         1      good") == 2
    finally:
        serving.terminate()
        serving.communicate(timeout=PATIENCE_SECONDS)


def shown(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """What was printed, line by line, each as the published schema has it."""
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for line in lines:
        jsonschema.Draft202012Validator(SCHEMA).validate(line)
    return lines


def test_a_program_reads_signals_as_lines_of_json_of_the_published_schema(
    cell: Cell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert main(["io", str(cell.bind), "--once", "--format", "json", "--force", "mc.part_present=1"]) == 0
    (line,) = shown(capsys)
    both = ("--force", "mc.part_present=1", "--force", "mc.part_present=0")
    assert main(["io", str(cell.bind), "--once", *both]) == 2
    assert "'mc.part_present' is forced to 0 and to 1: name it once" in capsys.readouterr().err
    assert line["devices"] == {"modbus": {"connected": True}}
    assert (line["signals"]["mc.part_present"]["value"], line["signals"]["mc.part_present"]["quality"]) == (
        True,
        "good",
    )
    assert main(["io", str(cell.bind), "--for", "2", "--format", "json"]) == 0
    assert 1 <= len(shown(capsys)) <= 3  # one for each change
    gone = tmp_path / "gone.bind.yaml"
    text = binding_text(NET, {"modbus": str(free_port())}, SENSORS)
    gone.write_text(text.replace("host: 127.0.0.1", "host: 127.0.0.1\n    start_s: 0.2"))
    assert main(["io", str(gone), "--once", "--format", "json"]) == 3
    (line,) = shown(capsys)
    assert line["devices"] == {"modbus": {"connected": False}}
    assert {(one["value"], one["quality"]) for one in line["signals"].values()} == {(None, "bad")}


def test_looking_writes_nothing_and_sending_by_hand_is_for_what_the_binding_allows(
    cell: Cell, capsys: pytest.CaptureFixture[str]
) -> None:
    sending = ["io", str(cell.bind), "--once", "--net", "catalogue:one_robot", "--send"]
    assert main(["io", str(cell.bind), "--once"]) == 0
    assert main([*sending, "robot.to_cv1"]) == 2
    assert main([*sending, "robot.back"]) == 0
    assert "robot.back: taken" in capsys.readouterr().err.splitlines()
    assert cell.line_with(" R ").strip().endswith("R MOVE to=HOME")


def test_devices_that_do_not_answer_are_waited_for_together_and_each_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"line{i}" for i in range(40)]
    device = "driver: serial, port: /dev/nobody-is-here, start_s: 0.5"
    lines = ["firable_bind: 1", "cell: dark", "devices:", *(f"  {name}: {{{device}}}" for name in names), "signals:"]
    bind = tmp_path / "dark.bind.yaml"
    bind.write_text("\n".join([*lines, *(f"  s.{name}: {{device: {name}, read: s}}" for name in names), ""]))
    begun = time.monotonic()
    assert main(["io", str(bind), "--once"]) == 3
    assert time.monotonic() - begun < len(names) * 0.5
    said = capsys.readouterr()
    assert said.out.count("not reached since the start") == len(names)
    assert [name for name in names if f"{name}: not connected: /dev/nobody-is-here: " not in said.err] == []


@pytest.mark.parametrize(
    "command",
    [
        ("check", "catalogue:one_robot", "--bind"),
        ("check", "catalogue:one_robot", "--machines", "catalogue:one_robot", "--bind"),
        ("io", "--once", "--net", "catalogue:one_robot"),
    ],
    ids=["check", "check with machines", "io"],
)
def test_a_binding_is_held_against_its_net_without_a_device(
    command: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind = tmp_path / "c.bind.yaml"
    text = binding_text(NET, {"modbus": str(free_port())}, SENSORS)
    bind.write_text(text.replace("host: 127.0.0.1", "host: 127.0.0.1\n    start_s: 0.2"))
    fits = main([*command, str(bind)])
    assert fits == (3 if "io" in command else 0), "nobody is there, and that it fits is no matter of that"
    said = capsys.readouterr()
    assert "F5101" not in said.err
    assert (f"{bind} binds each signal and command" in said.out) == ("check" in command)
    lines = bind.read_text().splitlines(keepends=True)
    bind.write_text("".join(line for line in lines if not line.startswith("  mc.part_present:")))
    assert main([*command, str(bind)]) == 2
    said = capsys.readouterr()
    assert "error[F5101]: the signal 'mc.part_present' is not bound" in said.err
    assert "must hold" not in said.out


def test_the_report_of_a_check_names_the_binding_that_fits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bind = tmp_path / "c.bind.yaml"
    bind.write_text(binding_text(NET, {"modbus": str(free_port())}, SENSORS))
    for machines in ([], ["--machines", "catalogue:one_robot"]):
        assert main(["check", "catalogue:one_robot", "--bind", str(bind), *machines, "--format", "json"]) == 0
        report = json.loads(capsys.readouterr().out)
        jsonschema.Draft202012Validator(REPORT_SCHEMA).validate(report)
        assert report["reports"][0]["binding"] == str(bind)


def test_a_binding_is_of_one_net(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bind = tmp_path / "c.bind.yaml"
    bind.write_text(binding_text(NET, {"modbus": str(free_port())}, SENSORS))
    assert main(["check", "catalogue:one_robot", "catalogue:two_cells", "--bind", str(bind)]) == 2
    assert "--bind is a binding of one net: name one NET" in capsys.readouterr().err


def test_what_cannot_be_read_is_told_and_unknown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bind = tmp_path / "c.bind.yaml"
    text = binding_text(NET, {"modbus": str(free_port())}, SENSORS)
    bind.write_text(text.replace("host: 127.0.0.1", "host: 127.0.0.1\n    start_s: 0.2"))
    assert main(["io", str(bind), "--once"]) == 3
    said = capsys.readouterr()
    assert "bad        -          0  not reached since the start" in said.out
    assert "modbus: not connected: " in said.err


def test_bundle_runs_on_the_machines_of_a_binding_until_it_is_stopped(cell: Cell, tmp_path: Path) -> None:
    bundle, trace = tmp_path / "cell.bundle", tmp_path / "trace"
    assert main(["bundle", "catalogue:one_robot", "-o", str(bundle)]) == 0
    running = firable("run", str(bundle), "--bind", str(cell.bind), "--trace", str(trace), "--format", "json")
    cell.line_with("workpiece 1 is carried out")
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=PATIENCE_SECONDS)
    assert running.returncode == 0, said
    report = json.loads(said[said.index("{") :])
    schema = REPORT_SCHEMA
    bound = {
        **schema,
        "properties": {"run": {"$ref": "#/$defs/bound_run"}},
        "additionalProperties": True,
        "required": [],
    }
    jsonschema.Draft202012Validator(schema).validate(report)
    (one,) = report["reports"]
    jsonschema.Draft202012Validator(bound).validate(one)
    assert (one["run"]["state"], one["run"]["binding"]) == ("stopped", str(cell.bind))
    assert one["run"]["commands"] > 5
    assert replay(NET, read_trace(trace)).complete


@pytest.mark.skipif(mosquitto() is None, reason="needs the broker mosquitto, which is not installed")
def test_binding_by_hand_with_each_machine_behind_a_protocol_of_its_own_is_served_and_run(tmp_path: Path) -> None:
    lines = [tmp_path / "robot.line", tmp_path / "conveyor.line"]
    ports = {"modbus": str(free_port()), "opcua": str(free_port()), "mqtt": str(free_port()), "serial": str(lines[1])}
    text = unhurried(binding_text(NET, ports, SENSORS))
    tcp = f"driver: modbus-tcp\n    host: 127.0.0.1\n    port: {ports['modbus']}"
    broker = "driver: mqtt\n    host: 127.0.0.1"
    sensor = "read: sensors/conveyor.part_at_exit"
    for was, is_now in (
        (tcp, f"driver: modbus-rtu\n    port: {lines[0]}\n    parity: N"),
        (broker, f"{broker}\n    alive: {{read: cell/life, within_s: 10}}"),
        (sensor, f"{sensor}, edges: edges/conveyor.part_at_exit"),
    ):
        assert text.count(was) == 1
        text = text.replace(was, is_now)
    bind, bundle = tmp_path / "own.bind.yaml", tmp_path / "cell.bundle"
    bind.write_text(text)
    lines[0].symlink_to("/dev/pts/a terminal that went with its process")
    assert main(["bundle", "catalogue:one_robot", "-o", str(bundle)]) == 0
    serving = firable("sim", "catalogue:one_robot", "--bind", str(bind), "--workpieces", "1", "--speed", "10")
    served = Cell(serving, bind)
    try:
        served.line_with("serving 'one-robot'")
        running = firable("run", str(bundle), "--bind", str(bind))
        served.line_with("workpiece 1 is carried out")
        running.send_signal(signal.SIGINT)
        said, _ = running.communicate(timeout=PATIENCE_SECONDS)
        assert running.returncode == 0, said
    finally:
        serving.terminate()
        rest, _ = serving.communicate(timeout=PATIENCE_SECONDS)
    assert "ended: 1 carried out, 0 inside" in rest
    assert [path for path in lines if path.is_symlink()] == []


ARM = """
firable: 1
cell: arm
controllers:
  a:
    start: home
    inputs: [key]
    places: {home: , away: {send: {machine: A, command: MOVE}, until: there}}
transitions:
  go:   {from: a.home, to: a.away}
  back: {from: a.away, to: a.home, unless: a.key}
"""
FAR = """
firable_bind: 1
cell: arm
devices:
  far: {driver: serial, port: /dev/nobody-is-here, start_s: 0.5, channels: {A: {command: out, taken: in, done: ok}}}
signals: {a.there: acknowledged, a.key: {device: far, read: key}}
commands: {a.away: {device: far, channel: A}}
"""


def test_commands_of_a_device_that_was_never_reached_are_counted_as_issued_and_no_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.firable.yaml").write_text(ARM)
    (tmp_path / "arm.bind.yaml").write_text(FAR)
    assert main(["bundle", str(tmp_path / "arm.firable.yaml"), "-o", str(tmp_path / "arm.bundle")]) == 0
    assert main(["run", str(tmp_path / "arm.bundle"), "--bind", str(tmp_path / "arm.bind.yaml")]) == 1
    said = capsys.readouterr().out
    assert "'a.key' cannot be read: not reached since the start" in said
    assert "1 firing, 1 command issued, " in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["sim", "catalogue:one_robot"], "name protocols"),
        (["sim", "catalogue:one_robot", "--modbus", "--stuck", "robot.tuch=1"], "did you mean 'robot.touch'?"),
        (["sim", "catalogue:one_robot", "--modbus", "--stuck", "robot.touch=2"], "write SIGNAL=0 or SIGNAL=1"),
        (["sim", "catalogue:one_robot", "--modbus", "--drop", "R.MOV"], "did you mean 'R.MOVE'?"),
        (
            ["sim", "catalogue:one_robot", "--modbus", "--drop", "R.PUT"],
            "nothing is held when 'R.PUT' ends; name one of R.",
        ),
        (["sim", "catalogue:one_robot", "--modbus", "--drop", "MC.CLAMP#2"], "nothing is held when 'MC.CLAMP' ends"),
        (["sim", "catalogue:index_table", "--modbus", "--drop", "T.INDEX"], "no command of this cell ends so"),
        (
            ["sim", "catalogue:index_table", "--modbus", "--hang", "L.DARK"],
            "'L.DARK' is done as it is sent",
        ),
        (["sim", "catalogue:one_robot", "--modbus", "--hang", "R.MOVE#0"], "'R.MOVE#0' never comes"),
        (["sim", "catalogue:philosophers-3", "--modbus"], "name the plant file of the cell with --plant"),
        (
            ["sim", "catalogue:one_robot", "--mqtt", "--press", "1"],
            "--press: the binding has no contact of an emergency",
        ),
        (["sim", "catalogue:one_robot", "--modbus", "--bind", "-"], "the binding cannot go to standard output"),
    ],
)
def test_mistakes_of_who_serves_a_cell_are_told(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert list(tmp_path.iterdir()) == []
    assert message in capsys.readouterr().err


def test_plant_file_beside_the_net_is_the_one_that_is_served(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    net = catalogue_path("one_robot").read_text("utf-8").replace("cell: one-robot", "cell: turning", 1)
    Path("turning.firable.yaml").write_text(net, "utf-8")
    command = ["sim", "turning.firable.yaml", "--modbus", "--for", "0"]
    assert main(command) == 2
    assert "there is no turning.plant.yaml, and none in the catalogue is 'turning'" in capsys.readouterr().err
    plant = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    Path("turning.plant.yaml").write_text(plant, "utf-8")
    assert main(command) == 2
    assert "this plant file is for the cell 'one-robot'" in capsys.readouterr().err
    Path("turning.plant.yaml").write_text(plant.replace("plant: one-robot", "plant: turning", 1), "utf-8")
    assert main(command) == 0


def test_no_protocol_is_left_without_a_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    net = "firable: 1\ncell: lamp\nstart: dark\nplaces:\n  dark:\n"
    net += "  bright: {send: {machine: L, command: SHINE}}\ntransitions:\n  shine: {from: dark, to: bright}\n"
    plant = "firable_plant: 1\nplant: lamp\nstations: [table]\narrivals: {station: table, every_s: 9}\n"
    plant += "departures: {station: table}\nmachines:\n  L: {commands: {SHINE: {does: work, takes_s: 1}}}\n"
    Path("lamp.firable.yaml").write_text(net, "utf-8")
    Path("lamp.plant.yaml").write_text(plant, "utf-8")
    assert main(["sim", "lamp.firable.yaml", "--modbus", "--opcua", "--for", "0"]) == 2
    assert "the net commands 1 machine, of which each is served by one protocol" in capsys.readouterr().err
    assert main(["sim", "lamp.firable.yaml", "--modbus", "--for", "0"]) == 0


def test_what_was_to_go_wrong_and_has_not_is_told_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["--drop", "R.MOVE#7", "--hang", "CV1.RUN", "--stuck", "robot.touch=1@50", "--stuck", "mc.part_present=1"]
    command = ["sim", "catalogue:one_robot", "--serial", "--bind", str(tmp_path / "c.bind.yaml"), *asked]
    assert main([*command, "--press", "60", "--for", "0.2"]) == 0
    said = capsys.readouterr().out
    assert "as asked for: mc.part_present is stuck at 1" in said
    assert said.splitlines()[-4:] == [
        "'robot.touch' was to be stuck at 50 s, and the cell has ended before",
        "'R.MOVE#7' has not come: it was never given",
        "'CV1.RUN#1' has not come: it was never given",
        "the emergency stop was to be pressed at 60 s, and the cell has ended before",
    ]


def test_binding_that_another_cell_serves_stays_as_it_is_where_no_port_is_free(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bind = tmp_path / "c.bind.yaml"
    before = binding_text(NET, {"opcua": "14999"}, SENSORS)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setitem(PORTS, "modbus", str(taken.getsockname()[1]))
        command = ["sim", "catalogue:one_robot", "--modbus", "--bind", str(bind)]
        assert main(command) == 2
        assert not bind.exists()
        bind.write_text(before)
        assert main(command) == 2
    assert bind.read_text() == before
    said = capsys.readouterr()
    assert "error[F5104]: the cell cannot be served: modbus: " in said.err
    assert "modbus at" not in said.out


@pytest.mark.parametrize(
    "path", sorted(catalogue_path("one_robot").parent.glob("*.plant.yaml")), ids=lambda path: path.stem
)
def test_a_binding_that_is_made_fits_its_net_whatever_that_has(path: Path) -> None:
    net = catalogue_net(path.name.removesuffix(".plant.yaml"))
    assert (
        misfits(parse_binding(binding_text(net, PORTS | {"serial": "/dev/ttyS0"}, read_plant(path).sensors)), net) == ()
    )


def beyond(text: str, keys: str) -> str:
    """A binding of `binding_text` with other keys of its one device."""
    head, _, rest = text.partition("    driver: ")
    _, _, rest = rest.partition("    heartbeat:")
    return f"{head}{keys}    heartbeat:{rest}"


@pytest.mark.parametrize(
    ("protocol", "keys", "why"),
    [
        ("modbus", "    driver: modbus-tcp\n    host: 10.0.0.1\n", "'modbus' is at 10.0.0.1, and a cell is served at"),
        (
            "mqtt",
            "    driver: mqtt\n    host: localhost\n    tls: true\n",
            "'mqtt' has `tls`, and a simulated cell neither",
        ),
        ("opcua", "    driver: opcua\n    url: opc.tcp://plc:4840/\n", "'opcua' is at plc, and a cell is served at"),
        (
            "serial",
            "    driver: serial\n    port: {file}\n",
            "serial: {file} cannot be made to lead to a line: File exists",
        ),
        (
            "modbus",
            "    driver: modbus-rtu\n    parity: N\n    port: {file}/x\n",
            "modbus: {file}/x cannot be made to lead to a line: ",
        ),
        (
            "modbus",
            "    driver: modbus-rtu\n    port: ./line\n",
            "'modbus' has the parity E, and a pseudo-terminal has none",
        ),
        ("serial", "    driver: simulated\n", "`driver: simulated` leads to nothing that can be served on this host"),
        (
            "serial",
            "    driver: simulated\n",
            "hint: the cell that is served has all machines of the net: give these a",
        ),
    ],
)
def test_device_that_nobody_would_reach_here_is_refused(
    protocol: str, keys: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind = tmp_path / "c.bind.yaml"
    bind.write_text(
        beyond(binding_text(NET, {protocol: "15020"}, SENSORS), keys.format(file=bind)).replace("15020", "./x")
    )
    before = bind.read_text()
    assert main(["sim", "catalogue:one_robot", "--bind", str(bind)]) == 2
    said = capsys.readouterr().err
    assert "error[F5104]" in said
    assert why.format(file=bind) in said
    assert bind.read_text() == before


def test_port_that_is_taken_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bind = tmp_path / "c.bind.yaml"
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        bind.write_text(binding_text(NET, {"modbus": str(port)}, SENSORS))
        assert main(["sim", "catalogue:one_robot", "--bind", str(bind)]) == 2
    said = capsys.readouterr().err
    assert f"error[F5104]: the cell cannot be served: modbus: cannot listen at 127.0.0.1:{port}" in said


@pytest.mark.parametrize(
    ("was", "is_now", "why"),
    [
        ("driver: modbus-tcp", "driver: mqtt", "and another protocol is spoken"),
        ("host: 127.0.0.1", "host: 127.0.0.2", "and another host is named"),
    ],
)
def test_devices_at_one_port_that_no_server_can_be_are_refused(
    was: str, is_now: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind = tmp_path / "c.bind.yaml"
    first, _, second = halved(binding_text(NET, {"modbus": "15020"}, SENSORS)).rpartition(was)
    bind.write_text(f"{first}{is_now}{second}")
    assert main(["sim", "catalogue:one_robot", "--bind", str(bind)]) == 2
    assert f"error[F5104]: 'second' is at port 15020, where 'modbus' is served, {why}" in capsys.readouterr().err


def test_a_binding_that_is_not_of_the_simulation_is_not_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bind = tmp_path / "site.bind.yaml"
    command = ["sim", "catalogue:one_robot", "--serial", "--bind", str(bind), "--for", "0"]
    bind.write_text("firable_bind: 1\ndescription: the real cell\n")
    assert main(command) == 2
    assert "error[F1017]" in capsys.readouterr().err
    assert "the real cell" in bind.read_text()
    bind.unlink()
    assert main(command) == 0
    assert main(command) == 0  # what it wrote itself it may write again
    edited = bind.read_text().replace("read: ", "force: true, read: ")
    assert edited != bind.read_text()
    for text in (edited, f"{bind.read_text()}\n", f"# mine\n{bind.read_text()}"):
        bind.write_text(text)
        capsys.readouterr()
        assert main(command) == 2
        assert "a file stands there that firable sim has not written, or was edited since" in capsys.readouterr().err
        assert bind.read_text() == text
    capsys.readouterr()
