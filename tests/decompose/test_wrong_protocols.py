"""Every protocol that is known to be wrong is refuted, by a run that can be read."""

import pytest
from support.reference import load_net

from firable.analysis.goal import Limits
from firable.decompose.protocol.draft import ASTRAY
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.refuting import EVENTS_READ, Refutation, readable, refute
from firable.decompose.protocol.variant import Variant
from firable.decompose.protocol.wrong import WRONG, WrongProtocol, example
from firable.nets.verdict import Status, Weight
from firable.semantics.player import Player

BY_NAME = {wrong.name: wrong for wrong in WRONG}


def named(wrong: WrongProtocol) -> str:
    return wrong.name


def refuted(name: str) -> Refutation:
    return refute(BY_NAME[name])


@pytest.mark.parametrize("wrong", WRONG, ids=named)
def test_wrong_protocol_is_refuted_by_a_run_that_the_reference_player_plays(wrong: WrongProtocol) -> None:
    found = refute(wrong)
    assert found.status is Status.VIOLATED
    assert found.witness is not None
    net = found.protocol.net
    player, marking = Player(net), net.initial_marking
    for (name,) in found.witness.firings:
        marking = player.fire(marking, [net.transition_index[name]])
    holds = set(net.names(marking))
    assert holds == set(found.witness.marking)
    central = {place.removeprefix("central/") for place in holds if place.startswith("central/")}
    own = {place for place in holds if place in found.protocol.parts.net.place_index}
    assert ASTRAY in holds or central != own


@pytest.mark.parametrize("wrong", WRONG, ids=named)
def test_true_protocol_is_right_where_the_wrong_one_fails(wrong: WrongProtocol) -> None:
    if wrong.example == "one_robot":
        return  # test_protocol_net has the whole cell
    found = explore_protocol(example(wrong.example))
    assert {verdict.status for verdict in found.verdicts} == {Status.PROVED}


def test_cached_vote_gives_the_robot_a_second_task_while_it_carries_a_part() -> None:
    found = refuted("cached-votes")
    assert found.events[-1] == "G2 is decided, though in the central net robot.free is empty"
    last_vote = max(i for i, event in enumerate(found.events) if event == "robot votes yes on G2")
    assert last_vote < found.events.index("G6 is decided") < found.events.index("G7 is decided")


def test_order_applied_twice_is_told_as_that() -> None:
    events = refuted("orders-twice").events
    assert any("which fires its part again" in event for event in events)


def test_missing_vote_leaves_half_a_firing() -> None:
    found = refuted("missing-vote")
    assert "hand_over is decided without the vote of robot" in found.events
    assert found.sentence.startswith("no order is on its way, and unlike in the central net robot.part is full")


def test_forgotten_promise_needs_a_crash() -> None:
    wrong = BY_NAME["forgotten-promises"]
    assert refute(WrongProtocol("x", "", "", wrong.variant, wrong.example)).status is Status.PROVED
    assert any("forgets in the crash" in event for event in refute(wrong).events)


def test_verdict_on_a_wrong_protocol_is_information() -> None:
    verdict = refuted("cached-gates").verdict
    assert (verdict.name, verdict.weight, verdict.status) == (
        "wrong.cached-gates",
        Weight.INFORMATION,
        Status.VIOLATED,
    )


def test_cell_without_internal_gates_cannot_go_wrong_by_cached_ones() -> None:
    found = refute(BY_NAME["cached-gates"], load_net("local_conflict"))
    assert (found.status, found.events, found.sentence) == (Status.PROVED, (), "")


@pytest.mark.parametrize("name", ["old-votes", "orders-twice", "missing-vote", "forgotten-promises"])
def test_wrong_protocols_are_refuted_on_the_whole_cell_too(name: str) -> None:
    """By a walk: a search for a shortest run would end with the memory."""
    found = refute(BY_NAME[name], load_net("cell1"), Limits())
    assert found.status is Status.VIOLATED
    assert found.events


def test_two_robots_cannot_go_wrong_by_cached_votes() -> None:
    """So a test of that cell alone would prove nothing about the protocol."""
    assert refute(BY_NAME["cached-votes"], load_net("cell2_separate")).status is Status.PROVED


def test_true_protocol_is_not_among_the_wrong_ones() -> None:
    assert Variant() not in {wrong.variant for wrong in WRONG}
    assert len({wrong.name for wrong in WRONG}) == len(WRONG)


def test_where_the_cell_has_no_run_that_can_be_read_the_small_example_has_one() -> None:
    found = readable(refute(BY_NAME["cached-gates"], load_net("local_conflict")))
    assert found.small is not None
    assert (len(found.small.events), found.small.protocol.parts.net.name) == (2, "doors")
    assert readable(found.small) is found.small
    assert all(len(refute(wrong).events) <= EVENTS_READ for wrong in WRONG)
