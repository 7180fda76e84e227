"""Machines explored alone: what controllers do among all is there, and each act is actions of the proof."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import replace

import pytest
from support import planted
from support.alone_acts import CELLS, Acts, alone, contained, decomposition_of, group_of
from support.examples import FACTOR
from support.free_parts import CountsEarlierEpochs, CountsUsedVotes
from support.local_net_tie import LocalNetTie
from support.local_tie import LocalTie
from support.standing_votes import AloneTie

from firable.decompose.protocol.building import protocol_net
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.messages import (
    Decision,
    Effect,
    ProtocolError,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.alone import Alone
from firable.executor.simulation.deciding import Deciding, FrameError
from firable.executor.simulation.exploring import Explorer, explore
from firable.executor.simulation.likeness import forget, idle
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.snapshots import clone, frozen
from firable.executor.simulation.surroundings import Reach

CRASH = Budget(crashes=1)


# --- What is met among all machines is met alone


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("remote_gate", Budget(losses=1, copies=1)),
        ("local_conflict", Budget(losses=1)),
        ("free ring", Budget()),
    ],
)
def test_whatever_controllers_do_among_all_machines_they_do_alone(name: str, faults: Budget) -> None:
    """`make explore` does the same to a net whose gate is read again."""
    decomposition, reach = decomposition_of(name), Reach(rounds=1, focus=TOP)
    among_all = Acts(reach, 0)
    assert explore(Explorer(decomposition), faults, max_configurations=30_000, watch=among_all).complete
    contained(among_all, alone(decomposition, reach, Budget()))
    assert among_all.beyond == 0


# --- Each act is actions of the proof


@pytest.mark.seeds  # a campaign goes further
@pytest.mark.parametrize("budget", [Budget(), CRASH], ids=["no crash", "crash"])
@pytest.mark.parametrize("net", [*CELLS, "free one_robot"])
def test_every_act_of_controllers_of_cells_is_some_actions_of_the_proof_as_far_as_it_is_explored(
    net: str, budget: Budget
) -> None:
    decomposition = decomposition_of(net)
    tie = AloneTie(decomposition)
    for subnet in decomposition.subnets:
        reach = Reach(rounds=1, focus=TOP)
        explore(Alone(decomposition, subnet.name, reach), budget, max_configurations=8 * FACTOR**2, watch=tie)
    assert tie.actions


def test_with_any_number_of_restarts_every_act_is_what_was_proved_and_all_there_is_is_explored() -> None:
    """Of the system's controller, but for what is closed; `make explore` does the same to all other machines."""
    decomposition = decomposition_of("free one_robot")
    tie, net_tie = AloneTie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        net_tie(explorer, at, step, after)

    assert explore(Alone(decomposition, "system", Reach()), CRASH, watch=watch).complete
    assert tie.actions["promise"] + tie.actions["stand"] > 0
    assert net_tie.kinds["apply"] > 0


@pytest.mark.seeds  # a campaign goes further
@pytest.mark.parametrize("name", ["system", "robot", "mc", "conveyor"])
def test_what_is_closed_and_was_told_does_not_matter_to_tokens_and_promises(name: str) -> None:
    """Each act with all that is known of a coordinator does to the rest what it does without."""
    decomposition = decomposition_of("free one_robot")
    compared = 0

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        nonlocal compared
        stored, message = explorer.machines[step.before], step.about
        machine, now, kept = clone(stored.machine), clone(explorer.machine(step.after)), dict(stored.kept)
        if not isinstance(message, VoteRequest | Decision) or step.kind != "arrive":
            return
        assert isinstance(machine, LocalController)
        assert isinstance(now, LocalController)
        before = the_rest(machine)
        if machine._is_closed(message.round) or message.round < message.closed_below:
            assert the_rest(now) == before, f"{message} of a round that is over changes something"
        elif message.round not in idle(machine, kept):
            forget(machine, kept, idle(machine, kept), frozenset())
            machine.receive(replace(message, closed_below=0, seen=-1))
            assert the_rest(now) == the_rest(machine), message
            compared += 1

    explore(Alone(decomposition, name, Reach(focus=TOP)), CRASH, max_configurations=12 * FACTOR, watch=watch)
    assert compared > 100


def the_rest(machine: LocalController) -> Hashable:
    """What a controller holds besides what it knows of coordinators; a promise of nothing locks nothing."""
    promises = sorted((n, sorted(promise.promised)) for n, promise in machine.promises.items() if promise.promised)
    held = (machine.word, machine.kept_word, machine.latched, machine.commands.newest, machine.timers.running)
    return frozen([*held, machine.unsent, machine.untold, machine.held, machine.leaving, promises])


# --- Coordinators


DECIDING: list[tuple[type[Coordinator], str, str, Budget]] = [
    (planted.DecidesEarly, "one_robot", "G1", Budget()),
    (planted.ClosesEarly, "one_robot", "G3", Budget()),
    (planted.CommitsAborted, "one_robot", "G1", Budget()),
    (planted.KeepsNoDecision, "free one_robot", "G9", CRASH),
    (planted.DropsDecisions, "one_robot", "G1", CRASH),
    (CountsEarlierEpochs, "free one_robot", "G9", CRASH),
    (CountsUsedVotes, "free one_robot", "G9", Budget()),
]


@pytest.mark.parametrize(("fault", "net", "t", "budget"), DECIDING, ids=[fault.__name__ for fault, *_ in DECIDING])
def test_a_drift_of_the_code_in_the_coordinator_of_the_cell_is_no_action_of_the_proof(
    fault: type[Coordinator], net: str, t: str, budget: Budget
) -> None:
    decomposition = decomposition_of(net)
    explorer = Deciding(decomposition, TOP, group_of(decomposition, t), coordinator=fault)
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=60, watch=LocalTie(decomposition))


class OpensNothingBeside(Coordinator):
    """A round of one group keeps every other one from being decided."""

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        if len(self.rounds) < 2:
            yield from super()._voted(vote)


def test_a_coordinator_of_which_groups_have_more_to_do_with_each_other_is_noticed() -> None:
    decomposition = decomposition_of("one_robot")
    explorer = Deciding(decomposition, TOP, group_of(decomposition, "G1"), coordinator=OpensNothingBeside)
    with pytest.raises(FrameError):
        explore(explorer, max_configurations=60)


# --- A drift of the code is found, on a cell

CODE: list[tuple[type[LocalController], str, str, Budget]] = [
    (planted.AppliesTwice, "one_robot", "system", Budget()),
    (planted.KeepsNoPromise, "one_robot", "system", CRASH),
    (planted.KeepsNoMarking, "one_robot", "system", CRASH),
    (planted.ForgetsClosedRounds, "one_robot", "system", CRASH),
    (planted.SignalsUnlocked, "free one_robot", "mc", Budget()),
    (planted.LeavesUntaken, "free one_robot", "conveyor", Budget()),
]


CLOSED = (planted.AppliesTwice, planted.ForgetsClosedRounds)
"""Those that can be told only where what is closed is explored."""
LONG = (planted.LeavesUntaken, planted.SignalsUnlocked)
"""Those that are told late where what is closed is explored, and at once where it is not."""
DRIFTS = [
    (*each, focus)
    for each in CODE
    for focus in (None, TOP)
    if (focus is not None or each[0] not in CLOSED) and (focus is None or each[0] not in LONG)
]


@pytest.mark.parametrize(
    ("fault", "net", "name", "budget", "focus"),
    DRIFTS,
    ids=[f"{fault.__name__} {'apart' if focus is None else 'all'}" for fault, *_, focus in DRIFTS],
)
def test_a_drift_of_the_code_in_a_controller_of_the_cell_is_no_action_of_the_proof(
    fault: type[LocalController], net: str, name: str, budget: Budget, focus: str | None
) -> None:
    explorer = Alone(decomposition_of(net), name, Reach(focus=focus), controller=fault)
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=2000, watch=AloneTie(decomposition_of(net)))
