"""`firable prove --protocol`, `--faults` and `--wrong`."""

import json
from pathlib import Path

import pytest

from firable.cli.main import main

NET = """\
firable: 1
cell: shuttle
controllers:
  robot:
    start: [part]
    places: {part: {}, free: {}}
  lathe:
    start: [empty]
    places: {empty: {}, full: {}}
transitions:
  hand_over: {from: [robot.part, lathe.empty], to: [robot.free, lathe.full]}
  fetch: {from: robot.free, to: robot.part}
  unload: {from: lathe.full, to: lathe.empty}
"""


@pytest.fixture
def net(tmp_path: Path) -> str:
    path = tmp_path / "shuttle.firable.yaml"
    path.write_text(NET)
    return str(path)


def test_protocol_is_explored_on_demand(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net, "--protocol"]) == 0
    told = capsys.readouterr().out
    assert "the protocol\n" in told
    assert "✓ proved    explored.complete" in told
    assert "3,782 configurations of the protocol" in told


def test_protocol_is_not_explored_unasked(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net]) == 0
    assert "explored.complete" not in capsys.readouterr().out


def test_faults_tell_what_stands_still(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net, "--faults"]) == 0
    told = capsys.readouterr().out
    assert "✓ proved    faults.resumes" in told
    assert "  robot dead\n    stands still at once   fetch\n    stands still at last   hand_over, unload\n" in told


def test_wrong_protocols_are_told_by_their_events_and_fail_nothing(
    capsys: pytest.CaptureFixture[str], net: str
) -> None:
    assert main(["prove", net, "--wrong"]) == 0
    told = capsys.readouterr().out
    assert "  missing-vote: a transition is decided though one vote is missing (Eq. (7))\n" in told
    assert "hand_over is decided without the vote of robot" in told
    assert "  cached-gates: a gate elsewhere is read from a copy, its owner takes no part (O3)\n" in told
    assert "cannot go wrong here" in told


def test_json_holds_the_verdicts_and_the_runs(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net, "--protocol", "--faults", "--wrong", "--format", "json"]) == 0
    report = json.loads(capsys.readouterr().out)["reports"][0]
    verdicts = {verdict["name"]: verdict for verdict in report["verdicts"]}
    assert verdicts["explored.follows"]["status"] == "proved"
    assert verdicts["faults.dead.robot"]["subjects"] == ["fetch", "hand_over", "unload"]
    assert verdicts["wrong.missing-vote"]["weight"] == "information"
    assert verdicts["wrong.missing-vote"]["witness"]["firings"][0] == ["ask/hand_over"]


def test_evidence_is_written_beside_the_obligations_and_verified(
    capsys: pytest.CaptureFixture[str], net: str, tmp_path: Path
) -> None:
    folder = tmp_path / "smt"
    assert main(["prove", net, "--protocol", "--smt-dir", str(folder)]) == 0
    evidence = folder / "protocol.evidence.json"
    assert f"evidence: firable verify {evidence}" in capsys.readouterr().out.replace("\n", "")
    assert main(["verify", str(evidence)]) == 0


def test_page_tells_what_was_found(net: str, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    assert main(["prove", net, "--wrong", "--report", str(page)]) == 0
    assert "wrong.missing-vote" in page.read_text("utf-8")
