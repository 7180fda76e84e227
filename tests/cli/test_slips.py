"""A slip of the pen, wherever a name is written: the name that was probably meant is told."""

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.decompose.refinement.refining import refine
from firable.executor.drivers.binding import parse_binding
from firable.executor.drivers.bound import bound_driver
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_tasks
from firable.nets.diagnostics import InputError, did_you_mean
from firable.nets.editing import edits
from firable.nets.machines.fitting import misfits
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import Controller, Net
from firable.nets.pnml import parse_pnml
from firable.nets.queries import query_named
from firable.nets.source import Source
from firable.nets.tasks.text import parse_tasks
from firable.nets.text import parse_net

PLANT = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
BINDING = catalogue_path("one_robot").with_name("one_robot.bind.yaml").read_text("utf-8")
CONCEPTUAL = catalogue_path("conceptual_one_robot").read_text("utf-8")
BARE = "firable: 1\ncell: c\ncontrollers: {robot: {places: {free: }}}\n"
TASKS = """firable_tasks: 1
tasks:
  fetch:
    roles: {robot: {steps: {go: {place: going}}}}
    subtasks: {taking: {task: {name: take, hand: robot}}}
    moves: {}
    start: {to: taking}
    end: {from: taking}
  take:
    roles: {hand: {steps: {grasp: {place: grasping}}}}
"""
PNML = (
    "<pnml><net id='n'><place id='buffer'/><transition id='go'/><arc id='a' source='bufer' target='go'/></net></pnml>"
)


def edited(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def of_the_plant(old: str, new: str) -> None:
    problems = misfits(parse_plant(edited(PLANT, old, new), "c.plant.yaml"), catalogue_net("one_robot"))
    raise InputError(problems)


def of_the_binding(old: str, new: str) -> object:
    return bound_driver(parse_binding(edited(BINDING, old, new), "c.bind.yaml"), catalogue_net("one_robot"))


def of_the_conceptual_net(old: str, new: str) -> object:
    return refine(parse_net(edited(CONCEPTUAL, old, new)), catalogue_tasks())


def of_a_task(old: str, new: str) -> object:
    tasks = {**catalogue_tasks(), **parse_tasks(edited(TASKS, old, new))}
    return refine(parse_net(edited(CONCEPTUAL, "{name: carry_in, conveyor: cv1}", "{name: fetch, robot: cv1}")), tasks)


def of_layers() -> object:
    return Net("n", controllers=(Controller("line", coordinator=True), Controller("cell", under="lien")))


SLIPS: dict[str, tuple[Callable[[], object], str]] = {
    "an end of an arc of PNML": (lambda: parse_pnml(PNML), "buffer"),
    "a controller that gets a place": (lambda: edits.add_place(Source("c.yaml", BARE), "x", "robto"), "robot"),
    "a coordinator above": (of_layers, "line"),
    "a place to start in": (lambda: parse_net(f"{BARE}places: {{part: }}\nstart: prat\n"), "part"),
    "a place of a query": (lambda: query_named("EF robot.fre", catalogue_net("one_robot")), "robot.free"),
    "a station": (lambda: of_the_plant("station: cv1_entry, every", "station: cv1_enrty, every"), "cv1_entry"),
    "a sensor": (lambda: of_the_plant("robot.touch: ", "robot.tuch: "), "robot.touch"),
    "a sensor that the net has": (lambda: of_the_plant("mc.part_present: ", "mc.part_presnt: "), "mc.part_presnt"),
    "a signal bound": (lambda: of_the_binding("mc.clamped:", "mc.clampt:"), "mc.clamped"),
    "a command bound": (lambda: of_the_binding("  mc.fix:", "  mc.fxi:"), "mc.fix"),
    "a device": (
        lambda: of_the_binding("{device: modbus, read: discrete 2", "{device: mobus, read: discrete 2"),
        "modbus",
    ),
    "a channel": (lambda: of_the_binding("channel: CV2", "channel: CV"), "CV2"),
    "a controller of a contact": (lambda: of_the_binding("discrete 9", "discrete 9, controllers: [robto]"), "robot"),
    "a controller that a resource opens to": (
        lambda: of_the_conceptual_net("to: robot.free", "to: robto.free"),
        "robot",
    ),
    "a resource of a task": (
        lambda: of_the_conceptual_net("robot: robot, source: cv1", "robot: robt, source: cv1"),
        "robot",
    ),
    "a role of a task": (lambda: of_the_conceptual_net("conveyor: cv1}", "conveyr: cv1}"), "conveyor"),
    "a task": (lambda: of_the_conceptual_net("name: unload", "name: unlaod"), "unload"),
    "a role of a subtask": (lambda: of_a_task("hand: robot}", "hand: robto}"), "robot"),
}


@pytest.mark.parametrize(("wrong", "meant"), SLIPS.values(), ids=SLIPS)
def test_the_name_that_was_probably_meant_is_told(wrong: Callable[[], object], meant: str) -> None:
    with pytest.raises(InputError) as refused:
        wrong()
    hints = [re.match(r"did you mean '(.*?)'\?", problem.hint) for problem in refused.value.diagnostics]
    assert meant in [hint.group(1) for hint in hints if hint is not None], refused.value


def test_a_name_that_is_like_another_by_its_owner_alone_is_no_slip_of_it() -> None:
    assert did_you_mean("lathe.reset", ["lathe.free", "lathe.busy"]) == ""
    assert did_you_mean("lathe.fere", ["lathe.free", "lathe.busy"]) == "did you mean 'lathe.free'? "


def test_the_same_name_under_another_owner_is_told_where_one_alone_has_it() -> None:
    assert did_you_mean("lathe.empty", ["lathe.free", "conveyor.empty"]) == "did you mean 'conveyor.empty'? "
    assert did_you_mean("lathe.empty", ["conveyor.empty", "table.empty"]) == ""
    assert did_you_mean("lathe.fre", ["lathe.free", "robot.free"]) == "did you mean 'lathe.free'? "
    assert did_you_mean("empty", ["lathe.free", "robot.far"]) == ""


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["draw", "catalogue:one_robot", "--marking", "robot.fre"], "robot.free"),
        (
            ["io", str(catalogue_path("one_robot").with_name("one_robot.bind.yaml")), "--force", "robot.tuch=1"],
            "robot.touch",
        ),
        (["check", "catalogue:one_robot", "--format", "jso"], "json"),
        (["check", "catalogue:one_robot", "--write", "jnit", "report.xml"], "junit"),
        (["schema", "nets"], "net"),
    ],
)
def test_a_slip_on_the_command_line_is_told_too(
    arguments: list[str], meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert f"did you mean '{meant}'?" in capsys.readouterr().err


def test_a_command_that_is_told_can_be_typed_as_it_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net, runs, evidence = (str(tmp_path / name) for name in ("my cell.firable.yaml", "my runs", "my evidence"))
    Path(net).write_text("firable: 1\ncell: c\nplaces: {a: , b: }\nstart: a\ntransitions: {t: {from: a, to: b}}\n")
    assert main(["check", net, "--trace-dir", runs, "--evidence", evidence]) == 1
    said = [shlex.split(found) for found in re.findall(r"firable ((?:replay|verify) .*)", capsys.readouterr().out)]
    assert {words[0] for words in said} == {"replay", "verify"}
    assert [main(words) for words in said] == [0] * len(said)


def test_a_name_that_looks_the_same_is_said_to_be_another() -> None:
    """Some keyboards and file systems take letters with accents apart; nobody sees that."""
    composed, apart = "t\u00fcr", "tu\u0308r"
    for name, known in ((composed, apart), (apart, composed)):
        hint = did_you_mean(name, ["tor", known])
        assert hint == f"'{known}' looks the same, and is written with other characters: copy it from there; "
