"""Running a bundle: its right to run, and the trace that is left of the run."""

import asyncio
import gc
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from support.cells import decomposition_of, firings, plant_of
from support.evidence_names import document_naming

from firable.executor.drivers.bench import until
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.running import RunReport, SimulatedCell, load, run_simulated
from firable.nets.bundle import Bundle, write_bundle
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.right_to_run import required_verdicts
from firable.nets.verdict import Status, Verdict
from firable.semantics.replaying import replay
from firable.semantics.trace import Trace, parse_trace


def proved_bundle(cell: str = "one_robot") -> Bundle:
    decomposition = decomposition_of(cell)
    names = tuple(dict.fromkeys(required_verdicts(decomposition)))
    verdicts = (
        Verdict(name, Status.PROVED, "holds", "by hand", evidence=("file",), discipline="interleaving")
        for name in names
    )
    return Bundle(decomposition, tuple(verdicts), {"file": document_naming(decomposition.net, names)})


def test_proved_bundle_is_loaded_and_run(tmp_path: Path) -> None:
    write_bundle(tmp_path / "cell.bundle", proved_bundle())
    report = run_simulated(
        load(tmp_path / "cell.bundle"),
        SimulatedCell(plant_of("one_robot"), workpieces=3),
        Conduct(trace=tmp_path / "trace.jsonl"),
    )
    assert report.delivered == (1, 2, 3)
    assert report.to_json()["state"] == "done"
    replayed = replay(catalogue_net("one_robot"), parse_trace((tmp_path / "trace.jsonl").read_text("utf-8")))
    assert (replayed.firings, replayed.complete) == (45, True)


@pytest.mark.parametrize("status", [Status.UNKNOWN, Status.VIOLATED])
def test_bundle_with_an_unproved_verdict_is_refused(status: Status, tmp_path: Path) -> None:
    bundle = proved_bundle()
    verdicts = (*bundle.verdicts[:-1], replace(bundle.verdicts[-1], status=status))
    write_bundle(tmp_path / "cell.bundle", replace(bundle, verdicts=verdicts))
    with pytest.raises(InputError) as refusal:
        load(tmp_path / "cell.bundle")
    assert {problem.code for problem in refusal.value.diagnostics} == {"F5002"}
    with pytest.raises(InputError):
        run_simulated(replace(bundle, verdicts=verdicts), SimulatedCell(plant_of("one_robot"), workpieces=1))


def test_bundle_without_a_verdict_is_refused(tmp_path: Path) -> None:
    write_bundle(tmp_path / "cell.bundle", replace(proved_bundle(), verdicts=()))
    with pytest.raises(InputError) as refusal:
        load(tmp_path / "cell.bundle")
    assert {problem.code for problem in refusal.value.diagnostics} == {"F5002"}


def test_bundle_with_no_evidence_that_its_net_has_no_deadlock_is_not_run(tmp_path: Path) -> None:
    """The deadlocking cell, with every verdict called proved, all but one with evidence."""
    bundle = proved_bundle("one_robot_mc_late")
    others = tuple(v.name for v in bundle.verdicts if v.name != "deadlock-free")
    bare = tuple(replace(v, evidence=()) if v.name == "deadlock-free" else v for v in bundle.verdicts)
    for verdicts, text in ((bare, bundle.evidence["file"]), (bundle.verdicts, document_naming(bundle.net, others))):
        write_bundle(tmp_path / "cell.bundle", replace(bundle, verdicts=verdicts, evidence={"file": text}))
        with pytest.raises(InputError) as refusal:
            load(tmp_path / "cell.bundle")
        assert [(d.code, d.subject) for d in refusal.value.diagnostics] == [("F5002", ("verdicts", "deadlock-free"))]


def test_changed_bundle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cell.bundle"
    write_bundle(path, proved_bundle())
    data = path.read_bytes()
    for at in range(0, len(data), len(data) // 37):
        path.write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        with pytest.raises(InputError) as refusal:
            load(path)
        assert [problem.code for problem in refusal.value.diagnostics] == ["F5001"]


def test_plant_of_another_cell_is_refused() -> None:
    with pytest.raises(InputError) as refusal:
        run_simulated(proved_bundle(), SimulatedCell(plant_of("two_robots_shared"), workpieces=1))
    assert {problem.code for problem in refusal.value.diagnostics} == {"F5003"}


def test_trace_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "no" / "trace.jsonl"):
        with pytest.raises(InputError) as refusal:
            run_simulated(proved_bundle(), SimulatedCell(plant_of("one_robot"), workpieces=1), Conduct(trace=path))
        assert [problem.code for problem in refusal.value.diagnostics] == ["F1017"]


def test_refused_run_leaves_an_older_trace_as_it_is(tmp_path: Path) -> None:
    trace = tmp_path / "trace.jsonl"
    trace.write_text("kept", encoding="utf-8")
    unproved = replace(proved_bundle(), verdicts=())
    for bundle, plant in ((proved_bundle(), plant_of("two_robots_shared")), (unproved, plant_of("one_robot"))):
        with pytest.raises(InputError):
            run_simulated(bundle, SimulatedCell(plant, workpieces=1), Conduct(trace=trace))
    with pytest.raises(ValueError, match="must"):
        run_simulated(proved_bundle(), SimulatedCell(plant_of("one_robot"), workpieces=-1), Conduct(trace=trace))
    assert trace.read_text("utf-8") == "kept"


def test_trace_is_on_disk_as_far_as_it_goes_while_the_run_waits(tmp_path: Path) -> None:
    async def operator(host: Host) -> None:
        await until(lambda: firings(host) == 3, "three firings")
        await host.quiet()
        so_far.append(parse_trace((tmp_path / "trace").read_text("utf-8")))

    so_far: list[Trace] = []
    run_simulated(
        proved_bundle(),
        SimulatedCell(plant_of("one_robot"), workpieces=1),
        Conduct(operator=operator, trace=tmp_path / "trace"),
    )
    assert replay(catalogue_net("one_robot"), so_far[0]).firings == 3


@pytest.mark.parametrize("workpieces", [0, 1])  # the disk is full at the end, or in the middle of the run
def test_full_disk_is_an_error_of_the_trace(workpieces: int) -> None:
    with pytest.raises(InputError) as refusal:
        run_simulated(
            proved_bundle(), SimulatedCell(plant_of("one_robot"), workpieces=workpieces), Conduct(trace="/dev/full")
        )
    assert [problem.code for problem in refusal.value.diagnostics] == ["F1017"]
    assert "/dev/full: the trace cannot be written: No space left" in str(refusal.value)
    assert refusal.value.diagnostics[0].hint.startswith("make room on its disk; with --journal, the same command")


def test_other_errors_of_the_system_are_not_taken_for_errors_of_the_trace(tmp_path: Path) -> None:
    async def operator(host: Host) -> None:
        raise ConnectionResetError("the panel is gone")

    with pytest.raises(ConnectionResetError):
        run_simulated(
            proved_bundle(),
            SimulatedCell(plant_of("one_robot"), workpieces=1),
            Conduct(operator=operator, trace=tmp_path / "trace"),
        )


def test_run_within_an_event_loop_is_refused_before_a_file_is_touched_and_runs_on_a_thread(tmp_path: Path) -> None:
    cell = SimulatedCell(plant_of("one_robot"), workpieces=1, speed=1000.0)
    conduct = Conduct(journal_path=tmp_path / "journal", trace=tmp_path / "trace")

    async def main() -> RunReport:
        with pytest.raises(RuntimeError, match="a run has an event loop of its own"):
            run_simulated(proved_bundle(), cell, conduct)
        assert not list(tmp_path.iterdir())
        return await asyncio.to_thread(run_simulated, proved_bundle(), cell, conduct)

    assert asyncio.run(main()).delivered == (1,)


def test_executor_runs_without_solvers_and_without_the_rooms_that_prove(tmp_path: Path) -> None:
    write_bundle(tmp_path / "cell.bundle", proved_bundle())
    program = f"""
import sys
from firable.executor import SimulatedCell, load, read_plant, run_simulated
cell = SimulatedCell(read_plant({str(catalogue_path("one_robot").with_name("one_robot.plant.yaml"))!r}), workpieces=2)
assert run_simulated(load({str(tmp_path / "cell.bundle")!r}), cell).delivered == (1, 2)
heavy = {{"z3", "networkx", "numpy", "highspy", "firable.analysis", "firable.decompose", "firable.cli"}}
print(sorted(heavy & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_run_in_real_time_keeps_what_is_loaded_from_the_collector_and_gives_it_back() -> None:
    frozen: list[int] = []

    async def operator(host: Host) -> None:
        frozen.append(gc.get_freeze_count())
        host.stop()

    gc.unfreeze()  # what the tests keep from it
    run_simulated(
        proved_bundle(), SimulatedCell(plant_of("one_robot"), workpieces=1, speed=100.0), Conduct(operator=operator)
    )
    assert frozen[0] > 10_000
    assert gc.get_freeze_count() == 0
