"""The files of a bundle that are not nets, as strict records: manifest, coordinator table, verdicts.

Whoever reads a bundle acts on it, so each value has exactly the type that the writer gives it, and an unknown or a
missing key is refused: pydantic says so in one place, and what is read needs no further look at its types. Reading by
hand was rejected: it took a `true` for a number wherever nobody thought of it, and had to catch the errors of our own
mistakes with those of the file's.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict

from firable.nets.decomposition import ArbitrationGroup, Coordinated, Decomposition, Part
from firable.nets.net import ArbitrationRule
from firable.nets.records import Named, Record, Row
from firable.nets.verdict import Cost, Cure, Status, Verdict, Wait, Weight, Witness


class VersionRecord(BaseModel):
    """What a manifest of any version begins with."""

    model_config = ConfigDict(defer_build=True, extra="ignore", strict=True, frozen=True)

    firable_bundle: int


class ManifestRecord(Record):
    """`manifest.json`: the SHA-256 of every other file, and a digest over the manifest itself."""

    firable_bundle: int
    cell: str
    members: Named[str]
    digest: str


class _CoordinatedRecord(Record):
    name: str
    number: int | None
    parts: Row[tuple[str, str]]
    description: str
    at: str | None


class _GroupRecord(Record):
    name: str
    sequence: Row[str]
    rest: Row[str]
    by: ArbitrationRule
    controller: str | None
    at: str | None


class TableRecord(Record):
    """`table.json`: what the coordinator decides."""

    coordinated: Row[_CoordinatedRecord]
    groups: Row[_GroupRecord]
    free: Row[tuple[str, str]] = ()

    def rows(self) -> tuple[Coordinated, ...]:
        """The transitions that the coordinator decides."""
        return tuple(
            Coordinated(row.name, row.number, tuple(Part(*part) for part in row.parts), row.description, row.at)
            for row in self.coordinated
        )

    def arbitration_groups(self) -> tuple[ArbitrationGroup, ...]:
        """The groups by which conflicts are decided."""
        return tuple(
            ArbitrationGroup(group.name, group.sequence, group.rest, group.by, group.controller, group.at)
            for group in self.groups
        )


def table_to_json(decomposition: Decomposition) -> dict[str, Any]:
    """The data of `TableRecord` for a decomposition."""
    return {
        "coordinated": [
            {
                "name": row.name,
                "number": row.number,
                "parts": [[part.controller, part.name] for part in row.parts],
                "description": row.description,
                "at": row.at,
            }
            for row in decomposition.coordinated
        ],
        "groups": [
            {
                "name": group.name,
                "sequence": list(group.sequence),
                "rest": list(group.rest),
                "by": group.by.value,
                "controller": group.controller,
                "at": group.at,
            }
            for group in decomposition.groups
        ],
        **({"free": [list(pair) for pair in decomposition.free]} if decomposition.free else {}),
    }


class _WaitRecord(Record):
    place: str
    transition: str
    lacks: str
    wanted: bool
    holder: str
    by: Row[str]

    def wait(self) -> Wait:
        """The wait."""
        return Wait(self.place, self.transition, self.lacks, self.wanted, self.holder, self.by)


class _WitnessRecord(Record):
    firings: Row[Row[str]]
    cycle: Row[Row[str]]
    marking: Row[str]
    assignment: Row[tuple[str, bool]]
    note: str
    waits: Row[_WaitRecord] = ()

    def witness(self) -> Witness:
        """The witness."""
        waits = tuple(wait.wait() for wait in self.waits)
        return Witness(self.firings, self.cycle, self.marking, self.assignment, self.note, waits)


class _CureRecord(Record):
    changes: Row[str]
    proves: Row[str]
    loses: Row[str]
    markings: int

    def cure(self) -> Cure:
        """The cure."""
        return Cure(self.changes, self.proves, self.loses, self.markings)


class VerdictRecord(Record):
    """What `Verdict.to_json` writes."""

    name: str
    status: Status
    statement: str
    method: str
    weight: Weight
    code: str = ""
    hint: str = ""
    bound: str = ""
    subjects: Row[str] = ()
    witness: _WitnessRecord | None = None
    evidence: Row[str] = ()
    markings: int | None = None
    edges: int | None = None
    discipline: str = ""
    cures: Row[_CureRecord] = ()

    def verdict(self) -> Verdict:
        """The verdict."""
        return Verdict(
            self.name,
            self.status,
            self.statement,
            self.method,
            self.weight,
            self.code,
            self.hint,
            self.bound,
            self.subjects,
            self.witness.witness() if self.witness else None,
            self.evidence,
            Cost(self.markings, self.edges),
            self.discipline,
            cures=tuple(record.cure() for record in self.cures),
        )


class JudgedRecord(Record):
    """`verdicts.json`: the verdicts, and the SHA-256 of each file that they are about."""

    of: Named[str]
    verdicts: Row[VerdictRecord]

    def read(self) -> tuple[Verdict, ...]:
        """The verdicts."""
        return tuple(record.verdict() for record in self.verdicts)
