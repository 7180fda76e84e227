"""Whether a claim is true, by playing everything: the oracle for evidence."""

from __future__ import annotations

from support.naive_space import Markings, NaiveSpace

from firable.analysis.evidence.checking.obligation import Evidence
from firable.analysis.evidence.claims import Claim, ClaimKind, as_ctl
from firable.analysis.temporal.ltl import refuting
from firable.analysis.temporal.sets import Sets
from firable.analysis.verdicts.leads_to import leads_to
from firable.nets.formula import Formula
from firable.nets.net import Property, PropertyKind
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
    negated,
)
from firable.semantics.player import Player


def true(evidence: Evidence) -> bool:
    """Whether the claim of the evidence holds of its net."""
    net, claim = evidence.net, evidence.claim
    space = NaiveSpace(net, evidence.discipline)
    if (formula := as_ctl(claim)) is not None:
        return net.initial_marking in where(space, formula)
    match claim.kind:
        case ClaimKind.FIRES:
            return _fires(space, claim)
        case ClaimKind.LATER:
            return _later(space, claim)
        case ClaimKind.IN_ORDER:
            return _in_order(space, claim)
        case ClaimKind.LTL | ClaimKind.NOT_LTL:
            return (refuting(Sets(space), claim.goal) is None) is (claim.kind is ClaimKind.LTL)
        case ClaimKind.LEADS_TO | ClaimKind.NOT_LEADS_TO:
            of = Property("asked", PropertyKind.LEADS_TO, claim.state_goal, claim.then, claim.fairness)
            return leads_to(space, of).holds is (claim.kind is ClaimKind.LEADS_TO)
        case ClaimKind.ORDERED | ClaimKind.UNORDERED:
            player = Player(net)
            ordered = all(player.serialisable(fired) for edges in space.graph.values() for fired, _ in edges)
            return ordered is (claim.kind is ClaimKind.ORDERED)
        case ClaimKind.LIVE:
            return all(space.live())
        case ClaimKind.HOME:
            return bool(space.home())
    raise ValueError(claim)


def _fires(space: NaiveSpace, claim: Claim) -> bool:
    """Some run meets the goal and then fires all: by what has fired so far, from each marking with the goal."""
    wanted = frozenset(space.net.transition_index[name] for name in claim.fires)
    todo = [(marking, frozenset[int]()) for marking in space.satisfying(claim.state_goal)]
    seen = set(todo)
    while todo:
        marking, fired = todo.pop()
        if fired == wanted:
            return True
        for label, after in space.graph[marking]:
            pair = (after, fired | (wanted & set(label)))
            if pair not in seen:
                seen.add(pair)
                todo.append(pair)
    return False


def _later(space: NaiveSpace, claim: Claim) -> bool:
    """Some run meets the goal and then, at once or later, the other one: EF (goal and EF then)."""
    met = where(space, Exists(Eventually(claim.then)))
    return bool(space.satisfying(claim.state_goal) & met)


def _in_order(space: NaiveSpace, claim: Claim) -> bool:
    """Some run meets the goal and then fires each at a later moment: step by step, from all markings it may be at."""
    at = frozenset[int](space.satisfying(claim.state_goal))
    for name in claim.fires:
        t = space.net.transition_index[name]
        todo, ahead = list(at), set(at)
        while todo:
            for _, after in space.graph[todo.pop()]:
                if after not in ahead:
                    ahead.add(after)
                    todo.append(after)
        at = frozenset(after for marking in ahead for label, after in space.graph[marking] if t in label)
    return bool(at)


def where(space: NaiveSpace, formula: Temporal) -> Markings:
    """The markings in which a formula of CTL holds, each fixpoint by its equation."""
    everything, graph = frozenset(space.graph), space.graph

    def nexts(targets: Markings, *, every: bool) -> Markings:
        judged = all if every else any
        return frozenset(m for m, edges in graph.items() if judged(after in targets for _, after in edges))

    def until(left: Markings, right: Markings, *, every: bool) -> Markings:
        found, moving = right, everything - space.deadlocks
        while more := (left & moving & nexts(found, every=every)) - found:
            found |= more
        return found

    match formula:
        case TemporalNot(operand):
            return everything - where(space, operand)
        case TemporalAnd(operands):
            return frozenset.intersection(*(where(space, one) for one in operands))
        case TemporalOr(operands):
            return frozenset[int]().union(*(where(space, one) for one in operands))
        case Exists(Next(operand)) | ForAll(Next(operand)):
            return nexts(where(space, operand), every=isinstance(formula, ForAll))
        case Exists(Eventually(operand)) | ForAll(Eventually(operand)):
            return until(everything, where(space, operand), every=isinstance(formula, ForAll))
        case Exists(Globally(operand)):
            return everything - where(space, ForAll(Eventually(negated(operand))))
        case ForAll(Globally(operand)):
            return everything - where(space, Exists(Eventually(negated(operand))))
        case Exists(Until(left, right)) | ForAll(Until(left, right)):
            return until(where(space, left), where(space, right), every=isinstance(formula, ForAll))
        case _ if isinstance(formula, Formula):
            return space.satisfying(formula)
    raise ValueError(formula)
