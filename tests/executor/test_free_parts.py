"""Parts free of promise in the machines: their acts are actions of the proof, and what they rest on is needed."""

from collections import Counter
from functools import cache

import pytest
from support import free_parts as planted
from support.examples import FIRST_SEED
from support.free_parts import GATE_CLOSED, GATE_PROMISED, OUTPUT_READ, freed, parts_of
from support.gated_nets import GATE_READ_AGAIN
from support.local_tie import LocalTie
from support.reference import load_net

from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.messages import (
    Decision,
    Firing,
    Message,
    ProtocolError,
    Report,
    ToCoordinator,
    VoteRequest,
)
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.exploring import Explorer, NotATraceError, explore, wander
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net

LOSS, COPY, CRASH = Budget(losses=1), Budget(copies=1), Budget(crashes=1)
SMALL = ["local_gate", "local_conflict", "read_before_order", "ring", "gate_read_again", "no_trouble"]


@cache
def free_in(name: str) -> Decomposition:
    return freed(split(GATE_READ_AGAIN if name == "gate_read_again" else load_net(name)))


@pytest.mark.parametrize("budget", [Budget(), LOSS, COPY, CRASH], ids=["no fault", "loss", "copy", "crash"])
@pytest.mark.parametrize("name", SMALL)
def test_every_act_with_free_parts_is_some_actions_of_the_proof(name: str, budget: Budget) -> None:
    tie = LocalTie(free_in(name))
    space = explore(Explorer(free_in(name)), budget, max_configurations=1500, watch=tie)
    assert tie.actions["stand"] > 0
    assert tie.actions["apply-free"] > 0
    assert space.complete or budget != Budget()


def larger() -> dict[str, Decomposition]:
    cells = {name: freed(split(catalogue_net(name))) for name in ("one_robot", "two_robots_shared", "one_robot_timed")}
    drawn = {f"{family}-{seed}": freed(split(DRAWN[family](seed))) for family in DRAWN for seed in range(2)}
    return {**cells, **drawn}


@pytest.mark.seeds
def test_on_ways_through_larger_nets_with_free_parts_every_act_is_some_actions_of_the_proof() -> None:
    met: Counter[str] = Counter()
    for name, decomposition in larger().items():
        tie = LocalTie(decomposition)
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), FIRST_SEED, 150, tie)
        assert tie.actions["stand"] > 0 or not decomposition.free, name
        met += tie.actions
    assert met["apply-free"] > 0


@pytest.mark.parametrize("seed", [25, 26])
def test_an_order_that_is_lost_in_a_crash_clears_no_timer(seed: int) -> None:
    """The restart does, as the signal may change by itself; on these ways one order is lost so."""
    decomposition = freed(split(DRAWN["drawn-timed"](0)))
    tie, lost = LocalTie(decomposition), 0

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        nonlocal lost
        tie(explorer, at, step, after)
        lost += step.kind == "arrive, crash" and isinstance(step.about, Decision) and step.about.committed is not None

    wander(Explorer(decomposition), Budget(2, 2, 2, 2), seed, 150, watch)
    assert lost > 0


FAULTS: list[tuple[type, str, Budget]] = [
    (planted.CountsEarlierEpochs, "no_trouble", CRASH),
    (planted.CountsUsedVotes, "ring", Budget()),
    (planted.CountsOlderReports, "no_trouble", COPY),
    (planted.VotesOnWhatIsNotKept, "local_gate", CRASH),
    (planted.AppliesFreePartsTwice, "ring", COPY),
    (planted.AcknowledgesBeforeItObeys, "ring", Budget()),
]


@pytest.mark.parametrize(("fault", "name", "budget"), FAULTS, ids=[fault.__name__ for fault, _, _ in FAULTS])
def test_planted_fault_in_what_standing_votes_rest_on_is_found(fault: type, name: str, budget: Budget) -> None:
    decomposition = free_in(name)
    is_controller = issubclass(fault, LocalController)
    explorer = (
        Explorer(decomposition, controller=fault) if is_controller else Explorer(decomposition, coordinator=fault)
    )
    with pytest.raises((AssertionError, NotATraceError, ProtocolError)):
        explore(explorer, budget, max_configurations=6000, watch=LocalTie(decomposition))


@pytest.mark.parametrize("net", [GATE_CLOSED, OUTPUT_READ], ids=["closed", "read"])
def test_part_that_is_free_and_may_not_be_goes_wrong(net: Net) -> None:
    with pytest.raises(NotATraceError):
        explore(Explorer(parts_of(split(net), "t1-11")))
    assert explore(Explorer(freed(split(net)))).complete


def test_vote_in_spite_of_a_promise_is_found() -> None:
    decomposition = parts_of(split(GATE_PROMISED), "t1-11")
    explorer = Explorer(decomposition, controller=planted.VotesInSpiteOfPromises)
    with pytest.raises((AssertionError, NotATraceError)):
        explore(explorer, watch=LocalTie(decomposition))


# --- What is left out


def between(decomposition: Decomposition, transition: str) -> list[Message]:
    """Let everything happen that happens without faults until a transition fires; the messages that were sent."""
    coordinator = Coordinator(decomposition)
    controllers = {s.name: LocalController(decomposition, s.name) for s in decomposition.subnets}
    waiting: list[Message] = []
    sent: list[Message] = []
    for controller in controllers.values():
        waiting += [e for e in controller.report() if isinstance(e, Message)]
    while waiting:
        message = waiting.pop(0)
        sent.append(message)
        if isinstance(message, ToCoordinator):
            effects = coordinator.receive(message)
        else:
            effects = controllers[message.controller].receive(message)
        waiting += [e for e in effects if isinstance(e, Message)]
        if Firing(transition) in effects:
            return sent
    raise AssertionError(f"'{transition}' does not fire")


def test_transition_of_free_parts_fires_without_being_asked_for() -> None:
    with_promises = split(load_net("no_trouble"))
    assert Counter(type(m).__name__ for m in between(with_promises, "G")) == {"Report": 2, "VoteRequest": 2, "Vote": 2}
    assert Counter(type(m).__name__ for m in between(freed(with_promises), "G")) == {"Report": 2}


def test_only_who_has_to_promise_is_asked_and_told_of_an_abort() -> None:
    decomposition = free_in("local_gate")
    assert decomposition.free == (("G", "c2"),)
    coordinator = Coordinator(decomposition)
    reports = [e for name in ("c1", "c2") for e in LocalController(decomposition, name).report()]
    asked = [e for r in reports if isinstance(r, Report) for e in coordinator.receive(r)]
    assert [e.controller for e in asked if isinstance(e, VoteRequest)] == ["c1"]
    aborted = [e for e in coordinator.permit(0) if isinstance(e, Decision)]
    assert [(e.controller, e.committed) for e in aborted] == [("c1", None)]


def test_completion_that_a_free_part_awaits_falls_by_its_command_alone() -> None:
    decomposition = freed(split(catalogue_net("two_robots_shared")))
    awaited = {
        (part.controller, gate.signal)
        for row in decomposition.coordinated
        for part in row.parts
        for gate in decomposition.subnet(part.controller).transition(part.name).external
        if (row.name, part.controller) in decomposition.free
    }
    assert awaited
    for name, signal in awaited:
        controller = LocalController(decomposition, name)
        bit = controller.player.signal_bit(signal)
        controller.read(signal, value=True)
        assert controller.word & bit
        assert controller.read(signal, value=False) == []
        assert controller.word & bit
