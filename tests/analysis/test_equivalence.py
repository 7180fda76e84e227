"""Isomorphism of labelled graphs and weak bisimilarity under hiding."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.reference import load_net
from support.ring_nets import ring_nets

from firable.analysis.spaces.equivalence import isomorphic, weakly_bisimilar
from firable.analysis.spaces.reachability import Budget, IncompleteGraph, explore
from firable.nets.net import Net, Place, Transition
from firable.semantics.complement import complement
from firable.semantics.player import Player
from firable.semantics.trace import Discipline


def by_number(net: Net, most: int) -> dict[str, str]:
    """The transitions with a number up to `most`, labelled by it."""
    return {t.name: f"n{t.number}" for t in net.transitions if t.number is not None and t.number <= most}


def of(*transitions: tuple[str, str, str]) -> Net:
    """A net of transitions (name, inputs, outputs) with its token on `a`."""
    names = sorted({letter for _, a, b in transitions for letter in a + b})
    return Net(
        "n",
        tuple(Place(name, marked=name == "a") for name in names),
        tuple(Transition(name, tuple(a), tuple(b)) for name, a, b in transitions),
    )


def test_the_cell_behaves_like_the_conceptual_net_when_its_inner_transitions_are_hidden() -> None:
    detailed, conceptual = load_net("cell1"), load_net("conceptual1")
    visible = by_number(detailed, 6), by_number(conceptual, 6)
    assert sorted(visible[0].values()) == sorted(visible[1].values()) == [f"n{i}" for i in range(1, 7)]
    assert weakly_bisimilar(explore(detailed), explore(conceptual), *visible)


def test_the_late_cell_does_not_behave_like_the_conceptual_net() -> None:
    late, conceptual = load_net("cell1_mc_late"), load_net("conceptual1")
    assert not weakly_bisimilar(explore(late), explore(conceptual), by_number(late, 6), by_number(conceptual, 6))


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        # Hidden steps before and after a visible one do not show.
        (of(("x", "a", "b"), ("h", "b", "c"), ("y", "c", "a")), of(("x", "a", "b"), ("y", "b", "a")), True),
        # A hidden step that decides does: after it, only one of the two is left.
        (
            of(("h", "a", "b"), ("i", "a", "c"), ("x", "b", "d"), ("y", "c", "d")),
            of(("x", "a", "b"), ("y", "a", "b")),
            False,
        ),
        # x then y, against y then x.
        (of(("x", "a", "b"), ("y", "b", "a")), of(("y", "a", "b"), ("x", "b", "a")), False),
    ],
)
def test_weak_bisimilarity_hides_steps_but_not_decisions(left: Net, right: Net, expected: bool) -> None:
    visible = {"x": "x", "y": "y"}
    assert weakly_bisimilar(explore(left), explore(right), visible, visible) is expected


def test_a_visible_step_may_be_followed_by_hidden_ones() -> None:
    # Milner's third law of the hidden step: x.(y + h.z) is x.(y + h.z) + x.z.
    right = of(("x", "a", "b"), ("y", "b", "d"), ("h", "b", "c"), ("z", "c", "d"))
    left = of(("x", "a", "b"), ("y", "b", "d"), ("h", "b", "c"), ("z", "c", "d"), ("x2", "a", "c"))
    visible = {"x": "x", "x2": "x", "y": "y", "z": "z"}
    assert weakly_bisimilar(explore(left), explore(right), visible, visible)
    assert not weakly_bisimilar(explore(left), explore(right), {**visible, "h": "h"}, {**visible, "h": "h"})


def test_graphs_that_join_in_different_places_are_not_isomorphic() -> None:
    begin = (("s1", "a", "b"), ("s2", "a", "c"))
    left = of(*begin, ("t", "b", "d"), ("v", "b", "d"), ("x", "c", "e"), ("y", "c", "f"))
    right = of(*begin, ("t", "b", "d"), ("v", "b", "f"), ("x", "c", "e"), ("y", "c", "e"))
    a, b = explore(left), explore(right)
    assert (a.n_markings, a.n_edges) == (b.n_markings, b.n_edges) == (6, 6)
    assert not isomorphic(a, b)
    assert not isomorphic(b, a)


@examples(60)
@given(ring_nets(), st.sampled_from(Discipline), st.data())
def test_a_complement_gives_an_isomorphic_graph_in_either_discipline(
    net: Net, discipline: Discipline, data: st.DataObject
) -> None:
    place = data.draw(st.sampled_from(net.places)).name
    other = complement(net, place)
    a, b = explore(net, discipline), explore(other, discipline)
    assert isomorphic(a, b)
    everything = {t.name: t.name for t in net.transitions}
    assert weakly_bisimilar(a, b, everything, everything)


@examples(100)
@given(ring_nets(), st.data())
def test_a_gate_more_is_isomorphic_only_if_it_forbids_nothing(net: Net, data: st.DataObject) -> None:
    t = data.draw(st.integers(0, len(net.transitions) - 1))
    place = data.draw(st.sampled_from(net.places)).name
    gated = replace(net.transitions[t], inhibitive=tuple({*net.transitions[t].inhibitive, place}))
    other = replace(net, transitions=(*net.transitions[:t], gated, *net.transitions[t + 1 :]))
    same = Player(net).reachable() == Player(other).reachable()
    assert isomorphic(explore(net), explore(other)) is same


def test_what_is_not_whole_is_not_compared() -> None:
    net = load_net("cell1")
    whole, part = explore(net), explore(net, budget=Budget(markings=5))
    for a, b in ((whole, part), (part, whole)):
        with pytest.raises(IncompleteGraph):
            isomorphic(a, b)
        with pytest.raises(IncompleteGraph):
            weakly_bisimilar(a, b, {}, {})
