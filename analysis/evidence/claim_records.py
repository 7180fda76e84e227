"""The JSON of claims and of sets of markings, as records that refuse whatever is not of their shape.

Each record says how its data become the value (`of`), with all names looked up in the net.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from firable.analysis.evidence.certificate import Diagram, Markings
from firable.analysis.evidence.claims import STATE_GOALS, TRUE, Claim, ClaimKind
from firable.nets.formula import Formula, Holds, format_formula, parse_formula
from firable.nets.net import Fairness, Marking, Net
from firable.nets.records import Many, Record
from firable.nets.temporal import Logic, Temporal, format_temporal, logics, parse_temporal
from firable.nets.temporal_parts import atoms_in

Natural = Annotated[int, Field(ge=0)]
Hexadecimal = Annotated[str, Field(pattern=r"^(0|[1-9a-f][0-9a-f]*)$")]
_SPOKEN_OF: Final = {
    "then": {ClaimKind.LATER, ClaimKind.LEADS_TO, ClaimKind.NOT_LEADS_TO},
    "fairness": {ClaimKind.LEADS_TO, ClaimKind.NOT_LEADS_TO},
    "fires": {ClaimKind.FIRES, ClaimKind.IN_ORDER},
}
"""Which kinds of claims speak of what stands beside the goal."""
_OF_NO_GOAL: Final = {ClaimKind.ORDERED, ClaimKind.UNORDERED, ClaimKind.LIVE, ClaimKind.HOME}
APART_MAX: Final = 100_000
"""How many markings of a set are written each for itself; of more the steps between them, which are shorter."""


class ClaimRecord(Record):
    """A claim; what a kind of claim does not speak of is left out."""

    kind: Annotated[ClaimKind, Field(strict=False)]  # not strict: an enumeration is a string here
    goal: str
    then: str = ""
    fairness: Annotated[Fairness, Field(strict=False)] = Fairness.NONE
    fires: Many[str] = Field(default_factory=list)

    def of(self, net: Net) -> Claim:
        """The claim, its names looked up; refused where it says what nobody would look at."""
        said = {"then": bool(self.then), "fairness": self.fairness is not Fairness.NONE, "fires": bool(self.fires)}
        for what, kinds in _SPOKEN_OF.items():
            if said[what] and self.kind not in kinds:
                raise ValueError(f"a claim of the kind '{self.kind}' does not speak of '{what}'")
        goal: Temporal = parse_formula(self.goal) if self.kind in STATE_GOALS else parse_temporal(self.goal)
        if self.kind in _OF_NO_GOAL and goal != TRUE:
            raise ValueError(f"a claim of the kind '{self.kind}' has no goal")
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
        turns = [net.transition_index[name] for name in fires]
        if self.kind is ClaimKind.FIRES and turns != sorted(set(turns)):
            raise ValueError("the transitions that fire are not in the order of the net, each once")
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


class MarkingsRecord(Record):
    """Listed markings."""

    kind: Literal["markings"]
    markings: Many[Hexadecimal]

    def space(self, net: Net) -> Markings:
        """The set."""
        markings = tuple(int(marking, 16) for marking in self.markings)
        if any(marking >> len(net.places) for marking in markings):
            raise ValueError("a marking holds a place that the net does not have")
        if any(one >= after for one, after in pairwise(markings)):
            raise ValueError("the markings of a set are not in order, the smallest first")
        return Markings(markings)


class AscendingRecord(Record):
    """Many listed markings: the smallest, and by how much each other one is larger than the one before it."""

    kind: Literal["ascending"]
    markings: Many[Hexadecimal]

    def space(self, net: Net) -> Markings:
        """The set."""
        steps = [int(step, 16) for step in self.markings]
        if not all(steps[1:]):
            raise ValueError("the markings of a set are not in order, the smallest first")
        markings = tuple(accumulate(steps))
        if markings and markings[-1] >> len(net.places):
            raise ValueError("a marking holds a place that the net does not have")
        return Markings(markings)


class DiagramRecord(Record):
    """A decision diagram."""

    kind: Literal["diagram"]
    order: Many[str]
    rows: Many[Annotated[Many[Natural], Field(min_length=3, max_length=3)]]
    roots: Annotated[Many[Natural], Field(min_length=1)]

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
        return list(map(_set_to_json, self.spaces))


def _set_to_json(space: Markings | Diagram) -> dict[str, Any]:
    match space:
        case Diagram(order, rows, roots):
            return {"kind": "diagram", "order": list(order), "rows": list(map(list, rows)), "roots": list(roots)}
        case Markings(markings) if len(markings) > APART_MAX:
            return {"kind": "ascending", "markings": [f"{step:x}" for step in steps_of(markings)]}
        case Markings(markings):
            return {"kind": "markings", "markings": [f"{marking:x}" for marking in markings]}


def steps_of(markings: Sequence[Marking]) -> Iterator[int]:
    """The first of some markings in order, and by how much each other one is larger than the one before it.

    >>> list(steps_of((2, 3, 9)))
    [2, 1, 6]
    """
    return (after - before for before, after in pairwise((0, *markings)))


def known(name: str, names: Mapping[str, int]) -> str:
    """The name itself, which the net must have; `ValueError` where it has not."""
    if name not in names:
        raise ValueError(f"the net has no '{name}'")
    return name
