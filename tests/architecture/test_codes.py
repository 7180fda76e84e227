"""Every code of the table is reported somewhere in the product, and expected by some test."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from firable.nets.diagnostics import CODES

ROOT = Path(__file__).parents[2]
TABLES = {"diagnostics.py", "text_positions.py"}  # they list codes, and report none by them
ROOMS = ("nets", "semantics", "analysis", "decompose", "executor", "cli")
CODE = re.compile(r"F\d{4}")

UNSAYABLE = {
    # Text, PNML and JSON have one name or one key for each gate, so only the carrier of the reference cases, which has
    # both a source and an external signal for one gate, can say this; SEMANTICS names it among the malformed nets.
    "F2010": "tests/support/reference.py",
}


def strings(tree: ast.AST) -> Iterator[str]:
    """The text constants of a module that report: not docstrings, nor what a code is only compared with."""
    if isinstance(tree, ast.Compare) or (isinstance(tree, ast.Expr) and isinstance(tree.value, ast.Constant)):
        return
    if isinstance(tree, ast.Constant) and isinstance(tree.value, str):
        yield tree.value
    for child in ast.iter_child_nodes(tree):
        yield from strings(child)


def codes_in(file: Path) -> set[str]:
    source = file.read_text("utf-8")
    if not CODE.search(source):
        return set()
    return {code for text in strings(ast.parse(source)) for code in CODE.findall(text)}


@pytest.fixture(scope="module")
def reported() -> set[str]:
    files = [file for room in ROOMS for file in (ROOT / room).rglob("*.py") if file.name not in TABLES]
    return set().union(*map(codes_in, files))


@pytest.mark.parametrize("code", CODES)
def test_a_code_is_reported_by_the_product(code: str, reported: set[str]) -> None:
    assert (code in reported) is (code not in UNSAYABLE)


@pytest.mark.parametrize(("code", "file"), UNSAYABLE.items())
def test_a_code_that_the_product_cannot_meet_is_reported_by_the_carrier(code: str, file: str) -> None:
    assert code in codes_in(ROOT / file)


def test_no_diagnostic_is_without_a_hint() -> None:
    for file in (file for room in ROOMS for file in (ROOT / room).rglob("*.py")):
        source = file.read_text("utf-8")
        for call in ast.walk(ast.parse(source)) if "Diagnostic" in source else ():
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Diagnostic":
                hints = [*call.args[2:3], *(one.value for one in call.keywords if one.arg == "hint")]
                assert [ast.unparse(hint) for hint in hints] not in ([], ["''"]), f"{file}:{call.lineno}"


def test_only_codes_of_the_table_are_reported(reported: set[str]) -> None:
    assert reported <= set(CODES)


@pytest.mark.parametrize("code", CODES)
def test_a_code_is_expected_by_some_test(code: str) -> None:
    files = [file for file in (ROOT / "tests").rglob("test_*.py") if file != Path(__file__)]
    assert any(code in file.read_text("utf-8") for file in files)
