"""Does a distributed protocol do what the central net does? All its runs, explored.

Eq. (7)-(10) hold at one instant; a protocol takes its votes and applies its orders at many. So each variant is explored
against the central net, configuration by configuration (`protocol_model` says what happens in one), and three questions
are asked:

- *refines*: the firings of every run are a run of the central net, and whenever no message is on its way, the
  controllers hold the marking that the central net then has. Orders half executed are refuted by the second.
- *wrong*: the markings displayed while no message is on its way that the central net does not reach at all.
- *complete*: whatever the central net may fire next, the protocol can still fire next, from every configuration
  that has followed the central net. Nothing is lost, and there is no new deadlock.

The variants that fail are here to show that the obligations are needed: a test of `locked` alone would also pass with a
model that can go wrong nowhere. Source: SEMANTICS, "Decomposition", O1-O6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol_model import LEFT, Configuration, Event, Model, Variant, Votes
from firable.decompose.split import split
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError
from firable.nets.net import Net

__all__ = ["CONFIGURATIONS_MAX", "ProtocolVerdict", "Variant", "Votes", "explore_protocol"]

CONFIGURATIONS_MAX: Final = 2_000_000


@dataclass(frozen=True, slots=True)
class ProtocolVerdict:
    """What the exploration of all runs says.

    `wrong` holds markings as the names of the places with a token. `counterexample` is a shortest run that the central
    net cannot follow, or that ends at rest in another marking than the central net's; `blocked` a shortest run after
    which the transition `lost` can no longer be the next to fire, though in the central net it may.
    """

    refines: bool
    wrong: tuple[tuple[str, ...], ...]
    complete: bool
    n_configurations: int
    counterexample: tuple[str, ...] = ()
    blocked: tuple[str, ...] = ()
    lost: str = ""


def explore_protocol(
    net: Net | Decomposition, variant: Variant, *, configurations_max: int = CONFIGURATIONS_MAX
) -> ProtocolVerdict:
    """Explore every run of a protocol variant, breadth first.

    Time and memory grow with the configurations, some 10 microseconds and 1 kB for each move. Raises `InputError`
    F3004 at more than `configurations_max` configurations, and the errors of `split`.
    """
    decomposition = split(net) if isinstance(net, Net) else net
    return _Exploration(Model(decomposition, variant), configurations_max).verdict()


class _Exploration:
    """The graph of configurations, numbered in the order in which they were found."""

    def __init__(self, model: Model, configurations_max: int) -> None:
        self.model = model
        self.found: list[Configuration] = [model.initial]
        self.parents: list[tuple[int, Event] | None] = [None]
        self.edges: list[list[tuple[int, int]]] = []
        index = {model.initial: 0}
        for n, now in enumerate(self.found):  # grows while it is walked
            edges = []
            for event, fired, after in model.moves(now):
                successor = index.setdefault(after, len(self.found))
                if successor == len(self.found):
                    self.found.append(after)
                    self.parents.append((n, event))
                edges.append((successor, fired))
            self.edges.append(edges)
            if len(self.found) > configurations_max:
                message = f"the protocol has more than {configurations_max:,} configurations"
                raise InputError([Diagnostic("F3004", message, "explore a smaller net, or allow more")])

    def verdict(self) -> ProtocolVerdict:
        net = self.model.net
        reachable = self.model.player.reachable()
        refuting = None
        wrong: dict[int, None] = {}
        for n, now in enumerate(self.found):
            astray = now.central == LEFT or (now.quiescent and now.local != now.central)
            if astray and refuting is None:
                refuting = n
            if now.quiescent and now.local not in reachable:
                wrong.setdefault(now.local)
        blocked = self.blocked()
        return ProtocolVerdict(
            refines=refuting is None,
            wrong=tuple(net.names(marking) for marking in wrong),
            complete=blocked is None,
            n_configurations=len(self.found),
            counterexample=() if refuting is None else self.run(refuting),
            blocked=() if blocked is None else self.run(blocked[0]),
            lost="" if blocked is None else net.transitions[blocked[1]].name,
        )

    def run(self, n: int) -> tuple[str, ...]:
        """The events that lead to a configuration, from the first."""
        events = []
        while (parent := self.parents[n]) is not None:
            n, event = parent
            events.append(str(event))
        return tuple(reversed(events))

    def blocked(self) -> tuple[int, int] | None:
        """The first configuration from which some transition of the central net can no longer be next, and which."""
        sources: list[list[int]] = [[] for _ in self.found]
        next_fired = [0] * len(self.found)
        for n, edges in enumerate(self.edges):
            for successor, fired in edges:
                if fired < 0:
                    sources[successor].append(n)
                else:
                    next_fired[n] |= 1 << fired
        todo = [n for n, fired in enumerate(next_fired) if fired]
        while todo:  # what can be next after a move that fires nothing can be next before it
            n = todo.pop()
            for source in sources[n]:
                joined = next_fired[source] | next_fired[n]
                if joined != next_fired[source]:
                    next_fired[source] = joined
                    todo.append(source)
        may_fire: dict[int, int] = {}
        for n, now in enumerate(self.found):
            if now.central == LEFT:
                continue
            if now.central not in may_fire:
                may_fire[now.central] = sum(1 << t for t in self.model.player.may_fire(now.central))
            if lost := may_fire[now.central] & ~next_fired[n]:
                return n, lost.bit_length() - 1
        return None
