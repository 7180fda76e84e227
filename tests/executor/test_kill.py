"""Runs that are killed (SIGKILL) at any moment and taken up: nothing is lost, nothing done twice, nothing guessed."""

import asyncio
import errno
import io
import json
import os
import re
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from support.cells import decomposition_of, plant_of
from support.examples import seeds

from firable.cli.main import main
from firable.executor import Conduct, SimulatedCell, State, execute
from firable.executor.cell.cell_log import CellLog
from firable.executor.cell.plant import Plant
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import until
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.journal.sqlite_journal import SqliteJournal
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.running import Operator, RunReport
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.deciders import coordinators
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Place
from firable.semantics.replaying import replay
from firable.semantics.trace import CommandSent, Fired, Noted, Trace, read_trace

TESTS = Path(__file__).parent.parent


def lives(folder: Path, cell: str, workpieces: int, seed: int, *speed: str) -> dict[str, Any]:
    """What `support/killing.py` says at the end of many processes."""
    arguments = [str(folder), cell, str(workpieces), str(seed), *speed]
    command = [sys.executable, str(TESTS / "support" / "killing.py"), *arguments]
    path = {"PYTHONPATH": ":".join([str(TESTS), *sys.path])}
    ended = subprocess.run(command, capture_output=True, text=True, env=path, check=False, timeout=300)
    assert ended.returncode == 0, ended.stderr
    said: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
    assert said["code"] == 0, ended.stderr
    return said


@pytest.mark.seeds
@pytest.mark.parametrize(
    ("cell", "speed"), [("one_robot", ()), ("two_robots_shared", ()), ("one_robot", ("200",))], ids=str
)
def test_cell_whose_controllers_are_killed_again_and_again_does_all_its_work_once(
    cell: str, speed: tuple[str, ...], tmp_path: Path
) -> None:
    """In virtual time, and with a speed on an event loop whose thread stores while the acts go on."""
    while_storing = 0
    for seed in seeds(1):
        folder = tmp_path / str(seed)
        folder.mkdir()
        ended = lives(folder, cell, 4, seed, *speed)
        assert ended["killed"] > 2
        while_storing += ended["while storing"]
        assert (ended["state"], ended["delivered"], ended["lost"], ended["doubled"]) == ("done", [1, 2, 3, 4], [], [])
        trace = read_trace(folder / "trace.jsonl")
        replayed = replay(decomposition_of(cell).net, trace)  # each command once for each entry, too
        assert replayed.complete
        fired = Counter(t for event in trace.events if isinstance(event, Fired) for t in event.transitions)
        assert set(fired.values()) == {4}
        told = [event.place for event in trace.events if isinstance(event, CommandSent)]
        inputs = [json.loads(line) for line in (folder / "cell.journal.cell").read_text("utf-8").splitlines()[1:]]
        received = [(place, entry) for _, what, *rest in inputs if what == "send" for place, entry, _ in [rest]]
        assert len(set(received)) == len(received), "a machine was commanded twice for one entry"
        assert Counter(place for place, _ in received) == Counter(told)
        assert main(["replay", str(folder / "trace.jsonl"), "--net", f"catalogue:{cell}"]) == 0
    assert bool(while_storing) == bool(speed)


def run_here(
    folder: Path,
    *,
    seconds: float | None = None,
    operator: Operator | None = None,
    trace: str | None = "trace.jsonl",
    workpieces: int = 2,
    **options: Any,
) -> tuple[RunReport, Trace | None]:
    """A run with a journal, or its taking up; with `seconds`, the operator stops it then."""

    async def stops(host: Any) -> None:
        await asyncio.sleep(seconds or 0)
        host.stop()

    report = execute(
        decomposition_of("one_robot"),
        SimulatedCell(plant_of("one_robot"), workpieces=workpieces),
        Conduct(
            trace=folder / trace if trace else None,
            journal_path=folder / "cell.journal",
            operator=operator or (stops if seconds is not None else None),
            **options,
        ),
        digest="d",
    )
    return report, read_trace(folder / trace) if trace else None


def refused(folder: Path, **options: Any) -> tuple[str, str]:
    with pytest.raises(InputError) as caught:
        run_here(folder, **options)
    (diagnostic,) = caught.value.diagnostics
    return diagnostic.code, diagnostic.message


def test_restart_moves_nothing_and_says_what_became_of_each_command(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=20.0)
    report, trace = run_here(tmp_path)
    assert report.state is State.HELD
    assert "nothing moves until it is resumed" in report.situation.message
    assert "was issued, and nobody knows what became of it" in report.situation.message
    assert trace is not None
    notes = [i for i, event in enumerate(trace.events) if isinstance(event, Noted) and event.note == "restarted"]
    assert not [event for event in trace.events[notes[0] :] if isinstance(event, Fired | CommandSent)]


def test_run_is_not_resumed_on_a_guess_and_goes_on_when_the_operator_has_said(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=20.0)
    report, _ = run_here(tmp_path, resume=True)
    assert report.state is State.HELD
    unknown = [part.split("'")[3] for part in report.situation.message.split("; ") if "nobody knows" in part]
    assert f"--say {unknown[0]}=done" in report.situation.message
    said = dict.fromkeys(unknown, Answer.NOT_RECEIVED)
    report, trace = run_here(tmp_path, resume=True, said=said)
    assert (report.state, report.delivered) == (State.DONE, (1, 2))
    assert trace is not None
    assert replay(decomposition_of("one_robot").net, trace).complete
    again = [event.data["place"] for event in trace.events if isinstance(event, Noted) and event.note == "sent again"]
    assert again == unknown


def test_operator_who_is_there_resumes_a_run(tmp_path: Path) -> None:
    async def resumes(host: Any) -> None:
        await host.quiet()
        assert host.situation().state is State.HELD
        await until(host.resume, "the answers of the machines")

    left = half_done(tmp_path)
    looked = run_here(left)[0].situation  # to look changes nothing
    assert looked.state is State.HELD
    assert run_here(left)[0].situation.marking == looked.marking
    report, _ = run_here(left, operator=resumes)
    assert (report.state, report.delivered) == (State.DONE, (1, 2))


@pytest.mark.parametrize("moment", [1, 3, 4, 7, 12, 19])
def test_run_that_is_killed_as_it_begins_is_begun_again(moment: int, tmp_path: Path) -> None:
    report, trace = run_here(half_done(tmp_path, moment), resume=True)
    assert (report.state, report.delivered) == (State.DONE, (1, 2))
    assert trace is not None
    assert replay(decomposition_of("one_robot").net, trace).complete


def half_done(folder: Path, moment: int = 600) -> Path:
    """What a run leaves that is killed at a moment."""
    killed = folder / "killed"
    killed.mkdir()
    arguments = [str(killed), "one_robot", "2", "0", str(moment)]
    program = (
        "import sys; from pathlib import Path; from support.killing import live;"
        "live(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5]))"
    )
    path = {"PYTHONPATH": ":".join([str(TESTS), *sys.path])}
    ended = subprocess.run([sys.executable, "-c", program, *arguments], env=path, check=False, timeout=60)
    assert ended.returncode == -9
    return killed


def test_run_that_is_done_is_done_when_it_is_taken_up(tmp_path: Path) -> None:
    run_here(tmp_path)
    report, trace = run_here(tmp_path, resume=True)
    assert (report.state, report.delivered) == (State.DONE, (1, 2))
    assert trace is not None
    assert replay(decomposition_of("one_robot").net, trace).complete


def test_cell_of_other_workpieces_is_not_taken_up(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    code, message = refused(tmp_path, workpieces=3)
    assert code == "F5035"
    assert "not of 3 workpieces" in message


def test_journal_whose_cell_is_gone_is_not_taken_up(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    (tmp_path / "cell.journal.cell").unlink()
    assert refused(tmp_path)[0] == "F5035"


def test_cell_whose_journal_is_gone_is_not_commanded_as_if_it_was_new(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    (tmp_path / "cell.journal").unlink()
    (tmp_path / "cell.journal.generation").unlink()
    (tmp_path / "trace.jsonl").unlink()
    assert refused(tmp_path) == (
        "F5035",
        f"{tmp_path}/cell.journal.cell: the simulated cell was commanded by a run whose journal is gone",
    )
    assert list(tmp_path.iterdir()) == [tmp_path / "cell.journal.cell"]
    parts = decomposition_of("one_robot")
    names = (*coordinators(parts), *(subnet.name for subnet in parts.subnets))
    SqliteJournal(tmp_path / "cell.journal", "d", names).close()  # which a run leaves that has never begun
    assert refused(tmp_path)[0] == "F5035"


def test_log_of_a_cell_that_is_damaged_is_refused(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    log = tmp_path / "cell.journal.cell"
    log.write_text(log.read_text("utf-8") + "[1.0]\n", "utf-8")
    code, message = refused(tmp_path)
    assert code == "F5035"
    assert "'[1.0]' is no line of it" in message


def test_log_of_a_cell_in_which_any_byte_has_changed_is_refused_or_has_lost_its_last_line(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=8.0)
    path, plant = tmp_path / "cell.journal.cell", plant_of("one_robot")
    with closing(CellLog(path, plant, 2, 0)) as log:
        past = log.past
    data = path.read_bytes()
    assert len(past) > 5
    for at in range(len(data)):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0x11]) + data[at + 1 :])
        if at == len(data) - 1:  # the end of the last line, which was cut off then
            with closing(CellLog(path, plant, 2, 0)) as log:
                assert log.past == past[:-1]
        else:
            with pytest.raises(InputError, match="F5035"):
                CellLog(path, plant, 2, 0)


def test_log_of_a_cell_in_which_a_line_is_missing_is_refused(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    log = tmp_path / "cell.journal.cell"
    lines = log.read_text("utf-8").splitlines(keepends=True)
    log.write_text("".join([*lines[:2], *lines[3:]]), "utf-8")
    code, message = refused(tmp_path)
    assert code == "F5035"
    assert "does not follow on the one before" in message


def test_log_of_a_cell_that_is_shorter_than_its_journal_says_is_refused_and_one_that_is_longer_is_not(
    tmp_path: Path,
) -> None:
    """Of what the cell was given after the last sync, by nobody as well, the journal does not know."""
    run_here(tmp_path, seconds=20.0)
    log = tmp_path / "cell.journal.cell"
    header, *inputs = log.read_text("utf-8").splitlines(keepends=True)
    log.write_text("".join([header, *inputs[:1]]), "utf-8")
    code, message = refused(tmp_path)
    assert code == "F5035"
    told = re.search(r"it has 1 of the (\d+) inputs that it had when its journal was written last", message)
    assert told is not None
    synced = int(told[1])
    assert 5 < synced <= len(inputs)
    log.write_text("".join([header, *inputs[: synced - 1]]), "utf-8")
    assert f"it has {synced - 1} of the {synced} inputs" in refused(tmp_path)[1]
    log.unlink()
    with closing(CellLog(log, plant_of("one_robot"), 2, 0)) as other:
        for at in range(synced + 3):
            other.add(float(at), "advance")
    assert f"its first {synced} inputs are not those that it had" in refused(tmp_path)[1]
    log.write_text("".join([header, *inputs[:synced]]), "utf-8")
    with closing(CellLog(log, plant_of("one_robot"), 2, 0)) as longer:
        longer.add(longer.end_seconds + 1, "advance")
    assert run_here(tmp_path)[0].state is State.HELD


def test_log_of_a_cell_of_another_format_is_refused_by_it(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=5.0)
    log = tmp_path / "cell.journal.cell"
    log.write_text(log.read_text("utf-8").replace('"firable_cell": 3', '"firable_cell": 2'), "utf-8")
    assert "it has format 2, and this firable writes 3" in refused(tmp_path)[1]


def test_file_that_is_no_log_of_a_cell_stays_as_it_is(tmp_path: Path) -> None:
    other = tmp_path / "other"
    for content in (b"precious\nand its end", b"precious"):
        other.write_bytes(content)
        with pytest.raises(InputError, match="F5035"):
            CellLog(other, plant_of("one_robot"), 2, 0)
        assert other.read_bytes() == content


def test_input_of_which_the_disk_takes_a_part_only_has_no_effect_and_ends_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, plant, write = tmp_path / "cell", plant_of("one_robot"), os.write
    log = CellLog(path, plant, 2, 0)
    log.add(1.0, "advance")
    mark, left = log.mark, [10]

    def on_a_full_disk(descriptor: int, data: bytes) -> int:
        if not left[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = write(descriptor, data[: left[0]])
        left[0] -= written
        return written

    monkeypatch.setattr(os, "write", on_a_full_disk)
    with pytest.raises(InputError, match="the simulated cell cannot be kept: No space left on device") as full:
        log.add(2.0, "send", "robot.to_cv1", 1)
    assert "make room on its disk" in full.value.diagnostics[0].hint
    monkeypatch.undo()
    assert log.mark == mark, "or the journal would keep a mark that no log has"
    log.close()
    with closing(CellLog(path, plant, 2, 0)) as again:
        again.demand(mark)
        assert again.past == ((1.0, "advance", ()),)
        again.add(3.0, "advance")
    with closing(CellLog(path, plant, 2, 0)) as last:
        assert [at for at, _, _ in last.past] == [1.0, 3.0]


@pytest.mark.parametrize(
    ("first", "then", "says"),
    [
        ("trace.jsonl", "other.jsonl", "cannot be begun in the middle"),
        (None, "trace.jsonl", "begun without a trace"),
    ],
)
def test_trace_is_not_begun_in_the_middle(tmp_path: Path, first: str | None, then: str, says: str) -> None:
    run_here(tmp_path, seconds=5.0, trace=first)
    code, message = refused(tmp_path, trace=then)
    assert code == "F1017"
    assert says in message


def test_trace_that_has_lost_lines_is_not_gone_on_with(tmp_path: Path) -> None:
    run_here(tmp_path, seconds=20.0)
    (tmp_path / "trace.jsonl").write_text("")
    code, message = refused(tmp_path)
    assert code == "F1017"
    assert "shorter than its journal says" in message


@pytest.mark.parametrize("empty", [100, None], ids=["in the middle", "to the end"])
def test_trace_with_a_block_that_was_never_written_is_not_gone_on_with(tmp_path: Path, empty: int | None) -> None:
    """As a power cut leaves it: nobody could read what comes behind."""
    run_here(tmp_path, seconds=20.0)
    path = tmp_path / "trace.jsonl"
    told = bytearray(path.read_bytes())
    half = len(told) // 2
    end = len(told) if empty is None else half + empty
    told[half:end] = bytes(end - half)
    path.write_bytes(told)
    code, message = refused(tmp_path)
    assert code == "F1017"
    assert "its last lines are not text" in message
    assert path.read_bytes() == told


class Failing(MemoryJournal):
    """A journal whose disk is full after some syncs."""

    def __init__(self, syncs: int) -> None:
        super().__init__()
        self.left = syncs

    def sync(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise InputError([Diagnostic("F5034", "the disk is full", "make room")])


@pytest.mark.parametrize("syncs", [0, 1, 5, 20])
def test_nothing_leaves_that_the_journal_does_not_have(syncs: int) -> None:
    net, stream = decomposition_of("one_robot").net, io.StringIO()
    plant = Plant(plant_of("one_robot"), workpieces=2)
    sent: list[tuple[int, str]] = []
    journal = Failing(syncs)

    class Noting(SimulatedDriver):
        def send(self, place: Place, entry: int) -> None:
            sent.append((journal.left, place.name))
            super().send(place, entry)

    driver = Noting(plant, net)
    host = Host(decomposition_of("one_robot"), driver, Recorder(net, "", stream), journal=journal)
    with pytest.raises(InputError, match="the disk is full"):
        run_in_virtual_time(host.main())
    assert all(left >= 0 for left, _ in sent)
    assert driver.stopped  # the safe outputs were driven
    written = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["command"] for line in written if "command" in line] == [place for _, place in sent]
