"""The code of the protocol explored to the end on small nets, with faults: each act of it is actions of the proof."""

import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import support.abstraction
from support import gated_nets, planted
from support.examples import FACTOR, FIRST_SEED, seeds
from support.gated_nets import GATE_READ_AGAIN, SENSOR
from support.layered_nets import cells_in_a_line, contending, left_below, shared_robot
from support.local_tie import LocalTie
from support.planted_layers import PLANTED_LAYERS
from support.reference import load_net
from support.timed_nets import HANDOVER, TWO_TIMES

from firable.decompose.protocol.parametric.logic import same
from firable.decompose.protocol.parametric.script import Action, Demand
from firable.decompose.protocol.parametric.system import PROTOCOL, Protocol, r, shadow
from firable.decompose.splitting.cut import split
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import Firing, ProtocolError
from firable.executor.protocol.token_player import TokenPlayer
from firable.executor.simulation.drawn import DRAWN
from firable.executor.simulation.exploring import Explorer, MachineError, Space, explore, wander
from firable.executor.simulation.numbering import Collecting, Ranking, apply
from firable.executor.simulation.repertoire import Budget, Configuration, Reached, Step
from firable.executor.simulation.snapshots import clone, frozen
from firable.nets.catalogue import catalogue_net
from firable.nets.decomposition import Decomposition
from firable.nets.text import parse_net

NETS = ["local_gate", "remote_gate", "local_conflict", "local_output_conflict", "read_before_order", "ring"]
LAYERED = split(shared_robot())
SHOWN = split(gated_nets.SHOWN)
LOSS, COPY, CRASH, GIVE_UP = Budget(losses=1), Budget(copies=1), Budget(crashes=1), Budget(giving_up=1)


OF_FREE_PARTS = frozenset({"stand", "apply-free", "sense-late"})
"""The actions of the proof that happen only where parts are free of promise, of which these nets have none."""


@cache
def decomposition_of(name: str) -> Decomposition:
    return split({"gate_read_again": GATE_READ_AGAIN, "sensor": SENSOR}.get(name) or load_net(name))


def explored(name: str, budget: Budget, most: int, tie: LocalTie | None = None) -> Space:
    return explore(Explorer(decomposition_of(name)), budget, max_configurations=most, watch=tie)


@pytest.mark.parametrize("name", NETS)
def test_without_faults_every_act_is_some_actions_of_the_proof_and_all_there_is_is_explored(name: str) -> None:
    tie = LocalTie(decomposition_of(name))
    assert explored(name, Budget(), 20_000, tie).complete
    assert tie.actions["decide"] > 0


@pytest.mark.parametrize("budget", [LOSS, COPY, GIVE_UP], ids=["loss", "copy", "giving up"])
@pytest.mark.parametrize("name", ["remote_gate", "read_before_order", "local_conflict"])
def test_with_one_fault_every_act_is_some_actions_of_the_proof_and_all_there_is_is_explored(
    name: str, budget: Budget
) -> None:
    assert explored(name, budget, 30_000, LocalTie(decomposition_of(name))).complete


@pytest.mark.seeds  # a campaign goes further, and `make explore` to the end of one of them
@pytest.mark.parametrize("name", ["local_gate", "remote_gate", "local_conflict", "ring", "sensor"])
def test_with_a_crash_every_act_is_some_actions_of_the_proof_as_far_as_it_is_explored(name: str) -> None:
    tie = LocalTie(decomposition_of(name))
    explored(name, CRASH, 3000 * FACTOR, tie)
    assert tie.actions["restart"] > 0


def test_a_machine_may_take_a_command_at_any_time_and_its_token_waits_for_that() -> None:
    kinds: Counter[str] = Counter()
    tie = LocalTie(SHOWN)

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        kinds[step.kind] += 1
        if any(how is Reached.SENT for _, _, how in at.jobs):
            assert not any(isinstance(effect, Firing) and effect.transition == "back" for effect in step.effects)

    for budget in (Budget(), LOSS):
        assert explore(Explorer(SHOWN), budget, max_configurations=5000, watch=watch).complete
    wander(Explorer(SHOWN), Budget(crashes=5), 1, 100, watch)  # crashes are too much to be explored to the end
    assert {"take", "take, crash", "take, unheard crash"} <= set(kinds)


@pytest.mark.parametrize(
    ("fault", "budget"),
    [(planted.LeavesUntaken, Budget()), (planted.SendsWithoutAsking, CRASH)],
    ids=["early", "twice"],
)
def test_a_command_that_is_never_taken_or_given_again_is_found(fault: type[LocalController], budget: Budget) -> None:
    with pytest.raises(MachineError):
        explore(Explorer(SHOWN, controller=fault), budget, max_configurations=6000)


def test_every_action_of_the_proof_is_met_with_faults_of_every_kind() -> None:
    met: Counter[str] = Counter()
    for name in ("local_conflict", "gate_read_again", "ring"):
        tie = LocalTie(decomposition_of(name))
        explored(name, Budget(1, 1, 1, 1), 2000, tie)
        met += tie.actions
    assert {action.name for action in PROTOCOL.actions} - set(met) <= {"sense", *OF_FREE_PARTS}


# --- Layers, time limits, and what is too large to be explored


def test_in_layers_every_act_is_some_actions_of_the_proof_and_all_there_is_is_explored() -> None:
    tie = LocalTie(LAYERED)
    assert explore(Explorer(LAYERED), max_configurations=10_000, watch=tie).complete
    assert tie.actions["decide"] > 0


@pytest.mark.parametrize("budget", [LOSS, COPY, GIVE_UP, CRASH], ids=["loss", "copy", "giving up", "crash"])
def test_in_layers_every_act_with_a_fault_is_some_actions_of_the_proof_as_far_as_it_is_explored(budget: Budget) -> None:
    tie = LocalTie(LAYERED)
    explore(Explorer(LAYERED), budget, max_configurations=1200, watch=tie)
    assert tie.actions["promise"] > 0


@pytest.mark.parametrize("budget", [Budget(), CRASH, COPY], ids=["no fault", "crash", "copy"])
def test_with_time_limits_every_act_is_some_actions_of_the_proof_as_far_as_it_is_explored(budget: Budget) -> None:
    fired: set[str] = set()
    decomposition = split(parse_net(HANDOVER))
    tie = LocalTie(decomposition)

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        fired.update(effect.transition for effect in step.effects if isinstance(effect, Firing))

    explore(Explorer(decomposition), budget, max_configurations=1200, watch=watch)
    assert "a.go_timeout" in fired


def wandered() -> dict[str, Decomposition]:
    cells = {name: split(catalogue_net(name)) for name in ("one_robot", "one_robot_timed", "two_cells")}
    nets = {"line": split(cells_in_a_line()), "two_times": split(TWO_TIMES)}
    drawn = {f"{family}-{seed}": split(DRAWN[family](seed)) for family in DRAWN for seed in seeds(2)}
    return {**cells, **nets, **drawn}


@pytest.mark.seeds
def test_on_ways_through_nets_too_large_to_be_explored_every_act_is_some_actions_of_the_proof() -> None:
    met: Counter[str] = Counter()
    for decomposition in wandered().values():
        tie = LocalTie(decomposition)
        wander(Explorer(decomposition), Budget(2, 2, 2, 2), FIRST_SEED, 70, tie)
        met += tie.actions
    assert {action.name for action in PROTOCOL.actions} - OF_FREE_PARTS <= set(met)


WAY = """
from firable.decompose.splitting.cut import split
from firable.executor.simulation.exploring import Explorer, wander
from firable.executor.simulation.repertoire import Budget
from firable.nets.catalogue import catalogue_net
seen = []
explorer = Explorer(split(catalogue_net("one_robot")))
wander(explorer, Budget(2, 2, 2, 2), 3, 40, lambda _, at, step, after: seen.append((step.kind, step.machine)))
print(sorted(seen))
"""


def test_one_seed_is_one_way_in_every_process() -> None:
    """Texts are hashed otherwise in each, and sets of messages come in the order of hashes."""
    told = []
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", WAY]
        told.append(subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout)
    assert told[0].count("arrive") > 50
    assert told[0] == told[1]


FOUND_IN_LAYERS = [
    ("CountsAnyVote", LAYERED, Budget()),
    ("NumbersOfItsOwn", LAYERED, Budget()),
    ("PromisesToEach", left_below(split(contending())), Budget()),
    ("ClosesRoundsOfOthers", LAYERED, Budget()),
    ("KeepsOneListOfRounds", LAYERED, Budget()),
]


@pytest.mark.parametrize(("name", "decomposition", "budget"), FOUND_IN_LAYERS, ids=[n for n, _, _ in FOUND_IN_LAYERS])
def test_a_drift_of_the_code_in_layers_is_no_action_of_the_proof(
    name: str, decomposition: Decomposition, budget: Budget
) -> None:
    planted_in = PLANTED_LAYERS[name]
    explorer = Explorer(decomposition, coordinator=planted_in.coordinator, controller=planted_in.controller)
    with pytest.raises((AssertionError, ProtocolError, KeyError)):
        explore(explorer, budget, max_configurations=6000, watch=LocalTie(decomposition))


def test_every_act_on_the_cell_is_some_actions_of_the_proof_as_far_as_it_is_explored() -> None:
    decomposition = split(catalogue_net("one_robot"))
    tie = LocalTie(decomposition)
    explore(Explorer(decomposition), Budget(crashes=1), max_configurations=2500, watch=tie)
    assert tie.actions["sense"] > 0


@pytest.mark.parametrize("name", ["local_gate", "gate_read_again"])
def test_from_every_configuration_something_fires_again_without_any_more_faults(name: str) -> None:
    """Unless nothing is enabled in the central net any more."""
    central = TokenPlayer.of(decomposition_of(name).net)
    space = explore(Explorer(decomposition_of(name)), Budget(losses=1), max_configurations=40_000, edges=True)
    assert space.complete
    before: dict[Configuration, list[Configuration]] = {}
    alive = set()
    for at, steps in space.edges.items():
        if not any(compiled.enabled(at.central) for compiled in central.transitions.values()):
            alive.add(at)
        for step, after in steps:
            if step.kind == "lose":
                continue
            before.setdefault(after, []).append(at)
            if any(isinstance(effect, Firing) for effect in step.effects):
                alive.add(at)
    todo = list(alive)
    while todo:
        for at in before.get(todo.pop(), ()):
            if at not in alive:
                alive.add(at)
                todo.append(at)
    assert len(alive) == space.configurations


# --- What makes it end


def test_numbers_are_replaced_in_their_order_and_within_their_epoch() -> None:
    found = {("round", "", ""): {7, 9, (1 << 32) + 3}, ("report", "a", ""): {-1, (1 << 32) - 1, 5}}
    ranking = Ranking(found.items())
    assert [ranking.round("", n) for n in (7, 9, (1 << 32) + 3)] == [0, 1, 1 << 32]
    assert [ranking.report("a", "", n) for n in (-1, 5, (1 << 32) - 1)] == [-1, 0, (1 << 32) - 1]


@pytest.mark.parametrize("epoch", [0, 1, 2])
def test_numbers_of_rounds_still_tell_whose_they_are_and_begin_as_those_of_a_restarted_coordinator(epoch: int) -> None:
    names = coordinators(LAYERED)
    for name in names:
        machine = Coordinator.restored(LAYERED, {"epoch": epoch - 1} if epoch else {}, name)
        later = {machine.next_round + machine.stride * i for i in (3, 5)}
        ranking = Ranking([(("round", "", name), later)], names)
        assert [ranking.round(name, n) for n in sorted(later)] == [
            machine.next_round,
            machine.next_round + machine.stride,
        ]


def test_a_field_that_may_hold_numbers_and_is_not_known_is_refused() -> None:
    machine = LocalController(decomposition_of("ring"), "c1")
    vars(machine)["added_later"] = 3
    with pytest.raises(TypeError, match="added_later"):
        apply(machine, {}, Collecting())


def test_a_copy_of_a_machine_is_equal_and_shares_nothing_that_changes() -> None:
    machine = LocalController(decomposition_of("ring"), "c1")
    copy = clone(machine)
    assert frozen(copy) == frozen(machine)
    copy.closed.add(3)
    copy.commands.newest.clear()
    assert frozen(copy) != frozen(machine)
    assert not machine.closed


# --- A drift of the code is found


CODE: list[tuple[type[Any], str, Budget]] = [
    (planted.NoLock, "gate_read_again", Budget()),
    (planted.ReadsUnlocked, "gate_read_again", Budget()),
    (planted.AppliesTwice, "remote_gate", COPY),
    (planted.VotesFromMemory, "gate_read_again", Budget()),
    (planted.KeepsNoPromise, "remote_gate", CRASH),
    (planted.KeepsNoMarking, "remote_gate", CRASH),
    (planted.KeepsNoLocalFiring, "local_gate", CRASH),
    (planted.ForgetsClosedRounds, "remote_gate", CRASH),
    (planted.DecidesEarly, "remote_gate", Budget()),
    (planted.CachedVotes, "gate_read_again", COPY),
    (planted.CachedGates, "remote_gate", Budget()),
    (planted.CommitsAborted, "remote_gate", GIVE_UP),
    (planted.ClosesEarly, "remote_gate", Budget()),
    (planted.KeepsNoDecision, "remote_gate", CRASH),
    (planted.DropsDecisions, "remote_gate", CRASH),
]


@pytest.mark.parametrize(("fault", "name", "budget"), CODE, ids=[fault.__name__ for fault, _, _ in CODE])
def test_a_drift_of_the_code_is_no_action_of_the_proof(fault: type[Any], name: str, budget: Budget) -> None:
    decomposition = decomposition_of(name)
    explorer = (
        Explorer(decomposition, controller=fault)
        if issubclass(fault, LocalController)
        else Explorer(decomposition, coordinator=fault)
    )
    with pytest.raises((AssertionError, ProtocolError)):
        explore(explorer, budget, max_configurations=8000, watch=LocalTie(decomposition))


# --- A drift of the proof is found


def drifts() -> list[tuple[str, Action]]:
    """Each action, with one update left out, or with a demand that never holds."""
    found = []
    never = Demand("never", ~same(r, r))
    for action in (action for action in PROTOCOL.actions if action.name not in OF_FREE_PARTS):
        for update in action.updates:
            if update.relation is not shadow:
                left = tuple(each for each in action.updates if each is not update)
                found.append((f"{action.name} without {update.relation.name}", replace(action, updates=left)))
        if r in action.parameters:
            found.append((f"{action.name} never", replace(action, demands=(*action.demands, never))))
    return found


@pytest.mark.parametrize(("words", "drifted"), drifts(), ids=[words for words, _ in drifts()])
def test_a_drift_of_the_proof_is_found(words: str, drifted: Action, monkeypatch: pytest.MonkeyPatch) -> None:
    actions = tuple(drifted if action.name == drifted.name else action for action in PROTOCOL.actions)
    monkeypatch.setattr(support.abstraction, "PROTOCOL", Protocol(PROTOCOL.static, actions))
    with pytest.raises(AssertionError):
        explore_some()


def explore_some() -> None:
    """Enough for every action of the proof to be met."""
    cases = (
        ("local_conflict", Budget()),
        ("remote_gate", COPY),
        ("sensor", CRASH),
        ("local_gate", COPY),
        ("local_gate", GIVE_UP),
        ("gate_read_again", Budget(1, 0, 1, 1)),
    )
    for name, budget in cases:
        explored(name, budget, 2500, LocalTie(decomposition_of(name)))
