"""The obligations on one protocol net as an SMT-LIB 2 file, and what z3 answers to each.

    (set-logic QF_LIA)
    (declare-const |PLACE| Bool) ...
    (define-fun |the invariant| () Bool SENTENCES)
    (define-fun |something is open| () Bool ...)
    (define-fun |to do 1| () Bool SENTENCE) ...
    (push 1) (echo "starts") ... (check-sat) (pop 1)
    (assert |the invariant|)
    (assert |votes stand|)                          where parts are free of promise
    (push 1) (echo "keeps.STEP") (assert DEMANDS) (assert (not (let (CHANGES) SENTENCES))) (check-sat) (pop 1)
    ...

A firing changes a few places to what is known, so what holds after it is the same text with these places bound by a
`let`, in which a defined name still says what it said before; no place needs a second name. Of the sentences only
those are asked in which a literal becomes false. No name of a net has a blank, so none is a defined one.

There is one spelling of each file, which docs/protocol.md defines: the checker of bundles writes it anew from the
central net alone, by a text of its own, and compares byte by byte (`firable.decompose.verification.explored`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from firable.analysis.induction.smt import Answer, in_ascii, symbol
from firable.decompose.proofs.script import Reader
from firable.decompose.protocol.building import ProtocolNet
from firable.decompose.protocol.completeness import way
from firable.decompose.protocol.divergence import REPEATING, weights
from firable.decompose.protocol.draft import ASTRAY, OUTSIDE, at, central
from firable.decompose.protocol.inductive import (
    Literal,
    Sentence,
    demands,
    effect,
    homeward,
    invariant,
    may_go_on,
    negated,
    persistent,
    still_to_be_done,
    touched,
)
from firable.decompose.protocol.rounds import committed, decided
from firable.nets.net import Transition
from firable.nets.source import printable

LOGIC: Final = "(set-logic QF_LIA)"
INVARIANT: Final = "|the invariant|"
PERSISTENT: Final = "|votes stand|"
OPEN: Final = "|something is open|"
_HEAD: Final = (
    "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
    "The constants: a place of the protocol's net holds a token; `let` says what a step changes.",
    "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
)
GIVEN: Final = (
    "; Given of the marking that the central net then has; the verdicts `persistent` of the same net show it."
)
SAYS: Final = {
    "starts": "the invariant holds at the start",
    "keeps": "the step keeps the invariant",
    "follows": "whatever fires, the central net can fire",
    "agrees": "where no order is on its way, the controllers hold the central marking",
    "orders-fit": "an order finds its part firable, or free of promise with inputs full and outputs empty",
    "one-token": "the step fills a full place only where the central net has contact, or an order takes the token",
    "home": "without faults, a step homeward can be taken, or all is at rest",
    "homeward": "the step leaves less to be done",
    "way": "from rest, what the central net can fire is fired by these steps",
    "divergence": "every step that fires nothing, but for repeating and giving up, lowers the weighted sum",
}
"""What each kind of obligation says, in the order of the file."""

RESTS_ON: Final = {
    "follows": ("starts", "keeps", "follows"),
    "agrees": ("starts", "keeps", "agrees"),
    "orders-fit": ("starts", "keeps", "orders-fit"),
    "complete": ("starts", "keeps", "follows", "home", "homeward", "way"),
    "resumes": ("starts", "keeps", "follows", "home", "homeward", "way"),
    "one-token": ("starts", "keeps", "one-token"),
    "divergence": ("divergence",),
}
"""For each verdict, the kinds of obligations that show it."""

VOTING: Final = frozenset({"stand", "repeat"})
"""The kinds of steps on a way to a firing that are left out where they were taken before; so is hearing of them."""


def all_of(texts: Iterable[str]) -> str:
    """The AND of some formulas, each once, in the order of their texts."""
    some = sorted(set(texts))
    return f"(and {' '.join(some)})" if len(some) > 1 else "".join(some) or "true"


def any_of(texts: Iterable[str]) -> str:
    """The OR of some formulas, each once, in the order of their texts."""
    some = sorted(set(texts))
    return f"(or {' '.join(some)})" if len(some) > 1 else "".join(some) or "false"


def literal(of: Literal) -> str:
    """A place that is full, or empty."""
    return symbol(of[0]) if of[1] else f"(not {symbol(of[0])})"


def sentence(of: Sentence) -> str:
    """An OR of ANDs."""
    return any_of(all_of(map(literal, term)) for term in of)


def after(changes: Mapping[str, bool], text: str) -> str:
    """What a formula says when these places have changed."""
    bound = " ".join(sorted(f"({symbol(place)} {str(full).lower()})" for place, full in changes.items()))
    return f"(let ({bound}) {text})" if bound else text


def tried(step: Transition, text: str) -> str:
    """What a formula says when a step has been taken, if it may be: as of votes that stand, or are given now."""
    may = all_of(map(literal, demands(step)))
    bound = [f"({symbol(p)} {any_of([symbol(p), may])})" for p in step.outputs]
    bound += [f"({symbol(p)} {all_of([symbol(p), f'(not {may})'])})" for p in step.inputs]
    return f"(let ({' '.join(sorted(bound))}) {text})"


def fired_by_its_way(protocol: ProtocolNet, t: str) -> str:
    """That the steps of its way can be taken one after the other; those of votes that stand, where they can be."""
    unasked = {at("hear", part) for part in protocol.parts.coordinated.get(t, ()) if part.free}
    text = "true"
    for name in reversed(way(protocol, t) or ()):
        step = protocol.net.transition(name)
        if protocol.steps[name].kind in VOTING or name in unasked:
            text = tried(step, text)
        else:
            text = all_of([*map(literal, demands(step)), after(effect(step), text)])
    return text


def declared(protocol: ProtocolNet, says: str, logic: str) -> list[str]:
    """The lines with which a file on a protocol net begins: what it says, and a constant for each place."""
    places = sorted(place.name for place in protocol.net.places)
    comments = (f"; {printable(line)}" for line in (says, *_HEAD))
    return [*comments, logic, *(f"(declare-const {symbol(place)} Bool)" for place in places)]


def defined(name: str, text: str) -> str:
    """The line that defines a formula by its name."""
    return f"(define-fun {name} () Bool {text})"


def obligation(kinds: Mapping[str, str], name: str, asserted: Iterable[str]) -> str:
    """One obligation; the word before the first point of its name is its kind."""
    lines = [f"; {kinds[name.partition('.')[0]]}", "(push 1)", f'(echo "{in_ascii(name)}")']
    lines += [f"(assert {text})" for text in asserted]
    return "\n" + "\n".join([*lines, "(check-sat)", "(pop 1)"]) + "\n"


@dataclass(frozen=True)
class Obligations:
    """The obligations on one protocol net; under faults those on its tokens and on what is busy for ever are left out.

    The name of an obligation is its kind, and where there are several, a point and the step or transition. Raises
    `ValueError` for a protocol without rounds.
    """

    protocol: ProtocolNet

    def __post_init__(self) -> None:
        if not self.protocol.variant.acknowledged:
            raise ValueError("only of the protocol with rounds is it known what holds of every configuration")

    @cached_property
    def invariant(self) -> tuple[Sentence, ...]:
        """What holds of every configuration."""
        return tuple(invariant(self.protocol))

    @cached_property
    def given(self) -> str:
        """What is given of the marking of the central net, as an assertion; nothing where every part promises."""
        return f"(assert {PERSISTENT})\n" if any(True for _ in persistent(self.protocol)) else ""

    @cached_property
    def facts(self) -> dict[Sentence, str]:
        """What is still to be done, in the order of the texts, each with its symbol."""
        some = sorted(set(still_to_be_done(self.protocol)), key=sentence)
        return {fact: f"|to do {i}|" for i, fact in enumerate(some, 1)}

    @cached_property
    def steps(self) -> list[Transition]:
        """The steps in the order of their names."""
        return sorted(self.protocol.net.transitions, key=lambda t: t.name)

    def beginning(self) -> str:
        """The head of the file, up to the first obligation."""
        protocol = self.protocol
        family = "faults" if protocol.faults else "explored"
        under = ", under faults" if protocol.faults else ""
        says = f"{family} of the protocol of '{protocol.parts.net.name}'{under}: it does what the central net does"
        lines = declared(protocol, says, LOGIC)
        lines.append(defined(INVARIANT, all_of(map(sentence, self.invariant))))
        if self.given:
            lines += [GIVEN, defined(PERSISTENT, all_of(map(sentence, persistent(protocol))))]
        lines.append(defined(OPEN, self._open))
        lines += [defined(name, sentence(fact)) for fact, name in self.facts.items()]
        return "\n".join(lines) + "\n"

    def starts(self) -> str:
        """The one obligation of which the invariant is not assumed."""
        literals = ((place.name, place.marked) for place in self.protocol.net.places)
        return _block("starts", [all_of(map(literal, literals)), f"(not {INVARIANT})"])

    def blocks(self) -> Iterator[str]:
        """The other obligations."""
        yield from self._keeping()
        yield from self._safe()
        if not self.protocol.faults:
            yield from self._tokens()
        yield from self._home()
        yield from self._ways()
        if not self.protocol.faults:
            yield _block("divergence", [f"(not {all_of(self._falling())})"])

    def _keeping(self) -> Iterator[str]:
        texts, at = {one: sentence(one) for one in self.invariant}, touched(self.invariant)
        for t in self.steps:
            changes = effect(t)
            goals = (texts[one] for of in changes.items() for one in at[negated(of)])
            asked = [all_of(map(literal, demands(t))), f"(not {after(changes, all_of(goals))})"]
            yield _block(f"keeps.{t.name}", asked)

    def _safe(self) -> Iterator[str]:
        parts = self.protocol.parts
        yield _block("follows", [symbol(ASTRAY)])
        closed = [literal((decided(parts, group[0]), False)) for group in parts.groups]
        yield _block("agrees", [all_of(closed), self._differs])
        unfit = []
        for part in (part for its in parts.coordinated.values() for part in its):
            wrong = [(place, False) for place in (*part.inputs, *part.permissive)]
            wrong += [(place, True) for place in (*part.outputs, *part.inhibitive)]
            there = [(at("commit-order", part), True), (at("promised", part), True)]
            if part.free:
                wrong = [(place, False) for place in (at("stands", part), *part.inputs)]
                wrong += [(place, True) for place in part.outputs]
                there[1] = (at("obeyed", part), False)
            unfit.append(all_of([*map(literal, there), any_of(map(literal, wrong))]))
        if unfit:
            yield _block("orders-fit", [any_of(unfit)])

    @cached_property
    def _differs(self) -> str:
        """Some controller holds another token than the central net."""
        names = (place.name for place in self.protocol.parts.net.places)
        return any_of(f"(not (= {symbol(name)} {symbol(central(name))}))" for name in names)

    def _tokens(self) -> Iterator[str]:
        taking: dict[str, list[str]] = {}
        for part in (part for its in self.protocol.parts.coordinated.values() for part in its if part.free):
            underway = all_of([symbol(committed(part.whole)), literal((at("obeyed", part), False))])
            for place in part.inputs:
                taking.setdefault(place, []).append(underway)
        for t in self.steps:
            given = [literal((place, True)) for place in (*t.inputs, *t.permissive)]
            given += [literal((place, False)) for place in t.inhibitive]
            if fires := self.protocol.steps[t.name].fires:
                given.append(f"(not {self._contact(self.protocol.parts.net.transition(fires))})")
                given += [f"(not {underway})" for place in t.outputs for underway in taking.get(place, ())]
            if t.outputs:
                yield _block(f"one-token.{t.name}", [all_of(given), any_of(map(symbol, t.outputs))])

    def _contact(self, t: Transition) -> str:
        """The central net has contact at a transition."""
        full = [(central(place), True) for place in (*t.inputs, *t.permissive)]
        empty = [(central(place), False) for place in t.inhibitive]
        return all_of([*map(literal, full + empty), any_of(symbol(central(place)) for place in t.outputs)])

    @cached_property
    def _open(self) -> str:
        """Something is asked, promised or on its way, or the controllers differ from the central net."""
        own = {place.name for place in self.protocol.parts.net.places}
        own |= {central(name) for name in own} | self.protocol.standing
        rest = (place.name for place in self.protocol.net.places if place.name not in own and not place.marked)
        return any_of([*map(symbol, rest), self._differs])

    def _home(self) -> Iterator[str]:
        ceased = list(map(literal, may_go_on(self.protocol)))
        possible = [all_of(map(literal, (*demands(one.step), *one.where))) for one in homeward(self.protocol)]
        yield _block("home", [*ceased, OPEN, f"(not {any_of(possible)})"])
        for name, asked in self.leading():
            yield _block(name, asked)

    def leading(self) -> Iterator[tuple[str, list[str]]]:
        """Of each step homeward that it leaves less to be done: the name, and what is asserted, over `facts`."""
        before, now, at = self.facts, {fact: sentence(fact) for fact in self.facts}, touched(self.facts)
        for one in sorted(homeward(self.protocol), key=lambda one: one.step.name):
            possible = all_of(map(literal, (*demands(one.step), *one.where)))
            changes = effect(one.step)
            risen = (fact for of in changes.items() for fact in at[of])
            fallen = (fact for of in changes.items() for fact in at[negated(of)])
            none_more = [f"(or {before[fact]} (not {now[fact]}))" for fact in risen]
            one_less = any_of(f"(and {before[fact]} (not {now[fact]}))" for fact in fallen)
            less = after(changes, all_of([*none_more, one_less]))
            yield f"homeward.{one.step.name}", [possible, f"(not {less})"]

    def _ways(self) -> Iterator[str]:
        ceased = list(map(literal, may_go_on(self.protocol)))
        for t in sorted(self.protocol.parts.transitions, key=lambda t: t.name):
            fired = fired_by_its_way(self.protocol, t.name)
            can = all_of(literal((central(place), full)) for place, full in demands(t))
            yield _block(f"way.{t.name}", [*ceased, can, f"(not {OPEN})", f"(not {fired})"])

    def _falling(self) -> Iterator[str]:
        weight = weights(self.protocol)

        def heavy(places: Iterable[str]) -> str:
            some = [str(w) if w >= 0 else f"(- {-w})" for place in sorted(places) if (w := weight.get(place, 0))]
            return f"(+ {' '.join(some)})" if len(some) > 1 else "".join(some) or "0"

        for t in self.steps:
            step = self.protocol.steps[t.name]
            if not step.fires and step.kind not in REPEATING | OUTSIDE:
                yield f"(< {heavy(t.outputs)} {heavy(t.inputs)})"


def _block(name: str, asserted: Iterable[str]) -> str:
    return obligation(SAYS, name, asserted)


@dataclass(frozen=True)
class Proof:
    """The file of the obligations on one protocol net, and the kinds of which z3 has answered not all with `unsat`."""

    text: str
    open_: frozenset[str]

    def shows(self, name: str) -> bool:
        """Whether the file shows the verdict of this name, without its family."""
        return self.open_.isdisjoint(RESTS_ON[name])


def prove_inductively(protocol: ProtocolNet, timeout_ms: int) -> Proof:
    """Ask z3 every obligation on the net of the true protocol; `timeout_ms` is for each.

    One question for each step, each in the time that a thousand sentences take: 0.3 s for the whole cell.

    >>> from firable.decompose.protocol.building import protocol_net
    >>> from firable.decompose.splitting.cut import split
    >>> from firable.nets.catalogue import family_net
    >>> proof = prove_inductively(protocol_net(split(family_net("workshop-1"))), 10_000)
    >>> sorted(proof.open_), proof.shows("complete")
    ([], True)
    """
    obligations = Obligations(protocol)
    beginning, starts = obligations.beginning(), obligations.starts()
    kept = f"\n(assert {INVARIANT})\n{obligations.given}"
    text, open_ = [beginning, starts, kept], set[str]()
    if Reader(timeout_ms, beginning).answer(starts) is not Answer.UNSAT:
        open_.add("starts")
    reader = Reader(timeout_ms, beginning + kept)
    for block in obligations.blocks():
        text.append(block)
        if reader.answer(block) is not Answer.UNSAT:
            open_.add(_kind(block))
    return Proof("".join(text), frozenset(open_))


def _kind(block: str) -> str:
    return block.partition('(echo "')[2].partition('"')[0].partition(".")[0]
