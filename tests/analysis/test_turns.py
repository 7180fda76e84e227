"""Verdicts that share what time is left: none keeps those behind it from being asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

import pytest

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.question import Answer, Question, unknown
from firable.analysis.report import _in_turn
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue import family_net
from firable.nets.verdict import Cost, Status, Verdict
from firable.semantics.trace import Discipline


@dataclass
class Turns:
    """As much of a state space as takes turns, and who was asked with which part of the time."""

    deadline: Deadline
    complete: bool = True
    share: float = 1.0
    asked: list[tuple[str, float]] = field(default_factory=list)

    @contextmanager
    def turn(self, share: float) -> Iterator[None]:
        self.share = share
        yield
        self.share = 1.0

    def ask(self, name: str, needs: float) -> Verdict:
        """Decided with so large a part of the time."""
        self.asked.append((name, self.share))
        answer = Answer(True) if self.share >= needs else unknown("time", "", "F3004")
        return Question(name, name).settle(answer, "", Discipline.INTERLEAVING, Cost())


def decided(turns: Turns, **needs: float) -> dict[str, bool]:
    asks = [partial(turns.ask, name, part) for name, part in needs.items()]
    verdicts = _in_turn(cast(StateSpace[Any], turns), asks)
    assert [verdict.name for verdict in verdicts] == list(needs)
    return {verdict.name: verdict.status is Status.PROVED for verdict in verdicts}


def test_what_takes_long_is_asked_again_when_all_others_have_been() -> None:
    turns = Turns(Deadline.after(3600))
    assert decided(turns, long=0.45, short=0.1, never=2.0) == {"long": False, "short": True, "never": False}
    names = [name for name, _ in turns.asked]
    assert names == ["long", "short", "never", "long", "never"]
    first, again = turns.asked[:3], turns.asked[3:]
    assert len({share for _, share in first}) == 1
    # What is left then is shared out, and a part of it stays for other techniques.
    assert [share for _, share in again] == pytest.approx([1 / 3, 1 / 2])
    assert decided(Turns(Deadline.after(3600)), long=0.45, short=0.1) == {"long": True, "short": True}


@pytest.mark.parametrize("turns", [Turns(NEVER), Turns(Deadline.after(3600), complete=False), Turns(Deadline.after(0))])
def test_nothing_is_asked_twice_where_more_time_is_none_or_would_not_help(turns: Turns) -> None:
    assert decided(turns, long=0.9, short=0.1) == {"long": False, "short": True}
    assert len(turns.asked) == 2


def test_a_turn_on_a_diagram_ends_with_its_part_of_the_time_and_leaves_the_rest() -> None:
    space = explore_symbolically(family_net("slotted_ring-10")).until(Deadline.after(3600))
    limits: list[float | None] = []

    class Engine:
        def limit(self, *, max_seconds: float | None, **_: object) -> None:
            limits.append(max_seconds)

    object.__setattr__(space, "engine", Engine())
    with pytest.raises(ZeroDivisionError), space.turn(0.25):
        raise ZeroDivisionError
    assert limits == [pytest.approx(900, abs=30), pytest.approx(3600, abs=30)]
    limits.clear()
    with space.turn(0.5), space.turn(0.5), space.turn(0.5, 10.0):
        pass
    assert limits == [pytest.approx(of, abs=30) for of in (1800, 900, 10, 900, 1800, 3600)]


def test_a_turn_on_a_diagram_ends_in_time_where_nothing_else_does() -> None:
    space = explore_symbolically(family_net("philosophers-100"))
    with pytest.raises(BudgetExceeded), space.turn(1.0, 0.0):
        space.backward(space.deadlocks)
    with space.turn(0.25):
        assert space.backward(space.deadlocks) == space.reach
