"""Running decompositions on the simulated cell: workpieces, situations, the operator's controls."""

import asyncio
import io
import random
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest
from support.cells import decomposition_of, firings, plant_of
from support.owned_nets import owned_net

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import Disturbance, NeverCompletes, StuckSensor
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.bench import until
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.operating.host import Host
from firable.executor.operating.items import Item
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.restart import uncertain
from firable.executor.operating.running import Operator, RunReport, execute
from firable.executor.operating.situation import State, is_deadlock
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import ProtocolError
from firable.executor.protocol.token_player import TokenPlayer
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.decomposition import Decomposition
from firable.nets.machines.plant_file import PlantModel, parse_plant
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.text import parse_net
from firable.semantics.joining import VOTED
from firable.semantics.judgement import Judgement, judge
from firable.semantics.player import Player
from firable.semantics.replaying import replay
from firable.semantics.trace import CommandSent, Fired, Noted, Trace, parse_trace

CELLS = ["one_robot", "one_robot_mc_late_capacity", "two_robots_shared", "two_robots_separate"]


def run_cell(
    cell: str,
    workpieces: int,
    *,
    seed: int = 0,
    speed: float | None = None,
    overdue_seconds: float = 120.0,
    disturbances: Iterable[Disturbance] = (),
    operator: Operator | None = None,
    plant: PlantModel | None = None,
) -> tuple[RunReport, Trace]:
    """Run a cell of the catalogue; every trace must be a complete one of the central net."""
    stream = io.StringIO()
    report = execute(
        decomposition_of(cell),
        plant or plant_of(cell),
        workpieces=workpieces,
        seed=seed,
        speed=speed,
        trace=stream,
        overdue_seconds=overdue_seconds,
        disturbances=disturbances,
        operator=operator,
    )
    trace = parse_trace(stream.getvalue())
    replayed = replay(catalogue_net(cell), trace)
    assert replayed.complete
    assert catalogue_net(cell).names(replayed.marking) == report.situation.marking
    assert (replayed.firings, replayed.commands) == (sum(report.firings.values()), report.commands)
    return report, trace


def notes(trace: Trace) -> list[str]:
    """What the trace keeps beside firings, signals, commands and votes."""
    return [event.note for event in trace.events if isinstance(event, Noted) and event.note != VOTED]


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


def replace_text(cell: str, old: str, new: str) -> PlantModel:
    text = catalogue_path(cell).with_name(f"{cell}.plant.yaml").read_text("utf-8")
    assert old in text
    return parse_plant(text.replace(old, new))


def test_command_that_never_completes_is_a_fault_and_not_a_deadlock() -> None:
    report, _ = run_cell("one_robot", 5, disturbances=[NeverCompletes("MC", "CLAMP", 2)], overdue_seconds=60.0)
    assert report.state is State.FAULT
    assert report.situation.message.startswith("'MC CLAMP' of 'mc.fix', sent at ")
    assert "is overdue: it counts as taken, and 'mc.clamped' has not come within 60 s" in report.situation.message
    assert {gate for blocked in report.situation.blocked for gate in blocked.gates} >= {("mc.clamped", True)}
    assert len(report.delivered) == 1


JAMMED = """
firable: 1
cell: jammed
controllers:
  r:
    start: [free, stuck]
    places: {free: , stuck: , moves: {send: {machine: M, command: GO}, until: moved, within: {time: 5s, to: stuck}}}
transitions:
  go: {from: r.free, to: r.moves}
  come: {from: r.moves, to: r.free}
"""
MOVER = """
firable_plant: 1
plant: jammed
stations: [s]
arrivals: {station: s, every_s: 8}
departures: {station: s, after_s: 1}
machines:
  M: {commands: {GO: {does: work, takes_s: 1}}}
"""


@pytest.mark.parametrize("paused_seconds", [0.0, 300.0])
def test_a_timed_command_is_overdue_where_its_timeout_cannot_fire_but_not_in_a_pause(paused_seconds: float) -> None:
    seen: list[State] = []

    async def pausing(host: Host) -> None:
        while "r.moves" not in host.marking:
            await asyncio.sleep(0.05)
        if paused_seconds:
            assert host.pause()
            await asyncio.sleep(paused_seconds)
            seen.append(host.situation().state)
            assert host.resume()
        await asyncio.sleep(1000.0)

    report = execute(
        split(parse_net(JAMMED)),
        parse_plant(MOVER),
        workpieces=1,
        overdue_seconds=60.0,
        disturbances=[NeverCompletes("M", "GO", 1)],
        operator=pausing,
    )
    assert seen == ([State.PAUSED] if paused_seconds else [])
    assert report.state is State.FAULT
    assert "is overdue: it counts as taken" in report.situation.message
    assert report.situation.message.endswith("'r.moved' has not come within its 5 s, nor its timeout in 60 s more")


def test_completion_is_formed_where_its_sensor_drops_at_the_same_instant() -> None:
    # So it is, too, where a slow host learns at one time of all that has happened in the meantime.
    report, _ = run_cell("one_robot", 3, plant=replace_text("one_robot", "after_s: 1", "after_s: 0"))
    assert report.state is State.DONE


def test_slow_command_is_no_fault_within_its_limit() -> None:
    slow = replace_text("one_robot", "takes_s: 12.0", "takes_s: 110")
    assert run_cell("one_robot", 2, plant=slow)[0].state is State.DONE


def test_stuck_sensor_leaves_the_cell_waiting_for_its_gate() -> None:
    stuck = StuckSensor("conveyor.part_at_entry", value=False, from_seconds=30.0)
    report, _ = run_cell("one_robot", 10, disturbances=[stuck])
    assert report.state is State.WAITING
    assert [(blocked.transition, blocked.gates) for blocked in report.situation.blocked] == [
        ("G1", (("conveyor.part_at_entry", True),))
    ]
    assert 0 < len(report.delivered) < 10
    assert report.lost == ()


def test_stuck_sensor_of_a_completion_makes_the_command_overdue() -> None:
    report, _ = run_cell("one_robot", 5, disturbances=[StuckSensor("robot.touch", value=False)])
    assert report.state is State.FAULT
    assert "'robot.touch' has not come" in report.situation.message


def test_sensor_stuck_at_one_makes_the_cell_act_on_nothing_which_the_plant_tells() -> None:
    report, _ = run_cell("one_robot", 2, disturbances=[StuckSensor("conveyor.part_at_entry", value=True)])
    assert report.state is State.FAULT
    assert "CV1 is to carry from cv1_entry, where no workpiece lies" in report.situation.message


def test_nothing_fires_during_a_pause_and_everything_goes_on_after_it() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(33.3)
        host.pause()
        await host.quiet()
        before = firings(host)
        await asyncio.sleep(100.0)
        assert firings(host) == before > 0
        assert host.situation().state is State.PAUSED
        host.resume()

    report, trace = run_cell("one_robot", 5, operator=operator, overdue_seconds=1000.0)
    assert report.state is State.DONE
    assert report.delivered == (1, 2, 3, 4, 5)
    assert notes(trace) == ["paused", "resumed"]
    times = [event.at_seconds for event in trace.events if isinstance(event, Fired)]
    assert not [at for at in times if 33.3 < at < 133.3]


def test_single_step_fires_one_transition_at_a_time() -> None:
    stepped: list[str] = []

    async def operator(host: Host) -> None:
        host.pause()
        for _ in range(1000):
            if len(stepped) == 15:
                break
            before = firings(host)
            name = await host.step()
            if name is None:
                assert firings(host) == before
                await asyncio.sleep(0.5)
            else:
                assert firings(host) == before + 1
                stepped.append(name)
        host.resume()

    report, trace = run_cell("one_robot", 3, operator=operator)
    assert report.state is State.DONE
    assert [event.transitions[0] for event in trace.events if isinstance(event, Fired)][:15] == stepped
    assert {"G1", "G2", "G3", "t1-a"} <= set(stepped)


@pytest.mark.parametrize(
    ("disturbance", "state"),
    [
        (StuckSensor("conveyor.part_at_entry", value=False), State.WAITING),
        (NeverCompletes("MC", "CLAMP"), State.FAULT),
    ],
)
def test_cell_is_at_rest_when_nothing_is_pending_and_not_while_a_completion_is_awaited(
    disturbance: Disturbance, state: State
) -> None:
    async def operator(host: Host) -> None:
        host.pause()
        for _ in range(1000):
            if await host.step() is None and host.at_rest:
                break
            await asyncio.sleep(0.5)
        assert host.at_rest
        assert not host.dispatch.timers
        host.resume()

    report, _ = run_cell("one_robot", 1, operator=operator, disturbances=[disturbance])
    assert report.state is state


def test_paused_run_does_not_end_while_the_operator_holds_firings_back() -> None:
    async def operator(host: Host) -> None:
        await until(lambda: firings(host) == 14, "all but one")
        host.pause()
        host.stop(at_end_of_cycle=True)
        await asyncio.sleep(100.0)
        assert host.at_rest
        host.resume()

    report, _ = run_cell("one_robot", 1, operator=operator, overdue_seconds=1000.0)
    assert sum(report.firings.values()) == 15
    assert report.situation.marking == catalogue_net("one_robot").names(catalogue_net("one_robot").initial_marking)


def test_step_is_for_a_paused_run() -> None:
    async def operator(host: Host) -> None:
        assert await host.step() is None

    assert run_cell("one_robot", 1, operator=operator)[0].state is State.DONE


def test_after_a_stop_nothing_fires_and_every_machine_stands_still() -> None:
    kept: list[Host] = []

    async def operator(host: Host) -> None:
        kept.append(host)
        await asyncio.sleep(41.0)
        host.stop()
        host.resume()  # a stop is final

    report, trace = run_cell("one_robot", 50, operator=operator)
    assert report.state is State.STOPPED
    assert report.simulated_seconds == pytest.approx(41.0)
    assert report.inside
    stopped = next(
        i for i, e in enumerate(trace.events) if isinstance(e, Noted) and e.note == "stopped by the operator"
    )
    assert not [event for event in trace.events[stopped:] if isinstance(event, Fired | CommandSent)]
    driver = kept[0].driver
    assert isinstance(driver, SimulatedDriver)
    assert all(machine.busy is None for machine in driver.plant.machines.values())


def test_a_trace_that_breaks_while_a_command_is_overdue_ends_the_run() -> None:
    class Full(io.StringIO):
        def write(self, line: str) -> int:
            if "overdue" in line:
                raise OSError("no space left")
            return super().write(line)

    never = NeverCompletes("R", "GRASP", 1)
    with pytest.raises(OSError, match="no space left"):
        execute(decomposition_of("one_robot"), plant_of("one_robot"), workpieces=1, trace=Full(), disturbances=[never])


def test_stop_at_the_end_of_the_cycle_leaves_an_empty_cell() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(60.0)
        host.stop(at_end_of_cycle=True)

    report, _ = run_cell("one_robot", 50, operator=operator)
    assert report.state is State.STOPPED
    assert report.inside == ()
    assert report.delivered == tuple(range(1, len(report.delivered) + 1))
    assert 1 < len(report.delivered) < 50


async def reset_and_resume(host: Host) -> None:
    """After an emergency stop, where what the machines were at is to be done anew; stop a run that does not end."""
    assert host.reset() == ()
    await asyncio.sleep(1.0)
    for place in uncertain(host):
        assert host.say(place, Answer.NOT_RECEIVED)
    assert host.resume()
    await asyncio.sleep(1000.0)
    host.stop()


def test_work_comes_in_again_after_an_emergency_stop_in_the_last_cycle() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(60.0)
        host.stop(at_end_of_cycle=True)
        await asyncio.sleep(1.0)
        host.emergency_stop("a person")
        await until(lambda: host.situation().state is State.LATCHED, "the latch")
        await reset_and_resume(host)

    report, _ = run_cell("one_robot", 6, operator=operator)
    assert (report.state, report.delivered) == (State.DONE, tuple(range(1, 7)))


def test_a_run_that_was_stopped_at_the_end_of_its_cycle_is_taken_up_with_the_work_that_is_to_come(
    tmp_path: Path,
) -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(60.0)
        host.stop(at_end_of_cycle=True)

    def run_on(operator: Operator | None) -> RunReport:
        cell, plant = decomposition_of("one_robot"), plant_of("one_robot")
        return execute(
            cell, plant, workpieces=6, operator=operator, journal_path=tmp_path / "cell.journal", resume=True
        )

    stopped = run_on(operator)
    assert stopped.state is State.STOPPED
    assert len(stopped.delivered) < 6
    for _ in range(2):  # the second one finds nothing to do
        report = run_on(None)
        assert (report.state, report.delivered) == (State.DONE, tuple(range(1, 7)))


def test_what_was_due_while_a_run_was_latched_happens_when_it_is_reset() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(100.0)  # the first workpiece has left, and the second has not come
        host.emergency_stop("a person")
        await asyncio.sleep(200.0)
        await reset_and_resume(host)

    text = catalogue_path("one_robot").with_name("one_robot.plant.yaml").read_text()
    report, _ = run_cell(
        "one_robot", 2, operator=operator, plant=parse_plant(text.replace("every_s: 8", "every_s: 200"))
    )
    assert (report.state, report.delivered) == (State.DONE, (1, 2))


def test_cancelled_run_is_an_operators_stop() -> None:
    async def cancelled(host: Host) -> None:
        await asyncio.sleep(20.0)
        (main,) = (task for task in asyncio.all_tasks() if "terminable" in repr(task.get_coro()))
        main.cancel()

    report, _ = run_cell("one_robot", 5, operator=cancelled)
    assert report.state is State.STOPPED


def test_operators_mistake_ends_the_run() -> None:
    async def operator(host: Host) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_cell("one_robot", 5, operator=operator)


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

    stopped = execute(circles("a", "b"), NO_MACHINES, workpieces=1, operator=operator)
    assert stopped.state is State.STOPPED
    assert fired[0] == fired[1]


def test_net_that_runs_in_circles_without_its_cell_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.executor.operating.groups.FIRINGS_AT_ONCE_MAX", 500)
    report = execute(circles("a"), NO_MACHINES, workpieces=1)
    assert report.state is State.FAULT
    assert "fire without end" in report.situation.message


def test_single_steps_take_turns_among_the_controllers() -> None:
    stepped = []

    async def operator(host: Host) -> None:
        host.pause()
        for _ in range(6):
            stepped.append(await host.step())
        host.stop()

    execute(circles("a", "b"), NO_MACHINES, workpieces=1, operator=operator)
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
    report = execute(split(net), plant_of("one_robot"), workpieces=2)
    assert report.state is State.FAULT
    assert "R pulls at a workpiece that is clamped on mc_table" in report.situation.message


@pytest.mark.parametrize(("workpieces", "speed", "overdue_seconds"), [(-1, None, 1.0), (1, 0.0, 1.0), (1, None, 0.0)])
def test_senseless_quantities_are_refused(workpieces: int, speed: float | None, overdue_seconds: float) -> None:
    with pytest.raises(ValueError, match="must"):
        run_cell("one_robot", workpieces, speed=speed, overdue_seconds=overdue_seconds)


def test_run_without_workpieces_is_done_at_once() -> None:
    report, _ = run_cell("one_robot", 0)
    assert (report.state, report.commands, report.simulated_seconds) == (State.DONE, 0, 0.0)
