"""Reports for other programs: SARIF against its published schema, JUnit read back, annotations of a workflow."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from junitparser import Error, Failure, JUnitXml

from firable.analysis.report import Figures
from firable.cli.main import main
from firable.nets.catalogue import catalogue_path
from firable.nets.text import parse_net
from firable.semantics.player import Player

SCHEMA_CRATE = Path(__file__).parents[1] / "sarif" / "Cargo.toml"
SAFE = (
    "firable: 1\ncell: line\nplaces: {p: , q: }\nstart: p\ntransitions:\n  t: {from: p, to: q}\n  u: {from: q, to: p}\n"
)
STUCK = (
    "firable: 1\ncell: stuck\nplaces: {p: , q: }\nstart: p\ntransitions:\n"
    "  t: {from: p, to: q, description: go: there}\n"
)


@pytest.fixture(scope="module")
def schema() -> Any:
    """The published schema of SARIF 2.1.0, as a crate that cargo fetches carries it."""
    command = [
        "cargo",
        "metadata",
        "--locked",
        "--quiet",
        "--format-version",
        "1",
        "--manifest-path",
        str(SCHEMA_CRATE),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        pytest.skip(f"cargo cannot fetch the schema of SARIF: {done.stderr.strip()}")
    packages = {package["name"]: package for package in json.loads(done.stdout)["packages"]}
    return json.loads((Path(packages["serde-sarif"]["manifest_path"]).parent / "src/schema.json").read_text("utf-8"))


def printed(capsys: pytest.CaptureFixture[str], *arguments: str, code: int) -> str:
    assert main(["check", "--no-cache", *arguments]) == code
    return capsys.readouterr().out


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with nets: one that deadlocks, one in which all holds, one that is no net."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nets").mkdir()
    (tmp_path / "nets/late.firable.yaml").write_text(catalogue_path("one_robot_mc_late").read_text("utf-8"), "utf-8")
    (tmp_path / "safe.firable.yaml").write_text(SAFE, "utf-8")
    (tmp_path / "bad net.firable.yaml").write_text("firable: 1\ncell: bad\nplces: {}\n", "utf-8")
    return tmp_path


def results(log: str) -> list[Any]:
    return list(json.loads(log)["runs"][0]["results"])


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["nets/late.firable.yaml"], 1),
        (["safe.firable.yaml"], 0),
        (["bad net.firable.yaml", "nets/late.firable.yaml"], 2),
        (["catalogue:one_robot", "--machines", "catalogue:one_robot"], 0),
        (["nets/late.firable.yaml", "--max-markings", "3", "--method", "explicit"], 3),
    ],
)
def test_sarif_is_what_its_schema_says(
    here: Path, schema: Any, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int
) -> None:
    log = json.loads(printed(capsys, "--format", "sarif", *arguments, code=code))
    jsonschema.Draft7Validator(schema).validate(log)
    assert log["runs"][0]["invocations"][0]["exitCode"] == code
    assert bool(log["runs"][0]["results"]) is (code != 0)


def test_the_name_of_a_file_may_hold_bytes_that_are_no_text(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    late, bad = "late\udcff.firable.yaml", "bad\udcff.firable.yaml"
    (here / "nets/late.firable.yaml").rename(late)
    Path(bad).write_text("firable: [", "utf-8")
    files = {kind: here / f"report.{kind}" for kind in ("json", "sarif", "junit")}
    printed(capsys, *(word for kind, file in files.items() for word in ("--write", kind, str(file))), late, bad, code=2)
    told = json.loads(files["json"].read_text("utf-8"))
    assert [report["input"] for report in told["reports"]] == [late]
    places = [result["locations"][0]["physicalLocation"] for result in results(files["sarif"].read_text("utf-8"))]
    assert {place["artifactLocation"]["uri"] for place in places} == {"late%FF.firable.yaml", "bad%FF.firable.yaml"}
    names = [case.name for suite in JUnitXml.fromfile(str(files["junit"])) for case in suite]
    assert "bad\N{REPLACEMENT CHARACTER}.firable.yaml:1:11" in names
    printed(capsys, "--report", "page.html", late, code=1)
    assert "late?.firable.yaml" in Path("page.html").read_text("utf-8")


def test_a_name_that_the_encoding_of_the_system_lacks_has_the_same_fingerprint(here: Path) -> None:
    Path("c.firable.yaml").write_text(
        "firable: 1\ncell: türen\nplaces: {a: , b: }\nstart: a\ntransitions: {t: {from: a, to: b}}\n", "utf-8"
    )
    told = []
    for utf8 in "10":
        env = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": utf8, "PYTHONCOERCECLOCALE": "0"}
        command = [sys.executable, "-m", "firable.cli", "check", "c.firable.yaml", "--write", "sarif", f"{utf8}.sarif"]
        subprocess.run(command, capture_output=True, env=env, check=False)
        told.append([one["partialFingerprints"] for one in results((here / f"{utf8}.sarif").read_text("utf-8"))])
    assert told[0] == told[1] != []


def test_the_schema_refuses_what_is_no_sarif(schema: Any) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft7Validator(schema).validate({"version": "2.1.0", "runs": [{"results": []}]})


def test_a_code_flow_is_the_firing_sequence_with_its_markings(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = results(printed(capsys, "--format", "sarif", "nets/late.firable.yaml", code=1))
    deadlock = next(result for result in found if result["properties"]["verdict"] == "deadlock-free")
    net = parse_net((here / "nets/late.firable.yaml").read_text("utf-8"))
    player, marking = Player(net), net.initial_marking
    locations = deadlock["codeFlows"][0]["threadFlows"][0]["locations"]
    for step in locations:
        name = step["location"]["logicalLocations"][0]["fullyQualifiedName"].removeprefix(f"{net.name}.")
        marking = player.fire(marking, [net.transition_index[name]])
        assert step["state"]["marking"]["text"] == ", ".join(net.names(marking))
        line = (
            (here / "nets/late.firable.yaml").read_text("utf-8").splitlines()[region(step["location"])["startLine"] - 1]
        )
        assert line.strip().startswith(f"{name}:")
    assert player.firable(marking) == ()
    assert len(locations) == 15


def region(location: Any) -> Any:
    return location["physicalLocation"]["region"]


def test_a_property_points_to_its_line_and_a_file_has_a_relative_escaped_name(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = (str(here / "nets/late.firable.yaml"), "bad net.firable.yaml")
    found = results(printed(capsys, "--format", "sarif", *arguments, code=2))
    files = {result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] for result in found}
    assert files == {"nets/late.firable.yaml", "bad%20net.firable.yaml"}
    restart = next(result for result in found if result.get("properties", {}).get("verdict") == "property.restart")
    lines = (here / "nets/late.firable.yaml").read_text("utf-8").splitlines()
    at = region(restart["locations"][0])
    assert lines[at["startLine"] - 1][at["startColumn"] - 1 : at["endColumn"] - 1] == "restart"


def test_fingerprints_stay_when_lines_move_and_differ_between_verdicts(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = results(printed(capsys, "--format", "sarif", "nets/late.firable.yaml", code=1))
    file = here / "nets/late.firable.yaml"
    file.write_text(file.read_text("utf-8").replace("controllers:", "# moved\n\ncontrollers:", 1), "utf-8")
    after = results(printed(capsys, "--format", "sarif", "nets/late.firable.yaml", code=1))
    prints = [result["partialFingerprints"]["firable/v1"] for result in before]
    assert [result["partialFingerprints"]["firable/v1"] for result in after] == prints
    assert [region(r["locations"][0])["startLine"] for r in after] != [
        region(r["locations"][0])["startLine"] for r in before
    ]
    assert len(set(prints)) == len(prints)


def test_rules_are_codes_and_every_result_names_one(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = json.loads(printed(capsys, "--format", "sarif", "bad net.firable.yaml", "nets/late.firable.yaml", code=2))
    rules = [rule["id"] for rule in log["runs"][0]["tool"]["driver"]["rules"]]
    assert len(set(rules)) == len(rules)
    assert {"F1008", "F3011", "F3012", "F3014", "F3001", "F3022"} == set(rules)
    assert all(rules[result["ruleIndex"]] == result["ruleId"] for result in log["runs"][0]["results"])


def test_junit_has_a_case_for_each_verdict_and_an_error_for_what_is_undecided(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("nets/late.firable.yaml", "bad net.firable.yaml", "safe.firable.yaml")
    document = JUnitXml.fromstring(printed(capsys, "--format", "junit", *arguments, code=2).encode())
    suites = {suite.name: {case.name: case for case in suite} for suite in document}
    assert set(suites) == {"input", "nets/late.firable.yaml", "safe.firable.yaml"}
    late = suites["nets/late.firable.yaml"]
    failed = {name for name, case in late.items() if any(isinstance(one, Failure) for one in case.result)}
    assert failed == {"deadlock-free", "property.no_deadlock", "property.restart"}
    assert "15. t1-b" in late["deadlock-free"].result[0].text
    assert late["deadlock-free"].result[0].type == "F3011"
    assert "F3014" in late["live"].system_out
    assert all(not case.result for case in suites["safe.firable.yaml"].values())
    (refused,) = suites["input"].values()
    assert isinstance(refused.result[0], Error)
    assert "bad net.firable.yaml:3:1" in refused.result[0].text
    small = ("--max-markings", "3", "--method", "explicit")
    document = JUnitXml.fromstring(
        printed(capsys, "--format", "junit", "nets/late.firable.yaml", *small, code=3).encode()
    )
    (suite,) = document
    assert any(isinstance(one, Error) and one.type == "F3004" for case in suite for one in case.result)


def test_annotations_follow_the_text_and_escape_what_commands_may_not_hold(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "a,b.firable.yaml").write_text(STUCK.replace("go: there", '"100 %: gone"'), "utf-8")
    lines = printed(capsys, "--format", "github", "a,b.firable.yaml", "bad net.firable.yaml", code=2).splitlines()
    notes = [line for line in lines if line.startswith("::")]
    assert "violated: 1 violated" in "\n".join(lines[: lines.index(notes[0])])
    refused = "::error file=bad net.firable.yaml,line=3,col=1,endColumn=5,title=F1008 unknown key"
    assert notes[0].startswith(f"{refused}::unknown key 'plces'%0Ahint: did you mean 'places'?")
    deadlock = next(line for line in notes if "F3011" in line)
    where = "file=a%2Cb.firable.yaml,line=2,col=7,endColumn=11"
    assert deadlock.startswith(f"::error {where},title=F3011 deadlock-free violated::")
    assert "100 %25: gone" in deadlock
    assert "%0A    1. t" in deadlock


def test_reports_are_written_to_files_beside_what_is_printed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = ("--write", "sarif", "out.sarif", "--write", "junit", "out.xml", "--write", "json", "out.json")
    text = printed(capsys, "nets/late.firable.yaml", *said, code=1)
    assert "violated: 3 violated" in text
    assert "::error" not in text
    assert (here / "out.sarif").read_text("utf-8") == printed(
        capsys, "nets/late.firable.yaml", "--format", "sarif", code=1
    )
    assert JUnitXml.fromfile(str(here / "out.xml")).failures == 3
    assert json.loads((here / "out.json").read_text("utf-8"))["exit_code"] == 1


def test_a_number_of_markings_of_any_length_is_written_in_json(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    to_json, longest = Figures.to_json, sys.get_int_max_str_digits()
    monkeypatch.setattr(Figures, "to_json", lambda of: to_json(of) | {"markings": 10**5000})
    text = printed(capsys, "safe.firable.yaml", "--format", "json", code=0)
    assert f'"markings": 1{"0" * 5000},' in text
    assert sys.get_int_max_str_digits() == longest


def test_no_report_is_written_over_what_is_read(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "report.json").symlink_to("safe.firable.yaml")
    for file, why in (
        ("safe.firable.yaml", "that is the name of a net file, which --write does not write"),
        ("report.json", "would overwrite what the command reads"),
        (str(here / "nets/../report.json"), "would overwrite what the command reads"),
    ):
        assert main(["check", "safe.firable.yaml", "--write", "json", file]) == 2
        assert why in capsys.readouterr().err
    assert (here / "safe.firable.yaml").read_text("utf-8") == SAFE


def test_a_report_cannot_be_written_beside_the_printed_one_on_standard_output(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", "safe.firable.yaml", "--write", "sarif", "-"]) == 2
    assert "--write is for files" in capsys.readouterr().err
