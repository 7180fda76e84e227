"""`firable draw`: the reachability graph as the engine knows it, placed by firable or by Graphviz."""

import shutil
import sys
import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path

import pytest

from firable.cli.main import main

SVG = "{http://www.w3.org/2000/svg}"


def picture(capsys: pytest.CaptureFixture[str], *arguments: str) -> ET.Element:
    assert main(["draw", *arguments]) == 0
    return ET.fromstring(capsys.readouterr().out)


def ids(svg: ET.Element, kind: str) -> set[str]:
    return {found for one in svg.iter() if (found := one.get("id", "")).startswith(f"{kind}:")}


def flags(svg: ET.Element) -> list[str | None]:
    return [text.text for text in svg.iter(f"{SVG}text") if text.get("class") == "flag"]


def caption(svg: ET.Element) -> str:
    return next(text.text or "" for text in svg.iter(f"{SVG}text") if text.get("class") == "subtitle")


@pytest.mark.parametrize(
    "layout",
    ["layered", pytest.param("dot", marks=pytest.mark.skipif(not shutil.which("dot"), reason="needs Graphviz"))],
)
def test_the_graph_shows_every_marking_and_firing_of_the_cell_that_deadlocks(
    layout: str, capsys: pytest.CaptureFixture[str]
) -> None:
    svg = picture(capsys, "catalogue:one_robot_mc_late", "--what", "graph", "--layout", layout)
    assert ids(svg, "marking") == {f"marking:{i}" for i in range(76)}
    assert len(ids(svg, "firing")) == 154
    assert (flags(svg).count("deadlock"), flags(svg).count("doomed")) == (1, 35)
    assert caption(svg) == "76 markings and 154 edges, one transition at a time"


def test_the_graph_of_a_large_net_says_how_much_of_it_is_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    svg = picture(capsys, "catalogue:philosophers-6", "--what", "graph", "--max-markings", "20")
    assert len(ids(svg, "marking")) == 20
    assert caption(svg) == "198 markings and 768 edges, one transition at a time; drawn: the 20 nearest to M0"
    texts = [text.text or "" for text in svg.iter(f"{SVG}text")]
    more = [int(text.split()[0]) for text in texts if text.endswith(" more")]
    assert sum(more) > 0


def test_of_a_net_too_large_to_explore_nothing_is_said_to_be_doomed(capsys: pytest.CaptureFixture[str]) -> None:
    svg = picture(capsys, "catalogue:philosophers-16", "--what", "graph", "--max-markings", "5")
    assert caption(svg).startswith("more than 200,000 markings")
    assert "which of them are doomed is not known" in caption(svg)
    assert "doomed" not in flags(svg)


def test_the_graph_of_steps_names_what_fires_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    svg = picture(capsys, "catalogue:conceptual_one_robot", "--what", "graph", "--discipline", "step")
    words = {text.text for text in svg.iter(f"{SVG}text") if text.get("class") == "firing"}
    assert {"t1 + t3", "t2 + t6"} <= words
    assert caption(svg) == "6 markings and 6 edges, in synchronous steps"


LAYOUTERS = [
    "layered",
    pytest.param("dot", marks=pytest.mark.skipif(not shutil.which("dot"), reason="needs Graphviz")),
    pytest.param("elk", marks=pytest.mark.skipif(find_spec("py_mini_racer") is None, reason="needs firable[layout]")),
]


@pytest.mark.parametrize("layout", LAYOUTERS)
def test_a_net_is_placed_without_lanes_with_all_that_is_of_it(layout: str, capsys: pytest.CaptureFixture[str]) -> None:
    lanes = picture(capsys, "catalogue:conceptual_two_robots")
    svg = picture(capsys, "catalogue:conceptual_two_robots", "--layout", layout)
    for kind in ("place", "transition", "input", "output"):
        assert ids(svg, kind) == ids(lanes, kind)
    circles = [one for one in svg.iter(f"{SVG}circle") if one.get("class") == "place"]
    spots = {(one.get("cx"), one.get("cy")) for one in circles}
    assert len(spots) == len(ids(svg, "place")) + 1  # and in the legend


@pytest.mark.skipif(find_spec("py_mini_racer") is None, reason="needs firable[layout]")
def test_a_graph_is_placed_by_elk(capsys: pytest.CaptureFixture[str]) -> None:
    svg = picture(capsys, "catalogue:philosophers-2", "--what", "graph", "--layout", "elk")
    assert len(ids(svg, "marking")) == 6
    assert flags(svg).count("deadlock") == 1


def test_elk_that_is_missing_is_one_clear_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "py_mini_racer", None)
    assert main(["draw", "catalogue:conceptual_one_robot", "--layout", "elk"]) == 2
    assert "pip install 'firable[layout]'" in capsys.readouterr().err.replace("\n", " ")


def fake_dot(folder: Path, script: str) -> str:
    (folder / "dot").write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    (folder / "dot").chmod(0o755)
    return str(folder)


@pytest.mark.parametrize(
    ("script", "words"),
    [
        (None, "no program 'dot' is on the PATH"),
        ("cat >/dev/null; echo out of ink >&2; exit 3", "Graphviz fails: out of ink"),
    ],
)
def test_a_graphviz_that_is_missing_or_fails_is_one_clear_error(
    script: str | None,
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = str(tmp_path) if script is None else f"{fake_dot(tmp_path, script)}:/usr/bin:/bin"
    monkeypatch.setenv("PATH", path)
    assert main(["draw", "catalogue:conceptual_one_robot", "--what", "graph", "--layout", "dot"]) == 2
    assert words in capsys.readouterr().err.replace("\n", " ")


def test_the_coordinator_of_a_cell_is_drawn_from_its_split(capsys: pytest.CaptureFixture[str]) -> None:
    svg = picture(capsys, "catalogue:two_cells", "--what", "coordinator")
    assert ids(svg, "coordinator") >= {"coordinator:line", "coordinator:cell_a", "coordinator:cell_b"}
    assert caption(svg) == "Coordinator diagram: 12 global transitions of 7 controllers"


def test_a_counterexample_is_drawn_step_by_step_with_what_its_end_waits_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = "catalogue:philosophers-2"
    assert main(["check", net, "--trace-dir", str(tmp_path), "--no-cache"]) == 1
    capsys.readouterr()
    svg = picture(capsys, net, "--what", "strip", "--trace", str(tmp_path / "deadlock-free.trace.jsonl"))
    assert ids(svg, "fired") == {"fired:1:p1_takes_left", "fired:2:p2_takes_left"}
    said = " ".join(text.text or "" for text in svg.iter(f"{SVG}text") if text.get("class") == "end")
    assert said.startswith("Deadlock: no transition is firable.")
    assert "p2.left waits in p2_takes_right for p1.fork" in said
