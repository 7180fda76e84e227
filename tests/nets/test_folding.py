"""Folded and wrapped pictures: what a task takes in, what stays to be seen, and that nothing is lost on the way."""

import xml.etree.ElementTree as ET
from urllib.parse import quote

import pytest
from hypothesis import given
from support.examples import examples
from support.whole_nets import whole_nets

from firable.nets.catalogue import catalogue_net
from firable.nets.drawing import draw_net
from firable.nets.drawing.folding import fold, tasks
from firable.nets.drawing.part import taking_part
from firable.nets.net import Net

SVG = "{http://www.w3.org/2000/svg}"


def ids(svg: ET.Element, kind: str) -> list[str]:
    return [found for one in svg.iter() if (found := one.get("id", "")).startswith(f"{kind}:")]


def classes(svg: ET.Element, id_: str) -> list[str | None]:
    group = next(one for one in svg.iter() if one.get("id") == id_)
    return [one.get("class") for one in group.iter(f"{SVG}circle")]


def test_a_task_is_what_a_controller_does_until_it_is_idle_again() -> None:
    net = catalogue_net("one_robot")
    found = tasks(net)
    assert ("robot.to_cv1", "robot.grasp_cv1", "robot.to_mc", "robot.put_mc", "robot.back") in found
    assert ("robot.to_mc_empty", "robot.grasp_mc", "robot.to_cv2", "robot.put_cv2") in found
    assert not any("robot.free" in task for task in found)


def test_a_controller_names_all_its_tasks_and_a_place_the_one_it_is_in() -> None:
    net = catalogue_net("one_robot")
    assert set(fold(net, ["robot"]).members) == {"robot.to_cv1", "robot.to_mc_empty"}
    assert set(fold(net, ["robot.put_mc"]).members) == {"robot.to_cv1"}
    assert set(fold(net, ["robot.free"]).members) == set()
    assert len(fold(net, ["all"]).net.places) == 10
    with pytest.raises(KeyError):
        fold(net, ["robt"])


def test_local_transitions_inside_a_task_go_and_global_ones_keep_their_part() -> None:
    net = catalogue_net("one_robot")
    svg = ET.fromstring(draw_net(net, folded=["robot"]))
    shown = {one.split(":")[1] for one in ids(svg, "transition")}
    assert {t.name for t in net.transitions} - shown == {"t1-a", "t1-b", "t1-c", "t1-d"}
    # G3 moves the robot's token inside the task: it has a bar in the box of the robot, and no arc there.
    assert not {"input:G3:robot.to_cv1", "output:G3:robot.to_cv1"} & {one.get("id") for one in svg.iter()}
    robot = next(one for one in svg.iter() if one.get("id") == "lane:robot")
    left, width = float(robot.get("x", "")), float(robot.get("width", ""))
    g3 = next(one for one in svg.iter() if one.get("id") == "transition:G3")
    assert any(left < float(bar.get("x", "")) < left + width for bar in g3.iter(f"{SVG}rect"))


@pytest.mark.parametrize("name", ["one_robot", "two_cells", "two_robots_shared", "philosophers-4", "machines-2"])
def test_a_global_transition_has_a_bar_in_the_box_of_each_who_takes_part_in_it(name: str) -> None:
    net = catalogue_net(name)
    for folded in ([], ["all"]):
        svg = ET.fromstring(draw_net(net, folded=folded))
        boxes = {str(one.get("id")): one for one in svg.iter() if one.get("id", "").startswith("lane:")}
        for t in fold(net, folded).net.transitions:
            group = next(one for one in svg.iter() if one.get("id") == f"transition:{t.name}")
            bars = [float(bar.get("x", "")) for bar in group.iter(f"{SVG}rect")]
            for owner in taking_part(net, net.transition(t.name)):
                box = boxes[f"lane:{owner}"]
                left, width = float(box.get("x", "")), float(box.get("width", ""))
                assert any(left < x < left + width for x in bars), (t.name, owner)


def test_a_folded_task_is_a_double_circle_and_holds_the_token_of_any_place_in_it() -> None:
    net = catalogue_net("one_robot")
    marking = net.initial_marking & ~net.marking(["robot.free"]) | net.marking(["robot.put_mc"])
    svg = ET.fromstring(draw_net(net, folded=["robot"], marking=marking))
    assert classes(svg, "place:robot.to_cv1") == ["macro", "macro", "token"]
    assert classes(svg, "place:robot.to_mc_empty") == ["macro", "macro"]
    assert classes(svg, "place:robot.free") == ["place"]


def test_some_controllers_alone_show_their_places_and_their_parts_with_who_else_takes_part() -> None:
    net = catalogue_net("two_cells")
    svg = ET.fromstring(draw_net(net, owners=["robot_a", "machine_a"]))
    assert set(ids(svg, "lane")) == {"lane:robot_a", "lane:machine_a"}
    assert {one.removeprefix("place:").split(".")[0] for one in ids(svg, "place")} == {"robot_a", "machine_a"}
    taking = {f"transition:{t.name}" for t in net.transitions if taking_part(net, t) & {"robot_a", "machine_a"}}
    assert set(ids(svg, "transition")) == taking
    load = next(one for one in svg.iter() if one.get("id") == "transition:load_a")
    words = [text.text for text in load.iter(f"{SVG}text")]
    assert words == ["load_a", "start of loading MA", "also cell_a, conveyors"]


def test_a_controller_alone_keeps_the_order_of_the_work_of_the_whole() -> None:
    """Found by a line of cells: without what lies between, all its belts began at once, each on tracks of its own."""
    net = catalogue_net("two_cells")
    svg = ET.fromstring(draw_net(net, owners=["conveyors"]))
    bars = {str(one.get("id")).split(":")[1]: one for one in svg.iter() if one.get("id", "").startswith("transition:")}
    height = {name: float(next(bar.iter(f"{SVG}rect")).get("y", "")) for name, bar in bars.items()}
    work = ["enter", "load_a", "fetched_a", "placed_a", "load_b", "fetched_b", "placed_b", "leave"]
    assert sorted(work, key=height.__getitem__) == work


def test_a_task_of_a_controller_alone_is_folded_and_what_it_shares_stays() -> None:
    net = catalogue_net("two_cells")
    alone, whole = (ET.fromstring(draw_net(net, owners=some, folded=["all"])) for some in (["robot_a"], None))
    of_robot = {one for one in ids(whole, "place") if one.startswith("place:robot_a.")}
    assert set(ids(alone, "place")) == of_robot
    assert len(of_robot) < 7
    shared = {f"transition:{t.name}" for t in net.transitions if {"robot_a"} < taking_part(net, t)}
    assert shared <= set(ids(alone, "transition"))


@examples(30)
@given(whole_nets())
def test_every_net_can_be_folded_and_wrapped_and_shows_all_the_rest_once(net: Net) -> None:
    folded = fold(net, ["all"])
    svg = ET.fromstring(draw_net(net, folded=["all"], width_max=300))
    everything = [found for one in svg.iter() if (found := one.get("id"))]
    assert len(set(everything)) == len(everything)
    assert set(ids(svg, "place")) == {f"place:{quote(place.name)}" for place in folded.net.places}
    shown = {":".join(one.split(":")[:2]) for one in ids(svg, "transition")}
    assert shown == {f"transition:{quote(t.name)}" for t in folded.net.transitions}
    inside = {name for members in folded.members.values() for name in members}
    assert {place.name for place in net.places} == {place.name for place in folded.net.places} | inside


def test_lanes_that_are_too_wide_go_on_below_with_the_parts_of_their_transitions() -> None:
    net = catalogue_net("two_cells")
    plain, narrow = (ET.fromstring(draw_net(net, width_max=width)) for width in (None, 1700))
    assert float(narrow.get("width", "")) <= 1700 < float(plain.get("width", ""))
    for kind in ("place", "lane", "input", "output", "gate"):
        assert sorted(ids(narrow, kind)) == sorted(ids(plain, kind))
    again = {one for one in ids(narrow, "transition") if one.count(":") == 2}
    assert again == {"transition:load_a:2", "transition:fetched_a:2", "transition:placed_a:2"}
    below = next(one for one in narrow.iter() if one.get("id") == "transition:load_a:2")
    assert [text.text for text in below.iter(f"{SVG}text")][-2:] == ["also cell_a,", "machine_a, robot_a"]
