"""Theorems on net classes against exploration: whatever a theorem says is so, and where it is an "iff" it says it."""

from __future__ import annotations

from threading import Event

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.classed_nets import free_choice_nets, marked_graphs, state_machines
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets

from firable.analysis.check import check
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.question import Known
from firable.analysis.structure.contact import contact_proof
from firable.analysis.structure.net_class import extended_free_choice
from firable.analysis.structure.ordinary import ordinary
from firable.analysis.structure.theorems import decide_by_class
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.nets.verdict import Status

STATUS = {True: Status.PROVED, False: Status.VIOLATED}


def confirmed(net: Net) -> dict[str, Known]:
    """What theorems say of the net, after exploration has said the same."""
    known, report = dict(decide_by_class(net, Limits())), check(net)
    for name, found in known.items():
        assert found.answer.holds is not None
        assert report.verdict(name).status is STATUS[found.answer.holds], (name, found)
        if subjects := set(found.answer.subjects):
            assert subjects <= set((report.figures.nonlive if name == "live" else report.figures.dead) or ())
    return known


def says(net: Net) -> dict[str, bool | None]:
    return {name: known.answer.holds for name, known in confirmed(net).items()}


def built(text: str, marked: str, *more: Transition) -> Net:
    """Transitions as `ab>c`, one letter for each place; a letter on both sides is a read."""
    pairs = [tuple(map(set, arcs.split(">"))) for arcs in text.split()]
    names = sorted(set().union(*(a | b for a, b in pairs)) | set(marked))
    moves = [
        Transition(f"t{i}", tuple(sorted(a - b)), tuple(sorted(b - a)), tuple(sorted(a & b)))
        for i, (a, b) in enumerate(pairs)
    ]
    return Net("n", tuple(Place(p, marked=p in marked) for p in names), (*moves, *more), (Signal("s"),))


@examples(40)
@given(state_machines())
def test_state_machines_with_one_token_each_are_decided_in_full(net: Net) -> None:
    found = says(net)
    if "reversible" in found and len(ordinary(net).transitions) == len(net.transitions):
        assert {"contact-free", "quasi-live", "live", "reversible", "home-markings"} <= found.keys()
        assert ("deadlock-free" in found) == check(net).verdict("deadlock-free").holds


@examples(40)
@given(marked_graphs())
def test_marked_graphs_are_live_iff_every_circuit_holds_a_token(net: Net) -> None:
    found = says(net)
    if contact_proof(net, NEVER).whole:
        assert "live" in found
        assert not found["live"] or found["reversible"]


@examples(50)
@given(free_choice_nets())
@example(built("a>bc b>d c>e de>a", "a"))
@example(built("a>b a>c bc>a", "a"))
@example(built("ax>bx b>a", "ax"))
def test_safe_free_choice_nets_are_live_iff_every_siphon_contains_a_marked_trap(net: Net) -> None:
    found, of = says(net), ordinary(net)
    free = not of.inhibited and extended_free_choice(of.inputs, of.consumers)
    if free and contact_proof(net, NEVER).behaves and of.transitions:
        assert "live" in found
        assert found["live"] is False or "reversible" in found


@examples(50)
@given(st.one_of(ring_nets(signals=True), dense_nets(most_transitions=3, signals=True)))
def test_whatever_a_theorem_says_of_any_net_exploration_confirms(net: Net) -> None:
    confirmed(net)


@pytest.mark.parametrize("name", reference_names())
def test_whatever_a_theorem_says_of_a_reference_net_exploration_confirms(name: str) -> None:
    confirmed(load_net(name))


@pytest.mark.parametrize(
    ("net", "method", "name", "holds"),
    [
        (built("a>b b>a", "a"), "state machines", "live", True),
        (built("a>b b>a b>c c>b", "c"), "state machines", "reversible", True),
        (built("a>b b>c c>b", "a"), "state machines", "reversible", False),
        (built("a>b b>c c>b", "a"), "state machines", "home-markings", True),
        (built("a>b a>c", "a"), "state machines", "home-markings", False),
        (built("a>b b>a c>d", "ac"), "state machines", "deadlock-free", True),
        (built("a>bc b>d c>e de>a", "a"), "marked graphs", "live", True),
        (built("a>bc b>d c>e de>a", "a"), "marked graphs", "reversible", True),
        (built("a>bc b>d b>d c>e de>a", "a"), "free-choice", "live", True),
        (built("a>bc b>d b>d c>e de>a", "a"), "live and safe free-choice", "reversible", True),
        (built("a>b a>c bc>a", "a"), "free-choice", "live", False),
        (built("ac>b b>ac ae>f f>ae", "ace"), "asymmetric", "live", True),
    ],
)
def test_each_theorem_decides_its_nets(net: Net, method: str, name: str, holds: bool) -> None:
    known = confirmed(net)[name]
    assert known.answer.holds is holds
    assert method in known.method


def test_the_cell_is_live_by_commoner_and_the_late_one_is_left_open() -> None:
    assert says(load_net("cell1"))["live"] is True
    assert "deadlock-free" not in says(load_net("cell1_mc_late"))


def test_a_violation_names_the_siphon_or_trap_that_shows_it() -> None:
    known = confirmed(built("a>b a>c bc>a", "a"))
    assert "the siphon of a, b contains no marked trap" in known["live"].answer.hint


def test_a_place_without_arcs_concerns_nobody() -> None:
    for ring in ("a>bc b>d c>e de>a", "a>bc b>d b>d c>e de>a"):
        whole = built(ring, "a")
        net = Net("n", (*whole.places, Place("unused")), whole.transitions, whole.signals)
        found = says(net)
        assert (found["live"], found["reversible"]) == (True, True)


def test_two_choices_that_must_agree_fail_the_rank_theorem_though_invariants_cover_them() -> None:
    net = built("a>b a>c d>e d>f be>ad cf>ad", "ad")
    assert says(net)["live"] is False


def test_the_rank_theorem_alone_makes_no_empty_net_live() -> None:
    assert says(built("a>bc b>d b>d c>e de>a", ""))["live"] is False


def test_inhibitive_gates_and_contact_keep_the_theorems_away() -> None:
    ring = "a>bc b>d c>e de>a"
    gated = built(ring, "a", Transition("u", ("a",), ("b",), inhibitive=("e",)))
    assert "live" not in says(gated)
    crowded = built("a>bc b>d c>e de>a", "ab")
    assert says(crowded) == {}


def test_external_gates_change_nothing_and_a_transition_that_contradicts_itself_is_dead_but_no_deadlock() -> None:
    gate, never = ExternalGate("s"), (ExternalGate("s", True), ExternalGate("s", False))
    free = says(built("a>bc b>d c>e de>a", "a", Transition("u", ("a",), ("b", "c"), external=(gate,))))
    assert (free["live"], free["deadlock-free"]) == (True, True)
    held = confirmed(built("a>bc b>d c>e de>a", "a", Transition("u", ("a",), ("b", "c"), external=never)))
    assert held["live"].answer.subjects == held["quasi-live"].answer.subjects == ("u",)
    assert (held["deadlock-free"].answer.holds, held["reversible"].answer.holds) == (True, True)


def test_parallel_sections_are_live_by_the_rank_theorem_whatever_their_number() -> None:
    """Each section chooses how it does its left part: 3 ** 100 siphons and more."""
    n, moves = 100, []
    for i in range(n):
        moves += [Transition(f"fork{i}", (f"d{i}",), (f"b{i}", f"c{i}"))]
        moves += [Transition(f"way{i}{k}", (f"b{i}",), (f"e{i}",)) for k in range(2)]
        moves += [Transition(f"join{i}", (f"e{i}", f"c{i}"), (f"d{(i + 1) % n}",))]
    places = tuple(Place(f"{letter}{i}", marked=f"{letter}{i}" == "d0") for i in range(n) for letter in "bcde")
    found = decide_by_class(Net("n", places, tuple(moves)), Limits())
    assert {name: known.answer.holds for name, known in found.items()} == dict.fromkeys(
        ("contact-free", "live", "quasi-live", "deadlock-free", "doomed-markings", "home-markings", "reversible"), True
    )


def test_a_limit_or_a_flag_leaves_the_verdicts_out() -> None:
    flag = Event()
    flag.set()
    assert decide_by_class(load_net("cell1"), Limits(Deadline(cancelled=flag))) == {}
    assert decide_by_class(load_net("cell1"), Limits(Deadline.after(0))) == {}


def test_the_empty_net_is_left_to_others() -> None:
    assert decide_by_class(Net("empty"), Limits()) == {}
