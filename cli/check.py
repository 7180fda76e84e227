"""`firable check`: everything that is asked of a net, decided by whichever technique can."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from firable.analysis.methods import Method
from firable.cli import text
from firable.cli.choice import OneOf
from firable.cli.evidence_files import is_evidence
from firable.cli.files import FOLDER, NETS, READ, WRITTEN_NET, net_files
from firable.cli.loop import loop_report, machines_option, show_binding, show_loop
from firable.cli.net_files import demand_a_net_file
from firable.cli.options import (
    analysis_options,
    answer_all,
    budget,
    demand_bound,
    formats_option,
    is_given,
    load_found,
    page_option,
    with_page,
    write_folder,
)
from firable.cli.report import Report
from firable.cli.structure import structure_json, structure_lines
from firable.cli.terminated import terminated_as_by_ctrl_c

if TYPE_CHECKING:
    from firable.analysis.report import CheckReport
    from firable.analysis.spaces.reachability import Budget
    from firable.cli.cache import Kept
    from firable.nets.loading import Loaded
    from firable.nets.net import Net
    from firable.nets.queries import Query
    from firable.nets.verdict import Verdict


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the options ask for."""

    discipline: str
    method: str
    budget: Budget
    trace_dir: str | None
    structure: bool
    cached: bool
    query_file: str | None
    query_texts: tuple[str, ...]
    progress: bool | None

    def of_the_net(self, queries: Iterable[Query]) -> dict[str, Any]:
        """What the answer depends on besides the net, as JSON values."""
        from firable.nets.queries import format_query

        allowed = (self.budget.markings, self.budget.memory_bytes, self.budget.seconds)
        return {
            "discipline": self.discipline,
            "method": self.method,
            "structure": self.structure,
            "budget": allowed,
            "queries": [(query.name, format_query(query)) for query in queries],
        }


@click.command(short_help="Check nets: deadlock, contact, liveness, conflicts, their own properties.")
@click.argument("nets", metavar="NET...", type=NETS, nargs=-1, required=True)
@click.option(
    "--discipline",
    type=OneOf(["interleaving", "step"]),
    default="interleaving",
    show_default=True,
    help="One transition at a time, or all enabled ones of a scan together.",
)
@click.option(
    "--method",
    type=OneOf([str(method) for method in Method]),
    default=str(Method.AUTO),
    show_default=True,
    help="Let one technique answer; `auto` lets them race where exploring a moment does not suffice. One that is "
    "asked question by question has a minute for each, and `bounded` looks 50 steps ahead, or whatever --max-seconds "
    "allows.",
)
@analysis_options
@click.option(
    "--trace-dir",
    metavar="DIR",
    type=FOLDER,
    help="Write the firing sequence of each violation, for `firable replay`.",
)
@click.option(
    "--evidence",
    "evidence_dir",
    metavar="DIR",
    type=FOLDER,
    help="Write evidence of what is decided, for `firable verify`; takes at most --max-seconds more, or 30.",
)
@click.option(
    "--structure", is_flag=True, help="Also net class, invariants, siphons, traps; in --max-seconds more, or 30."
)
@click.option(
    "--queries", "query_file", metavar="FILE", type=READ, help="Answer the queries of a file, text or property XML."
)
@click.option(
    "--query", "query_texts", metavar="QUERY", multiple=True, help="Answer a query, such as 'AG EF start'; repeatable."
)
@machines_option
@click.option(
    "--loop-net",
    "loop_file",
    metavar="FILE",
    type=WRITTEN_NET,
    help="Write the net that NET and its --machines are together, as a net file (*.firable.yaml).",
)
@click.option(
    "--bind",
    metavar="BIND",
    type=READ,
    help="Also demand of a binding that it fits NET: each signal and command is bound, and nothing else.",
)
@page_option
@click.option(
    "--no-cache",
    is_flag=True,
    help="Decide anew what was decided before of the same net. Answers are kept in the cache folder of the user, or in "
    "the one that the environment variable FIRABLE_CACHE names; where it is empty, nowhere.",
)
@click.option(
    "--progress/--no-progress",
    default=None,
    help="Tell on standard error how far exploring is.  [default: on a terminal; once a minute where there is none]",
)
@click.option("-v", "--verbose", is_flag=True, help="Tell methods, costs and the sequences of warnings too.")
@formats_option
@terminated_as_by_ctrl_c()
def check(
    nets: tuple[str, ...],
    discipline: str,
    method: str,
    trace_dir: str | None,
    evidence_dir: str | None,
    structure: bool,
    query_file: str | None,
    query_texts: tuple[str, ...],
    machines: str | None,
    loop_file: str | None,
    bind: str | None,
    page: str | None,
    no_cache: bool,
    progress: bool | None,
    verbose: bool,
    format_: str,
    **limits: Any,
) -> int:
    """Check nets, external gates free, by exploring their markings or by whichever other technique is first.

    Deadlock, contact, dead and live transitions, conflicts, gate races, commands, the properties that the file itself
    states, and queries in CTL, LTL and more (docs/queries.md). Each verdict is proved, violated (with a firing
    sequence, a shortest one where exploring found it) or unknown (with the bound reached); Ctrl-C or SIGTERM ends the
    search and shows what is known so far. A folder stands for the net files (*.firable.yaml) below it, but for those in
    hidden folders and of what is installed there (virtual environments, node_modules).

    With --machines the external gates are no longer free: they open as the machines of the plant allow. What differs
    is shown side by side, and what a fault of each machine leads to.
    """
    allowed = budget(**limits)
    nets = net_files(nets)
    if page is not None and len(nets) > 1:
        raise click.UsageError("--report is a page on one net: name one NET")
    if bind is not None and len(nets) > 1:
        raise click.UsageError("--bind is a binding of one net: name one NET")
    if machines is not None:
        _refuse_beside_machines()
        many = len(nets) > 1
        closed = []
        for net in nets:
            folder = None if evidence_dir is None else _folder(evidence_dir, net, many=many)
            make = partial(loop_report, net, machines, allowed, loop_file, folder, bind=bind, progress=progress)
            closed.append(with_page(make, page))
        return answer_all("check", format_, closed, partial(show_loop, verbose=verbose))
    if loop_file is not None:
        raise click.UsageError("--loop-net goes with --machines")
    asked = _Asked(discipline, method, allowed, trace_dir, structure, not no_cache, query_file, query_texts, progress)
    many = len(nets) > 1
    makers = [with_page(partial(_report, net, asked, evidence_dir, bind=bind, many=many), page) for net in nets]
    return answer_all("check", format_, makers, partial(_show, verbose=verbose))


def _refuse_beside_machines() -> None:
    """Refuse what is asked of a net and not of a loop: the loop is a net, once it is written."""
    context = click.get_current_context()
    alone = ("discipline", "method", "trace_dir", "structure", "query_file", "query_texts")
    if given := [name for name in alone if is_given(name)]:
        option = {"query_texts": "query", "query_file": "queries"}.get(given[0], given[0])
        message = f"--{option.replace('_', '-')} does not go with --machines: write the loop by --loop-net FILE, "
        raise click.UsageError(f"{message}and check that file")
    if len(context.params["nets"]) > 1 and context.params["loop_file"] is not None:
        raise click.UsageError("--loop-net holds one loop: name one NET")
    demand_a_net_file(context.params["loop_file"])


def _report(argument: str, asked: _Asked, evidence_dir: str | None, *, bind: str | None, many: bool) -> Report:
    from firable.cli.cache import key_of, opened_cache
    from firable.nets.oversights import overseen
    from firable.nets.verdict import held_to

    loaded = load_found(argument)
    net = loaded.net
    of_binding = demand_bound(bind, net)
    queries = _queries(loaded, asked)
    cache = opened_cache() if asked.cached else None
    key = key_of(net, asked.of_the_net(queries)) if cache is not None else ""
    # Evidence comes from the run that decides, which a cache does not keep.
    kept = cache.read(key) if cache is not None and evidence_dir is None else None
    again = kept is not None
    documents: dict[str, bytes] = {}
    if kept is None:
        with loaded.placing():
            found, kept = _found(net, asked, queries)
            if evidence_dir is not None:
                documents = _evidence(found, queries, asked)
        if cache is not None:
            cache.write(key, kept)
    files: tuple[str, ...] = ()
    if asked.trace_dir is not None:
        folder = _folder(asked.trace_dir, argument, many=many)
        files = write_folder(folder, _traces(net, kept.verdicts, asked.discipline))
    if evidence_dir is not None:
        files += write_folder(_folder(evidence_dir, argument, many=many), documents)
    with loaded.placing():
        verdicts = held_to(net.expected, kept.verdicts)
    return Report(
        "check",
        argument,
        net,
        verdicts,
        discipline=asked.discipline,
        figures=kept.figures,
        course=kept.course,
        notes=(*loaded.notes, *overseen(loaded), *of_binding),
        files=files,
        binding=bind or "",
        again=again,
        positions=loaded.positions,
    )


def _folder(named: str, argument: str, *, many: bool) -> str:
    """The folder named, or of many nets one in it for each."""
    from pathlib import Path

    from firable.nets.bundle import file_stem

    return str(Path(named) / file_stem(argument)) if many else named


def _queries(loaded: Loaded, asked: _Asked) -> tuple[Query, ...]:
    """The queries of the file, and those that are arguments, under the names query-1, query-2, ..."""
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.queries import query_named, read_queries

    found = () if asked.query_file is None else read_queries(asked.query_file, loaded.net, loaded.renamed)
    single = tuple(query_named(text, loaded.net, f"query-{n}") for n, text in enumerate(asked.query_texts, 1))
    if both := {query.name for query in found} & {query.name for query in single}:
        message = f"'{min(both)}' names a query of the file and is the name of a --query"
        raise InputError([Diagnostic("F2001", message, "rename the one in the file")])
    return found + single


def _found(net: Net, asked: _Asked, queries: Sequence[Query]) -> tuple[CheckReport, Kept]:
    """What the techniques find of a net, and what is kept of it."""
    from firable.analysis.check import check as check_net
    from firable.analysis.cures.finding import explained
    from firable.cli.cache import Kept
    from firable.cli.progress import progress_line
    from firable.nets.verdict import Status

    with progress_line(asked.progress) as line:
        found = check_net(
            net,
            asked.discipline,
            asked.budget,
            method=asked.method,
            queries=queries,
            progress=line,
            tell=None if line is None else line.say,
        )
    figures = found.figures.to_json()
    if asked.structure:
        status = found.verdict("contact-free").status
        contact_free = {Status.PROVED: True, Status.VIOLATED: False}.get(status)
        # Anew, since the structure is wanted most where the exploration has used up its own time.
        figures["structure"] = structure_json(
            net, contact_free=contact_free, seconds=asked.budget.seconds, discipline=asked.discipline
        )
    return found, Kept(explained(found, queries), figures, found.course)


def _traces(net: Net, verdicts: Iterable[Verdict], discipline: str) -> dict[str, str]:
    """The trace of each violation that matters and has one; of a cycle, its first turn."""
    from firable.nets.bundle import file_stem
    from firable.nets.verdict import Status, Weight
    from firable.semantics.trace import Discipline, Trace

    traces = {}
    for verdict in verdicts:
        if verdict.status is not Status.VIOLATED or verdict.weight is Weight.INFORMATION or verdict.witness is None:
            continue
        if firings := (*verdict.witness.firings, *verdict.witness.cycle):
            trace = Trace.of_firings(net, firings, Discipline(discipline))
            traces[f"{file_stem(verdict.name)}.trace.jsonl"] = "".join(f"{line}\n" for line in trace.lines())
    return traces


def _evidence(found: CheckReport, queries: Sequence[Query], asked: _Asked) -> dict[str, bytes]:
    """The document of evidence on all that was decided, by the name of its file."""
    from firable.analysis.evidence.producing.producer import evidence_of_report
    from firable.cli.evidence_files import evidence_file, evidence_limits

    document = evidence_of_report(found, queries, evidence_limits(asked.budget))
    return dict([evidence_file(found.net.name, document)])


def _show(report: Report, *, verbose: bool) -> None:
    text.show_diagnostics(report.notes)
    text.heading(report.net, report.input)
    figures = report.figures
    words = {"interleaving": "interleaving", "step": "synchronous steps"}[report.discipline]
    whole = "" if figures["complete"] else " so far"
    edges = "edges not counted" if figures["edges"] is None else text.counted(figures["edges"], "edge")
    click.echo(f"  {text.counted(figures['markings'], 'marking')}, {edges}{whole}; {words}, external gates free")
    show_binding(report)
    if verbose or len(report.course) > 1:
        for line in (*report.course, *(["taken from the cache: this net was checked before"] if report.again else [])):
            click.echo(f"  {line}")
    text.show_verdicts(report.net, report.verdicts, verbose=verbose)
    if "structure" in figures:
        click.echo(f"\n{click.style('structure', bold=True)}")
        for line in structure_lines(figures["structure"]):
            click.echo(f"  {line}")
    text.show_summary(report)
    documents = [file for file in report.files if is_evidence(file)]
    for file in report.files:
        if file not in documents:
            click.echo(f"  replay it: firable replay {shlex.quote(file)} --net {shlex.quote(report.input)}")
    for file in documents:
        click.echo(f"  evidence: firable verify {shlex.quote(file)}")
