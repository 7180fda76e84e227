"""What may lead into a cube of markings in one firing, asked of a solver that learns, level by level.

One solver holds everything: for each place a Boolean "holds a token now", for each transition "fires", at most one of
them, and for each place "holds a token after" and "is empty after". The last two are only implied as far as a question
needs them: after(p) if p holds now and no consumer fires, or a producer does. Clauses of level i have a switch of that
level in front of them; a question about level i turns on the switches of i and above, because what holds for more
firings holds for fewer (Eén, Mishchenko and Brayton 2011). Level 0 is M0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import z3

from firable.analysis.evidence.certificate import Clause
from firable.analysis.induction.session import Session
from firable.analysis.induction.smt import Answer, Term, Terms
from firable.analysis.induction.strengthening import Facts
from firable.nets.bits import bits
from firable.nets.net import Marking, Net
from firable.semantics.firing import firable

_QUESTIONS_MAX: Final = 1_500  # before the solver is made anew, without what was asked in passing


@dataclass(frozen=True, slots=True)
class Cube:
    """The markings in which all places of `full` hold a token and all of `empty` none, as masks."""

    full: Marking
    empty: Marking

    def contains(self, marking: Marking) -> bool:
        """Whether a marking is among them."""
        return not self.full & ~marking and not self.empty & marking

    def includes(self, other: Cube) -> bool:
        """Whether all markings of another cube are among them."""
        return not self.full & ~other.full and not self.empty & ~other.empty

    def literals(self) -> Iterator[Cube]:
        """The cubes of one literal whose intersection it is."""
        for i in bits(self.full):
            yield Cube(1 << i, 0)
        for i in bits(self.empty):
            yield Cube(0, 1 << i)

    def without(self, other: Cube) -> Cube:
        """The literals that another cube does not have."""
        return Cube(self.full & ~other.full, self.empty & ~other.empty)

    def order(self) -> tuple[int, int, int]:
        """A key that puts the general ones first."""
        return self.full.bit_count() + self.empty.bit_count(), self.full, self.empty


class StepsInto:
    """The solver of the module's essay."""

    def __init__(self, session: Session, net: Net) -> None:
        self.session, self.net = session, net
        terms = Terms()
        places = [terms.variable(place.name) for place in net.places]
        self._now = session.translated(places)
        self._empty_now = [z3.Not(p) for p in self._now]
        self._fires = [session.variable(f"fires({t.name})") for t in net.transitions]
        self._switches: list[z3.BoolRef] = []
        self._after: dict[tuple[int, bool], z3.BoolRef] = {}
        self._lasting: list[z3.BoolRef] = []
        self._blocked: list[tuple[Cube, int]] = []
        self._asked = 0
        self._solver = session.solver()
        may_fire = (
            firable(terms, net, t, places.__getitem__) if transition.openable else terms.false
            for t, transition in enumerate(net.transitions)
        )
        for fires, allowed in zip(self._fires, session.translated(list(may_fire)), strict=True):
            self._keep(z3.Implies(fires, allowed))
        if len(self._fires) > 1:
            self._keep(z3.AtMost(*self._fires, 1))
        for p in range(len(net.places)):
            self._keep(session.some([z3.Not(self._switch(0)), self._literal(p, net.places[p].marked)]))

    def _literal(self, p: int, full: bool) -> z3.BoolRef:
        return self._now[p] if full else self._empty_now[p]

    def _switch(self, level: int) -> z3.BoolRef:
        while len(self._switches) <= level:
            self._switches.append(self.session.variable(f"level {len(self._switches)}"))
        return self._switches[level]

    def _keep(self, term: z3.BoolRef) -> None:
        self._lasting.append(term)
        self._solver.add(term)

    def learn(self, facts: Facts) -> None:
        """Facts that hold in every reachable marking."""
        index = self.net.place_index
        for equation in facts.equations:
            self._keep(
                z3.PbEq([(self._now[index[name]], weight) for name, weight in equation.weights], equation.tokens)
            )
        for clause in facts.clauses:
            self._keep(self._some(clause))

    def _some(self, clause: Clause) -> z3.BoolRef:
        index = self.net.place_index
        marked = [self._now[index[name]] for name in clause.marked]
        return self.session.some([*marked, *(self._empty_now[index[name]] for name in clause.empty)])

    def _not_in(self, cube: Cube) -> list[z3.BoolRef]:
        return [*(self._empty_now[i] for i in bits(cube.full)), *(self._now[i] for i in bits(cube.empty))]

    def block(self, cube: Cube, level: int) -> None:
        """No marking of the level, or of one below, is in the cube."""
        self._keep(self.session.some([z3.Not(self._switch(level)), *self._not_in(cube)]))

    def named_goal(self, goal: Term) -> z3.BoolRef:
        """A literal that implies a term over the places."""
        name = self.session.variable("goal ")
        self._keep(z3.Implies(name, *self.session.translated([goal])))
        return name

    def _renew(self) -> None:
        """Make the solver anew where it is time; before a question, as what is said for one question alone is lost."""
        if self._asked >= _QUESTIONS_MAX:
            self._asked, self._solver = 0, self.session.solver()
            self._solver.add(*self._lasting)

    def may_hold(self, literal: z3.BoolRef, level: int) -> bool:
        """Whether a marking that the level allows satisfies a literal."""
        self._renew()
        return self._ask([literal], level) is Answer.SAT

    def marking(self) -> Marking:
        """The marking of the last answer."""
        model = self._solver.model()
        return sum(1 << i for i, place in enumerate(self._now) if z3.is_true(model[place]))

    def _ask(self, assumptions: list[z3.BoolRef], level: int) -> Answer:
        self._asked += 1
        self._switch(level)
        return self.session.ask(self._solver, *self._switches[level:], *assumptions)

    def into(self, cube: Cube, level: int) -> tuple[int | None, Cube]:
        """A transition that leads from outside the cube, at a level, into it; or None, and a cube for which that is so.

        The cube given back includes the one asked about, and does not hold M0 if that does not.
        """
        wanted = {self._after_literal(i, full=True): Cube(1 << i, 0) for i in bits(cube.full)}
        wanted |= {self._after_literal(i, full=False): Cube(0, 1 << i) for i in bits(cube.empty)}
        self._renew()
        # Outside the cube, for this question only.
        here = self.session.variable(f"asked {self._asked} ")
        self._solver.add(self.session.some([z3.Not(here), *self._not_in(cube)]))
        answer = self._ask([here, *wanted], level)
        if answer is Answer.SAT:
            model = self._solver.model()
            by = next(t for t in self._touching(cube) if z3.is_true(model[self._fires[t]]))
            self._solver.add(z3.Not(here))
            return by, cube
        core = {literal.get_id() for literal in self._solver.unsat_core()}
        self._solver.add(z3.Not(here))
        kept = [one for literal, one in wanted.items() if literal.get_id() in core]
        smaller = Cube(sum(one.full for one in kept), sum(one.empty for one in kept))
        initial = self.net.initial_marking
        if smaller.contains(initial):
            # A literal that M0 does not satisfy keeps it out; the cube has one.
            smaller = next((_joined(smaller, one) for one in cube.literals() if not one.contains(initial)), cube)
        return None, smaller

    def _touching(self, cube: Cube) -> list[int]:
        places = list(bits(cube.full | cube.empty))
        return sorted({t for p in places for t in (*self.net.consumers[p], *self.net.producers[p])})

    def _after_literal(self, p: int, *, full: bool) -> z3.BoolRef:
        """A literal that implies that the place holds a token (or none) after the firing."""
        if (p, full) not in self._after:
            after = self.session.variable(f"{self.net.places[p].name}{chr(39)}{int(full)}")
            net = self.net
            making, undoing = (net.producers, net.consumers) if full else (net.consumers, net.producers)
            made = (self._fires[t] for t in making[p])
            self._keep(self.session.some([z3.Not(after), self._literal(p, full), *made]))
            for t in undoing[p]:
                self._keep(self.session.some([z3.Not(after), z3.Not(self._fires[t])]))
            self._after[p, full] = after
        return self._after[p, full]

    def before(self, cube: Cube, by: int) -> Cube:
        """The markings from which a transition leads into a cube, where it does so from one."""
        masks = self.net.masks[by]
        touched = masks.inputs | masks.outputs
        full = masks.inputs | masks.permissive | (cube.full & ~touched)
        return Cube(full, masks.outputs | masks.inhibitive | (cube.empty & ~touched))


def _joined(cube: Cube, other: Cube) -> Cube:
    return Cube(cube.full | other.full, cube.empty | other.empty)
