"""Runs as evidence: a way through a product to a run that is accepted, and what a formula says of such a run.

A run that refutes a formula of LTL, or shows an EG, is a lasso: a firing sequence from M0 and a cycle that is fired for
ever, or, instead of the cycle, the deadlock in which the sequence ends. It is found by going forward, firing by firing
as the reference player fires, through sets that were computed backward: for a goal, the pairs that are at most k steps
away, for k = 0, 1, ... until the present pair is among them; then each step goes to a lower k. The cycle passes an edge
with each mark and returns to where it began; where it cannot return, it has left a strongly connected component of the
product for good and begins anew, which happens as often as there are components in a row, at most.

The run found is then judged by itself (`satisfies`): the formula is evaluated along its finitely many positions, by the
definition of each operator. Neither sets nor automata take part, so a fault in them cannot show a wrong run.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Generic, TypeVar

from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.temporal.product import Pairs, Product, ProductEdge, Steps
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.temporal import (
    Eventually,
    Fires,
    Globally,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    WeakUntil,
)
from firable.nets.verdict import Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, holds_in
from firable.semantics.trace import Discipline

S = TypeVar("S")
BYTES_MAX: Final = 2**30


class TooLongError(RuntimeError):
    """The sets that lead to the run take more memory than a run is worth."""


@dataclass(frozen=True, slots=True)
class Run:
    """A maximal run from M0: what is fired first, and what is then fired for ever; nothing, in a deadlock."""

    prefix: tuple[FiringSet, ...]
    cycle: tuple[FiringSet, ...]


def witness_of(net: Net, discipline: Discipline, run: Run, note: str) -> Witness:
    """The run in the net's names, replayed by the reference player; raises `WitnessError` where it is none."""
    witnesses = Witnesses(net, discipline)
    reached = witnesses.play(net.initial_marking, run.prefix)
    if run.cycle and witnesses.play(reached, run.cycle) != reached:
        raise WitnessError("the cycle does not close")
    if not run.cycle and not witnesses.player.deadlocked(reached):
        raise WitnessError("the sequence does not end in a deadlock")
    return witnesses.named(run.prefix, reached, run.cycle, note)


def satisfies(net: Net, run: Run, formula: Temporal) -> bool:
    """Whether a run, given as the sequence and cycle that the reference player fires, satisfies a formula of LTL.

    Position i is the marking before firing i; after the last comes the first of the cycle, or the deadlock again.
    """
    witnesses = Witnesses(net, Discipline.INTERLEAVING)
    markings, fired = [net.initial_marking], [*run.prefix, *run.cycle]
    for one in fired:
        markings.append(witnesses.player.fire(markings[-1], one))
    loop = len(run.prefix)
    if run.cycle:
        markings.pop()
    else:
        fired.append(())
    following = [*range(1, len(markings)), loop]
    return _Judge(net, markings, fired, following).values(formula)[0]


@dataclass(frozen=True)
class _Judge:
    """The positions of a lasso, and the value of formulas at each."""

    net: Net
    markings: list[Marking]
    fired: list[FiringSet]
    following: list[int]

    def values(self, formula: Temporal) -> list[bool]:
        positions = range(len(self.markings))
        match formula:
            case TemporalNot(operand):
                return [not value for value in self.values(operand)]
            case TemporalAnd(operands):
                return [all(row) for row in zip(*map(self.values, operands), strict=True)]
            case TemporalOr(operands):
                return [any(row) for row in zip(*map(self.values, operands), strict=True)]
            case Next(operand):
                values = self.values(operand)
                return [values[self.following[i]] for i in positions]
            case Eventually(operand):
                return self._until([True for _ in positions], self.values(operand))
            case Globally(operand):
                return [not v for v in self._until([True for _ in positions], [not v for v in self.values(operand)])]
            case Until(left, right):
                return self._until(self.values(left), self.values(right))
            case Release(left, right):
                never = self._until([not v for v in self.values(left)], [not v for v in self.values(right)])
                return [not v for v in never]
            case WeakUntil(left, right):
                first, second = self.values(left), self.values(right)
                ended = [not a and not b for a, b in zip(first, second, strict=True)]
                return [not v for v in self._until([not v for v in second], ended)]
            case Fires(transition):
                return [self.net.transition_index[transition] in fired for fired in self.fired]
            case _ if isinstance(formula, Formula):
                return [evaluate(BOOL, self.net, formula, holds_in(marking)) for marking in self.markings]
        raise ValueError(f"{formula} is no formula of LTL")

    def _until(self, left: list[bool], right: list[bool]) -> list[bool]:
        """The least solution of v = right or (left and v at the next position): two rounds backward find it."""
        values = list(right)
        for _ in range(2):
            for i in reversed(range(len(values))):
                values[i] = right[i] or (left[i] and values[self.following[i]])
        return values


@dataclass
class Walk(Generic[S]):
    """A walk through a product, from M0 and the first state."""

    product: Product[S]
    marking: Marking
    state: int = 0
    fired: list[FiringSet] = field(default_factory=list)

    def __post_init__(self) -> None:
        space = self.product.sets.space
        self.player = Witnesses(space.net, space.discipline).player
        self.step_wise = space.discipline is Discipline.STEP

    def go(self, goal: Pairs[S], within: Pairs[S]) -> bool:
        """Go on to the nearest pair of the goal through these pairs; whether there is a way."""
        layers, sizes, earlier = [goal], dict[int, int](), Pairs[S]()
        sets = self.product.sets
        while not self._in(last := layers[-1]):
            now = {state: sets.space.count(markings) for state, markings in last.items()}
            if now == sizes:
                return False
            grown = [state for state in now if now[state] > sizes.get(state, 0)]
            # What leads into the rest is there already, and to go back from a few markings is quick.
            steps = Steps(self.product, {q: sets.both(last[q], sets.outside(earlier.get(q, sets.none))) for q in grown})
            sizes, earlier = now, last
            layers.append(
                {
                    state: sets.either(
                        last.get(state, sets.none), sets.both(markings, steps.into(self.product.edges[state]))
                    )
                    for state, markings in within.items()
                }
            )
            if len(layers) * sum(getattr(markings, "nbytes", 0) for markings in last.values()) > BYTES_MAX:
                raise TooLongError
        for layer in reversed(layers[:-1]):
            if not self._in(layer):
                self.step(layer)
        return True

    def _in(self, pairs: Pairs[S]) -> bool:
        markings = pairs.get(self.state)
        return markings is not None and self.product.sets.space.contains(markings, self.marking)

    def step(self, pairs: Pairs[S], mark: int | None = None) -> None:
        """Take an edge into these pairs, one with the mark if it is given."""
        space = self.product.sets.space
        for edge in self.product.edges[self.state]:
            if (mark is not None and mark not in edge.marks) or not space.contains(edge.markings, self.marking):
                continue
            targets = pairs.get(edge.target)
            if targets is None:
                continue
            for fired, after in self._firings(edge):
                if space.contains(targets, after):
                    self.state, self.marking = edge.target, after
                    if fired:
                        self.fired.append(fired)
                    return
        raise WitnessError("there is no step to pairs from which this one was found by going back")

    def _firings(self, edge: ProductEdge[S]) -> list[tuple[FiringSet, Marking]]:
        successors = list(self.player.successors(self.marking, step=self.step_wise))
        if not successors:
            return [((), self.marking)] if edge.stutters else []
        return [(fired, after) for fired, after in successors if edge.by is None or edge.by & set(fired)]


def accepted_run(product: Product[S], fair: Pairs[S], leading: Pairs[S]) -> Run:
    """A run of the net that the automaton accepts, from M0, where `leading` (to `fair`) says that there is one.

    Raises `TooLongError` where finding it takes too much memory.
    """
    sets = product.sets
    walk = Walk(product, sets.space.net.initial_marking)
    if not walk.go(fair, leading):
        raise WitnessError("there is no way to pairs from which this one was found by going back")
    part = next(part for part in product.parts if walk.state in part)
    inside = {state: fair[state] for state in part if state in fair}
    while True:
        begin, anchor = len(walk.fired), (walk.marking, walk.state)
        for mark in range(product.n_marks) or (None,):
            steps = Steps(product, inside)
            if not walk.go({q: sets.both(of, steps.into(product.edges[q], mark)) for q, of in inside.items()}, inside):
                raise WitnessError("a mark of the automaton is not met again")
            walk.step(inside, mark)
        home = {anchor[1]: sets.both(sets.space.alone(anchor[0]), inside[anchor[1]])}
        if walk.go(home, inside):
            return Run(tuple(walk.fired[:begin]), tuple(walk.fired[begin:]))
