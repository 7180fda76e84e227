"""An operator at a running cell: pause, single steps, stops, and the end of the cycle."""

import asyncio
from pathlib import Path

import pytest
from support.cell_runs import notes, run_cell
from support.cells import decomposition_of, firings, plant_of

from firable.executor.cell.disturbances import Disturbance, NeverCompletes, StuckSensor
from firable.executor.drivers.bench import until
from firable.executor.drivers.simulated import SimulatedDriver
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.restart import uncertain
from firable.executor.operating.running import Operator, RunReport, SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.nets.catalogue import catalogue_net, catalogue_path
from firable.nets.machines.plant_file import parse_plant
from firable.semantics.trace import CommandSent, Fired, Noted


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
        assert not host.say(place, Answer.NOT_RECEIVED)
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
            cell,
            SimulatedCell(plant, workpieces=6),
            Conduct(operator=operator, journal_path=tmp_path / "cell.journal", resume=True),
        )

    stopped = run_on(operator)
    assert stopped.state is State.STOPPED
    assert len(stopped.delivered) < 6
    for _ in range(2):  # the second one finds nothing to do
        report = run_on(None)
        assert (report.state, report.delivered) == (State.DONE, tuple(range(1, 7)))


def test_workpieces_come_while_a_run_is_latched() -> None:
    async def operator(host: Host) -> None:
        await asyncio.sleep(100.0)  # the first workpiece has left, and the second has not come
        host.emergency_stop("a person")
        assert not host.driver.readings()["conveyor.part_at_entry"].value
        await asyncio.sleep(200.0)
        assert host.situation().state is State.LATCHED
        assert host.driver.readings()["conveyor.part_at_entry"].value
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
