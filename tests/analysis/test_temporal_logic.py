"""CTL and LTL over state spaces: against the definitions, over both kinds of space, with evidence that is judged."""

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples
from support.naive_space import Markings, NaiveSpace
from support.ring_nets import ring_nets
from support.temporal_formulas import ctl_formulas, ltl_formulas

from firable.analysis.spaces.columns import Column
from firable.analysis.spaces.reachability import ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.temporal.ctl import Ctl
from firable.analysis.temporal.lasso import Run, accepted_run, satisfies, witness_of
from firable.analysis.temporal.ltl import refuting
from firable.analysis.temporal.queries import answer
from firable.analysis.temporal.sets import Sets
from firable.nets.formula import Formula, Holds
from firable.nets.net import Net, Place, Transition
from firable.nets.queries import Query
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    format_temporal,
    negated,
    parse_temporal,
)
from firable.nets.verdict import Status
from firable.semantics.trace import Discipline


def names(net: Net) -> tuple[list[str], list[str]]:
    return [place.name for place in net.places], [transition.name for transition in net.transitions]


@st.composite
def asked(draw: st.DrawFn, *, linear: bool, events: bool = True) -> tuple[Net, Temporal]:
    """A net and a formula over its names."""
    net = draw(ring_nets())
    places, transitions = names(net)
    formulas = ltl_formulas(places, transitions, events=events) if linear else ctl_formulas(places, transitions)
    return net, draw(formulas)


def by_definition(space: NaiveSpace, formula: Temporal) -> Markings:
    """The markings in which a formula of CTL holds, each operator by unfolding: p now, or the same next."""
    everything, graph = frozenset(space.graph), space.graph

    def least(now: Markings, through: Markings, *, every: bool) -> Markings:
        found = now
        while True:
            quantifier = all if every else any
            more = {m for m in through if graph[m] and quantifier(after in found for _, after in graph[m])}
            if more <= found:
                return found
            found |= more

    match formula:
        case TemporalNot(operand):
            return everything - by_definition(space, operand)
        case TemporalAnd(operands):
            return everything.intersection(*(by_definition(space, one) for one in operands))
        case TemporalOr(operands):
            return frozenset[int]().union(*(by_definition(space, one) for one in operands))
        case Exists(Next(operand)):
            inside = by_definition(space, operand)
            return frozenset(m for m in everything if any(after in inside for _, after in graph[m]))
        case ForAll(Next(operand)):
            inside = by_definition(space, operand)
            return frozenset(m for m in everything if all(after in inside for _, after in graph[m]))
        case Exists(path) | ForAll(path):
            every = isinstance(formula, ForAll)
            match path:
                case Eventually(operand):
                    return least(by_definition(space, operand), everything, every=every)
                case Globally(operand):
                    return everything - least(everything - by_definition(space, operand), everything, every=not every)
                case Until(left, right):
                    return least(by_definition(space, right), by_definition(space, left), every=every)
    assert isinstance(formula, Formula)
    return space.satisfying(formula)


def markings_of(graph: ReachabilityGraph, column: Column) -> Markings:
    return frozenset(graph.markings(np.flatnonzero(column)))


@examples(15)
@given(asked(linear=False), st.sampled_from(Discipline))
def test_ctl_holds_where_its_definition_says_over_both_spaces(question: tuple[Net, Temporal], how: Discipline) -> None:
    net, formula = question
    naive, graph = NaiveSpace(net, how), explore(net, how)
    expected = by_definition(naive, formula)
    assert Ctl(Sets(naive)).of(formula) == expected
    assert markings_of(graph, Ctl(Sets(graph)).of(formula)) == expected


@examples(10)
@given(asked(linear=False))
def test_the_evidence_of_ctl_is_a_run_of_the_net(question: tuple[Net, Temporal]) -> None:
    net, formula = question
    verdict = answer(explore(net), Query.of("q", formula))
    match formula, verdict.status:
        case (Exists(), Status.PROVED) | (ForAll(), Status.VIOLATED):
            assert verdict.witness is not None
        case (ForAll(), Status.PROVED) | (Exists(), Status.VIOLATED):
            assert verdict.witness is None
    if (witness := verdict.witness) is None:
        return
    index = net.transition_index
    cycle = tuple(tuple(index[name] for name in fired) for fired in witness.cycle)
    run = Run(tuple(tuple(index[name] for name in fired) for fired in witness.firings), cycle)
    for inner in (formula, negated(formula)):
        match inner:
            case Exists(Globally(operand)) if isinstance(operand, Formula):
                assert satisfies(net, run, Globally(operand)) is (verdict.status is Status.PROVED)
            case TemporalNot(ForAll(Eventually(operand))) if isinstance(operand, Formula):
                assert not satisfies(net, run, Eventually(operand))  # it shows `not AF`, asked or refuted


def some_runs(net: Net, seed: int, n_runs: int = 6) -> list[Run]:
    """Lassos of the net: random walks until a marking comes again, or a deadlock."""
    draw, space = random.Random(seed), NaiveSpace(net)
    runs = []
    for _ in range(n_runs):
        at, fired, seen = net.initial_marking, list[tuple[int, ...]](), dict[int, int]()
        until = draw.randint(0, 6)  # go on that long even where a cycle could be closed
        while space.graph[at] and (at not in seen or len(fired) < until):
            seen[at] = len(fired)
            label, at = draw.choice(space.graph[at])
            fired.append(label)
        begin = seen[at] if space.graph[at] else len(fired)
        runs.append(Run(tuple(fired[:begin]), tuple(fired[begin:])))
    return runs


@examples(30)
@given(asked(linear=True), st.integers(0, 2**16))
def test_ltl_fails_where_a_run_refutes_it_over_both_spaces(question: tuple[Net, Temporal], seed: int) -> None:
    net, formula = question
    naive, graph = refuting(Sets(NaiveSpace(net)), formula), refuting(Sets(explore(net)), formula)
    assert (naive is None) == (graph is None)
    for run in some_runs(net, seed):
        if not satisfies(net, run, formula):
            assert naive is not None, (format_temporal(formula), run)
    for found in (naive, graph):
        if found is not None:
            run = accepted_run(*found)
            witness_of(net, Discipline.INTERLEAVING, run, "")
            assert not satisfies(net, run, formula)


@examples(20)
@given(asked(linear=True))
def test_a_formula_and_its_negation_are_not_both_refuted_by_one_run_nor_both_kept(
    question: tuple[Net, Temporal],
) -> None:
    net, formula = question
    space = Sets(NaiveSpace(net))
    kept = [refuting(space, one) is None for one in (formula, negated(formula))]
    assert kept != [True, True]  # there is a run


@examples(13)
@given(st.data(), ring_nets())
def test_the_decision_diagram_answers_like_the_definitions(data: st.DataObject, net: Net) -> None:
    places, transitions = names(net)
    naive, diagram = NaiveSpace(net), explore_symbolically(net)
    for formulas in (ctl_formulas(places, transitions), ltl_formulas(places, transitions)):
        query = Query.of("q", data.draw(formulas))
        expected, found = answer(naive, query), answer(diagram, query)
        assert found.status is expected.status
        assert (found.witness is None) == (expected.witness is None)


LAWS = [
    ("F p", "true U p"),
    ("G p", "not F not p"),
    ("p R q", "not (not p U not q)"),
    ("p W q", "p U q or G p"),
    ("X (p and q)", "X p and X q"),
    ("F (p or q)", "F p or F q"),
    ("p U (p U q)", "p U q"),
    ("G F G p", "F G p"),
    ("not X p", "X not p"),
    ("F (p U q)", "F q"),
]


@pytest.mark.parametrize(("one", "same"), LAWS)
@examples(10)
@given(ring_nets())
def test_the_laws_of_ltl_hold(one: str, same: str, net: Net) -> None:
    places, sets = names(net)[0], Sets(NaiveSpace(net))

    def holds(text: str) -> bool:
        formula = parse_temporal(text.replace("p", places[0]).replace("q", places[1]))
        return refuting(sets, formula) is None

    # Equal on every run, so neither implies what the other does not.
    assert holds(f"({one}) -> ({same})")
    assert holds(f"({same}) -> ({one})")


@examples(15)
@given(ring_nets())
def test_what_both_logics_say_they_decide_alike(net: Net) -> None:
    places, space = names(net)[0], NaiveSpace(net)
    p, q = Holds(places[0]), Holds(places[1])
    initial = space.net.initial_marking
    for linear, branching in (
        (Globally(p), ForAll(Globally(p))),
        (Eventually(p), ForAll(Eventually(p))),
        (Until(p, q), ForAll(Until(p, q))),
        (Globally(Eventually(p)), ForAll(Globally(ForAll(Eventually(p))))),
    ):
        assert (refuting(Sets(space), linear) is None) == (initial in Ctl(Sets(space)).of(branching))


def line(n: int = 2) -> Net:
    """a, then b, then c, where it ends."""
    return Net(
        "line",
        (Place("a", marked=True), Place("b"), Place("c")),
        (Transition("ab", ("a",), ("b",)), Transition("bc", ("b",), ("c",)))[:n],
    )


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        # In a deadlock there is no next marking: EX is false of anything, AX true. A run that ends there is maximal.
        ("EF EX true", True),
        ("AF not EX true", True),
        ("AF AX false", True),
        ("EG a", False),
        ("AF EG c", True),
        ("AF c", True),
        ("AG (c -> AG c)", True),
        ("A[a or b U c]", True),
        ("A[a U c]", False),
        ("E[a U c]", False),
        # LTL repeats the last marking, so it has a next one.
        ("F G c", True),
        ("F (c and X c)", True),
        ("G (c -> X c)", True),
        ("X X X X c", True),
        ("G X true", True),
        # An event is the next firing; in the deadlock nothing fires any more.
        ("fires(ab)", True),
        ("X fires(bc)", True),
        ("F (fires(bc) and X G not fires(bc))", True),
        ("G F (fires(ab) or fires(bc))", False),
        ("F G not (fires(ab) or fires(bc))", True),
        ("fires(ab) and fires(bc)", False),
    ],
)
def test_what_holds_of_a_run_that_ends_in_a_deadlock(text: str, holds: bool) -> None:
    for space in (NaiveSpace(line()), explore(line())):
        verdict = answer(space, Query.of("q", parse_temporal(text)))
        assert verdict.status is (Status.PROVED if holds else Status.VIOLATED), text


def test_a_lasso_that_ends_in_a_deadlock_has_no_cycle() -> None:
    verdict = answer(explore(line()), Query.of("q", parse_temporal("G F fires(ab)")))
    assert verdict.witness is not None
    assert verdict.witness.firings == (("ab",), ("bc",))
    assert verdict.witness.cycle == ()
    assert verdict.witness.marking == ("c",)


def test_a_cycle_passes_all_that_the_formula_asks_again_and_again() -> None:
    ring = Net(
        "ring",
        tuple(Place(p, marked=p == "a") for p in "abc"),
        tuple(Transition(x + y, (x,), (y,)) for x, y in ("ab", "ba", "bc", "cb")),
    )
    space: StateSpace[Column] = explore(ring)
    verdict = answer(
        space, Query.of("q", parse_temporal("not (G F a and G F c and G not fires(ba) or G F a and G F c)"))
    )
    assert verdict.status is Status.VIOLATED
    assert verdict.witness is not None
    assert {fired for step in verdict.witness.cycle for fired in step} == {"ab", "bc", "cb", "ba"}


def test_events_are_not_asked_of_steps() -> None:
    query = Query.of("q", parse_temporal("G not fires(ab)"))
    verdict = answer(explore(line(), Discipline.STEP), query)
    assert verdict.status is Status.UNKNOWN
    assert verdict.bound
