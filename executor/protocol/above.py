"""What a controller knows of the coordinators above it, and what it has promised in their rounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from firable.executor.protocol.messages import Readiness
from firable.executor.protocol.token_player import Compiled


@dataclass(frozen=True, slots=True)
class Promise:
    """A vote given in a round that is not decided yet, and what its yes parts write and read."""

    promised: frozenset[str]
    writes: int
    reads: int

    @classmethod
    def of(cls, parts: Mapping[str, Compiled], names: Iterable[str]) -> Promise:
        """The promise of these, of the parts of a controller."""
        promised = frozenset(names)
        yes = [parts[name] for name in promised]
        return cls(promised, union(part.writes for part in yes), union(part.reads for part in yes))


@dataclass(slots=True)
class Above:
    """What a controller knows of one coordinator that decides some of its parts."""

    name: str
    parts: frozenset[str]
    """The transitions that it decides and that have a part here."""
    mask: int
    """These parts, by their indexes."""
    readiness: Readiness = field(default_factory=lambda: Readiness(-1, frozenset()))
    ready_mask: int = 0
    """The parts that the readiness names."""
    told: int = -1
    """The sequence number of the newest report that was sent."""
    seen: int = -1
    """The sequence number of the newest report that is known to have arrived, in this epoch of the coordinator."""
    epoch: int = 0
    """The epoch of the coordinator."""
    closed_below: int = 0
    """Every round of the coordinator with a smaller number is closed."""
    kept_below: int = 0
    """What is kept of that."""
    dismissed: int = -1
    """The sequence number of the last report to which the coordinator has said that no round needs the controller."""


def union(masks: Iterable[int]) -> int:
    """All bits of several masks."""
    found = 0
    for mask in masks:
        found |= mask
    return found
