"""The examples in the docstrings give what they show."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = [
    file.relative_to(ROOT)
    for room in ("nets", "semantics", "analysis", "decompose", "executor", "cli")
    for file in sorted((ROOT / room).rglob("*.py"))
    if ">>> " in file.read_text("utf-8")
]


def test_there_are_examples() -> None:
    assert len(FILES) > 20


@pytest.mark.parametrize("file", FILES, ids=str)
def test_the_examples_of_a_module_are_true(file: Path) -> None:
    parts = [part for part in file.with_suffix("").parts if part != "__init__"]
    done = doctest.testmod(import_module(".".join(("firable", *parts))))
    assert done.attempted > 0
    assert done.failed == 0
