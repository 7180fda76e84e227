"""Labels: what shows a formula of CTL on a closed set of markings, by conditions between neighbours only.

The formula is brought to negation normal form, where negation stands before state formulas alone. Then every label may
be an under-approximation, and what follows from such labels is true (Clarke, Emerson and Sistla 1986 give the
equations; that a labelling is a proof is Namjoshi's, "Certifying model checkers", 2001):

    least       S with end <= S, and S <= end or (through and a next marking in S), each of a lower rank: "until"
    greatest    S <= through and (end or a next marking in S): "release", of which "always" is the case without an end

"A next marking" is some or every one, by the quantifier. A maximal run may end in a deadlock: there no run goes on, so
what every next marking satisfies holds, "until" is not yet fulfilled, and "always" is. For each fixpoint, inner ones
first, equal ones once, there is one label (`Label`), whose form depends on the set: a rank for each of listed markings;
of a decision diagram the firings or the number of rounds by which it is found, or the set itself.

The space is a parameter: it does the sums of sets, and this file says what has to be shown. Rejected: to compute the
fixpoints anew, which is model checking again, takes rounds where a label takes one look, and would show to nobody where
the goal lies.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from firable.analysis.evidence.certificate import Label
from firable.analysis.evidence.refusal import refuse
from firable.nets.formula import Constant, Formula, Not
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    format_temporal,
)

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class State:
    """A state formula."""

    formula: Formula


@dataclass(frozen=True, slots=True)
class All:
    """All parts hold."""

    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """Some part holds."""

    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Neighbour:
    """The part holds in every next marking, or in some."""

    every: bool
    part: Node


@dataclass(frozen=True, slots=True)
class Least:
    """On every maximal run from here, or on some, `end` comes, and until then `through` holds."""

    every: bool
    through: Node
    end: Node


@dataclass(frozen=True, slots=True)
class Greatest:
    """On every maximal run from here, or on some, `through` holds until and while `end` does, or for ever."""

    every: bool
    end: Node
    through: Node


Node = State | All | Some | Neighbour | Least | Greatest


def normal(formula: Temporal, *, negative: bool = False) -> Node:
    """The negation normal form of a formula of CTL, or of its negation.

    >>> from firable.nets.temporal import parse_temporal
    >>> normal(parse_temporal("not EX p"))
    Neighbour(every=True, part=State(formula=Not(operand=Holds(place='p'))))
    """
    match formula:
        case TemporalNot(operand):
            return normal(operand, negative=not negative)
        case TemporalAnd(operands) | TemporalOr(operands):
            parts = tuple(normal(operand, negative=negative) for operand in operands)
            return All(parts) if isinstance(formula, TemporalAnd) is not negative else Some(parts)
        case Exists(path) | ForAll(path):
            every = isinstance(formula, ForAll) is not negative
            return _of_path(path, every=every, negative=negative)
        case _ if isinstance(formula, Formula):
            return State(Not(formula) if negative else formula)
    raise ValueError(f"'{format_temporal(formula)}' is no formula of CTL")


def _of_path(path: Temporal, *, every: bool, negative: bool) -> Node:
    never, always = State(Constant(value=False)), State(Constant(value=True))
    match path:
        case Next(operand):
            return Neighbour(every, normal(operand, negative=negative))
        case Eventually(operand):
            part = normal(operand, negative=negative)
            return Greatest(every, never, part) if negative else Least(every, always, part)
        case Globally(operand):
            part = normal(operand, negative=negative)
            return Least(every, always, part) if negative else Greatest(every, never, part)
        case Until(left, right):
            first, second = normal(left, negative=negative), normal(right, negative=negative)
            return Greatest(every, first, second) if negative else Least(every, first, second)
    raise ValueError(f"'{format_temporal(path)}' stands behind no quantifier of CTL")


def fixpoints(node: Node) -> tuple[Least | Greatest, ...]:
    """The fixpoints of a formula, inner ones first, equal ones once: what the labels of a labelling belong to."""
    found: dict[Least | Greatest, None] = {}
    todo: list[tuple[Node, bool]] = [(node, False)]
    while todo:
        one, ready = todo.pop()
        if ready:
            if isinstance(one, Least | Greatest):
                found.setdefault(one)
            continue
        todo.append((one, True))
        todo += [(part, False) for part in reversed(parts_of(one))]
    return tuple(found)


def parts_of(node: Node) -> tuple[Node, ...]:
    """What a node is made of, in the order in which it is written."""
    match node:
        case All(parts) | Some(parts):
            return parts
        case Neighbour(_, part):
            return (part,)
        case Least(_, through, end):
            return (through, end)
        case Greatest(_, end, through):
            return (end, through)
    return ()


class LabelledSpace(Protocol[S]):
    """A closed set of markings and its subsets; `least` and `greatest` refuse a label that breaks its condition."""

    def holds_initially(self, markings: S, /) -> bool:
        """Whether M0 is in a subset."""
        ...

    def where(self, formula: Formula) -> S:
        """The markings of the set in which a state formula holds."""
        ...

    def all_of(self, sets: Iterable[S]) -> S:
        """The markings in all of the subsets."""
        ...

    def any_of(self, sets: Iterable[S]) -> S:
        """The markings in some of the subsets."""
        ...

    def neighbours(self, targets: S, *, every: bool) -> S:
        """The markings of which every next marking, or some, is a target."""
        ...

    def least(self, label: Label, through: S, end: S, *, every: bool) -> S:
        """The markings that the label says to be on the way to the end."""
        ...

    def greatest(self, label: Label, end: S, through: S, *, every: bool) -> S:
        """The markings that the label says to stay."""
        ...


def labelled(space: LabelledSpace[S], formula: Temporal, labels: Sequence[Label]) -> S:
    """The markings in which the labels show a formula of CTL to hold; refused where a label breaks its condition."""
    root = normal(formula)
    wanted = fixpoints(root)
    if len(labels) != len(wanted):
        refuse(f"({format_temporal(formula)}) wants {len(wanted)} labels, and there are {len(labels)}")
    label_of = dict(zip(wanted, labels, strict=True))
    known: dict[Node, S] = {}
    todo: list[Node] = [root]
    while todo:
        node = todo[-1]
        if node in known:
            todo.pop()
            continue
        if missing := [part for part in parts_of(node) if part not in known]:
            todo += missing
            continue
        parts = [known[part] for part in parts_of(node)]
        match node:
            case State(state):
                known[node] = space.where(state)
            case All():
                known[node] = space.all_of(parts)
            case Some():
                known[node] = space.any_of(parts)
            case Neighbour(every):
                known[node] = space.neighbours(parts[0], every=every)
            case Least(every):
                known[node] = space.least(label_of[node], parts[0], parts[1], every=every)
            case Greatest(every):
                known[node] = space.greatest(label_of[node], parts[0], parts[1], every=every)
        todo.pop()
    return known[root]
