"""`firable run` with an operator at the terminal: steps, stops, Ctrl-C, and the files that a run may write."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from unittest.mock import Mock

import jsonschema
import pytest
from support.cells import decomposition_of, plant_of
from support.waiting import PATIENCE_SECONDS, heard_in_time, until

from firable.cli import bound_run, hosting
from firable.cli.bound_run import run_bound_of
from firable.cli.main import main
from firable.cli.simulated_run import _verdicts
from firable.executor import RunReport, SimulatedCell, execute
from firable.executor.cell.disturbances import NeverCompletes
from firable.executor.operating import running
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.situation import Situation, State
from firable.nets.bundle import read_bundle
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.rules import hints_of
from firable.nets.verdict import Status
from firable.semantics.joining import VOTED
from firable.semantics.replaying import replay
from firable.semantics.trace import Noted, read_trace

PLANT = catalogue_path("one_robot").with_name("one_robot.plant.yaml")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A bundle of the one-robot cell."""
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


LATE = ("--watch", "ignore")
"""Of a run in real time: on a busy machine the simulated cell is late, which the monitor may tell."""


def typed(lines: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`firable run` with what the operator types; a run that never ends fails by its time limit."""
    return subprocess.run(
        [sys.executable, "-m", "firable.cli", "run", *arguments],
        input=lines,
        capture_output=True,
        text=True,
        check=False,
        timeout=2 * PATIENCE_SECONDS,
    )


def stepped(said: str) -> list[str]:
    """The transitions that were fired by a step, in order."""
    return re.findall(r"^.*?\d\.\d s  (\S+)  ", said, re.MULTILINE)


def notes_of(trace: Path) -> list[str]:
    """The notes in a trace, and why it ended; the trace must be one of the net, and whole."""
    read = read_trace(trace)
    assert replay(catalogue_net("one_robot"), read).complete
    assert read.end is not None
    return [*(event.note for event in read.events if isinstance(event, Noted) and event.note != VOTED), read.end.reason]


def test_plant_file_beside_the_bundle_is_the_one_that_is_run(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = tmp_path / "turning.bundle"
    shutil.copy(bundle, cell)
    beside = tmp_path / "turning.plant.yaml"
    beside.write_text(PLANT.read_text("utf-8").replace("station: cv1_entry", "station: nowhere"), "utf-8")
    assert main(["run", str(cell)]) == 2  # that of the catalogue has no mistake
    assert "turning.plant.yaml" in capsys.readouterr().err
    shutil.copy(PLANT, beside)
    assert main(["run", str(cell), "--workpieces", "2"]) == 0
    beside.unlink()
    assert main(["run", str(cell), "--workpieces", "2"]) == 0  # the net is one of the catalogue


@pytest.mark.parametrize("last", ["s\n", ""], ids=["s", "end of input"])
@pytest.mark.parametrize("speed", ["max", "10"])
def test_steps_are_fired_one_by_one_until_the_operator_stops(
    speed: str, last: str, bundle: str, tmp_path: Path
) -> None:
    trace = tmp_path / "trace"
    options = ("--speed", speed, "--trace", str(trace), *(LATE if speed != "max" else ()))
    done = typed(f"\n\n{last}", bundle, "--workpieces", "1", "--step", *options)
    assert done.returncode == 3, done.stdout + done.stderr
    assert stepped(done.stdout) == ["G1", "G2", "t1-a"]
    assert notes_of(trace) == ["paused", "stopped by the operator", "stopped"]


def test_a_run_goes_on_after_steps(bundle: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    done = typed("\nr\n", bundle, "--workpieces", "2", "--step", "--trace", str(trace))
    assert done.returncode == 0, done.stdout + done.stderr
    assert stepped(done.stdout) == ["G1", "G2"]
    assert "2 workpieces carried through" in done.stdout
    assert notes_of(trace) == ["paused", "resumed", "done"]


def test_every_firing_is_one_of_the_steps_where_the_operator_only_steps(bundle: str) -> None:
    done = typed("\n" * 15, bundle, "--workpieces", "1", "--step")
    assert (done.returncode, len(stepped(done.stdout))) == (0, 15), done.stdout + done.stderr


def test_a_run_stops_at_the_end_of_the_cycle(bundle: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    done = typed("\ne\n", bundle, "--workpieces", "50", "--step", "--trace", str(trace))
    assert done.returncode == 3, done.stdout + done.stderr
    assert "0 still inside" in done.stdout
    assert "0 workpieces carried through" not in done.stdout
    assert notes_of(trace) == ["paused", "stopping at the end of the cycle", "resumed", "stopped"]


def test_a_key_that_means_nothing_is_asked_for_again(bundle: str) -> None:
    done = typed("x\n S \n", bundle, "--workpieces", "1", "--step")
    assert stepped(done.stdout) == ["G1"]
    assert done.stdout.count("[e] stop at the end of the cycle") == 2


def test_enter_pauses_a_run_that_runs_on_in_real_time(bundle: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    typed("r\n\ns\n", bundle, "--workpieces", "1", "--step", "--speed", "10", *LATE, "--trace", str(trace))
    assert notes_of(trace) == ["paused", "resumed", "paused", "stopped by the operator", "stopped"]


def test_the_dialogue_keeps_out_of_the_json(bundle: str) -> None:
    done = typed("\ns\n", bundle, "--workpieces", "1", "--step", "--format", "json")
    assert json.loads(done.stdout)["reports"][0]["run"]["state"] == "stopped"
    assert stepped(done.stderr) == ["G1", "G2"]


INTERRUPT, TERMINATE = signal.SIGINT, signal.SIGTERM


@pytest.mark.parametrize(
    ("steps", "sent"),
    [
        (["--speed", "1"], INTERRUPT),
        (["--speed", "1", "--step"], INTERRUPT),
        (["--speed", "max", "--step"], INTERRUPT),
        (["--speed", "1"], TERMINATE),
    ],
)
def test_interrupt_and_terminate_end_a_run_in_order(
    steps: list[str], sent: signal.Signals, bundle: str, tmp_path: Path
) -> None:
    trace = tmp_path / "trace"
    options = [*LATE, "--trace", str(trace), *steps]
    command = [sys.executable, "-m", "firable.cli", "run", bundle, *options]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        if "--step" in steps:
            shown = ""
            with heard_in_time(process):
                while not shown.endswith("[s] stop now: "):
                    character = process.stdout.read(1)
                    assert character, shown
                    shown += character
        else:
            until(lambda: trace.exists() and '"fired"' in trace.read_text(encoding="utf-8"), "a firing")
        process.send_signal(sent)
        process.wait(timeout=PATIENCE_SECONDS)  # and nothing is typed, nor the input ended
        said, errors = process.communicate()
    assert process.returncode == 3, said + errors
    assert errors == ""
    assert "stopped after" in said
    assert notes_of(trace)[-2:] == ["stopped by the operator", "stopped"]


def test_steps_end_where_the_cell_waits_for_ever(bundle: str, tmp_path: Path) -> None:
    text = PLANT.read_text(encoding="utf-8")
    blind = text.replace(
        "conveyor.part_at_entry: {occupied: cv1_entry}", "conveyor.part_at_entry: {occupied: cv2_exit}"
    )
    assert blind != text
    plant = tmp_path / "blind.plant.yaml"
    plant.write_text(blind, encoding="utf-8")
    done = typed("\n\n", bundle, "--plant", str(plant), "--workpieces", "1", "--step")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "waiting after" in done.stdout
    assert "G1 waits for conveyor.part_at_entry" in done.stdout


def test_neither_trace_nor_log_overwrites_what_the_run_reads(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plant, link = tmp_path / "cell.plant.yaml", tmp_path / "link"
    plant.write_bytes(PLANT.read_bytes())
    link.hardlink_to(bundle)
    before = Path(bundle).read_bytes()
    for option in ("--trace", "--log"):
        for written in (bundle, str(link), str(plant)):
            assert main(["run", bundle, "--plant", str(plant), "--workpieces", "1", option, written]) == 2
            assert "error[F1017]" in capsys.readouterr().err
    assert (Path(bundle).read_bytes(), plant.read_bytes()) == (before, PLANT.read_bytes())


def test_a_refused_run_leaves_an_older_trace_as_it_is(bundle: str, tmp_path: Path) -> None:
    trace = tmp_path / "run.trace.jsonl"
    trace.write_text("kept", encoding="utf-8")
    assert main(["run", bundle, "--plant", "catalogue:two_robots_shared", "--trace", str(trace)]) == 2
    assert trace.read_text(encoding="utf-8") == "kept"


def test_a_trace_whose_name_no_file_can_have_is_refused(bundle: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", bundle, "--workpieces", "1", "--trace", "n" * 5000]) == 2
    assert "error[F1017]" in capsys.readouterr().err


def is_where_no_file_can_be_made(_: Path) -> Path:
    """Which is seen by whoever tries it alone: the folder says that one may write there."""
    return Path("/proc/cell.trace")


def is_a_link_to_itself(folder: Path) -> Path:
    (folder / "trace").symlink_to("trace")
    return folder / "trace"


def has_lines(folder: Path) -> Path:
    (folder / "trace").write_text("of another run\n", encoding="utf-8")
    return folder / "trace"


def is_a_pipe_that_nobody_reads(folder: Path) -> Path:
    os.mkfifo(folder / "trace")
    return folder / "trace"


@pytest.mark.parametrize(
    ("trace_in", "reason"),
    [
        (has_lines, "begins anew, and this file has lines"),
        (is_a_pipe_that_nobody_reads, "it is a pipe that nobody reads"),
        (lambda folder: folder, "Is a directory"),
        (lambda folder: f"{folder}/traces/", "Is a directory"),
        (lambda folder: folder / "traces" / "trace", "No such file or directory"),
        (lambda folder: has_lines(folder) / "trace", "Not a directory"),
        (lambda folder: folder / ("n" * 300), "File name too long"),
        (is_where_no_file_can_be_made, "the trace cannot be written"),
        (is_a_link_to_itself, "Too many levels of symbolic links"),
    ],
)
def test_a_run_that_is_refused_for_its_trace_leaves_no_journal(
    bundle: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    trace_in: Callable[[Path], Path | str],
    reason: str,
) -> None:
    trace = trace_in(tmp_path)
    before = set(tmp_path.iterdir())
    command = ["run", bundle, "--workpieces", "1", "--journal", str(tmp_path / "cell.journal"), "--trace", str(trace)]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert said.startswith("error[F1017]")
    assert reason in said
    assert set(tmp_path.iterdir()) == before


def test_a_run_that_is_refused_for_its_simulated_cell_leaves_nothing(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal, cell = tmp_path / "cell.journal", tmp_path / "cell.journal.cell"
    command = ["run", bundle, "--workpieces", "1", "--journal", str(journal), "--trace", str(tmp_path / "trace")]
    cell.mkdir()
    assert main(command) == 2
    assert f"error[F5034]: {cell}: the simulated cell cannot be kept: Is a directory" in capsys.readouterr().err
    cell.rmdir()
    cell.write_text("of another kind\n", "utf-8")
    assert main(command) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error[F5035]: {cell}: not the simulated cell of this run"), "no journal is told to be new"
    assert list(tmp_path.iterdir()) == [cell]
    assert cell.read_text("utf-8") == "of another kind\n"


def test_a_trace_is_begun_where_its_link_leads(bundle: str, tmp_path: Path) -> None:
    (tmp_path / "trace").symlink_to("kept")
    assert main(["run", bundle, "--workpieces", "1", "--trace", str(tmp_path / "trace")]) == 0
    assert (tmp_path / "trace").is_symlink()
    assert (tmp_path / "kept").stat().st_size


def test_a_trace_does_not_go_to_standard_output(
    bundle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", bundle, "--workpieces", "1", "--trace", "-"]) == 2
    streams = capsys.readouterr()
    assert "error[F1017]: -: the trace cannot go to standard output" in streams.err
    assert list(tmp_path.iterdir()) == []
    assert main(["run", bundle, "--workpieces", "1", "--trace", "./-"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["-"]


def killed(bundle: str, folder: Path) -> tuple[str, ...]:
    """The options of a run in real time that was killed after some of its commands."""
    options = ("--workpieces", "2", "--journal", str(folder / "cell.journal"), "--trace", str(folder / "trace"))
    command = [sys.executable, "-m", "firable.cli", "run", bundle, "--speed", "10", *LATE, *options]
    trace = folder / "trace"
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as running:
        try:
            until(lambda: trace.exists() and trace.read_text().count("command") >= 8, "commands")
            assert running.poll() is None
        finally:
            running.kill()
    return options


def test_a_run_that_was_killed_is_held_until_the_operator_takes_it_up(bundle: str, tmp_path: Path) -> None:
    options = killed(bundle, tmp_path)
    held = typed("", bundle, *options)
    assert held.returncode == 3
    assert "nothing moves until it is resumed" in held.stdout
    assert "0 commands issued" in held.stdout
    left = typed("s\n", bundle, *options, "--step", "--format", "json")
    assert "nothing moves until it is resumed" in left.stderr
    assert json.loads(left.stdout)["reports"][0]["run"]["state"] == "stopped"


def test_a_run_that_was_killed_goes_on_by_the_operators_key(bundle: str, tmp_path: Path) -> None:
    options = killed(bundle, tmp_path)
    done = typed("r\nr\n", bundle, *options, "--step")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 workpieces carried through, 0 lost, 0 doubled" in done.stdout
    assert re.search(r" firings, .* controllers, since it was taken up at \d+ s\n", done.stdout)
    assert {"restarted", "taken up"} <= set(notes_of(tmp_path / "trace"))


def test_a_trace_or_a_log_in_a_file_of_the_journal_is_refused(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = str(tmp_path / "cell.journal")
    for what in ("trace", "log"):
        for suffix in ("", ".cell", ".generation", "-wal", "-shm", "-journal"):
            assert main(["run", bundle, "--journal", journal, f"--{what}", f"{journal}{suffix}"]) == 2
            assert f"{journal}{suffix}: --{what} would overwrite what --journal writes" in capsys.readouterr().err
    both = str(tmp_path / "both")
    assert main(["run", bundle, "--trace", both, "--log", both]) == 2
    assert "--log would overwrite what --trace writes" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--say", "mc.fix=done"), "--say is of a run that is taken up: name its --journal"),
        (("--resume",), "--resume is of a run that is taken up: name its --journal"),
        (("--say", "mc.fi=done", "--journal", "j"), "did you mean 'mc.fix'?"),
        (("--say", "x=done", "--journal", "j"), "no place 'x' sends a command\n"),
        (("--say", "mc.fix=perhaps", "--journal", "j"), "say done, working, not-received"),
        (
            ("--say", "mc.fix=done", "--say", "mc.fix=working", "--journal", "j"),
            "--say mc.fix=working: something else is said of 'mc.fix' too",
        ),
    ],
)
def test_a_word_on_no_command_or_of_no_run_that_is_taken_up_is_refused(
    options: tuple[str, ...], words: str, bundle: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", bundle, *options]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("option", [("--workpieces", "3"), ("--seed", "1"), ("--speed", "10")], ids=lambda o: o[0])
@pytest.mark.parametrize(
    "real", [("--bind", "b.yaml"), ("--controller", "robot", "--dry-run", "1")], ids=lambda o: o[0]
)
def test_what_only_a_simulated_cell_heeds_is_refused_of_real_machines(
    option: tuple[str, str], real: tuple[str, ...], bundle: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", bundle, *real, *option]) == 2
    assert f"{option[0]} is of the simulated cell, which this run has not" in capsys.readouterr().err


def test_a_word_on_a_command_that_nobody_asks_after_is_told(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "trace"
    options = ("--workpieces", "1", "--journal", str(tmp_path / "journal"), "--trace", str(trace))
    assert main(["run", bundle, *options, "--say", "mc.fix=done"]) == 0
    assert "nobody asked after mc.fix" in capsys.readouterr().err
    assert "unasked" in notes_of(trace)
    assert main(["replay", str(trace), "--net", bundle]) == 0
    assert main(["run", bundle, *options, "--say", "mc.fix=done"]) == 0, "taken up"
    assert "nobody asked after mc.fix" in capsys.readouterr().err


def test_a_journal_that_is_new_is_told_of_and_one_that_is_taken_up_is_not(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal, log = str(tmp_path / "cell.journal"), tmp_path / "log"
    arguments = ["run", bundle, "--workpieces", "1", "--journal", journal, "--resume", "--log", str(log)]
    assert main(arguments) == 0
    told = f"  the journal {journal} is new: the run begins at the initial marking, and so must its machines\n"
    assert capsys.readouterr().err == told
    assert main(arguments) == 0
    assert "is new" not in capsys.readouterr().err
    began = [line["journal"] for line in map(json.loads, log.read_text().splitlines()) if line["event"] == "began"]
    assert began == ["new", "taken up"]


def test_a_run_that_is_done_is_known_as_done_when_it_is_started_again(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = tmp_path / "cell.journal"
    arguments = ["run", bundle, "--plant", str(PLANT), "--workpieces", "2", "--journal", str(journal)]
    assert main(arguments) == 0
    capsys.readouterr()
    for _ in range(2):
        assert main(arguments) == 0
        said = capsys.readouterr().out
        assert "this run was done before" in said
        assert "name a new journal" in said
        assert "interrupted" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "catalogue:one_robot"],
        ["run", "cell.pnml"],
        ["sign", "catalogue:one_robot", "--key", "k"],
        ["takeover", "catalogue:one_robot", "x.bundle", "--journal", "a", "--into", "b"],
    ],
)
def test_a_net_in_the_place_of_a_bundle_is_refused_with_how_a_bundle_is_made(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert "is a net, and " in said
    assert f"firable bundle {arguments[1]} -o " in said


def test_a_run_that_is_stopped_at_a_divergence_tells_it_once() -> None:
    report = execute(
        decomposition_of("one_robot"),
        SimulatedCell(plant_of("one_robot"), workpieces=3, disturbances=[NeverCompletes("R", "MOVE", 3)]),
        Conduct(watch=Watch.STOP),
    )
    assert report.divergence is not None
    through, _, machines = _verdicts(report, 3, 0, is_kept=False)
    assert through.subjects[0] == "the machines are not as they are modelled; see machines-as-modelled"
    assert not through.hint, "what to do is said of every such verdict"
    assert report.divergence.message in machines.hint


def test_the_end_of_a_run_by_a_fault_tells_the_fault_once_and_what_to_do() -> None:
    fault = "'R MOVE' of 'robot.to_cv1', sent at 1.0 s, is overdue: 'robot.at_cv1' has not come within 120 s"
    situation = Situation(State.FAULT, (), message=fault)
    report = RunReport(situation, (), (), (), (), {}, 0, 0, {}, 1.0)
    simulated = _verdicts(report, 1, 0, is_kept=False)[0]
    assert simulated.statement == "1 workpiece goes through the cell"
    for one in (simulated, bound_run._verdict(report, "cell.bind.yaml"), hosting._verdict(situation, ("robot",))):
        assert one.status is Status.VIOLATED
        assert one.subjects == (fault,)
        ((code, hint),) = hints_of(one)
        assert code == "F5007"
        assert fault not in hint
        goes_on = "this host goes on" if one.name == "host-ended-in-order" else "the run is taken up"
        assert ("--trace FILE" if one is simulated else f"with its --journal {goes_on}") in hint


def test_the_report_of_machines_that_are_not_as_they_are_modelled_is_as_its_schema_says(
    bundle: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = execute(
        decomposition_of("one_robot"),
        SimulatedCell(plant_of("one_robot"), workpieces=3, disturbances=[NeverCompletes("R", "MOVE", 3)]),
        Conduct(watch=Watch.STOP),
    )
    monkeypatch.setattr(running, "run_bound", lambda *_, **__: ended)
    monkeypatch.setattr(bound_run, "binding_for", lambda *_: (None, ()))
    report = run_bound_of(bundle, read_bundle(bundle), "b", Conduct(watch=Watch.STOP), None).to_json()
    schema = json.loads(files("firable.cli").joinpath("report.schema.json").read_text(encoding="utf-8"))
    bound = {
        **schema,
        "properties": {"run": {"$ref": "#/$defs/bound_run"}},
        "additionalProperties": True,
        "required": [],
    }
    jsonschema.Draft202012Validator(bound).validate(report)
    assert report["run"]["divergence"]["places"]


def test_a_run_of_layers_on_machines_says_what_each_coordinator_has_decided(
    bundle: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = execute(decomposition_of("one_robot"), SimulatedCell(plant_of("one_robot"), workpieces=1))
    monkeypatch.setattr(bound_run, "binding_for", lambda *_: (None, ()))
    for decided, told in (
        ({"line": 6, "cell": 3}, "between coordinators and controllers\n  decided: 6 by line, 3 by cell\n"),
        ({"line": 9}, "between coordinator and controllers\n\n"),
    ):
        found = replace(ended, decided=decided)
        monkeypatch.setattr(running, "run_bound", Mock(return_value=found))
        bound_run.show_bound(run_bound_of(bundle, read_bundle(bundle), "b", Conduct(), None))
        assert told in capsys.readouterr().out
