"""A machine that fails is one that takes longer: the theorem, by exploring, and what the loops must be for it."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from support.bench_cell import JUDGED, bench, free_cell
from support.closed_loops import closed, other_plants
from support.drawn_cells import drawn_cell
from support.lively_nets import lively_net

from firable.analysis.spaces.reachability import explore
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ACCIDENT, OVERRUN, ClosedLoop, Faults, Sending
from firable.nets.machines.plant_file import PlantModel
from firable.nets.machines.slower import difference
from firable.nets.net import Net, Place, Signal, SignalKind, Transition

CELLS = (
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "one_robot_timed"),
    *("two_robots_shared", "two_robots_separate", "two_cells", "index_table"),
)
FAULTS = (Faults.FOR_GOOD, Faults.REPAIRED)


def differences(net: Net, model: PlantModel) -> list[str]:
    well = close(net, model).net
    return [difference(well, close(net, model, one), repaired=one is Faults.REPAIRED) for one in FAULTS]


@pytest.mark.parametrize("cell", CELLS)
def test_in_every_cell_of_the_catalogue_a_machine_that_fails_is_one_that_takes_longer(cell: str) -> None:
    net, model = catalogue_net(cell), catalogue_plant(cell)
    assert differences(net, model) == ["", ""]
    assert close(net, model, Faults.REPAIRED).failed
    others = 0
    for seed in range(8):
        try:
            assert differences(net, other_plants(model, seed)) == ["", ""]
        except InputError:
            continue  # a plant that does not fit the net
        others += 1
    assert others > 3


def test_in_drawn_cells_a_machine_that_fails_is_one_that_takes_longer() -> None:
    failing = 0
    for seed in range(24):
        cell = drawn_cell(seed)
        assert differences(cell.net, cell.plant) == ["", ""], cell
        failing += bool(close(cell.net, cell.plant, Faults.REPAIRED).failed)
    assert failing > 8
    assert differences(free_cell(judged=True), bench(judged=JUDGED)) == ["", ""]


# --------------------------------------------------------------------------------------------------------------------
# What follows


def slower(draw: random.Random, well: Net) -> ClosedLoop:
    """A net in which two places hold up the transitions of another one, and are emptied again."""
    _, _, loop = closed("one_robot", Sending.AT_ONCE)
    failed = ("f0", "f1")
    names = [place.name for place in well.places]

    def held_up(t: Transition) -> Transition:
        by = tuple(name for name in failed if draw.random() < 0.4)
        return replace(t, inhibitive=(*t.inhibitive, *by))

    fails = [
        Transition(f"fails{i}", (), (name,), (draw.choice(names),), ()) if draw.random() < 0.7
        # and one that waits for another to have failed
        else Transition(f"fails{i}", (), (name,), (failed[1 - i],), (draw.choice(names),))
        for i, name in enumerate(failed)
    ]  # fmt: skip
    repaired = [Transition(f"repaired{i}", (name,)) for i, name in enumerate(failed)]
    net = replace(
        well,
        places=(*well.places, *(Place(name) for name in failed)),
        transitions=(*map(held_up, well.transitions), *fails, *repaired),
    )
    return replace(loop, net=net, failed=MappingProxyType(dict(zip("AB", failed, strict=True))))


def test_what_is_reached_or_always_fires_again_is_the_same_where_machines_take_longer() -> None:
    live, others, failed = 0, 0, 0
    for seed in range(300):
        draw = random.Random(seed)
        well = lively_net(draw, 8)
        loop = slower(draw, well)
        assert difference(well, loop, repaired=True) == ""
        space, longer = explore(well), explore(loop.net)
        mask = (1 << len(well.places)) - 1
        reached = {space.marking(i) for i in range(space.n_markings)}
        assert {longer.marking(i) & mask for i in range(longer.n_markings)} <= reached
        for i, is_live in enumerate(space.live()):
            assert longer.live()[i] == is_live, seed
            live, others = live + bool(is_live), others + (not is_live)
        failed += longer.n_markings > space.n_markings
    assert live > 30
    assert min(others, failed) > 200


# --------------------------------------------------------------------------------------------------------------------
# What they must be


def changed(loop: ClosedLoop) -> Iterator[tuple[str, Net]]:
    """The net of a loop with one thing changed, that lets something happen which could not, or gives or takes more."""
    net, failed = loop.net, set(loop.failed.values())

    def with_(old: Transition, *new: Transition) -> Net:
        return replace(net, transitions=(*(t for t in net.transitions if t is not old), *new))

    for t in net.transitions:
        yield f"{t.name} left out", with_(t)
        for kind in ("inputs", "outputs", "permissive", "inhibitive"):
            for place in getattr(t, kind):
                if place not in failed or kind != "inhibitive":
                    left: dict[str, Any] = {kind: tuple(one for one in getattr(t, kind) if one != place)}
                    yield f"{t.name} without {kind} {place}", with_(t, replace(t, **left))
        for kind in ("inputs", "outputs"):
            if "plant.CV1.idle" not in getattr(t, kind):
                more: dict[str, Any] = {kind: (*getattr(t, kind), "plant.CV1.idle")}
                yield f"{t.name} with {kind}", with_(t, replace(t, **more))
        if "plant.MC.idle" not in t.inhibitive:
            yield f"{t.name} waits", with_(t, replace(t, inhibitive=(*t.inhibitive, "plant.MC.idle")))
    for place in net.places:
        other = replace(place, marked=not place.marked)
        yield (
            f"{place.name} marked otherwise",
            replace(net, places=tuple(other if p is place else p for p in net.places)),
        )
    yield "a place more", replace(net, places=(*net.places, Place("plant.more", "plant")))
    yield "a signal", replace(net, signals=(Signal("plant.s", "plant", SignalKind.SENSOR),))
    yield "a transition more", replace(net, transitions=(*net.transitions, Transition("more", ("plant.CV1.idle",))))


def test_every_change_of_a_loop_by_which_it_does_more_is_seen() -> None:
    _, _, well = closed("one_robot", Sending.AT_ONCE)
    _, _, loop = closed("one_robot", Sending.AT_ONCE, Faults.REPAIRED)
    failing = {t.name for t in loop.net.transitions} - {t.name for t in well.net.transitions}
    same, count = set(), 0
    for what, net in changed(loop):
        count += 1
        if not difference(well.net, replace(loop, net=net), repaired=True):
            same.add(what)
    assert count > 2_000
    # How a machine comes to fail is of no matter, as nothing else changes; nor whether a repair waits for less.
    assert {what.partition(" ")[0] for what in same if "/fails/" in what} == {t for t in failing if "/fails/" in t}
    repairs = {what for what in same if "/fails/" not in what}
    assert repairs == {
        f"{t} without inhibitive {place}" for t in failing if t.endswith("/repaired") for place in (ACCIDENT, OVERRUN)
    }


def test_no_place_of_the_net_without_faults_says_that_a_machine_has_failed() -> None:
    """Such a place could be filled by failing, and what waits for it would happen only then."""
    well = Net("well", (Place("empty"), Place("full")), (Transition("t", ("empty",), ("full",)),))
    fails, repaired = Transition("fails", outputs=("empty",)), Transition("repaired", ("empty",))
    _, _, loop = closed("one_robot", Sending.AT_ONCE)
    net = replace(well, transitions=(*well.transitions, fails, repaired))
    failing = replace(loop, net=net, failed=MappingProxyType({"A": "empty"}))
    assert explore(net).n_markings > explore(well).n_markings
    assert difference(well, failing, repaired=True) == "its places are others, or marked otherwise"


def test_a_repair_that_waits_for_something_is_none() -> None:
    _, _, well = closed("one_robot", Sending.AT_ONCE)
    for faults, said in ((Faults.REPAIRED, ""), (Faults.FOR_GOOD, "'plant.CV1.failed' is not emptied by a repair")):
        _, _, loop = closed("one_robot", Sending.AT_ONCE, faults)
        assert difference(well.net, loop, repaired=False) == ""
        assert difference(well.net, loop, repaired=True) == said
