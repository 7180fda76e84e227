"""`firable check --machines`: what it prints, what it writes, what it refuses."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from support.interrupting import ended

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.producing import spaces
from firable.analysis.goal import Limits
from firable.analysis.methods import Method
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.cli.main import main
from firable.decompose import bundling
from firable.decompose.proofs import closed_loops
from firable.decompose.proofs.held_gates import HeldGates, held_gates
from firable.nets.catalogue import catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.machines.plant_file import PlantModel
from firable.nets.net import Net
from firable.semantics.trace import Discipline

SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
CELL, PLANT = "catalogue:one_robot", "catalogue:one_robot"


@pytest.fixture
def wrong_plant(tmp_path: Path) -> str:
    """The plant of the one-robot cell with a sensor on another station."""
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    path = tmp_path / "wrong.plant.yaml"
    path.write_text(text.replace("{occupied: mc_table}", "{occupied: cv2_entry}"), "utf-8")
    return str(path)


def test_the_loop_is_told_beside_the_net_with_gates_free(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", CELL, "--machines", PLANT]) == 0
    told = capsys.readouterr().out
    assert "the loop has 92 places, 178 transitions, 746 markings and 1,976 edges" in told
    assert "  deadlock-free                       proved      proved\n" in told
    assert "✓ proved    fault.MC.repaired" in told
    assert told.endswith("all hold: 17 proved\n")


def test_a_deadlock_of_the_cell_among_its_machines_tells_who_waits_for_whom(
    wrong_plant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    late = "catalogue:one_robot_mc_late"
    assert main(["check", late, "--machines", late]) == 1
    told = capsys.readouterr().out
    circle = "robot.put_mc (putting on MC) waits in G4 for mc.free, which comes from mc.release by G6 and G7"
    said = (
        "✗ violated  loop.deadlock-free",
        "in a circle, each waiting",
        circle,
        "waits in G6 for robot.free",
        "hint: [F3011] the machines",
    )
    at = [told.index(words) for words in said]
    assert at == sorted(at)
    assert main(["check", CELL, "--machines", wrong_plant]) == 1
    told = capsys.readouterr().out
    assert "✗ violated  loop.deadlock-free" in told
    assert "in a circle" not in told, "a transition of the cell waits for a gate, and no machine will open it"


def test_why_nothing_is_asked_of_faults_where_nothing_is_live_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late, page = "catalogue:one_robot_mc_late", tmp_path / "page.html"
    said = (
        "fault.MACHINE is not asked of R, MC, CV1, CV2: without faults no transition is live here, so a fault takes "
        "nothing, and repair gives nothing"
    )
    assert main(["check", late, "--machines", late]) == 1
    told = capsys.readouterr().out
    assert f"\n{said}\n" in told
    assert "fault.safe" in told
    assert "fault.MC" not in told
    assert main(["check", late, "--machines", late, "--format", "json", "--report", str(page)]) == 1
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    assert data["reports"][0]["loop"]["faults_not_asked"] == said
    assert f"<p>{said}.</p>" in page.read_text("utf-8")
    assert main(["check", CELL, "--machines", PLANT]) == 0
    assert "not asked" not in capsys.readouterr().out


def test_a_run_in_which_a_machine_fails_is_told_and_drawn_of_the_loop_in_which_it_may(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert main(["check", CELL, "--machines", PLANT, "--verbose", "--report", str(page)]) == 0
    told = capsys.readouterr().out
    about = told[told.index("no        fault.CV1 ") :]
    steps = ("1. arrives/cv1_entry", "2. G1/raw", "3. CV1/fails/conveyor.cv1_run  CV1 RUN fails", "CV1 has failed, and")
    at = [about.index(step) for step in steps]
    assert at == sorted(at)
    assert "<b>CV1 RUN fails</b>" in page.read_text("utf-8")


def test_what_gates_free_was_too_hopeful_about_stands_out(wrong_plant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", CELL, "--machines", wrong_plant]) == 1
    told = capsys.readouterr().out
    assert "  live                                proved      violated\n      gates free was too hopeful" in told
    assert "✗ violated  loop.gates-open" in told


def test_the_json_of_a_loop_fits_the_published_schema(wrong_plant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", CELL, "--machines", wrong_plant, "--format", "json"]) == 1
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    loop = data["reports"][0]["loop"]
    assert loop["machines"] == wrong_plant
    row = next(row for row in loop["comparison"] if row["question"] == "live")
    assert (row["gates_free"], row["with_machines"]) == ("proved", "violated")


def test_the_loop_is_written_as_a_net_that_is_checked_like_any_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, schema = tmp_path / "loop.firable.yaml", tmp_path / "net.schema.json"
    assert main(["check", CELL, "--machines", PLANT, "--loop-net", str(path)]) == 0
    told = capsys.readouterr().out
    assert f"  the loop as a net file: {path}\n  written: {schema}, by which editors complete and check it\n" in told
    assert told.count("as a net file") == 1
    assert main(["check", str(path), "--query", "AG not (plant.accident or plant.overrun)"]) == 1
    told = capsys.readouterr().out
    assert "746 markings, 1,976 edges" in told
    # The questions stand in it as properties, so that evidence of the answers can be had and checked.
    assert "✓ proved    property.loop.accident" in told
    assert "✓ proved    property.cell.restart" in told
    assert "✓ proved    query.query-1" in told


def test_the_evidence_on_each_loop_is_written_and_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "evidence"
    assert main(["check", CELL, "--machines", PLANT, "--evidence", str(folder)]) == 0
    told = capsys.readouterr().out
    loops = ("loop", "loop.failing")
    assert sorted(path.name for path in folder.iterdir()) == [f"one-robot.{loop}.evidence.json" for loop in loops]
    for loop, said in zip(loops, ("property.loop.live.0", "property.fault.R.t0"), strict=True):
        path = str(folder / f"one-robot.{loop}.evidence.json")
        assert f"evidence: firable verify {path}\n" in told
        assert main(["verify", path]) == 0
        assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--machines", "nowhere.yaml"], "F1001"),
        (["--machines", "catalogue:conceptual_one_robot"], "is a net without machines"),
        (["--machines", "catalogue:nothing"], "the catalogue has no 'nothing'"),
        (["--machines", "catalogue:two_robots_separate"], "F5003"),
        (["--machines", PLANT, "--query", "AG EF start"], "--query does not go with --machines"),
        (["--machines", PLANT, "--discipline", "step"], "--discipline does not go with --machines"),
        (["--machines", PLANT, "--trace-dir", "x"], "--trace-dir does not go with --machines"),
        (["--loop-net", "x"], "--loop-net goes with --machines"),
        ([CELL, "--machines", PLANT, "--loop-net", "x"], "--loop-net holds one loop"),
    ],
)
def test_what_does_not_go_together_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", CELL, *arguments]) == 2
    captured = capsys.readouterr()
    assert message in captured.err + captured.out


@pytest.mark.parametrize(
    "command",
    [
        ("check", CELL, "--machines"),
        ("prove", CELL, "--machines"),
        ("bundle", CELL, "-o", "cell.bundle", "--machines"),
        ("sim", CELL, "--modbus", "--bind", "cell.bind.yaml", "--plant"),
        ("view", CELL, "--no-browser", "--plant"),
    ],
    ids=lambda command: command[0],
)
def test_the_plant_file_of_a_twin_cell_is_refused_though_all_the_rest_of_it_fits(
    command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    monkeypatch.chdir(tmp_path)
    Path("twin.plant.yaml").write_text(text.replace("plant: one-robot", "plant: one-robot-2"), "utf-8")
    assert main([*command, "twin.plant.yaml"]) == 2
    told = capsys.readouterr().err
    assert "twin.plant.yaml:3:8: error[F5003]: this plant file is for the cell 'one-robot-2', and the net is" in told
    assert "`plant: one-robot`" in told
    assert [path.name for path in tmp_path.iterdir()] == ["twin.plant.yaml"]


def test_a_bundle_that_the_machines_forbid_ends_with_a_report_of_what_is_violated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As one does that the net alone forbids."""
    plant = tmp_path / "flickering.plant.yaml"
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    plant.write_text(text.replace("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}"))
    bundle = tmp_path / "cell.bundle"
    assert main(["bundle", CELL, "-o", str(bundle), "--machines", str(plant)]) == 1
    told = capsys.readouterr()
    assert "✗ violated  o4.G4/mc.part_present" in told.out
    assert f"`firable prove {CELL} --machines {plant}` shows the run" in told.out
    assert f"`firable check {CELL} --machines {plant}` shows the run" in told.out
    assert "violated: 2 violated" in told.out
    assert "no bundle was made" in told.out
    assert told.err == ""
    assert not bundle.exists()


WATCHED = """
firable: 1
cell: watched
controllers:
  robot:
    start: home
    inputs: reset
    places:
      home:
      out:       {send: {machine: R, command: MOVE, to: OUT}, until: is_out, within: 1s}
      out_fault: {send: {machine: R, command: STOP}}
  camera: {start: idle, places: {idle: , seen: }}
transitions:
  start: {from: robot.home, to: robot.out}
  again: {from: robot.out_fault, to: robot.out, if: robot.reset}
  end:   {from: robot.out, to: robot.home}
  see:   {from: camera.idle, to: camera.seen, if: robot.out}
  rest:  {from: camera.seen, to: camera.idle}
"""
HASTY = """
firable_plant: 1
plant: watched
stations: [table]
arrivals:   {station: table, every_s: 5}
departures: {station: table}
machines:
  R: {hand: OUT, positions: {OUT: }, commands: {MOVE: {does: move, takes_s: 1.5}, STOP: {does: stop}}}
sensors: {robot.reset: {acknowledges: R, after_s: 3}}
"""


@pytest.mark.parametrize(
    ("command", "codes"), [("split", ["F4015"]), ("prove", ["F4015", "F5009"]), ("bundle", ["F4015", "F5009"])]
)
def test_limits_that_a_split_or_a_machine_makes_late_are_warned_of_where_they_stand(
    command: str, codes: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, plant = tmp_path / "watched.firable.yaml", tmp_path / "watched.plant.yaml"
    net.write_text(WATCHED)
    plant.write_text(HASTY)
    options = ["--machines", str(plant)] if "F5009" in codes else []
    options += ["-o", str(tmp_path / "cell.bundle")] if command == "bundle" else []
    main([command, str(net), *options])
    told = capsys.readouterr().err
    assert sorted(re.findall(r"warning\[(F\d+)\]", told)) == codes
    line = 1 + WATCHED.splitlines().index("  see:   {from: camera.idle, to: camera.seen, if: robot.out}")
    assert f"watched.firable.yaml:{line}:3: warning[F4015]: 'robot.out_timeout' waits" in told


def test_a_bundle_for_whose_loops_the_time_is_too_short_says_how_to_give_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = closed_loops.sealed_loops

    def late(decomposition: Decomposition, plant: str, _: object) -> object:
        return real(decomposition, plant, lambda: Limits(Deadline.after(0)))

    monkeypatch.setattr(bundling, "sealed_loops", late)
    assert main(["bundle", CELL, "-o", str(tmp_path / "cell.bundle"), "--machines", PLANT]) != 0
    told = capsys.readouterr()
    assert "allow more time to look for evidence, with --max-seconds; without it, that is 30 s" in told.out + told.err


def test_what_was_tried_where_the_first_markings_are_not_all_is_told_of_a_loop_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.check.FIRST_MARKINGS", 200)
    assert main(["check", CELL, "--machines", PLANT]) == 0
    assert "\n  the first 200 markings are not all\n" in capsys.readouterr().out


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The nets that are explored beyond M0, of which Ctrl-C ends the second."""
    nets: list[str] = []

    def until_ctrl_c(net: Net, discipline: Discipline, budget: Budget, **by: Any) -> ReachabilityGraph:
        if budget.markings == 1:
            return explore(net, discipline, budget, **by)
        nets.append(net.name)
        if len(nets) == 2:
            return ended(explore(net, discipline, replace(budget, markings=5), **by))
        return explore(net, discipline, budget, **by)

    monkeypatch.setattr("firable.analysis.check.explore", until_ctrl_c)
    return nets


def test_one_ctrl_c_ends_all_explorations_of_a_cell_with_its_machines(
    begun: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", CELL, "--machines", PLANT]) == 0, "all that must hold was known before"
    assert len(begun) == 2, "of the loop, and of the net with gates free"
    told = capsys.readouterr().out
    assert "746 markings and 1,976 edges\n  5 markings with gates free so far\n" in told
    assert "\n  interrupted\n" in told
    assert "  deadlock-free                       unknown     proved\n" in told
    assert "✓ proved    loop.deadlock-free" in told
    assert re.search(r"\? unknown   fault\.MC .*\n +reached: interrupted\n +hint: .*ask again, and let it come", told)


def test_one_ctrl_c_ends_all_explorations_for_a_bundle(
    begun: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bundle", CELL, "-o", str(tmp_path / "cell.bundle"), "--machines", PLANT]) == 3
    assert len(begun) == 2, "of the net, and of the loop of commands that are sent late"
    told = capsys.readouterr().out
    assert "no bundle was made" in told
    assert "? unknown   loop.deadlock-free" in told
    assert "ask again, and let it come to its end" in told
    assert "--max-seconds" not in told


def test_the_parts_of_what_is_asked_of_a_loop_are_told_by_name_to_who_asks_for_all(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are many, and have names that stand in no file."""
    monkeypatch.setattr("firable.analysis.check.FIRST_MARKINGS", 200)
    for others in ("SPACES", "FIRST_KNOWERS"):
        monkeypatch.setattr(f"firable.analysis.check.{others}", {})
    # It decides each of them, however long it takes, and of what is no such question nobody decides anything.
    monkeypatch.setattr("firable.analysis.check.GOAL_LANES", ((Method.REDUCTION,),))
    monkeypatch.setattr("firable.analysis.check.FORMULA_LANES", ())
    limits = ["--max-markings", "300", "--no-cache"]
    assert main(["check", CELL, "--machines", PLANT, *limits]) == 3
    brief = capsys.readouterr().out
    assert "property.loop.completion.1: " not in brief
    told = re.search(r"asked one by one: (\d+) questions about the loop; -v tells of each", brief)
    assert told is not None
    assert main(["check", CELL, "--machines", PLANT, *limits, "-v"]) == 3
    whole = capsys.readouterr().out
    assert "property.loop.completion.1: " in whole
    assert len(re.findall(r"^  property\.\S+: ", whole, re.MULTILINE)) == int(told[1])
    assert "-v tells of each" not in whole


def test_a_bundle_that_is_kept_back_by_how_many_markings_are_written_down_is_not_told_to_take_more_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spaces, "MARKINGS_MAX", 500)  # those of the loop are 746
    monkeypatch.setattr(spaces, "WIDE_MAX", 500)
    assert main(["bundle", CELL, "-o", str(tmp_path / "cell.bundle"), "--machines", PLANT]) == 2
    told = capsys.readouterr().err
    assert (
        "'loop.property.accepted_is_carried_out' is proved, and there is no evidence that shows it again: ranks for"
        in told
    )
    assert "that is a limit of size, which no time moves" in told


def test_the_time_of_an_obligation_is_that_of_the_loop_too(monkeypatch: pytest.MonkeyPatch) -> None:
    budgets: list[Budget | None] = []

    def asked(decomposition: Decomposition, model: PlantModel, budget: Budget | None = None) -> HeldGates:
        budgets.append(budget)
        return held_gates(decomposition, model, budget)

    monkeypatch.setattr("firable.decompose.proofs.held_gates.held_gates", asked)
    assert main(["prove", CELL, "--machines", PLANT, "--timeout", "77"]) == 0
    assert budgets == [Budget(seconds=77.0)]


def test_prove_asks_the_assumptions_of_the_machines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", CELL, "--machines", PLANT]) == 0
    told = capsys.readouterr().out
    assert "shown in the loop: with the machines that were given" in told
    assert "✓ proved    o4.G4/mc.part_present" in told
    assert "assumed of the cell" not in told


def test_prove_shows_the_run_in_which_a_machine_closes_a_gate_after_the_vote(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    path = tmp_path / "flickers.plant.yaml"
    path.write_text(text.replace("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}"), "utf-8")
    assert main(["prove", CELL, "--machines", str(path)]) == 1
    told = capsys.readouterr().out
    for move, words in (
        ("drops", "the sensor of mc.part_present drops, though"),
        ("told/falls", "the controller is told"),
    ):
        assert re.search(rf"mc\.part_present/{move} +{words}", told)
    assert "'t2-82' had voted yes, and the last firing makes 'mc.part_present' 0" in told
    (held,) = (line for line in told.splitlines() if line.startswith("      then hold a token: "))
    assert "plant.mc_table.raw" in held
    assert "plant.CV1.idle" not in held, "machines that are as they were are left out"
    assert "hint: [F4002] put the interlock into the machine's own controller" in told
    assert main(["prove", CELL, "--machines", str(path), "--format", "json"]) == 1
    data = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    (o4,) = [line for line in data["reports"][0]["standing"] if line["name"] == "O4"]
    assert o4["status"] == "violated"


ZONE = """
firable: 1
cell: zone
controllers:
  r:
    start: [free, zone]
    places:
      free:
      zone:
      work:       {send: {machine: R, command: WORK}, until: worked, within: 2s}
      work_fault: {send: {machine: R, command: STOP}, UNTIL}
      home:       {send: {machine: R, command: HOME}, until: homed}
  q:
    start: idle
    places:
      idle:
      at_it:      {send: {machine: Q, command: WORK}, until: done}
transitions:
  begin:  {from: r.free, to: r.work}
  end:    {from: r.work, to: r.free}
  flee:   {from: [r.work_fault, r.zone], to: r.home}
  back:   {from: r.home, to: [r.free, r.zone]}
  q_on:   {from: [q.idle, r.zone], to: q.at_it}
  q_off:  {from: q.at_it, to: [q.idle, r.zone]}
"""
ZONE_PLANT = """
firable_plant: 1
plant: zone
stations: [table]
arrivals:   {station: table, every_s: 5}
departures: {station: table, after_s: 1}
machines:
  R:
    commands:
      WORK: {does: work, takes_s: 1, may_fail: for_good}
      HOME: {does: work, takes_s: 1}
      STOP: {does: stop, TAKES}
  Q:
    commands:
      WORK: {does: work, takes_s: 1}
"""


@pytest.mark.parametrize(("until", "takes"), [("", ""), ("until: at_rest", ""), ("until: at_rest", "takes_s: 0.3")])
def test_a_machine_that_has_failed_obeys_a_stop_and_hangs_at_what_comes_after_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], until: str, takes: str
) -> None:
    net, plant = tmp_path / "zone.firable.yaml", tmp_path / "zone.plant.yaml"
    net.write_text(ZONE.replace(", UNTIL", f", {until}" if until else ""), "utf-8")
    plant.write_text(ZONE_PLANT.replace(", TAKES", f", {takes}" if takes else ""), "utf-8")
    assert main(["check", str(net), "--machines", str(plant), "--format", "json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)["reports"]
    found = {verdict["name"]: verdict for verdict in report["verdicts"]}
    assert {"q_on", "q_off", "flee", "back"} <= set(found["fault.R"]["subjects"])
    assert found["fault.R"]["status"] == "violated"


GRIPPING = """
firable: 1
cell: gripping
controllers:
  r:
    start: free
    inputs: [part_there, in_hand, reset]
    places:
      free:
      to_table:    {send: {machine: R, command: MOVE, to: TABLE}, until: arrived}
      grasp:       {send: {machine: R, command: GRASP, at: TABLE}, until: grasped, within: 2s}
      grasp_fault: {send: {machine: R, command: STOP}}
      to_exit:     {send: {machine: R, command: MOVE, to: EXIT}, until: arrived}
      put:         {send: {machine: R, command: PUT, at: EXIT}, until: laid_down}
transitions:
  start:   {from: r.free, to: r.to_table, if: r.part_there}
  grip:    {from: r.to_table, to: r.grasp}
  carry:   {from: r.grasp, to: r.to_exit}
  again:   {from: r.grasp_fault, to: r.grasp, if: r.reset}
  release: {from: r.to_exit, to: r.put}
  end:     {from: r.put, to: r.free}
"""
GRIPPING_PLANT = """
firable_plant: 1
plant: gripping
stations: [table, exit]
arrivals:   {station: table, every_s: 5}
departures: {station: exit, after_s: 1}
machines:
  R:
    hand: EXIT
    positions: {TABLE: table, EXIT: exit}
    commands:
      MOVE:  {does: move,  takes_s: 1}
      GRASP: {does: grasp, takes_s: 1}
      PUT:   {does: put,   takes_s: 0.5, when_full: wait}
      STOP:  {does: stop}
sensors:
  r.part_there: {occupied: table}
  r.in_hand:    {holding: R}
  r.reset:      {acknowledges: R, after_s: 3}
"""
AT_REST = GRIPPING.replace("command: STOP}}", "command: STOP}, until: at_rest}")
LOOKING = AT_REST.replace("if: r.reset}", "if: r.reset, unless: r.in_hand}")
LATE = "\n  late:    {from: r.grasp_fault, to: r.to_exit, if: r.in_hand}\n"


def accident(folder: Path, capsys: pytest.CaptureFixture[str], cell: str, stop: str) -> list[str]:
    """The run to an accident of a cell whose stop takes time, or does not; none where all goes well."""
    net, plant = folder / "gripping.firable.yaml", folder / "gripping.plant.yaml"
    net.write_text(cell, "utf-8")
    plant.write_text(GRIPPING_PLANT.replace("{does: stop}", stop), "utf-8")
    assert main(["check", str(net), "--machines", str(plant), "--format", "json"]) in (0, 1)
    (report,) = json.loads(capsys.readouterr().out)["reports"]
    found = [v for v in report["verdicts"] if v["name"] in ("loop.accidents", "loop.busy-machines")]
    assert {verdict["status"] for verdict in found} <= {"proved", "violated"}
    return [name for verdict in found for step in verdict.get("witness", {}).get("firings", ()) for name in step]


@pytest.mark.parametrize(
    ("cell", "stop", "ends"),
    [
        (GRIPPING, "{does: stop}", ("R/done/r.grasp", "again/clears-r.grasped/R-holds")),
        (
            LOOKING.replace("}, until: at_rest}", "}}") + LATE,
            "{does: stop}",
            ("R/done/r.grasp", "again/clears-r.grasped/R-holds"),
        ),
        (AT_REST, "{does: stop}", ("R/still-done/r.grasp", "R/done/r.grasp_fault", "again/R-holds")),
        (AT_REST, "{does: stop, takes_s: 0.3}", ("R/still-done/r.grasp", "R/done/r.grasp_fault", "again/R-holds")),
        (LOOKING + LATE, "{does: stop, takes_s: 0.3}", ()),
        (LOOKING.replace("}, until: at_rest}", "}}") + LATE, "{does: stop, takes_s: 0.3}", ("again/R-busy",)),
    ],
)
def test_what_a_stop_breaks_off_may_still_be_done_until_the_machine_is_at_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], cell: str, stop: str, ends: tuple[str, ...]
) -> None:
    """Where nobody looks afterwards whether the part is in the hand, it is grasped again. Nobody does who does not wait
    until the robot is at rest: it may be done a moment before the stop, and its controller still to be told."""
    run = accident(tmp_path, capsys, cell, stop)
    assert [name for name in run if name in ends] == list(ends)
    assert bool(run) == bool(ends)


PRESS = """\
firable: 1
cell: press
controllers:
  press: {start: open, inputs: there, places: {open: , down: {send: {machine: P, command: RUN}, until: pressed}}}
transitions:
  close: {from: press.open, to: press.down, if: press.there}
  open: {from: press.down, to: press.open}
"""
PRESS_PLANT = """\
firable_plant: 1
plant: press
stations: [table]
arrivals: {station: table, every_s: 5}
departures: {station: table}
machines:
  P: {commands: {RUN: {does: work, takes_s: 1}}}
sensors:
  press.there: {occupied: table}
"""


def test_a_run_tells_that_its_machines_are_not_those_that_the_bundle_was_proved_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net, plant, bundle = (tmp_path / f"press.{kind}" for kind in ("firable.yaml", "plant.yaml", "bundle"))
    net.write_text(PRESS)
    plant.write_text(PRESS_PLANT)
    assert main(["bundle", str(net), "-o", str(bundle), "--machines", str(plant)]) == 0
    for changed, where in (("takes_s: 1", ""), ("takes_s: 1, may_fail: for_good", "machines.P.commands.RUN.may_fail")):
        plant.write_text(PRESS_PLANT.replace("takes_s: 1", changed).replace("every_s: 5", "every_s: 2"))
        capsys.readouterr()
        main(["run", str(bundle), "--workpieces", "1"])
        told = capsys.readouterr().err
        assert (f"warning[F5003]: '{where}': the bundle was proved with" in told) == bool(where)
        assert ("F5003" in told) == bool(where)
