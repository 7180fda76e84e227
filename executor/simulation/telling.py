"""The steps of a simulated run in words, for whoever looks at one that has failed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from firable.executor.protocol.messages import Acknowledgement, Decision, Hello, Report, Vote, VoteRequest

COORDINATOR: Final = "coordinator"
_THE: Final = f"the {COORDINATOR}"


def told(log: Iterable[tuple[int, str, object]]) -> Iterator[str]:
    """The last steps in words."""
    for step, what, about in log:
        match about:
            case Report() | Vote() | Acknowledgement():
                words = f"{what} from {about.controller} at {about.coordinator or _THE}: {_shown(about)}"
            case VoteRequest() | Decision() | Hello():
                words = f"{what} from {about.coordinator or _THE} at {about.controller}: {_shown(about)}"
            case _:
                words = f"{what}: {_shown(about)}" if about else what
        yield f"{step:5}  {words}"


def _shown(about: object) -> str:
    match about:
        case Report(readiness=readiness):
            return f"enabled: {_names(readiness.transitions)}"
        case VoteRequest():
            return f"round {about.round}: promise {_names(about.transitions)}?"
        case Vote():
            return f"round {about.round}: {_names(about.promised)} promised"
        case Decision():
            return f"round {about.round}: {about.committed or 'nothing'} is committed"
        case Acknowledgement():
            return f"round {about.round} obeyed"
        case Hello():
            return f"has restarted, epoch {about.epoch}"
        case tuple():
            return " ".join(map(str, about))
    return str(about)


def _names(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "nothing"
