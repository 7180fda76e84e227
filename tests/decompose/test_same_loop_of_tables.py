"""Loops in which machines index, held against the second reading of the plant file, and mutants of them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.closed_loops import KINDS
from support.table_cell import tables

from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import DiffersError
from firable.decompose.verification.same_loop import by_happening, compare, compare_one
from firable.nets.machines.closing import close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import Faults, Sending
from firable.nets.net import Transition


@pytest.mark.parametrize(("sending", "faults"), KINDS)
@pytest.mark.parametrize("extra", ["", ", may_flicker: true", ", may_linger: true"])
def test_both_readings_agree_on_machines_that_index(extra: str, sending: Sending, faults: Faults) -> None:
    net, model = tables(extra)
    loop, plant = close(net, model, faults, sending), Plant(net, model, sending, faults)
    assert compare(plant, loop) > len(loop.net.transitions)
    assert plant.things["step W"] == {
        None: "plant.W.steady",
        "STEP takes unload": "plant.W.STEP.takes.unload",
        "STEP lays unload": "plant.W.STEP.lays.unload",
    }


def of_an_index(name: str) -> bool:
    """Whether something happens in an index, or where it may be in the way."""
    words = ("T/", "W/", "R/", "B/", "arrives/", "sent/c.turn", "sent/c.back", "sent/c.beam", "sent/c.light")
    return name.startswith(words) and "/started" not in name


def test_every_way_of_an_index_that_is_left_out_is_missed() -> None:
    net, model = tables()
    loop, plant, count = close(net, model, sending=Sending.LATE), Plant(net, model), 0
    for name, some in by_happening(plant, loop.net.transitions).items():
        for t in some if of_an_index(name) else ():
            others = [other for other in some if other is not t]
            with pytest.raises(DiffersError, match="does not go as the plant file says"):
                pytest.fail(t.name) if compare_one(plant, name, others) else None
            count += 1
    assert count > 100


def test_every_gate_of_an_index_and_of_what_may_be_in_its_way_that_is_left_out_is_refused() -> None:
    """But for those on what controllers are told or machines are at, where one says what another one says already, and
    on a station that is full: whoever lays something there collides anyway."""
    net, model = tables()
    loop, plant, count, same = close(net, model, sending=Sending.LATE), Plant(net, model), 0, set[str]()
    for name, some in by_happening(plant, loop.net.transitions).items():
        for t in some[:2] if of_an_index(name) else ():
            for place in (*t.permissive, *t.inhibitive):
                count += 1
                try:
                    compare_one(plant, name, [without(place, t) if one is t else one for one in some])
                except DiffersError:
                    continue
                same.add(place)
    assert count > 150
    twice = (".starting", ".untold", ".told_0", ".told_1", ".news", ".idle", "plant.W.at.c.beam", "plant.load.empty")
    assert all(place.endswith(twice) for place in same), same


def without(place: str, t: Transition) -> Transition:
    """The transition without a gate on a place."""
    permissive, inhibitive = (tuple(one for one in some if one != place) for some in (t.permissive, t.inhibitive))
    return replace(t, permissive=permissive, inhibitive=inhibitive)


def test_a_loop_in_which_somebody_lays_a_workpiece_on_a_table_that_turns_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    net, model = tables()
    monkeypatch.setattr(Laws, "indexed_by", lambda *_: ())
    with pytest.raises(DiffersError, match="does not go as the plant file says"):
        compare(Plant(net, model), close(net, model, sending=Sending.LATE))


def test_a_station_that_is_full_at_first_is_empty_in_another_loop() -> None:
    net, model = tables()
    empty = model.model_copy(update={"full_at_first": {}})
    with pytest.raises(DiffersError, match="marked wrongly"):
        compare(Plant(net, empty), close(net, model, sending=Sending.LATE))
