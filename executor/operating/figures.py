"""Who counts: what a run shows to whoever keeps its figures (`metrics.py` does, for Prometheus)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from firable.executor.protocol.messages import Message
from firable.semantics.trace import Event


class Figures(Protocol):
    """A counter of what happens; it must not fail, and must not wait."""

    def taken_up(self, marking: Collection[str]) -> None:
        """The run goes on in this marking, after a restart."""
        ...

    def seen(self, event: Event) -> None:
        """An event of the trace."""
        ...

    def message(self, message: Message, *, again: bool = False) -> None:
        """A message between a controller and a coordinator, or one that is said again."""
        ...

    def inputs_coalesced(self, signal: str, changes: int) -> None:
        """Changes of a signal that came faster than they were read."""
        ...
