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
from firable.decompose.refinement.traces import readable, with_run_of_task
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
    assert "after 'start, c' the tokens are on 'work, robot.back, shelf.open'" in problem.message
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


def test_a_dead_move_is_shown_where_it_has_its_tokens_and_what_holds_it_back() -> None:
    for change, why in (
        ("      c: {from: robot.hold, to: robot.back, unless: shelf.open}\n", "'shelf.open' holds a token"),
        ("      c: {from: robot.hold, to: robot.back, if: robot.go}\n", "'robot.go' holds no token"),
    ):
        (verdict,) = [v for v in prove_block(task(SOUND + change)).verdicts if v.name == "work.complete"]
        assert verdict.witness is not None
        assert verdict.witness.firings == (("start",), ("a",))
        assert verdict.witness.note == f"here 'c' has all that it comes from, but {why}"
    # Nothing ever leads to the step that it comes from, so there is no run to show.
    never = task(SOUND.replace("hold: , ", "hold: , lost: , ") + "      c: {from: robot.lost, to: robot.back}\n")
    (verdict,) = [v for v in prove_block(never).verdicts if v.name == "work.complete"]
    assert (verdict.subjects, verdict.witness) == (("c",), None)


def test_moves_that_are_dead_are_named_and_not_what_closes_the_task() -> None:
    proof = prove_block(task(SOUND.replace("to: robot.hold}", "to: robot.hold, if: robot.back}")))
    (verdict,) = [v for v in proof.verdicts if v.name == "work.complete"]
    assert verdict.subjects == ("a", "b", "end")


def test_a_role_that_is_released_a_second_time_is_refused_with_the_run_to_there() -> None:
    text = SOUND.replace(
        "a: {from: robot.go, to: robot.hold}", "a: {from: [robot.go, shelf.open], to: robot.hold, release: shelf}"
    )
    of = task(
        text.replace(
            "b: {from: [robot.hold, shelf.open], to: [robot.back, shelf.shut]}",
            "b: {from: robot.hold, to: robot.back, release: shelf}",
        )
    )
    (problem,) = with_run_of_task(task_problems(of, {}), of)
    assert problem.code == "F4012"
    assert problem.message == (
        "'b' of the task 'work' frees 'shelf', which nobody holds there; "
        "after 'start, a' the tokens are on 'work, robot.hold, shelf.idle'"
    )


def test_where_no_run_leads_to_a_refused_move_none_is_told() -> None:
    of = task(
        SOUND.replace("hold: , ", "hold: , lost: , ")
        + "      c: {from: robot.lost, to: robot.back, release: shelf}\n    end: {from: robot.back}\n"
    )
    plain = [problem.message for problem in task_problems(of, {})]
    told = [problem.message for problem in with_run_of_task(task_problems(of, {}), of)]
    assert any("'c' of" in message for message in plain)
    assert [message for message in told if "'c' of" in message] == [message for message in plain if "'c' of" in message]


@examples(30)
@given(st.randoms(use_true_random=False))
def test_the_run_told_with_a_refusal_leads_to_where_its_move_has_what_it_takes(draw: random.Random) -> None:
    of = random_task(draw, "work", spoil=1.0)
    net, player = closed(of), Player(closed(of))
    for problem in with_run_of_task(task_problems(of, {}), of):
        _, after, run = problem.message.partition("; after '")
        fired, _, tokens = run.removesuffix("'").partition("' the tokens are on '")
        marking = net.initial_marking
        for name in fired.split(", ") if after else ():
            marking = player.fire(marking, (net.transition_index[name],))
        if after:
            assert tokens.split(", ") == list(net.names(marking))
            assert {*net.transition(problem.subject[2]).inputs} <= {*tokens.split(", ")}


def test_the_texts_of_a_task_are_told_with_the_names_of_its_roles() -> None:
    text = SOUND.replace(
        "a: {from: robot.go,",
        "a: {description: '{robot} to {shelf.machine}, {shelf.side} of {program}', from: robot.go,",
    )
    text = text.replace("go: ,", "go: {send: {machine: '{robot.machine}', command: MOVE, to: '{shelf.side}'}},")
    of = task("    parameters: {program: }\n" + text)
    net = readable(closed(of))
    assert net.transition("a").description == "robot to shelf, shelf's side of program"
    assert str(net.place("robot.go").command) == "robot MOVE to=shelf's side"


@pytest.mark.parametrize("name", sorted(catalogue_tasks()))
def test_no_brace_is_left_in_the_texts_of_a_task_that_a_reader_sees(name: str) -> None:
    of = catalogue_tasks()[name]
    net = readable(closed(of))
    told = [*(t.description for t in net.transitions), *(f"{p.description} {p.command}" for p in net.places)]
    assert "{" not in " ".join(told)
    assert [(t.name, t.inputs, t.outputs) for t in net.transitions] == [
        (t.name, t.inputs, t.outputs) for t in closed(of).transitions
    ]


def test_gates_that_contradict_each_other_make_a_dead_move() -> None:
    text = SOUND.replace("{steps: {go: , hold: , back: }}", "{inputs: {near: }, steps: {go: , hold: , back: }}")
    text = text.replace("to: robot.hold}", "to: robot.hold, if: robot.near, unless: robot.near}")
    (verdict,) = [v for v in prove_block(task(text)).verdicts if v.name == "work.complete"]
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert "'a' has all that it comes from, but its gates want one signal both 1 and 0" in verdict.witness.note


@pytest.mark.parametrize("budget", [Budget(2), Budget(memory_bytes=1)])
def test_a_budget_that_ends_proves_nothing(budget: Budget) -> None:
    proof = prove_block(task(SOUND), budget)
    assert not proof.sound
    assert {(verdict.status, verdict.code) for verdict in proof.verdicts} == {(Status.UNKNOWN, "F3004")}


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
