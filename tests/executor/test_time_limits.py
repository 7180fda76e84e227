"""Time limits while a cell runs: time is an input, the timeout is taken at the machine, and the trace shows it."""

import asyncio
import io
from functools import cache
from math import inf
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples, seeds
from support.hosts import Cell
from support.rehearsals import BAD, ORDERLY, rehearsed
from support.timed_nets import HANDOVER, timed_nets

from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.executor.cell.disturbances import NeverCompletes
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import until
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.running import RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State, blocked
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import Decision, Effect, Firing, Keep, Sending, Stored, Taken, VoteRequest
from firable.executor.protocol.token_player import TokenPlayer
from firable.executor.simulation.campaign import Passed, Run, rehearse
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.judge import Subject
from firable.nets.blocked_timeouts import blocked_timeouts
from firable.nets.catalogue import catalogue_net, catalogue_path, catalogue_plant
from firable.nets.decomposition import Decomposition
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import Net
from firable.nets.text import parse_net
from firable.semantics.replaying import replay
from firable.semantics.trace import CommandSent, SignalChanged, Trace, parse_trace

OVER = Taken("a.go_overdue", value=True)


@cache
def handover() -> Decomposition:
    return split(parse_net(HANDOVER))


def going() -> LocalController:
    """The controller that has just sent its command, at 0 s; its coordinator is never heard of."""
    controller = LocalController(handover(), "a")
    assert controller.deadline() is None
    assert Sending("a.go", 1) in controller.fire()
    assert controller.deadline() == -inf
    assert controller.tick(0.0) == []
    return controller


def visible(effects: list[Effect]) -> list[Effect]:
    return [effect for effect in effects if not isinstance(effect, Keep)]


# --- The controller


def test_a_timer_is_set_when_the_time_is_over_and_not_before() -> None:
    controller = going()
    assert controller.deadline() == 1.0
    assert controller.tick(0.999) == []
    assert controller.tick(1.0) == [OVER]
    assert controller.deadline() is None
    assert controller.tick(99.0) == []


def test_a_controller_takes_a_timeout_alone_whoever_else_waits_for_its_machine() -> None:
    controller = going()
    controller.tick(1.0)
    assert visible(controller.fire()) == [Firing("a.go_timeout")]
    assert controller.subnet.names(controller.marking) == ("a.go_fault",)
    assert controller.deadline() is None


def test_a_completion_in_time_ends_the_time() -> None:
    controller = going()
    controller.read("a.there", value=True, entry=1)
    assert controller.deadline() is None
    assert controller.tick(2.0) == []
    assert controller.fire() == []


def test_a_completion_that_comes_with_the_timeout_comes_first() -> None:
    controller = going()
    controller.tick(1.0)
    controller.read("a.there", value=True, entry=1)
    assert controller.fire() == []


def test_a_completion_that_comes_after_the_timeout_is_not_taken_for_that_of_the_next_command() -> None:
    controller = going()
    controller.tick(1.0)
    controller.fire()
    controller.read("a.there", value=True, entry=1)
    controller.read("a.key", value=True)
    effects = visible(controller.fire())
    assert effects[0] == Firing("again")
    assert {Taken("a.there", value=False), Taken("a.go_overdue", value=False), Sending("a.go", 2)} == set(effects[1:])
    assert controller.read("a.there", value=True, entry=1) == []
    assert controller.deadline() == -inf


def test_a_time_goes_on_where_another_command_clears_the_completion_that_both_share() -> None:
    text = HANDOVER.replace(
        "inputs: key, places: {free: ,",
        "inputs: key, places: {free: , rest: , other: {send: {machine: B, command: GO}, until: there},",
    )
    text = text.replace("start: free", "start: [free, rest]").replace(
        "  use:", "  begin: {from: a.rest, to: a.other, if: a.key}\n  use:"
    )
    controller = LocalController(split(parse_net(text)), "a")
    controller.fire()
    controller.tick(0.0)
    controller.read("a.there", value=True, entry=1)
    assert controller.tick(0.5) == []
    controller.read("a.key", value=True)
    assert Firing("begin") in controller.fire()
    assert controller.deadline() == 1.0
    assert controller.tick(1.0) == [OVER]


def test_a_clock_that_stands_still_or_jumps_back_sets_no_timer() -> None:
    controller = going()
    assert [controller.tick(now) for now in (0.0, 0.0, -5.0, 0.5)] == [[], [], [], []]


def test_a_timer_that_a_promise_reads_is_set_when_the_promise_ends() -> None:
    text = HANDOVER.replace("{idle: , has: }", "{idle: , has: , lamp: }")
    text = text.replace("  use:", "  lit: {from: b.idle, to: b.lamp, unless: a.go_overdue}\n  use:")
    controller = LocalController(split(parse_net(text)), "a")
    controller.fire()
    controller.tick(0.0)
    assert visible(controller.receive(VoteRequest("a", 0, ("lit",), 0, -1)))
    assert controller.promises[0].promised == {"lit"}
    assert controller.tick(1.0) == []
    assert OVER in controller.receive(Decision("a", 0, "lit", 0, -1))


WITH_STOP = ("a: {start: free, inputs: key, places: {", "a: {start: free, inputs: key, places: {go_fault: STOP, ")


@pytest.mark.parametrize(
    ("gate", "waits"),
    [
        ("if: a.go", True),
        ("if: a.stopped", True),
        ("unless: a.stopped", True),
        ("unless: a.go_fault", True),
        ("unless: a.go_overdue", True),
        ("unless: a.go", False),
        ("if: a.go_fault", False),
        ("if: a.go_overdue", False),
        ("unless: a.there", False),
        ("unless: a.free", False),
        ("if: a.free, unless: a.go_overdue", False),
    ],
)
def test_a_timeout_that_a_promise_would_keep_from_firing_is_warned_of(gate: str, waits: bool) -> None:
    text = HANDOVER.replace("{idle: , has: }", "{idle: , has: , lamp: }").replace(*WITH_STOP)
    text = text.replace("go_fault: STOP", "go_fault: {send: {machine: A, command: STOP}, until: stopped}")
    decomposition = split(parse_net(text.replace("  use:", f"  lit: {{from: b.idle, to: b.lamp, {gate}}}\n  use:")))
    controller = LocalController(decomposition, "a")
    if gate == "if: a.stopped":
        controller.read("a.stopped", value=True)
    controller.fire()
    controller.tick(0.0)
    controller.receive(VoteRequest("a", 0, ("lit",), 0, -1))
    controller.tick(1.0)
    assert (Firing("a.go_timeout") in controller.fire()) is not waits
    warned = [*blocked_timeouts(decomposition)]
    assert [(one.code, one.subject) for one in warned] == ([("F4015", ("transitions", "lit"))] if waits else [])
    assert all(one.message.endswith(f"which reads '{gate.split()[1]}'") for one in warned)


def test_a_timeout_of_a_controller_with_two_tokens_may_meet_what_wants_another_place_of_it() -> None:
    text = HANDOVER.replace("{idle: , has: }", "{idle: , has: , lamp: }")
    text = text.replace("  use:", "  lit: {from: b.idle, to: b.lamp, if: a.free, unless: a.go_overdue}\n  use:")
    assert [*blocked_timeouts(split(parse_net(text)))] == []
    two = text.replace(
        "a: {start: free, inputs: key, places: {free: ,",
        "a: {start: [free, spare], inputs: key, places: {free: , spare: ,",
    )
    two = two.replace("  use:", "  more: {from: a.spare, to: a.free}\n  use:")
    assert [one.subject for one in blocked_timeouts(split(parse_net(two)))] == [("transitions", "lit")]
    grown = text.replace("start: {from: a.free, to: a.go}", "start: {from: a.free, to: [a.go, a.spare]}")
    grown = grown.replace("places: {free: ,", "places: {free: , spare: ,", 1).replace(
        "  use:", "  more: {from: a.spare, to: a.free}\n  use:"
    )
    assert [one.subject for one in blocked_timeouts(split(parse_net(grown)))] == [("transitions", "lit")]


def test_each_of_several_timeouts_that_wait_for_one_decision_is_named() -> None:
    text = """
firable: 1
cell: c
controllers:
  a:
    start: [one, two]
    places:
      one: {send: {machine: A, command: GO}, until: done, within: {time: 1s, to: stuck}}
      two: {send: {machine: B, command: GO}, until: ready, within: {time: 1s, to: stuck}}
      stuck:
  b: {start: idle, places: {idle: , lamp: , busy: {send: {machine: C, command: GO}, until: over}}}
transitions:
  t1: {from: a.one, to: a.two}
  t2: {from: a.two, to: a.one}
  lit: {from: b.idle, to: b.lamp, unless: a.stuck}
"""
    waiting = [one.message.split("'")[1] for one in blocked_timeouts(split(parse_net(text)))]
    assert waiting == ["a.one_timeout", "a.two_timeout"]


def test_a_timeout_waits_for_no_transition_that_takes_the_token_or_is_decided_by_its_controller_alone() -> None:
    assert not [*blocked_timeouts(handover()), *blocked_timeouts(split(catalogue_net("one_robot_timed")))]


def test_a_timer_that_a_promise_held_back_is_not_set_if_the_completion_has_come_meanwhile() -> None:
    text = HANDOVER.replace("{idle: , has: }", "{idle: , has: , lamp: }")
    text = text.replace("  use:", "  lit: {from: b.idle, to: b.lamp, unless: a.go_overdue}\n  use:")
    controller = LocalController(split(parse_net(text)), "a")
    controller.fire()
    controller.tick(0.0)
    controller.receive(VoteRequest("a", 0, ("lit",), 0, -1))
    controller.tick(1.0)
    assert Taken("a.there", value=True) in controller.read("a.there", value=True, entry=1)
    assert OVER not in controller.receive(Decision("a", 0, "lit", 0, -1))


# --- Restart


def kept_of(*acts: list[Effect]) -> dict[str, Stored]:
    kept: dict[str, Stored] = {}
    for effect in (one for act in acts for one in act):
        if isinstance(effect, Keep):
            kept.pop(effect.key, None)
            if effect.value is not None:
                kept[effect.key] = effect.value
    return kept


@pytest.mark.parametrize("answer", [Answer.WORKING, Answer.NOT_RECEIVED])
def test_after_a_restart_a_time_begins_anew_when_the_controller_is_resumed(answer: Answer) -> None:
    first = LocalController(handover(), "a")
    kept = kept_of(first.start(), first.fire(), first.tick(0.0), first.tick(0.9))
    again = LocalController.restored(handover(), "a", kept)
    assert Taken("a.go_overdue", value=False) in again.start()
    assert again.deadline() is None
    assert again.tick(100.0) == []
    again.answer("a.go", 1, answer)
    again.resume()
    assert again.deadline() == -inf
    assert again.tick(200.0) == []
    assert again.tick(200.9) == []
    assert again.tick(201.0) == [OVER]


def test_after_a_restart_a_command_that_was_done_meanwhile_is_not_timed() -> None:
    first = LocalController(handover(), "a")
    kept = kept_of(first.start(), first.fire())
    again = LocalController.restored(handover(), "a", kept)
    again.start()
    again.answer("a.go", 1, Answer.DONE)
    again.resume()
    assert again.deadline() is None


def test_a_token_of_the_start_has_no_time_after_a_restart_either() -> None:
    decomposition = split(parse_net(HANDOVER.replace("start: free", "start: go")))
    first = LocalController(decomposition, "a")
    kept = kept_of(first.start())
    assert first.deadline() is None
    again = LocalController.restored(decomposition, "a", kept)
    again.start()
    assert again.resume() == []
    assert again.deadline() is None
    assert again.tick(0.0) == again.tick(100.0) == []


def test_a_controller_that_is_held_times_no_command_that_it_owes() -> None:
    decomposition = split(parse_net(HANDOVER.replace("to: a.go}\n  hand", "to: a.go, if: b.idle}\n  hand")))
    first = LocalController(decomposition, "a")
    kept = kept_of(first.start(), first.receive(VoteRequest("a", 0, ("start",), 0, -1)))
    again = LocalController.restored(decomposition, "a", kept)
    again.start()
    again.receive(Decision("a", 0, "start", 0, -1))
    assert again.subnet.names(again.marking) == ("a.go",)
    assert again.deadline() is None
    assert again.tick(50.0) == []
    assert Sending("a.go", 1) in again.resume()
    assert again.deadline() == -inf


def test_a_timer_that_was_set_before_a_crash_is_not_set_after_it() -> None:
    first = LocalController(handover(), "a")
    kept = kept_of(first.start(), first.fire(), first.tick(0.0), first.tick(1.0))
    kept["word"] = f"{first.word:x}"
    again = LocalController.restored(handover(), "a", kept)
    again.start()
    again.answer("a.go", 1, Answer.NOT_RECEIVED)
    assert Sending("a.go", 1, again=True) in again.resume()
    assert again.fire() == []


# --- Bad networks, crashes


@examples(30)
@given(timed_nets(), st.integers(0, 2**16), st.sampled_from([ORDERLY, BAD]))
def test_joint_traces_of_nets_with_time_limits_are_traces_of_the_central_net(
    net: Net, seed: int, kinds: tuple[str, ...]
) -> None:
    rehearsed(split(net), seed, kinds)


@pytest.mark.seeds
def test_timeouts_and_tries_after_them_happen_on_a_bad_network() -> None:
    timed = split(catalogue_net("one_robot_timed"))
    fired = {name for seed in seeds(12) for name in rehearsed(timed, seed, (*BAD, "stuck"), 1500).fired}
    assert {name for name in fired if name.endswith("_timeout")}
    assert fired & {"t1-e", "t1-f", "t1-g", "t1-h", "t1-i"}


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(8))
def test_time_limits_survive_crashes_drift_and_partitions(seed: int) -> None:
    found = rehearse(Subject(handover()), Run(seed, steps=400))
    assert isinstance(found, Passed), found


# --- Hosts


ROBOT = ("robot",)


def test_a_host_that_is_cut_off_takes_the_timeout_of_its_machine_alone(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, name="one_robot_timed")
        host = cell.hosts[ROBOT]
        assert isinstance(host.driver, DryRunDriver)
        await until(lambda: "robot.put_mc" in host.marking, "the motion before that back")
        host.driver.seconds = 1000.0  # so that the next one never ends
        await until(lambda: "robot.back" in host.marking, "the motion back")
        cell.exchange.cut(cell.links[ROBOT])
        await asyncio.sleep(4.7)
        assert "robot.back" in host.marking
        await asyncio.sleep(0.5)
        assert "robot.back_fault" in host.marking
        host.driver.seconds = 1.0
        stood = cell.firings()
        cell.exchange.mend(cell.links[ROBOT])
        await asyncio.sleep(60)
        await cell.stop()
        assert cell.replayed().firings > stood + 20

    run_in_virtual_time(main())


# --- A whole run


def run(*disturbances: NeverCompletes, key: float = 20.0, overdue_seconds: float = 120.0) -> tuple[RunReport, Trace]:
    text = catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml").read_text("utf-8")
    plant = parse_plant(text.replace("after_s: 20", f"after_s: {key}"))
    written = io.StringIO()
    net = catalogue_net("one_robot_timed")
    report = execute(
        split(net),
        SimulatedCell(plant, workpieces=3, disturbances=disturbances),
        Conduct(trace=written, overdue_seconds=overdue_seconds),
    )
    trace = parse_trace(written.getvalue())
    replay(net, trace)
    return report, trace


def test_a_motion_that_never_ends_is_stopped_in_time_and_tried_again_on_the_key() -> None:
    report, trace = run(NeverCompletes("R", "MOVE", 3))
    assert report.state is State.DONE
    assert report.delivered == (1, 2, 3)
    assert report.firings["robot.back_timeout"] == report.firings["t1-g"] == 1
    events = list(trace.events)
    over = next(e for e in events if isinstance(e, SignalChanged) and e.signal == "robot.back_overdue" and e.value)
    sent = [e for e in events if isinstance(e, CommandSent) and e.place == "robot.back"]
    stop = next(e for e in events if isinstance(e, CommandSent) and e.place == "robot.back_fault")
    assert over.at_seconds == pytest.approx(sent[0].at_seconds + 5.0)
    assert stop.at_seconds == over.at_seconds
    assert sent[1].at_seconds == pytest.approx(stop.at_seconds + 20.0)


def test_a_cell_whose_machines_are_in_time_runs_as_if_there_were_no_limits() -> None:
    report, trace = run()
    assert report.delivered == (1, 2, 3)
    assert not any(count for name, count in report.firings.items() if name.endswith("_timeout"))
    assert not any(isinstance(e, SignalChanged) and e.signal.endswith("_overdue") for e in trace.events)


def test_a_motion_may_be_late_again_and_again() -> None:
    report, _ = run(*(NeverCompletes("R", "MOVE", occurrence) for occurrence in (1, 2, 3)))
    assert report.delivered == (1, 2, 3)
    assert report.firings["robot.to_cv1_timeout"] == report.firings["t1-e"] == 3


def test_a_command_with_a_time_limit_has_no_other_alarm() -> None:
    report, _ = run(NeverCompletes("R", "MOVE", 1), key=10.0, overdue_seconds=4.9)
    assert report.state is State.FAULT
    assert "overdue" in report.situation.message
    assert "'robot." not in report.situation.message, "of the machining, which has no limit"


def test_a_run_without_anybody_who_presses_the_key_waits_in_the_fault_place() -> None:
    plant = catalogue_path("one_robot_timed").with_name("one_robot_timed.plant.yaml").read_text("utf-8")
    report = execute(
        split(catalogue_net("one_robot_timed")),
        SimulatedCell(
            parse_plant(plant.replace("acknowledges: R, after_s: 20", "acknowledges: CV2")),
            workpieces=1,
            disturbances=[NeverCompletes("R", "MOVE", 1)],
        ),
    )
    assert report.state is State.WAITING
    assert "robot.to_cv1_fault" in report.situation.marking
    assert [str(one) for one in report.situation.blocked] == ["t1-e waits for robot.reset"]


def test_what_only_a_timeout_would_fire_is_not_said_to_be_waited_for() -> None:
    net = catalogue_net("one_robot_timed")
    waiting = blocked(TokenPlayer.of(net), net.marking(["robot.to_cv1"]))
    assert [str(one) for one in waiting] == ["t1-a waits for robot.at_cv1"]


def test_the_timed_cell_of_the_catalogue_runs() -> None:
    report = execute(
        split(catalogue_net("one_robot_timed")), SimulatedCell(catalogue_plant("one_robot_timed"), workpieces=2)
    )
    assert report.state is State.DONE


def test_a_time_that_is_over_is_that_of_a_command_that_was_sent() -> None:
    """It began with the entry of the token, while the command still waited for a disk that was slow."""
    run = Run(7003351, ("partition", "crash", "unsynced", "pause"), 283)
    assert isinstance(rehearse(Subject(freed(split(DRAWN["drawn-timed"](run.seed // 10)))), run), Passed)
