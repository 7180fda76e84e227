"""What checking a bundle says of each of its verdicts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from firable.decompose.verification.refusal import NotShownError
from firable.nets.bundle import Bundle
from firable.nets.verdict import Verdict


@dataclass(frozen=True, slots=True)
class CheckedVerdict:
    """A verdict of a bundle: whether it is shown and by what, or why it is only claimed."""

    verdict: Verdict
    shown: bool
    method: str
    only_claimed: str = ""


@dataclass
class Examination:
    """A bundle while it is checked: which verdicts have been judged, and which files of evidence were of use."""

    bundle: Bundle
    checked: dict[str, CheckedVerdict] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    by_name: dict[str, Verdict] = field(init=False)

    def __post_init__(self) -> None:
        self.by_name = {}
        for verdict in self.bundle.verdicts:
            if verdict.name in self.by_name:
                raise NotShownError(f"there are two verdicts on '{verdict.name}'", "verdicts", verdict.name)
            self.by_name[verdict.name] = verdict

    def verdict(self, name: str) -> Verdict:
        """The verdict of this name, which must be there."""
        if name not in self.by_name:
            raise NotShownError(f"there is no verdict on '{name}'", "verdicts", name)
        return self.by_name[name]

    def text(self, file: str) -> str:
        """The text of a file of evidence, which must be there, and is of use."""
        if file not in self.bundle.evidence:
            raise NotShownError(f"the evidence '{file}' is missing", "evidence", file)
        self.used.add(file)
        return self.bundle.evidence[file]

    def judge(self, verdict: Verdict, *, shown: bool, method: str, only_claimed: str = "") -> None:
        """Say of a verdict whether it is shown."""
        self.checked[verdict.name] = CheckedVerdict(verdict, shown, method, only_claimed)

    def unjudged(self) -> Iterable[Verdict]:
        """The verdicts of which nothing was said yet."""
        return (verdict for verdict in self.bundle.verdicts if verdict.name not in self.checked)
