"""The properties that a net file states of its own net, decided on the state space.

Each kind is one temporal pattern over state formulas, with its own method and its own counterexample: `never` and
`always` by looking at every marking, `reachable` by finding one, `always_possible` (AG EF p) by the backward closure
of p, or where many are stated by the bottom components (`firable.analysis.spaces.bottoms`), `leads_to` by fair
components (`firable.analysis.verdicts.leads_to`). The shortest firing sequence to a marking that violates the property
is the evidence, of many always possible ones that to where nothing can be done about it any more; for `reachable` the
sequence is the proof. What no pattern says is a formula of CTL or LTL (`firable.analysis.temporal`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from firable.analysis.question import Answer, Question, no, yes
from firable.analysis.spaces.space import StateSpace
from firable.analysis.temporal.queries import decide_temporal
from firable.nets.formula import Not, format_formula
from firable.nets.net import Fairness, Property, PropertyKind, TemporalProperty
from firable.nets.verdict import Verdict

SEARCHED_MAX: Final = 8
"""So many properties to be always possible are searched for one by one, and shown where they are lost first."""
_FAIRNESS = {
    Fairness.NONE: "without any assumption of fairness",
    Fairness.WEAK: "under weak fairness (a transition that stays firable fires; its external gates do open)",
    Fairness.STRONG: (
        "under strong fairness (a transition that is firable again and again fires; its external gates do open)"
    ),
}


def statement(of: Property) -> str:
    """The property in words, with the assumptions it is decided under.

    >>> from firable.nets.formula import parse_formula
    >>> statement(Property("no_crash", PropertyKind.NEVER, parse_formula("a and b")))
    'never (a and b)'
    """
    formula = format_formula(of.formula)
    match of.kind:
        case PropertyKind.NEVER | PropertyKind.ALWAYS:
            return f"{of.kind} ({formula})"
        case PropertyKind.REACHABLE:
            return f"({formula}) is reachable, external gates free"
        case PropertyKind.ALWAYS_POSSIBLE:
            return f"from every reachable marking ({formula}) can be reached, external gates free"
        case PropertyKind.LEADS_TO:
            then = format_formula(of.then) if of.then else ""
            return f"({formula}) is always followed by ({then}), {_FAIRNESS[of.fairness]}"


def decide_property(space: StateSpace[Any], of: Property) -> Verdict:
    """The verdict `property.NAME` on one property of the net, under the discipline of the space."""

    def find() -> Answer:
        match of.kind:
            case PropertyKind.NEVER:
                return _invariant(space, of, violating=True)
            case PropertyKind.ALWAYS:
                return _invariant(space, of, violating=False)
            case PropertyKind.REACHABLE:
                return _reachable(space, of)
            case PropertyKind.ALWAYS_POSSIBLE:
                return _always_possible(space, of)
            case PropertyKind.LEADS_TO:
                from firable.analysis.verdicts.leads_to import leads_to

                return leads_to(space, of)

    return Question(f"property.{of.name}", statement(of)).ask(space, find)


def decide_stated(space: StateSpace[Any], of: Property | TemporalProperty) -> Verdict:
    """The verdict `property.NAME` on one property of the net, whichever way it is stated."""
    return decide_temporal(space, of) if isinstance(of, TemporalProperty) else decide_property(space, of)


def _invariant(space: StateSpace[Any], of: Property, *, violating: bool) -> Answer:
    bad = of.formula if violating else Not(of.formula)
    note = f"here ({format_formula(of.formula)}) {'holds' if violating else 'does not hold'}"
    witness = space.witness(space.satisfying(bad), note)
    if witness is not None:
        return no((), witness)
    space.require_complete()
    return yes()


def _reachable(space: StateSpace[Any], of: Property) -> Answer:
    witness = space.witness(space.satisfying(of.formula))
    if witness is not None:
        return yes(witness)
    space.require_complete()
    return no(hint="no reachable marking satisfies it; the whole state space was searched")


def _always_possible(space: StateSpace[Any], of: Property) -> Answer:
    goal, note = space.satisfying(of.formula), f"from here ({format_formula(of.formula)}) can never be reached again"
    if len(space.net.possibilities) > SEARCHED_MAX:
        lost = space.bottoms.where_lost(goal)
        if lost is not None and not space.count(lost):
            return yes()
        if lost is not None and (run := space.bottoms.run_into(lost)) is not None:
            return no((), replace(run, note=note))
    witness = space.witness(space.algebra.negation(space.backward(goal)), note)
    return yes() if witness is None else no((), witness)
