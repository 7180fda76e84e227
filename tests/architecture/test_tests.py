"""A test does what is written in it: a body that it defines and never calls cannot fail."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]


def never_used(source: str) -> list[str]:
    """The functions that a function defines within itself and does not name again; decorators may use theirs."""
    return [
        inner.name
        for outer in ast.walk(ast.parse(source))
        if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef)
        for inner in outer.body
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef) and not inner.decorator_list
        if not any(isinstance(node, ast.Name) and node.id == inner.name for node in ast.walk(outer))
    ]


@pytest.mark.parametrize("path", sorted(TESTS.rglob("*.py")), ids=lambda path: str(path.relative_to(TESTS)))
def test_what_a_test_defines_it_runs(path: Path) -> None:
    assert never_used(path.read_text(encoding="utf-8")) == []


def test_a_body_that_nobody_calls_is_found() -> None:
    assert never_used("def test():\n    async def main(): ...\n") == ["main"]
    assert never_used("def test():\n    async def main(): ...\n    run(main())\n") == []
