"""Time limits in analysis: a free gate that may race the completion, without conflict and without starvation."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import pytest

from firable.analysis import eager_run
from firable.analysis.check import check
from firable.analysis.loop.verdicts import LoopReport, check_loop
from firable.analysis.report import CheckReport
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.nets.machines.closing import close
from firable.nets.machines.fitting import misfits
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import ExternalGate, Fairness, Net, Property
from firable.nets.text import parse_net
from firable.nets.time_limits import only_after_a_timeout
from firable.nets.verdict import Status
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

FAULTS = ("to_cv1", "to_mc", "back", "to_mc_empty", "to_cv2")


def timed() -> Net:
    return catalogue_net("one_robot_timed")


def edited(*edits: tuple[str, str]) -> Net:
    """The timed cell with another text."""
    text = catalogue_path("one_robot_timed").read_text("utf-8")
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    return parse_net(text)


@cache
def checked() -> CheckReport:
    return check(timed())


def named(names: Iterable[str]) -> set[str]:
    return {f"robot.{name}_timeout" for name in names}


def test_the_timed_cell_holds_everything_and_warns_of_nothing_new() -> None:
    without = check(catalogue_net("one_robot"))
    assert all(verdict.holds for verdict in checked().verdicts if verdict.name.startswith("property."))
    for name in ("deadlock-free", "live", "reversible", "contact-free", "starvation", "effective-conflicts"):
        assert checked().verdict(name).holds, name
    warned = {v.name for v in checked().verdicts if v.status is Status.VIOLATED}
    assert warned == {v.name for v in without.verdicts if v.status is Status.VIOLATED} | {"structural-conflicts"}


def test_completion_and_timeout_may_each_come_first() -> None:
    player = Player(timed())
    moving = timed().marking(["robot.to_cv1"])
    assert {timed().transitions[t].name for t in player.may_fire(moving)} == {"t1-a", "robot.to_cv1_timeout"}
    late = {"robot.to_cv1_overdue": True}
    both = {"robot.to_cv1_overdue": True, "robot.at_cv1": True}
    assert [timed().transitions[t].name for t in player.enabled(moving, late)] == ["robot.to_cv1_timeout"]
    assert [timed().transitions[t].name for t in player.enabled(moving, both)] == ["t1-a"]
    assert player.enabled(moving, {}) == ()


def test_a_step_never_holds_completion_and_timeout_together() -> None:
    player = Player(timed())
    steps = player.steps(timed().marking(["robot.to_cv1"]))
    found = {tuple(timed().transitions[t].name for t in step) for step in steps}
    assert found == {("t1-a",), ("robot.to_cv1_timeout",)}
    assert check(timed(), Discipline.STEP).verdict("live").holds


def test_motions_that_fail_again_and_again_are_excluded_by_strong_fairness_only() -> None:
    (carried,) = [p for p in timed().properties if p.name == "accepted_is_carried_out"]
    assert isinstance(carried, Property)
    weak = replace(timed(), properties=(replace(carried, fairness=Fairness.WEAK),))
    verdict = check(weak).verdict("property.accepted_is_carried_out")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert any(name in named(FAULTS) for fired in verdict.witness.cycle for name in fired)


def test_a_cell_without_a_way_back_from_a_fault_place_is_not_live() -> None:
    back = "  t1-f: {from: robot.to_mc_fault,       to: robot.to_mc,       if: robot.reset, description: tried again}\n"
    report = check(edited((back, "")))
    assert report.verdict("live").status is Status.VIOLATED
    assert report.verdict("deadlock-free").status is Status.VIOLATED


def test_in_the_run_without_faults_nothing_starves_that_waits_for_one() -> None:
    run = eager_run(timed())
    assert run.cycle
    fired = {name for step in run.cycle for name in step}
    assert fired.isdisjoint(named(FAULTS))
    assert only_after_a_timeout(timed()) == named(FAULTS) | {f"t1-{letter}" for letter in "efghi"}
    assert only_after_a_timeout(catalogue_net("one_robot")) == frozenset()


def test_a_live_transition_that_priority_passes_over_starves_in_a_timed_cell_too() -> None:
    text = """
firable: 1
cell: c
start: free
places: {free: , a: {send: {machine: M, command: A}, until: x, within: 1s}, b: }
transitions:
  to_a: {from: free, to: a}
  to_b: {from: free, to: b}
  end_a: {from: a, to: free}
  end_b: {from: b, to: free}
  again: {from: a_fault, to: a}
"""
    verdict = check(parse_net(text)).verdict("starvation")
    assert verdict.status is Status.VIOLATED
    assert set(verdict.subjects) == {"to_b", "end_b"}


# --- With the machines


@cache
def looped() -> LoopReport:
    return check_loop(timed(), catalogue_plant("one_robot_timed"))


def test_with_its_machines_the_timed_cell_holds_everything() -> None:
    assert all(verdict.holds for verdict in looped().verdicts)


def test_a_robot_that_was_not_stopped_is_commanded_again_while_it_moves() -> None:
    text = catalogue_path("one_robot_timed").read_text("utf-8")
    net = parse_net(text.replace("{send: {machine: R, command: STOP}, description: stopped", "{description: stopped"))
    report = check_loop(net, catalogue_plant("one_robot_timed"))
    verdict = report.verdict("loop.busy-machines")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert any(fired[0] in named(FAULTS) for fired in verdict.witness.firings)


LIMITED = ("until: touch,    description: grasping on CV1", "until: touch, within: 2s, description: grasping on CV1")


def test_a_grip_that_is_tried_again_may_have_been_done_a_moment_before_the_timeout_and_its_stop() -> None:
    net = edited(
        LIMITED,
        ("  t2-a:", "  t1-j: {from: robot.grasp_cv1_fault, to: robot.grasp_cv1, if: robot.reset}\n  t2-a:"),
        ("      to_mc:\n", "      grasp_cv1_fault: {send: {machine: R, command: STOP}}\n      to_mc:\n"),
    )
    verdict = check_loop(net, catalogue_plant("one_robot_timed")).verdict("loop.accidents")
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    run = [name for (name,) in verdict.witness.firings]
    done = next(i for i, name in enumerate(run) if name.startswith("R/done/robot.grasp_cv1/"))
    assert run[done].endswith("/robot.touch-late")
    assert any(name.startswith("robot.grasp_cv1_timeout") for name in run[done:])
    assert run[-1].endswith("/R-holds")


@pytest.mark.parametrize("gates", [", unless: robot.in_hand", ""], ids=["its hand is looked at", "it is not"])
def test_a_grip_may_be_tried_again_where_the_robot_is_at_rest_and_its_hand_is_seen_to_be_empty(gates: str) -> None:
    again = f"  t1-j: {{from: robot.grasp_cv1_fault, to: robot.grasp_cv1, if: robot.reset{gates}}}\n"
    done = "{from: [robot.grasp_cv1_fault, conveyor.cv1_wait], to: [robot.to_mc, conveyor.cv1], if: robot.in_hand}"
    net = edited(
        LIMITED,
        ("inputs: reset\n", "inputs: [reset, in_hand]\n"),
        ("  t2-a:", f"{again}  G3-late: {done}\n  t2-a:"),
        ("      to_mc:\n", "      grasp_cv1_fault: {send: {machine: R, command: HALT}, until: still}\n      to_mc:\n"),
    )
    at_once = "      STOP:    {does: stop}\n  MC:\n"
    plant = catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml").read_text("utf-8")
    assert plant.count(at_once) == 1
    plant = plant.replace(at_once, f"      HALT:    {{does: stop, takes_s: 0.3}}\n{at_once}")
    report = check_loop(net, parse_plant(f"{plant}  robot.in_hand: {{holding: R}}\n"))
    if gates:
        assert all(verdict.holds for verdict in report.verdicts)
    else:
        assert report.verdict("loop.accidents").status is Status.VIOLATED


def test_a_timer_that_only_its_fault_transition_reads_is_no_place_of_the_loop() -> None:
    loop = close(timed(), catalogue_plant("one_robot_timed"))
    assert "robot.to_cv1_overdue" not in loop.net.place_index
    assert "plant.robot.at_cv1.told_1" in loop.net.transition("robot.to_cv1_timeout/R-idle").inhibitive


def test_a_timer_that_something_else_reads_is_set_while_its_place_waits_and_cleared_by_the_next_command() -> None:
    lamp = "  t1-j: {from: robot.dark, to: robot.lit, if: robot.to_cv1_overdue}\n"
    lamp += "  t1-k: {from: robot.lit, to: robot.dark}\n"
    net = edited(
        ("  t2-a:", f"{lamp}  t2-a:"),
        ("    start: free\n    inputs: reset", "    start: [free, dark]\n    inputs: reset"),
        ("      to_mc:\n", "      dark:\n      lit:\n      to_mc:\n"),
    )
    loop = close(net, catalogue_plant("one_robot_timed"))
    over = loop.net.transition("robot.to_cv1_overdue/over")
    assert over.outputs == ("robot.to_cv1_overdue",)
    assert "robot.to_cv1" in over.permissive
    assert "plant.robot.at_cv1.told_1" in over.inhibitive
    assert any("clears-robot.to_cv1_overdue" in name for name in loop.variants["G2"])
    report = check_loop(net, catalogue_plant("one_robot_timed"))
    assert report.verdict("loop.live").holds


def test_a_key_is_pressed_at_any_time_and_released_by_the_next_command() -> None:
    loop = close(timed(), catalogue_plant("one_robot_timed"))
    assert loop.net.transition("robot.reset/pressed").outputs == ("robot.reset", "plant.robot.reset.told_1")
    assert "plant.R.idle" in loop.net.transition("robot.reset/released").inhibitive
    assert ExternalGate("robot.reset") in timed().transition("t1-e").external


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("acknowledges: R,", "acknowledges: RR,", "there is no machine 'RR'"),
        ("acknowledges: R,", "acknowledges: R, holding: R,", "sees one thing"),
        ("acknowledges: R,", "acknowledges: R, may_flicker: true,", "pressed or not"),
        ("acknowledges: R,", "holding: R,", "sees at once"),
    ],
)
def test_a_key_that_is_none_is_refused(old: str, new: str, says: str) -> None:
    text = catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml").read_text("utf-8")
    with pytest.raises(InputError) as caught:
        parse_plant(text.replace(old, new))
    assert [problem.code for problem in caught.value.diagnostics] == ["F5003"]
    assert says in caught.value.diagnostics[0].message


@pytest.mark.parametrize("name", ["robot.to_cv1_overdue", "robot.at_cv1"])
def test_no_sensor_of_a_plant_sets_a_timer_and_no_key_a_completion(name: str) -> None:
    text = catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml").read_text("utf-8")
    model = parse_plant(f"{text.rstrip()}\n  {name}: {{acknowledges: R}}\n")
    assert [problem.subject for problem in misfits(model, timed())] == [("sensors", name)]
