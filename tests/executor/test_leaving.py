"""A host that ends takes its votes back and waits for the word that no order is open: in any order, and with faults."""

import asyncio
import random
from collections import Counter
from itertools import permutations
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from support import free_parts as planted
from support.examples import FIRST_SEED, seeds
from support.free_parts import freed
from support.gated_nets import GATE_READ_AGAIN
from support.hosts import ONE_EACH, TOGETHER, Cell, ended_within
from support.layered_nets import shared_robot
from support.local_tie import LocalTie
from support.net_tie import NetTie
from support.reference import load_net

from firable.decompose.protocol.building import protocol_net
from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.links.link import COORDINATOR
from firable.executor.operating.situation import State
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import Decision, Hello, Readiness, Report, VoteRequest
from firable.executor.simulation.campaign import Failed, Run, campaign, rehearse
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.exploring import Explorer, explore, wander
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.world import Machines
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.semantics.trace import read_trace

SMALL = ("ring", "local_gate", "local_conflict", "read_before_order", "gate_read_again", "shared_robot")
LEAVE = Budget(leaving=1)
FAULTS = {
    "no fault": LEAVE,
    "loss": Budget(leaving=1, losses=1),
    "copy": Budget(leaving=1, copies=1),
    "crash": Budget(leaving=1, crashes=1),
    "giving up": Budget(leaving=1, giving_up=1),
    "two leave": Budget(leaving=2),
}


def cut(name: str, *, free: bool) -> Decomposition:
    made = {"gate_read_again": GATE_READ_AGAIN, "shared_robot": shared_robot()}
    whole = split(made.get(name) or load_net(name))
    return freed(whole) if free else whole


def has_left(controller: object) -> bool:
    """Whether its host would end in order now."""
    return (
        isinstance(controller, LocalController)
        and controller.leaving
        and not controller.awaited
        and not any(promise.promised for promise in controller.promises.values())
    )


class NothingIsOpen:
    """A watcher: no round waits for a controller that has left, and no order is on its way to it."""

    def __init__(self) -> None:
        self.left = 0

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        del before, step
        machines = [explorer.machine(number) for number in after.machines]
        coordinators = [each for each in machines if isinstance(each, Coordinator)]
        for gone in (each for each in machines if isinstance(each, LocalController) and has_left(each)):
            self.left += 1
            for coordinator in coordinators:
                for opened in coordinator.rounds.values():
                    waits = gone.name in coordinator.ordered(opened) and gone.name not in opened.acknowledged
                    assert not (opened.committed and waits), f"{gone.name} has left, and round {opened.number} is open"
            for message in after.under_way:
                if isinstance(message, Decision) and message.controller == gone.name:
                    assert not gone.applies(message), f"{gone.name} has left, and {message} is on its way"


@pytest.mark.parametrize("faults", FAULTS)
@pytest.mark.parametrize("free", [True, False], ids=["free", "promised"])
@pytest.mark.parametrize("name", SMALL)
def test_no_order_is_open_for_a_controller_that_has_left(name: str, free: bool, faults: str) -> None:
    watch = NothingIsOpen()
    explore(Explorer(cut(name, free=free)), FAULTS[faults], max_configurations=400, watch=watch)
    assert watch.left > 0


@pytest.mark.parametrize("free", [True, False], ids=["free", "promised"])
@pytest.mark.parametrize("name", ["ring", "local_conflict", "gate_read_again"])
def test_every_act_of_who_leaves_is_some_actions_of_the_proof(name: str, free: bool) -> None:
    decomposition = cut(name, free=free)
    for budget in (LEAVE, Budget(leaving=1, copies=1), Budget(leaving=1, crashes=1)):
        explore(Explorer(decomposition), budget, max_configurations=600, watch=LocalTie(decomposition))


@pytest.mark.parametrize("name", ["ring", "local_conflict", "gate_read_again"])
def test_every_act_of_who_leaves_is_firings_of_the_protocol_net(name: str) -> None:
    decomposition = cut(name, free=False)
    tie = NetTie(protocol_net(decomposition))
    explore(Explorer(decomposition), LEAVE, max_configurations=1000, watch=tie)
    assert tie.untold == 0


@pytest.mark.seeds
@pytest.mark.parametrize("name", ["one_robot", "two_robots_shared", "two_cells"])
def test_on_ways_through_a_cell_no_order_is_open_for_who_has_left(name: str) -> None:
    decomposition = freed(split(catalogue_net(name)))
    watch, tie = NothingIsOpen(), LocalTie(decomposition)

    def both(*told: Any) -> None:
        watch(*told)
        tie(*told)

    taken: Counter[str] = Counter()
    for seed in seeds(3):
        taken += wander(Explorer(decomposition), Budget(1, 1, 1, 1, leaving=3), seed + FIRST_SEED, 60, both)
    assert taken["leave"] > 0
    assert watch.left > 0


@pytest.mark.seeds
@pytest.mark.parametrize("name", ["one_robot", "two_robots_shared", "two_cells"])
def test_hosts_of_a_cell_that_end_and_come_back_leave_nothing_open_through_faults(name: str) -> None:
    subject = Subject(freed(split(catalogue_net(name))))
    kinds = ("leave", "loss", "delay", "reordering", "duplication", "crash", "pause")
    done = campaign(lambda _: subject, (Run(seed, kinds) for seed in seeds(60)))
    assert not done.failed, done.failed[0].message
    assert done.counts["ends"] > 60


FORGOTTEN = [
    (
        "drawn-layered",
        Run(1002931, ("loss", "duplication", "delay", "partition", "crash", "drift", "standstill", "leave"), 181),
    ),
    ("drawn-timed", Run(1004095, ("crash", "torn", "disk", "drift", "standstill", "stale", "leave"), 488)),
]


@pytest.mark.parametrize(("family", "run"), FORGOTTEN, ids=["layered", "timed"])
def test_a_coordinator_that_restarts_after_its_word_may_forget_what_was_acknowledged(family: str, run: Run) -> None:
    assert not isinstance(rehearse(Subject(freed(split(DRAWN[family](run.seed // 10)))), run), Failed)


def test_what_a_process_still_had_to_say_when_its_disk_failed_is_not_said() -> None:
    """It was said by the dead, and what its driver kept then was there after the restart."""
    kinds = ("loss", "reordering", "crash", "torn", "disk", "drift", "slow", "queued", "forgetful", "pause", "step")
    run = Run(1010336, kinds, 2700)
    assert not isinstance(rehearse(Subject(freed(split(DRAWN["drawn-timed"](run.seed // 10)))), run), Failed)


WRONG: list[tuple[Machines, tuple[str, ...]]] = [
    (Machines(coordinator=planted.DismissesAtOnce), ("leave", "delay", "reordering")),
    (Machines(controller=planted.EndsWithoutAsking), ("leave", "delay")),
    (Machines(controller=planted.TakesAnyWord), ("leave", "delay", "reordering")),
    (Machines(controller=planted.LeavesItsVotes), ("leave",)),
    (Machines(coordinator=planted.NeverDismisses), ("leave",)),
]


@pytest.mark.parametrize(("machines", "kinds"), WRONG, ids=[str(i) for i in range(len(WRONG))])
def test_planted_fault_of_leaving_is_found(machines: Machines, kinds: tuple[str, ...]) -> None:
    subjects = [Subject(freed(split(catalogue_net(name)))) for name in ("one_robot", "two_robots_shared")]
    found = (rehearse(subjects[seed % 2], Run(seed, kinds), machines) for seed in range(400))
    assert any(isinstance(each, Failed) for each in found)


@pytest.mark.parametrize("wrong", [planted.DismissesAtOnce, planted.EndsWithoutAsking, planted.TakesAnyWord])
def test_planted_fault_of_leaving_is_found_by_exploring(wrong: type[Any]) -> None:
    kind = {"controller": wrong} if issubclass(wrong, LocalController) else {"coordinator": wrong}
    with pytest.raises(AssertionError, match="has left"):
        explore(Explorer(cut("ring", free=True), **kind), LEAVE, max_configurations=20_000, watch=NothingIsOpen())


# --- One controller


def test_who_leaves_votes_no_and_names_nothing_until_it_stays() -> None:
    decomposition = split(catalogue_net("one_robot"))
    controller = LocalController(decomposition, "robot")
    (first,) = controller.report()
    assert isinstance(first, Report)
    assert first.readiness.transitions
    assert not first.last
    (last,) = controller.leave()
    assert last == Report("robot", Readiness(first.readiness.sequence + 1, frozenset()), last=True)
    asked = VoteRequest("robot", 0, tuple(first.readiness.transitions), 0, -1)
    vote, again = controller.receive(asked)
    assert not getattr(vote, "promised", None)
    assert again == last
    assert list(controller.awaited) == [COORDINATOR]
    controller.receive(Hello("robot", 0, first.readiness.sequence, 0))
    assert list(controller.awaited) == [COORDINATOR], "that was said of an earlier report"
    controller.receive(Decision("robot", 0, None, 0, last.readiness.sequence))
    assert list(controller.awaited) == [COORDINATOR], "an order says that there are orders"
    controller.receive(Hello("robot", 0, last.readiness.sequence, 0))
    assert not list(controller.awaited)
    controller.stay()
    (anew,) = controller.report()
    assert isinstance(anew, Report)
    assert anew.readiness.transitions == first.readiness.transitions


# --- Hosts


ORDERS = [*permutations(ONE_EACH)]
PAUSES_SECONDS = (0.0, 0.01, 0.4)


@pytest.mark.parametrize("after", [2.1, 5.1, 8.15, 9.0])
@pytest.mark.parametrize("free", [True, False], ids=["free", "promised"])
def test_hosts_that_are_stopped_in_any_order_end_clean(after: float, free: bool, tmp_path: Path) -> None:
    draw = random.Random(after)

    async def main(order: tuple[tuple[str, ...], ...], between: float, folder: Path) -> None:
        cell = Cell(folder, free=free)
        await asyncio.sleep(after)
        for machines in order:
            cell.hosts[machines].stop()
            await asyncio.sleep(between)
        ended = await cell.stop()
        told = {machines: situation.message for machines, situation in ended.items()}
        assert not any(told.values()), (order, told)
        assert all(situation.state is State.STOPPED for situation in ended.values())
        assert cell.replayed().firings == cell.firings()

    for i, order in enumerate([ONE_EACH, ONE_EACH[::-1], *draw.sample(ORDERS, 4)]):
        folder = tmp_path / str(i)
        folder.mkdir()
        run_in_virtual_time(main(order, PAUSES_SECONDS[i % 3], folder))


def test_a_host_that_is_stopped_alone_does_not_wait_for_the_others_to_end(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, free=True)
        await asyncio.sleep(5.1)
        cell.hosts["robot",].stop()
        await ended_within(cell.tasks["robot",], 1)
        await cell.stop()

    run_in_virtual_time(main())


def test_an_order_that_comes_when_the_votes_are_taken_back_is_carried_out_before_the_cycle_ends(tmp_path: Path) -> None:
    """The conveyor is as at the beginning when the coordinator has just ordered that a workpiece comes in."""

    async def main(after: float, folder: Path) -> bool:
        cell = Cell(folder, TOGETHER, free=True)
        await asyncio.sleep(after)
        host = cell.hosts["conveyor",]
        host.stop(at_end_of_cycle=True)
        situation = await ended_within(cell.tasks["conveyor",], 60)
        assert situation.state is State.STOPPED
        controller = host.controllers["conveyor"]
        assert controller.marking == controller.subnet.initial_marking
        await cell.stop()
        assert cell.replayed().complete
        notes = read_trace(cell.path(("conveyor",))).events
        return any("kept back" in str(each) for each in notes)

    for i in range(12):
        folder = tmp_path / str(i)
        folder.mkdir()
        assert not run_in_virtual_time(main(2.0 + 0.53 * i, folder)), "a command came to a stop"


def test_a_host_whose_coordinator_is_frozen_ends_all_the_same_and_says_what_may_be_open(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, free=True)
        await asyncio.sleep(5.1)
        coordinator = cell.hosts[COORDINATOR,]
        coordinator.acts.hear = Mock()  # type: ignore[method-assign]
        cell.hosts["robot",].stop()
        situation = await ended_within(cell.tasks["robot",], 3)
        assert "'robot' has taken its votes back, and waits for the coordinator" in situation.message
        for task in cell.tasks.values():
            task.cancel()
        await asyncio.gather(*cell.tasks.values())
        assert read_trace(cell.path(("robot",))).end is None

    run_in_virtual_time(main())
