"""Documents of evidence as files: how long one is looked for, and under which name it is written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from firable.analysis.evidence.document import Document
    from firable.analysis.goal import Limits
    from firable.analysis.spaces.reachability import Budget

SECONDS: Final = 30.0
_SUFFIX: Final = ".evidence.json"
_NAME_MAX: Final = 100  # of a net, in the name of a file


def evidence_limits(budget: Budget) -> Limits:
    """What one document may take: as long as the search might, or half a minute, from now on."""
    from firable.analysis.deadline import Deadline
    from firable.analysis.goal import Limits

    seconds = SECONDS if budget.seconds is None else budget.seconds
    return Limits(Deadline.after(seconds), budget.memory_bytes)


def is_evidence(file: str) -> bool:
    """Whether a file that a command has written is a document of evidence, by its name."""
    return file.endswith((_SUFFIX, f"{_SUFFIX}.gz"))


def evidence_file(net: str, document: Document, kind: str = "") -> tuple[str, bytes]:
    """The name of the file of a document on a net, or on the net of a loop of that kind, and what is in it."""
    from firable.nets.bundle import file_stem

    data = document.to_bytes()
    stem = file_stem(net[:_NAME_MAX] or "net") + (f".{kind}" if kind else "") + _SUFFIX
    return (stem if data.startswith(b"{") else f"{stem}.gz"), data
