"""`firable refine`: open the tasks of a conceptual net, and carry over what was proved of it."""

from __future__ import annotations

import shlex
from textwrap import indent
from typing import TYPE_CHECKING

import click

from firable.cli import text
from firable.cli.files import FOLDER, READ, WRITTEN_NET
from firable.cli.net_files import demand_a_net_file, is_schema, schema_told, write_net
from firable.cli.options import (
    analysis_options,
    answer,
    budget,
    formats_option,
    load_net,
    net_argument,
    page_option,
    with_page,
    write_folder,
)
from firable.cli.report import Report

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from firable.analysis.goal import Limits
    from firable.analysis.spaces.reachability import Budget
    from firable.decompose.refinement.binding import Binding
    from firable.decompose.refinement.closed import BlockProof
    from firable.decompose.refinement.refining import Refinement
    from firable.nets.decomposition import Coordinated
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.net import Net
    from firable.nets.tasks.model import Catalogue
    from firable.nets.verdict import Verdict

_METHODS = ("exploration of the task, closed", "the arcs and gates of the conceptual net")
"""What conditions are decided by."""


tasks_option = click.option(
    "--tasks",
    "files",
    metavar="FILE",
    type=READ,
    multiple=True,
    help="A file of registered tasks (*.tasks.yaml); may be given again. They come before those of the catalogue.",
)


@click.command(short_help="Open the tasks of a conceptual net to a detailed net, and carry over its verdicts.")
@net_argument
@tasks_option
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=WRITTEN_NET,
    help="Write the detailed net there, as a net file (*.firable.yaml).",
)
@click.option("--cell", metavar="NAME", default="", help="The name of the detailed net; by default that of NET.")
@click.option(
    "--confirm/--no-confirm",
    default=None,
    help="Compare both nets by exploring them, whatever their size or not at all; by default where they are small.",
)
@click.option(
    "--evidence",
    "evidence_dir",
    metavar="DIR",
    type=FOLDER,
    help="Write what shows the conditions of each task, the verdicts on NET and, where that is small, those on the "
    "detailed net, for `firable verify`.",
)
@analysis_options
@page_option
@formats_option
def refine(
    net: str,
    files: tuple[str, ...],
    output: str | None,
    cell: str,
    confirm: bool | None,
    evidence_dir: str | None,
    max_markings: int,
    max_memory: int,
    max_seconds: float | None,
    page: str | None,
    format_: str,
) -> int:
    """Open every place of NET that names a registered task to the steps of that task.

    Each task is checked alone, with nothing around it: that it always can end, leaves nothing behind and has no
    contact. What is proved of NET then holds of the detailed net too, which is not explored for it. A task that
    violates a condition is refused, with a firing sequence in its own names. `firable bundle DETAILED --conceptual NET`
    puts all this into the bundle, for `firable verify` to show again.
    """
    demand_a_net_file(output)
    most = budget(max_markings, max_memory, max_seconds)
    make = with_page(lambda: _report(net, files, output, cell, confirm, most, evidence_dir), page)
    return answer("refine", format_, make, _show)


def _report(
    argument: str,
    files: tuple[str, ...],
    output: str | None,
    cell: str,
    confirm: bool | None,
    most: Budget,
    evidence_dir: str | None,
) -> Report:
    from firable.analysis.check import check
    from firable.decompose.refinement.binding import opened_by
    from firable.decompose.refinement.carrying import carried, not_carried
    from firable.decompose.refinement.evidence import refinement_evidence
    from firable.decompose.refinement.refining import proved_tasks
    from firable.decompose.refinement.refining import refine as refine_net

    loaded = load_net(argument)
    catalogue = read_catalogue(files)
    with loaded.placing():
        blocks = proved_tasks(loaded.net, catalogue)
        unsound = next((block for block in blocks if not block.sound), None)
        if unsound is not None:
            return _refused(argument, unsound, blocks, opened_by(loaded.net, catalogue))
        refinement = refine_net(loaded.net, catalogue, cell)
    report = check(loaded.net, budget=most)
    verdicts: Sequence[Verdict] = [
        *refinement.conditions,
        _contact_free(report.verdict("contact-free")),
        *carried(refinement.correspondence, blocks, report),
        *_confirmed(refinement, report.verdict("contact-free"), confirm, most),
    ]
    table, more = _table(refinement.net)
    written: tuple[str, ...] = ()
    if evidence_dir is not None:
        detailed = None if confirm is False else refinement.net
        verdicts, documents = refinement_evidence(blocks, report, verdicts, _limits(most), detailed=detailed)
        written = write_folder(evidence_dir, documents)
    if output is not None:
        written = (*write_net(output, refinement.net), *written)
    return Report(
        "refine",
        argument,
        refinement.net,
        tuple(verdicts),
        discipline="interleaving",
        course=(*_told(refinement), f"of the detailed net alone, `firable check` decides: {not_carried()}"),
        notes=(*loaded.notes, *refinement.notes, *loaded.placed(more)),
        table=table,
        files=written,
    )


def _limits(most: Budget) -> Limits:
    """How long evidence is looked for, in all documents together: as long as the verdicts, or 30 seconds."""
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits

    return Limits(Deadline.after(30.0 if most.seconds is None else most.seconds), most.memory_bytes)


def read_catalogue(files: tuple[str, ...]) -> Catalogue:
    """The tasks of these files and of the catalogue."""
    from firable.nets.catalogue import catalogue_tasks
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.tasks.text import read_tasks

    own: dict[str, str] = {}
    tasks = dict(catalogue_tasks())
    for file in files:
        for name, task in read_tasks(file).items():
            if (other := own.setdefault(name, file)) != file:
                message = f"the task '{name}' stands in '{other}' and in '{file}'"
                raise InputError([Diagnostic("F2001", message, "rename one of them", span=task.span)])
            tasks[name] = task
    return tasks


def _refused(argument: str, block: BlockProof, blocks: Sequence[BlockProof], bound: Mapping[str, Binding]) -> Report:
    """The report on a task that may not stand for a place: its net alone, in words, and what it violates."""
    from firable.decompose.refinement.traces import readable

    name = block.task.name
    too = [f"'{other.task.name}'" for other in blocks if other is not block and not other.sound]
    course = (
        f"the task '{name}' is refused: it cannot stand for a place",
        *(f"{path} names it, with {_roles(binding)}" for path, binding in bound.items() if binding.task.name == name),
        *([f"refused too, and told when this is mended: {', '.join(too)}"] if too else []),
        "nothing was opened or written",
    )
    return Report("refine", argument, readable(block.net), block.verdicts, discipline="interleaving", course=course)


def _contact_free(of: Verdict) -> Verdict:
    """What the theorem asks of the conceptual net. Its witness has the names of that net, which are not at hand."""
    from dataclasses import replace

    hint = "" if of.holds else "the theorem asks it; `firable check` of the conceptual net shows where"
    statement = f"in the conceptual net {of.statement}"
    return replace(of, name="conceptual.contact-free", statement=statement, witness=None, subjects=(), hint=hint)


def _confirmed(refinement: Refinement, contact_free: Verdict, confirm: bool | None, most: Budget) -> list[Verdict]:
    from firable.decompose.refinement.confirming import confirmed

    if confirm is False:
        return []
    return list(
        confirmed(
            refinement.correspondence,
            contact_free=contact_free.holds,
            settles=refinement.settles,
            budget=most if confirm else None,
        )
    )


def _table(net: Net) -> tuple[tuple[Coordinated, ...], tuple[Diagnostic, ...]]:
    """The coordinator table of a net; where it cannot be split, nothing, and why: no bundle can be made of it."""
    from dataclasses import replace

    from firable.decompose.splitting.cut import split
    from firable.nets.diagnostics import InputError, Severity

    try:
        return split(net).table, ()
    except InputError as error:
        why = (
            replace(one, message=f"no bundle can be made of the detailed net: {one.message}")
            for one in error.diagnostics
        )
        return (), tuple(replace(one, severity=Severity.WARNING, span=None) for one in why)


def _told(refinement: Refinement) -> list[str]:
    """What was opened, a line for each place that names a task, subtasks with the path that leads to them."""
    lines = []
    for path, binding in refinement.bound.items():
        task = binding.task
        early = f", {' and '.join(sorted(task.released))} released inside" if task.released else ""
        size = f"{text.counted(len(task.steps), 'step')}, {text.counted(len(task.moves), 'move')}"
        lines.append(f"{path} is opened by {task.name} ({_roles(binding)}): {size}{early}")
    return lines


def _roles(binding: Binding) -> str:
    """Who fills which role."""
    return ", ".join(f"{role} {resource.rpartition('.')[2]}" for role, resource in binding.resources.items())


def show_conditions(verdicts: Sequence[Verdict]) -> set[str]:
    """Print the conditions of each task on one line, and which places are opened as they must; returns what is told.

    What is violated or unknown is left to be told in full.
    """
    lines: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        if verdict.method in _METHODS:
            lines.setdefault(verdict.name.partition(".")[0], []).append(verdict)
    told = set[str]()
    width = max(map(len, lines), default=0)
    for subject, some in lines.items():
        proved = [verdict for verdict in some if verdict.holds]
        required = [verdict for verdict in some if verdict.weight.value == "required"]
        symbol, colour = ("✓", "green") if all(verdict.holds for verdict in required) else ("✗", "red")
        words = ", ".join(verdict.name.partition(".")[2] for verdict in proved)
        if missing := [verdict.name.partition(".")[2] for verdict in some if not verdict.holds]:
            words += f"{'; ' if words else ''}not {', '.join(missing)}"
        click.echo(f"  {click.style(symbol, fg=colour)} {subject:<{width}}  {words}")
        told |= {verdict.name for verdict in some if verdict.holds or verdict.weight.value == "information"}
    return told


def _show(report: Report) -> None:
    from firable.decompose.splitting.table import table_text

    for note in report.notes:
        text.show_diagnostic(note)
    text.heading(report.net, report.input)
    click.echo(f"\n{click.style('tasks', bold=True)}")
    for line in report.course:
        click.echo(f"  {line}")
    if report.table:
        click.echo(f"\n{click.style('coordinator table', bold=True)}")
        click.echo(indent(table_text(report.table), "  "), nl=False)
    click.echo(f"\n{click.style('conditions', bold=True)}")
    shown = show_conditions(report.verdicts)
    text.show_verdicts(report.net, [verdict for verdict in report.verdicts if verdict.name not in shown])
    text.show_summary(report)
    for file in report.files:
        if file.endswith((".evidence.json", ".evidence.json.gz")):
            click.echo(f"  evidence: firable verify {shlex.quote(file)}")
        elif is_schema(file):
            click.echo(f"  {schema_told(file)}")
        else:
            click.echo(f"  the detailed net is in {file}")
