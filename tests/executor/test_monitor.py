"""The monitor: silent on every run of machines that keep to their plant file, loud on those that do not."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support import inspected_cell, together_cell
from support.bench_cell import JUDGED, bench, free_cell
from support.watched_runs import CELLS, run_of, slower

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import NeverCompletes, StuckSensor
from firable.executor.operating.conduct import Conduct, Watch
from firable.executor.operating.host import Host
from firable.executor.operating.local_monitor import LocalMonitor
from firable.executor.operating.monitor import Divergence, Monitor, watch
from firable.executor.operating.running import RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.nets.machines.plant_file import parse_plant
from firable.nets.text import parse_net
from firable.semantics.trace import CommandSent, Event, Fired, SignalChanged, Trace, parse_trace


def watched(cell: str, trace: Trace) -> Divergence | None:
    return watch(Monitor(catalogue_net(cell), catalogue_plant(cell)), trace)


def altered(trace: Trace, events: list[Event]) -> Trace:
    return replace(trace, events=tuple(events))


@pytest.mark.parametrize("cell", CELLS)
def test_machines_that_keep_to_their_plant_file_never_diverge(cell: str) -> None:
    for seed in range(4):
        assert watched(cell, run_of(cell, seed=seed)) is None


def test_a_command_that_never_completes_is_a_divergence_at_its_place_soon_after_its_time() -> None:
    trace = run_of("one_robot", NeverCompletes("R", "MOVE", 3))
    found = watched("one_robot", trace)
    assert found is not None
    assert "robot.back" in found.places
    sent = [
        event.at_seconds for event in trace.events if isinstance(event, CommandSent) and event.place == "robot.back"
    ]
    assert sent[0] + 2.2 < found.at_seconds < sent[0] + 2.2 + 2.0, "known 110 s before the command would be overdue"


def test_a_completion_that_a_stuck_sensor_holds_back_is_named() -> None:
    found = watched("one_robot", run_of("one_robot", StuckSensor("robot.touch", value=False, from_seconds=30.0)))
    assert found is not None
    assert found.subject == "robot.touch"
    assert "robot.grasp_cv1" in found.places


SOAKING = """
firable: 1
cell: soaking
controllers:
  hoist:
    start: free
    inputs: part_there
    places:
      free:
      grasp:  {send: {machine: H, command: GRASP, at: TANK}, until: gripped}
      aside:  {send: {machine: H, command: MOVE, to: EXIT}, until: there}
      put:    {send: {machine: H, command: PUT, at: EXIT}, until: laid}
      back:   {send: {machine: H, command: MOVE, to: TANK}, until: there}
  tank:
    start: empty
    places:
      empty:
      soaking: {send: {machine: W, command: SOAK}, until: lifted}
transitions:
  soak:  {from: [tank.empty, hoist.free], to: [tank.soaking, hoist.grasp], if: hoist.part_there}
  lift:  {from: [tank.soaking, hoist.grasp], to: [tank.empty, hoist.aside]}
  lay:   {from: hoist.aside, to: hoist.put}
  leave: {from: hoist.put, to: hoist.back}
  end:   {from: hoist.back, to: hoist.free}
"""
SOAKING_PLANT = """
firable_plant: 1
plant: soaking
stations: [tank, exit]
arrivals: {station: tank, every_s: 10}
departures: {station: exit, after_s: 1}
machines:
  H:
    hand: TANK
    positions: {TANK: tank, EXIT: exit}
    commands:
      GRASP: {does: grasp, takes_s: 2}
      MOVE: {does: move, takes_s: 1}
      PUT: {does: put, takes_s: 1}
  W: {commands: {SOAK: {does: work, takes_s: 0.5}}}
sensors:
  hoist.part_there: {occupied: tank}
  tank.lifted: {holding: H}
"""


@pytest.mark.parametrize("stuck", [False, True])
def test_a_completion_that_is_formed_behind_its_acknowledgement_is_not_waited_for_in_silence(stuck: bool) -> None:
    """The tank has said that it soaks; the hoist holds the part, and what sees it there is stuck."""
    net, plant, stream = parse_net(SOAKING), parse_plant(SOAKING_PLANT), io.StringIO()
    disturbances = [StuckSensor("tank.lifted", value=False)] if stuck else []
    cell = SimulatedCell(plant, workpieces=3, disturbances=disturbances)
    execute(split(net), cell, Conduct(trace=stream, watch=Watch.IGNORE))
    trace, monitor = parse_trace(stream.getvalue()), Monitor(net, plant)
    if not stuck:
        assert watch(monitor, trace) is None
        return
    for event in trace.events:
        if event.at_seconds < 3:
            assert monitor.seen(event) is None
    due = monitor.deadline_seconds()
    assert due is not None
    assert 2.5 <= due < 3.5, "half a second behind the grasp, twice at the most"
    found = monitor.passed(4)
    assert found is not None
    assert found.message == "'tank.lifted' must be 1 by now, and is still 0"
    assert found.places == ("tank.soaking", "hoist.grasp")


def test_a_sensor_that_drops_while_the_workpiece_lies_there_is_unexplained() -> None:
    found = watched("one_robot", run_of("one_robot", StuckSensor("mc.part_present", value=False, from_seconds=10.0)))
    assert found is not None
    assert found.subject == "mc.part_present"
    assert "nothing that the machines can have done explains it" in found.message


def test_a_machine_that_is_slower_than_its_plant_file_is_noticed() -> None:
    slow = slower(catalogue_plant("one_robot"), "R", "MOVE", 4.0)
    found = watched("one_robot", run_of("one_robot", plant=slow))
    assert found is not None
    assert "by now" in found.message
    assert found.places[0] == "robot.to_cv1"


def test_a_machine_that_is_quicker_than_its_plant_file_is_not_blamed() -> None:
    quick = slower(catalogue_plant("one_robot"), "R", "MOVE", 0.5)
    assert watched("one_robot", run_of("one_robot", plant=quick)) is None


def test_every_completion_that_comes_twice_or_unasked_is_unexplained() -> None:
    trace = run_of("one_robot")
    events = list(trace.events)
    for name in ("robot.at_cv1", "robot.at_mc", "mc.program_end", "robot.put_done"):
        where = next(i for i, e in enumerate(events) if isinstance(e, SignalChanged) and e.signal == name and e.value)
        unasked = SignalChanged(events[0].at_seconds, name, value=True)
        found = watched("one_robot", altered(trace, [unasked, *events]))
        assert found is not None
        assert found.subject == name
        lost = watched("one_robot", altered(trace, [*events[:where], *events[where + 1 :]]))
        assert lost is not None, f"{name} left out"


@pytest.mark.parametrize(("after_seconds", "explained"), [(0.0, True), (2.2, True), (3.1, True), (3.3, False)])
def test_a_completion_may_be_taken_as_late_as_time_jitter_and_latency_say(
    after_seconds: float, explained: bool
) -> None:
    trace = run_of("one_robot", workpieces=1)
    index = next(i for i, e in enumerate(trace.events) if isinstance(e, CommandSent) and e.place == "robot.to_cv1")
    monitor = Monitor(catalogue_net("one_robot"), catalogue_plant("one_robot"))
    assert watch(monitor, replace(trace, events=trace.events[: index + 2], end=None)) is None
    sent = trace.events[index].at_seconds
    found = monitor.signal(sent + after_seconds, "robot.at_cv1", value=True)
    assert (monitor.divergence is None) == explained
    assert explained or (found is not None and found.subject == "robot.at_cv1")


def inspected(trace: Trace) -> Divergence | None:
    return watch(Monitor(inspected_cell.net(), inspected_cell.plant()), trace)


def until_judged(seed: int) -> tuple[list[Event], SignalChanged]:
    """A run until a workpiece lies before the camera, and what the camera shows."""
    events = list(inspected_cell.run(seed, workpieces=1).events)
    where = next(i for i, e in enumerate(events) if isinstance(e, SignalChanged) and e.signal.startswith("camera."))
    shows = events[where]
    assert isinstance(shows, SignalChanged)
    return events[:where], shows


OTHER = {"camera.ok": "camera.nok", "camera.nok": "camera.ok"}


def test_cameras_that_keep_to_their_plant_file_never_diverge_whatever_they_find() -> None:
    shown = set()
    for seed in range(4):
        trace = inspected_cell.run(seed)
        assert inspected(trace) is None
        shown |= {event.signal for event in trace.events if isinstance(event, SignalChanged) and event.value}
    assert {"camera.ok", "camera.nok"} < shown


@pytest.mark.parametrize("seed", range(4))
def test_either_judgement_is_explained_and_one_that_changes_while_the_workpiece_lies_there_is_not(seed: int) -> None:
    before, shows = until_judged(seed)
    for signal in OTHER:
        monitor = Monitor(inspected_cell.net(), inspected_cell.plant())
        for event in before:
            assert monitor.seen(event) is None
        at = shows.at_seconds
        assert monitor.signal(at, signal, value=True) is None
        # The workpiece lies there until the robot is told to take it, so it is judged once.
        found = monitor.signal(at + 0.4, signal, value=False)
        assert found is not None
        assert found.subject == signal

    for signal, other in OTHER.items():
        monitor = Monitor(inspected_cell.net(), inspected_cell.plant())
        for event in before:
            assert monitor.seen(event) is None
        assert monitor.signal(shows.at_seconds, signal, value=True) is None
        found = monitor.signal(shows.at_seconds + 0.1, other, value=True)
        assert found is not None
        assert found.subject == other, "both at once"


@pytest.mark.parametrize(("late_seconds", "explained"), [(0.0, True), (0.4, True), (0.6, False)])
def test_a_signal_that_has_changed_again_may_be_taken_late_and_once(late_seconds: float, explained: bool) -> None:
    """One controller knows that the workpiece was laid down when another is told that the hand held it."""
    fast = together_cell.PLANT.replace("takes_s: 0.5, when_full: wait", "takes_s: 0.1")
    fast = fast.replace("takes_s: 1,", "takes_s: 0.1,")
    monitor = Monitor(parse_net(together_cell.NET), parse_plant(fast))
    monitor.signal(0.0, "robot.entry", value=True)
    laid = 0.8
    for at, fired, sent, completion in (
        (0.0, "come", "robot.grasp", "robot.grasped"),
        (0.6, "t1", "robot.to_exit", "robot.there"),
        (0.7, "t2", "robot.put", "robot.placed"),
    ):
        assert monitor.fired(at, fired) is None
        assert monitor.sent(at, sent) is None
        assert monitor.signal({"come": 0.5, "t1": 0.7, "t2": laid}[fired], completion, value=True) is None
    found = monitor.signal(laid + late_seconds, "robot.holds", value=True)
    assert (found is None) == explained
    assert found is None or found.subject == "robot.holds"
    if explained:
        assert monitor.signal(laid + late_seconds, "robot.holds", value=False) is None
        again = monitor.signal(laid + late_seconds, "robot.holds", value=True)
        assert again is not None
        assert again.subject == "robot.holds"


def test_a_completion_that_its_command_has_cleared_is_not_taken_late() -> None:
    """The belt waits for the full station, so it cannot be done, and what it had done before is over."""
    net = parse_net("""\
firable: 1
cell: twice
controllers:
  belt:
    start: rest
    places:
      rest:
      one: {send: {machine: B, command: RUN}, until: there}
      two: {send: {machine: B, command: RUN}, until: there}
transitions:
  go:   {from: belt.rest, to: belt.one}
  next: {from: belt.one, to: belt.two}
  back: {from: belt.two, to: belt.rest}
""")
    plant = parse_plant("""\
firable_plant: 1
plant: twice
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 1}
departures: {station: exit, after_s: 1}
machines: {B: {commands: {RUN: {does: carry, from: entry, to: table, takes_s: 4, when_full: wait}}}}
sensors: {}
""")
    monitor = Monitor(net, plant)
    for at, fired, sent in ((0.0, "go", "belt.one"), (4.1, "next", "belt.two")):
        assert monitor.fired(at, fired) is None
        if fired == "next":
            assert monitor.signal(at, "belt.there", value=False) is None
        assert monitor.sent(at, sent) is None
        if fired == "go":
            assert monitor.signal(4.0, "belt.there", value=True) is None
    found = monitor.signal(4.3, "belt.there", value=True)
    assert found is not None
    assert found.subject == "belt.there"


@pytest.mark.parametrize(("after_seconds", "patience"), [(0.0, 0.9), (3.0, 3.9)])
def test_a_camera_that_never_judges_is_told_of_when_it_should_have(after_seconds: float, patience: float) -> None:
    before, shows = until_judged(1)
    slow = inspected_cell.PLANT.replace("{fails: table}", f"{{fails: table, after_s: {after_seconds}}}")
    monitor = Monitor(inspected_cell.net(), inspected_cell.plant(slow))
    for event in before:
        assert monitor.seen(event) is None
    assert monitor.signal(shows.at_seconds, "robot.placed", value=True) is None
    assert monitor.passed(shows.at_seconds + patience) is None
    found = monitor.passed(shows.at_seconds + patience + 0.5)
    assert found is not None
    assert found.subject in OTHER


def test_a_camera_whose_judgement_gets_stuck_is_unexplained() -> None:
    stuck = StuckSensor("camera.ok", value=True, from_seconds=2.0)
    found = inspected(inspected_cell.run(0, disturbances=[stuck]))
    assert found is not None
    assert found.subject == "camera.ok"


@pytest.mark.parametrize("is_local", [False, True])
def test_a_workpiece_that_is_machined_may_be_found_another_than_before(is_local: bool) -> None:
    net, model = free_cell(("clamp", "run", "to_entry", "belt"), judged=True), bench(judged=JUDGED)

    def monitored(*changes: tuple[float, str, bool]) -> Divergence | None:
        events: list[Event] = [SignalChanged(0.0, "c.entry", value=True), SignalChanged(0.0, "c.fresh", value=True)]
        for at, name in ((1.0, "belt"), (6.0, "clamp"), (8.0, "run")):
            events += [Fired(at, (f"send_{name}",)), CommandSent(at, f"c.{name}")]
        events += [SignalChanged(1.1, "c.entry", value=False), SignalChanged(1.1, "c.fresh", value=False)]
        events += [SignalChanged(at, signal, value=value) for at, signal, value in ((5.0, "c.ok", True), *changes)]
        monitor = LocalMonitor(split(net), ["c"], model) if is_local else Monitor(net, model)
        for event in sorted(events, key=lambda event: event.at_seconds):
            monitor.seen(event)
        return monitor.divergence

    assert monitored() is None
    assert monitored((11.0, "c.ended", True)) is None, "it may be found as before"
    assert monitored((11.0, "c.ok", False), (11.1, "c.nok", True), (11.2, "c.ended", True)) is None
    early = monitored((7.5, "c.ok", False), (7.6, "c.nok", True))
    assert early is not None
    assert early.subject == "c.ok"
    twice = monitored((11.0, "c.ok", False), (11.1, "c.nok", True), (11.2, "c.ended", True), (12.0, "c.ok", True))
    assert twice is not None
    assert twice.subject == "c.ok"


def test_a_command_that_the_plant_refuses_says_why() -> None:
    trace = run_of("one_robot")
    events = list(trace.events)
    where = next(i for i, e in enumerate(events) if isinstance(e, CommandSent) and e.place == "robot.to_cv1")
    early: list[Event] = [e for e in events[:where] if not isinstance(e, SignalChanged)]
    found = watched("one_robot", altered(trace, early))
    assert found is not None
    assert "conveyor" in found.subject


def test_after_the_first_divergence_nothing_more_is_said() -> None:
    monitor = Monitor(catalogue_net("one_robot"), catalogue_plant("one_robot"))
    first = monitor.signal(1.0, "mc.program_end", value=True)
    assert first is not None
    assert monitor.signal(2.0, "robot.at_mc", value=True) is None
    assert monitor.fired(3.0, "G1") is None
    assert monitor.divergence == first
    assert monitor.deadline_seconds() is None


def test_a_plant_of_another_cell_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        Monitor(catalogue_net("one_robot"), catalogue_plant("two_cells"))
    assert {diagnostic.code for diagnostic in caught.value.diagnostics} == {"F5003"}


def test_a_run_tells_of_silence_when_it_begins_and_goes_on_or_stops_as_was_said() -> None:
    def run(watch: Watch) -> RunReport:
        return execute(
            split(catalogue_net("one_robot")),
            SimulatedCell(catalogue_plant("one_robot"), workpieces=3, disturbances=[NeverCompletes("R", "MOVE", 3)]),
            Conduct(watch=watch),
        )

    told, stopped, ignored = run(Watch.TELL), run(Watch.STOP), run(Watch.IGNORE)
    assert told.divergence is not None
    assert told.divergence == stopped.divergence
    assert "overdue" in told.situation.message
    assert "the machines are not as they are modelled" in stopped.situation.message
    assert stopped.state is State.FAULT
    assert stopped.simulated_seconds < told.divergence.at_seconds + 0.001 < told.simulated_seconds - 100
    assert (ignored.watched, ignored.divergence) == (False, None)


def test_a_run_of_machines_as_they_are_modelled_diverges_nowhere() -> None:
    report = execute(
        split(catalogue_net("two_cells")),
        SimulatedCell(catalogue_plant("two_cells"), workpieces=5),
        Conduct(watch=Watch.STOP),
    )
    assert report.state is State.DONE
    assert report.watched
    assert report.divergence is None


def test_a_divergence_is_told_and_stands_in_the_situation_as_it_comes() -> None:
    told: list[tuple[str, str]] = []
    situations: list[str] = []

    async def looking(host: Host) -> None:
        while host.divergence is None:
            situations.append(host.situation().message)
            await asyncio.sleep(0.1)
        assert told == [("divergence", f"the machines are not as they are modelled: {host.divergence}")]
        assert host.situation().message.endswith(told[0][1])
        assert "robot.to_cv1" in told[0][1]
        host.stop()

    report = execute(
        split(catalogue_net("one_robot")),
        SimulatedCell(catalogue_plant("one_robot"), workpieces=1, disturbances=[NeverCompletes("R", "MOVE", 1)]),
        Conduct(operator=looking, tell=lambda kind, sentence: told.append((kind, sentence))),
    )
    assert situations
    assert not any("modelled" in one for one in situations)
    assert report.situation.message == "stopped by the operator"


def test_machines_are_said_to_be_watched_no_more_when_a_run_goes_on_from_the_middle(tmp_path: Path) -> None:
    def run(operator: Callable[[Host], Awaitable[None]] | None, watch: Watch = Watch.TELL) -> tuple[RunReport, int]:
        told: list[str] = []
        report = execute(
            split(catalogue_net("one_robot")),
            SimulatedCell(catalogue_plant("one_robot"), workpieces=2),
            Conduct(
                operator=operator,
                journal_path=tmp_path / "journal",
                resume=True,
                watch=watch,
                tell=lambda kind, _: told.append(kind),
            ),
        )
        return report, told.count("unwatched")

    async def reset_and_resumed(host: Host) -> None:
        await asyncio.sleep(5)
        host.emergency_stop("a person")
        while host.reset():
            await asyncio.sleep(0.1)
        for place in host.net.place_index:
            host.say(place, Answer.NOT_RECEIVED)
        while not host.resume():
            await asyncio.sleep(0.1)
            for place in host.net.place_index:
                host.say(place, Answer.NOT_RECEIVED)
        await asyncio.sleep(1)
        host.stop()

    report, told = run(reset_and_resumed)
    assert (report.state, report.watched, told) == (State.STOPPED, False, 1)
    report, told = run(None)
    assert (report.watched, told) == (False, 1)
    assert run(None, Watch.IGNORE)[1] == 0


BELT = """
firable: 1
cell: belt
controllers:
  b:
    start: free
    inputs: [there, full]
    places:
      free:
      run:  {send: {machine: B, command: RUN}, until: done}
      next: {send: {machine: B, command: RUN}, until: next_done}
      seen:
transitions:
  go:   {from: b.free, to: b.run, if: b.there}
  next: {from: b.run, to: b.next, if: b.there}
  look: {from: b.next, to: b.seen, if: b.full}
  end:  {from: b.seen, to: b.free}
"""
BELT_PLANT = """
firable_plant: 1
plant: belt
stations: [table, exit]
arrivals:   {station: table, every_s: 1}
departures: {station: exit, after_s: 4}
machines: {B: {commands: {RUN: {does: carry, from: table, to: exit, takes_s: 1, when_full: wait}}}}
sensors:
  b.there: {occupied: table}
  b.full: {occupied: exit}
"""


def belt_run() -> Trace:
    """A run in which each workpiece waits on the belt for 3 s, until the one before is taken away."""
    stream = io.StringIO()
    execute(split(parse_net(BELT)), SimulatedCell(parse_plant(BELT_PLANT), workpieces=4), Conduct(trace=stream))
    return parse_trace(stream.getvalue())


def test_a_machine_that_has_waited_for_a_full_station_is_not_late_when_that_becomes_free() -> None:
    assert watch(Monitor(parse_net(BELT), parse_plant(BELT_PLANT)), belt_run()) is None


def test_a_machine_that_waits_although_the_station_is_free_is_noticed_after_the_latency() -> None:
    monitor, events = Monitor(parse_net(BELT), parse_plant(BELT_PLANT)), belt_run().events
    free = events.index(SignalChanged(5.0, "b.full", False))
    assert all(monitor.seen(event) is None for event in events[: free + 1])
    assert monitor.passed(5.4) is None
    found = monitor.passed(7.0)
    assert found is not None
    assert found.subject in ("b.next", "b.full")
    assert "b.next" in found.places
