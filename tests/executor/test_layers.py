"""A coordinator for each layer: each decides its own, cells go on while the line is down, and no round is another's."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from pathlib import Path

import pytest
from support.examples import seeds
from support.hosts import Cell
from support.layered_nets import cells_in_a_line, contending, left_below, shared_robot
from support.planted_layers import PLANTED_LAYERS
from support.rehearsals import BAD, ORDERLY, rehearsed

from firable.decompose.splitting.cut import split
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.operating.hosting import SerialLine, machines_of, make_link, own_net
from firable.executor.operating.running import SimulatedCell, execute
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP, coordinators
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    Message,
    ProtocolError,
    ToController,
    ToCoordinator,
    VoteRequest,
)
from firable.executor.simulation.campaign import Failed, Passed, Run, rehearse
from firable.executor.simulation.drawn import layered_net
from firable.executor.simulation.faults import Faults
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.world import Machines, World
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net, catalogue_plant
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import InputError
from firable.semantics.trace import Fired

TWO_CELLS = split(catalogue_net("two_cells"))
LINE = split(cells_in_a_line())
CELL_A, CELL_B = "coordinator cell_a", "coordinator cell_b"


def test_each_coordinator_decides_what_is_its_own() -> None:
    assert coordinators(TWO_CELLS) == (TOP, CELL_A, CELL_B)
    for name in coordinators(TWO_CELLS):
        machine = Coordinator(TWO_CELLS, name)
        at = name.partition(" ")[2] or None
        assert set(machine.participants) == {row.name for row in TWO_CELLS.coordinated if row.at == at}
    robot = LocalController(TWO_CELLS, "robot_a")
    assert {name: sorted(above.parts) for name, above in robot.above.items()} == {
        TOP: ["fetched_a", "load_a", "placed_a", "unload_a"],
        CELL_A: ["put_a", "taken_a"],
    }


@pytest.mark.seeds
@pytest.mark.parametrize("kinds", [ORDERLY, BAD], ids=str)
def test_layers_run_as_the_central_net(kinds: tuple[str, ...]) -> None:
    for decomposition, steps in ((TWO_CELLS, 1500), (LINE, 600)):
        assert min(rehearsed(decomposition, s, kinds, steps).counts["firings"] for s in seeds(3)) > 0


@pytest.mark.seeds
def test_random_nets_in_layers_run_as_the_central_net() -> None:
    nets = (split(layered_net(seed)) for seed in seeds(30))
    assert sum(rehearsed(net, seed, BAD).counts["firings"] for seed, net in enumerate(nets)) > 50


@pytest.mark.seeds
def test_layers_survive_faults_of_every_kind() -> None:
    subject = Subject(TWO_CELLS)
    happened: Counter[str] = Counter()
    for seed in seeds(25):
        result = rehearse(subject, Run(seed))
        assert isinstance(result, Passed), result
        happened += result.counts
    assert happened["firings"] > 50
    assert happened["restarts"] > 50


def test_the_run_of_the_two_cells_shows_who_has_decided_what() -> None:
    report = execute(TWO_CELLS, SimulatedCell(catalogue_plant("two_cells"), workpieces=3))
    assert len(report.delivered) == 3
    by = {row.at or "line": 0 for row in TWO_CELLS.coordinated}
    for row in TWO_CELLS.coordinated:
        by[row.at or "line"] += report.firings[row.name]
    assert report.decided == by == {"line": 24, "cell_a": 6, "cell_b": 6}


# --- Somebody is dead


def dead(name: str) -> type[Coordinator]:
    """Coordinators of which one does nothing any more."""

    class Dead(Coordinator):
        def receive(self, message: ToCoordinator) -> list[Effect]:
            return [] if self.name == name else super().receive(message)

        def resend(self) -> list[Effect]:
            return [] if self.name == name else super().resend()

    return Dead


def fired_while_dead(name: str, steps: int = 3000) -> set[str]:
    world = World(Subject(LINE), 1, Faults.none(), Machines(coordinator=dead(name)))
    world.begin()
    world.run(steps)
    events = [event for event in world.events if isinstance(event, Fired)]
    late = [t for event in events[len(events) // 2 :] for t in event.transitions]
    return {t for t in late if late.count(t) > 3}


def test_cells_go_on_while_the_coordinator_of_the_line_is_dead() -> None:
    assert fired_while_dead(TOP) == {"fill_a", "clear_a", "fill_b", "clear_b"}


def test_all_but_its_own_cell_goes_on_while_the_coordinator_of_a_cell_is_dead() -> None:
    assert fired_while_dead(CELL_A) == {"back_a", "fill_b", "clear_b", "back_b", "hand_over"}


# --- The names of rounds


def test_no_two_rounds_have_one_name_not_even_after_a_restart() -> None:
    for epoch in (0, 1, 2):
        kept = {"epoch": epoch - 1} if epoch else {}
        machines = [Coordinator.restored(TWO_CELLS, kept, name) for name in coordinators(TWO_CELLS)]
        numbers = [machine.next_round + i * machine.stride for machine in machines for i in range(5)]
        assert len(set(numbers)) == len(numbers)
        assert {number >> EPOCH_BITS for number in numbers} == {epoch}
        robot = LocalController(TWO_CELLS, "robot_a")
        assert [robot.coordinator_of(machine.next_round) for machine in machines] == list(coordinators(TWO_CELLS))


def test_what_one_coordinator_has_closed_says_nothing_of_the_rounds_of_another() -> None:
    robot = LocalController(LINE, "robot_a")
    own, line = ("fill_a",), ("hand_over",)
    robot.receive(VoteRequest("robot_a", 1, own, 0, -1, 0, CELL_A))
    robot.receive(VoteRequest("robot_a", 0, line, 0, -1, 0, TOP))
    assert {number: promise.promised for number, promise in robot.promises.items()} == {1: {"fill_a"}, 0: {"hand_over"}}
    robot.receive(Hello("robot_a", 300, -1, 1, TOP))  # the line has restarted, and aborts what it had open
    assert set(robot.promises) == {1}
    assert robot.above[CELL_A].closed_below == 0
    kept = [
        effect.key
        for effect in robot.receive(Decision("robot_a", 1, None, 1, -1, 0, CELL_A))
        if isinstance(effect, Keep)
    ]
    assert kept == ["promise/1", f"closed/{CELL_A}"]


def test_who_decides_nothing_at_a_controller_may_not_speak_to_it() -> None:
    with pytest.raises(ProtocolError, match="decides nothing here"):
        LocalController(LINE, "robot_a").receive(Hello("robot_a", 0, -1, 1, CELL_B))


@pytest.mark.parametrize("name", PLANTED_LAYERS)
def test_planted_fault_of_layers_is_found(name: str) -> None:
    nets = (Subject(LINE), Subject(split(shared_robot())), Subject(left_below(split(contending()))))
    for seed in range(600):
        if isinstance(rehearse(nets[seed % 3], Run(seed), PLANTED_LAYERS[name]), Failed):
            return
    pytest.fail(f"{name} was not found")


# --- Who contends has one decider


def in_step(decomposition: Decomposition, turns: int) -> tuple[list[str], int]:
    """What fires, and how many rounds are opened, where `r` always hears the cell first, and `m` the line."""
    machines = {name: Coordinator(decomposition, name) for name in coordinators(decomposition)}
    controllers = {subnet.name: LocalController(decomposition, subnet.name) for subnet in decomposition.subnets}
    fired, opened, under_way = [], set[int](), deque[Message]()

    def say(effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Firing):
                fired.append(effect.transition)
            elif isinstance(effect, ToController | ToCoordinator):
                under_way.append(effect)

    for controller in controllers.values():
        say(controller.report())
    for _ in range(turns):
        now, under_way = sorted(under_way, key=_in_step), deque()
        for message in now:
            if isinstance(message, ToController):
                opened |= {message.round} if isinstance(message, VoteRequest) else set()
                controller = controllers[message.controller]
                say([*controller.receive(message), *controller.report()])
            else:
                say(machines[message.coordinator].receive(message))
    return fired, len(opened)


def _in_step(message: Message) -> tuple[str, str]:
    way_of_m = message.controller == "m"
    return message.controller, "" if (message.coordinator == TOP) == way_of_m else "later"


def test_two_deciders_of_what_contends_may_give_up_for_ever_and_one_does_not() -> None:
    decomposition = split(contending())
    assert {row.name: row.at for row in decomposition.coordinated} == {"within": None, "over": None}
    fired, opened = in_step(left_below(decomposition), 400)
    assert fired == []
    assert opened > 50
    fired, opened = in_step(decomposition, 400)
    assert len(fired) == 1  # each closes the gate of the other
    assert opened <= 3


# --- Hosts


def test_a_coordinator_runs_beside_the_controller_whose_name_it_bears() -> None:
    net = TWO_CELLS.net
    assert machines_of(net, ["cell_a", "robot_a"], coordinator=False) == ("cell_a", "robot_a", CELL_A)
    assert machines_of(net, ["line"], coordinator=False) == ("line", TOP)


def test_some_coordinators_alone_are_refused_on_a_serial_line() -> None:
    bundle = Bundle(TWO_CELLS, ())
    with pytest.raises(InputError) as refusal:
        make_link(bundle, ("cell_a", CELL_A), SerialLine("/dev/null"))
    assert refusal.value.diagnostics[0].code == "F5021"


HOSTS = (
    (TOP, "line", "conveyors"),
    ("cell_a", CELL_A),
    ("robot_a", "machine_a"),
    ("cell_b", CELL_B, "robot_b", "machine_b"),
)


def test_hosts_of_layers_run_as_the_central_net(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, HOSTS, "two_cells")
        await asyncio.sleep(30)
        await cell.stop()
        joined = cell.replayed()
        assert joined.firings > 20
        assert {name for host in cell.hosts.values() for name in host.coordinators} == {TOP, CELL_A, CELL_B}

    run_in_virtual_time(main())


def test_what_another_coordinator_says_in_its_name_is_dropped(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path, HOSTS, "two_cells")
        robots = cell.hosts["robot_a", "machine_a"]
        await asyncio.sleep(0.5)
        number = 1 + 3 * 1000
        robots.peers.arrived(CELL_A, "machine_a", VoteRequest("machine_a", number, ("taken_a",), 0, -1, 0, CELL_A), 0)
        robots.peers.arrived(TOP, "machine_a", VoteRequest("machine_a", number, ("taken_a",), 0, -1, 0, CELL_A), 0)
        assert [sentence for kind, sentence in cell.told if kind == "dropped"] == [
            "the coordinator sent a VoteRequest that is not its to send"
        ]
        await cell.stop()

    run_in_virtual_time(main())


def test_a_driver_serves_a_machine_whose_coordinator_is_on_another_host() -> None:
    assert [controller.name for controller in own_net(TWO_CELLS, ["robot_a"]).controllers] == ["robot_a"]
