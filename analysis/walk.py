"""Random walks: a goal found where it is too far for a search, by firing at random from M0 again and again.

A search that keeps every marking reaches some millions of them; a walk keeps none, and goes a thousand firings deep in
microseconds. It finds violations of nets that no search can hold and concludes nothing where it finds none. How it
walks (blind, towards what was fired least, towards the goal; with restarts after lengths that follow Luby's sequence)
stands in `analysis/engine/src/stubborn/walk.rs`, and so does how the sequence it found is cut down to the firings that
the goal needs.

The seed is fixed, so the same net gives the same walk. The rejected alternative, a search that keeps the most promising
markings (best first, beams), finds less when its estimate of the distance misleads it, and cells are made of waiting.
"""

from __future__ import annotations

from time import perf_counter
from typing import Final

from firable.analysis._engine import Stubborn
from firable.analysis.compiled import engine_limits, flat, nodes_of
from firable.analysis.goal import Finding, Limits
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.nets.formula import Deadlock, Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

METHOD: Final = "random walk"
SEED: Final = 1
_FIRINGS_MAX: Final = 2**40
"""Hours of walking: it is the deadline that ends a walk."""


class Walks:
    """Walks in one net, for one goal after the other: to make the net ready takes longer than a short walk."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self._engine = Stubborn(*flat(net))

    def decide(self, goal: Formula, limits: Limits, *, seed: int = SEED, firings: int = _FIRINGS_MAX) -> Finding:
        """Look for a marking that satisfies the goal; never says that it is not reachable.

        Ends after so many firings, or with the limits.
        """
        start, witnesses = perf_counter(), Witnesses(self.net, Discipline.INTERLEAVING)
        nodes = None if isinstance(goal, Deadlock) else nodes_of(self.net, goal)
        path, steps = self._engine.walk(nodes, seed=seed, max_steps=firings, **engine_limits(limits.deadline))
        cost = Cost(edges=steps, seconds=perf_counter() - start)
        if path is None:
            return Finding(None, METHOD, bound=f"{steps:,} random firings did not meet it", cost=cost)
        sequence = [(t,) for t in path]
        reached = witnesses.play(self.net.initial_marking, sequence)
        if not evaluate(BOOL, self.net, goal, holds_in(reached)):
            raise WitnessError("a walk ends in a marking that does not satisfy the goal")
        return Finding(reachable=True, method=METHOD, witness=witnesses.named(sequence, reached), cost=cost)


def decide_by_walk(
    net: Net, goal: Formula, limits: Limits, *, seed: int = SEED, firings: int = _FIRINGS_MAX
) -> Finding:
    """Look for a marking that satisfies the goal by random walks; never says that it is not reachable.

    Ends after so many firings, or with the limits. Cost: each firing costs the transitions that it touches and the size
    of the goal, whatever the size of the net.

    >>> from firable.nets.catalogue import catalogue_net
    >>> decide_by_walk(catalogue_net("one_robot_mc_late"), Deadlock(), Limits()).reachable
    True
    """
    return Walks(net).decide(goal, limits, seed=seed, firings=firings)
