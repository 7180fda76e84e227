"""Files of registered tasks: what is read, and what is refused where."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

import firable.nets.catalogue
from firable.nets.catalogue import catalogue_tasks
from firable.nets.diagnostics import InputError
from firable.nets.net import Command, TaskUse
from firable.nets.tasks.document import json_schema
from firable.nets.tasks.model import Gate, Move, Step
from firable.nets.tasks.text import SIZE_BYTES_MAX, filled, names_in_template, parse_tasks, read_tasks

FILE = Path(str(firable.nets.catalogue.__file__)).parent / "cell.tasks.yaml"

TASK = """\
firable_tasks: 1
tasks:
  fetch:
    parameters: {speed: slow}
    roles:
      robot:
        inputs: {near: }
        steps:
          go: {send: {machine: "{robot.machine}", command: MOVE, at: "{speed}"}, until: "{robot.prefix}there"}
          take:
      source:
        steps:
          held: {place: "{source}_held"}
    start: {if: robot.near}
    moves:
      a: {from: robot.go, to: robot.take, unless: source.held}
      taken: {from: [robot.take, source.held], to: robot.go, release: source}
"""


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        (
            "unless: source.held",
            "unless: not source.held",
            "a gate is one name, and no condition: write `if: source.held`",
        ),
        ("if: robot.near", "if: robot.near and not source.held", "write `if: robot.near, unless: source.held`"),
        ("[robot.take, source.held]", "'robot.take, source.held'", "write `from: [robot.take, source.held]`"),
    ],
)
def test_a_list_or_a_condition_in_the_place_of_a_name_is_told_as_the_file_says_it(
    old: str, new: str, hint: str
) -> None:
    assert old in TASK
    with pytest.raises(InputError) as refused:
        parse_tasks(TASK.replace(old, new))
    assert hint in refused.value.diagnostics[0].hint


def test_a_task_is_read_with_its_steps_moves_and_defaults() -> None:
    task = parse_tasks(TASK)["fetch"]
    assert [role.name for role in task.roles] == ["robot", "source"]
    move = Command("{robot.machine}", "MOVE", (("at", "{speed}"),))
    assert task.steps["robot.go"][1] == Step("go", "go", move, "{robot.prefix}there")
    assert task.steps["source.held"][1] == Step("held", "{source}_held")
    assert task.role("robot").inputs == (("near", "near"),)
    assert task.start == Move("start", (), ("robot.go", "source.held"), external=(Gate("robot", "near"),))
    assert task.end == Move("end", ("robot.take",))
    assert task.moves[0] == Move("a", ("robot.go",), ("robot.take",), inhibitive=("source.held",))
    assert task.moves[1].releases == ("source",)
    assert task.kept == ("robot",)
    assert task.released == {"source"}
    assert task.parameters == (("speed", "slow"),)
    with pytest.raises(KeyError):
        task.role("nobody")


def test_start_and_end_may_name_their_steps_and_subtasks() -> None:
    text = """\
firable_tasks: 1
tasks:
  outer:
    roles: {robot: {steps: {a: , b: }}}
    subtasks: {inside: {task: {name: inner, robot: robot, speed: fast}, description: "by {robot}"}}
    start: {to: inside}
    moves: {m: {from: inside, to: robot.b}}
    end: {from: [robot.b]}
"""
    task = parse_tasks(text)["outer"]
    assert task.subtasks[0].use == TaskUse("inner", (("robot", "robot"), ("speed", "fast")))
    assert task.start.targets == ("inside",)
    assert task.end.sources == ("robot.b",)


def test_a_template_is_filled() -> None:
    assert list(names_in_template("{a.b}_{c}x")) == ["a.b", "c"]
    assert filled("{a.b}_{c}x", {"a.b": "1", "c": "2"}) == "1_2x"


def test_the_shipped_tasks_validate_against_the_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())
    assert (
        list(jsonschema.Draft202012Validator(json_schema()).iter_errors(yaml.safe_load(FILE.read_text("utf-8")))) == []
    )
    assert read_tasks(FILE) == catalogue_tasks()
    assert all(task.description for task in catalogue_tasks().values())
    assert json.dumps(json_schema())


REFUSALS = (
    ("no file of tasks", "firable_tasks: 1", "firable: 1", "F1009 1:1"),
    ("another version", "firable_tasks: 1", "firable_tasks: 2", "F1011 1:16"),
    ("an unknown key", "    parameters:", "    paramters:", "F1008 4:5"),
    ("no roles", "    roles:", "    rules:", "F1008 5:5"),
    ("a name with a dot", "  fetch:", "  fe.tch:", None),
    ("a role with a dot", "      source:\n", "      sou.rce:\n", "F2012 11:7"),
    ("a reserved move", "      a: {", "      again: {", "F2012 16:7"),
    ("a reserved step", "          held:", "          idle:", "F2012 13:11"),
    ("a role and a parameter", "{speed: slow}", "{robot: slow}", "F2001"),
    ("a step and a sensor", "{near: }", "{take: }", "F2001 7:18"),
    ("an unknown step", "to: robot.take,", "to: robot.taek,", "F2025 16:31"),
    ("an unknown source", "from: robot.go,", "from: robot.gone,", "F2025 16:17"),
    ("an unknown role", "release: source", "release: sorce", "F2025 17:71"),
    ("a start that leads nowhere", "{if: robot.near}", "{if: robot.near, to: }", "F1010 14:29"),
    ("an end that comes from nowhere", "    moves:\n", "    end: {from: }\n    moves:\n", "F1010 15:11"),
    ("a time limit with no step", '"{robot.prefix}there"}', "x, within: {time: 1s, to: }}", "F1010 9:111"),
    ("an unknown sensor", "if: robot.near", "if: robot.neer", "F2025 14:17"),
    ("a step as gate of the start", "if: robot.near", "if: robot.go", "F2025 14:17"),
    ("twice", "[robot.take, source.held]", "[robot.take, robot.take]", "F2007 17:34"),
    ("a gate twice", "unless: source.held", "unless: [source.held, source.held]", "F2022 16:65"),
    ("a self-loop", "to: robot.take,", "to: robot.go,", "F2009 16:31"),
    ("a move from nowhere", "{from: robot.go, to", "{to", "F1009 16:7"),
    ("an unknown word", '"{source}_held"', '"{sorce}_held"', "F2026 13:25"),
    ("a key of a parameter", '"{speed}"', '"{speed.max}"', "F2026 9:70"),
    ("until without a command", '{place: "{source}_held"}', '{until: "{source}_held"}', "F2014 13:25"),
    ("a brace alone", '"{source}_held"', '"{source_held"', "F2026 13:25"),
)


@pytest.mark.parametrize(("old", "new", "found"), [row[1:] for row in REFUSALS], ids=[row[0] for row in REFUSALS])
def test_a_malformed_task_is_refused_where_it_is(old: str, new: str, found: str | None) -> None:
    text = TASK.replace(old, new, 1)
    assert text != TASK
    if found is None:  # a task may have any name that a net may use
        assert "fe.tch" in parse_tasks(text)
        return
    with pytest.raises(InputError) as refused:
        parse_tasks(text)
    said = [f"{d.code} {d.span.line}:{d.span.column}" for d in refused.value.diagnostics if d.span]
    assert any(one.startswith(found) for one in said), said
    assert all(d.hint for d in refused.value.diagnostics)


def test_a_key_that_holds_something_else_where_it_is_left_out_is_told_so() -> None:
    with pytest.raises(InputError, match=r"leave `to` out for what holds without it"):
        parse_tasks(TASK.replace("{if: robot.near}", "{to: }"))
    assert parse_tasks(TASK.replace("{if: robot.near}", "{to: []}"))["fetch"].start.targets == ()


def test_which_names_have_a_meaning_of_their_own_is_told() -> None:
    for old, new, hint in (
        ("      a: {", "      again: {", "take another name than again or end or start"),
        ("          held:", "          idle:", "take another name than given or idle"),
    ):
        with pytest.raises(InputError) as refused:
            parse_tasks(TASK.replace(old, new))
        assert refused.value.diagnostics[0].hint == hint


def test_all_mistakes_of_a_file_are_reported_together() -> None:
    text = TASK.replace("to: robot.take,", "to: x,").replace("release: source", "release: y").replace("{source}", "{z}")
    with pytest.raises(InputError) as refused:
        parse_tasks(text)
    assert [d.code for d in refused.value.diagnostics] == ["F2026", "F2025", "F2025"]


def test_a_file_that_is_too_large_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "large.tasks.yaml"
    with path.open("wb") as stream:
        stream.truncate(SIZE_BYTES_MAX + 1)
    with pytest.raises(InputError, match="F1003"):
        read_tasks(path)
