"""Reachability refuted by the state equation and traps: what every reachable marking satisfies, and none of the goal.

Three kinds of constraints hold in every reachable marking, whatever gates and contact forbid besides: places that can
never get a token are empty; a trap that is marked in M0 is marked; a sum of weighted tokens that no transition lowers
is not below that of M0 (the state equation, cut by cut: `firable.analysis.structure.inequalities`). Each is kept by
every firing, so all of them together are an inductive invariant, and if no marking satisfies them and the goal, the
goal is not reachable. The converse is false: the method can prove only that something is *not* reachable.

Method: Esparza and Melzer (2000, "Verification of safety properties using integer programming: beyond the state
equation"), with the roles turned round. z3 proposes a marking of the goal that satisfies the constraints found so far.
If a trap refutes it, or the state equation does (first the part of it that makes the goal true, then the whole), that
constraint is added; if neither does, the goal is undecided. So what remains is a small list of readable constraints, a
certificate that needs neither the solver's word nor the counts of firings. The rejected alternative, one integer
programme over markings and counts of firings, decides as much in one call, and its "unsatisfiable" is all it tells.

At the start the list holds draining sets that cover the net (`firable.analysis.structure.cover`): most are units, the
invariants an engineer would name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter

import z3

from firable.analysis.deadline import NEVER, Deadline
from firable.analysis.evidence.certificate import Clause, Equation, InductiveInvariant
from firable.analysis.goal import Finding, Limits
from firable.analysis.structure.asking import answer, solver_of
from firable.analysis.structure.cover import UnitSearch
from firable.analysis.structure.inequalities import AtLeast, Refuter, kept_by_all, never_more
from firable.analysis.structure.invariants import columns
from firable.analysis.structure.ordinary import markable, ordinary
from firable.analysis.structure.siphons import Rules, trap_rules
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost
from firable.semantics.formulas import evaluate

METHOD = "state equation and traps"


@dataclass
class Constraints:
    """What every reachable marking satisfies, as far as it was found, by index: places that are empty, units, ..."""

    net: Net
    empty: tuple[int, ...]
    units: list[tuple[int, ...]] = field(default_factory=list)
    inequalities: list[AtLeast] = field(default_factory=list)
    traps: list[tuple[int, ...]] = field(default_factory=list)

    def tokens(self, unit: Iterable[int]) -> int:
        """How many tokens a unit holds, in M0 and for ever."""
        return sum(self.net.places[p].marked for p in unit)

    def certificate(self) -> InductiveInvariant | None:
        """Their conjunction, which every firing keeps; None where a sum is kept only because transitions are dead."""
        if not kept_by_all(self.net, self.inequalities):
            return None
        names = [place.name for place in self.net.places]
        return InductiveInvariant(
            tuple(Equation(tuple((names[p], 1) for p in unit), self.tokens(unit)) for unit in self.units),
            (
                *(Clause(empty=(names[p],)) for p in self.empty),
                *(Clause(marked=tuple(names[p] for p in trap)) for trap in self.traps),
            ),
            inequalities=tuple(inequality.named(self.net) for inequality in self.inequalities),
        )


def decide_by_state_equation(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Refute that a marking satisfying the goal is reachable; never says that one is.

    Cost: a question to z3 for each constraint, and a linear programme of the net's size for each inequality.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import And, Holds
    >>> net = catalogue_net("one_robot")
    >>> both = And((Holds("robot.grasp_cv1"), Holds("robot.grasp_mc")))
    >>> decide_by_state_equation(net, both, Limits()).reachable
    False
    """
    return StateEquation(net)(goal, limits)


_OUT_OF_TIME = "the time was over"
_LEARNT_MAX = 64
"""So many inequalities, and as many traps, are kept from one goal to the next."""


class StateEquation:
    """Goals of one net, one after the other: what is found of the net for one of them is kept for all."""

    def __init__(self, net: Net) -> None:
        self.net = net
        self._of = ordinary(net)
        may_be_marked = markable(self._of)
        self._known = Constraints(net, tuple(p for p in range(self._of.n_places) if p not in may_be_marked))
        self._changes = columns(net)
        self._fires = [t for k, t in enumerate(self._of.transitions) if may_be_marked.issuperset(self._of.inputs[k])]
        self._learnt = Constraints(net, ())
        self._deadline = NEVER
        self._covering = self._cover()

    def _cover(self) -> Iterator[None]:
        """Look for draining sets that cover the net; stops after each, and goes on with one that the deadline ended.

        They are those of all transitions, so that each holds whatever else is known; with one token, or else with some.
        """
        of, covered = self._of, set[int]()
        for tokens_max in (1, None):
            drains = UnitSearch(self._changes, of.n_places, of.marked, tokens_max, draining=True)
            for place in range(of.n_places):
                drain = None
                while drain is None and place not in covered and place not in drains.covered:
                    drain = drains.unit(place, deadline=self._deadline)
                    if drain and drains.lossless([drain])[0]:
                        self._known.units.append(drain)
                    elif drain:
                        tokens = len(of.marked.intersection(drain))
                        self._known.inequalities.append(never_more(drain, tokens))
                    yield
            covered |= drains.covered

    @cached_property
    def _traps(self) -> Rules:
        return trap_rules(self._of)

    @cached_property
    def _refuter(self) -> Refuter:
        return Refuter([self._changes[t] for t in self._fires], self._of.n_places, self._of.marked)

    def __call__(self, goal: Formula, limits: Limits) -> Finding:
        """As `decide_by_state_equation`."""
        start = perf_counter()
        try:
            constraints, undecided = self._refuted(goal, limits.deadline)
        finally:
            if limits.deadline.over:  # a solver that was ended may take that for the next question, too
                self.__dict__.pop("_refuter", None)
        cost = Cost(seconds=perf_counter() - start)
        if constraints is None:
            return Finding(None, METHOD, bound=undecided, cost=cost)
        certificate = constraints.certificate()
        return Finding(reachable=False, method=METHOD, cost=cost, certificate=certificate)

    def _refuted(self, goal: Formula, deadline: Deadline) -> tuple[Constraints | None, str]:
        """The constraints that exclude the goal; or None, and why it is undecided."""
        self._deadline = deadline
        for _ in self._covering:
            if deadline.over:
                return None, _OUT_OF_TIME
        of, known, learnt = self._of, self._known, self._learnt
        inequalities = [*known.inequalities, *learnt.inequalities]
        search = _Search(
            self.net, goal, replace(known, units=[*known.units], inequalities=inequalities, traps=[*learnt.traps])
        )
        while True:
            said, full = search.next(deadline)
            if said == z3.unsat:
                needed = search.needed()
                self._learn(needed)
                return needed, ""
            if said != z3.sat:
                return None, _OUT_OF_TIME if deadline.over else "z3 gave up"
            trap = self._traps.largest(set(range(of.n_places)) - full)
            if trap & of.marked:
                search.add_trap(tuple(sorted(self._traps.smallest(trap, of.marked, deadline) or trap)))
                continue
            part = search.part(full, deadline)
            found = self._refuter.inequality(part & full, part - full, deadline)
            if found is None and len(part) < of.n_places:
                found = self._refuter.inequality(full, set(range(of.n_places)) - full, deadline)
            if found is None:
                told = "a marking of the goal solves the state equation and marks every trap that is marked at first"
                return None, _OUT_OF_TIME if deadline.over else told
            search.add_inequality(found)

    def _learn(self, needed: Constraints) -> None:
        """What excludes one goal often excludes the next."""
        known, learnt = set(self._known.inequalities), self._learnt
        learnt.inequalities += [of for of in needed.inequalities if of not in known and of not in learnt.inequalities]
        learnt.traps += [trap for trap in needed.traps if trap not in learnt.traps]
        del learnt.inequalities[:-_LEARNT_MAX], learnt.traps[:-_LEARNT_MAX]


class _Algebra:
    """The Boolean terms of one context of z3, as the algebra that formulas are evaluated in."""

    def __init__(self, context: z3.Context) -> None:
        self.context = context

    def conjunction(self, operands: Iterable[z3.BoolRef], /) -> z3.BoolRef:
        return z3.And([*operands, z3.And([], self.context)])

    def disjunction(self, operands: Iterable[z3.BoolRef], /) -> z3.BoolRef:
        return z3.Or([*operands, z3.Or([], self.context)])

    def negation(self, operand: z3.BoolRef, /) -> z3.BoolRef:
        return z3.Not(operand)


class _Search:
    """The markings of the goal that satisfy the constraints, asked of z3; and which part of one makes the goal true."""

    def __init__(self, net: Net, goal: Formula, known: Constraints) -> None:
        self.known, self.n_places = known, len(net.places)
        context = z3.Context()
        self.context = context
        self.places = [z3.Bool(f"p{i}", context) for i in range(self.n_places)]
        term = evaluate(_Algebra(context), net, goal, self.places.__getitem__)
        self.goal, self.contrary = solver_of(context), solver_of(context)
        self.goal.add(term)
        self.contrary.add(z3.Not(term))
        # Each constraint has a name, so that in the end it is known which of them are needed.
        self.names: list[z3.BoolRef] = []
        self.made: list[tuple[str, int]] = []
        for k, p in enumerate(known.empty):
            self._assert(z3.Not(self.places[p]), ("empty", k))
        for k, unit in enumerate(known.units):
            self._assert(z3.PbEq([(self.places[p], 1) for p in unit], known.tokens(unit)), ("unit", k))
        for k, inequality in enumerate(known.inequalities):
            self._assert(self._term(inequality), ("inequality", k))
        for k, trap in enumerate(known.traps):
            self._assert(z3.Or([self.places[p] for p in trap]), ("trap", k))

    def _assert(self, term: z3.BoolRef, made: tuple[str, int]) -> None:
        name = z3.Bool(f"c{len(self.names)}", self.context)
        self.names.append(name)
        self.made.append(made)
        self.goal.add(z3.Implies(name, term))

    def _term(self, inequality: AtLeast) -> z3.BoolRef:
        weighted = [
            (self.places[p], weight) if weight > 0 else (z3.Not(self.places[p]), -weight)
            for p, weight in inequality.weights
        ]
        least = inequality.tokens - sum(weight for _, weight in inequality.weights if weight < 0)
        return z3.PbGe(weighted, least)

    def add_trap(self, trap: tuple[int, ...]) -> None:
        self._assert(z3.Or([self.places[p] for p in trap]), ("trap", len(self.known.traps)))
        self.known.traps.append(trap)

    def add_inequality(self, inequality: AtLeast) -> None:
        self._assert(self._term(inequality), ("inequality", len(self.known.inequalities)))
        self.known.inequalities.append(inequality)

    def next(self, deadline: Deadline) -> tuple[z3.CheckSatResult, set[int]]:
        """What z3 says, and the full places of the marking that it found."""
        said = answer(self.goal, deadline, self.names)
        if said != z3.sat:
            return said, set()
        model = self.goal.model()
        return said, {p for p, place in enumerate(self.places) if z3.is_true(model[place])}

    def needed(self) -> Constraints:
        """The constraints that z3 needed to exclude the goal."""
        core = {name.get_id() for name in self.goal.unsat_core()}
        kept = {made for name, made in zip(self.names, self.made, strict=True) if name.get_id() in core}
        known = self.known
        # The empty places stay: traps and inequalities are kept by the transitions that can fire, which they say.
        return Constraints(
            known.net,
            known.empty,
            [unit for k, unit in enumerate(known.units) if ("unit", k) in kept],
            [inequality for k, inequality in enumerate(known.inequalities) if ("inequality", k) in kept],
            [trap for k, trap in enumerate(known.traps) if ("trap", k) in kept],
        )

    def part(self, full: set[int], deadline: Deadline) -> set[int]:
        """Places of a marking of the goal whose being full or empty makes the goal true, whatever the others are."""
        literals = [place if p in full else z3.Not(place) for p, place in enumerate(self.places)]
        if answer(self.contrary, deadline, literals) != z3.unsat:
            return set(range(self.n_places))
        core = {literal.get_id() for literal in self.contrary.unsat_core()}
        return {p for p, literal in enumerate(literals) if literal.get_id() in core}
