"""The evidence of a CTL formula in M0: the run that its outermost operator speaks of.

`EF p` and `E[p U q]` are shown by a firing sequence, `EX p` by one firing, `EG p` by a lasso; of a formula that does
not hold, its dual is shown: a counterexample. A disjunction is shown by an operand that holds. A universal formula that
holds has no single run to show, and a conjunction none for all of its operands.
"""

from __future__ import annotations

from typing import TypeVar

from firable.analysis.spaces.space import Witnesses
from firable.analysis.temporal.automaton import TimeEndedError
from firable.analysis.temporal.ctl import Ctl, dual
from firable.analysis.temporal.lasso import Run, TooLongError, Walk, accepted_run, witness_of
from firable.analysis.temporal.product import Product, ProductEdge
from firable.nets.formula import Formula
from firable.nets.temporal import (
    Eventually,
    Exists,
    ForAll,
    Globally,
    Next,
    Temporal,
    TemporalAnd,
    TemporalNot,
    TemporalOr,
    Until,
    format_temporal,
    negated,
)
from firable.nets.verdict import Witness

S = TypeVar("S")


def shown(ctl: Ctl[S], formula: Temporal) -> Witness | None:
    """A witness of a formula that holds in M0; None where it has none, or one that takes too much memory or time."""
    space = ctl.sets.space
    match formula:
        case TemporalOr(operands):
            witnesses = (shown(ctl, one) for one in operands if space.contains(ctl.of(one), space.net.initial_marking))
            return next((witness for witness in witnesses if witness is not None), None)
        case TemporalAnd(operands):
            found = [witness for one in operands if (witness := shown(ctl, one)) is not None]
            return found[0] if len(found) == 1 else None
        case Exists(Eventually(operand)):
            return space.witness(ctl.of(operand), _here(operand))
        case Exists(Next(operand)):
            return _way(ctl, Next(operand))
        case Exists(Until() as path):
            return _way(ctl, path)
        case Exists(Globally(operand)):
            return _endless(ctl, operand)
        case TemporalNot(operand):
            return refuted(ctl, operand)
        case _ if isinstance(formula, Formula):
            return space.witness(space.initial, _here(formula))
    return None


def refuted(ctl: Ctl[S], formula: Temporal) -> Witness | None:
    """A counterexample to a formula that does not hold in M0; None where it has none, or one that takes too long."""
    match formula:
        case ForAll(Until(left, right)):
            away = negated(right)
            sets = ctl.sets
            if sets.space.contains(sets.always(ctl.of(away)), sets.space.net.initial_marking):
                return _endless(ctl, away)
            ended = sets.both(ctl.of(away), sets.outside(ctl.of(left)))
            return _sequence(ctl, ctl.of(away), ended, f"until here ({format_temporal(right)}) does not hold, and now "
                             f"({format_temporal(left)}) does not either")  # fmt: skip
        case TemporalAnd(operands):
            initial = ctl.sets.space.net.initial_marking
            failing = (one for one in operands if not ctl.sets.space.contains(ctl.of(one), initial))
            return next((witness for one in failing if (witness := refuted(ctl, one)) is not None), None)
        case TemporalOr(operands):
            found = [witness for one in operands if (witness := refuted(ctl, one)) is not None]
            return found[0] if len(found) == 1 else None
        case TemporalNot(operand):
            return shown(ctl, operand)
        case ForAll():
            return shown(ctl, dual(formula))
        case _ if isinstance(formula, Formula):
            return shown(ctl, negated(formula))
    return None


def _here(formula: Temporal) -> str:
    return f"here ({format_temporal(formula)}) holds"


def _way(ctl: Ctl[S], path: Next | Until) -> Witness | None:
    match path:
        case Next(operand):
            space = ctl.sets.space
            witnesses = Witnesses(space.net, space.discipline)
            start, wanted = space.net.initial_marking, ctl.of(operand)
            for fired, after in witnesses.player.successors(start, step=space.discipline.value == "step"):
                if space.contains(wanted, after):
                    return witnesses.replayed([fired], after, _here(operand))
            return None
        case Until(left, right):
            return _sequence(ctl, ctl.of(left), ctl.of(right), _here(right))


def _edge(markings: S) -> ProductEdge[S]:
    return ProductEdge(markings, None, stutters=True, target=0, marks=frozenset())


def _sequence(ctl: Ctl[S], through: S, goal: S, note: str) -> Witness | None:
    """A firing sequence from M0 to the goal through a set."""
    space = ctl.sets.space
    walk = Walk(Product(ctl.sets, ((_edge(ctl.sets.all),),), 0), space.net.initial_marking)
    try:
        found = walk.go({0: goal}, {0: through})
    except (TooLongError, TimeEndedError):
        return None
    if not found:
        return None
    return Witnesses(space.net, space.discipline).replayed(walk.fired, walk.marking, note)


def _endless(ctl: Ctl[S], operand: Temporal) -> Witness | None:
    """A lasso from M0 that stays within a set."""
    sets, space = ctl.sets, ctl.sets.space
    markings = ctl.of(operand)
    product = Product(sets, ((_edge(markings),),), 0)
    always = {0: sets.always(markings)}
    try:
        run: Run = accepted_run(product, always, always)
    except (TooLongError, TimeEndedError):
        return None
    end = "for ever" if run.cycle else "and it is a deadlock"
    return witness_of(space.net, space.discipline, run, f"({format_temporal(operand)}) holds all the way, {end}")
