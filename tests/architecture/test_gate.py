"""The gate of `make test` sees every file: a planted mistake in each room must stop it, by the very commands it runs.

Type checkers and linters check nothing, and say so of nothing, when they are pointed at the wrong place. So bad files
are planted in a copy of each room, and `make lint-python` and `make lint-rust` must fail and name each of them. Of the
room itself the copy has its place in the tree alone: what is well need not be checked again to see what is not.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("nets", "semantics", "analysis", "decompose", "executor", "cli", "tests", "benchmarks")

BAD = {
    "unused": '"""Planted."""\n\nimport json\n',
    "unformatted": '"""Planted."""\n\nANSWER = [ 42 ]\n',
    "mistyped": '"""Planted."""\n\n\ndef planted() -> int:\n    """Plant."""\n    return "42"\n',
    "printing": '"""Planted."""\n\nprint("hello")\n',
}


def make(folder: Path, target: str, *variables: str, **environment: str) -> str:
    """The output of a target of the Makefile, which has to fail, with this environment: nothing is installed for it."""
    venv = Path(sys.executable).parents[1]
    made = [f"--assume-old={venv}/made/{stamp}" for stamp in ("develop", "rust-tools")]
    inherited = {key: value for key, value in os.environ.items() if key not in {"MAKEFLAGS", "MFLAGS", "MAKELEVEL"}}
    done = subprocess.run(
        ["make", "--keep-going", *made, f"VENV={venv}", *variables, target],
        cwd=folder,
        env=inherited | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0, done.stdout
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the Python half of the gate says of rooms with every kind of bad file."""
    copy = tmp_path_factory.mktemp("gate")
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    shutil.copytree(ROOT / "src", copy / "src", symlinks=True, ignore=ignored)
    for name in ("Makefile", "pyproject.toml", ".gitignore"):
        shutil.copy2(ROOT / name, copy / name)
    for room in ROOMS:
        (copy / room).mkdir()
        if (ROOT / room / "__init__.py").exists():
            shutil.copy2(ROOT / room / "__init__.py", copy / room)
        for kind, text in BAD.items():
            # The room in the name, since mypy knows files by their modules, and those of two folders are in none.
            (copy / room / f"planted_{kind}_{room}.py").write_text(text, encoding="utf-8")
    return make(copy, "lint-python")


@pytest.mark.parametrize("room", ROOMS)
def test_an_unused_import_in_any_room_stops_the_gate(output: str, room: str) -> None:
    assert f"{room}/planted_unused_{room}.py:3:8" in output


@pytest.mark.parametrize("room", ROOMS)
def test_a_badly_formatted_line_in_any_room_stops_the_gate(output: str, room: str) -> None:
    assert f"{room}/planted_unformatted_{room}.py" in output  # which nothing but the formatter objects to


@pytest.mark.parametrize("room", ROOMS)
def test_a_type_error_in_any_room_stops_the_gate(output: str, room: str) -> None:
    assert f"{room}/planted_mistyped_{room}.py:6: error: Incompatible return value" in output


@pytest.mark.parametrize("room", ROOMS)
def test_printing_outside_the_command_line_stops_the_gate(output: str, room: str) -> None:
    assert (f"{room}/planted_printing_{room}.py:3:1" in output) == (room not in {"cli", "benchmarks"})


CRATE = ROOT / "analysis" / "engine"
PYTHON = '#[cfg(feature = "extension-module")]\nmod python;\n'
"""How the crate has what only Python sees."""


def planted_crate(folder: Path, text: str) -> Path:
    """A crate with the settings of ours, and nothing in it but this."""
    (folder / "src").mkdir(parents=True, exist_ok=True)
    for name in ("Cargo.toml", "Cargo.lock", "rustfmt.toml"):
        shutil.copy2(CRATE / name, folder / name)
    (folder / "src" / "lib.rs").write_text(f"//! Planted.\n{text}", encoding="utf-8")
    return folder


def test_a_badly_formatted_line_in_the_crate_stops_the_gate(tmp_path: Path) -> None:
    crate = planted_crate(tmp_path, "\nfn  planted( ){}\n")
    assert f"Diff in {crate}/src/lib.rs" in make(ROOT, "lint-rust-format", f"CRATE={crate}")


def test_a_clippy_warning_in_the_crate_stops_the_gate_also_in_what_only_python_sees() -> None:
    # Always the same folder, inside the target folder: so the dependencies are those that the gate has built already.
    target = CRATE / "target"
    assert PYTHON in (CRATE / "src" / "lib.rs").read_text(encoding="utf-8")
    text = f"{PYTHON}\n/// Planted.\npub fn planted(bytes: &Vec<u8>) -> bool {{\n    bytes.len() == 0\n}}\n"
    crate = planted_crate(target / "planted", text)
    inside = crate / "src" / "python" / "mod.rs"
    inside.parent.mkdir(exist_ok=True)
    planted = "//! Planted.\n\npub fn planted(flag: bool) -> bool {\n    if flag == true { false } else { true }\n}\n"
    inside.write_text(planted, encoding="utf-8")
    output = make(ROOT, "lint-clippy", f"CRATE={crate}", CARGO_TARGET_DIR=str(target))
    assert "clippy::len-zero" in output
    assert "clippy::ptr-arg" in output
    assert "clippy::bool-comparison" in output  # inside the module that is compiled with all features only
