"""State formulas: their text and their value."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firable.nets.formula import (
    And,
    Constant,
    Deadlock,
    Firable,
    Formula,
    FormulaError,
    Holds,
    Not,
    Or,
    Start,
    format_formula,
    parse_formula,
)
from firable.nets.net import Net, Place, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate

formulas: st.SearchStrategy[Formula] = st.recursive(
    st.one_of(
        st.builds(Constant, st.booleans()),
        st.sampled_from(["robot.free", "a-b", "mc.wait_put"]).map(Holds),
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
    [("", 0), ("a and", 5), ("a b", 2), ("(a", 2), ("a and or b", 6), ("firable()", 8), ("not", 3), ("a -> ", 5)],
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
    ],
)
def test_the_value_of_a_formula_in_the_initial_marking(text: str, value: bool) -> None:
    net = Net("n", (Place("p", marked=True), Place("q")), (Transition("t", ("p",), ("q",)), Transition("u", ("q",))))
    assert evaluate(BOOL, net, parse_formula(text), lambda place: net.places[place].marked) is value
