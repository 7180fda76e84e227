"""Runs that fire transitions one after the other, and what parts two ends of a net: material for evidence.

That each transition fires in some run is shown by few runs rather than by one for each: on a graph of all markings a
run goes on to the nearest marking where an open transition may fire, and only where none is left ahead does another
begin. On nets too large for that, walks and searches by stubborn sets give such runs (`firable.analysis.stubborn`),
best on the net reduced for liveness.

That there is no home marking is shown by a formula: it holds for ever from one marking and never again from another.
Of a bottom component a place that never changes in it will do, if another component cannot have it so; else all such
places together; else its markings, if they are few.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Any, Final

import numpy as np

from firable.analysis._engine import BudgetExceeded
from firable.analysis.compiled import engine_limits
from firable.analysis.deadline import Deadline
from firable.analysis.evidence.certificate import FiringSequence
from firable.analysis.evidence.claims import is_marking, tidy
from firable.analysis.evidence.producing.lacking import NO_TIME
from firable.analysis.goal import Limits
from firable.analysis.reduction.reduce import reduce_for_liveness
from firable.analysis.spaces.reachability import ReachabilityGraph
from firable.analysis.spaces.space import StateSpace
from firable.analysis.stubborn import find_firings
from firable.nets.formula import And, Formula, Holds, Not, Or
from firable.nets.net import Marking, Net
from firable.nets.verdict import Witness
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player, holds_in
from firable.semantics.trace import Discipline

Run = tuple[tuple[str, ...], ...]
InOrder = tuple[tuple[str, str], FiringSequence]
"""Two transitions, and a run that fires the first of them and later the second."""
PARTING_MAX: Final = 200
"""How many markings a formula lists."""
PROLONGED_MAX: Final = 10_000
"""How many firings are added to a run, so that it ends in a deadlock or a cycle."""


class NotFoundError(Exception):
    """A transition that is to fire was not seen firing."""


def runs_on_graph(graph: ReachabilityGraph, names: Sequence[str], home: Marking | None) -> list[FiringSequence]:
    """Runs of a complete graph that fire these transitions, each after it met the home marking, if one is given."""
    open_ = {graph.net.transition_index[name] for name in names}
    may = np.zeros(graph.n_markings, dtype=np.uint32)  # how many of them may fire: kept, since it is asked at each step
    for t in open_:
        may += graph.may_fire(t)
    runs = []
    while open_:
        run = _Run(graph)
        if home is not None and (index := graph.index_of(home)) is not None:
            run.go(_column(graph, [index]))
            run.fired.clear()  # what fired on the way there does not count
        before = len(open_)
        while open_ and run.fire_one(open_, may > 0):
            for t in open_ & run.fired:
                may -= graph.may_fire(t)
            open_ -= run.fired
        if len(open_) == before:
            missing = graph.net.transitions[min(open_)].name
            raise NotFoundError(f"no run was found that fires {missing}")
        runs.append(FiringSequence(tuple(run.firings)))
    return runs


def run_by_way_of(graph: ReachabilityGraph, first: Marking, targets: Any) -> FiringSequence | None:
    """A run of a complete graph to a marking and from there to the nearest target; None where there is no way."""
    run, index = _Run(graph), graph.index_of(first)
    if index is None or not run.go(_column(graph, [index])) or not run.go(targets):
        return None
    return FiringSequence(tuple(run.firings))


def run_in_order(graph: ReachabilityGraph, one: Sequence[str], then: Sequence[str]) -> InOrder | None:
    """A run of a complete graph that fires one of these, and later one of those, and which two; None without one.

    None too where the time was over first.
    """
    try:
        return _in_order(graph, one, then)
    except BudgetExceeded:
        return None


def _in_order(graph: ReachabilityGraph, one: Sequence[str], then: Sequence[str]) -> InOrder | None:
    first, second = ({graph.net.transition_index[name] for name in names} for names in (one, then))
    may = np.zeros(graph.n_markings, dtype=np.bool_)
    for t in second:
        may |= graph.may_fire(t)
    ahead, run = graph.backward(may), _Run(graph)
    if not run.go(graph.before(ahead, sorted(first))):
        return None
    before = next(t for t in run.fire_into(first, ahead) if t in first)
    run.go(may)
    after = next(t for t in run.fire_into(second, np.ones(graph.n_markings, dtype=np.bool_)) if t in second)
    names = graph.net.transitions[before].name, graph.net.transitions[after].name
    return names, FiringSequence(tuple(run.firings))


class _Run:
    """A run through a graph."""

    def __init__(self, graph: ReachabilityGraph) -> None:
        self.graph, self.at = graph, 0
        self.firings: list[tuple[str, ...]] = []
        self.fired: set[int] = set()

    def go(self, targets: Any) -> bool:
        """Go on to the nearest target; whether there is a way."""
        graph = self.graph
        everywhere = np.ones(graph.n_markings, dtype=np.bool_)
        limits = engine_limits(graph.deadline)
        found = graph.engine.path_between(self.at, targets.tobytes(), everywhere.tobytes(), **limits)
        if found is None:
            return False
        for fired in found[0]:
            self._note(tuple(fired))
        self.at = found[1]
        return True

    def fire_one(self, open_: set[int], may: Any) -> bool:
        """Go on to the nearest marking in which an open transition may fire, and fire it; whether there is one."""
        if not self.go(may):
            return False
        self.fire_into(open_, np.ones(self.graph.n_markings, dtype=np.bool_))
        return True

    def fire_into(self, among: set[int], targets: Any) -> tuple[int, ...]:
        """Fire what holds one of these transitions and leads into a set, where something does; what it was."""
        edges = self.graph.successors(self.at)
        fired, self.at = next((fired, to) for fired, to in edges if targets[to] and among.intersection(fired))
        self._note(fired)
        return fired

    def _note(self, fired: tuple[int, ...]) -> None:
        self.firings.append(self.graph.witnesses.names(fired))
        self.fired.update(fired)


def runs_by_search(net: Net, names: Sequence[str], limits: Limits) -> tuple[list[Run], list[str]]:
    """Runs from M0 that fire these transitions under interleaving: by searches on the reduced net, then on this one.

    A transition of the reduced net stands for others that may fire where it may: the last firing of its run is theirs.
    """
    wanted, runs = set(names), list[Run]()
    for reduced in (True, False):
        if not wanted:
            break
        images: Mapping[str, str | None] = {name: name for name in wanted}
        searched, left = net, limits.deadline.left_seconds
        part = limits if left is None or not reduced else replace(limits, deadline=limits.deadline.within(left / 2))
        if reduced:
            try:
                small = reduce_for_liveness(net, part)
            except BudgetExceeded:
                continue
            images, searched = small.transitions, small.net
        found = find_firings(searched, part, net)
        moments = {searched.transitions[t].name: moment for t, moment in found.fires.items()}
        able = [(moments[image], name) for name in wanted if (image := images[name]) in moments and image is not None]
        # The last ones first: the ways to them lead past others.
        for _, name in sorted(able, reverse=True):
            if limits.deadline.over:
                raise BudgetExceeded(NO_TIME)
            image = images[name]
            if name in wanted and image is not None and (witness := found.witness(image)) is not None:
                runs.append(_gone_on(net, (*witness.firings[:-1], (name,)), wanted, limits.deadline))
                wanted -= {one for fired in runs[-1] for one in fired}
    return runs, sorted(wanted)


def _gone_on(net: Net, run: Run, wanted: AbstractSet[str], deadline: Deadline) -> Run:
    """The run, gone on with by transitions that are wanted, as long as many of them may fire.

    A net of thousands of parts would else have a run for each, past all others.
    """
    player, marking = Player(net), net.initial_marking
    for (name,) in run:
        marking = player.fire(marking, (net.transition_index[name],))
    fired = {name for (name,) in run}
    open_ = sorted(net.transition_index[name] for name in wanted - fired if net.transition(name).openable)
    more, fruitful = list(run), True
    while fruitful and open_ and not deadline.over:
        left = []
        for t in open_:
            if firable(BOOL, net, t, holds_in(marking)):
                marking = player.fire(marking, (t,))
                more.append((net.transitions[t].name,))
            else:
                left.append(t)
        fruitful = len(open_) - len(left) > len(open_) // 8
        open_ = left
    return tuple(more)


def maximal(net: Net, discipline: Discipline, witness: Witness) -> FiringSequence | None:
    """The run of a witness, gone on with until it is a maximal one; None where that takes too long.

    What refutes "always p" may end in the first marking without p, and every run that begins so refutes it too.
    """
    firings, cycle = list(witness.firings), witness.cycle
    player, marking = Player(net), net.marking(witness.marking)
    met: dict[Marking, int] = {}
    while not cycle and (ahead := next(player.successors(marking, step=discipline is Discipline.STEP), None)):
        if (begin := met.setdefault(marking, len(firings))) < len(firings):
            return FiringSequence(tuple(firings[:begin]), tuple(firings[begin:]))
        if len(met) > PROLONGED_MAX:
            return None
        fired, marking = ahead
        firings.append(tuple(net.transitions[t].name for t in fired))
    return FiringSequence(tuple(firings), cycle)


def parting(space: StateSpace[Any]) -> Formula | None:
    """A formula that stays true from some marking, and false from another; None where none is found."""
    algebra, net = space.algebra, space.net
    one = space.bottom()
    elsewhere = algebra.negation(space.backward(one))
    if not space.count(elsewhere):
        return None
    steady = list[Formula]()
    for p, place in enumerate(net.places):
        inside = space.count(algebra.conjunction([one, space.marked(p)]))
        if inside in {0, space.count(one)}:
            steady.append(Holds(place.name) if inside else Not(Holds(place.name)))
    for formula in (*steady, *([tidy(And(tuple(steady)))] if steady else [])):
        if space.count(algebra.negation(space.backward(space.satisfying(formula)))):
            return formula
    if space.count(one) > PARTING_MAX:
        return None
    markings, left = [], one
    while (witness := space.witness(left)) is not None:
        markings.append(is_marking(net, net.marking(witness.marking)))
        left = algebra.conjunction([left, algebra.negation(space.satisfying(markings[-1]))])
    return tidy(Or(tuple(markings)))


def _column(graph: ReachabilityGraph, indexes: Sequence[int]) -> Any:
    found = np.zeros(graph.n_markings, dtype=np.bool_)
    found[list(indexes)] = True
    return found
