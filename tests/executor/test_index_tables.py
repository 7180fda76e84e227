"""Machines that index, stations that are full at first and what is switched: the simulated cell, and its loop."""

from __future__ import annotations

import io

import pytest
from support.following import followed
from support.plant_bench import Bench
from support.table_cell import PLANT, tables

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import NeverCompletes
from firable.executor.cell.plant import CommandDone, SensorChanged
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.monitor import Monitor, watch
from firable.executor.operating.running import RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import Faults, Sending
from firable.nets.machines.plant_file import parse_plant
from firable.semantics.trace import SignalChanged, Trace, parse_trace


def lying(bench: Bench) -> dict[str, int | None]:
    return {station: one.id if one is not None else None for station, one in bench.plant.stations.items()}


def table(old: str = "", new: str = "", *, workpieces: int = 2) -> Bench:
    """The cell at rest, where one comes to the station for loading as soon as it is empty."""
    return Bench(text=PLANT.replace(old, new) if old else PLANT, workpieces=workpieces)


# --- Full at first


def test_what_lies_there_at_first_is_seen_before_anything_happens_and_counts() -> None:
    bench = table()
    assert bench.plant.shown == {"c.load": True, "c.drill": True, "c.good": False}
    assert SensorChanged("c.drill", value=True) not in bench.reports
    assert lying(bench) == {"feed": None, "load": 3, "drill": 1, "unload": 2, "out": None}
    drill, unload = bench.plant.stations["drill"], bench.plant.stations["unload"]
    assert drill is not None
    assert unload is not None
    assert (drill.processed, unload.processed) == (0, 1)
    assert bench.plant.inside == (1, 2, 3)


def test_what_lies_there_at_first_is_judged_and_taken_away_as_what_comes_later() -> None:
    found = table().wait(1.0)
    assert [one.signal for one in found if isinstance(one, SensorChanged)] == ["c.good"]
    bench = table("departures: {station: out, after_s: 1}", "departures: {station: unload, after_s: 1}")
    bench.wait(1.0)
    assert [one.id for one in bench.plant.delivered] == [2]


# --- An index


def test_an_index_moves_every_workpiece_to_the_next_station_and_round() -> None:
    bench = table(workpieces=1)
    bench.give("T", "INDEX")
    assert lying(bench) == dict.fromkeys(("feed", "load", "drill", "unload", "out"))
    assert bench.plant.shown == dict.fromkeys(bench.plant.shown, False)
    assert bench.plant.inside == (1, 2, 3), "those on their way are not lost"
    assert CommandDone(1) in bench.wait(2.0)
    assert lying(bench) == {"feed": None, "load": 2, "drill": 3, "unload": 1, "out": None}
    assert bench.plant.shown["c.drill"] is True
    assert bench.faults == []


def test_an_index_moves_nothing_from_an_empty_station() -> None:
    bench = table("full_at_first: {drill: raw, unload: machined}\n", "full_at_first: {drill: raw}\n", workpieces=0)
    bench.do("T", "INDEX")
    assert [station for station, one in lying(bench).items() if one is not None] == ["unload"]


def test_an_index_that_leads_to_a_full_station_collides() -> None:
    bench = table("{does: index, next: {drill: load}, takes_s: 2}", "{does: index, next: {load: drill}, takes_s: 2}")
    bench.do("T", "BACK")
    assert bench.faults == ["T moves workpiece 3 onto drill, where workpiece 1 lies"]


def test_workpieces_come_to_a_station_only_when_it_is_there() -> None:
    bench = table(workpieces=5)
    bench.wait(4.0)
    bench.give("T", "BACK")
    bench.wait(1.0)
    assert lying(bench)["load"] == 3, "BACK takes what lies at the drill alone"
    bench = table(workpieces=5)
    bench.give("W", "STEP")
    bench.wait(1.9)
    bench.give("T", "INDEX")
    assert bench.faults == ["T is given INDEX while W moves what lies on unload"]
    bench = table("full_at_first: {drill: raw, unload: machined}\n", "", workpieces=5)
    bench.give("T", "INDEX")
    bench.wait(1.9)
    bench.plant.arrival_due = True
    bench.wait(0.0)
    assert lying(bench)["load"] is None
    bench.wait(0.1)
    assert lying(bench)["load"] == 2, "as soon as the table has come to rest"


def test_an_index_pulls_at_a_workpiece_that_is_clamped() -> None:
    bench = table()
    bench.do("D", "CLAMP")
    bench.give("T", "INDEX")
    assert bench.faults == ["T is given INDEX, and the workpiece on drill is clamped"]


@pytest.mark.parametrize("when_full", ["", ", when_full: wait"])
def test_whoever_lays_a_workpiece_on_a_station_that_moves_collides(when_full: str) -> None:
    bench = table("takes_s: 1, when_full: wait}}}", f"takes_s: 1{when_full}}}}}}}", workpieces=0)
    bench.plant.stations["feed"] = bench.plant.stations["drill"]
    bench.plant.stations["drill"] = None
    bench.give("B", "RUN")
    bench.give("T", "INDEX")
    bench.wait(1.0)
    assert bench.faults == ["B pushes workpiece 1 onto load while T moves what lies there"]


def test_an_index_that_was_halted_goes_on_by_the_same_command_alone() -> None:
    bench = table(workpieces=1)
    bench.give("T", "INDEX")
    bench.wait(1.0)
    bench.plant.halt()
    bench.wait(5.0)
    assert lying(bench)["drill"] is None
    bench.do("T", "INDEX")
    assert lying(bench) == {"feed": None, "load": 2, "drill": 3, "unload": 1, "out": None}
    bench.give("T", "INDEX")
    bench.plant.halt()
    bench.give("T", "BACK")
    assert bench.faults == ["T is given BACK in the midst of INDEX"]


# --- What is switched


def test_what_is_switched_is_done_at_once_and_keeps_no_machine() -> None:
    bench = table()
    assert bench.give("L", "LIGHT") == [CommandDone(1)]
    assert bench.give("L", "LIGHT") == [CommandDone(2)]
    assert bench.plant.machines["L"].busy is None
    assert bench.plant.next_seconds is not None
    bench.give("L", "TEST")
    bench.give("L", "LIGHT")
    assert bench.faults == ["L is given LIGHT while it is at TEST"]


# --- Runs, held to the loop


def run_of(*disturbances: NeverCompletes, workpieces: int = 6, seed: int = 1) -> tuple[RunReport, Trace]:
    stream = io.StringIO()
    report = execute(
        split(catalogue_net("index_table")),
        SimulatedCell(catalogue_plant("index_table"), workpieces, seed, disturbances=disturbances),
        Conduct(trace=stream, watch=Watch.IGNORE),
    )
    return report, parse_trace(stream.getvalue())


@pytest.mark.parametrize("seed", range(4))
def test_the_index_table_of_the_catalogue_carries_all_through_as_its_loop_allows(seed: int) -> None:
    report, trace = run_of(seed=seed)
    assert report.state is State.DONE
    assert sorted(report.delivered) == [*range(1, 8)], "one more than have come: it was there at first"
    assert (report.inside, report.lost, report.doubled) == ((), (), ())
    net, model = catalogue_net("index_table"), catalogue_plant("index_table")
    for sending in Sending:
        assert followed(close(net, model, sending=sending), trace) == sum(report.firings.values())
    assert watch(Monitor(net, model), trace) is None


def test_nothing_fires_before_a_sensor_has_told_that_a_station_is_full() -> None:
    """At first a 0 would be believed of each, and the table turns unless it sees something at the end."""
    _, trace = run_of()
    first = [event for event in trace.events if isinstance(event, SignalChanged)][:3]
    told = {event.signal: event.value for event in first}
    assert told == {"table.part_at_load": False, "table.part_at_unload": True, "drill.part_there": False}
    assert list(trace.events[:3]) == first


def test_a_table_that_never_comes_to_the_end_is_told_by_the_monitor_and_one_of_the_loop_with_faults() -> None:
    report, trace = run_of(NeverCompletes("T", "INDEX", 2))
    assert report.state is not State.DONE
    net, model = catalogue_net("index_table"), catalogue_plant("index_table")
    assert followed(close(net, model, Faults.FOR_GOOD, Sending.AT_ONCE), trace) > 5
    late = watch(Monitor(net, model), trace)
    assert late is not None
    assert late.message == "'drill.part_there' must be 1 by now, and is still 0"


def test_the_monitor_knows_what_lies_there_at_first() -> None:
    net, model = tables()
    loop = Monitor(net, model).loop
    assert loop.initial & (1 << loop.index["plant.drill.raw"])
    empty = Monitor(net, parse_plant(PLANT.replace("full_at_first: {drill: raw, unload: machined}\n", "")))
    assert empty.signal(0.1, "c.drill", value=True) is not None
