"""`firable prove --protocol`, `--faults` and `--wrong`."""

import json
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path
from time import sleep

import jsonschema
import pytest
from support.free_parts import freed

from firable.analysis._engine import BudgetExceeded
from firable.cli.main import main
from firable.cli.page.protocol import while_dead
from firable.cli.protocol import Answered, show
from firable.cli.prove import show_obligations
from firable.cli.report import Report
from firable.decompose.protocol import exploring, verdicts
from firable.decompose.protocol.inductive_script import Proof
from firable.decompose.protocol.outages import Outage, sealed_outages
from firable.decompose.splitting.cut import split
from firable.nets import read_net
from firable.nets.verdict import Status, Verdict

SCHEMA = json.loads(resources.files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
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
    assert "1,192 configurations of the protocol" in told
    assert "2 parts without a promise" in told


def test_protocol_is_not_explored_unasked(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net]) == 0
    assert "explored.complete" not in capsys.readouterr().out


@pytest.mark.parametrize("more", [["--protocol"], ["--faults"]])
def test_asking_more_never_lowers_where_an_obligation_stands(
    capsys: pytest.CaptureFixture[str], net: str, more: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def standing(*options: str) -> list[dict[str, str]]:
        main(["prove", net, *options, "--format", "json"])
        (report,) = json.loads(capsys.readouterr().out)["reports"]
        found: list[dict[str, str]] = report["standing"]
        return found

    without = standing()
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    monkeypatch.setattr(exploring, "explore_symbolically", _given_up)
    assert standing(*more) == without


def _given_up(*_: object, **__: object) -> None:
    sleep(0.002)  # longer than the shortest timeout
    raise BudgetExceeded("the time was over")


def test_what_is_not_decided_in_time_is_told_with_the_option_for_more(
    capsys: pytest.CaptureFixture[str], net: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    monkeypatch.setattr(exploring, "explore_symbolically", _given_up)
    monkeypatch.setattr(verdicts, "prove_inductively", lambda *_: Proof("", frozenset({"starts", "divergence"})))
    assert main(["prove", net, "--protocol", "--timeout", "0.001"]) == 3
    told = capsys.readouterr().out
    assert "give each exploration more time (--timeout)" in told
    assert "no decision diagram: the time was over after" in told


def test_what_exploring_leaves_open_is_decided_by_the_invariant(
    capsys: pytest.CaptureFixture[str], net: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    monkeypatch.setattr(exploring, "explore_symbolically", _given_up)
    assert main(["prove", net, "--protocol"]) == 0
    assert "✓ proved    explored.complete" in capsys.readouterr().out


def test_obligations_that_are_unknown_are_no_violations(capsys: pytest.CaptureFixture[str]) -> None:
    verdict = Verdict("eq7.t", Status.PROVED, "", "z3")
    for others, sign in ([Status.PROVED], "✓"), ([Status.UNKNOWN], "?"), ([Status.UNKNOWN, Status.VIOLATED], "✗"):
        show_obligations([verdict, *(replace(verdict, status=status) for status in others)])
        assert capsys.readouterr().out.startswith(f"  {sign} ")


def test_faults_tell_what_stands_still(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net, "--faults"]) == 0
    told = capsys.readouterr().out
    assert "✓ proved    faults.resumes" in told
    assert (
        "  controller robot dead\n    stands still at once     fetch\n    may stand still          hand_over, unload\n"
        in told
    )


def test_who_is_dead_is_told_as_controller_or_as_coordinator(capsys: pytest.CaptureFixture[str], net: str) -> None:
    found = (Outage("line", goes_on=("t",)), Outage("robot"), Outage("", ("t",), coordinator="coordinator line"))
    both = "'line' is a controller and a coordinator: the one fires its parts, the other decides, and either may die"
    show(Answered(outages=found))
    told = capsys.readouterr().out
    assert f"{both} alone\n" in told.replace("\n  alone", " alone")
    assert re.findall("^  (.*) dead$", told, re.MULTILINE) == [
        "controller line",
        "controller robot",
        "coordinator line",
    ]
    page = str(while_dead(Report("prove", net, read_net(Path(net)), (), outages=found)))
    assert f"{both} alone." in page
    assert re.findall("<b>([^<]*)</b>", page) == ["controller line", "controller robot", "coordinator line"]
    show(Answered(outages=found[:2]))
    assert "either may die" not in capsys.readouterr().out


CHUTE = """\
firable: 1
cell: chute
controllers:
  feeder:
    start: [part]
    places: {part: {}, gone: {}}
  chute:
    start: [full]
    places: {full: {}, empty: {}, open: {}}
transitions:
  drop: {from: feeder.part, to: [feeder.gone, chute.full], if: chute.open}
  clear: {from: chute.full, to: chute.empty}
"""
"""The part of `drop` at the chute is free of promise: behind a dead coordinator its gate does not matter any more."""


def test_faults_are_told_of_the_free_parts_that_a_bundle_has(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path, folder = tmp_path / "chute.firable.yaml", tmp_path / "smt"
    path.write_text(CHUTE)
    assert main(["prove", str(path), "--faults", "--smt-dir", str(folder), "--format", "json"]) == 0
    told = {one["name"]: one for one in json.loads(capsys.readouterr().out)["reports"][0]["verdicts"]}
    decomposition = split(read_net(path))
    sealed, files = sealed_outages(freed(decomposition))
    assert [told[one.name].get("subjects", []) for one in sealed] == [list(one.subjects) for one in sealed]
    assert {name: (folder / name).read_text("utf-8") for name in files} == files
    without, _ = sealed_outages(decomposition)
    assert [one.subjects for one in without] != [one.subjects for one in sealed]


def test_wrong_protocols_are_told_by_their_events_and_fail_nothing(
    capsys: pytest.CaptureFixture[str], net: str
) -> None:
    assert main(["prove", net, "--wrong"]) == 0
    told = capsys.readouterr().out
    assert "  missing-vote: a transition is decided though one vote is missing (Eq. (7))\n" in told
    # Two runs are equally short.
    assert re.search("hand_over is decided without the vote of (robot|lathe)\n", told)
    assert "  cached-gates: a gate elsewhere is read from a copy, its owner takes no part (O3)\n" in told
    assert "cannot go wrong here" in told
    assert "on a small example, doors, in its own names (the press closes unless" in told
    assert "guard fires open" in told


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


def test_what_shows_that_votes_stand_is_written_beside_what_rests_on_it(tmp_path: Path) -> None:
    folder = tmp_path / "smt"
    assert main(["prove", "catalogue:one_robot", "--protocol", "--smt-dir", str(folder)]) == 0
    assert main(["verify", str(folder / "persistence.evidence.json")]) == 0


def test_page_tells_what_was_found(net: str, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    assert main(["prove", net, "--wrong", "--report", str(page)]) == 0
    assert "missing-vote" in page.read_text("utf-8")


def test_page_tells_the_table_first_and_folds_what_comes_of_wrong_protocols(net: str, tmp_path: Path) -> None:
    page = page_of(net, tmp_path, "--wrong")
    assert re.findall('<section id="([^"]*)"', page)[0] == "table"
    lives_on = section(page, "lives-on")
    assert lives_on.count("<details>") >= lives_on.count("<summary><span><b>") > 10
    assert "missing-vote</b>: a transition is decided though one vote is missing (Eq. (7)) <span" in lives_on
    assert '>cannot go wrong here</span></span></summary><div class="inside"><p>Wrong all the same, but' in lives_on


def page_of(net: str, tmp_path: Path, *options: str) -> str:
    page = tmp_path / "report.html"
    assert main(["prove", net, *options, "--report", str(page)]) == 0
    return page.read_text("utf-8")


def section(page: str, anchor: str) -> str:
    start = page.index(f'<section id="{anchor}"')
    return page[start : page.index("</section>", start)]


def test_page_tells_what_stands_still(net: str, tmp_path: Path) -> None:
    page = page_of(net, tmp_path, "--faults")
    dead = section(page, "dead")
    assert (
        '<tr><th scope="row"><b>controller robot</b></th><td data-of="stands still at once"><span class="code">fetch<'
        in dead
    )
    assert '<td data-of="may stand still"><span class="code">hand_over, unload<' in dead
    assert '<td data-of="goes on">–</td>' in dead
    others = page.replace(section(page, "fault"), "")
    assert "faults.dead." not in others, "told by the table, not once more among the verdicts"


def test_what_one_fault_does_is_told_with_the_verdicts_behind_it(
    capsys: pytest.CaptureFixture[str], net: str, tmp_path: Path
) -> None:
    assert main(["prove", net, "--faults"]) == 0
    told = capsys.readouterr().out.partition("what one fault does\n")[2].partition("\nwhat may stand still")[0]
    lost = told.partition("  a message is lost\n")[2].partition("  a message comes twice\n")[0]
    assert lost.count("✓ proved    ") == 2
    assert "blocked safely: nothing fires that the central net could not fire (faults.follows, faults.agrees," in lost
    assert "(faults.resumes)" in lost
    crash = told.partition("  a controller crashes, and restarts\n")[2].partition("  a coordinator crashes")[0]
    assert "told below\n                (faults.dead.robot, faults.dead.lathe)\n" in crash
    assert "?" not in told
    shown = section(page_of(net, tmp_path, "--faults"), "fault")
    assert shown.count("✓ proved") == told.count("✓ proved")
    assert '<th scope="row"><b>a message is lost</b></th><td data-of="blocked safely">' in shown


def test_what_one_fault_does_is_not_proved_where_its_verdicts_are_not(
    capsys: pytest.CaptureFixture[str], net: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    monkeypatch.setattr(exploring, "explore_symbolically", _given_up)
    monkeypatch.setattr(verdicts, "prove_inductively", lambda *_: Proof("", frozenset({"starts", "divergence"})))
    assert main(["prove", net, "--faults", "--timeout", "0.001"]) == 3
    told = capsys.readouterr().out.partition("what one fault does\n")[2].partition("\nwhat may stand still")[0]
    lost = told.partition("  a message is lost\n")[2].partition("  a message comes twice\n")[0]
    assert lost.count("? unknown   ") == 2
    assert "faults.resumes is unknown (" in lost
    assert "✓ proved    blocked safely" not in told
    assert "✓ proved    resumes" not in told


def test_json_says_what_stands_still_and_goes_on(capsys: pytest.CaptureFixture[str], net: str) -> None:
    assert main(["prove", net, "--faults", "--format", "json"]) == 0
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    report = data["reports"][0]
    lost = next(one for one in report["faults"] if one["fault"] == "a message is lost")
    assert (lost["resumes"]["status"], lost["resumes"]["by"]) == ("proved", ["faults.resumes"])
    assert "status" not in lost["stands_still"]  # no verdict says so
    robot = {"at_once": ["fetch"], "at_last": ["hand_over", "unload"], "goes_on": [], "still": [], "running": []}
    assert report["outages"][0] == {"dead": "robot", **robot}


def test_wrong_protocols_are_no_counterexamples_of_the_page(net: str, tmp_path: Path) -> None:
    page = page_of(net, tmp_path, "--wrong")
    assert "Counterexamples" not in page
    lives_on = section(page, "lives-on")
    assert "missing-vote</b>: a transition is decided though one vote is missing (Eq. (7))" in lives_on
    assert "this net does not need O3 yet" in lives_on
    assert "on a small example, doors, in its own names" in lives_on
    assert '<td data-of="guard"><span>guard fires open</span>' in lives_on
    assert "good" not in lives_on[: lives_on.index("missing-vote")], "what cannot go wrong here is not approved of"


def test_events_of_a_protocol_stand_in_the_lane_of_who_acts(net: str, tmp_path: Path) -> None:
    lives_on = section(page_of(net, tmp_path, "--wrong"), "lives-on")
    run = lives_on[lives_on.index("missing-vote") :]
    decided = '<td data-of="the coordinator"><span>hand_over is decided without the vote of {}</span></td>'
    (missing,) = (one for one in ("robot", "lathe") if decided.format(one) in run)
    asked = {"robot": "lathe", "lathe": "robot"}[missing]
    assert f'<td data-of="{asked}"><span>{asked} votes yes on hand_over</span></td>' in run
    assert "central/" not in lives_on
    assert "without a controller" not in lives_on
    lost = lives_on[lives_on.index("sent-once") :]
    assert re.search(r'<td data-of="on the way"><span>the order for hand_over to \w+ is lost</span></td>', lost)
