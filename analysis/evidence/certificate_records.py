"""The JSON of certificates, as records that refuse whatever is not of their shape.

Each record says how its data become the value (`of`), with all names looked up in the net. To add a kind of
certificate: its record here, and its row in `certificate_to_json`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Final, Literal

from pydantic import Field

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
    Reduction,
    Root,
    Rounds,
    Rule,
    Step,
    StubbornSets,
    Theorem,
    TheoremName,
    Unfolded,
    Whole,
)
from firable.analysis.evidence.claim_records import Hexadecimal, Natural, Sets, known
from firable.nets.formula import format_formula, parse_formula
from firable.nets.net import Net
from firable.nets.records import Many, Named, Record

DEPTH_MAX: Final = 1_000
ROUNDS_MAX: Final = 1_000_000
_DIGITS_MAX: Final = 4_000  # of one number: Python prints up to 4,300 digits, and sums of these are printed, too
_NUMBER_MAX: Final = 10**_DIGITS_MAX

Firings = Many[Many[str]]


class _FiringSequenceRecord(Record):
    kind: Literal["firing-sequence"]
    firings: Firings
    cycle: Firings = Field(default_factory=list)

    def of(self, net: Net, _: Sequence[Markings | Diagram]) -> FiringSequence:
        """The certificate, its names looked up; so in all that follow."""
        return FiringSequence(_firings(net, self.firings), _firings(net, self.cycle))


class _SumRecord(Record):
    weights: Named[int]
    tokens: int


class _ClauseRecord(Record):
    marked: Many[str]
    empty: Many[str]


class _InvariantRecord(Record):
    kind: Literal["inductive-invariant"]
    equations: Many[_SumRecord]
    inequalities: Many[_SumRecord]
    clauses: Many[_ClauseRecord]
    depth: Annotated[int, Field(ge=0, le=DEPTH_MAX)]

    def of(self, net: Net, _: Sequence[Markings | Diagram]) -> InductiveInvariant:
        def weights(one: _SumRecord) -> tuple[tuple[str, int], ...]:
            if any(abs(number) >= _NUMBER_MAX for number in (one.tokens, *one.weights.values())):
                raise ValueError(f"a number of an invariant has more than {_DIGITS_MAX:,} digits")
            return tuple((known(name, net.place_index), weight) for name, weight in one.weights.items())

        return InductiveInvariant(
            tuple(Equation(weights(one), one.tokens) for one in self.equations),
            tuple(Clause(_places(net, one.marked), _places(net, one.empty)) for one in self.clauses),
            self.depth,
            tuple(Inequality(weights(one), one.tokens) for one in self.inequalities),
        )


class _RanksRecord(Record):
    kind: Literal["ranks"]
    ranks: Many[Annotated[int, Field(ge=-1)]]

    def of(self, _: Net) -> Ranks:
        return Ranks(tuple(self.ranks))


class _BackRecord(Record):
    kind: Literal["back"]
    transitions: Many[str]

    def of(self, net: Net) -> Back:
        return Back(tuple(known(name, net.transition_index) for name in self.transitions))


class _RoundsRecord(Record):
    kind: Literal["rounds"]
    rounds: Annotated[int, Field(ge=0, le=ROUNDS_MAX)]

    def of(self, _: Net) -> Rounds:
        return Rounds(self.rounds)


class _RootRecord(Record):
    kind: Literal["root"]
    root: Natural

    def of(self, _: Net) -> Root:
        return Root(self.root)


class _WholeRecord(Record):
    kind: Literal["whole"]

    def of(self, _: Net) -> Whole:
        return Whole()


_LabelRecord = Annotated[
    _RanksRecord | _BackRecord | _RoundsRecord | _RootRecord | _WholeRecord, Field(discriminator="kind")
]


class _LabellingRecord(Record):
    kind: Literal["labelling"]
    set: Natural
    labels: Many[_LabelRecord]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Labelling:
        return Labelling(_set(sets, self.set), tuple(label.of(net) for label in self.labels))


class _StubbornRecord(Record):
    kind: Literal["stubborn-sets"]
    set: Natural
    stubborn: Many[Hexadecimal]
    chosen: Many[Natural]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> StubbornSets:
        stubborn = tuple(int(one, 16) for one in self.stubborn)
        if any(one >> len(net.transitions) for one in stubborn):
            raise ValueError("a stubborn set holds a transition that the net does not have")
        return StubbornSets(_listed(sets, self.set), stubborn, tuple(self.chosen))


class _StepRecord(Record):
    rule: str
    moves: Many[Natural] = Field(default_factory=list)
    places: Many[str] = Field(default_factory=list)

    def of(self, net: Net) -> Step:
        return Step(Rule(self.rule), tuple(self.moves), _places(net, self.places))


class _ReductionRecord(Record):
    kind: Literal["reduction"]
    steps: Many[_StepRecord]
    part: Many[str]
    goal: str
    then: Annotated[_InvariantRecord | _LabellingRecord | _StubbornRecord, Field(discriminator="kind")] | None

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Reduction:
        steps = tuple(step.of(net) for step in self.steps)
        then = None if self.then is None else self.then.of(net, sets)
        return Reduction(steps, _places(net, self.part), parse_formula(self.goal), then)


_NeverRecord = Annotated[
    _InvariantRecord | _LabellingRecord | _StubbornRecord | _ReductionRecord, Field(discriminator="kind")
]


class _ContinuationRecord(Record):
    kind: Literal["continuation"]
    firings: Firings
    then: _NeverRecord

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Continuation:
        return Continuation(_firings(net, self.firings), self.then.of(net, sets))


class _ProgressRecord(Record):
    kind: Literal["progress"]
    set: Natural
    ranks: Many[Many[Natural]]
    helpful: Many[Annotated[tuple[Many[Natural], str], Field(strict=False)]]  # not strict: a pair is an array here

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Progress:
        helpful = tuple((tuple(prefix), known(name, net.transition_index)) for prefix, name in self.helpful)
        if len({prefix for prefix, _ in helpful}) != len(helpful):
            raise ValueError("two transitions are to help in one rank")
        return Progress(_listed(sets, self.set), tuple(map(tuple, self.ranks)), helpful)


class _TheoremRecord(Record):
    kind: Literal["theorem"]
    name: Literal["marked-graph", "free-choice", "asymmetric-choice"]
    contact: _NeverRecord
    traps: Many[Many[str]]

    def of(self, net: Net, sets: Sequence[Markings | Diagram]) -> Theorem:
        traps = tuple(_places(net, trap) for trap in self.traps)
        return Theorem(TheoremName(self.name), self.contact.of(net, sets), traps)


class _UnfoldedRecord(Record):
    kind: Literal["unfolded"]
    set: Natural

    def of(self, _: Net, sets: Sequence[Markings | Diagram]) -> Unfolded:
        return Unfolded(_listed(sets, self.set))


CertificateRecord = Annotated[
    _FiringSequenceRecord
    | _InvariantRecord
    | _LabellingRecord
    | _StubbornRecord
    | _ReductionRecord
    | _ContinuationRecord
    | _ProgressRecord
    | _TheoremRecord
    | _UnfoldedRecord,
    Field(discriminator="kind"),
]
"""The record of any certificate."""


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
        case Reduction(steps, part, goal, rest):
            return {
                "kind": "reduction",
                "steps": list(map(_step_to_json, steps)),
                "part": list(part),
                "goal": format_formula(goal),
                "then": None if rest is None else certificate_to_json(rest, sets),
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


def _step_to_json(step: Step) -> dict[str, Any]:
    named = {"moves": list(step.moves), "places": list(step.places)}
    return {"rule": step.rule.value} | {key: value for key, value in named.items() if value}


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
