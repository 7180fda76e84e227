"""`firable run BUNDLE --bind FILE`: run all controllers of a bundle here, on the machines of a binding."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import click

from firable.cli import text
from firable.cli.log import told_aside
from firable.cli.options import binding_for
from firable.cli.report import Report
from firable.cli.watched import AFTER_A_FAULT, machines_verdict, show_coalesced, show_counts

if TYPE_CHECKING:
    from firable.executor import PlantModel, RunReport
    from firable.executor.operating.conduct import Conduct
    from firable.nets.bundle import Bundle
    from firable.nets.verdict import Verdict

_BLOCKED_SHOWN = 6
"""So many transitions are told of, and what they waited for when somebody stopped the run."""


def run_bound_of(path: str, bundle: Bundle, bind: str, conduct: Conduct, plant: PlantModel | None) -> Report:
    """Run until the operator stops it or nothing can go on, and report how it ended."""
    from firable.executor.operating.running import run_bound

    binding, notes = binding_for(bind, bundle.net)
    for note in notes:  # before anything moves
        text.show_diagnostic(note)
    with told_aside(_told, conduct.log) as tell:
        report = run_bound(bundle, binding, replace(conduct, tell=tell), plant=plant)
    known = report.to_json()
    of_workpieces = {"delivered", "inside", "lost", "doubled", "simulated_seconds"}
    kept = {key: value for key, value in known.items() if key not in of_workpieces}
    return Report(
        "run",
        path,
        bundle.net,
        (_verdict(report, bind), *machines_verdict(report, f"run on the machines of {bind}")),
        notes=notes,
        run={**kept, "seconds": report.simulated_seconds, "binding": bind},
    )


def show_bound(report: Report) -> None:
    """How the run ended."""
    text.heading(report.net, report.input)
    done = report.run
    click.echo(f"  {done['state']} after {done['seconds']:,.0f} s on the machines of {done['binding']}")
    if done["message"] and report.verdicts[0].holds:
        click.echo(f"  {done['message']}")
    if done["state"] == "stopped":
        for line in done["blocked"][:_BLOCKED_SHOWN]:
            click.echo(f"    {line}")
    show_counts(done)
    show_coalesced(done["coalesced"])
    if refuted := [verdict for verdict in report.verdicts if not verdict.holds]:
        text.show_verdicts(report.net, refuted)
    text.show_summary(report)
    for file in report.files:
        click.echo(f"  trace {file}")


def _told(_kind: str, sentence: str) -> None:
    """One line of what becomes of a link, as it happens."""
    click.echo(f"  {sentence}", err=True)


def _verdict(report: RunReport, bind: str) -> Verdict:
    from firable.executor import State
    from firable.nets.verdict import Status, Verdict

    went_wrong = report.state not in {State.STOPPED, State.HELD}
    # This is no failure of the cell, and nothing that a service manager may take for an end in order.
    unsettled = report.situation.is_unsettled
    return Verdict(
        "ran-until-stopped",
        Status.VIOLATED if went_wrong else Status.UNKNOWN if unsettled else Status.PROVED,
        "the cell runs until it is stopped",
        f"run on the machines of {bind}",
        bound=report.situation.message if unsettled else "",
        hint=AFTER_A_FAULT if report.state is State.FAULT else "",
        subjects=(*filter(None, [report.situation.message]), *map(str, report.situation.blocked)) if went_wrong else (),
    )
