"""The hosts of a cell: alone, together, cut off, killed and started anew; their traces join to one of the net."""

import asyncio
import io
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from support.hosts import ALL_IN_ONE, ONE_EACH, TOGETHER, Cell, ended_within

from firable.decompose import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.drivers.driver import Answer as DriversAnswer
from firable.executor.drivers.dry_run import DryRunDriver
from firable.executor.journal.journal import MemoryJournal
from firable.executor.links.in_process import Exchange, InProcessLink
from firable.executor.links.link import COORDINATOR, Greeting, Refusal
from firable.executor.links.storages import Storage
from firable.executor.operating.host import Host
from firable.executor.operating.peers import REPEAT_SECONDS, REPEAT_SECONDS_MAX
from firable.executor.operating.recorder import Recorder
from firable.executor.operating.running import execute
from firable.executor.operating.situation import State
from firable.executor.protocol.commands import Answer
from firable.executor.protocol.messages import Decision, Stored, Vote, VoteRequest
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.diagnostics import Diagnostic
from firable.nets.net import Place
from firable.nets.text import parse_net
from firable.semantics.trace import Fired, Noted, parse_trace, read_trace

LAMP = """\
firable: 1
cell: cell
controllers:
  a: {start: free, inputs: key, places: {free: , lamp: {send: {machine: A, command: OPEN}}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  hand: {from: [a.free, b.idle], to: [a.lamp, b.has], if: a.key}
"""
CENTRE = (COORDINATOR,)
ROBOT = ("robot",)


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
        assert any("held after a restart" in sentence for sentence in cell.hosts[ROBOT].peers.waits())
        assert ("held", "'robot' is held after a restart, until it is resumed") in cell.told
        await cell.stop()
        cell.replayed()

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


def test_a_round_that_was_aborted_keeps_nobody_waiting(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        await asyncio.sleep(7.3)
        cell.exchange.cut(cell.links[ROBOT])
        await asyncio.sleep(5)
        cell.hosts[CENTRE].coordinators[COORDINATOR].permit(0)
        assert not any("robot" in sentence for sentence in cell.hosts[CENTRE].peers.waits())

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


def test_every_vote_of_a_whole_run_stands_in_its_trace_before_what_it_decides() -> None:
    stream = io.StringIO()
    execute(split(catalogue_net("one_robot")), catalogue_plant("one_robot"), workpieces=2, trace=stream)
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
