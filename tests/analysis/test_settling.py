"""Verdicts settled one by one: who is asked what they know, and who goes on when asked again."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Event
from typing import ClassVar

import pytest

from firable.analysis import check as checking
from firable.analysis import settling
from firable.analysis.check import check
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.methods import Anew, Method, Technique
from firable.analysis.question import Known, yes
from firable.analysis.settling import Settling
from firable.analysis.spaces.reachability import Budget
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net
from firable.nets.verdict import Status

NET = catalogue_net("one_robot")
MEMORY_BYTES = 1 << 20


class Slow:
    """Knows whether the net is live when it is asked for the third time."""

    made: ClassVar[list[Slow]] = []

    def __init__(self, net: Net) -> None:
        assert net is NET
        self.asked = 0
        self.made.append(self)

    def __call__(self, limits: Limits) -> Mapping[str, Known]:
        assert limits.memory_bytes == MEMORY_BYTES
        self.asked += 1
        return {"live": Known(yes(), "slowly")} if self.asked == 3 else {}


def forgetful(net: Net, limits: Limits) -> Mapping[str, Known]:
    assert net is NET
    FORGETFUL.append(limits)
    return {}


FORGETFUL: list[Limits] = []
ASKED = {
    Method.REDUCTION: Technique("slow", f"{__name__}:Slow"),
    Method.STRUCTURE: Anew("forgetful", f"{__name__}:forgetful"),
}


def test_who_goes_on_is_asked_again_with_the_time_that_is_left_and_who_begins_anew_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Slow.made.clear()
    FORGETFUL.clear()
    monkeypatch.setattr(settling, "KNOWERS", ASKED)
    monkeypatch.setattr(settling, "WORTH_ASKING", {})
    one = Settling(NET, (), MEMORY_BYTES, Event())
    one.learn_on({"live"}, NEVER)
    assert Slow.made == []
    for of in (*ASKED, *ASKED):
        one.learn(of, {"live"}, NEVER)
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([2], 2)
    one.learn_on({"live"}, Deadline.after(0))
    assert not one.found
    one.learn_on({"live"}, NEVER)
    one.learn_on({"live"}, NEVER)  # it is known
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([3], 2)
    assert one.found["live"].method == "slowly"


def test_what_is_open_when_all_others_have_done_is_asked_of_who_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    Slow.made.clear()
    monkeypatch.setattr(settling, "KNOWERS", ASKED | {Method.COMPACT: ASKED[Method.STRUCTURE]})
    monkeypatch.setattr(settling, "WORTH_ASKING", {})
    monkeypatch.setattr(checking, "SPACES", {})
    monkeypatch.setattr(checking, "GOAL_LANES", ())
    live = check(NET, budget=Budget(5, MEMORY_BYTES, seconds=60)).verdict("live")
    assert (live.status, live.method) == (Status.PROVED, "slowly")
    assert [slow.asked for slow in Slow.made] == [3]
