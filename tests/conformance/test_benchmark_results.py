"""What `benchmarks/RESULTS.md` draws is what its tables say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from measuring import Table

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def cells(monkeypatch: pytest.MonkeyPatch) -> tuple[str, Table]:
    """The section of the results on generated cells, and its table as it was when it was written."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from measuring import Table
    from splitting import CELLS

    results = (BENCHMARKS / "RESULTS.md").read_text(encoding="utf-8")
    section = results.partition(f"## {CELLS}\n")[2].partition("\n## ")[0]
    head, _, *rows = [
        tuple(cell.strip() for cell in line.strip("|").split("|")) for line in section.splitlines() if line[:1] == "|"
    ]
    return section, Table(CELLS, "", head, tuple(rows))


def test_the_curve_of_the_obligations_is_drawn_from_the_table_that_stands_above_it(cells: tuple[str, Table]) -> None:
    from splitting import with_curves

    section, table = cells
    assert len(table.rows) >= 3
    assert with_curves(table).drawn in section


def test_the_charts_have_each_figure_of_the_table_and_no_other(cells: tuple[str, Table]) -> None:
    section, table = cells
    seconds, each = (dict(zip(table.columns, column, strict=True)) for column in (table.rows[-1], table.rows[0]))
    of_seconds, of_each = re.findall(r"```mermaid\n(.*?)```", section, re.DOTALL)
    bars = [re.search(r"bar \[(.*)\]", chart) for chart in (of_seconds, of_each)]
    shown = [found[1].split(", ") for found in bars if found]
    assert shown[0] == [row[table.columns.index("prove, s")].split()[0] for row in table.rows]
    assert shown[1] == [row[table.columns.index("ms/transition")] for row in table.rows]
    for chart in (of_seconds, of_each):
        assert f'"{seconds["transitions"]}"]' in chart
        assert f'["{each["transitions"]}"' in chart
    level = re.search(r"line \[(.*)\]", of_each)
    assert level
    assert set(level[1].split(", ")) == {each["ms/transition"]}


def test_a_table_that_is_measured_anew_is_drawn_anew(cells: tuple[str, Table]) -> None:
    from dataclasses import replace

    from splitting import with_curves

    section, table = cells
    at = table.columns.index("prove, s")
    changed = replace(table, rows=(*table.rows[:-1], (*table.rows[-1][:at], "999.99", *table.rows[-1][at + 1 :])))
    assert with_curves(changed).drawn not in section
    assert with_curves(changed).markdown().endswith("```\n")
