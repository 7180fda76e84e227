"""`firable takeover`: let a new bundle go on where an old one has stopped."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from firable.cli.options import analysis_options, budget, refuse_a_net

if TYPE_CHECKING:
    from firable.analysis.spaces.reachability import Budget
    from firable.nets.net import Net
    from firable.nets.verdict import Verdict

_ASKED = "taken-over"


@click.command(short_help="Let a new bundle go on where an old one has stopped.")
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option("--journal", metavar="FILE", required=True, help="The journal of the run of OLD, which has stopped.")
@click.option("--into", metavar="FILE", required=True, help="Where to write the journal for the run of NEW.")
@analysis_options
def takeover(
    old: str, new: str, journal: str, into: str, max_markings: int, max_memory: int, max_seconds: float | None
) -> int:
    """Take the marking of a stopped cell over from bundle OLD to bundle NEW, by the names of its places.

    It is done only in a marking that NEW can reach, because NEW was proved for those alone; with no vote open, and with
    the same command in every place that has a token. The journal of OLD is left as it is. `firable run NEW --journal`
    then goes on: held, until the machines are asked where they are and the operator resumes.
    """
    from firable.executor.journal.journal import sync_now
    from firable.executor.journal.sqlite_journal import SqliteJournal
    from firable.executor.journal.takeover import take_over
    from firable.executor.operating.running import load
    from firable.executor.protocol.deciders import coordinators
    from firable.executor.protocol.messages import Keep
    from firable.nets.bundle import read_bundle

    for bundle in (old, new):
        refuse_a_net(bundle, "a cell is taken over from bundle to bundle")
    before, after = read_bundle(old), load(new)
    _refuse_missing(journal)
    _refuse_standing(into)
    machines = [*coordinators(before.decomposition), *(subnet.name for subnet in before.decomposition.subnets)]
    read = SqliteJournal(journal, before.digest, machines)
    try:
        kept = {machine: dict(read.kept(machine)) for machine in machines}
    finally:
        read.close()
    moved = take_over(before.decomposition, after.decomposition, kept, coordinators(after.decomposition))
    _demand_reachable(after.net, moved.marking, budget(max_markings, max_memory, max_seconds))
    names = [*coordinators(after.decomposition), *(subnet.name for subnet in after.decomposition.subnets)]
    written = SqliteJournal(into, after.digest, names)
    try:
        for machine, of in moved.kept.items():
            written.write(machine, [Keep(key, value) for key, value in of.items()])
        sync_now(written)
    finally:
        written.close()
    if Path(f"{journal}.cell").is_file():  # the simulated cell that the journal is of, if it is one
        shutil.copyfile(f"{journal}.cell", f"{into}.cell")
    click.echo(f"{into}: '{after.net.name}' goes on with tokens on {', '.join(moved.marking)}")
    if moved.under_way:
        click.echo(f"  under way, and asked after at the start: the commands of {', '.join(moved.under_way)}")
    click.echo("  begun anew: whose turn it is where arbiters alternate; what sensors show is read at the start")
    click.echo(f"  next: firable run {new} --journal {into}, with the plant or binding of the cell")
    return 0


def _demand_reachable(net: Net, marking: tuple[str, ...], allowed: Budget) -> None:
    """Raise `InputError` F5051 unless the marking is one that the new net can reach."""
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.verdict import Status

    verdict = _reachable(net, marking, allowed)
    shown = ", ".join(marking)
    if verdict.status is Status.UNKNOWN:
        message = f"whether '{net.name}' reaches the marking {shown} could not be decided: {verdict.bound}"
        raise InputError([Diagnostic("F5051", message, "give it more time or memory: --max-seconds, --max-memory")])
    if verdict.status is Status.VIOLATED:
        message = f"'{net.name}' never comes into the marking {shown}, so nothing is proved of what follows"
        hint = (
            "run the old bundle on, to a marking that both nets reach: best to the end of the cycle; where there is "
            "none, bring the cell by hand to the initial marking of the new net, and begin with a new journal"
        )
        raise InputError([Diagnostic("F5051", message, hint)])


def _reachable(net: Net, marking: tuple[str, ...], allowed: Budget) -> Verdict:
    from dataclasses import replace

    from firable.analysis.check import check
    from firable.executor.journal.takeover import formula_of
    from firable.nets.net import Property, PropertyKind

    asked = replace(net, properties=(Property(_ASKED, PropertyKind.REACHABLE, formula_of(net, marking)),))
    return check(asked, budget=allowed).verdict(f"property.{_ASKED}")


def _refuse_missing(journal: str) -> None:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    if not Path(journal).is_file():
        message = f"{printable(journal)}: there is no journal"
        raise InputError([Diagnostic("F1001", message, "name the file that `firable run OLD --journal` wrote")])


def _refuse_standing(into: str) -> None:
    from firable.nets.diagnostics import Diagnostic, InputError
    from firable.nets.source import printable

    if Path(into).exists():
        message = f"{printable(into)}: a file stands there, and may be the journal of a cell"
        raise InputError([Diagnostic("F1017", message, "name another file")])
