"""Linear inequalities that hold in every reachable marking, made to measure for one that shall be excluded.

Every firing adds a column of the incidence matrix to the marking. So a sum of weighted tokens, a M, never falls if no
transition lowers it (a C >= 0), and every reachable marking satisfies a M >= a M0: an inductive inequality. A marking M
solves the *state equation* M = M0 + C x for some real x >= 0 iff it satisfies all of these (Farkas' lemma); if it does
not solve it, one of them shows that, and is found by linear programming over a. Weights may be negative. P-invariants
are the case a C = 0.

What is excluded is a part of a marking: some places full, some empty, the rest anything between 0 and 1, since every
place holds at most one token under the firing rule. One inequality then excludes all markings with that part.

Arithmetic is z3's, rational and exact, and each inequality is multiplied out against every transition again before it
is handed out. The rejected alternative, a floating-point solver with its answer checked afterwards, is faster on
thousands of places and one more dependency; and what it leaves undecided by a rounding error is undecided.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import gcd, lcm

import z3

from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import Inequality
from firable.analysis.structure.asking import WEIGHTS_MAX, answer, solver_of
from firable.analysis.structure.linear import Sparse
from firable.nets.net import Net


@dataclass(frozen=True, slots=True)
class AtLeast:
    """The sum of weight times token over the places (by index) is at least so much, in every reachable marking."""

    weights: tuple[tuple[int, int], ...]
    tokens: int

    def named(self, net: Net) -> Inequality:
        """The same with the names of the places, as certificates have it."""
        return Inequality(tuple((net.places[p].name, weight) for p, weight in self.weights), self.tokens)


def kept_by_all(net: Net, inequalities: Iterable[AtLeast]) -> bool:
    """Whether no transition lowers a sum, those included that can never fire for other reasons than a self-loop.

    A certificate must show it of each sum for itself, without what is known of places that stay empty.
    """
    index, of_place = net.place_index, dict[int, list[int]]()
    for t, transition in enumerate(net.transitions):
        if not transition.self_loops:
            for name in (*transition.inputs, *transition.outputs):
                of_place.setdefault(index[name], []).append(t)
    for inequality in inequalities:
        weights = dict(inequality.weights)
        for t in {t for p in weights for t in of_place.get(p, ())}:
            put = sum(weights.get(index[name], 0) for name in net.transitions[t].outputs)
            if put < sum(weights.get(index[name], 0) for name in net.transitions[t].inputs):
                return False
    return True


def never_more(places: Iterable[int], tokens: int) -> AtLeast:
    """That the places hold at most so many tokens."""
    return AtLeast(tuple((p, -1) for p in places), -tokens)


class Refuter:
    """Finds inequalities of one net; `columns` are those of its transitions that can fire, `marked` is M0."""

    def __init__(self, columns: Iterable[Sparse], n_places: int, marked: frozenset[int]) -> None:
        self.columns = list({tuple(sorted(column.items())) for column in columns if column})
        self.marked, self.n_places = marked, n_places
        # As text, which z3 reads ten times as fast as it is told terms.
        self.solver = solver_of(z3.Context(), logic="QF_LRA")
        lines = [f"(declare-const a{p} Real)(declare-const u{p} Real)" for p in range(n_places)]
        lines += [f"(assert (and (>= u{p} 0.0) (>= u{p} a{p})))" for p in range(n_places)]
        for column in self.columns:
            terms = " ".join(f"a{p}" if change > 0 else f"(- a{p})" for p, change in column)
            lines.append(f"(assert (>= (+ 0.0 {terms}) 0.0))")
        self.solver.from_string("\n".join(lines))

    def inequality(self, full: Iterable[int], empty: Iterable[int], deadline: Deadline) -> AtLeast | None:
        """An inequality that no marking with these places full and these empty satisfies.

        None where none was found whose weights a solver takes.
        """
        chosen, without = set(full), set(empty)
        # The most that a M can be, and what it is in M0: the weights are scaled so that they are 1 apart at least.
        most = [f"{'a' if p in chosen else 'u'}{p}" for p in range(self.n_places) if p not in without]
        initial = [f"(- a{p})" for p in sorted(self.marked)]
        if deadline.over:
            return None
        self.solver.push()
        try:
            self.solver.from_string(f"(assert (<= (+ 0.0 0.0 {' '.join([*most, *initial])}) (- 1.0)))")
            if answer(self.solver, deadline) != z3.sat:
                return None
            model = self.solver.model()
            values = {declared.name(): model[declared] for declared in model.decls()}
        finally:
            self.solver.pop()
        fractions = {
            p: (value.numerator_as_long(), value.denominator_as_long())
            for p in range(self.n_places)
            if (value := values.get(f"a{p}")) is not None and value.numerator_as_long()
        }
        scale = lcm(*(denominator for _, denominator in fractions.values()))
        whole = {p: numerator * (scale // denominator) for p, (numerator, denominator) in fractions.items()}
        divisor = gcd(*whole.values())
        weights = {p: weight // divisor for p, weight in whole.items()}
        if sum(map(abs, weights.values())) > WEIGHTS_MAX:
            return None
        found = AtLeast(tuple(weights.items()), sum(weight for p, weight in weights.items() if p in self.marked))
        self._check(found, chosen, without)
        return found

    def _check(self, found: AtLeast, full: set[int], empty: set[int]) -> None:
        weights = dict(found.weights)
        falls = any(sum(weights.get(p, 0) * change for p, change in column) < 0 for column in self.columns)
        most = sum(weight if p in full else max(0, weight) for p, weight in found.weights if p not in empty)
        if falls or most >= found.tokens:
            raise AssertionError("an inequality that is not inductive, or excludes nothing, came out of the solver")
