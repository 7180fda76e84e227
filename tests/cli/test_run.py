"""`firable run` with an operator at the terminal: steps, stops, Ctrl-C, and the files that a run may write."""

import subprocess
import sys
from pathlib import Path

import pytest

from firable.cli.main import main
from firable.nets.catalogue import catalogue_path

PLANT = catalogue_path("one_robot").with_name("one_robot.plant.yaml")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A bundle of the one-robot cell."""
    path = tmp_path_factory.mktemp("bundle") / "cell.bundle"
    assert main(["bundle", "catalogue:one_robot", "-o", str(path)]) == 0
    return str(path)


def typed(lines: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`firable run` with what the operator types; a run that never ends fails by its time limit."""
    return subprocess.run(
        [sys.executable, "-m", "firable.cli", "run", *arguments],
        input=lines,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


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


def test_a_trace_never_overwrites_what_the_run_reads(
    bundle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plant, link = tmp_path / "cell.plant.yaml", tmp_path / "link"
    plant.write_bytes(PLANT.read_bytes())
    link.hardlink_to(bundle)
    before = Path(bundle).read_bytes()
    for trace in (bundle, str(link), str(plant)):
        assert main(["run", bundle, "--plant", str(plant), "--workpieces", "1", "--trace", trace]) == 2
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
