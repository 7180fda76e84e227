"""Machines with a planted fault each that shows where a net has layers: one coordinator is taken for another."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from firable.executor.protocol.above import Above
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator
from firable.executor.protocol.deciders import TOP
from firable.executor.protocol.messages import (
    Effect,
    Keep,
    Report,
    Stored,
    ToController,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.world import Machines
from firable.nets.decomposition import Decomposition


class TellsVotesToAll(LocalController):
    """A vote goes to every coordinator above."""

    def receive(self, message: ToController) -> list[Effect]:
        return [each for effect in super().receive(message) for each in self._to_all(effect)]

    def _to_all(self, effect: Effect) -> Iterator[Effect]:
        if isinstance(effect, Vote):
            yield from (replace(effect, coordinator=name) for name in self.above)
        else:
            yield effect


class CountsAnyVote(Coordinator):
    """A vote is counted in whatever round waits for its controller, whoever asked for it."""

    def receive(self, message: ToCoordinator) -> list[Effect]:
        if isinstance(message, Vote) and message.round not in self.rounds:
            for opened in self.rounds.values():
                if not opened.decided and message.controller in opened.participants:
                    yes = frozenset(opened.transitions) if message.promised else frozenset[str]()
                    return list(self._voted(replace(message, round=opened.number, promised=yes)))
            return []
        return super().receive(message)


class NumbersOfItsOwn(Coordinator):
    """Each coordinator counts its rounds from 0, and a number is taken for a name."""

    def __init__(self, decomposition: Decomposition, name: str = TOP) -> None:
        super().__init__(decomposition, name)
        self.next_round, self.stride = 0, 1


class TrustsTheSender(LocalController):
    """A round is that of whoever sends the message."""

    def receive(self, message: ToController) -> list[Effect]:
        self.speaking = message.coordinator
        return super().receive(message)

    def coordinator_of(self, number: int) -> str:
        return getattr(self, "speaking", "") or super().coordinator_of(number)


class PromisesToEach(LocalController):
    """What is promised to one coordinator may be promised to another one, too."""

    def _vote(self, request: VoteRequest) -> Iterator[Effect]:
        every = self.promises
        self.promises = {n: p for n, p in every.items() if self.coordinator_of(n) == request.coordinator}
        effects = list(super()._vote(request))
        self.promises = every | self.promises
        yield from effects


class ClosesRoundsOfOthers(LocalController):
    """What one coordinator says to be closed below is taken to be so of all."""

    def _close_below(self, above: Above, number: int) -> Iterator[Effect]:
        for other in self.above.values():
            if other is above or number > other.closed_below:
                yield from super()._close_below(other, number)


class KeepsOneListOfRounds(LocalController):
    """What is closed of the rounds of each coordinator is kept under the one key, and the last one stays."""

    def receive(self, message: ToController) -> list[Effect]:
        effects = super().receive(message)
        return [replace(e, key="closed") if isinstance(e, Keep) and e.key.startswith("closed") else e for e in effects]

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        name = next(iter(self.above), TOP)
        super()._restore({f"closed/{name}" if name and key == "closed" else key: kept[key] for key in kept})


class ReportsToOne(LocalController):
    """What is enabled is told to the first coordinator above, only."""

    def report(self) -> list[Effect]:
        first = next(iter(self.above), TOP)
        return [e for e in super().report() if isinstance(e, Report) and e.coordinator == first]

    def resend(self) -> list[Effect]:
        return [e for e in super().resend() if not isinstance(e, Report)]


class RestartsWithEveryRound(Coordinator):
    """A coordinator that has restarted numbers its rounds as the one at the top does."""

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        super()._restore(kept)
        self.next_round -= self.next_round % self.stride


PLANTED_LAYERS: dict[str, Machines] = {
    "CountsAnyVote": Machines(CountsAnyVote, TellsVotesToAll),
    "NumbersOfItsOwn": Machines(NumbersOfItsOwn),
    "NumbersOfItsOwn, trusted": Machines(NumbersOfItsOwn, TrustsTheSender),
    "RestartsWithEveryRound": Machines(RestartsWithEveryRound),
    **{
        each.__name__: Machines(controller=each)
        for each in (PromisesToEach, ClosesRoundsOfOthers, KeepsOneListOfRounds, ReportsToOne)
    },
}
