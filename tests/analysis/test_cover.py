"""Units and the cover of a net by them, against all sets of places of small nets; and what large nets cost."""

from __future__ import annotations

from itertools import chain, combinations

from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import dense_nets
from support.examples import examples
from support.reference import load_net
from support.ring_nets import ring_nets

from firable.analysis.deadline import Deadline
from firable.analysis.structure.cover import UnitSearch, cover
from firable.analysis.structure.invariants import columns, rows
from firable.analysis.structure.linear import Sparse, eliminate, solutions
from firable.analysis.structure.semiflows import minimal_semiflows
from firable.nets.net import Net

NETS = st.one_of(dense_nets(), ring_nets())


def units_by_definition(equations: list[dict[int, int]], n: int) -> list[frozenset[int]]:
    """The non-empty sets with one variable of each sign, or none, in every equation; those without one within."""
    sets = [frozenset(s) for s in chain.from_iterable(combinations(range(n), k) for k in range(1, n + 1))]

    def balanced(chosen: frozenset[int]) -> bool:
        for equation in equations:
            signs = sorted(equation[v] for v in chosen & equation.keys())
            if signs not in ([], [-1, 1]):
                return False
        return True

    found = [s for s in sets if balanced(s)]
    return [s for s in found if not any(other < s for other in found)]


@examples(60)
@given(NETS)
def test_with_tries_enough_every_place_and_transition_that_is_in_a_unit_is_covered_by_one(net: Net) -> None:
    for equations, n in ((columns(net), len(net.places)), (rows(net), len(net.transitions))):
        units = units_by_definition(equations, n)
        found = cover(equations, n, tries_max=10_000)
        assert {frozenset(unit) for unit in found.units} <= set(units)
        assert set(found.uncovered) == set(range(n)) - set().union(*units)
        assert found.complete


@examples(40)
@given(NETS)
def test_a_bound_on_tokens_leaves_out_the_units_that_hold_more(net: Net) -> None:
    marked = frozenset(i for i, place in enumerate(net.places) if place.marked)
    units = [u for u in units_by_definition(columns(net), len(net.places)) if len(u & marked) <= 1]
    found = cover(columns(net), len(net.places), marked=marked, tokens_max=1, tries_max=10_000)
    assert {frozenset(unit) for unit in found.units} <= set(units)
    assert set(found.uncovered) == set(range(len(net.places))) - set().union(*units)


@examples(60)
@given(NETS)
def test_a_draining_set_never_gains_tokens_and_takes_one_from_itself_where_it_gains(net: Net) -> None:
    changes, n = columns(net), len(net.places)
    search = UnitSearch(changes, n, draining=True)
    for start in range(n):
        drain = set(search.unit(start, 10_000) or ())
        assert not drain or start in drain
        for change in changes:
            put = {p for p in drain if change.get(p, 0) > 0}
            assert len(put) <= len({p for p in drain if change.get(p, 0) < 0} or ())
            assert len(put) <= 1
    small = [frozenset(s) for k in range(1, n + 1) for s in combinations(range(n), k)]
    draining = [
        s
        for s in small
        if all(
            not (gained := [p for p in s if c.get(p, 0) > 0]) or (len(gained) == 1 and any(c.get(p, 0) < 0 for p in s))
            for c in changes
        )
    ]
    assert {start for start in range(n) if search.unit(start, 10_000)} == set().union(*draining)


def test_the_cell_is_covered_by_units_with_one_token_each() -> None:
    net = load_net("cell1")
    marked = frozenset(i for i, place in enumerate(net.places) if place.marked)
    found = cover(columns(net), len(net.places), marked=marked, tokens_max=1)
    assert found.uncovered == ()
    assert {len(marked & set(unit)) for unit in found.units} == {1}
    assert len(found.units) < 14  # fewer than the dimension, of 68 minimal invariants


def philosophers(count: int) -> tuple[list[dict[int, int]], int]:
    """Fork, thinking, the left fork taken, the right one taken, eating."""
    found: list[dict[int, int]] = []
    for i in range(count):
        fork, think, left, right, eat = range(5 * i, 5 * i + 5)
        other = 5 * ((i + 1) % count)
        found += [{think: -1, fork: -1, left: 1}, {think: -1, other: -1, right: 1}]
        found += [{left: -1, other: -1, eat: 1}, {right: -1, fork: -1, eat: 1}]
        found += [{eat: -1, think: 1, fork: 1, other: 1}]
    return found, 5 * count


def test_ten_thousand_places_are_eliminated_covered_and_listed_and_nothing_is_filled_in() -> None:
    equations, n = philosophers(2_000)
    eliminated = eliminate(equations)
    assert eliminated is not None
    basis = solutions(eliminated, range(n))
    assert basis is not None
    assert (eliminated.rank, len(basis)) == (6_000, 4_000)
    assert sum(map(len, basis)) < 3 * n
    assert {abs(weight) for vector in basis for weight in vector.values()} == {1}
    found = cover(equations, n)
    assert (len(found.units), found.uncovered) == (4_000, ())
    listed = minimal_semiflows(equations, n, rows_max=5_000)
    assert (len(listed.vectors), listed.complete) == (4_000, True)


def test_a_deadline_ends_each_of_them() -> None:
    equations, n = philosophers(3)
    over = Deadline.after(0)
    assert eliminate(equations, deadline=over) is None
    whole = eliminate(equations)
    assert whole is not None
    assert solutions(whole, range(n), deadline=over) is None
    assert not cover(equations, n, deadline=over).complete
    assert not minimal_semiflows(equations, n, rows_max=100, deadline=over).complete


@examples(100)
@given(
    st.lists(st.dictionaries(st.integers(0, 5), st.integers(-4, 4), max_size=4), max_size=6),
)
def test_the_solutions_of_any_integer_equations_solve_them_and_are_as_many_as_variables_are_free(
    equations: list[Sparse],
) -> None:
    eliminated = eliminate(equations)
    assert eliminated is not None
    basis = solutions(eliminated, range(6))
    assert basis is not None
    assert len(basis) == 6 - eliminated.rank
    for vector in basis:
        assert all(sum(x * vector.get(v, 0) for v, x in equation.items()) == 0 for equation in equations)
    # Independent: what is left of the variables when the vectors are taken as equations.
    again = eliminate(basis)
    assert again is not None
    assert again.rank == len(basis)


def test_the_rank_is_exact() -> None:
    for equations, rank in (([{0: 1, 1: 2}, {0: 2, 1: 4}], 1), ([{0: 1, 1: 2}, {0: 2, 1: 5}], 2), ([], 0), ([{}], 0)):
        found = eliminate(equations)
        assert found is not None
        assert found.rank == rank
