"""Whether the machines keep the gates of global transitions open from the vote to the firing (O4)."""

from __future__ import annotations

import pytest
from support.bench_cell import bench

from firable.analysis.evidence.checking.checker import check_document
from firable.analysis.evidence.document import document_from_text
from firable.analysis.loop.verdicts import check_loop
from firable.analysis.spaces.reachability import explore
from firable.decompose.proofs.assumptions import Assumption, assumptions
from firable.decompose.proofs.held_gates import COMMANDS, COMPLETIONS, held_gates, name_of
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_plant
from firable.nets.machines.closing import close
from firable.nets.machines.loop import ACCIDENT, Sending
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.text import parse_net
from firable.nets.verdict import Status
from firable.semantics.player import Player

LINGERS = "o4.G1/conveyor.part_at_entry"
CELLS = [
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity"),
    *("two_robots_shared", "two_robots_separate", "index_table"),
]


def plant_with(old: str, new: str) -> PlantModel:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    assert old in text
    return parse_plant(text.replace(old, new))


@pytest.mark.parametrize("cell", CELLS)
def test_the_machines_of_the_catalogue_keep_every_assumption(cell: str) -> None:
    decomposition = split(catalogue_net(cell))
    verdicts = held_gates(decomposition, catalogue_plant(cell)).verdicts
    assert [verdict.name for verdict in verdicts] == [*map(name_of, assumptions(decomposition)), COMPLETIONS, COMMANDS]
    assert all(verdict.holds for verdict in verdicts)


@pytest.mark.parametrize(
    ("until", "broken"), [("", {f"o4.t1-{way}/robot.reset" for way in "efghi"}), (", until: at_rest", set())]
)
def test_a_key_holds_until_the_way_back_fires_where_the_fault_place_waits_for_its_stop(
    until: str, broken: set[str]
) -> None:
    # As docs/time-limits.md says of this cell.
    text = catalogue_path("one_robot_timed").read_text("utf-8")
    net = parse_net(
        text.replace("command: STOP}, description: stopped", f"command: STOP}}{until}, description: stopped")
    )
    found = held_gates(split(net), catalogue_plant("one_robot_timed")).verdicts
    assert {verdict.name for verdict in found if not verdict.holds} == broken


@pytest.mark.parametrize(
    ("old", "new", "name", "move", "others"),
    [
        ("{occupied: mc_table}", "{occupied: mc_table, may_flicker: true}", "o4.G4/mc.part_present", "drops", set()),
        ("{occupied: cv1_entry}", "{occupied: cv1_entry, may_linger: true}", LINGERS, "clears", {COMMANDS}),
    ],
)
def test_a_sensor_that_is_not_exact_breaks_its_assumption(
    old: str, new: str, name: str, move: str, others: set[str]
) -> None:
    plant = plant_with(old, new)
    net = catalogue_net("one_robot")
    verdicts = {verdict.name: verdict for verdict in held_gates(split(net), plant).verdicts}
    broken = verdicts.pop(name)
    assert broken.status is Status.VIOLATED
    assert "interlock" in broken.hint
    assert broken.witness is not None
    signal = name.partition("/")[2]
    assert broken.witness.firings[-2:] == ((f"{signal}/{move}",), (f"{signal}/told/falls",))
    # An entry that seems to be taken lets the conveyor start with nothing on it.
    assert {verdict.name for verdict in verdicts.values() if not verdict.holds} == others

    loop = held_gates(split(net), plant).loop
    player, marking = Player(loop.net), loop.net.initial_marking
    place, means = loop.shown[name.partition("/")[2]]
    shown = []
    for (fired,) in broken.witness.firings:
        shown.append(bool(marking >> loop.net.place_index[place] & 1) == means)
        marking = player.fire(marking, [loop.net.transition_index[fired]])
    assert loop.net.names(marking) == broken.witness.marking
    assert shown[-1], "open at the vote"
    assert (place in broken.witness.marking) != means, "and closed after it"


@pytest.mark.parametrize(("during", "holds"), [("mc.machining", False), ("mc.release", True)])
def test_a_judgement_that_machining_changes_after_the_vote_breaks_its_assumption(during: str, holds: bool) -> None:
    text = (
        catalogue_path("one_robot").read_text("utf-8").replace("inputs: part_present", "inputs: [part_present, fine]")
    )
    seen = text.replace("description: robot free}\n", "description: robot free}\n      seen:\n").replace(
        "\nproperties:\n",
        f"  peek: {{from: robot.free, to: robot.seen, if: [{during}, mc.fine]}}\n"
        "  back: {from: robot.seen, to: robot.free}\n\nproperties:\n",
    )
    net = parse_net(seen)
    plant = plant_with(
        "robot.touch:            {holding: R}", "robot.touch: {holding: R}\n  mc.fine: {passes: mc_table}"
    )
    found = held_gates(split(net), plant)
    broken = {verdict.name: verdict for verdict in found.verdicts}["o4.peek/mc.fine"]
    assert broken.holds == holds
    if not holds:
        assert broken.witness is not None
        *_, (done,), (last,) = broken.witness.firings
        assert done == "MC/done/mc.machining/mc_table-passed"
        assert last.startswith("mc.fine/told/falls")


def test_a_gate_that_another_machine_closes_is_found() -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    # The exit is free now: nothing keeps it so until the robot has put its workpiece.
    wrong = text.replace(
        "from: [system.processing, robot.free, mc.release, conveyor.cv2]\n",
        "from: [system.processing, robot.free, mc.release, conveyor.cv2]\n    unless: mc.entry_taken\n",
    ).replace("inputs: part_present", "inputs: [part_present, entry_taken]")
    plant = plant_with(
        "robot.touch:            {holding: R}", "robot.touch: {holding: R}\n  mc.entry_taken: {occupied: cv1_entry}"
    )
    net = parse_net(wrong)
    verdicts = {verdict.name: verdict for verdict in held_gates(split(net), plant).verdicts}
    taken = verdicts["o4.G6/mc.entry_taken"]
    assert taken.status is Status.VIOLATED
    assert taken.witness is not None
    # By the other sensor there a gate opens: so of this one the controller may be told later.
    assert taken.witness.firings[-1] == ("mc.entry_taken/told/rises",)
    assert taken.witness.firings.count(("arrives/cv1_entry",)) == 2
    assert taken.witness.note == "'t2-42' had voted yes, and the last firing makes 'mc.entry_taken' 1"


LOCAL_BESIDE_GLOBAL = """\
firable: 1
cell: beside
controllers:
  sys:
    coordinator: true
    start: [s]
    places: {s: , s2: }
  a:
    start: [p]
    inputs: door
    places: {p: , q: , run: {send: {machine: B, command: RUN}, until: out}}
transitions:
  g: {from: [a.p, sys.s], to: [a.q, sys.s2]}
  h: {from: [a.q, sys.s2], to: [a.p, sys.s]}
  l: {from: a.p, to: a.run, if: a.door}
  m: {from: a.run, to: a.p}
arbiters:
  ar: {among: [l, g], by: rotation}
"""
ITS_MACHINE = """\
firable_plant: 1
plant: beside
stations: [entry, exit]
arrivals:   {station: entry, every_s: 8}
departures: {station: exit, after_s: 1}
machines:
  B:
    commands:
      RUN:   {does: carry, from: entry, to: exit, takes_s: 4.0, when_full: wait}
sensors:
  a.door: {occupied: entry}
"""


def test_two_gates_whose_names_are_one_without_what_parts_them_are_two_questions() -> None:
    assert name_of(Assumption("G", "b.c.s", wanted=True)) != name_of(Assumption("G.b", "c.s", wanted=True))


def test_the_gate_of_a_local_transition_that_the_coordinator_decides_is_asked_of_the_machines() -> None:
    decomposition = split(parse_net(LOCAL_BESIDE_GLOBAL))
    exact = held_gates(decomposition, parse_plant(ITS_MACHINE)).verdicts
    assert [verdict.name for verdict in exact] == ["o4.l/a.door", COMPLETIONS, COMMANDS]
    assert all(verdict.holds for verdict in exact)
    flickering = parse_plant(ITS_MACHINE.replace("{occupied: entry}", "{occupied: entry, may_flicker: true}"))
    broken = held_gates(decomposition, flickering).verdicts[0]
    assert broken.status is Status.VIOLATED
    assert broken.witness is not None
    assert broken.witness.firings[-2:] == (("a.door/drops",), ("a.door/told/falls",))


def test_a_gate_of_a_part_that_waits_for_a_completion_to_be_cleared_is_asked_whatever_that_is() -> None:
    """The part of `l` votes only before its command was ever sent."""
    text = LOCAL_BESIDE_GLOBAL.replace("if: a.door}", "if: a.door, unless: a.out}").replace(
        "to: a.p}\na", "to: a.q}\na"
    )
    flickering = parse_plant(ITS_MACHINE.replace("{occupied: entry}", "{occupied: entry, may_flicker: true}"))
    verdicts = held_gates(split(parse_net(text)), flickering).verdicts
    assert {verdict.name: verdict.status for verdict in verdicts[:2]} == {
        "o4.l/a.door": Status.VIOLATED,
        "o4.l/a.out": Status.PROVED,
    }


def test_a_controller_that_reads_a_gate_without_a_token_is_told_to_have_one() -> None:
    text = (
        LOCAL_BESIDE_GLOBAL.replace("    inputs: door\n", "")
        .replace("if: a.door", "")
        .replace("\ntransitions:", "\n  c: {inputs: door}\ntransitions:")
    )
    net = parse_net(text.replace("to: [a.q, sys.s2]}", "to: [a.q, sys.s2], if: c.door}"))
    asked = held_gates(split(net), parse_plant(ITS_MACHINE.replace("a.door", "c.door"))).verdicts[0]
    assert (asked.name, asked.status) == ("o4.g/c.door", Status.VIOLATED)
    assert asked.hint.startswith("let the controller that reads 'c.door' give a token to 'g'")


ONE_COMPLETION_OF_TWO = """\
firable: 1
cell: shared
controllers:
  sys: {coordinator: true, start: [s, k], places: {s: , s2: , k: , k2: }}
  a:
    start: [p, q]
    places:
      p:
      q:
      run:   {send: {machine: A, command: RUN}, until: out}
      again: {send: {machine: A, command: RUN}, until: out}
  b:
    start: idle
    places: {idle: , turn: {send: {machine: B, command: TURN}, until: turned}}
transitions:
  begin: {from: b.idle, to: b.turn}
  turned: {from: [b.turn, sys.k], to: [b.idle, sys.k2]}
  next: {from: sys.k2, to: sys.k}
  start: {from: a.p, to: a.run}
  ended: {from: [a.run, sys.s], to: [a.p, sys.s2]}
  back: {from: sys.s2, to: sys.s}
  other: {from: a.q, to: a.again}
  done: {from: [a.again, sys.s2], to: [a.q, sys.s]}
"""
WORKING = """\
firable_plant: 1
plant: shared
stations: [entry]
arrivals:   {station: entry, every_s: 8}
departures: {station: entry}
machines:
  A: {commands: {RUN: {does: work, takes_s: 1}}}
  B: {commands: {TURN: {does: work, takes_s: 1}}}
"""


def test_a_completion_that_another_command_clears_while_its_part_has_voted_is_found() -> None:
    held = held_gates(split(parse_net(ONE_COMPLETION_OF_TWO)), parse_plant(WORKING))
    completions = held.verdicts[0]
    assert (completions.name, completions.status) == (COMPLETIONS, Status.VIOLATED)
    assert completions.subjects == ("a.out for ended", "a.out for done"), "nothing clears b.turned but what comes after"
    assert completions.hint == "let each command that clears it have a completion of its own"
    assert completions.witness is not None
    assert completions.witness.note.startswith("'t1-21' had voted yes, and the last firing makes 'a.out' 0")
    assert completions.witness.firings[-1][0].startswith("sent/a.again")


def test_nothing_is_asked_of_a_transition_that_wants_a_signal_both_1_and_0_for_which_nobody_votes() -> None:
    both = "\n  never: {from: sys.s, to: sys.s2, if: [a.light, a.out], unless: [a.light, a.out]}"
    text = LOCAL_BESIDE_GLOBAL.replace("inputs: door", "inputs: [door, light]").replace(
        "\ntransitions:", f"\ntransitions:{both}"
    )
    net = parse_net(text.replace("among: [l, g]", "among: [l, g, never]"))
    verdicts = held_gates(split(net), parse_plant(f"{ITS_MACHINE}  a.light: {{occupied: exit}}\n")).verdicts
    assert [verdict.name for verdict in verdicts] == ["o4.l/a.door", COMPLETIONS, COMMANDS]
    assert all(verdict.holds for verdict in verdicts)


TWO_STATIONS = """\
firable: 1
cell: stations
controllers:
  sys: {coordinator: true, start: s, inputs: [one, two], places: {s: , u: }}
  robot:
    start: free
    places:
      free:
      fill_one:  {send: {machine: R, command: TO_ONE},   until: filled_one}
      fill_two:  {send: {machine: R, command: TO_TWO},   until: filled_two}
      clear_two: {send: {machine: R, command: FROM_TWO}, until: cleared_two}
      clear_one: {send: {machine: R, command: FROM_ONE}, until: cleared_one}
transitions:
  t1: {from: robot.free, to: robot.fill_one}
  t2: {from: robot.fill_one, to: robot.fill_two}
  t3: {from: robot.fill_two, to: robot.clear_two}
  t4: {from: robot.clear_two, to: robot.clear_one}
  t5: {from: robot.clear_one, to: robot.free}
  g: {from: sys.s, to: sys.u, if: [robot.clear_two, sys.one, sys.two]}
  back: {from: sys.u, to: sys.s}
"""
THEIR_ROBOT = """\
firable_plant: 1
plant: stations
stations: [entry, one, two, exit]
arrivals:   {station: entry, every_s: 8}
departures: {station: exit, after_s: 1}
machines:
  R:
    commands:
      TO_ONE:   {does: carry, from: entry, to: one, takes_s: 1}
      TO_TWO:   {does: carry, from: entry, to: two, takes_s: 1}
      FROM_TWO: {does: carry, from: two, to: exit, takes_s: 1, when_full: wait}
      FROM_ONE: {does: carry, from: one, to: exit, takes_s: 1, when_full: wait}
sensors:
  sys.one: {occupied: one}
  sys.two: {occupied: two}
"""


def test_a_gate_that_closes_after_the_other_one_of_its_vote_is_not_kept_open_either() -> None:
    verdicts = held_gates(split(parse_net(TWO_STATIONS)), parse_plant(THEIR_ROBOT)).verdicts
    runs = {verdict.name: verdict.witness.firings for verdict in verdicts[:2] if verdict.witness is not None}
    assert {name: (firings[-2], firings[-1]) for name, firings in runs.items()} == {
        "o4.g/sys.one": (("sent/robot.clear_one",), ("sys.one/told/falls",)),
        "o4.g/sys.two": (("sent/robot.clear_two",), ("sys.two/told/falls",)),
    }
    assert ("sys.two/told/falls",) in runs["o4.g/sys.one"], "the other one has been closed for long"


FILLING = """\
firable: 1
cell: filling
controllers:
  sys: {coordinator: true, start: [s, k], places: {s: , s2: , k: , k2: }}
  a:
    inputs: door
    places: {p: , run: {send: {machine: B, command: RUN}, until: out}}
transitions:
  fills: {from: sys.s, to: [sys.s2, a.run], if: a.door}
  ends: {from: a.run, to: a.p}
  again: {from: [a.p, sys.s2], to: sys.s}
  beside: {from: sys.k, to: sys.k2, if: a.door, unless: a.run}
  back: {from: sys.k2, to: sys.k}
"""


def test_nobody_has_voted_while_a_place_that_the_part_needs_empty_is_full() -> None:
    verdicts = held_gates(split(parse_net(FILLING)), parse_plant(ITS_MACHINE)).verdicts
    assert [verdict.name for verdict in verdicts] == ["o4.fills/a.door", "o4.beside/a.door", COMPLETIONS, COMMANDS]
    assert [verdict.holds for verdict in verdicts] == [True] * 4


TWO_COMMAND_ONE_BELT = """\
firable: 1
cell: late
controllers:
  c:
    start: rest
    inputs: [entry, hand]
    places:
      rest:
      runs: {send: {machine: B, command: RUN}}
      stops: {send: {machine: B, command: STOP}}
  d:
    places:
      told:
      goes: {send: {machine: B, command: WAIT}}
transitions:
  begin: {from: c.rest, to: c.runs, if: c.entry}
  hand_over: {from: c.runs, to: [c.stops, d.told]}
  go: {from: d.told, to: d.goes}
"""


def test_a_command_that_overtakes_that_of_another_controller_is_found_though_at_one_instant_all_is_well() -> None:
    net = parse_net(TWO_COMMAND_ONE_BELT)
    assert check_loop(net, bench()).verdict("loop.busy-machines").holds
    late = {verdict.name: verdict for verdict in held_gates(split(net), bench()).verdicts}[COMMANDS]
    assert late.status is Status.VIOLATED
    assert late.witness is not None
    assert late.witness.note == "B is given WAIT while it is at another command"
    assert late.hint == "let a completion of the one machine gate the command to the other"
    assert ("hand_over",) in late.witness.firings
    assert ("sent/c.stops/stops-c.runs",) not in late.witness.firings


def test_in_two_cells_a_robot_that_does_not_wait_meets_the_workpiece_that_a_late_conveyor_has_not_taken() -> None:
    text = catalogue_path("two_cells").with_name("two_cells.plant.yaml").read_text("utf-8")
    impatient = text.replace("jitter_s: 0.2, when_full: wait, ", "jitter_s: 0.2, ")
    assert impatient != text
    found = []
    for plant, sending in ((text, Sending.LATE), (impatient, Sending.AT_ONCE), (impatient, Sending.LATE)):
        loop = close(catalogue_net("two_cells"), parse_plant(plant), sending=sending)
        space = explore(loop.net)
        accident = space.marked(loop.net.place_index[ACCIDENT])
        found.append((space.complete, space.count(accident) > 0))
    assert found == [(True, False), (True, False), (True, True)]


def test_a_drill_that_votes_on_what_has_come_may_have_looked_while_the_table_was_turning() -> None:
    """Its station is empty then, and the table is asked later whether it has turned."""
    text = catalogue_path("index_table").read_text("utf-8")
    third, looks = text[text.index("  G3:") : text.index("  t1-a:")], "{from: drill.looking,"
    fourth = (
        third.replace("G3:", "G4:")
        .replace("number: 3", "number: 4")
        .replace("drill.looking]", "drill.empty]\n    unless: drill.part_there")
    )
    gated = third.replace("drill.looking]", "drill.clamping]\n    if: drill.part_there") + fourth
    without = "".join(line for line in text.splitlines(keepends=True) if looks not in line and "looking:" not in line)
    net = parse_net(without.replace(third, gated))
    found = {verdict.name: verdict for verdict in held_gates(split(net), catalogue_plant("index_table")).verdicts}
    broken = {name: verdict.status for name, verdict in found.items() if not verdict.holds}
    assert broken == {f"o4.{name}/drill.part_there": Status.VIOLATED for name in ("G3", "G4")}
    witness = found["o4.G4/drill.part_there"].witness
    assert witness is not None
    assert "T/lays/table.turning/load/raw" in witness.firings[-2][0]
    assert witness.firings[-1][0].startswith("drill.part_there/told/rises")


def test_the_verdicts_leave_evidence_that_the_checker_confirms(monkeypatch: pytest.MonkeyPatch) -> None:
    net = catalogue_net("one_robot")
    held = held_gates(split(net), catalogue_plant("one_robot"))
    ((file, text),) = held.evidence().items()
    assert file == "o4.evidence.json"
    monkeypatch.setattr("firable.analysis.evidence.document.PLAIN_BYTES_MAX", 0)
    assert list(held.evidence()) == ["o4.evidence.json.gz"]
    checked = list(check_document(document_from_text(text.decode())))
    asked = ["o4.G1/conveyor.part_at_entry", "o4.G4/mc.part_present", "o4.completion.0"]
    assert [one.record.name for one in checked][:3] == [f"property.{name}" for name in asked]
    assert all(one.shown and one.record.proved and not one.only_claimed for one in checked)
