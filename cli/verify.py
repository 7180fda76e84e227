"""`firable verify`: does this evidence show what it claims?"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from firable.cli import text
from firable.cli.options import answer_all, format_option, load_net, write_folder
from firable.cli.report import Report

if TYPE_CHECKING:
    from firable.analysis.evidence.document import Evidence
    from firable.nets.net import Net


@click.command(short_help="Check evidence anew, without the technique that made it.")
@click.argument("evidence", metavar="EVIDENCE...", nargs=-1, required=True)
@click.option("--net", "of", metavar="NET", help="Refuse evidence on any other net than this one.")
@click.option("--smt-dir", metavar="DIR", help="Write each obligation as an SMT-LIB 2 file, for another solver.")
@click.option(
    "--timeout",
    type=click.FloatRange(min=0.001),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Give up an obligation after so much time.",
)
@format_option
def verify(evidence: tuple[str, ...], of: str | None, smt_dir: str | None, timeout: float, format_: str) -> int:
    """Check documents of EVIDENCE, written by `firable check --evidence DIR`.

    A firing sequence is played, a set of markings is fired through, and the obligations of an inductive invariant are
    derived anew from the net and decided by z3. Evidence that was damaged or edited, or that does not show what it
    claims, is refused as an input error.
    """
    milliseconds = max(1, round(timeout * 1000))
    net = None if of is None else load_net(of).net
    many = len(evidence) > 1
    makers = [partial(_report, file, net, smt_dir, milliseconds, many=many) for file in evidence]
    return answer_all("verify", format_, makers, _show)


def _report(file: str, of: Net | None, smt_dir: str | None, timeout_ms: int, *, many: bool) -> Report:
    from firable.analysis.evidence.checker import check_evidence
    from firable.analysis.evidence.document import read_evidence
    from firable.nets.bundle import file_stem
    from firable.nets.verdict import Status, Verdict

    evidence = read_evidence(file)
    if of is not None:
        _refuse_another_net(file, evidence, of)
    checked = check_evidence(evidence, timeout_ms=timeout_ms)
    files: tuple[str, ...] = ()
    if smt_dir is not None:
        folder = str(Path(smt_dir) / file_stem(Path(file).stem)) if many else smt_dir
        files = write_folder(folder, _obligations(evidence))
    verdict = Verdict(
        "evidence",
        Status.PROVED if checked.shown else Status.UNKNOWN,
        str(evidence.claim),
        checked.method,
        bound=checked.bound,
        hint="" if checked.shown else "allow more time",
        evidence=tuple(Path(path).name for path in files),
        discipline=evidence.discipline.value,
    )
    return Report("verify", file, evidence.net, (verdict,), discipline=evidence.discipline.value, files=files)


def _refuse_another_net(file: str, evidence: Evidence, of: Net) -> None:
    from firable.nets.diagnostics import Diagnostic, InputError, Span
    from firable.nets.interchange import net_digest
    from firable.nets.source import printable

    if net_digest(evidence.net) != net_digest(of):
        message = (
            f"the evidence does not show what it claims of this net: it is about another one, '{evidence.net.name}'"
        )
        hint = "a change of a place, an arc or a gate makes another net; check it anew"
        raise InputError([Diagnostic("F6002", message, hint, span=Span(printable(file), 1, 1))])


def _obligations(evidence: Evidence) -> dict[str, str]:
    """The SMT-LIB 2 text of each obligation, by the name of its file."""
    from firable.analysis.evidence.obligations import obligations, sums_text

    files = {f"{obligation.name}.smt2": obligation.text(evidence) for obligation in obligations(evidence)}
    if (sums := sums_text(evidence)) is not None:
        files["sums.smt2"] = sums
    return files


def _show(report: Report) -> None:
    text.heading(report.net, report.input)
    words = {"interleaving": "interleaving", "step": "synchronous steps"}[report.discipline]
    click.echo(f"  {words}, external gates free")
    text.show_verdicts(report.net, report.verdicts, verbose=True)
    if report.files:
        click.echo(f"\n  {len(report.files)} SMT-LIB 2 files in {Path(report.files[0]).parent}")
