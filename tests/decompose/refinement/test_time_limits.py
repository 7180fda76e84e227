"""Time limits in registered tasks: a step may be late, and the task says how it goes on."""

import pytest

from firable.analysis.check import check
from firable.decompose.proofs.proving import prove
from firable.decompose.refinement.closed import closed, prove_block
from firable.decompose.refinement.refining import refine
from firable.decompose.splitting.cut import split
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, TimeLimit
from firable.nets.printing import format_net
from firable.nets.tasks.text import parse_tasks
from firable.nets.text import parse_net

TASKS = """\
firable_tasks: 1
tasks:
  fetch:
    roles:
      robot:
        steps:
          go:
            place: "to_{shelf}"
            send: {machine: "{robot.machine}", command: MOVE, to: "{shelf.machine}"}
            until: "at_{shelf}"
            within: 5s
          hold: {place: "hold_{shelf}"}
        inputs: {reset: "reset"}
      shelf:
        steps: {open: , shut: }
    moves:
      a: {from: [robot.go, shelf.open], to: [robot.hold, shelf.shut]}
      retry: {from: robot.go_fault, to: robot.go, if: robot.reset}
"""
CELL = """\
firable: 1
cell: c
controllers:
  system:
    coordinator: true
    start: [rob, s1]
    places:
      rob: {opens: {to: robot.free, machine: R}}
      s1: {opens: {to: shelf.idle, machine: S}}
      fetching: {task: {name: fetch, robot: rob, shelf: s1}}
  robot:
  shelf:
transitions:
  begin: {from: [system.rob, system.s1], to: system.fetching}
  finish: {from: system.fetching, to: [system.rob, system.s1]}
"""


def refined(tasks: str = TASKS) -> Net:
    return refine(parse_net(CELL), parse_tasks(tasks)).net


def test_a_task_with_a_time_limit_keeps_the_conditions_and_may_never_settle() -> None:
    proof = prove_block(parse_tasks(TASKS)["fetch"])
    assert proof.sound
    assert not proof.settles, "a step may be late and tried again for ever"


def test_a_task_that_leaves_its_fault_step_to_itself_cannot_end() -> None:
    retry = "      retry: {from: robot.go_fault, to: robot.go, if: robot.reset}\n"
    proof = prove_block(parse_tasks(TASKS.replace(retry, ""))["fetch"])
    assert "fetch.ends" in {verdict.name for verdict in proof.verdicts if not verdict.holds}


def test_a_step_with_a_time_limit_becomes_a_place_with_one() -> None:
    net = refined()
    assert net.place("robot.to_s1").within == TimeLimit(5000, "robot.to_s1_overdue")
    assert net.transition("robot.to_s1_timeout").outputs == ("robot.to_s1_fault",)
    assert "within: 5s}" in format_net(net)
    assert parse_net(format_net(net)) == net
    assert check(net).verdict("live").holds
    assert prove(split(net)).holds


def test_a_fault_step_that_is_declared_may_send_a_command() -> None:
    declared = TASKS.replace(
        "          hold:", "          go_fault: {place: stopped, send: {machine: R, command: HALT}}\n          hold:"
    )
    net = refined(declared)
    assert str(net.place("robot.stopped").command) == "R HALT"
    assert net.transition("robot.to_s1_timeout").outputs == ("robot.stopped",)
    assert parse_net(format_net(net)) == net


def test_the_closed_task_has_the_fault_transition_of_the_net() -> None:
    net = closed(parse_tasks(TASKS)["fetch"])
    assert {net.transitions[t].name for t in net.fault_transitions.values()} == {"robot_go_timeout"}


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("within: 5s", "within: 5", "F2029"),
        ("within: 5s", "within: {time: 5s, to: gone}", "F2025"),
        ("within: 5s", "within: {time: 5s, to: go}", "F2025"),
        ('            until: "at_{shelf}"\n', "", "F2028"),
    ],
)
def test_a_time_limit_of_a_step_that_is_none_is_refused(old: str, new: str, code: str) -> None:
    assert old in TASKS
    with pytest.raises(InputError) as caught:
        parse_tasks(TASKS.replace(old, new))
    assert code in {problem.code for problem in caught.value.diagnostics}
    assert all(problem.span for problem in caught.value.diagnostics)
