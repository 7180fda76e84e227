"""Which signals of a loop are told late, and what the loop says of a cell that fires between two of them."""

from __future__ import annotations

import pytest
from support.together_cell import NET, belts, together

from firable.analysis.loop.verdicts import check_loop
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Sending
from firable.nets.machines.telling import Telling
from firable.nets.text import parse_net
from firable.nets.verdict import Status

CELLS = (
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "one_robot_timed"),
    *("two_robots_shared", "two_robots_separate", "two_cells"),
)


def late(loop: ClosedLoop) -> list[str]:
    return [place.name.removeprefix("plant.")[:-5] for place in loop.net.places if place.name.endswith(".news")]


def test_a_cell_that_fires_between_two_signals_of_one_instant_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    report = check_loop(*together())
    verdict = report.verdict("loop.property.never_lost")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert verdict.witness.firings == (("arrives/entry",), ("come",), ("R/done/robot.grasp",), ("lost",))
    assert "lost fires before a controller is told of robot.holds, robot.grasped" in verdict.witness.note
    assert report.verdict("loop.deadlock-free").status is Status.VIOLATED
    monkeypatch.setattr(Telling, "told_late", lambda *_: frozenset())
    at_once = check_loop(*together())
    assert at_once.verdict("loop.property.never_lost").holds, "all that is wrong lies in between"
    assert at_once.verdict("loop.deadlock-free").holds


@pytest.mark.parametrize(
    ("gates", "expected"),
    [
        ("unless: [robot.entry, robot.holds]", ["robot.holds", "robot.grasped"]),
        ("if: robot.holds", ["robot.entry", "robot.grasped"]),  # `come` waits for the one that falls then
        ("if: robot.entry", []),
        ("unless: robot.holds", []),  # it closes one gate alone
        ("unless: robot.entry", []),
    ],
)
def test_a_sensor_is_told_late_that_closes_a_gate_while_another_opens_one(gates: str, expected: list[str]) -> None:
    net, plant = parse_net(NET.replace("unless: [robot.entry, robot.holds]", gates)), together()[1]
    assert late(close(net, plant)) == expected


def test_what_may_linger_falls_later_anyway() -> None:
    assert "belt.entry" in late(close(*belts()))
    assert "belt.entry" not in late(close(*belts(", may_linger: true")))


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("sending", Sending)
def test_no_gate_of_the_catalogue_rests_on_two_sensors_of_one_instant(name: str, sending: Sending) -> None:
    plant = catalogue_plant(name)
    assert late(close(catalogue_net(name), plant, sending=sending)) == []
