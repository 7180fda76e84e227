"""Isomorphism of labelled graphs and weak bisimilarity under hiding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.reference import load_net
from support.ring_nets import ring_nets

from firable.analysis.spaces.equivalence import (
    Label,
    branching_bisimilar,
    branching_classes,
    isomorphic,
    weakly_bisimilar,
)
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
    assert branching_bisimilar(explore(detailed), explore(conceptual), *visible)


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
    assert branching_bisimilar(explore(left), explore(right), visible, visible) is expected


def test_a_visible_step_may_be_followed_by_hidden_ones() -> None:
    # Milner's third law of the hidden step: x.(y + h.z) is x.(y + h.z) + x.z.
    right = of(("x", "a", "b"), ("y", "b", "d"), ("h", "b", "c"), ("z", "c", "d"))
    left = of(("x", "a", "b"), ("y", "b", "d"), ("h", "b", "c"), ("z", "c", "d"), ("x2", "a", "c"))
    visible = {"x": "x", "x2": "x", "y": "y", "z": "z"}
    assert weakly_bisimilar(explore(left), explore(right), visible, visible)
    assert not branching_bisimilar(explore(left), explore(right), visible, visible)  # x2 leaves the choice of y out
    assert not weakly_bisimilar(explore(left), explore(right), {**visible, "h": "h"}, {**visible, "h": "h"})


def test_an_endless_hidden_loop_is_told_from_a_deadlock_by_divergence_alone() -> None:
    left = of(("x", "a", "b"), ("h", "b", "c"), ("i", "c", "b"))
    right = of(("x", "a", "b"))
    graphs = explore(left), explore(right)
    assert weakly_bisimilar(*graphs, {"x": "x"}, {"x": "x"})
    assert branching_bisimilar(*graphs, {"x": "x"}, {"x": "x"}, divergence=False)
    assert not branching_bisimilar(*graphs, {"x": "x"}, {"x": "x"})


Moves = list[set[tuple[Label, int]]]


@st.composite
def moves(draw: st.DrawFn) -> Moves:
    """A graph of six nodes with hidden moves and two labels."""
    label = st.sampled_from([frozenset[str](), frozenset[str](), frozenset({"x"}), frozenset({"y"})])
    return [draw(st.sets(st.tuples(label, st.integers(0, 5)), max_size=3)) for _ in range(6)]


def partitions(nodes: Sequence[int]) -> Iterator[list[int]]:
    """Every way of giving classes to nodes, the classes numbered as they appear."""

    def given_(classes: list[int]) -> Iterator[list[int]]:
        if len(classes) == len(nodes):
            yield classes
            return
        for one in range(max(classes, default=-1) + 2):
            yield from given_([*classes, one])

    return given_([])


def is_branching_bisimulation(graph: Moves, classes: list[int], divergence: bool) -> bool:
    """The definition: what one of two equal nodes does, the other does after hidden moves that end in its class."""
    n = range(len(graph))

    def later(node: int) -> set[int]:
        found, todo = {node}, [node]
        for one in todo:
            more = {to for label, to in graph[one] if not label} - found
            found |= more
            todo += more
        return found

    def can(node: int, label: Label, into: int) -> bool:
        if not label and classes[node] == into:
            return True
        return any(
            classes[via] == classes[node] and (label, into) in {(seen, classes[to]) for seen, to in graph[via]}
            for via in later(node)
        )

    def diverges(node: int) -> bool:
        inside = {other for other in n if classes[other] == classes[node]}
        while True:  # what is left can always go on
            on = {other for other in inside if any(not label and to in inside for label, to in graph[other])}
            if on == inside:
                return node in inside
            inside = on

    return all(
        all(can(b, label, classes[to]) for label, to in graph[a]) and (not divergence or diverges(a) == diverges(b))
        for a in n
        for b in n
        if classes[a] == classes[b]
    )


@examples(20)
@given(moves(), st.booleans())
def test_branching_classes_are_the_coarsest_that_keep_the_definition(graph: Moves, divergence: bool) -> None:
    found = branching_classes(graph, divergence=divergence)
    assert is_branching_bisimulation(graph, found, divergence)
    for classes in partitions(range(6)):
        if len(set(classes)) <= len(set(found)) and is_branching_bisimulation(graph, classes, divergence):
            assert all(found[a] == found[b] for a in range(6) for b in range(6) if classes[a] == classes[b])


def test_graphs_that_join_in_different_places_are_not_isomorphic() -> None:
    begin = (("s1", "a", "b"), ("s2", "a", "c"))
    left = of(*begin, ("t", "b", "d"), ("v", "b", "d"), ("x", "c", "e"), ("y", "c", "f"))
    right = of(*begin, ("t", "b", "d"), ("v", "b", "f"), ("x", "c", "e"), ("y", "c", "e"))
    a, b = explore(left), explore(right)
    assert (a.n_markings, a.n_edges) == (b.n_markings, b.n_edges) == (6, 6)
    assert not isomorphic(a, b)
    assert not isomorphic(b, a)


@examples(30)
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
    assert branching_bisimilar(a, b, everything, everything)


@examples(50)
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
        with pytest.raises(IncompleteGraph):
            branching_bisimilar(a, b, {}, {})
