"""The protocol as a net of its own: what holds of it on small nets and on the whole cell, with and without faults."""

from dataclasses import replace
from threading import Event
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.free_parts import GATE_CLOSED, OUTPUT_READ, freed, parts_of
from support.owned_nets import owned_nets
from support.reference import load_net
from support.timed_nets import timed_nets

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Limits
from firable.analysis.spaces.equivalence import branching_bisimilar
from firable.analysis.spaces.reachability import Budget, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.decompose.protocol import exploring
from firable.decompose.protocol.building import ProtocolNet, protocol_net
from firable.decompose.protocol.completeness import first_lost
from firable.decompose.protocol.divergence import not_falling, weights
from firable.decompose.protocol.exploring import Exploration, explore_protocol
from firable.decompose.protocol.variant import ANY_FAULTS, NO_FAULTS, ONE_OF_EACH, PROTOCOL, Faults, Often, Variant
from firable.decompose.splitting.cut import split
from firable.nets.catalogue import catalogue_net
from firable.nets.net import Controller, ExternalGate, Net, Place, Signal, Transition
from firable.nets.verdict import Status

SMALL = ["ring", "local_conflict", "local_output_conflict", "local_gate", "read_before_order", "remote_gate"]
A, B = Controller("a"), Controller("b")


def statuses(found: Exploration) -> set[Status]:
    return {verdict.status for verdict in found.verdicts}


def visible(protocol: ProtocolNet) -> dict[str, str]:
    return {name: step.fires for name, step in protocol.steps.items() if step.fires}


@pytest.mark.parametrize("name", SMALL)
def test_protocol_refines_and_loses_nothing(name: str) -> None:
    assert statuses(explore_protocol(load_net(name))) == {Status.PROVED}


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("faults", [ONE_OF_EACH, ANY_FAULTS], ids=["one of each", "any"])
def test_protocol_refines_and_loses_nothing_under_faults_with_restart(name: str, faults: Faults) -> None:
    found = explore_protocol(load_net(name), PROTOCOL, faults)
    assert {*(v.status for v in found.safety), found.complete.status, found.one_token.status} == {Status.PROVED}


@pytest.mark.parametrize("name", ["ring", "local_gate"])
def test_partition_refinement_finds_the_same_bisimulation(name: str) -> None:
    """By another technique: classes of all configurations, not the relation that the configurations carry."""
    net = load_net(name)
    found = explore_protocol(net)
    assert isinstance(found.space, ReachabilityGraph)
    labels = {t.name: t.name for t in net.transitions}
    central = explore(net)
    assert branching_bisimilar(found.space, central, visible(found.protocol), labels, divergence=False)
    assert not branching_bisimilar(found.space, central, visible(found.protocol), labels, divergence=True)


@pytest.mark.parametrize("faults", [NO_FAULTS, ONE_OF_EACH, ANY_FAULTS], ids=["none", "one of each", "any"])
@pytest.mark.parametrize("name", [*SMALL, "no_trouble"])
def test_protocol_with_free_parts_refines_and_loses_nothing(name: str, faults: Faults) -> None:
    found = explore_protocol(freed(split(load_net(name))), PROTOCOL, faults)
    assert {*(v.status for v in found.safety), found.complete.status, found.one_token.status} == {Status.PROVED}


@pytest.mark.parametrize("name", ["ring", "local_gate"])
def test_partition_refinement_finds_the_same_bisimulation_with_free_parts(name: str) -> None:
    decomposition = freed(split(load_net(name)))
    found = explore_protocol(decomposition)
    assert isinstance(found.space, ReachabilityGraph)
    labels = {t.name: t.name for t in decomposition.net.transitions}
    central = explore(decomposition.net)
    assert branching_bisimilar(found.space, central, visible(found.protocol), labels, divergence=False)


@pytest.mark.parametrize("net", [GATE_CLOSED, OUTPUT_READ], ids=["closed", "read"])
def test_part_that_is_free_and_may_not_be_is_refuted(net: Net) -> None:
    found = explore_protocol(parts_of(split(net), "t1-11"))
    assert found.refines is Status.VIOLATED
    assert found.counterexample is not None
    assert any("votes yes on G, and promises nothing" in event for event in found.events(found.counterexample))


def test_transition_of_free_parts_is_asked_of_nobody() -> None:
    protocol = protocol_net(freed(split(load_net("ring"))))
    kinds = {step.kind for step in protocol.steps.values()}
    assert kinds.isdisjoint({"ask", "request", "promise", "give-up", "release"})
    assert {"stand", "hear", "decide", "order", "apply", "note", "close"} <= kinds
    assert not any(name.startswith(("asked/", "promised/")) for name in protocol.net.place_index)


@examples(6)
@given(st.one_of(owned_nets(), timed_nets()))
def test_protocol_of_random_nets_with_free_parts_refines_and_loses_nothing(net: Net) -> None:
    deadline = Deadline.after(2)
    found = explore_protocol(freed(split(net)), limits=Limits(deadline))
    assert Status.VIOLATED not in statuses(found)
    assert found.space.bound or deadline.over or statuses(found) == {Status.PROVED}


def test_partition_refinement_and_closures_both_see_what_a_dead_controller_loses() -> None:
    net = load_net("ring")
    found = explore_protocol(net, PROTOCOL, Faults(crash=Often.ONCE, restart=False))
    assert isinstance(found.space, ReachabilityGraph)
    assert found.refines is Status.PROVED
    assert found.complete.status is Status.VIOLATED
    labels = {t.name: t.name for t in net.transitions}
    assert not branching_bisimilar(found.space, explore(net), visible(found.protocol), labels, divergence=False)


@pytest.mark.parametrize("held", ["table", "diagram"])
def test_what_only_a_firing_leads_back_to_is_lost(held: str) -> None:
    """A protocol that keeps to G once it has asked for it: l is lost, though G fires and all is quiet again."""
    whole = protocol_net(split(load_net("local_conflict")))
    kept = [
        replace(t, inhibitive=(*t.inhibitive, "asked/G")) if t.name.startswith("decide/l") else t
        for t in whole.net.transitions
        if whole.steps[t.name].kind != "give-up"
    ]
    protocol = replace(whole, net=replace(whole.net, transitions=tuple(kept)))
    space = explore(protocol.net) if held == "table" else _diagram(protocol)
    lost = Exploration(protocol, space).lost
    assert lost is not None
    assert lost.transition == "l"
    assert lost.witness.firings == (("ask/G",),)
    asked = protocol.net.marking(lost.witness.marking)
    assert space.contains(space.backward(space.satisfying(protocol.quiet)), asked)


def test_a_protocol_whose_hidden_steps_change_the_central_marking_is_not_judged() -> None:
    """All configurations are asked at once whether hidden steps lead home, which says nothing of such a protocol."""
    whole = protocol_net(split(load_net("ring")))
    moved = [
        replace(t, inputs=(*t.inputs, "central/c1.p")) if t.name == "give-up/G" else t for t in whole.net.transitions
    ]
    protocol = replace(whole, net=replace(whole.net, transitions=tuple(moved)))
    with pytest.raises(ValueError, match="hidden steps change the central marking: give-up/G"):
        first_lost(protocol, explore(protocol.net), Limits())


def test_whole_cell_is_explored_as_a_diagram_and_refines() -> None:
    found = explore_protocol(load_net("cell1"))
    assert statuses(found) == {Status.PROVED}
    assert found.space.n_markings > 10**33


def test_table_and_diagram_agree_on_the_protocol() -> None:
    net = load_net("local_gate")
    table = explore_protocol(net)
    diagram = replace(table, space=_diagram(table.protocol))
    assert [(v.name, v.status) for v in table.verdicts] == [(v.name, v.status) for v in diagram.verdicts]
    assert table.space.n_markings == diagram.space.n_markings


def _diagram(protocol: ProtocolNet) -> StateSpace[Any]:
    return explore_symbolically(protocol.net, orders=protocol.orders)


def test_each_transition_is_one_step_and_fires_at_most_one_transition_of_the_central_net() -> None:
    net = load_net("cell1")
    protocol = protocol_net(split(net), PROTOCOL, ANY_FAULTS)
    assert set(protocol.steps) == {t.name for t in protocol.net.transitions}
    assert {step.fires for step in protocol.steps.values()} - {""} == {t.name for t in net.transitions}
    assert all(protocol.firing[t.name] for t in net.transitions)


def test_hidden_steps_leave_the_copy_of_the_central_marking_alone() -> None:
    protocol = protocol_net(split(load_net("cell1")), PROTOCOL, ANY_FAULTS)
    for i in protocol.hidden:
        t = protocol.net.transitions[i]
        assert not any(place.startswith("central/") for place in (*t.inputs, *t.outputs)), t.name


def test_only_repeating_and_giving_up_can_go_on_for_ever() -> None:
    protocol = protocol_net(split(load_net("cell1")))
    assert not_falling(protocol) == ()
    weight = weights(protocol)
    assert weight["request/G2/c1"] > weight["promised/G2/c1"] + weight["vote/G2/c1"]


def test_step_that_undoes_nothing_of_its_own_is_seen_as_endless() -> None:
    """A hidden step added to the net, which no weight lowers, is named."""
    protocol = protocol_net(split(load_net("ring")))
    idle = Transition("promise/G/c1/idle", (), (), ("asked/G",))
    steps = {**protocol.steps, idle.name: protocol.steps["promise/G/c1"]}
    net = replace(protocol.net, transitions=(*protocol.net.transitions, idle))
    assert not_falling(replace(protocol, net=net, steps=steps)) == (idle.name,)


def test_firing_that_changes_no_marking_is_not_taken_for_a_hidden_step() -> None:
    """`idle` reads gates alone and changes no marking; what is closed must still not go through it."""
    places = (Place("a.p", "a", marked=True), Place("b.q", "b", marked=True))
    idle = Transition("idle", permissive=("a.p", "b.q"))
    net = Net("n", places, (idle, Transition("l", ("a.p",))), (), (A, B))
    assert statuses(explore_protocol(net)) == {Status.PROVED}


def test_net_without_coordinated_transitions_is_its_own_protocol() -> None:
    net = Net("n", (Place("a.p", "a", marked=True),), (Transition("l", ("a.p",)),), (), (A,))
    found = explore_protocol(net)
    assert statuses(found) == {Status.PROVED}
    assert found.space.n_markings == 2


def test_transition_that_no_valuation_opens_has_no_steps() -> None:
    torn = (ExternalGate("b.s"), ExternalGate("b.s", wanted=False))
    transition = Transition("G", ("a.p",), external=torn)
    net = Net("n", (Place("a.p", "a", marked=True),), (transition,), (Signal("b.s", "b"),), (A, B))
    assert protocol_net(split(net)).net.transitions == ()


def test_contact_of_the_central_net_is_no_fault_of_the_protocol() -> None:
    """G would fill a.e, which is full: contact in the central net, and in its protocol nothing worse."""
    places = (Place("a.p", "a", marked=True), Place("a.e", "a", marked=True), Place("b.q", "b", marked=True))
    net = Net("n", places, (Transition("G", ("a.p", "b.q"), ("a.e",)), Transition("l", ("a.e",))), (), (A, B))
    assert statuses(explore_protocol(net)) == {Status.PROVED}


def test_search_that_ends_early_leaves_everything_unknown_but_what_needs_no_search() -> None:
    found = explore_protocol(load_net("ring"), budget=Budget(50))
    assert found.refines is Status.UNKNOWN
    assert {found.complete.status, found.one_token.status} == {Status.UNKNOWN}
    assert found.divergence.status is Status.PROVED


def test_orders_of_places_are_permutations_and_the_second_keeps_groups_together() -> None:
    protocol = protocol_net(split(catalogue_net("one_robot_mc_late")))
    orders = protocol.orders
    assert all(sorted(order) == list(range(len(protocol.net.places))) for order in orders)
    assert len(orders) == 2
    names = [[protocol.net.places[p].name for p in reversed(order)] for order in orders]
    asked = [[name for name in some if name.startswith("asked/")] for some in names]
    assert asked[0] == [f"asked/G{n}" for n in range(1, 10)]
    assert asked[1] == [f"asked/G{n}" for n in (1, 2, 6, 3, 4, 5, 8, 7, 9)]


def test_cell_without_the_capacity_of_its_machine_is_explored_where_groups_stand_together() -> None:
    found = explore_protocol(catalogue_net("one_robot_mc_late"))
    assert statuses(found) == {Status.PROVED}
    assert found.space.n_markings > 10**32


def test_diagram_that_is_not_found_in_time_is_what_the_bound_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    cancelled = Event()

    def given_up(*_: object, **__: object) -> None:
        cancelled.set()
        raise BudgetExceeded("no longer needed")

    monkeypatch.setattr(exploring, "explore_symbolically", given_up)
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    found = explore_protocol(load_net("ring"), limits=Limits(Deadline(cancelled=cancelled)))
    for verdict in (*found.safety, found.complete, found.one_token):
        assert verdict.status is Status.UNKNOWN
        assert verdict.bound.startswith("no decision diagram: the time was over after ")
        assert verdict.bound.endswith("; a table held 50 markings")
        assert verdict.hint == exploring.MORE_TIME


def test_diagram_that_is_too_large_asks_for_memory_and_not_for_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exploring, "FIRST_MARKINGS", 50)
    found = explore_protocol(load_net("ring"), limits=Limits(memory_bytes=2**14))
    assert {(verdict.status, verdict.hint) for verdict in found.safety} == {(Status.UNKNOWN, exploring.MORE_MEMORY)}


def test_memory_without_room_for_the_central_net_leaves_open_whether_anything_is_lost() -> None:
    found = explore_protocol(load_net("ring"), limits=Limits(memory_bytes=1))
    assert found.complete.status is Status.UNKNOWN
    assert "1 bytes does not hold the net itself" in found.complete.bound
    assert statuses(found) == {Status.PROVED, Status.UNKNOWN}, "the rest is asked of the protocol alone"


def test_votes_that_are_no_promises_need_the_bare_skeleton() -> None:
    from firable.decompose.protocol.variant import Votes

    with pytest.raises(ValueError, match="bare"):
        Variant(Votes.FRESH)


def test_no_faults_add_no_steps() -> None:
    decomposition = split(load_net("ring"))
    quiet = protocol_net(decomposition, PROTOCOL, NO_FAULTS)
    assert not any(step.kind in {"lose", "crash", "double"} for step in quiet.steps.values())
    assert len(protocol_net(decomposition, PROTOCOL, ANY_FAULTS).net.transitions) > len(quiet.net.transitions)


@examples(6)
@given(st.one_of(owned_nets(), timed_nets()))
def test_protocol_of_random_nets_refines_and_loses_nothing(net: Net) -> None:
    deadline = Deadline.after(2)
    found = explore_protocol(net, limits=Limits(deadline))
    assert Status.VIOLATED not in statuses(found)
    assert found.space.bound or deadline.over or statuses(found) == {Status.PROVED}


@examples(12)
@given(owned_nets(), st.sampled_from([NO_FAULTS, Faults(crash=Often.ONCE, restart=False)]))
def test_closures_and_partition_refinement_agree_on_random_nets(net: Net, faults: Faults) -> None:
    """What has fired determines the central marking, so what is lost keeps any relation from being a bisimulation."""
    found = explore_protocol(net, PROTOCOL, faults, budget=Budget(2_000))
    central = explore(net, budget=Budget(2_000))
    if not (found.space.complete and central.complete and isinstance(found.space, ReachabilityGraph)):
        return
    labels = {t.name: t.name for t in net.transitions}
    bisimilar = branching_bisimilar(found.space, central, visible(found.protocol), labels, divergence=False)
    assert bisimilar == (found.refines is found.complete.status is Status.PROVED)
