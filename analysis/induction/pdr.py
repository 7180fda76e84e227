"""Property-directed reachability: an inductive invariant built clause by clause, from what stands in its way.

Bradley (2011, "SAT-based model checking without unrolling", IC3) in the form of Eén, Mishchenko and Brayton (2011,
"Efficient implementation of property directed reachability"). Level i is a set of clauses that hold in all markings of
up to i firings. A marking of the last level in the goal is blocked if no marking of the level before leads to it; if
one does, that is blocked first, one level lower, down to M0, from where the way is a run into the goal. What is blocked
is a *cube*, some places full and some empty, and it is made as general as the question allows. When a level has all the
clauses of the next, they are an inductive invariant, and with it the certificate.

Petri nets make two steps of it exact. The markings from which a transition leads into a cube are again a cube (its
inputs and gates, and the rest of the cube), so that nothing needs to be lifted from a solver's model; and nothing moves
without a transition that touches the cube. P-invariants and marked traps are known from the start or found on the way,
as in `firable.analysis.induction.k_induction`; unlike there, the method ends on every net, if it is given the time.

Only interleaving: the markings from which a step leads into a cube are no cube. The rejected alternative, z3's own
engine of this kind (Spacer), can neither be told of invariants nor be interrupted reliably.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from time import perf_counter
from typing import Final

from firable.analysis.evidence.certificate import Clause, InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.induction.bounded import reached, shortened
from firable.analysis.induction.session import LimitReachedError, Session
from firable.analysis.induction.smt import Operator, Term, Terms, value, values_of, variables
from firable.analysis.induction.steps_into import Cube, StepsInto
from firable.analysis.induction.strengthening import Facts, Traps, structural_facts
from firable.analysis.spaces.space import Witnesses
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost, Witness
from firable.semantics.formulas import evaluate
from firable.semantics.trace import Discipline

METHOD: Final = "property-directed reachability"
_FAILURES_MAX: Final = 8  # of dropping a literal, before a cube is general enough


def decide_by_pdr(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Whether a marking satisfying the goal is reachable under interleaving: a run into it, or an inductive invariant.

    >>> from firable.nets.catalogue.families import family_net
    >>> from firable.nets.formula import Deadlock
    >>> decide_by_pdr(family_net("philosophers-3"), Deadlock(), Limits()).reachable
    True
    """
    start, proof = perf_counter(), None
    try:
        with Session(limits) as session:
            proof = _Proof(session, net, goal)
            reachable = proof.decide()
    except LimitReachedError:
        reachable = None
    cost = Cost(seconds=perf_counter() - start)
    if proof is None or reachable is None:
        levels = 0 if proof is None else len(proof.levels) - 1
        return Finding(None, METHOD, bound=f"not reached by {levels} firings, and no invariant by then", cost=cost)
    if reachable:
        return Finding(reachable, METHOD, proof.found, cost=cost)
    clauses = (*proof.facts.clauses, *map(proof.clause, proof.invariant))
    certificate = InductiveInvariant(proof.facts.equations, clauses)
    return Finding(reachable, METHOD, cost=cost, certificate=certificate)


@dataclass(frozen=True, slots=True)
class _Duty:
    """A cube to be blocked; firing `by` leads from all of its markings to those of `then`, and at last to the goal."""

    cube: Cube
    by: int = -1
    then: _Duty | None = None


class _Proof:
    """The levels, each with the cubes that were blocked there and not at a higher one."""

    def __init__(self, session: Session, net: Net, goal: Formula) -> None:
        self.session, self.net, self.goal = session, net, goal
        self.levels: list[set[Cube]] = [set()]
        self.facts = Facts()
        self.invariant: list[Cube] = []
        self.found: Witness | None = None

    def clause(self, cube: Cube) -> Clause:
        """That no marking is in a cube."""
        return Clause(self.net.names(cube.empty), self.net.names(cube.full))

    def decide(self) -> bool:
        """Whether the goal is reachable; raises `LimitReachedError` at the deadline."""
        net, terms = self.net, Terms()
        places = [terms.variable(place.name) for place in net.places]
        goal = evaluate(terms, net, self.goal, places.__getitem__)
        if value(goal, {place.name: place.marked for place in net.places}):
            return self._reached(_Duty(Cube(0, 0)))
        self.facts, self._traps = structural_facts(net, self.session.deadline), Traps(net, Discipline.INTERLEAVING)
        self._steps = StepsInto(self.session, net)
        self._steps.learn(self.facts)
        bad = self._steps.named_goal(goal)
        while True:
            self.levels.append(set())
            while self._steps.may_hold(bad, len(self.levels) - 1):
                marking = self._steps.marking()
                if (trap := self._traps.against(marking, self.session.deadline)) is not None:
                    self.facts = Facts(self.facts.equations, (*self.facts.clauses, trap))
                    self._steps.learn(Facts((), (trap,)))
                elif (end := self._block(_Duty(_justified(net, goal, marking)))) is not None:
                    return self._reached(end)
            if self._pushed():
                return False

    def _reached(self, duty: _Duty) -> bool:
        fired = []
        while duty.then is not None:
            fired.append(duty.by)
            duty = duty.then
        firings = shortened(self.net, self.goal, fired)
        self.found = Witnesses(self.net, Discipline.INTERLEAVING).replayed(firings, reached(self.net, firings))
        return True

    def _block(self, bad: _Duty) -> _Duty | None:
        """Block a cube at the last level, and first all that leads to it; a duty that holds M0 where that fails."""
        last = len(self.levels) - 1
        queue, number = [(last, 0, bad)], 0
        while queue:
            level, _, duty = heappop(queue)
            if duty.cube.contains(self.net.initial_marking):
                return duty
            if any(cube.includes(duty.cube) for i in range(level, last + 1) for cube in self.levels[i]):
                continue
            number += 1
            by, core = self._steps.into(duty.cube, level - 1)
            if by is not None:
                heappush(queue, (level - 1, -number, _Duty(self._steps.before(duty.cube, by), by, duty)))
                heappush(queue, (level, -number, duty))
                continue
            cube = self._general(core, level)
            while level < last and self._steps.into(cube, level)[0] is None:
                level += 1
            self._add(cube, level)
            if level < last:
                heappush(queue, (level + 1, -number, duty))
        return None

    def _general(self, cube: Cube, level: int) -> Cube:
        """A cube with fewer literals that no marking of the level before leads to either."""
        failures = 0
        for literal in cube.literals():
            smaller = cube.without(literal)
            if smaller == cube or smaller.contains(self.net.initial_marking):
                continue
            by, core = self._steps.into(smaller, level - 1)
            if by is None:
                cube = core
            elif (failures := failures + 1) == _FAILURES_MAX:
                break
        return cube

    def _add(self, cube: Cube, level: int) -> None:
        for i in range(1, level + 1):
            self.levels[i] = {other for other in self.levels[i] if not cube.includes(other)}
        self.levels[level].add(cube)
        self._steps.block(cube, level)

    def _pushed(self) -> bool:
        """Push clauses to the next level as far as they hold there; whether a level has none of its own left."""
        for level in range(1, len(self.levels) - 1):
            for cube in sorted(self.levels[level], key=Cube.order):
                if cube in self.levels[level] and self._steps.into(cube, level)[0] is None:
                    self._add(cube, level + 1)
            if not self.levels[level]:
                self.invariant = sorted(set().union(*self.levels[level + 1 :]), key=Cube.order)
                return True
        return False


def _justified(net: Net, goal: Term, marking: int) -> Cube:
    """A cube that holds the marking, and in all markings of which the goal is true."""
    assignment = {name: bool(marking >> net.place_index[name] & 1) for name in variables([goal])}
    values = values_of(goal, assignment)
    full = empty = 0
    todo, seen = [goal], set[Term]()
    while todo:
        term = todo.pop()
        if term in seen:
            continue
        seen.add(term)
        match term.operator:
            case Operator.VARIABLE:
                bit = 1 << net.place_index[term.name]
                full, empty = (full | bit, empty) if values[term] else (full, empty | bit)
            case Operator.AND | Operator.OR if values[term] is (term.operator is Operator.OR):
                # One operand decides: one that is decided already, or else a literal, or else the first.
                deciding = [operand for operand in term.operands if values[operand] is values[term]]
                known = (operand for operand in deciding if operand in seen)
                atoms = (operand for operand in deciding if _is_literal(operand))
                todo.append(next(known, None) or next(atoms, deciding[0]))
            case _:
                todo += term.operands
    return Cube(full, empty)


def _is_literal(term: Term) -> bool:
    return not term.operands or (term.operator is Operator.NOT and not term.operands[0].operands)
