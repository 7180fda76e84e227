"""Büchi automata from formulas of LTL, by a tableau.

A state of the automaton is a set of formulas that the rest of the run owes. Each is unfolded into what must hold
now and what is owed next, `p U q` being `q`, or `p` now and `p U q` next (Couvreur 1999, "On-the-fly verification of
linear temporal logic"): each alternative is an edge. An edge that puts `p U q` off without meeting `q` lacks its mark,
and a run is accepted iff it takes edges with each mark again and again: a transition-based generalised automaton, which
is smaller than the state-based one of Gerth, Peled, Vardi and Wolper (1995) that it comes from.

Atoms are not letters but the largest parts of the formula that are state formulas: they are evaluated as wholes, and
a part that holds in every reachable marking, or in none, is replaced before the tableau is built. An edge whose atoms
hold nowhere together is left out; states with the same edges are one. That keeps automata to a few states, where the
alphabet of all valuations would have them explode. Rejected: determinisation (needed for nothing here) and very weak
alternating automata (better for long formulas, which nobody writes about a cell).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from firable.analysis.deadline import NEVER, Deadline
from firable.nets.formula import Constant, Formula
from firable.nets.temporal import (
    Fires,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    negated,
)


class TooLargeError(RuntimeError):
    """The automaton of a formula has more states than the limit."""


class TimeEndedError(RuntimeError):
    """The deadline came first."""


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge: what must hold in the marking and be true of the next firing, where it leads, and its marks.

    `fires` are transitions one of which must fire (all of them: so exactly one is possible), `spared` must not.
    """

    atoms: frozenset[Formula]
    fires: frozenset[str]
    spared: frozenset[str]
    target: int
    marks: frozenset[int]


@dataclass(frozen=True, slots=True)
class Automaton:
    """A generalised Büchi automaton: the edges of each state, from state 0; a run needs each of the marks for ever."""

    edges: tuple[tuple[Edge, ...], ...]
    n_marks: int


_Owed = frozenset[Temporal]


@dataclass(frozen=True, slots=True)
class _Term:
    """One alternative: what holds now, what is owed next, and the untils that are put off."""

    now: _Owed = frozenset()
    owed: _Owed = frozenset()
    put_off: _Owed = frozenset()

    def joined(self, other: _Term) -> _Term:
        return _Term(self.now | other.now, self.owed | other.owed, self.put_off | other.put_off)

    def covers(self, other: _Term) -> bool:
        return self.now <= other.now and self.owed <= other.owed and self.put_off <= other.put_off


def _joined(left: Iterable[_Term], right: list[_Term]) -> Iterator[_Term]:
    for one in left:
        for other in right:
            both = one.joined(other)
            if not any(negated(literal) in both.now for literal in both.now):
                yield both


class _Tableau:
    def __init__(self, states_max: int, deadline: Deadline) -> None:
        self.states_max, self.deadline = states_max, deadline
        self.terms_max = 5 * states_max
        self.unfolded: dict[Temporal, list[_Term]] = {}

    def unfold(self, formula: Temporal) -> list[_Term]:
        if formula not in self.unfolded:
            self.unfolded[formula] = self.least(self._unfold(formula))
        return self.unfolded[formula]

    def _unfold(self, formula: Temporal) -> Iterable[_Term]:
        match formula:
            case Constant(value):
                return [_Term()] if value else []
            case TemporalAnd(operands):
                return self.together(frozenset(operands))
            case TemporalOr(operands):
                return [term for operand in operands for term in self.unfold(operand)]
            case Next(operand):
                owed = operand.operands if isinstance(operand, TemporalAnd) else (operand,)
                return [_Term(owed=frozenset(owed))]
            case Until(left, right):
                later = _Term(owed=frozenset({formula}), put_off=frozenset({formula}))
                return [*self.unfold(right), *_joined(self.unfold(left), [later])]
            case Release(left, right):
                later = _Term(owed=frozenset({formula}))
                return _joined(self.unfold(right), [*self.unfold(left), later])
        return [_Term(now=frozenset({formula}))]

    def together(self, formulas: _Owed) -> list[_Term]:
        terms = [_Term()]
        for formula in sorted(formulas, key=repr):
            terms = self.least(_joined(terms, self.unfold(formula)))
        return terms

    def least(self, terms: Iterable[_Term]) -> list[_Term]:
        """The alternatives that no other one covers."""
        found: list[_Term] = []
        for term in dict.fromkeys(terms):
            if self.deadline.over:
                raise TimeEndedError
            if len(found) > self.terms_max:
                raise TooLargeError(f"the formula has more than {self.terms_max:,} alternatives at one time")
            if not any(other.covers(term) for other in found):
                found = [other for other in found if not term.covers(other)]
                found.append(term)
        return found

    def automaton(self, formula: Temporal) -> Automaton:
        start: _Owed = frozenset(formula.operands) if isinstance(formula, TemporalAnd) else frozenset({formula})
        states: dict[_Owed, int] = {start: 0}
        terms: list[list[_Term]] = []
        for state in (todo := [start]):
            terms.append(self.together(state))
            for term in terms[-1]:
                if term.owed not in states:
                    states[term.owed] = len(states)
                    todo.append(term.owed)
                    if len(states) > self.states_max:
                        raise TooLargeError(f"the automaton of the formula has more than {self.states_max:,} states")
        untils = {until: mark for mark, until in enumerate(dict.fromkeys(self._untils(terms)))}
        marks = frozenset(untils.values())
        edges = tuple(
            tuple(_edge(term, states[term.owed], marks - {untils[u] for u in term.put_off}) for term in of)
            for of in terms
        )
        return Automaton(edges, len(untils))

    @staticmethod
    def _untils(terms: list[list[_Term]]) -> Iterator[Temporal]:
        for of in terms:
            for term in of:
                yield from sorted(term.put_off, key=repr)


def _edge(term: _Term, target: int, marks: frozenset[int]) -> Edge:
    return Edge(
        frozenset(one for one in term.now if isinstance(one, Formula)),
        frozenset(one.transition for one in term.now if isinstance(one, Fires)),
        frozenset(
            one.operand.transition
            for one in term.now
            if isinstance(one, TemporalNot) and isinstance(one.operand, Fires)
        ),
        target,
        marks,
    )


def automaton_of(formula: Temporal, states_max: int = 2_000, deadline: Deadline = NEVER) -> Automaton:
    """The automaton that accepts the runs which satisfy a formula of LTL in the form that `rewriting.positive` gives.

    Raises `TooLargeError` where it has more states than the limit, and `TimeEndedError`. Cost: exponential in the
    formula at worst, a few states at best.

    >>> from firable.analysis.temporal.rewriting import positive
    >>> from firable.nets.temporal import parse_temporal
    >>> automaton = automaton_of(positive(parse_temporal("G F p")))
    >>> len(automaton.edges), automaton.n_marks
    (1, 1)
    """
    return merged(_Tableau(states_max, deadline).automaton(formula))


def merged(automaton: Automaton) -> Automaton:
    """The automaton with one state for all that have the same edges, and without states that are not reached."""
    of = list(range(len(automaton.edges)))
    while True:
        seen: dict[frozenset[Edge], int] = {}
        now = [
            seen.setdefault(frozenset(replace(edge, target=of[edge.target]) for edge in edges), state)
            for state, edges in enumerate(automaton.edges)
        ]
        # A state keeps the lowest of its class; classes are only ever joined, so this ends.
        joined = [now[of[state]] for state in range(len(now))]
        if joined == of:
            break
        of = joined
    numbers = {of[0]: 0}
    rows: list[tuple[Edge, ...]] = []
    for state in (todo := [of[0]]):
        row = []
        for edge in automaton.edges[state]:
            target = of[edge.target]
            if target not in numbers:
                numbers[target] = len(numbers)
                todo.append(target)
            row.append(replace(edge, target=numbers[target]))
        rows.append(tuple(dict.fromkeys(row)))
    return Automaton(tuple(rows), automaton.n_marks)
