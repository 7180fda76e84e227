"""That the net which the dead leave stands for the protocol without them: its obligations, and what z3 answers.

What goes on while somebody is dead is found in a net of the size of the central one (`bereft`). Here it is tied to the
protocol's net under faults, with its parts that are free of promise, in one SMT-LIB 2 file for all who can be dead. A
part is *in the way* of another one that it would disturb while it is promised; or, where it is free of promise, while
it is behind: its transition is committed, and it has not obeyed yet. The invariant is kept (`starts`, `keeps`), and of
each configuration of that it is asked, once for all:

- `home.GROUP`: while a round is open, and its coordinator and those who take part live, it can be brought to its end;
- `homeward.STEP`: of what is still to be done, the step leaves less;
- `way.T`: where the round of T is at rest, nothing is in the way of its parts and those who take part in it live, T
  fires by the steps of its way if the central net can fire it;

and of each who can be dead:

- `at-once.WHO`: no step fires what is said to stand still at once;
- `undisturbed.WHO`: where the rounds in which the dead have no hand are at rest, and T goes on in the net that is left,
  nothing keeps T from its way;
- `promised.WHO.PART`: a promise that the dead leave is one that the net that is left may hold at this marking; so it is
  of a part free of promise that is behind.

So, by hand: the rounds in which the dead have no hand come to rest by steps of the others alone (`home`), and these end
(`homeward`; asked here too, so that this file leans on no other). What the protocol has then is a marking of the net
that is left, with the promises that stand and the parts that are behind (`promised`; `astray` is empty by the
invariant), and each of its firings is one of the protocol (`undisturbed`, `way`), after which the same holds again.
What can fire again there can fire again here. What the executor does beyond the protocol's net, the signals that a
promise holds still and the rounds that a coordinator does not open, is argued in docs/protocol.md.

The invariant is that of `faults.smt2`, and one sentence more: *a promise stands*, whether its round was given up or
not. Given is that votes stand, as there.
Rejected: a question for each who is dead of every step and transition, which is quadratic and shows nothing more.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from firable.analysis.induction.smt import Answer, symbol
from firable.decompose.proofs.script import LOGIC, Reader
from firable.decompose.protocol.bereft import Bereft, deaths, moved_beside
from firable.decompose.protocol.building import ProtocolNet, protocol_net
from firable.decompose.protocol.draft import at, central, channels_of, coordinator_down, down
from firable.decompose.protocol.inductive import (
    Sentence,
    demands,
    effect,
    homeward,
    implied,
    negated,
    persistent,
    touched,
)
from firable.decompose.protocol.inductive_script import (
    GIVEN,
    INVARIANT,
    PERSISTENT,
    Obligations,
    after,
    all_of,
    any_of,
    declared,
    defined,
    fired_by_its_way,
    literal,
    obligation,
    sentence,
)
from firable.decompose.protocol.parts import Part, Parts
from firable.decompose.protocol.rounds import committed, decided, is_open
from firable.decompose.protocol.variant import ANY_FAULTS, PROTOCOL
from firable.nets.decomposition import Decomposition
from firable.nets.net import Transition

FILE: Final = "dead.smt2"
STANDING: Final = "|a promise stands|"
SAYS: Final = {
    "starts": "at the start, the invariant holds, and promises stand",
    "keeps": "after the step, they still do",
    "home": "a round of the living can be brought to its end",
    "homeward": "the step leaves less to be done",
    "way": "what the central net can fire, and nothing is in the way of, is fired by these steps",
    "at-once": "nobody but the dead fires what stands still at once",
    "undisturbed": "what goes on in the net that is left finds nothing in its way",
    "promised": "a promise to the dead, or a part that is behind, is one that the net that is left may hold",
}
"""What each kind of obligation says, in the order of the file."""

_OF_PROMISING: Final = ("promised", "heard")


@dataclass(frozen=True)
class DeadObligations:
    """The obligations on all who can be dead in a decomposition."""

    decomposition: Decomposition

    @cached_property
    def protocol(self) -> ProtocolNet:
        """The protocol under any number of faults."""
        return protocol_net(self.decomposition, PROTOCOL, ANY_FAULTS)

    @cached_property
    def _rounds(self) -> Obligations:
        """What `faults.smt2` says of it."""
        return Obligations(self.protocol)

    def beginning(self) -> str:
        """The head of the file, up to the first obligation."""
        protocol = self.protocol
        says = f"dead of the protocol of '{protocol.parts.net.name}': what goes on without the dead goes on in it"
        lines = declared(protocol, says, LOGIC)
        lines.append(defined(INVARIANT, all_of(map(sentence, self._rounds.invariant))))
        lines.append(defined(STANDING, all_of(map(sentence, self._standing))))
        lines += [defined(name, sentence(fact)) for fact, name in self._rounds.facts.items()]
        lines += [defined(self._open(group), any_of(map(symbol, self._memory(group)))) for group in self._groups]
        if self._rounds.given:
            lines += [GIVEN, defined(PERSISTENT, all_of(map(sentence, persistent(protocol))))]
        return "\n".join(lines) + "\n"

    def blocks(self) -> Iterator[tuple[str, str]]:
        """Each obligation by its name. From the second one on, promises stand."""
        marked = all_of(literal((place.name, place.marked)) for place in self.protocol.net.places)
        name, block = _block("starts", [marked, f"(not (and {INVARIANT} {STANDING}))"])
        yield name, f"{block}\n(assert {INVARIANT})\n(assert {STANDING})\n{self._rounds.given}"
        for made in (self._keeping(), self._home(), self._leading(), self._ways()):
            yield from made
        for bereft in self.deaths:
            yield from self._of_one(bereft)

    @cached_property
    def deaths(self) -> tuple[Bereft, ...]:
        """Everybody who can be dead, in the order of the names."""
        some = deaths(self._promising, self.decomposition.free)
        return tuple(sorted(some, key=lambda bereft: bereft.verdict))

    @cached_property
    def _promising(self) -> Parts:
        """The parts as if each of them promised: what it would disturb then."""
        return Parts(replace(self.decomposition, free=()), PROTOCOL)

    @cached_property
    def _groups(self) -> list[tuple[str, ...]]:
        return sorted(self.protocol.parts.groups, key="+".join)

    # --- What stands, and what is open

    @cached_property
    def _standing(self) -> tuple[Sentence, ...]:
        """A promised part is firable, but for what others of its round may have moved."""
        parts, found = self.protocol.parts, list[Sentence]()
        for part in (part for t in parts.coordinated for part in parts.promising(t)):
            moved = moved_beside(parts, part)
            needs = [(place, True) for place in (*part.inputs, *part.permissive)]
            needs += [(place, False) for place in (*part.outputs, *part.inhibitive)]
            found += [implied((at("promised", part), True), need) for need in needs if need[0] not in moved]
        return tuple(dict.fromkeys(found))

    def _memory(self, group: Iterable[str]) -> Iterator[str]:
        """What is asked, promised, known or on its way in a round."""
        parts = self.protocol.parts
        for t in group:
            yield from (is_open(parts, t), committed(t), decided(parts, t))
            for part in parts.coordinated[t]:
                kinds = (*channels_of(part), "obeyed", "noted", *(() if part.free else _OF_PROMISING))
                yield from (at(kind, part) for kind in kinds)

    @staticmethod
    def _open(group: Iterable[str]) -> str:
        return symbol(f"open {'+'.join(group)}")

    def _downs(self, t: str) -> list[str]:
        """The places that hold a token while somebody is down without whom a transition does not fire."""
        parts = self.protocol.parts
        if t not in parts.coordinated:
            return [down(part.controller) for part in parts.local if part.whole == t]
        return [coordinator_down(parts.decider(t)), *(down(part.controller) for part in parts.coordinated[t])]

    def _in_the_way(self, t: str) -> set[str]:
        """What keeps a part of a transition from being promised, voted on or fired, each a formula."""
        parts = self._promising
        its = parts.coordinated.get(t) or [part for part in parts.local if part.whole == t]
        return {self._left(other) for part in its for other in parts.excluding(part)}

    def _left(self, part: Part) -> str:
        """That a part is promised, or where it is free of promise, that it is behind."""
        if (part.whole, part.controller) in self.decomposition.free:
            return all_of(map(literal, ((committed(part.whole), True), (at("obeyed", part), False))))
        return symbol(at("promised", part))

    # --- The obligations

    def _keeping(self) -> Iterator[tuple[str, str]]:
        some = (*self._rounds.invariant, *self._standing)
        texts, at_ = {one: sentence(one) for one in some}, touched(some)
        for t in sorted(self.protocol.net.transitions, key=lambda t: t.name):
            changes = effect(t)
            goals = [texts[one] for of in changes.items() for one in at_[negated(of)]]
            asserted = [all_of(map(literal, demands(t))), f"(not {after(changes, all_of(goals))})"]
            yield _block(f"keeps.{t.name}", asserted)

    def _home(self) -> Iterator[tuple[str, str]]:
        steps = list(homeward(self.protocol))
        for group in self._groups:
            its = set(self._memory(group))
            ends = [
                all_of(map(literal, (*demands(one.step), *one.where)))
                for one in steps
                if not its.isdisjoint((*one.step.inputs, *one.step.outputs))
            ]
            alive = all_of(literal((place, False)) for t in group for place in self._downs(t))
            yield _block(f"home.{'+'.join(group)}", [self._open(group), alive, f"(not {any_of(ends)})"])

    def _leading(self) -> Iterator[tuple[str, str]]:
        for name, asserted in self._rounds.leading():
            yield _block(name, asserted)

    def _ways(self) -> Iterator[tuple[str, str]]:
        parts = self.protocol.parts
        for t in sorted(parts.transitions, key=lambda t: t.name):
            fired = fired_by_its_way(self.protocol, t.name)
            can = [literal((central(place), full)) for place, full in demands(t)]
            free = [literal((place, False)) for place in self._downs(t.name)]
            free += [f"(not {obstacle})" for obstacle in self._in_the_way(t.name)]
            if t.name in parts.coordinated:
                free.append(f"(not {self._open(parts.groups[parts.group_of[t.name]])})")
            yield _block(f"way.{t.name}", [all_of(can), all_of(free), f"(not {fired})"])

    def _of_one(self, bereft: Bereft) -> Iterator[tuple[str, str]]:
        who, parts, net = bereft.verdict, self.protocol.parts, self.protocol.net
        is_down = down(bereft.who) if bereft.who else coordinator_down(bereft.coordinator)
        dead = symbol(is_down)
        firing = [u for u in net.transitions if self.protocol.steps[u.name].fires in bereft.at_once]
        if firing:
            yield _block(f"at-once.{who}", [dead, any_of(all_of(map(literal, demands(u))) for u in firing)])
        at_rest = [f"(not {self._open(group)})" for group in parts.groups if bereft.rests(group)]
        others = [*(down(subnet.name) for subnet in self.decomposition.subnets), *map(coordinator_down, parts.deciders)]
        alive = [literal((place, False)) for place in others if place != is_down]
        kept = []
        held = {f"held/{part.whole}/{part.controller}": self._left(part) for part in bereft.left}
        for t in (t for t in parts.transitions if t.name not in bereft.held_up):
            seen = [f"(not {held[p]})" for p in bereft.net.transition(t.name).inhibitive if p in held]
            ways = [*self._in_the_way(t.name), *map(symbol, self._downs(t.name))]
            ways += [self._open(g) for g in parts.groups if t.name in g]
            kept.append(all_of([*seen, any_of(ways)]))
        if kept:
            asserted = [dead, all_of([*at_rest, *alive]), any_of(kept)]
            yield _block(f"undisturbed.{who}", asserted)
        for part in sorted(bereft.left, key=lambda part: f"{part.whole}/{part.controller}"):
            name = f"{part.whole}/{part.controller}"
            acts = ("behind",) if bereft.is_free(part) else ("behind", "hold")
            may = [self._guard(bereft.net.transition(f"{act}/{name}"), held) for act in acts]
            yield _block(f"promised.{who}.{name}", [self._left(part), f"(not {any_of(may)})"])

    def _guard(self, t: Transition, held: dict[str, str]) -> str:
        """Where a transition of the net that is left may fire, said of the protocol's net."""
        of = {**held, **{place.name: symbol(central(place.name)) for place in self.protocol.parts.net.places}}
        full = [of[place] for place in t.permissive if place in of]
        return all_of([*full, *(f"(not {of[place]})" for place in t.inhibitive if place in of)])


def _block(name: str, asserted: Iterable[str]) -> tuple[str, str]:
    return name, obligation(SAYS, name, asserted)


@dataclass(frozen=True)
class DeadProof:
    """The file, and the names of the obligations that z3 has not answered with `unsat`."""

    text: str
    open_: tuple[str, ...]

    def lacks(self, bereft: Bereft) -> str:
        """Why the verdict on who is dead is not shown; empty where all that it rests on is."""
        for name in self.open_:
            kind, _, rest = name.partition(".")
            common = kind in {"starts", "keeps", "home", "homeward", "way"}
            if common or rest == bereft.verdict or (kind == "promised" and rest.startswith(f"{bereft.verdict}.")):
                return f"z3 does not show '{name}' of {FILE}"
        return ""


def prove_of_the_dead(decomposition: Decomposition, timeout_ms: int) -> DeadProof:
    """Ask z3 every obligation on who can be dead; `timeout_ms` is for each.

    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.catalogue import catalogue_net
    >>> prove_of_the_dead(split(catalogue_net("two_robots_shared")), 10_000).open_
    ()
    """
    obligations = DeadObligations(decomposition)
    beginning = obligations.beginning()
    reader, text, open_ = Reader(timeout_ms, beginning), [beginning], list[str]()
    for name, block in obligations.blocks():
        text.append(block)
        if reader.answer(block) is not Answer.UNSAT:
            open_.append(name)
    return DeadProof("".join(text), tuple(open_))
