"""A technique on the reduced net answers for the original one."""

from __future__ import annotations

import pytest
from support.naive_space import NaiveSpace
from support.small_text import net_of

from firable.analysis.evidence.certificate import InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.reduction.deciding import decide_reduced
from firable.analysis.spaces.space import WitnessError
from firable.nets.catalogue import catalogue_net
from firable.nets.formula import Deadlock, Formula, parse_formula
from firable.nets.net import Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.player import Player


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


def test_a_certificate_for_the_reduced_net_is_none_for_the_original() -> None:
    def certified(net: Net, goal: Formula, limits: Limits) -> Finding:
        return Finding(False, "proving", certificate=InductiveInvariant())

    assert decide_reduced(catalogue_net("one_robot_mc_late"), Deadlock(), Limits(), certified).certificate is None


def test_a_wrong_witness_is_refused() -> None:
    def wrong(net: Net, goal: Formula, limits: Limits) -> Finding:
        return Finding(True, "guessing", Witness())

    with pytest.raises(WitnessError):
        decide_reduced(catalogue_net("one_robot_mc_late"), Deadlock(), Limits(), wrong)
