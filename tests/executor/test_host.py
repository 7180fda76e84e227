"""The hosts of a cell together: each does its part, lines are cut and mended, and the traces join to one of the net."""

import asyncio
import io
from pathlib import Path

import pytest
from support.hosts import ALL_IN_ONE, CENTRE, ONE_EACH, ROBOT, TOGETHER, Cell

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.conduct import Conduct
from firable.executor.operating.peers import REPEAT_SECONDS, REPEAT_SECONDS_MAX
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.operating.situation import State
from firable.executor.protocol.messages import Decision, Vote
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.semantics.trace import Fired, Noted, parse_trace, read_trace


@pytest.mark.parametrize("of", [ONE_EACH, TOGETHER, ALL_IN_ONE], ids=["one each", "together", "all in one"])
def test_hosts_run_a_cell_and_their_traces_join_to_one_of_the_net(
    of: tuple[tuple[str, ...], ...], tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, of)
        await asyncio.sleep(60)
        ended = await cell.stop()
        assert {situation.state for situation in ended.values()} == {State.STOPPED}
        assert cell.replayed().firings == cell.firings() > 50

    run_in_virtual_time(main())


def test_a_run_over_the_in_process_link_is_a_function_of_its_cell(tmp_path: Path) -> None:
    async def main(folder: Path) -> int:
        folder.mkdir()
        cell = Cell(folder)
        await asyncio.sleep(60)
        await cell.stop()
        return cell.replayed().firings

    assert run_in_virtual_time(main(tmp_path / "a")) == run_in_virtual_time(main(tmp_path / "b")) > 50


@pytest.mark.parametrize("cut", ONE_EACH, ids=lambda machines: machines[0] or "coordinator")
def test_a_host_that_is_cut_off_is_told_and_the_cell_goes_on_when_the_line_is_back(
    cut: tuple[str, ...], tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(7.3)
        cell.exchange.cut(cell.links[cut])
        await asyncio.sleep(30)
        stood = cell.firings()
        assert [kind for kind, _ in cell.told].count("lost") == 8
        await asyncio.sleep(30)
        assert cell.firings() == stood  # nobody goes on without the machine that is cut off
        waiting = [sentence for host in cell.hosts.values() for sentence in host.peers.waits()]
        cell.exchange.mend(cell.links[cut])
        await asyncio.sleep(60)
        await cell.stop()
        assert cell.replayed().firings > stood + 30
        assert waiting or cut != ROBOT

    run_in_virtual_time(main())


def test_what_a_host_may_not_say_is_dropped(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(0.5)
        centre, robot = cell.hosts[CENTRE], cell.hosts[ROBOT]
        before = dict(centre.coordinators[COORDINATOR].seen)
        readiness = robot.controllers["robot"].above[COORDINATOR].readiness
        centre.peers.arrived("mc", COORDINATOR, Vote("robot", 0, frozenset({"G2"}), readiness), 0)
        robot.peers.arrived("mc", "robot", Decision("robot", 0, "G2", 0, 0), 0)
        robot.peers.arrived(COORDINATOR, "robot", Decision("mc", 0, "G2", 0, 0), 0)
        assert [kind for kind, _ in cell.told].count("dropped") == 3
        assert not centre.acts.posted
        assert not robot.acts.posted
        assert before is not None
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())


def test_what_was_missed_is_said_again_as_soon_as_the_line_is_back(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        for host in cell.hosts.values():
            host.peers.repeat_seconds = 1e6
        await asyncio.sleep(7.3)
        cell.exchange.cut(cell.links[CENTRE])
        await asyncio.sleep(5)
        stood = cell.firings()
        cell.exchange.mend(cell.links[CENTRE])
        await asyncio.sleep(30)
        await cell.stop()
        assert cell.replayed().firings > stood + 20

    run_in_virtual_time(main())


def test_a_trace_says_who_was_lost_and_who_came_back(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2)
        cell.exchange.cut(cell.links[ROBOT])
        await asyncio.sleep(2)
        cell.exchange.mend(cell.links[ROBOT])
        await asyncio.sleep(2)
        await cell.stop()

    run_in_virtual_time(main())
    notes = [e.note for e in read_trace(tmp_path / "robot.trace").events if isinstance(e, Noted)]
    told = [note for note in notes if note in {"connected", "lost"}]
    # In the end the coordinator is lost once more, by whose end that of this host is known to be heard.
    assert told == [*4 * ["connected"], *4 * ["lost"], *4 * ["connected"], *told[12:]]
    assert set(told[12:]) <= {"lost"}


def test_every_vote_of_a_whole_run_stands_in_its_trace_before_what_it_decides() -> None:
    stream = io.StringIO()
    execute(
        split(catalogue_net("one_robot")),
        SimulatedCell(catalogue_plant("one_robot"), workpieces=2),
        Conduct(trace=stream),
    )
    trace = parse_trace(stream.getvalue())
    voted: dict[int, set[str]] = {}
    for event in trace.events:
        match event:
            case Noted(_, "voted", {"round": number, "controller": controller}):
                assert controller not in voted.setdefault(number, set()), "a vote is told once"
                voted[number].add(controller)
            case Fired(_, ("G2",), int(number)):
                assert voted[number] == {"system", "robot", "mc", "conveyor"}
    assert len(voted) >= 18


def test_what_nobody_answers_is_repeated_ever_more_seldom_and_soon_when_there_is_something_new(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(5.1)
        cell.exchange.cut(cell.links[CENTRE])
        robot = cell.hosts[ROBOT]
        await asyncio.sleep(60)
        before = robot.acts.repeats
        await asyncio.sleep(32)
        assert 0 < robot.acts.repeats - before <= 32 / REPEAT_SECONDS_MAX + 1
        cell.exchange.mend(cell.links[CENTRE])
        assert robot.peers.pause_seconds == REPEAT_SECONDS
        await asyncio.sleep(30)
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())


def test_an_operator_acts_on_one_host_and_its_machines_alone(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(12.3)
        robot, centre = cell.hosts[ROBOT], cell.hosts[CENTRE]
        robot.pause()
        await asyncio.sleep(5)
        stood = dict(robot.recorder.firings)
        promised = dict(robot.controllers["robot"].promises)
        await asyncio.sleep(30)
        assert robot.recorder.firings == stood
        assert not promised
        assert robot.situation().state is State.PAUSED
        assert any("waits for the vote of 'robot'" in sentence for sentence in centre.peers.waits())
        assert robot.resume()
        fired = cell.firings()
        await asyncio.sleep(30)
        assert cell.firings() > fired + 10
        centre.pause()
        await asyncio.sleep(10)
        stepped = [await centre.step() for _ in range(40)]
        assert len([name for name in stepped if name]) >= 1
        assert centre.situation().state is State.PAUSED
        centre.resume()
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())
