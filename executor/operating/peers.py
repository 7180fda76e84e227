"""The other hosts, as one host knows them: who is reached, who never was, what they may say, what is repeated.

*Watching*: a peer that is lost or refused is told, with what waits for it; so is one that has not come within
`MEET_SECONDS`, because a name that was written wrong, a cable or a host that nobody has started look the same, a link
that connects to nobody and is silent about it. Nothing else changes: a controller that has promised waits for the
decision whoever is gone (O6), and one that has not goes on alone as far as its own transitions go.

*Repeats*: what is unanswered is repeated after `REPEAT_SECONDS`, then at twice that, and so on up to
`REPEAT_SECONDS_MAX` (exponential backoff), because a coordinator has no word for "heard" when there is nothing to
decide, and an idle cell would talk for ever. As soon as something new is said the repeats begin anew, and a peer that
is back is told at once.

*Acquaintances*: a host keeps by which storage it met each machine, and how old that was when it was last heard of
(`acquaintances.py`); it is refused, or refuses, where that is another, or an older copy (F5025). Until it has met one
of those that its machines talk to, or where they talk to nobody any other host, ever, nothing moves here: a journal
that was mistyped or left out looks like the first start of a cell, and only the others know better. If they do before
that, or before anybody was met since this host was started, it ends: its places of the start are wrong. If they have
heard later things of this very journal, it ends whoever was met: its places are old, and nobody but it knows of others.

*Machines that another host runs*: a host that is started by mistake beside the one that has its machines would stop
them by the safe outputs of its start, in the middle of their work. So one that nobody has ever let in leaves them alone
until somebody does or `MEET_SECONDS` are over; where another host has said that it has them, until it is let in, or the
other was gone for `PARTED_SECONDS`; where a third one has let the other in, until it is let in itself, or a person has
stopped it and started it again; where a coordinator of them is of another bundle or version, as long as that one is
there and for `PARTED_SECONDS` more, for it tells nobody unlike it whom it has let in. All that is in the situation as
long as it lasts. The price is named there, too: their emergency stops are not read meanwhile.
A host that comes back with its journal drives the safe outputs at once, and so does an emergency stop.
Rejected: to leave them alone until somebody lets it in, however long. A cell is started from its machines at rest, and
the first host of it may wait for hours for the others.
Rejected: that the word of a third host lapses some time after that host has gone, as a rival's own does. It may be the
only one that is linked to both, and its end says nothing of the rival, whose machines are at work for as long as they
find something to do without it. To wait costs little: nothing moves here before a coordinator is back, which says it
again, lets this host in or ends it; and what a dead host has left at work is for the watchdogs of its devices to stop.
Where none comes back only a person can see that the rival has ended, too.
Rejected: a command by which that person says so. To stop the host and start it again says it, by somebody who is there.

*Another bundle or version*: of two such hosts neither can know which is wrong, and neither will be let in by the other.
One that nobody has ever let in ends when all coordinators of its machines refuse it so, and none that fits has come
`MEET_SECONDS` later: it can do nothing without them (F5020). One that was let in before is right, and goes on. The host
of the coordinator at the top waits for others, who are let in by it: what comes to it by mistake, from another cell or
of an old release, is told, and ends nobody here.
Rejected: that both end. Whoever starts a wrong host would then end the right ones that wait beside it.

Where all machines are on one host there are no others, and this does nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Final

from firable.executor.links.link import COORDINATOR, Arrival, Link, Refusal, all_called, called, known_otherwise
from firable.executor.links.standing import Standing
from firable.executor.links.storages import Estranged, Memory, Storage
from firable.executor.operating.acquaintances import KEEP_SECONDS, Acquaintances
from firable.executor.operating.acts import Acts
from firable.executor.operating.between import Between
from firable.executor.operating.waits import reached, waits
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import Message, ToController
from firable.nets.decomposition import Decomposition
from firable.nets.diagnostics import Diagnostic, InputError

REPEAT_SECONDS: Final = 0.2
REPEAT_SECONDS_MAX: Final = 3.2
MEET_SECONDS: Final = 3.0
"""A peer that has not been met by then is told."""
PARTED_SECONDS: Final = 30.0
"""A host that is gone for so long has ended: a switch that is started anew, or a plug, parts two for less."""


class Peers:
    """The machines of other hosts, behind a link; `told` hears of them, by the kind of news and a sentence.

    `work` has done at once what has been posted; `begin` is called when something may move here that might not until
    then, and `end` ends the run by an error.
    """

    def __init__(
        self,
        decomposition: Decomposition,
        acts: Acts,
        acquaintances: Acquaintances,
        link: Link | None,
        told: Callable[[str, str], None],
        work: Callable[[], None],
        begin: Callable[[], None],
        end: Callable[[InputError], None],
    ) -> None:
        self.acts = acts
        self.acquaintances = acquaintances
        self.work = work
        self.begin = begin
        self.end = end
        self.link = link
        self.told = told
        self.repeat_seconds = self.pause_seconds = REPEAT_SECONDS
        self.between = Between(decomposition)
        self.here = here = {*acts.coordinators, *acts.controllers}
        self.names = {*coordinators(decomposition), *(subnet.name for subnet in decomposition.subnets)} - here
        self.deciding = {above for controller in acts.controllers.values() for above in controller.above} - here
        """The coordinators elsewhere of machines here."""
        voting = {
            c for each in acts.coordinators.values() for took_part in each.participants.values() for c in took_part
        }
        self.needed = tuple(sorted(self.deciding | (voting - here)))
        """The machines of other hosts that one here exchanges messages with."""
        self.connected_to: set[str] = set()
        self.met: set[str] = set()
        self.standing = Standing.GOING
        self.standing_peers: dict[str, Standing] = {}
        """Of these, those whose host is paused, held or latched, and which of it."""
        self.meeting = asyncio.Event()
        self.turned_away: dict[str, str] = {}
        """What is said of each that was refused and has not come back as it should."""
        self.refused_hosts: set[tuple[str, ...]] = set()
        """The hosts that were refused and are still there, each by its machines."""
        self.rival_let_in_by: dict[str, str] = {}
        """For each machine here that a rival host runs too: the third host that has let the rival in, in a phrase."""
        self.is_hands_off = False
        """Whether the machines here are left alone, because another host may have them."""
        self.hands_off_until_seconds = 0.0
        """When they no longer are, if nobody is known to have them then."""
        self.left_by_rival: set[str] = set()
        """Those of the machines here that the rival which left last was running as well."""
        self.left_by_unlike: set[str] = set()
        """The coordinators of machines here that were unlike this host, and are gone."""
        self.of_other_release: set[str] = set()
        """The machines elsewhere that were last met with another bundle or version than the one here."""
        self.hopeless: asyncio.TimerHandle | None = None
        """What ends a host that can do nothing without those."""
        self.keep_due_seconds = 0.0
        """When ages that were heard are made durable by themselves."""
        self.dropped: set[tuple[str, str]] = set()
        """Of whom it was told that he said what is not his to say, and of which kind that was."""
        self.is_due = False
        """Whether all should have come by now."""
        self.timer: asyncio.TimerHandle | None = None

    @property
    def age(self) -> int:
        """How old the storage of this host is."""
        return self.acts.journal.age

    @property
    def memory(self) -> Memory:
        """What this host is known by, and knows others by."""
        return self.acquaintances.memory

    @property
    def is_unmet(self) -> bool:
        """Whether nobody who could know better was ever met: then nothing moves here."""
        others = self.needed or self.names
        return self.link is not None and bool(others) and self.acquaintances.known.keys().isdisjoint(others)

    @property
    def nobody_met(self) -> bool:
        """Whether none of those who could know better was met since the start."""
        others = self.needed or self.names
        return self.link is not None and bool(others) and self.met.isdisjoint(others)

    async def somebody(self) -> None:
        """Wait until one of them has been met."""
        while self.nobody_met:
            self.meeting.clear()
            await self.meeting.wait()

    @property
    def claimed(self) -> tuple[str, ...]:
        """The controllers here whose machines another host has, as far as is known."""
        theirs = set(self.rival_let_in_by).union(*self.refused_hosts)
        return tuple(sorted(theirs.intersection(self.acts.controllers)))

    @property
    def _unlike(self) -> set[str]:
        """The coordinators of machines here that are there, and of another bundle or version."""
        return set() if COORDINATOR in self.acts.coordinators else self.deciding & self.of_other_release

    @property
    def _may_be_claimed(self) -> bool:
        """Whether another host has machines here, or may have been let in with them by one that would not say so."""
        return bool(self.claimed or self._unlike)

    async def let_drive(self, is_urgent: Callable[[], bool]) -> None:
        """Wait as long as another host may have the machines here, or is said to have them; not where it is urgent.

        What a host that is gone had is left alone for `PARTED_SECONDS` more: a broken line may have taken it away.
        """
        loop = asyncio.get_running_loop()
        self.hands_off_until_seconds = max(self.hands_off_until_seconds, loop.time() + MEET_SECONDS)
        self.is_hands_off = True
        try:
            while (
                self.is_unmet
                and not is_urgent()
                and ((is_open := self._may_be_claimed) or loop.time() < self.hands_off_until_seconds)
            ):
                self.meeting.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout_at(None if is_open else self.hands_off_until_seconds):
                        await self.meeting.wait()
        except asyncio.CancelledError:
            own = asyncio.current_task()
            if own is None or not is_urgent():
                raise
            own.cancel()  # of who drives by then, and on its way out drives the safe outputs
        finally:
            self.is_hands_off = False

    async def run(self) -> None:
        """Be linked to them until cancelled; raises `InputError` where the link cannot be opened, or fails."""
        if self.link is None:
            return
        loop = asyncio.get_running_loop()
        watchdog = loop.call_later(MEET_SECONDS, self._should_have_come)
        self._repeat_later(self.repeat_seconds)
        self.link.stand(self.standing)  # whatever it was in an earlier life
        try:
            await self.link.run(self)
        finally:
            watchdog.cancel()
            for timer in (self.timer, self.hopeless):
                if timer is not None:
                    timer.cancel()
            if self.acquaintances.has_heard:
                self.acquaintances.write()  # the last sync of the host stores it

    def send(self, message: Message) -> None:
        """Hand a message to the link; it is lost, and said again, as long as this life of the host is not kept."""
        if self.link is None:
            raise RuntimeError(f"nobody here takes {message!r}")
        if not self.acquaintances.is_alive:
            return
        controller, coordinator = message.controller, message.coordinator
        to_controller = isinstance(message, ToController)
        self.link.send(*((coordinator, controller) if to_controller else (controller, coordinator)), message)

    def stand(self, standing: Standing) -> None:
        """Have the others told whether this host lets anything move."""
        if self.link is not None and standing is not self.standing:
            self.standing = standing
            self.link.stand(standing)

    def something_new(self) -> None:
        """Something was said for the first time: repeats begin anew."""
        if self.pause_seconds > self.repeat_seconds and self.timer is not None:
            self._repeat_later(self.repeat_seconds)

    def waits(self, *, is_over: bool = False) -> Iterator[str]:
        """What waits for another machine, in a sentence each; or has waited, at the end of the run."""
        yield from waits(self.acts.coordinators, self.acts.controllers, self.names - self.connected_to)
        if self.is_unmet:
            yield "nothing moves here before another host of the cell has been met"
        if self.is_hands_off and self.acts.controllers:
            yield from self._left_alone(is_over=is_over)
        yield from dict.fromkeys(map(self._missing, self.never_met))

    def _left_alone(self, *, is_over: bool) -> Iterator[str]:
        """That the machines here are left alone, why, until when, and what is to be done where that never comes."""
        if said := sorted(self.rival_let_in_by.keys() & self.acts.controllers):
            by = " and ".join(dict.fromkeys(self.rival_let_in_by[name] for name in said))
            why, until = f"{by} has let another one in with {all_called(said)}", " itself"
        elif claimed := self.claimed:
            why, until = f"another host has {all_called(claimed)}", f", or that has been gone for {PARTED_SECONDS:g} s"
        elif self.left_by_rival:
            why = f"the host that had {all_called(sorted(self.left_by_rival))} is gone, or a line to it is broken"
            until = f", or that has been gone for {PARTED_SECONDS:g} s"
        elif unlike := sorted(self._unlike):
            by = all_called(unlike)
            why = f"{by} may have let another host in with {all_called(self.acts.controllers)}"
            until = f", or that has been gone for {PARTED_SECONDS:g} s"
        elif self.left_by_unlike:
            by = all_called(sorted(self.left_by_unlike))
            why = f"{by}, which may have let another host in, is gone, or a line to it is broken"
            until = f", or that has been gone for {PARTED_SECONDS:g} s"
        else:
            why = f"another host may have {all_called(self.acts.controllers)}"
            until = f", or nobody says so within {MEET_SECONDS:g} s of its start"
        if is_over:
            yield f"{why}: this one has left its machines alone, and has driven no safe outputs"
            return
        alone = "this one leaves its machines alone, and does not read their emergency stops"
        yield f"{why}: {alone}, until it is let in{until}"
        if said:
            yield (
                f"if somebody has seen that no other host runs {all_called(said)} any more, stop this one and start it "
                f"again: it drives the safe outputs {MEET_SECONDS:g} s later, unless that is said again"
            )

    def absent(self) -> Iterator[str]:
        """Those that some machine here talks to and that are lost, or stand, in a sentence each.

        Without them nothing of what they take part in goes on, also where nothing that was said waits for an answer.
        """
        for name in self.needed:
            if name in self.met and name not in self.connected_to:
                yield f"{called(name)} is not connected"
            elif (standing := self.standing_peers.get(name)) is not None:
                yield f"{called(name)} {standing.phrase}"

    @property
    def have_let_go(self) -> bool:
        """Whether each coordinator that can be reached has said to each controller here that no order is open.

        One that cannot be reached has ended, or must wait for a restart of these in any case.
        """
        return all(self.connected_to.isdisjoint(awaited) for awaited in self.acts.awaited().values())

    @property
    def never_met(self) -> tuple[str, ...]:
        """The machines that should have come by now and have not, of those that some machine here talks to."""
        return tuple(name for name in self.needed if name not in self.met) if self.is_due else ()

    # What the link tells

    def arrived(self, sender: str, receiver: str, message: Message, age: int) -> None:
        """A message of another host; what its sender may not say is dropped."""
        self.acquaintances.heard(sender, age)
        if self._may_say(sender, receiver, message):
            self.acts.hear(receiver, message)

    def arrived_together(self, messages: Sequence[Arrival]) -> None:
        """The same of several, acted upon before this returns: to wait for a turn of the loop costs more."""
        for sender, _, _, age in messages:
            self.acquaintances.heard(sender, age)
        self.acts.hear_all([(to, message) for by, to, message, _ in messages if self._may_say(by, to, message)])
        self.work()

    def _may_say(self, sender: str, receiver: str, message: Message) -> bool:
        way = (message.coordinator, message.controller)
        is_its = (sender, receiver) == (way if isinstance(message, ToController) else way[::-1])
        if is_its and receiver in self.here and self.between.has(message):
            return True
        if (what := (sender, type(message).__name__)) not in self.dropped:  # no trace is its to fill
            self.dropped.add(what)
            self.told("dropped", f"{called(sender)} sent a {what[1]} that is not its to send")
        return False

    def connected(self, peer: str, storage: Storage) -> None:
        """A peer can be reached: what it has missed is said again."""
        if peer in self.names:
            was_unmet = self.is_unmet
            if self.acquaintances.met(peer, storage):
                self.acquaintances.write()
                self.acts.have_kept(self._speak)
            if was_unmet:
                self.begin()
            self.connected_to.add(peer)
            self.met.add(peer)
            self.meeting.set()
            self.turned_away.pop(peer, None)
            self.of_other_release.discard(peer)
            self.told("connected", f"{called(peer)} is connected")
            self._say_again()

    def _speak(self) -> None:
        """This life is kept: what was not said because it was not is said now."""
        if not self.acquaintances.is_alive:
            self.acquaintances.is_alive = True
            self.acts.recorder.may_write |= not any(each.held for each in self.acts.controllers.values())
            self._say_again()

    def _say_again(self) -> None:
        self.acts.repeat()
        self.something_new()

    def lost(self, peer: str) -> None:
        """A peer can no longer be reached."""
        self.dropped = {what for what in self.dropped if what[0] != peer}
        if peer in self.names:
            self.connected_to.discard(peer)
            self.standing_peers.pop(peer, None)
            self._keep_ages()
            waiting = [sentence for sentence in self.waits() if reached(peer, {peer}) in sentence]
            self.told("lost", "; ".join([f"{called(peer)} is lost", *waiting]))

    def stands(self, peer: str, standing: Standing) -> None:
        """The host of a peer has been paused, say, or goes on."""
        if peer in self.names:
            self.standing_peers[peer] = standing
            if standing is Standing.GOING:
                del self.standing_peers[peer]
            self.told("standing", f"{called(peer)} {standing.phrase}")

    def refused(self, peers: Sequence[str], why: Refusal) -> None:
        """A host was refused, or has let another one in with machines here, and refuses this one."""
        theirs, who = self.here.intersection(why.run_by_two), f"the host of {all_called(peers)}"
        is_third = bool(theirs) and self.here.isdisjoint(peers)
        refused = f"this host is refused by {who}" if is_third else f"{who} is refused"
        self._turn_away(peers, f"{refused}: {why.problem.message}; {why.problem.hint}")
        self.refused_hosts.add(tuple(peers))
        if is_third:
            self.rival_let_in_by |= dict.fromkeys(theirs, who)
        self.meeting.set()
        if why.are_unlike:
            self.of_other_release.update(peers)
            if self._is_hopeless and self.hopeless is None:
                loop = asyncio.get_running_loop()
                self.hopeless = loop.call_later(MEET_SECONDS, self._end_if_hopeless, why.problem)

    def gone(self, peers: Sequence[str]) -> None:
        """A host that was refused is gone; what it had it may have left in the middle of something."""
        self.refused_hosts.discard(tuple(peers))
        if parted := self.acts.controllers.keys() & set(peers):
            self.left_by_rival = parted
        self.left_by_unlike |= (unlike := self._unlike & set(peers))
        if parted or unlike:
            self.hands_off_until_seconds = asyncio.get_running_loop().time() + PARTED_SECONDS
        gone = set(peers).difference(*self.refused_hosts)  # some may be those of another host that is there
        for name in gone:
            self.turned_away.pop(name, None)
        self.of_other_release -= gone
        self.told("gone", f"the host of {all_called(peers)} that was refused is gone")
        self.meeting.set()

    @property
    def _is_hopeless(self) -> bool:
        """Whether nobody ever let this host in, and all who decide for it are unlike it."""
        is_top = COORDINATOR in self.acts.coordinators
        return self.is_unmet and not is_top and bool(self.deciding) and self.deciding <= self.of_other_release

    def _end_if_hopeless(self, problem: Diagnostic) -> None:
        self.hopeless = None
        if self._is_hopeless:
            self.end(InputError([problem]))

    def disowned(self, peers: Sequence[str], why: Estranged) -> None:
        """A host knows machines here by another storage: where nobody has shown that this one is right, it ends.

        An older copy of the same one ends in any case.
        """
        problem = known_otherwise(why, peers)
        if why.is_older or self.is_unmet or not self.met:
            self.end(InputError([problem]))
        else:
            self._turn_away(peers, f"this host is refused: {problem.message}; {problem.hint}")

    def _turn_away(self, peers: Sequence[str], said: str) -> None:
        self.turned_away.update(dict.fromkeys(peers, said))
        self.told("refused", said)

    # Time

    def _should_have_come(self) -> None:
        self.is_due = True
        for name in self.never_met:
            if name not in self.turned_away:
                self.told("never-met", self._missing(name))

    def _keep_ages(self) -> None:
        """Have the journal keep now what was heard, though nothing else is to be kept."""
        self.keep_due_seconds = asyncio.get_running_loop().time() + KEEP_SECONDS
        self.acquaintances.write()
        self.acts.have_kept()

    def _repeat_later(self, after_seconds: float) -> None:
        if self.timer is not None:
            self.timer.cancel()
        self.pause_seconds = after_seconds
        self.timer = asyncio.get_running_loop().call_later(self.pause_seconds, self._repeat)

    def _repeat(self) -> None:
        if self.acquaintances.has_heard:
            self.acquaintances.write()
            if asyncio.get_running_loop().time() >= self.keep_due_seconds:
                self._keep_ages()
        self.acts.repeat()
        self._repeat_later(min(2 * self.pause_seconds, REPEAT_SECONDS_MAX))

    def _missing(self, name: str) -> str:
        """What is said of one that has not come: it was refused, or nobody has heard of it."""
        question = "" if self.link is None else f": {self.link.question}"
        return self.turned_away.get(name, f"{called(name)} was never reached{question}")
