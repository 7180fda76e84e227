"""Names in a net file: every place of each, and a rename that changes all of them and nothing else."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.nets.catalogue import catalogue_names, catalogue_path
from firable.nets.diagnostics import InputError
from firable.nets.interchange import net_to_json
from firable.nets.occurrences import Kind, Names, Occurrence
from firable.nets.source import Source
from firable.nets.text import parse_net

TEXTS = {name: catalogue_path(name).read_text("utf-8") for name in catalogue_names()}
OWNED = {Kind.PLACE, Kind.SIGNAL}


def names_in(text: str) -> Names:
    return Names(Source("cell.firable.yaml", text))


def written(names: Names, one: Occurrence) -> str:
    return names.source.lines[one.line - 1][one.column - 1 : one.column - 1 + one.length]


@pytest.mark.parametrize("name", TEXTS)
def test_every_name_of_a_net_is_declared_once_and_stands_where_it_is_said(name: str) -> None:
    net, names = parse_net(TEXTS[name]), names_in(TEXTS[name])
    defined = [(one.kind, one.name) for one in names.occurrences if one.defines]
    assert len(set(defined)) == len(defined)
    given_by_limits = {t.name for t in net.transitions} - {n for kind, n in defined if kind is Kind.TRANSITION}
    assert all(name.endswith("_timeout") or "." in name for name in given_by_limits)
    assert {n for kind, n in defined if kind is Kind.CONTROLLER} == {c.name for c in net.controllers}
    assert {n for kind, n in defined if kind is Kind.PLACE} <= set(net.place_index)
    assert {n for kind, n in defined if kind is Kind.ARBITER} == {a.name for a in net.arbiters}
    assert {n for kind, n in defined if kind is Kind.PROPERTY} == {p.name for p in net.properties}
    for one in names.occurrences:
        assert one.prefix + written(names, one) == one.name
        assert names.definition(one).defines


@pytest.mark.parametrize("name", ["one_robot", "two_cells", "conceptual_two_robots"])
def test_arcs_and_gates_are_all_found(name: str) -> None:
    net, names = parse_net(TEXTS[name]), names_in(TEXTS[name])
    for place in net.places:
        touching = sum((*t.inputs, *t.outputs, *t.permissive, *t.inhibitive).count(place.name) for t in net.transitions)
        found = [one for one in names.occurrences if one.name == place.name and not one.defines]
        assert len(found) >= touching + place.marked


@examples(30)
@given(data=st.data())
def test_a_rename_changes_every_place_of_a_name_and_nothing_else(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from(list(TEXTS.values())))
    names = names_in(text)
    one = data.draw(st.sampled_from([one for one in names.occurrences if one.name not in names.given]))
    new_text = names.renamed(one, "brand_new")
    prefix = one.name.rpartition(".")[0] if one.kind in OWNED else ""
    new = f"{prefix}.brand_new" if prefix else "brand_new"
    before, after = net_to_json(parse_net(text)), net_to_json(parse_net(new_text))
    assert after != before
    back = names_in(new_text)
    (again,) = {other for other in back.occurrences if other.name == new and other.defines}
    old = one.name.rpartition(".")[2] if one.kind in OWNED else one.name
    assert back.renamed(again, old) == text
    if one.kind is not Kind.CONTROLLER:
        assert one.name not in {other.name for other in back.occurrences}


@pytest.mark.parametrize("name", catalogue_names())
def test_a_rename_says_all_names_that_it_changes(name: str) -> None:
    source = Source(name, catalogue_path(name).read_text("utf-8"))
    names = Names(source)
    for one in (each for each in names.occurrences if each.defines):
        before, after = parse_net(source.text), parse_net(names.renamed(one, "another"))
        said = names.renames(one, "another")
        for of in ("controllers", "places", "signals", "transitions", "arbiters", "properties"):
            told = {said.get(each.name, each.name) for each in getattr(before, of)}
            assert told == {each.name for each in getattr(after, of)}, (one.name, of)


def test_a_controller_is_renamed_in_the_full_names_of_its_parts() -> None:
    text = TEXTS["one_robot"]
    names = names_in(text)
    robot = next(one for one in names.occurrences if (one.kind, one.name) == (Kind.CONTROLLER, "robot"))
    net = parse_net(names.renamed(robot, "arm"))
    assert [c.name for c in net.controllers] == [
        "arm" if c.name == "robot" else c.name for c in parse_net(text).controllers
    ]
    assert "arm.free" in net.place_index
    assert not any(place.name.startswith("robot.") for place in net.places)


TIMED = """\
firable: 1
cell: demo
controllers:
  robot:
    start: free
    inputs: reset
    places:
      free:
      to_cv1:       {send: {machine: R, command: MOVE}, until: at_cv1, within: 5s}   # a limit
      to_cv1_fault: {send: {machine: R, command: STOP}}
      grasp:        {send: {machine: R, command: GRASP}, until: touch, within: 1min}
transitions:
  go:    {from: robot.free, to: robot.to_cv1}
  take:  {from: robot.to_cv1, to: robot.grasp}
  back:  {from: robot.grasp, to: robot.free, unless: robot.to_cv1_overdue}
  again: {from: robot.to_cv1_fault, to: robot.to_cv1, if: robot.reset}
  lost:  {from: robot.grasp_fault, to: robot.free, if: robot.reset}
properties:
  late: {ctl: AG (robot.to_cv1_fault -> not firable(robot.to_cv1_timeout))}
"""


def place_of(names: Names, name: str) -> Occurrence:
    return next(one for one in names.occurrences if one.defines and (one.kind, one.name) == (Kind.PLACE, name))


def test_what_a_time_limit_gives_follows_the_name_of_its_place() -> None:
    before = net_to_json(parse_net(TIMED))
    for old in ("to_cv1", "grasp"):
        names = names_in(TIMED)
        text = names.renamed(place_of(names, f"robot.{old}"), "move")
        assert json.loads(json.dumps(before).replace(f"robot.{old}", "robot.move")) == net_to_json(parse_net(text))
        assert text == TIMED.replace(old, "move")
        assert names_in(text).renamed(place_of(names_in(text), "robot.move"), old) == TIMED


@pytest.mark.parametrize(
    ("limit", "after"),
    [
        ("within: 5s}", "within: {time: 5s, to: stuck}}"),
        ('within: "5s"}', 'within: {time: "5s", to: stuck}}'),
        ("within: {time: 5s, timer: slow}}", "within: {to: stuck, time: 5s, timer: slow}}"),
    ],
)
def test_a_fault_place_of_another_name_stays_the_one_that_its_limit_leads_to(limit: str, after: str) -> None:
    given = TIMED.replace("within: 5s}", limit).replace("unless: robot.to_cv1_overdue", "unless: robot.reset")
    names = names_in(given)
    text = names.renamed(place_of(names, "robot.to_cv1_fault"), "stuck")
    assert after in text
    before = json.dumps(net_to_json(parse_net(given)))
    assert json.loads(before.replace("robot.to_cv1_fault", "robot.stuck")) == net_to_json(parse_net(text))


def test_a_limit_on_lines_of_its_own_is_told_its_fault_place_on_another() -> None:
    text = (
        "firable: 1\r\ncell: c\r\ncontrollers:\r\n  r:\r\n    places:\r\n"
        "      wait:\r\n        send: {machine: R, command: WAIT}\r\n        until: done\r\n"
        "        within:  # a limit\r\n          time: 5s\r\n      wait_fault:\r\n"
    )
    names = names_in(text)
    after = names.renamed(place_of(names, "r.wait_fault"), "late")
    assert after == text.replace("time: 5s", "to: late\r\n          time: 5s").replace("wait_fault", "late")
    assert [t.outputs for t in parse_net(after).transitions] == [("r.late",)]


def test_a_controller_takes_along_what_its_time_limits_give() -> None:
    names = names_in(TIMED)
    robot = next(one for one in names.occurrences if (one.kind, one.name) == (Kind.CONTROLLER, "robot"))
    text = names.renamed(robot, "arm")
    assert "robot" not in text
    assert parse_net(text).transition("lost").inputs == ("arm.grasp_fault",)


def test_a_name_that_a_time_limit_gives_is_that_of_its_place_and_changes_with_it_alone() -> None:
    names = names_in(TIMED)
    timer = next(one for one in names.occurrences if one.name == "robot.to_cv1_overdue")
    assert timer.kind is Kind.SIGNAL
    assert names.definition(timer) == place_of(names, "robot.to_cv1")
    with pytest.raises(InputError, match="F1020"):
        names.renamed(timer, "slow")
    for one, new in (("robot.free", "grasp_fault"), ("robot.grasp", "to_cv1_fault"), ("robot.free", "grasp_overdue")):
        with pytest.raises(InputError, match="F2001"):
            names.renamed(place_of(names, one), new)
    text = TIMED.replace("      free:\n", "      free:\n      home_fault:\n")
    with pytest.raises(InputError, match=r"F2001.*'robot\.home_fault'"):
        names_in(text).renamed(place_of(names_in(text), "robot.grasp"), "home")


def test_a_name_that_is_taken_or_none_is_refused() -> None:
    names = names_in(TEXTS["one_robot"])
    free = next(one for one in names.occurrences if one.name == "robot.free")
    for new, code in (
        ("back", "F2001"),
        ("robot.back", "F2001"),
        ("a b", "F2012"),
        ("", "F2012"),
        ("mc.free", "F2012"),
    ):
        with pytest.raises(InputError, match=code):
            names.renamed(free, new)
    assert names.renamed(free, "robot.idle") == names.renamed(free, "idle")


def test_names_are_found_in_a_net_that_is_not_well_formed() -> None:
    names = names_in("firable: 1\ncell: c\nplaces: {p: , q: }\ntransitions:\n  t: {from: p, to: missing}\n")
    here = names.at(5, 13)
    assert here is not None
    assert here.name == "p"
    assert names.definition(here).line == 3
    assert names.at(5, 20) is None


def test_a_word_that_is_quoted_or_part_of_a_formula_is_found_where_it_stands() -> None:
    text = (
        'firable: 1\ncell: c\nplaces: {"p": , q: }\nstart: p\ntransitions:\n  t: {from: "p", to: q}\n'
        "properties:\n  apart: {never: q and (not p)}\nexpect:\n  property.apart: violated\n"
    )
    names = names_in(text)
    at = names.at(3, 11)
    assert at is not None
    assert [(one.line, one.column) for one in names.of(at)] == [(3, 11), (4, 8), (6, 14), (8, 29)]
    changed = names.renamed(at, "place")
    assert '  t: {from: "place", to: q}' in changed
    assert "never: q and (not place)" in changed
    no = names.at(10, 13)
    assert no is not None
    assert "  property.never_both: violated" in names.renamed(no, "never_both")
    assert replace(no, line=8, column=3, defines=True) in names.of(no)


@pytest.mark.parametrize(
    "formula",
    [
        "q and\n      not (@\n\n      and q->@)",
        "'q and\n      not (@ and q->@)'",
        '"q and\n\n      not (@ and q->@)"',
        '"q and \\\n      not (@ and\\\n      \\ q->@)"',
        ">-\n      q and\n      not (@ and\n\n      q->@)",
        "|  # said twice: p\n      q and\n        not (@\n      and q->@)\n",
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_word_of_a_formula_over_several_lines_is_found_where_it_stands(formula: str, newline: str) -> None:
    text = "firable: 1\ncell: c\nplaces: {@: , q: }\nstart: @\ntransitions:\n  t: {from: @, to: q}\nproperties:\n"
    text = f"{text}  apart:\n    never: {formula}\n".replace("\n", newline)
    names = names_in(text.replace("@", "p"))
    at = names.at(3, 10)
    assert at is not None
    assert names.renamed(at, "place") == text.replace("@", "place")
    assert [written(names, one) for one in names.of(at)] == ["p"] * 5
    parse_net(text.replace("@", "place"))


def test_a_word_that_escapes_take_apart_is_left_alone() -> None:
    text = 'firable: 1\ncell: c\nplaces: {p1: , q: }\nproperties: {apart: {never: "q and p\\\n  1 and p1"}}\n'
    names = names_in(text)
    assert [one.line for one in names.occurrences if one.name == "p1"] == [3]
    assert [one.line for one in names.occurrences if one.name == "q"] == [3, 4]


CONCEPTUAL = """\
firable: 1
cell: demo
controllers:
  system:
    coordinator: true
    start: [cv1, robot]
    places:
      loading: {task: {name: load, robot: robot, source: system.cv1, program: load}}
      cv1:     {opens: {to: conveyor.cv1, machine: CV1}}
      robot:   {opens: {to: robot.free, machine: R}}
  robot:    {under: system}
  conveyor:
transitions:
  load: {from: [system.cv1, system.robot], to: system.loading}
properties:
  robot: {reachable: system.loading->system.robot}
expect: {property.robot: violated}
"""


@pytest.mark.parametrize(
    ("kind", "name", "new", "parts"),
    [
        (
            Kind.PLACE,
            "system.cv1",
            "belt",
            ["[belt, robot]", "source: system.belt", "      belt:     {opens", "from: [system.belt, "],
        ),
        (
            Kind.PLACE,
            "system.robot",
            "arm",
            ["[cv1, arm]", "robot: arm,", "      arm:   {opens", ", system.arm]", "->system.arm}"],
        ),
        (Kind.TRANSITION, "load", "start", ["  start: {from"]),
        (Kind.CONTROLLER, "robot", "arm", ["{to: arm.free", "  arm:    {under"]),
        (Kind.CONTROLLER, "conveyor", "belts", ["{to: belts.cv1", "  belts:"]),
        (Kind.PROPERTY, "robot", "loads", ["  loads: {reachable", "{property.loads: "]),
    ],
)
def test_what_reads_like_a_name_and_is_none_of_its_kind_is_left_as_it_is(
    kind: Kind, name: str, new: str, parts: list[str]
) -> None:
    names = names_in(CONCEPTUAL)
    one = next(one for one in names.occurrences if one.defines and (one.kind, one.name) == (kind, name))
    text = names.renamed(one, new)
    old = name.rpartition(".")[2]
    expected = CONCEPTUAL
    for part in parts:
        assert expected.count(part.replace(new, old)) == 1
        expected = expected.replace(part.replace(new, old), part)
    assert text == expected
    assert parse_net(text).name == "demo"
