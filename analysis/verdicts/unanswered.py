"""A run in which an answer never comes, gone on with through sets of markings, for any state space.

Sets tell of a response that fails the way to where the answer need no longer come, and not the run that goes on from
there. That run ends in a deadlock, or goes round for ever in a set of markings without the answer in which a fair run
may always go on (`fair_markings`). There it meets one obligation of fairness after the other: it goes on to the nearest
marking where a transition that it owes may fire, or, where fairness is weak, may not fire. Then it goes home to where
its round began. What can not be met, or no way home, says that the run has left the component of the markings where it
began, and the round begins anew: a finite net has finitely many components behind each other.

Rejected: the first successor of each marking, which may be the answer and need not be fair.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.spaces.space import S, StateSpace, Witnesses
from firable.nets.net import Fairness, Marking
from firable.nets.verdict import Witness
from firable.semantics.player import FiringSet, Player
from firable.semantics.trace import Discipline


def unanswered(
    space: StateSpace[S], without: S, around: S, fairness: Fairness, witness: Witness, deadline: Deadline
) -> Witness | None:
    """The run of a witness, gone on with to a deadlock or round a fair cycle; None where there is no way to either.

    It stays in `without`, the markings without the answer, and `around` are the `fair_markings` of these. Raises
    `BudgetExceeded` where it is not there by the deadline: on a long way each step is too short to notice.
    """
    algebra = space.algebra
    stuck = algebra.conjunction([space.deadlocks, without])
    walk = _Walk(space, space.net.marking(witness.marking), deadline)
    if not walk.go(algebra.disjunction([around, stuck]), without):
        return None
    *before, cycle = _rounds(walk, around, fairness) if space.contains(around, walk.at) else [[]]
    prefix = [*walk.fired, *(fired for part in before for fired in part)]
    witnesses = Witnesses(space.net, space.discipline)
    further = witnesses.named(prefix, witnesses.play(space.net.marking(witness.marking), prefix), cycle)
    return replace(further, firings=(*witness.firings, *further.firings))


def _rounds(walk: _Walk, around: Any, fairness: Fairness) -> list[list[FiringSet]]:
    """What is fired in rounds that were given up, and in the last one, which ends where it began and is fair."""
    space, algebra, rounds = walk.space, walk.space.algebra, list[list[FiringSet]]()
    while True:
        walk = _Walk(space, walk.at, walk.deadline)
        rounds.append(walk.fired)
        home = space.alone(walk.at)
        walk.fire(around)
        while True:
            t = walk.owed(fairness)
            if t is None:
                if not walk.go(home, around):
                    break
                if walk.owed(fairness) is None:
                    return rounds
                continue
            fires = algebra.conjunction([around, space.before(around, [t])])
            met = [fires] if fairness is Fairness.STRONG else [fires, algebra.negation(space.may_fire(t))]
            if not walk.go(algebra.conjunction([around, algebra.disjunction(met)]), around):
                break
            if space.contains(fires, walk.at):
                walk.fire(around, t)


class _Walk:
    """A walk through the markings, with what it fired, and what might have fired in the markings it met."""

    def __init__(self, space: StateSpace[Any], at: Marking, deadline: Deadline) -> None:
        self.space, self.at, self.deadline, self.player = space, at, deadline, Player(space.net)
        self.fired: list[FiringSet] = []
        self.enabled = [frozenset(self.player.may_fire(at))]

    def go(self, targets: Any, within: Any) -> bool:
        """Go on to a nearest target through a set; whether there is a way."""
        space, algebra = self.space, self.space.algebra
        nearer, size = [targets], space.count(targets)
        while not space.contains(nearer[-1], self.at):
            self._in_time()
            ahead = algebra.conjunction([within, space.before(nearer[-1])])
            nearer.append(algebra.disjunction([nearer[-1], ahead]))
            before, size = size, space.count(nearer[-1])
            if size == before:
                return False
        for ahead in reversed(nearer[:-1]):
            self.fire(ahead)
        return True

    def fire(self, into: Any, t: int | None = None) -> None:
        """Fire what leads into a set, and holds `t` if it is given; raises `StopIteration` where nothing does."""
        self._in_time()
        successors = self.player.successors(self.at, step=self.space.discipline is Discipline.STEP)
        some = ((f, to) for f, to in successors if (t is None or t in f) and self.space.contains(into, to))
        fired, self.at = next(some)
        self.fired.append(fired)
        self.enabled.append(frozenset(self.player.may_fire(self.at)))

    def _in_time(self) -> None:
        if self.deadline.over:
            raise BudgetExceeded("the time is over in which a run is gone on with")

    def owed(self, fairness: Fairness) -> int | None:
        """A transition that fairness demands of a cycle through these markings, and that has not fired."""
        match fairness:
            case Fairness.NONE:
                return None
            case Fairness.WEAK:
                demanded = frozenset.intersection(*self.enabled)
            case Fairness.STRONG:
                demanded = frozenset[int]().union(*self.enabled)
        return min(demanded.difference(*self.fired), default=None)
