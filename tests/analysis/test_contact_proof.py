"""Contact excluded by invariants: never where exploration finds one, with a certificate that is inductive."""

from __future__ import annotations

from threading import Event

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.inductive import check_finding
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.goal import Limits
from firable.analysis.structure.contact import contact_proof, decide_contact_by_invariants
from firable.analysis.verdicts.goals import in_contact_formula
from firable.nets.catalogue import catalogue_net
from firable.nets.formula import Or
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player


@examples(75)
@given(st.one_of(ring_nets(signals=True), dense_nets(most_transitions=3)))
def test_where_contact_is_excluded_no_marking_is_in_contact_and_the_certificate_shows_it(net: Net) -> None:
    found = decide_contact_by_invariants(net, Limits())
    check_finding(net, Or(tuple(in_contact_formula(t) for t in net.transitions)), found)
    player, fires = Player(net), {t for t, transition in enumerate(net.transitions) if not transition.self_loops}
    if contact_proof(net, NEVER).behaves:
        assert not any(set(player.in_contact(marking)) & fires & can_fire(net) for marking in player.reachable())


def can_fire(net: Net) -> set[int]:
    return {
        i
        for i, t in enumerate(net.transitions)
        if t.openable and not {*t.inputs, *t.permissive} & {*t.outputs, *t.inhibitive}
    }


@pytest.mark.parametrize("name", reference_names())
def test_the_cells_are_contact_free_by_units_and_what_is_not_is_left_open(name: str) -> None:
    net = load_net(name)
    player = Player(net)
    in_contact = any(player.in_contact(marking) for marking in player.reachable())
    found = decide_contact_by_invariants(net, Limits())
    assert found.reachable in ((None,) if in_contact else (False, None))
    if name.startswith(("cell", "conceptual")):
        assert found.reachable is False


def test_a_weighted_inequality_excludes_what_no_unit_does() -> None:
    """Two tokens start, one of which a second place may need: p holds what q and r hold together."""
    net = Net(
        "n",
        (Place("p", marked=True), Place("q"), Place("r"), Place("s")),
        (
            Transition("split", ("p",), ("q", "r")),
            Transition("left", ("q",), ("s",)),
            Transition("join", ("r", "s"), ("p",)),
            Transition("once", ("r",), ()),
        ),
    )
    found = decide_contact_by_invariants(net, Limits())
    check_finding(net, Or(tuple(in_contact_formula(t) for t in net.transitions)), found)
    assert found.reachable is False
    assert contact_proof(net, NEVER).inequalities


def test_a_reachable_contact_and_an_over_full_buffer_are_left_open() -> None:
    net = Net(
        "n",
        (Place("p", marked=True), Place("q", marked=True)),
        (Transition("t", ("p",), ("q",)), Transition("u", ("q",))),
    )
    found = decide_contact_by_invariants(net, Limits())
    assert found.reachable is None
    assert found.bound == "contact at t with q is not excluded"


def test_a_transition_that_contradicts_itself_can_be_in_contact() -> None:
    """It never fires, so the net behaves as an ordinary one, but its full output place is a contact all the same."""
    net = Net(
        "n",
        (Place("p", marked=True), Place("q", marked=True), Place("r")),
        (Transition("loop", ("p",), ("p", "q")), Transition("t", ("p",), ("r",))),
    )
    proof = contact_proof(net, NEVER)
    assert (proof.whole, proof.behaves) == (False, True)
    assert decide_contact_by_invariants(net, Limits()).reachable is None
    assert Player(net).in_contact(net.initial_marking) == (0,)


def test_thousands_of_places_are_a_matter_of_units_and_the_flag_ends_the_search() -> None:
    n = 1_000
    places = [Place(f"{kind}{i}", marked=kind in "ft") for i in range(n) for kind in "ftle"]
    moves = []
    for i in range(n):
        other = (i + 1) % n
        moves.append(Transition(f"left{i}", (f"f{i}", f"t{i}"), (f"l{i}",)))
        moves.append(Transition(f"right{i}", (f"l{i}", f"f{other}"), (f"e{i}",)))
        moves.append(Transition(f"done{i}", (f"e{i}",), (f"t{i}", f"f{i}", f"f{other}")))
    net = Net("n", tuple(places), tuple(moves))
    assert decide_contact_by_invariants(net, Limits()).reachable is False
    flag = Event()
    flag.set()
    found = decide_contact_by_invariants(net, Limits(Deadline(cancelled=flag)))
    assert (found.reachable, found.bound) == (None, "the time was over")


def test_what_is_as_large_as_the_net_is_not_made_when_the_time_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_late(net: Net) -> list[dict[int, int]]:
        raise AssertionError(f"the matrix of {net.name} is made")

    monkeypatch.setattr("firable.analysis.structure.contact.columns", too_late)
    proof = contact_proof(catalogue_net("one_robot"), Deadline.after(0))
    assert (proof.whole, proof.undecided) == (False, "the time was over")
