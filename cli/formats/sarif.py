"""SARIF 2.1.0: what code-scanning sites take (OASIS, Static Analysis Results Interchange Format).

One run with a result for each alert and each refusal of an input. The rule is the code of the diagnostic, the code flow
is the firing sequence with the marking after each step, and the fingerprint is made of the cell's and the verdict's
names: it stays when lines move or other verdicts come and go, so that a site does not close an alert and open it again.
What is proved is no result: sites show every result as a problem, whatever its `kind` says.

Columns are counted in code points, as the diagnostics count them. Files below the working folder are named relative to
`%SRCROOT%`, as sites expect them; what lies elsewhere has its absolute URI.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from firable.cli.explain import page_of
from firable.cli.formats.alerts import Alert, alerts, ending, place_of, place_of_name
from firable.cli.report import ExitCode, Outcome, Report
from firable.cli.text import reasons
from firable.nets.diagnostics import CODES, Diagnostic, Severity, Span
from firable.nets.net import Net
from firable.nets.rules import rule_of
from firable.nets.verdict import Witness
from firable.semantics.player import Player

SCHEMA: Final = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_ROOT: Final = "%SRCROOT%"
_LEVELS: Final = {True: "error", False: "warning"}
_MEANINGS: Final = {
    ExitCode.ALL_HOLD: "all hold",
    ExitCode.VIOLATED: "a property is violated",
    ExitCode.INPUT_ERROR: "an input is refused",
    ExitCode.UNKNOWN: "something is not decided",
}


def sarif(outcome: Outcome) -> str:
    """The outcome of a command as a SARIF log, UTF-8 text that ends with a line feed."""
    results = [*_refusals(outcome.errors, Severity.ERROR)]
    for report in outcome.reports:
        results += _refusals(report.notes, Severity.WARNING)
        results += [_result(alert) for alert in alerts(report)]
    codes = list(dict.fromkeys(result["ruleId"] for result in results))
    for result in results:
        result["ruleIndex"] = codes.index(result["ruleId"])
    run = {
        "tool": {"driver": _driver(codes)},
        "automationDetails": {"id": f"firable/{outcome.command}/"},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": outcome.exit_code is not ExitCode.INPUT_ERROR,
                "exitCode": int(outcome.exit_code),
                "exitCodeDescription": _MEANINGS[outcome.exit_code],
            }
        ],
        "results": results,
    }
    return json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2, ensure_ascii=False) + "\n"


def _driver(codes: Sequence[str]) -> dict[str, Any]:
    from firable import __version__

    rules = [
        {
            "id": code,
            "name": "".join(word.capitalize() for word in re.findall(r"\w+", CODES[code])),
            "shortDescription": {"text": CODES[code].capitalize()},
            "help": {"text": f"firable explain {code}", "markdown": page_of(code)},
        }
        for code in codes
    ]
    return {"name": "firable", "semanticVersion": __version__, "rules": rules}


def _refusals(diagnostics: Sequence[Diagnostic], severity: Severity) -> Iterator[dict[str, Any]]:
    for one in diagnostics:
        result: dict[str, Any] = {
            "ruleId": one.code,
            "level": severity.value,
            "message": {"text": f"{one.message}\nhint: {one.hint}" if one.hint else one.message},
        }
        if one.span is not None:
            result["locations"] = [_physical(one.span)]
        where = one.span.file if one.span else ""
        result["partialFingerprints"] = {"firable/v1": _fingerprint(where, one.code, one.message)}
        yield result


def _result(alert: Alert) -> dict[str, Any]:
    report, verdict = alert.report, alert.verdict
    net = report.net_of(verdict)
    told = [line.strip() for line in reasons(net, verdict)]
    word = ending(verdict)
    result: dict[str, Any] = {
        "ruleId": rule_of(verdict),
        "level": _LEVELS[alert.is_error],
        "message": {"text": "\n".join([f"{verdict.name}: {word}: {verdict.statement}", *told])},
        "locations": [_location(report, place_of(report, verdict), verdict.name)],
        "partialFingerprints": {"firable/v1": _fingerprint(report.input, report.net.name, verdict.name)},
        "properties": {"verdict": verdict.name, "cell": report.net.name, "method": verdict.method},
    }
    witness = verdict.witness
    if witness is not None and (witness.firings or witness.cycle):
        result["codeFlows"] = [{"threadFlows": [{"locations": list(_flow(report, net, witness))}]}]
    if witness is not None:
        related = [(name, span) for name in witness.marking if (span := place_of_name(report, name))]
        if related:
            result["relatedLocations"] = [
                _physical(span) | {"id": i, "message": {"text": f"{name} holds a token"}}
                for i, (name, span) in enumerate(related)
            ]
    return result


def _flow(report: Report, net: Net, witness: Witness) -> Iterator[dict[str, Any]]:
    """One location for each firing, with the marking after it; the firings of the cycle are told once."""
    player, index, marking = Player(net), net.transition_index, net.initial_marking
    steps = [(fired, False) for fired in witness.firings] + [(fired, True) for fired in witness.cycle]
    for number, (fired, again) in enumerate(steps, start=1):
        marking = player.fire(marking, [index[name] for name in fired])
        words = [f"{name}: {words}" if (words := net.transition(name).description) else name for name in fired]
        text = f"{number}. {' + '.join(words)}" + (" (and again for ever)" if again else "")
        location = _location(report, place_of_name(report, fired[0]), fired[0]) | {"message": {"text": text}}
        state = {"marking": {"text": ", ".join(net.names(marking)) or "no place holds a token"}}
        yield {"location": location, "executionOrder": number, "state": state}


def _location(report: Report, span: Span | None, name: str) -> dict[str, Any]:
    """A place in the file, or the file alone, and what of the net is meant."""
    logical = [{"fullyQualifiedName": f"{report.net.name}.{name}" if report.net.name else name}]
    if span is not None:
        return _physical(span) | {"logicalLocations": logical}
    return {"physicalLocation": {"artifactLocation": _artifact(report.input)}, "logicalLocations": logical}


def _physical(span: Span) -> dict[str, Any]:
    region: dict[str, Any] = {
        "startLine": span.line,
        "startColumn": span.column,
        "endColumn": span.column + max(1, span.length),
    }
    physical: dict[str, Any] = {"artifactLocation": _artifact(span.file), "region": region}
    if span.excerpt and span.excerpt_column == 1:
        physical["contextRegion"] = {"startLine": span.line, "snippet": {"text": span.excerpt}}
    return {"physicalLocation": physical}


def _artifact(file: str) -> Mapping[str, str]:
    if re.match(r"[a-z]{2,}:", file):  # catalogue:NAME, which is a URI already
        return {"uri": file}
    path = Path(file)
    if path.is_absolute():
        try:
            path = path.resolve().relative_to(Path.cwd().resolve())
        except ValueError:
            return {"uri": path.as_uri()}
    return {"uri": quote(path.as_posix(), errors="surrogateescape"), "uriBaseId": _ROOT}


def _fingerprint(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode(errors="surrogatepass")).hexdigest()
