"""Terms mean what the algebra says, and their SMT-LIB text means the same to another solver."""

import re
from threading import Event

import pytest
import z3
from hypothesis import given
from hypothesis import strategies as st
from support.second_solver import by_cvc5

from firable.analysis.deadline import Deadline
from firable.analysis.induction.smt import (
    SEED,
    Answer,
    Operator,
    Term,
    Terms,
    decide,
    smtlib,
    subterms,
    symbol,
    value,
    variables,
)
from firable.analysis.structure.asking import answer
from firable.analysis.structure.siphons import minimal_siphons
from firable.nets.net import Net, Place

TERMS = Terms()
NAMES = ("robot.free", "p", "p'", "fires(t)", "é", "a%b")


terms = st.recursive(
    st.sampled_from(NAMES).map(TERMS.variable) | st.sampled_from([TERMS.true, TERMS.false]),
    lambda inner: (
        st.lists(inner, max_size=3).map(TERMS.conjunction)
        | st.lists(inner, max_size=3).map(TERMS.disjunction)
        | inner.map(TERMS.negation)
        | st.tuples(inner, inner).map(lambda pair: TERMS.equal(*pair))
    ),
    max_leaves=12,
)
assignments = st.fixed_dictionaries({name: st.booleans() for name in NAMES})


@given(st.lists(terms, max_size=4), assignments)
def test_connectives_have_their_values(operands: list[Term], assignment: dict[str, bool]) -> None:
    values = [value(term, assignment) for term in operands]
    assert value(TERMS.conjunction(operands), assignment) == all(values)
    assert value(TERMS.disjunction(operands), assignment) == any(values)
    assert value(TERMS.at_most_one(operands), assignment) == (sum(values) <= 1)
    for term, of_term in zip(operands, values, strict=True):
        assert value(TERMS.negation(term), assignment) != of_term
        assert value(TERMS.differ(term, operands[0]), assignment) == (of_term != values[0])
        assert value(TERMS.implies(term, operands[0]), assignment) == (not of_term or values[0])


@given(terms, assignments)
def test_solvers_agree_on_the_value_of_a_term(term: Term, assignment: dict[str, bool]) -> None:
    fixed = [TERMS.literal(name, wanted) for name, wanted in assignment.items()]
    expected = "sat" if value(term, assignment) else "unsat"
    assert decide([term, *fixed]).answer == expected
    assert by_cvc5(smtlib([term, *fixed])) == expected


@given(terms)
def test_sat_comes_with_an_assignment_that_makes_the_term_true(term: Term) -> None:
    decision = decide([term])
    assert decision.answer in {Answer.SAT, Answer.UNSAT}
    assert by_cvc5(smtlib([term])) == decision.answer
    if decision.answer is Answer.SAT:
        assert value(term, decision.assignment)
        assert set(decision.assignment) == set(variables([term]))


@given(terms)
def test_text_is_strict(term: Term) -> None:
    text = smtlib([term], ["head"])
    assert text.startswith("; head\n(set-logic QF_UF)\n")
    assert text.endswith(")\n(check-sat)\n")
    assert all(len(t.operands) >= 2 for t in subterms([term]) if t.operator in {Operator.AND, Operator.OR})
    used = set(re.findall(r"\(([^\s()]+)", re.sub(r"\|[^|]*\|", "x", text)))
    assert used <= {"and", "or", "not", "=", "set-logic", "declare-const", "define-fun", "assert", "check-sat"}


def test_equal_terms_are_one_object() -> None:
    one = Terms()
    p, q = one.variable("p"), one.variable("q")
    assert one.conjunction([p, q]) is one.conjunction([p, q])
    assert one.conjunction([p, q]) is not one.conjunction([q, p])
    assert one.conjunction([p]) is p
    assert one.conjunction([]) is one.true
    assert one.negation(one.negation(p)) is p


def test_comparison_of_two_equal_terms_is_not_simplified_away() -> None:
    p = TERMS.variable("p")
    assert "(not (= |p| |p|))" in smtlib([TERMS.differ(p, p)])
    assert decide([TERMS.differ(p, p)]).answer is Answer.UNSAT


def test_shared_subterm_is_defined_once() -> None:
    p, q, shared_name = TERMS.variable("p"), TERMS.variable("q"), TERMS.variable("shared1")
    both = TERMS.conjunction([p, q])
    text = smtlib([TERMS.equal(TERMS.disjunction([both, shared_name]), both)])
    assert text.count("(and ") == 1
    assert "(define-fun shared_1 () Bool (and |p| |q|))" in text
    assert by_cvc5(text) == "sat"


def test_deep_term_overflows_nothing() -> None:
    p, q = TERMS.variable("p"), TERMS.variable("q")
    term = p
    for i in range(20_000):
        term = (TERMS.conjunction if i % 2 else TERMS.disjunction)([q, term])
    assert value(term, {"p": True, "q": True})
    assert by_cvc5(smtlib([term, TERMS.negation(q)])) == "unsat"
    assert decide([term, TERMS.negation(q)]).answer is Answer.UNSAT


def test_no_two_names_share_a_symbol_and_no_line_breaks_out_of_a_comment() -> None:
    assert len({symbol(name) for name in NAMES}) == len(NAMES)
    assert smtlib([], ["a\n(assert false)"]).splitlines()[0] == "; a·(assert false)"


def test_solver_without_time_is_unknown() -> None:
    # The pigeonhole principle has no short resolution proof.
    holes = range(11)
    inside = [[TERMS.variable(f"{p} in {h}") for h in holes] for p in range(12)]
    claims = [TERMS.disjunction(row) for row in inside]
    claims += [TERMS.at_most_one(row[h] for row in inside) for h in holes]
    assert decide(claims, timeout_ms=50).answer is Answer.UNKNOWN


@pytest.mark.parametrize("text", ["(assert)", "(assert q)", "(assert (= p))"])
def test_second_solver_refuses_what_is_no_smt_lib(text: str) -> None:
    with pytest.raises(Exception, match=r"\S"):
        by_cvc5(f"(set-logic QF_UF)(declare-const p Bool){text}(check-sat)")


def test_every_question_is_asked_with_the_one_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    set_to: list[tuple[object, ...]] = []
    monkeypatch.setattr(z3.Solver, "set", lambda _, *options: set_to.append(options))
    decide([Terms().true])
    minimal_siphons(Net("n", (Place("p"),)))
    assert [options for options in set_to if options[0] == "random_seed"] == [("random_seed", SEED)] * 2


@pytest.mark.parametrize(("found", "told"), [(z3.sat, z3.unknown), (z3.unsat, z3.unsat), (z3.unknown, z3.unknown)])
def test_a_model_that_comes_as_the_time_is_over_is_no_answer(
    monkeypatch: pytest.MonkeyPatch, found: z3.CheckSatResult, told: z3.CheckSatResult
) -> None:
    cancelled, solver = Event(), z3.Solver()

    def check() -> z3.CheckSatResult:
        cancelled.set()
        return found

    monkeypatch.setattr(solver, "check", check)
    assert answer(solver, Deadline(cancelled=cancelled)) == told
