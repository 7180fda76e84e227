"""`firable prove`: split a net over its controllers and prove that the parts together are the whole."""

from __future__ import annotations

import shlex
from dataclasses import replace
from textwrap import indent
from typing import TYPE_CHECKING, Final

import click

from firable.cli import text
from firable.cli.files import FOLDER
from firable.cli.finite import FiniteRange
from firable.cli.loop import machines_option, read_machines_of
from firable.cli.options import answer, formats_option, load_net, net_argument, page_option, with_page, write_folder
from firable.cli.progress import stages
from firable.cli.protocol import Answered, Asked, ask, protocol_options
from firable.cli.protocol import show as show_protocol
from firable.cli.report import Report
from firable.cli.terminated import terminated_as_by_ctrl_c
from firable.cli.votes import Votes, is_vote, votes_told

if TYPE_CHECKING:
    from collections.abc import Sequence

    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

SIGNS: Final = {"violated": ("✗", "red"), "unknown": ("?", "yellow"), "proved": ("✓", "green")}
"""The sign and colour of several verdicts of which the first of these statuses is there."""


@click.command(short_help="Split a net over its controllers, and prove the parts equal to the whole.")
@net_argument
@click.option(
    "--smt-dir", metavar="DIR", type=FOLDER, help="Write the obligations as SMT-LIB 2 files, for another solver."
)
@click.option(
    "--timeout",
    type=FiniteRange(min=0.001),
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Give up an obligation after so much time, and each exploration of the protocol or of --machines.",
)
@machines_option
@protocol_options
@page_option
@formats_option
@terminated_as_by_ctrl_c()
def prove(
    net: str,
    smt_dir: str | None,
    timeout: float,
    machines: str | None,
    protocol: bool,
    faults: bool,
    wrong: bool,
    page: str | None,
    format_: str,
) -> int:
    """Split NET by ownership, print the coordinator table, and discharge every obligation with z3.

    Eq. (7) and (8) for every transition, (9)-(10) for every place, one decider for all that compete (O2), no gate read
    from a copy (O3), ownership, initial marking, commands, and that the arbiters together choose as the central one
    does. Of each of O1-O9 it is told whether it is proved, and where, or assumed. A violated obligation shows the
    values of the net's own names that refute it. With --machines the gates that a vote relies on (O4) are asked of the
    loop that the plant closes, instead of being assumed. With --protocol the voting protocol of the split is explored
    as a net of its own, with --faults under faults too, and with --wrong the protocols known to be wrong are tried.
    Ctrl-C or SIGTERM ends what is being done and shows what is known so far.
    """
    asked, answered = Asked(protocol, faults, wrong), list[Answered]()
    make = with_page(lambda: _report(net, smt_dir, timeout, machines, asked, answered), page)
    return answer("prove", format_, make, lambda report: _show(report, answered))


def show_obligations(verdicts: Sequence[Verdict]) -> None:
    """Print how many obligations of each family are proved."""
    from firable.decompose.proofs.families import REPORTED
    from firable.decompose.proofs.family import proved_of

    of_each = [(family, proved_of(family, verdicts)) for family in REPORTED]
    width = max(3, *(len(str(len(some))) for _, some in of_each))
    for family, some in of_each:
        if not some:
            continue
        proved = sum(verdict.holds for verdict in some)
        statuses = {verdict.status.value for verdict in some}
        symbol, colour = next(sign for status, sign in SIGNS.items() if status in statuses)
        count = f"{proved:>{width}} of {len(some):<{width}}"
        click.echo(f"  {click.style(symbol, fg=colour)} {count} {family.title:<16} {family.says}")


def _report(
    argument: str, smt_dir: str | None, timeout: float, machines: str | None, asked: Asked, answered: list[Answered]
) -> Report:
    from firable.decompose.proofs.assumptions import assumptions
    from firable.decompose.proofs.proving import prove as prove_split
    from firable.decompose.proofs.standing import standing
    from firable.decompose.protocol.parametric.side_conditions import side_conditions
    from firable.decompose.splitting.cut import split
    from firable.nets.blocked_timeouts import blocked_timeouts

    loaded = load_net(argument)
    with loaded.placing():
        decomposition = split(loaded.net)
    notes = (*loaded.notes, *loaded.placed(blocked_timeouts(decomposition)))
    with stages() as begins:
        found = prove_split(decomposition, timeout_ms=max(1, round(timeout * 1000)), begins=begins)
    verdicts = (*found.verdicts, *side_conditions(decomposition))
    loops: dict[str, Net] = {}
    evidence = dict[str, str | bytes](found.files)
    if machines is not None:
        from firable.analysis.spaces.reachability import Budget
        from firable.decompose.proofs.held_gates import held_gates
        from firable.nets.machines.fitting import late_limits

        model = read_machines_of(machines, loaded.net)
        held = held_gates(decomposition, model, Budget(seconds=timeout))
        notes += late_limits(model, loaded.net)
        loops = dict.fromkeys((verdict.name for verdict in held.verdicts), held.loop.net)
        verdicts += held.verdicts
        if smt_dir is not None:
            evidence |= held.evidence()
    told = Answered()
    if asked:
        with stages() as begins:
            told = ask(decomposition, asked, timeout, evidence=smt_dir is not None, begins=begins)
        answered[:] = [told]
        verdicts += told.verdicts
        evidence |= told.files
    files = write_folder(smt_dir, evidence) if smt_dir is not None else ()
    return Report(
        "prove",
        argument,
        loaded.net,
        verdicts,
        notes=notes,
        table=decomposition.table,
        assumptions=tuple(map(str, assumptions(decomposition))),
        standing=tuple(standing(decomposition, verdicts)),
        decomposition=replace(decomposition, free=told.free or ()),
        loops=loops,
        positions=loaded.positions,
        protocols=told.protocols,
        outages=told.outages,
        faults=told.faults,
        refutations=told.refutations,
        files=files,
    )


def _show(report: Report, answered: Sequence[Answered]) -> None:
    from firable.decompose.splitting.table import table_text

    for note in report.notes:
        text.show_diagnostic(note)
    text.heading(report.net, report.input)
    click.echo(f"\n{click.style('coordinator table', bold=True)}")
    click.echo(indent(table_text(report.table), "  "), nl=False)
    if not report.table:
        click.echo("  no transition has more than one participant")
    click.echo(f"\n{click.style('obligations', bold=True)}")
    show_obligations(report.verdicts)
    _show_votes(report, next((one.free for one in answered), None))
    click.echo(f"\n{click.style('what the running system needs', bold=True)}")
    for line in report.standing:
        click.echo(f"  {line.name}  {line.says}")
        click.echo(f"      {line.status}: {line.by}")
    if report.assumptions or report.loops:
        _show_assumptions(report)
    for one in answered:
        show_protocol(one)
    refuted = [verdict for verdict in report.verdicts if not verdict.holds]
    told = [verdict for verdict in refuted if is_vote(verdict) or verdict.name.startswith("wrong.")]  # above
    refuted = [verdict for verdict in refuted if verdict not in told]
    nets = (report.net, *report.loops.values(), *(of.net for of in report.protocols.values()))
    for net in {id(net): net for net in nets}.values():
        if some := [verdict for verdict in refuted if report.net_of(verdict) is net]:
            text.show_verdicts(net, some)
    text.show_summary(report)
    if report.files:
        from pathlib import Path

        documents = [file for file in report.files if ".evidence.json" in file]
        click.echo(f"  {len(report.files) - len(documents)} SMT-LIB 2 files in {Path(report.files[0]).parent}")
        for file in documents:
            click.echo(f"  evidence: firable verify {shlex.quote(file)}")


def _show_votes(report: Report, free: Sequence[tuple[str, str]] | None) -> None:
    """Which votes stand, and how many of the parts are `free` of promise, where that was asked."""
    if lines := list(votes_told(Votes.of(report), None if free is None else len(free))):
        click.echo(f"\n{click.style('votes', bold=True)}")
        for line in lines:
            click.echo(f"  {line}")


def _show_assumptions(report: Report) -> None:
    """What is assumed of the cell, or where its machines were given what became of it."""
    asked = [verdict for verdict in report.verdicts if verdict.name.startswith("o4.")]
    if asked:
        click.echo(f"\n{click.style('asked of the cell with its machines', bold=True)}")
        for verdict in asked:
            click.echo(text.verdict_line(verdict, max(len(one.name) for one in asked)))
        return
    click.echo(f"\n{click.style('assumed of the cell', bold=True)}")
    for assumption in report.assumptions:
        click.echo(f"  {assumption} [O4]")
