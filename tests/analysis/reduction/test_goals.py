"""Goals over places alone: what they say, and by which values they may become true."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from support.whole_nets import formulas

from firable.analysis.reduction.goals import Value, goal_of, literals_in, rewritten, written_out
from firable.nets.formula import Compare, Constant, Count, Deadlock, Formula, Sign, names_in, parse_formula
from firable.nets.net import Net, Place, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate

PLACES = "abcd"
NET = Net(
    "n",
    tuple(Place(p, marked=p in "ab") for p in PLACES),
    (
        Transition("t", ("a",), ("c",), ("b",), ("d",)),
        Transition("u", ("b",), ("b",)),
        Transition("v", ("c", "d"), ("a",)),
    ),
)
COUNTS = st.builds(Count, st.lists(st.sampled_from(PLACES), max_size=4).map(tuple), st.integers(0, 3))
FORMULAS = st.one_of(formulas(list(PLACES), ["t", "u", "v"]), st.builds(Compare, COUNTS, st.sampled_from(Sign), COUNTS))
VALUES = st.dictionaries(
    st.sampled_from(PLACES[1:]), st.one_of(st.booleans(), st.tuples(st.just("a"), st.booleans())), max_size=3
)


def value(formula: Formula, marking: int) -> bool:
    return evaluate(BOOL, NET, formula, lambda place: bool(marking >> place & 1))


@given(FORMULAS)
def test_written_out_over_places_a_formula_says_the_same(formula: Formula) -> None:
    goal = goal_of(NET, formula)
    assert all(type(atom).__name__ == "Holds" for atom in names_in(goal.formula))
    for marking in range(16):
        assert value(goal.as_formula(), marking) == value(formula, marking)


@given(FORMULAS, VALUES)
def test_rewriting_keeps_the_value_where_the_places_have_what_stands_for_them(
    formula: Formula, values: dict[str, Value]
) -> None:
    formula = written_out(NET, formula)
    new = rewritten(formula, values)
    assert not values.keys() & {atom.place for atom in names_in(new) if hasattr(atom, "place")}
    for marking in range(16):
        if all(
            bool(marking >> PLACES.index(p) & 1)
            == (v if isinstance(v, bool) else bool(marking >> PLACES.index(v[0]) & 1) == v[1])
            for p, v in values.items()
        ):
            assert value(new, marking) == value(formula, marking)


@given(FORMULAS)
def test_a_formula_becomes_true_only_by_its_literals(formula: Formula) -> None:
    formula = written_out(NET, formula)
    literals = set(literals_in(formula))
    for marking in range(16):
        for i, place in enumerate(PLACES):
            after = marking ^ 1 << i
            if not value(formula, marking) and value(formula, after):
                assert (place, bool(after >> i & 1)) in literals


def test_only_a_deadlock_in_conjunction_is_kept_as_such() -> None:
    assert goal_of(NET, parse_formula("deadlock and a")).deadlock
    assert not goal_of(NET, parse_formula("deadlock or a")).deadlock
    assert not goal_of(NET, parse_formula("not deadlock")).deadlock
    assert goal_of(NET, Deadlock()).as_formula() == Deadlock()
    assert goal_of(NET, parse_formula("deadlock and a and not a")).as_formula() == Constant(value=False)


def test_a_deadlock_is_seen_under_negations_as_queries_bring_them() -> None:
    # "AG not deadlock" and "AG (deadlock -> c)" come as goals with a negation around them
    for text, left in (("not not deadlock", "true"), ("not (deadlock -> c)", "not c")):
        goal = goal_of(NET, parse_formula(text))
        assert goal.deadlock, text
        assert goal.formula == parse_formula(left), text
