"""`firable verify`: does this evidence, or this bundle, show what it claims?"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from firable.cli.choice import OneOf
from firable.cli.files import FOLDER, READ
from firable.cli.finite import FiniteRange
from firable.cli.options import answer_all, formats_option, is_given, load_net, refuse_a_net, write_folder
from firable.cli.progress import stages
from firable.cli.report import Report
from firable.cli.sign import trust_option
from firable.cli.verified import show

if TYPE_CHECKING:
    from firable.analysis.evidence.checking.checker import CheckedRecord
    from firable.analysis.evidence.document import Document, Record
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

_CLAIMS_MAX = 3  # told of one verdict
_CLAIM_MAX = 100  # characters told of one claim


@click.command(short_help="Check evidence or a bundle anew, without what made it.")
@click.argument("evidence", metavar="EVIDENCE...", type=READ, nargs=-1, required=True)
@click.option("--net", "of", metavar="NET", type=READ, help="Refuse evidence on any other net than this one.")
@click.option(
    "--solver",
    type=OneOf(["cvc5", "z3"]),
    default="cvc5",
    show_default=True,
    help="Which solver answers the obligations of a bundle, which z3 has proved.",
)
@click.option(
    "--smt-dir", metavar="DIR", type=FOLDER, help="Write each obligation as an SMT-LIB 2 file, for another solver."
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.001),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Give up an obligation after so much time.",
)
@trust_option
@formats_option
def verify(
    evidence: tuple[str, ...],
    of: str | None,
    solver: str,
    smt_dir: str | None,
    timeout: float,
    trust: tuple[str, ...],
    format_: str,
) -> int:
    """Check EVIDENCE again: documents that `firable check --evidence DIR` wrote, or bundles.

    Each verdict of a document is shown again, from the firing rule alone: firing sequences are played, listed markings
    fired through, decision diagrams found closed, the obligations of invariants derived anew from the net and decided
    by z3. Of each it is told how. "shown", or "proved" in JSON, means that the evidence shows it, whether it says that
    something holds or that it is violated; a verdict that nothing shows is "claimed", or "unknown", and told why.

    Exit codes: 0 all that is claimed is shown, 3 some is only claimed, the time was over, or a document claims nothing,
    2 evidence was damaged or edited, is about another net, or does not show what it claims. What a bundle itself leaves
    undecided claims nothing.
    """
    for file in evidence:
        refuse_a_net(file, "what is verified is evidence of one", "firable verify")
    milliseconds = max(1, round(timeout * 1000))
    net = None if of is None else load_net(of).net
    many = len(evidence) > 1
    asked = _Asked(net, solver, smt_dir, milliseconds, many=many, trust=trust)
    if is_given("solver") and not any(map(_is_bundle, evidence)):
        raise click.UsageError("--solver is for bundles: of documents z3 decides what invariants claim, and only that")
    if trust and not all(map(_is_bundle, evidence)):
        raise click.UsageError("--trust is for bundles: documents of evidence are not signed, and need not be")
    makers = [partial(_of_bundle if _is_bundle(file) else _report, file, asked) for file in evidence]
    return answer_all("verify", format_, makers, partial(show, smt_dir=smt_dir))


@dataclass(frozen=True)
class _Asked:
    """What the options ask for."""

    of: Net | None
    solver: str
    smt_dir: str | None
    timeout_ms: int
    many: bool
    trust: tuple[str, ...]

    def write(self, file: str, texts: Mapping[str, str]) -> tuple[str, ...]:
        """Write SMT-LIB 2 files where that is asked for: of many inputs, in a folder for each."""
        from firable.nets.bundle import file_stem

        if self.smt_dir is None:
            return ()
        folder = str(Path(self.smt_dir) / file_stem(file)) if self.many else self.smt_dir
        return write_folder(folder, texts)


def _is_bundle(file: str) -> bool:
    from firable.nets.archive import SIGNATURE

    try:
        with Path(file).open("rb") as stream:
            return stream.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False  # which reading it as a document says


def _of_bundle(file: str, asked: _Asked) -> Report:
    from firable.decompose.verification.checking import check_bundle
    from firable.nets.bundle import read_bundle

    bundle = read_bundle(file)
    signers: tuple[str, ...] = ()
    if asked.trust:
        from firable.nets.signing import demand_signature

        signers = demand_signature(bundle, file, asked.trust)
    if asked.of is not None:
        _refuse_another_net(file, bundle.net, asked.of)
    with _named(file), stages() as begins:
        checked = check_bundle(bundle, solver=asked.solver, timeout_ms=asked.timeout_ms, begins=begins)
    verdicts = [_told(one.verdict, one.method, one.only_claimed, shown=one.shown) for one in checked]
    claims = [one.verdict for one in checked]
    files = asked.write(file, {name: text for name, text in bundle.evidence.items() if name.endswith(".smt2")})
    of = {"digest": bundle.digest, "solver": asked.solver, **({"signed_by": ", ".join(signers)} if signers else {})}
    return Report("verify", file, bundle.net, verdicts, files=files, bundle=of, claims=claims)


def _report(file: str, asked: _Asked) -> Report:
    from firable.analysis.evidence.checking.checker import check_document
    from firable.analysis.evidence.document import read_document

    document = read_document(file)
    if asked.of is not None:
        _refuse_another_net(file, document.net, asked.of)
    checked = list(check_document(document, timeout_ms=asked.timeout_ms))
    verdicts = [_verdict(document, one) for one in checked]
    claims = [_claim(document, one) for one in checked]
    files = asked.write(file, dict(_obligations(document, asked.timeout_ms))) if asked.smt_dir is not None else ()
    discipline = document.discipline.value
    return Report("verify", file, document.net, tuple(verdicts), discipline=discipline, files=files, claims=claims)


def _verdict(document: Document, checked: CheckedRecord) -> Verdict:
    """What is said of a record: that it is shown, whether it says that something holds or that it is violated."""
    from firable.nets.verdict import NOTHING, Status, Verdict

    record = checked.record
    said = f"it {'holds' if record.proved else 'is violated'}{_of(record, _claimed(record))}: " if record.name else ""
    late = checked.only_claimed and not checked.only_claimed.startswith("only claimed")
    return Verdict(
        record.name or "evidence",
        Status.PROVED if checked.shown else Status.UNKNOWN,
        f"{said}{_claimed(record)}".removesuffix(": "),
        "; ".join(checked.methods) or NOTHING,
        bound=checked.only_claimed,
        hint="allow more time" if late else "",
        discipline=document.discipline.value,
    )


def _claim(document: Document, checked: CheckedRecord) -> Verdict:
    """The verdict that a record claims, with the weight of its name; what nobody knows by its name must hold.

    For information alone are claims without a name, as those of votes, and what is asked of the dead, who may hold up
    anything.
    """
    from firable.decompose.verification.bereft import DEAD
    from firable.decompose.verification.words import SENTENCES
    from firable.nets.verdict import Status, Verdict, Weight

    record = checked.record
    sentence, weights = SENTENCES.get(record.name, ("", {Weight.REQUIRED}))
    told_alone = not record.name or DEAD in document.net.place_index
    weight = Weight.INFORMATION if told_alone else next(one for one in Weight if one in weights)
    status = Status.PROVED if record.proved else Status.VIOLATED
    said = _claimed(record) or sentence
    return Verdict(record.name, status, f"{said}{_of(record, _claimed(record))}", "claimed", weight)


def _of(record: Record, said: str) -> str:
    """The query that a record answers, unless what is said of it is the formula itself or that it does not hold."""
    logic, _, formula = record.query.partition(" ")
    named = f"{logic.upper()}: "
    denied = {f"{named}not {formula}", f"{named}not ({formula})", f"a run does not satisfy {named}{formula}"}
    is_said = said in {f"{named}{formula}", *denied}
    return f" ({record.query})" if record.query and not is_said else ""


def _claimed(record: Record) -> str:
    """What the evidence of a record shows, the first of it."""
    claims = [_shortened(str(claim)) for claim, _ in record.shown]
    more = f", and {len(claims) - _CLAIMS_MAX} more claims" if len(claims) > _CLAIMS_MAX else ""
    return f"{'; '.join(claims[:_CLAIMS_MAX])}{more}"


def _shortened(text: str) -> str:
    return text if len(text) <= _CLAIM_MAX else f"{text[: _CLAIM_MAX - 1]}…"


def _told(verdict: Verdict, method: str, only_claimed: str, *, shown: bool) -> Verdict:
    """What is said of a verdict of a bundle; one that the bundle leaves undecided claims nothing, and weighs so."""
    from firable.nets.verdict import Status, Verdict

    if verdict.status is Status.UNKNOWN:
        return Verdict(verdict.name, Status.UNKNOWN, verdict.statement, method, verdict.weight, bound=only_claimed)
    violated = "it is violated: " if verdict.status is Status.VIOLATED else ""
    return Verdict(
        verdict.name,
        Status.PROVED if shown else Status.UNKNOWN,
        f"{violated}{verdict.statement}",
        method,
        bound=only_claimed,
        hint="allow more time" if only_claimed.endswith("gave up") else "",
    )


@contextmanager
def _named(file: str) -> Generator[None]:
    """Name the file in what is found to be wrong with it in this block."""
    from firable.nets.diagnostics import InputError, Span
    from firable.nets.source import printable

    try:
        yield
    except InputError as error:
        at = Span(printable(file), 1, 1)
        raise InputError([replace(one, span=one.span or at) for one in error.diagnostics]) from None


def _refuse_another_net(file: str, net: Net, of: Net) -> None:
    from firable.nets.diagnostics import Diagnostic, InputError, Span
    from firable.nets.interchange import net_digest
    from firable.nets.source import printable

    if net_digest(net) != net_digest(of):
        message = f"the evidence does not show what it claims of this net: it is about another one, '{net.name}'"
        hint = "a change of a place, an arc or a gate makes another net; check it anew"
        raise InputError([Diagnostic("F6002", message, hint, span=Span(printable(file), 1, 1))])


def _obligations(document: Document, timeout_ms: int) -> Iterator[tuple[str, str]]:
    """The SMT-LIB 2 text of each obligation, by the name of its file: verdict, number of the claim, obligation."""
    from firable.analysis.deadline import Deadline
    from firable.analysis.evidence.checking.obligation import Evidence
    from firable.analysis.evidence.checking.obligations import obligations, sums_text
    from firable.analysis.evidence.refusal import TimeIsOverError
    from firable.nets.bundle import file_stem

    for record in document.records:
        for number, (claim, certificate) in enumerate(record.shown, start=1):
            evidence = Evidence(document.net, document.discipline, claim, certificate)
            name = file_stem(record.name or "evidence") + (f".{number}" if len(record.shown) > 1 else "")
            try:
                written = obligations(evidence, Deadline.after(timeout_ms / 1000))
            except TimeIsOverError:
                continue  # what takes so long is not shown either, as its verdict says
            for obligation in written:
                yield f"{name}.{obligation.name}.smt2", obligation.text(evidence)
            if (sums := sums_text(evidence)) is not None:
                yield f"{name}.sums.smt2", sums
