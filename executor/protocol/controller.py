"""The local controller: plays the tokens of one subnet, promises its parts, and commands its machines.

It fires its local transitions by itself and its parts of coordinated transitions on the coordinator's commit only.
A yes vote is a promise (O1): until the round is decided, the parts promised are a *lock*. What disturbs a lock waits:
local transitions, other promises, and changes of the signals that the promised parts read, which are latched outside
the process image and taken in when the lock is released. So an external gate that was open at the vote is open, in
the image, at the commit, and the commit always finds its part enabled. (The signal itself may have dropped meanwhile:
Eq. (8) then means "each true at its own vote", which SEMANTICS O4 accepts for gates that no command clears.)

A token that enters a place with a command does three things in one act: the marking is changed, the completion signal
of the place is cleared in the image, and the command is sent (O7). Nothing reads the image in between.

A pure machine: inputs are method calls, outputs the effects that they return. It asks no clock and remembers a round
only until the coordinator says that nobody will speak of it again. The alternative, a promise with a time limit, needs
clocks that agree; here a lost decision is repeated until acknowledged, and until then the part stays blocked (O6).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    ProtocolError,
    Readiness,
    Report,
    Sending,
    Taken,
    ToController,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import Arbiter, Compiled, TokenPlayer
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking


@dataclass(frozen=True, slots=True)
class Promise:
    """A vote given in a round that is not decided yet, and what its yes parts write and read."""

    promised: frozenset[str]
    writes: int
    reads: int


class LocalController:
    """The controller `name` of a decomposition, in its initial marking."""

    def __init__(self, decomposition: Decomposition, name: str) -> None:
        self.name = name
        self.subnet = decomposition.subnet(name)
        self.player = TokenPlayer.of(self.subnet)
        part_of = {
            part.name: row.name for row in decomposition.coordinated for part in row.parts if part.controller == name
        }
        compiled = self.player.transitions
        self.parts: dict[str, Compiled] = {row: compiled[part] for part, row in part_of.items()}
        self.locals: tuple[Compiled, ...] = tuple(c for c in compiled.values() if c.name not in part_of)
        self.arbiter = Arbiter(self.subnet, (group for group in decomposition.groups if group.controller == name))
        self.word = self.subnet.initial_marking
        self.promises: dict[int, Promise] = {}
        self.closed: set[int] = set()
        self.closed_below = 0
        self.latched: dict[str, bool] = {}
        self.entries: dict[str, int] = {}
        """For each completion signal, how many commands that it completes have been sent."""
        self.readiness = Readiness(0, frozenset())
        self.told = -1
        """The sequence number of the newest report that was sent."""
        self.seen = -1
        """The sequence number of the newest report that is known to have arrived."""

    @property
    def marking(self) -> Marking:
        """The marking of the subnet."""
        return self.player.marking(self.word)

    def receive(self, message: ToController) -> list[Effect]:
        """Take a message of the coordinator."""
        self.seen = max(self.seen, message.seen)
        if message.closed_below > self.closed_below:
            self.closed_below = message.closed_below
            self.closed = {number for number in self.closed if number >= self.closed_below}
        match message:
            case VoteRequest():
                return list(self._vote(message))
            case Decision():
                return list(self._decided(message))

    def read(self, signal: str, value: bool, entry: int | None = None) -> list[Effect]:
        """Take a new value of a signal.

        `entry` says of a completion signal which command is completed, as `Sending.entry` counted it: a completion of
        an earlier command is stale, and dropped.
        """
        if entry is not None and entry != self.entries.get(signal, 0):
            return []
        if self.player.signal_bit(signal) & self._locked_reads():
            self.latched[signal] = value
            return []
        return list(self._take(signal, value))

    def fire(self) -> list[Effect]:
        """Fire one local transition, if one is enabled and disturbs no promise; no effect means that none is."""
        enabled = [c.name for c in self.locals if c.enabled(self.word) and not self._disturbs_promises(c)]
        if not enabled:
            return []
        chosen = self.player.transitions[self.arbiter.choose(enabled)]
        return [Firing(chosen.name), *self._fire(chosen)]

    def report(self) -> list[Effect]:
        """Tell the coordinator which parts are enabled, if that has changed since it was last told."""
        readiness = self._readiness()
        if readiness.sequence <= self.told:
            return []
        self.told = readiness.sequence
        return [Report(self.name, readiness)] if self.parts else []

    def resend(self) -> list[Effect]:
        """Repeat the last report, unless it is known to have arrived; for links that lose messages."""
        if self.told <= self.seen or not self.parts:
            return []
        return [Report(self.name, self._readiness())]

    def _vote(self, request: VoteRequest) -> Iterator[Effect]:
        if self._is_closed(request.round):
            return  # an old copy: the round is decided
        if request.round not in self.promises:
            asked = [self.parts[name] for name in request.transitions if name in self.parts]
            # The parts of one round may disturb each other: one of them is chosen. Those of other rounds may not.
            free = [part.enabled(self.word) and not self._disturbs_promises(part) for part in asked]
            promised = [part for part, yes in zip(asked, free, strict=True) if yes]
            names = frozenset(name for name in request.transitions if self.parts.get(name) in promised)
            self.promises[request.round] = Promise(
                names, _union(part.writes for part in promised), _union(part.reads for part in promised)
            )
        yield Vote(self.name, request.round, self.promises[request.round].promised, self._told())

    def _decided(self, decision: Decision) -> Iterator[Effect]:
        if not self._is_closed(decision.round):
            promise = self.promises.pop(decision.round, None)
            self.closed.add(decision.round)
            if decision.committed in self.parts:
                yield from self._apply(decision, promise)
            yield from self._release()
        yield Acknowledgement(self.name, decision.round, self._told())

    def _apply(self, decision: Decision, promise: Promise | None) -> Iterator[Effect]:
        part = self.parts[str(decision.committed)]
        if promise is None or decision.committed not in promise.promised:
            raise ProtocolError(f"{self.name}: '{part.name}' is committed without a promise")
        if not part.enabled(self.word):
            raise ProtocolError(f"{self.name}: '{part.name}' was promised and is not enabled")
        yield from self._fire(part)

    def _fire(self, transition: Compiled) -> Iterator[Effect]:
        before = self.word
        self.word = transition.fire(before)
        for place in self.player.entered(transition.name):
            completion = self.subnet.place(place).completion
            entry = 0
            if completion is not None:
                entry = self.entries[completion] = self.entries.get(completion, 0) + 1
                self.latched.pop(completion, None)  # a value from before the command
                if before & self.player.signal_bit(completion):
                    yield Taken(completion, value=False)
            yield Sending(place, entry)

    def _release(self) -> Iterator[Effect]:
        """Take in the signals that changed while a promise read them."""
        for signal, value in list(self.latched.items()):
            if not self.player.signal_bit(signal) & self._locked_reads():
                del self.latched[signal]
                yield from self._take(signal, value)

    def _take(self, signal: str, value: bool) -> Iterator[Effect]:
        bit = self.player.signal_bit(signal)
        if bool(self.word & bit) != value:
            self.word ^= bit
            yield Taken(signal, value)

    def _is_closed(self, number: int) -> bool:
        return number < self.closed_below or number in self.closed

    def _disturbs_promises(self, transition: Compiled) -> bool:
        return any(transition.disturbs(promise.writes, promise.reads) for promise in self.promises.values())

    def _locked_reads(self) -> int:
        return _union(promise.reads for promise in self.promises.values())

    def _readiness(self) -> Readiness:
        ready = frozenset(name for name, part in self.parts.items() if part.enabled(self.word))
        if ready != self.readiness.transitions or self.told < 0:
            sequence = self.readiness.sequence + 1 if self.told >= 0 else 0
            self.readiness = Readiness(sequence, ready)
        return self.readiness

    def _told(self) -> Readiness:
        readiness = self._readiness()
        self.told = max(self.told, readiness.sequence)
        return readiness


def _union(masks: Iterable[int]) -> int:
    union = 0
    for mask in masks:
        union |= mask
    return union
