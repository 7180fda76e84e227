"""What the page says of votes: how many stand, and what shows it; each that falls, with the run that takes it back.

A vote that falls is no counterexample of the cell, which needs none that stands: its run is here, folded, and not among
the counterexamples. The obligations behind votes that stand, and the units that these rest on, unfold beside them.
"""

from __future__ import annotations

from firable.cli.page.listed import family_line
from firable.cli.page.markup import Markup, tag, together
from firable.cli.page.pieces import badge
from firable.cli.page.runs import strip
from firable.cli.report import Report
from firable.cli.votes import FALLEN_MAX, Votes, fall_told, free_told, is_vote
from firable.nets.verdict import Verdict

_STAND = "votes of which no other transition takes the yes back"
_UNITS = "sets of places, which these rest on, of which one at most holds a token"


def is_of_votes(verdict: Verdict) -> bool:
    """Whether the section here tells what this verdict says."""
    return is_vote(verdict) or _is_unit(verdict)


def which_stand(report: Report) -> Markup | None:
    """Which votes stand, and what takes the others back."""
    votes = Votes.of(report)
    if not votes.head:
        return None
    lead = (
        "A part votes yes when it is firable and its gates are open. A vote that is not persistent is no fault: its "
        "part promises, and so keeps what it voted for until the order."
    )
    free = len(report.decomposition.free) if report.decomposition is not None else 0
    more = len(votes.others) - FALLEN_MAX
    units = [verdict for verdict in report.verdicts if _is_unit(verdict)]
    return together(
        tag("p", lead, cls="lead"),
        tag("p", tag("b", votes.head), "."),
        tag("p", " ".join(free_told(free)), ".") if free else None,
        tag("p", tag("b", votes.left), ".") if votes.left else None,
        family_line("persistent", _STAND, votes.verdicts) if votes.verdicts else None,
        family_line("units", _UNITS, units) if units else None,
        tag("p", tag("b", votes.fall)) if votes.fall else None,
        *(_fallen(report, verdict) for verdict in votes.others[:FALLEN_MAX]),
        tag("p", f"and {more:,} more", cls="soft") if more > 0 else None,
    )


def _is_unit(verdict: Verdict) -> bool:
    return verdict.name.startswith("unit.")


def _fallen(report: Report, verdict: Verdict) -> Markup:
    """A vote that does not stand, or of which that is not known, with its run where there is one."""
    line = tag("span", badge(verdict), " ", fall_told(verdict))
    if verdict.witness is None:
        return tag("p", line)
    run = strip(report.net_of(verdict), verdict.witness, report.net, report.decomposition)
    how = tag("p", f"{verdict.name}; by {verdict.method}", cls="code soft")
    return tag("details", tag("summary", line), tag("div", how, run, cls="inside"))
