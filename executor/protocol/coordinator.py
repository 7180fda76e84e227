"""A coordinator: opens rounds over transitions that no controller decides alone, and decides them.

In one layer there is one, which decides all of these. Where the net has layers there is one for each part of it, and
each decides what stands in its own name; about the rounds of others it neither knows nor cares (`deciders`).

A round asks for the transitions of one arbitration group (or one transition without conflicts) whose participants all
report their parts enabled. Rounds run side by side as long as what they would write and read is disjoint as in O1; so
no two rounds ever wait for each other's promises, and there is no deadlock of promises to break. Groups wait in the
order in which they became ready, and one that has to wait keeps its place before later ones that would disturb it, so
that none starves behind two busy neighbours.

The decision is the moment at which a coordinated transition fires: from then on it is certain, and whatever the
participants do before they have applied it commutes with it (O1). A round stays open, and keeps what it would disturb
from being asked for, until all participants have acknowledged.

*Parts free of promise* are not asked, and get no abort. Their votes are what their controllers report, and stand until
an order is applied. One counts (a) if its report is newer than the acknowledgement of the last order of its transition,
for until then it may be a vote from before that firing: the round of it is open until all have acknowledged, and an
acknowledgement brings a report along; and (b) if the report is of this epoch of the coordinator, for who has restarted
knows nothing of the acknowledgements before, and any report from then may come late. `Hello` is repeated until there is
a report of this epoch. A round in which nobody has to promise is decided when it is opened.

*Leaving*: the last report of a controller is answered by `Hello` when no open round has asked it for anything or given
it an order, but those that it has acknowledged; until then by what is open, said again. No round needs it afterwards:
none is opened over what its newest report does not name, and who has restarted counts no vote of before.

A pure machine, as the controllers are. What is kept in stable storage, and the fault that would show if it were not:

- `round/<number>`, what was asked and what is committed, from the decision until all have acknowledged: a transition
  that has fired would be finished by those who heard of it, and aborted by the others.
- `turns` of the arbiter, with the decision that used them: a rule "twice this, once that" would break its own order.
- `epoch`: rounds would be numbered as earlier ones were, and a vote or an order of then be taken for one of now (O5).

Not kept: that a round is *opened*, the *votes*, and *aborts*. A round of an earlier epoch that is not known to be
committed never was and never will be, so its promises end: a vote of it, which controllers repeat, is answered by the
abort, and `closed_below` rises over it. So only a round that fires something costs a write. That a round is *closed* is
stored by deleting it, which may be lost: then its decision is repeated, and acknowledged, once more. *Acknowledgements*
are given again for the same reason. The controllers' *readiness* is asked for by `Hello`, until it comes.

Rejected: a decision as soon as one controller says no, without waiting for the
rest of the votes. It saves time on rounds that fail, which are rare, and doubles the orders of messages to think
about.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

from firable.executor.protocol.deciders import TOP, coordinator_at, coordinators
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    Readiness,
    Report,
    Stored,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.token_player import Arbiter, TokenPlayer
from firable.nets.decomposition import Decomposition


@dataclass(slots=True)
class Round:
    """A round that is not closed: the votes so far, and after the decision the acknowledgements.

    The participants are those who are asked for a promise.
    """

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
    """The coordinator of this name, of a decomposition, before anything is known of the controllers."""

    def __init__(self, decomposition: Decomposition, name: str = TOP) -> None:
        self.name = name
        self.player = TokenPlayer.of(decomposition.net)
        names = coordinators(decomposition)
        self.first_round, self.stride = names.index(name), len(names)
        """Its rounds are this one, and every so many-th after it."""
        self.participants = MappingProxyType(
            {
                row.name: tuple(part.controller for part in row.parts)
                for row in decomposition.coordinated
                if coordinator_at(row.at) == name
            }
        )
        """For each transition that it decides, who takes part: those who own a gate of it alone, too (O3)."""
        free = {t: frozenset(c for name, c in decomposition.free if name == t) for t, _ in decomposition.free}
        self.free = MappingProxyType({t: free.get(t, frozenset()) for t in self.participants})
        """For each of them, those whose part is free of promise."""
        self.of_free = MappingProxyType(
            {c: frozenset(t for t in self.free if c in self.free[t]) for at in free.values() for c in at}
        )
        """For each controller, the transitions of which its part is."""
        ours = [g for g in decomposition.groups if g.controller is None and coordinator_at(g.at) == name]
        self.arbiter = Arbiter(decomposition.net, ours)
        self.kept_turns = self.arbiter.turns
        together = [tuple(t for t in (*g.sequence, *g.rest) if t in self.participants) for g in ours]
        grouped = {name for group in together for name in group}
        self.groups = (
            *map(tuple, map(dict.fromkeys, together)),
            *((t,) for t in self.participants if t not in grouped),
        )
        self.group_of = MappingProxyType({name: g for g, group in enumerate(self.groups) for name in group})
        self.seen: dict[str, int] = {subnet.name: -1 for subnet in decomposition.subnets}
        self.ready: dict[str, frozenset[str]] = {subnet.name: frozenset() for subnet in decomposition.subnets}
        """What each controller has reported; of its free parts, those of which the vote counts but for (a)."""
        self.lately: dict[str, bool] = dict.fromkeys(self.of_free, False)
        """Whether the newest report of each controller with free parts is of this epoch."""
        self.waiting: dict[int, None] = {}
        """The groups that may be asked for, in the order in which they became ready."""
        self.rounds: dict[int, Round] = {}
        self.epoch = 0
        self.next_round = self.first_round
        self.permits: int | None = None
        """How many more transitions may be committed; None is without limit."""

    @classmethod
    def restored(cls, decomposition: Decomposition, kept: Mapping[str, Stored], name: str = TOP) -> Self:
        """The coordinator with what stable storage kept of it; a fresh one where it kept nothing."""
        machine = cls(decomposition, name)
        if kept:
            machine._restore(kept)
        return machine

    def start(self) -> list[Effect]:
        """The first act: from now on this epoch is used, so it is kept before anything is said in it."""
        return [Keep("epoch", self.epoch), *self.resend()]

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
                last = self._last_words(message.controller) if message.last else ()
                return [*self._open(), *last]
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
        """Repeat what has not been answered; for links that lose messages, and after a restart."""
        effects: list[Effect] = []
        if self.epoch:
            for controller in dict.fromkeys(c for took_part in self.participants.values() for c in took_part):
                if self.seen[controller] < 0 or not self.lately.get(controller, True):
                    effects.append(Hello(controller, self.closed_below, -1, self.epoch, self.name))
        for open_round in self.rounds.values():
            effects += self._unanswered(open_round)
        return effects

    def _unanswered(self, opened: Round) -> Iterator[VoteRequest | Decision]:
        for controller in self.ordered(opened):
            if controller not in opened.acknowledged:
                yield self._decision(controller, opened.number, opened.committed)
        for controller in () if opened.decided else opened.participants:
            if controller not in opened.votes:
                yield self._request(opened, controller)

    def ordered(self, decided: Round) -> tuple[str, ...]:
        """Who gets an order in a round that is decided, and has to acknowledge it; nobody before."""
        if not decided.decided:
            return ()
        commits = () if decided.committed is None else self.participants[decided.committed]
        return tuple(dict.fromkeys((*decided.participants, *commits)))

    def needs(self, controller: str) -> bool:
        """Whether an open round has to do with a controller that has not acknowledged its decision."""
        return any(
            controller in (*opened.participants, *self.ordered(opened)) and controller not in opened.acknowledged
            for opened in self.rounds.values()
        )

    def _last_words(self, controller: str) -> Iterator[Effect]:
        if not self.needs(controller):
            yield Hello(controller, self.closed_below, self.seen[controller], self.epoch, self.name)
        for opened in self.rounds.values():
            yield from (effect for effect in self._unanswered(opened) if effect.controller == controller)

    def _hear(self, controller: str, readiness: Readiness) -> None:
        if readiness.sequence <= self.seen[controller]:
            return
        self.seen[controller] = readiness.sequence
        transitions = readiness.transitions
        if controller in self.lately:
            self.lately[controller] = readiness.epoch == self.epoch
            if not self.lately[controller]:
                transitions -= self.of_free[controller]
        new = transitions - self.ready[controller]
        self.ready[controller] = transitions
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
        opened = self._round(self.next_round, group, names)
        self.rounds[opened.number] = opened
        self.next_round += self.stride
        for controller in opened.participants:
            yield self._request(opened, controller)
        if not opened.participants:
            yield from self._decide(opened, self._choice(opened))

    def _round(self, number: int, group: int, names: tuple[str, ...]) -> Round:
        writes = reads = 0
        for name in names:
            compiled = self.player.transitions[name]
            writes, reads = writes | compiled.writes, reads | compiled.reads
        participants = tuple(
            dict.fromkeys(c for name in names for c in self.participants[name] if c not in self.free[name])
        )
        return Round(number, group, names, participants, writes, reads)

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        for key, value in kept.items():
            match key.partition("/"), value:
                case ("epoch", _, _), int(epoch):
                    self.epoch = epoch + 1
                case ("turns", _, _), [*turns]:
                    self.arbiter.turns = self.kept_turns = tuple(int(str(turn)) for turn in turns)
                case ("round", _, number), [str(committed), *asked]:
                    names = tuple(map(str, asked))
                    opened = self._round(int(number), self.group_of[committed], names)
                    opened.decided, opened.committed = True, committed
                    self.rounds[opened.number] = opened
        self.rounds = dict(sorted(self.rounds.items()))
        begin = self.epoch << EPOCH_BITS
        self.next_round = begin + (self.first_round - begin) % self.stride

    def _voted(self, vote: Vote) -> Iterator[Effect]:
        voted = self.rounds.get(vote.round)
        if voted is None and vote.round < self.epoch << EPOCH_BITS:
            yield self._decision(vote.controller, vote.round, None)  # nobody fires it: not committed, or over
        # A vote of a round that is decided, or of none of ours, is stale (O5), and one of who was not asked is none.
        if voted is not None and not voted.decided and vote.controller in voted.participants:
            voted.votes[vote.controller] = vote.promised
            if len(voted.votes) == len(voted.participants):
                yield from self._decide(voted, self._choice(voted))
        yield from self._open()

    def _choice(self, voted: Round) -> str | None:
        """The transition to commit: one of those with all votes yes, by the arbiter of the group."""
        enabled = [t for t in voted.transitions if self._has_all_votes(voted, t)]
        return self.arbiter.choose(enabled) if enabled and self.permits != 0 else None

    def _has_all_votes(self, voted: Round, t: str) -> bool:
        free = self.free[t]
        if free and any(other.committed == t for other in self.rounds.values()):
            return False  # the votes may be from before that firing
        return all(t in (self.ready[c] if c in free else voted.votes[c]) for c in self.participants[t])

    def _decide(self, decided: Round, committed: str | None) -> Iterator[Effect]:
        decided.decided, decided.committed = True, committed
        if committed is not None:
            if self.permits is not None:
                self.permits -= 1
            yield Keep(f"round/{decided.number}", (committed, *decided.transitions))
            if self.arbiter.turns != self.kept_turns:
                self.kept_turns = self.arbiter.turns
                yield Keep("turns", self.kept_turns)
            yield Firing(committed)
        for controller in self.ordered(decided):
            yield self._decision(controller, decided.number, committed)
        if not self.ordered(decided):
            del self.rounds[decided.number]

    def _acknowledged(self, message: Acknowledgement) -> Iterator[Effect]:
        acknowledged = self.rounds.get(message.round)
        if acknowledged is not None and acknowledged.decided:
            acknowledged.acknowledged.add(message.controller)
            if acknowledged.acknowledged.issuperset(self.ordered(acknowledged)):
                del self.rounds[message.round]
                if acknowledged.committed is not None:
                    yield Keep(f"round/{message.round}", None)
                # Those that lost the arbitration are ready as before, and no report will say so again.
                self.waiting.setdefault(acknowledged.group)
        yield from self._open()

    def _request(self, asked: Round, controller: str) -> VoteRequest:
        names = tuple(
            t for t in asked.transitions if controller in self.participants[t] and controller not in self.free[t]
        )
        seen = self.seen[controller]
        return VoteRequest(controller, asked.number, names, self.closed_below, seen, self.epoch, self.name)

    def _decision(self, controller: str, number: int, committed: str | None) -> Decision:
        seen = self.seen[controller]
        return Decision(controller, number, committed, self.closed_below, seen, self.epoch, self.name)
