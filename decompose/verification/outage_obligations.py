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
from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.voting import HOME, Part, Step, Voting, central
from firable.decompose.verification.voting_obligations import (
    INVARIANT,
    STANDING,
    Obligations,
    Sentence,
    where_possible,
)
from firable.nets.net import Transition
from firable.nets.source import printable

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


def _text(places: Iterable[tuple[str, bool]]) -> str:
    """All of these."""
    texts = sorted({f"|{spelled(place)}|" if full else f"(not |{spelled(place)}|)" for place, full in places})
    return _joined("and", texts, "true")


def _joined(word: str, texts: Iterable[str], of_none: str) -> str:
    some = sorted(set(texts))
    return f"({word} {' '.join(some)})" if some[1:] else some[0] if some else of_none


def _one_of(texts: Iterable[str]) -> str:
    return _joined("or", texts, "false")


def _all_of(texts: Iterable[str]) -> str:
    return _joined("and", texts, "true")


def _needs(step: Step) -> list[tuple[str, bool]]:
    return [*((p, True) for p in step.takes | step.full), *((p, False) for p in step.puts | step.empty)]


def _then(step: Step, text: str) -> str:
    moved = {**dict.fromkeys(step.takes, "false"), **dict.fromkeys(step.puts, "true")}
    changes = " ".join(sorted(f"(|{spelled(p)}| {value})" for p, value in moved.items()))
    return f"(let ({changes}) {text})" if changes else text


def _eq1(t: Transition) -> list[tuple[str, bool]]:
    return [*((p, True) for p in (*t.inputs, *t.permissive)), *((p, False) for p in (*t.outputs, *t.inhibitive))]


@dataclass(frozen=True)
class OutageObligations(Obligations):
    """The file on all who can be dead, of the protocol of a net under faults."""

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

    @cached_property
    def text(self) -> str:
        """The file."""
        start, *others = (
            f'\n; {KINDS[name.partition(".")[0]]}\n(push 1)\n(echo "{spelled(name)}")\n'
            + "".join(f"(assert {one})\n" for one in asserted)
            + "(check-sat)\n(pop 1)\n"
            for name, asserted in self._blocks
        )
        given = f"(assert {STANDING})\n" if self._persistent else ""
        return "".join((self._head(), start, f"\n(assert {INVARIANT})\n(assert {_STANDS})\n{given}", *others))

    def _head(self) -> str:
        net = self.voting.cut.net.name
        comments = (
            f"dead of the protocol of '{net}': what goes on without the dead goes on in it",
            "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
            "The constants: a place of the protocol's net holds a token; `let` says what a step changes.",
            "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
        )
        lines = [*(f"; {printable(comment)}" for comment in comments), "(set-logic QF_UF)"]
        lines += [f"(declare-const |{spelled(place)}| Bool)" for place in sorted(self.voting.places)]
        defined = {INVARIANT: _all_of(map(self._sentence, self._invariant)), _STANDS: _all_of(self._standing)}
        defined |= {symbol: self._sentence(fact) for fact, symbol in self._facts.items()}
        for group in self._groups:
            defined[self._open_round(group)] = _one_of(f"|{spelled(place)}|" for place in self._memory(group))
        lines += [f"(define-fun {name} () Bool {text})" for name, text in defined.items()]
        if self._persistent:
            given = "of the marking that the central net then has; the verdicts `persistent` of the same net show it."
            votes = _all_of(map(self._sentence, self._persistent))
            lines += [f"; Given {given}", f"(define-fun {STANDING} () Bool {votes})"]
        return "".join(f"{line}\n" for line in lines)

    @cached_property
    def _blocks(self) -> tuple[tuple[str, list[str]], ...]:
        return (
            ("starts", [_text(self.voting.places.items()), f"(not (and {INVARIANT} {_STANDS}))"]),
            *self._kept(),
            *self._rounds(),
            *self._leading(),
            *self._all_ways(),
            *(block for wake in self.wakes for block in self._of(wake)),
        )

    # --- What stands, and what is open

    @staticmethod
    def _sentence(of: Sentence) -> str:
        return _one_of(map(_text, of))

    @cached_property
    def _promises(self) -> dict[tuple[str, bool], set[str]]:
        """For each literal that a promise needs, the sentences that say so."""
        found: dict[tuple[str, bool], set[str]] = {}
        for part in (part for part in self.voting.all_parts if not part.free):
            mates = {u for u in self.voting.group_of[part.whole] if u != part.whole}
            its = [p for u in mates for p in self.voting.parts[u] if p.controller == part.controller]
            moved = {place for mate in its for place in mate.writes}
            for need in (need for need in _eq1(part.own) if need[0] not in moved):
                sentence = frozenset([frozenset([(part.at("promised"), False)]), frozenset([need])])
                for literal in ((part.at("promised"), False), need):
                    found.setdefault(literal, set()).add(self._sentence(sentence))
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
        return f"|{spelled('open ' + '+'.join(group))}|"

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
            return _text([(f"committed/{part.whole}", True), (part.at("obeyed"), False)])
        return _text([(part.at("promised"), True)])

    # --- The obligations

    def _kept(self) -> Iterator[tuple[str, list[str]]]:
        written = {literal: set(texts) for literal, texts in self._promises.items()}
        for sentence in self._invariant:
            for literal in {literal for term in sentence for literal in term}:
                written.setdefault(literal, set()).add(self._sentence(sentence))
        for name, step in self.voting.steps.items():
            broken = {(place, True) for place in step.takes} | {(place, False) for place in step.puts}
            told = {text for literal in broken for text in written.get(literal, ())}
            yield f"keeps.{name}", [_text(_needs(step)), f"(not {_then(step, _all_of(told))})"]

    def _rounds(self) -> Iterator[tuple[str, list[str]]]:
        homeward = [(step, self._where(step)) for step in self.voting.steps.values() if HOME in step.kind]
        for group in self._groups:
            its = self._memory(group)
            ends = [text for step, text in homeward if its & (step.takes | step.puts)]
            alive = _text((place, False) for t in group for place in self._without_whom_not(t))
            yield f"home.{'+'.join(group)}", [self._open_round(group), alive, f"(not {_one_of(ends)})"]

    def _where(self, step: Step) -> str:
        """Where a step leads home: an order does while it is not answered."""
        orders = [place for place in step.puts if place.startswith(("commit-order/", "abort-order/"))]
        answers = [(f"acknowledgement/{order.partition('/')[2]}", False) for order in orders]
        return _text([*_needs(step), *answers])

    def _all_ways(self) -> Iterator[tuple[str, list[str]]]:
        for t in sorted(self.voting.transitions, key=lambda t: t.name):
            fired = "true"
            for step, must in reversed(self.voting.way(t.name)):
                needs = [_text([need]) for need in _needs(step)]
                fired = _all_of([*needs, _then(step, fired)]) if must else where_possible(step, _all_of(needs), fired)
            free = [_text([(place, False)]) for place in self._without_whom_not(t.name)]
            free += [f"(not {obstacle})" for obstacle in self._obstacles(t.name)]
            if t.name in self.voting.parts:
                free.append(f"(not {self._open_round(self.voting.group_of[t.name])})")
            can = _text((central(place), full) for place, full in _eq1(t))
            yield f"way.{t.name}", [can, _all_of(free), f"(not {fired})"]

    def _of(self, wake: Wake) -> Iterator[tuple[str, list[str]]]:
        who, dead = wake.name.removeprefix("faults."), f"|{spelled(wake.down)}|"
        firing = [step for step in self.voting.steps.values() if step.fires and wake.is_at_once(step.fires)]
        if firing:
            yield f"at-once.{who}", [dead, _one_of(_text(_needs(step)) for step in firing)]
        others = {*self.voting.coordinators_down, *(f"down/{subnet.name}" for subnet in self.voting.cut.subnets)}
        rest = [f"(not {self._open_round(group)})" for group in self._groups if wake.rests(group)]
        rest += [_text([(place, False)]) for place in others - {wake.down}]
        parts = {place: self._by_promise[part.at("promised")] for place, part in wake.promises.items()}
        held = {place: self._left(part) for place, part in parts.items()}
        left = {t.name: t for t in wake.net.transitions}
        kept = []
        for t in (t.name for t in self.voting.transitions if t.name not in wake.held_up):
            seen = [f"(not {held[place]})" for place in left[t].inhibitive if place in held]
            ways = [*self._obstacles(t), *(_text([(place, True)]) for place in self._without_whom_not(t))]
            ways += [self._open_round(self.voting.group_of[t])] if t in self.voting.parts else []
            kept.append(_all_of([*seen, _one_of(ways)]))
        if kept:
            yield f"undisturbed.{who}", [dead, _all_of(rest), _one_of(kept)]
        of = held | {place.name: _text([(central(place.name), True)]) for place in self.voting.cut.net.places}
        for place, promise in sorted(held.items()):
            name, may = place.removeprefix("held/"), []
            for act in ("behind",) if parts[place].free else ("hold", "behind"):
                holding = left[f"{act}/{name}"]
                guard = [of[p] for p in holding.permissive if p in of]
                may.append(_all_of([*guard, *(f"(not {of[p]})" for p in holding.inhibitive if p in of)]))
            yield f"promised.{who}.{name}", [promise, f"(not {_one_of(may)})"]
