"""Families of obligations: what each proves, and which of O1-O9 it serves.

A family takes a `Task` and gives verdicts with the files that they name. Most are static: they list obligations, which
`discharge` decides all in the same way. Those of the protocol explore or prove by induction, and discharge their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from firable.decompose.proofs.sides import Sides
from firable.decompose.splitting.votes import Vote
from firable.nets.decomposition import Decomposition
from firable.nets.verdict import Verdict


@dataclass(frozen=True)
class Task:
    """The decomposition that is to be proved; `timeout_ms` is for each question to a solver.

    `cast` are its votes as arcs and units have them, where somebody has them already.
    """

    decomposition: Decomposition
    timeout_ms: int
    cast: Sequence[Vote] | None = None

    @cached_property
    def sides(self) -> Sides:
        """Both sides of it, looked up once for all families."""
        return Sides(self.decomposition, self.cast)


@dataclass(frozen=True)
class Proved:
    """What a family found: its verdicts, and the text of each file of evidence that they name."""

    verdicts: Sequence[Verdict]
    files: Mapping[str, str] = field(default_factory=dict)


class Kind(StrEnum):
    """On what a family's proofs rest."""

    STATIC = "proved statically"
    PROTOCOL = "by the protocol proof"


@dataclass(frozen=True)
class Family:
    """Some obligations, of which the verdicts are named `name` or `name.SUBJECT`.

    With `words` they are named so with one of these instead, and those of the family rest on its file: others of these
    names may be shown otherwise.

    `title` is how a report calls it, `says` what it proves in a line; `serves` are the obligations of SEMANTICS that
    it proves, whole or in part.
    """

    name: str
    title: str
    says: str
    prove: Callable[[Task], Proved]
    serves: tuple[str, ...] = ()
    kind: Kind = Kind.STATIC
    apart: str = ""
    """The name of a family within this one that is told by itself."""
    words: tuple[str, ...] = ()

    def has(self, verdict: Verdict) -> bool:
        """Whether the verdict is one of this family."""
        if self.apart and _within(verdict.name, self.apart):
            return False
        if any(_within(verdict.name, word) for word in self.words):
            return f"{self.name}.smt2" in verdict.evidence
        return _within(verdict.name, self.name)


def _within(name: str, family: str) -> bool:
    return name == family or name.startswith(f"{family}.")


def proved_of(family: Family, verdicts: Iterable[Verdict]) -> list[Verdict]:
    """The verdicts of a family."""
    return [verdict for verdict in verdicts if family.has(verdict)]
