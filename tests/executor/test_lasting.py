"""A cell that has run for long runs as in its first minutes: what `benchmarks/lasting.py` measures for a day."""

import sys
from pathlib import Path

import pytest


def test_many_cycles_are_as_long_as_their_times_say_and_leave_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    import lasting

    first, many = lasting.lasted(20), lasting.lasted(50)
    assert abs(lasting.drift_seconds(many, first, lasting.cycle_seconds())) < 1e-6
    assert many.journal_kb == first.journal_kb
    assert many.report.delivered == tuple(range(1, 51))
    assert sum(many.report.firings.values()) == 15 * 50
    sys.modules.pop("lasting")
