"""Machines explored alone: what controllers do among all is there, and each act is actions of the proof."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import replace
from functools import cache

import pytest
from support import planted
from support.examples import FACTOR, FIRST_SEED
from support.free_parts import CountsEarlierEpochs, CountsUsedVotes, freed
from support.gated_nets import GATE_READ_AGAIN, SENSOR, SHOWN
from support.layered_nets import shared_robot
from support.local_net_tie import LocalNetTie
from support.local_tie import LocalTie
from support.reference import load_net

from firable.decompose.protocol.building import protocol_net
from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Decision,
    Effect,
    Message,
    ProtocolError,
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.alone import Alone
from firable.executor.simulation.deciding import Deciding, FrameError
from firable.executor.simulation.exploring import Explorer, explore, wander
from firable.executor.simulation.likeness import forget, idle, liken
from firable.executor.simulation.numbering import Collecting, Ranking, apply, apply_message
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.snapshots import clone, frozen
from firable.executor.simulation.surroundings import Reach
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition

CRASH = Budget(crashes=1)


@cache
def decomposition_of(name: str) -> Decomposition:
    family, _, net = name.rpartition(" ")
    if net in CELLS:
        found = split(catalogue_net(net))
    else:
        known = {"gate_read_again": GATE_READ_AGAIN, "sensor": SENSOR, "shown": SHOWN}
        found = split(shared_robot() if net == "shared_robot" else known.get(net) or load_net(net))
    return freed(found) if family else found


CELLS = ("one_robot", "two_robots_shared", "two_robots_separate", "two_cells")


# --- What is met among all machines is met alone


def told(explorer: Explorer, number: int, message: Message | None, reach: Reach) -> Hashable | None:
    """A controller and what it meets, by what an exploration alone tells apart; None beyond what it reaches."""
    stored = explorer.machines[number]
    machine, kept = clone(stored.machine), dict(stored.kept)
    assert isinstance(machine, LocalController)
    known = {*machine.promises, *machine.closed}
    if isinstance(message, ToController):
        over = machine.above[message.coordinator]
        known = {n for n in known if machine.above_of(n) is not over or n >= message.closed_below}
        if (n := getattr(message, "round", -1)) >= max(over.closed_below, message.closed_below):
            known.add(n)
    if reach.rounds is not None and len(known) > reach.rounds:
        return None
    if any(above.epoch > reach.restarts for above in machine.above.values()):
        return None
    liken(machine, kept)
    its = idle(machine, kept)
    met_with = {n for n in its if n == getattr(message, "round", -1)} or set(sorted(its)[-1:])
    forget(machine, kept, its - met_with, frozenset(machine.above))
    if isinstance(message, ToController):
        above = machine.above[message.coordinator]
        seen = above.told if message.seen == above.told else -1
        if (above.seen == above.told and message.epoch == above.epoch) or message.epoch < above.epoch:
            seen = above.seen
        below = message.closed_below
        if below <= above.closed_below:
            below = above.closed_below if above.closed_below >> EPOCH_BITS <= message.epoch else 0
        if message.epoch > reach.restarts:
            return None
        message = replace(message, seen=seen, closed_below=below)
    collecting = Collecting()
    apply(clone(machine), kept, collecting)
    if message is not None:
        apply_message(message, collecting)
    ranking = Ranking(collecting.found.items(), explorer.coordinators)
    kept = apply(machine, kept, ranking)
    met = None if message is None else apply_message(message, ranking)
    return frozen(machine), frozen(sorted(kept.items())), met


class Acts:
    """A watcher that notes what each controller meets."""

    def __init__(self, reach: Reach, crashes: int) -> None:
        self.reach, self.crashes = reach, crashes
        self.found: dict[str, set[Hashable]] = {}
        self.beyond = 0
        self.known: set[Hashable] = set()

    def __call__(self, explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        del at, after
        key = (step.machine, step.before, step.about, step.kind)
        if step.machine < len(explorer.coordinators) or key in self.known:
            return
        self.known.add(key)
        machine = explorer.machine(step.before)
        assert isinstance(machine, LocalController)
        message = step.about if isinstance(step.about, Message) else None
        act = told(explorer, step.before, message, self.reach)
        if act is None or (machine.epoch and not self.crashes):
            self.beyond += 1
        else:
            self.found.setdefault(machine.name, set()).add((step.kind, act))


def alone(decomposition: Decomposition, reach: Reach, budget: Budget) -> Acts:
    acts = Acts(reach, budget.crashes)
    for subnet in decomposition.subnets:
        assert explore(Alone(decomposition, subnet.name, reach), budget, watch=acts).complete
    return acts


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("remote_gate", Budget(losses=1, copies=1)),
        ("local_conflict", Budget(losses=1)),
        ("gate_read_again", Budget(losses=1)),
        ("free ring", Budget()),
    ],
)
def test_whatever_controllers_do_among_all_machines_they_do_alone(name: str, faults: Budget) -> None:
    decomposition, reach = decomposition_of(name), Reach(rounds=1, focus=TOP)
    among_all = Acts(reach, 0)
    assert explore(Explorer(decomposition), faults, max_configurations=30_000, watch=among_all).complete
    contained(among_all, alone(decomposition, reach, Budget()))
    assert among_all.beyond == 0


@pytest.mark.seeds
def test_whatever_controllers_do_around_a_crash_they_do_alone() -> None:
    decomposition, reach = decomposition_of("remote_gate"), Reach(rounds=1, focus=TOP)
    among_all = Acts(reach, 1)
    explore(Explorer(decomposition), CRASH, max_configurations=2000 * FACTOR, watch=among_all)
    contained(among_all, alone(decomposition, reach, CRASH))


def test_of_the_cell_every_act_is_some_actions_of_the_proof_whatever_arrives_and_those_on_ways_are_among_them() -> None:
    """Of the system controller, with parts free of promise as bundles have them: all that there is."""
    decomposition, reach = decomposition_of("free one_robot"), Reach(rounds=1, focus=TOP)
    by_itself, among_all, tie = Acts(reach, 0), Acts(reach, 0), Tie(decomposition)

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        by_itself(explorer, at, step, after)

    assert explore(Alone(decomposition, "system", reach), watch=watch).complete
    assert tie.actions["apply-free"] > 0
    wander(Explorer(decomposition), Budget(losses=2, copies=2), FIRST_SEED, 400, among_all)
    assert len(among_all.found["system"]) > 5
    assert among_all.found["system"] <= by_itself.found["system"]


def contained(among_all: Acts, by_itself: Acts) -> None:
    assert among_all.found
    for name, acts in among_all.found.items():
        assert acts <= by_itself.found[name], next(iter(acts - by_itself.found[name]))


# --- Each act is actions of the proof


class Tie(LocalTie):
    """Holds each act to the proof, and each vote that stands to what an order relies on besides."""

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        super().__call__(explorer, before, step, after)
        machine = explorer.machine(step.after)
        reports = [] if step.kind.endswith("crash") else [e for e in step.effects if isinstance(e, ToCoordinator)]
        if isinstance(machine, LocalController) and reports:
            for t in reports[-1].readiness.transitions & machine.free:
                assert not machine.parts[t].takes & machine.unsent, f"'{t}' is voted for before a command is taken"


@pytest.mark.seeds  # a campaign goes further
@pytest.mark.parametrize("budget", [Budget(), CRASH], ids=["no crash", "crash"])
@pytest.mark.parametrize("net", [*CELLS, "free one_robot"])
def test_every_act_of_controllers_of_cells_is_some_actions_of_the_proof_as_far_as_it_is_explored(
    net: str, budget: Budget
) -> None:
    decomposition = decomposition_of(net)
    tie = Tie(decomposition)
    for subnet in decomposition.subnets:
        reach = Reach(focus=TOP, restarts=1)
        explore(Alone(decomposition, subnet.name, reach), budget, max_configurations=8 * FACTOR**2, watch=tie)
    assert tie.actions


@pytest.mark.parametrize(("net", "name"), [("free one_robot", "system"), ("two_robots_shared", "mc")])
def test_with_any_number_of_restarts_every_act_is_what_was_proved_and_all_there_is_is_explored(
    net: str, name: str
) -> None:
    """But for what is closed; `make explore` does the same to the other machines of the cells."""
    decomposition = decomposition_of(net)
    tie, net_tie = Tie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        net_tie(explorer, at, step, after)

    assert explore(Alone(decomposition, name, Reach()), CRASH, watch=watch).complete
    assert tie.actions["promise"] + tie.actions["stand"] > 0
    assert net_tie.kinds["apply"] > 0


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

    explore(Alone(decomposition, name, Reach(focus=TOP)), CRASH, max_configurations=40, watch=watch)
    assert compared > 100


def the_rest(machine: LocalController) -> Hashable:
    """What a controller holds besides what it knows of coordinators; a promise of nothing locks nothing."""
    promises = sorted((n, sorted(promise.promised)) for n, promise in machine.promises.items() if promise.promised)
    held = (machine.word, machine.kept_word, machine.latched, machine.commands.newest, machine.timers.running)
    return frozen([*held, machine.unsent, machine.untold, machine.held, machine.leaving, promises])


# --- Coordinators


def test_of_a_group_of_the_cell_every_act_of_its_coordinator_is_some_actions_of_the_proof_with_any_restarts() -> None:
    decomposition = decomposition_of("free one_robot")
    tie, explorer = LocalTie(decomposition), Deciding(decomposition, TOP, group_of(decomposition, "G9"))
    assert explore(explorer, CRASH, watch=tie).complete
    assert {"decide", "note", "close", "give-up", "restart"} <= set(tie.actions)
    assert explorer.compared > 500


def group_of(decomposition: Decomposition, t: str) -> int:
    return Coordinator(decomposition).group_of[t]


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


@pytest.mark.parametrize("focus", [None, TOP], ids=["what is closed apart", "all"])
@pytest.mark.parametrize(("fault", "net", "name", "budget"), CODE, ids=[fault.__name__ for fault, *_ in CODE])
def test_a_drift_of_the_code_in_a_controller_of_the_cell_is_no_action_of_the_proof(
    fault: type[LocalController], net: str, name: str, budget: Budget, focus: str | None
) -> None:
    if focus is None and fault in (planted.AppliesTwice, planted.ForgetsClosedRounds):
        pytest.skip("what is closed is not explored there")
    explorer = Alone(decomposition_of(net), name, Reach(focus=focus), controller=fault)
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=2000, watch=Tie(decomposition_of(net)))
