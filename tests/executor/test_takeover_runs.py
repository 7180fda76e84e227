"""Runs that have taken a cell over go on from there, and their traces begin there."""

from __future__ import annotations

import asyncio
from contextlib import closing
from pathlib import Path

import pytest
from support.hosts import Cell
from support.takeovers import bundle, journal, old_and_new

from firable.cli.main import main
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal, sync_now
from firable.executor.journal.sqlite_journal import SqliteJournal, machines_of
from firable.executor.journal.takeover import take_over
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.taken_up import opened
from firable.executor.protocol.messages import Keep
from firable.nets.bundle import read_bundle
from firable.nets.catalogue import catalogue_path, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.semantics.joining import join
from firable.semantics.replaying import replay
from firable.semantics.trace import Start, read_trace


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return old_and_new(tmp_path_factory.mktemp("bundles"))


def test_a_run_on_the_simulated_cell_goes_on_under_the_new_bundle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    old = bundle(tmp_path, "old", text)
    new = bundle(tmp_path, "new", text.replace("program: O0001", "program: O0002"))
    renamed = bundle(tmp_path, "renamed", text.replace("machining", "milling"))
    plant = ("--plant", "catalogue:one_robot", "--workpieces", "1")
    before, after, other = (str(tmp_path / name) for name in ("before", "after", "other"))
    assert main(["run", str(old), *plant, "--journal", before]) == 0
    assert main(["takeover", str(old), str(new), "--journal", before, "--into", after]) == 0
    assert main(["run", str(new), *plant, "--journal", after]) == 3  # held
    assert main(["run", str(new), *plant, "--journal", after, "--resume"]) == 0
    Path(f"{before}.taken-over").unlink()  # as if the new journal were gone
    assert main(["takeover", str(old), str(renamed), "--journal", before, "--into", other]) == 0
    assert main(["run", str(renamed), *plant, "--journal", other]) == 2
    assert "which is no place" in capsys.readouterr().err
    Path(f"{after}.cell").unlink()
    assert main(["run", str(new), *plant, "--journal", after]) == 2
    assert "empty or gone" in capsys.readouterr().err


def test_the_trace_of_a_run_that_has_taken_a_cell_over_begins_there_and_is_judged_from_there(
    bundles: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.working", "table.full"})
    with closing(SqliteJournal(before, read_bundle(old).digest, machines_of(before))) as owing:
        owing.write("robot", [Keep("command/signal/robot.worked", ("robot.working", 7, "owed"))])
        sync_now(owing)
    after, trace = tmp_path / "new.journal", tmp_path / "new.trace"
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(after)]) == 0
    read = read_bundle(new)

    async def for_some_seconds() -> None:
        with opened(read.decomposition, read.digest, after, trace) as files:
            driver = DryRunDriver(read.decomposition.subnets, 1.0)
            run = Host(
                read.decomposition,
                driver,
                files.recorder,
                Conduct(resume=True),
                journal=files.journal,
                begin_seconds=files.begin_seconds,
            )
            ending = asyncio.create_task(run.main())
            await asyncio.sleep(3.5)
            run.stop()
            await ending

    for firings in (7, 14):  # the second goes on in the trace of the first
        run_in_virtual_time(for_some_seconds())
        told = read_trace(trace)
        assert told.header.start == Start(("robot.working", "table.full"), (), ("robot.working",))
        done = replay(read.net, told)
        assert done.complete
        assert done.firings >= firings
    capsys.readouterr()
    assert main(["replay", str(trace), "--net", str(new)]) == 0
    assert "from the marking that was taken over: robot.working, table.full" in capsys.readouterr().out
    assert main(["timeline", str(trace), "--net", str(new), "-o", str(tmp_path / "t.svg")]) == 0
    assert main(["draw", str(new), "--what", "strip", "--trace", str(trace), "-o", str(tmp_path / "s.svg")]) == 0


def test_the_trace_of_the_time_before_a_takeover_is_not_written_over(
    bundles: tuple[Path, Path], tmp_path: Path
) -> None:
    old, new = bundles
    before = journal(tmp_path / "old.journal", old, {"robot.free", "table.empty"})
    after, trace = tmp_path / "new.journal", tmp_path / "cell.trace"
    trace.write_text("what happened until then\n")
    assert main(["takeover", str(old), str(new), "--journal", str(before), "--into", str(after)]) == 0
    read = read_bundle(new)
    with pytest.raises(InputError, match="begins anew, and this file has lines"):
        opened(read.decomposition, read.digest, after, trace).__enter__()
    assert trace.read_text() == "what happened until then\n"
    for free in (tmp_path / "missing.trace", tmp_path / "empty.trace"):
        if free.name.startswith("empty"):
            free.touch()
        with opened(read.decomposition, read.digest, after, free):
            pass


def test_a_run_of_machines_begins_in_the_trace_of_no_other_one(bundles: tuple[Path, Path], tmp_path: Path) -> None:
    read, earlier = read_bundle(bundles[0]), tmp_path / "cell.trace"
    earlier.write_text("what an earlier run has told\n")
    cell = (catalogue_plant("one_robot"), 1, 0)
    for journal_path, simulated in (("new.journal", None), (None, None), ("simulated.journal", cell)):
        kept = None if journal_path is None else tmp_path / journal_path
        with pytest.raises(InputError, match="the trace of this run begins anew, and this file has lines"):
            opened(read.decomposition, read.digest, kept, earlier, simulated=simulated).__enter__()
        assert earlier.read_text() == "what an earlier run has told\n"
        with opened(read.decomposition, read.digest, kept, tmp_path / f"of {journal_path}.trace", simulated=simulated):
            pass
    assert not (tmp_path / "new.journal.cell").exists()
    with opened(read.decomposition, read.digest, None, earlier, simulated=cell) as again:
        assert again.begin_seconds == 0.0  # what the same command makes again may be written over


def test_the_traces_of_hosts_that_were_taken_over_join_and_not_with_one_that_was_not(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(4.6)
        await cell.stop()
        begun = read_trace(cell.path(("robot",)))
        kept = {name: of.kept(name) for machines, of in cell.journals.items() for name in machines}
        moved = take_over(cell.decomposition, cell.decomposition, kept, [COORDINATOR])
        assert set(moved.marking) != set(cell.net.names(cell.net.initial_marking))
        for machines in cell.journals:
            cell.journals[machines] = MemoryJournal()
            for name in machines:
                cell.journals[machines].write(name, [Keep(key, value) for key, value in moved.kept[name].items()])
            cell.start(machines, resume=True)
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings > 10
        traces = [read_trace(cell.path(machines)) for machines in cell.hosts]
        mixed = [begun if trace.header.machines == ("robot",) else trace for trace in traces]
        with pytest.raises(InputError, match="begins where a cell was taken over, and another in the initial marking"):
            join(cell.net, mixed)

    run_in_virtual_time(main())
