"""`check --structure` ends when its time is over or at Ctrl-C, says so, and keeps the verdicts."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any
from unittest.mock import ANY

import jsonschema
import pytest

from firable.analysis.deadline import Deadline
from firable.analysis.structure.invariants import Invariants
from firable.cli.main import main
from firable.cli.structure import structure_json
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net

SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))


def report_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    main(["check", "catalogue:one_robot", "--structure", *arguments, "--format", "json"])
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    return data["reports"][0]


def test_no_time_gives_incomplete_lists_and_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    structure = report_of(capsys, "--max-seconds", "0")["figures"]["structure"]
    assert structure["ended_early"] == "time"
    assert not any(structure[name]["complete"] for name in ("p_invariants", "t_invariants", "siphons", "traps"))
    assert not structure["siphons_exclude_deadlock"]
    main(["check", "catalogue:one_robot", "--structure", "--max-seconds", "0"])
    told = capsys.readouterr().out.partition("\nstructure\n")[2]
    assert "incomplete    the time for the structure is over" in told
    assert "P-invariants  0 minimal so far\n" in told  # and nothing on the places in none
    assert "siphons       0 minimal so far\n" in told  # and not that each of them contains a marked trap


def test_ctrl_c_in_a_list_ends_all_of_them_and_keeps_the_verdicts(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = report_of(capsys)

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("firable.analysis.structure.commoner.deadlock_trap", interrupted)
    part = report_of(capsys)
    assert part["verdicts"] == whole["verdicts"]
    structure = part["figures"]["structure"]
    assert structure["ended_early"] == "interrupted"
    assert structure["p_invariants"] == whole["figures"]["structure"]["p_invariants"]
    assert (structure["siphons"], structure["traps"]) == ({"minimal": [], "complete": False},) * 2
    main(["check", "catalogue:one_robot", "--structure"])
    assert "incomplete    interrupted: " in capsys.readouterr().out


def test_the_graph_of_arcs_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    structure = report_of(capsys)["figures"]["structure"]
    assert structure["ended_early"] == ""
    assert (structure["pure"], structure["connected"], structure["strongly_connected"]) == (True, True, True)
    main(["check", "catalogue:one_robot", "--structure"])
    assert "graph         strongly connected\n" in capsys.readouterr().out


def test_contact_freeness_that_exploration_left_open_is_proved_by_invariants(
    capsys: pytest.CaptureFixture[str],
) -> None:
    part = report_of(capsys, "--max-markings", "3", "--method", "explicit")
    assert next(v for v in part["verdicts"] if v["name"] == "contact-free")["status"] == "unknown"
    structure = part["figures"]["structure"]
    assert structure["siphons_exclude_deadlock"]
    assert structure["outside_of_its_theorems"] == ["it has external gates, on which choices depend"]


def test_a_list_that_takes_long_leaves_time_to_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[float] = []

    def gives_up(net: Net, *, deadline: Deadline) -> Invariants:
        given.append(deadline.left_seconds or 0.0)
        return Invariants((), None, complete=False)

    monkeypatch.setattr("firable.analysis.structure.invariants.p_invariants", gives_up)
    monkeypatch.setattr("firable.analysis.structure.invariants.t_invariants", gives_up)
    found = structure_json(catalogue_net("one_robot"), contact_free=True, seconds=1e6)
    assert 2.0e5 < given[0] <= 2.5e5 < given[1] <= 3.4e5  # a quarter, and a third of what was hardly used
    assert found["p_invariants"] == {
        "basis": ANY,
        "minimal": [],
        "dimension": None,
        "complete": False,
        "uncovered": ANY,
    }
    assert found["siphons"]["complete"]
    assert found["ended_early"] == ""


def test_where_the_minimal_invariants_are_too_many_a_basis_stands_in_for_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def gives_up(net: Net, *, deadline: Deadline) -> Invariants:
        return Invariants((), None, complete=False)

    net = catalogue_net("one_robot")
    monkeypatch.setattr("firable.analysis.structure.invariants.p_invariants", gives_up)
    found = report_of(capsys)["figures"]["structure"]["p_invariants"]
    assert len(found["basis"]) == 14
    changes = [
        sum(weights.get(name, 0) for name in transition.outputs)
        - sum(weights.get(name, 0) for name in transition.inputs)
        for weights in found["basis"]
        for transition in net.transitions
    ]
    assert not any(changes)
    main(["check", "catalogue:one_robot", "--structure"])
    told = capsys.readouterr().out
    assert "P-invariants  0 minimal so far\n                a basis of all is known: 14 in integers, as " in told
    assert told.count("a basis of all") == 1  # the T-invariants are all listed


def test_a_basis_that_takes_long_leaves_half_of_the_time_to_the_minimal_invariants(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[float] = []

    def gives_up(net: Net, *, deadline: Deadline) -> None:
        given.append(deadline.left_seconds or 0.0)

    monkeypatch.setattr("firable.analysis.structure.invariants.p_basis", gives_up)
    found = structure_json(catalogue_net("one_robot"), contact_free=True, seconds=1e6)
    assert 1.0e5 < given[0] <= 1.25e5
    assert (found["p_invariants"]["basis"], len(found["p_invariants"]["minimal"])) == (None, 68)
