"""Parikh vectors of the state equation, realised: a goal found by asking how often transitions fire, not in what order.

The least solution of the state equation that ends in the goal says how often each transition fires on a way there, if
it is one: a *plan*. An integer programme finds it (`programme.py`), whatever the number of markings; an order is found
by firing at random what is left of the plan. Where something is left that cannot fire, two things are done:

- What the plan's own transitions can never mark, whatever the order, somebody else must: a transition that needs such
  places fires only with one that puts the first token into them. That holds for every way from there, and is a *cut*.
- Else the plan is fired as far as it goes, and another one is made from the marking that was reached.

Where that leads nowhere, all is begun again with firings that cost other sums. What is found is replayed by the
reference player. That there is no plan proves nothing here: the programme is solved in floating point, and a plan fires
no transition more than some hundred times.

Source: Wimmel and Wolf (2012, "Applying CEGAR to the Petri net state equation"). Rejected: their increments, which make
a plan longer by constraints on single transitions and branch over these. A plan anew from where the old one ended needs
no search tree, and the least sum of firings replaces their order on solutions.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from operator import attrgetter
from time import perf_counter
from typing import Final

from firable.analysis._engine import BudgetExceeded
from firable.analysis.deadline import Deadline
from firable.analysis.goal import Finding, Limits
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.structure.goal_rows import OUT_OF_TIME, rows_of
from firable.analysis.structure.ordinary import markable, ordinary
from firable.analysis.structure.programme import Plan, Programme, require_room
from firable.nets.formula import Formula
from firable.nets.net import Marking, Net
from firable.nets.verdict import Cost
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

METHOD: Final = "Parikh vectors"
_SEED: Final = 1
_TRIES: Final = 30
"""How many orders of a plan are drawn."""
_BEGINNINGS_MAX: Final = 20
_COST_MAX: Final = 1.5
_RUNGS: Final = ((False, 16), (False, 1024), (True, 1024))
"""What is tried in turn: by the contact rule or without it, and how often a transition may fire.

A plan in which none fires often is found many times sooner where the programme says so.
"""


def decide_by_parikh(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Look for a marking that satisfies the goal by plans; never says that it is not reachable.

    Cost: an integer programme of the net's size for each plan, and tens of its lengths in firings.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import Deadlock
    >>> decide_by_parikh(catalogue_net("one_robot_mc_late"), Deadlock(), Limits()).reachable
    True
    """
    start, search = perf_counter(), _Search(net, goal, limits)
    try:
        path, bound = search.path(), "the state equation has no solution in the goal, as far as floating point tells"
    except BudgetExceeded as error:
        path, bound = None, str(error)
    cost = Cost(edges=search.fired, seconds=perf_counter() - start)
    if path is None:
        return Finding(None, METHOD, bound=bound, cost=cost)
    witnesses, sequence = Witnesses(net, Discipline.INTERLEAVING), [(t,) for t in path]
    reached = witnesses.play(net.initial_marking, sequence)
    if not search.is_reached(reached):
        raise WitnessError("a plan ends in a marking that does not satisfy the goal")
    return Finding(reachable=True, method=METHOD, witness=witnesses.named(sequence, reached), cost=cost)


class _Search:
    """The plans for one goal, and how many firings were tried."""

    def __init__(self, net: Net, goal: Formula, limits: Limits) -> None:
        self.net, self.goal, self.limits = net, goal, limits
        self.of = ordinary(net)
        self.draw = random.Random(_SEED)
        self.fired = 0

    def is_reached(self, marking: Marking) -> bool:
        return evaluate(BOOL, self.net, self.goal, holds_in(marking))

    def path(self) -> list[int] | None:
        """A firing sequence from M0 into the goal; None where there is no plan from M0.

        Raises `BudgetExceeded` where the time is over, enough plans were tried, or the programme has no room.
        """
        plans, limits = 0, self.limits
        require_room(sum(map(len, (*self.of.inputs, *self.of.outputs))), limits.memory_bytes)  # before much is made
        for contact, firings_max in _RUNGS:
            rows = rows_of(self.net, self.goal, contact=contact, deadline=limits.deadline)
            programme = Programme(self.of, rows, firings_max, limits.memory_bytes)
            for beginning in range(_BEGINNINGS_MAX):
                if beginning:
                    programme.weigh([self.draw.uniform(1, _COST_MAX) for _ in self.of.transitions])
                tried, path = self._go(programme)
                plans += tried
                if path is not None:
                    return path
                if not tried:
                    break
        if plans:
            raise BudgetExceeded(f"none of {plans} plans could be fired into the goal")
        return None

    def _go(self, programme: Programme) -> tuple[int, list[int] | None]:
        """How many plans were tried, each from where the one before it ended, and the firing sequence into the goal."""
        marking, path, seen = self.net.initial_marking, list[int](), set[Marking]()
        while marking not in seen:
            seen.add(marking)
            plan = self._plan(programme, marking)
            if plan is None:
                return len(seen) - 1, None
            attempt = self._attempt(plan, marking)
            path += attempt.path
            marking = attempt.marking
            if not attempt.left and self.is_reached(marking):
                return len(seen), path
        return len(seen), None

    def _plan(self, programme: Programme, marking: Marking) -> Plan | None:
        """A plan whose transitions can mark all that they need, if each of them fired often enough."""
        full = frozenset(p for p, bit in enumerate(f"{marking:b}"[::-1]) if bit == "1")
        programme.start_from(full)
        while plan := programme.plan(self.limits.deadline):
            chosen = replace(
                self.of,
                transitions=tuple(self.of.transitions[k] for k in plan),
                inputs=tuple(self.of.inputs[k] for k in plan),
                outputs=tuple(self.of.outputs[k] for k in plan),
                marked=full,
            )
            reached = markable(chosen)
            dead = [k for k in plan if not reached.issuperset(self.of.inputs[k])]
            if not dead:
                break
            programme.cut(dead, self._first_into(frozenset(range(self.of.n_places)) - reached))
        return plan

    def _first_into(self, places: Set[int]) -> list[int]:
        """The transitions that can put a token into some of these places while all of them are empty."""
        of = self.of
        return [
            k
            for k, (inputs, outputs) in enumerate(zip(of.inputs, of.outputs, strict=True))
            if not places.isdisjoint(outputs) and places.isdisjoint(inputs)
        ]

    def _attempt(self, plan: Plan, marking: Marking) -> _Attempt:
        """The best of some attempts to fire a plan in any order."""
        moves = _Moves(self.net, {k: self.of.transitions[k] for k in plan})
        best = moves.fired(plan, marking, self.draw, self.limits.deadline)
        for _ in range(_TRIES - 1):
            self.fired += len(best.path)
            if not best.left:
                break
            best = min(best, moves.fired(plan, marking, self.draw, self.limits.deadline), key=attrgetter("left"))
        return best


@dataclass(frozen=True)
class _Attempt:
    """A firing sequence of the extended net, the marking after it, and how many firings of the plan are left."""

    path: tuple[int, ...]
    marking: Marking
    left: int


class _Moves:
    """The firing rule of a plan's transitions, by masks: those of all transitions of a large net fill the memory."""

    def __init__(self, net: Net, transitions: Mapping[int, int]) -> None:
        self.transitions = transitions
        self.masks: dict[int, tuple[Marking, Marking, Marking]] = {}  # what is full before, what is empty, what changes
        self.touched: dict[int, list[int]] = {}
        seeing: dict[str, list[int]] = {}
        for k, t in transitions.items():
            of = net.transitions[t]
            full, empty = (*of.inputs, *of.permissive), (*of.outputs, *of.inhibitive)
            self.masks[k] = net.marking(full), net.marking(empty), net.marking((*of.inputs, *of.outputs))
            for place in {*full, *empty}:
                seeing.setdefault(place, []).append(k)
        for k, t in transitions.items():
            of = net.transitions[t]
            self.touched[k] = sorted({k, *(u for place in (*of.inputs, *of.outputs) for u in seeing[place])})

    def fired(self, plan: Plan, marking: Marking, draw: random.Random, deadline: Deadline) -> _Attempt:
        """Fire what is left of a plan as long as something can.

        Raises `BudgetExceeded` where the deadline is over.
        """
        left, path = dict(plan), list[int]()
        waiting = list(plan)  # all that may fire, and some that may not
        known = set(waiting)
        while waiting:
            if deadline.over:
                raise BudgetExceeded(OUT_OF_TIME)
            at = draw.randrange(len(waiting))
            waiting[at], waiting[-1] = waiting[-1], waiting[at]
            k = waiting.pop()
            known.remove(k)
            full, empty, changes = self.masks[k]
            if not left[k] or marking & full != full or marking & empty:
                continue
            marking ^= changes
            left[k] -= 1
            path.append(self.transitions[k])
            waiting += (u for u in self.touched[k] if u not in known)
            known.update(self.touched[k])
        return _Attempt(tuple(path), marking, sum(left.values()))
