"""What a run did, in the formats of other tools: each is read back by its published rules, and tells the same run."""

import json
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import pytest
from support.xes_rules import problems

from firable.cli.main import main
from firable.nets.catalogue import catalogue_net
from firable.semantics.course import Course, course
from firable.semantics.trace import read_trace

XES = "{http://www.xes-standard.org/}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the trace of a run in every format."""
    here = tmp_path_factory.mktemp("formats")
    assert main(["bundle", "catalogue:one_robot", "-o", str(here / "b")]) == 0
    assert main(["run", str(here / "b"), "--workpieces", "5", "--trace", str(here / "t")]) == 0
    for name in ("run.vcd", "run.perfetto.json", "run.xes"):
        assert main(["timeline", str(here / "t"), "--net", str(here / "b"), "-o", str(here / name)]) == 0
    return here


@pytest.fixture(scope="module")
def run(folder: Path) -> Course:
    return course(catalogue_net("one_robot"), read_trace(folder / "t"))


def test_vcd_read_back_tells_how_long_each_token_stayed(folder: Path, run: Course) -> None:
    words = (folder / "run.vcd").read_text("ascii").split()
    head, body = words[: words.index("$enddefinitions")], words[words.index("$enddefinitions") + 2 :]
    scope, names = list[str](), dict[str, str]()
    for k, word in enumerate(head):
        if word == "$scope":
            scope.append(head[k + 2])
        elif word == "$upscope":
            scope.pop()
        elif word == "$var":
            assert head[k + 1] in {"wire", "event"}
            assert head[k + 5] == "$end"
            assert head[k + 3] not in names
            names[head[k + 3]] = ".".join((*scope, head[k + 4]))
    assert scope == []
    now, times, changes = 0, list[int](), list[tuple[int, str, int]]()
    for word in body:
        if word.startswith("#"):
            now = int(word[1:])
            times.append(now)
        elif not word.startswith("$"):
            changes.append((now, names[word[1:]], int(word[0])))
    assert times == sorted(set(times))
    stays = Counter[tuple[str, int, int]]()
    for stay in run.stays:
        owner, _, name = stay.place.name.partition(".")
        stays[f"one-robot.{owner}.places.{name}", round(stay.entered_seconds * 1e9), 1] += 1
        if stay.left_seconds is not None:
            stays[f"one-robot.{owner}.places.{name}", round(stay.left_seconds * 1e9), 0] += 1
    initial = len(run.net.places) - run.net.initial_marking.bit_count()
    told = Counter((name, at, value) for at, name, value in changes if ".places." in name)
    assert (stays - told).total() == 0
    assert (told - stays).total() == initial
    fired = Counter(name.rpartition(".")[2] for _, name, _ in changes if ".transitions." in name)
    assert fired == Counter(firing.transition for firing in run.firings)
    last = {(name, at): value for at, name, value in changes if ".machines." in name}  # of one instant, as viewers do
    told_work = [(name, at, value) for (name, at), value in last.items() if at and value != _before(last, name, at)]
    assert sorted(told_work) == sorted((name, at, value) for at, name, value in _at_work(run))
    assert all(value == 0 for (_, at), value in last.items() if at == 0)


def _before(last: dict[tuple[str, int], int], name: str, at: int) -> int:
    """The value of a wire before an instant."""
    return last[max(of for of in last if of[0] == name and of[1] < at)]


def _at_work(run: Course) -> Iterator[tuple[int, str, int]]:
    """When each machine begins to work and ceases, by its commands: one that follows at once leaves it at work."""
    spans: dict[str, list[tuple[int, int]]] = {}
    for stay in run.stays:
        if stay.sent_seconds is not None and stay.done_seconds is not None and stay.place.command is not None:
            name = f"one-robot.{stay.place.owner}.machines.{stay.place.command.machine}"
            spans.setdefault(name, []).append((round(stay.sent_seconds * 1e9), round(stay.done_seconds * 1e9)))
    for name, those in spans.items():
        those.sort()
        begins, ends = {start for start, _ in those}, {end for _, end in those}
        yield from ((at, name, 1) for at in begins - ends)
        yield from ((at, name, 0) for at in ends - begins)


def test_perfetto_read_back_tells_each_command_and_nests_what_is_on_a_thread(folder: Path, run: Course) -> None:
    events = json.loads((folder / "run.perfetto.json").read_text("utf-8"))["traceEvents"]
    assert {event["ph"] for event in events} <= {"M", "X", "b", "e", "i", "C"}
    spans = [event for event in events if event["ph"] == "X"]
    told = {(e["args"]["place"], e["args"]["number"]): (e["ts"], e["dur"]) for e in spans if e["cat"] == "command"}
    sent = {(s.place.name, s.number): s for s in run.stays if s.sent_seconds is not None}
    assert told.keys() == sent.keys()
    for key, (start, took) in told.items():
        stay = sent[key]
        done = stay.sent_seconds if stay.place.completion is None else stay.done_seconds
        assert (start / 1e6, (start + took) / 1e6) == pytest.approx((stay.sent_seconds, done), abs=2e-9)
    by_thread: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for event in spans:
        by_thread.setdefault((event["pid"], event["tid"]), []).append((event["ts"], event["ts"] + event["dur"]))
    for those in by_thread.values():
        those.sort()
        assert all(end <= start + 1e-2 for (_, end), (start, _) in pairwise(those))
    assert {(e["pid"], e["tid"]) for e in spans} <= {(e["pid"], e["tid"]) for e in events if e["ph"] == "M"}


def test_xes_read_back_tells_each_command_once_and_its_cases_are_cycles(folder: Path, run: Course) -> None:
    log = ET.parse(folder / "run.xes").getroot()
    assert list(problems(log)) == []
    started = Counter[str]()
    for case in log.iter(f"{XES}trace"):
        assert [flag.attrib["value"] for flag in case.findall(f"{XES}boolean")] == ["true"]
        times = []
        for event in case.findall(f"{XES}event"):
            said = {part.attrib["key"]: part.attrib["value"] for part in event}
            times.append(datetime.fromisoformat(said["time:timestamp"]))
            started[said["concept:name"]] += said["lifecycle:transition"] == "start"
        assert times == sorted(times)
    cases = Counter(_name(case).rpartition(" ")[0] for case in log.iter(f"{XES}trace"))
    assert (cases["robot"], cases["mc"]) == (10, 5)  # of five workpieces, each loaded and unloaded, and machined once
    assert +started == Counter(stay.place.name for stay in run.stays if stay.sent_seconds is not None)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("1849.2016", "1849-2016", "log has xes.version='1849-2016'"),
        ('xes.version="1849.2016"', "", "log lacks xes.version"),
        ('"ActivityAndLifecycle"', '"Activity and lifecycle"', "classifier has name='Activity and lifecycle'"),
        ('keys="concept:name lifecycle', 'keys="org:resource lifecycle', "uses what is not global"),
        ('scope="trace"', 'scope="case"', "global has scope='case'"),
        ('"Organizational" prefix="org"', '"Organizational" prefix="people"', "org:resource is of no extension"),
        ("<trace>", '<string key="late" value=""/><trace>', ""),
        ("  <trace>", '  <trace><event/></trace><string key="late" value=""/><trace>', "string stands too late in log"),
        ("<event>", "<event><event/>", "event stands in event"),
        ("<event>", '<event when="now">', "event has an attribute when"),
        ("<event>", "<event>now", "event has text"),
        ("<date key", "<string key", "time:timestamp is no date"),
        ('+00:00"/>', '+00"/>', "date has value="),
        ('value="start"', 'value="begin"', "begin is no transition of the standard lifecycle"),
        ('value="true"', 'value="yes"', "boolean has value='yes'"),
        ('<string key="concept:name" value="G', '<string key="name" value="G', "lacks the global attribute concept"),
        ("      <date", '      <string key="concept:name" value=""/><date', "event has concept:name twice"),
        ('key="command"', 'key="a command"', "string has key='a command'"),
        ("http://www.xes-standard.org/\"", 'http://example.org/"', "the root is"),
    ],
)  # fmt: skip
def test_a_log_that_breaks_a_rule_of_xes_is_found(folder: Path, old: str, new: str, problem: str) -> None:
    text = (folder / "run.xes").read_text("utf-8")
    assert old in text
    found = list(problems(ET.fromstring(text.replace(old, new, 1))))
    assert bool(found) == bool(problem)
    assert not problem or any(re.search(problem, one) for one in found), found


def _name(case: ET.Element) -> str:
    return next(part.attrib["value"] for part in case if part.attrib["key"] == "concept:name")


def test_a_note_that_is_no_text_goes_into_every_format(folder: Path, tmp_path: Path) -> None:
    header, *rest = (folder / "t").read_text("utf-8").splitlines()
    note = r'{"at": 0, "note": "fault", "message": "half of a pair: \ud800"}'
    trace = tmp_path / "noted.trace.jsonl"
    trace.write_text("\n".join((header, note, *rest)) + "\n", "utf-8")
    for name in ("run.svg", "run.vcd", "run.perfetto.json", "run.xes"):
        assert main(["timeline", str(trace), "--net", str(folder / "b"), "-o", str(tmp_path / name)]) == 0


def test_what_a_format_cannot_carry_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("run.vcd", "run.perfetto.json", "run.xes"):
        assert main(["timeline", str(folder / "t"), "--net", str(folder / "b"), "-o", str(folder / name)]) == 0
        assert "note: not carried: " in capsys.readouterr().err
    assert main(["timeline", "t", "--net", "n", "-o", "run.csv"]) == 2
    assert main(["timeline", "t", "--net", "n", "-o", "run.vcd", "--from", "1"]) == 2
