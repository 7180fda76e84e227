"""A mistake in the laws, in the closing of a loop or in its second reading is a difference between the two."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from support import inspected_cell, rejecting_cell
from support.bench_cell import JUDGED, LEAVING_RAW, bench, free_cell
from support.closed_loops import KINDS, closed

from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import DiffersError
from firable.decompose.verification.same_loop import by_happening, compare, compare_one
from firable.nets.machines.closing import _Closing, close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import Faults, Sending
from firable.nets.machines.moment import Case


@pytest.mark.parametrize("law", ["judges", "_judged_no_more"])
def test_a_judgement_that_the_laws_forget_or_take_for_granted_is_found(
    law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    net, model, before = free_cell(judged=True), bench(judged=JUDGED), getattr(Laws, law)
    for spoiled in (lambda *_: iter([Case()]), lambda *of: list(before(*of))[:1], lambda *of: list(before(*of))[1:]):
        monkeypatch.setattr(Laws, law, spoiled)
        with pytest.raises(DiffersError):
            compare(Plant(net, model), close(net, model, sending=Sending.LATE))


def test_a_judgement_that_both_readings_keep_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """No state is compared in which something is judged where nothing lies: so none may come about."""
    net, model = free_cell(judged=True), bench(judged=JUDGED)
    monkeypatch.setattr(Plant, "unjudged", lambda _, changes: changes)
    monkeypatch.setattr(Laws, "_judged_no_more", lambda *_: iter([Case()]))
    plant = Plant(net, model)
    name = f"leaves/{model.departures[0].station}"
    some = by_happening(plant, close(net, model, sending=Sending.LATE).net.transitions)[name]
    with pytest.raises(DiffersError, match=r"nothing lies on exit, and it was found (good|bad)"):
        compare_one(plant, name, some)


@pytest.mark.parametrize(("sending", "faults"), KINDS)
def test_ways_out_are_the_same_in_both_readings_and_one_that_is_forgotten_or_mistaken_is_found(
    sending: Sending, faults: Faults, monkeypatch: pytest.MonkeyPatch
) -> None:
    for net, model in ((rejecting_cell.net(), rejecting_cell.plant()), (free_cell(), bench(leaving=LEAVING_RAW))):
        loop = close(net, model, faults, sending)
        assert compare(Plant(net, model, sending, faults), loop) > 2 * len(loop.net.transitions)
        first, second = model.departures
        for others in ([first], [second], [first, second.model_copy(update={"raw": False})]):
            other = close(net, model.model_copy(update={"departures": others}), faults, sending)
            with pytest.raises(DiffersError):
                compare(Plant(net, model, sending, faults), other)


def test_cameras_that_are_taken_for_each_other_are_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model, verdict = inspected_cell.net(), inspected_cell.plant(), Laws.verdict
    loop = close(net, model, sending=Sending.LATE)
    swapped = {**loop.shown, "camera.ok": loop.shown["camera.nok"], "camera.nok": loop.shown["camera.ok"]}
    with pytest.raises(DiffersError, match="that show the signals are others"):
        compare(Plant(net, model), replace(loop, shown=swapped))
    monkeypatch.setattr(Laws, "verdict", lambda self, station, good: verdict(self, station, good=not good))
    mistaken = close(net, model, sending=Sending.LATE)
    assert dict(mistaken.shown) == swapped
    with pytest.raises(DiffersError, match="'accept' does not go as the plant file says"):
        compare(Plant(net, model), replace(mistaken, shown=loop.shown))


def spoiling(change: Callable[[Case], Case | None]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A law that gives each of its cases changed, or leaves it out."""

    def spoil(law: Callable[..., Any]) -> Callable[..., Any]:
        def spoiled(*of: Any) -> Iterator[Case]:
            return (new for case in law(*of) if (new := change(case)) is not None)

        return spoiled

    return spoil


WITHOUT_FIRST = spoiling(lambda case: replace(case, wants=case.wants[:-1], leaves=()) if case.leaves else case)
NOTHING_LEFT = spoiling(lambda case: replace(case, leaves=()))
NEVER = spoiling(lambda _: None)


@pytest.mark.parametrize("law", ["sent", "refused", "done", "spoiled", "departs", "departs_raw"])
@pytest.mark.parametrize("spoil", [WITHOUT_FIRST, NOTHING_LEFT, NEVER])
def test_a_mistake_in_the_laws_is_found(
    law: str, spoil: Callable[[Callable[..., Any]], Callable[..., Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    net, model, _ = closed("one_robot")
    monkeypatch.setattr(Laws, law, spoil(getattr(Laws, law)))
    with pytest.raises(DiffersError):
        compare(Plant(net, model), close(net, model, sending=Sending.LATE))


@pytest.mark.parametrize("step", ["cleared", "formed", "sent_late", "workpieces"])
def test_a_mistake_in_the_closing_is_found(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    net, model, _ = closed("one_robot")
    before = getattr(_Closing, step)
    monkeypatch.setattr(_Closing, step, lambda *of: list(before(*of))[:1])
    with pytest.raises(DiffersError):
        compare(Plant(net, model), close(net, model, sending=Sending.LATE))


def test_a_firing_that_does_not_wait_for_the_command_before_it_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model, _ = closed("one_robot")
    monkeypatch.setattr(_Closing, "applied", lambda *_: Case())
    with pytest.raises(DiffersError):
        compare(Plant(net, model), close(net, model, sending=Sending.LATE))


@pytest.mark.parametrize("name", ["fires", "sent", "taken", "done", "effect", "spoils", "formed", "arrives", "leaves"])
def test_a_mistake_in_the_second_reading_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Plant, name, lambda *_: iter(()))
    with pytest.raises(DiffersError):
        compare(Plant(*closed("one_robot")[:2]), closed("one_robot")[2])


@pytest.mark.parametrize("name", ["sent", "taken", "done", "has_failed", "fails", "repaired"])
def test_a_mistake_in_the_second_reading_of_machines_that_fail_is_found(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    net, model, loop = closed("one_robot", Sending.AT_ONCE, Faults.REPAIRED)
    monkeypatch.setattr(Plant, name, lambda *_: iter(()))
    with pytest.raises(DiffersError):
        compare(Plant(net, model, Sending.AT_ONCE, Faults.REPAIRED), loop)


@pytest.mark.parametrize("other", KINDS[:-1])
def test_a_loop_whose_machines_fail_in_another_way_is_refused(other: tuple[Sending, Faults]) -> None:
    net, model, loop = closed("one_robot", *other)
    with pytest.raises(DiffersError):
        compare(Plant(net, model, Sending.AT_ONCE, Faults.REPAIRED), loop)
