"""Temporal formulas: their text, their logics, and what is none."""

import pytest
from hypothesis import given
from support.temporal_formulas import ctl_formulas, ltl_formulas

from firable.nets.formula import FormulaError, Holds
from firable.nets.temporal import (
    Exists,
    Fires,
    Logic,
    Next,
    Temporal,
    Until,
    format_temporal,
    logics,
    parse_temporal,
)
from firable.nets.temporal_parts import atoms_in, has_events

PLACES = ["robot.free", "a-b", "X", "E", "start"]


@given(ctl_formulas(PLACES, ["t", "AG"], 8))
def test_a_formula_of_ctl_is_read_back_as_printed(formula: Temporal) -> None:
    assert parse_temporal(format_temporal(formula)) == formula
    assert Logic.CTL in logics(formula)


@given(ltl_formulas(PLACES, ["t", "AG"], 8))
def test_a_formula_of_ltl_is_read_back_as_printed(formula: Temporal) -> None:
    assert parse_temporal(format_temporal(formula)) == formula
    assert Logic.LTL in logics(formula)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("p U q U r", "p U (q U r)"),
        ("p and q U r or s", "(p and (q U r)) or s"),
        ("not X p U q", "(not (X p)) U q"),
        ("p -> F q -> r", "p -> (F q -> r)"),
        ("E[p and q U r -> s]", "E[(p and q) U (r -> s)]"),
        ("AG EF p and q", "(AG EF p) and q"),
        ('"U" U "p"', '"U" U p'),
        ("tokens(a)<=2 U b", "(tokens(a) <= 2) U b"),
    ],
)
def test_operators_bind_as_the_grammar_says(text: str, same: str) -> None:
    assert parse_temporal(text) == parse_temporal(same)


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("", 0),
        ("EF", 2),
        ("p U", 3),
        ("U p", 0),
        ("E p", 2),
        ("E[p U q", 7),
        ("E[p W q]", 4),
        ("E[p U q U r]", 8),
        ("fires()", 6),
        ("p X q", 2),
    ],
)
def test_what_is_no_formula_is_refused_at_its_column(text: str, column: int) -> None:
    with pytest.raises(FormulaError) as caught:
        parse_temporal(text)
    assert caught.value.column == column


@pytest.mark.parametrize("text", ["EF X p", "AG fires(t)", "G EF p", "EF p or G q", "A[p U X q]", "A[p U q] U r"])
def test_the_two_logics_do_not_mix(text: str) -> None:
    with pytest.raises(FormulaError, match="mixed"):
        parse_temporal(text)


@pytest.mark.parametrize("text", ["(" * 101, "X " * 101, "EX not " * 60, "p U " * 101, "E[" * 101])
def test_a_formula_that_nests_too_deeply_is_refused(text: str) -> None:
    with pytest.raises(FormulaError, match="too deeply"):
        parse_temporal(text)


def test_a_quantifier_stands_before_an_operator() -> None:
    with pytest.raises(FormulaError, match="quantifier"):
        logics(Exists(Holds("p")))


def test_the_names_of_a_formula_are_found() -> None:
    formula = parse_temporal("a U X (fires(t) and tokens(b, c) < 1)")
    assert [*atoms_in(formula)] == [Holds("a"), Fires("t"), Holds("b"), Holds("c")]
    assert has_events(formula)
    assert not has_events(Exists(Until(Holds("fires"), Next(Holds("a")))))
