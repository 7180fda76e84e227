"""What `firable run` says of every run: of the machines, of what came too fast, since when, and after a fault."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import click

from firable.cli import text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from firable.executor import RunReport
    from firable.executor.operating.hosting import HostReport
    from firable.nets.verdict import Verdict

_AGAIN: Final = "mend what it tells of, and give the same command again: with its --journal "
AFTER_A_FAULT: Final = (
    f"{_AGAIN}the run is taken up where it stood; without one bring the cell to its initial marking first, and name "
    "another --trace, if there was one"
)
"""What to do after a run on machines that has ended by a fault."""
AFTER_A_FAULT_OF_A_HOST: Final = (
    f"{_AGAIN}this host goes on where it stood; without one bring the cell to its initial marking, and start all hosts "
    "anew, each with a new journal, and a new trace, if there was one"
)
"""The same after that of one host among others, which know it by its journal."""


def machines_verdict(report: RunReport | HostReport, method: str) -> tuple[Verdict, ...]:
    """The verdict on the machines of a run; none where they were not watched."""
    from firable.nets.verdict import Status, Verdict

    if not report.watched:
        return ()
    name, statement = "machines-as-modelled", "the machines did what the plant file allows, as far as signals show"
    found = report.divergence
    if found is None:
        return (Verdict(name, Status.PROVED, statement, method),)
    hint = f"at {found.at_seconds:.2f} s: {found.message}; mend the plant file, or look at that machine"
    return (Verdict(name, Status.VIOLATED, statement, method, hint=hint, subjects=found.places),)


def show_counts(run: Mapping[str, Any]) -> None:
    """How much was done, since when where the run was taken up, and by which coordinator where there are several."""
    since = f", since it was taken up at {run['begin_seconds']:,.0f} s" if run["begin_seconds"] else ""
    several = len(run["decided"]) > 1
    between = f"between {'coordinators' if several else 'coordinator'} and controllers"
    click.echo(
        f"  {text.counted(sum(run['firings'].values()), 'firing')}, "
        f"{text.counted(run['commands'], 'command')} issued, "
        f"{text.counted(run['messages'], 'message')} {between}{since}"
    )
    if several:
        click.echo(f"  decided: {', '.join(f'{count:,} by {name}' for name, count in run['decided'].items())}")


def show_coalesced(changes: Mapping[str, int]) -> None:
    """The signals that changed faster than they are read, that which did so most at first; nothing where none did."""
    for signal, count in sorted(changes.items(), key=lambda one: -one[1]):
        click.echo(f"  {signal} changed faster than it is read: {text.counted(count, 'change')} told to nobody")
