"""What is shipped: a wheel built from the sdist, installed where no solver is, holds all that the rooms hold."""

import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
from support.executor_modules import executor_modules

ROOT = Path(__file__).parents[2]
ROOMS = ("nets", "semantics", "analysis", "decompose", "executor", "cli")
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "analysis" / "engine" / "target"))
"""Where cargo has built the crate for these tests already.

It knows the same sources, built with the same settings, again at another path, and misses one that is not there. So a
wheel takes the compiler nothing, and as long as ever where the crate was edited since.
"""


def run(*command: str | Path, code: int = 0, cwd: Path | None = None, also: dict[str, str] | None = None) -> str:
    done = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, **(also or {})},
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def pip(programs: Path, *command: str | Path) -> str:
    """What the installer of these tests says, of the environment with these programs."""
    return run(sys.executable, "-m", "pip", "--python", programs / "python", "--disable-pip-version-check", *command)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of the sdist, built as `python -m build` does: each in an environment of its own."""
    dist = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--sdist", "--outdir", dist, ROOT)
    (sdist,) = dist.iterdir()
    # Always the same folder, so that cargo replaces what it built of an earlier one; outside the rooms, whose modules
    # other tests list meanwhile.
    unpacked = ROOT / "build" / "sdist"
    shutil.rmtree(unpacked, ignore_errors=True)
    run(sys.executable, "-m", "tarfile", "-e", sdist, unpacked)
    (source,) = unpacked.iterdir()
    also = {"CARGO_TARGET_DIR": str(TARGET.absolute())}
    run(sys.executable, "-m", "build", "--wheel", "--outdir", dist, source, also=also)
    (wheel,) = dist.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def thin(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a fresh environment with the wheel and its base dependencies, without the extra `prove`."""
    folder = tmp_path_factory.mktemp("thin")
    venv.create(folder)  # without an installer, which would first have to be installed
    pip(folder / "bin", "install", "--quiet", wheel)
    return folder / "bin"


def test_the_wheel_holds_every_module_and_every_data_file(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for room in ROOMS:
        for path in (ROOT / room).rglob("*"):
            if path.suffix in {".py", ".pyi", ".yaml", ".smt2"} or path.name.endswith(".schema.json"):
                relative = path.relative_to(ROOT)
                if "engine" not in relative.parts:
                    assert f"firable/{relative}" in names
    for page in (ROOT / "docs" / "codes").iterdir():
        assert f"firable/cli/codes/{page.name}" in names
    assert "firable/py.typed" in names
    assert any(name.startswith("firable/analysis/_engine.") for name in names)
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not any(name.split("/")[0] in ROOMS for name in names)
    assert "-cp311-abi3-" in wheel.name


def test_the_executor_and_the_help_need_no_solver(thin: Path, tmp_path: Path) -> None:
    installed = pip(thin, "list").lower()
    assert not any(solver in installed for solver in ("z3", "networkx", "numpy", "highspy"))
    assert "Usage: firable" in run(thin / "firable", "--help", cwd=tmp_path)
    modules = executor_modules()
    run(thin / "python", "-c", f"import {', '.join(modules)}", cwd=tmp_path)
    assert "<svg" in run(thin / "firable", "draw", "catalogue:one_robot", cwd=tmp_path)


def test_a_bundle_made_elsewhere_runs_where_no_solver_is(thin: Path, tmp_path: Path) -> None:
    bundle, trace = tmp_path / "cell.bundle", tmp_path / "trace"
    run(sys.executable, "-m", "firable.cli", "bundle", "catalogue:one_robot", "-o", bundle)
    assert "3 workpieces carried through" in run(
        thin / "firable", "run", bundle, "--workpieces", "3", "--trace", trace, cwd=tmp_path
    )
    run(thin / "firable", "replay", trace, "--net", bundle, cwd=tmp_path)


def test_checking_without_the_extra_says_how_to_install_it(thin: Path, tmp_path: Path) -> None:
    for command in ("check", "prove"):
        said = run(thin / "firable", command, "catalogue:one_robot", code=2, cwd=tmp_path)
        assert "pip install 'firable[prove]'" in said
        assert "Traceback" not in said
