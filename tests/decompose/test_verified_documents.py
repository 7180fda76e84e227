"""The documents of evidence in a bundle are checked again, and each verdict on the net is what they show."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from support.remembered import answered, bundled, examined, rests_on_an_obligation

from firable.analysis.check import check
from firable.analysis.evidence.certificate import (
    Certificate,
    Continuation,
    FiringSequence,
    InductiveInvariant,
    Labelling,
    Markings,
)
from firable.analysis.evidence.checking.checker import CheckedRecord
from firable.analysis.evidence.checking.obligation import Obligation
from firable.analysis.evidence.claims import Claim, ClaimKind
from firable.analysis.evidence.document import Document, Record, document_from_text
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.analysis.spaces.reachability import Budget
from firable.decompose.verification import documents
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.checking import check_bundle
from firable.decompose.verification.documents import UNDECIDED, check_verdicts_on_the_net
from firable.decompose.verification.solvers import SolverError
from firable.decompose.verification.words import SENTENCES
from firable.nets.bundle import Bundle
from firable.nets.catalogue import family_net
from firable.nets.diagnostics import InputError
from firable.nets.formula import Deadlock
from firable.nets.right_to_run import CHECKED
from firable.nets.verdict import Status, Verdict, Weight
from firable.semantics.trace import Discipline


def test_a_solver_that_cannot_read_an_obligation_of_a_document_is_no_internal_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle, files = bundled("conceptual_one_robot"), set(bundled("conceptual_one_robot").evidence.values())

    def picky(text: str, timeout_ms: int) -> tuple[str, ...]:
        if text in files or text == "(set-logic QF_UF)":
            return answered(text, timeout_ms)
        raise SolverError("no symbol begins so")

    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", {"cvc5": picky})
    with pytest.raises(InputError, match=r"cannot read an obligation of 'check.evidence.json'"):
        check_bundle(bundle)


@pytest.mark.usefixtures("remembering")
def test_an_obligation_of_a_document_that_the_solver_refutes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle, files = bundled("conceptual_one_robot"), set(bundled("conceptual_one_robot").evidence.values())
    asked: list[str] = []

    def saying(answer: str, of: str = "") -> dict[str, Callable[[str, int], tuple[str, ...]]]:
        def solver(text: str, timeout_ms: int) -> tuple[str, ...]:
            said = answered(text, timeout_ms)
            if text not in files and said:
                asked.append(text)
            return (*said[:-1], answer) if text == of else said

        return {"cvc5": solver}

    monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", saying("unsat"))
    check_bundle(bundle)
    assert len(asked) == len(set(asked)) > 5
    for text in (asked[0], asked[len(asked) // 2], asked[-1]):
        monkeypatch.setattr("firable.decompose.verification.checking.SOLVERS", saying("sat", text))
        with pytest.raises(InputError, match=r"an obligation of 'check\.evidence\.json' on '.*' is refuted"):
            check_bundle(bundle)


def test_a_bundle_without_documents_is_refused() -> None:
    bundle = bundled("conceptual_one_robot")
    kept = {file: text for file, text in bundle.evidence.items() if file.endswith(".smt2")}
    bare = tuple(replace(v, evidence=tuple(f for f in v.evidence if f in kept)) for v in bundle.verdicts)
    with pytest.raises(InputError, match="'deadlock-free' is said to be proved, without evidence"):
        check_bundle(replace(bundle, verdicts=bare, evidence=kept))


def told(bundle: Bundle, change: Callable[[Document], Document]) -> Bundle:
    """The bundle with another document on its net."""
    file = "check.evidence.json"
    text = change(document_from_text(bundle.evidence[file], file)).to_text()
    return replace(bundle, evidence={**bundle.evidence, file: text})


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda of: replace(of, records=(*of.records, Record("query.more", True, (), "no time", "deadlock"))),
            "speaks of 'query.more', as no bundle does",
        ),
        (
            lambda of: replace(of, records=(*of.records, Record("property.more", True, (), "no time"))),
            "the evidence on 'property.more' belongs to no verdict",
        ),
        (lambda of: replace(of, records=(*of.records, Record("", True, ()))), "has a record that claims nothing"),
        (lambda of: unnamed(of, ClaimKind.NEVER), "answers a question that no verdict asks"),
        (lambda of: unnamed(of, ClaimKind.ALWAYS_POSSIBLE), "claims '.*' of no verdict"),
    ],
)
def test_a_document_that_says_more_or_of_something_else_is_refused(
    change: Callable[[Document], Document], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        check_bundle(told(bundled("conceptual_one_robot"), change))


def apart(bundle: Bundle, change: Callable[[Document], Document]) -> Bundle:
    """The bundle with a document of its own, changed, on a verdict that no net must have to run."""
    document = document_from_text(bundle.evidence["check.evidence.json"])
    live = change(replace(document, records=tuple(r for r in document.records if r.name == "live")))
    rest = told(bundle, lambda of: replace(of, records=tuple(r for r in of.records if r.name != "live")))
    verdicts = tuple(replace(v, evidence=("live.evidence.json",)) if v.name == "live" else v for v in bundle.verdicts)
    return replace(rest, verdicts=verdicts, evidence={**rest.evidence, "live.evidence.json": live.to_text()})


@pytest.mark.usefixtures("remembering")
def test_a_document_on_another_net_or_on_steps_shows_nothing() -> None:
    bundle = bundled("conceptual_one_robot")
    assert all(one.shown for one in check_bundle(apart(bundle, lambda of: of)))
    twice = apart(bundle, lambda of: of).evidence["live.evidence.json"]
    with pytest.raises(InputError, match="speaks of 'live', as no bundle does"):
        check_bundle(replace(bundle, evidence={**bundle.evidence, "live.evidence.json": twice}))
    with pytest.raises(InputError, match=r"'live\.evidence\.json' is about another net"):
        check_bundle(apart(bundle, lambda of: replace(of, net=replace(of.net, name="other"))))
    with pytest.raises(InputError, match=r"'live\.evidence\.json' is about another discipline"):
        check_bundle(apart(bundle, lambda of: replace(of, discipline=Discipline.STEP)))


def unnamed(document: Document, kind: ClaimKind) -> Document:
    """A document with a claim of this kind besides, which belongs to no verdict."""
    claim = next(one for record in document.records for one in record.shown if one[0].kind is kind)
    return replace(document, records=(*document.records, Record("", True, (claim,))))


@pytest.mark.usefixtures("remembering")
def test_a_document_that_is_spelled_otherwise_is_refused() -> None:
    bundle, file = bundled("conceptual_one_robot"), "check.evidence.json"
    text = bundle.evidence[file].replace('":', '" :', 1)
    with pytest.raises(InputError, match=r"'check\.evidence\.json' is not as it was written"):
        check_bundle(replace(bundle, evidence={**bundle.evidence, file: text}))


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"status": Status.VIOLATED}, "'live' is violated, and the evidence says otherwise"),
        ({"evidence": ()}, "'live' does not name the evidence on it"),
        ({"statement": "all is well"}, "'live' says something else"),
    ],
)
def test_a_verdict_is_told_for_what_of_it_is_not_shown(changes: dict[str, Any], says: str) -> None:
    bundle = bundled("conceptual_one_robot")
    verdicts = tuple(replace(v, **changes) if v.name == "live" else v for v in bundle.verdicts)
    with pytest.raises(InputError, match=says):
        check_bundle(replace(bundle, verdicts=verdicts))


@pytest.mark.usefixtures("remembering")
def test_an_obligation_that_takes_too_long_to_be_written_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(*_: object, **__: object) -> Iterator[Obligation]:
        raise TimeIsOverError("the time was over")

    monkeypatch.setattr(documents, "obligations", late)
    assert all(one.shown for one in check_bundle(bundled("conceptual_one_robot")))


def test_whether_a_set_is_closed_is_asked_again_of_each_set_and_of_each_begin_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle, file = bundled("conceptual_one_robot"), "check.evidence.json"
    (first, second), begin = (Markings((1, 2)), Markings((1, 2))), (("t1",),)
    whole, part, run = Labelling(first), Continuation(begin, Labelling(first)), FiringSequence(begin)
    invariant = InductiveInvariant()
    shown: list[Certificate] = [
        whole,
        whole,
        Labelling(second),
        part,
        part,
        Continuation((), Labelling(first)),
        run,
        run,
    ]
    shown += [Continuation(begin, invariant)] * 2
    claim, asked = Claim(ClaimKind.NEVER, Deadlock()), list[bool]()
    records = tuple(Record("", True, ((claim, one),)) for one in shown)
    document = Document(bundle.net, Discipline.INTERLEAVING, records)

    def obligations(*_: object, closed: bool) -> tuple[Obligation, ...]:
        asked.append(closed)
        return ()

    monkeypatch.setattr(documents, "document_from_text", lambda *_: document)
    monkeypatch.setattr(documents, "check_document", lambda *_, **__: ())
    monkeypatch.setattr(documents, "obligations", obligations)
    examination = Examination(replace(bundle, evidence={file: document.to_text()}))
    documents.checked_document(examination, file, bundle.net, answered, 10_000)
    assert asked == [False, True, False, False, True, False, False, False, False, False]


def without_evidence_on(bundle: Bundle, *names: str) -> Bundle:
    """The bundle with nothing to show what these verdicts on its net say."""
    file = "check.evidence.json"
    document = document_from_text(bundle.evidence[file], file)
    records = tuple(replace(r, shown=(), lacking="no time") if r.name in names else r for r in document.records)
    text = replace(document, records=records).to_text()
    verdicts = tuple(replace(v, evidence=()) if v.name in names else v for v in bundle.verdicts)
    return replace(bundle, verdicts=verdicts, evidence={**bundle.evidence, file: text})


@pytest.mark.usefixtures("remembering")
def test_records_and_claims_of_a_document_in_another_order_are_refused() -> None:
    bundle, file = bundled("one_robot"), "check.evidence.json"
    document = document_from_text(bundle.evidence[file], file)
    first, second, *others = document.records
    of_many = next(record for record in document.records if len(record.shown) > 1)
    turned = replace(of_many, shown=of_many.shown[::-1])
    for records in (
        (second, first, *others),
        tuple(turned if record is of_many else record for record in document.records),
    ):
        text = replace(document, records=records).to_text()
        with pytest.raises(InputError, match="order"):
            check_bundle(replace(bundle, evidence={**bundle.evidence, file: text}))


@pytest.mark.usefixtures("remembering")
def test_a_warning_without_evidence_is_only_claimed_and_a_demand_refused() -> None:
    bundle = bundled("conceptual_one_robot")
    checked = check_bundle(without_evidence_on(bundle, "live", "reversible"))
    assert {one.verdict.name: one.only_claimed for one in checked if not one.shown} == {
        "live": "only claimed: no time",
        "reversible": "only claimed: no time",
    }
    with pytest.raises(InputError, match="F5002"):
        check_bundle(without_evidence_on(bundle, "quasi-live"))


def without_verdict(bundle: Bundle, name: str) -> Bundle:
    """The bundle without a verdict on its net, and without the record on it."""
    file = "check.evidence.json"
    document = document_from_text(bundle.evidence[file], file)
    text = replace(document, records=tuple(r for r in document.records if r.name != name)).to_text()
    verdicts = tuple(v for v in bundle.verdicts if v.name != name)
    return replace(bundle, verdicts=verdicts, evidence={**bundle.evidence, file: text})


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("name", [name for name in SENTENCES if name not in CHECKED])
def test_a_warning_that_was_taken_out_with_its_evidence_is_missed(name: str) -> None:
    with pytest.raises(InputError, match=f"F6002.*there is no verdict on '{name}'"):
        check_bundle(without_verdict(bundled("conceptual_one_robot"), name))


@pytest.mark.usefixtures("remembering")
def test_a_warning_that_was_made_undecided_is_told() -> None:
    bundle = bundled("conceptual_one_robot")
    (starvation,) = (v for v in bundle.verdicts if v.name == "starvation")
    doubted = replace(starvation, status=Status.UNKNOWN, evidence=(), bound=UNDECIDED)
    bare = without_verdict(bundle, "starvation")
    checked = check_bundle(replace(bare, verdicts=(*bare.verdicts, doubted)))
    assert [(one.verdict, one.shown) for one in checked if not one.shown] == [(doubted, False)]
    assert checked[-1].only_claimed.startswith("undecided")
    for edited in (replace(doubted, statement="all is well"), replace(doubted, bound="nobody asked")):
        with pytest.raises(InputError, match="says something else"):
            check_bundle(replace(bare, verdicts=(*bare.verdicts, edited)))


@pytest.mark.usefixtures("remembering")
@pytest.mark.parametrize("status", Status)
def test_a_verdict_that_nobody_knows_is_refused(status: Status) -> None:
    bundle = bundled("conceptual_one_robot")
    safe = Verdict("safe", status, "certified SIL 3", "", Weight.INFORMATION)
    with pytest.raises(InputError, match="nobody knows what 'safe' is on"):
        check_bundle(replace(bundle, verdicts=(*bundle.verdicts, safe)))


@pytest.mark.usefixtures("remembering")
def test_a_verdict_on_the_vote_of_nobody_is_refused() -> None:
    bundle = bundled("workshop-1")
    vote = next(v for v in bundle.verdicts if v.name.startswith("persistent."))
    nobody = replace(vote, name="persistent.t9-99", status=Status.UNKNOWN, evidence=())
    with pytest.raises(InputError, match=r"'persistent\.t9-99' is on no part"):
        check_bundle(replace(bundle, verdicts=(*bundle.verdicts, nobody)))


@pytest.mark.usefixtures("remembering")
def test_a_vote_that_was_taken_out_with_its_evidence_is_missed() -> None:
    bundle = bundled("one_robot")
    (first, second) = (v for v in bundle.verdicts if v.name in {"persistent.t1-21", "persistent.t1-41"})
    assert first.evidence == second.evidence
    (file,) = first.evidence
    document = document_from_text(bundle.evidence[file])
    assert [record.name for record in document.records] == ["", ""]
    text = replace(document, records=document.records[1:]).to_text()
    verdicts = tuple(v for v in bundle.verdicts if v is not first)
    with pytest.raises(InputError, match=r"there is no verdict on 'persistent\.t1-21'"):
        check_bundle(replace(bundle, verdicts=verdicts, evidence={**bundle.evidence, file: text}))


def test_what_a_document_shows_that_was_not_checked_in_time_is_only_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = bundled("one_robot")
    votes = [v.name for v in bundle.verdicts if v.name.startswith("persistent.") and not rests_on_an_obligation(v)]
    assert votes == ["persistent.t1-21", "persistent.t1-41"]

    def late(document: Document, timeout_ms: int) -> Iterator[CheckedRecord]:
        for one in examined(document, timeout_ms):
            open_ = one.record.name in ("", "live")  # what has no name is on votes
            yield replace(one, shown=False, only_claimed="the time was over") if open_ else one

    monkeypatch.setattr(documents, "check_document", late)
    monkeypatch.setattr(documents, "obligations", lambda *_, **__: ())
    examination = Examination(bundle)
    examination.used |= {file for file in bundle.evidence if file.endswith(".smt2")}
    for verdict in filter(rests_on_an_obligation, bundle.verdicts):
        examination.judge(verdict, shown=True, method="other tests")
    check_verdicts_on_the_net(examination, answered, 10_000)
    open_ = {name: one.only_claimed for name, one in examination.checked.items() if not one.shown}
    assert open_ == dict.fromkeys((*votes, "live"), "the time was over")


@pytest.mark.parametrize("name", ["workshop-6", "philosophers-4"])
def test_check_gives_every_verdict_that_is_missed_even_where_it_decides_none(name: str) -> None:
    for method in ("auto", "explicit"):
        report = check(family_net(name), budget=Budget(markings=2, seconds=0.5), method=method)
        assert set(SENTENCES) <= {verdict.name for verdict in report.verdicts}
