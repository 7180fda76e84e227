"""`firable run BUNDLE`: run all controllers of a bundle here, on the simulated cell."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click

from firable.cli import text
from firable.cli.log import told_aside
from firable.cli.report import Report
from firable.cli.watched import machines_verdict, show_coalesced, show_counts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from firable.executor import RunReport
    from firable.executor.operating.conduct import Conduct
    from firable.executor.operating.running import SimulatedCell
    from firable.nets.bundle import Bundle
    from firable.nets.verdict import Verdict


def run_simulated_of(path: str, bundle: Bundle, cell: SimulatedCell, conduct: Conduct) -> Report:
    """Run until the workpieces have gone through, or nothing can go on, and report how it ended."""
    from firable.executor.operating.running import run_simulated
    from firable.nets.machines.fitting import late_limits

    for late in late_limits(cell.plant, bundle.net):  # before the run, which may go round in a circle
        text.show_diagnostic(late)
    with told_aside(_told, conduct.log) as tell:
        report = run_simulated(bundle, cell, replace(conduct, tell=partial(_if_not_reported, tell)))
    return Report(
        "run",
        path,
        bundle.net,
        _verdicts(
            report,
            cell.going_through,
            cell.seed,
            is_kept=conduct.journal_path is not None,
            awaits_another=_awaits_another(report, cell),
        ),
        run={**report.to_json(), "workpieces": cell.workpieces, "seed": cell.seed},
    )


def show_simulated(report: Report) -> None:
    """How the run ended."""
    text.heading(report.net, report.input)
    done = report.run
    click.echo(
        f"  {done['state']} after {done['simulated_seconds']:,.0f} s in the cell: "
        f"{text.counted(len(done['delivered']), 'workpiece')} carried through, {len(done['lost'])} lost, "
        f"{len(done['doubled'])} doubled, {len(done['inside'])} still inside"
    )
    show_counts(done)
    show_coalesced(done["coalesced"])
    if done["state"] in {"stopped", "done"} and done["message"]:
        click.echo(f"  {done['message']}")
    refuted = [verdict for verdict in report.verdicts if not verdict.holds]
    if refuted:
        text.show_verdicts(report.net, refuted)
    text.show_summary(report)
    if done["state"] == "held":
        for line in done["message"].split("; "):
            click.echo(f"  {line}")
    for file in report.files:
        click.echo(f"  trace {file}")


_HELD_HINT = "the same command with `--resume` goes on, once `--say` has told of what no machine can tell of"
_UNKEPT_HINT = "name a --journal: then a run that is held can be taken up"
_LAST_HINT = (
    "where each workpiece is pushed on by the next one, the last stay inside, however many `--workpieces` come; "
    "where they are not to, let the cell carry them out without a next one"
)


def _told(_kind: str, sentence: str) -> None:
    """One line of what happens, as it happens."""
    click.echo(f"  {sentence}", err=True)


def _if_not_reported(tell: Callable[[str, str], None], kind: str, sentence: str) -> None:
    """Tell what the report does not: a new journal, a word of no use, an emergency stop that can be reset, a disk that
    hangs, that the machines are not watched, an error that nobody has handled.
    """
    from firable.executor.operating.disk_watch import ANSWERS, HANGS
    from firable.executor.operating.latch import LATCHED
    from firable.executor.operating.lives import BEGINS
    from firable.executor.operating.log import UNHANDLED
    from firable.executor.operating.restart import UNASKED
    from firable.executor.operating.watching import UNWATCHED

    if kind in {BEGINS, UNASKED, LATCHED, HANGS, ANSWERS, UNWATCHED, UNHANDLED}:
        tell(kind, sentence)


def _verdicts(
    report: RunReport, workpieces: int, seed: int, *, is_kept: bool, awaits_another: bool = False
) -> tuple[Verdict, ...]:
    from firable.executor import State
    from firable.nets.verdict import Status, Verdict, counted

    method = f"run on the simulated cell, seed {seed}"
    through = len(report.delivered)
    unsettled, all_through = report.situation.is_unsettled, through == workpieces
    ended = {State.DONE: Status.PROVED, State.STOPPED: Status.UNKNOWN, State.HELD: Status.UNKNOWN}.get(
        report.state, Status.VIOLATED
    )
    if report.state is State.STOPPED and all_through and not unsettled:
        ended = Status.PROVED
    reached = report.situation.message if all_through else f"{through} went through"
    intact = not report.lost and not report.doubled
    why, hint = [*_why(report)], ""
    if report.state is State.HELD:
        hint = _HELD_HINT if is_kept else _UNKEPT_HINT
    elif awaits_another:
        stay = "stays" if len(report.inside) == 1 else "stay"
        why.append(f"{len(report.inside)} of {counted(workpieces, 'workpiece')} {stay} inside until another one comes")
        hint = _LAST_HINT
    verdicts = [
        Verdict(
            "workpieces-carried-through",
            ended,
            f"{counted(workpieces, 'workpiece')} {'goes' if workpieces == 1 else 'go'} through the cell",
            method,
            bound=reached if ended is Status.UNKNOWN else "",
            subjects=(*why, *map(str, report.situation.blocked)) if ended is Status.VIOLATED else (),
            hint=hint,
        ),
        Verdict(
            "workpieces-intact",
            Status.PROVED if intact else Status.VIOLATED,
            "no workpiece is lost, none doubled",
            method,
            subjects=tuple(f"workpiece {i}" for i in (*report.lost, *report.doubled)),
        ),
    ]
    return (*verdicts, *machines_verdict(report, method))


def _why(report: RunReport) -> Iterator[str]:
    """Why the workpieces did not go through; what the verdict on the machines tells is not told twice."""
    found, message = report.divergence, report.situation.message
    if message:
        yield message if found is None else message.replace(f": {found}", "; see machines-as-modelled")


def _awaits_another(report: RunReport, cell: SimulatedCell) -> bool:
    """Whether workpieces are inside, and every transition that could fire waits for another one to come."""
    from firable.executor import State

    sensors, arrivals = cell.plant.sensors, cell.plant.arrivals.station
    comes = {(name, True) for name, sensor in sensors.items() if sensor.occupied == arrivals}
    return (
        report.state is State.WAITING
        and bool(report.inside)
        and all(
            one.gates and comes.issuperset(one.gates) and not (one.untaken or one.unread)
            for one in report.situation.blocked
        )
    )
