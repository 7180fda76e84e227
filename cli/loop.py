"""`firable check NET --machines PLANT`: the verdicts on a cell with its machines, beside those with gates free.

The loop that is asked can be written as a net file: whatever else is to be known of it (queries, evidence, a replay,
the words of another technique) is then asked by the commands for nets, and no option has to be given twice.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from firable.cli import text
from firable.cli.evidence_files import is_evidence
from firable.cli.files import CATALOGUE, READ
from firable.cli.net_files import is_schema, schema_told, write_net
from firable.cli.options import catalogue_file, demand_bound, load_found, write_folder
from firable.cli.progress import progress_line
from firable.cli.report import Report

if TYPE_CHECKING:
    from collections.abc import Mapping

    from firable.analysis.loop.families import Answered
    from firable.analysis.loop.verdicts import Difference
    from firable.analysis.spaces.reachability import Budget
    from firable.nets.machines.plant_file import PlantModel
    from firable.nets.net import Net

_INNER: Final = ("property.loop.", "property.cell.")
"""How the parts of what is asked are called in the net of the loop, which has dozens of them for one verdict."""

machines_option = click.option(
    "--machines",
    metavar="PLANT",
    type=READ,
    help="Close the loop with the machines of a plant file, or of catalogue:NAME; see docs/machines.md.",
)


def read_machines(argument: str) -> PlantModel:
    """The plant that an argument names: a plant file, or `catalogue:NAME`; raises `InputError` as its reader does."""
    from firable.nets.machines.plant_file import parse_plant, read_plant

    file = _plant_file(argument)
    if argument.startswith(CATALOGUE):
        return parse_plant(Path(file).read_text("utf-8"), argument)
    return read_plant(file)


def read_machines_of(argument: str, net: Net) -> PlantModel:
    """The plant that an argument names, after it was found to be that of the net's cell."""
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.fitting import of_another_cell

    model = read_machines(argument)
    if problems := of_another_cell(model, net):
        raise InputError(problems)
    return model


def read_fitting(argument: str, net: Net) -> tuple[str, PlantModel]:
    """The plant that an argument names, with the text of its file, after it was found to fit the net."""
    from firable.nets.diagnostics import InputError
    from firable.nets.machines.fitting import misfits, of_another_cell
    from firable.nets.machines.plant_file import SIZE_BYTES_MAX, parse_plant
    from firable.nets.source import read_source

    source = read_source(_plant_file(argument), SIZE_BYTES_MAX)
    model = parse_plant(source.text, source.file)
    if problems := of_another_cell(model, net) or misfits(model, net):
        raise InputError(problems)
    return source.text, model


def _plant_file(argument: str) -> Path | str:
    if not argument.startswith(CATALOGUE):
        return argument
    path = catalogue_file(argument, "plant")
    if not path.exists():
        raise click.UsageError(f"'{argument}' is a net without machines")
    return path


def loop_report(
    argument: str,
    machines: str,
    allowed: Budget,
    loop_file: str | None,
    evidence_dir: str | None,
    *,
    bind: str | None,
    progress: bool | None,
) -> Report:
    """The report on one net with its machines; the evidence on each of its loops goes into a folder.

    What is asked, and how far exploring is, is told as `progress_line` does. One Ctrl-C ends all that is asked.
    """
    from threading import Event

    from firable.analysis.check import INTERRUPTED
    from firable.analysis.cures.finding import with_circle
    from firable.analysis.loop.faults import ask_faults
    from firable.analysis.loop.verdicts import check_loop
    from firable.nets.machines.fitting import late_limits
    from firable.nets.oversights import overseen
    from firable.nets.verdict import held_to

    loaded = load_found(argument)
    of_binding = demand_bound(bind, loaded.net)
    model = read_machines_of(machines, loaded.net)
    interrupted = Event()
    with progress_line(progress) as line:
        heard: dict[str, Any] = {} if line is None else {"begins": line.begins, "progress": line, "tell": line.say}
        with loaded.placing():
            report = check_loop(loaded.net, model, allowed, **heard, interrupted=interrupted)
        faults = ask_faults(report.asked, model, allowed, **heard, interrupted=interrupted)
    files: tuple[str, ...] = ()
    if loop_file is not None:
        files = write_net(loop_file, report.closed.net)
    if evidence_dir is not None:
        loops = {"loop": report.asked, "loop.failing": faults.for_good}
        files += write_folder(evidence_dir, _documents(loaded.net.name, loops, allowed))
    figures, course = report.closed.figures, report.closed.course
    if interrupted.is_set() and INTERRUPTED not in course:  # it came when something else was asked
        course += (INTERRUPTED,)
    with loaded.placing():
        told = (with_circle(loaded.net, verdict) for verdict in report.verdicts)
        verdicts = held_to(loaded.net.expected, (*told, *faults.verdicts()))
    return Report(
        "check",
        argument,
        loaded.net,
        verdicts,
        discipline="interleaving",
        notes=(*loaded.notes, *overseen(loaded), *of_binding, *late_limits(model, loaded.net)),
        course=course,
        files=files,
        binding=bind or "",
        loops=dict.fromkeys((verdict.name for verdict in report.verdicts), report.loop.net) | faults.nets,
        positions=loaded.positions,
        loop={
            "machines": machines,
            "markings": figures.markings,
            "edges": figures.edges,
            "complete": figures.complete,
            "places": len(report.loop.net.places),
            "transitions": len(report.loop.net.transitions),
            "markings_gates_free": report.opened.figures.markings,
            "complete_gates_free": report.opened.figures.complete,
            "comparison": [_compared(one) for one in report.differences],
            **({"faults_not_asked": f"fault.MACHINE is not asked of {unasked}"} if (unasked := faults.unasked) else {}),
        },
    )


def _documents(net: str, loops: Mapping[str, Answered | None], allowed: Budget) -> dict[str, bytes]:
    """The document on each loop that was asked, by the name of its file."""
    from firable.cli.evidence_files import evidence_file, evidence_limits

    asked = ((kind, one) for kind, one in loops.items() if one is not None)
    return dict(evidence_file(net, one.document(evidence_limits(allowed)), kind) for kind, one in asked)


def _compared(one: Difference) -> dict[str, str]:
    data = {"question": one.question, "gates_free": str(one.gates_free), "with_machines": str(one.with_machines)}
    return data | ({"remark": one.remark} if one.remark else {})


def show_binding(report: Report) -> None:
    """Print which binding was found to fit the net, if one was asked about."""
    if report.binding:
        from firable.nets.source import printable

        click.echo(f"  {printable(report.binding)} binds each signal and command")


def show_loop(report: Report, *, verbose: bool) -> None:
    """Print the report on a net with its machines."""
    text.show_diagnostics(report.notes)
    loop = report.loop
    click.echo(f"{click.style(report.net.name, bold=True)}  {click.style(report.input, dim=True)}")
    click.echo(f"  with its machines: {loop['machines']}")
    show_binding(report)
    counts = [(loop["places"], "place"), (loop["transitions"], "transition"), (loop["markings"], "marking")]
    edges = "edges not counted" if loop["edges"] is None else text.counted(loop["edges"], "edge")
    whole, whole_free = ("" if loop[which] else " so far" for which in ("complete", "complete_gates_free"))
    click.echo(f"  the loop has {', '.join(text.counted(n, word) for n, word in counts)} and {edges}{whole}")
    click.echo(f"  {text.counted(loop['markings_gates_free'], 'marking')} with gates free{whole_free}")
    if verbose or len(report.course) > 1:
        told = [line for line in report.course if verbose or not line.startswith(_INNER)]
        for line in told:
            click.echo(f"  {line}")
        if left_out := len(report.course) - len(told):
            click.echo(f"  asked one by one: {text.counted(left_out, 'question')} about the loop; -v tells of each")
    rows = loop["comparison"]
    width = max((len(row["question"]) for row in rows), default=12)
    click.echo(f"\n{click.style('side by side', bold=True)}{' ' * (width - 6)}gates free  with its machines")
    for row in rows:
        differs = row["gates_free"] != row["with_machines"]
        line = f"  {row['question']:<{width}}    {row['gates_free']:<10}  {row['with_machines']:<10}"
        click.echo(click.style(line.rstrip(), fg="yellow" if differs else None))
        if "remark" in row:
            click.echo(f"      {row['remark']}")
    text.show_verdicts(report.net, report.verdicts, verbose=verbose, loops=report.loops)
    if "faults_not_asked" in loop:
        click.echo(f"\n{loop['faults_not_asked']}")
    text.show_summary(report)
    for file in report.files:
        if is_schema(file):
            click.echo(f"  {schema_told(file)}")
        else:
            name = str(Path(file))
            verified = f"evidence: firable verify {shlex.quote(name)}"
            click.echo(f"  {verified if is_evidence(file) else f'the loop as a net file: {name}'}")
