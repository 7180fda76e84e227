"""The loop of a cell with its machines: its transitions, workpieces that are judged, and its refusals."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import inspected_cell, together_cell
from support.bench_cell import JUDGED, bench, free_cell

from firable.analysis.loop.verdicts import check_loop
from firable.nets.catalogue import catalogue_names, catalogue_net, catalogue_path, catalogue_plant
from firable.nets.diagnostics import InputError
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ClosedLoop, Faults, Sending
from firable.nets.machines.moment import NOTHING, Case, each
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import Command, Controller, ExternalGate, Net, Place, Signal, SignalKind, Transition
from firable.nets.printing import format_net
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.player import Player

CELLS = [name for name in catalogue_names() if catalogue_path(name).with_name(f"{name}.plant.yaml").exists()]


def loop_of(cell: str, faults: Faults = Faults.NONE) -> ClosedLoop:
    return close(catalogue_net(cell), catalogue_plant(cell), faults)


# --- Literals


def test_the_four_kinds_of_arcs_follow_from_what_is_wanted_and_left() -> None:
    case = Case(
        (("input", True), ("output", False), ("permissive", True), ("inhibitive", False)),
        (("input", False), ("output", True)),
    )
    (moment,) = each([NOTHING], [case])
    assert moment.transition("t", "") == Transition("t", ("input",), ("output",), ("permissive",), ("inhibitive",))


def test_a_stop_and_a_start_in_one_firing_leave_the_machine_busy_and_make_no_self_loop() -> None:
    stop = Case((("busy", True), ("idle", False)), (("busy", False), ("idle", True)))
    start = Case((("idle", True), ("busy", False)), (("idle", False), ("busy", True)))
    (moment,) = each(each([NOTHING], [stop]), [start])
    assert moment.transition("t", "") == Transition("t", permissive=("busy",), inhibitive=("idle",))


def test_cases_that_contradict_each_other_are_no_firing() -> None:
    assert each([NOTHING], []) == []
    for value in (True, False):
        once = each([NOTHING], [Case((("p", value),), (("p", not value),))])
        assert each(once, [Case((("p", value),))]) == []
        assert len(each(once, [Case((("p", not value),))])) == 1


def test_what_is_said_of_a_firing_is_said_in_the_order_in_which_it_happens() -> None:
    (moment,) = each(each([NOTHING], [Case(tag="a", says="first")]), [Case(), Case(tag="b", says="then")][1:])
    assert (moment.tags, moment.says) == (("a", "b"), ("first", "then"))


def test_a_firing_that_waits_for_a_completion_and_sends_the_next_command_with_it_always_clears_it() -> None:
    net = parse_net(
        """\
firable: 1
cell: again
controllers:
  c:
    inputs: [entry, hand]
    places:
      to: {send: {machine: R, command: MOVE, to: TABLE}, until: done}
      back: {send: {machine: R, command: MOVE, to: HOME}, until: done}
transitions:
  t: {from: c.to, to: c.back}
"""
    )
    loop = close(net, bench())
    assert [name for name in loop.variants["t"] if name not in loop.accidents] == ["t/clears-c.done"]


# --- The loop


@pytest.mark.parametrize("cell", CELLS)
def test_the_loop_has_no_external_gates_and_the_cell_comes_first(cell: str) -> None:
    loop, net = loop_of(cell), catalogue_net(cell)
    assert not loop.net.signals
    assert not any(transition.external for transition in loop.net.transitions)
    assert [place.name for place in loop.net.places[: len(net.places)]] == [place.name for place in net.places]
    assert loop.net.initial_marking & (1 << len(net.places)) - 1 == net.initial_marking
    assert [transition.self_loops for transition in loop.net.transitions if transition.self_loops] == []


def test_the_loop_can_be_printed_and_read_back() -> None:
    net = loop_of("one_robot", Faults.REPAIRED).net
    assert parse_net(format_net(net)).transition_index.keys() == net.transition_index.keys()


def test_the_firing_that_enters_a_place_starts_its_machine_and_clears_its_completion() -> None:
    loop = loop_of("one_robot")
    bare, clearing, *_ = map(loop.net.transition, loop.variants["t1-a"])
    assert bare.outputs == ("robot.grasp_cv1", "plant.R.at.robot.grasp_cv1")
    assert bare.inputs == ("robot.to_cv1", "plant.R.idle")
    assert "robot.touch" in bare.inhibitive
    assert clearing.name == "t1-a/clears-robot.touch"
    assert clearing.inputs == ("robot.to_cv1", "robot.touch", "plant.R.idle")


def test_traces_map_back_to_the_names_of_the_cell() -> None:
    firings = (("arrives/cv1_entry",), ("G1/raw",), ("CV1/done/conveyor.cv1_run/raw",), ("G2/CV1-idle",))
    assert loop_of("one_robot").of_the_cell(firings) == (("G1",), ("G2",))


def test_a_gate_goes_by_what_its_controller_was_told() -> None:
    anew = loop_of("one_robot_timed").net.transition("t1-e")
    assert loop_of("one_robot_timed").shown["robot.reset"] == ("plant.robot.reset.told_1", True)
    assert "plant.robot.reset.told_1" in anew.permissive
    # Of the part in the machine nobody is told late who could go by it (`excluding.py`).
    g4 = loop_of("one_robot_timed").net.transition("G4")
    assert loop_of("one_robot_timed").shown["mc.part_present"] == ("plant.mc_table.empty", False)
    assert "plant.mc_table.empty" in g4.inhibitive


def test_a_sensor_that_may_flicker_is_a_bit_that_drops_and_returns() -> None:
    loop = close(free_cell(), bench(", may_flicker: true"))
    names = loop.net.transition_index
    assert {"c.entry/drops", "c.entry/returns"} <= names.keys()
    assert "c.entry/clears" not in names
    assert "c.entry" in loop.net.transition("arrives/entry").outputs


def test_a_sensor_that_may_linger_clears_after_the_workpiece_has_gone() -> None:
    loop = close(free_cell(), bench(", may_linger: true"))
    names = loop.net.transition_index
    assert "c.entry/clears" in names
    assert "c.entry/drops" not in names
    assert "arrives/entry/c.entry-on" in names


LINGERING = """\
firable: 1
cell: lingering
controllers:
  robot:
    start: free
    inputs: entry
    places:
      free:
      grasp: {send: {machine: R, command: GRASP, at: ENTRY}, until: grasped}
      move:  {send: {machine: R, command: MOVE, to: EXIT}, until: there}
      put:   {send: {machine: R, command: PUT, at: EXIT}, until: holds}
      back:  {send: {machine: R, command: MOVE, to: ENTRY}, until: there}
transitions:
  come: {from: robot.free, to: robot.grasp, if: robot.entry}
  t1:   {from: robot.grasp, to: robot.move}
  t2:   {from: robot.move, to: robot.put}
  t3:   {from: robot.put, to: robot.back}
  t4:   {from: robot.back, to: robot.free}
"""


@pytest.mark.parametrize("extra", ["", ", may_linger: true"])
def test_a_sensor_that_may_linger_need_not_where_a_completion_waits_for_it(extra: str) -> None:
    """That the hand holds something ends no laying down: not even where the sensor may take its time to see that."""
    model = parse_plant(together_cell.PLANT.replace("robot.holds: {holding: R}", f"robot.holds: {{holding: R{extra}}}"))
    report = check_loop(parse_net(LINGERING), model)
    assert report.verdict("loop.deadlock-free").status is Status.VIOLATED


def test_two_belts_that_start_in_one_firing_are_told_apart() -> None:
    """Each may still have its workpiece, or take one."""
    places = (
        Place("c.rest", "c", marked=True),
        Place("c.one", "c", command=Command("A", "RUN")),
        Place("c.two", "c", command=Command("B", "RUN")),
    )
    net = Net("belts", places, (Transition("both", ("c.rest",), ("c.one", "c.two")),), (), (Controller("c"),))
    belts = "".join(
        f"  {name}: {{commands: {{RUN: {{does: carry, from: {source}, to: {target}, takes_s: 1}}}}}}\n"
        for name, source, target in (("A", "s", "t"), ("B", "t", "u"))
    )
    plant = "firable_plant: 1\nplant: belts\nstations: [s, t, u]\narrivals: {station: s, every_s: 1}\n"
    loop = close(net, parse_plant(f"{plant}departures: {{station: u}}\nmachines:\n{belts}sensors: {{}}\n"))
    assert {"both", "both/A-goes-on", "both/B-goes-on", "both/A-goes-on/B-goes-on"} <= {*loop.variants["both"]}


def test_only_what_may_fail_fails_and_only_what_is_repairable_is_repaired() -> None:
    net = free_cell()
    for faults, failing in ((Faults.NONE, set()), (Faults.REPAIRED, {"R"}), (Faults.FOR_GOOD, {"R", "M"})):
        loop = close(net, bench(), faults)
        assert set(loop.failed) == failing
        fails = {name.partition("/")[0] for name in loop.net.transition_index if "/fails/" in name}
        assert fails == failing
        repaired = {name.partition("/")[0] for name in loop.net.transition_index if name.endswith("/repaired")}
        assert repaired == ({"R"} if faults is Faults.REPAIRED else set())


def test_a_plant_that_does_not_fit_the_net_is_refused() -> None:
    plant = catalogue_plant("one_robot")
    with pytest.raises(InputError) as refusal:
        close(catalogue_net("two_robots_separate"), plant)
    assert {problem.code for problem in refusal.value.diagnostics} == {"F5003"}


def test_no_machine_has_the_name_of_the_verdict_on_accidents() -> None:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    with pytest.raises(InputError, match=r"F5003.*'safe' is the verdict on accidents"):
        parse_plant(text.replace("\n  MC:\n", "\n  safe:\n"), "cell.plant.yaml")


def test_a_firing_with_more_outcomes_than_the_loop_can_tell_apart_is_refused() -> None:
    machines = "".join(
        f"  M{i}:\n    commands:\n      GO: {{does: clamp, station: table, takes_s: 1}}\n" for i in range(13)
    )
    plant = parse_plant(
        PLANT_OF_NOTHING.replace("[s]", "[s, table]").replace("machines: {}\n", f"machines:\n{machines}")
    )
    places = [Place("c.from", "c", marked=True)]
    places += [Place(f"c.p{i}", "c", command=Command(f"M{i}", "GO"), completion=f"c.done{i}") for i in range(13)]
    signals = [Signal(f"c.done{i}", "c", SignalKind.COMPLETION) for i in range(13)]
    signals += [Signal("plant.entry", "plant"), Signal("plant.hand", "plant")]
    every = Transition("all", ("c.from",), tuple(place.name for place in places[1:]))
    net = Net("many", tuple(places), (every,), tuple(signals), (Controller("c"), Controller("plant")))
    with pytest.raises(InputError) as refusal:
        close(net, plant)
    assert [(one.code, one.subject) for one in refusal.value.diagnostics] == [("F3007", ("transitions", "all", "to"))]


def test_a_firing_with_more_outcomes_than_that_with_what_controllers_are_told_of_it_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Five machines have 32, and of each completion that somebody looks at there may be news when it is cleared."""
    machines = range(5)
    commands = "".join(f"  M{i}: {{commands: {{GO: {{does: work, takes_s: 1}}}}}}\n" for i in machines)
    plant = parse_plant(
        "firable_plant: 1\nplant: many\nstations: [s]\narrivals: {station: s, every_s: 5}\ndepartures: {station: s}\n"
        f"machines:\n{commands}sensors: {{}}\n"
    )
    working = [Place(f"c.p{i}", "c", command=Command(f"M{i}", "GO"), completion=f"c.done{i}") for i in machines]
    signals = [Signal(f"c.done{i}", "c", SignalKind.COMPLETION) for i in machines]
    marked, names = (Place("c.from", "c", marked=True), Place("c.calm", "c", marked=True)), [p.name for p in working]
    nobody = tuple(ExternalGate(f"c.done{i}", wanted=False) for i in machines)
    transitions = (
        Transition("all", ("c.from",), tuple(names)),
        Transition("watch", ("c.calm",), ("c.seen",), external=nobody),
    )
    net = Net("many", (*marked, Place("c.seen", "c"), *working), transitions, tuple(signals), (Controller("c"),))
    assert 600 < len(close(net, plant).variants["all"]) < 1_000
    monkeypatch.setattr("firable.nets.machines.closing.TOLD_MAX", 600)
    with pytest.raises(InputError, match=r"F3007.*'all' sends commands with more than 600 outcomes") as refusal:
        close(net, plant)
    assert [one.subject for one in refusal.value.diagnostics] == [("transitions", "all", "to")]


def test_a_net_with_a_name_that_the_plant_takes_is_refused() -> None:
    text = "firable: 1\ncell: x\ncontrollers:\n  plant:\n    inputs: [entry, hand]\n    places: {p: }\n"
    plant = parse_plant(PLANT_OF_NOTHING)
    with pytest.raises(InputError) as refusal:
        close(parse_net(text), plant)
    assert "F2001" in {problem.code for problem in refusal.value.diagnostics}


def test_a_name_that_two_things_of_the_loop_would_have_is_told_where_its_cause_is_written() -> None:
    net = parse_net(
        """\
firable: 1
cell: x
controllers:
  c:
    places: {idle: , stop: {send: {machine: R, command: STOP}, until: stopped}}
    start: idle
places:
  raw: {send: {machine: R, command: MOVE, to: HERE}}
  halt: {send: {machine: R, command: STOP}, until: halted}
  halt/undone-raw: {send: {machine: R, command: STOP}, until: late}
transitions:
  t: {from: c.idle, to: c.stop}
""",
        "x.firable.yaml",
    )
    commands = "{MOVE: {does: move, takes_s: 1}, STOP: {does: stop, takes_s: 1}}"
    machines = f"machines: {{R: {{hand: HERE, positions: {{HERE: }}, commands: {commands}}}}}"
    plant = PLANT_OF_NOTHING[: PLANT_OF_NOTHING.index("sensors:")].replace("machines: {}", machines)
    with pytest.raises(InputError) as refusal:
        close(net, parse_plant(plant.replace("[s]", "[s, R.breaks_off]"), "x.plant.yaml"))
    found = [(one.code, one.subject, str(one.span or "")) for one in refusal.value.diagnostics]
    assert found == [
        ("F2001", ("stations", "1"), "x.plant.yaml:3:15"),
        ("F2001", ("places", "halt/undone-raw"), ""),
    ]
    place, happening = (str(one) for one in refusal.value.diagnostics)
    assert "'plant.R.breaks_off.raw' would name two things of the cell with its machines: R breaks off" in place
    assert "; and a raw workpiece lies on R.breaks_off" in place
    assert "rename 'R.breaks_off'" in place
    assert "'R/done/halt/undone-raw' would name two things" in happening


def test_a_completion_with_the_name_of_a_thing_of_the_plant_is_told_where_it_is_written_and_once() -> None:
    text = "firable: 1\ncell: x\nplaces: {a: {send: {machine: M, command: GO}, until: plant.accident}}\n"
    commands = "{GO: {does: work, takes_s: 1}}"
    plant = PLANT_OF_NOTHING[: PLANT_OF_NOTHING.index("sensors:")].replace("{}", f"{{M: {{commands: {commands}}}}}")
    with pytest.raises(InputError) as refusal:
        close(parse_net(text), parse_plant(plant))
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.subject) == ("F2001", ("places", "a"))
    assert "this completion of the net; and something happened that must not" in problem.message
    assert problem.hint.startswith("rename 'plant.accident':")
    taken = parse_net(text.replace("plant.accident", "done") + "transitions: {M/done/a: {}}\n")
    with pytest.raises(InputError) as refusal:
        close(taken, parse_plant(plant))
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.subject) == ("F2001", ("transitions", "M/done/a"))


def test_a_controller_with_the_name_of_the_plant_is_told_that_the_machines_have_it() -> None:
    net = parse_net("firable: 1\ncell: x\ncontrollers: {plant: {places: {a: }}}\n")
    with pytest.raises(InputError) as refusal:
        close(net, parse_plant(PLANT_OF_NOTHING[: PLANT_OF_NOTHING.index("sensors:")]))
    (problem,) = refusal.value.diagnostics
    assert (problem.code, problem.subject) == ("F2001", ("controllers", "plant"))
    assert "'plant' would name two controllers of the cell with its machines" in problem.message


def test_gates_on_the_own_input_and_output_ask_for_what_firing_asks_for_already() -> None:
    text = "firable: 1\ncell: x\ncontrollers: {{c: {{start: a, places: {{a: , b: }}}}}}\ntransitions:\n  t: {}\n"
    plant = parse_plant(PLANT_OF_NOTHING[: PLANT_OF_NOTHING.index("sensors:")])
    bare, gated = (
        close(parse_net(text.format(t)), plant).net
        for t in ("{from: c.a, to: c.b}", "{from: c.a, to: c.b, if: c.a, unless: c.b}")
    )
    assert gated.transitions == bare.transitions


def test_who_has_a_key_that_stands_alone_is_asked_what_it_means() -> None:
    commands = "{GO: {does: work, takes_s: 1, may_fail: }}"
    plant = PLANT_OF_NOTHING.replace("{}", f"{{M: {{hand: , commands: {commands}}}}}").replace(
        "plant.hand: {occupied: s}", "plant.hand: {holding: }"
    )
    with pytest.raises(InputError) as refusal:
        parse_plant(plant)
    found = [(one.code, one.hint) for one in refusal.value.diagnostics]
    keys = ("hand", "may_fail", "holding")
    assert found == [("F1010", f"write it, or leave `{key}` out for what holds without it") for key in keys]


PLANT_OF_NOTHING = """\
firable_plant: 1
plant: nothing
stations: [s]
arrivals: {station: s, every_s: 1}
departures: {station: s}
machines: {}
sensors:
  plant.entry: {occupied: s}
  plant.hand: {occupied: s}
"""


# --- Workpieces that are judged


def test_a_workpiece_is_found_good_or_not_some_time_after_it_has_come() -> None:
    loop = close(inspected_cell.net(), inspected_cell.plant())
    assert loop.shown["camera.ok"] == ("plant.table.passes", True)
    assert loop.shown["camera.nok"] == ("plant.table.fails", True)
    assert "plant.table.fails" in loop.net.transition("reject").permissive
    good, bad = (loop.net.transition(f"table/judged/{found}") for found in ("passes", "fails"))
    assert (good.outputs, bad.outputs) == (("plant.table.passes",), ("plant.table.fails",))
    for one in (good, bad):
        assert {"plant.table.empty", "plant.table.passes", "plant.table.fails"} < {*one.inhibitive, *one.outputs}
    assert bad.description == "the workpiece on table is judged, and is not found good"
    gone = [loop.net.transition(f"R/done/robot.take_bad{way}") for way in ("", "/table-passed", "/table-failed")]
    assert ["plant.table.passes" in one.inputs for one in gone] == [False, True, False]
    assert ["plant.table.fails" in one.inputs for one in gone] == [False, False, True]


def test_whatever_a_workpiece_was_found_it_is_judged_no_more_when_it_was_machined() -> None:
    net = close(free_cell(judged=True), bench(judged=JUDGED)).net
    verdicts = {"plant.table.passes", "plant.table.fails"}
    machined = [t for t in net.transitions if t.name.startswith("M/done/c.run")]
    assert {frozenset({*t.inputs} & verdicts) for t in machined} == {
        frozenset(),
        frozenset({"plant.table.passes"}),
        frozenset({"plant.table.fails"}),
    }
    assert all(verdicts <= {*t.inputs, *t.inhibitive} for t in machined)


@pytest.mark.parametrize("faults", Faults)
@pytest.mark.parametrize("sending", Sending)
def test_one_judgement_stands_as_long_as_a_workpiece_lies_there_and_nothing_changes_it(
    faults: Faults, sending: Sending
) -> None:
    loop = close(inspected_cell.net(), inspected_cell.plant(), faults, sending)
    empty, passes, fails = (1 << loop.net.place_index[f"plant.table.{word}"] for word in ("empty", "passes", "fails"))
    player, found, open_ = Player(loop.net), set[int](), [loop.net.initial_marking]
    seen = set()
    while open_:
        marking = open_.pop()
        assert [bool(marking & bit) for bit in (empty, passes, fails)].count(True) <= 1
        for t in player.firable(marking):
            after = player.fire(marking, [t])
            was, now = marking & (empty | passes | fails), after & (empty | passes | fails)
            seen.add((was, now))
            if after not in found:
                found.add(after)
                open_.append(after)
    assert {(was, now) for was, now in seen if was != now} == {
        *((empty, 0), (0, passes), (0, fails), (passes, empty), (fails, empty))
    }


def test_a_judgement_never_makes_a_loop_restless() -> None:
    loop = close(free_cell(judged=True), bench(judged=JUDGED))
    verdicts = {f"plant.{station}.{word}" for station in ("entry", "table", "exit") for word in ("passes", "fails")}
    for t in loop.net.transitions:
        if {*t.inputs, *t.outputs} <= verdicts and (t.inputs or t.outputs):
            assert "/judged/" in t.name
            assert not t.inputs, "it happens once for a workpiece that lies there"


def test_every_completion_and_sensor_of_the_catalogue_is_shown_by_something() -> None:
    for cell in CELLS:
        loop = loop_of(cell)
        signals = [signal for signal in loop.cell.signals if signal.kind is not SignalKind.TIMER]
        assert loop.shown.keys() == {signal.name for signal in signals}
        for signal in signals:
            place, means = loop.shown[signal.name]
            assert place in loop.net.place_index
            assert means or signal.kind is SignalKind.SENSOR


def test_the_plant_file_of_the_manual_is_one() -> None:
    manual = (Path(__file__).parents[2] / "docs" / "machines.md").read_text("utf-8")
    model = parse_plant(manual.partition("```yaml\n")[2].partition("```")[0])
    assert set(model.machines) == {"R", "MC", "BELT"}
