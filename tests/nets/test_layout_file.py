"""Layout files: a picture keeps its arrangement while the net changes, and a bad file is one clear error."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from support.examples import examples
from support.whole_nets import whole_nets

from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.nets.diagnostics import InputError
from firable.nets.drawing import draw_net
from firable.nets.drawing.arrangement import Arrangement
from firable.nets.drawing.layout import arranged, layout
from firable.nets.drawing.layout_file import format_layout, layout_path, parse_layout, vanished
from firable.nets.drawing.shapes import RADIUS
from firable.nets.net import Net, Place, Transition

NET = """\
firable: 1
cell: demo
controllers:
  robot:
    start: free
    places: {free: , busy: }
  belt:
    start: empty
    places: {empty: , full: }
transitions:
  take: {from: [robot.free, belt.full], to: [robot.busy, belt.empty]}
  done: {from: robot.busy, to: robot.free}
  bring: {from: belt.empty, to: belt.full}
"""


@examples(15)
@given(whole_nets())
def test_a_net_drawn_by_its_own_layout_file_looks_the_same(net: Net) -> None:
    kept = parse_layout(format_layout(arranged(net)))
    assert draw_net(net, given=kept) == draw_net(net)


def test_lanes_rows_and_tracks_are_those_of_the_file() -> None:
    net = catalogue_net("one_robot")
    own = arranged(net)
    turned = Arrangement(own.lanes[::-1], {name: -row for name, row in own.rows.items()}, own.tracks)
    where = layout(net, parse_layout(format_layout(turned)))
    assert [lane.owner for lane in where.lanes] == list(own.lanes[::-1])
    heights = [bar.y for bar in where.bars]
    assert sorted(range(len(heights)), key=heights.__getitem__) == sorted(
        range(len(heights)), key=lambda t: -own.rows[net.transitions[t].name]
    )


def test_what_is_new_is_put_in_and_the_rest_stays_in_its_order() -> None:
    net = catalogue_net("one_robot")
    kept = arranged(net)
    more = replace(
        net,
        places=(*net.places, Place("robot.washing", "robot")),
        transitions=(
            *net.transitions,
            Transition("wash", ("robot.free",), ("robot.washing",)),
            Transition("washed", ("robot.washing",), ("robot.free",)),
        ),
    )
    now = arranged(more, kept)
    assert now.lanes == kept.lanes
    assert sorted(kept.rows, key=lambda name: (kept.rows[name], name)) == sorted(
        kept.rows, key=lambda name: (now.rows[name], name)
    )
    before = [track for tracks in kept.tracks.values() for track in tracks]
    after = [track for tracks in now.tracks.values() for track in tracks]
    for track in before:
        assert any(set(track) <= set(one) for one in after)


@examples(15)
@given(whole_nets(), whole_nets())
def test_the_layout_of_another_net_spoils_no_picture(net: Net, other: Net) -> None:
    where = layout(net, arranged(other))
    assert {lane.owner for lane in where.lanes} == {lane.owner for lane in layout(net).lanes}
    pieces = [(bar.y, segment) for bar in where.bars for segment in bar.segments]
    for i, (y, (start, end)) in enumerate(pieces):
        assert all(y != v or end < left or right < start for v, (left, right) in pieces[:i])
    spots = [(spot.x, spot.y) for spot in where.places]
    assert len(set(spots)) == len(spots)


@examples(30)
@given(whole_nets())
def test_a_file_that_puts_all_places_of_a_lane_into_one_track_is_followed_as_far_as_lines_allow(net: Net) -> None:
    owners = {place.owner for place in net.places}
    crowded = {owner: (tuple(place.name for place in net.places if place.owner == owner),) for owner in owners}
    where = layout(net, Arrangement(tracks=crowded))
    for edge in where.edges:
        low, high = sorted((where.places[edge.place].y, where.bars[edge.transition].y))
        for p, other in enumerate(where.places):
            assert p == edge.place or not (abs(other.x - edge.x) < RADIUS + 3 and low < other.y < high)
    assert len({(spot.x, spot.y) for spot in where.places}) == len(where.places)


def test_names_that_have_vanished_are_said() -> None:
    net = catalogue_net("one_robot")
    (note,) = vanished(Arrangement(("gone",), {"G1": 1, "G77": 2}), net, "cell.layout.yaml")
    assert "the controller 'gone', the transition 'G77'" in str(note)
    assert note.code == "F1021"
    assert vanished(arranged(net), net, "cell.layout.yaml") == ()


@pytest.mark.parametrize(
    ("text", "code", "words", "line"),
    [
        ("firable_layout: 2\n", "F1011", "write `firable_layout: 1`", 1),
        ("rows: []\n", "F1009", "the key 'firable_layout' is missing", 1),
        ("firable_layout: 1\nlnes: []\n", "F1008", "unknown key 'lnes'\nlnes: []\ndid you mean 'lanes'?", 2),
        ("firable_layout: 1\nlanes: [{track: []}]\n", "F1008", "did you mean 'tracks'?", 2),
        ("firable_layout: 1\nrows:\n- [G1]\n- [G2, G1]\n", "F1021", "'G1' stands here a second time", 4),
        ("firable_layout: 1\nlanes:\n- owner: a\n- owner: a\n", "F1021", "'a' stands here a second time", 4),
        ("firable_layout: 1\nrows: G1\n", "F1010", "a list is expected: `[name, name]`", 2),
    ],
)
def test_a_bad_layout_file_is_refused_with_its_place(text: str, code: str, words: str, line: int) -> None:
    with pytest.raises(InputError) as refused:
        parse_layout(text)
    (found,) = refused.value.diagnostics
    assert found.code == code
    assert words in f"{found.message}\n{found.span and found.span.excerpt}\n{found.hint}"
    assert found.span is not None
    assert found.span.line == line


def test_a_layout_is_kept_beside_the_net_and_read_the_next_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "cell.firable.yaml"
    file.write_text(NET)
    assert main(["draw", str(file), "--keep-layout"]) == 0
    first = capsys.readouterr().out
    beside = layout_path(file)
    assert main(["draw", str(file)]) == 0
    assert capsys.readouterr().out == first
    beside.write_text(beside.read_text().replace("rows:\n- [bring]\n", "rows:\n") + "- [bring]\n- [lost]\n")
    assert main(["draw", str(file)]) == 0
    done = capsys.readouterr()
    assert done.out != first
    assert "the transition 'lost'" in done.err
    beside.write_text("- broken\n")
    assert main(["draw", str(file), "-o", str(tmp_path / "x.svg")]) == 2
    assert "error[F1010]" in capsys.readouterr().err
    assert not (tmp_path / "x.svg").exists()
    for bad in ("# nothing\n", "firable_layout: 1\nrows:\n- [bring, bring]\n"):
        beside.write_text(bad)
        assert main(["draw", str(file), "--keep-layout", "-o", str(tmp_path / "x.svg")]) == 2
        assert "delete it and have `firable draw NET --keep-layout` write it anew" in capsys.readouterr().err
        assert beside.read_text() == bad, "what a person wrote is not overwritten"
    beside.unlink()
    assert main(["draw", str(file), "--keep-layout", "-o", str(tmp_path / "x.svg")]) == 0
    assert beside.exists()
    assert main(["draw", "catalogue:one_robot", "--keep-layout", "-o", str(tmp_path / "x.svg")]) == 2
    assert "a net of the catalogue has none" in capsys.readouterr().err
