"""Pictures of reachability graphs: complete, nothing on top of anything, every part found by its id."""

import xml.etree.ElementTree as ET
from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

from firable.nets.drawing import MarkingGraph, Step, draw_markings, layered
from firable.nets.drawing.layered import Box, Link, Placed
from firable.nets.net import Controller, Net, Place

SVG = "{http://www.w3.org/2000/svg}"
Graph = tuple[list[Box], list[Link]]


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    """Rows of boxes of any size, and at most one edge from one to another, up, down or beside."""
    sizes = st.tuples(st.integers(20, 200), st.integers(16, 90), st.integers(0, 4))
    boxes = [Box(*size) for size in draw(st.lists(sizes, min_size=1, max_size=10))]
    ends = st.tuples(st.integers(0, len(boxes) - 1), st.integers(0, len(boxes) - 1)).filter(lambda e: e[0] != e[1])
    pairs = draw(st.lists(ends, unique=True, max_size=20)) if len(boxes) > 1 else []
    return boxes, [Link(tail, head, draw(st.integers(6, 120)), draw(st.integers(10, 40))) for tail, head in pairs]


def on_the_way(points: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    """Points along the curves of a route, close to each other."""
    found = []
    for k in range(0, len(points) - 1, 3):
        a, b, c, d = points[k : k + 4]
        for i in range(33):
            u = i / 32
            weights = ((1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u**3)
            found.append(
                (
                    sum(w * p[0] for w, p in zip(weights, (a, b, c, d), strict=True)),
                    sum(w * p[1] for w, p in zip(weights, (a, b, c, d), strict=True)),
                )
            )
    return found


def apart(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    (x, y, w, h), (u, v, a, b) = one, other
    return abs(x - u) >= (w + a) / 2 - 0.01 or abs(y - v) >= (h + b) / 2 - 0.01


def inside(x: float, y: float, box: Box, centre: tuple[float, float]) -> bool:
    return abs(x - centre[0]) < box.width / 2 - 0.5 and abs(y - centre[1]) < box.height / 2 - 0.5


@examples(25)
@given(graphs())
def test_boxes_and_words_never_overlap_and_lie_in_the_picture(graph: Graph) -> None:
    boxes, links = graph
    placed = layered(boxes, links)
    areas = [(*centre, box.width, box.height) for centre, box in zip(placed.centres, boxes, strict=True)]
    areas += [(*route.words, link.width, link.height) for route, link in zip(placed.routes, links, strict=True)]
    assert all(apart(one, other) for one, other in combinations(areas, 2))
    for x, y, width, height in areas:
        assert width / 2 - 0.01 <= x <= placed.width - width / 2 + 0.01
        assert height / 2 - 0.01 <= y <= placed.height - height / 2 + 0.01


@examples(25)
@given(graphs())
def test_a_line_joins_its_boxes_and_passes_through_no_other(graph: Graph) -> None:
    boxes, links = graph
    placed = layered(boxes, links)
    for link, route in zip(links, placed.routes, strict=True):
        for box, (x, y) in ((link.tail, route.points[0]), (link.head, route.points[-1])):
            assert abs(x - placed.centres[box][0]) <= boxes[box].width / 2
            assert abs(abs(y - placed.centres[box][1]) - boxes[box].height / 2) < 0.01
        for x, y in on_the_way(route.points):
            assert not any(inside(x, y, box, at) for box, at in zip(boxes, placed.centres, strict=True))


def test_a_graph_without_boxes_has_no_size() -> None:
    assert layered([], []) == Placed((), (), 0.0, 0.0)


def net() -> Net:
    places = (
        Place("r.free", "r", marked=True),
        Place("r.work", "r"),
        Place("m.on", "m", marked=True),
        Place("m.b", "m"),
    )
    return Net("n", places, controllers=(Controller("r"), Controller("m")))


def drawn(graph: MarkingGraph) -> ET.Element:
    return ET.fromstring(draw_markings(net(), graph))


def test_a_marking_says_what_is_different_from_the_first_one() -> None:
    graph = MarkingGraph((0b0101, 0b0110, 0b0010), (Step(0, 1, ("go",)), Step(1, 2, ("stop",))))
    found = {one.get("id"): ["".join(t.itertext()) for t in one.iter(f"{SVG}text")] for one in drawn(graph).iter()}
    assert found["marking:0"] == ["M0", "r: free", "m: on"]
    assert found["marking:1"] == ["M1", "r: work"]
    assert found["marking:2"] == ["M2", "r: work", "m: –"]
    assert found["firing:0:1"] == ["go"]


def test_what_fires_between_the_same_markings_stands_at_one_arrow() -> None:
    graph = MarkingGraph((1, 2), (Step(0, 1, ("a",)), Step(0, 1, ("b", "c")), Step(1, 1, ("idle",))))
    groups = {one.get("id"): one for one in drawn(graph).iter(f"{SVG}g")}
    assert ["".join(t.itertext()) for t in groups["firing:0:1"].iter(f"{SVG}text")] == ["a", "b + c"]
    assert ["".join(t.itertext()) for t in groups["firing:1:1"].iter(f"{SVG}text")] == ["idle"]
    title = groups["firing:0:1"].find(f"{SVG}title")
    assert title is not None
    assert title.text == "M0 → M1: a; b + c\nr.free → r.work"


def test_deadlocks_and_doomed_markings_say_so_and_stand_in_the_legend() -> None:
    steps = (Step(0, 1, ("a",)), Step(1, 2, ("b",)))
    graph = MarkingGraph((1, 2, 8), steps, deadlocks=frozenset({2}), doomed=frozenset({1, 2}), beyond=(3, 0, 0))
    groups = {one.get("id"): one for one in drawn(graph).iter(f"{SVG}g")}
    flags = {name: [t.text for t in one.iter(f"{SVG}text") if t.get("class") == "flag"] for name, one in groups.items()}
    assert flags["marking:0"] == []
    assert flags["marking:1"] == ["doomed"]
    assert flags["marking:2"] == ["deadlock"]
    assert [t.text for t in groups["marking:0"].iter(f"{SVG}text")][-1] == "3 more"
    legend = [t.text for t in drawn(graph).findall(f"{SVG}text")]
    assert {"deadlock", "doomed: a deadlock can no longer be avoided"} <= set(legend)
    assert "deadlock" not in [t.text for t in drawn(MarkingGraph((1,), ())).iter(f"{SVG}text")]
