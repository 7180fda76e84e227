"""Evidence shows what it claims to z3 and to cvc5, and nothing that was damaged, edited or weakened does."""

import json
import random
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dense_nets import PLACES, dense_nets
from support.evidence import certified, document
from support.evidence_examples import ENDING, EXAMPLES, LOOP, induced, net
from support.examples import examples
from support.second_solver import by_cvc5
from support.true_claims import true
from support.whole_nets import formulas

from firable.analysis.evidence.certificate import (
    Certificate,
    Clause,
    Diagram,
    Equation,
    FiringSequence,
    InductiveInvariant,
    Inequality,
    Labelling,
    Markings,
    Ranks,
    Whole,
)
from firable.analysis.evidence.checking.checker import check_document, check_evidence
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.obligations import obligations, sums_text
from firable.analysis.evidence.claims import STATE_GOALS, Claim, ClaimKind
from firable.analysis.evidence.document import document_from_text, seal
from firable.analysis.evidence.meaning import contact
from firable.analysis.evidence.producing.claims import Certifier
from firable.analysis.evidence.producing.labels import listed
from firable.analysis.goal import Limits
from firable.analysis.spaces.reachability import explore
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.nets.catalogue import catalogue_net
from firable.nets.catalogue.families import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import And, Constant, Firable, Formula, Holds, Not, Start, parse_formula
from firable.nets.interchange import net_digest, net_from_json
from firable.nets.net import Fairness, Net, Place, Transition
from firable.semantics.trace import Discipline

KINDS = [ClaimKind.NEVER, ClaimKind.REACHABLE, ClaimKind.ALWAYS_POSSIBLE, ClaimKind.LOST]
DISCIPLINES = [Discipline.INTERLEAVING, Discipline.STEP]


def text_of(evidence: Evidence) -> str:
    return document(evidence).to_text()


def read_back(text: str) -> Evidence:
    """The evidence of a document of one claim."""
    found = document_from_text(text)
    ((claim, certificate),) = found.records[0].shown
    return Evidence(found.net, found.discipline, claim, certificate)


def refuses(evidence: Evidence | str) -> bool:
    try:
        if isinstance(evidence, str):
            (checked,) = check_document(document_from_text(evidence))
            return not checked.shown
        found = check_evidence(evidence)
    except InputError as error:
        return {found.code for found in error.diagnostics} <= {"F6001", "F6002"}
    if found.shown is None:
        raise AssertionError(found.bound)
    return False


@st.composite
def questions(draw: st.DrawFn) -> tuple[Net, Formula]:
    net = draw(dense_nets(signals=True))
    return net, draw(formulas(list(PLACES), list(net.transition_index)))


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=questions())
@examples(13)
def test_all_that_induction_finds_is_shown_to_two_solvers(
    discipline: Discipline, question: tuple[Net, Formula]
) -> None:
    found = induced(*question, discipline)
    if found is None:
        return
    assert read_back(text_of(found)) == found
    assert check_evidence(found).shown is True
    texts = [obligation.text(found) for obligation in obligations(found)]
    assert {by_cvc5(text) for text in [*texts, *filter(None, [sums_text(found)])]} <= {"unsat"}


@pytest.mark.parametrize("discipline", DISCIPLINES)
@given(question=questions(), kind=st.sampled_from([ClaimKind.NEVER, ClaimKind.ALWAYS_POSSIBLE]))
@examples(13)
def test_the_markings_of_a_net_show_a_claim_iff_it_is_true(
    discipline: Discipline, question: tuple[Net, Formula], kind: ClaimKind
) -> None:
    net, goal = question
    claim = Claim(kind, goal)
    whole = Evidence(net, discipline, claim, Labelling(listed(explore(net, discipline))))
    found = certified(net, claim, discipline)
    assert (found is not None) is true(whole)
    assert refuses(whole) or (true(whole) and kind is ClaimKind.NEVER)
    if found is not None:
        assert read_back(text_of(found)) == found
        assert not refuses(found)
        assert {by_cvc5(obligation.text(found)) for obligation in obligations(found)} <= {"unsat"}


@pytest.mark.parametrize("edges_max", [100_000, 0])
@given(question=questions(), data=st.data(), discipline=st.sampled_from(DISCIPLINES))
@examples(40)
def test_no_certificate_shows_a_claim_that_is_false(
    edges_max: int, question: tuple[Net, Formula], data: st.DataObject, discipline: Discipline
) -> None:
    net, goal = question
    names = st.lists(st.sampled_from(PLACES), max_size=3).map(tuple)
    weights = st.dictionaries(st.sampled_from(PLACES), st.integers(-2, 2)).map(lambda w: tuple(w.items()))
    invariants = st.builds(
        InductiveInvariant,
        st.lists(st.builds(Equation, weights, st.integers(-2, 3)), max_size=2).map(tuple),
        st.lists(st.builds(Clause, names, names), max_size=3).map(tuple),
        st.integers(0, 2),
        st.lists(st.builds(Inequality, weights, st.integers(-3, 2)), max_size=1).map(tuple),
    )
    markings = st.lists(st.integers(0, 31), unique=True, max_size=32).map(lambda found: Markings(tuple(sorted(found))))
    labels = st.one_of(st.lists(st.integers(-1, 3), max_size=32).map(lambda r: Ranks(tuple(r))), st.builds(Whole))
    sets = st.builds(Labelling, markings, st.lists(labels, max_size=2).map(tuple))
    sequences = st.lists(st.sampled_from(["t0", "t1"]).map(lambda t: (t,)), max_size=3).map(
        lambda firings: FiringSequence(tuple(f for f in firings if f[0] in net.transition_index))
    )
    certificate = data.draw(st.one_of(invariants, sets, sequences))
    kind = data.draw(st.sampled_from(KINDS))
    evidence = Evidence(net, discipline, Claim(kind, goal), certificate)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", edges_max)
        assert refuses(evidence) or true(evidence)


def sealed(data: dict[str, Any]) -> str:
    return json.dumps(data | {"seal": seal(data)})


AT_LARGE = [f"{name}, at large" for name in ("markings", "distances", "labels", "wide", "continuation")]
"""Examples whose few markings are written, and looked through, as if they were very many."""


@pytest.fixture(params=[*EXAMPLES, *AT_LARGE])
def example(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Evidence:
    name, _, large = request.param.partition(", ")
    found = EXAMPLES[name]()
    if large:
        monkeypatch.setattr("firable.analysis.evidence.checking.checker.EDGES_MAX", 0)
        monkeypatch.setattr("firable.analysis.evidence.claim_records.APART_MAX", 0)
    assert found is not None
    assert not refuses(text_of(found))
    return found


def test_every_damaged_byte_is_seen(example: Evidence) -> None:
    text = text_of(example)
    chance = random.Random(0)
    for at in chance.sample(range(len(text)), 150):
        if not text[at].isspace():
            damaged = text[:at] + chance.choice('0 x}"') + text[at + 1 :]
            assert damaged == text or _harmless(text, damaged) or refuses(damaged)


def _harmless(text: str, damaged: str) -> bool:
    try:
        return bool(json.loads(text) == json.loads(damaged))
    except ValueError:
        return False


def test_a_text_that_ends_early_is_refused(example: Evidence) -> None:
    text = text_of(example).rstrip()
    assert all(refuses(text[:at]) for at in range(0, len(text), 211))
    assert not refuses(" \n" + text + "\n\n")


def _edits(value: Any) -> Iterator[Any]:
    """The value with one thing changed somewhere in it: an element left out, moved, another number or truth value."""
    match value:
        case dict():
            for key, inner in value.items():
                for edited in _edits(inner):
                    yield value | {key: edited}
        case list():
            for i, inner in enumerate(value):
                yield value[:i] + value[i + 1 :]
                if i and value[i - 1] != inner:
                    yield [*value[: i - 1], inner, value[i - 1], *value[i + 1 :]]
                for edited in _edits(inner):
                    yield [*value[:i], edited, *value[i + 1 :]]
        case bool():
            yield not value
        case int():
            yield from (value - 1, value + 1)


def test_an_edited_certificate_that_is_sealed_anew_is_refused_or_a_proof_all_the_same(example: Evidence) -> None:
    data = json.loads(text_of(example))
    shown = data["verdicts"][0]["shown"][0]
    edits = [(shown, "certificate", edited) for edited in _edits(shown["certificate"])]
    edits += [(data, "sets", edited) for edited in _edits(data["sets"])]
    assert edits
    refused = 0
    for inside, key, edited in random.Random(0).sample(edits, min(60, len(edits))):
        kept, inside[key] = inside[key], edited
        refused += refuses(sealed(data))  # where not, the claim is true: it has not changed
        inside[key] = kept
    assert refused


@pytest.mark.parametrize(
    "example", ["distances", "labels", "wide", "weak", "strong", "labels, at large", "wide, at large"], indirect=True
)
def test_no_edit_of_ranks_shows_the_same(example: Evidence) -> None:
    data = json.loads(text_of(example))
    shown = data["verdicts"][0]["shown"][0]
    edits = list(_edits(shown["certificate"]))
    assert edits
    for edited in edits:
        shown["certificate"] = edited
        assert refuses(sealed(data)), edited


def _numbers_as_other_things(value: Any) -> Iterator[Any]:
    """The value with one number in it as a text, a fraction or a truth value, any of which may be taken for it."""
    match value:
        case dict():
            for key, inner in value.items():
                yield from (value | {key: other} for other in _numbers_as_other_things(inner))
        case list():
            for i, inner in enumerate(value):
                yield from ([*value[:i], other, *value[i + 1 :]] for other in _numbers_as_other_things(inner))
        case int():
            yield from (str(value), float(value), bool(value))


def test_a_number_is_not_taken_from_what_is_none(example: Evidence) -> None:
    data = json.loads(text_of(example))
    shown = data["verdicts"][0]["shown"][0]
    edits = [(shown, "certificate", edited) for edited in _numbers_as_other_things(shown["certificate"])]
    edits += [(data, "sets", edited) for edited in _numbers_as_other_things(data["sets"])]
    for inside, key, edited in random.Random(0).sample(edits, min(30, len(edits))):
        kept, inside[key] = inside[key], edited
        with pytest.raises(InputError, match="F6001"):
            document_from_text(sealed(data))
        inside[key] = kept


def test_a_claim_that_is_shown_twice_is_refused(example: Evidence) -> None:
    data = json.loads(text_of(example))
    verdict = data["verdicts"][0]
    verdict["shown"] += verdict["shown"]
    assert refuses(sealed(data))


@pytest.mark.parametrize("example", ["fires"], indirect=True)
@pytest.mark.parametrize("fires", [["go", "tock"], ["tock", "tock", "go"]])
def test_transitions_that_fire_are_in_order_each_once(example: Evidence, fires: list[str]) -> None:
    data = json.loads(text_of(example))
    data["verdicts"][0]["shown"][0]["claim"]["fires"] = fires
    assert refuses(sealed(data))


@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("invariant", ["goal"]),
        ("traps", ["initial", "step", "goal"]),
        ("distances", ["initial", "step"]),
        ("diagram", ["initial", "step", "goal"]),
        ("reduction", ["weaker", "initial", "step", "goal"]),
        ("reduced to nothing", []),
        ("continuation", ["initial", "step", "goal"]),
        ("marked graph", ["initial", "step", "goal"]),
        ("free choice", ["initial", "step", "goal", "siphons"]),
        ("stubborn sets", []),
    ],
)
def test_a_second_solver_is_given_each_obligation(name: str, names: list[str]) -> None:
    found = EXAMPLES[name]()
    assert found is not None
    assert [obligation.name for obligation in obligations(found)] == names


def test_every_obligation_is_discharged_by_a_second_solver(example: Evidence) -> None:
    texts = [obligation.text(example) for obligation in obligations(example)]
    assert {by_cvc5(text) for text in [*texts, *filter(None, [sums_text(example)])]} <= {"unsat"}


ONLY_A, ONLY_B = Diagram(("a", "b", "z"), ((1, 0, 1),), (2,)), Diagram(("a", "b"), ((2, 0, 1),), (2,))
A_OR_B = Diagram(("a", "b", "z"), ((1, 0, 1), (2, 2, 1)), (3,))


@pytest.mark.parametrize(
    ("net", "space", "goal", "wrong"),
    [
        (ENDING, Markings((2,)), "a", ["initial"]),
        (ENDING, ONLY_B, "a", ["initial"]),
        (LOOP, Markings((1,)), "b", ["step"]),
        (LOOP, ONLY_A, "b", ["step"]),
        (LOOP, Markings((1, 2)), "b", ["goal"]),
        (LOOP, A_OR_B, "b", ["goal"]),
        (LOOP, A_OR_B, "z or a and b", []),
    ],
)
def test_what_a_set_does_not_show_is_an_obligation_that_does_not_hold(
    net: Net, space: Markings | Diagram, goal: str, wrong: list[str]
) -> None:
    claim = Claim(ClaimKind.NEVER, parse_formula(goal))
    evidence = Evidence(net, Discipline.INTERLEAVING, claim, Labelling(space))
    told = {obligation.name: by_cvc5(obligation.text(evidence)) for obligation in obligations(evidence)}
    assert [name for name, answer in told.items() if answer == "sat"] == wrong
    assert [obligation.name for obligation in obligations(evidence, closed=True)] == ["goal"]
    assert refuses(evidence) is bool(wrong)


def test_the_markings_need_each_of_them() -> None:
    found = EXAMPLES["markings"]()
    assert found is not None
    assert isinstance(found.certificate, Labelling)
    assert isinstance(found.certificate.space, Markings)
    markings = found.certificate.space.markings
    for i in range(len(markings)):
        assert refuses(replace(found, certificate=Labelling(Markings(markings[:i] + markings[i + 1 :]))))


def test_an_invariant_without_its_trap_is_refused() -> None:
    found = EXAMPLES["traps"]()
    assert found is not None
    assert isinstance(found.certificate, InductiveInvariant)
    (clause,) = found.certificate.clauses
    assert refuses(replace(found, certificate=replace(found.certificate, clauses=())))
    for place in clause.marked:
        smaller = Clause(tuple(name for name in clause.marked if name != place), clause.empty)
        assert refuses(replace(found, certificate=replace(found.certificate, clauses=(smaller,))))


def test_another_goal_sealed_anew_is_proved_for_itself_or_refused(example: Evidence) -> None:
    for goal in ("true", "start", "deadlock", "not start", "false"):
        data = json.loads(text_of(example))
        data["verdicts"][0]["shown"][0]["claim"]["goal"] = goal
        if not refuses(sealed(data)):
            assert true(replace(example, claim=replace(example.claim, goal=parse_formula(goal))))


def test_another_kind_of_claim_is_refused_or_true(example: Evidence) -> None:
    goal = example.claim.goal
    for kind in ClaimKind:
        if isinstance(goal, Formula) or kind not in STATE_GOALS:
            evidence = replace(example, claim=replace(example.claim, kind=kind))
            assert kind is example.claim.kind or refuses(evidence) or true(evidence)


@pytest.mark.parametrize("fairness", Fairness)
def test_less_fairness_is_refused_or_true(example: Evidence, fairness: Fairness) -> None:
    evidence = replace(example, claim=replace(example.claim, fairness=fairness))
    assert refuses(evidence) or true(evidence)


def test_another_net_is_refused_or_the_claim_is_true_of_it(example: Evidence) -> None:
    data = json.loads(text_of(example))
    edits = [("marked", i) for i in range(len(data["net"]["places"]))]
    edits += [(side, i) for side in ("inputs", "outputs") for i in range(len(data["net"]["transitions"]))]
    for key, i in edits:
        edited = deepcopy(data)
        if key == "marked":
            edited["net"]["places"][i]["marked"] ^= True
        else:
            edited["net"]["transitions"][i][key] = edited["net"]["transitions"][i][key][1:]
        if edited == data:
            continue
        assert refuses(sealed(edited))  # the digest is that of the old net
        try:
            net = net_from_json(edited["net"])
        except InputError:
            continue
        edited["digest"] = net_digest(net)
        if not refuses(sealed(edited)):
            assert true(replace(example, net=net))


def test_a_kind_of_evidence_shows_its_kind_of_claim_only() -> None:
    net = family_net("philosophers-2")
    claim = Claim(ClaimKind.NEVER, Holds("p1.eating"))
    assert refuses(Evidence(net, Discipline.INTERLEAVING, claim, FiringSequence(())))
    claim = Claim(ClaimKind.REACHABLE, Start())
    assert refuses(Evidence(net, Discipline.INTERLEAVING, claim, InductiveInvariant()))
    assert not refuses(Evidence(net, Discipline.INTERLEAVING, claim, FiringSequence(())))


@pytest.mark.parametrize(
    ("claim", "right", "wrong"),
    [
        (ClaimKind.REACHABLE, FiringSequence((("t0",),)), FiringSequence((("t0",), ("t1",)))),
        (ClaimKind.REACHABLE, FiringSequence((("t0",),)), FiringSequence((("t0",),), (("t1",), ("t0",)))),
        (ClaimKind.NEVER, Labelling(Markings((1, 2))), Labelling(Markings((1, 2)), (Whole(), Whole()))),
        (ClaimKind.NEVER, Labelling(A_OR_B), Labelling(A_OR_B, (Whole(), Whole()))),
    ],
)
def test_no_evidence_says_more_than_is_looked_at(claim: ClaimKind, right: Certificate, wrong: Certificate) -> None:
    goal = Holds("b" if claim is ClaimKind.REACHABLE else "z")
    assert not refuses(Evidence(LOOP, Discipline.INTERLEAVING, Claim(claim, goal), right))
    assert refuses(Evidence(LOOP, Discipline.INTERLEAVING, Claim(claim, goal), wrong))


def test_evidence_of_interleaving_shows_nothing_of_steps() -> None:
    both = And((Not(Holds("a")), Not(Holds("b"))))
    gated = (Transition("t", ("a",), permissive=("b",)), Transition("u", ("b",), permissive=("a",)))
    net = Net("racing", (Place("a", marked=True), Place("b", marked=True)), gated)
    found = certified(net, Claim(ClaimKind.NEVER, both))
    assert found is not None
    assert not refuses(found)
    assert refuses(replace(found, discipline=Discipline.STEP))


def test_evidence_of_steps_shows_nothing_of_interleaving() -> None:
    pair = net("pair", "ac", ("a", "b"), ("c", "d"))  # in a step both fire
    sums = tuple(Equation(tuple((name, 1) for name in names), 1) for names in ("ab", "cd"))
    together = Clause(marked=("d",), empty=("b",)), Clause(marked=("b",), empty=("d",))
    claim = Claim(ClaimKind.NEVER, parse_formula("b and c"))
    found = Evidence(pair, Discipline.STEP, claim, InductiveInvariant(sums, together))
    assert true(found)
    assert not refuses(found)
    assert not true(replace(found, discipline=Discipline.INTERLEAVING))
    assert refuses(replace(found, discipline=Discipline.INTERLEAVING))


LOOPING = replace(LOOP, transitions=(*LOOP.transitions, Transition("never", ("a",), ("a", "z"))))


@pytest.mark.parametrize(
    "invariant",
    [
        InductiveInvariant(clauses=(Clause(empty=("z",)),)),
        InductiveInvariant((Equation((("z", 1),), 0),)),  # who never fires changes no sum
        InductiveInvariant((Equation((("a", 0), ("z", 2)), 0),)),
        InductiveInvariant(inequalities=(Inequality((("z", -1),), 0),)),
        InductiveInvariant(inequalities=(Inequality((("a", 1), ("b", 1), ("z", -4)), -1),)),  # M0 has more than that
    ],
)
def test_an_invariant_shows_what_it_excludes(invariant: InductiveInvariant) -> None:
    found = Evidence(LOOPING, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, parse_formula("z and a")), invariant)
    assert not refuses(found)
    assert {by_cvc5(text) for text in (*(one.text(found) for one in obligations(found)), sums_text(found)) if text} == {
        "unsat"
    }
    assert refuses(replace(found, claim=Claim(ClaimKind.NEVER, Holds("b"))))


@pytest.mark.parametrize(
    "wrong",
    [
        InductiveInvariant((Equation((("z", 1),), -1),)),
        InductiveInvariant((Equation((("b", 1), ("b", 0)), 0),)),
        InductiveInvariant((Equation((("a", 1), ("b", -1)), 1),)),
        InductiveInvariant((Equation((("a", -1), ("b", 1)), -1),)),
        InductiveInvariant(inequalities=(Inequality((("a", -1),), 0),)),
        InductiveInvariant(inequalities=(Inequality((("a", 1), ("b", -1)), 1),)),
    ],
)
def test_a_sum_that_is_wrong_is_so_to_a_second_solver_too(wrong: InductiveInvariant) -> None:
    found = Evidence(LOOPING, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, Constant(value=False)), wrong)
    text = sums_text(found)
    assert text is not None
    assert by_cvc5(text) == "sat"
    assert refuses(found)


def test_a_deeper_induction_is_checked_with_its_base() -> None:
    # Tokens come to c only after two firings, which an induction over one cannot know.
    chain = tuple(Transition(f"t{i}", (f"p{i}",), (f"p{i + 1}",)) for i in range(4))
    net = Net("chain", tuple(Place(f"p{i}", marked=i == 0) for i in range(5)), chain)
    goal = And((Holds("p0"), Holds("p3")))
    for depth in range(5):
        evidence = Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, goal), InductiveInvariant(depth=depth))
        names = [obligation.name for obligation in obligations(evidence)]
        assert names == [*(f"base-{k}" for k in range(depth)), "goal"]
        shown = not refuses(evidence)
        assert shown is (depth >= 3)  # from p1 the token is in p3 after two firings
        assert shown is all(by_cvc5(obligation.text(evidence)) == "unsat" for obligation in obligations(evidence))
    reachable = Evidence(net, Discipline.INTERLEAVING, Claim(ClaimKind.NEVER, Holds("p2")), InductiveInvariant(depth=3))
    assert refuses(reachable)


def test_without_time_evidence_is_neither_shown_nor_refused() -> None:
    from support.pigeons import pigeon_evidence

    assert check_evidence(pigeon_evidence(), timeout_ms=1).shown is None


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", "NaN", '{"firable_evidence": 1}', '{"seal": 1, "seal": 1}', "[" * 100_000, "\ud83d"],
)
def test_what_is_no_evidence_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="F6001"):
        document_from_text(text)


def test_liveness_of_each_transition_is_shown_by_ranks() -> None:
    net = catalogue_net("conceptual_one_robot")
    for transition in net.transitions:
        found = certified(net, Claim(ClaimKind.ALWAYS_POSSIBLE, Firable(transition.name)))
        assert found is not None
        assert not refuses(found)


def test_a_sum_that_a_firing_changes_is_refused() -> None:
    net = Net("n", (Place("a", marked=True), Place("b")), (Transition("t", ("a",), ("b",)),))

    def shows(*sums: Equation | Inequality, goal: str = "a and b") -> bool:
        equations = tuple(one for one in sums if isinstance(one, Equation))
        inequalities = tuple(one for one in sums if isinstance(one, Inequality))
        certificate = InductiveInvariant(equations, inequalities=inequalities)
        claim = Claim(ClaimKind.NEVER, parse_formula(goal))
        evidence = Evidence(net, Discipline.INTERLEAVING, claim, certificate)
        text = sums_text(evidence)
        assert text is not None
        assert refuses(evidence) is (by_cvc5(text) == "sat")
        return not refuses(evidence)

    assert shows(Equation((("a", 1), ("b", 1)), 1))
    assert not shows(Equation((("a", 1), ("b", 1)), 0))  # not so in M0
    assert not shows(Equation((("b", 1),), 0))  # so in M0, and changed by t
    assert not shows(Equation((("a", 1), ("b", 2)), 1))
    assert shows(Inequality((("a", -1), ("b", -1)), -1))
    assert shows(Inequality((("a", 1), ("b", 2)), 1), goal="not a and not b")
    assert not shows(Inequality((("a", 1),), 1), goal="not a")  # so in M0, and lowered by t
    assert not shows(Inequality((("a", 1), ("b", 1)), 2), goal="not a")


def test_contact_of_a_net_too_large_to_list_is_excluded_by_sums_of_tokens() -> None:
    net = family_net("philosophers_either-40")
    claim = Claim(ClaimKind.NEVER, contact(net))
    certificate = Certifier(net, Discipline.INTERLEAVING, Limits(), explore_symbolically(net)).certify(claim)
    assert isinstance(certificate, InductiveInvariant)
    # One for each philosopher, who is in one place or none but has one token, and one for each fork.
    assert len(certificate.equations) == 80
    assert check_evidence(Evidence(net, Discipline.INTERLEAVING, claim, certificate)).shown
