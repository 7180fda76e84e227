"""Proving a decomposition: every family of obligations, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from firable.decompose.proofs.families import FAMILIES
from firable.decompose.proofs.family import Task
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Verdict

TIMEOUT_MS: Final = 60_000


@dataclass(frozen=True)
class ProofReport:
    """A verdict for each obligation, and the text of each file of evidence by its name."""

    verdicts: tuple[Verdict, ...]
    files: Mapping[str, str]

    @property
    def holds(self) -> bool:
        """Whether every obligation is proved."""
        return all(verdict.holds for verdict in self.verdicts)


def prove(decomposition: Decomposition, *, timeout_ms: int = TIMEOUT_MS) -> ProofReport:
    """Decide every obligation of a decomposition; `timeout_ms` is for each, and running out of it is UNKNOWN.

    The files are linear in the arcs of the net, and so is the time (10,500 transitions in 20 s), but for groups of
    hundreds of transitions that compete, whose order takes z3 somewhat more.
    """
    task = Task(decomposition, timeout_ms)
    verdicts: list[Verdict] = []
    files: dict[str, str] = {}
    for family in FAMILIES:
        found = family.prove(task)
        verdicts += found.verdicts
        files.update(found.files)
    return ProofReport(tuple(verdicts), files)
