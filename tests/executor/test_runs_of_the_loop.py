"""Every run of the executor on the simulated cell is a run of the loop that the check asks its questions of.

The distributed executor sends a command when its own controller has applied the firing, and the simulated cell has
times; the loop sends it in the firing, or late, and has none. If either could do what the loop cannot, verdicts on the
loop would say nothing of the cell.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest
from support import inspected_cell, rejecting_cell
from support.following import followed
from support.stale_cells import carried, stopped
from support.together_cell import together

from firable.analysis.loop.verdicts import check_loop
from firable.decompose.splitting.cut import split
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.same_loop import compare
from firable.executor.cell.disturbances import Disturbance, NeverCompletes
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.machines.telling import Telling
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.trace import Fired, SignalChanged, Trace, parse_trace

CELLS = ["one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "two_robots_shared", "two_robots_separate"]


@cache
def loop_of(cell: str, sending: Sending, faults: Faults = Faults.NONE) -> ClosedLoop:
    return close(catalogue_net(cell), catalogue_plant(cell), faults, sending)


def trace_of(cell: str, workpieces: int, *disturbances: Disturbance) -> tuple[State, Trace]:
    return run_of(catalogue_net(cell), catalogue_plant(cell), workpieces, *disturbances)


def run_of(net: Net, plant: PlantModel, workpieces: int, *disturbances: Disturbance) -> tuple[State, Trace]:
    stream = io.StringIO()
    report = execute(
        split(net),
        SimulatedCell(plant, workpieces=workpieces, seed=1, disturbances=disturbances),
        Conduct(trace=stream),
    )
    return report.state, parse_trace(stream.getvalue())


def follow(cell: str, trace: Trace, sending: Sending = Sending.AT_ONCE, faults: Faults = Faults.NONE) -> int:
    return followed(loop_of(cell, sending, faults), trace)


@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize("cell", CELLS)
def test_a_run_of_the_executor_is_one_of_the_loop(cell: str, sending: Sending) -> None:
    state, trace = trace_of(cell, 4 if sending is Sending.LATE else 8)
    assert state is (State.DEADLOCK if cell == "one_robot_mc_late" else State.DONE)
    assert follow(cell, trace, sending) > 10


@pytest.mark.parametrize("sending", Sending)
def test_a_run_in_which_workpieces_are_judged_is_one_of_the_loop(sending: Sending) -> None:
    loop, ways = close(inspected_cell.net(), inspected_cell.plant(), sending=sending), set[str]()
    for seed in range(3):
        trace = inspected_cell.run(seed)
        assert followed(loop, trace) > 30
        ways |= {name for event in trace.events if isinstance(event, Fired) for name in event.transitions}
        events = list(trace.events)
        where = next(i for i, e in enumerate(events) if isinstance(e, SignalChanged) and e.signal.startswith("camera."))
        shown = events[where]
        assert isinstance(shown, SignalChanged)
        other = {"camera.ok": "camera.nok", "camera.nok": "camera.ok"}[shown.signal]
        both = SignalChanged(shown.at_seconds, other, value=True)
        with pytest.raises(AssertionError, match=f"does not show {other} = 1"):
            followed(loop, replace(trace, events=(*events[: where + 1], both, *events[where + 1 :])))
    assert {"accept", "reject"} < ways


@pytest.mark.parametrize("sending", Sending)
def test_a_run_in_which_workpieces_leave_by_two_ways_is_one_of_the_loop(sending: Sending) -> None:
    net, plant = rejecting_cell.net(), rejecting_cell.plant()
    state, trace = run_of(net, plant, 8)
    assert state is State.DONE
    fired = [name for event in trace.events if isinstance(event, Fired) for name in event.transitions]
    assert {"reject", "t6"} < {*fired}
    assert followed(close(net, plant, sending=sending), trace) == len(fired)


def test_a_workpiece_that_leaves_raw_where_it_may_not_is_a_fault() -> None:
    plant = rejecting_cell.plant(rejecting_cell.PLANT.replace(", raw: true", ""))
    state, trace = run_of(rejecting_cell.net(), plant, 8)
    assert state is State.FAULT
    assert followed(close(rejecting_cell.net(), plant), trace) > 0


def test_two_cells_in_a_line_carry_their_workpieces_through_as_the_loop_allows() -> None:
    state, trace = trace_of("two_cells", 2)
    assert state is State.DONE
    assert follow("two_cells", trace) > 40


@pytest.mark.parametrize(("machine", "command"), [("R", "GRASP"), ("MC", "RUN"), ("CV2", "RUN")])
def test_a_run_with_a_machine_that_never_completes_is_one_of_the_loop_with_faults(machine: str, command: str) -> None:
    state, trace = trace_of("one_robot", 8, NeverCompletes(machine, command, 2))
    assert state is not State.DONE
    assert follow("one_robot", trace, Sending.AT_ONCE, Faults.FOR_GOOD) > 10


@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize("first", ["entry", "holds"])
def test_what_a_cell_does_between_two_signals_of_one_instant_is_in_the_loop(
    first: str, sending: Sending, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot that has grasped shows that the entry is empty and then that it holds something, or the other way."""
    net, plant = together(first)
    state, trace = run_of(net, plant, 3)
    fired = [name for event in trace.events if isinstance(event, Fired) for name in event.transitions]
    assert state is (State.DEADLOCK if first == "entry" else State.DONE)
    assert ("lost" in fired) == (first == "entry")
    assert followed(close(net, plant, Faults.NONE, sending), trace) == len(fired)
    monkeypatch.setattr(Telling, "told_late", lambda *_: frozenset())
    if first == "entry":
        with pytest.raises(AssertionError, match="the loop cannot fire lost here"):
            followed(close(net, plant, Faults.NONE, sending), trace)


@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize(("cell", "last"), [(carried, "still"), (stopped, "bad")])
def test_what_a_cell_does_on_a_signal_that_is_a_moment_old_is_in_the_loop(
    cell: Callable[[], tuple[Net, PlantModel]], last: str, sending: Sending
) -> None:
    """A conveyor takes its workpiece as its command is sent; a stop finds a robot that has just grasped."""
    net, plant = cell()
    state, trace = run_of(net, plant, 2)
    fired = [name for event in trace.events if isinstance(event, Fired) for name in event.transitions]
    assert (state, fired[-1]) == (State.DEADLOCK, last)
    assert followed(close(net, plant, sending=sending), trace) == len(fired)


TAKEN_NET = """\
firable: 1
cell: taken
controllers:
  belt:
    start: [rest, ready]
    inputs: [entry, middle]
    places:
      rest:
      ready:
      feed:  {send: {machine: A, command: RUN}, until: fed}
      run:   {send: {machine: B, command: RUN}UNTIL}
      seen:
      after:
transitions:
  first: {from: belt.rest, to: belt.feed, if: belt.entry}
  go:    {from: belt.feed, to: GO, if: belt.middle}
  see:   {SEE, if: belt.middle}
properties:
  never_after: {never: belt.after}
"""
TAKEN_PLANT = """\
firable_plant: 1
plant: taken
stations: [entry, middle, exit]
arrivals:   {station: entry, every_s: 400}
departures: {station: exit, after_s: 1}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: middle, takes_s: 4}}}
  B: {commands: {RUN: {does: carry, from: middle, to: exit, takes_s: 4}}}
sensors:
  belt.entry:  {occupied: entry}
  belt.middle: {occupied: middle}
"""


@pytest.mark.parametrize(
    ("until", "go", "see"),
    [
        ("", "belt.run", "from: belt.run, to: belt.after"),
        (", until: carried", "[belt.run, belt.seen]", "from: belt.seen, to: belt.after"),
        (", until: carried", "belt.run", "from: belt.ready, to: belt.after, unless: [belt.feed, belt.rest]"),
    ],
    ids=["takes", "beside", "empty"],
)
def test_what_fires_for_the_sake_of_a_command_that_is_sent_goes_by_what_was_seen_before(
    until: str, go: str, see: str
) -> None:
    """A conveyor takes its workpiece when it is told to; who fires then has not been told that it has gone."""
    text = TAKEN_NET.replace("UNTIL", until).replace("GO", go).replace("SEE", see)
    net, plant = (
        parse_net(text.replace("unless: belt.feed", "unless: [belt.feed, belt.rest]")),
        parse_plant(TAKEN_PLANT),
    )
    state, trace = run_of(net, plant, 1)
    fired = [name for event in trace.events if isinstance(event, Fired) for name in event.transitions]
    assert (state, fired) == (State.DEADLOCK, ["first", "go", "see"])
    for sending in Sending:
        loop = close(net, plant, sending=sending)
        assert followed(loop, trace) == 3
        compare(Plant(net, plant, sending), loop)
    assert check_loop(net, plant).verdict("loop.property.never_after").status is Status.VIOLATED


def test_two_conveyors_that_both_see_a_workpiece_may_both_be_sent_for_it() -> None:
    text = """\
firable: 1
cell: rivals
controllers:
  belt:
    start: [one, two]
    inputs: [left, right]
    places:
      one:
      two:
      run_a: {send: {machine: A, command: RUN}, until: done_a}
      run_b: {send: {machine: B, command: RUN}, until: done_b}
transitions:
  a: {from: belt.one, to: belt.run_a, if: belt.left}
  b: {from: belt.two, to: belt.run_b, if: belt.right}
"""
    sensors = "  belt.left: {occupied: entry}\n  belt.right: {occupied: entry}\n"
    model = parse_plant(TAKEN_PLANT.partition("  belt.entry")[0].replace("from: middle", "from: entry") + sensors)
    state, trace = run_of(parse_net(text), model, 1)
    assert state is State.FAULT
    assert any("where no workpiece lies" in str(event) for event in trace.events)
    assert check_loop(parse_net(text), model).verdict("loop.accidents").status is Status.VIOLATED
    for sending in Sending:
        compare(Plant(parse_net(text), model, sending), close(parse_net(text), model, sending=sending))


def test_a_camera_that_takes_no_time_is_told_of_behind_what_it_judges() -> None:
    text = """\
firable: 1
cell: seen
controllers:
  eye: {start: rest, inputs: [good, there], places: {rest: , odd: }}
transitions:
  odd: {from: eye.rest, to: eye.odd, if: eye.good, unless: eye.there}
properties:
  never_odd: {never: eye.odd}
"""
    sensors = "  eye.good: {passes: entry, likely: 1}\n  eye.there: {occupied: entry}\n"
    net, model = parse_net(text), parse_plant(TAKEN_PLANT.partition("  belt.entry")[0] + sensors)
    assert check_loop(net, model).verdict("loop.property.never_odd").holds
    state, trace = run_of(net, model, 1)
    assert state is State.WAITING
    seen = [event.signal for event in trace.events if isinstance(event, SignalChanged)]
    assert seen == ["eye.there", "eye.good"]
