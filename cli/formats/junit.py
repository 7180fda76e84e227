"""JUnit's XML of test results: a suite for each net, a case for each verdict.

What must hold and is violated is a failure; what must hold and is not decided is an error, since unknown never passes;
a net that cannot be read is a suite with one case in error. Warnings and what is only told for information pass, with
their words as output of the case. No times are given: the same input gives the same bytes.

The format has no standard; the library writes what the servers that read it have in common.
"""

from __future__ import annotations

import re
from io import BytesIO
from typing import Final

from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

from firable.cli.formats.alerts import ending
from firable.cli.report import Outcome, Report
from firable.cli.text import reasons
from firable.nets.rules import rule_of
from firable.nets.verdict import Status, Verdict

_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(outcome: Outcome) -> str:
    """The outcome of a command as JUnit XML, UTF-8 text that ends with a line feed."""
    document = JUnitXml("firable")
    if outcome.errors:
        suite = TestSuite("input")
        for error in outcome.errors:
            case = TestCase(_clean(str(error.span or "input")), "input")
            case.result = [Error(_clean(error.message), error.code)]
            case.result[0].text = _clean(str(error))
            suite.add_testcase(case)
        document.add_testsuite(suite)
    for report in outcome.reports:
        document.add_testsuite(_suite(outcome.command, report))
    stream = BytesIO()
    document.write(stream, pretty=True)
    return stream.getvalue().decode("utf-8").rstrip("\n") + "\n"


def _suite(command: str, report: Report) -> TestSuite:
    suite = TestSuite(_clean(report.input))
    name = f"firable.{command}.{report.net.name or 'net'}"
    for verdict in report.verdicts:
        suite.add_testcase(_case(report, verdict, name))
    return suite


def _case(report: Report, verdict: Verdict, classname: str) -> TestCase:
    case = TestCase(_clean(verdict.name), _clean(classname))
    told = _clean("\n".join((verdict.statement, *reasons(report.net_of(verdict), verdict))))
    if not verdict.matters or verdict.outcome is Status.PROVED:
        if verdict.status is not Status.PROVED:
            case.system_out = told
        return case
    kind = Error if verdict.status is Status.UNKNOWN else Failure
    result = kind(_clean(f"{ending(verdict)}: {verdict.statement}"), rule_of(verdict))
    result.text = told
    case.result = [result]
    return case


def _clean(text: str) -> str:
    """The text without what XML cannot say."""
    return _NO_XML.sub("\N{REPLACEMENT CHARACTER}", text)
