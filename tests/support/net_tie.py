"""Each act of a machine as firings of the protocol net that is explored and proved of a cell.

A configuration of the code is told as a marking of that net: what the controllers hold and have promised, what their
coordinators have open, and what the central net holds. An act must be a firing sequence of the net from the one marking
to the other, played by the reference player; most acts are one firing or none. What is under way is not compared, since
a message of the net may be sent again, lost and doubled; but each message that is met must be one that was sent in the
present round, and each that is sent one that a firing of the net sends there.

The net has one round of a group at a time. So three things of the code are told in its words:

- Messages of a round that is over do nothing, in the net as in the code.
- A coordinator that has crashed has given up what it had not decided. As long as promises of such a round stand, they
  are those of a round that is decided and asks for just these; the last release closes it. One that is given on a late
  request of such a round is that of a round which is asked for, promised and given up at once.
- A coordinator that has crashed has forgotten acknowledgements, and an old no may take the place of a yes: the net,
  where these stay, may do less often what nobody needs twice.

The vote on a part that is free of promise stands from a report to the order, and neither machine knows that it does. It
is told of where the coordinator counts it, and while its order is to come; who says yes must be able to vote then, or
have a vote that stands. Where it is not told of it may stand all the same, and what the net can do without that vote it
can do with it. Of every marking the invariant of the net must hold, so what is counted does stand.

Where a group has two rounds, one of them opened beside or before the end of the other, there is no such marking, nor
where a late request asks for more in a round that a crash has given up. There nothing is compared (`untold`); the
parametric proof, which has any number of rounds, speaks of these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache

from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import CHANNELS, at, central
from firable.decompose.protocol.inductive import Literal, invariant
from firable.decompose.protocol.rounds import asked, committed, decided
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.coordinator import Coordinator, Round
from firable.executor.protocol.deciders import closed_key, coordinator_at
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Firing,
    Message,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.numbering import Kept
from firable.executor.simulation.repertoire import Configuration, Step
from firable.nets.net import Marking
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player, holds_in

_IN_TURN = ("hear", "decide", "give-up", "order", "apply", "release", "note", "close", "fire", "promise", "ask")
"""The kinds of steps, as a search tries them."""
_CLOSING = ("note", "close", "ask")
"""The kinds of steps by which a coordinator closes a round, and asks anew."""
_DROPPED = ("ask", "request", "promise", "give-up", "order", "release", "note", "close")
"""The kinds of steps by which a round is given up that nobody knows of any more."""
_MARKINGS_MAX = 3_000

Rounds = Mapping[int, Round]


class NetTie:
    """A watcher of an exploration that holds every act to firings of the protocol net."""

    def __init__(self, built: ProtocolNet) -> None:
        self.built, self.parts, self.net = built, built.parts, built.net
        self.player = Player(built.net)
        self.part = {(t, part.controller): part for t, its in self.parts.coordinated.items() for part in its}
        at_ = {row.name: coordinator_at(row.at) for row in self.parts.decomposition.coordinated}
        self.decider = {t: at_[t] for t in self.parts.coordinated}
        self.channels = self.net.marking(p.name for p in self.net.places if p.name.partition("/")[0] in CHANNELS)
        self.kinds: Counter[str] = Counter()
        self.untold = 0
        self.acts: set[object] = set()
        self.told = cache(self._told)
        self.changes = [(masks.inputs | masks.outputs) & ~self.channels for masks in self.net.masks]
        self.promises = self._all("promised", free=False)
        self.passing = self._all("heard", free=False) | self._all("noted", free=False) | self._all("noted", free=True)
        self.stands, self.counted = self._all("stands", free=True), self._all("heard", free=True)
        """Votes that promise nothing: that they stand, and that the coordinator counts them."""
        self.free = [part for part in self.part.values() if part.free]
        self.sentences = [[self._masks(term) for term in one] for one in invariant(built)]
        self.is_so = cache(self._is_so)
        self.is_firable = cache(self._is_firable)
        self.near = [m.inputs | m.outputs | m.permissive | m.inhibitive for m in self.net.masks]
        """The places on which it depends whether a transition is firable."""
        self.memory = [self.net.marking(self._memory(group)) for group in self.parts.groups]
        self.moves: dict[tuple[int, str], list[int]] = {}
        """The transitions of each kind, of each group; of local firings the group is -1."""
        for t, transition in enumerate(self.net.transitions):
            kind, (_, whole, *more) = self.built.steps[transition.name].kind, transition.name.split("/")
            group = int(whole) if transition.name.startswith("close-round/") else self.parts.group_of.get(whole, -1)
            if "astray" not in more:
                self.moves.setdefault((group, kind), []).append(t)

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        del after  # its numbers are counted anew
        if step.machine < 0:
            return
        machines = (*before.machines[: step.machine], step.after, *before.machines[step.machine + 1 :])
        was = self.told(explorer, before.machines, before.central)
        now = self.told(explorer, machines, explorer.fired(before.central, step.effects))
        if was is None or now is None:
            self.untold += 1
            return
        rounds = self._rounds(explorer, before.machines)
        known = getattr(step.about, "round", None) in rounds
        told = tuple(effect for effect in step.effects if isinstance(effect, Message | Firing))
        act = (was, now, step.kind, step.machine, step.about, told, known)
        if act not in self.acts:
            self.acts.add(act)
            if self._asks_for_more(was, now, step, rounds):
                self.untold += 1
                return
            later = self._rounds(explorer, machines)
            self._act(explorer.names[step.machine], was, now, step, rounds, later)
            if not step.kind.endswith("crash"):
                rounds = {**rounds, **later}
                told_last = {e.coordinator: e for e in step.effects if isinstance(e, ToCoordinator)}
                for effect in step.effects:
                    if isinstance(effect, Message):
                        self._check_sent(was, now, effect, rounds)
                    if isinstance(effect, ToCoordinator):
                        # What is told once more before the act was true before it; what is told last, after it.
                        newest = told_last[effect.coordinator].readiness.sequence
                        self._check_told(was, now if effect.readiness.sequence == newest else was, effect)

    def _asks_for_more(self, was: Marking, now: Marking, step: Step, rounds: Rounds) -> bool:
        """Whether a late request lets more be promised in a round that a crash has given up."""
        if not isinstance(step.about, VoteRequest) or step.about.round in rounds:
            return False
        new = (t for t in step.about.transitions if self.net.marking([asked(t)]) & now & ~was)
        return any(self.net.marking([decided(self.parts, t)]) & was for t in new)

    def _all(self, kind: str, *, free: bool) -> Marking:
        return self.net.marking(at(kind, part) for part in self.part.values() if part.free is free)

    # --- A configuration as a marking

    def _rounds(self, explorer: Explorer, machines: tuple[int, ...]) -> dict[int, Round]:
        of = map(explorer.machine, machines[: len(explorer.coordinators)])
        return {n: each for machine in of if isinstance(machine, Coordinator) for n, each in machine.rounds.items()}

    def _told(self, explorer: Explorer, machines: tuple[int, ...], central_word: int) -> Marking | None:
        rounds = self._rounds(explorer, machines)
        of = [explorer.machines[number] for number in machines]
        controllers = {each.machine.name: each.machine for each in of if isinstance(each.machine, LocalController)}
        kept = {each.machine.name: each.kept for each in of}
        promised = {
            (n, t, name)
            for name, controller in controllers.items()
            for n, promise in controller.promises.items()
            for t in promise.promised
        }
        given_up = {(n, self.parts.group_of[t]) for n, t, _ in promised if n not in rounds}
        groups = Counter(self.parts.group_of[opened.transitions[0]] for opened in rounds.values())
        groups += Counter(group for _, group in given_up)
        if any(count > 1 for count in groups.values()):
            return None
        tokens = {central(p) for p in explorer.net.names(explorer.central.marking(central_word))}
        for controller in controllers.values():
            tokens |= set(controller.subnet.names(controller.marking))
        for n, opened in rounds.items():
            tokens |= set(self._open(n, opened, controllers))
        for n, _ in given_up:
            decider = explorer.coordinators[n % len(explorer.coordinators)]
            for t in {t for number, t, _ in promised if number == n}:
                tokens |= {asked(t), decided(self.parts, t)}
                obeyed = (part for part in self.parts.promising(t) if _has_obeyed(kept[part.controller], n, decider))
                tokens |= {at("obeyed", part) for part in obeyed}
        tokens |= {at("promised", self.part[t, name]) for _, t, name in promised}
        tokens |= set(self._voted(tokens, [each.machine for each in of if isinstance(each.machine, Coordinator)]))
        told = self.net.marking(tokens)
        assert self.is_so(told), f"what holds of every configuration: {sorted(tokens)}"
        return told

    def _masks(self, term: Iterable[Literal]) -> tuple[Marking, Marking]:
        """The places that a term of the invariant says are full, and those that it says are empty."""
        full, empty = (self.net.marking(place for place, value in term if value is wanted) for wanted in (True, False))
        return full, empty

    def _is_so(self, marking: Marking) -> bool:
        """Whether the invariant holds of a marking: of each sentence a term."""
        for one in self.sentences:
            for full, empty in one:
                if marking & full == full and not marking & empty:
                    break
            else:
                return False
        return True

    def _voted(self, tokens: set[str], deciding: Sequence[Coordinator]) -> Iterator[str]:
        """The votes of free parts that count, or whose order is to come."""
        for part in self.free:
            decider = next(each for each in deciding if each.name == self.decider[part.whole])
            if committed(part.whole) in tokens:
                if at("obeyed", part) not in tokens:
                    yield at("stands", part)
            elif part.whole in decider.ready[part.controller] and decider.lately[part.controller]:
                yield from (at("stands", part), at("heard", part))

    def _open(self, n: int, opened: Round, controllers: Mapping[str, LocalController]) -> Iterator[str]:
        if opened.decided:
            yield decided(self.parts, opened.transitions[0])
        for t in opened.transitions:
            if self.parts.promising(t):
                yield asked(t)
            if opened.committed == t:
                yield committed(t)
            for part in self.parts.coordinated[t] if opened.committed == t else self.parts.promising(t):
                if controllers[part.controller]._is_closed(n):
                    yield at("obeyed", part)
                if not part.free and not opened.decided and t in opened.votes.get(part.controller, ()):
                    yield at("heard", part)
                if part.controller in opened.acknowledged:
                    yield at("noted", part)

    # --- An act as firings

    def _act(self, actor: str, was: Marking, now: Marking, step: Step, rounds: Rounds, later: Rounds) -> None:
        fired = [effect.transition for effect in step.effects if isinstance(effect, Firing)]
        is_crash = step.kind.endswith("crash")
        forgotten = was & ~now & (self.passing if is_crash else self.net.marking(self._undecided(now)))
        forgotten |= was & ~now & self.counted  # what is told anew, or was told to who has crashed
        met = rounds.get(getattr(step.about, "round", -1))
        mine = -1 if met is None else self.parts.group_of[met.transitions[0]]
        alive = {self.parts.group_of[opened.transitions[0]] for opened in (*rounds.values(), *later.values())}
        lost = {self.parts.group_of[o.transitions[0]] for n, o in rounds.items() if is_crash and n not in later}
        lost -= {self.parts.group_of[opened.transitions[0]] for opened in later.values()}
        marking = was | self.net.marking(self._arriving(step.about, rounds, was))
        marking = self._hear(marking | now & self.stands, now, fired)
        touched = [g for g, memory in enumerate(self.memory) if (was ^ now) & memory or g == mine]
        # What is dropped or closed makes room for what is promised or asked for.
        for g in sorted(touched, key=lambda g: (g in alive - lost, g != mine)):
            is_over = (was & ~now) & self.net.marking([decided(self.parts, self.parts.groups[g][0])])
            if mine == g and self._is_decided_anew(rounds, later, g):
                closing = [t for kind in _CLOSING for t in self.moves.get((g, kind), ()) if self._acts(t, actor)]
                memory = self.memory[g]
                marking = self._went(marking, now & ~memory, forgotten, [], closing, memory, memory)
                marking = self._hear(marking, now, fired)
            kinds: tuple[str, ...] = _DROPPED if g not in alive - lost else _CLOSING if is_over else _IN_TURN
            allowed = [t for kind in kinds for t in self.moves.get((g, kind), ())]
            allowed = [t for t in allowed if kinds is _DROPPED or self._acts(t, actor)]
            through = self.memory[g] & self.passing if kinds is _IN_TURN else self.memory[g]
            marking = self._went(marking, now, forgotten, fired, allowed, self.memory[g], through)
        for name in fired:
            assert name not in self.parts.coordinated, f"'{name}' fires, and no firing of the net does"
            assert f"fire/{name}" in self.net.transition_index, f"'{name}' fires, and the net has no such step"
            t = self.net.transition_index[f"fire/{name}"]
            assert self._acts(t, actor), f"'{name}' is fired by '{actor}'"
            assert self.is_firable(marking & self.near[t], t), f"'{name}' fires, and is not firable in the net"
            marking = self.player.fire(marking, (t,))
            self.kinds["fire"] += 1
        reached = self._hear(marking, now, []) & ~self.channels
        # A vote that is not told of may stand all the same.
        differ = (reached ^ now) & ~(reached & (forgotten | self.stands))
        assert not differ, f"{step.kind} at '{actor}' of {step.about}: {self.net.names(differ)} differ"

    def _is_decided_anew(self, rounds: Rounds, later: Rounds, g: int) -> bool:
        """Whether a round was closed and another one, in which nobody has to promise, decided in the same act."""
        closed = any(self.parts.group_of[rounds[n].transitions[0]] == g for n in rounds.keys() - later.keys())
        opened = (later[n] for n in later.keys() - rounds.keys())
        return closed and any(each.decided and self.parts.group_of[each.transitions[0]] == g for each in opened)

    def _hear(self, marking: Marking, now: Marking, fired: Sequence[str]) -> Marking:
        """The marking when the votes of free parts are heard that count now, or are used in this act."""
        for part in self.free:
            heard, stands = (self.net.marking([at(kind, part)]) for kind in ("heard", "stands"))
            used = marking & self.net.marking([committed(part.whole)])
            if marking & stands and not marking & heard and not used and (now & heard or part.whole in fired):
                for step in ("stand/{}/again", "hear/{}"):
                    t = self.net.transition_index[step.format(f"{part.whole}/{part.controller}")]
                    if self.is_firable(marking & self.near[t], t):
                        marking = self.player.fire(marking, (t,))
                        self.kinds[self.built.steps[self.net.transitions[t].name].kind] += 1
        return marking

    def _acts(self, t: int, actor: str) -> bool:
        """Whether a step of the net is one of this machine."""
        name = self.net.transitions[t].name
        if controller := self.built.steps[name].controller:
            return controller == actor
        whole = name.split("/")[1]
        return self.decider[self.parts.groups[int(whole)][0] if name.startswith("close-round/") else whole] == actor

    def _undecided(self, now: Marking) -> Iterator[str]:
        """The votes that may have been heard in rounds that are not decided."""
        for (t, _), part in self.part.items():
            if part.free:
                continue
            if self.net.marking([asked(t)]) & now and not self.net.marking([decided(self.parts, t)]) & now:
                yield at("heard", part)

    def _memory(self, group: Sequence[str]) -> Iterator[str]:
        for t in group:
            if self.parts.promising(t):
                yield asked(t)
            yield from (committed(t), decided(self.parts, t))
            for part in self.parts.coordinated[t]:
                kinds = ("obeyed", "noted") if part.free else ("promised", "obeyed", "heard", "noted")
                yield from (at(kind, part) for kind in kinds)

    def _arriving(self, message: object, rounds: Rounds, was: Marking) -> Iterator[str]:
        """The messages of the net that a message of the code is: one for each part, in a round that is open."""
        opened = rounds.get(getattr(message, "round", -1))
        if opened is None:
            if isinstance(message, VoteRequest):  # of a round that a crash has given up, and that is not over
                asks = [t for t in message.transitions if self.net.marking([decided(self.parts, t)]) & was]
                yield from (at("request", self.part[t, message.controller]) for t in asks)
            return
        c = str(getattr(message, "controller", ""))
        its = self._concerned(opened, c)
        match message:
            case VoteRequest(transitions=transitions):
                yield from (at("request", self.part[t, c]) for t in its if t in transitions)
            case Vote(promised=promised):
                yield from (at("vote", self.part[t, c]) for t in its if t in promised)
            case Decision(committed=commit):
                kinds = (("commit-order" if t == commit else "abort-order", t) for t in its)
                yield from (at(kind, self.part[t, c]) for kind, t in kinds)
            case Acknowledgement():
                yield from (at("acknowledgement", self.part[t, c]) for t in its)

    def _concerned(self, opened: Round, c: str) -> list[str]:
        """The transitions of a round of which a controller is told: a free part gets an order to fire alone."""
        its = (t for t in opened.transitions if (t, c) in self.part)
        return [t for t in its if t == opened.committed or not self.part[t, c].free]

    def _went(
        self,
        first: Marking,
        now: Marking,
        forgotten: Marking,
        fired: list[str],
        allowed: list[int],
        memory: Marking,
        through: Marking,
    ) -> Marking:
        """A marking to which firings lead, and which holds of a group what it holds now; takes from `fired`."""
        free = (first ^ now) | through & ~self.promises | self.stands | self.counted
        allowed = [t for t in allowed if not self.changes[t] & ~free and self._fires(t) in ("", *fired)]
        allowed = [t for t in allowed if self._is_wanted(t, now, now & ~first)]
        seen, ways = {first}, [(first, list[int]())]
        while ways:
            marking, way = ways.pop()
            if not (marking ^ now) & memory & ~(marking & forgotten):
                for t in way:
                    self.kinds[self.built.steps[self.net.transitions[t].name].kind] += 1
                    if self._fires(t):
                        fired.remove(self._fires(t))
                return marking
            for t in reversed(allowed):
                if self.is_firable(marking & self.near[t], t):
                    after = self.player.fire(marking, (t,))
                    if after not in seen and len(seen) < _MARKINGS_MAX:
                        seen.add(after)
                        ways.append((after, [*way, t]))
        changed = f"{self.net.names(first & ~now & memory)} -> {self.net.names(now & ~first & memory)}"
        raise AssertionError(f"no firings of the net lead to {changed}")

    def _is_wanted(self, t: int, now: Marking, new: Marking) -> bool:
        """Whether what a step asks for, requests, promises or ends is asked for, promised or ended then."""
        masks = self.net.masks[t]
        if self.promises & (masks.inputs & now | masks.outputs & ~now):
            return False
        kind, about = (
            self.built.steps[self.net.transitions[t].name].kind,
            self.net.transitions[t].name.partition("/")[2],
        )
        if kind == "ask":
            return bool(self.net.marking([asked(about)]) & now)
        return kind != "request" or bool(self.net.marking([f"promised/{about}"]) & new)

    def _fires(self, t: int) -> str:
        return self.built.steps[self.net.transitions[t].name].fires

    def _is_firable(self, marking: Marking, t: int) -> bool:
        return firable(BOOL, self.net, t, holds_in(marking))

    # --- What is sent

    def _check_sent(self, was: Marking, now: Marking, message: Message, rounds: Rounds) -> None:
        """Check that the net may send what was sent, where the act has led; a vote is repeated before it is obeyed."""
        opened = rounds.get(getattr(message, "round", -1))
        c = message.controller
        its = self._concerned(opened, c) if opened is not None else []
        match message:
            case VoteRequest(transitions=transitions):
                assert set(transitions) <= set(its), message
                self._may_send(now, [f"send-request/{t}/{c}" for t in transitions], message)
            case Vote(promised=promised) if opened is not None:
                asks = self.net.marking(at("request", self.part[t, c]) for t in promised)
                stands = was if self.net.marking(at("promised", self.part[t, c]) for t in promised) & ~now else now
                self._may_send(stands | asks, [f"promise/{t}/{c}/again" for t in promised], message)
            case Decision(committed=commit) if opened is not None:
                orders = [f"order-{'commit' if t == commit else 'abort'}/{t}/{c}" for t in its]
                self._may_send(now, orders, message)
            case Decision(committed=commit):
                assert commit is None, f"{message} of a round that is not open"
            case Acknowledgement() if opened is not None:
                names = {at("obeyed", self.part[t, c]) for t in its}
                assert names <= set(self.net.names(now)), f"{message} before it has obeyed"

    def _check_told(self, was: Marking, then: Marking, message: ToCoordinator) -> None:
        """Check that a report says yes of free parts that may vote then, or of which the vote stands."""
        for t in message.readiness.transitions:
            if (part := self.part.get((t, message.controller))) is None or not part.free:
                continue
            if self.decider[t] == message.coordinator and not was & then & self.net.marking([at("stands", part)]):
                self._may_send(then & ~self.stands, [f"stand/{t}/{message.controller}"], message)

    def _may_send(self, marking: Marking, names: list[str], message: Message) -> None:
        for name in names:
            assert name in self.net.transition_index, f"{message}: the net has no '{name}'"
            t = self.net.transition_index[name]
            assert self.is_firable(marking & self.near[t], t), f"{message}: '{name}' is not firable"


def _has_obeyed(kept: Kept, number: int, coordinator: str) -> bool:
    """Whether a controller knows for good that a round is over; by hearsay it may know more."""
    match kept.get(closed_key(coordinator)):
        case [int(below), [*numbers]]:
            return number < below or number in numbers
    return False
