"""The cell from above: workpieces go where commands take them, and nothing of a cell is drawn upon another thing."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import expect
from support import rejecting_cell
from support.browser import browser, command, needs_browser, page_at

from firable.cli.view.runs import Run
from firable.cli.view.scene import Piece, Stage
from firable.cli.view.top_view import top_view
from firable.nets.catalogue import catalogue_names, catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.machines.plant_file import PlantModel, parse_plant, read_plant
from firable.nets.text import parse_net
from firable.semantics.trace import Discipline, Trace

SORTING_NET = """\
firable: 1
cell: sorting
controllers:
  belt:
    start: idle
    places:
      idle:
      carrying: {send: {machine: B, command: OUT}, until: carried}
      rejecting: {send: {machine: B, command: REJECT}, until: rejected}
transitions:
  good: {from: belt.idle, to: belt.carrying}
  end: {from: belt.carrying, to: belt.idle}
  bad: {from: belt.idle, to: belt.rejecting}
  over: {from: belt.rejecting, to: belt.idle}
"""
SORTING = """\
firable_plant: 1
plant: sorting
stations: [entry, out, bin]
arrivals: {station: entry, every_s: 4}
departures: [{station: out}, {station: bin}]
machines:
  B:
    commands:
      OUT: {does: carry, from: entry, to: out, takes_s: 1}
      REJECT: {does: carry, from: entry, to: bin, takes_s: 1}
"""
PLANTS = {
    name: path for name in catalogue_names() if (path := catalogue_path(name).with_name(f"{name}.plant.yaml")).exists()
}


def plant(name: str) -> PlantModel:
    return read_plant(PLANTS[name])


def assert_apart(view: dict[str, Any]) -> None:
    bodies = [*view["stations"].values(), *view["others"].values(), *(arm["base"] for arm in view["arms"].values())]
    for (a, b), (c, d) in combinations(bodies, 2):
        assert max(abs(a - c), abs(b - d)) >= 60


@pytest.mark.parametrize("name", PLANTS)
def test_everything_of_a_cell_stands_somewhere_and_apart(name: str) -> None:
    model = plant(name)
    view = top_view(model)
    grippers = {station for arm in view["arms"].values() for station in arm["gripper"]}
    assert {*view["stations"], *grippers} == set(model.stations)
    assert {*view["belts"], *view["tables"], *view["arms"], *view["others"]} == set(model.machines)
    assert_apart(view)


def test_a_workpiece_goes_through_the_cell_and_out_of_it() -> None:
    stage = Stage(catalogue_net("one_robot"), plant("one_robot"))
    scene, seen = stage.begin(), []
    for name in [
        "G1",
        "G2",
        "t1-a",
        "G3",
        "t1-b",
        "G4",
        "G5",
        "t2-a",
        "t2-b",
        "G6",
        "t1-c",
        "G7",
        "t1-d",
        "G8",
        "G9",
        "G1",
    ]:
        scene = stage.fired(scene, (name,), sends=True)
        seen.append([(piece.number, piece.on, piece.machined) for piece in scene.pieces])
    one = [[(1, on, machined)] for on, machined in (
        ("CV1", False), ("cv1_end", False), ("cv1_end", False), ("R", False), ("R", False), ("mc_table", False),
        ("mc_table", False), ("mc_table", False), ("mc_table", True), ("mc_table", True), ("mc_table", True),
        ("R", True), ("R", True), ("CV2", True), ("cv2_exit", True),
    )]  # fmt: skip
    assert seen == [*one, [(2, "CV1", False)]]
    assert scene.hands == {"R": "CV2"}
    assert stage.of_json(scene.to_json()) == scene


def test_an_index_moves_all_workpieces_that_are_known_to_lie_there_one_of_which_lay_there_at_first() -> None:
    stage = Stage(catalogue_net("index_table"), plant("index_table"))
    scene, seen = stage.begin(), []
    assert [(piece.number, piece.on, piece.machined) for piece in scene.pieces] == [(1, "unload", True)]
    for name in ("", "G1", "t1-a", "G3", "t1-b", "t2-a", "t2-c", "t2-d", "t2-e", "", "G2", "t1-a", "G3"):
        # A workpiece comes to the load station, which its sensor tells.
        scene = stage.fired(scene, (name,), sends=True) if name else stage.signal(scene, "table.part_at_load")
        seen.append({piece.number: (piece.on, piece.machined) for piece in scene.pieces})
    assert seen[0] == {1: ("unload", True), 2: ("load", False)}
    assert seen[2] == {2: ("load", False)}
    assert seen[3] == {2: ("drill", False)}
    assert seen[9] == {2: ("drill", True), 3: ("load", False)}
    assert seen[12] == {2: ("unload", True), 3: ("drill", False)}
    assert stage.of_json(scene.to_json()) == scene


def test_a_command_that_is_left_before_its_completion_has_no_effect() -> None:
    stage = Stage(catalogue_net("one_robot_timed"), plant("one_robot_timed"))
    fault = next(t for t in stage.net.transitions if t.name == "robot.to_cv1_timeout")
    moving = stage.sent(stage.begin(), "robot.to_cv1")
    assert stage.fired(moving, (fault.name,), sends=False).hands == {"R": "HOME"}
    assert stage.signal(moving, "robot.at_cv1").hands == {"R": "CV1"}
    assert stage.signal(moving, "robot.at_cv1").busy == {}


def sorting(*ends: str) -> PlantModel:
    """The cell of one robot whose belt out carries to these."""
    text = PLANTS["one_robot"].read_text("utf-8").replace("cv2_exit]", "cv2_exit, bin, rework]", 1)
    run = re.compile(r"RUN: +{does: carry, from: cv2_entry, to: cv2_exit.*")
    ways = (f"TO_{end}: {{does: carry, from: cv2_entry, to: {end}, takes_s: 1}}" for end in ends)
    return parse_plant(run.sub("\n      ".join(ways), text))


@pytest.mark.parametrize("ends", [("bin", "cv2_exit"), ("cv2_exit", "bin"), ("cv2_exit", "bin", "rework")])
def test_a_belt_that_carries_out_or_rejects_is_a_belt_with_a_way_to_each(ends: tuple[str, ...]) -> None:
    view = top_view(sorting(*ends))
    assert [*view["belts"]] == ["CV1", "CV2"]
    assert [*view["belts"]["CV2"]] == [*ends]
    assert [*view["arms"]] == ["R"]
    stations = view["stations"]
    assert view["belts"]["CV2"] == {end: [*stations["cv2_entry"], *stations[end]] for end in ends}
    (x, y), *behind = (stations[end] for end in ends)
    assert y == stations["cv2_entry"][1] == 0.0
    assert behind == [[x, -95.0], [x, -190.0]][: len(behind)]
    assert_apart(view)


def test_who_stands_behind_the_line_stands_behind_all_ends_of_belts_too() -> None:
    text = """firable_plant: 1
plant: p
stations: [a, b, c, d]
arrivals: {station: a, every_s: 1}
departures: {station: b}
machines:
  B:
    commands:
      TO_B: {does: carry, from: a, to: b, takes_s: 1}
      TO_C: {does: carry, from: a, to: c, takes_s: 1}
      TO_D: {does: carry, from: a, to: d, takes_s: 1}
  R1: {hand: H, positions: {H: , B: b, D: d}, commands: {GO: {does: move, takes_s: 1}}}
  R2: {hand: H, positions: {H: , B: b, D: d}, commands: {GO: {does: move, takes_s: 1}}}
  M: {commands: {GO: {does: work, takes_s: 1}}}
"""
    assert_apart(top_view(parse_plant(text)))


@needs_browser
def test_of_a_belt_the_way_on_which_it_carries_runs(tmp_path: Path) -> None:
    net = tmp_path / "sorting.firable.yaml"
    net.write_text(SORTING_NET, "utf-8")
    net.with_name("sorting.plant.yaml").write_text(SORTING, "utf-8")
    with (
        browser() as chromium,
        command("view", net, "--no-browser") as (address, _),
        page_at(chromium, address) as page,
    ):
        page.get_by_role("tab", name="Top view").click()
        page.get_by_role("switch", name="Gates free").click()
        ways = page.locator("[data-machine=B] .running")
        runs = page.locator("[data-machine=B] .running.on")
        expect(ways).to_have_count(2)
        expect(runs).to_have_count(0)
        for transition, end in (("good", "out"), ("end", None), ("bad", "bin")):
            page.locator(f"[data-transition={transition}]").click()
            expect(runs).to_have_count(0 if end is None else 1)
            if end is not None:
                expect(runs).to_have_attribute("data-to", end)


def test_a_sensor_shows_that_a_workpiece_has_come_and_only_one() -> None:
    stage = Stage(catalogue_net("one_robot"), plant("one_robot"))
    scene = stage.signal(stage.signal(stage.begin(), "conveyor.part_at_entry"), "conveyor.part_at_entry")
    assert scene.pieces == (Piece(1, "cv1_entry"),)


@pytest.mark.parametrize("judged", ["passes", "fails"])
def test_a_camera_shows_that_a_workpiece_has_come_whatever_it_finds(judged: str) -> None:
    text = PLANTS["one_robot"].read_text("utf-8").replace("{occupied: cv1_entry}", f"{{{judged}: cv1_entry}}")
    stage = Stage(catalogue_net("one_robot"), parse_plant(text))
    assert stage.signal(stage.begin(), "conveyor.part_at_entry").pieces == (Piece(1, "cv1_entry"),)


def test_a_sensor_of_a_hand_is_believed_after_a_grasp_that_was_given_up() -> None:
    manual = (Path(__file__).parents[2] / "docs" / "time-limits.md").read_text("utf-8")
    net, plant_file = re.findall(r"^```yaml\n(.*?)^```", manual.partition("given twice\n")[2], re.MULTILINE | re.DOTALL)
    stage = Stage(parse_net(net), parse_plant(plant_file))
    for seen in (True, False):
        scene = stage.fired(stage.signal(stage.begin(), "robot.part_there"), ("start",), sends=True)
        scene = stage.fired(stage.signal(scene, "robot.arrived"), ("grip",), sends=True)
        scene = stage.fired(scene, ("robot.grasp_timeout",), sends=True)
        assert scene.pieces == (Piece(1, "table"),)
        scene = stage.signal(scene, "robot.in_hand") if seen else scene
        scene = stage.signal(scene, "robot.at_rest")
        assert (scene.busy, [piece.on for piece in scene.pieces]) == ({}, ["R" if seen else "table"])
        scene = stage.signal(stage.fired(scene, ("late",), sends=True), "robot.arrived")
        assert (scene.hands, [piece.on for piece in scene.pieces]) == ({"R": "EXIT"}, ["R"])


@pytest.mark.parametrize("tells", [(), ("robot.part_there",)], ids=["still there", "there again"])
def test_a_workpiece_that_comes_while_the_one_before_is_grasped_is_not_lost(tells: tuple[str, ...]) -> None:
    """The station is full again before the grasp is said to be done, whether or not its sensor could tell."""
    manual = (Path(__file__).parents[2] / "docs" / "time-limits.md").read_text("utf-8")
    net, plant_file = re.findall(r"^```yaml\n(.*?)^```", manual.partition("given twice\n")[2], re.MULTILINE | re.DOTALL)
    stage = Stage(parse_net(net), parse_plant(plant_file))
    scene = stage.signal(stage.begin(), "robot.part_there")
    for number in (1, 2, 3):
        scene = stage.fired(
            stage.signal(stage.fired(scene, ("start",), sends=True), "robot.arrived"), ("grip",), sends=True
        )
        for signal in tells:
            scene = stage.signal(scene, signal)
        scene = stage.signal(scene, "robot.grasped")
        assert scene.pieces == (Piece(number, "R"), *(Piece(number + 1, "table") for _ in tells))
        scene = stage.signal(stage.fired(scene, ("carry",), sends=True), "robot.arrived")
        scene = stage.signal(stage.fired(scene, ("release",), sends=True), "robot.laid_down")
        scene = stage.fired(scene, ("end",), sends=True)


def test_the_gripper_of_an_arm_that_carries_is_its_own_station_and_a_belt_has_none() -> None:
    view = top_view(plant("two_cells"))
    assert {name: arm["gripper"] for name, arm in view["arms"].items()} == {"RA": ["gripper_a"], "RB": ["gripper_b"]}
    assert set(view["belts"]) == {"CV1", "CV2", "CV3"}
    assert set(view["others"]) == {"MA", "MB"}


def test_the_frames_of_a_run_tell_how_the_cell_looks() -> None:
    net = catalogue_net("one_robot")
    trace = Trace.of_firings(net, [("G1",), ("G2",)], Discipline.INTERLEAVING)
    frames = Run("r", "", trace).to_json(net, Stage(net, plant("one_robot")))["frames"]
    assert [frame["scene"]["pieces"] for frame in frames] == [[], [[1, "CV1", False]], [[1, "cv1_end", False]]]


@pytest.mark.parametrize(
    "damage",
    [
        {"pieces": [[1, "nowhere", False]]},
        {"pieces": [[1, "cv1_end"]]},
        {"pieces": 3},
        {"hands": {"X": "HOME"}},
        {"busy": {"R": "no.place"}},
        {"arrived": None},
    ],
)
def test_a_scene_that_the_plant_cannot_have_is_refused(damage: dict[str, object]) -> None:
    stage = Stage(catalogue_net("one_robot"), plant("one_robot"))
    with pytest.raises(InputError, match="F5070"):
        stage.of_json({**stage.begin().to_json(), **damage})


def test_workpieces_are_gone_from_each_way_out_with_the_next_firing() -> None:
    stage = Stage(rejecting_cell.net(), rejecting_cell.plant())
    assert top_view(stage.plant)["departures"] == ["exit", "bin"]
    scene = replace(stage.begin(), pieces=(Piece(1, "exit"), Piece(2, "bin"), Piece(3, "table")))
    assert [piece.on for piece in stage.fired(scene, ["t1"], sends=False).pieces] == ["table"]


def test_a_plant_with_one_machine_and_no_line_has_a_view() -> None:
    text = """firable_plant: 1
plant: p
stations: [s]
arrivals: {station: s, every_s: 1}
departures: {station: s}
machines: {M: {commands: {GO: {does: work, takes_s: 1}}}}
"""
    view = top_view(parse_plant(text))
    assert view["stations"] == {"s": [0.0, -95.0]}
    assert set(view["others"]) == {"M"}


def test_a_machine_that_only_works_stands_behind_the_arms_behind_the_line() -> None:
    text = """firable_plant: 1
plant: p
stations: [a, b]
arrivals: {station: a, every_s: 1}
departures: {station: b}
machines:
  R1: {hand: H, positions: {H: , A: a, B: b}, commands: {GO: {does: move, takes_s: 1}}}
  R2: {hand: H, positions: {H: , A: a, B: b}, commands: {GO: {does: move, takes_s: 1}}}
  M: {commands: {GO: {does: work, takes_s: 1}}}
"""
    view = top_view(parse_plant(text))
    assert view["arms"]["R2"]["base"][1] < min(y for _, y in view["stations"].values())
    (machine,) = view["others"].values()
    for arm in view["arms"].values():
        for x, y in (arm["base"], arm["home"]):
            assert max(abs(x - machine[0]), abs(y - machine[1])) >= 60
