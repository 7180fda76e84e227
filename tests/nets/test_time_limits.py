"""Time limits: what `within` gives, under which names, what is refused, and that nothing of it competes."""

import random
from dataclasses import replace

import pytest
from support.timed_nets import with_limits

from firable.executor.simulation.drawn import drawn_timed_net
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.interchange import net_from_json, net_to_json
from firable.nets.net import ExternalGate, Net, SignalKind, TimeLimit, Transition
from firable.nets.owning import with_owners
from firable.nets.pnml_writer import write_pnml
from firable.nets.printing import format_net
from firable.nets.text import parse_net
from firable.nets.time_limits import MILLISECONDS_MAX, format_time, parse_time
from firable.semantics.conflict import conflicts, jointly_openable

CELL = """\
firable: 1
cell: c
controllers:
  robot:
    start: free
    inputs: reset
    places:
      free:
      go: {send: {machine: R, command: MOVE, to: CV1}, until: there, within: 5s}
      stuck: {send: {machine: R, command: STOP}}
transitions:
  start: {from: robot.free, to: robot.go}
  end: {from: robot.go, to: robot.free}
  again: {from: robot.go_fault, to: robot.go, if: robot.reset}
"""


def cell(within: str) -> Net:
    """The cell with another time limit."""
    text = CELL.replace("within: 5s", f"within: {within}")
    return parse_net(text if "to: stuck" not in within else text.replace("robot.go_fault", "robot.stuck"))


def refused(text: str) -> list[tuple[str, str]]:
    """The code of each problem, and the text it points to."""
    with pytest.raises(InputError) as caught:
        parse_net(text)
    return [
        (problem.code, text.splitlines()[at.line - 1][at.column - 1 :][: at.length])
        for problem in caught.value.diagnostics
        if (at := problem.span)
    ]


def test_a_time_limit_gives_a_timer_a_fault_place_and_a_fault_transition() -> None:
    net = parse_net(CELL)
    assert net.place("robot.go").within == TimeLimit(5000, "robot.go_overdue")
    assert net.signal("robot.go_overdue").kind is SignalKind.TIMER
    assert net.signal("robot.go_overdue").owner == net.place("robot.go_fault").owner == "robot"
    fault = net.transition("robot.go_timeout")
    assert (fault.inputs, fault.outputs) == (("robot.go",), ("robot.go_fault",))
    assert fault.external == (ExternalGate("robot.go_overdue"), ExternalGate("robot.there", wanted=False))
    assert net.fault_transitions == {net.place_index["robot.go"]: net.transition_index["robot.go_timeout"]}
    assert ExternalGate("robot.there") in net.transition("end").external


def test_the_names_that_a_time_limit_gives_can_be_others() -> None:
    net = cell("{time: 1.5 s, to: stuck, transition: late, timer: slow}")
    assert net.place("robot.go").within == TimeLimit(1500, "robot.slow")
    assert net.transition("late").outputs == ("robot.stuck",)
    assert "robot.go_fault" not in net.place_index
    assert parse_net(format_net(net)) == net
    assert "within: {time: 1500ms, to: stuck, transition: late, timer: slow}" in format_net(net)


def test_a_fault_place_that_is_declared_may_send_a_command() -> None:
    net = parse_net(CELL.replace("stuck:", "go_fault:"))
    assert str(net.place("robot.go_fault").command) == "R STOP"
    assert [place.name for place in net.places].count("robot.go_fault") == 1
    assert parse_net(format_net(net)) == net


def test_a_fault_place_that_nobody_declared_is_not_printed() -> None:
    assert format_net(parse_net(CELL)) == format_net(parse_net(format_net(parse_net(CELL))))
    assert "go_fault:" not in format_net(parse_net(CELL))
    assert "within: 5s" in format_net(parse_net(CELL))


@pytest.mark.parametrize(
    ("within", "found"),
    [
        *((text, [("F2029", text)]) for text in ("5", "0s", "-5s", "5d", "1e3s", "0.5ms", "1441min", "s", "05s")),
        ("{time: 5 minutes}", [("F2029", "5 minutes")]),
        ("{time: 5s, to: stukc}", [("F2002", "stukc"), ("F2002", "robot.go_fault")]),
        ("{time: 5s, to: go}", [("F2009", "go"), ("F2002", "robot.go_fault")]),
        ("{time: 5s, timer: reset}", [("F2001", "reset")]),
        ("{time: 5s, transition: end}", [("F2001", "end")]),
        ("{tim: 5s}", [("F1008", "tim")]),
        ("[5s]", [("F1010", "[")]),
    ],
)  # fmt: skip
def test_a_time_limit_that_is_none_is_refused_where_it_stands(within: str, found: list[tuple[str, str]]) -> None:
    assert refused(CELL.replace("within: 5s", f"within: {within}")) == found


def test_a_time_limit_without_a_completion_is_refused() -> None:
    assert refused(CELL.replace("until: there, ", "")) == [("F2028", "5s")]


def test_a_name_that_a_time_limit_gives_is_taken_where_the_limit_stands() -> None:
    assert refused(CELL.replace("inputs: reset", "inputs: [reset, go_overdue]")) == [("F2001", "5s")]
    assert refused(CELL.replace("  end:", "  robot.go_timeout:")) == [("F2001", "5s")]


def test_one_timer_of_two_places_is_refused_where_the_second_names_it() -> None:
    more = "      more: {send: {machine: R, command: MORE}, until: done, within: {time: 1s, timer: go_overdue}}\n"
    assert refused(CELL.replace("transitions:\n", f"{more}transitions:\n")) == [("F2001", "go_overdue")]


def test_a_program_cannot_make_a_place_with_half_a_time_limit() -> None:
    net = parse_net(CELL)
    go, others = net.place("robot.go"), [place for place in net.places if place.name != "robot.go"]
    with pytest.raises(ValueError, match="without the gate"):
        replace(net, places=(*others, replace(go, within=None)))
    with pytest.raises(ValueError, match="is no timer"):
        replace(net, signals=tuple(replace(s, kind=SignalKind.COMPLETION) for s in net.signals))
    with pytest.raises(InputError) as caught:
        replace(net, places=(*others, replace(go, within=TimeLimit(MILLISECONDS_MAX + 1, "robot.go_overdue"))))
    assert [problem.code for problem in caught.value.diagnostics] == ["F2029"]
    with pytest.raises(ValueError, match="times both"):
        replace(net, places=(*net.places, replace(go, name="robot.more")))
    with pytest.raises(ValueError, match="more than one fault transition"):
        replace(net, transitions=(*net.transitions, replace(net.transition("robot.go_timeout"), name="more")))
    with pytest.raises(ValueError, match="that of no place"):
        replace(net, signals=(*net.signals, replace(net.signal("robot.go_overdue"), name="robot.other")))


def test_half_a_time_limit_in_json_is_refused() -> None:
    data = net_to_json(parse_net(CELL))
    assert net_from_json(data) == parse_net(CELL)
    data["places"][1]["within"]["timer"] = "robot.there"
    with pytest.raises(InputError) as caught:
        net_from_json(data)
    assert [problem.code for problem in caught.value.diagnostics] == ["F1015"]


@pytest.mark.parametrize(
    ("text", "milliseconds"),
    [("1ms", 1), ("1440min", MILLISECONDS_MAX), ("0.001s", 1), ("90 s", 90_000), ("8h", 28_800_000)],
)
def test_a_time_is_read_as_milliseconds(text: str, milliseconds: int) -> None:
    assert parse_time(text) == milliseconds
    assert parse_time(format_time(milliseconds)) == milliseconds


def test_pnml_says_that_it_loses_the_time_limits() -> None:
    assert [note.hint for note in write_pnml(parse_net(CELL))[1] if "time limit" in note.message] == [
        "in the file a fault transition may fire at any time"
    ]


def test_a_timer_is_owned_with_its_place() -> None:
    lines = CELL.replace("controllers:\n  robot:\n", "").replace("robot.", "").splitlines()
    bare = parse_net("\n".join(line.removeprefix("    ") for line in lines))
    assert bare.place("go").within == TimeLimit(5000, "go_overdue")
    owners = dict.fromkeys([*bare.place_index, *bare.signal_index], "robot")
    owned = with_owners(bare, owners, parse_net(CELL).controllers)
    assert owned.place("robot.go").within == TimeLimit(5000, "robot.go_overdue")


@pytest.mark.parametrize("seed", range(40))
def test_a_fault_transition_is_never_open_beside_another_taker_of_its_place(seed: int) -> None:
    net = drawn_timed_net(random.Random(seed), "timed")
    for p, fault in net.fault_transitions.items():
        assert net.competitors[p] == tuple(t for t in net.consumers[p] if t != fault)
        assert not any(jointly_openable(net, (fault, t)) for t in net.competitors[p])


def test_a_fault_transition_does_not_stand_in_the_conflict_component_of_its_place() -> None:
    net = catalogue_net("one_robot_timed")
    relation, timeout = conflicts(net), net.transition_index["robot.back_timeout"]
    assert relation.component_of[timeout] == -1
    assert net.transition_index["G5"] in relation.rivals[timeout]
    assert not relation.free([timeout, net.transition_index["G5"]])


def test_fault_transitions_to_one_fault_place_compete_for_it() -> None:
    net = with_limits(catalogue_net("one_robot"), ["robot.to_cv1", "robot.to_cv2"])
    shared = tuple(
        Transition(t.name, t.inputs, ("robot.to_cv1_fault",), external=t.external)
        if t.name == "robot.to_cv2_timeout"
        else t
        for t in net.transitions
    )
    relation = conflicts(replace(net, transitions=shared))
    members = {net.transition_index[name] for name in ("robot.to_cv1_timeout", "robot.to_cv2_timeout")}
    assert members in map(set, relation.components)
