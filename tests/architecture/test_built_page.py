"""The page that is committed is the one that its sources make."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from firable.cli.view.site import _TYPES
from firable.nets.drawing.colours import TINTS, UNOWNED

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "cli" / "view" / "built"
NODE = shutil.which("node")
NODE_MIN = (20, 19)


def node_version() -> tuple[int, ...]:
    if NODE is None or shutil.which("npm") is None:
        return ()
    told = subprocess.run([NODE, "--version"], capture_output=True, text=True, check=True).stdout
    return tuple(map(int, re.findall(r"\d+", told)))


@pytest.mark.skipif(node_version() < NODE_MIN, reason="no Node 20.19 or later, with npm, is installed here")
def test_the_committed_page_is_that_of_a_fresh_build(tmp_path: Path) -> None:
    sources, made = tmp_path / "web", tmp_path / "built"
    shutil.copytree(ROOT / "web", sources, ignore=shutil.ignore_patterns("node_modules"))
    for command in (["npm", "ci", "--no-fund", "--no-audit"], ["npm", "run", "build"]):
        environment = {**os.environ, "FIRABLE_PAGE_OUT": str(made)}
        done = subprocess.run(command, cwd=sources, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    fresh = {path.name: path.read_bytes() for path in made.iterdir()}
    assert fresh == {path.name: path.read_bytes() for path in BUILT.iterdir()}, "run `make page` and commit"


def test_every_file_of_the_page_is_served_and_no_other_is_there() -> None:
    assert {path.name for path in BUILT.iterdir()} == set(_TYPES)


def test_the_dark_has_a_colour_for_each_tint_of_the_drawing() -> None:
    style = (ROOT / "web" / "src" / "picture.css").read_text("utf-8")
    for tint in (*TINTS, UNOWNED[0]):
        assert f'[fill="{tint}"]' in style
        assert f'[stroke="{tint}"]' in style
