"""The page: one file with everything in it, which a browser shows, a printer prints and a mail can carry.

No script, no picture, no font and no address is loaded from anywhere; what folds is the browser's own `details`. The
same report gives the same bytes: there is no date and no measured time in it, so two pages can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from firable.cli.page.markup import Markup, raw, tag, together
from firable.cli.page.pieces import TONES, classes
from firable.cli.page.protocol import wrong_told
from firable.cli.page.sections import refuted, sections
from firable.cli.page.style import STYLE
from firable.cli.report import Report
from firable.cli.text import counted, endings, first_of, good_end
from firable.nets.source import printable
from firable.nets.verdict import Status, Verdict, overall

_ASKED: Final = {
    "prove": "Proof of the decomposition",
    "check": "Check of the net",
    "bundle": "Bundle",
    "refine": "Refinement of the net",
    "split": "Split over its controllers",
}
_FAILING_MAX: Final = 6
_NAMED_MAX: Final = 8
_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'"


def page_of(report: Report) -> str:
    """The report as an HTML page, whole and by itself."""
    title = f"{report.net.name or 'the net'}: {_ASKED.get(report.command, report.command)}"
    made = [(section, markup) for section in sections(report.command) if (markup := section.make(report)) is not None]
    links = [tag("li", tag("a", section.word, href=f"#{section.anchor}")) for section, _ in made]
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("title", title),
        tag("style", raw(STYLE)),
    )
    written = [
        tag("section", tag("h2", section.title), markup, id=section.anchor, aria_label=section.title)
        for section, markup in made
    ]
    body = tag(
        "body",
        _masthead(report),
        tag("nav", tag("div", tag("ul", links)), aria_label="sections") if links else None,
        tag("main", written),
        _foot(report),
    )
    text = f"<!DOCTYPE html>\n{tag('html', head, body, lang='en')}\n"
    return text.encode(errors="replace").decode()  # the name of a file may hold bytes that are no UTF-8


def _masthead(report: Report) -> Markup:
    net = report.net
    sizes = [(len(net.places), "place"), (len(net.transitions), "transition"), (len(net.controllers), "controller")]
    counts = [tag("li", tag("b", f"{n:,}"), f" {word}") for n, word in endings(report.verdicts)]
    counts += [tag("li", told)] if (told := wrong_told(report)) else []
    return tag(
        "header",
        tag(
            "div",
            tag("p", _ASKED.get(report.command, report.command)),
            tag("h1", net.name or "the net"),
            tag("p", net.description) if net.description else None,
            tag("p", ", ".join(counted(n, word) for n, word in sizes if n), _explored(report)),
            tag("p", f"{printable(report.binding)} binds each signal and command") if report.binding else None,
            tag("div", _overall_badge(report.verdicts), tag("ul", counts, cls="counts"), cls="verdict-line"),
            _failing(report),
        ),
        cls="masthead",
    )


def _explored(report: Report) -> str:
    """How much of the net was looked at, where that is known."""
    figures = report.figures
    known = [(figures.get("markings"), "marking"), (figures.get("edges"), "edge")]
    said = ", ".join(counted(n, word) for n, word in known if n is not None)
    return f"; {said}{'' if figures.get('complete', True) else ' so far'}" if said else ""


def _failing(report: Report) -> Markup | None:
    """What must hold and does not, or ends otherwise than the file expects, with its run or its subjects."""
    anchors = {verdict.name: f"#{anchor}" for anchor, verdict in refuted(report)}
    failing = [verdict for verdict in report.verdicts if verdict.matters and verdict.outcome is Status.VIOLATED]
    if not failing:
        return None
    lines = []
    for verdict in failing[:_FAILING_MAX]:
        where = anchors.get(verdict.name)
        said = tag("a", verdict.statement, href=where) if where else verdict.statement
        told = "" if verdict.expected is None else f": {verdict.status}, where the file expects {verdict.expected}"
        about = () if where or verdict.status is Status.PROVED else verdict.subjects
        named = tag("span", " about: ", first_of(about, _NAMED_MAX), cls="soft") if about else None
        lines.append(tag("li", tag("span", "✗ ", aria_hidden="true"), said, told, named))
    if len(failing) > _FAILING_MAX:
        lines.append(tag("li", f"and {len(failing) - _FAILING_MAX:,} more"))
    return tag("ul", lines, cls="failing", aria_label="what does not hold")


def _foot(report: Report) -> Markup:
    from firable import __version__
    from firable.nets.interchange import net_digest

    notes = [tag("p", str(note)) for note in report.notes]
    words = f"firable {__version__}, of {report.input}; the net is {net_digest(report.net)} (SHA-256)"
    return tag("footer", together(*notes), tag("p", words))


def _overall_badge(verdicts: Sequence[Verdict]) -> Markup:
    """How all together ended; a report that only tells what follows has nothing that could fail."""
    if not any(verdict.matters for verdict in verdicts):
        return tag("span", "· for information: nothing has to hold", cls=classes(TONES["·"]))
    good = f"✓ {good_end(verdicts)}"
    word = {Status.PROVED: good, Status.VIOLATED: "✗ violated", Status.UNKNOWN: "? not decided"}[overall(verdicts)]
    return tag("span", word, cls=classes(TONES[word[0]]))
