"""A claim of any kind has evidence iff it is true, and no false claim passes the checker, whatever is forged."""

import json
import random
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.classed_nets import free_choice_nets, marked_graphs
from support.dense_nets import dense_nets
from support.evidence import certified, document
from support.evidence_examples import ENDING, EXAMPLES, LOOP, on_diagram
from support.examples import examples, seeds
from support.lively_nets import lively_net
from support.ring_nets import ring_nets
from support.second_solver import by_cvc5
from support.temporal_formulas import ctl_formulas, ltl_formulas
from support.true_claims import true
from support.whole_nets import formulas

from firable.analysis.check import check
from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.obligations import obligations
from firable.analysis.evidence.claims import Claim, ClaimKind, is_marking, marking_of, tidy, without_start
from firable.analysis.evidence.document import Document, document_from_text, seal
from firable.analysis.evidence.meaning import commands_clash, completions_clash, contact
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.lacking import LackingError
from firable.analysis.evidence.producing.producer import evidence_of_report
from firable.analysis.goal import Limits
from firable.analysis.methods import Method
from firable.analysis.spaces.reachability import explore
from firable.analysis.temporal.queries import answer
from firable.analysis.verdicts.goals import goals_of
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Deadlock, Firable, Formula, Holds, Not, Or, Start
from firable.nets.net import ExternalGate, Fairness, Net, Place, Property, PropertyKind, Signal, Transition
from firable.nets.queries import Query, QueryKind
from firable.nets.temporal import Temporal, parse_temporal
from firable.semantics.trace import Discipline

DISCIPLINES = [Discipline.INTERLEAVING, Discipline.STEP]
UNSHOWN = {"machine-never-stopped"}
"""The verdict of which docs/evidence.md says that under steps it may be only claimed."""


def shows(evidence: Evidence) -> bool:
    try:
        return check_evidence(evidence).shown is True
    except InputError:
        return False


def names(net: Net) -> tuple[list[str], list[str]]:
    return [place.name for place in net.places], list(net.transition_index)


@st.composite
def asked(draw: st.DrawFn, *, linear: bool = False) -> tuple[Net, Temporal]:
    net = draw(st.one_of(ring_nets(signals=True), dense_nets(signals=True)))
    return net, draw((ltl_formulas if linear else ctl_formulas)(*names(net)))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=asked())
@examples(13)
def test_a_formula_of_ctl_has_labels_iff_it_holds(discipline: Discipline, question: tuple[Net, Temporal]) -> None:
    net, formula = question
    claim = Claim(ClaimKind.CTL, formula)
    found = certified(net, claim, discipline)
    assert (found is not None) is true(Evidence(net, discipline, claim, FiringSequence(())))
    assert found is None or shows(found)
    if discipline is Discipline.INTERLEAVING:
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
            assert found is None or shows(found)
        drawn = on_diagram(net, claim)
        assert (drawn is None) is (found is None)
        assert drawn is None or shows(drawn)


def test_going_back_there_and_back_misses_no_transition() -> None:
    # From the last marking on, each transition is the first that brings something new after all others did not.
    places = tuple(Place(name, marked=name in "ad") for name in "abcdef")
    moves = [("a", "b"), ("bf", "cd"), ("d", "e"), ("e", "f")]
    net = Net("n", places, tuple(Transition(f"t{i}", tuple(x), tuple(y)) for i, (x, y) in enumerate(moves)))
    drawn = on_diagram(net, Claim(ClaimKind.CTL, parse_temporal("EF AX start")))
    assert drawn is not None
    assert shows(drawn)


@given(question=asked(linear=True))
@examples(15)
def test_a_formula_of_ltl_is_shown_iff_it_holds_and_its_run_iff_not(question: tuple[Net, Temporal]) -> None:
    net, formula = question
    claim = Claim(ClaimKind.LTL, formula)
    found = certified(net, claim)
    assert found is not None
    assert shows(found) is true(found)
    verdict = answer(explore(net), Query("asked", QueryKind.LTL, formula))
    if verdict.witness is not None:
        refuted = Claim(ClaimKind.NOT_LTL, formula)
        run = Certifier(net, Discipline.INTERLEAVING, Limits()).certify(refuted, verdict.witness)
        assert shows(replace(found, claim=refuted, certificate=run))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@pytest.mark.parametrize("net", [LOOP, ENDING])
def test_a_run_into_a_marking_that_refutes_always_goes_on_to_its_end(net: Net, discipline: Discipline) -> None:
    query = Query("q", QueryKind.LTL, parse_temporal("G not b"))
    verdict = answer(explore(net, discipline), query)
    assert verdict.witness is not None
    assert not verdict.witness.cycle
    claim = Claim(ClaimKind.NOT_LTL, parse_temporal("G not b"))
    run = Certifier(net, discipline, Limits()).certify(claim, verdict.witness)
    assert shows(Evidence(net, discipline, claim, run))


@st.composite
def responses(draw: st.DrawFn) -> tuple[Net, Claim]:
    net = draw(st.one_of(ring_nets(signals=True), dense_nets(signals=True)))
    some = formulas(*names(net))
    return net, Claim(ClaimKind.LEADS_TO, draw(some), draw(some), draw(st.sampled_from(Fairness)))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=responses())
@examples(30)
def test_a_response_has_ranks_iff_it_holds_and_a_run_iff_not(
    discipline: Discipline, question: tuple[Net, Claim]
) -> None:
    net, claim = question
    found = certified(net, claim, discipline)
    holds = true(Evidence(net, discipline, claim, FiringSequence(())))
    assert (found is not None and shows(found)) is holds
    if not holds:
        of = Property("asked", PropertyKind.LEADS_TO, claim.state_goal, claim.then, claim.fairness)
        verdict = check(replace(net, properties=(of,)), discipline).verdict("property.asked")
        assert verdict.witness is not None
        run = FiringSequence(verdict.witness.firings, verdict.witness.cycle)
        assert shows(Evidence(net, discipline, replace(claim, kind=ClaimKind.NOT_LEADS_TO), run))


@given(net=st.one_of(marked_graphs(), free_choice_nets()))
@examples(30)
def test_a_theorem_says_only_what_is_true(net: Net) -> None:
    certifier = Certifier(net, Discipline.INTERLEAVING, Limits())
    start = Claim(ClaimKind.ALWAYS_POSSIBLE, is_marking(net, net.initial_marking))
    for claim in (Claim(ClaimKind.LIVE), Claim(ClaimKind.HOME), start):
        try:
            evidence = Evidence(net, Discipline.INTERLEAVING, claim, certifier.theorem(claim))
        except LackingError:
            continue
        assert shows(evidence)
        assert true(evidence)
        assert {by_cvc5(obligation.text(evidence)) for obligation in obligations(evidence)} <= {"unsat"}


@st.composite
def nets_with_properties(draw: st.DrawFn) -> tuple[Net, tuple[Query, ...]]:
    net = draw(st.one_of(ring_nets(signals=True, commands=True), dense_nets(signals=True)))
    some = formulas(*names(net))
    kinds = draw(st.lists(st.sampled_from(PropertyKind), max_size=2))
    properties = tuple(
        Property(f"p{i}", kind, tidy(draw(some)), tidy(draw(some)) if kind is PropertyKind.LEADS_TO else None)
        for i, kind in enumerate(kinds)
    )
    queries = tuple(
        Query(kind.value, kind)
        for kind in (QueryKind.LIVE, QueryKind.QUASI_LIVE, QueryKind.STABLE_MARKING, QueryKind.ONE_SAFE)
    )
    places = tuple(draw(st.lists(st.sampled_from(names(net)[0]), min_size=1, max_size=3)))
    return replace(net, properties=properties), (*queries, Query("bound", QueryKind.BOUND, places=places))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=nets_with_properties())
@examples(10)
def test_whatever_is_decided_of_a_small_net_is_shown(
    discipline: Discipline, question: tuple[Net, tuple[Query, ...]]
) -> None:
    net, queries = question
    found = evidence_of_report(check(net, discipline, queries=queries), queries)
    read = document_from_text(found.to_text())
    assert read == found
    for one in check_document(read):
        assert one.shown or (one.record.name in UNSHOWN and discipline is Discipline.STEP), one
        assert one.shown is not bool(one.only_claimed)


def test_none_starves_is_shown_by_no_transition_being_live_where_there_is_no_arbitrated_run() -> None:
    ways = (
        Transition("t", ("p",), ("q",), external=(ExternalGate("s"),)),
        Transition("u", ("p",), ("q",), external=(ExternalGate("s", wanted=False),)),
    )
    once = Net("n", (Place("p", marked=True), Place("q")), ways, (Signal("s"),))
    again = replace(once, transitions=(*ways, Transition("back", ("q",), ("p",))))
    for net, decided in ((once, True), (again, False)):
        records = {one.record.name: one for one in check_document(evidence_of_report(check(net)))}
        assert ("starvation" in records) is decided
        assert all(one.shown for one in records.values())


@given(net=ring_nets(signals=True, commands=True))
@examples(20)
def test_the_checker_and_the_techniques_mean_the_same_by_a_verdict(net: Net) -> None:
    for name, meant in (
        ("contact-free", contact(net)),
        ("conflicting-commands", commands_clash(net)),
        ("shared-completions", completions_clash(net)),
    ):
        asked_of = goals_of(net, name)
        assert asked_of is not None
        (goal,) = asked_of[1]
        assert meant == (Constant(value=False) if goal.formula == Or(()) else tidy(goal.formula))


@given(net=dense_nets(), marking=st.integers(0, 31))
@examples(20)
def test_a_formula_means_the_same_of_a_net_that_starts_elsewhere(net: Net, marking: int) -> None:
    assert marking_of(net, tidy(is_marking(net, marking))) == marking
    spelled = And(tuple(Holds(p.name) if p.marked else Not(Holds(p.name)) for p in net.places))
    assert without_start(net, is_marking(net, net.initial_marking)) == spelled
    one = Holds(net.places[0].name)
    assert without_start(net, And((one, Or((one, Not(Start())))))) == And((one, Or((one, Not(spelled)))))


@given(net=dense_nets())
@examples(20)
def test_a_formula_that_leaves_a_place_open_is_no_marking(net: Net) -> None:
    one, other, *_ = (Holds(p.name) for p in net.places)
    rest = tuple(Not(Holds(p.name)) for p in net.places[2:])
    for open_ in ((one, one), (one, Or((one, other))), (one, Not(one)), (one,), (one, other, other)):
        assert marking_of(net, And((*open_, *rest))) is None


def test_the_home_marking_of_a_net_of_one_place_is_shown() -> None:
    one = Net("one", (Place("a", marked=True),), (Transition("t", ("a",)),))
    checked = {found.record.name: found for found in check_document(evidence_of_report(check(one)))}
    assert checked["home-markings"].record.proved
    assert checked["home-markings"].shown


@pytest.mark.parametrize("method", [Method.EXPLICIT, Method.SYMBOLIC])
def test_what_holds_in_every_deadlock_is_shown_by_one_search_against_the_edges(method: Method) -> None:
    moves = [("p", "a"), ("a", "p"), ("a", "left"), ("a", "right")]
    places = [Place(name, marked=name == "p") for name in ("p", "a", "left", "right")]
    goals: list[Formula] = [Not(Holds("p")), Not(Holds("a")), Or((Holds("left"), Holds("right"))), Holds("left")]
    stated = [Property(f"x{i}", PropertyKind.ALWAYS_POSSIBLE, goal) for i, goal in enumerate(goals)]
    transitions = [Transition(f"t{i}", (source,), (target,)) for i, (source, target) in enumerate(moves)]
    net = Net("ends", tuple(places), tuple(transitions), properties=tuple(stated))
    checked = {found.record.name: found for found in check_document(evidence_of_report(check(net, method=method)))}
    of = [checked[f"property.x{i}"] for i in range(len(goals))]
    assert [one.record.proved for one in of] == [True, True, True, False]
    assert all(one.shown for one in of)
    ends = Claim(ClaimKind.ALWAYS_POSSIBLE, Deadlock())
    assert [ends in (claim for claim, _ in one.record.shown) for one in of] == [True, True, True, False]


# --------------------------------------------------------------------------------------------------------------------
# Forgeries


def forged(chance: random.Random, value: Any, words: list[str]) -> Any:
    """The value with one thing somewhere in it changed, left out, doubled or moved; a name becomes another one."""
    match value:
        case dict() if value:
            key = chance.choice(sorted(value))
            return value if key == "kind" else value | {key: forged(chance, value[key], words)}
        case list() if value:
            i, k = chance.randrange(len(value)), chance.randrange(len(value))
            match chance.randrange(6):
                case 0:
                    return value[:i] + value[i + 1 :]
                case 1:
                    return [*value[:i], value[k], *value[i:]]
                case 2:
                    return [*value[:i], value[k], *value[i + 1 :]]
            return [*value[:i], forged(chance, value[i], words), *value[i + 1 :]]
        case bool():
            return not value
        case int():
            return value + chance.choice((-2, -1, 1, 2))
        case str() if value in words:
            return chance.choice(words)
    return value


def a_claim(chance: random.Random, net: Net) -> Claim:
    """Some claim of a kind with a state formula, or of CTL."""
    places, transitions = names(net)

    def formula(depth: int = 2) -> Formula:
        if depth and chance.random() < 0.6:
            parts = (formula(depth - 1), formula(depth - 1))
            return chance.choice((And(parts), Or(parts), Not(parts[0])))
        if transitions and chance.random() < 0.4:
            return Firable(chance.choice(transitions))
        return chance.choice((Holds(chance.choice(places)), is_marking(net, net.initial_marking)))

    kinds = (ClaimKind.NEVER, ClaimKind.ALWAYS_POSSIBLE, ClaimKind.LOST, ClaimKind.LEADS_TO, ClaimKind.REACHABLE)
    kind = chance.choice(kinds)
    if kind is ClaimKind.LEADS_TO:
        return Claim(kind, tidy(formula()), tidy(formula()), chance.choice(list(Fairness)))
    return Claim(kind, tidy(formula()))


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(75))
def test_no_forged_document_shows_a_false_claim(seed: int) -> None:
    chance = random.Random(seed)
    net = lively_net(chance, most_places=6)
    discipline = chance.choice((Discipline.INTERLEAVING, Discipline.INTERLEAVING, Discipline.STEP))
    held = next(filter(None, (certified(net, a_claim(chance, net), discipline) for _ in range(20))), None)
    if held is None:
        return
    words = [*names(net)[0], *names(net)[1]]
    for _ in range(12):
        # The certificate of a true claim, for another claim, or edited, or both.
        claim = held.claim if chance.random() < 0.4 else a_claim(chance, net)
        data = json.loads(document(replace(held, claim=claim)).to_text())
        for _ in range(chance.randrange(3)):
            key = chance.choice(("verdicts", "sets"))
            data[key] = forged(chance, data[key], words)
        try:
            read = document_from_text(json.dumps(data | {"seal": seal(data)}))
        except InputError:
            continue
        for claimed, certificate in read.records[0].shown if read.records else ():
            evidence = Evidence(read.net, read.discipline, claimed, certificate)
            assert not shows(evidence) or true(evidence), (seed, str(claimed))


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(5))
@pytest.mark.parametrize("kind", EXAMPLES)
def test_no_forged_example_shows_a_false_claim(kind: str, seed: int) -> None:
    chance = random.Random(f"{seed} {kind}")
    held = EXAMPLES[kind]()
    assert held is not None
    words = [*names(held.net)[0], *names(held.net)[1]]
    for _ in range(10):
        data = json.loads(document(held).to_text())
        for _ in range(1 + chance.randrange(3)):
            key = chance.choice(("verdicts", "verdicts", "sets"))
            data[key] = forged(chance, data[key], words)
        try:
            read = document_from_text(json.dumps(data | {"seal": seal(data)}))
        except InputError:
            continue
        for claimed, certificate in read.records[0].shown if read.records else ():
            evidence = Evidence(read.net, read.discipline, claimed, certificate)
            assert not shows(evidence) or true(evidence), (seed, str(claimed))


@pytest.mark.seeds
@pytest.mark.parametrize("seed", seeds(20))
def test_no_verdict_is_shown_that_is_not_so(seed: int) -> None:
    """Each verdict turned into its opposite, with all claims that are shown of the net."""
    chance = random.Random(seed)
    net = lively_net(chance, most_places=6)
    found = evidence_of_report(check(net))
    every = tuple(pair for record in found.records for pair in record.shown)
    turned = tuple(replace(record, proved=not record.proved, shown=every, lacking="") for record in found.records)
    assert not [one.record.name for one in check_document(Document(net, found.discipline, turned)) if one.shown]


def test_a_marking_of_the_start_is_no_marking_of_a_net_that_starts_elsewhere() -> None:
    held = EXAMPLES["continuation"]()
    assert held is not None
    # `start` in the goal is M0 of the net itself: after the firings it would hold in the marking that they lead to.
    assert shows(held)
    assert not shows(replace(held, claim=Claim(ClaimKind.LOST, Not(is_marking(held.net, held.net.initial_marking)))))
