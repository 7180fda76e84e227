"""`firable split`: what it tells of a split, as text and as JSON."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from textwrap import indent
from typing import Any

import jsonschema
import pytest
from support.published import COORDINATOR_TABLE
from support.reference import load_net

from firable.cli.main import main
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.printing import format_net
from firable.nets.text import read_net

SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))


def as_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, Any]:
    """The exit code and the JSON of the command, which has to fit the published schema."""
    capsys.readouterr()
    code = main(["split", *arguments, "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    return code, data


def written(folder: Path, name: str) -> str:
    """A net of the reference as a file."""
    path = folder / f"{name}.firable.yaml"
    path.write_text(format_net(load_net(name)), encoding="utf-8")
    return str(path)


def test_split_of_the_cell_tells_the_published_table_and_the_two_votes_that_do_not_stand(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["split", "catalogue:one_robot"]) == 0
    told = capsys.readouterr().out
    assert indent(COORDINATOR_TABLE, "  ") in told
    assert "22 of 24 are persistent" in told
    assert "· t1-41: taken back by G2, as after G1, G2" in told
    assert "conflict-1: G2, G6; decided by system by the order of the file" in told
    assert "because of a gate" not in told


def test_split_tells_which_transition_only_a_gate_makes_global(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["split", written(tmp_path, "remote_gate")]) == 0
    told = capsys.readouterr().out
    assert "l: would be local but for c2.y" in told
    assert "locks for others c2.y (l)" in told


def test_split_tells_which_local_transition_a_conflict_takes_to_the_coordinator(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["split", written(tmp_path, "local_conflict")]) == 0
    assert "l: local, in conflict with G at c1." in capsys.readouterr().out


def test_json_of_a_split_holds_what_each_controller_must_know(capsys: pytest.CaptureFixture[str]) -> None:
    code, data = as_json(capsys, "catalogue:one_robot")
    (report,) = data["reports"]
    assert (code, report["status"]) == (0, "proved")
    mc = next(one for one in report["split"]["controllers"] if one["controller"] == "mc")
    assert (mc["fires"], mc["promises"], mc["talks_to"]) == (["t2-a", "t2-b"], ["t2-82"], ["system"])
    assert [group["rest"] for group in report["split"]["groups"]] == [["G2", "G6"], ["G5", "G8"]]
    assert sum(verdict["status"] == "violated" for verdict in report["verdicts"]) == 2


def test_subnets_are_written_as_net_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["split", "catalogue:one_robot", "--subnets", str(tmp_path / "subnets")]) == 0
    assert f"written: {tmp_path / 'subnets' / 'robot.firable.yaml'}" in capsys.readouterr().out
    assert read_net(tmp_path / "subnets" / "robot.firable.yaml") == split(catalogue_net("one_robot")).subnet("robot")


def test_net_without_owners_is_refused_with_a_hint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bare.firable.yaml"
    path.write_text("firable: 1\ncell: bare\nplaces: {p: , q: }\nstart: p\ntransitions: {t: {from: p, to: q}}\n")
    assert main(["split", str(path)]) == 2
    told = capsys.readouterr().err
    assert "F2011" in told
    assert "`firable split NET --own CONTROLLER='PATTERN' -o FILE`" in told


def test_large_split_is_told_in_part(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["split", "catalogue:manufacturing_cells-60", "--max-seconds", "0"]) == 0
    told = capsys.readouterr().out
    assert "and 60 more; --format json has them all" in told
    assert "s1_load may take it back" in told


def test_proposed_owners_are_told_with_their_reasons_and_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "owned.firable.yaml"
    assert main(["split", "catalogue:one_robot", "--suggest", "4", "-o", str(path)]) == 0
    told = capsys.readouterr().out
    assert "no ownership within these sizes has fewer global ones" in told
    assert "proposed        7 global,   16 votes" in told
    assert "in the file     9 global,   24 votes" in told
    assert "G3 joins cv1, r" in told
    assert "-o FILE writes" not in told
    assert main(["prove", str(path)]) == 0
    assert main(["split", "catalogue:one_robot", "--suggest", "2"]) == 0
    assert "-o FILE writes the net with these owners" in capsys.readouterr().out


def test_json_of_a_proposal_fits_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    _, data = as_json(capsys, "catalogue:one_robot", "--suggest", "2")
    suggestion = data["reports"][0]["split"]["suggestion"]
    assert (suggestion["proposed"]["cut"], suggestion["given"]["cut"], suggestion["fewest"]) == (3, 9, 1)


def test_rules_give_a_net_of_pnml_its_owners(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pnml, rules = tmp_path / "cell.pnml", tmp_path / "owners.yaml"
    assert main(["convert", "catalogue:philosophers-3", "-o", str(pnml)]) == 0
    rules.write_text('table: "*.fork"\n', encoding="utf-8")
    people = "people=*.thinking,*.left,*.eating"
    capsys.readouterr()
    assert main(["split", str(pnml), "--rules", str(rules), "--own", people]) == 0
    assert "p1_takes_left:" in capsys.readouterr().out
    assert main(["split", str(pnml), "--rules", str(rules)]) == 2
    assert "no rule gives 'p1.thinking' an owner" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--own", "a=*", "--suggest", "2"], "leave one out"),
        (["-o", "x.yaml"], "give them by --own or --rules"),
        (["--suggest", "0"], "Invalid value"),
        (["--slack", "0.1"], "--slack is of owners that are proposed: add --suggest N"),
    ],
)
def test_a_wrong_command_line_says_what_is_wrong(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["split", "catalogue:one_robot", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_a_place_of_two_rules_is_refused_where_it_stands(capsys: pytest.CaptureFixture[str]) -> None:
    own = ["--own", "a=system*,robot*,conveyor*", "--own", "b=mc*,robot.free"]
    assert main(["split", "catalogue:one_robot", *own]) == 2
    said = capsys.readouterr().err
    assert "catalogue:one_robot:21:7: error[F2023]: 'robot.free' is given to each of a, b" in said


def test_split_says_what_a_vote_without_promise_is_and_ends_no_line_in_spaces(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["split", "catalogue:one_robot"]) == 0
    assert "need no promise, which locks places from the yes to the order" in capsys.readouterr().out
    assert main(["split", "catalogue:two_cells"]) == 0
    told = capsys.readouterr().out
    assert not [line for line in told.splitlines() if line != line.rstrip()]


def test_a_pattern_that_matches_nothing_is_told_without_what_follows_from_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["split", "catalogue:one_robot", "--own", "a=zz*"]) == 2
    said = capsys.readouterr().err
    assert "F2002" in said
    assert "F2011" not in said


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ("1", "at least        0 global, for one controller owns all; at most"),
        ("2", "at least        0 global, for the net is in as many pieces as controllers, or more; at most"),
        ("5", "at least        1 global, as the net hangs together; at most"),
    ],
)
def test_what_bounds_a_proposal_is_said_of_a_net_that_hangs_together_only(
    capsys: pytest.CaptureFixture[str], parts: str, said: str
) -> None:
    assert main(["split", "catalogue:machines-4", "--suggest", parts]) == 0
    assert said in capsys.readouterr().out
