"""Verdicts settled one by one: who is asked what they know, and who goes on when asked again."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Event
from typing import ClassVar

import pytest

from firable.analysis import settling
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.methods import Anew, Method, Technique
from firable.analysis.question import Known, yes
from firable.analysis.settling import Settling
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Net

NET = catalogue_net("one_robot")


class Slow:
    """Knows whether the net is live when it is asked for the third time."""

    made: ClassVar[list[Slow]] = []

    def __init__(self, net: Net) -> None:
        assert net is NET
        self.asked = 0
        self.made.append(self)

    def __call__(self, limits: Limits) -> Mapping[str, Known]:
        assert limits.memory_bytes == 1 << 20
        self.asked += 1
        return {"live": Known(yes(), "slowly")} if self.asked == 3 else {}


def forgetful(net: Net, limits: Limits) -> Mapping[str, Known]:
    assert net is NET
    FORGETFUL.append(limits)
    return {}


FORGETFUL: list[Limits] = []


def test_who_goes_on_is_asked_again_with_the_time_that_is_left_and_who_begins_anew_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Slow.made.clear()
    FORGETFUL.clear()
    knowers = {
        Method.REDUCTION: Technique("slow", f"{__name__}:Slow"),
        Method.STRUCTURE: Anew("forgetful", f"{__name__}:forgetful"),
    }
    monkeypatch.setattr(settling, "KNOWERS", knowers)
    monkeypatch.setattr(settling, "WORTH_ASKING", {})
    one = Settling(NET, (), 1 << 20, Event())
    one.learn_on({"live"}, NEVER)
    assert Slow.made == []
    for of in (*knowers, *knowers):
        one.learn(of, {"live"}, NEVER)
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([2], 2)
    one.learn_on({"live"}, Deadline.after(0))
    assert not one.found
    one.learn_on({"live"}, NEVER)
    one.learn_on({"live"}, NEVER)  # it is known
    assert ([slow.asked for slow in Slow.made], len(FORGETFUL)) == ([3], 2)
    assert one.found["live"].method == "slowly"
