"""A newcomer's mistakes: one clear error, exit code 2, never a traceback, and nothing half-written."""

import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import firable.analysis.check
from firable.cli.main import main
from firable.executor.drivers.binding import parse_binding
from firable.nets.archive import SIGNATURE
from firable.nets.catalogue import catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.drawing.layout_file import parse_layout
from firable.nets.machines.plant_file import parse_plant
from firable.nets.tasks.text import parse_tasks
from firable.nets.text import parse_net

NET = """\
firable: 1
cell: small
controllers:
  robot:
    start: free
    places: {free: , busy: }
transitions:
  begin: {from: robot.free, to: robot.busy}
  end: {from: robot.busy, to: robot.free}
"""

MISTAKES: dict[str, tuple[Callable[[str], str], str]] = {
    "a wrong name": (lambda text: text.replace("to: robot.busy}", "to: robot.buzy}"), "F2002"),
    "wrong indentation": (lambda text: text.replace("    start", "   start"), "F1005"),
    "a missing owner": (lambda text: text.replace("from: robot.free", "from: free"), "F2002"),
    "an unknown gate": (lambda text: text.replace("to: robot.busy}", "to: robot.busy, if: robot.ready}"), "F2021"),
    "a self-loop": (lambda text: text.replace("to: robot.busy}", "to: [robot.busy, robot.free]}"), "F2009"),
    "a duplicate key": (lambda text: text + "  end: {from: robot.busy, to: robot.free}\n", "F1006"),
    "an unknown key": (lambda text: text.replace("cell: small", "cell: small\nplaces_: {}"), "F1008"),
    "a tab": (lambda text: text.replace("    start", "\tstart"), "F1005"),
    "an empty file": (lambda _: "", "F1002"),
    "another version": (lambda text: text.replace("firable: 1", "firable: 9"), "F1011"),
}


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What a command says on standard error that has to refuse its input."""
    capsys.readouterr()
    assert main(list(arguments)) == 2
    streams = capsys.readouterr()
    assert "Traceback" not in streams.out + streams.err
    assert "F9001" not in streams.err
    assert streams.err.strip()
    return streams.err


def test_the_net_without_a_mistake_holds(tmp_path: Path) -> None:
    (tmp_path / "net.firable.yaml").write_text(NET)
    assert main(["check", str(tmp_path / "net.firable.yaml")]) == 0


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_net_file_is_one_clear_error(
    mistake: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, code = MISTAKES[mistake]
    path = tmp_path / "net.firable.yaml"
    text = change(NET)
    assert text != NET
    path.write_text(text)
    for command in (["check"], ["prove"], ["draw"]):
        said = refused(capsys, *command, str(path))
        assert f"error[{code}]" in said
        assert f"{path}:" in said
        assert said.count("error[") == 1
        assert "hint: " in said


def test_what_is_no_net_file_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    binary = tmp_path / "photo.firable.yaml"
    binary.write_bytes(bytes(range(256)) * 64)
    noise = tmp_path / "noise.firable.yaml"
    with noise.open("wb") as stream:
        for _ in range(100):
            stream.write(os.urandom(1024 * 1024))
    folder = tmp_path / "folder.firable.yaml"
    folder.mkdir()
    text_noise = tmp_path / "noise.txt"
    text_noise.write_bytes(b"{[" * 500_000)
    for path in (
        binary,
        noise,
        folder,
        text_noise,
        tmp_path / "missing.yaml",
        Path("/dev/null"),
        tmp_path / ("x" * 300),
    ):
        for command in (["check"], ["prove"], ["bundle", "-o", str(tmp_path / "b")], ["run"], ["draw"]):
            said = refused(capsys, *command, str(path))  # by its name it may be a net, which does not run
            assert "error[F" in said or (command == ["run"] and "is a net, and what runs is a bundle" in said)
        assert "error[F" in refused(capsys, "replay", str(path), "--net", "catalogue:one_robot")
        assert "error[F" in refused(capsys, "convert", str(path), "-o", str(tmp_path / "out.pnml"))
    assert not (tmp_path / "b").exists()
    assert not (tmp_path / "out.pnml").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "Usage:"),
        (["chekc"], "No such command 'chekc'; did you mean 'check'?"),
        (["check"], "Missing argument"),
        (["check", "--disciplin", "step", "x"], "No such option"),
        (["check", "--discipline", "steps", "x"], "is not one of"),
        (["check", "--max-markings", "0", "x"], "Invalid value"),
        (["check", "--max-markings", "many", "x"], "Invalid value"),
        (["check", "--format", "xml", "x"], "is not one of"),
        (["check", "catalogue:one_robt"], "the catalogue has no 'one_robt'; did you mean 'one_robot'? it has: "),
        (["check", "catalogue:philosopher-5"], "families philosophers-N"),
        (["check", "catalogue:philosophers-1"], "the sizes of 'philosophers' are 2 to 250,000"),
        (["prove", "a", "b"], "unexpected extra argument"),
        (["bundle", "catalogue:one_robot"], "Missing option"),
        (["bundle", "catalogue:one_robot", "-o", "-"], "cannot go to standard output"),
        (["bundle", "x", "-o", "y", "--tasks", "z"], "--tasks goes with --conceptual"),
        (["run", "x", "--workpieces", "-1"], "Invalid value"),
        (["run", "x", "--speed", "100"], "is not one of"),
        (["run", "x.plant.yaml"], "'x.plant.yaml' is a plant file, and what runs is a bundle"),
        (["replay", "x"], "Missing option '--net'"),
        (["draw", "catalogue:machines-5000"], "20,000 places and transitions make no picture"),
        (["draw", "catalogue:machines-5000"], "at most 600 are drawn: --controller NAME draws some of its controllers"),
        (["draw", "catalogue:philosophers-90"], "--what overview draws what they share"),
        (["draw", "catalogue:counter-500"], "`firable split --suggest` proposes controllers for it"),
        (["draw", "catalogue:machines-5000", "--what", "overview"], "the net is too large for an overview"),
        (["draw", "catalogue:counter-5", "--what", "overview"], "this net has no two of them"),
        (["draw", "catalogue:one_robot", "--controller", "robt"], "no controller 'robt'; did you mean 'robot'?"),
        (["draw", "catalogue:two_cells", "--controller", "line"], "--controller line: it owns no place and no signal"),
        (["draw", "catalogue:two_cells", "--controller", "cell_a", "--layout", "layered"], "are of lanes"),
        (["draw", "catalogue:two_cells", "--controller", "cell_a", "--keep-layout"], "leave out --controller"),
        (
            ["draw", "catalogue:two_cells", "--controller", "cell_a", "--what", "overview"],
            "--controller is of --what net",
        ),
        (["view", "catalogue:machines-5000"], "20,000 places and transitions make no picture"),
        (["view", "catalogue:counter-500"], "`firable split --suggest` proposes controllers for it"),
        (["view", "catalogue:one_robot", "--controller", "robt"], "no controller 'robt'; did you mean 'robot'?"),
        (["draw", "catalogue:one_robot", "--marking", "robot.fre"], "no place 'robot.fre'"),
        (["draw", "catalogue:one_robot", "--marking", "robot.free", "--trace", "x"], "leave one out"),
        (["draw", "catalogue:one_robot", "--layout", "dot", "--width", "900"], "are of lanes"),
        (["draw", "catalogue:one_robot", "--what", "graph", "--layout", "lanes"], "markings have no lanes"),
        (["draw", "catalogue:one_robot", "--discipline", "step"], "--discipline is of --what graph, not of --what net"),
        (["draw", "catalogue:one_robot", "--what", "graph", "--marking", "robot.free"], "--marking is of --what net"),
        (["draw", "catalogue:one_robot", "--what", "strip"], "add --trace FILE"),
        (["draw", "catalogue:one_robot", "-o", "net.png"], "'net.png' is not named like one: name a file *.svg"),
        (["draw", "catalogue:one_robot", "-o", "net"], "'net' is not named like one: name a file *.svg"),
        (["draw", "catalogue:one_robot", "--collapse", "robt"], "no place and no controller 'robt'"),
        (["draw", "catalogue:one_robot", "--what", "graph", "--keep-layout"], "--keep-layout is of --what net"),
        (
            ["draw", "catalogue:one_robot", "--collapse", "robot", "--collapse", "robot.free"],
            "--collapse robot.free: no",
        ),
        (["view", "catalogue:one_robot", "--collapse", "robot.free"], "no task of two places or more is named so"),
        (["io", "no.bind.yaml", "--once", "--for", "1"], "--once ends by itself when everything has been read"),
        (["replay", "x", "--net", "y", "-o", "-"], "the trace cannot go to standard output"),
        (
            ["operate", "https://x", "pause", "--token-file", "t", "--cert", "c", "k"],
            "leave out --token-file or --cert",
        ),
        (["refine", "catalogue:conceptual_one_robot", "-o", "-"], "cannot go to standard output"),
        (["convert", "catalogue:one_robot", "-o", "net.docx"], "cannot tell the format"),
        (["schema", "everything"], "is not one of"),
    ],
)
def test_a_wrong_command_line_says_what_is_wrong(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words.lower() in refused(capsys, *arguments).lower()


EMPTY = [
    (["check", ""], "NET..."),
    (["check", "catalogue:conceptual_one_robot", ""], "NET..."),
    (["check", "catalogue:one_robot_mc_late", "--trace-dir", ""], "--trace-dir"),
    (["check", "catalogue:one_robot", "--evidence", ""], "--evidence"),
    (["draw", "catalogue:one_robot", "-o", ""], "-o"),
    (["prove", "catalogue:one_robot", "--smt-dir", ""], "--smt-dir"),
    (["run", "cell.bundle", "--trace", ""], "--trace"),
    (["run", "cell.bundle", "--journal", ""], "--journal"),
    (["run", "cell.bundle", "--serve-tls", "cert.pem", ""], "--serve-tls"),
    (["sign", "--make-key", ""], "--make-key"),
    (["split", "catalogue:one_robot", "--subnets", ""], "--subnets"),
    (["takeover", "old.bundle", "new.bundle", "--journal", "", "--into", "b"], "--journal"),
]
TWICE = [
    (["rehearse", "cell.bundle", "--seed", "1", "--seed", "2"], "--seed"),
    (["check", "catalogue:one_robot", "--method", "auto", "--method=symbolic"], "--method"),
    (["check", "catalogue:one_robot", "--progress", "--no-progress"], "--progress"),
    (["draw", "catalogue:one_robot", "-o", "a.svg", "--output", "b.svg"], "-o"),
    (["ci", "init", "--for", "gitlab", "--for", "gitlab"], "--for"),
]


@pytest.mark.parametrize(
    ("arguments", "named", "why"),
    [(*one, "it is empty") for one in EMPTY]
    + [(*one, "it is given more than once, and has one value") for one in TWICE],
)
def test_what_is_empty_or_of_one_value_and_given_twice_is_refused_and_never_taken_for_something_else(
    arguments: list[str],
    named: str,
    why: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An empty name would be the folder in which the command runs, and of two values the last was taken."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.bundle").touch()
    said = refused(capsys, *arguments)
    assert f"Error: Invalid value for '{named}'" in said
    assert said.endswith(f": {why}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["cell.bundle"]


def test_a_list_and_a_flag_may_be_given_twice(tmp_path: Path) -> None:
    (tmp_path / "net.firable.yaml").write_text(NET)
    lists = ["--query", "EF robot.busy", "--query", "EF robot.free"]
    assert main(["check", str(tmp_path / "net.firable.yaml"), "-v", "-v", *lists]) == 0


def test_all_tasks_of_a_net_without_any_are_no_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["draw", "catalogue:machines-2", "--collapse", "all"]) == 0
    folded = capsys.readouterr().out
    assert main(["draw", "catalogue:machines-2"]) == 0
    assert capsys.readouterr().out == folded


def test_a_marking_without_a_token_is_no_empty_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["draw", "catalogue:one_robot", "--marking", ""]) == 0


def test_an_output_that_cannot_be_written_leaves_nothing_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder.svg").mkdir()
    monkeypatch.chdir(tmp_path / "folder.svg")
    for output in (str(tmp_path / "no" / "x.svg"), str(tmp_path / "file" / "x.svg"), str(tmp_path / "folder.svg")):
        for command in (["draw", "catalogue:one_robot"], ["bundle", "catalogue:one_robot"]):
            assert "error[F1017]" in refused(capsys, *command, "-o", output)
    for output in (".", "/"):
        assert "error[F1017]" in refused(capsys, "bundle", "catalogue:one_robot", "-o", output)
    said = refused(capsys, "convert", "catalogue:one_robot", "-o", str(tmp_path / "no" / "x.pnml"))
    assert "error[F1017]" in said
    said = refused(capsys, "refine", "catalogue:conceptual_one_robot", "-o", str(tmp_path / "no" / "x.firable.yaml"))
    assert "error[F1017]" in said
    for option, maker in (("--trace-dir", "check"), ("--smt-dir", "prove")):
        said = refused(capsys, maker, "catalogue:one_robot_mc_late", option, str(tmp_path / "file"))
        assert "error[F1017]" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.svg"]
    assert (tmp_path / "file").read_text() == "kept"
    assert list((tmp_path / "folder.svg").iterdir()) == []


@pytest.mark.parametrize(
    ("parse", "what", "begins"),
    [
        (parse_net, "net file", "`firable: 1` and `cell: NAME`"),
        (parse_binding, "binding", "`firable_bind: 1` and `cell: NAME`"),
        (parse_plant, "plant file", "`firable_plant: 1` and `plant: NAME`"),
        (parse_tasks, "file of tasks", "`firable_tasks: 1`"),
        (parse_layout, "layout file", "`firable_layout: 1`"),
    ],
)
def test_a_file_without_anything_in_it_is_told_as_what_it_should_be(
    parse: Callable[[str, str], object], what: str, begins: str
) -> None:
    for text, why in (("", "is empty"), (" \n", "is empty"), ("# to be written\n", "holds comments alone")):
        with pytest.raises(InputError) as refusal:
            parse(text, "cell.yaml")
        (problem,) = refusal.value.diagnostics
        assert (problem.code, problem.message) == ("F1002", f"this is not a {what}: it {why}")
        assert problem.span is not None
        assert (problem.span.file, problem.span.line) == ("cell.yaml", 1)
        assert problem.hint.startswith(f"a {what} begins with {begins}")


def test_a_mistake_in_a_file_of_tasks_or_in_its_use_is_one_clear_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tasks = tmp_path / "own.tasks.yaml"
    for text, code, words in (
        ("", "F1002", "own.tasks.yaml:1:1"),
        ("tasks: {}\n", "F1009", "begins with `firable_tasks: 1`"),
        ("firable_tasks: 1\ntasks: {rest: {rols: {}}}\n", "F1008", "did you mean 'roles'?"),
        ("firable_tasks: 1\ntasks: {rest: {roles: {r: {steps: {a: {place: '{s}'}}}}}}\n", "F2026", "own.tasks.yaml:2:"),
    ):
        tasks.write_text(text)
        said = refused(capsys, "refine", "catalogue:conceptual_one_robot", "--tasks", str(tasks))
        assert f"error[{code}]" in said
        assert words in said
    assert "error[F1001]" in refused(
        capsys, "refine", "catalogue:conceptual_one_robot", "--tasks", str(tmp_path / "no")
    )
    assert "error[F4010]" in refused(capsys, "refine", "catalogue:one_robot")  # there is nothing to open
    said = refused(capsys, "refine", "catalogue:conceptual_one_robot_mc_late", "-o", str(tmp_path / "late.yaml"))
    assert "error[F4012]" in said
    assert "add 'system.mc' to `from`" in said
    assert not (tmp_path / "late.yaml").exists()


def test_a_bundle_is_no_trace(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle = tmp_path / "cell.bundle"
    bundle.write_bytes(SIGNATURE)
    for arguments in ((), ("--net", "catalogue:one_robot")):
        said = refused(capsys, "replay", str(bundle), *arguments)
        assert f"'{bundle}' is a bundle and no trace: `firable replay TRACE --net {bundle}`" in said


def test_a_plant_that_does_not_fit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle = str(tmp_path / "cell.bundle")
    assert main(["bundle", "catalogue:one_robot", "-o", bundle]) == 0
    assert "error[F5003]" in refused(capsys, "run", bundle, "--plant", "catalogue:two_robots_shared")
    plant = tmp_path / "x.plant.yaml"
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    plant.write_text(text.replace("part_present", "prt_present"))
    cell = "catalogue:one_robot"
    for arguments in (
        ("run", bundle, "--plant"),
        ("check", cell, "--machines"),
        ("bundle", cell, "-o", str(tmp_path / "x"), "--machines"),
    ):
        said = refused(capsys, *arguments, str(plant))
        assert f"{plant}:1:1" not in said
        assert re.search(rf"{plant}:\d+:3: error\[F5003\]: the net has no signal 'mc.prt_present'", said)
    assert "error[F1001]" in refused(capsys, "run", bundle, "--plant", str(tmp_path / "no.plant.yaml"))
    said = refused(capsys, "run", bundle, "--workpieces", "1", "--trace", str(tmp_path / "no" / "trace"))
    assert "error[F1017]" in said


def test_an_internal_error_is_one_line_and_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*arguments: object, **options: object) -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr(firable.analysis.check, "check", broken)
    assert main(["check", "catalogue:one_robot"]) == 4
    said = capsys.readouterr().err
    assert "error[F9001]: internal error: RuntimeError: planted" in said
    assert "Traceback" not in said
    assert main(["--traceback", "check", "catalogue:one_robot"]) == 4
    assert "Traceback" in capsys.readouterr().err


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def missing(*arguments: object, **options: object) -> None:
        raise ModuleNotFoundError("No module named 'numpy'", name="numpy")

    monkeypatch.setattr(firable.analysis.check, "check", missing)
    assert "pip install 'firable[prove]'" in refused(capsys, "check", "catalogue:one_robot")


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m firable.cli schema net | head -1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, check=False)
    assert done.stdout == "{\n"
    assert done.stderr == ""


def assert_unread(command: str, *, are_both_gone: bool) -> None:
    """A command whose output nobody reads, nor what it says of errors, ends with 3 and has nothing to say."""
    reading, gone = os.pipe()
    os.close(reading)
    others = gone if are_both_gone else subprocess.PIPE
    try:
        done = subprocess.run(
            [sys.executable, "-m", "firable.cli", *command.split()], stdout=gone, stderr=others, text=True, check=False
        )
    finally:
        os.close(gone)
    assert (done.returncode, done.stderr) == (3, None if are_both_gone else "")


@pytest.mark.parametrize("are_both_gone", [False, True], ids=["output", "both"])
@pytest.mark.parametrize("command", ["check catalogue:one_robot", "schema net", "--help"])
def test_what_nobody_reads_is_unknown_and_nothing_is_violated(command: str, *, are_both_gone: bool) -> None:
    assert_unread(command, are_both_gone=are_both_gone)


@pytest.mark.parametrize(("last", "are_both_gone"), [("catalogue:one_robot", False), ("bad.firable.yaml", True)])
def test_files_that_are_asked_for_are_written_though_nobody_reads_what_is_printed(
    tmp_path: Path, last: str, *, are_both_gone: bool
) -> None:
    (tmp_path / "bad.firable.yaml").write_text("firable: [", "utf-8")
    file = tmp_path / "firable.xml"
    command = f"check catalogue:one_robot_mc_late {tmp_path / last if are_both_gone else last} --write junit {file}"
    assert_unread(command, are_both_gone=are_both_gone)
    assert file.read_text("utf-8").count("<testsuite ") == 2


def test_a_terminal_without_unicode_still_gets_the_words() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "firable.cli", "check", "catalogue:one_robot"],
        env={**os.environ, "PYTHONIOENCODING": "latin-1"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0
    assert b"? proved    deadlock-free" in done.stdout


def test_colours_are_for_terminals_and_switched_off_by_no_color() -> None:
    command = [sys.executable, "-m", "firable.cli", "check", "catalogue:one_robot"]
    clean = {key: value for key, value in os.environ.items() if key not in {"NO_COLOR", "FORCE_COLOR"}}

    def on_a_terminal(**environment: str) -> bytes:
        master, slave = pty.openpty()
        with subprocess.Popen(command, env={**clean, "TERM": "xterm", **environment}, stdout=slave) as process:
            os.close(slave)
            shown = b""
            while True:
                try:
                    shown += (some := os.read(master, 65536))
                except OSError:  # the far side of a terminal that is closed
                    some = b""
                if not some:
                    break
        os.close(master)
        assert process.returncode == 0
        return shown

    assert b"\x1b[32m" in on_a_terminal()
    assert b"\x1b[" not in on_a_terminal(NO_COLOR="1")
    assert b"\x1b[" not in subprocess.run(command, env=clean, capture_output=True, check=True).stdout


def test_errors_that_differ_in_names_alone_are_told_once_and_counted(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "split", "catalogue:one_robot", "--own", "robot=robot.*")
    assert said.count("error[F2011]") == 1
    assert "no rule gives 'system.carrying_in' an owner" in said
    assert "the same of 23 more: 'system.loading', 'system.processing', 'system.unloading', " in said


def test_a_net_of_the_catalogue_goes_by_the_name_that_was_written(capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "split", "catalogue:one_robot", "--own", "robot=robot.*")
    lines = catalogue_path("one_robot").read_text("utf-8").splitlines()
    line = next(i for i, text in enumerate(lines, 1) if text.strip().startswith("carrying_in:"))
    column = lines[line - 1].index("carrying_in") + 1
    assert said.startswith(f"catalogue:one_robot:{line}:{column}: error")
    assert str(catalogue_path("one_robot").parent) not in said


def test_a_mistake_in_an_option_stands_nowhere_in_the_net(capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(capsys, "split", "catalogue:one_robot", "--own", "a").startswith("error[F1010]: 'a' is no rule")


def test_a_file_where_a_folder_is_wanted_is_said_to_be_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taken").write_text("x")
    said = refused(capsys, "prove", "catalogue:conceptual_one_robot", "--smt-dir", str(tmp_path / "taken"))
    assert "taken: cannot be written: this is a file, and a folder is wanted" in said


@pytest.mark.parametrize(
    "command",
    [
        ("sim", "catalogue:one_robot", "--modbus", "--press"),
        ("sim", "catalogue:one_robot", "--modbus", "--speed"),
        ("sim", "catalogue:one_robot", "--modbus", "--for"),
        ("io", "cell.bind.yaml", "--for"),
        ("run", "cell.bundle", "--controller", "robot", "--dry-run"),
        ("run", "cell.bundle", "--lease"),
        ("check", "catalogue:one_robot", "--max-seconds"),
        ("replay", "run.trace", "--net", "catalogue:one_robot", "--machines", "catalogue:one_robot", "--latency"),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("number", ["nan", "inf"])
def test_what_is_a_number_for_python_alone_is_refused(
    command: tuple[str, ...], number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, *command, number)
    assert "is not a finite number" in said or "is not in the range" in said
