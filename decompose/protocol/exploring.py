"""Does a distributed protocol do what the central net does? All its runs, explored.

Eq. (7)-(10) hold at one instant; a protocol takes its votes and applies its orders at many. So each variant is explored
against the central net, configuration by configuration (`model` says what happens in one), and three questions
are asked:

- *refines*: the firings of every run are a run of the central net, and whenever no message is on its way, the
  controllers hold the marking that the central net then has. Orders half executed are refuted by the second.
- *wrong*: the markings displayed while no message is on its way that the central net does not reach at all.
- *complete*: whatever the central net may fire next, the protocol can still fire next, from every configuration
  that has followed the central net. Nothing is lost, and there is no new deadlock.

Each of refining and completeness is proved, violated or, where the budget of configurations ended first, unknown. What
was found before the end stays found: a refuting run is one whatever follows, and a transition is lost only if it could
not be next even if every configuration that was not looked at could fire everything.

The variants that fail are here to show that the obligations are needed: a test of `locked` alone would also pass with a
model that can go wrong nowhere. Source: SEMANTICS, "Decomposition", O1-O6.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from firable.decompose.protocol.model import LEFT, Configuration, Event, Model, Variant, Votes
from firable.decompose.splitting.cut import split
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, Net
from firable.nets.verdict import Status

__all__ = ["CONFIGURATIONS_MAX", "ProtocolVerdict", "Variant", "Votes", "explore_protocol"]

CONFIGURATIONS_MAX: Final = 2_000_000


@dataclass(frozen=True, slots=True)
class ProtocolVerdict:
    """What the exploration of all runs says.

    `wrong` holds markings as the names of the places with a token; those that are known to be wrong, if the exploration
    ended early. `counterexample` is a shortest run that the central net cannot follow, or that ends at rest in another
    marking than the central net's; `blocked` a shortest run after which the transition `lost` can no longer be the next
    to fire, though in the central net it may. `bound` says how far was looked where the budget ended (then
    `blocked` need not be a shortest one); else it is empty.
    """

    refines: Status
    wrong: tuple[tuple[str, ...], ...]
    complete: Status
    n_configurations: int
    bound: str = ""
    counterexample: tuple[str, ...] = ()
    blocked: tuple[str, ...] = ()
    lost: str = ""


def explore_protocol(
    net: Net | Decomposition, variant: Variant, *, configurations_max: int = CONFIGURATIONS_MAX
) -> ProtocolVerdict:
    """Explore every run of a protocol variant, breadth first, until `configurations_max` configurations are explored.

    Time and memory grow with the configurations, some 10 microseconds and 1 kB for each move. Raises the errors of
    `split`.
    """
    decomposition = split(net) if isinstance(net, Net) else net
    return _Exploration(Model(decomposition, variant), configurations_max).verdict()


class _Exploration:
    """The graph of configurations, numbered in the order in which they were found.

    `edges` may be shorter than `found`: where the budget ended, nobody knows what follows the rest.
    """

    def __init__(self, model: Model, configurations_max: int) -> None:
        self.model = model
        self.configurations_max = configurations_max
        self.found: list[Configuration] = [model.initial]
        self.parents: list[tuple[int, Event] | None] = [None]
        self.edges: list[list[tuple[int, int]]] = []
        index = {model.initial: 0}
        for n, now in enumerate(self.found):  # grows while it is walked
            if n == configurations_max:
                break
            edges = []
            for event, fired, after in model.moves(now):
                successor = index.setdefault(after, len(self.found))
                if successor == len(self.found):
                    self.found.append(after)
                    self.parents.append((n, event))
                edges.append((successor, fired))
            self.edges.append(edges)

    @property
    def finished(self) -> bool:
        """Whether every configuration has been explored."""
        return len(self.edges) == len(self.found)

    def verdict(self) -> ProtocolVerdict:
        net = self.model.net
        refuting = None
        strange: dict[Marking, None] = {}
        for n, now in enumerate(self.found):
            astray = now.central == LEFT or (now.quiescent and now.local != now.central)
            if astray and refuting is None:
                refuting = n
            if astray and now.quiescent:
                strange.setdefault(now.local)
        blocked = self.blocked()
        otherwise = Status.PROVED if self.finished else Status.UNKNOWN
        explored = f"{len(self.edges):,} of at least {len(self.found):,} configurations explored"
        return ProtocolVerdict(
            refines=otherwise if refuting is None else Status.VIOLATED,
            wrong=tuple(net.names(marking) for marking in self.wrong(strange)),
            complete=otherwise if blocked is None else Status.VIOLATED,
            n_configurations=len(self.found),
            bound="" if self.finished else explored,
            counterexample=() if refuting is None else self.run(refuting),
            blocked=() if blocked is None else self.run(blocked[0]),
            lost="" if blocked is None else net.transitions[blocked[1]].name,
        )

    def wrong(self, markings: Iterable[Marking]) -> list[Marking]:
        """Those of the markings that the central net does not reach; none where it is too large to know."""
        wrong = dict.fromkeys(markings)
        if not wrong:
            return []
        reached = {self.model.net.initial_marking}
        todo = list(reached)
        for marking in todo:  # grows while it is walked
            if len(todo) > self.configurations_max:
                return []
            for _, successor in self.model.player.successors(marking):
                if successor not in reached:
                    reached.add(successor)
                    todo.append(successor)
        return [marking for marking in wrong if marking not in reached]

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
        next_fired = [0] * len(self.edges)
        # Of what was not explored, everything is taken to be possible: so nothing is called lost that may not be.
        next_fired += [(1 << len(self.model.net.transitions)) - 1] * (len(self.found) - len(self.edges))
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
