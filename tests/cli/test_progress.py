"""The line that tells how far an exploration has come: on a terminal or on request, and never in a report."""

import io

import pytest

from firable.cli.main import main
from firable.cli.progress import ProgressLine, progress_line


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    def __init__(self) -> None:
        self.now_seconds = 0.0

    def __call__(self) -> float:
        return self.now_seconds


def test_nothing_is_told_of_what_is_done_within_a_second() -> None:
    clock, terminal = Clock(), Terminal()
    line = ProgressLine(terminal, clock)
    clock.now_seconds = 0.9
    line(1_000, 2_000)
    line.wipe()
    assert terminal.getvalue() == ""


def test_a_line_is_written_over_itself_now_and_then_and_wiped() -> None:
    clock, terminal = Clock(), Terminal()
    line = ProgressLine(terminal, clock)
    for clock.now_seconds, n_markings in ((1.0, 1_000_000), (1.1, 1_500_000), (1.2, 99)):
        line(n_markings, 7)
    first, second = "  1,000,000 markings, 7 edges, 1 s", "  99 markings, 7 edges, 1 s"
    assert terminal.getvalue() == f"\r{first}\r{second.ljust(len(first))}"
    line.wipe()
    line.wipe()
    assert terminal.getvalue().endswith(f"\r{' ' * len(second)}\r")


def test_a_log_gets_whole_lines_and_fewer() -> None:
    clock, log = Clock(), io.StringIO()
    line = ProgressLine(log, clock)
    for clock.now_seconds in (1.0, 2.0, 2.5, 3.25):
        line(10, 20)
    line.wipe()
    assert log.getvalue() == "  10 markings, 20 edges, 1 s\n  10 markings, 20 edges, 3 s\n"


def test_by_default_the_line_is_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    for stream, shown in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr("sys.stderr", stream)
        with progress_line(None) as line:
            assert (line is not None) == shown
        with progress_line(wanted=False) as line:
            assert line is None
        with progress_line(wanted=True) as line:
            assert line is not None


def test_a_long_check_tells_how_far_it_is_and_the_report_is_the_same(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("firable.cli.progress.SILENT_SECONDS", 0.0)
    monkeypatch.setattr("firable.cli.progress.EVERY_SECONDS", 0.0)
    arguments = ["check", "catalogue:philosophers-11", "--no-cache"]
    assert main([*arguments, "--progress"]) == 1
    told = capsys.readouterr()
    assert "markings, " in told.err
    assert "edges, 0 s" in told.err or " s\n" in told.err
    assert main([*arguments, "--no-progress"]) == 1
    silent = capsys.readouterr()
    assert (silent.out, silent.err) == (told.out, "")
