"""The race of techniques: one answer, the first; and nobody left running."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event, active_count
from threading import enumerate as threads

import pytest

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.race import Contestant, race


def answering(answer: str) -> Callable[[Limits], str]:
    return lambda _: answer


def waiting(seen: Event, begun: Event | None = None) -> Callable[[Limits], str | None]:
    def wait(limits: Limits) -> None:
        if begun is not None:
            begun.set()
        while not limits.deadline.over:
            pass
        seen.set()

    return wait


def giving_up(limits: Limits) -> str:
    raise BudgetExceeded(f"not with {limits.memory_bytes} bytes")


def test_the_first_answer_ends_the_others() -> None:
    ended, begun, before = Event(), Event(), active_count()

    def quick(_: Limits) -> str:
        begun.wait()
        return "yes"

    outcome = race([[Contestant("slow", waiting(ended, begun))], [Contestant("quick", quick)]], Limits())
    assert (outcome.answer, outcome.winner) == ("yes", "quick")
    assert ended.is_set()
    assert active_count() == before, threads()


def test_a_technique_that_gives_up_leaves_its_lane_to_the_next() -> None:
    lane = [Contestant("poor", giving_up), Contestant("rich", answering("yes"))]
    outcome = race([lane], Limits(memory_bytes=100))
    assert outcome.winner == "rich"
    assert outcome.told == ("poor gave up: not with 100 bytes",)


def test_a_technique_that_is_cancelled_by_the_answer_of_another_has_not_given_up() -> None:
    begun = Event()

    def cancelled(limits: Limits) -> str:
        begun.set()
        while not limits.deadline.over:
            pass
        raise BudgetExceeded("cancelled")

    def quick(_: Limits) -> str:
        begun.wait()
        return "yes"

    outcome = race([[Contestant("slow", cancelled)], [Contestant("quick", quick)]], Limits())
    assert outcome.told == ("slow was no longer needed",)


def test_lanes_share_the_memory() -> None:
    outcome = race([[Contestant("a", giving_up)], [Contestant("b", giving_up)]], Limits(memory_bytes=100))
    assert outcome.answer is None
    assert sorted(outcome.told) == [f"{name} gave up: not with 50 bytes" for name in "ab"]


def test_a_slice_ends_a_technique_and_a_longer_one_asks_it_again() -> None:
    asked: list[float | None] = []

    def note(limits: Limits) -> str | None:
        asked.append(limits.deadline.left_seconds)
        while not limits.deadline.over:
            pass
        return "late" if len(asked) == 3 else None

    outcome = race([[Contestant("stubborn", note)]], Limits(), slices_seconds=(0.01, 0.02, 0.03, 0.04))
    assert outcome.answer == "late"
    assert len(asked) == 3
    assert all(left is not None for left in asked)


def test_where_the_time_is_short_slices_grow_up_to_all_of_it() -> None:
    asked: list[tuple[str, float]] = []

    def note(name: str) -> Callable[[Limits], str | None]:
        def wait(limits: Limits) -> None:
            left = limits.deadline.left_seconds
            assert left is not None
            asked.append((name, left))
            while not limits.deadline.over:
                pass

        return wait

    lane = [Contestant(name, note(name)) for name in ("first", "second")]
    race([lane], Limits(Deadline.after(1.6)), slices_seconds=(2.0, 10.0, 60.0))
    assert [name for name, _ in asked] == ["first", "second", "first", "second", "first"]
    for (_, left), longest in zip(asked, (0.1, 0.1, 0.4, 0.4, 1.6), strict=True):
        assert longest / 4 < left <= longest


def test_a_technique_that_gave_up_early_is_not_asked_again() -> None:
    asked: list[int] = []

    def give_up(_: Limits) -> None:
        asked.append(1)

    assert race([[Contestant("once", give_up)]], Limits(), slices_seconds=(10.0, 20.0)).answer is None
    assert len(asked) == 1


def test_the_limits_end_a_race_without_an_answer() -> None:
    ended = Event()
    outcome = race([[Contestant("slow", waiting(ended))]], Limits(Deadline.after(0.05)), slices_seconds=None)
    assert outcome.answer is None
    assert ended.is_set()


def test_an_error_of_a_technique_comes_out_and_ends_the_others() -> None:
    ended, begun = Event(), Event()

    def wrong(_: Limits) -> str:
        begun.wait()
        raise ZeroDivisionError("a fault of the program")

    with pytest.raises(ZeroDivisionError, match="a fault of the program"):
        race([[Contestant("wrong", wrong)], [Contestant("slow", waiting(ended, begun))]], Limits())
    assert ended.is_set()
