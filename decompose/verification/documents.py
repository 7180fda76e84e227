"""The verdicts on the central net: each is what a document of evidence in the bundle shows of it.

A document is checked as `firable verify` checks any: sequences played, markings gone through, obligations derived anew.
Besides it must be about this very net, under interleaving, and the only spelling of itself; its obligations are
answered by the solver that was asked for, too. Then verdicts and records are held against each other both ways: a
verdict that a record shows otherwise is refused, and a record that no verdict speaks of as well. A verdict that no
record shows is only claimed, and so is one that was left undecided; one that is not there, though `check` gives it of
every net, is missed.

Of the votes, those that arcs and units settle have been judged before, by their obligations (`restating_votes`).

A verdict says what is shown of it, and nothing else: how it was found, whom it is about, the run and the hint are told
by `firable check`, and stand in the document as far as they show anything. So nothing in it can be edited unnoticed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, TypeAlias

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Certificate, Continuation, Labelling
from firable.analysis.evidence.checking.checker import CheckedRecord, check_document
from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.checking.obligations import obligations
from firable.analysis.evidence.claims import ClaimKind
from firable.analysis.evidence.document import Document, document_from_text
from firable.analysis.evidence.refusal import TimeIsOverError
from firable.decompose.verification.checked import Examination
from firable.decompose.verification.formulas import FALSE, Formula, Formulas
from firable.decompose.verification.refusal import NotShownError
from firable.decompose.verification.solvers import Answers, SolverError
from firable.decompose.verification.votes import PREFIX, question_of, votes
from firable.decompose.verification.words import SENTENCES, sentence_of, weight_of_conflicts
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula as StateFormula
from firable.nets.interchange import net_to_json
from firable.nets.net import Net
from firable.nets.verdict import NOTHING, Status, Verdict, Weight
from firable.semantics.trace import Discipline

SUFFIX: Final = ".evidence.json"
METHOD: Final = "shown by its evidence"
"""What each such verdict says of how it was found."""
UNDECIDED: Final = "not decided within the limits"
Words: TypeAlias = tuple[str, frozenset[Weight]]

ShownRecord: TypeAlias = CheckedRecord
"""A record of a document with what checking it found, for those here who hold verdicts against records."""


@dataclass
class _Shown:
    """What the documents show: the record of each name with its file, and the answers to each question.

    Two parts may ask the same, where two transitions read one place: then there are two answers. `order` holds the
    records of each file that no verdict has taken so far: they stand there in the order of the verdicts.
    """

    records: dict[str, tuple[CheckedRecord, str]] = field(default_factory=dict)
    questions: dict[tuple[ClaimKind, Formula], list[tuple[CheckedRecord, str]]] = field(default_factory=dict)
    order: dict[str, list[CheckedRecord]] = field(default_factory=dict)

    def answer(self, kind: ClaimKind, question: Formula) -> tuple[CheckedRecord, str] | None:
        """The next answer of this kind to a question, which is no other verdict's then."""
        waiting = self.questions.get((kind, question))
        return self._taken(waiting.pop(0)) if waiting else None

    def record(self, name: str) -> tuple[CheckedRecord, str] | None:
        """The record on a verdict of this name, which is no other verdict's then."""
        return self._taken(self.records.pop(name)) if name in self.records else None

    def _taken(self, found: tuple[CheckedRecord, str]) -> tuple[CheckedRecord, str]:
        record, file = found
        if record is not self.order[file].pop(0):
            raise NotShownError(f"the records of '{file}' are in another order than the verdicts", "evidence", file)
        return found


def check_verdicts_on_the_net(examination: Examination, answers: Answers, timeout_ms: int) -> None:
    """Judge every verdict that documents show or could show; raises `NotShownError` where one is not what they show."""
    formulas, shown = Formulas(), _Shown()
    others = set(examination.bundle.evidence) - examination.used
    for file in sorted(name for name in others if name.endswith(SUFFIX)):
        _read(examination, file, answers, timeout_ms, formulas, shown)
    _judge_votes(examination, formulas, shown)
    for verdict in list(examination.unjudged()):
        if (words := sentence_of(examination.bundle.net, verdict.name)) is not None:
            _judge_on_the_net(examination, verdict, words, shown)
    for name in (*SENTENCES, *(f"property.{prop.name}" for prop in examination.bundle.net.properties)):
        examination.verdict(name)  # nobody takes a warning out unnoticed
    for name in shown.records:
        raise NotShownError(f"the evidence on '{name}' belongs to no verdict of the bundle", "evidence", name)
    for _, file in (one for waiting in shown.questions.values() for one in waiting):
        raise NotShownError(f"'{file}' answers a question that no verdict asks", "evidence", file)
    for file in (file for file, left in shown.order.items() if left):
        raise NotShownError(f"'{file}' has a record that claims nothing", "evidence", file)


def answers_in(examination: Examination, file: str) -> dict[str, bool]:
    """What a document says of each of its questions, before anything is known of whether it shows that."""
    try:
        document = document_from_text(examination.text(file), file)
    except InputError as error:
        raise NotShownError(f"'{file}': {error.diagnostics[0].message}", "evidence", file) from None
    return {record.name: record.proved for record in document.records}


def checked_document(
    examination: Examination, file: str, net: Net, answers: Answers, timeout_ms: int
) -> list[CheckedRecord]:
    """The records of a document of evidence, checked, which must be about this very net and the one spelling of it."""
    text = examination.text(file)
    try:
        document = document_from_text(text, file)
        if document.to_text() != text:
            raise NotShownError(f"'{file}' is not as it was written", "evidence", file)
        if net_to_json(document.net) != net_to_json(net):  # with all words, which a digest leaves out
            raise NotShownError(f"'{file}' is about another net", "evidence", file)
        if document.discipline is not Discipline.INTERLEAVING:
            raise NotShownError(f"'{file}' is about another discipline", "evidence", file)
        checked = list(check_document(document, timeout_ms=timeout_ms))
    except InputError as error:
        raise NotShownError(f"'{file}': {error.diagnostics[0].message}", "evidence", file) from None
    _ask_again(document, file, answers, timeout_ms)
    return checked


def _read(
    examination: Examination, file: str, answers: Answers, timeout_ms: int, formulas: Formulas, shown: _Shown
) -> None:
    shown.order[file] = checked_document(examination, file, examination.bundle.net, answers, timeout_ms)
    for one in shown.order[file]:
        record = one.record
        if record.name:
            if record.name in shown.records or record.query:
                raise NotShownError(f"'{file}' speaks of '{record.name}', as no bundle does", "evidence", file)
            shown.records[record.name] = (one, file)
            continue
        for claim, _ in record.shown:
            goal = claim.goal
            if not isinstance(goal, StateFormula) or claim.kind not in {ClaimKind.NEVER, ClaimKind.REACHABLE}:
                raise NotShownError(f"'{file}' claims '{claim}' of no verdict", "evidence", file)
            shown.questions.setdefault((claim.kind, question_of(goal, formulas)), []).append((one, file))


def _ask_again(document: Document, file: str, answers: Answers, timeout_ms: int) -> None:
    """Ask the solver every obligation of a document; where it refutes one, the document is refused."""
    asked: set[str] = set()
    closed: set[tuple[object, ...]] = set()
    for record in document.records:
        for claim, certificate in record.shown:
            evidence = Evidence(document.net, document.discipline, claim, certificate)
            on, deadline = _set_of(certificate), Deadline.after(timeout_ms / 1000)
            try:
                found = obligations(evidence, deadline, closed=on in closed)
                texts = [one.text(evidence) for one in found]
            except TimeIsOverError:
                continue  # the record is then only claimed, as the checker says of it
            for text in texts:
                try:
                    refuted = text not in asked and answers(text, timeout_ms)[-1:] == ("sat",)
                except SolverError as error:
                    message = f"the solver cannot read an obligation of '{file}' on '{record.name}': {error}"
                    raise NotShownError(message, "evidence", file) from None
                if refuted:
                    raise NotShownError(f"an obligation of '{file}' on '{record.name}' is refuted", "evidence", file)
                asked.add(text)
            if on is not None:
                closed.add(on)


def _set_of(certificate: Certificate) -> tuple[object, ...] | None:
    """What tells the set of markings that a claim rests on, and where it begins: whether it is closed is asked once."""
    match certificate:
        case Labelling(space):
            return (id(space),)
        case Continuation(firings, Labelling(space)):
            return (id(space), firings)
    return None


def _judge_votes(examination: Examination, formulas: Formulas, shown: _Shown) -> None:
    demanded = {vote.name: vote for vote in votes(examination.bundle.decomposition)}
    for verdict in [v for v in examination.unjudged() if v.name.startswith(PREFIX)]:
        if verdict.name not in demanded:
            raise NotShownError(f"'{verdict.name}' is on no part", "verdicts", verdict.name)
        vote = demanded[verdict.name]
        question = vote.question(formulas) if vote.asked else FALSE  # which no document asks
        never = shown.answer(ClaimKind.NEVER, question)
        found = never or shown.answer(ClaimKind.REACHABLE, question)
        _judge(examination, verdict, vote.sentence, Weight.INFORMATION, found, proved=never is not None)
    if missing := sorted(name for name in demanded if name not in examination.by_name):
        raise NotShownError(f"there is no verdict on '{missing[0]}'", "verdicts", missing[0])


def _judge_on_the_net(examination: Examination, verdict: Verdict, words: Words, shown: _Shown) -> None:
    sentence, weights = words
    found = shown.record(verdict.name)
    proved = found is not None and found[0].record.proved
    weight = min(weights) if len(weights) == 1 else weight_of_conflicts(examination.bundle.net, proved=verdict.holds)
    _judge(examination, verdict, sentence, weight, found, proved=proved)


def _judge(
    examination: Examination,
    verdict: Verdict,
    sentence: str,
    weight: Weight,
    found: tuple[CheckedRecord, str] | None,
    *,
    proved: bool,
) -> None:
    """Hold a verdict against its record, where there is one: it says what that says, and nothing else."""
    subject, status = ("verdicts", verdict.name), verdict.status
    evidence: tuple[str, ...] = ()
    if found is not None:
        status = Status.PROVED if proved else Status.VIOLATED
        evidence = () if found[0].record.lacking else (found[1],)
    wanted = Verdict(
        verdict.name,
        status,
        sentence,
        METHOD,
        weight,
        bound=UNDECIDED if status is Status.UNKNOWN else "",
        evidence=evidence,
        discipline=Discipline.INTERLEAVING.value,
    )
    if verdict.status is not status:
        raise NotShownError(f"'{verdict.name}' is {verdict.status.value}, and the evidence says otherwise", *subject)
    if verdict.evidence != evidence:
        raise NotShownError(f"'{verdict.name}' does not name the evidence on it, or names what is none", *subject)
    if verdict != wanted:
        raise NotShownError(f"'{verdict.name}' says something else than what is shown of it", *subject)
    if found is None:
        undecided = status is Status.UNKNOWN
        said = "undecided: the bundle itself does not say" if undecided else "only claimed: no evidence is on it"
        examination.judge(verdict, shown=False, method=NOTHING, only_claimed=said)
        return
    method = "; ".join(found[0].methods) or "the net itself"
    examination.judge(verdict, shown=found[0].shown, method=method, only_claimed=found[0].only_claimed)
