"""Decide a goal on the reduced net, by any technique, and answer for the original one.

Every technique that decides a goal is a function of a net, a goal and limits (`firable.analysis.goal`), so a reduction
stands in front of any of them. Where it leaves nothing to decide, the goal having become true or false, it answers by
itself; where what is left falls apart, its parts are decided one by one. The witness is lifted and replayed on the
original net, so a fault in a rule cannot become a wrong counterexample; against a wrong "not reachable" there is the
proof in each rule, the tests, and evidence, whose checker takes the steps anew
(`firable.analysis.evidence.checking.reductions`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Final

from firable.analysis._engine import BudgetExceeded, IncompleteGraph
from firable.analysis.goal import Finding, Limits
from firable.analysis.question import Known, no
from firable.analysis.race import Contestant, race
from firable.analysis.reduction.components import parts
from firable.analysis.reduction.reduce import ReducedTransitions, reduce_for_liveness
from firable.analysis.reduction.reducer import Reducer
from firable.analysis.spaces.reachability import explore_few
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.stubborn import FiringSearch, decide_by_stubborn_sets
from firable.analysis.walk import decide_by_walk
from firable.nets.formula import Constant, Formula
from firable.nets.net import Net
from firable.nets.verdict import Cost

DIAGRAM: Final = "decision diagram"
EXPLORED: Final = "explored"
_REDUCING_SHARE: Final = 0.75
_WALKED_FIRST: Final = 2**18
_WALKED_BESIDE: Final = 2**28
"""Firings of walks, alone and beside the others, which may have given up before."""
_ALONE_SHARE: Final = 0.15
"""The part of the time left for each technique that is alone before the others begin."""
_ALONE_FIRST: Final = 2**12
"""Markings that stubborn sets search before a diagram is made beside."""


def decide_reduced(
    net: Net,
    goal: Formula,
    limits: Limits,
    decide: Callable[[Net, Formula, Limits], Finding],
    reducer: Reducer | None = None,
) -> Finding:
    """Reduce the net for the goal, let `decide` decide the rest, and lift its witness.

    The `reducer`, if one is given, is of this net, and keeps what it finds. The method names the rules. A certificate
    of the small net is not handed on: evidence is made with the steps. Raises `WitnessError` where a witness does not
    replay on the original net.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import Deadlock
    >>> def nothing_left(net, goal, limits):
    ...     raise NotImplementedError
    >>> finding = decide_reduced(catalogue_net("one_robot"), Deadlock(), Limits(), nothing_left)
    >>> finding.reachable, finding.method[:44]
    (False, 'structural reduction from 28/15 to 0/0 place')
    """
    try:
        reduced = (reducer or Reducer(net)).for_goal(goal, limits)
    except BudgetExceeded as error:
        return Finding(None, "structural reduction", bound=str(error))
    if isinstance(reduced.goal, Constant):
        witness = reduced.lift(()) if reduced.goal.value else None
        return Finding(reduced.goal.value, f"structural {reduced.summary}", witness)
    found: list[Finding] = []
    separate = parts(reduced.net, reduced.goal)
    apart = f" on {len(separate)} separate parts" if len(separate) > 1 else ""
    for part, of in separate:
        finding = decide(part, of, limits)
        found.append(finding)
        if finding.reachable is False:
            break
    # One part that does not reach its goal decides it; else one that is undecided leaves it so.
    undecided = [finding for finding in found if finding.reachable is None]
    last = undecided[0] if undecided and found[-1].reachable is not False else found[-1]
    witness = None
    if last.reachable and all(finding.witness is not None for finding in found):
        witnesses = [finding.witness for finding in found if finding.witness is not None]
        witness = reduced.lift((name for one in witnesses for (name,) in one.firings), witnesses[-1].note)
    return Finding(
        last.reachable,
        f"{last.method}{apart}, after {reduced.summary}",
        witness,
        last.bound,
        _sum(f.cost for f in found),
    )


class ByReduction:
    """Decides goals on the reduced net by stubborn sets, a decision diagram, exploring and walks, whichever is first.

    Stubborn sets leave out orders of firing that the rules cannot; a diagram holds what is left of nets whose own is
    too large; where all transitions hang together neither helps, and a million markings are explored in a second; and
    walks come to a goal sooner than in the net itself, as a firing stands for many. What is proved of the net is kept
    for the next goal.

    >>> from firable.nets.catalogue import catalogue_net
    >>> from firable.nets.formula import Deadlock
    >>> ByReduction(catalogue_net("one_robot_mc_late"))(Deadlock(), Limits()).cost.markings
    4
    """

    def __init__(self, net: Net, reducer: Reducer | None = None) -> None:
        self.net = net
        self._reducer = reducer or Reducer(net)

    def __call__(self, goal: Formula, limits: Limits) -> Finding:
        """Whether a marking that satisfies the goal is reachable."""
        return decide_reduced(self.net, goal, limits, _by_all, self._reducer)


def _by_all(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Few markings are searched by stubborn sets alone, which shows a shortest way; many, beside a diagram and walks.

    Between the two a short walk: what is left of a net is small, and often falls into a deadlock by itself.
    """
    first = decide_by_stubborn_sets(net, goal, _alone(limits), turns=((False, _ALONE_FIRST),))
    if first.reachable is None and not limits.deadline.over:
        first = decide_by_walk(net, goal, _alone(limits), firings=_WALKED_FIRST)
    if first.reachable is not None or limits.deadline.over:
        return first
    deciders: list[dict[str, Callable[[Net, Formula, Limits], Finding]]] = [
        {"stubborn sets": decide_by_stubborn_sets},
        {"diagram": decide_by_diagram},
        {"exploring": decide_by_exploring, "walk": partial(decide_by_walk, firings=_WALKED_BESIDE)},
    ]
    lanes = [[Contestant(name, partial(_decided, of, net, goal)) for name, of in lane.items()] for lane in deciders]
    outcome = race(lanes, limits, slices_seconds=None)
    why = "the time was over" if limits.deadline.over else "; ".join(outcome.told)
    return outcome.answer or replace(first, bound=why)


def _alone(limits: Limits) -> Limits:
    return replace(limits, deadline=limits.deadline.share(_ALONE_SHARE))


def _decided(decide: Callable[[Net, Formula, Limits], Finding], net: Net, goal: Formula, limits: Limits) -> Finding:
    finding = decide(net, goal, limits)
    if finding.reachable is None:
        raise IncompleteGraph(finding.bound)
    return finding


def decide_by_diagram(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Decide whether a marking that satisfies the goal is reachable by holding all markings in a decision diagram."""
    began = perf_counter()
    try:
        space = explore_symbolically(net, limits)
        found = space.satisfying(goal)
        reachable = bool(found)
        witness = space.witness(found)
    except BudgetExceeded as error:
        return Finding(None, DIAGRAM, bound=str(error), cost=Cost(seconds=perf_counter() - began))
    cost = Cost(space.n_markings, seconds=perf_counter() - began)
    return Finding(reachable, DIAGRAM, witness, cost=cost)


def decide_by_exploring(net: Net, goal: Formula, limits: Limits) -> Finding:
    """Decide whether a marking that satisfies the goal is reachable by exploring all markings, where they are few.

    What was found until the limits are met may hold one, too.
    """
    began = perf_counter()
    try:
        graph = explore_few(net, limits)
        witness = graph.witness(graph.satisfying(goal))
    except BudgetExceeded as error:
        return Finding(None, EXPLORED, bound=str(error), cost=Cost(seconds=perf_counter() - began))
    reachable = True if witness is not None else False if graph.complete else None
    return Finding(reachable, EXPLORED, witness, graph.bound if reachable is None else "", cost=graph.cost)


class KnownByReduction:
    """The verdicts, by name, that the net reduced for liveness decides: dead transitions, and what walks meet in it.

    What fires in it is replayed in the original net. Asked again, the search goes on where it was ended. Cost: three
    quarters of the time for the reduction at most.
    """

    def __init__(self, net: Net) -> None:
        self.net = net
        self._begun: tuple[ReducedTransitions, FiringSearch] | None = None

    def __call__(self, limits: Limits) -> Mapping[str, Known]:
        """What is decided by the end of these limits."""
        if self._begun is None:
            left = limits.deadline.left_seconds
            until = limits.deadline if left is None else limits.deadline.within(left * _REDUCING_SHARE)
            try:
                reduced = reduce_for_liveness(self.net, replace(limits, deadline=until))
            except BudgetExceeded:
                return {}
            self._begun = reduced, FiringSearch(reduced.net, self.net)
        reduced, search = self._begun
        if dead := tuple(name for name, image in reduced.transitions.items() if image is None):
            return {name: Known(no(dead), f"structural {reduced.summary}") for name in ("quasi-live", "live")}
        firings = search.found(limits, until_dead=True)
        known = firings.known()
        if firings.dead:
            dead = tuple(name for name, image in reduced.transitions.items() if image in firings.dead)
            known["quasi-live"] = Known(no(dead), known["quasi-live"].method)
        return {name: replace(one, method=f"{one.method}, after {reduced.summary}") for name, one in known.items()}


def _sum(costs: Iterable[Cost]) -> Cost:
    """What several techniques took together; None where one of them counts something else."""
    known = list(costs)

    def total(values: list[int | None]) -> int | None:
        return None if None in values else sum(value for value in values if value is not None)

    seconds = [cost.seconds for cost in known if cost.seconds is not None]
    markings, edges = total([cost.markings for cost in known]), total([cost.edges for cost in known])
    return Cost(markings, edges, sum(seconds) if len(seconds) == len(known) else None)
