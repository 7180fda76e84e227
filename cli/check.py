"""`firable check`: everything that the reachability graph of a net decides."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from firable.cli import text
from firable.cli.options import analysis_options, answer_all, budget, format_option, load_net, write_folder
from firable.cli.report import Report
from firable.cli.structure import structure_json, structure_lines

if TYPE_CHECKING:
    from firable.analysis.check import CheckReport
    from firable.analysis.spaces.reachability import Budget


@click.command(short_help="Check nets: deadlock, contact, liveness, conflicts, their own properties.")
@click.argument("nets", metavar="NET...", nargs=-1, required=True)
@click.option(
    "--discipline",
    type=click.Choice(["interleaving", "step"]),
    default="interleaving",
    show_default=True,
    help="One transition at a time, or all enabled ones of a scan together.",
)
@analysis_options
@click.option("--trace-dir", metavar="DIR", help="Write the firing sequence of each violation, for `firable replay`.")
@click.option(
    "--structure", is_flag=True, help="Also net class, invariants, siphons, traps; in --max-seconds more, or 30."
)
@click.option("-v", "--verbose", is_flag=True, help="Tell methods, costs and the sequences of warnings too.")
@format_option
def check(
    nets: tuple[str, ...],
    discipline: str,
    trace_dir: str | None,
    structure: bool,
    verbose: bool,
    format_: str,
    **limits: Any,
) -> int:
    """Check nets by exploring all their reachable markings, external gates free.

    Deadlock, contact, dead and live transitions, conflicts, gate races, commands, and the properties that the file
    itself states. Each verdict is proved, violated (with a shortest firing sequence) or unknown (with the bound
    reached); Ctrl-C ends the exploration and shows what is known so far.
    """
    allowed = budget(**limits)
    makers = [
        partial(_report, net, discipline, allowed, trace_dir, structure=structure, many=len(nets) > 1) for net in nets
    ]
    return answer_all("check", format_, makers, partial(_show, verbose=verbose))


def _report(
    argument: str, discipline: str, allowed: Budget, trace_dir: str | None, *, structure: bool, many: bool
) -> Report:
    from firable.analysis.check import check as check_net

    loaded = load_net(argument)
    net = loaded.net
    with loaded.placing():
        found = check_net(net, discipline, allowed)
    figures = found.figures.to_json()
    if structure:
        contacts = found.figures.contacts
        contact_free = None if contacts is None else not contacts
        # Anew, since the structure is wanted most where the exploration has used up its own time.
        figures["structure"] = structure_json(net, contact_free=contact_free, seconds=allowed.seconds)
    files: tuple[str, ...] = ()
    if trace_dir is not None:
        from pathlib import Path

        from firable.nets.bundle import file_stem

        folder = str(Path(trace_dir) / file_stem(argument)) if many else trace_dir
        files = write_folder(folder, _traces(found))
    return Report(
        "check",
        argument,
        net,
        found.verdicts,
        discipline=discipline,
        figures=figures,
        notes=loaded.notes,
        files=files,
    )


def _traces(found: CheckReport) -> dict[str, str]:
    """The trace of each violation that matters and has one; of a cycle, its first turn."""
    from firable.nets.bundle import file_stem
    from firable.nets.verdict import Status, Weight
    from firable.semantics.trace import Trace

    traces = {}
    for verdict in found.verdicts:
        if verdict.status is not Status.VIOLATED or verdict.weight is Weight.INFORMATION or verdict.witness is None:
            continue
        if firings := (*verdict.witness.firings, *verdict.witness.cycle):
            trace = Trace.of_firings(found.net, firings, found.discipline)
            traces[f"{file_stem(verdict.name)}.trace.jsonl"] = "".join(f"{line}\n" for line in trace.lines())
    return traces


def _show(report: Report, *, verbose: bool) -> None:
    for note in report.notes:
        text.show_diagnostic(note)
    text.heading(report.net, report.input)
    figures = report.figures
    words = {"interleaving": "interleaving", "step": "synchronous steps"}[report.discipline]
    whole = "" if figures["complete"] else " so far"
    click.echo(
        f"  {text.counted(figures['markings'], 'marking')}, {text.counted(figures['edges'], 'edge')}{whole}; "
        f"{words}, external gates free"
    )
    text.show_verdicts(report.net, report.verdicts, verbose=verbose)
    if "structure" in figures:
        click.echo(f"\n{click.style('structure', bold=True)}")
        for line in structure_lines(figures["structure"]):
            click.echo(f"  {line}")
    text.show_summary(report)
    for file in report.files:
        click.echo(f"  replay it: firable replay {file} --net {report.input}")
