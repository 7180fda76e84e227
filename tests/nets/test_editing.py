"""Edits of a net file: what is asked for changes, and every other character stays."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.nets.catalogue import catalogue_names, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.editing import edits
from firable.nets.editing.net_file import NetFile
from firable.nets.net import Net, Place, Transition
from firable.nets.occurrences import Kind
from firable.nets.owning import with_owners
from firable.nets.printing import in_file_order
from firable.nets.source import Source
from firable.nets.text import parse_net

TEXTS = {name: catalogue_path(name).read_text("utf-8") for name in catalogue_names()}

BLOCKS = """\
# a cell
firable: 1
cell: demo            # its name

controllers:          # who does what
  robot:
    # where it begins
    start: free
    inputs: [touch]   # sensors
    places:
      free:           # {not: a brace}
      busy:   {send: {machine: R, command: MOVE}, until: at_home}  # moves
      # the end
  mc:

transitions:
  # there
  go:
    from:
      - robot.free    # from here
    to: robot.busy
  back: {from: robot.busy, to: robot.free, if: robot.touch}
# end of the file
"""
FLOW = """\
firable: 1
cell: demo
places: {p: , q: {description: a}}
start: p
transitions: {t: {from: p, to: [q]}, u: {}}
"""


def edited(text: str, edit: Callable[[Source], Source]) -> str:
    return edit(Source("cell.firable.yaml", text)).text


def without(text: str, *parts: str) -> str:
    for part in parts:
        assert part in text
        text = text.replace(part, "")
    return text


def changed(text: str, edit: Callable[[Source], Source]) -> tuple[list[str], list[str]]:
    """The lines that went, and those that came."""
    before, after = text.split("\n"), edited(text, edit).split("\n")
    told = list(difflib.ndiff(before, after))
    return [line[2:] for line in told if line[0] == "-"], [line[2:] for line in told if line[0] == "+"]


@pytest.mark.parametrize(
    ("edit", "went", "came"),
    [
        (lambda s: edits.add_place(s, "new", "robot"), [], ["      new:"]),
        (lambda s: edits.add_place(s, "new", "mc"), [], ["    places:", "      new:"]),
        (lambda s: edits.add_controller(s, "agv"), [], ["  agv:"]),
        (lambda s: edits.add_transition(s, "new"), [], ["  new: {}"]),
        (lambda s: edits.add_sensor(s, "shut", "mc"), [], ["    inputs: shut"]),
        (
            lambda s: edits.add_sensor(s, "shut", "robot"),
            ["    inputs: [touch]   # sensors"],
            ["    inputs: [touch, shut]   # sensors"],
        ),
        (lambda s: edits.connect(s, "go", "from", "robot.busy"), [], ["      - robot.busy"]),
        (lambda s: edits.connect(s, "go", "unless", "robot.touch"), [], ["    unless: robot.touch"]),
        (lambda s: edits.connect(s, "go", "to", "x"), ["    to: robot.busy"], ["    to: [robot.busy, x]"]),
        (lambda s: edits.disconnect(s, "go", "to", "robot.busy"), ["    to: robot.busy"], []),
        (
            lambda s: edits.disconnect(s, "go", "from", "robot.free"),
            ["    from:", "      - robot.free    # from here"],
            [],
        ),
        (lambda s: edits.mark(s, "robot.free", marked=False), ["    start: free"], []),
        (lambda s: edits.mark(s, "robot.busy", marked=True), ["    start: free"], ["    start: [free, busy]"]),
        (
            lambda s: edits.describe(s, Kind.PLACE, "robot.free", "at rest: here"),
            ["      free:           # {not: a brace}"],
            ['      free: {description: "at rest: here"}           # {not: a brace}'],
        ),
        (lambda s: edits.describe(s, Kind.CONTROLLER, "robot", "it moves"), [], ["    description: it moves"]),
        (
            lambda s: edits.own(s, Kind.PLACE, "robot.busy", "mc"),
            [
                "      busy:   {send: {machine: R, command: MOVE}, until: at_home}  # moves",
                "    to: robot.busy",
                "  back: {from: robot.busy, to: robot.free, if: robot.touch}",
            ],
            [
                "    places:",
                "      busy: {send: {machine: R, command: MOVE}, until: at_home}  # moves",
                "    to: mc.busy",
                "  back: {from: mc.busy, to: robot.free, if: robot.touch}",
            ],
        ),
        (
            lambda s: edits.rename(s, Kind.TRANSITION, "back", "home"),
            ["  back: {from: robot.busy, to: robot.free, if: robot.touch}"],
            ["  home: {from: robot.busy, to: robot.free, if: robot.touch}"],
        ),
        (
            lambda s: edits.delete(s, Kind.SIGNAL, "robot.touch"),
            [
                "    inputs: [touch]   # sensors",
                "  back: {from: robot.busy, to: robot.free, if: robot.touch}",
            ],
            ["  back: {from: robot.busy, to: robot.free}"],
        ),
        (
            lambda s: edits.delete(s, Kind.TRANSITION, "back"),
            ["  back: {from: robot.busy, to: robot.free, if: robot.touch}"],
            [],
        ),
    ],
)
def test_an_edit_changes_its_lines_and_no_others(
    edit: Callable[[Source], Source], went: list[str], came: list[str]
) -> None:
    assert changed(BLOCKS, edit) == (went, came)
    with_other_ends = edited(BLOCKS.replace("\n", "\r\n"), edit)
    assert with_other_ends == edited(BLOCKS, edit).replace("\n", "\r\n")


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (lambda s: edits.add_place(s, "r"), FLOW.replace("a}}", "a}, r: }")),
        (lambda s: edits.delete(s, Kind.PLACE, "p"), without(FLOW, "p: , ", "start: p\n", "from: p, ")),
        (lambda s: edits.delete(s, Kind.PLACE, "q"), without(FLOW, ", q: {description: a}", ", to: [q]")),
        (lambda s: edits.connect(s, "u", "to", "q"), FLOW.replace("u: {}", "u: {to: q}")),
        (lambda s: edits.connect(s, "t", "to", "p"), FLOW.replace("[q]", "[q, p]")),
        (lambda s: edits.connect(s, "t", "if", "q"), FLOW.replace("[q]", "[q], if: q")),
        (lambda s: edits.describe(s, Kind.PLACE, "q", ""), FLOW.replace("{description: a}", "{}")),
        (lambda s: edits.describe(s, Kind.PLACE, "p", "b"), FLOW.replace("p: ,", "p: {description: b} ,")),
        (lambda s: edits.describe(s, Kind.PLACE, "q", "on"), FLOW.replace(": a}", ': "on"}')),
    ],
)  # fmt: skip
def test_what_stands_on_one_line_stays_on_it(edit: Callable[[Source], Source], text: str) -> None:
    assert edited(FLOW, edit) == text


def sorted_net(net: Net) -> Net:
    """The net, whatever order its file declares it in."""
    net = in_file_order(net)
    transitions = [
        replace(
            t,
            inputs=tuple(sorted(t.inputs)),
            outputs=tuple(sorted(t.outputs)),
            permissive=tuple(sorted(t.permissive)),
            inhibitive=tuple(sorted(t.inhibitive)),
            external=tuple(sorted(t.external, key=str)),
        )
        for t in net.transitions
    ]
    return replace(
        net,
        places=tuple(sorted(net.places, key=lambda one: one.name)),
        signals=tuple(sorted(net.signals, key=lambda one: one.name)),
        transitions=tuple(sorted(transitions, key=lambda t: t.name)),
    )


def comments(text: str) -> list[str]:
    return re.findall(r"#c\d+", text)


def commented(data: st.DataObject, text: str) -> str:
    """The text with comments drawn between its lines and after them."""
    lines, drawn = [], Random(data.draw(st.integers(0, 2**32)))
    for i, line in enumerate(text.split("\n")):
        before, after = drawn.choice([(0, 0), (0, 0), (1, 0), (0, 1)])
        lines += ["    " * (i % 3) + f"#c{i}0"] if before else []
        lines.append(f"{line}  #c{i}1" if after else line)
    return "\n".join(lines)


@examples(10)
@given(data=st.data())
def test_edits_of_the_text_are_those_of_the_net_and_keep_its_comments(data: st.DataObject) -> None:
    text = commented(data, TEXTS[data.draw(st.sampled_from(["one_robot", "two_cells", "conceptual_two_robots"]))])
    net, kept = parse_net(text), comments(text)
    for _ in range(data.draw(st.integers(1, 3))):
        edit = data.draw(st.sampled_from([place_more, arc_more, arc_less, marked_otherwise, owned_otherwise]))
        text, net = edit(data, text, net)
        assert sorted_net(parse_net(text)) == sorted_net(net)
        assert sorted(comments(text)) == sorted(kept)


def place_more(data: st.DataObject, text: str, net: Net) -> tuple[str, Net]:
    owner = data.draw(st.sampled_from([controller.name for controller in net.controllers]))
    name = f"new{len(net.places)}"
    made = edited(text, lambda s: edits.add_place(s, name, owner))
    return made, replace(net, places=(*net.places, Place(f"{owner}.{name}", owner)))


def other_transition(net: Net, old: Transition, new: Transition) -> Net:
    return replace(net, transitions=tuple(new if one is old else one for one in net.transitions))


def arc_more(data: st.DataObject, text: str, net: Net) -> tuple[str, Net]:
    t = data.draw(st.sampled_from(net.transitions))
    part = data.draw(st.sampled_from(["if", "unless"]))
    used = {*t.inputs, *t.outputs, *t.permissive, *t.inhibitive}
    place = data.draw(st.sampled_from([one.name for one in net.places if one.name not in used]))
    made = edited(text, lambda s: edits.connect(s, t.name, part, place))
    gates = (*(t.permissive if part == "if" else t.inhibitive), place)
    new = replace(t, permissive=gates) if part == "if" else replace(t, inhibitive=gates)
    return made, other_transition(net, t, new)


def arc_less(data: st.DataObject, text: str, net: Net) -> tuple[str, Net]:
    t = data.draw(st.sampled_from(net.transitions))
    if not t.outputs or any(line.strip().startswith("#") or "#c" in line for line in text.split("\n") if "to:" in line):
        return text, net  # a line that goes takes its comment along
    place = data.draw(st.sampled_from(t.outputs))
    made = edited(text, lambda s: edits.disconnect(s, t.name, "to", place))
    return made, other_transition(net, t, replace(t, outputs=tuple(one for one in t.outputs if one != place)))


def marked_otherwise(data: st.DataObject, text: str, net: Net) -> tuple[str, Net]:
    place = data.draw(st.sampled_from([one for one in net.places if not one.marked]))
    made = edited(text, lambda s: edits.mark(s, place.name, marked=True))
    new = replace(place, marked=True)
    return made, replace(net, places=tuple(new if one is place else one for one in net.places))


def owned_otherwise(data: st.DataObject, text: str, net: Net) -> tuple[str, Net]:
    """A place without a completion to another controller, where its name is free there."""
    names = {place.name for place in net.places} | {signal.name for signal in net.signals}
    place = data.draw(st.sampled_from([p for p in net.places if p.completion is None and not p.marked]))
    owner = data.draw(st.sampled_from([one.name for one in net.controllers]))
    local = place.name.removeprefix(f"{place.owner}.")
    if f"{owner}.{local}" in names:
        return text, net
    ends_with_comment = any(line.strip().startswith(f"{local}:") and "#c" in line for line in text.split("\n"))
    in_a_line = "places: {" in text or re.search(rf"^ +{re.escape(owner)}: +\{{", text, re.MULTILINE) is not None
    if ends_with_comment and in_a_line:
        with pytest.raises(InputError, match="F1020"):  # it would have to go into a line
            edited(text, lambda s: edits.own(s, Kind.PLACE, place.name, owner))
        return text, net
    made = edited(text, lambda s: edits.own(s, Kind.PLACE, place.name, owner))
    owners = {place.name: place.owner or "" for place in net.places}
    owners |= {signal.name: signal.owner or "" for signal in net.signals}
    return made, with_owners(net, {**owners, place.name: owner}, net.controllers)


def test_a_place_takes_its_completion_and_its_time_limit_along() -> None:
    text = """firable: 1
cell: demo
controllers:
  robot:
    start: free
    places:
      free:
      busy: {send: {machine: R, command: MOVE}, until: at_home, within: 5s}
  mc:
    places: {idle: }
transitions:
  go: {from: robot.free, to: robot.busy}
  back: {from: robot.busy, to: robot.free, if: robot.at_home}
  again: {from: robot.busy_fault, to: robot.free, if: robot.busy_overdue}
  never: {from: mc.idle, unless: robot.at_home}
"""
    net = parse_net(edited(text, lambda s: edits.own(s, Kind.PLACE, "robot.busy", "mc")))
    assert {place.name for place in net.places} == {"robot.free", "mc.idle", "mc.busy", "mc.busy_fault"}
    assert [signal.name for signal in net.signals] == ["mc.at_home", "mc.busy_overdue"]
    assert net.transition("again").inputs == ("mc.busy_fault",)
    assert "mc.busy_timeout" in net.transition_index


def test_a_completion_that_others_wait_for_stays_with_them() -> None:
    text = TEXTS["one_robot"].replace("    if: mc.part_present\n", "    if: [mc.part_present, robot.touch]\n")
    net = parse_net(edited(text, lambda s: edits.own(s, Kind.PLACE, "robot.grasp_cv1", "conveyor")))
    assert net.place("conveyor.grasp_cv1").completion == "conveyor.touch"
    assert net.place("robot.grasp_mc").completion == "robot.touch"
    assert "robot.touch" in {gate.signal for gate in net.transition("G4").external}


CONCEPTUAL = """\
firable: 1
cell: demo
controllers:
  system:
    start: [cv1, robot]
    places:
      loading: {task: {name: load, robot: robot, source: cv1}}
      leaving: {task: {name: leave, robot: system.robot}}
      cv1:     {opens: {to: conveyor.cv1, machine: CV1}}
      robot:   {opens: {to: robot.free, machine: R}}
  robot:
  conveyor:
transitions: {}
"""


@pytest.mark.parametrize(
    ("place", "owner", "loading", "leaving"),
    [
        ("system.robot", "robot", ["robot.robot", "cv1"], ["robot.robot"]),
        ("system.cv1", None, ["robot", "cv1"], ["system.robot"]),
        ("system.loading", "robot", ["system.robot", "system.cv1"], ["system.robot"]),
    ],
)
def test_what_fills_the_role_of_a_task_is_the_same_place_after_it_was_moved(
    place: str, owner: str | None, loading: list[str], leaving: list[str]
) -> None:
    net = parse_net(edited(CONCEPTUAL, lambda s: edits.own(s, Kind.PLACE, place, owner)))
    told = {each.task.name: [role for _, role in each.task.arguments] for each in net.places if each.task}
    assert told == {"load": loading, "leave": leaving}


NAMESAKES = """\
firable: 1
cell: demo
controllers:
  one:
    places:
      own: {opens: {to: r.free, machine: R}}
  two:
    places:
      load: {task: {name: load, robot: all}}
      other: {opens: {to: s.free, machine: S}}
  three:
    places: {all: {opens: {to: t.free, machine: T}}}
places:
  all: {opens: {to: q.free, machine: Q}}
transitions: {}
"""


@pytest.mark.parametrize(
    "edit",
    [
        lambda s: edits.rename(s, Kind.PLACE, "two.other", "all"),
        lambda s: edits.own(s, Kind.PLACE, "two.load", "three"),
        lambda s: edits.own(s, Kind.PLACE, "three.all", "two"),
        lambda s: edits.rename(s, Kind.PLACE, "all", "other"),
    ],
)
def test_no_edit_lets_another_place_fill_the_role_of_a_task(edit: Callable[[Source], Source]) -> None:
    with pytest.raises(InputError, match="another place would fill the role that"):
        edited(NAMESAKES, edit)


def test_a_place_of_nobody_that_holds_a_token_goes_to_a_controller_with_it() -> None:
    text = FLOW.replace("places:", "controllers: {robot: }\nplaces:").replace("start: p", "start: [q, p]")
    net = parse_net(edited(text, lambda s: edits.own(s, Kind.PLACE, "p", "robot")))
    assert [(place.name, place.marked) for place in net.places] == [("robot.p", True), ("q", True)]
    assert net.transition("t").inputs == ("robot.p",)


LIMITED = """\
firable: 1
cell: demo
controllers:
  robot:
    start: free
    places:
      free:
      busy: {send: {machine: R, command: MOVE}, until: at_home, within: 5s}
      busy_fault: {description: late}
  mc:
transitions:
  go: {from: robot.free, to: robot.busy}
  back: {from: robot.busy, to: robot.free}
  again: {from: robot.busy_fault, to: robot.free}
"""


@pytest.mark.parametrize(("limit", "fault"), [("5s", "busy_fault"), ("{time: 5s, to: late}", "late")])
def test_no_edit_makes_a_time_limit_lead_to_another_place(limit: str, fault: str) -> None:
    text = LIMITED.replace("5s", limit).replace("busy_fault", fault)
    assert parse_net(text).transition("robot.busy_timeout").outputs == (f"robot.{fault}",)
    for edit in (
        lambda s: edits.own(s, Kind.PLACE, "robot.busy", "mc"),
        lambda s: edits.own(s, Kind.PLACE, f"robot.{fault}", "mc"),
        lambda s: edits.delete(s, Kind.PLACE, f"robot.{fault}"),
    ):
        with pytest.raises(InputError, match=f"the time limit of 'busy' leads to '{fault}'"):
            edited(text, edit)


@pytest.mark.parametrize(("place", "fault"), [("robot.busy", "mc.busy_fault"), ("mc.busy_fault", "robot.busy_fault")])
def test_no_edit_brings_a_place_where_a_time_limit_leads_to_another_of_its_name(place: str, fault: str) -> None:
    text = LIMITED.replace("      busy_fault: {description: late}\n", "").replace(
        "  mc:\n", "  mc:\n    places: {busy_fault: }\n"
    )
    assert len(parse_net(text).places) == 4
    with pytest.raises(InputError, match=f"there is a '{fault}' already"):
        edited(text, lambda s: edits.own(s, Kind.PLACE, place, fault.partition(".")[0]))


def test_an_arbiter_decides_on_the_fault_transition_of_a_place_that_has_moved() -> None:
    text = LIMITED.replace("      busy_fault: {description: late}\n", "").replace(
        "transitions:\n", "arbiters:\n  when: {among: [back, robot.busy_timeout], by: priority}\ntransitions:\n"
    )
    net = parse_net(edited(text, lambda s: edits.own(s, Kind.PLACE, "robot.busy", "mc")))
    assert net.arbiters[0].among == ("back", "mc.busy_timeout")


@pytest.mark.parametrize(
    ("edit", "code"),
    [
        (lambda s: edits.add_place(s, "free", "robot"), "F1006"),
        (lambda s: edits.add_place(s, "x", "nobody"), "F2005"),
        (lambda s: edits.add_place(s, "", "robot"), "F2012"),
        (lambda s: edits.rename(s, Kind.PLACE, "robot.free", "a b"), "F2012"),
        (lambda s: edits.rename(s, Kind.PLACE, "robot.free", "busy"), "F2001"),
        (lambda s: edits.disconnect(s, "back", "if", "robot.at_home"), "F1020"),
        (lambda s: edits.connect(s, "no_such", "to", "robot.free"), "F1020"),
        (lambda s: edits.connect(s, "go", "among", "robot.free"), "F1020"),
        (lambda s: edits.delete(s, Kind.SIGNAL, "robot.at_home"), "F1020"),
        (lambda s: edits.delete(s, Kind.PROPERTY, "p"), "F1020"),
        (lambda s: edits.mark(s, "robot.no_such", marked=True), "F1020"),
    ],
)
def test_what_cannot_be_edited_is_refused_with_a_code(edit: Callable[[Source], Source], code: str) -> None:
    with pytest.raises(InputError) as refused:
        edited(BLOCKS, edit)
    assert refused.value.diagnostics[0].code == code
    assert refused.value.diagnostics[0].hint


def test_a_form_that_would_be_edited_wrongly_is_refused() -> None:
    text = 'firable: 1\ncell: c\n? places\n: {p: }\n? "transitions"\n: t:\n    from: p\n  u: {}\n'
    assert parse_net(text).name == "c"
    with pytest.raises(InputError, match="F1020"):
        edited(text, lambda s: edits.delete(s, Kind.TRANSITION, "t"))


def test_a_file_is_written_only_while_it_is_what_was_read(tmp_path: Path) -> None:
    path = tmp_path / "cell.firable.yaml"
    path.write_bytes(b"\xef\xbb\xbffirable: 1\r\ncell: c\r\n")
    path.chmod(0o640)
    file = NetFile.read(path)
    after = file.written("firable: 1\ncell: d\n")
    assert path.read_bytes() == b"\xef\xbb\xbffirable: 1\r\ncell: d\r\n"
    assert path.stat().st_mode & 0o777 == 0o640
    assert after.is_current()
    assert after.source == NetFile.read(path).source
    with pytest.raises(InputError, match="F1019"):
        file.written("firable: 1\ncell: e\n")
    path.unlink()
    with pytest.raises(InputError, match="F1019"):
        after.written("firable: 1\ncell: e\n")
    assert not path.exists()


@pytest.mark.parametrize("body", ["{from: p}   # the only arc", "\n    from: p   # the only arc", "{from: p}"])
def test_a_transition_that_loses_its_last_arc_is_one_without_arcs(body: str) -> None:
    text = f"firable: 1\ncell: c\nplaces: {{p: }}\ntransitions:\n  t: {body}\n  u: {{}}\n"
    text = edited(text.replace(": \n", ":\n"), lambda s: edits.disconnect(s, "t", "from", "p"))
    assert "  t: {}" in text
    assert parse_net(text).transitions == (Transition("t"), Transition("u"))


def test_a_net_without_a_table_of_transitions_gets_one() -> None:
    text = edited("firable: 1\ncell: c\n", lambda s: edits.add_transition(s, "t"))
    assert parse_net(text).transitions == (Transition("t"),)
