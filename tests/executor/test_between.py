"""What a host says that is not what it says it is: it is not heard, and the others go on."""

import asyncio
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from support.examples import seeds
from support.hosts import Cell

from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.executor.cell.virtual_time import run_in_virtual_time
from firable.executor.operating.between import Between
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Hello,
    Message,
    Readiness,
    Report,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.campaign import Run, campaign
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.judge import Subject
from firable.executor.simulation.world import World
from firable.nets.catalogue import catalogue_net

ONE_ROBOT = split(catalogue_net("one_robot"))
TWO_CELLS = split(catalogue_net("two_cells"))
CELL_A = "coordinator cell_a"
NONE = Readiness(1, frozenset())
OTHER = frozenset({"nobody-has-this"})
SUBJECTS: dict[str, Callable[[], list[Subject]]] = {
    "cell": lambda: [Subject(ONE_ROBOT)],
    "cell with free parts": lambda: [Subject(freed(ONE_ROBOT))],
    "layers": lambda: [Subject(TWO_CELLS)],
    **{
        family: partial(lambda draw: [Subject(split(draw(n))) for n in range(8)], draw)
        for family, draw in DRAWN.items()
    },
}


@pytest.mark.parametrize(
    "message",
    [
        Report("robot", Readiness(1, OTHER)),
        Report("robot", NONE, "mc"),
        Vote("robot", 5, OTHER, NONE),
        Vote("robot", 5, frozenset(), Readiness(1, OTHER)),
        Acknowledgement("robot", 5, Readiness(1, OTHER)),
        VoteRequest("robot", 5, tuple(OTHER), 0, 0),
        Decision("robot", 5, "nobody-has-this", 0, 0),
        Hello("robot", 0, 0, 1, "mc"),
        Hello("nobody", 0, 0, 1),
    ],
)
def test_what_is_not_between_two_is_found(message: Message) -> None:
    assert not Between(ONE_ROBOT).has(message)


def test_a_coordinator_speaks_of_its_own_rounds_alone() -> None:
    between = Between(TWO_CELLS)
    own = 3 * 1000 + between.first_round[CELL_A]
    for number, is_its in ((own, True), (own - 1, False), (own + 1, False)):
        assert between.has(Decision("machine_a", number, None, 0, 0, 0, CELL_A)) is is_its
        assert between.has(VoteRequest("machine_a", number, (), 0, 0, 0, CELL_A)) is is_its


def test_who_lost_the_arbitration_is_told_who_won_though_it_takes_no_part_in_that() -> None:
    coordinator, between = Coordinator(ONE_ROBOT), Between(ONE_ROBOT)
    group = frozenset({"G5", "G8"})
    asked = {c: group & {t for t in group if c in coordinator.participants[t]} for c in coordinator.ready}
    told = [e for c in ("system", "mc", "conveyor") for e in coordinator.receive(Report(c, Readiness(1, asked[c])))]
    told += coordinator.receive(Report("robot", Readiness(1, asked["robot"])))
    for controller, transitions in asked.items():
        told += coordinator.receive(Vote(controller, 0, transitions, NONE))
    orders = [message for message in told if isinstance(message, Decision)]
    winner = orders[0].committed
    assert winner in group
    assert any(winner not in asked[message.controller] for message in orders)
    assert all(between.has(message) for message in told if isinstance(message, VoteRequest | Decision))


@pytest.mark.seeds
@pytest.mark.parametrize("subject", SUBJECTS)
def test_whatever_the_machines_say_to_each_other_through_faults_is_between_them(
    subject: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Elections that are lost, restarts, late answers: a message that was dropped would be dropped for ever."""
    said: Counter[str] = Counter()
    betweens: dict[int, Between] = {}

    def send(world: World, message: Message) -> None:
        of = world.subject.decomposition
        between = betweens.setdefault(id(of), Between(of))
        assert between.has(message), message
        said[type(message).__name__] += 1
        put_on_its_way(world, message)

    put_on_its_way = World.send
    monkeypatch.setattr(World, "send", send)
    subjects = SUBJECTS[subject]()
    done = campaign(lambda seed: subjects[seed % len(subjects)], map(Run, seeds(40)))
    assert not done.failed, done.failed[:1]
    assert set(said) == {"Hello", "Report", "VoteRequest", "Vote", "Decision", "Acknowledgement"}


def test_a_coordinator_orders_what_it_decides_alone() -> None:
    own = Between(TWO_CELLS).first_round[CELL_A]
    assert Between(TWO_CELLS).has(Decision("machine_a", own, "taken_a", 0, 0, 0, CELL_A))
    assert not Between(TWO_CELLS).has(Decision("machine_a", own, "taken_b", 0, 0, 0, CELL_A))


def test_a_host_that_says_what_nobody_knows_ends_no_other_one(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        centre = next(host for names, host in cell.hosts.items() if TOP in host.acts.coordinators)
        await asyncio.sleep(0.5)
        peer = next(name for name in sorted(centre.peers.connected_to) if name != TOP)
        centre.peers.arrived(peer, TOP, Report(peer, Readiness(1 << 62, OTHER)), 0)
        centre.peers.arrived(peer, "nowhere", Vote(peer, 5, frozenset(), NONE, "nowhere"), 0)
        await asyncio.sleep(0.5)
        assert [kind for kind, _ in cell.told if kind == "dropped"] == ["dropped", "dropped"]
        await cell.stop()

    run_in_virtual_time(main())


def test_a_host_that_goes_on_saying_it_fills_no_trace(tmp_path: Path) -> None:
    async def main() -> None:
        cell = Cell(tmp_path)
        centre = next(host for names, host in cell.hosts.items() if TOP in host.acts.coordinators)
        await asyncio.sleep(0.5)
        for last in (1000, 2000):
            for number in range(last):
                centre.peers.arrived("robot", TOP, Report("robot", Readiness((1 << 62) + number, OTHER)), 0)
            await cell.kill(("robot",))  # it is told anew of who has come anew
            cell.start(("robot",))
            await asyncio.sleep(5.0)
        told = [sentence for kind, sentence in cell.told if kind == "dropped"]
        assert told == ["'robot' sent a Report that is not its to send"] * 2
        await cell.stop()

    run_in_virtual_time(main())


def test_a_vote_of_who_was_not_asked_counts_for_nobody() -> None:
    coordinator = Coordinator(ONE_ROBOT)
    name, participants = next((t, c) for t, c in coordinator.participants.items() if len(c) == 2)
    asked = [
        effect
        for controller in participants
        for effect in coordinator.receive(Report(controller, Readiness(1, frozenset({name}))))
        if isinstance(effect, VoteRequest)
    ]
    number = asked[0].round
    stranger = next(s.name for s in ONE_ROBOT.subnets if s.name not in participants)
    coordinator.receive(Vote(stranger, number, frozenset(), NONE))
    coordinator.receive(Vote(participants[0], number, frozenset({name}), NONE))
    assert not coordinator.rounds[number].decided
    coordinator.receive(Vote(participants[1], number, frozenset({name}), NONE))
    assert coordinator.rounds[number].committed == name
