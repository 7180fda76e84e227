"""The judge of a simulated run: the reference player, told of each event in the moment in which it is certain.

It plays the joint trace on the central net while it is written, so a run ends at the first event that is none, and what
led there is the end of its log. It is the judge of `firable replay`; the one liberty taken is that the reference
player's answers are remembered, since a hundred thousand runs ask the same questions about the same few markings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from firable.executor.protocol.token_player import TokenPlayer
from firable.executor.simulation.machinery import apart_of
from firable.executor.simulation.timekeeper import limited
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, Net, SignalKind
from firable.semantics.player import FiringSet, Player

_REMEMBERED_MAX = 20_000


class RunFailedError(AssertionError):
    """What happened is none of what may happen."""


@dataclass(frozen=True)
class RememberingPlayer(Player):
    """The reference player, who answers a question that was asked before from memory."""

    answers: dict[object, FiringSet] = field(default_factory=dict)
    firings: dict[object, Marking] = field(default_factory=dict)

    def firable(self, marking: Marking) -> FiringSet:
        """The transitions that are firable, as the reference player says."""
        if (known := self.answers.get(marking)) is None:
            known = super().firable(marking)
            if len(self.answers) < _REMEMBERED_MAX:
                self.answers[marking] = known
        return known

    def enabled(self, marking: Marking, signals: Mapping[str, bool]) -> FiringSet:
        """The transitions that are enabled, as the reference player says."""
        key = (marking, frozenset(name for name, value in signals.items() if value))
        if (known := self.answers.get(key)) is None:
            known = super().enabled(marking, signals)
            if len(self.answers) < _REMEMBERED_MAX:
                self.answers[key] = known
        return known

    def fire(self, marking: Marking, transitions: Iterable[int]) -> Marking:
        """The marking after a firing, as the reference player says; what may not fire is never remembered."""
        key = (marking, tuple(transitions))
        if (known := self.firings.get(key)) is None:
            known = super().fire(marking, key[1])
            if len(self.firings) < _REMEMBERED_MAX:
                self.firings[key] = known
        return known


class Subject:
    """A decomposition to be tried, with what all runs of it share."""

    def __init__(self, decomposition: Decomposition) -> None:
        self.decomposition = decomposition
        self.net: Net = decomposition.net
        self.player = RememberingPlayer(self.net)
        self.central = TokenPlayer.of(self.net)
        self.apart = apart_of(self.net)
        self.controllers = tuple(subnet.name for subnet in decomposition.subnets)
        self.owner_of = {signal.name: subnet.name for subnet in decomposition.subnets for signal in subnet.signals}
        self.sender_of = {place.name: str(place.owner) for place in self.net.places if place.command}
        self.limited = {subnet.name: limited(subnet) for subnet in decomposition.subnets}
        """The places with a time limit, of each controller."""
        self.sensors = tuple(signal.name for signal in self.net.signals if signal.kind is SignalKind.SENSOR)
