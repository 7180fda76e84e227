"""`expect:` in a net file: a verdict that is known to end so, of which any change fails."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from junitparser import Failure, JUnitXml

from firable.cli.main import main
from firable.nets.catalogue import catalogue_path
from firable.nets.interchange import net_digest, net_from_json, net_to_json
from firable.nets.printing import format_net
from firable.nets.text import parse_net
from firable.nets.verdict import Expectation, Status, Verdict, Weight, held_to, overall

LATE = catalogue_path("one_robot_mc_late").read_text("utf-8")
KNOWN = ("deadlock-free", "property.no_deadlock", "property.restart")


def written(folder: Path, **expected: str) -> str:
    """A net file of the cell that deadlocks, with what it expects; `_` stands for what a keyword cannot hold."""
    lines = "".join(f"  {name}: {end}\n" for name, end in expected.items())
    path = folder / "cell.firable.yaml"
    path.write_text(f"{LATE}\nexpect:\n{lines}", "utf-8")
    return str(path)


def checked(capsys: pytest.CaptureFixture[str], path: str, *options: str) -> tuple[int, str]:
    capsys.readouterr()
    code = main(["check", path, "--no-cache", *options])
    return code, capsys.readouterr().out


def test_what_is_known_to_be_violated_passes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, told = checked(capsys, written(tmp_path, **dict.fromkeys(KNOWN, "violated")))
    assert code == 0
    assert "= expected  deadlock-free" in told
    assert "all as expected: 6 proved, 3 as expected, 3 warnings" in told
    assert " 15. t1-b" not in told


def test_one_violation_that_no_line_expects_still_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, told = checked(capsys, written(tmp_path, **dict.fromkeys(KNOWN[:2], "violated")))
    assert code == 1
    assert "violated: 1 violated, 6 proved, 2 as expected" in told


def test_a_verdict_that_has_become_proved_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = {**dict.fromkeys(KNOWN, "violated"), "contact-free": "violated"}
    code, told = checked(capsys, written(tmp_path, **known))
    assert code == 1
    assert "✗ changed   contact-free" in told
    told = " ".join(told.split())
    assert "hint: [F3024] the file expects violated, and it is proved; where that is right, write" in told
    assert "write `contact-free: proved` under `expect`, or take its line out" in told


def test_what_is_only_told_may_be_held_to_its_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = {**dict.fromkeys(KNOWN, "violated"), "home-markings": "proved", "live": "proved"}
    code, told = checked(capsys, written(tmp_path, **known))
    assert code == 1
    assert "1 changed, 4 as expected" in told
    assert "hint: [F3024] the file expects proved, and it is violated; where that is right, write `live: vio" in told
    assert "hint: [F3014] right for what happens only at start-up" in told
    assert "G1 can never fire after this" in told, "what fails has its run, whatever it would weigh by itself"


def test_json_tells_the_code_and_the_hints_that_the_text_shows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = {**dict.fromkeys(KNOWN[:2], "violated"), "reversible": "proved", "contact-free": "violated"}
    path = written(tmp_path, **known)
    told = checked(capsys, path)[1]
    (report,) = json.loads(checked(capsys, path, "--format", "json")[1])["reports"]
    verdicts = {verdict["name"]: verdict for verdict in report["verdicts"]}
    codes = {name: verdicts[name].get("code") for name in (*known, "property.restart", "structural-conflicts", "live")}
    assert codes == {
        "deadlock-free": "F3011",
        "property.no_deadlock": "F3022",
        "reversible": "F3024",
        "contact-free": "F3024",
        "property.restart": "F3022",
        "structural-conflicts": "F3017",
        "live": "F3014",
    }
    shown = re.findall(r"hint: \[F\d+\] (.*)", told)
    assert len(shown) >= 8
    hints = "; ".join(verdict.get("hint", "") for verdict in verdicts.values())
    assert all(hint in hints for hint in shown)
    assert all(
        verdict.get("hint")
        for verdict in verdicts.values()
        if verdict["status"] != "proved" and not known.get(verdict["name"])
    )


def test_unknown_never_passes_as_expected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, **dict.fromkeys(KNOWN, "violated"))
    code, _ = checked(capsys, path, "--method", "explicit", "--max-markings", "3")
    assert code == 3


def test_an_unknown_verdict_is_refused_at_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, **{"deadlock-fre": "violated"})
    assert main(["check", path]) == 2
    error = capsys.readouterr().err
    line = LATE.count("\n") + 3
    assert f"cell.firable.yaml:{line}:3: error[F2030]: `expect` names the verdict 'deadlock-fre'" in error
    assert "did you mean 'deadlock-free'?" in error


def test_verdicts_with_machines_and_without_wait_for_each_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    path = tmp_path / "cell.firable.yaml"
    path.write_text(f"{text}\nexpect:\n  loop.live: violated\n  deadlock-free: proved\n", "utf-8")
    assert checked(capsys, str(path))[0] == 0
    code, told = checked(capsys, str(path), "--machines", "catalogue:one_robot")
    assert code == 1
    assert "✗ changed   loop.live" in told


def test_json_and_junit_say_what_was_expected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, **{**dict.fromkeys(KNOWN, "violated"), "contact-free": "violated"})
    data: dict[str, Any] = json.loads(checked(capsys, path, "--format", "json")[1])
    main(["schema", "report"])
    jsonschema.Draft202012Validator(json.loads(capsys.readouterr().out)).validate(data)
    verdicts = {verdict["name"]: verdict for verdict in data["reports"][0]["verdicts"]}
    assert verdicts["deadlock-free"]["expected"] == verdicts["deadlock-free"]["status"] == "violated"
    assert "expected" not in verdicts["quasi-live"]
    (suite,) = JUnitXml.fromstring(checked(capsys, path, "--format", "junit")[1].encode())
    failed = {case.name: case.result[0].type for case in suite if any(isinstance(one, Failure) for one in case.result)}
    assert failed == {"contact-free": "F3024"}


def test_expectations_are_kept_by_print_and_json_and_void_no_proof() -> None:
    plain = parse_net(LATE)
    net = parse_net(f"{LATE}\nexpect:\n  deadlock-free: violated\n")
    assert net.expected == (Expectation("deadlock-free", Status.VIOLATED),)
    assert parse_net(format_net(net)).expected == net.expected
    assert net_from_json(net_to_json(net)).expected == net.expected
    assert net_digest(net) == net_digest(plain)
    assert "expected" not in net_to_json(plain)


def test_no_bundle_is_made_of_what_is_known_to_be_violated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, **dict.fromkeys(KNOWN, "violated"))
    assert main(["bundle", path, "-o", str(tmp_path / "cell.bundle")]) == 1
    assert not (tmp_path / "cell.bundle").exists()
    capsys.readouterr()


def test_no_verdict_is_lost_where_two_have_one_name() -> None:
    one = Verdict("fault.safe", Status.VIOLATED, "no accident", "by hand")
    other = Verdict("fault.safe", Status.VIOLATED, "it goes on", "by hand", Weight.INFORMATION)
    assert held_to((), (one, other)) == (one, other)
    assert overall(held_to((), (one, other))) is Status.VIOLATED


UNDECIDED = """\
firable: 1
cell: two
inputs: s
places: {p: , q: }
start: p
transitions:
  t: {from: p, to: q, if: s}
  u: {from: p, to: q, unless: s}
  v: {from: q, to: p}
"""


def test_a_warning_that_is_not_decided_passes_and_is_counted_and_fails_where_the_file_expects_an_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.firable.yaml").write_text(UNDECIDED)
    assert main(["check", str(tmp_path / "two.firable.yaml")]) == 0
    assert ", 1 warning (1 unknown)\n" in capsys.readouterr().out
    (tmp_path / "two.firable.yaml").write_text(UNDECIDED + "expect: {starvation: proved}\n")
    assert main(["check", str(tmp_path / "two.firable.yaml")]) == 3
    assert "not decided: " in capsys.readouterr().out
