"""`firable timeline`: what the machines did in a run, as a picture."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from support.host_traces import Hosts

from firable.cli.main import main
from firable.cli.timeline.axis import axis
from firable.cli.timeline.lanes import lanes, taking_part
from firable.cli.timeline.svg import draw_timeline
from firable.decompose import split
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Command, ExternalGate, Net, Place, Signal, SignalKind, TimeLimit, Transition
from firable.semantics.course import Course, course
from firable.semantics.trace import CommandSent, End, Event, Fired, Header, Noted, SignalChanged, Trace, read_trace

NS = "{http://www.w3.org/2000/svg}"
DRILL = Net(
    "drill",
    places=(
        Place("idle", marked=True),
        Place("busy", command=Command("D", "RUN"), completion="done", within=TimeLimit(2000, "late")),
        Place("stuck"),
    ),
    transitions=(
        Transition("start", ("idle",), ("busy",)),
        Transition("stop", ("busy",), ("idle",), external=(ExternalGate("done"),)),
        Transition("fail", ("busy",), ("stuck",), external=(ExternalGate("late"), ExternalGate("done", wanted=False))),
    ),
    signals=(Signal("done", kind=SignalKind.COMPLETION), Signal("late", kind=SignalKind.TIMER)),
)
GOOD: tuple[Event, ...] = (
    Fired(1.0, ("start",)),
    CommandSent(1.0, "busy"),
    SignalChanged(3.0, "done", True),
    Fired(4.0, ("stop",)),
)
BAD: tuple[Event, ...] = (
    Fired(5.0, ("start",)),
    CommandSent(5.0, "busy"),
    SignalChanged(7.0, "late", True),
    Noted(7.0, "fault", {"machine": "D"}),
)


def drilled(*events: Event, end: End | None = None) -> Course:
    return course(DRILL, Trace(Header("drill", signals=True, commands=True), events, end))


def picture(of: Course, since: float = 0.0, until: float | None = None) -> dict[str, ET.Element]:
    """The parts of a picture, by their ids."""
    root = ET.fromstring(draw_timeline(of, caption="", since=since, until=until))
    found = [part for part in root.iter() if "id" in part.attrib]
    by_id = {part.attrib["id"]: part for part in found}
    assert len(by_id) == len(found)
    return by_id


def spans(part: ET.Element) -> list[tuple[float, float]]:
    """From where to where the rectangles of a part go."""
    boxes = part.findall(f"{NS}rect")
    return [(float(box.attrib["x"]), float(box.attrib["x"]) + float(box.attrib["width"])) for box in boxes]


def test_a_stay_knows_when_its_command_was_sent_done_and_left() -> None:
    (idle, busy, again) = drilled(*GOOD, end=End(6.0, ("idle",))).stays
    assert (busy.entered_seconds, busy.sent_seconds, busy.done_seconds, busy.left_seconds) == (1.0, 1.0, 3.0, 4.0)
    assert (idle.left_seconds, idle.sent_seconds) == (1.0, None)
    assert (again.number, again.entered_seconds, again.left_seconds) == (2, 4.0, None)
    assert not busy.is_broken_off


def test_a_completion_that_a_new_token_clears_is_a_level_that_falls() -> None:
    levels = drilled(*GOOD, Fired(5.0, ("start",)), CommandSent(5.0, "busy")).levels
    assert [(level.at_seconds, level.value) for level in levels] == [(3.0, True), (5.0, False)]


def test_a_bar_ends_where_the_completion_comes_and_waiting_where_the_token_leaves() -> None:
    parts = picture(drilled(*GOOD, end=End(6.0, ("idle",))))
    ((start, done),), ((waits, left),) = spans(parts["bar:busy:1"]), spans(parts["wait:busy:1"])
    assert waits == pytest.approx(done, abs=0.1)
    assert (left - waits) * 2 == pytest.approx(done - start, abs=0.2)
    assert parts["fired:stop:1"].find(f"{NS}path") is not None
    tick = re.match(r"M([\d.]+) ", parts["fired:stop:1"].findall(f"{NS}path")[-1].attrib["d"])
    assert tick is not None
    assert float(tick[1]) == pytest.approx(left, abs=0.1)


def test_a_command_that_is_broken_off_has_a_red_end_and_one_that_is_not_done_has_none() -> None:
    broken = picture(drilled(*GOOD, *BAD, Fired(8.0, ("fail",)), end=End(9.0, ("stuck",))))
    assert broken["bar:busy:2"].find(f"{NS}path[@class='broken']") is not None
    assert broken["bar:busy:1"].find(f"{NS}path[@class='broken']") is None
    assert broken["note:1"].findtext(f"{NS}title") == "fault, machine D at 7.00 s"
    assert broken["held:stuck:1"].findtext(f"{NS}title") == "stuck: 8.00 to 9.00 s"
    cut = picture(drilled(*GOOD, *BAD))
    assert cut["bar:busy:2"].find(f"{NS}path[@class='broken']") is None
    assert "not done at the end" in (cut["bar:busy:2"].findtext(f"{NS}title") or "")


def test_only_a_run_that_ended_has_a_line_at_its_end() -> None:
    whole, cut = drilled(*GOOD, end=End(6.0, ("idle",))), drilled(*GOOD)
    assert 'class="over"' in draw_timeline(whole, caption="")
    assert 'class="over"' not in draw_timeline(cut, caption="")
    assert 'class="over"' not in draw_timeline(whole, caption="", until=5.0)


def test_two_commands_of_one_machine_at_once_get_a_row_each() -> None:
    net = Net(
        "two",
        places=(
            Place("a", marked=True),
            Place("b", marked=True),
            Place("x", command=Command("M", "X")),
            Place("y", command=Command("M", "Y")),
        ),
        transitions=(Transition("t", ("a",), ("x",)), Transition("u", ("b",), ("y",))),
    )
    events: tuple[Event, ...] = (
        Fired(0.0, ("t",)),
        CommandSent(0.0, "x"),
        Fired(1.0, ("u",)),
        CommandSent(1.0, "y"),
    )
    (lane,) = lanes(course(net, Trace(Header("two", commands=True), events, End(2.0, ("x", "y")))))
    assert [[stay.place.name for stay in row] for row in lane.rows] == [["x"], ["y"]]


def test_a_transition_is_shown_with_the_machines_that_it_is_about() -> None:
    net = catalogue_net("one_robot")
    shown = lanes(course(net, Trace.of_firings(net, [])))
    names = {t: [shown[i].machine for i in of] for t, of in taking_part(net, shown).items()}
    assert names["G9"] == ["CV2"]
    assert names["G2"] == ["R", "MC", "CV1"]
    assert names["t1-a"] == ["R"]


def test_a_run_is_cut_into_strips_without_a_gap() -> None:
    of = axis(0.0, 2600.0, [0.5, 2.0, 2.0, 10.0], 1200.0)
    assert 1 < of.strips <= 48
    assert of.strips * of.strip_seconds >= 2600.0
    pieces = list(of.pieces(50.0, 700.0))
    seconds = sum(right - left for _, left, right in pieces) / of.width_px * of.strip_seconds
    assert seconds == pytest.approx(650.0)
    assert [strip for strip, _, _ in pieces] == list(range(pieces[0][0], pieces[-1][0] + 1))
    assert list(of.pieces(2601.0, 2700.0)) == []


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bundle and the trace of a run of a hundred workpieces."""
    here = tmp_path_factory.mktemp("timeline")
    assert main(["bundle", "catalogue:one_robot", "-o", str(here / "b")]) == 0
    assert main(["run", str(here / "b"), "--workpieces", "100", "--trace", str(here / "t")]) == 0
    return here


def test_a_run_of_a_hundred_workpieces_is_drawn_whole_and_the_same_each_time(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["timeline", str(folder / "t"), "--net", str(folder / "b"), "-o", "-"]
    assert main(command) == 0
    drawn = capsys.readouterr().out
    assert main(command) == 0
    assert drawn == capsys.readouterr().out
    ids = re.findall(r'id="(\w+):([^"]*)"', drawn)
    read = read_trace(folder / "t")
    sent = [event.place for event in read.events if isinstance(event, CommandSent)]
    assert sorted(name.rpartition(":")[0] for kind, name in ids if kind == "bar") == sorted(sent)
    fired = [event.transitions[0] for event in read.events if isinstance(event, Fired)]
    assert sorted(name.rpartition(":")[0] for kind, name in ids if kind == "fired") == sorted(fired)
    assert len(drawn) < 10**6


def test_a_part_of_a_run_is_drawn_by_its_times(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["timeline", str(folder / "t"), "--net", str(folder / "b"), "-o", "-"]
    assert main([*command, "--from", "100", "--to", "130"]) == 0
    drawn = capsys.readouterr().out
    assert ">100 s<" in drawn
    assert 0 < drawn.count('id="bar:') < 40
    assert main([*command, "--from", "9000"]) == 2
    assert "the run ends at" in capsys.readouterr().err


def test_the_traces_of_several_hosts_make_one_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = []
    for trace in Hosts(split(catalogue_net("one_robot")), 1).run(600):
        path = tmp_path / (trace.header.machines[0] or "coordinator")
        path.write_text("".join(f"{line}\n" for line in trace.lines()), "utf-8")
        paths.append(str(path))
    assert main(["timeline", *paths, "--net", "catalogue:one_robot", "-o", "-"]) == 0
    assert 'id="lane:robot:R"' in capsys.readouterr().out


def test_a_trace_without_commands_has_no_timeline(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = catalogue_net("one_robot")
    path = tmp_path / "t"
    path.write_text("".join(f"{line}\n" for line in Trace.of_firings(net, [["G1"]]).lines()), "utf-8")
    assert main(["timeline", str(path), "--net", "catalogue:one_robot", "-o", "-"]) == 2
    assert "F5006" in capsys.readouterr().err
    header = Header("philosophers-3", commands=True)
    path.write_text("".join(f"{line}\n" for line in Trace(header, ()).lines()), "utf-8")
    assert main(["timeline", str(path), "--net", "catalogue:philosophers-3", "-o", "-"]) == 2
    assert "commands a machine" in capsys.readouterr().err


def test_a_trace_of_another_net_is_not_drawn(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["timeline", str(folder / "t"), "--net", "catalogue:two_cells", "-o", "-"]) != 0
    assert "F5004" in capsys.readouterr().err
