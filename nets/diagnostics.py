"""Diagnostics: what is wrong with an input, where, and what to write instead.

Every refusal of firable carries a code, a position, the excerpt and a hint, and all refusals of one input are
reported together. The model (`Net`) knows nothing of files: it names the *subject* of a problem, a path such as
`("transitions", "G1", "from", "conveyor.cvx")`, and the reader that built the net knows where each subject stands in
its text. So the rules of a well-formed net are written once, for text, PNML and nets built by a program.

To add a diagnostic: one row in `CODES`, the place that reports it, a case in the tests of its room, a page
in docs/codes with an example that is run (or a row in tests/support/exact_words.py).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from typing import Final

Subject = tuple[str, ...]
"""What a problem is about: a path of names from the root of the net, e.g. `("places", "robot.free")`."""


DIAGNOSTICS_MAX: Final = 80
"""So many problems of one input are shown."""
PROBLEMS_MAX: Final = 100
"""So many are looked for: enough to join and to read, where a file of noise has millions."""


class Severity(StrEnum):
    """How bad a diagnostic is; only errors refuse the input."""

    ERROR = "error"
    WARNING = "warning"


CODES: Final[dict[str, str]] = {
    # F1: the text
    "F1001": "the file cannot be read",
    "F1002": "the file is empty",
    "F1003": "the file is too large",
    "F1004": "not a text file",
    "F1005": "not valid YAML",
    "F1006": "duplicate key",
    "F1007": "ambiguous YAML",
    "F1008": "unknown key",
    "F1009": "missing key",
    "F1010": "wrong kind of value",
    "F1011": "unsupported version of the format",
    "F1012": "not a formula",
    "F1013": "not valid PNML",
    "F1014": "PNML that this toolkit cannot represent",
    "F1015": "not valid JSON",
    "F1016": "not carried over by the conversion",
    "F1017": "the file cannot be written",
    "F1018": "not a file of queries",
    "F1019": "the file has changed since it was read",
    "F1020": "an edit that cannot be made",
    "F1021": "a layout file that names something twice, or what the net does not have",
    # F2: the net
    "F2001": "duplicate name",
    "F2002": "unknown place",
    "F2003": "unknown signal",
    "F2004": "unknown transition",
    "F2005": "unknown controller",
    "F2006": "more than one token on a place",
    "F2007": "double arc",
    "F2008": "a gate whose source is a transition",
    "F2009": "self-loop",
    "F2010": "a gate that is both internal and external",
    "F2011": "a place or signal without an owner",
    "F2012": "not a name",
    "F2013": "malformed arbiter",
    "F2014": "a completion signal without a command",
    "F2015": "more than one coordinator",
    "F2016": "duplicate transition number",
    "F2017": "an arc to something that is not a place",
    "F2018": "a signal of two kinds",
    "F2019": "the owner and the name of a place or signal disagree",
    "F2020": "a change of the net that would change its meaning",
    "F2021": "unknown source of a gate",
    "F2022": "double gate",
    "F2023": "more than one owner",
    "F2024": "a place that stands for two things",
    "F2025": "unknown step, sensor or role of a task",
    "F2026": "a template that cannot be filled",
    "F2027": "controllers that are no tree",
    "F2028": "a time limit without a completion",
    "F2029": "not a time limit",
    "F2030": "an expectation of an unknown verdict",
    "F2031": "a place that nothing fills",
    "F2032": "a command that the next one overtakes",
    # F3: analysis
    "F3001": "a machine is started that no command ever stops",
    "F3002": "an output signal on a place marked in M0",
    "F3003": "conflicting commands to one machine",
    "F3004": "not decided",
    "F3005": "a completion signal awaited by two commands at once",
    "F3006": "a method that does not know the discipline",
    "F3007": "a firing with too many outcomes",
    "F3010": "a transition held back by a full output place",
    "F3011": "a deadlock can be reached",
    "F3012": "a deadlock that can no longer be avoided",
    "F3013": "a dead transition",
    "F3014": "a transition that can be lost for good",
    "F3015": "the initial marking can be lost for good",
    "F3016": "no marking can always be reached again",
    "F3017": "transitions that share a place",
    "F3018": "transitions that compete at a reachable marking",
    "F3019": "a transition that closes a gate of another one",
    "F3020": "a step that no order of firings replays",
    "F3021": "a transition that starves under the arbiters",
    "F3022": "a property of the file does not hold",
    "F3023": "a query does not hold",
    "F3024": "a verdict that the file expects otherwise",
    "F3030": "a command to a machine that is busy",
    "F3031": "an accident of the machines",
    "F3032": "a completion that is lost",
    "F3033": "a gate that no machine ever opens",
    "F3034": "a fault of a machine that the cell does not get over",
    # F4: decomposition
    "F4001": "the net cannot be split",
    "F4002": "an obligation is refuted",
    "F4003": "the net may not be bundled",
    "F4004": "no partition was found",
    "F4005": "a vote that another firing takes back",
    "F4006": "the running protocol does not behave as the net",
    "F4010": "unknown task",
    "F4011": "a role or parameter of a task that is not filled, or not rightly",
    "F4012": "a resource that a task takes twice, keeps or loses",
    "F4013": "a task that violates a condition of refinement",
    "F4014": "a place that cannot be opened to its task",
    "F4015": "a timeout that waits for a decision",
    # F5: running
    "F5001": "the bundle is damaged or has been changed",
    "F5002": "the bundle is not proved",
    "F5003": "the plant file does not fit the bundle",
    "F5004": "the trace is not a trace of the net",
    "F5005": "the trace file is malformed",
    "F5006": "a trace in which no machine is seen at work",
    "F5007": "a run that did not come to its end",
    "F5008": "machines that did what their plant file does not allow",
    "F5009": "a time limit that the machine never keeps",
    "F5020": "a host that may not take part",
    "F5021": "a link that cannot be opened, or has failed",
    "F5022": "a link that is open to the network",
    "F5023": "a bundle without the signature that is demanded",
    "F5024": "a key or signatures that are none, or damaged",
    "F5025": "a host without the journal that it had",
    "F5026": "a secret that everybody on this host can read",
    "F5027": "a password that anybody on the network can read",
    "F5031": "the journal of another bundle",
    "F5032": "the journal is damaged",
    "F5033": "the journal is in use",
    "F5034": "the journal cannot be used",
    "F5035": "the simulated cell of another run",
    "F5036": "a journal from which a new bundle goes on",
    "F5050": "a run that a new bundle may not go on from",
    "F5051": "a marking that the new bundle does not reach",
    "F5060": "an operator's endpoint that is open to everybody",
    "F5061": "an address that cannot be served",
    "F5062": "a certificate that cannot be used",
    "F5063": "a run that cannot be operated",
    "F5070": "a request of the page that cannot be answered",
    "F5101": "the binding does not fit the net",
    "F5102": "an address or a value that does not fit the device",
    "F5103": "unknown or unusable driver",
    "F5104": "a device that cannot be served here",
    "F5105": "a device with machines of several hosts",
    "F5106": "a device that another program commands",
    "F5107": "machines that nothing stops",
    # F6: evidence
    "F6001": "the evidence is damaged or malformed",
    "F6002": "the evidence does not show what it claims",
    # F9: our own fault
    "F9001": "internal error",
}
"""The code of every diagnostic and its title."""


@dataclass(frozen=True, slots=True)
class Span:
    """Where a diagnostic points: a file, a line and a column (both from 1), and the text of the line.

    The excerpt of a very long line is a window of it; `excerpt_column` is the column of its first character.
    """

    file: str
    line: int
    column: int
    excerpt: str = ""
    length: int = 1
    excerpt_column: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One thing that is wrong, or questionable, in an input."""

    code: str
    message: str
    hint: str = ""
    subject: Subject = ()
    span: Span | None = None
    severity: Severity = Severity.ERROR

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise ValueError(f"{self.code} is not in the table of codes")

    @property
    def title(self) -> str:
        """The title of the code."""
        return CODES[self.code]

    def __str__(self) -> str:
        from firable.nets.source import one_line  # which reads files, and says what is wrong with them

        where = f"{self.span}: " if self.span else ""
        lines = [one_line(f"{where}{self.severity}[{self.code}]: {self.message}")]
        if self.span and self.span.excerpt:
            gutter = f"{self.span.line:5d} | "
            offset = self.span.column - self.span.excerpt_column
            length = max(1, min(self.span.length, len(self.span.excerpt) - offset))
            marker = " " * (len(gutter) + offset) + "^" * length
            lines += [gutter + self.span.excerpt, marker]
        if self.hint:
            lines.append(one_line(f"  hint: {self.hint}"))
        return "\n".join(lines)


class Problems(list[Diagnostic]):
    """The problems of one input, as they are found: the first `PROBLEMS_MAX` of those that are reported."""

    @property
    def is_full(self) -> bool:
        """Whether no more are kept."""
        return len(self) >= PROBLEMS_MAX

    def report(self, problem: Diagnostic) -> None:
        """Keep one more."""
        if not self.is_full:
            self.append(problem)


def bounded(problems: list[Diagnostic]) -> list[Diagnostic]:
    """The first of the diagnostics; the last one of them tells how many are left out."""
    if len(problems) <= DIAGNOSTICS_MAX:
        return problems
    shown, left = problems[:DIAGNOSTICS_MAX], len(problems) - DIAGNOSTICS_MAX
    last = shown[-1]
    hint = f"{last.hint} ({left:,} more problems are not shown)".strip()
    return [*shown[:-1], replace(last, hint=hint)]


class InputError(Exception):
    """The input is refused; `diagnostics` says why, the most important reason first."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics: tuple[Diagnostic, ...] = tuple(diagnostics)
        if not self.diagnostics:
            raise ValueError("an input is refused for at least one reason")
        super().__init__("\n".join(str(diagnostic) for diagnostic in self.diagnostics))


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """The start of a hint that names the closest known name, or nothing where none is close.

    The same name under another owner is close, where one owner alone has it; and so is one that looks the same, because
    an accent is a character of its own in one of the two.

    >>> did_you_mean("lathe.belt", ["conveyor.belt", "lathe.free"])
    "did you mean 'conveyor.belt'? "
    """
    from difflib import get_close_matches
    from unicodedata import normalize

    if not name.isascii() and (alike := next((x for x in known if normalize("NFC", x) == normalize("NFC", name)), "")):
        return f"'{alike}' looks the same, and is written with other characters: copy it from there; "
    owner, _, own = name.rpartition(".")
    elsewhere = [one for one in known[:20_000] if one.endswith(f".{own}")] if owner else []
    if len(elsewhere) == 1 and not _is_opposite(name, elsewhere[0]):
        return f"did you mean '{elsewhere[0]}'? "
    # Comparing is slow where both are many or long: a hint is not worth a minute.
    known = [candidate for candidate in known if abs(len(candidate) - len(name)) <= 4][:2000] if len(name) <= 80 else []
    close = filter(partial(_is_slip, name), get_close_matches(name, known, n=5, cutoff=0.6))
    return next((f"did you mean '{one}'? " for one in close), "")


def _is_slip(name: str, meant: str) -> bool:
    """Whether each part of a name is as it is meant, but for a slip: what they share, such as an owner, says nothing.

    >>> _is_slip("lathe.fere", "lathe.free"), _is_slip("lathe.reset", "lathe.free"), _is_slip("p.unlocked", "p.locked")
    (True, False, False)
    """
    parts, others = name.split("."), meant.split(".")
    if _is_opposite(name, meant) or _is_opposite(parts[-1], others[-1]):
        return False
    if len(parts) != len(others):
        return True
    return all(
        a.startswith(b) or b.startswith(a) or _edits(a, b) <= max(1, max(len(a), len(b)) // 3)
        for a, b in zip(parts, others, strict=True)
    )


_DENIAL: Final = re.compile(r"(?:no?|non|not|un|in|dis|de)[._-]*|-")
_DENIAL_BEHIND: Final = re.compile(r"[._-](?:n|not)")


def _is_opposite(a: str, b: str) -> bool:
    """Whether one word denies the other, as `nok`, `not_ok`, `ok_n` and `unlocked` do: that is no slip.

    >>> _is_opposite("nok", "ok"), _is_opposite("part", "part_n"), _is_opposite("parts", "part")
    (True, True, False)
    """
    short, long = sorted((a.lower(), b.lower()), key=len)
    if long.endswith(short) and _DENIAL.fullmatch(long.removesuffix(short)):
        return True
    return long.startswith(short) and _DENIAL_BEHIND.fullmatch(long.removeprefix(short)) is not None


def _edits(a: str, b: str) -> int:
    """How many letters to write, strike out, replace, or exchange with the next one lead from one word to another."""
    before: list[int] = []
    row: list[int] = [*range(len(b) + 1)]
    for i, x in enumerate(a, 1):
        before, above, row = row, before, [i]
        for j, y in enumerate(b, 1):
            row.append(min(before[j] + 1, row[j - 1] + 1, before[j - 1] + (x != y)))
            if i > 1 and j > 1 and x == b[j - 2] and y == a[i - 2]:
                row[j] = min(row[j], above[j - 2] + 1)
    return row[-1]


def with_meant(message: str, name: str, known: Sequence[str]) -> str:
    """A message about a name that nothing has, with the known name that was probably meant.

    >>> with_meant("there is no 'jso'.", "jso", ["json", "text"])
    "there is no 'jso'; did you mean 'json'?"
    """
    near = did_you_mean(name, known).rstrip()
    return f"{message.removesuffix('.')}; {near}" if near else message
