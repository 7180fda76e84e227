"""What the page says of the protocol: what one fault does, who stands still for the dead, what the cell lives on.

The protocols that are known to be wrong are refuted on the cell, and a refutation is no counterexample of the cell: the
protocol that runs is another. So they have a section of their own, in the words of the terminal. A wrong protocol that
does no harm here gets no sign of approval either, since the next edit of the net may need what this one does not.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from firable.cli.page.markup import Content, Markup, tag, together
from firable.cli.page.pieces import classes, names, status_badge, table
from firable.cli.page.swimlanes import swimlanes
from firable.cli.report import Report
from firable.nets.verdict import Status, Verdict

if TYPE_CHECKING:
    from firable.decompose.protocol.refuting import Refutation
    from firable.decompose.protocol.single_faults import Finding


def is_of_protocol(verdict: Verdict) -> bool:
    """Whether the sections here tell what this verdict says."""
    return verdict.name.startswith(("wrong.", "faults.dead"))


def one_fault(report: Report) -> Markup | None:
    """What one fault of each kind does, and the verdicts that show it."""
    if not report.faults:
        return None
    from firable.decompose.protocol.single_faults import LEAD, TITLES

    rows = [(tag("b", fault.fault), *(_finding(finding) for finding in fault.findings)) for fault in report.faults]
    return together(
        tag("p", LEAD, cls="lead"), table(("fault", *TITLES), rows, caption="What one fault of each kind does")
    )


def _finding(finding: Finding) -> Markup:
    return together(
        None if finding.status is None else status_badge(finding.status),
        tag("p", finding.says),
        tag("p", names(finding.by)) if finding.by else None,
        tag("p", finding.lacking, cls="soft") if finding.lacking else None,
    )


def while_dead(report: Report) -> Markup | None:
    """Who is dead, and what that keeps back."""
    if not report.outages:
        return None
    from firable.decompose.protocol.outages import namesakes

    rows: list[tuple[Content, ...]] = []
    for outage in report.outages:
        who = tag("b", outage.told)
        if outage.bound:
            rows.append((who, f"not known: {outage.bound}", *("" for _ in range(4))))
            continue
        told = (outage.at_once, outage.at_last, outage.goes_on, outage.still, outage.running)
        rows.append((who, *(names(some) if some else "–" for some in told)))
    lead = (
        "Who is dead never restarts. The others do nothing wrong, but some transitions stand still at once, and others "
        "may, for ever, by what the crash has left open. What goes on does so whenever the crash was. A machine may "
        "stand that may get no command any more."
    )
    both = namesakes(report.outages)
    heads = (
        "dead",
        "stands still at once",
        "may stand still",
        "goes on",
        "machines that may stand",
        "machines running",
    )
    return together(
        tag("p", lead, cls="lead"),
        tag("p", both, ".") if both else None,
        table(heads, rows, caption="What may stand still while somebody is dead"),
    )


def lives_on(report: Report) -> Markup | None:
    """The protocols known to be wrong, and what comes of each on this net."""
    if not report.refutations:
        return None
    lead = (
        "Each of these protocols leaves one thing out, and none of them is the one that runs. Where one goes wrong "
        "here, the cell lives on the obligation that it leaves out."
    )
    return together(tag("p", lead, cls="lead"), *map(_refutation, report.refutations))


def wrong_told(report: Report) -> str:
    """What the verdict on the whole is about where wrong protocols were tried: the one that runs, none of these."""
    some = report.refutations
    if not some:
        return ""
    refuted = sum(one.status is Status.VIOLATED for one in some)
    return (
        f"this is of the protocol that runs; of the {len(some)} known to be wrong, {refuted} go wrong on this net, as "
        "they must where it needs what they leave out"
    )


def _refutation(refutation: Refutation) -> Markup:
    """A wrong protocol as a line that unfolds: what it leaves out, what comes of it, and the run that shows it."""
    wrong = refutation.wrong
    tone = {"violated": "bad", "unknown": "open"}.get(refutation.status.value)
    said, *rest = re.split("[:,] ", refutation.outcome, maxsplit=1)
    why = "".join(rest)
    line = tag(
        "span", tag("b", wrong.name), f": {wrong.says} ({wrong.obligation}) ", tag("span", said, cls=classes(tone))
    )
    inside = together(
        tag("p", f"{why[:1].upper()}{why[1:]}.") if why else None,
        tag("p", f"reached: {refutation.bound}") if refutation.status.value == "unknown" else None,
        _run(refutation),
        _example(refutation.small),
    )
    return tag("details", tag("summary", line), tag("div", inside, cls="inside"))


def _run(refutation: Refutation) -> Markup | None:
    if refutation.witness is None:
        return None
    return together(
        swimlanes(refutation.protocol, refutation.witness, refutation.folded),
        tag("p", refutation.sentence, cls="outcome"),
    )


def _example(small: Refutation | None) -> Markup | None:
    if small is None:
        return None
    return together(tag("p", tag("b", f"{small.of_example}:")), _run(small))
