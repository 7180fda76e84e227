"""What `firable run` says of the machines: whether they did what their model allows."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from firable.executor import RunReport
    from firable.executor.operating.hosting import HostReport
    from firable.nets.verdict import Verdict


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
