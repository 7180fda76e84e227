"""What stops machines, and is left out of a binding, is told once, unless the binding says that there is none."""

import json
from pathlib import Path

import pytest
from support.small_binding import GOOD, NET_TEXT

from firable.cli.main import main
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.unguarded import unguarded
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import Severity

SAFE = "    safe: {coil 1: false}\n"
BEAT = "    heartbeat: {write: holding 0, every_s: 0.2, tripped: discrete 9}\n"
STOP = "emergency_stop: {door: {device: plc, read: discrete 3}}\n"
GUARDED = GOOD.replace("signals:\n", f"{STOP}signals:\n")
OTHER = "  lamp: {driver: modbus-tcp, host: 10.0.0.2}\n"


def told(text: str) -> list[str]:
    """What is told of a binding, without the reasons."""
    found = list(unguarded(parse_binding(text, "c.bind.yaml")))
    assert all(one.code == "F5107" and one.severity is Severity.WARNING and one.span and one.hint for one in found)
    return [one.message.partition(":")[0] for one in found]


def test_of_a_binding_with_all_that_stops_machines_nothing_is_told() -> None:
    assert told(GUARDED) == []
    assert told(catalogue_path("one_robot").with_name("one_robot.bind.yaml").read_text("utf-8")) == []


@pytest.mark.parametrize(
    ("missing", "none", "said"),
    [
        (SAFE, "    safe: {}\n", "'plc' has no `safe` outputs"),
        (BEAT, "    heartbeat: {}\n", "'plc' has no `heartbeat`"),
        (STOP, "emergency_stop: {}\n", "no contact of an emergency stop is read"),
    ],
)
def test_what_is_left_out_is_told_unless_it_is_said_to_be_none(missing: str, none: str, said: str) -> None:
    assert told(GUARDED.replace(missing, "")) == [said]
    assert told(GUARDED.replace(missing, none)) == []


def test_devices_that_lack_the_same_are_told_of_together() -> None:
    channel = "    channels: {N: {number: holding 5}}\n"
    other = f"  far:\n    driver: modbus-tcp\n    host: 10.0.0.2\n{channel}"
    text = GUARDED.replace(SAFE, "").replace(STOP, f"{other}{STOP}")
    text = text.replace("M.stop: {device: plc, channel: M", "M.stop: {device: far, channel: N")
    assert told(text) == ["'plc', 'far' have no `safe` outputs", "'far' has no `heartbeat`"]


def test_a_device_that_nothing_commands_needs_nothing() -> None:
    assert told(GUARDED.replace(STOP, f"{OTHER}{STOP}")) == []


def test_a_simulated_device_needs_nothing() -> None:
    simulated = """firable_bind: 1
cell: c
devices:
  toy: {driver: simulated, channels: {M: {command: M, taken: M.taken, done: M.done}}}
signals: {M.there: {device: toy, read: there}, M.moved: acknowledged}
commands: {M.move: {device: toy, channel: M}, M.stop: {device: toy, channel: M}}
"""
    assert told(simulated) == []


def test_the_check_of_a_binding_tells_it_in_its_report_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net, bind = tmp_path / "c.firable.yaml", tmp_path / "c.bind.yaml"
    net.write_text(NET_TEXT)
    bind.write_text(GUARDED.replace(SAFE, ""))
    main(["check", str(net), "--bind", str(bind), "--format", "json"])
    (note,) = json.loads(capsys.readouterr().out)["reports"][0]["notes"]
    assert (note["code"], note["severity"], note["line"]) == ("F5107", "warning", 4)
    main(["check", str(net), "--bind", str(bind)])
    assert capsys.readouterr().err.count("warning[F5107]") == 1


def test_a_run_tells_it_before_it_begins_and_in_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net, bind, bundle = tmp_path / "c.firable.yaml", tmp_path / "c.bind.yaml", tmp_path / "c.bundle"
    net.write_text(NET_TEXT)
    nowhere = "host: 127.0.0.1\n    port: 1\n    start_s: 0.1"
    bind.write_text(GUARDED.replace(SAFE, "").replace("host: 10.0.0.1", nowhere))
    assert main(["bundle", str(net), "-o", str(bundle)]) == 0
    capsys.readouterr()
    assert main(["run", str(bundle), "--bind", str(bind), "--format", "json"]) != 2
    said = capsys.readouterr()
    (note,) = json.loads(said.out)["reports"][0]["notes"]
    assert note["code"] == "F5107"
    assert said.err.startswith(f"{bind}:4:3: warning[F5107]: 'plc' has no `safe` outputs")
    assert said.err.count("F5107") == 1


def test_a_binding_that_does_not_fit_is_refused_before_anything_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, bind = tmp_path / "c.firable.yaml", tmp_path / "c.bind.yaml"
    net.write_text(NET_TEXT)
    bind.write_text(GUARDED.replace(SAFE, "").replace("  M.moved: acknowledged\n", ""))
    assert main(["check", str(net), "--bind", str(bind)]) == 2
    told_of = capsys.readouterr().err
    assert "error[F5101]" in told_of
    assert "F5107" not in told_of
