"""From conceptual nets and registered tasks to detailed nets, held to the cells that were drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.published import COORDINATOR_TABLE

from firable.decompose import split, table_text
from firable.decompose.refinement.refining import proved_tasks, refine
from firable.nets import InputError, Net, catalogue_net, format_net, parse_net
from firable.nets.catalogue import catalogue_tasks
from firable.nets.net import ExternalGate, Place, TaskUse, Transition
from firable.nets.tasks.model import Catalogue
from firable.nets.tasks.text import parse_tasks

CELLS = (
    ("conceptual_one_robot", "one_robot"),
    ("conceptual_two_robots", "two_robots_separate"),
    ("conceptual_two_robots_shared", "two_robots_shared"),
)
TASKS = catalogue_tasks()


def arcs_in_order(net: Net) -> Net:
    """The net without its properties; arcs are sets, and may stand in any order."""
    transitions = [
        replace(t, inputs=tuple(sorted(t.inputs)), outputs=tuple(sorted(t.outputs))) for t in net.transitions
    ]
    return replace(net, transitions=tuple(transitions), properties=())


@pytest.mark.parametrize(("conceptual", "detailed"), CELLS)
def test_a_conceptual_cell_is_refined_to_exactly_the_detailed_one(conceptual: str, detailed: str) -> None:
    wanted = catalogue_net(detailed)
    found = refine(catalogue_net(conceptual), TASKS, wanted.name).net
    assert arcs_in_order(found) == arcs_in_order(wanted)
    assert [t.description for t in found.transitions] == [t.description for t in wanted.transitions]
    assert table_text(split(found).table) == table_text(split(wanted).table)
    assert parse_net(format_net(found)) == found


def test_the_published_coordinator_table_comes_out_of_the_conceptual_cell() -> None:
    assert table_text(split(refine(catalogue_net("conceptual_one_robot"), TASKS).net).table) == COORDINATOR_TABLE


def test_the_properties_of_the_conceptual_net_are_stated_of_the_detailed_one() -> None:
    net = catalogue_net("conceptual_one_robot")
    stated = parse_net(
        format_net(net)
        + '  free: {always_possible: "system.cv1 and system.robot"}\n'
        + "  starts: {reachable: firable(t2)}\n"
        + '  ctl: {ctl: "AG EF system.mc"}\n'
        + "  counted: {always: 'tokens(system.mc, system.loading) <= 1'}\n"
    )
    refinement = refine(stated, TASKS)
    text = format_net(refinement.net)
    for line in (
        "free: {always_possible: conveyor.cv1 and robot.free}",
        "starts: {reachable: firable(G2)}",
        "ctl: {ctl: AG EF mc.free}",
        "counted: {always: ",
        "restart: {always_possible: start}",
    ):
        assert f"  {line}" in text
    assert "(mc.free, system.loading)" in text
    untold = [note.message for note in refinement.notes]
    # cv1 and mc are idle later than the conceptual net says; firable and CTL look between the moves.
    assert len(untold) == 4
    assert all(name in " ".join(untold) for name in ("'free'", "'starts'", "'ctl'", "'counted'"))


def test_a_machine_that_is_seized_late_is_refused_at_the_transition_that_should_take_it() -> None:
    with pytest.raises(InputError) as refused:
        refine(catalogue_net("conceptual_one_robot_mc_late"), TASKS)
    found = [(d.code, d.subject) for d in refused.value.diagnostics]
    assert found == [("F4012", ("transitions", "t2")), ("F4012", ("transitions", "t3"))]


NET = """\
firable: 1
cell: c
controllers:
  system:
    coordinator: true
    start: [src, a, b]
    places:
      src:
      work:  {task: {name: pick, robot: a, shelf: b}}
      done:
      a:     {opens: {to: arm.free, machine: A}}
      b:     {opens: {to: store.free, machine: B, side: left}}
  arm:
  store:
transitions:
  t1: {from: [system.src, system.a, system.b], to: system.work}
  t2: {from: system.work, to: [system.done, system.a, system.b]}
  t3: {from: system.done, to: system.src}
"""
PICK = """\
firable_tasks: 1
tasks:
  pick:
    roles:
      robot:
        steps:
          go:
          take: {send: {machine: "{robot.machine}", command: TAKE, side: "{shelf.side}"}, until: taken}
      shelf: {inputs: {full: }, steps: {open: }}
    moves: {a: {from: robot.go, to: robot.take, if: shelf.open}}
    end: {unless: shelf.full}
"""


def small(net: str = NET, tasks: str = PICK) -> Net:
    return refine(parse_net(net), parse_tasks(tasks)).net


def refusal(net: str = NET, tasks: str = PICK) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as refused:
        small(net, tasks)
    assert all(d.hint for d in refused.value.diagnostics)
    return [(d.code, d.message) for d in refused.value.diagnostics]


def test_a_small_net_is_opened_with_its_gates_and_parameters() -> None:
    net = small()
    assert net.place("arm.take").completion == "arm.taken"
    assert str(net.place("arm.take").command) == "A TAKE side=left"
    # The move's gate makes the shelf's controller take part: it is a row of the table, with the next number.
    assert [(t.name, t.number) for t in net.transitions] == [("G1", 1), ("G2", 2), ("G3", 3), ("t3", None)]
    assert net.transition("G2").permissive == ("store.open",)
    assert net.transition("G3").external == (ExternalGate("arm.taken"), ExternalGate("store.full", wanted=False))
    assert net.transition("G3").inputs == ("system.work", "arm.take", "store.open")


def test_one_resource_that_does_a_task_for_two_places_gets_names_for_each() -> None:
    again = "      more:  {task: {name: pick, robot: a, shelf: b}}\n"
    text = NET.replace("      done:\n", "      done:\n" + again) + "".join(
        (
            "  t4: {from: [system.done, system.a, system.b], to: system.more}\n",
            "  t5: {from: system.more, to: [system.src, system.a, system.b]}\n",
        )
    )
    net = small(text, PICK.replace(", if: shelf.open", ""))
    names = [place.name for place in net.places if place.owner == "arm"]
    assert names == ["arm.free", "arm.go_work", "arm.take_work", "arm.go_more", "arm.take_more"]
    assert {t.name for t in net.transitions} >= {"t1-a-work", "t1-a-more"}
    # Both places are renamed, whichever comes first.
    assert {place.name for place in net.places if place.owner == "store"} == {
        "store.free",
        "store.open_work",
        "store.open_more",
    }


def test_a_move_keeps_its_inhibitive_gate_and_its_sensors() -> None:
    tasks = PICK.replace("if: shelf.open}", "unless: [shelf.open, shelf.full]}")
    with pytest.raises(InputError, match="from every marking inside"):
        small(tasks=tasks)  # the shelf is open until the end
    tasks = tasks.replace("steps: {open: }", "steps: {open: , shut: }").replace(
        "moves: {", "moves: {s: {from: shelf.open, to: shelf.shut}, "
    )
    move = small(tasks=tasks).transition("G2")
    assert move.inhibitive == ("store.open",)
    assert ExternalGate("store.full", wanted=False) in move.external


def test_what_the_conceptual_net_says_of_its_other_places_and_signals_stays() -> None:
    text = NET.replace("      done:\n", "      done:  {send: {machine: L, command: LIGHT}, until: lit}\n")
    text = text.replace("    places:\n", "    inputs: key\n    places:\n").replace("t3: {", "t3: {unless: system.key, ")
    net = small(text)
    assert str(net.place("system.done").command) == "L LIGHT"
    assert net.transition("t3").external == (ExternalGate("system.lit"), ExternalGate("system.key", wanted=False))
    assert [str(signal.kind) for signal in net.signals if signal.owner == "system"] == ["sensor", "completion"]
    assert parse_net(format_net(net)) == net


def test_places_without_an_owner_can_be_refined_too() -> None:
    text = (
        "firable: 1\ncell: c\ncontrollers: {x: }\nstart: [a, b]\n"
        "places: {w: {task: {name: pick, robot: a, shelf: b}}, a: {opens: {to: x.a, machine: A}},\n"
        "  b: {opens: {to: x.b, machine: B, side: up}}}\n"
        "transitions: {t: {from: [a, b], to: w}, u: {from: w, to: [a, b]}}\n"
    )
    net = small(text)
    assert [place.name for place in net.places] == ["x.a", "x.go", "x.take", "x.b", "x.open", "w"]
    assert [t.name for t in net.transitions] == ["G1", "G2", "t1-a"]


LENT = PICK.replace("to: robot.take, if: shelf.open}", "to: robot.take, release: shelf}").replace(
    "{from: robot.go,", "{from: [robot.go, shelf.open],"
)


def test_a_resource_that_is_idle_before_and_released_inside_is_borrowed() -> None:
    text = NET.replace("{from: [system.src, system.a, system.b],", "{from: [system.src, system.a], if: system.b,")
    text = text.replace("[system.done, system.a, system.b]", "[system.done, system.a]")
    refinement = refine(parse_net(text), parse_tasks(LENT))
    net = refinement.net
    assert refinement.correspondence.borrowed == {"system.b"}
    assert net.transition("G1").inputs == ("system.src", "arm.free", "store.free")
    assert net.transition("G1").permissive == ()
    assert net.transition("G2").outputs == ("arm.take", "store.free")
    assert net.transition("G3").inputs == ("system.work", "arm.take")


def test_a_resource_that_is_neither_handed_over_nor_borrowed_is_told_how() -> None:
    with pytest.raises(InputError) as refused:
        small(NET.replace("[system.src, system.a, system.b]", "[system.src, system.a]"), LENT)
    assert any("borrow it: `if: system.b`" in d.hint for d in refused.value.diagnostics)


def test_a_resource_that_the_start_itself_releases_stays_idle() -> None:
    tasks = (
        PICK.replace("if: shelf.open", "")
        .replace(", steps: {open: }", "")
        .replace("    end:", "    start: {release: shelf}\n    end:")
    )
    text = NET.replace("{from: [system.src, system.a, system.b],", "{from: [system.src, system.a], if: system.b,")
    text = text.replace("[system.done, system.a, system.b]", "[system.done, system.a]")
    with pytest.raises(InputError, match="never makes it free"):
        small(text.replace(", if: system.b", ""), tasks)
    assert small(text, tasks).transition("G1").permissive == ("store.free",)


MISTAKES = (
    ("an unknown task", "name: pick", "name: pik", "F4010", "'pik' of 'system.work' is not registered"),
    ("an unknown role", "robot: a,", "rob: a,", "F4011", "'rob' of 'system.work' is neither a role nor"),
    ("a role not filled", "robot: a, ", "", "F4011", "the role 'robot' of the task 'pick' of 'system.work'"),
    ("no resource", "robot: a,", "robot: src,", "F4011", "opens to no resource"),
    ("one resource twice", "shelf: b}", "shelf: a}", "F4011", "'a' is in two roles"),
    ("a word not said", ", side: left", "", "F4011", "asks for 'side' of 'b', which says none"),
    (
        "never taken",
        "[system.src, system.a, system.b]",
        "[system.src, system.a]",
        "F4012",
        "needs 'system.b' from its start",
    ),
    ("lost", "[system.done, system.a, system.b]", "[system.done, system.a]", "F4012", "'system.b' is lost"),
    (
        "taken and freed",
        "system.a, system.b], to: system.work",
        "system.b], to: [system.work, system.a]",
        "F4012",
        "makes 'system.a' free, which",
    ),
    (
        "taken twice",
        "{from: system.work, to: [system.done, system.a,",
        "{from: [system.work, system.a], to: [system.done,",
        "F4012",
        "takes 'system.a' twice",
    ),
    ("no controller", "store.free", "stor.free", "F2005", "there is no controller 'stor'"),
    ("marked in M0", "start: [src,", "start: [work, src,", "F4014", "holds a token in M0"),
    ("never started", "to: system.work}", "to: []}", "F4014", "no transition starts the task"),
    ("two of one name", "arm.free", "system.done", "F4014", "two places would be 'system.done'"),
)


@pytest.mark.parametrize(
    ("old", "new", "code", "words"), [row[1:] for row in MISTAKES], ids=[row[0] for row in MISTAKES]
)
def test_a_net_that_fits_its_tasks_wrongly_is_refused(old: str, new: str, code: str, words: str) -> None:
    assert old in NET
    found = refusal(NET.replace(old, new, 1))
    assert any(one == code and words in message for one, message in found), found


TASK_MISTAKES = (
    ("a role that goes nowhere", "to: robot.take,", "", "F4012", "ends 'robot.go', and 'robot' is lost"),
    (
        "a role out of nothing",
        "to: robot.take,",
        "to: [robot.take, shelf.open],",
        "F4012",
        "needs 'shelf' from its start",
    ),
    ("freed by nobody", "if: shelf.open", "release: shelf", "F4012", "frees 'shelf', which nobody holds"),
    (
        "one name for two steps",
        "take: {send",
        "take: {place: go, send",
        "F4014",
        "two places would be 'arm.go",
    ),
    ("one signal, two wishes", "end: {unless", "start: {if: shelf.full}\n    end: {unless", None, ""),
)


@pytest.mark.parametrize(
    ("old", "new", "code", "words"), [row[1:] for row in TASK_MISTAKES], ids=[row[0] for row in TASK_MISTAKES]
)
def test_a_task_whose_resources_do_not_add_up_is_refused(old: str, new: str, code: str | None, words: str) -> None:
    assert old in PICK
    tasks = PICK.replace(old, new, 1)
    if code is None:  # the start wants the signal, the end does not: they are different transitions
        assert small(tasks=tasks)
        return
    found = refusal(tasks=tasks)
    assert any(one == code and words in message for one, message in found), found


def test_two_tasks_that_keep_one_resource_may_not_end_together() -> None:
    text = NET.replace("      done:\n", "      done:\n      more:  {task: {name: pick, robot: a, shelf: b}}\n")
    text = text.replace("t2: {from: system.work,", "t2: {from: [system.work, system.more],").replace(
        "t3:", "t4: {from: [system.src, system.a, system.b], to: system.more}\n  t3:"
    )
    words = "'t2' takes 'system.a' twice, from 'system.work' and 'system.more'"
    assert ("F4012", words) in refusal(text)  # both tasks never run at once, so no run leads there


def test_what_is_wrong_with_a_task_is_said_with_its_line() -> None:
    tasks = parse_tasks(PICK.replace("to: robot.take,", ""), "own.tasks.yaml")
    with pytest.raises(InputError) as refused:
        refine(parse_net(NET), tasks)
    assert str(refused.value.diagnostics[0].span) == "own.tasks.yaml:10:13"


def test_two_tasks_that_meet_in_one_transition_and_want_one_signal_otherwise_are_refused() -> None:
    text = NET.replace("      done:\n", "      done:  {task: {name: put, robot: a, shelf: b}}\n")
    text = text.replace("[system.done, system.a, system.b]", "system.done")
    text = text.replace(
        "{from: system.done, to: system.src}", "{from: system.done, to: [system.src, system.a, system.b]}"
    )
    tasks = PICK + PICK.partition("tasks:\n")[2].replace("pick:", "put:").replace("end: {unless", "start: {if")
    found = refusal(text, tasks)
    assert found[0][0] == "F4014"
    assert "would want the signal 'store.full' both 1 and 0" in found[0][1]


def test_a_gate_that_would_see_a_resource_released_inside_is_refused() -> None:
    net = catalogue_net("conceptual_one_robot")
    for gate in ("system.cv1", "system.mc"):
        t6 = replace(net.transition("t6"), inhibitive=(gate,))
        gated = replace(net, transitions=(*net.transitions[:5], t6))
        with pytest.raises(InputError) as refused:
            refine(gated, TASKS)
        assert [(d.code, d.subject) for d in refused.value.diagnostics] == [
            ("F4014", ("transitions", "t6", "unless", gate))
        ]
    # Of a resource that every task keeps to its end, the detailed net says what the conceptual one says.
    t6 = replace(net.transition("t6"), inhibitive=("system.robot",))
    assert refine(replace(net, transitions=(*net.transitions[:5], t6)), TASKS)


def test_a_transition_that_takes_and_frees_a_resource_is_refused_however_the_net_was_made() -> None:
    net = parse_net(NET)
    looped = replace(net, transitions=(Transition("t0", ("system.a",), ("system.a",)), *net.transitions))
    with pytest.raises(InputError, match="both takes and frees"):
        refine(looped, parse_tasks(PICK))
    looped = replace(net, transitions=(Transition("t0", ("system.work",), ("system.work",)), *net.transitions))
    with pytest.raises(InputError, match="both ends and starts the task"):
        refine(looped, parse_tasks(PICK))


def test_an_arbiter_whose_conflict_is_gone_is_left_out_and_named() -> None:
    net = catalogue_net("conceptual_one_robot")
    text = format_net(net) + "\narbiters:\n  free: {among: [t2, t4]}\n  lost: {among: [t3, t5]}\n"
    refinement = refine(parse_net(text), TASKS)
    assert [arbiter.among for arbiter in refinement.net.arbiters] == [("G2", "G6"), ("G5", "G8")]
    text = format_net(net).replace("transitions:\n", "transitions:\n  t7: {to: system.cv1, if: system.mc}\n")
    refinement = refine(parse_net(text + "\narbiters:\n  cv1: {among: [t2, t7]}\n"), TASKS)
    assert refinement.net.arbiters == ()
    assert "the arbiter 'cv1' is left out" in refinement.notes[0].message


def test_a_net_without_tasks_is_refused() -> None:
    with pytest.raises(InputError, match="F4010"):
        refine(catalogue_net("one_robot"), TASKS)


def test_a_task_is_proved_once_however_many_places_name_it() -> None:
    net = parse_net(NET)
    more = replace(
        net,
        places=(*net.places, Place("system.more", "system", task=TaskUse("pick", (("robot", "a"), ("shelf", "b"))))),
    )
    tasks: Catalogue = parse_tasks(PICK)
    assert [block.task.name for block in proved_tasks(more, tasks)] == ["pick"]


def test_a_time_limit_of_the_conceptual_net_is_one_of_the_detailed_net() -> None:
    text = format_net(replace(catalogue_net("conceptual_one_robot"), properties=()))
    horn = "\n  horn:\n    start: off_\n    places:\n      off_:\n"
    horn += "      sounds: {send: {machine: H, command: SOUND}, until: heard, within: 2s}\n\ntransitions:\n"
    horn += "  h1: {from: horn.off_, to: horn.sounds}\n  h2: {from: horn.sounds, to: horn.off_}\n"
    horn += "  h3: {from: horn.sounds_fault, to: horn.off_}"
    net = parse_net(text.replace("\n\ntransitions:", f"{horn}", 1))
    found = refine(net, TASKS).net
    assert found.place("horn.sounds").within == net.place("horn.sounds").within
    assert found.transition("horn.sounds_timeout") == net.transition("horn.sounds_timeout")
    assert found.transition("h2").external == net.transition("h2").external
    assert parse_net(format_net(found)) == found
