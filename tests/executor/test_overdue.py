"""Commands that are not done in time: a fault, with what it waited for."""

import asyncio
import io

import pytest
from support.cell_runs import replace_text, run_cell
from support.cells import decomposition_of, plant_of

from firable.decompose.splitting.cut import split
from firable.executor.cell.disturbances import NeverCompletes, StuckSensor
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Answer
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import KEY, TRACE, Recorder
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.nets.interchange import net_digest
from firable.nets.machines.plant_file import parse_plant
from firable.nets.net import Place
from firable.nets.text import parse_net


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
        SimulatedCell(parse_plant(MOVER), workpieces=1, disturbances=[NeverCompletes("M", "GO", 1)]),
        Conduct(overdue_seconds=60.0, operator=pausing),
    )
    assert seen == ([State.PAUSED] if paused_seconds else [])
    assert report.state is State.FAULT
    assert "is overdue: it counts as taken" in report.situation.message
    assert report.situation.message.endswith("'r.moved' has not come within its 5 s, nor its timeout in 60 s more")


LATE = """
firable: 1
cell: late
controllers:
  r:
    start: free
    inputs: key
    places: {free: , moves: {send: {machine: M, command: GO}, until: moved, within: {time: 5s, to: late}}, late: }
transitions:
  go: {from: r.free, to: r.moves}
  come: {from: r.moves, to: r.free}
  again: {from: r.late, to: r.free, unless: r.key}
"""


class Working(DryRunDriver):
    """A machine that is at its command for ever."""

    def send(self, place: Place, entry: int) -> None:
        """Begin it."""

    async def ask(self, place: Place, entry: int) -> Answer:
        del place, entry
        return Answer.WORKING


@pytest.mark.parametrize("held_seconds", [127.0, 300.0])  # longer than 65 s, and so long that 2 * 65 s are over soon
def test_a_timed_command_is_not_overdue_while_its_run_is_held_and_its_time_does_not_run(held_seconds: float) -> None:
    async def present(_: Host) -> None:
        await asyncio.sleep(1000.0)

    async def main() -> None:
        journal = MemoryJournal()
        for is_taken_up in (False, True):
            decomposition = split(parse_net(LATE))
            net, kept = decomposition.net, journal.kept(TRACE).get(KEY)
            recorder, driver = Recorder(net, net_digest(net), io.StringIO(), kept), Working(decomposition.subnets, 1.0)
            conduct = Conduct(overdue_seconds=60.0, operator=present)
            host = Host(decomposition, driver, recorder, conduct, journal=journal)
            ending = asyncio.create_task(host.main())
            await asyncio.sleep(1.0)
            if is_taken_up:
                await asyncio.sleep(held_seconds)
                assert host.situation().state is State.HELD
                assert host.resume()
                await asyncio.sleep(10.0)
            assert host.marking == (("r.late",) if is_taken_up else ("r.moves",))
            host.stop()
            assert (await ending).state is State.STOPPED

    run_in_virtual_time(main())


def test_slow_command_is_no_fault_within_its_limit() -> None:
    slow = replace_text("one_robot", "takes_s: 12.0", "takes_s: 110")
    assert run_cell("one_robot", 2, plant=slow)[0].state is State.DONE


def test_stuck_sensor_of_a_completion_makes_the_command_overdue() -> None:
    report, _ = run_cell("one_robot", 5, disturbances=[StuckSensor("robot.touch", value=False)])
    assert report.state is State.FAULT
    assert "'robot.touch' has not come" in report.situation.message


def test_a_trace_that_breaks_while_a_command_is_overdue_ends_the_run() -> None:
    class Full(io.StringIO):
        def write(self, line: str) -> int:
            if "overdue" in line:
                raise OSError("no space left")
            return super().write(line)

    never = NeverCompletes("R", "GRASP", 1)
    with pytest.raises(OSError, match="no space left"):
        execute(
            decomposition_of("one_robot"),
            SimulatedCell(plant_of("one_robot"), workpieces=1, disturbances=[never]),
            Conduct(trace=Full()),
        )
