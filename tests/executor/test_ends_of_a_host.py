"""One host of several is stopped, ends its cycle or fails: it is safe, and it leaves nothing open."""

import asyncio
from pathlib import Path

from support.hosts import CENTRE, ROBOT, TOGETHER, Cell, ended_within

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.ending import beginnings
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import State
from firable.executor.protocol.messages import VoteRequest
from firable.nets.catalogue import catalogue_net
from firable.nets.interchange import net_digest
from firable.nets.net import Place
from firable.nets.text import parse_net
from firable.semantics.trace import Noted, read_trace


def test_an_overdue_command_ends_its_host_and_the_others_see_it_lost(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        host = cell.hosts[ROBOT]
        host.dispatch.overdue_seconds = 0.5
        situation = await cell.tasks[ROBOT]
        assert situation.state is State.FAULT
        assert "is overdue" in situation.message
        await asyncio.sleep(1)
        assert any(kind == "lost" and sentence.startswith("'robot' is lost") for kind, sentence in cell.told)

    run_in_virtual_time(main())


def test_nothing_stands_behind_the_last_line(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, TOGETHER)
        await asyncio.sleep(5)
        await cell.stop()
        for host in cell.hosts.values():
            host.peers.lost("robot")
            assert not host.recorder.unwritten
        assert cell.replayed().firings > 3

    run_in_virtual_time(main())


def test_a_host_that_is_stopping_promises_nothing_more(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(0.5)
        host, controller = cell.hosts[ROBOT], cell.hosts[ROBOT].controllers["robot"]
        name = next(n for n, part in controller.parts.items() if part.enabled(controller.word))
        host.stop()
        host.peers.arrived(COORDINATOR, "robot", VoteRequest("robot", 7 << 40, (name,), 0, -1), 0)
        await asyncio.sleep(0.1)
        assert not any(promise.promised for promise in controller.promises.values())
        await cell.stop()

    run_in_virtual_time(main())


def test_an_emergency_stop_of_a_host_is_safe_first_and_commands_nothing_more(tmp_path: Path) -> None:
    class Strict(DryRunDriver):
        def send(self, place: Place, entry: int) -> None:
            assert not self.is_stopped
            super().send(place, entry)

    async def main() -> None:
        cell = Cell(tmp_path)
        host = cell.hosts[ROBOT]
        driver = host.driver = Strict([cell.decomposition.subnet("robot")], 1.0)
        await asyncio.sleep(3.5)
        host.emergency_stop("a person in the cell")
        assert driver.is_stopped
        assert host.outcome is not None
        assert not host.outcome.done()
        ended = await cell.tasks[ROBOT]
        assert (ended.state, ended.message) == (State.STOPPED, "emergency stop: a person in the cell")
        assert not host.resume()
        await cell.stop()
        notes = [event for event in read_trace(cell.path(ROBOT)).events if isinstance(event, Noted)]
        assert any(event.note == "emergency stop" for event in notes)

    run_in_virtual_time(main())


def test_a_cell_whose_driver_cannot_keep_work_out_ends_its_cycle_with_the_machines_as_at_the_beginning() -> None:
    async def main() -> Host:
        decomposition = split(catalogue_net("one_robot"))
        recorder = Recorder(decomposition.net, "", None)
        host = Host(decomposition, DryRunDriver(decomposition.subnets, 1.0), recorder)
        ending = asyncio.create_task(host.main())
        await asyncio.sleep(33)
        assert host.recorder.marking != decomposition.net.initial_marking
        host.stop(at_end_of_cycle=True)
        assert host.situation().message == "the operator has asked for the end at the end of the cycle"
        begun = host.recorder.firings["G1"]
        ended = await ended_within(ending, 100)
        assert (ended.state, ended.message) == (State.STOPPED, "stopped at the end of the cycle")
        assert [str(one) for one in ended.blocked] == ["G1 is barred by the operator: no new work comes in"]
        assert host.recorder.marking == decomposition.net.initial_marking
        assert host.recorder.firings["G1"] == begun == host.recorder.firings["G9"]  # what was begun was ended
        return host

    run_in_virtual_time(main())


def test_a_host_that_ends_its_cycle_takes_no_new_work_and_ends_alone(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(33)
        host = cell.hosts[("conveyor",)]
        host.stop(at_end_of_cycle=True)
        alone = "conveyor alone is waited for; the cell may not be empty"
        assert alone in host.situation().message
        situation = await ended_within(cell.tasks[("conveyor",)], 100)
        assert situation.state is State.STOPPED
        controller = host.controllers["conveyor"]
        assert controller.marking == controller.subnet.initial_marking
        await cell.stop()
        cell.replayed()
        notes = [event for event in read_trace(cell.path(("conveyor",))).events if isinstance(event, Noted)]
        assert [note.data for note in notes if note.note == "stopped at the end of the cycle"] == [{"message": alone}]

    run_in_virtual_time(main())


def test_an_emergency_stop_needs_neither_coordinator_nor_link(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(7.3)
        await cell.kill(CENTRE)
        cell.exchange.cut(cell.links[ROBOT])
        robot = cell.hosts[ROBOT]
        driver = robot.driver
        assert isinstance(driver, DryRunDriver)
        robot.emergency_stop("a person in the cell")
        assert driver.is_stopped, "before it returns"
        ended = await ended_within(cell.tasks[ROBOT], 5)
        assert ended.message == "emergency stop: a person in the cell"
        cell.start(CENTRE)
        await asyncio.sleep(1)
        await cell.stop()

    run_in_virtual_time(main())


HELD = """
firable: 1
cell: held
controllers:
  line:
    start: running
    inputs: [hold, release, door, gate]
    places: {running: , held: , doors: , gates: , counted: }
  robot:
    start: free
    inputs: part
    places: {free: , taken: , work: {send: {machine: R, command: WORK}, until: worked}}
transitions:
  hold: {from: line.running, to: line.held, if: line.hold}
  release: {from: line.held, to: line.running, if: line.release}
  take: {from: robot.free, to: robot.taken, if: [robot.part, line.running]}
  begin: {from: robot.taken, to: robot.work}
  end: {from: robot.work, to: robot.free}
"""


def test_an_end_of_the_cycle_bars_what_brings_work_and_not_the_key_that_holds_the_cell() -> None:
    """What holds work up is obeyed to the end; of two buttons that begin work together one is barred at least."""
    assert beginnings(parse_net(HELD)) == ("take",)
    two = HELD.replace(
        "  begin:",
        "  one: {to: line.doors, if: line.door}\n  two: {to: line.gates, if: line.gate}\n"
        "  both: {from: [line.doors, line.gates, robot.free], to: robot.taken}\n  begin:",
    )
    assert beginnings(parse_net(two)) == ("take", "one", "two")
    buttons = two.replace("  both:", "  let_go: {from: line.doors}\n  let_go_too: {from: line.gates}\n  both:")
    assert beginnings(parse_net(buttons)) == ("take", "two")
    by_itself = HELD.replace("if: [robot.part, line.running]", "if: line.running")
    assert beginnings(parse_net(by_itself)) == ("take",)
    nothing = HELD.replace("send: {machine: R, command: WORK}, until: worked", "description: at work")
    assert beginnings(parse_net(nothing)) == ("take",)


JOINING = """
firable: 1
cell: joining
controllers:
  left: {start: empty, inputs: there, places: {empty: , full: }}
  right: {start: empty, inputs: there, places: {empty: , full: }}
  robot:
    start: free
    places: {free: , join: {send: {machine: R, command: JOIN}, until: joined}}
transitions:
  from_left: {from: left.empty, to: left.full, if: left.there}
  from_right: {from: right.empty, to: right.full, if: right.there}
  join: {from: [left.full, right.full, robot.free], to: [left.empty, right.empty, robot.join]}
  end: {from: robot.join, to: robot.free}
"""


def test_a_part_that_would_wait_for_another_one_comes_in_no_more_at_the_end_of_the_cycle() -> None:
    net = parse_net(JOINING)
    assert beginnings(net) == ("from_left", "from_right")

    async def present(_: Host) -> None:
        await asyncio.sleep(600)

    async def main() -> None:
        machine = DryRunDriver(split(net).subnets, 1.0, {"left.there": False, "right.there": False})
        run = Host(split(net), machine, Recorder(net, net_digest(net), None), Conduct(operator=present))
        ending = asyncio.create_task(run.main())
        await asyncio.sleep(1)
        run.signal("left.there", value=True, entry=None)
        run.stop(at_end_of_cycle=True)
        situation = await asyncio.wait_for(ending, 60)
        assert (situation.state, situation.message) == (State.STOPPED, "stopped at the end of the cycle")

    run_in_virtual_time(main())
