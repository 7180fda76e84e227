"""The verdicts on the central net: each is what a document of evidence in the bundle shows of it.

A document is checked as `firable verify` checks any: sequences played, markings gone through, obligations derived anew.
Besides it must be about this very net, under interleaving, and the only spelling of itself; its obligations are
answered by the solver that was asked for, too. Then verdicts and records are held against each other both ways: a
verdict that a record shows otherwise is refused, and a record that no verdict speaks of as well. A verdict that no
record shows is only claimed, and so is one that was left undecided; one that is not there, though `check` gives it of
every net, is missed.

Of the votes, those that arcs and units settle have been judged before, by their obligations (`restating_votes`).

How a verdict was found, what that cost and the hint that it gives are told, not shown; nothing rests on them. Its
witness is played, and that of a vote which falls ends with who takes it back.
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
from firable.decompose.verification.solvers import Answers
from firable.decompose.verification.votes import PREFIX, Vote, question_of, votes
from firable.decompose.verification.words import SENTENCES, sentence_of
from firable.nets.diagnostics import InputError
from firable.nets.formula import Formula as StateFormula
from firable.nets.interchange import net_digest
from firable.nets.net import Net
from firable.nets.verdict import TOKENS_MAX, Status, Verdict, Weight
from firable.semantics.player import NotFirableError, Player
from firable.semantics.trace import Discipline

SUFFIX: Final = ".evidence.json"

ShownRecord: TypeAlias = CheckedRecord
"""A record of a document with what checking it found, for those here who hold verdicts against records."""


@dataclass
class _Shown:
    """What the documents show: the record of each name with its file, and the answers to each question.

    Two parts may ask the same, where two transitions read one place: then there are two answers.
    """

    records: dict[str, tuple[CheckedRecord, str]] = field(default_factory=dict)
    questions: dict[tuple[ClaimKind, Formula], list[tuple[CheckedRecord, str]]] = field(default_factory=dict)

    def answer(self, kind: ClaimKind, question: Formula) -> tuple[CheckedRecord, str] | None:
        """The next answer of this kind to a question, which is no other verdict's then."""
        waiting = self.questions.get((kind, question))
        return waiting.pop(0) if waiting else None


def check_verdicts_on_the_net(examination: Examination, answers: Answers, timeout_ms: int) -> None:
    """Judge every verdict that documents show or could show; raises `NotShownError` where one is not what they show."""
    formulas, shown = Formulas(), _Shown()
    others = set(examination.bundle.evidence) - examination.used
    for file in sorted(name for name in others if name.endswith(SUFFIX)):
        _read(examination, file, answers, timeout_ms, formulas, shown)
    _judge_votes(examination, formulas, shown)
    for verdict in list(examination.unjudged()):
        if (words := sentence_of(examination.bundle.net, verdict.name)) is not None:
            _judge(examination, verdict, words, shown)
    for name in (*SENTENCES, *(f"property.{prop.name}" for prop in examination.bundle.net.properties)):
        examination.verdict(name)  # nobody takes a warning out unnoticed
    for name in shown.records:
        raise NotShownError(f"the evidence on '{name}' belongs to no verdict of the bundle", "evidence", name)
    for _, file in (one for waiting in shown.questions.values() for one in waiting):
        raise NotShownError(f"'{file}' answers a question that no verdict asks", "evidence", file)


def answers_in(examination: Examination, file: str) -> dict[str, bool]:
    """What a document says of each of its questions, before anything is known of whether it shows that."""
    try:
        document = document_from_text(examination.text(file), file)
    except InputError as error:
        raise NotShownError(f"'{file}': {error.diagnostics[0].message}", "evidence", file) from None
    found = {record.name: record.proved for record in document.records}
    if len(found) < len(document.records):
        raise NotShownError(f"'{file}' answers one question twice", "evidence", file)
    return found


def checked_document(
    examination: Examination, file: str, net: Net, answers: Answers, timeout_ms: int
) -> list[CheckedRecord]:
    """The records of a document of evidence, checked, which must be about this very net and the one spelling of it."""
    text = examination.text(file)
    try:
        document = document_from_text(text, file)
        if document.to_text() != text:
            raise NotShownError(f"'{file}' is not as it was written", "evidence", file)
        if net_digest(document.net) != net_digest(net):
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
    for one in checked_document(examination, file, examination.bundle.net, answers, timeout_ms):
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
                if text not in asked and answers(text, timeout_ms)[-1:] == ("sat",):
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
        _compare(examination, verdict, vote.sentence, frozenset({Weight.INFORMATION}))
        question = vote.question(formulas) if vote.asked else FALSE  # which no document asks
        never = shown.answer(ClaimKind.NEVER, question)
        reachable = None if never else shown.answer(ClaimKind.REACHABLE, question)
        _by_record(examination, verdict, never or reachable, proved=never is not None)
        if verdict.status is Status.VIOLATED:
            _falls(examination, verdict, vote)
    if missing := sorted(name for name in demanded if name not in examination.by_name):
        raise NotShownError(f"there is no verdict on '{missing[0]}'", "verdicts", missing[0])


def _falls(examination: Examination, verdict: Verdict, vote: Vote) -> None:
    """The run that a fallen vote tells ends with who takes it back, and names nobody who could not."""
    subject, witness, net = ("verdicts", verdict.name), verdict.witness, examination.bundle.net
    if (
        verdict.code
        or len(set(verdict.subjects)) < len(verdict.subjects)
        or not set(vote.accused).issuperset(verdict.subjects)
    ):
        raise NotShownError(f"'{verdict.name}' blames what cannot take the yes back", *subject)
    if witness is None or not witness.firings or witness.cycle:
        raise NotShownError(f"'{verdict.name}' does not tell how the yes is taken back", *subject)
    player, before = Player(net), net.initial_marking
    for fired in witness.firings[:-1]:
        before = player.fire(before, [net.transition_index[name] for name in fired])
    stands = vote.full.issubset(net.names(before)) and vote.empty.isdisjoint(net.names(before))
    if not stands or not set(verdict.subjects).issuperset(witness.firings[-1]):
        raise NotShownError(f"the firings of '{verdict.name}' do not end with who takes the yes back", *subject)


def _judge(examination: Examination, verdict: Verdict, words: tuple[str, frozenset[Weight]], shown: _Shown) -> None:
    _compare(examination, verdict, *words)
    found = shown.records.pop(verdict.name, None)
    _by_record(examination, verdict, found, proved=found is not None and found[0].record.proved)


def _compare(examination: Examination, verdict: Verdict, sentence: str, weights: frozenset[Weight]) -> None:
    """What a verdict says, how, and what it would play, as far as that can be known without any proof."""
    subject = ("verdicts", verdict.name)
    if verdict.statement != sentence or verdict.weight not in weights:
        raise NotShownError(f"'{verdict.name}' says something else than what is shown of it", *subject)
    if verdict.discipline != Discipline.INTERLEAVING.value:
        raise NotShownError(f"'{verdict.name}' is on another discipline than interleaving", *subject)
    if verdict.holds and (verdict.code or verdict.subjects):
        raise NotShownError(f"'{verdict.name}' holds, and yet tells of an exception", *subject)
    if verdict.witness is not None:
        _play(examination, verdict)


def _by_record(
    examination: Examination, verdict: Verdict, found: tuple[CheckedRecord, str] | None, *, proved: bool
) -> None:
    subject = ("verdicts", verdict.name)
    if found is None:
        if verdict.evidence:
            raise NotShownError(f"the evidence that '{verdict.name}' names does not speak of it", *subject)
        undecided = verdict.status is Status.UNKNOWN
        said = "undecided: the bundle itself does not say" if undecided else "only claimed: no evidence is on it"
        examination.judge(verdict, shown=False, method="nothing", only_claimed=said)
        return
    one, file = found
    if verdict.status is not (Status.PROVED if proved else Status.VIOLATED):
        raise NotShownError(f"'{verdict.name}' is {verdict.status.value}, and the evidence says otherwise", *subject)
    if verdict.evidence != (() if one.record.lacking else (file,)):
        raise NotShownError(f"'{verdict.name}' does not name the evidence on it", *subject)
    method = "; ".join(one.methods) or "read off the net"
    examination.judge(verdict, shown=one.shown, method=method, only_claimed=one.only_claimed)


def _play(examination: Examination, verdict: Verdict) -> None:
    net, witness = examination.bundle.net, verdict.witness
    assert witness is not None
    player, marking = Player(net), net.initial_marking
    try:
        for fired in witness.firings:
            marking = player.fire(marking, [net.transition_index[name] for name in fired])
        after = marking
        for fired in witness.cycle:
            after = player.fire(after, [net.transition_index[name] for name in fired])
    except (NotFirableError, KeyError):
        raise NotShownError(f"the firings of '{verdict.name}' cannot be played", "verdicts", verdict.name) from None
    left_out = not witness.marking and marking.bit_count() > TOKENS_MAX
    if witness.assignment or not (left_out or set(witness.marking) == set(net.names(marking))):
        raise NotShownError(f"the firings of '{verdict.name}' end elsewhere", "verdicts", verdict.name)
    if witness.cycle and after != marking:
        raise NotShownError(f"the cycle of '{verdict.name}' does not close", "verdicts", verdict.name)
