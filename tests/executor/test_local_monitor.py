"""The monitor of one host: silent on machines that keep to their plant file whatever others do, loud on its own."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support import inspected_cell
from support.hosts import Cell, ended_within
from support.watched_runs import CELLS, run_of, slower

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import Disturbance, NeverCompletes, StuckSensor
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.operating.conduct import Watch
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.monitor import Divergence
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.nets.machines.plant_file import Departure, parse_plant
from firable.nets.text import parse_net
from firable.semantics.joining import APPLIED
from firable.semantics.trace import CommandSent, Event, Fired, Noted, SignalChanged, Trace


@cache
def cut(cell: str) -> Decomposition:
    return split(catalogue_net(cell))


def names(cell: str) -> list[str]:
    return [subnet.name for subnet in cut(cell).subnets]


def seen_at(cell: str, controllers: list[str], trace: Trace) -> list[Event]:
    """What hosts of these controllers see of a run: the parts of coordinated transitions when they are applied."""
    parts: dict[str, list[str]] = {}
    for row in cut(cell).coordinated:
        parts[row.name] = [part.controller for part in row.parts]
    events: list[Event] = []
    for event in trace.events:
        if isinstance(event, Fired) and event.transitions[0] in parts:
            (t,) = event.transitions
            events += [
                Noted(event.at_seconds, APPLIED, {"controller": c, "round": 1, "transition": t})
                for c in controllers
                if c in parts[t]
            ]
        else:
            events.append(event)
    return events


def diverges(cell: str, controllers: list[str], trace: Trace) -> Divergence | None:
    monitor = LocalMonitor(cut(cell), controllers, catalogue_plant(cell))
    for event in seen_at(cell, controllers, trace):
        monitor.seen(event)
    assert trace.end is not None
    monitor.passed(trace.end.at_seconds)
    return monitor.divergence


@pytest.mark.parametrize("cell", CELLS)
def test_machines_that_keep_to_their_plant_file_diverge_at_no_host(cell: str) -> None:
    for seed in range(2):
        trace = run_of(cell, seed=seed)
        for controller in names(cell):
            assert diverges(cell, [controller], trace) is None, controller
        assert diverges(cell, names(cell), trace) is None


@pytest.mark.parametrize("station", ["mc_table", "cv1_end"])
def test_machines_that_keep_to_a_plant_file_with_several_ways_out_diverge_at_no_host(station: str) -> None:
    """Some of them out of the reach of a host, some not; the run needs but one."""
    model, trace = catalogue_plant("one_robot"), run_of("one_robot", seed=0)
    more = [Departure(station=station, raw=True), *model.departures]
    for controller in names("one_robot"):
        monitor = LocalMonitor(cut("one_robot"), [controller], model.model_copy(update={"departures": more}))
        for event in seen_at("one_robot", [controller], trace):
            monitor.seen(event)
        assert monitor.divergence is None, controller


def of_inspection(controllers: list[str], trace: Trace) -> Divergence | None:
    """What monitors of the cell with a camera find in what hosts of some controllers see of a run."""
    cell = split(inspected_cell.net())
    monitor = LocalMonitor(cell, controllers, inspected_cell.plant())
    assert trace.end is not None
    parts = {row.name: [part.controller for part in row.parts] for row in cell.coordinated}
    for event in trace.events:
        if isinstance(event, Fired) and (own := parts.get(event.transitions[0])) is not None:
            (t,) = event.transitions
            for name in (name for name in controllers if name in own):
                monitor.seen(Noted(event.at_seconds, APPLIED, {"controller": name, "round": 1, "transition": t}))
        else:
            monitor.seen(event)
    monitor.passed(trace.end.at_seconds)
    return monitor.divergence


@pytest.mark.parametrize("controllers", [["robot"], ["camera"], ["robot", "camera"]], ids="-".join)
def test_a_camera_at_a_station_that_others_reach_may_find_anything_at_any_time(controllers: list[str]) -> None:
    for seed in range(3):
        trace = inspected_cell.run(seed)
        assert of_inspection(controllers, trace) is None
        flipped = []
        for event in trace.events:
            flipped.append(event)
            if isinstance(event, SignalChanged) and event.signal in OTHER and event.value:
                at, other = event.at_seconds, OTHER[event.signal]
                flipped += [SignalChanged(at, event.signal, value=False), SignalChanged(at, other, value=True)]
                flipped += [SignalChanged(at, other, value=False), SignalChanged(at, event.signal, value=True)]
        assert of_inspection(controllers, replace(trace, events=tuple(flipped))) is None


OTHER = {"camera.ok": "camera.nok", "camera.nok": "camera.ok"}
OWN: list[tuple[str, Disturbance, str]] = [
    ("robot", NeverCompletes("R", "MOVE", 3), "robot.back"),
    ("robot", StuckSensor("robot.touch", value=False, from_seconds=30.0), "robot.grasp_cv1"),
    ("mc", NeverCompletes("MC", "RUN", 2), "mc.machining"),
    ("conveyor", NeverCompletes("CV1", "RUN", 2), "conveyor.cv1_run"),
]


@pytest.mark.parametrize(("controller", "disturbance", "place"), OWN, ids=[f"{c}-{p}" for c, _, p in OWN])
def test_a_machine_that_does_otherwise_is_found_at_its_own_host_with_the_place_and_at_no_other(
    controller: str, disturbance: Disturbance, place: str
) -> None:
    trace = run_of("one_robot", disturbance)
    found = diverges("one_robot", [controller], trace)
    assert found is not None
    assert place in found.places, found
    for other in set(names("one_robot")) - {controller}:
        assert diverges("one_robot", [other], trace) is None, other


def test_a_machine_that_is_slower_than_its_plant_file_is_noticed_at_its_host() -> None:
    slow = slower(catalogue_plant("one_robot"), "R", "MOVE", 4.0)
    found = diverges("one_robot", ["robot"], run_of("one_robot", plant=slow))
    assert found is not None
    assert found.places[0] == "robot.to_cv1"


def test_a_signal_that_a_promise_holds_may_come_late_by_the_time_of_the_promise_and_no_later() -> None:
    trace = run_of("one_robot", NeverCompletes("R", "MOVE", 1))
    events = seen_at("one_robot", ["robot"], trace)
    at = {"robot.at_cv1"}

    def told(until_seconds: float) -> LocalMonitor:
        monitor = LocalMonitor(cut("one_robot"), ["robot"], catalogue_plant("one_robot"))
        held = True
        monitor.excuse(lambda signal: held and signal in at)
        for event in events:
            if event.at_seconds < until_seconds:
                monitor.seen(event)
        monitor.passed(until_seconds)
        assert monitor.divergence is None, "it is held"
        held = False
        monitor.passed(until_seconds + 0.01)
        assert monitor.divergence is None, "it has just been freed"
        return monitor

    assert told(60.0).passed(60.9) is None, "done at the last moment, and taken as late as may be"
    found = told(60.0).passed(61.2)
    assert found is not None
    assert found.places == ("robot.to_cv1",)


def test_a_machine_of_two_hosts_and_a_plant_of_another_cell_are_refused() -> None:
    with pytest.raises(InputError) as caught:
        LocalMonitor(cut("one_robot"), ["robot"], catalogue_plant("two_cells"))
    assert {problem.code for problem in caught.value.diagnostics} == {"F5003"}
    shared = parse_net(SHARED)
    with pytest.raises(InputError, match="'M' is commanded by a and b"):
        LocalMonitor(split(shared), ["a"], parse_plant(SHARED_PLANT))


SHARED = """
firable: 1
cell: c
controllers:
  a: {start: idle, places: {idle: , at: {send: {machine: M, command: GO}, until: gone}}}
  b: {start: idle, places: {idle: , at: {send: {machine: M, command: GO}, until: gone}}}
transitions:
  t1: {from: a.idle, to: a.at}
  t2: {from: a.at, to: a.idle}
  t3: {from: b.idle, to: b.at}
  t4: {from: b.at, to: b.idle}
"""
SHARED_PLANT = """
firable_plant: 1
plant: c
stations: [s]
arrivals: {station: s, every_s: 1}
departures: {station: s}
machines:
  M: {commands: {GO: {does: work, takes_s: 1}}}
"""


COMPETING = """
firable: 1
cell: c
controllers:
  a: {coordinator: true, start: idle, places: {idle: , at: {send: {machine: M, command: GO}, until: gone}, lent: }}
  b: {start: idle, places: {idle: , using: }}
transitions:
  lend: {from: [a.idle, b.idle], to: [a.lent, b.using]}
  back: {from: [a.lent, b.using], to: [a.idle, b.idle]}
  go:   {from: a.idle, to: a.at}
  gone: {from: a.at, to: a.idle}
"""


@pytest.mark.parametrize("here", [["a"], ["a", "b"]], ids="-".join)
def test_what_is_decided_of_one_controller_and_applied_beside_its_coordinator_has_fired_once(here: list[str]) -> None:
    """It competes with a transition of two, so a coordinator decides it; row and part are of one name."""
    cell = split(parse_net(COMPETING))
    assert {row.name for row in cell.coordinated} == {"lend", "back", "go", "gone"}
    monitor = LocalMonitor(cell, here, parse_plant(SHARED_PLANT))

    def decided(at_seconds: float, name: str, *controllers: str) -> None:
        monitor.seen(Fired(at_seconds, (name,), 1))
        for one in (one for one in controllers if one in here):
            monitor.seen(Noted(at_seconds + 0.01, APPLIED, {"controller": one, "round": 1, "transition": name}))

    decided(1.0, "go", "a")
    monitor.seen(CommandSent(1.02, "a.at"))
    monitor.seen(SignalChanged(2.02, "a.gone", value=True))
    decided(2.1, "gone", "a")
    decided(3.0, "lend", "a", "b")
    decided(4.0, "back", "a", "b")
    assert monitor.divergence is None
    decided(5.0, "go", "a")
    monitor.seen(SignalChanged(5.02, "a.gone", value=False))
    monitor.seen(CommandSent(5.02, "a.at"))
    found = monitor.passed(9.0)
    assert found is not None
    assert found.places == ("a.at",)


# --- Hosts


class WatchedCell(Cell):
    """The hosts of the one-robot cell, each of which watches its own machines."""

    stops = False

    def start(self, machines: tuple[str, ...], shown: Any = None, **options: Any) -> None:
        """Start a host with its monitor."""
        here = [name for name in machines if name]
        monitor = LocalMonitor(self.decomposition, here, catalogue_plant("one_robot"))
        super().start(machines, shown, monitor=monitor, watch=Watch.STOP if self.stops else Watch.TELL, **options)


class StoppingCell(WatchedCell):
    """One whose hosts end at a divergence."""

    stops = True


@pytest.mark.parametrize("free", [True, False], ids=["free", "promised"])
def test_hosts_of_machines_that_are_quick_enough_diverge_nowhere_also_while_a_line_is_down(
    free: bool, tmp_path: Path
) -> None:
    async def main() -> None:
        cell, held = WatchedCell(tmp_path, free=free, seconds=0.7), set[str]()
        for _ in range(10):
            await asyncio.sleep(3.37)
            cell.exchange.cut(cell.links["mc",])
            await asyncio.sleep(5)
            watching, controller = cell.hosts["robot",].watching, cell.hosts["robot",].controllers["robot"]
            assert watching is not None
            assert isinstance(watching.monitor, LocalMonitor)
            asks = watching.monitor.monitors["robot"].is_held
            held |= {signal.name for signal in controller.subnet.signals if asks(signal.name)}
            cell.exchange.mend(cell.links["mc",])
        await cell.stop()
        assert held or free, "no promise was open, and this shows nothing"
        assert {name: host.divergence for name, host in cell.hosts.items() if host.divergence} == {}
        assert cell.replayed().firings > 40

    run_in_virtual_time(main())


def test_a_host_tells_that_its_machine_is_too_slow_with_the_place_and_can_end_there(tmp_path: Path) -> None:
    async def main() -> None:
        cell = WatchedCell(tmp_path, seconds=4.0)
        await asyncio.sleep(60)
        await cell.stop()
        found = cell.hosts["robot",].divergence
        assert found is not None
        assert found.places == ("robot.to_cv1",)
        assert '"divergence"' in cell.path(("robot",)).read_text()

        (tmp_path / "stops").mkdir()
        cell = StoppingCell(tmp_path / "stops", seconds=4.0)
        situation = await ended_within(cell.tasks["robot",], 60)
        assert "the machines are not as they are modelled" in situation.message
        await cell.stop()

    run_in_virtual_time(main())
