"""Nets in a project's CI: the workflows of `ci init`, folders of nets, the pre-commit hook, the pytest plugin."""

import errno
import json
import os
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from firable.cli.main import main
from firable.nets.catalogue import catalogue_path, family_net
from firable.nets.printing import format_net

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[2]
WORKFLOW = ".github/workflows/firable.yml"
LATE = catalogue_path("one_robot_mc_late").read_text("utf-8")
SAFE = catalogue_path("one_robot").read_text("utf-8")
KNOWN = "\nexpect:\n  deadlock-free: violated\n  property.no_deadlock: violated\n  property.restart: violated\n"
PLUGIN = ("-p", "no:firable", "-p", "firable.cli.pytest_plugin", "-p", "no:cacheprovider")


def fits(schema: str, file: Path) -> bool:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", str(file)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with two nets, one below the other, and one in a hidden folder that nobody shall check."""
    (tmp_path / "cells/late").mkdir(parents=True)
    (tmp_path / "cells/safe.firable.yaml").write_text(SAFE, "utf-8")
    (tmp_path / "cells/late/late.firable.yaml").write_text(LATE + KNOWN, "utf-8")
    (tmp_path / ".cache").mkdir()
    (tmp_path / ".cache/broken.firable.yaml").write_text("firable: 2\n", "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("site", "file", "schema", "wrong"),
    [
        ("github", WORKFLOW, "github-workflows", ("runs-on:", "runs-where:")),
        ("gitlab", ".gitlab/firable.yml", "gitlab-ci", ("script:", "scrpt:")),
    ],
)
def test_a_workflow_is_what_its_site_takes(
    project: Path, site: str, file: str, schema: str, wrong: tuple[str, str]
) -> None:
    assert main(["ci", "init", "--for", site]) == 0
    assert fits(schema, project / file)
    (project / file).write_text((project / file).read_text("utf-8").replace(*wrong), "utf-8")
    assert not fits(schema, project / file)


def check_of(steps: list[Any]) -> list[str]:
    """The arguments of the command in a workflow that checks the nets."""
    (command,) = (step["run"] for step in steps if step.get("run", "").startswith("firable check"))
    return shlex.split(command)[1:]


def test_the_check_of_the_workflow_passes_and_fails_as_the_nets_do(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ci", "init"]) == 0
    workflow = yaml.safe_load((project / WORKFLOW).read_text("utf-8"))
    steps = workflow["jobs"]["check"]["steps"]
    arguments = check_of(steps)
    capsys.readouterr()
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "::error" not in told
    assert told.index("cells/late/late.firable.yaml") < told.index("cells/safe.firable.yaml")
    assert next(step for step in steps if "upload-sarif" in step.get("uses", ""))["continue-on-error"] is True
    uploaded = [step["with"] for step in steps if "with" in step and {"sarif_file", "path"} & set(step["with"])]
    wanted = {uploaded[0]["sarif_file"], *uploaded[1]["path"].split()}
    assert {path.name for path in project.iterdir() if path.is_file()} == wanted
    (project / "cells/late/late.firable.yaml").write_text(LATE, "utf-8")
    assert main(arguments) == 1
    assert "::error file=cells/late/late.firable.yaml,line=" in capsys.readouterr().out


def test_a_workflow_is_never_written_over(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / ".github/workflows").mkdir(parents=True)
    (project / WORKFLOW).write_text("mine", "utf-8")
    assert main(["ci", "init"]) == 2
    assert "error[F1017]" in capsys.readouterr().err
    assert (project / WORKFLOW).read_text("utf-8") == "mine"


def test_a_requirement_cannot_leave_its_quotes(project: Path) -> None:
    for requirement in ("firable'; rm", "firable # of today", "firable @ file: x", "a\rb", "a\x85b", "a\udc85"):
        assert main(["ci", "init", "--install", requirement]) == 2
    assert not (project / WORKFLOW).exists()
    assert main(["ci", "init", "--install", "./firable[prove]"]) == 0
    assert "pip install './firable[prove]'" in (project / WORKFLOW).read_text("utf-8")


def test_a_folder_without_nets_is_refused(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "empty").mkdir()
    assert main(["check", "empty"]) == 2
    assert "error[F1001]: no net file is in empty\n" in capsys.readouterr().err
    assert main(["draw", "cells"]) == 2
    assert "cells:1:1: error[F1001]: this is a directory\n  hint: name a file in it" in capsys.readouterr().err


def test_a_folder_with_more_folders_below_it_than_a_project_has_is_refused(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [project, project / "cells", project / "cells/late"]
    monkeypatch.setattr("firable.cli.files.FOLDERS_MAX", len(folders))
    assert main(["check", "."]) == 0
    monkeypatch.setattr("firable.cli.files.FOLDERS_MAX", len(folders) - 1)
    capsys.readouterr()
    for more in ((), ("--machines", "catalogue:one_robot"), ("--write", "json", "report.json")):
        assert main(["check", ".", *more]) == 2
        told = capsys.readouterr().err
        assert "error[F1001]: .: more than 2 folders are below it, and are not searched for nets\n" in told
        assert "hint: name the folder of a project, or net files" in told
    assert main(["check", "cells/late", ".", "--format", "json"]) == 2
    document = json.loads(capsys.readouterr().out)
    assert [one["input"] for one in document["reports"]] == ["cells/late/late.firable.yaml"]
    assert [one["code"] for one in document["errors"]] == ["F1001"]


@pytest.mark.parametrize(
    "command",
    [
        ("bundle", "-o", "x.bundle"),
        ("convert", "-o", "x.pnml"),
        ("draw",),
        ("draw", "-o", "x.svg"),
        ("prove", "--write", "json", "x.json"),
        ("refine", "-o", "x.firable.yaml"),
        ("rehearse",),
        ("replay", "-o", "x.trace", "--net", "catalogue:one_robot"),
        ("run", "--trace", "x.trace"),
        ("sim", "--modbus"),
        ("split", "-o", "x.firable.yaml", "--suggest", "2"),
        ("timeline", "-o", "x.svg", "--net", "catalogue:one_robot"),
        ("verify", "--write", "json", "x.json"),
        ("view", "--no-browser"),
    ],
    ids=" ".join,
)
def test_a_folder_is_searched_by_check_alone_and_refused_by_others_at_once(
    command: tuple[str, ...], project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def walk(*_: object, **__: object) -> None:
        raise AssertionError("the folder is searched")

    (project / "other").mkdir()
    monkeypatch.setattr(os, "walk", walk)
    for folder in ("cells", "other"):
        assert main([command[0], folder, *command[1:]]) == 2
        assert f"{folder}:1:1: error[F1001]: this is a directory\n  hint: name a file in it" in capsys.readouterr().err


def test_a_folder_that_may_not_be_looked_into_is_told_and_the_others_are_checked(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "cells/locked").mkdir()
    looked_into, known = os.scandir, Path.stat

    def scandir(path: str | Path = ".") -> Iterator[os.DirEntry[str]]:
        if Path(path).name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return looked_into(path)

    def stat(path: Path, **options: bool) -> os.stat_result:
        if path.parent.name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return known(path, **options)

    monkeypatch.setattr(os, "scandir", scandir)
    monkeypatch.setattr(Path, "stat", stat)
    assert main(["check", ".", "--format", "json"]) == 2
    document = json.loads(capsys.readouterr().out)
    assert [one["input"] for one in document["reports"]] == ["cells/late/late.firable.yaml", "cells/safe.firable.yaml"]
    assert [(one["file"], one["message"]) for one in document["errors"]] == [
        ("cells/locked", "cannot be read: Permission denied")
    ]
    assert main(["draw", "cells/locked"]) == 2
    assert "cells/locked:1:1: error[F1001]: cannot be read: Permission denied" in capsys.readouterr().err


def test_a_net_file_of_a_folder_that_may_only_be_listed_is_told(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    known = Path.stat

    def stat(path: Path, **options: bool) -> os.stat_result:
        if path.name == "safe.firable.yaml":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return known(path, **options)

    monkeypatch.setattr(Path, "stat", stat)
    assert main(["check", "cells"]) == 2
    told = capsys.readouterr()
    assert "cells/safe.firable.yaml:1:1: error[F1001]: cannot be read: Permission denied" in told.err
    assert "cells/late/late.firable.yaml" in told.out


def test_all_nets_of_a_project_are_checked_and_none_that_is_installed_there(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (project / "cells/short.firable.yml").write_text(SAFE, "utf-8")
    (project / "env/lib").mkdir(parents=True)
    (project / "env/pyvenv.cfg").touch()
    (project / "env/lib/broken.firable.yaml").write_text("firable: 2\n", "utf-8")
    (project / "web/node_modules/cells").mkdir(parents=True)
    (project / "web/node_modules/cells/broken.firable.yaml").write_text("firable: 2\n", "utf-8")
    assert main(["check", ".", "--format", "json"]) == 0
    reports = json.loads(capsys.readouterr().out)["reports"]
    assert [one["input"] for one in reports] == [
        "cells/late/late.firable.yaml",
        "cells/safe.firable.yaml",
        "cells/short.firable.yml",
    ]


def test_the_pre_commit_hook_is_one_and_brings_what_checking_needs() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pre_commit", "validate-manifest", str(ROOT / ".pre-commit-hooks.yaml")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text("utf-8"))
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    assert hook["additional_dependencies"] == extras["prove"]
    assert hook["entry"] == "firable check"


@pytest.fixture(autouse=True)
def no_other_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plugins that are installed here beside ours take longer to load than these nets to check."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def outcomes(pytester: pytest.Pytester, *arguments: str) -> tuple[dict[str, int], str]:
    done = pytester.runpytest_subprocess(*PLUGIN, *arguments)
    told = done.stdout.str() + done.stderr.str()
    return {} if "no tests ran" in told else done.parseoutcomes(), told


def test_each_verdict_that_matters_is_a_test(pytester: pytest.Pytester) -> None:
    (pytester.path / "late.firable.yaml").write_text(LATE, "utf-8")
    found, told = outcomes(pytester, "-v")
    assert found == {"passed": 6, "failed": 3}
    assert "late.firable.yaml::deadlock-free FAILED" in told
    assert "late.firable.yaml::property.cv1_held_while_grasped PASSED" in told
    assert " 15. t1-b  arrived at MC with the workpiece" in told
    assert "robot.put_mc (putting on MC) waits in G4 for mc.free, which comes from mc.release by G6 and G7" in told
    assert "cure: give G2 the gate `unless: system.processing`" in told
    found, told = outcomes(pytester, "-k", "restart")
    assert found == {"failed": 1, "deselected": 8}


@pytest.mark.parametrize("workers", [(), ("-p", "xdist", "-n", "1")])
def test_the_story_of_a_verdict_is_told_once_also_in_ci(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, workers: tuple[str, ...]
) -> None:
    monkeypatch.setenv("CI", "true")  # where the summary of pytest shows all of a message
    (pytester.path / "late.firable.yaml").write_text(LATE, "utf-8")
    told = outcomes(pytester, "-k", "restart", "--junitxml", "report.xml", *workers)[1]
    if not workers:  # these hand on no more than the text
        assert told.count("from the initial marking fire:") == 1
        assert "::property.restart - ✗ violated  property.restart  from every reachable marking" in told
    report = (pytester.path / "report.xml").read_text("utf-8")
    assert "1. G1    start of carrying in" in report


def test_what_the_file_expects_passes_and_a_change_fails(pytester: pytest.Pytester) -> None:
    path = pytester.path / "late.firable.yaml"
    path.write_text(f"{LATE}{KNOWN}  live: violated\n", "utf-8")
    assert outcomes(pytester)[0] == {"passed": 10}
    path.write_text(f"{LATE}{KNOWN}  home-markings: violated\n  loop.live: violated\n", "utf-8")
    found, told = outcomes(pytester)
    assert found == {"passed": 9, "failed": 1}
    assert "hint: [F3024] the file expects violated, and it is proved; where that is right, write `" in told


def test_a_net_that_cannot_be_read_is_an_error_of_the_collection(pytester: pytest.Pytester) -> None:
    (pytester.path / "bad.firable.yaml").write_text("firable: 1\ncell: c\nplces: {}\n", "utf-8")
    found, told = outcomes(pytester)
    assert found == {"errors": 1}
    assert "bad.firable.yaml:3:1: error[F1008]: unknown key 'plces'" in told


def test_an_expectation_of_no_verdict_fails_every_test_of_its_file(pytester: pytest.Pytester) -> None:
    (pytester.path / "a.firable.yaml").write_text(f"{SAFE}\nexpect:\n  deadlok: violated\n", "utf-8")
    found, told = outcomes(pytester)
    assert set(found) == {"failed"}
    assert "F2030" in told


def test_settings_turn_collecting_off_and_bound_the_time(pytester: pytest.Pytester) -> None:
    (pytester.path / "late.firable.yaml").write_text(LATE, "utf-8")
    pytester.makeini("[pytest]\nfirable_collect = false\n")
    assert outcomes(pytester)[0] == {}
    (pytester.path / "large.firable.yaml").write_text(format_net(family_net("philosophers-12")), "utf-8")
    pytester.makeini("[pytest]\nfirable_max_seconds = 0\n")
    told = outcomes(pytester, "large.firable.yaml", "-v")[1]
    assert "large.firable.yaml::deadlock-free FAILED" in told
    assert "? unknown   deadlock-free" in told


@pytest.mark.parametrize("seconds", ["soon", "-1", "nan", "inf"])
def test_a_bound_that_is_no_number_of_seconds_is_refused_once(pytester: pytest.Pytester, seconds: str) -> None:
    (pytester.path / "late.firable.yaml").write_text(LATE, "utf-8")
    pytester.makeini(f"[pytest]\nfirable_max_seconds = {seconds}\n")
    ended = pytester.runpytest_subprocess(*PLUGIN)
    assert ended.ret is pytest.ExitCode.USAGE_ERROR
    ended.stderr.fnmatch_lines([f"ERROR: firable_max_seconds: '{seconds}' is no number of seconds"])


def test_the_plugin_is_announced_to_pytest() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"firable": "firable.cli.pytest_plugin"}
