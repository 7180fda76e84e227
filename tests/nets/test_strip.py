"""Strips: a frame for each step, with the places that matter, the tokens that come and leave, and what fires."""

import xml.etree.ElementTree as ET

import pytest

from firable.nets.catalogue import catalogue_net
from firable.nets.drawing import Frame, draw_strip
from firable.nets.drawing.strip import STEPS_MAX
from firable.nets.net import Net, Place, Transition

SVG = "{http://www.w3.org/2000/svg}"


def frames(net: Net, *fired: str) -> list[Frame]:
    found, marking = [], net.initial_marking
    for number, name in enumerate(fired, start=1):
        t = net.transition(name)
        after = marking & ~net.marking(t.inputs) | net.marking(t.outputs)
        found.append(Frame(number, (name,), marking, after))
        marking = after
    return found


def group(svg: ET.Element, id_: str) -> ET.Element:
    return next(one for one in svg.iter() if one.get("id") == id_)


def ids(svg: ET.Element, kind: str) -> list[str]:
    return [found for one in svg.iter() if (found := one.get("id", "")).startswith(f"{kind}:")]


def test_a_frame_holds_the_places_that_the_run_touches_and_no_other() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_strip(net, frames(net, "G1")))
    assert ids(svg, "step") == ["step:0", "step:1"]
    touched = {"system.carrying_in", "conveyor.cv1", "conveyor.cv1_run"}
    assert set(ids(svg, "place")) == {f"place:{n}:{name}" for n in (0, 1) for name in touched}
    assert ids(svg, "fired") == ["fired:1:G1"]


def test_tokens_that_come_leave_and_stay_are_told_apart() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_strip(net, frames(net, "G1", "G2")))

    def seen(id_: str) -> tuple[str | None, int]:
        one = group(svg, id_)
        circles = list(one.iter(f"{SVG}circle"))
        return next(one.iter(f"{SVG}text")).get("class"), len(circles) - 1

    assert seen("place:0:robot.free") == ("held", 1)
    assert seen("place:1:system.carrying_in") == ("comes", 1)
    assert seen("place:2:system.carrying_in") == ("leaves", 0)
    assert seen("place:2:system.loading") == ("comes", 1)
    assert seen("place:1:system.loading") == ("empty", 0)


def test_what_fires_has_an_arc_for_each_token_and_its_gates_and_says_what_it_is() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_strip(net, frames(net, "G1", "G2")))
    g2 = net.transition("G2")
    arcs = [one for one in group(svg, "fired:2:G2").iter(f"{SVG}path") if one.get("class") == "arc"]
    assert len(arcs) == len(g2.inputs) + len(g2.outputs)
    said = ["".join(text.itertext()) for text in group(svg, "step:2").iter(f"{SVG}text")]
    assert said[:3] == ["2 G2", "start of loading from CV1", "if part_at_end"]
    gated = Net("n", (Place("p"), Place("q", marked=True)), (Transition("t", (), ("p",), ("q",)),))
    drawn = ET.fromstring(draw_strip(gated, frames(gated, "t")))
    assert [one.get("class") for one in group(drawn, "fired:1:t").iter(f"{SVG}circle")] == ["dot"]


def test_frames_that_do_not_fit_go_on_in_the_next_row() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_strip(net, frames(net, "G1", "G2", "t1-a", "G3"), width_max=500))
    corners = [next(one.iter(f"{SVG}rect")) for one in svg.iter(f"{SVG}g") if one.get("id", "").startswith("step:")]
    at = [(float(box.get("x", "")), float(box.get("y", ""))) for box in corners]
    assert len(set(at)) == 5
    assert len({y for _, y in at}) > 1
    assert max(x for x, _ in at) < 500 < float(svg.get("height", ""))


def test_of_a_long_run_the_middle_is_left_out_and_said_to_be() -> None:
    net = Net(
        "n",
        (Place("p", marked=True), Place("q")),
        (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))),
    )
    run = frames(net, *(["t", "u"] * STEPS_MAX))
    svg = ET.fromstring(draw_strip(net, run))
    shown = [int(one.split(":")[1]) for one in ids(svg, "step")]
    assert shown == [*range(STEPS_MAX // 2 + 1), *range(STEPS_MAX * 3 // 2 + 1, 2 * STEPS_MAX + 1)]
    assert f"{STEPS_MAX} steps are left out here" in [text.text for text in svg.iter(f"{SVG}text")]


def test_the_end_of_a_run_is_told_beside_its_last_frame() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_strip(net, (), end=["Deadlock: nothing fires.", "a waits for b"]))
    assert [text.text for text in svg.iter(f"{SVG}text") if text.get("class") == "end"][::2] == [
        "Deadlock: nothing fires.",
        "a waits for b",
    ]


@pytest.mark.parametrize("steps", [1, 8])
def test_what_is_told_of_the_end_is_told_whole_and_over_nothing_else(steps: int) -> None:
    net = Net(
        "ring",
        (Place("p", marked=True), Place("q")),
        (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",))),
    )
    end = [f"{place} (a place and words that say what it is) waits in a transition for another" for place in "abcdef"]
    svg = ET.fromstring(draw_strip(net, frames(net, *["t", "u"][:steps] * (steps // 2 or 1)), end=end))
    lines = [text for text in svg.iter(f"{SVG}text") if text.get("class") == "end"]
    assert " ".join(text.text or "" for text in lines).split() == " ".join(end).split()
    (legend, *_) = [text for text in svg.iter(f"{SVG}text") if text.text == "fires in this step"]
    assert max(float(line.get("y", "0")) for line in lines) < float(legend.get("y", "0")) - 12
