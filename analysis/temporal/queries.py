"""Queries answered: each kind of question that is asked of a net from outside, over any state space.

What each kind means is said in docs/queries.md; that the contact rule keeps every net safe, and what `one_safe` is then
about, too. An `EF p` or `AG p` over a state formula is decided by the first marking found (`as_goal` hands it to the
techniques that need no state space at all); everything else needs all markings, and is unknown without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, TypeVar

from firable.analysis._engine import BudgetExceeded
from firable.analysis.question import Answer, Question, listed, no, unknown, yes
from firable.analysis.spaces.space import StateSpace, WitnessError
from firable.analysis.temporal.automaton import TimeEndedError, TooLargeError
from firable.analysis.temporal.ctl import Ctl, satisfied
from firable.analysis.temporal.evidence import refuted, shown
from firable.analysis.temporal.lasso import TooLongError, accepted_run, satisfies, witness_of
from firable.analysis.temporal.ltl import refuting
from firable.analysis.temporal.sets import Sets
from firable.nets.formula import Count, Formula, Not, format_count
from firable.nets.net import TemporalProperty
from firable.nets.queries import Query, QueryKind, format_query
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Temporal,
    format_temporal,
)
from firable.nets.temporal_parts import has_events
from firable.nets.verdict import Verdict, Witness
from firable.semantics.trace import Discipline

S = TypeVar("S")
_SHOWN_SHARE: Final = 0.25  # of the time that is left, for the run that shows an answer that is known


def as_goal(formula: Temporal | None) -> tuple[Formula, bool] | None:
    """The goal that decides a formula, and whether reaching it makes the formula hold; None where no goal does.

    `EF p` holds iff p is reachable, `AG p` holds iff `not p` is not.

    >>> from firable.nets.temporal import parse_temporal
    >>> as_goal(parse_temporal("AG p"))
    (Not(operand=Holds(place='p')), False)
    """
    match formula:
        case Exists(Eventually(operand)) if isinstance(operand, Formula):
            return operand, True
        case ForAll(Globally(operand)) if isinstance(operand, Formula):
            return Not(operand), False
        case Globally(operand) if isinstance(operand, Formula):
            return Not(operand), False
    return None


def answer(space: StateSpace[Any], query: Query) -> Verdict:
    """The verdict `query.NAME` on a query, under the discipline of the space.

    Unknown where the space is not whole and the query needs it, and where the deadline of the space comes.
    """
    if query.kind is QueryKind.BOUND:
        return _bounded(space, query)
    return question_of(query).ask(space, lambda: _answered(space, query))


def decide_temporal(space: StateSpace[Any], of: TemporalProperty) -> Verdict:
    """The verdict `property.NAME` on a property of the net in CTL or LTL."""
    return temporal_question(of).ask(space, lambda: _answered(space, _query(of)))


def question_of(query: Query) -> Question:
    """The question that a query is; the statement of a bound lacks the number."""
    return Question(f"query.{query.name}", _statement(query))


def temporal_question(of: TemporalProperty) -> Question:
    """The question that a temporal property is."""
    return Question(f"property.{of.name}", _statement(_query(of)))


def _query(of: TemporalProperty) -> Query:
    return Query(of.name, QueryKind(of.logic), of.formula)


def _statement(query: Query) -> str:
    match query.kind:
        case QueryKind.CTL | QueryKind.LTL if query.formula is not None:
            return f"{query.kind.upper()}: {format_temporal(query.formula)}"
        case QueryKind.BOUND:
            return f"the greatest {format_count(Count(query.places))} in a reachable marking"
        case QueryKind.LIVE:
            return "every transition can fire again from every reachable marking, external gates free"
        case QueryKind.QUASI_LIVE:
            return "every transition can fire, external gates free"
        case QueryKind.STABLE_MARKING:
            return "some place has the same marking in every reachable marking"
        case QueryKind.ONE_SAFE:
            return "without the contact rule no place would ever hold two tokens"
    return format_query(query)


def _answered(space: StateSpace[Any], query: Query) -> Answer:
    if (goal := as_goal(query.formula)) is not None:
        return _goal(space, goal[0], holds=goal[1])
    match query.kind:
        case QueryKind.CTL if query.formula is not None:
            return _ctl(space, query.formula)
        case QueryKind.LTL if query.formula is not None:
            return _ltl(space, query.formula)
        case QueryKind.LIVE:
            dead = [t.name for t, live in zip(space.net.transitions, space.live(), strict=True) if not live]
            return no(tuple(dead), hint=f"not live: {listed(dead)}") if dead else yes()
        case QueryKind.QUASI_LIVE:
            space_fired = zip(space.net.transitions, space.fired(), strict=True)
            if dead := [t.name for t, times in space_fired if not times]:
                space.require_complete()
                return no(tuple(dead), hint=f"dead: {listed(dead)}")
            return yes()
        case QueryKind.STABLE_MARKING:
            return _stable(space)
        case QueryKind.ONE_SAFE:
            return _one_safe(space)
    raise ValueError(f"'{query.name}' is a query without what it is about")


def _goal(space: StateSpace[S], goal: Formula, *, holds: bool) -> Answer:
    targets = space.satisfying(goal)
    if space.count(targets):
        return _decided(space, holds, lambda: space.witness(targets, f"here ({format_temporal(goal)}) holds"))
    space.require_complete()
    return no() if holds else yes()


def _ctl(space: StateSpace[S], formula: Temporal) -> Answer:
    ctl = Ctl(Sets(space))
    holds = satisfied(ctl, formula)
    return _decided(space, holds, lambda: shown(ctl, formula) if holds else refuted(ctl, formula))


def _decided(space: StateSpace[S], holds: bool, show: Callable[[], Witness | None]) -> Answer:
    """An answer that is known, with what shows it: it must not be lost over the search for that."""
    try:
        with space.turn(_SHOWN_SHARE):
            return Answer(holds, witness=show())
    except BudgetExceeded:
        return Answer(holds, hint="the run that shows it takes too long to be found")


def _ltl(space: StateSpace[S], formula: Temporal) -> Answer:
    net = space.net
    if has_events(formula) and space.discipline is Discipline.STEP:
        return unknown("`fires` names one firing, and a step holds several", "ask it under interleaving")
    try:
        found = refuting(Sets(space), formula)
    except TooLargeError as error:
        return unknown(str(error), "write a shorter formula, or several")
    except TimeEndedError:
        return unknown("the time ended within the search for a run", "give it more time", "F3004")
    if found is None:
        return yes()
    try:
        run = accepted_run(*found)
    except (TooLongError, TimeEndedError):
        return no(hint="a run refutes it, which takes too long to be shown")
    if satisfies(net, run, formula):
        raise WitnessError("the run does not refute the formula")
    end = "the cycle goes on for ever" if run.cycle else "the sequence ends in a deadlock"
    return no(witness=witness_of(net, space.discipline, run, f"this run does not satisfy the formula: {end}"))


def _stable(space: StateSpace[Any]) -> Answer:
    space.require_complete()
    stable = []
    for index, place in enumerate(space.net.places):
        if space.count(space.marked(index)) in {0, space.n_markings}:
            stable.append(place.name)
    if not stable:
        return no(hint="every place is marked in some reachable markings and empty in others")
    return Answer(holds=True, subjects=tuple(stable))


def _one_safe(space: StateSpace[Any]) -> Answer:
    if loops := [t.name for t in space.net.transitions if t.self_loops]:
        reason = f"self-loops keep {listed(loops)} from firing here, and would not without the contact rule"
        return unknown(reason, "a gate instead of the two arcs says what is meant")
    for t, transition in enumerate(space.net.transitions):
        if not transition.openable:
            continue
        note = f"here '{transition.name}' would put a second token on a place that is full"
        if (witness := space.witness(space.in_contact(t), note)) is not None:
            return no((transition.name,), witness)
    space.require_complete()
    return yes()


def _bounded(space: StateSpace[Any], query: Query) -> Verdict:
    counted, question = format_count(Count(query.places)), question_of(query)
    found: list[int] = []

    def find() -> Answer:
        bound, markings = space.fullest([space.net.place_index[place] for place in query.places])
        found.append(bound)
        note = f"here {counted} = {bound}"
        return _decided(space, holds=True, show=lambda: space.witness(markings, note))

    verdict = question.ask(space, find)
    if not found:
        return verdict
    return replace(verdict, statement=f"{question.statement} is {found[0]}")
