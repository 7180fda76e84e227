"""A technique on the reduced net answers for the original one."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cell_nets import cell_nets
from support.examples import examples
from support.lively_nets import lively_net, part_of
from support.naive_space import NaiveSpace
from support.small_text import net_of

from firable.analysis.check import check
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.reduction import deciding
from firable.analysis.reduction.components import parts
from firable.analysis.reduction.deciding import (
    ByReduction,
    KnownByReduction,
    decide_by_diagram,
    decide_reduced,
)
from firable.analysis.reduction.reduce import ReducedTransitions, reduce_for_liveness
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.stubborn import Firings, FiringSearch
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.catalogue.processes import machines, philosophers
from firable.nets.formula import And, Deadlock, Formula, Holds, Not, parse_formula
from firable.nets.net import Net, Place, Transition
from firable.nets.verdict import Cost, Status, Witness
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

TECHNIQUES = ("decide_by_stubborn_sets", "decide_by_diagram", "decide_by_exploring", "decide_by_walk")


def by_playing(net: Net, goal: Formula, limits: Limits) -> Finding:
    space = NaiveSpace(net)
    witness = space.witness(space.satisfying(goal), "here it is")
    return Finding(witness is not None, "playing", witness, cost=Cost(space.n_markings))


def test_the_witness_is_one_of_the_original_net() -> None:
    net = catalogue_net("one_robot_mc_late")
    finding = decide_reduced(net, Deadlock(), Limits(), by_playing)
    assert finding.reachable
    assert finding.method.startswith("playing, after reduction from 27/15 to 2/3 places/transitions by closers early")
    assert finding.witness is not None
    assert finding.witness.note == "here it is"
    player, marking = Player(net), net.initial_marking
    for (name,) in finding.witness.firings:
        marking = player.fire(marking, [net.transition_index[name]])
    assert player.deadlocked(marking)
    assert finding.cost.markings == 4


def test_what_the_reduction_decides_needs_no_technique() -> None:
    def never(net: Net, goal: Formula, limits: Limits) -> Finding:
        raise AssertionError("there is nothing to decide")

    ring = net_of("a", "t: a -> b", "u: b -> c", "v: c -> a")
    found = decide_reduced(ring, parse_formula("c"), Limits(), never)
    assert found.reachable
    assert found.witness is not None
    assert found.witness.firings == (("t",), ("u",))
    assert found.method.startswith("structural reduction from 3/3 to 0/0 places/transitions by")
    absent = decide_reduced(ring, parse_formula("a and b"), Limits(), never)
    assert absent.reachable is False
    assert absent.witness is None


def test_what_is_not_decided_stays_so() -> None:
    def gives_up(net: Net, goal: Formula, limits: Limits) -> Finding:
        return Finding(None, "giving up", bound="nowhere")

    finding = decide_reduced(catalogue_net("one_robot_mc_late"), Deadlock(), Limits(), gives_up)
    assert finding.reachable is None
    assert finding.bound == "nowhere"


RING = ("t: a -> b if d", "u: b -> a, c", "v: c -> d unless b", "w: d ->")


def beside(*nets: Net) -> Net:
    """Nets side by side, with names of their own."""

    def renamed(names: tuple[str, ...], i: int) -> tuple[str, ...]:
        return tuple(f"{name}{i}" for name in names)

    return Net(
        "beside",
        tuple(Place(f"{p.name}{i}", marked=p.marked) for i, net in enumerate(nets) for p in net.places),
        tuple(
            Transition(
                f"{t.name}{i}",
                renamed(t.inputs, i),
                renamed(t.outputs, i),
                renamed(t.permissive, i),
                renamed(t.inhibitive, i),
            )
            for i, net in enumerate(nets)
            for t in net.transitions
        ),
    )


def test_nets_side_by_side_are_taken_apart_and_what_speaks_of_both_holds_them_together() -> None:
    net = beside(net_of("a", *RING), net_of("a", *RING))
    for goal, sizes in (
        ("deadlock", [4, 4]),
        ("deadlock and a0 and not b1", [4, 4]),
        ("a0 and (b0 or c0)", [4]),
        ("a0 and b1", [4, 4]),
        ("a0 or b1", [8]),
        ("deadlock and (a0 or b1)", [8]),
        ("tokens(a0, a1) = 1", [8]),
        ("not deadlock", [8]),
        ("start and b1", [8]),
    ):
        found = parts(net, parse_formula(goal))
        assert [len(part.places) for part, _ in found] == sizes, goal


def test_a_transition_without_places_keeps_a_net_together() -> None:
    net = beside(net_of("a", *RING), net_of("a", *RING))
    loose = replace(net, transitions=(*net.transitions, Transition("any")))
    assert len(parts(loose, Deadlock())) == 1


@examples(20)
@given(cell_nets(), cell_nets(), st.booleans())
def test_parts_reach_their_goals_exactly_if_the_whole_does(first: Net, second: Net, deadlock: bool) -> None:
    goals = [Holds(f"{net.places[-1].name}{i}") for i, net in enumerate((first, second))]
    goal = Deadlock() if deadlock else And((goals[0], Not(goals[1])))
    alone = [by_playing(net, of, Limits()).reachable for net, of in parts(beside(first, second), goal)]
    first_reaches = by_playing(first, Deadlock() if deadlock else Holds(first.places[-1].name), Limits()).reachable
    second_goal = Deadlock() if deadlock else Not(Holds(second.places[-1].name))
    assert all(alone) == (first_reaches and by_playing(second, second_goal, Limits()).reachable)


def test_parts_are_decided_one_by_one_and_their_witnesses_put_together() -> None:
    late = catalogue_net("one_robot_mc_late")
    alone = decide_reduced(late, Deadlock(), Limits(), by_playing)
    both = decide_reduced(beside(late, late), Deadlock(), Limits(), by_playing)
    assert both.reachable
    assert alone.witness is not None
    assert both.witness is not None
    assert "playing on 2 separate parts, after" in both.method
    assert alone.cost.markings is not None
    assert both.cost.markings == 2 * alone.cost.markings
    assert len(both.witness.firings) == 2 * len(alone.witness.firings)


def test_one_part_that_does_not_reach_its_goal_decides_and_one_that_is_undecided_leaves_it_open() -> None:
    late = catalogue_net("one_robot_mc_late")
    for answers, expected in (([None, False], False), ([True, None], None), ([None, True], None)):
        queue = list(answers)

        def next_of(net: Net, goal: Formula, limits: Limits, queue: list[bool | None] = queue) -> Finding:
            return Finding(queue.pop(0), "asking")

        assert decide_reduced(beside(late, late), Deadlock(), Limits(), next_of).reachable is expected


@examples(15)
@given(cell_nets())
def test_stubborn_sets_on_the_reduced_net_find_a_deadlock_exactly_if_there_is_one(net: Net) -> None:
    found = ByReduction(net)(Deadlock(), Limits())
    assert found.reachable is by_playing(net, Deadlock(), Limits()).reachable
    assert (found.witness is not None) is found.reachable


def test_walks_go_on_beside_what_has_no_room_and_all_that_gave_up_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    net, small = philosophers(60), Limits(memory_bytes=1 << 18)
    monkeypatch.setattr(deciding, "_WALKED_FIRST", 0)
    found = ByReduction(net)(Deadlock(), small)
    assert found.reachable
    assert found.method.startswith("random walk, after reduction")
    monkeypatch.setattr(deciding, "_WALKED_BESIDE", 3)
    left = ByReduction(net)(Deadlock(), small)
    assert left.reachable is None
    for name in ("stubborn sets", "diagram", "walk"):
        assert f"{name} gave up: " in left.bound


def test_a_certificate_for_the_reduced_net_is_none_for_the_original() -> None:
    def certified(net: Net, goal: Formula, limits: Limits) -> Finding:
        return Finding(False, "proving", certificate=InductiveInvariant())

    assert decide_reduced(catalogue_net("one_robot_mc_late"), Deadlock(), Limits(), certified).certificate is None


def test_a_wrong_witness_is_refused() -> None:
    def wrong(net: Net, goal: Formula, limits: Limits) -> Finding:
        return Finding(True, "guessing", Witness())

    with pytest.raises(WitnessError):
        decide_reduced(catalogue_net("one_robot_mc_late"), Deadlock(), Limits(), wrong)


@pytest.mark.parametrize("chunk", range(4))
def test_what_is_known_on_the_reduced_net_holds_of_the_original(chunk: int) -> None:
    known = 0
    for seed in range(40 * chunk, 40 * (chunk + 1)):
        net = lively_net(random.Random(seed), 9)
        report = check(net, method="explicit")
        for name, of in KnownByReduction(net)(Limits()).items():
            verdict = report.verdict(name)
            assert of.answer.holds is (verdict.status is Status.PROVED)
            assert set(of.answer.subjects) <= set(verdict.subjects)
            if of.answer.witness is not None:
                marking = Witnesses(net, Discipline.INTERLEAVING).play(
                    net.initial_marking,
                    [(net.transition_index[t],) for (t,) in of.answer.witness.firings],
                )
                assert Player(net).deadlocked(marking)
            known += 1
    assert known >= 40


@pytest.mark.parametrize("chunk", range(4))
def test_a_diagram_of_the_reduced_net_decides_what_exploration_decides(chunk: int) -> None:
    for seed in range(25 * chunk, 25 * (chunk + 1)):
        draw = random.Random(seed)
        net = lively_net(draw, 9)
        for goal in (Deadlock(), part_of(draw, net, draw.getrandbits(len(net.places)), 4)):
            found = decide_reduced(net, goal, Limits(), decide_by_diagram)
            assert found.reachable is by_playing(net, goal, Limits()).reachable


def test_a_deadlock_that_only_a_diagram_knows_comes_with_a_way_to_it() -> None:
    net = philosophers(8)
    found = decide_by_diagram(net, Deadlock(), Limits())
    assert found.reachable
    assert found.witness is not None
    marking = net.initial_marking
    for (name,) in found.witness.firings:
        marking = Player(net).fire(marking, [net.transition_index[name]])
    assert Player(net).deadlocked(marking)


def test_a_diagram_without_room_decides_nothing() -> None:
    found = decide_by_diagram(philosophers(8), Deadlock(), Limits(memory_bytes=1000))
    assert found.reachable is None
    assert found.bound


def test_a_net_that_was_not_read_in_time_is_left_undecided() -> None:
    late, wide = Limits(Deadline.after(0)), machines(600)
    found = ByReduction(wide)(Deadlock(), late)
    assert found.reachable is None
    assert found.bound == "the time was over before the net was read for its reduction"
    assert KnownByReduction(wide)(late) == {}


def test_a_net_that_was_reduced_once_is_searched_on_and_not_reduced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    net, reduced, asked = philosophers(5), list[str](), list[tuple[FiringSearch, Limits]]()
    found = FiringSearch.found

    def counted(net: Net, limits: Limits) -> ReducedTransitions:
        reduced.append(net.name)
        return reduce_for_liveness(net, limits)

    def noted(search: FiringSearch, limits: Limits, *, until_dead: bool) -> Firings:
        asked.append((search, limits))
        return found(search, limits, until_dead=until_dead)

    monkeypatch.setattr(deciding, "reduce_for_liveness", counted)
    monkeypatch.setattr(FiringSearch, "found", noted)
    knower, looks = KnownByReduction(net), [Limits(depth_max=1), Limits(depth_max=2)]
    known = [knower(limits) for limits in looks][-1]
    assert known["quasi-live"].answer.holds
    assert reduced == [net.name]
    assert asked == [(asked[0][0], limits) for limits in looks]


@pytest.mark.parametrize("alone", TECHNIQUES)
def test_each_technique_is_asked_in_the_reduced_net(monkeypatch: pytest.MonkeyPatch, alone: str) -> None:
    def gives_up(net: Net, goal: Formula, limits: Limits, **_: object) -> Finding:
        return Finding(None, "gives up", bound="nothing")

    monkeypatch.setattr(deciding, "_ALONE_FIRST", 1)
    for name in set(TECHNIQUES) - {alone}:
        monkeypatch.setattr(deciding, name, gives_up)
    met = parse_formula("counter.one0 and counter.one1 and counter.zero2")
    found = ByReduction(family_net("counter-17"))(met, Limits())
    assert found.reachable
    assert found.witness is not None
