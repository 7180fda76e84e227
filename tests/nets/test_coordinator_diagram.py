"""Coordinator diagrams: every part of the table is there, found by its id, and nothing stands on anything."""

import re
import xml.etree.ElementTree as ET
from itertools import pairwise

import pytest

from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.drawing import draw_coordinator
from firable.nets.drawing.panels import panels
from firable.nets.net import Controller, Net, Place, Transition
from firable.nets.text import parse_net

SVG = "{http://www.w3.org/2000/svg}"
CELLS = ["one_robot", "one_robot_mc_late", "two_cells", "manufacturing_cells-8", "conceptual_one_robot"]


def drawn(name: str, width_max: float = 1900) -> ET.Element:
    return ET.fromstring(draw_coordinator(split(catalogue_net(name)), width_max=width_max))


def ids(svg: ET.Element, kind: str) -> list[str]:
    return [found for one in svg.iter() if (found := one.get("id", "")).startswith(f"{kind}:")]


def texts(svg: ET.Element, id_: str) -> list[str]:
    group = next(one for one in svg.iter() if one.get("id") == id_)
    return ["".join(text.itertext()) for text in group.iter(f"{SVG}text")]


@pytest.mark.parametrize("width_max", [1900, 700])
@pytest.mark.parametrize("name", CELLS)
def test_every_part_of_every_row_is_drawn_once_however_narrow_the_sheet(name: str, width_max: float) -> None:
    decomposition = split(catalogue_net(name))
    svg = drawn(name, width_max)
    parts = {f"part:{row.name}:{part.controller}" for row in decomposition.coordinated for part in row.parts}
    assert sorted(ids(svg, "part")) == sorted(parts)
    again = ids(svg, "decision")
    assert {":".join(one.split(":")[:2]) for one in again} == {
        f"decision:{row.name}" for row in decomposition.coordinated
    }
    everything = [found for one in svg.iter() if (found := one.get("id"))]
    assert len(set(everything)) == len(everything)


def test_a_part_says_what_it_moves_and_what_it_waits_for() -> None:
    svg = drawn("one_robot")
    assert texts(svg, "part:G5:robot") == ["t1-31", "back → free", "if at_home"]
    assert texts(svg, "part:G1:system") == ["t0-1", "∅ → carrying_in"]


def test_a_participant_that_only_reads_is_hollow_and_the_legend_says_why() -> None:
    places = (Place("a.p", "a", marked=True), Place("b.q", "b"), Place("c.r", "c"))
    t = Transition("t", ("a.p",), ("b.q",), inhibitive=("c.r",))
    net = Net("n", places, (t,), controllers=(Controller("a"), Controller("b"), Controller("c")))
    svg = ET.fromstring(draw_coordinator(split(net)))
    assert texts(svg, "part:t:c")[1:] == ["unless r"]
    hollow = [one.get("id") for one in svg.iter(f"{SVG}g") if any(r.get("class") == "reads" for r in one)]
    assert hollow == ["part:t:c"]
    assert "part that votes and locks, and moves no token" in [text.text for text in svg.iter(f"{SVG}text")]


def test_what_competes_is_joined_and_told() -> None:
    svg = drawn("one_robot_mc_late")
    group = next(one for one in svg.iter() if one.get("id") == "group:robot_next")
    assert group.findtext(f"{SVG}title") == "by priority: G6, G2"


@pytest.mark.parametrize("name", [*CELLS, "two_robots_shared"])
def test_who_decides_stands_in_the_lane_of_the_decisions_and_not_on_another(name: str) -> None:
    svg = drawn(name)
    boxes = [one for one in svg.iter(f"{SVG}rect") if one.get("fill") == "#f7f8fa"]
    right = {float(one.get("x", "")) + float(one.get("width", "")) for one in boxes}
    px = {"lane": 9.4, "band": 8.2}  # as wide as bold letters are in a browser
    spans: dict[str, list[tuple[float, float]]] = {}
    for text in svg.iter(f"{SVG}text"):
        if (said := text.text or "").endswith(" decides"):
            x = float(text.get("x", ""))
            spans.setdefault(text.get("y", ""), []).append((x, x + len(said) * px[text.get("class", "")]))
    assert spans or name == "conceptual_one_robot"
    for row in spans.values():
        assert all(end <= min(right) for _, end in row)
        assert all(a_end <= b for (_, a_end), (b, _) in pairwise(row))


def test_layers_stand_above_those_that_they_coordinate() -> None:
    svg = drawn("two_cells", 4000)

    def span(id_: str) -> tuple[float, float]:
        found = next(one for one in svg.iter() if one.get("id") == id_)
        box = found if found.tag == f"{SVG}rect" else next(found.iter(f"{SVG}rect"))
        left = float(box.get("x", ""))
        return left, left + float(box.get("width", ""))

    for cell, under in (("cell_a", ["robot_a", "machine_a"]), ("cell_b", ["robot_b", "machine_b"])):
        left, right = span(f"coordinator:{cell}")
        for controller in under:
            assert left <= span(f"controller:{controller}")[0] < span(f"controller:{controller}")[1] <= right
        assert not left <= span("controller:conveyors")[0] <= right
    assert span("coordinator:line")[0] <= span("coordinator:cell_a")[0]


@pytest.mark.parametrize("name", CELLS)
def test_words_stay_in_the_box_of_their_controller(name: str) -> None:
    svg = drawn(name)
    boxes = {
        one.get("id", "").split(":")[1]: one for one in svg.iter(f"{SVG}rect") if "controller:" in one.get("id", "")
    }
    for group in svg.iter(f"{SVG}g"):
        if not (found := re.fullmatch("part:.*:(.*)", group.get("id", ""))):
            continue
        box = boxes[found[1]]
        right = float(box.get("x", "")) + float(box.get("width", ""))
        for text in group.iter(f"{SVG}text"):
            assert float(text.get("x", "")) + 5.4 * len(text.text or "") < right


NARROW = """\
firable: 1
cell: narrow
controllers:
  a: {start: [free, seen], places: {free: , busy: , seen: }}
  b: {start: idle, places: {idle: , one: , other: }}
transitions:
  go: {from: [a.free, b.idle], to: [a.busy, b.one]}
  see: {from: b.idle, to: b.other, if: a.seen}
  back: {from: [a.busy, b.one], to: [a.free, b.idle]}
  done: {from: b.other, to: b.idle}
"""


def test_the_legend_of_a_narrow_picture_ends_in_it() -> None:
    svg = ET.fromstring(draw_coordinator(split(parse_net(NARROW))))
    words = ["moves no token", "is decided at a time"]
    legend = [text for text in svg.iter(f"{SVG}text") if (text.text or "").endswith(tuple(words))]
    assert len(legend) == len(words)
    for text in legend:
        assert float(text.get("x", "")) + 5.4 * len(text.text or "") < float(svg.get("width", ""))
        assert float(text.get("y", "")) < float(svg.get("height", ""))
    assert any("and 1 that competes with them" in (text.text or "") for text in svg.iter(f"{SVG}text"))


def test_lanes_are_cut_where_the_fewest_transitions_have_parts_on_both_sides() -> None:
    assert panels([4, 4, 4, 4], 14, 1, [{0, 1}, {0, 1}, {1, 2}, {1, 2}, {2, 3}]) == [range(3), range(3, 4)]
    assert panels([4, 4, 4, 4], 9, 1, []) == [range(2), range(2, 4)]
    assert panels([40, 4], 9, 1, []) == [range(1), range(1, 2)]
    assert panels([], 9, 1, []) == []
