"""The coordinator: opens rounds over the transitions that no controller decides alone, and decides them.

A round asks for the transitions of one arbitration group (or one transition without conflicts) whose participants all
report their parts enabled. Rounds run side by side as long as what they would write and read is disjoint as in O1; so
no two rounds ever wait for each other's promises, and there is no deadlock of promises to break. Groups wait in the
order in which they became ready, and one that has to wait keeps its place before later ones that would disturb it, so
that none starves behind two busy neighbours.

The decision is the moment at which a coordinated transition fires: from then on it is certain, and whatever the
participants do before they have applied it commutes with it (O1). A round stays open, and keeps what it would disturb
from being asked for, until all participants have acknowledged.

A pure machine, as the controllers are. Rejected: a decision as soon as one controller says no, without waiting for the
rest of the votes. It saves time on rounds that fail, which are rare, and doubles the orders of messages to think
about.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Readiness,
    Report,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import Arbiter, TokenPlayer
from firable.nets.decomposition import Decomposition


@dataclass(slots=True)
class Round:
    """A round that is not closed: the votes so far, and after the decision the acknowledgements."""

    number: int
    group: int
    transitions: tuple[str, ...]
    participants: tuple[str, ...]
    writes: int
    reads: int
    votes: dict[str, frozenset[str]] = field(default_factory=dict)
    decided: bool = False
    committed: str | None = None
    acknowledged: set[str] = field(default_factory=set)


class Coordinator:
    """The coordinator of a decomposition, before anything is known of the controllers."""

    def __init__(self, decomposition: Decomposition) -> None:
        self.player = TokenPlayer.of(decomposition.net)
        self.participants = {
            row.name: tuple(part.controller for part in row.parts) for row in decomposition.coordinated
        }
        """For each coordinated transition, who has to promise it: those who own a gate of it alone, too (O3)."""
        ours = [group for group in decomposition.groups if group.controller is None]
        self.arbiter = Arbiter(decomposition.net, ours)
        together = [tuple(t for t in (*g.sequence, *g.rest) if t in self.participants) for g in ours]
        grouped = {name for group in together for name in group}
        self.groups = (
            *map(tuple, map(dict.fromkeys, together)),
            *((t,) for t in self.participants if t not in grouped),
        )
        self.group_of = {name: g for g, group in enumerate(self.groups) for name in group}
        self.seen: dict[str, int] = {subnet.name: -1 for subnet in decomposition.subnets}
        self.ready: dict[str, frozenset[str]] = {subnet.name: frozenset() for subnet in decomposition.subnets}
        self.waiting: dict[int, None] = {}
        """The groups that may be asked for, in the order in which they became ready."""
        self.rounds: dict[int, Round] = {}
        self.next_round = 0
        self.permits: int | None = None
        """How many more transitions may be committed; None is without limit."""

    @property
    def idle(self) -> bool:
        """Whether no round is open."""
        return not self.rounds

    @property
    def closed_below(self) -> int:
        """Every round with a smaller number is closed."""
        return next(iter(self.rounds), self.next_round)

    def receive(self, message: ToCoordinator) -> list[Effect]:
        """Take a message of a controller."""
        match message:
            case Report():
                self._hear(message.controller, message.readiness)
                return list(self._open())
            case Vote():
                self._hear(message.controller, message.readiness)
                return list(self._voted(message))
            case Acknowledgement():
                self._hear(message.controller, message.readiness)
                return list(self._acknowledged(message))

    def permit(self, firings: int | None) -> list[Effect]:
        """Allow so many commits from now on, or any number; with 0, rounds that are not decided are aborted."""
        self.permits = firings
        effects: list[Effect] = []
        if firings == 0:
            for number in [r.number for r in self.rounds.values() if not r.decided]:
                effects += self._decide(self.rounds[number], None)
        return [*effects, *self._open()]

    def resend(self) -> list[Effect]:
        """Repeat what has not been answered; for links that lose messages."""
        effects: list[Effect] = []
        for open_round in self.rounds.values():
            for controller in open_round.participants:
                if open_round.decided and controller not in open_round.acknowledged:
                    effects.append(self._decision(open_round, controller))
                elif not open_round.decided and controller not in open_round.votes:
                    effects.append(self._request(open_round, controller))
        return effects

    def _hear(self, controller: str, readiness: Readiness) -> None:
        if readiness.sequence <= self.seen[controller]:
            return
        self.seen[controller] = readiness.sequence
        new = readiness.transitions - self.ready[controller]
        self.ready[controller] = readiness.transitions
        for name in sorted(new):
            self.waiting.setdefault(self.group_of[name])

    def _open(self) -> Iterator[Effect]:
        """Open a round for each waiting group that disturbs no open round, nor a group that waits before it."""
        if not self.waiting:
            return
        writes = reads = 0
        for open_round in self.rounds.values():
            writes, reads = writes | open_round.writes, reads | open_round.reads
        for group in list(self.waiting):
            if self.permits is not None and sum(not r.decided for r in self.rounds.values()) >= self.permits:
                return
            names = tuple(t for t in self.groups[group] if all(t in self.ready[c] for c in self.participants[t]))
            if not names:
                del self.waiting[group]
                continue
            compiled = [self.player.transitions[name] for name in names]
            disturbs = any(c.disturbs(writes, reads) for c in compiled)
            for c in compiled:
                writes, reads = writes | c.writes, reads | c.reads
            if not disturbs:
                del self.waiting[group]
                yield from self._ask(group, names)

    def _ask(self, group: int, names: tuple[str, ...]) -> Iterator[Effect]:
        writes = reads = 0
        for name in names:
            compiled = self.player.transitions[name]
            writes, reads = writes | compiled.writes, reads | compiled.reads
        participants = tuple(dict.fromkeys(c for name in names for c in self.participants[name]))
        opened = Round(self.next_round, group, names, participants, writes, reads)
        self.rounds[opened.number] = opened
        self.next_round += 1
        for controller in participants:
            yield self._request(opened, controller)

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        voted = self.rounds.get(vote.round)
        # A vote of a round that is decided, or of none of ours, is stale (O5).
        if voted is not None and not voted.decided:
            voted.votes[vote.controller] = vote.promised
            if len(voted.votes) == len(voted.participants):
                yield from self._decide(voted, self._choice(voted))
        yield from self._open()

    def _choice(self, voted: Round) -> str | None:
        """The transition to commit: one of those with all votes yes, by the arbiter of the group."""
        enabled = [t for t in voted.transitions if all(t in voted.votes[c] for c in self.participants[t])]
        return self.arbiter.choose(enabled) if enabled and self.permits != 0 else None

    def _decide(self, decided: Round, committed: str | None) -> Iterator[Effect]:
        decided.decided, decided.committed = True, committed
        if committed is not None:
            if self.permits is not None:
                self.permits -= 1
            yield Firing(committed)
        for controller in decided.participants:
            yield self._decision(decided, controller)

    def _acknowledged(self, message: Acknowledgement) -> Iterator[Effect]:
        acknowledged = self.rounds.get(message.round)
        if acknowledged is not None and acknowledged.decided:
            acknowledged.acknowledged.add(message.controller)
            if len(acknowledged.acknowledged) == len(acknowledged.participants):
                del self.rounds[message.round]
                # Those that lost the arbitration are ready as before, and no report will say so again.
                self.waiting.setdefault(acknowledged.group)
        yield from self._open()

    def _request(self, asked: Round, controller: str) -> VoteRequest:
        names = tuple(t for t in asked.transitions if controller in self.participants[t])
        return VoteRequest(controller, asked.number, names, self.closed_below, self.seen[controller])

    def _decision(self, decided: Round, controller: str) -> Decision:
        return Decision(controller, decided.number, decided.committed, self.closed_below, self.seen[controller])
