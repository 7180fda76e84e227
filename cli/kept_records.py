"""The JSON of an entry of the cache, as records that refuse whatever is not of their shape.

Who reads an entry goes by its figures without a look at their types, so one that somebody else has written is told
apart here. Rejected: the JSON Schema of reports, which says the same of figures; what reads it is no dependency.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from firable.nets.bundle_records import VerdictRecord
from firable.nets.document import given

_Number = Annotated[int, Field(ge=0)]
_Names = list[str]
_Pair = Annotated[_Names, Field(min_length=2, max_length=2)]
_Weights = dict[str, int]


class _Record(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", strict=True, frozen=True)


class _VectorsRecord(_Record):
    basis: list[_Weights] | None
    minimal: list[_Weights]
    dimension: _Number | None
    complete: bool
    uncovered: _Names


class _SetsRecord(_Record):
    minimal: list[_Names]
    complete: bool


class _StructureRecord(_Record):
    net_class: str
    pure: bool
    connected: bool
    strongly_connected: bool
    outside_of_its_theorems: _Names
    p_invariants: _VectorsRecord
    t_invariants: _VectorsRecord
    siphons: _SetsRecord
    traps: _SetsRecord
    siphons_without_marked_trap: list[_Names]
    siphons_exclude_deadlock: bool
    ended_early: Literal[""]  # else it is not kept


class _PairsRecord(_Record):
    by_input: list[_Pair]
    by_output: list[_Pair]


class _FiguresRecord(_Record):
    """What `Figures.to_json` of `firable.analysis.report` writes, and the structure where it was asked for."""

    markings: _Number
    edges: _Number | None
    complete: bool
    bytes_per_marking: float | None
    deadlocks: _Number | None
    doomed: _Number | None
    home: _Number | None
    reversible: bool | None
    live: bool | None
    dead: _Names | None
    nonlive: _Names | None
    contacts: dict[str, _Number] | None
    self_loops: _Names
    firable_in_initial_marking: _Names
    structural_conflicts: _PairsRecord | None
    effective_conflicts: _PairsRecord | None
    gate_races: list[_Pair] | None
    cut_short: _Names
    nonserialisable: list[_Names] | None
    structure: Annotated[_StructureRecord | None, BeforeValidator(given)] = None


class KeptRecord(_Record):
    """A whole entry."""

    verdicts: list[VerdictRecord]
    figures: _FiguresRecord
    course: _Names
