"""`firable rehearse`: what it says of runs that pass and of one that fails, and the mistakes of its users."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from multiprocessing import active_children
from pathlib import Path

import jsonschema
import pytest
from support.waiting import until

import firable.cli.rehearse
import firable.executor.simulation.campaign
from firable.analysis.check import check
from firable.cli.main import main
from firable.cli.rehearse import _subjects
from firable.decompose.bundling import make_bundle
from firable.executor.simulation.campaign import Campaign, Failed, Passed, Run
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.world import Machines
from firable.nets.bundle import write_bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net, Place, Transition
from firable.nets.pnml_writer import write_pnml

SCHEMA = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))


def told(capsys: pytest.CaptureFixture[str]) -> str:
    return capsys.readouterr().out


def test_runs_that_pass_are_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rehearse", "catalogue:one_robot", "--seeds", "20"]) == 0
    out = told(capsys)
    assert "each of 20 runs is a trace of the net, and goes on when everything is mended" in out
    assert "kills" in out


def test_the_report_is_of_the_schema_and_holds_no_measured_time(capsys: pytest.CaptureFixture[str]) -> None:
    documents = []
    for jobs in ("1", "2"):
        assert main(["rehearse", "drawn", "--seeds", "60", "--jobs", jobs, "--format", "json"]) == 0
        documents.append(told(capsys))
    assert documents[0] == documents[1]
    document = json.loads(documents[0])
    jsonschema.validate(document, SCHEMA)
    assert document["reports"][0]["run"]["runs"] == 60


def test_a_few_runs_are_shared_by_all_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    shared: list[list[int]] = []

    def share(_: str, chunks: Sequence[Sequence[Run]], __: int, ___: Campaign) -> None:
        shared.append([len(chunk) for chunk in chunks])
        raise KeyboardInterrupt

    monkeypatch.setattr(firable.cli.rehearse, "_share", share)
    for seeds, jobs in (("7", "3"), ("2", "8"), ("120", "2")):
        assert main(["rehearse", "catalogue:one_robot", "--seeds", seeds, "--jobs", jobs]) == 3
    assert shared == [[3, 3, 1], [1, 1], [50, 50, 20]]


@pytest.mark.parametrize("before", [0, 7])
def test_ctrl_c_shows_what_the_runs_until_then_came_to(
    before: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rehearsed = firable.executor.simulation.campaign.rehearse

    def rehearse(subject: Subject, run: Run, machines: Machines) -> Passed | Failed:
        if run.seed == before:
            raise KeyboardInterrupt
        return rehearsed(subject, run, machines)

    monkeypatch.setattr(firable.executor.simulation.campaign, "rehearse", rehearse)
    assert main(["rehearse", "drawn", "--seeds", "1000"]) == 3
    said = capsys.readouterr()
    if before:
        assert "? unknown   rehearsal  each of 7 runs is a trace of the net" in said.out
        assert "reached: 7 runs of 1,000; interrupted" in said.out
        assert "7 runs in" in said.err
    else:
        assert (said.out, said.err.strip()) == ("", "interrupted: nothing is known yet")


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_all_processes_and_shows_what_their_runs_came_to(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rehearsed, first = firable.executor.simulation.campaign.rehearse, os.getpid()

    def rehearse(subject: Subject, run: Run, machines: Machines) -> Passed | Failed:
        if run.seed == 70:
            os.kill(first, signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)  # a terminal sends it to all
        return rehearsed(subject, run, machines)

    monkeypatch.setattr(firable.executor.simulation.campaign, "rehearse", rehearse)
    assert main(["rehearse", "drawn", "--seeds", "100000", "--jobs", "2", "--format", "json"]) == 3
    said = capsys.readouterr()
    (report,) = json.loads(said.out)["reports"]
    runs = report["run"]["runs"]
    assert 20 < runs < 100_000, "those before the seed that interrupts, and those of the other process"
    assert report["verdicts"][0]["bound"] == f"{runs:,} runs of 100,000; interrupted"
    assert said.err == ""
    assert not active_children()


def test_ctrl_c_while_a_run_is_made_shorter_shows_it_as_it_was(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def shrunk(*_: object) -> Failed:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        firable.executor.simulation.campaign, "rehearse", lambda _, run, __: Failed(run, "a kind", "words", ())
    )
    monkeypatch.setattr(firable.executor.simulation.campaign, "shrunk", shrunk)
    assert main(["rehearse", "drawn", "--seeds", "2"]) == 1
    assert "firable rehearse drawn --seed 0" in told(capsys)


def test_a_run_that_fails_is_shown_with_its_last_steps_and_the_command_that_brings_it_back(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from support.planted import DecidesEarly

    planted = Machines(coordinator=DecidesEarly)
    monkeypatch.setattr(firable.executor.simulation.campaign, "REAL", planted)
    for function in ("rehearse", "campaign", "shrunk"):
        made = getattr(firable.executor.simulation.campaign, function)
        monkeypatch.setattr(made, "__defaults__", (planted,))
    assert main(["rehearse", "catalogue:one_robot", "--seeds", "30", "--format", "json"]) == 1
    document = json.loads(told(capsys))
    jsonschema.validate(document, SCHEMA)
    command = document["reports"][0]["run"]["failed"][0]["command"]
    assert command.startswith("firable rehearse catalogue:one_robot --seed ")
    assert main(command.split()[1:]) == 1
    out = told(capsys)
    assert "the last steps:" in out
    assert command in out


def test_what_is_rehearsed_is_what_a_bundle_of_the_net_runs(tmp_path: Path) -> None:
    net = catalogue_net("one_robot")
    made = make_bundle(check(net))
    assert made.decomposition.free
    write_bundle(tmp_path / "cell.bundle", made)
    assert _subjects("catalogue:one_robot")(0).decomposition == made.decomposition
    promising = replace(made, decomposition=replace(made.decomposition, free=()))
    write_bundle(tmp_path / "promising.bundle", promising)
    for name, bundle in (("cell", made), ("promising", promising)):
        assert _subjects(str(tmp_path / f"{name}.bundle"))(0).decomposition == bundle.decomposition


def test_a_kind_of_fault_that_there_is_not_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rehearse", "catalogue:one_robot", "--faults", "los"]) == 2
    error = capsys.readouterr().err
    assert "there is no fault 'los'" in error
    assert "loss, duplication" in error


def test_a_net_without_owners_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = Net("net", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)),))
    (tmp_path / "net.pnml").write_text(write_pnml(net)[0])
    assert main(["rehearse", str(tmp_path / "net.pnml")]) == 2
    assert "owner" in capsys.readouterr().err


def test_every_kind_of_fault_is_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    from firable.executor.simulation.faults import KINDS

    assert main(["rehearse", "--help"]) == 0
    words = told(capsys).replace("\n", " ").replace(",", " ").replace(".", " ").split()
    assert not [kind for kind in KINDS if kind not in words]


@pytest.mark.parametrize("more", [("--seeds", "3"), ("--from", "0"), ("--jobs", "2")])
def test_one_run_alone_takes_nothing_that_is_for_many(
    more: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["rehearse", "catalogue:one_robot", "--seed", "1", *more]) == 2
    assert f"--seed is one run alone, and {more[0]} is for many" in capsys.readouterr().err


def test_processes_that_share_the_runs_end_with_the_first_one_however_that_ends() -> None:
    command = (
        sys.executable,
        "-m",
        "firable.cli",
        "rehearse",
        "catalogue:one_robot",
        "--seeds",
        "100000",
        "--jobs",
        "2",
    )
    first = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def runs(pid: str) -> bool:
        try:
            return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
        except OSError:
            return False

    def sharing() -> list[str]:
        return Path(f"/proc/{first.pid}/task/{first.pid}/children").read_text().split()

    until(lambda: len(sharing()) == 2, "the processes")
    its = sharing()
    first.kill()
    first.wait()
    until(lambda: not any(map(runs, its)), "their end")
