"""The line that tells how far an exploration has come: on a terminal or on request, and never in a report."""

import io
import re
import signal
from collections.abc import Callable
from pathlib import Path
from threading import Event
from typing import Any

import pytest

import firable.analysis.check
from firable.analysis.spaces import reachability
from firable.cli.main import main
from firable.cli.progress import ProgressLine, progress_line, stages


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


def test_a_log_hears_of_what_is_as_it_was_once_a_minute() -> None:
    clock, log = Clock(), io.StringIO()
    line = ProgressLine(log, clock)
    line.begins("this")
    for clock.now_seconds in (1.0, 4.0, 60.9, 61.0):
        line.tell()
    line.say("that")
    clock.now_seconds = 63.0
    line.tell()
    assert log.getvalue() == "  this, 1 s\n  this, 61 s\n  this: that, 63 s\n"


def test_a_log_hears_of_what_nobody_asked_to_be_told_once_a_minute() -> None:
    clock, log = Clock(), io.StringIO()
    line = ProgressLine(log, clock, wanted=False)
    line.begins("this")
    for clock.now_seconds in (1.0, 59.9, 60.0, 90.0, 119.9, 120.0):
        line(round(clock.now_seconds), 0)
    line.wipe()
    assert log.getvalue() == "  this: 60 markings, 0 edges, 60 s\n  this: 120 markings, 0 edges, 120 s\n"
    clock.now_seconds = 200.0
    ProgressLine(log, clock, wanted=False).tell()
    assert log.getvalue().count("\n") == 2, "nothing was said of what is done"


def test_by_default_a_line_at_once_is_for_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.cli.progress.SILENT_SECONDS", 0.0)
    for stream, shown in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr("sys.stderr", stream)
        for wanted in (None, True):
            with progress_line(wanted) as line:
                assert line is not None
                line.say("something")
                assert ("something" in stream.getvalue()) == (shown or wanted is True)
        with progress_line(wanted=False) as line:
            assert line is None


def test_a_line_is_told_again_while_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    told = Event()
    monkeypatch.setattr(ProgressLine, "tell", lambda _: told.set())
    with progress_line(wanted=True):
        assert told.wait(60)


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


def test_a_check_with_machines_tells_how_far_it_is_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("firable.cli.progress.SILENT_SECONDS", 0.0)
    monkeypatch.setattr("firable.cli.progress.EVERY_SECONDS", 0.0)
    explored: list[int] = []
    explored_by = reachability.explore

    def explore(
        *arguments: Any, progress: Callable[[int, int], object] | None = None, **options: Any
    ) -> reachability.ReachabilityGraph:
        explored.append(len(explored))
        if progress is not None:
            progress(explored[-1], 0)
        return explored_by(*arguments, progress=progress, **options)

    monkeypatch.setattr(firable.analysis.check, "explore", explore)
    cell = "catalogue:one_robot"
    assert main(["check", cell, "--machines", cell, "--progress"]) == 0
    told = capsys.readouterr()
    said = (
        "the cell with its machines: 0 markings",
        "the cell with gates free: 1 markings",
        "the cell of which a machine fails for good: 2 markings",
    )
    assert re.findall(r"^  (.*, 0 edges), \d+ s$", told.err, re.MULTILINE) == [f"{one}, 0 edges" for one in said]
    assert len(explored) == 3
    assert main(["check", cell, "--machines", cell, "--no-progress"]) == 0
    silent = capsys.readouterr()
    assert (silent.out, silent.err) == (told.out, "")


def test_stages_tell_what_is_done_and_for_how_long_and_are_wiped() -> None:
    clock, terminal = Clock(), Terminal()
    line = ProgressLine(terminal, clock)
    line.begins("Eq. (7)")
    clock.now_seconds = 0.9
    line.tell()
    assert terminal.getvalue() == ""
    for clock.now_seconds, words in ((1.0, "arbitration"), (2.0, "O2")):
        line.begins(words)
        line.tell()
    assert terminal.getvalue() == f"\r  arbitration, 1 s\r{'  O2, 2 s'.ljust(18)}"
    line.wipe()
    line.wipe()
    assert terminal.getvalue().endswith(f"\r{' ' * len('  O2, 2 s')}\r")


def test_what_was_said_of_one_stage_is_not_said_of_the_next() -> None:
    clock, terminal = Clock(), Terminal()
    line = ProgressLine(terminal, clock)
    line.begins("the loop")
    clock.now_seconds = 1.0
    line(7, 8)
    clock.now_seconds = 2.0
    line.begins("its faults")
    line.tell()
    first = "  the loop: 7 markings, 8 edges, 1 s"
    assert terminal.getvalue() == f"\r{first}\r{'  its faults, 2 s'.ljust(len(first))}"


def test_a_stage_of_many_words_is_one_line_of_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    clock, terminal = Clock(), Terminal()
    line = ProgressLine(terminal, clock)
    line.begins("what is said of this stage is long")
    clock.now_seconds = 2.0
    line.tell()
    assert terminal.getvalue() == f"\r{'  what is said of this stage'[:19]}", "what is broken could not be wiped"


def test_stages_are_told_by_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(ProgressLine, "begins", lambda _, doing: said.append(doing))
    with stages() as begins:
        begins("Eq. (7)")
    assert said == ["Eq. (7)"]


NET = "catalogue:conceptual_one_robot"


def interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_ctrl_c_in_a_proof_shows_what_is_known_so_far(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("firable.decompose.proofs.families.theorem", interrupt)
    assert main(["prove", NET]) == 3
    told = capsys.readouterr().out
    assert "✓   6 of 6   Eq. (7)" in told
    assert "?   0 of 1   protocol" in told
    assert "interrupted" in told


def test_ctrl_c_in_the_exploration_of_a_protocol_shows_what_is_known_so_far(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("firable.decompose.protocol.outages.inquests", interrupt)
    assert main(["prove", NET, "--faults"]) == 3
    told = capsys.readouterr().out
    assert "✓ proved    explored.follows" in told
    assert "explored.asked" in told
    assert "interrupted" in told


def test_ctrl_c_while_a_bundle_is_checked_leaves_the_rest_claimed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bundle = str(tmp_path / "cell.bundle")
    assert main(["bundle", NET, "-o", bundle]) == 0
    capsys.readouterr()
    monkeypatch.setattr("firable.decompose.verification.checking.check_verdicts_on_the_net", interrupt)
    assert main(["verify", bundle]) == 3
    told = capsys.readouterr().out
    assert "6 of 6    eq7 " in told
    assert re.search(r"\? claimed +deadlock-free", told)
    assert "interrupted" in told


def test_a_technique_that_is_named_tells_how_far_it_is_and_ends_by_itself(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("firable.cli.progress.SILENT_SECONDS", 0.0)
    monkeypatch.setattr("firable.cli.progress.EVERY_SECONDS", 0.0)
    monkeypatch.setattr(firable.analysis.check, "ALONE_STEPS", 7)
    arguments = ["check", "catalogue:one_robot", "--method", "bounded", "--no-cache"]
    assert main([*arguments, "--progress"]) == 3
    told = capsys.readouterr()
    assert "  deadlock-free: no run of up to 7 steps of firings in parallel, " in told.err
    assert "reached: bounded model checking gave up: no run of up to 7 steps of firings in parallel leads" in told.out
    assert "reached: bounded model checking does not decide it" in told.out  # whether it is live


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_in_a_bounded_search_shows_how_far_it_has_come(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(_: ProgressLine, words: str) -> None:
        if words.startswith("deadlock-free: no run of up to 3 "):
            signal.raise_signal(signal.SIGINT)  # the main thread hears of it

    monkeypatch.setattr(ProgressLine, "say", interrupt)
    assert main(["check", "catalogue:one_robot", "--method", "bounded", "--no-cache", "--progress"]) == 3
    told = capsys.readouterr().out
    assert "\n  interrupted\n" in told
    assert re.search(r"deadlock-free: bounded model checking gave up: no run of up to \d+ steps", told)
    assert "reached: bounded model checking was not asked any more" in told
