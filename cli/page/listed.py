"""Verdicts as a list: each by itself, or as a line of its family that unfolds.

Where there are dozens of one kind, such as a verdict on each vote, whoever reads wants to know how many hold, and then
those that do not. A family is told by the first word of the names, and named here, as nothing else says which verdicts
are alike; tasks are known by how their conditions are decided.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from firable.cli.page.markup import Markup, tag, together
from firable.cli.page.pieces import badge, hints_said
from firable.cli.text import counted, first_of
from firable.nets.verdict import Status, Verdict, Weight

LISTED_MAX: Final = 300
"""How many verdicts of one family are listed; of more, those that are not proved come first."""
_SUBJECTS_MAX: Final = 40
_SAYS: Final = {
    "opens": "a place is opened by a task as the theorem asks, and each resource adds up",
}
_OF_TASKS: Final = "exploration of the task, closed"


def listed(some: Sequence[Verdict]) -> Markup:
    """The verdicts in their order; a family stands as one line where its first verdict does."""
    families: dict[str, list[Verdict]] = {}
    for verdict in some:
        families.setdefault(_family_of(verdict) or verdict.name, []).append(verdict)
    parts: list[Markup] = []
    single = 0
    for name, its in families.items():
        if _family_of(its[0]):
            parts.append(family_line(name, _SAYS.get(name, _conditions(its)), its))
            continue
        parts += map(_verdict, its[: max(0, LISTED_MAX - single)])
        single += len(its)
    if single > LISTED_MAX:
        parts.append(tag("p", f"and {single - LISTED_MAX:,} more", cls="soft"))
    return together(*parts)


def _family_of(verdict: Verdict) -> str:
    """The family of which this is one of many, or nothing."""
    word, _, rest = verdict.name.partition(".")
    return word if rest and (word in _SAYS or verdict.method == _OF_TASKS) else ""


def _conditions(some: Sequence[Verdict]) -> str:
    return ", ".join(verdict.name.partition(".")[2] for verdict in some)


def family_line(title: str, says: str, some: Sequence[Verdict]) -> Markup:
    """A family as a line that unfolds: how many are proved, and each of them; open where one that must hold is not."""
    proved = sum(verdict.holds for verdict in some)
    # A line for each, those that are not proved first: whoever opens it looks for them.
    ordered = sorted(some, key=lambda verdict: verdict.holds)
    share = f"width:{100 * proved // len(some)}%"
    bar = tag("i", tag("b", style=share), aria_hidden="true")
    line = tag(
        "span",
        tag("b", title),
        tag("span", bar, f"{proved:,} of {len(some):,}", cls="share"),
        tag("span", says, cls="says"),
        cls="family",
    )
    more = len(some) - LISTED_MAX
    rest = (
        tag("p", f"and {more:,} more, all {'proved' if ordered[LISTED_MAX].holds else 'like these'}")
        if more > 0
        else None
    )
    inside = tag("div", *map(_verdict, ordered[:LISTED_MAX]), rest, cls="inside")
    return tag(
        "details",
        tag("summary", line),
        inside,
        open=any(not verdict.holds and verdict.weight is Weight.REQUIRED for verdict in some),
    )


def _verdict(verdict: Verdict) -> Markup:
    cost = [counted(n, word) for n, word in ((verdict.cost.markings, "marking"), (verdict.cost.edges, "edge")) if n]
    how = ", ".join(["by " + verdict.method, *cost])
    about = verdict.subjects if verdict.status is not Status.PROVED else ()
    return tag(
        "div",
        tag("div", badge(verdict)),
        tag(
            "div",
            tag("p", verdict.statement, cls="what"),
            tag("p", f"{verdict.name}; {how}", cls="code"),
            tag("p", "about: ", first_of(about, _SUBJECTS_MAX)) if about else None,
            tag("p", "reached: ", verdict.bound) if verdict.bound and verdict.status is Status.UNKNOWN else None,
            hints_said(verdict),
            tag("p", "evidence: ", ", ".join(verdict.evidence), cls="code") if verdict.evidence else None,
        ),
        cls="verdict",
    )
