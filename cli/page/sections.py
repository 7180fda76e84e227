"""The sections of the page, each a function from the report to markup, or to nothing where the report has none of it.

They are generic over verdicts: a family of obligations, a part of the protocol or a fault that is reported tomorrow
appears by its verdicts, under the first word of their names. Only what has a shape of its own has a section of its own:
the table, the groups, the knowledge of controllers, the nine obligations, the assumptions, the loop with its machines.

To add a section: its function, and a row in `SECTIONS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from firable.cli.page.listed import family_line, listed
from firable.cli.page.markup import Content, Markup, raw, tag, together
from firable.cli.page.pieces import ROWS_MAX, badge, classes, hints_said, in_code, names, status_badge, table
from firable.cli.page.protocol import is_of_protocol, lives_on, one_fault, while_dead
from firable.cli.page.runs import strip
from firable.cli.page.swimlanes import swimlanes
from firable.cli.page.votes import is_of_votes, which_stand
from firable.cli.report import Report
from firable.cli.story import outcome_told, waits_told
from firable.cli.text import counted, rule
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict, Weight, Witness

if TYPE_CHECKING:
    from firable.decompose.proofs.family import Family
    from firable.nets.net import Net

COUNTEREXAMPLES_MAX: Final = 24
_DRAWN_TRANSITIONS_MAX: Final = 80
_COLUMNS_MAX: Final = 9
_HEADINGS: Final = {
    Weight.REQUIRED: "must hold",
    Weight.WARNING: "warnings",
    Weight.INFORMATION: "for information",
}


@dataclass(frozen=True, slots=True)
class Section:
    """A section: its anchor, the word that leads to it, its title, and what makes it."""

    anchor: str
    word: str
    title: str
    make: Callable[[Report], Markup | None]


# --- Obligations and assumptions


def _standing(report: Report) -> Markup | None:
    if not report.standing:
        return None
    rows = []
    for line in report.standing:
        tone = "good" if line.status.startswith(("proved", "by the protocol", "shown")) else None
        tone = {"violated": "bad", "unknown": "open", "assumed": "open"}.get(line.status, tone)
        rows.append((line.name, line.says, tag("span", line.status, cls=classes(tone)), line.by))
    lead = "What the running, distributed cell needs so that it does what the central net does."
    return together(
        tag("p", lead, cls="lead"),
        table(("", "obligation", "status", "shown by, or assumed of"), rows, caption="The obligations O1 to O9"),
    )


def _obligations(report: Report) -> Markup | None:
    from firable.decompose.proofs.family import proved_of

    rows = []
    for family in _families(report):
        if some := proved_of(family, report.verdicts):
            rows.append(family_line(family.title, family.says, some))
    if not rows:
        return None
    lead = "Each obligation compares the central net with its parts, and a solver finds no case in which they differ."
    return together(tag("p", lead, cls="lead"), *rows)


def _families(report: Report) -> Sequence[Family]:
    """The families of obligations; a check has none, though a verdict of it may bear the name of one."""
    from firable.decompose.proofs.families import REPORTED

    return REPORTED if report.decomposition is not None else ()


def _assumptions(report: Report) -> Markup | None:
    if not report.assumptions:
        return None
    asked = {verdict.statement: verdict for verdict in report.verdicts if verdict.name.startswith("o4.")}
    rows = []
    for assumption in report.assumptions:
        verdict = asked.get(assumption)
        state = tag("span", "assumed", cls=classes("open")) if verdict is None else badge(verdict)
        how = "to be checked on the cell" if verdict is None else "asked of the loop with its machines"
        rows.append((assumption, state, how))
    for verdict in asked.values():
        if verdict.statement not in report.assumptions:
            rows.append((verdict.statement, badge(verdict), "asked of the loop with its machines"))
    lead = (
        "External gates cannot be locked (O4): what a proof relies on, and whether the machines are known to keep it. "
        "Where one does not hold, the interlock belongs to the machine's own controller."
    )
    heads = ("assumption", "status", "how it is known")
    return together(tag("p", lead, cls="lead"), table(heads, rows, caption="Assumptions"))


# --- Verdicts


def _others(report: Report) -> Markup | None:
    """The verdicts that no section above shows."""
    shown = _shown_above(report)
    rest = [verdict for verdict in report.verdicts if id(verdict) not in shown and not _told_apart(verdict)]
    parts: list[Markup] = []
    for weight, title in _HEADINGS.items():
        some = [verdict for verdict in rest if verdict.told_as is weight]
        if some:
            parts.append(tag("h3", title))
            parts.append(listed(some))
    return together(*parts) if parts else None


def _told_apart(verdict: Verdict) -> bool:
    """Whether a section of its own tells what the verdict says, with its run."""
    return is_of_protocol(verdict) or is_of_votes(verdict)


def _shown_above(report: Report) -> set[int]:
    from firable.decompose.proofs.family import proved_of

    found = {id(verdict) for family in _families(report) for verdict in proved_of(family, report.verdicts)}
    return found | {id(verdict) for verdict in report.verdicts if verdict.name.startswith("o4.") and report.assumptions}


def _loop(report: Report) -> Markup | None:
    if not report.loop:
        return None
    loop = report.loop
    rows = []
    for row in loop["comparison"]:
        free, closed = Status(row["gates_free"]), Status(row["with_machines"])
        rows.append(
            (tag("span", row["question"], cls="code"), status_badge(free), status_badge(closed), row.get("remark", ""))
        )
    edges = "" if loop["edges"] is None else f" and {counted(loop['edges'], 'edge')}"
    lead = (
        f"The net and its machines ({loop['machines']}) as one: {counted(loop['places'], 'place')}, "
        f"{counted(loop['transitions'], 'transition')}, {counted(loop['markings'], 'marking')}{edges}. "
        f"With gates free there are {counted(loop['markings_gates_free'], 'marking')}, and a verdict may hope for a "
        "gate that never opens."
    )
    heads = ("question", "gates free", "with its machines", "")
    unasked = tag("p", loop["faults_not_asked"], ".") if "faults_not_asked" in loop else None
    return together(tag("p", lead, cls="lead"), table(heads, rows, caption="Verdicts side by side"), unasked)


def refuted(report: Report) -> list[tuple[str, Verdict]]:
    """The verdicts whose runs are drawn, each with its anchor: what must hold comes first, what is as expected last."""
    some = [v for v in report.verdicts if v.status is Status.VIOLATED and v.witness is not None]
    some = [v for v in some if not _told_apart(v)]
    some.sort(key=lambda verdict: (verdict.outcome is Status.PROVED, list(_HEADINGS).index(verdict.told_as)))
    return [(f"run-{n}", verdict) for n, verdict in enumerate(some, start=1)]


def _course(report: Report) -> Markup | None:
    if not report.course:
        return None
    return tag("ul", [tag("li", line) for line in report.course])


def _counterexamples(report: Report) -> Markup | None:
    told: dict[tuple[object, ...], tuple[str, str]] = {}
    parts: list[Markup] = []
    some = refuted(report)
    for anchor, verdict in some[:COUNTEREXAMPLES_MAX]:
        witness = verdict.witness
        if witness is None:
            continue
        key = (id(report.net_of(verdict)), witness.firings, witness.cycle, witness.assignment)
        head = together(tag("h3", badge(verdict), " ", verdict.statement), tag("p", verdict.name, cls="code soft"))
        if key in told and (witness.firings or witness.cycle):
            name, where = told[key]
            same = tag(
                "p",
                "By the same run as ",
                tag("a", name, href=f"#{where}"),
                f": {witness.note}" if witness.note else "",
            )
            parts.append(tag("div", head, same, cls="counter", id=anchor))
            continue
        told[key] = (verdict.name, anchor)
        hints = hints_said(verdict)
        drawn = _drawn(report, verdict, witness)
        story = _story(report.net_of(verdict), verdict, told, anchor)
        parts.append(tag("div", head, drawn, story, hints, cls="counter", id=anchor))
    if not parts:
        return None
    if len(some) > COUNTEREXAMPLES_MAX:
        parts.append(tag("p", f"{len(some) - COUNTEREXAMPLES_MAX:,} more are in the report as JSON", cls="soft"))
    return together(*parts)


def _story(net: Net, verdict: Verdict, told: dict[tuple[object, ...], tuple[str, str]], anchor: str) -> Markup:
    """Who waits for whom where the run ends, and what would cure it; `told` holds where the same was told before."""
    parts: list[Markup] = []
    if verdict.witness is not None and verdict.witness.waits:
        waits = (tag("li", line) for line in waits_told(net, verdict.witness.waits))
        parts += [tag("p", "There the tokens wait in a circle, each for the next:"), tag("ol", *waits)]
    changes = tuple(cure.changes for cure in verdict.cures)
    if changes and changes in told:
        name, where = told[changes]
        parts.append(tag("p", "Cured by the same change as ", tag("a", name, href=f"#{where}"), "."))
    elif changes:
        told[changes] = (verdict.name, anchor)
        cures = (
            tag("li", in_code("; and ".join(cure.changes)), tag("p", f"checked: {outcome_told(cure)}", cls="soft"))
            for cure in verdict.cures
        )
        parts += [tag("p", "What would cure it, each change by itself:"), tag("ul", *cures)]
    return together(*parts)


def _drawn(report: Report, verdict: Verdict, witness: Witness) -> Markup:
    protocol = report.protocols.get(verdict.name)
    told = None if protocol is None else swimlanes(protocol, witness)
    return told or strip(report.net_of(verdict), witness, report.net, report.decomposition)


# --- The cell and its decomposition


def _picture(report: Report) -> Markup | None:
    from firable.nets.drawing import draw_net, draw_overview, has_overview

    net = report.net
    is_large = len(net.transitions) > _DRAWN_TRANSITIONS_MAX
    if is_large and not has_overview(net):
        return tag("p", f"{counted(len(net.transitions), 'transition')} are too many for a picture that can be read.")
    label = f"the net of {net.name or 'the cell'}, a lane for each controller"
    if is_large:
        label = f"the controllers of {net.name or 'the cell'}, and the transitions that they share"
    drawn = raw(draw_overview(net) if is_large else draw_net(net))
    return tag("div", drawn, cls="picture", tabindex="0", role="region", aria_label=label)


def _coordinator(report: Report) -> Markup | None:
    """The coordinator diagram, of a split that somebody can take in."""
    from firable.nets.drawing import draw_coordinator

    if report.decomposition is None or not 0 < len(report.table) <= _DRAWN_TRANSITIONS_MAX:
        return None
    label = "who decides what over whom: a box for each controller, and the transitions that coordinators decide"
    drawn = raw(draw_coordinator(report.decomposition))
    return tag("div", drawn, cls="picture", tabindex="0", role="region", aria_label=label)


def _coordinator_table(report: Report) -> Markup | None:
    from firable.nets.layers import Layers

    if not report.table:
        return None
    controllers = [c.name for c in report.net.controllers]
    apart = len(controllers) <= _COLUMNS_MAX
    reasons = dict(_reasons(report.decomposition))
    top, layered = Layers(report.net).root, any(row.at for row in report.table)
    rows: list[Sequence[Content]] = []
    for row in report.table[:ROWS_MAX]:
        parts = {part.controller: part.name for part in row.parts}
        cells = (
            [tag("span", parts[name], cls="part-name") if name in parts else "" for name in controllers]
            if apart
            else []
        )
        if not apart:
            cells = [names(f"{name} at {controller}" for controller, name in parts.items())]
        decided = [row.at or top] if layered else []
        rows.append((row.name, row.description, *cells, *decided, reasons.get(row.name, "")))
    lead = f"{_globals(report)}: each fires when every controller that has a part in it has voted yes."
    heads = ("", "transition", *(controllers if apart else ["parts"]), *["decided by"] * layered, "global because of")
    return together(
        tag("p", lead, cls="lead"), table(heads, rows, caption="Coordinator table", count=len(report.table))
    )


def _globals(report: Report) -> str:
    return counted(len(report.table), "global transition")


def _reasons(decomposition: Decomposition | None) -> Iterator[tuple[str, str]]:
    from firable.nets.knowledge import Because, reasons

    for reason in reasons(decomposition) if decomposition else ():
        words = {
            Because.ARCS: "its arcs",
            Because.GATE: f"gates on {', '.join(reason.gates)}",
            Because.CONFLICT: f"its conflict with {reason.rival} at {reason.place}",
        }[reason.because]
        if reason.lifted_from:
            words += f"; decided above {reason.lifted_from}, as it competes with {reason.rival} at {reason.place}"
        yield reason.transition, words


def _groups(report: Report) -> Markup | None:
    from firable.nets.layers import Layers

    if report.decomposition is None or not report.decomposition.groups:
        return None
    rows = []
    groups, top = report.decomposition.groups, Layers(report.net).root
    for group in groups[:ROWS_MAX]:
        order = "; then ".join(", ".join(some) for some in (group.sequence, group.rest) if some)
        rows.append(
            (
                group.name,
                tag("span", order, cls="code"),
                rule(group.sequence, str(group.by)),
                group.controller or group.at or top,
            )
        )
    lead = (
        f"{counted(len(groups), 'group')}: transitions that compete for a place, directly or through others, are "
        "decided together by one arbiter."
    )
    heads = ("group", "transitions", "how", "decided by")
    return together(tag("p", lead, cls="lead"), table(heads, rows, caption="Arbitration groups", count=len(groups)))


def _knowledge(report: Report) -> Markup | None:
    from firable.nets.knowledge import knowledge

    if report.decomposition is None or not report.table:
        return None
    parts = []
    known = knowledge(report.decomposition)
    for one in known[:ROWS_MAX]:
        facts: tuple[tuple[str, Sequence[str]], ...] = (
            ("owns the places", one.places),
            ("owns the signals", one.signals),
            ("fires alone", one.fires),
            ("votes for", tuple(f"{row} by {part}" for row, part in one.votes)),
            ("keeps for others to read", tuple(f"{name} for {row}" for name, row in one.locks)),
            ("reads from its machines", tuple(f"{name} for {row}" for name, row in one.answers)),
            ("talks to", one.talks_to),
        )
        listed = [together(tag("dt", word), tag("dd", names(some))) for word, some in facts if some]
        parts.append(tag("details", tag("summary", tag("b", one.controller)), tag("dl", *listed, cls="facts inside")))
    if len(known) > ROWS_MAX:
        parts.append(tag("p", f"and {len(known) - ROWS_MAX:,} more controllers", cls="soft"))
    return together(*parts)


SECTIONS: Final[tuple[Section, ...]] = (
    Section("table", "Table", "Coordinator table", _coordinator_table),
    Section("needs", "Needs", "What the running system needs", _standing),
    Section("obligations", "Obligations", "Obligations", _obligations),
    Section("votes", "Votes", "Which votes stand", which_stand),
    Section("assumptions", "Assumptions", "Assumptions", _assumptions),
    Section("machines", "Machines", "With its machines", _loop),
    Section("counterexamples", "Counterexamples", "Counterexamples", _counterexamples),
    Section("verdicts", "Verdicts", "Verdicts", _others),
    Section("fault", "One fault", "What one fault does", one_fault),
    Section("dead", "Dead", "What may stand still while somebody is dead", while_dead),
    Section("lives-on", "Wrong protocols", "What this cell lives on", lives_on),
    Section("course", "Course", "How it was found", _course),
    Section("coordinator", "Deciders", "Who decides what over whom", _coordinator),
    Section("groups", "Arbitration", "Arbitration", _groups),
    Section("controllers", "Controllers", "What each controller must know", _knowledge),
    Section("cell", "Cell", "The cell", _picture),
)
"""Every section, in the order of the page: what is split, what is proved of it, what is told besides, pictures."""
_ABOVE_IN_A_SPLIT: Final = ("coordinator", "table", "groups", "votes", "controllers")


def sections(command: str) -> tuple[Section, ...]:
    """Every section, in the order of the page; a split is asked for its table, and a vote taken back is no failure."""
    first = [section for section in SECTIONS if command == "split" and section.anchor in _ABOVE_IN_A_SPLIT]
    first.sort(key=lambda section: _ABOVE_IN_A_SPLIT.index(section.anchor))
    return (*first, *(section for section in SECTIONS if section not in first))
