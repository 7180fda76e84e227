"""Evidence as a document: the net, what is claimed of it, and the certificate, in one JSON file.

It holds all that a check needs, so that it can be checked years later and far away. Three things tie it together. The
*seal* is the SHA-256 of all the rest: a byte that was damaged on the way is seen before anything is computed. The
*digest* is that of the net without descriptions, the same that verdicts and bundles carry, so that one sees at a glance
which net it speaks of. And the *check* (`firable.analysis.evidence.checker`) trusts neither: whoever edits the document
and seals it anew has either made another proof, or none.

    firable_evidence  1
    seal              SHA-256 of the canonical JSON of the other keys
    digest            of the net
    net               as in bundles (`firable.nets.interchange`)
    discipline        interleaving or step
    claim             kind: never, reachable or always_possible; goal: a state formula
    certificate       kind, and the data of `firable.analysis.evidence.certificate`; markings in hexadecimal, bit i
                      being place i of the net

Rejected: to name the net by its digest only, which makes evidence worthless where the file of the net is lost, and to
keep the obligations instead of the data they come from, which would let a forger choose what is to be proved.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from firable.analysis.evidence.certificate import (
    Certificate,
    Clause,
    Equation,
    FiringSequence,
    InductiveInvariant,
    Inequality,
    MarkingSet,
)
from firable.nets.diagnostics import Diagnostic, InputError, Span
from firable.nets.formula import (
    Formula,
    FormulaError,
    Holds,
    format_formula,
    names_in,
    parse_formula,
)
from firable.nets.interchange import canonical_json, net_digest, net_from_json, net_to_json
from firable.nets.net import Net
from firable.nets.source import printable, read_source
from firable.semantics.trace import Discipline

VERSION: Final = 1
SIZE_BYTES_MAX: Final = 2**28
DEPTH_MAX: Final = 1_000


class ClaimKind(StrEnum):
    """What is claimed of the reachable markings: the patterns of the same names in a net file."""

    NEVER = "never"  # the goal holds in no reachable marking
    REACHABLE = "reachable"  # it holds in one
    ALWAYS_POSSIBLE = "always_possible"  # from every reachable marking one can be reached where it holds


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement about the reachable markings of a net.

    >>> str(Claim(ClaimKind.NEVER, parse_formula("deadlock")))
    'never (deadlock)'
    """

    kind: ClaimKind
    goal: Formula

    def __str__(self) -> str:
        goal = format_formula(self.goal)
        match self.kind:
            case ClaimKind.NEVER:
                return f"never ({goal})"
            case ClaimKind.REACHABLE:
                return f"({goal}) is reachable, external gates free"
            case ClaimKind.ALWAYS_POSSIBLE:
                return f"from every reachable marking ({goal}) can be reached, external gates free"


@dataclass(frozen=True, slots=True)
class Evidence:
    """A claim about a net under a discipline, with what shows it."""

    net: Net
    discipline: Discipline
    claim: Claim
    certificate: Certificate

    def to_text(self) -> str:
        """The document; `evidence_from_text` reads it back."""
        data = {
            "firable_evidence": VERSION,
            "digest": net_digest(self.net),
            "discipline": self.discipline.value,
            "claim": {"kind": self.claim.kind.value, "goal": format_formula(self.claim.goal)},
            "certificate": _certificate_to_json(self.certificate),
            "net": net_to_json(self.net),
        }
        return json.dumps({"seal": seal(data), **data}, indent=1, ensure_ascii=False) + "\n"


def seal(data: Mapping[str, Any]) -> str:
    """The SHA-256 of the document without its seal, in hexadecimal."""
    return hashlib.sha256(canonical_json({key: value for key, value in data.items() if key != "seal"})).hexdigest()


def _certificate_to_json(certificate: Certificate) -> dict[str, Any]:
    def sums(of: Sequence[Equation | Inequality]) -> list[dict[str, Any]]:
        return [{"weights": dict(one.weights), "tokens": one.tokens} for one in of]

    match certificate:
        case FiringSequence(firings):
            return {"kind": "firing-sequence", "firings": [list(fired) for fired in firings]}
        case InductiveInvariant(equations, clauses, depth, inequalities):
            return {
                "kind": "inductive-invariant",
                "equations": sums(equations),
                "inequalities": sums(inequalities),
                "clauses": [{"marked": list(clause.marked), "empty": list(clause.empty)} for clause in clauses],
                "depth": depth,
            }
        case MarkingSet(markings, distances):
            return {
                "kind": "marking-set",
                "markings": [f"{marking:x}" for marking in markings],
                "distances": list(distances),
            }


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _ClaimRecord(_Record):
    kind: Literal["never", "reachable", "always_possible"]
    goal: str


class _FiringSequenceRecord(_Record):
    kind: Literal["firing-sequence"]
    firings: list[list[str]]


class _SumRecord(_Record):
    weights: dict[str, int]
    tokens: int


class _ClauseRecord(_Record):
    marked: list[str]
    empty: list[str]


class _InvariantRecord(_Record):
    kind: Literal["inductive-invariant"]
    equations: list[_SumRecord]
    inequalities: list[_SumRecord]
    clauses: list[_ClauseRecord]
    depth: Annotated[int, Field(ge=0, le=DEPTH_MAX)]


class _MarkingSetRecord(_Record):
    kind: Literal["marking-set"]
    markings: list[Annotated[str, Field(pattern=r"^(0|[1-9a-f][0-9a-f]*)$")]]
    distances: list[Annotated[int, Field(ge=0)]]


class _EvidenceRecord(_Record):
    firable_evidence: Literal[1]
    seal: str
    digest: str
    discipline: Literal["interleaving", "step"]
    claim: _ClaimRecord
    certificate: Annotated[_FiringSequenceRecord | _InvariantRecord | _MarkingSetRecord, Field(discriminator="kind")]
    net: dict[str, Any]


def read_evidence(path: str | Path) -> Evidence:
    """Read a document of evidence; whether it shows what it claims is another question.

    Raises `InputError`: F1001, F1003 and F1004 where it cannot be read, F6001 where it is damaged or malformed.
    """
    source = read_source(path, SIZE_BYTES_MAX)
    return evidence_from_text(source.text, source.file)


def evidence_from_text(text: str, file: str = "") -> Evidence:
    """The evidence that `Evidence.to_text` wrote; raises `InputError` F6001 for a text that it does not write.

    Blanks between the values and the order of keys are free.
    """
    try:
        data = json.loads(text, object_pairs_hook=_without_doubles, parse_constant=_no_constant)
        record = _EvidenceRecord.model_validate(data)
        if seal(data) != record.seal:
            raise ValueError("its seal is not that of its content")
        evidence = _evidence(record)
    except InputError as error:
        raise _damaged(file, error.diagnostics[0].message) from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise _damaged(file, f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except (ValueError, RecursionError) as error:  # not JSON, or what is raised here
        raise _damaged(file, str(error)) from None
    return evidence


def _damaged(file: str, reason: str) -> InputError:
    message = f"the evidence is damaged or malformed: {printable(reason)}"
    hint = "make it anew: `firable check --evidence DIR` writes it"
    return InputError([Diagnostic("F6001", message, hint, span=Span(printable(file), 1, 1) if file else None)])


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands twice in one object")
    return found


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no value of JSON")


def _evidence(record: _EvidenceRecord) -> Evidence:
    net = net_from_json(record.net)
    if net_digest(net) != record.digest:
        raise ValueError("the digest is not that of the net")
    try:
        goal = parse_formula(record.claim.goal)
    except FormulaError as error:
        raise ValueError(f"the goal is not a formula: {error.message}") from None
    for atom in names_in(goal):
        _known(atom.place, net.place_index) if isinstance(atom, Holds) else _known(
            atom.transition, net.transition_index
        )
    claim = Claim(ClaimKind(record.claim.kind), goal)
    return Evidence(net, Discipline(record.discipline), claim, _certificate(record.certificate, net))


def _known(name: str, names: Mapping[str, int]) -> str:
    if name not in names:
        raise ValueError(f"the net has no '{name}'")
    return name


def _certificate(record: _FiringSequenceRecord | _InvariantRecord | _MarkingSetRecord, net: Net) -> Certificate:
    def weights(one: _SumRecord) -> tuple[tuple[str, int], ...]:
        return tuple((_known(name, net.place_index), weight) for name, weight in one.weights.items())

    def places(names: list[str]) -> tuple[str, ...]:
        return tuple(_known(name, net.place_index) for name in names)

    match record:
        case _FiringSequenceRecord():
            for fired in record.firings:
                for name in fired:
                    _known(name, net.transition_index)
            return FiringSequence(tuple(map(tuple, record.firings)))
        case _InvariantRecord():
            return InductiveInvariant(
                tuple(Equation(weights(one), one.tokens) for one in record.equations),
                tuple(Clause(places(one.marked), places(one.empty)) for one in record.clauses),
                record.depth,
                tuple(Inequality(weights(one), one.tokens) for one in record.inequalities),
            )
        case _MarkingSetRecord():
            markings = tuple(int(marking, 16) for marking in record.markings)
            if any(marking >> len(net.places) for marking in markings):
                raise ValueError("a marking holds a place that the net does not have")
            if record.distances and len(record.distances) != len(markings):
                raise ValueError("there are not as many distances as markings")
            return MarkingSet(markings, tuple(record.distances))
