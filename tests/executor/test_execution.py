"""Running decompositions on the simulated cell: workpieces, situations, how runs end."""

import asyncio
import random
from dataclasses import replace
from typing import cast

import pytest
from support.cell_runs import replace_text, run_cell
from support.cells import decomposition_of, firings, plant_of
from support.owned_nets import owned_net

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import StuckSensor
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import until
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.items import Item
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.situation import State, is_deadlock
from firable.executor.protocol.messages import ProtocolError
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.text import parse_net
from firable.semantics.judgement import Judgement, judge
from firable.semantics.player import Player
from firable.semantics.trace import Fired, Noted

CELLS = ["one_robot", "one_robot_mc_late_capacity", "two_robots_shared", "two_robots_separate"]


def test_a_hundred_workpieces_go_through_none_lost_none_doubled_in_order() -> None:
    report, _ = run_cell("one_robot", 100)
    assert report.state is State.DONE
    assert report.delivered == tuple(range(1, 101))
    assert report.lost == report.doubled == report.inside == ()
    assert set(report.firings.values()) == {100}
    assert set(report.situation.marking) == set(
        catalogue_net("one_robot").names(catalogue_net("one_robot").initial_marking)
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cell", CELLS)
def test_every_cell_carries_its_workpieces_through(cell: str, seed: int) -> None:
    report, _ = run_cell(cell, 20, seed=seed)
    assert report.state is State.DONE
    assert report.delivered == tuple(range(1, 21))


def test_one_seed_is_one_run() -> None:
    traces = [list(run_cell("two_robots_separate", 5, seed=seed)[1].lines()) for seed in (3, 3, 4)]
    assert traces[0] == traces[1]
    assert traces[0] != traces[2]


def test_deadlock_is_told_while_running_with_what_waits_for_what() -> None:
    report, trace = run_cell("one_robot_mc_late", 10)
    assert report.state is State.DEADLOCK
    assert {"robot.put_mc", "mc.release", "system.loading", "system.processing"} <= set(report.situation.marking)
    told = {blocked.transition: blocked for blocked in report.situation.blocked}
    assert told["G4"].empty == ("mc.free",)
    assert "robot.free" in told["G6"].empty
    assert str(told["G6"]).startswith("G6 waits for a token on robot.free")
    assert report.situation.message == (
        "no transition can fire any more, whatever the signals do; in a circle, each waiting for the next: "
        "robot.put_mc (putting on MC) waits in G4 for mc.free, which comes from mc.release by G6 and G7; "
        "mc.release (releasing and then waiting) waits in G6 for robot.free, which comes from robot.put_mc by G4 and G5"
    )
    assert trace.end is not None
    assert trace.end.reason == "deadlock"


def test_robot_that_does_not_wait_crashes_into_the_full_machine() -> None:
    impatient = replace_text("one_robot_mc_late", ", when_full: wait", "")
    report, trace = run_cell("one_robot_mc_late", 10, plant=impatient)
    assert report.state is State.FAULT
    assert report.situation.message.endswith("pushes workpiece 2 onto mc_table, where workpiece 1 lies")
    assert [event.data["message"] for event in trace.events if isinstance(event, Noted) and event.note == "fault"] == [
        report.situation.message
    ]


def test_completion_is_formed_where_its_sensor_drops_at_the_same_instant() -> None:
    # So it is, too, where a slow host learns at one time of all that has happened in the meantime.
    report, _ = run_cell("one_robot", 3, plant=replace_text("one_robot", "after_s: 1", "after_s: 0"))
    assert report.state is State.DONE


def test_stuck_sensor_leaves_the_cell_waiting_for_its_gate() -> None:
    stuck = StuckSensor("conveyor.part_at_entry", value=False, from_seconds=30.0)
    report, _ = run_cell("one_robot", 10, disturbances=[stuck])
    assert report.state is State.WAITING
    assert [(blocked.transition, blocked.gates) for blocked in report.situation.blocked] == [
        ("G1", (("conveyor.part_at_entry", True),))
    ]
    assert 0 < len(report.delivered) < 10
    assert report.lost == ()


def test_sensor_stuck_at_one_makes_the_cell_act_on_nothing_which_the_plant_tells() -> None:
    report, _ = run_cell("one_robot", 2, disturbances=[StuckSensor("conveyor.part_at_entry", value=True)])
    assert report.state is State.FAULT
    assert "CV1 is to carry from cv1_entry, where no workpiece lies" in report.situation.message


@pytest.mark.parametrize(("mailbox", "receiver"), [("", "the coordinator"), ("robot", "'robot'")])
def test_message_that_nobody_knows_ends_the_run(mailbox: str, receiver: str) -> None:
    async def operator(host: Host) -> None:
        host.acts.post(mailbox, cast(Item, "a letter"))

    with pytest.raises(ProtocolError, match=f"{receiver} was sent 'a letter'"):
        run_cell("one_robot", 5, operator=operator)


def test_situation_while_running_names_the_gates_that_are_waited_for() -> None:
    seen = []

    async def operator(host: Host) -> None:
        await until(lambda: firings(host) == 1, "a firing")
        await host.quiet()
        seen.append(host.situation())

    run_cell("one_robot", 1, operator=operator)
    assert seen[0].state is State.WAITING
    assert str(seen[0]) == "waiting\n  G2 waits for conveyor.part_at_end"


def test_real_time_runs_as_virtual_time_does() -> None:
    report, trace = run_cell("one_robot", 1, speed=400.0, overdue_seconds=1e6)
    virtual, virtual_trace = run_cell("one_robot", 1)
    assert report.state is State.DONE
    assert report.firings == virtual.firings
    assert [e.transitions for e in trace.events if isinstance(e, Fired)] == [
        e.transitions for e in virtual_trace.events if isinstance(e, Fired)
    ]


def circles(*owners: str) -> Decomposition:
    """A token that goes round in each controller, without any gate."""
    return split(
        Net(
            "circles",
            tuple(Place(f"{owner}.{p}", owner, marked=p == "p") for owner in owners for p in "pq"),
            tuple(
                Transition(f"{owner}-{p}", (f"{owner}.{p}",), (f"{owner}.{q}",))
                for owner in owners
                for p, q in ("pq", "qp")
            ),
            controllers=tuple(map(Controller, owners)),
        )
    )


NO_MACHINES = parse_plant(
    "firable_plant: 1\nplant: none\nstations: [s]\nmachines: {}\n"
    "arrivals: {station: s, every_s: 1}\ndepartures: {station: s}\n"
)


@pytest.mark.parametrize("yields", range(6))
def test_nothing_fires_in_a_step_that_a_stop_overtakes(yields: int) -> None:
    fired: list[int] = []

    async def operator(host: Host) -> None:
        host.pause()
        step = asyncio.create_task(host.step())
        for _ in range(yields):
            await asyncio.sleep(0)
        host.stop()
        fired.append(firings(host))
        await step
        fired.append(firings(host))

    stopped = execute(circles("a", "b"), SimulatedCell(NO_MACHINES, workpieces=1), Conduct(operator=operator))
    assert stopped.state is State.STOPPED
    assert fired[0] == fired[1]


def test_net_that_runs_in_circles_without_its_cell_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.executor.operating.groups.FIRINGS_AT_ONCE_MAX", 500)
    report = execute(circles("a"), SimulatedCell(NO_MACHINES, workpieces=1))
    assert report.state is State.FAULT
    assert "fire without end" in report.situation.message


def test_single_steps_take_turns_among_the_controllers() -> None:
    stepped = []

    async def operator(host: Host) -> None:
        host.pause()
        for _ in range(6):
            stepped.append(await host.step())
        host.stop()

    execute(circles("a", "b"), SimulatedCell(NO_MACHINES, workpieces=1), Conduct(operator=operator))
    assert [str(name)[0] for name in stepped] == ["a", "b"] * 3


def test_transition_that_no_valuation_opens_is_not_waited_for() -> None:
    gates = (ExternalGate("a.s"), ExternalGate("a.s", wanted=False))
    places = (Place("a.p", "a", marked=True), Place("a.q", "a"))
    never = Transition("t", ("a.p",), ("a.q",), external=gates)
    net = Net("n", places, (never,), (Signal("a.s", "a"),), (Controller("a"),))
    assert is_deadlock(TokenPlayer.of(net), net.initial_marking)
    waiting = replace(never, external=gates[:1])
    assert not is_deadlock(TokenPlayer.of(replace(net, transitions=(waiting,))), net.initial_marking)


@pytest.mark.parametrize("seed", range(60))
def test_deadlock_of_a_run_is_the_deadlock_of_the_reference(seed: int) -> None:
    net, draw = owned_net(seed), random.Random(seed)
    gates = (ExternalGate(signal.name, wanted=wanted) for signal in net.signals for wanted in (True, False))
    shut = replace(net.transitions[0], name="shut", external=tuple(gates))  # openable where there is no signal
    net = replace(net, transitions=(shut, *net.transitions[draw.randrange(2) :]))
    player, reference = TokenPlayer.of(net), Player(net)
    for word in (net.initial_marking, *(draw.getrandbits(len(net.places) + len(net.signals)) for _ in range(100))):
        judged = judge(reference, player.marking(word), {})
        assert is_deadlock(player, word) is (judged is Judgement.DEADLOCK)


def test_recorder_fires_by_the_rule_of_the_token_player() -> None:
    recorder = Recorder(catalogue_net("one_robot"), "", None)
    recorder.fired(0.0, "G1")
    recorder.signal(0.5, "robot.at_cv1", value=True)
    before, player = recorder.word, recorder.player
    recorder.fired(1.0, "G2")
    assert recorder.word == player.transitions["G2"].fire(before)
    assert not recorder.word & player.signal_bit("robot.at_cv1")  # its command is sent in the same act


def test_a_firing_that_is_told_twice_or_out_of_turn_is_an_error_of_the_program_and_no_silence() -> None:
    recorder = Recorder(catalogue_net("one_robot"), "", None)
    recorder.fired(0.0, "G1")
    before, counted = recorder.word, dict(recorder.firings)
    for transition in ("G1", "G3"):
        with pytest.raises(ProtocolError, match=f"'{transition}' is told as fired where its tokens are not"):
            recorder.fired(1.0, transition)
    assert (recorder.word, recorder.firings) == (before, counted)


def test_a_run_in_which_a_firing_is_told_twice_ends_by_that_error_with_its_machines_stopped() -> None:
    class Doubled(Recorder):
        def fired(self, at_seconds: float, transition: str, number: int | None = None) -> None:
            super().fired(at_seconds, transition, number)
            if transition == "G2":
                super().fired(at_seconds, transition, number)

    decomposition = decomposition_of("one_robot")
    driver = DryRunDriver(decomposition.subnets, 1.0)
    host = Host(decomposition, driver, Doubled(decomposition.net, "", None))
    with pytest.raises(ProtocolError, match="'G2' is told as fired"):
        run_in_virtual_time(host.main())
    assert driver.is_stopped


def test_command_order_of_a_wrong_net_crashes_in_the_cell() -> None:
    text = catalogue_path("one_robot").read_text("utf-8")
    # The robot's task to unload is begun while the workpiece is still clamped.
    wrong = text.replace("{send: {machine: MC, command: UNCLAMP},             until: released, ", "{")
    assert wrong != text
    net = parse_net(wrong)
    report = execute(split(net), SimulatedCell(plant_of("one_robot"), workpieces=2))
    assert report.state is State.FAULT
    assert "R pulls at a workpiece that is clamped on mc_table" in report.situation.message


@pytest.mark.parametrize(("workpieces", "speed", "overdue_seconds"), [(-1, None, 1.0), (1, 0.0, 1.0), (1, None, 0.0)])
def test_senseless_quantities_are_refused(workpieces: int, speed: float | None, overdue_seconds: float) -> None:
    with pytest.raises(ValueError, match="must"):
        run_cell("one_robot", workpieces, speed=speed, overdue_seconds=overdue_seconds)


def test_run_without_workpieces_is_done_at_once() -> None:
    report, _ = run_cell("one_robot", 0)
    assert (report.state, report.commands, report.simulated_seconds) == (State.DONE, 0, 0.0)
