"""Formulas of LTL before the tableau: what they are rewritten to, and how large their automata are."""

import pytest

from firable.analysis.temporal.automaton import automaton_of
from firable.analysis.temporal.rewriting import positive, replaced
from firable.nets.formula import Constant, Formula, Holds
from firable.nets.temporal import format_temporal, parse_temporal


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("not (p U q)", "not p R not q"),
        ("not (p R q)", "not p U not q"),
        ("not (p W q)", "not q U not (p or q)"),
        ("not X p", "X not p"),
        ("not not F p", "F p"),
        ("p U F q", "F q"),
        ("p R G q", "G q"),
        ("F F p", "F p"),
        ("F (p U q)", "F q"),
        ("G (p R q)", "G q"),
        ("p U (p U q)", "p U q"),
        ("X G F p", "G F p"),
        ("p U G F q", "G F q"),
        ("F G F p", "G F p"),
        ("G F G p", "F G p"),
        ("F X p", "X F p"),
        ("G F X X p", "G F p"),
        ("X p U X q", "X (p U q)"),
        ("p U (q and G F r)", "(p U q) and G F r"),
        ("p R (q or G F r)", "(p R q) or G F r"),
        ("X (p or F G q)", "X p or F G q"),
        ("F (X p or G q)", "X F p or F G q"),
        ("F false or X true", "true"),
        ("G true and p U false", "false"),
    ],
)
def test_a_formula_is_rewritten(text: str, same: str) -> None:
    assert format_temporal(positive(parse_temporal(text))) == format_temporal(positive(parse_temporal(same)))


def test_a_part_that_is_known_is_replaced() -> None:
    def known(state: Formula) -> Formula:
        return Constant(value=state == Holds("p")) if isinstance(state, Holds) else state

    assert replaced(positive(parse_temporal("G (p or X (q U r))")), known) == Constant(value=True)
    assert replaced(positive(parse_temporal("F (p and X (q U r))")), known) == Constant(value=False)


@pytest.mark.parametrize(
    ("text", "states", "marks"),
    [
        ("G F p", 1, 1),
        ("F G p", 2, 1),
        ("G F p and G F q and G F r", 1, 3),
        ("p U q", 2, 1),
        ("G (p -> F q)", 2, 1),
        ("X X X p", 5, 0),
    ],
)
def test_automata_are_small(text: str, states: int, marks: int) -> None:
    automaton = automaton_of(positive(parse_temporal(text)))
    assert (len(automaton.edges), automaton.n_marks) == (states, marks)
