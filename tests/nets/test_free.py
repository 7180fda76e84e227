"""Nets drawn without lanes: the same signs and ids, wherever a layouter puts them."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import pytest
from hypothesis import given
from support.examples import examples
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_net
from firable.nets.drawing import draw_free, draw_net
from firable.nets.drawing.layered import Box, Link, Placed, layered
from firable.nets.net import Net

SVG = "{http://www.w3.org/2000/svg}"


def ids(svg: str) -> list[str]:
    return [found for one in ET.fromstring(svg).iter() if (found := one.get("id")) and not found.startswith("lane:")]


@examples(30)
@given(whole_nets())
def test_what_is_of_the_net_has_the_ids_of_the_picture_with_lanes(net: Net) -> None:
    free = ids(draw_free(net))
    assert sorted(free) == sorted(ids(draw_net(net)))


def test_arcs_lead_from_sign_to_sign() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_free(net))

    def middle(id_: str) -> tuple[float, float]:
        group = next(one for one in svg.iter() if one.get("id") == id_)
        circle = next(group.iter(f"{SVG}circle"))
        return float(circle.get("cx", "")), float(circle.get("cy", ""))

    paths = [one for one in svg.iter(f"{SVG}path") if (one.get("id") or "").startswith(("input:", "output:"))]
    assert len(paths) == sum(len(t.inputs) + len(t.outputs) for t in net.transitions)
    for path in paths:
        kind, _, place = (path.get("id") or "").split(":")
        first, last = (path.get("d") or "")[1:].split("L")[0], (path.get("d") or "").split("L")[-1]
        x, y = map(float, (first if kind == "input" else last).split())
        at = middle(f"place:{place}")
        assert ((x - at[0]) ** 2 + (y - at[1]) ** 2) ** 0.5 == pytest.approx(15, abs=0.2)


def test_a_layouter_is_told_how_far_down_a_node_is_and_where_its_lines_should_lead() -> None:
    net = catalogue_net("conceptual_one_robot")
    seen: list[Box] = []

    def watching(boxes: Sequence[Box], links: Sequence[Link]) -> Placed:
        seen.extend(boxes)
        assert len(links) == sum(len(t.inputs) + len(t.outputs) for t in net.transitions)
        return layered(boxes, links)

    draw_free(net, layout=watching)
    names = [place.name for place in net.places] + [transition.name for transition in net.transitions]
    rows = {name: box.row for name, box in zip(names, seen, strict=True)}
    assert rows["t1"] < rows["system.loading"] < rows["t3"]
    assert {box.core for box in seen} == {30.0, 48.0}


def test_the_legend_shows_gates_and_commands_as_the_picture_has_them() -> None:
    net = catalogue_net("index_table")
    assert any(not gate.wanted for transition in net.transitions for gate in transition.external)
    free, lanes = draw_free(net), draw_net(net)
    words = [text.split(">")[1].split("<")[0] for text in free.split("<text ") if 'class="signal"' in text]
    assert words[-2:] == ["if", "unless"]
    assert 'class="stub"' not in free
    assert 'class="send"' not in free
    assert 'class="stub"' in lanes
    assert 'class="send"' in lanes
