"""The code of the protocol does what the protocol net does that is explored and proved of a cell, and nothing else."""

from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from support import planted
from support.examples import FIRST_SEED, seeds
from support.free_parts import (
    GATE_CLOSED,
    GATE_PROMISED,
    OUTPUT_READ,
    AcknowledgesBeforeItObeys,
    AppliesFreePartsTwice,
    CountsEarlierEpochs,
    CountsOlderReports,
    CountsUsedVotes,
    VotesInSpiteOfPromises,
    VotesOnWhatIsNotKept,
    freed,
    parts_of,
)
from support.gated_nets import GATE_READ_AGAIN
from support.layered_nets import cells_in_a_line, shared_robot
from support.net_tie import NetTie
from support.reference import load_net
from support.timed_nets import HANDOVER, TWO_TIMES

from firable.decompose.protocol.building import ProtocolNet, protocol_net
from firable.decompose.protocol.draft import CHANNELS
from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.messages import ProtocolError
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.exploring import Explorer, NotATraceError, Space, explore, wander
from firable.executor.simulation.repertoire import Budget
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.net import Net, Transition
from firable.nets.text import parse_net

SMALL = ("local_conflict", "local_gate", "local_output_conflict", "read_before_order", "remote_gate", "ring")
MADE = {
    "gate_read_again": GATE_READ_AGAIN,
    "shared_robot": shared_robot(),
    "line": cells_in_a_line(),
    "handover": parse_net(HANDOVER),
    "two_times": TWO_TIMES,
}
LOSS, COPY, CRASH, GIVE_UP = Budget(losses=1), Budget(copies=1), Budget(crashes=1), Budget(giving_up=1)
KINDS = {"ask", "promise", "hear", "decide", "give-up", "order", "apply", "release", "note", "close", "fire"}


def net_of(name: str) -> Net:
    family, _, seed = name.partition(" ")
    if seed:
        return DRAWN[family](int(seed))
    return MADE[name] if name in MADE else load_net(name) if name in SMALL else catalogue_net(name)


@cache
def built(name: str) -> tuple[Decomposition, ProtocolNet]:
    decomposition = split(net_of(name))
    return decomposition, protocol_net(decomposition)


def tied(name: str, budget: Budget, most: int) -> tuple[NetTie, Space]:
    decomposition, protocol = built(name)
    tie = NetTie(protocol)
    return tie, explore(Explorer(decomposition), budget, max_configurations=most, watch=tie)


@pytest.mark.parametrize("name", SMALL)
def test_without_faults_every_act_is_firings_of_the_protocol_net_and_all_there_is_is_explored(name: str) -> None:
    tie, space = tied(name, Budget(), 20_000)
    assert space.complete
    assert tie.untold == 0
    assert tie.kinds["decide"] > 0


@pytest.mark.parametrize("budget", [LOSS, COPY, GIVE_UP, CRASH], ids=["loss", "copy", "giving up", "crash"])
@pytest.mark.parametrize("name", [*SMALL, "shared_robot", "handover"])
def test_with_a_fault_every_act_is_firings_of_the_protocol_net_as_far_as_it_is_explored(
    name: str, budget: Budget
) -> None:
    tie, space = tied(name, budget, 500)
    assert tie.untold == 0 or budget.crashes
    assert tie.untold < space.steps / 10


CELLS = ("one_robot", "one_robot_mc_late", "one_robot_timed", "two_robots_shared", "two_cells", "line", "two_times")


# --- With parts that are free of promise


WITH_FREE = ("local_conflict", "local_gate", "local_output_conflict", "read_before_order", "ring", "no_trouble")
KINDS_OF_FREE = KINDS | {"stand", "repeat"}


@cache
def built_free(name: str) -> tuple[Decomposition, ProtocolNet]:
    decomposition = freed(split(load_net(name) if name == "no_trouble" else net_of(name)))
    return decomposition, protocol_net(decomposition)


@pytest.mark.parametrize("budget", [Budget(), LOSS, COPY, GIVE_UP, CRASH], ids=["none", "loss", "copy", "up", "crash"])
@pytest.mark.parametrize("name", [*WITH_FREE, "gate_read_again", "shared_robot"])
def test_every_act_with_free_parts_is_firings_of_the_protocol_net_that_has_them(name: str, budget: Budget) -> None:
    decomposition, protocol = built_free(name)
    assert decomposition.free
    tie = NetTie(protocol)
    space = explore(Explorer(decomposition), budget, max_configurations=500, watch=tie)
    assert tie.kinds["decide"] > 0
    assert tie.kinds["hear"] > 0
    assert tie.untold == 0 or budget.crashes
    assert tie.untold < space.steps / 10


@pytest.mark.seeds
def test_on_ways_through_the_cells_with_free_parts_every_act_is_firings_of_the_protocol_net() -> None:
    kinds: Counter[str] = Counter()
    for name in CELLS:
        decomposition, protocol = built_free(name)
        tie = NetTie(protocol)
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), FIRST_SEED, 40, tie)
        kinds += tie.kinds
    assert set(kinds) >= KINDS


@pytest.mark.seeds
@pytest.mark.parametrize("family", DRAWN)
def test_on_ways_through_drawn_nets_with_free_parts_every_act_is_firings_of_the_protocol_net(family: str) -> None:
    for seed in seeds(5):
        decomposition, protocol = built_free(f"{family} {seed}")
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), seed, 40, NetTie(protocol))


OF_FREE: list[tuple[type[Any], str, Budget]] = [
    (CountsEarlierEpochs, "no_trouble", CRASH),
    (CountsUsedVotes, "ring", Budget()),
    (CountsOlderReports, "no_trouble", COPY),
    (VotesOnWhatIsNotKept, "local_gate", CRASH),
    (AppliesFreePartsTwice, "ring", COPY),
    (AcknowledgesBeforeItObeys, "ring", Budget()),
]


@pytest.mark.parametrize(("fault", "name", "budget"), OF_FREE, ids=[fault.__name__ for fault, _, _ in OF_FREE])
def test_a_drift_of_the_code_of_free_parts_is_no_firing_of_the_protocol_net(
    fault: type[Any], name: str, budget: Budget
) -> None:
    decomposition, protocol = built_free(name)
    explorer = (
        Explorer(decomposition, controller=fault)
        if issubclass(fault, LocalController)
        else Explorer(decomposition, coordinator=fault)
    )
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=6000, watch=NetTie(protocol))


@pytest.mark.parametrize("net", [GATE_CLOSED, OUTPUT_READ, GATE_PROMISED], ids=["closed", "read", "promised"])
def test_a_part_that_is_free_and_may_not_be_breaks_the_invariant_of_the_net(net: Net) -> None:
    decomposition = parts_of(split(net), "t1-11")
    explorer = Explorer(decomposition, controller=VotesInSpiteOfPromises if net is GATE_PROMISED else LocalController)
    with pytest.raises(AssertionError) as failed:
        explore(explorer, watch=NetTie(protocol_net(decomposition)))
    assert (
        isinstance(failed.value, NotATraceError)
        or "what holds of every" in str(failed.value)
        or "firable" in str(failed.value)
    )


@pytest.mark.seeds
def test_on_ways_through_the_cells_every_act_is_firings_of_the_protocol_net() -> None:
    kinds: Counter[str] = Counter()
    for name in CELLS:
        decomposition, protocol = built(name)
        tie = NetTie(protocol)
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), FIRST_SEED, 40, tie)
        kinds += tie.kinds
    assert set(kinds) >= KINDS


@pytest.mark.seeds
@pytest.mark.parametrize("family", DRAWN)
def test_on_ways_through_drawn_nets_every_act_is_firings_of_the_protocol_net(family: str) -> None:
    for seed in seeds(5):
        decomposition, protocol = built(f"{family} {seed}")
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), seed, 40, NetTie(protocol))


# --- A drift of the code is found


CODE: list[tuple[type[Any], str, Budget]] = [
    (planted.NoLock, "gate_read_again", Budget()),
    (planted.ReadsUnlocked, "gate_read_again", Budget()),
    (planted.AppliesTwice, "remote_gate", COPY),
    (planted.VotesFromMemory, "gate_read_again", Budget()),
    (planted.KeepsNoPromise, "remote_gate", CRASH),
    (planted.KeepsNoMarking, "remote_gate", CRASH),
    (planted.KeepsNoLocalFiring, "local_gate", CRASH),
    (planted.DecidesEarly, "remote_gate", Budget()),
    (planted.CachedVotes, "gate_read_again", COPY),
    (planted.CachedGates, "remote_gate", Budget()),
    (planted.CommitsAborted, "remote_gate", GIVE_UP),
    (planted.ClosesEarly, "remote_gate", Budget()),
    (planted.KeepsNoDecision, "remote_gate", CRASH),
    (planted.DropsDecisions, "remote_gate", CRASH),
]


@pytest.mark.parametrize(("fault", "name", "budget"), CODE, ids=[fault.__name__ for fault, _, _ in CODE])
def test_a_drift_of_the_code_is_no_firing_of_the_protocol_net(fault: type[Any], name: str, budget: Budget) -> None:
    decomposition, protocol = built(name)
    explorer = (
        Explorer(decomposition, controller=fault)
        if issubclass(fault, LocalController)
        else Explorer(decomposition, coordinator=fault)
    )
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=8000, watch=NetTie(protocol))


# --- A drift of the net is found


def without_one(transition: Transition, kind: str) -> Transition:
    """The transition with the last of its arcs of a kind left out that is none of a message."""

    def left(arcs: tuple[str, ...]) -> tuple[str, ...]:
        last = [place for place in arcs if place.partition("/")[0] not in CHANNELS][-1:]
        return tuple(place for place in arcs if place not in last)

    if kind == "inputs":
        return replace(transition, inputs=left(transition.inputs))
    return replace(transition, outputs=left(transition.outputs))


def drifts() -> list[tuple[str, str, str]]:
    """Steps of each kind that are left out, or put or take one thing less, or need something more."""
    found = [(kind, "left out", "") for kind in sorted(KINDS)]
    found += [
        (kind, "puts less", "outputs") for kind in ("ask", "promise", "hear", "decide", "give-up", "apply", "note")
    ]
    found += [(kind, "takes less", "inputs") for kind in ("apply", "close", "fire")]
    return [*found, *((kind, "needs more", "") for kind in sorted(KINDS - {"order"}))]


def drifted(protocol: ProtocolNet, kind: str, how: str, arcs: str) -> ProtocolNet:
    """The protocol net with each step of a kind edited."""

    def edited(transition: Transition) -> list[Transition]:
        if protocol.steps[transition.name].kind != kind:
            return [transition]
        if how == "left out":
            return []
        if how == "needs more":
            return [replace(transition, permissive=(*transition.permissive, "astray"))]
        return [without_one(transition, arcs)]

    transitions = tuple(each for transition in protocol.net.transitions for each in edited(transition))
    return replace(protocol, net=replace(protocol.net, transitions=transitions))


@pytest.mark.parametrize(("kind", "how", "arcs"), drifts(), ids=[" ".join(d[:2]) for d in drifts()])
def test_a_drift_of_the_protocol_net_is_found(kind: str, how: str, arcs: str) -> None:
    def explore_some() -> None:
        for name, budget in (("ring", Budget()), ("local_gate", GIVE_UP), ("local_conflict", COPY)):
            decomposition, protocol = built(name)
            tie = NetTie(drifted(protocol, kind, how, arcs))
            explore(Explorer(decomposition), budget, max_configurations=1500, watch=tie)

    with pytest.raises(AssertionError):
        explore_some()
