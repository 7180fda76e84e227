"""A host that is killed and started anew among others: held, asked what its machines did, and let go on."""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from support.hosts import ONE_EACH, ROBOT, Cell

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Answer as DriversAnswer
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import Greeting
from firable.executor.links.storages import Storage
from firable.executor.operating.host import Host
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import Decision, Stored, VoteRequest
from firable.nets.net import Place
from firable.nets.text import parse_net

LAMP = """\
firable: 1
cell: cell
controllers:
  a: {start: free, inputs: key, places: {free: , lamp: {send: {machine: A, command: OPEN}}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  hand: {from: [a.free, b.idle], to: [a.lamp, b.has], if: a.key}
"""


@pytest.mark.parametrize("after", [3.0, 3.999, 4.0, 5.1, 6.0, 8.2])
@pytest.mark.parametrize("dies", ONE_EACH, ids=lambda machines: machines[0] or "coordinator")
def test_a_host_that_is_killed_and_started_anew_loses_and_doubles_nothing(
    dies: tuple[str, ...], after: float, tmp_path: Path
) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(after)
        await cell.kill(dies)
        await asyncio.sleep(5)
        cell.start(dies)
        await asyncio.sleep(5)
        held = [name for name, controller in cell.hosts[dies].controllers.items() if controller.held]
        assert held == [name for name in dies if name]
        stood = cell.firings()
        assert cell.hosts[dies].resume()
        await asyncio.sleep(60)
        await cell.stop()
        assert cell.replayed().firings > stood + 30

    run_in_virtual_time(main())


def test_while_held_nothing_that_needs_the_machine_fires(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(5.1)
        await cell.kill(ROBOT)
        cell.start(ROBOT)
        await asyncio.sleep(30)
        stood = cell.firings()
        await asyncio.sleep(30)
        assert cell.firings() == stood
        assert any("is held, until it is resumed" in sentence for sentence in cell.hosts[ROBOT].peers.waits())
        assert ("held", "'robot' is held, until it is resumed") in cell.told
        await cell.stop()
        cell.replayed()

    run_in_virtual_time(main())


def test_commands_without_an_answer_keep_the_host_held_until_somebody_knows(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.5)
        await cell.kill(ROBOT)
        cell.start(ROBOT)
        host = cell.hosts[ROBOT]
        questions = host.controllers["robot"].commands.questions
        assert questions
        assert not host.resume()  # the driver has not been asked yet
        for place, entry in questions:
            host.answer("robot", place, entry, Answer.NOT_RECEIVED)
        assert host.resume()
        await asyncio.sleep(20)
        await cell.stop()
        assert cell.replayed().firings > 10

    run_in_virtual_time(main())


def test_what_no_machine_knows_an_operator_may_say_beforehand(tmp_path: Path) -> None:
    class Forgetful(DryRunDriver):
        async def ask(self, place: Place, entry: int) -> DriversAnswer:
            return DriversAnswer.UNKNOWN if place.command is not None and entry else DriversAnswer.DONE

    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.5)
        await cell.kill(ROBOT)
        cell.start(ROBOT)
        host = cell.hosts[ROBOT]
        ((place, _),) = host.controllers["robot"].commands.questions
        host.driver = Forgetful([cell.decomposition.subnet("robot")], 1.0)
        await asyncio.sleep(1)
        assert not host.resume()
        assert any(f"of '{place}': look" in sentence for kind, sentence in cell.told if kind == "held")
        await cell.kill(ROBOT)
        cell.start(ROBOT, said={place: Answer.NOT_RECEIVED})
        host = cell.hosts[ROBOT]
        host.driver = Forgetful([cell.decomposition.subnet("robot")], 1.0)
        await asyncio.sleep(1)
        assert host.resume()
        await asyncio.sleep(20)
        await cell.stop()
        assert cell.replayed().firings > 10

    run_in_virtual_time(main())


@pytest.mark.parametrize("end", [Host.stop, lambda host: host.driver_fault("R", "failed")], ids=["stop", "fault"])
def test_a_host_that_is_to_resume_by_itself_commands_nothing_after_a_stop(
    end: Callable[[Host], None], tmp_path: Path
) -> None:
    class Slow(DryRunDriver):
        sent = 0

        def send(self, place: Place, entry: int) -> None:
            super().send(place, entry)
            self.sent += 1

        async def ask(self, place: Place, entry: int) -> DriversAnswer:
            await asyncio.sleep(0.3)
            return DriversAnswer.NOT_RECEIVED if place.command is not None and entry else DriversAnswer.UNKNOWN

    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(2.5)
        await cell.kill(ROBOT)
        cell.start(ROBOT, resume=True)
        host = cell.hosts[ROBOT]
        driver = host.driver = Slow([cell.decomposition.subnet("robot")], 1.0)
        await asyncio.sleep(0.1)
        assert host.controllers["robot"].commands.questions
        end(host)
        await cell.tasks[ROBOT]
        assert driver.sent == 0
        assert not host.resume()
        await cell.stop()

    run_in_virtual_time(main())


def test_a_command_that_is_decided_when_the_driver_fails_is_asked_after_at_the_restart() -> None:
    class Kept(MemoryJournal):
        durable: Mapping[str, Stored] = {}

        def sync(self) -> None:
            self.durable = dict(self.kept("a"))

    class Noting(DryRunDriver):
        sent = 0

        def send(self, place: Place, entry: int) -> None:
            super().send(place, entry)
            self.sent += 1

    async def main() -> None:
        decomposition, journal = split(parse_net(LAMP)), Kept()
        driver = Noting([decomposition.subnet("a")], 1.0)
        link = InProcessLink(Exchange(), Greeting("d", ("a",)))
        recorder = Recorder(decomposition.net, "", None, None, ("a",))
        host = Host(decomposition, driver, recorder, machines=("a",), link=link, journal=journal)
        ending = asyncio.create_task(host.main())
        await asyncio.sleep(0.05)
        host.peers.connected("", Storage("of another host"))
        host.peers.arrived("", "a", VoteRequest("a", 0, ("hand",), 0, -1), 0)
        await asyncio.sleep(0.05)
        host.peers.arrived("", "a", Decision("a", 0, "hand", 0, -1), 0)
        host.driver_fault("A", "failed")
        assert (await ending).state is State.FAULT
        assert driver.sent == 0
        assert journal.durable["command/place/a.lamp"] == ("a.lamp", 1, "issued")

    run_in_virtual_time(main())
