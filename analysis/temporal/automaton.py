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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from firable.analysis.deadline import NEVER, Deadline
from firable.nets.formula import And, Constant, Formula, Not, Or
from firable.nets.temporal import (
    Eventually,
    Fires,
    Globally,
    Next,
    Release,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    WeakUntil,
    all_of,
    any_of,
    negated,
)

TRUE: Final = Constant(value=True)
FALSE: Final = Constant(value=False)


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


def positive(formula: Temporal) -> Temporal:
    """The formula with negations at atoms only, and with the operators X, U and R alone.

    >>> from firable.nets.temporal import format_temporal, parse_temporal
    >>> format_temporal(positive(parse_temporal("not G (p -> F q)")))
    'true U (p and (false R not q))'
    """
    match formula:
        case TemporalAnd(operands):
            return _all_of(map(positive, operands))
        case TemporalOr(operands):
            return _any_of(map(positive, operands))
        case Next(operand):
            return _next(positive(operand))
        case Eventually(operand):
            return _until(TRUE, positive(operand))
        case Globally(operand):
            return _release(FALSE, positive(operand))
        case Until(left, right):
            return _until(positive(left), positive(right))
        case Release(left, right):
            return _release(positive(left), positive(right))
        case WeakUntil(left, right):
            return _release(positive(right), _any_of((positive(left), positive(right))))
        case TemporalNot(operand):
            return _positive_of_negation(operand)
        case Not(Not(operand)):
            return positive(operand)
    return formula


def _positive_of_negation(formula: Temporal) -> Temporal:
    match formula:
        case TemporalNot(operand):
            return positive(operand)
        case TemporalAnd(operands):
            return _any_of(positive(negated(operand)) for operand in operands)
        case TemporalOr(operands):
            return _all_of(positive(negated(operand)) for operand in operands)
        case Next(operand):  # a run never ends: in a deadlock it stutters, so X is its own dual
            return _next(positive(negated(operand)))
        case Eventually(operand):
            return _release(FALSE, positive(negated(operand)))
        case Globally(operand):
            return _until(TRUE, positive(negated(operand)))
        case Until(left, right):
            return _release(positive(negated(left)), positive(negated(right)))
        case Release(left, right):
            return _until(positive(negated(left)), positive(negated(right)))
        case WeakUntil(left, right):
            either = any_of((left, right))
            return _until(positive(negated(right)), positive(negated(either)))
    return negated(formula)


def _all_of(operands: Iterable[Temporal]) -> Temporal:
    """A conjunction whose state formulas are one operand."""
    flat: dict[Temporal, None] = {}
    for operand in operands:
        parts = operand.operands if isinstance(operand, TemporalAnd) else (operand,)
        flat.update(dict.fromkeys(parts))
    states = tuple(one for one in flat if isinstance(one, Formula) and one != TRUE)
    others = tuple(one for one in flat if not isinstance(one, Formula))
    if FALSE in states:
        return FALSE
    state = states[0] if len(states) == 1 else And(states)
    if not others:
        return state if states else TRUE
    return all_of((state, *others) if states else others)


def _any_of(operands: Iterable[Temporal]) -> Temporal:
    """A disjunction whose state formulas are one operand."""
    flat: dict[Temporal, None] = {}
    for operand in operands:
        parts = operand.operands if isinstance(operand, TemporalOr) else (operand,)
        flat.update(dict.fromkeys(parts))
    states = tuple(one for one in flat if isinstance(one, Formula) and one != FALSE)
    others = tuple(one for one in flat if not isinstance(one, Formula))
    if TRUE in states:
        return TRUE
    state = states[0] if len(states) == 1 else Or(states)
    if not others:
        return state if states else FALSE
    return any_of((state, *others) if states else others)


def _next(operand: Temporal) -> Temporal:
    return operand if operand in {TRUE, FALSE} else Next(operand)


def _until(left: Temporal, right: Temporal) -> Temporal:
    if right in {TRUE, FALSE} or left == FALSE:
        return right
    match right:
        case Until(inner, _) if inner in {left, TRUE}:  # p U (p U q), F F q
            return right if inner == left or left == TRUE else _until(TRUE, right.right)
        case TemporalOr(operands) if left == TRUE:  # F (p or q)
            return _any_of(_until(TRUE, operand) for operand in operands)
        case Release(inner, Until(first, _) as goal) if left == TRUE and inner == FALSE and first == TRUE:  # F G F q
            return Release(FALSE, goal)
    return Until(left, right)


def _release(left: Temporal, right: Temporal) -> Temporal:
    if right in {TRUE, FALSE} or left == TRUE:
        return right
    match right:
        case Release(inner, _) if inner in {left, FALSE}:
            return right if inner == left or left == FALSE else _release(FALSE, right.right)
        case TemporalAnd(operands) if left == FALSE:
            return _all_of(_release(FALSE, operand) for operand in operands)
        case Until(inner, Release(first, _) as goal) if left == FALSE and inner == TRUE and first == FALSE:
            return Until(TRUE, goal)
    return Release(left, right)


def replaced(formula: Temporal, value: Callable[[Formula], Formula]) -> Temporal:
    """The (positive) formula with each state formula of it replaced, and simplified again."""
    match formula:
        case TemporalAnd(operands):
            return _all_of(replaced(operand, value) for operand in operands)
        case TemporalOr(operands):
            return _any_of(replaced(operand, value) for operand in operands)
        case Next(operand):
            return _next(replaced(operand, value))
        case Until(left, right):
            return _until(replaced(left, value), replaced(right, value))
        case Release(left, right):
            return _release(replaced(left, value), replaced(right, value))
    return value(formula) if isinstance(formula, Formula) else formula


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
    """The automaton that accepts the runs which satisfy a formula of LTL in the form that `positive` gives.

    Raises `TooLargeError` where it has more states than the limit, and `TimeEndedError`. Cost: exponential in the
    formula at worst, a few states at best.

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
