"""Bounded search and k-induction against exploration: what they decide is so, and they end when they are told to."""

from collections.abc import Callable
from dataclasses import replace
from threading import Event

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.dense_nets import PLACES, dense_nets
from support.evidence import evidence_of_finding
from support.examples import examples
from support.second_solver import by_cvc5
from support.whole_nets import formulas

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Clause, InductiveInvariant
from firable.analysis.evidence.checking.checker import check_evidence
from firable.analysis.evidence.checking.obligations import obligations
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.bounded import decide_by_bounded_search, shortened
from firable.analysis.induction.encoding import parallel_relation
from firable.analysis.induction.k_induction import decide_by_k_induction
from firable.analysis.induction.pdr import decide_by_pdr
from firable.analysis.induction.smt import Answer, Terms, decide
from firable.analysis.induction.strengthening import Facts, Traps, structural_facts
from firable.analysis.structure.invariants import p_invariants
from firable.analysis.structure.state_equation import decide_by_state_equation
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Deadlock, Formula, Holds, Not, Or
from firable.nets.net import ExternalGate, Net, Place, Signal, Transition
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline

DISCIPLINES = [Discipline.INTERLEAVING, Discipline.STEP]


def reachable(net: Net, goal: Formula, discipline: Discipline) -> bool:
    """What the reference player finds by playing everything."""
    found = Player(net).reachable(step=discipline is Discipline.STEP)
    return any(evaluate(BOOL, net, goal, holds_in(marking)) for marking in found)


def in_time(seconds: float = 20) -> Limits:
    return Limits(Deadline.after(seconds))


@st.composite
def questions(draw: st.DrawFn) -> tuple[Net, Formula]:
    net = draw(dense_nets(signals=True))
    return net, draw(formulas(list(PLACES), list(net.transition_index)))


CLOSING = Net(  # t0 closes the gate of t1, so only t1 before t0 puts tokens on both b and c
    "closing",
    (Place("a", marked=True), Place("b"), Place("c"), Place("d", marked=True)),
    (Transition("t0", ("a",), ("b",)), Transition("t1", ("d",), ("c",), permissive=("a",))),
)
RACING = Net(  # each closes the gate of the other: interleaving fires one of them, a step both
    "racing",
    (Place("a", marked=True), Place("b", marked=True)),
    (Transition("t0", ("a",), permissive=("b",)), Transition("t1", ("b",), permissive=("a",))),
)
TORN = Net(  # one wants s, the other not s: never in one step, yet one after the other
    "torn",
    (Place("a", marked=True), Place("b", marked=True)),
    (
        Transition("t0", ("a",), external=(ExternalGate("s"),)),
        Transition("t1", ("b",), external=(ExternalGate("s", wanted=False),)),
    ),
    (Signal("s"),),
)
NEITHER = And((Not(Holds("a")), Not(Holds("b"))))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=questions())
@example(question=(CLOSING, And((Holds("b"), Holds("c")))))
@example(question=(RACING, NEITHER))
@example(question=(TORN, NEITHER))
@examples(13)
def test_a_goal_is_found_by_bounded_search_iff_it_is_reachable(
    discipline: Discipline, question: tuple[Net, Formula]
) -> None:
    net, goal = question
    found = decide_by_bounded_search(net, goal, in_time(), discipline=discipline, depth_max=12)
    assert found.reachable is (True if reachable(net, goal, discipline) else None)
    if found.witness:
        assert evaluate(BOOL, net, goal, holds_in(net.marking(found.witness.marking)))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=questions())
@example(question=(RACING, NEITHER))
@example(question=(TORN, NEITHER))
@examples(13)
def test_what_k_induction_decides_is_so(discipline: Discipline, question: tuple[Net, Formula]) -> None:
    net, goal = question
    found = decide_by_k_induction(net, goal, in_time(), discipline=discipline, depth_max=4)
    assert found.reachable in {None, reachable(net, goal, discipline)}
    assert (found.certificate is not None) is (found.reachable is False)


@given(net=dense_nets(signals=True))
@examples(13)
def test_firings_in_parallel_reach_what_interleaving_reaches(net: Net) -> None:
    player, terms = Player(net), Terms()
    relation = parallel_relation(net, terms)
    known = [relation.term, relation.initial()]
    single = {after for _, after in player.successors(net.initial_marking)}
    everything = set(player.reachable())
    found = set()
    while (decision := decide(known)).answer is Answer.SAT:
        _, _, after = relation.edge(decision.assignment)
        found.add(after)
        known.append(terms.negation(relation.is_marking(after, after=True)))
    assert single <= found <= everything


@given(net=dense_nets(), discipline=st.sampled_from(DISCIPLINES))
@example(net=RACING, discipline=Discipline.STEP)
@examples(13)
def test_structural_facts_hold_in_every_reachable_marking(net: Net, discipline: Discipline) -> None:
    facts = structural_facts(net, Deadline())
    markings = Player(net).reachable(step=discipline is Discipline.STEP)
    traps = Traps(net, discipline)
    clauses = [*facts.clauses, *(trap for m in range(32) if (trap := traps.against(m, Deadline())))]
    for marking in markings:
        holds = {place for place in PLACES if place in net.names(marking)}
        for equation in facts.equations:
            assert sum(weight for name, weight in equation.weights if name in holds) == equation.tokens
        for clause in clauses:
            assert holds & set(clause.marked) or set(clause.empty) - holds


@given(question=questions())
@example(question=(RACING, NEITHER))
@example(question=(TORN, NEITHER))
@example(question=(CLOSING, And((Holds("b"), Holds("c")))))
@examples(25)
def test_property_directed_reachability_decides_every_goal(question: tuple[Net, Formula]) -> None:
    net, goal = question
    found = decide_by_pdr(net, goal, in_time())
    assert found.reachable is reachable(net, goal, Discipline.INTERLEAVING)
    evidence = evidence_of_finding(net, goal, found)
    assert evidence is not None
    assert check_evidence(evidence).shown is True
    assert {by_cvc5(obligation.text(evidence)) for obligation in obligations(evidence)} <= {"unsat"}


@pytest.mark.parametrize("family", ["counter-4", "interlocked-3", "grid-2", "philosophers_either-3"])
def test_each_place_is_reached_or_an_invariant_says_why_not(family: str) -> None:
    net = family_net(family)
    markings = Player(net).reachable()
    for first, second in zip(net.places, net.places[1:], strict=False):
        goal = And((Holds(first.name), Holds(second.name)))
        found = decide_by_pdr(net, goal, in_time())
        assert found.reachable is any(evaluate(BOOL, net, goal, holds_in(m)) for m in markings)
        evidence = evidence_of_finding(net, goal, found)
        assert evidence is not None
        assert check_evidence(evidence).shown is True


@pytest.mark.parametrize("questions_max", [1, 2, 3])
def test_a_solver_made_anew_answers_the_question_that_was_next(
    questions_max: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firable.analysis.induction.steps_into._QUESTIONS_MAX", questions_max)
    monkeypatch.setattr("firable.analysis.induction.pdr.structural_facts", lambda *_: Facts())
    for net in (family_net("philosophers-2"), family_net("counter-3"), CLOSING, RACING):
        for goal in (Deadlock(), And(tuple(Holds(place.name) for place in net.places[-2:]))):
            expected = reachable(net, goal, Discipline.INTERLEAVING)
            assert decide_by_pdr(net, goal, in_time()).reachable is expected


def test_an_invariant_is_found_where_the_arcs_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.induction.pdr.structural_facts", lambda *_: Facts())
    net = family_net("philosophers-2")
    goal = And((Holds("p1.eating"), Holds("p2.eating")))
    found = decide_by_pdr(net, goal, in_time())
    assert isinstance(found.certificate, InductiveInvariant)
    assert found.certificate.clauses
    evidence = evidence_of_finding(net, goal, found)
    assert evidence is not None
    assert check_evidence(evidence).shown is True
    assert {by_cvc5(obligation.text(evidence)) for obligation in obligations(evidence)} == {"unsat"}
    for i in range(len(found.certificate.clauses)):
        fewer = found.certificate.clauses[:i] + found.certificate.clauses[i + 1 :]
        weaker = replace(evidence, certificate=replace(found.certificate, clauses=fewer))
        answers = {by_cvc5(obligation.text(weaker)) for obligation in obligations(weaker)}
        if answers == {"unsat"}:  # the clause was not needed
            assert check_evidence(weaker).shown is True
        else:
            with pytest.raises(InputError, match="F6002"):
                check_evidence(weaker)


def test_a_place_that_no_token_can_come_to_is_known_to_stay_empty() -> None:
    net = Net("n", (Place("a", marked=True), Place("b")), (Transition("t", ("b",), ()),))
    assert structural_facts(net, Deadline()).clauses == (Clause(empty=("b",)),)


def doubling(stages: int) -> Net:
    """Each stage splits a token, and either half goes on: p0 weighs 2 ** stages times the last place."""
    places, transitions = [Place("p0", marked=True)], []
    for i in range(stages):
        whole, halves, after = f"p{i}", (f"a{i}", f"b{i}"), f"p{i + 1}"
        places += [Place(name) for name in (*halves, after)]
        transitions.append(Transition(f"s{i}", (whole,), halves))
        transitions += [Transition(f"{half}_goes_on", (half,), (after,)) for half in halves]
    return Net("doubling", tuple(places), tuple(transitions))


@pytest.mark.parametrize("decide_by", [decide_by_k_induction, decide_by_pdr, decide_by_state_equation])
def test_invariants_that_weigh_more_than_a_solver_takes_are_done_without(
    decide_by: Callable[[Net, Formula, Limits], Finding],
) -> None:
    net = doubling(40)
    assert max(weight for one in p_invariants(net).minimal for _, weight in one.weights) == 2**40
    assert structural_facts(net, Deadline()).equations == ()
    assert structural_facts(doubling(20), Deadline()).equations != ()
    goal = And((Holds("p39"), Not(Holds("a0"))))
    assert decide_by(net, goal, Limits(Deadline.after(2))).reachable is not False


def test_deadlock_is_excluded_by_a_marked_trap() -> None:
    # Two tokens chase each other through a fork and a join; no P-invariant alone excludes that all is empty.
    net = family_net("manufacturing_cells-2")
    found = decide_by_k_induction(net, Deadlock(), in_time())
    assert found.reachable is False
    assert isinstance(found.certificate, InductiveInvariant)


def test_the_number_of_philosophers_does_not_matter_to_induction() -> None:
    net = family_net("philosophers-40")
    goal = Or(tuple(And((Holds(f"p{i}.eating"), Holds(f"p{i % 40 + 1}.eating"))) for i in range(1, 41)))
    found = decide_by_k_induction(net, goal, in_time())
    assert found.reachable is False
    assert isinstance(found.certificate, InductiveInvariant)
    assert found.certificate.depth == 0


@pytest.mark.parametrize("decide_by", [decide_by_bounded_search, decide_by_k_induction, decide_by_pdr])
def test_the_deadlock_of_many_philosophers_is_a_step_away(decide_by: Callable[[Net, Formula, Limits], Finding]) -> None:
    found = decide_by(family_net("philosophers-20"), Deadlock(), in_time())
    assert found.reachable is True
    assert found.witness
    assert len(found.witness.firings) == 20


def test_the_late_machine_deadlocks_and_the_cell_does_not() -> None:
    late = decide_by_bounded_search(catalogue_net("one_robot_mc_late"), Deadlock(), in_time())
    assert late.reachable is True
    assert decide_by_bounded_search(catalogue_net("one_robot"), Deadlock(), in_time(), depth_max=10).reachable is None


def test_firings_that_the_goal_does_not_need_are_left_out() -> None:
    net = Net(
        "n", (Place("a", marked=True), Place("b", marked=True)), (Transition("t", ("a",)), Transition("u", ("b",)))
    )
    assert shortened(net, Not(Holds("a")), [1, 0]) == [(0,)]
    assert shortened(net, NEITHER, [1, 0]) == [(1,), (0,)]


@pytest.mark.parametrize("decide_by", [decide_by_bounded_search, decide_by_k_induction, decide_by_pdr])
def test_a_method_that_is_cancelled_answers_unknown(decide_by: Callable[[Net, Formula, Limits], Finding]) -> None:
    cancelled = Event()
    cancelled.set()
    found = decide_by(family_net("philosophers-5"), Holds("p1.eating"), Limits(Deadline(cancelled=cancelled)))
    assert found.reachable is None
    assert found.bound


@pytest.mark.parametrize("decide_by", [decide_by_bounded_search, decide_by_k_induction, decide_by_pdr])
def test_without_time_nothing_is_known(decide_by: Callable[[Net, Formula, Limits], Finding]) -> None:
    assert decide_by(family_net("philosophers-5"), Deadlock(), in_time(0)).reachable is None


@pytest.mark.parametrize("decide_by", [decide_by_bounded_search, decide_by_k_induction, decide_by_pdr])
def test_without_memory_nothing_is_known(decide_by: Callable[[Net, Formula, Limits], Finding]) -> None:
    assert decide_by(family_net("philosophers-20"), Deadlock(), Limits(memory_bytes=2**20)).reachable is None
