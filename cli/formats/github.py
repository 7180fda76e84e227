"""Annotations of a workflow run: lines such as `::error file=...,line=...::...`, which GitHub shows beside the code.

They follow the report as text, so that the log of the run still tells everything: a runner takes annotations out of
whatever a step prints. An annotation tells the whole story, since what it points to is often one line of a long way.
"""

from __future__ import annotations

from collections.abc import Iterator

from firable.cli.formats.alerts import alerts, ending, place_of
from firable.cli.report import Outcome
from firable.cli.text import reasons
from firable.nets.diagnostics import Diagnostic, Severity, Span
from firable.nets.rules import rule_of


def github(outcome: Outcome) -> str:
    """The annotations of an outcome, one on a line; none where all hold."""
    return "".join(f"{line}\n" for line in _lines(outcome))


def _lines(outcome: Outcome) -> Iterator[str]:
    for error in outcome.errors:
        yield _of_diagnostic(error)
    for report in outcome.reports:
        for note in report.notes:
            yield _of_diagnostic(note)
        for alert in alerts(report):
            verdict = alert.verdict
            told = [f"{verdict.statement}", *reasons(report.net_of(verdict), verdict)]
            title = f"{rule_of(verdict)} {verdict.name} {ending(verdict)}"
            span = place_of(report, verdict)
            yield _annotation("error" if alert.is_error else "warning", span, report.input, title, "\n".join(told))


def _of_diagnostic(one: Diagnostic) -> str:
    level = "error" if one.severity is Severity.ERROR else "warning"
    told = f"{one.message}\nhint: {one.hint}" if one.hint else one.message
    return _annotation(level, one.span, "", f"{one.code} {one.title}", told)


def _annotation(level: str, span: Span | None, file: str, title: str, told: str) -> str:
    if span is not None:
        end = span.column + max(1, span.length) - 1
        where = {"file": span.file, "line": span.line, "col": span.column, "endColumn": end}
    else:
        where = {"file": file} if file else {}
    properties = ",".join(f"{key}={_property(str(value))}" for key, value in (where | {"title": title}).items())
    return f"::{level} {properties}::{_message(told)}"


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")
