"""That the net which the dead leave stands for the protocol without them: `dead.smt2` stated anew, byte for byte.

The second text of `firable.decompose.protocol.dead_script`, over the protocol's net and the nets that are left as the
checker has made them itself. What a part would disturb is asked of the protocol in which every part promises: one that
is free of promise is in the way of the same, but only while it is behind. docs/protocol.md has the obligations and the
form of the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from firable.decompose.verification.bereft import Wake, wakes
from firable.decompose.verification.voting import HOME, Part, Step, Voting, central
from firable.decompose.verification.voting_obligations import (
    INVARIANT,
    Obligations,
    after,
    conjunction,
    cube,
    defined,
    demanded,
    disjunction,
    eq1,
    sentence_text,
    symbol,
    where_possible,
)

FILE: Final = "dead.smt2"
KINDS: Final = {
    "starts": "at the start, the invariant holds, and promises stand",
    "keeps": "after the step, they still do",
    "home": "a round of the living can be brought to its end",
    "homeward": "the step leaves less to be done",
    "way": "what the central net can fire, and nothing is in the way of, is fired by these steps",
    "at-once": "nobody but the dead fires what stands still at once",
    "undisturbed": "what goes on in the net that is left finds nothing in its way",
    "promised": "a promise to the dead, or a part that is behind, is one that the net that is left may hold",
}
"""The kinds of obligations, and what each says."""
OF_ONE: Final = ("at-once", "undisturbed", "promised")
"""Those that are of one who is dead; the others are of all."""

_STANDS: Final = "|a promise stands|"


@dataclass(frozen=True)
class OutageObligations(Obligations):
    """The file on all who can be dead, of the protocol of a net under faults."""

    kinds = KINDS
    assumed = (INVARIANT, _STANDS)

    @cached_property
    def _promising(self) -> Voting:
        """The protocol in which every part promises."""
        return replace(self.voting, free=frozenset())

    @property
    def family(self) -> str:
        """The name of the file."""
        return "dead"

    @cached_property
    def wakes(self) -> tuple[Wake, ...]:
        """Everybody who can be dead, in the order of the names."""
        return tuple(sorted(wakes(self._promising, self.voting.free), key=lambda wake: wake.name))

    def _head(self) -> Iterator[str]:
        yield from self._declared(": what goes on without the dead goes on in it", "QF_UF")
        yield from defined({INVARIANT: conjunction(map(sentence_text, self._invariant))})
        yield from defined({_STANDS: conjunction(self._standing)})
        yield from defined({name: sentence_text(fact) for fact, name in self._facts.items()})
        yield from defined(
            {self._open_round(group): disjunction(map(symbol, self._memory(group))) for group in self._groups}
        )
        yield from self._given()

    @cached_property
    def _blocks(self) -> tuple[tuple[str, list[str]], ...]:
        return (
            ("starts", [cube(self.voting.places.items()), f"(not (and {INVARIANT} {_STANDS}))"]),
            *self._kept(),
            *self._rounds(),
            *self._leading(),
            *self._all_ways(),
            *(block for wake in self.wakes for block in self._of(wake)),
        )

    # --- What stands, and what is open

    @cached_property
    def _promises(self) -> dict[tuple[str, bool], set[str]]:
        """For each literal that a promise needs, the sentences that say so."""
        found: dict[tuple[str, bool], set[str]] = {}
        for part in (part for part in self.voting.all_parts if not part.free):
            mates = {u for u in self.voting.group_of[part.whole] if u != part.whole}
            its = [p for u in mates for p in self.voting.parts[u] if p.controller == part.controller]
            moved = {place for mate in its for place in mate.writes}
            for need in (need for need in eq1(part.own) if need[0] not in moved):
                sentence = frozenset([frozenset([(part.at("promised"), False)]), frozenset([need])])
                for literal in ((part.at("promised"), False), need):
                    found.setdefault(literal, set()).add(sentence_text(sentence))
        return found

    @property
    def _standing(self) -> set[str]:
        return {sentence for sentences in self._promises.values() for sentence in sentences}

    @cached_property
    def _groups(self) -> list[tuple[str, ...]]:
        return sorted(self.voting.groups, key="+".join)

    def _memory(self, group: Iterable[str]) -> set[str]:
        """The places of a round, but for those that tell of votes which stand."""
        found = set[str]()
        for t in group:
            found |= {self.voting.opened(t), f"committed/{t}", self.voting.decided(t)}
            for part in self.voting.parts[t]:
                standing = ("stands", "heard") if part.free else ()
                found |= {part.at(kind) for kind in (*part.messages, *part.memory) if kind not in standing}
        return found

    @staticmethod
    def _open_round(group: Iterable[str]) -> str:
        return symbol("open " + "+".join(group))

    @cached_property
    def _parts_of(self) -> dict[str, tuple[Part, ...]]:
        return {**{part.whole: (part,) for part in self.voting.local}, **self.voting.parts}

    def _without_whom_not(self, t: str) -> set[str]:
        """Where somebody is down who has a hand in a transition."""
        found = {f"down/{part.controller}" for part in self._parts_of[t]}
        return found | ({self.voting.coordinator_down(t)} if t in self.voting.parts else set())

    def _obstacles(self, t: str) -> set[str]:
        """What others have promised, or are behind with, and a transition would disturb: formulas."""
        promises = {promise for part in self._parts_of[t] for promise in self._promising.others(part)}
        return {self._left(self._by_promise[promise]) for promise in promises}

    @cached_property
    def _by_promise(self) -> dict[str, Part]:
        return {part.at("promised"): part for part in self.voting.all_parts}

    @staticmethod
    def _left(part: Part) -> str:
        """A part is promised; or it is free of promise, and its order has not been obeyed."""
        if part.free:
            return cube([(f"committed/{part.whole}", True), (part.at("obeyed"), False)])
        return cube([(part.at("promised"), True)])

    # --- The obligations

    def _kept(self) -> Iterator[tuple[str, list[str]]]:
        written = {literal: set(texts) for literal, texts in self._promises.items()}
        for sentence in self._invariant:
            for literal in {literal for term in sentence for literal in term}:
                written.setdefault(literal, set()).add(sentence_text(sentence))
        for name, step in self.voting.steps.items():
            broken = {(place, True) for place in step.takes} | {(place, False) for place in step.puts}
            told = {text for literal in broken for text in written.get(literal, ())}
            yield f"keeps.{name}", [cube(demanded(step)), f"(not {after(step, conjunction(told))})"]

    def _rounds(self) -> Iterator[tuple[str, list[str]]]:
        homeward = [(step, self._where(step)) for step in self.voting.steps.values() if HOME in step.kind]
        for group in self._groups:
            its = self._memory(group)
            ends = [text for step, text in homeward if its & (step.takes | step.puts)]
            alive = cube((place, False) for t in group for place in self._without_whom_not(t))
            yield f"home.{'+'.join(group)}", [self._open_round(group), alive, f"(not {disjunction(ends)})"]

    def _where(self, step: Step) -> str:
        """Where a step leads home: an order does while it is not answered."""
        orders = [place for place in step.puts if place.startswith(("commit-order/", "abort-order/"))]
        answers = [(f"acknowledgement/{order.partition('/')[2]}", False) for order in orders]
        return cube([*demanded(step), *answers])

    def _all_ways(self) -> Iterator[tuple[str, list[str]]]:
        for t in sorted(self.voting.transitions, key=lambda t: t.name):
            fired = "true"
            for step, must in reversed(self.voting.way(t.name)):
                needs = [cube([need]) for need in demanded(step)]
                if must:
                    fired = conjunction([*needs, after(step, fired)])
                else:
                    fired = where_possible(step, conjunction(needs), fired)
            free = [cube([(place, False)]) for place in self._without_whom_not(t.name)]
            free += [f"(not {obstacle})" for obstacle in self._obstacles(t.name)]
            if t.name in self.voting.parts:
                free.append(f"(not {self._open_round(self.voting.group_of[t.name])})")
            can = cube((central(place), full) for place, full in eq1(t))
            yield f"way.{t.name}", [can, conjunction(free), f"(not {fired})"]

    def _of(self, wake: Wake) -> Iterator[tuple[str, list[str]]]:
        who, dead = wake.name.removeprefix("faults."), symbol(wake.down)
        firing = [step for step in self.voting.steps.values() if step.fires and wake.is_at_once(step.fires)]
        if firing:
            yield f"at-once.{who}", [dead, disjunction(cube(demanded(step)) for step in firing)]
        others = {*self.voting.coordinators_down, *(f"down/{subnet.name}" for subnet in self.voting.cut.subnets)}
        rest = [f"(not {self._open_round(group)})" for group in self._groups if wake.rests(group)]
        rest += [cube([(place, False)]) for place in others - {wake.down}]
        parts = {place: self._by_promise[part.at("promised")] for place, part in wake.promises.items()}
        held = {place: self._left(part) for place, part in parts.items()}
        left = {t.name: t for t in wake.net.transitions}
        kept = []
        for t in (t.name for t in self.voting.transitions if t.name not in wake.held_up):
            seen = [f"(not {held[place]})" for place in left[t].inhibitive if place in held]
            ways = [*self._obstacles(t), *(cube([(place, True)]) for place in self._without_whom_not(t))]
            ways += [self._open_round(self.voting.group_of[t])] if t in self.voting.parts else []
            kept.append(conjunction([*seen, disjunction(ways)]))
        if kept:
            yield f"undisturbed.{who}", [dead, conjunction(rest), disjunction(kept)]
        of = held | {place.name: cube([(central(place.name), True)]) for place in self.voting.cut.net.places}
        for place, promise in sorted(held.items()):
            name, may = place.removeprefix("held/"), []
            for act in ("behind",) if parts[place].free else ("hold", "behind"):
                holding = left[f"{act}/{name}"]
                guard = [of[p] for p in holding.permissive if p in of]
                may.append(conjunction([*guard, *(f"(not {of[p]})" for p in holding.inhibitive if p in of)]))
            yield f"promised.{who}.{name}", [promise, f"(not {disjunction(may)})"]
