"""`firable bundle`: make the one file that may run on a cell."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from firable.cli import text
from firable.cli.files import READ, WRITTEN_BUNDLE
from firable.cli.loop import machines_option, read_fitting
from firable.cli.options import (
    analysis_options,
    answer,
    budget,
    formats_option,
    load_net,
    net_argument,
    page_option,
    with_page,
)
from firable.cli.progress import stages
from firable.cli.refine import read_catalogue, tasks_option
from firable.cli.report import Report
from firable.cli.terminated import terminated_as_by_ctrl_c

if TYPE_CHECKING:
    from threading import Event

    from firable.analysis.spaces.reachability import Budget
    from firable.decompose.refinement.sealing import Origin
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

_UNMADE: Final = "F4003"


@click.command(short_help="Check and prove a net, and seal it in a bundle that may run.")
@net_argument
@click.option("-o", "--output", metavar="FILE", type=WRITTEN_BUNDLE, required=True, help="The bundle to write.")
@machines_option
@click.option("--faults", is_flag=True, help="The same under lost and doubled messages, crashes and restarts.")
@click.option("--protocol", is_flag=True, help="Hold the proof on the voting protocol of this very net, too.")
@click.option(
    "--conceptual",
    metavar="NET",
    type=READ,
    help="Hold the conceptual net that NET was made of by `firable refine`, and that it does what that one does.",
)
@tasks_option
@analysis_options
@page_option
@formats_option
def bundle(
    net: str,
    output: str,
    page: str | None,
    format_: str,
    *,
    machines: str | None,
    protocol: bool,
    faults: bool,
    conceptual: str | None,
    files: tuple[str, ...],
    **limits: Any,
) -> int:
    """Check NET, split it, prove the split, and write subnets, table, verdicts and evidence as one sealed file.

    Nothing is written unless everything that the net must prove is proved, and evidence on it was found. `firable run`
    refuses a bundle of which any byte was changed. Each bundle holds the proof on the protocol for nets of any size;
    with --protocol and --faults it also holds one on the protocol of NET itself, step by step.
    With --machines it holds the plant, and the proof that its machines keep what votes rely on (O4).
    Each document of evidence, on NET and on each of its loops with machines, is looked for in --max-seconds, or 30; the
    loops are explored to the end.
    With --conceptual it holds the tasks, too, and the proof that opening them makes NET, and keeps what can be done.
    Ctrl-C or SIGTERM ends what is being done, writes no bundle and shows what is known so far.
    """
    if output == "-":
        raise click.UsageError("a bundle cannot go to standard output, where the report goes: name a file")
    if files and conceptual is None:
        raise click.UsageError("--tasks goes with --conceptual, whose places name tasks")
    asked = _Asked(net, output, budget(**limits), machines, protocol, faults, conceptual, files)
    with terminated_as_by_ctrl_c() as ended:
        return answer("bundle", format_, with_page(lambda: _telling(asked, ended), page), _show)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a bundle is to be made of, and what it is to hold."""

    net: str
    output: str
    allowed: Budget
    machines: str | None
    protocol: bool
    faults: bool
    conceptual: str | None
    tasks: tuple[str, ...]


def _telling(asked: _Asked, ended: Event) -> Report:
    """The report, which where no bundle was made tells of what stands in its place: a script would go on with that."""
    from firable.nets.diagnostics import Diagnostic, InputError, Severity

    try:
        report = _report(asked, ended)
    except InputError as error:
        if not (older := _older(asked.output)):
            raise
        *others, last = error.diagnostics
        raise InputError([*others, replace(last, hint="; ".join(filter(None, (last.hint, older))))]) from None
    if report.files or not (older := _older(asked.output)):
        return report
    hint = "take it away, so that nothing goes on with it"
    return replace(report, notes=(*report.notes, Diagnostic(_UNMADE, older, hint, severity=Severity.WARNING)))


def _older(output: str) -> str:
    """What is told of a file that stands where the bundle was to be written; nothing where there is none."""
    from firable.nets.bundle import read_bundle
    from firable.nets.diagnostics import InputError
    from firable.nets.source import printable

    if not Path(output).is_file():
        return ""
    try:
        older = read_bundle(output)
        what = f"an older bundle, of '{older.net.name}', identity {older.digest[:16]}"
    except InputError:
        what = "an older file"
    return f"{printable(output)} was not made by this call: it is {what}"


def _origin(asked: _Asked) -> Origin | None:
    """The conceptual net that the net is made of, with the tasks that its places name."""
    if asked.conceptual is None:
        return None
    from firable.decompose.refinement.sealing import Origin

    loaded = load_net(asked.conceptual)
    with loaded.placing():
        return Origin.of(loaded.net, read_catalogue(asked.tasks), asked.allowed)


def _plant(asked: _Asked, net: Net) -> tuple[str, tuple[Diagnostic, ...]]:
    """The text of the plant file, and what it warns of; nothing where none is named."""
    if asked.machines is None:
        return "", ()
    from firable.nets.machines.fitting import late_limits

    text, model = read_fitting(asked.machines, net)
    return text, late_limits(model, net)


def _report(asked: _Asked, ended: Event) -> Report:
    from firable.analysis.check import check
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits
    from firable.decompose.bundling import SECONDS, UnbundledError, make_bundle
    from firable.nets.blocked_timeouts import blocked_timeouts
    from firable.nets.bundle import write_bundle
    from firable.nets.oversights import overseen
    from firable.nets.verdict import Status, overall

    loaded, allowed = load_net(asked.net), asked.allowed
    plant, late = _plant(asked, loaded.net)
    origin = _origin(asked)
    with loaded.placing():
        found = check(loaded.net, budget=allowed)
    figures = found.figures.to_json()
    unmade = Report(
        "bundle",
        asked.net,
        loaded.net,
        found.verdicts,
        figures=figures,
        notes=(*loaded.notes, *overseen(loaded), *late),
        positions=loaded.positions,
    )
    if overall(unmade.verdicts) is not Status.PROVED:
        return unmade
    seconds = SECONDS if allowed.seconds is None else allowed.seconds
    told = {verdict.name: verdict for verdict in found.verdicts}  # with all that the bundle has no evidence on
    with loaded.placing(), stages() as stage:

        def begins(words: str) -> None:
            if ended.is_set():
                raise KeyboardInterrupt
            stage(words)

        try:
            made = make_bundle(
                found,
                Limits(Deadline.after(seconds), allowed.memory_bytes),
                protocol=asked.protocol,
                faults=asked.faults,
                plant=plant,
                origin=origin,
                begins=begins,
            )
        except UnbundledError as refusal:
            verdicts = tuple(told.get(one.name) or _told(one, asked) for one in refusal.verdicts)
            if overall(verdicts) is Status.PROVED:  # what is lacking is evidence
                raise
            return replace(unmade, verdicts=verdicts)
    write_bundle(asked.output, made)
    return replace(
        unmade,
        notes=(*unmade.notes, *loaded.placed(blocked_timeouts(made.decomposition))),
        verdicts=tuple(replace(told.get(one.name, one), evidence=one.evidence) for one in made.verdicts),
        figures={**figures, "bundle_digest": made.digest},
        table=made.decomposition.table,
        decomposition=made.decomposition,
        files=(asked.output,),
    )


def _told(verdict: Verdict, asked: _Asked) -> Verdict:
    """A verdict on one of the loops with machines, told without its run: it is of a net that is not shown here."""
    from firable.decompose.bundling import seen_by
    from firable.decompose.proofs.closed_loops import PREFIXES

    is_seen = verdict.witness is not None or verdict.status.value == "unknown"
    if asked.machines is None or not is_seen or not verdict.name.startswith(PREFIXES):
        return verdict
    seen = seen_by(verdict, shlex.quote(asked.net), shlex.quote(asked.machines))
    hint = "; ".join(filter(None, (verdict.hint, seen)))
    return replace(verdict, witness=None, hint=hint)


def _show(report: Report) -> None:
    text.show_diagnostics(note for note in report.notes if note.code != _UNMADE)
    text.heading(report.net, report.input)
    # What is told for information has its place in `check` and `split`; a warning is told wherever it is counted.
    told = [v for v in report.verdicts if not v.holds and (not report.files or v.weight.value == "warning")]
    text.show_verdicts(report.net, told)
    text.show_summary(report)
    if report.files:
        click.echo(f"  bundle {report.files[0]}, identity {report.figures['bundle_digest'][:16]}…")
    else:
        click.echo("  no bundle was made: only what is proved may run")
    for note in report.notes:
        if note.code == _UNMADE:
            text.show_diagnostic(note)
