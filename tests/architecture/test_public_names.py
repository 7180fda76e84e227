"""The names that a room says a program imports from it are there, each once, and load what is heavy only when asked."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import firable.analysis
import firable.decompose
import firable.nets
import firable.semantics

ROOT = Path(__file__).parents[2]
ROOMS = pytest.mark.parametrize(
    "room",
    [firable.nets, firable.semantics, firable.analysis, firable.decompose],
    ids=lambda room: room.__name__,
)


def modules_of(room: ModuleType) -> set[str]:
    """The modules of a room and of its folders, by their names within the room, and the folders themselves."""
    folder = ROOT / room.__name__.removeprefix("firable.")
    files = (file.relative_to(folder) for file in folder.rglob("*.py") if file.stem != "__main__")
    parts = (file.parts[:-1] if file.stem == "__init__" else file.with_suffix("").parts for file in files)
    return {".".join(part) for part in parts if part}


@ROOMS
def test_each_public_name_is_defined_in_one_module_of_its_room_and_explained(room: ModuleType) -> None:
    assert len(set(room.__all__)) == len(room.__all__)
    modules = [import_module(f"{room.__name__}.{name}") for name in modules_of(room)]
    for name in room.__all__:
        value = getattr(room, name)
        defined_in = {getattr(value, "__module__", "")} & {module.__name__ for module in modules}
        compiled = value.__module__ == "firable.analysis._engine"
        assert compiled or len(defined_in) == 1, name
        beside = [module for module in modules if module.__name__.count(".") == room.__name__.count(".") + 1]
        same = [module.__name__ for module in beside if name in vars(module) and vars(module)[name] is not value]
        assert not same, f"{same} mean something else by {name}"
        assert f"`{name}`" in (room.__doc__ or ""), f"the docstring says nothing of {name}"


@ROOMS
def test_no_public_name_hides_a_module(room: ModuleType) -> None:
    assert not modules_of(room) & set(room.__all__)


def test_the_analysis_loads_nothing_heavy_before_it_is_asked() -> None:
    heavy = ("numpy", "z3", "networkx", "highspy")
    program = f"import sys, firable.analysis; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_the_records_of_a_net_load_no_reader_and_neither_does_the_right_to_run() -> None:
    program = (
        "import sys; from firable.nets import Net, Verdict; import firable.nets.right_to_run;"
        " print([name for name in ('yaml', 'pydantic') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_name_that_the_analysis_has_not_is_refused_and_the_others_are_listed() -> None:
    with pytest.raises(AttributeError, match=r"'firable\.analysis' has no attribute 'chekc'"):
        getattr(firable.analysis, "chekc")  # noqa: B009 - spelt out, a type checker refuses it, as it should
    assert set(firable.analysis.__all__) <= set(dir(firable.analysis))
