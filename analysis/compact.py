"""A compact search: all markings in 5 to 8 bytes each, for nets that no memory holds with their numbers.

The explicit engine keeps each marking with an index, because graphs are asked for ways back, components and fixpoints.
What only asks whether something can be *met* needs less: a set that tells known markings. Few places determine a
marking (those that the firings leave free over exclusive or), so a table that stores only what the place of a slot does
not say already is exact in a third of the bytes; essay and sources stand in `analysis/engine/src/compact/mod.rs`.
Nothing is hashed away: what this search does not find is not there.

One search answers contact, deadlock and dead transitions together (`known_by_counting`), and one any goal. The way to
what was met is found by searching again, in halves, and replayed like every witness. Nets whose markings take more than
60 determining places are left alone.

The rejected alternative, bit-state hashing, holds a hundred times as many markings and proves nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from firable.analysis import _engine
from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import Node, engine_limits, flat, nodes_of
from firable.analysis.goal import Finding, Limits
from firable.analysis.question import Answer, Known, no, yes
from firable.analysis.spaces.reachability import REASONS
from firable.analysis.spaces.space import WitnessError, Witnesses
from firable.analysis.verdicts.goals import goals_of
from firable.nets.formula import Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost, Witness, spelled
from firable.semantics.algebra import BOOL
from firable.semantics.formulas import evaluate
from firable.semantics.player import holds_in
from firable.semantics.trace import Discipline

METHOD: Final = "compact search"


def decide_by_compact_search(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Decide whether a marking that satisfies the goal is reachable; where it is, with a shortest firing sequence.

    Cost: that of exploring, about twice per edge, as far as the nearest such marking or to the end.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import Deadlock
    >>> found = decide_by_compact_search(catalogue_net("one_robot_mc_late"), Deadlock(), Limits())
    >>> found.reachable, found.witness is not None
    (True, True)
    """
    try:
        search = _search(net, [nodes_of(net, goal)], limits, until_met=True)
    except BudgetExceeded as error:
        return Finding(None, METHOD, bound=str(error))
    cost = Cost(search.n_markings, search.n_edges, search.seconds)
    if not search.goals()[0]:
        return Finding(False if search.complete else None, METHOD, bound=_bound(search), cost=cost)
    try:
        way = search.way_to_goal(0, **engine_limits(limits.deadline))
    except BudgetExceeded as error:
        return Finding(None, METHOD, bound=f"the goal was met, and the way to it not found: {error}", cost=cost)
    witness = _replayed(net, way)
    if not evaluate(BOOL, net, goal, holds_in(net.marking(witness.marking))):
        raise WitnessError("a compact search ends in a marking that does not satisfy the goal")
    return Finding(reachable=True, method=METHOD, witness=witness, cost=cost)


def known_by_counting(net: Net, limits: Limits) -> Mapping[str, Known]:
    """The verdicts on contact, deadlock and dead transitions, by name, as far as one search decides them.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = known_by_counting(catalogue_net("one_robot_mc_late"), Limits())
    >>> [(name, known.answer.holds) for name, known in found.items()]
    [('contact-free', True), ('deadlock-free', False), ('quasi-live', True)]
    """
    try:
        search = _search(net, [], limits, until_met=False)
    except BudgetExceeded:
        return {}
    asked: dict[str, Callable[[], Answer | None]] = {
        "contact-free": lambda: _contact(net, search, limits),
        "deadlock-free": lambda: _deadlock(net, search, limits),
        "quasi-live": lambda: _dead(net, search),
    }
    return {name: Known(answer, METHOD) for name, ask in asked.items() if (answer := ask()) is not None}


def _search(net: Net, goals: list[list[Node]], limits: Limits, *, until_met: bool) -> _engine.Compact:
    return _engine.explore_compactly(
        *flat(net), goals, until_met=until_met, max_memory_bytes=limits.memory_bytes, **engine_limits(limits.deadline)
    )


def _contact(net: Net, search: _engine.Compact, limits: Limits) -> Answer | None:
    names = tuple(t.name for t, count in zip(net.transitions, search.contacts(), strict=True) if count)
    if not names:
        return yes() if search.complete else None
    try:
        witness = _replayed(net, search.way_to_contact(**engine_limits(limits.deadline)))
    except BudgetExceeded:
        return None
    asked = goals_of(net, "contact-free")
    if asked is None:
        raise WitnessError("contact is no goal")
    _, note = asked[1][0].told(net.marking(witness.marking))
    return no(names, replace(witness, note=note))


def _deadlock(net: Net, search: _engine.Compact, limits: Limits) -> Answer | None:
    count = search.n_deadlocks
    if not count:
        return yes() if search.complete else None
    try:
        witness = _replayed(net, search.way_to_deadlock(**engine_limits(limits.deadline)))
    except BudgetExceeded:
        return None
    found = (
        "1 marking of the net is a deadlock" if count == 1 else f"{spelled(count)} markings of the net are deadlocks"
    )
    return no((), replace(witness, note=found if search.complete else f"at least {found}"))


def _dead(net: Net, search: _engine.Compact) -> Answer | None:
    dead = tuple(t.name for t, count in zip(net.transitions, search.fired(), strict=True) if not count)
    if dead and not search.complete:
        return None
    return Answer(not dead, dead)


def _replayed(net: Net, way: list[int] | None) -> Witness:
    """The way as a witness, played by the reference player."""
    if way is None:
        raise WitnessError("a compact search has met something and knows no way to it")
    witnesses, firings = Witnesses(net, Discipline.INTERLEAVING), [(t,) for t in way]
    return witnesses.named(firings, witnesses.play(net.initial_marking, firings))


def _bound(search: _engine.Compact) -> str:
    """How far an incomplete search went, in words; empty for a complete one."""
    if search.complete:
        return ""
    return f"{search.n_markings:,} markings, compactly: {REASONS.get(search.reason or '', search.reason)}"
