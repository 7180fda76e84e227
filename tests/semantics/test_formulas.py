"""State formulas: their text and their value."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firable.analysis.spaces.columns import COLUMNS, packed, unpacked
from firable.nets.formula import (
    And,
    Compare,
    Constant,
    Count,
    Deadlock,
    Firable,
    Formula,
    FormulaError,
    Holds,
    Not,
    Or,
    Sign,
    Start,
    format_formula,
    names_in,
    parse_formula,
)
from firable.nets.net import Net, Place, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate

PLACES = ["robot.free", "a-b", "mc.wait_put"]
numbers = st.integers(0, 4)
counts = st.one_of(
    st.builds(Count, st.just(()), numbers),
    st.builds(Count, st.lists(st.sampled_from(PLACES), min_size=1, max_size=5).map(tuple), numbers),
)
comparisons = st.builds(Compare, counts, st.sampled_from(Sign), counts)
formulas: st.SearchStrategy[Formula] = st.recursive(
    st.one_of(
        st.builds(Constant, st.booleans()),
        st.sampled_from([*PLACES, "start", "a<=b", "2", "tokens"]).map(Holds),
        comparisons,
        st.sampled_from(["G1", "t1-a"]).map(Firable),
        st.just(Start()),
        st.just(Deadlock()),
    ),
    lambda inner: st.one_of(
        st.builds(Not, inner),
        st.lists(inner, min_size=2, max_size=3).map(lambda x: And(tuple(x))),
        st.lists(inner, min_size=2, max_size=3).map(lambda x: Or(tuple(x))),
    ),
)


@given(formulas)
def test_a_formula_is_read_back_as_printed(formula: Formula) -> None:
    assert parse_formula(format_formula(formula)) == formula


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("", 0),
        ("a and", 5),
        ("a b", 2),
        ("(a", 2),
        ("a and or b", 6),
        ("firable()", 8),
        ("not", 3),
        ("a -> ", 5),
        ("a,b", 1),
        ("a [", 2),
        ("tokens() = 1", 7),
        ("tokens(a", 8),
        ("tokens(a) b", 10),
        ("tokens(a) <= x", 13),
        ("tokens(a) <= 1234567890", 13),
        ("tokens(a) <= 1 + 2", 15),
        ("2 <= a", 5),
    ],
)
def test_what_is_no_formula_is_refused_at_its_column(text: str, column: int) -> None:
    with pytest.raises(FormulaError) as caught:
        parse_formula(text)
    assert caught.value.column == column


def test_a_formula_that_nests_too_deeply_is_refused() -> None:
    with pytest.raises(FormulaError, match="too deeply"):
        parse_formula("(" * 100_000)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("p", True),
        ("q", False),
        ("p -> q", False),
        ("q -> p -> q", True),
        ("not p or q or true", True),
        ("p and not q", True),
        ("start", True),
        ("deadlock", False),
        ("firable(t)", True),
        ("firable(u)", False),
        ("tokens(p, q) = 1", True),
        ("tokens(p, q)<=0", False),
        ("1<=tokens(p)", True),
        ("tokens(q)+1 > tokens(p) and tokens(q) + 1 >= tokens(p)", False),
        ("tokens(p, p) != 2", False),
        ('"p"', True),
    ],
)
def test_the_value_of_a_formula_in_the_initial_marking(text: str, value: bool) -> None:
    net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u", ("q",))))
    assert evaluate(BOOL, net, parse_formula(text), lambda place: net.places[place].marked) is value


@given(comparisons, st.sets(st.sampled_from(PLACES)))
def test_a_comparison_has_the_value_of_the_numbers_in_every_algebra(comparison: Compare, marked: set[str]) -> None:
    net = Net("n", tuple(map(Place, PLACES)))

    def total(count: Count) -> int:
        return sum(place in marked for place in count.places) + count.added

    left, right = total(comparison.left), total(comparison.right)
    expected = {"<=": left <= right, "<": left < right, "=": left == right, "!=": left != right, ">=": left >= right}
    value = expected.get(comparison.sign, left > right)
    assert evaluate(BOOL, net, comparison, lambda place: PLACES[place] in marked) is value
    column = evaluate(COLUMNS, net, comparison, lambda place: packed(np.array([PLACES[place] in marked])))
    assert bool(np.atleast_1d(unpacked(column))[0]) is value


def test_a_comparison_of_many_places_is_a_term_of_few_parts() -> None:
    names = tuple(f"p{i}" for i in range(600))
    net, asked = Net("n", tuple(map(Place, names))), []

    def holds(place: int) -> bool:
        asked.append(place)
        return place % 2 == 0

    assert evaluate(BOOL, net, Compare(Count(names[:300]), Sign.AT_MOST, Count(names[300:])), holds)
    assert len(asked) == 600


def test_the_names_of_a_comparison_are_found() -> None:
    assert [*names_in(parse_formula("tokens(a, b) <= tokens(c)"))] == [Holds("a"), Holds("b"), Holds("c")]
