"""Siphons and traps against all sets of places; the deadlock-trap argument against the reachability graph."""

from __future__ import annotations

from itertools import chain, combinations, count

import pytest
import z3
from hypothesis import example, given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.deadline import Deadline
from firable.analysis.structure.commoner import commoner, deadlock_trap
from firable.analysis.structure.ordinary import markable, ordinary
from firable.analysis.structure.siphons import (
    largest_siphon,
    minimal_siphons,
    minimal_traps,
)
from firable.cli.structure import structure_json
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.nets.verdict import Status
from firable.semantics.player import Player
from firable.semantics.trace import Discipline

NETS = st.one_of(dense_nets(), ring_nets())
READING_EACH_OTHER = Net(  # both leave together in one step, and then neither can go back
    "reading",
    (Place("a", marked=True), Place("b"), Place("c", marked=True), Place("d")),
    (
        Transition("out1", ("a",), ("b",), permissive=("c",)),
        Transition("out2", ("c",), ("d",), permissive=("a",)),
        Transition("back1", ("b",), ("a",), permissive=("c",)),
        Transition("back2", ("d",), ("c",), permissive=("a",)),
    ),
)


def subsets(net: Net) -> list[frozenset[str]]:
    names = [place.name for place in net.places]
    return [frozenset(s) for s in chain.from_iterable(combinations(names, n) for n in range(len(names) + 1))]


def may_ever_fire(t: Transition) -> bool:
    return t.openable and not {*t.inputs, *t.permissive} & {*t.outputs, *t.inhibitive}


def is_siphon(net: Net, places: frozenset[str]) -> bool:
    """Who puts a token into it takes or reads one in it."""
    return all(
        places & {*t.inputs, *t.permissive} for t in net.transitions if places & set(t.outputs) and may_ever_fire(t)
    )


def is_trap(net: Net, places: frozenset[str]) -> bool:
    """Who takes a token from it puts one into it or leaves one there that it reads."""
    return all(
        places & {*t.outputs, *(set(t.permissive) - set(t.inputs))}
        for t in net.transitions
        if places & set(t.inputs) and may_ever_fire(t)
    )


def minimal(sets: list[frozenset[str]]) -> set[frozenset[str]]:
    return {s for s in sets if s and not any(other < s for other in sets if other)}


@examples(30)
@given(NETS)
def test_minimal_siphons_and_traps_are_those_among_all_sets_of_places(net: Net) -> None:
    siphons, traps = minimal_siphons(net), minimal_traps(net)
    assert siphons.complete
    assert traps.complete
    assert {frozenset(s) for s in siphons.minimal} == minimal([s for s in subsets(net) if is_siphon(net, s)])
    assert {frozenset(s) for s in traps.minimal} == minimal([s for s in subsets(net) if is_trap(net, s)])


@examples(30)
@given(NETS)
def test_the_largest_siphon_is_the_union_of_all_within(net: Net) -> None:
    for places in subsets(net)[:16]:
        inside = [s for s in subsets(net) if s <= places]
        siphon = frozenset[str]().union(*(s for s in inside if is_siphon(net, s)))
        assert set(net.names(largest_siphon(net, net.marking(places)))) == siphon


@examples(40)
@given(ring_nets(signals=True))
def test_where_the_premises_hold_the_property_excludes_deadlock(net: Net) -> None:
    report = check(net)
    found = deadlock_trap(net, contact_free=report.verdict("contact-free").holds)
    marked = [s for s in subsets(net) if is_trap(net, s) and net.marking(s) & net.initial_marking]
    assert found.holds == all(any(trap <= s for trap in marked) for s in subsets(net) if s and is_siphon(net, s))
    if found.excludes_deadlock:
        assert report.verdict("deadlock-free").status is Status.PROVED


@pytest.mark.parametrize("name", reference_names())
def test_an_empty_siphon_stays_empty_and_a_marked_trap_marked_in_every_reference_net(name: str) -> None:
    net = load_net(name)
    graph = Player(net).reachable()
    for siphon in minimal_siphons(net).minimal:
        mask = net.marking(siphon)
        assert not any(not m & mask and target & mask for m, edges in graph.items() for _, target in edges)
    for trap in minimal_traps(net).minimal:
        mask = net.marking(trap)
        assert not any(m & mask and not target & mask for m, edges in graph.items() for _, target in edges)


def test_the_cell_is_proved_free_of_deadlock_and_the_late_one_shows_the_siphon_that_runs_empty() -> None:
    safe = deadlock_trap(load_net("cell1"), contact_free=True)
    late = deadlock_trap(load_net("cell1_mc_late"), contact_free=True)
    assert safe.excludes_deadlock
    assert not late.holds
    net = load_net("cell1_mc_late")
    (deadlock,) = (marking for marking, edges in Player(net).reachable().items() if not edges)
    assert any(not net.marking(siphon) & deadlock for siphon in late.without_marked_trap)


@examples(30)
@given(ring_nets(signals=True))
@example(READING_EACH_OTHER)
def test_under_steps_the_property_excludes_deadlock_only_without_reads(net: Net) -> None:
    report = check(net, Discipline.STEP)
    contact_free = report.verdict("contact-free").holds
    found = deadlock_trap(net, contact_free=contact_free, discipline=Discipline.STEP)
    if found.excludes_deadlock:
        assert report.verdict("deadlock-free").status is Status.PROVED


def test_two_that_take_what_the_other_reads_run_a_marked_trap_empty_in_one_step() -> None:
    net = READING_EACH_OTHER
    assert deadlock_trap(net, contact_free=True).excludes_deadlock
    assert check(net).verdict("deadlock-free").status is Status.PROVED
    assert check(net, Discipline.STEP).verdict("deadlock-free").status is Status.VIOLATED
    assert not deadlock_trap(net, contact_free=True, discipline=Discipline.STEP).excludes_deadlock
    for discipline, excluded in (("interleaving", True), ("step", False)):
        found = structure_json(net, contact_free=True, seconds=None, discipline=discipline)
        assert found["siphons_exclude_deadlock"] is excluded


def test_inhibitive_gates_and_contact_are_missing_premises() -> None:
    ring = (Transition("t", ("p",), ("q",)), Transition("u", ("q",), ("p",)))
    places = (Place("p", marked=True), Place("q"))
    assert deadlock_trap(Net("n", places, ring), contact_free=True).excludes_deadlock
    assert not deadlock_trap(Net("n", places, ring)).excludes_deadlock
    gated = Net("n", (*places, Place("r", marked=True)), (Transition("t", ("p",), ("q",), inhibitive=("r",)), ring[1]))
    found = deadlock_trap(gated, contact_free=True)
    assert found.holds
    assert not found.excludes_deadlock
    assert check(gated).figures.deadlocks == 1
    assert not deadlock_trap(Net("n", places), contact_free=True).excludes_deadlock


def test_past_the_bound_on_their_number_the_list_is_said_to_be_incomplete() -> None:
    net = load_net("cell1")
    whole, part = minimal_siphons(net), minimal_siphons(net, most=5)
    assert whole.complete
    assert not part.complete
    assert len(part.minimal) == 5
    assert set(part.minimal) < set(whole.minimal)
    assert deadlock_trap(net, contact_free=True, most=5).holds  # which needs no list
    assert minimal_siphons(net, most=len(whole.minimal)).complete


def test_a_solver_that_gives_up_leaves_the_list_incomplete(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(z3.Solver, "check", lambda _: z3.unknown)
    assert not minimal_siphons(load_net("fig2a")).complete
    assert not deadlock_trap(load_net("fig2a"), contact_free=True).holds


def test_one_deadline_ends_all_questions_together_and_what_was_found_till_then_is_true(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    net, clock = load_net("cell1"), count()
    whole = minimal_siphons(net)
    monkeypatch.setattr("firable.analysis.deadline.monotonic", lambda: float(next(clock)))
    part = minimal_siphons(net, deadline=Deadline.after(20))
    assert not part.complete
    assert 0 < len(part.minimal) < len(whole.minimal)
    assert set(part.minimal) < set(whole.minimal)
    assert not deadlock_trap(net, contact_free=True, deadline=Deadline.after(20)).holds
    assert not minimal_traps(net, deadline=Deadline.after(0)).complete


def test_siphons_that_the_deadline_leaves_unread_prove_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    net = load_net("cell1")
    found = minimal_siphons(net)
    assert found.complete
    monkeypatch.setattr("firable.analysis.structure.siphons.minimal_siphons", lambda *_, **__: found)
    assert deadlock_trap(net, contact_free=True).excludes_deadlock
    assert not deadlock_trap(net, contact_free=True, deadline=Deadline.after(0)).excludes_deadlock


def test_ctrl_c_that_the_solver_took_for_itself_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(z3.Solver, "check", lambda _: z3.unknown)
    monkeypatch.setattr(z3.Solver, "reason_unknown", lambda _: "interrupted from keyboard")
    with pytest.raises(KeyboardInterrupt):
        minimal_siphons(load_net("fig2a"))


def test_a_permissive_gate_is_a_read_of_which_the_argument_holds() -> None:
    places = (Place("p", marked=True), Place("q"), Place("r", marked=True))
    ring = (Transition("t", ("p",), ("q",), permissive=("r",)), Transition("u", ("q",), ("p",)))
    net = Net("n", places, ring)
    assert deadlock_trap(net, contact_free=True).excludes_deadlock
    assert check(net).figures.deadlocks == 0
    taken = Net("n", places, (*ring, Transition("v", ("r",), ())))
    assert not deadlock_trap(taken, contact_free=True).holds
    assert check(taken).figures.deadlocks == 1


def test_transitions_that_contradict_themselves_take_no_part() -> None:
    places = (Place("p", marked=True), Place("q", marked=True))
    for dead in (
        Transition("t", ("p",), ("p",)),
        Transition("t", ("p",), (), permissive=("q",), inhibitive=("q",)),
        Transition("t", ("p",), (), external=(ExternalGate("s", True), ExternalGate("s", False))),
    ):
        assert deadlock_trap(Net("n", places, (dead,), (Signal("s"),)), contact_free=True).premises
        going = Transition("u", ("p",), ("q",)), Transition("v", ("q",), ("p",))
        net = Net("n", (Place("p", marked=True), Place("q")), (dead, *going), (Signal("s"),))
        assert deadlock_trap(net, contact_free=True).excludes_deadlock
        assert check(net).figures.deadlocks == 0


SIPHON_WITH_AN_EMPTY_TRAP = Net(
    "n",
    (Place("p", marked=True), Place("q")),
    (Transition("t", ("p",)), Transition("u", (), ("p",), ("q",)), Transition("v", (), ("q",), ("p",))),
)


@examples(30)
@given(NETS)
@example(SIPHON_WITH_AN_EMPTY_TRAP)
def test_exclusion_and_ranks_decide_the_property_as_all_sets_of_places_do(net: Net) -> None:
    of = ordinary(net)
    siphons = [s for s in subsets(net) if s and is_siphon(net, s)]
    marked = [s for s in subsets(net) if is_trap(net, s) and net.marking(s) & net.initial_marking]
    expected = all(any(trap <= s for trap in marked) for s in siphons)
    found = commoner(of)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("firable.analysis.structure.commoner.EXCLUDED_MAX", 0)
        by_ranks = commoner(of)
    assert found.holds is by_ranks.holds is expected
    for answer in (found, by_ranks):
        bare = frozenset(net.places[p].name for p in answer.bare)
        assert bool(bare) is not expected
        assert not bare or (bare in siphons and not any(trap <= bare for trap in marked))
    traps = [frozenset(net.places[p].name for p in trap) for trap in found.traps]
    assert all(trap in marked for trap in traps)
    assert not expected or all(any(trap <= s for trap in traps) for s in siphons)


@examples(30)
@given(NETS)
def test_places_that_cannot_be_marked_are_the_largest_siphon_that_is_empty_and_stay_so(net: Net) -> None:
    never = set(range(len(net.places))) - markable(ordinary(net))
    empty = [s for s in subsets(net) if is_siphon(net, s) and not net.marking(s) & net.initial_marking]
    assert {net.places[p].name for p in never} == set().union(*empty)
    assert not any(marking >> p & 1 for marking in Player(net).reachable() for p in never)


def test_parallel_sections_with_exponentially_many_siphons_are_decided() -> None:
    n = 10
    places = [Place("d0", marked=True), *(Place(f"{side}{i}") for i in range(n) for side in "bc")]
    places += [Place(f"d{i}") for i in range(1, n)]
    moves = []
    for i in range(n):
        moves.append(Transition(f"fork{i}", (f"d{i}",), (f"b{i}", f"c{i}")))
        moves.append(Transition(f"join{i}", (f"b{i}", f"c{i}"), (f"d{(i + 1) % n}",)))
    net = Net("n", tuple(places), tuple(moves))
    assert len(minimal_siphons(net, most=200).minimal) == 200
    assert deadlock_trap(net, contact_free=True, most=10).excludes_deadlock
