"""Does a distributed protocol do what the central net does? All its runs, by the project's own engine.

Eq. (7)-(10) hold at one instant; a protocol takes its votes and applies its orders at many. So the protocol is a net of
its own (`building`), and what is asked of it is asked of the markings that this net reaches, in a table where there are
few and in a decision diagram where there are many:

- `follows`: whatever fires, the central net can fire. With `agrees` (where no order is on its way, the controllers hold
  the marking that the central net then has) this is *refinement*: every run is, seen from outside, a run of the central
  net. Of the true protocol also `orders-fit`: an order always finds its part firable, so promises are kept.
- `complete`: nothing is lost (`completeness`), and so no deadlock is added.
- `one-token`: contact is where the central net has it, and nowhere else, but at what a part that is free of promise
  takes when its order comes: who fills such a place waits for that by the firing rule. Else no step waits for a place
  to be empty that it was not told to look at, and a place holds one token at most by what the steps do.
- `divergence`: which runs are busy for ever (`divergence`).

Each is proved, violated with a firing sequence of the protocol net, told in the words of who watches, or unknown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import Any, Final

import numpy as np

from firable.analysis.deadline import NEVER
from firable.analysis.goal import Limits
from firable.analysis.question import Answer, Question, listed, no, yes
from firable.analysis.spaces.reachability import REASONS, Budget, BudgetExceeded, ReachabilityGraph, explore
from firable.analysis.spaces.space import StateSpace
from firable.analysis.spaces.symbolic import explore_symbolically
from firable.analysis.verdicts.properties import decide_property
from firable.decompose.protocol.building import AGREES, FIT, FOLLOWS, ProtocolNet, protocol_net
from firable.decompose.protocol.completeness import IncompleteGraph, Lost, central_markings, first_lost
from firable.decompose.protocol.divergence import not_falling
from firable.decompose.protocol.draft import ASTRAY
from firable.decompose.protocol.variant import NO_FAULTS, PROTOCOL, Faults, Variant
from firable.decompose.splitting.cut import split
from firable.nets.decomposition import Decomposition
from firable.nets.formula import And, Holds, Or
from firable.nets.net import Net, Property
from firable.nets.verdict import Status, Verdict, Witness

FIRST_MARKINGS: Final = 200_000
"""How many markings are looked for in a table before a diagram is tried."""
AT_FAULT: Final = "the protocol itself is at fault: run no net by it, and report it"
MORE_TIME: Final = "give each exploration more time (--timeout)"
MORE_MEMORY: Final = "the diagram needs more memory than `prove` gives it; `explore_protocol` takes `Limits` with more"

STATEMENTS: Final = {
    FOLLOWS: "whatever the protocol fires, the central net can fire",
    AGREES: "where no order is on its way, the controllers hold the marking of the central net",
    FIT: "an order to fire finds its part firable, or free of promise with inputs full and outputs empty",
}
COMPLETE: Final = Question(
    "explored.complete",
    "whatever the central net may fire next, the protocol can still fire next (branching bisimilar, its steps hidden)",
    code="F4006",
    hint=f"the last event of the run is what it is lost by; {AT_FAULT}",
)
ONE_TOKEN: Final = Question(
    "explored.one-token",
    "no step finds a full place that it would fill, but where the central net has contact, or an order under way takes "
    "the token of a part free of promise",
    code="F4006",
    hint=AT_FAULT,
)
DIVERGENCE: Final = Question(
    "explored.divergence",
    "while nothing fires, a run goes on for ever only by repeating requests, votes or orders, or giving rounds up",
    code="F4006",
    hint=AT_FAULT,
    method="weights on places that every other hidden step lowers",
)


@dataclass(frozen=True)
class Exploration:
    """The protocol net of a decomposition, and as many of its markings as could be held."""

    protocol: ProtocolNet
    space: StateSpace[Any]
    limits: Limits = field(default_factory=Limits)

    @cached_property
    def safety(self) -> tuple[Verdict, ...]:
        """The verdicts of refinement."""
        return tuple(
            self._hinted(self._told(decide_property(self.space, of)))
            for of in self.protocol.net.properties
            if isinstance(of, Property)
        )

    @cached_property
    def complete(self) -> Verdict:
        """The verdict on completeness; the subject of a violation is what is lost."""

        def find() -> Answer:
            lost = self.lost
            return yes() if lost is None else no((lost.transition,), lost.witness)

        return self._hinted(COMPLETE.ask(self.space, find))

    @cached_property
    def lost(self) -> Lost | None:
        """What is lost; raises where that is not known."""
        return first_lost(self.protocol, self.space, self.limits)

    @cached_property
    def one_token(self) -> Verdict:
        """The verdict on contact."""

        def find() -> Answer:
            self.space.require_complete()
            net, steps = self.protocol.net, self.protocol.steps
            added = [t for t in self.space.meet_contact() if not steps[net.transitions[t].name].fires]
            if not added:
                return yes()
            return no(tuple(net.transitions[t].name for t in added), self.space.witness_of_contact(added))

        return self._hinted(ONE_TOKEN.ask(self.space, find))

    @cached_property
    def divergence(self) -> Verdict:
        """The verdict on runs that are busy for ever."""
        rising = not_falling(self.protocol)
        return DIVERGENCE.ask(self.space, lambda: no(rising) if rising else yes())

    @cached_property
    def refines(self) -> Status:
        """Whether every run is one of the central net."""
        statuses = {verdict.status for verdict in self.safety}
        return next(status for status in (Status.VIOLATED, Status.UNKNOWN, Status.PROVED) if status in statuses)

    @cached_property
    def counterexample(self) -> Witness | None:
        """A run of the protocol net that the central net cannot follow, or that ends at rest in another marking."""
        found = [verdict.witness for verdict in self.safety if verdict.witness is not None]
        return min(found, key=lambda witness: len(witness.firings), default=None)

    @cached_property
    def wrong(self) -> tuple[tuple[str, ...], ...]:
        """The markings that are displayed at rest and that the central net does not reach, as names of places.

        Those among the markings that are known; none where they are held in a diagram, or the central net is too large.
        """
        if not isinstance(self.space, ReachabilityGraph):
            return ()
        protocol, net = self.protocol, self.protocol.parts.net
        known = self.space.until(NEVER)
        strange = known.satisfying(And((protocol.at_rest, Or((protocol.differs, Holds(ASTRAY))))))
        own = [protocol.net.place_index[place.name] for place in net.places]
        shown: dict[int, None] = {}
        for i in np.flatnonzero(strange):
            marking = self.space.marking(int(i))
            shown.setdefault(sum(1 << p for p, bit in enumerate(own) if marking >> bit & 1))
        if not shown:
            return ()
        try:
            reached = central_markings(net, self.limits)
        except IncompleteGraph:
            return ()
        return tuple(net.names(marking) for marking in shown if marking not in reached)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """All verdicts on the true protocol."""
        return (*self.safety, self.complete, self.one_token, self.divergence)

    def events(self, witness: Witness | None) -> tuple[str, ...]:
        """A firing sequence of the protocol net as what happens, in the words of who watches."""
        return () if witness is None else tuple(str(self.protocol.steps[t]) for (t,) in witness.firings)

    def _told(self, verdict: Verdict) -> Verdict:
        name, wrong = verdict.name.removeprefix("property."), verdict.status is Status.VIOLATED
        return replace(
            verdict,
            name=f"explored.{name}",
            statement=STATEMENTS[name],
            code="F4006" if wrong else verdict.code,
            hint=AT_FAULT if wrong else verdict.hint,
            witness=None if verdict.witness is None else replace(verdict.witness, note=_note(name)),
        )

    def _hinted(self, verdict: Verdict) -> Verdict:
        """With what would decide it, where something was too much for the limits."""
        if verdict.status is not Status.UNKNOWN:
            return verdict
        if self.limits.deadline.over:
            return replace(verdict, hint=MORE_TIME)
        return replace(verdict, hint=MORE_MEMORY) if isinstance(self.space, Undrawn) else verdict


@dataclass(frozen=True)
class Undrawn(ReachabilityGraph):
    """A table of some markings of a protocol, of which no diagram was found either: `why`, in words."""

    why: str = ""

    @property
    def bound(self) -> str:
        """How far the table went, and what ended the search for a diagram."""
        return f"no decision diagram: {self.why}; a table held {self.n_markings:,} markings"


def _note(name: str) -> str:
    return {
        FOLLOWS: "by the last event something fires that the central net cannot fire",
        AGREES: "at rest, the controllers hold another marking than the central net",
        FIT: "the order has arrived, and its part is not firable",
    }[name]


def explore_protocol(
    net: Net | Decomposition,
    variant: Variant = PROTOCOL,
    faults: Faults = NO_FAULTS,
    *,
    budget: Budget | None = None,
    limits: Limits | None = None,
) -> Exploration:
    """All runs of a protocol, exposed to faults: in a table within the budget, else in a diagram within the limits.

    Where neither holds them, the table is as far as it goes, and its bound says what ended the diagram. Raises the
    errors of `split`.

    >>> from firable.nets.catalogue import catalogue_net
    >>> found = explore_protocol(catalogue_net("conceptual_one_robot"))
    >>> str(found.refines), str(found.complete.status)
    ('proved', 'proved')
    """
    protocol = protocol_net(split(net) if isinstance(net, Net) else net, variant, faults)
    limits = limits or Limits()
    return Exploration(protocol, space_of(protocol, limits, budget), limits)


def space_of(protocol: ProtocolNet, limits: Limits, budget: Budget | None = None) -> StateSpace[Any]:
    """The configurations of a protocol, in a table or in a diagram as for `explore_protocol`."""
    graph = explore(protocol.net, budget=budget or Budget(FIRST_MARKINGS), deadline=limits.deadline)
    if graph.complete or budget is not None:
        return graph
    start = perf_counter()
    try:
        return explore_symbolically(protocol.net, limits, orders=protocol.orders)
    except BudgetExceeded as error:
        ended = REASONS["time"] if limits.deadline.over else str(error)
        why = f"{ended} after {perf_counter() - start:.1f} s of the search for it"
        return Undrawn(graph.net, graph.discipline, graph.budget, graph.engine, graph.deadline, why)


def failing(exploration: Exploration) -> Iterator[str]:
    """Which sentences do not hold, in words."""
    for verdict in exploration.safety:
        if verdict.status is Status.VIOLATED:
            yield verdict.statement
    if exploration.complete.status is Status.VIOLATED:
        yield f"{exploration.complete.statement}: {listed(exploration.complete.subjects)} is lost"
