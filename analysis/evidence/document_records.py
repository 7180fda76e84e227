"""The JSON of claims and certificates, as records that refuse whatever is not of their shape.

Each record says how its data become the value (`of`), with all names looked up in the net. To add a kind of
certificate: its record here, and its row in `certificate_to_json`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from firable.analysis.evidence.certificate import (
    Back,
    Certificate,
    Clause,
    Continuation,
    Diagram,
    Equation,
    FiringSequence,
    InductiveInvariant,
    Inequality,
    Label,
    Labelling,
    Markings,
    Progress,
    Ranks,
    Root,
    Rounds,
    StubbornSets,
    Theorem,
    TheoremName,
    Unfolded,
    Whole,
)
from firable.analysis.evidence.claims import STATE_GOALS, TRUE, Claim, ClaimKind
from firable.nets.formula import Formula, Holds, format_formula, parse_formula
from firable.nets.net import Fairness, Net
from firable.nets.temporal import Logic, Temporal, format_temporal, logics, parse_temporal
from firable.nets.temporal_parts import atoms_in

DEPTH_MAX: Final = 1_000
ROUNDS_MAX: Final = 1_000_000

Natural = Annotated[int, Field(ge=0)]
Firings = list[list[str]]
Hexadecimal = Annotated[str, Field(pattern=r"^(0|[1-9a-f][0-9a-f]*)$")]


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ClaimRecord(_Record):
    """A claim; what a kind of claim does not speak of is left out."""

    kind: ClaimKind
    goal: str = ""
    then: str = ""
    fairness: Fairness = Fairness.NONE
    fires: list[str] = []

    model_config = ConfigDict(extra="forbid", strict=False, frozen=True)  # not strict: an enumeration is a string here

    def of(self, net: Net) -> Claim:
        """The claim, its names looked up."""
        goal: Temporal = TRUE
        if self.goal:
            goal = parse_formula(self.goal) if self.kind in STATE_GOALS else parse_temporal(self.goal)
        if self.kind not in STATE_GOALS:
            wanted = Logic.CTL if self.kind is ClaimKind.CTL else Logic.LTL
            if wanted not in logics(goal):
                raise ValueError(f"'{self.goal}' is no formula of {wanted.upper()}")
        then: Formula = parse_formula(self.then) if self.then else TRUE
        for formula in (goal, then):
            for atom in atoms_in(formula):
                if isinstance(atom, Holds):
                    known(atom.place, net.place_index)
                else:
                    known(atom.transition, net.transition_index)
        fires = tuple(known(name, net.transition_index) for name in self.fires)
        return Claim(self.kind, goal, then, self.fairness, fires)


def claim_to_json(claim: Claim) -> dict[str, Any]:
    """The data of a claim."""
    data: dict[str, Any] = {"kind": claim.kind.value, "goal": format_temporal(claim.goal)}
    if claim.kind in STATE_GOALS:
        data["goal"] = format_formula(claim.state_goal)
    if claim.then != TRUE:
        data["then"] = format_formula(claim.then)
    if claim.fairness is not Fairness.NONE:
        data["fairness"] = claim.fairness.value
    if claim.fires:
        data["fires"] = list(claim.fires)
    return data


class _MarkingsRecord(_Record):
    kind: Literal["markings"]
    markings: list[Hexadecimal]

    def space(self, net: Net) -> Markings:
        """The set."""
        markings = tuple(int(marking, 16) for marking in self.markings)
        if any(marking >> len(net.places) for marking in markings):
            raise ValueError("a marking holds a place that the net does not have")
        return Markings(markings)


class _DiagramRecord(_Record):
    kind: Literal["diagram"]
    order: list[str]
    rows: list[Annotated[list[Natural], Field(min_length=3, max_length=3)]]
    roots: Annotated[list[Natural], Field(min_length=1)]

    def space(self, net: Net) -> Diagram:
        """The set."""
        order = tuple(known(name, net.place_index) for name in self.order)
        return Diagram(order, tuple((row[0], row[1], row[2]) for row in self.rows), tuple(self.roots))


@dataclass
class Sets:
    """The sets of a document, each once."""

    spaces: list[Markings | Diagram] = field(default_factory=list)

    def number(self, space: Markings | Diagram) -> int:
        """The number of a set."""
        for number, known_ in enumerate(self.spaces):
            if known_ is space:
                return number
        self.spaces.append(space)
        return len(self.spaces) - 1

    def to_json(self) -> list[dict[str, Any]]:
        """The data of all sets."""
        return [
            {"kind": "markings", "markings": [f"{marking:x}" for marking in space.markings]}
            if isinstance(space, Markings)
            else {
                "kind": "diagram",
                "order": list(space.order),
                "rows": [list(row) for row in space.rows],
                "roots": list(space.roots),
            }
            for space in self.spaces
        ]


class _FiringSequenceRecord(_Record):
    kind: Literal["firing-sequence"]
    firings: Firings
    cycle: Firings = []

    def of(self, net: Net, _: Sequence[Markings | Diagram]) -> FiringSequence:
        """The certificate, its names looked up; so in all that follow."""
        return FiringSequence(_firings(net, self.firings), _firings(net, self.cycle))


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

    def of(self, net: Net, _: Sequence[Markings | Diagram]) -> InductiveInvariant:
        def weights(one: _SumRecord) -> tuple[tuple[str, int], ...]:
            return tuple((known(name, net.place_index), weight) for name, weight in one.weights.items())

        return InductiveInvariant(
            tuple(Equation(weights(one), one.tokens) for one in self.equations),
            tuple(Clause(_places(net, one.marked), _places(net, one.empty)) for one in self.clauses),
            self.depth,
            tuple(Inequality(weights(one), one.tokens) for one in self.inequalities),
        )


class _RanksRecord(_Record):
    kind: Literal["ranks"]
    ranks: list[Annotated[int, Field(ge=-1)]]

    def of(self, _: Net) -> Ranks:
        return Ranks(tuple(self.ranks))


class _BackRecord(_Record):
    kind: Literal["back"]
    transitions: list[str]

    def of(self, net: Net) -> Back:
        return Back(tuple(known(name, net.transition_index) for name in self.transitions))


class _RoundsRecord(_Record):
    kind: Literal["rounds"]
    rounds: Annotated[int, Field(ge=0, le=ROUNDS_MAX)]

    def of(self, _: Net) -> Rounds:
        return Rounds(self.rounds)


class _RootRecord(_Record):
    kind: Literal["root"]
    root: Natural

    def of(self, _: Net) -> Root:
        return Root(self.root)


class _WholeRecord(_Record):
    kind: Literal["whole"]

    def of(self, _: Net) -> Whole:
        return Whole()


_LabelRecord = Annotated[
    _RanksRecord | _BackRecord | _RoundsRecord | _RootRecord | _WholeRecord, Field(discriminator="kind")
]


class _LabellingRecord(_Record):
    kind: Literal["labelling"]
    set: Natural
    labels: list[_LabelRecord]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Labelling:
        return Labelling(_set(sets, self.set), tuple(label.of(net) for label in self.labels))


class _StubbornRecord(_Record):
    kind: Literal["stubborn-sets"]
    set: Natural
    stubborn: list[Hexadecimal]
    chosen: list[Natural]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> StubbornSets:
        stubborn = tuple(int(one, 16) for one in self.stubborn)
        if any(one >> len(net.transitions) for one in stubborn):
            raise ValueError("a stubborn set holds a transition that the net does not have")
        return StubbornSets(_listed(sets, self.set), stubborn, tuple(self.chosen))


_NeverRecord = Annotated[_InvariantRecord | _LabellingRecord | _StubbornRecord, Field(discriminator="kind")]


class _ContinuationRecord(_Record):
    kind: Literal["continuation"]
    firings: Firings
    then: _NeverRecord

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Continuation:
        return Continuation(_firings(net, self.firings), self.then.of(net, sets))


class _ProgressRecord(_Record):
    kind: Literal["progress"]
    set: Natural
    ranks: list[list[Natural]]
    helpful: list[tuple[list[Natural], str]]

    model_config = ConfigDict(extra="forbid", strict=False, frozen=True)  # not strict: a pair is an array here

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Progress:
        helpful = tuple((tuple(prefix), known(name, net.transition_index)) for prefix, name in self.helpful)
        if len({prefix for prefix, _ in helpful}) != len(helpful):
            raise ValueError("two transitions are to help in one rank")
        return Progress(_listed(sets, self.set), tuple(map(tuple, self.ranks)), helpful)


class _TheoremRecord(_Record):
    kind: Literal["theorem"]
    name: Literal["marked-graph", "free-choice", "asymmetric-choice"]
    contact: _NeverRecord
    traps: list[list[str]]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Theorem:
        traps = tuple(_places(net, trap) for trap in self.traps)
        return Theorem(TheoremName(self.name), self.contact.of(net, sets), traps)


class _UnfoldedRecord(_Record):
    kind: Literal["unfolded"]
    set: Natural

    def of(self, _: Net, sets: Sequence[Markings | Diagram]) -> Unfolded:
        return Unfolded(_listed(sets, self.set))


class _ShownRecord(_Record):
    claim: ClaimRecord
    certificate: Annotated[
        _FiringSequenceRecord
        | _InvariantRecord
        | _LabellingRecord
        | _StubbornRecord
        | _ContinuationRecord
        | _ProgressRecord
        | _TheoremRecord
        | _UnfoldedRecord,
        Field(discriminator="kind"),
    ]


class _VerdictRecord(_Record):
    name: str
    status: Literal["proved", "violated"]
    query: str
    lacking: str
    shown: list[_ShownRecord]


class EvidenceRecord(_Record):
    """The whole document."""

    firable_evidence: Literal[2]
    seal: str
    digest: str
    discipline: Literal["interleaving", "step"]
    verdicts: list[_VerdictRecord]
    sets: list[Annotated[_MarkingsRecord | _DiagramRecord, Field(discriminator="kind")]]
    net: dict[str, Any]


def certificate_to_json(certificate: Certificate, sets: Sets) -> dict[str, Any]:
    """The data of a certificate; sets are named by their numbers."""

    def sums(of: Sequence[Equation | Inequality]) -> list[dict[str, Any]]:
        return [{"weights": dict(one.weights), "tokens": one.tokens} for one in of]

    def lists(of: Iterable[Iterable[Any]]) -> list[list[Any]]:
        return [list(one) for one in of]

    match certificate:
        case FiringSequence(firings, cycle):
            return {"kind": "firing-sequence", "firings": lists(firings), "cycle": lists(cycle)}
        case InductiveInvariant(equations, clauses, depth, inequalities):
            return {
                "kind": "inductive-invariant",
                "equations": sums(equations),
                "inequalities": sums(inequalities),
                "clauses": [{"marked": list(clause.marked), "empty": list(clause.empty)} for clause in clauses],
                "depth": depth,
            }
        case Labelling(space, labels):
            return {"kind": "labelling", "set": sets.number(space), "labels": list(map(_label_to_json, labels))}
        case StubbornSets(space, stubborn, chosen):
            return {
                "kind": "stubborn-sets",
                "set": sets.number(space),
                "stubborn": [f"{one:x}" for one in stubborn],
                "chosen": list(chosen),
            }
        case Continuation(firings, then):
            return {"kind": "continuation", "firings": lists(firings), "then": certificate_to_json(then, sets)}
        case Progress(space, ranks, helpful):
            helping = [[list(prefix), name] for prefix, name in helpful]
            return {"kind": "progress", "set": sets.number(space), "ranks": lists(ranks), "helpful": helping}
        case Theorem(name, contact, traps):
            shown = certificate_to_json(contact, sets)
            return {"kind": "theorem", "name": name.value, "contact": shown, "traps": lists(traps)}
        case Unfolded(space):
            return {"kind": "unfolded", "set": sets.number(space)}


def _label_to_json(label: Label) -> dict[str, Any]:
    match label:
        case Ranks(ranks):
            return {"kind": "ranks", "ranks": list(ranks)}
        case Back(transitions):
            return {"kind": "back", "transitions": list(transitions)}
        case Rounds(rounds):
            return {"kind": "rounds", "rounds": rounds}
        case Root(root):
            return {"kind": "root", "root": root}
        case Whole():
            return {"kind": "whole"}


def known(name: str, names: Mapping[str, int]) -> str:
    """The name itself, which the net must have; `ValueError` where it has not."""
    if name not in names:
        raise ValueError(f"the net has no '{name}'")
    return name


def _places(net: Net, names: Iterable[str]) -> tuple[str, ...]:
    return tuple(known(name, net.place_index) for name in names)


def _firings(net: Net, firings: Firings) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(known(name, net.transition_index) for name in names) for names in firings)


def _set(sets: Sequence[Markings | Diagram], number: int) -> Markings | Diagram:
    if number >= len(sets):
        raise ValueError(f"there is no set {number}")
    return sets[number]


def _listed(sets: Sequence[Markings | Diagram], number: int) -> Markings:
    space = _set(sets, number)
    if not isinstance(space, Markings):
        raise ValueError(f"set {number} is not listed")
    return space
