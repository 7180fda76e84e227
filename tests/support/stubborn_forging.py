"""Forged stubborn sets: of goals that are reachable, with sets that keep all rules but one, here and there.

A forger who knows the rules keeps those that cost him nothing. At each marking he begins with what the goal asks for,
or with any transitions, closes that under the rules (disabled) and (firable), and forgets now and then some of what
they ask for. Then he fires what is left, and draws again where that meets the goal.
"""

from __future__ import annotations

import random

from firable.analysis.evidence.certificate import Markings, StubbornSets
from firable.nets.formula import And, Compare, Count, Deadlock, Firable, Formula, Holds, Not, Or, Sign
from firable.nets.net import Marking, Net
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import Player, holds_in

TRIES = 12


def goal_of(draw: random.Random, net: Net) -> Formula:
    """A goal that is met in some markings and not in many."""
    names = [place.name for place in net.places]

    def some(of: int) -> tuple[Formula, ...]:
        return tuple(Holds(p) if draw.random() < 0.5 else Not(Holds(p)) for p in draw.sample(names, of))

    count = Compare(Count(tuple(draw.sample(names, 4))), draw.choice(list(Sign)), Count(added=draw.randint(0, 4)))
    found: list[Formula] = [
        Deadlock(),
        And((Deadlock(), *some(1))),
        And(some(draw.randint(2, 5))),
        Or((And(some(3)), And(some(4)))),
        And((Firable(draw.choice(net.transitions).name), *some(1))),
        And((count, *some(2))),
        count,
    ]
    return draw.choice(found)


def forged(draw: random.Random, net: Net, goal: Formula) -> StubbornSets | None:
    """Sets and markings by which the goal is not met; None where the forger finds none."""
    of = _Rules(net)
    found: dict[Marking, int] = {}
    todo = [net.initial_marking]
    while todo:
        marking = todo.pop()
        if marking in found:
            continue
        if evaluate(BOOL, net, goal, holds_in(marking)):
            return None
        for _ in range(TRIES):
            chosen = of.drawn(draw, marking, goal)
            after = [of.player.fire(marking, (t,)) for t in of.player.may_fire(marking) if t in chosen]
            if not any(evaluate(BOOL, net, goal, holds_in(one)) for one in after):
                break
        else:
            return None
        found[marking] = sum(1 << t for t in chosen)
        todo += after
    sets = tuple(dict.fromkeys(found.values()))
    return StubbornSets(Markings(tuple(found)), sets, tuple(sets.index(one) for one in found.values()))


class _Rules:
    """Who is in conflict with whom, and who enables whom, by the sides of the transitions."""

    def __init__(self, net: Net) -> None:
        self.net, self.player = net, Player(net)
        self.wants = [
            {(p, True) for p in (*t.inputs, *t.permissive)} | {(p, False) for p in (*t.outputs, *t.inhibitive)}
            for t in net.transitions
        ]
        self.flips = [{(p, True) for p in t.inputs} | {(p, False) for p in t.outputs} for t in net.transitions]

    def asked(self, draw: random.Random, marking: Marking, goal: Formula) -> set[int]:
        """Transitions of which one must fire before a goal is met that is not met here."""
        match goal:
            case And(operands):
                unmet = [one for one in operands if not evaluate(BOOL, self.net, one, holds_in(marking))]
                return self.asked(draw, marking, draw.choice(unmet))
            case Or(operands):
                return set[int]().union(*(self.asked(draw, marking, one) for one in operands))
            case Holds(place):
                return {u for u, flips in enumerate(self.flips) if (place, False) in flips}
            case Not(Holds(place)):
                return {u for u, flips in enumerate(self.flips) if (place, True) in flips}
            case Deadlock() | Firable():
                t = self.net.transition_index[goal.transition] if isinstance(goal, Firable) else -1
                return (
                    self.losing(draw.choice(self.player.may_fire(marking))) if t < 0 else self.serving(draw, marking, t)
                )
            case Compare(left, _, _):
                return {u for u, flips in enumerate(self.flips) if any(place in left.places for place, _ in flips)}
        raise ValueError(goal)

    def losing(self, t: int) -> set[int]:
        """Who may disable a firable transition."""
        return {u for u, flips in enumerate(self.flips) if flips & self.wants[t]}

    def serving(self, draw: random.Random, marking: Marking, t: int) -> set[int]:
        """Who makes one of its false conditions true."""
        index = self.net.place_index
        lacking = [(p, value) for p, value in sorted(self.wants[t]) if bool(marking >> index[p] & 1) != value]
        place, value = draw.choice(lacking) if lacking else ("", True)
        return {u for u, flips in enumerate(self.flips) if (place, not value) in flips}

    def drawn(self, draw: random.Random, marking: Marking, goal: Formula) -> set[int]:
        """A set that keeps the rules, but for what is forgotten."""
        firable, forgets = set(self.player.may_fire(marking)), draw.choice([0.0, 0.0, 0.05, 0.3])
        everyone = range(len(self.wants))
        chosen: set[int] = set()
        todo = draw.sample(everyone, min(len(everyone), draw.choice([0, 1, 2])))
        if firable and draw.random() < 0.8:
            todo = sorted(self.asked(draw, marking, goal))
        while todo:
            t = todo.pop()
            if t in chosen:
                continue
            chosen.add(t)
            if t in firable:
                more = {u for u in everyone if self.wants[u] & self.flips[t]}
            else:
                more = self.serving(draw, marking, t)
            todo += [u for u in sorted(more) if draw.random() >= forgets]
        return chosen
