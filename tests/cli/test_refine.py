"""`firable refine`, as an engineer sees it."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
from support.published import COORDINATOR_TABLE

from firable.cli.main import main
from firable.nets import catalogue_net, read_net
from firable.semantics.player import Player

OWN = """\
firable_tasks: 1
tasks:
  process:
    parameters: {program: }
    roles: {machine: {steps: {run: , stop: , stuck: }}}
    moves:
      a: {from: machine.run, to: machine.stop}
      b: {from: machine.run, to: machine.stuck, description: the tool breaks}
    end: {from: machine.stop}
"""


def refined(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = main(["refine", *arguments])
    return code, capsys.readouterr().out


def test_refining_prints_what_was_opened_the_table_and_what_carries_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "cell.firable.yaml"
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "-o", str(output), "--cell", "one-robot")
    assert code == 0
    assert "system.loading is opened by load (robot robot, target mc, source cv1): 8 steps, 4 moves" in said
    assert all(line in said for line in COORDINATOR_TABLE.splitlines())
    assert "✓ load       ends, ends-clean, contact-free, complete, settles, orderly" in said
    assert "proved    deadlock-free" in said
    assert "bisimilar.branching" in said
    assert f"the detailed net is in {output}" in said
    assert len(read_net(output).transitions) == len(catalogue_net("one_robot").transitions)
    assert main(["check", str(output)]) == 0
    assert main(["prove", str(output)]) == 0


def test_a_task_that_can_get_stuck_is_refused_with_its_trace_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tasks, output = tmp_path / "own.tasks.yaml", tmp_path / "cell.firable.yaml"
    tasks.write_text(OWN)
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "--tasks", str(tasks), "-o", str(output))
    assert code == 1
    assert not output.exists()
    assert "process.ends" in said
    assert "2. b      the tool breaks" in said
    assert "from here the task can never end" in said
    assert "nothing was opened or written" in said


def test_a_refused_task_is_told_in_words_with_who_names_it_and_who_is_refused_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = files("firable.nets").joinpath("catalogue", "cell.tasks.yaml").read_text(encoding="utf-8")
    whole = "        if: target.present\n"
    assert whole in shipped
    tasks = tmp_path / "own.tasks.yaml"
    tasks.write_text(shipped.replace(whole, "        if: [target.present, robot.approach]\n"))
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "--tasks", str(tasks))
    assert code == 1
    assert "system.loading names it, with robot robot, target mc, source cv1" in said
    assert "1. start  start of loading from source" in said
    assert "here 'placed' has all that it comes from, but 'robot.approach' holds no token" in said
    assert "{" not in said
    tasks.write_text(
        "firable_tasks: 1\ntasks:\n"
        "  process: {parameters: {program: }, roles: {m: {steps: {a: , b: }}},\n"
        "    subtasks: {in: {task: {name: hold, of: m}}},\n"
        "    start: {to: in}, moves: {x: {from: in, to: m.b}, y: {from: in, to: m.a}}, end: {from: m.b}}\n"
        "  hold: {roles: {of: {steps: {a: , b: }}}}\n"
    )
    net = tmp_path / "net.firable.yaml"
    net.write_text(
        "firable: 1\ncell: c\ncontrollers:\n  s:\n    start: [m]\n    places:\n"
        "      work: {task: {name: process, m: m, program: O1}}\n      m: {opens: {to: mc.free, machine: MC}}\n"
        "  mc: {description: machine}\ntransitions:\n  begin: {from: s.m, to: s.work}\n  end: {from: s.work, to: s.m}\n"
    )
    code, said = refined(capsys, str(net), "--tasks", str(tasks))
    assert code == 1
    assert "the task 'process' is refused" in said
    assert "refused too, and told when this is mended: 'hold'" in said


def test_a_task_that_releases_twice_is_refused_with_the_run_that_shows_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = files("firable.nets").joinpath("catalogue", "cell.tasks.yaml").read_text(encoding="utf-8")
    whole = "        if: target.present\n"
    tasks = tmp_path / "own.tasks.yaml"
    tasks.write_text(shipped.replace(whole, f"{whole}        release: source\n"))
    assert main(["refine", "catalogue:conceptual_one_robot", "--tasks", str(tasks)]) == 2
    said = capsys.readouterr().err
    assert "error[F4012]: 'placed' of the task 'load' frees 'source', which nobody holds there; " in said
    assert "after 'start, a, grasped, b' the tokens are on 'load, robot.put, target.wait, source.idle'" in said


def test_the_json_of_refining_has_the_shape_of_every_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    schema = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
    late = "catalogue:conceptual_one_robot_mc_late"
    for argument, code in (("catalogue:conceptual_two_robots", 0), (late, 2)):
        found, said = refined(capsys, argument, "--format", "json")
        assert found == code
        document = json.loads(said)
        jsonschema.validate(document, schema)
        assert document["command"] == "refine"
        assert bool(document["errors"]) is (code == 2)


def test_own_tasks_come_before_those_of_the_catalogue_and_two_of_one_name_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = tmp_path / "one.tasks.yaml", tmp_path / "two.tasks.yaml"
    one.write_text(OWN.replace("      b: {from: machine.run, to: machine.stuck, description: the tool breaks}\n", ""))
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "--tasks", str(one), "--no-confirm")
    assert code == 0
    assert "process (machine mc): 3 steps, 1 move" in said
    assert "bisimilar" not in said
    two.write_text(one.read_text())
    assert main(["refine", "catalogue:conceptual_one_robot", "--tasks", str(one), "--tasks", str(two)]) == 2
    assert "error[F2001]" in capsys.readouterr().err


def test_a_budget_that_ends_leaves_unknown(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "--confirm", "--max-markings", "30")
    assert code == 0
    assert "? unknown   bisimilar.weak" in said


def test_a_violated_property_of_the_conceptual_net_is_told_in_the_detailed_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "net.firable.yaml"
    path.write_text(
        "firable: 1\ncell: c\ncontrollers:\n  s:\n    coordinator: true\n    start: [m, n]\n    places:\n"
        "      work: {task: {name: process, machine: m, program: O1}}\n      m: {opens: {to: mc.free, machine: MC}}\n"
        "      n:\n  mc: {description: machine}\ntransitions:\n  begin: {from: s.m, to: s.work}\n"
        "  end: {from: [s.work, s.n], to: s.m}\n"
    )
    output = tmp_path / "out.firable.yaml"
    code, said = refined(capsys, str(path), "-o", str(output))
    assert code == 1
    assert "t1-a  fixed" in said
    net = read_net(output)
    player = Player(net)
    assert any(player.deadlocked(marking) for marking in player.reachable())


def test_a_detailed_net_of_which_no_bundle_can_be_made_is_told_where_the_conceptual_one_is_at_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = tmp_path / "net.firable.yaml", tmp_path / "out.firable.yaml"
    path.write_text(
        "firable: 1\ncell: c\ncontrollers: {mc: }\nstart: m\nplaces:\n"
        "  work: {task: {name: process, machine: m, program: O1}}\n  m: {opens: {to: mc.free, machine: MC}}\n"
        "transitions: {t: {from: m, to: work}, u: {from: work, to: m}}\n"
    )
    assert main(["refine", str(path), "-o", str(output)]) == 0
    assert capsys.readouterr().err.startswith(
        f"{path}:6:3: warning[F2011]: no bundle can be made of the detailed net: 'work' has no owner"
    )
    assert main(["bundle", str(output), "-o", str(tmp_path / "c.bundle")]) == 2
    assert "error[F2011]: 'work' has no owner" in capsys.readouterr().err


def test_evidence_is_written_and_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "evidence"
    code, said = refined(capsys, "catalogue:conceptual_one_robot", "--evidence", str(folder), "--no-confirm")
    assert code == 0
    documents = sorted(folder.iterdir())
    assert [file.name.partition(".")[0] for file in documents] == [
        *("carry_in", "carry_out", "conceptual-one-robot", "load", "process", "unload")
    ]
    assert said.replace("\n", "").count("evidence: firable verify") == 6
    assert main(["verify", *map(str, documents)]) == 0
    assert main(["refine", "catalogue:conceptual_one_robot", "--cell", "one", "--evidence", str(folder)]) == 0
    assert main(["verify", str(folder / "one.detailed.evidence.json")]) == 0
    assert "✓ shown  property.ends-clean" in capsys.readouterr().out


def test_the_schema_of_files_of_tasks_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "tasks"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "firable file of tasks"


def test_what_was_refined_is_bundled_with_where_it_comes_from_and_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell, bundle = str(tmp_path / "cell.firable.yaml"), str(tmp_path / "cell.bundle")
    own = tmp_path / "own.tasks.yaml"
    own.write_text(
        OWN.replace(", stuck: ", "").replace(
            "      b: {from: machine.run, to: machine.stuck, description: the tool breaks}\n", ""
        )
    )
    arguments = ["catalogue:conceptual_one_robot", "--tasks", str(own)]
    assert refined(capsys, *arguments, "-o", cell)[0] == 0
    assert main(["bundle", cell, "--conceptual", *arguments, "-o", bundle]) == 0
    assert main(["verify", bundle]) == 0
    assert "refinement       the net is what registered tasks make" in capsys.readouterr().out
    assert main(["bundle", cell, "--conceptual", arguments[0], "-o", bundle]) == 2
    assert "error[F4003]: the net is not what its tasks make of 'conceptual-one-robot'" in capsys.readouterr().err
