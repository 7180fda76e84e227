"""Response under fairness: does every fair run that meets p meet q afterwards?

The statement AG (p -> AF q) fails iff from a reachable marking with p and without q a run goes on for ever without q
and is fair, or ends in a deadlock before q. A run is *weakly* fair if no transition stays enabled for ever without
firing, and *strongly* if each that is enabled again and again fires again and again. In a graph, among the markings
without q, the components in which such a run can go on are found edge by edge (`engine/src/fairness.rs`).

Enabled means firable and openable, external gates free: that a gate opens at last is part of the assumption, as the
statement of the verdict says. Under steps a transition fires when the step holds it.

A violation is a lasso: a shortest sequence to p, a shortest way from there to the component without meeting q, and a
cycle through it that meets every obligation of fairness. Before it is shown, the reference player fires prefix and
cycle, and checks that the cycle closes, that q is never met and that the cycle is fair, from the definition.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import engine_limits
from firable.analysis.question import Answer, no, yes
from firable.analysis.spaces.columns import NO_COMPONENT, Column, first
from firable.analysis.spaces.reachability import REASONS, ReachabilityGraph
from firable.analysis.spaces.space import S, StateSpace, WitnessError, Witnesses
from firable.analysis.verdicts.fair_runs import fair_markings
from firable.analysis.verdicts.unanswered import unanswered
from firable.nets.formula import Formula, format_formula
from firable.nets.net import Fairness, Marking, Property
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, holds_in

GOING_ON_SHARE, GOING_ON_SECONDS = 0.25, 10.0
"""The part of the time left, and the time, that sets may take to go on with a run: it decides nothing any more."""


def leads_to(space: StateSpace[Any], of: Property) -> Answer:
    """Decide a `leads_to` property; raises `IncompleteGraph` where the space is not whole.

    Cost: one decomposition into components for no and weak fairness; for strong fairness one for each round of pruning.
    A space that is no reachability graph has no components: there the answer comes from sets (`fair_runs.py`), and so
    does the run that goes on without an answer (`unanswered.py`). Where that takes too long, a violation shows the way
    to where it begins.
    """
    space.require_complete()
    return _by_components(space, of) if isinstance(space, ReachabilityGraph) else _by_sets(space, of)


def _by_sets(space: StateSpace[S], of: Property) -> Answer:
    algebra = space.algebra
    without = algebra.negation(space.satisfying(_then(of)))
    around = fair_markings(space, without, of.fairness)
    failing = space.backward(algebra.disjunction([around, algebra.conjunction([space.deadlocks, without])]), without)
    end = f"here ({format_formula(of.formula)}) holds, and ({format_formula(_then(of))}) need never come"
    witness = space.witness(algebra.conjunction([space.satisfying(of.formula), without, failing]), end)
    if witness is None:
        return yes()
    try:
        with space.turn(GOING_ON_SHARE, GOING_ON_SECONDS) as deadline:
            whole = unanswered(space, without, around, of.fairness, witness, deadline)
    except BudgetExceeded:
        whole = None
    if whole is None:
        return no((), witness)
    index = space.net.transition_index
    prefix, cycle = ([tuple(index[t] for t in fired) for fired in part] for part in (whole.firings, whole.cycle))
    check_lasso(Witnesses(space.net, space.discipline), of, prefix, len(witness.firings), cycle)
    return no((), replace(whole, note=_told(of, len(witness.firings), cycle)))


def _told(of: Property, prefix_length: int, cycle: list[FiringSet]) -> str:
    end = "the cycle is fair" if cycle else "the sequence ends in a deadlock"
    return (
        f"after firing {prefix_length} of the sequence ({format_formula(of.formula)}) holds, and then "
        f"({format_formula(_then(of))}) never comes: {end}"
    )


def _then(of: Property) -> Formula:
    if of.then is None:
        raise ValueError(f"'{of.name}' has no second formula")
    return of.then


def _by_components(graph: ReachabilityGraph, of: Property) -> Answer:
    without = ~graph.satisfying(_then(of))
    component = graph.fair_components(without, of.fairness)
    around = component != NO_COMPONENT
    stuck = graph.deadlocks & without
    start = first(graph.satisfying(of.formula) & graph.backward(around | stuck, without) & without)
    if start is None:
        return yes()
    prefix = [tuple(fired) for fired in graph.engine.path_to(start, **engine_limits(graph.moment))]
    prefix_length = len(prefix)
    tail, entry = _way(graph, start, around | stuck, without)
    prefix += tail
    cycle = [] if stuck[entry] else _cycle(graph, component == component[entry], of.fairness, entry)
    check_lasso(graph.witnesses, of, prefix, prefix_length, cycle)
    return no((), graph.witnesses.named(prefix, graph.marking(entry), cycle, _told(of, prefix_length, cycle)))


def _way(graph: ReachabilityGraph, source: int, targets: Column, within: Column) -> tuple[list[FiringSet], int]:
    """A shortest firing sequence through `within` that is known to exist, and the target it reaches."""
    found = graph.engine.path_between(source, targets.tobytes(), within.tobytes(), **engine_limits(graph.moment))
    if found is None:
        raise WitnessError("there is no way to a marking from which it was found by going back")
    firings, target = found
    return [tuple(fired) for fired in firings], target


def _cycle(graph: ReachabilityGraph, within: Column, fairness: Fairness, entry: int) -> list[FiringSet]:
    """A closed walk from a marking of a fair component (`within`) through that component, which is itself fair."""
    walk = _Walk(graph, within, entry)
    if fairness is Fairness.STRONG:
        for t, count in enumerate(graph.fired()):
            if graph.moment.over:
                raise BudgetExceeded(REASONS["time"])
            if count and t not in walk.fired and (enabled := graph.may_fire(t) & within).any():
                walk.fire(t, enabled)
    elif fairness is Fairness.WEAK:
        while owed := walk.lasting() - walk.fired:
            t = min(owed)
            enabled = graph.may_fire(t) & within
            disabled = within & ~enabled
            if disabled.any():
                walk.go(disabled)
            else:
                walk.fire(t, enabled)
    if not walk.firings:
        walk.step()
    return walk.back_to(entry)


@dataclass
class _Walk:
    """A walk inside one component, and what it has met so far."""

    graph: ReachabilityGraph
    within: Column
    at: int
    firings: list[FiringSet] = field(default_factory=list)
    fired: set[int] = field(default_factory=set)
    visited: list[int] = field(init=False)
    """The markings that it has met, of which `lasting` has not yet been told."""
    _lasting: set[int] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.visited = [self.at]

    def lasting(self) -> set[int]:
        """The transitions that were enabled all the time: each is on some edge of every marking, under steps too, where
        some step that may be taken holds it."""
        for index in self.visited:
            enabled = {t for fired, _ in self.graph.successors(index) for t in fired}
            self._lasting = enabled if self._lasting is None else self._lasting & enabled
        self.visited.clear()
        return self._lasting or set()

    def go(self, targets: Column) -> None:
        """Go on to the nearest target."""
        firings, reached = _way(self.graph, self.at, targets, self.within)
        for fired in firings:
            self._move(fired, next(target for label, target in self.graph.successors(self.at) if label == fired))
        if self.at != reached:
            raise WitnessError("a path between two markings does not end where it should")

    def fire(self, t: int, enabled: Column) -> None:
        """Go on to an edge inside the component that fires a transition, and take it."""
        self.go(enabled & self.graph.before(self.within, [t]))
        self.step(t)

    def step(self, t: int | None = None) -> None:
        """Take an edge inside the component, one that fires `t` if it is given."""
        edges = self.graph.successors(self.at)
        self._move(*next((f, to) for f, to in edges if self.within[to] and (t is None or t in f)))

    def back_to(self, entry: int) -> list[FiringSet]:
        """Close the walk; all that was fired."""
        home = np.zeros_like(self.within)
        home[entry] = True
        self.go(home)
        return self.firings

    def _move(self, fired: FiringSet, target: int) -> None:
        self.firings.append(fired)
        self.fired.update(fired)
        self.at = target
        self.visited.append(target)


def check_lasso(
    witnesses: Witnesses, of: Property, prefix: list[FiringSet], trigger: int, cycle: list[FiringSet]
) -> None:
    """Play prefix and cycle by the reference player; raises `WitnessError` unless they refute the property.

    After `trigger` of the prefix p holds, and q does not from there on.
    """
    net, player = witnesses.net, witnesses.player

    def holds(formula: Formula, marking: Marking) -> bool:
        return evaluate(BOOL, net, formula, holds_in(marking))

    def played(marking: Marking, firings: Iterable[FiringSet]) -> list[Marking]:
        markings = [marking]
        for fired in firings:
            markings.append(witnesses.play(markings[-1], [fired]))
        return markings

    before = played(net.initial_marking, prefix)
    around = played(before[-1], cycle)
    answered = any(holds(_then(of), marking) for marking in (*before[trigger:], *around))
    if answered or not holds(of.formula, before[trigger]):
        raise WitnessError("the lasso does not refute the property")
    if not cycle:
        if not player.deadlocked(before[-1]):
            raise WitnessError("the sequence does not end in a deadlock")
        return
    if around[-1] != around[0]:
        raise WitnessError("the cycle does not close")
    fired = {t for label in cycle for t in label}
    enabled = [set(player.may_fire(marking)) for marking in around[:-1]]
    owed: set[int] = set()
    if of.fairness is Fairness.WEAK:
        owed = set.intersection(*enabled)
    elif of.fairness is Fairness.STRONG:
        owed = set.union(*enabled)
    if not owed <= fired:
        raise WitnessError("the cycle is not fair")
