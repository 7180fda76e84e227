"""The verdicts on a cell with its machines: what gates free is too hopeful about, accidents, faults."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import count
from random import Random

import pytest
from support import inspected_cell, rejecting_cell
from support.bench_cell import COMMANDS, JUDGED, PLANT, bench, free_cell
from support.drawn_cells import drawn_cell
from support.examples import seeds

from firable.analysis.check import check
from firable.analysis.loop.faults import ask_faults, check_faults
from firable.analysis.loop.verdicts import LoopReport, ask_loop, check_loop, known_live, live_in
from firable.analysis.spaces.reachability import Budget, explore
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_plant
from firable.nets.formula import Deadlock, parse_formula
from firable.nets.machines.closing import close
from firable.nets.machines.loop import Faults
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.machines.telling import Telling
from firable.nets.net import ExternalGate, Net, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.temporal import Logic, parse_temporal
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.player import Player

SIZES = {
    "one_robot": (92, 178, 746, 1976),
    "one_robot_mc_late": (91, 176, 1838, 5670),
    "one_robot_mc_late_capacity": (92, 178, 746, 1976),
    "one_robot_timed": (124, 592, 5894, 22270),
    "two_robots_shared": (105, 159, 1706, 5080),
    "two_robots_separate": (105, 159, 1706, 5080),
    "index_table": (52, 64, 153, 302),
}


def text_of(cell: str, kind: str = "firable") -> str:
    return catalogue_path(cell).with_name(f"{cell}.{kind}.yaml").read_text("utf-8")


def plant_with(old: str, new: str, cell: str = "one_robot") -> PlantModel:
    text = text_of(cell, "plant")
    assert old in text
    return parse_plant(text.replace(old, new))


def net_with(old: str, new: str, cell: str = "one_robot") -> Net:
    text = text_of(cell)
    assert old in text
    return parse_net(text.replace(old, new))


@cache
def report_of(cell: str) -> LoopReport:
    return check_loop(catalogue_net(cell), catalogue_plant(cell))


def replays(report: LoopReport, name: str) -> None:
    """The witness is a run of the loop, and without the machines one of the open net."""
    witness = report.verdict(name).witness
    assert witness is not None
    for net, firings in (
        (report.loop.net, witness.firings),
        (report.loop.cell, report.loop.of_the_cell(witness.firings)),
    ):
        player, marking = Player(net), net.initial_marking
        for fired in firings:
            marking = player.fire(marking, [net.transition_index[one] for one in fired])


# --- The catalogue


@pytest.mark.parametrize("cell", SIZES)
def test_sizes_of_the_loops_of_the_catalogue(cell: str) -> None:
    report = report_of(cell)
    figures = report.closed.figures
    net = report.loop.net
    assert (len(net.places), len(net.transitions), figures.markings, figures.edges) == SIZES[cell]


def test_no_accident_happens_in_two_cells_and_every_transition_is_live_there() -> None:
    loop = close(catalogue_net("two_cells"), catalogue_plant("two_cells"))
    space = explore(loop.net)
    assert (space.n_markings, space.n_edges) == (75_464, 358_254)
    assert not any(space.fired()[loop.net.transition_index[name]] for name in loop.accidents)
    live = space.live()
    assert all(any(live[loop.net.transition_index[name]] for name in variants) for variants in loop.variants.values())


@pytest.mark.parametrize("cell", [cell for cell in SIZES if cell != "one_robot_mc_late"])
def test_the_good_cells_hold_everything_with_their_machines_too(cell: str) -> None:
    report = report_of(cell)
    assert {verdict.name for verdict in report.verdicts if not verdict.holds} == set()
    assert not any(one.differs for one in report.differences)
    assert not any(explore(report.closed.net).contacts())


def test_the_late_cell_hangs_with_its_machines_as_it_does_without() -> None:
    report = report_of("one_robot_mc_late")
    hangs = report.verdict("loop.deadlock-free")
    assert hangs.status is Status.VIOLATED
    assert hangs.witness is not None
    assert hangs.witness.note.startswith("from here no transition of the cell ever fires again: R is at PUT at=MC")
    replays(report, "loop.deadlock-free")
    assert report.verdict("loop.property.no_deadlock").status is Status.VIOLATED
    assert not any(one.differs for one in report.differences)


@pytest.mark.parametrize("cell", SIZES)
def test_what_is_proved_to_be_safe_with_gates_free_is_safe_with_the_machines(cell: str) -> None:
    report = report_of(cell)
    safe = {PropertyKind.NEVER, PropertyKind.ALWAYS}
    for of in report.loop.cell.properties:
        if isinstance(of, Property) and of.kind in safe and of.formula != Deadlock():
            free = report.opened.verdict(f"property.{of.name}")
            assert free.status is not Status.PROVED or report.verdict(f"loop.property.{of.name}").holds


# --- Mistakes that gates free cannot see


def test_a_sensor_on_the_wrong_station_lets_the_cell_hang_though_gates_free_calls_it_live() -> None:
    report = check_loop(catalogue_net("one_robot"), plant_with("{occupied: mc_table}", "{occupied: cv2_entry}"))
    assert report.opened.verdict("live").holds
    gates = report.verdict("loop.gates-open")
    assert gates.status is Status.VIOLATED
    assert gates.subjects == ("G4",)
    assert gates.witness is not None
    assert gates.witness.note == "from here the gates of G4 never open again: G4 waits for mc.part_present"
    hopeful = [one for one in report.differences if one.differs]
    assert {"deadlock-free", "live", "property.restart"} <= {one.question for one in hopeful}
    assert {one.remark for one in hopeful} >= {"gates free was too hopeful: here a gate that it opened stays closed"}
    replays(report, "loop.gates-open")


def test_a_net_that_does_not_wait_for_its_robot_commands_it_while_it_is_busy() -> None:
    net = net_with("command: MOVE,  to: CV1},  until: at_cv1, ", "command: MOVE,  to: CV1}, ")
    report = check_loop(net, catalogue_plant("one_robot"))
    busy = report.verdict("loop.busy-machines")
    assert busy.status is Status.VIOLATED
    assert busy.witness is not None
    assert busy.witness.note == "R is given GRASP at=CV1 while it is at another command"
    assert busy.witness.firings[-1] == ("t1-a/R-busy",)
    replays(report, "loop.busy-machines")
    remarks = {one.question: one.remark for one in report.differences if one.differs}
    assert remarks["property.restart"] == "gates free knows of no accidents: here one ends the run"


def test_an_exit_that_is_not_cleared_in_time_is_a_collision() -> None:
    report = check_loop(catalogue_net("one_robot"), plant_with(", when_full: wait", ""))
    collision = report.verdict("loop.accidents")
    assert collision.status is Status.VIOLATED
    assert collision.witness is not None
    assert collision.witness.note == "CV2 pushes its workpiece onto cv2_exit, where another lies"
    replays(report, "loop.accidents")


def test_a_place_that_is_marked_at_first_waits_in_vain_for_a_command_that_was_never_sent() -> None:
    net = net_with("start: [cv1, cv2]", "start: [cv1, cv2_run]")
    net = replace(net, properties=())
    report = check_loop(net, catalogue_plant("one_robot"))
    lost = report.verdict("loop.completions")
    assert (lost.status, lost.subjects) == (Status.VIOLATED, ("conveyor.cv2_run",))
    assert report.verdict("loop.live").status is Status.VIOLATED


def test_a_completion_that_two_commands_share_can_be_lost() -> None:
    net = parse_net(SHARED)
    report = check_loop(net, bench())
    lost = report.verdict("loop.completions")
    assert lost.status is Status.VIOLATED
    assert "c.clamp and c.unclamp" in lost.subjects


SHARED = """\
firable: 1
cell: shared
controllers:
  c:
    start: [a, b]
    inputs: [entry, hand]
    places:
      a:
      b:
      clamp: {send: {machine: R, command: MOVE, to: TABLE}, until: done}
      unclamp: {send: {machine: M, command: UNCLAMP}, until: done}
transitions:
  t: {from: c.a, to: c.clamp}
  u: {from: c.b, to: c.unclamp}
  t2: {from: c.clamp, to: c.a}
  u2: {from: c.unclamp, to: c.b}
"""


# --- Properties of the net file


def test_start_is_the_marking_of_the_cell_wherever_its_machines_are() -> None:
    assert report_of("one_robot").verdict("loop.property.restart").holds


def test_formulas_of_temporal_logic_are_asked_with_the_variants_of_each_transition() -> None:
    properties = (
        TemporalProperty("again", Logic.CTL, parse_temporal("AG (system.carrying_in -> EF firable(G5))")),
        TemporalProperty("order", Logic.LTL, parse_temporal("not fires(G5) W fires(G2)")),
        TemporalProperty("wrong", Logic.LTL, parse_temporal("not fires(G2) W fires(G5)")),
    )
    net = replace(catalogue_net("one_robot"), properties=properties)
    report = check_loop(net, catalogue_plant("one_robot"))
    found = [str(report.verdict(f"loop.property.{name}").status) for name in ("again", "order", "wrong")]
    assert found == ["proved", "proved", "violated"]


def test_a_deadlock_within_a_formula_is_unknown_where_a_sensor_never_rests() -> None:
    inner = Property("inner", PropertyKind.NEVER, parse_formula("deadlock and robot.put_mc"))
    bare = Property("bare", PropertyKind.NEVER, Deadlock())
    net = replace(catalogue_net("one_robot_mc_late"), properties=(inner, bare))
    plant = plant_with("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}", "one_robot_mc_late")
    report = check_loop(net, plant)
    assert report.verdict("loop.property.inner").status is Status.UNKNOWN
    assert "flicker" in report.verdict("loop.property.inner").bound
    assert report.verdict("loop.property.bare").status is Status.VIOLATED
    steady = check_loop(net, catalogue_plant("one_robot_mc_late"))
    assert steady.verdict("loop.property.inner").status is Status.VIOLATED


def test_a_deadlock_within_a_formula_is_unknown_where_workpieces_come_and_go_at_one_station() -> None:
    net = parse_net("""
firable: 1
cell: hangs
controllers:
  a: {start: p, places: {p: , q: {send: {machine: M, command: GO}, until: done}, r: }}
transitions:
  begins: {from: a.p, to: a.q}
  ends: {from: a.q, to: a.r}
properties:
  never: {never: deadlock}
  always: {always: not deadlock}
  reached: {reachable: deadlock and a.r}
""")
    for leaves, found in (
        ("there", ("violated", "unknown", "unknown")),
        ("elsewhere", ("violated", "violated", "proved")),
    ):
        plant = parse_plant(f"""
firable_plant: 1
plant: hangs
stations: [there, elsewhere]
arrivals: {{station: there, every_s: 8}}
departures: {{station: {leaves}, after_s: 1}}
machines:
  M: {{commands: {{GO: {{does: work, takes_s: 1}}}}}}
""")
        report = check_loop(net, plant)
        assert tuple(str(report.verdict(f"loop.property.{one.name}").status) for one in net.properties) == found


def test_a_cell_that_a_camera_sends_two_ways_is_judged_both_ways_and_holds_everything() -> None:
    asked = {
        "good": (PropertyKind.REACHABLE, "robot.take_good"),
        "bad": (PropertyKind.REACHABLE, "robot.take_bad"),
        "rests": (PropertyKind.REACHABLE, "deadlock"),
    }
    made = tuple(Property(name, kind, parse_formula(text)) for name, (kind, text) in asked.items())
    report = check_loop(replace(inspected_cell.net(), properties=made), inspected_cell.plant())
    verdicts = {one.name: one.status for one in report.verdicts}
    assert verdicts.pop("loop.property.rests") is Status.VIOLATED, "asked, for a judgement keeps nothing moving"
    assert set(verdicts.values()) == {Status.PROVED}
    names = [one.name for one in report.verdicts if not one.holds]
    assert names == ["loop.property.rests"]


@pytest.mark.parametrize("verdict", ["ok", "nok"])
def test_a_cell_that_forgets_one_judgement_hangs(verdict: str) -> None:
    t = {"ok": "accept", "nok": "reject"}[verdict]
    net = inspected_cell.net()
    net = replace(net, transitions=tuple(one for one in net.transitions if one.name != t))
    report = check_loop(net, inspected_cell.plant())
    hangs = report.verdict("loop.deadlock-free")
    assert hangs.status is Status.VIOLATED
    assert hangs.witness is not None
    found = {"ok": "passes", "nok": "fails"}[verdict]
    assert f"plant.table.{found}" in hangs.witness.marking
    assert report.verdict("loop.accidents").holds


def test_a_cell_that_takes_the_lack_of_one_judgement_for_the_other_is_told_of_an_empty_station() -> None:
    net = inspected_cell.net()
    wrong = [
        replace(t, inputs=("robot.free", "camera.idle"), external=(ExternalGate("camera.nok", wanted=False),))
        if t.name == "accept"
        else t
        for t in net.transitions
    ]
    assert (
        not check_loop(replace(net, transitions=tuple(wrong)), inspected_cell.plant()).verdict("loop.accidents").holds
    )


def test_a_workpiece_that_is_thrown_out_as_it_came_is_an_accident_unless_it_may_leave_raw() -> None:
    net = rejecting_cell.net()
    assert all(verdict.holds for verdict in check_loop(net, rejecting_cell.plant()).verdicts)
    found = check_loop(net, rejecting_cell.plant(rejecting_cell.PLANT.replace(", raw: true", "")))
    accident = found.verdict("loop.accidents")
    assert accident.witness is not None
    assert accident.witness.firings[-1] == ("leaves/bin/raw",)
    one = rejecting_cell.PLANT.replace("  - {station: bin, after_s: 2, raw: true}\n", "")
    assert not check_loop(net, rejecting_cell.plant(one)).verdict("loop.deadlock-free").holds, "the bin fills up"


def test_a_budget_that_ends_leaves_the_loop_unknown() -> None:
    net, plant = catalogue_net("one_robot"), catalogue_plant("one_robot")
    report = check_loop(net, plant, Budget(markings=20, seconds=0.0))
    assert report.status is Status.UNKNOWN
    assert report.verdict("loop.live").status is Status.UNKNOWN


# --- Faults


def faults_of(net: Net, plant: PlantModel) -> dict[str, Status]:
    return {verdict.name: verdict.status for verdict in check_faults(check_loop(net, plant), plant)}


@pytest.mark.parametrize("cell", SIZES)
def test_every_machine_of_every_cell_may_fail_and_be_repaired(cell: str) -> None:
    """But for a lamp, which nobody waits for."""
    plant = catalogue_plant(cell)
    own = {name: {does.does for does in one.commands.values()} for name, one in plant.machines.items()}
    may_fail = {name for name, does in own.items() if does != {"switch"}}
    for faults in (Faults.FOR_GOOD, Faults.REPAIRED):
        assert set(close(catalogue_net(cell), plant, faults).failed) == may_fail


def test_no_fault_of_two_cells_is_an_accident_and_after_a_repair_every_transition_is_live() -> None:
    net, plant = catalogue_net("two_cells"), catalogue_plant("two_cells")
    loop = close(net, plant, Faults.FOR_GOOD)
    space = explore(loop.net)
    assert space.n_markings > 75_464
    assert not any(space.fired()[loop.net.transition_index[name]] for name in loop.accidents)
    loop = close(net, plant, Faults.REPAIRED)
    live = explore(loop.net).live()
    assert all(any(live[loop.net.transition_index[name]] for name in variants) for variants in loop.variants.values())


def test_each_fault_of_the_one_robot_cell_is_safe_stops_all_and_is_recovered_from() -> None:
    plant = catalogue_plant("one_robot")
    verdicts = {verdict.name: verdict for verdict in check_faults(report_of("one_robot"), plant)}
    assert verdicts.pop("fault.safe").holds
    for machine in ("R", "MC", "CV1", "CV2"):
        assert verdicts.pop(f"fault.{machine}.repaired").holds
        gone = verdicts.pop(f"fault.{machine}")
        assert gone.status is Status.VIOLATED
        assert len(gone.subjects) == 15
        assert gone.hint.startswith("in the end all stand still; these can hold their token for ever")
        assert gone.witness is not None
        assert gone.witness.note.startswith(f"{machine} has failed, and")
    assert not verdicts


def test_a_part_of_the_cell_that_does_not_need_the_machine_goes_on() -> None:
    text = """\
firable: 1
cell: apart
controllers:
  c:
    start: [a, b]
    inputs: [entry, hand]
    places:
      a:
      b:
      clamp: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
      stand:
transitions:
  t: {from: c.a, to: c.clamp}
  t2: {from: c.clamp, to: c.a}
  u: {from: c.b, to: c.stand}
  u2: {from: c.stand, to: c.b}
"""
    net = parse_net(text)
    (safe, gone, repaired) = check_faults(check_loop(net, bench()), bench())[:3]
    assert (safe.holds, repaired.holds) == (True, True)
    assert gone.subjects == ("t", "t2")
    assert gone.hint == "these go on whatever fails at it: u, u2; these can hold their token for ever: c.clamp"


def test_a_fault_of_one_machine_takes_nothing_from_what_another_one_does() -> None:
    text = """\
firable: 1
cell: two
controllers:
  c:
    start: [a, b]
    inputs: [entry, hand]
    places:
      a:
      b:
      moves: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
      frees: {send: {machine: M, command: UNCLAMP}, until: free}
transitions:
  t: {from: c.a, to: c.moves}
  t2: {from: c.moves, to: c.a}
  u: {from: c.b, to: c.frees}
  u2: {from: c.frees, to: c.b}
"""
    old = "UNCLAMP: {does: release, station: table, takes_s: 1}"
    assert old in PLANT
    plant = parse_plant(PLANT.replace(old, f"{old[:-1]}, may_fail: for_good}}"))
    verdicts = {verdict.name: verdict for verdict in check_faults(check_loop(parse_net(text), plant), plant)}
    assert verdicts["fault.R"].subjects == ("t", "t2")
    assert verdicts["fault.M"].subjects == ("u", "u2")
    assert verdicts["fault.M"].hint.endswith("hold their token for ever: c.frees")


def test_a_fault_that_leads_to_an_accident_is_not_safe() -> None:
    net = net_with("command: MOVE,  to: CV1},  until: at_cv1, ", "command: MOVE,  to: CV1}, ")
    assert faults_of(net, catalogue_plant("one_robot"))["fault.safe"] is Status.VIOLATED


HASTY = """\
firable: 1
cell: hasty
controllers:
  c:
    start: [idle]
    inputs: [entry, hand]
    places:
      idle:
      frees: {send: {machine: M, command: UNCLAMP}}
      again: {send: {machine: M, command: UNCLAMP}, until: free}
      moves: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
transitions:
  t: {from: c.idle, to: c.frees}
  u: {from: c.frees, to: c.again}
  v: {from: c.again, to: c.moves}
"""


def test_an_accident_before_anything_may_fail_is_none_of_a_fault() -> None:
    report = check_loop(parse_net(HASTY), bench())
    assert report.verdict("loop.busy-machines").status is Status.VIOLATED
    assert faults_of(parse_net(HASTY), bench())["fault.safe"] is Status.PROVED
    old = "UNCLAMP: {does: release, station: table, takes_s: 1}"
    assert old in PLANT
    plant = parse_plant(PLANT.replace(old, f"{old[:-1]}, may_fail: for_good}}"))
    assert [*close(parse_net(HASTY), plant, Faults.FOR_GOOD).failed] == ["R", "M"]
    assert faults_of(parse_net(HASTY), plant)["fault.safe"] is Status.VIOLATED, "M fails, and is given its command"

    before = parse_net(HASTY.replace("[idle]", "[idle, other]").replace("idle:\n", "idle:\n      other:\n"))
    before = replace(before, transitions=(*before.transitions, Transition("w", ("c.other",), ("c.moves",))))
    (safe, *_) = check_faults(check_loop(before, bench()), bench())
    assert safe.status is Status.VIOLATED
    assert safe.witness is not None
    assert [fired for (fired,) in safe.witness.firings if "/fails/" in fired] == ["R/fails/c.moves"]
    assert "plant.R.failed" in safe.witness.marking


def test_a_plant_in_which_nothing_may_fail_has_no_verdicts_on_faults() -> None:
    assert not faults_of(catalogue_net("one_robot"), plant_with(", may_fail: repairable", ""))


def test_what_fails_for_good_is_not_said_to_be_repaired() -> None:
    names = faults_of(catalogue_net("one_robot"), plant_with("may_fail: repairable", "may_fail: for_good")).keys()
    assert {name for name in names if name.endswith(".repaired")} == set()
    assert "fault.R" in names


STARTING = """\
firable: 1
cell: starting
controllers:
  c:
    start: [cold, a]
    inputs: [entry, hand]
    places:
      cold:
      warm:
      a:
      clamp: {send: {machine: R, command: MOVE, to: TABLE}, until: at_table}
transitions:
  boot: {from: c.cold, to: c.warm}
  t: {from: c.a, to: c.clamp}
  t2: {from: c.clamp, to: c.a}
"""


def test_a_fault_is_not_to_blame_for_what_nobody_knows_to_be_live_without_it() -> None:
    net = parse_net(STARTING)
    known = ask_loop(net, bench())
    assert known_live(known) == live_in(known) == ("t", "t2")
    told = {verdict.name: verdict for verdict in ask_faults(known, bench()).verdicts()}
    assert (told["fault.R.repaired"].holds, told["fault.R"].subjects) == (True, ("t", "t2"))

    ended = ask_loop(net, bench(), Budget(markings=1, seconds=0.0))
    assert (known_live(ended), live_in(ended)) == ((), ("boot", "t", "t2"))
    told = {verdict.name: verdict for verdict in ask_faults(ended, bench()).verdicts()}
    for name in ("fault.R.repaired", "fault.R"):
        assert (told[name].status, told[name].witness) == (Status.UNKNOWN, None)
        assert told[name].subjects == ("boot", "t", "t2")
    assert told["fault.R"].bound == "it cannot fire again then, and is not known to be live without faults"
    assert "1 markings" in told["fault.R.repaired"].bound


def test_of_a_fault_it_is_told_what_is_not_known_of_it() -> None:
    asked = ask_faults(ask_loop(parse_net(STARTING), bench()), bench())
    lasting = asked.for_good
    assert lasting is not None

    def hint_without(*names: str) -> str:
        """What is told of the fault where these properties are not decided."""
        undecided = {f"property.fault.R.{name}" for name in names}
        left = (replace(v, status=Status.UNKNOWN) if v.name in undecided else v for v in lasting.report.verdicts)
        answered = replace(lasting, report=replace(lasting.report, verdicts=tuple(left))).doubting(())
        return next(one.hint for one in replace(asked, for_good=answered).verdicts() if one.name == "fault.R")

    still, hang = "in the end all stand still", "these can hold their token for ever"
    assert hint_without() == f"{still}; {hang}: c.warm, c.clamp"
    assert hint_without("t1", "p1") == f"it is not known of these: t2; {hang}: c.clamp"
    assert hint_without("p0", "p1", "p2", "p3") == still


# --- Any net


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(3))
def test_that_something_is_set_from_outside_could_be_told_late_and_nothing_else_would_come_of_it(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = (drawn_cell(each) for each in count(1_000 * seed) if "set_by" in drawn_cell(each).plant_text)
    told = ((cell, close(cell.net, cell.plant)) for cell in cells)
    cell, loop = next((c, one) for c, one in told if explore(one.net, budget=Budget(markings=2_000)).complete)
    at_once = ask_loop(cell.net, cell.plant)
    monkeypatch.setattr(Telling, "from_outside", frozenset())
    late = ask_loop(cell.net, cell.plant)
    assert len(late.loop.net.places) >= len(loop.net.places)
    for family in at_once.families:
        now, then = at_once.of(family), late.of(family)
        assert {of: one.status for of, one in now.items()} == {of: one.status for of, one in then.items()}, cell


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(10))
def test_what_can_never_happen_with_gates_free_never_happens_in_the_loop(seed: int) -> None:
    judged = ["", JUDGED][seed % 2]
    net = free_cell(tuple(Random(seed).sample(list(COMMANDS), 4)), judged=bool(judged))
    report = check_loop(net, bench(judged=judged))
    places = [place.name for place in net.places]
    pairs = [(p, q) for p in places for q in places if p < q]
    asked = [Property(f"x{i}", PropertyKind.NEVER, parse_formula(f"{p} and {q}")) for i, (p, q) in enumerate(pairs)]
    free = check(replace(net, properties=tuple(asked)))
    closed = check(replace(report.loop.net, properties=tuple(asked)))
    for one in asked:
        assert not free.verdict(f"property.{one.name}").holds or closed.verdict(f"property.{one.name}").holds
