"""The loop that O4 is asked of, held against a second reading of the plant file, and mutants of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from support import inspected_cell
from support.bench_cell import JUDGED, bench, free_cell
from support.closed_loops import KINDS, closed, other_plants
from support.together_cell import BELT_PLANT, belts, together

from firable.decompose.verification import same_loop
from firable.decompose.verification.happenings import Plant
from firable.decompose.verification.plant import DiffersError, UncomparedError
from firable.decompose.verification.same_loop import by_happening, compare, compare_one
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.nets.machines import closing
from firable.nets.machines.closing import close
from firable.nets.machines.laws import Laws
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.moment import Case
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.machines.telling import Telling
from firable.nets.net import Net, Place, Transition
from firable.nets.text import parse_net
from firable.nets.well_formed import is_name

CELLS = (
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "one_robot_timed"),
    *("two_robots_shared", "two_robots_separate", "two_cells", "index_table"),
)


@pytest.mark.parametrize(
    ("name", "sending", "faults"),
    [
        *(("one_robot_timed", *kind) for kind in KINDS),
        *((name, *kind) for name in CELLS if name != "one_robot_timed" for kind in (KINDS[0], KINDS[-1])),
    ],
)
def test_the_loop_of_every_cell_of_the_catalogue_is_what_its_plant_file_says(
    name: str, sending: Sending, faults: Faults
) -> None:
    net, model, loop = closed(name, sending, faults)
    assert compare(Plant(net, model, sending, faults), loop) > 2 * len(loop.net.transitions)


ODD = ("R 1", "R~201", "Presse A/1 #ü", "{} 'at' | \\ \"[1]\" (a), %s")
"""Names of machines that a net accepts; the first two are alike where a blank is written as `~20` and nothing else."""


@pytest.mark.parametrize(("sending", "faults"), KINDS)
def test_machines_stations_and_positions_may_have_any_name_that_can_be_seen(sending: Sending, faults: Faults) -> None:
    net, model, plain = closed("one_robot_timed", sending, faults)
    machines = dict(zip(model.machines, ODD, strict=True))
    stations = {name: f"{name} at {it}" for name, it in zip(model.stations, (*ODD, "x y"), strict=True)}
    positions = {name: f"in front of #{name}" for name in model.machines["R"].positions}
    odd = Plant(*renamed(net, model, stations | positions | machines), sending, faults)
    loop = close(odd.net, odd.model, faults, sending)
    assert list(odd.model.machines) == list(ODD)
    assert compare(odd, loop) == compare(Plant(net, model, sending, faults), plain)
    assert all(map(is_name, (*loop.net.place_index, *loop.net.transition_index)))
    assert len(loop.net.places) == len(plain.net.places)
    assert len(loop.net.transitions) == len(plain.net.transitions)


def renamed(net: Net, model: PlantModel, names: dict[str, str]) -> tuple[Net, PlantModel]:
    """A cell whose machines, stations and positions have other names."""

    def written(part: Any) -> Any:
        if isinstance(part, dict):
            return {names.get(key, key): written(one) for key, one in part.items()}
        return [written(one) for one in part] if isinstance(part, list) else names.get(part, part)

    def of_place(place: Place) -> Place:
        if (sent := place.command) is None:
            return place
        parameters = tuple((key, names.get(value, value)) for key, value in sent.parameters)
        return replace(place, command=replace(sent, machine=names[sent.machine], parameters=parameters))

    data = written(model.model_dump(by_alias=True, exclude_defaults=True))
    return replace(net, places=tuple(map(of_place, net.places))), PlantModel.model_validate(data)


def test_both_readings_agree_on_plants_of_every_kind() -> None:
    count, judged = 0, 0
    for seed in range(24):
        net = catalogue_net(CELLS[seed % len(CELLS)])
        model = other_plants(catalogue_plant(CELLS[seed % len(CELLS)]), seed)
        sending, faults = KINDS[seed % len(KINDS)]
        try:
            loop = close(net, model, faults, sending)
        except InputError:
            continue  # a net that the plant does not fit
        count += 1
        judged += bool(Laws(model, net).judged)
        assert compare(Plant(net, model, sending, faults), loop) > 2 * len(loop.net.transitions)
    assert count > 10
    assert judged > 5


@pytest.mark.parametrize(("sending", "faults"), KINDS)
def test_both_readings_agree_on_workpieces_that_are_judged_where_they_come_are_machined_and_go(
    sending: Sending, faults: Faults
) -> None:
    for net, model in (
        (free_cell(judged=True), bench(judged=JUDGED)),
        (inspected_cell.net(), inspected_cell.plant()),
    ):
        loop, plant = close(net, model, faults, sending), Plant(net, model, sending, faults)
        assert compare(plant, loop) > 2 * len(loop.net.transitions)
        judged = {f"plant.{at}.{word}" for at in model.stations for word in ("passes", "fails")}
        groups = by_happening(plant, loop.net.transitions)
        for name, some in groups.items():
            for t in first_and_last_of_each_kind(some, judged):
                others = [other for other in some if other is not t]
                mutants = [m for m in changed(t) if judged & ({*m.inputs, *m.outputs} ^ {*t.inputs, *t.outputs})]
                for wrong in (others, *([mutant, *others] for mutant in mutants)):
                    with pytest.raises(DiffersError):
                        pytest.fail(t.name) if compare_one(plant, name, wrong) else None


def first_and_last_of_each_kind(transitions: Iterable[Transition], places: set[str]) -> list[Transition]:
    """Of the transitions with some of these places, two of all that take and give the same of them.

    A completion that many signals tell of late has hundreds of ways, and which workpiece is judged is the same in all.
    """
    kinds: dict[tuple[frozenset[str], ...], list[Transition]] = {}
    for t in transitions:
        if not (places.isdisjoint((*t.inputs, *t.outputs)) or t.name.endswith("/set-already")):
            kinds.setdefault((frozenset(places & {*t.inputs}), frozenset(places & {*t.outputs})), []).append(t)
    return [t for some in kinds.values() for t in dict.fromkeys((some[0], some[-1]))]


STOPS = """
firable: 1
cell: stops
controllers:
  r:
    start: free
    places:
      free:
      grasp: {send: {machine: R, command: GRASP, at: TABLE}, until: grasped}
      open:  {send: {machine: R, command: OPEN}, until: opened}
      halt:  {send: {machine: R, command: STOP}}
      brake: {send: {machine: R, command: STOP}, until: braked}
      rest:  {send: {machine: R, command: STOP}, until: at_rest}
transitions:
  grip:  {from: r.free, to: r.grasp}
  open:  {from: r.grasp, to: r.open}
  leave: {from: r.open, to: r.brake}
  brake: {from: r.free, to: r.brake}
  rest:  {from: r.brake, to: r.rest}
  halt:  {from: r.rest, to: r.halt}
  again: {from: r.halt, to: r.free}
"""
STOPS_PLANT = """
firable_plant: 1
plant: stops
stations: [table]
arrivals:   {station: table, every_s: 5}
departures: {station: table, after_s: 9}
machines:
  R:
    hand: TABLE
    positions: {TABLE: table}
    commands:
      GRASP: {does: grasp, takes_s: 1, may_fail: repairable}
      OPEN:  {does: work, takes_s: 1}
      STOP:  {does: stop}
sensors: {}
"""


@pytest.mark.parametrize(("sending", "faults"), KINDS)
def test_both_readings_agree_on_stops_at_once_and_in_time_of_one_machine(sending: Sending, faults: Faults) -> None:
    net, model = parse_net(STOPS), parse_plant(STOPS_PLANT)
    loop = close(net, model, faults, sending)
    plant = Plant(net, model, sending, faults)
    assert compare(plant, loop) > 2 * len(loop.net.transitions)
    assert plant.things["breaks off R"] == {
        None: "plant.R.breaks_off_nothing",
        "r.grasp": "plant.R.breaks_off.r.grasp",
    }
    for name in ("R/still-done/r.grasp", "R/still-accident/r.grasp", "R/done/r.rest", "R/done/r.brake"):
        for t in by_happening(plant, loop.net.transitions)[name]:
            others = [one for one in by_happening(plant, loop.net.transitions)[name] if one is not t]
            with pytest.raises(DiffersError, match="does not go as the plant file says"):
                compare_one(plant, name, others)


def two_machines(count: int) -> tuple[Net, PlantModel]:
    """Two hands with so many motions each, stopped in one firing."""
    cell, plant = "firable: 1\ncell: two\ncontrollers:\n", "firable_plant: 1\nplant: two\nstations: [s]\n"
    transitions = "transitions:\n  both: {from: [a.halt, b.halt], to: [a.idle, b.idle]}\n"
    last = f"m{count - 1}"
    transitions += f"  stop: {{from: [a.{last}, b.{last}], to: [a.halt, b.halt]}}\n"
    plant += "arrivals: {station: s, every_s: 5}\ndepartures: {station: s, after_s: 3}\nsensors: {}\nmachines:\n"
    for name, machine in (("a", "A"), ("b", "B")):
        cell += f"  {name}:\n    start: idle\n    places:\n      idle:\n"
        cell += f"      halt: {{send: {{machine: {machine}, command: STOP}}, until: at_rest}}\n"
        before = "idle"
        for i in range(count):
            cell += f"      m{i}: {{send: {{machine: {machine}, command: MOVE, to: P}}, until: done{i}}}\n"
            transitions += f"  {name}{i}: {{from: {name}.{before}, to: {name}.m{i}}}\n"
            before = f"m{i}"
        plant += f"  {machine}: {{hand: P, positions: {{P: s}}, commands: {{MOVE: {{does: move, takes_s: 1}},"
        plant += " STOP: {does: stop}}}\n"
    return parse_net(cell + transitions), parse_plant(plant)


def test_a_firing_that_stops_two_machines_is_compared_however_many_commands_they_have() -> None:
    net, model = two_machines(20)
    loop = close(net, model, sending=Sending.AT_ONCE)
    plant = Plant(net, model, Sending.AT_ONCE)
    stopping = by_happening(plant, loop.net.transitions)["stop"]
    assert len(stopping) > 20**2
    assert compare_one(plant, "stop", stopping) < 4 * len(stopping)


AT_ONCE_TWICE = """
firable: 1
cell: both
controllers:
  c:
    start: free
    places:
      free:
      opens: {send: {machine: D, command: OPEN}}
      shuts: {send: {machine: D, command: SHUT}}
transitions:
  both: {from: c.free, to: [c.opens, c.shuts]}
  again: {from: [c.opens, c.shuts], to: c.free}
"""
DOOR = """
firable_plant: 1
plant: both
stations: [s]
arrivals:   {station: s, every_s: 5}
departures: {station: s, after_s: 1}
machines:
  D: {commands: {OPEN: {does: work, takes_s: 1}, SHUT: {does: work, takes_s: 1}}}
"""


def test_of_two_commands_that_one_firing_sends_to_one_machine_either_may_be_refused() -> None:
    net, model = parse_net(AT_ONCE_TWICE), parse_plant(DOOR)
    loop, plant = close(net, model), Plant(net, model, Sending.AT_ONCE)
    both = by_happening(plant, loop.net.transitions)["both"]
    assert {loop.accidents[t.name] for t in both} == {
        "D is given OPEN while it is at another command",
        "D is given SHUT while it is at another command",
    }
    assert compare(plant, loop) > 0


def test_a_gate_on_what_the_reading_does_not_look_at_is_refused() -> None:
    net, model, loop = closed("one_robot")
    plant, seen = Plant(net, model), 0
    for name, some in by_happening(plant, loop.net.transitions).items():
        if len(some) != 1:
            continue  # in what is no longer done in one way another may do the same
        (t,) = some
        for place in ("plant.MC.idle", "plant.R.hand_at.CV1", "plant.CV1.at.conveyor.cv1_run"):
            if place in (*t.inputs, *t.outputs, *t.permissive, *t.inhibitive):
                continue
            for gated in (
                replace(t, permissive=(*t.permissive, place)),
                replace(t, inhibitive=(*t.inhibitive, place)),
            ):
                with pytest.raises(DiffersError, match="does not go as the plant file says"):
                    compare_one(plant, name, [gated])
                seen += 1
    assert seen > 100


def test_what_the_reading_ends_and_the_net_does_not_look_at_is_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model, loop = closed("one_robot")
    arrives = Plant.arrives
    monkeypatch.setattr(
        Plant, "arrives", lambda self, state: ({**one, "signal robot.at_cv1": False} for one in arrives(self, state))
    )
    plant, name = Plant(net, model), f"arrives/{model.arrivals.station}"
    with pytest.raises(DiffersError, match=f"'{name}' does not go as the plant file says"):
        compare_one(plant, name, by_happening(plant, loop.net.transitions)[name])


def test_what_is_broken_off_after_a_stop_is_found_where_both_readings_forget_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No state is compared in which a machine at rest breaks something off: so none may come about."""
    net, model, done = parse_net(STOPS), parse_plant(STOPS_PLANT), Plant.done
    monkeypatch.setattr(Laws, "_at_rest", lambda *_: iter([Case()]))
    monkeypatch.setattr(
        Plant,
        "done",
        lambda self, place, state: (
            {thing: value for thing, value in one.items() if not thing.startswith("breaks off")}
            for one in done(self, place, state)
        ),
    )
    plant, name = Plant(net, model, Sending.AT_ONCE), "R/done/r.rest"
    some = by_happening(plant, close(net, model, sending=Sending.AT_ONCE).net.transitions)[name]
    with pytest.raises(DiffersError, match=r"R breaks off the command of 'r\.grasp', and is at no stop"):
        compare_one(plant, name, some)


def test_a_machine_at_what_stops_it_at_once_is_a_difference() -> None:
    plant = Plant(parse_net(STOPS), parse_plant(STOPS_PLANT), Sending.AT_ONCE)
    with pytest.raises(DiffersError, match=r"'at R' becomes r\.halt, which it never is"):
        plant.assert_exists(plant.start, {"at R": "r.halt"})


def test_what_would_be_asked_in_too_many_states_is_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model, loop = closed("one_robot")
    monkeypatch.setattr(same_loop, "STATES_MAX", 10)
    with pytest.raises(UncomparedError, match="looks at more things than are compared"):
        compare(Plant(net, model), loop)


# --------------------------------------------------------------------------------------------------------------------
# Mutants of the loop


def test_every_transition_of_the_loop_that_is_left_out_is_missed() -> None:
    net, model, loop = closed("one_robot")
    plant = Plant(net, model)
    groups = by_happening(plant, loop.net.transitions)
    for t in loop.net.transitions:
        (name,) = (name for name, some in groups.items() if t in some)
        others = [other for other in groups[name] if other is not t]
        if t.name.endswith("/twice") or t.name.endswith("/set-already"):
            continue  # some ways of a completion that machines share are two transitions
        with pytest.raises(DiffersError, match="does not go as the plant file says"):
            pytest.fail(t.name) if compare_one(plant, name, others) else None


def changed(t: Transition) -> Iterator[Transition]:
    """The transition with each arc and gate left out, turned round, or made its opposite."""
    opposite = {"inputs": "permissive", "permissive": "inputs", "outputs": "inhibitive", "inhibitive": "outputs"}
    for kind, other in opposite.items():
        for place in getattr(t, kind):
            changes: dict[str, Any] = {kind: tuple(p for p in getattr(t, kind) if p != place)}
            yield replace(t, **changes)
            changes[other] = (*getattr(t, other), place)
            yield replace(t, **changes)


def test_every_change_of_an_arc_or_a_gate_of_the_loop_is_refused() -> None:
    """But for those after which the loop does the same: another transition does already what is let in."""
    net, model, loop = closed("two_robots_shared")
    plant = Plant(net, model)
    groups, count, same = by_happening(plant, loop.net.transitions), 0, set()
    for name, some in groups.items():
        for t in some[:1]:
            for mutant in list(changed(t)):
                count += 1
                try:
                    compare_one(plant, name, [mutant if one is t else one for one in some])
                except DiffersError:
                    continue
                same.add(t.name)
    assert count > 800
    assert all(name.endswith("/clamped") for name in same), same  # an empty station is an accident of its own


def test_a_loop_of_another_kind_is_refused() -> None:
    net, model, loop = closed("one_robot")
    others: tuple[tuple[ClosedLoop, str], ...] = (
        (close(net, model), "is missing in the loop"),
        (replace(loop, unsent={}), "still to be sent are others"),
        (replace(loop, shown=dict(list(loop.shown.items())[1:])), "that show the signals are others"),
        (replace(loop, net=with_token(loop.net, "plant.MC.idle")), "marked wrongly"),
        (replace(loop, net=with_move(loop.net, "thieves/come")), "nothing happens in the plant as 'thieves/come'"),
        (replace(loop, net=with_move(loop.net, "arrives/cv1_entry/again")), "may happen after an accident"),
    )
    for other, message in others:
        with pytest.raises(DiffersError, match=message):
            compare(Plant(net, model), other)


def with_token(net: Net, name: str) -> Net:
    return replace(net, places=tuple(replace(p, marked=not p.marked) if p.name == name else p for p in net.places))


def with_move(net: Net, name: str) -> Net:
    return replace(net, transitions=(*net.transitions, Transition(name, ("plant.MC.idle",))))


def test_sensors_that_are_not_exact_are_read_twice_too(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model = catalogue_net("one_robot"), other_plants(catalogue_plant("one_robot"), 3)
    loop = close(net, model, sending=Sending.LATE)
    compare(Plant(net, model), loop)
    for name in ("sensors_see", "wavers"):
        with monkeypatch.context() as patch:
            patch.setattr(Plant, name, lambda *_: iter([{}]))
            with pytest.raises(DiffersError):
                compare(Plant(net, model), loop)


def test_a_place_of_the_net_may_bear_any_name_that_the_plant_does_not() -> None:
    net, model, loop = closed("one_robot")
    assert Place("plant.MC.idle", "plant") not in net.places
    assert set(Plant(net, model).thing_of) == {place.name for place in loop.net.places}


@pytest.mark.parametrize("faults", Faults)
@pytest.mark.parametrize("sending", Sending)
@pytest.mark.parametrize("extra", ["", ", may_flicker: true", ", may_linger: true"])
def test_signals_that_change_together_are_read_twice_too(extra: str, sending: Sending, faults: Faults) -> None:
    both = BELT_PLANT.replace("arrivals:   {station: entry", "arrivals:   {station: table")
    sensed = BELT_PLANT.replace("{occupied: table}", "{occupied: table, may_linger: true}\n  belt.there: {holding: B")
    assert BELT_PLANT not in {both, sensed}
    for net, model in (together(), belts(extra), belts(extra, both), belts(extra, f"{sensed[:-1]}{extra}}}\n")):
        plant = Plant(net, model, sending, faults)
        assert set(plant.late) == {name for name in plant.truths if f"{name}/told" in plant.happenings}
        assert {"robot.holds", "belt.on_it"} & {*plant.late}
        compare(plant, close(net, model, faults, sending))


@pytest.mark.parametrize(
    ("what", "instead"),
    [
        ("told_late", lambda *_: frozenset()),
        (
            "told_late",
            lambda self, changes, _=(): frozenset(name for name, _ in changes if name not in self.completions),
        ),
        ("_with_news", lambda *args: iter([args[1]])),
        ("may_end", lambda *_: Case()),
        ("sent", lambda *args: [args[1]]),
        ("starting", {}),
        ("behind", {"belt.there": ()}),
        ("of", lambda *args: [args[1]]),
        ("moves", lambda _: iter(())),
        ("wanted", frozenset({("belt.entry", True), ("belt.on_it", True)})),
        ("completions", frozenset()),
    ],
)
def test_a_loop_that_tells_otherwise_is_refused(what: str, instead: object, monkeypatch: pytest.MonkeyPatch) -> None:
    net, model = belts()
    monkeypatch.setattr(Telling, what, instead)
    for sending in Sending:
        loop = close(net, model, sending=sending)
        with pytest.raises(DiffersError):
            compare(Plant(net, model, sending), loop)


@pytest.mark.parametrize("what", ["is_told", "may_end"])
def test_a_loop_that_waits_for_no_key_is_refused(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A key is told of before it changes again, and before the command is done that has released it."""
    net, model = catalogue_net("one_robot_timed"), catalogue_plant("one_robot_timed")
    monkeypatch.setattr(Telling, what, lambda *_: Case())
    with pytest.raises(DiffersError):
        compare(Plant(net, model), close(net, model, sending=Sending.LATE))


HANG = """
firable: 1
cell: hang
controllers:
  sys: {coordinator: true}
  a: {start: p, inputs: [s1, s2], places: {p: , q: }}
transitions:
  a.s1/told: {from: a.p, to: a.q, if: a.s1, unless: a.s2}
  back: {from: a.q, to: a.p}
"""
HANG_PLANT = """
firable_plant: 1
plant: hang
stations: [CV1]
arrivals: {station: CV1, every_s: 1}
departures: {station: CV1}
machines: {}
sensors: {a.s1: {occupied: CV1}, a.s2: {occupied: CV1}}
"""


def test_no_transition_of_the_cell_is_taken_for_what_happens_at_a_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    net, model = parse_net(HANG), parse_plant(HANG_PLANT, "hang.plant.yaml")
    with pytest.raises(InputError, match=r"'a\.s1/told' names one of the transitions, and what happens in the plant"):
        close(net, model)
    monkeypatch.setattr(closing, "_taken", lambda *_: ())
    loop = close(net, model)
    with pytest.raises(DiffersError, match=r"two things that happen are called 'a\.s1/told'"):
        compare(Plant(net, model, Sending.AT_ONCE), loop)


def test_a_place_of_the_cell_with_the_name_of_a_place_of_the_plant_is_refused() -> None:
    renamed = HANG.replace("a.s1/told:", "go:").replace("  a: {start: p", "  plant: {start: CV1.raw")
    net = parse_net(renamed.replace("{p: ,", "{CV1.raw: ,").replace("a.p", "plant.CV1.raw").replace("a.", "plant."))
    model = parse_plant(HANG_PLANT.replace("a.s", "plant.s"), "hang.plant.yaml")
    with pytest.raises(InputError, match=r"'plant\.CV1\.raw' would name two things .*: this place .*; and a raw"):
        close(net, model)
    with pytest.raises(DiffersError, match=r"'plant\.CV1\.raw' stands for the token of plant\.CV1\.raw"):
        _ = Plant(net, model).thing_of
