"""Changes of signals that come faster than they are read are counted, whoever keeps them from being told."""

from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cells import decomposition_of, plant_of
from support.examples import examples

from firable.cli.watched import show_coalesced
from firable.decompose import split
from firable.executor import RunReport
from firable.executor.drivers.driver import Reading
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.acts import Acts
from firable.executor.operating.items import SignalRead
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.protocol.messages import Decision, VoteRequest
from firable.nets.text import parse_net

HANDED = split(
    parse_net("""\
firable: 1
cell: cell
controllers:
  a: {start: free, inputs: part, places: {free: , over: }}
  b: {start: idle, places: {idle: , has: }}
transitions:
  hand: {from: [a.free, b.idle], to: [a.over, b.has], if: a.part}
""")
)


@examples(100)
@given(st.booleans(), st.lists(st.booleans(), max_size=8))
def test_every_change_behind_a_promise_is_told_at_its_end_or_counted(shown: bool, values: list[bool]) -> None:
    recorder = Recorder(HANDED.net, "", None, machines=("a",))
    counted = Counter[str]()
    acts = Acts(HANDED, ("a",), MemoryJournal(), recorder, None, lambda: None, lambda *_: None, counted)
    acts.start()
    acts.hear("a", SignalRead("a.part", True, None))
    acts.hear("a", VoteRequest("a", 0, ("hand",), 0, -1))
    acts.group()
    controller = acts.controllers["a"]
    assert controller.holds("a.part")
    for value in values:
        acts.hear("a", SignalRead("a.part", value, None))
    acts.group()
    acts.hear("a", Decision("a", 0, None, 1, -1))
    acts.group()
    assert not controller.promises
    last = [True, *values][-1]
    assert bool(controller.word & controller.player.signal_bit("a.part")) is last
    changes = sum(before != after for before, after in pairwise([True, *values]))
    assert counted["a.part"] == changes - (last is not True)
    acts.hear("a", SignalRead("a.part", shown, None))  # nothing is promised now
    acts.group()
    assert counted["a.part"] == changes - (last is not True)


def test_a_run_reports_what_its_driver_has_coalesced_though_nobody_asks_for_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = {"robot.at_cv1": Reading(coalesced=2), "mc.done": Reading(), "robot.at_cv2": Reading(coalesced=1200)}
    monkeypatch.setattr(SimulatedDriver, "readings", lambda _: shown)
    report: RunReport = execute(decomposition_of("one_robot"), SimulatedCell(plant_of("one_robot"), workpieces=1))
    assert report.to_json()["coalesced"] == {"robot.at_cv1": 2, "robot.at_cv2": 1200}
    show_coalesced(report.coalesced)
    assert capsys.readouterr().out == (
        "  robot.at_cv2 changed faster than it is read: 1,200 changes told to nobody\n"
        "  robot.at_cv1 changed faster than it is read: 2 changes told to nobody\n"
    )
