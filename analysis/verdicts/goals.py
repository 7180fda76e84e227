"""The verdicts that come down to goals: is a marking reachable that shows the opposite, or the thing itself?

Where no state space could be held whole, these verdicts need not stay unknown: each names the state formulas whose
reachability decides it, and any technique that decides goals (`firable.analysis.goal`) may answer. A verdict of several
goals (quasi-live: one for each transition) holds where all of them come out as wanted, and fails with the first that
does not.

Liveness, reversibility and response are no such questions: they speak of what remains possible, not of one marking.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from firable.analysis.question import Question, listed
from firable.analysis.temporal.queries import as_goal, temporal_question
from firable.analysis.verdicts.behaviour import CONTACT_FREE, DEADLOCK_FREE, QUASI_LIVE
from firable.analysis.verdicts.commands import (
    COMMANDS_AGREE,
    COMPLETIONS_APART,
    Clash,
    clash_subjects,
    clashing,
    command_clashes,
    completion_clashes,
)
from firable.analysis.verdicts.properties import statement
from firable.nets.formula import And, Deadlock, Firable, Formula, Holds, Not, Or, format_formula
from firable.nets.net import Marking, Net, Property, PropertyKind, TemporalProperty, Transition
from firable.nets.queries import Query
from firable.nets.verdict import Verdict
from firable.semantics.algebra import BOOL
from firable.semantics.firing import in_contact
from firable.semantics.player import holds_in

Told = tuple[tuple[str, ...], str]
"""The subjects of a verdict, and the note on its witness."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A formula whose reachability decides a question, or one part of it.

    The part holds iff the formula is reachable, where `wanted`, or iff it is not. `told` says of a marking that
    satisfies the formula what it concerns and what is to be seen there; `subjects` are named where no such marking is.
    """

    formula: Formula
    told: Callable[[Marking], Told]
    wanted: bool
    subjects: tuple[str, ...] = ()


_Maker = Callable[[Net, Collection[str]], tuple[Goal, ...]]
_MAKERS: Final[tuple[tuple[Question, _Maker], ...]] = (
    (CONTACT_FREE, lambda net, _: _never(_contact(net), lambda marking: _told_of_contact(net, marking))),
    (DEADLOCK_FREE, lambda *_: _never(Deadlock(), lambda _: ((), "a marking of the net is a deadlock"))),
    (QUASI_LIVE, lambda net, fired: tuple(_firing(t.name) for t in net.transitions if t.name not in fired)),
    (COMMANDS_AGREE, lambda net, _: _apart(net, command_clashes(net))),
    (COMPLETIONS_APART, lambda net, _: _apart(net, completion_clashes(net))),
)
_OF_THE_NET: Final[Mapping[str, tuple[Question, _Maker]]] = {made[0].name: made for made in _MAKERS}
"""The questions about the net itself that come down to goals, and what makes these, by the name of the verdict."""


def is_of_the_net(name: str) -> bool:
    """Whether a verdict is one on the net itself that comes down to goals, which take seconds to make of large nets."""
    return name in _OF_THE_NET


def goals_of(net: Net, name: str, fired: Collection[str] = ()) -> tuple[Question, tuple[Goal, ...]] | None:
    """The question of a verdict and its goals; None where the verdict does not come down to goals.

    `fired` are transitions that are known to fire, so that nothing needs to be asked of them.
    """
    if name in _OF_THE_NET:
        question, maker = _OF_THE_NET[name]
        return question, maker(net, fired)
    if not name.startswith("property."):
        return None
    of = next(of for of in net.properties if f"property.{of.name}" == name)
    if isinstance(of, TemporalProperty):
        goal = as_goal(of.formula)
        return None if goal is None else (temporal_question(of), (_goal(*goal),))
    goals = _property(of)
    return None if goals is None else (Question(name, statement(of)), goals)


def query_goals(queries: Iterable[Query], verdict: Verdict) -> tuple[Question, tuple[Goal, ...]] | None:
    """The question of the verdict on one of the queries, and its goal; None where it is none, or none does."""
    query = next((query for query in queries if f"query.{query.name}" == verdict.name), None)
    goal = None if query is None else as_goal(query.formula)
    return None if goal is None else (Question(verdict.name, verdict.statement), (_goal(*goal),))


def _goal(formula: Formula, wanted: bool) -> Goal:
    return Goal(formula, lambda _: ((), f"here ({format_formula(formula)}) holds"), wanted)


def _firing(transition: str) -> Goal:
    return Goal(Firable(transition), lambda _: ((), ""), wanted=True, subjects=(transition,))


def _never(bad: Formula, told: Callable[[Marking], Told]) -> tuple[Goal, ...]:
    return (Goal(bad, told, wanted=False),)


def _property(of: Property) -> tuple[Goal, ...] | None:
    text = format_formula(of.formula)
    match of.kind:
        case PropertyKind.NEVER:
            return _never(of.formula, lambda _: ((), f"here ({text}) holds"))
        case PropertyKind.ALWAYS:
            return _never(Not(of.formula), lambda _: ((), f"here ({text}) does not hold"))
        case PropertyKind.REACHABLE:
            return (Goal(of.formula, lambda _: ((), ""), wanted=True),)
        case _:
            return None


def _contact(net: Net) -> Formula:
    """Some transition is in contact: its inputs and internal gates are satisfied, an output place outside is full."""
    return Or(tuple(in_contact_formula(t) for t in net.transitions if set(t.outputs) - set(t.inputs)))


def in_contact_formula(t: Transition) -> Formula:
    """The state formula "this transition is in contact" (`firable.semantics.firing.in_contact`)."""
    satisfied: Iterator[Formula] = (Holds(place) for place in (*t.inputs, *t.permissive))
    open_: Iterator[Formula] = (Not(Holds(place)) for place in t.inhibitive)
    full = Or(tuple(Holds(place) for place in t.outputs if place not in t.inputs))
    return And((*satisfied, *open_, full))


def _told_of_contact(net: Net, marking: Marking) -> Told:
    blocked = [t for t in range(len(net.transitions)) if in_contact(BOOL, net, t, holds_in(marking))]
    full = net.names(net.masks[blocked[0]].outputs & ~net.masks[blocked[0]].inputs & marking)
    names = tuple(net.transitions[t].name for t in blocked)
    return names, f"the inputs of {names[0]} are there and {listed(full)} is full"


def _apart(net: Net, clashes: tuple[Clash, ...]) -> tuple[Goal, ...]:
    def told(marking: Marking) -> Told:
        found = clashing(clashes, marking)
        return clash_subjects(net, found), found[0].note

    both = (And((Holds(net.places[clash.p].name), Holds(net.places[clash.q].name))) for clash in clashes)
    return _never(Or(tuple(both)), told)
