"""Runs on the simulated cell that go round in a circle, and runs that only look so for a while."""

from __future__ import annotations

import asyncio
import re

import pytest

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import Disturbance, NeverCompletes
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.running import Operator, RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.machines.plant_file import parse_plant
from firable.nets.text import parse_net

NET = """firable: 1
cell: fetching
controllers:
  robot:
    start: free
    inputs: [reset, there]
    places:
      free:
      out:        {send: {machine: R, command: MOVE, to: OUT}, until: is_out, within: 1s}
      out_fault:  {send: {machine: R, command: STOP}}
      grasp:      {send: {machine: R, command: GRASP, at: OUT}, until: has_grasped}
      back:       {send: {machine: R, command: MOVE, to: HOME}, until: is_home}
      put:        {send: {machine: R, command: PUT, at: HOME}, until: has_put}
transitions:
  start:  {from: robot.free, to: robot.out, if: robot.there}
  again:  {from: robot.out_fault, to: robot.out, if: robot.reset}
  take:   {from: robot.out, to: robot.grasp}
  turn:   {from: robot.grasp, to: robot.back}
  lay:    {from: robot.back, to: robot.put}
  end:    {from: robot.put, to: robot.free}
"""
PLANT = """firable_plant: 1
plant: fetching
stations: [table, exit]
arrivals:   {station: table, every_s: 5}
departures: {station: exit}
machines:
  R:
    hand: HOME
    positions: {HOME: exit, OUT: table}
    commands:
      MOVE: {does: move, takes_s: 1.5}
      GRASP: {does: grasp, takes_s: 0.5}
      PUT: {does: put, takes_s: 0.5}
      STOP: {does: stop}
  L: {commands: {BLINK: {does: work, takes_s: 0.5}}}
sensors:
  robot.reset: {acknowledges: R, after_s: 3}
  robot.there: {occupied: table}
"""
LAMP = """  lamp:
    start: dark
    places:
      dark:
      bright: {send: {machine: L, command: BLINK}, until: has_blinked}
"""
BLINKING = """  shine:  {from: lamp.dark, to: lamp.bright}
  fade:   {from: lamp.bright, to: lamp.dark}
"""
WITH_LAMP = NET.replace("transitions:\n", f"{LAMP}transitions:\n") + BLINKING
"""The same beside a lamp, which is a circle of its own."""
HANGS = NeverCompletes("R", "MOVE", 1)


@pytest.fixture(autouse=True)
def _small_circles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.executor.operating.circling.FIRINGS_MAX", 200)
    monkeypatch.setattr("firable.executor.operating.circling.ROUNDS_MAX", 60)


def ran(text: str, *disturbances: Disturbance, every_s: int = 5, operator: Operator | None = None) -> RunReport:
    """A run of two workpieces."""
    plant = parse_plant(PLANT.replace("every_s: 5", f"every_s: {every_s}"))
    cell = SimulatedCell(plant, workpieces=2, disturbances=disturbances)
    return execute(split(parse_net(text)), cell, Conduct(operator=operator))


def with_lamp(limit: str) -> str:
    """The cell beside a lamp, with this limit for the way to the table."""
    return WITH_LAMP.replace(", within: 1s", limit)


def test_a_motion_that_is_late_each_time_and_tried_again_ends_the_run() -> None:
    report = ran(NET)
    assert (report.state, report.delivered, report.inside) == (State.FAULT, (), (1,))
    # When the circle began depends on whether a workpiece that is due as a time is over comes before that or after it.
    assert report.situation.message == (
        "the cell goes round in a circle of again and robot.out_timeout: 200 firings in 397 s led to nothing new, and "
        "brought no workpiece any further"
    )


def test_a_motion_that_is_late_nine_times_in_ten_comes_to_its_end() -> None:
    plant = parse_plant(PLANT.replace("takes_s: 1.5", "takes_s: 1.4, jitter_s: 0.5"))
    assert execute(split(parse_net(NET)), SimulatedCell(plant, workpieces=20)).state is State.DONE


def test_a_slow_motion_that_is_late_three_times_in_four_comes_to_its_end_whatever_blinks_beside_it() -> None:
    plant = parse_plant(PLANT.replace("takes_s: 1.5", "takes_s: 60, jitter_s: 30"))
    report = execute(split(parse_net(with_lamp(", within: 45s"))), SimulatedCell(plant, workpieces=4))
    assert report.delivered == (1, 2, 3, 4)
    assert report.firings["again"] > 4


def test_what_goes_round_when_all_workpieces_went_through_is_stopped_and_no_fault() -> None:
    report = ran(with_lamp(""))
    assert (report.state, report.delivered) == (State.STOPPED, (1, 2))
    circle = "all workpieces went through, and now the cell goes round in a circle of shine and fade"
    assert re.fullmatch(f"{circle}: 20[01] firings in 50 s led to nothing new", report.situation.message)


def test_a_workpiece_that_comes_late_is_waited_for_whatever_goes_round_until_then() -> None:
    report = ran(with_lamp(""), every_s=300)
    assert report.delivered == (1, 2)
    assert report.firings["shine"] > 600


def test_a_command_that_is_overdue_is_told_of_and_not_what_goes_round_beside_it() -> None:
    report = ran(with_lamp(""), HANGS)  # for two minutes, in which the lamp blinks often enough
    assert report.state is State.FAULT
    assert "'R MOVE to=OUT' of 'robot.out', sent at 0.0 s, is overdue" in report.situation.message


def test_a_long_time_limit_is_waited_for_whatever_goes_round_beside_it() -> None:
    report = ran(with_lamp(", within: 600s"), HANGS)
    assert report.firings["robot.out_timeout"] == 1
    assert report.delivered == (1, 2)


def test_what_goes_round_is_left_to_an_operator_who_is_there() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(1000)
        host.stop()

    report = ran(NET, operator=operator)
    assert (report.state, report.situation.message) == (State.STOPPED, "stopped by the operator")
    assert report.firings["again"] > 200
