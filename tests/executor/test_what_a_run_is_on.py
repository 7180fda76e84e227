"""A journal tells where the tokens of a run stand that commanded these machines, and of no other run."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from support.takeovers import bundle

from firable.cli.main import main
from firable.executor.journal.journal import sync_now
from firable.executor.operating.taken_up import On, opened
from firable.executor.protocol.messages import Keep
from firable.nets.bundle import Bundle, read_bundle
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError

RUNS = {
    On.MACHINES: "a run on the machines of a binding",
    On.SIMULATED: "a run on a simulated cell",
    On.NOTHING: "a dry run",
}
PLANT = ("--plant", "catalogue:one_robot", "--workpieces", "1")


@pytest.fixture(scope="module")
def one_robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bundle(tmp_path_factory.mktemp("bundles"), "cell", catalogue_path("one_robot").read_text("utf-8"))


def begun(journal: Path, read: Bundle, on: On) -> Path:
    """The journal of a run that has begun, and stopped."""
    with opened(read.decomposition, read.digest, journal, None, on=on) as files:
        files.journal.write("robot", [Keep("epoch", 1)])
        sync_now(files.journal)
    return journal


def test_a_journal_of_a_run_on_something_else_is_refused(one_robot: Path, tmp_path: Path) -> None:
    read = read_bundle(one_robot)
    for on in On:
        journal = begun(tmp_path / on.name, read, on)
        for other in On:
            if other is on:
                begun(journal, read, on)
                continue
            with pytest.raises(InputError) as refusal:
                begun(journal, read, other)
            (problem,) = refusal.value.diagnostics
            assert (problem.code, problem.message) == (
                "F5031",
                f"{journal}: the journal is of {RUNS[on]}, and this is {RUNS[other]}",
            )


def test_machines_do_not_go_on_where_a_simulation_has_stopped(
    one_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its tokens stand where no machine is: what they wait for next would be commanded."""
    journal, taken = str(tmp_path / "cell.journal"), str(tmp_path / "new.journal")
    assert main(["run", str(one_robot), *PLANT, "--journal", journal]) == 0
    (new := tmp_path / "new").mkdir()
    text = catalogue_path("one_robot").read_text("utf-8").replace("program: O0001", "program: O0002")
    later = bundle(new, "cell", text)
    binding = tmp_path / "cell.bind.yaml"
    shutil.copy(catalogue_path("one_robot").with_name("one_robot.bind.yaml"), binding)
    everybody = [f"--controller={name}" for name in ("system", "robot", "mc", "conveyor")]
    as_hosts = [*everybody, "--join", "tcp/127.0.0.1:9"]
    capsys.readouterr()
    for on, arguments in (
        (On.MACHINES, ["--bind", str(binding)]),
        (On.MACHINES, [*as_hosts, "--bind", str(binding)]),
        (On.NOTHING, [*as_hosts, "--dry-run", "1"]),
    ):
        assert main(["run", str(one_robot), *arguments, "--journal", journal, "--resume"]) == 2
        assert f"error[F5031]: {journal}: the journal is of a run on a simulated cell, and this is {RUNS[on]}" in (
            capsys.readouterr().err
        )
    assert main(["takeover", str(one_robot), str(later), "--journal", journal, "--into", taken]) == 0
    assert main(["run", str(later), "--bind", str(binding), "--journal", taken, "--resume"]) == 2
    assert "F5031" in capsys.readouterr().err
    assert main(["run", str(later), *PLANT, "--journal", taken, "--resume"]) == 0


def test_who_gives_the_same_command_again_without_a_journal_is_told_to_name_another_trace(
    one_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").with_name("one_robot.bind.yaml").read_text("utf-8")
    binding, trace = tmp_path / "cell.bind.yaml", tmp_path / "cell.trace"
    nowhere = text.replace("15020", "1").replace("14840", "1")
    binding.write_text(re.sub(r"(?m)^    driver: .*$", r"\g<0>\n    start_s: 0.1", nowhere))
    command = ["run", str(one_robot), "--bind", str(binding), "--trace", str(trace)]
    assert main(command) == 1
    assert "bring the cell to its initial marking first, and name another --trace" in capsys.readouterr().out
    assert main(command) == 2
    assert f"error[F1017]: {trace}: the trace of this run begins anew" in capsys.readouterr().err
    assert main([*command[:-1], str(tmp_path / "another.trace")]) == 1
