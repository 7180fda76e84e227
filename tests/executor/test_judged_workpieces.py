"""Workpieces that a sensor finds good or not, in the simulated cell and in the file that says so."""

import random

import pytest
from support.plant_bench import TEXT, Bench

from firable.executor.cell.plant import PlantReport, SensorChanged
from firable.nets.diagnostics import InputError
from firable.nets.machines.plant_file import parse_plant


def judging(*sensors: str, seed: int = 0, workpieces: int = 1, text: str = TEXT) -> Bench:
    return Bench(workpieces=workpieces, seed=seed, text=text + "".join(f"  {sensor}\n" for sensor in sensors))


def shown(reports: list[PlantReport]) -> list[tuple[str, bool]]:
    """What sensors have come to see, those of the hand and the entry left out."""
    changes = [report for report in reports if isinstance(report, SensorChanged)]
    return [(one.signal, one.value) for one in changes if one.signal not in {"entry", "hand"}]


def test_workpiece_is_judged_when_it_comes_and_the_judgement_stands_until_it_leaves() -> None:
    seen = set()
    for seed in range(20):
        bench = judging("ok: {passes: table, likely: 0.5}", "nok: {fails: table}", seed=seed)
        bench.load()
        ((signal, value),) = shown(bench.reports)
        assert value
        seen.add(signal)
        bench.reports.clear()
        for command in ("CLAMP", "UNCLAMP"):
            bench.do("M", command)
        assert shown(bench.reports) == []
        bench.do("R", "GRASP", at="TABLE")
        assert shown(bench.reports) == [(signal, False)]
    assert seen == {"ok", "nok"}


def test_workpiece_that_was_machined_is_judged_again_and_no_other() -> None:
    seen = set()
    for seed in range(40):
        bench = judging("ok: {passes: table, likely: 0.5}", "nok: {fails: table}", seed=seed)
        bench.load()
        ((was, _),) = shown(bench.reports)
        bench.do("M", "CLAMP")
        bench.give("M", "RUN")
        bench.reports.clear()
        bench.wait(2.5)
        assert shown(bench.reports) == []
        bench.wait(1)
        now = {signal for signal, value in shown(bench.reports) if value} or {was}
        assert len(shown(bench.reports)) in {0, 2}
        assert [name for name in ("ok", "nok") if bench.plant.shown[name]] == [*now]
        seen.add((was, *now))
    assert len(seen) == 4, "whatever it was found, it is good or not"


def test_camera_that_takes_its_time_shows_nothing_till_then_and_begins_anew_with_what_was_machined() -> None:
    slow = ("ok: {passes: table, likely: 1, after_s: 5}", "nok: {fails: table, after_s: 1}")
    bench = judging(*slow)
    bench.load()
    assert shown(bench.reports) == []
    bench.wait(1.9)
    assert shown(bench.reports) == [], "the longest time counts"
    bench.wait(0.2)
    assert shown(bench.reports) == [("ok", True)]
    bench.do("M", "CLAMP")
    bench.reports.clear()
    bench.do("M", "RUN")
    assert shown(bench.reports) == [("ok", False)]
    bench.wait(4.1)
    assert shown(bench.reports) == [("ok", False), ("ok", True)]
    bench = judging(*slow)
    bench.load()
    bench.do("R", "GRASP", at="TABLE")
    bench.wait(5)
    assert shown(bench.reports) == [], "what has gone meanwhile is not found anything"


def test_workpiece_is_judged_where_it_comes_in_and_once_more_where_it_is_laid_down() -> None:
    seen = set()
    for seed in range(40):
        bench = judging("fresh: {passes: entry, likely: 0.5}", "ok: {passes: table, likely: 0.5}", seed=seed)
        at_entry = ("fresh", True) in shown(bench.reports)
        bench.load()
        seen.add((at_entry, bench.plant.shown["ok"]))
        assert not bench.plant.shown["fresh"]
    assert len(seen) == 4


@pytest.mark.parametrize(
    ("sensor", "likely"),
    [
        *(("{passes: entry}", 0.9), ("{fails: entry}", 0.1)),
        *(("{passes: entry, likely: 0.3}", 0.3), ("{fails: entry, likely: 0.3}", 0.3)),
        *(("{passes: entry, likely: 0}", 0.0), ("{fails: entry, likely: 1}", 1.0)),
    ],
)
def test_sensor_that_judges_sees_what_comes_as_often_as_is_likely(sensor: str, likely: float) -> None:
    count = sum(judging(f"judges: {sensor}", seed=seed).plant.shown["judges"] for seed in range(500))
    assert abs(count / 500 - likely) < 0.06
    assert likely not in {0.0, 1.0} or count == 500 * likely


def test_other_sensor_of_a_station_need_not_say_how_likely_it_is_and_no_one_else_draws_anything() -> None:
    for seed in range(10):
        bench = judging("nok: {fails: entry}", "ok: {passes: entry, likely: 0}", "also: {fails: entry}", seed=seed)
        assert bench.plant.shown == {"entry": True, "hand": False, "nok": True, "ok": False, "also": True}
    bench = Bench(seed=7)
    bench.load()
    assert bench.plant.random.random() == random.Random(7).random()


@pytest.mark.parametrize(
    ("sensor", "message", "hint"),
    [
        ("{fails: tabel}", "there is no station 'tabel'", "did you mean 'table'?"),
        ("{passes: tabel}", "there is no station 'tabel'", "did you mean 'table'?"),
        ("{passes: table, fails: table}", "a sensor sees one thing", "`passes: STATION` or `fails: STATION`"),
        ("{passes: table, occupied: table}", "a sensor sees one thing", "`passes: STATION` or `fails: STATION`"),
        ("{passes: table, may_flicker: true}", "a judgement stands until", "a sensor with `occupied` can have them"),
        ("{fails: table, may_linger: true}", "a judgement stands until", "a sensor with `occupied` can have them"),
        ("{occupied: table, after_s: 2}", "a sensor sees at once", "`acknowledges`, `passes`, `fails` and `set_by`"),
        ("{occupied: table, likely: 0.5}", "nothing is judged", "`likely` belongs to `passes` and `fails`"),
        ("{fails: table, likely: 0.3}", "found good with 0.6, as 'ok' says, and here with 0.7", "say it once"),
        ("{passes: table, likely: 0.4}", "found good with 0.6, as 'ok' says, and here with 0.4", "say it once"),
    ],
)
def test_judgement_that_cannot_be_is_refused(sensor: str, message: str, hint: str) -> None:
    text = f"{TEXT}  ok: {{passes: table, likely: 0.6}}\n"
    parse_plant(f"{text}  x: {{fails: table, likely: 0.4}}\n")
    with pytest.raises(InputError) as refusal:
        parse_plant(f"{text}  x: {sensor}\n")
    (problem,) = refusal.value.diagnostics
    assert problem.code == "F5003"
    assert message in problem.message
    assert hint in problem.hint
    assert problem.span is not None
    assert problem.span.line == 28
