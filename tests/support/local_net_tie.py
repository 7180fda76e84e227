"""Each act of one controller as firings of the protocol net, told of what this machine and the message that it met say.

`net_tie` tells a whole configuration as a marking of the protocol net. Of a controller that is explored alone there is
no such configuration; but each step of the net is somebody's, and besides the messages it moves only places of whoever
takes it. So the marking is that controller's share, with the message that it met in its channel and what others hold
left empty; an act must be steps of this controller from the one share to the other, played by the reference player, or
none. Where a step fires in the central net, the copy of its places is as the controller has them: that the central net
can follow is proved of the net itself (`faults.follows`). Of coordinators nothing is told here.

The net has one round of a group at a time: what is met of a round that is over must do nothing, and where a controller
knows two rounds of a group that are not over, as after a restart of its coordinator, nothing is told (`untold`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from support.told_acts import Held

from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.draft import ASTRAY, CHANNELS, at, central
from firable.executor.protocol.controller import LocalController
from firable.executor.protocol.deciders import coordinators
from firable.executor.protocol.messages import (
    Acknowledgement,
    Decision,
    Effect,
    Firing,
    Message,
    ToCoordinator,
    Vote,
    VoteRequest,
)
from firable.executor.simulation.exploring import Explorer
from firable.executor.simulation.repertoire import Configuration, Step
from firable.nets.net import Marking
from firable.semantics.algebra import BOOL
from firable.semantics.firing import firable
from firable.semantics.player import Player, holds_in

_MARKINGS_MAX = 500


class LocalNetTie:
    """A watcher of an exploration that holds every act of a machine to firings of the protocol net."""

    def __init__(self, built: ProtocolNet) -> None:
        self.parts, self.net, self.steps = built.parts, built.net, built.steps
        self.player = Player(built.net)
        self.part = {(t, part.controller): part for t, its in self.parts.coordinated.items() for part in its}
        self.coordinators = coordinators(self.parts.decomposition)
        self.places = frozenset(place.name for place in self.parts.net.places)
        self.channels = self.net.marking(p.name for p in self.net.places if p.name.partition("/")[0] in CHANNELS)
        self.stands = self._marking(at("stands", part) for part in self.part.values() if part.free)
        self.memory: dict[str, Marking] = {}
        """The places of each controller."""
        self.changes: list[Marking] = []
        self.group: list[int] = []
        """Of each step what it changes, and the group of its transition; -1 of a local one."""
        self.moves: dict[str, list[int]] = {}
        """The steps that each of them takes."""
        for t, transition in enumerate(self.net.transitions):
            step = self.steps[transition.name]
            who = step.controller
            self.changes.append(built.net.masks[t].inputs | built.net.masks[t].outputs)
            self.group.append(self._group(transition.name))
            # Whatever is sent again, and is ignored, changes nothing that is told.
            if (
                who
                and ASTRAY not in transition.name.split("/")
                and step.kind not in ("request", "order", "ignore", "repeat")
            ):
                self.moves.setdefault(who, []).append(t)
        self.kinds: Counter[str] = Counter()
        self.untold = 0
        self.acts: set[object] = set()

    def __call__(self, explorer: Explorer, before: Configuration, step: Step, after: Configuration) -> None:
        del before, after
        if step.machine < 0:
            return
        was, now = explorer.machine(step.before), explorer.machine(step.after)
        if isinstance(was, LocalController) and isinstance(now, LocalController):
            told = tuple(e for e in step.effects if isinstance(e, Message | Firing))
            held = Held.of(explorer, step.before), Held.of(explorer, step.after)
            if (key := (*held, step.about, told, step.kind.endswith("crash"))) not in self.acts:
                self.acts.add(key)
                self._controller(*held, step, told)

    # --- A controller

    def _controller(self, was: Held, now: Held, step: Step, told: Sequence[Effect]) -> None:
        name, message = was.name, step.about if isinstance(step.about, Message) else None
        number = getattr(message, "round", -1)
        is_over = number >= 0 and _is_over(was, number, self._whose(number))
        open_ = {(n, self.parts.group_of[t]) for n, names in (*was.promises, *now.promises) for t in names}
        if isinstance(message, VoteRequest | Decision) and not is_over:
            names = message.transitions if isinstance(message, VoteRequest) else (message.committed,)
            open_ |= {(number, self.parts.group_of[t]) for t in names if t in self.parts.group_of}
        if any(count > 1 for count in Counter(group for _, group in set(open_)).values()):
            self.untold += 1
            return
        first, last = self._held(was), self._held(now)
        given_up = {n for n, names in was.promises if names and n < dict(now.closed_below)[self._whose(n)]}
        met = [] if is_over or message is None else [*self._arriving(was, message)]
        met += [at("abort-order", self.part[t, name]) for n, names in was.promises if n in given_up for t in names]
        obeyed = {
            (t, name)
            for n, names in was.promises
            for t in names
            if n in given_up or (isinstance(message, Decision) and n == number)
        }
        if isinstance(message, Decision) and (message.committed, name) in self.part and not is_over:
            obeyed.add((str(message.committed), name))
        last |= self._marking(at("obeyed", self.part[key]) for key in obeyed)
        fired = [effect.transition for effect in told if isinstance(effect, Firing)]
        start = first | self._marking(met)
        start |= self._marking(central(p) for p in was.marked if p in self.places)
        start |= self._standing(was, message, is_over=is_over)
        mine = self._own(name)
        reached = self._went(start, last, mine & ~self.stands, fired, name, step)
        if not step.kind.endswith("crash"):
            for effect in told:
                if isinstance(effect, ToCoordinator):
                    self._check_said(reached, last, effect, is_over=is_over and getattr(effect, "round", -1) == number)

    def _held(self, held: Held) -> Marking:
        tokens = [place for place in held.marked if place in self.places]
        tokens += [at("promised", self.part[t, held.name]) for _, names in held.promises for t in names]
        return self._marking(tokens)

    def _arriving(self, was: Held, message: Message) -> Iterator[str]:
        c = was.name
        match message:
            case VoteRequest(transitions=names):
                yield from (at("request", self.part[t, c]) for t in names if (t, c) in self.part)
            case Decision(committed=commit):
                if (commit, c) in self.part:
                    yield at("commit-order", self.part[str(commit), c])
                promised = dict(was.promises).get(message.round, frozenset())
                yield from (at("abort-order", self.part[t, c]) for t in promised if t != commit)

    def _standing(self, was: Held, message: Message | None, *, is_over: bool) -> Marking:
        """The vote of a free part stands that an order finds."""
        if (
            isinstance(message, Decision)
            and not is_over
            and (part := self.part.get((str(message.committed), was.name)))
        ):
            return self._marking([at("stands", part)]) if part.free else 0
        return 0

    def _check_said(self, reached: Marking, last: Marking, effect: Effect, *, is_over: bool) -> None:
        c = effect.controller if isinstance(effect, ToCoordinator) else ""
        match effect:
            case Vote(promised=promised):
                for t in promised:
                    part = self.part[t, c]
                    asked_again = reached | self._marking([at("request", part)]) & ~reached
                    sent = reached & self._marking([at("vote", part)])
                    assert sent or self._may(asked_again, f"promise/{t}/{c}/again"), f"{effect}: the net says no such"
            case Acknowledgement() if not is_over:
                orders = [at(kind, p) for (_, of), p in self.part.items() if of == c for kind in ("commit-order",)]
                assert not reached & self._marking(orders), f"{effect} before an order is obeyed"
        if isinstance(effect, ToCoordinator) and not effect.readiness.transitions.isdisjoint(
            t for (t, of), part in self.part.items() if of == c and part.free
        ):
            self._check_stands(reached, last, effect)

    def _check_stands(self, reached: Marking, last: Marking, told: ToCoordinator) -> None:
        for t in told.readiness.transitions:
            part = self.part.get((t, told.controller))
            if part is not None and part.free and not reached & self._marking([at("stands", part)]):
                words = f"stand/{t}/{told.controller}"
                assert self._may(last & ~self.channels & ~self.stands, words), f"{told}: '{words}' is not firable"

    # --- Firings

    def _went(self, first: Marking, last: Marking, memory: Marking, fired: list[str], who: str, step: Step) -> Marking:
        """A marking to which steps of a controller lead, and which holds of its memory what it holds then."""
        allowed = [t for t in self.moves.get(who, ()) if (fires := self._fires(t)) == "" or fires in fired]
        touched = {self.group[t] for t in allowed if self.changes[t] & (first ^ last) & memory}
        touched |= {self.group[t] for t in allowed if self._fires(t) or self.changes[t] & first & self.channels}
        allowed = [t for t in allowed if self.group[t] in touched]
        seen, ways = {(first, False)}, [(first, False, list[int]())]
        while ways:
            marking, has_fired, way = ways.pop()
            if not (marking ^ last) & memory and has_fired is bool(fired):
                self.kinds.update(self.steps[self.net.transitions[t].name].kind for t in way)
                return marking
            for t in allowed:
                is_fired = bool(self._fires(t))
                if not (is_fired and has_fired) and firable(BOOL, self.net, t, holds_in(marking)):
                    after = self.player.fire(marking, (t,)), has_fired or is_fired
                    if after not in seen and len(seen) < _MARKINGS_MAX:
                        seen.add(after)
                        ways.append((*after, [*way, t]))
        changed = f"{self.net.names(first & ~last & memory)} -> {self.net.names(last & ~first & memory)}, fired {fired}"
        raise AssertionError(f"{step.kind} at '{who}' of {step.about}: no firings of the net lead to {changed}")

    def _own(self, who: str) -> Marking:
        """What a controller alone knows."""
        if (known := self.memory.get(who)) is None:
            names = [place.name for place in self.parts.decomposition.subnet(who).places]
            its = [part for part in self.part.values() if part.controller == who]
            names += [at(kind, part) for part in its for kind in ("promised", "obeyed")]
            known = self.memory[who] = self._marking(names)
        return known

    def _group(self, step: str) -> int:
        return self.parts.group_of.get(step.split("/")[1], -1)

    def _fires(self, t: int) -> str:
        return self.steps[self.net.transitions[t].name].fires

    def _may(self, marking: Marking, name: str) -> bool:
        t = self.net.transition_index.get(name)
        return t is not None and firable(BOOL, self.net, t, holds_in(marking))

    def _marking(self, names: Iterable[str]) -> Marking:
        return self.net.marking(name for name in names if name in self.net.place_index)

    def _whose(self, number: int) -> str:
        return self.coordinators[number % len(self.coordinators)]


def _is_over(held: Held, number: int, coordinator: str) -> bool:
    below, numbers = dict(held.obeyed)[coordinator]
    return number < max(below, dict(held.closed_below)[coordinator]) or number in numbers
