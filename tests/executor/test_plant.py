"""The simulated cell: the laws it obeys, the faults it raises, and the file that describes it."""

import re
from pathlib import Path

import pytest
from support.plant_bench import TEXT, Bench

from firable.executor.cell.disturbances import Drops, NeverCompletes, StuckSensor
from firable.executor.cell.plant import CommandDone, SensorChanged, Workpiece
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.diagnostics import InputError, Severity
from firable.nets.machines.fitting import late_limits, misfits, otherwise_than
from firable.nets.machines.plant_file import parse_plant, read_plant
from firable.nets.text import parse_net

CELLS = [
    *("one_robot", "one_robot_mc_late", "one_robot_mc_late_capacity", "two_robots_shared", "two_robots_separate"),
]


def plant_path(cell: str) -> Path:
    return catalogue_path(cell).with_name(f"{cell}.plant.yaml")


def test_workpiece_goes_through_and_is_delivered_once() -> None:
    bench = Bench(workpieces=1)
    bench.load()
    for command in ("CLAMP", "RUN", "UNCLAMP"):
        bench.do("M", command)
    bench.do("R", "GRASP", at="TABLE")
    bench.do("R", "MOVE", to="EXIT")
    bench.do("R", "PUT", at="EXIT")
    assert bench.faults == []
    assert [(workpiece.id, workpiece.processed) for workpiece in bench.plant.delivered] == [(1, 1)]
    assert bench.plant.inside == ()
    assert bench.plant.next_seconds is None


def test_command_is_acknowledged_when_its_time_is_over_and_not_before() -> None:
    bench = Bench()
    bench.give("R", "MOVE", to="ENTRY")
    assert bench.wait(1.9) == []
    assert bench.wait(0.2) == [CommandDone(1)]


def test_sensor_is_seen_before_the_command_is_acknowledged() -> None:
    bench = Bench(workpieces=1)
    bench.do("R", "MOVE", to="ENTRY")
    assert bench.do("R", "GRASP", at="ENTRY") == [
        SensorChanged("entry", value=False),
        SensorChanged("hand", value=True),
        CommandDone(2),
    ]


def test_next_workpiece_waits_until_the_station_is_empty() -> None:
    bench = Bench()
    bench.wait(20.0)
    assert bench.plant.entered == 1
    bench.fetch()
    assert bench.plant.entered == 2
    assert bench.plant.inside == (1, 2)


def test_putting_onto_an_occupied_station_is_a_fault() -> None:
    bench = Bench()
    bench.load()
    bench.fetch()
    bench.do("R", "MOVE", to="TABLE")
    bench.do("R", "PUT", at="TABLE")
    assert bench.faults == ["R pushes workpiece 2 onto table, where workpiece 1 lies"]


def test_putting_with_patience_waits_until_the_station_is_empty() -> None:
    bench = Bench(
        text=TEXT.replace("  M:\n", "  S:\n    commands: {X: {does: carry, from: table, to: exit, takes_s: 1}}\n  M:\n")
    )
    bench.load()
    for command in ("CLAMP", "RUN", "UNCLAMP"):
        bench.do("M", command)
    bench.fetch()
    bench.do("R", "MOVE", to="TABLE")
    assert bench.do("R", "HOLD", at="TABLE") == []
    bench.do("S", "X")
    assert bench.faults == []
    assert bench.plant.stations["table"] is not None
    assert bench.plant.stations["table"].id == 2


@pytest.mark.parametrize(
    ("commands", "fault"),
    [
        ([("R", "GRASP", {"at": "ENTRY"})], "R is to grasp at ENTRY, and its hand is at HOME"),
        (
            [("R", "MOVE", {"to": "TABLE"}), ("R", "GRASP", {"at": "TABLE"})],
            "R grasps at TABLE, where no workpiece lies",
        ),
        ([("R", "MOVE", {"to": "TABLE"}), ("R", "PUT", {"at": "TABLE"})], "R is to put at TABLE and holds nothing"),
        ([("R", "MOVE", {"to": "MOON"})], "R does not know the position MOON of MOVE"),
        ([("M", "CLAMP", {})], "M clamps on table, where no workpiece lies"),
        ([("M", "RUN", {})], "M is to machine on table, where no workpiece lies"),
        ([("M", "DANCE", {})], "M does not know the command DANCE"),
        ([("B", "RUN", {}), ("M", "RUN", {})], "M machines workpiece 1, which is not clamped"),
        (
            [("B", "RUN", {}), ("M", "CLAMP", {}), ("M", "RUN", {}), ("M", "RUN", {})],
            "M machines workpiece 1 a second time",
        ),
        (
            [("B", "RUN", {}), ("M", "CLAMP", {}), ("R", "MOVE", {"to": "TABLE"}), ("R", "GRASP", {"at": "TABLE"})],
            "R pulls at a workpiece that is clamped on table",
        ),
        ([("B", "RUN", {}), ("B", "RUN", {})], "B pushes workpiece 2 onto table, where workpiece 1 lies"),
    ],
)
def test_broken_law_is_a_fault_that_stops_the_cell(commands: list[tuple[str, str, dict[str, str]]], fault: str) -> None:
    bench = Bench()
    for machine, command, parameters in commands:
        assert bench.faults == []
        bench.do(machine, command, **parameters)
        bench.wait(2.0)
    assert bench.faults == [fault]
    assert bench.plant.next_seconds is None
    assert bench.give("R", "MOVE", to="HOME") == []


def test_commanding_a_busy_machine_is_a_fault() -> None:
    bench = Bench()
    bench.give("R", "MOVE", to="ENTRY")
    bench.give("R", "MOVE", to="HOME")
    assert bench.faults == ["R is given MOVE while it is at MOVE"]


def test_stop_ends_a_command_without_acknowledgement_and_the_part_stays_on_the_belt() -> None:
    bench = Bench(workpieces=1)
    bench.give("B", "RUN")
    bench.wait(1.0)
    assert bench.do("B", "STOP") == [CommandDone(2)]
    assert bench.plant.inside == (1,)
    bench.do("B", "RUN")
    assert bench.plant.stations["table"] is not None


STOPPABLE = TEXT.replace("      GRASP:", "      STOP:  {does: stop, takes_s: 0.5}\n      GRASP:") + (
    "  key:   {acknowledges: R, after_s: 2}\n"
)


def test_stop_that_takes_time_is_done_at_rest_and_what_was_not_near_its_end_is_left_undone() -> None:
    bench = Bench(text=STOPPABLE)
    bench.give("R", "MOVE", to="ENTRY")
    bench.wait(0.5)
    assert bench.give("R", "STOP") == []
    assert bench.wait(0.25) == []
    assert bench.give("R", "STOP") == []
    assert bench.wait(0.25) == []
    assert bench.wait(0.25) == [CommandDone(3)]
    assert bench.plant.machines["R"].position == "HOME"
    assert bench.wait(1.75) == []
    assert bench.wait(0.25) == [SensorChanged("key", value=True)]
    assert bench.do("R", "MOVE", to="ENTRY") == [SensorChanged("key", value=False), CommandDone(4)]


def test_key_is_pressed_after_a_stop_that_the_safe_outputs_cut_short() -> None:
    bench = Bench(text=STOPPABLE)
    bench.give("R", "MOVE", to="ENTRY")
    bench.wait(0.5)
    bench.give("R", "STOP")
    bench.wait(0.25)
    bench.plant.stand("R")
    assert bench.wait(1.0) == []
    assert bench.wait(1.0) == [SensorChanged("key", value=True)]


def test_what_a_stop_breaks_off_near_its_end_may_still_be_done_before_the_machine_rests_and_no_one_is_told() -> None:
    seen = set()
    for seed in range(20):
        bench = Bench(text=STOPPABLE, workpieces=1, seed=seed)
        bench.do("R", "MOVE", to="ENTRY")
        bench.give("R", "GRASP", at="ENTRY")
        bench.wait(0.75)
        assert bench.give("R", "STOP") == []
        bench.wait(0.125)
        assert bench.give("R", "STOP") == []
        assert bench.wait(0.375) in ([], [SensorChanged("entry", value=False), SensorChanged("hand", value=True)])
        seen.add(bench.plant.machines["R"].holding is not None)
        assert bench.wait(0.125) == [CommandDone(4)]
        holding = bench.plant.machines["R"].holding
        bench.wait(3)
        assert bench.plant.machines["R"].holding is holding, "what is at rest does nothing"
    assert seen == {True, False}


def test_what_a_stop_breaks_off_may_still_end_in_its_accident() -> None:
    seen = set()
    for seed in range(20):
        bench = Bench(text=STOPPABLE, workpieces=0, seed=seed)
        bench.do("R", "MOVE", to="ENTRY")
        bench.give("R", "GRASP", at="ENTRY")
        bench.wait(0.75)
        bench.do("R", "STOP")
        seen.add(tuple(bench.faults))
    assert seen == {(), ("R grasps at ENTRY, where no workpiece lies",)}


@pytest.mark.parametrize("stopped_after", [3.5, 4.5], ids=["before it waits", "while it waits"])
def test_what_a_stop_breaks_off_at_a_full_station_may_still_be_done_when_that_becomes_free(
    stopped_after: float,
) -> None:
    text = STOPPABLE.replace("takes_s: 4}", "takes_s: 4, when_full: wait}").replace(
        "STOP: {does: stop}", "STOP: {does: stop, takes_s: 5}"
    )
    seen = set()
    for seed in range(20):
        bench = Bench(text=text, seed=seed)
        bench.load()
        bench.do("R", "MOVE", to="TABLE")
        bench.give("B", "RUN")
        bench.wait(stopped_after)
        bench.give("B", "STOP")
        bench.wait(1.5)
        assert bench.plant.machines["B"].holding is not None
        bench.give("R", "GRASP", at="TABLE")
        bench.wait(1.25)
        assert bench.faults == []
        seen.add(bench.plant.stations["table"] is not None)
        assert (bench.plant.stations["table"] is None) == (bench.plant.machines["B"].holding is not None)
    assert seen == {True, False}


@pytest.mark.parametrize("draw", [0.9, 0.1], ids=["undone", "done"])
@pytest.mark.parametrize("stopped_after", [3.5, 4.5], ids=["before it waits", "while it waits"])
def test_whether_what_is_broken_off_is_still_done_is_drawn_once(
    monkeypatch: pytest.MonkeyPatch, stopped_after: float, draw: float
) -> None:
    text = STOPPABLE.replace("takes_s: 4}", "takes_s: 4, when_full: wait}")
    bench = Bench(text=text.replace("STOP: {does: stop}", "STOP: {does: stop, takes_s: 50}"))
    bench.load()
    bench.do("R", "MOVE", to="TABLE")
    bench.give("B", "RUN")
    bench.wait(stopped_after)
    left = [draw]
    monkeypatch.setattr(bench.plant.random, "random", left.pop)
    bench.give("B", "STOP")
    bench.wait(1.5)
    assert left == []
    for _ in range(3):  # a machine that waits is woken whenever a station becomes free
        bench.plant._wake()
        bench.wait(0.25)
    assert bench.plant.machines["B"].holding is not None
    bench.do("R", "GRASP", at="TABLE")
    assert (bench.plant.stations["table"] is not None) == (draw == 0.1)
    assert bench.faults == []


def test_nobody_comes_to_a_machine_that_is_stopped_at_rest_and_a_machine_that_stops_takes_nothing_else() -> None:
    bench = Bench(text=STOPPABLE)
    bench.give("R", "STOP")
    bench.wait(0.4)
    assert bench.do("R", "STOP") == [CommandDone(2)]
    assert bench.wait(100) == []
    bench.give("R", "STOP")
    bench.give("R", "MOVE", to="ENTRY")
    assert bench.faults == ["R is given MOVE while it is at STOP"]


@pytest.mark.parametrize("text", [STOPPABLE, STOPPABLE.replace("stop, takes_s: 0.5", "stop")])
def test_stop_that_hangs_is_never_done(text: str) -> None:
    bench = Bench(NeverCompletes("R", "STOP"), text=text)
    bench.give("R", "MOVE", to="ENTRY")
    assert bench.give("R", "STOP") == []
    assert bench.wait(1) == []
    assert bench.plant.machines["R"].position == "HOME"
    assert [what for _, what in bench.plant.befallen] == ["R has STOP and will never end it"]
    assert bench.do("R", "STOP") == [CommandDone(3), SensorChanged("key", value=True)]


def test_workpiece_that_leaves_unmachined_is_a_fault() -> None:
    bench = Bench(workpieces=1)
    bench.fetch()
    bench.do("R", "MOVE", to="EXIT")
    bench.do("R", "PUT", at="EXIT")
    assert bench.faults == ["workpiece 1 leaves the cell without having been machined"]


LOADED_BY_HAND = TEXT.replace("station: entry, every", "station: table, every").replace(
    "station: exit,", "station: table,"
)


def test_workpiece_is_taken_away_where_it_has_come_once_it_was_machined_there() -> None:
    bench = Bench(text=LOADED_BY_HAND)
    bench.wait(20)
    assert bench.plant.delivered == [], "it waits to be machined"
    bench.do("M", "CLAMP")
    bench.do("M", "RUN")
    bench.do("M", "UNCLAMP")
    assert [workpiece.id for workpiece in bench.plant.delivered] == [1]
    assert bench.plant.stations["table"] == Workpiece(2)
    assert bench.faults == []
    without = "".join(line for line in LOADED_BY_HAND.splitlines(keepends=True) if "does: process" not in line)
    bench = Bench(text=without)
    bench.wait(20)
    assert [workpiece.id for workpiece in bench.plant.delivered] == [1, 2]


def test_workpiece_that_has_been_grasped_meanwhile_is_not_taken_away_nor_is_another() -> None:
    bench = Bench(text=LOADED_BY_HAND.replace("after_s: 1", "after_s: 12"))
    for command in ("CLAMP", "RUN", "UNCLAMP"):
        bench.do("M", command)
    bench.do("R", "MOVE", to="TABLE")
    bench.give("R", "GRASP", at="TABLE")
    bench.wait(9)
    assert bench.plant.delivered == []
    assert bench.plant.stations["table"] == Workpiece(2)
    assert bench.faults == []


def test_disturbed_command_is_taken_and_never_done() -> None:
    bench = Bench(NeverCompletes("R", "MOVE", occurrence=2))
    assert bench.do("R", "MOVE", to="ENTRY") == [CommandDone(1)]
    assert bench.do("R", "MOVE", to="HOME") == []
    assert [what for _, what in bench.plant.befallen] == ["R has MOVE and will never end it"]


def test_what_is_dropped_is_told_and_that_nothing_was_held() -> None:
    first, second = Drops("R", "MOVE", 1), Drops("R", "MOVE", 2)
    bench = Bench(first, second, Drops("R", "MOVE", 99))
    bench.fetch()
    bench.do("R", "MOVE", to="HOME")
    assert bench.plant.befallen == [
        (first, "R drops nothing, for it holds nothing, as MOVE ends"),
        (second, "R drops workpiece 1, as MOVE ends"),
    ]


def test_stuck_sensor_shows_one_value_from_its_time_on() -> None:
    bench = Bench(StuckSensor("entry", value=False, from_seconds=3.0))
    assert bench.plant.shown["entry"]
    assert bench.wait(3.0) == [SensorChanged("entry", value=False)]
    assert [what for _, what in bench.plant.befallen] == ["entry is stuck at 0"]


@pytest.mark.parametrize("cell", CELLS)
def test_plant_of_the_catalogue_fits_its_net(cell: str) -> None:
    assert misfits(read_plant(plant_path(cell)), catalogue_net(cell)) == ()


def test_plant_of_another_cell_does_not_fit() -> None:
    messages = [
        problem.message for problem in misfits(read_plant(plant_path("two_robots_shared")), catalogue_net("one_robot"))
    ]
    assert "'robot.to_cv1' sends 'R MOVE to=CV1', and the plant has no such machine 'R'" in messages
    assert "the net has no signal 'robots.r1_touch'" in messages


def test_position_or_sensor_that_the_plant_lacks_is_a_misfit() -> None:
    text = plant_path("one_robot").read_text("utf-8")
    lacking_text = text.replace("CV2: cv2_entry", "CV3: cv2_entry").replace("mc.part_present", "mc.part_presence")
    lacking = parse_plant(lacking_text)
    found = misfits(lacking, catalogue_net("one_robot"))
    lines = lacking_text.splitlines()
    assert {lines[problem.span.line - 1].split(":")[0].strip() for problem in found if problem.span} == {
        "positions",
        "sensors",
        "mc.part_presence",
    }
    codes = {(problem.code, problem.subject) for problem in found}
    assert codes == {
        ("F5003", ("places", "robot.to_cv2")),
        ("F5003", ("places", "robot.put_cv2")),
        ("F5003", ("signals", "mc.part_present")),
        ("F5003", ("sensors", "mc.part_presence")),
    }


def test_machine_or_command_that_the_plant_lacks_is_said_at_the_table_to_add_it_to() -> None:
    text = plant_path("one_robot").read_text("utf-8")
    net = catalogue_net("one_robot")
    for old, new, at, words in (
        ("\n  MC:", "\n  MCC:", "machines", "did you mean 'MCC'? add it to the plant file, as `MC: {commands: {"),
        ("      MOVE:", "      MOVEE:", "commands", "did you mean 'MOVEE'? add it to the plant file, as `MOVE: {does:"),
    ):
        assert old in text
        lacking = text.replace(old, new)
        problem = misfits(parse_plant(lacking), net)[0]
        assert problem.span is not None
        assert lacking.splitlines()[problem.span.line - 1].strip() == f"{at}:"
        assert words in problem.hint


@pytest.mark.parametrize(
    ("takes", "told"),
    [
        ("takes_s: 5.0, jitter_s: 0", False),
        ("takes_s: 5.5, jitter_s: 0.5", False),
        ("takes_s: 5.6, jitter_s: 0.5", True),
        ("takes_s: 6", True),
    ],
)
def test_time_limit_that_no_command_keeps_is_warned_of(takes: str, told: bool) -> None:
    text, net = plant_path("one_robot_timed").read_text("utf-8"), catalogue_net("one_robot_timed")
    assert not late_limits(parse_plant(text), net)
    slow = re.sub(r"(MOVE: +\{does: move, +)[^}]*?(, may_fail|\})", rf"\g<1>{takes}\2", text, count=1)
    assert slow != text
    found = late_limits(parse_plant(slow), net)
    limited = [place for place in net.places if place.within and place.within.seconds == 5]
    assert {problem.subject for problem in found} == ({("places", place.name) for place in limited} if told else set())
    for problem in found:
        assert (problem.code, problem.severity) == ("F5009", Severity.WARNING)
        assert "late each time" in problem.message
        assert problem.span is not None
        assert takes in slow.splitlines()[problem.span.line - 1]


def test_hint_at_a_sensor_that_the_plant_lacks_names_all_that_one_can_see() -> None:
    lacking = parse_plant(plant_path("one_robot").read_text("utf-8").replace("  mc.part_present:", "  mc.part:"))
    hint = next(one.hint for one in misfits(lacking, catalogue_net("one_robot")) if "drives" in one.message)
    assert all(f"`{kind}: " in hint for kind in ("occupied", "holding", "acknowledges", "passes", "fails"))


@pytest.mark.parametrize(
    ("old", "new", "sent"),
    [
        ("CV1: cv1_end", "CVI: cv1_end", "'R MOVE to=CV1', and 'CV1' is no position of 'R'"),
        ("MOVE:    {does: move,", "MOVE:    {does: grasp,", "'R MOVE to=CV1' without `at`, a position of 'R'"),
    ],
)
def test_a_command_at_no_position_says_which_is_none(old: str, new: str, sent: str) -> None:
    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text("utf-8")
    first, *_ = misfits(parse_plant(text.replace(old, new)), catalogue_net("one_robot"))
    assert first.message == f"'robot.to_cv1' sends {sent}"
    assert first.hint.endswith("its positions are HOME, CVI, MC, CV2" if "CVI" in new else "HOME, CV1, MC, CV2")


def test_a_signal_without_a_sensor_is_meant_by_a_sensor_without_a_signal() -> None:
    net = parse_net(
        "firable: 1\ncell: c\ncontrollers: {in: {start: a, inputs: [box_ok, box_nok], places: {a: , b: }}}\n"
        "transitions: {t: {from: in.a, to: in.b, if: [in.box_ok, in.box_nok]}}\n"
    )
    plant = (
        "firable_plant: 1\nplant: c\nstations: [s]\narrivals: {station: s, every_s: 1}\n"
        "departures: {station: s, after_s: 1}\nmachines: {}\n"
        "sensors: {in.box_nok: {fails: s}, in.box_okay: {passes: s}}\n"
    )
    hints = [one.hint.partition("?")[0] for one in misfits(parse_plant(plant), net)]
    assert hints == ["did you mean 'in.box_okay'", "did you mean 'in.box_ok'"]
    (hint,) = [one.hint for one in misfits(parse_plant(plant.replace(", in.box_okay: {passes: s}", "")), net)]
    assert hint.startswith("add it"), "`in.box_nok` is another signal"


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("hand: HOME", "hand: MOON", 8, "there is no position 'MOON'"),
        ("to: table", "to: tabel", 22, "there is no station 'tabel'"),
        ("{station: exit,", "{station: exits,", 5, "'departures.station': there is no station 'exits'"),
        (
            "{station: exit, after_s: 1}",
            "\n- {station: exit}\n- {station: exits}",
            7,
            "'departures.1.station': there is",
        ),
        (
            "{station: exit, after_s: 1}",
            "\n- {station: exit}\n- {station: exit}",
            7,
            "leave at 'exit' by an earlier entry",
        ),
        ("    hand: HOME\n", "", 10, "'R' has no hand"),
        ("{holding: R}", "{holding: Q}", 26, "there is no machine 'Q'"),
        ("{holding: R}", "{}", 26, "a sensor sees one thing"),
        ("{holding: R}", "{holding: M}", 26, "'M' never holds anything"),
        ("[entry, table, exit]", "[entry, table, exit, table]", 3, "'table' stands here a second time"),
        ("[entry, table, exit]", '[entry, table, exit, "a\\u200bb"]', 3, "is not a name for a station: it has a char"),
        ("{HOME: ,", '{HOME: , "a\\tb": ,', 9, "is not a name for a position: it has a character that cannot"),
        ("  R:\n", '  "R\\e[2J":\n', 7, "is not a name for a machine: it has a character that cannot be seen"),
    ],
)
def test_plant_file_that_contradicts_itself_is_refused_with_its_line(
    old: str, new: str, line: int, message: str
) -> None:
    assert old in TEXT
    with pytest.raises(InputError) as refusal:
        parse_plant(TEXT.replace(old, new, 1))
    problem = refusal.value.diagnostics[0]
    assert problem.code == "F5003"
    assert message in problem.message
    assert problem.span is not None
    assert problem.span.line == line
    assert problem.hint


@pytest.mark.parametrize(
    ("old", "new", "code", "at", "words"),
    [
        ("takes_s: 4}", "takes_s: 4s}", "F1010", "4s", "a number of seconds, without a unit, is expected"),
        ("takes_s: 4}", "takes_s: .inf}", "F1010", ".inf", "a number of seconds, without a unit, is expected"),
        ("takes_s: 4}", "takes_s: nan}", "F1010", "nan", "a number of seconds"),
        ("takes_s: 4}", "takes_s: -1}", "F1010", "-1", "a number of seconds from 0, without a unit, is expected"),
        ("takes_s: 4}", "take_s: 4}", "F1008", "take_s", "did you mean 'takes_s'? the keys here are"),
        ("takes_s: 4}", "takes_s: 4, may_fail: often}", "F1010", "often", "'repairable' or 'for_good' is expected"),
        ("does: stop", "does: stpo", "F1010", "stpo", "did you mean 'stop'? one of 'move', 'grasp'"),
        ("does: stop", "dose: stop", "F1009", "dose", "the key 'does' is missing in 'machines.B.commands.STOP'"),
        ("{does: stop}", "{}", "F1009", "STOP", "add `does:`"),
        ("does: stop", "does: stop, may_fail: x", "F1008", "may_fail", "the keys here are does, takes_s, jitter_s"),
        ("{does: stop}", "\n      does: stop", "F1010", "STOP", "a mapping, lines of `name: value`"),
        ("plant: bench", "plant: bench\ncolour: red", "F1008", "colour", "unknown key 'colour'"),
        ("{station: exit, after_s: 1}", "[]", "F1010", "[", "`{station: NAME}`, or a list of these, is expected"),
        ("{station: exit, after_s: 1}", "exit", "F1010", "exit", "`{station: NAME}`, or a list of these, is expected"),
        ("{station: exit, after_s: 1}", "{statoin: exit}", "F1008", "statoin", "did you mean 'station'?"),
        ("{station: exit, after_s: 1}", "[{statoin: exit}]", "F1008", "statoin", "did you mean 'station'?"),
        ("{station: exit, after_s: 1}", "{station: exit, raw: maybe}", "F1010", "maybe", "true or false is expected"),
        ("{holding: R}", "{passes: table, likely: often}", "F1010", "often", "a number from 0 to 1 is expected"),
        ("{holding: R}", "{passes: table, likely: 1.5}", "F1010", "1.5", "a number from 0 to 1 is expected"),
        ("{holding: R}", "{passes: table, likely: -1}", "F1010", "-1", "a number from 0 to 1 is expected"),
        ("{holding: R}", "{passes: table, likely: }", "F1010", "likely", "leave `likely` out"),
        ("firable_plant: 1", "firable_plant: 2", "F1011", "2", "write `firable_plant: 1`"),
    ],
)
def test_word_that_a_plant_file_does_not_have_is_refused_where_it_stands(
    old: str, new: str, code: str, at: str, words: str
) -> None:
    assert old in TEXT
    with pytest.raises(InputError) as refusal:
        parse_plant(TEXT.replace(old, new, 1))
    problem = refusal.value.diagnostics[0]
    assert problem.code == code
    assert words in f"{problem.message}\n{problem.hint}"
    assert problem.span is not None
    assert problem.span.excerpt[problem.span.column - 1 :][: problem.span.length] == at
    assert len(refusal.value.diagnostics) == (2 if "\n      does" in new else 1)


@pytest.mark.parametrize(("text", "code"), [("", "F1002"), ("- a", "F1010"), ("x", "F1010"), ("a: 1\na: 2", "F1006")])
def test_file_that_is_no_plant_is_refused(text: str, code: str, tmp_path: Path) -> None:
    path = tmp_path / "x.plant.yaml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError) as refusal:
        read_plant(path)
    assert refusal.value.diagnostics[0].code == code


def test_a_plant_is_another_one_by_what_is_called_like_a_time_and_by_a_stop_that_takes_one() -> None:
    """A stop that takes time may still do what it breaks off, which a proof asks for."""
    text = """\
firable_plant: 1
plant: press
stations: [table]
arrivals: {station: table, every_s: 5}
departures: {station: table}
machines:
  P:
    hand: HOME
    positions: {HOME: table, likely: table}
    commands: {RUN: {does: work, takes_s: 1}, HALT: {does: stop}, GO: {does: move, takes_s: 1}}
"""
    sealed = parse_plant(text)
    assert not otherwise_than(sealed, parse_plant(text.replace("takes_s: 1", "takes_s: 3, jitter_s: 1")))
    for one, other, where in (
        ("{does: stop}", "{does: stop, takes_s: 1}", "machines.P.commands.HALT.takes_s"),
        ("likely: table", "likely: ", "machines.P.positions.likely"),
        ("RUN: {does: work, takes_s: 1}, ", "", "machines.P.commands.RUN"),
    ):
        (found,) = otherwise_than(sealed, parse_plant(text.replace(one, other)))
        assert found.message.startswith(f"'{where}': ")
