"""What a document may ask of its checker: it ends in time, and says one thing of each verdict."""

import json
import random
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from typing import Any

import pytest
from support.evidence_examples import CIRCUIT, EXAMPLES, LOOP, RACING

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.check import check
from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence import claim_records
from firable.analysis.evidence.certificate import (
    Certificate,
    Diagram,
    Equation,
    FiringSequence,
    InductiveInvariant,
    Inequality,
    Labelling,
    Markings,
    Reduction,
    Rule,
    Step,
    Theorem,
    TheoremName,
    Unfolded,
)
from firable.analysis.evidence.checking.checker import Checked, check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence, TimedTerms
from firable.analysis.evidence.checking.obligations import diagram_term, obligations, played
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record, document_from_text, seal
from firable.analysis.evidence.meaning import suffices
from firable.analysis.evidence.producing import spaces as producing
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.labels import drawn
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.evidence.producing.room import Room
from firable.analysis.evidence.producing.runs import runs_by_search, runs_on_graph
from firable.analysis.evidence.read_off import eager_cycle
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.goal import Limits
from firable.analysis.induction.smt import Answer, Decision, Term, decide
from firable.analysis.spaces.reachability import REASONS, Budget, ReachabilityGraph, explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Holds, Or
from firable.nets.net import Command, ExternalGate, Net, Place, Signal, Transition
from firable.nets.queries import parse_query
from firable.nets.temporal import parse_temporal
from firable.semantics.firing import firable
from firable.semantics.trace import Discipline

STILL = Net("still", tuple(Place(f"p{i}", marked=i % 2 == 0) for i in range(60)))
TOGETHER = And((Holds("p0"), Holds("p1")))


def of_sums(*sums: Equation | Inequality, net: Net = STILL, depth: int = 0) -> Evidence:
    equations = tuple(one for one in sums if isinstance(one, Equation))
    certificate: Certificate = InductiveInvariant(
        equations, (), depth, tuple(one for one in sums if isinstance(one, Inequality))
    )
    return Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, TOGETHER), certificate)


def test_a_sum_with_too_many_values_shows_nothing() -> None:
    draw = random.Random(0)
    weights = tuple((place.name, draw.getrandbits(64)) for place in STILL.places)
    tokens = sum(weight for place, (_, weight) in zip(STILL.places, weights, strict=True) if place.marked)
    for one in (Equation(weights, tokens), Inequality(weights, tokens)):
        found = check_evidence(of_sums(one))
        assert found.shown is None
        assert "different values" in found.bound


def test_weights_as_large_as_they_like_are_read_where_they_make_few_values() -> None:
    pair = (("p0", 10**30), ("p1", 10**30))
    net = Net("still", (Place("p0", marked=True), Place("p1")))
    assert check_evidence(of_sums(Equation(pair, 10**30), net=net)).shown


def test_obligations_of_many_firings_are_written_in_time() -> None:
    with pytest.raises(TimeIsOverError):
        obligations(of_sums(depth=1_000), Deadline.after(0))


@pytest.mark.parametrize("name", ["starvation", "steps-serialisable", "conflicting-commands"])
def test_what_is_read_off_the_net_is_read_in_time(name: str) -> None:
    places = tuple(replace(p, command=Command("m", p.name)) for p in RACING.places)
    net, discipline = replace(RACING, places=places), Discipline.STEP
    suffices(net, discipline, name, proved=True, claims=[], query=None, deadline=NEVER)
    with pytest.raises(TimeIsOverError):
        suffices(net, discipline, name, proved=True, claims=[], query=None, deadline=Deadline.after(0))
    (checked,) = check_document(Document(net, discipline, (Record(name, True, ()),)), timeout_ms=0)
    assert (checked.shown, checked.only_claimed) == (False, "the time was over")


@pytest.mark.parametrize(
    ("records", "reason"),
    [
        ([Record("self-loops", True, (), query="ctl AG a")], "is no query"),
        ([Record("", True, (), query="ctl AG a")], "is no query"),
        ([Record("self-loops", True, ()), Record("self-loops", False, ())], "stands twice"),
        ([Record("query.q", True, (), query="ctl AG a"), Record("query.q", True, (), query="AG b")], "stands twice"),
    ],
)
def test_a_document_says_one_thing_of_each_verdict(records: list[Record], reason: str) -> None:
    text = Document(LOOP, Discipline.INTERLEAVING, tuple(records)).to_text()
    with pytest.raises(InputError, match=reason) as caught:
        document_from_text(text)
    assert [found.code for found in caught.value.diagnostics] == ["F6001"]


def test_what_a_document_says_to_be_lacking_is_not_shown() -> None:
    records = (Record("self-loops", True, ()), Record("structural-conflicts", True, (), lacking="no time"))
    checked = check_document(Document(LOOP, Discipline.INTERLEAVING, records))
    assert [(one.shown, one.only_claimed) for one in checked] == [(True, ""), (False, "only claimed: no time")]


def test_a_claim_that_stood_before_names_its_certificate_and_one_that_did_not_is_refused() -> None:
    found = EXAMPLES["markings"]()
    assert found is not None
    one = ((found.claim, found.certificate),)
    document = Document(found.net, found.discipline, (Record("deadlock-free", True, one), Record("", True, one)))
    text = document.to_text()
    assert text.count('{"kind":"before"}') == 1
    again = document_from_text(text)
    assert again.to_text() == text
    assert again.records[1].shown[0][1] is again.records[0].shown[0][1]
    assert [checked.shown for checked in check_document(again)] == [True, True]
    other = document_from_text(replace(document, records=(document.records[0],)).to_text()).records[0].shown[0][1]
    assert other is not found.certificate
    whole = replace(document, records=(document.records[0], Record("", True, ((found.claim, other),)))).to_text()
    assert '{"kind":"before"}' not in whole  # it is another certificate
    data = json.loads(text)
    data["verdicts"].reverse()
    with pytest.raises(InputError, match="no verdict before has"):
        document_from_text(json.dumps({**data, "seal": seal(data)}))


def test_another_certificate_of_a_claim_that_was_shown_is_looked_at() -> None:
    found = EXAMPLES["traps"]()
    assert found is not None
    assert isinstance(found.certificate, InductiveInvariant)
    wrong = replace(found.certificate, clauses=())
    records = tuple(Record("", True, ((found.claim, one),)) for one in (found.certificate, wrong))
    checked = check_document(Document(found.net, found.discipline, records))
    assert next(checked).shown
    with pytest.raises(InputError, match="F6002"):
        next(checked)


@pytest.mark.parametrize("edges_max", [100_000, 0])
def test_each_claim_is_looked_at_on_the_markings_of_its_own(edges_max: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", edges_max)
    sets = (Markings((1, 2)), Markings((2,)))
    claims = (Claim(ClaimKind.NEVER, And((Holds("a"), Holds(name)))) for name in ("b", "z"))
    shown = tuple((claim, Labelling(markings)) for claim, markings in zip(claims, sets, strict=True))
    with pytest.raises(InputError, match="the initial marking is not in the set"):
        list(check_document(Document(LOOP, Discipline.INTERLEAVING, (Record("", True, shown),))))


OF_PARTS = Evidence(
    LOOP,
    Discipline.INTERLEAVING,
    Claim(ClaimKind.NEVER, Or((Holds("z"), And((Holds("a"), Holds("b")))))),
    Labelling(Diagram(("a", "b", "z"), ((1, 0, 1), (2, 2, 1)), (3,))),
)
ONE_EACH = InductiveInvariant((Equation((("a", 1), ("b", 1)), 1), Equation((("c", 1), ("d", 1)), 1)))
BY_SUMS = Evidence(
    CIRCUIT, Discipline.INTERLEAVING, Claim(ClaimKind.LIVE), Theorem(TheoremName.MARKED_GRAPH, contact=ONE_EACH)
)
SOLVED: dict[str, Callable[[], Evidence | None]] = {
    "a diagram": lambda: OF_PARTS,
    "a theorem on sums": lambda: BY_SUMS,
    **{name: EXAMPLES[name] for name in ("invariant", "traps", "reduction", "reduced to a part")},
    **{name: EXAMPLES[name] for name in ("free choice", "free choice by ranks")},
}


@pytest.mark.parametrize("name", SOLVED)
def test_what_the_solver_gives_up_is_not_shown(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found, questions = SOLVED[name](), count()
    assert found is not None

    def checked(given_up: int) -> Checked:
        asked = count()

        def answer(*of: Any, **limits: Any) -> Decision:
            next(questions)
            return Decision(Answer.UNKNOWN, reason="why not") if next(asked) == given_up else decide(*of, **limits)

        monkeypatch.setattr("firable.analysis.evidence.checking.checker.decide", answer)
        return check_evidence(found)

    assert checked(-1).shown
    asked_in_all = next(questions)
    assert asked_in_all
    for given_up in range(asked_in_all):
        told = checked(given_up)
        assert told.shown is None
        assert "z3 gave up" in told.bound
        assert told.bound.endswith("why not")


def test_claims_of_no_verdict_may_stand_beside_each_other() -> None:
    text = Document(LOOP, Discipline.INTERLEAVING, (Record("", True, ()), Record("", True, ()))).to_text()
    assert len(document_from_text(text).records) == 2


def test_a_formula_of_ltl_that_few_markings_show_is_shown_where_nobody_lists_all() -> None:
    net = family_net("machines-40")
    claim = Claim(ClaimKind.LTL, parse_temporal("start"))
    certificate = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim)
    assert certificate == Unfolded(Markings((net.initial_marking,)))


def test_without_a_diagram_in_time_ctl_is_shown_on_more_listed_markings(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> None:
        raise BudgetExceeded

    net, claim = family_net("machines-4"), Claim(ClaimKind.CTL, parse_temporal("AG EF start"))
    monkeypatch.setattr(producing, "MARKINGS_MAX", 3)
    on_diagram = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim)
    assert isinstance(on_diagram, Labelling)
    assert isinstance(on_diagram.space, Diagram)
    monkeypatch.setattr(producing, "explore_symbolically", late)
    listed = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim)
    assert isinstance(listed, Labelling)
    assert isinstance(listed.space, Markings)
    assert len(listed.space.markings) == 16
    assert check_evidence(Evidence(net, Discipline.INTERLEAVING, claim, listed)).shown
    monkeypatch.setattr(producing, "WIDE_MAX", 15)
    many = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim)
    assert isinstance(many, Labelling)
    assert many.space == listed.space
    monkeypatch.setattr(producing, "MANY_MAX", 15)
    with pytest.raises(LackingError, match="markings than are listed, and no decision diagram of them at hand"):
        Certifier(net, Discipline.INTERLEAVING, Limits()).certify(claim)


@pytest.fixture
def without_diagrams(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object) -> None:
        raise BudgetExceeded

    monkeypatch.setattr(producing, "explore_symbolically", late)


def ending_in(n: int, *ends: str) -> Net:
    """So many machines that work and rest, and a place that goes to an end, or to one of several, while they do."""
    machines = family_net(f"machines-{n}")
    moves = tuple(Transition(f"to_{end}", ("open",), (end,)) for end in ends)
    turns = tuple(Transition(f"turn_{end}", (end,), (f"{end}2",)) for end in ends)
    back = tuple(Transition(f"back_{end}", (f"{end}2",), (end,)) for end in ends)
    places = (Place("open", marked=True), *(Place(f"{end}{k}") for end in ends for k in ("", "2")))
    transitions = (*machines.transitions, *moves, *turns, *back)
    return replace(machines, places=(*machines.places, *places), transitions=transitions)


@pytest.mark.parametrize(("machines", "ends"), [(11, ("left",)), (15, ("left", "right"))])
@pytest.mark.usefixtures("without_diagrams")
def test_many_markings_without_a_diagram_show_every_verdict(machines: int, ends: tuple[str, ...]) -> None:
    net = ending_in(machines, *ends)
    texts = ("ctl AG EF AX EX turn", "ctl EF EG open", "ctl AF AG not open", "ctl E[open U AX not open]")
    queries = [parse_query(text.replace("turn", "firable(turn_left)"), f"q{i}") for i, text in enumerate(texts)]
    report = check(net, method="explicit", queries=queries)
    assert report.figures.markings == (1 + 2 * len(ends)) * 2**machines
    found = evidence_of_report(report, queries)
    text = found.to_text()
    assert '"kind":"ascending"' in text or len(ends) == 1
    again = document_from_text(text)
    assert again.records == found.records
    checked = {one.record.name: one for one in check_document(again)}
    assert [name for name, one in checked.items() if not one.shown] == []
    assert {"home-markings", "starvation", "live", "reversible", "query.q0"} <= set(checked)
    assert checked["home-markings"].record.proved is (len(ends) == 1)


def test_what_finds_no_room_in_a_document_is_only_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    report = check(family_net("philosophers-4"), method="explicit")
    whole = [record.name for record in evidence_of_report(report).records if record.lacking]
    monkeypatch.setattr("firable.analysis.evidence.producing.producer.Room", lambda: Room(100))
    found = evidence_of_report(report)
    lacking = {record.name: record.lacking for record in found.records if record.lacking and record.name not in whole}
    assert set(lacking.values()) == {"the document would be larger than what is read"}
    assert 0 < len(lacking) < len(found.records)
    assert len(found.to_text()) < 20_000


@pytest.mark.parametrize(
    ("steps", "reason"), [(["1", "0"], "not in order"), (["1", "fffff"], "does not have"), (["1", "-1"], "pattern")]
)
def test_steps_of_a_large_set_are_refused_where_they_make_none(
    steps: list[str], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(claim_records, "APART_MAX", 0)
    claim = Claim(ClaimKind.NEVER, Holds("z"))
    of = Labelling(Markings((LOOP.initial_marking, 2)))
    text = Document(LOOP, Discipline.INTERLEAVING, (Record("", True, ((claim, of),)),)).to_text()
    assert document_from_text(text).records[0].shown[0][1] == of
    data = json.loads(text)
    data["sets"][0]["markings"] = steps
    with pytest.raises(InputError, match=reason):
        document_from_text(json.dumps({**data, "seal": seal(data)}))


def test_the_first_of_a_large_set_may_be_the_marking_without_tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claim_records, "APART_MAX", 0)
    net = Net("taken", (Place("a", marked=True), Place("z")), (Transition("take", ("a",)),))
    of = Labelling(Markings((0, 1)))
    document = Document(net, Discipline.INTERLEAVING, (Record("", True, ((Claim(ClaimKind.NEVER, Holds("z")), of),)),))
    assert '"ascending","markings":["0","1"]' in document.to_text()
    assert document_from_text(document.to_text()) == document


def test_a_net_of_many_parts_fires_all_its_transitions_in_few_runs() -> None:
    net = family_net("machines-300")
    names = [transition.name for transition in net.transitions]
    runs, left = runs_by_search(net, names, Limits())
    assert left == []
    assert {name for run in runs for fired in run for name in fired} == set(names)
    assert len(runs) <= 3
    assert sum(map(len, runs)) <= 4 * len(names)
    for run in runs:
        played(net, Discipline.INTERLEAVING, run)


def test_runs_are_not_looked_for_when_the_time_is_over() -> None:
    net = family_net("machines-8")
    with pytest.raises(BudgetExceeded):
        runs_by_search(net, [transition.name for transition in net.transitions], Limits(Deadline.after(0)))


def test_the_arbitrated_run_costs_what_happens_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = 0

    def counted(*of: Any) -> Any:
        nonlocal asked
        asked += 1
        return firable(*of)

    monkeypatch.setattr("firable.analysis.evidence.read_off.firable", counted)
    net = ring(200)
    assert eager_cycle(net) == frozenset(transition.name for transition in net.transitions)
    assert asked <= 5 * len(net.transitions)


def test_each_transition_is_asked_where_it_fires_a_few_times_on_a_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, may_fire = 0, ReachabilityGraph.may_fire

    def counted(graph: ReachabilityGraph, t: int) -> Any:
        nonlocal asked
        asked += 1
        return may_fire(graph, t)

    monkeypatch.setattr(ReachabilityGraph, "may_fire", counted)
    net = ring(200)
    (run,) = runs_on_graph(explore(net), list(net.transition_index), None)
    assert len(run.firings) == len(net.transitions)
    assert asked <= 2 * len(net.transitions)


def test_a_diagram_is_as_large_a_term_as_it_has_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    negations, negation = 0, TimedTerms.negation

    def counted(terms: TimedTerms, term: Term) -> Term:
        nonlocal negations
        negations += 1
        return negation(terms, term)

    monkeypatch.setattr(TimedTerms, "negation", counted)
    net, terms = family_net("machines-200"), TimedTerms()
    diagram = drawn(explore_symbolically(net))
    names = [terms.variable(place.name) for place in net.places]
    diagram_term(terms, net, diagram, names.__getitem__)
    assert negations <= 2 * len(diagram.rows) + len(net.places)


def ring(n: int) -> Net:
    """One token that goes round so many places."""
    places = tuple(Place(f"p{i}", marked=i == 0) for i in range(n))
    return Net("ring", places, tuple(Transition(f"t{i}", (f"p{i}",), (f"p{(i + 1) % n}",)) for i in range(n)))


def test_searches_for_something_smaller_share_one_part_of_the_time_where_all_markings_are_held() -> None:
    """Else each of many claims takes its part, and nothing is left for those that only the markings show."""
    net, limits = family_net("philosophers-4"), Limits(Deadline.after(1000))
    held = producing.Spaces(net, Discipline.INTERLEAVING, limits, explore(net))
    first, second = (held.part_of_a_search(1.0).at_seconds for _ in range(2))
    assert first == second < limits.deadline.at_seconds - 700
    held._for_less = Deadline.after(0)  # it is used up
    assert held.part_of_a_search(1.0).over
    assert not held.part_of_a_run().over, "what fires something has a part of its own"
    alone = producing.Spaces(net, Discipline.INTERLEAVING, limits)
    assert alone.part_of_a_search(1.0).at_seconds > limits.deadline.at_seconds - 700


def test_evidence_of_two_ends_that_time_is_over_for_is_lacking() -> None:
    report = check(ending_in(5, "left", "right"), method="symbolic")
    found = evidence_of_report(report, limits=Limits(Deadline.after(0)))
    lacking = {record.name: record.lacking for record in found.records if record.lacking}
    assert lacking["home-markings"] == "the time for evidence was over"


def test_evidence_is_made_of_a_diagram_where_the_explicit_engine_has_no_room_for_the_net() -> None:
    net = family_net("machines-8")
    report = check(net, method="symbolic")
    found = evidence_of_report(report, limits=Limits(memory_bytes=1))
    lacking = {record.name for record in found.records if record.lacking}
    assert "live" not in lacking
    assert [checked.record.name for checked in check_document(found) if not checked.shown] == sorted(lacking)


def test_evidence_that_memory_does_not_suffice_for_says_so() -> None:
    """Neither is the time over, nor are there too many markings of a net of eighty, of which the memory holds none."""
    report = check(catalogue_net("one_robot"), budget=Budget(markings=5))
    assert report.verdict("property.accepted_is_carried_out").holds
    found = evidence_of_report(report, limits=Limits(memory_bytes=1))
    lacking = {record.name: record.lacking for record in found.records}
    assert lacking["property.accepted_is_carried_out"] == "the memory for evidence was used up"


def test_the_time_of_one_search_is_no_reason_why_a_smaller_one_has_too_few_markings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def in_time(net: Net, discipline: Discipline, budget: Budget, deadline: Deadline) -> ReachabilityGraph:
        return explore(net, discipline, budget, deadline=deadline if budget.markings <= 200 else Deadline.after(0))

    for most in ("MARKINGS_MAX", "WIDE_MAX"):
        monkeypatch.setattr(producing, most, 200)
    monkeypatch.setattr(producing, "explore", in_time)
    of = producing.Spaces(family_net("philosophers-8"), Discipline.INTERLEAVING, Limits())
    assert (of.wide, of.many) == (None, None)
    assert (of.ended(200), of.ended(producing.MANY_MAX)) == ("", "the time for evidence was over")


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (BudgetExceeded("the time was over"), "the time for evidence was over"),
        (BudgetExceeded("the budget of memory is used up"), "the memory for evidence was used up"),
        (IncompleteGraph("the exploration ended early: memory"), "the memory for evidence was used up"),
        (IncompleteGraph("the exploration ended early: markings"), "the markings for evidence were used up"),
        (IncompleteGraph(f"5 markings found, 7 edges followed: {REASONS['time']}"), "the time for evidence was over"),
        (BudgetExceeded("the search for a run was given up"), "the search for a run was given up"),
    ],
)
def test_what_asks_a_space_out_of_its_budget_beside_its_claims_is_lacking(
    monkeypatch: pytest.MonkeyPatch, error: Exception, why: str
) -> None:
    def late(*_: object) -> None:
        raise error

    monkeypatch.setattr(Certifier, "run_in_order", late)
    commands = {"p0": Command("m", "run"), "p1": Command("m", "stop")}
    places = tuple(Place(p, marked=p == "p0", command=of) for p, of in commands.items())
    net = Net("turns", places, (Transition("go", ("p0",), ("p1",)), Transition("back", ("p1",), ("p0",))))
    lacking = {record.name: record.lacking for record in evidence_of_report(check(net)).records if record.lacking}
    assert lacking == {"machine-never-stopped": why}


def in_stages(n_places: int, n_ways: int) -> Evidence:
    """From each place to the next there are many ways, and a reduction composes all of them with each other."""
    names = [f"p{i}" for i in range(n_places)]
    ways = ((i, k) for i in range(n_places - 1) for k in range(n_ways))
    places = tuple(Place(name, marked=name == "p0") for name in names)
    of = Net("stages", places, tuple(Transition(f"t{i}-{k}", (names[i],), (names[i + 1],)) for i, k in ways))
    steps = tuple(Step(Rule.OPENERS_LATE, places=(name,)) for name in names[1:-1])
    return Evidence(of, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, Holds(names[-1])), Reduction(steps))


def with_signals(n_signals: int) -> Evidence:
    """Who fires depends on signals of which each may be 0 or 1."""
    signals = tuple(Signal(f"s{i}") for i in range(n_signals))
    ways = tuple(Transition(f"t{i}", ("a",), ("b",), external=(ExternalGate(f"s{i}"),)) for i in range(n_signals))
    of = Net("signals", (Place("a", marked=True), Place("b")), ways, signals)
    claim = Claim(ClaimKind.NEVER, And((Holds("a"), Holds("b"))))
    return Evidence(of, Discipline.STEP, claim, Labelling(Markings((1, 2))))


def with_clauses(n_signals: int) -> Evidence:
    """Whether one transition is a step alone is whether clauses of three literals can be true together."""
    of, n_clauses = random.Random(3), 5 * n_signals
    places = [Place("a", marked=True), Place("b")]
    transitions = [Transition("t", ("a",), ("b",))]
    for i in range(n_clauses):
        gates = (ExternalGate(f"s{k}", wanted=of.random() < 0.5) for k in of.sample(range(n_signals), 3))
        places += [Place(f"c{i}", marked=True), Place(f"d{i}")]
        transitions.append(Transition(f"u{i}", (f"c{i}",), (f"d{i}",), external=tuple(gates)))
    net = Net("clauses", tuple(places), tuple(transitions), tuple(Signal(f"s{i}") for i in range(n_signals)))
    return Evidence(net, Discipline.STEP, Claim(ClaimKind.REACHABLE, Holds("b")), FiringSequence((("t",),)))


@pytest.mark.parametrize("evidence", [in_stages(5, 20), with_signals(18), with_clauses(24)], ids=lambda of: of.net.name)
def test_what_a_small_document_makes_a_checker_do_ends_in_time(evidence: Evidence) -> None:
    assert check_evidence(evidence, timeout_ms=100).shown is None
