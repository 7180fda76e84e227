"""Time limits in a split: the timer and the fault transition are the controller's own, also where others take part."""

import random
from dataclasses import replace

import pytest

from firable.analysis.check import check
from firable.decompose.bundling import make_bundle
from firable.decompose.proofs.assumptions import assumptions
from firable.decompose.proofs.deciders import deciders
from firable.decompose.proofs.proving import prove
from firable.decompose.proofs.sides import Sides
from firable.decompose.protocol.exploring import explore_protocol
from firable.decompose.protocol.outages import outages
from firable.decompose.protocol.parametric.side_conditions import side_conditions
from firable.decompose.splitting.cut import split
from firable.decompose.splitting.hypergraph import hypergraph
from firable.decompose.splitting.rules import owned_by_rules, rules_of_options
from firable.decompose.splitting.votes import votes
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.obligations import compared
from firable.decompose.verification.recut import check_cut
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.restating import HEADS
from firable.executor.simulation.drawn import drawn_timed_net
from firable.nets.bundle import Bundle
from firable.nets.catalogue import catalogue_net
from firable.nets.contention import contentions
from firable.nets.decomposition import Coordinated, Decomposition, Part
from firable.nets.diagnostics import InputError
from firable.nets.net import Net, TimeLimit
from firable.nets.right_to_run import unproved
from firable.nets.text import parse_net
from firable.nets.verdict import Status

HANDOVER = """\
firable: 1
cell: handover
controllers:
  a: {start: free, inputs: key, places: {free: , go: {send: {machine: A, command: GO}, until: there, within: 1s}}}
  b: {start: idle, places: {idle: , has: }}
transitions:
  start: {from: a.free, to: a.go}
  hand: {from: [a.go, b.idle], to: [a.free, b.has]}
  again: {from: a.go_fault, to: a.go, if: a.key}
  use: {from: b.has, to: b.idle}
"""


def handover() -> Net:
    return parse_net(HANDOVER)


def coordinated(decomposition: Decomposition) -> set[str]:
    return {row.name for row in decomposition.coordinated}


def test_a_fault_transition_is_left_to_its_controller_where_the_completion_is_waited_for_by_several() -> None:
    decomposition = split(handover())
    assert coordinated(decomposition) == {"hand"}
    assert "a.go_timeout" in decomposition.subnet("a").transition_index
    timed = split(catalogue_net("one_robot_timed"))
    assert not any(name.endswith("_timeout") for name in coordinated(timed))
    assert {"t1-e", "t1-f", "t1-g", "t1-h", "t1-i"} <= coordinated(timed), "each competes with a global one"


def test_a_timeout_into_a_place_that_is_filled_together_is_decided_with_that_and_dies_with_the_coordinator() -> None:
    filled = HANDOVER.replace(
        "use: {from: b.has, to: b.idle}", "drop: {from: [a.free, b.has], to: [a.go_fault, b.idle]}"
    )
    decomposition = split(parse_net(filled))
    assert "a.go_timeout" in coordinated(decomposition)
    assert prove(decomposition).holds
    (dead,) = (outage for outage in outages(decomposition) if outage.coordinator)
    assert "a.go_timeout" in dead.at_once


def test_nothing_is_assumed_of_the_machines_for_a_timeout() -> None:
    assert {str(one.signal) for one in assumptions(split(handover()))} == set()
    assert not any("timeout" in one.transition for one in assumptions(split(catalogue_net("one_robot_timed"))))


def test_a_timeout_takes_back_no_yes_that_rests_on_the_completion() -> None:
    (vote,) = [vote for vote in votes(split(handover())) if vote.controller == "a"]
    assert vote.accused == ()


@pytest.mark.parametrize("seed", range(25))
def test_the_split_of_a_net_with_time_limits_is_proved_and_stated_anew(seed: int) -> None:
    decomposition = split(drawn_timed_net(random.Random(seed), "timed"))
    proof = prove(decomposition)
    assert proof.holds, [v.name for v in proof.verdicts if not v.holds]
    examination = Examination(Bundle(decomposition, proof.verdicts, proof.files))
    cut = check_cut(decomposition)
    stated = [one.name for family in HEADS for one in compared(examination, cut, family)]
    assert stated == [v.name for v in proof.verdicts if not v.name.startswith("protocol.")]


def test_that_completion_and_timeout_exclude_each_other_is_an_obligation_of_o2() -> None:
    (own,) = [one for one in deciders(Sides(split(handover()))) if one.name == "o2.a.go"]
    assert own.statement.endswith("and none of them is open beside 'a.go_timeout'")


def test_a_fault_transition_that_the_coordinator_is_to_decide_is_another_split() -> None:
    decomposition = split(handover())
    row = Coordinated("a.go_timeout", None, (Part("a", "a.go_timeout"),))
    with pytest.raises(NotShownError, match="not the one that the net makes"):
        check_cut(replace(decomposition, coordinated=(*decomposition.coordinated, row)))


def test_what_waits_for_the_timeout_and_the_completion_never_fires_and_is_no_timeout() -> None:
    never = "  never: {from: a.go, to: b.more, if: a.go_overdue, unless: a.there}\n"
    decomposition = split(parse_net(HANDOVER.replace("has: }", "has: , more: }") + never))
    for net in (decomposition.net, replace(decomposition.net, transitions=decomposition.net.transitions[::-1])):
        faults = {net.places[p].name: net.transitions[t].name for p, t in net.fault_transitions.items()}
        assert faults == {"a.go": "a.go_timeout"}
    assert coordinated(decomposition) == {"hand", "never"}
    check_cut(decomposition)


def test_a_subnet_with_another_time_or_timer_is_refuted() -> None:
    decomposition = split(handover())
    subnet = decomposition.subnet("a")
    longer = replace(subnet.place("a.go"), within=TimeLimit(2000, "a.go_overdue"))
    places = tuple(longer if place.name == "a.go" else place for place in subnet.places)
    edited = replace(decomposition, subnets=(replace(subnet, places=places), *decomposition.subnets[1:]))
    assert {v.name for v in prove(edited).verdicts if v.status is Status.VIOLATED} == {"commands"}
    with pytest.raises(NotShownError, match="places differ"):
        check_cut(edited)
    renamed = parse_net(HANDOVER.replace("within: 1s", "within: {time: 1s, timer: slow}"))
    other = replace(decomposition, subnets=split(renamed).subnets)
    assert "protocol.side.gates" in {v.name for v in side_conditions(other) if v.status is Status.VIOLATED}


def test_the_protocol_of_a_net_with_time_limits_refines_and_loses_nothing() -> None:
    found = explore_protocol(handover())
    assert {verdict.status for verdict in found.verdicts} == {Status.PROVED}


def test_everything_in_the_bundle_of_the_timed_cell_is_shown() -> None:
    bundle = make_bundle(check(catalogue_net("one_robot_timed")))
    assert not unproved(bundle)
    assert all(one.shown for one in check_bundle(bundle))
    assert Bundle.from_bytes(bundle.to_bytes()).net == bundle.net


def test_a_place_its_timer_and_its_fault_place_stand_in_one_block() -> None:
    (block,) = [block for block in hypergraph(handover()).blocks if "a.go" in block]
    assert {"a.go", "a.there", "a.go_overdue", "a.go_fault"} <= set(block)


def test_timer_and_fault_place_follow_their_place_where_no_rule_speaks_of_them() -> None:
    owned = owned_by_rules(handover(), rules_of_options(["x=a.free,a.go,a.key", "y=b.*"]))
    assert owned.place("x.go_fault").owner == "x"
    assert owned.signal("x.go_overdue").owner == "x"
    assert owned.place("x.go").within == TimeLimit(1000, "x.go_overdue")


def test_a_controller_cannot_time_the_command_of_another_one() -> None:
    rules = rules_of_options(["x=a.free,a.go,a.go_fault,a.key,a.there", "y=b.*,a.go_overdue"])
    with pytest.raises(InputError) as caught:
        split(owned_by_rules(handover(), rules))
    assert [problem.code for problem in caught.value.diagnostics] == ["F4001"]
    assert "is timed by 'y.go_overdue'" in caught.value.diagnostics[0].message


def test_a_transition_that_reads_a_timer_contends_with_those_that_clear_it() -> None:
    text = HANDOVER.replace("to: a.go}\n  hand", "to: a.go, if: b.idle}\n  hand").replace("has: }", "has: , lamp: }")
    net = parse_net(text.replace("  use:", "  lit: {from: b.has, to: b.lamp, unless: a.go_overdue}\n  use:"))
    found = [one for one in contentions(net, {"start", "lit"}) if one.at == "a.go_overdue"]
    assert [(one.mover, one.reader) for one in found] == [("start", "lit")]
