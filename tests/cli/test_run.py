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
    blind = text.replace("conveyor.part_at_entry: {occupied: cv1_entry}", "conveyor.part_at_entry: {occupied: cv2_exit}")
    assert blind != text
    plant = tmp_path / "blind.plant.yaml"
    plant.write_text(blind, encoding="utf-8")
    done = typed("\n\n", bundle, "--plant", str(plant), "--workpieces", "1", "--step")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "waiting after" in done.stdout
    assert "G1 waits for conveyor.part_at_entry" in done.stdout
