"""What a diagram and a sum say as terms is what they say: of each marking, whether it is one of them."""

from itertools import product

import pytest
from support.evidence_examples import net

from firable.analysis.evidence.certificate import Diagram, Equation, Inequality
from firable.analysis.evidence.checking.obligations import diagram_term, sum_term
from firable.analysis.induction.encoding import marking_term
from firable.analysis.induction.smt import Answer, Term, Terms, decide

OF = net("of", "", ("a", "b"))
PLACES = ("a", "b", "z")
DIAGRAMS: dict[Diagram, set[int]] = {
    Diagram(PLACES, (), (0,)): set(),
    Diagram(PLACES, (), (1,)): {0},
    Diagram(PLACES, ((1, 0, 1), (2, 2, 1)), (3,)): {0b001, 0b010},
    Diagram(PLACES, ((1, 0, 1), (3, 0, 2)), (3,)): {0b101},
    Diagram(PLACES, ((1, 1, 1), (2, 0, 2), (3, 3, 2)), (4,)): {0b010, 0b011, 0b100, 0b101},
    Diagram(("z", "a", "b"), ((1, 0, 1), (3, 2, 1)), (3,)): {0b100, 0b010},
}


def satisfied(terms: Terms, term: Term, holds: tuple[Term, ...], n_places: int) -> set[int]:
    """The markings in which a term is true."""
    return {
        marking
        for marking in range(2**n_places)
        if decide((term, marking_term(terms, marking, holds))).answer is Answer.SAT
    }


@pytest.mark.parametrize("of", DIAGRAMS, ids=str)
def test_a_diagram_is_a_term_that_is_true_in_its_markings(of: Diagram) -> None:
    terms = Terms()
    holds = tuple(map(terms.variable, PLACES))
    assert satisfied(terms, diagram_term(terms, OF, of, holds.__getitem__), holds, 3) == DIAGRAMS[of]


@pytest.mark.parametrize("weights", list(product((-2, 0, 1, 2), repeat=2)))
def test_a_sum_is_a_term_that_is_true_where_it_is_as_stated(weights: tuple[int, int]) -> None:
    terms = Terms()
    holds = tuple(map(terms.variable, PLACES[:2]))
    total = {marking: sum(weight for i, weight in enumerate(weights) if marking >> i & 1) for marking in range(4)}
    named = tuple(zip(PLACES, weights, strict=False))
    for tokens in range(-3, 4):
        exact = sum_term(terms, OF, Equation(named, tokens), holds.__getitem__)
        assert satisfied(terms, exact, holds, 2) == {m for m, tokens_in in total.items() if tokens_in == tokens}
        least = sum_term(terms, OF, Inequality(named, tokens), holds.__getitem__)
        assert satisfied(terms, least, holds, 2) == {m for m, tokens_in in total.items() if tokens_in >= tokens}
