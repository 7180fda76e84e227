"""The report: what every command says, as one record, printed as text or as JSON.

`check`, `prove`, `bundle`, `run` and `replay` all answer with verdicts on a net, so they share one shape, and a program
that reads one reads all. The JSON is published as `report.schema.json`, and holds no measured times: the same input
gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from firable.decompose.proofs.standing import Standing
    from firable.decompose.protocol.building import ProtocolNet
    from firable.decompose.protocol.outages import Outage
    from firable.decompose.protocol.refuting import Refutation
    from firable.decompose.protocol.single_faults import OneFault
    from firable.nets.decomposition import Coordinated, Decomposition
    from firable.nets.diagnostics import Diagnostic
    from firable.nets.net import Net
    from firable.nets.text_positions import Positions
    from firable.nets.verdict import Status, Verdict

VERSION = 1


class ExitCode(IntEnum):
    """What the exit code of a command means."""

    ALL_HOLD = 0
    VIOLATED = 1
    INPUT_ERROR = 2
    UNKNOWN = 3
    INTERNAL_ERROR = 4


@dataclass(frozen=True)
class Report:
    """The verdicts of one command on one net, with what belongs to them; empty parts are left out of the JSON.

    `loops` are the nets with machines that some verdicts show runs of (`net_of`), by the names of these verdicts, and
    `protocols` are others; `outages`, `faults` and `refutations` are told beside those. `claims` are, where the
    verdicts say whether evidence shows something, what it claims of each. `binding` was found to fit the net.
    `page` is the report as a page for a person, where one was written. `again` says that the same was decided before,
    which a program need not know; `positions` say where the parts of the net stand in its file.
    """

    command: str
    input: str
    net: Net
    verdicts: Sequence[Verdict]
    discipline: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)
    course: Sequence[str] = ()
    notes: Sequence[Diagnostic] = ()
    table: Sequence[Coordinated] = ()
    assumptions: Sequence[str] = ()
    standing: Sequence[Standing] = ()
    files: Sequence[str] = ()
    binding: str = ""
    run: Mapping[str, Any] = field(default_factory=dict)
    bundle: Mapping[str, str] = field(default_factory=dict)
    loop: Mapping[str, Any] = field(default_factory=dict)
    decomposition: Decomposition | None = None
    loops: Mapping[str, Net] = field(default_factory=dict)
    protocols: Mapping[str, ProtocolNet] = field(default_factory=dict)
    outages: Sequence[Outage] = ()
    faults: Sequence[OneFault] = ()
    refutations: Sequence[Refutation] = ()
    claims: Sequence[Verdict] = ()
    split: Mapping[str, Any] = field(default_factory=dict)
    page: str = ""
    again: bool = False
    positions: Positions | None = None

    def net_of(self, verdict: Verdict) -> Net:
        """The net that the runs of a verdict are of."""
        if verdict.name in self.protocols:
            return self.protocols[verdict.name].net
        return self.loops.get(verdict.name, self.net)

    @property
    def status(self) -> Status:
        """What all verdicts say together; evidence without any shows nothing."""
        from firable.nets.verdict import Status, overall

        return Status.UNKNOWN if self.command == "verify" and not self.verdicts else overall(self.verdicts)

    @property
    def exit_code(self) -> ExitCode:
        """The exit code that these verdicts mean."""
        from firable.nets.verdict import Status

        codes = {
            Status.PROVED: ExitCode.ALL_HOLD,
            Status.VIOLATED: ExitCode.VIOLATED,
            Status.UNKNOWN: ExitCode.UNKNOWN,
        }
        return codes[self.status]

    def to_json(self) -> dict[str, Any]:
        """The report as JSON data."""
        from firable.nets.interchange import net_digest

        data: dict[str, Any] = {
            "input": self.input,
            "cell": self.net.name,
            "digest": net_digest(self.net),
            "status": self.status.value,
        }
        if self.table:
            data["table"] = [_row_to_json(row) for row in self.table]
        for key in (
            "discipline",
            "course",
            "figures",
            "assumptions",
            "files",
            "binding",
            "run",
            "loop",
            "split",
            "bundle",
        ):
            if value := getattr(self, key):
                data[key] = list(value) if isinstance(value, tuple) else value
        if self.page:
            data["files"] = [*self.files, self.page]
        if self.standing:
            data["standing"] = [asdict(line) for line in self.standing]
        if self.outages:
            data["outages"] = [_outage_to_json(outage) for outage in self.outages]
        if self.faults:
            data["faults"] = [_fault_to_json(fault) for fault in self.faults]
        if self.notes:
            data["notes"] = [diagnostic_to_json(note) for note in self.notes]
        data["verdicts"] = [_verdict_to_json(verdict) for verdict in self.verdicts]
        return data


def _verdict_to_json(verdict: Verdict) -> dict[str, Any]:
    """A verdict, and of what is not as it should be the code and the hints that the text shows."""
    from firable.nets.rules import hints_of, rule_of

    data, hints = verdict.to_json(), [hint for _, hint in hints_of(verdict)]
    if hints or not verdict.holds:
        data["code"] = rule_of(verdict)
    if hints:
        data["hint"] = "; ".join(hints)
    return data


def _row_to_json(row: Coordinated) -> dict[str, Any]:
    return {
        "name": row.name,
        "parts": [{"controller": part.controller, "name": part.name} for part in row.parts],
        "description": row.description,
        **({} if row.at is None else {"at": row.at}),
    }


def _fault_to_json(one: OneFault) -> dict[str, Any]:
    keys = ("blocked_safely", "stands_still", "resumes")
    data: dict[str, Any] = {"fault": one.fault}
    for key, found in zip(keys, one.findings, strict=True):
        shown = {} if found.status is None else {"status": found.status.value, "by": list(found.by)}
        data[key] = {"says": found.says, **shown}
    return data


def _outage_to_json(outage: Outage) -> dict[str, Any]:
    if outage.bound:
        return {"dead": outage.name, "bound": outage.bound}
    return {
        "dead": outage.name,
        "at_once": list(outage.at_once),
        "at_last": list(outage.at_last),
        "goes_on": list(outage.goes_on),
        "still": list(outage.still),
        "running": list(outage.running),
    }


def diagnostic_to_json(diagnostic: Diagnostic) -> dict[str, Any]:
    """A diagnostic as JSON data."""
    data: dict[str, Any] = {
        "code": diagnostic.code,
        "severity": diagnostic.severity.value,
        "message": diagnostic.message,
    }
    if diagnostic.hint:
        data["hint"] = diagnostic.hint
    if diagnostic.span is not None:
        data |= {"file": diagnostic.span.file, "line": diagnostic.span.line, "column": diagnostic.span.column}
    return data


def exit_code_of(error: Diagnostic) -> ExitCode:
    """The exit code that an error means: an input error, but for a budget that ended before anything was known."""
    return ExitCode.UNKNOWN if error.code == "F3004" else ExitCode.INPUT_ERROR


def worst(codes: Iterable[ExitCode]) -> ExitCode:
    """The exit code of several reports together: an input error outweighs a violation, and that what is unknown."""
    order = (ExitCode.INPUT_ERROR, ExitCode.VIOLATED, ExitCode.UNKNOWN)
    found = set(codes)
    return next((code for code in order if code in found), ExitCode.ALL_HOLD)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command found: one report for each net that was read, and why the others were refused."""

    command: str
    reports: Sequence[Report]
    errors: Sequence[Diagnostic]
    exit_code: ExitCode


def document(
    command: str, reports: Sequence[Report], errors: Sequence[Diagnostic], exit_code: ExitCode
) -> dict[str, Any]:
    """What `--format json` prints."""
    from firable import __version__

    return {
        "firable_report": VERSION,
        "firable": __version__,
        "command": command,
        "exit_code": int(exit_code),
        "reports": [report.to_json() for report in reports],
        "errors": [diagnostic_to_json(error) for error in errors],
    }
