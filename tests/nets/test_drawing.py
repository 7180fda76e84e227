"""Drawings: complete, deterministic, and readable by construction whatever the net."""

import re
import xml.etree.ElementTree as ET
from urllib.parse import quote

import pytest
from hypothesis import given
from support.examples import examples
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_names, catalogue_net
from firable.nets.drawing import draw_net
from firable.nets.drawing.layout import layout
from firable.nets.drawing.rows import lane_order, rows_of
from firable.nets.drawing.shapes import LABEL_LEFT, RADIUS, STUB_LINE, WORDS_LINE
from firable.nets.drawing.text import width_of
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, Transition

SVG = "{http://www.w3.org/2000/svg}"


def elements(svg: str, tag: str, css: str) -> list[ET.Element]:
    return [element for element in ET.fromstring(svg).iter(f"{SVG}{tag}") if element.get("class") == css]


def texts(svg: str) -> set[str]:
    return {"".join(element.itertext()) for element in ET.fromstring(svg).iter(f"{SVG}text")}


@pytest.mark.parametrize("name", catalogue_names())
def test_everything_of_a_cell_is_drawn(name: str) -> None:
    net = catalogue_net(name)
    svg = draw_net(net)
    # One place and one token more stand in the legend.
    assert len(elements(svg, "circle", "place")) == len(net.places) + 1
    assert len(elements(svg, "circle", "token")) == sum(place.marked for place in net.places) + 1
    arcs = sum(len(transition.inputs) + len(transition.outputs) for transition in net.transitions)
    assert len(elements(svg, "path", "arc")) == len(elements(svg, "path", "head")) == arcs
    shown = texts(svg)
    assert {place.name.removeprefix(f"{place.owner}.") for place in net.places} <= shown
    assert {transition.name for transition in net.transitions} <= shown
    assert {str(place.command) for place in net.places if place.command} <= shown


def test_the_same_net_gives_the_same_picture() -> None:
    net = catalogue_net("one_robot")
    assert draw_net(net) == draw_net(net)


def test_a_leader_goes_on_behind_the_bar_of_another_transition() -> None:
    names = ("a", "b", "c")
    places = tuple(Place(f"{owner}.{p}", owner, marked=p == "p") for owner in names for p in "pqr")
    transitions = (
        Transition("first", ("a.p", "b.p"), ("a.q", "b.q")),
        Transition("second", ("b.q", "c.p"), ("b.r", "c.q")),
        Transition("local", ("a.q",), ("a.r",)),
    )
    net = Net("n", places, transitions, controllers=tuple(map(Controller, names)))
    (second,) = [
        one.get("d", "") for one in elements(draw_net(net), "path", "leader") if one.get("d", "").count("M") == 2
    ]
    ends = [float(x) for x in re.findall(r"[MH]([\d.]+)", second)]
    local = layout(net).bars[2]
    assert ends[1] < local.segments[0][0] < local.segments[-1][1] + 8 + width_of(*local.words[0]) < ends[2] < ends[3]


@examples(25)
@given(whole_nets())
def test_no_arc_passes_through_a_place_or_a_bar_that_it_does_not_join(net: Net) -> None:
    ET.fromstring(draw_net(net))
    where = layout(net)
    for edge in where.edges:
        spot, bar = where.places[edge.place], where.bars[edge.transition]
        assert any(start <= edge.x <= end for start, end in bar.segments)
        low, high = sorted((spot.y, bar.y))
        for p, other in enumerate(where.places):
            if p != edge.place:
                assert not (abs(other.x - edge.x) < RADIUS + 3 and low < other.y < high)
        for t, other_bar in enumerate(where.bars):
            if t != edge.transition and low < other_bar.y < high:
                assert not any(start - 2 < edge.x < end + 2 for start, end in other_bar.segments)


@examples(25)
@given(whole_nets())
def test_places_and_bars_never_overlap_and_stay_in_their_lanes(net: Net) -> None:
    where = layout(net)
    spots = [(spot.x, spot.y) for spot in where.places]
    for i, (x, y) in enumerate(spots):
        assert all(abs(x - u) > 2 * RADIUS or abs(y - v) > 2 * RADIUS for u, v in spots[:i])
        lane = next(lane for lane in where.lanes if lane.owner == net.places[i].owner)
        assert lane.x < x - RADIUS
        assert x + LABEL_LEFT < lane.x + lane.width
    pieces = [(bar.y, segment) for bar in where.bars for segment in bar.segments]
    for i, (y, (start, end)) in enumerate(pieces):
        assert all(y != v or end < left or right < start for v, (left, right) in pieces[:i])
    for first, second in zip(where.lanes, where.lanes[1:], strict=False):
        assert first.x + first.width < second.x


def test_a_token_cuts_a_cycle_so_work_runs_down_the_page() -> None:
    places = (Place("free", marked=True), Place("load"), Place("work"))
    transitions = (
        Transition("c", ("work",), ("free",)),
        Transition("a", ("free",), ("load",)),
        Transition("b", ("load",), ("work",)),
    )
    assert rows_of(Net("n", places, transitions), [(0, 0)] * 3) == (3, 1, 2)


def test_a_cycle_without_a_token_is_drawn_all_the_same() -> None:
    net = Net("n", (Place("p"), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))))
    assert sorted(rows_of(net, [(0, 0)] * 2)) == [1, 2]


def test_lanes_that_work_together_stand_together() -> None:
    assert lane_order([frozenset({0, 2}), frozenset({0, 2}), frozenset({1, 2})], 3) == (0, 2, 1)


def test_of_many_lanes_those_that_work_together_stand_together_too() -> None:
    net = catalogue_net("manufacturing_cells-8")
    owners = [lane.owner for lane in layout(net).lanes]
    assert owners == ["s1", "r1", "s2", "s3", "r2", "s4", "s5", "r3", "s6", "s7", "r4", "s8"]


def test_a_transition_without_arcs_has_its_bar_in_the_lane_whose_row_it_takes() -> None:
    """Found by a drawn net: its bar stood in the first lane of the drawing, on that of another transition."""
    controllers = (Controller("a"), Controller("b"), Controller("c"))
    places = (Place("a.p", "a"), Place("b.p", "b"), Place("c.p", "c"))
    wide = (Transition("ac", ("a.p",), ("c.p",)), Transition("ab", ("a.p",), ("b.p",)))
    net = Net("n", places, (Transition("bare"), Transition("own", ("b.p",)), *wide), controllers=controllers)
    where = layout(net)
    assert [lane.owner for lane in where.lanes] == ["b", "a", "c"]
    bare, own = where.bars[:2]
    lane = where.lanes[1]
    assert lane.x < bare.segments[0][0] < bare.segments[0][1] < lane.x + lane.width
    assert own.segments[0][1] < lane.x


def test_global_transitions_at_one_height_each_have_their_name_beside_their_bar() -> None:
    svg = draw_net(catalogue_net("philosophers-4"))
    names = [text for text in elements(svg, "text", "name") if "_takes_right" in (text.text or "")]
    assert len({(text.get("x"), text.get("y")) for text in names}) == len(names) == 4


def test_gates_end_in_a_dot_or_a_hollow_circle() -> None:
    net = Net(
        "n",
        (Place("p", marked=True), Place("q")),
        (Transition("t", (), (), ("p",), ("q",), (ExternalGate("go"), ExternalGate("halt", wanted=False))),),
        (Signal("go"), Signal("halt")),
    )
    svg = draw_net(net)
    assert len(elements(svg, "path", "gate")) == 2 + 2  # and in the legend
    assert len(elements(svg, "path", "stub")) == 2 + 2
    assert len(elements(svg, "circle", "dot")) == 2 + 2
    assert len(elements(svg, "circle", "hollow")) == 2 + 2
    assert {"go", "halt"} <= texts(svg)


def test_names_are_escaped() -> None:
    command = Command("R<1>", "A&B")
    net = Net('<script>"', (Place("a.p", "a", command=command),), controllers=(Controller("a", description="<b>"),))
    svg = draw_net(net, caption="x < y & z")
    assert {'<script>"', "R<1> A&B", "<b>", "x < y & z"} <= texts(svg)
    assert "<script>" not in svg


def test_firings_are_numbered_at_their_transitions() -> None:
    net = catalogue_net("conceptual_one_robot")
    svg = draw_net(net, firings=[["t1"], ["t2"], ["t1"]])
    assert {"1, 3", "2"} <= texts(svg)
    assert len(elements(svg, "rect", "fired")) >= 2


def test_a_time_limit_stands_below_the_command_and_its_timer_beside_the_completion() -> None:
    drawn = draw_net(catalogue_net("one_robot_timed"))
    assert drawn.count(">within 5s<") == 5
    stubs = {"".join(stub.itertext()): stub.get("x") for stub in elements(drawn, "text", "signal")}
    assert stubs["to_cv1_overdue"] == stubs["at_cv1"]


@examples(25)
@given(whole_nets())
def test_what_is_of_the_net_is_found_by_an_id_of_its_own(net: Net) -> None:
    ids = [found for element in ET.fromstring(draw_net(net)).iter() if (found := element.get("id")) is not None]
    assert len(set(ids)) == len(ids)
    wanted = {f"place:{quote(place.name)}" for place in net.places}
    for transition in net.transitions:
        name = quote(transition.name)
        wanted |= {f"transition:{name}"}
        wanted |= {f"input:{name}:{quote(place)}" for place in transition.inputs}
        wanted |= {f"output:{name}:{quote(place)}" for place in transition.outputs}
        wanted |= {f"permissive:{name}:{quote(place)}" for place in transition.permissive}
        wanted |= {f"inhibitive:{name}:{quote(place)}" for place in transition.inhibitive}
        wanted |= {f"gate:{name}:{quote(g.signal)}{'' if g.wanted else ':0'}" for g in transition.external}
    assert wanted == {one for one in ids if not one.startswith("lane:")}
    owners = {place.owner for place in net.places} | {signal.owner for signal in net.signals}
    assert {f"lane:{quote(owner)}" for owner in owners if owner} == {one for one in ids if one.startswith("lane:")}


def test_the_words_of_a_place_do_not_touch_the_signals_of_the_bar_below() -> None:
    described = Place("c.p", "c", description="what stands here takes two lines beside its place")
    signals = tuple(Signal(f"c.s{i}", "c") for i in range(4))
    gates = tuple(ExternalGate(signal.name) for signal in signals)
    net = Net(
        "close",
        (described, Place("c.q", "c", marked=True)),
        (Transition("t", ("c.q",), ("c.p",)), Transition("u", ("c.p",), ("c.q",), external=gates)),
        signals,
        (Controller("c"),),
    )
    where = layout(net)
    place, bar = where.places[0], where.bars[1]
    assert len(place.words) == 3
    assert {stub.x for stub in where.stubs} == {place.x}
    below_words = place.y + WORDS_LINE * (len(place.words) - 1) / 2 + 7.5
    above_signals = [bar.y - 20 - STUB_LINE * stub.slot for stub in where.stubs]
    assert len(above_signals) == 4
    assert below_words < min(above_signals)
