"""Which signals of a loop are told late, and what the loop says of a cell that fires between two of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.stale_cells import carried, stopped
from support.together_cell import NET, together

from firable.analysis.loop.verdicts import check_loop
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.same_loop import compare
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.machines.telling import Telling
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.nets.verdict import Status

CELLS = (
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "one_robot_timed"),
    *("two_robots_shared", "two_robots_separate", "two_cells", "index_table"),
)


def late(loop: ClosedLoop) -> list[str]:
    return [place.name.removeprefix("plant.")[:-5] for place in loop.net.places if place.name.endswith(".news")]


def test_a_cell_that_fires_between_two_signals_of_one_instant_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    report = check_loop(*together())
    verdict = report.verdict("loop.property.never_lost")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert [name for (name,) in verdict.witness.firings if "/told/" not in name] == [
        *("arrives/entry", "come", "R/done/robot.grasp", "lost")
    ]
    assert verdict.witness.note.endswith("; lost fires before its controller is told that robot.holds has changed")
    assert report.verdict("loop.deadlock-free").status is Status.VIOLATED
    monkeypatch.setattr(Telling, "told_late", lambda *_: frozenset())
    at_once = check_loop(*together())
    assert at_once.verdict("loop.property.never_lost").holds, "all that is wrong lies in between"
    assert at_once.verdict("loop.deadlock-free").holds


@pytest.mark.parametrize(
    ("gates", "expected"),
    [
        ("unless: [robot.entry, robot.holds]", ["robot.entry", "robot.holds", "robot.grasped", "robot.placed"]),
        ("if: robot.entry", ["robot.entry", "robot.grasped"]),
        ("unless: robot.holds", ["robot.holds", "robot.grasped", "robot.placed"]),
        ("if: robot.holds", []),
    ],
    ids=["both", "the entry", "the hand", "the hand while it is full"],
)
def test_a_sensor_that_closes_a_gate_is_told_late_and_its_completion_behind_it(gates: str, expected: list[str]) -> None:
    net, plant = parse_net(NET.replace("unless: [robot.entry, robot.holds]", gates)), together()[1]
    assert late(close(net, plant)) == expected


def test_what_only_opens_gates_is_told_in_the_instant() -> None:
    loop = close(*carried())
    told = {"plant.belt.table.news", "plant.belt.table.told_1"}
    assert told & {*loop.net.transition("A/done/belt.bring").outputs} == {"plant.belt.table.told_1"}
    assert told & {*loop.net.transition("go").outputs} == {"plant.belt.table.news"}


@pytest.mark.parametrize(("cell", "last"), [(carried, "still"), (stopped, "bad")])
def test_a_cell_that_fires_on_what_a_sensor_showed_a_moment_ago_is_found(
    cell: Callable[[], tuple[Net, PlantModel]], last: str
) -> None:
    report = check_loop(*cell())
    verdict = report.verdict("loop.property.never_alarm")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert verdict.witness.firings[-1] == (last,)
    assert report.verdict("loop.accidents").holds


PASSING_NET = """\
firable: 1
cell: passing
controllers:
  belt:
    start: rest
    inputs: [entry, there, seen]
    places:
      rest:
      feed: {send: {machine: A, command: RUN}}
      run:  {send: {machine: B, command: RUN}, until: carried}
      gone:
      back:
transitions:
  first: {from: belt.rest, to: belt.feed, if: belt.entry}
  go:    {from: belt.feed, to: belt.run, if: belt.there}
  end:   {from: belt.run, to: belt.gone, unless: belt.seen}
  again: {from: belt.gone, to: belt.back, if: belt.seen}
properties:
  never_back: {never: belt.back}
"""
PASSING_PLANT = """\
firable_plant: 1
plant: passing
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 4}
departures: {station: exit, after_s: 1}
machines:
  A: {commands: {RUN: {does: carry, from: entry, to: table, takes_s: 4}}}
  B: {commands: {RUN: {does: carry, from: table, to: exit,  takes_s: 4}}}
sensors:
  belt.entry: {occupied: entry}
  belt.there: {occupied: table}
  belt.seen:  {occupied: table}
"""


def test_what_has_come_and_gone_before_a_controller_was_told_it_may_be_told_still() -> None:
    """The belt takes the workpiece that one sensor has shown, before the controller is told what the other one saw."""
    text = PASSING_NET.replace(", until: carried", "")
    report = check_loop(parse_net(text), parse_plant(PASSING_PLANT))
    verdict = report.verdict("loop.property.never_back")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    names = [name for (name,) in verdict.witness.firings]
    assert names[-4:] == ["go/belt.seen-still-to-be-told", "end", "belt.seen/told/rose", "again"]
    waits = check_loop(parse_net(PASSING_NET), parse_plant(PASSING_PLANT))
    assert waits.verdict("loop.property.never_back").holds, "who waits for the completion was told before"


@pytest.mark.parametrize("name", CELLS)
def test_in_the_catalogue_only_a_key_is_told_late_and_completions_that_have_a_time_limit(name: str) -> None:
    """Who goes by a sensor there needs a token that waits for the command to be done."""
    net = catalogue_net(name)
    told = set(late(close(net, catalogue_plant(name))))
    assert told == {place.completion for place in net.places if place.within is not None} | (
        {"robot.reset"} if name == "one_robot_timed" else set()
    )


READ_NET = """\
firable: 1
cell: read
controllers:
  belt:
    start: [ready, watching]
    inputs: [SENSORS]
    places:
      ready:
      aside:   {send: {machine: S, command: STOP}}
      running: {send: {machine: B, command: RUN}, until: brought}
      still:
      after:
      watching:
      saw:
transitions:
  go:    {from: belt.ready, to: [belt.aside, belt.running]}
  end:   {from: [belt.aside, belt.running], to: belt.still, END}
  then:  {from: belt.still, to: belt.after, THEN}
  watch: {from: belt.watching, to: belt.saw, WATCH}
"""
READ_PLANT = """\
firable_plant: 1
plant: read
stations: [entry, table, exit]
arrivals:   {station: entry, every_s: 4}
departures: DEPARTURES
machines:
  S: {commands: {STOP: {does: stop}}}
  B: {commands: {RUN: {does: carry, from: entry, to: table, takes_s: 4}, HALT: {does: stop}}}
sensors:
  belt.one: SENSOR
"""


def read(where: str, gate: str, sensor: str, saw: str = "") -> tuple[Net, PlantModel]:
    """A belt that brings a workpiece to a table for good, beside which a machine is stopped; one gate reads one signal.

    Who reads it as the belt is done, or after that, cannot do so before; who watches it can at any time.
    """
    text, out = READ_NET.replace("saw:", f"saw: {saw}"), "{station: table}" if "leaves" in gate else "{station: exit}"
    for one in ("END", "THEN", "WATCH"):
        text = text.replace(f", {one}", f", {gate.removeprefix('leaves ')}" if one == where else "")
    text, sensors = text.replace("SENSORS", "one"), READ_PLANT.replace("SENSOR", sensor)
    if "brought" in gate:
        text = text.replace("inputs: [one]", "inputs: []")
        sensors = sensors.replace("belt.one", "belt.brought") if sensor else sensors.replace("\n  belt.one: ", " {}")
    return parse_net(text), parse_plant(sensors.replace("DEPARTURES", out))


@pytest.mark.parametrize(
    ("where", "gate", "sensor", "expected"),
    [
        ("WATCH", "unless: belt.one", "{holding: B}", ["belt.one", "belt.brought"]),
        ("WATCH", "if: belt.one", "{holding: B}", ["belt.one", "belt.brought"]),
        ("WATCH", "if: belt.one", "{holding: B, may_linger: true}", ["belt.one"]),
        ("WATCH", "unless: belt.brought", "", ["belt.brought"]),
        ("THEN", "unless: belt.brought", "", []),
        ("THEN", "unless: belt.brought", "{occupied: table}", ["belt.brought"]),
        ("THEN", "if: belt.brought", "{occupied: table, may_flicker: true}", []),
        ("END", "unless: belt.one", "{occupied: table}", []),
        ("END", "unless: belt.one", "{occupied: table, may_flicker: true}", ["belt.one", "belt.brought"]),
        ("END", "if: belt.one", "{occupied: table, may_flicker: true}", ["belt.one", "belt.brought"]),
        ("END", "if: belt.one", "{occupied: table}", []),
        ("END", "if: belt.one", "{occupied: table, may_linger: true}", ["belt.one", "belt.brought"]),
        ("END", "leaves if: belt.one", "{occupied: table}", ["belt.one", "belt.brought"]),
        ("END", "unless: belt.one", "{passes: table}", ["belt.one"]),
        ("END", "if: belt.one", "{passes: table}", []),
        ("END", "leaves if: belt.one", "{fails: table}", ["belt.one"]),
        ("END", "unless: belt.one", "{set_by: operator}", []),
        ("END", "if: belt.one", "{acknowledges: B}", ["belt.one"]),
    ],
)
def test_what_is_told_late_is_what_may_change_while_somebody_could_go_by_the_old_value(
    where: str, gate: str, sensor: str, expected: list[str]
) -> None:
    net, plant = read(where, gate, sensor)
    for sending in Sending:
        loop = close(net, plant, sending=sending)
        assert late(loop) == expected
        assert compare(Plant(net, plant, sending), loop)


def test_what_a_machine_still_does_after_a_stop_is_told_late_whoever_waits_for_its_command() -> None:
    stopped = "{send: {machine: B, command: HALT}, until: at_rest}"
    net, plant = read("END", "unless: belt.one", "{occupied: table}", stopped)
    loop = close(net, plant)
    assert late(loop) == ["belt.one", "belt.brought"]
    assert "plant.belt.one.news" in loop.net.transition("B/still-done/belt.running").outputs
    assert compare(Plant(net, plant, Sending.AT_ONCE), loop)
