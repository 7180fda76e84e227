"""What a host says of the others: whom it waits for, who is lost, was refused, or never came."""

import asyncio
from pathlib import Path

from support.hosts import CENTRE, ROBOT, Cell

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting, Refusal
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.nets.diagnostics import Diagnostic
from firable.nets.text import parse_net


def test_a_round_that_was_aborted_keeps_nobody_waiting(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(7.3)
        cell.exchange.cut(cell.links[ROBOT])
        await asyncio.sleep(5)
        cell.hosts[CENTRE].coordinators[COORDINATOR].permit(0)
        assert not any("robot" in sentence for sentence in cell.hosts[CENTRE].peers.waits())

    run_in_virtual_time(main())


CROSSED = """
firable: 1
cell: crossed
controllers:
  left: {start: free, inputs: part, places: {free: , hold: {send: {machine: L, command: HOLD}, until: held}}}
  right: {start: free, inputs: part, places: {free: , hold: {send: {machine: R, command: HOLD}, until: held}}}
transitions:
  take_left: {from: left.free, to: left.hold}
  take_right: {from: right.free, to: right.hold}
  give_left: {from: left.hold, to: left.free, if: [left.held, right.part]}
  give_right: {from: right.hold, to: right.free, if: [right.held, left.part]}
"""


def test_the_host_of_the_coordinator_says_who_else_a_transition_waits_for() -> None:
    async def main() -> None:
        decomposition, own = split(parse_net(CROSSED)), (COORDINATOR, "left")
        exchange, hosts = Exchange(), []
        for machines in (own, ("right",)):
            subnets = [decomposition.subnet(name) for name in machines if name]
            driver = DryRunDriver(subnets, 1.0, {f"{machines[-1]}.part": False})
            recorder = Recorder(decomposition.net, "", None, None, machines)
            link = InProcessLink(exchange, Greeting("d", machines))
            hosts.append(Host(decomposition, driver, recorder, machines=machines, link=link))
        tasks = [asyncio.create_task(host.main()) for host in hosts]
        await asyncio.sleep(5)
        left, right = ([str(one) for one in host.situation().blocked] for host in hosts)
        assert left == ["give_left is ready here, and waits for right to be ready", "give_right waits for left.part"]
        assert right == [
            "give_left waits for right.part",
            "give_right is ready here, and is decided by the coordinator",
        ]
        for host in hosts:
            host.stop()
        await asyncio.gather(*tasks)

    run_in_virtual_time(main())


def test_a_machine_that_never_comes_is_told_by_name_and_no_more_when_it_has_come(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, (CENTRE, ("system", "mc", "conveyor")))
        await asyncio.sleep(10)
        centre = cell.hosts[CENTRE]
        assert set(centre.peers.never_met) == {"robot"}
        assert [sentence for kind, sentence in cell.told if kind == "never-met"] == [
            "'robot' was never reached: is its host started, and the address right?"
        ]
        assert "'robot' was never reached" in centre.situation().message
        cell.journals[ROBOT] = MemoryJournal()
        cell.start(ROBOT)
        await asyncio.sleep(20)
        assert set(centre.peers.never_met) == set()
        assert cell.firings() > 5
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())


def test_a_machine_that_was_refused_is_not_told_to_be_missing(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, (CENTRE, ("system", "mc", "conveyor")))
        await asyncio.sleep(1)
        centre = cell.hosts[CENTRE]
        problem = Diagnostic("F5020", "'robot' holds another bundle", "give it this one")
        centre.peers.refused(ROBOT, Refusal(problem, are_unlike=True))
        await asyncio.sleep(9)
        assert not [sentence for kind, sentence in cell.told if kind == "never-met"]
        assert "'robot' is refused: 'robot' holds another bundle; give it this one" in centre.situation().message
        assert "was never reached" not in centre.situation().message
        cell.journals[ROBOT] = MemoryJournal()
        cell.start(ROBOT)
        await asyncio.sleep(20)
        assert "refused" not in centre.situation().message
        await cell.stop()

    run_in_virtual_time(main())


def test_a_situation_names_the_hosts_that_are_lost_also_where_no_answer_is_awaited(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(12.3)
        robot, centre = cell.hosts[ROBOT], cell.hosts[CENTRE]
        assert "not connected" not in robot.situation().message + centre.situation().message
        cell.exchange.cut(cell.links[ROBOT])
        await asyncio.sleep(60)
        assert not list(robot.peers.waits()), "it is at its work, and has promised nothing"
        assert robot.situation().message == "the coordinator is not connected"
        assert centre.situation().message.startswith("'robot' is not connected")
        cell.exchange.mend(cell.links[ROBOT])
        await asyncio.sleep(10)
        assert "not connected" not in robot.situation().message + centre.situation().message
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())


def test_parts_of_one_host_in_a_transition_wait_as_one(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, (("", "system", "mc", "conveyor"), ROBOT))
        for _ in range(60):
            await asyncio.sleep(0.5)
            waiting = [one.transition for one in cell.hosts["", "system", "mc", "conveyor"].situation().blocked]
            assert len(waiting) == len(set(waiting))
        await cell.stop()

    run_in_virtual_time(main())
