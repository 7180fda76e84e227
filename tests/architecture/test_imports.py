"""Who may import whom, read from the source of every room, and what the executor loads when it runs."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.executor_modules import executor_modules

from firable.cli.main import main

ROOT = Path(__file__).parents[2]

MAY_IMPORT = {
    "nets": set[str](),
    "semantics": {"nets"},
    "analysis": {"semantics", "nets"},
    "decompose": {"analysis", "semantics", "nets"},
    "executor": {"semantics", "nets"},
    "cli": {"executor", "decompose", "analysis", "semantics", "nets"},
}
PROVERS = {"z3", "networkx", "numpy", "highspy", "cvc5"}
THIN = {"nets", "semantics", "executor"}


def imported(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno} imports relatively"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_the_rooms_of_this_test_are_the_rooms_of_the_package() -> None:
    linked = {path.name for path in (ROOT / "src" / "firable").iterdir() if path.is_symlink()}
    assert linked == set(MAY_IMPORT)
    assert all((ROOT / "src" / "firable" / room).resolve() == ROOT / room for room in linked)


@pytest.mark.parametrize("room", sorted(MAY_IMPORT))
def test_a_room_imports_only_the_rooms_below_it(room: str) -> None:
    files = sorted((ROOT / room).rglob("*.py"))
    assert files
    for file in files:
        for name in imported(file):
            first, _, rest = name.partition(".")
            assert first not in MAY_IMPORT, f"{file}: `import {name}` must be `import firable.{name}`"
            if first == "firable" and (target := rest.partition(".")[0]) in MAY_IMPORT:
                assert target in MAY_IMPORT[room] | {room}, f"{file} imports firable.{target}"
            if room in THIN:
                assert first not in PROVERS, f"{file} imports {first}"


def loaded_by(code: str) -> set[str]:
    shown = f"{code}\nimport sys\nprint(' '.join(sorted({{name.partition('.')[0] for name in sys.modules}})))"
    done = subprocess.run([sys.executable, "-c", shown], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.split())


def test_the_executor_loads_no_prover_at_run_time() -> None:
    modules = executor_modules()
    loaded = loaded_by("import " + ", ".join(modules))
    assert "firable" in loaded
    assert not loaded & PROVERS
    rooms = (
        f"{'import ' + ', '.join(modules)}\nimport sys\nprint(*(n for n in sys.modules if n.startswith('firable.')))"
    )
    names = subprocess.run([sys.executable, "-c", rooms], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert {name.split(".")[1] for name in names.split()} <= THIN


def test_the_command_line_starts_without_loading_what_only_commands_need() -> None:
    loaded = loaded_by("import firable.cli.main")
    assert not loaded & (PROVERS | {"pydantic", "yaml", "asyncio"})


def test_the_checker_of_evidence_loads_nothing_that_finds_any() -> None:
    code = (
        "import firable.analysis.evidence.checking.checker, sys\n"
        "print(*(n for n in sys.modules if n.startswith('firable.analysis.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = {name.removeprefix("firable.analysis.") for name in done.stdout.split()}
    of_evidence = {name for name in loaded if name == "evidence" or name.startswith("evidence.")}
    assert "evidence.checking.checker" in loaded
    assert not {name for name in of_evidence if name.startswith("evidence.producing")}
    # How a term is written for a solver, and how a deadline ends: nothing else of the room.
    assert loaded - of_evidence == {"deadline", "induction", "induction.encoding", "induction.smt"}


def test_the_checker_of_bundles_loads_nothing_that_makes_them() -> None:
    code = (
        "import pkgutil, sys, firable.decompose.verification as room\n"
        "names = [m.name for m in pkgutil.iter_modules(room.__path__)]\n"
        "for name in names: __import__(f'firable.decompose.verification.{name}')\n"
        "print(*(n for n in sys.modules if n.startswith('firable.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = {name.removeprefix("firable.") for name in done.stdout.split()}
    made_by = {
        name for name in loaded if name.startswith("decompose.") and not name.startswith("decompose.verification")
    }
    assert "decompose.verification.checking" in loaded
    assert not made_by
    assert not {name for name in loaded if name.startswith("analysis.evidence.producing")}
    assert not {name for name in loaded if name.startswith(("analysis.spaces", "analysis.verdicts", "analysis.check"))}


def test_the_process_that_verifies_a_bundle_holds_nothing_that_makes_one(tmp_path: Path) -> None:
    bundle = tmp_path / "cell.bundle"
    assert main(["bundle", "catalogue:conceptual_one_robot", "-o", str(bundle)]) == 0
    code = (
        "import sys\nfrom firable.cli.main import main\n"
        f"code = main(['verify', {str(bundle)!r}])\n"
        "print('loaded:', *(n for n in sys.modules if n.startswith('firable.')))\nsys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = done.stdout.rpartition("loaded:")[2].split()
    assert "firable.decompose.verification.checking" in loaded
    made_by = ("firable.decompose.", "firable.analysis.spaces", "firable.analysis.check")
    checker = "firable.decompose.verification"
    assert [name for name in loaded if name.startswith(made_by) and not name.startswith(checker)] == []


@pytest.mark.parametrize("file", sorted((ROOT / "decompose" / "verification").glob("*.py")), ids=lambda f: f.stem)
def test_what_is_stated_anew_uses_no_text_of_the_rule_that_was_proved(file: Path) -> None:
    rooms = {name.removeprefix("firable.") for name in imported(file) if name.startswith("firable.")}
    assert not {
        name for name in rooms if name.startswith(("decompose.proofs", "decompose.splitting", "decompose.protocol"))
    }
    if file.stem != "documents":  # which checks evidence on the net by the one checker of evidence
        assert not {name for name in rooms if name.startswith(("analysis.", "semantics."))}
