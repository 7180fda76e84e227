"""What a loop has of the moments between two signals: all that can happen then, and nothing that takes longer."""

from __future__ import annotations

import pytest
from support.between_cells import (
    at_rest,
    beside,
    blind,
    both,
    bouncing,
    by_sensors,
    done,
    done_when_the_next_has_come,
    formed,
    found_good,
    in_between,
    judged,
    leaving,
    mixed_up,
    overdue,
    timed_out,
    tried_again,
    twice,
)
from support.drawn_cells import drawn_cell
from support.examples import seeds
from support.physical_cell import reached

from firable.analysis.loop.verdicts import LoopReport, check_loop
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import DiffersError
from firable.decompose.verification.same_loop import compare
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.excluding import Excluding
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.moment import Case
from firable.nets.machines.plant_file import PlantModel
from firable.nets.machines.telling import Telling
from firable.nets.net import Net
from firable.nets.verdict import Status

CELLS = ("one_robot", "one_robot_mc_late", "one_robot_timed", "two_robots_shared")
KEYS = {
    "{set_by: operator}": "belt.key/set",
    "{acknowledges: B}": "belt.key/pressed",
    "{occupied: entry, may_flicker: true}": "arrives/entry",
    "{occupied: entry}": "arrives/entry",
}
"""What the key is, and what makes it so."""


def names(report: LoopReport, verdict: str) -> list[str]:
    witness = report.verdict(verdict).witness
    assert witness is not None
    return [name for (name,) in witness.firings]


@pytest.mark.parametrize(
    ("cell", "between"),
    [*((in_between(key), how) for key, how in KEYS.items()), (beside(), "W/done/belt.working")],
    ids=[*KEYS, "the end of another command"],
)
def test_all_that_can_happen_may_happen_while_a_controller_is_told_one_thing_after_the_other(
    cell: tuple[Net, PlantModel], between: str
) -> None:
    report = check_loop(*cell)
    assert report.verdict("loop.accidents").status is Status.VIOLATED
    run = names(report, "loop.accidents")
    lies = next(i for i, name in enumerate(run) if name.startswith("B/done"))
    assert any(name.startswith(between) for name in run[lies:])
    for sending in Sending:
        assert compare(Plant(*cell, sending), close(*cell, sending=sending))


def test_what_a_time_limit_does_to_a_command_that_is_done_a_moment_before_is_found_without_sensors_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    report = check_loop(*blind())
    assert report.verdict("loop.accidents").status is Status.VIOLATED
    run = names(report, "loop.accidents")
    done = next(i for i, name in enumerate(run) if name.startswith("R/done/robot.put/"))
    assert run[done] == "R/done/robot.put/robot.laid_down-late"
    assert run[done + 1].startswith("robot.put_timeout/")
    assert run[-1].endswith("R-empty")
    monkeypatch.setattr(Telling, "told_late", lambda *_: frozenset())
    assert check_loop(*blind()).verdict("loop.accidents").holds


def test_no_machine_is_done_with_what_it_was_told_to_do_in_between(monkeypatch: pytest.MonkeyPatch) -> None:
    assert check_loop(*by_sensors()).verdict("loop.property.never_odd").holds
    for what, instead in (("may_end", lambda *_: Case()), ("sent", lambda *args: [args[1]])):
        with monkeypatch.context() as patch:
            patch.setattr(Telling, what, instead)
            assert check_loop(*by_sensors()).verdict("loop.property.never_odd").status is Status.VIOLATED


@pytest.mark.parametrize(
    ("cell", "rule", "instead"),
    [
        (done(), "behind", {}),
        (done_when_the_next_has_come(), "behind", {}),
        (at_rest(), "may_end", lambda self, _: Case(((self.starting["R"], False),))),
        (judged(), "is_seen", lambda *_: Case()),
        (both(), "is_seen", lambda *_: Case()),
    ],
    ids=["done", "shown by a sensor", "at rest after a stop", "judged", "judged before"],
)
def test_who_is_told_that_something_is_done_or_judged_was_told_before_what_can_be_seen_of_it(
    cell: tuple[Net, PlantModel], rule: str, instead: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert check_loop(*cell).verdict("loop.property.never_odd").holds
    monkeypatch.setattr(Telling, rule, instead)
    assert check_loop(*cell).verdict("loop.property.never_odd").status is Status.VIOLATED


def test_a_time_may_be_over_while_a_controller_is_still_to_be_told_that_the_command_is_done() -> None:
    run = names(check_loop(*overdue()), "loop.property.never_odd")
    done_at = next(i for i, name in enumerate(run) if name.startswith("R/done/robot.grasp"))
    assert done_at < run.index("robot.grasp_overdue/over")


def test_a_completion_is_formed_when_its_sensor_shows_it_whatever_else_is_still_to_be_told() -> None:
    assert any("robot.gone" in one for one in reached(close(*formed()), 1_000) or ())


def test_a_completion_that_no_sensor_is_told_before_is_not_too_late_for_ever() -> None:
    """A run that is fair to all that fires tells it in the instant at some time."""
    assert check_loop(*tried_again()).verdict("loop.property.gets_there").holds


def test_a_completion_that_a_camera_forms_waits_for_other_sensors_and_not_for_itself() -> None:
    loop = close(*found_good())
    assert "plant.robot.lies.news" in loop.net.transition("robot.good/told/rises").inhibitive
    assert check_loop(*found_good()).verdict("loop.gates-open").holds
    for sending in Sending:
        assert compare(Plant(*found_good(), sending), close(*found_good(), sending=sending))


@pytest.mark.parametrize("cell", [timed_out(), mixed_up()], ids=["the time is over", "another machine sets it"])
def test_who_takes_the_token_before_the_completion_is_told_goes_by_what_was_seen_before(
    cell: tuple[Net, PlantModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert names(check_loop(*cell), "loop.accidents")[-1].endswith("/R-holds")
    waited_for = frozenset(place.name for place in cell[0].places if place.completion is not None)
    monkeypatch.setattr(Excluding, "announced", waited_for)
    assert check_loop(*cell).verdict("loop.accidents").holds


def test_a_completion_is_told_behind_news_that_was_there_before(monkeypatch: pytest.MonkeyPatch) -> None:
    assert check_loop(*leaving()).verdict("loop.accidents").holds
    for sending in Sending:
        plant, loop = Plant(*leaving(), sending), close(*leaving(), sending=sending)
        assert any("belt.carried-behind-belt.exit" in t.name for t in loop.net.transitions)
        assert compare(plant, loop)
        with monkeypatch.context() as patch:
            patch.setattr(Telling, "_behind", lambda *_: iter(()))
            with pytest.raises(DiffersError):
                compare(plant, close(*leaving(), sending=sending))


def test_a_sensor_that_flickers_as_a_workpiece_goes_may_be_told_to_have_come_back() -> None:
    report = check_loop(*bouncing())
    assert report.verdict("loop.accidents").status is Status.VIOLATED
    run = names(report, "loop.accidents")
    assert run[run.index("go") :] == [
        "go",
        "belt.entry/told/flickered",
        "left",
        "belt.entry/told/rose",
        "next/A-nothing",
    ]
    assert check_loop(*bouncing("")).verdict("loop.accidents").holds
    for sending in Sending:
        assert compare(Plant(*bouncing(), sending), close(*bouncing(), sending=sending))


@pytest.mark.parametrize("sending", Sending)
def test_a_machine_that_is_given_two_commands_in_one_firing_while_there_is_news_is_at_the_last(
    sending: Sending,
) -> None:
    loop = close(*twice(), sending=sending)
    assert compare(Plant(*twice(), sending), loop)
    assert loop.news
    assert any(
        {"belt.run", "plant.B.at.belt.halt", "plant.B.breaks_off.belt.run"} <= one for one in reached(loop, 999) or ()
    )


def told_late(net: Net, model: PlantModel, faults: Faults, sending: Sending) -> tuple[ClosedLoop, ClosedLoop]:
    """The loop, and the one in which all that closes a gate is told late, whoever goes by it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Excluding, "excludes", lambda *_, **__: False)
        late = close(net, model, faults, sending)
    return close(net, model, faults, sending), late


@pytest.mark.parametrize("faults", [Faults.NONE, Faults.FOR_GOOD])
@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize("name", CELLS)
def test_what_is_told_in_the_instant_because_nobody_could_go_by_it_leaves_nothing_out(
    name: str, sending: Sending, faults: Faults
) -> None:
    loop, late = told_late(catalogue_net(name), catalogue_plant(name), faults, sending)
    assert loop.news.keys() < late.news.keys()
    assert (markings := reached(loop, 1_000_000)) is not None
    assert markings == reached(late, 1_000_000)


@pytest.mark.seeds
@pytest.mark.parametrize("chunk", range(2))
def test_in_drawn_cells_it_leaves_nothing_out_either(chunk: int) -> None:
    cells = [(drawn_cell(seed), sending) for seed in seeds(3, chunk) for sending in Sending]
    compared = 0
    for cell, sending in cells:
        loop, late = told_late(cell.net, cell.plant, Faults.NONE, sending)
        if (markings := reached(loop, 20_000)) is not None and (others := reached(late, 60_000)) is not None:
            assert markings == others, cell
            compared += 1
    assert compared > len(cells) / 2
