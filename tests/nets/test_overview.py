"""The overview of a net: every controller and every shared transition, in an order that follows the work."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from urllib.parse import quote

import pytest
from hypothesis import given
from support.examples import examples
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.drawing import draw_overview, has_overview
from firable.nets.drawing.overview import LINES_MAX
from firable.nets.drawing.part import everybody, owners_of
from firable.nets.drawing.rows import followed, grown
from firable.nets.net import Controller, Net, Place, Transition

SVG = "{http://www.w3.org/2000/svg}"


def by_id(svg: ET.Element, kind: str) -> Mapping[str, ET.Element]:
    return {found: one for one in svg.iter() if (found := one.get("id", "")).startswith(f"{kind}:")}


def texts(group: ET.Element, css: str) -> list[str]:
    return [one.text or "" for one in group.iter(f"{SVG}text") if one.get("class") == css]


def spans(group: ET.Element, css: str) -> Iterator[tuple[float, float]]:
    """From where to where the rectangles of a class reach, downwards."""
    for one in group.iter(f"{SVG}rect"):
        if one.get("class") == css:
            y = float(one.get("y", ""))
            yield y, y + float(one.get("height", ""))


@examples(40)
@given(whole_nets())
def test_a_shared_transition_is_thick_in_the_line_of_each_who_takes_part_and_in_no_other(net: Net) -> None:
    svg = ET.fromstring(draw_overview(net, width_max=500))
    everything = [found for one in svg.iter() if (found := one.get("id"))]
    assert len(set(everything)) == len(everything)
    heads, bars = by_id(svg, "controller"), by_id(svg, "transition")
    owners = {*(controller.name for controller in net.controllers), *owners_of(net)}
    assert {one.split(":")[1] for one in heads} == {quote(owner or "") for owner in owners}
    shared = {name: some for name, some in everybody(net).items() if len(some) > 1}
    assert set(bars) == {f"transition:{quote(name)}" for name in shared}
    lines = [(one.split(":")[1], *next(spans(head, "line"))) for one, head in heads.items()]
    for name, some in shared.items():
        parts = list(spans(bars[f"transition:{quote(name)}"], "bar"))
        there = [owner for top, bottom in parts for owner, low, high in lines if low <= top and bottom <= high]
        assert sorted(there) == sorted(quote(owner or "") for owner in some)


def test_who_is_under_a_coordinator_stands_below_it_indented_and_in_its_colour() -> None:
    heads = by_id(ET.fromstring(draw_overview(catalogue_net("two_cells"))), "controller")
    names = [one.split(":")[1] for one in heads]
    assert names == ["line", "cell_a", "machine_a", "robot_a", "conveyors", "cell_b", "robot_b", "machine_b"]
    left = {one.split(":")[1]: float(next(head.iter(f"{SVG}text")).get("x", "")) for one, head in heads.items()}
    assert left["line"] < left["cell_a"] == left["conveyors"] < left["robot_a"] == left["robot_b"]
    tint = {one.split(":")[1]: next(head.iter(f"{SVG}rect")).get("fill") for one, head in heads.items()}
    assert tint["cell_a"] == tint["robot_a"] == tint["machine_a"]
    assert len({tint[name] for name in ("line", "cell_a", "conveyors", "cell_b")}) == 4


def test_a_line_says_what_its_controller_owns_and_where_its_tokens_are() -> None:
    net = catalogue_net("two_cells")
    heads = by_id(ET.fromstring(draw_overview(net)), "controller")
    assert texts(heads["controller:robot_a"], "note") == ["7", "2", "6"]
    assert texts(heads["controller:robot_a"], "held") == ["free"]
    assert texts(heads["controller:conveyors"], "held") == ["cv1 +2"]
    assert texts(heads["controller:cell_a"], "held") == [""]
    moved = ET.fromstring(draw_overview(net, marking=net.marking(["robot_a.fetch"])))
    assert texts(by_id(moved, "controller")["controller:robot_a"], "held") == ["fetch"]


def test_what_has_fired_says_in_which_steps() -> None:
    net = catalogue_net("two_cells")
    svg = ET.fromstring(draw_overview(net, firings=[["enter"], ["load_a"], ["fetched_a"], ["load_a"]]))
    bars = by_id(svg, "transition")
    assert texts(bars["transition:load_a"], "step") == ["2, 4"]
    assert texts(bars["transition:fetched_a"], "step") == ["3"]
    assert len(list(spans(bars["transition:load_a"], "fired"))) == 4
    assert not list(spans(bars["transition:put_a"], "fired"))


def columns(svg: ET.Element) -> list[str]:
    """The shared transitions from left to right, system by system."""
    at = []
    for one, bar in by_id(svg, "transition").items():
        (left,) = {float(rect.get("x", "")) for rect in bar.iter(f"{SVG}rect")}
        at.append((left, one.removeprefix("transition:")))
    return [name for _, name in sorted(at)]


def test_bars_follow_the_work_and_a_cell_stands_together() -> None:
    shown = columns(ET.fromstring(draw_overview(catalogue_net("two_cells"))))
    of_a, of_b = (
        [f"{name}_{cell}" for name in ("load", "fetched", "put", "unload", "taken", "placed")] for cell in "ab"
    )
    assert shown == [*of_a, *of_b]


@examples(40)
@given(whole_nets())
def test_no_bar_stands_before_one_that_it_follows(net: Net) -> None:
    shared = [t for t, some in enumerate(everybody(net).values()) if len(some) > 1]
    at = {name: i for i, name in enumerate(columns(ET.fromstring(draw_overview(net, width_max=100_000))))}
    names = [quote(net.transitions[t].name) for t in shared]
    for name, before in zip(names, followed(net, shared), strict=True):
        assert all(at[names[other]] < at[name] for other in before)


def test_bars_that_are_wider_than_the_sheet_go_on_below_with_those_who_take_part() -> None:
    net = family_net("manufacturing_cells-60")
    svg = ET.fromstring(draw_overview(net))
    assert float(svg.get("width", "")) <= 1300
    heads = by_id(svg, "controller")
    assert len(by_id(svg, "transition")) == 120
    below = [one for one in heads if one.count(":") == 2]
    assert 0 < len(below) < 4, "few controllers take part above and below, and no others are written twice"
    assert {one.split(":")[1] for one in heads} == {controller.name for controller in net.controllers}


def test_what_lies_between_two_shared_transitions_says_which_comes_first() -> None:
    places = (Place("p"), Place("q"), Place("r"))
    chain = (Transition("t", (), ("p",)), Transition("u", ("p",), ("q",)), Transition("v", ("q",), ("r",)))
    net = Net("n", places, chain)
    assert followed(net, [0, 2]) == [set(), {0}]
    assert followed(net, [2, 0]) == [{1}, set()]


def test_an_order_that_grows_keeps_what_stands_before() -> None:
    wide = [frozenset({0, 1}), frozenset({1, 2})]
    assert grown(wide, 3, 0) == (0, 1, 2)
    assert grown(wide, 3, 0, [[], [2], []]) == (0, 2, 1)


@pytest.mark.parametrize(
    ("net", "has_one"),
    [
        (catalogue_net("two_cells"), True),
        (family_net("counter-50"), False),  # one owns it all
        (Net("n", (Place("a.p", "a"),), controllers=(Controller("a"), Controller("b"))), False),  # one owns it all
        (Net("n", (Place("a.p", "a"), Place("q")), controllers=(Controller("a"),)), True),
        (family_net("philosophers-300"), True),
        (family_net("philosophers-400"), False),  # 400 controllers and 800 transitions
    ],
)
def test_a_net_has_an_overview_where_several_own_it_and_it_can_be_looked_through(net: Net, has_one: bool) -> None:
    assert has_overview(net) == has_one
    assert LINES_MAX == 1000
