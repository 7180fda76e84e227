"""The local controller: plays the tokens of one subnet, promises its parts, and commands its machines.

It fires its local transitions by itself and its parts of coordinated transitions on their coordinator's commit only.
With layers there are several coordinators above it, and what it knows of each stands apart (`Above`); a promise keeps
away what disturbs it whoever asks.
A yes vote is a promise (O1): until the round is decided, the parts promised are a *lock*. What disturbs a lock waits:
local transitions, other promises, and changes of the signals that the promised parts read or clear, latched outside
the process image and taken in when the lock is released. So an external gate that was open at the vote is open, in
the image, at the commit, and the commit always finds its part enabled. (The signal itself may have dropped meanwhile:
Eq. (8) then means "each true at its own vote", which SEMANTICS O4 accepts for gates that no command clears.) That is
for the commit alone: whatever else reads the signal, local transitions and later votes, waits where what it shows now
closes a gate, or one would command a machine on an interlock that has opened long ago.

A part that is *free of promise* votes by what the controller reports: when it is enabled and no promise here disturbs
it. The vote stands until the order comes, and nothing waits for it; then the part finds its inputs full and its outputs
empty, but its gates may have changed since the decision. Two things are kept for its sake. The completions that it
awaits fall by a command only: what a driver says else is not taken in. And what it rests on, the marking and these
completions, is in stable storage before any report leaves, as all of `word` is; so it stands after a restart, though
the controller does not know any more that it has told of it.

A token that enters a place with a command does three things in one act: the marking is changed, the completion signal
of the place and its timer are cleared in the image, and the command is sent (O7). Nothing reads the image in between.

A pure machine: inputs are method calls, outputs the effects that they return. It asks no clock and remembers a round
only until the coordinator says that nobody will speak of it again. The alternative, a promise with a time limit, needs
clocks that agree; here a lost decision is repeated until acknowledged, and until then the part stays blocked (O6).

A controller whose host is about to end is *leaving*: it fires nothing, names nothing in its reports and votes no, so
that no round waits for it and no vote of it stands. But an order may be under way on a vote that stood before. So its
report asks each coordinator for the word that no open round needs it any more, and until that has come it obeys
whatever arrives. Rejected: to end when all is quiet here. Of an order on a standing vote a controller knows nothing
before it comes.

What of all that a restart finds, and why, is in `restored.py`.

After a restart a controller is *held*: nothing moves because a computer has started. It fires nothing, promises nothing
more and sends no command, until an operator resumes it. What it promised before is still promised: its votes are
repeated, and their decisions applied, with the commands owed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType
from typing import Self

from firable.executor.protocol.above import Above, Promise, union
from firable.executor.protocol.commands import Answer, Commands
from firable.executor.protocol.deciders import closed_key, coordinator_at, coordinators
from firable.executor.protocol.enabled import EnabledSet
from firable.executor.protocol.messages import (
    EPOCH_BITS,
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Hello,
    Keep,
    ProtocolError,
    Readiness,
    Report,
    Stored,
    Taken,
    ToController,
    Vote,
    VoteRequest,
)
from firable.executor.protocol.restored import restore
from firable.executor.protocol.stored_word import Piece, changed_pieces, kept_of
from firable.executor.protocol.timers import Timers
from firable.executor.protocol.token_player import Arbiter, Compiled, SignalAt, TokenPlayer, Word
from firable.nets.bits import bits
from firable.nets.decomposition import Decomposition
from firable.nets.net import Marking, SignalKind


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
        self.parts: Mapping[str, Compiled] = MappingProxyType({row: compiled[part] for part, row in part_of.items()})
        self.transitions = tuple(compiled.values())
        width = len(self.subnet.places) + len(self.subnet.signals)
        self.enabled = EnabledSet([(c.needs, c.forbids) for c in self.transitions], width)
        self.rows = MappingProxyType({t: part_of[c.name] for t, c in enumerate(self.transitions) if c.name in part_of})
        """The coordinated transition of each part, by the index of the part."""
        self.local_mask = sum(1 << t for t in range(len(self.transitions)) if t not in self.rows)
        """The transitions that it fires by itself."""
        self.free = frozenset(row for row, controller in decomposition.free if controller == name)
        """The transitions of which the part here is free of promise."""
        self.free_mask = sum(1 << t for t, row in self.rows.items() if row in self.free)
        self.lasting = union(self.parts[row].needs for row in self.free) & ~self.player.places
        """The completions that these wait for."""
        self.arbiter = Arbiter(self.subnet, (group for group in decomposition.groups if group.controller == name))
        self.kept_turns = self.arbiter.turns
        self.word = self.subnet.initial_marking
        self.kept_word = self.word
        """The word that a restart would find."""
        self.promises: dict[int, Promise] = {}
        self.closed: set[int] = set()
        """The rounds decided, of all coordinators, that are not below what is closed."""
        self.coordinators = coordinators(decomposition)
        at = {row.name: coordinator_at(row.at) for row in decomposition.coordinated if row.name in self.parts}
        self.above: dict[str, Above] = {}
        for coordinator in self.coordinators:
            if mask := sum(1 << t for t, row in self.rows.items() if at[row] == coordinator):
                self.above[coordinator] = Above(coordinator, frozenset(self.rows[t] for t in bits(mask)), mask)
        self.latched: dict[str, bool] = {}
        self.commands = Commands(self.subnet, {})
        self.timers = Timers(self.player)
        self.unsent: Word = 0
        """The places whose token waits until a driver has its command (`commands`)."""
        self.untold: Word = 0
        """The sensors that have shown nothing since the restart."""
        self.held = False
        self.leaving = False
        """Whether its host is about to end."""
        self.forgone = 0
        """The transitions that an operator lets fire no more, by their indexes."""
        self.index_of = MappingProxyType({row: t for t, row in self.rows.items()})
        self.epoch = 0

    @classmethod
    def restored(cls, decomposition: Decomposition, name: str, kept: Mapping[str, Stored]) -> Self:
        """The controller with what stable storage kept of it, held; a fresh one where it kept nothing."""
        machine = cls(decomposition, name)
        if kept:
            machine._restore(kept)
        return machine

    @property
    def marking(self) -> Marking:
        """The marking of the subnet."""
        return self.player.marking(self.word)

    def start(self) -> list[Effect]:
        """The first act: from now on this epoch is used, so it is kept before anything is said in it."""
        cleared = (name for name in self.timers.signals if not self.word & self.player.signal_bit(name))
        return [Keep("epoch", self.epoch), *(Taken(name, value=False) for name in cleared if self.held)]

    def answer(self, place: str, entry: int, answer: Answer) -> list[Effect]:
        """Take what is said of a command in `commands.questions`."""
        completion = self.subnet.place(place).completion
        if not self.commands.answer(place, entry, answer) or answer not in (Answer.DONE, Answer.WORKING):
            return []
        if completion is None:
            return self.sent(place, entry)  # it was received, and nothing else is asked of it
        return self.read(completion, value=True, entry=entry) if answer is Answer.DONE else []

    def resume(self) -> list[Effect]:
        """End the hold after a restart, and send what is owed; `ProtocolError` while there are questions."""
        owed = list(self.commands.resume(frozenset(self.subnet.names(self.marking))))
        self.held = False
        self._mark_unsent()
        self.timers.begin_anew(self.word & ~self._uncommanded())
        return owed

    def receive(self, message: ToController) -> list[Effect]:
        """Take a message of a coordinator; `ProtocolError` from one that decides nothing here."""
        above = self.above.get(message.coordinator)
        if above is None:
            raise ProtocolError(f"{self.name}: '{message.coordinator}' decides nothing here")
        effects = list(self._close_below(above, message.closed_below))
        if message.epoch > above.epoch:
            # It has restarted, and has forgotten which rounds were open: to name them makes it abort them.
            above.epoch, above.seen, above.dismissed = message.epoch, -1, -1
            effects += self._say_again(above)
        if message.epoch == above.epoch:
            above.seen = max(above.seen, message.seen)
            if isinstance(message, Hello):
                above.dismissed = max(above.dismissed, message.seen)
        match message:
            case VoteRequest():
                effects += self._vote(message)
            case Decision():
                effects += self._decided(message)
            case Hello():
                return effects
        return [*effects, *self._last_words(above)]

    def leave(self) -> list[Effect]:
        """Take all votes back and fire no more; the end may come when `awaited` names nobody and no promise is open."""
        self.leaving = True
        return [effect for above in self.above.values() for effect in self._last_words(above)]

    def stay(self) -> None:
        """Leave no more: votes are given again."""
        self.leaving = False

    @property
    def awaited(self) -> tuple[str, ...]:
        """The coordinators that have not said yet that no round needs it; nobody unless it is leaving."""
        return tuple(name for name, above in self.above.items() if self._is_unanswered(above))

    def holds(self, signal: str) -> bool:
        """Whether a promise keeps a signal in the image as it was."""
        return bool(self.promises and self.player.signal_bit(signal) & self._locked_reads())

    def applies(self, decision: Decision) -> bool:
        """Whether this order would fire a part here: it commits one, and has not been obeyed."""
        return decision.committed in self.parts and not self._is_closed(decision.round)

    def read(self, signal: str, value: bool, entry: int | None = None) -> list[Effect]:
        """Take a new value of a signal.

        `entry` says of a completion signal which command is completed, as `Sending.entry` counted it: a completion of
        an earlier command is stale, and dropped.
        """
        if entry is not None and entry != self.commands.entry(signal):
            return []
        at = self.player.signals[signal]
        if not value and at.bit & self.lasting:
            return []
        if self.promises and at.bit & self._locked_reads():
            self.latched[signal] = value
            return []
        return self._take(signal, at, value)

    def sent(self, place: str, entry: int) -> list[Effect]:
        """Take the driver's word that it has the command of a place."""
        effects = self.commands.sent(place, entry)
        if effects:
            self.unsent &= ~(1 << self.subnet.place_index[place])
        return effects

    def tick(self, now_seconds: float, held: Collection[str] = ()) -> list[Effect]:
        """Take what the clock shows: set the timers whose time is over; a controller that is held times nothing.

        The commands of the places `held` have not left the host: their times do not begin.
        """
        if self.held or not self.timers.running:
            return []
        effects: list[Effect] = []
        for place in self.timers.over(now_seconds, self.word, held):
            effects += self.read(self.subnet.place(place).cleared[-1], value=True)
        return effects

    def deadline(self, held: Collection[str] = ()) -> float | None:
        """When it has to be told the time next; minus infinity for at once, None while nothing is timed.

        The times of the places `held` begin when the host says that they are not.
        """
        return self.timers.deadline(self.word, held) if self.timers.running and not self.held else None

    @property
    def may_fire(self) -> bool:
        """Whether a local transition is enabled by the word; what else keeps it, `fire` knows."""
        enabled = self.enabled.at(self.word)
        return (enabled & self.local_mask if self.rows else enabled) != 0

    def fire(self) -> list[Effect]:
        """Fire one local transition, if one is enabled and disturbs no promise; no effect means that none is."""
        if self.held or self.leaving:
            return []
        enabled = self.enabled.at(self.word)
        if self.rows:  # each operation counts where there are thousands of transitions
            enabled &= self.local_mask
        if self.forgone:
            enabled &= ~self.forgone
        if not enabled:
            return []
        is_bound = self.promises or self.untold or self.unsent  # by more than the word
        found = self.arbiter.following(enabled, self._is_free if is_bound else None)
        if found is None:
            return []
        chosen = self.transitions[found]
        effects = self._fire(chosen)
        effects.insert(0, Firing(chosen.name))
        if self.arbiter.turns != self.kept_turns:
            self.kept_turns = self.arbiter.turns
            effects.append(Keep("turns", self.kept_turns))
        return effects

    def forgo(self, names: Collection[str]) -> None:
        """Neither fire nor promise these transitions any more; what is promised stays so. A restart forgets it."""
        own = {self.rows.get(t, transition.name): t for t, transition in enumerate(self.transitions)}
        self.forgone = sum(1 << own[name] for name in names if name in own)

    def report(self) -> list[Effect]:
        """Tell each coordinator which parts are enabled, if that has changed since it was last told."""
        if not self.above:
            return []  # nobody decides anything here, as of most cells with one controller
        return [self._report(above) for above in self.above.values() if self._readiness(above).sequence > above.told]

    def resend(self) -> list[Effect]:
        """Repeat what is unanswered, for links that lose messages: votes, and the last report if it is not seen."""
        return [effect for above in self.above.values() for effect in self._say_again(above)]

    def _say_again(self, above: Above) -> list[Effect]:
        promised = [n for n, promise in self.promises.items() if promise.promised and self.above_of(n) is above]
        if promised:
            return [Vote(self.name, n, self.promises[n].promised, self._told(above), above.name) for n in promised]
        return [self._report(above)] if above.told > above.seen or self._is_unanswered(above) else []

    def _report(self, above: Above) -> Report:
        return Report(self.name, self._told(above), above.name, self.leaving)

    def _last_words(self, above: Above) -> list[Effect]:
        return [self._report(above)] if self._is_unanswered(above) else []

    def _is_unanswered(self, above: Above) -> bool:
        return self.leaving and above.dismissed < self._readiness(above).sequence

    def _restore(self, kept: Mapping[str, Stored]) -> None:
        self.held = True
        restore(self, kept)
        self._mark_unsent()
        held = self._locked_reads()
        self.word &= ~sum(bit for name in self.timers.signals if not (bit := self.player.signal_bit(name)) & held)
        self.await_sensors()

    @property
    def unread(self) -> frozenset[str]:
        """The sensors that nobody has read since the start."""
        bits = self.player.signal_bits if self.untold else {}
        return frozenset(name for name, bit in bits.items() if bit & self.untold)

    def await_sensors(self) -> None:
        """Close the gates of each sensor until it is told: what nobody has read yet is no 0."""
        sensors = (s.name for s in self.subnet.signals if s.kind is SignalKind.SENSOR)
        self.untold = sum(map(self.player.signal_bit, sensors))

    def _vote(self, request: VoteRequest) -> Iterator[Effect]:
        if self._is_closed(request.round):
            return  # an old copy: the round is decided
        if request.round not in self.promises:
            is_asked = not (self.held or self.leaving)
            asked = [n for n in request.transitions if n in self.parts and n not in self.free and is_asked]
            asked = [name for name in asked if not self.forgone >> self.index_of[name] & 1]
            # The parts of one round may disturb each other: one of them is chosen. Those of other rounds may not.
            yes = [n for n in asked if self._is_enabled(self.parts[n]) and not self._disturbs_promises(self.parts[n])]
            self.promises[request.round] = Promise.of(self.parts, yes)
            if yes:
                yield Keep(f"promise/{request.round}", yes)
                yield from self._keep_word(self.word, ())
        above = self.above_of(request.round)
        yield Vote(self.name, request.round, self.promises[request.round].promised, self._told(above), above.name)

    def _decided(self, decision: Decision) -> Iterator[Effect]:
        if not self._is_closed(decision.round):
            promise = self.promises.get(decision.round)
            yield from self._end(decision.round)
            if decision.committed in self.parts:
                yield from self._apply(decision, promise)
            yield from self._release()
        above = self.above_of(decision.round)
        if decision.round >= above.kept_below and decision.round not in self.closed:
            yield from self._keep_closed(above)  # closed by hearsay alone; what is acknowledged outlives a crash
        yield Acknowledgement(self.name, decision.round, self._told(above), above.name)

    def _apply(self, decision: Decision, promise: Promise | None) -> Iterator[Effect]:
        part = self.parts[str(decision.committed)]
        if decision.committed in self.free:
            if self.word & part.takes != part.takes or self.word & part.puts:
                raise ProtocolError(f"{self.name}: '{part.name}' is free of promise, and its tokens have been moved")
            yield from self._fire(part)
            return
        if promise is None or decision.committed not in promise.promised:
            raise ProtocolError(f"{self.name}: '{part.name}' is committed without a promise")
        if not part.enabled(self.word):  # the signals it reads are in the image as they were at the vote
            raise ProtocolError(f"{self.name}: '{part.name}' was promised and is not enabled")
        yield from self._fire(part)

    def _end(self, number: int) -> Iterator[Effect]:
        """End the promise of a round that is decided; whatever comes of the round later is an old copy."""
        promise = self.promises.pop(number, None)
        if promise is not None and promise.promised:
            yield Keep(f"promise/{number}", None)
        above = self.above_of(number)
        if number >= above.closed_below:
            self.closed.add(number)
        yield from self._keep_closed(above)

    def _keep_closed(self, above: Above) -> Iterator[Effect]:
        above.kept_below = above.closed_below
        numbers = sorted(n for n in self.closed if self.above_of(n) is above)
        yield Keep(closed_key(above.name), (above.closed_below, numbers))

    def _close_below(self, above: Above, number: int) -> Iterator[Effect]:
        """Forget the rounds that nobody will speak of again; one promised and unheard of was aborted by a restart."""
        if number > above.closed_below:
            above.closed_below = number
            self.closed = {closed for closed in self.closed if closed >= number or self.above_of(closed) is not above}
            if aborted := [n for n in self.promises if n < number and self.above_of(n) is above]:
                for promised in aborted:
                    yield from self._end(promised)
                yield from self._release()

    def _fire(self, transition: Compiled) -> list[Effect]:
        before = self.word
        self.word = transition.fire(before)
        self.enabled.said = before, self.word, transition.step
        effects = self._keep_word(before, transition.pieces)
        for entered in transition.entered:
            for signal, bit in entered.cleared:
                self.latched.pop(signal, None)  # a value from before the command
                if before & bit:
                    effects.append(Taken(signal, value=False))
            place = entered.place
            if place.within is not None:
                self.timers.enter(place.name)
            effects += self.commands.enter(place, held=self.held)
            if place.completion is None:
                self.unsent |= entered.bit
        return effects

    def _release(self) -> Iterator[Effect]:
        """Take in the signals that changed while a promise read them."""
        for signal, value in list(self.latched.items()):
            if not self.player.signal_bit(signal) & self._locked_reads():
                del self.latched[signal]
                timed = self.timers.signals.get(signal)
                if timed is None or self.timers.waits(timed.name, self.word):
                    yield from self._take(signal, self.player.signals[signal], value)
                else:  # the completion has come in time after all
                    self.timers.enter(timed.name)

    def _take(self, signal: str, at: SignalAt, value: bool) -> list[Effect]:
        effects: list[Effect] = []
        bit, before = at.bit, self.word
        # What a sensor shows first after a restart is told even if it is nothing new: the image may be newer than what
        # was kept of it, and who follows the trace saw the newer one.
        if bool(before & bit) != value or bit & self.untold:
            self.word = before | bit if value else (before | bit) ^ bit
            self.enabled.said = before, self.word, at.steps[value]
            if self.untold:
                self.untold &= ~bit
            effects.append(Taken(signal, value))
            if bit & self.player.completing:
                effects += self._keep_word(before, at.pieces)
        if value and bit & self.player.completing:
            effects += self.commands.completed(signal)
        return effects

    def _keep_word(self, before: Word, pieces: tuple[Piece, ...]) -> list[Effect]:
        """Have the word kept; of the word `before`, these pieces have changed."""
        kept, self.kept_word = self.kept_word, self.word
        if kept is before:
            return kept_of(before, self.word, pieces)
        return changed_pieces(kept, self.word)

    def _is_enabled(self, transition: Compiled) -> bool:
        """Enabled by the image, and by what the signals show where a promise keeps that out of the image.

        A sensor untold since the start closes its gates; a token whose command is not sent yet is not taken.
        """
        if transition.takes & self.unsent or transition.reads & self.untold:
            return False
        return transition.enabled(self.word) and (not self.latched or transition.enabled(self._shown()))

    def _shown(self) -> Word:
        """The word with the values in it that promises keep out."""
        word = self.word
        for signal, value in self.latched.items():
            bit = self.player.signal_bit(signal)
            word = word | bit if value else word & ~bit
        return word

    def _uncommanded(self) -> Word:
        """The places with a time limit for whose completion no command was sent: a token there came with the start."""
        limited = self.timers.places.values()
        names = (p.name for p in limited if p.completion is not None and not self.commands.entry(p.completion))
        return sum(1 << self.subnet.place_index[name] for name in names)

    def _mark_unsent(self) -> None:
        self.unsent = sum(1 << self.subnet.place_index[place] for place in self.commands.unsent)

    def _is_free(self, t: int) -> bool:
        transition = self.transitions[t]
        return self._is_enabled(transition) and not self._disturbs_promises(transition)

    def coordinator_of(self, number: int) -> str:
        """The coordinator whose round it is."""
        return self.coordinators[number % len(self.coordinators)]

    def above_of(self, number: int) -> Above:
        """What is known of the coordinator whose round it is."""
        return self.above[self.coordinator_of(number)]

    def _is_closed(self, number: int) -> bool:
        return number < self.above_of(number).closed_below or number in self.closed

    def _disturbs_promises(self, transition: Compiled) -> bool:
        return any(transition.disturbs(promise.writes, promise.reads) for promise in self.promises.values())

    def _locked_reads(self) -> int:
        return union(promise.reads | promise.writes for promise in self.promises.values())

    def _readiness(self, above: Above) -> Readiness:
        ready = 0 if self.held or self.leaving else self.enabled.at(self.word) & above.mask
        if self.forgone:
            ready &= ~self.forgone
        if self.untold or self.unsent or self.latched:
            ready = sum(1 << t for t in bits(ready) if self._is_enabled(self.transitions[t]))
        if self.promises and ready & self.free_mask:
            disturbing = (t for t in bits(ready & self.free_mask) if self._disturbs_promises(self.transitions[t]))
            ready &= ~sum(1 << t for t in disturbing)
        known = above.readiness
        if ready != above.ready_mask or known.sequence < self.epoch << EPOCH_BITS or known.epoch != above.epoch:
            above.ready_mask = ready
            names = frozenset(self.rows[t] for t in bits(ready))
            above.readiness = Readiness(known.sequence + 1, names, above.epoch)
        return above.readiness

    def _told(self, above: Above) -> Readiness:
        readiness = self._readiness(above)
        above.told = max(above.told, readiness.sequence)
        return readiness
