"""Invariants: minimal, exact, complete; against exhaustive search on small nets and the figures of the cell."""

from __future__ import annotations

from fractions import Fraction
from itertools import count, product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import load_net, reference_names
from support.ring_nets import ring_nets

from firable.analysis.deadline import Deadline
from firable.analysis.structure.invariants import (
    Invariant,
    Invariants,
    columns,
    p_basis,
    p_invariants,
    rows,
    t_basis,
    t_invariants,
)
from firable.nets.net import Net, Place, Transition
from firable.semantics.player import Player


def test_the_one_robot_cell_has_68_minimal_p_invariants_of_weight_one_that_cover_every_place() -> None:
    net = load_net("cell1")
    found = p_invariants(net)
    assert (len(found.minimal), found.dimension, found.complete) == (68, 14, True)
    assert {weight for invariant in found.minimal for _, weight in invariant.weights} == {1}
    assert found.uncovered([place.name for place in net.places]) == ()


@pytest.mark.parametrize("name", reference_names())
def test_the_tokens_of_an_invariant_are_the_same_in_every_reachable_marking(name: str) -> None:
    net = load_net(name)
    markings = Player(net).reachable()
    for invariant in p_invariants(net).minimal:
        assert {invariant.tokens(net, marking) for marking in markings} == {invariant.tokens(net, net.initial_marking)}


def brute_force(matrix: tuple[tuple[int, ...], ...], most: int) -> set[tuple[int, ...]]:
    """The solutions of minimal support with entries up to `most` and no common divisor, by trying all vectors."""
    solutions = [
        y
        for y in product(range(most + 1), repeat=len(matrix))
        if any(y) and not any(sum(a * b for a, b in zip(y, c, strict=True)) for c in zip(*matrix, strict=True))
    ]
    supports = {frozenset(i for i, x in enumerate(y) if x) for y in solutions}
    minimal = {s for s in supports if not any(other < s for other in supports)}
    smallest: dict[frozenset[int], tuple[int, ...]] = {}
    for y in sorted(solutions, key=sum):
        smallest.setdefault(frozenset(i for i, x in enumerate(y) if x), y)
    return {smallest[s] for s in minimal}


def incidence(net: Net) -> tuple[tuple[int, ...], ...]:
    """C with all its zeros, straight from its definition."""
    return tuple(
        tuple((place.name in t.outputs) - (place.name in t.inputs) for t in net.transitions) for place in net.places
    )


def check_both_kinds(net: Net, most: int) -> None:
    matrix = incidence(net)
    places, transitions = [p.name for p in net.places], [t.name for t in net.transitions]
    turned = tuple(tuple(row[t] for row in matrix) for t in range(len(transitions)))
    for found, names, matrix_of in ((p_invariants(net), places, matrix), (t_invariants(net), transitions, turned)):
        vectors = {tuple(dict(invariant.weights).get(name, 0) for name in names) for invariant in found.minimal}
        small = {vector for vector in vectors if max(vector) <= most}
        assert found.complete
        assert len(vectors) == len(found.minimal)
        assert small == {y for y in brute_force(matrix_of, most) if y in vectors or not dominated(y, vectors)}


def dominated(y: tuple[int, ...], vectors: set[tuple[int, ...]]) -> bool:
    """Whether a solution of larger entries, out of the search's reach, has a smaller support."""
    support = {i for i, x in enumerate(y) if x}
    return any(max(v) > 1 and {i for i, x in enumerate(v) if x} < support for v in vectors)


@examples(30)
@given(dense_nets(most_transitions=4))
def test_minimal_invariants_are_those_that_exhaustive_search_finds(net: Net) -> None:
    check_both_kinds(net, 3)


@examples(20)
@given(ring_nets())
def test_minimal_invariants_of_rings_are_those_that_exhaustive_search_finds(net: Net) -> None:
    check_both_kinds(net, 1 if len(net.places) + len(net.transitions) > 12 else 2)


def test_a_self_loop_and_a_gate_leave_the_incidence_alone() -> None:
    places = (Place("p"), Place("q"))
    net = Net("n", places, (Transition("t", ("p",), ("p",), ("q",)),))
    assert (columns(net), rows(net)) == ([{}], [{}, {}])
    assert [str(invariant) for invariant in p_invariants(net).minimal] == ["p", "q"]
    assert [str(invariant) for invariant in t_invariants(net).minimal] == ["t"]


def test_weights_larger_than_one_are_exact() -> None:
    # One token of p becomes one of q and one of r, each becomes one of s, and two of s, one by way of u, make one of p.
    places = tuple(Place(name) for name in "pqrsu")
    moves = (
        Transition("split", ("p",), ("q", "r")),
        Transition("left", ("q",), ("s",)),
        Transition("right", ("r",), ("s",)),
        Transition("put_by", ("s",), ("u",)),
        Transition("join", ("s", "u"), ("p",)),
    )
    found = p_invariants(Net("n", places, moves))
    assert [str(invariant) for invariant in found.minimal] == ["2 p + q + r + s + u"]


def test_a_sum_of_two_invariants_is_not_minimal() -> None:
    places = tuple(Place(name) for name in "abcd")
    moves = (Transition("t1", ("b", "d"), ("a", "c")), Transition("t2", ("b", "c"), ("a", "d")))
    found = p_invariants(Net("n", places, moves))
    assert [str(invariant) for invariant in found.minimal] == ["a + b", "c + d"]


def test_an_invariant_has_no_common_divisor() -> None:
    places = tuple(Place(name) for name in "xyuv")
    moves = (
        Transition("t1", ("y",), ("x",)),
        Transition("t2", ("u", "v"), ("x", "y")),
        Transition("t3", ("v",), ("u",)),
    )
    assert [str(invariant) for invariant in p_invariants(Net("n", places, moves)).minimal] == ["x + y + u + v"]


def test_past_the_bound_on_rows_the_result_says_that_it_is_incomplete_and_lists_only_minimal_ones() -> None:
    net = load_net("cell1")
    whole, part = p_invariants(net), p_invariants(net, rows_max=40)
    assert not part.complete
    assert part.dimension == whole.dimension
    assert set(part.minimal) < set(whole.minimal)


def test_the_empty_net_has_no_invariants() -> None:
    for found in (p_invariants(Net("empty")), t_invariants(Net("empty"))):
        assert (found.minimal, found.dimension, found.complete) == ((), 0, True)


@examples(50)
@given(st.one_of(dense_nets(), ring_nets()))
def test_a_basis_has_as_many_independent_vectors_as_the_space_has_dimensions(net: Net) -> None:
    matrix = incidence(net)
    places, transitions = [p.name for p in net.places], [t.name for t in net.transitions]
    of_matrix = dense_rank(matrix)
    for basis, names, found in (
        (p_basis(net), places, p_invariants(net)),
        (t_basis(net), transitions, t_invariants(net)),
    ):
        assert basis is not None
        vectors = [tuple(dict(invariant.weights).get(name, 0) for name in names) for invariant in basis]
        assert len(basis) == len(names) - of_matrix == dense_rank(tuple(vectors)) == found.dimension
        assert dense_rank((*vectors, *(semi_positive(found, names)))) == len(basis)


def semi_positive(found: Invariants, names: list[str]) -> list[tuple[int, ...]]:
    return [tuple(dict(invariant.weights).get(name, 0) for name in names) for invariant in found.minimal]


def dense_rank(matrix: tuple[tuple[int, ...], ...]) -> int:
    """By Gauss with fractions, as in a first course."""
    left, rank = [[Fraction(x) for x in row] for row in matrix], 0
    for column in range(len(matrix[0]) if matrix else 0):
        pivot = next((row for row in left if row[column]), None)
        if pivot is None:
            continue
        rank += 1
        left = [
            [x - row[column] / pivot[column] * y for x, y in zip(row, pivot, strict=True)]
            for row in left
            if row is not pivot
        ]
    return rank


def test_an_invariant_of_both_signs_reads_as_a_sum() -> None:
    assert str(Invariant((("p", -1), ("q", 2), ("r", -3)))) == "-p + 2 q - 3 r"


def test_a_place_that_a_bound_left_out_is_covered_by_a_unit() -> None:
    """A ring of forks: 2 places to choose from at each of 14 stations make 2 ** 14 minimal invariants."""
    n = 14
    places = [
        Place("a"),
        *(Place(f"{side}{i}") for i in range(n) for side in "bc"),
        *(Place(f"d{i}") for i in range(n)),
    ]
    moves = []
    for i in range(n):
        source = "a" if i == 0 else f"d{i - 1}"
        moves.append(Transition(f"fork{i}", (source,), (f"b{i}", f"c{i}")))
        moves.append(Transition(f"join{i}", (f"b{i}", f"c{i}"), (f"d{i}",)))
    moves.append(Transition("back", (f"d{n - 1}",), ("a",)))
    net = Net("n", tuple(places), tuple(moves))
    found = p_invariants(net, rows_max=100)
    assert not found.complete
    assert found.uncovered([place.name for place in places]) == ()
    assert p_invariants(net, rows_max=100) == found


def test_past_the_deadline_the_list_is_incomplete_and_what_it_holds_is_invariant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    net = load_net("cell1")
    whole = p_invariants(net)
    for seconds in range(0, 400, 7):
        ticks = map(float, count())
        monkeypatch.setattr("firable.analysis.deadline.monotonic", ticks.__next__)
        part = p_invariants(net, deadline=Deadline.after(seconds))
        assert set(part.minimal) <= set(whole.minimal)
        assert part.dimension in {None, whole.dimension}
        assert part.complete <= (part.minimal == whole.minimal)
    assert not p_invariants(net, deadline=Deadline.after(0)).complete
    assert p_invariants(net, deadline=Deadline.after(1e9)) == whole
