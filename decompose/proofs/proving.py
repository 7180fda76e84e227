"""Proving a decomposition: every family of obligations, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from firable.decompose.proofs.families import FAMILIES
from firable.decompose.proofs.family import Task
from firable.decompose.splitting.votes import Vote
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Status, Verdict

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


def prove(
    decomposition: Decomposition,
    *,
    timeout_ms: int = TIMEOUT_MS,
    cast: Sequence[Vote] | None = None,
    begins: Callable[[str], object] = lambda _: None,
) -> ProofReport:
    """Decide every obligation of a decomposition; `timeout_ms` is for each, and running out of it is UNKNOWN.

    `cast` are its votes as arcs and units have them, where somebody has them already; else units are looked for
    (`firable.decompose.splitting.votes`). `begins` is told the title of each family before its turn. Ctrl-C ends the
    proof: of the family that it met and of those to come there is one verdict each, UNKNOWN. The files are linear in
    the arcs of the net, but for parts at places that hundreds share, and so is the time (10,500 transitions in 20 s).
    """
    task = Task(decomposition, timeout_ms, cast)
    verdicts: list[Verdict] = []
    files: dict[str, str] = {}
    try:
        for family in FAMILIES:
            begins(family.title)
            found = family.prove(task)
            verdicts += found.verdicts
            files.update(found.files)
    except KeyboardInterrupt:
        missing = FAMILIES[FAMILIES.index(family) :]
        verdicts += [Verdict(one.name, Status.UNKNOWN, one.says, "nothing", bound="interrupted") for one in missing]
    return ProofReport(tuple(verdicts), files)
