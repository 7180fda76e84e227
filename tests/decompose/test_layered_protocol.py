"""The protocol of a net in layers: each coordinator decides its own rounds, and cells go on while the line is down."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.layered_nets import cells_in_a_line

from firable.decompose.protocol.building import protocol_net
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.outages import Outage, outage_text, outage_verdict, outages
from firable.decompose.protocol.parts import Parts
from firable.decompose.protocol.refuting import refute
from firable.decompose.protocol.variant import ANY_FAULTS, PROTOCOL, Variant
from firable.decompose.protocol.verdicts import protocol_verdicts
from firable.decompose.protocol.wrong import WRONG, example
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.verdict import Status

LINE, CELL_A, CELL_B = "coordinator line", "coordinator cell_a", "coordinator cell_b"


@pytest.fixture(scope="module")
def dead() -> dict[str, Outage]:
    return {outage.name: outage for outage in outages(split(cells_in_a_line()))}


def test_each_coordinator_acts_under_its_own_name() -> None:
    protocol = protocol_net(split(cells_in_a_line()))
    assert protocol.parts.deciders == (LINE, CELL_A, CELL_B)
    steps = protocol.steps
    assert str(steps["ask/fill_a"]) == "coordinator cell_a asks for fill_a"
    assert str(steps["decide/hand_over"]) == "hand_over is decided by coordinator line"
    acting = {step.coordinator for name, step in steps.items() if "fill_a" in name and not step.controller}
    assert acting == {CELL_A}


def test_with_one_that_decides_it_is_the_coordinator_whatever_it_is_called() -> None:
    net = cells_in_a_line()
    flat = replace(net, controllers=tuple(replace(controller, under=None) for controller in net.controllers))
    assert Parts(split(flat), PROTOCOL).deciders == ("the coordinator",)
    assert Parts(split(catalogue_net("one_robot")), PROTOCOL).deciders == ("the coordinator",)


def test_coordinator_that_is_down_holds_up_its_own_rounds_alone() -> None:
    protocol = protocol_net(split(cells_in_a_line()), PROTOCOL, ANY_FAULTS)
    waiting = {t.name for t in protocol.net.transitions if "coordinator-down/cell_a" in t.inhibitive}
    assert waiting
    assert all("fill_a" in name or "clear_a" in name for name in waiting - {"crash/coordinator-down/cell_a"})
    assert "coordinator-down/line" in protocol.net.transition("ask/hand_over").inhibitive


def test_layered_protocol_does_what_the_central_net_does_whoever_crashes() -> None:
    found = protocol_verdicts(split(cells_in_a_line()), faults=True)
    assert {verdict.name: verdict.status for verdict in found.verdicts if not verdict.holds} == {}
    assert any("controllers and coordinators crash" in verdict.statement for verdict in found.verdicts)


def test_cells_go_on_while_the_line_is_dead(dead: dict[str, Outage]) -> None:
    outage = dead[LINE]
    assert (outage.at_once, outage.at_last) == (("hand_over",), ("back_a", "back_b"))
    assert outage.goes_on == ("fill_a", "clear_a", "fill_b", "clear_b")
    assert (outage.still, outage.running) == (("Ba", "Bb"), ("Ra", "Ma", "Rb", "Mb"))


def test_a_dead_cell_coordinator_stops_its_own_cell_and_nobody_else(dead: dict[str, Outage]) -> None:
    outage = dead[CELL_A]
    assert (outage.at_once, outage.at_last) == (("fill_a", "clear_a"), ())
    assert outage.goes_on == ("back_a", "fill_b", "clear_b", "back_b", "hand_over")
    assert (outage.still, outage.running) == (("Ra", "Ma"), ("Ba", "Rb", "Bb", "Mb"))


def test_the_name_of_a_coordinator_tells_it_from_the_controller(dead: dict[str, Outage]) -> None:
    assert dead["cell_a"].at_once == dead["cell_a"].at_last == ()  # it has no place
    assert outage_verdict(dead[CELL_A]).name == "faults.dead-coordinator.cell_a"
    assert outage_verdict(dead["cell_a"]).name == "faults.dead.cell_a"
    assert outage_text([dead[LINE]]).startswith("coordinator line dead\n")


def test_conflict_across_coordinators_that_is_decided_below_goes_wrong() -> None:
    wrong = next(wrong for wrong in WRONG if wrong.name == "conflicts-decided-below")
    found = refute(wrong)
    assert found.status is Status.VIOLATED
    assert "hand_over is decided by coordinator cell" in " ".join(found.events)
    # In one layer there is nothing that is decided below.
    lent = example(wrong.example)
    flat = replace(lent, controllers=tuple(replace(controller, under=None) for controller in lent.controllers))
    assert refute(wrong, flat).status is Status.PROVED


def test_share_of_a_conflict_is_a_group_of_its_own_in_the_wrong_variant() -> None:
    lent = split(example("lent"))
    assert Parts(lent, PROTOCOL).groups == (("hand_over", "lend"),)
    assert Parts(lent, Variant(common=False)).groups == (("lend",), ("hand_over",))


def test_wrong_variant_is_not_explained_by_what_holds_of_the_true_one() -> None:
    found = explore_protocol(split(example("lent")))
    assert found.refines is Status.PROVED
    assert explore_protocol(split(example("lent")), Variant(common=False)).refines is Status.VIOLATED
