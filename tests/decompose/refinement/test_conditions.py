"""The conditions of a task, each violated by a small task, with a trace that the reference player replays."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.random_tasks import random_task

from firable.analysis import Budget
from firable.decompose.refinement.closed import closed, prove_block
from firable.decompose.refinement.ledger import task_problems
from firable.decompose.refinement.refining import refine
from firable.nets import InputError, Status, parse_net
from firable.nets.catalogue import catalogue_tasks
from firable.nets.tasks.model import Task
from firable.nets.tasks.text import parse_tasks
from firable.semantics.player import Player


def task(body: str) -> Task:
    return parse_tasks(f"firable_tasks: 1\ntasks:\n  work:\n{body}")["work"]


TWO = """\
    roles:
      robot: {steps: {go: , hold: , back: }}
      shelf: {steps: {open: , shut: }}
"""
SOUND = (
    TWO
    + """\
    moves:
      a: {from: robot.go, to: robot.hold}
      b: {from: [robot.hold, shelf.open], to: [robot.back, shelf.shut]}
"""
)
UNSOUND = {
    # The robot goes back before the shelf is shut, which only both can do.
    "ends": SOUND + "      c: {from: robot.go, to: robot.back}\n",
    # The robot is at its end while the shelf, which is released later, still is open.
    "ends-clean": TWO.replace(", shut: ", "") + """\
    moves:
      a: {from: robot.go, to: robot.hold}
      b: {from: robot.hold, to: robot.back}
      c: {from: shelf.open, release: shelf}
""",
    "complete": SOUND + "      c: {from: robot.hold, to: robot.back, unless: shelf.open}\n",
}  # fmt: skip


def statuses(of: Task) -> dict[str, Status]:
    return {verdict.name.partition(".")[2]: verdict.status for verdict in prove_block(of).verdicts}


def test_a_sound_task_keeps_every_condition() -> None:
    proof = prove_block(task(SOUND))
    assert proof.sound
    assert proof.settles
    assert proof.orderly
    assert [verdict.name for verdict in proof.verdicts] == [
        "work.ends", "work.ends-clean", "work.contact-free", "work.complete", "work.settles", "work.orderly",
    ]  # fmt: skip


@pytest.mark.parametrize("name", sorted(catalogue_tasks()))
def test_the_tasks_of_the_catalogue_keep_every_condition(name: str) -> None:
    assert set(statuses(catalogue_tasks()[name]).values()) == {Status.PROVED}


@pytest.mark.parametrize("condition", UNSOUND)
def test_a_violated_condition_is_shown_by_a_trace_in_the_names_of_the_task(condition: str) -> None:
    proof = prove_block(task(UNSOUND[condition]))
    assert not proof.sound
    (verdict,) = [v for v in proof.verdicts if v.name == f"work.{condition}"]
    assert verdict.status is Status.VIOLATED
    assert verdict.code == "F4013"
    if condition == "complete":
        assert verdict.subjects == ("c",)
        return
    player, marking = Player(proof.net), proof.net.initial_marking
    assert verdict.witness is not None
    for (name,) in verdict.witness.firings:
        marking = player.fire(marking, (proof.net.transition_index[name],))
    assert proof.net.names(marking) == verdict.witness.marking


def test_what_violates_the_conditions_is_refused_with_the_trace() -> None:
    net = parse_net(
        "firable: 1\ncell: c\nplaces: {w: {task: {name: work, robot: r, shelf: s}},\n"
        "  r: {opens: {to: x.r, machine: R}}, s: {opens: {to: x.s, machine: S}}}\nstart: [r, s]\ncontrollers: {x: }\n"
        "transitions: {t: {from: [r, s], to: w}, u: {from: w, to: [r, s]}}\n"
    )
    tasks = parse_tasks(f"firable_tasks: 1\ntasks:\n  work:\n{UNSOUND['ends']}", "own.tasks.yaml")
    with pytest.raises(InputError) as refused:
        refine(net, tasks)
    (problem,) = refused.value.diagnostics
    assert problem.code == "F4013"
    assert "after start, c the tokens are on work, robot.back, shelf.open" in problem.message
    assert str(problem.span) == "own.tasks.yaml:3:3"


def test_a_role_that_is_released_twice_is_a_contact() -> None:
    # Both branches release the shelf, and after the one the other is still there: the ledger forbids it in one move,
    # so the second token comes from a step that is entered from nowhere else.
    text = (
        TWO
        + """\
    start: {to: [robot.go, shelf.open, shelf.shut]}
    moves:
      a: {from: [robot.go, shelf.open], to: robot.hold, release: shelf}
      b: {from: [robot.hold, shelf.shut], to: robot.back, release: shelf}
"""
    )
    twice = task(text)
    assert any("gives 'shelf' to" in problem.message for problem in task_problems(twice, {}))
    assert statuses(twice)["contact-free"] is Status.VIOLATED


def test_an_endless_run_and_a_choice_inside_are_told_but_not_refused() -> None:
    proof = prove_block(task(SOUND + "      again_: {from: robot.hold, to: robot.go}\n"))
    assert proof.sound
    assert not proof.settles
    assert not proof.orderly
    told = {verdict.name: verdict for verdict in proof.verdicts}
    assert set(told["work.orderly"].subjects) == {"b", "again_"}


def test_gates_that_contradict_each_other_make_a_dead_move() -> None:
    text = SOUND.replace("{steps: {go: , hold: , back: }}", "{inputs: {near: }, steps: {go: , hold: , back: }}")
    text = text.replace("to: robot.hold}", "to: robot.hold, if: robot.near, unless: robot.near}")
    assert statuses(task(text))["complete"] is Status.VIOLATED


def test_a_budget_that_ends_proves_nothing() -> None:
    proof = prove_block(task(SOUND), Budget(2))
    assert not proof.sound
    assert {verdict.status for verdict in proof.verdicts} == {Status.UNKNOWN}


def test_the_end_may_not_be_reached_by_a_role_that_was_released() -> None:
    text = SOUND + "      c: {from: shelf.open, release: shelf}\n    end: {from: [robot.back, shelf.shut]}\n"
    assert any("'shelf' is lost" in problem.message for problem in task_problems(task(text), {}))


@examples(30)
@given(st.randoms(use_true_random=False))
def test_the_conditions_of_a_random_task_are_what_plain_search_says(draw: random.Random) -> None:
    of = random_task(draw, "work", spoil=0.5)
    proof = prove_block(of)
    net = closed(of)
    graph = Player(net).reachable()
    inside, lasts = net.marking(["work"]), net.marking(("work", *of.end.sources))
    steps = net.marking(of.steps)
    idle = net.marking(f"{role}.idle" for role in of.released)
    ready = {marking for marking in graph if marking & lasts == lasts}

    can_end = set(ready)
    while more := {m for m, edges in graph.items() if m not in can_end and any(after in can_end for _, after in edges)}:
        can_end |= more
    player = Player(net)
    expected = {
        "ends": all(marking in can_end for marking in graph if marking & inside),
        "ends-clean": all(m & steps == lasts & steps and m & idle == idle for m in ready),
        "contact-free": not any(player.in_contact(marking) for marking in graph),
        "complete": len({fired for edges in graph.values() for fired, _ in edges}) == len(net.transitions),
    }
    found = {verdict.name.partition(".")[2]: verdict.holds for verdict in proof.verdicts}
    assert {name: found[name] for name in expected} == expected
    assert proof.sound is all(expected.values())
