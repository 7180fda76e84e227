"""What must be proved of the voting protocol of one net, stated anew: the whole file, byte for byte.

The second text of `firable.decompose.protocol.inductive`: the invariant and what is still to be done as tables of
words, which mean the places that `voting` gives them, and each obligation as docs/protocol.md has it. There is one such
file for a net. Whether the invariant is a good one needs no second opinion, since the solver is asked whether the steps
keep it. What has to be right here is that these are the steps of this net's protocol, and that these are the questions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

from firable.decompose.verification.formulas import spelled
from firable.decompose.verification.voting import ASTRAY, GO_ON, HOME, REPEATS, Part, Step, Voting, central
from firable.nets.net import Transition
from firable.nets.source import printable

KINDS: Final = {
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
"""The kinds of obligations, and what each says."""

_ALWAYS: Final = """
    request > asked; vote > asked; promised > asked; obeyed > asked; abort-order > asked; obeyed > decided;
    abort-order > decided; acknowledgement > obeyed; noted > obeyed; vote > promised obeyed; heard > promised;
    heard > -committed; promised > -obeyed; committed > promised obeyed; commit-order > committed;
    abort-order > -committed; abort-order > -heard
"""
"""Of each part: where the first is, one of the others is; with a minus, is not."""

_ALWAYS_OF_FREE: Final = """
    obeyed > committed; commit-order > committed; acknowledgement > obeyed; noted > obeyed; vote > stands obeyed;
    heard > stands; heard > -committed; committed > stands obeyed
"""
"""The same of one that is free of promise."""

_TO_DO: Final = """
    request; vote; asked -noted; asked -noted -acknowledgement;
    asked -noted -acknowledgement -commit-order -abort-order;
    asked -noted, asked commit-order, asked abort-order, asked acknowledgement;
    asked -noted, asked commit-order, asked abort-order;
    asked -noted, asked commit-order acknowledgement, asked abort-order acknowledgement
"""
"""Of each part, what is still to be done: one of these, of which all is so."""

_TO_DO_OF_FREE: Final = """
    vote; committed -noted; committed -noted -acknowledgement; committed -noted -acknowledgement -commit-order;
    committed -noted, committed commit-order, committed acknowledgement;
    committed -noted, committed commit-order; committed -noted, committed commit-order acknowledgement
"""
"""The same of one that is free of promise."""

_WEIGHTS: Final = {"request": 4, "commit-order": 4, "abort-order": 4, "vote": 2, "acknowledgement": 2} | dict.fromkeys(
    ("heard", "promised", "noted", "obeyed"), 1
)
_WEIGHTS_OF_FREE: Final = {"commit-order": 7, "vote": 2, "acknowledgement": 2, "stands": -3} | dict.fromkeys(
    ("heard", "noted", "obeyed"), 1
)

INVARIANT: Final = "|the invariant|"
STANDING: Final = "|votes stand|"
OPEN: Final = "|something is open|"

_HEAD: Final = (
    "Each block asserts that its sentence does not hold, so the answer `unsat` proves it.",
    "The constants: a place of the protocol's net holds a token; `let` says what a step changes.",
    "To check it with another solver: cvc5 --incremental FILE, or z3 FILE; every name is followed by `unsat`.",
)
_GIVEN: Final = "Given of the marking that the central net then has; the verdicts `persistent` of the same net show it."

Literals = frozenset[tuple[str, bool]]
Sentence = frozenset[Literals]


def _any(literals: Iterable[tuple[str, bool]]) -> Sentence:
    return frozenset(frozenset([literal]) for literal in literals)


def conjunction(texts: Iterable[str]) -> str:
    """The AND of some formulas, each once, in the order of their texts."""
    found = sorted(set(texts))
    return found[0] if len(found) == 1 else f"(and {' '.join(found)})" if found else "true"


def disjunction(texts: Iterable[str]) -> str:
    """The OR of some formulas, each once, in the order of their texts."""
    found = sorted(set(texts))
    return found[0] if len(found) == 1 else f"(or {' '.join(found)})" if found else "false"


def symbol(place: str) -> str:
    """A place as a variable of the file."""
    return f"|{spelled(place)}|"


def _literal(place: str, full: bool) -> str:
    return symbol(place) if full else f"(not {symbol(place)})"


def cube(literals: Iterable[tuple[str, bool]]) -> str:
    """All of some literals: places that are full, or empty."""
    return conjunction(_literal(*one) for one in literals)


def sentence_text(sentence: Sentence) -> str:
    """An OR of ANDs."""
    return disjunction(map(cube, sentence))


def eq1(t: Transition) -> list[tuple[str, bool]]:
    """Eq. (1) of a transition."""
    return [*((p, True) for p in (*t.inputs, *t.permissive)), *((p, False) for p in (*t.outputs, *t.inhibitive))]


def demanded(step: Step) -> list[tuple[str, bool]]:
    """The same of a step."""
    return [(place, wanted) for place, values in step.demands.items() for wanted in values]


def _changes(step: Step) -> dict[str, bool]:
    return dict.fromkeys(step.takes, False) | dict.fromkeys(step.puts, True)


def after(step: Step, text: str) -> str:
    """What a formula says after a step that is taken."""
    changes = " ".join(sorted(f"({symbol(p)} {'true' if full else 'false'})" for p, full in _changes(step).items()))
    return f"(let ({changes}) {text})" if changes else text


def where_possible(step: Step, may: str, text: str) -> str:
    """What a formula says after a step that is taken where it can be."""
    changes = {place: disjunction([symbol(place), may]) for place in step.puts}
    changes |= {place: conjunction([symbol(place), f"(not {may})"]) for place in step.takes}
    return f"(let ({' '.join(sorted(f'({symbol(place)} {then})' for place, then in changes.items()))}) {text})"


def defined(formulas: Mapping[str, str]) -> Iterator[str]:
    """The lines that define formulas by their names."""
    return (f"(define-fun {name} () Bool {text})" for name, text in formulas.items())


@dataclass(frozen=True)
class Obligations:
    """The file on the protocol of a net."""

    voting: Voting

    kinds: ClassVar[Mapping[str, str]] = KINDS
    """The kinds of its obligations, and what each says."""
    assumed: ClassVar[tuple[str, ...]] = (INVARIANT,)
    """What all obligations but the first may use."""

    @property
    def family(self) -> str:
        """The family of the verdicts that it shows, and the name of the file."""
        return "faults" if self.voting.faults else "explored"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name of each obligation, in their order."""
        return tuple(name for name, _ in self._blocks)

    @cached_property
    def text(self) -> str:
        """The file."""
        start, *others = (
            f'\n; {self.kinds[name.partition(".")[0]]}\n(push 1)\n(echo "{spelled(name)}")\n'
            + "".join(f"(assert {one})\n" for one in asserted)
            + "(check-sat)\n(pop 1)\n"
            for name, asserted in self._blocks
        )
        assumed = (*self.assumed, STANDING) if self._persistent else self.assumed
        given = "".join(f"(assert {name})\n" for name in assumed)
        return "".join((*(f"{line}\n" for line in self._head()), start, "\n", given, *others))

    def _head(self) -> Iterator[str]:
        under = ", under faults" if self.voting.faults else ""
        yield from self._declared(f"{under}: it does what the central net does", "QF_LIA")
        yield from defined({INVARIANT: conjunction(map(sentence_text, self._invariant))})
        yield from self._given()
        yield from defined({OPEN: self._open} | {name: sentence_text(fact) for fact, name in self._facts.items()})

    def _declared(self, says: str, logic: str) -> Iterator[str]:
        for comment in (f"{self.family} of the protocol of '{self.voting.cut.net.name}'{says}", *_HEAD):
            yield f"; {printable(comment)}"
        yield f"(set-logic {logic})"
        yield from (f"(declare-const {symbol(place)} Bool)" for place in sorted(self.voting.places))

    def _given(self) -> Iterator[str]:
        if self._persistent:
            yield f"; {_GIVEN}"
            yield from defined({STANDING: conjunction(map(sentence_text, self._persistent))})

    @cached_property
    def _blocks(self) -> tuple[tuple[str, list[str]], ...]:
        return (
            ("starts", [cube(self.voting.places.items()), f"(not {INVARIANT})"]),
            *self._keeping(),
            *self._safe(),
            *(() if self.voting.faults else self._tokens()),
            *self._home(),
            *self._ways(),
            *(() if self.voting.faults else [("divergence", [f"(not {conjunction(self._falling())})"])]),
        )

    # --- The invariant, and what is still to be done

    def _literals(self, part: Part, words: str) -> Literals:
        of = {"asked": f"asked/{part.whole}", "committed": f"committed/{part.whole}"}
        of["decided"] = self.voting.decided(part.whole)
        bare = ((word.removeprefix("-"), not word.startswith("-")) for word in words.split())
        return frozenset((of.get(word, part.at(word)), full) for word, full in bare)

    @cached_property
    def _invariant(self) -> tuple[Sentence, ...]:
        return tuple({*self._of_rounds(), *self._of_parts(), *self._of_markings()})

    def _of_rounds(self) -> Iterator[Sentence]:
        yield _any([(ASTRAY, False)])
        for group in self.voting.groups:
            over = self.voting.decided(group[0])
            for t in group:
                if self.voting.asks(t):
                    yield _any([(f"committed/{t}", False), (f"asked/{t}", True)])
                yield _any([(f"committed/{t}", False), (over, True)])
                yield from (_any([(f"committed/{t}", False), (f"committed/{u}", False)]) for u in group if u != t)
            if len(group) == 1:
                yield _any([(over, False), (self.voting.opened(group[0]), True)])

    def _of_parts(self) -> Iterator[Sentence]:
        for part in self.voting.all_parts:
            for rule in (_ALWAYS_OF_FREE if part.free else _ALWAYS).split(";"):
                given, then = (self._literals(part, words) for words in rule.split(">"))
                yield _any([*((place, not full) for place, full in given), *then])
            promised, needs = (part.at("promised"), False), eq1(part.own)
            if part.free:
                underway, no_vote = self._literals(part, "committed -obeyed"), (part.at("stands"), False)
                for p, full in needs:
                    yield _any([no_vote, (central(p), full)]) | {underway}
                    if p in part.writes and full == (p in part.own.inputs):
                        yield _any([no_vote, (p, full)])
                continue
            for need in needs:
                yield _any([promised, (self.voting.decided(part.whole), True), need])
                yield _any([promised, (f"committed/{part.whole}", False), need])
            yield from (_any([promised, (other, False)]) for other in self.voting.others(part))

    def _of_markings(self) -> Iterator[Sentence]:
        movers: dict[tuple[str, bool], list[Literals]] = {}
        for part in self.voting.all_parts:
            underway = self._literals(part, "committed -obeyed")
            for moved in part.writes:
                taken = moved in part.own.inputs  # then it holds a token that the central net has not any more
                movers.setdefault((moved, taken), []).append(underway)
                yield _any([*((p, not full) for p, full in underway), (central(moved), not taken)])
        for place in self.voting.cut.net.places:
            for full in (True, False):
                name = place.name
                same = _any([(name, not full), (central(name), full)])
                yield same | frozenset(movers.get((name, full), ()))

    @cached_property
    def _persistent(self) -> tuple[Sentence, ...]:
        """Of each part free of promise and whatever would take its yes back: they are never firable both."""
        found = set()
        for part in (part for part in self.voting.all_parts if part.free):
            own = part.own
            full, empty = {*own.inputs, *own.permissive}, {*own.outputs, *own.inhibitive}
            for t in self.voting.transitions:
                full_too, empty_too = full.union(t.inputs, t.permissive), empty.union(t.outputs, t.inhibitive)
                falls = not full.isdisjoint(t.inputs) or not empty.isdisjoint(t.outputs)
                if t.name != part.whole and falls and full_too.isdisjoint(empty_too):
                    full_first = [(central(p), False) for p in full_too]
                    found.add(_any([*full_first, *((central(p), True) for p in empty_too)]))
        return tuple(found)

    @cached_property
    def _facts(self) -> dict[Sentence, str]:
        return {fact: f"|to do {i}|" for i, fact in enumerate(sorted(set(self._to_do()), key=sentence_text), 1)}

    def _to_do(self) -> Iterator[Sentence]:
        for group in self.voting.groups:
            over = self.voting.decided(group[0])
            yield _any([(over, True), *((self.voting.opened(t), True) for t in group)])
            yield from (_any([(self.voting.opened(t), True)]) for t in group)
            asks = [t for t in group if self.voting.asks(t)]
            yield from (frozenset([frozenset([(f"asked/{t}", True), (over, False)])]) for t in asks)
        for part in self.voting.all_parts:
            for fact in (_TO_DO_OF_FREE if part.free else _TO_DO).split(";"):
                yield frozenset(self._literals(part, words) for words in fact.split(","))
        if self.voting.faults:
            yield from (_any([(place, True)]) for place in self._faulty())

    def _faulty(self) -> Iterator[str]:
        yield from (*self.voting.coordinators_down, "late-copy-of-old-round")
        yield from (f"down/{subnet.name}" for subnet in self.voting.cut.subnets)

    # --- The obligations

    def _keeping(self) -> Iterator[tuple[str, list[str]]]:
        written: dict[tuple[str, bool], list[str]] = {}
        for sentence in self._invariant:
            text = sentence_text(sentence)
            for literal in {literal for term in sentence for literal in term}:
                written.setdefault(literal, []).append(text)
        for name, step in self.voting.steps.items():
            broken = (text for place, full in _changes(step).items() for text in written.get((place, not full), ()))
            yield f"keeps.{name}", [cube(demanded(step)), f"(not {after(step, conjunction(broken))})"]

    def _safe(self) -> Iterator[tuple[str, list[str]]]:
        yield "follows", [symbol(ASTRAY)]
        yield "agrees", [cube((self.voting.decided(group[0]), False) for group in self.voting.groups), self._differs]
        cases = []
        for part in self.voting.all_parts:
            own = part.own
            missing = [(place, False) for place in (*own.inputs, *own.permissive)]
            in_the_way = [(place, True) for place in (*own.outputs, *own.inhibitive)]
            there = symbol(part.at("commit-order")), symbol(part.at("promised"))
            if part.free:  # only what it moves has to be as it was
                missing = [(place, False) for place in (part.at("stands"), *own.inputs)]
                in_the_way = [(place, True) for place in own.outputs]
                there = there[0], _literal(part.at("obeyed"), full=False)
            cases.append(conjunction([*there, disjunction(_literal(*one) for one in (*missing, *in_the_way))]))
        if cases:
            yield "orders-fit", [disjunction(cases)]

    @cached_property
    def _differs(self) -> str:
        pairs = ((symbol(place.name), symbol(central(place.name))) for place in self.voting.cut.net.places)
        return disjunction(f"(not (= {here} {there}))" for here, there in pairs)

    @cached_property
    def _open(self) -> str:
        net = {name for place in self.voting.cut.net.places for name in (place.name, central(place.name))}
        net |= {part.at(kind) for part in self.voting.all_parts if part.free for kind in ("stands", "heard")}
        return disjunction([*(symbol(p) for p in self.voting.places if p not in net and p != GO_ON), self._differs])

    def _tokens(self) -> Iterator[tuple[str, list[str]]]:
        for name, step in self.voting.steps.items():
            given = [*((p, True) for p in step.takes | step.full), *((p, False) for p in step.empty)]
            texts = [_literal(*one) for one in given]
            if step.fires:
                t = self.voting.cut.net.transition(step.fires)
                around = [*((p, True) for p in (*t.inputs, *t.permissive)), *((p, False) for p in t.inhibitive)]
                contact = [_literal(central(p), full) for p, full in around]
                contact.append(disjunction(symbol(central(p)) for p in t.outputs))
                texts.append(f"(not {conjunction(contact)})")
                for part in (part for part in self.voting.all_parts if part.free):
                    if not step.puts.isdisjoint(part.own.inputs):
                        texts.append(f"(not {cube(self._literals(part, 'committed -obeyed'))})")
            if step.puts:
                yield f"one-token.{name}", [conjunction(texts), disjunction(map(symbol, step.puts))]

    @property
    def _ceased(self) -> list[str]:
        return [f"(not {symbol(GO_ON)})"] if self.voting.faults else []

    def _home(self) -> Iterator[tuple[str, list[str]]]:
        yield "home", [*self._ceased, OPEN, f"(not {disjunction(self._ways_home.values())})"]
        yield from self._leading()

    @cached_property
    def _ways_home(self) -> dict[str, str]:
        """Where each step leads home."""
        ways = {}
        for name, step in self.voting.steps.items():
            if HOME in step.kind:
                orders = (p.split("/", 1) for p in step.puts if p.startswith(("commit-order/", "abort-order/")))
                ways[name] = cube([*demanded(step), *((f"acknowledgement/{part}", False) for _, part in orders)])
        return ways

    def _leading(self) -> Iterator[tuple[str, list[str]]]:
        """Each step homeward leaves less to be done."""
        at: dict[tuple[str, bool], set[Sentence]] = {}
        for fact in self._facts:
            for literal in {literal for term in fact for literal in term}:
                at.setdefault(literal, set()).add(fact)
        for name, way in self._ways_home.items():
            changes = _changes(self.voting.steps[name])
            up = {fact for place, full in changes.items() for fact in at.get((place, full), ())}
            down = {fact for place, full in changes.items() for fact in at.get((place, not full), ())}
            no_more = [f"(or {self._facts[fact]} (not {sentence_text(fact)}))" for fact in up]
            one_less = disjunction(f"(and {self._facts[fact]} (not {sentence_text(fact)}))" for fact in down)
            less = after(self.voting.steps[name], conjunction([*no_more, one_less]))
            yield f"homeward.{name}", [way, f"(not {less})"]

    def _ways(self) -> Iterator[tuple[str, list[str]]]:
        for t in sorted(self.voting.transitions, key=lambda t: t.name):
            text = "true"
            for step, must in reversed(self.voting.way(t.name)):
                needs = [_literal(*one) for one in demanded(step)]
                if must:
                    text = conjunction([*needs, after(step, text)])
                else:
                    text = where_possible(step, conjunction(needs), text)
            can = cube((central(p), full) for p, full in eq1(t))
            yield f"way.{t.name}", [*self._ceased, can, f"(not {OPEN})", f"(not {text})"]

    def _falling(self) -> Iterator[str]:
        weights = {
            part.at(kind): weight
            for part in self.voting.all_parts
            for kind, weight in (_WEIGHTS_OF_FREE if part.free else _WEIGHTS).items()
        }
        for t in self.voting.parts:
            weights |= {f"asked/{t}": -1, f"committed/{t}": 1, self.voting.decided(t): 1}
        for step in self.voting.steps.values():
            if not step.fires and REPEATS not in step.kind:
                yield f"(< {_sum(weights, step.puts)} {_sum(weights, step.takes)})"


def _sum(weights: Mapping[str, int], places: Iterable[str]) -> str:
    some = [weights[place] for place in sorted(places) if place in weights]
    texts = [str(weight) if weight >= 0 else f"(- {-weight})" for weight in some]
    return texts[0] if len(texts) == 1 else f"(+ {' '.join(texts)})" if texts else "0"
