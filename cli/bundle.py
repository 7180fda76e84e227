"""`firable bundle`: make the one file that may run on a cell."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from firable.cli import text
from firable.cli.files import READ, WRITTEN
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
from firable.cli.refine import read_catalogue, tasks_option
from firable.cli.report import Report

if TYPE_CHECKING:
    from firable.analysis.spaces.reachability import Budget
    from firable.decompose.refinement.sealing import Origin
    from firable.nets.verdict import Verdict

_UNMADE: Final = "F4003"


@click.command(short_help="Check and prove a net, and seal it in a bundle that may run.")
@net_argument
@click.option("-o", "--output", metavar="FILE", type=WRITTEN, required=True, help="The bundle to write.")
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
    """
    if output == "-":
        raise click.UsageError("a bundle cannot go to standard output, where the report goes: name a file")
    more: dict[str, Any] = {"protocol": protocol, "faults": faults}
    if files and conceptual is None:
        raise click.UsageError("--tasks goes with --conceptual, whose places name tasks")
    made_of = None if conceptual is None else (conceptual, files)
    return answer(
        "bundle", format_, with_page(lambda: _telling(net, output, limits, more, machines, made_of), page), _show
    )


def _telling(argument: str, output: str, *more: Any) -> Report:
    """The report, which where no bundle was made tells of what stands in its place: a script would go on with that."""
    from firable.nets.diagnostics import Diagnostic, InputError, Severity

    try:
        report = _report(argument, output, *more)
    except InputError as error:
        if not (older := _older(output)):
            raise
        *others, last = error.diagnostics
        raise InputError([*others, replace(last, hint="; ".join(filter(None, (last.hint, older))))]) from None
    if report.files or not (older := _older(output)):
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


def _origin(conceptual: str, files: tuple[str, ...], allowed: Budget) -> Origin:
    from firable.decompose.refinement.sealing import Origin

    loaded = load_net(conceptual)
    with loaded.placing():
        return Origin.of(loaded.net, read_catalogue(files), allowed)


def _report(
    argument: str,
    output: str,
    limits: dict[str, Any],
    more: dict[str, Any],
    machines: str | None,
    made_of: tuple[str, tuple[str, ...]] | None,
) -> Report:
    from firable.analysis.check import check
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits
    from firable.decompose.bundling import SECONDS, UnbundledError, make_bundle
    from firable.nets.blocked_timeouts import blocked_timeouts
    from firable.nets.bundle import write_bundle
    from firable.nets.verdict import Status, overall

    loaded = load_net(argument)
    net, allowed, notes = loaded.net, budget(**limits), loaded.notes
    if machines is not None:
        from firable.nets.machines.plant_file import late_limits

        more["plant"], model = read_fitting(machines, net)
        notes += late_limits(model, net)
    if made_of is not None:
        more["origin"] = _origin(*made_of, allowed)
    with loaded.placing():
        found = check(net, budget=allowed)
    figures = found.figures.to_json()
    unmade = Report("bundle", argument, net, found.verdicts, figures=figures, notes=notes, positions=loaded.positions)
    if overall(unmade.verdicts) is not Status.PROVED:
        return unmade
    seconds = SECONDS if allowed.seconds is None else allowed.seconds
    told = {verdict.name: verdict for verdict in found.verdicts}  # with all that the bundle has no evidence on
    with loaded.placing():
        try:
            made = make_bundle(found, Limits(Deadline.after(seconds), allowed.memory_bytes), **more)
        except UnbundledError as refusal:
            verdicts = tuple(told.get(one.name) or _told(one, argument, machines) for one in refusal.verdicts)
            if overall(verdicts) is Status.PROVED:  # what is lacking is evidence
                raise
            return replace(unmade, verdicts=verdicts)
    write_bundle(output, made)
    return replace(
        unmade,
        notes=(*notes, *loaded.placed(blocked_timeouts(made.decomposition))),
        verdicts=tuple(replace(told.get(one.name, one), evidence=one.evidence) for one in made.verdicts),
        figures={**figures, "bundle_digest": made.digest},
        table=made.decomposition.table,
        decomposition=made.decomposition,
        files=(output,),
    )


def _told(verdict: Verdict, argument: str, machines: str | None) -> Verdict:
    """A verdict on one of the loops with machines, told without its run: it is of a net that is not shown here."""
    from firable.decompose.bundling import seen_by
    from firable.decompose.proofs.closed_loops import PREFIXES

    is_seen = verdict.witness is not None or verdict.status.value == "unknown"
    if machines is None or not is_seen or not verdict.name.startswith(PREFIXES):
        return verdict
    hint = "; ".join(filter(None, (verdict.hint, seen_by(verdict, shlex.quote(argument), shlex.quote(machines)))))
    return replace(verdict, witness=None, hint=hint)


def _show(report: Report) -> None:
    for note in report.notes:
        if note.code != _UNMADE:
            text.show_diagnostic(note)
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
