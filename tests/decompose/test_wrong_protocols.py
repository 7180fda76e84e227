"""Every protocol that is known to be wrong is refuted, by a run that can be read."""

from threading import Event
from typing import Any

import pytest
from support.reference import load_net

from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.decompose.protocol import refuting
from firable.decompose.protocol.building import protocol_net
from firable.decompose.protocol.directed import Search, directed, numbered
from firable.decompose.protocol.draft import ASTRAY
from firable.decompose.protocol.exploring import AT_FAULT, COMPLETE, DIVERGENCE, ONE_TOKEN, explore_protocol
from firable.decompose.protocol.refuting import LINES_READ, Refutation, is_true_here, readable, refute
from firable.decompose.protocol.variant import Variant
from firable.decompose.protocol.wrong import WRONG, WrongProtocol, example
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.persistence import freed
from firable.nets.catalogue import catalogue_net
from firable.nets.formula import Holds
from firable.nets.net import Controller, Net, Place, Transition
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


def test_what_is_wrong_with_a_protocol_has_its_code_and_says_what_to_do() -> None:
    assert {question.code for question in (COMPLETE, ONE_TOKEN, DIVERGENCE)} == {"F4006"}
    assert all(question.hint.endswith(AT_FAULT) for question in (COMPLETE, ONE_TOKEN, DIVERGENCE))


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
    # Two runs are equally short: without the vote of the one, and of the other.
    (missing,) = (
        one for one in ("robot", "lathe") if f"hand_over is decided without the vote of {one}" in found.events
    )
    full = {"robot": "robot.part is full", "lathe": "lathe.empty is full"}[missing]
    assert found.sentence.startswith(f"no order is on its way, and unlike in the central net {full}")


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


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("cached-votes", 15),
        ("old-votes", 18),
        ("unlocked-conflicts", 21),
        ("orders-twice", 14),
        ("missing-vote", 5),
        ("forgotten-promises", 14),
    ],
)
def test_run_of_the_whole_cell_is_told_in_a_few_lines_and_played_event_for_event(name: str, lines: int) -> None:
    found = refute(BY_NAME[name], load_net("cell1"), Limits())
    assert found.status is Status.VIOLATED
    assert found.witness is not None
    assert len(found.lines) == lines < len(found.events) == sum(line.events for line in found.lines)
    net = found.protocol.net
    player, marking = Player(net), net.initial_marking
    for (step,) in found.witness.firings:
        marking = player.fire(marking, [net.transition_index[step]])
    assert net.names(marking) == found.witness.marking
    assert found.sentence
    assert readable(found) is found
    numbers = [number for number, _ in numbered(found.lines)]
    assert numbers[-1].rpartition("-")[2] == str(len(found.events))


def test_unlocked_conflict_gives_the_robot_of_the_cell_a_second_task() -> None:
    """Both it and G6 have the yes of the robot; while it unloads, the others give theirs."""
    found = refute(BY_NAME["unlocked-conflicts"], catalogue_net("one_robot"), Limits())
    told = [line.text for line in found.lines]
    assert told[-1] == "G2 is decided, though in the central net robot.free is empty"
    yes = told.index("robot is asked for its vote on G2, and its yes arrives")
    assert yes < told.index("G6 is fired, undisturbed") < told.index("G7 is fired, undisturbed")


@pytest.mark.parametrize("name", ["cached-gates", "unlocked-reads"])
def test_what_the_cell_has_nothing_of_cannot_be_left_out_of_its_protocol(name: str) -> None:
    found = refute(BY_NAME[name], load_net("cell1"), Limits())
    assert (found.status, found.lines) == (Status.PROVED, ())
    assert "inductive invariant" in found.method
    assert is_true_here(split(load_net("cell1")), BY_NAME[name].variant)
    assert not is_true_here(split(example(BY_NAME[name].example)), BY_NAME[name].variant)


@pytest.mark.parametrize("wrong", WRONG, ids=named)
def test_only_what_leaves_something_out_of_the_parts_may_be_the_true_protocol(wrong: WrongProtocol) -> None:
    by_parts = wrong.name in {"cached-gates", "unlocked-reads", "unlocked-conflicts", "conflicts-decided-below"}
    shuttle, own = split(example("shuttle")), split(example(wrong.example))
    if wrong.variant.of_free:
        assert is_true_here(shuttle, wrong.variant), "no part is said to be free"
        shuttle, own = freed(shuttle), freed(own)
    assert is_true_here(shuttle, wrong.variant) is by_parts
    assert not is_true_here(own, wrong.variant)


def test_steps_that_cannot_follow_each_other_are_no_leap() -> None:
    protocol = protocol_net(split(example("shuttle")), BY_NAME["missing-vote"].variant)
    search = Search(protocol, Holds(ASTRAY), Limits())
    assert search.leap("x", ["ask/hand_over", "ask/hand_over"], "asked twice") is None
    assert search.leap("x", ["ask/nothing"], "no step") is None
    leap = search.leap("x", ["ask/hand_over", "give-up/hand_over"], "in vain")
    assert leap is not None
    assert leap.transition.inputs == leap.transition.permissive == ()
    assert set(leap.transition.outputs) == {"asked/hand_over", "decided/hand_over"}


def test_true_protocol_has_no_run_that_goes_wrong_in_any_focus() -> None:
    protocol = protocol_net(split(load_net("cell1")))
    assert directed(protocol, Holds(ASTRAY), Limits()) is None


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
    assert all(len(refute(wrong).lines) <= LINES_READ for wrong in WRONG)


def doors() -> Net:
    """`finish` has free parts alone, and `begin` and `shut` none: what the one closes is a gate of the other."""
    places = ("boss.idle", "arm.home", "press.open", "boss.busy", "arm.out", "press.shut")
    transitions = (
        Transition("begin", ("boss.idle", "arm.home"), ("boss.busy", "arm.out"), permissive=("press.open",)),
        Transition("shut", ("press.open",), ("press.shut",), inhibitive=("arm.out",)),
        Transition("reopen", ("press.shut",), ("press.open",)),
        Transition("finish", ("boss.busy", "arm.out"), ("boss.idle", "arm.home")),
    )
    made = tuple(Place(name, name.partition(".")[0], i < 3) for i, name in enumerate(places))
    return Net("doors", made, transitions, (), tuple(map(Controller, ("boss", "arm", "press"))))


@pytest.mark.parametrize("name", ["used-votes", "free-twice"])
def test_what_is_left_out_of_free_parts_goes_wrong_where_only_parts_are_free_that_may_be(name: str) -> None:
    found = refute(BY_NAME[name], split(doors()))
    assert found.status is Status.VIOLATED
    assert found.protocol.parts.decomposition.free == freed(split(doors())).free
    votes = {event for event in found.events if event.endswith("promises nothing")}
    assert votes
    assert not any("begin" in vote or "shut" in vote for vote in votes if vote.startswith("press"))
    assert any("once more" in event for event in found.events) == (name == "free-twice")


@pytest.mark.parametrize("name", ["used-votes", "free-twice"])
def test_a_net_without_free_parts_cannot_go_wrong_by_them(name: str) -> None:
    net = example("doors")
    assert freed(split(net)).free == ()
    assert refute(BY_NAME[name], split(net)).status is Status.PROVED


def test_memory_without_room_for_a_protocol_leaves_it_undecided() -> None:
    for wrong in WRONG:
        found = refute(wrong, limits=Limits(memory_bytes=1))
        assert found.status is Status.UNKNOWN
        assert "1 bytes does not hold the net itself" in found.bound


def test_a_focus_that_memory_has_no_room_for_is_left_out() -> None:
    protocol = protocol_net(split(load_net("ring")))
    assert directed(protocol, Holds(ASTRAY), Limits(memory_bytes=1)) is None


def test_time_that_ends_while_the_first_markings_are_found_leaves_it_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    over = Event()

    def explored(*of: Any, **how: Any) -> ReachabilityGraph:
        graph = explore(*of, **how)
        over.set()
        return graph

    monkeypatch.setattr(refuting, "explore", explored)
    found = refute(BY_NAME["unlocked-conflicts"], catalogue_net("two_cells"), Limits(Deadline(cancelled=over)))
    assert (found.status, found.witness) == (Status.UNKNOWN, None)
    assert found.verdict.bound
