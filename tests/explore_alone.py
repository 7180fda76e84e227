"""What the tests of explored machines would do too, were it quicker: `make explore` does.

    pytest tests/explore_alone.py

No test of the suite: its name is none that pytest collects by itself.
"""

from __future__ import annotations

import pytest
from support.alone_acts import Acts, alone, contained, decomposition_of, group_of
from support.examples import FACTOR, FIRST_SEED
from support.local_net_tie import LocalNetTie
from support.local_tie import LocalTie
from support.standing_votes import AloneTie

from firable.decompose.protocol.building import protocol_net
from firable.executor.protocol.deciders import TOP
from firable.executor.simulation.alone import Alone
from firable.executor.simulation.deciding import Deciding
from firable.executor.simulation.exploring import Explorer, explore, wander
from firable.executor.simulation.repertoire import Budget, Configuration, Step
from firable.executor.simulation.surroundings import Reach

CRASH = Budget(crashes=1)


def test_with_parts_that_promise_every_act_is_what_was_proved_and_all_there_is_is_explored() -> None:
    """Of the machining centre of `two_robots_shared`, but for what is closed, with any number of restarts."""
    decomposition = decomposition_of("two_robots_shared")
    tie, net_tie = AloneTie(decomposition), LocalNetTie(protocol_net(decomposition))

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        net_tie(explorer, at, step, after)

    assert explore(Alone(decomposition, "mc", Reach()), CRASH, watch=watch).complete
    assert tie.actions["promise"] > 0
    assert net_tie.kinds["apply"] > 0


def test_with_a_crash_every_act_is_some_actions_of_the_proof_and_all_there_is_is_explored() -> None:
    decomposition = decomposition_of("remote_gate")
    tie = LocalTie(decomposition)
    assert explore(Explorer(decomposition), CRASH, watch=tie).complete
    assert tie.actions["restart"] > 0


def test_whatever_controllers_do_where_a_gate_is_read_again_they_do_alone() -> None:
    decomposition, reach = decomposition_of("gate_read_again"), Reach(rounds=1, focus=TOP)
    among_all = Acts(reach, 0)
    assert explore(Explorer(decomposition), Budget(losses=1), max_configurations=1_000_000, watch=among_all).complete
    contained(among_all, alone(decomposition, reach, Budget()))
    assert among_all.beyond == 0


def test_whatever_controllers_do_around_a_crash_they_do_alone() -> None:
    decomposition, reach = decomposition_of("remote_gate"), Reach(rounds=1, focus=TOP)
    among_all = Acts(reach, 1)
    explore(Explorer(decomposition), CRASH, max_configurations=2000 * FACTOR, watch=among_all)
    contained(among_all, alone(decomposition, reach, CRASH))


def test_of_the_cell_every_act_is_some_actions_of_the_proof_whatever_arrives_and_those_on_ways_are_among_them() -> None:
    """Of the system controller, with parts free of promise as bundles have them: all that there is."""
    decomposition, reach = decomposition_of("free one_robot"), Reach(rounds=1, focus=TOP)
    by_itself, among_all, tie = Acts(reach, 0), Acts(reach, 0), AloneTie(decomposition)

    def watch(explorer: Explorer, at: Configuration, step: Step, after: Configuration) -> None:
        tie(explorer, at, step, after)
        by_itself(explorer, at, step, after)

    assert explore(Alone(decomposition, "system", reach), watch=watch).complete
    assert tie.actions["apply-free"] > 0
    wander(Explorer(decomposition), Budget(losses=2, copies=2), FIRST_SEED, 400, among_all)
    assert len(among_all.found["system"]) > 5
    assert among_all.found["system"] <= by_itself.found["system"]


@pytest.mark.parametrize(("name", "budget"), [("system", CRASH), ("robot", Budget()), ("mc", Budget())])
def test_with_what_a_coordinator_has_closed_every_act_is_what_was_proved_and_all_there_is_is_explored(
    name: str, budget: Budget
) -> None:
    """With any number of restarts of its own, or none."""
    decomposition = decomposition_of("free one_robot")
    tie = AloneTie(decomposition)
    assert explore(Alone(decomposition, name, Reach(rounds=1, focus=TOP)), budget, watch=tie).complete
    assert tie.actions["apply-free"] + tie.actions["apply"] > 0


def test_of_a_group_of_the_cell_every_act_of_its_coordinator_is_some_actions_of_the_proof_with_any_restarts() -> None:
    decomposition = decomposition_of("free one_robot")
    tie, explorer = LocalTie(decomposition), Deciding(decomposition, TOP, group_of(decomposition, "G9"))
    assert explore(explorer, CRASH, watch=tie).complete
    assert {"decide", "note", "close", "give-up", "restart"} <= set(tie.actions)
    assert explorer.compared > 500
