"""What the arcs of a net say of every reachable marking, for proofs by induction.

Induction starts from any marking that satisfies what is known, so it fails on markings that no run can reach. Three
kinds of facts exclude most of them, and none needs a run to be found:

- P-invariants: a weighted sum of tokens that no firing changes;
- the largest siphon that is empty in M0: it stays empty, so each of its places does;
- traps that are marked in M0 stay marked. There are exponentially many, so none is listed in advance: a marking that
  refutes the induction is asked whether its empty places contain a marked trap, which one closure answers, and that
  trap is a new fact (Esparza, Ledesma-Garza, Majumdar, Meyer and Niksic 2014, "An SMT-based approach to coverability
  analysis").

All three hold whatever the gates and the contact rule forbid, and for steps as for single firings: they need only that
a firing takes from its inputs and puts into its outputs, and a step has one consumer and one producer of a place. What
does not hold for steps is that a place that is read keeps its token (`Traps`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Final

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Clause, Equation
from firable.analysis.structure.asking import WEIGHTS_MAX
from firable.analysis.structure.invariants import p_invariants
from firable.analysis.structure.ordinary import ordinary
from firable.analysis.structure.siphons import largest_siphon, trap_rules
from firable.nets.net import Marking, Net
from firable.semantics.trace import Discipline

_SHARE: Final = 0.25  # of the time that is left, for the invariants
_SECONDS_MAX: Final = 10.0
_SIZE_MAX: Final = 50  # places in all equations together, for each place of the net
_SHRINKING_SECONDS: Final = 1.0


@dataclass(frozen=True, slots=True)
class Facts:
    """Equations and clauses that hold in every reachable marking of a net."""

    equations: tuple[Equation, ...] = ()
    clauses: tuple[Clause, ...] = ()


def structural_facts(net: Net, deadline: Deadline) -> Facts:
    """P-invariants, as many as are found in a share of the time, and the places that stay empty.

    >>> from firable.nets.catalogue.families import family_net
    >>> facts = structural_facts(family_net("philosophers-3"), Deadline())
    >>> len(facts.equations), facts.clauses
    (6, ())
    """
    left = deadline.left_seconds
    share = min(_SECONDS_MAX, inf if left is None else left * _SHARE)
    found = p_invariants(net, deadline=deadline.within(share)).minimal
    equations, size = list[Equation](), 0
    light = (one for one in found if sum(weight for _, weight in one.weights) <= WEIGHTS_MAX)
    for invariant in sorted(light, key=lambda one: len(one.weights)):
        size += len(invariant.weights)
        if size > _SIZE_MAX * len(net.places):
            break
        equations.append(Equation(invariant.weights, invariant.tokens(net, net.initial_marking)))
    everywhere = (1 << len(net.places)) - 1
    never_marked = net.names(largest_siphon(net, everywhere & ~net.initial_marking))
    return Facts(tuple(equations), tuple(Clause(empty=(place,)) for place in never_marked))


class Traps:
    """The traps of a net that are marked in M0, found one by one, each to exclude a marking.

    Under interleaving a place that a transition reads counts as taken and put back. In a step somebody else may take
    it at the same time, so there only arcs count.
    """

    def __init__(self, net: Net, discipline: Discipline) -> None:
        self.net = net
        if discipline is Discipline.STEP:
            bare = tuple(replace(transition, permissive=()) for transition in net.transitions)
            net = Net(net.name, net.places, bare, net.signals, net.controllers)
        self._rules = trap_rules(ordinary(net))
        self._marked = frozenset(i for i, place in enumerate(net.places) if place.marked)

    def against(self, marking: Marking, deadline: Deadline) -> Clause | None:
        """A trap that is marked in M0 and empty in a marking, as a clause; None if there is none.

        It is made as small as a second allows. Cost: a closure over the arcs for each place of the trap.
        """
        trap = self._rules.largest(i for i in range(len(self.net.places)) if not marking >> i & 1)
        if not trap & self._marked:
            return None
        smaller = self._rules.smallest(trap, self._marked, deadline.within(_SHRINKING_SECONDS)) or trap
        return Clause(marked=tuple(self.net.places[i].name for i in sorted(smaller)))
