"""Bounded model checking: is a goal reachable in so many firings? Finds violations, and proves nothing.

Biere, Cimatti, Clarke and Zhu (1999, "Symbolic model checking without BDDs"): the runs of k firings are the models of a
Boolean formula, and a solver looks for one that ends in the goal; k grows until it finds one. Under interleaving
the relation is that of firings in parallel (`firable.analysis.induction.encoding`): a deadlock of a thousand machines
is a few steps away and not a thousand, and what the solver finds is put into an order that the reference player
replays. Firings that the goal does not need, which a solver adds freely, are taken out again as far as that is cheap.

Under the step discipline the relation is that of maximal steps, and nothing can be taken out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import Final

from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.encoding import parallel_relation, step_relation
from firable.analysis.induction.session import LimitReachedError, Session
from firable.analysis.induction.unrolling import Unrolling
from firable.analysis.spaces.space import Witnesses
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import FiringSet, NotFirableError, Player, holds_in
from firable.semantics.trace import Discipline

METHOD: Final = "bounded model checking"
_COST_MAX: Final = 30_000  # firings played, and transitions looked at, to make a witness shorter


def decide_by_bounded_search(
    net: Net,
    goal: Formula,
    limits: Limits,
    *,
    discipline: Discipline = Discipline.INTERLEAVING,
    depth_max: int | None = None,
) -> Finding:
    """Look for a run into the goal, of growing length up to that of the limits; the finding is a witness or nothing.

    Cost: a copy of the net for each depth, and whatever the solver needs.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import Deadlock
    >>> found = decide_by_bounded_search(family_net("philosophers-9"), Deadlock(), Limits())
    >>> found.reachable, len(found.witness.firings) if found.witness else None
    (True, 9)
    """
    start, depth = perf_counter(), -1
    longest = limits.depth_max if depth_max is None else depth_max
    found: Witness | None = None
    try:
        with Session(limits) as session:
            search = BoundedSearch(session, net, goal, discipline)
            while found is None and depth < longest:
                found = search.witness(depth + 1)
                depth += 1
                limits.tell(f"no run of up to {depth:,} {_WORDS[discipline]}")
    except LimitReachedError:
        pass
    bound = "" if found else f"no run of up to {depth:,} {_WORDS[discipline]} leads to it" if depth >= 0 else "nothing"
    return Finding(True if found else None, METHOD, found, bound, Cost(seconds=perf_counter() - start))


_WORDS: Final = {Discipline.INTERLEAVING: "steps of firings in parallel", Discipline.STEP: "steps"}


class BoundedSearch:
    """The runs from M0, and the question whether one of a given depth ends in the goal."""

    def __init__(self, session: Session, net: Net, goal: Formula, discipline: Discipline) -> None:
        self.net, self.goal, self.discipline = net, goal, discipline
        encode = parallel_relation if discipline is Discipline.INTERLEAVING else step_relation
        self.runs = Unrolling(session, net, encode)
        self.runs.learn_marking(0, net.initial_marking)
        self._goal = evaluate(self.runs.terms, net, goal, self.runs.places.__getitem__)

    def witness(self, depth: int) -> Witness | None:
        """A run of this depth into the goal, None where there is none.

        Raises `LimitReachedError` at the deadline.
        """
        while self.runs.depth < depth:
            self.runs.extend()
        if not self.runs.ask_at(depth, self._goal):
            return None
        steps = self.runs.firings(self.runs.solver.model(), depth)
        witnesses = Witnesses(self.net, self.discipline)
        if self.discipline is Discipline.INTERLEAVING:
            firings = shortened(self.net, self.goal, [t for step in steps for t in step])
            return witnesses.replayed(firings, reached(self.net, firings))
        return witnesses.replayed(steps, reached(self.net, steps))


def shortened(net: Net, goal: Formula, transitions: Sequence[int]) -> list[FiringSet]:
    """The firing sequence without firings that it does not need to lead to the goal.

    Each firing is left out once, from the last to the first, and stays out where the rest still leads to the goal.
    Cost: bounded; a long sequence on a wide net keeps most of its firings.
    """
    player = Player(net)

    def leads_to_goal(sequence: Sequence[int]) -> bool:
        marking = net.initial_marking
        for t in sequence:
            try:
                marking = player.fire(marking, (t,))
            except NotFirableError:
                return False
        return evaluate(BOOL, net, goal, holds_in(marking))

    found = list(transitions)
    if not leads_to_goal(found):
        raise AssertionError("the firings in parallel do not play one by one")
    cost, i = 0, len(found) - 1
    while i >= 0 and cost < _COST_MAX:
        cost += len(found) + len(net.transitions)
        if leads_to_goal(shorter := [*found[:i], *found[i + 1 :]]):
            found = shorter
        i -= 1
    return [(t,) for t in found]


def reached(net: Net, firings: Iterable[FiringSet]) -> Marking:
    """The marking after a firing sequence from M0."""
    player, marking = Player(net), net.initial_marking
    for fired in firings:
        marking = player.fire(marking, fired)
    return marking
